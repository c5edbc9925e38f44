//! The ticks of a run.
//!
//! Consumes a [`Job`] and [`Hardware`]; whatever the hardware is, kernel, streams and background are the
//! same, and so is what they do, to the bit, as long as the hardware's answers are.

use core::convert::Infallible;

use motion_kernel::axis::{AxesConfig, Correction};
use motion_kernel::exec::ExecState;
use motion_kernel::fault::Reaction;
use motion_kernel::kernel::{CorrectedIntake, Kernel};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Item;
use motion_kernel::trace::Trace;

use super::Observer;
use super::background::{Background, Storage};
use super::commands::Commands;
use super::contour::Contour;
use super::error::RunError;
use super::faults;
use super::hardware::{Hardware, SimulatedHardware, simulated};
use super::inject::Injections;
use super::job::{Job, Number, RunOptions, StretchCorrection};
use super::kinks::Kinks;
use super::limit_share::LimitShare;
use super::probing::{Probed, Probing};
use super::summary::{AxisSummary, Collector, RunSummary};
use super::switches::Switches;
use crate::machine::Machine;
use crate::planning::Plan;
use crate::trace::{AxisTick, RunEnd, TraceRow};

/// How long the machine is given to settle before its end position is read \[s\].
const SETTLE_S: f64 = 0.2;

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
    let job = Job::new(options, plan, machine)?;
    on_simulated(machine, options.injections, |hardware| run_on(&job, hardware, observe))
}

/// What `work` does with the simulated machine, at rest at the origin, which breaks as `injections` say.
///
/// # Errors
/// The machine can't be simulated, or has no such axis; and those of `work`.
pub fn on_simulated<const N: usize, T>(
    machine: &Machine<N>,
    injections: Option<&Injections>,
    work: impl FnOnce(&mut SimulatedHardware<'_, N>) -> Result<T, RunError>,
) -> Result<T, RunError> {
    let simulated = simulated(machine)?;
    let mut hardware = SimulatedHardware::new(&simulated)?;
    if let Some(injections) = injections {
        hardware.breaks = injections.of(machine)?;
    }
    work(&mut hardware)
}

/// Runs `job` on `hardware`.
///
/// Under live control, streams of nine places pass through the stack when they are made, which takes 3 MB of it: more than
/// a thread has that is started without saying so.
///
/// # Errors
/// The job can't be executed. Faults of the run itself are in the summary.
pub fn run_on<const N: usize>(
    job: &Job<N>,
    hardware: &mut impl Hardware<N>,
    observe: &mut Observer<'_, N>,
) -> Result<RunSummary, RunError> {
    match job.number {
        Number::F32 => run_in::<f32, N>(job, hardware, observe),
        Number::F64 => run_in::<f64, N>(job, hardware, observe),
        Number::Fixed => run_in::<Fixed, N>(job, hardware, observe),
    }
}

fn run_in<R: Real, const N: usize>(
    job: &Job<N>,
    hardware: &mut impl Hardware<N>,
    observe: &mut Observer<'_, N>,
) -> Result<RunSummary, RunError> {
    let mut memory = Memory::<R, N>::new(job);
    let mut execution = Execution::new(job, &mut memory, hardware)?;
    while execution.tick(observe)? {}
    Ok(execution.finish())
}

/// What a run keeps its streams in, and what was learnt.
pub struct Memory<'job, R: Real, const N: usize> {
    storage: Storage<'job, R, N>,
    knots_mm_s: Vec<[R; N]>,
}

impl<'job, R: Real, const N: usize> Memory<'job, R, N> {
    /// For one run of a job.
    #[must_use]
    pub fn new(job: &'job Job<N>) -> Self {
        let of_axis = |knot: &[f64; 3], axis: usize| R::from_f64(knot.get(axis).copied().unwrap_or_default());
        let knots_mm_s = job
            .correction
            .iter()
            .flat_map(|correction| &correction.knots_mm_s)
            .map(|knot| core::array::from_fn(|axis| of_axis(knot, axis)))
            .collect();
        Self { storage: Storage::new(job.script.as_ref(), &job.info), knots_mm_s }
    }
}

/// The items of a job, as the background takes them.
type Items<'a, const N: usize> =
    core::iter::Map<core::slice::Iter<'a, Item<N>>, fn(&'a Item<N>) -> Result<Item<N>, Infallible>>;

