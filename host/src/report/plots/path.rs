//! The path as the tool sees it, coloured by feed.

use std::io;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

use super::{Area, Caption, Drawn, Layout, Panel, on_both_layouts};
use crate::report::decimate;
use crate::report::format::figure;
use crate::report::palette::{self, CLASSES};
use crate::report::summary::{Span, Summary};
use crate::trace::{RunTrace, TraceRow};

/// Corners of the drawn path: far more than a screen resolves, and a bound on the size of the file.
const CORNERS_MAX: usize = 12_000;

/// Tallest and lowest picture as a part of its width.
const TALL: f64 = 0.52;
const TALL_NARROW: f64 = 1.1;
const LOW: f64 = 0.18;

/// Two linear axes of the machine, to the right and upwards.
pub(in crate::report) struct View {
    /// Number of the axis to the right.
    pub(in crate::report) right: usize,
    /// Number of the axis upwards.
    pub(in crate::report) up: usize,
}

/// The class of colour of a feed.
fn class_of(feed_mm_s: f64, feed_mm_s_max: f64) -> usize {
    let part = if feed_mm_s_max > 0.0 { feed_mm_s / feed_mm_s_max } else { 0.0 };
    ((part.max(0.0) * CLASSES.len() as f64) as usize).min(CLASSES.len() - 1)
}

/// Lowest and highest feed of every class \[mm/s\], for the legend.
pub(in crate::report) fn classes(feed_mm_s: Span) -> Vec<(f64, f64)> {
    let step = feed_mm_s.magnitude() / CLASSES.len() as f64;
    (0..CLASSES.len()).map(|class| (class as f64 * step, (class + 1) as f64 * step)).collect()
}

/// How millimetres map to drawing units: the same in both directions.
struct Scale {
    x_mm: (f64, f64),
    y_mm: (f64, f64),
    units_per_mm: f64,
    height: u32,
}

impl Scale {
    /// Fits both spans into the layout, with air around them.
    fn fit(x: Span, y: Span, layout: &Layout) -> Self {
        let width = f64::from(layout.width - layout.left - layout.right);
        let tall = if layout.class == "narrow" { TALL_NARROW } else { TALL };
        let air = f64::from(2 * layout.text);
        // A point has no size; give it a millimetre.
        let largest = x.width().max(y.width());
        let (dx, dy) = if largest > 0.0 { (x.width(), y.width()) } else { (1.0, 1.0) };
        let by_width = (width - 2.0 * air) / dx.max(f64::MIN_POSITIVE);
        let by_height = (width * tall - 2.0 * air) / dy.max(f64::MIN_POSITIVE);
        let units_per_mm = by_width.min(by_height);
        let axes_height = (dy * units_per_mm + 2.0 * air).max(LOW * width).round();
        let centred = |span: Span, units: f64| {
            let middle = if span.is_empty() { 0.0 } else { span.low.midpoint(span.high) };
            (middle - units / units_per_mm / 2.0, middle + units / units_per_mm / 2.0)
        };
        Self {
            x_mm: centred(x, width),
            y_mm: centred(y, axes_height),
            units_per_mm,
            height: axes_height as u32 + layout.title_height() + layout.axis_height(),
        }
    }

    fn to_units(&self, x_mm: f64, y_mm: f64) -> (f64, f64) {
        ((x_mm - self.x_mm.0) * self.units_per_mm, (y_mm - self.y_mm.0) * self.units_per_mm)
    }

    fn to_mm(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x_mm.0 + x / self.units_per_mm, self.y_mm.0 + y / self.units_per_mm)
    }
}

/// Draws one view of the path.
pub(in crate::report) fn draw<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    names: &[String],
    view: &View,
    caption: &Caption<'_>,
) -> io::Result<String> {
    let (x, y) = (summary.axes[view.right].set_mm, summary.axes[view.up].set_mm);
    let feed_max = summary.feed_mm_s.magnitude();
    let place = |tick: &TraceRow<N>| (tick.axes[view.right].set_mm, tick.axes[view.up].set_mm);
    on_both_layouts(
        caption,
        |layout| Scale::fit(x, y, layout).height,
        |area, layout| {
            let scale = Scale::fit(x, y, layout);
            let panel = Panel {
                title: &format!("{} [mm]", names[view.up]),
                x: scale.x_mm,
                y: scale.y_mm,
                x_name: Some(&format!("{} [mm]", names[view.right])),
                right: layout.right,
                is_logarithmic: false,
                shade: &[],
            };
            let mut chart = panel.draw(area, layout)?;
            let corners = || {
                trace.ticks.iter().map(|tick| {
                    let (x, y) = place(tick);
                    let (x, y) = scale.to_units(x, y);
                    (x, y, class_of(tick.v_mm_s, feed_max))
                })
            };
            for stretch in decimate::path(corners, CORNERS_MAX) {
                let points: Vec<_> = stretch.points.iter().map(|&point| scale.to_mm(point)).collect();
                super::curve(&mut chart, points, CLASSES[stretch.class], 14)?;
            }
            let area = chart.plotting_area().strip_coord_spec();
            let on_area = |tick: &TraceRow<N>| {
                let (x, y) = place(tick);
                let (x, y) = scale.to_units(x, y);
                let (_, height) = area.dim_in_pixel();
                (x.is_finite() && y.is_finite()).then(|| (x.round() as i32, height as i32 - y.round() as i32))
            };
            let start = trace.ticks.iter().find_map(on_area);
            let end = trace.ticks.iter().rev().find_map(on_area);
            let fault = trace.faults.first().and_then(|fault| {
                let index = trace.ticks.partition_point(|tick| tick.tick < fault.tick);
                trace.ticks.get(index).and_then(on_area)
            });
            marks(&area, layout, start, end, fault)
        },
    )
}

