//! Curves of several series over one axis, one graph above the other.

use std::io;

use plotters::element::PathElement;
use plotters::style::Color as _;

use super::{Caption, Layout, Panel, curve, ends_with_zero, on_both_layouts};
use crate::report::decimate;
use crate::report::palette::{self, Ink};
use crate::report::summary::Span;

/// A curve.
pub(in crate::report) struct Series {
    pub(in crate::report) ink: Ink,
    pub(in crate::report) points: Vec<(f64, f64)>,
}

/// One pair of axes with its curves.
pub(in crate::report) struct Graph {
    /// Quantity and unit.
    pub(in crate::report) title: String,
    /// Ends of the vertical axis; without them, all of the curves and zero.
    pub(in crate::report) y: Option<(f64, f64)>,
    pub(in crate::report) series: Vec<Series>,
    /// Levels that are drawn as limits.
    pub(in crate::report) levels: Vec<f64>,
}

/// Graphs over a common horizontal axis.
pub(in crate::report) struct Stack {
    pub(in crate::report) x: (f64, f64),
    /// Quantity and unit.
    pub(in crate::report) x_name: &'static str,
    /// The horizontal axis is logarithmic; its values are above 0.
    pub(in crate::report) is_logarithmic: bool,
    pub(in crate::report) graphs: Vec<Graph>,
}

impl Graph {
    fn ends(&self) -> (f64, f64) {
        if let Some(ends) = self.y {
            return ends;
        }
        let mut span = Span::default();
        self.series.iter().flat_map(|series| &series.points).for_each(|point| span.add(point.1));
        self.levels.iter().for_each(|&level| span.add(level));
        ends_with_zero(span)
    }
}

impl Stack {
    /// Draws it for both widths.
    pub(in crate::report) fn draw(&self, caption: &Caption<'_>) -> io::Result<String> {
        let height =
            |layout: &Layout| self.graphs.len() as u32 * self.graph_height(layout) + layout.axis_height();
        let along = |x: f64| if self.is_logarithmic { x.log10() } else { x };
        let x = (along(self.x.0), along(self.x.1));
        on_both_layouts(caption, height, |area, layout| {
            let mut rest = area.clone();
            for (index, graph) in self.graphs.iter().enumerate() {
                let last = index + 1 == self.graphs.len();
                let (upper, lower) = rest.split_vertically(self.graph_height(layout));
                let part = if last { &rest } else { &upper };
                let y = graph.ends();
                let panel = Panel {
                    title: &graph.title,
                    x,
                    y,
                    x_name: last.then_some(self.x_name),
                    is_logarithmic: self.is_logarithmic,
                };
                let mut chart = panel.draw(part, layout)?;
                let limit = palette::LIMIT.rgb().stroke_width(5);
                let inside = graph.levels.iter().filter(|level| (y.0..=y.1).contains(*level));
                chart.draw_series(
                    inside.map(|&level| PathElement::new([(x.0, level), (x.1, level)], limit)),
                )?;
                for series in &graph.series {
                    let points = series.points.iter().map(|&(at, value)| (along(at), value));
                    // What lies beyond a picture that shows a part is left out.
                    let is_inside = |end: (f64, f64), value: f64| value >= end.0 && value <= end.1;
                    let shown = points.filter(|point| is_inside(x, point.0) && is_inside(y, point.1));
                    curve(
                        &mut chart,
                        decimate::by_column(shown, x, layout.columns),
                        series.ink,
                        layout.stroke,
                    )?;
                }
                rest = lower;
            }
            Ok(())
        })
    }

    /// A single graph gets more room than each of a stack.
    fn graph_height(&self, layout: &Layout) -> u32 {
        match self.graphs.len() {
            1 => 2 * layout.panel_height,
            2 => layout.panel_height * 8 / 5,
            _ => layout.panel_height * 5 / 4,
        }
    }
}
