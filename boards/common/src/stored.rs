//! Parameters that a board keeps across power.
//!
//! Consumes records as they come over the link, and flash; produces the record that was stored last. A board takes a new one
//! in three steps, so that flash is written while nothing else runs: an erase stops the processor of most boards, for up to seconds.
//!
//! 1. [`Pending::put`]: while the drives are off the record goes to memory that a reset leaves as it is; then the board
//!    resets itself.
//! 2. [`Pending::take`] and [`ParameterStore::write`]: the start finds it and writes it to flash, before tick and watchdog run
//!    and before anything can be enabled.
//! 3. [`ParameterStore::read`]: this start and every later one.
//!
//! Where power fails at any instant, the next start has the old record or the new one. Each of two sectors has records one
//! behind the other, with numbers and checksums. A new one goes behind the newest; where there is no room, or a store was
//! interrupted there, into the other sector, which is erased first and has only older ones. So what is erased or written
//! never is what is valid, and a sector that is erased in part is no other than one with anything in it. (The crate
//! `sequential-storage` loses the old record where a sector is erased in part: it takes it for the source of a move.)

use core::ops::Range;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use embedded_storage::nor_flash::NorFlash;
use motion_kernel::program::Checksum;

/// Before a record: checksum of all that follows, number, length; 32 bits each, least significant byte first.
const HEAD: usize = 12;
/// Records begin at multiples of this, which is one of the flash's smallest write \[bytes\].
const STEP: usize = 16;
/// What the store needs of a buffer beside the longest record \[bytes\].
pub const OVERHEAD: usize = HEAD + STEP;
/// A byte that is erased.
const ERASED: u8 = 0xff;

/// Why flash does not keep a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// The flash can't be read, written or erased, or has something else than was written.
    Flash,
    /// The record is too long for a sector or the buffer.
    Length,
}

/// Flash that keeps a record.
pub struct ParameterStore<F: NorFlash> {
    flash: F,
    /// Two, of the same size.
    sectors: [Range<u32>; 2],
}

/// A record in flash.
#[derive(Clone, Copy)]
struct Entry {
    sector: usize,
    at: u32,
    number: u32,
    length: usize,
}

