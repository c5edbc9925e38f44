//! The link's bytes: USART2, over DMA in both directions.
//!
//! Consumes frames of the background, one at a time; produces the bytes of ST-LINK's serial port. Receives into a ring that
//! the background reads, and sends from a buffer of its own; the tick has no part in it, and nothing waits. What is lost here
//! is counted where it is noticed, and the link's checksums find the rest.
//!
//! Streams and channel: RM0390, table 28 (DMA1 request mapping), which the HAL's types repeat. A stream that is enabled works
//! beside the processor, which the compiler can't see: that is the `unsafe` of this file.
#![allow(unsafe_code)]

use core::sync::atomic::{AtomicU8, Ordering};

use cortex_m::{asm, singleton};
use motion_kernel::link::FRAME_MAX;
use nucleo_f446re::design_parameters::LINK_RING;
use nucleo_f446re::receive_ring::ReceiveRing;
use stm32f4xx_hal::dma::config::Priority;
use stm32f4xx_hal::dma::traits::{DMASet, Stream};
use stm32f4xx_hal::dma::{
    DmaChannel, DmaDirection, DmaFlag, MemoryToPeripheral, PeripheralToMemory, Stream5, Stream6, StreamsTuple,
};
use stm32f4xx_hal::pac::{DMA1, USART2};
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::Serial;
use stm32f4xx_hal::{ClearFlags, ReadFlags};

/// What has come. Atomic, because the DMA writes to it.
static RING: [AtomicU8; LINK_RING] = [const { AtomicU8::new(0) }; LINK_RING];

/// The channel of both streams.
const CHANNEL: DmaChannel = DmaChannel::Channel4;

/// Compiles for what the table has.
const fn is_mapped<S, D>()
where
    USART2: DMASet<S, 4, D>,
{
}
const _: () = is_mapped::<Stream5<DMA1>, PeripheralToMemory>();
const _: () = is_mapped::<Stream6<DMA1>, MemoryToPeripheral>();

/// Both ends of the line.
pub(crate) struct LinkPort {
    port: USART2,
    receiver: Stream5<DMA1>,
    ring: ReceiveRing<LINK_RING>,
    sender: Stream6<DMA1>,
    /// What is being sent.
    frame: &'static mut [u8; FRAME_MAX],
}

impl LinkPort {
    /// The port behind `serial`, which is set up for DMA in both directions. It receives from now on.
    pub(crate) fn new(serial: Serial<USART2>, dma: DMA1, rcc: &mut Rcc) -> Self {
        let (port, _) = serial.release();
        let frame: &'static mut [u8; FRAME_MAX] =
            defmt::unwrap!(singleton!(: [u8; FRAME_MAX] = [0; FRAME_MAX]));
        let data = port.dr().as_ptr() as u32;
        let StreamsTuple(_, _, _, _, _, mut receiver, mut sender, _) = StreamsTuple::new(dma, rcc);
        // As after a reset: bytes on both sides, without the FIFO.
        receiver.set_channel(CHANNEL);
        receiver.set_direction(DmaDirection::PeripheralToMemory);
        receiver.set_peripheral_address(data);
        receiver.set_memory_address(RING.as_ptr() as u32);
        receiver.set_number_of_transfers(LINK_RING as u16);
        receiver.set_memory_increment(true);
        receiver.set_circular_mode(true);
        // A byte that is not fetched in time is lost; one that is sent late is not.
        receiver.set_priority(Priority::High);
        // Sound: it writes to the ring and nowhere else, forever, and the ring's bytes are atomic.
        unsafe { receiver.enable() };
        sender.set_channel(CHANNEL);
        sender.set_direction(DmaDirection::MemoryToPeripheral);
        sender.set_peripheral_address(data);
        sender.set_memory_address(frame.as_ptr() as u32);
        sender.set_memory_increment(true);
        Self { port, receiver, ring: ReceiveRing::new(), sender, frame }
    }

    /// The divider of the clock that makes the baud rate.
    pub(crate) fn divider(&self) -> u32 {
        self.port.brr().read().bits().into()
    }

    /// Where the DMA writes next.
    fn at(&self) -> usize {
        LINK_RING - usize::from(self.receiver.number_of_transfers())
    }

    /// Whether a byte has come since the start.
    pub(crate) fn has_come(&self) -> bool {
        self.at() != 0
    }

    /// How often bytes were given up because the background did not read them in time.
    pub(crate) fn lost(&self) -> u32 {
        self.ring.lost()
    }

    /// The next byte, in the order in which they came.
    pub(crate) fn next_byte(&mut self) -> Option<u8> {
        let place = match self.ring.next_place() {
            Some(place) => place,
            None => {
                let has_passed = [DmaFlag::HalfTransfer, DmaFlag::TransferComplete].map(|flag| {
                    let is_set = self.receiver.flags().contains(flag);
                    if is_set {
                        self.receiver.clear_flags(flag);
                    }
                    is_set
                });
                self.ring.look(self.at(), has_passed);
                // The bytes are read after the place.
                asm::dmb();
                self.ring.next_place()?
            }
        };
        RING.get(place).map(|byte| byte.load(Ordering::Relaxed))
    }

    /// Sends what `write` writes: so many bytes, 0 for none. It is not asked while the frame before is under way.
    pub(crate) fn send(&mut self, write: impl FnOnce(&mut [u8]) -> usize) {
        // A stream ends by itself (RM0390, DMA_SxCR, EN).
        if self.sender.is_enabled() {
            return;
        }
        let length = write(&mut *self.frame);
        if length == 0 {
            return;
        }
        // Flags of the transfer before would keep the stream from being enabled.
        self.sender.clear_all_flags();
        // Shorter than 2^16.
        self.sender.set_number_of_transfers(length.min(FRAME_MAX) as u16);
        // The frame is written before the DMA reads it.
        asm::dmb();
        // Sound: it reads the frame, which nothing changes until the stream has ended.
        unsafe { self.sender.enable() };
    }
}
