//! `motion drive compare`: regulators side by side.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::{Common, feed_mm_min, frequencies};
use crate::cli::demo::STRINGER;
use crate::cli::error::{CliError, Outcome};
use crate::cli::progress::Progress;
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::circle_motion::Circle;
use crate::drive::compare::{Choice, Measured, Motion, Regulators, Row, Sweep, rows, sweeps};
use crate::drive::peer_regulator::PeerGains;
use crate::machine::Machine;
use crate::report;

/// Frequencies of the circles whose figures are in the table \[Hz\].
const SHOWN_HZ: [f64; 2] = [4.0, 10.0];
/// Duration of the outputs that the report shows \[s\].
const OUTPUT_SPAN_S: f64 = 0.1;
/// Greatest number of resolutions.
const RESOLUTIONS_MAX: usize = 10;

const HELP: &str = "\
All regulators have the machine's feedback (P, with the ki and kd that it has) and output limits, and get set values of
the same plans; they differ only in feedforward. FF1–FF3 are differences of set positions, as in LinuxCNC's component
pid, including an error relative to the previous command; its gains are those of P + V + A + J, less what differencing
adds, or fitted to the least following error. The inverse is the machine file's; without one, that of the simulated
drive. Following errors are relative to exact set positions. Noise is the rms difference from the run with exact set
positions.

JSON: feed_mm_min, motions, fitted (of each axis: ff1, ff2_s, ff3_s2), regulators: list of {name, set_resolution_um
(0: exact), motions: list of {following_error_um, contour_error_um, output_noise_mv, current_noise_percent}},
sweep_resolution_um, sweeps: list of {name, circles: list of {frequency_hz, following_error_um, contour_error_um,
output_noise_mv, current_noise_percent}}.";

/// Compare regulators on circles and on a program: P, P + V, differenced, analytic, inverse with preview.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct CompareArguments {
    /// First frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, allow_negative_numbers = true)]
    from: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 16.0, allow_negative_numbers = true)]
    to: f64,
    /// Step between frequencies, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, allow_negative_numbers = true)]
    by: f64,
    /// Feed on the circles, mm/min; without it 2150, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    /// Resolutions of set positions, µm; the sweep uses the first, the picture of outputs the last.
    #[arg(long, value_name = "UM,…", value_delimiter = ',', default_values_t = [0.1, 1.0], num_args = 1..)]
    resolutions_um: Vec<f64>,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct CompareJson {
    feed_mm_min: f64,
    motions: Vec<String>,
    fitted: Vec<GainsJson>,
    regulators: Vec<RowJson>,
    sweep_resolution_um: f64,
    sweeps: Vec<SweepJson>,
}

#[derive(Serialize)]
struct GainsJson {
    axis: String,
    ff1: f64,
    ff2_s: f64,
    ff3_s2: f64,
}

#[derive(Serialize)]
struct RowJson {
    name: &'static str,
    set_resolution_um: f64,
    motions: Vec<MeasuredJson>,
}

#[derive(Serialize)]
struct SweepJson {
    name: &'static str,
    circles: Vec<CircleJson>,
}

#[derive(Serialize)]
struct CircleJson {
    frequency_hz: f64,
    #[serde(flatten)]
    measured: MeasuredJson,
}

#[derive(Serialize)]
struct MeasuredJson {
    following_error_um: f64,
    contour_error_um: f64,
    output_noise_mv: f64,
    current_noise_percent: f64,
}

impl MeasuredJson {
    fn new(measured: &Measured) -> Self {
        Self {
            following_error_um: measured.following_um,
            contour_error_um: measured.contour_um,
            output_noise_mv: measured.output_noise_v * 1e3,
            current_noise_percent: measured.current_noise * 1e2,
        }
    }
}

