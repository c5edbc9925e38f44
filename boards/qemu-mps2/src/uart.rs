//! UART 0 of an MPS2 board, by which a PC drives it: the APB UART of the Cortex-M System Design Kit (Arm DDI 0479, "APB
//! UART"). Its address and its interrupt are those of the application notes AN385 and AN386.
//!
//! It holds one byte each way. What comes is taken by an interrupt into a queue, from which the background has it. Where the
//! queue is full the interrupt is masked until there is room, and the byte stays in the UART: the emulator holds back what
//! comes after it, so nothing is lost.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};
use motion_kernel::link::FRAME_MAX;

/// The number of the interrupt that is to call [`receive`]: a byte has come.
pub const INTERRUPT: u16 = 0;
/// Bytes that the background may be late for.
const RECEIVED: usize = 4096;
/// Below the tick, which has the greatest priority, 0.
const PRIORITY: u8 = 0x80;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const INTERRUPT_STATUS: *mut u32 = 0x4000_400C as *mut u32;
const BAUD_DIVISOR: *mut u32 = 0x4000_4010 as *mut u32;
/// Bits of the state: no room for a byte to send; a byte has come.
const IS_TRANSMIT_FULL: u32 = 1 << 0;
const IS_RECEIVE_FULL: u32 = 1 << 1;
/// Bits of the control: sends, receives, interrupts when a byte has come.
const SENDS: u32 = 1 << 0;
const RECEIVES: u32 = 1 << 1;
const INTERRUPTS: u32 = 1 << 3;
/// Bit of the interrupt's status, which is cleared by writing it: a byte has come.
const HAS_COME: u32 = 1 << 1;
/// The least. The emulator sends as fast as it can, whatever the rate.
const DIVISOR: u32 = 16;

fn read(register: *mut u32) -> u32 {
    // Sound: a register of the UART, which this module alone uses.
    unsafe { register.read_volatile() }
}

fn write(register: *mut u32, value: u32) {
    // Sound: as above.
    unsafe { register.write_volatile(value) }
}

/// The interrupt for a byte that has come.
#[derive(Clone, Copy)]
struct HasCome;

// Sound: always the same number.
unsafe impl InterruptNumber for HasCome {
    fn number(self) -> u16 {
        INTERRUPT
    }
}

/// What the interrupt owns.
static QUEUE: Mutex<Cell<Option<Producer<'static, u8>>>> = Mutex::new(Cell::new(None));
/// The queue was full, and the interrupt is masked.
static IS_MASKED: AtomicBool = AtomicBool::new(false);

/// The interrupt.
pub fn receive() {
    critical_section::with(|cs| {
        let place = QUEUE.borrow(cs);
        let Some(mut queue) = place.take() else { return };
        while read(STATE) & IS_RECEIVE_FULL != 0 {
            if !queue.ready() {
                IS_MASKED.store(true, Ordering::Relaxed);
                NVIC::mask(HasCome);
                break;
            }
            // Before the byte is read: the next one may come right after that.
            write(INTERRUPT_STATUS, HAS_COME);
            // There is room.
            let _ = queue.enqueue(read(DATA) as u8);
        }
        place.set(Some(queue));
    });
}

/// The background's part: bytes that came, and a frame on its way out.
pub struct Port {
    received: Consumer<'static, u8>,
    frame: [u8; FRAME_MAX],
    length: usize,
    sent: usize,
}

impl Port {
    /// Starts the UART. None if it was started before.
    pub fn start(nvic: &mut NVIC) -> Option<Self> {
        let (producer, received) = crate::singleton!(Queue<u8, RECEIVED> = Queue::new())?.split();
        critical_section::with(|cs| QUEUE.borrow(cs).set(Some(producer)));
        write(BAUD_DIVISOR, DIVISOR);
        write(CONTROL, SENDS | RECEIVES | INTERRUPTS);
        // Sound: nothing relies on the interrupt's priority, nor on its being masked.
        unsafe {
            nvic.set_priority(HasCome, PRIORITY);
            NVIC::unmask(HasCome);
        }
        Some(Self { received, frame: [0; FRAME_MAX], length: 0, sent: 0 })
    }

    /// The next byte that came.
    pub fn next_byte(&mut self) -> Option<u8> {
        let byte = self.received.dequeue();
        if IS_MASKED.load(Ordering::Relaxed) {
            IS_MASKED.store(false, Ordering::Relaxed);
            // Sound: as at the start.
            unsafe { NVIC::unmask(HasCome) };
        }
        byte
    }

    /// Whether bytes came that were not taken.
    pub fn has_bytes(&self) -> bool {
        self.received.ready()
    }

    /// Sends what the UART takes now, and asks `next_frame` for another frame where the one before has gone. Whether anything
    /// was sent.
    pub fn send(&mut self, next_frame: impl FnOnce(&mut [u8]) -> usize) -> bool {
        if self.sent >= self.length {
            (self.length, self.sent) = (next_frame(&mut self.frame), 0);
        }
        let before = self.sent;
        while let Some(&byte) = self.frame.get(..self.length).and_then(|frame| frame.get(self.sent))
            && read(STATE) & IS_TRANSMIT_FULL == 0
        {
            write(DATA, byte.into());
            self.sent += 1;
        }
        self.sent > before
    }
}
