//! `motion page`: the playground, a page that plans and runs programs in a browser.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::demo::{STRINGER, STRINGER_NAME};
use super::error::{CliError, Outcome};
use super::input;
use crate::files::Files;
use crate::machine::REFERENCE_TOML;
use crate::report::page::{Playground, Sheet};

/// Where `host/wasm/build` puts the module.
const MODULE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/page/motion.wasm");
/// What every module begins with.
const MAGIC: &[u8] = b"\0asm";

const EXAMPLES: &str = "\
Examples:
  host/wasm/build                                    build the module that the page needs, once
  motion page                                        write motion.html; open it in a browser
  motion page part.ngc --machine mine.toml --output part.html
                                                     begin with a program and a machine of your own";

/// Write a page that plans and runs programs in a browser: edit or drop a program, move sliders. It needs no network.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PageArguments {
    /// G-code to begin with; `-` is standard input. Without it, the built-in demonstration.
    #[arg(value_name = "PROGRAM")]
    program: Option<PathBuf>,
    /// Machine file to begin with; without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// The page; an existing file is replaced.
    #[arg(long, short, value_name = "FILE.html", default_value = "motion.html")]
    output: PathBuf,
    /// The module; without it, the one that `host/wasm/build` made.
    #[arg(long, value_name = "FILE.wasm")]
    module: Option<PathBuf>,
}

/// Writes the page.
///
/// # Errors
/// The module is not there, program or machine can't be read, or the page can't be written.
pub fn page(arguments: &PageArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let module = arguments.module.clone().unwrap_or_else(|| MODULE.into());
    let mut files = Files::reading([
        ("PROGRAM", arguments.program.as_deref()),
        ("--machine", arguments.machine.as_deref()),
        ("--module", Some(&module)),
    ]);
    let output = files.output("--output", &arguments.output)?;
    let no_module = |found: String| CliError::NoModule { path: module.display().to_string(), found };
    let module = fs::read(&module).map_err(|source| no_module(source.to_string()))?;
    if !module.starts_with(MAGIC) {
        return Err(no_module("a file of another kind".to_owned()));
    }
    let (program_name, program) = match &arguments.program {
        Some(path) => text(path)?,
        None => (STRINGER_NAME.to_owned(), STRINGER.to_owned()),
    };
    let (machine_name, machine) = match &arguments.machine {
        Some(path) => text(path)?,
        None => ("reference.toml".to_owned(), REFERENCE_TOML.to_owned()),
    };
    let playground = Playground {
        program: Sheet { name: &program_name, text: &program },
        machine: Sheet { name: &machine_name, text: &machine },
    };
    let name = output.name().to_owned();
    output.write_whole(|file| playground.write(&module, file)).map_err(CliError::Unwritten)?;
    writeln!(out, "page written to {name}").map_err(CliError::Output)?;
    Ok(Outcome::Done)
}

/// A file's name without its folders, and its text. What is no UTF-8 is "�" in a page; the reader refuses it outside of comments.
fn text(path: &std::path::Path) -> Result<(String, String), CliError> {
    let source = input::read(path)?;
    let name = path.file_name().filter(|_| source.name != "stdin");
    let name = name.map_or(source.name, |name| name.to_string_lossy().into_owned());
    Ok((name, String::from_utf8_lossy(&source.text).into_owned()))
}