/// Runs the regulators and prints their figures.
///
/// # Errors
/// An argument is refused, a fault ended a run, or a file can't be written.
pub fn run(arguments: &CompareArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let frequencies_hz = frequencies(arguments.from, arguments.to, arguments.by)?;
    let (first_um, last_um) = resolutions(&arguments.resolutions_um)?;
    let report = arguments.common.report()?;
    let feed_mm_min = feed_mm_min(&machine, &[0, 1], arguments.feed_mm_min, 2150.0);
    let feed_mm_s = feed_mm_min / 60.0;
    let mut motions: Vec<Motion> =
        SHOWN_HZ.iter().map(|&hz| Motion::Circle(Circle::new(hz, feed_mm_s))).collect();
    motions.push(Motion::Program("stringer.ngc", STRINGER));
    let steps = Regulators::STEPS + Choice::ALL.len() + Choice::SHOWN.len();
    let mut progress = Progress::new(steps as u64);
    let regulators = Regulators::new(&machine, feed_mm_s, &mut || progress.step())?;
    let rows = rows(&regulators, &motions, &arguments.resolutions_um, &mut || progress.step())?;
    let sweeps = sweeps(&regulators, feed_mm_s, &frequencies_hz, first_um, &mut || progress.step())?;
    progress.finish();
    if arguments.common.json {
        let json = CompareJson {
            feed_mm_min,
            motions: motions.iter().map(Motion::name).collect(),
            fitted: fitted(&machine, &regulators),
            regulators: rows.iter().map(row_json).collect(),
            sweep_resolution_um: first_um,
            sweeps: sweeps.iter().map(sweep_json).collect(),
        };
        write_json(&json, out)?;
    } else {
        write_rows(&motions, &rows, out)
            .and_then(|()| write_fitted(&fitted(&machine, &regulators), out))
            .map_err(CliError::Output)?;
    }
    if report.is_some() {
        let circle = Circle::new(SHOWN_HZ[1], feed_mm_s);
        let mut outputs = Vec::new();
        for choice in [Choice::PeerFitted, Choice::VajFitted] {
            outputs.push((choice, regulators.output(choice, &circle, last_um, OUTPUT_SPAN_S)?));
        }
        arguments.common.write_report(report, out, || {
            let resolutions_um = [first_um, last_um];
            let rows = (&motions[..], &rows[..]);
            Ok(report::drive::compare_findings(&machine, rows, &sweeps, &outputs, resolutions_um))
        })?;
    }
    Ok(Outcome::Done)
}

/// The first and the last resolution.
fn resolutions(all_um: &[f64]) -> Result<(f64, f64), CliError> {
    let refused = || CliError::Arguments {
        found: format!("set-point resolutions {all_um:?} µm"),
        expected: "1 to 10 numbers above 0, at most 1000",
    };
    let fits = all_um.len() <= RESOLUTIONS_MAX && all_um.iter().all(|&um| um > 0.0 && um <= 1000.0);
    match (all_um.first(), all_um.last()) {
        (Some(&first), Some(&last)) if fits => Ok((first, last)),
        _ => Err(refused()),
    }
}

fn fitted(machine: &Machine, regulators: &Regulators) -> Vec<GainsJson> {
    let gains = |(axis, gains): (&crate::machine::AxisSettings, &PeerGains)| GainsJson {
        axis: axis.name.clone(),
        ff1: gains.ff1,
        ff2_s: gains.ff2_s,
        ff3_s2: gains.ff3_s2,
    };
    machine.axes.iter().zip(&regulators.fitted).map(gains).collect()
}

fn row_json(row: &Row) -> RowJson {
    RowJson {
        name: row.choice.name(),
        set_resolution_um: row.resolution_um,
        motions: row.measured.iter().map(MeasuredJson::new).collect(),
    }
}

fn sweep_json(sweep: &Sweep) -> SweepJson {
    let circle = |&(frequency_hz, ref measured): &(f64, Measured)| CircleJson {
        frequency_hz,
        measured: MeasuredJson::new(measured),
    };
    SweepJson { name: sweep.choice.name(), circles: sweep.circles.iter().map(circle).collect() }
}

fn write_rows(motions: &[Motion], rows: &[Row], out: &mut dyn Write) -> io::Result<()> {
    let columns = [
        ("regulator", "", Align::Left),
        ("set positions", "µm", Align::Right),
        ("following error", "µm", Align::Right),
        ("contour error", "µm", Align::Right),
        ("output noise", "mV rms", Align::Right),
        ("current noise", "% of limit", Align::Right),
    ];
    for (index, motion) in motions.iter().enumerate() {
        writeln!(out, "{}{}\n", if index > 0 { "\n" } else { "" }, motion.name())?;
        let cells = |row: &Row| {
            let found = row.measured.get(index)?;
            let steps =
                if row.resolution_um > 0.0 { row.resolution_um.to_string() } else { "exact".to_owned() };
            Some([
                row.choice.name().to_owned(),
                steps,
                format!("{:.2}", found.following_um),
                format!("{:.2}", found.contour_um),
                format!("{:.1}", found.output_noise_v * 1e3),
                format!("{:.1}", found.current_noise * 1e2),
            ])
        };
        let cells: Vec<_> = rows.iter().filter_map(cells).collect();
        table::write(&columns, &cells, out)?;
    }
    Ok(())
}

fn write_fitted(fitted: &[GainsJson], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "\nFitted gains of the differences\n")?;
    let columns = [
        ("axis", "", Align::Left),
        ("FF1", "1", Align::Right),
        ("FF2", "s", Align::Right),
        ("FF3", "s²", Align::Right),
    ];
    let cells: Vec<_> = fitted
        .iter()
        .map(|gains| {
            let GainsJson { axis, ff1, ff2_s, ff3_s2 } = gains;
            [axis.clone(), ff1.to_string(), format!("{ff2_s:.3e}"), format!("{ff3_s2:.3e}")]
        })
        .collect();
    table::write(&columns, &cells, out)
}
