//! Limits how many segments or dwells end within one tick.

use super::rejection::Rejection;
use crate::law::Ticks;
use crate::num::rolled;

/// Greatest number of segments or dwells that may end within one tick. Denser ones are rejected when they are
/// offered.
pub const SEGMENTS_PER_TICK_MAX: usize = 8;

/// How close segments and dwells follow each other.
#[derive(Clone, Copy, Debug)]
pub struct Density {
    /// Durations of the latest items, newest first.
    recent: [Ticks; SEGMENTS_PER_TICK_MAX],
}

impl Density {
    /// After a rest.
    pub const NONE: Self = Self { recent: [Ticks::ONE; SEGMENTS_PER_TICK_MAX] };

    /// Adds an item that takes `newest`.
    ///
    /// # Errors
    /// The executor can't keep up with it and the items before it.
    #[inline(never)]
    pub fn follow(&mut self, newest: Ticks) -> Result<(), Rejection> {
        let (mut next, mut together) = (newest, Ticks::ZERO);
        for place in rolled(self.recent.as_mut_slice()) {
            together = rolled(together.plus(next));
            core::mem::swap(place, &mut next);
        }
        if together < Ticks::ONE {
            return Err(Rejection::Dense { ticks: together.to_f64() });
        }
        Ok(())
    }
}
