//! Motions that show every parameter of an axis, and the set of them that identification asks for.
//!
//! Small steps show the velocity controller and the delay. Large steps show the current limit, the viscous
//! friction and, while the axis cruises, the ringing bed. Harmonic motion shows the bed again, and how the
//! delay splits into dead time and lag. Slow motion shows the Coulomb friction.

use core::f64::consts::PI;

use hal_sim::{DriveModel, DriveParameters, DriveState};

use super::differences::Parabolas;
use super::recording::AxisRecording;
use super::simulation::SUBSTEPS;

/// The part of what an axis reaches that it may take: drift and trim need some of the output, too.
const REACH_SHARE: f64 = 0.95;

/// The fastest step of the plan \[mm/s\]: S4's fastest.
const FASTEST_MM_S: f64 = 9549.0 / 60.0;
/// And the time in which the axis gets there at its greatest acceleration \[s\].
const RISE_S: f64 = 0.15;
/// Each step over the next one.
const STEP_RATIO: f64 = 4.0;
const STEPS: i32 = 4;

/// The velocity of the first look, over what the axis reaches.
const FIRST_SHARE: f64 = 0.3;

/// Harmonic motions \[Hz\]: for the friction, and for what moves at other frequencies.
const SLOW_HZ: [f64; 1] = [3.0];
const HARMONIC_HZ: [f64; 8] = [5.0, 8.0, 12.0, 18.0, 28.0, 45.0, 70.0, 110.0];
/// Time of one of them \[s\], and the least and greatest number of periods.
const HARMONIC_S: f64 = 0.45;
const PERIODS: (f64, f64) = (4.0, 40.0);
/// The part of the greatest acceleration that they take.
const HARMONIC_ACCEL: f64 = 0.4;
/// The slow ones' velocity, over the steps'.
const SLOW_SHARE: f64 = 0.15;

/// Time of long harmonic motion \[s\]. A bed of 5 Hz and a damping of 0.005 takes 6 s to build up by all but a third.
const LONG_S: f64 = 4.0;

/// Parts of the greatest acceleration that it takes, the first one that the drive bears with this part of its limit.
const LONG_ACCEL: [f64; 8] = [0.8, 0.6, 0.4, 0.25, 0.15, 0.1, 0.06, 0.03];
const BORNE_SHARE: f64 = 0.9;
/// Sub-steps of dead time that a drive may have.
const DELAY_LINE: usize = 1024;

/// Ticks of the shortest period.
const PERIOD_TICKS_MIN: f64 = 10.0;

/// What an axis can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Control tick \[s\], > 0.
    pub tick_s: f64,
    /// Velocity \[mm/s\], > 0.
    pub fastest_mm_s: f64,
    /// Acceleration \[mm/s²\], > 0: about what its drive gives it.
    pub accel_mm_s2: f64,
}

impl Reach {
    /// That of an axis of which `first_look` was recorded.
    #[must_use]
    pub fn seen(first_look: &AxisRecording, fastest_mm_s: f64) -> Self {
        Self { tick_s: first_look.tick_s, fastest_mm_s, accel_mm_s2: accel_mm_s2(first_look) }
    }

    /// The fastest step \[mm/s\].
    fn step_mm_s(&self) -> f64 {
        FASTEST_MM_S.min(REACH_SHARE * self.fastest_mm_s).min(RISE_S * self.accel_mm_s2)
    }

    /// The amplitude of harmonic motion \[mm/s\].
    fn harmonic_mm_s(&self, frequency_hz: f64) -> f64 {
        HARMONIC_ACCEL * self.accel_mm_s2 / (2.0 * PI * frequency_hz)
    }
}

/// A motion of one axis about its starting point, as the commanded velocity over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Excitation {
    /// 0 → feed → 0 → −feed → 0, each change within one tick (S4).
    Steps {
        /// Velocity \[mm/s\], > 0.
        feed_mm_s: f64,
        /// Time at either feed \[s\].
        cruise_s: f64,
        /// Time at rest before, between and after \[s\].
        rest_s: f64,
    },
    /// A sine of constant velocity amplitude (S4 (2)), which grows and decays over one period each.
    Harmonic {
        /// Velocity amplitude \[mm/s\], > 0.
        amplitude_mm_s: f64,
        /// Frequency \[Hz\], > 0.
        frequency_hz: f64,
        /// Periods in all, at least 3.
        periods: u32,
    },
}

