//! The feed lists in time: the one under way, and the next.
//!
//! Consumes lists, each with the place where it takes over; hands them to the tick, follows the tick, and
//! takes back lists that it has not reached. The only part of live control that talks to the feed lists.
//! Background.

use super::list::{LIST_ITEMS, List};
use super::lookahead::Lookahead;
use super::mode::Request;
use super::places::{Places, Takeover};
use super::program_feed::ProgramFeed;
use super::splice::{BlockEnd, Splice};
use crate::law::Ticks;
use crate::num::Real;
use crate::program::SupplyError;
use crate::program::supply::is_taken;
use crate::queue::{Change, Density, FeedItem, LISTS, LiveFeeder, Progress, Rejection};
use crate::units::Position;

/// A ramp is cut at most this many ticks after the progress last seen.
const LEAD_TICKS_MAX: u64 = 64;

/// How handing a list over ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HandOver {
    /// The tick has it.
    Done,
    /// It was given up for a stop: the tick has what it had.
    GivenUp,
}

/// How far ahead of the progress last seen a ramp is changed \[ticks\]: as many as pass during an ordinary poll of this
/// kind, if ticks can interrupt the background. Where that was too late, the lead grows by a tick, and stays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leads {
    /// For a stop, which takes a few ramps.
    pub stop_ticks: u32,
    /// For everything else, which is planned.
    pub plan_ticks: u32,
}

impl Leads {
    /// For ticks that never interrupt the background.
    pub const NONE: Self = Self { stop_ticks: 0, plan_ticks: 0 };
}

fn ticks(count: u32) -> Ticks {
    Ticks::from_bits(u64::from(count) << 32)
}

/// A list that the tick has or will have.
#[derive(Debug)]
struct Handed {
    id: u8,
    list: List,
    /// The density of the items driven before it.
    before: Density,
}

impl Handed {
    /// Nothing, before all motion.
    fn nothing(tick_s: f64) -> Self {
        Self { id: 0, list: List::new(Timeline::BEGIN, tick_s), before: Density::NONE }
    }
}

/// Why there is a list that follows the one under way.
#[derive(Clone, Copy, Debug)]
struct Next {
    /// The command it was made for, if any.
    request: Option<Request>,
    /// The override of the motion before it.
    before_override: f64,
}

/// The lists that the tick has and will have.
#[derive(Debug)]
pub(super) struct Timeline {
    tick_s: f64,
    /// The list under way and the next one, by turns: a list is kilobytes, and is never moved.
    lists: [Handed; 2],
    is_second_under_way: bool,
    next: Option<Next>,
    /// Where the next list begins.
    splice: Splice,
    /// The override of the motion that was handed over last.
    driven_override: f64,
    /// How long after the progress last seen a ramp is cut: for a stop, and for everything else.
    stop_lead: Ticks,
    plan_lead: Ticks,
    /// Where motion was last held, or last waited at the end of a block.
    waited_at: Option<Splice>,
}

impl Timeline {
    /// Before all motion.
    const BEGIN: Splice = Splice { stretch: 0, at: Position::ZERO, feed_mm_s: 0.0 };

    /// At rest before all motion, in the list that the streams begin with.
    pub(super) fn new(tick_s: f64, leads: Leads) -> Self {
        Self {
            tick_s,
            lists: [Handed::nothing(tick_s), Handed::nothing(tick_s)],
            is_second_under_way: false,
            next: None,
            splice: Self::BEGIN,
            driven_override: 1.0,
            stop_lead: ticks(leads.stop_ticks),
            plan_lead: ticks(leads.plan_ticks),
            waited_at: None,
        }
    }

    /// Begins anew. The leads stay as far as they have grown.
    pub(super) fn restart(&mut self) {
        let Handed { id, list, before } = self.under_way_mut();
        list.restart(Self::BEGIN);
        (*id, *before, self.next) = (0, Density::NONE, None);
        (self.splice, self.driven_override, self.waited_at) = (Self::BEGIN, 1.0, None);
    }

    /// A timeline with `list` under way, without handing it over.
    #[cfg(test)]
    pub(super) fn driving(list: List, tick_s: f64) -> Self {
        let splice = list.exit_splice();
        let under_way = Handed { list, ..Handed::nothing(tick_s) };
        let lists = [under_way, Handed::nothing(tick_s)];
        Self { lists, splice, ..Self::new(tick_s, Leads::NONE) }
    }

    fn under_way(&self) -> &Handed {
        let [first, second] = &self.lists;
        if self.is_second_under_way { second } else { first }
    }

    fn under_way_mut(&mut self) -> &mut Handed {
        let [first, second] = &mut self.lists;
        if self.is_second_under_way { second } else { first }
    }

