//! `motion watch`: what a board does.

use std::io::Write;
use std::time::{Duration, Instant};

use clap::Args;
use motion_kernel::link::{Event, Status};
use motion_kernel::units::Position;

use super::error::{CliError, Outcome};
use super::parameters::identity;
use super::port::PortArguments;
use super::scope::ScopeArguments;
use crate::board::interface::state_words;
use crate::board::{BoardError, Connection, Heard, Scope};
use crate::files::interrupt;
use crate::gcode::Axis;
use crate::planning::on_axis_count;
use crate::simulate::{RunInfo, SheetAxis, faults};

const EXAMPLES: &str = "\
Examples:
  motion watch --port /dev/ttyACM0                   a line for every change, and every second
  motion watch --port tcp:localhost:5000 --json      lines of JSON: {tick, state, line, set_mm, actual_mm, feed_mm_s, taken,
                                                     starvations, is_ready, fault}
  motion watch --port /dev/ttyACM0 --seconds 10 --scope ticks.csv
                                                     every tick, of a machine at rest or in the hand

Commands nothing. A wire has one end: while it watches, nobody else can send, and while somebody sends it finds no answer.
Ctrl-C ends it.";

/// Show what a board does.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct WatchArguments {
    #[command(flatten)]
    port: PortArguments,
    #[command(flatten)]
    scope: ScopeArguments,
    /// End after this time, s; without it, only Ctrl-C ends it.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Print lines of JSON.
    #[arg(long)]
    json: bool,
}

/// Greets the board, and shows what it tells.
///
/// # Errors
/// There is no board, or it is lost.
pub fn watch(arguments: &WatchArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let identity = identity(&arguments.port)?;
    let [major, minor, patch] = identity.build.kernel;
    let header = format!(
        "kernel {major}.{minor}.{patch}, {} axes, {}, {} ticks/s, machine {:08x}",
        identity.axes,
        if identity.is_fixed_point { "fixed point" } else { "f32" },
        (1.0 / identity.tick_s).round(),
        identity.machine
    );
    if !arguments.json {
        writeln!(out, "{header}").map_err(CliError::Output)?;
    }
    on_axis_count!(usize::from(identity.axes), M => show::<M>(arguments, identity.tick_s, out))
}

fn show<const M: usize>(
    arguments: &WatchArguments,
    tick_s: f64,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let mut connection: Connection<M> = arguments.port.open()?;
    connection.greet().map_err(|error| arguments.port.refused(error))?;
    let scoped = arguments.scope.start(&[], &info(M, tick_s), &arguments.port, &mut connection)?;
    if scoped.is_some() {
        // Its file is finished first.
        interrupt::hold_first();
    }
    let (begin, mut last, mut told) = (Instant::now(), None, Instant::now());
    while arguments.seconds.is_none_or(|seconds| begin.elapsed().as_secs_f64() < seconds) {
        let (mut lost, mut is_new) = (None, false);
        connection.step(Duration::from_millis(20), &mut |heard| match heard {
            Heard::Lost(cause) => lost = Some(BoardError::Wire(std::io::Error::other(cause))),
            Heard::Board(Event::Replaced) => lost = Some(BoardError::Replaced),
            Heard::Board(Event::Restarted { .. }) => is_new = true,
            _ => {}
        });
        if is_new {
            connection.accept();
            if !arguments.json {
                writeln!(out, "the board has started anew").map_err(CliError::Output)?;
            }
        }
        if connection.scope().is_some_and(Scope::has_failed) || interrupt::take_asked().is_some() {
            break;
        }
        if let Some(cause) = lost {
            return Err(arguments.port.refused(cause));
        }
        let Some(status) = connection.status() else { continue };
        let now = (status.state, status.line, status.fault.map(|fault| fault.tick));
        if last == Some(now) && told.elapsed() < Duration::from_secs(1) {
            continue;
        }
        (last, told) = (Some(now), Instant::now());
        line(arguments, status, out).and_then(|()| out.flush()).map_err(CliError::Output)?;
    }
    match scoped {
        Some(scoped) => scoped.finish(&mut connection, arguments.json, Outcome::Done, out),
        None => Ok(Outcome::Done),
    }
}

/// A board's axes have no names.
fn info(axes: usize, tick_s: f64) -> RunInfo {
    let axis = |number: usize| SheetAxis {
        name: format!("axis{number}"),
        letter: Axis::X,
        feed_mm_s: 0.0,
        accel_mm_s2: 0.0,
        jerk_mm_s3: 0.0,
    };
    RunInfo { tick_s, axes: (1..=axes).map(axis).collect(), ..RunInfo::default() }
}

fn line<const M: usize>(
    arguments: &WatchArguments,
    status: &Status<M>,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let fault = status.fault.map(|fault| faults::told(&fault.kind, |axis| format!("axis {}", axis + 1)));
    let mm = |positions: &[Position; M]| positions.map(Position::to_mm).to_vec();
    if arguments.json {
        let line = serde_json::json!({
            "tick": status.tick,
            "state": state_words(status.state),
            "line": status.line,
            "set_mm": mm(&status.set),
            "actual_mm": mm(&status.actual),
            "feed_mm_s": status.feed_mm_s,
            "taken": status.taken,
            "starvations": status.starvations,
            "is_ready": status.is_ready,
            "fault": fault,
        });
        return writeln!(out, "{line}");
    }
    let position: Vec<String> = mm(&status.set).iter().map(|mm| format!("{mm:.3}")).collect();
    let fault = fault.map_or_else(String::new, |fault| format!("; fault: {fault}"));
    writeln!(
        out,
        "tick {}: {}, line {} at {} mm, {:.1} mm/s{fault}",
        status.tick,
        state_words(status.state),
        status.line,
        position.join(" "),
        status.feed_mm_s
    )
}
