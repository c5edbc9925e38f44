//! Files about a run: the trace, written during the run, and the report, written afterwards.

use std::io::{self, Write};
use std::path::PathBuf;

use super::error::{CliError, Outcome};
use super::progress::Progress;
use super::trace::{TraceArguments, TraceWriter};
use super::until_closed::UntilClosed;
use crate::check;
use crate::files::{Failure, Files, FilesError, OutputFile};
use crate::planning::Plan;
use crate::report::{self, Findings, PageRun};
use crate::simulate::{Job, Observer, RunError, RunInfo, RunSummary};
use crate::trace::mcap::McapTicks;
use crate::trace::{RunTrace, TraceRow, TracedProgram};

/// Opens the file of an option, if it is given.
pub(super) fn open(
    files: &mut Files,
    option: &'static str,
    path: Option<&PathBuf>,
) -> Result<Option<OutputFile>, FilesError> {
    path.map(|path| files.output(option, path)).transpose()
}

/// The outcome of writing a command's files. They are written before the results are printed, and the results
/// are printed even if a file fails.
#[derive(Debug, Default)]
pub(super) struct Written {
    files: Vec<(&'static str, String)>,
    failures: Vec<(&'static str, FilesError)>,
    /// The trace has no tick: what it was to begin with has not come.
    has_no_tick: bool,
    /// Why a trace did not get to standard output.
    printed: Option<io::Error>,
}

impl Written {
    /// Writes a file that was asked for.
    pub(super) fn write(
        &mut self,
        what: &'static str,
        output: Option<OutputFile>,
        write: impl FnOnce(&mut OutputFile) -> io::Result<()>,
    ) {
        if let Some(output) = output {
            let name = output.name().to_owned();
            self.add(what, name, output.write_whole(write));
        }
    }

    /// Notes a file that was to be written.
    pub(super) fn add(&mut self, what: &'static str, name: String, done: Result<(), FilesError>) {
        match done {
            Ok(()) => self.files.push((what, name)),
            Err(failure) => self.failures.push((what, failure)),
        }
    }

    /// The path of the file, if it was written.
    pub(super) fn place_of(&self, what: &str) -> Option<&str> {
        self.files.iter().find(|(of, _)| *of == what).map(|(_, name)| name.as_str())
    }

    /// Why the file was not written, if it should have been.
    pub(super) fn failure_of(&self, what: &str) -> Option<String> {
        self.failures.iter().find(|(of, _)| *of == what).map(|(_, failure)| failure.to_string())
    }

    /// Says where files were written.
    pub(super) fn say(&self, out: &mut dyn Write) -> Result<(), CliError> {
        for (what, name) in &self.files {
            writeln!(out, "  {what} written to {name}").map_err(CliError::Output)?;
        }
        if self.has_no_tick {
            let note = "  note: the trace has no tick, because what --from names has not come";
            writeln!(out, "{note}").map_err(CliError::Output)?;
        }
        Ok(())
    }

    /// The command's outcome, unless a file was not written.
    pub(super) fn outcome(self, outcome: Outcome) -> Result<Outcome, CliError> {
        let printed = self.printed.map(|failure| Err(CliError::Output(failure)));
        let failures = self.failures.into_iter().map(|(_, failure)| Err(CliError::Unwritten(failure)));
        CliError::all(printed.into_iter().chain(failures).chain([Ok(outcome)]))
    }
}

/// The files asked for, opened early: a wrong path should not cost the user a long run.
pub(super) struct Outputs {
    trace: Option<TraceOutput>,
    /// What of it.
    of_trace: TraceArguments,
    mcap: Option<OutputFile>,
    report: Option<OutputFile>,
    /// What the report shows of the program.
    program: Option<TracedProgram>,
    /// The run that the report shows beside it.
    against: Option<PageRun>,
    /// What it shows below.
    below: Option<Findings>,
}

/// Where a trace goes.
enum TraceOutput {
    File(OutputFile),
    Standard(UntilClosed<io::Stdout>),
}

impl TraceOutput {
    /// A file gets its name.
    fn commit(self) -> Result<(), FilesError> {
        match self {
            Self::File(file) => file.commit(),
            Self::Standard(_) => Ok(()),
        }
    }
}

impl Write for TraceOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Standard(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Standard(out) => out.flush(),
        }
    }
}

impl Outputs {
    /// A trace on standard output leaves no place for JSON there.
    pub(super) fn open(
        files: &mut Files,
        of_trace: &TraceArguments,
        report: Option<&PathBuf>,
        is_json: bool,
    ) -> Result<Self, CliError> {
        let trace = if of_trace.is_standard() {
            if is_json {
                let found = "--trace - with --json".to_owned();
                return Err(CliError::Arguments { found, expected: "one of them on standard output" });
            }
            Some(TraceOutput::Standard(UntilClosed::new(io::stdout())))
        } else {
            open(files, "--trace", of_trace.trace.as_ref())?.map(TraceOutput::File)
        };
        let mcap = open(files, "--mcap", of_trace.mcap.as_ref())?;
        let report = open(files, "--report", report)?;
        Ok(Self {
            trace,
            of_trace: of_trace.clone(),
            mcap,
            report,
            program: None,
            against: None,
            below: None,
        })
    }

