//! Tests: an axis like the reference machine's X, what is watched of it, and a machine of such axes.

use core::convert::Infallible;

use super::{AxesConfig, AxisFigures, Feedforward, Gains, GuardFigures, Guards};
use crate::fault::Reactions;
use crate::hal::{DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use crate::num::Real;
use crate::units::{Counts, DacCode};

pub(crate) const TICK_S: f64 = 5e-4;
pub(crate) const MM_PER_COUNT: f64 = 1e-4;

pub(crate) fn figures() -> AxisFigures {
    AxisFigures {
        mm_per_count: MM_PER_COUNT,
        mm_s_at_10_v: 1000.0 / 3.0,
        output_offset_v: 0.0,
        output_limit_v: 10.0,
        gains: Gains { kp_per_s: 230.0, ki_per_s2: 0.0, kd: 0.0 },
        feedforward: Feedforward { velocity: 1.0, ..Feedforward::default() },
        following_error_limit_mm: 1.0,
    }
}

pub(crate) const GUARD: GuardFigures = GuardFigures {
    following_error_at_rest_mm: 0.25,
    following_error_per_velocity_s: 1e-3,
    following_error_per_accel_s2: 1e-4,
    jump_mm: 0.007,
    moving_mm_s: 3.0,
    response_s: 0.013,
    load_accel_mm_s2: 1230.0,
    noise_counts: 0,
    saturation_s: 0.1,
    travel_mm: None,
};

/// Axes that are all alike.
pub(crate) fn guarded<R: Real, const AXES: usize>(
    figures: AxisFigures,
    guard: GuardFigures,
) -> AxesConfig<R, AXES> {
    let guards = Guards { axes: [Some(guard); AXES], reactions: Reactions::IMMEDIATE };
    let axes = AxesConfig::new(&[figures; AXES], TICK_S).and_then(|axes| axes.guarded(&guards, TICK_S));
    axes.expect("axes")
}

/// What a drive changes the distance of a tick by from one tick to the next [mm].
const DRIVE_MM: f64 = 0.003;

/// Axes that do what they are told, as far as a drive can.
pub(crate) struct Follower<const AXES: usize> {
    pub(crate) counts: [Counts; AXES],
    pub(crate) codes: [DacCode; AXES],
    pub(crate) inputs: MachineInputs<AXES>,
    at_mm: [f64; AXES],
    step_mm: [f64; AXES],
}

impl<const AXES: usize> Default for Follower<AXES> {
    fn default() -> Self {
        Self {
            counts: [Counts(0); AXES],
            codes: [DacCode::ZERO; AXES],
            inputs: MachineInputs::HEALTHY,
            at_mm: [0.0; AXES],
            step_mm: [0.0; AXES],
        }
    }
}

impl<const AXES: usize> Follower<AXES> {
    pub(crate) fn advance(&mut self) {
        for ((at_mm, step_mm), (DacCode(code), counts)) in
            self.at_mm.iter_mut().zip(&mut self.step_mm).zip(self.codes.into_iter().zip(&mut self.counts))
        {
            let commanded_mm = f64::from(code) / 32768.0 * 1000.0 / 3.0 * TICK_S;
            *step_mm = commanded_mm.clamp(*step_mm - DRIVE_MM, *step_mm + DRIVE_MM);
            *at_mm += *step_mm;
            *counts = Counts((*at_mm / MM_PER_COUNT).round() as i64);
        }
    }
}

impl<const AXES: usize> Encoder<AXES> for Follower<AXES> {
    type Error = Infallible;
    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        Ok(self.counts)
    }
}

impl<const AXES: usize> Inputs<AXES> for Follower<AXES> {
    type Error = Infallible;
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        Ok(self.inputs)
    }
}

impl<const AXES: usize> VelocityChannel<AXES> for Follower<AXES> {
    type Error = Infallible;
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Infallible> {
        self.codes = *codes;
        Ok(())
    }
}

impl<const AXES: usize> DriveEnable<AXES> for Follower<AXES> {
    type Error = Infallible;
    fn set_enabled(&mut self, _: bool) -> Result<(), Infallible> {
        Ok(())
    }
}
