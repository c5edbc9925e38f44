//! `motion send`: drives a program on a board.

mod confirm;
mod journal;
pub mod resume;
mod shown;

use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use motion_kernel::link::State;
use motion_kernel::program::Checksum;

use self::confirm::Middle;
use self::journal::{Journal, Subject};
use self::resume::Resumed;
use self::shown::Shown;
use super::error::{CliError, Outcome};
use super::input;
use super::port::{DriveArguments, OnBoard, PortArguments};
use super::progress;
use super::scope::ScopeArguments;
use crate::board::from_line::from_line;
use crate::board::items::{Said, Source};
use crate::board::progress::{Place, Progress};
use crate::board::sender::{Found, check, check_outputs};
use crate::board::stops::Stops;
use crate::board::{BoardError, Connection, Heard, InPlanning, Job, Numbers, Sender, Step, in_numbers};
use crate::files::STANDARD_INPUT;
use crate::files::interrupt::{self, Asked};
use crate::gcode::{self, Program, ReadOptions};
use crate::machine::{Machine, on_machine};
use crate::planning::{Executable, Mode as PlanMode, Plan, PlanningError, require_outputs};
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
  motion send part.ngc --port /dev/ttyACM0 --from-line 120
                                                     begins at the path of line 120
  motion send part.ngc --port /dev/ttyACM0 --scope ticks.csv --trigger 'err_um>50'
                                                     and what the board did around ticks with a great following error

The board first moves straight to the program's start, slowly, then drives the program.

--from-line reads the whole program: offsets, tool, spindle and coolant are those of that line. What comes first is told
and waits for r: spindle and coolant are switched where the machine stands, then it moves straight to where that line's path
begins, so bring it to a place from where that way is free. A rounded corner belongs to the line before it.

Keys, each with Enter: h holds, r resumes (also from a program stop), a aborts, + and - change the override by 10 %, 0
resets it, s switches single block. Ctrl-C holds; Ctrl-C again ends this command, and the board stays held. A request to end
(SIGTERM) does both.

A board without this command comes to rest on the path where its items end. A cable that was out is noticed: the board is
held when it is in again, and r goes on. After a power cut, of the board, of the PC or of both, `motion resume` goes on.

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
    /// Begin in the middle: at the path of this line of the program, or of the next one with motion. What was before is read,
    /// and not driven.
    #[arg(long, value_name = "LINE", conflicts_with = "continues")]
    from_line: Option<u32>,
    /// Confirm the first motion of --from-line, for scripts.
    #[arg(long, requires = "from_line")]
    yes: bool,
    /// Where to remember how far the program is, for `motion resume`. Without it, a file of the port in the user's state
    /// folder ($XDG_STATE_HOME/motion or ~/.local/state/motion); none for `simulator`, nor for a program from standard input.
    #[arg(long, value_name = "FILE")]
    journal: Option<PathBuf>,
    #[command(flatten)]
    drives: DriveArguments,
    /// Go on after what the board has of this program: after this command was killed, or the PC was restarted.
    #[arg(long = "continue", conflicts_with = "restart")]
    continues: bool,
    /// Give up what the board has of a program.
    #[arg(long)]
    restart: bool,
    /// Begin at once: the program is read and planned while it is driven. A line that can't be read, or is beyond the travel, ends
    /// the motion at rest before it. Between G41 or G42 and G40 nothing is known to be final. Without this option all is planned
    /// before anything moves.
    #[arg(long, conflicts_with = "from_line")]
    stream: bool,
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
    send_program(arguments, None, out)
}

