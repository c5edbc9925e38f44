//! Feed and time at any path position of a planned stretch.

use motion_kernel::law::Ramp;
use motion_kernel::plan::BlockPlan;

use super::FeedRecord;
use super::lookahead::PlannedSegment;

/// Positions closer than this are the same: segments start and end on position steps, blocks do not.
const ROUNDING_MM: f64 = 1.0e-9;

/// The feed over a stretch.
#[derive(Clone, Debug, Default)]
pub struct FeedProfile {
    spans: Vec<Span>,
    time_s: f64,
}

/// One segment, with its place on the path and in time.
#[derive(Clone, Copy, Debug)]
struct Span {
    start_mm: f64,
    length_mm: f64,
    start_s: f64,
    time_s: f64,
    ramp: Ramp<f64>,
}

impl FeedProfile {
    pub(super) fn new(planned: &[PlannedSegment]) -> Self {
        let (mut start_mm, mut time_s) = (0.0, 0.0);
        let mut spans = Vec::with_capacity(planned.len());
        // Added up in f64: a stretch's positions are not exact, but what is compared with them is as long.
        for segment in planned {
            let (length_mm, ramp) = (segment.length.to_mm(), segment.ramp);
            spans.push(Span { start_mm, length_mm, start_s: time_s, time_s: ramp.duration_s(), ramp });
            start_mm += length_mm;
            time_s += ramp.duration_s();
        }
        Self { spans, time_s }
    }

    /// Duration \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Feed \[mm/s\] and time \[s\] at `s_mm` from the stretch's start.
    #[must_use]
    pub fn at(&self, s_mm: f64) -> (f64, f64) {
        match self.spans.get(self.index(s_mm)) {
            Some(span) => span.at(s_mm),
            None => (0.0, 0.0),
        }
    }

    /// The feeds at, between and at the end of two positions, and the time between them \[s\].
    #[must_use]
    pub fn over(&self, from_mm: f64, to_mm: f64) -> (BlockPlan<f64>, f64) {
        let ((enter_mm_s, start_s), (exit_mm_s, end_s)) = (self.at(from_mm), self.at(to_mm));
        let first = self.index(from_mm);
        // The feed has its extremes at the ends of segments.
        let peak_mm_s = self
            .spans
            .iter()
            .skip(first)
            .take_while(|span| span.start_mm + span.length_mm < to_mm + ROUNDING_MM)
            .map(|span| span.ramp.to_mm_s)
            .fold(enter_mm_s.max(exit_mm_s), f64::max);
        (BlockPlan { enter_mm_s, peak_mm_s, exit_mm_s }, end_s - start_s)
    }

    /// The segments, for a stretch that starts at `start_mm` of the program.
    pub(super) fn records(&self, start_mm: f64) -> Vec<FeedRecord> {
        let record = |span: &Span| FeedRecord {
            start_mm: start_mm + span.start_mm,
            length_mm: span.length_mm,
            from_mm_s: span.ramp.from_mm_s,
            to_mm_s: span.ramp.to_mm_s,
            peak_jerk_mm_s3: span.ramp.peak_jerk_mm_s3,
            t1_s: span.ramp.t1_s,
            t2_s: span.ramp.t2_s,
            time_s: span.time_s,
        };
        self.spans.iter().map(record).collect()
    }

    /// The span that contains `s_mm`; at a junction, the one that ends there.
    fn index(&self, s_mm: f64) -> usize {
        self.spans.partition_point(|span| span.start_mm + ROUNDING_MM < s_mm).saturating_sub(1)
    }
}

impl Span {
    fn at(&self, s_mm: f64) -> (f64, f64) {
        let local_mm = s_mm - self.start_mm;
        if local_mm <= ROUNDING_MM {
            return (self.ramp.from_mm_s, self.start_s);
        }
        if local_mm >= self.length_mm - ROUNDING_MM {
            return (self.ramp.to_mm_s, self.start_s + self.time_s);
        }
        if self.ramp.is_cruise() {
            let feed = self.ramp.from_mm_s;
            return (feed, self.start_s + local_mm / feed);
        }
        // The position grows with time: halve until the time has its last digit.
        let (mut early, mut late) = (0.0, self.time_s);
        for _ in 0..64 {
            let middle = 0.5 * (early + late);
            if self.ramp.at(middle).s_mm < local_mm { early = middle } else { late = middle }
        }
        (self.ramp.at(late).v_mm_s, self.start_s + late)
    }
}
