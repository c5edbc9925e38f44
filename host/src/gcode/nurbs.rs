//! Control points of G5.2 and G6.2, as LinuxCNC takes them.
//!
//! G5.2 is that of LinuxCNC 2.9, by its documentation ("G5.2 G5.3 NURBS Block") and `convert_nurbs` of its
//! `interp_convert.cc`; as in 2.10 it may be in any plane. G6.2 has no documentation: it is that of `convert_nurbs` of LinuxCNC 2.10, where P is
//! the order, R the weight and K the knot.
//!
//! What they leave silent or undefined is refused here: a weight that is missing, an order that changes, other
//! words within the lines of a NURBS, a NURBS that is never ended, knots that decrease or are not all equal at
//! the start.

use super::axis::{Axis, Point, xyz_mm};
use super::block::{Block, GGroup};
use super::error::{Located, Problem};
use super::interpreter::Interpreter;
use super::lexer::Word;
use super::modal::Motion;
use super::program::{Feed, Nurbs, NurbsMove, Plane, StepKind};

/// Greatest order: beyond, a curve costs more to evaluate than any program needs.
const ORDER_MAX: u32 = 20;

/// How a NURBS is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// G5.2 to G5.3: the knots are uniform.
    Uniform,
    /// G6.2: every line has a knot.
    Knotted,
}

impl Kind {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Uniform => "G5.2",
            Self::Knotted => "G6.2",
        }
    }

    /// The number of its word in tenths.
    pub(super) fn tenths(self) -> i64 {
        match self {
            Self::Uniform => 52,
            Self::Knotted => 62,
        }
    }

    /// Its letters other than those of the axes.
    pub(super) fn letters(self) -> &'static [u8] {
        match self {
            Self::Uniform => b"LP",
            Self::Knotted => b"KPQR",
        }
    }
}

/// A NURBS whose lines are being read.
#[derive(Debug)]
pub(super) struct Open {
    kind: Kind,
    plane: Plane,
    /// So many control points make a point of the curve; none before the first L.
    order: Option<u32>,
    entries: Vec<Entry>,
}

/// What a line says.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// In work and in machine coordinates.
    point: Option<[Point; 2]>,
    weight: Option<f64>,
    knot: u32,
}

impl Interpreter {
    /// Refuses what has no place within the lines of a NURBS.
    pub(super) fn refuse_in_nurbs(&self, block: &Block<'_>) -> Result<(), Located> {
        let Some(open) = &self.nurbs else { return Ok(()) };
        let (word, expected) = match open.kind {
            _ if is_end(block) => (block.stranger(b"NF", &[53, 63]), "no other word but F in its line"),
            Kind::Uniform => {
                (block.stranger(b"NXYZPLF", &[52]), "X, Y, Z, P, L or F between G5.2 and G5.3, or G5.3")
            }
            Kind::Knotted => (
                block.stranger(b"NXYZPQRKF", &[62]),
                "X, Y, Z, P, Q, R, K or F until the NURBS is complete: the last K in as many lines as the order",
            ),
        };
        word.map_or(Ok(()), |word| Err(refused(&word, expected)))
    }

    /// The problem of a program that ends within a NURBS.
    pub(super) fn unended_nurbs(&self) -> Option<Located> {
        let expected = match self.nurbs.as_ref()?.kind {
            Kind::Uniform => "G5.3 before it",
            Kind::Knotted => "lines with the last K, as many as the order, before it",
        };
        let found = "the end of the program within a NURBS".to_owned();
        Some(Located::new(0, Problem::Nurbs { found, expected }))
    }

    /// A line of a NURBS, if it is one.
    pub(super) fn nurbs_line(&mut self, block: &Block<'_>) -> Result<bool, Located> {
        if let Some(end) = block.g(GGroup::NonModal).filter(|_| is_end(block)) {
            self.nurbs_end(block, end.tenths, end.word)?;
            return Ok(true);
        }
        let Some(motion @ Motion::Nurbs(kind)) = self.modal.motion else { return Ok(false) };
        let code = block.g(GGroup::Motion).map(|code| code.word);
        if block.axes_are_taken() || code.is_none() && !block.moves(Some(motion)) {
            return Ok(false);
        }
        if let Some(word) = block.machine_word() {
            return Err(word.problem(|word| Problem::MachineMove { word, expected: "G0 or G1" }));
        }
        let letters = b"XYZPLQRK".iter().filter_map(|&letter| block.letter(letter));
        let Some(first) = code.into_iter().chain(letters).min_by_key(|word| word.offset) else {
            return Ok(false);
        };
        self.refuse_uncompensated(motion, first.offset)?;
        let feed = self.feed(block, motion, first.offset)?;
        self.untimed(motion, first.offset)?;
        let point = self.control_point(block, self.modal.plane)?;
        match kind {
            Kind::Uniform => self.uniform_line(block, first, point)?,
            Kind::Knotted => {
                let is_complete = self.knotted_line(block, first, point)?;
                if is_complete {
                    self.knotted_end(first, feed)?;
                }
            }
        }
        if self.nurbs.as_ref().is_some_and(|open| open.entries.len() > self.steps_max) {
            let steps_max = self.steps_max;
            return Err(Located::new(first.offset, Problem::TooManySteps { steps_max }));
        }
        Ok(true)
    }

