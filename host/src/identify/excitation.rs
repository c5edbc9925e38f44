//! Motions that show every parameter of an axis, the set of them that identification asks for, and longer ones of which tuning may
//! ask further.
//!
//! Small steps show the velocity controller and the delay. Large steps show the current limit, the viscous
//! friction and, while the axis cruises, the ringing bed. Harmonic motion shows the bed again, and how the
//! delay splits into dead time and lag. Slow motion shows the Coulomb friction.

use core::f64::consts::PI;

use super::Identification;
use super::differences::Parabolas;
use super::parameters::{Unknown, Unknowns};
use super::recording::AxisRecording;
use super::simulation::{LANES, SUBSTEPS, Simulation};

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

/// Time of long harmonic motion \[s\]: a bed of 5 Hz and a damping of 0.005 has built up by half then.
const LONG_S: f64 = 4.0;

/// Parts of the greatest acceleration that it takes: the first one that the drive bears.
const LONG_ACCEL: [f64; 8] = [0.8, 0.6, 0.4, 0.25, 0.15, 0.1, 0.06, 0.03];
/// The part of its current limit that is for it: the limit is not known exactly.
const BORNE_SHARE: f64 = 0.9;
/// Slower motion shows nothing \[mm/s\].
const LEAST_MM_S: f64 = 0.1;

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

    /// The amplitude of harmonic motion that takes this `share` of the greatest acceleration \[mm/s\].
    fn harmonic_mm_s(&self, share: f64, frequency_hz: f64) -> f64 {
        share * self.accel_mm_s2 / (2.0 * PI * frequency_hz)
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
        amplitude_mm_s: reach.harmonic_mm_s(HARMONIC_ACCEL, frequency_hz).min(most_mm_s),
        frequency_hz,
        // Whole and small.
        periods: (HARMONIC_S * frequency_hz).round().clamp(PERIODS.0, PERIODS.1) as u32,
    };
    let slow = SLOW_HZ.into_iter().map(|hz| harmonic(hz, SLOW_SHARE * step_mm_s));
    let fast = HARMONIC_HZ.into_iter().filter(|hz| *hz <= highest_hz(reach.tick_s));
    steps.chain(slow).chain(fast.map(|hz| harmonic(hz, 0.5 * step_mm_s))).collect()
}

/// Long harmonic motion at `frequency_hz` \[Hz\], which shows how an axis answers there, resonances of little damping included. It is
/// as much as the drive that was `found` bears without coming to its current limit: what a drive's own clock leaves each time
/// the limit acts would hide more than the motion shows.
/// `None` for less than 1 Hz, for more than [`highest_hz`], and for a drive that bears hardly any.
#[must_use]
pub fn long_harmonic(reach: &Reach, found: &Identification, frequency_hz: f64) -> Option<Excitation> {
    let mut drive = found.ends.found;
    if !found.parameters.accel_limit_mm_s2.is_determined() {
        drive.set(Unknown::AccelLimit, reach.accel_mm_s2);
    }
    most_borne(reach, drive, frequency_hz)
}

