//! What is drawn of a spline through points: the points, the curve, and how far they are apart.

use super::figure::{Axis, Figure, Graph, Plane, Series, Stack, Told};
use super::findings::Findings;
use super::format::figure;
use super::palette;
use crate::points::Points;
use crate::toolpath::Vector;
use crate::toolpath::spline::Spline;

/// Places of the curve that are drawn, about, and at least on each span.
const PLACES: usize = 20_000;
const PLACES_OF_SPAN: (usize, usize) = (4, 32);

/// The points, where their spline passes them, and the path length there.
struct Fitted {
    curve_mm: Vec<Vector>,
    path_mm: Vec<f64>,
    deviation_mm: Vec<Vector>,
}

impl Fitted {
    fn of(points: &[Vector], parameters: &[f64], spline: &Spline) -> Self {
        let course = crate::smoothness::course(spline);
        // Where each span ends; the course has no junction at its own end.
        let mut ends_mm = course.junctions_mm().to_vec();
        ends_mm.resize(spline.spans().len(), course.length_mm());
        let steps = (PLACES / spline.spans().len().max(1)).clamp(PLACES_OF_SPAN.0, PLACES_OF_SPAN.1);
        let knots = spline.knots();
        let places = |span: usize| {
            let (from, to) = (knots[span], knots[span + 1]);
            (0..=steps).map(move |step| from + (to - from) * step as f64 / steps as f64)
        };
        let curve_mm = (0..spline.spans().len()).flat_map(|span| places(span).skip(usize::from(span > 0)));
        let curve_mm = curve_mm.map(|u| spline.at(u)).collect();
        // Along chords of the span, which end where the span does.
        let path_mm = |u: f64| {
            let (span, _) = spline.local(u);
            let start_mm = if span == 0 { 0.0 } else { ends_mm[span - 1] };
            let chords = |us: Vec<f64>| -> f64 {
                us.windows(2).map(|pair| distance(spline.at(pair[0]), spline.at(pair[1]))).sum()
            };
            let whole = chords(places(span).collect());
            let part = chords(places(span).take_while(|&place| place < u).chain([u]).collect());
            start_mm + (ends_mm[span] - start_mm) * if whole > 0.0 { part / whole } else { 0.0 }
        };
        let from_curve = |(point, &u): (&Vector, &f64)| {
            let [x, y, z] = spline.at(u);
            [x - point[0], y - point[1], z - point[2]]
        };
        Self {
            curve_mm,
            path_mm: parameters.iter().map(|&u| path_mm(u)).collect(),
            deviation_mm: points.iter().zip(parameters).map(from_curve).collect(),
        }
    }
}

