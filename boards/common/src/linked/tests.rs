//! A board and an operator's side, over a wire: programs, faults, aborts, homing, the flight recorder.

use hal_sim::{SimHome, SimHomes};
use motion_kernel::fault::FaultKind;
use motion_kernel::flight::{FlightRecorder, FlightRow};
use motion_kernel::hal::Spindle;
use motion_kernel::kernel::Kernel;
use motion_kernel::link::{Event, FRAME_MAX, HostLink, Mode, State, Status};
use motion_kernel::program::Item;
use motion_kernel::queue::LiveStreams;
use motion_kernel::units::{Counts, Position};
use rtic_core::Exclusive;

use super::*;
use crate::fixture::{AXES, BOARD, IdealDrives, Random, TICK_S, end, identity, machine};
use crate::runs::to_start;

mod homing;

type Host = HostLink<AXES, 64, 8192>;

const ITEMS: usize = 8;

/// A program from `from` on: a straight way to the stringer's start, and the stringer.
fn stringer(from: [Position; AXES]) -> Vec<Option<Item<AXES>>> {
    let machine = machine();
    let way = to_start(machine.header(), from)
        .expect("a way")
        .map(|item| item.unwrap_or_else(|never| match never {}));
    way.chain(machine.program.items().map(|item| item.expect("sound"))).map(Some).chain([None]).collect()
}

/// What an operator's side knows and does.
struct Operator {
    host: Host,
    status: Option<Status<AXES>>,
    /// What it still has to send.
    items: std::collections::VecDeque<Option<Item<AXES>>>,
    is_ready: bool,
    /// The fault that the board's inputs find from now on.
    unhealthy: Option<FaultKind<f32>>,
    /// The board's own hold.
    is_held: bool,
    /// Nothing comes from the operator any more.
    is_silent: bool,
    /// The board's background has time for a poll in one of so many ticks.
    polled_in: u32,
    /// So many frames in a thousand are cut, in both directions.
    loses: u64,
    random: Random,
    /// Rows of the flight recorder that have come.
    flight: Vec<FlightRow<f64, AXES>>,
    flight_rows: Option<u16>,
}

impl Operator {
    fn state(&self) -> Option<State> {
        self.status.map(|status| status.state)
    }

    /// Everything is sent and driven.
    fn is_done(&self) -> bool {
        self.items.is_empty()
            && self.host.waiting() == 0
            && self.status.is_some_and(|status| {
                status.state == State::Idle
                    && status.aborts == self.host.controls().aborts
                    && status.taken == self.host.confirmed()
            })
    }
}

/// What was seen of a board.
struct Seen {
    /// Every state with the set position when it was told first.
    states: Vec<(State, [Position; AXES])>,
    drives: IdealDrives,
    lines: Vec<LogLine<f32, AXES>>,
}

/// A board and an operator over a good wire, until `script` says that it is over; it is called before every tick.
fn board(script: impl FnMut(u32, &mut Operator) -> bool) -> Seen {
    board_with([const { None }; AXES], script)
}

