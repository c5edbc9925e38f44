//! Programs on the simulated board, over wires that break: everything is driven once and to its end, whatever becomes of the
//! wire and of who sends.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hal_sim::{HomeParameters, IndexParameters, SwitchParameters};
use motion_host::board::home::OnBoardHoming;
use motion_host::board::items::{InPlanning, Source};
use motion_host::board::job::parameters;
use motion_host::board::jog::Jogs;
use motion_host::board::parameters::{Difference, Figures, read, write};
use motion_host::board::scope::Ticks;
use motion_host::board::sender::{Found, Permissions};
use motion_host::board::simulator::{self, SimulatedBoard};
use motion_host::board::{BoardError, Connection, Heard, Job, Port, Scope, Sender, Step};
use motion_host::gcode::ReadOptions;
use motion_host::machine::{HomingSettings, Machine};
use motion_host::planning::Executable;
use motion_host::simulate::home::{HomedAxis, Homes};
use motion_host::simulate::jog::{Ended, Keys, Press};
use motion_kernel::axis::{AxisCompensation, Backlash, PitchError};
use motion_kernel::homing::{Homed, HomingConfig};
use motion_kernel::jog::Direction;
use motion_kernel::link::{HomingFailure, HomingProgress, State, WriteError};
use motion_kernel::program::Item;
use motion_kernel::units::{Counts, Position};
use motion_tests::check::planned;

/// So many times as fast as the wall clock.
const PACE: f64 = 20.0;
/// Against a test that hangs; nothing is compared with it.
pub(crate) const LONGEST: Duration = Duration::from_secs(300);

/// Zigzag of straight lines, blended, so that all of it is one stretch: several times the items that a board has room for.
fn zigzag(lines: u32) -> String {
    let lines: String =
        (1..=lines).map(|line| format!("G1 X{} Y{} F3000\n", f64::from(line) * 0.7, line % 2)).collect();
    format!("G21 G90 G64 P0.05\n{lines}M2\n")
}

fn job(text: &str, machine: &Machine) -> Job<3> {
    let plan = planned(text, machine).expect("a plan");
    Job::new(machine, &Executable::new::<f32>(&plan).expect("executable").items)
}

/// Where a job ends.
fn end(job: &Job<3>) -> [Position; 3] {
    let end = job.items.iter().rev().find_map(|item| match item {
        Item::EndOfStretch(end) => Some(*end),
        _ => None,
    });
    end.expect("a stretch")
}

fn board(machine: &Machine, session: u32) -> (SimulatedBoard, SocketAddr) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound");
    (simulator::listen(machine, session, listener, PACE).expect("a board"), address)
}

fn connect(address: SocketAddr, asker: u32) -> Connection<3> {
    let port: Port = format!("tcp:{address}").parse().expect("an address");
    Connection::open(Box::new(move || port.open(0)), asker).expect("a board")
}

const ENABLES: Permissions =
    Permissions { enables: true, clears_fault: false, disables: false, found: Found::Stays };

/// Names of the axes.
fn axes() -> Arc<[String]> {
    Arc::new(["X", "Y", "Z"].map(str::to_owned))
}

/// Drives a job to its end; `each` is called after every step of the connection.
fn drive(
    job: &Job<3>,
    may: Permissions,
    connection: &mut Connection<3>,
    each: impl FnMut(&mut Connection<3>, &mut Sender<3>, &[Heard<3>]) -> bool,
) -> Result<Step, BoardError> {
    drive_sender(Sender::new(Arc::new(job.clone()), axes(), may), connection, each)
}

fn drive_sender(
    mut sender: Sender<3>,
    connection: &mut Connection<3>,
    mut each: impl FnMut(&mut Connection<3>, &mut Sender<3>, &[Heard<3>]) -> bool,
) -> Result<Step, BoardError> {
    let begin = Instant::now();
    loop {
        assert!(begin.elapsed() < LONGEST, "it hangs: {:?} {:?}", sender.step(), connection.status());
        let mut heard = Vec::new();
        connection.step(Duration::from_millis(1), &mut |one| heard.push(one));
        for one in &heard {
            sender.hear(one)?;
        }
        let is_over = each(connection, &mut sender, &heard);
        let step = sender.advance(connection)?;
        if is_over || matches!(step, Step::Done | Step::Aborted) {
            return Ok(step);
        }
    }
}

/// Where the machine stands, as told last.
fn stands(connection: &Connection<3>) -> [Position; 3] {
    connection.status().expect("told").set
}

