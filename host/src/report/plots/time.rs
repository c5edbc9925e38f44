//! Stacks of curves over one time axis.

use std::io;

use plotters::element::PathElement;
use plotters::style::Color as _;

use super::{
    Area, Caption, Drawn, Layout, Panel, command_marks, curve, ends_over, ends_with_zero, fault_marks, marks,
    on_both_layouts,
};
use crate::report::decimate;
use crate::report::format::figure;
use crate::report::palette::{self, Ink};
use crate::report::summary::{Rest, Span, Summary};
use crate::trace::{RunTrace, TraceRow, TracedCommand};

/// Full scale of the output \[V\].
const RAIL_V: f64 = 10.0;

/// The output from which the plot shows the rails too \[V\].
const RAIL_SHOWN_FROM_V: f64 = 7.0;

/// A quantity over time.
struct Curve<V> {
    title: String,
    span: Span,
    /// The machine's limit in both directions; 0 if that is not known.
    limit: f64,
    ink: Ink,
    value: V,
}

/// The part of its limit below which a curve would be flat in a picture that shows the limit.
const LIMIT_SHOWN_FROM: f64 = 0.2;

/// Whether the plot of a curve shows its limit.
pub(in crate::report) fn shows_limit(span: Span, limit: f64) -> bool {
    limit > 0.0 && limit.is_finite() && span.magnitude() >= LIMIT_SHOWN_FROM * limit
}

impl<V> Curve<V> {
    /// The limits to be drawn: in the directions in which the curve goes.
    fn limits(&self) -> impl Iterator<Item = f64> {
        let shown = shows_limit(self.span, self.limit);
        let up = (shown && self.span.high > 0.0).then_some(self.limit);
        let down = (shown && self.span.low < 0.0).then_some(-self.limit);
        up.into_iter().chain(down)
    }

    /// Quantity and unit, and the limit if it is drawn.
    fn title(&self) -> String {
        if shows_limit(self.span, self.limit) {
            format!("{}, limit ±{}", self.title, figure(self.limit, 4))
        } else {
            self.title.clone()
        }
    }

    /// Ends of the vertical axis.
    fn ends(&self) -> (f64, f64) {
        let mut span = self.span;
        self.limits().for_each(|limit| span.add(limit));
        ends_with_zero(span)
    }
}

/// Columns that a shaded stretch has at least, so that it is seen.
const SHADE_COLUMNS: f64 = 3.0;

/// The rests to shade, at most one for each of `columns`: motion too short to be seen between two of them is
/// left out.
fn shades(rests: &[Rest], x: (f64, f64), columns: usize) -> Vec<(f64, f64)> {
    let column = (x.1 - x.0) / columns.max(1) as f64;
    let mut shades: Vec<(f64, f64)> = Vec::new();
    for rest in rests {
        let to = rest.to_s.max(rest.from_s + SHADE_COLUMNS * column).min(x.1);
        match shades.last_mut() {
            Some(last) if rest.from_s - last.1 < column => last.1 = last.1.max(to),
            _ => shades.push((rest.from_s, to)),
        }
    }
    shades
}

/// Feed, acceleration, jerk and snap along the path.
pub(in crate::report) fn along_path<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    caption: &Caption<'_>,
) -> io::Result<String> {
    type Value<const N: usize> = fn(&TraceRow<N>) -> f64;
    let limits = &trace.limits;
    let curve = |title: &str, span, limit, ink, value: Value<N>| Curve {
        title: title.to_owned(),
        span,
        limit,
        ink,
        value,
    };
    let curves = [
        curve("Feed [mm/s]", summary.feed_mm_s, 0.0, palette::FEED, |tick| tick.v_mm_s),
        curve(
            "Acceleration [mm/s²]",
            summary.accel_mm_s2,
            limits.accel_mm_s2,
            palette::ACCELERATION,
            |tick| tick.a_mm_s2,
        ),
        curve("Jerk [mm/s³]", summary.jerk_mm_s3, limits.jerk_mm_s3, palette::JERK, |tick| tick.j_mm_s3),
        curve("Snap [mm/s⁴]", summary.snap_mm_s4, limits.snap_mm_s4, palette::SNAP, |tick| tick.snap_mm_s4),
    ];
    stack(trace, summary, &curves, caption, &trace.commands)
}

