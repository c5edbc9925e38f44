//! The record of a tick: everything that S4 shows of a run.

use serde::{Deserialize, Serialize};

use crate::axis::AxisOutput;
use crate::exec::ExecState;
use crate::exec::Executed;
use crate::fault::Fault;
use crate::hal::{MachineInputs, OutputState};
use crate::num::Scalar;

/// One tick of the whole kernel.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound(deserialize = "R: Copy + Deserialize<'de>"))]
pub struct Trace<R, const AXES: usize> {
    /// Tick number since the start.
    pub tick: u64,
    /// Set values along the path and per axis; the last ones if a fault has stopped the executor.
    pub executed: Executed<R, AXES>,
    /// Encoder readings, actual values and outputs; with the drives off, the outputs stand still.
    #[serde(with = "crate::array")]
    pub axes: [AxisOutput<R>; AXES],
    /// The digital inputs as the tick read them; without the feature `guards` those of the last tick with
    /// unhealthy inputs.
    pub inputs: MachineInputs<AXES>,
    /// The latched fault, if there is one.
    pub fault: Option<Fault<R>>,
}

/// A fingerprint of a run: 64 bits over everything that its ticks set, read and put out.
///
/// Two runs with the same digest had the same bits, except for one chance in 2⁶⁴; two runs that differ in a
/// single word of a single tick always have different digests, because every step is a bijection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u64);

impl Digest {
    /// The digest of no ticks.
    #[must_use]
    pub const fn new() -> Self {
        // The offset of the FNV-1a hash.
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Adds a tick: motion along the path, set-points, counts, codes, state, fault.
    pub fn add<R: Scalar, const AXES: usize>(&mut self, trace: &Trace<R, AXES>) {
        let motion = &trace.executed.motion;
        self.word(motion.s.to_bits().cast_unsigned());
        for quantity in [motion.v_mm_s, motion.a_mm_s2, motion.j_mm_s3, motion.snap_mm_s4] {
            self.word(quantity.to_bits64());
        }
        for (setpoint, output) in trace.executed.setpoints.iter().zip(&trace.axes) {
            self.word(setpoint.position.to_bits().cast_unsigned());
            for quantity in [setpoint.velocity_mm_s, setpoint.accel_mm_s2, setpoint.jerk_mm_s3] {
                self.word(quantity.to_bits64());
            }
            self.word(output.counts.0.cast_unsigned());
            self.word(u64::from(output.code.0.cast_unsigned()));
        }
        let state = match trace.executed.state {
            ExecState::Idle => 0,
            ExecState::Moving => 1,
            ExecState::Dwell => 2,
            ExecState::Stopped => 3,
            // The next bit is for the fault.
            ExecState::Held => 8,
        };
        self.word(state | u64::from(trace.fault.is_some()) << 2 | u64::from(trace.executed.line) << 32);
    }

    /// Adds outputs that are switched between two ticks.
    pub fn switch(&mut self, to: &OutputState) {
        let &OutputState { spindle, speed_rpm, flood, mist } = to;
        self.word(speed_rpm.to_bits());
        self.word(spindle as u64 | u64::from(flood) << 2 | u64::from(mist) << 3);
    }

    /// FNV-1a with a word in place of a byte.
    fn word(&mut self, word: u64) {
        self.0 = (self.0 ^ word).rotate_left(29).wrapping_mul(0x0000_0100_0000_01b3);
    }

    /// The 64 bits.
    #[must_use]
    pub const fn value(self) -> u64 {
        self.0
    }
}

impl Default for Digest {
    fn default() -> Self {
        Self::new()
    }
}
