//! The page of regulators side by side: errors over frequency, outputs over time, figures.

use std::io::{self, Write};

use super::super::figure_html;
use super::super::format::{escape, figure, fixed};
use super::super::palette::{self, Ink};
use super::super::plots::graph::{Graph, Series, Stack};
use super::super::plots::{Caption, picture};
use super::table;
use crate::drive::compare::{Choice, Measured, Motion, Row, Sweep};
use crate::machine::Machine;

/// The graphs end this far above the greatest error of velocity feedforward: it is what the others are to
/// better.
const AIR: f64 = 1.3;

/// Outputs over time by regulator \[s, V\].
pub type Outputs = [(Choice, Vec<(f64, f64)>)];

fn inked(choices: impl Iterator<Item = Choice>) -> Vec<(Ink, String)> {
    choices.map(|choice| (ink(choice), choice.name().to_owned())).collect()
}

/// The solid line is the inverse's, which lies low.
fn ink(choice: Choice) -> Ink {
    let last_first = Choice::SHOWN.iter().rev().position(|&shown| shown == choice);
    palette::series(last_first.unwrap_or(0))
}

fn errors(sweeps: &[Sweep], id: &str) -> io::Result<String> {
    let graph = |title: &str, value: fn(&Measured) -> f64| {
        let greatest =
            |sweep: &Sweep| sweep.circles.iter().map(|(_, found)| value(found)).fold(0.0, f64::max);
        let of_velocity = sweeps.iter().filter(|sweep| sweep.choice == Choice::Pv).map(greatest);
        let top = AIR * of_velocity.fold(1e-3, f64::max);
        let points =
            |sweep: &Sweep| sweep.circles.iter().map(|(hz, found)| (*hz, value(found).min(top))).collect();
        let series = |sweep: &Sweep| Series { ink: ink(sweep.choice), points: points(sweep) };
        Graph {
            title: title.to_owned(),
            y: Some((0.0, top)),
            series: sweeps.iter().map(series).collect(),
            levels: Vec::new(),
        }
    };
    let all = || sweeps.iter().flat_map(|sweep| &sweep.circles).map(|(hz, _)| *hz);
    let (from, to) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let stack = Stack {
        x: if to > from { (from, to) } else { (0.0, 2.0 * to.max(0.5)) },
        x_name: "turns per second [Hz]",
        is_logarithmic: false,
        graphs: vec![
            graph("Contour error, greatest [µm]", |found| found.contour_um),
            graph("Following error, greatest of any axis [µm]", |found| found.following_um),
        ],
    };
    let caption = Caption {
        id,
        title: "Errors of the regulators over frequency",
        description: "Greatest contour error and greatest following error of every regulator over the frequency of a \
                      circle of constant feed.",
    };
    stack.draw(&caption)
}

fn outputs_drawn(outputs: &Outputs, id: &str) -> io::Result<String> {
    let last_s = outputs.iter().filter_map(|(_, points)| points.last()).map(|point| point.0);
    let end_ms = last_s.fold(1e-3, f64::max) * 1e3;
    let graphs = outputs
        .iter()
        .map(|(choice, points)| Graph {
            title: format!("{}: output [V]", choice.name()),
            y: None,
            series: vec![Series {
                ink: palette::VOLTS,
                points: points.iter().map(|(time_s, volts)| (time_s * 1e3, *volts)).collect(),
            }],
            levels: Vec::new(),
        })
        .collect();
    let stack = Stack { x: (0.0, end_ms), x_name: "time [ms]", is_logarithmic: false, graphs };
    let caption = Caption {
        id,
        title: "Outputs of two regulators with the same gains",
        description: "Output voltage over time: with differenced positions it is noise, with analytic velocity, \
                      acceleration and jerk it is smooth.",
    };
    stack.draw(&caption)
}

/// The errors over frequency as an SVG file.
///
/// # Errors
/// The drawing library rejects something.
pub fn picture_of_errors(sweeps: &[Sweep]) -> io::Result<String> {
    Ok(picture(&errors(sweeps, "errors")?, &inked(sweeps.iter().map(|sweep| sweep.choice))))
}

/// The outputs over time as an SVG file.
///
/// # Errors
/// The drawing library rejects something.
pub fn picture_of_outputs(outputs: &Outputs) -> io::Result<String> {
    Ok(picture(&outputs_drawn(outputs, "outputs")?, &[]))
}

/// Writes the page. `resolutions_um` are the steps of set positions in the first and in the second picture.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_compare(
    machine: &Machine,
    (motions, rows): (&[Motion], &[Row]),
    sweeps: &[Sweep],
    outputs: &Outputs,
    resolutions_um: [f64; 2],
    out: &mut impl Write,
) -> io::Result<()> {
    let sentence = "<strong>The same kp, limits and path for all;</strong> they differ in feedforward only.";
    super::open("Regulators side by side", machine, sentence, &[], out)?;
    let [over_frequency_um, over_time_um] = resolutions_um.map(|um| figure(um, 3));
    writeln!(out, "<section><h2>Errors over frequency</h2>")?;
    let words = format!(
        "Circles of constant feed, set positions in steps of {over_frequency_um} µm. What lies beyond a picture \
         runs along its upper edge; the table has the figures."
    );
    let legend = inked(sweeps.iter().map(|sweep| sweep.choice));
    figure_html(&errors(sweeps, "errors")?, &legend, &words, out)?;
    writeln!(out, "</section><section><h2>Outputs</h2>")?;
    let words = format!(
        "Set positions in steps of {over_time_um} µm. Both have the same gains; each picture has its own scale."
    );
    figure_html(&outputs_drawn(outputs, "outputs")?, &[], &words, out)?;
    writeln!(out, "</section><section><h2>Figures</h2>")?;
    for (index, motion) in motions.iter().enumerate() {
        writeln!(out, "<h3>{}</h3>", escape(&motion.name()))?;
        let headings = [
            "regulator, set positions",
            "following error [µm]",
            "contour error [µm]",
            "output noise [mV rms]",
            "current noise [% of the limit]",
        ];
        let cells = rows.iter().filter_map(|row| {
            let found = row.measured.get(index)?;
            Some(vec![
                format!("{}, {}", row.choice.name(), steps(row.resolution_um)),
                fixed(found.following_um, 2),
                fixed(found.contour_um, 2),
                fixed(found.output_noise_v * 1e3, 1),
                fixed(found.current_noise * 1e2, 1),
            ])
        });
        table(&headings, cells, out)?;
    }
    writeln!(out, "</section>")?;
    super::close(out)
}

fn steps(resolution_um: f64) -> String {
    if resolution_um > 0.0 { format!("{} µm", figure(resolution_um, 3)) } else { "exact".to_owned() }
}
