//! The move a line asks for: straight, an arc, a point of a curve, or the holes of a cycle.

use std::f64::consts::PI;

use super::arc;
use super::axis::{AXES_MAX, Axis, Point, feed_length, is_rotary};
use super::block::{Block, GGroup};
use super::decimal::Length;
use super::error::{Located, Problem};
use super::frame::{lengths, turn, turn_sin_cos};
use super::interpreter::Interpreter;
use super::lexer::Word;
use super::modal::{Distance, FeedMode, Modal, Motion};
use super::polar::Polar;
use super::program::{
    ArcMove, CubicMove, Feed, LineMove, NoticeKind, PathMode, Plane, StepKind, ThroughMove,
};
use super::spline;

/// Most turns of an arc or a helix.
const TURNS_MAX: u32 = 10_000;

/// A line that asks for a move.
#[derive(Clone, Copy)]
pub(super) struct MoveLine<'a, 'line> {
    pub(super) block: &'a Block<'line>,
    pub(super) motion: Motion,
    pub(super) feed: Feed,
    /// The first word that asks for the move.
    pub(super) first: Word<'line>,
    /// Where problems of the move as a whole stand: its G word, or else the first word.
    pub(super) offset: usize,
}

impl Interpreter {
    /// The move a line asks for by an axis word or, in the arc modes, an offset or radius.
    pub(super) fn motion(&mut self, block: &Block<'_>) -> Result<(), Located> {
        if self.nurbs_line(block)? {
            return Ok(());
        }
        let code = block.g(GGroup::Motion);
        if block.axes_are_taken() {
            return match code.filter(|code| code.tenths != 800) {
                Some(code) => Err(code.word.problem(|word| Problem::AxesTaken { word })),
                None => Ok(()),
            };
        }
        if let (Some(Motion::Cycle(cycle)), Some(code)) = (self.modal.motion, code)
            && !block.has_axes()
        {
            let expected = "axis words";
            return Err(code.word.problem(|_| Problem::Cycle { word: cycle.word(), expected }));
        }
        if let (Some(Motion::Probe(_)), Some(code), false) = (self.modal.motion, code, block.has_axes()) {
            return Err(code.word.problem(|word| Problem::Setup { word, expected: "axis words" }));
        }
        let machine = block.machine_word();
        if !block.moves(self.modal.motion) {
            let unmoved =
                |word: Word<'_>| word.problem(|word| Problem::MachineMove { word, expected: "axis words" });
            return machine.map_or(Ok(()), |word| Err(unmoved(word)));
        }
        let ends = [b'P', b'Q', b'@', b'^'].map(|letter| block.letter(letter));
        let words = block.axes().into_iter().chain(block.offsets()).chain([block.letter(b'R')]).chain(ends);
        let Some(first) = words.flatten().min_by_key(|word| word.offset) else { return Ok(()) };
        let Some(motion) = self.modal.motion else {
            return Err(first.problem(|word| Problem::AxisWithoutMotion { word }));
        };
        let offset = code.map_or(first.offset, |code| code.word.offset);
        self.refuse_probe_feed(motion, offset)?;
        let feed = self.feed(block, motion, offset)?;
        self.refuse_uncompensated(motion, offset)?;
        if let Some(word) = machine {
            self.refuse_machine_move(word)?;
            return self.machine_move(block, motion, feed, first);
        }
        let line = MoveLine { block, motion, feed, first, offset };
        match motion {
            // Its lines were taken above.
            Motion::Nurbs(_) => Ok(()),
            Motion::Cycle(cycle) => self.cycle(block, cycle, feed, first),
            Motion::Rapid | Motion::Feed => self.line(line),
            Motion::Clockwise | Motion::CounterClockwise => self.circular(line),
            Motion::Cubic | Motion::Quadratic => self.cubic(line),
            Motion::Probe(kind) => self.probe(line, kind),
            Motion::Through => self.through(line, code.is_some()),
        }
    }

    /// Where a line leads: in the program's coordinates, and in those of the machine.
    pub(super) fn target(&self, line: MoveLine<'_, '_>) -> Result<[Point; 2], Located> {
        let work = self.end_point(line.block)?;
        let to = self.machine_at(work);
        Ok([work, to.ok_or_else(|| line.first.problem(|word| Problem::PositionOutOfRange { word }))?])
    }

    /// G0 and G1.
    fn line(&mut self, line: MoveLine<'_, '_>) -> Result<(), Located> {
        let [work, to] = self.target(line)?;
        if self.is_offset() {
            self.offset_line(to, line.feed, self.modal.path, line.offset)?;
            self.machine = to;
        } else {
            self.line_to(to, line.feed, self.modal.path)?;
        }
        self.work = work;
        Ok(())
    }

