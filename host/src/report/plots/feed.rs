//! Feed over path length, under its ceilings.

use std::io;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

use super::{
    Area, Caption, Chart, Drawn, Layout, NARROW, Panel, UNITS_PER_PX, WIDE, curve, ends_over, marks,
    on_both_layouts,
};
use crate::report::decimate;
use crate::report::format::scale_mark;
use crate::report::palette::{self, NOT_REACHED};
use crate::report::summary::Summary;
use crate::trace::{RunTrace, TracedBlock};

/// A ceiling may lie far above any feed (a rapid over a short way). The axis ends at this many times the
/// highest feed, planned or run; a higher ceiling holds nothing back and is left out.
const CEILING_TO_FEED_MAX: f64 = 1.3;

/// Line width of the ceilings: wide enough to show on both sides of a feed that runs along them.
const CEILING_STROKE: u32 = 18;

/// Line width of the ceilings that the feed does not reach.
const UNREACHED_STROKE: u32 = 8;

/// A level piece of the ceiling, or, where many blocks share a column, the range they cover.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step<'a> {
    from_mm: f64,
    to_mm: f64,
    low_mm_s: f64,
    high_mm_s: f64,
    reason: &'a str,
}

impl Step<'_> {
    /// Whether it stands for several ceilings.
    fn is_range(&self) -> bool {
        self.high_mm_s > self.low_mm_s
    }
}

/// Whether there are more blocks than columns, so that a column shows a range of ceilings.
pub(in crate::report) fn is_crowded<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> bool {
    let (top_mm_s, _) = top(trace, summary);
    steps(&trace.blocks, top_mm_s, summary.path_length_mm, NARROW.columns).iter().any(Step::is_range)
}

/// What set a block's ceiling. A block that is too short to reach it names what keeps the feed below instead;
/// what set its ceiling is then not known, and does not matter.
fn reason(block: &TracedBlock) -> &str {
    match &*block.cap_reason {
        "accelerating" | "braking" => NOT_REACHED,
        reason => reason,
    }
}

/// Reasons of the ceilings up to `top_mm_s`, in the order of their appearance.
pub(in crate::report) fn reasons(blocks: &[TracedBlock], top_mm_s: f64) -> Vec<&str> {
    let mut known = Vec::new();
    for block in blocks.iter().filter(|block| block.cap_mm_s <= top_mm_s) {
        if !known.contains(&reason(block)) {
            known.push(reason(block));
        }
    }
    known
}

/// Top of the feed axis \[mm/s\], and whether a ceiling lies above it.
pub(in crate::report) fn top<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> (f64, bool) {
    let planned = trace.blocks.iter().map(|block| block.peak_mm_s).filter(|peak| peak.is_finite());
    let feed = planned.fold(summary.feed_mm_s.magnitude(), f64::max);
    let limit = if feed > 0.0 { CEILING_TO_FEED_MAX * feed } else { f64::INFINITY };
    let ceilings = || trace.blocks.iter().map(|block| block.cap_mm_s);
    let beyond = ceilings().any(|cap| cap > limit);
    let highest = ceilings().filter(|cap| cap.is_finite() && *cap <= limit).fold(feed, f64::max);
    (if highest > 0.0 { highest } else { 1.0 }, beyond)
}

/// The ceilings up to the top as steps, at most about two for each of `columns`. A column with many blocks
/// shows their range in the ink of the lowest, the one that holds the feed down.
fn steps<'a>(blocks: &'a [TracedBlock], top_mm_s: f64, length_mm: f64, columns: usize) -> Vec<Step<'a>> {
    let column_mm = length_mm / columns.max(1) as f64;
    let mut steps: Vec<Step<'a>> = Vec::new();
    let shown = |block: &&TracedBlock| block.cap_mm_s <= top_mm_s && block.length_mm.is_finite();
    for block in blocks.iter().filter(shown) {
        let (cap, reason) = (block.cap_mm_s, reason(block));
        let to_mm = block.start_mm + block.length_mm;
        match steps.last_mut() {
            Some(last)
                if last.reason == reason
                    && block.start_mm - last.to_mm < column_mm
                    && last.low_mm_s.total_cmp(&cap).is_eq()
                    && last.high_mm_s.total_cmp(&cap).is_eq() =>
            {
                last.to_mm = to_mm;
            }
            Some(last) if to_mm - last.from_mm < column_mm => {
                if cap < last.low_mm_s {
                    last.reason = reason;
                }
                last.low_mm_s = last.low_mm_s.min(cap);
                last.high_mm_s = last.high_mm_s.max(cap);
                last.to_mm = to_mm;
            }
            _ => steps.push(Step { from_mm: block.start_mm, to_mm, low_mm_s: cap, high_mm_s: cap, reason }),
        }
    }
    // Neighbours that came out alike are one.
    steps.dedup_by(|next, step| {
        let alike = (step.reason, step.low_mm_s.to_bits(), step.high_mm_s.to_bits())
            == (next.reason, next.low_mm_s.to_bits(), next.high_mm_s.to_bits())
            && next.from_mm - step.to_mm < column_mm;
        if alike {
            step.to_mm = next.to_mm;
        }
        alike
    });
    steps
}

