//! Both ends over a wire that loses, doubles, reorders, cuts and damages frames.

use core::task::Poll;
use std::collections::VecDeque;

use super::frame::Payload;
use super::*;
use crate::hal::BoardOutputs;
use crate::law::Ticks;
use crate::program::{Item, Source};
use crate::random::Random;
use crate::units::Position;

const IDENTITY: Identity = Identity {
    build: Build::THIS,
    format: 5,
    axes: 3,
    is_fixed_point: false,
    tick_s: 5e-4,
    items: ROOM as u16,
    outputs: BoardOutputs::None,
    machine: 0xCAFE_F00D,
};
/// Items that a board has room for.
const ROOM: usize = 12;

type Host = HostLink<3, 64, 8192>;
type Items = ItemQueue<3, ROOM>;

/// Frames on their way in one direction.
#[derive(Default)]
struct Wire {
    frames: VecDeque<Vec<u8>>,
    /// Of a thousand frames this many suffer each of what frames may suffer.
    permille: u64,
    sent: u64,
    harmed: u64,
    is_cut: bool,
}

impl Wire {
    fn send(&mut self, random: &Random, frame: &[u8]) {
        self.sent += 1;
        if self.is_cut {
            self.harmed += 1;
            return;
        }
        let mut frame = frame.to_vec();
        let mut times = 1;
        let mut is_hit = || {
            let is_hit = random.below(1000) < self.permille;
            self.harmed += u64::from(is_hit);
            is_hit
        };
        if is_hit() {
            times = 0;
        }
        if is_hit() {
            times = 2;
        }
        if is_hit() {
            frame.truncate(random.below(frame.len() as u64) as usize);
        }
        if is_hit() {
            let at = random.below(frame.len().max(1) as u64) as usize;
            if let Some(byte) = frame.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
        let swaps = is_hit();
        for _ in 0..times {
            self.frames.push_back(frame.clone());
        }
        let count = self.frames.len();
        if swaps && count > 1 {
            self.frames.swap(count - 1, count - 2);
        }
    }

    /// Some of the bytes that have arrived, cut anywhere.
    fn receive(&mut self, random: &Random) -> Vec<u8> {
        let mut bytes = Vec::new();
        // Frames come in bursts.
        if random.chance(0.5) {
            return bytes;
        }
        while let Some(frame) = self.frames.front_mut() {
            let count = (random.below(frame.len() as u64 + 40) as usize).min(frame.len());
            bytes.extend(frame.drain(..count));
            if !frame.is_empty() {
                break;
            }
            self.frames.pop_front();
            if random.chance(0.3) {
                break;
            }
        }
        bytes
    }
}

/// An item that is known by its number: dwells, and lines and curves of all lengths in bytes.
fn item(number: u32) -> Item<3> {
    let position = |bits: i64| Position::from_bits(bits);
    let start = [position(i64::from(number) << 20), position(-i64::from(number)), position(1 << 40)];
    match number % 3 {
        0 => Item::Dwell(Ticks::from_bits(u64::from(number))),
        1 => Item::Line { line: number, start, direction: [0.6, 0.8, 0.0], length: position(1 << 33) },
        _ => Item::Septic {
            line: number,
            start,
            coefficients: [[f64::from(number); 7], [0.1; 7], [0.0; 7]],
            length: position(1 << 34),
        },
    }
}

/// A board: its end of the link, the items that live control takes from it, in their order, and its controls.
struct Board {
    link: BoardLink,
    items: Items,
    driven: Vec<Item<3>>,
    controls: Vec<Controls>,
    parameters: Vec<u8>,
    /// New ones, and whether they may come.
    buffer: ParameterBuffer<1024>,
    is_off: bool,
}

impl Board {
    fn new(session: u32) -> Self {
        Self {
            link: BoardLink::new(session, IDENTITY),
            items: Items::new(),
            driven: Vec::new(),
            controls: Vec::new(),
            parameters: Vec::new(),
            buffer: ParameterBuffer::new(),
            is_off: true,
        }
    }
}

struct Bench {
    random: Random,
    host: Host,
    board: Board,
    down: Wire,
    up: Wire,
    now_ms: u32,
    events: Vec<Event<3>>,
    statuses: u64,
    /// What the board tells of homing, and what has come of it.
    homing: HomingProgress,
    told: HomingProgress,
}

impl Bench {
    fn new(seed: u64, permille: u64) -> Self {
        println!("seed {seed}, {permille} of a thousand");
        let wire = || Wire { permille, ..Wire::default() };
        Self {
            random: Random::new(seed),
            host: Host::new(1),
            board: Board::new(1),
            down: wire(),
            up: wire(),
            // Times wrap.
            now_ms: u32::MAX - 3000,
            events: Vec::new(),
            statuses: 0,
            homing: HomingProgress::None,
            told: HomingProgress::None,
        }
    }

