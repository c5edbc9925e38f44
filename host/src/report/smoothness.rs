//! The page of S2's experiment: velocity, acceleration and jerk of both axes, on arcs and on splines.

use std::io::{self, Write};

use super::drive::{close, legend, table};
use super::figure_html;
use super::format::{escape, figure, fixed};
use super::head;
use super::palette;
use super::plots::Caption;
use super::plots::graph::{Graph, Series, Stack};
use crate::smoothness::evaluators::WAYS;
use crate::smoothness::{AxisTicks, Course, Evaluator, FEED_MM_S, Figures, TABLE_2_S, TICK_S};
use crate::toolpath::Vector;

const AXES: [&str; 2] = ["X", "Y"];

/// Writes the page: `paths` are the arcs, then the splines; `evaluators` those of a well and of a badly
/// parametrised spline.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_smoothness(
    paths: &[(Course, Figures)],
    [well, badly]: &[[Evaluator; WAYS]; 2],
    out: &mut impl Write,
) -> io::Result<()> {
    let title = format!("Path smoothness at {FEED_MM_S} mm/s");
    head(&title, out)?;
    writeln!(out, "<header><h1>{}</h1>", escape(&title))?;
    writeln!(
        out,
        "<p class=\"result done\"><strong>Only the quintic’s jerk is continuous.</strong> On two arcs the acceleration \
         steps where they meet, and its difference over a tick grows as the tick shrinks; a cubic spline through ten of their \
         points steps in jerk at every knot.</p></header>"
    )?;
    writeln!(out, "<section><h2>Figures</h2>")?;
    let headings = ["path", "length [mm]", "time [s]", "ticks", "from the arcs [mm]"];
    let rows = paths.iter().map(|(_, figures)| {
        vec![
            figures.name.to_owned(),
            fixed(figures.length_mm, 5),
            fixed(figures.time_s, 6),
            figures.ticks.to_string(),
            fixed(figures.deviation_mm, 4),
        ]
    });
    table(&headings, rows, out)?;
    knots(paths, out)?;
    by_tick(paths, out)?;
    writeln!(out, "</section>")?;
    // The splines share their scales, so that the eye can compare them; the arcs have their own.
    let ticks: Vec<AxisTicks> = paths.iter().map(|(course, _)| course.ticks(FEED_MM_S, TICK_S)).collect();
    let splines = ticks.get(1..).unwrap_or_default();
    let common = [
        ends(splines.iter().flat_map(|ticks| &ticks.accel_mm_s2)),
        ends(splines.iter().flat_map(|ticks| &ticks.jerk_mm_s3)),
    ];
    for (index, ((course, _), ticks)) in paths.iter().zip(&ticks).enumerate() {
        one_path(course.name, index, ticks, (index > 0).then_some(common), out)?;
    }
    writeln!(out, "<section><h2>Feed of a tick</h2>")?;
    let headings = ["evaluator", "greatest error, well parametrised", "badly parametrised"];
    let rows = well.iter().zip(badly).map(|(well, badly)| {
        vec![well.name.to_owned(), format!("{:.1e}", well.feed_error), format!("{:.1e}", badly.feed_error)]
    });
    table(&headings, rows, out)?;
    writeln!(
        out,
        "<p>Quintic splines through the ten points: over the published u, and over one that grows by steps of four and five in          turn. Only septic pieces are what the kernel runs.</p></section>"
    )?;
    close(out)
}

/// A table of the times at the knots, the published ones, and the steps of the jerk there.
fn knots(paths: &[(Course, Figures)], out: &mut impl Write) -> io::Result<()> {
    let [_, (_, cubic), (_, quintic)] = paths else { return Ok(()) };
    writeln!(out, "<h2>At the knots</h2>")?;
    let headings = [
        "knot",
        "cubic [s]",
        "quintic [s]",
        "published [s]",
        "difference [ms]",
        "step of the jerk, cubic [mm/s³]",
        "quintic [mm/s³]",
    ];
    let rows = cubic.junctions.iter().zip(&quintic.junctions).zip(TABLE_2_S).enumerate().map(
        |(index, ((cubic, quintic), published_s))| {
            vec![
                (index + 1).to_string(),
                fixed(cubic.time_s, 4),
                fixed(quintic.time_s, 4),
                published_s.to_string(),
                fixed((quintic.time_s - published_s) * 1e3, 1),
                fixed(cubic.jerk_step_mm_s3(), 0),
                fixed(quintic.jerk_step_mm_s3(), 0),
            ]
        },
    );
    table(&headings, rows, out)?;
    writeln!(
        out,
        "<p>The published times fit no curve through the points that is run through at constant feed: the first five chords \
         are of one length.</p>"
    )
}

fn by_tick(paths: &[(Course, Figures)], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "<h2>Jerk as a difference over ticks</h2>")?;
    let headings = ["path, tick", "greatest [mm/s³]", "greatest step from tick to tick [mm/s³]"];
    let rows = paths.iter().flat_map(|(_, figures)| {
        figures.by_tick.iter().map(|by_tick| {
            vec![
                format!("{}, {} ms", figures.name, by_tick.tick_s * 1e3),
                fixed(by_tick.jerk_max_mm_s3, 1),
                fixed(by_tick.jerk_step_max_mm_s3, 1),
            ]
        })
    });
    table(&headings, rows, out)
}

/// Ends of an axis over all values of X and Y.
fn ends<'a>(values: impl Iterator<Item = &'a Vector>) -> (f64, f64) {
    let (low, high) = values
        .flat_map(|[x, y, _]| [*x, *y])
        .fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    let air = 0.06 * (high - low);
    (low - air, high + air)
}

fn one_path(
    name: &str,
    index: usize,
    ticks: &AxisTicks,
    ends: Option<[(f64, f64); 2]>,
    out: &mut impl Write,
) -> io::Result<()> {
    let graph = |title: &str, values: &[Vector], first_tick: usize, y: Option<(f64, f64)>| Graph {
        title: title.to_owned(),
        y,
        series: (0..AXES.len())
            .map(|axis| Series {
                ink: palette::series(axis),
                points: values
                    .iter()
                    .enumerate()
                    .map(|(tick, value)| ((tick + first_tick) as f64 * ticks.tick_s * 1e3, value[axis]))
                    .collect(),
            })
            .collect(),
        levels: Vec::new(),
    };
    let stack = Stack {
        x: (0.0, ticks.velocity_mm_s.len() as f64 * ticks.tick_s * 1e3),
        x_name: "time [ms]",
        is_logarithmic: false,
        graphs: vec![
            graph("Velocity [mm/s]", &ticks.velocity_mm_s, 0, None),
            graph("Acceleration [mm/s²]", &ticks.accel_mm_s2, 1, ends.map(|[accel, _]| accel)),
            graph("Jerk [mm/s³]", &ticks.jerk_mm_s3, 2, ends.map(|[_, jerk]| jerk)),
        ],
    };
    let description = format!(
        "Velocity, acceleration and jerk of X and Y over time on the {name}; jerk up to {} mm/s³.",
        figure(ticks.jerk_max_mm_s3(), 4)
    );
    let title = format!("Axes on the {name}");
    let caption = Caption { id: &format!("path{index}"), title: &title, description: &description };
    let words = format!("Accelerations and jerks are differences over ticks of {} ms.", ticks.tick_s * 1e3);
    writeln!(out, "<section><h2>{}</h2>", escape(&title))?;
    figure_html(&stack.draw(&caption)?, &legend(AXES.map(str::to_owned).into_iter()), &words, out)?;
    writeln!(out, "</section>")
}
