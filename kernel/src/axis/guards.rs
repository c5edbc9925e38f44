//! What a machine says of its guards and of how its faults end.
//!
//! Data only: with the feature `guards` the kernel acts on it.

use serde::{Deserialize, Serialize};

use crate::fault::reaction::Reactions;
use crate::path::Travel;
use crate::units::Position;

/// Guards of a machine: a compiled program carries them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Guards<const AXES: usize> {
    /// Of each axis; `None` to watch nothing of it but the limit of its following error.
    #[serde(with = "crate::array")]
    pub axes: [Option<GuardFigures>; AXES],
    /// How faults end.
    pub reactions: Reactions,
}

impl<const AXES: usize> Guards<AXES> {
    /// The same reactions to fewer faults.
    #[must_use]
    pub fn limits_only(self) -> Self {
        Self { axes: [None; AXES], ..self }
    }

    /// Where the axes may go; an end beyond the kernel's range bounds nothing.
    #[must_use]
    pub fn travel(&self) -> Travel<AXES> {
        self.axes.map(|axis| {
            let [low, high] = axis?.travel_mm?.map(Position::from_mm);
            Some([low?, high?])
        })
    }
}

/// What is watched, in figures of any number type.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuardFigures {
    /// Greatest following error at rest \[mm\], > 0, at most the axis' limit.
    pub following_error_at_rest_mm: f64,
    /// What it may be greater for velocity \[mm per mm/s\], 0 or more.
    pub following_error_per_velocity_s: f64,
    /// What it may be greater for acceleration \[mm per mm/s²\], 0 or more.
    pub following_error_per_accel_s2: f64,
    /// Greatest second difference of the following error from tick to tick \[mm\], > 0.
    pub jump_mm: f64,
    /// The axis has to move where it is commanded to at this velocity \[mm/s\], > 0.
    pub moving_mm_s: f64,
    /// After so long at the latest \[s\], > 0.
    pub response_s: f64,
    /// Friction and load change the axis' velocity by less \[mm/s²\], > 0.
    pub load_accel_mm_s2: f64,
    /// Encoder's noise in either direction \[counts\].
    pub noise_counts: u16,
    /// How long the output may be at its limit \[s\], > 0.
    pub saturation_s: f64,
    /// Least and greatest set position \[mm\].
    pub travel_mm: Option<[f64; 2]>,
}
