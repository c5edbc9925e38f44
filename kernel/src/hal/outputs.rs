//! Spindle and coolant: outputs that a program switches while motion rests.
//!
//! Not called by the kernel's tick: the background switches between two stretches, in the program's order
//! ([`Switching`](crate::program::Switching)), and whoever finds a fault switches all off
//! ([`OutputState::OFF`]).

use serde::{Deserialize, Serialize};

/// Turning of the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Spindle {
    /// Not at all.
    #[default]
    Off,
    /// Clockwise, seen from the spindle towards the part.
    Clockwise,
    /// The other way round.
    Counterclockwise,
}

/// What spindle and coolant are to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OutputState {
    /// How the spindle turns.
    pub spindle: Spindle,
    /// Its commanded speed \[rev/min\], 0 or more; 0 if it does not turn. It may be 0 while the spindle turns: a
    /// program need not say a speed.
    pub speed_rpm: f64,
    /// Coolant as a flood.
    pub flood: bool,
    /// Coolant as a mist.
    pub mist: bool,
}

impl OutputState {
    /// Nothing turns or flows: before a program, and after a fault or an abort.
    pub const OFF: Self = Self { spindle: Spindle::Off, speed_rpm: 0.0, flood: false, mist: false };

    /// Whether the spindle is to turn.
    #[must_use]
    pub fn spindle_turns(&self) -> bool {
        self.spindle != Spindle::Off
    }

    /// Whether coolant is to flow, in whatever way.
    #[must_use]
    pub fn coolant_flows(&self) -> bool {
        self.flood || self.mist
    }
}

/// What a board has for spindle and coolant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub enum BoardOutputs {
    /// Nothing: programs that switch are refused.
    None,
    /// An output for a spindle that turns clockwise at the speed that is set at its drive. M4 and a second speed are
    /// refused.
    FixedSpeed,
    /// A spindle that turns both ways at the commanded speed.
    CommandedSpeed,
}

/// The outputs for spindle and coolant. A board without them refuses programs that switch before the start:
/// [`check`](crate::program::check()) does.
pub trait Outputs {
    /// Puts all outputs into a state. Does not wait for the spindle: the program has a dwell behind the switch. It
    /// cannot fail: what a drive of the spindle reports is an input.
    fn switch(&mut self, to: &OutputState);
}
