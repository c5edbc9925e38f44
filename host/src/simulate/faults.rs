//! Faults for people: names, figures, and the table of what is found how, and how it ends.

use motion_kernel::axis::AxesConfig;
use motion_kernel::exec::ExecFault;
use motion_kernel::fault::{Fault, FaultKind, Reaction};
use motion_kernel::num::Real;
use motion_kernel::path::Setpoint;
use motion_kernel::program::Header;

use super::job::RunInfo;
use crate::trace::TracedFault;

/// A fault as a run records it, of a job's machine in the tick's motion.
pub(super) fn traced<R: Real, const N: usize>(
    fault: &Fault<R>,
    job: (&Header<N>, &RunInfo),
    config: &AxesConfig<R, N>,
    setpoints: &[Setpoint<R>; N],
) -> TracedFault {
    let (header, info) = job;
    let (name, axis) = (name(&fault.kind), axis(&fault.kind));
    let unit = axis.map_or("mm", |axis| info.unit_of(axis).symbol());
    let detail = match fault.kind {
        FaultKind::Executor(cause) => format!("{cause:?}"),
        FaultKind::FollowingError { axis, error_mm } => {
            let limit_mm = config.axes[axis].following_error_limit_mm_in(&setpoints[axis]);
            format!("{:.3} {unit}, limit {:.3} {unit}", error_mm.to_f64(), limit_mm.to_f64())
        }
        FaultKind::EncoderJump { axis, jump_mm } => {
            let counts = jump_mm.to_f64() / header.axes[axis].mm_per_count;
            format!("{counts:.0} counts in a tick that no motor moves")
        }
        FaultKind::SetpointJump { jump_mm, .. } => {
            format!("{:.4} {unit} in a tick that no accepted motion makes", jump_mm.to_f64())
        }
        FaultKind::TickMissed { ticks } => format!("{ticks} ticks did not come"),
        ref kind => row(kind).rule.to_owned(),
    };
    let axis = axis.map(|axis| info.name_of(axis));
    TracedFault { tick: fault.tick, axis, fault: name.to_owned(), detail }
}

fn axis<R>(kind: &FaultKind<R>) -> Option<usize> {
    match *kind {
        FaultKind::FollowingError { axis, .. }
        | FaultKind::EncoderLost { axis }
        | FaultKind::EncoderJump { axis, .. }
        | FaultKind::Runaway { axis }
        | FaultKind::Saturated { axis }
        | FaultKind::SoftLimit { axis }
        | FaultKind::SetpointJump { axis, .. }
        | FaultKind::NotFinite { axis }
        | FaultKind::Drive { axis }
        | FaultKind::DriveNotReady { axis }
        | FaultKind::LimitSwitch { axis } => Some(axis),
        FaultKind::Executor(_)
        | FaultKind::Encoder
        | FaultKind::Inputs
        | FaultKind::Output
        | FaultKind::Enable
        | FaultKind::EmergencyStop
        | FaultKind::TickOverrun
        | FaultKind::TickMissed { .. } => None,
    }
}

/// The name of a kind of fault.
pub fn name<R>(kind: &FaultKind<R>) -> &'static str {
    row(kind).name
}

/// A fault that a board tells, in one line, with what has to be done before it is cleared.
pub(crate) fn told<R: Real>(kind: &FaultKind<R>, name_of_axis: impl Fn(usize) -> String) -> String {
    let Row { name, rule, clears, .. } = row(kind);
    let axis = axis(kind).map(|axis| format!(" of {}", name_of_axis(axis))).unwrap_or_default();
    let figure = match kind {
        FaultKind::FollowingError { error_mm: mm, .. }
        | FaultKind::EncoderJump { jump_mm: mm, .. }
        | FaultKind::SetpointJump { jump_mm: mm, .. } => format!(" ({:.4})", mm.to_f64()),
        FaultKind::Executor(cause) => format!(" ({cause:?})"),
        FaultKind::TickMissed { ticks } => format!(" ({ticks})"),
        _ => String::new(),
    };
    format!("{name}{axis}{figure}: {rule}; to clear it: {clears}")
}

/// What is said of a kind of fault.
struct Row {
    name: &'static str,
    /// When it is one.
    rule: &'static str,
    /// How long it takes to be found.
    time: &'static str,
    /// What has to be done before it is cleared, or it comes again.
    clears: &'static str,
}

