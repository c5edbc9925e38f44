//! The programmed path: moves as they stand in the text, in exact decimals, and their points by arc length.

use std::f64::consts::PI;

pub type Vector = [f64; 3];

/// Units of 10⁻¹⁰ mm, the last decimal a program may have.
pub const UNITS_PER_MM: f64 = 1e10;

pub fn mm(units: i64) -> f64 {
    units as f64 / UNITS_PER_MM
}

pub fn norm(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The steps of 2⁻³² mm nearest to a number of units.
pub fn position_bits(units: i64) -> i64 {
    let scaled = i128::from(units) << 33;
    ((scaled / 10_000_000_000 + scaled.signum()) / 2) as i64
}

/// A move of a program.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    pub from: [i64; 3],
    pub to: [i64; 3],
    /// None for a line.
    pub arc: Option<Arc>,
    /// Programmed feed \[mm/min\]; infinite for a rapid.
    pub feed_mm_min: f64,
}

/// What makes a move an arc or a helix.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    /// First and second axis of the plane, and its normal; right-handed.
    pub axes: [usize; 3],
    /// Centre minus start, along the first and second axis.
    pub offset: [i64; 2],
    pub is_clockwise: bool,
}

/// A point of the path and its derivatives by arc length.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    pub at: Vector,
    pub tangent: Vector,
    pub second: Vector,
    pub third: Vector,
    /// Magnitudes of the three derivatives, of a polynomial of the terms that they are sums of.
    pub sizes: [f64; 3],
}

/// A move made ready to be evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    pub length_mm: f64,
    from: Vector,
    /// Radius, 0 for a line, and what it grows by until the end (the rounding of the programmed end).
    pub radius_mm: f64,
    grows_mm: f64,
    sweep_rad: f64,
    outward: Vector,
    onward: Vector,
    /// Of a line the direction, of an arc the rise.
    axial: Vector,
    /// Of a polynomial, per axis those of u, u², …, as parts of the length.
    coefficients: Option<[[f64; 7]; 3]>,
}

impl Element {
    /// A line as compiled.
    pub fn line(from: Vector, direction: Vector, length_mm: f64) -> Self {
        Self {
            length_mm,
            from,
            radius_mm: 0.0,
            grows_mm: 0.0,
            sweep_rad: 0.0,
            outward: [0.0; 3],
            onward: [0.0; 3],
            axial: direction,
            coefficients: None,
        }
    }

    /// A curve as compiled. It has no radius of its own.
    pub fn polynomial(from: Vector, coefficients: [[f64; 7]; 3], length_mm: f64) -> Self {
        let line = Self::line(from, [0.0; 3], length_mm);
        Self { radius_mm: f64::INFINITY, coefficients: Some(coefficients), ..line }
    }

    pub fn new(step: &Move) -> Self {
        let from = step.from.map(mm);
        let whole: Vector = core::array::from_fn(|axis| mm(step.to[axis] - step.from[axis]));
        let Some(arc) = step.arc else {
            let length_mm = norm(whole);
            return Self::line(from, whole.map(|c| c / length_mm), length_mm);
        };
        let [first, second, normal] = arc.axes;
        let start = arc.offset.map(|units| -units);
        let end =
            [start[0] + step.to[first] - step.from[first], start[1] + step.to[second] - step.from[second]];
        let product = |a: i64, b: i64| i128::from(a) * i128::from(b);
        let cross = product(start[0], end[1]) - product(start[1], end[0]);
        let inner = product(start[0], end[0]) + product(start[1], end[1]);
        let mut sweep_rad = (cross as f64).atan2(inner as f64);
        if arc.is_clockwise {
            sweep_rad = -sweep_rad;
        }
        if sweep_rad <= 0.0 {
            sweep_rad += 2.0 * PI;
        }
        let radius_mm = mm(start[0]).hypot(mm(start[1]));
        let mut outward = [0.0; 3];
        (outward[first], outward[second]) = (mm(start[0]) / radius_mm, mm(start[1]) / radius_mm);
        let turn = if arc.is_clockwise { -1.0 } else { 1.0 };
        let mut onward = [0.0; 3];
        (onward[first], onward[second]) = (-turn * outward[second], turn * outward[first]);
        let length_mm = (radius_mm * sweep_rad).hypot(whole[normal]);
        let mut axial = [0.0; 3];
        axial[normal] = whole[normal] / length_mm;
        let grows_mm = mm(end[0]).hypot(mm(end[1])) - radius_mm;
        Self { radius_mm, grows_mm, sweep_rad, outward, onward, ..Self::line(from, axial, length_mm) }
    }

