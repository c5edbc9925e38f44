//! The modules assembled: one call per tick.
//!
//! ```text
//! encoders, inputs ─► latch ─► executor ─► axis regulators ─► converter codes ─► outputs
//! ```
//!
//! The kernel starts disabled and does nothing to the drives until [`Kernel::enable`]. Then it holds the
//! machine where it stands for the time that drives and brakes need, and only then executes the streams.
//!
//! A fault ends in one defined way: it is latched with the tick it was found in, every output goes to the
//! voltage of standing still (0 V plus trim), the drives are disabled, and both stay so until
//! [`Kernel::clear_fault`]. A fault raised while writing the outputs takes effect on them one tick later. How
//! the outputs come to 0 V is the fault's [reaction](crate::fault::Reaction): on the path or along a ramp,
//! with the feature `guards` and if the machine allows time for it; else at once. The first fault stays
//! latched, but a later one may ask for a more urgent reaction.

mod corrected_intake;
#[cfg(all(test, feature = "guards"))]
mod endings;
#[cfg(feature = "guards")]
mod guarded;
#[cfg(not(feature = "guards"))]
#[path = "kernel/unguarded.rs"]
mod guarded;
#[cfg(feature = "live")]
mod reference;
#[cfg(feature = "scope")]
mod state;

use serde::{Deserialize, Serialize};

use crate::axis::{AxesConfig, AxisConfig, AxisOutput, AxisState, Correction, Preview};
use crate::exec::{ExecState, Executor};
use crate::fault::Reaction;
use crate::fault::{Fault, FaultKind, axis_bit};
use crate::hal::{AxisInputs, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use crate::num::Real;
use crate::queue::Intake;
use crate::trace::Trace;
use crate::units::{Counts, DacCode, Position};
pub use corrected_intake::CorrectedIntake;
use guarded::{Ending, Guards};
#[cfg(feature = "scope")]
pub use state::KernelState;

/// Whether the drives may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Power {
    Off,
    /// Enabled, and still held for this many ticks.
    Starting {
        ticks_left: u32,
    },
    On,
    /// In a fault whose reaction takes time.
    Ending(Ending),
}

impl Power {
    /// Whether the executor continues.
    #[inline]
    fn executes(self) -> bool {
        match self {
            Self::On => true,
            Self::Ending(ending) => ending.executes(),
            Self::Off | Self::Starting { .. } => false,
        }
    }

    /// Whether the axes are regulated.
    #[inline]
    fn regulates(self) -> bool {
        match self {
            Self::Off => false,
            Self::Starting { .. } | Self::On => true,
            Self::Ending(ending) => ending.regulates(),
        }
    }
}

