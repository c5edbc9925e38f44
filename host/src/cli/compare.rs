//! `motion compare`: how long programs take, exact and blended, compared with what acceleration alone would
//! allow.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::progress::Progress;
use super::table::{self, Align};
use super::{csv_failure, input, write_json};
use crate::compare::{Figures, Path, figures, is_blended};
use crate::gcode::Program;
use crate::machine::{Machine, on_machine};

const EXAMPLES: &str = "\
Examples:
  motion compare part.ngc                        exact path and blends, within the machine's own tolerance
  motion compare parts/ --tolerance 0.01 --tolerance 0.05 --csv > times.csv
      every .ngc file of a folder, with blends of two tolerances

Values: `blends` counts blends and curves; `per block` is the time with one pair of sin² ramps per block, the
published plan, whatever the machine's law is; `least` is the time on the same path without limits of jerk and
snap along it, but under the ceilings that they make, a lower bound for every plan; `accel. alone` is the time
on it under programmed feeds and acceleration alone; `tolerance` is the greatest share of the tolerance that the
path uses; `feed` to `step` are the executed ticks over the limits of axes and path, `step` for the acceleration
step at a junction without a blend; `velocity step` is the most that a kink steps that is passed, in one tick.
Refused programs are listed; then the exit status is 2.";

/// Compare the times of programs: exact path, blends, plan per block, and the least possible.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct CompareArguments {
    /// G-code (`-`: standard input), or folders of .ngc files.
    #[arg(value_name = "PROGRAM|FOLDER", required = true)]
    programs: Vec<PathBuf>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// Tolerance of blends, from 0 to 10 mm; may be given several times. Without it, the machine's tolerance.
    #[arg(long = "tolerance", value_name = "MM", value_parser = tolerance, allow_negative_numbers = true)]
    tolerances: Vec<f64>,
    /// Print JSON: rows, refused.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV, a row per program and path.
    #[arg(long)]
    csv: bool,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=10.0).contains(&value) => Ok(value),
        _ => Err(format!("found {text}, expected a number from 0 to 10")),
    }
}

#[derive(Serialize)]
struct Row {
    program: String,
    path: String,
    blocks: usize,
    blends: usize,
    length_mm: f64,
    time_s: f64,
    per_block_s: f64,
    least_s: f64,
    tolerance_share: f64,
    feed_ratio: f64,
    accel_ratio: f64,
    jerk_ratio: f64,
    accel_step_ratio: f64,
    acceleration_s: f64,
    velocity_step_mm_s: f64,
}

impl Row {
    fn new(program: &str, path: Path, figures: &Figures) -> Self {
        let Figures { blocks, blends, length_mm, time_s, per_block_s, least_s, .. } = *figures;
        let Figures { acceleration_s, tolerance_share, ratios, .. } = *figures;
        Self {
            program: program.to_owned(),
            path: path.to_string(),
            blocks,
            blends,
            length_mm,
            time_s,
            per_block_s,
            least_s,
            tolerance_share,
            feed_ratio: ratios.feed,
            accel_ratio: ratios.accel,
            jerk_ratio: ratios.jerk,
            accel_step_ratio: ratios.accel_step,
            acceleration_s,
            velocity_step_mm_s: ratios.velocity_step_mm_s,
        }
    }
}

#[derive(Serialize)]
struct CompareJson<'a> {
    rows: &'a [Row],
    refused: &'a [String],
}

/// Compares and prints.
///
/// # Errors
/// A program can't be read or is refused (after the others are printed), the machine file is refused, or
/// `out` can't be written.
pub fn compare(arguments: &CompareArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let programs = programs(&arguments.programs)?;
    let own = [on_machine!(machine, machine => machine.path.blend_tolerance_mm)];
    let tolerances_mm = if arguments.tolerances.is_empty() { &own[..] } else { &arguments.tolerances };
    let options = arguments.reading.options(machine.read_options())?;
    let (mut rows, mut refused) = (Vec::new(), Vec::new());
    let mut progress = Progress::new(programs.len() as u64);
    for path in &programs {
        let source = input::read(path)?;
        match source.program(&options) {
            Ok(program) => on_machine!(machine, machine => {
                rows_of(&source.name, &program, tolerances_mm, machine, &mut rows)
            })
            .unwrap_or_else(|error| refused.push(error.to_string())),
            Err(error) => refused.push(error.to_string()),
        }
        progress.step();
    }
    progress.finish();
    if arguments.csv {
        write_csv(&rows, out)?;
    } else if arguments.json {
        write_json(&CompareJson { rows: &rows, refused: &refused }, out)?;
    } else {
        write_tables(&rows, out).map_err(CliError::Output)?;
    }
    if refused.is_empty() { Ok(Outcome::Done) } else { Err(CliError::Refused { programs: refused }) }
}

