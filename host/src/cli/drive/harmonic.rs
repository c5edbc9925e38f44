//! `motion drive harmonic`: circles of constant feed, amplitude and phase of each axis.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::{
    Common, ComparisonJson, Feedforward, comparisons_json, feed_mm_min, frequencies, is_feed, or_dash,
    outcome, write_comparisons,
};
use crate::cli::error::{CliError, Outcome};
use crate::cli::progress::Progress;
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::circle_motion::Circle;
use crate::drive::harmonic::{Amplitude, HarmonicFigures, bandwidth, measure};
use crate::drive::{experiment, harmonic, model, reference};
use crate::machine::Machine;
use crate::report;

/// Number of frequencies whose velocities the report shows.
const SHOWN: usize = 3;

const HELP: &str = "\
A circle of constant feed F at frequency f has the radius F/(2πf): each axis moves as a sine of the same velocity at
every frequency. 'Swing' is half the distance from the greatest to the least velocity, 'fundamental' the amplitude of
the sine in it.

JSON: feed_mm_min, open_loop, axes: list of {name, bandwidth_swing_hz, bandwidth_fundamental_hz, current_limited_hz,
linear_bandwidth_hz, points: list of {frequency_hz, radius_mm, swing_ratio, fundamental_ratio, phase_deg, delay_ms,
third_harmonic_ratio}}, reference.";

/// Move X and Y harmonically over a range of frequencies; amplitude and phase of the velocity.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct HarmonicArguments {
    /// First frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 4.0, allow_negative_numbers = true)]
    from: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 40.0, allow_negative_numbers = true)]
    to: f64,
    /// Step between frequencies, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 4.0, allow_negative_numbers = true)]
    by: f64,
    /// Feed on the circle, mm/min: the amplitude of the velocities; without it 9549, or what the machine reaches.
    #[arg(long, value_name = "MM_MIN", allow_negative_numbers = true)]
    feed_mm_min: Option<f64>,
    /// Keep the machine's regulator; without it, the loop is open.
    #[arg(long)]
    closed_loop: bool,
    /// Feedforward of the closed loop.
    #[arg(long, value_enum, requires = "closed_loop", default_value_t = Feedforward::AsIs)]
    feedforward: Feedforward,
    #[command(flatten)]
    common: Common,
}

#[derive(Serialize)]
struct HarmonicJson<'run> {
    feed_mm_min: f64,
    open_loop: bool,
    axes: Vec<AxisJson<'run>>,
    reference: Vec<ComparisonJson>,
}

#[derive(Serialize)]
struct AxisJson<'run> {
    name: &'run str,
    bandwidth_swing_hz: Option<f64>,
    bandwidth_fundamental_hz: Option<f64>,
    current_limited_hz: f64,
    linear_bandwidth_hz: Option<f64>,
    points: Vec<PointJson>,
}

#[derive(Serialize)]
struct PointJson {
    frequency_hz: f64,
    radius_mm: f64,
    swing_ratio: f64,
    fundamental_ratio: f64,
    phase_deg: f64,
    delay_ms: f64,
    third_harmonic_ratio: f64,
}

/// The figures given for an axis besides its curve.
struct Bandwidths {
    swing_hz: Option<f64>,
    fundamental_hz: Option<f64>,
    current_limited_hz: f64,
    linear_hz: Option<f64>,
}

/// Runs the circles and prints the axes' responses.
///
/// # Errors
/// An argument is refused, a fault ended a run, or a file can't be written.
pub fn run(arguments: &HarmonicArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = arguments.common.machine()?;
    let frequencies_hz = frequencies(arguments.from, arguments.to, arguments.by)?;
    let report = arguments.common.report()?;
    let feed_mm_min = feed_mm_min(&machine, &[0, 1], arguments.feed_mm_min, 9549.0);
    let feed_mm_s = feed_mm_min / 60.0;
    let ran = if arguments.closed_loop {
        arguments.feedforward.terms().of(&machine)
    } else {
        experiment::open_loop(&machine)
    };
    let circle = |frequency_hz| Circle::new(frequency_hz, feed_mm_s);
    let mut progress = Progress::new(frequencies_hz.len() as u64);
    let mut found = Vec::with_capacity(frequencies_hz.len());
    for &frequency_hz in &frequencies_hz {
        found.push(measure(&ran, &circle(frequency_hz))?);
        progress.step();
    }
    progress.finish();
    let range_hz = (arguments.from, arguments.to, arguments.by);
    let of_axis = |axis: usize| -> Result<Bandwidths, CliError> {
        let drive = &machine.axes[axis].drive;
        let limit_mm_s2 = drive.accel_limit_mm_s2 / (1.0 + drive.load_inertia_ratio);
        let start = circle(arguments.from);
        Ok(Bandwidths {
            swing_hz: bandwidth(&ran, &start, range_hz, axis, Amplitude::Swing)?,
            fundamental_hz: bandwidth(&ran, &start, range_hz, axis, Amplitude::Fundamental)?,
            current_limited_hz: harmonic::current_limited_hz(limit_mm_s2, feed_mm_s),
            linear_hz: model::bandwidth_hz(drive, machine.tick_s, crate::drive::HALF_POWER),
        })
    };
    let bandwidths = [of_axis(0)?, of_axis(1)?];
    let is_published = is_feed(feed_mm_min, reference::BANDWIDTH_FEED_MM_S) && !arguments.closed_loop;
    let comparisons = if is_published && reference::is_reference(&machine) {
        reference::compare_harmonic(&machine)?
    } else {
        Vec::new()
    };
    let explanation = explanation(&bandwidths[0], feed_mm_min, &machine.axes[0].name);
    if arguments.common.json {
        let json = HarmonicJson {
            feed_mm_min,
            open_loop: !arguments.closed_loop,
            axes: (0..2).map(|axis| axis_json(&machine, axis, &bandwidths[axis], &found)).collect(),
            reference: comparisons_json(&comparisons),
        };
        write_json(&json, out)?;
    } else {
        let how = if arguments.closed_loop { "closed loop" } else { "open loop" };
        writeln!(out, "Harmonic motion at {} mm/min, {how}", feed_mm_min)
            .and_then(|()| write_axes(&machine, &found, &bandwidths, out))
            .and_then(|()| if arguments.closed_loop { Ok(()) } else { writeln!(out, "\n{explanation}") })
            .and_then(|()| write_comparisons(&comparisons, out))
            .map_err(CliError::Output)?;
    }
    if report.is_some() {
        let mut waves = Vec::new();
        let last = frequencies_hz.len() - 1;
        let mut places: Vec<usize> = (0..SHOWN).map(|i| i * last / (SHOWN - 1)).collect();
        places.dedup();
        for place in places {
            let circle = circle(frequencies_hz[place]);
            waves.push((circle, circle.record(&ran)?));
        }
        let words = if arguments.closed_loop { "" } else { &explanation };
        arguments.common.write_report(report, out, || {
            report::drive::harmonic_findings(&machine, &found, &waves, words, &comparisons)
        })?;
    }
    Ok(outcome(&comparisons))
}

