//! The drive model of hal-sim for several sets of unknowns at once.
//!
//! A search asks for a dozen neighbours of a set. Four that run side by side take the time of one and a half:
//! a sub-step is a chain of operations that wait for each other.
//!
//! Equations and sub-steps are those of [`hal_sim::DriveModel`], but for one thing. There the integrator stops
//! or runs for whole sub-steps while the current limit acts. Here it stops for the part of the sub-step in
//! which the limit acts, so positions are smooth in every unknown and difference quotients are derivatives. What
//! the model leaves out is a remainder of up to half a sub-step at every such moment. It stays in the axis'
//! position, so [`readings`](super::readings) must know the moments. One is where the limit is just reached, too.
//!
//! Most ticks have no event: no limit is reached or left, and the axis neither stops nor starts. Their sub-steps are
//! one linear map, which [`whole_ticks`](super::whole_ticks) takes at once.

use super::parameters::{Unknown, Unknowns};
use super::whole_ticks::WholeTicks;

/// Sets of unknowns that are simulated side by side.
pub(super) const LANES: usize = 4;

/// Sub-steps of a tick in the last stage of the search: those of the reference machine.
pub(super) const SUBSTEPS: u32 = 20;

/// Part of the limit within which its crossing is divided; steps of the command cross further.
pub(super) const CROSSING: f64 = 0.05;

pub(super) type Lane = [f64; LANES];

/// Coefficients, as in [`hal_sim::DriveModel`].
pub(super) struct Model {
    pub(super) step_s: f64,
    pub(super) gain: Lane,
    pub(super) offset: Lane,
    pub(super) whole_ticks: [usize; LANES],
    pub(super) whole_steps: [u32; LANES],
    pub(super) fraction: Lane,
    pub(super) filter_share: Lane,
    pub(super) velocity_gain: Lane,
    integral_gain: Lane,
    pub(super) limit: Lane,
    current_share: Lane,
    viscous_factor: Lane,
    pub(super) coulomb_step: Lane,
    pub(super) stiffness: Lane,
    damping: Lane,
    mass_ratio: Lane,
    pub(super) has_bed: bool,
}

#[derive(Clone, Default)]
pub(super) struct State {
    pub(super) command: Lane,
    pub(super) integral: Lane,
    pub(super) demand: Lane,
    pub(super) torque: Lane,
    pub(super) velocity: Lane,
    pub(super) position: Lane,
    pub(super) bed: Lane,
    pub(super) bed_velocity: Lane,
    pub(super) bed_accel: Lane,
    pub(super) is_frozen: bool,
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

