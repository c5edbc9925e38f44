//! What follows what: reads items, obeys commands, makes lists and hands them over.

use core::task::Poll;

use heapless::Deque;

use super::block_ends::{BlockEnd, BlockEnds};
use super::list::{Item as ListItem, LIST_ITEMS, List};
use super::replan::Ramps;
use super::road::{Road, Splice, is_before};
use super::source::Source;
use crate::law::{FeedSegment, PlannedRamp, Ticks};
use crate::num::Real;
use crate::program::supply::{Ready, is_taken};
use crate::program::{Item, SupplyError};
use crate::queue::{Change, Density, LiveFeeder, Progress, Rejection};
use crate::units::Position;

/// What live control is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Going on as long as there are items.
    Running,
    /// Told to hold, and not at rest yet.
    Holding,
    /// Held, at rest.
    Held,
    /// Told to give up, and not at rest yet.
    Aborting,
    /// Given up, at rest: stand here and split the streams anew.
    Aborted,
    /// Everything that came so far is done, at rest and between two stretches; the source has no more for now.
    Waiting,
    /// Everything is done.
    Done,
    /// An item can't be executed; at rest behind what came before it.
    Failed,
}

/// What a command asks of the motion under way, until a list for it has been handed over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    /// Come to rest.
    Stop,
    /// Go on under another override.
    Respeed,
}

/// A list that the tick has or will have.
#[derive(Debug)]
pub(super) struct Handed {
    id: u8,
    pub(super) list: List,
    /// Of what is driven before it.
    before: Density,
}

/// A list that follows.
#[derive(Debug)]
struct Next {
    handed: Handed,
    /// Items that it takes back from the list before it, at the front of the course.
    taken_back: usize,
    /// What it was made for, if that was a command.
    command: Option<Wanted>,
    /// The override of the motion before it.
    before_override: f64,
}

/// The background of live control, with room for `PLACES` blocks and as many planned ramps.
#[derive(Debug)]
pub struct LiveControl<R: Real, const AXES: usize, I, E, const PLACES: usize> {
    items: I,
    pub(super) tick_s: f64,
    pending: Option<Ready<R, AXES>>,
    /// There is no room for the next item.
    is_full: bool,
    is_at_end: bool,
    /// The source had nothing when it was asked last.
    is_late: bool,
    error: Option<SupplyError<E>>,
    /// The stretch being read, and the path of it that is queued.
    reading: u32,
    path_end: Position,
    pub(super) road: Road<PLACES>,
    pub(super) ends: BlockEnds<PLACES>,
    /// The program's own feed from `ahead` on; of a stretch that is planned anew only its end.
    pub(super) course: Deque<ListItem, PLACES>,
    /// Where the next list begins.
    pub(super) ahead: Splice,
    /// The last stretch that is planned anew; those before it are, too, as far as they are still ahead.
    replanned: Option<u32>,
    pub(super) current: Handed,
    next: Option<Next>,
    pub(super) feed_override: f64,
    /// The one of the motion that was handed over last.
    pub(super) driven_override: f64,
    pub(super) is_held: bool,
    is_aborted: bool,
    pub(super) is_single: bool,
    /// Where single block is to come to rest within a stretch; no plan goes beyond it.
    pub(super) block_end: Option<BlockEnd>,
    /// Where it was held last.
    pub(super) held_at: Option<Splice>,
    wanted: Option<Wanted>,
    /// How far ahead of where the tick was seen a ramp is given up.
    pub(super) lead: Ticks,
    starvations: u32,
}

