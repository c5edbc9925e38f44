//! The executed ticks of a plan, held against the machine's limits.

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Plan};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::num::Real;
use motion_kernel::program::Supply;
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;

use super::{minus, norm};

/// What the ticks of a program came to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Worst {
    /// Greatest |V|, |A|, |J| of an axis over its limit.
    pub(super) axis: [f64; 3],
    /// Greatest magnitude of A and J as vectors over the path's limit.
    pub(super) path: [f64; 2],
    /// Greatest change of an axis' jerk in a tick, over what snap allows.
    pub(super) jerk_step: f64,
    /// Greatest change of the acceleration vector in a tick \[mm/s²\].
    pub(super) accel_step_mm_s2: f64,
    pub(super) ticks: u64,
}

/// Executes a plan with the kernel's executor and looks at every tick.
pub(super) fn driven<R: Real>(plan: &Plan, machine: &Machine) -> Result<Worst, String> {
    let executable = Executable::new::<R>(plan).map_err(|error| error.to_string())?;
    let start = [Position::ZERO; 3];
    let mut streams = Streams::<R, 3, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut worst = Worst::default();
    let (mut last_accel, mut last_jerk) = ([0.0; 3], [0.0; 3]);
    loop {
        supply.fill(&mut feeder).map_err(|rejection| format!("rejected: {rejection}"))?;
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        let of = |figure: fn(&motion_kernel::path::Setpoint<R>) -> R| {
            core::array::from_fn::<f64, 3, _>(|axis| figure(&executed.setpoints[axis]).to_f64())
        };
        let (v, a, j) = (of(|s| s.velocity_mm_s), of(|s| s.accel_mm_s2), of(|s| s.jerk_mm_s3));
        for (axis, limits) in machine.axes.iter().enumerate() {
            let ratios =
                [v[axis] / limits.feed_mm_s, a[axis] / limits.accel_mm_s2, j[axis] / limits.jerk_mm_s3];
            for (worst, ratio) in worst.axis.iter_mut().zip(ratios) {
                *worst = worst.max(ratio.abs());
            }
            let step = (j[axis] - last_jerk[axis]).abs() / (limits.snap_mm_s4 * machine.tick_s);
            worst.jerk_step = worst.jerk_step.max(step);
        }
        worst.path[0] = worst.path[0].max(norm(a) / machine.path.accel_mm_s2);
        worst.path[1] = worst.path[1].max(norm(j) / machine.path.jerk_mm_s3);
        worst.accel_step_mm_s2 = worst.accel_step_mm_s2.max(norm(minus(a, last_accel)));
        (last_accel, last_jerk) = (a, j);
        worst.ticks += 1;
        match executed.state {
            ExecState::Idle if supply.is_empty() => return Ok(worst),
            ExecState::Stopped => executor.resume(),
            _ => {}
        }
        if worst.ticks as f64 > plan.time_s / machine.tick_s + 1000.0 {
            return Err("no end".to_owned());
        }
    }
}

impl Worst {
    pub(super) fn check(&self) -> Result<(), String> {
        let all = self.axis.iter().chain(&self.path);
        if all.copied().fold(0.0, f64::max) > 1.0 + 1e-6 || self.jerk_step > 1.0 + 1e-6 {
            return Err(format!("{self:?}"));
        }
        Ok(())
    }

    pub(super) fn max(self, other: Self) -> Self {
        Self {
            axis: core::array::from_fn(|index| self.axis[index].max(other.axis[index])),
            path: core::array::from_fn(|index| self.path[index].max(other.path[index])),
            jerk_step: self.jerk_step.max(other.jerk_step),
            accel_step_mm_s2: self.accel_step_mm_s2.max(other.accel_step_mm_s2),
            ticks: self.ticks + other.ticks,
        }
    }
}
