//! Refuses a plan that is too dense for a tick, over the whole program.
//!
//! Wherever the ticks fall, at most [`PIECES_PER_TICK_MAX`] pieces and [`SEGMENTS_PER_TICK_MAX`]
//! segments and dwells may end within one, whatever stretches they belong to.

use std::collections::VecDeque;

use motion_kernel::exec::PIECES_PER_TICK_MAX;
use motion_kernel::law::Ticks;
use motion_kernel::queue::SEGMENTS_PER_TICK_MAX;

use super::error::Problem;

/// The times at which the latest short pieces end, and where on the path \[s, mm\].
#[derive(Default)]
pub(super) struct PiecePace {
    ends: VecDeque<(f64, f64)>,
    /// Start of the stretch: time \[s\] and position \[mm\].
    start: (f64, f64),
}

impl PiecePace {
    /// The next piece of a stretch, below a ceiling, which ends at a time \[s\] and a place \[mm\] of it.
    pub(super) fn piece(
        &mut self,
        (time_s, end_mm): (f64, f64),
        length_mm: f64,
        ceiling_mm_s: f64,
        tick_s: f64,
    ) -> Result<(), Problem> {
        if length_mm >= ceiling_mm_s * tick_s {
            // It takes a tick at least by itself: nothing before it can share one with what follows.
            self.ends.clear();
            return Ok(());
        }
        self.ends.push_back((self.start.0 + time_s, self.start.1 + end_mm));
        self.check(tick_s)
    }

    /// The stretch has ended, after a time \[s\] and a length \[mm\].
    pub(super) fn end(&mut self, (time_s, length_mm): (f64, f64)) {
        self.start.0 += time_s;
        self.start.1 += length_mm;
    }

    /// The machine rests.
    pub(super) fn dwell(&mut self, seconds: f64) {
        self.start.0 += seconds;
    }

    /// One more than the bound must not end within less than a tick.
    fn check(&mut self, tick_s: f64) -> Result<(), Problem> {
        if self.ends.len() <= PIECES_PER_TICK_MAX {
            return Ok(());
        }
        let (Some((first_s, first_mm)), Some(&(last_s, last_mm))) = (self.ends.pop_front(), self.ends.back())
        else {
            return Ok(());
        };
        let (time_s, length_mm) = (last_s - first_s, last_mm - first_mm);
        if time_s >= tick_s {
            return Ok(());
        }
        Err(Problem::DensePieces {
            pieces: PIECES_PER_TICK_MAX,
            length_mm,
            feed_mm_s: length_mm / time_s,
            feed_max_mm_s: length_mm / tick_s,
            tick_s,
        })
    }
}

/// The latest durations, as the queue looks at them.
#[derive(Default)]
pub(super) struct SegmentPace(VecDeque<Ticks>);

impl SegmentPace {
    /// The next segment or dwell.
    pub(super) fn next(&mut self, duration: Ticks) -> Result<(), Problem> {
        self.0.push_back(duration);
        if self.0.len() > SEGMENTS_PER_TICK_MAX {
            self.0.pop_front();
        }
        let together = self.0.iter().fold(Ticks::ZERO, |sum, &one| sum.plus(one));
        if self.0.len() == SEGMENTS_PER_TICK_MAX && together < Ticks::ONE {
            return Err(Problem::DenseSegments { segments: SEGMENTS_PER_TICK_MAX, ticks: together.to_f64() });
        }
        Ok(())
    }
}
