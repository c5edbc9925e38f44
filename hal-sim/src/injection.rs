//! Breaks the simulated machine on demand: one thing at a time, at any tick.
//!
//! Consumes the counts that the encoders read and the true positions; produces the counts and digital inputs
//! that a broken machine shows. Faults of a drive change the machine itself. A broken part stays broken until
//! [`Injector::repair`]. Constant cost, cannot fail.

use motion_kernel::hal::{AxisInputs, MachineInputs};
use motion_kernel::units::Counts;

use crate::machine::SimMachine;

/// The part that breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Injection {
    /// The encoder's cable is cut: its counts no longer change.
    EncoderLost,
    /// The encoder makes extra counts, once.
    EncoderJump {
        /// The extra counts.
        counts: i32,
    },
    /// The encoder counts the other way from here on.
    EncoderReversed,
    /// The drive turns the other way.
    DriveReversed,
    /// The load is too great: this limits the drive's acceleration.
    Overload {
        /// Its current limit \[mm/s²\], above 0.
        accel_limit_mm_s2: f64,
    },
    /// The drive's ready line drops.
    DriveNotReady,
    /// The drive's fault line rises.
    DriveFault,
    /// There is a limit switch for all positions up to this one \[mm\].
    LimitLow {
        /// The position.
        at_mm: f64,
    },
    /// There is a limit switch for all positions from this one on \[mm\].
    LimitHigh {
        /// The position.
        at_mm: f64,
    },
}

/// One axis' encoder and lines.
#[derive(Clone, Copy, Debug)]
struct Broken {
    /// The encoder's last reading; `None` before the first one.
    read: Option<i64>,
    /// The count shown for it.
    shown: i64,
    /// Counts shown per count read.
    gain: i64,
    lines: AxisInputs,
    limits_mm: [f64; 2],
}

impl Broken {
    const NOTHING: Self = Self {
        read: None,
        shown: 0,
        gain: 1,
        lines: AxisInputs::HEALTHY,
        limits_mm: [f64::NEG_INFINITY, f64::INFINITY],
    };
}

/// Sits between a simulated machine and its readers.
#[derive(Clone, Copy, Debug)]
pub struct Injector<const AXES: usize> {
    axes: [Broken; AXES],
    /// The emergency stop is open.
    pub emergency_stop: bool,
}

impl<const AXES: usize> Injector<AXES> {
    /// Nothing is broken.
    #[must_use]
    pub const fn new() -> Self {
        Self { axes: [Broken::NOTHING; AXES], emergency_stop: false }
    }

    /// Breaks a part of an axis, counted from 0; without effect if there is no such axis.
    pub fn inject<const LINE: usize, const CHIPS: usize>(
        &mut self,
        machine: &SimMachine<AXES, LINE, CHIPS>,
        axis: usize,
        injection: Injection,
    ) {
        let Some(broken) = self.axes.get_mut(axis) else { return };
        match injection {
            Injection::EncoderLost => broken.gain = 0,
            Injection::EncoderJump { counts } => broken.shown += i64::from(counts),
            Injection::EncoderReversed => broken.gain = -1,
            Injection::DriveReversed => machine.reverse_drive(axis),
            Injection::Overload { accel_limit_mm_s2 } => machine.limit_drive(axis, accel_limit_mm_s2),
            Injection::DriveNotReady => broken.lines = broken.lines.with_ready(false),
            Injection::DriveFault => broken.lines = broken.lines.with_fault(true),
            Injection::LimitLow { at_mm } => broken.limits_mm[0] = at_mm,
            Injection::LimitHigh { at_mm } => broken.limits_mm[1] = at_mm,
        }
    }

    /// Repairs encoders, lines and switches; encoders continue to count from where they are. A drive is
    /// repaired by the same injection with the opposite effect.
    pub fn repair(&mut self) {
        for broken in &mut self.axes {
            *broken = Broken { read: broken.read, shown: broken.shown, ..Broken::NOTHING };
        }
        self.emergency_stop = false;
    }

