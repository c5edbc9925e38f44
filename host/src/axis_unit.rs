//! What an axis counts, and how that is written.

use crate::gcode::Axis;

/// Millimetres, or degrees. Names in code say `mm` for both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisUnit {
    /// Of linear axes.
    Millimetre,
    /// Of rotary axes.
    Degree,
}

impl AxisUnit {
    /// The unit of an axis.
    #[must_use]
    pub const fn of(axis: Axis) -> Self {
        if axis.is_rotary() { Self::Degree } else { Self::Millimetre }
    }

    /// For people: "mm" or "°".
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Degree => "°",
        }
    }

    /// Its thousandth, for people: "µm" or "m°".
    #[must_use]
    pub const fn thousandth_symbol(self) -> &'static str {
        match self {
            Self::Millimetre => "µm",
            Self::Degree => "m°",
        }
    }

    /// In names of columns and keys: "mm" or "deg".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Degree => "deg",
        }
    }

    /// Its thousandth in such names: "um" or "mdeg".
    #[must_use]
    pub const fn thousandth_name(self) -> &'static str {
        match self {
            Self::Millimetre => "um",
            Self::Degree => "mdeg",
        }
    }
}
