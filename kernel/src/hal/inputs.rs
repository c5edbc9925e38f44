//! The machine's digital inputs: drives' ready and fault lines, switches, emergency stop.
//!
//! Produced by a board once per tick, all axes at once; one byte per axis. Every input has its logical
//! meaning: the board inverts a switch that opens when it is reached, so a broken wire reads as reached.

use serde::{Deserialize, Serialize};

/// The digital inputs of one axis.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisInputs(u8);

impl AxisInputs {
    const READY: u8 = 1;
    const FAULT: u8 = 1 << 1;
    const LIMIT_LOW: u8 = 1 << 2;
    const LIMIT_HIGH: u8 = 1 << 3;
    const HOME: u8 = 1 << 4;

    /// The drive is ready, and no switch is reached.
    pub const HEALTHY: Self = Self(Self::READY);

    /// The same with the drive's ready line as given.
    #[must_use]
    pub const fn with_ready(self, is_ready: bool) -> Self {
        self.with(Self::READY, is_ready)
    }

    /// The same with the drive's fault line as given.
    #[must_use]
    pub const fn with_fault(self, is_fault: bool) -> Self {
        self.with(Self::FAULT, is_fault)
    }

    /// The same with the limit switch at the lower end of the travel as given.
    #[must_use]
    pub const fn with_limit_low(self, is_reached: bool) -> Self {
        self.with(Self::LIMIT_LOW, is_reached)
    }

    /// The same with the limit switch at the upper end of the travel as given.
    #[must_use]
    pub const fn with_limit_high(self, is_reached: bool) -> Self {
        self.with(Self::LIMIT_HIGH, is_reached)
    }

    /// The same with the home switch as given.
    #[must_use]
    pub const fn with_home(self, is_reached: bool) -> Self {
        self.with(Self::HOME, is_reached)
    }

    /// The drive is ready to move. Checked only while the drive is enabled and settled.
    #[must_use]
    pub(crate) const fn is_ready(self) -> bool {
        self.0 & Self::READY != 0
    }

    /// The drive reports a fault.
    #[must_use]
    pub(crate) const fn is_fault(self) -> bool {
        self.0 & Self::FAULT != 0
    }

    /// The limit switch at the lower end of the travel is reached.
    #[must_use]
    pub(crate) const fn is_limit_low(self) -> bool {
        self.0 & Self::LIMIT_LOW != 0
    }

    /// The limit switch at the upper end of the travel is reached.
    #[must_use]
    pub(crate) const fn is_limit_high(self) -> bool {
        self.0 & Self::LIMIT_HIGH != 0
    }

    /// The home switch is reached. No fault.
    #[must_use]
    pub const fn is_home(self) -> bool {
        self.0 & Self::HOME != 0
    }

    /// Nothing but the home switch differs from [`AxisInputs::HEALTHY`].
    #[must_use]
    pub(crate) const fn is_healthy(self) -> bool {
        self.0 & !Self::HOME == Self::READY
    }

    /// The byte, for records.
    #[must_use]
    pub const fn to_bits(self) -> u8 {
        self.0
    }

    /// The inputs of a recorded byte; unused bits are dropped.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & (Self::READY | Self::FAULT | Self::LIMIT_LOW | Self::LIMIT_HIGH | Self::HOME))
    }

    const fn with(self, bit: u8, is_set: bool) -> Self {
        if is_set { Self(self.0 | bit) } else { Self(self.0 & !bit) }
    }
}

impl Default for AxisInputs {
    fn default() -> Self {
        Self::HEALTHY
    }
}

impl core::fmt::Debug for AxisInputs {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("AxisInputs")
            .field("ready", &self.is_ready())
            .field("fault", &self.is_fault())
            .field("limit_low", &self.is_limit_low())
            .field("limit_high", &self.is_limit_high())
            .field("home", &self.is_home())
            .finish()
    }
}

/// The digital inputs of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MachineInputs<const AXES: usize> {
    /// Each axis.
    #[serde(with = "crate::array")]
    pub axes: [AxisInputs; AXES],
    /// The emergency stop is open.
    pub emergency_stop: bool,
}

impl<const AXES: usize> MachineInputs<AXES> {
    /// The inputs of a board without any: every drive ready, no switch reached, no emergency stop. Returned
    /// as a constant, it compiles to nothing.
    pub const HEALTHY: Self = Self { axes: [AxisInputs::HEALTHY; AXES], emergency_stop: false };

    /// Whether nothing except home switches differs from [`MachineInputs::HEALTHY`].
    #[inline]
    #[must_use]
    pub(crate) fn is_healthy(&self) -> bool {
        !self.emergency_stop && self.axes.iter().all(|axis| axis.is_healthy())
    }
}

impl<const AXES: usize> Default for MachineInputs<AXES> {
    fn default() -> Self {
        Self::HEALTHY
    }
}

/// The digital inputs of all axes and of the machine.
pub trait Inputs<const AXES: usize> {
    /// What can go wrong when the inputs are read.
    type Error;

    /// All inputs as they are now, debounced as far as needed. A board without inputs returns
    /// [`MachineInputs::HEALTHY`].
    ///
    /// # Errors
    /// The inputs could not be read.
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Self::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    type With = fn(AxisInputs, bool) -> AxisInputs;
    type Is = fn(AxisInputs) -> bool;

    /// Every bit is set and read by its own name and by no other.
    #[test]
    fn every_input_is_one_bit() {
        let inputs: [(With, Is); 5] = [
            (AxisInputs::with_ready, AxisInputs::is_ready),
            (AxisInputs::with_fault, AxisInputs::is_fault),
            (AxisInputs::with_limit_low, AxisInputs::is_limit_low),
            (AxisInputs::with_limit_high, AxisInputs::is_limit_high),
            (AxisInputs::with_home, AxisInputs::is_home),
        ];
        for all in 0..32_u8 {
            let mut made = AxisInputs::from_bits(!all);
            for (bit, (with, _)) in inputs.iter().enumerate() {
                made = with(made, all >> bit & 1 == 1);
            }
            assert_eq!((made.to_bits(), AxisInputs::from_bits(all | 0xE0)), (all, made));
            for (bit, (_, is)) in inputs.iter().enumerate() {
                assert_eq!(is(made), all >> bit & 1 == 1, "{made:?}");
            }
            assert_eq!(made.is_healthy(), made.with_home(false) == AxisInputs::HEALTHY);
        }
    }

    #[test]
    fn a_home_switch_alone_is_healthy() {
        let mut inputs = MachineInputs::<2>::HEALTHY;
        inputs.axes[1] = AxisInputs::HEALTHY.with_home(true);
        assert!(inputs.is_healthy());
        assert!(!MachineInputs { emergency_stop: true, ..inputs }.is_healthy());
        inputs.axes[1] = inputs.axes[1].with_limit_high(true);
        assert!(!inputs.is_healthy());
    }
}
