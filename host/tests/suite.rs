//! All suites in one executable: what they share is compiled once, and their tests share the processor's cores.
//!
//! ```text
//! cargo test -p motion-host --test suite gcode::      one suite
//! ```

#![allow(clippy::disallowed_methods, reason = "what a platform computes is an oracle here")]

mod axes_reading;
mod axes_planning;
mod axes_runs;
mod board;
mod cli;
mod compare;
mod curves;
mod cutter;
mod dialect;
mod drive;
mod from_line;
mod gcode;
mod limit_share;
mod mutation;
mod nurbs;
mod operated;
mod panel;
mod probing;
mod outputs;
mod resume;
mod smoothness;
mod spline;

#[test]
fn no_suite_is_left_out() {
    motion_tests::assert_all_are_in(env!("CARGO_MANIFEST_DIR"), include_str!("suite.rs"), &["page"]);
}