    /// G2 and G3.
    fn circular(&mut self, line: MoveLine<'_, '_>) -> Result<(), Located> {
        let [work, to] = self.target(line)?;
        self.refuse_plane(line.motion, self.modal.plane, line.offset)?;
        if self.plane_turn_deg() % 180.0 != 0.0 {
            // Turned, the plane needs both axes of the turn.
            self.refuse_plane(line.motion, Plane::Xy, line.offset)?;
        }
        // In the program's coordinates: turned to another plane's and rounded, the same point would be another.
        let [first_axis, second_axis, _] = self.modal.plane.axes();
        let closes = [first_axis, second_axis].iter().all(|&axis| work[axis] == self.work[axis]);
        let arc = self.arc(line, [self.machine, to], closes)?;
        if self.is_offset() {
            self.offset_arc(&arc, line.offset)?;
        } else {
            self.step(StepKind::Arc(arc))?;
        }
        (self.work, self.machine) = (work, to);
        Ok(())
    }

    /// G5 and G5.1.
    fn cubic(&mut self, line: MoveLine<'_, '_>) -> Result<(), Located> {
        let [work, to] = self.target(line)?;
        let MoveLine { block, motion, feed, offset, .. } = line;
        self.refuse_plane(motion, Plane::Xy, offset)?;
        let (from, mode) = (self.machine, self.modal.path);
        let controls_mm = match motion {
            Motion::Quadratic => spline::quadratic_mm(block, &self.modal, [self.work, work], offset)?,
            _ => spline::cubic_mm(block, &self.modal, self.cubic_before_mm, offset)?,
        };
        self.untimed(motion, offset)?;
        (self.work, self.machine) = (work, to);
        if from == to && controls_mm == [[0.0; 2]; 2] {
            return Ok(());
        }
        // What the next curve continues is in the program's directions.
        let turned_mm = controls_mm.map(|control| self.turned_mm(control));
        self.step(StepKind::Cubic(CubicMove { from, to, controls_mm: turned_mm, feed, mode }))?;
        // Only a G5 continues a G5.
        self.cubic_before_mm = (motion == Motion::Cubic).then_some(controls_mm[1]);
        Ok(())
    }

    /// A point of G5.5; with the word itself, another spline `begins`.
    fn through(&mut self, line: MoveLine<'_, '_>, begins: bool) -> Result<(), Located> {
        let [work, to] = self.target(line)?;
        let (from, mode) = (self.machine, self.modal.path);
        (self.work, self.machine) = (work, to);
        if from == to {
            return Ok(());
        }
        self.untimed(line.motion, line.offset)?;
        let feed = self.straight_feed(line.feed, from, to);
        self.step(StepKind::Through(ThroughMove { from, to, begins, feed, mode }))
    }

    /// Machine coordinates of a point; `None` beyond the range. Turned to the program's axes and back they are rounded:
    /// what stays in XY stays, so that a whole turn remains one.
    pub(super) fn machine_at(&self, work: Point) -> Option<Point> {
        let to = self.frame.machine(work)?;
        let stays = [0, 1].iter().all(|&axis| work[axis] == self.work[axis]);
        let mut to = to;
        if stays {
            [to[0], to[1]] = [self.machine[0], self.machine[1]];
        }
        Some(to)
    }

    /// A straight move from where the tool is.
    pub(super) fn line_to(&mut self, to: Point, feed: Feed, mode: PathMode) -> Result<(), Located> {
        let from = self.tool_at.take().unwrap_or(self.machine);
        self.machine = to;
        if from == to {
            return Ok(());
        }
        let feed = self.straight_feed(feed, from, to);
        self.step(StepKind::Line(LineMove { from, to, feed, mode }))
    }

    /// G53: to a point in machine coordinates.
    fn machine_move(
        &mut self,
        block: &Block<'_>,
        motion: Motion,
        feed: Feed,
        first: Word<'_>,
    ) -> Result<(), Located> {
        let refused = |expected| first.problem(|word| Problem::MachineMove { word, expected });
        if !matches!(motion, Motion::Rapid | Motion::Feed) {
            return Err(refused("G0 or G1"));
        }
        if self.modal.distance == Distance::Incremental {
            return Err(refused("absolute end points (G90)"));
        }
        if let Some(word) = block.letter(b'@').or(block.letter(b'^')) {
            return Err(word.problem(|word| Problem::MachineMove { word, expected: "axis words" }));
        }
        let mut to = self.machine;
        for (coordinate, word) in to.iter_mut().zip(block.axes()) {
            if let Some(word) = word {
                *coordinate = self.modal.units.coordinate(word)?;
            }
        }
        self.line_to(to, feed, self.modal.path)?;
        self.update_work(first.offset)
    }