/// Whether there is room in a wide plot for the number of at least one line.
pub(in crate::report) fn has_line_numbers<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> bool {
    !numbered(&WIDE, &trace.blocks, length_shown(summary)).is_empty()
}

/// End of the path axis \[mm\].
pub(super) fn length_shown(summary: &Summary) -> f64 {
    summary.path_length_mm.max(summary.path_done_mm)
}

/// Lines of the program that are long enough for their number above the plot: number, from, to.
fn numbered(layout: &Layout, blocks: &[TracedBlock], length_mm: f64) -> Vec<(String, f64, f64)> {
    let units_per_mm = f64::from(layout.width - 2 * layout.left) / length_mm.max(f64::MIN_POSITIVE);
    let stretches = lines(blocks).into_iter().map(|(line, from, to)| (line.to_string(), from, to));
    stretches.filter(|(word, from, to)| (to - from) * units_per_mm > layout.width_of(word) + 16.0).collect()
}

/// Where the lines of the program meet, with their numbers at the height `at`; `y_top` is the end of the
/// axis.
pub(super) fn line_numbers(
    chart: &mut Chart<'_>,
    layout: &Layout,
    blocks: &[TracedBlock],
    length_mm: f64,
    (at, y_top): (f64, f64),
) -> Drawn {
    for (word, from, to) in numbered(layout, blocks, length_mm) {
        let rule = palette::RULE.rgb().stroke_width(3);
        for x in [from, to] {
            chart.draw_series([PathElement::new([(x, 0.0), (x, y_top)], rule)])?;
        }
        let style = layout.letters(palette::TEXT, HPos::Center, VPos::Center);
        chart.draw_series([Text::new(word, (from.midpoint(to), at), style)])?;
    }
    Ok(())
}

/// Stretches of one G-code line: line, from, to. A line may be several blocks (its blends, its pieces).
fn lines(blocks: &[TracedBlock]) -> Vec<(u32, f64, f64)> {
    let mut lines: Vec<(u32, f64, f64)> = Vec::new();
    for block in blocks.iter().filter(|block| block.start_mm.is_finite() && block.length_mm.is_finite()) {
        let to = block.start_mm + block.length_mm;
        match lines.last_mut() {
            Some(last) if last.0 == block.line => last.2 = to,
            _ => lines.push((block.line, block.start_mm, to)),
        }
    }
    lines
}

/// Draws feed and ceilings, with commands and faults where on the path they came.
pub(in crate::report) fn draw<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    caption: &Caption<'_>,
) -> io::Result<String> {
    let x = ends_over(0.0, length_shown(summary));
    let words = |layout: &Layout| marks::Words::new(marks::over_path(trace), layout, x, layout.left);
    let height =
        |layout: &Layout| layout.panel_height * 2 + layout.axis_height() + words(layout).height(layout);
    on_both_layouts(caption, height, |area, layout| draw_on(area, layout, trace, summary, &words(layout)))
}

fn draw_on<const N: usize>(
    area: &Area<'_>,
    layout: &Layout,
    trace: &RunTrace<N>,
    summary: &Summary,
    words: &marks::Words,
) -> Drawn {
    let (top_mm_s, _) = top(trace, summary);
    let length_mm = length_shown(summary);
    // Room above the highest ceiling for the line numbers, and above these for the words.
    let numbered_mm_s = 1.14 * top_mm_s;
    let plot = f64::from(layout.panel_height * 2 - layout.title_height());
    let panel = Panel {
        title: "Feed [mm/s]",
        x: ends_over(0.0, length_mm),
        y: (0.0, numbered_mm_s * (1.0 + f64::from(words.height(layout)) / plot)),
        x_name: Some("path length [mm]"),
        right: layout.left,
        is_logarithmic: false,
        shade: &[],
    };
    let mut chart = panel.draw(area, layout)?;
    line_numbers(&mut chart, layout, &trace.blocks, length_mm, (1.09 * top_mm_s, numbered_mm_s))?;

    let known = reasons(&trace.blocks, top_mm_s);
    for step in steps(&trace.blocks, top_mm_s, length_mm, layout.columns) {
        let ink = palette::ceiling(step.reason, &known).rgb();
        if step.is_range() {
            let corners = [(step.from_mm, step.low_mm_s), (step.to_mm, step.high_mm_s)];
            chart.draw_series([Rectangle::new(corners, ink.mix(0.25).filled())])?;
        }
        let level = [(step.from_mm, step.low_mm_s), (step.to_mm, step.low_mm_s)];
        let stroke = if step.reason == NOT_REACHED { UNREACHED_STROKE } else { CEILING_STROKE };
        chart.draw_series([PathElement::new(level, ink.stroke_width(stroke))])?;
    }

    let feed = trace.ticks.iter().map(|tick| (tick.s_mm, tick.v_mm_s));
    curve(&mut chart, decimate::by_column(feed, panel.x, layout.columns), palette::FEED, layout.stroke)?;
    words.draw(&mut chart, area, layout, panel.y, layout.title_height())?;
    per_minute(area, layout, &panel)
}