/// The first look at an axis that reaches `fastest_mm_s` \[mm/s\], > 0, and of which nothing else is known.
#[must_use]
pub fn first_look(fastest_mm_s: f64) -> Excitation {
    let feed_mm_s = (FIRST_SHARE * fastest_mm_s).min(FASTEST_MM_S);
    Excitation::Steps { feed_mm_s, cruise_s: 0.4, rest_s: 0.2 }
}

/// The highest frequency of harmonic motion in ticks of `tick_s` > 0 \[s\] \[Hz\].
#[must_use]
pub fn highest_hz(tick_s: f64) -> f64 {
    1.0 / (PERIOD_TICKS_MIN * tick_s)
}

/// The motions to run, in any order: about 10 s of machine time and 70 mm of travel to one side.
///
/// They are as fast as the axis bears: the greatest step reaches the current limit, the smallest of four does not,
/// and harmonic motion stays within two fifths of it.
#[must_use]
pub fn identification_plan(reach: &Reach) -> Vec<Excitation> {
    let step_mm_s = reach.step_mm_s();
    let steps = (0..STEPS).map(|step| {
        let feed_mm_s = step_mm_s / STEP_RATIO.powi(step);
        let cruise_s = 0.2 + 1.5 * feed_mm_s / reach.accel_mm_s2;
        Excitation::Steps { feed_mm_s, cruise_s, rest_s: 0.15 }
    });
    let harmonic = |frequency_hz: f64, most_mm_s: f64| Excitation::Harmonic {
        amplitude_mm_s: reach.harmonic_mm_s(frequency_hz).min(most_mm_s),
        frequency_hz,
        // Whole and small.
        periods: (HARMONIC_S * frequency_hz).round().clamp(PERIODS.0, PERIODS.1) as u32,
    };
    let slow = SLOW_HZ.into_iter().map(|hz| harmonic(hz, SLOW_SHARE * step_mm_s));
    let fast = HARMONIC_HZ.into_iter().filter(|hz| *hz <= highest_hz(reach.tick_s));
    steps.chain(slow).chain(fast.map(|hz| harmonic(hz, 0.5 * step_mm_s))).collect()
}

/// Harmonic motion that shows how the axis answers at a frequency, resonances with little damping included: as much of it as `drive`,
/// which the axis is taken for, bears without coming to its current limit. What a drive's own clock leaves each time the limit acts
/// would hide more than the motion shows.
/// `None` for frequencies that are not above 0, or above the highest of the plan, and for a drive that bears hardly any.
#[must_use]
pub fn long_harmonic(reach: &Reach, drive: &DriveParameters, frequency_hz: f64) -> Option<Excitation> {
    if !(frequency_hz > 0.0 && frequency_hz <= highest_hz(reach.tick_s)) {
        return None;
    }
    let periods = (LONG_S * frequency_hz).round().max(PERIODS.0) as u32;
    let of = |share: f64| Excitation::Harmonic {
        amplitude_mm_s: (share * reach.accel_mm_s2 / (2.0 * PI * frequency_hz)).min(reach.step_mm_s()),
        frequency_hz,
        periods,
    };
    let model = DriveModel::new(*drive, reach.tick_s, SUBSTEPS).ok()?;
    let most = BORNE_SHARE * drive.accel_limit_mm_s2;
    LONG_ACCEL.into_iter().map(of).find(|excitation| {
        greatest_torque_mm_s2(&model, &excitation.velocity_mm_s(reach.tick_s))
            .is_some_and(|torque| torque < most)
    })
}

/// What a drive's current loop gives at most under commands.
fn greatest_torque_mm_s2(model: &DriveModel, command_mm_s: &[f64]) -> Option<f64> {
    let mut state = DriveState::<DELAY_LINE>::at_rest(model, 0.0).ok()?;
    let torque = command_mm_s.iter().map(|command| {
        model.tick(&mut state, *command);
        state.torque_mm_s2().abs()
    });
    Some(torque.fold(0.0, f64::max))
}

