//! Random G-code programs whose geometry is known without reading them.

use std::f64::consts::PI;
use std::fmt::Write;

use super::geometry::{Arc, Element, Move, UNITS_PER_MM, mm};
use crate::random::Random;

/// One thing a program asks for.
#[derive(Clone, Copy, Debug)]
pub enum Asked {
    Move(Move),
    Dwell(f64),
    Stop,
}

/// A program as text, and what it asks for.
#[derive(Clone, Debug)]
pub struct Generated {
    pub text: String,
    pub asked: Vec<Asked>,
}

/// Programs stay within this cube \[mm\].
const REACH_MM: f64 = 7900.0;
const PLANES: [([usize; 3], &str, [char; 2]); 3] =
    [([0, 1, 2], "G17", ['I', 'J']), ([2, 0, 1], "G18", ['K', 'I']), ([1, 2, 0], "G19", ['J', 'K'])];

struct Writer<'a> {
    random: &'a mut Random,
    program: Generated,
    at: [i64; 3],
    feed_mm_min: f64,
    is_rapid: bool,
    is_incremental: bool,
    motion: &'static str,
    plane: usize,
    /// Direction at the end of the last move.
    heading: [f64; 3],
    longest_mm: f64,
    /// No move is programmed to take longer than this \[s\].
    move_s: f64,
}

/// A program of `fragments` groups of moves for a machine whose greatest feed is `feed_max_mm_s`.
pub fn generate(random: &mut Random, fragments: usize, feed_max_mm_s: f64) -> Generated {
    let move_s = random.log(0.02, 3.0);
    let mut writer = Writer {
        program: Generated { text: "G17 G21 G90 G61\n".to_owned(), asked: Vec::new() },
        at: [0; 3],
        feed_mm_min: 1000.0,
        is_rapid: false,
        is_incremental: false,
        motion: "",
        plane: 0,
        heading: [1.0, 0.0, 0.0],
        longest_mm: (move_s * feed_max_mm_s).min(4000.0),
        move_s,
        random,
    };
    for _ in 0..fragments {
        writer.fragment();
    }
    writer.program.text.push_str("M2\n");
    writer.program
}

/// A program of lines from the origin through `points`, at one feed.
pub fn lines(points: &[[i64; 3]], feed_mm_min: f64) -> Generated {
    let mut program = Generated { text: format!("G61 F{feed_mm_min}\n"), asked: Vec::new() };
    let mut from = [0; 3];
    for &to in points {
        let [x, y, z] = to.map(decimal);
        let _ = writeln!(program.text, "G1 X{x} Y{y} Z{z}");
        program.asked.push(Asked::Move(Move { from, to, arc: None, feed_mm_min }));
        from = to;
    }
    program
}