    /// The command filter and the velocity controller: its error, and the acceleration that it asks for.
    #[inline(always)]
    pub(super) fn ask(&self, state: &mut State, delayed: &Lane) -> (Lane, Lane) {
        let (mut error, mut demand) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            state.command[lane] += self.filter_share[lane] * (delayed[lane] - state.command[lane]);
            error[lane] = state.command[lane] - state.velocity[lane];
            demand[lane] = self.velocity_gain[lane] * error[lane] + state.integral[lane];
        }
        (error, demand)
    }

    /// The integrator, which `runs` for a part of the sub-step, and the current loop under the `limited` demand.
    #[inline(always)]
    pub(super) fn push(&self, state: &mut State, error: &Lane, runs: &Lane, limited: &Lane) {
        for lane in 0..LANES {
            state.integral[lane] += self.integral_gain[lane] * error[lane] * runs[lane];
            state.torque[lane] += self.current_share[lane] * (limited[lane] - state.torque[lane]);
        }
    }

    /// The axis and its bed; friction takes what `held` says of the velocity that the axis would have without.
    #[inline(always)]
    pub(super) fn travel(&self, state: &mut State, held: impl Fn(usize, f64) -> f64) {
        let mut rise = [0.0; LANES];
        for (lane, rise) in rise.iter_mut().enumerate() {
            let velocity = state.velocity[lane];
            let pushed = (velocity + self.step_s * (state.torque[lane] - state.bed_accel[lane]))
                * self.viscous_factor[lane];
            let next = pushed - held(lane, pushed);
            state.position[lane] += 0.5 * self.step_s * (velocity + next);
            state.velocity[lane] = next;
            *rise = next - velocity;
        }
        if self.has_bed {
            for (lane, rise) in rise.iter().enumerate() {
                let accel = -self.stiffness[lane] * state.bed[lane]
                    - self.damping[lane] * state.bed_velocity[lane]
                    - self.mass_ratio[lane] * (rise / self.step_s + state.bed_accel[lane]);
                state.bed_accel[lane] = accel;
                state.bed_velocity[lane] += self.step_s * accel;
                state.bed[lane] += self.step_s * state.bed_velocity[lane];
            }
        }
    }

    /// One sub-step with the `delayed` commands; whether the first lane's integrator stopped, went on or ran for a part.
    #[inline(always)]
    fn step(&self, state: &mut State, delayed: &Lane) -> bool {
        let (error, demand) = self.ask(state, delayed);
        let is_near = (0..LANES).any(|lane| demand[lane].abs() > (1.0 - CROSSING) * self.limit[lane]);
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
        // A limit that is just reached stops the drive's integrator for a sub-step, or not at all.
        let is_part = runs[0] > 0.0 && runs[0] < 1.0;
        let is_moment = is_part || is_frozen != state.is_frozen;
        state.is_frozen = is_frozen;
        state.demand = demand;
        // Loops, as closures over lanes are not inlined everywhere.
        let mut limited = demand;
        for (limited, limit) in limited.iter_mut().zip(&self.limit) {
            *limited = limited.min(*limit).max(-limit);
        }
        self.push(state, &error, &runs, &limited);
        self.travel(state, |lane, pushed| pushed.min(self.coulomb_step[lane]).max(-self.coulomb_step[lane]));
        is_moment
    }

    /// The commands of a tick as they come out of the dead time: first the earlier, then the late.
    fn delayed(&self, command_mm_s: &[f64], tick: usize) -> Delayed {
        let mut delayed = Delayed { earlier: [0.0; LANES], late: [0.0; LANES] };
        for lane in 0..LANES {
            let at = |ticks: usize| match tick.checked_sub(ticks) {
                Some(tick) => self.gain[lane] * command_mm_s[tick] + self.offset[lane],
                None => 0.0,
            };
            delayed.late[lane] = at(self.whole_ticks[lane]);
            delayed.earlier[lane] = at(self.whole_ticks[lane] + 1);
        }
        delayed
    }

    /// The commands in one sub-step of a tick.
    #[inline(always)]
    pub(super) fn delayed_in(&self, Delayed { earlier, late }: &Delayed, step: u32) -> Lane {
        let mut delayed = *late;
        for (lane, delayed) in delayed.iter_mut().enumerate() {
            if step < self.whole_steps[lane] {
                *delayed = earlier[lane];
            } else if step == self.whole_steps[lane] {
                *delayed += self.fraction[lane] * (earlier[lane] - late[lane]);
            }
        }
        delayed
    }
}

/// Commands of a tick, after the dead time.
pub(super) struct Delayed {
    pub(super) earlier: Lane,
    pub(super) late: Lane,
}

/// The model of several sets of unknowns, ready to run.
pub(super) struct Simulation {
    model: Model,
    whole_ticks: Option<WholeTicks>,
    substeps: u32,
    /// How many ticks were taken at once.
    #[cfg(test)]
    ticks_whole: core::cell::Cell<u32>,
}

impl Simulation {
    pub(super) fn new(lanes: &[Unknowns; LANES], tick_s: f64, substeps: u32) -> Self {
        let model = Model::new(lanes, tick_s, substeps);
        let whole_ticks = WholeTicks::new(&model, tick_s, substeps);
        Self {
            model,
            whole_ticks,
            substeps,
            #[cfg(test)]
            ticks_whole: core::cell::Cell::new(0),
        }
    }