/// The real-time motion kernel of a machine with `AXES` axes.
// In this order: the fields that a tick uses most lie within reach of the core's short addresses.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Kernel<R: Real, const AXES: usize> {
    power: Power,
    /// What the drives were last told; `None` before the first time and after a failure.
    told: Option<bool>,
    executor: Executor<R, AXES>,
    /// The trace of the latest tick; the next one continues from it.
    trace: Trace<R, AXES>,
    axes: [AxisState<R>; AXES],
    config: [AxisConfig<R>; AXES],
    preview: Preview<AXES>,
    guards: Guards<AXES>,
    /// Axes whose encoder failed since their last reference, the lowest bit is the first one's. No tick follows from it.
    without_counts: u32,
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// A kernel at rest at `position`, where the encoders read `counts`, drives disabled.
    #[must_use]
    pub fn new(config: &AxesConfig<R, AXES>, position: [Position; AXES], counts: [Counts; AXES]) -> Self {
        let &AxesConfig { axes: ref config, preview_ticks, reactions } = config;
        let (mut axes, mut outputs) = ([AxisState::default(); AXES], [AxisOutput::default(); AXES]);
        let of_axes = axes.iter_mut().zip(&mut outputs).zip(config).zip(counts.iter().zip(&position));
        for (((axis, output), config), (&counts, &position)) in of_axes {
            (output.counts, output.set) = (counts, position);
            axis.set_position(config, counts, position);
        }
        let executor = Executor::new(position);
        // The first tick is number 0. In one expression: 16 KiB have no room for a copy.
        let trace = Trace {
            tick: u64::MAX,
            executed: executor.resting(),
            axes: outputs,
            inputs: MachineInputs::HEALTHY,
            fault: None,
        };
        Self {
            config: *config,
            executor,
            preview: Preview::new(preview_ticks, position),
            axes,
            power: Power::Off,
            told: None,
            trace,
            guards: Guards::new(reactions),
            without_counts: 0,
        }
    }

    /// Enables the drives with the next tick, holds the machine still for `settle_ticks` ticks (for brakes
    /// and relays), then executes the streams. Without effect in a fault.
    ///
    /// Drops a stretch that was cut off in the middle, as [`Kernel::stand_here`] does.
    pub fn enable(&mut self, settle_ticks: u32) {
        if self.trace.fault.is_none() && self.power == Power::Off {
            if !self.executor.is_at_rest() {
                self.stand_here();
            }
            for axis in &mut self.axes {
                axis.restart_guard();
            }
            self.power = Power::Starting { ticks_left: settle_ticks };
        }
    }

    /// Disables the drives with the next tick, wherever the machine is. The motion under way is lost:
    /// continue with [`Kernel::stand_here`] and new streams.
    pub fn disable(&mut self) {
        self.power = Power::Off;
    }

    /// Latches a fault that the board has found (an input, a missed tick), in the next tick, whose outputs
    /// already are those of a fault. Without effect if there is a fault already.
    pub fn trip(&mut self, kind: FaultKind<R>) {
        self.latch_fault_in(self.trace.tick.wrapping_add(1), kind);
    }

    /// One control tick: reads the encoders and inputs, executes the streams, regulates every axis, writes
    /// the outputs. Call it only from the tick's interrupt. Its trace stays readable until the next tick.
    #[inline]
    pub fn tick<H>(&mut self, intake: &mut Intake<'_, R, AXES>, hal: &mut H) -> &Trace<R, AXES>
    where
        H: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES>,
    {
        self.tick_with(intake, None, hal)
    }

    /// [`Kernel::tick`] with the learnt correction of a stretch added to feedforward while that stretch is
    /// driven.
    #[inline]
    pub fn tick_corrected<H>(
        &mut self,
        intake: &mut CorrectedIntake<'_, R, AXES>,
        hal: &mut H,
    ) -> &Trace<R, AXES>
    where
        H: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES>,
    {
        let CorrectedIntake { intake, correction } = intake;
        self.tick_with(intake, correction.as_mut(), hal)
    }

    #[inline]
    fn tick_with<H>(
        &mut self,
        intake: &mut Intake<'_, R, AXES>,
        correction: Option<&mut Correction<'_, R, AXES>>,
        hal: &mut H,
    ) -> &Trace<R, AXES>
    where
        H: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES>,
    {
        self.trace.tick = self.trace.tick.wrapping_add(1);
        match hal.latch() {
            Ok(counts) => {
                for (output, counts) in self.trace.axes.iter_mut().zip(counts) {
                    output.counts = counts;
                }
            }
            Err(_) => self.latch_fault(FaultKind::Encoder),
        }
        match hal.read_inputs() {
            Ok(inputs) => {
                // Without guards, keeping healthy inputs is not worth the instructions.
                if Guards::<AXES>::KEEP_INPUTS || !inputs.is_healthy() {
                    let before = core::mem::replace(&mut self.trace.inputs, inputs);
                    if !inputs.is_healthy() {
                        self.judge_inputs(&before);
                    }
                }
            }
            Err(_) => self.latch_fault(FaultKind::Inputs),
        }
        self.execute(intake);
        self.regulate(correction);
        let mut local = [DacCode::ZERO; AXES];
        let codes = self.guards.written(&mut local);
        for (code, axis) in codes.iter_mut().zip(&self.trace.axes) {
            *code = axis.code;
        }
        if hal.write(codes).is_err() {
            self.latch_fault(FaultKind::Output);
        }
        // Repeated until the drives have accepted it, which matters most when they are to be disabled.
        let enable = self.power != Power::Off;
        if self.told != Some(enable) {
            self.told = hal.set_enabled(enable).is_ok().then_some(enable);
            if self.told.is_none() {
                self.latch_fault(FaultKind::Enable);
            }
        }
        &self.trace
    }

    #[inline]
    fn execute(&mut self, intake: &mut Intake<'_, R, AXES>) {
        match &mut self.power {
            Power::Starting { ticks_left: 0 } => self.power = Power::On,
            Power::Starting { ticks_left } => *ticks_left -= 1,
            Power::Off | Power::On | Power::Ending(_) => {}
        }
        if self.power.executes()
            && let Err(fault) = self.executor.tick_into(intake, &mut self.trace.executed)
        {
            self.latch_fault(FaultKind::Executor(fault));
        }
        self.continue_stop(intake);
    }

    /// The outputs of all axes. With the drives off they stand still, and regulators and peaks keep their
    /// values.
    #[inline]
    fn regulate(&mut self, correction: Option<&mut Correction<'_, R, AXES>>) {
        let Trace { executed, axes: outputs, .. } = &mut self.trace;
        if self.power.regulates() {
            if let Some(correction) = correction {
                let is_moving = executed.state == ExecState::Moving;
                let corrections = correction.next(is_moving.then_some(executed.stretches));
                for (axis, correction_mm_s) in self.axes.iter_mut().zip(corrections) {
                    axis.regulator.correction_mm_s = correction_mm_s;
                }
            }
            self.preview.delay(&executed.setpoints, outputs.iter_mut().map(|output| &mut output.set));
            let mut is_lost = false;
            let parts = self.axes.iter_mut().zip(&self.config).zip(&executed.setpoints);
            for (output, ((axis, config), setpoint)) in outputs.iter_mut().zip(parts) {
                axis.tick(config, setpoint, output);
                is_lost |= output.lost;
            }
            if is_lost {
                self.lose();
            }
            self.sample();
        }
        if !self.power.regulates() {
            self.stand_still();
            self.continue_ramp();
        }
    }

    /// Latches what the inputs report.
    #[cold]
    fn judge_inputs(&mut self, before: &MachineInputs<AXES>) {
        let inputs = self.trace.inputs;
        if inputs.emergency_stop {
            // If its reaction is a stop, other faults may be more urgent.
            self.latch_fault(FaultKind::EmergencyStop);
        }
        if let Some(axis) = inputs.axes.iter().position(|axis| axis.is_fault()) {
            return self.latch_fault(FaultKind::Drive { axis });
        }
        // Drives that are off or not settled need not be ready, and they stand still anyway.
        if !self.power.executes() {
            return;
        }
        if let Some(axis) = inputs.axes.iter().position(|axis| !axis.is_ready()) {
            return self.latch_fault(FaultKind::DriveNotReady { axis });
        }
        // An axis may drive off a switch, but not farther onto it.
        let moves = self.trace.executed.setpoints.iter().map(|setpoint| setpoint.velocity_mm_s);
        let is_driven_on = |((now, before), velocity_mm_s): ((&AxisInputs, &AxisInputs), R)| {
            now.is_limit_low() && (velocity_mm_s < R::ZERO || !before.is_limit_low())
                || now.is_limit_high() && (velocity_mm_s > R::ZERO || !before.is_limit_high())
        };
        if let Some(axis) = inputs.axes.iter().zip(&before.axes).zip(moves).position(is_driven_on) {
            self.latch_fault(FaultKind::LimitSwitch { axis });
        }
    }

    /// Latches the first axis that is lost; all that are lost in the same tick are judged.
    #[cold]
    fn lose(&mut self) {
        for axis in 0..AXES {
            let output = self.trace.axes.get(axis);
            if let Some(&AxisOutput { lost: true, following_error_mm: error_mm, .. }) = output {
                self.judge(axis, error_mm);
            }
        }
    }

    fn stand_still(&mut self) {
        for ((output, axis), config) in self.trace.axes.iter_mut().zip(&mut self.axes).zip(&self.config) {
            axis.stand_still(config, output);
        }
    }

    /// Ends a program stop.
    pub fn resume(&mut self) {
        self.executor.resume();
    }

    /// The trace of the latest tick.
    pub fn trace(&self) -> &Trace<R, AXES> {
        &self.trace
    }

    /// Whether the drives are on and have settled: the streams are executed.
    pub fn is_on(&self) -> bool {
        self.power == Power::On
    }

    /// Whether the drives are off, or told to be.
    pub fn is_off(&self) -> bool {
        self.power == Power::Off
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault<R>> {
        self.trace.fault
    }

    /// Whether the encoder of an axis was seen to fail since the axis was last [referenced](Kernel::reference): its position
    /// can't be trusted, also where another fault was there before and after all faults are cleared. With the drives off
    /// only a failed reading is seen.
    #[must_use]
    pub fn has_lost_counts(&self, axis: usize) -> bool {
        self.without_counts & axis_bit(axis) != 0
    }

    /// Clears the fault, if there is one, and stands at the actual position as [`Kernel::stand_here`] does;
    /// returns that position. The drives stay disabled until [`Kernel::enable`]. `None` while the reaction to
    /// a fault is under way: only a more urgent one, [`Kernel::disable`] and [`Kernel::stand_here`] cut it
    /// short.
    pub fn clear_fault(&mut self) -> Option<[Position; AXES]> {
        if self.reaction().is_some_and(|reaction| reaction < Reaction::Immediate) {
            return None;
        }
        self.trace.fault = None;
        Some(self.stand_here())
    }

    /// Drops all motion under way or queued, takes the actual position as the set position, and disables the
    /// drives at once. Returns the position: split the streams anew for it, which empties the queues.
    pub fn stand_here(&mut self) -> [Position; AXES] {
        self.power = Power::Off;
        let mut position = [Position::ZERO; AXES];
        for (((position, axis), config), output) in
            position.iter_mut().zip(&mut self.axes).zip(&self.config).zip(&mut self.trace.axes)
        {
            *position = axis.stand_here(config, output);
        }
        self.executor = Executor::new(position);
        self.preview.rest_at(position);
        self.trace.executed = self.executor.resting();
        position
    }

    /// The largest following error of every axis since the last call \[mm\].
    pub fn take_peak_following_error_mm(&mut self) -> [R; AXES] {
        let peaks = self.axes.map(|axis| axis.peak_following_error_mm);
        for axis in &mut self.axes {
            axis.peak_following_error_mm = R::ZERO;
        }
        peaks
    }

    /// Begins the reaction to a fault, and latches the fault unless there is one already.
    #[cold]
    fn latch_fault(&mut self, kind: FaultKind<R>) {
        self.latch_fault_in(self.trace.tick, kind);
    }

    fn latch_fault_in(&mut self, tick: u64, kind: FaultKind<R>) {
        self.react(&kind);
        self.without_counts |= kind.axes_without_counts();
        if self.trace.fault.is_none() {
            self.trace.fault = Some(Fault { tick, kind });
        }
    }
}
