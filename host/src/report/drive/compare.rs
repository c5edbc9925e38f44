//! The page of regulators side by side: errors over frequency, outputs over time, figures.

use super::super::figure::{Axis, Figure, Graph, Series, Stack, ends_of};
use super::super::findings::Findings;
use super::super::format::{figure, fixed};
use super::super::palette::{self, Ink};
use super::super::picture;
use super::open;
use crate::drive::compare::{Choice, Measured, Motion, Row, Sweep};
use crate::machine::Machine;

/// The graphs end this far above the greatest error of velocity feedforward: it is what the others are to
/// better.
const AIR: f64 = 1.3;

/// Outputs over time by regulator \[s, V\].
pub type Outputs = [(Choice, Vec<(f64, f64)>)];

/// The solid line is the inverse's, which lies low.
fn ink(choice: Choice) -> Ink {
    let last_first = Choice::SHOWN.iter().rev().position(|&shown| shown == choice);
    palette::series(last_first.unwrap_or(0))
}

fn errors(sweeps: &[Sweep]) -> Stack {
    let graph = |name: &str, value: fn(&Measured) -> f64| {
        let greatest =
            |sweep: &Sweep| sweep.circles.iter().map(|(_, found)| value(found)).fold(0.0, f64::max);
        let of_velocity = sweeps.iter().filter(|sweep| sweep.choice == Choice::Pv).map(greatest);
        let series = |sweep: &Sweep| {
            let points = sweep.circles.iter().map(|(hz, found)| (*hz, value(found))).collect();
            Series::curve(sweep.choice.name(), ink(sweep.choice), points)
        };
        let ends = Some((0.0, AIR * of_velocity.fold(1e-3, f64::max)));
        Graph { ends, ..Graph::new(name, "µm", sweeps.iter().map(series).collect()) }
    };
    let all = sweeps.iter().flat_map(|sweep| &sweep.circles).map(|(hz, _)| *hz);
    let graphs = vec![
        graph("Contour error, greatest", |found| found.contour_um),
        graph("Following error, greatest of any axis", |found| found.following_um),
    ];
    let turns = Axis::new("Turns per second", "Hz");
    Stack::new("Errors of the regulators over the frequency of a circle", turns, ends_of(all), graphs)
}

fn over_time(outputs: &Outputs) -> Stack {
    let last_s = outputs.iter().filter_map(|(_, points)| points.last()).map(|point| point.0);
    let end_ms = last_s.fold(1e-3, f64::max) * 1e3;
    let graphs = outputs
        .iter()
        .map(|(choice, points)| {
            let points = points.iter().map(|(time_s, volts)| (time_s * 1e3, *volts)).collect();
            Graph::new(
                format!("{}: output", choice.name()),
                "V",
                vec![Series::curve("", palette::VOLTS, points)],
            )
        })
        .collect();
    Stack::new(
        "Outputs of two regulators with the same gains",
        Axis::new("Time", "ms"),
        (0.0, end_ms),
        graphs,
    )
}

/// The errors over frequency as an SVG file.
#[must_use]
pub fn picture_of_errors(sweeps: &[Sweep]) -> String {
    picture::of(&errors(sweeps))
}

/// The outputs over time as an SVG file.
#[must_use]
pub fn picture_of_outputs(outputs: &Outputs) -> String {
    picture::of(&over_time(outputs))
}

/// The page of regulators side by side. `resolutions_um` are the steps of set positions in the first and in the second figure.
#[must_use]
pub fn compare_findings(
    machine: &Machine,
    (motions, rows): (&[Motion], &[Row]),
    sweeps: &[Sweep],
    outputs: &Outputs,
    resolutions_um: [f64; 2],
) -> Findings {
    let words = ["The same feedback, limits and path for all;", "they differ in feedforward only."];
    let mut findings = open("Regulators side by side", machine, words, &[]);
    let [over_frequency_um, over_time_um] = resolutions_um.map(|um| figure(um, 3));
    findings.section("Errors over frequency");
    let words = format!(
        "Circles of constant feed, set positions in steps of {over_frequency_um} µm. Some errors lie above the \
         graphs: the cursor and the table have them."
    );
    findings.figure(errors(sweeps).with_words(words));
    findings.section("Outputs");
    let words = format!(
        "Set positions in steps of {over_time_um} µm. Both have the same gains; each graph has its own scale."
    );
    findings.figure(Figure::from(over_time(outputs).with_words(words)));
    findings.section("Figures");
    for (index, motion) in motions.iter().enumerate() {
        let headings = [
            "*Regulator, set positions",
            "Following error [µm]",
            "Contour error [µm]",
            "Output noise [mV rms]",
            "Current noise [% of the limit]",
        ];
        let cells = rows.iter().filter_map(|row| {
            let found = row.measured.get(index)?;
            Some(vec![
                format!("{}, {}", row.choice.name(), steps(row.resolution_um)),
                fixed(found.following_um, 2),
                fixed(found.contour_um, 2),
                fixed(found.output_noise_v * 1e3, 1),
                fixed(found.current_noise * 1e2, 1),
            ])
        });
        findings.words(&motion.name());
        findings.table(&motion.name(), &headings, cells);
    }
    findings
}

fn steps(resolution_um: f64) -> String {
    if resolution_um > 0.0 { format!("{} µm", figure(resolution_um, 3)) } else { "exact".to_owned() }
}
