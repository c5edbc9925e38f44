//! Choices from values made by hand, without queue, tick or executor.

use super::*;
use crate::fixture::LIMITS;
use crate::law::{Law, Phase, Pulse, Ramp, Ticks};
use crate::live::mode::{Blocks, Request};
use crate::live::timeline::Leads;
use crate::program::{Allowed, PathBlock};
use crate::queue::Progress;

const TICK_S: f64 = 5e-4;
const FEED_MM_S: f64 = 20.0;
const CRUISE_MM: f64 = 100.0;

fn at(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

/// A stretch of a ramp, a cruise and a ramp, with everything that a choice depends on.
struct Ahead {
    up: Ramp<f64>,
    whole: Position,
    lookahead: Lookahead<64>,
    feed: ProgramFeed<64>,
    path: QueuedPath,
    mode: Mode,
    timeline: Timeline,
}

impl Ahead {
    /// All of it is read and queued.
    fn new() -> Self {
        let up = Ramp::new(&Law::new(Pulse::Plateau, LIMITS).expect("limits"), 0.0, FEED_MM_S);
        let ramp = at(up.length_mm());
        let whole = ramp + at(CRUISE_MM) + ramp;
        let allowed = Allowed { cap_mm_s: FEED_MM_S, limits: LIMITS };
        let mut lookahead = Lookahead::new(Pulse::Plateau);
        let block = PathBlock::new(whole, FEED_MM_S, allowed, allowed, 0.0);
        lookahead.push(0, block).expect("room");
        let mut feed = ProgramFeed::new();
        for item in Self::items(up) {
            feed.push(item).expect("room");
        }
        let path = QueuedPath::new(1, Position::ZERO);
        Self {
            up,
            whole,
            lookahead,
            feed,
            path,
            mode: Mode::new(),
            timeline: Timeline::new(TICK_S, Leads::NONE),
        }
    }

    fn items(up: Ramp<f64>) -> [Item; 4] {
        let length = at(up.length_mm());
        let cruise = Ramp::cruise(FEED_MM_S, CRUISE_MM / FEED_MM_S);
        [
            Item::Feed(PlannedRamp { ramp: up, length }),
            Item::Feed(PlannedRamp { ramp: cruise, length: at(CRUISE_MM) }),
            Item::Feed(PlannedRamp { ramp: up.reversed(), length }),
            Item::End,
        ]
    }

    /// The stretch is under way, or a dwell before it.
    fn under_way(mut self, dwell: Option<Item>) -> Self {
        let mut list = List::new(*self.timeline.splice(), TICK_S);
        for item in dwell.into_iter().chain(Self::items(self.up)) {
            list.push(item);
        }
        list.set_exit_to_end();
        self.timeline = Timeline::driving(list, TICK_S);
        self
    }

    fn choose(&mut self, request: Option<(Request, Progress)>) -> (Choice, List) {
        let mut list = List::new(*self.timeline.splice(), TICK_S);
        let attention = Attention::undivided();
        let mut chooser = Chooser {
            attention: &attention,
            lookahead: &self.lookahead,
            feed: &mut self.feed,
            path: self.path,
            is_full: false,
            mode: self.mode,
            timeline: &self.timeline,
            block_end: None,
            tick_s: TICK_S,
        };
        let choice = match request {
            Some((request, progress)) => chooser.obey(request, &progress, &mut list),
            None => chooser.next(&mut list),
        };
        (choice, list)
    }

    fn greatest_mm_s(list: &List) -> f64 {
        list.placed().map(|(start, _)| start.feed_mm_s).fold(0.0, f64::max)
    }
}

fn progress(done: u32, inside: Option<(Phase, Ticks)>) -> Progress {
    Progress { tick: 0, list: 0, done, inside, waits: false }
}

const FOLLOW: Choice = Choice::Follow { feed_override: 1.0 };

#[test]
fn a_stretch_that_is_known_is_driven_by_its_own_plan() {
    let mut ahead = Ahead::new();
    let (choice, list) = ahead.choose(None);
    assert_eq!(choice, FOLLOW);
    assert!(list.items().eq(&Ahead::items(ahead.up)), "{list:?}");
    assert_eq!((list.exit(), list.ends_block()), (4, true));
    assert!(ahead.feed.is_empty());
    assert_eq!(ahead.choose(None).0, Choice::Nothing, "there is no more");
}

/// Motion continues on queued path only: the rest of the cruise stays ahead, and a fallback stop ends the
/// list.
#[test]
fn a_list_ends_in_a_stop_on_queued_path() {
    let mut ahead = Ahead::new();
    let queued = at(50.0);
    ahead.path = QueuedPath::new(0, queued);
    let (choice, list) = ahead.choose(None);
    assert_eq!(choice, FOLLOW);
    assert_eq!((list.exit(), list.len()), (2, 3));
    assert!(list.exit_splice().feed_mm_s == FEED_MM_S && list.end().is_at_rest(), "{list:?}");
    assert!(list.end().at <= queued);
    let Some(Item::Feed(PlannedRamp { length, .. })) = ahead.feed.peek() else {
        panic!("the rest of the cruise")
    };
    assert_eq!(list.exit_splice().at + *length + at(ahead.up.length_mm()), ahead.whole);
    // Taken back, it is ahead as a whole.
    ahead.feed.roll_back();
    assert_eq!(ahead.feed.peek(), Some(&Ahead::items(ahead.up)[0]));
}

#[test]
fn an_override_is_planned_anew() {
    let mut ahead = Ahead::new();
    ahead.mode.set_override(0.5).expect("in range");
    let (choice, list) = ahead.choose(None);
    assert_eq!(choice, Choice::Follow { feed_override: 0.5 });
    assert_eq!(Ahead::greatest_mm_s(&list), 0.5 * FEED_MM_S);
    assert!(list.contains(&Item::End) && ahead.feed.is_empty(), "{list:?}");
}

#[test]
fn single_block_comes_to_rest_at_the_end_of_the_block() {
    let mut ahead = Ahead::new();
    let middle = at(60.0);
    ahead.lookahead.queued_piece(0, Position::ZERO, 1).expect("room");
    ahead.lookahead.queued_piece(0, middle, 2).expect("room");
    ahead.mode.set_blocks(Blocks::Single);
    let (choice, list) = ahead.choose(None);
    assert_eq!(choice, FOLLOW);
    assert_eq!((list.end().at, list.exit(), list.ends_block()), (middle, list.len(), true));
    assert!(list.end().is_at_rest() && ahead.feed.peek() == Some(&Item::End), "{list:?}");
}

/// A cruise is cut at once; a ramp that brakes to rest goes to its end; a dwell is the last item driven.
#[test]
fn a_stop_takes_over_as_soon_as_the_feed_does_not_change() {
    let left = Ticks::from_seconds(1.0, TICK_S).expect("in range");
    let mut ahead = Ahead::new().under_way(None);
    let (choice, list) = ahead.choose(Some((Request::Stop, progress(1, Some((Phase::Hold, left))))));
    assert_eq!(choice, Choice::TakeOver { takeover: Takeover::Within(1), feed_override: 1.0 });
    let braked_mm = CRUISE_MM - FEED_MM_S + 2.0 * ahead.up.length_mm();
    assert!(libm::fabs(list.end().at.to_mm() - braked_mm) < 1e-6 && list.end().is_at_rest(), "{list:?}");

    let falling = progress(2, Some((Phase::Rise, Ticks::ONE)));
    assert_eq!(ahead.choose(Some((Request::Stop, falling))).0, Choice::DriveToEnd);

    let mut ahead = Ahead::new().under_way(Some(Item::Dwell(left)));
    let dwelling = Progress { waits: true, ..progress(1, None) };
    let (choice, _) = ahead.choose(Some((Request::Stop, dwelling)));
    assert_eq!(choice, Choice::Rest { after: 1, ends_block: false });
}

/// A ramp that brakes to a lower feed goes on to rest from its rise or its hold; from its fall it goes to its
/// end, and brakes again.
#[test]
fn a_ramp_that_brakes_is_driven_on_to_rest() {
    let mut ahead = Ahead::new();
    let law = Law::new(Pulse::Plateau, LIMITS).expect("limits");
    let down = Ramp::new(&law, FEED_MM_S, 0.5 * FEED_MM_S);
    let mut list = List::new(Splice { feed_mm_s: FEED_MM_S, ..*ahead.timeline.splice() }, TICK_S);
    list.push(Item::Feed(PlannedRamp { ramp: down, length: at(down.length_mm()) }));
    list.push_cruise(0.5 * FEED_MM_S, at(50.0));
    list.set_exit_to_end();
    ahead.timeline = Timeline::driving(list, TICK_S);
    let middle = Ticks::from_seconds(0.5 * down.t1_s, TICK_S).expect("in range");
    let rising = progress(0, Some((Phase::Rise, middle)));
    let (choice, list) = ahead.choose(Some((Request::Stop, rising)));
    assert_eq!(choice, Choice::TakeOver { takeover: Takeover::Within(0), feed_override: 1.0 });
    assert!(list.len() == 1 && list.end().is_at_rest() && list.start().feed_mm_s == FEED_MM_S, "{list:?}");

    let falling = progress(0, Some((Phase::Fall, middle)));
    let (choice, list) = ahead.choose(Some((Request::Stop, falling)));
    assert_eq!(choice, Choice::TakeOver { takeover: Takeover::After(1), feed_override: 1.0 });
    assert!(list.start().feed_mm_s == 0.5 * FEED_MM_S && list.end().is_at_rest(), "{list:?}");
}

/// A rise that will be over before a change can take effect is cut in its hold: it does not go on to its end.
#[test]
fn a_ramp_is_cut_across_the_end_of_its_rise() {
    let mut ahead = Ahead::new();
    let law = Law::new(Pulse::Plateau, LIMITS).expect("limits");
    let long = Ramp::new(&law, 0.0, 200.0);
    let mut list = List::new(*ahead.timeline.splice(), TICK_S);
    list.push(Item::Feed(PlannedRamp { ramp: long, length: at(long.length_mm()) }));
    list.push_cruise(200.0, at(100.0));
    list.set_exit_to_end();
    ahead.timeline = Timeline::driving(list, TICK_S);
    for _ in 0..3 {
        ahead.timeline.lead_more(Some(Request::Stop));
    }
    let allowed = Allowed { cap_mm_s: 200.0, limits: LIMITS };
    ahead.lookahead = Lookahead::new(Pulse::Plateau);
    ahead.lookahead.push(0, PathBlock::new(ahead.whole, 200.0, allowed, allowed, 0.0)).expect("room");
    let (choice, list) = ahead.choose(Some((Request::Stop, progress(0, Some((Phase::Rise, Ticks::ONE))))));
    assert_eq!(choice, Choice::TakeOver { takeover: Takeover::Within(0), feed_override: 1.0 });
    let Some((_, Item::Feed(PlannedRamp { ramp, .. }))) = list.get(0) else { panic!("{list:?}") };
    assert!(libm::fabs(ramp.t2_s - ramp.t1_s - 2.0 * TICK_S) < 1e-9 && ramp.t1_s == long.t1_s, "{ramp:?}");
    assert!(list.len() == 2 && list.end().is_at_rest(), "{list:?}");
}

/// A lower override brakes from the cruise to its feed; the whole stretch is planned anew from there.
#[test]
fn another_override_takes_over_in_a_cruise() {
    let mut ahead = Ahead::new().under_way(None);
    ahead.mode.set_override(0.25).expect("in range");
    let left = Ticks::from_seconds(1.0, TICK_S).expect("in range");
    let (choice, list) = ahead.choose(Some((Request::Override, progress(1, Some((Phase::Hold, left))))));
    assert_eq!(choice, Choice::TakeOver { takeover: Takeover::Within(1), feed_override: 0.25 });
    assert_eq!(list.get(2).map(|(start, _)| start.feed_mm_s), Some(0.25 * FEED_MM_S), "{list:?}");
    assert!(ahead.feed.replans(0) && list.end().is_at_rest());
}
