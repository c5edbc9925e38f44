//! The programmed path as a whole: stretches between full stops, found from the geometry alone.

use super::geometry::{Element, PathPoint, junction, position_bits};
use super::program::{Asked, Generated};
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Item as PlanItem, Plan};
use motion_host::toolpath::smooth::TANGENT_ROUNDING_RAD;
use motion_kernel::program::Item;
use motion_kernel::units::Position;

/// A move on its stretch.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    pub element: Element,
    /// From the stretch's start \[mm\].
    pub start_mm: f64,
    pub feed_mm_s: f64,
    /// Index of the move, and so of the plan's block.
    pub block: usize,
    /// Angle \[rad\] and step of curvature [1/mm] at its start, if the motion does not stop there.
    pub junction: Option<(f64, f64)>,
}

/// From full stop to full stop.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    pub moves: Vec<Placed>,
    pub length_mm: f64,
    /// Exact end, in steps of 2⁻³² mm.
    pub end_bits: [i64; 3],
}

#[derive(Clone, Debug, Default)]
pub struct Path {
    pub stretches: Vec<Stretch>,
    pub dwell_s: f64,
    pub dwells: u64,
    pub stops: u64,
    /// A junction's angle is so close to the machine's that rounding decides whether it stops there.
    pub is_ambiguous: bool,
}

impl Path {
    pub fn new(program: &Generated, machine: &Machine) -> Self {
        let mut path = Self::default();
        let mut open = Stretch::default();
        let mut block = 0;
        for asked in &program.asked {
            let step = match asked {
                Asked::Move(step) => step,
                Asked::Dwell(seconds) => {
                    path.close(&mut open);
                    path.dwell_s += seconds;
                    path.dwells += 1;
                    continue;
                }
                Asked::Stop => {
                    path.close(&mut open);
                    path.stops += 1;
                    continue;
                }
            };
            let element = Element::new(step);
            let mut passed = None;
            if let Some(last) = open.moves.last() {
                let (angle_rad, bend) = junction(&last.element, &element);
                // What is less is no angle to any machine.
                let limit_rad = machine.path.junction_angle_rad.max(TANGENT_ROUNDING_RAD);
                // An arc's ends differ in radius by rounding; the direction at its end depends on where that is put.
                let slant_rad = last.element.slant_rad() + element.slant_rad();
                let is_close = (angle_rad - limit_rad).abs() <= 1e-6 * limit_rad + 1e-9 + slant_rad;
                path.is_ambiguous |= is_close;
                if angle_rad > limit_rad {
                    path.close(&mut open);
                } else {
                    passed = Some((angle_rad, bend));
                }
            }
            open.moves.push(Placed {
                element,
                start_mm: open.length_mm,
                feed_mm_s: step.feed_mm_min / 60.0,
                block,
                junction: passed,
            });
            open.length_mm += element.length_mm;
            open.end_bits = step.to.map(position_bits);
            block += 1;
        }
        path.close(&mut open);
        path
    }

