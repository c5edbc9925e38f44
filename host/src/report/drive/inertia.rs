//! The page of the growing load.

use super::super::figure::{Graph, Series, Stack};
use super::super::findings::Findings;
use super::super::format::figure;
use super::super::palette;
use super::harmonic::{over_revolutions, wave};
use super::open;
use crate::drive::Recording;
use crate::drive::circle_motion::Circle;
use crate::drive::experiment::DriveError;
use crate::drive::inertia::{InertiaFigures, accelerations};
use crate::machine::Machine;

/// Velocity and acceleration of one axis under each load.
///
/// # Errors
/// A recording without its steady part.
pub fn inertia_figure(circle: &Circle, found: &[(InertiaFigures, Recording)]) -> Result<Stack, DriveError> {
    let (mut velocity, mut accel) = (Vec::new(), Vec::new());
    if let Some((figures, recording)) = found.first() {
        let set = wave(circle, recording, figures.response.axis, true)?;
        velocity.push(Series::curve("set", palette::LIMIT, set));
    }
    for (index, (figures, recording)) in found.iter().enumerate() {
        let (ink, axis) = (palette::series(index), figures.response.axis);
        let name = format!("load {}", figure(figures.load_inertia_ratio, 3));
        velocity.push(Series::curve(name.clone(), ink, wave(circle, recording, axis, false)?));
        let points = accelerations(recording, circle, axis)?;
        let points = points.into_iter().map(|(time_s, mm_s2)| (time_s * 1e3, mm_s2 / 1e3)).collect();
        accel.push(Series::curve(name, ink, points));
    }
    let graphs = vec![Graph::new("Velocity", "m/min", velocity), Graph::new("Acceleration", "m/s²", accel)];
    let words = "Load: added inertia over the unloaded axis’s.";
    Ok(over_revolutions("Velocity and acceleration under load", circle, graphs).with_words(words))
}

/// The page of the growing load.
///
/// # Errors
/// Those of [`inertia_figure`].
pub fn inertia_findings(
    machine: &Machine,
    circle: &Circle,
    found: &[(InertiaFigures, Recording)],
) -> Result<Findings, DriveError> {
    let axis = found.first().map_or(0, |(figures, _)| figures.response.axis);
    let name = &machine.axes[axis].name;
    let title = format!("Axis {name} at {} Hz under load", figure(circle.frequency_hz, 4));
    let limited = found.iter().find(|(figures, _)| figures.is_limited);
    let [bold, rest] = match limited {
        None => ["The velocity stays a sine:".to_owned(), "the current limit is not reached.".to_owned()],
        Some((figures, _)) => [
            format!("From load {} on the velocity is a triangle:", figure(figures.load_inertia_ratio, 3)),
            format!(
                "the current limit holds the acceleration at {} m/s².",
                figure(figures.plateau_accel_mm_s2 / 1e3, 3)
            ),
        ],
    };
    let mut findings = open(&title, machine, [&bold, &rest], &[]);
    findings.section("Velocity and acceleration");
    findings.figure(inertia_figure(circle, found)?);
    Ok(findings)
}
