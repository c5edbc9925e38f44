//! Boards on the link: an emulated board with its machine simulated, and the PC's end of the link over TCP.
//!
//! The emulator's time is the PC's here, so nothing is judged by how fast anything is: only what comes out, and by the board's
//! own ticks. Time-outs are against hanging.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use motion_kernel::link::{Build, Event, FRAME_MAX, HostLink, Identity, Mode, State, Status};
use motion_kernel::program::{FORMAT, Header, Item, Reader, write};
use motion_kernel::straight::Straight;
use motion_kernel::units::Position;

use crate::programs;
use crate::tools::{Board, Bundle, Case, LINKED_BOARDS, Tools};

const AXES: usize = 3;
/// As the board has room (`boards/qemu-mps2/src/bin/linked.rs`).
const ITEMS: u16 = 256;
/// Against hanging.
pub(crate) const TIME_OUT: Duration = Duration::from_secs(900);
/// Feed of the way to a program's start [mm/s].
const WAY_MM_S: f64 = 50.0;
/// Ticks after which a machine that has not moved rests.
const REST_TICKS: u32 = 1000;
/// Ticks from one status to the next, on average: it is told every 40 ticks, where the background keeps up.
const STATUS_TICKS_MAX: u32 = 500;
/// Name of the long program; the next one is that of another time that it is driven.
const LONG: u32 = 7;
/// Items of the long program that are driven before the cable is out, and before an abort.
const BEFORE: u32 = 300;

/// A running emulator.
pub(crate) struct Emulator {
    running: Child,
    port: u16,
}

impl Emulator {
    pub(crate) fn start(tools: &Tools, board: Board, record: &Bundle) -> Result<Self, String> {
        let free = TcpListener::bind(("127.0.0.1", 0)).and_then(|listener| listener.local_addr());
        let port = free.map_err(|error| format!("a free port: {error}"))?.port();
        // What the board writes byte by byte is not to wait for anything.
        let serial = format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
        let mut emulator = tools.emulator(board, "linked", record.path(), &serial)?;
        // It says that it was ended, and nothing of it is to hold this test's output open.
        emulator.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let running = emulator.spawn().map_err(|error| format!("emulator: {error}"))?;
        Ok(Self { running, port })
    }

    /// Where it takes connections, on this machine.
    pub(crate) fn port(&self) -> u16 {
        self.port
    }

    /// Waits until it takes a connection.
    pub(crate) fn connect(&mut self) -> Result<TcpStream, String> {
        let since = Instant::now();
        loop {
            match TcpStream::connect(("127.0.0.1", self.port)) {
                Ok(stream) => {
                    let is_set = stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
                    return is_set.map(|()| stream).map_err(|error| error.to_string());
                }
                Err(error) if since.elapsed() > TIME_OUT => return Err(error.to_string()),
                Err(_) => std::thread::sleep(Duration::from_millis(20)),
            }
            if let Ok(Some(status)) = self.running.try_wait() {
                return Err(format!("the emulator has ended: {status}"));
            }
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // A signal to `timeout` ends both.
        let _ = Command::new("kill").arg(self.running.id().to_string()).status();
        let _ = self.running.wait();
    }
}

/// What is sent: items, and none for the end of their program.
type Entries = Vec<Option<Item<AXES>>>;

type Link = HostLink<AXES, 512, 65536>;

/// The PC's side of a connection.
struct Pc {
    host: Box<Link>,
    stream: TcpStream,
    began: Instant,
    /// What the wire has not taken yet, and how many bytes it took.
    out: Vec<u8>,
    sent: usize,
    /// What is to be sent, and how much of it the link has.
    entries: Entries,
    pushed: usize,
    identity: Option<Identity>,
    /// The number of the next item, since the board takes them.
    next: Option<u32>,
    status: Option<Status<AXES>>,
    /// When the first status came, its tick, and how many came after it.
    first: Option<(Instant, u32)>,
    statuses: u32,
}

impl Pc {
    /// Connected and greeted.
    fn greet(emulator: &mut Emulator, asker: u32) -> Result<Self, String> {
        let mut pc = Self {
            host: Box::new(HostLink::new(asker)),
            stream: emulator.connect()?,
            began: Instant::now(),
            out: Vec::new(),
            sent: 0,
            entries: Vec::new(),
            pushed: 0,
            identity: None,
            next: None,
            status: None,
            first: None,
            statuses: 0,
        };
        pc.wait("a board", |pc| pc.identity.is_some() && pc.next.is_some() && pc.status.is_some())?;
        Ok(pc)
    }

