//! `motion drive inertia`: harmonic motion under a growing load, until the current limit shows.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::{Common, axis_named, feed_mm_min};
use crate::cli::error::{CliError, Outcome};
use crate::cli::progress::Progress;
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::circle_motion::{Circle, plane_of};
use crate::drive::inertia::{InertiaFigures, measure};
use crate::report;

const HELP: &str = "\
Where the current limit acts, the velocity is a triangle and the acceleration flat: the plateau is the admissible
acceleration under that load. Open loop, simulated drives only.

JSON: axis, frequency_hz, feed_mm_min, loads: list of {load_inertia_ratio, swing_ratio, phase_deg,
third_harmonic_ratio (sine 0, triangle 0.111), peak_accel_m_s2, plateau_accel_m_s2, is_limited}.";

/// Load an axis more and more at one frequency, and read off its current limit.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct InertiaArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// Frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 8.0, allow_negative_numbers = true)]
    frequency: f64,
    /// Feed on the circle, mm/min; without it 9549, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    /// Added inertia over the unloaded axis's; the motion is run with each.
    #[arg(long, value_name = "RATIO,…", value_delimiter = ',', default_values_t = [0.0, 0.5, 1.0, 2.0])]
    loads: Vec<f64>,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct InertiaJson<'run> {
    axis: &'run str,
    frequency_hz: f64,
    feed_mm_min: f64,
    loads: Vec<LoadJson>,
}

#[derive(Serialize)]
struct LoadJson {
    load_inertia_ratio: f64,
    swing_ratio: f64,
    phase_deg: f64,
    third_harmonic_ratio: f64,
    peak_accel_m_s2: f64,
    plateau_accel_m_s2: f64,
    is_limited: bool,
}

/// Runs the motion once per load.
///
/// # Errors
/// An argument is refused, a fault ended a run, or a file can't be written.
pub fn run(arguments: &InertiaArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let axis = axis_named(&machine, &arguments.axis)?;
    let report = arguments.common.report()?;
    let [first, second, _] = plane_of(axis).axes();
    let feed_mm_min = feed_mm_min(&machine, &[first, second], arguments.feed_mm_min, 9549.0);
    let feed_mm_s = feed_mm_min / 60.0;
    let circle = Circle { plane: plane_of(axis), ..Circle::new(arguments.frequency, feed_mm_s) };
    let mut progress = Progress::new(arguments.loads.len() as u64);
    let mut found = Vec::with_capacity(arguments.loads.len());
    for &load in &arguments.loads {
        found.push(measure(&machine, &circle, axis, load)?);
        progress.step();
    }
    progress.finish();
    let name = &machine.axes[axis].name;
    if arguments.common.json {
        let load = |(figures, _): &(InertiaFigures, _)| LoadJson {
            load_inertia_ratio: figures.load_inertia_ratio,
            swing_ratio: figures.response.swing_ratio,
            phase_deg: figures.response.phase_rad.to_degrees(),
            third_harmonic_ratio: figures.response.third_harmonic,
            peak_accel_m_s2: figures.peak_accel_mm_s2 / 1e3,
            plateau_accel_m_s2: figures.plateau_accel_mm_s2 / 1e3,
            is_limited: figures.is_limited,
        };
        let json = InertiaJson {
            axis: name,
            frequency_hz: arguments.frequency,
            feed_mm_min,
            loads: found.iter().map(load).collect(),
        };
        write_json(&json, out)?;
    } else {
        let (frequency, feed) = (arguments.frequency, feed_mm_min);
        writeln!(out, "Axis {name} at {frequency} Hz and {feed} mm/min under load, open loop\n")
            .and_then(|()| write_loads(found.iter().map(|(figures, _)| figures), out))
            .map_err(CliError::Output)?;
        let asked_mm_s2 = std::f64::consts::TAU * frequency * feed_mm_s;
        writeln!(out, "\n{}", reading(found.iter().map(|(figures, _)| figures), asked_mm_s2))
            .map_err(CliError::Output)?;
    }
    arguments
        .common
        .write_report(report, out, || report::drive::inertia_findings(&machine, &circle, &found))?;
    Ok(Outcome::Done)
}

/// The reading of the plateau, from the heaviest limited load.
fn reading<'run>(found: impl Iterator<Item = &'run InertiaFigures>, asked_mm_s2: f64) -> String {
    let limited = found
        .filter(|figures| figures.is_limited)
        .max_by(|a, b| a.load_inertia_ratio.total_cmp(&b.load_inertia_ratio));
    match limited {
        None => "  The velocity stays a sine: the current limit is not reached.".to_owned(),
        Some(figures) => {
            let load = figures.load_inertia_ratio;
            let unloaded_mm_s2 = figures.plateau_accel_mm_s2 * (1.0 + load);
            format!(
                "  Under load {load} the acceleration is flat at {:.2} m/s²: the current limit gives the unloaded axis \
                 {:.2} m/s².\n  The motion asks for {:.2} m/s² and admits a load of {:.2}.",
                figures.plateau_accel_mm_s2 / 1e3,
                unloaded_mm_s2 / 1e3,
                asked_mm_s2 / 1e3,
                (unloaded_mm_s2 / asked_mm_s2 - 1.0).max(-1.0),
            )
        }
    }
}

fn write_loads<'run>(
    found: impl Iterator<Item = &'run InertiaFigures>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let columns = [
        ("load", "1", Align::Right),
        ("swing", "1", Align::Right),
        ("phase", "°", Align::Right),
        ("third harmonic", "%", Align::Right),
        ("peak acceleration", "m/s²", Align::Right),
        ("plateau", "m/s²", Align::Right),
        ("velocity", "", Align::Left),
    ];
    let rows: Vec<[String; 7]> = found
        .map(|figures| {
            [
                figures.load_inertia_ratio.to_string(),
                format!("{:.4}", figures.response.swing_ratio),
                format!("{:.2}", figures.response.phase_rad.to_degrees()),
                format!("{:.2}", figures.response.third_harmonic * 1e2),
                format!("{:.2}", figures.peak_accel_mm_s2 / 1e3),
                format!("{:.2}", figures.plateau_accel_mm_s2 / 1e3),
                if figures.is_limited { "triangle: limited" } else { "sine" }.to_owned(),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)
}