/// The same; or what is left of a program that was interrupted.
fn send_program(
    arguments: &SendArguments,
    resumed: Option<&Resumed>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.program)?;
    let options = source.options(&arguments.reading.options(machine.read_options())?);
    let name = input_sum(&source.text, &options);
    if arguments.stream {
        let source = Source {
            name: source.name,
            text: source.text,
            options,
            leaves_out_outputs: arguments.no_spindle,
        };
        return on_machine!(machine, machine => {
            arguments.port.on_board(machine, Streamed { arguments, source, name, machine, out })
        });
    }
    let program = gcode::read_with(&source.name, &source.text, &options)?;
    let program = Sent { arguments, resumed, program: &program, sum: Checksum::of(&source.text), name };
    on_machine!(machine, machine => {
        if !arguments.no_spindle {
            require_outputs(&source.name, &program.program.steps, machine)?;
        }
        let plan = progress::plan(&source.name, program.program, machine, PlanMode::Spanning)?;
        plan.refuse_probes()?;
        for notice in plan.notices.iter().filter(|_| !arguments.json) {
            writeln!(out, "note: {notice}").map_err(CliError::Output)?;
        }
        // What the board is, is not known yet; most are of f32.
        holds_axes(Numbers::F32, machine)?;
        let sent = &program;
        arguments.port.on_board(machine, Planned { sent, plan: &plan, machine, out })
    })
}

/// What is asked for, and the program read.
struct Sent<'a> {
    arguments: &'a SendArguments,
    resumed: Option<&'a Resumed>,
    program: &'a Program,
    /// The checksum of its file, and of everything that its items are made of but the machine.
    sum: u32,
    name: u32,
}

/// The checksum of a program and of what it is read with.
fn input_sum(text: &[u8], options: &ReadOptions) -> u32 {
    // Folders may have been named otherwise.
    let options = ReadOptions { subroutines: Vec::new(), ..options.clone() };
    let options = format!("{} {options:?}", env!("CARGO_PKG_VERSION"));
    Checksum::of([Checksum::of(text), Checksum::of(options.as_bytes())].map(u32::to_le_bytes).as_flattened())
}

/// The name on the link of a program with this checksum that is planned while it is driven.
pub(super) fn job_name(input: u32, machine: u32) -> u32 {
    Checksum::of([input, machine].map(u32::to_le_bytes).as_flattened()).max(1)
}

/// A program that is read and planned while it is driven.
struct Streamed<'a, const N: usize> {
    arguments: &'a SendArguments,
    source: Source,
    /// The checksum of everything that its items are made of but the machine.
    name: u32,
    machine: &'a Machine<N>,
    out: &'a mut dyn Write,
}

impl<const N: usize> OnBoard for Streamed<'_, N> {
    fn run<const M: usize>(self, connection: Connection<M>) -> Result<Outcome, CliError> {
        let Self { arguments, source, name, machine, out } = self;
        holds_axes(connection.numbers(), machine)?;
        let job = Job::<M>::in_planning(machine, 0);
        let job = Job { name: job_name(name, job.machine), ..job };
        let subject = Subject {
            program_sum: Checksum::of(&source.text),
            machine_sum: job.machine,
            job: job.name,
            session: connection.session(),
            name: job.name,
        };
        let journal = Journal::open(arguments, &subject)?;
        let lines = source.text.iter().filter(|&&byte| byte == b'\n').count() as u64;
        let planned = in_numbers!(connection.numbers(), R => InPlanning::begin::<R, N>(source, machine));
        let driven = Driven {
            job: Arc::new(job),
            planned: Some(planned),
            found: found(arguments),
            stops: Stops::default(),
            middle: None,
            journal,
            lines,
        };
        drive(arguments, driven, machine, connection, out)
    }
}

/// The files that no output may replace.
fn inputs(arguments: &SendArguments) -> [(&'static str, Option<&Path>); 5] {
    [
        ("the program", Some(arguments.program.as_path())),
        ("--machine", arguments.machine.as_deref()),
        ("--parameters", arguments.reading.parameters.as_deref()),
        ("--tools", arguments.reading.tools.as_deref()),
        ("--journal", arguments.journal.as_deref()),
    ]
}

/// What is to become of a program that the board has already.
fn found(arguments: &SendArguments) -> Found {
    match (arguments.continues, arguments.restart) {
        (true, _) => Found::Continued,
        (_, true) => Found::GivenUp,
        _ => Found::Stays,
    }
}

/// Refuses a machine whose axes a kernel of the number type does not hold.
fn holds_axes<const N: usize>(numbers: Numbers, machine: &Machine<N>) -> Result<(), CliError> {
    let axes = in_numbers!(numbers, R => machine.axes_config::<R>().map(|_| ()));
    axes.map_err(|source| CliError::Axis { machine: machine.name.clone(), source })
}

/// A program that is planned.
struct Planned<'a, const N: usize> {
    sent: &'a Sent<'a>,
    plan: &'a Plan<N>,
    machine: &'a Machine<N>,
    out: &'a mut dyn Write,
}

