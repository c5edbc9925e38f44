//! Guards of the axes, and reactions on the path or along a ramp.

use serde::{Deserialize, Serialize};

use super::{Kernel, Power};
use crate::axis::{AxisFault, SAMPLE_TICKS};
use crate::exec::ExecState;
use crate::fault::{FaultKind, Reaction, Reactions};
use crate::num::Real;
use crate::queue::Intake;
use crate::units::DacCode;

/// A reaction that takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Ending {
    /// Coming to rest on the path; at rest, until the preview has passed.
    Stopping { ticks_left: u32, is_at_rest: bool },
    /// Outputs on their way to 0 V, drives enabled.
    Ramping { ticks_left: u16 },
}

impl Ending {
    /// Whether the executor continues.
    #[inline]
    pub(super) fn executes(self) -> bool {
        matches!(self, Self::Stopping { is_at_rest: false, .. })
    }

    /// Whether the axes are regulated.
    #[inline]
    pub(super) fn regulates(self) -> bool {
        matches!(self, Self::Stopping { .. })
    }
}

/// The state that guards and reactions need.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Guards<const AXES: usize> {
    reactions: Reactions,
    /// The codes written last.
    #[serde(with = "crate::array")]
    pub(super) written: [DacCode; AXES],
    /// The codes when the ramp began.
    #[serde(with = "crate::array")]
    ramp_from: [DacCode; AXES],
    /// Place in the round of the axes' samples.
    pub(super) sample_ticks: u8,
}

impl<const AXES: usize> Guards<AXES> {
    /// Every tick's inputs are kept.
    pub(super) const KEEP_INPUTS: bool = true;

    pub(super) fn new(reactions: Reactions) -> Self {
        let still = [DacCode::ZERO; AXES];
        Self { reactions, written: still, ramp_from: still, sample_ticks: 0 }
    }

    /// Where the codes of a tick are written; they are remembered for a ramp.
    #[inline]
    pub(super) fn written<'a>(&'a mut self, _: &'a mut [DacCode; AXES]) -> &'a mut [DacCode; AXES] {
        &mut self.written
    }
}

impl<R: Real, const AXES: usize> Kernel<R, AXES> {
    /// Ticks of a round in which every axis is sampled once.
    const ROUND_TICKS: u8 = {
        assert!(AXES * (SAMPLE_TICKS as usize) < 256, "a round of samples is counted in a byte");
        SAMPLE_TICKS * AXES as u8
    };

    /// The reaction under way, in order of urgency: on the path, along a ramp, or with the drives off, which
    /// ends every reaction. `None` without a fault.
    pub fn reaction(&self) -> Option<Reaction> {
        self.trace.fault.map(|_| match self.power {
            Power::Ending(Ending::Stopping { .. }) => Reaction::Stop,
            Power::Ending(Ending::Ramping { .. }) => Reaction::Ramp,
            // A fault leaves no other.
            _ => Reaction::Immediate,
        })
    }

    /// Samples one axis in every [`SAMPLE_TICKS`] ticks.
    #[inline]
    pub(super) fn sample(&mut self) {
        self.guards.sample_ticks += 1;
        if self.guards.sample_ticks.is_multiple_of(SAMPLE_TICKS) {
            self.sample_axis(usize::from(self.guards.sample_ticks / SAMPLE_TICKS) - 1);
        }
    }

    #[inline(never)]
    fn sample_axis(&mut self, axis: usize) {
        if self.guards.sample_ticks >= Self::ROUND_TICKS {
            self.guards.sample_ticks = 0;
        }
        let parts = self.axes.get_mut(axis).zip(self.config.get(axis));
        let ticks = self.trace.executed.setpoints.get(axis).zip(self.trace.axes.get(axis));
        if let Some(((state, config), (setpoint, output))) = parts.zip(ticks)
            && !output.lost
            && let Some(found) = state.sample(config, setpoint, output)
        {
            self.latch_fault(kind_of(axis, found));
        }
    }

