//! Which item may follow which in the streams.
//!
//! Every check costs the producer a few operations and spares the tick from ever meeting an item it could not
//! execute. Each method moves to the state after the item. Where the queue may be full, call it on a copy; a
//! rejected item leaves a state that must be discarded.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::density::Density;
use super::rejection::Rejection;
use crate::law::{FeedSegment, Limits, Ticks};
use crate::num::{Real, Scalar, is_within, rolled};
use crate::path::{Piece, Steepness, magnitude};
use crate::units::Position;

/// The limits that every item is checked against. Immutable; part of the machine's configuration.
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

/// Where the streams stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Acceptance<R: Real, const AXES: usize> {
    rules: PathRules,
    position: [Position; AXES],
    /// The tangent at the end of the stretch's last piece.
    tangent: Option<[R; AXES]>,
    path_length: Position,
    feed_length: Position,
    feed_mm_s: R,
    density: Density,
    /// For the part of a stream beyond the other's end: the steepest curve, where the last curve ends, and
    /// the greatest feed. A fast ramp may follow a sharp curve, but must not be on it.
    steepness: Steepness,
    curved_until: Position,
    ahead_mm_s: f64,
    bounds: Bounds<AXES>,
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
            bounds: Bounds::NONE,
        }
    }

    pub(super) fn bound(&mut self, bounds: Bounds<AXES>) {
        self.bounds = bounds;
    }

    /// Between stretches, at `position`.
    pub(super) fn restarted(&self, position: [Position; AXES]) -> Self {
        Self { bounds: self.bounds, ..Self::new(self.rules, position) }
    }

    pub(crate) fn piece(&mut self, piece: &Piece<R, AXES>) -> Result<(), Rejection> {
        self.continuous(&piece.start())?;
        if let Some(before) = self.tangent {
            let after = piece.tangent_at(R::ZERO);
            let mut chord = after.map(Scalar::to_f64);
            for (after, before) in chord.iter_mut().zip(before) {
                *after -= before.to_f64();
            }
            // The chord between unit vectors is shorter than the angle by the fraction angle²/24.
            let angle_rad = magnitude(&chord);
            let rounding = 4.0 * R::EPSILON;
            if !(angle_rad <= self.rules.junction_angle_rad + rounding) {
                return Err(Rejection::Corner { angle_rad });
            }
        }
        self.bounds.hold(piece)?;
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
        let (from_mm_s, to_mm_s) = (segment.from_mm_s(), segment.to_mm_s());
        let step = (from_mm_s - self.feed_mm_s).abs();
        if !(step <= R::from_f64(4.0 * R::EPSILON) * self.feed_mm_s) {
            return Err(Rejection::FeedStep {
                from_mm_s: self.feed_mm_s.to_f64(),
                to_mm_s: from_mm_s.to_f64(),
            });
        }
        let limits = &self.rules.limits;
        let quantities = ["feed [mm/s]", "acceleration [mm/s²]", "jerk [mm/s³]", "snap [mm/s⁴]"];
        let feed_mm_s = from_mm_s.max(to_mm_s);
        let values =
            [feed_mm_s, segment.peak_accel_mm_s2(), segment.peak_jerk_mm_s3(), segment.peak_snap_mm_s4()];
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
            let v_mm_s = from_mm_s.max(to_mm_s).to_f64();
            let is_on_curve = self.feed_length < self.curved_until;
            self.fits(if is_on_curve { &self.steepness } else { &Steepness::STRAIGHT }, v_mm_s)?;
            let was_ahead = self.feed_length > self.path_length;
            self.ahead_mm_s = if was_ahead { f64::max(self.ahead_mm_s, v_mm_s) } else { v_mm_s };
        }
        self.feed_mm_s = to_mm_s;
        self.feed_length = feed_length;
        Ok(())
    }

    /// Whether the number type holds what a feed of up to `v_mm_s` on a piece of this steepness asks of the
    /// axes, and what is computed on the way.
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

    /// The state for feed that continues at `feed_length`, at `feed_mm_s` and after `density`, whatever was
    /// accepted before.
    pub(crate) fn feed_from(&self, feed_length: Position, feed_mm_s: R, density: Density) -> Self {
        Self {
            feed_length,
            feed_mm_s,
            density,
            // Curves are checked when they enter.
            steepness: Steepness::STRAIGHT,
            curved_until: Position::ZERO,
            ..*self
        }
    }

    /// Whether the number type holds what a piece asks of the axes at up to `fastest_mm_s`.
    pub(crate) fn fits_at(&self, piece: &Piece<R, AXES>, fastest_mm_s: f64) -> Result<(), Rejection> {
        if R::SETPOINT_MAX.is_some() { self.fits(&piece.steepness(), fastest_mm_s) } else { Ok(()) }
    }

    /// The state after the end of a stretch's feed.
    pub(crate) fn feed_after_stretch(&self) -> Self {
        self.feed_from(Position::ZERO, R::ZERO, self.density)
    }

    pub(crate) fn feed_dwell(&mut self, duration: Ticks) -> Result<(), Rejection> {
        self.feed_at_rest()?;
        self.density.follow(duration)
    }

    /// Whether the feed of a list is between stretches.
    pub(crate) fn feed_at_rest(&self) -> Result<(), Rejection> {
        if self.feed_length > Position::ZERO { Err(Rejection::InsideStretch) } else { Ok(()) }
    }

    pub(crate) fn feed_mm_s(&self) -> R {
        self.feed_mm_s
    }

    /// Accepts the end of a stretch's path; its feed is accepted separately, in lists.
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

    /// Checks that the feed has come to rest at the end of its path, which is `path` long.
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
