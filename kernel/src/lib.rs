//! Real-time motion for boards that drive ±10 V velocity servos.
//!
//! Every control tick the kernel evaluates a feed law of smooth jerk, walks the path,
//! regulates every axis with P(ID) and feedforward of velocity, acceleration and jerk, and writes a
//! voltage. No allocation, no unsafe code, no panic, no loop without a constant bound.
//!
//! Modules in the order the data travels:
//!
//! ```text
//!   background                                   what it hands on
//!   ──────────                                   ────────────────
//!   plan    ceilings, junctions, look-ahead      Block, Path, PlannedRamp
//!   law     ramps; inverse problems              Ramp ─► FeedSegment ─┐ two streams that measure
//!   path    lines and septic pieces              Piece ───────────────┤ the same path length
//!   program both as data; keeps the queues full  Item ─► Feeder       │
//!   live    hold, override, abort (optional)     feed lists           │
//!   straight, jog, homing (optional)             Item ─► live         │
//!   link    a wire to a PC (optional)            Item ─► live         │
//!   scope   ticks for a PC (optional)            Recorder ─► link     │
//!   queue   bounded, checked on entry            Feeder ─► Intake ◄───┘
//!   ─────── tick ───────────────────────────────────────────────────────
//!   exec    feed law ─► s, v, a, j, snap         PathMotion
//!   path    piece ─► position, V, A, J           Setpoint per axis
//!   axis    following error, regulator           DacCode per axis
//!   hal     ±10 V outputs, encoders, enable      Counts back to axis
//! ```
//!
//! [`kernel`] assembles the tick, [`trace`] is the record of a tick, [`flight`] keeps the last records, and
//! all modules compute in [`units`] and [`num`].
//!
//! Units are mm, s and V throughout. Equations are cited by paper and number: S1 is the sin² law,
//! S3 the feed planning, S4 the servo axis (full titles in the project's README).
//!
//! # Example
//!
//! A straight move of 20 mm on one axis, from plan to set-points:
//!
//! ```
//! use motion_kernel::exec::{ExecState, Executor};
//! use motion_kernel::law::{Law, Limits, Pulse};
//! use motion_kernel::path::Piece;
//! use motion_kernel::plan::{Block, BlockPlan, plan, ramps};
//! use motion_kernel::queue::{PathRules, Streams};
//! use motion_kernel::units::Position;
//!
//! // Background: plan in f64.
//! let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
//! let block = Block {
//!     length_mm: 20.0,
//!     cap_mm_s: 50.0,
//!     junction_mm_s: f64::INFINITY,
//!     law: Law::new(Pulse::Plateau, limits).unwrap(),
//! };
//! let mut plans = [BlockPlan::default()];
//! plan(&[block], 0.0, 0.0, &mut plans).unwrap();
//!
//! // Feed the two streams, for an f32 tick of 0.5 ms. Lines longer than 16 mm are cut.
//! let at = |mm| Position::from_mm(mm).unwrap();
//! let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 8, 8>::new();
//! let (mut feeder, mut intake) = streams.split(rules, [at(0.0)]);
//! for ramp in ramps(&block, &plans[0], at(0.0), at(20.0), 0.0005).unwrap().into_iter().flatten() {
//!     feeder.segment(ramp.segment(0.0005).unwrap()).unwrap();
//! }
//! feeder.piece(Piece::line(1, [at(0.0)], [1.0], at(10.0)).unwrap()).unwrap();
//! feeder.piece(Piece::line(1, [at(10.0)], [1.0], at(10.0)).unwrap()).unwrap();
//! feeder.end_stretch([at(20.0)]).unwrap();
//!
//! // Tick.
//! let mut executor = Executor::new([at(0.0)]);
//! loop {
//!     let executed = executor.tick(&mut intake).unwrap();
//!     if executed.state == ExecState::Idle {
//!         assert_eq!(executed.setpoints[0].position, at(20.0)); // exactly
//!         break;
//!     }
//! }
//! ```
#![cfg_attr(not(test), no_std)]
// Which feature an item needs, on docs.rs.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
// Some shared code is called only by guards, live control or the scope, which needs both; without them the linker drops it.
#![cfg_attr(not(feature = "scope"), allow(dead_code))]
// No panic path in code that runs on a board; tests may panic.
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod array;
pub mod units;
pub mod num;
pub mod plan;
pub mod law;
pub mod path;
pub mod queue;
pub mod program;
#[cfg(feature = "live")]
pub mod live;
pub mod exec;
pub mod axis;
pub mod hal;
pub mod fault;
pub mod tick_monitor;
pub mod trace;
pub mod flight;
pub mod kernel;
#[cfg(feature = "link")]
pub mod link;
#[cfg(feature = "scope")]
pub mod scope;
#[cfg(feature = "live")]
pub mod straight;
#[cfg(feature = "live")]
pub mod jog;
// Without guards a tick does not keep a healthy machine's inputs, so homing would not see the switch.
#[cfg(all(feature = "live", feature = "guards"))]
pub mod homing;

#[doc(hidden)]
pub mod internals;
mod work;

#[cfg(all(test, feature = "guards"))]
mod corrupted;
#[cfg(test)]
mod fixture;
#[cfg(test)]
mod random;
