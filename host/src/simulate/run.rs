//! The ticks of a run.

use core::convert::Infallible;

use motion_kernel::axis::{Correction, CorrectionError};
use motion_kernel::exec::ExecState;
use motion_kernel::hal::Encoder;
use motion_kernel::kernel::Kernel;
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::SupplyError;
use motion_kernel::trace::Trace;
use motion_kernel::units::Position;

use super::Observer;
use super::background::Storage;
use super::contour::Contour;
use super::faults;
use super::inject::{InjectionError, Injections};
use super::limit_share::LimitShare;
use super::live::Script;
use super::rig::{Rig, Simulated};
use super::summary::{Collector, RunSummary};
use crate::machine::{AxisError, Machine};
use crate::planning::{Executable, Item as PlanItem, Plan, PlanningError};
use crate::record::{AXES, AxisTick, TickRecord};

/// How long the machine is given to settle before its end position is read \[s\].
const SETTLE_S: f64 = 0.2;

/// The number type of the kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Number {
    /// As on a board with a single-precision FPU.
    #[default]
    F32,
    /// The reference.
    F64,
    /// As on a board without an FPU.
    Fixed,
}

/// A correction of one stretch of a program, for the kernel's [`Correction`].
#[derive(Clone, Debug, PartialEq)]
pub struct StretchCorrection {
    /// Which stretch, from 0.
    pub stretch: u32,
    /// Ticks from knot to knot.
    pub knot_ticks: u16,
    /// Velocity commands \[mm/s\], the first one in the stretch's first tick.
    pub knots_mm_s: Vec<[f64; AXES]>,
    /// No knot is of a greater magnitude \[mm/s\].
    pub bound_mm_s: f64,
}

/// How a program is run.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunOptions<'a> {
    /// The kernel's number type.
    pub number: Number,
    /// What was learnt of one of its stretches.
    pub correction: Option<&'a StretchCorrection>,
    /// Live control.
    pub script: Option<&'a Script>,
    /// What breaks.
    pub injections: Option<&'a Injections>,
}

