//! Axes in records: as their letters.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};

use crate::gcode::Axis;

pub(super) fn serialize<S: Serializer>(axis: &Axis, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_char(axis.letter())
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Axis, D::Error> {
    let letter = char::deserialize(deserializer)?;
    let axis = u8::try_from(letter).ok().and_then(Axis::of_letter);
    axis.ok_or_else(|| {
        D::Error::custom(format!("found the axis `{letter}`, expected X to Z, A to C or U to W"))
    })
}
