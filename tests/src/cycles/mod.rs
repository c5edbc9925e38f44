//! Estimated cycles of a Cortex-M4 with zero-wait-state memory, from a trace of the instructions an
//! emulator executed and the timing tables that ARM publishes. Nothing here is a measurement: the emulator
//! has no pipeline, the tables have no memory system.
//!
//! ```text
//!   mnemonic      which row of the tables an instruction belongs to         Row
//!   instruction   a line of disassembly ─► row, width, registers            Instruction
//!   price         row, branch taken?, instruction before it ─► cycles       Cost
//!   trace         the emulator's log, as it is written ─► one per call      Estimate
//! ```
//!
//! Sections and tables cited are those of the Cortex-M4 Technical Reference Manual r0p1 (ARM DDI 0439D).
//! What it states without a range counts on both sides. Where it leaves a range, the nominal side takes
//! what the manual calls normal or else the middle, the pessimistic side takes the upper end.
//!
//! Not in either side: wait states of flash or bus, unaligned accesses (3.3.2 adds 1 or 2 cycles, and a
//! trace has no data addresses), and entry and exit of exceptions. An instruction that its IT block skips
//! is priced as though it ran, and a division of floats in full even where integer instructions would
//! overlap it (7.2.3): the trace tells neither.

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
}

impl std::ops::AddAssign<Cost> for Estimate {
    fn add_assign(&mut self, cost: Cost) {
        self.instructions += 1;
        self.nominal_cycles += u64::from(cost.nominal);
        self.pessimistic_cycles += u64::from(cost.pessimistic);
    }
}
