//! Live control: hold, resume, feed override and abort at any tick, and a stop where data come too late.
//!
//! ```text
//!   items ─► LiveControl ─► path queue, feed lists ─► executor
//!   commands ──┘  ▲                                   │
//!                 └────────── where it is ◄───────────┘
//! ```
//!
//! Consumes [`Item`](crate::program::Item)s and commands; produces pieces and **feed lists**, each a complete motion that
//! ends at rest on path that is queued. All of it runs in the background: the tick only goes over from one list to the
//! next where it was told to (see [`Change`](crate::queue::Change)). So motion is legal whatever the background does and
//! however long it takes, and where it takes too long, the list under way ends in a stop on the path.
//!
//! A command is a list that begins at the next **splice**, a place where the feed does not change: anywhere in a
//! cruise; a little later in a ramp that accelerates, which is given up by the shortest way (`Item::cut`), or for an
//! override where it gets to the feed that this allows (`Item::cut_to`); at the end of a ramp that brakes, because ceilings ahead may need all of it. From there on it brakes to rest or to another
//! feed under the ceilings and limits of all the blocks it crosses; where a ceiling ahead does not let it begin, at the
//! next splice that does. What follows a stop or an override is planned anew, to the end of the stretch; a stretch
//! that nothing was changed in is driven by the program's own plan.
//!
//! - `block_ends`, `single`: a rest at the end of every program block;
//! - `road`: blocks ahead, and how to brake on them;
//! - `replan`: a plan from a splice on;
//! - `list`: a feed list as the background sees it;
//! - `gather`: what goes into the next list;
//! - [`Source`]: where items come from, perhaps later;
//! - `command`: what takes over from the motion under way, and where;
//! - [`control`]: what follows what.
//!
//! ```
//! use motion_kernel::exec::Executor;
//! use motion_kernel::law::Limits;
//! use motion_kernel::live::{LiveControl, State};
//! use motion_kernel::queue::{LiveStreams, PathRules};
//! use motion_kernel::straight::Straight;
//! use motion_kernel::units::Position;
//!
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let (start, end) = ([Position::ZERO], [Position::from_mm(100.0).expect("within a kilometre")]);
//! let program = Straight::new(start, end, limits, [40.0, 50.0], 0.0005).expect("a motion");
//! let mut streams = LiveStreams::<f32, 1, 64, 16>::new();
//! let (mut feeder, mut intake) = streams.split(rules, start);
//! let mut control = LiveControl::<f32, 1, _, _, 64>::new(program, 0.0005, 1);
//! let mut executor = Executor::new(start);
//! for tick in 0..2000 {
//!     if tick == 1000 {
//!         control.hold();
//!     }
//!     control.poll(&mut feeder).expect("items that can be executed");
//!     let executed = executor.tick(&mut intake).expect("no fault");
//!     if control.state(&feeder) == State::Held {
//!         assert_eq!(executed.motion.v_mm_s, 0.0);
//!     }
//! }
//! assert_eq!(control.state(&feeder), State::Held);
//! ```

mod block_ends;
mod command;
pub mod control;
mod gather;
#[cfg(test)]
mod interrupted;
mod list;
mod replan;
mod road;
mod source;
mod single;

pub use control::{LiveControl, OVERRIDE_MAX, OVERRIDE_MIN, State};
pub use list::LIST_ITEMS;
pub use source::Source;