impl<F: NorFlash> ParameterStore<F> {
    /// In this range of `flash`, in which nothing else is. `None` if it is not two sectors, or the flash is written in longer
    /// parts than 16 bytes.
    #[must_use]
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        let size = range.end.checked_sub(range.start)? / 2;
        let erased = u32::try_from(F::ERASE_SIZE).ok()?;
        let is_whole = size > 0 && range.start.is_multiple_of(erased) && size.is_multiple_of(erased);
        let is_fine = F::WRITE_SIZE > 0 && STEP.is_multiple_of(F::WRITE_SIZE);
        let middle = range.start + size;
        let sectors = [range.start..middle, middle..middle + size];
        (is_whole && is_fine && range.end == middle + size).then_some(Self { flash, sectors })
    }

    /// The record that was stored last; none if there is none. `buffer` is [`OVERHEAD`] longer than the longest one.
    ///
    /// # Errors
    /// The flash can't be read, or the record is longer than the buffer: a firmware with a longer one has stored it.
    pub fn read<'a>(&mut self, buffer: &'a mut [u8]) -> Result<Option<&'a [u8]>, StoreError> {
        let Some(entry) = self.newest(buffer)? else { return Ok(None) };
        if entry.length > buffer.len().saturating_sub(HEAD) {
            return Err(StoreError::Length);
        }
        // Others may have been read since.
        let found = self.entry(entry.sector, entry.at, buffer)?.map(|found| found.length);
        Ok(found.and_then(|length| buffer.get(HEAD..HEAD + length)))
    }

    /// Stores a record in the place of the one before, if it is another one. `buffer` is [`OVERHEAD`] longer than the longest record.
    ///
    /// # Errors
    /// The record is too long, or the flash can't be written. The record before is there then, if there was one.
    pub fn write(&mut self, record: &[u8], buffer: &mut [u8]) -> Result<(), StoreError> {
        let length = (HEAD + record.len()).next_multiple_of(STEP);
        let [first, _] = &self.sectors;
        if length > buffer.len() || length > first.len() || record.is_empty() {
            return Err(StoreError::Length);
        }
        if self.read(buffer) == Ok(Some(record)) {
            return Ok(());
        }
        let newest = self.newest(buffer)?;
        let number = newest.map_or(0, |entry| entry.number.wrapping_add(1));
        let behind = newest.map(|entry| (entry.sector, entry.at + stored_length(entry.length)));
        let at = match behind {
            Some((sector, at)) if self.is_erased(sector, at, length as u32, buffer)? => at,
            _ => {
                let sector = behind.map_or(0, |(sector, _)| 1 - sector);
                let Some(Range { start, end }) = self.sectors.get(sector).cloned() else {
                    return Err(StoreError::Flash);
                };
                self.flash.erase(start, end).map_err(|_| StoreError::Flash)?;
                start
            }
        };
        let Some(bytes) = buffer.get_mut(..length) else { return Err(StoreError::Length) };
        bytes.fill(ERASED);
        let numbers = number.to_le_bytes().into_iter().chain((record.len() as u32).to_le_bytes());
        for (place, byte) in bytes.iter_mut().skip(4).zip(numbers.chain(record.iter().copied())) {
            *place = byte;
        }
        let sum = Checksum::of(bytes.get(4..HEAD + record.len()).unwrap_or_default()).to_le_bytes();
        for (place, byte) in bytes.iter_mut().zip(sum) {
            *place = byte;
        }
        self.flash.write(at, bytes).map_err(|_| StoreError::Flash)?;
        if self.read(buffer)? == Some(record) { Ok(()) } else { Err(StoreError::Flash) }
    }

    /// The record with the greatest number, of both sectors.
    fn newest(&mut self, buffer: &mut [u8]) -> Result<Option<Entry>, StoreError> {
        let mut newest: Option<Entry> = None;
        for (sector, Range { start, end }) in self.sectors.clone().into_iter().enumerate() {
            let mut at = start;
            // Bounded: a record has a byte at least. What is behind one that was interrupted is not looked at.
            while at < end
                && let Some(entry) = self.entry(sector, at, buffer)?
            {
                // Numbers wrap.
                if newest.is_none_or(|newest| entry.number.wrapping_sub(newest.number).cast_signed() > 0) {
                    newest = Some(entry);
                }
                at += stored_length(entry.length);
            }
        }
        Ok(newest)
    }

    /// The record that begins at `at`; none if there is none. It is read to `buffer`, in pieces if it is longer.
    fn entry(&mut self, sector: usize, at: u32, buffer: &mut [u8]) -> Result<Option<Entry>, StoreError> {
        let room = self.sectors.get(sector).map_or(0, |sector| sector.end.saturating_sub(at)) as usize;
        let Some(head) = buffer.first_chunk_mut::<HEAD>().filter(|_| room >= HEAD) else { return Ok(None) };
        self.flash.read(at, head).map_err(|_| StoreError::Flash)?;
        let [a, b, c, d, e, f, g, h, i, j, k, l] = *head;
        let (sum, number) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
        let length = u32::from_le_bytes([i, j, k, l]) as usize;
        if length == 0 || length > room - HEAD {
            return Ok(None);
        }
        let (head, place) = buffer.split_at_mut(HEAD);
        let mut found = Checksum::NONE;
        found.update(head.get(4..).unwrap_or_default());
        let mut done = 0;
        // Bounded: a piece has a byte at least.
        while done < length {
            let piece = place.len().min(length - done);
            let Some(bytes) = place.get_mut(..piece).filter(|_| piece > 0) else { return Ok(None) };
            self.flash.read(at + (HEAD + done) as u32, bytes).map_err(|_| StoreError::Flash)?;
            found.update(bytes);
            done += piece;
        }
        Ok((found.finish() == sum).then_some(Entry { sector, at, number, length }))
    }

    /// Whether there is room for `length` bytes at `at`, and all of them are erased.
    fn is_erased(
        &mut self,
        sector: usize,
        at: u32,
        length: u32,
        buffer: &mut [u8],
    ) -> Result<bool, StoreError> {
        let Some(bytes) = buffer.get_mut(..length as usize) else { return Ok(false) };
        if self.sectors.get(sector).is_none_or(|sector| length > sector.end.saturating_sub(at)) {
            return Ok(false);
        }
        self.flash.read(at, bytes).map_err(|_| StoreError::Flash)?;
        Ok(bytes.iter().all(|&byte| byte == ERASED))
    }
}

/// Bytes that a record of `length` bytes takes.
fn stored_length(length: usize) -> u32 {
    (HEAD + length).next_multiple_of(STEP) as u32
}