/// Start (ring), end (square) and first fault (cross) with their words, which give way to each other.
fn marks(
    area: &Area<'_>,
    layout: &Layout,
    start: Option<(i32, i32)>,
    end: Option<(i32, i32)>,
    fault: Option<(i32, i32)>,
) -> Drawn {
    let near = |a: (i32, i32), b: (i32, i32)| {
        // As long as the longest word and the gap before it.
        f64::from((a.0 - b.0).abs()) < layout.width_of("start") + 12.0
            && (a.1 - b.1).unsigned_abs() < layout.text * 3 / 2
    };
    let ink = palette::TEXT.rgb();
    let mut words: Vec<((i32, i32), String)> = Vec::new();
    for (at, word) in [(start, "start"), (end, "end"), (fault, "fault")] {
        let Some(at) = at else { continue };
        match words.iter_mut().find(|(other, _)| near(*other, at)) {
            Some((_, words)) => words.push_str(&format!(", {word}")),
            None => words.push((at, word.to_string())),
        }
        match word {
            "start" => area.draw(&Circle::new(at, 22, ink.stroke_width(8)))?,
            "end" => {
                area.draw(&Rectangle::new([(at.0 - 14, at.1 - 14), (at.0 + 14, at.1 + 14)], ink.filled()))?
            }
            _ => {
                // Solid, unlike the dashed fault lines of the other plots: two crossing dashes are no cross.
                for (dx, dy) in [(26, 26), (26, -26)] {
                    let line = [(at.0 - dx, at.1 - dy), (at.0 + dx, at.1 + dy)];
                    area.draw(&PathElement::new(line, ink.stroke_width(10)))?;
                }
            }
        }
    }
    let (width, _) = area.dim_in_pixel();
    for ((x, y), word) in words {
        // Above the mark; to the left of it where the layout ends on the right.
        let to_left = f64::from(x) + layout.width_of(&word) > f64::from(width);
        let (h, dx) = if to_left { (HPos::Right, -24) } else { (HPos::Left, 24) };
        let style = layout.letters(palette::TEXT, h, VPos::Bottom);
        area.draw(&Text::new(word, (x + dx, y - 20), style))?;
    }
    Ok(())
}

/// A sentence for those who cannot see the picture.
pub(in crate::report) fn describe(summary: &Summary, names: &[String], view: &View) -> String {
    let part = |axis: usize| {
        let span = summary.axes[axis].set_mm;
        format!("{} from {} to {} mm", names[axis], figure(span.low, 5), figure(span.high, 5))
    };
    format!(
        "Set path, {} and {}, coloured by feed up to {} mm/s.",
        part(view.right),
        part(view.up),
        figure(summary.feed_mm_s.magnitude(), 4)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_millimetre_is_as_long_in_both_directions() {
        for layout in [&super::super::WIDE, &super::super::NARROW] {
            for (dx, dy) in [(100.0, 20.0), (3.0, 400.0), (50.0, 0.0), (0.0, 0.0)] {
                let scale =
                    Scale::fit(Span { low: 1.0, high: 1.0 + dx }, Span { low: -2.0, high: dy - 2.0 }, layout);
                let width = f64::from(layout.width - layout.left - layout.right);
                let height = f64::from(scale.height - layout.title_height() - layout.axis_height());
                let across = width / (scale.x_mm.1 - scale.x_mm.0);
                let upwards = height / (scale.y_mm.1 - scale.y_mm.0);
                assert!((across / upwards - 1.0).abs() < 1e-9, "{across} {upwards}");
                assert!(height < 1.2 * width);
            }
        }
    }

    #[test]
    fn classes_cover_every_feed() {
        assert_eq!(class_of(0.0, 83.0), 0);
        assert_eq!(class_of(83.0, 83.0), CLASSES.len() - 1);
        assert_eq!(class_of(-1e-9, 83.0), 0);
        assert_eq!(class_of(f64::NAN, 83.0), 0);
        assert_eq!(class_of(0.0, 0.0), 0);
    }
}
