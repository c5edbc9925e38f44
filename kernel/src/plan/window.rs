//! Planning with a bounded window: blocks are appended at one end, ramps and cruises leave at the other.
//!
//! Consumes blocks as they come; produces the same [`FeedSpan`]s as [`plan_spanning`]. However much there is still to
//! come, what is in the window is planned to a stop at its end, and of that plan only what lies further from the end
//! than one needs to stop is **committed**. A committed span never changes. The next plan begins with the feed at the
//! end of what is committed, where the feed rests (a = 0), and what was planned from there before is kept until there
//! is a new plan: so there always is one, and motion could always come to rest within the window.
//!
//! Where no plan with ramps that span blocks is found, or none that there is room for, one pair of ramps a block is tried.
//! From rest that always is a plan. From a feed it may not be one either: then motion goes on as planned before.
//!
//! A window of twice the stopping length loses little to a plan of the whole program; a shorter one is legal too, but
//! keeps stopping. A plan is made each time the window is full: where half of it leaves each time, every block is
//! planned about twice.

use super::lookahead::{Block, BlockPlan, PlanError, plan};
use super::spanning::{FeedSpan, Node, ROUNDING_MM, plan_spanning, spans_of};

/// Blocks on their way to be spans.
pub struct Window<'a> {
    blocks: &'a mut [Block<f64>],
    count: usize,
    /// Blocks that have left it.
    gone: usize,
    places: &'a mut [Node],
    plans: &'a mut [BlockPlan<f64>],
    spans: &'a mut [FeedSpan],
    /// How many of them are provisional, and cover the blocks of the window from its start to a stop.
    planned: usize,
    /// Where the window starts \[mm\], and with which feed \[mm/s\].
    start_mm: f64,
    feed_mm_s: f64,
}

/// Why a window does not go on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WindowError {
    /// A block cannot be planned; counted from the first that was appended.
    Plan(PlanError),
    /// No plan was found for what is in the window, from the feed at its start \[mm/s\].
    NoPlan {
        /// That feed.
        feed_mm_s: f64,
    },
    /// There is no place for a single block.
    NoPlaces,
    /// The plan has more spans than there are places.
    Spans {
        /// The places.
        places: usize,
    },
}

impl core::fmt::Display for WindowError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Plan(error) => error.fmt(f),
            Self::NoPlan { feed_mm_s } => write!(f, "no plan from {feed_mm_s} mm/s"),
            Self::NoPlaces => write!(f, "a window without places, expected room for a block"),
            Self::Spans { places } => write!(f, "more ramps and cruises than the {places} places for them"),
        }
    }
}

impl core::error::Error for WindowError {}

impl<'a> Window<'a> {
    /// A window that starts at rest, in the caller's memory: as many plans as `blocks`,
    /// [`nodes_for`](super::nodes_for) them nodes, and spans for two plans: four times as many as blocks are enough
    /// for most, six times as many for all.
    pub fn new(
        blocks: &'a mut [Block<f64>],
        places: &'a mut [Node],
        plans: &'a mut [BlockPlan<f64>],
        spans: &'a mut [FeedSpan],
    ) -> Self {
        Self { blocks, count: 0, gone: 0, places, plans, spans, planned: 0, start_mm: 0.0, feed_mm_s: 0.0 }
    }

    /// The same, starting with a feed \[mm/s\], from 0 to the first block's ceiling, and without acceleration. Whether one can
    /// stop from it within the window is seen when it is planned.
    #[must_use]
    pub fn starting_at(self, feed_mm_s: f64) -> Self {
        Self { feed_mm_s, ..self }
    }

    /// Appends a block; commits spans, to `put`, if the window is full.
    ///
    /// # Errors
    /// A block is out of range, or the window too small for what is in it. It is not used any further then.
    pub fn push(&mut self, block: Block<f64>, put: &mut impl FnMut(FeedSpan)) -> Result<(), WindowError> {
        if self.blocks.is_empty() {
            return Err(WindowError::NoPlaces);
        }
        while self.count == self.blocks.len() {
            self.plan(put)?;
            if self.planned == 0 {
                // Blocks of no length: there is nothing to drive.
                self.drop_blocks(self.count);
            }
            self.commit(put);
        }
        if let Some(place) = self.blocks.get_mut(self.count) {
            *place = block;
            self.count += 1;
        }
        Ok(())
    }

