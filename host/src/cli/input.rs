//! Programs and machine files.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use clap::{ArgAction, Args};
use serde::{Deserialize, Serialize};

use super::error::CliError;
use crate::files::STANDARD_INPUT;
use crate::gcode::{self, Axis, GcodeError, ParameterFile, Program, ReadOptions, Refusal, ToolTable};
use crate::machine::{AnyMachine, Machine, REFERENCE_TOML};

/// What G-code is read with.
#[derive(Clone, Debug, PartialEq, Args, Serialize, Deserialize)]
pub(super) struct ReadingArguments {
    /// Leave out lines of G-code that begin with `/`.
    #[arg(long, value_name = "true|false", default_value_t = true, action = ArgAction::Set)]
    block_delete: bool,
    /// Stop at M1.
    #[arg(long, value_name = "true|false", default_value_t = true, action = ArgAction::Set)]
    optional_stop: bool,
    /// Folder of subroutines, a file `name.ngc` each; may be given several times. The program's own is the last.
    #[arg(long, value_name = "DIR")]
    subroutines: Vec<PathBuf>,
    /// Parameters to start with (offsets, places of G28 and G30), in LinuxCNC's format.
    #[arg(long, value_name = "FILE.var")]
    pub(super) parameters: Option<PathBuf>,
    /// Tool table, in LinuxCNC's format. Without it, every tool has length 0 and the radius of the machine file, or 0.
    #[arg(long, value_name = "FILE.tbl")]
    pub(super) tools: Option<PathBuf>,
    /// Most lines of G-code to execute, loops included.
    #[arg(long, value_name = "COUNT", default_value_t = ReadOptions::default().lines_max)]
    lines_max: u64,
}

impl ReadingArguments {
    /// The options they ask for, with the files read, beside [those of a machine](Machine::read_options).
    pub(super) fn options(&self, machine: ReadOptions) -> Result<ReadOptions, CliError> {
        for folder in &self.subroutines {
            let path = || folder.display().to_string();
            fs::read_dir(folder).map_err(|source| CliError::Folder { path: path(), source })?;
        }
        let parameters = match &self.parameters {
            Some(path) => {
                let Source { name, text, .. } = read(path)?;
                ParameterFile::parse(&name, &text)?
            }
            None => ParameterFile::default(),
        };
        let tools = match &self.tools {
            Some(path) => {
                let Source { name, text, .. } = read(path)?;
                Some(ToolTable::parse(&name, &text)?)
            }
            None => None,
        };
        Ok(ReadOptions {
            block_delete: self.block_delete,
            optional_stop: self.optional_stop,
            subroutines: self.subroutines.clone(),
            parameters,
            tools,
            lines_max: self.lines_max,
            ..machine
        })
    }

    /// The same with other paths.
    pub(super) fn with_paths(&self, path: impl Fn(&Path) -> PathBuf) -> Self {
        Self {
            subroutines: self.subroutines.iter().map(|folder| path(folder)).collect(),
            parameters: self.parameters.as_deref().map(&path),
            tools: self.tools.as_deref().map(&path),
            ..self.clone()
        }
    }

    /// The program of a source, with the options of a machine.
    pub(super) fn program(&self, source: &Source, machine: ReadOptions) -> Result<Program, CliError> {
        Ok(source.program(&self.options(machine)?)?)
    }
}

/// A text and its name in errors and reports.
pub(super) struct Source {
    pub(super) name: String,
    pub(super) text: Vec<u8>,
    /// Where it lies; none for standard input.
    folder: Option<PathBuf>,
}

impl Source {
    /// The program in it. Its own folder is the last that is searched for subroutines.
    pub(super) fn program(&self, options: &ReadOptions) -> Result<Program, GcodeError> {
        gcode::read_with(&self.name, &self.text, &self.options(options))
    }

    /// All refusals of the program in it.
    pub(super) fn refusals(&self, options: &ReadOptions) -> Vec<Refusal> {
        gcode::refusals(&self.name, &self.text, &self.options(options))
    }

    /// These options, with its own folder.
    pub(super) fn options(&self, options: &ReadOptions) -> ReadOptions {
        let mut options = options.clone();
        options.subroutines.extend(self.folder.clone());
        options
    }
}

/// Reads a file, or standard input if it is called `-`.
pub(super) fn read(path: &Path) -> Result<Source, CliError> {
    let (name, text) = if path.as_os_str() == STANDARD_INPUT {
        let mut text = Vec::new();
        ("stdin".to_owned(), io::stdin().lock().read_to_end(&mut text).map(|_| text))
    } else {
        (path.display().to_string(), fs::read(path))
    };
    match text {
        Ok(text) => {
            let is_file = path.as_os_str() != STANDARD_INPUT;
            let folder = path.parent().filter(|_| is_file).map(Path::to_path_buf);
            Ok(Source { name, text, folder })
        }
        Err(source) => Err(CliError::Read { path: name, source }),
    }
}

/// Only one input can be standard input.
pub(super) fn differ(
    role: &str,
    path: &Path,
    other_role: &str,
    other: Option<&Path>,
) -> Result<(), CliError> {
    if path.as_os_str() != STANDARD_INPUT || other.is_none_or(|other| other != path) {
        return Ok(());
    }
    let source = io::Error::other(format!("standard input, which is {role} already"));
    Err(CliError::Read { path: format!("{other_role} {STANDARD_INPUT}"), source })
}

/// Reads the file of a machine of any number of axes; without one, the reference machine.
pub(super) fn any_machine(path: Option<&PathBuf>) -> Result<AnyMachine, CliError> {
    if path.is_none() {
        return Ok(AnyMachine::Three(Box::new(Machine::reference())));
    }
    let MachineText { name, text } = MachineText::read(path)?;
    Ok(AnyMachine::from_toml(&name, &text)?)
}

/// Reads the file of a machine of X, Y and Z, in this order, for commands that know their axes by it; without a file, the
/// reference machine.
pub(super) fn xyz_machine(path: Option<&PathBuf>) -> Result<Machine, CliError> {
    if path.is_none() { Ok(Machine::reference()) } else { MachineText::read(path)?.xyz_machine() }
}

/// A machine file, to be changed.
pub(super) struct MachineText {
    pub(super) name: String,
    pub(super) text: String,
}

impl MachineText {
    /// Reads the file; without one, that of the reference machine.
    pub(super) fn read(path: Option<&PathBuf>) -> Result<Self, CliError> {
        let Some(path) = path else {
            return Ok(Self { name: "reference.toml".to_owned(), text: REFERENCE_TOML.to_owned() });
        };
        let name = path.display().to_string();
        match fs::read_to_string(path) {
            Ok(text) => Ok(Self { name, text }),
            Err(source) => Err(CliError::Read { path: name, source }),
        }
    }

    /// The machine of X, Y and Z, in this order.
    pub(super) fn xyz_machine(&self) -> Result<Machine, CliError> {
        let machine = Machine::from_toml(&self.name, &self.text)?;
        if machine.axes.each_ref().map(|axis| axis.letter) == [Axis::X, Axis::Y, Axis::Z].map(Some) {
            return Ok(machine);
        }
        let letters = machine.axes.iter().filter_map(|axis| axis.letter).map(Axis::name);
        let letters: Vec<&str> = letters.collect();
        let expected = "X, Y and Z, in this order, for this command";
        Err(CliError::Arguments {
            found: format!("{} with the axes {}", self.name, letters.join(", ")),
            expected,
        })
    }
}
