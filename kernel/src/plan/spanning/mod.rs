//! Ramps that span blocks.
//!
//! Consumes the same blocks as [`plan`](super::plan()); produces ramps and cruises over path length that begin and end
//! wherever it is best, not at joints. Every ceiling is kept at every point, and a ramp uses no more than the least
//! limits of all the blocks it crosses.
//!
//! - [`valleys`]: which ceilings are rested in, and what lies between them: humps;
//! - [`climb`]: up one side of a hump, below its stairs.
//!
//! Works in f64 on slices of the caller, allocates nothing, and takes time in proportion to the number of blocks.

pub mod climb;
pub mod valleys;

pub use valleys::Node;

use self::climb::{Climb, climb};
use self::valleys::{Hump, Valleys};
use super::lookahead::{Block, PlanError, check};
use crate::law::{Limits, Ramp};

/// A ramp or a cruise, with its place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedSpan {
    /// Where it starts \[mm\].
    pub start_mm: f64,
    /// Its length \[mm\].
    pub length_mm: f64,
    /// The ramp; a cruise has equal feeds and t₂ = its duration.
    pub ramp: Ramp<f64>,
}

/// Places for nodes that are enough for any list of so many blocks.
#[must_use]
pub const fn nodes_for(blocks: usize) -> usize {
    2 * blocks + 2
}

/// Solver steps for the feed at the top of a hump.
const TOP_STEPS: usize = 24;

/// Plans a stretch with ramps that may span blocks, and hands every ramp and cruise to `put`, in path order. Returns
/// the time it takes \[s\], or `None` where no such plan was found (one pair of ramps a block may still be possible).
///
/// # Errors
/// A figure is out of range, or `places` is shorter than [`nodes_for`] says.
pub fn plan_spanning(
    blocks: &[Block<f64>],
    start_mm_s: f64,
    end_mm_s: f64,
    places: &mut [Node],
    put: &mut impl FnMut(FeedSpan),
) -> Result<Option<f64>, PlanError> {
    check(blocks, start_mm_s, end_mm_s)?;
    let room = places.len();
    let Some(mut valleys) = Valleys::new(blocks, start_mm_s, end_mm_s, places) else {
        return Err(PlanError::Output { blocks: nodes_for(blocks.len()), plans: room });
    };
    let mut out = Out { at_mm: 0.0, time_s: 0.0, put };
    while let Some(hump) = valleys.next_hump() {
        out.cruise(hump.start_mm, hump.enter_mm_s);
        if solve(&hump, &valleys, &mut out).is_none() {
            #[cfg(feature = "debugprint")]
            extern crate std;
            #[cfg(feature = "debugprint")]
            std::println!("{hump:?}");
            return Ok(None);
        }
    }
    Ok(Some(out.time_s))
}

/// Where spans go.
struct Out<'a, F> {
    at_mm: f64,
    time_s: f64,
    put: &'a mut F,
}

impl<F: FnMut(FeedSpan)> Out<'_, F> {
    fn cruise(&mut self, to_mm: f64, feed_mm_s: f64) {
        let length_mm = to_mm - self.at_mm;
        if length_mm > 0.0 && feed_mm_s > 0.0 {
            let ramp = Ramp::cruise(feed_mm_s, length_mm / feed_mm_s);
            (self.put)(FeedSpan { start_mm: self.at_mm, length_mm, ramp });
            self.time_s += ramp.duration_s();
        }
        self.at_mm = self.at_mm.max(to_mm);
    }

    fn ramp(&mut self, ramp: &Ramp<f64>) {
        let length_mm = ramp.length_mm();
        (self.put)(FeedSpan { start_mm: self.at_mm, length_mm, ramp: *ramp });
        self.time_s += ramp.duration_s();
        self.at_mm += length_mm;
    }
}

/// Up, along and down.
fn solve<F: FnMut(FeedSpan)>(hump: &Hump, valleys: &Valleys<'_>, out: &mut Out<'_, F>) -> Option<()> {
    let room_mm = hump.end_mm - hump.start_mm;
    if !(room_mm > 0.0) {
        return (hump.enter_mm_s == hump.exit_mm_s).then_some(());
    }
    let blocks = valleys.blocks_of(hump);
    let mut laws = blocks.clone().map(|(_, _, law)| law);
    let first = laws.next()?;
    let is_uniform = laws.all(|law| law == first);
    // The least limits between two positions.
    let least = |from_mm: f64, to_mm: f64| {
        if is_uniform {
            return first.limits();
        }
        let touched = blocks.clone().filter(|&(start, end, _)| end > from_mm && start < to_mm.max(from_mm + 1e-12));
        touched.map(|(_, _, law)| law.limits()).reduce(least).unwrap_or(first.limits())
    };
    let sides = |top: f64| -> Option<(Climb, Climb)> {
        let (start, end) = (hump.start_mm, hump.end_mm);
        let up = climb(&hump.rising, hump.enter_mm_s, top, room_mm, |a, b| least(start + a, start + b))?;
        let down = climb(&hump.falling, hump.exit_mm_s, top, room_mm, |a, b| least(end - b, end - a))?;
        Some((up, down))
    };
    let gap = |(up, down): &(Climb, Climb)| room_mm - up.length_mm - down.length_mm;
    // What acceleration alone would reach.
    let accel = blocks.clone().map(|(_, _, law)| law.limits().accel_mm_s2).fold(0.0, f64::max);
    let squares = 0.5 * (hump.enter_mm_s * hump.enter_mm_s + hump.exit_mm_s * hump.exit_mm_s);
    let mut high = hump.top_mm_s.min(libm::sqrt(squares + accel * room_mm));
    let mut low = hump.enter_mm_s.max(hump.exit_mm_s);
    high = high.max(low);
    let mut best = sides(high).filter(|both| gap(both) >= 0.0).map(|both| (high, both));
    if best.is_none() {
        let mut at_low = sides(low).filter(|both| gap(both) >= 0.0)?;
        let mut gap_low = gap(&at_low);
        for _ in 0..TOP_STEPS {
            let middle = 0.5 * (low + high);
            match sides(middle).filter(|both| gap(both) >= 0.0) {
                Some(both) => {
                    low = middle;
                    gap_low = gap(&both);
                    at_low = both;
                }
                None => high = middle,
            }
            if gap_low < 1e-4 * room_mm {
                break;
            }
        }
        best = Some((low, at_low));
    }
    let (top, (up, down)) = best?;
    let mut feed = hump.enter_mm_s;
    for leg in up.legs() {
        out.cruise(hump.start_mm + leg.start_mm, feed);
        out.ramp(&leg.ramp);
        feed = leg.ramp.to_mm_s;
    }
    feed = top;
    for leg in down.legs().rev() {
        let ramp = leg.ramp.reversed();
        out.cruise(hump.end_mm - leg.start_mm - ramp.length_mm(), feed);
        out.ramp(&ramp);
        feed = ramp.to_mm_s;
    }
    out.cruise(hump.end_mm, feed);
    Some(())
}

fn least(a: Limits<f64>, b: Limits<f64>) -> Limits<f64> {
    Limits {
        accel_mm_s2: a.accel_mm_s2.min(b.accel_mm_s2),
        jerk_mm_s3: a.jerk_mm_s3.min(b.jerk_mm_s3),
        snap_mm_s4: a.snap_mm_s4.min(b.snap_mm_s4),
    }
}
