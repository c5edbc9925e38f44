//! `motion drive screw`: backlash and pitch error, from where the load was measured to be.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use motion_kernel::axis::{AxisCompensation, Backlash};
use motion_kernel::jog::Direction;
use serde::Serialize;

use super::axis_named;
use super::tune::EstimateJson;
use crate::cli::error::{CliError, Outcome};
use crate::cli::input::{self, MachineText};
use crate::cli::outputs::{self, Written};
use crate::cli::write_json;
use crate::drive::screw::{Survey, measure, program, read};
use crate::files::Files;
use crate::identify::{ScrewFound, ScrewReference, ScrewSearch, identify_screw};
use crate::machine::{AxisSettings, Machine, compensated};
use crate::report;

/// Rest at a place \[s\], for the instrument.
const REST_S: f64 = 3.0;

const HELP: &str = "\
An encoder on the motor sees neither play nor the screw's error: an instrument at the load does. --program writes the program
that goes to places along the travel, from both sides, at rest everywhere. Run it without the axis' compensation, note what the
instrument shows at every rest, and read that with --from: CSV with the heading commanded_mm,measured_mm and a row for each
rest, in the order of the motion. The first row says where it began, and has no direction. Without --from the simulated
axis of the machine file is measured.

Which table is written, one over the travel or, with --pitch-mm, one that repeats turn by turn, and with how many points, is
decided by what explains the readings better than chance; the axis has one of the two. What is less than a count of the encoder
is not written, nor backlash whose interval has 0. Compensation that the machine file has of the axis is replaced.

Examples:
  motion drive screw --axis X --from-mm 0 --to-mm 400 --program screw_x.ngc
  motion drive screw --axis X --pitch-mm 5 --from x.csv --machine mine.toml --output mine.toml

JSON: axis, source, readings, backlash_mm {value, half_width_95, determined}, take_up_s (null without backlash), pitch_error
(null or {start_mm, spacing_mm, repeats, points_um, half_width_95_um}), before_um, left_rms_um, left_most_um, outlier (null or
{load_mm, off_um}), output, reason.";

/// What a user should know of an axis that is compensated already.
const OF_COMPENSATED: &str =
    "the machine file compensates this axis: what is measured has to be measured without that";

/// Find backlash and pitch error of an axis, and how to compensate them.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct ScrewArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// What was measured: CSV.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["program", "from_mm", "to_mm", "places", "rounds", "rest_s"])]
    from: Option<PathBuf>,
    /// Write the program that goes to the places, instead of measuring; an existing file is replaced.
    #[arg(long, value_name = "FILE.ngc", conflicts_with_all = ["output", "report", "json", "pitch_mm"])]
    program: Option<PathBuf>,
    /// Travel of a turn of the screw, mm: the error is looked for turn by turn, too.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pitch_mm: Option<f64>,
    /// Where the places begin, machine coordinates in mm; without it, at the travel's end in the machine file.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    from_mm: Option<f64>,
    /// Where the places end.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    to_mm: Option<f64>,
    /// How many places there are.
    #[arg(long, value_name = "NUMBER", default_value_t = 64)]
    places: u32,
    /// How often each is gone to from both sides.
    #[arg(long, value_name = "NUMBER", default_value_t = 2)]
    rounds: u32,
    /// Rest at each, in seconds, for the instrument; without it, 3.
    #[arg(long, value_name = "S", requires = "program", allow_negative_numbers = true)]
    rest_s: Option<f64>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Where the machine file with the compensation goes; it may be --machine itself.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a self-contained HTML page with the curves; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print JSON; every key carries its unit.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct ScrewJson<'run> {
    axis: &'run str,
    source: &'run str,
    readings: usize,
    backlash_mm: EstimateJson,
    take_up_s: Option<f64>,
    pitch_error: Option<PitchErrorJson>,
    before_um: f64,
    left_rms_um: f64,
    left_most_um: f64,
    outlier: Option<OutlierJson>,
    output: Option<&'run str>,
    reason: Option<String>,
}

#[derive(Serialize)]
struct OutlierJson {
    load_mm: f64,
    off_um: f64,
}

#[derive(Serialize)]
struct PitchErrorJson {
    start_mm: f64,
    spacing_mm: f64,
    repeats: bool,
    points_um: Vec<f64>,
    half_width_95_um: f64,
}

