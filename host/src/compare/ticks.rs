//! The ticks of a plan against the limits of its machine.
//!
//! Consumes a plan; executes it with the kernel's executor, in f64 and without axes; produces the greatest
//! ratios of set values to limits.

use core::convert::Infallible;

use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::program::{Supply, SupplyError};
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;

use crate::machine::Machine;
use crate::planning::{Executable, Plan, PlanningError};
use crate::toolpath::{Vector, norm, subtract};

/// Places in either stream.
const QUEUED: usize = 64;

/// The greatest of each over all ticks, over its limit, where there is one: at most 1 but for rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ratios {
    /// Velocity of an axis.
    pub feed: f64,
    /// Acceleration, of an axis or of the linear axes as a vector.
    pub accel: f64,
    /// Jerk, of an axis or of the linear axes as a vector; what junctions step is not in it.
    pub jerk: f64,
    /// Change of the acceleration vector from one tick to the next, beyond what jerk accounts for, over the
    /// acceleration-step limit.
    pub accel_step: f64,
    /// Change of the velocity vector from one tick to the next, beyond what the set accelerations of both account for, of the
    /// linear axes \[mm/s\]: what a kink steps that is passed. Where acceleration steps, half of that times the tick is in it.
    pub velocity_step_mm_s: f64,
}

/// Why a plan could not be executed.
#[derive(Debug, thiserror::Error)]
pub enum TicksError {
    /// The program is too dense for a tick.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The kernel refused what the planner made.
    #[error("found motion that can't be executed: {0}")]
    Rejected(SupplyError<Infallible>),
    /// The executor stopped with a fault.
    #[error("the executor stops: {0}")]
    Fault(String),
}

/// The ratios of `plan` on `machine`.
///
/// # Errors
/// The plan can't be executed.
pub fn ratios<const N: usize>(plan: &Plan<N>, machine: &Machine<N>) -> Result<Ratios, TicksError> {
    let executable = Executable::new::<f64>(plan)?;
    let start = [Position::ZERO; N];
    let mut streams = Streams::<f64, N, QUEUED, QUEUED>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<f64, N>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let (path, jerk_mm_s3) = (&machine.path, machine.rules().limits.jerk_mm_s3);
    let is_linear = machine.linear_places();
    // The part of a vector that the limits of the path bind.
    let linear = |vector: Vector<N>| -> Vector<N> {
        core::array::from_fn(|axis| if is_linear[axis] { vector[axis] } else { 0.0 })
    };
    let (mut ratios, mut last_accel, mut last_velocity) = (Ratios::default(), [0.0; N], [0.0; N]);
    loop {
        supply.fill(&mut feeder).map_err(TicksError::Rejected)?;
        let executed = executor.tick(&mut intake).map_err(|fault| TicksError::Fault(format!("{fault:?}")))?;
        let (accel, jerk) =
            (executed.setpoints.map(|set| set.accel_mm_s2), executed.setpoints.map(|set| set.jerk_mm_s3));
        for (set, axis) in executed.setpoints.iter().zip(&machine.axes) {
            ratios.feed = ratios.feed.max(set.velocity_mm_s.abs() / axis.feed_mm_s);
            ratios.accel = ratios.accel.max(set.accel_mm_s2.abs() / axis.accel_mm_s2);
            ratios.jerk = ratios.jerk.max(set.jerk_mm_s3.abs() / axis.jerk_mm_s3);
        }
        ratios.accel = ratios.accel.max(norm(linear(accel)) / path.accel_mm_s2);
        ratios.jerk = ratios.jerk.max(norm(linear(jerk)) / path.jerk_mm_s3);
        let step = norm(subtract(accel, last_accel)) - jerk_mm_s3 * plan.tick_s;
        ratios.accel_step = ratios.accel_step.max(step / path.accel_step_mm_s2);
        let velocity = executed.setpoints.map(|set| set.velocity_mm_s);
        let stepped = core::array::from_fn(|axis| {
            let by_accel = (accel[axis] + last_accel[axis]) / 2.0 * plan.tick_s;
            velocity[axis] - last_velocity[axis] - by_accel
        });
        ratios.velocity_step_mm_s = ratios.velocity_step_mm_s.max(norm(linear(stepped)));
        (last_accel, last_velocity) = (accel, velocity);
        match executed.state {
            ExecState::Idle if supply.is_empty() => return Ok(ratios),
            ExecState::Stopped => executor.resume(),
            _ => {}
        }
    }
}