/// Following error and output of one axis.
pub(in crate::report) fn of_axis<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    axis: usize,
    caption: &Caption<'_>,
) -> io::Result<String> {
    let (figures, of_run) = (&summary.axes[axis], &trace.axes[axis]);
    let error = move |tick: &TraceRow<N>| tick.axes[axis].err_um;
    let volts = move |tick: &TraceRow<N>| tick.axes[axis].out_v;
    let mut output = figures.out_v;
    if output.magnitude() >= RAIL_SHOWN_FROM_V {
        output.add(RAIL_V);
        output.add(-RAIL_V);
    }
    type Value<'a, const N: usize> = Box<dyn Fn(&TraceRow<N>) -> f64 + 'a>;
    let curves = [
        Curve {
            title: format!("Following error [{}]", of_run.unit().thousandth_symbol()),
            span: figures.err_um,
            limit: of_run.following_error_limit_um,
            ink: palette::ERROR,
            value: Box::new(error) as Value<'_, N>,
        },
        Curve {
            title: "Output [V]".to_owned(),
            span: output,
            limit: 0.0,
            ink: palette::VOLTS,
            value: Box::new(volts),
        },
    ];
    stack(trace, summary, &curves, caption, &[])
}

/// The commands of a run, and the override that they make.
struct LiveControl {
    x: (f64, f64),
    words: marks::Words,
    /// Time \[s\], override \[%\]: a step curve.
    course: Vec<(f64, f64)>,
}

impl LiveControl {
    fn new<const N: usize>(trace: &RunTrace<N>, layout: &Layout, x: (f64, f64)) -> Self {
        let mut course = vec![(x.0, 100.0)];
        let mut present = 100.0;
        for command in &trace.commands {
            if let Some(share) = command.feed_override {
                let at = (command.tick as f64 * trace.tick_s).clamp(x.0, x.1);
                course.extend([(at, present), (at, 100.0 * share)]);
                present = 100.0 * share;
            }
        }
        course.push((x.1, present));
        Self { x, words: marks::Words::new(marks::over_time(trace), layout, x, layout.right), course }
    }

    /// Height of the plot without its words.
    fn plot_height(layout: &Layout) -> u32 {
        layout.panel_height * 4 / 5
    }

    fn height(&self, layout: &Layout) -> u32 {
        Self::plot_height(layout) + self.words.height(layout)
    }

    fn draw(&self, area: &Area<'_>, layout: &Layout, shade: &[(f64, f64)]) -> Drawn {
        let highest = self.course.iter().map(|point| point.1).fold(100.0, f64::max);
        let plot = f64::from(Self::plot_height(layout) - layout.title_height() - layout.text / 2);
        let top = 1.1 * highest * (1.0 + f64::from(self.words.height(layout)) / plot);
        let panel = Panel {
            title: "Feed override [%]",
            x: self.x,
            y: (0.0, top),
            x_name: None,
            right: layout.right,
            is_logarithmic: false,
            shade,
        };
        let mut chart = panel.draw(area, layout)?;
        let points = decimate::by_column(self.course.iter().copied(), self.x, layout.columns);
        curve(&mut chart, points, palette::OVERRIDE, layout.stroke)?;
        self.words.draw(&mut chart, area, layout, panel.y, layout.title_height())
    }
}

