//! `motion drive tune`: identify the axes, propose regulator figures with their reasons, verify them on
//! circles, and write them into the machine file.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::axis_named;
use super::identify::from_recording;
use super::verification::{Verification, VerificationJson};
use crate::cli::error::{CliError, Outcome};
use crate::cli::input::MachineText;
use crate::cli::outputs::{self, Written};
use crate::cli::table::{self, Align};
use crate::cli::write_json;
use crate::drive::DriveError;
use crate::drive::circle_motion::Circle;
use crate::drive::learning::{LearningOptions, Learnt, Model, Reason, RepeatFigures, Robustness, learn};
use crate::drive::recorded::Scales;
use crate::drive::reference::CIRCLE_FEED_MM_S;
use crate::drive::verification::{bears_mm_s2, planes};
use crate::files::Files;
use crate::identify::{Estimate, Identification};
use crate::machine::{AxisEdit, AxisSettings, Machine, edited};
use crate::report::drive::{LearntRow, TunedAxis, Tuning, tune_findings};
use crate::report::{Findings, Verdict};
use crate::simulate::StretchCorrection;
use crate::tuning::{self, AxisTuning, identify_axes, propose};

const HELP: &str = "\
All axes are simulated: those of the machine file, with its [axis.drive]. No axis of a real machine is moved. With --from
one axis is identified from a recording of a real one, and the circles are driven by the model that was found.

The command runs velocity steps and circles in open loop, for longer where a margin is not known well. From the
converter's outputs and the encoders' counts it estimates the parameters of each drive. From these it derives gains,
with their margins, and a feedforward. Then it drives circles with the old and the new figures, in as many planes as
it takes to move every tuned axis. Where both axes of a plane were tuned, the contour error counts; where only one
was, its following error counts.

Examples:
  motion drive tune                                  see what the reference machine could do
  motion drive tune --machine mine.toml --output mine.toml
                                                     write the figures into the file; its comments stay
  motion drive tune --method series --learn 5        and the gain by learning from repeats
  motion drive tune --axis X --method fit --json     V, A and J gains only, for a script

JSON: axes: list of {name, found: {velocity_gain_per_s…: {value, half_width_95, determined}}, margins: {crossover_hz,
phase_deg, gain, sensitivity, half_widths_95: {phase_deg, gain}}, changes: list of {key, before, after, unit, reason},
remarks}, verification: {feed_mm_min, circles: list of {axes, frequency_hz, feed_mm_min, before, after:
{contour_error_um, form_deviation_um, following_error_first_um, following_error_second_um}}, not_driven: list of {axes,
frequency_hz, feed_mm_min, reason}}, learning: null, or {repeats: list of {contour_error_um, following_error_um_rms of
the three axes}, best_repeat, ended, robustness: list of {axis, filter_corner_hz, contraction, contraction_hz}, reason
(null if a correction was learnt; else why not: then without repeats where it could not begin)}, output, reason (null
if the machine file was written; else why not, also where nothing could be tuned).

Circles stay within what the outputs reach and the current limit that was found bears: a circle that is driven slower
than the others, or not at all, is in not_driven.

--report: parameters with intervals and what is not determined, gains and feedforward with reasons, margins, Bode plots of
model and measurement, circles before and after. It is written where tuning fails, too, with the reason in red; where an
argument or a file is refused, it is not.

--learn-output: CSV with time_s from the stretch's first tick on, and a column of mm/s for each axis, added to
feedforward and linear between rows; CorrectedIntake::correct hands it to the kernel. It has no rows if no correction was
better than none. Without this option the learnt correction is only shown.

Exit status 1, and the machine file stays as it was: the tuned machine is worse on a circle than before, or the recordings
do not determine the parameters that everything depends on (command gain, Kv, Ti, total delay). Exit status 1, too, where
learning can't begin; a machine that is better without is written all the same.";

