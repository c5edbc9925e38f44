//! The feed plan (S3): how fast each block may be, and how to get there.
//!
//! Consumes blocks of path; produces ramps over exact lengths of it. Works on slices, allocates nothing, runs
//! in the background: on the host for a whole stretch, on the board for the queued path. The same input gives
//! the same bits.
//!
//! - `ceiling`: stage 1, the feed that a block's geometry and the machine allow, with the reason,
//!   and how much acceleration, jerk and snap are left for changing the feed on a curve;
//! - `junction`: the greatest feed through a junction of two blocks;
//! - `two_pass`: stages 1 and 2 over the stretch: the feeds that can be reached, and from which it can brake;
//! - `ramps`: the pair of ramps of a planned block over exact path positions;
//! - `spanning`: ramps that begin and end between junctions and may span many blocks;
//! - `planner`: the entry for all callers: the faster of the two, in the caller's memory;
//! - `attention`: what long plans are given up for.
//!
//! ```
//! use motion_kernel::plan::{Junction, junction};
//!
//! // A corner of 0.5° in a tick of 0.5 ms, where the acceleration may step by 200 mm/s².
//! let corner = Junction { angle_rad: 0.5_f64.to_radians(), curvature_step_per_mm: 0.0 };
//! let feed_mm_s = junction(&corner, 0.02, 200.0, 0.0005);
//! assert!((feed_mm_s * corner.angle_rad / 0.0005 - 200.0).abs() < 1e-6);
//! // Beyond the angle that may be passed the machine stops on the corner.
//! assert_eq!(junction(&Junction { angle_rad: 0.03, ..corner }, 0.02, 200.0, 0.0005), 0.0);
//! ```

mod attention;
mod ceiling;
mod junction;
mod planner;
mod ramps;
mod spanning;
pub(crate) mod two_pass;

pub use attention::Attention;
pub use ceiling::{
    AxisLimits, BLEND_FEED_SHARE, Bend, CURVE_FEED_SHARE, CURVE_FEED_SHARE_MAX, Ceiling, MachineLimits,
    Reason,
};
pub use junction::{Junction, junction};
pub use planner::{Effort, Memory, Path, Planned, plan_ramps, plan_ramps_unless};
pub use ramps::ramps;
pub use spanning::{Node, nodes_for, plan_spanning};
pub use two_pass::{Block, BlockPlan, PlanError, plan};
