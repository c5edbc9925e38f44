//! G38.2 to G38.5: a straight move that ends where the probe touches the surface, or leaves it.
//!
//! The program goes on from where the machine comes to rest, and reads where the probe tripped. A reader that knows the
//! surface and the machine's limits knows both before anything moves: the feed at the contact and the length of braking
//! behind it are those that planning makes of the move.

use motion_kernel::law::reach;
use motion_kernel::plan::{Bend, Ceiling, MachineLimits};

use super::axis::{Axes, Axis, Point, feed_length, xyz_mm};
use super::decimal::Length;
use super::error::{Located, Problem};
use super::interpreter::Interpreter;
use super::modal::{FeedMode, Motion};
use super::motion::MoveLine;
use super::program::{Feed, ProbeMove, StepKind};
use crate::touch::Surface;

/// Where the probe tripped: X to W.
const POSITION: std::ops::RangeInclusive<u32> = 5061..=5069;
/// Whether it did.
const TRIPPED: u32 = 5070;

/// A probe in the spindle, and what it touches.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// What it touches.
    pub surface: Surface,
    /// What the machine brakes with.
    pub limits: MachineLimits<f64, 3>,
}

/// What a G38 looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ProbeKind {
    /// G38.4, G38.5: where the probe leaves the surface.
    pub(super) leaves: bool,
    /// G38.3, G38.5: the program goes on without.
    pub(super) may_miss: bool,
}

impl ProbeKind {
    /// By its number in tenths.
    pub(super) fn of(tenths: i64) -> Option<Self> {
        matches!(tenths, 382..=385)
            .then_some(Self { leaves: matches!(tenths, 384 | 385), may_miss: matches!(tenths, 383 | 385) })
    }

    pub(super) fn tenths(self) -> i64 {
        382 + 2 * i64::from(self.leaves) + i64::from(self.may_miss)
    }

    pub(super) fn word(self) -> &'static str {
        match (self.leaves, self.may_miss) {
            (false, false) => "G38.2",
            (false, true) => "G38.3",
            (true, false) => "G38.4",
            (true, true) => "G38.5",
        }
    }
}

impl Probe {
    /// Where the machine is at rest after the probe tripped at `trip` on the way from `from` to `end`: braked as soon as it
    /// tripped, from the feed that it had there. At the latest that is the end. `None` where there are no such limits.
    fn rest(&self, [from, trip, end]: [Point; 3], feed: Feed) -> Option<Point> {
        let (length_mm, to_trip_mm) = (feed_length(from, end), feed_length(from, trip));
        let way_mm = [0, 1, 2].map(|axis: usize| end[axis].to_mm() - from[axis].to_mm());
        let direction = way_mm.map(|way_mm| (way_mm / length_mm).abs());
        let ceiling =
            Ceiling::new(&self.limits, feed.mm_s(), &direction, &[false; 3], &Bend::default()).ok()?;
        let at_trip_mm_s = reach(&ceiling.law, 0.0, to_trip_mm).min(ceiling.feed_mm_s);
        let share = (to_trip_mm + ceiling.law.ramp_length_mm(0.0, at_trip_mm_s)) / length_mm;
        if share >= 1.0 {
            return Some(end);
        }
        let xyz_mm = core::array::from_fn(|axis| from[axis].to_mm() + share * way_mm[axis]);
        with_xyz_mm(from, xyz_mm)
    }
}

impl Interpreter {
    /// Refuses feeds that are none per minute: LinuxCNC refuses G95, and drives at the feed of some move before after G93.
    pub(super) fn refuse_probe_feed(&self, motion: Motion, offset: usize) -> Result<(), Located> {
        if !matches!(motion, Motion::Probe(_)) || self.modal.feed_mode == FeedMode::PerMinute {
            return Ok(());
        }
        Err(Located::new(offset, Problem::ProbeFeed { motion: motion.word() }))
    }

    /// A move of G38.2 to G38.5.
    pub(super) fn probe(&mut self, line: MoveLine<'_, '_>, kind: ProbeKind) -> Result<(), Located> {
        let MoveLine { motion, feed, first, offset, .. } = line;
        let motion = motion.word();
        let refused = |problem| Located::new(offset, problem);
        let Some(probe) = self.probe.clone() else {
            return Err(refused(Problem::NeedsProbe { word: motion.to_owned() }));
        };
        if let Some(word) = line.block.axis_beside(Axes::XYZ) {
            return Err(
                word.problem(|word| Problem::Setup { word, expected: "a probing move of X, Y and Z only" })
            );
        }
        let [_, end] = self.target(line)?;
        let from = self.machine;
        let [from_mm, end_mm] = [from, end].map(xyz_mm);
        let is_touched = probe.surface.is_touched(from_mm);
        if from == end && !kind.may_miss {
            return Err(refused(Problem::ProbeStands { motion }));
        }
        let trip = if is_touched != kind.leaves {
            if !kind.may_miss {
                return Err(refused(Problem::ProbeTripped { motion, at: shown(from_mm), is_touched }));
            }
            Some(from_mm)
        } else if from == end {
            None
        } else if kind.leaves {
            probe.surface.left_at_mm(from_mm, end_mm)
        } else {
            probe.surface.touched_at_mm(from_mm, end_mm)
        };
        let beyond = || first.problem(|word| Problem::PositionOutOfRange { word });
        let trip = match trip {
            Some(trip_mm) => Some(with_xyz_mm(from, trip_mm).ok_or_else(beyond)?),
            None if kind.may_miss => None,
            None => {
                return Err(refused(Problem::ProbeMissed { motion, to: shown(end_mm), is_touched }));
            }
        };
        let to = match trip {
            None => end,
            Some(trip) if trip == from => from,
            Some(trip) => probe.rest([from, trip, end], feed).ok_or_else(beyond)?,
        };
        self.step(StepKind::Probe(ProbeMove { from, to, end, trip, leaves: kind.leaves, feed }))?;
        self.machine = to;
        self.update_work(offset)?;
        let position = self.frame.work(trip.unwrap_or(end)).ok_or(refused(Problem::WorkOutOfRange))?;
        for ((number, coordinate), axis) in POSITION.zip(position).zip(Axis::ALL) {
            let value = coordinate.to_mm();
            let value = if axis.is_rotary() { value } else { self.modal.units.of_mm(value) };
            self.parameters.set(number, value);
        }
        self.parameters.set(TRIPPED, f64::from(u8::from(trip.is_some())));
        Ok(())
    }
}

/// A point with other X, Y and Z; `None` beyond the range.
fn with_xyz_mm(mut point: Point, xyz_mm: [f64; 3]) -> Option<Point> {
    for (coordinate, mm) in point.iter_mut().zip(xyz_mm) {
        *coordinate = Length::nearest(mm)?;
    }
    Some(point)
}

/// A position in machine coordinates \[mm\], for people.
fn shown([x, y, z]: [f64; 3]) -> String {
    format!("X{x:.4} Y{y:.4} Z{z:.4}")
}
