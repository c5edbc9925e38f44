//! The sin² jerk feed law (S1): how the feed changes from one value to another.
//!
//! In the order it is used:
//!
//! - [`limits`]: acceleration, jerk and snap limits, and what follows from them once;
//! - [`shape`]: the law in normalised time, the same for every ramp, evaluated in the tick;
//! - [`ramp`]: one change of feed: choice of peak jerk and times, S1 (22) and (23);
//! - [`passing`]: about where a ramp passes a feed, for the planner;
//! - [`mod@reach`]: the inverse problems, background only: highest feed reachable in a length, and
//!   highest peak between two feeds;
//! - [`planned`]: a ramp or a cruise over an exact length of path, as plans hand it on;
//! - [`segment`]: the same made ready for the tick: no division is left to do.
//!
//! Feeds are magnitudes along the path and never negative. All the functions here are pure.

pub mod limits;
pub mod passing;
pub mod planned;
pub mod ramp;
pub mod reach;
pub mod segment;
pub mod shape;

pub use limits::{Law, LimitError, Limits};
pub use passing::Passing;
pub use planned::PlannedRamp;
pub use ramp::{FeedState, LimitedBy, Ramp};
pub use reach::{peak, reach};
#[cfg(feature = "live")]
pub use segment::CutRamp;
pub use segment::{FeedSegment, PathMotion, Phase, SegmentError, Ticks};
