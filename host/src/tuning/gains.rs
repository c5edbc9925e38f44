//! The proportional gain.
//!
//! Feedforward moves the axis. Feedback corrects what feedforward does not know; a higher kp corrects more.
//! Lag bounds kp: dead time, current loop, converter. ki and kd stay 0. The drive's own controller integrates
//! already, so an integral here would add lag and no accuracy in motion, and an offset at rest belongs into
//! the output's trim; a derivative of encoder counts is noise at the frequencies where it would help.

use hal_sim::DriveParameters;

use super::margins::Margins;

/// Least phase margin \[°\]: S4's machine ran 39°.
pub const PHASE_MIN_DEG: f64 = 40.0;
/// Least gain margin.
pub const GAIN_MIN: f64 = 2.0;
/// Greatest gain that is looked at \[1/s\].
const KP_MAX_PER_S: f64 = 2000.0;

/// The greatest kp \[1/s\] that keeps both margins, and its margins. 0 if none does.
#[must_use]
pub fn proportional(drive: &DriveParameters, tick_s: f64) -> (f64, Margins) {
    let keeps = |kp_per_s: f64| {
        let margins = Margins::of(drive, kp_per_s, tick_s);
        margins.phase_deg >= PHASE_MIN_DEG && margins.gain >= GAIN_MIN
    };
    // Margins shrink as the gain grows.
    let (mut holds, mut fails) = (0.0, KP_MAX_PER_S);
    for _ in 0..16 {
        let middle = 0.5 * (holds + fails);
        if keeps(middle) {
            holds = middle;
        } else {
            fails = middle;
        }
    }
    (holds, Margins::of(drive, holds, tick_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_is_the_greatest_that_keeps_margins() {
        for drive in [hal_sim::REFERENCE_X, hal_sim::REFERENCE_Y] {
            let (kp_per_s, margins) = proportional(&drive, 5e-4);
            assert!((210.0..235.0).contains(&kp_per_s), "{kp_per_s}");
            assert!(margins.phase_deg >= PHASE_MIN_DEG && margins.gain >= GAIN_MIN);
            let more = Margins::of(&drive, 1.01 * kp_per_s, 5e-4);
            assert!(more.phase_deg < PHASE_MIN_DEG || more.gain < GAIN_MIN);
        }
    }
}
