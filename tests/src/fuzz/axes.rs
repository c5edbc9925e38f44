//! What the machine answers: as it should, or as it likes.

use arbitrary::{Result, Unstructured};
use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains, GuardFigures, Guards};
use motion_kernel::fault::{Reaction, Reactions};
use motion_kernel::hal::{AxisInputs, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use motion_kernel::num::Real;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode, Position};

use super::items::TICK_S;

const MM_PER_COUNT: f64 = 1e-4;
/// What is put out at rest \[V\].
pub(super) const TRIM_V: f64 = 0.1;

/// What the axes are guarded by, alike, for a machine whose encoders read a tick later what was set.
const GUARD: GuardFigures = GuardFigures {
    following_error_at_rest_mm: 0.2,
    following_error_per_velocity_s: 1e-3,
    following_error_per_accel_s2: 1e-4,
    jump_mm: 0.02,
    moving_mm_s: 5.0,
    response_s: 0.02,
    load_accel_mm_s2: 5000.0,
    noise_counts: 0,
    saturation_s: 0.1,
    travel_mm: Some([-900.0, 900.0]),
};
/// How faults end.
pub(super) const REACTIONS: Reactions =
    Reactions { ramp_ticks: 50, stop_ticks: 2000, emergency_stop: Reaction::Stop };

/// The axes, alike.
pub(super) fn axes<R: Real>() -> AxesConfig<R, 2> {
    let axis = AxisFigures {
        mm_per_count: MM_PER_COUNT,
        // Above the greatest feed, and what regulation adds to it.
        mm_s_at_10_v: 500.0,
        output_offset_v: TRIM_V,
        output_limit_v: 9.0,
        gains: Gains { kp_per_s: 100.0, ki_per_s2: 10.0, kd: 0.001 },
        feedforward: Feedforward { velocity: 1.0, accel_s: 1e-3, jerk_s2: 1e-6, ..Feedforward::default() },
        following_error_limit_mm: 1.0,
    };
    let guards = Guards { axes: [Some(GUARD); 2], reactions: REACTIONS };
    AxesConfig::new(&[axis; 2], TICK_S).and_then(|axes| axes.guarded(&guards, TICK_S)).expect("axes")
}

/// A machine whose encoders read what was set, until they are told otherwise.
#[derive(Debug, Default)]
pub(super) struct TestAxes {
    pub(super) counts: [Counts; 2],
    inputs: MachineInputs<2>,
    /// Of latch, inputs, write and enable.
    fails: [bool; 4],
    pub(super) written: [DacCode; 2],
    pub(super) is_enabled: bool,
    /// What the encoders read where the machine is at 0.
    origin: [i64; 2],
    /// Has answered other than it should.
    pub(super) is_hostile: bool,
}

impl TestAxes {
    /// Counts that jump, inputs that change, calls that fail.
    pub(super) fn upset(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        self.is_hostile = true;
        match input.int_in_range(0..=3)? {
            0 => self.fails = input.arbitrary()?,
            1 => {
                self.inputs.axes[input.choose_index(2)?] = AxisInputs::from_bits(input.arbitrary()?);
                self.inputs.emergency_stop = input.ratio(1, 4)?;
            }
            2 => self.counts[input.choose_index(2)?] = Counts(input.arbitrary()?),
            _ => {
                let jump = i64::from(input.arbitrary::<i16>()?);
                let counts = &mut self.counts[input.choose_index(2)?].0;
                *counts = counts.wrapping_add(jump);
            }
        }
        Ok(())
    }

    /// All is well again.
    pub(super) fn mend(&mut self) {
        (self.fails, self.inputs) = ([false; 4], MachineInputs::HEALTHY);
    }

    /// An axis has got another position by so much.
    pub(super) fn shift(&mut self, axis: usize, by: Position) {
        self.origin[axis] -= counts(by);
    }

    /// The axes are where they were set.
    pub(super) fn follow<R: Real>(&mut self, trace: &Trace<R, 2>) {
        let set = trace.executed.setpoints.each_ref().map(|axis| axis.position);
        self.counts = core::array::from_fn(|axis| Counts(self.origin[axis] + counts(set[axis])));
    }

    fn answer<T>(&self, call: usize, value: T) -> core::result::Result<T, Failure> {
        if self.fails[call] { Err(Failure) } else { Ok(value) }
    }
}

/// A distance in counts.
fn counts(at: Position) -> i64 {
    (at.to_mm() / MM_PER_COUNT).round_ties_even() as i64
}

/// What every call may answer.
pub(super) struct Failure;

impl Encoder<2> for TestAxes {
    type Error = Failure;

    fn latch(&mut self) -> core::result::Result<[Counts; 2], Failure> {
        self.answer(0, self.counts)
    }
}

impl Inputs<2> for TestAxes {
    type Error = Failure;

    fn read_inputs(&mut self) -> core::result::Result<MachineInputs<2>, Failure> {
        self.answer(1, self.inputs)
    }
}

impl VelocityChannel<2> for TestAxes {
    type Error = Failure;

    fn write(&mut self, codes: &[DacCode; 2]) -> core::result::Result<(), Failure> {
        self.answer(2, ())?;
        self.written = *codes;
        Ok(())
    }
}

impl DriveEnable<2> for TestAxes {
    type Error = Failure;

    fn set_enabled(&mut self, is_enabled: bool) -> core::result::Result<(), Failure> {
        self.answer(3, ())?;
        self.is_enabled = is_enabled;
        Ok(())
    }
}
