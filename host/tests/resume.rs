//! Power cuts in the middle of programs: what is driven before and after them is the whole path, and nothing of it is left
//! out. Boards run in step with the sender, tick by tick, so nothing depends on the clock.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::sync::mpsc::{Receiver, Sender as Channel, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use motion_board::{BoardParameters, Control, Linked};
use motion_host::board::job::parameters;
use motion_host::board::progress::{Place, Progress};
use motion_host::board::sender::{Found, Permissions};
use motion_host::board::wire::Wire;
use motion_host::board::{Connection, Heard, Job, Sender, Step};
use motion_host::machine::{CoolantSettings, Machine, SpindleSettings};
use motion_host::planning::Executable;
use motion_host::simulate::hardware::{SimulatedHardware, simulated};
use motion_kernel::axis::Feedforward;
use motion_kernel::flight::FlightRecorder;
use motion_kernel::hal::{
    BoardOutputs, DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, OutputState, Outputs,
    VelocityChannel,
};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::PathMotion;
use motion_kernel::link::{BoardLink, Build, Event, FRAME_MAX, Identity};
use motion_kernel::live::Leads;
use motion_kernel::path::Piece;
use motion_kernel::program::{FORMAT, Item};
use motion_kernel::queue::LiveStreams;
use motion_kernel::units::{Counts, DacCode, Position};
use motion_tests::check::planned;
use motion_tests::random::Random;
use rtic_core::Exclusive;

/// Programs with power cuts, one or two, on each of two machines.
const CUTS: u64 = 30;
/// Ticks of the board each time that the sender reads.
const STEP_TICKS: u32 = 8;
/// Of the board's clock in a tick, so that it tells its status in each.
const TICK_MS: u32 = 20;

/// What was switched, and in which tick.
type Switched = Arc<Mutex<Vec<(u32, OutputState)>>>;

/// The simulated machine, and what its spindle and coolant are switched to.
struct Recorded<'a> {
    machine: SimulatedHardware<'a, 3>,
    now: u32,
    switched: Switched,
}

impl Encoder<3> for Recorded<'_> {
    type Error = Infallible;
    fn latch(&mut self) -> Result<[Counts; 3], Infallible> {
        self.machine.latch()
    }
}

impl Inputs<3> for Recorded<'_> {
    type Error = Infallible;
    fn read_inputs(&mut self) -> Result<MachineInputs<3>, Infallible> {
        self.machine.read_inputs()
    }
}

impl<'a> VelocityChannel<3> for Recorded<'a> {
    type Error = <SimulatedHardware<'a, 3> as VelocityChannel<3>>::Error;
    fn write(&mut self, codes: &[DacCode; 3]) -> Result<(), Self::Error> {
        self.machine.write(codes)
    }
}

impl<'a> DriveEnable<3> for Recorded<'a> {
    type Error = <SimulatedHardware<'a, 3> as DriveEnable<3>>::Error;
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Self::Error> {
        self.machine.set_enabled(enabled)
    }
}

impl IndexLatch for Recorded<'_> {
    type Error = Infallible;
    fn arm(&mut self, axis: usize) -> Result<(), Infallible> {
        self.machine.arm(axis)
    }
    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Infallible> {
        self.machine.latched(axis)
    }
}

impl Outputs for Recorded<'_> {
    fn switch(&mut self, to: &OutputState) {
        self.switched.lock().expect("one board").push((self.now, *to));
    }
}

/// A board's end of a wire: it runs some ticks whenever it is read.
struct InStep {
    ask: Channel<Vec<u8>>,
    answers: Receiver<Vec<u8>>,
    to_board: Vec<u8>,
    waiting: VecDeque<u8>,
}

