//! Files about a run: the trace, written as it goes, and the report afterwards.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use super::error::CliError;
use super::input::Output;
use super::progress::Progress;
use super::trace::TraceWriter;
use crate::record::{RunRecord, TickRecord};
use crate::report;
use crate::simulate::{Job, Observer, RunError, RunSummary, Sheet};

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
        let (ran, report) = self.of_ticks(&job.sheet, |observe| {
            let mut progress = Progress::new((job.sheet.planned_time_s / job.sheet.tick_s) as u64);
            let ran = run(&mut |tick| {
                observe(tick);
                progress.tick();
            });
            progress.finish();
            ran
        })?;
        let ran = ran.map_err(|source| CliError::Run { program: job.sheet.program.clone(), source })?;
        report.write(|ticks| record(job, summary_of(&ran), ticks))?;
        Ok(ran)
    }

    /// The files about a record that was not made by a run of now.
    pub(super) fn of_record(self, sheet: &Sheet, record: &RunRecord) -> Result<(), CliError> {
        let ((), report) = self.of_ticks(sheet, |observe| record.ticks.iter().for_each(observe))?;
        report.write(|ticks| RunRecord { ticks, ..record.clone() })
    }

    /// What `run` returns, its ticks traced, and the report that is to be written of them.
    pub(super) fn of_ticks<T>(
        self,
        sheet: &Sheet,
        run: impl FnOnce(&mut Observer<'_>) -> T,
    ) -> Result<(T, Report), CliError> {
        let mut files = Files::new(self, sheet)?;
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
    ticks: Vec<TickRecord>,
}

impl Files {
    fn new(outputs: Outputs, sheet: &Sheet) -> Result<Self, CliError> {
        let trace = match outputs.trace {
            None => None,
            Some(Output { name, file }) => match TraceWriter::new(file, sheet) {
                Ok(writer) => Some((name, writer)),
                Err(source) => return Err(CliError::Write { path: name, source }),
            },
        };
        Ok(Self { trace, report: Report { output: outputs.report, ticks: Vec::new() } })
    }

    fn add(&mut self, tick: &TickRecord) {
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
    fn write(self, record: impl FnOnce(Vec<TickRecord>) -> RunRecord) -> Result<(), CliError> {
        let Some(Output { name, mut file }) = self.output else { return Ok(()) };
        report::write_html(&record(self.ticks), &mut file)
            .and_then(|()| file.flush())
            .map_err(|source| CliError::Write { path: name, source })
    }
}

fn record(job: &Job, summary: &RunSummary, ticks: Vec<TickRecord>) -> RunRecord {
    let limit_um = job.header.axes.each_ref().map(|axis| axis.following_error_limit_mm * 1e3);
    RunRecord {
        following_error_limit_um: limit_um,
        end_error_counts: summary.axes.each_ref().map(|axis| axis.end_error_counts),
        ticks,
        commands: summary.commands.clone(),
        faults: summary.faults.clone(),
        notices: summary.notices.clone(),
        ..job.sheet.record()
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
