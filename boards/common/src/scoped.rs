//! Tests of the scope: a board in memory, an operator with a seed, a wire that loses frames, and every tick compared with the
//! board's own.

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;

use motion_kernel::fault::FaultKind;
use motion_kernel::flight::FlightRecorder;
use motion_kernel::hal::{
    DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs, VelocityChannel,
};
use motion_kernel::internals::Access;
use motion_kernel::kernel::Kernel;
use motion_kernel::link::{BoardLink, Event, FRAME_MAX, HostLink, Mode, State, Status};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Item;
use motion_kernel::queue::LiveStreams;
use motion_kernel::scope::{BODY_MAX, Replay, ReplayError, ScopeMemory, Told};
use motion_kernel::trace::{Digest, Trace};
use motion_kernel::units::{Counts, DacCode, Position};

use crate::control::Control;
use crate::fixture::{AXES, BOARD, PROGRAM, Random, TICK_S, identity, machine};
use crate::linked::Linked;
use crate::machine::Machine;
use crate::runs::to_start;

const ITEMS: usize = 8;
/// Ticks that have room before a poll.
const RECORDS: usize = 128;

/// Drives without inertia, with encoders that are off by a count or two, and lines that fail where they are told to.
struct Bench {
    counts: [f64; AXES],
    counts_per_code: [f64; AXES],
    is_enabled: bool,
    random: Random,
    inputs: MachineInputs<AXES>,
    fails: Option<Fails>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Fails {
    Encoder,
    Inputs,
    Output,
    Enable,
}

struct Failed;

impl Bench {
    fn new() -> Self {
        let counts_per_code = machine().header().axes.map(|axis| {
            let mm_s_per_code = axis.mm_s_at_10_v / f64::from(DacCode::from_volts(10.0_f64).0);
            mm_s_per_code * TICK_S / axis.mm_per_count
        });
        let (random, inputs) = (Random(5), MachineInputs::HEALTHY);
        Self { counts: [0.0; AXES], counts_per_code, is_enabled: false, random, inputs, fails: None }
    }

    fn unless<T>(&self, fails: Fails, answer: T) -> Result<T, Failed> {
        if self.fails == Some(fails) { Err(Failed) } else { Ok(answer) }
    }
}

impl Encoder<AXES> for Bench {
    type Error = Failed;
    fn latch(&mut self) -> Result<[Counts; AXES], Failed> {
        let noise = [(); AXES].map(|()| self.random.below(3) as i64 - 1);
        let counts = core::array::from_fn(|axis| Counts(self.counts[axis].round() as i64 + noise[axis]));
        self.unless(Fails::Encoder, counts)
    }
}

/// There is no index.
impl motion_kernel::hal::IndexLatch for Bench {
    type Error = Failed;
    fn arm(&mut self, _: usize) -> Result<(), Failed> {
        Err(Failed)
    }
    fn latched(&mut self, _: usize) -> Result<Option<Counts>, Failed> {
        Err(Failed)
    }
}

impl Inputs<AXES> for Bench {
    type Error = Failed;
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Failed> {
        self.unless(Fails::Inputs, self.inputs)
    }
}

impl VelocityChannel<AXES> for Bench {
    type Error = Failed;
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Failed> {
        if self.is_enabled {
            for ((counts, per_code), code) in self.counts.iter_mut().zip(self.counts_per_code).zip(codes) {
                *counts += per_code * f64::from(code.0);
            }
        }
        self.unless(Fails::Output, ())
    }
}

impl DriveEnable<AXES> for Bench {
    type Error = Failed;
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Failed> {
        self.unless(Fails::Enable, ())?;
        self.is_enabled = enabled;
        Ok(())
    }
}

impl Outputs for Bench {
    fn switch(&mut self, _: &OutputState) {}
}

/// Faults before ticks that nobody has read do not stand in the way of those behind a snapshot.
#[test]
fn faults_before_dropped_ticks_are_dropped() {
    let machine = machine();
    let header = *machine.header();
    let mut flight = FlightRecorder::<f32, AXES, 16, 8>::new();
    let mut streams = LiveStreams::<f32, AXES, 64, 16>::new();
    let (feeder, intake) = streams.split(header.rules, header.start);
    let mut memory = ScopeMemory::<f32, AXES, 16>::new();
    let (recorder, mut scope, log) = memory.split(&feeder);
    let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
    let mut control = Control::new(kernel, intake, &mut flight);
    control.set_recorder(recorder);
    scope.obey(Some((1, 0)), log);
    let mut bench = Bench::new();
    for round in 0..3 {
        // Twice as many ticks as have room, and more faults before them than do.
        for tick in 0..80 {
            control.tick((tick % 2 == 0).then_some(FaultKind::TickOverrun), None, &mut bench);
        }
        assert!(scope.is_snapshot_due(log), "round {round}");
        let Control { kernel, intake, recorder: Some(recorder), .. } = &mut control else {
            panic!("there is one")
        };
        scope.take_snapshot(kernel, intake, recorder, log);
        for tick in 0..8 {
            control.tick((tick % 2 == 0).then_some(FaultKind::TickOverrun), None, &mut bench);
        }
        let mut body = [0; BODY_MAX];
        while scope.body(log, &mut body).is_some() {}
        assert!(!scope.is_snapshot_due(log), "round {round}");
    }
}

/// What a run is.
#[derive(Clone, Debug)]
struct Run {
    seed: u64,
    ticks: u64,
    /// Of a thousand frames of the board.
    loses_permille: u64,
    /// Ticks of the longest poll of the background, and how many in a hundred accesses to the streams a tick interrupts.
    poll_ticks_max: u64,
    interrupts_percent: u64,
    /// The scope is switched on in this tick.
    from: u64,
    /// A bit of this body of the scope is wrong, counted from the last byte.
    wrong_bit: Option<(u64, usize)>,
    /// The items of programs are not known from this one on.
    forgets: Option<u32>,
}

impl Run {
    const GOOD: Self = Self {
        seed: 1,
        ticks: 100_000,
        loses_permille: 0,
        poll_ticks_max: 8,
        interrupts_percent: 10,
        from: 0,
        wrong_bit: None,
        forgets: None,
    };
}

/// What came of it.
#[derive(Debug, Default)]
struct Came {
    /// Ticks that were told, all of them as the board's.
    told: u64,
    gaps: Vec<Range<u64>>,
    /// Bodies of the scope's frames, and bytes of these frames.
    bodies: u64,
    bytes: u64,
    /// Bytes of snapshots.
    of_snapshots: u64,
    /// Ticks told in motion, in a fault, and how often items were not known.
    moving: u64,
    faulted: u64,
    unknown: u64,
    error: Option<ReplayError>,
    /// What came was made wrong: a tick in 256 is told before that is found.
    is_wrong: bool,
    /// The first tick that was told, and the last that was told or is missing.
    first: u64,
    last: u64,
}

impl Came {
    fn missing(&self) -> u64 {
        self.gaps.iter().map(|gap| gap.end - gap.start).sum()
    }