impl Wire for InStep {
    fn read(&mut self, bytes: &mut [u8], _: Duration) -> io::Result<usize> {
        let gone = || io::Error::from(io::ErrorKind::BrokenPipe);
        if self.waiting.is_empty() {
            self.ask.send(std::mem::take(&mut self.to_board)).map_err(|_| gone())?;
            self.waiting.extend(self.answers.recv().map_err(|_| gone())?);
        }
        let count = bytes.len().min(self.waiting.len());
        for (byte, of_board) in bytes.iter_mut().zip(self.waiting.drain(..count)) {
            *byte = of_board;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.to_board.extend(bytes);
        Ok(())
    }
}

/// A board from power-on, with the simulated machine at its origin, until its power is cut after so many ticks.
fn board(machine: &Machine, session: u32, until: Option<u32>, switched: Switched) -> InStep {
    let (ask, asked) = channel::<Vec<u8>>();
    let (answer, answers) = channel();
    let machine = machine.clone();
    thread::spawn(move || run(&machine, (session, until), switched, &asked, &answer));
    InStep { ask, answers, to_board: Vec::new(), waiting: VecDeque::new() }
}

fn run(
    machine: &Machine,
    (session, until): (u32, Option<u32>),
    switched: Switched,
    asked: &Receiver<Vec<u8>>,
    answer: &Channel<Vec<u8>>,
) {
    const ITEMS: usize = 64;
    let board = BoardParameters {
        tick_hz: (1.0 / machine.tick_s).round() as u32,
        cycles_hz: 1_000_000,
        counts_per_s_max: u32::MAX,
        leads: Leads::NONE,
        outputs: BoardOutputs::CommandedSpeed,
    };
    let record = parameters::<3, 3>(machine);
    let started = motion_board::Machine::<f32, 3>::new(&record, &board).expect("suits");
    let header = *started.header();
    let identity = Identity {
        build: Build::THIS,
        format: FORMAT.into(),
        axes: 3,
        is_fixed_point: false,
        tick_s: header.tick_s,
        items: ITEMS as u16,
        outputs: board.outputs,
        machine: started.program.machine_checksum(),
    };
    let world = simulated(machine).expect("a machine");
    let hardware = SimulatedHardware::new(&world).expect("converters");
    let mut hardware = Recorded { machine: hardware, now: 0, switched };
    let mut flight = FlightRecorder::<f32, 3, 16, 8>::new();
    let mut streams = LiveStreams::<f32, 3, 64, 16>::new();
    let (feeder, intake) = streams.split(header.rules, header.start);
    let Ok(counts) = hardware.latch();
    let mut control = Control::new(Kernel::new(&started.axes, header.start, counts), intake, &mut flight);
    let link = BoardLink::new(session, identity);
    let mut linked = Linked::<f32, 3, ITEMS, 64, 0>::new(&board, link, feeder, header.pulse);
    let (mut frame, mut came, mut ticks) = ([0; FRAME_MAX], VecDeque::new(), 0_u32);
    while let Ok(bytes) = asked.recv() {
        came.extend(bytes);
        let mut out = Vec::new();
        for _ in 0..STEP_TICKS {
            if until == Some(ticks) {
                return;
            }
            hardware.now = ticks + 1;
            control.tick(None, None, &mut hardware);
            world.advance();
            ticks += 1;
            let mut shared = Exclusive(&mut control);
            linked.poll(&mut || came.pop_front(), &mut shared);
            loop {
                let length = linked.transmit(ticks * TICK_MS, &mut shared, &mut frame);
                if length == 0 {
                    break;
                }
                out.extend(&frame[..length]);
            }
        }
        if answer.send(out).is_err() {
            return;
        }
    }
}

/// What was told of a tick of the program.
struct Told {
    tick: u32,
    driven: u32,
    /// That the machine has followed to.
    sure: u32,
    set: [Position; 3],
    actual: [Position; 3],
}

/// Drives a job on a board that has just started, until that has no power any more or all is driven: what was told of every
/// tick of the program, and how far a journal has it for sure, if it is written now and then.
fn drive(
    machine: &Machine,
    job: &Job<3>,
    session: u32,
    until: Option<u32>,
    random: &mut Random,
) -> (Vec<Told>, u32) {
    let switched = Switched::default();
    let mut wire = Some(board(machine, session, until, Arc::clone(&switched)));
    let open = Box::new(move || match wire.take() {
        Some(wire) => Ok(Box::new(wire) as Box<dyn Wire>),
        None => Err(io::ErrorKind::BrokenPipe.into()),
    });
    let mut connection = Connection::<3>::open(open, session).expect("a board");
    let may = Permissions { enables: true, clears_fault: false, disables: false, found: Found::Stays };
    let names = Arc::new(["X", "Y", "Z"].map(str::to_owned));
    let mut sender = Sender::new(Arc::new(job.clone()), names, may);
    let mut progress = Progress::new(job.begin.path, job.header.tick_s);
    let (mut told, mut journal, period) = (Vec::new(), job.begin.path, 1 + random.below(200));
    loop {
        let mut heard = Vec::new();
        connection.step(Duration::ZERO, &mut |one| heard.push(one));
        for one in heard {
            sender.hear(&one).expect("no fault");
            match one {
                // The status of another program before this one.
                Heard::Board(Event::Status(status)) if status.aborts == connection.controls().aborts => {
                    let Some(driven) = sender.driven(&status) else { continue };
                    let sure = progress.tell(status.tick, Place { driven, line: status.line }).driven;
                    told.push(Told {
                        tick: status.tick,
                        driven,
                        sure,
                        set: status.set,
                        actual: status.actual,
                    });
                    if random.below(period) == 0 {
                        journal = sure;
                    }
                }
                Heard::Lost(_) => {
                    check_outputs(job, &told, &switched, false);
                    return (told, journal);
                }
                _ => {}
            }
        }
        if sender.advance(&mut connection).expect("no fault") == Step::Done {
            check_outputs(job, &told, &switched, true);
            return (told, journal);
        }
    }
}

/// Spindle and coolant of a job that begins in the middle are on before anything moves, the way to its path too, and stay so
/// up to the program's end.
fn check_outputs(job: &Job<3>, told: &[Told], switched: &Switched, is_whole: bool) {
    let switched = switched.lock().expect("one board");
    let (Some(Item::Switch(on)), Some(first)) = (job.begin.lead.first(), told.first()) else { return };
    let moves = told.iter().find(|told| told.set != first.set).map(|told| told.tick);
    let last = told.windows(2).rev().find(|two| two[0].set != two[1].set).map(|two| two[1].tick);
    let (Some(moves), Some(last)) = (moves, last) else { return };
    assert!(switched.first().is_some_and(|&(tick, to)| tick < moves && to == *on), "{switched:?} {moves}");
    let off = switched.iter().find(|(_, to)| *to != *on);
    assert!(off.is_none_or(|&(tick, _)| is_whole && tick >= last), "{switched:?} {last}");
    assert!(!is_whole || off.is_some());
}

/// The path of a whole job.
struct Path {
    /// Pieces, and where each begins on the path [mm]; ends of stretches are none.
    items: Vec<(Option<Piece<f64, 3>>, f64)>,
    length_mm: f64,
}

impl Path {
    fn of(job: &Job<3>) -> Self {
        let (mut items, mut at_mm) = (Vec::new(), 0.0);
        for item in &job.items {
            let piece = match *item {
                Item::Line { line, start, direction, length } => {
                    Piece::line(line, start, direction, length).map(Some).expect("a piece")
                }
                Item::Septic { line, start, coefficients, length } => {
                    Piece::septic(line, start, coefficients, length).map(Some).expect("a piece")
                }
                Item::EndOfStretch(_) => None,
                _ => continue,
            };
            items.push((piece, at_mm));
            at_mm += piece.map_or(0.0, |piece| piece.length().to_mm());
        }
        Self { items, length_mm: at_mm }
    }

