//! `motion run`: a program through plan, kernel and simulated machine.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use motion_kernel::hal::OutputState;
use serde::Serialize;

use super::against;
use super::error::{CliError, Outcome};
use super::input;
use super::outputs::{self, Outputs, Written};
use super::progress;
use super::read::direction;
use super::table::{self, Align};
use super::trace::TraceArguments;
use super::units::{InUnit, TableUnits};
use super::write_json;
use crate::files::{Files, OutputFile};
use crate::gcode::Axis;
use crate::machine::{Machine, on_machine};
use crate::planning::{Mode, Plan};
use crate::recording::Recorder;
use crate::simulate::inject::Injections;
use crate::simulate::live::Script;
use crate::simulate::{self, AxisSummary, Job, Probed, RunError, RunInfo, RunOptions, RunSummary};
use crate::trace::{RunEnd, TracedCommand, TracedFault, TracedSwitch};

const EXAMPLES: &str = "\
Examples:
  motion run part.ngc                                run on the reference machine, print a summary
  motion run part.ngc --report part.html             and write a page to look into the run
  motion run part.ngc --report part.html --against before.ngc
                                                     with the curves of another program, or of a recording, beside it
  motion run part.ngc --machine mine.toml --trace part.csv
                                                     every tick of every axis, for a spreadsheet
  motion run part.ngc --at N50:hold,1.3s:resume,3000:override=0.5
                                                     with commands at a line, a time, and a tick
  motion run part.ngc --trace - --columns t_s,X_err_um --every 10 | plot
                                                     some columns of every tenth tick
  motion run part.ngc --record part.mrec             and record it for `motion replay`
  generate-part | motion run - --json                for a script

Exit status: 0 the program finished, 1 a fault, 3 held, 4 aborted, 5 a command of --at was not reached, 6 a file could not
be written. In all these cases the summary is printed, and the files are written.

