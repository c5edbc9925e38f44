//! Every tick of a board in a trace file, or those around a trigger.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;

use super::error::{CliError, Outcome};
use super::outputs::{self, Written};
use super::port::PortArguments;
use super::trace::{Selection, TraceWriter};
use crate::board::scope::{Scope, ScopeSummary, Ticks};
use crate::board::trigger::{Around, Condition};
use crate::board::{BoardError, Connection, parameters};
use crate::files::{Failure, Files, OutputFile};
use crate::simulate::RunInfo;
use crate::trace::TraceRow;

/// The last ticks come within this time.
const LATE: Duration = Duration::from_secs(1);

/// What is to be written of every tick.
#[derive(Clone, Debug, Args)]
pub(super) struct ScopeArguments {
    /// Write every tick of the board to this file, one row each, as `motion run --trace` does; an existing file is replaced.
    #[arg(long, value_name = "FILE")]
    scope: Option<PathBuf>,
    /// Write only ticks around those where this is true: COLUMN>VALUE or COLUMN<VALUE for the magnitude in a column of
    /// the file, such as `X_err_um>50`, or `err_um>50` for any axis; or state=NAME.
    #[arg(long, value_name = "CONDITION", requires = "scope")]
    trigger: Option<Condition>,
    /// So many ticks before them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    before: usize,
    /// So many ticks after them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    after: usize,
}

/// The file being written.
struct ScopeFile<W: Write, const N: usize> {
    trace: TraceWriter<W>,
    /// Which ticks are written; without it, all.
    around: Option<Around<N>>,
}

impl<W: Write, const N: usize> ScopeFile<W, N> {
    fn add(&mut self, row: &TraceRow<N>) {
        let Self { trace, around } = self;
        match around {
            Some(around) => around.take(row, &mut |row| trace.add(row)),
            None => trace.add(row),
        }
    }
}

/// A scope under way, and its file.
pub(super) struct Scoped<const N: usize> {
    file: Arc<Mutex<ScopeFile<OutputFile, N>>>,
    name: String,
    failure: Failure,
}

impl ScopeArguments {
    /// Starts the scope, if it is asked for, before the first item is sent. No file of `inputs` is replaced. `info` names the board's axes.
    ///
    /// # Errors
    /// The file can't be written, there is no axis of the trigger's name, or the board does not answer.
    pub(super) fn start<const N: usize>(
        &self,
        inputs: &[(&'static str, Option<&Path>)],
        info: &RunInfo,
        port: &PortArguments,
        connection: &mut Connection<N>,
    ) -> Result<Option<Scoped<N>>, CliError> {
        let mut files = Files::reading(inputs.iter().copied());
        let Some(output) = outputs::open(&mut files, "--scope", self.scope.as_ref())? else {
            return Ok(None);
        };
        let names: Vec<String> = info.axes.iter().map(|axis| axis.name.clone()).collect();
        if let Some(trigger) = self.trigger.as_ref().filter(|trigger| !trigger.suits(&names)) {
            let found = format!("--trigger {trigger}");
            return Err(CliError::Arguments { found, expected: "an axis of the machine" });
        }
        let refused = |error: BoardError| port.refused(error);
        let record = parameters::read(connection).map_err(refused)?;
        let (name, failure) = (output.name().to_owned(), output.failure());
        let file = Arc::new(Mutex::new(ScopeFile {
            trace: TraceWriter::new(output, info, Selection::all(info)),
            around: self.trigger.clone().map(|trigger| Around::new(trigger, names, self.before, self.after)),
        }));
        let shared = Arc::clone(&file);
        let sink = Box::new(move |told: Ticks<'_, N>| {
            if let Ticks::Row(row) = told {
                lock(&shared).add(row);
            }
        });
        let identity = connection.identity().copied().ok_or_else(|| refused(BoardError::Silent))?;
        let scope = Scope::start(&identity, &record, sink).map_err(|error| refused(error.into()))?;
        connection.set_scope(scope);
        Ok(Some(Scoped { file, name, failure }))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked has said so.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<const N: usize> Scoped<N> {
    /// Ends the scope, once it has come as far as the board has told: writes the file, and says what is in it unless `is_quiet`. `outcome` is that of the command, which fails
    /// where a tick differed.
    pub(super) fn finish(
        self,
        connection: &mut Connection<N>,
        is_quiet: bool,
        outcome: Outcome,
        out: &mut dyn Write,
    ) -> Result<Outcome, CliError> {
        let (begin, until) = (Instant::now(), connection.status().map(|status| status.tick));
        let is_behind = |connection: &Connection<N>| {
            // Numbers wrap.
            let is_before = |last: u64, tick: u32| (last as u32).wrapping_sub(tick).cast_signed() < 0;
            let last = connection.scope().filter(|scope| !scope.has_failed()).map(Scope::last);
            last.zip(until).is_some_and(|(last, tick)| is_before(last, tick))
        };
        while is_behind(connection) && !connection.is_lost() && begin.elapsed() < LATE {
            connection.step(Duration::from_millis(5), &mut |_| {});
        }
        let summary = connection.end_scope().unwrap_or_default();
        let file = Arc::into_inner(self.file).expect("the thread has ended");
        let ScopeFile { trace, around } = file.into_inner().unwrap_or_else(PoisonError::into_inner);
        let triggers = around.map(|around| around.triggers());
        let mut written = Written::default();
        let done = trace.finish().map_err(|source| self.failure.of(source));
        written.add("scope", self.name, done.and_then(OutputFile::commit));
        if !is_quiet {
            told(&summary, triggers, out).map_err(CliError::Output)?;
            written.say(out)?;
        }
        if is_quiet {
            let line = json(&summary, triggers);
            writeln!(out, "{line}").map_err(CliError::Output)?;
        }
        let outcome = match summary.error {
            Some(error) => {
                if !is_quiet {
                    writeln!(out, "  scope: {error}").map_err(CliError::Output)?;
                }
                Outcome::Failed
            }
            None => outcome,
        };
        written.outcome(outcome)
    }
}

/// What a scope has come to, for scripts.
fn json(summary: &ScopeSummary, triggers: Option<u64>) -> serde_json::Value {
    serde_json::json!({ "scope": {
        "ticks": summary.ticks,
        "missing": summary.missing(),
        "gaps": summary.gaps,
        "bytes": summary.bytes,
        "is_foreign": summary.is_foreign,
        "triggered": triggers,
        "error": summary.error.as_ref().map(ToString::to_string),
    } })
}

/// What a scope has come to, in words.
fn told(summary: &ScopeSummary, triggers: Option<u64>, out: &mut dyn Write) -> io::Result<()> {
    let ScopeSummary { ticks, gaps, bytes, is_foreign, .. } = summary;
    let of_tick = if *ticks > 0 { *bytes as f64 / *ticks as f64 } else { 0.0 };
    writeln!(out, "  scope: {ticks} ticks, {} missing, {of_tick:.1} bytes a tick", summary.missing())?;
    for (first, last) in gaps {
        writeln!(out, "  scope: ticks {first} to {last} are missing")?;
    }
    if *is_foreign {
        writeln!(out, "  scope: some of these followed items that were sent by somebody else")?;
    }
    if let Some(triggers) = triggers {
        writeln!(out, "  scope: triggered {triggers} times")?;
    }
    Ok(())
}