/// Records an axis by `record`: a first look, and then what [`identification_plan`] asks of it.
///
/// # Errors
/// Those of `record`.
pub fn explore<E>(
    fastest_mm_s: f64,
    mut record: impl FnMut(&Excitation) -> Result<AxisRecording, E>,
) -> Result<Vec<AxisRecording>, E> {
    let mut runs = vec![record(&first_look(fastest_mm_s))?];
    for excitation in identification_plan(&Reach::seen(&runs[0], fastest_mm_s)) {
        runs.push(record(&excitation)?);
    }
    Ok(runs)
}

/// The greatest acceleration of a run \[mm/s²\], over a time in which the encoder shows it.
fn accel_mm_s2(run: &AxisRecording) -> f64 {
    let begins = run.command_mm_s.iter().position(|command| *command != run.rest_mm_s()).unwrap_or(0);
    let mut found = 0.0;
    for time_s in [5e-3, 10e-3, 20e-3, 40e-3] {
        let parabolas = Parabolas::over(time_s, run.tick_s);
        found = parabolas.greatest_accel(&run.actual_mm);
        if parabolas.greatest_accel(&run.actual_mm[..begins]) < 0.1 * found {
            break;
        }
    }
    // An axis that did not move may still be asked for a little.
    f64::max(found, 10.0)
}

impl Excitation {
    /// Commanded velocity of each tick \[mm/s\], for ticks of `tick_s` > 0 \[s\].
    #[must_use]
    pub fn velocity_mm_s(&self, tick_s: f64) -> Vec<f64> {
        // The cast cuts off; lengths that are not finite make no motion.
        let ticks = |time_s: f64| (time_s / tick_s).round() as usize;
        match *self {
            Self::Steps { feed_mm_s, cruise_s, rest_s } => {
                let mut velocity = Vec::new();
                for (feed, time_s) in [
                    (0.0, rest_s),
                    (feed_mm_s, cruise_s),
                    (0.0, rest_s),
                    (-feed_mm_s, cruise_s),
                    (0.0, rest_s),
                ] {
                    velocity.resize(velocity.len() + ticks(time_s), feed);
                }
                velocity
            }
            Self::Harmonic { amplitude_mm_s, frequency_hz, periods } => {
                let periods = f64::from(periods);
                let at = |tick: usize| {
                    let phase = tick as f64 * tick_s * frequency_hz;
                    let edge = phase.min(periods - phase).clamp(0.0, 1.0);
                    let envelope = 0.5 - 0.5 * libm::cos(PI * edge);
                    amplitude_mm_s * envelope * libm::sin(2.0 * PI * phase)
                };
                (0..ticks(periods / frequency_hz)).map(at).collect()
            }
        }
    }

