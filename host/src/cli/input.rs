//! Programs and machine files, and the files that are written.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};

use super::error::CliError;
use crate::machine::Machine;

/// The name that stands for standard input.
const STANDARD_INPUT: &str = "-";

/// A text and the name it goes by in errors and reports.
pub(super) struct Source {
    pub(super) name: String,
    pub(super) text: Vec<u8>,
}

/// Reads a file, or standard input if it is called `-`.
pub(super) fn read(path: &Path) -> Result<Source, CliError> {
    let (name, text) = if path.as_os_str() == STANDARD_INPUT {
        let mut text = Vec::new();
        ("stdin".to_owned(), io::stdin().lock().read_to_end(&mut text).map(|_| text))
    } else {
        (path.display().to_string(), fs::read(path))
    };
    match text {
        Ok(text) => Ok(Source { name, text }),
        Err(source) => Err(CliError::Read { path: name, source }),
    }
}

/// Reads a machine file; without one, the reference machine.
pub(super) fn machine(path: Option<&PathBuf>) -> Result<Machine, CliError> {
    let Some(path) = path else {
        return Ok(Machine::reference());
    };
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|source| CliError::Read { path: name.clone(), source })?;
    Ok(Machine::from_toml(&name, &text)?)
}

/// A file to be written, and its name for errors.
pub(super) struct Output {
    pub(super) name: String,
    pub(super) file: BufWriter<File>,
}

impl Output {
    /// Creates the file; what was there is replaced.
    pub(super) fn create(path: &Path) -> Result<Self, CliError> {
        let name = path.display().to_string();
        match File::create(path) {
            Ok(file) => Ok(Self { name, file: BufWriter::new(file) }),
            Err(source) => Err(CliError::Write { path: name, source }),
        }
    }
}
