//! A file being written: a temporary one in the same folder, renamed when it is complete.

use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::FilesError;
use super::interrupt::PendingPath;
use super::place::{self, Identity, Place};

/// A file being written. If dropped before [`Self::commit`], it leaves the previous file.
#[derive(Debug)]
pub struct OutputFile {
    /// The path, as the user gave it.
    name: String,
    sink: Sink,
}

#[derive(Debug)]
enum Sink {
    File(Replacement),
    Stream(BufWriter<File>),
}

/// The replacement of a file. When dropped, it removes the temporary file and then unregisters it.
#[derive(Debug)]
struct Replacement {
    temporary: BufWriter<NamedTempFile>,
    pending: PendingPath,
    target: PathBuf,
    permissions: Option<Permissions>,
}

impl OutputFile {
    pub(super) fn open(path: &Path, place: Place) -> Result<Self, FilesError> {
        let name = path.display().to_string();
        let Place { identity, target, metadata } = place;
        let permissions = metadata.map(|metadata| metadata.permissions());
        let sink = if identity == Identity::Stream {
            OpenOptions::new().write(true).open(path).map(|file| Sink::Stream(BufWriter::new(file)))
        } else if permissions.as_ref().is_some_and(Permissions::readonly) {
            return Err(FilesError::ReadOnly { path: name });
        } else {
            // A rename would replace a file that its user may not write.
            let is_writable = match &permissions {
                Some(_) => OpenOptions::new().write(true).open(&target).map(drop),
                None => Ok(()),
            };
            is_writable.and_then(|()| Replacement::new(target, permissions, &name)).map(Sink::File)
        };
        match sink {
            Ok(sink) => Ok(Self { name, sink }),
            Err(source) => Err(FilesError::Open { path: name, source }),
        }
    }

    /// The path, as the user gave it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Writes the content with `write`, and commits it.
    ///
    /// # Errors
    /// It can't be written completely.
    pub fn write_whole(mut self, write: impl FnOnce(&mut Self) -> io::Result<()>) -> Result<(), FilesError> {
        match write(&mut self) {
            Ok(()) => self.commit(),
            Err(source) => Err(self.failure().of(source)),
        }
    }

    /// Replaces the file by what was written, in one step.
    ///
    /// # Errors
    /// It can't be written completely.
    pub fn commit(self) -> Result<(), FilesError> {
        let failure = self.failure();
        let done = match self.sink {
            Sink::File(replacement) => replacement.commit(),
            Sink::Stream(mut stream) => stream.flush(),
        };
        done.map_err(|source| failure.of(source))
    }

    /// The message for a failure of writing it.
    #[must_use]
    pub fn failure(&self) -> Failure {
        Failure { path: self.name.clone(), is_stream: matches!(self.sink, Sink::Stream(_)) }
    }
}

/// A file that was not written, before the cause is known.
#[derive(Clone, Debug)]
pub struct Failure {
    path: String,
    is_stream: bool,
}

impl Failure {
    /// The error with its cause `source`.
    #[must_use]
    pub fn of(self, source: io::Error) -> FilesError {
        let Self { path, is_stream } = self;
        if is_stream { FilesError::Stream { path, source } } else { FilesError::Write { path, source } }
    }
}

impl Replacement {
    fn new(target: PathBuf, permissions: Option<Permissions>, name: &str) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".motion-").suffix(".tmp");
        // As for a new file: the user's mask applies.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let (temporary, pending) =
            PendingPath::made(name, || builder.tempfile_in(place::folder_of(&target)))?;
        Ok(Self { temporary: BufWriter::new(temporary), pending, target, permissions })
    }

    fn commit(self) -> io::Result<()> {
        let Self { temporary, pending, target, permissions } = self;
        let temporary = temporary.into_inner().map_err(io::IntoInnerError::into_error)?;
        if let Some(permissions) = permissions {
            temporary.as_file().set_permissions(permissions)?;
        }
        // Completely on disk before it gets its name: after a power failure there is the old file or the new
        // one.
        temporary.as_file().sync_all()?;
        pending.end(|| temporary.persist(target).map(drop).map_err(|error| error.error))
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.sink {
            Sink::File(replacement) => replacement.temporary.write(bytes),
            Sink::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::File(replacement) => replacement.temporary.flush(),
            Sink::Stream(stream) => stream.flush(),
        }
    }
}
