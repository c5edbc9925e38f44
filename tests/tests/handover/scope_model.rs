//! The tick and the background of a scope, and what has to hold between them: a tick that is read is whole, the next one after
//! the one before, and where one is missing the background is told before it reads one behind it.

use motion_kernel::axis::AxisOutput;
use motion_kernel::exec::{ExecState, Executed};
use motion_kernel::hal::MachineInputs;
use motion_kernel::law::PathMotion;
use motion_kernel::path::Setpoint;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode, Position};

use super::ring::{TicksIn, TicksOut};
use super::tick_record::{TickRecord, TripCount};

/// Room for two ticks.
pub(super) const PLACES: usize = 3;

/// The tick: every word tells which one.
pub(super) struct Tick<'a> {
    pub(super) ticks: TicksIn<'a, 1>,
    pub(super) count: u8,
}

impl Tick<'_> {
    pub(super) fn tick(&mut self) {
        self.count += 1;
        let number = i64::from(self.count);
        let at = Position::from_bits(number);
        let output = AxisOutput {
            counts: Counts(number),
            set: at,
            code: DacCode(number as i16),
            ..AxisOutput::default()
        };
        let trace = Trace::<f32, 1> {
            tick: number as u64,
            executed: Executed {
                state: ExecState::Idle,
                motion: PathMotion::default(),
                stretches: 0,
                line: 0,
                setpoints: [Setpoint { position: at, ..Setpoint::default() }],
            },
            axes: [output],
            inputs: MachineInputs::HEALTHY,
            fault: None,
        };
        self.ticks.enter(&trace, number as u32, 0, self.count);
    }
}

/// The background.
pub(super) struct Background<'a> {
    pub(super) ticks: TicksOut<'a, 1>,
    /// The last one that was read; none after some were dropped.
    pub(super) last: Option<u32>,
    /// The last one of all that were read.
    pub(super) latest: u32,
}

impl Background<'_> {
    /// Reads what waits, once.
    pub(super) fn read(&mut self) {
        let waiting = self.ticks.len();
        assert!(waiting < PLACES);
        let Some(record) = self.ticks.first() else { return };
        let number = record.generation;
        let TickRecord { counts: [counts], set: [set], codes: [code], trips, .. } = record;
        assert_eq!(
            (counts, set, code.0 as u32, trips),
            (number, number, number, TripCount::New(number as u8))
        );
        match self.last {
            Some(last) => assert_eq!(number, last + 1, "one is missing between them"),
            None => assert!(number > self.latest, "{number} again, after {}", self.latest),
        }
        (self.last, self.latest) = (Some(number), number);
        self.ticks.drop_first();
    }

    /// Where one is missing: a snapshot, before which all are dropped. No tick comes meanwhile.
    pub(super) fn begin_anew(&mut self) {
        self.ticks.clear();
        self.last = None;
    }
}
