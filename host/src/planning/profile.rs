//! Feed and time at any path position of a planned stretch.

use motion_kernel::law::PlannedRamp;
use motion_kernel::plan::BlockPlan;

/// Positions closer than this are the same: ramps start and end on position steps, blocks do not.
pub(super) const ROUNDING_MM: f64 = 1.0e-9;

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
        // The position grows with time: halve until the time has its last digit.
        let (mut early, mut late) = (0.0, self.time_s());
        for _ in 0..64 {
            let middle = 0.5 * (early + late);
            if ramp.at(middle).s_mm < local_mm { early = middle } else { late = middle }
        }
        (ramp.at(late).v_mm_s, self.start_s + late)
    }
}
