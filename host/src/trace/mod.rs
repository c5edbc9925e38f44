//! What a run leaves behind: one row per tick, and the plan it was run from.
//!
//! Filled by the simulation, read by the summary, the trace file and the report.

pub mod columns;
#[cfg(feature = "terminal")]
pub mod mcap;

use std::borrow::Cow;

use motion_kernel::hal::OutputState;
use serde::{Deserialize, Serialize};

use crate::axis_unit::AxisUnit;
use crate::gcode::Axis;

/// A whole run, of a machine with `N` places for axes.
#[derive(Clone, Debug, Default)]
pub struct RunTrace<const N: usize = 3> {
    /// Program name as the user gave it.
    pub program: String,
    /// Machine name from the machine file.
    pub machine: String,
    /// Control tick \[s\].
    pub tick_s: f64,
    /// The program, where it is at hand: no recording has it.
    pub source: Option<TracedProgram>,
    /// Limits along the path.
    pub limits: PathLimits,
    /// The axes that there are, which have the first places.
    pub axes: Vec<TracedAxis>,
    /// Blocks of the plan, in path order over the whole program.
    pub blocks: Vec<TracedBlock>,
    /// Every tick, in order.
    pub ticks: Vec<TraceRow<N>>,
    /// Duration of the plan, dwells included \[s\].
    pub planned_time_s: f64,
    /// How it ended.
    pub end: RunEnd,
    /// Commands of live control, in order.
    pub commands: Vec<TracedCommand>,
    /// Switches of spindle and coolant, in order.
    pub outputs: Vec<TracedSwitch>,
    /// Faults, in order.
    pub faults: Vec<TracedFault>,
    /// What was accepted and not acted on, and other remarks for the reader.
    pub notices: Vec<String>,
}

/// An axis of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedAxis {
    /// Its name.
    pub name: String,
    /// The axis of a program that moves it.
    pub letter: Axis,
    /// Following error at which it faults \[µm, m°\]; 0 if not known.
    pub following_error_limit_um: f64,
    /// Set − actual position after settling \[counts\].
    pub end_error_counts: i64,
}

impl TracedAxis {
    /// What it counts.
    #[must_use]
    pub fn unit(&self) -> AxisUnit {
        AxisUnit::of(self.letter)
    }
}

/// A switch of spindle and coolant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedSwitch {
    /// The tick before which it happened.
    pub tick: u64,
    /// The line of the program, from 1; none for all off after an abort or a fault.
    pub line: Option<u32>,
    /// What they do from then on.
    pub to: OutputState,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunEnd {
    /// At the end of the program.
    #[default]
    Finished,
    /// At rest, and no command was left to resume it.
    Held(HeldBy),
    /// At rest, with the rest of the program given up.
    Aborted,
    /// By a fault.
    Faulted,
    /// By the hardware: a replay that differs from its recording.
    Cut,
}

/// What holds a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldBy {
    /// A hold.
    Hold,
    /// Single block, at the end of a line.
    SingleBlock,
    /// An override of 0.
    Override,
}

impl RunEnd {
    /// What stopped it before the end of the program, for scripts.
    #[must_use]
    pub fn stopped_by(self) -> Option<&'static str> {
        match self {
            Self::Finished => None,
            Self::Held(HeldBy::Hold) => Some("hold"),
            Self::Held(HeldBy::SingleBlock) => Some("single block"),
            Self::Held(HeldBy::Override) => Some("override"),
            Self::Aborted => Some("abort"),
            Self::Faulted => Some("fault"),
            Self::Cut => Some("difference"),
        }
    }

    /// How it ended before the end of the program, for people.
    #[must_use]
    pub fn words(self) -> Option<&'static str> {
        match self {
            Self::Finished => None,
            Self::Held(HeldBy::Hold) => Some("held"),
            Self::Held(HeldBy::SingleBlock) => Some("held by single block"),
            Self::Held(HeldBy::Override) => Some("held by an override of 0"),
            Self::Aborted => Some("aborted"),
            Self::Faulted => Some("faulted"),
            Self::Cut => Some("ended by a difference"),
        }
    }
}