fn distance(a: Vector, b: Vector) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// The section of a run's page: points and curve in a plane, and the deviation over path length. `parameters` are those of the points.
#[must_use]
pub fn spline_findings(points: &Points, parameters: &[f64], spline: &Spline, tolerance_mm: f64) -> Findings {
    let fitted = Fitted::of(&points.points, parameters, spline);
    let deviation_um: Vec<f64> =
        fitted.deviation_mm.iter().map(|by| by.iter().map(|mm| mm * mm).sum::<f64>().sqrt() * 1e3).collect();
    let mut findings = Findings::part();
    findings.section("Points and deviation");
    findings.words(&format!(
        "{} points; the spline is within {} µm of each at its parameter.",
        points.points.len(),
        figure(spline.deviation_mm() * 1e3, 4)
    ));
    let told = || {
        let of = |name: &str, unit: &str, values: Vec<f64>| Told { quantity: Axis::new(name, unit), values };
        let coordinate = |axis: usize| points.points.iter().map(|point| point[axis]).collect();
        vec![
            of("Line", "", points.lines.iter().map(|&line| f64::from(line)).collect()),
            of("X", "mm", coordinate(0)),
            of("Y", "mm", coordinate(1)),
            of("Z", "mm", coordinate(2)),
            of("Path", "mm", fitted.path_mm.clone()),
            of("Deviation", "µm", deviation_um.clone()),
        ]
    };
    let in_plane = |values: &[Vector], [right, up]: [usize; 2]| -> Vec<(f64, f64)> {
        values.iter().map(|value| (value[right], value[up])).collect()
    };
    let names = ["X", "Y", "Z"];
    let planes = planes(&points.points).into_iter().map(|axes| {
        Figure::from(Plane {
            title: format!("Points and spline, {}{}", names[axes[0]], names[axes[1]]),
            words: String::new(),
            axes: axes.map(|axis| names[axis].to_owned()),
            curve: Series::curve("spline", palette::series(0), in_plane(&fitted.curve_mm, axes)),
            points: Series::dots("points", palette::series(1), in_plane(&points.points, axes)),
            deviations: in_plane(&fitted.deviation_mm, axes),
            told: told(),
        })
    });
    findings.figures(planes);
    let over_path = fitted.path_mm.iter().copied().zip(deviation_um.iter().copied()).collect();
    let graph = Graph::new("Deviation", "µm", vec![Series::dots("", palette::CONTOUR, over_path)]);
    let graph = if tolerance_mm > 0.0 { graph.with_levels(&[tolerance_mm * 1e3]) } else { graph };
    let length_mm = fitted.path_mm.last().copied().unwrap_or(0.0);
    let words = if tolerance_mm > 0.0 {
        format!(
            "Distance of each point from the spline at its parameter. Dashed: the tolerance, {} µm.",
            figure(tolerance_mm * 1e3, 4)
        )
    } else {
        "Distance of each point from the spline at its parameter. The spline goes through all points: what is left is rounding.".to_owned()
    };
    let path = Axis::new("Path", "mm");
    let title = "Deviation over path length";
    findings.figure(Stack::new(title, path, (0.0, length_mm), vec![graph]).with_words(words));
    findings
}

/// The plane in which the points reach farthest, and the one with the third axis, if they move along it, too.
fn planes(points: &[Vector]) -> Vec<[usize; 2]> {
    let reach = |axis: usize| {
        let values = || points.iter().map(|point| point[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let flattest = (0..3).rev().min_by(|&a, &b| reach(a).total_cmp(&reach(b))).unwrap_or(2);
    let others: Vec<usize> = (0..3).filter(|&axis| axis != flattest).collect();
    let mut planes = vec![[others[0], others[1]]];
    if reach(flattest) > 0.0 {
        planes.push(if flattest < others[0] { [flattest, others[0]] } else { [others[0], flattest] });
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::spline::{Degree, chord_lengths, fit};

    /// What is drawn is what the spline says of itself.
    #[test]
    fn deviations_and_lengths_are_those_of_the_spline() {
        let at = |index: u32| {
            let t = f64::from(index) * 0.1;
            [20.0 * t.cos(), 12.0 * t.sin() + 0.02 * (f64::from(index) * 2.4).sin(), 0.5 * t]
        };
        let points: Vec<Vector> = (0..100).map(at).collect();
        let parameters = chord_lengths(&points).expect("points that differ");
        let spline = fit(&points, &parameters, Degree::Quintic, 0.02).expect("a spline");
        let fitted = Fitted::of(&points, &parameters, &spline);
        let length = |by: &Vector| by.iter().map(|mm| mm * mm).sum::<f64>().sqrt();
        let greatest_mm = fitted.deviation_mm.iter().map(length).fold(0.0, f64::max);
        assert!(greatest_mm > 1e-4 && (greatest_mm - spline.deviation_mm()).abs() < 1e-12, "{greatest_mm}");
        let length_mm = crate::smoothness::course(&spline).length_mm();
        assert_eq!(fitted.path_mm[0], 0.0);
        assert!((fitted.path_mm[99] - length_mm).abs() < 1e-9, "{}", fitted.path_mm[99]);
        assert!(fitted.path_mm.windows(2).all(|pair| pair[0] < pair[1]));
        // Chords are shorter than the curve, by the square of what they span.
        let chords_mm: f64 = fitted.curve_mm.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        assert!(chords_mm < length_mm && chords_mm > 0.9999 * length_mm, "{chords_mm} {length_mm}");
        assert_eq!(planes(&points), [[0, 1], [0, 2]]);
        let flat: Vec<Vector> = points.iter().map(|&[x, y, _]| [1.0, y, x]).collect();
        assert_eq!(planes(&flat), [[1, 2]]);
    }
}
