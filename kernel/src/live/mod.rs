//! Live control: hold, resume, feed override and abort at any tick, and a stop where data come too late.
//!
//! ```text
//!   Source ──► reader ──► path queue ──────────────────────────────► executor
//!                │  lookahead: blocks, block ends                       ▲  │
//!                │  program_feed: cursor                                │  │
//!                ▼                                                      │  │
//!   commands ► mode ──► choose ──► list, Choice ──► timeline ──► feed lists│
//!                         ▲                            ▲                   │
//!                         └───────── places ───────────┴──── where it is ◄─┘
//! ```
//!
//! Consumes [`Item`](crate::program::Item)s and commands; produces pieces and **feed lists**, each a complete
//! motion that ends at rest on path that is queued. All of it runs in the background: the tick only changes
//! from one list to the next where it is told to (see [`Change`](crate::queue::Change)). So motion is legal
//! whatever the background does and however long it takes; if it takes too long, the list under way ends in a
//! stop on the path.
//!
//! A command is a list that begins at the next **splice**, a place where the feed does not change: anywhere
//! in a cruise; a little later in a ramp that accelerates, which is cut in the shortest way (`Item::cut`), or
//! for an override where it reaches the feed that this allows (`Item::cut_to`); at the end of a ramp that
//! brakes, because ceilings ahead may need all of it. From there on it brakes to rest or to another feed
//! under the ceilings and limits of all the blocks it crosses; where a ceiling ahead forbids that, it begins
//! at the next splice that allows it. A stop drives a ramp that brakes on to rest (`Item::driven_to_rest`).
//! It may keep the feed up to the end of a soft block, if it is nearer at rest then
//! (`Lookahead::nearest_rest`). After a stop or an override the rest of the stretch is planned anew; an
//! unchanged stretch is driven by the program's own plan.
//!
//! Modules in the order the data travels:
//!
//! - [`Source`]: where items come from, perhaps later;
//! - `reader`: reads them, enters path into its queue, and keeps what is ahead: `lookahead` the blocks and
//!   block ends, `program_feed` the program's own feed with a cursor to what is handed over next;
//! - `mode`: the commands;
//! - `choose`: the next list, a function of all that, with `brake` (braking over the blocks ahead), `replan`
//!   (a plan from a splice) and `places` (where the list under way may be left);
//! - `list`: a feed list as the background sees it, and `splice`, the places where lists begin and end;
//! - `timeline`: the list under way and the next; hands over, follows the tick, takes back;
//! - `control`: owns reader, mode and timeline; has `poll`.
//!
//! ```
//! use motion_kernel::exec::Executor;
//! use motion_kernel::law::{Limits, Pulse};
//! use motion_kernel::live::{Leads, LiveControl, State};
//! use motion_kernel::queue::{LiveStreams, PathRules};
//! use motion_kernel::straight::Straight;
//! use motion_kernel::units::Position;
//!
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let (start, end) = ([Position::ZERO], [Position::from_mm(100.0).expect("within a kilometre")]);
//! let program = Straight::new(start, end, Pulse::Plateau, limits, [40.0, 50.0], 0.0005).expect("a motion");
//! let mut streams = LiveStreams::<f32, 1, 64, 16>::new();
//! let (mut feeder, mut intake) = streams.split(rules, start);
//! let mut control = LiveControl::<f32, 1, _, _, 64>::new(program, Pulse::Plateau, 0.0005, Leads::NONE);
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

mod brake;
mod choose;
mod control;
#[cfg(test)]
mod given_up;
#[cfg(test)]
mod interrupted;
mod list;
mod lookahead;
mod mode;
mod places;
mod program_feed;
mod reader;
mod replan;
mod splice;
mod timeline;

pub use crate::program::Source;
pub use control::{LiveControl, State};
#[cfg(feature = "scope")]
pub(crate) use list::Item as ListItem;
pub use mode::{OVERRIDE_MAX, OVERRIDE_MIN};
pub use timeline::Leads;