    /// The next list, if there is one.
    fn next_handed(&self) -> Option<&Handed> {
        let [first, second] = &self.lists;
        self.next.map(|_| if self.is_second_under_way { first } else { second })
    }

    /// The place for the next list.
    fn place_of_next(&mut self) -> &mut Handed {
        let [first, second] = &mut self.lists;
        if self.is_second_under_way { first } else { second }
    }

    /// The list under way.
    pub(super) fn list(&self) -> &List {
        &self.under_way().list
    }

    /// The lists that the tick has and will have.
    #[cfg(feature = "scope")]
    pub(super) fn handed(&self) -> impl Iterator<Item = (u8, &List)> {
        core::iter::once(self.under_way()).chain(self.next_handed()).map(|handed| (handed.id, &handed.list))
    }

    /// Where the next list begins.
    pub(super) fn splice(&self) -> &Splice {
        &self.splice
    }

    pub(super) fn driven_override(&self) -> f64 {
        self.driven_override
    }

    /// Whether a list follows the one under way.
    pub(super) fn has_next(&self) -> bool {
        self.next.is_some()
    }

    /// The request that the next list was made for.
    pub(super) fn request_of_next(&self) -> Option<Request> {
        self.next?.request
    }

    /// Notes the request that the next list, if there is one, was made for.
    pub(super) fn set_request_of_next(&mut self, request: Request) {
        if let Some(next) = &mut self.next {
            next.request = Some(request);
        }
    }

