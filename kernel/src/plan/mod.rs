//! The feed plan (S3): how fast each block may be, and how to get there.
//!
//! Consumes blocks of path; produces feed segments. Works on slices, allocates nothing, runs in the
//! background, on the host for a whole stretch or on the board for what is queued. Unchanged input
//! gives the same bits.
//!
//! - [`ceiling`]: stage 1, the feed that a block's geometry and the machine allow, with the reason,
//!   and how much acceleration, jerk and snap are left for changing the feed on a curve;
//! - [`mod@junction`]: what a junction between two blocks allows;
//! - [`lookahead`]: stages 1 and 2 over the stretch: what can be reached, and from what one can brake;
//! - [`spanning`]: ramps that begin and end between junctions and may span many blocks;
//! - [`window`]: the same with a bounded window, blocks appended as they come;
//! - [`feed`]: the planned blocks as feed segments over exact path positions.

pub mod ceiling;
pub mod feed;
pub mod junction;
pub mod lookahead;
pub mod spanning;
pub mod window;

pub use ceiling::{
    AxisLimits, BLEND_FEED_SHARE, Bend, CURVE_FEED_SHARE, CURVE_FEED_SHARE_MAX, Ceiling, MachineLimits,
    Reason,
};
pub use feed::segments;
pub use junction::{Junction, junction};
pub use lookahead::{Block, BlockPlan, PlanError, merge_equal, plan};
pub use spanning::{FeedSpan, Node, nodes_for, plan_spanning};
pub use window::{Window, WindowError};
