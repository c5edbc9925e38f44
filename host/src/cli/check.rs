//! `motion check`: whether a program runs on the machine, what it needs, how long it takes, and why.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::input::{self, Source};
use super::read;
use super::table::{self, Align};
use super::write_json;
use crate::axis_unit::AxisUnit;
use crate::check::needs::system_word;
use crate::check::{Check, Reason, check};
use crate::gcode::{Axis, Program, Refusal};
use crate::machine::{Machine, on_machine};
use crate::planning::PlanningError;

const EXAMPLES: &str = "\
Examples:
  motion check part.ngc                          every refusal at once, or time, needs and advice
  motion check part.ngc --machine mine.toml --tools mill.tbl
  generate-part | motion check - --json          for a script

Exit status: 0 the program is accepted, 2 it is refused.

JSON: accepted, refusals (source, line, column or null, lines, problem); of an accepted program also steps, blocks, length_mm, time_s,
extent_mm (least and greatest X, Y, Z at the ends of moves, and of the machine's other
axes in the order A B C U V W, ° for A, B and C), needs (tools, tools_assumed, systems, outputs), corner_stops,
operator_stops, time_by_reason (seconds: programmed, machine, acceleration, jerk, snap, feed change, corner, stop, dwell),
advice, notices.";

/// Check a program: list all refusals, or what it needs and where its time goes.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct CheckArguments {
    /// G-code (`-`: standard input).
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct CheckJson<'a> {
    accepted: bool,
    refusals: Vec<RefusalJson<'a>>,
    #[serde(flatten)]
    accepted_program: Option<AcceptedJson<'a>>,
}

#[derive(Serialize)]
struct RefusalJson<'a> {
    source: &'a str,
    line: u32,
    /// Planning knows lines only.
    column: Option<u32>,
    lines: usize,
    problem: String,
}

#[derive(Serialize)]
struct AcceptedJson<'a> {
    steps: usize,
    blocks: usize,
    length_mm: f64,
    time_s: f64,
    extent_mm: Option<Vec<[f64; 2]>>,
    needs: NeedsJson<'a>,
    corner_stops: usize,
    operator_stops: usize,
    time_by_reason: serde_json::Map<String, serde_json::Value>,
    advice: &'a [String],
    notices: &'a [String],
}

#[derive(Serialize)]
struct NeedsJson<'a> {
    tools: &'a [u32],
    tools_assumed: &'a [u32],
    systems: Vec<&'static str>,
    outputs: &'a [&'static str],
}

/// Checks and prints.
///
/// # Errors
/// The program or the machine file is refused, or `out` can't be written.
pub fn run(arguments: &CheckArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.program)?;
    let options = arguments.reading.options(machine.read_options())?;
    match source.program(&options) {
        Ok(program) => on_machine!(machine, machine => accepted(arguments, &source, &program, machine, out)),
        Err(_) => {
            let refusals = source.refusals(&options);
            refused(arguments, &source.name, refusals.iter().map(refusal_json).collect(), out)
        }
    }
}

fn accepted<const N: usize>(
    arguments: &CheckArguments,
    source: &Source,
    program: &Program,
    machine: &Machine<N>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let checked = match check(&source.name, program, machine) {
        Ok(checked) => checked,
        Err(error) => {
            let PlanningError { source_name, place, problem } = &error;
            let refusal = RefusalJson {
                source: source_name,
                line: place.line,
                column: place.column,
                lines: 1,
                problem: problem.to_string(),
            };
            return refused(arguments, &source.name, vec![refusal], out);
        }
    };
    if arguments.json {
        let accepted_program = Some(json(program, &checked));
        write_json(&CheckJson { accepted: true, refusals: Vec::new(), accepted_program }, out)?;
    } else {
        write_check(&source.name, program, &checked, out).map_err(CliError::Output)?;
    }
    Ok(Outcome::Done)
}

fn refused(
    arguments: &CheckArguments,
    name: &str,
    refusals: Vec<RefusalJson<'_>>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let (kinds, lines) = (refusals.len(), refusals.iter().map(|refusal| refusal.lines).sum::<usize>());
    if arguments.json {
        write_json(&CheckJson { accepted: false, refusals, accepted_program: None }, out)?;
    } else {
        write_refusals(&refusals, out).map_err(CliError::Output)?;
    }
    let found = match (kinds, lines) {
        (1, 1) => "1 refusal".to_owned(),
        (1, lines) => format!("1 refusal in {lines} lines"),
        (kinds, lines) => format!("{kinds} refusals in {lines} lines"),
    };
    Err(CliError::Refused { programs: vec![format!("{name}: found {found}, expected none")] })
}

fn refusal_json(refusal: &Refusal) -> RefusalJson<'_> {
    let Refusal { first, lines } = refusal;
    RefusalJson {
        source: &first.source_name,
        line: first.line,
        column: Some(first.column),
        lines: *lines,
        problem: first.problem.to_string(),
    }
}