impl<const N: usize> OnBoard for Planned<'_, N> {
    fn run<const M: usize>(self, connection: Connection<M>) -> Result<Outcome, CliError> {
        let Self { sent, plan, machine, out } = self;
        let job = job::<N, M>(connection.numbers(), plan, machine)?;
        send_job::<N, M>(sent, (plan, job), machine, connection, out)
    }
}

/// The plan as items, in the board's number type, if that holds its axes, too.
fn job<const N: usize, const M: usize>(
    numbers: Numbers,
    plan: &Plan<N>,
    machine: &Machine<N>,
) -> Result<Job<M>, CliError> {
    holds_axes(numbers, machine)?;
    let executable = in_numbers!(numbers, R => Executable::new::<R>(plan))?;
    Ok(Job::new(machine, &executable.items))
}

/// Drives the job, or the rest of it that is asked for.
fn send_job<const N: usize, const M: usize>(
    sent: &Sent<'_>,
    (plan, whole): (&Plan<N>, Job<M>),
    machine: &Machine<N>,
    mut connection: Connection<M>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let &Sent { arguments, resumed, program, sum, name } = sent;
    let mut found = found(arguments);
    // Another machine is refused before another program.
    if let (Some(_), Some(identity)) = (resumed, connection.identity()) {
        check(&whole, identity).map_err(|error| arguments.port.refused(error))?;
    }
    let stops = Stops::new(program, plan, &whole);
    let (machine_sum, name_of_whole) = (whole.machine, whole.name);
    let (job, middle) = match (resumed, arguments.from_line) {
        (Some(resumed), _) => {
            // What the board has of it is driven again from where the journal was.
            if resumed.is_of(connection.controls().program) {
                found = Found::GivenUp;
            }
            let (job, middle) =
                resumed.rest::<N, M>(machine, program, (&whole, name), arguments.yes, &mut connection)?;
            (job, Some(middle))
        }
        (None, Some(line)) => {
            let (job, middle) = from_line_on(arguments, program, (connection.numbers(), &whole), line)?;
            (job, Some(middle))
        }
        (None, None) => (whole, None),
    };
    let subject = Subject {
        program_sum: sum,
        machine_sum,
        job: name_of_whole,
        session: connection.session(),
        name: job.name,
    };
    let journal = Journal::open(arguments, &subject)?;
    let stops = stops.skip(job.begin.stops);
    let lines = program.steps.last().map_or(0, |step| u64::from(step.line));
    let driven = Driven { job: Arc::new(job), planned: None, found, stops, middle, journal, lines };
    drive(arguments, driven, machine, connection, out)
}

/// What is driven, and what goes with it.
struct Driven<const M: usize> {
    job: Arc<Job<M>>,
    /// Its items, where they are planned meanwhile.
    planned: Option<InPlanning<M>>,
    found: Found,
    stops: Stops,
    /// It begins in the middle.
    middle: Option<Middle>,
    journal: Option<Journal>,
    /// Lines of the program.
    lines: u64,
}

