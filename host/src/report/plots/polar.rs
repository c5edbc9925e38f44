//! Deviations from a circle, drawn around it, magnified.

use std::f64::consts::TAU;
use std::io;

use plotters::element::{PathElement, Text};
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, VPos};

use super::graph::Series;
use super::{Caption, Drawn, Layout, on_both_layouts};
use crate::report::format::figure;
use crate::report::palette;

/// Radius of the programmed circle, as a part of the largest that fits.
const CIRCLE: f64 = 0.62;
/// Corners of a drawn circle.
const CORNERS: u32 = 180;
/// Height of the picture over its width, on the wide and on the narrow layout.
const HEIGHT: (f64, f64) = (0.55, 0.95);

/// Draws curves of (angle \[rad\], deviation \[µm\]) around the programmed circle, with rings at ± `ring_um`.
/// The deviations fill what is left of the layout.
pub(in crate::report) fn draw(series: &[Series], ring_um: f64, caption: &Caption<'_>) -> io::Result<String> {
    let deviations = series.iter().flat_map(|series| series.points.iter().map(|point| point.1));
    let greatest_um = deviations.filter(|um| um.is_finite()).fold(ring_um, |most, um| most.max(um.abs()));
    let height = |layout: &Layout| {
        let part = if layout.class == "wide" { HEIGHT.0 } else { HEIGHT.1 };
        (f64::from(layout.width) * part).round() as u32
    };
    on_both_layouts(caption, height, |area, layout| {
        let (width, height) = area.dim_in_pixel();
        let centre = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let largest = (centre.0.min(centre.1) - f64::from(layout.text)) * 0.98;
        let at = |angle_rad: f64, deviation_um: f64| {
            let radius = largest * (CIRCLE + (1.0 - CIRCLE) * deviation_um / greatest_um);
            let (sine, cosine) = angle_rad.sin_cos();
            ((centre.0 + radius * cosine).round() as i32, (centre.1 - radius * sine).round() as i32)
        };
        let ring = |deviation_um: f64| {
            (0..=CORNERS).map(move |i| at(TAU * f64::from(i) / f64::from(CORNERS), deviation_um))
        };
        let grid = palette::AXIS.rgb().stroke_width(5);
        let limit = palette::LIMIT.rgb().stroke_width(4);
        area.draw(&PathElement::new(ring(0.0).collect::<Vec<_>>(), grid))?;
        for deviation_um in [ring_um, -ring_um] {
            area.draw(&PathElement::new(ring(deviation_um).collect::<Vec<_>>(), limit))?;
        }
        for series in series {
            let points: Vec<_> =
                series.points.iter().map(|&(angle_rad, deviation_um)| at(angle_rad, deviation_um)).collect();
            area.draw(&PathElement::new(points, series.ink.rgb().stroke_width(layout.stroke)))?;
        }
        let write = |words: String, deviation_um: f64| -> Drawn {
            let (_, y) = at(TAU / 4.0, deviation_um);
            let style = layout.letters(palette::TEXT, HPos::Center, VPos::Center);
            area.draw(&Text::new(words, (centre.0 as i32, y), style))
        };
        write(format!("+{} µm", figure(ring_um, 3)), ring_um)?;
        write(format!("−{} µm", figure(ring_um, 3)), -ring_um)
    })
}