/// The most of it that `drive` bears.
fn most_borne(reach: &Reach, mut drive: Unknowns, frequency_hz: f64) -> Option<Excitation> {
    if !(PERIODS.0 / LONG_S..=highest_hz(reach.tick_s)).contains(&frequency_hz) {
        return None;
    }
    drive.set(Unknown::AccelLimit, BORNE_SHARE * drive.get(Unknown::AccelLimit));
    let simulation = Simulation::new(&[drive; LANES], reach.tick_s, SUBSTEPS);
    let periods = (LONG_S * frequency_hz).round() as u32;
    LONG_ACCEL
        .into_iter()
        .map(|share| reach.harmonic_mm_s(share, frequency_hz).min(reach.step_mm_s()))
        .filter(|amplitude_mm_s| *amplitude_mm_s > LEAST_MM_S)
        .map(|amplitude_mm_s| Excitation::Harmonic { amplitude_mm_s, frequency_hz, periods })
        .find(|motion| simulation.run(&motion.velocity_mm_s(reach.tick_s), &mut |_, _| {}).is_empty())
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
    use hal_sim::{DriveModel, DriveParameters, DriveState};

    use super::super::fixtures::unknowns;
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

    const REACH: Reach = Reach { tick_s: 0.5e-3, fastest_mm_s: 333.0, accel_mm_s2: 12_300.0 };

    fn drive(gain: f64, limit_mm_s2: f64, bed_hz: f64, lag_s: f64) -> Unknowns {
        let values = [
            (Unknown::Gain, gain),
            (Unknown::VelocityGain, 440.0),
            (Unknown::IntegralTime, 0.0275),
            (Unknown::AccelLimit, limit_mm_s2),
            (Unknown::Coulomb, 85.0),
            (Unknown::Viscous, 0.08),
            (Unknown::BedFrequency, bed_hz),
            (Unknown::BedDamping, 0.02),
            (Unknown::BedMassRatio, 0.1),
        ];
        unknowns(values, [0.001_43, 0.0, lag_s])
    }

    /// A drive that does not come to its limit moves as one without: bit for bit, in the simulation of hal-sim. The bed pushes back
    /// at its frequency, the gain of commands is not known to the machine, and a slow current loop hides what is asked of it.
    #[test]
    fn long_motion_stays_below_the_current_limit() {
        for drive in [
            drive(1.0, 12_300.0, 13.4, 0.37e-3),
            drive(1.25, 12_300.0, 70.0, 2e-3),
            drive(0.8, 9000.0, 110.0, 1e-3),
            drive(1.0, 3000.0, 18.0, 0.37e-3),
        ] {
            for hz in [1.0, 4.7, 13.4, 18.0, 53.7, 70.0, 110.0, 200.0] {
                let motion = most_borne(&REACH, drive, hz);
                let Some(Excitation::Harmonic { amplitude_mm_s, frequency_hz, periods }) = motion else {
                    panic!("no harmonic motion at {hz} Hz");
                };
                assert!(
                    (frequency_hz - hz).abs() < 1e-12 && amplitude_mm_s <= 159.2,
                    "{amplitude_mm_s} mm/s"
                );
                assert!((f64::from(periods) / hz - 4.0).abs() < 0.6 / hz, "{periods} periods");
                let positions_mm = |limit_mm_s2: f64| -> Vec<f64> {
                    let limited = DriveParameters { accel_limit_mm_s2: limit_mm_s2, ..drive.drive() };
                    let model = DriveModel::new(limited, REACH.tick_s, SUBSTEPS).expect("a drive");
                    let mut state =
                        DriveState::<256>::at_rest(&model, 0.0).expect("a dead time of some ticks");
                    let command_mm_s = motion.expect("a motion").velocity_mm_s(REACH.tick_s);
                    let gain = drive.get(Unknown::Gain);
                    let each = command_mm_s.iter().map(|command| {
                        model.tick(&mut state, gain * command);
                        state.position_mm()
                    });
                    each.collect()
                };
                let limit_mm_s2 = drive.get(Unknown::AccelLimit);
                let [limited, free] = [limit_mm_s2, 100.0 * limit_mm_s2].map(positions_mm);
                assert_eq!(limited, free, "{hz} Hz, {amplitude_mm_s} mm/s");
            }
        }
    }

    /// What a drive follows nearly whole takes what it has, and a weak one less.
    #[test]
    fn long_motion_is_as_much_as_a_drive_bears() {
        let accel_mm_s2 =
            |limit_mm_s2: f64| match most_borne(&REACH, drive(1.0, limit_mm_s2, 300.0, 0.37e-3), 40.0) {
                Some(Excitation::Harmonic { amplitude_mm_s, frequency_hz, .. }) => {
                    2.0 * PI * frequency_hz * amplitude_mm_s
                }
                other => panic!("{other:?}"),
            };
        for (limit_mm_s2, least, most) in [(12_300.0, 0.59, 0.81), (4000.0, 0.14, 0.26)] {
            let part = accel_mm_s2(limit_mm_s2) / REACH.accel_mm_s2;
            assert!((least..most).contains(&part), "{part} with {limit_mm_s2} mm/s²");
        }
    }

    #[test]
    fn there_is_no_long_motion_out_of_reach() {
        let strong = drive(1.0, 12_300.0, 300.0, 0.37e-3);
        for hz in [0.0, -1.0, 0.99, 201.0, f64::NAN, f64::INFINITY] {
            assert_eq!(most_borne(&REACH, strong, hz), None);
        }
        // It takes 85 mm/s² to slide.
        assert_eq!(most_borne(&REACH, drive(1.0, 90.0, 300.0, 0.37e-3), 40.0), None);
        let slow = Reach { accel_mm_s2: 100.0, ..REACH };
        assert_eq!(most_borne(&slow, strong, 200.0), None, "0.06 mm/s");
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
