//! The evenness of the feed that a control gets from a curve over a parameter.
//!
//! Every tick has to find the parameter at which the path is F·τ longer, S2 (4). Common methods are a Taylor
//! series of the parameter, of first or second order, and a polynomial of degree seven for the parameter over
//! arc length, fitted span by span (the feed-correction polynomial), after which a Newton step may set the
//! chord right. Septic pieces need none of it: they are over arc length already, and their error is how far
//! |r'| is from 1.

use super::Course;
use crate::toolpath::curve::Curve;
use crate::toolpath::septic::between;
use crate::toolpath::{Vector, dot, norm, scale, septics, subtract};

/// How many ways there are.
pub const WAYS: usize = 5;

/// A method of walking a curve, and how well it keeps the feed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluator {
    /// The evaluator's name.
    pub name: &'static str,
    /// Greatest relative error of a tick's travel.
    pub feed_error: f64,
}

/// The errors of all ways over a path of polynomials, at a feed \[mm/s\] and a tick \[s\]. Each span is
/// walked from its start.
#[must_use]
pub fn evaluators(course: &Course, feed_mm_s: f64, tick_s: f64) -> [Evaluator; WAYS] {
    let travel_mm = feed_mm_s * tick_s;
    let mut errors = [0.0_f64; WAYS];
    for element in course.elements() {
        let Some((curve, end)) = element.curve() else { continue };
        let length_mm = curve.length(0.0, end);
        let correction = feed_correction(curve, end, length_mm);
        let walks: [&dyn Fn(u64, f64) -> f64; WAYS - 1] = [
            &|_, u| u + travel_mm / norm(curve.derivatives(u)[0]),
            &|_, u| {
                // u' = 1/σ and u'' = −(r'·r'')/σ⁴ by arc length.
                let [d1, d2, _] = curve.derivatives(u);
                let speed = norm(d1);
                u + travel_mm / speed - 0.5 * travel_mm * travel_mm * dot(d1, d2) / speed.powi(4)
            },
            &|tick, _| end * polynomial(&correction, travel_mm * tick as f64 / length_mm),
            &|tick, u| {
                let near = end * polynomial(&correction, travel_mm * tick as f64 / length_mm);
                near - (norm(curve.offset(u, near)) - travel_mm) / norm(curve.derivatives(near)[0])
            },
        ];
        for (error, walk) in errors.iter_mut().zip(walks) {
            *error = error.max(walked(curve, end, travel_mm, length_mm, walk));
        }
        let pieces = septics::<f32, _>(element).unwrap_or_default();
        errors[WAYS - 1] =
            pieces.iter().map(|piece| piece.deviation.bound().feed).fold(errors[WAYS - 1], f64::max);
    }
    let names = [
        "Taylor series, first order",
        "Taylor series, second order",
        "feed-correction polynomial",
        "the same and a Newton step",
        "septic pieces",
    ];
    core::array::from_fn(|index| Evaluator { name: names[index], feed_error: errors[index] })
}

/// The greatest relative error of a tick's travel, over all whole ticks.
fn walked(
    curve: &dyn Curve,
    end: f64,
    travel_mm: f64,
    length_mm: f64,
    next: &dyn Fn(u64, f64) -> f64,
) -> f64 {
    let (mut u, mut greatest) = (0.0, 0.0_f64);
    for tick in 1..=(length_mm / travel_mm) as u64 {
        let after = next(tick, u);
        // The series may run a little past the end in its last tick.
        if after > end {
            break;
        }
        greatest = greatest.max((curve.length(u, after) / travel_mm - 1.0).abs());
        u = after;
    }
    greatest
}

/// u/end over s/length: a septic with the right value and three right derivatives at both ends.
fn feed_correction(curve: &dyn Curve, end: f64, length_mm: f64) -> [f64; 7] {
    let derivatives = |u: f64| {
        let [d1, d2, d3]: [Vector; 3] = curve.derivatives(u);
        let speed = norm(d1);
        let tangent = scale(d1, 1.0 / speed);
        let s2 = dot(tangent, d2);
        let across = subtract(d2, scale(tangent, s2));
        let s3 = dot(tangent, d3) + dot(across, across) / speed;
        // The inverse function's derivatives.
        [
            length_mm / (speed * end),
            -s2 * length_mm.powi(2) / (speed.powi(3) * end),
            (3.0 * s2 * s2 - speed * s3) * length_mm.powi(3) / (speed.powi(5) * end),
        ]
    };
    between(1.0, derivatives(0.0), derivatives(end))
}

fn polynomial(coefficients: &[f64; 7], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| (sum + c) * x)
}
