//! The proposed settings of an axis with their reasons, so that a technician can follow them number by
//! number.

use motion_kernel::axis::{
    AxesConfig, AxisFigures, BedInverse, DriveInverse, Feedforward, Gains, PREVIEW_TICKS_MAX, ScaleError,
    Table,
};
use motion_kernel::units::DacCode;

use super::error::TuningError;
use super::feedforward::{Method, feedforward};
use super::gains::{GAIN_MIN, NOISE_PART, PHASE_MIN_DEG};
use super::known::{Known, Origin};
use super::margins::Margins;
use super::position_loop::{PositionLoop, command_gain};
use crate::identify::{AxisParametersFound, BedEstimate, Estimate, Identification, highest_hz};
use crate::machine::AxisSettings;

/// A key of the machine file with its new value.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The key as in the file, below the axis: `regulator.kp_per_s`.
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
    /// Margins of the new loop, in the identified model ...
    pub margins: Margins,
    /// ... and how well the recordings tell its phase margin \[°\] ...
    pub phase_margin_deg: Estimate,
    /// ... and its gain margin. Infinite if there is none.
    pub gain_margin: Estimate,
    /// Every value that is set, changed or not, in the order of the file.
    pub changes: Vec<Change>,
    /// Remarks for the technician: what was not determined, what else the axis' settings should respect.
    pub remarks: Vec<String>,
}

/// A proposal for `axis` from what was found of it.
///
/// # Errors
/// What everything depends on was not found, or the kernel has no room for the figures.
pub fn propose(
    axis: &AxisSettings,
    found: &Identification,
    method: Method,
    tick_s: f64,
) -> Result<AxisTuning, TuningError> {
    let parameters = &found.parameters;
    let known = Known::new(axis, parameters, tick_s)?;
    // Feedforward does nothing for what is not known. A loop has it all the same: what explains the recordings best.
    let (drive, gain) = (&known.drive, command_gain(parameters));
    let position_loop =
        PositionLoop::new(axis, found, tick_s).ok_or_else(|| TuningError::Lag { axis: axis.name.clone() })?;
    let PositionLoop { gains, loop_gains, margins, phase_margin_deg, gain_margin } = position_loop;
    let mut tuning = AxisTuning {
        gains,
        feedforward: feedforward(method, drive, gain, &loop_gains, tick_s),
        output_offset_v: offset_v(axis, parameters),
        margins,
        phase_margin_deg,
        gain_margin,
        changes: Vec::new(),
        remarks: remarks(axis, found),
    };
    tuning.remarks.extend(unclear_margins(found, &position_loop.unclear_hz(), tick_s));
    let series = || feedforward(Method::Series, drive, gain, &loop_gains, tick_s);
    simplify(axis, &mut tuning, tick_s, series)?;
    if tuning.feedforward.drive.is_none() {
        tuning.feedforward.tables = axis.feedforward.tables;
    }
    if tuning.feedforward.drive.is_none() {
        tuning.remarks.push(
            "V, A and J gains know neither friction nor bed: reversals and resonance keep their error."
                .to_owned(),
        );
    }
    tuning.changes = changes(axis, &tuning, parameters, &known, method);
    Ok(tuning)
}

/// What to say of margins that are not known well, read at these frequencies, if motion there would tell more.
fn unclear_margins(found: &Identification, frequencies_hz: &[f64], tick_s: f64) -> Option<String> {
    let within = frequencies_hz.iter().filter(|hz| **hz <= highest_hz(tick_s));
    let unclear: Vec<String> = within.map(|hz| format!("{hz:.1} Hz")).collect();
    (found.gains_by_motion() && !unclear.is_empty()).then(|| {
        format!("Margins would be known better from longer harmonic motion at {}.", unclear.join(" and at "))
    })
}

/// Leaves out what the kernel would refuse, the bed first, and says so.
fn simplify(
    axis: &AxisSettings,
    tuning: &mut AxisTuning,
    tick_s: f64,
    series: impl Fn() -> Feedforward,
) -> Result<(), TuningError> {
    while let Err(cause) = accepted(axis, tuning, tick_s) {
        let (what, simpler) = match tuning.feedforward.drive {
            Some(drive @ DriveInverse { bed: Some(_), .. }) => {
                let drive = Some(DriveInverse { bed: None, ..drive });
                ("the bed", Feedforward { drive, ..tuning.feedforward })
            }
            Some(_) => ("the drive's inverse", series()),
            None => return Err(TuningError::Refused { axis: axis.name.clone(), cause }),
        };
        tuning.remarks.push(format!("Without {what}: {cause}."));
        tuning.feedforward = simpler;
    }
    Ok(())
}

