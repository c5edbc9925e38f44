//! A machine of simulated axes behind DAC chips, as the kernel's hardware.
//!
//! Consumes the chips' voltages and the drive enable; produces encoder counts, all axes at once. One
//! [`SimMachine::advance`] is one control tick; its cost is constant: axes × sub-steps.
//!
//! Everything goes through a shared reference, as on a board where several peripherals connect to the same
//! machine: `&machine` is the kernel's encoder and its drive enable, `machine.chip()` is the SPI device of
//! its DAC driver, and the simulation advances the machine between two ticks. It is meant for one thread.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;

use motion_kernel::hal::{DriveEnable, Encoder, Inputs, MachineInputs};
use motion_kernel::units::Counts;

use crate::axis::{AxisParameters, SimAxis};
use crate::dac_chip::{Ad5754Chip, CHANNELS};
use crate::parameter::{ParameterError, positive};

/// Control tick of the reference machine \[s\] (S4).
pub const REFERENCE_TICK_S: f64 = 0.0005;

/// Sub-steps of the reference machine's tick.
pub const REFERENCE_SUBSTEPS: u32 = 20;

/// Number of cells that is enough for the reference machine's dead time of 1.42 ms in steps of 25 µs.
pub const REFERENCE_LINE: usize = 64;

/// A machine. Immutable once given to a [`SimMachine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineParameters<const AXES: usize> {
    /// The axes, on the DAC's channels from A upwards; each four have a chip.
    pub axes: [AxisParameters; AXES],
    /// Control tick \[s\], > 0.
    pub tick_s: f64,
    /// Simulation steps per tick, from 1 to [`SUBSTEPS_MAX`](crate::SUBSTEPS_MAX).
    pub substeps: u32,
}

impl<const AXES: usize> MachineParameters<AXES> {
    /// `axes` at the reference tick of 0.5 ms in 20 sub-steps.
    #[must_use]
    pub const fn at_reference_tick(axes: [AxisParameters; AXES]) -> Self {
        Self { axes, tick_s: REFERENCE_TICK_S, substeps: REFERENCE_SUBSTEPS }
    }
}

/// An axis of a machine cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineError {
    /// The axis, from 0.
    pub axis: usize,
    /// What is wrong with it, or with the tick.
    pub cause: ParameterError,
}

impl core::fmt::Display for MachineError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "axis {}: {}", self.axis, self.cause)
    }
}

impl core::error::Error for MachineError {}

/// The true state of an axis, which only a simulation knows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisTruth {
    /// Position of the load \[mm\].
    pub position_mm: f64,
    /// Position of the motor \[mm\], which the encoder reads: another one only through errors of the screw.
    pub motor_mm: f64,
    /// Velocity of the motor \[mm/s\].
    pub velocity_mm_s: f64,
    /// Torque, as the acceleration it gives the unloaded axis \[mm/s²\].
    pub torque_mm_s2: f64,
    /// Displacement of the bed under the axis \[mm\].
    pub bed_mm: f64,
}

/// Simulated axes and their DACs: up to four axes to a chip. More axes do not compile:
///
/// ```compile_fail,E0080
/// use hal_sim::{AxisParameters, MachineParameters, SimMachine};
/// let parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X; 5]);
/// let _ = SimMachine::<5>::new(&parameters);
/// ```
#[derive(Debug)]
pub struct SimMachine<const AXES: usize, const LINE: usize = REFERENCE_LINE, const CHIPS: usize = 1> {
    chips: [Ad5754Chip; CHIPS],
    axes: RefCell<[SimAxis<LINE>; AXES]>,
    is_enabled: Cell<bool>,
    tick_ns: u64,
    ticks: Cell<u64>,
}

impl<const AXES: usize, const LINE: usize, const CHIPS: usize> SimMachine<AXES, LINE, CHIPS> {
    const AXES_FIT: () = assert!(AXES >= 1 && AXES <= CHIPS * CHANNELS, "a DAC has four channels");

    /// A machine at rest, drives disabled, its chips just powered on.
    ///
    /// # Errors
    /// The first axis that cannot be simulated and why.
    pub fn new(parameters: &MachineParameters<AXES>) -> Result<Self, MachineError> {
        let () = Self::AXES_FIT;
        let &MachineParameters { axes, tick_s, substeps } = parameters;
        positive("tick_s", tick_s).map_err(|cause| MachineError { axis: 0, cause })?;
        let build = |axis: usize, parameters: AxisParameters| {
            SimAxis::<LINE>::new(parameters, tick_s, substeps).map_err(|cause| MachineError { axis, cause })
        };
        // Without allocation an array is filled by a fallible function only over something already there.
        let first = build(0, axes[0])?;
        let mut built: [SimAxis<LINE>; AXES] = core::array::from_fn(|_| first.clone());
        for (axis, (place, parameters)) in built.iter_mut().zip(axes).enumerate().skip(1) {
            *place = build(axis, parameters)?;
        }
        Ok(Self {
            chips: [const { Ad5754Chip::new() }; CHIPS],
            axes: RefCell::new(built),
            is_enabled: Cell::new(false),
            tick_ns: (tick_s * 1e9) as u64,
            ticks: Cell::new(0),
        })
    }

    /// The DAC chip of the first four axes: the SPI device of the velocity output's driver.
    #[must_use]
    pub fn chip(&self) -> &Ad5754Chip {
        &self.chips[0]
    }