fn row<R>(kind: &FaultKind<R>) -> Row {
    let (name, rule, time, clears) = match kind {
        FaultKind::Executor(_) => (
            "executor",
            "data came too late, or too densely for a tick, or begin elsewhere than the machine stands",
            "the tick",
            "new streams",
        ),
        FaultKind::FollowingError { .. } => (
            "following error",
            "beyond the limit at rest + what grows with velocity and acceleration",
            "the tick",
            "the cause: load, limits, tuning",
        ),
        FaultKind::EncoderLost { .. } => (
            "encoder lost",
            "no counts while commanded to move: its cable, or the axis is blocked",
            "the tick above jump_mm a tick; else response_s + 2 rounds of samples while commanded above moving_mm_s",
            "the encoder, and homing",
        ),
        FaultKind::EncoderJump { .. } => (
            "encoder jump",
            "second difference of the counts beyond what drive and noise make",
            "the tick, for jumps above twice jump_mm",
            "homing",
        ),
        FaultKind::Runaway { .. } => (
            "runaway",
            "the axis loses velocity towards its command faster than by load, or counts the other way: reversed encoder \
             or drive, or a collision",
            "with the following error, or response_s + 2 rounds of samples",
            "the wiring",
        ),
        FaultKind::Saturated { .. } => (
            "saturation",
            "the output is at its limit in every sample for too long",
            "saturation_s + 2 rounds of samples",
            "the load",
        ),
        FaultKind::SoftLimit { .. } => (
            "soft limit",
            "the set position is beyond the travel, and on its way farther out",
            "1 round of samples",
            "driving back, which is allowed",
        ),
        FaultKind::SetpointJump { .. } => (
            "set-point jump",
            "second difference of the following error, but not of the counts: a corrupted piece or segment",
            "the tick, for jumps above twice jump_mm",
            "new streams",
        ),
        FaultKind::NotFinite { .. } => {
            ("not a number", "a set value or the command is not a number", "the tick", "new streams")
        }
        FaultKind::Encoder => ("encoder", "the encoders could not be read", "the tick", "the bus"),
        FaultKind::Inputs => ("inputs", "the digital inputs could not be read", "the tick", "the bus"),
        FaultKind::Output => (
            "output",
            "the converter could not be written",
            "the tick; outputs from the next one on",
            "the bus",
        ),
        FaultKind::Enable => (
            "enable",
            "the drives could not be switched",
            "the tick; outputs from the next one on",
            "the output",
        ),
        FaultKind::EmergencyStop => {
            ("emergency stop", "the emergency stop is open", "the tick", "closing it")
        }
        FaultKind::Drive { .. } => ("drive", "the drive reports a fault", "the tick", "the drive"),
        FaultKind::DriveNotReady { .. } => (
            "drive not ready",
            "the drive is not ready, although it is enabled and has settled",
            "the tick",
            "the drive",
        ),
        FaultKind::LimitSwitch { .. } => (
            "limit switch",
            "it is reached, or motion is towards it",
            "the tick; the next one where it was reached before",
            "driving off it, which is allowed",
        ),
        FaultKind::TickOverrun => {
            ("tick overrun", "a tick took longer than its period", "the tick's end", "nothing")
        }
        FaultKind::TickMissed { .. } => {
            ("tick missed", "ticks did not come", "the next tick that comes", "nothing")
        }
    };
    Row { name, rule, time, clears }
}

/// Every kind of fault once, with figures that say nothing.
fn kinds() -> [FaultKind<f32>; 19] {
    let (axis, jump_mm) = (0, 0.0);
    [
        FaultKind::EmergencyStop,
        FaultKind::Drive { axis },
        FaultKind::DriveNotReady { axis },
        FaultKind::LimitSwitch { axis },
        FaultKind::SoftLimit { axis },
        FaultKind::FollowingError { axis, error_mm: 0.0 },
        FaultKind::EncoderLost { axis },
        FaultKind::EncoderJump { axis, jump_mm },
        FaultKind::Runaway { axis },
        FaultKind::Saturated { axis },
        FaultKind::SetpointJump { axis, jump_mm },
        FaultKind::NotFinite { axis },
        FaultKind::Executor(ExecFault::NotHere),
        FaultKind::TickOverrun,
        FaultKind::TickMissed { ticks: 1 },
        FaultKind::Encoder,
        FaultKind::Inputs,
        FaultKind::Output,
        FaultKind::Enable,
    ]
}

/// The table of all faults, in Markdown.
#[must_use]
pub fn table() -> String {
    let mut text =
        "| fault | found when | found in | ends in | before it is cleared |\n|---|---|---|---|---|\n"
            .to_owned();
    for kind in kinds() {
        let Row { name, rule, time, clears } = row(&kind);
        let reaction = match (&kind, kind.reaction(Reaction::Immediate)) {
            (FaultKind::EmergencyStop, _) => "as `faults.emergency_stop` says",
            (_, Reaction::Stop) => "stop on the path",
            (_, Reaction::Ramp) => "ramp to 0 V",
            (_, Reaction::Immediate) => "0 V and drives off at once",
        };
        text += &format!("| {name} | {rule} | {time} | {reaction} | {clears} |\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every kind has a row, and no two have the same name: the match in `row` knows them all, and so must
    /// the list.
    #[test]
    fn every_kind_has_its_row() {
        let mut names: Vec<_> = kinds().iter().map(name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), kinds().len());
    }
}
