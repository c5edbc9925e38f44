//! What is wrong with a parameter of a simulated machine.

/// A parameter cannot be simulated. Nothing is clamped to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterError {
    /// The value is not a number or infinite.
    NotFinite {
        /// The parameter, by its field name.
        quantity: &'static str,
        /// The value given, in the unit of the name.
        value: f64,
    },
    /// The value is finite but outside its documented range.
    OutOfRange {
        /// The parameter, by its field name.
        quantity: &'static str,
        /// The value given, in the unit of the name.
        value: f64,
    },
    /// The dead time spans more sub-steps than the line has cells for.
    LineTooShort {
        /// Cells that the dead time needs at this sub-step.
        cells_needed: usize,
        /// Number of cells.
        capacity: usize,
    },
}

impl core::fmt::Display for ParameterError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite { quantity, value } => write!(formatter, "{quantity} = {value} is not finite"),
            Self::OutOfRange { quantity, value } => write!(formatter, "{quantity} = {value} is out of range"),
            Self::LineTooShort { cells_needed, capacity } => {
                write!(formatter, "the dead time needs {cells_needed} cells, the line has {capacity}")
            }
        }
    }
}

impl core::error::Error for ParameterError {}

/// Refuses a value that is not finite.
pub(crate) fn finite(quantity: &'static str, value: f64) -> Result<(), ParameterError> {
    if value.is_finite() { Ok(()) } else { Err(ParameterError::NotFinite { quantity, value }) }
}

/// Refuses a value that is not finite or not above zero.
pub(crate) fn positive(quantity: &'static str, value: f64) -> Result<(), ParameterError> {
    finite(quantity, value)?;
    if value > 0.0 { Ok(()) } else { Err(ParameterError::OutOfRange { quantity, value }) }
}

/// Refuses a value that is not finite or below zero.
pub(crate) fn not_negative(quantity: &'static str, value: f64) -> Result<(), ParameterError> {
    finite(quantity, value)?;
    if value >= 0.0 { Ok(()) } else { Err(ParameterError::OutOfRange { quantity, value }) }
}
