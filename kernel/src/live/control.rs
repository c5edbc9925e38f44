//! Live control, background side: every [`LiveControl::poll`] reads the program, applies commands and hands
//! the next feed list to the tick.

use super::choose::{Choice, Chooser};
use super::list::List;
use super::mode::{Blocks, Mode, Request, Run};
use super::places::Takeover;
use super::reader::Reader;
use super::splice::{BlockEnd, Extent};
use super::timeline::{HandOver, Leads, Timeline};
use crate::hal::OutputState;
use crate::law::Pulse;
use crate::num::Real;
use crate::plan::Attention;
use crate::program::{Source, SupplyError, Switching};
use crate::queue::{LiveFeeder, Progress};
use crate::units::Position;

/// What live control is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Continues as long as there are items.
    Running,
    /// Told to hold, and not at rest yet.
    Holding,
    /// Held, at rest.
    Held,
    /// Told to abort, and not at rest yet.
    Aborting,
    /// Aborted, at rest: the machine stands here; split the streams anew to continue.
    Aborted,
    /// Everything read so far is done, at rest between two stretches; the source has no more items for now.
    Waiting,
    /// Everything is done.
    Done,
    /// An item can't be executed; the machine is at rest after the items before it.
    Failed,
}

/// The background side of live control, with room for `PLACES` blocks and as many planned ramps.
#[derive(Debug)]
pub struct LiveControl<R: Real, const AXES: usize, I, E, const PLACES: usize> {
    reader: Reader<R, AXES, I, PLACES>,
    timeline: Timeline,
    mode: Mode,
    /// Where single block is to come to rest within a stretch; set by the last choice.
    block_end: Option<BlockEnd>,
    /// The error that ended reading.
    error: Option<SupplyError<E>>,
    tick_s: f64,
    starvations: u32,
}

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, I, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// Starts at rest with all of `items` still to do, planning anew with ramps of `pulse`s, for ticks of
    /// `tick_s` and freshly split streams. Ramps are changed with these `leads`.
    pub fn new(items: I, pulse: Pulse, tick_s: f64, leads: Leads) -> Self {
        Self {
            reader: Reader::new(items, pulse, tick_s),
            timeline: Timeline::new(tick_s, leads),
            mode: Mode::new(),
            block_end: None,
            error: None,
            tick_s,
            starvations: 0,
        }
    }

    /// Begins anew, as [`LiveControl::new`] does, with the items that the source still has, and with streams that begin anew
    /// too ([`LiveFeeder::restart`]). In place, for boards whose stack has no room for a second one.
    pub fn restart(&mut self) {
        self.reader.restart();
        self.timeline.restart();
        self.mode = Mode::new();
        (self.block_end, self.error, self.starvations) = (None, None, 0);
    }

    /// Feed hold: comes to rest on the path as soon as the law and the ceilings allow.
    pub fn hold(&mut self) {
        self.mode.hold();
    }

    /// Continues after a hold, from rest. A hold that has not reached rest yet may be resumed too.
    pub fn resume(&mut self) {
        self.mode.resume();
    }

    /// Comes to rest on the path and gives up the rest of the program.
    pub fn abort(&mut self) {
        self.mode.abort();
    }

    /// Drives at `feed_override` times the program's feed, from [`OVERRIDE_MIN`](super::OVERRIDE_MIN) to
    /// [`OVERRIDE_MAX`](super::OVERRIDE_MAX), under all ceilings; 0 is a hold of its own.
    ///
    /// # Errors
    /// The value is outside that range; it is returned.
    pub fn set_override(&mut self, feed_override: f64) -> Result<(), f64> {
        self.mode.set_override(feed_override)
    }

    /// Single block: motion comes to rest exactly at the end of the program block under way, or of the next
    /// one that it can still stop at, and is held there until [`LiveControl::resume`], which runs one more
    /// block. A program block is all that has the same program line; a dwell or a stop is one too. If
    /// switched on at rest, the next block is run. Switching it off does not end a hold; only a resume does.
    pub fn set_single_block(&mut self, is_single: bool) {
        self.mode.set_blocks(if is_single { Blocks::Single } else { Blocks::All });
    }

    /// The source of the items, for sources that take instructions. Items already read from it are under way.
    pub fn source_mut(&mut self) -> &mut I {
        self.reader.source_mut()
    }

    /// Number of stops because data came too late.
    pub fn starvations(&self) -> u32 {
        self.starvations
    }

    /// How many pieces of path and ends of stretches are driven to their end, since it began or was restarted: motion is on
    /// the next one, or at rest before it. 0 once the program is given up.
    pub fn driven(&self, feeder: &LiveFeeder<'_, R, AXES>) -> u32 {
        if self.mode.run() == Run::Abort {
            return 0;
        }
        // The one under way is queued.
        self.reader.lookahead().queued().wrapping_sub(feeder.path_queued() as u32)
    }

    /// Tells `feeder`'s log the lists that the tick has and will have, for who did not hear of them.
    #[cfg(feature = "scope")]
    pub fn tell_lists(&self, feeder: &mut LiveFeeder<'_, R, AXES>) {
        let Some(log) = feeder.log_mut() else { return };
        for (id, list) in self.timeline.handed() {
            list.items().for_each(|item| log.keep(id, item));
        }
    }

    /// Whether it is at rest because the override is 0.
    pub fn is_stopped_by_override(&self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        self.mode.feed_override() <= 0.0 && self.rests(feeder)
    }

    /// Returns what live control is doing.
    pub fn state(&self, feeder: &LiveFeeder<'_, R, AXES>) -> State {
        let rests = self.rests(feeder);
        match self.mode.run() {
            Run::Abort if rests => State::Aborted,
            _ if rests && self.error.is_some() => State::Failed,
            Run::Abort => State::Aborting,
            Run::Hold if rests => State::Held,
            Run::Hold => State::Holding,
            Run::On if !rests || self.timeline.splice().at != Position::ZERO => State::Running,
            // The next poll holds it.
            Run::On if self.is_at_block_end() => State::Running,
            Run::On if self.reader.is_read() => State::Done,
            Run::On if self.reader.is_waiting() => State::Waiting,
            Run::On => State::Running,
        }
    }

    /// Whether single block is to hold it here.
    fn is_at_block_end(&self) -> bool {
        self.mode.is_single_block() && self.timeline.waits_at_block_end(self.reader.lookahead())
    }

    /// Whether everything handed over has been driven and no request is pending.
    fn rests(&self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        self.timeline.is_driven(&feeder.progress()) && self.mode.request().is_none()
    }

    /// One poll of the background: reads while there is room, applies commands, hands over the next list. A
    /// fault whose reaction is a stop on the path acts as a hold that is not resumed.
    ///
    /// # Errors
    /// An item can't be executed. Nothing more is read, every later call returns the same error, and what was
    /// handed over ends at rest. A hold or an abort is still obeyed where possible.
    pub fn poll(&mut self, feeder: &mut LiveFeeder<'_, R, AXES>) -> Result<(), SupplyError<E>> {
        self.poll_unless(&|| false, feeder)
    }

    /// [`LiveControl::poll`], which is cut short where `is_stop_asked` says that a hold or an abort waits to be told, or
    /// where a fault asks for a stop: the plan or the list that is being made is given up, and the rest of the poll is left to
    /// the next one. Motion goes on as handed over, or into the stop at the end of its list: a next list may have been taken back.
    /// `is_stop_asked` is called often, so it should only look.
    ///
    /// # Errors
    /// As [`LiveControl::poll`].
    pub fn poll_unless(
        &mut self,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        self.advance(is_stop_asked, feeder).unwrap_or_else(|error| {
            self.error.get_or_insert(error);
        });
        match &self.error {
            None => Ok(()),
            Some(error) => Err(error.clone()),
        }
    }

    fn advance(
        &mut self,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        if feeder.is_stop_wanted() {
            self.mode.hold();
        }
        if feeder.is_refused() {
            // The tick had passed the place: try again, further ahead.
            let request = self.timeline.request_of_next();
            self.timeline.lead_more(request);
            self.mode.renew(request);
            self.timeline.take_back_next(self.reader.feed_mut(), feeder);
        }
        let progress = self.timeline.follow(self.reader.feed_mut(), feeder);
        self.note_rest(feeder);
        self.reader.pass(&self.timeline.list().after(progress.done as usize), feeder);
        // A stop needs nothing that could still be read.
        let is_stop = self.mode.request() == Some(Request::Stop);
        if is_stop {
            self.obey_request(is_stop_asked, feeder)?;
        }
        let read = match self.error {
            None => self.reader.read(self.mode.run() == Run::Abort, is_stop_asked, feeder),
            Some(_) => Ok(()),
        };
        if !is_stop {
            self.obey_request(is_stop_asked, feeder)?;
        }
        read?;
        self.note_starvation(feeder);
        let is_to_rest = self.mode.is_to_rest() || self.error.is_some();
        if !self.timeline.has_next()
            && !is_to_rest
            && self.mode.request().is_none()
            && feeder.has_free_list()
            && !self.waits_at_block_end(feeder)
        {
            self.choose(None, is_stop_asked, feeder)?;
        }
        Ok(())
    }

    /// Obeys the request that there is, if there is a list for it.
    fn obey_request(
        &mut self,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        if let Some(request) = self.mode.request()
            && feeder.has_free_list()
        {
            let progress = self.timeline.take_back_next(self.reader.feed_mut(), feeder);
            // The list taken back may have been the last free one.
            if feeder.has_free_list() {
                self.obey(request, &progress, is_stop_asked, feeder)?;
            }
        }
        Ok(())
    }

    /// Hands over a list that obeys `request`, with motion at `progress`.
    fn obey(
        &mut self,
        request: Request,
        progress: &Progress,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<(), SupplyError<E>> {
        if !self.choose(Some((request, progress)), is_stop_asked, feeder)? {
            return Ok(());
        }
        self.timeline.set_request_of_next(request);
        Ok(())
    }

    /// Chooses a list and acts on the choice: for a request with motion at that progress, or else to follow
    /// the list under way. False if that was given up for something more urgent; a request stays then.
    fn choose(
        &mut self,
        request: Option<(Request, &Progress)>,
        is_stop_asked: &dyn Fn() -> bool,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<bool, SupplyError<E>> {
        let (path, is_full) = (self.reader.path(), self.reader.is_full());
        let (lookahead, feed) = self.reader.ahead();
        // Nothing is more urgent than a stop.
        let is_stop = matches!(request, Some((Request::Stop, _)));
        let is_wanted = || !is_stop && (is_stop_asked() || feeder.is_stop_wanted());
        let attention = Attention::new(&is_wanted);
        let mut chooser = Chooser {
            attention: &attention,
            lookahead,
            feed,
            path,
            is_full,
            mode: self.mode,
            timeline: &self.timeline,
            block_end: self.block_end,
            tick_s: self.tick_s,
        };
        let mut list = List::new(*self.timeline.splice(), self.tick_s);
        let choice = match request {
            Some((request, progress)) => chooser.obey(request, progress, &mut list),
            None => chooser.next(&mut list),
        };
        if attention.is_wanted() {
            chooser.feed.roll_back();
            return Ok(false);
        }
        let block_end = chooser.block_end;
        let acted = self.act(choice, &mut list, (!is_stop).then_some(is_stop_asked), feeder);
        if let Ok(HandOver::GivenUp) = acted {
            self.reader.feed_mut().roll_back();
            return Ok(false);
        }
        self.block_end = block_end;
        if request.is_some() {
            // What can't be done now can't be done in the next poll either; motion ends at rest anyway.
            self.mode.clear_request();
        }
        acted.map(|_| true)
    }

    /// Acts on a choice: hands the list over, `unless` a stop is asked for meanwhile, and moves the program's feed
    /// accordingly.
    fn act(
        &mut self,
        choice: Choice,
        list: &mut List,
        unless: Option<&dyn Fn() -> bool>,
        feeder: &mut LiveFeeder<'_, R, AXES>,
    ) -> Result<HandOver, SupplyError<E>> {
        let Self { reader, timeline, .. } = self;
        let exit = timeline.list().exit();
        let (takeover, feed_override) = match choice {
            Choice::Nothing => return Ok(HandOver::Done),
            Choice::Follow { feed_override } => (Takeover::After(exit), feed_override),
            Choice::TakeOver { takeover, feed_override } => (takeover, feed_override),
            Choice::Rest { after, ends_block } => {
                list.restart(timeline.list().after(after));
                list.set_ends_block(ends_block);
                (Takeover::After(after), timeline.driven_override())
            }
            Choice::EndBlock => {
                timeline.end_block();
                return Ok(HandOver::Done);
            }
            Choice::DriveToEnd if !timeline.drive_to_end() => return Ok(HandOver::Done),
            Choice::DriveToEnd | Choice::Replan => {
                reader.feed_mut().replan_from(timeline.splice().stretch);
                return Ok(HandOver::Done);
            }
        };
        let handed_over =
            timeline.hand_over(list, takeover, feed_override, reader.lookahead(), unless, feeder)?;
        if handed_over == HandOver::GivenUp {
            return Ok(handed_over);
        }
        let (feed, stretch) = (reader.feed_mut(), timeline.splice().stretch);
        let is_planned_anew = matches!(choice, Choice::TakeOver { .. });
        if is_planned_anew {
            feed.replan_through(stretch);
        }
        feed.take_back(timeline.list(), takeover.driven(), exit);
        if is_planned_anew {
            feed.replan_from(stretch);
        }
        Ok(HandOver::Done)
    }

    /// If data came too late, motion is in a fallback stop: the next list begins at its end. A stop at the
    /// end of the stretch is no starvation: motion was to end there.
    fn note_starvation(&mut self, feeder: &LiveFeeder<'_, R, AXES>) {
        if self.timeline.is_in_fallback(&feeder.progress()) && self.timeline.drive_to_end() {
            let end = *self.timeline.splice();
            let extent = self.reader.path().extent_of(end.stretch, self.block_end, self.reader.lookahead());
            if extent != Extent::Whole(end.at) {
                self.starvations = self.starvations.wrapping_add(1);
            }
            self.reader.feed_mut().replan_from(end.stretch);
        }
    }

    /// Whether motion is to wait at the end of a block. Once at rest there, it is held if more items are to
    /// come.
    fn waits_at_block_end(&mut self, feeder: &LiveFeeder<'_, R, AXES>) -> bool {
        if !self.is_at_block_end() {
            return false;
        }
        if self.rests(feeder) {
            if !self.reader.is_read() {
                self.mode.hold_at_block_end();
            }
            self.timeline.has_waited();
        }
        true
    }

    /// At rest in a hold, or without single block, the wait is over: the next block is run.
    fn note_rest(&mut self, feeder: &LiveFeeder<'_, R, AXES>) {
        if (self.mode.run() != Run::On || !self.mode.is_single_block()) && self.rests(feeder) {
            self.timeline.has_waited();
        }
    }
}

impl<R, const AXES: usize, I, E, const PLACES: usize> LiveControl<R, AXES, Switching<I>, E, PLACES>
where
    R: Real,
    E: Clone,
    I: Source<AXES, Error = E>,
{
    /// What the program switches outputs to now, if motion has come to rest for that; from then on it goes on, so the
    /// caller has to put it out.
    pub fn switch(&mut self, feeder: &LiveFeeder<'_, R, AXES>) -> Option<OutputState> {
        if self.state(feeder) != State::Waiting {
            return None;
        }
        let source = self.source_mut();
        let due = source.due();
        source.switched();
        due
    }
}

#[cfg(test)]
mod tests;
