//! Ramps that span blocks.
//!
//! Consumes the same blocks as [`plan`](super::plan()); produces ramps and cruises over path length that begin and end
//! wherever it is best, not at joints. Every ceiling is kept at every point, and a ramp uses no more than the least
//! limits of all the blocks it crosses.
//!
//! - [`valleys`]: which ceilings are rested in, and what lies between them: humps;
//! - [`climb`]: up one side of a hump, below its stairs.
//!
//! Works in f64 on slices of the caller, allocates nothing. Time goes with the number of blocks; chains of valleys
//! that cannot be reached cost more, up to a bound beyond which there is no such plan.

pub mod climb;
pub mod valleys;

pub use valleys::Node;

use self::climb::Climb;
use self::valleys::{Hump, Valleys};
use super::lookahead::{Block, BlockPlan, PlanError, check};
use crate::law::{Law, LimitedBy, Limits, Ramp, peak};

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

impl FeedSpan {
    /// At one feed > 0 from one position to another.
    pub(super) fn cruise(start_mm: f64, end_mm: f64, feed_mm_s: f64) -> Self {
        let length_mm = end_mm - start_mm;
        Self { start_mm, length_mm, ramp: Ramp::cruise(feed_mm_s, length_mm / feed_mm_s) }
    }
}

/// Places for nodes that are enough for any list of so many blocks.
#[must_use]
pub const fn nodes_for(blocks: usize) -> usize {
    2 * blocks + 2
}

/// Lengths that differ by no more are equal \[mm\].
pub(super) const ROUNDING_MM: f64 = 1.0e-9;
/// Solver steps for the feed at the top of a hump.
const TOP_STEPS: usize = 24;
/// Of them, so many aim at where the ramps next to the top would meet, and the steps to find that.
const LEG_STEPS: usize = 4;
const LEGS_STEPS: usize = 6;
/// No more steps once another could gain so small a part of the time.
const TOP_GAIN: f64 = 2.0e-5;
/// Where between the best top and the first that did not fit another one is tried.
const TOP_ABOVE: f64 = 0.33;
/// That is worth it if the last stair rested in is above this part of the top.
const TOP_CLOSE: f64 = 0.75;
/// No more steps once so small a part of the hump is left to cruise at its top.
const TOP_GAP: f64 = 1.0e-3;

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
    // Several kilobytes each: used for all humps.
    let (mut up, mut down) = (Climb::NONE, Climb::NONE);
    let fits = |valleys: &Valleys<'_>, hump: &Hump| match Sides::new(hump, valleys) {
        Some(sides) => {
            sides.start(&mut up, &mut down);
            sides.fit(sides.lowest(), &mut up, &mut down).is_some_and(|left| left >= 0.0)
        }
        None => hump.enter_mm_s == hump.exit_mm_s,
    };
    if !valleys.settle(fits) {
        return Ok(None);
    }
    let mut out = Out { at_mm: 0.0, time_s: 0.0, put };
    for hump in valleys.humps() {
        out.cruise(hump.start_mm, hump.enter_mm_s);
        if drive(&hump, &valleys, &mut up, &mut down, &mut out).is_none() {
            return Ok(None);
        }
    }
    Ok(Some(out.time_s))
}

/// One pair of ramps a block, as [`plan`](super::plan()) found them.
pub(super) fn spans_of(blocks: &[Block<f64>], plans: &[BlockPlan<f64>], put: &mut impl FnMut(FeedSpan)) {
    let mut out = Out { at_mm: 0.0, time_s: 0.0, put };
    let mut end_mm = 0.0;
    for (block, plan) in blocks.iter().zip(plans) {
        end_mm += block.length_mm;
        let rise = Ramp::new(&block.law, plan.enter_mm_s, plan.peak_mm_s);
        let fall = Ramp::new(&block.law, plan.peak_mm_s, plan.exit_mm_s);
        if !rise.is_cruise() {
            out.ramp(&rise);
        }
        out.cruise(end_mm - fall.length_mm(), plan.peak_mm_s);
        if !fall.is_cruise() {
            out.ramp(&fall);
        }
    }
}