    /// The counts that the encoders show for their readings.
    pub fn counts(&mut self, read: [Counts; AXES]) -> [Counts; AXES] {
        let mut shown = read;
        for ((broken, Counts(read)), shown) in self.axes.iter_mut().zip(read).zip(&mut shown) {
            // A jump before the first reading counts from there.
            let moved = broken.read.map_or(read, |before| broken.gain * (read - before));
            broken.shown += moved;
            broken.read = Some(read);
            *shown = Counts(broken.shown);
        }
        shown
    }

    /// The inputs of a machine in its present state.
    #[must_use]
    pub fn inputs<const LINE: usize, const CHIPS: usize>(
        &self,
        machine: &SimMachine<AXES, LINE, CHIPS>,
    ) -> MachineInputs<AXES> {
        let mut axes = [AxisInputs::HEALTHY; AXES];
        for ((broken, inputs), truth) in self.axes.iter().zip(&mut axes).zip(machine.truth()) {
            let [low_mm, high_mm] = broken.limits_mm;
            *inputs = broken
                .lines
                .with_limit_low(truth.position_mm <= low_mm)
                .with_limit_high(truth.position_mm >= high_mm);
        }
        MachineInputs { axes, emergency_stop: self.emergency_stop }
    }
}

impl<const AXES: usize> Default for Injector<AXES> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AxisParameters, MachineParameters};

    #[test]
    fn an_encoder_is_cut_jumps_turns_round_and_is_mended_where_it_is() {
        let parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X; 2]);
        let machine = SimMachine::<2>::new(&parameters).expect("a machine");
        let mut injector = Injector::new();
        let show = |injector: &mut Injector<2>, read: i64| {
            let [Counts(broken), Counts(good)] = injector.counts([Counts(read), Counts(-read)]);
            assert_eq!(good, -read, "the other axis");
            broken
        };
        assert_eq!((show(&mut injector, 1000), show(&mut injector, 1010)), (1000, 1010));
        injector.inject(&machine, 0, Injection::EncoderLost);
        assert_eq!((show(&mut injector, 1020), show(&mut injector, 1030)), (1010, 1010));
        injector.repair();
        assert_eq!((show(&mut injector, 1031), show(&mut injector, 1030)), (1011, 1010));
        injector.inject(&machine, 0, Injection::EncoderJump { counts: -500 });
        assert_eq!((show(&mut injector, 1031), show(&mut injector, 1032)), (511, 512));
        injector.inject(&machine, 0, Injection::EncoderReversed);
        assert_eq!((show(&mut injector, 1040), show(&mut injector, 1030)), (504, 514));
    }

    #[test]
    fn switches_and_lines_are_those_of_their_axis() {
        let mut parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X; 2]);
        parameters.axes[1].start_position_mm = 5.0;
        let machine = SimMachine::<2>::new(&parameters).expect("a machine");
        let mut injector = Injector::new();
        assert_eq!(injector.inputs(&machine), MachineInputs::HEALTHY);
        injector.inject(&machine, 1, Injection::LimitHigh { at_mm: 5.1 });
        assert_eq!(injector.inputs(&machine), MachineInputs::HEALTHY);
        injector.inject(&machine, 1, Injection::LimitHigh { at_mm: 5.0 });
        injector.inject(&machine, 0, Injection::LimitLow { at_mm: 0.0 });
        injector.inject(&machine, 0, Injection::DriveNotReady);
        injector.inject(&machine, 1, Injection::DriveFault);
        injector.emergency_stop = true;
        let healthy = AxisInputs::HEALTHY;
        let axes =
            [healthy.with_ready(false).with_limit_low(true), healthy.with_fault(true).with_limit_high(true)];
        assert_eq!(injector.inputs(&machine), MachineInputs { axes, emergency_stop: true });
        injector.repair();
        assert_eq!(injector.inputs(&machine), MachineInputs::HEALTHY);
    }
}