/// A record of up to `BYTES` bytes that waits for the start after a reset, in memory that a reset leaves as it is: a static of
/// a section that is not initialised. After power came it has anything, which is no record.
pub struct Pending<const BYTES: usize> {
    length: AtomicU32,
    sum: AtomicU32,
    bytes: [AtomicU8; BYTES],
}

impl<const BYTES: usize> Pending<BYTES> {
    /// None.
    #[must_use]
    pub const fn new() -> Self {
        let bytes = [const { AtomicU8::new(0) }; BYTES];
        Self { length: AtomicU32::new(0), sum: AtomicU32::new(0), bytes }
    }

    /// Puts a record there; false if it is too long.
    pub fn put(&self, record: &[u8]) -> bool {
        if record.len() > BYTES {
            return false;
        }
        for (place, &byte) in self.bytes.iter().zip(record) {
            place.store(byte, Ordering::Relaxed);
        }
        self.sum.store(Checksum::of(record), Ordering::Relaxed);
        self.length.store(record.len() as u32, Ordering::Relaxed);
        true
    }

    /// The record, in `place`, if there is one; then never again.
    pub fn take<'a>(&self, place: &'a mut [u8]) -> Option<&'a [u8]> {
        // Not at once: small cores can't, and nothing else runs yet.
        let length = self.length.load(Ordering::Relaxed) as usize;
        self.length.store(0, Ordering::Relaxed);
        if length == 0 || length > BYTES {
            return None;
        }
        let place = place.get_mut(..length)?;
        for (byte, from) in place.iter_mut().zip(&self.bytes) {
            *byte = from.load(Ordering::Relaxed);
        }
        (Checksum::of(place) == self.sum.load(Ordering::Relaxed)).then_some(place)
    }
}

