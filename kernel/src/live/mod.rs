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
