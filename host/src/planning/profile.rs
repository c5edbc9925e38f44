//! Feed and time at any path position of a planned stretch.

use motion_kernel::law::PlannedRamp;
use motion_kernel::plan::BlockPlan;

/// Positions closer than this are the same: ramps start and end on position steps, blocks do not.
pub(super) const ROUNDING_MM: f64 = 1.0e-9;
/// Steps to the time at which a ramp is at a place.
const STEPS_MAX: usize = 64;

/// The feed over a stretch.
#[derive(Clone, Debug, Default)]
pub struct FeedProfile {
    ramps: Vec<PlacedRamp>,
    time_s: f64,
}

/// A ramp or a cruise with its place on the path and in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedRamp {
    /// Where it starts \[mm\].
    pub start_mm: f64,
    /// When it starts \[s\].
    pub start_s: f64,
    /// The ramp over its length of path.
    pub planned: PlannedRamp,
}

impl FeedProfile {
    pub(super) fn new(planned: &[PlannedRamp]) -> Self {
        let (mut start_mm, mut time_s) = (0.0, 0.0);
        let mut ramps = Vec::with_capacity(planned.len());
        // Added up in f64: a stretch's positions are not exact, but what is compared with them is as long.
        for &planned in planned {
            let placed = PlacedRamp { start_mm, start_s: time_s, planned };
            start_mm += placed.length_mm();
            time_s += placed.time_s();
            ramps.push(placed);
        }
        Self { ramps, time_s }
    }

    /// Duration \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Feed \[mm/s\] and time \[s\] at `s_mm` from the stretch's start.
    #[must_use]
    pub fn at(&self, s_mm: f64) -> (f64, f64) {
        match self.ramps.get(self.index(s_mm)) {
            Some(placed) => placed.at(s_mm),
            None => (0.0, 0.0),
        }
    }

    /// The feeds at, between and at the end of two positions, and the time between them \[s\].
    #[must_use]
    pub fn over(&self, from_mm: f64, to_mm: f64) -> (BlockPlan<f64>, f64) {
        let ((enter_mm_s, start_s), (exit_mm_s, end_s)) = (self.at(from_mm), self.at(to_mm));
        let first = self.index(from_mm);
        // The feed has its extremes at the ends of ramps.
        let peak_mm_s = self
            .ramps
            .iter()
            .skip(first)
            .take_while(|placed| placed.start_mm + placed.length_mm() < to_mm + ROUNDING_MM)
            .map(|placed| placed.planned.ramp.to_mm_s)
            .fold(enter_mm_s.max(exit_mm_s), f64::max);
        (BlockPlan { enter_mm_s, peak_mm_s, exit_mm_s }, end_s - start_s)
    }

    /// The ramps, in path order.
    #[must_use]
    pub fn ramps(&self) -> &[PlacedRamp] {
        &self.ramps
    }

    /// The ramp that contains `s_mm`; at a junction, the one that ends there.
    fn index(&self, s_mm: f64) -> usize {
        self.ramps.partition_point(|placed| placed.start_mm + ROUNDING_MM < s_mm).saturating_sub(1)
    }
}

impl PlacedRamp {
    /// Its length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.planned.length.to_mm()
    }

    /// Its duration \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.planned.ramp.duration_s()
    }

    /// Feed \[mm/s\] and time \[s\] at `s_mm`, counted as its start.
    pub(super) fn at(&self, s_mm: f64) -> (f64, f64) {
        let (ramp, local_mm) = (self.planned.ramp, s_mm - self.start_mm);
        if local_mm <= ROUNDING_MM {
            return (ramp.from_mm_s, self.start_s);
        }
        if local_mm >= self.length_mm() - ROUNDING_MM {
            return (ramp.to_mm_s, self.start_s + self.time_s());
        }
        if ramp.is_cruise() {
            let feed = ramp.from_mm_s;
            return (feed, self.start_s + local_mm / feed);
        }
        // The position grows with time: Newton's method between two times, or the middle of these where its steps don't
        // halve: close to rest they get shorter by a quarter each.
        let (mut early_s, mut late_s) = (0.0, self.time_s());
        let mut time_s = late_s * (local_mm / self.length_mm());
        let mut step_before_s = late_s;
        let mut state = ramp.at(time_s);
        let rounding_mm = 2.0 * f64::EPSILON * self.length_mm();
        for _ in 0..STEPS_MAX {
            if (local_mm - state.s_mm).abs() <= rounding_mm {
                break;
            }
            if state.s_mm < local_mm {
                early_s = time_s
            } else {
                late_s = time_s
            }
            let step_s = (local_mm - state.s_mm) / state.v_mm_s;
            let is_good =
                (early_s..=late_s).contains(&(time_s + step_s)) && 2.0 * step_s.abs() <= step_before_s;
            let next_s = if is_good { time_s + step_s } else { f64::midpoint(early_s, late_s) };
            step_before_s = (next_s - time_s).abs();
            time_s = next_s;
            state = ramp.at(time_s);
            if step_before_s <= f64::EPSILON * time_s {
                break;
            }
        }
        (state.v_mm_s, self.start_s + time_s)
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::law::{Law, Limits, Pulse, Ramp};

    use super::*;

    /// Where a ramp is at a time it is at that time, close to rest and to its ends, too.
    #[test]
    fn a_place_has_its_time_and_feed() {
        let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
        for pulse in [Pulse::Sin2, Pulse::Plateau] {
            let law = Law::new(pulse, limits).expect("positive limits");
            for (from_mm_s, to_mm_s) in [(0.0, 50.0), (50.0, 0.0), (20.0, 20.5), (0.0, 1e-3), (300.0, 1.0)] {
                let ramp = Ramp::new(&law, from_mm_s, to_mm_s);
                let length = motion_kernel::units::Position::from_mm(ramp.length_mm()).expect("in range");
                let planned = PlannedRamp::new(&ramp, length, 0.0005).expect("a ramp");
                let placed = PlacedRamp { start_mm: 7.0, start_s: 3.0, planned };
                for part in (1..1000).map(|part| f64::from(part) / 1000.0) {
                    let time_s = part * placed.time_s();
                    let state = planned.ramp.at(time_s);
                    if state.s_mm <= ROUNDING_MM || state.s_mm >= placed.length_mm() - ROUNDING_MM {
                        continue;
                    }
                    let (feed_mm_s, at_s) = placed.at(7.0 + state.s_mm);
                    // What rounding of the place and of its time leaves.
                    let place_mm = 7.0 + placed.length_mm();
                    let rounding_s = 4.0 * f64::EPSILON * (place_mm / state.v_mm_s + 3.0 + placed.time_s());
                    assert!((at_s - 3.0 - time_s).abs() < rounding_s, "{part} {at_s}");
                    assert!(
                        (feed_mm_s - state.v_mm_s).abs() < 1e-12 + state.a_mm_s2.abs() * rounding_s,
                        "{part}"
                    );
                }
            }
        }
    }
}
