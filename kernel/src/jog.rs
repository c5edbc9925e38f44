//! Jog: moves one axis by an increment or to the soft limit.
//!
//! Consumes the machine's position, an axis and a feed; produces the items of a program of one straight
//! stretch, which [`LiveControl`](crate::live::LiveControl) drives like any other. So a jog is jerk-limited,
//! and stops exactly at the increment's end or at the soft limit, by construction. Releasing the key is
//! [`LiveControl::abort`](crate::live::LiveControl::abort), another feed
//! [`LiveControl::set_override`](crate::live::LiveControl::set_override), both at any tick. The rest is then
//! dropped, and the next jog begins where the axis stands
//! ([`Kernel::rest_here`](crate::kernel::Kernel::rest_here)).
//!
//! Background; one item at a time, no memory for the path. A bad request is a [`JogError`], and nothing
//! moves.
//!
//! ```
//! use motion_kernel::exec::Executor;
//! use motion_kernel::jog::{Direction, Jog, JogAxis, Travel, JogTarget};
//! use motion_kernel::law::{Limits, Pulse};
//! use motion_kernel::live::{Leads, LiveControl, State};
//! use motion_kernel::queue::{LiveStreams, PathRules};
//! use motion_kernel::units::Position;
//!
//! let at = |mm| Position::from_mm(mm).unwrap();
//! let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
//! let rules = PathRules { limits, feed_mm_s: 100.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let travel = Some(Travel { least: at(-200.0), greatest: at(300.0) });
//! let axis = JogAxis { feed_mm_s: 100.0, limits, pulse: Pulse::Plateau, travel };
//! let tick_s = 0.0005;
//!
//! // A key of the first of two axes is pressed, and released after 400 ticks.
//! let start = [at(0.0), at(5.0)];
//! let jog = Jog::new(&axis, 0, start, JogTarget::Continuous(Direction::Positive), 20.0, tick_s).unwrap();
//! let mut streams = LiveStreams::<f32, 2, 32, 16>::new();
//! let (mut feeder, mut intake) = streams.split(rules, start);
//! let mut control = LiveControl::<f32, 2, _, _, 64>::new(jog, Pulse::Plateau, tick_s, Leads::NONE);
//! let mut executor = Executor::new(start);
//! let mut rest = start;
//! for tick in 0.. {
//!     if tick == 400 {
//!         control.abort();
//!     }
//!     control.poll(&mut feeder).unwrap();
//!     rest = executor.tick(&mut intake).unwrap().setpoints.map(|axis| axis.position);
//!     if control.state(&feeder) == State::Aborted {
//!         break;
//!     }
//! }
//! assert!(rest[0] > start[0] && rest[1] == start[1]);
//! // The next jog begins at `rest`: the streams are split anew for it.
//! ```

use core::convert::Infallible;

use serde::{Deserialize, Serialize};

use crate::law::{Limits, Pulse};
use crate::program::Item;
use crate::straight::{Straight, StraightError};
use crate::units::Position;

/// A direction along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// To greater positions.
    Positive,
    /// To lesser positions.
    Negative,
}

impl Direction {
    /// The opposite direction.
    #[must_use]
    pub(crate) fn reversed(self) -> Self {
        match self {
            Self::Positive => Self::Negative,
            Self::Negative => Self::Positive,
        }
    }

    fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }

    /// The position `length` ahead of `from`.
    fn ahead(self, from: Position, length: Position) -> Position {
        match self {
            Self::Positive => from + length,
            Self::Negative => from - length,
        }
    }

    /// How far `to` is ahead of `from`; negative if it lies behind it.
    fn distance(self, from: Position, to: Position) -> Position {
        match self {
            Self::Positive => to - from,
            Self::Negative => from - to,
        }
    }
}

/// The soft limits of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Travel {
    /// Least position.
    pub least: Position,
    /// Greatest position, above the least.
    pub greatest: Position,
}

/// The limits of an axis in a jog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogAxis {
    /// Greatest feed \[mm/s\], of the jog and under any override; above 0, at most the queue's
    /// ([`PathRules`](crate::queue::PathRules)).
    pub feed_mm_s: f64,
    /// Limits of its ramps; at most the queue's.
    pub limits: Limits<f64>,
    /// The shape of their pulses of jerk.
    pub pulse: Pulse,
    /// Its soft limits; `None` as long as the axis does not know where it is.
    pub travel: Option<Travel>,
}

/// How far a jog goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JogTarget {
    /// As far as the soft limit, or until it is aborted.
    Continuous(Direction),
    /// By a signed distance, not 0; at most to the soft limit ([`Jog::ends_at_limit`]).
    By(Position),
}

