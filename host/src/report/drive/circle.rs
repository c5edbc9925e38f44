//! The page of the circle test: errors over frequency, around the circle, and over a revolution.

use super::super::figure::{Axis, Figure, Graph, Polar, Series, Stack, ends_of};
use super::super::findings::Findings;
use super::super::format::{figure, fixed};
use super::super::palette;
use super::open;
use crate::drive::Recording;
use crate::drive::circle::{CircleFigures, deviations};
use crate::drive::circle_motion::Circle;
use crate::drive::experiment::DriveError;
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// The contour error that S4 asks for \[µm\].
pub const CIRCLE_LIMIT_UM: f64 = 20.0;
/// Time of a motion that is shown at most \[s\].
const SHOWN_S: f64 = 1.0;

/// A circle that is drawn: who drove it, and its errors.
#[derive(Clone, Debug)]
pub struct Around {
    name: String,
    axes: [usize; 2],
    frequency_hz: f64,
    radius_mm: f64,
    /// Angle and deviation of the last revolution \[°, µm\].
    deviations: Vec<(f64, f64)>,
    /// Time and following error of the first axis \[ms, µm\].
    following: Vec<(f64, f64)>,
}

impl Around {
    /// What is drawn of a recording.
    ///
    /// # Errors
    /// The feed was not held long enough.
    pub fn of(name: &str, circle: &Circle, recording: &Recording) -> Result<Self, DriveError> {
        let tick_s = recording.tick_s();
        let turn_ticks = (1.0 / (circle.frequency_hz * tick_s)).round() as usize;
        let points = deviations(recording, circle)?;
        // One revolution, closed; the last one.
        let last = points.len().saturating_sub(turn_ticks + 1);
        let degrees = |&(angle_rad, um): &(f64, f64)| (angle_rad.to_degrees(), um);
        let [first, _] = circle.axes();
        let over_time = |(tick, row): (usize, &crate::trace::TraceRow)| {
            (tick as f64 * tick_s * 1e3, row.axes[first].err_um)
        };
        let shown_ticks = ((2.0 / circle.frequency_hz).min(SHOWN_S) / tick_s) as usize + 1;
        Ok(Self {
            name: name.to_owned(),
            axes: circle.axes(),
            frequency_hz: circle.frequency_hz,
            radius_mm: circle.radius_mm(),
            deviations: points.iter().skip(last).map(degrees).collect(),
            following: circle
                .measured(recording)?
                .iter()
                .take(shown_ticks)
                .enumerate()
                .map(over_time)
                .collect(),
        })
    }

    pub(super) fn is_at(&self, axes: [usize; 2], frequency_hz: f64) -> bool {
        self.axes == axes && self.frequency_hz.total_cmp(&frequency_hz).is_eq()
    }

    pub(super) fn is_of_plane(&self, axes: [usize; 2]) -> bool {
        self.axes == axes
    }
}

/// Circles over frequency, and what acted.
#[derive(Clone, Debug)]
pub struct CircleSweep<'a> {
    /// What acted.
    pub name: &'a str,
    /// Its circles.
    pub circles: &'a [CircleFigures],
}

