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
//! Consumes [`Item`](crate::program::Item)s and commands; produces pieces and **feed lists**, each a complete motion that
//! ends at rest on path that is queued. All of it runs in the background: the tick only changes from one list to the
//! next where it was told to (see [`Change`](crate::queue::Change)). So motion is legal whatever the background does and
//! however long it takes, and where it takes too long, the list under way ends in a stop on the path.
//!
//! A command is a list that begins at the next **splice**, a place where the feed does not change: anywhere in a
//! cruise; a little later in a ramp that accelerates, which is cut in the shortest way (`Item::cut`), or for an override
//! where it gets to the feed that this allows (`Item::cut_to`); at the end of a ramp that brakes, because ceilings ahead
//! may need all of it. From there on it brakes to rest or to another feed under the ceilings and limits of all the blocks
//! it crosses; where a ceiling ahead does not let it begin, at the next splice that does. What follows a stop or an override
//! is planned anew, to the end of the stretch; a stretch in which nothing was changed is driven by the program's own plan.
//!
//! In the order in which data travel:
//!
//! - [`Source`]: where items come from, perhaps later;
//! - `reader`: reads them; enters path into its queue, and keeps what is ahead:
//!   `lookahead` the blocks and block ends, `program_feed` the program's own feed with a cursor to what is handed over next;
//! - `mode`: what was commanded;
//! - `choose`: what comes next, a function of all that, with `brake` (how to brake on the blocks ahead), `replan` (a plan
//!   from a splice on) and `places` (where the list under way may be left);
//! - `list`: a feed list as the background sees it, and `splice`, the places on the path that it leads to;
//! - `timeline`: the list under way and the next; hands over, follows the tick, takes back;
//! - [`control`]: the three that own all this, and `poll`.

mod brake;
mod choose;
pub mod control;
#[cfg(test)]
mod interrupted;
mod list;
mod lookahead;
mod mode;
mod places;
mod program_feed;
mod reader;
mod replan;
mod source;
mod splice;
mod timeline;

pub use control::{LiveControl, State};
pub use list::LIST_ITEMS;
pub use mode::{OVERRIDE_MAX, OVERRIDE_MIN};
pub use source::Source;
