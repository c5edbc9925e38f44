//! Estimated cycles of a Cortex-M4, with memory that never waits and with a slow flash, from a trace of the instructions an
//! emulator executed and the timing tables that ARM publishes. Nothing here is a measurement: the emulator
//! has no pipeline, the tables have no memory system.
//!
//! ```text
//!   mnemonic      which row of the tables an instruction belongs to         Row
//!   instruction   a line of disassembly ─► row, width, registers            Instruction
//!   price         row, branch taken?, instruction before it ─► cycles       Cost
//!   flash         addresses in their order ─► cycles that memory waits      Cost
//!   trace         the emulator's log, as it is written ─► one per call      Estimate
//! ```
//!
//! Sections and tables cited are those of the Cortex-M4 Technical Reference Manual r0p1 (ARM DDI 0439D).
//! What it states without a range counts on both sides. Where it leaves a range, the nominal side takes
//! what the manual calls normal or else the middle, the pessimistic side takes the upper end.
//!
//! Wait states of an STM32F446's flash are a sum of their own, and so is the interrupt around the call
//! ([`INTERRUPT`]).
//!
//! Not in either side: wait states of other memory or buses, and unaligned accesses (3.3.2 adds 1 or 2 cycles, and a
//! trace has no data addresses). An instruction that its IT block skips
//! is priced as though it ran, and a division of floats in full even where integer instructions would
//! overlap it (7.2.3): the trace tells neither.

mod flash;
mod instruction;
mod mnemonic;
mod price;
mod trace;

pub use instruction::{Instruction, UnknownInstruction};
pub use price::price;
pub use trace::{Begin, Calls, TraceError};

/// Estimated cycles of one instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// What the manual calls normal, else the middle of its range.
    pub nominal: u32,
    /// The upper end of the manual's range.
    pub pessimistic: u32,
}

impl Cost {
    const NOTHING: Self = Self { nominal: 0, pessimistic: 0 };
}

impl std::ops::Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { nominal: self.nominal + other.nominal, pessimistic: self.pessimistic + other.pessimistic }
    }
}

/// Entry into an interrupt that uses floats, over a background that does, and return from it.
///
/// The manual's entry takes 12 cycles with memory that never waits: 8 words are stacked while the vector is
/// fetched, which flash may make wait. The 17 words of floats are only given room then and stacked with the first instruction of floats:
/// lazy stacking, without which the entry takes 29 cycles (ARM's application note 298). The return loads both again, and
/// refills the pipeline, from a line of the background that was replaced on the pessimistic side.
pub const INTERRUPT: Cost = Cost { nominal: 12 + 17 + 10 + 17, pessimistic: (12 + 5) + 18 + (12 + 18 + 10) };

/// Estimated cycles of one call: from the function's first instruction up to and with its return. The
/// instruction that calls it is not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// Instructions executed, those of the functions it calls included.
    pub instructions: u64,
    /// Sum of the nominal costs.
    pub nominal_cycles: u64,
    /// Sum of the pessimistic costs.
    pub pessimistic_cycles: u64,
    /// Cycles that an STM32F446's flash adds, which holds nothing of the call when it begins.
    pub nominal_waits: u64,
    /// The same on the pessimistic side.
    pub pessimistic_waits: u64,
}

impl Estimate {
    fn wait(&mut self, cost: Cost) {
        self.nominal_waits += u64::from(cost.nominal);
        self.pessimistic_waits += u64::from(cost.pessimistic);
    }
}

impl std::ops::AddAssign<Cost> for Estimate {
    fn add_assign(&mut self, cost: Cost) {
        self.instructions += 1;
        self.nominal_cycles += u64::from(cost.nominal);
        self.pessimistic_cycles += u64::from(cost.pessimistic);
    }
}
