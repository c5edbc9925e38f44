//! Stacks of curves over one time axis.

use std::io;

use super::{Caption, Panel, Sheet, curve, ends_over, ends_with_zero, fault_marks, on_both_sheets};
use crate::record::{RunRecord, TickRecord};
use crate::report::decimate;
use crate::report::palette::{self, Ink};
use crate::report::summary::{Span, Summary};

/// Full scale of the output \[V\].
const RAIL_V: f64 = 10.0;

/// From this output on the plot shows the rails as well \[V\].
const RAIL_SHOWN_FROM_V: f64 = 7.0;

/// A quantity over time.
struct Curve<V: Fn(&TickRecord) -> f64> {
    title: &'static str,
    span: Span,
    ink: Ink,
    value: V,
}

/// Feed, acceleration, jerk and snap along the path.
pub(in crate::report) fn along_path(
    record: &RunRecord,
    summary: &Summary,
    caption: &Caption<'_>,
) -> io::Result<String> {
    type Value = fn(&TickRecord) -> f64;
    let curve = |title, span, ink, value: Value| Curve { title, span, ink, value };
    let curves = [
        curve("Feed [mm/s]", summary.feed_mm_s, palette::FEED, |tick| tick.v_mm_s),
        curve("Acceleration [mm/s²]", summary.accel_mm_s2, palette::ACCELERATION, |tick| tick.a_mm_s2),
        curve("Jerk [mm/s³]", summary.jerk_mm_s3, palette::JERK, |tick| tick.j_mm_s3),
        curve("Snap [mm/s⁴]", summary.snap_mm_s4, palette::SNAP, |tick| tick.snap_mm_s4),
    ];
    stack(record, summary, &curves, caption)
}

/// Following error and output of one axis.
pub(in crate::report) fn of_axis(
    record: &RunRecord,
    summary: &Summary,
    axis: usize,
    caption: &Caption<'_>,
) -> io::Result<String> {
    let figures = &summary.axes[axis];
    let error = move |tick: &TickRecord| tick.axes[axis].err_um;
    let volts = move |tick: &TickRecord| tick.axes[axis].out_v;
    let mut output = figures.out_v;
    if output.magnitude() >= RAIL_SHOWN_FROM_V {
        output.add(RAIL_V);
        output.add(-RAIL_V);
    }
    type Value<'a> = Box<dyn Fn(&TickRecord) -> f64 + 'a>;
    let curves = [
        Curve {
            title: "Following error [µm]",
            span: figures.err_um,
            ink: palette::ERROR,
            value: Box::new(error) as Value<'_>,
        },
        Curve { title: "Output [V]", span: output, ink: palette::VOLTS, value: Box::new(volts) },
    ];
    stack(record, summary, &curves, caption)
}

fn stack<V: Fn(&TickRecord) -> f64>(
    record: &RunRecord,
    summary: &Summary,
    curves: &[Curve<V>],
    caption: &Caption<'_>,
) -> io::Result<String> {
    let height = |sheet: &Sheet| curves.len() as u32 * sheet.panel_height + sheet.axis_height();
    let faults_s: Vec<f64> = record.faults.iter().map(|fault| fault.tick as f64 * record.tick_s).collect();
    let x = ends_over(summary.time_s.0, summary.time_s.1);
    on_both_sheets(caption, height, |area, sheet| {
        let mut rest = area.clone();
        for (index, shown) in curves.iter().enumerate() {
            let last = index + 1 == curves.len();
            let (upper, lower) = rest.split_vertically(sheet.panel_height);
            // The lowest panel carries the time axis of all.
            let part = if last { &rest } else { &upper };
            let panel = Panel {
                title: shown.title,
                x,
                y: ends_with_zero(shown.span),
                x_name: last.then_some("time [s]"),
                right: sheet.right,
            };
            let mut chart = panel.draw(part, sheet)?;
            let points =
                record.ticks.iter().map(|tick| (tick.tick as f64 * record.tick_s, (shown.value)(tick)));
            curve(&mut chart, decimate::by_column(points, x, sheet.columns), shown.ink, sheet.stroke)?;
            fault_marks(&mut chart, &faults_s, panel.x, panel.y)?;
            rest = lower;
        }
        Ok(())
    })
}
