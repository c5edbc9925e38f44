//! Ticks as bytes: what differs from what the ticks before let expect.
//!
//! A tick begins with a byte of flags. For every axis follows by how many counts its velocity has changed, zigzag, seven bits a
//! byte; what is flagged; and the byte of the check. In steady motion and at rest that is two bytes and one for each axis.
//!
//! Instead of flags a byte may say that something else follows: what was handed to the tick, a fault that the board has found.

use super::record::{Check, failed};
use super::tick_record::{TickRecord, TripCount};
use crate::hal::{AxisInputs, MachineInputs};

/// Instead of flags: what was handed to the tick that comes next.
pub(super) const HANDED: u8 = 1 << 7;
/// Instead of flags: a fault that the board has found before the tick that comes next.
pub(super) const TRIP: u8 = HANDED | 1;
/// The inputs follow, a byte for each axis, and one for the emergency stop.
const INPUTS: u8 = 1;
/// What failed follows.
const FAILURES: u8 = 1 << 1;
/// The board has found faults, those that came before it.
const TRIPS: u8 = 1 << 2;
/// The board has found the same faults as before the last tick.
const SAME_TRIPS: u8 = 1 << 3;

/// Bytes being written.
#[derive(Debug)]
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    pub(super) count: usize,
    /// There was no room for all.
    is_full: bool,
}

impl<'a> Writer<'a> {
    pub(super) fn new(out: &'a mut [u8]) -> Self {
        Self { out, count: 0, is_full: false }
    }

    /// What `write` writes as a whole, or nothing; whether there was room.
    pub(super) fn all(&mut self, write: impl FnOnce(&mut Self)) -> bool {
        let begin = self.count;
        self.is_full = false;
        write(self);
        if self.is_full {
            self.count = begin;
        }
        !self.is_full
    }

    pub(super) fn push(&mut self, byte: u8) {
        match self.out.get_mut(self.count) {
            Some(place) => {
                *place = byte;
                self.count += 1;
            }
            None => self.is_full = true,
        }
    }

    /// A value in the postcard wire format.
    pub(super) fn value<T: serde::Serialize>(&mut self, value: &T) {
        let written = self.out.get_mut(self.count..).and_then(|room| postcard::to_slice(value, room).ok());
        match written {
            Some(written) => self.count += written.len(),
            None => self.is_full = true,
        }
    }

    /// Seven bits a byte, the lowest first.
    fn number(&mut self, mut number: u32) {
        // Five bytes at most.
        for _ in 0..5 {
            let low = (number & 0x7F) as u8;
            number >>= 7;
            if number == 0 {
                return self.push(low);
            }
            self.push(low | 0x80);
        }
    }
}

/// Bytes being read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn next(&mut self) -> Option<u8> {
        let (byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*byte)
    }

    pub(super) fn value<T: serde::de::DeserializeOwned>(&mut self) -> Option<T> {
        let (value, rest) = postcard::take_from_bytes(self.0).ok()?;
        self.0 = rest;
        Some(value)
    }

    fn number(&mut self) -> Option<u32> {
        let mut number = 0_u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.next()?;
            number |= u32::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }
}

/// What is expected of the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected<const AXES: usize> {
    counts: [u32; AXES],
    /// By how much they changed in the last tick.
    speed: [u32; AXES],
    inputs: [AxisInputs; AXES],
    is_stopped: bool,
    check: Check,
}

/// What a tick consumed, as it was sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Consumed<const AXES: usize> {
    /// The lower halves.
    pub(super) counts: [u32; AXES],
    pub(super) inputs: [AxisInputs; AXES],
    pub(super) is_stopped: bool,
    pub(super) failures: u8,
    pub(super) trips: TripCount,
    pub(super) check: u8,
}

impl<const AXES: usize> Expected<AXES> {
    /// After a tick that had read this.
    pub(super) fn after(counts: [u32; AXES], inputs: &MachineInputs<AXES>) -> Self {
        let &MachineInputs { axes: inputs, emergency_stop: is_stopped } = inputs;
        Self { counts, speed: [0; AXES], inputs, is_stopped, check: Check::default() }
    }

    /// Writes a tick, as far as there is room; then what is expected after it.
    pub(super) fn write(&self, record: &TickRecord<AXES>, out: &mut Writer<'_>) -> Self {
        let mut next = *self;
        let has_changed = (record.inputs, record.is_stopped) != (self.inputs, self.is_stopped);
        let flag = |is_set: bool, flag: u8| if is_set { flag } else { 0 };
        out.push(
            flag(has_changed, INPUTS)
                | flag(record.failures != 0, FAILURES)
                | match record.trips {
                    TripCount::None => 0,
                    TripCount::New(_) => TRIPS,
                    TripCount::Same => SAME_TRIPS,
                },
        );
        let places = next.counts.iter_mut().zip(&mut next.speed);
        for ((counts, speed), &read) in places.zip(&record.counts) {
            let moved = read.wrapping_sub(*counts);
            let faster = moved.wrapping_sub(*speed).cast_signed();
            out.number((faster << 1 ^ faster >> 31).cast_unsigned());
            (*counts, *speed) = (read, moved);
        }
        if has_changed {
            record.inputs.iter().for_each(|inputs| out.push(inputs.to_bits()));
            out.push(u8::from(record.is_stopped));
            (next.inputs, next.is_stopped) = (record.inputs, record.is_stopped);
        }
        if record.failures != 0 {
            out.push(record.failures);
        }
        out.push(next.check.add(record));
        next
    }