fn json<'a, const N: usize>(program: &'a Program, checked: &'a Check<N>) -> AcceptedJson<'a> {
    let Check { plan, needs, times, advice } = checked;
    let by_reason = Reason::ALL.map(|reason| (reason.name().to_owned(), times.of_reason_s(reason).into()));
    AcceptedJson {
        steps: program.steps.len(),
        blocks: plan.blocks.len(),
        length_mm: plan.length_mm,
        time_s: plan.time_s,
        extent_mm: needs
            .extent
            .map(|extent| read::shown_axes(program.axes).map(|axis| extent[axis.index()]).collect()),
        needs: NeedsJson {
            tools: &needs.tools,
            tools_assumed: &program.tools_assumed,
            systems: needs.systems.iter().map(|&system| system_word(system)).collect(),
            outputs: &needs.outputs,
        },
        corner_stops: times.corner_stops,
        operator_stops: times.operator_stops,
        time_by_reason: by_reason.into_iter().collect(),
        advice,
        notices: &plan.notices,
    }
}

fn write_refusals(refusals: &[RefusalJson<'_>], out: &mut dyn Write) -> io::Result<()> {
    let columns = [("lines", "", Align::Right), ("first", "", Align::Left), ("problem", "", Align::Left)];
    let row = |refusal: &RefusalJson<'_>| {
        let RefusalJson { source, line, column, lines, problem } = refusal;
        let column = column.map_or_else(String::new, |column| format!(":{column}"));
        [lines.to_string(), format!("{source}:{line}{column}"), problem.clone()]
    };
    let rows: Vec<[String; 3]> = refusals.iter().map(row).collect();
    table::write(&columns, &rows, out)
}

fn write_check<const N: usize>(
    name: &str,
    program: &Program,
    checked: &Check<N>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let Check { plan, needs, times, advice } = checked;
    writeln!(out, "{name} is accepted: {}, {:.3} mm", duration(plan.time_s), plan.length_mm)?;
    let stops = |count: usize, one: &str, more: &str| match count {
        0 => String::new(),
        1 => format!(", 1 {one}"),
        count => format!(", {count} {more}"),
    };
    let at_corners = stops(times.corner_stops, "full stop at a corner", "full stops at corners");
    let for_operator = stops(times.operator_stops, "stop for the operator", "stops for the operator");
    writeln!(out, "  {} steps, {} blocks{at_corners}{for_operator}", program.steps.len(), plan.blocks.len())?;
    if let Some(extent) = needs.extent {
        let of_axis = |axis: Axis| {
            let [low, high] = extent[axis.index()];
            format!("{axis} {low:.3} to {high:.3} {}", AxisUnit::of(axis).symbol())
        };
        let axes: Vec<String> = program.axes.iter().map(of_axis).collect();
        writeln!(out, "  machine coordinates: {}", axes.join(", "))?;
    }
    let mut list = |what: &str, items: Vec<String>| match items.len() {
        0 => Ok(()),
        _ => writeln!(out, "  {what}: {}", items.join(", ")),
    };
    let word = |&system: &u32| system_word(system).to_owned();
    list("coordinate systems", needs.systems.iter().map(word).collect())?;
    list("tools", needs.tools.iter().map(|tool| format!("T{tool}")).collect())?;
    list("switches", needs.outputs.iter().map(|&output| output.to_owned()).collect())?;
    writeln!(out)?;
    let columns = [("time", "s", Align::Right), ("", "%", Align::Right), ("spent", "", Align::Left)];
    let total_s = plan.time_s;
    let rows: Vec<[String; 3]> = Reason::ALL
        .into_iter()
        .map(|reason| (reason, times.of_reason_s(reason)))
        .filter(|(_, time_s)| *time_s > 0.0)
        .map(|(reason, time_s)| {
            let share = format!("{:.1}", 100.0 * time_s / total_s);
            [format!("{time_s:.3}"), share, reason.words().to_owned()]
        })
        .collect();
    if !rows.is_empty() {
        table::write(&columns, &rows, out)?;
        writeln!(out)?;
    }
    advice.iter().try_for_each(|sentence| writeln!(out, "  {sentence}"))?;
    plan.notices.iter().try_for_each(|notice| writeln!(out, "  note: {notice}"))
}

/// A time for people: seconds, from a minute on with minutes and hours.
fn duration(time_s: f64) -> String {
    const MINUTE_S: f64 = 60.0;
    const HOUR_S: f64 = 3600.0;
    // As it is printed, so that no minute has 60 seconds.
    let step_s = if time_s < MINUTE_S - 0.0005 { 0.001 } else { 0.1 };
    let time_s = (time_s / step_s).round() * step_s;
    let (hours, minutes) = ((time_s / HOUR_S).floor(), (time_s % HOUR_S / MINUTE_S).floor());
    if hours > 0.0 {
        format!("{hours} h {minutes} min {:.0} s", (time_s % MINUTE_S).floor())
    } else if minutes > 0.0 {
        format!("{minutes} min {:.1} s", time_s % MINUTE_S)
    } else {
        format!("{time_s:.3} s")
    }
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_are_told_in_the_units_of_people() {
        for (time_s, expected) in [
            (0.5, "0.500 s"),
            (75.23, "1 min 15.2 s"),
            (119.97, "2 min 0.0 s"),
            (59.9997, "1 min 0.0 s"),
            (3600.0, "1 h 0 min 0 s"),
            (7325.9, "2 h 2 min 5 s"),
        ] {
            assert_eq!(duration(time_s), expected);
        }
    }
}
