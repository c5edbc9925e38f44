//! CRC-32, which detects damaged bytes: of programs, and of recordings.

/// CRC-32 (ISO-HDLC) of the bytes so far. Four bits at a time: the kilobyte of flash for a byte-wise table is
/// worth more than the milliseconds.
#[derive(Clone, Copy, Debug)]
pub struct Checksum(u32);

impl Checksum {
    /// The checksum of no bytes.
    pub const NONE: Self = Self(u32::MAX);
    /// The remainders of the four bits that leave, for the polynomial with its least significant bit first.
    // In a constant: an index beyond the table does not compile.
    #[allow(clippy::indexing_slicing)]
    const REST: [u32; 16] = {
        let (mut rest, mut index) = ([0; 16], 0);
        while index < 16 {
            let (mut sum, mut bit) = (index as u32, 0);
            while bit < 4 {
                sum = sum >> 1 ^ ((sum & 1) * 0xEDB8_8320);
                bit += 1;
            }
            rest[index] = sum;
            index += 1;
        }
        rest
    };

    /// The 32 bits of all of `bytes`.
    #[must_use]
    pub fn of(bytes: &[u8]) -> u32 {
        let mut sum = Self::NONE;
        sum.update(bytes);
        sum.finish()
    }

    /// Adds bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 ^= u32::from(byte);
            self.leave();
            self.leave();
        }
    }

    // Not inlined, because the loop over bytes would be unrolled.
    #[inline(never)]
    fn leave(&mut self) {
        // The index is below the length.
        let rest = Self::REST.get(self.0 as usize & 15).copied().unwrap_or_default();
        self.0 = self.0 >> 4 ^ rest;
    }

    /// The 32 bits.
    #[must_use]
    pub fn finish(self) -> u32 {
        !self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value that the catalogue of parametrised CRC algorithms gives for CRC-32/ISO-HDLC, in one part and
    /// in two.
    #[test]
    fn the_checksum_is_the_one_of_zip_and_ethernet() {
        for split in 0..=9 {
            let (first, second) = b"123456789".split_at(split);
            let mut sum = Checksum::NONE;
            sum.update(first);
            sum.update(second);
            assert_eq!(sum.finish(), 0xCBF4_3926);
        }
        assert_eq!(Checksum::of(b"123456789"), 0xCBF4_3926);
    }
}