fn stack<V: Fn(&TraceRow<N>) -> f64, const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    curves: &[Curve<V>],
    caption: &Caption<'_>,
    commands: &[TracedCommand],
) -> io::Result<String> {
    let x = ends_over(summary.time_s.0, summary.time_s.1);
    let live = |layout: &Layout| (!commands.is_empty()).then(|| LiveControl::new(trace, layout, x));
    let height = |layout: &Layout| {
        let live = live(layout).map_or(0, |live| live.height(layout));
        live + curves.len() as u32 * layout.panel_height + layout.axis_height()
    };
    let faults_s: Vec<f64> = trace.faults.iter().map(|fault| fault.tick as f64 * trace.tick_s).collect();
    let commands_s: Vec<f64> = commands.iter().map(|command| command.tick as f64 * trace.tick_s).collect();
    on_both_layouts(caption, height, |area, layout| {
        let mut rest = area.clone();
        if let Some(live) = live(layout) {
            let (upper, lower) = rest.split_vertically(live.height(layout));
            live.draw(&upper, layout, &shades(&summary.rests, x, layout.columns))?;
            rest = lower;
        }
        for (index, shown) in curves.iter().enumerate() {
            let last = index + 1 == curves.len();
            let (upper, lower) = rest.split_vertically(layout.panel_height);
            // The lowest panel carries the time axis of all.
            let part = if last { &rest } else { &upper };
            let panel = Panel {
                title: &shown.title(),
                x,
                y: shown.ends(),
                x_name: last.then_some("time [s]"),
                right: layout.right,
                is_logarithmic: false,
                shade: &shades(&summary.rests, x, layout.columns),
            };
            let mut chart = panel.draw(part, layout)?;
            let style = palette::LIMIT.rgb().stroke_width(5);
            let line = |limit| PathElement::new([(x.0, limit), (x.1, limit)], style);
            chart.draw_series(shown.limits().map(line))?;
            let points =
                trace.ticks.iter().map(|tick| (tick.tick as f64 * trace.tick_s, (shown.value)(tick)));
            curve(&mut chart, decimate::by_column(points, x, layout.columns), shown.ink, layout.stroke)?;
            command_marks(&mut chart, &commands_s, panel.x, panel.y)?;
            fault_marks(&mut chart, &faults_s, panel.x, panel.y)?;
            rest = lower;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_far_above_its_curve_does_not_flatten_it() {
        let curve = |low, high| Curve {
            title: "Jerk [mm/s³]".to_owned(),
            span: Span { low, high },
            limit: 5000.0,
            ink: palette::JERK,
            value: |tick: &TraceRow| tick.j_mm_s3,
        };
        assert_eq!(curve(-900.0, 999.0).limits().count(), 0);
        assert_eq!(curve(-900.0, 999.0).title(), "Jerk [mm/s³]");
        assert_eq!(curve(-900.0, 1500.0).title(), "Jerk [mm/s³], limit ±5000");
        assert!(curve(-900.0, 1500.0).ends().0 < -5000.0);
        assert_eq!(curve(0.0, 1500.0).limits().count(), 1);
        assert_eq!(curve(f64::INFINITY, f64::NEG_INFINITY).limits().count(), 0);
        assert!(!shows_limit(Span { low: -1.0, high: 1.0 }, 0.0));
    }

    #[test]
    fn short_rests_are_seen_and_many_stay_few() {
        let rest = |from_s, to_s| Rest { state: "dwell", from_s, to_s };
        let two = shades(&[rest(1.0, 1.001), rest(3.0, 5.0)], (0.0, 10.0), 100);
        assert!((two[0].1 - two[0].0 - 0.3).abs() < 1e-9, "{two:?}");
        assert_eq!(two[1], (3.0, 5.0));
        let many: Vec<_> = (0..10_000).map(|i| f64::from(i) * 1e-3).map(|at| rest(at, at + 1e-4)).collect();
        let shades = shades(&many, (0.0, 10.0), 100);
        assert!(shades.len() <= 100, "{}", shades.len());
        assert!(shades.windows(2).all(|pair| pair[0].1 <= pair[1].0));
    }
}
