//! What may follow what in the streams.
//!
//! Every check costs the producer a few operations and spares the tick from ever meeting an item it
//! could not execute. Each method goes on to the state after the item; a copy does, where the item may find
//! its queue full, and an item that is rejected leaves a state of no further use.

use serde::{Deserialize, Serialize};

use crate::law::{FeedSegment, Limits, Ticks};
use crate::num::{Real, Scalar, is_within, rolled};
#[cfg(feature = "guards")]
use crate::path::Travel;
use crate::path::{Piece, Steepness, magnitude};
use crate::units::Position;

/// How many segments or dwells may end within one tick. Denser ones are rejected when they are offered.
pub const SEGMENTS_PER_TICK_MAX: usize = 8;

/// What the streams are held to. Immutable; the machine's configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathRules {
    /// Limits along the path.
    pub limits: Limits<f64>,
    /// Greatest feed \[mm/s\].
    pub feed_mm_s: f64,
    /// Greatest angle between the tangents of neighbouring pieces of one stretch \[rad\].
    pub junction_angle_rad: f64,
    /// Greatest gap between the end of a piece and the start of the next \[mm\].
    pub junction_gap_mm: f64,
}

/// Why an item may not enter. Each names the quantity and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Rejection {
    /// A piece does not start where its predecessor ends.
    Gap {
        /// The axis, from 0.
        axis: usize,
        /// The gap \[mm\].
        gap_mm: f64,
    },
    /// A piece does not go on in the direction in which its predecessor ends.
    Corner {
        /// The angle between the tangents \[rad\].
        angle_rad: f64,
    },
    /// A segment does not start at the feed at which its predecessor ends.
    FeedStep {
        /// The predecessor's \[mm/s\].
        from_mm_s: f64,
        /// The segment's \[mm/s\].
        to_mm_s: f64,
    },
    /// A segment exceeds a limit, or on its piece of path asks an axis for more than the number type holds.
    Limit {
        /// Which one, with its unit.
        quantity: &'static str,
        /// The segment's value, or an axis' where piece and segment meet.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// More segments or dwells than the executor handles would end within one tick.
    Dense {
        /// How long this segment and its predecessors, as many as the executor handles in a tick,
        /// take together \[ticks\]; at least 1 is needed.
        ticks: f64,
    },
    /// A stretch would end before it is at rest.
    Moving {
        /// The feed \[mm/s\].
        feed_mm_s: f64,
    },
    /// The two streams have measured different lengths of the same stretch.
    Lengths {
        /// The pieces' \[mm\].
        path_mm: f64,
        /// The segments' \[mm\].
        feed_mm: f64,
    },
    /// A piece leaves the travel of an axis.
    Travel {
        /// The axis, from 0.
        axis: usize,
        /// Where it is beyond \[mm\].
        mm: f64,
    },
    /// A stretch without any length.
    Empty,
    /// Dwells and stops belong between stretches.
    InsideStretch,
    /// The blocks of a stretch are longer or shorter than its path.
    #[cfg(feature = "live")]
    Blocks {
        /// The blocks' \[mm\].
        blocks_mm: f64,
        /// The pieces' \[mm\].
        path_mm: f64,
    },
    /// Path that no block says the feed of: live control could not brake on it.
    NoBlock,
    /// More is to be kept than there are places for, where room had been left: an error of live control, not of the program.
    #[cfg(feature = "live")]
    Full {
        /// Of which there are too many.
        what: &'static str,
        /// As many as there are places for.
        places: usize,
    },
    /// A change to or from a feed list that is not the one it may be: to the one that was filled last, from another,
    /// after fewer items than that word holds.
    #[cfg(feature = "live")]
    NoChange {
        /// The list under way.
        from: u8,
        /// The list asked for.
        to: u8,
        /// Items of `from` that are driven before.
        after: u32,
    },
    /// The stretch is longer, or a position farther out, than the kernel's range.
    Range {
        /// The length or coordinate \[mm\].
        mm: f64,
    },
}

#[cfg(feature = "live")]
impl Rejection {
    /// There are no more than `places` for `what`.
    #[cold]
    pub(crate) fn full(what: &'static str, places: usize) -> Self {
        Self::Full { what, places }
    }
}

