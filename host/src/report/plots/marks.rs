//! Moments of a run that its plots mark: commands of live control, and faults.

use plotters::element::{PathElement, Text};
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, VPos};

use super::{Area, Chart, Drawn, Layout};
use crate::report::format::figure;
use crate::report::palette::{self, Ink};
use crate::trace::{RunTrace, TracedCommand};

/// Commands marked in one plot; more than these would hide the curve.
pub(in crate::report) const COMMAND_MARKS_MAX: usize = 60;

/// Rows of words above a plot. A word that fits into none is left out; its line stays.
const ROWS_MAX: usize = 6;

/// An upright line with a word to it.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::report) struct Mark {
    /// The place on the horizontal axis.
    at: f64,
    word: String,
    is_fault: bool,
}

/// A command as people read it: "hold", "override 50 %".
pub(in crate::report) fn word(command: &TracedCommand) -> String {
    match command.feed_override {
        Some(share) => format!("override {} %", figure(share * 100.0, 4)),
        None => command.command.clone(),
    }
}

/// The marks of `trace`, each where `place` finds its tick.
fn marks<const N: usize>(trace: &RunTrace<N>, place: impl Fn(u64) -> Option<f64>) -> Vec<Mark> {
    let commands =
        trace.commands.iter().take(COMMAND_MARKS_MAX).filter_map(|command| {
            Some(Mark { at: place(command.tick)?, word: word(command), is_fault: false })
        });
    let faults =
        trace.faults.iter().take(super::FAULT_MARKS_MAX).filter_map(|fault| {
            Some(Mark { at: place(fault.tick)?, word: "fault".to_owned(), is_fault: true })
        });
    let mut marks: Vec<Mark> = commands.chain(faults).filter(|mark| mark.at.is_finite()).collect();
    marks.sort_by(|a, b| a.at.total_cmp(&b.at));
    marks
}

/// Over time \[s\].
pub(super) fn over_time<const N: usize>(trace: &RunTrace<N>) -> Vec<Mark> {
    marks(trace, |tick| Some(tick as f64 * trace.tick_s))
}

/// Over the path \[mm\]: where the machine was when the tick began.
pub(super) fn over_path<const N: usize>(trace: &RunTrace<N>) -> Vec<Mark> {
    marks(trace, |tick| {
        let index = trace.ticks.partition_point(|row| row.tick < tick);
        let row = trace.ticks.get(index.saturating_sub(1)).or(trace.ticks.last());
        row.map(|row| row.s_mm)
    })
}

/// A word's place above the plot.
struct Place {
    row: usize,
    /// The word stands left of its line, not right.
    is_left: bool,
}

/// Words of marks, in rows above a plot.
pub(super) struct Words {
    marks: Vec<Mark>,
    places: Vec<Option<Place>>,
    rows: usize,
}

impl Words {
    /// Marks for a plot with `x` as the ends of its horizontal axis, and this much room on its right.
    pub(super) fn new(marks: Vec<Mark>, layout: &Layout, x: (f64, f64), right: u32) -> Self {
        let width = f64::from(layout.width - layout.left - right);
        let gap = f64::from(layout.text) / 4.0;
        let mut taken: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut place = |mark: &Mark| {
            let at = (mark.at - x.0) / (x.1 - x.0) * width;
            if !(0.0..=width).contains(&at) {
                return None;
            }
            let room = layout.width_of(&mark.word) + gap;
            let is_left = at + room > width;
            let span = if is_left { (at - room - gap, at) } else { (at, at + room + gap) };
            let is_free =
                |row: &Vec<(f64, f64)>| row.iter().all(|other| span.1 <= other.0 || other.1 <= span.0);
            let row = taken.iter().position(is_free).unwrap_or(taken.len());
            if row == ROWS_MAX || span.0 < 0.0 {
                return None;
            }
            taken.resize_with(taken.len().max(row + 1), Vec::new);
            taken[row].push(span);
            Some(Place { row, is_left })
        };
        let places = marks.iter().map(&mut place).collect();
        Self { marks, places, rows: taken.len() }
    }

    /// Height of one row.
    fn row_height(layout: &Layout) -> u32 {
        layout.text * 5 / 4
    }

    /// Room for the words above the plot, in drawing units.
    pub(super) fn height(&self, layout: &Layout) -> u32 {
        self.rows as u32 * Self::row_height(layout)
    }

    /// Draws lines as high as the plot, and words into the room at its top. `top` is the upper end of the
    /// plot in `area`.
    pub(super) fn draw(
        &self,
        chart: &mut Chart<'_>,
        area: &Area<'_>,
        layout: &Layout,
        y: (f64, f64),
        top: u32,
    ) -> Drawn {
        for mark in &self.marks {
            let style = mark.ink().rgb().stroke_width(6);
            chart.draw_series([PathElement::new([(mark.at, y.0), (mark.at, y.1)], style)])?;
        }
        // On top of all lines.
        for (mark, place) in self.marks.iter().zip(&self.places) {
            let Some(Place { row, is_left }) = place else { continue };
            let (left, _) = area.get_base_pixel();
            let (x, _) = chart.backend_coord(&(mark.at, y.0));
            let gap = layout.text as i32 / 4;
            let (x, anchor) = if *is_left { (x - gap, HPos::Right) } else { (x + gap, HPos::Left) };
            let at = (x - left, (top + Self::row_height(layout) * *row as u32 + layout.text / 2) as i32);
            area.draw(&Text::new(
                mark.word.clone(),
                at,
                layout.letters(mark.text_ink(), anchor, VPos::Center),
            ))?;
        }
        Ok(())
    }
}

impl Mark {
    fn ink(&self) -> Ink {
        if self.is_fault { palette::FAULT } else { palette::COMMAND }
    }

    fn text_ink(&self) -> Ink {
        if self.is_fault { palette::FAULT } else { palette::TEXT }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NARROW, WIDE};
    use super::*;

    fn words(at: &[f64], layout: &Layout) -> Words {
        let mark = |&at: &f64| Mark { at, word: "override 50 %".to_owned(), is_fault: false };
        Words::new(at.iter().map(mark).collect(), layout, (0.0, 10.0), layout.right)
    }

    fn rows(words: &Words) -> Vec<Option<(usize, bool)>> {
        words.places.iter().map(|place| place.as_ref().map(|place| (place.row, place.is_left))).collect()
    }

    #[test]
    fn words_that_would_overlap_take_another_row() {
        let close = words(&[1.0, 1.01, 5.0, 9.99], &WIDE);
        assert_eq!(rows(&close), [Some((0, false)), Some((1, false)), Some((0, false)), Some((0, true))]);
        assert_eq!(close.height(&WIDE), 2 * Words::row_height(&WIDE));
        // Beyond the rows, and beyond the axis, lines have no word.
        let crowd = words(&[2.0; 9], &NARROW);
        assert_eq!(rows(&crowd).iter().filter(|row| row.is_some()).count(), ROWS_MAX);
        assert_eq!(rows(&words(&[11.0], &WIDE)), [None]);
        assert_eq!(words(&[], &WIDE).height(&WIDE), 0);
    }
}
