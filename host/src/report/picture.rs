//! A figure as a picture of its own, SVG on white paper: for documents, which run no script.

use std::fmt::Write as _;

use super::figure::{Graph, Stack};
use super::format::{escape, scale_mark};
use super::palette::{self, Ink};

/// Size of the picture \[px\], and of the letters.
const WIDTH: f64 = 960.0;
const GRAPH_HEIGHT: f64 = 240.0;
const LETTERS: f64 = 13.0;
/// Room around a graph: left for the numbers, right, above for the title, below for the numbers \[px\].
const LEFT: f64 = 70.0;
const RIGHT: f64 = 20.0;
const ABOVE: f64 = 28.0;
const BELOW: f64 = 22.0;
/// Height of a row of the legend, and length of its lines \[px\].
const ROW: f64 = 20.0;
const KEY: f64 = 48.0;
/// About how many marks an axis has, along and upwards.
const MARKS: (f64, f64) = (12.0, 5.0);

/// Draws the graphs one above the other, the names of the curves below them.
pub(super) fn of(stack: &Stack) -> String {
    let mut svg = String::new();
    let mut names: Vec<(&str, Ink)> = Vec::new();
    for series in stack.graphs.iter().flat_map(|graph| &graph.series) {
        if !series.name.is_empty() && !names.iter().any(|(name, _)| *name == series.name) {
            names.push((&series.name, series.ink));
        }
    }
    let graphs_end = stack.graphs.len() as f64 * (GRAPH_HEIGHT + ABOVE + BELOW) + ROW;
    let height = graphs_end + ROW * (names.len() as f64 + 0.5);
    let _ = writeln!(
        svg,
        "<svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{}\" xmlns=\"http://www.w3.org/2000/svg\" \
         font-family=\"sans-serif\" font-size=\"{LETTERS}\" fill=\"{}\">\n<rect width=\"{WIDTH}\" height=\"{height}\" \
         fill=\"#ffffff\"/>",
        escape(&stack.title),
        palette::TEXT.hex(),
    );
    let mut top = 0.0;
    for graph in &stack.graphs {
        draw(stack, graph, top + ABOVE, &mut svg);
        top += GRAPH_HEIGHT + ABOVE + BELOW;
    }
    let x_name = format!("{} [{}]", stack.x.name, stack.x.unit);
    text(&x_name, LEFT + 0.5 * (WIDTH - LEFT - RIGHT), top + 0.5 * ROW, "middle", &mut svg);
    for (index, (name, ink)) in names.into_iter().enumerate() {
        let y = graphs_end + ROW * (index as f64 + 0.5);
        line(&format!("{LEFT},{y} {},{y}", LEFT + KEY), ink, 2.0, &mut svg);
        text(name, LEFT + KEY + 8.0, y + 0.35 * LETTERS, "start", &mut svg);
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw(stack: &Stack, graph: &Graph, top: f64, svg: &mut String) {
    let (from, to) = stack.ends;
    let values = graph.series.iter().flat_map(|series| &series.points).map(|point| point.1);
    let (low, high) = graph.ends.unwrap_or_else(|| {
        let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let air = 0.06 * (high - low).max(1e-9);
        (if low < 0.0 { low - air } else { low }, high + air)
    });
    let (width, bottom) = (WIDTH - LEFT - RIGHT, top + GRAPH_HEIGHT);
    let x = |value: f64| LEFT + (value - from) / (to - from) * width;
    let y = |value: f64| bottom - (value - low) / (high - low) * GRAPH_HEIGHT;
    text(&format!("{} [{}]", graph.y.name, graph.y.unit), LEFT, top - 9.0, "start", svg);
    for mark in marks(from, to, MARKS.0) {
        let at = x(mark);
        line(&format!("{at:.1},{top:.1} {at:.1},{bottom:.1}"), palette::GRID, 1.0, svg);
        text(&scale_mark(mark, to - from), at, bottom + 16.0, "middle", svg);
    }
    for mark in marks(low, high, MARKS.1) {
        let at = y(mark);
        let ink = if mark.abs() > 1e-9 * (high - low) { palette::GRID } else { palette::RULE };
        line(&format!("{LEFT:.1},{at:.1} {:.1},{at:.1}", LEFT + width), ink, 1.0, svg);
        text(&scale_mark(mark, high - low), LEFT - 6.0, at + 0.35 * LETTERS, "end", svg);
    }
    let frame = format!(
        "{LEFT},{top} {LEFT},{bottom} {right},{bottom} {right},{top} {LEFT},{top}",
        right = LEFT + width
    );
    line(&frame, palette::AXIS, 1.0, svg);
    for series in &graph.series {
        let inside = series.points.iter().filter(|(at, value)| (from..=to).contains(at) && value.is_finite());
        // What lies beyond the graph runs along its edge.
        let points: Vec<String> =
            inside.map(|&(at, value)| format!("{:.1},{:.1}", x(at), y(value.clamp(low, high)))).collect();
        line(&points.join(" "), series.ink, 1.8, svg);
    }
}

/// Multiples of 1, 2 or 5 times a power of ten that divide an axis into about `parts`.
fn marks(from: f64, to: f64, parts: f64) -> Vec<f64> {
    let least = (to - from) / parts;
    let decade = libm::exp10(libm::log10(least).floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|part| part * decade).into_iter().find(|step| *step >= least);
    let step = step.unwrap_or(10.0 * decade);
    let (first, last) = ((from / step - 1e-9).ceil() as i64, (to / step + 1e-9).floor() as i64);
    (first..=last).map(|number| number as f64 * step).collect()
}

fn line(points: &str, ink: Ink, width: f64, svg: &mut String) {
    // Dashes are written for drawings of four units to a pixel.
    let dashes: Vec<String> = ink
        .dash()
        .split_whitespace()
        .filter_map(|part| Some((part.parse::<f64>().ok()? / 4.0).to_string()))
        .collect();
    let dashes =
        if dashes.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", dashes.join(" ")) };
    let _ = writeln!(
        svg,
        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" \
         stroke-linejoin=\"round\"{dashes}/>",
        ink.hex()
    );
}

fn text(words: &str, x: f64, y: f64, anchor: &str, svg: &mut String) {
    let _ =
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>", escape(words));
}
