//! Steps of a program to runs of moves: where the motion must stop, and where a long run is cut.
//!
//! **Sections.** A run without a stop may be as long as the program. It is cut into sections, each of which is smoothed by
//! itself, so that motion begins before all is planned, and in bounded memory. Where it is cut depends on the moves alone.
//! A cut is in the middle of a straight move or an arc, the longest of the later half: nothing steps there, and blends
//! take at most half of a move anyhow. A move of exact path is not divided: the cut is at its end. Where moves are short, one
//! stands for several, so that its direction is that of the path.

use std::mem::take;
use std::ops::Range;

use motion_kernel::hal::OutputState;

use super::curves::{Point, cubic, nurbs, through};
use super::error::{AtLine, Problem};
use super::outputs::Switches;
use super::travel;
use crate::gcode::{Feed, LineMove, Message, Nurbs, PathMode, ProbeMove, Step, StepKind};
use crate::machine::Machine;
use crate::toolpath::merge::merge;
use crate::toolpath::smooth::{Move, is_same_run};
use crate::toolpath::spline_ends::meet;
use crate::toolpath::{Element, Feeds, SpeedRatios, Vector};

/// Moves of the first section of a program at least, and of the later ones: each has twice as many as the one before, so
/// that motion begins soon.
const SECTION: [usize; 2] = [64, 1024];
/// A section takes this time at the programmed feed \[s\] at least, since a cut may cost some: 0.02 to 0.2 s were seen.
const SECTION_S: f64 = 4.0;
/// The tolerance of the halves, as a part of the move's: lines of another tolerance are not merged with them, so that both
/// go on in one direction.
const HALF: f64 = 1.0 - 1.0e-6;
/// So many moves on either side of a cut may become one with the move that is cut, within this part of their tolerance.
const AROUND: usize = 32;
const AROUND_SHARE: f64 = 0.5;
/// Moves of a section at most.
const SECTION_MAX: usize = 1 << 14;

/// A part of a program for a machine.
#[derive(Clone, Debug)]
pub(super) enum Part<const N: usize> {
    /// Moves that follow each other without a stop.
    Moves {
        /// The moves, one at least.
        moves: Vec<Move<N>>,
        /// The next part goes on without a stop.
        goes_on: bool,
    },
    /// What stands between stretches.
    Between(Between),
}

/// What stands between stretches.
#[derive(Clone, Debug)]
pub(super) enum Between {
    /// A probing move; its motion is the next part, unless it stands.
    Probe { line: u32, probe: Box<ProbeMove> },
    /// Rest.
    Dwell { line: u32, seconds: f64 },
    /// Spindle and coolant switch.
    Switch { line: u32, to: OutputState },
    /// Program stop.
    Stop {
        line: u32,
        /// What the program says of it.
        said: String,
    },
}

/// Makes parts of steps.
pub(super) struct Runs<'m, const N: usize> {
    machine: &'m Machine<N>,
    switches: Switches<'m, N>,
    run: Vec<Move<N>>,
    /// Its time at the programmed feed \[s\].
    run_s: f64,
    /// Where the spline begins whose points are being collected, and these.
    start: Vector<N>,
    points: Vec<Point<N>>,
    /// Moves of the next section.
    section: usize,
    parts: Vec<Part<N>>,
    /// Messages since the last program stop, each with its line.
    said: Vec<(u32, String)>,
}

impl<'m, const N: usize> Runs<'m, N> {
    /// Before the first step.
    pub(super) fn new(machine: &'m Machine<N>) -> Self {
        Self {
            machine,
            switches: Switches::new(machine),
            run: Vec::new(),
            run_s: 0.0,
            start: [0.0; N],
            points: Vec::new(),
            section: SECTION[0],
            parts: Vec::new(),
            said: Vec::new(),
        }
    }

    /// The parts that are known, which are taken.
    pub(super) fn parts(&mut self) -> Vec<Part<N>> {
        take(&mut self.parts)
    }

    /// How many of them have moves.
    pub(super) fn waiting(&self) -> usize {
        self.parts.iter().filter(|part| matches!(part, Part::Moves { .. })).count()
    }

    /// The program says something before the next step.
    pub(super) fn say(&mut self, message: &Message) {
        self.said.push((message.line, message.text.clone()));
    }

