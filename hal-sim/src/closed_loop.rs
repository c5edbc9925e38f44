//! A compiled program in closed loop: supply, streams, kernel and simulated machine, tick by tick.
//!
//! The same code on a PC and inside an emulated board, so that two digests can be compared. The converter is
//! driven after the tick, from memory, so that a tick can be measured alone and its cost is the kernel's:
//! [`InMemory`] holds what a board's interrupt would exchange with its peripherals.
//!
//! [`Producer::fill`] is the background's part, [`ClosedLoop::tick`] the interrupt's. The module `live` has
//! another background, with the same program under live control.

#[cfg(feature = "live")]
pub mod live;

use core::convert::Infallible;

use motion_kernel::axis::{AxesConfig, AxesError, Correction, CorrectionError};
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{
    Ad5754Error, Ad5754Output, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel,
};
use motion_kernel::kernel::{CorrectedIntake, Kernel};
use motion_kernel::num::Real;
use motion_kernel::program::{Header, Items, ProgramError, Reader, Supply, SupplyError};
use motion_kernel::queue::{Feeder, Intake, Streams};
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode};

use crate::axis::AxisParameters;
use crate::dac_chip::{Ad5754Chip, ChipError};
use crate::drive_parameters::{REFERENCE_X, REFERENCE_Y};
use crate::encoder::{EncoderParameters, REFERENCE_ENCODER};
use crate::machine::{MachineParameters, SimMachine};
#[cfg(feature = "screw")]
use crate::screw::ScrewParameters;

/// The reference drives with a program's scales: the first axis is S4's X, the second its Y, all others are
/// like X.
#[must_use]
pub fn reference_machine<const AXES: usize>(header: &Header<AXES>, substeps: u32) -> MachineParameters<AXES> {
    let mut drives = [REFERENCE_X; AXES];
    if let Some(second) = drives.get_mut(1) {
        *second = REFERENCE_Y;
    }
    let axes = core::array::from_fn(|axis| AxisParameters {
        drive: drives[axis],
        #[cfg(feature = "screw")]
        screw: ScrewParameters::default(),
        encoder: EncoderParameters { resolution_mm: header.axes[axis].mm_per_count, ..REFERENCE_ENCODER },
        mm_s_per_volt: header.axes[axis].mm_s_at_10_v / DacCode::FULL_SCALE_V,
        start_position_mm: 0.0,
    });
    MachineParameters { axes, tick_s: header.tick_s, substeps }
}

/// The values that a tick exchanges with its peripherals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InMemory<const AXES: usize> {
    /// The encoders' readings when the tick began.
    pub counts: [Counts; AXES],
    /// The codes that the tick wrote.
    pub codes: [DacCode; AXES],
    /// The last command to the drives, if any.
    pub enabled: Option<bool>,
}

impl<const AXES: usize> Encoder<AXES> for InMemory<AXES> {
    type Error = Infallible;

    #[inline]
    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        Ok(self.counts)
    }
}

/// Without inputs.
impl<const AXES: usize> Inputs<AXES> for InMemory<AXES> {
    type Error = Infallible;

    #[inline]
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        Ok(MachineInputs::HEALTHY)
    }
}

impl<const AXES: usize> VelocityChannel<AXES> for InMemory<AXES> {
    type Error = Infallible;

    #[inline]
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Infallible> {
        self.codes = *codes;
        Ok(())
    }
}

impl<const AXES: usize> DriveEnable<AXES> for InMemory<AXES> {
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
    Axes(AxesError),
    /// The program's machine has compensation, which this loop has not.
    Compensated,
    /// The program's guards can't be read.
    #[cfg(feature = "live")]
    Program(ProgramError),
    /// The converter refused its configuration.
    Converter(Ad5754Error<ChipError>),
}

/// The background's part: keeps the streams full.
pub struct Producer<'a, R: Real, const AXES: usize> {
    feeder: Feeder<'a, R, AXES>,
    supply: Supply<R, AXES, Items<'a, AXES>, ProgramError>,
}

impl<R: Real, const AXES: usize> Producer<'_, R, AXES> {
    /// Fills the streams; true if nothing is left to come.
    ///
    /// # Errors
    /// The program holds an item that can't be executed.
    // In its own stack frame, like the tick: 16 KiB have no room for both at once.
    #[inline(never)]
    pub fn fill(&mut self) -> Result<bool, SupplyError<ProgramError>> {
        self.supply.fill(&mut self.feeder).map(|()| self.supply.is_empty())
    }
}

