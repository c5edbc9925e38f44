//! The feed plan (S3): how fast each block may be, and how to get there.
//!
//! Consumes blocks of path; produces ramps over exact lengths of it. Works on slices, allocates nothing, runs in the
//! background, on the host for a whole stretch or on the board for what is queued. Unchanged input
//! gives the same bits.
//!
//! - [`ceiling`]: stage 1, the feed that a block's geometry and the machine allow, with the reason,
//!   and how much acceleration, jerk and snap are left for changing the feed on a curve;
//! - [`mod@junction`]: what a junction between two blocks allows;
//! - [`two_pass`]: stages 1 and 2 over the stretch: what can be reached, and from what one can brake;
//! - [`mod@ramps`]: the pair of ramps of a planned block over exact path positions;
//! - `spanning`: ramps that begin and end between junctions and may span many blocks;
//! - [`planner`]: the entry for all callers: the faster of the two, in the caller's memory.

pub mod ceiling;
pub mod junction;
pub mod planner;
pub mod ramps;
mod spanning;
pub mod two_pass;

pub use ceiling::{
    AxisLimits, BLEND_FEED_SHARE, Bend, CURVE_FEED_SHARE, CURVE_FEED_SHARE_MAX, Ceiling, MachineLimits,
    Reason,
};
pub use junction::{Junction, junction};
pub use planner::{Effort, Memory, Path, Planned, plan_ramps};
pub use ramps::ramps;
pub use spanning::{Node, nodes_for, plan_spanning};
pub use two_pass::{Block, BlockPlan, PlanError, merge_equal, plan};