/// Whether the kernel would run the axis with it.
fn accepted(axis: &AxisSettings, tuning: &AxisTuning, tick_s: f64) -> Result<(), ScaleError> {
    let &AxisTuning { gains, feedforward, output_offset_v, .. } = tuning;
    let figures = AxisFigures { gains, feedforward, output_offset_v, ..axis.figures() };
    AxesConfig::<f32, 1>::new(&[figures], tick_s).map(drop).map_err(|error| error.cause)
}

/// What an estimate was determined from, and how well.
fn interval(estimate: Estimate, from: &str) -> String {
    let part = estimate.half_width_95 / estimate.value.abs().max(f64::MIN_POSITIVE);
    format!("{from}, ± {:.2} %", 100.0 * part)
}

/// Rounds to the four decimals that are shown; 0 has no sign.
fn rounded_to(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// The trim that takes the drift away. The recordings' commands are whole outputs, the old trim included, so
/// what stands still is an output by itself and no change of the old one. That stays if a converter step or
/// the recordings do not tell it from the new one.
fn offset_v(axis: &AxisSettings, parameters: &AxisParametersFound) -> f64 {
    let v_per_mm_s = DacCode::FULL_SCALE_V / parameters.command_gain.value / axis.mm_s_at_10_v;
    let still = parameters.command_offset_mm_s.times(-v_per_mm_s);
    let least_v = still.half_width_95.max(1.0 / DacCode::PER_VOLT);
    // To a microvolt, a three-hundredth of a converter step; 0 without a sign.
    let trim_v = (still.value * 1e6).round() / 1e6 + 0.0;
    let is_told = (trim_v - axis.output_offset_v).abs() > least_v;
    if is_told && trim_v.abs() < axis.output_limit_v { trim_v } else { axis.output_offset_v }
}

fn remarks(axis: &AxisSettings, found: &Identification) -> Vec<String> {
    let parameters = &found.parameters;
    let mut remarks = Vec::new();
    if !found.is_met() {
        remarks.push(format!(
            "The model does not follow the recordings: what is left has {:.1} times the square of the readings' errors. \
             The axis has something that the model lacks, and intervals are as wide as that allows.",
            found.misfit_per_reading,
        ));
    }
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
    remarks
}

fn changes(
    axis: &AxisSettings,
    tuning: &AxisTuning,
    parameters: &AxisParametersFound,
    known: &Known,
    method: Method,
) -> Vec<Change> {
    let change = |key, before: Option<f64>, after: Option<f64>, unit, reason: String| Change {
        key,
        before,
        after,
        unit,
        reason,
    };
    let (was, is, margins) = (&axis.feedforward, &tuning.feedforward, &tuning.margins);
    let gains = &tuning.gains;
    let from = |method_is: &str| match (is.drive, is.accel_s > 0.0) {
        (None, _) if method == Method::Fit => "least following error from 1 to 20 Hz".to_owned(),
        (None, _) => method_is.to_owned(),
        (Some(_), false) => "in the inverse and its lead".to_owned(),
        (Some(_), true) => {
            format!("what set-points can't be delayed by: more than {PREVIEW_TICKS_MAX} ticks of lead")
        }
    };
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
                "with kd it leaves least of disturbances, with {PHASE_MIN_DEG}° of phase and a factor {GAIN_MIN} of gain in \
                 hand: crossover {:.1} Hz, phase margin {:.2} ± {:.2}°, gain margin {:.3} ± {:.3}, errors magnified at most \
                 {:.2} times",
                margins.crossover_hz,
                margins.phase_deg,
                tuning.phase_margin_deg.half_width_95,
                margins.gain,
                tuning.gain_margin.half_width_95,
                margins.sensitivity
            ),
        ),
        change(
            "regulator.ki_per_s2",
            Some(axis.gains.ki_per_s2),
            Some(0.0),
            "1/s²",
            "the drive's own controller integrates, and two integrals would not let an axis with friction rest; drift is \
             trimmed by offset_v"
                .to_owned(),
        ),
        change(
            "regulator.kd",
            Some(axis.gains.kd),
            Some(gains.kd),
            "",
            if gains.kd > 0.0 {
                "makes up for the lag of the drive's velocity loop".to_owned()
            } else {
                format!(
                    "kp leaves less without it, of a kd whose noise of the readings is below {:.1} % of the current limit",
                    100.0 * NOISE_PART
                )
            },
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
            from("first term of the drive's inverse: dead time + half a tick + b·Ti/Kv"),
        ),
        change(
            "regulator.feedforward_jerk_s2",
            Some(was.jerk_s2),
            Some(is.jerk_s2),
            "s²",
            from("second term: about delay²/2 + Ti/Kv"),
        ),
        change(
            "regulator.feedforward_lead_s",
            (was.lead_s != 0.0).then_some(was.lead_s),
            (is.lead_s != 0.0).then_some(is.lead_s),
            "s",
            format!(
                "dead time {:.3} ms + half a tick: what is put out now moves the axis then",
                known.drive.dead_time_s * 1e3,
            ),
        ),
    ];
    let tables = |of: &Feedforward| [of.tables.velocity, of.tables.accel, of.tables.jerk];
    let keys = [
        "regulator.feedforward_velocity_table.reach",
        "regulator.feedforward_accel_table.reach",
        "regulator.feedforward_jerk_table.reach",
    ];
    for (((key, unit), was), is) in
        keys.into_iter().zip(["mm/s", "mm/s²", "mm/s³"]).zip(tables(was)).zip(tables(is))
    {
        let reason = match is {
            Some(_) => "the table stays; it was not looked at".to_owned(),
            None => "the table goes: the inverse has friction and lag, which would come twice".to_owned(),
        };
        let reach = |table: Option<Table>| table.map(|table| table.reach);
        list.push(change(key, reach(was), reach(is), unit, reason));
    }
    let (was, is) = (was.drive.as_ref(), is.drive.as_ref());
    let of = |drive: Option<&DriveInverse>, value: fn(&DriveInverse) -> f64| drive.map(value);
    let origin = |origin: Origin, recorded: String| match origin {
        Origin::Recorded => recorded,
        Origin::File => "the recordings do not determine it: as it was, as far as they allow".to_owned(),
        Origin::Least => "the recordings do not determine it: as little as they allow".to_owned(),
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
        origin(known.current_lag, interval(parameters.current_lag_s, "how torque sets in")),
    );
    inverse(
        "regulator.inverse.viscous_friction_per_s",
        |drive| drive.viscous_friction_per_s,
        "1/s",
        origin(
            known.viscous_friction,
            "torque that grows with velocity; small compared with the rest".to_owned(),
        ),
    );
    inverse(
        "regulator.inverse.coulomb_friction_mm_s2",
        |drive| drive.coulomb_friction_mm_s2,
        "mm/s²",
        origin(
            known.coulomb_friction,
            interval(parameters.coulomb_friction_mm_s2, "torque that changes sign with the direction"),
        ),
    );
    inverse(
        "regulator.inverse.reversal_mm_s",
        |drive| drive.reversal_mm_s,
        "mm/s",
        "over this velocity friction changes sign; less is sharper, more is gentler".to_owned(),
    );
    let bed = |drive: Option<&DriveInverse>| drive.and_then(|drive| drive.bed);
    let (was, is) = (bed(was), bed(is));
    let found = parameters.bed;
    let mut of_bed = |key, value: fn(&BedInverse) -> f64, unit, reason: String| {
        if was.is_some() || is.is_some() {
            list.push(change(key, was.as_ref().map(value), is.as_ref().map(value), unit, reason));
        }
    };
    let of = |part: fn(&BedEstimate) -> String| {
        let recorded = match (is, &found) {
            (None, Some(_)) => "the kernel has no room for it".to_owned(),
            (_, None) => "no bed shows in the recordings".to_owned(),
            (_, Some(bed)) => part(bed),
        };
        origin(known.bed, recorded)
    };
    of_bed(
        "regulator.inverse.bed.frequency_hz",
        |bed| bed.frequency_hz,
        "Hz",
        of(|bed| {
            let shakes_hz = bed.resonance_hz();
            format!("the bed alone; with the axis' mass on it the machine shakes at {shakes_hz:.2} Hz")
        }),
    );
    of_bed(
        "regulator.inverse.bed.damping_ratio",
        |bed| bed.damping_ratio,
        "",
        of(|bed| interval(bed.damping_ratio, "how long it rings")),
    );
    of_bed(
        "regulator.inverse.bed.mass_ratio",
        |bed| bed.mass_ratio,
        "",
        of(|bed| interval(bed.mass_ratio, "how strongly it rings")),
    );
    list.retain(|change| change.before.is_some() || change.after.is_some());
    list
}

