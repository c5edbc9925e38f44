//! How high a hump goes.
//!
//! Consumes a hump, for which there are chains of ramps up both its sides to any top; produces the top with which it takes the least
//! time. The time is no smooth function of the top: just above a stair a chain may need one more rest.

use super::ROUNDING_MM;
use super::climb::Climb;
use super::valleys::{Hump, Valleys};
use crate::law::{Law, LimitedBy, Limits, peak};

/// Solver steps for the feed at the top of a hump.
const TOP_STEPS: usize = 24;
/// Of them, so many aim at where the ramps next to the top would meet, and the steps to find that.
const LEG_STEPS: usize = 4;
const LEGS_STEPS: usize = 6;
/// No more steps once another could gain so small a part of the time.
const TOP_GAIN: f64 = 2.0e-5;
/// No more steps once so small a part of the hump is left to cruise at its top.
const TOP_GAP: f64 = 1.0e-3;

/// The two sides of a hump, for any top.
pub(super) struct Sides<'a> {
    hump: &'a Hump,
    valleys: &'a Valleys<'a>,
    /// The law of all its blocks, if it is one.
    uniform: Option<Law<f64>>,
}

impl<'a> Sides<'a> {
    /// `None` if the hump has no blocks.
    pub(super) fn new(hump: &'a Hump, valleys: &'a Valleys<'a>) -> Option<Self> {
        let mut laws = valleys.laws_of(hump);
        let first = laws.next()?;
        let uniform = laws.all(|law| law == first).then_some(first);
        Some(Self { hump, valleys, uniform })
    }

    /// The lowest top there is.
    pub(super) fn lowest(&self) -> f64 {
        self.hump.enter_mm_s.max(self.hump.exit_mm_s)
    }

    /// The highest top that is worth trying: the ceiling, or what the law would reach without stairs, or with several laws,
    /// what their greatest acceleration alone would.
    fn highest(&self) -> f64 {
        let Hump { enter_mm_s, exit_mm_s, start_mm, end_mm, top_mm_s, .. } = *self.hump;
        let accel = self.valleys.laws_of(self.hump).map(|law| law.limits().accel_mm_s2);
        let squares = 0.5 * (enter_mm_s * enter_mm_s + exit_mm_s * exit_mm_s);
        let bound = libm::sqrt(squares + accel.fold(0.0, f64::max) * (end_mm - start_mm));
        let reached =
            self.uniform.map_or(bound, |law| bound.min(peak(&law, enter_mm_s, exit_mm_s, end_mm - start_mm)));
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
    pub(super) fn start(&self, up: &mut Climb, down: &mut Climb) {
        up.start(&self.hump.rising, self.hump.enter_mm_s, self.room_mm());
        down.start(&self.hump.falling, self.hump.exit_mm_s, self.room_mm());
    }

    /// Both sides up to `top`; returns what is left between them \[mm\], less than 0 if there is no room. `None` if there
    /// is none for one side by itself.
    pub(super) fn fit(&self, top: f64, up: &mut Climb, down: &mut Climb) -> Option<f64> {
        let (start_mm, end_mm) = (self.hump.start_mm, self.hump.end_mm);
        let up_mm = up.find(top, |a, b| self.limits(start_mm + a, start_mm + b, false))?;
        let down_mm = down.find(top, |a, b| self.limits(end_mm - b, end_mm - a, true))?;
        Some(self.room_mm() - up_mm - down_mm)
    }

    /// Up to the top with which the hump takes the least time, which is returned.
    pub(super) fn best(&self, up: &mut Climb, down: &mut Climb) -> Option<f64> {
        self.start(up, down);
        let (mut low, mut high) = (self.lowest(), self.highest());
        let room_mm = self.hump.end_mm - self.hump.start_mm;
        let mut left_high = match self.fit(high, up, down) {
            Some(left) if left >= 0.0 => return Some(high),
            Some(left) => left,
            None => f64::NEG_INFINITY,
        };
        // That the lowest one fits is known.
        let (mut left_low, mut gap_mm, mut last) = (room_mm, room_mm, high);
        // The best need not be the highest that fits: just above a stair a chain may lose more than its top gains.
        let (mut best, mut best_s) = (low, f64::INFINITY);
        // False position, with halving where that stands still; aimed a little short, so that there is room.
        let aim_mm = 0.5 * TOP_GAP * room_mm;
        for step in 0..TOP_STEPS {
            let gains = best_s == f64::INFINITY || gap_mm * (high - low) > TOP_GAIN * best_s * high * low;
            if gap_mm < TOP_GAP * room_mm || !gains {
                break;
            }
            let by_legs = if step < LEG_STEPS { top_by_legs(up, down, last, room_mm - aim_mm) } else { None };
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

/// Whether a hump can be driven at all: with the lowest top there is.
pub(super) fn lowest_fits(hump: &Hump, valleys: &Valleys<'_>, up: &mut Climb, down: &mut Climb) -> bool {
    let Some(sides) = Sides::new(hump, valleys) else {
        return hump.enter_mm_s == hump.exit_mm_s;
    };
    sides.start(up, down);
    sides.fit(sides.lowest(), up, down).is_some_and(|left_mm| left_mm >= 0.0)
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
            let (time_s, time_slope) = match ramp.limited_by {
                LimitedBy::Acceleration => (ramp.t1_s + change / accel, 1.0 / accel),
                LimitedBy::Jerk => {
                    let time_s = 2.0 * libm::sqrt(2.0 * change / ramp.peak_jerk_mm_s3);
                    (time_s, 0.5 * time_s / change)
                }
                LimitedBy::Snap => {
                    let time_s = ramp.duration_s() * libm::cbrt(change / (ramp.to_mm_s - ramp.from_mm_s));
                    (time_s, time_s / (3.0 * change))
                }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "exact values are the point")]

    use std::vec::Vec;
    use std::{println, vec};

    use super::*;
    use crate::plan::{Block, Node, nodes_for};
    use crate::random::Random;

    /// A hump's list of blocks: a staircase, random feeds, up and down, or a random walk; one law or one for each block.
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
                let law = Law::new(limits).expect("positive");
                Block { length_mm, cap_mm_s, junction_mm_s: f64::INFINITY, law }
            })
            .collect()
    }

