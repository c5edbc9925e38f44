//! The two ends of the link, driven by bytes.
//!
//! Any bytes are a script: what the PC and the board do, what happens to the frames between them, and which PC or board is
//! replaced by another one. [`drive()`] runs it and panics where a promise is broken:
//!
//! - nothing panics, whatever comes in;
//! - every item is taken once, in its order, and is of the program that it was sent for;
//! - the controls that are obeyed are newer than those before;
//! - once the wire is whole again, everything that was pushed is taken.
//!
//! Frames that were harmed on the way have wrong checksums. After one that was *forged*, which has a right one, only the
//! first promise holds, and that the board never takes more than it has room for.

use std::collections::VecDeque;
use std::task::Poll;

use arbitrary::{Result, Unstructured};
use motion_kernel::law::Ticks;
use motion_kernel::link::{
    BoardLink, Controls, Event, FRAME_MAX, HostLink, Identity, ItemQueue, Mode, ParameterBuffer, Status,
};
use motion_kernel::program::{Checksum, Item, Source};
use motion_kernel::units::Position;

use crate::link::{IDENTITY, STATUS};

const AXES: usize = 3;
/// Items and bytes of parameters that a board has room for.
const ITEMS: usize = 12;
const PARAMETERS: usize = 300;
/// Time in which a whole wire repairs everything, with the longest pause before frames are repeated \[ms\].
const REPAIRS_MS: u32 = 20_000;
/// Steps of a script at most.
const STEPS_MAX: usize = 2000;

type Host = HostLink<AXES, 32, 4096>;

/// Runs what `bytes` say.
///
/// # Panics
/// An end of the link breaks a promise.
pub fn drive(bytes: &[u8]) {
    let mut input = Unstructured::new(bytes);
    // Most scripts are to keep all promises.
    let mut bench = Bench::new(input.ratio(1, 4).unwrap_or(false));
    for _ in 0..STEPS_MAX {
        if input.is_empty() || bench.step(&mut input).is_err() {
            break;
        }
    }
    bench.repair();
}

/// Frames on their way in one direction.
#[derive(Default)]
struct Wire(VecDeque<Vec<u8>>);

impl Wire {
    /// What may happen to a frame on the way.
    fn harm(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        if self.0.is_empty() {
            return Ok(());
        }
        let index = input.choose_index(self.0.len())?;
        let count = self.0.len();
        match input.int_in_range(0..=4)? {
            0 => drop(self.0.remove(index)),
            1 => self.0.push_back(self.0[index].clone()),
            2 => self.0.swap(index, count - 1),
            3 => {
                let length = input.choose_index(self.0[index].len().max(1))?;
                self.0[index].truncate(length);
            }
            _ => {
                let frame = &mut self.0[index];
                if !frame.is_empty() {
                    let at = input.choose_index(frame.len())?;
                    frame[at] ^= 1 << input.int_in_range(0..=7)?;
                }
            }
        }
        Ok(())
    }

    /// A frame whose payload is changed, with the right checksum; whether there was one.
    fn forge(&mut self, input: &mut Unstructured<'_>) -> Result<bool> {
        if self.0.is_empty() {
            return Ok(false);
        }
        let index = input.choose_index(self.0.len())?;
        let frame = &self.0[index];
        let Some(mut payload) = frame.strip_suffix(&[0]).and_then(|frame| cobs::decode_vec(frame).ok())
        else {
            return Ok(false);
        };
        payload.truncate(payload.len().saturating_sub(4));
        for _ in 0..=input.int_in_range(0..=3)? {
            if payload.is_empty() || input.ratio(1, 4)? {
                payload.push(input.arbitrary()?);
            } else {
                let at = input.choose_index(payload.len())?;
                payload[at] = input.arbitrary()?;
            }
        }
        let sum = Checksum::of(&payload);
        payload.extend(sum.to_le_bytes());
        let mut forged = cobs::encode_vec(&payload);
        forged.push(0);
        self.0.push_back(forged);
        Ok(true)
    }
}

/// What a program's items are known by: those of a board's start, given up so often before, with this name.
type Program = (u32, u16, u32);

/// The item of this number in a program.
fn item((session, aborts, name): Program, number: u32) -> Item<AXES> {
    let position = |number: u32| Position::from_bits(i64::from(number) << 16);
    let start = [session, u32::from(aborts), name].map(position);
    match number % 3 {
        0 => Item::Dwell(Ticks::from_bits(u64::from(name) << 32 | u64::from(number))),
        1 => Item::Line { line: number, start, direction: [0.6, 0.8, 0.0], length: position(number + 1) },
        _ => Item::Septic {
            line: number,
            start,
            coefficients: [[f64::from(number); 7], [0.1; 7], [0.0; 7]],
            length: position(number + 1),
        },
    }
}

