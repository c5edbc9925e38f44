//! Places for ticks between the tick and the background: words that are written where they stay, which costs the tick some
//! thirty instructions less than to make a record and to move it into a queue.
//!
//! Single producer, single consumer, lock-free, as the streams are. One place stays empty.

use super::tick_record::{TickRecord, TripCount};
use super::words::{AtomicBool, AtomicU8, AtomicU16, AtomicU32, AtomicUsize, Ordering};
use crate::hal::AxisInputs;
use crate::num::Real;
use crate::trace::Trace;
use crate::units::DacCode;

/// A tick in its place.
#[derive(Debug)]
struct Place<const AXES: usize> {
    generation: AtomicU32,
    counts: [AtomicU32; AXES],
    set: [AtomicU32; AXES],
    codes: [AtomicU16; AXES],
    inputs: [AtomicU8; AXES],
    /// The state, [`STOPPED`], and the failures behind it.
    flags: AtomicU8,
    trips: AtomicU8,
}

/// Of [`Place::flags`]: the state has the bits below it; the failures begin at the next one.
const STOPPED: u8 = 1 << 3;
const FAILURES_BIT: u32 = 4;

impl<const AXES: usize> Place<AXES> {
    const fn new() -> Self {
        Self {
            generation: AtomicU32::new(0),
            counts: [const { AtomicU32::new(0) }; AXES],
            set: [const { AtomicU32::new(0) }; AXES],
            codes: [const { AtomicU16::new(0) }; AXES],
            inputs: [const { AtomicU8::new(0) }; AXES],
            flags: AtomicU8::new(0),
            trips: AtomicU8::new(0),
        }
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn write<R: Real>(&self, trace: &Trace<R, AXES>, generation: u32, failures: u8, trips: u8) {
        const ORDERING: Ordering = Ordering::Relaxed;
        let Trace { executed, axes, inputs, .. } = trace;
        self.generation.store(generation, ORDERING);
        let places = self.counts.iter().zip(&self.set).zip(&self.codes);
        for (((counts, set), code), axis) in places.zip(axes) {
            counts.store(axis.counts.0 as u32, ORDERING);
            set.store(axis.set.to_bits() as u32, ORDERING);
            code.store(axis.code.0.cast_unsigned(), ORDERING);
        }
        for (place, inputs) in self.inputs.iter().zip(&inputs.axes) {
            place.store(inputs.to_bits(), ORDERING);
        }
        let is_stopped = u8::from(inputs.emergency_stop) * STOPPED;
        self.flags.store(executed.state as u8 | is_stopped | failures << FAILURES_BIT, ORDERING);
        self.trips.store(trips, ORDERING);
    }

    fn read(&self) -> TickRecord<AXES> {
        const ORDERING: Ordering = Ordering::Relaxed;
        let flags = self.flags.load(ORDERING);
        TickRecord {
            generation: self.generation.load(ORDERING),
            counts: self.counts.each_ref().map(|word| word.load(ORDERING)),
            set: self.set.each_ref().map(|word| word.load(ORDERING)),
            codes: self.codes.each_ref().map(|word| DacCode(word.load(ORDERING).cast_signed())),
            inputs: self.inputs.each_ref().map(|word| AxisInputs::from_bits(word.load(ORDERING))),
            is_stopped: flags & STOPPED != 0,
            state: flags & (STOPPED - 1),
            failures: flags >> FAILURES_BIT,
            trips: TripCount::of(self.trips.load(ORDERING)),
        }
    }
}

/// Where both ends are.
#[derive(Debug)]
struct Ends {
    /// The place written last; only the tick changes it.
    entered: AtomicUsize,
    /// The place read last; only the background changes it.
    taken: AtomicUsize,
    /// A tick was left out. The tick sets it, with all places taken: what has entered by then follows each other.
    is_missing: AtomicBool,
}

/// The places, `TICKS` of them.
#[derive(Debug)]
pub(super) struct Ring<const AXES: usize, const TICKS: usize> {
    places: [Place<AXES>; TICKS],
    ends: Ends,
}

impl<const AXES: usize, const TICKS: usize> Ring<AXES, TICKS> {
    pub(super) const fn new() -> Self {
        let ends = Ends {
            entered: AtomicUsize::new(0),
            taken: AtomicUsize::new(0),
            is_missing: AtomicBool::new(false),
        };
        Self { places: [const { Place::new() }; TICKS], ends }
    }

