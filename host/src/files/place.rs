//! Which file a path means, whether it exists or not.
//!
//! Two paths mean one file if both lead to the same node of the file system, or to the same name in the same
//! folder.

use std::ffi::OsString;
use std::fs::{self, Metadata};
use std::io::ErrorKind;
use std::path::{self, Path, PathBuf};

use super::{FilesError, Known};

/// Greatest number of links in a row, as in operating systems.
const LINKS_MAX: usize = 40;

/// The identity of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// One that exists.
    File(Node),
    /// One that does not exist: its folder and its name there.
    New(Node, OsString),
    /// Not a file that keeps its content: a pipe, a terminal, a device.
    Stream,
}

/// A node of a file system: device and number.
#[cfg(unix)]
pub(super) type Node = (u64, u64);
/// A node of a file system, by its only path without links.
#[cfg(not(unix))]
pub(super) type Node = PathBuf;

#[cfg(unix)]
fn node(_: &Path, metadata: &Metadata) -> std::io::Result<Node> {
    use std::os::unix::fs::MetadataExt;
    Ok((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn node(path: &Path, _: &Metadata) -> std::io::Result<Node> {
    fs::canonicalize(path)
}

/// Where a path leads.
#[derive(Debug)]
pub(super) struct Place {
    pub(super) identity: Identity,
    /// The path without links.
    pub(super) target: PathBuf,
    /// The metadata of the file, if it exists.
    pub(super) metadata: Option<Metadata>,
}

impl Place {
    /// Follows the links of `path`.
    pub(super) fn of(path: &Path) -> Result<Self, FilesError> {
        let name = path.display().to_string();
        let failed = |source| FilesError::Open { path: name.clone(), source };
        match fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => Err(FilesError::IsFolder { path: name }),
            Ok(metadata) if metadata.is_file() => {
                let target = fs::canonicalize(path).map_err(failed)?;
                let identity = Identity::File(node(path, &metadata).map_err(failed)?);
                Ok(Self { identity, target, metadata: Some(metadata) })
            }
            Ok(metadata) => {
                Ok(Self { identity: Identity::Stream, target: path.to_owned(), metadata: Some(metadata) })
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Self::of_new(path, name),
            Err(source) => Err(failed(source)),
        }
    }

    /// The place of a file that does not exist, or of a link to one.
    fn of_new(path: &Path, name: String) -> Result<Self, FilesError> {
        let mut target = path.to_owned();
        for _ in 0..LINKS_MAX {
            let Ok(next) = fs::read_link(&target) else { break };
            target = folder_of(&target).join(next);
        }
        let ends_as_folder = target.to_string_lossy().ends_with(path::is_separator);
        let Some(file_name) = target.file_name().filter(|_| !ends_as_folder) else {
            return Err(FilesError::IsFolder { path: name });
        };
        let folder = folder_of(&target);
        let of_folder = fs::metadata(&folder).ok().filter(Metadata::is_dir);
        let Some(node) = of_folder.and_then(|metadata| node(&folder, &metadata).ok()) else {
            return Err(FilesError::NoFolder { path: name, folder: folder.display().to_string() });
        };
        // Systems whose file names ignore case.
        let ignores_case = cfg!(any(windows, target_os = "macos"));
        let file_name = if ignores_case { file_name.to_ascii_lowercase() } else { file_name.to_owned() };
        Ok(Self { identity: Identity::New(node, file_name), target, metadata: None })
    }
}

/// The folder of a file.
pub(super) fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Standard input, if it comes from a file.
#[cfg(unix)]
pub(super) fn standard_input() -> Option<Known> {
    use std::os::fd::AsFd;
    of_stream("standard input", std::io::stdin().as_fd())
}

/// Standard output and standard error, as far as they go to files.
#[cfg(unix)]
pub(super) fn standard_outputs() -> Vec<Known> {
    use std::os::fd::AsFd;
    let out = of_stream("standard output", std::io::stdout().as_fd());
    let error = of_stream("standard error", std::io::stderr().as_fd());
    out.into_iter().chain(error).collect()
}

#[cfg(unix)]
fn of_stream(role: &'static str, stream: std::os::fd::BorrowedFd<'_>) -> Option<Known> {
    let metadata = fs::File::from(stream.try_clone_to_owned().ok()?).metadata().ok()?;
    let node = node(Path::new(""), &metadata).ok().filter(|_| metadata.is_file())?;
    Some(Known { role, path: String::new(), identity: Identity::File(node) })
}

#[cfg(not(unix))]
pub(super) fn standard_input() -> Option<Known> {
    None
}

#[cfg(not(unix))]
pub(super) fn standard_outputs() -> Vec<Known> {
    Vec::new()
}
