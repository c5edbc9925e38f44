//! The path of the tool's centre beside the programmed one, as LinuxCNC makes it.
//!
//! Every move is shifted by the tool's radius to the side of G41 or G42. The first one, the entry, goes
//! from where the tool is to the point beside its end. At an outer corner the centre goes round the corner
//! on an arc (at G0: straight on, then across). At an inner corner the move before ends, and the next one
//! begins, where both shifted paths meet; a move that would have to end before it begins does not let the
//! tool in and is refused (LinuxCNC drives some of them backwards). G40 leaves the tool where it is; the
//! next move, a straight one, takes it back to the programmed path.
//!
//! The end of a move is known with the next one only: until then its steps are changed in place. What
//! stands between two moves of the plane, such as a dwell or a move across the plane, happens at the
//! corner.

use std::f64::consts::{FRAC_PI_2, PI};

use super::axis::Point;
use super::cutter::Cutter;
use super::decimal::Length;
use super::error::{Located, Problem};
use super::frame::{lengths, turn};
use super::interpreter::Interpreter;
use super::program::{ArcMove, Feed, LineMove, PathMode, Plane, StepKind};

/// Smaller turns are no corners \[rad\]: posts round their tangents. At an inner one the tool cuts a
/// thousandth of its radius too deep, as in LinuxCNC.
const CORNER_MIN_RAD: f64 = 0.05;
/// By so much an arc may be longer than programmed \[rad\], by ends rounded as above.
const GROWTH_MAX_RAD: f64 = 0.0254;
/// Shorter motion in the plane is none, and an end this far before the start is the start \[mm\].
const LENGTH_MIN_MM: f64 = 1e-6;
/// The least cosine between the end's radius and the chord of an entry arc.
const ENTRY_COS_MIN: f64 = 1e-4;

/// A point or vector along the plane's axes \[mm\].
type PlanePoint = [f64; 2];

/// The last move in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    /// Where the centre starts.
    start: PlanePoint,
    /// Where it ends unless the next corner is an inner one: beside the programmed point.
    end: PlanePoint,
    shape: Shape,
    /// The index of its step. Behind it come steps that do not move in the plane.
    step: usize,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Line { direction: PlanePoint },
    Arc(Circle),
}

impl Shape {
    fn is_outside_arc(&self) -> bool {
        matches!(self, Self::Arc(circle) if !circle.is_inside)
    }
}

/// An arc of the centre.
#[derive(Clone, Copy, Debug)]
struct Circle {
    centre: PlanePoint,
    radius_mm: f64,
    /// 1: counter-clockwise, -1: clockwise.
    turn: f64,
    /// What the centre runs through, and what the program says \[rad\], positive.
    sweep_rad: f64,
    programmed_rad: f64,
    /// The tool is inside of the arc.
    is_inside: bool,
}

/// How a move is made, and where it is asked for.
#[derive(Clone, Copy, Debug)]
struct Manner {
    feed: Feed,
    mode: PathMode,
    place: usize,
}

/// What the path does at the start of a move.
#[derive(Clone, Copy, Debug)]
enum Corner {
    Smooth,
    /// It turns away from the tool by so much \[rad\].
    Outer(f64),
    /// It turns towards the tool by so much \[rad\].
    Inner(f64),
}