#[test]
fn a_job_is_driven_and_again() {
    let machine = Machine::reference();
    let job = job(&zigzag(120), &machine);
    assert!(job.items.len() > 400, "{}", job.items.len());
    let (_board, address) = board(&machine, 1);
    let mut connection = connect(address, 1);
    for _ in 0..2 {
        assert_eq!(drive(&job, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
        assert_eq!(stands(&connection), end(&job));
        assert_eq!(connection.status().map(|status| status.starvations), Some(0));
    }
}

/// A wire between, which can be cut.
struct Cable {
    address: SocketAddr,
    is_cut: Arc<AtomicBool>,
}

impl Cable {
    fn to(board: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let (address, is_cut) = (listener.local_addr().expect("bound"), Arc::new(AtomicBool::new(false)));
        let cut = Arc::clone(&is_cut);
        thread::spawn(move || {
            for near in listener.incoming().flatten() {
                // As an address where nobody is.
                if cut.load(Ordering::Relaxed) {
                    continue;
                }
                let far = TcpStream::connect(board).expect("a board");
                for (from, to) in [(&near, &far), (&far, &near)] {
                    let (from, to) = (from.try_clone().expect("a socket"), to.try_clone().expect("a socket"));
                    let cut = Arc::clone(&cut);
                    thread::spawn(move || forward(from, to, &cut));
                }
            }
        });
        Self { address, is_cut }
    }

    fn cut(&self, is_cut: bool) {
        self.is_cut.store(is_cut, Ordering::Relaxed);
    }
}

/// Until one end is closed, or the cable is cut: in the middle of what is under way.
fn forward(mut from: TcpStream, mut to: TcpStream, cut: &AtomicBool) {
    let mut bytes = [0; 64];
    let _ = from.set_read_timeout(Some(Duration::from_millis(5)));
    loop {
        let read = from.read(&mut bytes);
        if cut.load(Ordering::Relaxed) {
            break;
        }
        let is_passed = match read {
            Ok(0) => false,
            Ok(count) => to.write_all(&bytes[..count]).is_ok(),
            Err(error) => matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut),
        };
        if !is_passed {
            break;
        }
    }
    let _ = from.shutdown(std::net::Shutdown::Both);
    let _ = to.shutdown(std::net::Shutdown::Both);
}

/// The cable is cut and plugged in again, several times in a program: motion comes to rest, the board is held when it is back,
/// and goes on after the operator's resume, with no item twice.
#[test]
fn a_cable_that_was_cut_is_a_hold() {
    let machine = Machine::reference();
    let job = job(&zigzag(600), &machine);
    let (_board, address) = board(&machine, 2);
    let cable = Cable::to(address);
    let mut connection = connect(cable.address, 2);
    let (mut cuts, mut since, mut backs) = (0, None::<Instant>, 0);
    let mut rests: Vec<[Position; 3]> = Vec::new();
    let step = drive(&job, ENABLES, &mut connection, |connection, sender, heard| {
        let taken = connection.status().map_or(0, |status| status.taken);
        // Not before it has gone on: the board may have had that many for long.
        let has_moved = connection.status().is_some_and(|status| rests.last() != Some(&status.set));
        if sender.step() == Step::Drives
            && since.is_none()
            && cuts < 4
            && taken > 100 * (cuts + 1)
            && has_moved
        {
            cable.cut(true);
            (cuts, since) = (cuts + 1, Some(Instant::now()));
        }
        // Longer than the board has items for.
        if since.is_some_and(|since| since.elapsed() > Duration::from_secs(1)) {
            cable.cut(false);
        }
        backs += heard.iter().filter(|one| **one == Heard::Back).count() as u32;
        let state = connection.status().map(|status| status.state);
        if since.is_some() && !connection.is_lost() && backs == cuts && state == Some(State::Held) {
            rests.push(stands(connection));
            since = None;
            assert!(sender.resume(connection));
        }
        false
    });
    assert_eq!((step.expect("driven"), cuts, backs), (Step::Done, 4, 4));
    assert!(rests.windows(2).all(|pair| pair[0] != pair[1]) && !rests.contains(&end(&job)), "{rests:?}");
    assert_eq!(stands(&connection), end(&job));
}

/// Who sends is gone in the middle, as by a kill: another one finds the program on the board, and goes on after it.
#[test]
fn another_sender_goes_on() {
    let machine = Machine::reference();
    let (job, other) = (job(&zigzag(150), &machine), job(&zigzag(20), &machine));
    let (_board, address) = board(&machine, 3);
    let mut gone_at = 0;
    let mut connection = connect(address, 3);
    drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        gone_at = connection.next().unwrap_or(gone_at);
        sender.step() == Step::Drives && gone_at > 300
    })
    .expect("no fault");
    drop(connection);
    // Whose it is not.
    let refused = drive(&other, ENABLES, &mut connect(address, 4), |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::Busy)), "{refused:?}");
    let continued = Permissions { found: Found::Continued, ..ENABLES };
    let refused = drive(&other, continued, &mut connect(address, 5), |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::NotBegun)), "{refused:?}");
    // Who does not say what is to become of it.
    let refused = drive(&job, ENABLES, &mut connect(address, 6), |_, _, _| false);
    let of = job.items.len() as u32 + 1;
    let is_begun = matches!(refused, Err(BoardError::Begun { has, of: all }) if all == Some(of) && (1..of).contains(&has));
    assert!(is_begun, "{refused:?}");
    let mut connection = connect(address, 7);
    let mut first = None;
    let step = drive(&job, continued, &mut connection, |connection, sender, _| {
        if sender.step() == Step::Greets {
            first = connection.next().or(first);
        }
        assert_ne!(sender.step(), Step::ToStart, "not from the start");
        false
    });
    assert_eq!(step.expect("driven"), Step::Done);
    assert!(first.is_some_and(|first| (1..=gone_at).contains(&first)), "{first:?} {gone_at}");
    assert_eq!(stands(&connection), end(&job));
}