/// Tune the simulated axes: identify them, propose gains and feedforward with reasons, verify them on
/// circles.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct TuneArguments {
    /// Axes to tune; without it, all.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    axis: Vec<String>,
    /// Identify the one axis that --axis names from this recording, and move nothing: of `motion`, or CSV (see
    /// `motion drive identify`).
    #[arg(long, value_name = "FILE", requires = "axis")]
    from: Option<PathBuf>,
    /// The method for feedforward.
    #[arg(long, value_enum, default_value_t = Method::Inverse)]
    method: Method,
    /// Then drive a circle this many times and learn from each repeat; without it, no learning.
    #[arg(long, value_name = "REPEATS")]
    learn: Option<usize>,
    /// Frequency of the circle that is learnt, Hz.
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 10.0,
        allow_negative_numbers = true,
        requires = "learn"
    )]
    learn_hz: f64,
    /// Write the best learnt correction: CSV, velocity commands over the time in the stretch.
    #[arg(long, value_name = "FILE", requires = "learn")]
    learn_output: Option<PathBuf>,
    /// Write the machine file with the new figures. It may be the file that is read.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Write a self-contained HTML page with what was found, gains, margins, Bode plots and circles before
    /// and after, also where tuning fails; an existing file is replaced.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print JSON; every key carries its unit.
    #[arg(long)]
    json: bool,
}

/// The method for feedforward, as an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// The drive's inverse with friction and bed, led by its dead time.
    Inverse,
    /// V, A and J gains of the inverse's series.
    Series,
    /// V, A and J gains with the least following error from 1 to 20 Hz.
    Fit,
}

impl From<Method> for tuning::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Inverse => Self::Inverse,
            Method::Series => Self::Series,
            Method::Fit => Self::Fit,
        }
    }
}

/// Identifies, proposes, verifies, prints and writes.
///
/// # Errors
/// An argument is refused, an axis can't be identified, a fault ended a run, or a file can't be written.
pub fn run(arguments: &TuneArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([("--machine", arguments.machine.as_deref())]);
    let output = match &arguments.output {
        Some(path) => Some(files.edited("--output", path, "--machine")?),
        None => None,
    };
    let learn_output = outputs::open(&mut files, "--learn-output", arguments.learn_output.as_ref())?;
    let report = outputs::open(&mut files, "--report", arguments.report.as_ref())?;
    let source = MachineText::read(arguments.machine.as_ref())?;
    let machine = source.xyz_machine()?;
    let axes = match arguments.axis.as_slice() {
        [] => (0..machine.axes.len()).collect(),
        names => names.iter().map(|name| axis_named(&machine, name)).collect::<Result<Vec<_>, _>>()?,
    };
    // Before the work: a wrong argument should not cost the user a long run.
    let plane = planes(&axes).first().copied().unwrap_or_default();
    let learning = arguments.learn.map(|repeats| Lesson {
        circle: Circle { plane, ..Circle::new(arguments.learn_hz, CIRCLE_FEED_MM_S) },
        options: LearningOptions { repeats, ..LearningOptions::default() },
    });
    if let Some(lesson) = &learning {
        lesson.circle.check(machine.tick_s)?;
        lesson.options.check(&machine)?;
    }
    if arguments.from.is_some() && axes.len() != 1 {
        let found = format!("--from with {} axes", axes.len());
        return Err(CliError::Arguments { found, expected: "--axis with the one axis that was recorded" });
    }
    let mut work = Work::default();
    let failure = match work.tune(&machine, &source, &axes, arguments, learning.as_ref()) {
        // Files of a refused input stay as they were.
        Err(refusal) if refusal.exit_code() == ExitCode::from(2) => return Err(refusal),
        done => done.err(),
    };
    let refused = failure.as_ref().map(ToString::to_string);
    let worse = work.verification.as_ref().and_then(Verification::reason);
    let reason = refused.or(worse);
    let mut written = Written::default();
    let is_better = reason.is_none();
    written.write("machine file", output.filter(|_| is_better), |file| file.write_all(work.text.as_bytes()));
    if let (Some(Ok(learnt)), None) = (&work.learnt, &failure) {
        written.write("correction", learn_output, |file| write_correction(&machine, learnt, file));
    }
    let place = written.place_of("machine file").map(str::to_owned);
    let ending =
        Ending { is_refused: failure.is_some(), reason, was_asked: arguments.output.is_some(), place };
    written.write("report", report, |file| work.findings(&machine, &ending, arguments.learn_hz).write(file));
    if let Some(failure) = failure {
        if arguments.json {
            let (axes, verification, learning, output) = ([], None, None, None);
            let reason = failure.to_string();
            write_json(&RefusalJson { axes, verification, learning, output, reason }, out)?;
        } else {
            written.say(out)?;
        }
        return CliError::all([written.outcome(Outcome::Failed), Err(failure)]);
    }
    let Some(verification) = &work.verification else { return written.outcome(Outcome::Failed) };
    if arguments.json {
        let Ending { reason, place, .. } = ending;
        let unwritten =
            || written.failure_of("machine file").unwrap_or_else(|| "--output was not given".to_owned());
        let reason = reason.or_else(|| place.is_none().then(unwritten));
        write_json(&json(&machine, &work.tunings, verification, work.learnt.as_ref(), (place, reason)), out)?;
    } else {
        write_words(&machine, &work.tunings, verification, out).map_err(CliError::Output)?;
        match &work.learnt {
            Some(Ok(learnt)) => {
                write_learnt(&machine, learnt, arguments.learn_hz, out).map_err(CliError::Output)?;
            }
            Some(Err(why)) => writeln!(out, "  {}\n", not_learnt(why)).map_err(CliError::Output)?,
            None => {}
        }
        let end = match (&arguments.output, ending.reason) {
            (_, Some(worse)) => Some(format!("  no machine file is written: {worse}")),
            (None, None) => Some("  no machine file is written; --output FILE writes it".to_owned()),
            (Some(_), None) => None,
        };
        end.map_or(Ok(()), |end| writeln!(out, "{end}")).map_err(CliError::Output)?;
        written.say(out)?;
    }
    let is_done = is_better && !matches!(work.learnt, Some(Err(_)));
    written.outcome(if is_done { Outcome::Done } else { Outcome::Failed })
}

