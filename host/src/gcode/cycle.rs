//! Drilling cycles: G73, G81 to G83, G85, G86, G88 and G89 to moves.
//!
//! As LinuxCNC makes them: along the normal of the plane, in exact path, the holes of one line after each other.

use super::axis::{AXES_MAX, Axes};
use super::block::Block;
use super::decimal::Length;
use super::error::{Located, Problem};
use super::interpreter::Interpreter;
use super::lexer::Word;
use super::modal::{Distance, FeedMode};
use super::polar::Polar;
use super::program::{Feed, LineMove, PathMode, Plane, StepKind};

/// How far above the depth reached a peck stops its rapid, or a chip breaks \[10⁻¹⁰ mm\]: 0.254 mm.
const CLEARANCE: i64 = Length::UNITS_PER_MM * 254 / 1000;

/// A cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cycle {
    /// G73: pecks, with a short retraction to break the chip.
    ChipBreak,
    /// G81.
    Drill,
    /// G82: with a dwell.
    DrillDwell,
    /// G83: pecks, out of the hole after each.
    Peck,
    /// G85: back at feed.
    Bore,
    /// G86: with a dwell, the spindle stopped on the way back.
    BoreStop,
    /// G88: with a dwell, and a stop at the bottom, the spindle stopped for it.
    BoreManual,
    /// G89: with a dwell, back at feed.
    BoreDwell,
}

impl Cycle {
    pub(super) fn of(tenths: i64) -> Option<Self> {
        Some(match tenths {
            730 => Self::ChipBreak,
            810 => Self::Drill,
            820 => Self::DrillDwell,
            830 => Self::Peck,
            850 => Self::Bore,
            860 => Self::BoreStop,
            880 => Self::BoreManual,
            890 => Self::BoreDwell,
            _ => return None,
        })
    }

    pub(super) fn tenths(self) -> i64 {
        match self {
            Self::ChipBreak => 730,
            Self::Drill => 810,
            Self::DrillDwell => 820,
            Self::Peck => 830,
            Self::Bore => 850,
            Self::BoreStop => 860,
            Self::BoreManual => 880,
            Self::BoreDwell => 890,
        }
    }

    pub(super) fn word(self) -> &'static str {
        match self {
            Self::ChipBreak => "G73",
            Self::Drill => "G81",
            Self::DrillDwell => "G82",
            Self::Peck => "G83",
            Self::Bore => "G85",
            Self::BoreStop => "G86",
            Self::BoreManual => "G88",
            Self::BoreDwell => "G89",
        }
    }

    fn dwells(self) -> bool {
        matches!(self, Self::DrillDwell | Self::BoreStop | Self::BoreManual | Self::BoreDwell)
    }

    fn pecks(self) -> bool {
        matches!(self, Self::ChipBreak | Self::Peck)
    }

    /// Whether it takes a letter other than those of the axes.
    pub(super) fn takes(self, letter: u8) -> bool {
        match letter {
            b'R' | b'L' => true,
            b'P' => self.dwells(),
            b'Q' => self.pecks(),
            _ => false,
        }
    }
}

/// What stays in force from hole to hole.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CycleState {
    /// The cycle of the hole before; none if another motion mode was between.
    last: Option<Cycle>,
    /// Where the first hole began, along the plane's normal.
    initial: Option<Length>,
    /// The words of the hole before.
    r: Length,
    depth: Length,
    dwell_s: f64,
    peck: Length,
}

/// A hole, in work coordinates along the plane's normal \[10⁻¹⁰ mm\].
#[derive(Clone, Copy)]
struct Levels {
    /// R.
    r: i64,
    /// Where the rapid moves between holes are.
    clear: i64,
    bottom: i64,
}

