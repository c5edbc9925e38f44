//! A ramp or a cruise over an exact length of path.
//!
//! Consumes a [`Ramp`] of any number type and the path it covers; produces the one form in which plans,
//! programs and live control hand feed on, in f64. The tick runs it as a [`FeedSegment`] of its own number
//! type. Background.

use serde::{Deserialize, Serialize};

use super::ramp::Ramp;
use super::segment::{FeedSegment, SegmentError, check, of_length};
use crate::num::{Real, Root};
use crate::units::Position;

/// A ramp or a cruise over a length of path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedRamp {
    /// The ramp; a cruise has equal feeds and t₂ = its duration.
    pub ramp: Ramp<f64>,
    /// The length of path: the ramp's own, but for rounding.
    pub length: Position,
}

impl PlannedRamp {
    /// `ramp` over `length`, for ticks of `tick_s`. Number types narrower than f64 may still refuse its
    /// segment.
    ///
    /// # Errors
    /// A figure is not finite, negative or too large, the lengths differ, or the feed steps.
    pub fn new<P: Root>(ramp: &Ramp<P>, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        Self::checked(of_length(ramp, length)?, length, tick_s)
    }

    /// A cruise at `feed_mm_s` > 0 over `length`.
    ///
    /// # Errors
    /// A figure is not finite, the feed is not positive, or the duration is too long.
    pub fn cruise(feed_mm_s: f64, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        Self::checked(Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s), length, tick_s)
    }

    fn checked(ramp: Ramp<f64>, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        let mut refused = None;
        check(&mut refused, &ramp, length, tick_s, f64::RAMP_MM_MAX);
        refused.map_or(Ok(Self { ramp, length }), Err)
    }

    /// The segment that the tick runs, for ticks of `tick_s`.
    ///
    /// # Errors
    /// As [`FeedSegment::ramp`]: a ramp that was read as data is checked here.
    pub fn segment<R: Real>(&self, tick_s: f64) -> Result<FeedSegment<R>, SegmentError> {
        FeedSegment::ramp(&self.ramp, self.length, tick_s)
    }
}
