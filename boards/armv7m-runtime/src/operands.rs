//! Pairs of numbers to test the routines with: with exponents far apart and near; with short fractions, so that sums and products
//! are half way between two numbers; at both ends of the range; and zeros, infinities and NaN.

use core::hint::black_box;

const FRACTION: u64 = (1 << 52) - 1;
const SIGN: u64 = 1 << 63;
/// Numbers with rules of their own, as bits without sign: zero, the least number, the greatest subnormal number, the least normal
/// one, 1, the greatest number, infinity, NaN.
const SPECIAL: [u64; 8] =
    [0, 1, FRACTION, FRACTION + 1, 1023 << 52, (0x7FF << 52) - 1, 0x7FF << 52, (0x7FF << 52) + 1];

/// Pairs that emulated cores are tested with, and after how many each time there is a digest.
const PAIRS: usize = 2_000_000;
const PAIRS_PER_DIGEST: usize = 10_000;

/// Digests of the results of all pairs so far, as the processor computes them, after every ten thousand of two million.
pub fn digests() -> impl Iterator<Item = u64> {
    let (mut pairs, mut results) = (Operands::new(2), Results::default());
    (0..PAIRS / PAIRS_PER_DIGEST).map(move |_| {
        for (a, b) in pairs.by_ref().take(PAIRS_PER_DIGEST) {
            let (x, y) = black_box((f64::from_bits(a), f64::from_bits(b)));
            results.take(x, y);
        }
        results.0
    })
}

/// A sequence of pairs, as bits of f64; the same for a seed everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Operands(u64);

impl Operands {
    /// The sequence of a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        // Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    }

    /// From −`most` to `most`, wrapped.
    fn small(&mut self, most: u32) -> u64 {
        u64::from((self.bits() >> 32) as u32 % (2 * most + 1)).wrapping_sub(u64::from(most))
    }
}

impl Iterator for Operands {
    type Item = (u64, u64);

    fn next(&mut self) -> Option<(u64, u64)> {
        let (kind, a, b) = (self.bits(), self.bits(), self.bits());
        let exponent = a >> 52 & 0x7FF;
        let with = |bits: u64, exponent: u64| bits & !(0x7FF << 52) | (exponent & 0x7FF) << 52;
        // The upper places alone, of some number.
        let short = |bits: u64, places: u64| bits & !(FRACTION >> (places % 52));
        let special = |which: u64| SPECIAL[(which & 7) as usize] | which << 60 & SIGN;
        let near = exponent.wrapping_add(self.small(70));
        let pair = match kind & 15 {
            0 => (a, b),
            1 | 2 => (a, with(b, near)),
            3 => (a, with(b, exponent.wrapping_add(self.small(2)))),
            4 => (a, a ^ b & SIGN ^ b >> 1 >> (kind >> 8 & 63) & FRACTION),
            5 | 6 => (short(a, kind >> 8), with(short(b, kind >> 16), near)),
            // A sum that carries far up, of a number with one bit more, which may be lost.
            7 => (
                a | FRACTION << (kind >> 8 & 63) & FRACTION,
                with(b & !FRACTION | 1 << ((kind >> 16) % 52), near),
            ),
            // Sums of small numbers and of great ones.
            8 => (with(a, kind >> 8 & 63), with(b, kind >> 16 & 63)),
            9 => (with(a, 2046 - (kind >> 8 & 3)), with(b, 2046 - (kind >> 16 & 63))),
            // Products and quotients at the ends of the range.
            10 => (a, with(b, 1023_u64.wrapping_sub(exponent).wrapping_add(self.small(60)))),
            11 => (a, with(b, 3069_u64.wrapping_sub(exponent).wrapping_add(self.small(3)))),
            12 => (a, with(b, exponent.wrapping_add(1022).wrapping_add(self.small(60)))),
            13 => (a, special(kind >> 8)),
            14 => (special(kind >> 8), b),
            _ => (special(kind >> 8), special(kind >> 16)),
        };
        Some(pair)
    }
}

/// A digest of results, in which every NaN is the same.
#[derive(Default)]
struct Results(u64);

impl Results {
    /// Adds those of a pair.
    fn take(&mut self, x: f64, y: f64) {
        for result in [x + y, x - y, x * y, x / y] {
            // By its bits: comparisons are tested themselves.
            let bits = result.to_bits();
            self.add(if bits & !SIGN > 0x7FF << 52 { 0x7FF << 52 | 1 } else { bits });
        }
        let order = [x < y, x <= y, x > y, x >= y, x == y, x.partial_cmp(&y).is_none()];
        self.add(order.into_iter().fold(0, |bits, is_so| bits << 1 | u64::from(is_so)));
    }

    fn add(&mut self, bits: u64) {
        // FNV-1a, by words.
        self.0 = (self.0 ^ bits).wrapping_mul(0x0000_0100_0000_01B3).rotate_left(29);
    }
}