    /// Against tops tried one by one, over all that there are: by how much longer the hump takes, beyond what a scan can tell.
    #[test]
    fn no_top_of_a_scan_is_much_better() {
        let (mut lost, seed) = (Vec::new(), 20_261);
        for case in 0..2000 {
            let random = Random::new(seed + 7919 * case as u64);
            let blocks = blocks(&random, case);
            let mut places = vec![Node::EMPTY; nodes_for(blocks.len())];
            let mut valleys = Valleys::new(&blocks, 0.0, 0.0, &mut places).expect("places");
            let (mut up, mut down) = (Climb::NONE, Climb::NONE);
            if !valleys.settle(|valleys, hump| lowest_fits(hump, valleys, &mut up, &mut down)) {
                continue;
            }
            for hump in valleys.humps() {
                let Some(sides) = Sides::new(&hump, &valleys) else { continue };
                let top = sides.best(&mut up, &mut down).expect("the lowest fits");
                let mut time_s = |top: f64| {
                    let left_mm = sides.fit(top, &mut up, &mut down).filter(|&left_mm| left_mm >= 0.0)?;
                    Some(up.time_s() + down.time_s() + left_mm / top)
                };
                let found_s = time_s(top).expect("what was found fits");
                // Acceleration alone reaches no more than this.
                let accel = valleys.laws_of(&hump).map(|law| law.limits().accel_mm_s2).fold(0.0, f64::max);
                let squares = 0.5 * (hump.enter_mm_s.powi(2) + hump.exit_mm_s.powi(2));
                let reached_mm_s = (squares + accel * (hump.end_mm - hump.start_mm)).sqrt();
                let (low, high) = (sides.lowest(), hump.top_mm_s.min(reached_mm_s).max(sides.lowest()));
                let tops = (0..=300).map(|step| low + (high - low) * f64::from(step) / 300.0);
                let least_s = tops.filter_map(time_s).fold(f64::INFINITY, f64::min);
                lost.push(((found_s / least_s - 1.0).max(0.0), case));
            }
        }
        lost.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mean = lost.iter().map(|lost| lost.0).sum::<f64>() / lost.len() as f64;
        let above = |part: f64| lost.iter().filter(|lost| lost.0 > part).count() as f64 / lost.len() as f64;
        println!(
            "seed {seed}, {} humps: {mean:.6} lost in the mean, more than 0.001 in {:.4}, 0.01 in {:.4}; worst {:?}",
            lost.len(),
            above(1e-3),
            above(1e-2),
            &lost[..4]
        );
        assert!(
            lost.len() > 3000 && mean < MEAN_LOST_MAX && above(1e-3) < SHARE_LOST_MAX && lost[0].0 < LOST_MAX
        );
    }

    /// Where ramps need room, just above a stair, tops of which few fit may be missed.
    const LOST_MAX: f64 = 0.06;
    const MEAN_LOST_MAX: f64 = 2.0e-4;
    const SHARE_LOST_MAX: f64 = 0.02;
}
