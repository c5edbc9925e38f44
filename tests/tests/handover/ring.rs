//! A queue with heapless' orderings. The checker watches its memory.
//!
//! `peek` of heapless reads the queue's end relaxed, which is enough for an interrupt. Here it acquires: a thread needs that.

use std::marker::PhantomData;
use std::sync::atomic::AtomicU32 as Untracked;
use std::sync::atomic::Ordering::SeqCst;
use std::sync::{Arc, Mutex};

use super::handover::{AtomicU32, Memory, Ordering};
use super::model::ITEMS;

/// A list's items, and a place that stays free.
const PLACES: u32 = ITEMS + 1;

struct Place<T: 'static> {
    memory: Memory,
    item: Mutex<Option<&'static T>>,
}

/// Head and tail count all items so far.
pub(super) struct Ring<T: 'static> {
    list: u8,
    head: AtomicU32,
    tail: AtomicU32,
    /// Head and tail as who writes them knows them. Loom must not see its reads: `handover` of `two_cores` says why.
    own_head: Untracked,
    own_tail: Untracked,
    places: [Place<T>; PLACES as usize],
    /// Items before this count were given up.
    given_up: Untracked,
}

impl<T> Ring<T> {
    pub(super) fn new(list: u8) -> Arc<Self> {
        let (head, tail) = (AtomicU32::new(0), AtomicU32::new(0));
        // Made before the threads begin.
        let (own_head, own_tail) = (head.load(Ordering::Relaxed).into(), tail.load(Ordering::Relaxed).into());
        let place = |_| Place { memory: Memory::default(), item: Mutex::new(None) };
        let places = std::array::from_fn(place);
        Arc::new(Self { list, head, tail, own_head, own_tail, places, given_up: Untracked::new(0) })
    }

    fn place(&self, count: u32) -> &Place<T> {
        &self.places[(count % PLACES) as usize]
    }

    /// The background's view.
    pub(super) fn is_empty(&self) -> bool {
        self.head.load(Ordering::Relaxed) == self.own_tail.load(SeqCst)
    }

    /// Enters an item, in the background.
    pub(super) fn enqueue(&self, item: &'static T) {
        let tail = self.own_tail.load(SeqCst);
        assert!(tail - self.head.load(Ordering::Acquire) < ITEMS, "a list that was empty is full");
        let place = self.place(tail);
        place.memory.write();
        *place.item.lock().expect("no panic before") = Some(item);
        self.own_tail.store(tail + 1, SeqCst);
        self.tail.store(tail + 1, Ordering::Release);
    }

    /// From now on the tick may drop what is queued.
    pub(super) fn give_up(&self) {
        self.given_up.store(self.own_tail.load(SeqCst), SeqCst);
    }
}

/// The tick's end.
pub(super) struct Consumer<'a, T: 'static> {
    ring: Arc<Ring<T>>,
    of: PhantomData<&'a T>,
}

impl<T> Consumer<'_, T> {
    pub(super) fn new(ring: &Arc<Ring<T>>) -> Self {
        Self { ring: ring.clone(), of: PhantomData }
    }

    pub(super) fn peek(&self) -> Option<&'static T> {
        let head = self.ring.own_head.load(SeqCst);
        if head == self.ring.tail.load(Ordering::Acquire) {
            return None;
        }
        let place = self.ring.place(head);
        place.memory.read();
        *place.item.lock().expect("no panic before")
    }

    /// The executor is done with an item.
    pub(super) fn take(&mut self) -> Option<&'static T> {
        let item = self.peek()?;
        let head = self.ring.own_head.fetch_add(1, SeqCst);
        self.ring.head.store(head + 1, Ordering::Release);
        Some(item)
    }

    /// The lists drop an item.
    pub(super) fn dequeue(&mut self) -> Option<&'static T> {
        let is_given_up = self.ring.own_head.load(SeqCst) < self.ring.given_up.load(SeqCst);
        assert!(is_given_up, "an item is dropped of a list that was not given up");
        self.take()
    }

    pub(super) fn list(&self) -> u8 {
        self.ring.list
    }

    /// Whether the list was given up as a whole.
    pub(super) fn is_given_up(&self) -> bool {
        self.ring.own_head.load(SeqCst) < self.ring.given_up.load(SeqCst)
    }
}