/// How tuning ended.
struct Ending {
    /// Nothing could be tuned.
    is_refused: bool,
    /// Why the machine is not better.
    reason: Option<String>,
    /// Whether a machine file was to be written, and where it was.
    was_asked: bool,
    place: Option<String>,
}

impl Ending {
    /// The sentence that says so: its beginning, and the rest.
    fn words(&self) -> (Verdict, &'static str, String) {
        let no_worse = "no circle is worse than before.";
        match (&self.reason, &self.place) {
            (Some(reason), _) if self.is_refused => (Verdict::Failed, "Not tuned:", reason.clone()),
            (Some(reason), _) => {
                (Verdict::Failed, "Not better:", format!("{reason}. No machine file is written."))
            }
            (None, Some(place)) => {
                (Verdict::Done, "Tuned:", format!("{no_worse} The machine file is written to {place}."))
            }
            (None, None) if self.was_asked => {
                (Verdict::Failed, "Not written:", format!("{no_worse} The machine file can’t be written."))
            }
            (None, None) => {
                let words = format!("{no_worse} No machine file is written; --output FILE writes it.");
                (Verdict::Unfinished, "Tuned, not written:", words)
            }
        }
    }
}

/// How far tuning has come.
#[derive(Default)]
struct Work {
    /// The axes that were identified.
    found: Vec<(usize, Identification)>,
    /// Those of them for which there is a proposal.
    tunings: Vec<Tuned>,
    /// The machine file with the new figures.
    text: String,
    verification: Option<Verification>,
    /// What was learnt, or why learning could not begin: the machine is tuned all the same.
    learnt: Option<Result<Learnt, DriveError>>,
}