impl Interpreter {
    /// A straight move with compensation.
    pub(super) fn offset_line(
        &mut self,
        to: Point,
        feed: Feed,
        mode: PathMode,
        place: usize,
    ) -> Result<(), Located> {
        let Some(cutter) = self.cutter else { return Ok(()) };
        let from = self.machine;
        let feed = self.straight_feed(feed, from, to);
        let manner = Manner { feed, mode, place };
        let [start, end] = [from, to].map(|point| self.in_plane(point));
        let along = minus(end, start);
        let length_mm = norm(along);
        let Some(track) = cutter.track else {
            if length_mm <= cutter.radius_mm {
                return Err(cutter.entry_too_short(length_mm, place));
            }
            let direction = scaled(along, 1.0 / length_mm);
            let end = plus(end, cutter.side(direction), cutter.radius_mm);
            let step = self.program.steps.len();
            self.centre_line(end, to, manner)?;
            self.follow(Track { start, end, shape: Shape::Line { direction }, step });
            return Ok(());
        };
        if length_mm < LENGTH_MIN_MM {
            return self.centre_line(track.end, to, manner);
        }
        let direction = scaled(along, 1.0 / length_mm);
        let normal = cutter.side(direction);
        let beside = plus(start, normal, cutter.radius_mm);
        let end = plus(end, normal, cutter.radius_mm);
        let begins = match cutter.corner(&track, start, normal, track.shape.is_outside_arc()) {
            Corner::Smooth => {
                self.end_track(place)?;
                track.end
            }
            Corner::Outer(_) if feed == Feed::Rapid => {
                self.end_track(place)?;
                self.centre_line(beside, from, manner)?;
                beside
            }
            Corner::Outer(turn_rad) => self.round(start, beside, turn_rad, from, manner)?,
            Corner::Inner(turn_rad) => {
                let meeting = match track.shape {
                    Shape::Arc(circle) => {
                        let [first, last] =
                            crossings(beside, direction, &circle).ok_or_else(|| cutter.gouge(place))?;
                        if circle.is_inside { first } else { last }
                    }
                    Shape::Line { .. } => {
                        let onwards = cutter.direction(minus(track.end, start));
                        plus(track.end, onwards, -libm::tan(turn_rad / 2.0))
                    }
                };
                self.end_at(meeting, place)?
            }
        };
        let step = self.program.steps.len();
        self.centre_line(end, to, manner)?;
        self.follow(Track { start: begins, end, shape: Shape::Line { direction }, step });
        Ok(())
    }

    /// An arc with compensation.
    pub(super) fn offset_arc(&mut self, arc: &ArcMove, place: usize) -> Result<(), Located> {
        let Some(cutter) = self.cutter else { return Ok(()) };
        let manner = Manner { feed: arc.feed, mode: arc.mode, place };
        let [start, end] = [arc.from, arc.to].map(|point| self.in_plane(point));
        let centre = arc.centre_mm;
        let turn = 1.0_f64.copysign(arc.sweep_rad);
        let is_inside = cutter.is_left == (turn > 0.0);
        if is_inside && arc.start_radius_mm.min(arc.end_radius_mm) <= cutter.radius_mm {
            let radius_mm = cutter.radius_mm;
            return Err(Located::new(place, Problem::CompensatedArc { radius_mm }));
        }
        // From a point of the arc to the side of the tool.
        let normal = |point: PlanePoint| {
            let outwards = minus(point, centre);
            scaled(outwards, if is_inside { -1.0 } else { 1.0 } / norm(outwards))
        };
        let programmed_rad = arc.sweep_rad.abs();
        let Some(track) = cutter.track else {
            let circle =
                Circle { centre, radius_mm: 0.0, turn, sweep_rad: programmed_rad, programmed_rad, is_inside };
            let end = plus(end, normal(end), cutter.radius_mm);
            return self.entry_arc(arc, circle, [start, end], manner);
        };
        let beside = plus(start, normal(start), cutter.radius_mm);
        let end = plus(end, normal(end), cutter.radius_mm);
        let radius_mm = arc.end_radius_mm + if is_inside { -cutter.radius_mm } else { cutter.radius_mm };
        let mut circle =
            Circle { centre, radius_mm, turn, sweep_rad: programmed_rad, programmed_rad, is_inside };
        let begins = match cutter.corner(&track, start, normal(start), !is_inside) {
            Corner::Smooth => {
                self.end_track(place)?;
                track.end
            }
            Corner::Outer(turn_rad) => self.round(start, beside, turn_rad, arc.from, manner)?,
            Corner::Inner(_) => {
                let meeting = match track.shape {
                    Shape::Arc(before) => between(&before, &circle),
                    Shape::Line { .. } => {
                        let direction = cutter.direction(minus(track.end, start));
                        let direction = scaled(direction, 1.0 / norm(direction));
                        crossings(track.end, direction, &circle)
                            .map(|[first, last]| if is_inside { last } else { first })
                    }
                };
                self.end_at(meeting.ok_or_else(|| cutter.gouge(place))?, place)?
            }
        };
        // If nothing is left, the arc's end says so.
        circle.sweep_rad -= circle.travel_rad(beside, begins);
        let step = self.program.steps.len();
        self.centre_arc(&circle, end, arc.to, manner)?;
        self.follow(Track { start: begins, end, shape: Shape::Arc(circle), step });
        Ok(())
    }

