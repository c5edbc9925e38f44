//! Where another list may take over from the one under way.
//!
//! Consumes the list under way and the tick's progress; produces the places that a command may use, in order
//! of time: here or within the item under way, then after each item still to be driven. Background.

use super::list::{Item, List};
use super::splice::Splice;
use crate::law::{Phase, Ticks};
use crate::queue::Progress;

/// Where a list takes over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Takeover {
    /// After this many items of the list under way.
    After(usize),
    /// Within the item after this many: the new list's first item repeats that item with another end.
    Within(usize),
}

impl Takeover {
    /// Number of items of the list under way that are driven whole.
    pub(super) fn driven(self) -> usize {
        match self {
            Self::After(count) | Self::Within(count) => count,
        }
    }
}

/// Where a command may take over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    takeover: Takeover,
    start: Splice,
    head: Option<Item>,
    /// The phase of the item under way, and the time in it, at which it is left.
    since: Option<(Phase, Ticks)>,
}

impl Place {
    pub(super) fn takeover(&self) -> Takeover {
        self.takeover
    }

    /// Where the list that takes over begins.
    pub(super) fn start(&self) -> &Splice {
        &self.start
    }

    /// The phase of the item under way, and the time in it, at which it is left.
    pub(super) fn since(&self) -> Option<(Phase, Ticks)> {
        self.since
    }

    /// The splice from which it may do something else.
    pub(super) fn splice(&self, tick_s: f64) -> Splice {
        self.head.map_or(self.start, |head| head.end(&self.start, tick_s))
    }

    /// Restarts a list with the cut item under way, if there is one, and nothing else.
    pub(super) fn begin(&self, list: &mut List) {
        list.restart(self.start);
        if let Some(head) = self.head {
            list.push(head);
        }
    }
}

/// The places in a list.
#[derive(Clone, Debug)]
pub(super) struct Places<'a> {
    list: &'a List,
    /// A later cut of the item under way, tried before `first`.
    later: Option<Place>,
    first: Option<Place>,
    /// The next place is after this many items.
    count: usize,
}

impl<'a> Places<'a> {
    /// The places where `list` may be left, with motion at `progress`. Items are cut no sooner than `lead`
    /// after that.
    pub(super) fn new(list: &'a List, progress: &Progress, lead: Ticks, tick_s: f64) -> Self {
        let done = progress.done as usize;
        let mut places = Self { list, later: None, first: None, count: done + 1 };
        places.first = match progress.inside {
            Some((phase, left)) => places.within(done, phase, left, lead, tick_s),
            None => Some(places.after(done)),
        };
        places
    }

    /// The list under way.
    pub(super) fn list(&self) -> &'a List {
        self.list
    }

    /// The item under way, if it can be cut.
    pub(super) fn inside(&self) -> Option<(&'a Splice, &'a Item, &Place)> {
        let place = self.first.as_ref()?;
        let Takeover::Within(done) = place.takeover else { return None };
        let (start, item) = self.list.get(done)?;
        Some((start, item, place))
    }

    /// Adds `head`, a later cut of the item under way, which is tried before the soonest one.
    pub(super) fn with_head(self, head: Item) -> Self {
        let later = self.first.map(|first| Place { head: Some(head), ..first });
        Self { later, ..self }
    }

    fn after(&self, count: usize) -> Place {
        Place { takeover: Takeover::After(count), start: self.list.after(count), head: None, since: None }
    }

    /// Within the item under way, cut as soon as possible.
    fn within(&self, done: usize, phase: Phase, left: Ticks, lead: Ticks, tick_s: f64) -> Option<Place> {
        let (start, item) = self.list.get(done)?;
        let duration = item.phase_duration(phase, tick_s)?;
        // Not at its very start: there is no beginning to repeat yet.
        let lead = if left >= duration { lead.max(Ticks::ONE) } else { lead };
        let elapsed = duration.minus(left)?.plus(lead);
        // The rise may be over by then, and the hold under way.
        let (phase, elapsed) = match elapsed.minus(duration) {
            Some(over) if phase == Phase::Rise && over > Ticks::ZERO => (Phase::Hold, over),
            _ => (phase, elapsed),
        };
        if elapsed > item.phase_duration(phase, tick_s)? {
            return None;
        }
        let head = item.cut(phase, elapsed, tick_s)?;
        let since = Some((phase, elapsed));
        Some(Place { takeover: Takeover::Within(done), start: *start, head: Some(head), since })
    }
}

impl Iterator for Places<'_> {
    type Item = Place;

    fn next(&mut self) -> Option<Place> {
        if let Some(place) = self.later.take().or_else(|| self.first.take()) {
            return Some(place);
        }
        let count = self.count;
        self.count += 1;
        (count <= self.list.exit()).then(|| self.after(count))
    }
}
