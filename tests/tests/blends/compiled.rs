//! The pieces of a plan, evaluated here: how they join, and how far they are from the programmed path.

use motion_host::planning::{Executable, Plan};
use motion_host::toolpath::septic::Septic;
use motion_kernel::program::Item;
use motion_kernel::units::Position;

use super::asked::Asked;
use super::{Vector, minus, norm};

/// A piece as the kernel gets it: derivatives by arc length are computed here.
pub(super) struct Compiled {
    start: Vector,
    length: f64,
    /// Of u = s/length, per axis, as parts of the length; the first is the tangent.
    coefficients: [[f64; 7]; 3],
}

impl Compiled {
    /// Of an element that starts at the origin.
    pub(super) fn of(septic: &Septic) -> Self {
        let coefficients = septic.coefficients.map(|axis| axis.map(|mm| mm / septic.length_mm));
        Self { start: septic.start, length: septic.length_mm, coefficients }
    }

    /// Position and its first four derivatives by arc length.
    pub(super) fn at(&self, u: f64) -> [Vector; 5] {
        let mut found = [[0.0; 3]; 5];
        for axis in 0..3 {
            for (index, &c) in self.coefficients[axis].iter().enumerate() {
                let mut factor = c * self.length;
                for (order, found) in found.iter_mut().enumerate() {
                    let power = index as i32 + 1 - order as i32;
                    if power >= 0 {
                        found[axis] += factor * u.powi(power) / self.length.powi(order as i32);
                    }
                    factor *= f64::from(power);
                }
            }
            found[0][axis] += self.start[axis];
        }
        found
    }
}

/// The pieces of every stretch.
pub(super) fn compiled(plan: &Plan) -> Vec<Vec<Compiled>> {
    let mut stretches = vec![Vec::new()];
    for item in Executable::new::<f64>(plan).expect("planned").items {
        let (start, length, coefficients) = match item {
            Item::Line { start, direction, length, .. } => {
                (start, length, direction.map(|d| [d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
            }
            Item::Septic { start, coefficients, length, .. } => (start, length, coefficients),
            Item::EndOfStretch(_) => {
                stretches.push(Vec::new());
                continue;
            }
            _ => continue,
        };
        let piece = Compiled { start: start.map(Position::to_mm), length: length.to_mm(), coefficients };
        stretches.last_mut().expect("one").push(piece);
    }
    stretches.retain(|stretch| !stretch.is_empty());
    stretches
}

/// Nothing up to the derivative of that order steps within a stretch, three of them at most: gaps [mm], and steps of the first
/// three derivatives, made numbers by the length of the shorter piece.
pub(super) fn continuous(stretches: &[Vec<Compiled>], order: usize) -> Result<(), String> {
    for pair in stretches.iter().flat_map(|pieces| pieces.windows(2)) {
        let (end, start) = (pair[0].at(1.0), pair[1].at(0.0));
        let shorter = pair[0].length.min(pair[1].length);
        let step = |order: usize| norm(minus(end[order], start[order]));
        let steps = [step(0), step(1), step(2) * shorter, step(3) * shorter * shorter];
        // Coordinates are rounded to 2⁻³² mm and lines have their direction from them.
        let rounding = 2e-9 + 4e-10 / shorter;
        let limits = [2e-9, rounding, rounding, 10.0 * rounding];
        if !steps.iter().zip(limits).take(order + 1).all(|(&step, limit)| step <= limit) {
            return Err(format!(
                "steps {steps:?} between pieces of {} and {} mm",
                pair[0].length, pair[1].length
            ));
        }
    }
    Ok(())
}

/// The greatest distance of the pieces from the path, and of the path from the pieces, over the tolerance.
pub(super) fn distance(asked: &[Asked], stretches: &[Vec<Compiled>], tolerance: f64, samples: usize) -> f64 {
    let mut driven: Vec<Vector> = Vec::new();
    let mut worst = 0.0_f64;
    for piece in stretches.iter().flatten() {
        // Chords between the samples cut off at most a two-thousandth of the tolerance.
        let curvature = (0..=8).map(|part| norm(piece.at(f64::from(part) / 8.0)[2])).fold(0.0, f64::max);
        let samples = samples.max((piece.length * (curvature * 250.0 / tolerance).sqrt()).ceil() as usize);
        for part in 0..=samples {
            let [point, ..] = piece.at(part as f64 / samples as f64);
            let nearest = asked.iter().map(|step| step.distance(point)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest);
            driven.push(point);
        }
    }
    let chords: Vec<Asked> = driven
        .windows(2)
        .filter(|pair| norm(minus(pair[0], pair[1])) > 0.0)
        .map(|pair| Asked::Line { from: pair[0], to: pair[1] })
        .collect();
    for step in asked {
        // Near the ends, where blends are, most of all.
        for part in 0..=40 {
            let part = f64::from(part) / 40.0;
            let part = part * part * (3.0 - 2.0 * part);
            let point = step.at(part);
            let nearest = chords.iter().map(|chord| chord.distance(point)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest);
        }
    }
    worst / tolerance
}
