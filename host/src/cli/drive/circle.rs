//! `motion drive circle`: contour error over frequency, closed loop.

use std::io::{self, Write};

use clap::Args;
use motion_kernel::axis::{Feedforward as KernelFeedforward, Tables};
use serde::Serialize;

use super::{
    Common, ComparisonJson, Feedforward, comparisons_json, feed_mm_min, frequencies, is_feed, or_dash,
    outcome, write_comparisons,
};
use crate::cli::error::{CliError, Outcome};
use crate::cli::progress::Progress;
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::circle::{CircleFigures, Sweep, sweep};
use crate::drive::circle_motion::Circle;
use crate::drive::reference;
use crate::machine::AxisSettings;
use crate::report::drive::{Around, CircleSweep, circle_findings};

const HELP: &str = "\
Read from encoder positions over the last second at constant feed: the contour error is the actual minus the
programmed radius, the form deviation its greatest minus its least value.

JSON: feed_mm_min, limit_um, feedforward: list of {name, axes: list of {axis, velocity, accel_s, jerk_s2, lead_s,
has_inverse, has_tables}, limit_hz (null: not passed within the range), circles: list of {frequency_hz, radius_mm, contour_error_um, contour_error_um_max,
contour_error_um_min, form_deviation_um, following_error_x_um, following_error_y_um}}, reference.";

/// Drive circles over a range of frequencies, closed loop; contour error, form deviation, following error.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct CircleArguments {
    /// First frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, allow_negative_numbers = true)]
    from: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 16.0, allow_negative_numbers = true)]
    to: f64,
    /// Step between frequencies, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, allow_negative_numbers = true)]
    by: f64,
    /// Feed on the circle, mm/min; without it 2150, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    /// Feedforward terms of the machine that act; circles are driven with each choice.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_values_t = [Feedforward::V, Feedforward::Va, Feedforward::Vaj]
    )]
    feedforward: Vec<Feedforward>,
    /// Contour error for which the frequency is searched, µm.
    #[arg(long, value_name = "UM", default_value_t = 20.0, allow_negative_numbers = true)]
    limit_um: f64,
    /// Frequencies for which the report draws the error around the circle and over a turn, Hz.
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', default_values_t = [4.0, 13.0])]
    show: Vec<f64>,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct CircleJson {
    feed_mm_min: f64,
    limit_um: f64,
    feedforward: Vec<SweepJson>,
    reference: Vec<ComparisonJson>,
}

#[derive(Serialize)]
struct SweepJson {
    name: &'static str,
    axes: Vec<GainsJson>,
    limit_hz: Option<f64>,
    circles: Vec<FiguresJson>,
}

#[derive(Serialize)]
struct GainsJson {
    axis: String,
    velocity: f64,
    accel_s: f64,
    jerk_s2: f64,
    lead_s: f64,
    has_inverse: bool,
    has_tables: bool,
}

#[derive(Serialize)]
struct FiguresJson {
    frequency_hz: f64,
    radius_mm: f64,
    contour_error_um: f64,
    contour_error_um_max: f64,
    contour_error_um_min: f64,
    form_deviation_um: f64,
    following_error_x_um: f64,
    following_error_y_um: f64,
}

/// Runs the circles and prints their errors.
///
/// # Errors
/// An argument is refused, a fault ended a run, or a file can't be written.
pub fn run(arguments: &CircleArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let frequencies_hz = frequencies(arguments.from, arguments.to, arguments.by)?;
    let report = arguments.common.report()?;
    let feed_mm_min = feed_mm_min(&machine, &[0, 1], arguments.feed_mm_min, 2150.0);
    let feed_mm_s = feed_mm_min / 60.0;
    let limit = (arguments.limit_um, (arguments.from, arguments.to, arguments.by));
    let mut progress = Progress::new((frequencies_hz.len() * arguments.feedforward.len()) as u64);
    let mut sweeps = Vec::with_capacity(arguments.feedforward.len());
    for choice in &arguments.feedforward {
        let terms = choice.terms();
        sweeps.push(sweep(terms.of(&machine), terms.name(), feed_mm_s, &frequencies_hz, limit, &mut || {
            progress.step()
        })?);
    }
    progress.finish();
    let is_published = is_feed(feed_mm_min, reference::CIRCLE_FEED_MM_S);
    let comparisons = if is_published && reference::is_reference(&machine) {
        reference::compare_circle(&machine)?
    } else {
        Vec::new()
    };
    if arguments.common.json {
        let json = CircleJson {
            feed_mm_min,
            limit_um: arguments.limit_um,
            feedforward: sweeps.iter().map(sweep_json).collect(),
            reference: comparisons_json(&comparisons),
        };
        write_json(&json, out)?;
    } else {
        writeln!(out, "Circles at {} mm/min, closed loop", feed_mm_min)
            .and_then(|()| write_sweeps(&sweeps, arguments.limit_um, out))
            .and_then(|()| write_comparisons(&comparisons, out))
            .map_err(CliError::Output)?;
    }
    if report.is_some() {
        let mut shown = Vec::new();
        for &frequency_hz in &arguments.show {
            let circle = Circle::new(frequency_hz, feed_mm_s);
            for sweep in &sweeps {
                shown.push(Around::of(sweep.name, &circle, &circle.record(&sweep.machine)?)?);
            }
        }
        arguments.common.write_report(report, out, || {
            let limits_hz: Vec<Option<f64>> = sweeps.iter().map(|sweep| sweep.limit_hz).collect();
            let sweeps: Vec<CircleSweep<'_>> = sweeps
                .iter()
                .map(|sweep| CircleSweep { name: sweep.name, circles: &sweep.circles })
                .collect();
            let limits = (&limits_hz[..], arguments.limit_um);
            Ok(circle_findings(&machine, &sweeps, limits, &shown, &comparisons))
        })?;
    }
    Ok(outcome(&comparisons))
}

