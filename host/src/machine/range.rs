//! Numbers that carry their range in their type.
//!
//! The check runs while the file is being read, so the reader knows line and column of a wrong value.

use std::fmt;
use std::marker::PhantomData;

use motion_kernel::axis::{BACKLASH_MM_MAX, PITCH_ERROR_SPACING_MM, PITCH_ERROR_UM_MAX};
use motion_kernel::plan::CURVE_FEED_SHARE_MAX;
use serde::Deserialize;
use serde::de::{Deserializer, Error, Unexpected, Visitor};

/// A range of finite numbers. None of them contains what is not a number.
pub(super) trait Range {
    /// "a number …", as errors say it.
    const EXPECTED: &'static str;
    /// Whether `value` is allowed.
    fn contains(value: f64) -> bool;
}

/// The rule for the letter of an axis.
pub(super) const AXIS_LETTER: &str = "one of the letters X, Y, Z, A, B, C, U, V, W";
/// The rule for the name of an axis, which heads seven columns of a trace.
pub(super) const AXIS_NAME: &str = "1 to 8 letters and digits";
/// Most characters of an axis's name.
pub(super) const NAME_CHARACTERS_MAX: usize = 8;
/// Widths of a counter register.
pub(super) const TIMER_BITS: &str = "16 or 32";
/// Amplitudes of an encoder's noise.
pub(super) const NOISE_COUNTS: &str = "a whole number from 0 to 1000";
/// The greatest of them.
pub(super) const NOISE_COUNTS_MAX: u16 = 1000;
/// The reactions of an emergency stop.
pub(super) const PATH_MODE: &str = "\"blend\" or \"exact\"";
pub(super) const EMERGENCY_STOP: &str = "\"immediate\", \"ramp\" or \"stop\"";
/// Ways that a spindle turns.
pub(super) const SPINDLE_TURNS: &str = "\"both\" or \"clockwise\"";
/// Kinds of coolant.
pub(super) const COOLANT_KINDS: &str = "\"both\", \"flood\" or \"mist\"";
/// Names of a subroutine, or none.
pub(super) const SUBROUTINE: &str = "letters, digits, '-' and '_', or \"\" for none";
/// Whether a table repeats.
pub(super) const REPEATS: &str = "true or false";
/// Seeds of an encoder's noise.
pub(super) const NOISE_SEED: &str = "a whole number, 0 or more";

/// A number within `R`.
pub(super) struct Within<R>(pub(super) f64, PhantomData<R>);

macro_rules! ranges {
    ($($name:ident: $expected:literal, $contains:expr;)*) => {$(
        pub(super) struct $name;
        impl Range for $name {
            const EXPECTED: &'static str = $expected;
            fn contains(value: f64) -> bool {
                let contains: fn(f64) -> bool = $contains;
                contains(value)
            }
        }
    )*};
}

// Ends are far beyond any machine: they keep quotients and products of several values finite in f32, too.
ranges! {
    Tick: "a number from 0.00002 to 0.02", |value| (0.00002..=0.02).contains(&value);
    Limit: "a number from 0.001 to 1e12", |value| (0.001..=1e12).contains(&value);
    JunctionAngle: "a number from 0 to 30", |value| (0.0..=30.0).contains(&value);
    CornerAngle: "a number from 0 to 180", |value| (0.0..=180.0).contains(&value);
    CurveShare: "a number from 0.1 to 0.85", |value| (0.1..=CURVE_FEED_SHARE_MAX).contains(&value);
    BlendTolerance: "a number from 0 to 10", |value| (0.0..=10.0).contains(&value);
    Ramp: "a number from 0 to 1", |value| (0.0..=1.0).contains(&value);
    StopTime: "a number from 0 to 60", |value| (0.0..=60.0).contains(&value);
    SpindleTime: "a number from 0 to 600", |value| (0.0..=600.0).contains(&value);
    SpindleSpeed: "a number from 1 to 1e6", |value| (1.0..=1e6).contains(&value);
    ErrorGrowth: "a number from 0 to 10", |value| (0.0..=10.0).contains(&value);
    Jump: "a number from 1e-6 to 1000", |value| (1e-6..=1000.0).contains(&value);
    Watch: "a number from 0.00002 to 10", |value| (2e-5..=10.0).contains(&value);
    Load: "a number from 0.001 to 1e9", |value| (1e-3..=1e9).contains(&value);
    Coordinate: "a number from -1e6 to 1e6", |value| value.abs() <= 1e6;
    FollowingError: "a number from 0.0001 to 1000", |value| (0.0001..=1000.0).contains(&value);
    Resolution: "a number above 1e-8 and below 0.5", |value| value > 1e-8 && value < 0.5;
    Velocity: "a number of magnitude 0.001 to 1e9", |value| (0.001..=1e9).contains(&value.abs());
    OutputLimit: "a number above 0, at most 10", |value| value > 0.0 && value <= 10.0;
    OutputOffset: "a number above -10 and below 10", |value| value.abs() < 10.0;
    Gain: "a number from 0 to 1e9", |value| (0.0..=1e9).contains(&value);
    FeedforwardGain: "a number from -1000 to 1000", |value| value.abs() <= 1000.0;
    Positive: "a number from 1e-6 to 1e9", |value| (1e-6..=1e9).contains(&value);
    DeadTime: "a number from 0 to 0.01", |value| (0.0..=0.01).contains(&value);
    LeadTime: "a number from 0 to 0.48", |value| (0.0..=0.48).contains(&value);
    TablePoint: "a number from -100000 to 100000", |value| value.abs() <= 1e5;
    InverseGain: "a number from 0.001 to 1e6", |value| (1e-3..=1e6).contains(&value);
    IntegralTime: "a number from 0.00002 to 1e6", |value| (2e-5..=1e6).contains(&value);
    Lag: "a number from 0 to 1", |value| (0.0..=1.0).contains(&value);
    Friction: "a number from 0 to 1e6", |value| (0.0..=1e6).contains(&value);
    Reversal: "a number from 0.001 to 1e6", |value| (1e-3..=1e6).contains(&value);
    Damping: "a number from 0.001 to 1", |value| (1e-3..=1.0).contains(&value);
    Length: "a number from 0.001 to 100000", |value| (0.001..=1e5).contains(&value);
    LengthOrNone: "a number from 0 to 100000", |value| (0.0..=1e5).contains(&value);
    Place: "a number from -100000 to 100000", |value| value.abs() <= 1e5;
    MassRatio: "a number from 1e-6 to 100", |value| (1e-6..=100.0).contains(&value);
    Play: "a number above 0, at most 1", |value| value > 0.0 && value <= BACKLASH_MM_MAX;
    TakeUp: "a number from 0.00002 to 1", |value| (2e-5..=1.0).contains(&value);
    PlayOrNone: "a number from 0 to 1", |value| (0.0..=BACKLASH_MM_MAX).contains(&value);
    Spacing: "a number from 0.01 to 1000", |value| (PITCH_ERROR_SPACING_MM[0]..=PITCH_ERROR_SPACING_MM[1]).contains(&value);
    PitchErrorPoint: "a number from -300 to 300", |value| value.abs() <= PITCH_ERROR_UM_MAX;
    Amplitude: "a number from 0 to 300", |value| (0.0..=PITCH_ERROR_UM_MAX).contains(&value);
    Angle: "a number from -360 to 360", |value| value.abs() <= 360.0;
    Inertia: "a number above -1, at most 1000", |value| value > -1.0 && value <= 1000.0;
}