/// The interrupt's part.
pub struct ClosedLoop<'a, R: Real, const AXES: usize, const LINE: usize> {
    kernel: Kernel<R, AXES>,
    intake: CorrectedIntake<'a, R, AXES>,
    machine: &'a SimMachine<AXES, LINE>,
    outputs: Ad5754Output<&'a Ad5754Chip, AXES>,
    memory: InMemory<AXES>,
}

/// Both parts of a loop.
pub type Closed<'a, R, const AXES: usize, const LINE: usize> =
    (Producer<'a, R, AXES>, ClosedLoop<'a, R, AXES, LINE>);

/// Closes the loop of a program over `machine`, drives enabled.
///
/// In steps with their own stack frames: a board with 16 KiB has no room for several copies at once.
///
/// # Errors
/// The program's machine can't be regulated or simulated.
#[inline(never)]
pub fn close<
    'a,
    R: Real,
    const AXES: usize,
    const PIECES: usize,
    const SEGMENTS: usize,
    const LINE: usize,
>(
    program: &Reader<'a, AXES>,
    streams: &'a mut Streams<R, AXES, PIECES, SEGMENTS>,
    machine: &'a SimMachine<AXES, LINE>,
) -> Result<Closed<'a, R, AXES, LINE>, LoopError> {
    if program.is_compensated() {
        return Err(LoopError::Compensated);
    }
    let config = &regulated(program.header());
    let config = config.as_ref().map_err(|error| *error)?;
    let &Header { tick_s, rules, start, .. } = program.header();
    let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip()).map_err(LoopError::Converter)?;
    let Ok(counts) = (&*machine).latch();
    let (feeder, intake) = streams.split(rules, start);
    let supply = Supply::new(program.items(), tick_s);
    let memory = InMemory { counts, codes: [DacCode::ZERO; AXES], enabled: None };
    let mut kernel = Kernel::new(config, start, counts);
    kernel.enable(0);
    let intake = intake.into();
    Ok((Producer { feeder, supply }, ClosedLoop { kernel, intake, machine, outputs, memory }))
}

#[inline(never)]
fn regulated<R: Real, const AXES: usize>(header: &Header<AXES>) -> Result<AxesConfig<R, AXES>, LoopError> {
    AxesConfig::new(&header.axes, header.tick_s).map_err(LoopError::Axes)
}

/// Arbitrary knots of a correction, for runs that are compared with each other \[mm/s\].
#[must_use]
pub fn some_knots<R: Real, const AXES: usize>() -> [[R; AXES]; 4] {
    [0.0, 0.625, -0.375, 0.25]
        .map(|mm_s| core::array::from_fn(|axis| R::from_f64(mm_s * (1.0 + axis as f64))))
}

impl<'a, R: Real, const AXES: usize, const LINE: usize> ClosedLoop<'a, R, AXES, LINE> {
    /// Corrects the second stretch by `knots`, 40 ticks from one to the next.
    ///
    /// # Errors
    /// A knot is above 4 mm/s.
    pub fn correct(&mut self, knots_mm_s: &'a [[R; AXES]]) -> Result<(), CorrectionError> {
        self.intake.correct(Correction::new(1, knots_mm_s, 40, 4.0)?)
    }

    /// One tick of the kernel and of the machine. A program stop is resumed at once.
    #[inline(never)]
    pub fn tick(&mut self) -> Trace<R, AXES> {
        self.advance(|kernel, intake, memory| *kernel.tick_corrected(intake, memory))
    }

    /// The same with the kernel's tick called by `tick`, to measure it; without the correction.
    pub fn tick_by(
        &mut self,
        tick: impl FnOnce(&mut Kernel<R, AXES>, &mut Intake<'a, R, AXES>, &mut InMemory<AXES>) -> Trace<R, AXES>,
    ) -> Trace<R, AXES> {
        self.advance(|kernel, intake, memory| tick(kernel, intake.bare(), memory))
    }

    #[inline]
    fn advance(
        &mut self,
        tick: impl FnOnce(
            &mut Kernel<R, AXES>,
            &mut CorrectedIntake<'a, R, AXES>,
            &mut InMemory<AXES>,
        ) -> Trace<R, AXES>,
    ) -> Trace<R, AXES> {
        let mut machine = self.machine;
        let Ok(counts) = machine.latch();
        self.memory.counts = counts;
        let trace = tick(&mut self.kernel, &mut self.intake, &mut self.memory);
        if let Some(enabled) = self.memory.enabled.take() {
            let Ok(()) = machine.set_enabled(enabled);
        }
        // The emulated bus fails only if a test tells it to.
        let written = self.outputs.write(&self.memory.codes);
        debug_assert!(written.is_ok());
        machine.advance();
        if trace.executed.state == ExecState::Stopped {
            self.kernel.resume();
        }
        trace
    }
}
