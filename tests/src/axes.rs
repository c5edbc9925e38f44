//! Test axes: hardware in memory whose encoders read what was set, until it is told to fail.

use motion_kernel::hal::{DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use motion_kernel::num::Real;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode, Position};

/// Resolution of the encoders \[mm\].
pub const MM_PER_COUNT: f64 = 1e-4;

/// Two axes, read and written by a kernel.
#[derive(Debug, Default)]
pub struct TestAxes {
    /// What the encoders read.
    pub counts: [Counts; 2],
    /// What the digital inputs read.
    pub inputs: MachineInputs<2>,
    /// Which calls fail.
    pub fails: Fails,
    /// What was written last.
    pub written: [DacCode; 2],
    /// Whether the drives are enabled.
    pub is_enabled: bool,
    /// What the encoders read where the machine is at 0.
    pub origin: [i64; 2],
}

/// Calls that fail, one for each trait of the hardware.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fails {
    /// Of the encoders.
    pub latch: bool,
    /// Of the digital inputs.
    pub inputs: bool,
    /// Of the converter.
    pub write: bool,
    /// Of the drives' enable.
    pub enable: bool,
}

/// What a call that fails returns.
#[derive(Debug)]
pub struct Failure;

impl TestAxes {
    /// The axes are where they were set.
    pub fn follow<R: Real>(&mut self, trace: &Trace<R, 2>) {
        let set = trace.executed.setpoints.each_ref().map(|axis| axis.position);
        self.counts = core::array::from_fn(|axis| Counts(self.origin[axis] + counts(set[axis])));
    }
}

/// A distance in counts.
#[must_use]
pub fn counts(at: Position) -> i64 {
    (at.to_mm() / MM_PER_COUNT).round_ties_even() as i64
}

fn answer<T>(fails: bool, value: T) -> Result<T, Failure> {
    if fails { Err(Failure) } else { Ok(value) }
}

impl Encoder<2> for TestAxes {
    type Error = Failure;

    fn latch(&mut self) -> Result<[Counts; 2], Failure> {
        answer(self.fails.latch, self.counts)
    }
}

impl Inputs<2> for TestAxes {
    type Error = Failure;

    fn read_inputs(&mut self) -> Result<MachineInputs<2>, Failure> {
        answer(self.fails.inputs, self.inputs)
    }
}

impl VelocityChannel<2> for TestAxes {
    type Error = Failure;

    fn write(&mut self, codes: &[DacCode; 2]) -> Result<(), Failure> {
        answer(self.fails.write, ())?;
        self.written = *codes;
        Ok(())
    }
}

impl DriveEnable<2> for TestAxes {
    type Error = Failure;

    fn set_enabled(&mut self, is_enabled: bool) -> Result<(), Failure> {
        answer(self.fails.enable, ())?;
        self.is_enabled = is_enabled;
        Ok(())
    }
}
