//! Contour error over path length, with the feed that it may come from.

use std::io;

use super::feed::{length_shown, line_numbers};
use super::{Caption, Layout, Panel, curve, ends_over, fault_marks, on_both_layouts};
use crate::report::decimate;
use crate::report::palette;
use crate::report::summary::Summary;
use crate::trace::RunTrace;

/// Draws the contour error on the path axis of the feed. `faults_mm` is where on the path a fault was
/// latched.
pub(in crate::report) fn draw<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    faults_mm: &[f64],
    caption: &Caption<'_>,
) -> io::Result<String> {
    let height = |layout: &Layout| layout.panel_height + layout.axis_height();
    let highest_um = match summary.contour_um.magnitude() {
        0.0 => 1.0,
        highest_um => highest_um,
    };
    on_both_layouts(caption, height, |area, layout| {
        let panel = Panel {
            title: "Contour error [µm]",
            x: ends_over(0.0, length_shown(summary)),
            // Room above the highest error for the line numbers.
            y: (0.0, 1.3 * highest_um),
            x_name: Some("path length [mm]"),
            // As wide as the plot of the feed, which has a second axis there.
            right: layout.left,
            is_logarithmic: false,
            shade: &[],
        };
        let mut chart = panel.draw(area, layout)?;
        line_numbers(
            &mut chart,
            layout,
            &trace.blocks,
            length_shown(summary),
            (1.19 * highest_um, panel.y.1),
        )?;
        let points = trace.ticks.iter().map(|tick| (tick.s_mm, tick.contour_um));
        curve(
            &mut chart,
            decimate::by_column(points, panel.x, layout.columns),
            palette::CONTOUR,
            layout.stroke,
        )?;
        fault_marks(&mut chart, faults_mm, panel.x, (0.0, 1.08 * highest_um))
    })
}