impl Writer<'_> {
    fn fragment(&mut self) {
        if self.random.chance(0.7) {
            self.feed_mm_min = self.random.log(0.1, 1e5);
        }
        self.is_rapid = self.random.chance(0.15);
        if self.random.chance(0.1) {
            self.is_incremental = !self.is_incremental;
            let word = if self.is_incremental { "G91\n" } else { "G90\n" };
            self.program.text.push_str(word);
        }
        match self.random.below(10) {
            0 | 1 => {
                let direction = self.direction();
                let length_mm = self.length(1e-3);
                self.line(direction, length_mm);
            }
            2 => self.circle(),
            3..=5 => self.tangent_chain(),
            6 => self.polyline(),
            7 => self.equal_parts(),
            8 => {
                for _ in 0..self.random.below(12) {
                    let direction = self.direction();
                    let length_mm = self.random.log(1e-3, 2.0);
                    self.line(direction, length_mm);
                }
            }
            _ if self.random.chance(0.5) => {
                let text = format!("{:.6}", self.random.log(1e-5, 0.3));
                let _ = writeln!(self.program.text, "G4 P{text}");
                self.program.asked.push(Asked::Dwell(text.parse().expect("a number")));
            }
            _ => {
                self.program.text.push_str(if self.random.chance(0.5) { "M0\n" } else { "M1\n" });
                self.program.asked.push(Asked::Stop);
            }
        }
    }

    fn length(&mut self, least_mm: f64) -> f64 {
        self.random.log(least_mm, self.longest_mm)
    }

    fn direction(&mut self) -> [f64; 3] {
        if self.random.chance(0.3) {
            let mut along = [0.0; 3];
            along[self.random.below(3)] = self.random.sign();
            return along;
        }
        self.random.direction()
    }

    /// Where `length_mm` along `direction` ends; turned back where it would leave the reach.
    fn end_of(&self, direction: [f64; 3], length_mm: f64) -> [i64; 3] {
        core::array::from_fn(|axis| {
            let step = (direction[axis] * length_mm * UNITS_PER_MM).round() as i64;
            let end = self.at[axis] + step;
            if mm(end).abs() > REACH_MM { self.at[axis] - step } else { end }
        })
    }

    fn line(&mut self, direction: [f64; 3], length_mm: f64) {
        let to = self.end_of(direction, length_mm);
        self.step(to, None);
    }

    /// An arc about the point `radius_mm` from here along `inward`, in the plane, to an angle further on.
    fn arc(&mut self, radius_mm: f64, inward: [f64; 2], sweep_rad: f64, is_clockwise: bool, rise_mm: f64) {
        let axes = PLANES[self.plane].0;
        let offset = inward.map(|c| (c * radius_mm * UNITS_PER_MM).round() as i64);
        let (sine, cosine) = (if is_clockwise { -sweep_rad } else { sweep_rad }).sin_cos();
        let start = offset.map(|c| -(c as f64));
        let end = [cosine * start[0] - sine * start[1], sine * start[0] + cosine * start[1]];
        let mut to = self.at;
        for (index, axis) in [axes[0], axes[1]].into_iter().enumerate() {
            to[axis] += offset[index];
            if sweep_rad < 2.0 * PI {
                to[axis] += end[index].round() as i64;
            } else {
                to[axis] = self.at[axis];
            }
        }
        to[axes[2]] += (rise_mm * UNITS_PER_MM).round() as i64;
        let moved = to != self.at || sweep_rad >= 2.0 * PI;
        if moved && to.iter().all(|&c| mm(c).abs() <= REACH_MM) {
            self.step(to, Some(Arc { axes, offset, is_clockwise }));
        }
    }

    fn circle(&mut self) {
        self.plane = self.random.below(3);
        let radius_mm = self.random.log(2e-3, 0.4 * self.longest_mm);
        let angle = self.random.between(0.0, 2.0 * PI);
        let sweep = if self.random.chance(0.3) { 2.0 * PI } else { self.random.between(0.01, 6.2) };
        let rise = if self.random.chance(0.5) { radius_mm * self.random.between(-3.0, 3.0) } else { 0.0 };
        let is_clockwise = self.random.chance(0.5);
        self.arc(radius_mm, [angle.cos(), angle.sin()], sweep, is_clockwise, rise);
    }

    /// Lines and arcs that go on in the direction in which the last move ended.
    fn tangent_chain(&mut self) {
        self.plane = self.random.below(3);
        let [first, second, normal] = PLANES[self.plane].0;
        for _ in 0..=self.random.below(6) {
            let planar = self.heading[first].hypot(self.heading[second]);
            let (mut x, mut y) = (self.heading[first] / planar, self.heading[second] / planar);
            if planar.is_nan() || planar < 0.5 || self.heading[normal].abs() > 1e-12 {
                (y, x) = self.random.between(0.0, 2.0 * PI).sin_cos();
            }
            if self.random.chance(0.4) {
                let mut direction = [0.0; 3];
                (direction[first], direction[second]) = (x, y);
                let length_mm = self.length(1e-2);
                self.line(direction, length_mm);
            } else {
                let radius_mm = self.random.log(1e-2, 0.4 * self.longest_mm);
                let sweep = self.random.log(0.02, 5.0);
                let is_clockwise = self.random.chance(0.5);
                let inward = if is_clockwise { [y, -x] } else { [-y, x] };
                self.arc(radius_mm, inward, sweep, is_clockwise, 0.0);
            }
            if self.random.chance(0.2) {
                self.feed_mm_min = self.random.log(10.0, 1e5);
            }
        }
    }

    /// Many short lines with small angles between them.
    fn polyline(&mut self) {
        let mut direction = self.random.direction();
        let length_mm = self.random.log(1e-3, 2.0);
        let angle = self.random.log(1e-7, 2e-2);
        let is_even = self.random.chance(0.5);
        for _ in 0..10 + self.random.below(100) {
            let aside = self.random.direction();
            let bent: [f64; 3] = core::array::from_fn(|axis| direction[axis] + angle * aside[axis]);
            let size = bent.iter().map(|c| c * c).sum::<f64>().sqrt();
            direction = bent.map(|c| c / size);
            let share = if is_even { 1.0 } else { self.random.log(0.1, 1.0) };
            self.line(direction, length_mm * share);
        }
    }

    /// A line in equal parts, exactly.
    fn equal_parts(&mut self) {
        let direction = self.direction();
        let length_mm = self.random.log(1e-3, 1.0);
        let parts = 2 + self.random.below(80) as i64;
        let to = self.end_of(direction, length_mm);
        let step: [i64; 3] = core::array::from_fn(|axis| to[axis] - self.at[axis]);
        for _ in 0..parts {
            let next: [i64; 3] = core::array::from_fn(|axis| self.at[axis] + step[axis]);
            if next.iter().all(|&c| mm(c).abs() <= REACH_MM) {
                self.step(next, None);
            }
        }
    }

    /// Writes a move.
    fn step(&mut self, to: [i64; 3], arc: Option<Arc>) {
        let mut step = Move { from: self.at, to, arc, feed_mm_min: f64::INFINITY };
        let word = match arc {
            None if to == self.at => return,
            None if self.is_rapid => "G0",
            None => "G1",
            Some(arc) if arc.is_clockwise => "G2",
            Some(_) => "G3",
        };
        let element = Element::new(&step);
        let text = &mut self.program.text;
        if arc.is_some() {
            let _ = write!(text, "{} ", PLANES[self.plane].1);
        }
        if word != self.motion || self.random.chance(0.3) {
            text.push_str(word);
            self.motion = word;
        }
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if to[axis] != self.at[axis] || (arc.is_some() && axis == PLANES[self.plane].0[0]) {
                let value = if self.is_incremental { to[axis] - self.at[axis] } else { to[axis] };
                let _ = write!(text, " {letter}{}", decimal(value));
            }
        }
        if let Some(arc) = arc {
            for (letter, offset) in PLANES[self.plane].2.into_iter().zip(arc.offset) {
                let _ = write!(text, " {letter}{}", decimal(offset));
            }
        }
        if word != "G0" {
            let feed = format!("{:.4}", self.feed_mm_min.max(element.length_mm * 60.0 / self.move_s));
            let _ = write!(text, " F{feed}");
            step.feed_mm_min = feed.parse().expect("a number");
        }
        text.push('\n');
        self.heading = element.at(element.length_mm).tangent;
        self.at = to;
        self.program.asked.push(Asked::Move(step));
    }
}

/// The exact decimal of a number of units.
fn decimal(units: i64) -> String {
    let size = units.unsigned_abs();
    let sign = if units < 0 { "-" } else { "" };
    format!("{sign}{}.{:010}", size / 10_000_000_000, size % 10_000_000_000)
}
