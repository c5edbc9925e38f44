//! The figures of one path that S2 reads off its plots.

use super::course::{Course, JunctionStep};
use super::deviation_mm;
use crate::toolpath::norm;

/// Ticks that the jerk is differenced over, long to short \[s\].
pub const TICKS_S: [f64; 3] = [1.0e-3, 3.0e-4, 1.0e-4];
/// Points at which the deviation from the arcs is looked for.
const DEVIATION_POINTS: u32 = 20_000;

/// Figures of a path at constant feed.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// The path's curves.
    pub name: &'static str,
    /// Arc length \[mm\].
    pub length_mm: f64,
    /// Duration \[s\].
    pub time_s: f64,
    /// Whole ticks of 1 ms in it.
    pub ticks: usize,
    /// The greatest distance from the arcs \[mm\].
    pub deviation_mm: f64,
    /// The steps at the junctions of the arcs, or of the polynomials.
    pub junctions: Vec<JunctionStep>,
    /// The figures for every tick of [`TICKS_S`].
    pub by_tick: [ByTick; TICKS_S.len()],
}

/// The figures that depend on the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ByTick {
    /// The tick \[s\].
    pub tick_s: f64,
    /// The greatest |jerk| of an axis, as a difference over ticks \[mm/s³\].
    pub jerk_max_mm_s3: f64,
    /// The greatest step of the jerk, over all axes, from one tick to the next \[mm/s³\].
    pub jerk_step_max_mm_s3: f64,
}

impl Figures {
    /// The figures of a path at a feed \[mm/s\].
    #[must_use]
    pub fn of(course: &Course, feed_mm_s: f64) -> Self {
        let length_mm = course.length_mm();
        let at = |part: u32| length_mm * f64::from(part) / f64::from(DEVIATION_POINTS);
        let points = (0..=DEVIATION_POINTS).filter_map(|part| course.at(at(part)));
        let by_tick = TICKS_S.map(|tick_s| {
            let ticks = course.ticks(feed_mm_s, tick_s);
            ByTick {
                tick_s,
                jerk_max_mm_s3: ticks.jerk_max_mm_s3(),
                jerk_step_max_mm_s3: ticks.jerk_step_max_mm_s3(),
            }
        });
        Self {
            name: course.name,
            length_mm,
            time_s: length_mm / feed_mm_s,
            ticks: (length_mm / (feed_mm_s * super::TICK_S)) as usize,
            deviation_mm: points.map(|local| deviation_mm(local.point)).fold(0.0, f64::max),
            junctions: course.junction_steps(feed_mm_s),
            by_tick,
        }
    }
}

impl JunctionStep {
    /// The size of the step of jerk over all axes \[mm/s³\].
    #[must_use]
    pub fn jerk_step_mm_s3(&self) -> f64 {
        norm(self.jerk_mm_s3)
    }
}