/// A run on its way, from one tick to the next.
pub struct Execution<'a, R: Real, H, const N: usize> {
    job: &'a Job<N>,
    hardware: &'a mut H,
    config: AxesConfig<R, N>,
    kernel: Kernel<R, N>,
    background: Background<'a, R, Items<'a, N>, N>,
    intake: CorrectedIntake<'a, R, N>,
    summary: RunSummary,
    collector: Collector<N>,
    contour: Contour<N>,
    kinks: Kinks<N>,
    limit_share: LimitShare<'a, N>,
    probing: Probing<'a>,
    commands: Commands<'a>,
    switches: Switches<'a>,
    stops: u64,
    stopped_ticks: u64,
    state: ExecState,
    s_mm: f64,
    /// The hardware takes another tick.
    goes_on: bool,
}

impl<'a, R: Real, H: Hardware<N>, const N: usize> Execution<'a, R, H, N> {
    /// Before the first tick of `job` on `hardware`.
    ///
    /// # Errors
    /// The job can't be executed.
    pub fn new(
        job: &'a Job<N>,
        memory: &'a mut Memory<'_, R, N>,
        hardware: &'a mut H,
    ) -> Result<Self, RunError> {
        let Job { header, info, correction, script, .. } = job;
        let tick_s = header.tick_s;
        let config = job.axes_config()?;
        let mut kernel = Kernel::<R, N>::new(&config, header.start, hardware.start_counts());
        kernel.enable(0);
        let items: Items<'a, N> = job.items.iter().map(|&item| Ok(item));
        let place = (header.start, job.guards.travel());
        let (background, intake) = memory.storage.split(header.rules, place, items, (header.pulse, tick_s));
        let mut intake = CorrectedIntake::from(intake);
        if let &Some(StretchCorrection { stretch, knot_ticks, bound_mm_s, .. }) = correction {
            intake.correct(Correction::new(stretch, &memory.knots_mm_s, knot_ticks, bound_mm_s)?)?;
        }
        let summary = RunSummary {
            tick_s,
            planned_time_s: info.planned_time_s,
            path_length_mm: info.path_length_mm,
            axes: info.axes.iter().map(|axis| AxisSummary::new(&axis.name, axis.letter)).collect(),
            notices: info.notices.clone(),
            end: RunEnd::Cut,
            ..RunSummary::default()
        };
        Ok(Self {
            job,
            hardware,
            config,
            kernel,
            background,
            intake,
            summary,
            collector: Collector::new(),
            contour: Contour::new(info.linear_places()),
            kinks: Kinks::of(&job.items),
            limit_share: LimitShare::new(info),
            probing: Probing::new(info),
            commands: Commands::new(script.as_ref(), tick_s),
            switches: Switches::new(&info.switch_lines),
            stops: 0,
            stopped_ticks: 0,
            state: ExecState::Idle,
            s_mm: 0.0,
            goes_on: true,
        })
    }

    /// Runs a tick. False: it was the last one.
    ///
    /// # Errors
    /// The background can't go on with the job.
    pub fn tick(&mut self, observe: &mut Observer<'_, N>) -> Result<bool, RunError> {
        let Self { job, hardware, kernel, background, intake, summary, collector, switches, .. } = self;
        let Job { header, info, .. } = job;
        background
            .poll((collector.ticks(), self.s_mm), self.state, (&mut *switches, &mut **hardware))
            .map_err(RunError::Rejected)?;
        let was_idle = self.state == ExecState::Idle;
        let trace = *kernel.tick_corrected(intake, &mut **hardware);
        self.goes_on = hardware.advance(&trace);
        let state = trace.executed.state;
        self.state = state;
        // Only the next poll may find that outputs are to be switched.
        self.stopped_ticks += u64::from(was_idle && state == ExecState::Idle && background.due().is_some());
        // What is idle after the last item is no longer part of the program, but for the tick in which
        // it ended.
        let ended = background.ended(state);
        let start_mm = info.starts_mm.get(trace.executed.stretches as usize).copied();
        let start_mm = start_mm.unwrap_or(info.path_length_mm);
        let mut row = trace_row(&trace, start_mm, &mut self.contour);
        collector.add(&row);
        self.limit_share.add(&row);
        let at = (u64::from(trace.executed.stretches), trace.executed.motion.s);
        let kinks_mm_s2 = self.kinks.passed(at, row.v_mm_s, header.tick_s);
        for (axis, kink_mm_s2) in row.axes.iter_mut().zip(kinks_mm_s2) {
            axis.acc_mm_s2 += kink_mm_s2;
        }
        self.probing.tick(&trace);
        self.commands.add(background.given(), &row);
        self.s_mm = row.s_mm;
        observe(&row);
        if let Some(fault) = trace.fault {
            summary.end = RunEnd::Faulted;
            if summary.faults.is_empty() {
                let setpoints = &trace.executed.setpoints;
                summary.faults.push(faults::traced(&fault, (header, info), &self.config, setpoints));
            }
            switches.off(collector.ticks(), &mut **hardware);
            return Ok(self.goes_on && kernel.reaction() != Some(Reaction::Immediate));
        }
        if let Some(end) = ended {
            summary.end = end;
            if end == RunEnd::Aborted {
                switches.off(collector.ticks(), &mut **hardware);
            }
            return Ok(false);
        }
        if state == ExecState::Stopped {
            self.stops += 1;
            self.stopped_ticks += 1;
            kernel.resume();
        }
        Ok(self.goes_on)
    }