#[cfg(test)]
mod tests {
    use hal_sim::{DriveModel, DriveState};

    use super::super::feedforward::rounded;
    use super::*;
    use crate::identify::{AxisRecording, explore, identify};
    use crate::machine::Machine;

    const TICK_S: f64 = 5e-4;

    /// What identification finds of S4's X axis with a drift of `drift_mm_s` at 0 V and the trim of `axis`,
    /// open loop through the output's scale.
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
            Ok::<_, ()>(AxisRecording {
                tick_s: TICK_S,
                command_mm_s,
                actual_mm,
                lead_in_ticks: 0,
                harmonic_hz,
            })
        };
        identify(&explore(333.0, run).expect("runs")).expect("an identification")
    }

    /// No axis is moved at over 200 Hz in these ticks, and without noise longer motion tells nothing new.
    #[test]
    fn motion_that_would_tell_margins_better_is_named() {
        let axis = Machine::reference().axes[0].clone();
        let quiet = found(&axis, 0.0);
        let mut noisy = quiet.clone();
        noisy.figures.reading_noise_mm = quiet.figures.resolution_mm;
        let said = |found: &Identification, hz: &[f64]| unclear_margins(found, hz, TICK_S);
        let words = said(&noisy, &[33.0, 61.0, 205.0]).expect("a remark");
        assert!(words.contains("motion at 33.0 Hz and at 61.0 Hz."), "{words}");
        assert_eq!([said(&noisy, &[205.0]), said(&noisy, &[])], [None, None]);
        assert_eq!(said(&quiet, &[33.0]), None);
    }

    /// What everything depends on has to be known; what the rest is not known to be stays, as far as the
    /// recordings allow.
    #[test]
    fn what_is_not_determined_is_not_tuned_by() {
        let mut axis = Machine::reference().axes[1].clone();
        axis.output_offset_v = 0.0;
        let whole = found(&axis, 0.0);
        let unknown = |estimate: &mut Estimate| estimate.half_width_95 = estimate.value;
        type Part = fn(&mut AxisParametersFound) -> &mut Estimate;
        let needed: [(&str, Part); 4] = [
            ("command gain", |found| &mut found.command_gain),
            ("Kv [1/s]", |found| &mut found.velocity_gain_per_s),
            ("Ti [s]", |found| &mut found.integral_time_s),
            ("total delay [s]", |found| &mut found.total_delay_s),
        ];
        for (name, part) in needed {
            let mut found = whole.clone();
            unknown(part(&mut found.parameters));
            let refusal = propose(&axis, &found, Method::Inverse, TICK_S).expect_err(name);
            assert!(matches!(refusal, TuningError::Undetermined { quantity, .. } if quantity == name));
            assert!(refusal.to_string().starts_with("tuning of axis Y: found "), "{refusal}");
        }
        let mut found = whole.clone();
        let parameters = &mut found.parameters;
        for estimate in [
            &mut parameters.current_lag_s,
            &mut parameters.viscous_friction_per_s,
            &mut parameters.coulomb_friction_mm_s2,
            &mut parameters.bed.as_mut().expect("Y has a bed").mass_ratio,
        ] {
            unknown(estimate);
        }
        let drive = |axis: &AxisSettings| {
            let tuning = propose(axis, &found, Method::Inverse, TICK_S).expect("a proposal");
            let said =
                |words: &str| tuning.changes.iter().filter(|change| change.reason.contains(words)).count();
            (
                tuning.feedforward.drive.expect("an inverse"),
                tuning.feedforward.lead_s,
                said("do not determine it"),
            )
        };
        // Nothing in the file: as little as fits, and the whole delay stays what it is.
        let (least, lead_s, said) = drive(&axis);
        assert_eq!((least.coulomb_friction_mm_s2, least.current_lag_s, least.bed), (0.0, 0.0, None));
        assert!((lead_s - whole.parameters.total_delay_s.value).abs() < 1e-8, "{lead_s}");
        assert_eq!(said, 3);
        // The file has figures: they stay.
        let bed = BedInverse { frequency_hz: 13.0, damping_ratio: 0.02, mass_ratio: 0.05 };
        axis.feedforward.drive = Some(DriveInverse {
            current_lag_s: 3e-4,
            coulomb_friction_mm_s2: 200.0,
            viscous_friction_per_s: 0.06,
            bed: Some(bed),
            ..least
        });
        let (kept, _, said) = drive(&axis);
        assert_eq!((kept.coulomb_friction_mm_s2, kept.current_lag_s, kept.bed), (200.0, 3e-4, Some(bed)));
        assert_eq!(said, 6);
        // But not against the recordings.
        axis.feedforward.drive = Some(DriveInverse { coulomb_friction_mm_s2: 9000.0, ..least });
        let most_mm_s2 = rounded(found.parameters.coulomb_friction_mm_s2.upper());
        assert!((drive(&axis).0.coulomb_friction_mm_s2 - most_mm_s2).abs() < 1e-9);
    }

    /// What the kernel has no room for is left out with its reason, and the file can be read again.
    #[test]
    fn a_proposal_fits_the_kernel() {
        let axis = Machine::reference().axes[1].clone();
        let whole = found(&axis, 0.0);
        let propose = |change: fn(&mut AxisParametersFound), tick_s: f64| {
            let mut found = whole.clone();
            change(&mut found.parameters);
            propose(&axis, &found, Method::Inverse, tick_s).expect("a proposal")
        };
        // 1.43 ms at ticks of 0.05 ms: more than 24 of them; the rest is in the gains.
        let tick_s = 5e-5;
        let tuning = propose(|_| {}, tick_s);
        let Feedforward { lead_s, accel_s, jerk_s2, drive, .. } = tuning.feedforward;
        assert!((lead_s - 24.0 * tick_s).abs() < 1e-15 && drive.is_some());
        let left_s = whole.parameters.total_delay_s.value - whole.parameters.current_lag_s.value - lead_s;
        assert!((accel_s - left_s).abs() < 1e-8 && (jerk_s2 - left_s * left_s / 2.0).abs() < 1e-12);
        let said =
            |tuning: &AxisTuning, words: &str| tuning.remarks.iter().any(|remark| remark.contains(words));
        let left_out = |tuning: &AxisTuning| said(tuning, "Without the");
        assert!(!left_out(&tuning));
        // A bed that an inverse of one step a tick can't follow, and one without damping.
        let fast = propose(|found| found.bed.as_mut().expect("a bed").frequency_hz.value = 150.0, 2e-3);
        assert!(fast.feedforward.drive.is_some_and(|drive| drive.bed.is_none()));
        assert!(said(&fast, "Without the bed: bed frequency [Hz] 150: expected"), "{:?}", fast.remarks);
        let hard = |found: &mut AxisParametersFound| {
            let damping = &mut found.bed.as_mut().expect("a bed").damping_ratio;
            (damping.value, damping.half_width_95) = (1e-4, 1e-5);
        };
        assert!(said(&propose(hard, TICK_S), "Without the bed: bed damping ratio"));
        // A controller faster than a tick.
        let quick = |found: &mut AxisParametersFound| {
            let time = &mut found.integral_time_s;
            (time.value, time.half_width_95) = (2e-4, 1e-6);
        };
        let tuning = propose(quick, TICK_S);
        assert!(tuning.feedforward.drive.is_none() && tuning.feedforward.accel_s > 0.0);
        assert!(said(&tuning, "Without the drive's inverse: drive integral time [s] 0.0002"));
    }

    /// An inverse takes the place of tables; gains do not.
    #[test]
    fn tables_go_with_the_inverse_only() {
        let mut axis = Machine::reference().axes[0].clone();
        let found = found(&axis, 0.0);
        let table = Table::new(300.0, &[-1.0, -1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
        axis.feedforward.tables.velocity = Some(table);
        for (method, after) in [(Method::Inverse, None), (Method::Series, Some(300.0))] {
            let tuning = propose(&axis, &found, method, TICK_S).expect("a proposal");
            assert_eq!(tuning.feedforward.tables.velocity.is_none(), after.is_none());
            let key = "regulator.feedforward_velocity_table.reach";
            let change = tuning.changes.iter().find(|change| change.key == key).expect("a line");
            assert_eq!((change.before, change.after), (Some(300.0), after));
        }
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
                axis.output_offset_v =
                    propose(&axis, &found, Method::Inverse, TICK_S).expect("a proposal").output_offset_v;
                let off_v = (axis.output_offset_v - expected_v).abs();
                println!("{old_v} V, {drift_mm_s} mm/s, pass {pass}: {} V", axis.output_offset_v);
                assert!(off_v <= 2.0 * step_v, "{old_v} V, {drift_mm_s} mm/s: {}", axis.output_offset_v);
                assert!(pass == 1 || axis.output_offset_v.total_cmp(&before_v).is_eq(), "moved again");
            }
        }
    }
}