    /// The feed in force; after G93, the F of the line.
    pub(super) fn feed(&self, block: &Block<'_>, motion: Motion, offset: usize) -> Result<Feed, Located> {
        if motion == Motion::Rapid {
            return Ok(Feed::Rapid);
        }
        let missing = |problem| Located::new(offset, problem);
        let spindle = self.modal.spindle;
        let own = block.letter(b'F').filter(|word| word.number.signum() > 0);
        match (self.modal.feed_mode, self.modal.feed, own) {
            (FeedMode::InverseTime, _, Some(word)) => Ok(Feed::MmPerMin(word.number.to_f64())),
            (FeedMode::InverseTime, ..) => {
                Err(missing(Problem::InverseTimeMissing { motion: motion.word() }))
            }
            (_, None, _) => Err(missing(Problem::FeedMissing { motion: motion.word() })),
            (FeedMode::PerMinute, Some(feed), _) => Ok(Feed::MmPerMin(feed.linear)),
            (FeedMode::PerRevolution, Some(feed), _) if spindle.speed > 0.0 && !spindle.is_surface => {
                Ok(Feed::MmPerMin(feed.linear * spindle.speed))
            }
            (FeedMode::PerRevolution, ..) => {
                Err(missing(Problem::SpindleSpeedMissing { motion: motion.word() }))
            }
        }
    }

    /// The feed of a straight move, from the feed that linear axes have.
    pub(super) fn straight_feed(&self, feed: Feed, from: Point, to: Point) -> Feed {
        match (self.modal.feed_mode, self.modal.feed) {
            (FeedMode::InverseTime, _) => self.timed(feed, feed_length(from, to)),
            (_, Some(programmed)) if feed != Feed::Rapid && is_rotary(from, to) => {
                let per_rev = self.modal.feed_mode == FeedMode::PerRevolution;
                let times = if per_rev { self.modal.spindle.speed } else { 1.0 };
                Feed::MmPerMin(programmed.angular * times)
            }
            _ => feed,
        }
    }

    /// Refuses a curve in a plane whose axes the machine does not have.
    pub(super) fn refuse_plane(&self, motion: Motion, plane: Plane, offset: usize) -> Result<(), Located> {
        let [first, second, _] = plane.axes().map(|index| Axis::ALL[index]);
        if self.program.axes.contains(first) && self.program.axes.contains(second) {
            return Ok(());
        }
        let (motion, axes) = (motion.word(), self.program.axes);
        Err(Located::new(offset, Problem::PlaneWithoutAxes { motion, plane, axes }))
    }

    /// The feed of a move of this length.
    pub(super) fn timed(&self, feed: Feed, length_mm: f64) -> Feed {
        match (self.modal.feed_mode, feed) {
            (FeedMode::InverseTime, Feed::MmPerMin(per_min)) => Feed::MmPerMin(per_min * length_mm),
            _ => feed,
        }
    }

    /// Curves have no feed of inverse time.
    pub(super) fn untimed(&self, motion: Motion, offset: usize) -> Result<(), Located> {
        if self.modal.feed_mode != FeedMode::InverseTime {
            return Ok(());
        }
        Err(Located::new(offset, Problem::CurveTimed { motion: motion.word() }))
    }

    /// A vector in XY \[mm\] of the program, in machine coordinates.
    fn turned_mm(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if self.frame.rotation_deg == 0.0 {
            return [x, y];
        }
        let (sin, cos) = turn_sin_cos(self.frame.rotation_deg);
        [x * cos - y * sin, x * sin + y * cos]
    }

    pub(super) fn end_point(&self, block: &Block<'_>) -> Result<Point, Located> {
        let mut to = self.work;
        for (coordinate, word) in to.iter_mut().zip(block.axes()) {
            let Some(word) = word else { continue };
            let length = self.modal.units.coordinate(word)?;
            *coordinate = match self.modal.distance {
                Distance::Absolute => length,
                Distance::Incremental => coordinate
                    .checked_add(length)
                    .ok_or_else(|| word.problem(|word| Problem::PositionOutOfRange { word }))?,
            };
        }
        if let Some(polar) = Polar::of(block)? {
            [to[0], to[1]] = polar.point([self.work[0], self.work[1]], &self.modal)?;
        }
        Ok(to)
    }