    /// Lets the machine settle, and tells what the run came to.
    #[must_use]
    pub fn finish(self) -> RunSummary {
        let Self { job, hardware, mut kernel, background, mut intake, mut summary, mut probing, .. } = self;
        let tick_s = job.header.tick_s;
        self.collector.fill(&mut summary);
        summary.outputs = self.switches.noted();
        match background.starvations() {
            0 => {}
            1 => summary.notices.push("1 stop on the path because data came too late".to_owned()),
            more => summary.notices.push(format!("{more} stops on the path because data came too late")),
        }
        (summary.commands, summary.unreached) = self.commands.finish();
        summary.limit_active_share = self.limit_share.share();
        summary.time_s = (summary.ticks - self.stopped_ticks) as f64 * tick_s;
        match self.stops {
            0 => {}
            1 => summary.notices.push("1 program stop: resumed at once".to_owned()),
            more => summary.notices.push(format!("{more} program stops: resumed at once")),
        }
        let mut goes_on = self.goes_on;
        let mut last = None;
        for _ in 0..(SETTLE_S / tick_s) as u64 {
            if !goes_on {
                break;
            }
            let trace = *kernel.tick_corrected(&mut intake, hardware);
            goes_on = hardware.advance(&trace);
            probing.tick(&trace);
            last = Some(trace);
        }
        summary.probes = probing.finish();
        summary.notices.extend(summary.probes.iter().filter_map(Probed::disagreement));
        let end = last.iter().flat_map(|trace| &trace.axes);
        for ((axis, end), figures) in summary.axes.iter_mut().zip(end).zip(&job.header.axes) {
            let error_mm = end.following_error_mm.to_f64();
            axis.end_error_counts = (error_mm / figures.mm_per_count.abs()).round() as i64;
        }
        summary
    }
}

pub(crate) fn trace_row<R: Real, const N: usize>(
    trace: &Trace<R, N>,
    start_mm: f64,
    contour: &mut Contour<N>,
) -> TraceRow<N> {
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
    TraceRow {
        tick: trace.tick,
        s_mm: start_mm + motion.s.to_mm(),
        v_mm_s: motion.v_mm_s.to_f64(),
        a_mm_s2: motion.a_mm_s2.to_f64(),
        j_mm_s3: motion.j_mm_s3.to_f64(),
        snap_mm_s4: motion.snap_mm_s4.to_f64(),
        state: state_name(executed.state, trace.fault.is_some()),
        line: executed.line,
        contour_um: contour.error_um(&axes),
        axes,
    }
}

/// All names of states.
pub(crate) fn state_names() -> [&'static str; 6] {
    use ExecState::{Dwell, Held, Idle, Moving, Stopped};
    let [idle, moving, dwell, stopped, held] =
        [Idle, Moving, Dwell, Stopped, Held].map(|state| state_name(state, false));
    [idle, moving, dwell, stopped, held, state_name(Idle, true)]
}

/// What records call a state.
pub(crate) fn state_name(state: ExecState, is_faulted: bool) -> &'static str {
    if is_faulted {
        return "fault";
    }
    match state {
        ExecState::Idle => "idle",
        ExecState::Moving => "moving",
        ExecState::Dwell => "dwell",
        ExecState::Stopped => "stopped",
        ExecState::Held => "held",
    }
}