/// The same with home switches and index pulses.
fn board_with(homes: [Option<SimHome>; AXES], mut script: impl FnMut(u32, &mut Operator) -> bool) -> Seen {
    let machine = machine();
    let header = *machine.header();
    let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
    let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
    let (feeder, intake) = streams.split(header.rules, header.start);
    let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
    let mut control = Control::new(kernel, intake, &mut flight);
    let link = BoardLink::new(3, identity(ITEMS));
    let mut linked = Linked::<f32, AXES, ITEMS, 64, 0>::new(&BOARD, link, feeder, header.pulse);
    linked.set_homing(&homing::figures(), header.pulse);
    let mut drives = IdealDrives::new();
    drives.homes = SimHomes::new(homes);
    let mut operator = Operator {
        host: Host::new(1),
        status: None,
        items: std::collections::VecDeque::new(),
        is_ready: false,
        unhealthy: None,
        is_held: false,
        is_silent: false,
        polled_in: 1,
        loses: 0,
        random: Random(7),
        flight: Vec::new(),
        flight_rows: None,
    };
    let (mut out, mut to_board) = ([0; FRAME_MAX], std::collections::VecDeque::new());
    let (mut states, mut lines): (Vec<(State, _)>, _) = (Vec::new(), Vec::new());
    for now in 1..200_000 {
        if script(now, &mut operator) {
            return Seen { states, drives, lines };
        }
        let Operator {
            host,
            items,
            status,
            is_ready,
            unhealthy,
            is_held,
            is_silent,
            polled_in,
            loses,
            random,
            flight,
            flight_rows,
        } = &mut operator;
        let mut cut = |length: usize| {
            if random.below(1000) < *loses { random.below(length as u64 + 1) as usize } else { length }
        };
        while let Some(item) = items.front()
            && *is_ready
            && host.push(item.as_ref()).expect("short")
        {
            items.pop_front();
        }
        let now_ms = now / 2;
        let length = if *is_silent { 0 } else { host.transmit(now_ms, &mut out) };
        to_board.extend(out[..cut(length)].iter().copied());
        drives.now = now;
        control.tick(*unhealthy, None, &mut drives);
        let mut control = Exclusive(&mut control);
        lines.extend(linked.line(now, 0, &mut control));
        if now % *polled_in == 0 {
            linked.poll_unless(&|| *is_held, &mut || to_board.pop_front(), &mut control);
        }
        let length = linked.transmit(now_ms, &mut control, &mut out);
        host.receive(&out[..cut(length)], now_ms, &mut |event| match event {
            Event::Status(told) => {
                if states.last().is_none_or(|(state, _)| *state != told.state) {
                    states.push((told.state, told.set));
                }
                *status = Some(told);
            }
            Event::Ready { .. } => *is_ready = true,
            Event::Flight { rows, kept, .. } => {
                flight.extend(kept);
                *flight_rows = Some(rows);
            }
            Event::Welcome(found) => assert_eq!(found, identity(ITEMS)),
            other => panic!("{other:?}"),
        });
    }
    panic!("it never ends: {states:?}")
}

/// The states alone.
fn names(seen: &Seen) -> Vec<State> {
    seen.states.iter().map(|&(state, _)| state).collect()
}

/// Enables, drives the stringer from where the machine stands, and is over.
fn drive(step: &mut u32, operator: &mut Operator) -> bool {
    match *step {
        0 if operator.status.is_some_and(|status| status.is_ready) => {
            assert!(operator.host.enable(true));
            operator.is_ready = false;
            *step = 1;
        }
        1 if operator.is_ready && operator.state() == Some(State::Held) => {
            operator.items.extend(stringer(operator.status.expect("held").set));
            assert!(operator.host.press(Mode::Run));
            *step = 2;
        }
        2 if operator.is_done() => *step = 3,
        _ => {}
    }
    *step == 3
}

#[test]
fn a_program_is_driven_from_where_the_machine_stands() {
    let mut step = 0;
    let seen = board(|_, operator| drive(&mut step, operator));
    assert_eq!(names(&seen), [State::Off, State::Held, State::Moving, State::Idle]);
    assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
    assert!(seen.drives.is_enabled);
}

/// What is told to be driven is where motion is: on the piece after it, in every status; and the next program counts anew.
#[test]
fn pieces_are_counted_as_they_are_driven() {
    let (mut step, mut path, mut last, mut seen) = (0, Vec::new(), 0, 0);
    board(|now, operator| {
        let before = step;
        let is_over = drive(&mut step, operator);
        if (before, step) == (1, 2) {
            let items = stringer(operator.status.expect("held").set);
            path = items
                .into_iter()
                .filter_map(|item| match item? {
                    Item::Line { start, length, .. } | Item::Septic { start, length, .. } => {
                        Some((start, length))
                    }
                    Item::EndOfStretch(end) => Some((end, Position::ZERO)),
                    _ => None,
                })
                .collect();
        }
        let Some(status) = operator.status.filter(|status| status.aborts == operator.host.controls().aborts)
        else {
            return is_over;
        };
        assert!(status.driven >= last, "tick {now}: {} after {last}", status.driven);
        last = status.driven;
        if step == 2
            && let Some((start, length)) = path.get(last as usize)
        {
            let squares = status.set.iter().zip(start).map(|(set, start)| (*set - *start).to_mm().powi(2));
            let from_start_mm = squares.sum::<f64>().sqrt();
            assert!(from_start_mm <= length.to_mm() + 1e-4, "tick {now}: {from_start_mm} mm of {length:?}");
            seen = seen.max(last);
        }
        is_over
    });
    assert_eq!(last as usize, path.len());
    assert!(seen > 10 && path.len() >= 15, "{seen} of {}", path.len());
}

