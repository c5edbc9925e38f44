//! Motion that comes over the link, under live control.
//!
//! Consumes the bytes of a PC's [`HostLink`](motion_kernel::link::HostLink); keeps the tick's streams filled with the items
//! that come, obeys the operator's controls, and answers. Motion ends at rest on the path wherever items stop coming, so no
//! time-out of the link decides about it but a dead man's, where the controls ask for one. Background.

use core::cell::RefCell;
use core::convert::Infallible;
use core::task::Poll;

use motion_kernel::hal::OutputState;
use motion_kernel::jog::Jog;
use motion_kernel::law::Pulse;
use motion_kernel::link::{BoardLink, Came, Controls, ItemQueue, Mode, Status};
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::program::{Item, Source, SupplyError, Switching};
use motion_kernel::queue::{Intake, LiveFeeder};
use motion_kernel::scope::Log;
use motion_kernel::units::Position;

/// Frames of items that one poll puts away at most: motion is to be planned, too.
const FRAMES_PER_POLL: usize = 8;

/// What the operator asks of the rest of the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    /// The operator enables the drives, or disables them.
    pub power: Option<bool>,
    /// The operator clears the fault.
    pub clears_fault: bool,
    /// The operator resumes: also from a program stop, which is the kernel's.
    pub resumes: bool,
    /// The operator holds.
    pub holds: bool,
    /// The operator gives up what is under way.
    pub aborts: bool,
    /// The operator has these axes homed, the lowest bit is the first one's; what was under way is given up.
    pub homes: Option<u16>,
    /// Nothing that ends it was pressed since.
    pub(crate) may_home: bool,
}

/// Where items come from: over the link, or of a move of homing.
struct Items<const AXES: usize, const ITEMS: usize> {
    queue: ItemQueue<AXES, ITEMS>,
    /// Nothing is taken from the queue.
    is_homing: bool,
    /// What is left of the move.
    jog: Option<Jog<AXES>>,
}

impl<const AXES: usize, const ITEMS: usize> Source<AXES> for Items<AXES, ITEMS> {
    type Error = Infallible;

    fn poll_next(&mut self) -> Poll<Option<Result<Item<AXES>, Infallible>>> {
        if !self.is_homing {
            return self.queue.poll_next();
        }
        match self.jog.as_mut().and_then(Iterator::next) {
            Some(item) => Poll::Ready(Some(item)),
            None => Poll::Pending,
        }
    }
}

/// A program that comes over the link. `ITEMS` have room before they are taken into the streams; `PLACES` is that of
/// [`LiveControl`].
pub struct Streamed<'a, R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize> {
    link: RefCell<BoardLink>,
    feeder: LiveFeeder<'a, R, AXES>,
    control: Live<R, AXES, ITEMS, PLACES>,
    obeyed: Controls,
}

/// Live control of items that come over the link.
type Live<R, const AXES: usize, const ITEMS: usize, const PLACES: usize> =
    LiveControl<R, AXES, Switching<Items<AXES, ITEMS>>, Infallible, PLACES>;