    /// Commits all that is left, up to a stop at the end.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn finish(&mut self, put: &mut impl FnMut(FeedSpan)) -> Result<(), WindowError> {
        self.plan(put)?;
        self.hand_on(self.planned, None, put);
        self.drop_blocks(self.count);
        Ok(())
    }

    fn in_window(&self) -> &[Block<f64>] {
        self.blocks.get(..self.count).unwrap_or(&[])
    }

    fn length_mm(&self) -> f64 {
        self.in_window().iter().map(|block| block.length_mm).sum()
    }

    /// Plans what is in the window, from the feed at its start to rest. If no plan is found, motion goes on as planned
    /// before for one more span, and it is tried from there: at the latest from rest.
    fn plan(&mut self, put: &mut impl FnMut(FeedSpan)) -> Result<(), WindowError> {
        loop {
            match self.plan_from_here() {
                Err(WindowError::NoPlan { .. } | WindowError::Spans { .. }) if self.planned > 0 => {
                    self.hand_on(1, None, put);
                }
                done => return done,
            }
        }
    }

    fn plan_from_here(&mut self) -> Result<(), WindowError> {
        let kept = self.planned;
        let mut room = Room { spans: self.spans.get_mut(kept..).unwrap_or(&mut []), made: 0 };
        let blocks = self.blocks.get(..self.count).unwrap_or(&[]);
        let gone = self.gone;
        let counted = |error| match error {
            PlanError::Block { block, quantity, value, range } => {
                WindowError::Plan(PlanError::Block { block: gone + block, quantity, value, range })
            }
            error => WindowError::Plan(error),
        };
        let found = plan_spanning(blocks, self.feed_mm_s, 0.0, self.places, &mut |span| room.put(span));
        if found.map_err(counted)?.is_none() || !room.is_enough() {
            room.made = 0;
            let plans = self.plans.get_mut(..self.count).unwrap_or(&mut []);
            match plan(blocks, self.feed_mm_s, 0.0, plans) {
                Err(PlanError::TooShortToBrake { .. }) => {
                    return Err(WindowError::NoPlan { feed_mm_s: self.feed_mm_s });
                }
                planned => planned.map_err(counted)?,
            }
            spans_of(blocks, plans, &mut |span| room.put(span));
        }
        if !room.is_enough() {
            return Err(WindowError::Spans { places: room.spans.len() });
        }
        let made = room.made;
        self.spans.copy_within(kept..kept + made, 0);
        self.planned = made;
        Ok(())
    }

    /// Hands on what lies further from the window's end than a stop takes; a cruise is divided there. If that is nothing,
    /// what begins in the first half: every turn is to bring the window on.
    fn commit(&mut self, put: &mut impl FnMut(FeedSpan)) {
        let stops = self.in_window().iter().map(|block| block.law.ramp_length_mm(0.0, block.cap_mm_s));
        let up_to_mm = self.length_mm() - stops.fold(0.0, f64::max);
        let spans = self.spans.get(..self.planned).unwrap_or(&[]);
        let whole = spans.partition_point(|span| span.start_mm + span.length_mm <= up_to_mm);
        let divided = spans.get(whole).filter(|span| span.ramp.is_cruise() && span.start_mm < up_to_mm);
        match divided {
            Some(_) => self.hand_on(whole, Some(up_to_mm), put),
            None if whole > 0 => self.hand_on(whole, None, put),
            None => {
                let half_mm = 0.5 * self.length_mm();
                let half = spans.partition_point(|span| span.start_mm < half_mm);
                self.hand_on(half.max(1), None, put);
            }
        }
    }

    /// Commits so many spans, and of the next one, a cruise, what lies before `divide_mm`.
    fn hand_on(&mut self, whole: usize, divide_mm: Option<f64>, put: &mut impl FnMut(FeedSpan)) {
        let whole = whole.min(self.planned);
        let mut gone_mm = 0.0;
        for span in self.spans.get(..whole).unwrap_or(&[]) {
            put(FeedSpan { start_mm: self.start_mm + span.start_mm, ..*span });
            (gone_mm, self.feed_mm_s) = (span.start_mm + span.length_mm, span.ramp.to_mm_s);
        }
        if let (Some(divide_mm), Some(span)) = (divide_mm, self.spans.get_mut(whole)) {
            let (start_mm, feed_mm_s) = (span.start_mm, span.ramp.from_mm_s);
            *span = FeedSpan::cruise(divide_mm, start_mm + span.length_mm, feed_mm_s);
            put(FeedSpan::cruise(self.start_mm + start_mm, self.start_mm + divide_mm, feed_mm_s));
            (gone_mm, self.feed_mm_s) = (divide_mm, feed_mm_s);
        }
        self.spans.copy_within(whole..self.planned, 0);
        self.planned -= whole;
        for span in self.spans.get_mut(..self.planned).unwrap_or(&mut []) {
            span.start_mm -= gone_mm;
        }
        self.drop_front(gone_mm);
    }

    /// Forgets the blocks up to `gone_mm`, and the part of one.
    fn drop_front(&mut self, gone_mm: f64) {
        self.start_mm += gone_mm;
        let (mut end_mm, mut gone) = (0.0, 0);
        for block in self.blocks.get_mut(..self.count).unwrap_or(&mut []) {
            end_mm += block.length_mm;
            // What is left of a block after rounding belongs to the next one.
            if end_mm > gone_mm + ROUNDING_MM {
                block.length_mm = end_mm - gone_mm;
                break;
            }
            gone += 1;
        }
        self.drop_blocks(gone);
    }

    fn drop_blocks(&mut self, gone: usize) {
        self.blocks.copy_within(gone..self.count, 0);
        self.count -= gone;
        self.gone += gone;
    }
}

/// Where the spans of a new plan go, behind those of the plan before.
struct Room<'a> {
    spans: &'a mut [FeedSpan],
    /// How many there are, or would be.
    made: usize,
}

impl Room<'_> {
    fn put(&mut self, span: FeedSpan) {
        if let Some(place) = self.spans.get_mut(self.made) {
            *place = span;
        }
        self.made += 1;
    }

    fn is_enough(&self) -> bool {
        self.made <= self.spans.len()
    }
}
