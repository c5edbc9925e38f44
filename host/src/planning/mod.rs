//! Programs and block lists to feed plans.
//!
//! Consumes G-code steps or a BLOCKS.json; produces a [`Plan`]: every block with its ceiling and the
//! reason for it, the feed over the path, and what the kernel needs to execute it. Plans
//! stretches, from one full stop to the next, in f64.
//!
//! **Limits.** A dwell, and a part of a move at constant feed or acceleration, may last 2³¹ ticks: twelve
//! days at 0.5 ms. Between two full stops there may be one kilometre of path (10⁶ mm), and every point of the
//! path lies within one kilometre of the origin on each axis (a rotary one: 10⁶ °). Anything beyond is refused, with
//! the line of the block.
//!
//! - `runs`: steps to runs of moves: where motion must stop, and where long runs are cut;
//! - `sections`: several runs smoothed at once;
//! - `blending`: stretches to blocks: the choice of the junctions that are blended, `crossing`: how one is crossed,
//!   `shapes`: its blends and easements, each made once, and `compared`: the best of its crossings;
//! - [`outputs`]: spindle and coolant: what the machine switches;
//! - `ceilings`: the ceiling of a move or a blend, and of a junction;
//! - `curves`: programmed curves to moves;
//! - [`spline`]: a spline to one stretch, and how far its pieces are from it;
//! - `lookahead`: the kernel's planner in the host's memory, over a path that grows;
//! - [`stretch`]: ceilings, look-ahead and ramps of one stretch;
//! - `pipeline`: all of these, part by part;
//! - [`program`]: a whole program to one plan;
//! - [`profile`]: feed and time at any path position of a planned stretch;
//! - [`blocks`]: bare block lists, BLOCKS.json;
//! - `items`: blocks and ramps in the kernel's terms;
//! - [`executable`]: a whole plan in these;
//! - [`stream`]: a program while it is read;
//! - `rest`: the rest of a stretch, from one of its pieces on;
//! - `compiled`: a plan as bytes for a board;
//! - `density`: refuses what is too dense for a tick;
//! - [`error`]: refusals, with file and line.

pub mod blocks;
mod blending;
mod ceilings;
mod compared;
mod compiled;
mod crossing;
mod curves;
mod density;
mod items;
mod pipeline;
mod runs;
mod sections;
mod shapes;
pub mod error;
pub mod executable;
mod lookahead;
pub mod outputs;
pub mod profile;
pub mod program;
mod rest;
pub mod spline;
pub mod stream;
pub mod stretch;
mod travel;

pub use blocks::plan_blocks;
pub(crate) use compiled::{bytes_of, first_axes, header_of_axes, on_axis_count};
pub use error::{Place, PlanningError, Problem};
pub use executable::Executable;
pub use outputs::require_outputs;
pub use profile::PlacedRamp;
pub use program::{Planner, plan_moves, plan_program, plan_program_in_view};
pub(crate) use program::{assumed_path, notes};
pub(crate) use rest::rest_of_stretch;
pub use spline::plan_spline;
pub use stream::{Stream, Streamed};
pub use stretch::Stretch;

use motion_kernel::hal::OutputState;
use motion_kernel::law::Pulse;
use serde::{Deserialize, Serialize};

use crate::gcode::{Axis, ProbeMove, xyz_mm};
use crate::trace::TracedBlock;

/// How ramps and blocks go together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// A ramp may span blocks.
    #[default]
    Spanning,
    /// One pair of sin² ramps per block, as S3 plans.
    PerBlock,
}

impl Mode {
    /// The shape of the pulses of jerk where `chosen` is what the machine or the block list says.
    fn pulse(self, chosen: Pulse) -> Pulse {
        match self {
            Self::Spanning => chosen,
            Self::PerBlock => Pulse::Sin2,
        }
    }
}

/// A planned program.
#[derive(Clone, Debug)]
pub struct Plan<const N: usize = 3> {
    /// Name of the program or block list.
    pub source: String,
    /// Blocks, in path order.
    pub blocks: Vec<TracedBlock>,
    /// Feed, in path order, placed from the program's start; times as in `time_s`.
    pub feed: Vec<PlacedRamp>,
    /// Duration, dwells included, stops not \[s\].
    pub time_s: f64,
    /// Path length \[mm\].
    pub length_mm: f64,
    /// The items to execute, in order. Empty for a block list, which has no geometry.
    pub items: Vec<Item<N>>,
    /// Probing moves, in order.
    pub probes: Vec<PlannedProbe>,
    /// Stretches among the items.
    pub stretches: u32,
    /// Words that were accepted and not acted on.
    pub notices: Vec<String>,
    /// The shape of the pulses of jerk in its ramps.
    pub pulse: Pulse,
    /// The control tick it was planned for \[s\].
    pub tick_s: f64,
    /// The axes of its machine, by their places; none for a block list.
    pub axes: [Option<Axis>; N],
}

impl<const N: usize> Plan<N> {
    /// Refuses a plan with probing moves, for boards.
    pub(crate) fn refuse_probes(&self) -> Result<(), PlanningError> {
        match self.probes.first() {
            Some(probe) => Err(PlanningError::at_line(&self.source, (probe.line, Problem::NoProbeInput))),
            None => Ok(()),
        }
    }

    /// A plan with nothing to do.
    fn empty(source: &str, pulse: Pulse, tick_s: f64, axes: [Option<Axis>; N]) -> Self {
        Self {
            source: source.to_owned(),
            blocks: Vec::new(),
            feed: Vec::new(),
            time_s: 0.0,
            length_mm: 0.0,
            items: Vec::new(),
            probes: Vec::new(),
            stretches: 0,
            notices: Vec::new(),
            pulse,
            tick_s,
            axes,
        }
    }
}

/// A probing move of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedProbe {
    /// Program line.
    pub line: u32,
    /// Stretches before it. The next one is its own, unless it stands.
    pub stretch: u32,
    /// It stands where it trips, or where it ends.
    pub stands: bool,
    /// It trips where it leaves the surface.
    pub leaves: bool,
    /// Where the program reads it to have tripped \[mm\], in machine coordinates; absent if it does not trip.
    pub trip_mm: Option<[f64; 3]>,
}

impl PlannedProbe {
    fn new(line: u32, stretch: u32, probe: &ProbeMove) -> Self {
        let trip_mm = probe.trip.map(xyz_mm);
        Self { line, stretch, stands: probe.from == probe.to, leaves: probe.leaves, trip_mm }
    }

    /// Stretches up to its end.
    pub(crate) fn end(&self) -> u32 {
        self.stretch + u32::from(!self.stands)
    }
}

/// One thing to execute.
#[derive(Clone, Debug)]
pub enum Item<const N: usize = 3> {
    /// Motion from one full stop to the next.
    Stretch(Stretch<N>),
    /// Rest.
    Dwell {
        /// Program line.
        line: u32,
        /// Duration \[s\].
        seconds: f64,
    },
    /// Spindle and coolant switch.
    Switch {
        /// Program line.
        line: u32,
        /// To what.
        to: OutputState,
    },
    /// Program stop.
    Stop {
        /// Program line.
        line: u32,
    },
}
