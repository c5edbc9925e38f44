//! The experiment on path smoothness, as tables, JSON, CSV and a page.

use std::io::{self, Write};

use serde::Serialize;

use super::super::error::{CliError, Outcome};
use super::super::outputs::{self, Written};
use super::super::table::{self, Align};
use super::super::{csv_failure, write_json};
use super::SplineArguments;
use crate::files::Files;
use crate::report;
use crate::smoothness::evaluators::WAYS;
use crate::smoothness::{self, AxisTicks, Course, Evaluator, FEED_MM_S, Figures, TABLE_2_S, TICK_S};

pub(super) fn run(arguments: &SplineArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([]);
    let trace = outputs::open(&mut files, "--trace", arguments.trace.trace.as_ref())?;
    let report = outputs::open(&mut files, "--report", arguments.report.as_ref())?;
    let courses = smoothness::courses()
        .map_err(|source| CliError::Spline { place: "the built-in points".to_owned(), source })?;
    let paths = courses.map(|course| {
        let figures = Figures::of(&course, FEED_MM_S);
        (course, figures)
    });
    let evaluated = smoothness::well_and_badly_parametrised()
        .map_err(|source| CliError::Spline { place: "the built-in points".to_owned(), source })?
        .map(|course| smoothness::evaluators(&course, FEED_MM_S, TICK_S));
    let mut written = Written::default();
    written.write("trace", trace, |file| write_trace(&paths, file));
    written.write("report", report, |file| {
        report::smoothness::smoothness_findings(&paths, &evaluated).write(file)
    });
    if arguments.json {
        write_json(&json(&paths, &evaluated), out)?;
    } else {
        write_tables(&paths, out)
            .and_then(|()| write_evaluators(&evaluated, out))
            .map_err(CliError::Output)?;
        written.say(out)?;
    }
    written.outcome(Outcome::Done)
}

/// Writes a row per tick: velocity, acceleration and jerk of X and Y on every path; empty where there is no
/// difference yet.
fn write_trace(paths: &[(Course, Figures)], out: &mut impl Write) -> io::Result<()> {
    let all: Vec<AxisTicks> = paths.iter().map(|(course, _)| course.ticks(FEED_MM_S, TICK_S)).collect();
    let mut writer = csv::Writer::from_writer(out);
    let mut heading = vec!["tick".to_owned(), "t_s".to_owned()];
    for (course, _) in paths {
        let name = course.name.split(' ').next().unwrap_or(course.name);
        for axis in ["x", "y"] {
            heading.extend(["vel_mm_s", "acc_mm_s2", "jerk_mm_s3"].map(|key| format!("{name}_{axis}_{key}")));
        }
    }
    writer.write_record(&heading).map_err(csv_failure)?;
    let rows = all.iter().map(|ticks| ticks.velocity_mm_s.len()).max().unwrap_or(0);
    for tick in 0..rows {
        let mut row = vec![tick.to_string(), format!("{:.3}", tick as f64 * TICK_S)];
        for ticks in &all {
            for axis in 0..2 {
                let values = [
                    ticks.velocity_mm_s.get(tick),
                    tick.checked_sub(1).and_then(|tick| ticks.accel_mm_s2.get(tick)),
                    tick.checked_sub(2).and_then(|tick| ticks.jerk_mm_s3.get(tick)),
                ];
                row.extend(
                    values.map(|value| value.map_or_else(String::new, |value| format!("{:.6}", value[axis]))),
                );
            }
        }
        writer.write_record(&row).map_err(csv_failure)?;
    }
    writer.flush()
}

#[derive(Serialize)]
struct ExperimentJson {
    feed_mm_s: f64,
    tick_s: f64,
    paths: Vec<PathJson>,
    evaluators: Vec<EvaluatorJson>,
}

#[derive(Serialize)]
struct EvaluatorJson {
    name: &'static str,
    feed_error: f64,
    feed_error_badly_parametrised: f64,
}

#[derive(Serialize)]
struct PathJson {
    name: &'static str,
    length_mm: f64,
    time_s: f64,
    ticks: usize,
    deviation_mm: f64,
    junctions: Vec<JunctionJson>,
    by_tick: Vec<ByTickJson>,
}

#[derive(Serialize)]
struct JunctionJson {
    time_s: f64,
    /// The published time; for splines only.
    published_s: Option<f64>,
    accel_step_mm_s2: [f64; 2],
    jerk_step_mm_s3: f64,
}

#[derive(Serialize)]
struct ByTickJson {
    tick_s: f64,
    jerk_max_mm_s3: f64,
    jerk_step_max_mm_s3: f64,
}