/// All of a program is on the board, held, when its sender is killed: the next one sends nothing, and sees it to its end.
#[test]
fn a_program_that_is_whole_on_the_board_is_gone_on_with() {
    let machine = Machine::reference();
    let job = job("G21 G90 G61\nG1 X40 F600\nM2\n", &machine);
    let (_board, address) = board(&machine, 22);
    let mut connection = connect(address, 1);
    drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        let has_all = connection.next() == Some(job.items.len() as u32 + 1) && connection.has_all();
        if sender.step() == Step::Drives && has_all {
            sender.hold(connection);
        }
        sender.step() == Step::Drives && connection.status().is_some_and(|status| status.state == State::Held)
    })
    .expect("no fault");
    drop(connection);
    let mut connection = connect(address, 2);
    let continued = Permissions { found: Found::Continued, ..ENABLES };
    assert_eq!(drive(&job, continued, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    assert_eq!(stands(&connection), end(&job));
}

/// A program that is read and planned while it is driven: given up in the middle, gone on with by another sender; and one
/// with a line at fault, which ends at rest before that line.
#[test]
fn a_program_is_planned_while_it_is_driven() {
    let machine = Machine::reference();
    let text = zigzag(300);
    let whole = job(&text, &machine);
    let (_board, address) = board(&machine, 21);
    let job = Arc::new(Job::<3>::in_planning(&machine, 7));
    let planned = |text: &str| {
        let source = Source {
            name: "part.ngc".to_owned(),
            text: text.as_bytes().to_vec(),
            options: ReadOptions::default(),
            leaves_out_outputs: false,
        };
        InPlanning::begin::<f32, 3>(source, &machine)
    };
    let mut connection = connect(address, 1);
    let sender = Sender::planned(Arc::clone(&job), planned(&text), axes(), ENABLES);
    let given_up = drive_sender(sender, &mut connection, |connection, sender, _| {
        sender.step() == Step::Drives && connection.next().is_some_and(|next| next > 300)
    });
    given_up.expect("no fault");
    drop(connection);
    let mut connection = connect(address, 2);
    let continued = Permissions { found: Found::Continued, ..ENABLES };
    let sender = Sender::planned(Arc::clone(&job), planned(&text), axes(), continued);
    assert_eq!(drive_sender(sender, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    assert_eq!(stands(&connection), end(&whole));
    // Each item once, and the end.
    let taken = connection.status().map(|status| status.taken);
    assert_eq!(taken, Some(whole.items.len() as u32 + 1));

    // In the middle of a stretch, by a move that the machine can't make: at rest before it.
    let mut narrow = machine.clone();
    narrow.axes[0].travel_mm = Some([-1.0, 100.0]);
    let source = Source {
        name: "part.ngc".to_owned(),
        text: b"G21 G90 G64 P0.05\nG1 X1 F3000\nX2 Y1\nX200\nX300\nM2\n".to_vec(),
        options: ReadOptions::default(),
        leaves_out_outputs: false,
    };
    let beyond = InPlanning::begin::<f32, 3>(source, &narrow);
    let refused = drive_sender(
        Sender::planned(Arc::clone(&job), beyond, axes(), ENABLES),
        &mut connection,
        |_, _, _| false,
    );
    let Err(BoardError::Program(error)) = refused else { panic!("{refused:?}") };
    assert!(error.to_string().starts_with("part.ngc:4:"), "{error}");
    assert_eq!(stands(&connection).map(Position::to_mm), [2.0, 1.0, 0.0]);
    assert_eq!(connection.status().map(|status| status.state), Some(State::Idle));

    let wrong = text.replace("M2", "G1 X0 Y0\nG1 X5 Q");
    let sender = Sender::planned(Arc::clone(&job), planned(&wrong), axes(), ENABLES);
    let refused = drive_sender(sender, &mut connection, |_, _, _| false);
    let Err(BoardError::Program(error)) = refused else { panic!("{refused:?}") };
    assert!(error.to_string().starts_with("part.ngc:303:"), "{error}");
    assert_eq!(stands(&connection), [Position::ZERO; 3]);
    assert_eq!(connection.status().map(|status| status.state), Some(State::Idle));
}

/// A board that was reset knows nothing; the sender says where its program was.
#[test]
fn a_reset_is_told_with_the_line() {
    let machine = Machine::reference();
    let job = job(&zigzag(150), &machine);
    let (first, address) = board(&machine, 8);
    let cable_to = |board| Cable::to(board);
    let mut first = Some(first);
    let cable = cable_to(address);
    let mut connection = connect(cable.address, 8);
    let mut second = None;
    let refused = drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        if sender.step() == Step::Drives
            && connection.next().is_some_and(|next| next > 300)
            && second.is_none()
        {
            drop(first.take());
            // The cable leads to where the first one was.
            let listener = TcpListener::bind(address).expect("the same port");
            second = Some(simulator::listen(&machine, 9, listener, PACE).expect("a board"));
        }
        false
    });
    let Err(BoardError::Reset { confirmed, at }) = refused else { panic!("{refused:?}") };
    assert!((1..job.items.len() as u32).contains(&confirmed), "{confirmed}");
    let line = job.line_of(confirmed).expect("a line");
    assert_eq!(at, format!(", at line {line} of the program"));
}

#[test]
fn a_board_with_another_machine_is_refused() {
    let machine = Machine::reference();
    let job = job(&zigzag(3), &machine);
    let mut other = Machine::reference();
    other.axes[1].gains.kp_per_s *= 1.5;
    let (_board, address) = board(&other, 10);
    let refused = drive(&job, ENABLES, &mut connect(address, 10), |_, _, _| false);
    let Err(BoardError::Disagrees { found, expected, .. }) = refused else { panic!("{refused:?}") };
    assert_eq!(expected, format!("{:08x}", job.machine));
    assert_ne!(found, expected);
}

/// Off without the permission, on with it; the emergency stop is a fault until it is closed and cleared.
#[test]
fn drives_and_faults() {
    let machine = Machine::reference();
    let job = job(&zigzag(60), &machine);
    let (board, address) = board(&machine, 11);
    let mut connection = connect(address, 11);
    let refused = drive(&job, Permissions::default(), &mut connection, |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::Off)), "{refused:?}");
    let refused = drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        board.set_emergency_stop(
            sender.step() == Step::Drives && connection.next().is_some_and(|next| next > 150),
        );
        false
    });
    let Err(BoardError::Fault { told, .. }) = refused else { panic!("{refused:?}") };
    assert_eq!(told, "emergency stop: the emergency stop is open; to clear it: closing it");
    // Without the permission to clear it, and while it is open.
    board.set_emergency_stop(true);
    let refused = drive(&job, ENABLES, &mut connection, |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::Fault { .. })), "{refused:?}");
    board.set_emergency_stop(false);
    // Where the drives were off nothing is gone on with, and what is left of a program is not dropped unasked.
    let clears = Permissions { clears_fault: true, ..ENABLES };
    let refused = drive(&job, clears, &mut connection, |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::Begun { .. })), "{refused:?}");
    let continued = Permissions { found: Found::Continued, ..clears };
    let refused = drive(&job, continued, &mut connection, |_, _, _| false);
    assert!(matches!(refused, Err(BoardError::Interrupted { .. })), "{refused:?}");
    let clears = Permissions { found: Found::GivenUp, disables: true, ..clears };
    assert_eq!(drive(&job, clears, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    // Off, it stands where the encoders say.
    assert_eq!(connection.status().map(|status| status.state), Some(State::Off));
    let off_mm = stands(&connection).into_iter().zip(end(&job)).map(|(at, end)| (at - end).to_mm().abs());
    assert!(off_mm.fold(0.0, f64::max) < 2e-3);
}

/// Held before anything moves: nothing starts, on the way or after it, until the operator resumes.
#[test]
fn a_hold_before_the_start_is_kept() {
    let machine = Machine::reference();
    let job = job(&zigzag(20), &machine);
    let (_board, address) = board(&machine, 13);
    let mut connection = connect(address, 13);
    let (mut looks, mut is_resumed) = (0, false);
    let step = drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        if looks == 0 {
            sender.hold(connection);
        }
        looks += 1;
        let moved = connection.status().is_some_and(|status| status.set != job.header.start);
        assert!(is_resumed || !moved);
        if sender.step() == Step::Drives && looks > 400 && !is_resumed {
            is_resumed = sender.resume(connection);
        }
        false
    });
    assert_eq!((step.expect("driven"), is_resumed), (Step::Done, true));
    assert_eq!(stands(&connection), end(&job));
}