/// Writes the program; or measures or reads, identifies, prints and writes.
///
/// # Errors
/// An argument or a file is refused, the readings do not determine a screw, or a file can't be written.
pub fn run(arguments: &ScrewArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files =
        Files::reading([("--machine", arguments.machine.as_deref()), ("--from", arguments.from.as_deref())]);
    let program_file = outputs::open(&mut files, "--program", arguments.program.as_ref())?;
    let output = match &arguments.output {
        Some(path) => Some(files.edited("--output", path, "--machine")?),
        None => None,
    };
    let report = outputs::open(&mut files, "--report", arguments.report.as_ref())?;
    let source = MachineText::read(arguments.machine.as_ref())?;
    let machine = source.xyz_machine()?;
    let axis = axis_named(&machine, &arguments.axis)?;
    if let Some(pitch_mm) = arguments.pitch_mm
        && !(0.1..=1000.0).contains(&pitch_mm)
    {
        let expected = "the travel of a turn, from 0.1 to 1000 mm";
        return Err(CliError::Arguments { found: format!("--pitch-mm {pitch_mm}"), expected });
    }
    if let Some(file) = program_file {
        let program = program(&machine, &survey(arguments, &machine, axis)?);
        let mut written = Written::default();
        written.write("program", Some(file), |file| file.write_all(program.as_bytes()));
        written.say(out)?;
        if machine.axes[axis].compensation.is_some() {
            writeln!(out, "  note: {OF_COMPENSATED}").map_err(CliError::Output)?;
        }
        return written.outcome(Outcome::Done);
    }
    let (measured, readings) = match &arguments.from {
        Some(path) => {
            let source = input::read(path)?;
            let readings = read(&source.name, &source.text)?;
            (source.name, readings)
        }
        None => ("simulated machine".to_owned(), measure(&machine, &survey(arguments, &machine, axis)?)?),
    };
    let settings = &machine.axes[axis];
    let reference = settings.homing.as_ref().map_or_else(ScrewReference::default, |homing| ScrewReference {
        position_mm: homing.config.position.to_mm(),
        is_from_above: homing.config.direction == Direction::Negative,
    });
    // What the drive has beyond the axis' own acceleration.
    let left_mm_s2 = settings.drive_accel_mm_s2() - settings.accel_mm_s2;
    let search = ScrewSearch {
        pitch_mm: arguments.pitch_mm,
        reference,
        least_mm: settings.mm_per_count.abs(),
        curvature_per_mm: left_mm_s2 / (settings.feed_mm_s * settings.feed_mm_s),
    };
    let found = identify_screw(&readings, &search)
        .map_err(|source| CliError::Screw { name: measured.clone(), source })?;
    let compensation = compensation(&found, settings, machine.tick_s);
    let text = compensated(&source.name, &source.text, axis, &compensation)?;
    let refused = Machine::<3>::from_toml(&source.name, &text).err();
    let is_new = compensation.backlash.is_some()
        || compensation.pitch_error.is_some()
        || settings.compensation.is_some();
    let reason = match (&refused, is_new) {
        (Some(refusal), _) => Some(format!("what was found can't be compensated: {refusal}")),
        (None, false) => Some("there is nothing that could be compensated".to_owned()),
        (None, true) if output.is_none() => Some("--output was not given".to_owned()),
        (None, true) => None,
    };
    let mut written = Written::default();
    let output = output.filter(|_| reason.is_none());
    written.write("machine file", output, |file| file.write_all(text.as_bytes()));
    let name = &settings.name;
    written.write("report", report, |file| {
        report::drive::screw_findings(&machine, axis, &found, refused.is_some()).write(file)
    });
    if arguments.json {
        let json = ScrewJson {
            axis: name,
            source: &measured,
            readings: found.readings.len(),
            backlash_mm: EstimateJson::of(found.backlash_mm),
            take_up_s: compensation.backlash.map(|backlash| backlash.take_up_s),
            pitch_error: found.pitch_error.map(|error| PitchErrorJson {
                start_mm: error.table.start_mm,
                spacing_mm: error.table.spacing_mm,
                repeats: error.table.repeats,
                points_um: error.table.points_um().collect(),
                half_width_95_um: error.half_width_95_mm * 1e3,
            }),
            before_um: found.before_mm() * 1e3,
            left_rms_um: found.left_rms_mm * 1e3,
            left_most_um: found.left_most_mm * 1e3,
            outlier: found.outlier().map(|reading| OutlierJson {
                load_mm: reading.load_mm,
                off_um: reading.left_mm().abs() * 1e3,
            }),
            output: written.place_of("machine file"),
            reason: reason.or_else(|| written.failure_of("machine file")),
        };
        write_json(&json, out)?;
    } else {
        writeln!(out, "Screw of axis {name}, from {} readings: {measured}\n", found.readings.len())
            .and_then(|()| write_words(&found, &compensation, out))
            .map_err(CliError::Output)?;
        if settings.compensation.is_some() && arguments.from.is_some() {
            writeln!(out, "  note: {OF_COMPENSATED}").map_err(CliError::Output)?;
        }
        if let Some(reason) = &reason {
            writeln!(out, "  no machine file is written: {reason}").map_err(CliError::Output)?;
        }
        written.say(out)?;
    }
    written.outcome(if refused.is_some() { Outcome::Failed } else { Outcome::Done })
}