    /// The place on a piece that is nearest to a point, from the path's start, and how far it is from there [mm].
    fn nearest(&self, item: usize, point: &[Position; 3]) -> Option<(f64, f64)> {
        let &(piece, begin_mm) = self.items.get(item)?;
        let piece = piece?;
        let (zero, length_mm) = (0.0, piece.length().to_mm());
        let rest =
            PathMotion { s: Position::ZERO, v_mm_s: zero, a_mm_s2: zero, j_mm_s3: zero, snap_mm_s4: zero };
        let distance_mm = |s_mm: f64| {
            let at = piece.at(s_mm, &rest);
            let squares = at.iter().zip(point).map(|(at, &point)| (at.position - point).to_mm().powi(2));
            squares.sum::<f64>().sqrt()
        };
        // A piece turns by 45° at most: the distance has one minimum.
        let (mut low_mm, mut high_mm) = (0.0, length_mm);
        for _ in 0..80 {
            let (left_mm, right_mm) = (low_mm + (high_mm - low_mm) / 3.0, high_mm - (high_mm - low_mm) / 3.0);
            if distance_mm(left_mm) <= distance_mm(right_mm) { high_mm = right_mm } else { low_mm = left_mm }
        }
        let s_mm = 0.5 * (low_mm + high_mm);
        Some((begin_mm + s_mm, distance_mm(s_mm)))
    }

