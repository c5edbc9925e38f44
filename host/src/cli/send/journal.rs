//! What is remembered of a program under way, to go on with it after a power cut.
//!
//! A thread writes the newest record at a bounded rate, each time as a whole file that replaces the one before: a slow disk
//! delays neither keys nor items, and a power cut leaves the old record or the new one.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::SendArguments;
use crate::board::Port;
use crate::board::progress::Place;
use crate::cli::error::CliError;
use crate::cli::input::ReadingArguments;
use crate::files::{Files, FilesError, STANDARD_INPUT};

/// What a journal is known by, and that of this version.
const FORMATS: &str = "motion journal ";
const FORMAT: &str = "motion journal 1";
/// At least between two writes.
const PERIOD: Duration = Duration::from_millis(250);

/// A program under way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    format: String,
    /// The program's file, and its checksum.
    pub program: PathBuf,
    pub program_sum: u32,
    /// The machine file; none for the reference machine.
    pub machine: Option<PathBuf>,
    /// What the program is read with.
    pub(super) reading: ReadingArguments,
    pub no_spindle: bool,
    /// The checksum of the machine, and the name of the whole job: the checksum of machine and items.
    pub machine_sum: u32,
    pub job: u32,
    /// The board's start that knew where the machine is.
    pub session: Option<u32>,
    /// The name of the job on the link, which may have begun in the middle.
    pub name: u32,
    /// Pieces of path and ends of stretches of the whole program that are driven.
    pub driven: u32,
    /// The program line there, and where motion was \[mm\].
    pub line: u32,
    pub set_mm: Vec<f64>,
    /// Whether each axis was homed there; none where nothing was driven yet.
    #[serde(default)]
    pub homed: Option<Vec<bool>>,
    /// All is driven.
    pub is_finished: bool,
}

/// What a record is about from its begin to its end.
pub(super) struct Subject {
    pub(super) program_sum: u32,
    pub(super) machine_sum: u32,
    pub(super) job: u32,
    pub(super) session: Option<u32>,
    pub(super) name: u32,
}

impl Record {
    /// Before anything is driven.
    pub(super) fn new(arguments: &SendArguments, subject: &Subject) -> Self {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        let &Subject { program_sum, machine_sum, job, session, name } = subject;
        Self {
            format: FORMAT.to_owned(),
            program: absolute(&arguments.program),
            program_sum,
            machine: arguments.machine.as_deref().map(absolute),
            reading: arguments.reading.with_paths(absolute),
            no_spindle: arguments.no_spindle,
            machine_sum,
            job,
            session,
            name,
            driven: 0,
            line: 0,
            set_mm: Vec::new(),
            homed: None,
            is_finished: false,
        }
    }

    /// The record in a file.
    ///
    /// # Errors
    /// It can't be read, or is no journal.
    pub(super) fn read(path: &Path) -> Result<Self, CliError> {
        let name = || path.display().to_string();
        let text = fs::read(path).map_err(|source| CliError::Read { path: name(), source })?;
        Self::parse(&text).ok_or_else(|| CliError::NoJournal { path: name() })
    }

    fn parse(text: &[u8]) -> Option<Self> {
        serde_json::from_slice(text).ok().filter(|record: &Self| record.format == FORMAT)
    }
}

/// Whether a file is a journal, of this version or another: it may be written over.
fn is_journal(text: &[u8]) -> bool {
    let value: Option<serde_json::Value> = serde_json::from_slice(text).ok();
    value.is_some_and(|value| value["format"].as_str().is_some_and(|format| format.starts_with(FORMATS)))
}

/// The place of the journal of a port: that of the user's programs for their state. None on a system that has none.
#[must_use]
pub(super) fn default_path(port: &Port) -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let state = variable("XDG_STATE_HOME")
        .or_else(|| variable("HOME").map(|home| home.join(".local/state")))
        .or_else(|| variable("LOCALAPPDATA"))?;
    let name: String =
        port.to_string().chars().map(|sign| if sign.is_ascii_alphanumeric() { sign } else { '-' }).collect();
    Some(state.join("motion").join(format!("{}.journal.json", name.trim_matches('-'))))
}

/// A journal being written.
pub(super) struct Journal {
    records: Option<Sender<Record>>,
    writer: Option<JoinHandle<Result<(), FilesError>>>,
    failure: Arc<Mutex<Option<String>>>,
    record: Record,
    /// Where the one before was moved.
    kept: Option<PathBuf>,
}

/// Moves the journal of another program that was not driven to its end; where to.
fn keep(path: &Path, subject: &Subject) -> Result<Option<PathBuf>, CliError> {
    let is_open = |before: Record| !before.is_finished && before.job != subject.job;
    if !path.exists() || !Record::read(path).is_ok_and(is_open) {
        return Ok(None);
    }
    let kept = path.with_extension("before");
    let refused = |source| CliError::Folder { path: kept.display().to_string(), source };
    fs::rename(path, &kept).map_err(refused)?;
    Ok(Some(kept))
}

