//! `motion machine`: the reference machine's file, to copy and change, and the meaning of its keys.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::write_json;
use crate::machine::REFERENCE_TOML;
use crate::machine::keys::{KEY_TABLES, Key, KeyTable, is_list};

const EXAMPLES: &str = "\
Examples:
  motion machine                      the file, with a comment on every value
  motion machine --explain            every key with unit, range, default and meaning
  motion machine > mine.toml          a machine of your own; edit it, then
  motion run part.ngc --machine mine.toml

JSON: list of {table (in dots; empty: before the first table), table_is_optional, key, unit, values (how many), range,
default (null: required), meaning}.";

/// Print the built-in reference machine as a commented machine file, or the meaning of its keys.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct MachineArguments {
    /// Explain every key of a machine file instead.
    #[arg(long)]
    explain: bool,
    /// Print the explanation as JSON.
    #[arg(long, requires = "explain")]
    json: bool,
}

#[derive(Serialize)]
struct KeyJson {
    table: &'static str,
    table_is_optional: bool,
    key: &'static str,
    unit: &'static str,
    values: usize,
    may_be_more: bool,
    range: &'static str,
    default: Option<&'static str>,
    meaning: &'static str,
}

/// Prints the file as it is, or the explanation.
///
/// # Errors
/// `out` can't be written.
pub fn print(arguments: &MachineArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    match arguments {
        MachineArguments { explain: false, .. } => {
            out.write_all(REFERENCE_TOML.as_bytes()).map_err(CliError::Output)?;
        }
        MachineArguments { json: true, .. } => {
            let keys = |table: &'static KeyTable| table.keys.iter().map(|key| key_json(table, key));
            let all: Vec<KeyJson> = KEY_TABLES.iter().flat_map(keys).collect();
            write_json(&all, out)?;
        }
        MachineArguments { json: false, .. } => explain(out).map_err(CliError::Output)?,
    }
    Ok(Outcome::Done)
}

fn key_json(table: &KeyTable, key: &Key) -> KeyJson {
    let &Key { name, unit, values, may_be_more, range, default, meaning } = key;
    KeyJson {
        table: table.name,
        table_is_optional: table.is_optional,
        key: name,
        unit,
        values,
        may_be_more,
        range,
        default,
        meaning,
    }
}

fn explain(out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "Keys of a machine file. Everything else is refused, with its line and column.")?;
    for table in KEY_TABLES {
        let heading = match table.name {
            "" => "At the top".to_owned(),
            name if is_list(name) => format!("[[{name}]]"),
            name => format!("[{name}]"),
        };
        let optional = if table.is_optional { " Optional." } else { "" };
        writeln!(out, "\n{heading}  {}{optional}", table.meaning)?;
        for Key { name, unit, values, may_be_more, range, default, meaning } in table.keys {
            let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
            let times = match (values, may_be_more) {
                (1, _) => String::new(),
                (values, false) => format!("{values} times "),
                (values, true) => format!("{values} times or more "),
            };
            let default = default.map_or_else(|| "required".to_owned(), |value| format!("default {value}"));
            writeln!(out, "  {name}{unit}: {times}{range}; {default}\n      {meaning}")?;
        }
    }
    Ok(())
}
