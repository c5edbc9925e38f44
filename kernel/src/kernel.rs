//! The rooms assembled: one call a tick.
//!
//! ```text
//! encoders ─► latch ─► executor ─► axis regulators ─► converter codes ─► outputs
//! ```
//!
//! A fault ends in one defined way: it is latched with the tick it was found in, every output goes to
//! 0 V, the drives are disabled, and both stay so until [`Kernel::clear_fault`].

use crate::axis::{AxisConfig, AxisOutput, AxisState};
use crate::exec::{Executed, Executor};
use crate::fault::{Fault, FaultKind};
use crate::hal::{DriveEnable, Encoder, VelocityChannel};
use crate::num::Real;
use crate::queue::Intake;
use crate::trace::Trace;
use crate::units::{Counts, DacCode, Position};

/// The real-time motion kernel of a machine with `AXES` axes.
#[derive(Clone, Copy, Debug)]
pub struct Kernel<R: Real, const AXES: usize> {
    config: [AxisConfig<R>; AXES],
    executor: Executor<R, AXES>,
    axes: [AxisState<R>; AXES],
    tick: u64,
    enabled: bool,
    last: Executed<R, AXES>,
    counts: [Counts; AXES],
    fault: Option<Fault<R>>,
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// A kernel at rest at `position`, where the encoders read `counts`, drives disabled.
    #[must_use]
    pub fn new(config: [AxisConfig<R>; AXES], position: [Position; AXES], counts: [Counts; AXES]) -> Self {
        let mut axes = [AxisState::default(); AXES];
        for (((axis, config), &counts), &position) in axes.iter_mut().zip(&config).zip(&counts).zip(&position)
        {
            axis.set_position(config, counts, position);
        }
        let executor = Executor::new(position);
        Self {
            config,
            executor,
            axes,
            tick: 0,
            enabled: false,
            last: executor.resting(),
            counts,
            fault: None,
        }
    }

    /// One control tick: reads the encoders, executes the streams, regulates every axis, writes the
    /// outputs. Call it from the tick's interrupt and nowhere else.
    pub fn tick<H>(&mut self, intake: &mut Intake<'_, R, AXES>, hal: &mut H) -> Trace<R, AXES>
    where
        H: Encoder<AXES> + VelocityChannel<AXES> + DriveEnable<AXES>,
    {
        match hal.latch() {
            Ok(counts) => self.counts = counts,
            Err(_) => self.latch_fault(FaultKind::Encoder),
        }
        if self.fault.is_none() {
            match self.executor.tick(intake) {
                Ok(executed) => self.last = executed,
                Err(fault) => self.latch_fault(FaultKind::Executor(fault)),
            }
        }
        let mut outputs = [AxisOutput::default(); AXES];
        let parts = self.axes.iter_mut().zip(&self.config).zip(&self.last.setpoints).zip(&self.counts);
        for (output, (((axis, config), setpoint), &counts)) in outputs.iter_mut().zip(parts) {
            *output = axis.tick(config, setpoint, counts);
        }
        if let Some((axis, output)) = outputs.iter().enumerate().find(|(_, output)| output.lost) {
            self.latch_fault(FaultKind::FollowingError { axis, error_mm: output.following_error_mm });
        }
        if self.fault.is_some() {
            for output in &mut outputs {
                output.code = DacCode::ZERO;
            }
        }
        if hal.write(&outputs.map(|output| output.code)).is_err() {
            self.latch_fault(FaultKind::Output);
        }
        let enable = self.fault.is_none();
        if enable != self.enabled {
            match hal.set_enabled(enable) {
                Ok(()) => self.enabled = enable,
                Err(_) => self.latch_fault(FaultKind::Enable),
            }
        }
        let trace = Trace { tick: self.tick, executed: self.last, axes: outputs, fault: self.fault };
        self.tick = self.tick.wrapping_add(1);
        trace
    }

    /// Ends a program stop.
    pub fn resume(&mut self) {
        self.executor.resume();
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault<R>> {
        self.fault
    }

    /// Clears the fault and starts anew at rest at the actual position. What was queued must have
    /// been dropped before: use new streams.
    pub fn clear_fault(&mut self) {
        let mut position = [Position::ZERO; AXES];
        for (((position, axis), config), &counts) in
            position.iter_mut().zip(&mut self.axes).zip(&self.config).zip(&self.counts)
        {
            *position = config.encoder.position(counts) + axis.offset;
            axis.regulator = crate::axis::RegulatorState::default();
        }
        self.executor = Executor::new(position);
        self.last = self.executor.resting();
        self.fault = None;
    }

    /// The largest following error of every axis since the last call \[mm\].
    pub fn take_peak_following_error_mm(&mut self) -> [R; AXES] {
        let peaks = self.axes.map(|axis| axis.peak_following_error_mm);
        for axis in &mut self.axes {
            axis.peak_following_error_mm = R::ZERO;
        }
        peaks
    }

    /// The first fault stays.
    fn latch_fault(&mut self, kind: FaultKind<R>) {
        if self.fault.is_none() {
            self.fault = Some(Fault { tick: self.tick, kind });
        }
    }
}
