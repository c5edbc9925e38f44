//! `motion send`: drives a program on a board.

mod shown;
mod stops;

use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use motion_kernel::link::State;
use motion_kernel::num::{Fixed, Root};

use self::shown::Shown;
pub(super) use self::shown::state_words;
use self::stops::Stops;
use super::error::{CliError, Outcome};
use super::input;
use super::port::PortArguments;
use super::scope::ScopeArguments;
use crate::board::sender::{Found, Permissions, check_outputs};
use crate::board::{BoardError, Connection, Heard, Job, Port, Sender, Step};
use crate::files::STANDARD_INPUT;
use crate::files::interrupt::{self, Asked};
use crate::gcode::Program;
use crate::machine::{Machine, on_machine};
use crate::planning::{Executable, Mode as PlanMode, Plan, on_axis_count, plan_program, require_outputs};
use crate::simulate::RunInfo;

const EXAMPLES: &str = "\
Examples:
  motion send part.ngc --port simulator --enable     on the simulated machine, at the pace of the clock
  motion send part.ngc --port tcp:localhost:5000 --enable
                                                     on a board behind an address (`motion board` starts one)
  motion send part.ngc --port /dev/ttyACM0 --machine mine.toml
                                                     on a board at a serial port, with its drives on
  motion send part.ngc --port /dev/ttyACM0 --continue
                                                     goes on after what the board has of the program
  motion send part.ngc --port /dev/ttyACM0 --scope ticks.csv --trigger 'err_um>50'
                                                     and what the board did around ticks with a great following error

The board first moves straight to the program's start, slowly, then drives the program.

Keys, each with Enter: h holds, r resumes (also from a program stop), a aborts, + and - change the override by 10 %, 0
resets it, s switches single block. Ctrl-C holds; Ctrl-C again ends this command, and the board stays held. A request to end
(SIGTERM) does both.

A board without this command comes to rest on the path where its items end. A cable that was out is noticed: the board is
held when it is in again, and r goes on.

Exit status: 0 done; 1 a fault, or the board was lost, reset, or asked by another sender; 2 the program or the board does
not fit; 3 held, or at a program stop, and nobody there to resume (the end of standard input), or ended by SIGTERM; 4 aborted;
130 interrupted, the board is held.";

/// Drive a program on a board, and show what it does.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct SendArguments {
    /// G-code (`-`: standard input; then there are no keys).
    program: PathBuf,
    #[command(flatten)]
    port: PortArguments,
    /// Machine file (`motion machine` prints one); without it, the reference machine. The board must have the same.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// Switch the drives on if they are off.
    #[arg(long)]
    enable: bool,
    /// Clear a fault of the board before that.
    #[arg(long, requires = "enable")]
    clear_fault: bool,
    /// Switch the drives off at the end.
    #[arg(long)]
    disable: bool,
    /// Go on after what the board has of this program: after this command was killed, or the PC was restarted.
    #[arg(long = "continue", conflicts_with = "restart")]
    continues: bool,
    /// Give up what the board has of a program.
    #[arg(long)]
    restart: bool,
    /// Leave out the words of spindle and coolant that the machine has no output for.
    #[arg(long)]
    no_spindle: bool,
    #[command(flatten)]
    scope: ScopeArguments,
    /// Print lines of JSON: {step, state, line, set_mm, actual_mm, feed_mm_s, override, taken, items}, at every change, and
    /// twice a second.
    #[arg(long)]
    json: bool,
}

/// Plans, connects, drives.
///
/// # Errors
/// The program, the machine file or the board is refused, or the board is in a fault.
pub fn send(arguments: &SendArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.program)?;
    let program = arguments.reading.program(&source, machine.read_options())?;
    on_machine!(machine, machine => {
        if !arguments.no_spindle {
            require_outputs(&source.name, &program, machine)?;
        }
        let plan = plan_program(&source.name, &program, machine, PlanMode::Spanning)?;
        if let Some(probe) = plan.probes.first() {
            return Err(CliError::NoProbeInput { program: source.name.clone(), line: probe.line });
        }
        for notice in plan.notices.iter().filter(|_| !arguments.json) {
            writeln!(out, "note: {notice}").map_err(CliError::Output)?;
        }
        send_plan(arguments, (&program, &plan), machine, out)
    })
}