JSON: finished, stopped_by (null, \"hold\", \"single block\", \"override\", \"abort\" or \"fault\"), reached_mm, reached_line
(how far the run came), commands_not_reached, probes, outputs, and the figures of the run; those of a rotary axis have mdeg
in place of um. probes are the probing moves: line,
tick, tripped, position_mm (where the encoders read X, Y, Z then), program_mm (where the program reads the trip, in machine
coordinates). outputs are the switches of spindle and coolant: tick (before which), line (null: all off by an abort or a
fault), spindle (\"clockwise\", \"counterclockwise\" or null: off), speed_rpm, flood, mist.";

/// Run a program: plan it, execute it tick by tick with the real-time kernel, on simulated axes.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct RunArguments {
    /// G-code; `-` is standard input.
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    #[command(flatten)]
    trace: TraceArguments,
    /// Write a self-contained HTML page about the run, for a browser; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Show another run in the report, too: a program, run on the same machine, or a recording of `--record`.
    #[arg(long, value_name = "FILE", requires = "report")]
    against: Option<PathBuf>,
    /// Record the kernel's inputs, tick by tick, for `motion replay`; an existing file is replaced.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Live control: commands at given moments, such as `2000:hold,1.3s:resume,N50:override=0.5`.
    ///
    /// A moment is a tick (2000), a time from the start of the run (1.3s), or where motion on a line of
    /// the program's file begins (N50: line 50, whatever its N word is).
    /// Each command waits for the one before it.
    ///
    /// A command is `hold` (come to rest on the path), `resume`, `abort` (come to rest and drop the rest of
    /// the program), `override=SHARE` (feed override: 0 to 2 times the program's feed, never above the
    /// machine's limits), `single` (single block: come to rest at the end of every program line and wait
    /// there for a resume) or `continuous` (single block off).
    #[arg(long, value_name = "WHEN:COMMAND,…")]
    at: Option<Script>,
    /// Break the simulated machine before given ticks, such as `2000:encoder-lost=X`.
    ///
    /// What can break: `encoder-lost=AXIS`, `encoder-jump=AXIS:COUNTS`, `encoder-reversed=AXIS`,
    /// `drive-reversed=AXIS`, `overload=AXIS:ACCELERATION` (the drive's remaining acceleration, in mm/s² or °/s²),
    /// `drive-not-ready=AXIS`, `drive-fault=AXIS`, `limit-low=AXIS:POSITION` and `limit-high=AXIS:POSITION`
    /// (a limit switch up to or from this position, in mm or °), and `emergency-stop`.
    #[arg(long, value_name = "TICK:FAULT,…")]
    inject: Option<Injections>,
    /// Print JSON: ticks, times, maxima along the path, share of the path with an active limit, errors of the
    /// axes, faults.
    #[arg(long)]
    json: bool,
}

/// Plans, runs and prints.
///
/// # Errors
/// The program or the machine file is refused, there is no plan, or a file can't be written.
pub fn run(arguments: &RunArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([
        ("PROGRAM", Some(arguments.program.as_path())),
        ("--machine", arguments.machine.as_deref()),
        ("--parameters", arguments.reading.parameters.as_deref()),
        ("--tools", arguments.reading.tools.as_deref()),
        ("--against", arguments.against.as_deref()),
    ]);
    let outputs = Outputs::open(&mut files, &arguments.trace, arguments.report.as_ref(), arguments.json)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    input::differ("PROGRAM", &arguments.program, "--against", arguments.against.as_deref())?;
    let record = outputs::open(&mut files, "--record", arguments.record.as_ref())?;
    let kept = arguments.reading.parameters.as_ref();
    let kept = kept.map(|path| files.edited("--parameters", path, "--parameters")).transpose()?;
    let machine = input::any_machine(arguments.machine.as_ref())?;
    // A wrong column is not found after a long plan.
    on_machine!(machine, machine => arguments.trace.selection(&RunInfo::of_machine(machine)))?;
    let source = input::read(&arguments.program)?;
    let reading = arguments.reading.options(machine.read_options())?;
    let program = source.program(&reading)?;
    let after = reading.parameters.after(&program.parameters);
    let options = RunOptions {
        script: arguments.at.as_ref(),
        injections: arguments.inject.as_ref(),
        ..RunOptions::default()
    };
    let (summary, mut written) = on_machine!(machine, machine => {
        let outputs = match &arguments.against {
            Some(path) => outputs.against(against::run(path, &reading, machine)?),
            None => outputs,
        };
        let plan = progress::plan(&source.name, &program, machine, Mode::Spanning)?;
        execute(&options, &plan, machine, outputs.of_program(&source.text, &plan), record)
    })?;
    // A run that ended early has not set what the program would set later.
    if Outcome::of(&summary) == Outcome::Done {
        written.write("parameters", kept, |file| write!(file, "{after}"));
    }
    let printed = if arguments.json {
        write_json(&json(&summary), out)
    } else {
        write_summary(&summary, out).map_err(CliError::Output).and_then(|()| written.say(out))
    };
    CliError::all([
        printed.map(|()| Outcome::Done),
        written.outcome(Outcome::Done),
        CliError::of_unreached(&summary, Outcome::of(&summary)),
    ])
}

/// Runs a plan; writes the trace during the run, report and recording afterwards.
pub(super) fn execute<const N: usize>(
    options: &RunOptions<'_>,
    plan: &Plan<N>,
    machine: &Machine<N>,
    outputs: Outputs,
    record: Option<OutputFile>,
) -> Result<(RunSummary, Written), CliError> {
    let refused = |source: RunError| CliError::Run { program: plan.source.clone(), source };
    let job = Job::new(options, plan, machine).map_err(refused)?;
    let Some(record) = record else {
        let run = |observe: &mut simulate::Observer<'_, N>| {
            simulate::on_simulated(machine, options.injections, |hardware| {
                simulate::run_on(&job, hardware, observe)
            })
        };
        return outputs.of_run(&job, run, |summary| summary);
    };
    let run = |observe: &mut simulate::Observer<'_, N>| {
        simulate::on_simulated(machine, options.injections, |hardware| {
            let mut recorder = Recorder::new(hardware);
            let summary = simulate::run_on(&job, &mut recorder, observe)?;
            Ok((summary, recorder.finish(&job)))
        })
    };
    let ((summary, recording), mut written) = outputs.of_run(&job, run, |(summary, _)| summary)?;
    written.write("recording", Some(record), |file| file.write_all(&recording.to_bytes()));
    Ok((summary, written))
}