    /// Where the rest of a command's output goes: to standard error, where the trace has standard output.
    pub(super) fn printed<'a>(&self, out: &'a mut dyn Write) -> Box<dyn Write + 'a> {
        match self.trace {
            Some(TraceOutput::Standard(_)) => Box::new(io::stderr()),
            _ => Box::new(out),
        }
    }

    /// Only the report; `role` names its option.
    pub(super) fn report(files: &mut Files, role: &'static str, path: PathBuf) -> Result<Self, FilesError> {
        let (of_trace, report) = (TraceArguments::default(), open(files, role, Some(&path))?);
        Ok(Self { trace: None, of_trace, mcap: None, report, program: None, against: None, below: None })
    }

    /// With the program's text, and where the time of its plan goes.
    pub(super) fn of_program<const N: usize>(mut self, text: &[u8], plan: &Plan<N>) -> Self {
        self.program = Some(check::traced(text, plan));
        self
    }

    /// With another run beside it.
    pub(super) fn against(mut self, run: PageRun) -> Self {
        self.against = Some(run);
        self
    }

    /// Whether a report was asked for.
    pub(super) fn has_report(&self) -> bool {
        self.report.is_some()
    }

    /// With findings below the run.
    pub(super) fn below(mut self, findings: Findings) -> Self {
        self.below = Some(findings);
        self
    }

    /// Runs a job with `run` and writes the files about it. A run that can't be made leaves no files.
    pub(super) fn of_run<const N: usize, T>(
        mut self,
        job: &Job<N>,
        run: impl FnOnce(&mut Observer<'_, N>) -> Result<T, RunError>,
        summary_of: impl Fn(&T) -> &RunSummary,
    ) -> Result<(T, Written), CliError> {
        let source = self.program.take();
        let (ran, ticks) = self.of_ticks(&job.info, |observe: &mut Observer<'_, N>| {
            let mut progress = Progress::new((job.info.planned_time_s / job.info.tick_s) as u64);
            let ran = run(&mut |tick| {
                observe(tick);
                progress.tick();
            });
            progress.finish();
            ran
        })?;
        let ran = ran.map_err(|source| CliError::Run { program: job.info.program.clone(), source })?;
        let written = ticks.write(|ticks| RunTrace { source, ..job.trace(summary_of(&ran), ticks) });
        Ok((ran, written))
    }

    /// Writes the files about an existing trace.
    pub(super) fn of_trace<const N: usize>(
        self,
        info: &RunInfo,
        trace: &RunTrace<N>,
    ) -> Result<Written, CliError> {
        let ((), ticks) = self.of_ticks(info, |observe| trace.ticks.iter().for_each(observe))?;
        Ok(ticks.write(|ticks| RunTrace { ticks, ..trace.clone() }))
    }

    /// Returns the result of `run`, and its ticks, from which the files are to be written.
    pub(super) fn of_ticks<const N: usize, T>(
        self,
        info: &RunInfo,
        run: impl FnOnce(&mut Observer<'_, N>) -> T,
    ) -> Result<(T, Ticks<N>), CliError> {
        let selection = self.of_trace.selection(info)?;
        let trace = self.trace.map(|output| {
            let named = match &output {
                TraceOutput::File(file) => Some((file.name().to_owned(), file.failure())),
                TraceOutput::Standard(_) => None,
            };
            (named, TraceWriter::new(output, info, selection))
        });
        let mcap = self.mcap.map(|file| {
            let named = (file.name().to_owned(), file.failure());
            (named, McapTicks::new(file, info))
        });
        let (report, against, below) = (self.report, self.against, self.below);
        let mut ticks = Ticks { trace, mcap, report, against, below, ticks: Vec::new() };
        let ran = run(&mut |tick| ticks.add(tick));
        Ok((ran, ticks))
    }
}

/// The name of a trace's file, and what tells of a failure there.
type TraceFile = (String, Failure);

/// The ticks of a run. Only a report needs all of them at once.
pub(super) struct Ticks<const N: usize> {
    /// With the file that it is written to, if it is.
    trace: Option<(Option<TraceFile>, TraceWriter<TraceOutput>)>,
    mcap: Option<(TraceFile, io::Result<McapTicks<OutputFile, N>>)>,
    report: Option<OutputFile>,
    against: Option<PageRun>,
    below: Option<Findings>,
    ticks: Vec<TraceRow<N>>,
}

impl<const N: usize> Ticks<N> {
    fn add(&mut self, tick: &TraceRow<N>) {
        if let Some((_, trace)) = &mut self.trace {
            trace.add(tick);
        }
        if let Some((_, Ok(mcap))) = &mut self.mcap {
            mcap.add(tick);
        }
        if self.report.is_some() {
            self.ticks.push(*tick);
        }
    }

    /// Writes the trace, and the report of the ticks as converted by `trace`.
    pub(super) fn write(self, trace: impl FnOnce(Vec<TraceRow<N>>) -> RunTrace<N>) -> Written {
        let mut written = Written::default();
        if let Some((named, writer)) = self.trace {
            written.has_no_tick = writer.has_not_begun();
            match (named, writer.finish()) {
                (Some((name, failure)), done) => {
                    let done = done.map_err(|source| failure.of(source));
                    written.add("trace", name, done.and_then(TraceOutput::commit));
                }
                (None, Ok(mut out)) => written.printed = out.flush().err(),
                (None, Err(source)) => written.printed = Some(source),
            }
        }
        if let Some(((name, failure), begun)) = self.mcap {
            let done = begun.and_then(McapTicks::finish).map_err(|source| failure.of(source));
            written.add("MCAP", name, done.and_then(OutputFile::commit));
        }
        let (ticks, against, below) = (self.ticks, self.against, self.below);
        written.write("report", self.report, |file| {
            report::write_html(&trace(ticks), against.as_ref(), below, file)
        });
        written
    }
}