impl Journal {
    /// The journal that `arguments` ask for, about `subject`; none for a program from standard input, and for a simulated
    /// board unless it is asked for.
    ///
    /// # Errors
    /// There is another file of the user's, or none can be written there.
    pub(super) fn open(arguments: &SendArguments, subject: &Subject) -> Result<Option<Self>, CliError> {
        let is_file = arguments.program.as_os_str() != STANDARD_INPUT;
        let path = match &arguments.journal {
            Some(path) if is_file => path.clone(),
            Some(_) => {
                let found = "--journal with a program from standard input".to_owned();
                return Err(CliError::Arguments {
                    found,
                    expected: "a program in a file, which can be read again",
                });
            }
            None if !is_file || arguments.port.port == Port::Simulator => return Ok(None),
            None => {
                let Some(path) = default_path(&arguments.port.port) else { return Ok(None) };
                if let Some(folder) = path.parent() {
                    let refused = |source| CliError::Folder { path: folder.display().to_string(), source };
                    fs::create_dir_all(folder).map_err(refused)?;
                }
                path
            }
        };
        if path.exists() {
            let name = || path.display().to_string();
            let text = fs::read(&path).map_err(|source| CliError::Read { path: name(), source })?;
            if !is_journal(&text) {
                return Err(CliError::NoJournal { path: name() });
            }
        }
        let kept = match &arguments.journal {
            None => keep(&path, subject)?,
            Some(_) => None,
        };
        // Found before anything moves, as for every output; nothing is written yet.
        let inputs =
            [("the program", Some(arguments.program.as_path())), ("--machine", arguments.machine.as_deref())];
        Files::reading(inputs).output("--journal", &path)?;
        let ((records, to_write), failure) = (channel(), Arc::new(Mutex::new(None)));
        let of_writer = Arc::clone(&failure);
        let writer = thread::spawn(move || write(&path, &to_write, &of_writer));
        Ok(Some(Self {
            records: Some(records),
            writer: Some(writer),
            failure,
            record: Record::new(arguments, subject),
            kept,
        }))
    }

    /// Where the journal of another program that is not at its end was moved; told once.
    pub(super) fn take_kept(&mut self) -> Option<PathBuf> {
        self.kept.take()
    }

    /// Motion has come so far.
    pub(super) fn note(&mut self, place: Place, set_mm: Vec<f64>, homed: Vec<bool>) {
        if self.record.set_mm.is_empty() || self.record.driven != place.driven {
            (self.record.driven, self.record.line, self.record.set_mm) = (place.driven, place.line, set_mm);
            self.record.homed = Some(homed);
            self.put();
        }
    }

    /// All is driven.
    pub(super) fn finish(&mut self) {
        self.record.is_finished = true;
        self.put();
    }

    fn put(&self) {
        if let Some(records) = &self.records {
            // Where the writer has failed, that is told.
            let _ = records.send(self.record.clone());
        }
    }

    /// Why it could not be written, since the last call. It is tried again.
    pub(super) fn failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Waits until the last record is written.
    pub(super) fn close(&mut self) -> Result<(), FilesError> {
        self.records = None;
        // A thread that has panicked has said so.
        self.writer.take().map_or(Ok(()), |writer| writer.join().unwrap_or(Ok(())))
    }
}

impl Drop for Journal {
    /// Also where the command ends early, the last record is written.
    fn drop(&mut self) {
        let _ = self.close();
    }
}

/// Writes the newest of `records` until there are no more; what can't be written is tried again. The last result.
fn write(path: &Path, records: &Receiver<Record>, failure: &Mutex<Option<String>>) -> Result<(), FilesError> {
    let (mut due, mut written) = (None, Ok(()));
    loop {
        let next = match due {
            Some(_) => records.recv_timeout(PERIOD),
            None => records.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let is_end = matches!(next, Err(RecvTimeoutError::Disconnected));
        due = next.ok().or(due);
        while let Ok(newer) = records.try_recv() {
            due = Some(newer);
        }
        let Some(record) = &due else { return written };
        written = put(path, record);
        match &written {
            Ok(()) => due = None,
            Err(error) => *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string()),
        }
        if is_end {
            return written;
        }
        thread::sleep(PERIOD);
    }
}

fn put(path: &Path, record: &Record) -> Result<(), FilesError> {
    let file = Files::reading([]).output("--journal", path)?;
    file.write_whole(|file| serde_json::to_writer_pretty(file, record).map_err(std::io::Error::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_its_own_journal() {
        let names: Vec<_> = ["tcp:localhost:5000", "/dev/ttyACM0", "/dev/ttyACM1"]
            .map(|port| default_path(&port.parse().expect("a port")))
            .into_iter()
            .flatten()
            .map(|path| path.file_name().expect("a name").to_owned())
            .collect();
        if !names.is_empty() {
            assert_eq!(names[0], "tcp-localhost-5000.journal.json");
            assert_eq!(names[1], "dev-ttyACM0.journal.json");
            assert_ne!(names[1], names[2]);
        }
    }

    #[test]
    fn what_is_no_journal_is_none() {
        for text in ["", "{}", "G1 X1", "{\"format\": \"motion journal 1\"}"] {
            assert_eq!(Record::parse(text.as_bytes()), None, "{text}");
        }
        // One of another version can't be gone on with, and is written over.
        for (text, is_one) in [("G1 X1", false), ("{}", false), ("{\"format\": \"motion journal 2\"}", true)]
        {
            assert_eq!(is_journal(text.as_bytes()), is_one, "{text}");
        }
    }
}
