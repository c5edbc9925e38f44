//! Every tick of a board in a trace file or on a page, or those around a trigger.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::{ArgGroup, Args};

use super::error::{CliError, Outcome};
use super::outputs::{self, Written};
use super::port::PortArguments;
use super::trace::{Selection, TraceWriter};
use crate::board::scope::{Scope, ScopeSummary, Ticks};
use crate::board::trigger::{Around, Condition};
use crate::board::{BoardError, Connection, parameters};
use crate::files::{Failure, Files, OutputFile};
use crate::report;
use crate::simulate::RunInfo;
use crate::trace::{RunTrace, TraceRow};

/// The last ticks come within this time.
const LATE: Duration = Duration::from_secs(1);
/// Ticks that a page has at most: five minutes of 2 kHz, which take some 200 MB until it is written.
const PAGE_TICKS_MAX: usize = 600_000;

/// What is to be written of every tick.
#[derive(Clone, Debug, Args)]
#[command(group(ArgGroup::new("ticks").multiple(true)))]
pub(super) struct ScopeArguments {
    /// Write every tick of the board to this file, one row each, as `motion run --trace` does; an existing file is replaced.
    #[arg(long, value_name = "FILE", group = "ticks")]
    scope: Option<PathBuf>,
    /// Write a self-contained HTML page of every tick of the board, 600 000 at most; an existing file is replaced.
    #[arg(long, value_name = "FILE.html", group = "ticks")]
    report: Option<PathBuf>,
    /// Write only ticks around those where this is true: COLUMN>VALUE or COLUMN<VALUE for the magnitude in a column of
    /// the file, such as `X_err_um>50`, or `err_um>50` for any axis; or state=NAME.
    #[arg(long, value_name = "CONDITION", requires = "ticks")]
    trigger: Option<Condition>,
    /// So many ticks before them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    before: usize,
    /// So many ticks after them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    after: usize,
}

/// The files being written.
struct ScopeFiles<W: Write, const N: usize> {
    trace: Option<TraceWriter<W>>,
    page: Option<PageTicks<N>>,
    /// Which ticks are written; without it, all.
    around: Option<Around<N>>,
}

/// The ticks of a page.
#[derive(Default)]
struct PageTicks<const N: usize> {
    ticks: Vec<TraceRow<N>>,
    /// How many there was no room for.
    dropped: u64,
}

impl<W: Write, const N: usize> ScopeFiles<W, N> {
    fn add(&mut self, row: &TraceRow<N>) {
        let Self { trace, page, around } = self;
        let mut write = |row: &TraceRow<N>| {
            if let Some(trace) = trace {
                trace.add(row);
            }
            match page {
                Some(page) if page.ticks.len() < PAGE_TICKS_MAX => page.ticks.push(*row),
                Some(page) => page.dropped += 1,
                None => {}
            }
        };
        match around {
            Some(around) => around.take(row, &mut write),
            None => write(row),
        }
    }
}

impl<const N: usize> PageTicks<N> {
    /// As a run; what is missing in it is named.
    fn trace(
        self,
        program: String,
        info: &RunInfo,
        summary: &ScopeSummary,
        trigger: Option<&Condition>,
    ) -> RunTrace<N> {
        let triggered = trigger.map(|trigger| format!("only ticks around those with {trigger}"));
        let missing = summary.gaps.iter().map(|(first, last)| format!("ticks {first} to {last} are missing"));
        let dropped =
            (self.dropped > 0).then(|| format!("{} ticks after these had no room here", self.dropped));
        let notices = triggered.into_iter().chain(missing).chain(dropped).collect();
        RunTrace { program, notices, ticks: self.ticks, ..info.empty_trace() }
    }
}

/// A scope under way, and its files.
pub(super) struct Scoped<const N: usize> {
    files: Arc<Mutex<ScopeFiles<OutputFile, N>>>,
    /// The trace's name, and what tells of a failure there.
    trace: Option<(String, Failure)>,
    page: Option<OutputFile>,
    /// What the page shows, in words.
    program: String,
    info: RunInfo,
    trigger: Option<Condition>,
}

impl ScopeArguments {
    /// Starts the scope, if it is asked for, before the first item is sent. No file of `inputs` is replaced. `info` names the board's axes.
    ///
    /// # Errors
    /// A file can't be written, there is no axis of the trigger's name, or the board does not answer.
    pub(super) fn start<const N: usize>(
        &self,
        inputs: &[(&'static str, Option<&Path>)],
        info: &RunInfo,
        port: &PortArguments,
        connection: &mut Connection<N>,
    ) -> Result<Option<Scoped<N>>, CliError> {
        let mut files = Files::reading(inputs.iter().copied());
        let output = outputs::open(&mut files, "--scope", self.scope.as_ref())?;
        let page = outputs::open(&mut files, "--report", self.report.as_ref())?;
        if output.is_none() && page.is_none() {
            return Ok(None);
        }
        let names: Vec<String> = info.axes.iter().map(|axis| axis.name.clone()).collect();
        if let Some(trigger) = self.trigger.as_ref().filter(|trigger| !trigger.suits(&names)) {
            let found = format!("--trigger {trigger}");
            return Err(CliError::Arguments { found, expected: "an axis of the machine" });
        }
        let refused = |error: BoardError| port.refused(error);
        let record = parameters::read(connection).map_err(refused)?;
        let trace = output.as_ref().map(|output| (output.name().to_owned(), output.failure()));
        let files = Arc::new(Mutex::new(ScopeFiles {
            trace: output.map(|output| TraceWriter::new(output, info, Selection::all(info))),
            page: page.as_ref().map(|_| PageTicks::default()),
            around: self.trigger.clone().map(|trigger| Around::new(trigger, names, self.before, self.after)),
        }));
        let shared = Arc::clone(&files);
        let sink = Box::new(move |told: Ticks<'_, N>| {
            if let Ticks::Row(row) = told {
                lock(&shared).add(row);
            }
        });
        let identity = connection.identity().copied().ok_or_else(|| refused(BoardError::Silent))?;
        let scope = Scope::start(&identity, &record, sink).map_err(|error| refused(error.into()))?;
        connection.set_scope(scope);
        let program = format!("ticks of the board at {}", port.port);
        Ok(Some(Scoped { files, trace, page, program, info: info.clone(), trigger: self.trigger.clone() }))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked has said so.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<const N: usize> Scoped<N> {
    /// Ends the scope, once it has come as far as the board has told: writes the files, and says what is in them unless `is_quiet`. `outcome` is that of the command, which fails
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
        let files = Arc::into_inner(self.files).expect("the thread has ended");
        let ScopeFiles { trace, page, around } = files.into_inner().unwrap_or_else(PoisonError::into_inner);
        let triggers = around.map(|around| around.triggers());
        let mut written = Written::default();
        if let Some((trace, (name, failure))) = trace.zip(self.trace) {
            let done = trace.finish().map_err(|source| failure.of(source));
            written.add("scope", name, done.and_then(OutputFile::commit));
        }
        if let Some(page) = page {
            let trace = page.trace(self.program, &self.info, &summary, self.trigger.as_ref());
            written.write("report", self.page, |file| report::write_html(&trace, None, None, file));
        }
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