    /// Reads a tick behind its flags; none if it is none.
    pub(super) fn read(&mut self, flags: u8, bytes: &mut Bytes<'_>) -> Option<Consumed<AXES>> {
        if flags & !(INPUTS | FAILURES | TRIPS | SAME_TRIPS) != 0 {
            return None;
        }
        for (counts, speed) in self.counts.iter_mut().zip(&mut self.speed) {
            let number = bytes.number()?;
            let faster = number >> 1 ^ (number & 1).wrapping_neg();
            *speed = speed.wrapping_add(faster);
            *counts = counts.wrapping_add(*speed);
        }
        if flags & INPUTS != 0 {
            for inputs in &mut self.inputs {
                *inputs = AxisInputs::from_bits(bytes.next()?);
            }
            self.is_stopped = bytes.next()? != 0;
        }
        let failures = if flags & FAILURES == 0 { 0 } else { bytes.next()? };
        if failures & !failed::ALL != 0 {
            return None;
        }
        let trips = match flags & (TRIPS | SAME_TRIPS) {
            0 => TripCount::None,
            TRIPS => TripCount::New(0),
            SAME_TRIPS => TripCount::Same,
            _ => return None,
        };
        let Self { counts, inputs, is_stopped, .. } = *self;
        Some(Consumed { counts, inputs, is_stopped, failures, trips, check: bytes.next()? })
    }

    /// Whether a tick that was run again comes to what was sent.
    pub(super) fn agrees(&mut self, record: &TickRecord<AXES>, check: u8) -> bool {
        self.check.add(record) == check
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::units::DacCode;

    fn record(random: &Random, is_wild: bool, before: [u32; 2]) -> TickRecord<2> {
        let any = || (random.unit() * f64::from(u32::MAX)) as u32;
        let is = |chance: f64| random.unit() < chance;
        let near = |counts: u32| counts.wrapping_add(any() % 60).wrapping_sub(30);
        TickRecord {
            generation: 0,
            counts: if is_wild { [any(), any()] } else { before.map(near) },
            set: [any(), any()],
            codes: [DacCode(any() as i16), DacCode(0)],
            inputs: [AxisInputs::from_bits(if is(0.1) { any() as u8 } else { 1 }), AxisInputs::HEALTHY],
            is_stopped: is(0.1),
            state: (any() % 5) as u8,
            failures: if is(0.1) { any() as u8 & failed::ALL } else { 0 },
            trips: [TripCount::None, TripCount::Same, TripCount::New(0)][any() as usize % 3],
        }
    }

    /// Any ticks: slow, and such as no machine has. Their checks agree, and do not once a word of one of them differs.
    #[test]
    fn ticks_are_read_as_they_were_written() {
        let (random, mut found) = (Random::new(3), 0);
        let start = Expected::after([u32::MAX, 0], &MachineInputs::HEALTHY);
        let (mut writes, mut reads, mut counts) = (start, start, [u32::MAX, 0]);
        for round in 0..20_000 {
            let record = record(&random, round % 3 == 0, counts);
            counts = record.counts;
            let mut bytes = [0; 40];
            let mut out = Writer::new(&mut bytes);
            assert!(out.all(|out| writes = writes.write(&record, out)));
            let length = out.count;
            let mut left = Bytes(&bytes[..length]);
            let flags = left.next().expect("flags");
            let read = reads.read(flags, &mut left).expect("a tick");
            assert!(left.0.is_empty());
            assert_eq!(
                (read.counts, read.inputs, read.is_stopped, read.failures, read.trips),
                (record.counts, record.inputs, record.is_stopped, record.failures, record.trips)
            );
            let mut other = reads;
            found +=
                usize::from(!other.agrees(&TickRecord { set: [record.set[0] ^ 1, 7], ..record }, read.check));
            assert!(reads.agrees(&record, read.check));
            assert_eq!(reads, writes);
            // Cut anywhere it is none.
            for length in 1..length {
                let mut other = writes;
                assert!(other.read(flags, &mut Bytes(&bytes[1..length])).is_none());
            }
        }
        // But for one in 256.
        assert!(found > 19_800, "{found}");
    }

    /// Where there is no room nothing is written.
    #[test]
    fn a_tick_is_written_whole_or_not() {
        let start = Expected::after([0; 2], &MachineInputs::HEALTHY);
        let record = record(&Random::new(1), true, [0; 2]);
        let mut bytes = [0; 5];
        let mut out = Writer::new(&mut bytes);
        out.push(9);
        assert!(!out.all(|out| {
            start.write(&record, out);
        }));
        assert_eq!((out.count, out.all(|out| out.push(1)), out.count), (1, true, 2));
    }
}
