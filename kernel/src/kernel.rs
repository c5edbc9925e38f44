//! The rooms assembled: one call a tick.
//!
//! ```text
//! encoders, inputs ─► latch ─► executor ─► axis regulators ─► converter codes ─► outputs
//! ```
//!
//! The kernel starts disabled and does nothing to the drives until [`Kernel::enable`]; then it holds the
//! machine where it stands for the time that drives and brakes need, and only then executes the streams.
//!
//! A fault ends in one defined way: it is latched with the tick it was found in, every output goes to
//! the voltage of standing still (0 V plus trim), the drives are disabled, and both stay so until
//! [`Kernel::clear_fault`]. A fault that is found in writing the outputs shows in them from the next tick on.
//! How outputs come to 0 V is the fault's [reaction](crate::fault::Reaction): with the feature `guards` and where the
//! machine gives it time, on the path or along a ramp; else at once. The first fault stays, but a later one
//! may ask for a more urgent end.

mod corrected_intake;
#[cfg(all(test, feature = "guards"))]
mod endings;
#[cfg(feature = "live")]
mod reference;

use crate::axis::{AxesConfig, AxisConfig, AxisOutput, AxisState, Correction, Preview};
#[cfg(feature = "guards")]
use crate::axis::{AxisFault, LOOK_TICKS};
use crate::exec::{ExecState, Executor};
use crate::fault::{Fault, FaultKind};
#[cfg(feature = "guards")]
use crate::fault::{Reaction, Reactions};
use crate::hal::{AxisInputs, DriveEnable, Encoder, Inputs, MachineInputs, VelocityChannel};
use crate::num::Real;
use crate::queue::Intake;
use crate::trace::Trace;
use crate::units::{Counts, DacCode, Position};
pub use corrected_intake::CorrectedIntake;

/// Whether the drives may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Power {
    Off,
    /// Enabled and held still for so many more ticks.
    Starting {
        ticks_left: u32,
    },
    On,
    /// In a fault, coming to rest on the path; at rest, until the preview has passed.
    #[cfg(feature = "guards")]
    Stopping {
        ticks_left: u32,
        is_at_rest: bool,
    },
    /// In a fault, outputs on their way to 0 V, drives enabled.
    #[cfg(feature = "guards")]
    Ramping {
        ticks_left: u16,
    },
}

impl Power {
    /// The executor goes on.
    #[inline]
    fn executes(self) -> bool {
        match self {
            Self::On => true,
            #[cfg(feature = "guards")]
            Self::Stopping { is_at_rest, .. } => !is_at_rest,
            _ => false,
        }
    }

    /// The axes are regulated.
    #[inline]
    fn regulates(self) -> bool {
        #[cfg(feature = "guards")]
        if matches!(self, Self::Ramping { .. }) {
            return false;
        }
        self != Self::Off
    }
}

/// The real-time motion kernel of a machine with `AXES` axes.
// In this order: what a tick touches most lies within reach of the core's short addresses.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Kernel<R: Real, const AXES: usize> {
    power: Power,
    /// What the drives were last told; `None` before the first time and where that failed.
    told: Option<bool>,
    executor: Executor<R, AXES>,
    /// What the latest tick did; the next one goes on from it.
    trace: Trace<R, AXES>,
    axes: [AxisState<R>; AXES],
    config: [AxisConfig<R>; AXES],
    preview: Preview<AXES>,
    #[cfg(feature = "guards")]
    guards: Guards<AXES>,
}

