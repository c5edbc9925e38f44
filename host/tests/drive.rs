//! The drive experiments through planner, streams and kernel in f32, against the reference machine's figures.

use motion_host::drive::reference::{self, BANDWIDTH_FEED_MM_S, CIRCLE_FEED_MM_S, Comparison};
use motion_host::drive::step::Step;
use motion_host::drive::{Terms, circle, experiment, harmonic, turning::Turning};
use motion_host::machine::Machine;

#[track_caller]
fn assert_hold(comparisons: &[Comparison]) {
    for comparison in comparisons {
        let figure = comparison.figure;
        println!(
            "{}: {:.3} {}, expected {} ± {}",
            figure.quantity, comparison.measured, figure.unit, figure.expected, figure.tolerance
        );
    }
    let failed: Vec<_> = comparisons.iter().filter(|comparison| !comparison.holds()).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn the_step_has_the_figures_of_s4() {
    let machine = Machine::reference();
    let (figures, _) = Step::reference().measure(&machine).expect("a step");
    assert_hold(&reference::compare_step(&machine, &figures).expect("a step"));
}

#[test]
fn harmonics_have_the_figures_of_s4() {
    assert_hold(&reference::compare_harmonic(&Machine::reference()).expect("harmonics"));
}

#[test]
fn circles_have_the_figures_of_s4() {
    assert_hold(&reference::compare_circle(&Machine::reference()).expect("circles"));
}
