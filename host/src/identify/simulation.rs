//! The drive model of hal-sim for several sets of unknowns at once.
//!
//! A search asks for a dozen neighbours of a set. Four that run side by side take the time of one and a half:
//! a sub-step is a chain of operations that wait for each other.
//!
//! Equations and sub-steps are those of [`hal_sim::DriveModel`], but for one thing. There the integrator stops
//! or runs for whole sub-steps while the current limit acts. Here it stops for the part of the sub-step in
//! which the limit acts, so positions are smooth in every unknown and difference quotients are derivatives. What
//! the model leaves out is a remainder of up to half a sub-step at every such moment. It stays in the axis'
//! position, so [`readings`](super::readings) must know the moments.

use super::parameters::{Unknown, Unknowns};

/// Sets of unknowns that are simulated side by side.
pub(super) const LANES: usize = 4;

/// Sub-steps of a tick in the last stage of the search: those of the reference machine.
pub(super) const SUBSTEPS: u32 = 20;

/// Part of the limit within which its crossing is divided; steps of the command cross further.
const CROSSING: f64 = 0.05;

type Lane = [f64; LANES];

/// Coefficients, as in [`hal_sim::DriveModel`].
struct Model {
    step_s: f64,
    gain: Lane,
    offset: Lane,
    whole_ticks: [usize; LANES],
    whole_steps: [u32; LANES],
    fraction: Lane,
    filter_share: Lane,
    velocity_gain: Lane,
    integral_gain: Lane,
    limit: Lane,
    current_share: Lane,
    viscous_factor: Lane,
    coulomb_step: Lane,
    stiffness: Lane,
    damping: Lane,
    mass_ratio: Lane,
    has_bed: bool,
}

#[derive(Default)]
struct State {
    command: Lane,
    integral: Lane,
    demand: Lane,
    torque: Lane,
    velocity: Lane,
    position: Lane,
    bed: Lane,
    bed_velocity: Lane,
    bed_accel: Lane,
    is_frozen: bool,
}

/// The fraction of the distance to its input that a lag covers in a step, to delay by `delay_s` in the mean.
fn lag_share(step_s: f64, delay_s: f64) -> f64 {
    step_s / (step_s + delay_s.max(0.0))
}

impl Model {
    fn new(lanes: &[Unknowns; LANES], tick_s: f64, substeps: u32) -> Self {
        let step_s = tick_s / f64::from(substeps);
        let of = |value: &dyn Fn(&Unknowns) -> f64| core::array::from_fn(|lane| value(&lanes[lane]));
        let get = |unknown: Unknown| of(&|lane| lane.get(unknown));
        let dead_steps: Lane = of(&|lane| lane.dead_time_s() / step_s);
        // The casts cut off.
        let whole: [u32; LANES] = dead_steps.map(|steps| steps as u32);
        let omega = |lane: &Unknowns| core::f64::consts::TAU * lane.get(Unknown::BedFrequency);
        Self {
            step_s,
            gain: get(Unknown::Gain),
            offset: get(Unknown::Offset),
            whole_ticks: whole.map(|steps| (steps / substeps) as usize),
            whole_steps: whole.map(|steps| steps % substeps),
            fraction: core::array::from_fn(|lane| dead_steps[lane] - f64::from(whole[lane])),
            filter_share: of(&|lane| lag_share(step_s, lane.filter_delay_s())),
            velocity_gain: get(Unknown::VelocityGain),
            integral_gain: of(&|lane| {
                step_s * lane.get(Unknown::VelocityGain) / lane.get(Unknown::IntegralTime)
            }),
            limit: get(Unknown::AccelLimit),
            // A sub-step passes between velocity and torque. A longer one leaves less for the lag.
            current_share: of(&|lane| {
                lag_share(step_s, lane.get(Unknown::CurrentLag) + lane.step_s() - step_s)
            }),
            viscous_factor: of(&|lane| 1.0 / (1.0 + step_s * lane.get(Unknown::Viscous))),
            coulomb_step: of(&|lane| step_s * lane.get(Unknown::Coulomb)),
            stiffness: of(&|lane| omega(lane).powi(2)),
            damping: of(&|lane| 2.0 * lane.get(Unknown::BedDamping) * omega(lane)),
            mass_ratio: get(Unknown::BedMassRatio),
            has_bed: lanes.iter().any(|lane| lane.get(Unknown::BedMassRatio) > 0.0),
        }
    }