    /// The control point of a line. As in LinuxCNC, G91 counts all of them from where the NURBS starts.
    fn control_point(&self, block: &Block<'_>, plane: Plane) -> Result<Option<[Point; 2]>, Located> {
        let axes = block.axes();
        let [first, second, _] = plane.axes();
        let in_plane = [first, second].map(|index| Axis::ALL[index]).into_iter().collect();
        if let Some(word) = block.axis_beside(in_plane) {
            return Err(refused(&word, "no coordinate across the plane of the NURBS"));
        }
        let [first, second] = [first, second].map(|axis| axes.get(axis).copied().flatten());
        let word = match (first, second) {
            (None, None) => return Ok(None),
            (Some(word), None) | (None, Some(word)) => {
                return Err(refused(&word, "both coordinates of a control point"));
            }
            (Some(word), Some(_)) => word,
        };
        let work = self.end_point(block)?;
        match self.machine_at(work) {
            Some(machine) => Ok(Some([work, machine])),
            None => Err(word.problem(|word| Problem::PositionOutOfRange { word })),
        }
    }

    /// A line of G5.2.
    fn uniform_line(
        &mut self,
        block: &Block<'_>,
        first: Word<'_>,
        point: Option<[Point; 2]>,
    ) -> Result<(), Located> {
        let weight = block.own(b'P').map(|word| weight(&word)).transpose()?;
        let order = block.own(b'L').map(|word| order(&word, 3, "an order from 3 to 20")).transpose()?;
        let begins = self.nurbs.is_none();
        let entry = |point, weight| Entry { point, weight: Some(weight), knot: 0 };
        let from = [self.work, self.machine];
        let plane = self.modal.plane;
        let open = self.nurbs.get_or_insert_with(|| Open {
            kind: Kind::Uniform,
            plane,
            order: None,
            entries: Vec::new(),
        });
        if let (Some(new), Some(word)) = (order, block.own(b'L')) {
            if open.order.is_some_and(|order| order != new) {
                return Err(refused(&word, "one order for all of the NURBS"));
            }
            open.order = Some(new);
        }
        // The NURBS starts where the machine is. P without X and Y is the weight of that point.
        if begins {
            let of_start = if point.is_none() { weight } else { None };
            open.entries.push(entry(Some(from), of_start.unwrap_or(1.0)));
        } else if point.is_none() {
            return Err(refused(&first, "a control point, or G5.3: only the first line may be without"));
        }
        match (point, weight) {
            (None, _) => Ok(()),
            (Some(point), Some(weight)) => {
                open.entries.push(entry(Some(point), weight));
                Ok(())
            }
            (Some(_), None) => {
                let found = "a control point without P".to_owned();
                Err(Located::new(first.offset, Problem::Nurbs { found, expected: "its weight" }))
            }
        }
    }

    /// A line of G6.2; whether it completes the NURBS.
    fn knotted_line(
        &mut self,
        block: &Block<'_>,
        first: Word<'_>,
        point: Option<[Point; 2]>,
    ) -> Result<bool, Located> {
        const ORDER: &str = "an order from 2 to 20";
        let missing = |found: &str, expected| {
            Located::new(first.offset, Problem::Nurbs { found: found.to_owned(), expected })
        };
        let order = block.own(b'P').map(|word| order(&word, 2, ORDER)).transpose()?;
        let weight = block.own(b'R').map(|word| weight(&word)).transpose()?;
        // LinuxCNC's ways of approximating the curve, which is driven as it is here.
        let method = block.own(b'Q');
        if let Some(word) = method.filter(|word| !word.number.whole().is_some_and(|q| (1..=3).contains(&q))) {
            return Err(refused(&word, "1, 2 or 3"));
        }
        if point.is_some() && weight.is_none() {
            return Err(missing("a control point without R", "its weight"));
        }
        let word = block.own(b'K').ok_or_else(|| missing("a line of G6.2 without K", "its knot"))?;
        let knot = word.count(0, "a knot, a whole number that is not negative")?;
        let plane = self.modal.plane;
        let open = match &mut self.nurbs {
            Some(open) => open,
            None if order.is_none() => return Err(missing("a first line of G6.2 without P", ORDER)),
            None if method.is_none() => {
                return Err(missing("a first line of G6.2 without Q", "Q1, Q2 or Q3"));
            }
            none => none.insert(Open { kind: Kind::Knotted, plane, order, entries: Vec::new() }),
        };
        if let Some(word) = block.own(b'P').filter(|_| order != open.order) {
            return Err(refused(&word, "one order for all of the NURBS"));
        }
        if open.plane != plane {
            return Err(missing("another plane within a NURBS", "one plane"));
        }
        let order = open.order.unwrap_or(ORDER_MAX) as usize;
        let knot_of = |entry: Option<&Entry>| entry.map(|entry| entry.knot);
        if knot_of(open.entries.last()).is_some_and(|before| knot < before) {
            return Err(refused(&word, "a knot that is not below the one before"));
        }
        if open.entries.len() < order && knot_of(open.entries.first()).is_some_and(|first| knot != first) {
            return Err(refused(&word, "the first K in as many lines as the order P"));
        }
        open.entries.push(Entry { point, weight, knot });
        let count = open.entries.len();
        Ok(count > order && knot_of(open.entries.get(count - order)) == Some(knot))
    }

