//! Every suite but two in one executable: what the suites use of the generic kernel is compiled once for all of them, and their
//! tests share the processor's cores.
//!
//! On their own are `handover`, which compiles files of the kernel, and `target`, which names its tests at run time.
//!
//! ```text
//! cargo test -p motion-tests --test suite             all
//! cargo test -p motion-tests --test suite live::      one suite
//! ```

mod accuracy;
mod blends;
mod boards;
mod bytes;
mod compensation;
mod faults;
mod feedforward;
mod fixed_range;
mod functions;
mod fuzz;
mod homing;
mod identify;
mod jog;
mod law;
mod learning;
mod link_rate;
mod live;
mod optimum;
mod plan;
mod precision;
mod programs;
mod recording;
mod regulators;
mod samples;
mod screw;
mod streams;
mod stringer;
mod tuning;

#[test]
fn no_suite_is_left_out() {
    let alone = ["handover", "target"];
    motion_tests::assert_all_are_in(env!("CARGO_MANIFEST_DIR"), include_str!("suite.rs"), &alone);
}