    /// One sub-step with the `delayed` commands; whether the first lane's integrator stopped or went on.
    fn step(&self, state: &mut State, delayed: &Lane) -> bool {
        let mut error = [0.0; LANES];
        let mut demand = [0.0; LANES];
        let mut is_near = false;
        for lane in 0..LANES {
            state.command[lane] += self.filter_share[lane] * (delayed[lane] - state.command[lane]);
            error[lane] = state.command[lane] - state.velocity[lane];
            demand[lane] = self.velocity_gain[lane] * error[lane] + state.integral[lane];
            is_near |= demand[lane].abs() > (1.0 - CROSSING) * self.limit[lane];
        }
        let mut runs = [1.0; LANES];
        if is_near {
            for lane in 0..LANES {
                let limit = self.limit[lane];
                let rise = (demand[lane] - state.demand[lane]).abs().clamp(1e-9 * limit, CROSSING * limit);
                if demand[lane] * error[lane] > 0.0 {
                    runs[lane] = (0.5 - (demand[lane].abs() - limit) / rise).clamp(0.0, 1.0);
                }
            }
        }
        let is_frozen = runs[0] < 0.5;
        let is_moment = is_frozen != state.is_frozen;
        state.is_frozen = is_frozen;
        for lane in 0..LANES {
            state.demand[lane] = demand[lane];
            state.integral[lane] += self.integral_gain[lane] * error[lane] * runs[lane];
            let limited = demand[lane].min(self.limit[lane]).max(-self.limit[lane]);
            state.torque[lane] += self.current_share[lane] * (limited - state.torque[lane]);
            let velocity = state.velocity[lane];
            let pushed = (velocity + self.step_s * (state.torque[lane] - state.bed_accel[lane]))
                * self.viscous_factor[lane];
            let held = pushed.min(self.coulomb_step[lane]).max(-self.coulomb_step[lane]);
            let next = pushed - held;
            state.position[lane] += 0.5 * self.step_s * (velocity + next);
            state.velocity[lane] = next;
            demand[lane] = (next - velocity) / self.step_s;
        }
        if self.has_bed {
            for (lane, pushed) in demand.iter().enumerate() {
                let accel = -self.stiffness[lane] * state.bed[lane]
                    - self.damping[lane] * state.bed_velocity[lane]
                    - self.mass_ratio[lane] * (pushed + state.bed_accel[lane]);
                state.bed_accel[lane] = accel;
                state.bed_velocity[lane] += self.step_s * accel;
                state.bed[lane] += self.step_s * state.bed_velocity[lane];
            }
        }
        is_moment
    }
}

/// The positions of an axis that starts at rest at 0, at the start of every tick \[mm\], by set of unknowns; and
/// the ticks in which the first set's current limit stops or frees the integrator.
pub(super) fn simulate(
    command_mm_s: &[f64],
    tick_s: f64,
    substeps: u32,
    lanes: &[Unknowns; LANES],
    each: &mut dyn FnMut(usize, &[f64; LANES]),
) -> Vec<usize> {
    let model = Model::new(lanes, tick_s, substeps);
    let mut state = State::default();
    let mut moments = Vec::new();
    for tick in 0..command_mm_s.len() {
        each(tick, &state.position);
        let (mut late, mut earlier, mut between) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let at = |ticks: usize| match tick.checked_sub(ticks) {
                Some(tick) => model.gain[lane] * command_mm_s[tick] + model.offset[lane],
                None => 0.0,
            };
            late[lane] = at(model.whole_ticks[lane]);
            earlier[lane] = at(model.whole_ticks[lane] + 1);
            between[lane] = late[lane] + model.fraction[lane] * (earlier[lane] - late[lane]);
        }
        for step in 0..substeps {
            let mut delayed = late;
            for lane in 0..LANES {
                if step < model.whole_steps[lane] {
                    delayed[lane] = earlier[lane];
                } else if step == model.whole_steps[lane] {
                    delayed[lane] = between[lane];
                }
            }
            if model.step(&mut state, &delayed) && moments.last() != Some(&tick) {
                moments.push(tick);
            }
        }
    }
    moments
}

#[cfg(test)]
mod tests {
    use hal_sim::{DriveModel, DriveState, REFERENCE_Y};

    use super::*;

    /// Without the current limit bit for bit but for the order of operations, with it to half a sub-step.
    #[test]
    fn it_is_the_drive_of_hal_sim() {
        let mut unknowns = Unknowns::zero(2.5e-5);
        let bed = REFERENCE_Y.bed.expect("Y has a bed");
        for (unknown, value) in [
            (Unknown::Gain, 1.0),
            (Unknown::VelocityGain, 440.0),
            (Unknown::IntegralTime, 0.0275),
            (Unknown::AccelLimit, 12_300.0),
            (Unknown::Coulomb, 260.0),
            (Unknown::Viscous, 0.08),
            (Unknown::BedFrequency, bed.frequency_hz),
            (Unknown::BedDamping, bed.damping_ratio),
            (Unknown::BedMassRatio, bed.mass_ratio),
        ] {
            unknowns.set(unknown, value);
        }
        unknowns.set_lags(0.001_43, 0.0007, 0.000_37);
        let drive = unknowns.drive();
        assert!(
            (drive.current_lag_s - 0.00037).abs() < 1e-12 && (drive.command_filter_s - 0.0007).abs() < 1e-12
        );
        let model = DriveModel::new(drive, 5e-4, SUBSTEPS).expect("a drive");
        for (feed_mm_s, tolerance_mm, limited) in [(12.0, 1e-9, false), (150.0, 1.5e-3, true)] {
            let command: Vec<f64> =
                (0..1200).map(|tick| if (100..600).contains(&tick) { feed_mm_s } else { 0.0 }).collect();
            let mut state = DriveState::<256>::at_rest(&model, 0.0).expect("at rest");
            let mut expected = Vec::new();
            for command_mm_s in &command {
                expected.push(state.position_mm());
                model.tick(&mut state, *command_mm_s);
            }
            let mut other = unknowns;
            other.set(Unknown::VelocityGain, 100.0);
            let mut worst_mm = 0.0_f64;
            let moments =
                simulate(&command, 5e-4, SUBSTEPS, &[unknowns, other, other, unknowns], &mut |tick, at| {
                    worst_mm = worst_mm.max((at[0] - expected[tick]).abs());
                    assert_eq!(at[0].to_bits(), at[3].to_bits());
                });
            assert!(worst_mm < tolerance_mm, "{feed_mm_s} mm/s: {worst_mm} mm");
            assert_eq!(!moments.is_empty(), limited, "{moments:?}");
        }
    }
}
