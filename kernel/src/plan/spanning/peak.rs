//! The peak of an interval: its greatest feed.
//!
//! Consumes an interval, with chains of ramps up both its sides to any peak; produces the peak with the least
//! time. The time is not a smooth function of the peak: just above a step a chain may need one more rest.

use super::ROUNDING_MM;
use super::ascent::{Ascent, AscentRamp};
use super::intervals::{Interval, Intervals};
use crate::law::{Law, Limits, peak};

/// Solver steps for the feed at the peak of an interval.
const PEAK_STEPS: usize = 24;
/// Number of them that aim at where the ramps next to the peak would meet, and the number of steps to find
/// that.
const AIMED_STEPS: usize = 4;
const AIM_STEPS: usize = 6;
/// Relative gain in time below which no more steps are taken.
const PEAK_GAIN: f64 = 2.0e-5;
/// Share of the interval left to cruise at its peak below which no more steps are taken.
const PEAK_GAP: f64 = 1.0e-3;

/// The two sides of an interval, for any peak.
pub(super) struct Sides<'a> {
    interval: &'a Interval,
    intervals: &'a Intervals<'a>,
    /// The law of all its blocks, if they share one.
    uniform: Option<Law<f64>>,
}

impl<'a> Sides<'a> {
    /// `None` if the interval has no blocks.
    pub(super) fn new(interval: &'a Interval, intervals: &'a Intervals<'a>) -> Option<Self> {
        let mut laws = intervals.laws_of(interval);
        let first = laws.next()?;
        let uniform = laws.all(|law| law == first).then_some(first);
        Some(Self { interval, intervals, uniform })
    }

    /// The lowest possible peak.
    pub(super) fn lowest(&self) -> f64 {
        self.interval.enter_mm_s.max(self.interval.exit_mm_s)
    }

    /// The highest peak worth trying: the ceiling, or the feed that the law would reach without steps, or,
    /// with several laws, the feed that their greatest acceleration alone would reach.
    fn highest(&self) -> f64 {
        let Interval { enter_mm_s, exit_mm_s, start_mm, end_mm, peak_mm_s, .. } = *self.interval;
        let accel = self.intervals.laws_of(self.interval).map(|law| law.limits().accel_mm_s2);
        let squares = 0.5 * (enter_mm_s * enter_mm_s + exit_mm_s * exit_mm_s);
        let bound = libm::sqrt(squares + accel.fold(0.0, f64::max) * (end_mm - start_mm));
        let reached =
            self.uniform.map_or(bound, |law| bound.min(peak(&law, enter_mm_s, exit_mm_s, end_mm - start_mm)));
        peak_mm_s.min(reached).max(self.lowest())
    }

    /// The least limits of the blocks between two positions. For a single position, the limits of the block
    /// after it, or on the way back the block before it.
    fn limits(&self, low_mm: f64, high_mm: f64, is_back: bool) -> Limits<f64> {
        if let Some(law) = self.uniform {
            return law.limits();
        }
        // Where a block ends is off by some last places, because an ascent counts from the end of the
        // interval that it begins at. So much of a block must not ask for its limits: it may be far softer.
        let rounding_mm = 4.0 * f64::EPSILON * self.interval.end_mm;
        let (low_mm, high_mm) = match (low_mm < high_mm, is_back) {
            (true, _) => (low_mm + rounding_mm, high_mm - rounding_mm),
            (false, false) => (low_mm + rounding_mm, high_mm + rounding_mm),
            (false, true) => (low_mm - rounding_mm, high_mm - rounding_mm),
        };
        self.intervals.least(self.interval, low_mm, high_mm, is_back)
    }

    /// Length of the interval plus a rounding, so that a ramp planned before to end just there still fits.
    fn room_mm(&self) -> f64 {
        self.interval.end_mm - self.interval.start_mm + ROUNDING_MM
    }

    /// Starts both ascents before their steps.
    pub(super) fn start(&self, up: &mut Ascent<'_>, down: &mut Ascent<'_>) {
        let pulse = self.intervals.pulse();
        up.start(&self.interval.rising, self.interval.enter_mm_s, self.room_mm(), pulse);
        down.start(&self.interval.falling, self.interval.exit_mm_s, self.room_mm(), pulse);
    }

    /// Plans both sides up to `peak`; returns the length left between them \[mm\], negative if there is no
    /// room. `None` if there is no room even for one side alone, or something more urgent waits.
    pub(super) fn fit(&self, peak: f64, up: &mut Ascent<'_>, down: &mut Ascent<'_>) -> Option<f64> {
        if self.intervals.attention.is_wanted() {
            return None;
        }
        let (start_mm, end_mm) = (self.interval.start_mm, self.interval.end_mm);
        let up_mm = up.find(peak, |a, b| self.limits(start_mm + a, start_mm + b, false))?;
        let down_mm = down.find(peak, |a, b| self.limits(end_mm - b, end_mm - a, true))?;
        Some(self.room_mm() - up_mm - down_mm)
    }