impl<'a, R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize>
    Streamed<'a, R, AXES, ITEMS, PLACES>
{
    /// At rest and held, with streams that were split where the machine stands; what is planned anew has ramps of
    /// `pulse`s, for ticks of `tick_s`, with these `leads`.
    #[must_use]
    pub fn new(
        link: BoardLink,
        feeder: LiveFeeder<'a, R, AXES>,
        pulse: Pulse,
        tick_s: f64,
        leads: Leads,
    ) -> Self {
        let items = Items { queue: ItemQueue::new(), is_homing: false, jog: None };
        let mut control = LiveControl::new(Switching::new(items), pulse, tick_s, leads);
        // As the controls are before the operator's first command.
        control.hold();
        Self { link: RefCell::new(link), feeder, control, obeyed: Controls::NONE }
    }

    /// The first part of a poll of the background: takes what `next_byte` has, and obeys the operator; what he asks of the rest
    /// of the board. Parameters that came wait for who puts them away before the second part.
    pub fn receive(&mut self, next_byte: &mut dyn FnMut() -> Option<u8>) -> Requests {
        let Self { link, control, obeyed, .. } = self;
        let mut bytes = core::iter::from_fn(next_byte);
        let link = link.get_mut();
        for _ in 0..FRAMES_PER_POLL {
            link.receive(&mut bytes);
            if !link.put_items(&mut control.source_mut().items_mut().queue) {
                break;
            }
        }
        match link.take_controls() {
            Some(controls) => obey(&controls, obeyed, control),
            None => Requests::default(),
        }
    }

    /// The second part: plans. `next_byte` is asked between the steps of a plan, too: a hold ends the plan, and items that come
    /// meanwhile are dropped and come again. So whoever gives it may count there that the background is alive.
    ///
    /// Motion is held wherever `is_hold_asked` says so, which a hold on the board does: a button. It is asked between the steps
    /// of a plan, too, and needs no filter, as what bounces holds again. Only the operator's next resume over the link goes on,
    /// and not while it still says so.
    ///
    /// # Errors
    /// An item can't be executed: of this and every later call. Motion ends at rest.
    pub fn plan(
        &mut self,
        is_hold_asked: &dyn Fn() -> bool,
        next_byte: &mut dyn FnMut() -> Option<u8>,
    ) -> Result<(), SupplyError<Infallible>> {
        let Self { link, feeder, control, .. } = self;
        let bytes = core::iter::from_fn(next_byte);
        let is_held = is_hold_asked() || link.get_mut().is_silent();
        // Homing is aborted instead.
        if is_held && !control.source_mut().items_mut().is_homing {
            control.hold();
        }
        let bytes = RefCell::new(bytes);
        let is_stop_asked = || {
            let is_hold_new = !is_held && is_hold_asked();
            // Both are borrowed nowhere else while motion is planned.
            let (Ok(mut link), Ok(mut bytes)) = (link.try_borrow_mut(), bytes.try_borrow_mut()) else {
                return is_hold_new;
            };
            link.receive_controls(&mut *bytes);
            is_hold_new || link.is_stop_asked()
        };
        control.poll_unless(&is_stop_asked, feeder)
    }

    /// After an abort ([`State::Aborted`]), or where the drives are enabled: drops what was not driven, and begins anew on a
    /// machine that stands at `here`, with the items of the program after it. The operator's settings stay. `intake` is the
    /// other end of the streams, and `tick` the last one.
    pub fn restart(&mut self, intake: &mut Intake<'_, R, AXES>, here: [Position; AXES], tick: u64) {
        let Self { feeder, control, obeyed, .. } = self;
        // Of the program before, even if it was never put out.
        control.source_mut().switched();
        control.restart();
        let items = control.source_mut().items_mut();
        let was_homing = core::mem::replace(&mut items.is_homing, false);
        items.jog = None;
        let Came { aborts, taken, .. } = items.queue.came();
        // After homing nothing moves before the next command.
        if obeyed.mode == Mode::Hold || was_homing {
            control.hold();
        }
        set(obeyed, control);
        let is_restarted = feeder.restart(intake, here);
        debug_assert!(is_restarted, "both are ends of the same streams");
        feeder.note_restart(tick, here, Some((aborts, taken)));
    }

    /// [`Self::restart`] with a move of homing, or with none yet; items that come wait until another restart.
    pub(crate) fn restart_homing(
        &mut self,
        jog: Option<Jog<AXES>>,
        intake: &mut Intake<'_, R, AXES>,
        here: [Position; AXES],
        tick: u64,
    ) {
        let Self { feeder, control, obeyed, .. } = self;
        control.source_mut().switched();
        control.restart();
        let items = control.source_mut().items_mut();
        (items.is_homing, items.jog) = (true, jog);
        set(obeyed, control);
        let is_restarted = feeder.restart(intake, here);
        debug_assert!(is_restarted, "both are ends of the same streams");
        feeder.note_restart(tick, here, None);
    }

    /// Comes to rest, and gives up what is under way.
    pub(crate) fn abort(&mut self) {
        self.control.abort();
    }

    /// Whether who asked last says nothing any more, for the time that the controls tell.
    pub(crate) fn is_silent(&mut self) -> bool {
        self.link.get_mut().is_silent()
    }

    /// Writes the next frame for the PC to `out`; see [`BoardLink::transmit`]. `status` is asked for the machine's status with
    /// what has come of the program.
    pub fn transmit(
        &mut self,
        now_ms: u32,
        status: Option<&dyn Fn(Came) -> Status<AXES>>,
        out: &mut [u8],
    ) -> usize {
        let items = &self.control.source_mut().items_mut().queue;
        let status = status.map(|status| status(items.came()));
        self.link.get_mut().transmit(now_ms, items, status, out)
    }

    /// From now on `log` is told what the tick is handed.
    pub(crate) fn set_log(&mut self, log: &'a mut Log<AXES>) {
        self.feeder.set_log(log);
    }

    /// Who is told what the tick is handed.
    pub(crate) fn log_mut(&mut self) -> Option<&mut Log<AXES>> {
        self.feeder.log_mut()
    }

    /// Tells the log the lists that the tick has and will have.
    pub(crate) fn tell_lists(&mut self) {
        self.control.tell_lists(&mut self.feeder);
    }

    /// The board's end of the link.
    pub(crate) fn link_mut(&mut self) -> &mut BoardLink {
        self.link.get_mut()
    }

    /// What the program switches outputs to now; see [`LiveControl::switch`].
    pub fn switch(&mut self) -> Option<OutputState> {
        self.control.switch(&self.feeder)
    }

    /// The state of live control; [`State::Waiting`] where everything that came is done, switches of outputs too.
    #[must_use]
    pub fn state(&mut self) -> State {
        match self.control.state(&self.feeder) {
            State::Waiting if self.control.source_mut().due().is_some() => State::Running,
            state => state,
        }
    }

    /// How many pieces of path and ends of stretches of the program are driven; see [`LiveControl::driven`].
    #[must_use]
    pub fn driven(&self) -> u32 {
        self.control.driven(&self.feeder)
    }

    /// Number of stops on the path because items came too late.
    #[must_use]
    pub fn starvations(&self) -> u32 {
        self.control.starvations()
    }
}