    /// The place of a point on the path from the item at `first` on, up to `last`: the first one that is as near as `near_mm`.
    fn place(&self, first: usize, last: usize, point: &[Position; 3], near_mm: f64) -> Option<(usize, f64)> {
        (first..=last).find_map(|item| {
            let (s_mm, distance_mm) = self.nearest(item, point)?;
            (distance_mm < near_mm).then_some((item, s_mm))
        })
    }
}

/// Rounding of set positions in f32, and of the search.
const NEAR_MM: f64 = 1e-5;
/// The most that a tick covers, with the reference machine's greatest feed \[mm\].
const STEP_MM: f64 = 0.1;

/// From where to where on the path the ticks of a run are: each on the piece that is told or behind it, none farther than a
/// tick from the one before.
fn covered(path: &Path, told: &[Told], begin: usize) -> [f64; 2] {
    let start_mm = path.items[begin].1;
    let (mut item, mut at_mm, mut before) = (begin, start_mm, begin as u32);
    for (tick, told) in told.iter().enumerate() {
        // On the way to its start.
        let Some((on, s_mm)) = path.place(item, told.driven as usize, &told.set, NEAR_MM) else {
            assert!(item == begin && at_mm == start_mm, "tick {tick}: off the path behind {at_mm} mm");
            continue;
        };
        assert!(s_mm >= at_mm - NEAR_MM && s_mm - at_mm < STEP_MM, "tick {tick}: {at_mm} mm to {s_mm} mm");
        (item, at_mm) = (on, s_mm);
        let is_new = tick > 0 && told.sure != before;
        if is_new && told.sure > begin as u32 {
            // A journal that is written now leaves nothing out that the machine has not come to.
            let nearest = (told.sure.saturating_sub(3)..=told.driven)
                .filter_map(|item| path.nearest(item as usize, &told.actual))
                .min_by(|one, other| one.1.total_cmp(&other.1));
            let (actual_mm, _) = nearest.expect("a piece");
            let goes_on_mm = path.items.get(told.sure as usize).map_or(path.length_mm, |(_, at_mm)| *at_mm);
            assert!(
                goes_on_mm < actual_mm + 1e-3,
                "tick {tick}: {goes_on_mm} mm, the machine is at {actual_mm} mm"
            );
        }
        before = told.sure;
    }
    [start_mm, at_mm]
}

fn job(text: &str, machine: &Machine) -> Job<3> {
    let plan = planned(text, machine).expect("a plan");
    Job::new(machine, &Executable::new::<f32>(&plan).expect("executable").items)
}

/// A machine whose axes lag behind: without feedforward.
fn lagging() -> Machine {
    let mut machine = Machine::reference();
    for axis in &mut machine.axes {
        axis.feedforward = Feedforward { velocity: 0.0, ..axis.feedforward };
    }
    machine
}

/// Corners, blends, arcs, dwells and full stops.
fn program() -> String {
    let lines: String = (1..=30)
        .map(|line| match line % 10 {
            4 => "G91 G2 X1 Y-1 I1 J0\nG90\n".to_owned(),
            7 => "G4 P0.02\n".to_owned(),
            _ => format!("G1 X{} Y{} F3000\n", f64::from(line) * 1.3, 2 * (line % 2)),
        })
        .collect();
    format!("G21 G90 G64 P0.05\nG1 X0 Y1 F3000\n{lines}M2\n")
}

/// The power of the board is cut at any tick, and the program is gone on with, by what a journal says; some twice.
#[test]
fn after_a_power_cut_the_whole_path_is_driven() {
    let machine = lagging();
    power_cuts(&machine, &program());
    let spindle = SpindleSettings { speed_max_rpm: 9000.0, start_s: 0.1, stop_s: 0.0, reverses: false };
    let coolant = CoolantSettings { flood: true, mist: false };
    let machine = Machine { spindle: Some(spindle), coolant: Some(coolant), ..machine };
    power_cuts(&machine, &format!("M3 S6000\nM8\n{}", program()));
}

fn power_cuts(machine: &Machine, text: &str) {
    let whole = job(text, machine);
    let path = Path::of(&whole);
    let end = whole.items.iter().rev().find_map(|item| match item {
        Item::EndOfStretch(end) => Some(*end),
        _ => None,
    });
    let mut random = Random::new(1);
    let (told, _) = drive(machine, &whole, 1, None, &mut random);
    let ticks = told.len() as u64;
    let [from_mm, to_mm] = covered(&path, &told, 0);
    assert!(from_mm == 0.0 && (to_mm - path.length_mm).abs() < NEAR_MM, "{to_mm}");
    println!("{} items, {} on the path, {ticks} ticks", whole.items.len(), path.items.len());
    let (mut repeated_mm, mut in_the_middle) = (0.0_f64, 0);
    for seed in 1..=CUTS {
        let mut random = Random::new(seed);
        let (mut job, mut session, mut driven_mm, mut cuts) = (whole.clone(), 100 * seed as u32, 0.0, 0);
        loop {
            session += 1;
            // Before the program begins, too, and behind its end.
            let until = (cuts < 1 + seed % 2).then(|| 200 + random.below(ticks as usize * 11 / 10) as u32);
            let begin = job.begin.path as usize;
            let (told, journal) = drive(machine, &job, session, until, &mut random);
            let [from_mm, to_mm] = covered(&path, &told, begin);
            // Nothing is left out between two runs.
            assert!(from_mm <= driven_mm, "seed {seed}: from {driven_mm} mm to {from_mm} mm");
            if until.is_none() {
                assert!((to_mm - path.length_mm).abs() < NEAR_MM, "seed {seed}: ends at {to_mm} mm");
                assert_eq!(told.last().map(|told| told.set), end, "seed {seed}");
                break;
            }
            cuts += 1;
            driven_mm = f64::max(from_mm, to_mm);
            let item = whole.item_behind(journal);
            job = whole.from_item::<f32>(item).unwrap_or_else(|(line, problem)| panic!("{line}: {problem}"));
            let next_mm = path.items.get(job.begin.path as usize).map_or(path.length_mm, |(_, at_mm)| *at_mm);
            repeated_mm = repeated_mm.max(driven_mm - next_mm);
            in_the_middle += u32::from(next_mm > 0.0 && next_mm < path.length_mm);
        }
    }
    println!("at most {repeated_mm:.3} mm come again; {in_the_middle} begun in the middle");
    assert!(in_the_middle > CUTS as u32 / 2, "{in_the_middle}");
}