impl core::fmt::Display for Rejection {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Gap { axis, gap_mm } => write!(f, "gap of {gap_mm} mm to the predecessor on axis {axis}"),
            Self::Corner { angle_rad } => write!(f, "corner of {angle_rad} rad inside a stretch"),
            Self::FeedStep { from_mm_s, to_mm_s } => {
                write!(f, "feed steps from {from_mm_s} to {to_mm_s} mm/s")
            }
            Self::Limit { quantity, value, limit } => write!(f, "{quantity} {value} exceeds {limit}"),
            Self::Dense { ticks } => {
                write!(f, "{SEGMENTS_PER_TICK_MAX} segments in {ticks} ticks: expected at least 1")
            }
            Self::Moving { feed_mm_s } => write!(f, "stretch ends at {feed_mm_s} mm/s: expected rest"),
            Self::Lengths { path_mm, feed_mm } => {
                write!(f, "{path_mm} mm of path, {feed_mm} mm of feed: expected equal lengths")
            }
            Self::Travel { axis, mm } => write!(f, "position {mm} mm of axis {axis}: expected its travel"),
            Self::Empty => write!(f, "a stretch without any length"),
            #[cfg(feature = "live")]
            Self::Full { what, places } => write!(f, "more {what} than the {places} that there is room for"),
            #[cfg(feature = "live")]
            Self::Blocks { blocks_mm, path_mm } => {
                write!(f, "{blocks_mm} mm of blocks, {path_mm} mm of path: expected equal lengths")
            }
            Self::NoBlock => write!(f, "path without a block, expected one that says what holds its feed"),
            #[cfg(feature = "live")]
            Self::NoChange { from, to, after } => {
                write!(
                    f,
                    "change to list {to} after {after} items of list {from}: expected the one filled last"
                )
            }
            Self::InsideStretch => write!(f, "dwell or stop inside a stretch"),
            Self::Range { mm } => write!(f, "{mm} mm: expected at most ±{} mm", Position::LIMIT_MM),
        }
    }
}

impl core::error::Error for Rejection {}

/// How close segments and dwells follow each other.
#[derive(Clone, Copy, Debug)]
pub struct Density {
    /// Durations of the latest, the newest first.
    recent: [Ticks; SEGMENTS_PER_TICK_MAX],
}

impl Density {
    /// After a rest.
    pub const NONE: Self = Self { recent: [Ticks::ONE; SEGMENTS_PER_TICK_MAX] };

    /// One more, that takes `newest`.
    ///
    /// # Errors
    /// The executor can't keep up with it and those before it.
    #[inline(never)]
    pub fn follow(&mut self, newest: Ticks) -> Result<(), Rejection> {
        let (mut next, mut together) = (newest, Ticks::ZERO);
        for place in rolled(self.recent.as_mut_slice()) {
            together = rolled(together.plus(next));
            core::mem::swap(place, &mut next);
        }
        if together < Ticks::ONE {
            return Err(Rejection::Dense { ticks: together.to_f64() });
        }
        Ok(())
    }
}

/// Where the streams stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Acceptance<R: Real, const AXES: usize> {
    rules: PathRules,
    position: [Position; AXES],
    /// Of the last piece of this stretch.
    tangent: Option<[R; AXES]>,
    path_length: Position,
    feed_length: Position,
    feed_mm_s: R,
    density: Density,
    /// Of what one stream has beyond the other's end: the steepest of its curves and where the last of them ends, the
    /// greatest feed. A fast ramp may follow a sharp curve, but must not be on it.
    steepness: Steepness,
    curved_until: Position,
    ahead_mm_s: f64,
    #[cfg(feature = "guards")]
    travel: Travel<AXES>,
}

impl<R: Real, const AXES: usize> Acceptance<R, AXES> {
    pub(crate) fn new(rules: PathRules, position: [Position; AXES]) -> Self {
        Self {
            rules,
            position,
            tangent: None,
            path_length: Position::ZERO,
            feed_length: Position::ZERO,
            feed_mm_s: R::ZERO,
            density: Density::NONE,
            steepness: Steepness::STRAIGHT,
            curved_until: Position::ZERO,
            ahead_mm_s: 0.0,
            #[cfg(feature = "guards")]
            travel: [None; AXES],
        }
    }

    #[cfg(feature = "guards")]
    pub(crate) fn bound(&mut self, travel: Travel<AXES>) {
        self.travel = travel;
    }

    /// Between stretches, at `position`.
    fn restarted(&self, position: [Position; AXES]) -> Self {
        Self {
            #[cfg(feature = "guards")]
            travel: self.travel,
            ..Self::new(self.rules, position)
        }
    }