    /// Takes what is told, and compares it with the board's.
    fn take<R: Real>(&mut self, told: &Told<'_, R, AXES>, board: &mut VecDeque<Trace<R, AXES>>) {
        match told {
            Told::Tick(trace) => {
                if self.told == 0 {
                    (self.first, self.last) = (trace.tick, trace.tick - 1);
                }
                assert_eq!(trace.tick, self.last + 1, "told in order, or missing");
                let mut of_board = board.iter().skip_while(|of_board| of_board.tick < trace.tick);
                let of_board = of_board.next().expect("a tick of the board");
                if !self.is_wrong {
                    assert_same(trace, of_board);
                }
                while board.front().is_some_and(|of_board| of_board.tick <= trace.tick) {
                    board.pop_front();
                }
                self.last = trace.tick;
                self.told += 1;
                self.moving += u64::from(trace.executed.motion.v_mm_s > R::ZERO);
                self.faulted += u64::from(trace.fault.is_some());
            }
            &Told::Gap { first, last } => {
                assert!(self.told == 0 || first == self.last + 1 && last >= first, "{first} {last} {self:?}");
                self.gaps.push(first..last + 1);
                self.last = last;
            }
            Told::UnknownItems => self.unknown += 1,
        }
    }
}

/// The same in every quantity, to the bit.
fn assert_same<R: Real>(found: &Trace<R, AXES>, expected: &Trace<R, AXES>) {
    let digest = |trace: &Trace<R, AXES>| {
        let mut digest = Digest::new();
        digest.add(trace);
        digest.value()
    };
    let axes = |trace: &Trace<R, AXES>| {
        trace.axes.map(|axis| {
            let figures =
                (axis.set, axis.actual, axis.following_error_mm.to_bits64(), axis.code, axis.counts);
            (figures, axis.saturated, axis.lost)
        })
    };
    let rest =
        |trace: &Trace<R, AXES>| (trace.tick, trace.executed.state, trace.executed.stretches, trace.inputs);
    assert_eq!(rest(found), rest(expected));
    assert_eq!(axes(found), axes(expected), "tick {}", found.tick);
    assert_eq!(found.fault, expected.fault, "tick {}", found.tick);
    assert_eq!(digest(found), digest(expected), "tick {}", found.tick);
}

/// An operator who drives the stringer from wherever the machine stands, again and again, and presses what he likes.
struct Operator {
    host: HostLink<AXES, 64, 8192>,
    status: Option<Status<AXES>>,
    items: VecDeque<Option<Item<AXES>>>,
    is_ready: bool,
    /// All items ever pushed, by program.
    pushed: HashMap<u16, Vec<Option<Item<AXES>>>>,
    random: Random,
}

impl Operator {
    fn stringer(&self, from: [Position; AXES]) -> Vec<Option<Item<AXES>>> {
        let machine = machine();
        let way = to_start(machine.header(), from).expect("a way").map(|item| match item {
            Ok(item) => item,
            Err(never) => match never {},
        });
        way.chain(machine.program.items().map(|item| item.expect("sound"))).map(Some).chain([None]).collect()
    }

