//! Limit and home switches of the axes.
//!
//! Consumes nine inputs per tick; produces the kernel's. A few register accesses. Inputs have pull-ups, and low is
//! a switch that is not reached: it opens when the axis comes to it. So a broken wire reads as reached.

use motion_kernel::hal::{AxisInputs, MachineInputs};
use nucleo_f446re::machine::AXES;
use stm32f4xx_hal::gpio::{Input, PA4, PA9, PB0, PC0, PC1, PC2, PC3, PC4, PC7};

/// The wires of each axis: the limits at the lower and upper end of its travel, and the home switch.
pub(crate) struct Switches {
    pub(crate) x: (PC0<Input>, PC1<Input>, PC2<Input>),
    pub(crate) y: (PC3<Input>, PC4<Input>, PC7<Input>),
    pub(crate) z: (PA4<Input>, PB0<Input>, PA9<Input>),
}

impl Switches {
    /// All of them, now. Drives and emergency stop are the board's own ([`Drives`](crate::drives::Drives)).
    #[inline]
    pub(crate) fn read(&self) -> MachineInputs<AXES> {
        let Self { x, y, z } = self;
        let axes = [
            axis(x.0.is_high(), x.1.is_high(), x.2.is_high()),
            axis(y.0.is_high(), y.1.is_high(), y.2.is_high()),
            axis(z.0.is_high(), z.1.is_high(), z.2.is_high()),
        ];
        MachineInputs { axes, emergency_stop: false }
    }
}

#[inline]
fn axis(is_low: bool, is_high: bool, is_home: bool) -> AxisInputs {
    AxisInputs::HEALTHY.with_limit_low(is_low).with_limit_high(is_high).with_home(is_home)
}
