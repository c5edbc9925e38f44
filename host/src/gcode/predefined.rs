//! Parameters that tell positions, offsets, tool, feed and modes.

use super::axis::{Axis, Point};
use super::expression::Environment;
use super::interpreter::Interpreter;
use super::modal::{Distance, FeedMode, Units};
use super::program::Plane;

/// The names, without their underscore, sorted.
const NAMES: [&str; 60] = [
    "a",
    "abs_a",
    "abs_b",
    "abs_c",
    "abs_u",
    "abs_v",
    "abs_w",
    "abs_x",
    "abs_y",
    "abs_z",
    "absolute",
    "adaptive_feed",
    "b",
    "c",
    "call_level",
    "ccomp",
    "coord_system",
    "current_pocket",
    "current_tool",
    "feed",
    "feed_hold",
    "feed_override",
    "flood",
    "ijk_absolute_mode",
    "imperial",
    "incremental",
    "inverse_time",
    "lathe_diameter_mode",
    "lathe_radius_mode",
    "line",
    "metric",
    "metric_machine",
    "mist",
    "motion_mode",
    "plane",
    "remap_level",
    "retract_old_z",
    "retract_r_plane",
    "rpm",
    "selected_pocket",
    "selected_tool",
    "speed_override",
    "spindle_css_mode",
    "spindle_cw",
    "spindle_on",
    "spindle_rpm_mode",
    "task",
    "tool_offset",
    "u",
    "units_per_minute",
    "units_per_rev",
    "v",
    "value",
    "value_returned",
    "vmajor",
    "vminor",
    "w",
    "x",
    "y",
    "z",
];

/// Whether a name, with its underscore, is predefined.
pub(super) fn is_name(name: &str) -> bool {
    name.strip_prefix('_').is_some_and(|name| NAMES.binary_search(&name).is_ok())
}

fn truth(value: bool) -> f64 {
    f64::from(u8::from(value))
}

impl Environment for Interpreter {
    fn numbered(&self, number: u32) -> f64 {
        let current = || self.tools.table.get(self.tools.current);
        let coordinate = |point: Point, index: u32| match Axis::ALL.get(index as usize) {
            Some(axis) if axis.is_rotary() => at(point, index),
            _ => self.modal.units.of_mm(at(point, index)),
        };
        match number {
            5021..=5029 => coordinate(self.machine, number - 5021),
            5420..=5428 => coordinate(self.work, number - 5420),
            5400 => f64::from(self.tools.current),
            5401..=5409 => current().map_or(0.0, |tool| at(tool.offset, number - 5401)),
            5410 => current().map_or(2.0 * self.tools.radius_mm, |tool| tool.diameter.to_mm()),
            5411 => current().map_or(0.0, |tool| tool.angles_deg[0]),
            5412 => current().map_or(0.0, |tool| tool.angles_deg[1]),
            5413 => current().map_or(0.0, |tool| f64::from(tool.orientation)),
            _ => self.parameters.get(number),
        }
    }

    fn named(&self, name: &str) -> Option<f64> {
        match name.strip_prefix('_').and_then(|name| self.predefined(name)) {
            Some(value) => Some(value),
            None => self.parameters.named(name),
        }
    }

    fn is_diameter(&self) -> bool {
        self.modal.is_diameter
    }
}

/// A coordinate \[mm\].
fn at(point: Point, axis: u32) -> f64 {
    point.get(axis as usize).map_or(0.0, |length| length.to_mm())
}

impl Interpreter {
    /// `x` to `w` in work, `abs_x` to `abs_w` in machine coordinates.
    fn coordinate_named(&self, name: &str) -> Option<f64> {
        let (letter, first) = match name.strip_prefix("abs_") {
            Some(letter) => (letter, 5021),
            None => (name, 5420),
        };
        let [letter] = letter.as_bytes() else { return None };
        let axis = Axis::of_letter(*letter)?;
        Some(self.numbered(first + axis.index() as u32))
    }

    fn predefined(&self, name: &str) -> Option<f64> {
        if let Some(value) = self.coordinate_named(name) {
            return Some(value);
        }
        let modal = &self.modal;
        let pocket = |number: Option<u32>| {
            let pocket =
                number.and_then(|number| self.tools.table.get(number)).map(|tool| f64::from(tool.pocket));
            pocket.unwrap_or(-1.0)
        };
        Some(match name {
            "feed" => match modal.feed_mode {
                FeedMode::InverseTime => 0.0,
                _ => modal.units.of_mm(modal.feed.map_or(0.0, |feed| feed.linear)),
            },
            "rpm" => modal.spindle.speed,
            "line" => f64::from(self.line),
            "motion_mode" => modal.motion.map_or(800.0, |motion| motion.tenths() as f64),
            "plane" => match modal.plane {
                Plane::Xy => 170.0,
                Plane::Zx => 180.0,
                Plane::Yz => 190.0,
            },
            "ccomp" => self.cutter.map_or(400.0, |cutter| cutter.tenths as f64),
            "metric" => truth(modal.units == Units::Millimetres),
            "imperial" => truth(modal.units == Units::Inches),
            "metric_machine" => 1.0,
            "absolute" => truth(modal.distance == Distance::Absolute),
            "incremental" => truth(modal.distance == Distance::Incremental),
            "inverse_time" => truth(modal.feed_mode == FeedMode::InverseTime),
            "units_per_minute" => truth(modal.feed_mode == FeedMode::PerMinute),
            "units_per_rev" => truth(modal.feed_mode == FeedMode::PerRevolution),
            "coord_system" => match self.system() {
                system @ ..=6 => f64::from(530 + 10 * system),
                system => f64::from(584 + system),
            },
            "tool_offset" => truth(self.frame.tool.iter().any(|length| length.units() != 0)),
            "retract_r_plane" => truth(modal.retracts_to_r),
            "retract_old_z" => truth(!modal.retracts_to_r),
            "spindle_rpm_mode" => truth(!modal.spindle.is_surface),
            "spindle_css_mode" => truth(modal.spindle.is_surface),
            "ijk_absolute_mode" => truth(modal.arc_distance == Distance::Absolute),
            "lathe_diameter_mode" => truth(modal.is_diameter),
            "lathe_radius_mode" => truth(!modal.is_diameter),
            "spindle_on" => truth(modal.spindle.clockwise.is_some()),
            "spindle_cw" => truth(modal.spindle.clockwise == Some(true)),
            "mist" => truth(modal.mist),
            "flood" => truth(modal.flood),
            "speed_override" => truth(modal.overrides.speed),
            "feed_override" => truth(modal.overrides.feed),
            "adaptive_feed" => truth(modal.overrides.adaptive_feed),
            "feed_hold" => truth(modal.overrides.feed_stop),
            "current_tool" => f64::from(self.tools.current),
            "selected_tool" => self.tools.selected.map_or(-1.0, f64::from),
            "current_pocket" => pocket(Some(self.tools.current)),
            "selected_pocket" => pocket(self.tools.selected),
            "value" => self.returned.unwrap_or(0.0),
            "value_returned" => truth(self.returned.is_some()),
            "call_level" => self.call_level() as f64,
            "task" | "remap_level" => 0.0,
            // The version whose semantics these are.
            "vmajor" => 2.9,
            "vminor" => 0.0,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_value() {
        assert!(NAMES.is_sorted());
        let interpreter = Interpreter::new(&super::super::ReadOptions::default());
        for name in NAMES {
            assert!(interpreter.named(&format!("_{name}")).is_some(), "{name}");
            assert!(is_name(&format!("_{name}")), "{name}");
        }
        assert!(!is_name("_mine") && !is_name("x"));
    }
}