    fn step(&mut self) {
        while let Some(item) = self.items.front()
            && self.is_ready
        {
            let aborts = self.host.controls().aborts;
            if !self.host.push(item.as_ref()).expect("short") {
                break;
            }
            self.pushed.entry(aborts).or_default().extend(self.items.pop_front());
        }
        let Some(status) = self.status.filter(|status| status.aborts == self.host.controls().aborts) else {
            return;
        };
        match (status.state, self.random.below(20_000)) {
            (State::Off, 0..100) if status.fault.is_some() => {
                let _ = self.host.clear_fault();
            }
            (State::Off, 0..100) if status.is_ready && self.host.enable(true) => {
                (self.is_ready, self.status) = (false, None);
                self.items.clear();
            }
            (State::Held | State::Stopped | State::Idle, 0..400) => {
                if self.items.is_empty() && self.is_ready && self.host.waiting() == 0 {
                    self.items.extend(self.stringer(status.set));
                }
                let _ = self.host.press(Mode::Run);
            }
            (State::Moving, 0..10) => {
                let _ = self.host.press(Mode::Hold);
            }
            (_, 20..40) => {
                let permille = [0, 50, 300, 700, 1000, 1500, 2000][self.random.below(7) as usize];
                let _ = self.host.control(|controls| controls.override_permille = permille);
            }
            (_, 40..44) => {
                let _ = self.host.control(|controls| controls.is_single_block ^= true);
            }
            (_, 60) if self.host.abort() => {
                (self.is_ready, self.status) = (false, None);
                self.items.clear();
            }
            (_, 61) if self.host.enable(false) => {
                (self.is_ready, self.status) = (false, None);
                self.items.clear();
            }
            _ => {}
        }
    }
}

/// What the tick owns.
struct Foreground<R: Real> {
    control: Control<'static, R, AXES, 16, 8>,
    bench: Bench,
    unhealthy: Option<FaultKind<R>>,
    random: Random,
    /// What its ticks were, as far as nobody has told them again.
    traces: VecDeque<Trace<R, AXES>>,
}

impl<R: Real> Foreground<R> {
    /// A tick; before it, what the machine's lines and the board itself find.
    fn tick(&mut self) {
        let Self { control, bench, unhealthy, random, traces } = self;
        match random.below(100_000) {
            0..3 => *unhealthy = Some(FaultKind::EmergencyStop),
            3..200 => *unhealthy = None,
            200 => {
                let fails = [Fails::Encoder, Fails::Inputs, Fails::Output, Fails::Enable];
                bench.fails = fails.get(random.below(4) as usize).copied();
            }
            201..2000 => bench.fails = None,
            2000..2010 => bench.inputs.axes[1] = bench.inputs.axes[1].with_home(random.below(2) == 0),
            2010 => bench.inputs.axes[2] = bench.inputs.axes[2].with_fault(true),
            2011..2400 => bench.inputs.axes[2] = bench.inputs.axes[2].with_fault(false),
            2400 => control.trip(FaultKind::TickMissed { ticks: 1 }),
            _ => {}
        }
        control.tick(*unhealthy, None, bench);
        traces.push_back(*control.kernel.trace());
    }
}

/// The background's way to it.
struct Shared<'f, R: Real>(&'f RefCell<Option<Foreground<R>>>);

impl<R: Real> rtic_core::Mutex for Shared<'_, R> {
    type T = Control<'static, R, AXES, 16, 8>;

    fn lock<T>(&mut self, using: impl FnOnce(&mut Self::T) -> T) -> T {
        using(&mut self.0.borrow_mut().as_mut().expect("begun").control)
    }
}