    /// Sends and receives what there is.
    fn turn(&mut self) -> Result<(), String> {
        let now_ms = self.began.elapsed().as_millis() as u32;
        while let Some(entry) = self.entries.get(self.pushed)
            && self.host.push(entry.as_ref()).map_err(|error| error.to_string())?
        {
            self.pushed += 1;
        }
        // A frame that is written late has the newest controls.
        if self.out.is_empty() {
            let mut frame = [0; FRAME_MAX];
            let length = self.host.transmit(now_ms, &mut frame);
            self.out.extend(&frame[..length]);
        }
        let written = if self.out.is_empty() { Ok(0) } else { self.stream.write(&self.out) };
        let written = unless_blocked(written)?;
        self.out.drain(..written);
        self.sent += written;
        let mut bytes = [0; 4096];
        let read = self.stream.read(&mut bytes);
        if matches!(read, Ok(0)) {
            return Err("the board's end of the connection is closed".to_owned());
        }
        let read = unless_blocked(read)?;
        self.receive(&bytes[..read], now_ms)?;
        if written == 0 && read == 0 {
            std::thread::sleep(Duration::from_micros(500));
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &[u8], now_ms: u32) -> Result<(), String> {
        let Self { host, identity, next, status, first, statuses, .. } = self;
        let mut wrong = None;
        let aborts = host.controls().aborts;
        host.receive(bytes, now_ms, &mut |event| match event {
            // Of what was given up.
            Event::Status(told) if told.aborts != aborts => {}
            Event::Welcome(found) => *identity = Some(found),
            Event::Ready { next: found } => *next = Some(found),
            Event::Status(told) => {
                *statuses += u32::from(first.is_some());
                first.get_or_insert((Instant::now(), told.tick));
                *status = Some(told);
                if told.fault.is_some() {
                    wrong = Some(Event::Status(told));
                }
            }
            other => wrong = Some(other),
        });
        wrong.map_or(Ok(()), |wrong| Err(format!("{wrong:?}")))
    }

    /// Goes on until `is_reached`.
    fn wait(&mut self, what: &str, mut is_reached: impl FnMut(&Self) -> bool) -> Result<(), String> {
        let since = Instant::now();
        while !is_reached(self) {
            if since.elapsed() > TIME_OUT {
                let (pushed, of, confirmed) = (self.pushed, self.entries.len(), self.host.confirmed());
                return Err(format!(
                    "no {what}: {pushed} of {of} pushed, {confirmed} confirmed, {:?}",
                    self.status
                ));
            }
            self.turn()?;
        }
        Ok(())
    }

    fn is(&self, state: State) -> bool {
        self.status.is_some_and(|status| status.state == state)
    }

    fn told(&self) -> Result<Status<AXES>, String> {
        self.status.ok_or_else(|| "no status".to_owned())
    }

    fn press(&mut self, mode: Mode) -> Result<(), String> {
        self.host.press(mode).then_some(()).ok_or_else(|| "the board is not known".to_owned())
    }

    /// Has what there was before given up by `command`, and waits until the machine is held and another program may follow,
    /// from its first item on.
    fn give_up(&mut self, command: impl FnOnce(&mut Link) -> bool) -> Result<(), String> {
        (self.next, self.status) = (None, None);
        self.send(&[]);
        if !command(&mut self.host) {
            return Err("the board is not known".to_owned());
        }
        self.wait("board that waits for a program", |pc| pc.next == Some(0) && pc.is(State::Held))
    }

    fn send(&mut self, entries: &[Option<Item<AXES>>]) {
        (self.entries, self.pushed) = (entries.to_vec(), 0);
    }

    /// Waits until what is sent is driven: all of it taken, to the last bit at its end.
    fn end(&mut self) -> Result<(), String> {
        self.wait("end of a program", |pc| {
            pc.pushed == pc.entries.len()
                && pc.host.waiting() == 0
                && pc.is(State::Idle)
                && pc.status.is_some_and(|status| status.taken == pc.host.confirmed())
        })?;
        let expected = self.entries.iter().rev().flatten().find_map(|item| match item {
            Item::EndOfStretch(end) => Some(*end),
            _ => None,
        });
        let found = self.told()?.set;
        if Some(found) == expected { Ok(()) } else { Err(format!("at {found:?}, expected {expected:?}")) }
    }

    /// Waits until the machine has not moved for some time, whatever it waits for.
    fn rest(&mut self) -> Result<(), String> {
        let mut since: Option<Status<AXES>> = None;
        self.wait("rest", |pc| {
            let Some(now) = pc.status else { return false };
            let before = *since.get_or_insert(now);
            if now.set != before.set {
                since = Some(now);
            }
            now.feed_mm_s == 0.0 && now.tick.wrapping_sub(before.tick) > REST_TICKS
        })
    }
}

fn unless_blocked(result: std::io::Result<usize>) -> Result<usize, String> {
    match result {
        Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(0),
        result => result.map_err(|error| error.to_string()),
    }
}

/// A program with the way to its start from where the machine stands.
struct Program {
    header: Header<AXES>,
    items: Vec<Item<AXES>>,
}

impl Program {
    fn new(bytes: &[u8]) -> Self {
        let program = Reader::new(bytes).expect("a program");
        let items = program.items().map(|item| item.expect("an item")).collect();
        Self { header: *program.header(), items }
    }