impl Work {
    /// Identifies, proposes, verifies and learns.
    fn tune(
        &mut self,
        machine: &Machine,
        source: &MachineText,
        axes: &[usize],
        arguments: &TuneArguments,
        learning: Option<&Lesson>,
    ) -> Result<(), CliError> {
        let found = identified(machine, axes, arguments)?;
        self.found = axes.iter().copied().zip(found).collect();
        let method = arguments.method.into();
        for (axis, found) in &self.found {
            let tuning = propose(&machine.axes[*axis], found, method, machine.tick_s)?;
            self.tunings.push(Tuned { axis: *axis, found: found.clone(), tuning });
        }
        // Verify exactly what the file will say.
        let edits: Vec<AxisEdit> = self.tunings.iter().map(Tuned::edit).collect();
        self.text = edited(&source.name, &source.text, &edits)?;
        let tuned = Machine::from_toml(&source.name, &self.text)?;
        // A recorded axis is no simulated one: what is verified is the model that was found.
        let (before, after) = match arguments.from {
            Some(_) => (as_found(machine, &self.tunings), as_found(&tuned, &self.tunings)),
            None => (machine.clone(), tuned.clone()),
        };
        let bears: Vec<Option<f64>> = self.found.iter().map(|(_, found)| bears_mm_s2(found)).collect();
        self.verification = Some(Verification::new(&before, &after, axes, &bears));
        self.learnt = learning.map(|lesson| lesson.learn(&tuned, &self.tunings));
        Ok(())
    }

    /// What a page shows of it.
    fn findings(&self, machine: &Machine, ending: &Ending, learn_hz: f64) -> Findings {
        let (verdict, bold, rest) = ending.words();
        let (circles, not_driven, shown) =
            self.verification.as_ref().map_or_else(Default::default, Verification::shown);
        let axes = self.found.iter().map(|(axis, found)| {
            let tuned = self.tunings.iter().find(|tuned| tuned.axis == *axis);
            TunedAxis { axis: *axis, found, tuning: tuned.map(|tuned| &tuned.tuning) }
        });
        let of_learning = |learnt: &Learnt| {
            let row = |figures: &RepeatFigures| LearntRow {
                contour_um: figures.contour_um,
                rms_um: figures.rms_um,
            };
            let mut words = vec![format!(
                "A circle at {learn_hz} Hz: repeat {} is the best; ended: {}.",
                learnt.best_repeat,
                ended(&learnt.stopped)
            )];
            words.extend(robustness_in_words(machine, learnt));
            (learnt.repeats.iter().map(row).collect(), words)
        };
        let learnt = self.learnt.as_ref().map(|learnt| match learnt {
            Ok(learnt) => of_learning(learnt),
            Err(why) => (Vec::new(), vec![format!("{}.", not_learnt(why))]),
        });
        let words = [bold, &rest];
        let axes = axes.collect();
        tune_findings(machine, &Tuning { verdict, words, axes, circles, not_driven, shown, learnt })
    }
}

/// `machine` with the drives that were found.
fn as_found(machine: &Machine, tunings: &[Tuned]) -> Machine {
    let mut machine = machine.clone();
    for Tuned { axis, found, .. } in tunings {
        machine.axes[*axis].drive = found.parameters.drive();
    }
    machine
}

/// The axes as they were recorded, or as they are simulated.
fn identified(
    machine: &Machine,
    axes: &[usize],
    arguments: &TuneArguments,
) -> Result<Vec<Identification>, CliError> {
    match (&arguments.from, axes) {
        (Some(path), &[axis]) => {
            let &AxisSettings { mm_s_at_10_v, mm_per_count, .. } = &machine.axes[axis];
            Ok(vec![from_recording(machine, axis, path, Scales { mm_s_at_10_v, mm_per_count })?])
        }
        _ => Ok(identify_axes(machine, axes)?),
    }
}

/// An axis with its identified drive and its new settings.
struct Tuned {
    axis: usize,
    found: Identification,
    tuning: AxisTuning,
}

impl Tuned {
    fn edit(&self) -> AxisEdit {
        let &AxisTuning { gains, feedforward, output_offset_v, .. } = &self.tuning;
        AxisEdit { axis: self.axis, gains, feedforward, output_offset_v }
    }
}

