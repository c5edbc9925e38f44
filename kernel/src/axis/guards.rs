//! A machine's figures for its guards, and its reactions to faults.
//!
//! Data only: the kernel acts on it with the feature `guards`.

use serde::{Deserialize, Serialize};

use crate::fault::reaction::Reactions;
use crate::path::Travel;
use crate::units::Position;

/// Guards of a machine; a compiled program carries them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Guards<const AXES: usize> {
    /// Figures of each axis; `None` to watch only the limit of its following error.
    #[serde(with = "crate::array")]
    pub axes: [Option<GuardFigures>; AXES],
    /// The reactions to faults.
    pub reactions: Reactions,
}

impl<const AXES: usize> Guards<AXES> {
    /// The same reactions, watching only the limits of the following error.
    #[must_use]
    pub fn limits_only(self) -> Self {
        Self { axes: [None; AXES], ..self }
    }

    /// The travel of the axes; an end beyond the kernel's range bounds nothing.
    #[must_use]
    pub fn travel(&self) -> Travel<AXES> {
        self.axes.map(|axis| {
            let [low, high] = axis?.travel_mm?.map(Position::from_mm);
            Some([low?, high?])
        })
    }
}

/// The figures of an axis' guards, for any number type.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuardFigures {
    /// Greatest following error at rest \[mm\], > 0, at most the axis' limit.
    pub following_error_at_rest_mm: f64,
    /// Additional following error allowed per velocity \[mm per mm/s\], 0 or more.
    pub following_error_per_velocity_s: f64,
    /// Additional following error allowed per acceleration \[mm per mm/s²\], 0 or more.
    pub following_error_per_accel_s2: f64,
    /// Greatest second difference of the following error from tick to tick \[mm\], > 0.
    pub jump_mm: f64,
    /// Commanded velocity at which the axis has to move \[mm/s\], > 0.
    pub moving_mm_s: f64,
    /// Time after which it has to move at the latest \[s\], > 0.
    pub response_s: f64,
    /// Acceleration that friction and load never exceed \[mm/s²\], > 0.
    pub load_accel_mm_s2: f64,
    /// The encoder's noise in either direction \[counts\].
    pub noise_counts: u16,
    /// How long the output may be at its limit \[s\], > 0.
    pub saturation_s: f64,
    /// Least and greatest set position \[mm\].
    pub travel_mm: Option<[f64; 2]>,
}
