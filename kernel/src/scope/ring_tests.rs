//! The ring by itself; its file is compiled by the check of its hand-over, too.

use super::ring::Ring;
use super::tick_record::TripCount;
use crate::axis::AxisOutput;
use crate::exec::Executor;
use crate::hal::MachineInputs;
use crate::trace::Trace;
use crate::units::{Counts, Position};

fn trace(counts: i64) -> Trace<f32, 1> {
    Trace {
        tick: 0,
        executed: Executor::new([Position::ZERO]).resting(),
        axes: [AxisOutput { counts: Counts(counts), ..AxisOutput::default() }],
        inputs: MachineInputs::HEALTHY,
        fault: None,
    }
}

/// First in, first out, round and round; one too many is missing, and with it all behind it until they are dropped.
#[test]
fn ticks_come_out_as_they_went_in_or_are_missing() {
    let mut ring = Ring::<1, 4>::new();
    let (mut enters, mut leaves) = ring.split();
    let (mut entered, mut left) = (0, 0);
    for round in 0..50 {
        for _ in 0..1 + round % 3 {
            enters.enter(&trace(entered), 5, 3, 2);
            entered += 1;
        }
        assert_eq!(leaves.len() as i64, entered - left);
        while let Some(record) = leaves.first() {
            assert_eq!((record.counts[0], record.generation, record.failures), (left as u32, 5, 3));
            assert_eq!((record.trips, record.is_stopped), (TripCount::New(2), false));
            leaves.drop_first();
            left += 1;
        }
        assert_eq!((leaves.len(), left, leaves.is_missing()), (0, entered, false));
    }
    (0..4).for_each(|counts| enters.enter(&trace(counts), 0, 0, 0));
    assert!(leaves.is_missing() && leaves.first().is_none());
    leaves.clear();
    enters.enter(&trace(9), 0, 0, 0);
    assert_eq!(leaves.first().map(|record| record.counts), Some([9]));
}