/// Explains why the bandwidths of a drive differ.
fn explanation(bandwidths: &Bandwidths, feed_mm_min: f64, name: &str) -> String {
    if bandwidths.linear_hz.is_some_and(|linear_hz| linear_hz < bandwidths.current_limited_hz) {
        return format!(
            "At {feed_mm_min} mm/min the loop ends the bandwidth of {name}: linear, it has its −3 dB at {} Hz, and the\n\
             current limit would end it only at {:.1} Hz.",
            or_dash(bandwidths.linear_hz, 1),
            bandwidths.current_limited_hz,
        );
    }
    format!(
        "At {feed_mm_min} mm/min it is the current limit that ends the bandwidth of {name}, not the loop: the linear\n\
         loop has its −3 dB at {} Hz. A limited acceleration a makes a triangle of the velocity, which swings through\n\
         0.707·F up to a/(4·0.707·F) = {:.1} Hz, less what friction and lags take. The sine in a triangle is smaller\n\
         than its swing (8/π²), so the fundamental falls below −3 dB earlier. A step needs the limit only while it\n\
         rises, so its spectrum reaches further. At a lower feed all of them come closer to the linear loop's.",
        or_dash(bandwidths.linear_hz, 1),
        bandwidths.current_limited_hz,
    )
}

fn axis_json<'run>(
    machine: &'run Machine,
    axis: usize,
    bandwidths: &Bandwidths,
    found: &[HarmonicFigures],
) -> AxisJson<'run> {
    let point = |figures: &HarmonicFigures| {
        let response = &figures.axes[axis];
        PointJson {
            frequency_hz: figures.frequency_hz,
            radius_mm: Circle::new(figures.frequency_hz, figures.feed_mm_s).radius_mm(),
            swing_ratio: response.swing_ratio,
            fundamental_ratio: response.fundamental_ratio,
            phase_deg: response.phase_rad.to_degrees(),
            delay_ms: response.delay_s * 1e3,
            third_harmonic_ratio: response.third_harmonic,
        }
    };
    AxisJson {
        name: &machine.axes[axis].name,
        bandwidth_swing_hz: bandwidths.swing_hz,
        bandwidth_fundamental_hz: bandwidths.fundamental_hz,
        current_limited_hz: bandwidths.current_limited_hz,
        linear_bandwidth_hz: bandwidths.linear_hz,
        points: found.iter().map(point).collect(),
    }
}

fn write_axes(
    machine: &Machine,
    found: &[HarmonicFigures],
    bandwidths: &[Bandwidths; 2],
    out: &mut dyn Write,
) -> io::Result<()> {
    let columns = [
        ("frequency", "Hz", Align::Right),
        ("radius", "mm", Align::Right),
        ("swing", "1", Align::Right),
        ("fundamental", "1", Align::Right),
        ("phase", "°", Align::Right),
        ("delay", "ms", Align::Right),
        ("third harmonic", "%", Align::Right),
    ];
    for (axis, bandwidths) in bandwidths.iter().enumerate() {
        writeln!(out, "\nAxis {}\n", machine.axes[axis].name)?;
        let rows: Vec<[String; 7]> = found
            .iter()
            .map(|figures| {
                let response = &figures.axes[axis];
                let radius_mm = Circle::new(figures.frequency_hz, figures.feed_mm_s).radius_mm();
                [
                    format!("{:.2}", figures.frequency_hz),
                    format!("{radius_mm:.4}"),
                    format!("{:.4}", response.swing_ratio),
                    format!("{:.4}", response.fundamental_ratio),
                    format!("{:.2}", response.phase_rad.to_degrees()),
                    format!("{:.3}", response.delay_s * 1e3),
                    format!("{:.2}", response.third_harmonic * 1e2),
                ]
            })
            .collect();
        table::write(&columns, &rows, out)?;
        writeln!(
            out,
            "\n  −3 dB: swing at {} Hz, fundamental at {} Hz",
            or_dash(bandwidths.swing_hz, 2),
            or_dash(bandwidths.fundamental_hz, 2),
        )?;
    }
    Ok(())
}