    /// The DAC chips that have axes, each of the four that follow those of the chip before.
    #[must_use]
    pub fn chips(&self) -> &[Ad5754Chip] {
        &self.chips[..AXES.div_ceil(CHANNELS)]
    }

    /// One control tick: the chips' present voltages act on the drives until the next call.
    pub fn advance(&self) {
        // It can: nothing here is called from within. Without the panic of `borrow_mut`, for images that have none.
        let Ok(mut axes) = self.axes.try_borrow_mut() else { return };
        for (axes, chip) in axes.chunks_mut(CHANNELS).zip(&self.chips) {
            for (axis, output_v) in axes.iter_mut().zip(chip.volts()) {
                axis.advance(output_v, self.is_enabled.get());
            }
            chip.elapse_ns(self.tick_ns);
        }
        self.ticks.set(self.ticks.get() + 1);
    }

    /// Ticks since the start.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.ticks.get()
    }

    /// Whether the drives are enabled.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        self.is_enabled.get()
    }

    /// Reverses the drive of an axis; a second call restores it.
    pub fn reverse_drive(&self, axis: usize) {
        if let Some(axis) = self.axes.borrow_mut().get_mut(axis) {
            axis.reverse_drive();
        }
    }

    /// Sets another current limit of an axis' drive \[mm/s²\], > 0.
    pub fn limit_drive(&self, axis: usize, accel_limit_mm_s2: f64) {
        if let Some(axis) = self.axes.borrow_mut().get_mut(axis) {
            axis.limit_drive(accel_limit_mm_s2);
        }
    }

    /// The true position of an axis' load, for switches there \[mm\]; none if there is no such axis. Without a panic, for images that
    /// have none.
    #[must_use]
    pub fn position_mm(&self, axis: usize) -> Option<f64> {
        let axes = self.axes.try_borrow().ok()?;
        Some(axes.get(axis)?.load_mm())
    }

    /// The true state of all axes, for tests and records.
    #[must_use]
    pub fn truth(&self) -> [AxisTruth; AXES] {
        let axes = self.axes.borrow();
        core::array::from_fn(|axis| {
            let drive = axes[axis].drive();
            AxisTruth {
                position_mm: axes[axis].load_mm(),
                motor_mm: drive.position_mm(),
                velocity_mm_s: drive.velocity_mm_s(),
                torque_mm_s2: drive.torque_mm_s2(),
                bed_mm: drive.bed_mm(),
            }
        })
    }
}

impl<const AXES: usize, const LINE: usize, const CHIPS: usize> Encoder<AXES>
    for &SimMachine<AXES, LINE, CHIPS>
{
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        let mut counts = [Counts(0); AXES];
        // As in `advance`.
        if let Ok(mut axes) = self.axes.try_borrow_mut() {
            for (counts, axis) in counts.iter_mut().zip(&mut *axes) {
                *counts = axis.latch();
            }
        }
        Ok(counts)
    }
}

impl<const AXES: usize, const LINE: usize, const CHIPS: usize> Inputs<AXES>
    for &SimMachine<AXES, LINE, CHIPS>
{
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        Ok(MachineInputs::HEALTHY)
    }
}

impl<const AXES: usize, const LINE: usize, const CHIPS: usize> DriveEnable<AXES>
    for &SimMachine<AXES, LINE, CHIPS>
{
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.is_enabled.set(enabled);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::hal::{Ad5754Output, VelocityChannel};
    use motion_kernel::units::DacCode;

    use super::*;
    use crate::{DriveParameters, REFERENCE_Y};

    #[test]
    fn a_refusal_names_the_axis() {
        let slow = DriveParameters { dead_time_s: 0.002, ..REFERENCE_Y };
        let axes =
            [AxisParameters::REFERENCE_X, AxisParameters { drive: slow, ..AxisParameters::REFERENCE_Y }];
        let refusal = SimMachine::<2>::new(&MachineParameters::at_reference_tick(axes)).unwrap_err();
        let cause = ParameterError::LineTooShort { cells_needed: 82, capacity: REFERENCE_LINE };
        assert_eq!(refusal, MachineError { axis: 1, cause });
    }

    #[test]
    fn axes_keep_their_own_parameters() {
        let apart = |start_position_mm| AxisParameters { start_position_mm, ..AxisParameters::REFERENCE_X };
        let axes = [apart(1.0), apart(2.0), apart(3.0)];
        let machine = SimMachine::<3>::new(&MachineParameters::at_reference_tick(axes)).unwrap();
        assert_eq!((&machine).latch(), Ok([Counts(10_000), Counts(20_000), Counts(30_000)]));
    }

    #[test]
    fn each_four_axes_have_a_chip() {
        let parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X; 6]);
        let machine = SimMachine::<6, REFERENCE_LINE, 3>::new(&parameters).unwrap();
        let [first, second] = machine.chips() else { panic!("{} chips", machine.chips().len()) };
        let _first = Ad5754Output::<_, 4>::setup(first, &mut &*first).unwrap();
        let mut second = Ad5754Output::<_, 4>::setup(second, &mut &*second).unwrap();
        (&machine).set_enabled(true).unwrap();
        second.write(&[DacCode::ZERO, DacCode(1000), DacCode::ZERO, DacCode::ZERO]).unwrap();
        for _ in 0..100 {
            machine.advance();
        }
        let moved = machine.truth().map(|axis| axis.position_mm > 0.1);
        assert_eq!(moved, [false, false, false, false, false, true]);
    }
}