fn write_words(
    machine: &Machine,
    tunings: &[Tuned],
    verification: &Verification,
    out: &mut dyn Write,
) -> io::Result<()> {
    for Tuned { axis, found, tuning } in tunings {
        writeln!(out, "Axis {}\n\n{}", machine.axes[*axis].name, found.parameters)?;
        let columns = [
            ("key", "", Align::Left),
            ("before", "", Align::Right),
            ("after", "", Align::Right),
            ("unit", "", Align::Left),
            ("because", "", Align::Left),
        ];
        let rows: Vec<[String; 5]> = tuning
            .changes
            .iter()
            .map(|change| {
                [
                    change.key.to_owned(),
                    number(change.before),
                    number(change.after),
                    change.unit.to_owned(),
                    change.reason.clone(),
                ]
            })
            .collect();
        table::write(&columns, &rows, out)?;
        for remark in &tuning.remarks {
            writeln!(out, "  note: {remark}")?;
        }
        writeln!(out)?;
    }
    verification.write_words(out)
}

/// A circle to be learnt.
struct Lesson {
    circle: Circle,
    options: LearningOptions,
}

impl Lesson {
    /// Learns on the tuned machine, with the identified drives; an axis that was not tuned is taken from the
    /// machine file.
    fn learn(&self, tuned: &Machine, tunings: &[Tuned]) -> Result<Learnt, DriveError> {
        let mut models = tuned.axes.each_ref().map(|axis| Model::from(axis.drive));
        for Tuned { axis, found, .. } in tunings {
            let command_gain = found.parameters.command_gain.value;
            models[*axis] = Model { drive: found.parameters.drive(), command_gain };
        }
        learn(tuned, &self.circle, &models, &self.options)
    }
}

/// The correction of the best repeat, by its knots.
fn write_correction(machine: &Machine, learnt: &Learnt, out: &mut impl Write) -> io::Result<()> {
    let StretchCorrection { knot_ticks, knots_mm_s, .. } = &learnt.best;
    write!(out, "time_s")?;
    for axis in &machine.axes {
        write!(out, ",{}_mm_s", axis.name)?;
    }
    writeln!(out)?;
    for (index, knot) in knots_mm_s.iter().enumerate() {
        let time_s = index as f64 * f64::from(*knot_ticks) * machine.tick_s;
        write!(out, "{time_s:.6}")?;
        for value in knot {
            write!(out, ",{value:.6}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn write_learnt(
    machine: &Machine,
    learnt: &Learnt,
    frequency_hz: f64,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "Learning a circle at {frequency_hz} Hz\n")?;
    let columns = [
        ("repeat", "", Align::Right),
        ("contour", "µm", Align::Right),
        ("following, rms, first axis", "µm", Align::Right),
        ("second", "µm", Align::Right),
        ("third", "µm", Align::Right),
    ];
    let rows: Vec<[String; 5]> = learnt
        .repeats
        .iter()
        .zip(0..)
        .map(|(figures, repeat)| {
            let [x, y, z] = figures.rms_um.map(|um| format!("{um:.3}"));
            [repeat.to_string(), format!("{:.2}", figures.contour_um), x, y, z]
        })
        .collect();
    table::write(&columns, &rows, out)?;
    for words in robustness_in_words(machine, learnt) {
        writeln!(out, "  {words}")?;
    }
    writeln!(out, "  repeat {} is the best; ended: {}\n", learnt.best_repeat, ended(&learnt.stopped))
}

/// How safe each axis' law is.
fn robustness_in_words(machine: &Machine, learnt: &Learnt) -> Vec<String> {
    let of = |(axis, robustness): (&AxisSettings, &Option<Robustness>)| {
        let robustness = robustness.as_ref()?;
        Some(format!(
            "{}: filter of {:.0} Hz; a repeat leaves at most {:.2} of an error (at {:.0} Hz), with Kv, Ti, current \
             lag, dead time and the bed's frequency up to a fifth off",
            axis.name, robustness.filter.corner_hz, robustness.contraction, robustness.at_hz
        ))
    };
    machine.axes.iter().zip(&learnt.robustness).filter_map(of).collect()
}

/// Why learning could not begin.
fn not_learnt(why: &DriveError) -> String {
    format!("no correction is learnt: {why}")
}

/// Why no correction came of it, if none did.
fn no_better(learnt: &Learnt) -> Option<String> {
    (learnt.best_repeat == 0)
        .then(|| format!("no correction was better than none; ended: {}", ended(&learnt.stopped)))
}

fn ended(reason: &Reason) -> String {
    match reason {
        Reason::Repeats => "all repeats made".to_owned(),
        Reason::Resolved => "the error is below the encoders' steps".to_owned(),
        Reason::NoBetter => "two repeats in a row were no better".to_owned(),
        Reason::Fault(fault) => format!("a fault: {}", fault.fault),
    }
}

/// A value of the file, or words that it is missing.
fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), toml_number)
}