    /// Plans both sides up to the peak with the least time, and returns that peak. `None` if there is none, or something more urgent
    /// waits.
    pub(super) fn best(&self, up: &mut Ascent<'_>, down: &mut Ascent<'_>) -> Option<f64> {
        if self.intervals.attention.is_wanted() {
            return None;
        }
        self.start(up, down);
        let (mut low, mut high) = (self.lowest(), self.highest());
        let at_high = self.fit(high, up, down);
        if at_high.is_some_and(|left| left >= 0.0) {
            return Some(high);
        }
        let mut left_high = at_high.unwrap_or(f64::NEG_INFINITY);
        // What the ramps to the highest peak aim at has to be found before the lowest takes their place.
        let room_mm = self.interval.end_mm - self.interval.start_mm;
        let aim_mm = 0.5 * PEAK_GAP * room_mm;
        let mut aimed = peak_by_ramps(up, down, high, room_mm - aim_mm);
        let mut left_low = self.fit(low, up, down).filter(|&left| left >= 0.0)?;
        let low_s = up.time_s() + down.time_s() + if low > 0.0 { left_low / low } else { f64::INFINITY };
        // The best peak need not be the highest that fits, nor better than the lowest one: just above a step
        // a chain may lose more than its peak gains.
        let (mut gap_mm, mut last) = (left_low, high);
        let (mut best, mut best_s) = (low, low_s);
        // False position, with bisection where that stalls; aimed a little short, so that there is room.
        for step in 0..PEAK_STEPS {
            let gains = best_s == f64::INFINITY || gap_mm * (high - low) > PEAK_GAIN * best_s * high * low;
            if gap_mm < PEAK_GAP * room_mm || !gains || self.intervals.attention.is_wanted() {
                break;
            }
            if 0 < step && step < AIMED_STEPS {
                aimed = peak_by_ramps(up, down, last, room_mm - aim_mm);
            }
            let part = (left_low - aim_mm) / (left_low - left_high);
            let part = if part > 0.02 && part < 0.98 { part } else { 0.5 };
            last =
                aimed.take().filter(|&peak| low < peak && peak < high).unwrap_or(low + part * (high - low));
            match self.fit(last, up, down) {
                Some(left) if left >= 0.0 => {
                    (low, left_low, gap_mm) = (last, left, left);
                    left_high *= 0.5;
                    let time_s = up.time_s() + down.time_s() + left / last;
                    if time_s < best_s {
                        (best, best_s) = (last, time_s);
                    }
                }
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

/// Whether an interval can be driven at all, that is, with the lowest possible peak.
pub(super) fn lowest_fits(
    interval: &Interval,
    intervals: &Intervals<'_>,
    up: &mut Ascent<'_>,
    down: &mut Ascent<'_>,
) -> bool {
    let Some(sides) = Sides::new(interval, intervals) else {
        return interval.enter_mm_s == interval.exit_mm_s;
    };
    sides.start(up, down);
    sides.fit(sides.lowest(), up, down).is_some_and(|left_mm| left_mm >= 0.0)
}

/// The peak of an interval for which both sides together are `room_mm` long, if their last
/// ramps, now up to `peak_mm_s`, only get longer or shorter by it.
fn peak_by_ramps(up: &Ascent<'_>, down: &Ascent<'_>, peak_mm_s: f64, room_mm: f64) -> Option<f64> {
    let ramps = [up.last_ramp()?, down.last_ramp()?];
    let mut peak = peak_mm_s;
    for _ in 0..AIM_STEPS {
        let (mut length_mm, mut slope_s) = (0.0, 0.0);
        for AscentRamp { start_mm, ramp } in ramps {
            let change = peak - ramp.from_mm_s;
            if !(change > 0.0) {
                return None;
            }
            let (time_s, time_slope) = ramp.time_for_s(change);
            let mean_mm_s = 0.5 * (ramp.from_mm_s + peak);
            length_mm += start_mm + mean_mm_s * time_s;
            slope_s += 0.5 * time_s + mean_mm_s * time_slope;
        }
        let step = (length_mm - room_mm) / slope_s;
        peak -= step;
        if step.abs() < 1.0e-5 * peak {
            break;
        }
    }
    Some(peak)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "exact values are the point")]

    use std::vec::Vec;
    use std::{println, vec};

    use super::*;
    use crate::law::Pulse;
    use crate::plan::{Attention, Block, Node, nodes_for};
    use crate::random::Random;

    /// An interval's list of blocks: rising steps, random feeds, up and down, or a random walk; one law or
    /// one for each block.
    fn blocks(random: &Random, case: usize) -> Vec<Block<f64>> {
        let count = 1 + random.below(60) as usize;
        let (step_mm, mut walk_mm_s) = (random.log(1e-3, 50.0), 50.0);
        (0..count)
            .map(|n| {
                let part = n as f64 / count as f64;
                let cap_mm_s = match case % 4 {
                    0 => 10.0 + 150.0 * part,
                    1 => 50.0 + 50.0 * random.log(0.01, 1.0),
                    2 => 161.0 - 160.0 * (2.0 * part - 1.0).abs(),
                    _ => {
                        walk_mm_s = f64::clamp(walk_mm_s * random.log(0.8, 1.25), 1.0, 200.0);
                        walk_mm_s
                    }
                };
                let limit = |least: f64| if case % 8 < 4 { least } else { least * (1.0 + random.unit()) };
                let limits =
                    Limits { accel_mm_s2: limit(500.0), jerk_mm_s3: limit(5e3), snap_mm_s4: limit(4e5) };
                let length_mm =
                    if case.is_multiple_of(3) { step_mm } else { step_mm * random.log(0.01, 1.0) };
                let law = Law::new(Pulse::Plateau, limits).expect("positive");
                Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law }
            })
            .collect()
    }

    /// Against peaks tried one by one, over all that there are: by how much longer the interval takes, beyond
    /// what a scan can tell.
    #[test]
    fn no_peak_of_a_scan_is_much_better() {
        let (mut lost, seed) = (Vec::new(), 20_261);
        let attention = Attention::undivided();
        for case in 0..2000 {
            let random = Random::new(seed + 7919 * case as u64);
            let blocks = blocks(&random, case);
            let mut places = vec![Node::EMPTY; nodes_for(blocks.len())];
            let mut intervals = Intervals::new(&blocks, 0.0, 0.0, &mut places, &attention).expect("places");
            let (mut up, mut down) = (Ascent::NONE, Ascent::NONE);
            if !intervals.settle(|intervals, interval| lowest_fits(interval, intervals, &mut up, &mut down)) {
                continue;
            }
            for interval in intervals.in_order() {
                let Some(sides) = Sides::new(&interval, &intervals) else { continue };
                let peak = sides.best(&mut up, &mut down).expect("the lowest fits");
                let mut time_s = |peak: f64| {
                    let left_mm = sides.fit(peak, &mut up, &mut down).filter(|&left_mm| left_mm >= 0.0)?;
                    Some(up.time_s() + down.time_s() + left_mm / peak)
                };
                let found_s = time_s(peak).expect("what was found fits");
                // Acceleration alone reaches no more than this.
                let accel =
                    intervals.laws_of(&interval).map(|law| law.limits().accel_mm_s2).fold(0.0, f64::max);
                let squares = 0.5 * (interval.enter_mm_s.powi(2) + interval.exit_mm_s.powi(2));
                let reached_mm_s = (squares + accel * (interval.end_mm - interval.start_mm)).sqrt();
                let (low, high) = (sides.lowest(), interval.peak_mm_s.min(reached_mm_s).max(sides.lowest()));
                let peaks = (0..=300).map(|step| low + (high - low) * f64::from(step) / 300.0);
                let least_s = peaks.filter_map(time_s).fold(f64::INFINITY, f64::min);
                lost.push(((found_s / least_s - 1.0).max(0.0), case));
            }
        }
        lost.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mean = lost.iter().map(|lost| lost.0).sum::<f64>() / lost.len() as f64;
        let above = |part: f64| lost.iter().filter(|lost| lost.0 > part).count() as f64 / lost.len() as f64;
        println!(
            "seed {seed}, {} intervals: {mean:.6} lost in the mean, more than 0.001 in {:.4}, 0.01 in {:.4}; worst {:?}",
            lost.len(),
            above(1e-3),
            above(1e-2),
            &lost[..4]
        );
        assert!(
            lost.len() > 3000 && mean < MEAN_LOST_MAX && above(1e-3) < SHARE_LOST_MAX && lost[0].0 < LOST_MAX
        );
    }

    /// Where ramps need room, just above a step, peaks of which few fit may be missed.
    const LOST_MAX: f64 = 0.04;
    const MEAN_LOST_MAX: f64 = 2.0e-4;
    const SHARE_LOST_MAX: f64 = 0.02;
}
