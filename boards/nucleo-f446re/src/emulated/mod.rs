//! The board as QEMU's `netduinoplus2` has it (STM32F405): the firmware runs there with these files in the place of
//! the board's own.
//!
//! QEMU has the processor, its interrupts and SysTick, SPI2 and USART2. It has no clock control, no pins, no
//! watchdog, no DMA, and timers that do not count encoders. So here
//!
//! - SysTick makes the ticks, and pends the interrupt of TIM7;
//! - whatever goes over SPI2 also goes, frame by frame, to the model of the converter in `hal-sim`, whose voltages
//!   move modelled drives, whose encoders the next tick reads: the loop is closed through the frames;
//! - a script presses the button and opens the emergency stop; letters come over the emulated USART2;
//! - the log goes to the emulator's output.
//!
//! Between two ticks the model takes no time: SysTick stands still for it, and with it all that the firmware knows of
//! time.
//!
//! | line | what |
//! |---|---|
//! | `TICK …` | a line of the log |
//! | `interrupt CYCLES` | cycles of the emulated processor from the timer's event to the end of the tick's interrupt |
//! | `model: …` | what the model has seen |

pub(crate) mod board;
pub(crate) mod emergency_stop;
pub(crate) mod encoders;
#[cfg(feature = "link")]
pub(crate) mod link_port;
pub(crate) mod tick_timer;
#[cfg(feature = "link")]
mod flash;
mod model;
mod script;
mod wires;
