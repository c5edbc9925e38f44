//! What an axis should be set to, and why, so that a technician can follow it number by number.

use motion_kernel::axis::{BedInverse, DriveInverse, Feedforward, Gains};
use motion_kernel::units::DacCode;

use super::feedforward::{Method, feedforward, rounded};
use super::gains::{GAIN_MIN, PHASE_MIN_DEG, proportional};
use super::margins::Margins;
use crate::identify::{AxisParametersFound, Identification};
use crate::machine::AxisSettings;

/// A key of the machine file with its new value.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// As in the file, below the axis: `regulator.kp_per_s`.
    pub key: &'static str,
    /// Before; none if the file did not have the key.
    pub before: Option<f64>,
    /// After; none if the key goes.
    pub after: Option<f64>,
    /// Its unit.
    pub unit: &'static str,
    /// Where the value comes from.
    pub reason: String,
}

/// The proposal for one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisTuning {
    /// New gains.
    pub gains: Gains,
    /// New feedforward.
    pub feedforward: Feedforward,
    /// New trim of the output \[V\].
    pub output_offset_v: f64,
    /// Margins of the new loop, in the identified model.
    pub margins: Margins,
    /// Every value that is set, changed or not, in the order of the file.
    pub changes: Vec<Change>,
    /// What a technician should know beside: what was not determined, what else the axis' settings should respect.
    pub remarks: Vec<String>,
}

/// A proposal for `axis` from what was found of it.
#[must_use]
pub fn propose(axis: &AxisSettings, found: &Identification, method: Method, tick_s: f64) -> AxisTuning {
    let parameters = &found.parameters;
    let drive = parameters.drive();
    let gain = command_gain(parameters);
    let (kp_per_s, _) = proportional(&drive, tick_s);
    // The drive's velocity is `gain` times what the scale says, and so is the loop's gain.
    let kp_per_s = rounded(libm::floor(kp_per_s / gain));
    let gains = Gains { kp_per_s, ki_per_s2: 0.0, kd: 0.0 };
    let feedforward = feedforward(method, &drive, gain, kp_per_s * gain, tick_s);
    let output_offset_v = offset_v(axis, parameters);
    let margins = Margins::of(&drive, kp_per_s * gain, tick_s);
    let mut tuning = AxisTuning {
        gains,
        feedforward,
        output_offset_v,
        margins,
        changes: Vec::new(),
        remarks: remarks(axis, found, method),
    };
    tuning.changes = changes(axis, &tuning, parameters, method, tick_s);
    tuning
}