fn send_plan<const N: usize>(
    arguments: &SendArguments,
    (program, plan): (&Program, &Plan<N>),
    machine: &Machine<N>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    if arguments.port.port == Port::Simulator {
        let job = job::<f32, N, N>(plan, machine)?;
        let (mut connection, _board) = arguments.port.simulated(machine)?;
        greet(&mut connection).map_err(|error| arguments.port.refused(error))?;
        let stops = Stops::new(program, plan, &job);
        return drive(arguments, (&job, stops), machine, connection, out);
    }
    on_axis_count!(machine.axis_count(), M => {
        let mut job = job::<f32, N, M>(plan, machine)?;
        let mut connection = arguments.port.open::<M>()?;
        // The number type is the board's.
        greet(&mut connection).map_err(|error| arguments.port.refused(error))?;
        if connection.identity().is_some_and(|identity| identity.is_fixed_point) {
            job = self::job::<Fixed, N, M>(plan, machine)?;
        }
        let stops = Stops::new(program, plan, &job);
        drive(arguments, (&job, stops), machine, connection, out)
    })
}

/// The plan as items, in the board's number type, if that holds its axes, too.
fn job<R: Root, const N: usize, const M: usize>(
    plan: &Plan<N>,
    machine: &Machine<N>,
) -> Result<Job<M>, CliError> {
    machine.axes_config::<R>().map_err(|source| CliError::Axis { machine: machine.name.clone(), source })?;
    Ok(Job::new(machine, &Executable::new::<R>(plan)?.items))
}

/// Waits for the board's answer: what it is.
pub(super) fn greet<const M: usize>(connection: &mut Connection<M>) -> Result<(), BoardError> {
    let mut lost = None;
    for _ in 0..200 {
        connection.step(Duration::from_millis(50), &mut |heard| {
            if let Heard::Lost(cause) = heard {
                lost = Some(cause);
            }
        });
        if connection.identity().is_some() {
            return Ok(());
        }
        if let Some(cause) = lost.take() {
            return Err(BoardError::Wire(io::Error::other(cause)));
        }
    }
    Err(BoardError::Silent)
}

/// So long a board that only an operator can go on with is waited for where there is none.
const UNATTENDED: Duration = Duration::from_secs(5);

/// What the operator types.
enum Typed {
    Key(char),
    /// Nobody types any more.
    End,
}

/// The keys of standard input, unless the program comes from there.
fn keys(arguments: &SendArguments) -> Receiver<Typed> {
    let (typed, keys) = channel();
    let is_taken = arguments.program.as_os_str() == STANDARD_INPUT;
    thread::spawn(move || {
        if !is_taken {
            for line in io::stdin().lock().lines().map_while(Result::ok) {
                for key in line.trim().chars() {
                    if typed.send(Typed::Key(key)).is_err() {
                        return;
                    }
                }
            }
        }
        let _ = typed.send(Typed::End);
    });
    keys
}

fn drive<const N: usize, const M: usize>(
    arguments: &SendArguments,
    (job, stops): (&Job<M>, Stops),
    machine: &Machine<N>,
    mut connection: Connection<M>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let info = RunInfo::of_machine(machine);
    let scoped = arguments.scope.start(&info, &arguments.port, &mut connection)?;
    let outcome = drive_to_end(arguments, (job, stops), machine, &mut connection, out);
    match scoped {
        Some(scoped) => {
            let is_quiet = arguments.json;
            // What was seen is kept, and why it ended is told.
            let of_scope = scoped.finish(&mut connection, is_quiet, Outcome::Done, out);
            let outcome = outcome?;
            of_scope.map(|of_scope| if outcome == Outcome::Done { of_scope } else { outcome })
        }
        None => outcome,
    }
}