#[derive(Serialize)]
pub(super) struct RunJson<'run> {
    finished: bool,
    stopped_by: Option<&'static str>,
    reached_mm: f64,
    reached_line: u32,
    ticks: u64,
    tick_s: f64,
    planned_time_s: f64,
    time_s: f64,
    path_length_mm: f64,
    max: MaxJson,
    limit_active_share: f64,
    axes: Vec<InUnit<AxisJson<'run>>>,
    contour_error_um_max: f64,
    probes: Vec<ProbeJson>,
    commands: &'run [TracedCommand],
    commands_not_reached: &'run [String],
    outputs: Vec<SwitchJson>,
    faults: Vec<FaultJson<'run>>,
    notices: &'run [String],
}

#[derive(Serialize)]
struct MaxJson {
    feed_mm_s: f64,
    accel_mm_s2: f64,
    jerk_mm_s3: f64,
    snap_mm_s4: f64,
}

#[derive(Serialize)]
struct AxisJson<'run> {
    name: &'run str,
    following_error_um_max: f64,
    following_error_um_rms: f64,
    end_error_counts: i64,
    output_v_max: f64,
}

#[derive(Serialize)]
struct ProbeJson {
    line: u32,
    tick: u64,
    tripped: bool,
    position_mm: [f64; 3],
    program_mm: Option<[f64; 3]>,
}

#[derive(Serialize)]
struct SwitchJson {
    tick: u64,
    line: Option<u32>,
    spindle: Option<&'static str>,
    speed_rpm: f64,
    flood: bool,
    mist: bool,
}

#[derive(Serialize)]
struct FaultJson<'run> {
    tick: u64,
    axis: Option<&'run str>,
    fault: &'run str,
    detail: &'run str,
}

pub(super) fn json<'run>(summary: &'run RunSummary) -> RunJson<'run> {
    let axis = |axis: &'run AxisSummary| AxisJson {
        name: &axis.name,
        following_error_um_max: axis.following_error_um_max,
        following_error_um_rms: axis.following_error_um_rms,
        end_error_counts: axis.end_error_counts,
        output_v_max: axis.output_v_max,
    };
    let probe = |probed: &Probed| {
        let &Probed { line, tick, tripped, position_mm, program_mm } = probed;
        ProbeJson { line, tick, tripped, position_mm, program_mm }
    };
    let fault = |fault: &'run TracedFault| FaultJson {
        tick: fault.tick,
        axis: fault.axis.as_deref(),
        fault: &fault.fault,
        detail: &fault.detail,
    };
    let switch = |switch: &TracedSwitch| {
        let OutputState { spindle, speed_rpm, flood, mist } = switch.to;
        let spindle = direction(spindle);
        SwitchJson { tick: switch.tick, line: switch.line, spindle, speed_rpm, flood, mist }
    };
    RunJson {
        finished: summary.end == RunEnd::Finished,
        stopped_by: summary.end.stopped_by(),
        reached_mm: summary.reached_mm,
        reached_line: summary.reached_line,
        ticks: summary.ticks,
        tick_s: summary.tick_s,
        planned_time_s: summary.planned_time_s,
        time_s: summary.time_s,
        path_length_mm: summary.path_length_mm,
        max: MaxJson {
            feed_mm_s: summary.max_feed_mm_s,
            accel_mm_s2: summary.max_accel_mm_s2,
            jerk_mm_s3: summary.max_jerk_mm_s3,
            snap_mm_s4: summary.max_snap_mm_s4,
        },
        limit_active_share: summary.limit_active_share,
        axes: summary.axes.iter().map(|of| InUnit(of.unit(), axis(of))).collect(),
        contour_error_um_max: summary.contour_error_um_max,
        probes: summary.probes.iter().map(probe).collect(),
        commands: &summary.commands,
        commands_not_reached: &summary.unreached,
        outputs: summary.outputs.iter().map(switch).collect(),
        faults: summary.faults.iter().map(fault).collect(),
        notices: &summary.notices,
    }
}

