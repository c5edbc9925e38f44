//! Where a job begins that is driven from a program's line on.
//!
//! Consumes a program that was read whole, its items, and a line; produces the item where that line's path begins, with what
//! the operator is to know before anything moves.

use motion_kernel::program::Item;
use thiserror::Error;

use super::job::piece;
use crate::gcode::{Program, Runs, Step};

/// Where a line's path begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FromLine {
    /// The item.
    pub item: usize,
    /// Its program line: not the line asked for where that has no motion, or is a part of what began before.
    pub line: u32,
    /// The tool that the program has in the spindle there; 0: none that it knows of.
    pub tool: u32,
}

/// Why a program is not driven from a line on. Displays as "found …, expected …".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FromLineError {
    /// There is no such line.
    #[error("found a program of {lines} lines, expected one that has this line")]
    Lacking {
        /// How many there are.
        lines: usize,
    },
    /// It is never run.
    #[error("found a line that is jumped over, or stands behind the end, expected one that is run")]
    NeverRuns,
    /// It is run more than once.
    #[error(
        "found a line that is run more than once, in a loop or in a subroutine that is called again, expected one that is \
         run once: a line before the loop or the call, or behind it"
    )]
    RunsAgain,
    /// The next motion is of a line that is run more than once.
    #[error(
        "found no motion in this line, and the next is of line {line}, which is run more than once, expected a line that is \
         run once"
    )]
    NextRunsAgain {
        /// That line.
        line: u32,
    },
    /// Nothing moves any more.
    #[error("found no motion in this line or behind it, expected some")]
    NoMotion,
}

/// Where the path of `line` begins among the items of `program`.
///
/// # Errors
/// There is no one place.
pub fn from_line<'a, const M: usize>(
    program: &Program,
    items: impl IntoIterator<Item = &'a Item<M>>,
    line: u32,
) -> Result<FromLine, FromLineError> {
    let begins = match program.lines.runs(line) {
        None => return Err(FromLineError::Lacking { lines: program.lines.count() }),
        Some(Runs::Never) => return Err(FromLineError::NeverRuns),
        Some(Runs::Again) => return Err(FromLineError::RunsAgain),
        Some(Runs::Once { step }) => step as usize,
    };
    let moves = |step: &Step| step.kind.ends().is_some();
    let behind = program.steps.get(begins..).unwrap_or_default();
    let own = behind.iter().position(|step| step.line == line && moves(step));
    let next = own.or_else(|| behind.iter().position(moves)).ok_or(FromLineError::NoMotion)?;
    let (step, of_line) = (begins + next, behind[next].line);
    let Some(Runs::Once { step: target }) = program.lines.runs(of_line) else {
        return Err(FromLineError::NextRunsAgain { line: of_line });
    };
    // The last line's first piece that begins before that motion or with it: moves that were merged have the line of the first.
    let (mut found, mut last) = (None, None);
    for (number, item) in items.into_iter().enumerate() {
        let Some((line, _)) = piece(item) else { continue };
        if last.replace(line) == Some(line) {
            continue;
        }
        match program.lines.runs(line) {
            Some(Runs::Once { step }) if step <= target => found = Some((number, line)),
            Some(Runs::Once { .. }) => break,
            _ => {}
        }
        if line == of_line {
            break;
        }
    }
    let (item, line) = found.ok_or(FromLineError::NoMotion)?;
    Ok(FromLine { item, line, tool: program.tool_at(step) })
}
