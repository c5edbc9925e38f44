//! Where a program switches outputs: motion rests, the background switches, the program goes on.
//!
//! Consumes a [`Source`]; produces its items up to the next [`Item::Switch`], then none until
//! [`Switching::switched`]. So the streams, the tick and live control know nothing of outputs: to them, the items
//! come late. Background.
//!
//! Once all items before the switch are done and the machine is at rest ([`State::Waiting`](crate::live::State) of
//! live control; with [`Supply`](super::Supply), [`Supply::is_waiting`](super::Supply::is_waiting) and a tick
//! that executed and ended idle after the last [`Supply::fill`](super::Supply::fill): one with the drives on and settled,
//! and without a fault), the background puts
//! [`Switching::due`] out and calls [`Switching::switched`]. The wait for the spindle is the program's next
//! item, a dwell. Under a hold, live control is not waiting, so nothing is switched before the resume.
//!
//! ```
//! use core::convert::Infallible;
//!
//! use motion_kernel::exec::{ExecState, Executor};
//! use motion_kernel::hal::{OutputState, Spindle};
//! use motion_kernel::law::Ticks;
//! use motion_kernel::program::{Item, Supply, Switching};
//! use motion_kernel::queue::{PathRules, Streams};
//! use motion_kernel::units::Position;
//!
//! // A dwell, the spindle on, and another dwell until it turns.
//! let dwell = Item::<1>::Dwell(Ticks::from_seconds(0.001, 0.0005).expect("some ticks"));
//! let on = OutputState { spindle: Spindle::Clockwise, speed_rpm: 12_000.0, ..OutputState::OFF };
//! let items = [dwell, Item::Switch(on), dwell].map(Ok::<_, Infallible>);
//! # let limits = motion_kernel::law::Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 18, 10>::new();
//! let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
//! let mut supply = Supply::new(Switching::new(items.into_iter()), 0.0005);
//! let mut executor = Executor::new([Position::ZERO]);
//! let mut put_out = Vec::new();
//! for tick in 0..6 {
//!     supply.fill(&mut feeder).expect("items that can be executed");
//!     let state = executor.tick(&mut intake).expect("no fault").state;
//!     if supply.is_waiting() && state == ExecState::Idle && let Some(due) = supply.source_mut().due() {
//!         put_out.push((tick, due));
//!         supply.source_mut().switched();
//!     }
//! }
//! assert_eq!(put_out, [(1, on)]);
//! assert!(supply.is_empty());
//! ```

use core::task::Poll;

use super::{Item, Source};
use crate::hal::OutputState;

/// A source that ends for now where outputs are to be switched.
#[derive(Clone, Copy, Debug)]
pub struct Switching<I> {
    items: I,
    due: Option<OutputState>,
}

impl<I> Switching<I> {
    /// `items`, with nothing to switch yet.
    pub const fn new(items: I) -> Self {
        Self { items, due: None }
    }

    /// What is to be put out as soon as everything before is done.
    pub fn due(&self) -> Option<OutputState> {
        self.due
    }

    /// It is put out: goes on with the items behind it.
    pub fn switched(&mut self) {
        self.due = None;
    }

    /// The items.
    pub fn items_mut(&mut self) -> &mut I {
        &mut self.items
    }
}

impl<const AXES: usize, I: Source<AXES>> Source<AXES> for Switching<I> {
    type Error = I::Error;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, I::Error>>> {
        if self.due.is_some() {
            return Poll::Pending;
        }
        match self.items.poll_next() {
            Poll::Ready(Some(Ok(Item::Switch(to)))) => {
                self.due = Some(to);
                Poll::Pending
            }
            polled => polled,
        }
    }
}

/// The items for [`check`](super::check()) on a board that has the outputs: to it, a switch is a stop, which may
/// only be between stretches.
pub fn switches_as_stops<const AXES: usize, E>(
    items: impl Iterator<Item = Result<Item<AXES>, E>>,
) -> impl Iterator<Item = Result<Item<AXES>, E>> {
    items.map(|item| match item {
        Ok(Item::Switch(_)) => Ok(Item::Stop),
        item => item,
    })
}
