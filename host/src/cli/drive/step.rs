//! `motion drive step`: the feed steps within one tick, open loop.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::{
    Common, ComparisonJson, axis_named, comparisons_json, feed_mm_min, is_feed, or_dash, outcome,
    write_comparisons,
};
use crate::cli::error::{CliError, Outcome};
use crate::cli::write_json;
use crate::drive::reference;
use crate::drive::step::{Step, StepFigures};
use crate::report;

const HELP: &str = "\
By the tangent method, from encoder readings: the tangent at the steepest rise crosses 0 at the delay and
reaches the step within the time constant. The peaks are backward differences of readings, as published.

JSON: axis, feed_mm_min, delay_ms, time_constant_ms, overshoot_percent, settling_ms (null: never), peak_accel_m_s2,
peak_jerk_m_s3, bandwidth_hz, reference (figures with the published ones; empty on other machines).";

/// Step the velocity from rest within one tick, open loop.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct StepArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// Velocity after the step, mm/min; without it 7200, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    /// Time for which it is held and recorded, in seconds.
    #[arg(long, value_name = "S", default_value_t = 0.4, allow_negative_numbers = true)]
    duration_s: f64,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct StepJson<'run> {
    axis: &'run str,
    feed_mm_min: f64,
    delay_ms: f64,
    time_constant_ms: f64,
    overshoot_percent: f64,
    settling_ms: Option<f64>,
    peak_accel_m_s2: f64,
    peak_jerk_m_s3: f64,
    bandwidth_hz: Option<f64>,
    reference: Vec<ComparisonJson>,
}

/// Runs the step and prints its figures.
///
/// # Errors
/// An argument is refused, a fault ended the run, or a file can't be written.
pub fn run(arguments: &StepArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let axis = axis_named(&machine, &arguments.axis)?;
    let report = arguments.common.report()?;
    let feed_mm_min = feed_mm_min(&machine, &[axis], arguments.feed_mm_min, 7200.0);
    let step = Step { axis, feed_mm_s: feed_mm_min / 60.0, duration_s: arguments.duration_s };
    let (figures, response) = step.measure(&machine)?;
    let is_published = is_feed(feed_mm_min, reference::STEP_FEED_MM_S) && axis == 0;
    let comparisons = if is_published && reference::is_reference(&machine) {
        reference::compare_step(&machine, &figures)?
    } else {
        Vec::new()
    };
    let name = &machine.axes[axis].name;
    if arguments.common.json {
        let json = StepJson {
            axis: name,
            feed_mm_min,
            delay_ms: figures.delay_s * 1e3,
            time_constant_ms: figures.time_constant_s * 1e3,
            overshoot_percent: figures.overshoot * 1e2,
            settling_ms: figures.settling_s.map(|settling_s| settling_s * 1e3),
            peak_accel_m_s2: figures.peak_accel_mm_s2 / 1e3,
            peak_jerk_m_s3: figures.peak_jerk_mm_s3 / 1e3,
            bandwidth_hz: figures.bandwidth_hz,
            reference: comparisons_json(&comparisons),
        };
        write_json(&json, out)?;
    } else {
        writeln!(out, "Step of axis {name} from rest to {} mm/min, open loop\n", feed_mm_min)
            .and_then(|()| write_figures(&figures, out))
            .and_then(|()| write_comparisons(&comparisons, out))
            .map_err(CliError::Output)?;
    }
    arguments.common.write_report(report, out, || {
        Ok(report::drive::step_findings(&machine, &step, &response, &figures, &comparisons))
    })?;
    Ok(outcome(&comparisons))
}

fn write_figures(figures: &StepFigures, out: &mut dyn Write) -> io::Result<()> {
    let settling_ms = figures.settling_s.map(|settling_s| settling_s * 1e3);
    writeln!(out, "  delay                      {:.2} ms", figures.delay_s * 1e3)?;
    writeln!(out, "  time constant              {:.2} ms", figures.time_constant_s * 1e3)?;
    writeln!(out, "  overshoot                  {:.2} %", figures.overshoot * 1e2)?;
    writeln!(out, "  settled within ±0.02 m/min {} ms", or_dash(settling_ms, 1))?;
    writeln!(out, "  peak acceleration          {:.2} m/s²", figures.peak_accel_mm_s2 / 1e3)?;
    writeln!(out, "  peak jerk                  {:.0} m/s³", figures.peak_jerk_mm_s3 / 1e3)?;
    writeln!(out, "  −3 dB of its spectrum      {} Hz", or_dash(figures.bandwidth_hz, 2))
}