    /// A millisecond.
    fn step(&mut self, takes: f64) {
        let mut out = [0; FRAME_MAX];
        self.now_ms = self.now_ms.wrapping_add(1);
        let length = self.host.transmit(self.now_ms, &mut out);
        if length > 0 {
            self.down.send(&self.random, &out[..length]);
        }
        let bytes = self.down.receive(&self.random);
        let mut bytes = bytes.into_iter();
        let Board { link, items, buffer, is_off, parameters, .. } = &mut self.board;
        while bytes.len() > 0 {
            link.receive(&mut bytes);
            link.put_items(items);
            link.put_parameters(buffer, *is_off);
        }
        let length = link.transmit_parameters(parameters, buffer, &mut out);
        if length > 0 {
            self.up.send(&self.random, &out[..length]);
        }
        self.board.controls.extend(self.board.link.take_controls());
        if self.random.chance(takes)
            && let Poll::Ready(Some(Ok(item))) = self.board.items.poll_next()
        {
            self.board.driven.push(item);
        }
        let status = Status {
            tick: self.now_ms,
            state: State::Moving,
            set: [Position::ZERO; 3],
            actual: [Position::ZERO; 3],
            feed_mm_s: 12.5,
            line: 7,
            aborts: self.board.items.came().aborts,
            taken: self.board.items.taken(),
            driven: 0,
            is_ended: self.board.items.came().is_ended,
            starvations: 3,
            is_ready: true,
            fault: None,
            homing: self.homing,
            homed: [None; 3],
        };
        let status = self.random.chance(0.02).then_some(status);
        let length = self.board.link.transmit(self.now_ms, &self.board.items, status, &mut out);
        if length > 0 {
            self.up.send(&self.random, &out[..length]);
        }
        let bytes = self.up.receive(&self.random);
        let (events, statuses, homing) = (&mut self.events, &mut self.statuses, &mut self.told);
        self.host.receive(&bytes, self.now_ms, &mut |event| match event {
            Event::Status(status) => {
                assert_eq!((status.feed_mm_s, status.line), (12.5, 7));
                *statuses += 1;
                *homing = status.homing;
            }
            event => events.push(event),
        });
    }

