//! The background: start button, console, streams and log.
//!
//! Consumes the [`Panel`] and the tick's results in [`Control`]; produces items for the streams and at most
//! one [`LogLine`] per poll. Runs in the time that the ticks leave: the board calls [`Background::poll`]
//! right after a tick, logs its line, and calls [`Background::plan`], over and over.
//!
//! A poll begins right after a tick with the parts that mask interrupts: taking figures out of [`Control`],
//! and the log line (defmt encodes it with interrupts masked). Both are over long before the next tick, so
//! neither delays it. Then come planning and filling, which may take several ticks and mask nothing.
//!
//! On failure it brings the machine to rest and logs why; in a fault, with drives off.

use motion_kernel::exec::ExecState;
use motion_kernel::hal::OutputState;
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::program::{ProgramError, Reader, SupplyError};
use motion_kernel::queue::LiveStreams;
use motion_kernel::straight::StraightError;
use motion_kernel::units::Position;
use rtic_core::Mutex;

use crate::console::Command;
use crate::control::{Control, Seen};
use crate::log::LogLine;
use crate::operator::{Action, Asked, Phase, Settings};
use crate::panel::{Button, Panel};
use crate::parameters::BoardParameters;
use crate::report::{FlightDump, Report};
use crate::runs::Run;

/// The state of the background. `PIECES` and `SEGMENTS` are those of [`LiveStreams`], `PLACES` that of
/// [`Run`].
pub struct Background<
    'a,
    R: Real,
    const AXES: usize,
    const PIECES: usize,
    const SEGMENTS: usize,
    const PLACES: usize,
> {
    board: BoardParameters,
    program: Reader<'a, AXES>,
    phase: Phase,
    settings: Settings,
    /// The streams, until the first start.
    streams: Option<&'a mut LiveStreams<R, AXES, PIECES, SEGMENTS>>,
    run: Option<Run<'a, R, AXES, PLACES>>,
    /// Where the next run starts from.
    from: Option<[Position; AXES]>,
    /// Why there is no way to the program's start.
    no_way: Option<StraightError>,
    /// Why the program ends early.
    refused: Option<SupplyError<ProgramError>>,
    /// The log has said that motion waits for the operator.
    has_said: bool,
    /// The program has spindle or coolant on.
    is_on: bool,
    button: Button,
    dump: FlightDump,
    report: Report,
}

