//! The page of S2's experiment: velocity, acceleration and jerk of both axes, on arcs and on splines.

use super::figure::{Axis, Graph, Series, Stack};
use super::findings::{Findings, Verdict};
use super::format::fixed;
use crate::smoothness::evaluators::WAYS;
use crate::smoothness::{AxisTicks, Course, Evaluator, FEED_MM_S, Figures, TABLE_2_S, TICK_S};
use crate::toolpath::Vector;

const AXES: [&str; 2] = ["X", "Y"];

/// The page: `paths` are the arcs, then the splines; `evaluators` those of a well and of a badly parametrised spline.
#[must_use]
pub fn smoothness_findings(paths: &[(Course, Figures)], [well, badly]: &[[Evaluator; WAYS]; 2]) -> Findings {
    let title = format!("Path smoothness at {FEED_MM_S} mm/s");
    let words = [
        "Only the quintic’s jerk is continuous.",
        "On two arcs the acceleration steps where they meet, and its difference over a tick grows as the tick shrinks; a cubic \
         spline through ten of their points steps in jerk at every knot.",
    ];
    let mut findings = Findings::new(&title, "", Verdict::Done, words);
    findings.section("Figures");
    let headings = ["*Path", "Length [mm]", "Time [s]", "Ticks", "From the arcs [mm]"];
    let rows = paths.iter().map(|(_, figures)| {
        vec![
            figures.name.to_owned(),
            fixed(figures.length_mm, 5),
            fixed(figures.time_s, 6),
            figures.ticks.to_string(),
            fixed(figures.deviation_mm, 4),
        ]
    });
    findings.table("Paths", &headings, rows);
    knots(paths, &mut findings);
    by_tick(paths, &mut findings);
    // The splines share their scales, so that the eye can compare them; the arcs have their own.
    let ticks: Vec<AxisTicks> = paths.iter().map(|(course, _)| course.ticks(FEED_MM_S, TICK_S)).collect();
    let splines = ticks.get(1..).unwrap_or_default();
    let common = [
        ends(splines.iter().flat_map(|ticks| &ticks.accel_mm_s2)),
        ends(splines.iter().flat_map(|ticks| &ticks.jerk_mm_s3)),
    ];
    for (index, ((course, _), ticks)) in paths.iter().zip(&ticks).enumerate() {
        findings.section(&format!("Axes on the {}", course.name));
        findings.figure(one_path(course.name, ticks, (index > 0).then_some(common)));
    }
    findings.section("Feed of a tick");
    let headings = ["*Evaluator", "Greatest error, well parametrised", "Badly parametrised"];
    let rows = well.iter().zip(badly).map(|(well, badly)| {
        vec![well.name.to_owned(), format!("{:.1e}", well.feed_error), format!("{:.1e}", badly.feed_error)]
    });
    findings.table("Evaluators", &headings, rows);
    findings.words(
        "Quintic splines through the ten points: over the published u, and over one that grows by steps of four and five in \
         turn. Only septic pieces are what the kernel runs.",
    );
    findings
}

/// A table of the times at the knots, the published ones, and the steps of the jerk there.
fn knots(paths: &[(Course, Figures)], findings: &mut Findings) {
    let [_, (_, cubic), (_, quintic)] = paths else { return };
    findings.section("At the knots");
    let headings = [
        "*Knot",
        "Cubic [s]",
        "Quintic [s]",
        "Published [s]",
        "Difference [ms]",
        "Step of the jerk, cubic [mm/s³]",
        "Quintic [mm/s³]",
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
    findings.table("Knots", &headings, rows);
    findings.words(
        "The published times fit no curve through the points that is run through at constant feed: the first five chords \
         are of one length.",
    );
}

fn by_tick(paths: &[(Course, Figures)], findings: &mut Findings) {
    findings.section("Jerk as a difference over ticks");
    let headings = ["*Path, tick", "Greatest [mm/s³]", "Greatest step from tick to tick [mm/s³]"];
    let rows = paths.iter().flat_map(|(_, figures)| {
        figures.by_tick.iter().map(|by_tick| {
            vec![
                format!("{}, {} ms", figures.name, by_tick.tick_s * 1e3),
                fixed(by_tick.jerk_max_mm_s3, 1),
                fixed(by_tick.jerk_step_max_mm_s3, 1),
            ]
        })
    });
    findings.table("Jerk", &headings, rows);
}

/// Ends of an axis over all values of X and Y.
fn ends<'a>(values: impl Iterator<Item = &'a Vector>) -> (f64, f64) {
    let (low, high) = values
        .flat_map(|[x, y, _]| [*x, *y])
        .fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    let air = 0.06 * (high - low);
    (low - air, high + air)
}

fn one_path(name: &str, ticks: &AxisTicks, ends: Option<[(f64, f64); 2]>) -> Stack {
    let tick_ms = ticks.tick_s * 1e3;
    let graph = |title: &str, unit: &str, values: &[Vector], first_tick: usize, ends: Option<(f64, f64)>| {
        let of = |axis: usize| {
            let at = |(tick, value): (usize, &Vector)| ((tick + first_tick) as f64 * tick_ms, value[axis]);
            (AXES[axis].to_owned(), values.iter().enumerate().map(at).collect())
        };
        Graph { ends, ..Graph::new(title, unit, Series::numbered((0..AXES.len()).map(of))) }
    };
    let graphs = vec![
        graph("Velocity", "mm/s", &ticks.velocity_mm_s, 0, None),
        graph("Acceleration", "mm/s²", &ticks.accel_mm_s2, 1, ends.map(|[accel, _]| accel)),
        graph("Jerk", "mm/s³", &ticks.jerk_mm_s3, 2, ends.map(|[_, jerk]| jerk)),
    ];
    let end_ms = ticks.velocity_mm_s.len() as f64 * tick_ms;
    Stack::new(format!("Axes on the {name}"), Axis::new("Time", "ms"), (0.0, end_ms), graphs)
        .with_words(format!("Accelerations and jerks are differences over ticks of {tick_ms} ms."))
}
