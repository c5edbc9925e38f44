//! Why a file is not written.

use std::io;

use thiserror::Error;

/// Why a file is not written. Displays as one line.
#[derive(Debug, Error)]
pub enum FilesError {
    /// It is an input or another output.
    #[error("{option} {path}: found the same file as {other}, expected another one")]
    Same {
        /// Its option.
        option: &'static str,
        /// The path, as the user gave it.
        path: String,
        /// The other file, with what it is for.
        other: String,
    },
    /// It is a folder.
    #[error("{path}: found a folder, expected a file")]
    IsFolder {
        /// The path, as the user gave it.
        path: String,
    },
    /// Its folder does not exist.
    #[error("{path}: found no folder {folder}, expected one that exists")]
    NoFolder {
        /// The path, as the user gave it.
        path: String,
        /// The folder.
        folder: String,
    },
    /// It exists, and its permissions forbid writing it.
    #[error("{path}: found a read-only file, expected one that may be replaced")]
    ReadOnly {
        /// The path, as the user gave it.
        path: String,
    },
    /// It can't be opened, or no file can be made in its folder.
    #[error("{path}: found {source}, expected a file that can be written")]
    Open {
        /// The path, as the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
    /// It was opened but could not be written completely. The previous content stays.
    #[error("{path}: found {source}, expected to write the whole file; it stays as it was")]
    Write {
        /// The path, as the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A pipe or a device did not accept all of it.
    #[error("{path}: found {source}, expected to write all of it")]
    Stream {
        /// The path, as the user gave it.
        path: String,
        /// The system's reason.
        source: io::Error,
    },
}
