//! Parts of the rooms that the project's own tests, benches and instruction counts look into. Programs
//! outside of it need none of them, and they may change at any time: there is no promise of stability. The same
//! holds for methods of public types that the documentation hides: besides the crate itself only those tests, benches
//! and counts call them.

pub use crate::axis::feedforward::{FeedforwardConfig, FeedforwardState};
#[cfg(feature = "live")]
pub use crate::law::segment::CutRamp;
pub use crate::law::{passing::Passing, reach::peak, segment::Phase, shape::Shape};
#[cfg(feature = "micromath")]
pub use crate::num::sine::Micromath;
pub use crate::num::sine::{Libm, Own, SineCosine};
pub use crate::plan::two_pass::merge_equal;
pub use crate::program::supply::Ready;
#[cfg(feature = "live")]
pub use crate::queue::change::{Change, Progress};
pub use crate::queue::density::Density;
pub use crate::queue::item::FeedItem;
#[cfg(all(feature = "live", feature = "watch"))]
pub use crate::queue::watch::Access;
pub use crate::work::{add as add_work, work_done};