/// Where spans go.
struct Out<'a, F> {
    at_mm: f64,
    time_s: f64,
    put: &'a mut F,
}

impl<F: FnMut(FeedSpan)> Out<'_, F> {
    fn cruise(&mut self, to_mm: f64, feed_mm_s: f64) {
        if to_mm > self.at_mm && feed_mm_s > 0.0 {
            let span = FeedSpan::cruise(self.at_mm, to_mm, feed_mm_s);
            (self.put)(span);
            self.time_s += span.ramp.duration_s();
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

/// The two sides of a hump, for any top.
struct Sides<'a> {
    hump: &'a Hump,
    valleys: &'a Valleys<'a>,
    /// The law of all its blocks, if it is one.
    uniform: Option<Law<f64>>,
}

impl<'a> Sides<'a> {
    /// `None` if the hump has no blocks.
    fn new(hump: &'a Hump, valleys: &'a Valleys<'a>) -> Option<Self> {
        let mut laws = valleys.laws_of(hump);
        let first = laws.next()?;
        let uniform = laws.all(|law| law == first).then_some(first);
        Some(Self { hump, valleys, uniform })
    }

    /// The lowest top there is.
    fn lowest(&self) -> f64 {
        self.hump.enter_mm_s.max(self.hump.exit_mm_s)
    }

    /// The highest top that is worth trying: the ceiling, or what acceleration alone would reach.
    fn highest(&self) -> f64 {
        let Hump { enter_mm_s, exit_mm_s, start_mm, end_mm, top_mm_s, .. } = *self.hump;
        let accel = self.valleys.laws_of(self.hump).map(|law| law.limits().accel_mm_s2);
        let squares = 0.5 * (enter_mm_s * enter_mm_s + exit_mm_s * exit_mm_s);
        let reached = libm::sqrt(squares + accel.fold(0.0, f64::max) * (end_mm - start_mm));
        top_mm_s.min(reached).max(self.lowest())
    }

    /// The least limits of the blocks between two positions; of a position by itself, of the block that comes next on
    /// the way on, or on the way back.
    fn limits(&self, low_mm: f64, high_mm: f64, is_back: bool) -> Limits<f64> {
        match self.uniform {
            Some(law) => law.limits(),
            None => self.valleys.least(self.hump, low_mm, high_mm, is_back),
        }
    }

    /// Length of the hump, and a rounding: a ramp that was planned before to end just there still does.
    fn room_mm(&self) -> f64 {
        self.hump.end_mm - self.hump.start_mm + ROUNDING_MM
    }

    /// Puts both climbs before their stairs.
    fn start(&self, up: &mut Climb, down: &mut Climb) {
        up.start(&self.hump.rising, self.hump.enter_mm_s, self.room_mm());
        down.start(&self.hump.falling, self.hump.exit_mm_s, self.room_mm());
    }

    /// Both sides up to `top`; returns what is left between them \[mm\], less than 0 if there is no room. `None` if there
    /// is none for one side by itself.
    fn fit(&self, top: f64, up: &mut Climb, down: &mut Climb) -> Option<f64> {
        let (start_mm, end_mm) = (self.hump.start_mm, self.hump.end_mm);
        let up_mm = up.find(top, |a, b| self.limits(start_mm + a, start_mm + b, false))?;
        let down_mm = down.find(top, |a, b| self.limits(end_mm - b, end_mm - a, true))?;
        Some(self.room_mm() - up_mm - down_mm)
    }

    /// Up to the top with which the hump takes the least time, which is returned.
    fn best(&self, up: &mut Climb, down: &mut Climb) -> Option<f64> {
        self.start(up, down);
        let (mut low, mut high) = (self.lowest(), self.highest());
        let room_mm = self.hump.end_mm - self.hump.start_mm;
        if let Some(law) = self.uniform {
            // Stairs in the way only make it lower.
            high = high.min(peak(&law, self.hump.enter_mm_s, self.hump.exit_mm_s, room_mm)).max(low);
        }
        let mut left_high = match self.fit(high, up, down) {
            Some(left) if left >= 0.0 => return Some(high),
            Some(left) => left,
            None => f64::NEG_INFINITY,
        };
        // That the lowest one fits is known.
        let (mut left_low, mut gap_mm, mut last) = (room_mm, room_mm, high);
        // The best need not be the highest that fits: just above a stair a chain may lose more than its top gains. Nor need what
        // is above one that does not fit: a softer chain that does not rest in that stair may be shorter.
        let (mut best, mut best_s) = (low, f64::INFINITY);
        let mut above =
            (!self.hump.rising.is_empty() || !self.hump.falling.is_empty()).then_some((high, left_high));
        // False position, with halving where that stands still; aimed a little short, so that there is room.
        let aim_mm = 0.5 * TOP_GAP * room_mm;
        for step in 0..TOP_STEPS {
            let gains = best_s == f64::INFINITY || gap_mm * (high - low) > TOP_GAIN * best_s * high * low;
            let is_above = gap_mm < TOP_GAP * room_mm || !gains;
            let by_legs = if is_above {
                let is_close =
                    |climb: &Climb| climb.rested_mm_s().is_some_and(|feed| feed > TOP_CLOSE * last);
                let Some((highest, left)) = above.take().filter(|_| is_close(up) || is_close(down)) else {
                    break;
                };
                (high, left_high) = (highest, left);
                Some(best + TOP_ABOVE * (highest - best))
            } else if step < LEG_STEPS {
                top_by_legs(up, down, last, room_mm - aim_mm)
            } else {
                None
            };
            let part = (left_low - aim_mm) / (left_low - left_high);
            let part = if part > 0.02 && part < 0.98 { part } else { 0.5 };
            last = by_legs.filter(|&top| low < top && top < high).unwrap_or(low + part * (high - low));
            match self.fit(last, up, down) {
                Some(left) if left >= 0.0 => {
                    (low, left_low, gap_mm) = (last, left, left);
                    left_high *= 0.5;
                    let time_s = up.time_s() + down.time_s() + left / last;
                    if time_s < best_s {
                        (best, best_s) = (last, time_s);
                    }
                }
                _ if is_above => break,
                tried => {
                    (high, left_high) = (last, tried.unwrap_or(f64::NEG_INFINITY));
                    left_low *= 0.5;
                }
            }
        }
        if last != best {
            self.fit(best, up, down).filter(|&left| left >= 0.0)?;
        }
        Some(best)
    }
}

/// The top of a hump for which both sides together are `room_mm` long, if their last ramps, now up to `top_mm_s`, only get
/// longer or shorter by it.
fn top_by_legs(up: &Climb, down: &Climb, top_mm_s: f64, room_mm: f64) -> Option<f64> {
    let legs = [up.last_leg()?, down.last_leg()?];
    let mut top = top_mm_s;
    for _ in 0..LEGS_STEPS {
        let (mut length_mm, mut slope_s) = (0.0, 0.0);
        for leg in legs {
            let ramp = &leg.ramp;
            let change = top - ramp.from_mm_s;
            if !(change > 0.0) {
                return None;
            }
            let accel = ramp.peak_accel_mm_s2();
            let (time_s, time_slope) = if ramp.limited_by == LimitedBy::Acceleration {
                (ramp.t1_s + change / accel, 1.0 / accel)
            } else {
                let time_s = 2.0 * libm::sqrt(2.0 * change / ramp.peak_jerk_mm_s3);
                (time_s, 0.5 * time_s / change)
            };
            let mean_mm_s = 0.5 * (ramp.from_mm_s + top);
            length_mm += leg.start_mm + mean_mm_s * time_s;
            slope_s += 0.5 * time_s + mean_mm_s * time_slope;
        }
        let step = (length_mm - room_mm) / slope_s;
        top -= step;
        if step.abs() < 1.0e-5 * top {
            break;
        }
    }
    Some(top)
}

/// Up, along and down.
fn drive<F: FnMut(FeedSpan)>(
    hump: &Hump,
    valleys: &Valleys<'_>,
    up: &mut Climb,
    down: &mut Climb,
    out: &mut Out<'_, F>,
) -> Option<()> {
    let Some(sides) = Sides::new(hump, valleys) else { return Some(()) };
    let top = sides.best(up, down)?;
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