fn drive_to_end<const N: usize, const M: usize>(
    arguments: &SendArguments,
    (job, stops): (&Job<M>, Stops),
    machine: &Machine<N>,
    connection: &mut Connection<M>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let refused = |error: BoardError| arguments.port.refused(error);
    let names: Vec<String> = machine.driven_axes().iter().map(|axis| axis.name.clone()).collect();
    let found = match (arguments.continues, arguments.restart) {
        (true, _) => Found::Continued,
        (_, true) => Found::GivenUp,
        _ => Found::Stays,
    };
    let may = Permissions {
        enables: arguments.enable,
        clears_fault: arguments.clear_fault,
        disables: arguments.disable,
        found,
    };
    let mut sender = Sender::new(job, &names, may);
    if let Some(identity) = connection.identity() {
        sender.check(identity).map_err(refused)?;
        let program = arguments.program.display().to_string();
        check_outputs(&program, job, identity.outputs).map_err(refused)?;
    }
    let keys = keys(arguments);
    let mut shown = Shown::new(arguments, &names, stops, job.items.len() as u64);
    interrupt::hold_first();
    let (mut is_attended, mut waits_since) = (true, Instant::now());
    loop {
        let mut heard = Vec::new();
        connection.step(Duration::from_millis(2), &mut |one| heard.push(one));
        for one in heard {
            match &one {
                Heard::Lost(cause) => {
                    shown.say(out, &format!("lost the board: {cause}; it comes to rest on the path"))?;
                }
                Heard::Back => shown.say(out, "the board is back, and is held: r resumes")?,
                Heard::Board(_) => {}
            }
            sender.hear(&one).map_err(refused)?;
        }
        if let Some(asked) = interrupt::take_asked() {
            sender.hold(connection);
            if asked == Asked::End {
                if !connection.settle() {
                    let told = "no confirmation of a hold: it drives what it has, and rests";
                    return Err(refused(BoardError::Wire(io::Error::other(told))));
                }
                return shown.end(out, "ended: the board is held").map(|()| Outcome::Held);
            }
            shown.say(out, "holding: r resumes, a aborts, Ctrl-C again leaves the board held")?;
        }
        loop {
            match keys.try_recv() {
                Ok(Typed::Key(key)) => {
                    if !command(key, connection, &mut sender) {
                        shown.say(out, "nothing is done: the board is lost, or there is no such key")?;
                    }
                }
                Ok(Typed::End) | Err(TryRecvError::Disconnected) => is_attended = false,
                Err(TryRecvError::Empty) => break,
            }
            if !is_attended {
                break;
            }
        }
        let step = sender.advance(connection).map_err(refused)?;
        shown.show(out, step, connection)?;
        match step {
            Step::Done => return shown.end(out, "done").map(|()| Outcome::Done),
            Step::Aborted => return shown.end(out, "aborted").map(|()| Outcome::Aborted),
            _ => {}
        }
        // Somewhere where only an operator goes on.
        let waits = matches!(step, Step::Drives | Step::ToStart)
            && connection.status().is_some_and(|status| matches!(status.state, State::Held | State::Stopped));
        if !waits && !connection.is_lost() {
            waits_since = Instant::now();
        }
        if !is_attended && waits_since.elapsed() > UNATTENDED {
            if connection.is_lost() {
                return Err(refused(BoardError::Wire(io::Error::other("no board any more"))));
            }
            let goes_on = if step == Step::Drives { "; motion send --continue goes on" } else { "" };
            let what = format!("nobody resumes: the board stays held{goes_on}");
            return shown.end(out, &what).map(|()| Outcome::Held);
        }
    }
}

/// Obeys a key; false if nothing comes of it.
fn command<const M: usize>(key: char, connection: &mut Connection<M>, sender: &mut Sender<'_, M>) -> bool {
    let change = |permille: u16, by: i16| permille.saturating_add_signed(by).clamp(100, 2000);
    match key {
        'h' => {
            sender.hold(connection);
            true
        }
        'r' => {
            interrupt::hold_first();
            sender.resume(connection)
        }
        'a' => {
            sender.abort(connection);
            true
        }
        '+' | '-' => {
            let by = if key == '+' { 100 } else { -100 };
            connection.command(|link| {
                link.control(|controls| controls.override_permille = change(controls.override_permille, by))
            })
        }
        '0' => connection.command(|link| link.control(|controls| controls.override_permille = 1000)),
        's' => connection.command(|link| link.control(|controls| controls.is_single_block ^= true)),
        _ => false,
    }
}
