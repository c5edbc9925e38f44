//! What a run executes, and what its records call it by.
//!
//! Consumes a [`Plan`] and a [`Machine`]; produces a [`Job`]: everything that the kernel of a run consumes
//! but the answers of its hardware. Fails where the plan or the machine can't be executed in the number type.

use motion_kernel::axis::{AxesConfig, Compensation, Guards};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::{Header, Item};
use serde::{Deserialize, Serialize};

use super::error::RunError;
use super::inject::Injections;
use super::live::Script;
use super::summary::RunSummary;
use crate::axis_unit::AxisUnit;
use crate::gcode::Axis;
use crate::machine::{AxisError, AxisSettings, Machine};
use crate::planning::{Executable, Item as PlanItem, Plan, PlannedProbe};
use crate::touch::Surface;
use crate::trace::{PathLimits, RunTrace, TraceRow, TracedAxis, TracedBlock};

/// The number type of the kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Number {
    /// As on a board with a single-precision FPU.
    #[default]
    F32,
    /// The reference.
    F64,
    /// As on a board without an FPU.
    Fixed,
}

/// A correction of one stretch of a program, for the kernel's
/// [`Correction`](motion_kernel::axis::Correction).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StretchCorrection {
    /// Which stretch, from 0.
    pub stretch: u32,
    /// Ticks from knot to knot.
    pub knot_ticks: u16,
    /// Velocity commands of the first three axes \[mm/s\], the first one in the stretch's first tick.
    pub knots_mm_s: Vec<[f64; 3]>,
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
    /// An experiment that may drive axes as no program does: nothing but the limits of their following errors
    /// is watched.
    pub is_unguarded: bool,
}

/// A program with its machine, and with what is commanded on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job<const N: usize = 3> {
    /// The kernel's number type.
    pub number: Number,
    /// The machine, as the kernel has to know it.
    pub header: Header<N>,
    /// How its faults are told and end.
    pub guards: Guards<N>,
    /// What its screws need.
    pub compensation: Compensation<N>,
    /// The program, with the blocks of its path.
    pub items: Vec<Item<N>>,
    /// What was learnt of one of its stretches.
    pub correction: Option<StretchCorrection>,
    /// Live control.
    pub script: Option<Script>,
    /// For records.
    pub info: RunInfo,
}

/// The data of a run in its records, apart from the ticks. The kernel does not use it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunInfo {
    /// The program's name.
    pub program: String,
    /// The machine's.
    pub machine: String,
    /// Control tick \[s\].
    pub tick_s: f64,
    /// Limits along the path.
    pub limits: PathLimits,
    /// The axes that there are, which have the first places.
    pub axes: Vec<SheetAxis>,
    /// Blocks of the plan, in path order.
    pub blocks: Vec<TracedBlock>,
    /// Where each stretch starts, from the program's start along the path \[mm\].
    pub starts_mm: Vec<f64>,
    /// The line of each switch of spindle and coolant.
    pub switch_lines: Vec<u32>,
    /// Path length of the plan \[mm\].
    pub path_length_mm: f64,
    /// Duration of the plan, dwells included, stops not \[s\].
    pub planned_time_s: f64,
    /// Probing moves, in path order.
    pub probes: Vec<PlannedProbe>,
    /// What they touch.
    pub surface: Surface,
    /// What was accepted and not acted on.
    pub notices: Vec<String>,
}

/// An axis' name and limits. Of a rotary one read ° for mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SheetAxis {
    /// Name.
    pub name: String,
    /// The axis of a program that moves it.
    #[serde(with = "super::letter")]
    pub letter: Axis,
    /// Greatest velocity \[mm/s\].
    pub feed_mm_s: f64,
    /// Greatest acceleration \[mm/s²\].
    pub accel_mm_s2: f64,
    /// Greatest jerk \[mm/s³\].
    pub jerk_mm_s3: f64,
}

impl SheetAxis {
    /// What it counts.
    #[must_use]
    pub fn unit(&self) -> AxisUnit {
        AxisUnit::of(self.letter)
    }
}

impl RunInfo {
    /// Of a machine, without a program.
    #[must_use]
    pub fn of_machine<const N: usize>(machine: &Machine<N>) -> Self {
        let axis = |axis: &AxisSettings| {
            Some(SheetAxis {
                name: axis.name.clone(),
                letter: axis.letter?,
                feed_mm_s: axis.feed_mm_s,
                accel_mm_s2: axis.accel_mm_s2,
                jerk_mm_s3: axis.jerk_mm_s3,
            })
        };
        Self {
            machine: machine.name.clone(),
            tick_s: machine.tick_s,
            limits: PathLimits {
                accel_mm_s2: machine.path.accel_mm_s2,
                jerk_mm_s3: machine.path.jerk_mm_s3,
                snap_mm_s4: machine.path.snap_mm_s4,
            },
            axes: machine.driven_axes().iter().filter_map(axis).collect(),
            ..Self::default()
        }
    }

