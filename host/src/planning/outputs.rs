//! Spindle and coolant of a program on a machine: what is switched, and the wait behind it.
//!
//! Consumes the [`Outputs`] of steps; produces the states that the machine's outputs take. What the machine has no
//! output for is left out, which notices tell, or, for a board, refused by [`require_outputs`]. What an output
//! can't do is refused.

use motion_kernel::hal::{OutputState, Spindle};

use super::error::{PlanningError, Problem};
use crate::gcode::{NoticeKind, Outputs, SpindleSpeed, Step, StepKind};
use crate::machine::{Machine, SpindleSettings};

/// The outputs as the program has switched them so far.
pub(super) struct Switches<'m, const N: usize> {
    machine: &'m Machine<N>,
    now: OutputState,
}

impl<'m, const N: usize> Switches<'m, N> {
    /// All off.
    pub(super) fn new(machine: &'m Machine<N>) -> Self {
        Self { machine, now: OutputState::OFF }
    }

    /// What to switch to, and how long to wait then \[s\]; none if the machine's outputs stay as they are.
    pub(super) fn next(&mut self, to: &Outputs) -> Result<Option<(OutputState, f64)>, Problem> {
        let mut next = OutputState::OFF;
        let mut wait_s = 0.0;
        if let Some(settings) = &self.machine.spindle {
            (next.spindle, next.speed_rpm) = (to.spindle, speed_rpm(settings, to)?);
            if (next.spindle, next.speed_rpm) != (self.now.spindle, self.now.speed_rpm) {
                wait_s = if next.spindle_turns() { settings.start_s } else { settings.stop_s };
            }
        }
        if let Some(settings) = &self.machine.coolant {
            for (word, is_on, has) in [("M7", to.mist, settings.mist), ("M8", to.flood, settings.flood)] {
                if is_on && !has {
                    return Err(Problem::Coolant { word });
                }
            }
            (next.flood, next.mist) = (to.flood, to.mist);
        }
        let is_other = next != self.now;
        self.now = next;
        Ok(is_other.then_some((next, wait_s)))
    }
}

/// The speed if this spindle can turn so.
fn speed_rpm(settings: &SpindleSettings, to: &Outputs) -> Result<f64, Problem> {
    if to.spindle == Spindle::Counterclockwise && !settings.reverses {
        return Err(Problem::SpindleDirection);
    }
    match to.speed {
        SpindleSpeed::Surface(_) => Err(Problem::SurfaceSpeed),
        SpindleSpeed::Rpm(found_rpm) if found_rpm > settings.speed_max_rpm => {
            Err(Problem::SpindleSpeed { found_rpm, max_rpm: settings.speed_max_rpm })
        }
        SpindleSpeed::Rpm(speed_rpm) => Ok(speed_rpm),
    }
}

/// Whether the machine acts on what a notice says is not acted on.
pub(super) fn acts_on<const N: usize>(machine: &Machine<N>, kind: NoticeKind) -> bool {
    match kind {
        NoticeKind::Spindle | NoticeKind::SpindleSpeed => machine.spindle.is_some(),
        NoticeKind::Coolant => machine.coolant.is_some(),
        _ => false,
    }
}

/// Refuses a program that switches on what the machine has no output for.
///
/// # Errors
/// The first such word, with its line.
pub fn require_outputs<const N: usize>(
    source_name: &str,
    steps: &[Step],
    machine: &Machine<N>,
) -> Result<(), PlanningError> {
    for step in steps {
        let StepKind::Switch(to) = &step.kind else { continue };
        let spindle = match to.spindle {
            Spindle::Off => None,
            Spindle::Clockwise => Some("M3"),
            Spindle::Counterclockwise => Some("M4"),
        };
        let coolant = to.mist.then_some("M7").or(to.flood.then_some("M8"));
        let lacking = (spindle.filter(|_| machine.spindle.is_none()).map(|word| (word, "spindle")))
            .or(coolant.filter(|_| machine.coolant.is_none()).map(|word| (word, "coolant")));
        if let Some((word, table)) = lacking {
            let problem = Problem::NoOutput { word, table };
            return Err(PlanningError::at_line(source_name, (step.line, problem)));
        }
    }
    Ok(())
}