/// Has live control obey `controls`, where they differ from those `obeyed` before.
fn obey<R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize>(
    controls: &Controls,
    obeyed: &mut Controls,
    control: &mut Live<R, AXES, ITEMS, PLACES>,
) -> Requests {
    let before = core::mem::replace(obeyed, *controls);
    // Where another one has asked for a board with a dead man, the link holds without a press.
    let is_pressed = controls.presses != before.presses || controls.mode != before.mode;
    let is_homing = control.source_mut().items_mut().is_homing;
    if controls.aborts != before.aborts {
        control.abort();
    } else if is_pressed && !is_homing {
        match controls.mode {
            Mode::Run => control.resume(),
            Mode::Hold => control.hold(),
        }
    }
    set(controls, control);
    Requests {
        power: (controls.power_presses != before.power_presses).then_some(controls.is_enabled),
        clears_fault: controls.fault_resets != before.fault_resets,
        resumes: is_pressed && controls.mode == Mode::Run,
        holds: is_pressed && controls.mode == Mode::Hold,
        aborts: controls.aborts != before.aborts,
        homes: (controls.homings != before.homings).then_some(controls.home_axes),
        // What was pressed after it may have come with it.
        may_home: controls.mode == Mode::Run && controls.dead_man_ms > 0,
    }
}