impl<'de, R: Range> Deserialize<'de> for Within<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Number<R>(PhantomData<R>);

        impl<R: Range> Visitor<'_> for Number<R> {
            type Value = f64;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str(R::EXPECTED)
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
                if R::contains(value) {
                    Ok(value)
                } else {
                    Err(E::invalid_value(Unexpected::Float(value), &self))
                }
            }

            // 5 is as good as 5.0. Integers of a range's size are exact.
            fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
                self.visit_f64(value as f64)
            }
        }

        deserializer.deserialize_f64(Number(PhantomData::<R>)).map(|value| Self(value, PhantomData))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words name the ends: what lies on them is told from what lies beyond them as they say.
    fn words_are_the_range<R: Range>() {
        let words = R::EXPECTED;
        let mut ends = words.split([' ', ',']).filter_map(|word| word.parse::<f64>().ok());
        let (Some(low), Some(high), None) = (ends.next(), ends.next(), ends.next()) else {
            panic!("{words}: expected two numbers");
        };
        let has_low = !words.contains("above");
        let has_high = !words.contains("below");
        assert_eq!((R::contains(low), R::contains(high)), (has_low, has_high), "{words}");
        let inside = |end: f64, to: f64| end + 1e-9 * (to - end);
        let beyond = |end: f64, from: f64| end + 1e-9 * (end - from);
        assert!(R::contains(inside(low, high)) && R::contains(inside(high, low)), "{words}");
        assert!(!R::contains(beyond(high, low)), "{words}");
        if words.contains("magnitude") {
            assert!(!R::contains(0.999 * low) && !R::contains(-0.999 * low), "{words}");
            assert!(R::contains(-high) && !R::contains(-beyond(high, low)), "{words}");
        } else {
            assert!(!R::contains(beyond(low, high)) && !R::contains(-high - 1.0), "{words}");
        }
        assert!(!R::contains(f64::NAN) && !R::contains(f64::INFINITY), "{words}");
    }

    #[test]
    fn words_and_checks_agree() {
        words_are_the_range::<Tick>();
        words_are_the_range::<Limit>();
        words_are_the_range::<JunctionAngle>();
        words_are_the_range::<CornerAngle>();
        words_are_the_range::<CurveShare>();
        words_are_the_range::<FollowingError>();
        words_are_the_range::<Ramp>();
        words_are_the_range::<StopTime>();
        words_are_the_range::<ErrorGrowth>();
        words_are_the_range::<Jump>();
        words_are_the_range::<Watch>();
        words_are_the_range::<Load>();
        words_are_the_range::<Coordinate>();
        words_are_the_range::<Resolution>();
        words_are_the_range::<Velocity>();
        words_are_the_range::<OutputLimit>();
        words_are_the_range::<OutputOffset>();
        words_are_the_range::<Gain>();
        words_are_the_range::<FeedforwardGain>();
        words_are_the_range::<Positive>();
        words_are_the_range::<DeadTime>();
        words_are_the_range::<LeadTime>();
        words_are_the_range::<TablePoint>();
        words_are_the_range::<InverseGain>();
        words_are_the_range::<IntegralTime>();
        words_are_the_range::<Lag>();
        words_are_the_range::<Friction>();
        words_are_the_range::<Reversal>();
        words_are_the_range::<Damping>();
        words_are_the_range::<Length>();
        words_are_the_range::<LengthOrNone>();
        words_are_the_range::<Place>();
        words_are_the_range::<MassRatio>();
        words_are_the_range::<Play>();
        words_are_the_range::<PlayOrNone>();
        words_are_the_range::<Spacing>();
        words_are_the_range::<PitchErrorPoint>();
        words_are_the_range::<Amplitude>();
        words_are_the_range::<Angle>();
        words_are_the_range::<Inertia>();
    }
}