/// To the four decimals that are shown; 0 without a sign.
fn rounded_to(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// Actual over nominal scale; 1 where the recordings do not tell it from 1.
fn command_gain(parameters: &AxisParametersFound) -> f64 {
    let gain = parameters.command_gain;
    let is_told = (gain.value - 1.0).abs() > gain.half_width_95.max(1e-3);
    if is_told && gain.value > 0.0 { gain.value } else { 1.0 }
}

/// The trim that takes the drift away. The recordings' commands are whole outputs, the old trim included, so what stands
/// still is an output by itself and no change of the old one. That stays if a converter step or the recordings do not
/// tell it from the new one.
fn offset_v(axis: &AxisSettings, parameters: &AxisParametersFound) -> f64 {
    let v_per_mm_s = DacCode::FULL_SCALE_V / parameters.command_gain.value / axis.mm_s_at_10_v;
    let still = parameters.command_offset_mm_s.times(-v_per_mm_s);
    let least_v = still.half_width_95.max(1.0 / DacCode::PER_VOLT);
    let trim_v = rounded(still.value);
    let is_told = (trim_v - axis.output_offset_v).abs() > least_v;
    if is_told && trim_v.abs() < axis.output_limit_v { trim_v } else { axis.output_offset_v }
}

fn remarks(axis: &AxisSettings, found: &Identification, method: Method) -> Vec<String> {
    let parameters = &found.parameters;
    let mut remarks = Vec::new();
    let limit = parameters.accel_limit_mm_s2;
    if limit.is_determined() {
        let share = axis.accel_mm_s2 / limit.value;
        remarks.push(format!(
            "The drive's current is at its limit at {:.0} mm/s²; accel_mm_s2 = {} is {:.0} % of it{}.",
            limit.value,
            axis.accel_mm_s2,
            share * 100.0,
            if share > 0.8 { ": too close, feedforward needs the rest" } else { "" },
        ));
    } else {
        remarks.push(
            "No run reached the drive's current limit: the admissible acceleration is not known.".to_owned(),
        );
    }
    for (name, estimate) in [
        ("Kv", parameters.velocity_gain_per_s),
        ("Ti", parameters.integral_time_s),
        ("the total delay", parameters.total_delay_s),
    ] {
        if !estimate.is_determined() {
            remarks.push(format!("The recordings do not determine {name}: do not trust this proposal."));
        }
    }
    if method != Method::Inverse {
        remarks.push(
            "V, A and J gains know neither friction nor bed: reversals and resonance keep their error."
                .to_owned(),
        );
    }
    remarks
}

fn changes(
    axis: &AxisSettings,
    tuning: &AxisTuning,
    parameters: &AxisParametersFound,
    method: Method,
    tick_s: f64,
) -> Vec<Change> {
    let change = |key, before: Option<f64>, after: Option<f64>, unit, reason: String| Change {
        key,
        before,
        after,
        unit,
        reason,
    };
    let (was, is, margins) = (&axis.feedforward, &tuning.feedforward, &tuning.margins);
    let mut list = vec![
        change(
            "output.offset_v",
            Some(axis.output_offset_v),
            Some(tuning.output_offset_v),
            "V",
            format!(
                "without it, at 0 V, the axis moves at {:.4} mm/s",
                rounded_to(parameters.command_offset_mm_s.value)
            ),
        ),
        change(
            "regulator.kp_per_s",
            Some(axis.gains.kp_per_s),
            Some(tuning.gains.kp_per_s),
            "1/s",
            format!(
                "the greatest with {PHASE_MIN_DEG}° of phase and a factor {GAIN_MIN} of gain in hand: crossover {:.1} Hz, \
                 phase margin {:.1}°, gain margin {:.2}, errors magnified at most {:.2} times",
                margins.crossover_hz, margins.phase_deg, margins.gain, margins.sensitivity
            ),
        ),
        change(
            "regulator.ki_per_s2",
            Some(axis.gains.ki_per_s2),
            Some(0.0),
            "1/s²",
            "the drive's own controller integrates; drift is trimmed by offset_v".to_owned(),
        ),
        change(
            "regulator.kd",
            Some(axis.gains.kd),
            Some(0.0),
            "",
            "differences of encoder counts are noise where phase would be won".to_owned(),
        ),
        change(
            "regulator.feedforward_velocity",
            Some(was.velocity),
            Some(is.velocity),
            "",
            format!("the axis moves at {:.4} of what mm_min_at_10_v says", parameters.command_gain.value),
        ),
        change(
            "regulator.feedforward_accel_s",
            Some(was.accel_s),
            Some(is.accel_s),
            "s",
            match method {
                Method::Inverse => "in the inverse and its lead".to_owned(),
                Method::Series => {
                    "first term of the drive's inverse: dead time + half a tick + b·Ti/Kv".to_owned()
                }
                Method::Fit => "least following error from 1 to 20 Hz".to_owned(),
            },
        ),
        change(
            "regulator.feedforward_jerk_s2",
            Some(was.jerk_s2),
            Some(is.jerk_s2),
            "s²",
            match method {
                Method::Inverse => "in the inverse and its lead".to_owned(),
                Method::Series => "second term: about delay²/2 + Ti/Kv".to_owned(),
                Method::Fit => "least following error from 1 to 20 Hz".to_owned(),
            },
        ),
        change(
            "regulator.feedforward_lead_s",
            (was.lead_s != 0.0).then_some(was.lead_s),
            (is.lead_s != 0.0).then_some(is.lead_s),
            "s",
            format!(
                "dead time {:.3} ms + half a tick {:.3} ms: what is put out now moves the axis then",
                parameters.dead_time_s.value * 1e3,
                tick_s * 500.0
            ),
        ),
    ];
    let (was, is) = (was.drive.as_ref(), is.drive.as_ref());
    let of = |drive: Option<&DriveInverse>, value: fn(&DriveInverse) -> f64| drive.map(value);
    let interval = |estimate: crate::identify::Estimate, from: &str| {
        format!(
            "{from}, ± {:.2} %",
            100.0 * estimate.half_width_95 / estimate.value.abs().max(f64::MIN_POSITIVE)
        )
    };
    let mut inverse = |key, value: fn(&DriveInverse) -> f64, unit, reason: String| {
        list.push(change(key, of(was, value), of(is, value), unit, reason));
    };
    inverse(
        "regulator.inverse.velocity_gain_per_s",
        |drive| drive.velocity_gain_per_s,
        "1/s",
        interval(parameters.velocity_gain_per_s, "torque per velocity difference, from small steps"),
    );
    inverse(
        "regulator.inverse.integral_time_s",
        |drive| drive.integral_time_s,
        "s",
        interval(parameters.integral_time_s, "how the drive recovers, from overshoot"),
    );
    inverse(
        "regulator.inverse.current_lag_s",
        |drive| drive.current_lag_s,
        "s",
        interval(parameters.current_lag_s, "how torque sets in"),
    );
    inverse(
        "regulator.inverse.viscous_friction_per_s",
        |drive| drive.viscous_friction_per_s,
        "1/s",
        "torque that grows with velocity; small beside the rest".to_owned(),
    );
    inverse(
        "regulator.inverse.coulomb_friction_mm_s2",
        |drive| drive.coulomb_friction_mm_s2,
        "mm/s²",
        interval(parameters.coulomb_friction_mm_s2, "torque that turns with the direction"),
    );
    inverse(
        "regulator.inverse.reversal_mm_s",
        |drive| drive.reversal_mm_s,
        "mm/s",
        "over this velocity friction turns; less is sharper, more is gentler".to_owned(),
    );
    let bed = |drive: Option<&DriveInverse>| drive.and_then(|drive| drive.bed);
    let (was, is) = (bed(was), bed(is));
    let found = parameters.bed;
    let mut of_bed = |key, value: fn(&BedInverse) -> f64, unit, reason: String| {
        if was.is_some() || is.is_some() {
            list.push(change(key, was.as_ref().map(value), is.as_ref().map(value), unit, reason));
        }
    };
    let no_bed = || "no bed shows in the recordings".to_owned();
    of_bed(
        "regulator.inverse.bed.frequency_hz",
        |bed| bed.frequency_hz,
        "Hz",
        found.map_or_else(no_bed, |bed| {
            format!(
                "the bed alone; with the axis' mass on it the machine shakes at {:.2} Hz",
                bed.resonance_hz()
            )
        }),
    );
    of_bed(
        "regulator.inverse.bed.damping_ratio",
        |bed| bed.damping_ratio,
        "",
        found.map_or_else(no_bed, |bed| interval(bed.damping_ratio, "how long it rings")),
    );
    of_bed(
        "regulator.inverse.bed.mass_ratio",
        |bed| bed.mass_ratio,
        "",
        found.map_or_else(no_bed, |bed| interval(bed.mass_ratio, "how strongly it rings")),
    );
    list.retain(|change| change.before.is_some() || change.after.is_some());
    list
}

#[cfg(test)]
mod tests {
    use hal_sim::{DriveModel, DriveState};

    use super::*;
    use crate::identify::{AxisRecording, identification_plan, identify};
    use crate::machine::Machine;

    const TICK_S: f64 = 5e-4;

    /// What identification finds of S4's X axis with a drift of `drift_mm_s` at 0 V and the trim of `axis`, open loop
    /// through the output's scale.
    fn found(axis: &AxisSettings, drift_mm_s: f64) -> Identification {
        let model = DriveModel::new(axis.drive, TICK_S, 20).expect("a drive");
        let trim_mm_s = axis.output_offset_v / DacCode::FULL_SCALE_V * axis.mm_s_at_10_v;
        let run = |excitation: &crate::identify::Excitation| {
            let mut drive = DriveState::<128>::at_rest(&model, 0.0).expect("a drive");
            let velocity_mm_s = excitation.velocity_mm_s(TICK_S);
            let command_mm_s: Vec<f64> = velocity_mm_s.iter().map(|v| v + trim_mm_s).collect();
            let mut latch = |command_mm_s: &f64| {
                let counts = (drive.position_mm() / 1e-4).round();
                model.tick(&mut drive, command_mm_s + drift_mm_s);
                counts * 1e-4
            };
            let actual_mm = command_mm_s.iter().map(&mut latch).collect();
            let harmonic_hz = excitation.harmonic_hz();
            AxisRecording { tick_s: TICK_S, command_mm_s, actual_mm, lead_in_ticks: 0, harmonic_hz }
        };
        identify(&identification_plan().iter().map(run).collect::<Vec<_>>()).expect("an identification")
    }

    /// Whatever the trim was, the new one is what holds the drive still, and a second tuning leaves it.
    #[test]
    fn the_trim_is_what_holds_the_drive_still() {
        let step_v = 1.0 / DacCode::PER_VOLT;
        for (old_v, drift_mm_s) in [(0.05, 0.0), (0.05, 1.5), (0.0, -1.5), (-0.02, 0.0)] {
            let mut axis = Machine::reference().axes[0].clone();
            axis.output_offset_v = old_v;
            let expected_v = -drift_mm_s / axis.mm_s_at_10_v * DacCode::FULL_SCALE_V;
            for pass in 1..=2 {
                let before_v = axis.output_offset_v;
                let found = found(&axis, drift_mm_s);
                axis.output_offset_v = propose(&axis, &found, Method::Inverse, TICK_S).output_offset_v;
                let off_v = (axis.output_offset_v - expected_v).abs();
                println!("{old_v} V, {drift_mm_s} mm/s, pass {pass}: {} V", axis.output_offset_v);
                assert!(off_v <= 2.0 * step_v, "{old_v} V, {drift_mm_s} mm/s: {}", axis.output_offset_v);
                assert!(pass == 1 || axis.output_offset_v.total_cmp(&before_v).is_eq(), "moved again");
            }
        }
    }
}