#[test]
fn an_abort_ends_at_rest_on_the_way() {
    let machine = Machine::reference();
    let job = job(&zigzag(150), &machine);
    let (_board, address) = board(&machine, 12);
    let mut connection = connect(address, 12);
    let mut is_aborted = false;
    let step = drive(&job, ENABLES, &mut connection, |connection, sender, _| {
        if !is_aborted && sender.step() == Step::Drives && connection.next().is_some_and(|next| next > 300) {
            is_aborted = true;
            sender.abort(connection);
        }
        false
    });
    assert_eq!(step.expect("no fault"), Step::Aborted);
    assert_ne!(stands(&connection), end(&job));
    assert_eq!(drive(&job, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    assert_eq!(stands(&connection), end(&job));
}

/// A board is given another machine while its drives are off, and drives a program for that one then; what differs is named.
#[test]
fn a_board_gets_other_parameters() {
    let machine = Machine::reference();
    let mut other = Machine::reference();
    other.axes[1].gains.kp_per_s *= 1.5;
    let (first, second) = (parameters::<3, 3>(&machine), parameters::<3, 3>(&other));
    println!("{} bytes for three axes", first.len());
    let (_board, address) = board(&machine, 20);
    let mut connection = connect(address, 20);
    let figures = |record: &[u8]| Figures::of::<3>(record).expect("a record");
    let read = |connection: &mut Connection<3>| read(connection).expect("an answer");
    // Before the greeting nothing is asked.
    assert_eq!(read(&mut connection), first);
    let differences = figures(&first).differences(&figures(&second));
    let names: Vec<&str> = differences.iter().map(|difference| difference.name.as_str()).collect();
    // Guards follow from the gain.
    assert!(names.first() == Some(&"axes[1].gains.kp_per_s"), "{names:?}");
    assert!(names.len() < 6 && names.iter().all(|name| name.starts_with("axes[1].")), "{names:?}");
    // Nothing that is damaged, or for another tick.
    let mut damaged = second.clone();
    damaged[100] ^= 1;
    let slow = parameters::<3, 3>(&Machine { tick_s: 0.001, ..Machine::reference() });
    for bad in [damaged, slow, vec![1; 5000]] {
        let refused = write(&mut connection, &bad);
        let is_refused = match bad.len() {
            5000 => matches!(refused, Err(BoardError::Parameters(WriteError::Length { room: 4096 }))),
            _ => matches!(refused, Err(BoardError::Parameters(WriteError::Unsuitable))),
        };
        assert!(is_refused, "{refused:?}");
    }
    assert_eq!(read(&mut connection), first);
    write(&mut connection, &second).expect("suits");
    assert_eq!(read(&mut connection), second);
    let job = job(&zigzag(20), &other);
    // There is one wire.
    drop(connection);
    let mut connection = connect(address, 21);
    assert_eq!(drive(&job, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    // The drives are on now.
    let refused = write(&mut connection, &first);
    assert!(matches!(refused, Err(BoardError::Parameters(WriteError::DrivesOn))), "{refused:?}");
    assert_eq!(drive(&job, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
}

/// Keys on a board: one goes its way, one is released; where the cable is out, the board comes to rest by itself, and the next
/// key begins there.
#[test]
fn a_jog_ends_by_itself_by_its_release_or_by_the_dead_man() {
    /// Of the board's time; ten times the pauses of a slow computer.
    const DEAD_MAN_MS: u16 = 5000;
    const FEED_MM_S: f64 = 20.0;
    let machine = Machine::reference();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound");
    let _board = simulator::listen(&machine, 30, listener, 5.0).expect("a board");
    let presses = ["Y+3", "X+400@2000", "X+400", "X-1"].map(|press| press.parse::<Press>().expect("a press"));
    let keys = Keys::new(&machine, &presses, Some(FEED_MM_S)).expect("keys");
    let job = Arc::new(Job::<3>::new(&machine, &[]));
    let jogs = Jogs { keys: &keys, job, axes: axes(), may: ENABLES, dead_man_ms: DEAD_MAN_MS };
    let cable = Cable::to(address);
    let mut connection = connect(cable.address, 30);
    let first = jogs.press(0, &mut connection, &mut || false).expect("a jog");
    assert_eq!((first.from_mm, first.to_mm, first.ended), (0.0, 3.0, Ended::Distance));
    assert!(first.feed_mm_s > 0.5 * FEED_MM_S && first.feed_mm_s < FEED_MM_S + 1e-3, "{first:?}");
    assert_eq!(connection.controls().dead_man_ms, 0);
    let second = jogs.press(1, &mut connection, &mut || false).expect("a jog");
    assert!(matches!(second.ended, Ended::Released { .. }), "{second:?}");
    assert!(second.to_mm > 5.0 && second.to_mm < 100.0, "{second:?}");
    // By the operator.
    let begin = Instant::now();
    let released = jogs.press(2, &mut connection, &mut || begin.elapsed() > Duration::from_millis(500));
    let released = released.expect("a jog");
    assert!(released.from_mm == second.to_mm && released.to_mm < 400.0 + second.to_mm, "{released:?}");
    // The cable is out.
    let begin = Instant::now();
    let lost = jogs.press(2, &mut connection, &mut || {
        cable.cut(begin.elapsed() > Duration::from_millis(500));
        false
    });
    assert!(matches!(lost, Err(BoardError::Wire(_))), "{lost:?}");
    let cut_mm = stands_mm(&connection);
    drop(connection);
    thread::sleep(Duration::from_millis(2000));
    cable.cut(false);
    let mut connection = connect(cable.address, 31);
    let begin = Instant::now();
    let is_held =
        |connection: &Connection<3>| connection.status().is_some_and(|status| status.state == State::Held);
    while !is_held(&connection) {
        assert!(begin.elapsed() < LONGEST, "{:?}", connection.status());
        connection.step(Duration::from_millis(1), &mut |_| {});
    }
    let rest_mm = stands_mm(&connection);
    // What was told last may be 0.1 s old, and a stop is shorter than 5 mm.
    let most_mm = FEED_MM_S * (f64::from(DEAD_MAN_MS) * 1e-3 + 1.0) + 5.0;
    assert!(rest_mm > cut_mm && rest_mm < cut_mm + most_mm, "{cut_mm} {rest_mm}");
    let back = jogs.press(3, &mut connection, &mut || false).expect("a jog");
    assert!(back.from_mm == rest_mm && (back.to_mm - rest_mm + 1.0).abs() < 1e-9, "{back:?}");
}

/// The reference machine, with a home switch at X and one with an index at Y.
fn homed_machine() -> Machine {
    let mut machine = Machine::reference();
    let mm = |mm| Position::from_mm(mm).expect("in range");
    for (axis, (direction, index_mm)) in
        [(Direction::Negative, None), (Direction::Positive, Some(11.0))].into_iter().enumerate()
    {
        let config = HomingConfig {
            direction,
            fast_mm_s: 40.0,
            slow_mm_s: 2.0,
            travel_mm: 100.0,
            back_off_mm: 60.0,
            index_mm,
            position: mm(-7.0),
            park: Some(mm(1.5)),
        };
        let closes_mm = if axis == 0 { (-60.0, -23.456) } else { (31.5, 70.0) };
        let simulated = HomeParameters {
            switch: Some(SwitchParameters { closes_mm, hysteresis_mm: 0.2 }),
            index: index_mm.map(|_| IndexParameters { counts: 100_000, at: Counts(345_678) }),
        };
        machine.axes[axis].homing = Some(HomingSettings { config, simulated });
    }
    machine
}

/// On a board the references are those of the simulated machine without one, to the count. A program and a jog follow; what
/// ends homing early ends it at rest.
#[test]
fn a_board_homes_as_the_simulated_machine_does() {
    let machine = homed_machine();
    let mut expected = Vec::new();
    Homes::new(&machine, &[]).expect("two axes").home(&mut expected, &mut |_| {}).expect("homed");
    let (_board, address) = board(&machine, 50);
    let cable = Cable::to(address);
    let mut connection = connect(cable.address, 50);
    let job = Arc::new(Job::<3>::new(&machine, &[]));
    let homing = OnBoardHoming { machine: &machine, job, may: ENABLES, dead_man_ms: 60_000 };
    let all = Homes::new(&machine, &[]).expect("two axes").mask();
    let mut found = Vec::new();
    let given_up = homing.home(all, &mut connection, &mut found, &mut || false, &mut |_, _| {});
    assert!(!given_up.expect("homed"));
    assert_eq!(connection.controls().dead_man_ms, 0);
    let references = |found: &[HomedAxis]| -> Vec<(String, Homed)> {
        found.iter().map(|axis| (axis.name.clone(), axis.homed)).collect()
    };
    assert_eq!(references(&found), references(&expected));
    assert_eq!(found[1].homed.counts, Counts(345_678));
    let homed =
        |connection: &Connection<3>| connection.status().expect("told").homed.map(|homed| homed.is_some());
    assert_eq!(homed(&connection), [true, true, false]);
    let park = Position::from_mm(1.5).expect("in range");
    assert_eq!(stands(&connection), [park, park, Position::ZERO]);
    // Given up in the search, by name; Y stays homed.
    let mut stages = 0;
    let given_up = std::cell::Cell::new(false);
    let mut found = Vec::new();
    let ended = homing.home(1, &mut connection, &mut found, &mut || given_up.get(), &mut |axis, _| {
        assert_eq!(axis, "X");
        stages += 1;
        given_up.set(true);
    });
    assert!(ended.expect("given up") && found.is_empty() && stages == 1);
    let told = connection.status().expect("told").homing;
    assert_eq!(told, HomingProgress::Failed { axis: 0, failure: HomingFailure::Aborted });
    assert_eq!(homed(&connection), [false, true, false]);
    let program = self::job(&zigzag(5), &machine);
    assert_eq!(drive(&program, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    assert_eq!(stands(&connection), end(&program));
    // An axis without settings.
    let ended = homing.home(0b100, &mut connection, &mut found, &mut || false, &mut |_, _| {});
    let is_it = matches!(&ended, Err(BoardError::NotHomed { axis, failure: HomingFailure::NoSettings }) if axis == "Z");
    assert!(is_it, "{ended:?}");
}

/// The flight recorder of a board: empty before a fault, all of its ticks after it.
#[test]
fn a_boards_flight_recorder_is_read() {
    let machine = Machine::reference();
    let (board, address) = board(&machine, 52);
    let mut connection = connect(address, 52);
    let nothing = motion_host::board::flight::read(&mut connection).expect("an answer");
    assert!(nothing.is_empty());
    board.set_emergency_stop(true);
    let begin = Instant::now();
    let rows = loop {
        let rows = motion_host::board::flight::read(&mut connection).expect("an answer");
        if !rows.is_empty() {
            break rows;
        }
        assert!(begin.elapsed() < LONGEST);
    };
    // All that it keeps, or all since the board began.
    assert!(
        rows.len() == 64 || rows.len() > 17 && rows[0].tick <= 1,
        "{} from tick {}",
        rows.len(),
        rows[0].tick
    );
    assert!(rows.windows(2).all(|pair| pair[1].tick == pair[0].tick + 1));
    assert_eq!(rows.iter().filter(|row| row.is_faulted).count(), 17);
}

/// The asker is gone in the middle: the board ends homing at rest, by its dead man, and tells the next one why.
#[test]
fn homing_of_an_asker_that_is_gone_ends_at_rest() {
    let machine = homed_machine();
    let (_board, address) = board(&machine, 51);
    let mut connection = connect(address, 51);
    let job = Arc::new(Job::<3>::new(&machine, &[]));
    let homing = OnBoardHoming { machine: &machine, job, may: ENABLES, dead_man_ms: 20_000 };
    let mut seen = 0;
    let gone = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _ = homing.home(0b11, &mut connection, &mut Vec::new(), &mut || false, &mut |axis, _| {
            seen += 1;
            assert!(axis != "X" || seen < 2, "killed");
        });
    }));
    assert!(gone.is_err());
    drop(connection);
    let mut connection = connect(address, 52);
    let begin = Instant::now();
    let failed = loop {
        assert!(begin.elapsed() < LONGEST, "{:?}", connection.status());
        connection.step(Duration::from_millis(1), &mut |_| {});
        if let Some(status) = connection.status()
            && let HomingProgress::Failed { failure, axis } = status.homing
        {
            // On a busy machine the next one may come when X is homed already.
            assert!(status.homed[usize::from(axis)..].iter().all(Option::is_none), "{status:?}");
            break failure;
        }
    };
    // By the silence, or by the next one's question.
    assert!(matches!(failed, HomingFailure::Silent | HomingFailure::Aborted), "{failed:?}");
    let status = *connection.status().expect("told");
    assert_eq!(status.state, State::Held);
}

/// Where X stands, as told last \[mm\].
fn stands_mm(connection: &Connection<3>) -> f64 {
    stands(connection)[0].to_mm()
}

/// What a scope has told: the ticks with the set positions, in order, and those that are missing.
#[derive(Default)]
struct Told {
    rows: Vec<(u64, [f64; 3], &'static str)>,
    missing: Vec<(u64, u64)>,
}

/// A board is given a machine with compensation, tells it again, and drives with it: its ticks, run again, come to the same, so
/// both ends compensate alike. A table that is too steep is refused.
#[test]
fn a_board_gets_compensation_and_its_ticks_show_it() {
    let machine = Machine::reference();
    let compensated = |most_um: f64| {
        let mut machine = Machine::reference();
        let points_um = [0.0, most_um, 0.0, -most_um];
        for axis in &mut machine.axes[..2] {
            axis.compensation = Some(AxisCompensation {
                backlash: Some(Backlash { play_mm: 0.02, take_up_s: 0.006 }),
                pitch_error: PitchError::new(-1.0, 1.25, &points_um, true),
            });
        }
        machine
    };
    let other = compensated(10.0);
    let (first, second) = (parameters::<3, 3>(&machine), parameters::<3, 3>(&other));
    println!("{} bytes, {} with the compensation of two axes", first.len(), second.len());
    let figures = |record: &[u8]| Figures::of::<3>(record).expect("a record");
    let differences = figures(&first).differences(&figures(&second));
    let is_of_it = |difference: &Difference| difference.name.starts_with("compensation.axes[");
    assert!(!differences.is_empty() && differences.iter().all(is_of_it), "{differences:?}");
    let (_board, address) = board(&machine, 61);
    let mut connection = connect(address, 61);
    assert_eq!(read(&mut connection).expect("an answer"), first);
    let refused = write(&mut connection, &parameters::<3, 3>(&compensated(26.0)));
    assert!(matches!(refused, Err(BoardError::Parameters(WriteError::Unsuitable))), "{refused:?}");
    write(&mut connection, &second).expect("suits");
    assert_eq!(read(&mut connection).expect("an answer"), second);
    drop(connection);
    let mut connection = connect(address, 62);
    // A program for the machine without it is for another machine.
    let foreign = drive(&job(&zigzag(10), &machine), ENABLES, &mut connection, |_, _, _| false);
    assert!(matches!(foreign, Err(BoardError::Disagrees { .. })), "{foreign:?}");
    drop(connection);
    let job = job(&zigzag(40), &other);
    let mut connection = connect(address, 63);
    let record = read(&mut connection).expect("its parameters");
    let sink = Box::new(|_: Ticks<'_, 3>| {});
    let identity = *connection.identity().expect("greeted");
    connection.set_scope(Scope::start(&identity, &record, sink).expect("a machine"));
    assert_eq!(drive(&job, ENABLES, &mut connection, |_, _, _| false).expect("driven"), Step::Done);
    assert_eq!(stands(&connection), end(&job));
    let summary = connection.end_scope().expect("begun");
    assert_eq!((summary.error, summary.is_foreign), (None, false));
    assert!(summary.ticks > 1000, "{summary:?}");
}

/// A program with a hold, another override and a cable that is cut: every tick is there, to the last one at the program's end, or
/// named as missing while the cable was out.
#[test]
fn a_scope_has_every_tick_but_those_while_the_cable_was_out() {
    let machine = Machine::reference();
    let job = job(&zigzag(150), &machine);
    let (_board, address) = board(&machine, 31);
    let cable = Cable::to(address);
    let mut connection = connect(cable.address, 31);
    let record = read(&mut connection).expect("its parameters");
    let told = Arc::new(Mutex::new(Told::default()));
    let sink = {
        let told = Arc::clone(&told);
        Box::new(move |ticks: Ticks<'_, 3>| {
            let mut told = told.lock().expect("sound");
            match ticks {
                Ticks::Row(row) => told.rows.push((row.tick, row.axes.map(|axis| axis.set_mm), row.state)),
                Ticks::Gap(first, last) => told.missing.push((first, last)),
            }
        })
    };
    let identity = *connection.identity().expect("greeted");
    connection.set_scope(Scope::start(&identity, &record, sink).expect("a machine"));
    let (mut steps, mut since) = (0, Instant::now());
    let step = drive(&job, ENABLES, &mut connection, |connection, sender, heard| {
        let taken = connection.status().map_or(0, |status| status.taken);
        let state = connection.status().map(|status| status.state);
        let is_held = state == Some(State::Held) && !connection.is_lost();
        let next = match steps {
            0 if sender.step() == Step::Drives && taken > 100 => {
                sender.hold(connection);
                true
            }
            1 if is_held => {
                let is_set = connection.command(|link| link.control(|to| to.override_permille = 700));
                is_set && sender.resume(connection)
            }
            2 if taken > 250 => {
                cable.cut(true);
                true
            }
            3 if since.elapsed() > Duration::from_millis(300) => {
                cable.cut(false);
                true
            }
            4 => heard.contains(&Heard::Back),
            5 if is_held => sender.resume(connection),
            _ => false,
        };
        if next {
            (steps, since) = (steps + 1, Instant::now());
        }
        false
    });
    assert_eq!((step.expect("driven"), steps), (Step::Done, 6));
    let last = connection.status().map(|status| status.tick).expect("told");
    // What was driven last comes behind the status that tells so.
    let begin = Instant::now();
    while begin.elapsed() < LONGEST
        && told.lock().expect("sound").rows.last().is_none_or(|row| row.0 < u64::from(last))
    {
        connection.step(Duration::from_millis(1), &mut |_| {});
    }
    let summary = connection.end_scope().expect("begun");
    let told = told.lock().expect("sound");
    assert_eq!((summary.error, summary.is_foreign), (None, false));
    assert_eq!((summary.ticks, &summary.gaps), (told.rows.len() as u64, &told.missing));
    assert!(!told.missing.is_empty(), "the cable was out");
    let (first, last) = (told.rows[0].0, told.rows[told.rows.len() - 1].0);
    assert_eq!(summary.ticks + summary.missing(), last + 1 - first);
    assert!(told.rows.is_sorted_by(|before, after| before.0 < after.0));
    for &(first, last) in &told.missing {
        assert!(!told.rows.iter().any(|row| (first..=last).contains(&row.0)), "{first} to {last}");
    }
    assert_eq!(told.rows[told.rows.len() - 1].1, end(&job).map(Position::to_mm));
    let moving = told.rows.iter().filter(|row| row.2 == "moving").count();
    assert!(moving > 5000, "{moving} ticks of motion");
    println!(
        "{} ticks, {moving} of motion, {:.2} bytes each",
        summary.ticks,
        summary.bytes as f64 / summary.ticks as f64
    );
}