    /// The tick's end, and the background's.
    pub(super) fn split(&mut self) -> (TicksIn<'_, AXES>, TicksOut<'_, AXES>) {
        let Self { places, ends } = self;
        let (places, ends) = (&*places, &*ends);
        (TicksIn { places, ends }, TicksOut { places, ends })
    }
}

/// The place after this one; none if there are no places.
#[inline]
fn after<T>(at: usize, places: &[T]) -> Option<(usize, &T)> {
    let next = at.wrapping_add(1);
    match places.get(next) {
        Some(place) => Some((next, place)),
        None => places.first().map(|place| (0, place)),
    }
}

/// The tick's end.
pub(super) struct TicksIn<'a, const AXES: usize> {
    places: &'a [Place<AXES>],
    ends: &'a Ends,
}

impl<const AXES: usize> TicksIn<'_, AXES> {
    /// Notes that a tick is left out.
    #[cold]
    pub(super) fn leave_out(&mut self) {
        self.ends.is_missing.store(true, Ordering::Release);
    }

    /// Writes a tick, if there is room.
    #[inline]
    pub(super) fn enter<R: Real>(
        &mut self,
        trace: &Trace<R, AXES>,
        generation: u32,
        failures: u8,
        trips: u8,
    ) {
        let Some((next, place)) = after(self.ends.entered.load(Ordering::Relaxed), self.places) else {
            return;
        };
        if next != self.ends.taken.load(Ordering::Acquire) {
            place.write(trace, generation, failures, trips);
            self.ends.entered.store(next, Ordering::Release);
        } else {
            self.leave_out();
        }
    }
}

/// The background's end.
pub(super) struct TicksOut<'a, const AXES: usize> {
    places: &'a [Place<AXES>],
    ends: &'a Ends,
}

impl<const AXES: usize> TicksOut<'_, AXES> {
    /// Number of ticks that wait.
    pub(super) fn len(&self) -> usize {
        let (entered, taken) =
            (self.ends.entered.load(Ordering::Acquire), self.ends.taken.load(Ordering::Relaxed));
        if entered >= taken { entered - taken } else { entered + self.places.len() - taken }
    }

    /// The first one; none if a tick is missing before one of those that wait.
    pub(super) fn first(&self) -> Option<TickRecord<AXES>> {
        let at = self.ends.taken.load(Ordering::Relaxed);
        // In this order: what has entered behind one that was left out is seen together with that.
        if at == self.ends.entered.load(Ordering::Acquire) || self.is_missing() {
            return None;
        }
        after(at, self.places).map(|(_, place)| place.read())
    }

    /// Drops the first one.
    pub(super) fn drop_first(&mut self) {
        let at = self.ends.taken.load(Ordering::Relaxed);
        if at != self.ends.entered.load(Ordering::Acquire)
            && let Some((next, _)) = after(at, self.places)
        {
            self.ends.taken.store(next, Ordering::Release);
        }
    }

    /// Whether a tick was left out since they were dropped.
    pub(super) fn is_missing(&self) -> bool {
        self.ends.is_missing.load(Ordering::Acquire)
    }

    /// Drops all that wait; no tick may come meanwhile that is wanted.
    pub(super) fn clear(&mut self) {
        self.ends.is_missing.store(false, Ordering::Release);
        self.ends.taken.store(self.ends.entered.load(Ordering::Acquire), Ordering::Release);
    }
}
