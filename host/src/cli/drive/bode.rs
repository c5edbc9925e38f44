//! `motion drive bode`: amplitude and phase from step, harmonics and linear model.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::{Common, axis_named, feed_mm_min, or_dash};
use crate::cli::error::{CliError, Outcome};
use crate::cli::progress::Progress;
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::bode::{Bode, Point, measure};
use crate::drive::circle_motion::plane_of;
use crate::drive::{HALF_POWER, model};
use crate::report;

/// Greatest number of frequencies.
const POINTS_MAX: u32 = 1000;

const HELP: &str = "\
The linear model is that of the machine file's drive with viscous friction and bed, without Coulomb friction and current
limit. Where the curves part, the current limit acts: a lower feed brings them together. At a very low feed Coulomb
friction parts them.

JSON: axis, feed_mm_min, step_bandwidth_hz, linear_bandwidth_hz, points: list of {frequency_hz, step_ratio,
step_phase_deg, swing_ratio, fundamental_ratio, harmonic_phase_deg, linear_ratio, linear_phase_deg}.";

/// Amplitude and phase of a drive over frequency, open loop, by three methods.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct BodeArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// First frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, allow_negative_numbers = true)]
    from: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 100.0, allow_negative_numbers = true)]
    to: f64,
    /// Number of frequencies, in equal ratios.
    #[arg(long, value_name = "NUMBER", default_value_t = 41)]
    points: u32,
    /// Feed of the step and of the harmonics, mm/min; without it 9549, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct BodeJson<'run> {
    axis: &'run str,
    feed_mm_min: f64,
    step_bandwidth_hz: Option<f64>,
    linear_bandwidth_hz: Option<f64>,
    points: Vec<PointJson>,
}

#[derive(Serialize)]
struct PointJson {
    frequency_hz: f64,
    step_ratio: f64,
    step_phase_deg: f64,
    swing_ratio: f64,
    fundamental_ratio: f64,
    harmonic_phase_deg: f64,
    linear_ratio: f64,
    linear_phase_deg: f64,
}

/// Measures the curves and prints them.
///
/// # Errors
/// An argument is refused, a fault ended a run, or a file can't be written.
pub fn run(arguments: &BodeArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let axis = axis_named(&machine, &arguments.axis)?;
    let frequencies_hz = in_equal_ratios(arguments)?;
    let report = arguments.common.report()?;
    let mut progress = Progress::new(frequencies_hz.len() as u64);
    let [first, second, _] = plane_of(axis).axes();
    let feed_mm_min = feed_mm_min(&machine, &[first, second], arguments.feed_mm_min, 9549.0);
    let feed_mm_s = feed_mm_min / 60.0;
    let bode = measure(&machine, axis, feed_mm_s, &frequencies_hz, &mut || progress.step())?;
    progress.finish();
    let name = &machine.axes[axis].name;
    let linear_hz = model::bandwidth_hz(&machine.axes[axis].drive, machine.tick_s, HALF_POWER);
    if arguments.common.json {
        let json = BodeJson {
            axis: name,
            feed_mm_min,
            step_bandwidth_hz: bode.step.bandwidth_hz,
            linear_bandwidth_hz: linear_hz,
            points: points(&bode),
        };
        write_json(&json, out)?;
    } else {
        writeln!(out, "Axis {name} at {} mm/min, open loop\n", feed_mm_min)
            .and_then(|()| write_points(&bode, out))
            .map_err(CliError::Output)?;
        writeln!(
            out,
            "\n  −3 dB: spectrum of the step {} Hz, linear model {} Hz",
            or_dash(bode.step.bandwidth_hz, 2),
            or_dash(linear_hz, 1)
        )
        .map_err(CliError::Output)?;
    }
    arguments.common.write_report(report, out, || Ok(report::drive::bode_findings(&machine, &bode)))?;
    Ok(Outcome::Done)
}

fn in_equal_ratios(arguments: &BodeArguments) -> Result<Vec<f64>, CliError> {
    let &BodeArguments { from, to, points, .. } = arguments;
    if !(from > 0.0 && to > from && to.is_finite() && (2..=POINTS_MAX).contains(&points)) {
        return Err(CliError::Arguments {
            found: format!("{points} frequencies from {from} to {to} Hz"),
            expected: "2 to 1000 positive frequencies in ascending order",
        });
    }
    let last = points - 1;
    let at = |index: u32| {
        if index == last { to } else { from * libm::pow(to / from, f64::from(index) / f64::from(last)) }
    };
    Ok((0..points).map(at).collect())
}

fn points(bode: &Bode) -> Vec<PointJson> {
    let degrees = |point: &Point| point.phase_rad.to_degrees();
    bode.points
        .iter()
        .map(|point| PointJson {
            frequency_hz: point.frequency_hz,
            step_ratio: point.step.ratio,
            step_phase_deg: degrees(&point.step),
            swing_ratio: point.harmonic.swing_ratio,
            fundamental_ratio: point.harmonic.fundamental_ratio,
            harmonic_phase_deg: point.harmonic.phase_rad.to_degrees(),
            linear_ratio: point.model.ratio,
            linear_phase_deg: degrees(&point.model),
        })
        .collect()
}

fn write_points(bode: &Bode, out: &mut dyn Write) -> io::Result<()> {
    let columns = [
        ("frequency", "Hz", Align::Right),
        ("step", "dB", Align::Right),
        ("swing", "dB", Align::Right),
        ("fundamental", "dB", Align::Right),
        ("linear", "dB", Align::Right),
        ("step", "°", Align::Right),
        ("harmonic", "°", Align::Right),
        ("linear", "°", Align::Right),
    ];
    let db = |ratio: f64| format!("{:.2}", 20.0 * libm::log10(ratio));
    let rows: Vec<[String; 8]> = points(bode)
        .iter()
        .map(|point| {
            [
                format!("{:.2}", point.frequency_hz),
                db(point.step_ratio),
                db(point.swing_ratio),
                db(point.fundamental_ratio),
                db(point.linear_ratio),
                format!("{:.1}", point.step_phase_deg),
                format!("{:.1}", point.harmonic_phase_deg),
                format!("{:.1}", point.linear_phase_deg),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}
