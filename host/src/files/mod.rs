//! Files that a command reads and writes: none is ever lost.
//!
//! Consumes the paths that a command reads, then the paths that it writes; produces an [`OutputFile`] for
//! each of these.
//!
//! - Before the work: an output that is an input or another output is refused, whatever links and spellings
//!   lead to it (`place`); so is an output in a folder that does not exist or can't be written.
//! - During the work: everything goes to a temporary file in the same folder ([`OutputFile`]).
//! - At its end: [`OutputFile::commit`] renames it. If it is not committed, because of an error, a panic or a
//!   signal ([`interrupt`]), the previous file stays and the temporary one is removed.
//!
//! A link is followed to the file that it names. A replaced file keeps its permissions; other hard links to
//! it keep the old content. Anything but a regular file (a pipe, a terminal, `/dev/null`) is written
//! directly.

mod error;
pub mod interrupt;
mod output;
mod place;

use std::path::Path;

pub use self::error::FilesError;
pub use self::output::{Failure, OutputFile};
use self::place::{Identity, Place};

/// The name that stands for standard input.
pub const STANDARD_INPUT: &str = "-";

/// The files of a command.
#[derive(Debug)]
pub struct Files {
    known: Vec<Known>,
}

/// A file that is read or written.
#[derive(Debug)]
struct Known {
    /// Its role: an option, an argument or a standard stream.
    role: &'static str,
    /// The path, as the user gave it.
    path: String,
    identity: Identity,
}

impl Files {
    /// The files of a command that reads `inputs`, each with its argument. A missing input is no error here.
    #[must_use]
    pub fn reading<'a>(inputs: impl IntoIterator<Item = (&'static str, Option<&'a Path>)>) -> Self {
        // Printed output would be lost in a file that is replaced.
        let mut known = place::standard_outputs();
        for (role, path) in inputs {
            match path {
                Some(path) if path.as_os_str() == STANDARD_INPUT => known.extend(place::standard_input()),
                Some(path) => {
                    let identity = Place::of(path).map_or(Identity::Stream, |place| place.identity);
                    known.push(Known { role, path: path.display().to_string(), identity });
                }
                None => {}
            }
        }
        Self { known }
    }

    /// Opens the file that `option` names.
    ///
    /// # Errors
    /// It is an input or another output, it is a folder or read-only, or its folder does not exist or can't
    /// be written.
    pub fn output(&mut self, option: &'static str, path: &Path) -> Result<OutputFile, FilesError> {
        self.open(option, path, None)
    }

    /// As [`Self::output`], for a file that may be the input `of`: an edited copy that replaces it.
    ///
    /// # Errors
    /// As [`Self::output`].
    pub fn edited(
        &mut self,
        option: &'static str,
        path: &Path,
        of: &'static str,
    ) -> Result<OutputFile, FilesError> {
        self.open(option, path, Some(of))
    }

    fn open(
        &mut self,
        option: &'static str,
        path: &Path,
        edited: Option<&'static str>,
    ) -> Result<OutputFile, FilesError> {
        let place = Place::of(path)?;
        let name = path.display().to_string();
        let is_same = |known: &&Known| {
            known.identity == place.identity
                && place.identity != Identity::Stream
                && edited != Some(known.role)
        };
        if let Some(Known { role, path, .. }) = self.known.iter().find(is_same) {
            let other = format!("{role} {path}").trim_end().to_owned();
            return Err(FilesError::Same { option, path: name, other });
        }
        self.known.push(Known { role: option, path: name, identity: place.identity.clone() });
        OutputFile::open(path, place)
    }
}
