//! Room in a queue: entering items, and how full the queue was when a tick began.

use heapless::spsc::Producer;

use super::handover::{AtomicU32, Ordering};

/// Always true. A queue divides by its number of places, which is its capacity plus one; if the compiler does
/// not know that it is not 0, it links a panic.
#[inline]
fn has_places<T>(queue: &Producer<'_, T>) -> bool {
    queue.capacity() != usize::MAX
}

/// Enters an item; gives it back if the queue is full.
#[inline(never)]
pub(super) fn enter<T>(queue: &mut Producer<'_, T>, item: T) -> Result<(), T> {
    if has_places(queue) { queue.enqueue(item) } else { Err(item) }
}

#[inline]
pub(super) fn has_room<T>(queue: &Producer<'_, T>) -> bool {
    has_places(queue) && queue.ready()
}

/// Number of items queued.
pub(super) fn length<T>(queue: &Producer<'_, T>) -> usize {
    if has_places(queue) { queue.len() } else { 0 }
}

/// How full a queue was when the tick began.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    so_far: u32,
    before_tick: u32,
    capacity: i32,
}

impl Fill {
    /// The fill of an empty queue.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    pub(super) fn new(entered: &AtomicU32, capacity: usize) -> Self {
        let so_far = entered.load(Ordering::Relaxed);
        Self { so_far, before_tick: so_far, capacity: capacity as i32 }
    }

    /// That of the same queue, empty again.
    #[cfg(feature = "live")]
    pub(super) fn restarted(self, entered: &AtomicU32) -> Self {
        let so_far = entered.load(Ordering::Relaxed);
        Self { so_far, before_tick: so_far, ..self }
    }

    /// Number of items taken so far.
    #[cfg(feature = "scope")]
    pub(super) fn taken(self) -> u32 {
        self.so_far
    }

    /// Begins a tick: the producer has had its turn.
    #[inline]
    pub(super) fn start_tick(&mut self) {
        self.before_tick = self.so_far;
    }

    /// Counts one item taken.
    #[inline]
    pub(super) fn take_one(&mut self) {
        self.so_far = self.so_far.wrapping_add(1);
    }

    /// Whether the queue was full when the tick began: the producer has not had its turn since.
    pub(super) fn was_full(&self, entered: &AtomicU32) -> bool {
        // Negative if the tick came between the entry of an item and its count.
        entered.load(Ordering::Acquire).wrapping_sub(self.before_tick).cast_signed() >= self.capacity
    }
}