    /// Takes a step; `curves` are those of its batch.
    pub(super) fn step(&mut self, step: &Step, curves: &[Nurbs]) -> AtLine<()> {
        let (line, machine) = (step.line, self.machine);
        let at = |problem: Problem| (line, problem);
        let switch = match &step.kind {
            StepKind::Switch(to) => match self.switches.next(to).map_err(at)? {
                // For this machine it is no step.
                None => return Ok(()),
                switch => switch,
            },
            _ => None,
        };
        if !matches!(&step.kind, StepKind::Through(point) if !point.begins) {
            self.end_spline()?;
        }
        let path_move = |element: Element<N>, feed: Feed, mode| {
            let feeds = Feeds::programmed(feed.mm_s(), &element, &machine.letters_by_place());
            move_at(line, element, feeds, mode, machine)
        };
        match &step.kind {
            StepKind::Line(to) => self.go([path_move(Element::line(to, machine), to.feed, to.mode)])?,
            StepKind::Arc(arc) => {
                let element = Element::arc(arc, machine).map_err(|error| at(error.into()))?;
                self.go([path_move(element, arc.feed, arc.mode)])?;
            }
            StepKind::Cubic(curve) => {
                let element = cubic(curve, machine).map_err(at)?;
                self.go([path_move(element, curve.feed, curve.mode)])?;
            }
            StepKind::Nurbs(curve) => {
                let elements = nurbs(curve, curves.get(curve.curve), machine).map_err(at)?;
                self.go(elements.into_iter().map(|element| path_move(element, curve.feed, curve.mode)))?;
            }
            StepKind::Through(point) => {
                let (from, to) = (machine.coordinates(point.from), machine.coordinates(point.to));
                if self.points.is_empty() {
                    self.start = from;
                }
                let chord = Element::Line { from, to };
                let feeds = Feeds::programmed(point.feed.mm_s(), &chord, &machine.letters_by_place());
                self.points.push(Point { line, at: to, feeds, mode: point.mode });
                // The points of a spline are not moves yet; the stop behind the last is made above.
                return Ok(());
            }
            StepKind::Probe(probe) => {
                self.stop();
                let ProbeMove { from, to, end, feed, .. } = *probe;
                travel::check_end(machine.coordinates(end), machine).map_err(at)?;
                self.between(Between::Probe { line, probe: Box::new(*probe) });
                if from != to {
                    let to = LineMove { from, to, feed, mode: PathMode::ExactStop };
                    self.go([path_move(Element::line(&to, machine), feed, to.mode)])?;
                }
                self.stop();
            }
            &StepKind::Dwell { seconds } => {
                self.stop();
                self.rest(line, seconds);
            }
            StepKind::Switch(_) => {
                self.stop();
                if let Some((to, wait_s)) = switch {
                    self.between(Between::Switch { line, to });
                    self.rest(line, wait_s);
                }
            }
            &StepKind::ToolChange { tool } => {
                self.stop();
                // A message of its line names the tool, too.
                let others = take(&mut self.said).into_iter().filter(|&(of_line, _)| of_line != line);
                let said = words(format!("changes to tool {tool}"), line, others);
                self.between(Between::Stop { line, said });
            }
            StepKind::Stop => {
                self.stop();
                let said = words("stops".to_owned(), line, take(&mut self.said).into_iter());
                self.between(Between::Stop { line, said });
            }
            StepKind::End => self.stop(),
        }
        if step.kind.mode() == Some(PathMode::ExactStop) {
            self.stop();
        }
        Ok(())
    }

    /// Makes moves of the points of a spline.
    pub(super) fn end_spline(&mut self) -> AtLine<()> {
        let stops = self.points.last().is_some_and(|point| point.mode == PathMode::ExactStop);
        let moves = through(self.start, &mut self.points, self.machine)?;
        self.go(moves)?;
        if stops {
            self.stop();
        }
        Ok(())
    }

    /// Takes moves, up to one that leaves the travel.
    pub(super) fn go(&mut self, moves: impl IntoIterator<Item = Move<N>>) -> AtLine<()> {
        for mut step in moves {
            travel::check_move(&step.element, self.machine).map_err(|problem| (step.line, problem))?;
            if let Some(before) = self.run.last_mut() {
                meet(before, &mut step, self.machine.path.junction_angle_rad);
            }
            self.run_s += self.time_s(&step);
            self.run.push(step);
            let is_long = self.run.len() > self.section && self.run_s > SECTION_S;
            if is_long || self.run.len() > SECTION_MAX {
                self.cut();
            }
        }
        Ok(())
    }

    /// The time of a move at its programmed feed \[s\].
    fn time_s(&self, step: &Move<N>) -> f64 {
        let ratios = SpeedRatios::of(&step.element, &self.machine.letters_by_place());
        step.element.length_mm() / step.feeds.along(&ratios).min(self.machine.path.feed_mm_s)
    }