/// Drives a board as `run` says.
fn drive<R: Real>(run: &Run) -> Came {
    println!("{run:?}");
    let machine = Machine::<R, AXES>::new(PROGRAM, &BOARD).expect("suits");
    let header = *machine.header();
    // Kept as long as a board keeps them.
    let foreground: &'static _ = Box::leak(Box::new(RefCell::new(None::<Foreground<R>>)));
    let flight = Box::leak(Box::new(FlightRecorder::<R, AXES, 16, 8>::new()));
    let streams = Box::leak(Box::new(LiveStreams::<R, AXES, 32, 16>::new()));
    let memory = Box::leak(Box::new(ScopeMemory::<R, AXES, RECORDS>::new()));
    let (mut feeder, intake) = streams.split(header.rules, header.start);
    let interrupts = RefCell::new(Random(run.seed ^ 77));
    let percent = run.interrupts_percent;
    let interrupt: &'static _ = Box::leak(Box::new(move |_: Access| {
        // While the background has locked the tick out, none comes.
        if interrupts.borrow_mut().below(100) < percent
            && let Ok(mut foreground) = foreground.try_borrow_mut()
            && let Some(foreground) = &mut *foreground
        {
            foreground.tick();
        }
    }));
    feeder.watch(interrupt);
    let (recorder, scope, log) = memory.split(&feeder);
    let kernel = Kernel::new(&machine.axes, header.start, [Counts(0); AXES]);
    let mut control = Control::new(kernel, intake, flight);
    let link = BoardLink::new(3, identity(ITEMS));
    let mut linked = Linked::<R, AXES, ITEMS, 64, 0>::new(&BOARD, link, feeder, header.pulse);
    control.set_recorder(recorder);
    linked.set_scope(scope, log);
    *foreground.borrow_mut() = Some(Foreground {
        control,
        bench: Bench::new(),
        unhealthy: None,
        random: Random(run.seed ^ 0xabcd),
        traces: VecDeque::new(),
    });
    let mut streams_again = Box::new(LiveStreams::<R, AXES, 64, 16>::new());
    let mut replay = Box::new(Replay::new(&machine.axes, &header, &mut *streams_again));
    let mut operator = Operator {
        host: HostLink::new(1),
        status: None,
        items: VecDeque::new(),
        is_ready: false,
        pushed: HashMap::new(),
        random: Random(run.seed),
    };
    let mut random = Random(run.seed ^ 0x1234);
    let (mut out, mut to_board) = ([0; FRAME_MAX], VecDeque::new());
    let mut came = Came::default();
    for now in 0..run.ticks {
        if now == run.from {
            operator.host.set_scope(true);
        }
        operator.step();
        let now_ms = (now / 2) as u32;
        let length = operator.host.transmit(now_ms, &mut out);
        to_board.extend(&out[..length]);
        for _ in 0..1 + random.below(run.poll_ticks_max) {
            foreground.borrow_mut().as_mut().expect("begun").tick();
        }
        linked.poll(&mut || to_board.pop_front(), &mut Shared(foreground));
        for _ in 0..4 {
            let length = linked.transmit(now_ms, &mut Shared(foreground), &mut out);
            if random.below(1000) < run.loses_permille {
                continue;
            }
            let Operator { host, status, is_ready, pushed, .. } = &mut operator;
            let mut bodies = Vec::new();
            host.receive(&out[..length], now_ms, &mut |event| match event {
                Event::Status(told) => *status = Some(told),
                Event::Ready { .. } => *is_ready = true,
                Event::Welcome(_) => {}
                Event::Scope { is_first, body } => bodies.push((is_first, body.bytes().to_vec())),
                other => panic!("{other:?}"),
            });
            for (is_first, mut body) in bodies {
                (came.bodies, came.bytes) = (came.bodies + 1, came.bytes + length as u64);
                // Ticks begin with 2.
                came.of_snapshots += if body[0] == 2 { 0 } else { body.len() as u64 - 1 };
                if let Some((number, bit)) = run.wrong_bit
                    && number == came.bodies
                {
                    let at = body.len() - 1 - bit / 8;
                    body[at] ^= 1 << (bit % 8);
                    came.is_wrong = true;
                }
                let is_known = |number: u32| run.forgets.is_none_or(|from| number < from);
                let mut items = |aborts: u16, number: u32| {
                    pushed.get(&aborts)?.get(number as usize).copied().filter(|_| is_known(number))
                };
                let mut foreground = foreground.borrow_mut();
                let traces = &mut foreground.as_mut().expect("begun").traces;
                let taken = replay.take(is_first, &body, &mut items, &mut |told| came.take(&told, traces));
                if let Err(error) = taken {
                    came.error = Some(error);
                    return came;
                }
                if came.unknown > 0 && now.is_multiple_of(500) {
                    host.renew_scope();
                }
            }
        }
    }
    assert_eq!(came.told + came.missing(), came.last + 1 - came.first);
    came
}

