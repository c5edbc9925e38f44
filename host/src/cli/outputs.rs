//! Files about a run: the trace, written as it goes, and the report afterwards.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use super::error::CliError;
use super::input::Output;
use super::progress::Progress;
use super::trace::TraceWriter;
use crate::report;
use crate::simulate::{Job, Observer, RunError, RunInfo, RunSummary};
use crate::trace::{RunTrace, TraceRow};

/// Files that are asked for, opened: a wrong path should not cost the user a long run.
pub(super) struct Outputs {
    trace: Option<Output>,
    report: Option<Output>,
}

impl Outputs {
    pub(super) fn create(trace: &Option<PathBuf>, report: &Option<PathBuf>) -> Result<Self, CliError> {
        let create = |path: &Option<PathBuf>| path.as_deref().map(Output::create).transpose();
        Ok(Self { trace: create(trace)?, report: create(report)? })
    }

    /// What `run` makes of a job, with the files about it.
    pub(super) fn of_run<T>(
        self,
        job: &Job,
        run: impl FnOnce(&mut Observer<'_>) -> Result<T, RunError>,
        summary_of: impl Fn(&T) -> &RunSummary,
    ) -> Result<T, CliError> {
        let (ran, report) = self.of_ticks(&job.info, |observe| {
            let mut progress = Progress::new((job.info.planned_time_s / job.info.tick_s) as u64);
            let ran = run(&mut |tick| {
                observe(tick);
                progress.tick();
            });
            progress.finish();
            ran
        })?;
        let ran = ran.map_err(|source| CliError::Run { program: job.info.program.clone(), source })?;
        report.write(|ticks| trace_of(job, summary_of(&ran), ticks))?;
        Ok(ran)
    }

    /// The files about a trace that was not made by a run of now.
    pub(super) fn of_trace(self, info: &RunInfo, trace: &RunTrace) -> Result<(), CliError> {
        let ((), report) = self.of_ticks(info, |observe| trace.ticks.iter().for_each(observe))?;
        report.write(|ticks| RunTrace { ticks, ..trace.clone() })
    }

    /// What `run` returns, its ticks traced, and the report that is to be written of them.
    pub(super) fn of_ticks<T>(
        self,
        info: &RunInfo,
        run: impl FnOnce(&mut Observer<'_>) -> T,
    ) -> Result<(T, Report), CliError> {
        let mut files = Files::new(self, info)?;
        let ran = run(&mut |tick| files.add(tick));
        // What was traced of a run that failed stays.
        Ok((ran, files.finish_trace()?))
    }
}

/// Files being written.
struct Files {
    trace: Option<(String, TraceWriter<BufWriter<File>>)>,
    report: Report,
}

/// Only a report needs all the ticks at once.
pub(super) struct Report {
    output: Option<Output>,
    ticks: Vec<TraceRow>,
}

impl Files {
    fn new(outputs: Outputs, info: &RunInfo) -> Result<Self, CliError> {
        let trace = match outputs.trace {
            None => None,
            Some(Output { name, file }) => match TraceWriter::new(file, info) {
                Ok(writer) => Some((name, writer)),
                Err(source) => return Err(CliError::Write { path: name, source }),
            },
        };
        Ok(Self { trace, report: Report { output: outputs.report, ticks: Vec::new() } })
    }

    fn add(&mut self, tick: &TraceRow) {
        if let Some((_, trace)) = &mut self.trace {
            trace.add(tick);
        }
        if self.report.output.is_some() {
            self.report.ticks.push(*tick);
        }
    }

    fn finish_trace(self) -> Result<Report, CliError> {
        if let Some((path, trace)) = self.trace {
            trace.finish().map_err(|source| CliError::Write { path, source })?;
        }
        Ok(self.report)
    }
}

impl Report {
    fn write(self, trace: impl FnOnce(Vec<TraceRow>) -> RunTrace) -> Result<(), CliError> {
        let Some(Output { name, mut file }) = self.output else { return Ok(()) };
        report::write_html(&trace(self.ticks), &mut file)
            .and_then(|()| file.flush())
            .map_err(|source| CliError::Write { path: name, source })
    }
}

fn trace_of(job: &Job, summary: &RunSummary, ticks: Vec<TraceRow>) -> RunTrace {
    let limit_um = job.header.axes.each_ref().map(|axis| axis.following_error_limit_mm * 1e3);
    RunTrace {
        following_error_limit_um: limit_um,
        end_error_counts: summary.axes.each_ref().map(|axis| axis.end_error_counts),
        ticks,
        commands: summary.commands.clone(),
        faults: summary.faults.clone(),
        notices: summary.notices.clone(),
        ..job.info.empty_trace()
    }
}

/// Says where files were written.
pub(super) fn say_written(files: &[(&str, &Option<PathBuf>)], out: &mut dyn Write) -> Result<(), CliError> {
    for (what, path) in files {
        if let Some(path) = path {
            writeln!(out, "  {what} written to {}", path.display()).map_err(CliError::Output)?;
        }
    }
    Ok(())
}
