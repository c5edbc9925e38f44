//! A feed segment under way: its phase, and the time in it. The segment itself stays in its queue.

use serde::{Deserialize, Serialize};

use super::Activity;
use crate::law::{FeedSegment, PathMotion, Phase, Ticks};
use crate::num::Real;
use crate::units::Position;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Moving {
    /// Path position of the segment's start.
    start: Position,
    phase: Phase,
    /// Time left in the phase.
    left: Ticks,
    /// The normalised time in the phase, in 2⁻⁶⁴.
    fraction: u64,
}

impl Moving {
    #[inline]
    pub(super) fn new<R: Real>(segment: &FeedSegment<R>, start: Position) -> Self {
        let rise = segment.phase_duration(Phase::Rise);
        // A cruise has a hold only.
        let (phase, left) = if rise > Ticks::ZERO {
            (Phase::Rise, rise)
        } else {
            (Phase::Hold, segment.phase_duration(Phase::Hold))
        };
        Self { start, phase, left, fraction: 0 }
    }

    /// Spends `time` ≤ 1 tick in the phase. If the phase ends by then, returns the rest of the time.
    #[inline]
    pub(super) fn spend<R: Real>(&mut self, segment: &FeedSegment<R>, time: Ticks) -> Option<Ticks> {
        let over = time.minus(self.left);
        if let Some(left) = self.left.minus(time)
            && over.is_none()
        {
            self.fraction = self.fraction.wrapping_add(segment.fraction_in(self.phase, time));
            self.left = left;
        }
        over
    }

    /// Continues with the next phase that takes time; false if that was the last one.
    #[inline]
    pub(super) fn next_phase<R: Real>(&mut self, segment: &FeedSegment<R>) -> bool {
        let next = |phase| (phase, segment.phase_duration(phase));
        let (phase, left) = match (self.phase, next(Phase::Hold)) {
            (Phase::Rise, hold @ (_, duration)) if duration > Ticks::ZERO => hold,
            (Phase::Rise | Phase::Hold, _) => next(Phase::Fall),
            (Phase::Fall, _) => return false,
        };
        (self.phase, self.left, self.fraction) = (phase, left, segment.fraction_at_start(phase));
        left > Ticks::ZERO
    }

    /// The same place in `segment`, which repeats the beginning of `before`; `None` if `segment` has already
    /// ended here.
    #[cold]
    pub(super) fn carried_over<R: Real>(
        &self,
        before: &FeedSegment<R>,
        segment: &FeedSegment<R>,
    ) -> Option<Self> {
        let elapsed = before.phase_duration(self.phase).minus(self.left)?;
        let left = segment.phase_duration(self.phase).minus(elapsed)?;
        let is_same_rise = before.phase_duration(Phase::Rise) == segment.phase_duration(Phase::Rise);
        let fraction = match self.phase {
            Phase::Rise if is_same_rise => self.fraction,
            // The same up to where `segment` parts from `before`.
            Phase::Rise if elapsed <= segment.opens_for() && elapsed <= before.opens_for() => {
                segment.fraction_after(Phase::Rise, elapsed)
            }
            Phase::Rise => return None,
            // The place where `segment` parts from `before` has been passed.
            Phase::Hold if !is_same_rise => return None,
            Phase::Hold => segment.fraction_after(Phase::Hold, elapsed),
            // A falling acceleration can't be ended earlier.
            Phase::Fall => return None,
        };
        Some(Self { start: self.start, phase: self.phase, left, fraction })
    }

    /// The phase, and the time left in it.
    #[inline]
    pub(super) fn inside(&self) -> (Phase, Ticks) {
        (self.phase, self.left)
    }

    /// The activity after the segment's end.
    #[inline]
    pub(super) fn ended<R: Real>(&self, segment: &FeedSegment<R>) -> Activity<R> {
        Activity::Between { s: self.start + segment.length(), v_mm_s: segment.to_mm_s() }
    }

    /// The motion now; `s` counts from the stretch's start.
    #[inline]
    pub(super) fn at<R: Real>(&self, segment: &FeedSegment<R>) -> PathMotion<R> {
        let motion = segment.at(self.phase, self.fraction);
        PathMotion { s: self.start + motion.s, ..motion }
    }
}
