//! `motion replay`: runs a recording again, from the recording alone.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::input::{self, Source};
use super::outputs::Outputs;
use super::run::{self, RunJson};
use super::trace::TraceArguments;
use super::write_json;
use crate::files::Files;
use crate::gcode::AXES_MAX;
use crate::recording::{self, Difference, Recording};

const EXAMPLES: &str = "\
Examples:
  motion run part.ngc --record part.mrec             record a run, with its faults and commands
  motion replay part.mrec                            run it again and compare every tick
  motion replay part.mrec --trace part.csv --report part.html
                                                     with files that were not written then

The kernel gets the recorded program, machine, commands and answers of the hardware; nothing is simulated. Trace and
report are those of the run.

Exit status: 0 identical, even if the run was held, aborted or ended by a fault; 1 a tick differs; 2 the file is no
recording, or is damaged; 6 a file could not be written.
JSON: that of `motion run`, and replay: identical, ticks (those of settling included), digest, difference.";

/// Replay a recorded run: the same kernel with the recorded inputs, compared tick by tick.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ReplayArguments {
    /// A file that `motion run --record` wrote (`-`: standard input).
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    #[command(flatten)]
    trace: TraceArguments,
    /// Write a self-contained HTML page about the run; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Reads, runs again, compares.
///
/// # Errors
/// The file is no recording, what it holds can't be executed, or a file can't be written.
pub fn replay(arguments: &ReplayArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([("FILE", Some(arguments.recording.as_path()))]);
    let outputs = Outputs::open(&mut files, &arguments.trace, arguments.report.as_ref(), arguments.json)?;
    let mut printed = outputs.printed(out);
    let out = &mut *printed;
    let source = input::read(&arguments.recording)?;
    let refused = |error| CliError::Recording { path: source.name.clone(), source: error };
    match recording::places(&source.text).map_err(refused)? {
        AXES_MAX => again::<AXES_MAX>(arguments, &source, outputs, out),
        _ => again::<3>(arguments, &source, outputs, out),
    }
}

/// Runs a recording of a machine with `N` places again.
fn again<const N: usize>(
    arguments: &ReplayArguments,
    source: &Source,
    outputs: Outputs,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    let refused = |error| CliError::Recording { path: source.name.clone(), source: error };
    let recording = Recording::<N>::from_bytes(&source.text).map_err(refused)?;
    let job = recording.job();
    let (replayed, written) = outputs.of_run(
        job,
        |observe| recording::replay(&recording, job, observe),
        |replayed| &replayed.summary,
    )?;
    let recording::Replay { summary, ticks, difference } = &replayed;
    if arguments.json {
        let figures = ReplayJson {
            identical: difference.is_none(),
            ticks: *ticks,
            digest: format!("{:016x}", recording.digest()),
            difference: difference.as_ref().map(Difference::to_string),
        };
        write_json(&Json { run: run::json(summary), replay: figures }, out)?;
    } else {
        run::write_summary(summary, out).map_err(CliError::Output)?;
        let verdict = match difference {
            None => format!("identical over {ticks} ticks, digest {:016x}", recording.digest()),
            Some(difference) => format!("NOT IDENTICAL: the replay {difference}"),
        };
        writeln!(out, "\n  {verdict}").map_err(CliError::Output)?;
        written.say(out)?;
    }
    written.outcome(if difference.is_none() { Outcome::Done } else { Outcome::Failed })
}

#[derive(Serialize)]
struct Json<'run> {
    #[serde(flatten)]
    run: RunJson<'run>,
    replay: ReplayJson,
}

#[derive(Serialize)]
struct ReplayJson {
    identical: bool,
    ticks: u64,
    digest: String,
    difference: Option<String>,
}
