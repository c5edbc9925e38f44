//! A path that is run through at constant feed: what every axis does, tick by tick.

use crate::toolpath::curve::{Curve, by_arc_length};
use crate::toolpath::{Element, Vector, add, norm, scale, subtract};

/// Newton steps to a path position; quadratic from less than a tenth of the part off.
const NEWTON_STEPS: u32 = 8;

/// Curves, one after the other.
#[derive(Clone, Debug)]
pub struct Course {
    /// The curve.
    pub name: &'static str,
    elements: Vec<Element>,
    /// Path position of every end \[mm\].
    ends_mm: Vec<f64>,
}

/// Point, tangent, and second and third derivative by arc length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local {
    /// The point \[mm\].
    pub point: Vector,
    /// First derivative, a unit vector.
    pub tangent: Vector,
    /// Second derivative \[1/mm\].
    pub second: Vector,
    /// Third derivative \[1/mm²\].
    pub third: Vector,
}

/// The steps of the axes at a junction at constant feed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JunctionStep {
    /// The time when it is passed \[s\].
    pub time_s: f64,
    /// Step of the acceleration of every axis \[mm/s²\].
    pub accel_mm_s2: Vector,
    /// Step of the jerk of every axis, where it is one: at a step of acceleration there is none to be
    /// had \[mm/s³\].
    pub jerk_mm_s3: Vector,
}

/// Velocity, acceleration and jerk of every axis, tick by tick. Accelerations and jerks are differences over
/// ticks, S2 (7): the first acceleration is that of tick 1, the first jerk that of tick 2.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisTicks {
    /// The control tick τ \[s\].
    pub tick_s: f64,
    /// V at 0, τ, 2τ, … \[mm/s\].
    pub velocity_mm_s: Vec<Vector>,
    /// A at τ, 2τ, … \[mm/s²\].
    pub accel_mm_s2: Vec<Vector>,
    /// J at 2τ, 3τ, … \[mm/s³\].
    pub jerk_mm_s3: Vec<Vector>,
}

impl Course {
    /// A course of arcs and polynomials, each of which starts where the one before ends. Lines are left out.
    #[must_use]
    pub fn new(name: &'static str, elements: impl IntoIterator<Item = Element>) -> Self {
        let elements: Vec<Element> =
            elements.into_iter().filter(|element| element.curve().is_some()).collect();
        let mut end_mm = 0.0;
        let ends_mm = elements
            .iter()
            .map(|element| {
                end_mm += element.length_mm();
                end_mm
            })
            .collect();
        Self { name, elements, ends_mm }
    }

    /// The course's length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.ends_mm.last().copied().unwrap_or(0.0)
    }

    /// The course's curves.
    #[must_use]
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Path positions where one curve ends and the next begins \[mm\].
    #[must_use]
    pub fn junctions_mm(&self) -> &[f64] {
        &self.ends_mm[..self.ends_mm.len().saturating_sub(1)]
    }

    /// The motion at `s_mm` of the path; at a junction, that of the curve that begins there.
    #[must_use]
    pub fn at(&self, s_mm: f64) -> Option<Local> {
        let index = self.junctions_mm().partition_point(|&end_mm| end_mm <= s_mm);
        let element = self.elements.get(index)?;
        let start_mm = index.checked_sub(1).map_or(0.0, |before| self.ends_mm[before]);
        let (curve, end) = element.curve()?;
        let parameter = parameter_at(curve, end, s_mm - start_mm, self.ends_mm[index] - start_mm);
        Some(local(element, curve, parameter))
    }

    /// The steps at every junction, for a constant feed.
    #[must_use]
    pub fn junction_steps(&self, feed_mm_s: f64) -> Vec<JunctionStep> {
        let end = |element: &Element| element.curve().map(|(curve, end)| local(element, curve, end));
        let start = |element: &Element| element.curve().map(|(curve, _)| local(element, curve, 0.0));
        let both = self.elements.windows(2).filter_map(|pair| Some((end(&pair[0])?, start(&pair[1])?)));
        both.zip(&self.ends_mm)
            .map(|((before, after), end_mm)| JunctionStep {
                time_s: end_mm / feed_mm_s,
                accel_mm_s2: scale(subtract(after.second, before.second), feed_mm_s * feed_mm_s),
                jerk_mm_s3: scale(subtract(after.third, before.third), feed_mm_s.powi(3)),
            })
            .collect()
    }

    /// Velocities every `tick_s` at a constant feed, by S2 (4) and (5), and their differences.
    #[must_use]
    pub fn ticks(&self, feed_mm_s: f64, tick_s: f64) -> AxisTicks {
        let count = (self.length_mm() / (feed_mm_s * tick_s)) as u64;
        let velocity_mm_s: Vec<Vector> = (0..=count)
            .filter_map(|tick| self.at(feed_mm_s * tick_s * tick as f64))
            .map(|local| scale(local.tangent, feed_mm_s))
            .collect();
        let differences = |values: &[Vector]| -> Vec<Vector> {
            values.windows(2).map(|pair| scale(subtract(pair[1], pair[0]), 1.0 / tick_s)).collect()
        };
        let accel_mm_s2 = differences(&velocity_mm_s);
        let jerk_mm_s3 = differences(&accel_mm_s2);
        AxisTicks { tick_s, velocity_mm_s, accel_mm_s2, jerk_mm_s3 }
    }
}

impl AxisTicks {
    /// The greatest |jerk| of an axis \[mm/s³\].
    #[must_use]
    pub fn jerk_max_mm_s3(&self) -> f64 {
        self.jerk_mm_s3.iter().flatten().fold(0.0, |max, jerk| max.max(jerk.abs()))
    }

    /// The greatest step of the jerk, over all axes, from one tick to the next \[mm/s³\].
    #[must_use]
    pub fn jerk_step_max_mm_s3(&self) -> f64 {
        self.jerk_mm_s3.windows(2).map(|pair| norm(subtract(pair[1], pair[0]))).fold(0.0, f64::max)
    }
}

fn local(element: &Element, curve: &dyn Curve, parameter: f64) -> Local {
    let [tangent, second, third] = by_arc_length(curve.derivatives(parameter));
    let point = add(element.ends_mm().0, curve.offset(0.0, parameter));
    Local { point, tangent, second, third }
}

/// The parameter up to which a curve is `s_mm` long, `length_mm` up to `end`. S2 (4), solved for u.
fn parameter_at(curve: &dyn Curve, end: f64, s_mm: f64, length_mm: f64) -> f64 {
    let mut parameter = end * (s_mm / length_mm);
    for _ in 0..NEWTON_STEPS {
        let excess_mm = curve.length(0.0, parameter) - s_mm;
        let step = excess_mm / norm(curve.derivatives(parameter)[0]);
        parameter = (parameter - step).clamp(0.0, end);
        if step.abs() <= f64::EPSILON * end {
            break;
        }
    }
    parameter
}