    /// The arc from where the tool is that is tangent, beside the programmed end, to the path.
    fn entry_arc(
        &mut self,
        arc: &ArcMove,
        mut circle: Circle,
        [start, end]: [PlanePoint; 2],
        manner: Manner,
    ) -> Result<(), Located> {
        let Some(cutter) = self.cutter else { return Ok(()) };
        let length_mm = norm(minus(self.in_plane(arc.to), start));
        if length_mm <= cutter.radius_mm {
            return Err(cutter.entry_too_short(length_mm, manner.place));
        }
        let (chord, radius) = (minus(start, end), minus(circle.centre, end));
        let cos = dot(chord, radius) / (norm(chord) * norm(radius));
        // With a centre on the other side the tool would come from ahead. NaN is none either.
        if !(cos >= ENTRY_COS_MIN) {
            let radius_mm = cutter.radius_mm;
            return Err(Located::new(manner.place, Problem::CompensatedArc { radius_mm }));
        }
        circle.radius_mm = norm(chord) / 2.0 / cos;
        circle.centre = plus(end, radius, circle.radius_mm / norm(radius));
        let part_rad = circle.travel_rad(start, end).rem_euclid(2.0 * PI);
        let turns = ((circle.programmed_rad - part_rad) / (2.0 * PI)).round().max(0.0);
        circle.sweep_rad = part_rad + turns * 2.0 * PI;
        circle.programmed_rad = circle.sweep_rad;
        if cutter.shift_mm != [0.0; 2] {
            // The arc is one of the nose's centre.
            self.centre_line(start, arc.from, manner)?;
        }
        let step = self.program.steps.len();
        self.centre_arc(&circle, end, arc.to, manner)?;
        self.follow(Track { start, end, shape: Shape::Arc(circle), step });
        Ok(())
    }

    /// Round an outer corner; where it ends.
    fn round(
        &mut self,
        corner: PlanePoint,
        end: PlanePoint,
        turn_rad: f64,
        height: Point,
        manner: Manner,
    ) -> Result<PlanePoint, Located> {
        let Some(cutter) = self.cutter else { return Ok(end) };
        self.end_track(manner.place)?;
        let circle = Circle {
            centre: corner,
            radius_mm: cutter.radius_mm,
            turn: if cutter.is_left { -1.0 } else { 1.0 },
            sweep_rad: turn_rad,
            programmed_rad: turn_rad,
            is_inside: false,
        };
        self.centre_arc(&circle, end, height, manner)?;
        Ok(end)
    }

    /// A straight step of the centre, to the height of a point across the plane.
    fn centre_line(&mut self, end: PlanePoint, height: Point, manner: Manner) -> Result<(), Located> {
        let from = self.position();
        let to = self.controlled(end, height, manner.place)?;
        if from != to {
            self.step(StepKind::Line(LineMove { from, to, feed: manner.feed, mode: manner.mode }))?;
        }
        self.tool_at = Some(to);
        Ok(())
    }

    /// A step of the centre along an arc.
    fn centre_arc(
        &mut self,
        circle: &Circle,
        end: PlanePoint,
        height: Point,
        manner: Manner,
    ) -> Result<(), Located> {
        let Some(cutter) = self.cutter else { return Ok(()) };
        let from = self.position();
        let to = self.controlled(end, height, manner.place)?;
        let centre_mm = plus(circle.centre, cutter.shift_mm, 1.0);
        let [start_radius_mm, end_radius_mm] =
            [from, to].map(|point| norm(minus(self.in_plane(point), centre_mm)));
        let (plane, turn_deg) = (self.modal.plane, self.plane_turn_deg());
        let sweep_rad = circle.turn * circle.sweep_rad;
        let arc = ArcMove {
            from,
            to,
            plane,
            turn_deg,
            centre_mm,
            start_radius_mm,
            end_radius_mm,
            sweep_rad,
            feed: manner.feed,
            mode: manner.mode,
        };
        self.step(StepKind::Arc(arc))?;
        self.tool_at = Some(to);
        Ok(())
    }

    /// No corner follows: the last move ends beside its programmed end, if it may.
    pub(super) fn end_track(&mut self, place: usize) -> Result<(), Located> {
        match self.cutter.and_then(|cutter| cutter.track) {
            Some(track) => self.end_at(track.end, place).map(drop),
            None => Ok(()),
        }
    }

