//! The sin² jerk feed law (S1): how the feed changes from one value to another.
//!
//! In the order it is used:
//!
//! - `limits`: acceleration, jerk and snap limits, and the constants that follow from them;
//! - `shape`: the law in normalised time, the same for every ramp, evaluated in the tick;
//! - `ramp`: one change of feed: choice of peak jerk and times, S1 (22) and (23);
//! - `passing`: bounds on where a ramp passes a feed, for the planner;
//! - `reach`: the inverse problems, background only: highest feed reachable in a length, and
//!   highest peak between two feeds;
//! - `planned`: a ramp or a cruise over an exact length of path, as plans hand it on;
//! - `segment`: the same made ready for the tick, with no division left to do.
//!
//! Feeds are magnitudes along the path and never negative. All functions here are pure.
//!
//! ```
//! use motion_kernel::law::{Law, Limits, Ramp};
//!
//! let law = Law::new(Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 })?;
//! let ramp = Ramp::new(&law, 10.0_f64, 50.0);
//! // Symmetrical, so its mean feed is that of its ends.
//! assert!((ramp.length_mm() - 30.0 * ramp.duration_s()).abs() < 1e-9);
//! assert!(ramp.peak_accel_mm_s2() <= 500.0);
//! let middle = ramp.at(0.5 * ramp.duration_s());
//! assert!((middle.v_mm_s - 30.0).abs() < 1e-9);
//! # Ok::<(), motion_kernel::law::LimitError>(())
//! ```

mod limits;
pub(crate) mod passing;
mod planned;
mod ramp;
mod reach;
pub(crate) mod segment;
pub(crate) mod shape;

pub use limits::{Law, LimitError, Limits};
pub use planned::PlannedRamp;
pub use ramp::{FeedState, LimitedBy, Ramp};
pub use reach::{peak, reach};
#[cfg(feature = "live")]
pub(crate) use segment::CutRamp;
pub use segment::{FeedSegment, PathMotion, Phase, SegmentError, Ticks};
