//! The least time that a plan's path can take under the plan's ceilings.
//!
//! Consumes a plan; produces the time of the fastest motion over its blocks that keeps their ceilings, their
//! junction feeds and the acceleration of their laws, with no limit of jerk and snap along the path. Every plan
//! of these blocks keeps all that too, so none is faster. Jerk and snap across the path make ceilings, and
//! these count here.

use motion_kernel::plan::Block;

use crate::planning::{Item, Plan, Stretch};

/// The least time \[s\], dwells included, stops not.
#[must_use]
pub fn least_time_s<const N: usize>(plan: &Plan<N>) -> f64 {
    plan.items
        .iter()
        .map(|item| match item {
            Item::Stretch(stretch) => of_stretch_s(stretch),
            &Item::Dwell { seconds, .. } => seconds,
            Item::Switch { .. } | Item::Stop { .. } => 0.0,
        })
        .sum()
}

fn of_stretch_s<const N: usize>(stretch: &Stretch<N>) -> f64 {
    let blocks = stretch.for_lookahead();
    // v² at every junction, at most what the two ceilings and the junction allow; 0 at both ends.
    let mut squares = vec![0.0_f64; blocks.len() + 1];
    for (index, pair) in blocks.windows(2).enumerate() {
        let feed_mm_s = pair[0].junction_mm_s.min(pair[0].cap_mm_s).min(pair[1].cap_mm_s);
        squares[index + 1] = feed_mm_s * feed_mm_s;
    }
    let gained = |block: &Block<f64>| 2.0 * block.law.limits().accel_mm_s2 * block.length_mm;
    for (index, block) in blocks.iter().enumerate() {
        squares[index + 1] = squares[index + 1].min(squares[index] + gained(block));
    }
    for (index, block) in blocks.iter().enumerate().rev() {
        squares[index] = squares[index].min(squares[index + 1] + gained(block));
    }
    let time_s = |(block, ends): (&Block<f64>, &[f64])| {
        let accel = block.law.limits().accel_mm_s2;
        let (enter, exit) = (ends[0].sqrt(), ends[1].sqrt());
        let peak = (0.5 * (ends[0] + ends[1] + gained(block))).sqrt().min(block.cap_mm_s);
        let changing_mm = (2.0 * peak * peak - ends[0] - ends[1]) / (2.0 * accel);
        // The peak is above 0 wherever there is a length.
        let cruise_s = if peak > 0.0 { (block.length_mm - changing_mm).max(0.0) / peak } else { 0.0 };
        (2.0 * peak - enter - exit) / accel + cruise_s
    };
    blocks.iter().zip(squares.windows(2)).map(time_s).sum()
}