    /// Until the board takes items.
    fn greet(&mut self) -> u32 {
        self.events.clear();
        for _ in 0..10_000 {
            self.step(0.0);
            if let Some(Event::Ready { next }) = self.events.last() {
                return *next;
            }
        }
        panic!("no answer: {:?}", self.events);
    }
}

/// Every item comes once and in its order, and the board has the last controls, whatever happens to frames.
/// `MOTION_TEST_SEEDS` programs, 160 if it is not set.
#[test]
fn nothing_is_lost_or_doubled_on_a_bad_wire() {
    let seeds = std::env::var("MOTION_TEST_SEEDS").map_or(160, |seeds| seeds.parse().expect("a number"));
    let (mut frames, mut harmed, mut damaged, mut cuts) = (0, 0, 0, 0);
    for (seed, permille) in (1..=seeds).zip([0, 10, 10, 50, 200].into_iter().cycle()) {
        let mut bench = Bench::new(seed, permille);
        assert_eq!(bench.greet(), 0);
        let (count, mut pushed, mut steps) = (600, 0, 0_u32);
        let takes = bench.random.log(0.02, 1.0);
        while bench.board.driven.len() < count as usize
            || bench.host.waiting() > 0
            || !bench.host.is_controlled()
        {
            steps += 1;
            assert!(steps < 400_000, "{} of {count} driven", bench.board.driven.len());
            while pushed < count && bench.host.push(Some(&item(pushed))).expect("short") {
                pushed += 1;
            }
            // Now and then one after the other.
            while pushed < count && bench.random.chance(if steps % 97 < 3 { 0.7 } else { 0.002 }) {
                bench.step(takes);
                let is_taken = match bench.random.below(4) {
                    0 => bench.host.press(Mode::Hold),
                    1 => bench.host.press(Mode::Run),
                    2 => bench.host.control(|controls| controls.override_permille ^= 3),
                    _ => bench.host.control(|controls| controls.is_single_block ^= true),
                };
                assert!(is_taken);
            }
            // A cable pulled, and back in.
            if !bench.down.is_cut && bench.random.chance(2e-3) {
                (bench.down.is_cut, bench.up.is_cut) = (true, bench.random.chance(0.5));
                cuts += 1;
            }
            if bench.random.chance(2e-3) {
                (bench.down.is_cut, bench.up.is_cut) = (false, false);
            }
            bench.step(takes);
        }
        for (number, driven) in (0..).zip(&bench.board.driven) {
            assert_eq!(*driven, item(number), "item {number}");
        }
        let controls = &bench.board.controls;
        assert_eq!(controls.last(), Some(bench.host.controls()));
        assert!(controls.windows(2).all(|pair| pair[1].is_newer_than(&pair[0])), "an old one comes again");
        assert!(bench.statuses > 0);
        frames += bench.down.sent + bench.up.sent;
        harmed += bench.down.harmed + bench.up.harmed;
        damaged += bench.board.link.damaged() + bench.host.damaged();
    }
    println!("{frames} frames, {harmed} of them harmed, {damaged} found damaged, {cuts} cuts");
    // Of each program.
    assert!(frames > 1500 * seeds && harmed > 150 * seeds && u64::from(damaged) > 30 * seeds && cuts > seeds);
}

/// A frame that is lost is sent again as soon as the board has seen a later one, not only when it is late.
#[test]
fn what_is_missing_is_sent_again_at_once() {
    for seed in 1..=20 {
        let mut bench = Bench::new(seed, 0);
        bench.greet();
        let mut number = 0;
        // An item in each frame, and always room for more.
        let mut steps = |bench: &mut Bench, count: u32| {
            for _ in 0..count {
                number += u32::from(bench.host.push(Some(&item(number))).expect("short"));
                bench.step(1.0);
                bench.step(1.0);
                bench.step(1.0);
            }
        };
        steps(&mut bench, 100);
        bench.down.is_cut = true;
        steps(&mut bench, 1);
        bench.down.is_cut = false;
        let before = bench.board.driven.len();
        // Less than the time after which all is sent again.
        steps(&mut bench, 32);
        assert!(bench.board.driven.len() > before + 8, "{} of {before}", bench.board.driven.len());
    }
}

/// Controls pass a program that waits for room, and the same mode pressed again is a command again.
#[test]
fn controls_wait_for_nothing() {
    let mut bench = Bench::new(7, 0);
    bench.greet();
    let mut number = 0;
    for _ in 0..2000 {
        while bench.host.push(Some(&item(number))).expect("short") {
            number += 1;
        }
        bench.step(0.0);
    }
    assert_eq!((bench.board.items.taken(), bench.host.confirmed()), (0, ROOM as u32), "the board is full");
    for mode in [Some(Mode::Run), Some(Mode::Hold), Some(Mode::Hold), None] {
        assert!(match mode {
            Some(mode) => bench.host.press(mode),
            None => bench.host.abort(),
        });
        let before = bench.board.controls.len();
        let mut steps = 0;
        while bench.board.controls.len() == before {
            bench.step(0.0);
            steps += 1;
            assert!(steps < 60, "{mode:?}");
        }
        assert_eq!(bench.board.controls.last(), Some(bench.host.controls()));
    }
}

/// A board that starts anew says so; a PC that starts anew learns what the board has, and goes on there.
#[test]
fn both_ends_may_start_anew() {
    let mut bench = Bench::new(8, 20);
    bench.greet();
    let push = |bench: &mut Bench, number: &mut u32, until: u32| {
        while *number < until && bench.host.push(Some(&item(*number))).expect("short") {
            *number += 1;
        }
    };
    let mut number = 0;
    for _ in 0..3000 {
        push(&mut bench, &mut number, 100);
        bench.step(0.3);
    }
    assert_eq!(bench.board.driven.len(), 100);
    // The PC: its next run goes on with item 100 of the same session, with the controls as they are there.
    for _ in 0..5 {
        assert!(bench.host.press(Mode::Run));
    }
    for _ in 0..1000 {
        bench.step(0.3);
    }
    let known = *bench.host.controls();
    bench.host = Host::new(2);
    assert!(!bench.host.press(Mode::Run), "not before the board has answered");
    assert_eq!(bench.greet(), 100);
    assert_eq!(bench.host.push(Some(&item(100))), Err(PushError::Skipped { expected: 0, found: 100 }));
    for number in 0..100 {
        bench.host.skip(&item(number));
    }
    assert_eq!(bench.host.controls(), &known);
    assert!(bench.host.press(Mode::Hold));
    for _ in 0..1000 {
        bench.step(0.3);
    }
    assert_eq!(bench.board.controls.last().map(|controls| controls.mode), Some(Mode::Hold));
    for _ in 0..3000 {
        push(&mut bench, &mut number, 200);
        bench.step(0.3);
    }
    assert_eq!(bench.board.driven.len(), 200);
    assert!(bench.board.driven.iter().zip(0..).all(|(driven, number)| *driven == item(number)));
    // The board, while items are under way.
    for _ in 0..20 {
        push(&mut bench, &mut number, 300);
        bench.step(0.3);
    }
    let confirmed = bench.host.confirmed();
    bench.board = Board::new(2);
    for _ in 0..1000 {
        bench.step(0.3);
    }
    let Some(&Event::Restarted { confirmed: told }) = bench.events.last() else {
        panic!("{:?}", bench.events)
    };
    assert!(told >= confirmed && bench.board.driven.is_empty(), "{told} {confirmed}");
    assert_eq!(bench.host.push(Some(&item(0))), Ok(false), "not before the caller has decided");
    bench.host.accept();
    assert_eq!(bench.greet(), 0);
    // What was pressed before is no command for it.
    assert_eq!(bench.host.controls(), &Controls::NONE);
    let mut number = 0;
    for _ in 0..3000 {
        push(&mut bench, &mut number, 50);
        bench.step(0.3);
    }
    assert!(bench.board.driven.len() == 50 && bench.board.controls.is_empty(), "{:?}", bench.board.controls);
}

/// What a wire still holds of the answers to another PC's side is not taken for the board's.
#[test]
fn old_answers_are_not_taken_for_new_ones() {
    let mut bench = Bench::new(9, 0);
    bench.greet();
    let mut old = Vec::new();
    for number in 0..ROOM as u32 {
        let mut out = [0; FRAME_MAX];
        bench.board.link.receive(&mut [0].into_iter());
        bench.board.link.is_welcome_due_again();
        for _ in 0..2 {
            let length = bench.board.link.transmit(bench.now_ms, &bench.board.items, None, &mut out);
            old.extend_from_slice(&out[..length]);
        }
        assert!(bench.host.push(Some(&item(number))).expect("short"));
        for _ in 0..10 {
            bench.step(0.0);
        }
    }
    bench.host = Host::new(77);
    bench.host.receive(&old, bench.now_ms, &mut |event| panic!("{event:?}"));
    assert_eq!(bench.greet(), ROOM as u32);
}

/// A board with another protocol, other messages, or other axes. Another kernel alone is no reason.
#[test]
fn what_does_not_fit_is_refused() {
    let other_protocol = Build { protocol: Build::THIS.protocol + 1, ..Build::THIS };
    let other_messages = Build { schema: !Build::THIS.schema, ..Build::THIS };
    let other_axes = Identity { axes: 2, ..IDENTITY };
    for (identity, event) in [
        (Identity { build: other_protocol, ..IDENTITY }, Event::Foreign(other_protocol)),
        (Identity { build: other_messages, ..IDENTITY }, Event::Foreign(other_messages)),
        (other_axes, Event::Refused(other_axes)),
    ] {
        let mut bench = Bench::new(10, 0);
        bench.board.link = BoardLink::new(1, identity);
        for _ in 0..1000 {
            bench.step(0.0);
        }
        assert!(bench.events.len() > 1, "asked again");
        assert!(bench.events.iter().all(|one| *one == event), "{:?}", bench.events);
        assert_eq!(bench.host.push(Some(&item(0))), Ok(false));
    }
    let mut bench = Bench::new(10, 0);
    let build = Build { kernel: [9, 9, 9], ..Build::THIS };
    bench.board.link = BoardLink::new(1, Identity { build, ..IDENTITY });
    assert_eq!(bench.greet(), 0);
}

/// What a board of another protocol is can be read, whatever follows there.
#[test]
fn a_board_of_any_protocol_is_known() {
    for tail in [&[][..], &[1], &[0xff; 300]] {
        let mut host = Host::new(5);
        let mut out = [0; FRAME_MAX];
        assert!(host.transmit(0, &mut out) > 0, "it asks");
        let build = Build { protocol: 200, schema: 3, kernel: [1, 22, 333] };
        // Written by hand, as it has to stay: the first message; a session; who asked; numbers of 7 bits a byte.
        let mut payload =
            Payload::of(&(0_u8, 9_u32, 5_u32, 200_u16, 3_u32, [1_u16, 22, 333])).expect("short");
        assert!(payload.push_all(tail.iter().copied()));
        let length = payload.frame(&mut out);
        let mut events = Vec::new();
        host.receive(&out[..length], 0, &mut |event| events.push(event));
        assert_eq!(events, [Event::Foreign(build)]);
    }
}

/// The number of the messages as they are. Whoever changes one sees it here, and thinks of the protocol's version: it
/// is raised where a message means something else in the same form.
#[test]
fn the_messages_are_known_by_a_number() {
    assert_eq!(format!("{:08x}", Build::THIS.schema), "987c3a69");
    let [major, minor, patch] = Build::THIS.kernel;
    assert_eq!(format!("{major}.{minor}.{patch}"), env!("CARGO_PKG_VERSION"));
}

/// No bytes can do more than be dropped: random ones, and frames with random payloads and right checksums.
#[test]
fn any_bytes_may_come() {
    let mut read = 0_u32;
    for seed in 0..40 {
        let random = Random::new(seed);
        let (mut board, mut host) = (Board::new(1), Host::new(1));
        let mut out = [0; FRAME_MAX];
        for _ in 0..2000 {
            let mut payload: Vec<u8> = (0..random.below(60))
                .map(|_| if random.chance(0.5) { 0 } else { random.next() as u8 })
                .collect();
            // Near a message of this session.
            if random.chance(0.5)
                && let [first, second, ..] = &mut payload[..]
            {
                (*first, *second) = (*first & 3, 1);
            }
            let bytes = if random.chance(0.7) {
                let mut framed = frame::Payload::of(&()).expect("nothing");
                assert!(framed.push_all(payload.into_iter()));
                let length = framed.frame(&mut out);
                out[..length].to_vec()
            } else {
                payload
            };
            let before = (board.items.came().aborts, board.items.next());
            board.link.receive(&mut bytes.iter().copied());
            board.link.put_items(&mut board.items);
            board.link.put_parameters(&mut board.buffer, seed % 2 == 0);
            board.link.transmit_parameters(&[1; 300], &board.buffer, &mut out);
            host.receive(&bytes, 0, &mut |_| read += 1);
            // Numbers begin anew with a program.
            let before = if before.0 == board.items.came().aborts { before.1 } else { 0 };
            let came = board.items.next().wrapping_sub(before);
            assert!(came <= ROOM as u32);
            read += came + u32::from(board.link.take_controls().is_some());
            while let Poll::Ready(Some(_)) = board.items.poll_next() {}
        }
    }
    println!("{read} were messages");
    assert!(read > 10);
}

/// Programs one after the other, each given up somewhere, over a bad wire: nothing of one comes after the next has begun,
/// whatever frames the wire still holds, and numbers begin anew.
#[test]
fn nothing_of_a_program_that_was_given_up_comes_after_it() {
    let mut given_up = 0;
    for (seed, permille) in (100..=130).zip([0, 10, 50, 200].into_iter().cycle()) {
        let mut bench = Bench::new(seed, permille);
        assert_eq!(bench.greet(), 0);
        for program in 1..=20_u32 {
            let before = bench.board.driven.len();
            assert!(match bench.random.below(3) {
                0 => bench.host.enable(true) && bench.host.begin(program),
                1 => bench.host.abort() && bench.host.begin(program),
                _ => bench.host.begin(program),
            });
            assert_eq!((bench.host.waiting(), bench.host.push(Some(&item(0)))), (0, Ok(false)));
            assert_eq!(bench.greet(), 0);
            let count = bench.random.below(60) as u32;
            let mut pushed = 0;
            for _ in 0..bench.random.below(1500) {
                while pushed < count && bench.host.push(Some(&item(1000 * program + pushed))).expect("short")
                {
                    pushed += 1;
                }
                bench.step(0.2);
            }
            let driven = &bench.board.driven[before..];
            given_up += u32::from(driven.len() < count as usize);
            // The last ones of the program before may have been taken until the board knew of this one.
            let first =
                driven.iter().position(|driven| *driven == item(1000 * program)).unwrap_or(driven.len());
            for (number, driven) in (0..).zip(&driven[first..]) {
                assert_eq!(*driven, item(1000 * program + number), "item {number} of program {program}");
            }
            assert!(
                driven[..first]
                    .iter()
                    .all(|driven| { (0..60).any(|number| *driven == item(1000 * (program - 1) + number)) })
            );
        }
        assert_eq!(bench.board.controls.last().map(|controls| controls.program), Some(20));
    }
    assert!(given_up > 50, "{given_up}");
}

/// New parameters of every length come whole over a bad wire, and are read back; not with drives on, not if there is no room.
#[test]
fn parameters_come_whole() {
    for (seed, permille) in (200..=230).zip([0, 10, 50, 200].into_iter().cycle()) {
        let mut bench = Bench::new(seed, permille);
        bench.greet();
        let length = bench.random.below(1500) as usize + 1;
        let parameters: Vec<u8> = (0..length).map(|_| bench.random.next() as u8).collect();
        let expected = if length > 1024 { Err(WriteError::Length { room: 1024 }) } else { Ok(()) };
        bench.board.is_off = false;
        assert_eq!(bench.write(&parameters), Err(WriteError::DrivesOn));
        bench.board.is_off = true;
        for _ in 0..2 {
            assert_eq!(bench.write(&parameters), expected, "{length} bytes");
            let Board { link, buffer, .. } = &mut bench.board;
            assert_eq!(buffer.take(), expected.ok().map(|()| &parameters[..]));
            assert_eq!(buffer.take(), None, "once");
            if expected.is_ok() {
                // What a board says that finds them no good.
                link.refuse_parameters(buffer, WriteError::Unsuitable);
            }
        }
        bench.board.parameters = parameters.clone();
        let mut read = Vec::new();
        bench.events.clear();
        bench.host.read_parameters(0);
        for _ in 0..50_000 {
            bench.step(0.0);
            if let Some(Event::Parameters { offset, length, piece }) = bench.events.pop() {
                assert_eq!((offset as usize, length as usize), (read.len(), parameters.len()));
                read.extend_from_slice(piece.bytes());
                bench.host.read_parameters(read.len() as u32);
            }
            if read.len() >= length {
                break;
            }
        }
        assert_eq!(read, parameters);
    }
}

impl Bench {
    /// Writes parameters until the board has them, or refuses them.
    fn write(&mut self, parameters: &[u8]) -> Result<(), WriteError> {
        self.events.clear();
        self.host.write_parameters(parameters, 0);
        for _ in 0..50_000 {
            self.step(0.0);
            match self.events.pop() {
                Some(Event::Written { error: Some(error), .. }) => return Err(error),
                Some(Event::Written { bytes, .. }) if bytes as usize == parameters.len() => return Ok(()),
                Some(Event::Written { bytes, .. }) => self.host.write_parameters(parameters, bytes),
                _ => {}
            }
        }
        panic!("no answer");
    }
}

/// Somebody else asks the board: whoever had it is told, and nothing that he presses or pushes gets there any more, until he
/// asks anew himself.
#[test]
fn who_asked_last_has_the_board() {
    for (seed, permille) in (300..=320).zip([0, 10, 50, 200].into_iter().cycle()) {
        let mut bench = Bench::new(seed, permille);
        bench.greet();
        assert!(bench.host.press(Mode::Run) && bench.host.push(Some(&item(0))) == Ok(true));
        // However many frames are lost: both are there, and the board's answers.
        let is_there = |bench: &Bench| bench.host.waiting() == 0 && bench.host.is_controlled();
        for _ in 0..3000 {
            bench.step(1.0);
        }
        for _ in 0..30_000 {
            if is_there(&bench) {
                break;
            }
            bench.step(1.0);
        }
        // Held back while the second one has the board.
        let mut first = core::mem::replace(&mut bench.host, Host::new(1 << 20));
        assert_eq!(bench.greet(), 1);
        assert!(bench.host.press(Mode::Hold));
        for _ in 0..3000 {
            bench.step(1.0);
        }
        let known = (*bench.host.controls(), bench.board.driven.len());
        assert!(first.enable(true) && first.press(Mode::Run));
        core::mem::swap(&mut first, &mut bench.host);
        bench.events.clear();
        for _ in 0..3000 {
            bench.step(1.0);
        }
        assert_eq!(bench.events.first(), Some(&Event::Replaced));
        assert_eq!(bench.board.controls.last(), Some(&known.0), "a press of who was replaced");
        assert_eq!((bench.host.push(Some(&item(1))), bench.board.driven.len()), (Ok(false), known.1));
        assert!(!bench.host.press(Mode::Run));
    }
}

/// A jog that its operator has to keep alive is held where somebody else asks the board; a program goes on.
#[test]
fn a_jog_is_held_where_somebody_else_asks() {
    for (dead_man_ms, expected) in [(0, Mode::Run), (200, Mode::Hold)] {
        let mut bench = Bench::new(500, 0);
        bench.greet();
        assert!(bench.host.control(|controls| controls.dead_man_ms = dead_man_ms));
        assert!(bench.host.press(Mode::Run));
        for _ in 0..100 {
            bench.step(0.0);
        }
        assert_eq!(bench.board.controls.last().map(|controls| controls.mode), Some(Mode::Run));
        bench.host = Host::new(2);
        bench.greet();
        let obeyed = bench.board.controls.last().map(|controls| controls.mode);
        assert_eq!((obeyed, bench.host.controls().mode), (Some(expected), expected), "{dead_man_ms} ms");
    }
}

/// A command to home gets through a bad wire, once, and what has become of it back. Frames of before that come late change nothing,
/// and where somebody else asks the board, it is held.
#[test]
fn homing_is_commanded_once() {
    for seed in 700..720 {
        let mut bench = Bench::new(seed, 150);
        bench.greet();
        for (times, axes) in (1..).zip([0b101, 0b10, 0b10]) {
            assert!(bench.host.home(axes, 250));
            let failure = HomingFailure::NoSwitch { travel_mm: f64::from(axes) };
            bench.homing = HomingProgress::Failed { axis: times, failure };
            for _ in 0..2000 {
                bench.step(1.0);
            }
            let Controls { homings, home_axes, mode, dead_man_ms, .. } =
                *bench.board.controls.last().expect("some");
            assert_eq!((homings, home_axes, mode, dead_man_ms), (times, axes, Mode::Run, 250));
            assert_eq!(bench.told, bench.homing);
        }
        let counts: Vec<u16> = bench.board.controls.iter().map(|controls| controls.homings).collect();
        assert!(counts.is_sorted() && *counts.last().expect("some") == 3, "{counts:?}");
        bench.host = Host::new(2);
        bench.greet();
        let last = bench.board.controls.last().expect("some");
        assert_eq!((last.homings, last.mode, bench.host.controls().mode), (3, Mode::Hold, Mode::Hold));
    }
}

/// An item that can't be read is told with its number; none after it is taken until the program is given up.
#[test]
fn what_cant_be_read_ends_a_program() {
    let mut bench = Bench::new(600, 0);
    bench.greet();
    assert!(bench.host.push(Some(&item(0))).expect("short"));
    for _ in 0..100 {
        bench.step(1.0);
    }
    // As a PC of another version might write it, with the right checksum: the next item, of a kind that there is none of.
    let (session, asker) = (1, 1);
    let request = message::Request::Items { session, asker, aborts: 0, first: 1, is_last: false };
    let mut payload = frame::Payload::of(&request).expect("short");
    assert!(payload.push_all([0xFF; 8].into_iter()));
    let mut out = [0; FRAME_MAX];
    let length = payload.frame(&mut out);
    // Behind a frame that may be there in part.
    bench.board.link.receive(&mut [0].iter().chain(&out[..length]).copied());
    bench.board.link.put_items(&mut bench.board.items);
    assert!(bench.host.push(Some(&item(1))).expect("short"));
    for _ in 0..1000 {
        bench.step(1.0);
    }
    assert_eq!(bench.events.last(), Some(&Event::Unreadable { item: 1 }));
    assert_eq!((bench.board.items.next(), &bench.board.driven[..]), (1, &[item(0)][..]));
    assert!(bench.host.begin(2));
    assert_eq!(bench.greet(), 0);
    assert!(bench.host.push(Some(&item(2))).expect("short"));
    for _ in 0..100 {
        bench.step(1.0);
    }
    assert_eq!(bench.board.driven, [item(0), item(2)]);
}

/// The first items of a program come again after it was given up, in the place of the next one's.
#[test]
fn a_late_frame_of_a_program_that_was_given_up_is_dropped() {
    let mut bench = Bench::new(400, 0);
    bench.greet();
    assert!(bench.host.begin(1));
    assert_eq!(bench.greet(), 0);
    assert_eq!(bench.host.push(Some(&item(7))), Ok(true));
    let mut out = [0; FRAME_MAX];
    let feed = |board: &mut Board, frame: &[u8]| {
        board.link.receive(&mut frame.iter().copied());
        board.link.put_items(&mut board.items);
        board.items.next()
    };
    let late = loop {
        bench.now_ms = bench.now_ms.wrapping_add(1);
        let length = bench.host.transmit(bench.now_ms, &mut out);
        if feed(&mut bench.board, &out[..length]) == 1 {
            break out[..length].to_vec();
        }
    };
    assert!(bench.host.begin(2));
    let length = bench.host.transmit(bench.now_ms, &mut out);
    assert_eq!(feed(&mut bench.board, &out[..length]), 0, "the next program has begun");
    assert_eq!(feed(&mut bench.board, &late), 0);
}