/// What the kernel remembers of guards and reactions.
#[cfg(feature = "guards")]
#[derive(Clone, Copy, Debug)]
struct Guards<const AXES: usize> {
    reactions: Reactions,
    /// What was put out last.
    written: [DacCode; AXES],
    /// What was put out when the ramp began.
    ramp_from: [DacCode; AXES],
    /// Place in the round of looks at the axes.
    look_ticks: u8,
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// A kernel at rest at `position`, where the encoders read `counts`, drives disabled.
    #[must_use]
    pub fn new(config: &AxesConfig<R, AXES>, position: [Position; AXES], counts: [Counts; AXES]) -> Self {
        #[cfg(feature = "guards")]
        let reactions = config.reactions;
        let &AxesConfig { axes: ref config, preview_ticks, .. } = config;
        let (mut axes, mut outputs) = ([AxisState::default(); AXES], [AxisOutput::default(); AXES]);
        let of_axes = axes.iter_mut().zip(&mut outputs).zip(config).zip(counts.iter().zip(&position));
        for (((axis, output), config), (&counts, &position)) in of_axes {
            (output.counts, output.set) = (counts, position);
            axis.set_position(config, counts, position);
        }
        let executor = Executor::new(position);
        // The first tick is number 0.
        // In one: 16 KiB hold no copy of what it rests with.
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
            #[cfg(feature = "guards")]
            guards: Guards {
                reactions,
                written: [DacCode::ZERO; AXES],
                ramp_from: [DacCode::ZERO; AXES],
                look_ticks: 0,
            },
        }
    }

    /// Enables the drives with the next tick, holds the machine still for `settle_ticks` ticks (what
    /// brakes and relays need), then executes the streams. Without effect in a fault.
    ///
    /// What was cut off in the middle of a stretch is given up, as by [`Kernel::stand_here`].
    pub fn enable(&mut self, settle_ticks: u32) {
        if self.trace.fault.is_none() && self.power == Power::Off {
            if !self.executor.is_at_rest() {
                self.stand_here();
            }
            #[cfg(feature = "guards")]
            for axis in &mut self.axes {
                axis.restart_guard();
            }
            self.power = Power::Starting { ticks_left: settle_ticks };
        }
    }

    /// Disables the drives with the next tick, wherever the machine is. The motion under way is lost:
    /// go on with [`Kernel::stand_here`] and new streams.
    pub fn disable(&mut self) {
        self.power = Power::Off;
    }

    /// Latches a fault that the board has found (an input, a missed tick), in the tick to come: its
    /// outputs already are those of a fault. Without effect if there is one.
    pub fn trip(&mut self, kind: FaultKind<R>) {
        self.latch_fault_in(self.trace.tick.wrapping_add(1), kind);
    }

    /// One control tick: reads the encoders and inputs, executes the streams, regulates every axis, writes the
    /// outputs. Call it from the tick's interrupt and nowhere else. What it did stays readable until the next.
    #[inline]
    pub fn tick<H>(&mut self, intake: &mut Intake<'_, R, AXES>, hal: &mut H) -> &Trace<R, AXES>
    where
        H: Encoder<AXES> + Inputs<AXES> + VelocityChannel<AXES> + DriveEnable<AXES>,
    {
        self.tick_with(intake, None, hal)
    }

    /// [`Kernel::tick`] with what was learnt of a stretch added to feedforward while that is driven.
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
                // Without guards, what is healthy is not worth the instructions.
                if cfg!(feature = "guards") || !inputs.is_healthy() {
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
        #[cfg(not(feature = "guards"))]
        let codes = &mut [DacCode::ZERO; AXES];
        #[cfg(feature = "guards")]
        let codes = &mut self.guards.written;
        for (code, axis) in codes.iter_mut().zip(&self.trace.axes) {
            *code = axis.code;
        }
        if hal.write(codes).is_err() {
            self.latch_fault(FaultKind::Output);
        }
        // Repeated until the drives have taken it, above all when they are to be disabled.
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
            Power::Off => {}
            Power::Starting { ticks_left: 0 } => self.power = Power::On,
            Power::Starting { ticks_left } => *ticks_left -= 1,
            Power::On => {}
            #[cfg(feature = "guards")]
            Power::Stopping { .. } | Power::Ramping { .. } => {}
        }
        if self.power.executes()
            && let Err(fault) = self.executor.tick_into(intake, &mut self.trace.executed)
        {
            self.latch_fault(FaultKind::Executor(fault));
        }
        #[cfg(feature = "guards")]
        if let Power::Stopping { .. } = self.power {
            self.go_on_stopping(intake);
        }
    }

    /// The outputs of all axes. Where the drives are off they stand still, and regulators and peaks
    /// keep what they had.
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
            #[cfg(feature = "guards")]
            self.look();
        }
        if !self.power.regulates() {
            self.stand_still();
            #[cfg(feature = "guards")]
            self.ramp();
        }
    }

    /// Latches what the inputs report.
    #[cold]
    fn judge_inputs(&mut self, before: &MachineInputs<AXES>) {
        let inputs = self.trace.inputs;
        if inputs.emergency_stop {
            // Not the last word where it is a stop: the others may be more urgent.
            self.latch_fault(FaultKind::EmergencyStop);
        }
        if let Some(axis) = inputs.axes.iter().position(|axis| axis.is_fault()) {
            return self.latch_fault(FaultKind::Drive { axis });
        }
        // Drives that are off, or have not settled, need not be ready, and stand still wherever they are.
        if !self.power.executes() {
            return;
        }
        if let Some(axis) = inputs.axes.iter().position(|axis| !axis.is_ready()) {
            return self.latch_fault(FaultKind::DriveNotReady { axis });
        }
        // One can drive off a switch, not farther onto it.
        let moves = self.trace.executed.setpoints.iter().map(|setpoint| setpoint.velocity_mm_s);
        let is_driven_on = |((now, before), velocity_mm_s): ((&AxisInputs, &AxisInputs), R)| {
            now.is_limit_low() && (velocity_mm_s < R::ZERO || !before.is_limit_low())
                || now.is_limit_high() && (velocity_mm_s > R::ZERO || !before.is_limit_high())
        };
        if let Some(axis) = inputs.axes.iter().zip(&before.axes).zip(moves).position(is_driven_on) {
            self.latch_fault(FaultKind::LimitSwitch { axis });
        }
    }

    /// Latches the first axis that is lost.
    #[cold]
    fn lose(&mut self) {
        let lost = self.trace.axes.iter().enumerate().find(|(_, output)| output.lost);
        if let Some((axis, &AxisOutput { following_error_mm: error_mm, .. })) = lost {
            #[cfg(not(feature = "guards"))]
            self.latch_fault(FaultKind::FollowingError { axis, error_mm });
            #[cfg(feature = "guards")]
            self.judge(axis, error_mm);
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

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault<R>> {
        self.trace.fault
    }

    /// Clears the fault, if there is one, and stands at the actual position, as [`Kernel::stand_here`], which it returns.
    /// The drives stay disabled until [`Kernel::enable`]. `None` while the reaction to a fault is under way: nothing cuts it
    /// short but a more urgent one, [`Kernel::disable`] and [`Kernel::stand_here`].
    pub fn clear_fault(&mut self) -> Option<[Position; AXES]> {
        #[cfg(feature = "guards")]
        if self.reaction().is_some_and(|reaction| reaction < Reaction::Immediate) {
            return None;
        }
        self.trace.fault = None;
        Some(self.stand_here())
    }

    /// Gives up the motion that is under way or queued and takes the actual position for the set
    /// position; the drives are disabled at once. Returns the position: split the streams anew for it, which
    /// drops what is queued.
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

    /// The first fault stays, and the drives go off.
    #[cold]
    fn latch_fault(&mut self, kind: FaultKind<R>) {
        self.latch_fault_in(self.trace.tick, kind);
    }

    fn latch_fault_in(&mut self, tick: u64, kind: FaultKind<R>) {
        #[cfg(not(feature = "guards"))]
        {
            self.power = Power::Off;
        }
        #[cfg(feature = "guards")]
        self.react(kind.reaction(self.guards.reactions.emergency_stop));
        if self.trace.fault.is_none() {
            self.trace.fault = Some(Fault { tick, kind });
        }
    }
}

/// Guards of the axes, and how faults end.
#[cfg(feature = "guards")]
impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// Ticks of a round of looks at the axes.
    const ROUND_TICKS: u8 = {
        assert!(AXES * (LOOK_TICKS as usize) < 256, "a round of looks is counted in a byte");
        LOOK_TICKS * AXES as u8
    };

    /// How the fault is ending, in the order of urgency: on the path, along a ramp, or with the drives off, which is the end
    /// of every fault. `None` without a fault.
    pub fn reaction(&self) -> Option<Reaction> {
        self.trace.fault.map(|_| match self.power {
            Power::Stopping { .. } => Reaction::Stop,
            Power::Ramping { .. } => Reaction::Ramp,
            // A fault leaves no other.
            _ => Reaction::Immediate,
        })
    }

    /// Looks at one axis in every [`LOOK_TICKS`] ticks.
    #[inline]
    fn look(&mut self) {
        self.guards.look_ticks += 1;
        if self.guards.look_ticks.is_multiple_of(LOOK_TICKS) {
            self.look_at(usize::from(self.guards.look_ticks / LOOK_TICKS) - 1);
        }
    }

    #[inline(never)]
    fn look_at(&mut self, axis: usize) {
        if self.guards.look_ticks >= Self::ROUND_TICKS {
            self.guards.look_ticks = 0;
        }
        let parts = self.axes.get_mut(axis).zip(self.config.get(axis));
        let ticks = self.trace.executed.setpoints.get(axis).zip(self.trace.axes.get(axis));
        if let Some(((state, config), (setpoint, output))) = parts.zip(ticks)
            && !output.lost
            && let Some(found) = state.look(config, setpoint, output)
        {
            self.latch_fault(kind_of(axis, found));
        }
    }

    /// Latches what broke in an axis that is lost.
    fn judge(&mut self, axis: usize, error_mm: R) {
        // Since its place in the round, or in the round before.
        let place = LOOK_TICKS.saturating_mul(axis as u8 + 1);
        let now = self.guards.look_ticks + 1;
        let since = if now > place { now - place } else { now + (Self::ROUND_TICKS - place) };
        let parts = self.axes.get(axis).zip(self.config.get(axis));
        let found = match parts.zip(self.trace.executed.setpoints.get(axis)) {
            Some(((state, config), setpoint)) => state.judge(config, setpoint, since),
            None => AxisFault::FollowingError { error_mm },
        };
        self.latch_fault(kind_of(axis, found));
    }

    /// Begins a reaction, unless one as urgent is under way.
    fn react(&mut self, reaction: Reaction) {
        let Reactions { ramp_ticks, stop_ticks, .. } = self.guards.reactions;
        let reaction = if ramp_ticks == 0 { Reaction::Immediate } else { reaction };
        self.power = match (self.power, reaction) {
            (Power::Off, _) | (_, Reaction::Immediate) => Power::Off,
            // Drives that have not been told to be on are not enabled for a ramp.
            _ if self.told != Some(true) => Power::Off,
            (Power::Ramping { .. }, _) | (Power::Stopping { .. }, Reaction::Stop) => self.power,
            (Power::On, Reaction::Stop) if self.trace.executed.state == ExecState::Moving => {
                Power::Stopping { ticks_left: stop_ticks, is_at_rest: false }
            }
            // What rests does not begin to move.
            (Power::On, Reaction::Stop) => self.at_rest(),
            (Power::On | Power::Starting { .. } | Power::Stopping { .. }, _) => {
                self.guards.ramp_from = self.guards.written;
                Power::Ramping { ticks_left: ramp_ticks }
            }
        };
    }

    /// The end of a stop: what is delayed is still to come.
    fn at_rest(&self) -> Power {
        Power::Stopping { ticks_left: u32::from(self.preview.ticks()), is_at_rest: true }
    }

    /// A tick of a stop on the path, after the executor's.
    #[cold]
    fn go_on_stopping(&mut self, intake: &Intake<'_, R, AXES>) {
        let Power::Stopping { ticks_left, is_at_rest } = self.power else { return };
        let has_come_to_rest = !is_at_rest && self.trace.executed.state != ExecState::Moving;
        if has_come_to_rest {
            self.power = self.at_rest();
        } else if ticks_left > 0 && (is_at_rest || intake.want_stop()) {
            self.power = Power::Stopping { ticks_left: ticks_left - 1, is_at_rest };
        } else {
            self.react(if is_at_rest { Reaction::Immediate } else { Reaction::Ramp });
        }
    }

    /// The outputs of a ramp to 0 V; its last tick is the first one with the drives off.
    #[cold]
    fn ramp(&mut self) {
        let Power::Ramping { ticks_left } = self.power else { return };
        let (left, all) = (i64::from(ticks_left) - 1, i64::from(self.guards.reactions.ramp_ticks));
        for (output, &DacCode(from)) in self.trace.axes.iter_mut().zip(&self.guards.ramp_from) {
            let DacCode(still) = output.code;
            let above = (i64::from(from) - i64::from(still)) * left;
            output.code = DacCode(still.wrapping_add(above.checked_div(all).unwrap_or(0) as i16));
        }
        self.power = if left == 0 { Power::Off } else { Power::Ramping { ticks_left: ticks_left - 1 } };
    }
}

/// What was found of an axis, as a fault.
#[cfg(feature = "guards")]
fn kind_of<R>(axis: usize, found: AxisFault<R>) -> FaultKind<R> {
    match found {
        AxisFault::FollowingError { error_mm } => FaultKind::FollowingError { axis, error_mm },
        AxisFault::EncoderLost => FaultKind::EncoderLost { axis },
        AxisFault::EncoderJump { jump_mm } => FaultKind::EncoderJump { axis, jump_mm },
        AxisFault::Runaway => FaultKind::Runaway { axis },
        AxisFault::Saturated => FaultKind::Saturated { axis },
        AxisFault::SoftLimit => FaultKind::SoftLimit { axis },
        AxisFault::SetpointJump { jump_mm } => FaultKind::SetpointJump { axis, jump_mm },
        AxisFault::NotFinite => FaultKind::NotFinite { axis },
    }
}