    pub(crate) fn piece(&mut self, piece: &Piece<R, AXES>) -> Result<(), Rejection> {
        self.continuous(&piece.start())?;
        if let Some(before) = self.tangent {
            let after = piece.tangent_at(R::ZERO);
            let mut chord = after.map(Scalar::to_f64);
            for (after, before) in chord.iter_mut().zip(before) {
                *after -= before.to_f64();
            }
            // The chord between unit vectors is below the angle by a part in 24·angle².
            let angle_rad = magnitude(&chord);
            let rounding = 4.0 * R::EPSILON;
            if !(angle_rad <= self.rules.junction_angle_rad + rounding) {
                return Err(Rejection::Corner { angle_rad });
            }
        }
        #[cfg(feature = "guards")]
        if let Some((axis, mm)) = piece.beyond(&self.travel) {
            return Err(Rejection::Travel { axis, mm });
        }
        let end = piece.end();
        for position in rolled(end.as_slice()) {
            within_range(*position)?;
        }
        let path_length = self.path_length + piece.length();
        within_range(path_length)?;
        if R::SETPOINT_MAX.is_some() {
            let steepness = piece.steepness();
            if self.path_length < self.feed_length {
                self.fits(&steepness, self.ahead_mm_s)?;
            }
            if steepness != Steepness::STRAIGHT {
                let was_ahead = self.curved_until > self.feed_length;
                self.steepness = if was_ahead { self.steepness.max(&steepness) } else { steepness };
                self.curved_until = path_length;
            }
        }
        self.position = end;
        self.tangent = Some(piece.tangent_at(piece.length().to_offset()));
        self.path_length = path_length;
        Ok(())
    }

    pub(crate) fn segment(&mut self, segment: &FeedSegment<R>) -> Result<(), Rejection> {
        let ramp = segment.as_ramp();
        let step = (ramp.from_mm_s - self.feed_mm_s).abs();
        if !(step <= R::from_f64(4.0 * R::EPSILON) * self.feed_mm_s) {
            return Err(Rejection::FeedStep {
                from_mm_s: self.feed_mm_s.to_f64(),
                to_mm_s: ramp.from_mm_s.to_f64(),
            });
        }
        let limits = &self.rules.limits;
        let quantities = ["feed [mm/s]", "acceleration [mm/s²]", "jerk [mm/s³]", "snap [mm/s⁴]"];
        let feed_mm_s = ramp.from_mm_s.max(ramp.to_mm_s);
        let values = [feed_mm_s, segment.peak_accel_mm_s2(), ramp.peak_jerk_mm_s3, segment.peak_snap_mm_s4()];
        let most = [self.rules.feed_mm_s, limits.accel_mm_s2, limits.jerk_mm_s3, limits.snap_mm_s4];
        let (quantities, values, most) = rolled((quantities.as_slice(), values.as_slice(), most.as_slice()));
        for ((&quantity, value), &limit) in quantities.iter().zip(values).zip(most) {
            let value = rolled(value).to_f64();
            if !is_within(value, 0.0, limit * (1.0 + 8.0 * R::EPSILON)) {
                return Err(Rejection::Limit { quantity, value, limit });
            }
        }
        self.density.follow(segment.duration())?;
        let feed_length = self.feed_length + segment.length();
        within_range(feed_length)?;
        if R::SETPOINT_MAX.is_some() {
            let v_mm_s = ramp.from_mm_s.max(ramp.to_mm_s).to_f64();
            let is_on_curve = self.feed_length < self.curved_until;
            self.fits(if is_on_curve { &self.steepness } else { &Steepness::STRAIGHT }, v_mm_s)?;
            let was_ahead = self.feed_length > self.path_length;
            self.ahead_mm_s = if was_ahead { f64::max(self.ahead_mm_s, v_mm_s) } else { v_mm_s };
        }
        self.feed_mm_s = ramp.to_mm_s;
        self.feed_length = feed_length;
        Ok(())
    }

    /// Whether the number type holds what a feed of up to `v_mm_s` on a piece of this steepness asks of the axes,
    /// and what is computed on the way.
    fn fits(&self, steepness: &Steepness, v_mm_s: f64) -> Result<(), Rejection> {
        let Some(most) = R::SETPOINT_MAX else { return Ok(()) };
        let Limits { accel_mm_s2, jerk_mm_s3, .. } = self.rules.limits;
        let quantities = ["axis velocity [mm/s]", "axis acceleration [mm/s²]", "axis jerk [mm/s³]"];
        let values = steepness.setpoint_max(v_mm_s, accel_mm_s2, jerk_mm_s3);
        for ((quantity, value), limit) in quantities.into_iter().zip(values).zip(most) {
            if !(value <= limit) {
                return Err(Rejection::Limit { quantity, value, limit });
            }
        }
        Ok(())
    }