/// Why a jog is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum JogError {
    /// There is no such axis.
    Axis {
        /// The axis, from 0.
        axis: usize,
        /// Number of axes.
        axes: usize,
    },
    /// The soft limits are in the wrong order.
    Travel(Travel),
    /// The distance is 0.
    NoDistance,
    /// A continuous jog would have no end: the axis has no soft limits.
    NoTravel,
    /// The axis stands at the soft limit or beyond it: it may only move inwards.
    AtLimit {
        /// Where it stands.
        position: Position,
        /// The soft limit.
        limit: Position,
    },
    /// The end is beyond what positions hold \[mm\].
    End {
        /// The end.
        end_mm: f64,
    },
    /// There is no straight stretch for it.
    Straight(StraightError),
}

impl core::fmt::Display for JogError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Axis { axis, axes } => write!(f, "axis {axis}: expected one of {axes}, from 0"),
            Self::Travel(Travel { least, greatest }) => {
                let (least_mm, greatest_mm) = (least.to_mm(), greatest.to_mm());
                write!(f, "soft limits {least_mm} and {greatest_mm} mm: expected the lesser one first")
            }
            Self::NoDistance => f.write_str("a distance of 0: expected a distance to go"),
            Self::NoTravel => {
                f.write_str("a jog without an end: expected soft limits, which the axis does not know yet")
            }
            Self::AtLimit { position, limit } => {
                let (position_mm, limit_mm) = (position.to_mm(), limit.to_mm());
                write!(
                    f,
                    "at {position_mm} mm outwards: expected inwards only from the soft limit {limit_mm} mm"
                )
            }
            Self::End { end_mm } => {
                write!(f, "an end at {end_mm} mm: expected within {} mm", Position::LIMIT_MM)
            }
            Self::Straight(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for JogError {}

/// The items of a jog.
#[derive(Clone, Debug)]
pub struct Jog<const AXES: usize> {
    motion: Straight<AXES>,
    ends_at_limit: bool,
}

impl<const AXES: usize> Jog<AXES> {
    /// A jog of `axis` from rest at `start`, at `feed_mm_s`, for ticks of `tick_s`.
    ///
    /// # Errors
    /// The request is refused. Once a jog is made, nothing else fails, in a number type that holds its
    /// limits.
    pub fn new(
        config: &JogAxis,
        axis: usize,
        start: [Position; AXES],
        target: JogTarget,
        feed_mm_s: f64,
        tick_s: f64,
    ) -> Result<Self, JogError> {
        let &JogAxis { feed_mm_s: most_mm_s, limits, pulse, travel } = config;
        let &from = start.get(axis).ok_or(JogError::Axis { axis, axes: AXES })?;
        let (direction, wanted) = match target {
            JogTarget::Continuous(direction) => (direction, None),
            JogTarget::By(by) if by > Position::ZERO => (Direction::Positive, Some(by)),
            JogTarget::By(by) if by < Position::ZERO => (Direction::Negative, Some(-by)),
            JogTarget::By(_) => return Err(JogError::NoDistance),
        };
        let room = travel.map(|travel| room(from, direction, travel)).transpose()?;
        let length = match (wanted, room) {
            (None, None) => return Err(JogError::NoTravel),
            (Some(length), None) | (None, Some(length)) => length,
            (Some(wanted), Some(room)) => wanted.min(room),
        };
        let end_mm = from.to_mm() + direction.sign() * length.to_mm();
        let ahead = direction.ahead(from, length);
        if !ahead.is_within_limit() || libm::fabs(end_mm) > Position::LIMIT_MM {
            return Err(JogError::End { end_mm });
        }
        let mut end = start;
        if let Some(end) = end.get_mut(axis) {
            *end = ahead;
        }
        let motion = Straight::new(start, end, pulse, limits, [feed_mm_s, most_mm_s], tick_s)
            .map_err(JogError::Straight)?;
        Ok(Self { motion, ends_at_limit: room == Some(length) })
    }

    /// Where it ends if it is not aborted.
    #[doc(hidden)]
    #[must_use]
    pub fn end(&self) -> [Position; AXES] {
        self.motion.end()
    }

    /// Whether it ends at the soft limit.
    #[must_use]
    pub fn ends_at_limit(&self) -> bool {
        self.ends_at_limit
    }
}

/// How far it is from `from` to the soft limit ahead.
fn room(from: Position, direction: Direction, travel: Travel) -> Result<Position, JogError> {
    let Travel { least, greatest } = travel;
    if least >= greatest {
        return Err(JogError::Travel(travel));
    }
    let limit = match direction {
        Direction::Positive => greatest,
        Direction::Negative => least,
    };
    let room = direction.distance(from, limit);
    if room > Position::ZERO { Ok(room) } else { Err(JogError::AtLimit { position: from, limit }) }
}

impl<const AXES: usize> Iterator for Jog<AXES> {
    type Item = Result<Item<AXES>, Infallible>;

    fn next(&mut self) -> Option<Self::Item> {
        self.motion.next()
    }
}