    /// Latches what broke in an axis that is lost.
    pub(super) fn judge(&mut self, axis: usize, error_mm: R) {
        // Ticks since its place in this round, or in the round before.
        let place = SAMPLE_TICKS.saturating_mul(axis as u8 + 1);
        let now = self.guards.sample_ticks + 1;
        let since = if now > place { now - place } else { now + (Self::ROUND_TICKS - place) };
        let parts = self.axes.get(axis).zip(self.config.get(axis));
        let found = match parts.zip(self.trace.executed.setpoints.get(axis)) {
            Some(((state, config), setpoint)) => state.judge(config, setpoint, since),
            None => AxisFault::FollowingError { error_mm },
        };
        self.latch_fault(kind_of(axis, found));
    }

    /// Begins the reaction to a fault, unless one as urgent is under way.
    pub(super) fn react(&mut self, kind: &FaultKind<R>) {
        self.begin(kind.reaction(self.guards.reactions.emergency_stop));
    }

    fn begin(&mut self, reaction: Reaction) {
        let Reactions { ramp_ticks, stop_ticks, .. } = self.guards.reactions;
        let reaction = if ramp_ticks == 0 { Reaction::Immediate } else { reaction };
        self.power = match (self.power, reaction) {
            (Power::Off, _) | (_, Reaction::Immediate) => Power::Off,
            // Drives that have not been told to be on are not enabled for a ramp.
            _ if self.told != Some(true) => Power::Off,
            (Power::Ending(Ending::Ramping { .. }), _)
            | (Power::Ending(Ending::Stopping { .. }), Reaction::Stop) => self.power,
            (Power::On, Reaction::Stop) if self.trace.executed.state == ExecState::Moving => {
                Power::Ending(Ending::Stopping { ticks_left: stop_ticks, is_at_rest: false })
            }
            // A machine at rest does not begin to move.
            (Power::On, Reaction::Stop) => self.at_rest(),
            (Power::On | Power::Starting { .. } | Power::Ending(Ending::Stopping { .. }), _) => {
                self.guards.ramp_from = self.guards.written;
                Power::Ending(Ending::Ramping { ticks_left: ramp_ticks })
            }
        };
    }

    /// The end of a stop, in which delayed set-points are still to come.
    fn at_rest(&self) -> Power {
        Power::Ending(Ending::Stopping { ticks_left: u32::from(self.preview.ticks()), is_at_rest: true })
    }

    /// Continues a stop on the path, after the executor.
    #[inline]
    pub(super) fn continue_stop(&mut self, intake: &Intake<'_, R, AXES>) {
        if let Power::Ending(Ending::Stopping { .. }) = self.power {
            self.tick_of_stop(intake);
        }
    }

    #[cold]
    fn tick_of_stop(&mut self, intake: &Intake<'_, R, AXES>) {
        let Power::Ending(Ending::Stopping { ticks_left, is_at_rest }) = self.power else { return };
        let has_come_to_rest = !is_at_rest && self.trace.executed.state != ExecState::Moving;
        if has_come_to_rest {
            self.power = self.at_rest();
        } else if ticks_left > 0 && (is_at_rest || intake.want_stop()) {
            self.power = Power::Ending(Ending::Stopping { ticks_left: ticks_left - 1, is_at_rest });
        } else {
            self.begin(if is_at_rest { Reaction::Immediate } else { Reaction::Ramp });
        }
    }

    /// Puts out a ramp to 0 V; its last tick is the first one with the drives off.
    #[cold]
    pub(super) fn continue_ramp(&mut self) {
        let Power::Ending(Ending::Ramping { ticks_left }) = self.power else { return };
        let (left, all) = (i64::from(ticks_left) - 1, i64::from(self.guards.reactions.ramp_ticks));
        for (output, &DacCode(from)) in self.trace.axes.iter_mut().zip(&self.guards.ramp_from) {
            let DacCode(still) = output.code;
            let above = (i64::from(from) - i64::from(still)) * left;
            output.code = DacCode(still.wrapping_add(above.checked_div(all).unwrap_or(0) as i16));
        }
        self.power = if left == 0 {
            Power::Off
        } else {
            Power::Ending(Ending::Ramping { ticks_left: ticks_left - 1 })
        };
    }
}

/// The fault of an axis as a fault of the machine.
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
