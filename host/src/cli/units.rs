//! Units of axes in what commands print: a rotary axis has degrees where others have millimetres.

use serde::ser::Error;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use crate::axis_unit::AxisUnit;

/// An object of an axis with this unit: in its keys `mm` and `um` stand for `deg` and `mdeg` of a rotary one.
pub(super) struct InUnit<T>(pub(super) AxisUnit, pub(super) T);

impl<T: Serialize> Serialize for InUnit<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let &Self(unit, ref object) = self;
        if unit == AxisUnit::Millimetre {
            return object.serialize(serializer);
        }
        let part = |part: &str| match part {
            "mm" => unit.name().to_owned(),
            "um" => unit.thousandth_name().to_owned(),
            other => other.to_owned(),
        };
        let key = |key: String| key.split('_').map(part).collect::<Vec<_>>().join("_");
        match serde_json::to_value(object).map_err(S::Error::custom)? {
            Value::Object(fields) => {
                let fields: Map<String, Value> =
                    fields.into_iter().map(|(name, value)| (key(name), value)).collect();
                fields.serialize(serializer)
            }
            other => other.serialize(serializer),
        }
    }
}

/// A feed that is asked for, per second: a number is per minute, as in programs, unless it carries its unit.
pub(super) fn feed_per_s(text: &str) -> Result<f64, String> {
    let per_s = [("mm/s", 1.0), ("deg/s", 1.0), ("°/s", 1.0)];
    let per_min = [("mm/min", 60.0), ("deg/min", 60.0), ("°/min", 60.0), ("", 60.0)];
    let of_unit = |&(unit, seconds): &(&str, f64)| {
        let number: f64 = text.trim().strip_suffix(unit)?.trim().parse().ok()?;
        Some(number / seconds)
    };
    per_s
        .iter()
        .chain(&per_min)
        .find_map(of_unit)
        .ok_or_else(|| format!("found `{text}`, expected a feed such as 3000 (mm/min), 50mm/s or 10deg/s"))
}

/// Where the units of a table of axes stand: in its head, or beside each figure if there are rotary axes.
#[derive(Clone, Copy)]
pub(super) struct TableUnits {
    is_beside: bool,
}

impl TableUnits {
    pub(super) fn of(mut units: impl Iterator<Item = AxisUnit>) -> Self {
        Self { is_beside: units.any(|unit| unit != AxisUnit::Millimetre) }
    }

    /// What the head of a column says that is in `unit` for linear axes.
    pub(super) fn head(self, unit: &'static str) -> &'static str {
        if self.is_beside { "" } else { unit }
    }

    /// A cell of an axis.
    pub(super) fn cell(self, figure: String, unit: &str) -> String {
        if self.is_beside { format!("{figure} {unit}") } else { figure }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_feed_is_per_minute_or_carries_its_unit() {
        for (text, expected) in
            [("3000", 50.0), ("50mm/s", 50.0), ("3000 mm/min", 50.0), ("10deg/s", 10.0), ("600°/min", 10.0)]
        {
            assert_eq!(feed_per_s(text), Ok(expected), "{text}");
        }
        for text in ["", "mm/s", "fast", "50m/s", "50mm"] {
            let error = feed_per_s(text).expect_err(text);
            assert!(error.starts_with(&format!("found `{text}`, expected a feed")), "{error}");
        }
    }

    #[test]
    fn keys_of_a_rotary_axis_say_degrees() {
        #[derive(Serialize)]
        struct Figures {
            from_mm: f64,
            feed_mm_s: f64,
            error_um_max: f64,
            command: &'static str,
        }
        let figures = || Figures { from_mm: 1.0, feed_mm_s: 2.0, error_um_max: 3.0, command: "mm" };
        let linear = serde_json::to_string(&InUnit(AxisUnit::Millimetre, figures())).expect("an object");
        assert_eq!(linear, r#"{"from_mm":1.0,"feed_mm_s":2.0,"error_um_max":3.0,"command":"mm"}"#);
        let rotary = serde_json::to_value(InUnit(AxisUnit::Degree, figures())).expect("an object");
        let expected =
            serde_json::json!({"from_deg": 1.0, "feed_deg_s": 2.0, "error_mdeg_max": 3.0, "command": "mm"});
        assert_eq!(rotary, expected);
    }
}
