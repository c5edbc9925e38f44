//! The places of a run where a quantity is greatest.

use serde::Serialize;

use crate::trace::{RunTrace, TraceRow};

/// Places of a quantity.
const PLACES: usize = 10;

/// A place on the run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Place {
    tick: u64,
    line: u32,
    s_mm: f64,
    value: f64,
}

/// The places where a quantity's magnitude is greatest, the greatest first. A visit to a line of the program counts once, with
/// its greatest value: otherwise neighbours of one tick would be all ten.
pub(super) fn places<const N: usize>(trace: &RunTrace<N>, value: impl Fn(&TraceRow<N>) -> f64) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::with_capacity(PLACES + 1);
    for visit in trace.ticks.chunk_by(|a, b| a.line == b.line) {
        let finite = visit.iter().map(|row| (row, value(row))).filter(|(_, value)| value.is_finite());
        // The first of equal ones.
        let greatest = finite.reduce(|most, next| if next.1.abs() > most.1.abs() { next } else { most });
        let Some((row, value)) = greatest else { continue };
        let place = Place { tick: row.tick, line: row.line, s_mm: row.s_mm, value };
        let rank = places.partition_point(|other| other.value.abs() >= value.abs());
        if rank < PLACES && value != 0.0 {
            places.insert(rank, place);
            places.truncate(PLACES);
        }
    }
    places
}
