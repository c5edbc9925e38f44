//! Parts of a program, smoothed: several at once.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread;

use motion_kernel::internals::{add_work, work_done};

use super::blending::blocks;
use super::error::AtLine;
use super::runs::{Between, Part};
use super::stretch::StretchBlock;
use crate::machine::Machine;

/// A part with its moves smoothed.
#[derive(Clone, Debug)]
pub(super) enum Smoothed<const N: usize> {
    /// Blocks; the junction feed of the last one is 0.
    Blocks {
        /// The blocks.
        blocks: Vec<StretchBlock<N>>,
        /// The next part goes on without a stop.
        goes_on: bool,
    },
    /// What stands between stretches.
    Between(Between),
}

/// Moves that are worth a thread.
const MOVES_MIN: usize = 32;

/// Parts that are smoothed together at most: what waits meanwhile is bounded.
pub(super) const TOGETHER: usize = 4;

/// Smooths parts, in their order. An error comes with the program line; it ends the parts.
pub(super) fn smoothed<const N: usize>(
    parts: Vec<Part<N>>,
    machine: &Machine<N>,
) -> Vec<AtLine<Smoothed<N>>> {
    let is_long = |part: &Part<N>| matches!(part, Part::Moves { moves, .. } if moves.len() >= MOVES_MIN);
    let long = parts.iter().filter(|part| is_long(part)).count();
    let threads = thread::available_parallelism().map_or(1, usize::from).min(long);
    if threads < 2 {
        return parts.into_iter().map(|part| one(part, machine)).collect();
    }
    let next = AtomicUsize::new(0);
    let places: Vec<_> = parts.into_iter().map(|part| Mutex::new((Some(part), None))).collect();
    let work = || {
        // Who takes a number takes the part; nobody waits for a place.
        while let Some(place) = places.get(next.fetch_add(1, Ordering::Relaxed)) {
            if let Ok(mut place) = place.lock() {
                place.1 = place.0.take().map(|part| one(part, machine));
            }
        }
    };
    let elsewhere = AtomicU64::new(0);
    thread::scope(|scope| {
        (1..threads).for_each(|_| {
            scope.spawn(|| {
                work();
                elsewhere.fetch_add(work_done(), Ordering::Relaxed);
            });
        });
        work();
    });
    // Tests hold it to an amount, whoever does it.
    add_work(elsewhere.into_inner() as usize);
    places.into_iter().filter_map(|place| place.into_inner().ok()?.1).collect()
}

fn one<const N: usize>(part: Part<N>, machine: &Machine<N>) -> AtLine<Smoothed<N>> {
    match part {
        Part::Moves { moves, goes_on } => {
            blocks(&moves, machine).map(|blocks| Smoothed::Blocks { blocks, goes_on })
        }
        Part::Between(what) => Ok(Smoothed::Between(what)),
    }
}