/// After an abort nothing of the program before counts for the next one.
#[test]
fn after_an_abort_the_count_begins_anew() {
    let mut step = 0;
    let mut counts = Vec::new();
    board(|now, operator| {
        if now < 2500 {
            drive(&mut step, operator);
        } else if now == 2500 {
            counts.push(operator.status.expect("told").driven);
            assert!(operator.host.abort());
            operator.items.clear();
        }
        if let Some(status) =
            operator.status.filter(|status| now > 2500 && status.aborts == operator.host.controls().aborts)
        {
            counts.push(status.driven);
        }
        now == 5000
    });
    assert!(counts[0] > 0 && counts.len() > 100 && counts[1..].iter().all(|count| *count == 0), "{counts:?}");
}

/// Off before the operator's command, whatever else was pressed.
#[test]
fn only_the_operators_command_enables() {
    let seen = board(|now, operator| {
        if now % 300 == 100 && operator.is_ready {
            assert!(operator.host.press(Mode::Run));
            operator.items.push_back(Some(Item::Switch(ON)));
            operator.items.extend(stringer(machine().header().start));
        }
        now == 5000
    });
    assert_eq!(names(&seen), [State::Off]);
    assert!(!seen.drives.is_enabled && seen.drives.switched.is_empty());
}

/// An abort in the middle of a program that the board has only the beginning of: nothing of it is driven any more, and
/// another program follows from where the machine came to rest.
#[test]
fn after_an_abort_another_program_is_driven() {
    for at in [2000, 2500, 3100, 4000] {
        println!("abort at {at}");
        let (mut step, mut next) = (0, 1);
        let seen = board(|now, operator| {
            if now < at {
                assert!(!drive(&mut step, operator));
                return false;
            }
            if now == at {
                assert!(
                    operator.host.abort()
                        && operator.host.control(|controls| {
                            controls.override_permille = 500;
                        })
                );
                operator.items.clear();
                operator.is_ready = false;
                return false;
            }
            drive(&mut next, operator)
        });
        use State::{Held, Idle, Moving, Off};
        assert_eq!(names(&seen), [Off, Held, Moving, Held, Moving, Idle], "{:?}", seen.states);
        let ((_, before), (_, after)) = (seen.states[3], seen.states[4]);
        // Comes to rest at a place of the path, and goes on from there.
        assert_ne!(before, end());
        let gone_mm = after.iter().zip(&before).map(|(a, b)| (*a - *b).to_mm().abs()).fold(0.0, f64::max);
        assert!(gone_mm < 1.0, "{gone_mm}");
        assert_eq!(seen.states[5].1, end());
    }
}

/// The emergency stop in motion: off, with the fault until it is cleared; nothing moves before drives are enabled again.
#[test]
fn a_fault_is_told_and_cleared() {
    let (mut step, mut next, mut is_off) = (0, 0, 0);
    let seen = board(|now, operator| {
        match now {
            ..3000 => {
                drive(&mut step, operator);
                return false;
            }
            3000 => operator.unhealthy = Some(FaultKind::EmergencyStop),
            3600 => {
                let fault = operator.status.and_then(|status| status.fault).expect("a fault");
                assert_eq!((fault.kind, fault.tick), (FaultKind::EmergencyStop, 2999));
                // Neither is obeyed in a fault.
                assert!(operator.host.enable(true) && operator.host.press(Mode::Run));
                operator.items.clear();
                operator.unhealthy = None;
            }
            4000 => {
                assert_eq!(operator.state(), Some(State::Off));
                assert!(operator.host.clear_fault());
            }
            4100.. => {
                let status = operator.status.expect("told");
                assert_eq!(status.fault, None);
                is_off += u32::from(now < 4200 && status.state == State::Off);
                return now > 4200 && drive(&mut next, operator);
            }
            _ => {}
        }
        false
    });
    use State::{Held, Idle, Moving, Off};
    assert_eq!(is_off, 100);
    let names = names(&seen);
    assert_eq!(names.first_chunk(), Some(&[Off, Held, Moving]));
    assert_eq!(names.last_chunk(), Some(&[Off, Held, Moving, Idle]), "{names:?}");
    assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
    // The log has the fault once, and then what the flight recorder kept.
    let told = seen.lines.iter().filter(|line| matches!(line, LogLine::Fault(_)));
    let rows = seen.lines.iter().filter(|line| matches!(line, LogLine::Flight(_)));
    assert_eq!((told.count(), rows.count()), (1, 16));
}

/// An item that does not follow the one before it: told by the state and once in the log.
#[test]
fn what_is_refused_is_told() {
    let mut step = 0;
    let seen = board(|_, operator| {
        let before = step;
        assert!(!drive(&mut step, operator));
        if (before, step) == (1, 2) {
            // Without the way to the start.
            operator.items.drain(..4);
        }
        operator.state() == Some(State::Refused)
    });
    let told: Vec<_> = seen.lines.iter().filter(|line| matches!(line, LogLine::Refused(_))).collect();
    assert!(matches!(told[..], [LogLine::Refused(SupplyError::Rejected(_))]), "{told:?}");
}

