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