/// The places that were asked for.
fn survey(arguments: &ScrewArguments, machine: &Machine, axis: usize) -> Result<Survey, CliError> {
    let end_mm = |asked: Option<f64>, end: usize| {
        asked.or_else(|| machine.axes[axis].travel_mm.map(|travel_mm| travel_mm[end])).ok_or_else(|| {
            CliError::Arguments {
                found: format!("axis {} without travel in the machine file", machine.axes[axis].name),
                expected: "--from-mm and --to-mm",
            }
        })
    };
    let ends_mm = [end_mm(arguments.from_mm, 0)?, end_mm(arguments.to_mm, 1)?];
    let &ScrewArguments { places, rounds, .. } = arguments;
    let rest_s = arguments.rest_s.unwrap_or(REST_S);
    let survey = Survey { axis, ends_mm, places, rounds, rest_s };
    survey.check()?;
    Ok(survey)
}

/// What the machine file gets: what the readings determine and the encoder can tell.
fn compensation(found: &ScrewFound, settings: &AxisSettings, tick_s: f64) -> AxisCompensation {
    let (play_mm, count_mm) = (found.backlash_mm, settings.mm_per_count.abs());
    let is_play = play_mm.value >= count_mm && play_mm.value > play_mm.half_width_95;
    let backlash = is_play.then(|| {
        // Ten nanometres are more than an instrument tells.
        let play_mm = (play_mm.value * 1e5).round().max(1.0) / 1e5;
        let ticks = (settings.take_up_s(play_mm) / tick_s).ceil().max(2.0);
        // To digits that a person can read, and not less.
        Backlash { play_mm, take_up_s: (ticks * tick_s * 1e6 - 1e-6).ceil() / 1e6 }
    });
    AxisCompensation { backlash, pitch_error: found.pitch_error.map(|error| error.table) }
}

fn write_words(found: &ScrewFound, compensation: &AxisCompensation, out: &mut dyn Write) -> io::Result<()> {
    let play = found.backlash_mm;
    let (play_um, half_um) = (play.value * 1e3, play.half_width_95 * 1e3);
    write!(out, "  backlash         {play_um:.2} ± {half_um:.2} µm")?;
    match compensation.backlash {
        Some(backlash) => writeln!(out, ", taken up in {:.3} ms", backlash.take_up_s * 1e3)?,
        None if play.value <= play.half_width_95 => writeln!(out, ": not told from none")?,
        None => writeln!(out, ": less than a count, which is not compensated")?,
    }
    match &found.pitch_error {
        None => writeln!(out, "  pitch error      none that a table would explain better than chance")?,
        Some(error) => {
            let points = error.table.point_count();
            let most_um = error.table.points_um().map(f64::abs).fold(0.0, f64::max);
            let over = if error.table.repeats {
                format!("a turn of {:.4} mm", error.table.spacing_mm * points as f64)
            } else {
                format!("{:.1} mm of travel", error.table.spacing_mm * (points - 1) as f64)
            };
            let half_um = error.half_width_95_mm * 1e3;
            writeln!(
                out,
                "  pitch error      {points} points over {over}, at most {most_um:.2} µm, each ± {half_um:.2} µm"
            )?;
        }
    }
    let (before_um, left_um) = (found.before_mm() * 1e3, found.left_most_mm * 1e3);
    let rms_um = found.left_rms_mm * 1e3;
    if let Some(reading) = found.outlier() {
        let off_um = reading.left_mm().abs() * 1e3;
        writeln!(
            out,
            "  note: the reading at {:.3} mm is {off_um:.2} µm off, more than scatter: is its row right?",
            reading.load_mm
        )?;
    }
    writeln!(
        out,
        "  off the mean     at most {before_um:.2} µm before; {left_um:.2} µm with this, {rms_um:.2} µm rms"
    )
}