    /// By how much an arc leans outwards because its ends differ in radius.
    pub fn slant_rad(&self) -> f64 {
        if self.radius_mm * self.sweep_rad > 0.0 {
            self.grows_mm.abs() / (self.radius_mm * self.sweep_rad)
        } else {
            0.0
        }
    }

    /// `s_mm` from its start.
    pub fn at(&self, s_mm: f64) -> PathPoint {
        let still = [0.0; 3];
        if let Some(coefficients) = &self.coefficients {
            return self.on_polynomial(coefficients, s_mm / self.length_mm);
        }
        if self.radius_mm <= 0.0 {
            let at = core::array::from_fn(|axis| self.from[axis] + self.axial[axis] * s_mm);
            let sizes = [1.0, 0.0, 0.0];
            return PathPoint { at, tangent: self.axial, second: still, third: still, sizes };
        }
        let part = s_mm / self.length_mm;
        let (sine, cosine) = (self.sweep_rad * part).sin_cos();
        let half = (0.5 * self.sweep_rad * part).sin();
        let turn = self.sweep_rad / self.length_mm;
        let planar = self.radius_mm * turn;
        let mut point =
            PathPoint { at: self.from, tangent: still, second: still, third: still, sizes: [1.0; 3] };
        for axis in 0..3 {
            let (o, n) = (self.outward[axis], self.onward[axis]);
            let (here, ahead) = (o * cosine + n * sine, n * cosine - o * sine);
            point.at[axis] += self.radius_mm * (n * sine - 2.0 * o * half * half)
                + here * self.grows_mm * part
                + self.axial[axis] * s_mm;
            point.tangent[axis] = planar * ahead + self.axial[axis];
            point.second[axis] = -planar * turn * here;
            point.third[axis] = -planar * turn * turn * ahead;
        }
        point.sizes = [1.0, norm(point.second), norm(point.third)];
        point
    }

    fn on_polynomial(&self, coefficients: &[[f64; 7]; 3], u: f64) -> PathPoint {
        let mut derived = [self.from, [0.0; 3], [0.0; 3], [0.0; 3]];
        let mut sizes = [0.0; 4];
        for (order, (derived, size)) in derived.iter_mut().zip(&mut sizes).enumerate() {
            let scale = self.length_mm.powi(1 - order as i32);
            for (axis, coefficients) in coefficients.iter().enumerate() {
                let mut terms = 0.0;
                for (index, &c) in coefficients.iter().enumerate().skip(order.max(1) - 1) {
                    let power = index + 1;
                    let factor: f64 = (power + 1 - order..=power).map(|k| k as f64).product();
                    let term = c * factor * scale * u.powi((power - order) as i32);
                    derived[axis] += term;
                    terms += term.abs();
                }
                *size = f64::max(*size, terms);
            }
        }
        let [at, tangent, second, third] = derived;
        let [_, sizes @ ..] = sizes;
        PathPoint { at, tangent, second, third, sizes: [sizes[0].max(1.0), sizes[1], sizes[2]] }
    }
}

/// Angle between the directions at a junction \[rad\], and the step of the curvature vector \[1/mm\].
pub fn junction(before: &Element, after: &Element) -> (f64, f64) {
    let (end, start) = (before.at(before.length_mm), after.at(0.0));
    let chord = norm(minus(end.tangent, start.tangent));
    (2.0 * (0.5 * chord).min(1.0).asin(), norm(minus(end.second, start.second)))
}