struct Bench {
    host: Box<Host>,
    asker: u32,
    /// The number of the next item to be pushed, of the program that the PC is about.
    pushed: u32,
    board: Box<BoardLink>,
    items: Box<ItemQueue<AXES, ITEMS>>,
    parameters: Box<ParameterBuffer<PARAMETERS>>,
    session: u32,
    controls: Controls,
    /// Names of programs, by how many were given up before them.
    obeyed: Vec<Program>,
    /// The program that the board is about, and the number of the next item to be taken of it.
    taken: (u16, u32),
    down: Wire,
    up: Wire,
    now_ms: u32,
    names: u32,
    /// Frames may be forged, and one was.
    may_forge: bool,
    is_forged: bool,
}

fn board(session: u32) -> Box<BoardLink> {
    Box::new(BoardLink::new(session, Identity { items: ITEMS as u16, ..IDENTITY }))
}

impl Bench {
    fn new(may_forge: bool) -> Self {
        Self {
            host: Box::new(Host::new(1)),
            asker: 1,
            pushed: 0,
            board: board(1),
            items: Box::default(),
            parameters: Box::new(ParameterBuffer::new()),
            session: 1,
            controls: Controls::NONE,
            obeyed: Vec::new(),
            taken: (0, 0),
            down: Wire::default(),
            up: Wire::default(),
            // Times wrap.
            now_ms: u32::MAX - 1000,
            names: 0,
            may_forge,
            is_forged: false,
        }
    }

    fn step(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        match input.int_in_range(0..=15)? {
            0 | 1 => self.push(),
            2 => self.transmit(),
            3 => {
                let count = input.int_in_range(1..=40)?;
                self.deliver_down(count);
            }
            4 => self.answer(),
            5 => {
                let count = input.int_in_range(1..=40)?;
                self.deliver_up(count);
            }
            6 => self.take(),
            7 => self.now_ms = self.now_ms.wrapping_add(input.int_in_range(1..=300)?),
            8 => self.down.harm(input)?,
            9 => self.up.harm(input)?,
            10 => self.command(input)?,
            11 => self.replace(input)?,
            12 => {
                let bytes = Vec::from(input.bytes(input.len().min(5))?);
                if input.arbitrary()? { &mut self.down } else { &mut self.up }.0.push_back(bytes);
            }
            13 if self.may_forge => {
                // Nothing that follows from it is the link's fault.
                self.is_forged |=
                    if input.arbitrary()? { &mut self.down } else { &mut self.up }.forge(input)?;
            }
            14 => self.parameters(input)?,
            _ => {
                for _ in 0..input.int_in_range(1..=30)? {
                    self.turn();
                }
            }
        }
        Ok(())
    }

    /// A millisecond on a whole wire.
    fn turn(&mut self) {
        self.now_ms = self.now_ms.wrapping_add(1);
        self.push();
        self.transmit();
        self.deliver_down(usize::MAX);
        self.take();
        self.answer();
        self.deliver_up(usize::MAX);
    }

    /// The program that the PC is about, once the board is known.
    fn program(&self) -> Option<Program> {
        let Controls { aborts, program, .. } = *self.host.controls();
        Some((self.host.session()?, aborts, program))
    }

    fn push(&mut self) {
        let Some(program) = self.program() else { return };
        match self.host.push(Some(&item(program, self.pushed))) {
            Ok(is_taken) => self.pushed += u32::from(is_taken),
            // What the items before were, only the PC knows that sent them.
            Err(error) => assert!(self.is_forged, "{error}"),
        }
    }

    fn transmit(&mut self) {
        let mut out = [0; FRAME_MAX];
        let length = self.host.transmit(self.now_ms, &mut out);
        if length > 0 {
            self.down.0.push_back(out[..length].to_vec());
        }
    }

    /// Hands `count` bytes to the board.
    fn deliver_down(&mut self, count: usize) {
        let Self { board, items, parameters, down, .. } = self;
        let bytes: Vec<u8> = std::iter::from_fn(|| next(down)).take(count).collect();
        let mut bytes = bytes.into_iter();
        while bytes.len() > 0 {
            board.receive(&mut bytes);
            board.put_items(items);
            board.put_parameters(parameters, true);
        }
        if let Some(controls) = self.board.take_controls() {
            let is_newer = controls.number.wrapping_sub(self.controls.number).cast_signed() > 0;
            assert!(is_newer || self.is_forged, "{controls:?} after {:?}", self.controls);
            self.controls = controls;
            self.obeyed.push((self.session, controls.aborts, controls.program));
        }
    }

    fn answer(&mut self) {
        let mut out = [0; FRAME_MAX];
        let came = self.items.came();
        let status = Status {
            tick: self.now_ms,
            aborts: came.aborts,
            taken: came.taken,
            is_ended: came.is_ended,
            ..STATUS
        };
        let mut length = self.board.transmit_parameters(&[7; PARAMETERS], &self.parameters, &mut out);
        if length == 0 {
            let status = self.now_ms.is_multiple_of(20).then_some(status);
            length = self.board.transmit(self.now_ms, &self.items, status, &mut out);
        }
        if length > 0 {
            self.up.0.push_back(out[..length].to_vec());
        }
    }