    /// For feed that goes on from here, at `feed_mm_s` and behind what `density` says, whatever was accepted before.
    #[cfg(feature = "live")]
    pub(crate) fn feed_from(&self, feed_length: Position, feed_mm_s: R, density: Density) -> Self {
        Self {
            feed_length,
            feed_mm_s,
            density,
            // What the curves ask for is checked where they enter.
            steepness: Steepness::STRAIGHT,
            curved_until: Position::ZERO,
            ..*self
        }
    }

    /// Whether the number type holds what a piece asks of the axes at up to `fastest_mm_s`.
    #[cfg(feature = "live")]
    pub(crate) fn fits_at(&self, piece: &Piece<R, AXES>, fastest_mm_s: f64) -> Result<(), Rejection> {
        if R::SETPOINT_MAX.is_some() { self.fits(&piece.steepness(), fastest_mm_s) } else { Ok(()) }
    }

    /// Behind the end of a stretch's feed.
    #[cfg(feature = "live")]
    pub(crate) fn feed_after_stretch(&self) -> Self {
        self.feed_from(Position::ZERO, R::ZERO, self.density)
    }

    #[cfg(feature = "live")]
    pub(crate) fn feed_dwell(&mut self, duration: Ticks) -> Result<(), Rejection> {
        self.feed_at_rest()?;
        self.density.follow(duration)
    }

    /// Whether the feed of a list is between stretches.
    #[cfg(feature = "live")]
    pub(crate) fn feed_at_rest(&self) -> Result<(), Rejection> {
        if self.feed_length > Position::ZERO { Err(Rejection::InsideStretch) } else { Ok(()) }
    }

    #[cfg(feature = "live")]
    pub(crate) fn feed_mm_s(&self) -> R {
        self.feed_mm_s
    }

    /// The end of the path of a stretch, whose feed is accepted in lists of its own.
    #[cfg(feature = "live")]
    pub(crate) fn end_of_path(&mut self, position: [Position; AXES]) -> Result<(), Rejection> {
        self.continuous(&position)?;
        if self.path_length == Position::ZERO {
            return Err(Rejection::Empty);
        }
        *self = self.restarted(position);
        Ok(())
    }

    pub(crate) fn end_of_stretch(&mut self, position: [Position; AXES]) -> Result<(), Rejection> {
        self.continuous(&position)?;
        if self.path_length == Position::ZERO {
            return Err(Rejection::Empty);
        }
        self.feed_ends(self.path_length)?;
        *self = Self { density: self.density, ..self.restarted(position) };
        Ok(())
    }

    /// Whether the feed has come to rest where its path, `path` long, ends.
    pub(crate) fn feed_ends(&self, path: Position) -> Result<(), Rejection> {
        if self.feed_mm_s > R::ZERO {
            return Err(Rejection::Moving { feed_mm_s: self.feed_mm_s.to_f64() });
        }
        if path != self.feed_length {
            let (path_mm, feed_mm) = (path.to_mm(), self.feed_length.to_mm());
            return Err(Rejection::Lengths { path_mm, feed_mm });
        }
        Ok(())
    }

    pub(crate) fn dwell(&mut self, duration: Ticks) -> Result<(), Rejection> {
        self.at_rest()?;
        self.density.follow(duration)
    }

    /// How the feed's length of this stretch compares with the path's.
    pub(crate) fn feed_ahead_of_path(&self) -> core::cmp::Ordering {
        self.feed_length.cmp(&self.path_length)
    }

    pub(crate) fn at_rest(&self) -> Result<(), Rejection> {
        if self.tangent.is_some() || self.feed_length > Position::ZERO {
            return Err(Rejection::InsideStretch);
        }
        Ok(())
    }

    fn continuous(&self, start: &[Position; AXES]) -> Result<(), Rejection> {
        let (here, start) = rolled((self.position.as_slice(), start.as_slice()));
        for (axis, (here, start)) in here.iter().zip(start).enumerate() {
            let gap_mm = (*start - *here).to_mm();
            if !(libm::fabs(gap_mm) <= self.rules.junction_gap_mm) {
                return Err(Rejection::Gap { axis, gap_mm });
            }
        }
        Ok(())
    }
}

fn within_range(position: Position) -> Result<(), Rejection> {
    if position.is_within_limit() { Ok(()) } else { Err(Rejection::Range { mm: position.to_mm() }) }
}