    /// The places where the list under way may be left for `request`, with motion at `progress`.
    pub(super) fn places(&self, request: Request, progress: &Progress) -> Places<'_> {
        let lead = match request {
            Request::Stop => self.stop_lead,
            Request::Override => self.plan_lead,
        };
        Places::new(self.list(), progress, lead, self.tick_s)
    }

    /// Whether everything handed over has been driven.
    pub(super) fn is_driven(&self, progress: &Progress) -> bool {
        progress.list == self.under_way().id
            && self.next.is_none()
            && progress.inside.is_none()
            && !progress.waits
            && progress.done as usize >= self.list().len()
    }

    /// Notes that motion has waited at the end of the list under way.
    pub(super) fn has_waited(&mut self) {
        self.waited_at = Some(self.list().end());
        self.under_way_mut().list.set_ends_block(false);
    }

    /// Whether motion is to wait where the next list begins: at a block end where it has not waited yet.
    pub(super) fn waits_at_block_end<const PLACES: usize>(&self, lookahead: &Lookahead<PLACES>) -> bool {
        let splice = &self.splice;
        let has_waited = || self.waited_at.is_some_and(|waited| BlockEnd::from(waited).is_at(splice));
        let is_block_end = || lookahead.block_ends(splice.stretch).any(|end| end.is_at(splice));
        self.list().ends_block() || splice.is_at_rest() && !has_waited() && is_block_end()
    }

    /// Marks the list under way as ending a block.
    pub(super) fn end_block(&mut self) {
        self.under_way_mut().list.set_ends_block(true);
    }

    /// Returns the tick's progress. Once the tick is on the next list, that is the list under way.
    pub(super) fn follow<R: Real, const AXES: usize, const PLACES: usize>(
        &mut self,
        feed: &mut ProgramFeed<PLACES>,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Progress {
        let progress = feeder.progress();
        if self.next_handed().is_some_and(|next| next.id == progress.list) {
            feeder.give_up(self.under_way().id);
            (self.is_second_under_way, self.next) = (!self.is_second_under_way, None);
            feed.follow();
        }
        progress
    }

    /// Takes back the next list: motion is as before. If the tick has already changed to it, that counts.
    pub(super) fn take_back_next<R: Real, const AXES: usize, const PLACES: usize>(
        &mut self,
        feed: &mut ProgramFeed<PLACES>,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Progress {
        feeder.no_change();
        let progress = self.follow(feed, feeder);
        let id = self.next_handed().map(|next| next.id);
        if let (Some(Next { before_override, .. }), Some(id)) = (self.next.take(), id) {
            feeder.give_up(id);
            self.driven_override = before_override;
            self.splice = self.list().exit_splice();
            feed.roll_back();
        }
        progress
    }

    /// The tick had passed the place of a change that was made for `request`: increases the lead for the next one.
    pub(super) fn lead_more(&mut self, request: Option<Request>) {
        let lead = match request {
            Some(Request::Stop) => &mut self.stop_lead,
            Some(Request::Override) | None => &mut self.plan_lead,
        };
        if lead.to_bits() < LEAD_TICKS_MAX << 32 {
            *lead = lead.plus(Ticks::ONE);
        }
    }

    /// Whether motion is in the fallback stop of the list under way, because nothing followed in time.
    pub(super) fn is_in_fallback(&self, progress: &Progress) -> bool {
        let Handed { id, list, .. } = self.under_way();
        let (done, exit) = (progress.done as usize, list.exit());
        let is_in_stop = done > exit || done == exit && progress.inside.is_some();
        self.next.is_none() && progress.list == *id && is_in_stop && exit < list.len()
    }

    /// Lets the list under way be driven to its end, fallback stop included; the next list begins there.
    /// False if it would be driven to its end anyway.
    pub(super) fn drive_to_end(&mut self) -> bool {
        let list = &mut self.under_way_mut().list;
        if list.exit() >= list.len() {
            return false;
        }
        list.set_exit_to_end();
        self.splice = self.list().end();
        true
    }

    /// The density of the list under way up to where another takes over.
    fn density_before(&self, takeover: Takeover) -> Density {
        let Handed { list, before, .. } = self.under_way();
        let mut density = *before;
        for duration in list.items().take(takeover.driven()).filter_map(|item| item.duration(self.tick_s)) {
            let accepted = density.follow(duration);
            debug_assert!(accepted.is_ok(), "it was accepted when it was handed over");
        }
        density
    }

    /// Whether the executor keeps up with `list` if it takes over at `takeover`.
    pub(super) fn keeps_up(&self, list: &List, takeover: Takeover) -> bool {
        let mut density = self.density_before(takeover);
        let mut durations = list.items().filter_map(|item| item.duration(self.tick_s));
        durations.all(|duration| density.follow(duration).is_ok())
    }

    /// Hands over a list whose motion is under `feed_override`, and asks the tick to change to it. There must
    /// be a free feed list. The next list begins at its exit. Where there is another free one for it, a stop that is asked
    /// for, which `unless` says, or that a fault asks for comes first: the list is given up, and all is as before.
    pub(super) fn hand_over<R: Real, E, const AXES: usize, const PLACES: usize>(
        &mut self,
        list: &List,
        takeover: Takeover,
        feed_override: f64,
        lookahead: &Lookahead<PLACES>,
        unless: Option<&dyn Fn() -> bool>,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<HandOver, SupplyError<E>> {
        let (from, before) = (R::from_f64(list.start().feed_mm_s), self.density_before(takeover));
        let id = feeder.begin(list.start().at, from, before);
        let id = id.ok_or(SupplyError::Rejected(Rejection::full("feed lists", LISTS.into())))?;
        let change = Change {
            from: self.under_way().id,
            to: id,
            after: takeover.driven() as u32,
            within: matches!(takeover, Takeover::Within(_)),
        };
        let handed_over = match self.fill(list, id, lookahead, unless, feeder) {
            Ok(HandOver::Done) => {
                feeder.change(change).map(|()| HandOver::Done).map_err(SupplyError::Rejected)
            }
            filled => filled,
        };
        if !matches!(handed_over, Ok(HandOver::Done)) {
            feeder.give_up(id);
            return handed_over;
        }
        self.splice = list.exit_splice();
        let before_override = core::mem::replace(&mut self.driven_override, feed_override);
        self.next = Some(Next { request: None, before_override });
        let next = self.place_of_next();
        (next.id, next.before) = (id, before);
        next.list.assign(list);
        handed_over
    }

    fn fill<R: Real, E, const AXES: usize, const PLACES: usize>(
        &self,
        list: &List,
        id: u8,
        lookahead: &Lookahead<PLACES>,
        unless: Option<&dyn Fn() -> bool>,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<HandOver, SupplyError<E>> {
        let mut has_room = !list.is_overfull();
        for (start, item) in list.placed() {
            let is_stop_wanted =
                unless.is_some_and(|is_stop_asked| is_stop_asked() || feeder.is_stop_wanted());
            // The tick empties a list that is given up, which takes some ticks.
            if is_stop_wanted && feeder.has_free_list() {
                return Ok(HandOver::GivenUp);
            }
            let is_taken = match item.ready(self.tick_s).map_err(SupplyError::Segment)? {
                FeedItem::Segment(segment) => is_taken(feeder.segment(id, segment)),
                FeedItem::EndOfStretch => {
                    // If all blocks of the stretch have been passed, so has its end.
                    let path = lookahead.end_of(start.stretch).unwrap_or(start.at);
                    is_taken(feeder.end_of_feed(id, path))
                }
                FeedItem::Dwell(duration) => is_taken(feeder.dwell(id, duration)),
                FeedItem::ProgramStop => is_taken(feeder.program_stop(id)),
            };
            has_room &= is_taken.map_err(SupplyError::Rejected)?;
            #[cfg(feature = "scope")]
            if let Some(log) = feeder.log_mut() {
                log.item(id, item);
            }
        }
        if has_room {
            Ok(HandOver::Done)
        } else {
            Err(SupplyError::Rejected(Rejection::full("items of a feed list", LIST_ITEMS)))
        }
    }
}