/// Why a run could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The plan can't be executed.
    #[error(transparent)]
    Planning(#[from] PlanningError),
    /// The machine's parameters can't be used.
    #[error(transparent)]
    Machine(#[from] AxisError),
    /// The simulated machine can't be built.
    #[error("simulated machine: {0}")]
    Simulation(String),
    /// What is to break is not there.
    #[error(transparent)]
    Injection(#[from] InjectionError),
    /// The correction can't be used.
    #[error("correction: {0}")]
    Correction(#[from] CorrectionError),
    /// The kernel refused what the planner made.
    #[error("the kernel rejects the plan: {0}")]
    Rejected(SupplyError<Infallible>),
}

/// Runs `plan` in f32, as a board would.
///
/// # Errors
/// The plan or the machine can't be executed. Faults of the run itself are in the summary.
pub fn run(plan: &Plan, machine: &Machine, observe: &mut Observer<'_>) -> Result<RunSummary, RunError> {
    run_with(&RunOptions::default(), plan, machine, observe)
}

/// Runs `plan` as `options` say.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    options: &RunOptions<'_>,
    plan: &Plan,
    machine: &Machine,
    observe: &mut Observer<'_>,
) -> Result<RunSummary, RunError> {
    match options.number {
        Number::F32 => run_in::<f32>(options, plan, machine, observe),
        Number::F64 => run_in::<f64>(options, plan, machine, observe),
        Number::Fixed => run_in::<Fixed>(options, plan, machine, observe),
    }
}

fn run_in<R: Real>(
    options: &RunOptions<'_>,
    plan: &Plan,
    machine: &Machine,
    observe: &mut Observer<'_>,
) -> Result<RunSummary, RunError> {
    let &RunOptions { correction, script, injections, .. } = options;
    if let Some(injections) = injections {
        injections.check(machine)?;
    }
    let executable = Executable::new::<R>(plan)?;
    let starts: Vec<f64> = plan
        .items
        .iter()
        .filter_map(|item| match item {
            PlanItem::Stretch(stretch) => Some(stretch.start_mm),
            PlanItem::Dwell { .. } | PlanItem::Stop { .. } => None,
        })
        .collect();
    let simulated =
        Simulated::new(&machine.simulated()).map_err(|error| RunError::Simulation(error.to_string()))?;
    let mut rig = Rig::new(&simulated).map_err(|error| RunError::Simulation(format!("{error:?}")))?;
    let Ok(counts) = rig.latch();
    let start = [Position::ZERO; AXES];
    let config = machine.axes_config()?;
    let mut kernel = Kernel::<R, AXES>::new(&config, start, counts);
    kernel.enable(0);
    let knots_mm_s: Vec<[R; AXES]> = correction
        .iter()
        .flat_map(|correction| &correction.knots_mm_s)
        .map(|knot| knot.map(R::from_f64))
        .collect();
    let mut storage = Storage::<R>::new(script);
    let (mut background, mut intake) =
        storage.split(machine.rules(), (start, machine.travel()), executable.supplied(), executable.tick_s);
    if let Some(&StretchCorrection { stretch, knot_ticks, bound_mm_s, .. }) = correction {
        intake.correct(Correction::new(stretch, &knots_mm_s, knot_ticks, bound_mm_s)?);
    }

    let mut summary = RunSummary {
        tick_s: machine.tick_s,
        planned_time_s: plan.time_s,
        path_length_mm: plan.length_mm,
        notices: plan.notices.clone(),
        ..RunSummary::default()
    };
    let mut collector = Collector::default();
    let mut contour = Contour::default();
    let mut limit_share = LimitShare::new(plan, machine);
    let (mut stops, mut stopped_ticks) = (0_u64, 0_u64);
    loop {
        if kernel.wants_hold() {
            background.hold();
        }
        background.turn(collector.ticks()).map_err(RunError::Rejected)?;
        if let Some(injections) = injections {
            injections.apply(collector.ticks(), machine, &mut rig);
        }
        let trace = *kernel.tick(&mut intake, &mut rig);
        simulated.advance();
        let state = trace.executed.state;
        // What is idle after the last item is no longer part of the program, but for the tick in which
        // it ended.
        let ended = background.ended(state);
        let start_mm = starts.get(trace.executed.stretches as usize).copied().unwrap_or(plan.length_mm);
        let record = tick_record(&trace, start_mm, &mut contour);
        collector.add(&record);
        limit_share.add(&record);
        observe(&record);
        if let Some(fault) = trace.fault {
            if summary.faults.is_empty() {
                let motion = config.axes.iter().zip(&trace.executed.setpoints);
                let mut limits_mm = motion.map(|(axis, setpoint)| axis.following_error_limit_mm_in(setpoint));
                let limits_mm = [(); AXES].map(|()| limits_mm.next().unwrap_or(R::ZERO));
                summary.faults.push(faults::record(&fault, machine, limits_mm));
            }
            if kernel.is_off() {
                break;
            }
            continue;
        }
        if let Some(reason) = ended {
            summary.notices.extend(reason.map(str::to_owned));
            break;
        }
        if state == ExecState::Stopped {
            stops += 1;
            stopped_ticks += 1;
            kernel.resume();
        }
    }
    collector.fill(&mut summary);
    match background.starvations() {
        0 => {}
        1 => summary.notices.push("1 stop on the path because data came too late".to_owned()),
        more => summary.notices.push(format!("{more} stops on the path because data came too late")),
    }
    summary.limit_active_share = limit_share.share();
    summary.time_s = (summary.ticks - stopped_ticks) as f64 * machine.tick_s;
    if stops > 0 {
        summary.notices.push(match stops {
            1 => "1 program stop: resumed at once".to_owned(),
            _ => format!("{stops} program stops: resumed at once"),
        });
    }
    let mut last = None;
    for _ in 0..(SETTLE_S / machine.tick_s) as u64 {
        last = Some(*kernel.tick(&mut intake, &mut rig));
        simulated.advance();
    }
    for (index, (axis, settings)) in summary.axes.iter_mut().zip(&machine.axes).enumerate() {
        axis.name.clone_from(&settings.name);
        if let Some(trace) = &last {
            let error_mm = trace.axes[index].following_error_mm.to_f64();
            axis.end_error_counts = (error_mm / settings.mm_per_count.abs()).round() as i64;
        }
    }
    Ok(summary)
}

fn tick_record<R: Real>(trace: &Trace<R, AXES>, start_mm: f64, contour: &mut Contour) -> TickRecord {
    let executed = &trace.executed;
    let motion = &executed.motion;
    let axes = core::array::from_fn(|index| {
        let (setpoint, output) = (&executed.setpoints[index], &trace.axes[index]);
        AxisTick {
            set_mm: output.set.to_mm(),
            vel_mm_s: setpoint.velocity_mm_s.to_f64(),
            acc_mm_s2: setpoint.accel_mm_s2.to_f64(),
            jerk_mm_s3: setpoint.jerk_mm_s3.to_f64(),
            act_mm: output.actual.to_mm(),
            err_um: output.following_error_mm.to_f64() * 1e3,
            out_v: output.code.to_volts(),
        }
    });
    TickRecord {
        tick: trace.tick,
        s_mm: start_mm + motion.s.to_mm(),
        v_mm_s: motion.v_mm_s.to_f64(),
        a_mm_s2: motion.a_mm_s2.to_f64(),
        j_mm_s3: motion.j_mm_s3.to_f64(),
        snap_mm_s4: motion.snap_mm_s4.to_f64(),
        state: state_name(trace),
        line: executed.line,
        contour_um: contour.error_um(&axes),
        axes,
    }
}

fn state_name<R: Real>(trace: &Trace<R, AXES>) -> &'static str {
    if trace.fault.is_some() {
        return "fault";
    }
    match trace.executed.state {
        ExecState::Idle => "idle",
        ExecState::Moving => "moving",
        ExecState::Dwell => "dwell",
        ExecState::Stopped => "stopped",
        ExecState::Held => "held",
    }
}