    fn from(&self, here: [Position; AXES]) -> Entries {
        let Header { rules, pulse, tick_s, start, .. } = self.header;
        let way = Straight::new(here, start, pulse, rules.limits, [WAY_MM_S; 2], tick_s).expect("a way");
        let way = way.map(|item| item.unwrap_or_else(|never| match never {}));
        way.chain(self.items.iter().copied()).map(Some).chain([None]).collect()
    }
}

/// What a board is told about its machine: a program without items.
pub(crate) fn record(program: &[u8]) -> Vec<u8> {
    let program = Reader::<AXES>::new(program).expect("a program");
    let guards = program.guards().expect("guards");
    let mut bytes = Vec::new();
    write(program.header(), guards.as_ref(), &[], &mut bytes).expect("short");
    bytes
}

/// A number that other starts do not have.
pub(crate) fn session() -> u32 {
    use std::hash::{BuildHasher, RandomState};
    RandomState::new().hash_one(0) as u32
}

/// A PC enables a board's drives and has a program driven; its cable is out in the middle of another one, and it goes on
/// with the rest; it gives up a third one, and has a fourth one driven.
fn driven(tools: &Tools, board: Board) -> Result<String, String> {
    let (stringer, long) = (programs::live_stringer(), programs::long());
    let record = record(&stringer);
    let bundle = Bundle::new(&[Case { seed: session(), bytes: record.clone() }])?;
    let (stringer, long) = (Program::new(&stringer), Program::new(&long));
    let mut emulator = Emulator::start(tools, board, &bundle)?;

    let mut pc = Pc::greet(&mut emulator, 1)?;
    let expected = Identity {
        build: Build::THIS,
        format: FORMAT.into(),
        axes: AXES as u16,
        is_fixed_point: board.number == "fixed",
        tick_s: stringer.header.tick_s,
        items: ITEMS,
        outputs: motion_kernel::hal::BoardOutputs::CommandedSpeed,
        machine: record.last_chunk().map_or(0, |&checksum| u32::from_le_bytes(checksum)),
    };
    if pc.identity != Some(expected) || pc.next != Some(0) {
        return Err(format!("{:?} {:?}, expected {expected:?}", pc.next, pc.identity));
    }

    // Drives are off until the command.
    pc.wait("ready board", |pc| {
        pc.status.is_some_and(|status| status.state == State::Off && status.is_ready)
    })?;
    pc.give_up(|host| host.enable(true))?;
    // All of it is there when it starts, so no time of this PC can make it starve.
    pc.send(&stringer.from(pc.told()?.set));
    pc.wait("board that has all", |pc| pc.pushed == pc.entries.len() && pc.host.waiting() == 0)?;
    pc.press(Mode::Run)?;
    pc.end()?;
    if pc.told()?.starvations != 0 {
        return Err(format!("starved: {:?}", pc.told()?));
    }

    // As many items of the long program as there is room for, as fast as the wire takes them; then its motion.
    pc.give_up(|host| host.begin(LONG))?;
    let entries = long.from(pc.told()?.set);
    let (sent, since) = (pc.sent, Instant::now());
    pc.send(&entries);
    pc.wait("full board", |pc| pc.host.confirmed() >= u32::from(ITEMS))?;
    let bytes_per_s = (pc.sent - sent) as f64 / since.elapsed().as_secs_f64();
    pc.press(Mode::Run)?;
    let is_under_way =
        |pc: &Pc| pc.is(State::Moving) && pc.status.is_some_and(|status| status.taken > BEFORE);
    pc.wait("motion", is_under_way)?;
    let told = pc.told()?;
    let (began, first_tick) = pc.first.ok_or("no status")?;
    let ticks = told.tick.wrapping_sub(first_tick);
    let ticks_per_s = f64::from(ticks) / began.elapsed().as_secs_f64();
    let status_ticks = ticks / pc.statuses.max(1);
    if status_ticks > STATUS_TICKS_MAX {
        return Err(format!("a status in {status_ticks} ticks on average"));
    }

    // The cable is out: nobody says goodbye. Motion ends at rest where what came ends.
    let (presses, starvations) = (pc.host.controls().presses, told.starvations);
    drop(pc);
    let mut pc = Pc::greet(&mut emulator, 2)?;
    pc.rest()?;
    // The same board, still enabled, which expects an item in the middle of the program.
    let (next, at_rest, controls) = (pc.next.unwrap_or_default(), pc.told()?, *pc.host.controls());
    let is_same = (controls.presses, controls.program) == (presses, LONG) && at_rest.state != State::Off;
    if !is_same || next <= BEFORE || next as usize >= entries.len() || at_rest.taken > next {
        return Err(format!("after the cable: item {next} of {}, {controls:?}, {at_rest:?}", entries.len()));
    }
    // The bytes of an item depend on those before it.
    entries.iter().take(next as usize).flatten().for_each(|item| pc.host.skip(item));
    pc.send(&entries[next as usize..]);
    pc.press(Mode::Run)?;
    pc.end()?;

    // Given up in the middle; then another one from where it has come to rest.
    pc.give_up(|host| host.begin(LONG + 1))?;
    pc.send(&long.from(pc.told()?.set));
    pc.press(Mode::Run)?;
    pc.wait("motion again", is_under_way)?;
    pc.give_up(Link::abort)?;
    let before = pc.told()?.set;
    pc.rest()?;
    if pc.told()?.set != before {
        return Err(format!("it moves after an abort, from {before:?} to {:?}", pc.told()?));
    }
    pc.send(&stringer.from(before));
    pc.press(Mode::Run)?;
    pc.end()?;

    Ok(format!(
        "{}, {}: {bytes_per_s:.0} bytes/s to the board; {ticks_per_s:.0} ticks/s, of {:.0} in real time; a status in \
         {status_ticks} ticks; item {next} of {} after the cable, at {:.3} mm, {:?}; {starvations} starvations before",
        board.core,
        board.number,
        1.0 / stringer.header.tick_s,
        entries.len(),
        at_rest.set[0].to_mm(),
        at_rest.state,
    ))
}

pub(crate) fn a_pc_drives_boards_over_the_link(tools: &Tools) -> Result<(), String> {
    // Beside each other: most of the time both wait.
    let results = std::thread::scope(|scope| {
        LINKED_BOARDS
            .map(|board| {
                scope.spawn(move || driven(tools, board).map_err(|error| format!("{}: {error}", board.core)))
            })
            .map(|thread| thread.join().unwrap_or_else(|_| Err("panicked".to_owned())))
    });
    for result in results {
        println!("{}", result?);
    }
    Ok(())
}
