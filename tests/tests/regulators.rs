//! Regulators side by side on the reference machine, as `motion drive compare` and host/AXIS.md show them.

use motion_host::cli::demo::STRINGER;
use motion_host::drive::compare::{Choice, Measured, Motion, Regulators};
use motion_host::drive::reference::CIRCLE_FEED_MM_S;
use motion_host::drive::replay::{Law, replay};
use motion_host::drive::turning::Turning;
use motion_host::machine::Machine;
use motion_tests::figures::{Table, hold};

const RESOLUTIONS_UM: [f64; 2] = [0.1, 1.0];

#[test]
fn regulators() {
    let regulators = Regulators::new(&Machine::reference(), CIRCLE_FEED_MM_S, &mut || {}).expect("a fit");
    println!("{:?}", regulators.fitted);
    let motions = [
        Motion::Circle(Turning::new(4.0, CIRCLE_FEED_MM_S)),
        Motion::Circle(Turning::new(10.0, CIRCLE_FEED_MM_S)),
        Motion::Program("stringer.ngc", STRINGER),
    ];
    for choice in Choice::ALL {
        let found = motions.each_ref().map(|m| regulators.measure(choice, m, &RESOLUTIONS_UM).expect("a run"));
        for i in 0..3 {
            println!("{} {:?}", choice.name(), found.each_ref().map(|f| f[i]));
        }
    }
}
