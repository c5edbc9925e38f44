//! Reports of the drive experiments: the curves from which their figures are read.
//!
//! Consumes recordings and figures of [`drive`](crate::drive); produces a [`Findings`] each. What draws an experiment draws it for
//! a report and for the page that makes experiments itself.

#[cfg(feature = "terminal")]
mod compare;
mod bode;
mod circle;
mod harmonic;
mod inertia;
mod screw;
mod step;
mod tune;

pub use self::bode::bode_findings;
pub use self::circle::{
    Around, CIRCLE_LIMIT_UM, CircleSweep, circle_around, circle_figures, circle_findings,
};
#[cfg(feature = "terminal")]
pub use self::compare::{Outputs, compare_findings, picture_of_errors, picture_of_outputs};
pub use self::harmonic::{harmonic_figures, harmonic_findings};
pub use self::inertia::{inertia_figure, inertia_findings};
pub use self::screw::screw_findings;
pub use self::step::{step_figures, step_findings};
pub use self::tune::{Circles, LearntRow, NotDriven, TunedAxis, Tuning, tune_figures, tune_findings};

use super::figure::{Axis, Graph, Series, Stack};
use super::findings::{Findings, Verdict};
use super::format::fixed;
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// Amplitude at −3 dB.
const HALF_POWER_DB: f64 = -3.0103;

fn db(ratio: f64) -> f64 {
    20.0 * libm::log10(ratio)
}

/// Amplitude and phase over frequency.
fn over_frequency(title: &str, ends: (f64, f64), amplitude: Vec<Series>, phase: Vec<Series>) -> Stack {
    let amplitude = Graph::new("Amplitude", "dB", amplitude).with_levels(&[HALF_POWER_DB]);
    let graphs = vec![amplitude, Graph::new("Phase", "°", phase)];
    Stack::new(title, Axis::new("Frequency", "Hz"), ends, graphs).logarithmic()
}

/// Begins the page: title, machine, the outcome in a sentence, and how it compares with the reference machine's figures.
fn open(title: &str, machine: &Machine, [bold, rest]: [&str; 2], comparisons: &[Comparison]) -> Findings {
    let missed = comparisons.iter().filter(|comparison| !comparison.holds()).count();
    let (verdict, compared) = match (comparisons.len(), missed) {
        (0, _) => (Verdict::Done, String::new()),
        (all, 0) => (Verdict::Done, format!(" All {all} figures of the reference machine hold.")),
        (all, missed) => {
            (Verdict::Failed, format!(" {missed} of {all} figures of the reference machine are missed."))
        }
    };
    let mut findings = Findings::new(title, &machine.name, verdict, [bold, &format!("{rest}{compared}")]);
    if comparisons.is_empty() {
        return findings;
    }
    let rows = comparisons.iter().map(|comparison| {
        let figure = &comparison.figure;
        vec![
            format!("{} [{}]", figure.quantity, figure.unit),
            fixed(comparison.measured, 2),
            fixed(figure.expected, 2),
            figure.tolerance.to_string(),
            figure.paper.to_string().replace('-', "−"),
            if comparison.holds() { "holds" } else { "missed" }.to_owned(),
        ]
    });
    findings.section("The reference machine’s figures");
    findings.table("Figures", &["*Figure", "Measured", "Expected", "±", "Published", "*"], rows);
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::reference::Figure;

    /// A figure that is missed makes the page red.
    #[test]
    fn missed_figures_are_told_in_red() {
        let machine = Machine::reference();
        let figure = Figure { quantity: "delay", unit: "ms", paper: 2.0, expected: 2.01, tolerance: 0.1 };
        let page = |measured: f64| {
            let findings = open("Step", &machine, ["Delay", "told."], &[Comparison { figure, measured }]);
            findings.parts().0
        };
        let (holds, missed) = (page(2.05), page(2.2));
        assert!(holds.contains("class=\"result done\"") && holds.contains("All 1 figures"), "{holds}");
        assert!(missed.contains("class=\"result faulted\""), "{missed}");
        assert!(missed.contains("1 of 1 figures of the reference machine are missed."), "{missed}");
    }
}