    /// Drives an axis that starts at rest at 0; `each` has the state at the start of every tick, and may change it. Returns the
    /// ticks in which the first set's current limit stops or frees the integrator, or may.
    pub(super) fn run(&self, command_mm_s: &[f64], each: &mut dyn FnMut(usize, &mut State)) -> Vec<usize> {
        let Self { model, whole_ticks, substeps, .. } = self;
        let mut state = State::default();
        let mut moments = Vec::new();
        for tick in 0..command_mm_s.len() {
            each(tick, &mut state);
            let delayed = model.delayed(command_mm_s, tick);
            if whole_ticks.as_ref().is_some_and(|whole| whole.advance(model, &mut state, &delayed)) {
                #[cfg(test)]
                self.ticks_whole.set(self.ticks_whole.get() + 1);
                continue;
            }
            for step in 0..*substeps {
                if model.step(&mut state, &model.delayed_in(&delayed, step)) && moments.last() != Some(&tick)
                {
                    moments.push(tick);
                }
            }
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use hal_sim::{DriveModel, DriveState, REFERENCE_Y};

    use super::super::fixtures::unknowns;
    use super::*;

    fn reference_y() -> Unknowns {
        let bed = REFERENCE_Y.bed.expect("Y has a bed");
        let values = [
            (Unknown::Gain, 1.0),
            (Unknown::VelocityGain, 440.0),
            (Unknown::IntegralTime, 0.0275),
            (Unknown::AccelLimit, 12_300.0),
            (Unknown::Coulomb, 260.0),
            (Unknown::Viscous, 0.08),
            (Unknown::BedFrequency, bed.frequency_hz),
            (Unknown::BedDamping, bed.damping_ratio),
            (Unknown::BedMassRatio, bed.mass_ratio),
        ];
        unknowns(values, [0.001_43, 0.0007, 0.000_37])
    }

    /// Without the current limit bit for bit but for the order of operations, with it to half a sub-step.
    #[test]
    fn it_is_the_drive_of_hal_sim() {
        let unknowns = reference_y();
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
            let moments = Simulation::new(&[unknowns, other, other, unknowns], 5e-4, SUBSTEPS).run(
                &command,
                &mut |tick, State { position: at, .. }| {
                    worst_mm = worst_mm.max((at[0] - expected[tick]).abs());
                    assert_eq!(at[0].to_bits(), at[3].to_bits());
                },
            );
            assert!(worst_mm < tolerance_mm, "{feed_mm_s} mm/s: {worst_mm} mm");
            assert_eq!(!moments.is_empty(), limited, "{moments:?}");
        }
    }

    /// A step of the command asks for the most at once: here for a part of the limit.
    #[test]
    fn a_limit_that_is_just_reached_is_a_moment() {
        let mut rigid = reference_y();
        rigid.set(Unknown::BedMassRatio, 0.0);
        rigid.set_lags(0.001, 0.0, 0.000_37);
        let limit_mm_s = rigid.get(Unknown::AccelLimit) / rigid.get(Unknown::VelocityGain);
        let moments = |part: f64| {
            let feed_mm_s = part * limit_mm_s;
            let command: Vec<f64> = (0..400).map(|tick| if tick < 100 { 0.0 } else { feed_mm_s }).collect();
            Simulation::new(&[rigid; LANES], 5e-4, SUBSTEPS).run(&command, &mut |_, _| {})
        };
        // Two ticks of dead time.
        for (part, ticks) in [(0.95, &[][..]), (0.99, &[102]), (1.01, &[102])] {
            assert_eq!(moments(part), ticks, "{part} of the limit");
        }
    }

    /// Whole ticks are the product of their sub-steps, and most of all ticks.
    #[test]
    fn whole_ticks_are_their_sub_steps() {
        let rigid = |unknowns: Unknowns| {
            let mut rigid = unknowns;
            rigid.set(Unknown::BedMassRatio, 0.0);
            rigid
        };
        let step = |feed_mm_s: f64| {
            move |tick: u32| {
                if (100..600).contains(&tick) { feed_mm_s } else { 0.0 }
            }
        };
        let sine = |amplitude_mm_s: f64, hz: f64| {
            move |tick: u32| amplitude_mm_s * (core::f64::consts::TAU * hz * 5e-4 * f64::from(tick)).sin()
        };
        let motions: [&dyn Fn(u32) -> f64; 6] =
            [&step(12.0), &step(150.0), &step(0.4), &sine(24.0, 3.0), &sine(40.0, 18.0), &sine(7.0, 110.0)];
        let mut ticks_whole = 0;
        for (is_rigid, motion) in
            [true, false].into_iter().flat_map(|rigid| motions.map(|motion| (rigid, motion)))
        {
            let command: Vec<f64> = (0..1200).map(motion).collect();
            let y = if is_rigid { rigid(reference_y()) } else { reference_y() };
            let near = |unknown: Unknown, by: f64| y.shifted(unknown, by);
            let lanes = [
                y,
                near(Unknown::VelocityGain, 2e-3),
                near(Unknown::Lag, 4e-5),
                near(Unknown::Coulomb, -3.0),
            ];
            let mut simulation = Simulation::new(&lanes, 5e-4, SUBSTEPS);
            let mut positions = [Vec::new(), Vec::new()];
            let [by_ticks, by_steps] = &mut positions;
            let moments = simulation.run(&command, &mut |_, state| by_ticks.push(state.position));
            ticks_whole += simulation.ticks_whole.get();
            simulation.whole_ticks = None;
            assert_eq!(simulation.run(&command, &mut |_, state| by_steps.push(state.position)), moments);
            for (tick, (at, expected)) in by_ticks.iter().zip(by_steps).enumerate() {
                for (at, expected) in at.iter().zip(expected) {
                    let off_mm = (at - *expected).abs();
                    assert!(off_mm < 1e-11, "rigid {is_rigid}, tick {tick}: {at} mm, expected {expected} mm");
                }
            }
        }
        assert!(ticks_whole > 12 * 1200 * 3 / 4, "{ticks_whole} of {}", 12 * 1200);
    }
}