    /// Ends the last move at a point, and with it what came behind it; where it ends.
    fn end_at(&mut self, point: PlanePoint, place: usize) -> Result<PlanePoint, Located> {
        let Some((cutter, track)) = self.cutter.and_then(|cutter| Some((cutter, cutter.track?))) else {
            return Ok(point);
        };
        let (mut point, mut sweep_rad) = (point, 0.0);
        match track.shape {
            Shape::Line { direction } => {
                let left_mm = dot(minus(point, track.start), direction);
                if left_mm < -LENGTH_MIN_MM {
                    return Err(cutter.gouge(place));
                }
                if left_mm < LENGTH_MIN_MM {
                    point = track.start;
                }
            }
            Shape::Arc(circle) => {
                sweep_rad = circle.sweep_rad - circle.travel_rad(point, track.end);
                if sweep_rad <= 0.0 || sweep_rad > circle.programmed_rad + GROWTH_MAX_RAD {
                    return Err(cutter.gouge(place));
                }
            }
        }
        let mut at = None;
        for index in track.step..self.program.steps.len() {
            let Some(mut kind) = self.program.steps.get(index).map(|step| step.kind) else { continue };
            let (from, to) = match &mut kind {
                StepKind::Line(line) => (&mut line.from, &mut line.to),
                StepKind::Arc(arc) => {
                    let end = plus(point, cutter.shift_mm, 1.0);
                    arc.end_radius_mm = norm(minus(end, arc.centre_mm));
                    arc.sweep_rad = sweep_rad.copysign(arc.sweep_rad);
                    (&mut arc.from, &mut arc.to)
                }
                _ => continue,
            };
            *from = at.unwrap_or(*from);
            *to = self.controlled(point, *to, place)?;
            at = Some(*to);
            if let Some(step) = self.program.steps.get_mut(index) {
                step.kind = kind;
            }
        }
        self.tool_at = at.or(self.tool_at);
        self.drop_empty_lines(track.step);
        Ok(point)
    }

    /// Removes lines of no length from a step on.
    fn drop_empty_lines(&mut self, first: usize) {
        let is_empty = |kind: &StepKind| matches!(kind, StepKind::Line(line) if line.from == line.to);
        let mut index = first;
        while let Some(step) = self.program.steps.get(index) {
            if !is_empty(&step.kind) {
                index += 1;
                continue;
            }
            self.program.steps.remove(index);
            self.program.lines.removed(index);
            for (before, _) in
                self.program.tool_changes.iter_mut().rev().take_while(|(before, _)| *before > index)
            {
                *before -= 1;
            }
            for message in self.program.messages.iter_mut().rev().take_while(|message| message.step > index) {
                message.step -= 1;
            }
        }
    }

    fn follow(&mut self, track: Track) {
        if let Some(cutter) = &mut self.cutter {
            cutter.track = Some(track);
        }
    }

    /// Where the tool is: beside the programmed point with compensation, and behind G40 until the next move.
    fn position(&self) -> Point {
        self.tool_at.unwrap_or(self.machine)
    }

    /// The turn of the plane's axes about Z \[°\]. In XY there is none: a turned circle is a circle.
    pub(super) fn plane_turn_deg(&self) -> f64 {
        if self.modal.plane == Plane::Xy { 0.0 } else { self.frame.rotation_deg }
    }

    fn in_plane(&self, point: Point) -> PlanePoint {
        let turned = turn(point.map(Length::units), -self.plane_turn_deg());
        let [first, second, _] = self.modal.plane.axes();
        [first, second].map(|axis| turned[axis] as f64 / Length::UNITS_PER_MM as f64)
    }

    /// The tool's controlled point with the centre there, at the height of a point across the plane.
    fn controlled(&self, centre: PlanePoint, height: Point, place: usize) -> Result<Point, Located> {
        let beyond = Located::new(place, Problem::WorkOutOfRange);
        let Some(cutter) = self.cutter else { return Err(beyond) };
        let [first, second, _] = self.modal.plane.axes();
        let [Some(u), Some(v)] = plus(centre, cutter.shift_mm, 1.0).map(Length::nearest) else {
            return Err(beyond);
        };
        let mut turned = turn(height.map(Length::units), -self.plane_turn_deg());
        (turned[first], turned[second]) = (u.units(), v.units());
        lengths(turn(turned, self.plane_turn_deg())).ok_or(beyond)
    }
}