    /// An arc between two points; it `closes` if they are the same in its plane.
    fn arc(
        &mut self,
        line: MoveLine<'_, '_>,
        [from, to]: [Point; 2],
        closes: bool,
    ) -> Result<ArcMove, Located> {
        let MoveLine { block, motion, feed, offset, .. } = line;
        let Modal { plane, units, path: mode, .. } = self.modal;
        let [first, second, normal] = plane.axes();
        let offsets = block.offsets();
        if let Some(word) = offsets[normal].filter(|word| word.number.signum() != 0) {
            return Err(word.problem(|word| Problem::ArcOffsetOutsidePlane { word, plane }));
        }
        // In XY the machine's axes do; another plane turns with the program's.
        let turn_deg = self.plane_turn_deg();
        let turned = |point: Point| {
            let beyond = || Located::new(offset, Problem::WorkOutOfRange);
            lengths(turn(point.map(Length::units), -turn_deg)).ok_or_else(beyond)
        };
        let (turned_from, turned_to) = (turned(from)?, turned(to)?);
        let [start, end] = [turned_from, turned_to].map(|point| [point[first], point[second]]);
        let end = if closes { start } else { end };
        let clockwise = motion == Motion::Clockwise;
        let centre_words = [offsets[first], offsets[second]];
        let resolved = match (block.letter(b'R'), centre_words) {
            (None, [None, None]) => {
                Err(Located::new(offset, Problem::ArcWithoutCentre { motion: motion.word(), plane }))
            }
            (None, _) => {
                let centre = self.centre(centre_words, start, turn_deg, offset)?;
                arc::about_centre(start, end, centre, clockwise, units.radius_mismatch_mm())
                    .map_err(|problem| Located::new(offset, problem))
            }
            (Some(word), [None, None]) => {
                let radius = units.length(word)?;
                arc::of_radius(start, end, radius, clockwise, plane, || word.text())
                    .map_err(|problem| Located::new(word.offset, problem))
            }
            (Some(word), _) => Err(word.problem(|word| Problem::ArcCentreAndRadius { word })),
        }?;
        if resolved.radius_enlarged {
            self.notice(NoticeKind::RadiusEnlarged);
        }
        let arc::Resolved { centre_mm, start_radius_mm, end_radius_mm, mut sweep_rad, .. } = resolved;
        if let Some(word) = block.letter(b'P') {
            let turns = word.count(1, "a whole number of turns from 1 to 10000")?;
            if turns > TURNS_MAX {
                let expected = "a whole number of turns from 1 to 10000";
                return Err(word.problem(|word| Problem::NotThisCount { word, expected }));
            }
            sweep_rad += (2.0 * PI * f64::from(turns - 1)).copysign(sweep_rad);
        }
        let mean_radius_mm = (start_radius_mm + end_radius_mm) / 2.0;
        let height_mm = turned_to[normal].to_mm() - turned_from[normal].to_mm();
        let feed = self.timed(feed, libm::hypot(mean_radius_mm * sweep_rad, height_mm));
        Ok(ArcMove {
            from,
            to,
            plane,
            turn_deg,
            centre_mm,
            start_radius_mm,
            end_radius_mm,
            sweep_rad,
            feed,
            mode,
        })
    }

    /// Centre along the plane's axes \[10⁻¹⁰ mm\], which are turned about Z by `turn_deg` from the machine's; it may
    /// lie beyond the range of a [`Length`].
    fn centre(
        &self,
        words: [Option<Word<'_>>; 2],
        start: [Length; 2],
        turn_deg: f64,
        offset: usize,
    ) -> Result<[i64; 2], Located> {
        let [first, second, _] = self.modal.plane.axes();
        let mut lengths = [0; 2];
        for (length, word) in lengths.iter_mut().zip(words) {
            *length = match word {
                Some(word) => self.modal.units.length(word)?.units(),
                None if self.modal.arc_distance == Distance::Incremental => 0,
                None => {
                    return Err(Located::new(
                        offset,
                        Problem::ArcCentreIncomplete { plane: self.modal.plane },
                    ));
                }
            };
        }
        let mut vector = [0; AXES_MAX];
        (vector[first], vector[second]) = (lengths[0], lengths[1]);
        let vector = turn(self.frame.turned(vector), -turn_deg);
        if self.modal.arc_distance == Distance::Incremental {
            return Ok([start[0].units() + vector[first], start[1].units() + vector[second]]);
        }
        let origin = turn(self.frame.zero(), -turn_deg);
        Ok([first, second].map(|axis| vector[axis] + origin[axis]))
    }
}
