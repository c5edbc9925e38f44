//! `motion machine`: the reference machine's file, to copy and change.

use std::io::Write;

use clap::Args;

use super::error::{CliError, Outcome};
use crate::machine::REFERENCE_TOML;

const EXAMPLES: &str = "\
Examples:
  motion machine                      read about every value
  motion machine > mine.toml          a machine of your own; edit it, then
  motion run part.ngc --machine mine.toml";

/// Print the built-in reference machine as a commented machine file.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct MachineArguments {}

/// Prints the file as it is.
///
/// # Errors
/// `out` can't be written.
pub fn print(out: &mut dyn Write) -> Result<Outcome, CliError> {
    out.write_all(REFERENCE_TOML.as_bytes()).map_err(CliError::Output)?;
    Ok(Outcome::Done)
}
