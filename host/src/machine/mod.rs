//! The machine: its limits, the wiring and regulation of its axes, and its drives.
//!
//! **Consumes** a TOML file (or nothing: [`Machine::reference`]). **Produces** a [`Machine`] from which every
//! stage takes its own configuration: planning its limits, the kernel its rules and axes, the simulation its
//! drives. **Runs** in the background, once. **Fails** with a [`MachineError`] that names file, line, column,
//! what was found and what was expected; nothing is clamped or filled in silently.
//!
//! - [`settings`]: the values, and what the stages make of them;
//! - [`edit`]: values written back into a file;
//! - [`error`]: refusals and their places;
//! - [`keys`]: every key of the file, for people;
//! - `any`: a machine of any number of axes;
//! - `file`: the layout of the file and the rules that join several keys;
//! - `law_name`: the names of the feed law's shapes, which block lists have too;
//! - `range`: numbers that carry their range, so that a wrong one is refused where it stands.
//!
//! ```
//! use motion_host::machine::{Machine, REFERENCE_TOML};
//!
//! let machine = Machine::from_toml("reference.toml", REFERENCE_TOML)?;
//! assert_eq!(machine, Machine::reference());
//!
//! let fast = REFERENCE_TOML.replacen("tick_s = 0.0005", "tick_s = 0.0", 1);
//! let refused = Machine::from_toml("fast.toml", &fast).unwrap_err();
//! assert!(refused.to_string().contains("found tick_s = 0.0, expected a number from 0.00002 to 0.02"));
//! # Ok::<(), motion_host::machine::MachineError>(())
//! ```

pub mod edit;
pub mod error;
pub mod keys;
pub mod settings;

mod any;
mod file;
mod law_name;
mod range;
#[cfg(test)]
mod tests;

pub use any::AnyMachine;
pub(crate) use any::on_machine;
pub use edit::{AxisEdit, NumberEdit, compensated, edited, numbers, with_numbers};
pub use error::{AxisError, MachineError};
pub(crate) use law_name::{LAW_NAMES, law_named};
pub use settings::{
    AxisSettings, CoolantSettings, DEAD_TIME_CELLS, DefaultPathMode, FaultSettings, HomingSettings, Machine,
    PathSettings, SpindleSettings, ToolSettings,
};

/// The reference machine's file, with every key explained.
pub const REFERENCE_TOML: &str = include_str!("reference.toml");
