//! The command line as users and scripts rely on it: exit statuses, keys, headers, errors, files.

mod axes;
mod checking;
mod drive;
mod files;
mod machines;
mod options;
mod page;
mod planning;
mod reading;
mod probing;
mod running;
mod sending;
mod spline;
mod unfinished;
pub(crate) mod workspace;
