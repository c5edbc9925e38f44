//! A simulated machine for the motion kernel: ±10 V velocity servos behind an SPI converter, with
//! encoders.
//!
//! The kernel's hardware traits are the seam. Above it runs the code that runs on a board, driver of the
//! converter included; below it are models. They are `no_std`, allocate nothing and use no platform
//! mathematics, so the closed loop gives the same bits on a PC and inside an emulated board.
//!
//! # In the order the data travels
//!
//! ```text
//! DacCode ─► motion_kernel::hal::Ad5754Output        the driver that a board uses
//!               │ 24-bit frames, one chip select each
//!               ▼
//!            Ad5754Chip      frames, input and output registers, ranges, power-up
//!               │ volts, held over the tick
//!               ▼
//!            DriveModel      dead time, velocity controller, current limit, inertia, friction, bed
//!               │ the motor's true position ───► Screw (feature `screw`): pitch error, play ───► the load's
//!               ▼
//!            SimEncoder      counts, 16- or 32-bit timer, noise
//!               │ the kernel's own CountExtender
//!               ▼
//!            Counts ─► back to the kernel
//! ```
//!
//! [`closed_loop`] runs a compiled program on it, the same way on a PC and inside an emulated board.
//! [`Injector`] breaks it on demand.
//! [`SimMachine`] holds such axes, up to four to a chip, and advances them one control tick at a time.
//!
//! # Example
//!
//! One volt on the reference X axis is 2 m/min.
//!
//! ```
//! use hal_sim::{AxisParameters, MachineParameters, SimMachine};
//! use motion_kernel::hal::{Ad5754Output, DriveEnable, Encoder, VelocityChannel};
//! use motion_kernel::units::DacCode;
//!
//! let parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X]);
//! let machine = SimMachine::<1>::new(&parameters)?;
//!
//! // The machine plays every peripheral: bus, delay timer, encoder timers, enable output.
//! let mut output = Ad5754Output::<_, 1>::setup(machine.chip(), &mut machine.chip())?;
//! let (mut encoder, mut enable) = (&machine, &machine);
//!
//! enable.set_enabled(true)?;
//! for _ in 0..1000 {
//!     let _counts = encoder.latch()?; // a regulator would use these
//!     output.write(&[DacCode::from_volts(1.0_f64)])?;
//!     machine.advance();
//! }
//! let [axis] = machine.truth();
//! assert!((axis.velocity_mm_s - 2000.0 / 60.0).abs() < 0.01);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Accuracy of the drive model
//!
//! S4 published measurements of a machine and no model. [`REFERENCE_X`] and [`REFERENCE_Y`] were fitted so
//! that the measurements come out together; the crate's tests hold the fit's figures:
//!
//! | | S4 | model |
//! |---|---|---|
//! | velocity step to 7.2 m/min: delay, time constant \[ms\] | 2, 10 | 2.01, 9.83 |
//! | overshoot \[%\], settled after \[ms\] | 1.1, 62 | 1.12, 57 |
//! | following error at 4 Hz and 2.150 m/min, V / V+A+J feedforward \[µm\] | 11 / 4 | 10.5 / 4.2 |
//! | form deviation of a circle at 13 Hz \[µm\] | 32 | 31.5 |
//!
//! Missing: cogging, elasticity of the screw, coupling of the axes through the bed, thermal limits of the
//! motor.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod axis;
pub mod closed_loop;
mod dac_chip;
mod dac_frame;
mod dead_time;
mod drive;
mod drive_parameters;
mod encoder;
mod home;
mod injection;
mod machine;
mod noise;
mod parameter;
#[cfg(feature = "screw")]
mod screw;

pub use axis::{AxisParameters, REFERENCE_MM_S_PER_VOLT, SimAxis};
pub use dac_chip::{Ad5754Chip, CHANNELS, ChipError, POWER_UP_TIME_NS};
pub use dac_frame::OutputRange;
pub use drive::{DriveModel, DriveState, SUBSTEPS_MAX};
pub use drive_parameters::{BedMode, DriveParameters, REFERENCE_X, REFERENCE_Y, REFERENCE_Z};
pub use encoder::{EncoderNoise, EncoderParameters, REFERENCE_ENCODER, SimEncoder, TimerBits};
pub use home::{HomeParameters, IndexParameters, SimHome, SimHomes, SwitchParameters};
pub use injection::{Injection, Injector};
pub use machine::{
    AxisTruth, MachineError, MachineParameters, REFERENCE_LINE, REFERENCE_SUBSTEPS, REFERENCE_TICK_S,
    SimMachine,
};
pub use parameter::ParameterError;
#[cfg(feature = "screw")]
pub use screw::{PitchErrorParameters, ScrewParameters};
