//! The page of tuning: parameters, gains with their reasons, margins, Bode plots, circles before and after.
//!
//! It is written in failing cases, too: with what was found until then, and why there is no more.

use std::f64::consts::TAU;

use super::super::figure::{Axis, Figure, Graph, Series, Stack};
use super::super::findings::{Findings, Verdict};
use super::super::format::{figure, fixed};
use super::super::palette;
use super::circle::{Around, CIRCLE_LIMIT_UM, around, circle_around};
use super::{db, over_frequency};
use crate::drive::circle::CircleFigures;
use crate::drive::model;
use crate::identify::{Described, Estimate, HarmonicReading, Identification};
use crate::machine::{AxisSettings, Machine};
use crate::tuning::AxisTuning;
use crate::tuning::gains::scaled;
use crate::tuning::margins::open_loop;

/// Frequencies of the models' curves \[Hz\], and how many there are.
const CURVE_HZ: (f64, f64) = (1.0, 200.0);
const CURVE_POINTS: u32 = 241;

/// An axis that was identified and, unless it was refused, tuned.
#[derive(Clone, Copy, Debug)]
pub struct TunedAxis<'a> {
    /// The axis, from 0.
    pub axis: usize,
    /// What was found of it.
    pub found: &'a Identification,
    /// What is proposed.
    pub tuning: Option<&'a AxisTuning>,
}

/// Circles of one plane before and after, in pairs of one frequency.
#[derive(Clone, Debug)]
pub struct Circles<'a> {
    /// The plane's axes, from 0.
    pub axes: [usize; 2],
    /// Before, after, and whether it is worse.
    pub pairs: Vec<(&'a CircleFigures, &'a CircleFigures, bool)>,
}

/// A circle that was not driven as it should.
#[derive(Clone, Debug)]
pub struct NotDriven<'a> {
    /// Names of its axes.
    pub axes: &'a [String; 2],
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Feed \[mm/min\].
    pub feed_mm_min: f64,
    /// Why.
    pub reason: &'a str,
}

/// A repeat of a circle that was learnt.
#[derive(Clone, Copy, Debug)]
pub struct LearntRow {
    /// Contour error \[µm\].
    pub contour_um: f64,
    /// Following error of the three axes, rms \[µm\].
    pub rms_um: [f64; 3],
}

/// What came of tuning.
#[derive(Clone, Debug)]
pub struct Tuning<'a> {
    /// How it ended, and the sentence that says so: its beginning in bold, and the rest.
    pub verdict: Verdict,
    /// The sentence.
    pub words: [&'a str; 2],
    /// The axes, as far as it came.
    pub axes: Vec<TunedAxis<'a>>,
    /// Circles that were driven, by plane.
    pub circles: Vec<Circles<'a>>,
    /// Circles that were not, or slower.
    pub not_driven: Vec<NotDriven<'a>>,
    /// Circles that are drawn.
    pub shown: &'a [Around],
    /// The repeats, and in words what came of learning.
    pub learnt: Option<(Vec<LearntRow>, Vec<String>)>,
}

/// The page of tuning.
#[must_use]
pub fn tune_findings(machine: &Machine, tuning: &Tuning<'_>) -> Findings {
    let names: Vec<&str> = tuning.axes.iter().map(|of| machine.axes[of.axis].name.as_str()).collect();
    let title = match names.as_slice() {
        [] => "Tuning".to_owned(),
        [one] => format!("Tuning of axis {one}"),
        many => format!("Tuning of axes {}", many.join(", ")),
    };
    let mut findings = Findings::new(&title, &machine.name, tuning.verdict, tuning.words);
    if !tuning.not_driven.is_empty() {
        let rows = tuning.not_driven.iter().map(|circle| {
            let [first, second] = circle.axes;
            let hz = figure(circle.frequency_hz, 4);
            vec![
                format!("{first}, {second}, {hz} Hz"),
                fixed(circle.feed_mm_min, 0),
                circle.reason.to_owned(),
            ]
        });
        findings.section("Circles that were not driven as they should be");
        findings.table("Not driven", &["*Axes, frequency", "Feed [mm/min]", "*Reason"], rows);
    }
    for of in &tuning.axes {
        of_axis(machine, of, &mut findings);
    }
    for circles in &tuning.circles {
        of_plane(machine, circles, tuning, &mut findings);
    }
    if let Some((repeats, words)) = &tuning.learnt {
        of_learning(machine, repeats, words, &mut findings);
    }
    findings
}