/// Writes the run for people.
pub(super) fn write_summary(summary: &RunSummary, out: &mut dyn Write) -> io::Result<()> {
    let RunSummary { ticks, tick_s, planned_time_s, time_s, path_length_mm, .. } = summary;
    let tick_ms = tick_s * 1e3;
    if let Some(words) = summary.end.words() {
        let line = match summary.reached_line {
            0 => String::new(),
            line => format!(", line {line}"),
        };
        writeln!(out, "  {words} at {:.4} of {path_length_mm:.4} mm{line}", summary.reached_mm)?;
    }
    let length_mm = if summary.end == RunEnd::Finished { *path_length_mm } else { summary.reached_mm };
    writeln!(
        out,
        "  {length_mm:.4} mm in {time_s:.4} s (planned {planned_time_s:.6} s), {ticks} ticks of {tick_ms} ms"
    )?;
    writeln!(
        out,
        "  along the path at most: feed {:.3} mm/s ({:.1} mm/min), acceleration {:.2} mm/s², jerk {:.1} mm/s³, snap {:.0} mm/s⁴",
        summary.max_feed_mm_s,
        summary.max_feed_mm_s * 60.0,
        summary.max_accel_mm_s2,
        summary.max_jerk_mm_s3,
        summary.max_snap_mm_s4,
    )?;
    writeln!(out, "  a limit is active on {:.1} % of the length", summary.limit_active_share * 100.0)?;
    writeln!(out, "  contour error at most {:.2} µm\n", summary.contour_error_um_max)?;
    let units = TableUnits::of(summary.axes.iter().map(AxisSummary::unit));
    let error =
        |axis: &AxisSummary, error: f64| units.cell(format!("{error:.2}"), axis.unit().thousandth_symbol());
    let columns = [
        ("axis", "", Align::Left),
        ("following error max", units.head("µm"), Align::Right),
        ("rms", units.head("µm"), Align::Right),
        ("at the end", "counts", Align::Right),
        ("output max", "V", Align::Right),
    ];
    let rows: Vec<[String; 5]> = summary
        .axes
        .iter()
        .map(|axis| {
            [
                axis.name.clone(),
                error(axis, axis.following_error_um_max),
                error(axis, axis.following_error_um_rms),
                axis.end_error_counts.to_string(),
                format!("{:.3}", axis.output_v_max),
            ]
        })
        .collect();
    table::write(&columns, &rows, out)?;
    if let (Some(first), Some(last)) = (summary.outputs.first(), summary.outputs.last()) {
        let (number, tick) = (summary.outputs.len(), first.tick);
        write!(out, "\n  spindle and coolant: {number} switches, the first before tick {tick}")?;
        if last.to == OutputState::OFF {
            writeln!(out, ", all off before tick {}", last.tick)?;
        } else {
            writeln!(out, ", not all off at the end")?;
        }
    }
    let nothing = summary.commands.is_empty() && summary.probes.is_empty();
    if !(nothing && summary.faults.is_empty() && summary.notices.is_empty()) {
        writeln!(out)?;
    }
    for TracedCommand { tick, command, s_mm, stop, .. } in &summary.commands {
        write!(out, "  {command} before tick {tick} ({:.4} s, {s_mm:.4} mm)", *tick as f64 * tick_s)?;
        match stop {
            Some(stop) => writeln!(out, ": at rest after {:.4} s and {:.4} mm", stop.time_s, stop.length_mm)?,
            None => writeln!(out)?,
        }
    }
    for Probed { line, tick, tripped, position_mm, .. } in &summary.probes {
        let tripped = if *tripped { "tripped" } else { "did not trip" };
        let time_s = *tick as f64 * tick_s;
        write!(out, "  line {line}: the probe {tripped}, in tick {tick} ({time_s:.4} s) at")?;
        for (letter, at_mm) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(position_mm) {
            if summary.axes.iter().any(|axis| axis.letter == letter) {
                write!(out, " {letter}{at_mm:.4}")?;
            }
        }
        writeln!(out, " of the machine")?;
    }
    for TracedFault { tick, axis, fault, detail } in &summary.faults {
        let axis = axis.as_ref().map_or_else(String::new, |name| format!(" of axis {name}"));
        writeln!(out, "  FAULT in tick {tick} ({:.4} s): {fault}{axis}: {detail}", *tick as f64 * tick_s)?;
    }
    summary.notices.iter().try_for_each(|notice| writeln!(out, "  note: {notice}"))
}
