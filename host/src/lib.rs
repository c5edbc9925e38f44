//! The PC side of the motion kernel: from G-code to motion on a simulated machine.
//!
//! Modules in the order the data travels:
//!
//! ```text
//!   files      paths ─► OutputFile              what is read stays, what is written is whole
//!   machine    TOML ─► Machine                    limits, axes, drives
//!   touch      boxes                              what a probe touches
//!   gcode      text ─► Program                    exact decimals, modal state
//!   points     CSV ─► Points                    what a spline goes through
//!   toolpath   moves ─► Element ─► Piece          arc length, septic polynomials
//!   smoothness points, arcs ─► axis jerk          what the degree of a path does to the axes
//!   planning   Program ─► Plan                    ceilings with reasons, feed over path
//!   check      Program, Machine ─► Check          needs, time by reason, advice
//!   compare    Program ─► figures                times of its paths, beside the least there is
//!   simulate   Plan ─► ticks                      the kernel against hal-sim
//!   recording  a run ─► bytes ─► the same run    replay from what the kernel was told
//!   flight     a board's log ─► TraceRow       the ticks around a fault
//!   trace      TraceRow, RunTrace              what a run leaves behind
//!   board      items ─► a board, and its state ◄─   over a wire, or simulated
//!   panel      a board ◄─► tabs of a browser      an operator's view of it
//!   axis_unit                                  mm or °
//!   drive      Machine ─► figures of its axes     step, harmonics, circles
//!   identify   recordings ─► drive parameters     what an axis is, from its runs
//!   tuning     Machine ─► parameters ─► gains     with the reason for each
//!   report     RunTrace ─► HTML                  one file, its data inside
//!   ramp       limits, feeds ─► figures         one change of feed
//!   playground request ─► steps ─► answer       what a page in a browser asks for
//!   cli        the `motion` command
//! ```
//!
//! Without the feature `terminal` it is what a page runs: no files, no threads, no wires, no command.

// What only the command uses is in modules that others use, too.
#![cfg_attr(not(feature = "terminal"), allow(dead_code, unused_imports))]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "what a platform computes is an oracle here"))]

mod chance;
#[cfg(feature = "terminal")]
pub mod files;
pub mod machine;
#[cfg(feature = "terminal")]
pub mod cli;
pub mod touch;
pub mod gcode;
pub mod points;
pub mod toolpath;
pub mod smoothness;
pub mod planning;
pub mod check;
pub mod compare;
pub mod simulate;
pub mod recording;
pub mod flight;
#[cfg(feature = "terminal")]
pub mod board;
#[cfg(feature = "terminal")]
pub mod panel;
pub mod axis_unit;
pub mod trace;
pub mod drive;
pub mod identify;
pub mod tuning;
pub mod report;
pub mod ramp;
pub mod playground;
pub mod sine;