/// The given programs, and those in folders in the order of their names.
fn programs(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CliError> {
    let mut programs = Vec::new();
    for path in paths {
        if !path.is_dir() {
            programs.push(path.clone());
            continue;
        }
        let failed = |source| CliError::Read { path: path.display().to_string(), source };
        let entries: io::Result<Vec<PathBuf>> =
            fs::read_dir(path).map_err(failed)?.map(|entry| entry.map(|entry| entry.path())).collect();
        let mut files = entries.map_err(failed)?;
        files.retain(|file| file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ngc")));
        files.sort();
        if files.is_empty() {
            let found = format!("{} without a file that ends in .ngc", path.display());
            return Err(CliError::Arguments { found, expected: "a folder of programs" });
        }
        programs.append(&mut files);
    }
    Ok(programs)
}

fn rows_of<const N: usize>(
    name: &str,
    program: &Program,
    tolerances_mm: &[f64],
    machine: &Machine<N>,
    rows: &mut Vec<Row>,
) -> Result<(), crate::compare::CompareError> {
    let written = is_blended(program).then_some(Path::Written);
    let blended = tolerances_mm.iter().map(|&tolerance_mm| Path::Blended(tolerance_mm));
    let paths = [Path::Exact].into_iter().chain(blended).chain(written);
    let mut new = Vec::new();
    for path in paths {
        new.push(Row::new(name, path, &figures(name, program, path, machine)?));
    }
    rows.append(&mut new);
    Ok(())
}

fn write_csv(rows: &[Row], out: &mut dyn Write) -> Result<(), CliError> {
    let mut csv = csv::Writer::from_writer(out);
    for row in rows {
        csv.serialize(row).map_err(|error| CliError::Output(csv_failure(error)))?;
    }
    csv.flush().map_err(CliError::Output)
}

/// So many paths stand beside each other: lines have no more than 100 columns.
const BESIDE: usize = 5;

/// Writes a table for each program: a line for each value, a column for each path.
fn write_tables(rows: &[Row], out: &mut dyn Write) -> io::Result<()> {
    for (index, of_program) in rows.chunk_by(|one, next| one.program == next.program).enumerate() {
        let gap = if index > 0 { "\n" } else { "" };
        let name = of_program.first().map_or("", |row| row.program.as_str());
        writeln!(out, "{gap}{name}")?;
        of_program.chunks(BESIDE).try_for_each(|rows| write_table(rows, out))?;
    }
    Ok(())
}

fn write_table(rows: &[Row], out: &mut dyn Write) -> io::Result<()> {
    let paths = rows.iter().map(|row| (row.path.as_str(), "", Align::Right));
    let columns: Vec<_> = [("path", "", Align::Left)].into_iter().chain(paths).collect();
    let value = |name: &str, of: &dyn Fn(&Row) -> String| -> Vec<String> {
        [name.to_owned()].into_iter().chain(rows.iter().map(of)).collect()
    };
    let time = |name: &str, of: fn(&Row) -> f64| value(name, &|row| format!("{:.4}", of(row)));
    let percent = |name: &str, of: fn(&Row) -> f64| value(name, &|row| format!("{:.1}", 100.0 * of(row)));
    let lines = [
        value("blocks", &|row| row.blocks.to_string()),
        value("blends", &|row| row.blends.to_string()),
        value("length [mm]", &|row| format!("{:.3}", row.length_mm)),
        time("time [s]", |row| row.time_s),
        time("per block [s]", |row| row.per_block_s),
        time("least [s]", |row| row.least_s),
        time("accel. alone [s]", |row| row.acceleration_s),
        percent("tolerance [%]", |row| row.tolerance_share),
        percent("feed [%]", |row| row.feed_ratio),
        percent("accel. [%]", |row| row.accel_ratio),
        percent("jerk [%]", |row| row.jerk_ratio),
        percent("step [%]", |row| row.accel_step_ratio),
        value("velocity step [mm/s]", &|row| format!("{:.3}", row.velocity_step_mm_s)),
    ];
    table::write(&columns, &lines, out)
}