impl<'a, R: Real, const AXES: usize, const PIECES: usize, const SEGMENTS: usize, const PLACES: usize>
    Background<'a, R, AXES, PIECES, SEGMENTS, PLACES>
{
    /// Ready for the first start of `program`.
    #[must_use]
    pub fn new(
        board: BoardParameters,
        program: Reader<'a, AXES>,
        streams: &'a mut LiveStreams<R, AXES, PIECES, SEGMENTS>,
    ) -> Self {
        Self {
            board,
            program,
            phase: Phase::Ready,
            settings: Settings::NONE,
            streams: Some(streams),
            run: None,
            from: None,
            no_way: None,
            refused: None,
            has_said: false,
            is_on: false,
            button: Button::default(),
            dump: FlightDump::default(),
            report: Report::default(),
        }
    }

    /// The first part of a poll, right after tick `now`: handles the operator's requests and the tick's
    /// results. Returns a line to log, if any.
    // In its own stack frame, which is free again while motion is planned.
    #[inline(never)]
    pub fn poll<const ROWS: usize, const AFTER: usize>(
        &mut self,
        now: u32,
        panel: &mut impl Panel,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        let seen = control.lock(|control| control.seen());
        let asked = if self.button.is_pressed(panel.is_button_down(), now, self.board.button_ticks()) {
            Some(Asked::Press)
        } else {
            core::iter::from_fn(|| panel.next_byte()).find_map(Command::of).map(Asked::Command)
        };
        if let Some(line) = self.follow(&seen, asked, control) {
            return Some(line);
        }
        if self.phase == Phase::Faulted
            && let Some(line) = self.dump.line(now, &self.board, control)
        {
            return Some(line);
        }
        let counts = [self.run.as_ref().map_or(0, Run::starvations), panel.bytes_lost()];
        self.report.line(now, &self.board, counts, control)
    }

    /// The second part of a poll, which may take several ticks, unless a hold waits on the `panel`. Also in a fault: it
    /// may end in a stop on the path.
    pub fn plan(&mut self, panel: &impl Panel) {
        let Some(run) = &mut self.run else { return };
        if let Some(here) = self.from.take() {
            self.no_way = run.start(here).err();
        }
        run.set(&self.settings);
        let is_held = matches!(self.phase, Phase::Running { is_held: true, .. });
        let is_hold_waiting = || {
            panel.waiting_byte().and_then(Command::of) == Some(Command::Hold)
                || panel.is_button_down() && !self.button.is_seen()
        };
        let is_stop_asked = || {
            panel.note_step();
            !is_held && is_hold_waiting()
        };
        self.refused = run.poll(&is_stop_asked).err();
    }

    /// Notes the duration of a poll, log included, in cycles of the board's counter.
    pub fn note_poll(&mut self, cycles: u32) {
        self.report.note_poll(cycles);
    }

    /// Handles the tick's results, then the operator's requests.
    fn follow<const ROWS: usize, const AFTER: usize>(
        &mut self,
        seen: &Seen<R, AXES>,
        asked: Option<Asked>,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        if let Some(line) = self.ended(seen) {
            return Some(line);
        }
        if let (Phase::Running { .. }, Some(run)) = (self.phase, &mut self.run) {
            let is_stopped = seen.state == ExecState::Stopped;
            self.phase = Phase::Running { is_held: run.is_held(), is_stopped };
        }
        match asked {
            Some(asked) => self.act(Action::of(self.phase, asked), seen, control),
            None => self.switched(seen, control).or_else(|| self.came_to_rest(seen)),
        }
    }

    /// Returns the line to log if the board has just reached a state that only a reset ends.
    fn ended(&mut self, seen: &Seen<R, AXES>) -> Option<LogLine<R, AXES>> {
        if matches!(self.phase, Phase::Ready | Phase::Faulted) {
            return None;
        }
        if let Some(fault) = seen.fault {
            self.phase = Phase::Faulted;
            return Some(LogLine::Fault(fault));
        }
        if let (Phase::Running { .. }, Some(error), Some(run)) = (self.phase, self.refused, &mut self.run) {
            run.hold();
            self.phase = Phase::Refused;
            return Some(LogLine::Refused(error));
        }
        let error = self.no_way.take()?;
        self.phase = Phase::Refused;
        Some(LogLine::NoWay(error))
    }

    /// Switches spindle and coolant where the program says so, and all off once motion of a refused program rests;
    /// returns the line to log.
    fn switched<const ROWS: usize, const AFTER: usize>(
        &mut self,
        seen: &Seen<R, AXES>,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        let run = self.run.as_mut()?;
        let to = match self.phase {
            Phase::Running { .. } => run.switch()?,
            // At a program stop it is neither held nor at its end.
            Phase::Refused
                if self.is_on
                    && (seen.state == ExecState::Stopped
                        || matches!(run.state(), State::Held | State::Failed | State::Waiting)) =>
            {
                OutputState::OFF
            }
            _ => return None,
        };
        self.is_on = to != OutputState::OFF;
        control.lock(|control| control.switch(to));
        Some(LogLine::Switched(to))
    }

    /// Returns the line to log if a run has just ended, or waits for the operator.
    fn came_to_rest(&mut self, seen: &Seen<R, AXES>) -> Option<LogLine<R, AXES>> {
        let (Phase::Running { is_stopped, .. }, Some(run)) = (self.phase, &mut self.run) else { return None };
        let state = run.state();
        if state == State::Waiting && seen.state == ExecState::Idle {
            self.phase = Phase::Done;
            return Some(LogLine::Done);
        }
        let had_said = core::mem::replace(&mut self.has_said, is_stopped || state == State::Held);
        if had_said || !self.has_said {
            return None;
        }
        Some(if is_stopped { LogLine::ProgramStop } else { LogLine::Held })
    }

    /// Carries an action out.
    fn act<const ROWS: usize, const AFTER: usize>(
        &mut self,
        action: Action,
        seen: &Seen<R, AXES>,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<LogLine<R, AXES>> {
        Some(match (action, &mut self.run) {
            (Action::Start, None) if !seen.is_healthy => LogLine::NotReady,
            (Action::Start, None) => {
                let here = self.first_start(control)?;
                self.start(here)
            }
            // At rest the set position is exactly where the streams ended.
            (Action::Start, Some(_)) => self.start(seen.position),
            (Action::Hold, Some(run)) => {
                run.hold();
                LogLine::Holding
            }
            (Action::Resume, Some(run)) => {
                if let Phase::Running { is_stopped: true, .. } = self.phase {
                    control.lock(|control| control.kernel.resume());
                }
                run.resume();
                self.has_said = false;
                LogLine::Resumed
            }
            (Action::Override(step), _) => {
                self.settings.feed_override = self.settings.feed_override.after(step);
                LogLine::Override(self.settings.feed_override.percent())
            }
            (Action::SingleBlock(is_single), _) => {
                self.settings.is_single = is_single;
                LogLine::SingleBlock(is_single)
            }
            (Action::Nothing(why), _) => LogLine::Nothing(why),
            // There is no run to hold in the phases before the first start.
            (Action::Hold | Action::Resume, None) => return None,
        })
    }

    /// Takes the actual position, which it returns, gives the streams to the tick and enables the drives.
    fn first_start<const ROWS: usize, const AFTER: usize>(
        &mut self,
        control: &mut impl Mutex<T = Control<'a, R, AXES, ROWS, AFTER>>,
    ) -> Option<[Position; AXES]> {
        // Also clears the faults of a machine that was not ready yet.
        let here = control.lock(|control| {
            control.flight.clear();
            control.kernel.clear_fault()
        });
        // Nothing has been enabled yet, so no reaction can be under way.
        let (here, streams) = here.zip(self.streams.take())?;
        let (feeder, intake) = streams.split(self.program.header().rules, here);
        control.lock(|control| {
            control.intake = intake;
            control.kernel.enable(self.board.settle_ticks());
        });
        self.run = Some(Run::new(self.program, feeder, self.board.leads));
        Some(here)
    }

    /// Starts a run from `here`, as soon as that is logged.
    fn start(&mut self, here: [Position; AXES]) -> LogLine<R, AXES> {
        self.from = Some(here);
        self.phase = Phase::Running { is_held: false, is_stopped: false };
        self.has_said = false;
        LogLine::Started(here)
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::fault::FaultKind;
    use motion_kernel::flight::FlightRecorder;
    use motion_kernel::hal::Spindle;
    use motion_kernel::kernel::Kernel;
    use motion_kernel::law::Ticks;
    use motion_kernel::program::{Item, write};
    use motion_kernel::queue::Streams;
    use motion_kernel::units::Counts;
    use rtic_core::Exclusive;

    use super::*;
    use crate::fixture::{AXES, BOARD, IdealDrives, TICK_S, end, machine};

    /// What an operator does at which tick.
    #[derive(Default)]
    struct Hands {
        down_from: u32,
        now: u32,
        byte: Option<u8>,
    }

    impl Panel for Hands {
        fn is_button_down(&self) -> bool {
            (self.down_from..self.down_from + 100).contains(&self.now)
        }
        fn note_step(&self) {}
        fn waiting_byte(&self) -> Option<u8> {
            self.byte
        }
        fn next_byte(&mut self) -> Option<u8> {
            self.byte.take()
        }
        fn bytes_lost(&self) -> u32 {
            0
        }
    }

    type Lines = Vec<(u32, LogLine<f32, AXES>)>;

    /// A board from its start on, with a poll after every tick. Before tick `n` `script` does what it says in
    /// it; the lines of its log without reports, its set position and whether its drives are enabled.
    fn board(
        ticks: u32,
        script: impl FnMut(u32, &mut Hands, &mut Option<FaultKind<f32>>, &Lines),
    ) -> (Lines, [Position; AXES], bool) {
        let seen = board_of(machine().program, ticks, script);
        (seen.lines, seen.position, seen.is_enabled)
    }

    /// What was seen of a board.
    struct SeenOf {
        lines: Lines,
        position: [Position; AXES],
        is_enabled: bool,
        switched: Vec<(u32, OutputState)>,
        /// The first and the last tick that changed the set position.
        moved: [u32; 2],
    }

    /// The same of a board with another program.
    fn board_of(
        program: Reader<'static, AXES>,
        ticks: u32,
        mut script: impl FnMut(u32, &mut Hands, &mut Option<FaultKind<f32>>, &Lines),
    ) -> SeenOf {
        let machine = machine();
        let header = *machine.header();
        let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
        let mut empty = Streams::<f32, AXES, 2, 2>::new();
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let mut drives = IdealDrives::new();
        let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
        let (_, intake) = empty.split(header.rules, header.start);
        let mut control = Control::new(kernel, intake, &mut flight);
        let mut background = Background::<f32, AXES, 64, 16, 64>::new(BOARD, program, &mut streams);
        let (mut hands, mut lines, mut moved) = (Hands::default(), Lines::new(), [0; 2]);
        let mut position = header.start;
        hands.down_from = u32::MAX - 100;
        for now in 1..=ticks {
            hands.now = now;
            let mut unhealthy = None;
            script(now, &mut hands, &mut unhealthy, &lines);
            drives.now = now;
            control.tick(unhealthy, None, &mut drives);
            if control.seen().position != position {
                position = control.seen().position;
                moved = [if moved[0] == 0 { now } else { moved[0] }, now];
            }
            let line = background.poll(now, &mut hands, &mut Exclusive(&mut control));
            lines.extend(line.filter(|line| !is_report(line)).map(|line| (now, line)));
            background.plan(&hands);
        }
        let IdealDrives { is_enabled, switched, .. } = drives;
        SeenOf { lines, position, is_enabled, switched, moved }
    }

    fn is_report(line: &LogLine<f32, AXES>) -> bool {
        use LogLine::{Background, FollowingErrors, Ticks};
        matches!(line, Ticks { .. } | FollowingErrors(_) | Background { .. })
    }

    fn said(lines: &Lines) -> Vec<LogLine<f32, AXES>> {
        lines.iter().map(|&(_, line)| line).collect()
    }

    #[test]
    fn a_press_starts_the_next_one_holds_the_third_resumes_and_it_comes_to_the_end() {
        let start = machine().header().start;
        let (lines, position, is_enabled) = board(8000, |now, hands, _, _| {
            if matches!(now, 100 | 1500 | 2500) {
                hands.down_from = now;
            }
        });
        use LogLine::{Done, Held, Holding, Resumed, Started};
        assert_eq!(said(&lines), [Started(start), Holding, Held, Resumed, Done]);
        assert_eq!(lines[0].0, 100 + BOARD.button_ticks());
        assert_eq!((position, is_enabled), (end(), true));
    }

    const ON: OutputState =
        OutputState { spindle: Spindle::Clockwise, speed_rpm: 9000.0, flood: true, mist: false };
    /// The wait for the spindle.
    const WAIT_TICKS: u32 = 300;

    /// The stringer with spindle and coolant on, up to its end; then what `more` says.
    fn with_outputs(more: &[Item<AXES>]) -> Reader<'static, AXES> {
        let stringer = machine();
        let wait = Ticks::from_seconds(f64::from(WAIT_TICKS) * TICK_S, TICK_S).expect("some ticks");
        let mut items = vec![Item::Switch(ON), Item::Dwell(wait)];
        items.extend(stringer.program.items().map(|item| item.expect("an item")));
        items.extend(more);
        let (mut bytes, guards) = (Vec::new(), stringer.program.guards().expect("guards"));
        write(stringer.header(), guards.as_ref(), &items, &mut bytes).expect("short");
        Reader::new(bytes.leak()).expect("a program")
    }

    #[test]
    fn spindle_and_coolant_switch_in_order_with_motion_and_twice_in_two_runs() {
        let program = with_outputs(&[Item::Switch(OutputState::OFF)]);
        let seen = board_of(program, 30_000, |now, hands, _, _| {
            if matches!(now, 100 | 8000) {
                hands.down_from = now;
            }
        });
        use LogLine::{Done, Started, Switched};
        let off = OutputState::OFF;
        assert_eq!(
            said(&seen.lines),
            [
                Started(machine().header().start),
                Switched(ON),
                Switched(off),
                Done,
                Started(end()),
                Switched(ON),
                Switched(off),
                Done
            ]
        );
        let ticks: Vec<u32> = seen.switched.iter().map(|(tick, _)| *tick).collect();
        assert_eq!(seen.switched.iter().map(|(_, to)| *to).collect::<Vec<_>>(), [ON, off, ON, off]);
        // In the tick after the poll that says so.
        for (tick, line) in ticks.iter().zip([1, 2, 5, 6]) {
            assert_eq!(*tick, seen.lines[line].0 + 1);
        }
        assert!(seen.moved[0] > ticks[0] + WAIT_TICKS, "{:?} {ticks:?}", seen.moved);
        assert!(seen.moved[1] < ticks[3], "{:?} {ticks:?}", seen.moved);
    }

    #[test]
    fn a_hold_leaves_spindle_and_coolant_on_and_a_fault_switches_them_off_in_its_tick() {
        let program = with_outputs(&[Item::Switch(OutputState::OFF)]);
        let seen = board_of(program, 9000, |now, hands, unhealthy, _| {
            *unhealthy = (now == 4000).then_some(FaultKind::EmergencyStop);
            if matches!(now, 100 | 1500 | 3000) {
                hands.down_from = now;
            }
        });
        assert!(said(&seen.lines).contains(&LogLine::Held));
        assert!(seen.moved[1] > 3000 && !seen.is_enabled);
        let [(_, first), last] = seen.switched[..] else { panic!("{:?}", seen.switched) };
        assert_eq!((first, last), (ON, (4000, OutputState::OFF)));
        // Nothing is on, nothing is switched.
        let seen = board_of(with_outputs(&[]), 4000, |now, _, unhealthy, _| {
            *unhealthy = (now == 1500).then_some(FaultKind::EmergencyStop);
        });
        assert_eq!(seen.switched, []);
    }

    /// In single block a switch waits for the resume, as motion does: after a block, and after the way to the start of a
    /// second run.
    #[test]
    fn in_single_block_nothing_is_switched_before_the_resume() {
        let program = with_outputs(&[Item::Switch(OutputState::OFF)]);
        let seen = board_of(program, 60_000, |now, hands, _, lines| {
            hands.byte = (now == 50).then_some(b's');
            let rests = |&(at, line): &(u32, LogLine<f32, AXES>)| {
                now == at + 100 && matches!(line, LogLine::Held | LogLine::Done)
            };
            if now == 100 || lines.last().is_some_and(rests) {
                hands.down_from = now;
            }
        });
        let lines = said(&seen.lines);
        let switched: Vec<usize> =
            (0..lines.len()).filter(|&index| matches!(lines[index], LogLine::Switched(_))).collect();
        assert!(switched.len() >= 4, "{lines:?}");
        // The first is the beginning of the first run, which has no way to its start.
        for &index in &switched[1..] {
            assert_eq!(lines[index - 1], LogLine::Resumed, "{index}: {lines:?}");
        }
    }

    /// The program is refused on the way: all is off once motion rests.
    #[test]
    fn a_refused_program_ends_with_all_off_at_rest() {
        let start = end();
        let broken =
            Item::Line { line: 9, start, direction: [f64::NAN; AXES], length: Position::from_bits(1 << 32) };
        let seen = board_of(with_outputs(&[broken]), 9000, |now, hands, _, _| {
            if now == 100 {
                hands.down_from = now;
            }
        });
        assert!(said(&seen.lines).iter().any(|line| matches!(line, LogLine::Refused(_))), "{:?}", seen.lines);
        let [(_, first), (tick, last)] = seen.switched[..] else { panic!("{:?}", seen.switched) };
        assert_eq!((first, last), (ON, OutputState::OFF));
        assert!(tick > seen.moved[1], "{tick} {:?}", seen.moved);
    }

    #[test]
    fn the_console_does_what_its_letters_say_and_starts_nothing() {
        let (lines, position, is_enabled) = board(500, |now, hands, _, _| {
            hands.byte =
                [b'r', b'h', b'u', b's', b'x'].get((now / 100) as usize).copied().filter(|_| now % 100 == 0);
        });
        use LogLine::{Nothing, Override, SingleBlock};
        assert!(matches!(said(&lines)[..], [Nothing(_), Override(110), SingleBlock(true)]), "{lines:?}");
        assert_eq!((position, is_enabled), (machine().header().start, false));
    }

    #[test]
    fn a_board_that_is_not_ready_does_not_start_and_starts_once_it_is() {
        let (lines, position, _) = board(8000, |now, hands, unhealthy, _| {
            *unhealthy = (now < 1000).then_some(FaultKind::EmergencyStop);
            if matches!(now, 500 | 1500) {
                hands.down_from = now;
            }
        });
        use LogLine::{Done, NotReady, Started};
        assert!(matches!(said(&lines)[..], [NotReady, Started(_), Done]), "{lines:?}");
        assert_eq!(position, end());
    }

    /// The rows are those around the fault, a line every 10 ms, and nothing starts any more.
    #[test]
    fn a_fault_is_said_once_its_rows_follow_and_only_a_reset_helps() {
        let (lines, _, is_enabled) = board(4000, |now, hands, unhealthy, _| {
            *unhealthy = (now == 1500).then_some(FaultKind::Drive { axis: 1 });
            if matches!(now, 100 | 2500) {
                hands.down_from = now;
            }
        });
        assert!(
            matches!(lines[1], (1500, LogLine::Fault(fault)) if fault.kind == FaultKind::Drive { axis: 1 })
        );
        let rows: Vec<_> = lines
            .iter()
            .filter_map(|(tick, line)| match line {
                LogLine::Flight(row) => Some((*tick, row.tick)),
                _ => None,
            })
            .collect();
        assert_eq!(rows.len(), 16, "{rows:?}");
        assert!(
            rows.windows(2)
                .all(|two| two[1].0 - two[0].0 >= BOARD.flight_line_ticks() && two[1].1 == two[0].1 + 1)
        );
        let nothing = lines.iter().filter(|(_, line)| matches!(line, LogLine::Nothing(_)));
        assert_eq!((nothing.count(), lines.len()), (1, 2 + 16 + 1));
        assert!(!is_enabled);
    }

    #[test]
    fn reports_come_once_a_second() {
        let mut ticks = Vec::new();
        let machine = machine();
        let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
        let mut empty = Streams::<f32, AXES, 2, 2>::new();
        let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
        let start = machine.header().start;
        let kernel = Kernel::new(&machine.axes, start, [Counts(0); AXES]);
        let (_, intake) = empty.split(machine.header().rules, start);
        let mut control = Control::new(kernel, intake, &mut flight);
        let mut background = Background::<f32, AXES, 64, 16, 64>::new(BOARD, machine.program, &mut streams);
        let mut hands = Hands { down_from: u32::MAX - 100, ..Hands::default() };
        for now in 1..=10_000 {
            control.timing.add(100 + now, 20, now == 1);
            background.note_poll(1_680_000);
            match background.poll(now, &mut hands, &mut Exclusive(&mut control)) {
                Some(LogLine::Ticks { timing, overruns }) => {
                    assert_eq!(overruns, 1);
                    ticks.push((now, timing.ticks));
                }
                Some(LogLine::Background { longest_poll_us, .. }) => assert_eq!(longest_poll_us, 10_000),
                Some(LogLine::FollowingErrors(_)) => {}
                other => assert_eq!(other, None),
            }
        }
        let expected: Vec<_> = (0..5).map(|second| (2000 * second + 1, 2000)).collect();
        assert_eq!(ticks[1..], expected[1..]);
    }
}