    /// G5.3 or G6.3.
    fn nurbs_end(&mut self, block: &Block<'_>, tenths: i64, word: Word<'_>) -> Result<(), Located> {
        let open = self.nurbs.as_ref().map(|open| open.kind);
        match (tenths, open) {
            (53, Some(Kind::Uniform)) => {}
            // It does nothing in LinuxCNC: the knots end a NURBS.
            (63, None) => return Ok(()),
            (53, _) => return Err(refused(&word, "G5.2 before it")),
            _ => return Err(refused(&word, "the last K in as many lines as the order before it")),
        }
        let feed = self.feed(block, Motion::Nurbs(Kind::Uniform), word.offset)?;
        let Some(open) = self.nurbs.take() else { return Ok(()) };
        let order = open.order.unwrap_or(3);
        let (points, count) = (open.entries.len(), order as usize);
        if points < count {
            return Err(Located::new(word.offset, Problem::NurbsPoints { points, order }));
        }
        let inner = points - count;
        let knots = (0..points + count).map(|index| index.saturating_sub(count - 1).min(inner + 1) as f64);
        self.made(order, &open.entries, knots.collect(), feed)
    }

    /// The NURBS whose last lines, as many as the order, are knots only.
    fn knotted_end(&mut self, at: Word<'_>, feed: Feed) -> Result<(), Located> {
        let Some(open) = self.nurbs.take() else { return Ok(()) };
        let order = open.order.unwrap_or(ORDER_MAX);
        let count = open.entries.len().saturating_sub(order as usize);
        let points = open.entries.get(..count).unwrap_or_default();
        if count < order as usize {
            return Err(Located::new(at.offset, Problem::NurbsPoints { points: count, order }));
        }
        if points.iter().any(|entry| entry.point.is_none()) {
            return Err(refused(&at, "as many lines of knots alone as the order P at the end"));
        }
        // As in LinuxCNC, a line leads to a NURBS that starts elsewhere.
        if let Some([work, machine]) = points.first().and_then(|entry| entry.point) {
            self.line_to(machine, feed, self.modal.path)?;
            self.work = work;
        }
        let knots = open.entries.iter().map(|entry| f64::from(entry.knot)).collect();
        self.made(order, points, knots, feed)
    }

    /// Appends the step. The machine is where the last control point is.
    fn made(&mut self, order: u32, entries: &[Entry], knots: Vec<f64>, feed: Feed) -> Result<(), Located> {
        self.modal.motion = None;
        let points: Vec<[Point; 2]> = entries.iter().filter_map(|entry| entry.point).collect();
        let (from, mode) = (self.machine, self.modal.path);
        if let Some(&[work, machine]) = points.last() {
            (self.work, self.machine) = (work, machine);
        }
        if points.iter().all(|[_, machine]| *machine == from) {
            return Ok(());
        }
        let curve = self.program.nurbs.len();
        self.step(StepKind::Nurbs(NurbsMove { from, to: self.machine, curve, feed, mode }))?;
        self.program.nurbs.push(Nurbs {
            degree: order as usize - 1,
            points_mm: points.iter().map(|[_, machine]| xyz_mm(*machine)).collect(),
            weights: entries.iter().filter_map(|entry| entry.weight).collect(),
            knots,
        });
        Ok(())
    }
}

/// Whether a line has G5.3 or G6.3.
fn is_end(block: &Block<'_>) -> bool {
    block.g(GGroup::NonModal).is_some_and(|code| matches!(code.tenths, 53 | 63))
}

fn refused(word: &Word<'_>, expected: &'static str) -> Located {
    word.problem(|found| Problem::Nurbs { found, expected })
}

fn weight(word: &Word<'_>) -> Result<f64, Located> {
    let weight = word.number.to_f64();
    if weight > 0.0 { Ok(weight) } else { Err(refused(word, "a positive weight")) }
}

fn order(word: &Word<'_>, least: i64, expected: &'static str) -> Result<u32, Located> {
    let order = word.count(least, expected)?;
    if order <= ORDER_MAX { Ok(order) } else { Err(refused(word, expected)) }
}