/// What is drawn of identified axes, and of circles before and after.
#[must_use]
pub fn tune_figures(machine: &Machine, axes: &[TunedAxis<'_>], shown: &[Around]) -> Vec<Figure> {
    let drives = axes.iter().flat_map(|of| of_drive(machine, of)).map(Figure::from);
    let planes = [[0, 1], [1, 2], [2, 0]].into_iter().flat_map(|axes| {
        let of: Vec<Around> = shown.iter().filter(|around| around.is_of_plane(axes)).cloned().collect();
        circle_around(machine, &of, CIRCLE_LIMIT_UM)
    });
    drives.chain(planes).collect()
}

fn of_axis(machine: &Machine, of: &TunedAxis<'_>, findings: &mut Findings) {
    let settings = &machine.axes[of.axis];
    findings.section(&format!("Axis {}", settings.name));
    let rows = of.found.parameters.described().into_iter();
    let rows = rows.map(|Described { name, found, why }| vec![name.to_owned(), found, why]);
    findings
        .words("Parameters of the axis with its drive, per unit of the inertia moved, ± 95 % confidence.");
    findings.table("Parameters", &["*Parameter", "*Found", "*Why"], rows);
    findings.words(&format!(
        "What the model leaves of the recordings has {} times the square of the readings’ errors; {}.",
        figure(of.found.misfit_per_reading, 3),
        if of.found.is_met() {
            "the model explains the recordings"
        } else {
            "the axis has something that the model lacks, and intervals are as wide as that allows"
        }
    ));
    findings.words("What the recordings do not show:");
    findings.notes(of.found.lacks().into_iter());
    if let Some(tuning) = of.tuning {
        let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| figure(value, 6));
        let rows = tuning.changes.iter().map(|change| {
            let [before, after] = [change.before, change.after].map(number);
            vec![change.key.to_owned(), before, after, change.unit.to_owned(), change.reason.clone()]
        });
        findings.words("Gains and feedforward, and why.");
        findings.table("Gains", &["*Key", "Before", "After", "*Unit", "*Because"], rows);
        findings.notes(tuning.remarks.iter().map(String::as_str));
        let margins = &tuning.margins;
        let rows = [
            ("phase margin", within(tuning.phase_margin_deg), "°"),
            ("gain margin", gain_margin(tuning.gain_margin), ""),
            ("delay margin", figure(margins.delay_s() * 1e3, 4), "ms"),
            ("crossover", figure(margins.crossover_hz, 4), "Hz"),
            ("greatest magnification of an error", figure(margins.sensitivity, 4), ""),
        ];
        let rows = rows.into_iter();
        let rows = rows.map(|(name, value, unit)| vec![name.to_owned(), value, unit.to_owned()]);
        findings.words("Margins of the position loop, with their 95 % intervals.");
        findings.table("Margins", &["*Margin", "Value", "*Unit"], rows);
    }
    findings.figures(of_drive(machine, of).into_iter().map(Figure::from));
}

fn within(Estimate { value, half_width_95 }: Estimate) -> String {
    let width = if half_width_95.is_finite() { figure(half_width_95, 2) } else { "any".to_owned() };
    format!("{} ± {width}", figure(value, 4))
}

fn gain_margin(gain: Estimate) -> String {
    if gain.value.is_finite() { within(gain) } else { "none: it may grow at will".to_owned() }
}

/// Frequencies in equal ratios.
fn curve_hz() -> impl Iterator<Item = f64> {
    let ratio = CURVE_HZ.1 / CURVE_HZ.0;
    (0..CURVE_POINTS).map(move |i| CURVE_HZ.0 * libm::pow(ratio, f64::from(i) / f64::from(CURVE_POINTS - 1)))
}

/// A response over frequency: amplitudes \[dB\] and phases \[°\].
fn curves(response: impl Fn(f64) -> model::Complex) -> [Vec<(f64, f64)>; 2] {
    let found: Vec<(f64, model::Complex)> = curve_hz().map(|hz| (hz, response(hz))).collect();
    // A phase never changes by half a circle from one frequency to the next.
    let mut phase_rad = 0.0;
    let mut unwrapped = |found: &model::Complex| {
        let change = found.phase_rad() - phase_rad;
        phase_rad += change - TAU * (change / TAU).round();
        phase_rad.to_degrees()
    };
    [
        found.iter().map(|(hz, found)| (*hz, db(found.magnitude()))).collect(),
        found.iter().map(|(hz, found)| (*hz, unwrapped(found))).collect(),
    ]
}

/// The drive's response, of the model and as it was measured, and the position loop's before and after.
fn of_drive(machine: &Machine, of: &TunedAxis<'_>) -> Vec<Stack> {
    let settings = &machine.axes[of.axis];
    let drive = of.found.parameters.drive();
    let gain = of.found.parameters.command_gain.value;
    let [amplitude, phase] =
        curves(|hz| model::Complex::new(gain, 0.0) * model::response(&drive, machine.tick_s, hz));
    let harmonics = &of.found.figures.harmonics;
    let measured = |value: fn(&HarmonicReading) -> f64| {
        let points = harmonics.iter().map(|found| (found.frequency_hz, value(found))).collect();
        Series::dots("measured", palette::series(1), points)
    };
    let model = |points| Series::curve("model", palette::series(0), points);
    let amplitude = vec![model(amplitude), measured(|found| db(found.gain))];
    let phase = vec![model(phase), measured(|found| -360.0 * found.frequency_hz * found.delay_s)];
    let words = if harmonics.is_empty() {
        "The recording has no steady harmonic motion, of which points could be measured."
    } else {
        "Actual over commanded velocity: the model that was found, and harmonic motion as it was recorded."
    };
    let name = &settings.name;
    let bode = over_frequency(&format!("Drive of {name}"), CURVE_HZ, amplitude, phase).with_words(words);
    let mut figures = vec![bode];
    figures.extend(of.tuning.map(|tuning| position_loop(machine.tick_s, settings, of, tuning)));
    figures
}