impl<const BYTES: usize> Default for Pending<BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash};

    use super::*;
    use crate::fixture::Random;

    /// Random numbers for several.
    struct Dice(RefCell<Random>);

    impl Dice {
        fn new(seed: u64) -> Self {
            Self(RefCell::new(Random(seed)))
        }

        fn below(&self, count: usize) -> usize {
            self.0.borrow_mut().below(count as u64) as usize
        }

        fn byte(&self) -> u8 {
            self.below(256) as u8
        }
    }

    const SECTOR: usize = 512;
    const RANGE: Range<u32> = 0..2 * SECTOR as u32;
    const BUFFER: usize = 160 + OVERHEAD;
    const _: () = assert!(BUFFER < SECTOR);

    /// Two sectors whose power fails after some bytes were written or erased: of the byte under way some bits are
    /// as they were, and some of the sector under way is erased.
    struct Flash<'a> {
        bytes: &'a mut [u8; 2 * SECTOR],
        /// Bytes until power fails.
        left: &'a mut usize,
        random: &'a Dice,
    }

    #[derive(Debug)]
    struct NoPower;

    impl NorFlashError for NoPower {
        fn kind(&self) -> NorFlashErrorKind {
            NorFlashErrorKind::Other
        }
    }

    impl ErrorType for Flash<'_> {
        type Error = NoPower;
    }

    impl ReadNorFlash for Flash<'_> {
        const READ_SIZE: usize = 1;

        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
            bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
            Ok(())
        }

        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl NorFlash for Flash<'_> {
        const WRITE_SIZE: usize = 1;
        const ERASE_SIZE: usize = SECTOR;

        fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
            // All bytes of a sector rise at once; where power fails, as many as there was time for.
            let sectors = &mut self.bytes[from as usize..to as usize];
            if *self.left < sectors.len() {
                let count = sectors.len();
                for byte in sectors {
                    *byte |= if self.random.below(count) < *self.left { 0xff } else { self.random.byte() };
                }
                *self.left = 0;
                return Err(NoPower);
            }
            *self.left -= sectors.len();
            sectors.fill(0xff);
            Ok(())
        }

        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
            for (place, &byte) in self.bytes[offset as usize..].iter_mut().zip(bytes) {
                assert_eq!(*place & byte, byte, "a bit that was not erased");
                if *self.left == 0 {
                    *place &= byte | self.random.byte();
                    return Err(NoPower);
                }
                *self.left -= 1;
                *place &= byte;
            }
            Ok(())
        }
    }

    fn record(random: &Dice, length: usize) -> Vec<u8> {
        (0..length).map(|_| random.byte()).collect()
    }

    /// Power fails anywhere in any store of a sequence: the start after it has the old record or the new one, and can store.
    #[test]
    fn a_loss_of_power_leaves_the_old_record_or_the_new_one() {
        let (mut olds, mut news) = (0, 0);
        for seed in 0..4000 {
            let random = Dice::new(seed);
            let (mut bytes, mut enough) = ([0xff; 2 * SECTOR], usize::MAX);
            let mut buffer = [0; BUFFER];
            let mut present: Option<Vec<u8>> = None;
            for _ in 0..12 {
                let next = record(&random, 1 + random.below(150));
                let mut left = if random.below(2) == 0 { random.below(1000) } else { usize::MAX };
                let flash = Flash { bytes: &mut bytes, left: &mut left, random: &random };
                let stored =
                    ParameterStore::new(flash, RANGE).expect("two sectors").write(&next, &mut buffer);
                let flash = Flash { bytes: &mut bytes, left: &mut enough, random: &random };
                let mut store = ParameterStore::new(flash, RANGE).expect("two sectors");
                let found = store.read(&mut buffer).map(|found| found.map(<[u8]>::to_vec));
                match found {
                    Ok(found) if found.as_ref() == Some(&next) => {
                        news += usize::from(stored.is_err());
                        present = found;
                    }
                    Ok(found) if found == present && stored == Err(StoreError::Flash) => olds += 1,
                    found => {
                        panic!("seed {seed}: {found:?} after {stored:?}, before {present:?}, new {next:?}")
                    }
                }
            }
        }
        assert!(olds > 1000 && news > 100, "{olds} {news}");
    }

    /// What an older and longer firmware left in the sectors.
    #[test]
    fn flash_with_something_else_is_erased_where_a_record_is_stored() {
        for seed in 0..200 {
            let random = Dice::new(seed);
            let (mut bytes, mut enough) = ([0; 2 * SECTOR], usize::MAX);
            if seed > 0 {
                bytes.fill_with(|| random.byte());
            }
            let mut buffer = [0; BUFFER];
            let flash = Flash { bytes: &mut bytes, left: &mut enough, random: &random };
            let mut store = ParameterStore::new(flash, RANGE).expect("two sectors");
            assert_eq!(store.read(&mut buffer), Ok(None), "seed {seed}");
            let next = record(&random, 120);
            assert_eq!(store.write(&next, &mut buffer), Ok(()), "seed {seed}");
            assert_eq!(store.read(&mut buffer), Ok(Some(&next[..])), "seed {seed}");
            let long = record(&random, 600);
            assert_eq!(store.write(&long, &mut buffer), Err(StoreError::Length));
            assert_eq!(store.read(&mut buffer), Ok(Some(&next[..])), "seed {seed}");
        }
    }

    /// A record that a firmware with a longer buffer has stored does not uncover the one before it, and is replaced.
    #[test]
    fn a_longer_record_is_told_and_replaced() {
        let random = Dice::new(5);
        let (mut bytes, mut enough) = ([0xff; 2 * SECTOR], usize::MAX);
        let flash = Flash { bytes: &mut bytes, left: &mut enough, random: &random };
        let mut store = ParameterStore::new(flash, RANGE).expect("two sectors");
        let (short, long, next) = (record(&random, 40), record(&random, 140), record(&random, 50));
        let (mut buffer, mut small) = ([0; BUFFER], [0; 64 + OVERHEAD]);
        assert_eq!(store.write(&short, &mut buffer), Ok(()));
        assert_eq!(store.write(&long, &mut buffer), Ok(()));
        assert_eq!(store.read(&mut small), Err(StoreError::Length));
        assert_eq!(store.read(&mut buffer), Ok(Some(&long[..])));
        assert_eq!(store.write(&next, &mut small), Ok(()));
        assert_eq!(store.read(&mut small), Ok(Some(&next[..])));
    }

    #[test]
    fn a_record_waits_once_and_anything_else_is_none() {
        let (pending, mut place) = (Pending::<64>::new(), [0; 64]);
        assert_eq!(pending.take(&mut place), None);
        assert!(!pending.put(&[7; 65]));
        assert!(pending.put(&[7; 64]));
        assert_eq!(pending.take(&mut place), Some(&[7; 64][..]));
        assert_eq!(pending.take(&mut place), None);
        let random = Dice::new(1);
        for _ in 0..10_000 {
            pending.length.store(random.below(80) as u32, Ordering::Relaxed);
            pending.sum.store(random.below(1 << 31) as u32, Ordering::Relaxed);
            pending.bytes[random.below(64)].store(random.byte(), Ordering::Relaxed);
            assert_eq!(pending.take(&mut place), None);
        }
    }
}
