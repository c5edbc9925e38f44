//! A compiled program in closed loop: supply, streams, kernel and simulated machine, tick by tick.
//!
//! The same code on a PC and inside an emulated board, so that two digests can be compared. The converter
//! is driven after the tick, from memory, so that a tick alone can be measured and a loop's cost is the
//! kernel's: [`InMemory`] is what a board's interrupt would exchange with its peripherals.
//!
//! [`Producer::fill`] is the background's part, [`ClosedLoop::tick`] the interrupt's.

use core::convert::Infallible;

use motion_kernel::axis::{AxisConfig, ScaleError};
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{Ad5754Error, Ad5754Output, DriveEnable, Encoder, VelocityChannel};
use motion_kernel::kernel::Kernel;
use motion_kernel::num::Real;
use motion_kernel::program::{Header, ProgramError, Reader, Supply, SupplyError};
use motion_kernel::queue::{Feeder, Intake, Streams};
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use crate::axis::AxisParameters;
use crate::dac_chip::{Ad5754Chip, ChipError};
use crate::drive_parameters::{DriveParameters, REFERENCE_X, REFERENCE_Y, REFERENCE_Z};
use crate::encoder::{EncoderParameters, REFERENCE_ENCODER};
use crate::machine::{MachineParameters, SimMachine};

/// Axes of a closed loop.
pub const LOOP_AXES: usize = 3;

/// The reference drives behind a program's scales.
#[must_use]
pub fn reference_machine(header: &Header<LOOP_AXES>, substeps: u32) -> MachineParameters<LOOP_AXES> {
    let [x, y, z] = header.axes;
    let axis = |drive: DriveParameters, figures: motion_kernel::axis::AxisFigures| AxisParameters {
        drive,
        encoder: EncoderParameters { resolution_mm: figures.mm_per_count, ..REFERENCE_ENCODER },
        mm_s_per_volt: figures.mm_s_at_10_v / DacCode::FULL_SCALE_V,
        start_position_mm: 0.0,
    };
    MachineParameters {
        axes: [axis(REFERENCE_X, x), axis(REFERENCE_Y, y), axis(REFERENCE_Z, z)],
        tick_s: header.tick_s,
        substeps,
    }
}

/// What a tick exchanges with its peripherals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InMemory {
    /// As the encoders read when the tick began.
    pub counts: [Counts; LOOP_AXES],
    /// As the tick wrote.
    pub codes: [DacCode; LOOP_AXES],
    /// As the tick told the drives, if it did.
    pub enabled: Option<bool>,
}

impl Encoder<LOOP_AXES> for InMemory {
    type Error = Infallible;

    #[inline]
    fn latch(&mut self) -> Result<[Counts; LOOP_AXES], Infallible> {
        Ok(self.counts)
    }
}

impl VelocityChannel<LOOP_AXES> for InMemory {
    type Error = Infallible;

    #[inline]
    fn write(&mut self, codes: &[DacCode; LOOP_AXES]) -> Result<(), Infallible> {
        self.codes = *codes;
        Ok(())
    }
}

impl DriveEnable<LOOP_AXES> for InMemory {
    type Error = Infallible;

    #[inline]
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.enabled = Some(enabled);
        Ok(())
    }
}

/// Why a loop can't be closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoopError {
    /// An axis can't be regulated.
    Scale(ScaleError),
    /// The converter refused its configuration.
    Converter(Ad5754Error<ChipError>),
}

/// The background's part: keeps the streams full.
pub struct Producer<'a, R: Real> {
    feeder: Feeder<'a, R, LOOP_AXES>,
    supply: Supply<R, LOOP_AXES, Reader<'a, LOOP_AXES>>,
}

impl<R: Real> Producer<'_, R> {
    /// Fills the streams; true if nothing is left to come.
    ///
    /// # Errors
    /// The program holds an item that can't be executed.
    pub fn fill(&mut self) -> Result<bool, SupplyError<ProgramError>> {
        self.supply.fill(&mut self.feeder).map(|()| self.supply.is_empty())
    }
}

/// The interrupt's part.
pub struct ClosedLoop<'a, R: Real, const LINE: usize> {
    kernel: Kernel<R, LOOP_AXES>,
    intake: Intake<'a, R, LOOP_AXES>,
    machine: &'a SimMachine<LOOP_AXES, LINE>,
    outputs: Ad5754Output<&'a Ad5754Chip, LOOP_AXES>,
    memory: InMemory,
}

/// Closes the loop of a program over `machine`, drives enabled.
///
/// # Errors
/// The program's machine can't be regulated or simulated.
pub fn close<'a, R: Real, const PIECES: usize, const SEGMENTS: usize, const LINE: usize>(
    program: Reader<'a, LOOP_AXES>,
    streams: &'a mut Streams<R, LOOP_AXES, PIECES, SEGMENTS>,
    machine: &'a SimMachine<LOOP_AXES, LINE>,
) -> Result<(Producer<'a, R>, ClosedLoop<'a, R, LINE>), LoopError> {
    let &Header { tick_s, rules, axes: [x, y, z], start } = program.header();
    let config = |figures| AxisConfig::new(&figures, tick_s).map_err(LoopError::Scale);
    let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip()).map_err(LoopError::Converter)?;
    let Ok(counts) = (&*machine).latch();
    let mut kernel = Kernel::new([config(x)?, config(y)?, config(z)?], start, counts);
    kernel.enable(0);
    let (feeder, intake) = streams.split(rules, start);
    let supply = Supply::new(program, tick_s);
    let memory = InMemory::default();
    Ok((Producer { feeder, supply }, ClosedLoop { kernel, intake, machine, outputs, memory }))
}

impl<R: Real, const LINE: usize> ClosedLoop<'_, R, LINE> {
    /// One tick of the kernel and of the machine. A program stop is resumed at once.
    pub fn tick(&mut self) -> Trace<R, LOOP_AXES> {
        self.tick_by(|kernel, intake, memory| *kernel.tick(intake, memory))
    }

    /// The same with the kernel's tick called by `tick`, to measure it.
    pub fn tick_by(
        &mut self,
        tick: impl FnOnce(
            &mut Kernel<R, LOOP_AXES>,
            &mut Intake<'_, R, LOOP_AXES>,
            &mut InMemory,
        ) -> Trace<R, LOOP_AXES>,
    ) -> Trace<R, LOOP_AXES> {
        let mut machine = self.machine;
        let Ok(counts) = machine.latch();
        self.memory.counts = counts;
        let trace = tick(&mut self.kernel, &mut self.intake, &mut self.memory);
        if let Some(enabled) = self.memory.enabled.take() {
            let Ok(()) = machine.set_enabled(enabled);
        }
        // The emulated bus fails only where a test tells it to.
        let written = self.outputs.write(&self.memory.codes);
        debug_assert!(written.is_ok());
        machine.advance();
        if trace.executed.state == ExecState::Stopped {
            self.kernel.resume();
        }
        trace
    }
}