impl Interpreter {
    /// The holes of a line. `first` is the word the place of errors is.
    pub(super) fn cycle(
        &mut self,
        block: &Block<'_>,
        cycle: Cycle,
        feed: Feed,
        first: Word<'_>,
    ) -> Result<(), Located> {
        let refused = |expected| first.problem(|_| Problem::Cycle { word: cycle.word(), expected });
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Err(refused("a feed per minute or revolution (G94, G95)"));
        }
        let [axis_1, axis_2, normal] = self.modal.plane.axes();
        if let Some(word) = block.axis_beside(Axes::XYZ) {
            return Err(word.problem(|word| Problem::CycleAxis { word, cycle: cycle.word() }));
        }
        let goes_on = self.cycle.last == Some(cycle);
        let words = self.words(block, cycle, goes_on, normal, first)?;
        let repeats =
            block.letter(b'L').map_or(Ok(1), |word| word.count(1, "a whole number of holes, 1 or more"))?;

        let incremental = self.modal.distance == Distance::Incremental;
        let mut initial = self.cycle.initial.unwrap_or(self.work[normal]).units();
        let mut increments = [0, 0];
        let mut hole = [self.work[axis_1].units(), self.work[axis_2].units()];
        let axes = block.axes();
        let polar = Polar::of(block)?;
        if polar.is_some() && self.modal.plane != Plane::Xy {
            return Err(refused("X, Y and Z in this plane, not @ and ^"));
        }
        for (index, axis) in [axis_1, axis_2].into_iter().enumerate() {
            let Some(word) = axes[axis] else { continue };
            let length = self.modal.units.coordinate(word)?.units();
            if incremental { increments[index] = length } else { hole[index] = length }
        }
        let r = words.r.units() + if incremental { initial } else { 0 };
        let bottom = words.depth.units() + if incremental { r } else { 0 };
        if bottom > r {
            return Err(refused("a depth below R"));
        }
        let mut here = self.work[normal].units();
        self.cycle = CycleState {
            last: Some(cycle),
            initial: Some(self.cycle.initial.unwrap_or(self.work[normal])),
            ..words
        };
        let start = self.work.map(Length::units);
        let at = |hole: [i64; 2], level: i64| {
            let mut point = start;
            point[axis_1] = hole[0];
            point[axis_2] = hole[1];
            point[normal] = level;
            point
        };
        if initial < r {
            let above = [self.work[axis_1].units(), self.work[axis_2].units()];
            // The cycle has not begun.
            self.straight(at(above, r), Feed::Rapid, self.modal.path, first)?;
            (initial, here) = (r, r);
        }
        let beyond = || first.problem(|word| Problem::PositionOutOfRange { word });
        let levels = Levels { r, clear: if self.modal.retracts_to_r { r } else { initial }, bottom };
        for repeat in 0..repeats {
            let before = self.program.steps.len();
            hole = [hole[0] + increments[0], hole[1] + increments[1]];
            if let Some(polar) = polar {
                let here = hole.map(Length::from_units);
                let [Some(x), Some(y)] = here else { return Err(beyond()) };
                hole = polar.point([x, y], &self.modal)?.map(Length::units);
            }
            let over = if repeat == 0 && here > r { here } else { levels.clear };
            self.straight(at(hole, over), Feed::Rapid, PathMode::ExactPath, first)?;
            self.straight(at(hole, r), Feed::Rapid, PathMode::ExactPath, first)?;
            self.hole(cycle, levels, feed, first, |level| at(hole, level))?;
            // Without a step, the others would make none either, however many L asks for.
            if self.program.steps.len() == before {
                break;
            }
        }
        Ok(())
    }

    /// R, depth, dwell and peck of a line, or of the line before.
    fn words(
        &self,
        block: &Block<'_>,
        cycle: Cycle,
        goes_on: bool,
        normal: usize,
        first: Word<'_>,
    ) -> Result<CycleState, Located> {
        let axes = block.axes();
        let missing = [
            (block.letter(b'R').is_none(), "an R word"),
            (axes[normal].is_none(), "a depth along the normal of the plane"),
            (cycle.dwells() && block.letter(b'P').is_none(), "a dwell, a P word"),
            (cycle.pecks() && block.letter(b'Q').is_none(), "the depth of a peck, a Q word"),
        ];
        if let Some((_, expected)) = missing.into_iter().find(|(is_missing, _)| *is_missing && !goes_on) {
            return Err(first.problem(|_| Problem::Cycle { word: cycle.word(), expected }));
        }
        let mut words = self.cycle;
        let length = |word| self.modal.units.length(word);
        if let Some(word) = block.letter(b'R') {
            words.r = length(word)?;
        }
        if let Some(word) = axes[normal] {
            words.depth = length(word)?;
        }
        if let Some(word) = block.letter(b'P').filter(|_| cycle.dwells()) {
            word.refuse_negative()?;
            words.dwell_s = word.number.to_f64();
        }
        if let Some(word) = block.letter(b'Q').filter(|_| cycle.pecks()) {
            words.peck = length(word)?;
            if words.peck <= Length::ZERO {
                return Err(word
                    .problem(|word| Problem::NotThisCount { word, expected: "a positive depth of a peck" }));
            }
        }
        if matches!(cycle, Cycle::BoreStop | Cycle::BoreManual) && self.modal.spindle.clockwise.is_none() {
            return Err(first
                .problem(|_| Problem::Cycle { word: cycle.word(), expected: "a turning spindle (M3, M4)" }));
        }
        Ok(words)
    }

    /// Down from R, and up again.
    fn hole(
        &mut self,
        cycle: Cycle,
        levels: Levels,
        feed: Feed,
        first: Word<'_>,
        at: impl Fn(i64) -> [i64; AXES_MAX],
    ) -> Result<(), Located> {
        if cycle.pecks() {
            let mut depth = levels.r - self.cycle.peck.units();
            while depth > levels.bottom {
                self.straight(at(depth), feed, PathMode::ExactPath, first)?;
                if cycle == Cycle::Peck {
                    self.straight(at(levels.r), Feed::Rapid, PathMode::ExactPath, first)?;
                }
                self.straight(at(depth + CLEARANCE), Feed::Rapid, PathMode::ExactPath, first)?;
                depth -= self.cycle.peck.units();
            }
        }
        self.straight(at(levels.bottom), feed, PathMode::ExactPath, first)?;
        if cycle.dwells() {
            self.step(StepKind::Dwell { seconds: self.cycle.dwell_s })?;
        }
        let turned = self.modal.spindle.clockwise;
        match cycle {
            Cycle::Bore => self.straight(at(levels.r), feed, PathMode::ExactPath, first)?,
            Cycle::BoreDwell => self.straight(at(levels.clear), feed, PathMode::ExactPath, first)?,
            Cycle::BoreStop => self.stop_spindle()?,
            Cycle::BoreManual => {
                self.stop_spindle()?;
                self.step(StepKind::Stop)?;
                self.modal.spindle.clockwise = turned;
                self.switch()?;
            }
            _ => {}
        }
        self.straight(at(levels.clear), Feed::Rapid, PathMode::ExactPath, first)?;
        self.modal.spindle.clockwise = turned;
        self.switch()
    }

    /// A straight move to a point in work coordinates \[10⁻¹⁰ mm\].
    pub(super) fn straight(
        &mut self,
        to: [i64; AXES_MAX],
        feed: Feed,
        mode: PathMode,
        first: Word<'_>,
    ) -> Result<(), Located> {
        let beyond = || first.problem(|word| Problem::PositionOutOfRange { word });
        let work = super::frame::lengths(to).ok_or_else(beyond)?;
        let to = self.machine_at(work).ok_or_else(beyond)?;
        let from = self.tool_at.take().unwrap_or(self.machine);
        (self.work, self.machine) = (work, to);
        if from == to {
            return Ok(());
        }
        self.step(StepKind::Line(LineMove { from, to, feed, mode }))
    }

    /// Another motion mode is in force: the next cycle begins anew.
    pub(super) fn end_cycles(&mut self) {
        (self.cycle.last, self.cycle.initial) = (None, None);
    }
}
