//! Figures that a page's script draws: curves over an axis, deviations around a circle, points in a plane.
//!
//! A page has their values to the last bit, as the experiment found them; what has no value is left out of the curve. Names, units
//! and inks are those of the page.

use serde::{Serialize, Serializer};

use super::palette::{self, Ink};

/// Points of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    pub(super) name: String,
    #[serde(serialize_with = "name_of")]
    pub(super) ink: Ink,
    pub(super) points: Vec<(f64, f64)>,
    /// Points that no line joins.
    pub(super) is_dots: bool,
}

fn name_of<S: Serializer>(ink: &Ink, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&ink.name())
}

impl Series {
    /// A curve.
    pub(super) fn curve(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), ink, points, is_dots: false }
    }

    /// Dots.
    pub(super) fn dots(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Self { is_dots: true, ..Self::curve(name, ink, points) }
    }

    /// Curves that differ in kind, in inks of their own.
    pub(super) fn numbered(curves: impl IntoIterator<Item = (String, Vec<(f64, f64)>)>) -> Vec<Self> {
        let curves = curves.into_iter().enumerate();
        curves.map(|(index, (name, points))| Self::curve(name, palette::series(index), points)).collect()
    }
}

/// A quantity and its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Axis {
    pub(super) name: String,
    pub(super) unit: String,
}

impl Axis {
    pub(super) fn new(name: impl Into<String>, unit: &str) -> Self {
        Self { name: name.into(), unit: unit.to_owned() }
    }
}

/// One pair of axes with its curves.
#[derive(Clone, Debug, Serialize)]
pub struct Graph {
    pub(super) y: Axis,
    /// Ends of the vertical axis; without them, all that is seen of the curves, and zero.
    pub(super) ends: Option<(f64, f64)>,
    pub(super) series: Vec<Series>,
    /// Levels that are drawn as limits.
    pub(super) levels: Vec<f64>,
}

impl Graph {
    pub(super) fn new(name: impl Into<String>, unit: &str, series: Vec<Series>) -> Self {
        Self { y: Axis::new(name, unit), ends: None, series, levels: Vec::new() }
    }

    pub(super) fn with_levels(self, levels: &[f64]) -> Self {
        Self { levels: levels.to_vec(), ..self }
    }
}

/// Graphs one above the other, over a common horizontal axis.
#[derive(Clone, Debug, Serialize)]
pub struct Stack {
    pub(super) title: String,
    /// What explains it.
    pub(super) words: String,
    pub(super) x: Axis,
    /// Ends of the horizontal axis.
    pub(super) ends: (f64, f64),
    /// The horizontal axis is logarithmic; its values are above 0.
    pub(super) is_logarithmic: bool,
    pub(super) graphs: Vec<Graph>,
}

impl Stack {
    pub(super) fn new(title: impl Into<String>, x: Axis, ends: (f64, f64), graphs: Vec<Graph>) -> Self {
        Self { title: title.into(), words: String::new(), x, ends, is_logarithmic: false, graphs }
    }

    pub(super) fn with_words(self, words: impl Into<String>) -> Self {
        Self { words: words.into(), ..self }
    }

    pub(super) fn logarithmic(self) -> Self {
        Self { is_logarithmic: true, ..self }
    }
}

/// Deviations from a circle, drawn around it, magnified.
#[derive(Clone, Debug, Serialize)]
pub struct Polar {
    pub(super) title: String,
    pub(super) words: String,
    pub(super) radius_mm: f64,
    /// Rings are drawn at ± this deviation \[µm\].
    pub(super) ring_um: f64,
    /// Names of the axes to the right and upwards.
    pub(super) axes: [String; 2],
    /// Angle \[°\] and deviation \[µm\].
    pub(super) series: Vec<Series>,
}

/// Points in a plane beside a curve, with equal scales \[mm\].
#[derive(Clone, Debug, Serialize)]
pub struct Plane {
    pub(super) title: String,
    pub(super) words: String,
    /// Names of the axes to the right and upwards.
    pub(super) axes: [String; 2],
    pub(super) curve: Series,
    pub(super) points: Series,
    /// From each point to the curve \[mm\]; drawn magnified.
    pub(super) deviations: Vec<(f64, f64)>,
    /// What is told of each point.
    pub(super) told: Vec<Told>,
}

/// A quantity of every point.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    pub(super) quantity: Axis,
    pub(super) values: Vec<f64>,
}

/// A figure.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Figure {
    /// Curves over an axis.
    Stack(Stack),
    /// Deviations around a circle.
    Polar(Polar),
    /// Points in a plane.
    Plane(Plane),
}

impl From<Stack> for Figure {
    fn from(stack: Stack) -> Self {
        Self::Stack(stack)
    }
}

impl From<Polar> for Figure {
    fn from(polar: Polar) -> Self {
        Self::Polar(polar)
    }
}

impl From<Plane> for Figure {
    fn from(plane: Plane) -> Self {
        Self::Plane(plane)
    }
}

/// Ends of an axis that has these values; wider than nothing where they are one.
pub(super) fn ends_of(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    if high > low { (low, high) } else { (0.0, 2.0 * high.max(0.5)) }
}
