//! The page of a screw: what was measured from both sides, and what compensation makes of it.

use super::super::figure::{Axis, Graph, Series, Stack, ends_of};
use super::super::findings::{Findings, Verdict};
use super::super::format::figure;
use super::super::palette;
use crate::identify::{ExplainedReading, ScrewFound};
use crate::machine::Machine;

const UM: f64 = 1e3;

/// Errors over the travel, and what the model leaves; `is_refused`: the machine file can't have it.
#[must_use]
pub fn screw_findings(machine: &Machine, axis: usize, found: &ScrewFound, is_refused: bool) -> Findings {
    let name = &machine.axes[axis].name;
    let title = format!("Screw of axis {name}");
    let um = |mm: f64| format!("{} µm", figure(mm * UM, 3));
    let bold = format!(
        "Off the mean by at most {}; off the model by {}.",
        um(found.before_mm()),
        um(found.left_most_mm)
    );
    let play = found.backlash_mm;
    let (verdict, rest) = if is_refused {
        (Verdict::Failed, "The machine file can’t have this compensation.")
    } else {
        (Verdict::Done, "")
    };
    let mut findings = Findings::new(&title, &machine.name, verdict, [&bold, rest]);
    findings.section("Where the load is, less where it was told to be");
    let of = |is_from_above: bool, value: &dyn Fn(&ExplainedReading) -> f64| {
        let readings = found.readings.iter().filter(|reading| reading.is_from_above == is_from_above);
        let mut points: Vec<(f64, f64)> =
            readings.map(|reading| (reading.load_mm, value(reading) * UM)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let measured = |reading: &ExplainedReading| reading.error_mm;
    let model = |reading: &ExplainedReading| reading.model_mm;
    let graphs = vec![
        Graph::new(
            "Error",
            "µm",
            vec![
                Series::dots("after motion in positive direction", palette::series(0), of(false, &measured)),
                Series::dots("after motion in negative direction", palette::series(1), of(true, &measured)),
                Series::curve("model, positive", palette::series(2), of(false, &model)),
                Series::curve("model, negative", palette::series(3), of(true, &model)),
            ],
        ),
        Graph::new(
            "Left",
            "µm",
            vec![
                Series::dots("positive", palette::series(0), of(false, &ExplainedReading::left_mm)),
                Series::dots("negative", palette::series(1), of(true, &ExplainedReading::left_mm)),
            ],
        ),
    ];
    let ends = ends_of(found.readings.iter().map(|reading| reading.load_mm));
    let words = format!(
        "Backlash {} ± {}. Readings are about their mean; the model is joined by straight lines from place to place.",
        um(play.value),
        um(play.half_width_95)
    );
    findings.figure(
        Stack::new("Errors over the travel", Axis::new("Load", "mm"), ends, graphs).with_words(words),
    );
    findings
}