    /// Hands `count` bytes to the PC.
    fn deliver_up(&mut self, count: usize) {
        let bytes: Vec<u8> = std::iter::from_fn(|| next(&mut self.up)).take(count).collect();
        let mut events = Vec::new();
        self.host.receive(&bytes, self.now_ms, &mut |event| events.push(event));
        for event in events {
            match event {
                Event::Ready { next } => {
                    // Of this PC, or of one before.
                    if let Some(program) = self.program() {
                        for number in self.pushed..next.min(self.pushed.saturating_add(10_000)) {
                            self.host.skip(&item(program, number));
                        }
                    }
                    self.pushed = next;
                }
                Event::Restarted { .. } => {
                    self.host.accept();
                    self.pushed = 0;
                }
                Event::Replaced => assert!(self.is_forged, "nobody else asks"),
                Event::Unreadable { item } => assert!(self.is_forged, "item {item} can't be read"),
                Event::Foreign(build) => assert!(self.is_forged, "{build:?}"),
                Event::Refused(identity) => assert!(self.is_forged, "{identity:?}"),
                Event::Welcome(_)
                | Event::Status(_)
                | Event::Parameters { .. }
                | Event::Written { .. }
                | Event::Scope { .. }
                | Event::Flight { .. } => {}
            }
        }
    }

    /// The board takes an item.
    fn take(&mut self) {
        let came = self.items.came();
        if came.aborts != self.taken.0 {
            self.taken = (came.aborts, 0);
        }
        let Poll::Ready(Some(Ok(found))) = self.items.poll_next() else { return };
        let number = self.taken.1;
        self.taken.1 += 1;
        assert!(self.items.next().wrapping_sub(self.items.taken()) as usize <= ITEMS);
        if !self.is_forged {
            let program = self.obeyed.iter().rev().find(|program| program.1 == came.aborts);
            let program = program.copied().unwrap_or((self.session, 0, 0));
            assert_eq!(found, item(program, number), "item {number} of {program:?}");
        }
    }

    fn command(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        self.names += 1;
        let name = self.names;
        let (is_taken, gives_up) = match input.int_in_range(0..=5)? {
            0 => (self.host.press(Mode::Run), false),
            1 => (self.host.press(Mode::Hold), false),
            2 => (self.host.control(|controls| controls.override_permille ^= 1), false),
            3 => (self.host.abort(), true),
            4 => (self.host.enable(true), true),
            _ => (self.host.begin(name), true),
        };
        if is_taken && gives_up {
            self.pushed = 0;
        }
        Ok(())
    }

    /// Another PC, or the board has started anew.
    fn replace(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        if input.ratio(3, 4)? {
            self.asker += 1 << 16;
            (self.host, self.pushed) = (Box::new(Host::new(self.asker)), 0);
            // A wire has one end.
            self.up.0.clear();
        } else {
            self.session += 1;
            (self.board, self.items) = (board(self.session), Box::default());
            (self.controls, self.taken) = (Controls::NONE, (0, 0));
            self.obeyed.clear();
        }
        Ok(())
    }

    fn parameters(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        let offset = input.int_in_range(0..=PARAMETERS as u32)?;
        if input.arbitrary()? {
            self.host.read_parameters(offset);
        } else {
            self.host.write_parameters(&[9; PARAMETERS], offset);
        }
        Ok(())
    }

    /// The wire is whole from now on: all that is pushed gets there.
    fn repair(&mut self) {
        self.down.0.clear();
        self.up.0.clear();
        // The end of what was cut.
        self.down.0.push_back(vec![0]);
        self.up.0.push_back(vec![0]);
        if self.is_forged {
            for _ in 0..100 {
                self.turn();
            }
            return;
        }
        let (mut before, mut waited_ms) = (self.items.taken(), 0);
        for _ in 0..30 {
            while self.items.taken() == before {
                self.turn();
                waited_ms += 1;
                assert!(waited_ms < REPAIRS_MS, "nothing comes any more");
            }
            (before, waited_ms) = (self.items.taken(), 0);
        }
        // What was taken came after the newest controls, or they are said again.
        for _ in 0..1000 {
            self.turn();
        }
        assert_eq!(self.controls.number, self.host.controls().number, "the newest controls do not get there");
        assert!(self.host.is_controlled());
    }
}

/// The next byte on a wire.
fn next(wire: &mut Wire) -> Option<u8> {
    let frame = loop {
        match wire.0.front_mut() {
            Some(frame) if frame.is_empty() => drop(wire.0.pop_front()),
            Some(frame) => break frame,
            None => return None,
        }
    };
    Some(frame.remove(0))
}