/// The position loop, opened: where its margins are read.
fn position_loop(tick_s: f64, settings: &AxisSettings, of: &TunedAxis<'_>, tuning: &AxisTuning) -> Stack {
    let drive = of.found.parameters.drive();
    // The drive's velocity is this times what is commanded, and so is the loop's gain.
    let scale = of.found.parameters.command_gain.value;
    let [before, after] = [settings.gains, tuning.gains]
        .map(|gains| curves(|hz| open_loop(&drive, &scaled(gains, scale), tick_s, hz)));
    let of_both = |index: usize| {
        let named = [("before", &before), ("after", &after)];
        Series::numbered(named.map(|(name, curves)| (name.to_owned(), curves[index].clone())))
    };
    let amplitude = Graph::new("Amplitude", "dB", of_both(0)).with_levels(&[0.0]);
    let phase = Graph::new("Phase", "°", of_both(1)).with_levels(&[-180.0]);
    let title = format!("Position loop of {}, opened", settings.name);
    let words = "With the gains before and after. Dashed: 0 dB and −180°. The phase margin is read where the amplitude is 0 dB, the gain margin where the phase is \
                 −180°.";
    Stack::new(title, Axis::new("Frequency", "Hz"), CURVE_HZ, vec![amplitude, phase])
        .logarithmic()
        .with_words(words)
}

/// The circles of a plane at a frequency, one over the other.
fn before_and_after(machine: &Machine, axes: [usize; 2], frequency_hz: f64, shown: &[Around]) -> Vec<Figure> {
    let of: Vec<&Around> = shown.iter().filter(|around| around.is_at(axes, frequency_hz)).collect();
    if of.is_empty() { Vec::new() } else { around(machine, &of, CIRCLE_LIMIT_UM).into() }
}

fn of_plane(machine: &Machine, circles: &Circles<'_>, tuning: &Tuning<'_>, findings: &mut Findings) {
    let [first, second] = circles.axes.map(|axis| machine.axes[axis].name.as_str());
    findings.section(&format!("Circles of {first} and {second}, before and after"));
    let following = [first, second].map(|name| format!("Following {name} before [µm]"));
    let headings = [
        "Frequency [Hz]",
        "Feed [mm/min]",
        "Contour error before [µm]",
        "after [µm]",
        "Form deviation before [µm]",
        "after [µm]",
        &following[0],
        "after [µm]",
        &following[1],
        "after [µm]",
        "*Verdict",
    ];
    let rows = circles.pairs.iter().map(|(before, after, is_worse)| {
        let driven = [figure(before.frequency_hz, 4), fixed(before.feed_mm_s * 60.0, 0)];
        let errors = before.errors_um_beside(after).map(|um| fixed(um, 2));
        let verdict = if *is_worse { "worse" } else { "no worse" }.to_owned();
        driven.into_iter().chain(errors).chain([verdict]).collect()
    });
    findings.table("Circles", &headings, rows);
    for (before, _, _) in &circles.pairs {
        findings.figures(before_and_after(machine, circles.axes, before.frequency_hz, tuning.shown));
    }
}

fn of_learning(machine: &Machine, repeats: &[LearntRow], words: &[String], findings: &mut Findings) {
    findings.section("Learning");
    findings.notes(words.iter().map(String::as_str));
    if repeats.is_empty() {
        return;
    }
    let over = |value: &dyn Fn(&LearntRow) -> f64| -> Vec<(f64, f64)> {
        repeats.iter().enumerate().map(|(repeat, row)| (repeat as f64, value(row))).collect()
    };
    let contour = vec![Series::curve("", palette::CONTOUR, over(&|row| row.contour_um))];
    let names = machine.axes.iter().map(|axis| axis.name.clone()).enumerate();
    let rms = Series::numbered(names.map(|(axis, name)| (name, over(&|row| row.rms_um[axis]))));
    let graphs =
        vec![Graph::new("Contour error", "µm", contour), Graph::new("Following error, rms", "µm", rms)];
    let ends = (0.0, repeats.len().saturating_sub(1).max(1) as f64);
    findings.figure(Stack::new("Errors over repeats", Axis::new("Repeat", ""), ends, graphs));
}
