//! The simulated probe: an input that is on where the encoders read the axes within the surface, and a latch that keeps where it
//! changes.
//!
//! Consumes the ticks of a run; produces where each probing move tripped, or that it did not. The motion is that of the plan:
//! its reader knew the surface.

use motion_kernel::exec::ExecState;
use motion_kernel::num::Real;
use motion_kernel::trace::Trace;

use super::job::RunInfo;
use crate::gcode::Axis;
use crate::planning::PlannedProbe;

/// What came of a probing move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Program line.
    pub line: u32,
    /// The tick in which the probe tripped; without, the first after the move.
    pub tick: u64,
    /// Whether it tripped.
    pub tripped: bool,
    /// Where the encoders read X, Y and Z in this tick \[mm\]; 0 for one that there is not.
    pub position_mm: [f64; 3],
    /// Where the program reads it to have tripped \[mm\], in machine coordinates; absent if it reads that it did not.
    pub program_mm: Option<[f64; 3]>,
}

impl Probed {
    /// Whether run and program do not agree on whether it trips.
    #[must_use]
    pub fn disagrees(&self) -> bool {
        self.tripped != self.program_mm.is_some()
    }

    /// What is to be said where run and program do not agree.
    pub(super) fn disagreement(&self) -> Option<String> {
        let tripped = |tripped: bool| if tripped { "tripped" } else { "did not trip" };
        let read = self.program_mm.is_some();
        let said = || {
            let line = self.line;
            format!(
                "line {line}: the probe {}, but the program reads that it {}",
                tripped(self.tripped),
                tripped(read)
            )
        };
        self.disagrees().then(said)
    }
}

/// The probing moves of a run.
pub(super) struct Probing<'a> {
    info: &'a RunInfo,
    /// The places of X, Y and Z.
    places: [Option<usize>; 3],
    /// Stretches that were driven, and the tick after the last one, where X, Y and Z are.
    now: (u32, u64, [f64; 3]),
    /// What came of those that are over.
    probed: Vec<Probed>,
}

impl<'a> Probing<'a> {
    pub(super) fn new(info: &'a RunInfo) -> Self {
        let places = [Axis::X, Axis::Y, Axis::Z].map(|letter| info.place_of(letter));
        Self { info, places, now: (0, 0, [0.0; 3]), probed: Vec::new() }
    }

    /// The probing move that is next or under way.
    fn next(&self) -> Option<&'a PlannedProbe> {
        self.info.probes.get(self.probed.len())
    }

    pub(super) fn tick<R: Real, const N: usize>(&mut self, trace: &Trace<R, N>) {
        let actual_mm = |place: usize| trace.axes.get(place).map_or(0.0, |axis| axis.actual.to_mm());
        let position_mm = self.places.map(|place| place.map_or(0.0, actual_mm));
        self.now = (trace.executed.stretches, trace.tick, position_mm);
        while let Some(probe) = self.next() {
            let has_begun = trace.executed.stretches >= probe.stretch;
            // An axis may follow late: its move is over when the next one begins.
            let moves_on =
                trace.executed.state == ExecState::Moving && trace.executed.stretches >= probe.end();
            if has_begun && self.info.surface.is_touched(position_mm) != probe.leaves {
                self.keep(probe, true);
            } else if moves_on {
                self.keep(probe, false);
            } else {
                break;
            }
        }
    }

    fn keep(&mut self, probe: &PlannedProbe, tripped: bool) {
        let (_, tick, position_mm) = self.now;
        let &PlannedProbe { line, trip_mm: program_mm, .. } = probe;
        self.probed.push(Probed { line, tick, tripped, position_mm, program_mm });
    }

    /// At the end of the run, also of one that ended early.
    pub(super) fn finish(mut self) -> Vec<Probed> {
        while let Some(probe) = self.next().filter(|probe| self.now.0 >= probe.end()) {
            self.keep(probe, false);
        }
        self.probed
    }
}