/// The same axis once more on the right, in the unit of the program.
fn per_minute(area: &Area<'_>, layout: &Layout, panel: &Panel<'_>) -> Drawn {
    let (width, height) = area.dim_in_pixel();
    let (upper, lower) = (layout.title_height() as i32, (height - layout.axis_height()) as i32);
    let x = (width - panel.right) as i32;
    let top = panel.y.1 * 60.0;
    let step = round_step(top / layout.marks.1 as f64);
    let letters = |h| layout.letters(palette::TEXT, h, VPos::Center);
    let axis = palette::AXIS.rgb().stroke_width(4);
    area.draw(&PathElement::new([(x, upper), (x, lower)], axis))?;
    for mark in 0..=(top / step) as i32 {
        let value = f64::from(mark) * step;
        let y = lower - (value / top * f64::from(lower - upper)).round() as i32;
        area.draw(&PathElement::new([(x, y), (x + 16, y)], axis))?;
        area.draw(&Text::new(scale_mark(value, top), (x + 28, y), letters(HPos::Left)))?;
    }
    let title = layout.letters(palette::TEXT, HPos::Right, VPos::Top);
    area.draw(&Text::new("[mm/min]", ((width - UNITS_PER_PX) as i32, 4), title))
}

/// The next of 1, 2, 5, 10, … from `least` on.
fn round_step(least: f64) -> f64 {
    let decade = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|part| part * decade).find(|step| *step >= least).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(
        line: u32,
        start_mm: f64,
        length_mm: f64,
        cap_mm_s: f64,
        cap_reason: &'static str,
    ) -> TracedBlock {
        TracedBlock {
            line,
            kind: "line".into(),
            start_mm,
            length_mm,
            cap_mm_s,
            cap_reason: cap_reason.into(),
            enter_mm_s: 0.0,
            peak_mm_s: 0.0,
            exit_mm_s: 0.0,
            time_s: 1.0,
        }
    }

    #[test]
    fn equal_ceilings_join_and_crowded_ones_show_their_range() {
        let wide = [block(1, 0.0, 10.0, 50.0, "programmed"), block(2, 10.0, 10.0, 50.0, "programmed")];
        assert_eq!(steps(&wide, 100.0, 20.0, 100).len(), 1);
        let crowd: Vec<_> = (0..10_000u32)
            .map(|i| {
                block(
                    i,
                    f64::from(i) * 0.01,
                    0.01,
                    if i == 777 { 3.0 } else { 50.0 + f64::from(i % 7) },
                    "jerk",
                )
            })
            .collect();
        let steps = steps(&crowd, 100.0, 100.0, 200);
        assert!(steps.len() <= 401, "{}", steps.len());
        assert!(steps.iter().any(|step| (step.low_mm_s - 3.0).abs() < 1e-12 && step.high_mm_s > 55.0));
    }

    #[test]
    fn ceilings_out_of_reach_are_told_apart_and_left_out_when_far_above() {
        let mut blocks = vec![
            block(1, 0.0, 10.0, 50.0, "braking"),
            block(2, 10.0, 10.0, 50.0, "accelerating"),
            block(3, 20.0, 10.0, 40.0, "programmed"),
            block(4, 30.0, 10.0, 300.0, "braking"),
            block(5, 40.0, 10.0, 40.0, "programmed"),
        ];
        blocks[2].peak_mm_s = 40.0;
        let trace = RunTrace::<3> { blocks, ..RunTrace::default() };
        let summary = Summary::of(&trace);
        let (top_mm_s, beyond) = top(&trace, &summary);
        assert!((top_mm_s - 50.0).abs() < 1e-12 && beyond);
        assert_eq!(reasons(&trace.blocks, top_mm_s), [NOT_REACHED, "programmed"]);
        let drawn = steps(&trace.blocks, top_mm_s, 50.0, 100);
        let ends: Vec<_> = drawn.iter().map(|step| (step.reason, step.from_mm, step.to_mm)).collect();
        // The programmed ceilings are alike, but the block between them has another.
        assert_eq!(ends, [(NOT_REACHED, 0.0, 20.0), ("programmed", 20.0, 30.0), ("programmed", 40.0, 50.0)]);
    }

    #[test]
    fn marks_fall_on_round_feeds() {
        for (least, step) in [(980.0, 1000.0), (1.1, 2.0), (0.03, 0.05), (6.0, 10.0)] {
            assert!((round_step(least) - step).abs() < 1e-9, "{least}");
        }
    }
}