/// Nothing is lost: every tick from the snapshot on.
fn whole<R: Real>(run: &Run) {
    let came = drive::<R>(run);
    println!("{came:?}, {:.2} bytes a tick", came.bytes as f64 / came.told as f64);
    assert_eq!((came.error, came.unknown, came.missing()), (None, 0, 0));
    assert!(came.told > run.ticks && came.moving > came.told / 5 && came.faulted > 0, "{came:?}");
}

/// A million ticks in either number type, with holds, overrides, single block, aborts, faults and failing lines, and ticks that
/// interrupt the background.
#[test]
fn every_tick_is_that_of_the_board() {
    for seed in 1..=2 {
        let run = Run { seed, ..Run::GOOD };
        whole::<f32>(&run);
        whole::<Fixed>(&run);
    }
}

#[test]
#[ignore = "ten million ticks: cargo test --release -p motion-board -- --ignored --nocapture ten_million"]
fn ten_million_ticks_are_those_of_the_board() {
    let run = Run { seed: 3, ticks: 2_000_000, ..Run::GOOD };
    whole::<f32>(&run);
}

/// One frame in a hundred is lost, whatever is in it: all other ticks are those of the board, and the gaps have names.
#[test]
fn lost_frames_are_gaps_with_names() {
    for seed in 1..=3 {
        let run = Run { seed, loses_permille: 10, ticks: 50_000, ..Run::GOOD };
        for came in [drive::<f32>(&run), drive::<Fixed>(&run)] {
            println!("{came:?}");
            assert_eq!((came.error, came.unknown), (None, 0));
            assert!(came.gaps.len() > 20 && came.moving > came.told / 5, "{came:?}");
            // Motion is told from its midst on, so little is missing.
            assert!(came.missing() < came.told / 10, "{} of {}", came.missing(), came.told);
        }
    }
}

/// A background that is away longer than there is room for ticks: what was dropped is named.
#[test]
fn ticks_without_room_are_gaps_with_names() {
    let run = Run { poll_ticks_max: RECORDS as u64, ticks: 10_000, ..Run::GOOD };
    let came = drive::<f32>(&run);
    println!("{came:?}");
    assert_eq!((came.error, came.unknown), (None, 0));
    assert!(came.gaps.len() > 100 && came.told > came.missing() && came.moving > 1000, "{came:?}");
}

/// Switched on in the middle of motion, or wherever the machine is.
#[test]
fn the_scope_begins_anywhere() {
    for from in (1000..4000).step_by(150) {
        let run = Run { from, ticks: from + 300, ..Run::GOOD };
        let came = drive::<f32>(&run);
        println!("snapshot of {} bytes", came.of_snapshots);
        assert_eq!((came.error, came.unknown, came.missing()), (None, 0, 0));
        assert!(came.told > 500 && came.of_snapshots < 2000, "{came:?}");
    }
}

/// What came is wrong by a bit: found, in its tick or in one of the next, by the check of one of them. A bit of the last byte
/// is one of a check.
#[test]
fn a_wrong_bit_is_found() {
    let (mut named, mut unused) = (0, 0);
    for body in (20..420).step_by(10) {
        for bit in [0, 7, 11, 30, 77] {
            let run = Run { ticks: 3000, wrong_bit: Some((body, bit)), ..Run::GOOD };
            let came = drive::<f32>(&run);
            let Some(error) = came.error else {
                // Where the path of a restart is counted from matters to snapshots alone: every tick is still the board's.
                assert!(came.told > 2000 && came.missing() == 0, "not found: {run:?} {came:?}");
                unused += 1;
                continue;
            };
            if let ReplayError::Difference { tick } = error {
                named += 1;
                assert!(tick > came.last && tick < came.last + 100, "{error:?} {came:?}");
                // In the very tick if it is the check.
                assert!(bit > 7 || tick < came.last + 2, "{error:?} {came:?}");
            }
        }
    }
    assert!(named > 100 && unused <= 1, "{named} {unused}");
}

/// Items that nobody knows: told as such, never as another motion; at rest the scope goes on.
#[test]
fn unknown_items_end_in_a_gap() {
    let run = Run { forgets: Some(9), ticks: 20_000, ..Run::GOOD };
    let came = drive::<f32>(&run);
    println!("{came:?}");
    assert_eq!(came.error, None);
    assert!(came.unknown > 1 && came.gaps.len() > 1 && came.told > came.missing() / 10, "{came:?}");
}
