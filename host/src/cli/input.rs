//! Programs and machine files.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::error::CliError;
use crate::files::STANDARD_INPUT;
use crate::machine::Machine;

/// A text and its name in errors and reports.
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
