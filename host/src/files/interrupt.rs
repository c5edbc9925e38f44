//! Ctrl-C and the request to end: temporary files are removed, and the process ends with the signal's status.
//!
//! A separate thread waits for the signals, so it can remove files whatever the main thread is doing. It
//! takes the lock that a rename holds: a commit under way is completed, everything else stays as it was.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

/// Temporary files of outputs that are not committed, with the outputs' names.
static PENDING: Mutex<Vec<(PathBuf, String)>> = Mutex::new(Vec::new());

/// The next signal is noted, and ends nothing.
static IS_HELD_FIRST: AtomicBool = AtomicBool::new(false);
/// What has come: 0 for nothing, or an [`Asked`].
static ASKED: AtomicU8 = AtomicU8::new(0);

/// What a signal asks of a command that holds first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// Ctrl-C: hold.
    Hold = 1,
    /// The request to end: hold, and end.
    End = 2,
}

/// From now on the next Ctrl-C or request to end is noted for [`take_asked`], and only another one after it ends the process: for
/// a command that brings a machine to rest first.
pub fn hold_first() {
    IS_HELD_FIRST.store(true, Ordering::Relaxed);
}

/// The signal that was noted since the last call.
#[must_use]
pub fn take_asked() -> Option<Asked> {
    match ASKED.swap(0, Ordering::Relaxed) {
        1 => Some(Asked::Hold),
        2 => Some(Asked::End),
        _ => None,
    }
}

fn lock() -> MutexGuard<'static, Vec<(PathBuf, String)>> {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A temporary file that a signal removes, until this is dropped.
#[derive(Debug)]
pub(super) struct PendingPath(PathBuf);

impl PendingPath {
    /// Registers the file that `make` makes for the output `name`.
    pub(super) fn made(
        name: &str,
        make: impl FnOnce() -> io::Result<NamedTempFile>,
    ) -> io::Result<(NamedTempFile, Self)> {
        let mut pending = lock();
        let temporary = make()?;
        let path = temporary.path().to_owned();
        pending.push((path.clone(), name.to_owned()));
        Ok((temporary, Self(path)))
    }

    /// Renames it with `rename`; a signal comes before or after that.
    pub(super) fn end(self, rename: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
        let mut pending = lock();
        let renamed = rename();
        pending.retain(|(path, _)| *path != self.0);
        drop(pending);
        renamed
    }
}

impl Drop for PendingPath {
    fn drop(&mut self) {
        lock().retain(|(path, _)| *path != self.0);
    }
}

/// Ends the process on SIGINT (Ctrl-C, status 130) and SIGTERM (143), without losing a file. Call it once,
/// first of all.
///
/// On systems other than Unix, the system ends the process, and a temporary file may stay.
pub fn watch() {
    #[cfg(unix)]
    unix::watch();
}

#[cfg(unix)]
mod unix {
    use std::io::{self, IsTerminal, Write};
    use std::sync::atomic::Ordering;
    use std::{fs, process, thread};

    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    /// The offset that a shell adds to the number of a signal.
    const STATUS_OF_SIGNALS: i32 = 128;

    pub(super) fn watch() {
        // Without the handler, a signal ends the process as usual.
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
        thread::spawn(move || {
            for signal in signals.forever() {
                if super::IS_HELD_FIRST.swap(false, Ordering::Relaxed) {
                    let asked = if signal == SIGINT { super::Asked::Hold } else { super::Asked::End };
                    super::ASKED.store(asked as u8, Ordering::Relaxed);
                    continue;
                }
                end(signal);
            }
        });
    }

    fn end(signal: i32) -> ! {
        let pending = super::lock();
        for (path, _) in pending.iter() {
            let _ = fs::remove_file(path);
        }
        let names: Vec<&str> = pending.iter().map(|(_, name)| name.as_str()).collect();
        let stays = match names.as_slice() {
            [] => String::new(),
            [name] => format!(": {name} stays as it was"),
            names => format!(": {} stay as they were", names.join(", ")),
        };
        let mut error = io::stderr().lock();
        // After the ^C that a terminal shows, or the progress bar.
        let line = if error.is_terminal() { "\n" } else { "" };
        let _ = writeln!(error, "{line}motion: interrupted{stays}");
        // The lock is still held: nothing more is committed.
        process::exit(STATUS_OF_SIGNALS + signal)
    }
}