    /// A trace with what the info has for it, and no tick.
    #[must_use]
    pub fn empty_trace<const N: usize>(&self) -> RunTrace<N> {
        let axis = |axis: &SheetAxis| TracedAxis {
            name: axis.name.clone(),
            letter: axis.letter,
            following_error_limit_um: 0.0,
            end_error_counts: 0,
        };
        RunTrace {
            program: self.program.clone(),
            machine: self.machine.clone(),
            tick_s: self.tick_s,
            // They bind linear axes alone, and a trace tells the motion of all along the path.
            limits: if self.has_rotary_axis() { PathLimits::default() } else { self.limits },
            axes: self.axes.iter().map(axis).collect(),
            blocks: self.blocks.clone(),
            planned_time_s: self.planned_time_s,
            ..RunTrace::default()
        }
    }

    /// The place of an axis, if there is one of this letter.
    pub(super) fn place_of(&self, letter: Axis) -> Option<usize> {
        self.axes.iter().position(|axis| axis.letter == letter)
    }

    /// What the axis of a place is called.
    pub(super) fn name_of(&self, place: usize) -> String {
        self.axes.get(place).map_or_else(|| format!("of place {place}"), |axis| axis.name.clone())
    }

    /// What the axis of a place counts.
    pub(super) fn unit_of(&self, place: usize) -> AxisUnit {
        self.axes.get(place).map_or(AxisUnit::Millimetre, SheetAxis::unit)
    }

    /// Whether an axis counts degrees.
    pub(super) fn has_rotary_axis(&self) -> bool {
        self.axes.iter().any(|axis| axis.letter.is_rotary())
    }

    /// Which places have linear axes.
    pub(crate) fn linear_places<const N: usize>(&self) -> [bool; N] {
        core::array::from_fn(|place| self.axes.get(place).is_some_and(|axis| !axis.letter.is_rotary()))
    }

    fn new<const N: usize>(plan: &Plan<N>, machine: &Machine<N>) -> Self {
        let start_mm = |item: &PlanItem<N>| match item {
            PlanItem::Stretch(stretch) => Some(stretch.start_mm),
            PlanItem::Dwell { .. } | PlanItem::Switch { .. } | PlanItem::Stop { .. } => None,
        };
        let switch_line = |item: &PlanItem<N>| match item {
            &PlanItem::Switch { line, .. } => Some(line),
            _ => None,
        };
        Self {
            program: plan.source.clone(),
            blocks: plan.blocks.clone(),
            starts_mm: plan.items.iter().filter_map(start_mm).collect(),
            switch_lines: plan.items.iter().filter_map(switch_line).collect(),
            path_length_mm: plan.length_mm,
            planned_time_s: plan.time_s,
            probes: plan.probes.clone(),
            surface: machine.probe.clone().unwrap_or_default(),
            notices: plan.notices.clone(),
            ..Self::of_machine(machine)
        }
    }
}

impl<const N: usize> Job<N> {
    /// `plan` on `machine`, as `options` say.
    ///
    /// # Errors
    /// The plan can't be executed in the number type.
    pub fn new(options: &RunOptions<'_>, plan: &Plan<N>, machine: &Machine<N>) -> Result<Self, RunError> {
        let executable = match options.number {
            Number::F32 => Executable::new::<f32>(plan),
            Number::F64 => Executable::new::<f64>(plan),
            Number::Fixed => Executable::new::<Fixed>(plan),
        }?;
        Ok(Self {
            number: options.number,
            header: machine.header(),
            guards: if options.is_unguarded { machine.guards().limits_only() } else { machine.guards() },
            compensation: machine.compensation(),
            items: executable.items,
            correction: options.correction.cloned(),
            script: options.script.cloned(),
            info: RunInfo::new(plan, machine),
        })
    }

    /// What a run of it leaves behind: its ticks, and what they came to.
    #[must_use]
    pub fn trace(&self, summary: &RunSummary, ticks: Vec<TraceRow<N>>) -> RunTrace<N> {
        let mut trace = RunTrace {
            ticks,
            end: summary.end,
            commands: summary.commands.clone(),
            outputs: summary.outputs.clone(),
            faults: summary.faults.clone(),
            notices: summary.notices.clone(),
            ..self.info.empty_trace()
        };
        for ((axis, figures), ended) in trace.axes.iter_mut().zip(&self.header.axes).zip(&summary.axes) {
            axis.following_error_limit_um = figures.following_error_limit_mm * 1e3;
            axis.end_error_counts = ended.end_error_counts;
        }
        trace
    }

    /// The kernel's axes.
    pub(super) fn axes_config<R: Real>(&self) -> Result<AxesConfig<R, N>, AxisError> {
        let tick_s = self.header.tick_s;
        let axes = AxesConfig::new(&self.header.axes, tick_s);
        axes.and_then(|axes| axes.guarded(&self.guards, tick_s))
            .and_then(|axes| axes.compensated(&self.compensation, tick_s))
            .map_err(|error| AxisError { axis: self.info.name_of(error.axis), source: error.cause })
    }
}
