//! The numbers of a machine file that a page has sliders for.

use serde::Serialize;

use crate::machine::keys::KEY_TABLES;
use crate::machine::numbers;

/// A group of sliders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Group {
    /// Along the path.
    Path,
    /// Of axes.
    Axes,
    /// Feedback and feedforward of axes.
    Regulator,
    /// The simulated drives of axes.
    Drive,
}

/// Where a slider ends; a machine file may have values beyond.
struct Slider {
    group: Group,
    table: &'static str,
    key: &'static str,
    label: &'static str,
    low: f64,
    high: f64,
}

const fn slider(
    (group, table): (Group, &'static str),
    key: &'static str,
    label: &'static str,
    (low, high): (f64, f64),
) -> Slider {
    Slider { group, table, key, label, low, high }
}

const PATH: (Group, &str) = (Group::Path, "path");
const AXES: (Group, &str) = (Group::Axes, "axis");
const REGULATOR: (Group, &str) = (Group::Regulator, "axis.regulator");
const DRIVE: (Group, &str) = (Group::Drive, "axis.drive");

const SLIDERS: [Slider; 23] = [
    slider(PATH, "feed_mm_s", "Feed", (1.0, 300.0)),
    slider(PATH, "accel_mm_s2", "Acceleration", (10.0, 10_000.0)),
    slider(PATH, "jerk_mm_s3", "Jerk", (100.0, 1e6)),
    slider(PATH, "snap_mm_s4", "Snap", (1e3, 1e9)),
    slider(PATH, "blend_tolerance_mm", "Tolerance", (0.001, 1.0)),
    slider(AXES, "feed_mm_s", "Feed", (1.0, 300.0)),
    slider(AXES, "accel_mm_s2", "Acceleration", (10.0, 10_000.0)),
    slider(AXES, "jerk_mm_s3", "Jerk", (100.0, 1e6)),
    slider(AXES, "snap_mm_s4", "Snap", (1e3, 1e9)),
    slider(REGULATOR, "kp_per_s", "Proportional gain", (0.0, 600.0)),
    slider(REGULATOR, "ki_per_s2", "Integral gain", (0.0, 10_000.0)),
    slider(REGULATOR, "kd", "Derivative gain", (0.0, 2.0)),
    slider(REGULATOR, "feedforward_velocity", "Feedforward of velocity", (0.0, 1.2)),
    slider(REGULATOR, "feedforward_accel_s", "Feedforward of acceleration", (0.0, 0.005)),
    slider(REGULATOR, "feedforward_jerk_s2", "Feedforward of jerk", (0.0, 1e-4)),
    slider(DRIVE, "velocity_gain_per_s", "Velocity gain", (50.0, 2000.0)),
    slider(DRIVE, "integral_time_s", "Integral time", (0.001, 0.2)),
    slider(DRIVE, "dead_time_s", "Dead time", (0.0, 0.01)),
    slider(DRIVE, "current_lag_s", "Lag of the current loop", (0.0, 0.005)),
    slider(DRIVE, "accel_limit_mm_s2", "Current limit", (200.0, 50_000.0)),
    slider(DRIVE, "load_inertia_ratio", "Added inertia", (0.0, 5.0)),
    slider(DRIVE, "coulomb_friction_mm_s2", "Coulomb friction", (0.0, 2000.0)),
    slider(DRIVE, "viscous_friction_per_s", "Viscous friction", (0.0, 10.0)),
];

/// A slider as a page makes it.
#[derive(Debug, Serialize)]
pub(super) struct SliderJson {
    group: Group,
    table: &'static str,
    key: &'static str,
    label: &'static str,
    unit: &'static str,
    meaning: &'static str,
    low: f64,
    high: f64,
    /// Of the path one, or one of each axis.
    values: Vec<f64>,
}

/// All of them, with the values of a machine file.
pub(super) fn of_machine(text: &str) -> Vec<SliderJson> {
    let json = |slider: &Slider| {
        let &Slider { group, table, key, label, low, high } = slider;
        let tables = KEY_TABLES.iter().filter(|of| of.name == table);
        let known = tables.flat_map(|of| of.keys).find(|of| of.name == key)?;
        let default = known.default.and_then(|default| default.parse().ok());
        let values = numbers(text, table, key).into_iter().map(|number| number.or(default));
        let values = values.collect::<Option<Vec<f64>>>()?;
        Some(SliderJson {
            group,
            table,
            key,
            label,
            unit: known.unit,
            meaning: known.meaning,
            low,
            high,
            values,
        })
    };
    SLIDERS.iter().filter_map(json).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::REFERENCE_TOML;

    #[test]
    fn every_slider_has_a_key_and_the_reference_machine_within_its_ends() {
        let all = of_machine(REFERENCE_TOML);
        assert_eq!(all.len(), SLIDERS.len());
        for SliderJson { key, low, high, values, .. } in &all {
            assert!(matches!(values.len(), 1 | 3), "{key}");
            assert!(values.iter().all(|value| low <= value && value <= high), "{key}: {values:?}");
        }
        let tolerance = all.iter().find(|slider| slider.key == "blend_tolerance_mm").expect("a slider");
        assert_eq!((&tolerance.values[..], tolerance.unit), (&[0.01][..], "mm"));
    }
}
