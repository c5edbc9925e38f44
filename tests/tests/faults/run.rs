//! What a run reports of a fault that was injected.

use motion_host::machine::Machine;
use motion_host::simulate::inject::Injections;
use motion_host::simulate::live::Script;
use motion_host::simulate::{RunOptions, RunSummary, run_with};
use motion_tests::check::planned;

fn run(injections: &str, script: Option<&Script>) -> RunSummary {
    let machine = Machine::reference();
    let plan = planned("G21 G90 G61\nG1 X100 Y40 F6000\n", &machine).expect("a plan");
    let injections: Injections = injections.parse().expect("injections");
    let options = RunOptions { injections: Some(&injections), script, ..RunOptions::default() };
    run_with(&options, &plan, &machine, &mut |_| {}).expect("a run")
}

#[test]
fn a_run_reports_the_fault_with_its_tick_axis_and_figures() {
    let live: Script = "0:override=1".parse().expect("a script");
    for (injected, axis, fault, detail) in [
        ("1000:encoder-lost=X", Some("X"), "encoder lost", "no counts"),
        ("1000:encoder-jump=Y:-5000", Some("Y"), "encoder jump", "counts in a tick that no motor moves"),
        ("1000:encoder-reversed=X", Some("X"), "runaway", "counts the other way"),
        ("1000:drive-not-ready=Z", Some("Z"), "drive not ready", "not ready"),
        ("1000:drive-fault=Z", Some("Z"), "drive", "reports a fault"),
        ("1000:limit-high=X:-50", Some("X"), "limit switch", "reached"),
        ("1000:emergency-stop", None, "emergency stop", "open"),
        // The first one stays.
        ("1000:emergency-stop,1000:drive-fault=Z,1001:encoder-lost=X", None, "emergency stop", "open"),
    ] {
        for script in [None, Some(&live)] {
            let summary = run(injected, script);
            let [found] = summary.faults.as_slice() else { panic!("{injected}: {:?}", summary.faults) };
            assert_eq!((found.tick, found.axis.as_deref()), (1000, axis), "{injected}: {found:?}");
            assert!(found.fault == fault && found.detail.contains(detail), "{injected}: {found:?}");
        }
    }
}