fn sweep_json(sweep: &Sweep) -> SweepJson {
    let circle = |figures: &CircleFigures| FiguresJson {
        frequency_hz: figures.frequency_hz,
        radius_mm: figures.radius_mm,
        contour_error_um: figures.contour_um(),
        contour_error_um_max: figures.contour_um_max,
        contour_error_um_min: figures.contour_um_min,
        form_deviation_um: figures.form_um(),
        following_error_x_um: figures.following_um[0],
        following_error_y_um: figures.following_um[1],
    };
    SweepJson {
        name: sweep.name,
        axes: driven(sweep).map(gains_json).collect(),
        limit_hz: sweep.limit_hz,
        circles: sweep.circles.iter().map(circle).collect(),
    }
}

/// The axes that the circles move.
fn driven(sweep: &Sweep) -> impl Iterator<Item = &AxisSettings> {
    let axes = sweep.circles.first().map_or([0, 1], |circle| circle.axes);
    axes.into_iter().map(|axis| &sweep.machine.axes[axis])
}

fn has_tables(feedforward: &KernelFeedforward) -> bool {
    feedforward.tables != Tables::default()
}

fn gains_json(axis: &AxisSettings) -> GainsJson {
    let feedforward = &axis.feedforward;
    GainsJson {
        axis: axis.name.clone(),
        velocity: feedforward.velocity,
        accel_s: feedforward.accel_s,
        jerk_s2: feedforward.jerk_s2,
        lead_s: feedforward.lead_s,
        has_inverse: feedforward.drive.is_some(),
        has_tables: has_tables(feedforward),
    }
}

/// The feedforward of an axis, in words.
fn gains_words(axis: &AxisSettings) -> String {
    let feedforward = &axis.feedforward;
    let KernelFeedforward { velocity, accel_s, jerk_s2, lead_s, .. } = feedforward;
    let mut words =
        format!("{}: velocity {velocity}, acceleration {accel_s} s, jerk {jerk_s2:e} s²", axis.name);
    if *lead_s > 0.0 {
        words += &format!(", lead {lead_s} s");
    }
    if has_tables(feedforward) {
        words += ", tables";
    }
    if let Some(drive) = &feedforward.drive {
        words += if drive.bed.is_some() { ", inverse of drive and bed" } else { ", inverse of the drive" };
    }
    words
}

fn write_sweeps(sweeps: &[Sweep], limit_um: f64, out: &mut dyn Write) -> io::Result<()> {
    let columns = [
        ("frequency", "Hz", Align::Right),
        ("radius", "mm", Align::Right),
        ("contour max", "µm", Align::Right),
        ("min", "µm", Align::Right),
        ("form deviation", "µm", Align::Right),
        ("following X", "µm", Align::Right),
        ("Y", "µm", Align::Right),
    ];
    for sweep in sweeps {
        writeln!(out, "\nFeedforward {}", sweep.name)?;
        for axis in driven(sweep) {
            writeln!(out, "  {}", gains_words(axis))?;
        }
        writeln!(out)?;
        let rows: Vec<[String; 7]> = sweep
            .circles
            .iter()
            .map(|figures| {
                [
                    format!("{:.2}", figures.frequency_hz),
                    format!("{:.4}", figures.radius_mm),
                    format!("{:.2}", figures.contour_um_max),
                    format!("{:.2}", figures.contour_um_min),
                    format!("{:.2}", figures.form_um()),
                    format!("{:.2}", figures.following_um[0]),
                    format!("{:.2}", figures.following_um[1]),
                ]
            })
            .collect();
        table::write(&columns, &rows, out)?;
        writeln!(out, "\n  contour error ≤ {limit_um} µm up to {} Hz", or_dash(sweep.limit_hz, 2))?;
    }
    Ok(())
}