    /// Cuts a section off the run. A move at least is left.
    fn cut(&mut self) {
        let length_mm = |step: &Move<N>| match step.element {
            Element::Line { .. } | Element::Arc { .. } => step.element.length_mm(),
            Element::Polynomial { .. } | Element::Involute { .. } => 0.0,
        };
        let last = self.run.len() - 1;
        let later = self.run.iter().enumerate().take(last).skip(last / 2);
        let longest = later.map(|(index, step)| (index, length_mm(step))).rev();
        let longest = longest.max_by(|(_, one), (_, other)| one.total_cmp(other));
        let Some((index, _)) = longest.filter(|&(_, length_mm)| length_mm > 0.0) else {
            let rest = self.run.split_off(last);
            return self.end_section(rest);
        };
        if self.run[index].tolerance_mm == 0.0 {
            // Its end is exact anyhow.
            let rest = self.run.split_off(index + 1);
            return self.end_section(rest);
        }
        let (whole, stands_for) = self.around(index, last);
        if self.time_s(&whole) < 2.0 * self.machine.tick_s {
            // Its halves would be two pieces where a tick has hardly room for one.
            let rest = self.run.split_off(last);
            return self.end_section(rest);
        }
        let [first_half, other_half] = whole.element.split(0.5);
        let mut rest = self.run.split_off(stands_for.end);
        rest.insert(0, Move { element: other_half, ..whole });
        self.run.truncate(stands_for.start);
        self.run.push(Move { element: first_half, ..whole });
        self.end_section(rest);
    }

    /// One line or arc for the short lines around a move, if there is one within a part of their tolerance, and the moves that
    /// it stands for; these have to end before `last`. It is longer than the move, and its direction is that of the path.
    fn around(&self, index: usize, last: usize) -> (Move<N>, Range<usize>) {
        let alike = |one: usize| is_same_run(&self.run[one], &self.run[one + 1]);
        let first = (index.saturating_sub(AROUND)..index).rev().take_while(|&before| alike(before)).last();
        let end = (index..(index + AROUND).min(last - 1)).take_while(|&here| alike(here)).last();
        let (first, end) = (first.unwrap_or(index), end.map_or(index, |here| here + 1) + 1);
        let step = self.run[index];
        let moves = &self.run[first..end];
        let from = moves.iter().map(|step| step.element.ends_mm().0);
        let points: Vec<_> = from.chain(moves.last().map(|step| step.element.ends_mm().1)).collect();
        let most_mm = AROUND_SHARE * step.tolerance_mm;
        let most_mm = step.merging_mm.map_or(most_mm, |merging_mm| merging_mm.min(most_mm));
        let parts = if moves.len() > 1 { merge(&points, most_mm) } else { Vec::new() };
        let ends = parts.iter().skip(1).map(|part| part.first).chain([moves.len()]);
        let longest = parts
            .iter()
            .zip(ends)
            .max_by(|(one, _), (other, _)| one.element.length_mm().total_cmp(&other.element.length_mm()));
        let (element, distance_mm, stands_for) = match longest {
            Some((part, end)) if part.element.length_mm() > step.element.length_mm() => {
                (part.element, part.distance_mm, first + part.first..first + end)
            }
            _ => (step.element, 0.0, index..index + 1),
        };
        let feeds = self.run[stands_for.clone()].iter().map(|step| step.feeds).reduce(Feeds::least);
        let tolerance_mm = (step.tolerance_mm - distance_mm) * HALF;
        let line = self.run[stands_for.start].line;
        (Move { line, element, tolerance_mm, feeds: feeds.unwrap_or(step.feeds), ..step }, stands_for)
    }

    fn end_section(&mut self, rest: Vec<Move<N>>) {
        self.run_s = rest.iter().map(|step| self.time_s(step)).sum();
        let moves = std::mem::replace(&mut self.run, rest);
        self.parts.push(Part::Moves { moves, goes_on: true });
        self.section = (2 * self.section).min(SECTION[1]);
    }

    /// The motion stops here.
    pub(super) fn stop(&mut self) {
        if !self.run.is_empty() {
            self.parts.push(Part::Moves { moves: take(&mut self.run), goes_on: false });
            self.run_s = 0.0;
        }
    }

    fn between(&mut self, what: Between) {
        self.parts.push(Part::Between(what));
    }

    /// A dwell; one of no time changes nothing but the stop it makes.
    fn rest(&mut self, line: u32, seconds: f64) {
        if seconds > 0.0 {
            self.between(Between::Dwell { line, seconds });
        }
    }
}

/// What is said of a stop.
fn words(what: String, line: u32, said: impl Iterator<Item = (u32, String)>) -> String {
    said.fold(format!("line {line} {what}"), |words, (_, text)| format!("{words}; {text}"))
}

/// A move of a program's line, with the tolerances of its path mode.
pub(super) fn move_at<const N: usize>(
    line: u32,
    element: Element<N>,
    feeds: Feeds,
    mode: PathMode,
    machine: &Machine<N>,
) -> Move<N> {
    let merging_mm = match mode {
        PathMode::Blend { merging_mm, .. } => merging_mm,
        PathMode::Unprogrammed | PathMode::ExactPath | PathMode::ExactStop => None,
    };
    Move { line, element, feeds, tolerance_mm: machine.path.tolerance_mm(mode), merging_mm, distance_mm: 0.0 }
}