    /// The path of a plan as compiled, where what is programmed is not what is driven: with blends. Those are held
    /// against the program elsewhere.
    pub fn compiled(plan: &Plan, executable: &Executable) -> Self {
        let mut path = Self::default();
        let mut items = executable.items.iter();
        let mut first = 0;
        for item in &plan.items {
            let stretch = match item {
                PlanItem::Stretch(stretch) => stretch,
                PlanItem::Dwell { seconds, .. } => {
                    path.dwell_s += seconds;
                    path.dwells += 1;
                    continue;
                }
                PlanItem::Switch { .. } => continue,
                PlanItem::Stop { .. } => {
                    path.stops += 1;
                    continue;
                }
            };
            let mut open = Stretch::default();
            let ends: Vec<f64> = (stretch.blocks.iter())
                .scan(0.0, |end, block| {
                    *end += block.element.length_mm();
                    Some(*end)
                })
                .collect();
            let mut last = None;
            for item in items.by_ref() {
                let element = match *item {
                    Item::Line { start, direction, length, .. } => {
                        Element::line(start.map(Position::to_mm), direction, length.to_mm())
                    }
                    Item::Septic { start, coefficients, length, .. } => {
                        Element::polynomial(start.map(Position::to_mm), coefficients, length.to_mm())
                    }
                    Item::EndOfStretch(end) => {
                        open.end_bits = end.map(Position::to_bits);
                        break;
                    }
                    _ => continue,
                };
                let middle_mm = open.length_mm + 0.5 * element.length_mm;
                let block = ends.partition_point(|&end| end < middle_mm).min(ends.len() - 1);
                // Within a block pieces join as the curve does.
                let passed = (open.moves.last()).filter(|_| last != Some(block));
                let junction = passed.map(|before: &Placed| junction(&before.element, &element));
                last = Some(block);
                open.moves.push(Placed {
                    element,
                    start_mm: open.length_mm,
                    feed_mm_s: stretch.blocks[block].feed_mm_s,
                    block: first + block,
                    junction,
                });
                open.length_mm += element.length_mm;
            }
            first += stretch.blocks.len();
            path.stretches.push(open);
        }
        path
    }

    fn close(&mut self, open: &mut Stretch) {
        let end_bits = open.end_bits;
        if !open.moves.is_empty() {
            self.stretches.push(std::mem::take(open));
            open.end_bits = end_bits;
        }
    }

    pub fn length_mm(&self) -> f64 {
        self.stretches.iter().map(|stretch| stretch.length_mm).sum()
    }
}

/// Walks a path forward.
#[derive(Clone, Debug)]
pub struct Cursor<'a> {
    path: &'a Path,
    stretch: usize,
    index: usize,
    /// Length of the stretches before.
    pub before_mm: f64,
}

impl<'a> Cursor<'a> {
    pub fn new(path: &'a Path) -> Self {
        Self { path, stretch: 0, index: 0, before_mm: 0.0 }
    }

    /// The move that contains `s_mm` of a stretch; none after the last stretch.
    pub fn seek(&mut self, stretch: usize, s_mm: f64) -> Option<&'a Placed> {
        while self.stretch < stretch {
            self.before_mm += self.path.stretches.get(self.stretch)?.length_mm;
            self.stretch += 1;
            self.index = 0;
        }
        let moves = &self.path.stretches.get(stretch)?.moves;
        while moves.get(self.index + 1).is_some_and(|next| next.start_mm <= s_mm) {
            self.index += 1;
        }
        moves.get(self.index)
    }

    /// The move found last and what lies around it on the stretch.
    pub fn neighbours(&self) -> &'a [Placed] {
        let moves = self.path.stretches.get(self.stretch).map_or(&[][..], |stretch| &stretch.moves);
        let from = self.index.saturating_sub(20).min(moves.len());
        &moves[from..(self.index + 2).min(moves.len())]
    }

    /// The moves that contain `s_mm` but for rounding: the one found last, and at a junction others.
    pub fn near(&self, s_mm: f64, rounding_mm: f64) -> impl Iterator<Item = &'a Placed> {
        let holds = move |placed: &Placed, margin_mm: f64| {
            let local_mm = s_mm - placed.start_mm;
            local_mm >= -margin_mm && local_mm <= placed.element.length_mm + margin_mm
        };
        let around = self.neighbours();
        let inside = around.iter().rev().take(2).position(|placed| holds(placed, -rounding_mm));
        let around = match inside {
            Some(from_end) => &around[around.len() - 1 - from_end..around.len() - from_end],
            None => around,
        };
        around.iter().filter(move |placed| holds(placed, rounding_mm))
    }
}

impl Placed {
    pub fn at(&self, s_mm: f64) -> PathPoint {
        self.element.at(s_mm - self.start_mm)
    }
}