/// Applies the settings among `controls`.
fn set<R: Real, const AXES: usize, const ITEMS: usize, const PLACES: usize>(
    controls: &Controls,
    control: &mut Live<R, AXES, ITEMS, PLACES>,
) {
    let is_homing = control.source_mut().items_mut().is_homing;
    // The lengths of homing are for its feeds, or slower.
    let most = if is_homing { 1.0 } else { f64::INFINITY };
    let set = control.set_override((f64::from(controls.override_permille) * 1e-3).min(most));
    debug_assert!(set.is_ok(), "the link takes no other");
    control.set_single_block(controls.is_single_block && !is_homing);
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::{ExecState, Executor};
    use motion_kernel::link::{Event, FRAME_MAX, HomingProgress, HostLink, State as MachineState};
    use motion_kernel::program::Item;
    use motion_kernel::queue::LiveStreams;
    use motion_kernel::straight::Straight;

    use super::*;
    use crate::fixture::{AXES, Random, end, identity, machine};

    const ITEMS: usize = 8;
    /// Few, so that a board has far less than the program.
    const PIECES: usize = 20;
    /// How often the stringer is driven: many more items than there is room for.
    const ROUNDS: usize = 5;

    /// The stringer again and again, with a straight way back between.
    fn items() -> Vec<Item<AXES>> {
        let machine = machine();
        let header = machine.header();
        let mut items: Vec<Item<AXES>> = Vec::new();
        for round in 0..ROUNDS {
            if round > 0 {
                let (limits, feeds_mm_s) = (header.rules.limits, [20.0; 2]);
                let back =
                    Straight::new(end(), header.start, header.pulse, limits, feeds_mm_s, header.tick_s);
                items.extend(back.expect("a way").map(|item| item.unwrap_or_else(|never| match never {})));
            }
            items.extend(machine.program.items().map(|item| item.expect("sound")));
        }
        assert!(items.len() > 150, "{}", items.len());
        items
    }

    /// What an operator and the wire do in a tick.
    #[derive(Clone, Copy, Default)]
    struct Does {
        press: Option<Mode>,
        permille: Option<u16>,
        /// Frames are lost in both directions.
        is_cut: bool,
    }

    /// The stringer over a wire that carries a frame each way in a tick, of which `loses` in a thousand get lost or damaged.
    /// Where every tick was, and how often motion stopped for want of items.
    fn sent(seed: u64, loses: u64, mut does: impl FnMut(u32, State) -> Does) -> (Vec<[Position; AXES]>, u32) {
        let machine = machine();
        let header = machine.header();
        let items = items();
        let mut random = Random(seed);
        let mut host = HostLink::<AXES, 64, 8192>::new(1);
        let mut streams = LiveStreams::<f32, AXES, PIECES, 16>::new();
        let (feeder, mut intake) = streams.split(header.rules, header.start);
        let link = BoardLink::new(9, identity(ITEMS));
        let mut board =
            Streamed::<f32, AXES, ITEMS, 64>::new(link, feeder, header.pulse, header.tick_s, Leads::NONE);
        let mut executor = Executor::<f32, AXES>::new(header.start);
        let (mut pushed, mut ticks, mut state) = (0, Vec::new(), ExecState::Idle);
        let mut requests = Vec::new();
        let mut out = [0; FRAME_MAX];
        let mut of_host = std::collections::VecDeque::new();
        let (mut is_pressed, mut waits) = (false, None);
        for now in 0..200_000 {
            let Does { press, permille, is_cut } = does(now, board.state());
            // As an operator who presses until the board has answered.
            waits = press.or(waits).filter(|&mode| !host.press(mode));
            is_pressed |= press.is_some();
            if let Some(permille) = permille {
                let _ = host.control(|controls| controls.override_permille = permille);
            }
            while pushed <= items.len() && host.push(items.get(pushed)).expect("short") {
                pushed += 1;
            }
            let mut harms = |frame: &mut Vec<u8>| {
                if random.below(1000) < loses {
                    frame.truncate(random.below(frame.len() as u64 + 1) as usize);
                }
                if is_cut {
                    frame.clear();
                }
            };
            let now_ms = now / 2;
            let length = host.transmit(now_ms, &mut out);
            let mut frame = out[..length].to_vec();
            harms(&mut frame);
            of_host.extend(frame);
            let asked = board.receive(&mut || of_host.pop_front());
            board.plan(&|| false, &mut || of_host.pop_front()).expect("executable");
            requests.push(asked);
            let executed = executor.tick(&mut intake).expect("no fault");
            state = executed.state;
            ticks.push(executed.setpoints.map(|setpoint| setpoint.position));
            let status = |came: Came| Status {
                tick: now,
                state: MachineState::Moving,
                set: [Position::ZERO; AXES],
                actual: [Position::ZERO; AXES],
                feed_mm_s: 0.0,
                line: 0,
                aborts: came.aborts,
                taken: came.taken,
                driven: 0,
                is_ended: came.is_ended,
                starvations: 0,
                is_ready: true,
                fault: None,
                homing: HomingProgress::None,
                homed: [None; AXES],
            };
            let length = board.transmit(now_ms, now.is_multiple_of(40).then_some(&status), &mut out);
            let mut frame = out[..length].to_vec();
            harms(&mut frame);
            host.receive(&frame, now_ms, &mut |event| {
                assert!(!matches!(event, Event::Unreadable { .. } | Event::Restarted { .. }), "{event:?}");
            });
            let is_done = pushed > items.len() && host.waiting() == 0 && is_pressed;
            if is_done && board.state() == State::Waiting && state == ExecState::Idle {
                let resumes = requests.iter().filter(|requests| requests.resumes).count();
                assert!(
                    resumes > 0
                        && requests.iter().all(|requests| requests.power.is_none() && !requests.clears_fault)
                );
                return (ticks, board.starvations());
            }
        }
        panic!("it never ends: {state:?}");
    }

    /// The first and the last tick that moved the machine.
    fn moving(ticks: &[[Position; AXES]]) -> &[[Position; AXES]] {
        let first = ticks.windows(2).position(|pair| pair[0] != pair[1]).expect("motion");
        let last = ticks.windows(2).rposition(|pair| pair[0] != pair[1]).expect("motion");
        &ticks[first..=last + 1]
    }

    fn starts(now: u32) -> Does {
        Does { press: (now == 300).then_some(Mode::Run), ..Does::default() }
    }

    /// What f32 rounds along a cruise. Where items come late, live control divides a cruise elsewhere.
    const ROUNDING_MM: f64 = 1e-6;

    /// Held until the operator's command; then every tick is the same, whatever the wire does, as long as items come in time:
    /// mostly to the bit.
    #[test]
    fn a_bad_wire_changes_no_tick() {
        let (clean, starvations) = sent(1, 0, |now, _| starts(now));
        assert_eq!((starvations, clean.last()), (0, Some(&end())));
        assert!(clean[..300].iter().all(|at| *at == machine().header().start), "it moves before the command");
        let mut same = 0;
        for seed in 2..12 {
            println!("seed {seed}");
            let (ticks, starvations) = sent(seed, 100, |now, _| starts(now));
            assert_eq!(starvations, 0);
            let (ticks, clean) = (moving(&ticks), moving(&clean));
            assert_eq!(ticks.len(), clean.len());
            same += u32::from(ticks == clean);
            for (at, expected) in ticks.iter().zip(clean).flat_map(|(a, b)| a.iter().zip(b)) {
                assert!((*at - *expected).to_mm().abs() < ROUNDING_MM, "{at:?} {expected:?}");
            }
        }
        assert!(same >= 3, "only {same} of 10 are the same to the bit");
    }

    /// Longer than all that a board has room for takes.
    const CUT_TICKS: u32 = 45_000;

    /// The cable is out for seconds: motion ends at rest where the items that came end, and goes on when more come.
    #[test]
    fn a_cable_that_is_out_is_a_stop_on_the_path() {
        for (seed, out) in (1..8).zip([301, 1700, 5200, 14_900, 22_600, 33_300, 44_000]) {
            println!("seed {seed}, out at tick {out}");
            let (ticks, _) = sent(seed, 20, |now, _| Does {
                is_cut: (out..out + CUT_TICKS).contains(&now),
                ..starts(now)
            });
            assert_eq!(ticks.last(), Some(&end()));
            // At rest for a second before the cable is in again.
            let until = (out + CUT_TICKS) as usize;
            let rests = &ticks[until - 2000..until];
            assert!(rests.iter().all(|at| *at == rests[0]), "it moves");
        }
    }

    /// Holds and overrides at random times, over a wire that loses a tenth.
    #[test]
    fn commands_get_through() {
        for seed in 1..8 {
            println!("seed {seed}");
            let mut random = Random(seed + 77);
            let (mut held, mut waits) = (0, 0);
            let (ticks, _) = sent(seed, 100, |now, state| {
                let mut does = starts(now);
                if state == State::Held && now > 400 {
                    waits += 1;
                    // Until the resume has come.
                    does.press = (waits % 200 == 1).then_some(Mode::Run);
                } else if now > 400 && random.below(600) == 0 {
                    held += 1;
                    does.press = Some(Mode::Hold);
                } else if random.below(900) == 0 {
                    does.permille = Some(300 + random.below(1700) as u16);
                }
                does
            });
            assert!(held > 3 && waits > 3, "{held} {waits}");
            assert_eq!(ticks.last(), Some(&end()));
        }
    }
}