impl Cutter {
    /// A direction, turned to the side of the tool.
    fn side(&self, [u, v]: PlanePoint) -> PlanePoint {
        if self.is_left { [-v, u] } else { [v, -u] }
    }

    /// The direction of a path, from that to the side of its tool.
    fn direction(&self, [u, v]: PlanePoint) -> PlanePoint {
        if self.is_left { [v, -u] } else { [-v, u] }
    }

    /// The corner between the last move and one that starts in `start` with the tool along `normal`. A path
    /// that goes back beside itself goes round its end, unless it `climbs` from the outside of an arc, or
    /// onto it: then it stays above.
    fn corner(&self, track: &Track, start: PlanePoint, normal: PlanePoint, climbs: bool) -> Corner {
        let before = minus(track.end, start);
        let turn_rad = libm::atan2(cross(before, normal), dot(before, normal));
        let outwards_rad = if self.is_left { -turn_rad } else { turn_rad };
        let reverses = outwards_rad.abs() >= PI - CORNER_MIN_RAD;
        if reverses && !climbs {
            return Corner::Outer(outwards_rad.rem_euclid(2.0 * PI));
        }
        if outwards_rad.abs() <= CORNER_MIN_RAD {
            Corner::Smooth
        } else if outwards_rad > 0.0 && !reverses {
            Corner::Outer(outwards_rad)
        } else {
            Corner::Inner(outwards_rad.abs())
        }
    }

    fn entry_too_short(&self, length_mm: f64, place: usize) -> Located {
        Located::new(place, Problem::CompensationEntry { length_mm, radius_mm: self.radius_mm })
    }

    fn gouge(&self, place: usize) -> Located {
        Located::new(place, Problem::Gouge { radius_mm: self.radius_mm })
    }
}

impl Circle {
    /// The angle from one direction to another, the way the arc goes, from -90° to 270° \[rad\].
    fn travel_rad(&self, from: PlanePoint, to: PlanePoint) -> f64 {
        let (from, to) = (minus(from, self.centre), minus(to, self.centre));
        let angle_rad = self.turn * libm::atan2(cross(from, to), dot(from, to));
        if angle_rad < -FRAC_PI_2 { angle_rad + 2.0 * PI } else { angle_rad }
    }
}

/// Where a line crosses a circle, in the order of its direction, which is of length 1.
fn crossings(on_line: PlanePoint, direction: PlanePoint, circle: &Circle) -> Option<[PlanePoint; 2]> {
    let to_centre = minus(circle.centre, on_line);
    let off_mm = cross(direction, to_centre);
    let half_mm = libm::sqrt((circle.radius_mm - off_mm) * (circle.radius_mm + off_mm));
    if half_mm.is_nan() {
        return None;
    }
    let middle_mm = dot(to_centre, direction);
    Some([middle_mm - half_mm, middle_mm + half_mm].map(|along| plus(on_line, direction, along)))
}

/// Where an arc and the next one meet.
fn between(before: &Circle, next: &Circle) -> Option<PlanePoint> {
    let across = minus(next.centre, before.centre);
    let distance_mm = norm(across);
    let towards = scaled(across, 1.0 / distance_mm);
    let along_mm = (before.radius_mm * before.radius_mm + distance_mm * distance_mm
        - next.radius_mm * next.radius_mm)
        / (2.0 * distance_mm);
    let aside_mm = libm::sqrt((before.radius_mm - along_mm) * (before.radius_mm + along_mm));
    if !aside_mm.is_finite() {
        return None;
    }
    let left = if before.is_inside == (next.turn > 0.0) { aside_mm } else { -aside_mm };
    Some(plus(plus(before.centre, towards, along_mm), [-towards[1], towards[0]], left))
}

fn plus(a: PlanePoint, b: PlanePoint, times: f64) -> PlanePoint {
    [a[0] + b[0] * times, a[1] + b[1] * times]
}

fn minus(a: PlanePoint, b: PlanePoint) -> PlanePoint {
    [a[0] - b[0], a[1] - b[1]]
}

fn scaled(a: PlanePoint, times: f64) -> PlanePoint {
    [a[0] * times, a[1] * times]
}

fn dot(a: PlanePoint, b: PlanePoint) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: PlanePoint, b: PlanePoint) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn norm(a: PlanePoint) -> f64 {
    libm::hypot(a[0], a[1])
}
