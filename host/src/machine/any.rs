//! A machine of any number of axes.

use super::error::MachineError;
use super::file;
use super::settings::Machine;
use crate::gcode::{AXES_MAX, ReadOptions};

/// Evaluates an expression with the machine in an [`AnyMachine`], whatever its places.
macro_rules! on_machine {
    ($any:expr, $machine:ident => $result:expr) => {
        match &$any {
            $crate::machine::AnyMachine::Three($machine) => $result,
            $crate::machine::AnyMachine::Nine($machine) => $result,
        }
    };
}

pub(crate) use on_machine;

/// A machine with the fewest places that hold its axes. Planning and simulation are made for both.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyMachine {
    /// One to three axes.
    Three(Box<Machine>),
    /// Four to nine.
    Nine(Box<Machine<AXES_MAX>>),
}

impl AnyMachine {
    /// Reads a machine file; `source_name` appears in errors only.
    ///
    /// # Errors
    /// The text is not TOML, a key is missing or unknown, or a value is out of its range.
    pub fn from_toml(source_name: &str, text: &str) -> Result<Self, MachineError> {
        let machine = file::read(source_name, text)?;
        if machine.axis_count() > 3 {
            return Ok(Self::Nine(Box::new(machine)));
        }
        machine.fitted(source_name, text).map(|machine| Self::Three(Box::new(machine)))
    }

    /// What the machine adds to the options that its programs are read with.
    #[must_use]
    pub fn read_options(&self) -> ReadOptions {
        on_machine!(self, machine => machine.read_options())
    }
}
