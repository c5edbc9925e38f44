//! Experiments with the drives of a machine, and its tuning: `motion drive` with its usual figures.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::sliders::{self, SliderJson};
use super::{Answer, Progress, Stage, Work};
use crate::drive::circle::{self, CircleFigures};
use crate::drive::circle_motion::{Circle, plane_of};
use crate::drive::harmonic::{self, HarmonicFigures, Response};
use crate::drive::inertia::{self, InertiaFigures};
use crate::drive::reference::{BANDWIDTH_FEED_MM_S, CIRCLE_FEED_MM_S};
use crate::drive::step::Step;
use crate::drive::verification::{self, Verdict};
use crate::drive::{AXES, DriveError, Recording, Terms, experiment};
use crate::gcode::{Axis, Plane};
use crate::identify::Identification;
use crate::machine::{AxisEdit, Machine, NumberEdit, edited, with_numbers};
use crate::report::Figure;
use crate::report::drive::{
    Around, CIRCLE_LIMIT_UM, CircleSweep, TunedAxis, circle_around, circle_figures, harmonic_figures,
    inertia_figure, step_figures, tune_figures,
};
use crate::tuning::{self, AxisTuning, identify_axes, propose};

/// Frequencies of harmonic motion, of circles, and of motion under load \[Hz\]; the loads, as added inertia over the axis' own.
const HARMONIC_HZ: [f64; 10] = [4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0];
const CIRCLES_HZ: [f64; 8] = [1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0];
/// Frequencies of which the error around the circle is drawn \[Hz\].
const DRAWN_HZ: [f64; 2] = [4.0, 13.0];
const LOADED_HZ: f64 = 8.0;
const LOADS: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Experiment {
    /// The feed steps within one tick, open loop.
    Step,
    /// Amplitude and phase over frequency, open loop.
    Harmonic,
    /// Contour error over frequency.
    Circle,
    /// A growing load, open loop.
    Inertia,
    /// Identifies and tunes all axes.
    Tune,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DriveRequest {
    experiment: Experiment,
    /// The axis, from 0. Circles are of X and Y, tuning is of all axes.
    axis: usize,
    machine_name: String,
    machine: String,
    #[serde(default)]
    edits: Vec<NumberEdit>,
}

#[derive(Serialize)]
struct DriveJson {
    /// The machine's file, changed as was asked for.
    machine: String,
    sliders: Vec<SliderJson>,
    axes: Vec<String>,
    /// The outcome in a sentence, and whether it is a good one.
    outcome: String,
    is_good: bool,
    tables: Vec<Table>,
    figures: Vec<Figure>,
    /// The tuned machine's file.
    tuned: Option<String>,
}

/// What a page shows as a table.
#[derive(Debug, Serialize)]
struct Table {
    title: String,
    /// Words below the title.
    words: Vec<String>,
    /// Headings: a word, and its unit in brackets; words begin with a star.
    head: Vec<&'static str>,
    rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Cell {
    Number(f64),
    Words(String),
}

/// Nothing where there is no number.
fn number(value: Option<f64>) -> Cell {
    value.map_or_else(|| Cell::Words("–".to_owned()), Cell::Number)
}

fn words(text: impl Into<String>) -> Cell {
    Cell::Words(text.into())
}

/// What is made of the machine so far.
struct Bench {
    machine_name: String,
    text: String,
    machine: Machine,
    tables: Vec<Table>,
    figures: Vec<Figure>,
    responses: Vec<HarmonicFigures>,
    loads: Vec<(InertiaFigures, Recording)>,
    sweeps: Vec<(&'static str, Vec<CircleFigures>)>,
    /// Circles that are drawn.
    shown: Vec<Around>,
    found: Vec<Identification>,
    proposals: Vec<AxisTuning>,
    /// Text and machine after tuning.
    tuned: Option<(String, Machine)>,
    /// The acceleration that each axis bears \[mm/s²\].
    bears_mm_s2: [f64; AXES],
    /// Circles before tuning, or why they can't be driven.
    before: Vec<Result<Driven, String>>,
    worse: usize,
    compared: usize,
}

/// A circle's figures, and what is drawn of it.
type Driven = (CircleFigures, Around);

/// A run, or what is concluded from runs.
type Piece = Box<dyn FnOnce(&mut Bench) -> Result<(), String>>;

struct Experimenting {
    experiment: Experiment,
    bench: Bench,
    pieces: VecDeque<Piece>,
    all: usize,
}

/// Reads the machine.
pub(super) fn begin(request: DriveRequest) -> Result<Box<dyn Work>, String> {
    let DriveRequest { experiment, axis, machine_name, machine, edits } = request;
    let text = with_numbers(&machine_name, &machine, &edits).map_err(|error| error.to_string())?;
    let machine = Machine::from_toml(&machine_name, &text).map_err(|error| error.to_string())?;
    let letters = machine.axes.each_ref().map(|axis| axis.letter);
    if letters != [Axis::X, Axis::Y, Axis::Z].map(Some) {
        let found: Vec<&str> = letters.into_iter().flatten().map(Axis::name).collect();
        let found = found.join(", ");
        return Err(format!(
            "found {machine_name} with the axes {found}, expected X, Y and Z, in this order, for experiments"
        ));
    }
    if axis >= AXES {
        return Err(format!("found axis {axis}, expected one from 0 to {}", AXES - 1));
    }
    let pieces = match experiment {
        Experiment::Step => step(axis),
        Experiment::Harmonic => harmonic(axis),
        Experiment::Circle => circles(),
        Experiment::Inertia => loads(axis),
        Experiment::Tune => tune(),
    };
    let bench = Bench {
        machine_name,
        text,
        machine,
        tables: Vec::new(),
        figures: Vec::new(),
        responses: Vec::new(),
        loads: Vec::new(),
        sweeps: Vec::new(),
        shown: Vec::new(),
        found: Vec::new(),
        proposals: Vec::new(),
        tuned: None,
        bears_mm_s2: [f64::INFINITY; AXES],
        before: Vec::new(),
        worse: 0,
        compared: 0,
    };
    Ok(Box::new(Experimenting { experiment, bench, all: pieces.len(), pieces }))
}

impl Work for Experimenting {
    fn advance(&mut self) -> Result<Option<Answer>, String> {
        if let Some(piece) = self.pieces.pop_front() {
            piece(&mut self.bench)?;
        }
        if !self.pieces.is_empty() {
            return Ok(None);
        }
        let Bench { text, machine, tables, figures, tuned, worse, compared, .. } = &mut self.bench;
        let is_verified = self.experiment != Experiment::Tune || *compared > 0;
        let is_good = *worse == 0 && is_verified;
        let outcome = match (self.experiment, is_good) {
            (Experiment::Tune, true) => "Tuned: no circle is worse than before.".to_owned(),
            (Experiment::Tune, false) if !is_verified => {
                "Not verified: no circle could be driven.".to_owned()
            }
            (Experiment::Tune, false) => format!("Not better: {worse} circles are worse than before."),
            _ => "Done without a fault.".to_owned(),
        };
        let json = DriveJson {
            sliders: sliders::of_machine(text),
            machine: std::mem::take(text),
            axes: machine.axes.iter().map(|axis| axis.name.clone()).collect(),
            outcome,
            is_good,
            tables: std::mem::take(tables),
            figures: std::mem::take(figures),
            tuned: tuned.take().filter(|_| is_good).map(|(text, _)| text),
        };
        Answer::new(&json, Vec::new()).map(Some)
    }

    fn progress(&self) -> Progress {
        let done = self.all - self.pieces.len();
        Progress { stage: Stage::Running, part: done as f64 / self.all.max(1) as f64 }
    }
}

impl Bench {
    fn axis_name(&self, axis: usize) -> String {
        self.machine.axes[axis].name.clone()
    }

    fn begin_table(&mut self, title: String, head: &[&'static str]) {
        self.tables.push(Table { title, words: Vec::new(), head: head.to_vec(), rows: Vec::new() });
    }

    fn row(&mut self, row: Vec<Cell>) {
        if let Some(table) = self.tables.last_mut() {
            table.rows.push(row);
        }
    }
}

fn told(error: DriveError) -> String {
    error.to_string()
}

fn step(axis: usize) -> VecDeque<Piece> {
    let piece: Piece = Box::new(move |bench| {
        let step = Step { axis, ..Step::reference() };
        let (figures, response) = step.measure(&bench.machine).map_err(told)?;
        bench.figures.extend(step_figures(&bench.machine, &step, &response, &figures).map(Figure::from));
        let title =
            format!("Step of {} to {:.0} mm/min, open loop", bench.axis_name(axis), 60.0 * step.feed_mm_s);
        bench.begin_table(title, &["*Figure", "Value", "*Unit"]);
        let rows = [
            ("delay", Some(figures.delay_s * 1e3), "ms"),
            ("time constant", Some(figures.time_constant_s * 1e3), "ms"),
            ("overshoot", Some(figures.overshoot * 1e2), "%"),
            ("settled within ±0.02 m/min", figures.settling_s.map(|settling_s| settling_s * 1e3), "ms"),
            ("peak acceleration", Some(figures.peak_accel_mm_s2 / 1e3), "m/s²"),
            ("peak jerk", Some(figures.peak_jerk_mm_s3 / 1e3), "m/s³"),
            ("−3 dB of its spectrum", figures.bandwidth_hz, "Hz"),
        ];
        for (name, value, unit) in rows {
            bench.row(vec![words(name), number(value), words(unit)]);
        }
        Ok(())
    });
    VecDeque::from([piece])
}

fn response(found: &Response) -> [Cell; 4] {
    let figures =
        [found.swing_ratio, found.fundamental_ratio, found.phase_rad.to_degrees(), found.third_harmonic];
    figures.map(Cell::Number)
}

fn harmonic(axis: usize) -> VecDeque<Piece> {
    let of_frequency = |frequency_hz: f64| -> Piece {
        Box::new(move |bench| {
            if bench.tables.is_empty() {
                let feed_mm_min = 60.0 * BANDWIDTH_FEED_MM_S;
                let title = format!(
                    "Harmonic motion of {} at {feed_mm_min:.0} mm/min, open loop",
                    bench.axis_name(axis)
                );
                bench.begin_table(
                    title,
                    &["Frequency [Hz]", "Swing", "Fundamental", "Phase [°]", "Third harmonic"],
                );
            }
            let circle = Circle { plane: plane_of(axis), ..Circle::new(frequency_hz, BANDWIDTH_FEED_MM_S) };
            let found = harmonic::measure(&experiment::open_loop(&bench.machine), &circle).map_err(told)?;
            let of_axis = found.axes.iter().find(|found| found.axis == axis).unwrap_or(&found.axes[0]);
            bench.row([Cell::Number(frequency_hz)].into_iter().chain(response(of_axis)).collect());
            bench.responses.push(found);
            Ok(())
        })
    };
    let draw: Piece = Box::new(move |bench| {
        bench.figures.push(harmonic_figures(&bench.machine, &[axis], &bench.responses));
        Ok(())
    });
    HARMONIC_HZ.into_iter().map(of_frequency).chain([draw]).collect()
}

/// The motion under load.
fn loaded(axis: usize) -> Circle {
    Circle { plane: plane_of(axis), ..Circle::new(LOADED_HZ, BANDWIDTH_FEED_MM_S) }
}

fn loads(axis: usize) -> VecDeque<Piece> {
    let of_load = |load: f64| -> Piece {
        Box::new(move |bench| {
            if bench.tables.is_empty() {
                let title = format!("{} at {LOADED_HZ} Hz under load, open loop", bench.axis_name(axis));
                bench.begin_table(
                    title,
                    &[
                        "Added inertia",
                        "Swing",
                        "Fundamental",
                        "Phase [°]",
                        "Third harmonic",
                        "Peak acceleration [m/s²]",
                        "Plateau [m/s²]",
                        "*Current limit",
                    ],
                );
            }
            let (found, recording) =
                inertia::measure(&bench.machine, &loaded(axis), axis, load).map_err(told)?;
            let acceleration =
                [found.peak_accel_mm_s2, found.plateau_accel_mm_s2].map(|a| Cell::Number(a / 1e3));
            let acts = words(if found.is_limited { "acts" } else { "–" });
            let row = [Cell::Number(load)].into_iter().chain(response(&found.response));
            bench.row(row.chain(acceleration).chain([acts]).collect());
            bench.loads.push((found, recording));
            Ok(())
        })
    };
    let draw: Piece = Box::new(move |bench| {
        bench.figures.push(inertia_figure(&loaded(axis), &bench.loads).map_err(told)?.into());
        Ok(())
    });
    LOADS.into_iter().map(of_load).chain([draw]).collect()
}

fn circles() -> VecDeque<Piece> {
    let of_circle = |(terms, frequency_hz): (Terms, f64)| -> Piece {
        Box::new(move |bench| {
            let title = format!(
                "Circles of X and Y at {:.0} mm/min, feedforward {}",
                60.0 * CIRCLE_FEED_MM_S,
                terms.name()
            );
            if bench.tables.last().is_none_or(|table| table.title != title) {
                bench.begin_table(
                    title,
                    &[
                        "Frequency [Hz]",
                        "Radius [mm]",
                        "Contour error [µm]",
                        "Form deviation [µm]",
                        "Following error of X [µm]",
                        "of Y [µm]",
                    ],
                );
            }
            let machine = terms.of(&bench.machine);
            let circle = Circle::new(frequency_hz, CIRCLE_FEED_MM_S);
            let recording = circle.record(&machine).map_err(told)?;
            let found = circle::figures(&recording, &circle).map_err(told)?;
            if DRAWN_HZ.contains(&frequency_hz) {
                bench.shown.push(Around::of(terms.name(), &circle, &recording).map_err(told)?);
            }
            let [x, y] = found.following_um;
            let row = [found.frequency_hz, found.radius_mm, found.contour_um(), found.form_um(), x, y];
            bench.row(row.map(Cell::Number).into());
            match bench.sweeps.last_mut() {
                Some((name, circles)) if *name == terms.name() => circles.push(found),
                _ => bench.sweeps.push((terms.name(), vec![found])),
            }
            Ok(())
        })
    };
    let draw: Piece = Box::new(|bench| {
        let sweeps: Vec<CircleSweep<'_>> =
            bench.sweeps.iter().map(|(name, circles)| CircleSweep { name, circles }).collect();
        bench.figures.push(circle_figures(&bench.machine, &sweeps, CIRCLE_LIMIT_UM).into());
        bench.figures.extend(circle_around(&bench.machine, &bench.shown, CIRCLE_LIMIT_UM));
        Ok(())
    });
    let choices = [Terms::V, Terms::Va, Terms::AsIs];
    choices
        .into_iter()
        .flat_map(|terms| CIRCLES_HZ.map(|hz| (terms, hz)))
        .map(of_circle)
        .chain([draw])
        .collect()
}

fn tune() -> VecDeque<Piece> {
    let identify = |axis: usize| -> Piece {
        Box::new(move |bench| {
            bench.found.extend(identify_axes(&bench.machine, &[axis]).map_err(told)?);
            Ok(())
        })
    };
    let before = |(plane, hz): (Plane, f64)| -> Piece {
        Box::new(move |bench| {
            let found = driven(bench, &bench.machine, plane, hz, "before");
            bench.before.push(found);
            Ok(())
        })
    };
    let after = |(index, (plane, hz)): (usize, (Plane, f64))| -> Piece {
        Box::new(move |bench| compare(bench, index, plane, hz))
    };
    let all: Vec<usize> = (0..AXES).collect();
    let of_plane = |plane: Plane| verification::VERIFIED_HZ.map(|hz| (plane, hz));
    let circles: Vec<(Plane, f64)> = verification::planes(&all).into_iter().flat_map(of_plane).collect();
    let propose: Piece = Box::new(proposed);
    let draw: Piece = Box::new(|bench| {
        let of = |(axis, (found, tuning))| TunedAxis { axis, found, tuning: Some(tuning) };
        let axes: Vec<TunedAxis<'_>> = bench.found.iter().zip(&bench.proposals).enumerate().map(of).collect();
        bench.figures = tune_figures(&bench.machine, &axes, &bench.shown);
        Ok(())
    });
    let pieces = (0..AXES).map(identify).chain([propose]);
    pieces
        .chain(circles.clone().into_iter().map(before))
        .chain(circles.into_iter().enumerate().map(after))
        .chain([draw])
        .collect()
}

/// A circle of the machine before or after tuning, within what its axes bear.
fn driven(
    bench: &Bench,
    machine: &Machine,
    plane: Plane,
    frequency_hz: f64,
    name: &str,
) -> Result<Driven, String> {
    let [first, second, _] = plane.axes();
    let bears_mm_s2 = bench.bears_mm_s2[first].min(bench.bears_mm_s2[second]);
    let (circle, _) = verification::circle(plane, frequency_hz, &bench.machine, bears_mm_s2);
    let recording = circle.record(machine).map_err(told)?;
    let figures = circle::figures(&recording, &circle).map_err(told)?;
    Ok((figures, Around::of(name, &circle, &recording).map_err(told)?))
}

/// The machine's file with the figures proposed, and tables of what was found and what is changed.
fn proposed(bench: &mut Bench) -> Result<(), String> {
    let mut edits = Vec::with_capacity(AXES);
    let all_found = std::mem::take(&mut bench.found);
    for (axis, found) in all_found.iter().enumerate() {
        bench.bears_mm_s2[axis] = verification::bears_mm_s2(found).unwrap_or(f64::INFINITY);
        let settings = &bench.machine.axes[axis];
        let proposal = propose(settings, found, tuning::Method::Inverse, bench.machine.tick_s);
        let proposal = proposal.map_err(|error| error.to_string())?;
        let title = format!("Axis {}", bench.axis_name(axis));
        bench.begin_table(title, &["*Key", "Before", "After", "*Unit", "*Because"]);
        for change in &proposal.changes {
            let reason = words(change.reason.clone());
            bench.row(vec![
                words(change.key),
                number(change.before),
                number(change.after),
                words(change.unit),
                reason,
            ]);
        }
        if let Some(table) = bench.tables.last_mut() {
            table.words = found.parameters.to_string().lines().map(str::to_owned).collect();
            table.words.extend(proposal.remarks.iter().map(|remark| format!("Note: {remark}")));
        }
        let (gains, feedforward) = (proposal.gains, proposal.feedforward);
        edits.push(AxisEdit { axis, gains, feedforward, output_offset_v: proposal.output_offset_v });
        bench.proposals.push(proposal);
    }
    bench.found = all_found;
    let text = edited(&bench.machine_name, &bench.text, &edits).map_err(|error| error.to_string())?;
    // Verified is exactly what the file says.
    let machine = Machine::from_toml(&bench.machine_name, &text).map_err(|error| error.to_string())?;
    bench.tuned = Some((text, machine));
    Ok(())
}

/// A circle after tuning, beside the one before.
fn compare(bench: &mut Bench, index: usize, plane: Plane, frequency_hz: f64) -> Result<(), String> {
    let Some((_, tuned)) = &bench.tuned else { return Ok(()) };
    let after = driven(bench, tuned, plane, frequency_hz, "after");
    let axes = [plane.axes()[0], plane.axes()[1]];
    let [first, second] = axes.map(|axis| bench.axis_name(axis));
    let title = format!("Circles of {first} and {second}, before and after");
    let verdict = Verdict { machine: tuned, is_tuned: [true; 2] };
    let (row, is_worse) = match (&bench.before[index], after) {
        (Ok((before, around)), Ok((after, around_after))) => {
            bench.compared += 1;
            bench.shown.extend([around.clone(), around_after]);
            let is_worse = !verdict.is_no_worse(before, &after);
            // Contour and form.
            let errors = before.errors_um_beside(&after).into_iter().take(4);
            let figures = [before.feed_mm_s * 60.0].into_iter().chain(errors).map(Cell::Number);
            let verdict = words(if is_worse { "worse" } else { "no worse" });
            (figures.chain([verdict]).collect::<Vec<_>>(), is_worse)
        }
        // What the machine could drive before, it is to drive now.
        (before, after) => {
            let told = before.as_ref().err().cloned().or(after.err()).unwrap_or_default();
            let nothing = (0..5).map(|_| number(None));
            (nothing.chain([words(told)]).collect(), before.is_ok())
        }
    };
    bench.worse += usize::from(is_worse);
    if bench.tables.last().is_none_or(|table| table.title != title) {
        let head = [
            "Frequency [Hz]",
            "Feed [mm/min]",
            "Contour error before [µm]",
            "after [µm]",
            "Form deviation before [µm]",
            "after [µm]",
            "*Verdict",
        ];
        bench.begin_table(title, &head);
    }
    bench.row([Cell::Number(frequency_hz)].into_iter().chain(row).collect());
    Ok(())
}