fn json(paths: &[(Course, Figures)], [well, badly]: &[[Evaluator; WAYS]; 2]) -> ExperimentJson {
    let path = |figures: &Figures| {
        let is_spline = figures.junctions.len() == TABLE_2_S.len();
        let junctions = figures.junctions.iter().enumerate().map(|(index, junction)| JunctionJson {
            time_s: junction.time_s,
            published_s: is_spline.then(|| TABLE_2_S[index]),
            accel_step_mm_s2: [junction.accel_mm_s2[0], junction.accel_mm_s2[1]],
            jerk_step_mm_s3: junction.jerk_step_mm_s3(),
        });
        let by_tick = figures.by_tick.iter().map(|by_tick| ByTickJson {
            tick_s: by_tick.tick_s,
            jerk_max_mm_s3: by_tick.jerk_max_mm_s3,
            jerk_step_max_mm_s3: by_tick.jerk_step_max_mm_s3,
        });
        PathJson {
            name: figures.name,
            length_mm: figures.length_mm,
            time_s: figures.time_s,
            ticks: figures.ticks,
            deviation_mm: figures.deviation_mm,
            junctions: junctions.collect(),
            by_tick: by_tick.collect(),
        }
    };
    ExperimentJson {
        feed_mm_s: FEED_MM_S,
        tick_s: TICK_S,
        paths: paths.iter().map(|(_, figures)| path(figures)).collect(),
        evaluators: well
            .iter()
            .zip(badly)
            .map(|(well, badly)| EvaluatorJson {
                name: well.name,
                feed_error: well.feed_error,
                feed_error_badly_parametrised: badly.feed_error,
            })
            .collect(),
    }
}

fn write_tables(paths: &[(Course, Figures); 3], out: &mut dyn Write) -> io::Result<()> {
    let [(_, arcs), (_, cubic), (_, quintic)] = paths;
    writeln!(
        out,
        "Two quarter circles, radius 10 and 8 mm, and splines through ten of their points, at {FEED_MM_S} mm/s\n"
    )?;
    let columns = [
        ("path", "", Align::Left),
        ("length", "mm", Align::Right),
        ("time", "s", Align::Right),
        ("ticks", "1 ms", Align::Right),
        ("from the arcs", "mm", Align::Right),
    ];
    let rows: Vec<[String; 5]> = paths
        .iter()
        .map(|(_, figures)| {
            [
                figures.name.to_owned(),
                format!("{:.5}", figures.length_mm),
                format!("{:.6}", figures.time_s),
                figures.ticks.to_string(),
                format!("{:.4}", figures.deviation_mm),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)?;
    for junction in &arcs.junctions {
        let before_mm_s2 = -FEED_MM_S * FEED_MM_S / smoothness::RADII_MM[0];
        writeln!(
            out,
            "\nWhere the arcs meet, at {:.6} s, the acceleration of Y steps from {before_mm_s2:.3} to {:.3} mm/s².",
            junction.time_s,
            before_mm_s2 + junction.accel_mm_s2[1],
        )?;
    }
    writeln!(
        out,
        "\nThe splines' knots: times beside the published ones, and the steps of the jerk there\n"
    )?;
    let columns = [
        ("knot", "", Align::Right),
        ("cubic", "s", Align::Right),
        ("quintic", "s", Align::Right),
        ("published", "s", Align::Right),
        ("difference", "ms", Align::Right),
        ("cubic", "mm/s³", Align::Right),
        ("quintic", "mm/s³", Align::Right),
    ];
    let junctions = cubic.junctions.iter().zip(&quintic.junctions).zip(TABLE_2_S).enumerate();
    let rows: Vec<[String; 7]> = junctions
        .map(|(index, ((cubic, quintic), published_s))| {
            [
                (index + 1).to_string(),
                format!("{:.4}", cubic.time_s),
                format!("{:.4}", quintic.time_s),
                published_s.to_string(),
                format!("{:.1}", (quintic.time_s - published_s) * 1e3),
                format!("{:.0}", cubic.jerk_step_mm_s3()),
                format!("{:.0}", quintic.jerk_step_mm_s3()),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)?;
    let farthest_s = quintic
        .junctions
        .iter()
        .zip(TABLE_2_S)
        .map(|(junction, s)| (junction.time_s - s).abs())
        .fold(0.0, f64::max);
    writeln!(
        out,
        "\nThe published times differ by up to {:.1} ms. No curve through the points that is run through at constant feed has \
         them:\nthe first five chords are of one length, and so take equal times.",
        farthest_s * 1e3
    )?;
    writeln!(out, "\nJerk as a difference over ticks, and its steps from tick to tick\n")?;
    let columns = [
        ("path", "", Align::Left),
        ("tick", "ms", Align::Right),
        ("jerk max", "mm/s³", Align::Right),
        ("step max", "mm/s³", Align::Right),
    ];
    let rows: Vec<[String; 4]> = paths
        .iter()
        .flat_map(|(_, figures)| figures.by_tick.iter().map(|by_tick| (figures.name, by_tick)))
        .map(|(name, by_tick)| {
            [
                name.to_owned(),
                (by_tick.tick_s * 1e3).to_string(),
                format!("{:.1}", by_tick.jerk_max_mm_s3),
                format!("{:.1}", by_tick.jerk_step_max_mm_s3),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)?;
    writeln!(
        out,
        "\nOn the arcs the jerk is none of the path but of the tick; on the cubic spline its steps stay, on the quintic they go \
         with the tick."
    )
}

/// Writes how constant the feed is for each way to walk a spline.
fn write_evaluators([well, badly]: &[[Evaluator; WAYS]; 2], out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "\nGreatest error of the feed in a tick, on the quintic spline and on one whose u grows by steps of four and five in turn\n"
    )?;
    let columns = [
        ("evaluator", "", Align::Left),
        ("well", "", Align::Right),
        ("badly parametrised", "", Align::Right),
    ];
    let rows: Vec<[String; 3]> = well
        .iter()
        .zip(badly)
        .map(|(well, badly)| {
            [well.name.to_owned(), format!("{:.1e}", well.feed_error), format!("{:.1e}", badly.feed_error)]
        })
        .collect();
    table::write(&columns, &rows, out)
}