    /// The value for [`AxisRecording::harmonic_hz`](super::AxisRecording::harmonic_hz).
    #[must_use]
    pub fn harmonic_hz(&self) -> Option<f64> {
        match *self {
            Self::Steps { .. } => None,
            Self::Harmonic { frequency_hz, .. } => Some(frequency_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use hal_sim::{REFERENCE_X, REFERENCE_Y};

    use super::*;

    #[test]
    fn the_plan_is_short_and_stays_within_its_travel() {
        let tick_s = 0.5e-3;
        let mut time_s = 0.0;
        for excitation in identification_plan(&Reach { tick_s, fastest_mm_s: 333.0, accel_mm_s2: 12_300.0 }) {
            let velocity = excitation.velocity_mm_s(tick_s);
            time_s += velocity.len() as f64 * tick_s;
            let mut position_mm: f64 = 0.0;
            for v in &velocity {
                position_mm += v * tick_s;
                assert!((-10.0..=70.0).contains(&position_mm), "{excitation:?}: {position_mm} mm");
            }
            assert!(velocity[0].abs() < 1e-12 && velocity.last().unwrap().abs() < 1.0, "{excitation:?}");
        }
        assert!((8.0..10.0).contains(&time_s), "{time_s} s");
    }

    #[test]
    fn a_slow_axis_gets_what_it_reaches() {
        let greatest_mm_s = |fastest_mm_s: f64| {
            let reach = Reach { tick_s: 0.5e-3, fastest_mm_s, accel_mm_s2: 12_300.0 };
            let motions = identification_plan(&reach);
            let velocities = motions.iter().flat_map(|motion| motion.velocity_mm_s(0.5e-3));
            velocities.fold(0.0, f64::max)
        };
        for fastest_mm_s in [1.0, 100.0, 160.0] {
            assert!((greatest_mm_s(fastest_mm_s) - REACH_SHARE * fastest_mm_s).abs() < 1e-9);
        }
        assert!((greatest_mm_s(1000.0) - 159.15).abs() < 1e-9);
    }

    /// The published axes; the bed of Y at 13.4 Hz pushes back. What the drive's current loop gives is that of a simulation.
    #[test]
    fn long_motion_stays_below_the_current_limit() {
        let reach = Reach { tick_s: 0.5e-3, fastest_mm_s: 333.0, accel_mm_s2: 12_300.0 };
        let accel = |drive: &DriveParameters, hz: f64| {
            let excitation = long_harmonic(&reach, drive, hz);
            let Some(Excitation::Harmonic { amplitude_mm_s, frequency_hz, periods }) = excitation else {
                panic!("no harmonic motion at {hz} Hz");
            };
            assert!((frequency_hz - hz).abs() < 1e-12 && amplitude_mm_s <= 159.2, "{amplitude_mm_s} mm/s");
            assert!(f64::from(periods) >= 4.0 && (f64::from(periods) / hz - 4.0).abs() < 10.0, "{periods}");
            let model = DriveModel::new(*drive, 0.5e-3, 20).expect("a drive");
            let command_mm_s = excitation.expect("a motion").velocity_mm_s(0.5e-3);
            let torque_mm_s2 =
                greatest_torque_mm_s2(&model, &command_mm_s).expect("a dead time of some ticks");
            assert!(torque_mm_s2 < 0.9 * drive.accel_limit_mm_s2, "{torque_mm_s2} mm/s² at {hz} Hz");
            amplitude_mm_s * 2.0 * PI * hz
        };
        for hz in [0.3, 4.7, 13.4, 53.7, 200.0] {
            accel(&REFERENCE_X, hz);
            accel(&REFERENCE_Y, hz);
        }
        // A drive follows 40 Hz nearly whole.
        let much = accel(&REFERENCE_X, 40.0);
        assert!((0.59 * 12_300.0..0.81 * 12_300.0).contains(&much), "{much} mm/s²");
        let weak = DriveParameters { accel_limit_mm_s2: 4000.0, ..REFERENCE_X };
        let little = accel(&weak, 40.0);
        assert!((0.1 * 12_300.0..0.31 * 12_300.0).contains(&little), "{little} mm/s²");
    }

    #[test]
    fn there_is_no_long_motion_out_of_reach() {
        let reach = Reach { tick_s: 0.5e-3, fastest_mm_s: 333.0, accel_mm_s2: 12_300.0 };
        for hz in [0.0, -1.0, 201.0, f64::NAN, f64::INFINITY] {
            assert_eq!(long_harmonic(&reach, &REFERENCE_X, hz), None);
        }
        // It takes 85 mm/s² to slide.
        let weak = DriveParameters { accel_limit_mm_s2: 90.0, ..REFERENCE_X };
        assert_eq!(long_harmonic(&reach, &weak, 40.0), None);
    }

    /// Steps saturate a drive for 0.15 s at most, and harmonic motion never does.
    #[test]
    fn a_weak_axis_gets_what_it_bears() {
        for accel_mm_s2 in [300.0, 3000.0] {
            let reach = Reach { tick_s: 0.5e-3, fastest_mm_s: 333.0, accel_mm_s2 };
            for motion in identification_plan(&reach) {
                match motion {
                    Excitation::Steps { feed_mm_s, .. } => assert!(feed_mm_s <= RISE_S * accel_mm_s2 + 1e-9),
                    Excitation::Harmonic { amplitude_mm_s, frequency_hz, .. } => {
                        assert!(
                            2.0 * PI * frequency_hz * amplitude_mm_s <= HARMONIC_ACCEL * accel_mm_s2 + 1e-9
                        );
                    }
                }
            }
        }
    }
}