/// The shortest number that reads back to the same value; small ones with an exponent.
fn toml_number(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:e}") } else { value.to_string() }
}

#[derive(Serialize)]
struct TuneJson<'run> {
    axes: Vec<AxisJson<'run>>,
    verification: VerificationJson,
    learning: Option<LearningJson<'run>>,
    output: Option<String>,
    reason: Option<String>,
}

/// What is told where nothing could be tuned.
#[derive(Serialize)]
struct RefusalJson {
    axes: [(); 0],
    verification: Option<()>,
    learning: Option<()>,
    output: Option<()>,
    reason: String,
}

#[derive(Serialize)]
struct LearningJson<'run> {
    repeats: Vec<RepeatJson>,
    best_repeat: Option<usize>,
    ended: Option<String>,
    robustness: Vec<RobustnessJson<'run>>,
    /// Null if a correction was learnt.
    reason: Option<String>,
}

#[derive(Serialize)]
struct RobustnessJson<'run> {
    axis: &'run str,
    filter_corner_hz: f64,
    contraction: f64,
    contraction_hz: f64,
}

#[derive(Serialize)]
struct RepeatJson {
    contour_error_um: f64,
    following_error_um_rms: [f64; 3],
}

#[derive(Serialize)]
struct AxisJson<'run> {
    name: &'run str,
    found: FoundJson,
    margins: MarginsJson,
    changes: Vec<ChangeJson<'run>>,
    remarks: &'run [String],
}

/// What was found of an axis.
#[derive(Serialize)]
pub(super) struct FoundJson {
    command_gain: EstimateJson,
    command_offset_mm_s: EstimateJson,
    velocity_gain_per_s: EstimateJson,
    integral_time_s: EstimateJson,
    dead_time_s: EstimateJson,
    command_filter_s: EstimateJson,
    current_lag_s: EstimateJson,
    total_delay_s: EstimateJson,
    accel_limit_mm_s2: EstimateJson,
    coulomb_friction_mm_s2: EstimateJson,
    viscous_friction_per_s: EstimateJson,
    load_inertia_ratio: EstimateJson,
    bed: Option<BedJson>,
}

impl FoundJson {
    pub(super) fn of(found: &Identification) -> Self {
        let parameters = &found.parameters;
        let estimate = EstimateJson::of;
        FoundJson {
            command_gain: estimate(parameters.command_gain),
            command_offset_mm_s: estimate(parameters.command_offset_mm_s),
            velocity_gain_per_s: estimate(parameters.velocity_gain_per_s),
            integral_time_s: estimate(parameters.integral_time_s),
            dead_time_s: estimate(parameters.dead_time_s),
            command_filter_s: estimate(parameters.command_filter_s),
            current_lag_s: estimate(parameters.current_lag_s),
            total_delay_s: estimate(parameters.total_delay_s),
            accel_limit_mm_s2: estimate(parameters.accel_limit_mm_s2),
            coulomb_friction_mm_s2: estimate(parameters.coulomb_friction_mm_s2),
            viscous_friction_per_s: estimate(parameters.viscous_friction_per_s),
            load_inertia_ratio: estimate(parameters.load_inertia_ratio),
            bed: parameters.bed.map(|bed| BedJson {
                frequency_hz: estimate(bed.frequency_hz),
                damping_ratio: estimate(bed.damping_ratio),
                mass_ratio: estimate(bed.mass_ratio),
            }),
        }
    }
}

