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
use crate::trace::AXES;

/// Passes everything on to `H`, and keeps its answers.
#[derive(Debug)]
pub struct Recorder<'a, H> {
    hardware: &'a mut H,
    start: [Counts; AXES],
    answers: Answers,
    checks: Checks,
    writer: AnswerWriter,
}

impl<'a, H: Hardware> Recorder<'a, H> {
    /// Of `hardware`, before its first tick.
    pub fn new(hardware: &'a mut H) -> Self {
        let start = [Counts(0); AXES];
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
    pub fn finish(self, job: &Job) -> Recording {
        Recording::new(job, self.start, self.writer.finish(self.checks.digest()))
    }
}

impl<H: Hardware> Hardware for Recorder<'_, H> {
    fn start_counts(&mut self) -> [Counts; AXES] {
        self.start = self.hardware.start_counts();
        self.writer = AnswerWriter::new(self.start);
        self.start
    }

    fn advance<R: Scalar>(&mut self, trace: &Trace<R, AXES>) -> bool {
        self.writer.add(&self.answers, self.checks.add(trace));
        self.answers = Answers::NONE;
        self.hardware.advance(trace)
    }
}

impl<H: Hardware> Encoder<AXES> for Recorder<'_, H> {
    type Error = <H as Encoder<AXES>>::Error;

    fn latch(&mut self) -> Result<[Counts; AXES], Self::Error> {
        let latched = self.hardware.latch();
        self.answers.counts = latched.as_ref().ok().copied();
        latched
    }
}

impl<H: Hardware> Inputs<AXES> for Recorder<'_, H> {
    type Error = <H as Inputs<AXES>>::Error;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Self::Error> {
        let read = self.hardware.read_inputs();
        self.answers.inputs = read.as_ref().ok().copied();
        read
    }
}

impl<H: Hardware> VelocityChannel<AXES> for Recorder<'_, H> {
    type Error = <H as VelocityChannel<AXES>>::Error;

    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Self::Error> {
        let written = self.hardware.write(codes);
        self.answers.is_written = written.is_ok();
        written
    }
}

impl<H: Hardware> DriveEnable<AXES> for Recorder<'_, H> {
    type Error = <H as DriveEnable<AXES>>::Error;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Self::Error> {
        let taken = self.hardware.set_enabled(enabled);
        self.answers.told = Some((enabled, taken.is_ok()));
        taken
    }
}

impl<H: Hardware> Outputs for Recorder<'_, H> {
    fn switch(&mut self, to: &OutputState) {
        self.checks.switch(to);
        self.hardware.switch(to);
    }
}
