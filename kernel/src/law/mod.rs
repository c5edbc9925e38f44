//! The sin² jerk feed law (S1): how the feed changes from one value to another.
//!
//! A change of feed is a pulse of jerk, a hold at constant acceleration, and the pulse reversed. S1's pulse
//! is one sin² arch ([`Pulse::Sin2`]). Where snap allows shorter edges than that, a pulse with a plateau
//! between two half arches is faster ([`Pulse::Plateau`]); S1 is the case without a plateau.
//!
//! In the order it is used:
//!
//! - `limits`: acceleration, jerk and snap limits, and which of them fixes a ramp: S1 (22) and (23);
//! - `shape`: an arch in normalised time, the same for every ramp, evaluated in the tick;
//! - `pulse`: one pulse of jerk, of two edges and a plateau;
//! - `ramp`: one change of feed;
//! - `passing`: bounds on where a ramp passes a feed, for the planner;
//! - `reach`: the inverse problems, background only: highest feed reachable in a length, and
//!   highest peak between two feeds;
//! - `planned`: a ramp or a cruise over an exact length of path, as plans hand it on;
//! - `segment`: the same made ready for the tick, with no division left to do.
//!
//! Feeds are magnitudes along the path and never negative. All functions here are pure.
//!
//! ```
//! use motion_kernel::law::{Law, Limits, Pulse, Ramp};
//!
//! let law = Law::new(Pulse::Plateau, Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 })?;
//! let ramp = Ramp::new(&law, 10.0_f64, 50.0);
//! // Symmetrical, so its mean feed is that of its ends.
//! assert!((ramp.length_mm() - 30.0 * ramp.duration_s()).abs() < 1e-9);
//! assert!(ramp.peak_accel_mm_s2() <= 500.0 * (1.0 + f64::EPSILON));
//! let middle = ramp.at(0.5 * ramp.duration_s());
//! assert!((middle.v_mm_s - 30.0).abs() < 1e-9);
//! # Ok::<(), motion_kernel::law::LimitError>(())
//! ```

mod limits;
pub(crate) mod passing;
mod planned;
mod pulse;
mod ramp;
pub(crate) mod reach;
pub(crate) mod segment;
pub(crate) mod shape;

pub use limits::{Law, LimitError, Limits, Pulse};
pub use planned::PlannedRamp;
pub use ramp::{FeedState, LimitedBy, Ramp};
pub(crate) use reach::peak;
pub use reach::reach;
#[cfg(feature = "live")]
pub(crate) use segment::CutRamp;
pub(crate) use segment::Phase;
pub use segment::{FeedSegment, PathMotion, SegmentError, Ticks};