/// The board's own hold, short or long: at rest until it is over and the operator resumes.
#[test]
fn a_hold_on_the_board_waits_for_the_operator() {
    for ticks in [1, 1500] {
        let mut step = 0;
        let seen = board(|now, operator| {
            operator.is_held = (2500..2500 + ticks).contains(&now);
            // What is pressed while it lasts is in vain.
            if now == 3500 || now == 2500 + ticks + 1500 {
                assert_eq!(operator.state(), Some(State::Held), "{ticks} {now}");
                assert!(now == 3500 && ticks == 1 || operator.host.press(Mode::Run));
            }
            drive(&mut step, operator)
        });
        use State::{Held, Idle, Moving, Off};
        assert_eq!(names(&seen), [Off, Held, Moving, Held, Moving, Idle]);
        assert_eq!(seen.states.last().map(|(_, set)| *set), Some(end()));
    }
}

/// A dead man's time \[ms\], in ticks, and how often a PC says something at least.
const DEAD_MAN_MS: u16 = 250;
const DEAD_MAN_TICKS: u32 = 500;
const SAYS_TICKS: u32 = 200;

/// A PC falls silent: with a dead man the board holds within the time and the stop, and its position is known; it stays
/// there when the PC is back, until the next resume. Without one it drives what it has.
#[test]
fn a_dead_man_holds() {
    const FROM: u32 = 2600;
    let held_at = |dead_man_ms: u16, held_from: Option<u32>| {
        let (mut step, mut held) = (0, None);
        let seen = board(|now, operator| {
            operator.is_held = held_from.is_some_and(|from| now >= from) && held.is_none();
            operator.is_silent = held_from.is_none() && (FROM..FROM + 3000).contains(&now);
            let before = step;
            let is_over = drive(&mut step, operator);
            if (before, step) == (1, 2) {
                assert!(operator.host.control(|controls| controls.dead_man_ms = dead_man_ms));
            }
            if now > FROM && operator.state() == Some(State::Held) {
                held.get_or_insert(now);
            }
            // Long after the PC is back.
            if held.is_some() && now == FROM + 5000 {
                assert_eq!(operator.state(), Some(State::Held));
                assert!(operator.host.press(Mode::Run));
            }
            is_over
        });
        assert_eq!(seen.states.last().map(|(state, set)| (*state, *set)), Some((State::Idle, end())));
        let rests = seen.states.iter().filter(|(state, _)| *state == State::Held).count();
        // Before the start, and here.
        assert_eq!(rests, 1 + usize::from(held.is_some()));
        held
    };
    let latest = FROM + DEAD_MAN_TICKS;
    let stop_ticks = held_at(0, Some(latest)).expect("held") - latest;
    let held = held_at(DEAD_MAN_MS, None).expect("held");
    assert!(held > latest - SAYS_TICKS && held <= latest + 2 * stop_ticks, "{held} {latest} {stop_ticks}");
    assert_eq!(held_at(0, None), None);
}

const ON: OutputState =
    OutputState { spindle: Spindle::Clockwise, speed_rpm: 9000.0, flood: true, mist: false };

/// Spindle and coolant on before the motion and off after it, or off because of an abort.
#[test]
fn outputs_are_switched_and_off_after_an_abort() {
    for is_aborted in [false, true] {
        let mut step = 0;
        let seen = board(|now, operator| {
            let before = step;
            let is_over = drive(&mut step, operator);
            if (before, step) == (1, 2) {
                operator.items.push_front(Some(Item::Switch(ON)));
                operator.items.insert(operator.items.len() - 1, Some(Item::Switch(OutputState::OFF)));
            }
            if is_aborted && now == 3000 {
                assert!(operator.host.abort());
                operator.items.clear();
            }
            is_over || is_aborted && now == 5000
        });
        let switched: Vec<_> = seen.drives.switched.iter().map(|&(_, to)| to).collect();
        assert_eq!(switched, [ON, OutputState::OFF]);
        assert_eq!(seen.drives.switched[1].0 < 4500, is_aborted, "{:?}", seen.drives.switched);
    }
}

