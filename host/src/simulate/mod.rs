//! A plan executed by the kernel on the simulated machine, tick by tick.
//!
//! Consumes a [`Plan`](crate::planning::Plan) and a [`Machine`](crate::machine::Machine), as a [`Job`];
//! produces one [`TraceRow`] per tick and a [`RunSummary`]. A machine has `N` places, of which the first have
//! axes; the kernel runs the others, too, and no record shows them. The kernel, the streams, the converter's adapter
//! and the encoder's count extension are the ones a board runs; only the drive is a model.
//!
//! - [`error`]: why a run could not be made;
//! - [`job`]: what is executed, and what its records call it by;
//! - `letter`: axes in records;
//! - [`faults`]: names and table of faults;
//! - [`inject`]: what breaks before given ticks;
//! - [`live`]: commands before given ticks;
//! - `background`: what fills the streams, with commands or without;
//! - [`hardware`]: the simulated machine as the kernel's hardware;
//! - `converters`: its velocity outputs;
//! - `commands`: what became of them;
//! - `contour`: how far the machine is off its path;
//! - `switches`: spindle and coolant;
//! - `limit_share`: on how much of the path a limit is active;
//! - [`run`](mod@run): the ticks;
//! - [`probing`]: the probe, and where it trips;
//! - [`summary`]: maxima, following and contour error;
//! - [`session`]: one motion after the other, without a plan;
//! - [`home`]: axes find their references;
//! - [`jog`]: keys pressed and released.

mod background;
mod commands;
mod letter;
pub(crate) mod contour;
pub mod error;
pub mod job;
pub mod faults;
pub mod inject;
mod kinks;
mod limit_share;
pub mod live;
mod converters;
pub mod hardware;
mod switches;
pub mod run;
pub mod summary;
pub mod probing;
pub mod session;
pub mod home;
pub mod jog;

pub use error::RunError;
pub use hardware::Hardware;
pub use job::{Job, Number, RunInfo, RunOptions, SheetAxis, StretchCorrection};
pub use probing::Probed;
pub use run::{on_simulated, run, run_on, run_with};
pub use summary::{AxisSummary, RunSummary};

use crate::trace::TraceRow;

/// Called with every tick.
pub type Observer<'a, const N: usize = 3> = dyn FnMut(&TraceRow<N>) + 'a;