/// Error bands, form deviation and following error over frequency.
#[must_use]
pub fn circle_figures(machine: &Machine, sweeps: &[CircleSweep<'_>], limit_um: f64) -> Stack {
    let [first, _] = axis_names(machine, sweeps);
    let curves = |words: &str, value: fn(&CircleFigures) -> f64| -> Vec<Series> {
        let of = |(index, sweep): (usize, &CircleSweep<'_>)| {
            let points = sweep.circles.iter().map(|circle| (circle.frequency_hz, value(circle))).collect();
            Series::curve(format!("{}{words}", sweep.name), palette::series(index), points)
        };
        sweeps.iter().enumerate().map(of).collect()
    };
    let mut bands = curves(", greatest", |circle| circle.contour_um_max);
    bands.extend(curves(", least", |circle| circle.contour_um_min));
    let all = sweeps.iter().flat_map(|sweep| sweep.circles).map(|circle| circle.frequency_hz);
    let graphs = vec![
        Graph::new("Contour error", "µm", bands).with_levels(&[limit_um, -limit_um]),
        Graph::new("Form deviation", "µm", curves("", CircleFigures::form_um)),
        Graph::new(
            format!("Following error of {first}, greatest"),
            "µm",
            curves("", |circle| circle.following_um[0]),
        ),
    ];
    let words = format!(
        "Contour error is the actual less the programmed radius: each has a curve of its greatest and one of its least value. \
         Dashed: ±{} µm.",
        figure(limit_um, 3)
    );
    Stack::new("Errors over frequency", Axis::new("Frequency", "Hz"), ends_of(all), graphs).with_words(words)
}

/// The error around a circle, magnified, and the following error over two revolutions. All circles are of the same frequency.
pub(super) fn around(machine: &Machine, shown: &[&Around], limit_um: f64) -> [Figure; 2] {
    let of = |points: fn(&Around) -> &Vec<(f64, f64)>| -> Vec<Series> {
        Series::numbered(shown.iter().map(|around| (around.name.clone(), points(around).clone())))
    };
    let (hz, radius_mm, axes) = shown
        .first()
        .map_or((1.0, 0.0, [0, 1]), |around| (around.frequency_hz, around.radius_mm, around.axes));
    let polar = Polar {
        title: format!("Contour error around the circle at {} Hz", figure(hz, 4)),
        words: format!("Radius {} mm. Dashed: ±{} µm.", figure(radius_mm, 4), figure(limit_um, 3)),
        radius_mm,
        ring_um: limit_um,
        axes: axes.map(|axis| machine.axes[axis].name.clone()),
        series: of(|around| &around.deviations),
    };
    let name = name_of(machine, shown.iter().map(|around| around.axes[0]), "the first axis");
    let graph = Graph::new(format!("Following error of {name}"), "µm", of(|around| &around.following));
    let ends = (0.0, (2.0 / hz).min(SHOWN_S) * 1e3);
    let title = format!("Over two revolutions at {} Hz", figure(hz, 4));
    let over_time = Stack::new(title, Axis::new("Time", "ms"), ends, vec![graph]);
    [polar.into(), over_time.into()]
}

/// The circles of each frequency, in the order of their appearance.
fn by_frequency(shown: &[Around]) -> Vec<Vec<&Around>> {
    let mut groups: Vec<Vec<&Around>> = Vec::new();
    for around in shown {
        let is_alike = |group: &&mut Vec<&Around>| {
            group.iter().all(|other| other.frequency_hz.total_cmp(&around.frequency_hz).is_eq())
        };
        match groups.iter_mut().find(is_alike) {
            Some(group) => group.push(around),
            None => groups.push(vec![around]),
        }
    }
    groups
}

/// What is drawn of circles in one plane, those of each frequency one over the other.
#[must_use]
pub fn circle_around(machine: &Machine, shown: &[Around], limit_um: f64) -> Vec<Figure> {
    by_frequency(shown).iter().flat_map(|of| around(machine, of, limit_um)).collect()
}

/// The page of the circle test; `limits_hz` are the frequencies up to which the error stays within `limit_um`.
#[must_use]
pub fn circle_findings(
    machine: &Machine,
    sweeps: &[CircleSweep<'_>],
    (limits_hz, limit_um): (&[Option<f64>], f64),
    shown: &[Around],
    comparisons: &[Comparison],
) -> Findings {
    let feed_m_min =
        sweeps.iter().flat_map(|sweep| sweep.circles).next().map_or(0.0, |figures| figures.feed_mm_s * 0.06);
    let title = format!("Circle test at {} m/min", figure(feed_m_min, 4));
    let passed = |(sweep, hz): (&CircleSweep<'_>, &Option<f64>)| {
        let hz = hz.map_or_else(|| "–".to_owned(), |hz| figure(hz, 3));
        format!("{hz} Hz ({})", sweep.name)
    };
    let passed: Vec<String> = sweeps.iter().zip(limits_hz).map(passed).collect();
    let bold = format!("Contour error ≤ {} µm up to", figure(limit_um, 3));
    let mut findings = open(&title, machine, [&bold, &format!("{}.", passed.join(", "))], comparisons);
    findings.section("Errors over frequency");
    findings.figure(circle_figures(machine, sweeps, limit_um));
    for of in by_frequency(shown) {
        findings
            .section(&format!("At {} Hz", figure(of.first().map_or(0.0, |around| around.frequency_hz), 4)));
        findings.figures(around(machine, &of, limit_um));
    }
    findings.section("Figures");
    let rows = sweeps.iter().flat_map(|sweep| sweep.circles.iter().map(|circle| row(sweep.name, circle)));
    let [first, second] = axis_names(machine, sweeps).map(|name| format!("Following {name} [µm]"));
    let headings = [
        "*Feedforward, frequency",
        "Radius [mm]",
        "Contour max [µm]",
        "Contour min [µm]",
        "Form deviation [µm]",
        first.as_str(),
        second.as_str(),
    ];
    findings.table("Circles", &headings, rows);
    findings
}

/// The names of the two axes that all circles have in common.
fn axis_names(machine: &Machine, sweeps: &[CircleSweep<'_>]) -> [String; 2] {
    let circles = || sweeps.iter().flat_map(|sweep| sweep.circles);
    [
        name_of(machine, circles().map(|circle| circle.axes[0]), "the first axis"),
        name_of(machine, circles().map(|circle| circle.axes[1]), "the second axis"),
    ]
}

/// The name of the axis that all of `axes` are; `else_name` where planes differ.
fn name_of(machine: &Machine, mut axes: impl Iterator<Item = usize>, else_name: &str) -> String {
    let first = axes.next().and_then(|axis| machine.axes.get(axis).map(|settings| (axis, settings)));
    match first {
        Some((axis, settings)) if axes.all(|other| other == axis) => settings.name.clone(),
        _ => else_name.to_owned(),
    }
}

fn row(name: &str, circle: &CircleFigures) -> Vec<String> {
    vec![
        format!("{}, {} Hz", name, figure(circle.frequency_hz, 4)),
        fixed(circle.radius_mm, 4),
        fixed(circle.contour_um_max, 2),
        fixed(circle.contour_um_min, 2),
        fixed(circle.form_um(), 2),
        fixed(circle.following_um[0], 2),
        fixed(circle.following_um[1], 2),
    ]
}