/// An abort at a program stop, in a dwell of minutes, and after an item that can't be executed: another program follows.
#[test]
fn an_abort_waits_for_nothing() {
    let dwell = Item::Dwell(motion_kernel::law::Ticks::from_seconds(600.0, TICK_S).expect("some ticks"));
    let stringer_of = |from| stringer(from).into_iter().flatten();
    let far = stringer_of(end()).find(|item| matches!(item, Item::Line { .. })).expect("a line");
    let waits = [(Item::Stop, State::Stopped), (dwell, State::Dwell), (far, State::Refused)];
    for (item, state) in waits {
        let (mut step, mut next, mut aborted) = (0, 1, None);
        let seen = board(|now, operator| {
            if let Some(aborted) = aborted {
                assert!(now < aborted + 8000, "it waits at {:?}", operator.state());
                return drive(&mut next, operator);
            }
            let before = step;
            drive(&mut step, operator);
            if (before, step) == (1, 2) {
                operator.items.clear();
                operator.items.push_front(Some(item));
            }
            if operator.state() == Some(state) {
                assert!(operator.host.abort());
                (aborted, operator.is_ready) = (Some(now), false);
                operator.items.clear();
            }
            false
        });
        assert_eq!(seen.states.last(), Some(&(State::Idle, end())), "{state:?}");
    }
}

/// A program stop waits for the operator, and goes on.
#[test]
fn a_program_stop_waits() {
    let (mut step, mut stopped) = (0, 0);
    let seen = board(|_, operator| {
        let before = step;
        let is_over = drive(&mut step, operator);
        if (before, step) == (1, 2) {
            operator.items.push_front(Some(Item::Stop));
        }
        if operator.state() == Some(State::Stopped) {
            stopped += 1;
            if stopped == 500 {
                assert!(operator.host.press(Mode::Run));
            }
        }
        is_over
    });
    use State::{Held, Idle, Moving, Off, Stopped};
    assert!(stopped >= 500);
    let names: Vec<_> = names(&seen).into_iter().filter(|state| !matches!(state, Idle | Moving)).collect();
    assert_eq!(names, [Off, Held, Stopped]);
    assert_eq!(seen.states.last().map(|(state, set)| (*state, *set)), Some((Idle, end())));
}

/// Nothing before a fault; then every row once and in order, however many frames are lost; nothing after the fault is cleared.
#[test]
fn the_flight_recorder_is_read() {
    for loses in [0, 300] {
        let (mut step, mut since) = (0, 0);
        board(|now, operator| {
            match step {
                0 if operator.status.is_some() => {
                    operator.loses = loses;
                    operator.host.read_flight(0);
                    step = 1;
                }
                1 if operator.flight_rows.take() == Some(0) => {
                    assert!(operator.flight.is_empty());
                    operator.unhealthy = Some(FaultKind::EmergencyStop);
                    (step, since) = (2, now);
                }
                2 if now > since + 100 => {
                    operator.host.read_flight(0);
                    step = 3;
                }
                3 if operator.flight_rows.take().is_some() => {
                    let count = operator.flight.len();
                    if count < 16 {
                        operator.host.read_flight(count as u16);
                        return false;
                    }
                    let first = operator.flight[0].tick;
                    let ticks: Vec<u64> = operator.flight.iter().map(|row| row.tick).collect();
                    assert_eq!(ticks, (first..first + 16).collect::<Vec<_>>());
                    // Eight of them behind the fault's.
                    let faulted = operator.flight.iter().position(|row| row.is_faulted);
                    assert_eq!((faulted, operator.flight[7].tick), (Some(7), u64::from(since) - 1));
                    operator.unhealthy = None;
                    operator.flight.clear();
                    assert!(operator.host.clear_fault());
                    (step, since) = (4, now);
                }
                4 if now > since + 2000 => {
                    operator.host.read_flight(0);
                    step = 5;
                }
                5 if operator.flight_rows == Some(0) => return operator.flight.is_empty(),
                _ => {}
            }
            false
        });
    }
}

/// Somebody else asks while a key is pressed: the board holds at once, though the other one is not silent.
#[test]
fn another_asker_holds_what_has_a_dead_man() {
    let (mut step, mut held) = (0, None);
    board(|now, operator| {
        if now < 2600 {
            let before = step;
            drive(&mut step, operator);
            if (before, step) == (1, 2) {
                assert!(operator.host.control(|controls| controls.dead_man_ms = DEAD_MAN_MS));
            }
        } else if now == 2600 {
            (operator.host, operator.status) = (Host::new(77), None);
            operator.items.clear();
        } else if operator.state() == Some(State::Held) {
            held.get_or_insert(now);
        }
        now == 5000
    });
    assert!(held.is_some());
}