/// What the machine allows along the path. A limit of 0 is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathLimits {
    /// Greatest acceleration \[mm/s²\].
    pub accel_mm_s2: f64,
    /// Greatest jerk \[mm/s³\].
    pub jerk_mm_s3: f64,
    /// Greatest snap \[mm/s⁴\].
    pub snap_mm_s4: f64,
}

/// One block of the plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TracedBlock {
    /// G-code line, from 1.
    pub line: u32,
    /// "line", "arc", "helix", "blend", "curve", "spline" or "involute".
    pub kind: Cow<'static, str>,
    /// Where the block starts, from the program's start along the path \[mm\].
    pub start_mm: f64,
    /// Path length \[mm\].
    pub length_mm: f64,
    /// Ceiling of the feed \[mm/s\].
    pub cap_mm_s: f64,
    /// What holds the feed down: what set the ceiling, or "accelerating" or "braking" where the block is too
    /// short for the feed to reach it.
    pub cap_reason: Cow<'static, str>,
    /// Feed at the start \[mm/s\].
    pub enter_mm_s: f64,
    /// Highest feed inside \[mm/s\].
    pub peak_mm_s: f64,
    /// Feed at the end \[mm/s\].
    pub exit_mm_s: f64,
    /// Duration \[s\].
    pub time_s: f64,
    /// Whether the program moves here as fast as the machine can, and cuts nothing (G0).
    pub is_rapid: bool,
}

/// The program of a run, for people.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedProgram {
    /// Its text.
    pub text: String,
    /// Where the time of its plan goes: a reason in words, and its time \[s\].
    pub times: Vec<(&'static str, f64)>,
}

/// One tick: set values along the path, and every axis.
#[derive(Clone, Copy, Debug)]
pub struct TraceRow<const N: usize = 3> {
    /// Tick number from 0.
    pub tick: u64,
    /// Path position from the program's start \[mm\].
    pub s_mm: f64,
    /// Feed \[mm/s\].
    pub v_mm_s: f64,
    /// Acceleration along the path \[mm/s²\].
    pub a_mm_s2: f64,
    /// Jerk along the path \[mm/s³\].
    pub j_mm_s3: f64,
    /// Snap along the path \[mm/s⁴\].
    pub snap_mm_s4: f64,
    /// Executor state: "idle", "moving", "dwell", "stopped", "fault".
    pub state: &'static str,
    /// G-code line of the path piece.
    pub line: u32,
    /// Contour error, the part of the linear axes' following error across the path, 0 or more \[µm\].
    pub contour_um: f64,
    /// Per place; where there is no axis, nothing moves.
    pub axes: [AxisTick; N],
}

/// One axis in one tick. Of a rotary one read ° for mm and m° for µm.
#[derive(Clone, Copy, Debug, Default)]
pub struct AxisTick {
    /// Set position \[mm\].
    pub set_mm: f64,
    /// Set velocity \[mm/s\].
    pub vel_mm_s: f64,
    /// Set acceleration \[mm/s²\]; in a run with what a kink of the path that this tick passes steps velocity by, over the tick.
    pub acc_mm_s2: f64,
    /// Set jerk \[mm/s³\].
    pub jerk_mm_s3: f64,
    /// Actual position from the encoder \[mm\].
    pub act_mm: f64,
    /// Following error, set − actual \[µm\].
    pub err_um: f64,
    /// Output voltage \[V\].
    pub out_v: f64,
}

/// A fault as recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TracedFault {
    /// Tick in which it was latched.
    pub tick: u64,
    /// Name of the axis, if it concerns one.
    pub axis: Option<String>,
    /// Stable name of the fault.
    pub fault: String,
    /// Figures.
    pub detail: String,
}

/// A command of live control as it was given, and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TracedCommand {
    /// Tick before which it was given.
    pub tick: u64,
    /// As in a script: "hold", "override=0.5".
    pub command: String,
    /// The feed override from here on, if it is one: times the program's feed.
    pub feed_override: Option<f64>,
    /// Path position where it was given \[mm\].
    pub s_mm: f64,
    /// The rest that it asked for, if that was reached before a command to go on.
    pub stop: Option<TracedStop>,
}

/// How motion came to rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TracedStop {
    /// The first tick that ended at rest.
    pub tick: u64,
    /// From the command to the end of that tick; 0 if it was at rest already \[s\].
    pub time_s: f64,
    /// Along the path \[mm\].
    pub length_mm: f64,
}
