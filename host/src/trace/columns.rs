//! The quantities of an axis, by the names of the trace file's columns.

use super::AxisTick;
use crate::axis_unit::AxisUnit;

// A position step is 2⁻³² mm = 2.3·10⁻¹⁰ mm, a step of the converter 0.3 mV.

/// Decimals of a time in s.
pub const TIME: usize = 9;
/// Decimals of a position in mm.
pub const POSITION: usize = 10;
/// Decimals of a velocity in mm/s.
pub const VELOCITY: usize = 9;
/// Decimals of acceleration in mm/s², and of jerk in mm/s³.
pub const CHANGE: usize = 6;
const ERROR: usize = 6;
const VOLTS: usize = 6;

/// A column of an axis.
pub struct AxisColumn {
    /// Its name without the unit.
    pub quantity: &'static str,
    /// The unit of an axis that counts in this.
    pub unit: fn(AxisUnit) -> String,
    /// Decimals that it is written with.
    pub decimals: usize,
    /// Its value.
    pub of: fn(&AxisTick) -> f64,
}

/// The columns of an axis.
pub const AXIS_COLUMNS: [AxisColumn; 7] = [
    axis_column("set", |unit| unit.name().to_owned(), POSITION, |tick| tick.set_mm),
    axis_column("vel", |unit| format!("{}_s", unit.name()), VELOCITY, |tick| tick.vel_mm_s),
    axis_column("acc", |unit| format!("{}_s2", unit.name()), CHANGE, |tick| tick.acc_mm_s2),
    axis_column("jerk", |unit| format!("{}_s3", unit.name()), CHANGE, |tick| tick.jerk_mm_s3),
    axis_column("act", |unit| unit.name().to_owned(), POSITION, |tick| tick.act_mm),
    axis_column("err", |unit| unit.thousandth_name().to_owned(), ERROR, |tick| tick.err_um),
    axis_column("out", |_| "v".to_owned(), VOLTS, |tick| tick.out_v),
];

const fn axis_column(
    quantity: &'static str,
    unit: fn(AxisUnit) -> String,
    decimals: usize,
    of: fn(&AxisTick) -> f64,
) -> AxisColumn {
    AxisColumn { quantity, unit, decimals, of }
}