#[derive(Serialize)]
struct BedJson {
    frequency_hz: EstimateJson,
    damping_ratio: EstimateJson,
    mass_ratio: EstimateJson,
}

#[derive(Serialize)]
pub(super) struct EstimateJson {
    value: f64,
    /// Null if it is unbounded.
    half_width_95: Option<f64>,
    determined: bool,
}

impl EstimateJson {
    pub(super) fn of(estimate: Estimate) -> Self {
        Self {
            value: estimate.value,
            half_width_95: Some(estimate.half_width_95).filter(|width| width.is_finite()),
            determined: estimate.is_determined(),
        }
    }
}

#[derive(Serialize)]
struct MarginsJson {
    crossover_hz: f64,
    phase_deg: f64,
    gain: Option<f64>,
    sensitivity: f64,
    half_widths_95: MarginWidthsJson,
}

/// Null where it is unbounded, or there is no margin.
#[derive(Serialize)]
struct MarginWidthsJson {
    phase_deg: Option<f64>,
    gain: Option<f64>,
}

#[derive(Serialize)]
struct ChangeJson<'run> {
    key: &'run str,
    before: Option<f64>,
    after: Option<f64>,
    unit: &'run str,
    reason: &'run str,
}

fn json<'run>(
    machine: &'run Machine,
    tunings: &'run [Tuned],
    verification: &Verification,
    learnt: Option<&Result<Learnt, DriveError>>,
    (output, reason): (Option<String>, Option<String>),
) -> TuneJson<'run> {
    TuneJson {
        axes: tunings.iter().map(|tuned| axis_json(&machine.axes[tuned.axis].name, tuned)).collect(),
        verification: verification.json(),
        learning: learnt.map(|learnt| learning_json(machine, learnt)),
        output,
        reason,
    }
}

fn learning_json<'run>(machine: &'run Machine, learnt: &Result<Learnt, DriveError>) -> LearningJson<'run> {
    let learnt = match learnt {
        Ok(learnt) => learnt,
        Err(why) => {
            let (repeats, best_repeat, ended, robustness) = (vec![], None, None, vec![]);
            return LearningJson { repeats, best_repeat, ended, robustness, reason: Some(not_learnt(why)) };
        }
    };
    let repeat = |figures: &RepeatFigures| RepeatJson {
        contour_error_um: figures.contour_um,
        following_error_um_rms: figures.rms_um,
    };
    let axes = machine.axes.iter().zip(&learnt.robustness);
    let robustness = axes.filter_map(|(axis, robustness)| {
        let Robustness { filter, contraction, at_hz, .. } = robustness.as_ref()?;
        Some(RobustnessJson {
            axis: &axis.name,
            filter_corner_hz: filter.corner_hz,
            contraction: *contraction,
            contraction_hz: *at_hz,
        })
    });
    LearningJson {
        repeats: learnt.repeats.iter().map(repeat).collect(),
        best_repeat: Some(learnt.best_repeat),
        ended: Some(ended(&learnt.stopped)),
        robustness: robustness.collect(),
        reason: no_better(learnt),
    }
}

fn axis_json<'run>(name: &'run str, Tuned { found, tuning, .. }: &'run Tuned) -> AxisJson<'run> {
    let margins = &tuning.margins;
    let width = |Estimate { value, half_width_95 }: Estimate| {
        (value.is_finite() && half_width_95.is_finite()).then_some(half_width_95)
    };
    AxisJson {
        name,
        found: FoundJson::of(found),
        margins: MarginsJson {
            crossover_hz: margins.crossover_hz,
            phase_deg: margins.phase_deg,
            gain: Some(margins.gain).filter(|gain| gain.is_finite()),
            sensitivity: margins.sensitivity,
            half_widths_95: MarginWidthsJson {
                phase_deg: width(tuning.phase_margin_deg),
                gain: width(tuning.gain_margin),
            },
        },
        changes: tuning
            .changes
            .iter()
            .map(|change| ChangeJson {
                key: change.key,
                before: change.before,
                after: change.after,
                unit: change.unit,
                reason: &change.reason,
            })
            .collect(),
        remarks: &tuning.remarks,
    }
}
