//! Hardware that writes down what it answers.

use motion_kernel::hal::{
    DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs, VelocityChannel,
};
use motion_kernel::num::Scalar;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use super::Recording;
use super::answers::{AnswerWriter, Answers, Checks};
use crate::simulate::{Hardware, Job};

/// Passes everything on to `H`, and keeps its answers.
#[derive(Debug)]
pub struct Recorder<'a, H, const N: usize = 3> {
    hardware: &'a mut H,
    start: [Counts; N],
    answers: Answers<N>,
    checks: Checks,
    writer: AnswerWriter<N>,
}

impl<'a, H: Hardware<N>, const N: usize> Recorder<'a, H, N> {
    /// Of `hardware`, before its first tick.
    pub fn new(hardware: &'a mut H) -> Self {
        let start = [Counts(0); N];
        Self {
            hardware,
            start,
            answers: Answers::NONE,
            checks: Checks::default(),
            writer: AnswerWriter::new(start),
        }
    }

    /// What was recorded of the run of `job`.
    #[must_use]
    pub fn finish(self, job: &Job<N>) -> Recording<N> {
        Recording::new(job, self.start, self.writer.finish(self.checks.digest()))
    }
}

impl<H: Hardware<N>, const N: usize> Hardware<N> for Recorder<'_, H, N> {
    fn start_counts(&mut self) -> [Counts; N] {
        self.start = self.hardware.start_counts();
        self.writer = AnswerWriter::new(self.start);
        self.start
    }

    fn advance<R: Scalar>(&mut self, trace: &Trace<R, N>) -> bool {
        self.writer.add(&self.answers, self.checks.add(trace));
        self.answers = Answers::NONE;
        self.hardware.advance(trace)
    }
}

impl<H: Hardware<N>, const N: usize> Encoder<N> for Recorder<'_, H, N> {
    type Error = <H as Encoder<N>>::Error;

    fn latch(&mut self) -> Result<[Counts; N], Self::Error> {
        let latched = self.hardware.latch();
        self.answers.counts = latched.as_ref().ok().copied();
        latched
    }
}

impl<H: Hardware<N>, const N: usize> Inputs<N> for Recorder<'_, H, N> {
    type Error = <H as Inputs<N>>::Error;

    fn read_inputs(&mut self) -> Result<MachineInputs<N>, Self::Error> {
        let read = self.hardware.read_inputs();
        self.answers.inputs = read.as_ref().ok().copied();
        read
    }
}

impl<H: Hardware<N>, const N: usize> VelocityChannel<N> for Recorder<'_, H, N> {
    type Error = <H as VelocityChannel<N>>::Error;

    fn write(&mut self, codes: &[DacCode; N]) -> Result<(), Self::Error> {
        let written = self.hardware.write(codes);
        self.answers.is_written = written.is_ok();
        written
    }
}

impl<H: Hardware<N>, const N: usize> DriveEnable<N> for Recorder<'_, H, N> {
    type Error = <H as DriveEnable<N>>::Error;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Self::Error> {
        let taken = self.hardware.set_enabled(enabled);
        self.answers.told = Some((enabled, taken.is_ok()));
        taken
    }
}

impl<H: Hardware<N>, const N: usize> Outputs for Recorder<'_, H, N> {
    fn switch(&mut self, to: &OutputState) {
        self.checks.switch(to);
        self.hardware.switch(to);
    }
}
