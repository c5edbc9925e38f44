//! The page of the circle test: errors over frequency, around the circle, and over a revolution.

use std::io::{self, Write};

use super::super::figure_html;
use super::super::format::{escape, figure, fixed};
use super::super::palette;
use super::super::plots::graph::{Graph, Series, Stack};
use super::super::plots::{Caption, polar};
use super::{legend, table};
use crate::drive::Recording;
use crate::drive::circle::{CircleFigures, Sweep, deviations};
use crate::drive::circle_motion::Circle;
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// A circle to be shown: what acted, the motion, its recording.
pub type Shown = (&'static str, Circle, Recording);

/// Writes the page.
///
/// # Errors
/// Whatever `out` reports; a recording without its steady part.
pub fn write_circle(
    machine: &Machine,
    sweeps: &[Sweep],
    limit_um: f64,
    shown: &[Shown],
    comparisons: &[Comparison],
    out: &mut impl Write,
) -> io::Result<()> {
    let feed_m_min =
        sweeps.iter().flat_map(|sweep| &sweep.circles).next().map_or(0.0, |figures| figures.feed_mm_s * 0.06);
    let title = format!("Circle test at {} m/min", figure(feed_m_min, 4));
    let passed: Vec<String> = sweeps
        .iter()
        .map(|sweep| {
            let hz = sweep.limit_hz.map_or_else(|| "–".to_owned(), |hz| figure(hz, 3));
            format!("{hz} Hz ({})", sweep.name)
        })
        .collect();
    let sentence = format!(
        "<strong>Contour error ≤ {} µm up to</strong> {}.",
        figure(limit_um, 3),
        escape(&passed.join(", "))
    );
    super::open(&title, machine, &sentence, comparisons, out)?;
    over_frequency(machine, sweeps, limit_um, out)?;
    let mut frequencies_hz: Vec<f64> = Vec::new();
    for (_, circle, _) in shown {
        if !frequencies_hz.iter().any(|hz| hz.total_cmp(&circle.frequency_hz).is_eq()) {
            frequencies_hz.push(circle.frequency_hz);
        }
    }
    for (index, hz) in frequencies_hz.into_iter().enumerate() {
        let of: Vec<&Shown> =
            shown.iter().filter(|(_, circle, _)| circle.frequency_hz.total_cmp(&hz).is_eq()).collect();
        one_frequency(machine, index, hz, limit_um, &of, out)?;
    }
    writeln!(out, "<section><h2>Figures</h2>")?;
    let rows = sweeps.iter().flat_map(|sweep| sweep.circles.iter().map(|circle| row(sweep.name, circle)));
    let [first, second] = axis_names(machine, sweeps).map(|name| format!("following {name} [µm]"));
    let headings = [
        "feedforward, frequency",
        "radius [mm]",
        "contour max [µm]",
        "min [µm]",
        "form deviation [µm]",
        first.as_str(),
        second.as_str(),
    ];
    table(&headings, rows, out)?;
    writeln!(out, "</section>")?;
    super::close(out)
}

/// The names of the two axes that all circles have in common.
fn axis_names(machine: &Machine, sweeps: &[Sweep]) -> [String; 2] {
    let circles = || sweeps.iter().flat_map(|sweep| &sweep.circles);
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

/// Error bands and form deviation over frequency.
fn over_frequency(
    machine: &Machine,
    sweeps: &[Sweep],
    limit_um: f64,
    out: &mut impl Write,
) -> io::Result<()> {
    let [first, _] = axis_names(machine, sweeps);
    let curves = |value: fn(&CircleFigures) -> f64| -> Vec<Series> {
        let points =
            |sweep: &Sweep| sweep.circles.iter().map(|circle| (circle.frequency_hz, value(circle))).collect();
        sweeps
            .iter()
            .enumerate()
            .map(|(index, sweep)| Series { ink: palette::series(index), points: points(sweep) })
            .collect()
    };
    let mut bands = curves(|circle| circle.contour_um_max);
    bands.extend(curves(|circle| circle.contour_um_min));
    let all = || sweeps.iter().flat_map(|sweep| &sweep.circles).map(|circle| circle.frequency_hz);
    let (from, to) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let graph = |title: &str, series, levels| Graph { title: title.to_owned(), y: None, series, levels };
    let stack = Stack {
        x: if to > from { (from, to) } else { (0.0, 2.0 * to.max(0.5)) },
        x_name: "frequency [Hz]",
        is_logarithmic: false,
        graphs: vec![
            graph("Contour error, greatest and least [µm]", bands, vec![limit_um, -limit_um]),
            graph("Form deviation [µm]", curves(CircleFigures::form_um), Vec::new()),
            graph(
                &format!("Following error of {first}, greatest [µm]"),
                curves(|circle| circle.following_um[0]),
                Vec::new(),
            ),
        ],
    };
    let caption = Caption {
        id: "bands",
        title: "Errors of the circle over frequency",
        description: "Greatest and least contour error, form deviation and following error over frequency.",
    };
    let mut words = legend(sweeps.iter().map(|sweep| sweep.name.to_owned()));
    words.push((palette::LIMIT, format!("±{} µm", figure(limit_um, 3))));
    let remark = "Actual less programmed radius: each feedforward has a curve of its greatest and one of its least value.";
    writeln!(out, "<section><h2>Errors over frequency</h2>")?;
    figure_html(&stack.draw(&caption)?, &words, remark, out)?;
    writeln!(out, "</section>")
}

/// The circle with its error magnified, and the following error over two revolutions.
fn one_frequency(
    machine: &Machine,
    index: usize,
    frequency_hz: f64,
    limit_um: f64,
    shown: &[&Shown],
    out: &mut impl Write,
) -> io::Result<()> {
    let hz = figure(frequency_hz, 4);
    let (mut around, mut following) = (Vec::new(), Vec::new());
    let mut radius_mm = 0.0;
    for (index, (_, circle, recording)) in shown.iter().enumerate() {
        let ink = palette::series(index);
        radius_mm = circle.radius_mm();
        let revolution_ticks = (1.0 / (frequency_hz * recording.tick_s())).round() as usize;
        let points = deviations(recording, circle).map_err(io::Error::other)?;
        // One revolution, closed; the last one.
        let last = points.len().saturating_sub(revolution_ticks + 1);
        around.push(Series { ink, points: points[last..].to_vec() });
        let ticks = circle.measured(recording).map_err(io::Error::other)?;
        let [x, _] = circle.axes();
        let over_time = |(tick, trace): (usize, &crate::trace::TraceRow)| {
            (tick as f64 * recording.tick_s() * 1e3, trace.axes[x].err_um)
        };
        following.push(Series { ink, points: ticks.iter().enumerate().map(over_time).collect() });
    }
    let words = legend(shown.iter().map(|(name, _, _)| (*name).to_owned()));
    writeln!(out, "<section><h2>At {hz} Hz: radius {} mm</h2>", figure(radius_mm, 4))?;
    let title = format!("Contour error around the circle at {hz} Hz, magnified");
    let caption = Caption { id: &format!("polar{index}"), title: &title, description: &title };
    let mut rings = words.clone();
    rings.push((palette::AXIS, "programmed circle".to_owned()));
    rings.push((palette::LIMIT, format!("±{} µm", figure(limit_um, 3))));
    let remark = "The error is magnified, the circle is not to scale with it: the rings show how much.";
    figure_html(&polar::draw(&around, limit_um, &caption)?, &rings, remark, out)?;
    let name = name_of(machine, shown.iter().map(|(_, circle, _)| circle.axes()[0]), "the first axis");
    let graph = Graph {
        title: format!("Following error of {name} [µm]"),
        y: None,
        series: following,
        levels: Vec::new(),
    };
    let stack = Stack {
        x: (0.0, (2e3 / frequency_hz).min(1e3)),
        x_name: "time [ms]",
        is_logarithmic: false,
        graphs: vec![graph],
    };
    let title = format!("Following error at {hz} Hz");
    let caption = Caption { id: &format!("following{index}"), title: &title, description: &title };
    figure_html(&stack.draw(&caption)?, &words, "", out)?;
    writeln!(out, "</section>")
}
