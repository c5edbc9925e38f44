//! Motions that show every parameter of an axis, and the set of them that identification asks for.
//!
//! Small steps show the velocity controller and the delay. Large steps show the current limit, the viscous
//! friction and, while the axis cruises, the ringing bed. Harmonic motion shows the bed again, and how the
//! delay splits into dead time and lag. Slow motion shows the Coulomb friction.

use core::f64::consts::PI;

/// The fastest motion of the plan \[m/min\].
const FASTEST_M_MIN: f64 = 9.549;
/// And the part of what an axis reaches that it may take: drift and trim need some of the output, too.
const REACH_SHARE: f64 = 0.95;

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

/// The motions to run, in any order: about 9 s of machine time and 50 mm of travel to one side.
///
/// They were chosen for axes like those of S4 (Kv 300 … 600 /s, 8 … 16 m/s², bed at 9 … 18 Hz), which are
/// faster than the plan. An axis that reaches no more than `fastest_mm_s` \[mm/s\], > 0, gets all of it
/// slower in proportion.
#[must_use]
pub fn identification_plan(fastest_mm_s: f64) -> Vec<Excitation> {
    let part = (REACH_SHARE * fastest_mm_s / (FASTEST_M_MIN * 1000.0 / 60.0)).min(1.0);
    let per_minute = |m_min: f64| part * m_min * 1000.0 / 60.0;
    let harmonic = |feed_m_min, frequency_hz, periods| Excitation::Harmonic {
        amplitude_mm_s: per_minute(feed_m_min),
        frequency_hz,
        periods,
    };
    vec![
        Excitation::Steps { feed_mm_s: per_minute(1.0), cruise_s: 0.25, rest_s: 0.1 },
        Excitation::Steps { feed_mm_s: per_minute(7.2), cruise_s: 0.4, rest_s: 0.1 },
        Excitation::Steps { feed_mm_s: per_minute(FASTEST_M_MIN), cruise_s: 0.3, rest_s: 0.1 },
        harmonic(0.12, 2.0, 3),
        harmonic(7.2, 3.0, 4),
        harmonic(2.150, 4.0, 4),
        harmonic(2.150, 10.0, 6),
        harmonic(2.150, 13.0, 9),
        harmonic(2.150, 20.0, 8),
        harmonic(2.150, 40.0, 14),
        harmonic(FASTEST_M_MIN, 16.0, 6),
    ]
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
                    let envelope = 0.5 - 0.5 * (PI * edge).cos();
                    amplitude_mm_s * envelope * (2.0 * PI * phase).sin()
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
    use super::*;

    #[test]
    fn the_plan_is_short_and_stays_within_its_travel() {
        let tick_s = 0.5e-3;
        let mut time_s = 0.0;
        for excitation in identification_plan(f64::INFINITY) {
            let velocity = excitation.velocity_mm_s(tick_s);
            time_s += velocity.len() as f64 * tick_s;
            let mut position_mm: f64 = 0.0;
            for v in &velocity {
                position_mm += v * tick_s;
                assert!((-10.0..=50.0).contains(&position_mm), "{excitation:?}: {position_mm} mm");
            }
            assert!(velocity[0].abs() < 1e-12 && velocity.last().unwrap().abs() < 1.0, "{excitation:?}");
        }
        assert!((8.0..10.0).contains(&time_s), "{time_s} s");
    }

    #[test]
    fn a_slow_axis_gets_what_it_reaches() {
        let greatest_mm_s = |fastest_mm_s: f64| {
            let motions = identification_plan(fastest_mm_s);
            let velocities = motions.iter().flat_map(|motion| motion.velocity_mm_s(0.5e-3));
            velocities.fold(0.0, f64::max)
        };
        for fastest_mm_s in [1.0, 100.0, 160.0] {
            assert!((greatest_mm_s(fastest_mm_s) - REACH_SHARE * fastest_mm_s).abs() < 1e-9);
        }
        assert!((greatest_mm_s(1000.0) - 159.15).abs() < 1e-9);
    }
}
