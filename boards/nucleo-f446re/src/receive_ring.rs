//! Where a ring of bytes that the DMA fills is read.
//!
//! Consumes the place where the DMA is and the flags that it sets half-way and at the end; produces the places to read. Not
//! more than half of the ring may come between two looks: what may be more is given up and counted. Background.

/// Places of a ring of `SIZE` bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceiveRing<const SIZE: usize> {
    next: usize,
    /// Where the DMA was at the last look.
    end: usize,
    lost: u32,
}

impl<const SIZE: usize> ReceiveRing<SIZE> {
    /// Before the first byte.
    #[must_use]
    pub const fn new() -> Self {
        Self { next: 0, end: 0, lost: 0 }
    }

    /// How often bytes were given up.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// The next place to read, or none: then the DMA is to be looked at.
    pub fn next_place(&mut self) -> Option<usize> {
        if self.next == self.end {
            return None;
        }
        let place = self.next;
        self.next = (place + 1) % SIZE;
        Some(place)
    }

    /// A look: the DMA writes to the place `at` next, and since the last look `has_passed` the middle, and the end. The flags
    /// are read first: what it passes meanwhile then counts for the next look.
    pub fn look(&mut self, at: usize, has_passed: [bool; 2]) {
        self.end = at % SIZE;
        // Whoever has come round has passed both.
        if has_passed == [true; 2] {
            self.next = self.end;
            self.lost = self.lost.saturating_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 64;

    /// Bytes come in lumps of random length and are read all, or a random part: in order, and none twice. Up to half of the
    /// ring nothing is lost; where it was all of it or more, that is noticed.
    #[test]
    fn bytes_come_in_order_and_losses_are_noticed() {
        let mut random = 1_u64;
        let mut below = |count: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % count
        };
        let (mut ring, mut bytes) = (ReceiveRing::<SIZE>::new(), [0_u64; SIZE]);
        let (mut written, mut read) = (0_u64, 0_u64);
        for most in [SIZE / 2, 3 * SIZE] {
            let mut losses = 0;
            for _ in 0..100_000 {
                let count = below(most as u64 + 1);
                let mut has_passed = [false; 2];
                for _ in 0..count {
                    bytes[written as usize % SIZE] = written;
                    written += 1;
                    has_passed[0] |= written as usize % SIZE == SIZE / 2;
                    has_passed[1] |= (written as usize).is_multiple_of(SIZE);
                }
                let before = ring.lost();
                ring.look(written as usize % SIZE, has_passed);
                if ring.lost() > before {
                    assert!(count > SIZE as u64 / 2, "{count}");
                    (read, losses) = (written, losses + 1);
                }
                assert!(count < SIZE as u64 || ring.lost() > before, "{count}");
                while let Some(place) = ring.next_place() {
                    assert_eq!(bytes[place], read);
                    read += 1;
                }
                assert_eq!(read, written);
            }
            assert_eq!(losses > 0, most > SIZE / 2);
        }
    }
}