/// The greatest feed override.
pub const OVERRIDE_MAX: f64 = 2.0;
/// The least that is not 0.
pub const OVERRIDE_MIN: f64 = 1.0e-3;
/// A list that can't be begun or filled is a machine that was put together wrongly.
const TOO_SMALL: Rejection = Rejection::Empty;
/// A ramp is given up at most so many ticks ahead.
const LEAD_TICKS_MAX: u64 = 64;

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, I, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// All of `items` still to do, at rest, for ticks of `tick_s`; with freshly split streams. Where ticks come while the
    /// background works, `lead_ticks` is how far ahead of what it saw it may change a ramp: as many as may pass meanwhile.
    pub fn new(items: I, tick_s: f64, lead_ticks: u32) -> Self {
        const { assert!(PLACES >= 4 * LIST_ITEMS, "places for what lies ahead, and for a list that is given up") };
        let start = Splice { stretch: 0, at: Position::ZERO, feed_mm_s: 0.0 };
        Self {
            items,
            tick_s,
            pending: None,
            is_full: false,
            is_at_end: false,
            is_late: false,
            error: None,
            reading: 0,
            path_end: Position::ZERO,
            road: Road::new(),
            ends: BlockEnds::new(),
            course: Deque::new(),
            ahead: start,
            replanned: None,
            current: Handed { id: 0, list: List::new(start, tick_s), before: Density::NONE },
            next: None,
            feed_override: 1.0,
            driven_override: 1.0,
            is_held: false,
            is_aborted: false,
            is_single: false,
            block_end: None,
            held_at: None,
            wanted: None,
            lead: Ticks::from_bits(u64::from(lead_ticks) << 32),
            starvations: 0,
        }
    }

    /// Feed hold: comes to rest on the path as soon as the law and the ceilings allow.
    pub fn hold(&mut self) {
        if !self.is_held {
            (self.is_held, self.wanted) = (true, Some(Wanted::Stop));
        }
    }

    /// Goes on after a hold, from rest; also one that is not at rest yet.
    pub fn resume(&mut self) {
        if self.is_held && !self.is_aborted {
            self.is_held = false;
            // A stop that is not handed over yet is not made; the override may be another one by now.
            self.wanted = self.wanted.map(|_| self.wanted_by_override());
        }
    }

    /// Comes to rest on the path and gives up the rest of the program.
    pub fn abort(&mut self) {
        self.hold();
        self.is_aborted = true;
    }

    fn wanted_by_override(&self) -> Wanted {
        if self.feed_override > 0.0 { Wanted::Respeed } else { Wanted::Stop }
    }

    /// Drives at `feed_override` times the program's feed, from [`OVERRIDE_MIN`] to [`OVERRIDE_MAX`], under all ceilings;
    /// 0 is a hold of its own.
    ///
    /// # Errors
    /// It is not within that range; the value.
    pub fn set_override(&mut self, feed_override: f64) -> Result<(), f64> {
        if feed_override != 0.0 && !(OVERRIDE_MIN..=OVERRIDE_MAX).contains(&feed_override) {
            return Err(feed_override);
        }
        if feed_override != self.feed_override {
            self.feed_override = feed_override;
            self.go_on_anew();
        }
        Ok(())
    }

    /// What motion goes on to is another, if it goes on.
    pub(super) fn go_on_anew(&mut self) {
        if !self.is_held {
            self.wanted = Some(self.wanted_by_override());
        }
    }

    /// Where items come from, for a source that is to be told something. What was read of it is under way.
    pub fn source_mut(&mut self) -> &mut I {
        &mut self.items
    }

    /// How often motion had to stop because data came too late.
    pub fn starvations(&self) -> u32 {
        self.starvations
    }

    /// Whether it is at rest because the override is 0.
    pub fn is_stopped_by_override(&self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        self.feed_override <= 0.0 && self.rests(feeder)
    }

    /// Whether all that was handed over has been driven, and nothing is wanted of it.
    pub(super) fn rests(&self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        let progress = feeder.progress();
        progress.list == self.current.id
            && self.next.is_none()
            && progress.inside.is_none()
            && !progress.waits
            && progress.done as usize >= self.current.list.len()
            && self.wanted.is_none()
    }

    /// Whether there is nothing more to come.
    pub(super) fn is_read(&self) -> bool {
        self.is_at_end && self.pending.is_none() && self.course.is_empty()
    }

    /// Whether nothing is left of what came, up to the end of a stretch.
    fn is_waiting(&self) -> bool {
        self.is_late
            && self.pending.is_none()
            && self.course.is_empty()
            && self.ahead.at == Position::ZERO
            && self.path_end == Position::ZERO
            && self.road.end_of(self.reading).is_none_or(|end| end == Position::ZERO)
    }

    /// What it is doing.
    pub fn state(&self, feeder: &LiveFeeder<'_, R, AXES>) -> State {
        let rests = self.rests(feeder);
        if rests && self.error.is_some() {
            return State::Failed;
        }
        match (self.is_aborted, self.is_held) {
            (true, _) if rests => State::Aborted,
            (true, _) => State::Aborting,
            (false, true) if rests => State::Held,
            (false, true) => State::Holding,
            (false, false) if rests && self.is_read() && self.ahead.at == Position::ZERO => State::Done,
            (false, false) if rests && self.is_waiting() => State::Waiting,
            (false, false) => State::Running,
        }
    }

    /// One turn of the background: reads what there is room for, obeys what was commanded, hands over what follows. A fault
    /// that ends in a stop on the path is obeyed as a hold that is not resumed.
    ///
    /// # Errors
    /// An item can't be executed. Nothing is read any more, every later call returns the same error, and what was handed
    /// over ends at rest; a hold or an abort is still obeyed, but for one that itself can't be.
    pub fn poll(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        self.turn_on(feeder).unwrap_or_else(|error| {
            self.error.get_or_insert(error);
        });
        match &self.error {
            None => Ok(()),
            Some(error) => Err(error.clone()),
        }
    }

    fn turn_on(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        if feeder.is_stop_wanted() {
            self.hold();
        }
        if feeder.is_refused() {
            // The tick had passed the place: once more, further ahead.
            if self.lead.to_bits() < LEAD_TICKS_MAX << 32 {
                self.lead = self.lead.plus(Ticks::ONE);
            }
            let command = self.next.as_ref().and_then(|next| next.command);
            self.take_back_next(feeder);
            self.wanted = self.wanted.or(command);
        }
        let progress = self.follow(feeder);
        self.note_rest(feeder);
        let place = self.current.list.after(progress.done as usize);
        self.road.pass(place.stretch, place.at);
        self.ends.pass(feeder.path_queued());
        let read = if self.error.is_none() { self.read(feeder) } else { Ok(()) };
        if let Some(wanted) = self.wanted
            && feeder.has_free_list()
        {
            let progress = self.take_back_next(feeder);
            // What was taken back may have been the last free one.
            if feeder.has_free_list() {
                self.obey(wanted, &progress, feeder)?;
            }
        }
        read?;
        self.note_starvation(feeder);
        let is_to_rest = self.is_held || self.feed_override <= 0.0 || self.error.is_some();
        if self.next.is_none()
            && !is_to_rest
            && self.wanted.is_none()
            && feeder.has_free_list()
            && !self.waits_behind_block(feeder)
        {
            self.go_on(feeder)?;
        }
        Ok(())
    }

    /// Hands over what is wanted of motion that is as far as `progress` says.
    fn obey(
        &mut self,
        wanted: Wanted,
        progress: &Progress,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        let obeyed = match wanted {
            Wanted::Stop => self.stop(progress, feeder),
            Wanted::Respeed => self.respeed(progress, feeder),
        };
        // What can't be done now can't be done in the next turn either: motion ends at rest without.
        self.wanted = None;
        obeyed?;
        if let Some(next) = &mut self.next {
            next.command = Some(wanted);
        }
        Ok(())
    }

    /// Where the tick is; the list that follows is the one under way as soon as it is on it.
    fn follow(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Progress {
        let progress = feeder.progress();
        if let Some(next) = self.next.take_if(|next| next.handed.id == progress.list) {
            feeder.give_up(self.current.id);
            self.current = next.handed;
        }
        progress
    }

    /// Gives up the list that follows; what it holds is ahead again. What the tick does in between counts.
    fn take_back_next(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Progress {
        feeder.no_change();
        let progress = self.follow(feeder);
        if let Some(Next { handed: Handed { id, list, .. }, taken_back, before_override, .. }) =
            self.next.take()
        {
            feeder.give_up(id);
            self.driven_override = before_override;
            for _ in 0..taken_back {
                self.course.pop_front();
            }
            // The list under way goes on to where it is left.
            self.ahead = self.current.list.after(self.current.list.leave);
            self.put_back(&list, list.len() - list.leave, 0);
        }
        progress
    }

    /// Puts the items of a list from `from` on in front of the course, but for its last `without`. Feed that was planned
    /// anew is planned anew again.
    pub(super) fn put_back(&mut self, list: &List, without: usize, from: usize) {
        let is_replanned = self.replans(list.start.stretch);
        for item in list.back_to(from).skip(without) {
            if !(is_replanned && item.is_feed()) {
                // There is room: reading leaves as much as a list holds.
                let _ = self.course.push_front(*item);
            }
        }
    }

    /// Reads items while there is room for them.
    fn read(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        loop {
            let answer = match &self.pending {
                Some(Ready::Piece(piece)) => {
                    let end = self.path_end + piece.length();
                    let fastest_mm_s = self.road.fastest_mm_s(self.reading, self.path_end, end);
                    let fastest_mm_s = fastest_mm_s.ok_or(SupplyError::Rejected(Rejection::NoBlock))?;
                    is_taken(feeder.piece(*piece, fastest_mm_s)).inspect(|&taken| {
                        if taken {
                            self.ends.piece(self.reading, self.path_end, piece.program_line());
                            self.path_end = end;
                        }
                    })
                }
                Some(Ready::EndOfStretch(end)) => is_taken(feeder.end_of_path(*end)).inspect(|&taken| {
                    if taken {
                        let _ = self.course.push_back(ListItem::End);
                        self.ends.end_of_stretch();
                        (self.reading, self.path_end) = (self.reading.wrapping_add(1), Position::ZERO);
                    }
                }),
                Some(Ready::Segment(_) | Ready::Dwell(_) | Ready::Stop | Ready::Block) | None => Ok(true),
            };
            self.is_full = !answer.map_err(SupplyError::Rejected)?;
            if self.is_full {
                return Ok(());
            }
            self.pending = None;
            self.is_full =
                self.course.len() + 2 * LIST_ITEMS >= PLACES || self.road.is_full() || self.ends.is_full();
            if self.is_full || self.is_aborted || self.is_at_end {
                return Ok(());
            }
            let polled = self.items.poll_next();
            self.is_late = polled.is_pending();
            match polled {
                Poll::Ready(Some(item)) => self.take(item.map_err(SupplyError::Source)?)?,
                Poll::Ready(None) => self.is_at_end = true,
                Poll::Pending => return Ok(()),
            }
        }
    }

    fn take(&mut self, item: Item<AXES>) -> Result<(), SupplyError<E>> {
        let planned = match item {
            Item::Block(block) => {
                self.road.push(self.reading, block.within_range::<R>());
                return Ok(());
            }
            Item::Line { .. } | Item::Septic { .. } | Item::EndOfStretch(_) => {
                if let Item::EndOfStretch(_) = item {
                    self.check_blocks()?;
                }
                self.pending = Some(item.ready(self.tick_s)?);
                return Ok(());
            }
            Item::Feed(_) if self.replans(self.reading) => return Ok(()),
            Item::Feed(PlannedRamp { ramp, length }) => ListItem::Feed { ramp, length },
            Item::Dwell(duration) => ListItem::Dwell(duration),
            Item::Stop => ListItem::Stop,
        };
        let _ = self.course.push_back(planned);
        Ok(())
    }

    /// The blocks of the stretch that has been read end where its path does: plans go by the blocks.
    fn check_blocks(&self) -> Result<(), SupplyError<E>> {
        let (path, blocks) = (self.path_end, self.road.end_of(self.reading).unwrap_or(Position::ZERO));
        if blocks == path {
            return Ok(());
        }
        let (blocks_mm, path_mm) = (blocks.to_mm(), path.to_mm());
        Err(SupplyError::Rejected(Rejection::Blocks { blocks_mm, path_mm }))
    }

    /// How far the path of a stretch is queued, and whether that is all of it; not beyond the block end to rest at.
    pub(super) fn path_of(&self, stretch: u32) -> (Position, bool) {
        if let Some(BlockEnd { at, .. }) = self.block_end.filter(|end| end.stretch == stretch) {
            (at, false)
        } else if stretch == self.reading {
            (self.path_end, false)
        } else {
            (self.road.end_of(stretch).unwrap_or(Position::ZERO), true)
        }
    }

    /// Whether a stretch is planned anew.
    fn replans(&self, stretch: u32) -> bool {
        self.replanned.is_some_and(|last| !is_before(last, stretch))
    }

    /// From now on the stretches up to this one are planned anew.
    pub(super) fn replan_through(&mut self, stretch: u32) {
        if !self.replans(stretch) {
            self.replanned = Some(stretch);
        }
    }

    /// What follows begins at `ahead`, and the rest of its stretch is planned anew.
    pub(super) fn replan_from(&mut self, ahead: Splice) {
        self.ahead = ahead;
        self.replan_through(ahead.stretch);
        self.drop_feed();
    }

    /// What comes first in the course is planned anew.
    pub(super) fn drop_feed(&mut self) {
        while self.course.front().is_some_and(ListItem::is_feed) {
            self.course.pop_front();
        }
    }

    /// Where data came too late the list under way is in its stop: what follows begins there. A stop where the stretch ends
    /// is none: motion was to end there.
    fn note_starvation(&mut self, feeder: &LiveFeeder<'_, R, AXES>) {
        let progress = feeder.progress();
        let Handed { id, list, .. } = &mut self.current;
        let done = progress.done as usize;
        let is_in_stop = done > list.leave || done == list.leave && progress.inside.is_some();
        if self.next.is_none() && progress.list == *id && is_in_stop && list.leave < list.len() {
            list.leave = list.len();
            let end = list.end();
            let (path_end, is_whole) = self.path_of(end.stretch);
            if !(is_whole && end.at == path_end) {
                self.starvations = self.starvations.wrapping_add(1);
            }
            self.replan_from(end);
        }
    }

    /// Hands over the list that follows the one under way.
    fn go_on(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        self.block_end = None;
        let begins = self.ahead.at == Position::ZERO && !self.course.is_empty();
        if begins && (self.is_single || self.feed_override != 1.0) {
            self.replan_from(self.ahead);
        }
        if self.replans(self.ahead.stretch) {
            return self.go_on_replanned(begins, feeder);
        }
        let mut list = List::new(self.ahead, self.tick_s);
        let is_found = self.gather(&mut list);
        // At rest with no room for more path: the program's feed needs more of it to stop than there will be.
        if !self.hand_over_ended(list, is_found, 1.0, feeder)? && self.is_full && self.ahead.feed_mm_s <= 0.0
        {
            self.replan_from(self.ahead);
        }
        Ok(())
    }

    /// Hands over the list that follows, planned anew, if there is one.
    fn go_on_replanned(
        &mut self,
        begins: bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        for ramps in Ramps::IN_ORDER {
            self.block_end = None;
            let mut list = List::new(self.ahead, self.tick_s);
            let is_found = if self.is_single && begins && self.course.front().is_some_and(ListItem::is_rest) {
                // By itself: it is a block.
                self.gather_rests(&mut list);
                true
            } else if self.is_single {
                self.gather_block(&mut list, ramps)
            } else {
                self.gather_under_override(&mut list, true, ramps)
            };
            if self.hand_over_ended(list, is_found, self.feed_override, feeder)? || !is_found {
                break;
            }
        }
        Ok(())
    }

    /// Hands over a list that was found, ended at rest, behind the one under way; otherwise what it holds is ahead again.
    fn hand_over_ended(
        &mut self,
        mut list: List,
        is_found: bool,
        feed_override: f64,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<bool, SupplyError<E>> {
        let change = self.change_after(self.current.list.leave);
        let is_ended = is_found && self.end_in_a_stop(&mut list, feed_override);
        // From rest there is no other place to begin: what is too dense then is refused.
        if is_ended && (self.ahead.feed_mm_s <= 0.0 || self.keeps_up(&list, &change)) {
            return self.hand_over(list, change, feed_override, feeder).map(|()| true);
        }
        let stop = if is_ended { list.len() - list.leave } else { 0 };
        self.put_back(&list, stop, 0);
        Ok(false)
    }

    /// A change after so many items of the list under way.
    pub(super) fn change_after(&self, count: usize) -> Change {
        Change { from: self.current.id, to: self.current.id, after: count as u32, within: false }
    }

    /// The density of the list under way up to a change.
    fn density_before(&self, change: &Change) -> Density {
        let Handed { list, before, .. } = &self.current;
        let mut density = *before;
        for item in list.items().take(change.after as usize) {
            if let Some(duration) = item.duration(self.tick_s) {
                // It has been accepted.
                let _ = density.follow(duration);
            }
        }
        density
    }

    /// Whether the executor keeps up with a list that takes over there.
    pub(super) fn keeps_up(&self, list: &List, change: &Change) -> bool {
        let mut density = self.density_before(change);
        let mut durations = list.items().filter_map(|item| item.duration(self.tick_s));
        durations.all(|duration| density.follow(duration).is_ok())
    }

    /// Fills a list, of which there is a free one, with motion under `feed_override`, and asks for the change to it.
    pub(super) fn hand_over(
        &mut self,
        list: List,
        change: Change,
        feed_override: f64,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        let (from, before) = (R::from_f64(list.start.feed_mm_s), self.density_before(&change));
        let id = feeder.begin(list.start.at, from, before).ok_or(SupplyError::Rejected(TOO_SMALL))?;
        let change = Change { to: id, ..change };
        let is_asked =
            self.fill(&list, id, feeder).and_then(|()| feeder.change(change).map_err(SupplyError::Rejected));
        if let Err(error) = is_asked {
            feeder.give_up(id);
            return Err(error);
        }
        self.ahead = list.after(list.leave);
        let before_override = core::mem::replace(&mut self.driven_override, feed_override);
        let handed = Handed { id, list, before };
        self.next = Some(Next { handed, taken_back: 0, command: None, before_override });
        Ok(())
    }

    fn fill(&self, list: &List, id: u8, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        for (start, item) in list.placed() {
            let is_taken = match *item {
                ListItem::Feed { ramp, length } => {
                    let segment = FeedSegment::ramp(&ramp, length, self.tick_s);
                    is_taken(feeder.segment(id, segment.map_err(SupplyError::Segment)?))
                }
                ListItem::Turned { ramp, at, length } => {
                    let segment = FeedSegment::cut(&ramp, at, length, self.tick_s);
                    is_taken(feeder.segment(id, segment.map_err(SupplyError::Segment)?))
                }
                ListItem::End => {
                    // Where all its blocks have been passed, its end has.
                    let path = self.road.end_of(start.stretch).unwrap_or(start.at);
                    is_taken(feeder.end_of_feed(id, path))
                }
                ListItem::Dwell(duration) => is_taken(feeder.dwell(id, duration)),
                ListItem::Stop => is_taken(feeder.program_stop(id)),
            };
            if !is_taken.map_err(SupplyError::Rejected)? {
                return Err(SupplyError::Rejected(TOO_SMALL));
            }
        }
        Ok(())
    }

    /// The list that follows takes the place of the items of the one under way from `from` on: what ends their stretch,
    /// and what comes behind it, is ahead again; of a stretch that is not planned anew, its feed too.
    pub(super) fn take_back_from(&mut self, from: usize) {
        let mut count = 0;
        let list = &self.current.list;
        let keeps_feed = !self.replans(list.start.stretch);
        for item in list.back_to(from).skip(list.len() - list.leave.min(list.len())) {
            if keeps_feed || !item.is_feed() {
                let _ = self.course.push_front(*item);
                count += 1;
            }
        }
        if let Some(next) = &mut self.next {
            next.taken_back = count;
        }
    }

    /// Hands over a list without anything: at rest behind so many items of the list under way, nothing more of it is to
    /// follow. It is ahead again.
    pub(super) fn rest_behind(
        &mut self,
        done: usize,
        ends_block: bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        let place = self.current.list.after(done);
        let change = self.change_after(done);
        let mut list = List::new(place, self.tick_s);
        list.ends_block = ends_block;
        self.hand_over(list, change, self.driven_override, feeder)?;
        self.take_back_from(done);
        self.ahead = place;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::*;
    use crate::exec::Executor;
    use crate::fixture::{self, LIMITS};
    use crate::law::{Law, Limits, Ramp};
    use crate::num::Fixed;
    use crate::program::{Allowed, PathBlock};
    use crate::queue::{LiveStreams, PathRules};
    use crate::straight::Straight;

    const TICK_S: f64 = 0.0005;

    fn at(mm: f64) -> Position {
        Position::from_mm(mm).expect("in range")
    }

    const RULES: PathRules = PathRules { feed_mm_s: 20.0, ..fixture::RULES };

    /// A hundred millimetres of cruise between two ramps, on a block that is so much longer.
    fn line(longer: Position) -> [Item<1>; 6] {
        let up = Ramp::new(&Law::new(LIMITS).expect("limits"), 0.0, 20.0);
        let (ramp, cruise) = (at(up.length_mm()), at(100.0));
        let whole = ramp + cruise + ramp;
        let allowed = Allowed { cap_mm_s: 20.0, limits: LIMITS };
        let line = Item::Line { line: 1, start: [Position::ZERO], direction: [1.0], length: whole };
        [
            Item::Block(PathBlock::new(whole + longer, 20.0, allowed, allowed, 0.0)),
            line,
            Item::Feed(PlannedRamp { ramp: up, length: ramp }),
            Item::Feed(PlannedRamp { ramp: Ramp::cruise(20.0, 5.0), length: cruise }),
            Item::Feed(PlannedRamp { ramp: up.reversed(), length: ramp }),
            Item::EndOfStretch([whole]),
        ]
    }

    /// Ticks that come between the background's look and its word make it too late: the command is made again, from where
    /// motion is by then.
    #[test]
    fn a_refused_command_is_made_again() {
        let items = line(Position::ZERO);
        let ramp_s = Ramp::new(&Law::new(LIMITS).expect("limits"), 0.0, 20.0).duration_s();
        // In the rise, the hold of a cruise, and just before a ramp ends.
        for seen in [50, 2000, (ramp_s / TICK_S) as u32 - 2] {
            let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
            let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
            let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
            let mut control =
                LiveControl::<f64, 1, _, Infallible, 64>::new(items.into_iter().map(Ok), TICK_S, 0);
            for _ in 0..seen {
                control.poll(&mut feeder).expect("items");
                executor.tick(&mut intake).expect("no fault");
            }
            let progress = feeder.progress();
            for _ in 0..5 {
                executor.tick(&mut intake).expect("no fault");
            }
            control.hold();
            control.obey(Wanted::Stop, &progress, &mut feeder).expect("a stop");
            let mut ticks = 0;
            while control.state(&feeder) != State::Held && ticks < 20_000 {
                executor.tick(&mut intake).expect("no fault");
                control.poll(&mut feeder).expect("items");
                ticks += 1;
            }
            // A ramp to the end and another to rest, not 5 s of cruise.
            assert!(ticks < 1200, "seen at tick {seen}: {ticks} ticks to rest");
            assert_eq!(control.starvations(), 0, "seen at tick {seen}");
        }
    }

    /// Three programs from one source, which has nothing for a while before, between and behind them.
    #[test]
    fn a_source_may_go_on_later() {
        struct Late {
            items: std::vec::IntoIter<Item<1>>,
        }
        impl Source<1> for Late {
            type Error = Infallible;
            fn poll_next(&mut self) -> Poll<Option<Result<Item<1>, Infallible>>> {
                self.items.next().map_or(Poll::Pending, |item| Poll::Ready(Some(Ok(item))))
            }
        }
        let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
        let none = std::vec::Vec::new().into_iter();
        let mut control = LiveControl::<f64, 1, _, Infallible, 64>::new(Late { items: none }, TICK_S, 0);
        let mut start = Position::ZERO;
        for _ in 0..3 {
            for _ in 0..100 {
                control.poll(&mut feeder).expect("items");
                let executed = executor.tick(&mut intake).expect("no fault");
                assert_eq!(executed.setpoints[0].position, start);
                assert_eq!(control.state(&feeder), State::Waiting);
            }
            let mut items = line(Position::ZERO).to_vec();
            let Item::EndOfStretch([length]) = items[5] else { panic!("{:?}", items[5]) };
            items[1] = Item::Line { line: 1, start: [start], direction: [1.0], length };
            start = start + length;
            items[5] = Item::EndOfStretch([start]);
            control.source_mut().items = items.into_iter();
            for tick in 0.. {
                control.poll(&mut feeder).expect("items");
                if control.state(&feeder) == State::Waiting {
                    break;
                }
                assert_eq!(control.state(&feeder), State::Running);
                executor.tick(&mut intake).expect("no fault");
                assert!(tick < 12_000, "it never ends");
            }
        }
        assert_eq!(control.starvations(), 0);
    }

    /// Limits beyond fixed point's range: the program's ramps are soft enough, and so is a stop.
    #[test]
    fn a_stop_asks_for_no_more_than_the_number_type_holds() {
        let hard = Limits { accel_mm_s2: 1e4, jerk_mm_s3: 1e9, snap_mm_s4: 4e9 };
        let soft = Straight::new([Position::ZERO], [at(100.0)], LIMITS, [20.0; 2], TICK_S).expect("a way");
        let allowed = Allowed { cap_mm_s: 20.0, limits: hard };
        let items = soft.map(|item| match item {
            Ok(Item::Block(block)) => {
                Ok(Item::Block(PathBlock::new(block.length, 20.0, allowed, allowed, 0.0)))
            }
            item => item,
        });
        let rules = PathRules { limits: hard, ..RULES };
        let mut streams = LiveStreams::<Fixed, 1, 8, 16>::new();
        let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
        let mut executor = Executor::<Fixed, 1>::new([Position::ZERO]);
        let mut control = LiveControl::<Fixed, 1, _, Infallible, 64>::new(items, TICK_S, 0);
        for tick in 0..2100 {
            if tick == 2000 {
                control.hold();
            }
            control.poll(&mut feeder).expect("a stop");
            executor.tick(&mut intake).expect("no fault");
        }
        assert_eq!(control.state(&feeder), State::Held);
    }

    /// A block that is a step longer or shorter than its path: what was handed over ends at rest, and the rest is refused.
    #[test]
    fn blocks_that_contradict_their_path_are_refused() {
        for steps in [-1, 1, 1 << 30] {
            let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
            let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO]);
            let mut executor = Executor::<f64, 1>::new([Position::ZERO]);
            let items = line(Position::from_bits(steps));
            let mut control =
                LiveControl::<f64, 1, _, Infallible, 64>::new(items.into_iter().map(Ok), TICK_S, 0);
            let mut refused = 0;
            for _ in 0..20_000 {
                let turned = control.poll(&mut feeder);
                refused +=
                    usize::from(matches!(turned, Err(SupplyError::Rejected(Rejection::Blocks { .. }))));
                executor.tick(&mut intake).expect("no fault");
            }
            assert_eq!((refused, control.state(&feeder)), (20_000, State::Failed), "{steps}");
        }
    }
}