/// The job from a line on, and what there is to confirm.
fn from_line_on<const M: usize>(
    arguments: &SendArguments,
    program: &Program,
    (numbers, whole): (Numbers, &Job<M>),
    line: u32,
) -> Result<(Job<M>, Middle), CliError> {
    let name = arguments.program.display().to_string();
    let found = from_line(program, &whole.items, line).map_err(|source| CliError::FromLine {
        program: name.clone(),
        line,
        source,
    })?;
    let job = in_numbers!(numbers, R => whole.from_item::<R>(found.item));
    let job = job.map_err(|problem| PlanningError::at_line(&name, problem))?;
    let why = match found.line {
        same if same == line => "",
        later if later > line => ", the next one with motion",
        _ => ", whose path goes on there",
    };
    let place = format!("begins at line {} of {name}{why}", found.line);
    Ok((job, Middle { place, tool: found.tool, is_confirmed: arguments.yes }))
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
    driven: Driven<M>,
    machine: &Machine<N>,
    mut connection: Connection<M>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let info = RunInfo::of_machine(machine);
    let scoped = arguments.scope.start(&inputs(arguments), &info, &arguments.port, &mut connection)?;
    let outcome = drive_to_end(arguments, driven, machine, &mut connection, out);
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
    driven: Driven<M>,
    machine: &Machine<N>,
    connection: &mut Connection<M>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let refused = |error: BoardError| match error {
        BoardError::Program(error) => CliError::Program(error),
        error => arguments.port.refused(error),
    };
    let names: Arc<[String]> = machine.axis_names();
    let Driven { job, planned, found, stops, middle, mut journal, lines } = driven;
    let may = arguments.drives.permissions(found);
    let items = planned.is_none().then_some(job.items.len());
    let mut sender = match planned {
        Some(planned) => Sender::planned(Arc::clone(&job), planned, Arc::clone(&names), may),
        None => Sender::new(Arc::clone(&job), Arc::clone(&names), may),
    };
    let mut progress = Progress::new(job.begin.path, job.header.tick_s);
    if let Some(identity) = connection.identity() {
        check(&job, identity).map_err(refused)?;
        let program = arguments.program.display().to_string();
        check_outputs(&program, &job, identity.outputs).map_err(refused)?;
    }
    let keys = keys(arguments);
    let mut shown = Shown::new(arguments, &names, stops, (items, lines));
    if let Some(middle) = &middle
        && let Some(outcome) = middle.confirm(&job, (connection, &arguments.port), &keys, &shown, out)?
    {
        return Ok(outcome);
    }
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
        for said in sender.take_said() {
            match said {
                Said::Stop(place, text) => shown.stops.add(place, text),
                Said::Note(note) => shown.say(out, &format!("note: {note}"))?,
            }
        }
        shown.show(out, step, connection)?;
        if let Some(journal) = &mut journal {
            note(journal, &mut progress, &sender, connection, names.len());
        }
        if let Some(kept) = journal.as_mut().and_then(Journal::take_kept) {
            let kept = kept.display();
            shown.say(
                out,
                &format!("another program was not at its end: motion resume {kept} goes on with it"),
            )?;
        }
        if let Some(failure) = journal.as_ref().and_then(Journal::failure) {
            shown.say(out, &format!("the journal is not written: {failure}"))?;
        }
        match step {
            Step::Done => {
                shown.end(out, "done")?;
                let Some(mut journal) = journal else { return Ok(Outcome::Done) };
                journal.finish();
                return journal.close().map(|()| Outcome::Done).map_err(CliError::Unwritten);
            }
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
            let goes_on = match (step, &middle) {
                (Step::Drives, None) => "; motion send --continue goes on",
                (Step::Drives, Some(_)) => "; motion resume goes on",
                _ => "",
            };
            let what = format!("nobody resumes: the board stays held{goes_on}");
            return shown.end(out, &what).map(|()| Outcome::Held);
        }
    }
}

/// Notes in the journal how far the program is.
fn note<const M: usize>(
    journal: &mut Journal,
    progress: &mut Progress,
    sender: &Sender<M>,
    connection: &Connection<M>,
    axes: usize,
) {
    if let Some(status) = connection.status()
        && let Some(driven) = sender.driven(status)
    {
        let place = progress.tell(status.tick, Place { driven, line: status.line });
        let set_mm = status.set.iter().take(axes).map(|position| position.to_mm()).collect();
        let homed = status.homed.iter().take(axes).map(Option::is_some).collect();
        journal.note(place, set_mm, homed);
    }
}

/// Obeys a key; false if nothing comes of it.
fn command<const M: usize>(key: char, connection: &mut Connection<M>, sender: &mut Sender<M>) -> bool {
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
