//! Reproducible noise for the encoder.
//!
//! The generator is SplitMix64: a counter with an odd increment (2⁶⁴ over the golden ratio) put through
//! two rounds of xor-shift and multiply. It passes through all 2⁶⁴ states, has no bad seeds and needs
//! one word. For disturbances in tests, not for cryptography.

/// A stream of pseudo-random numbers from a seed.
#[derive(Clone, Debug)]
pub(crate) struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    pub(crate) const fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// The next 64 bits.
    pub(crate) fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    /// A whole number from −`amplitude` to `amplitude`, all equally likely to 2⁻³².
    pub(crate) fn within(&mut self, amplitude: u16) -> i64 {
        let choices = 2 * u64::from(amplitude) + 1;
        // Scaling the upper half by the number of choices avoids a division.
        let choice = ((self.next() >> 32) * choices) >> 32;
        choice as i64 - i64::from(amplitude)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_the_published_one() {
        // First outputs of SplitMix64 with seed 1234567, as published with other implementations.
        let mut stream = SplitMix64::new(1_234_567);
        assert_eq!(stream.next(), 6_457_827_717_110_365_317);
        assert_eq!(stream.next(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn every_choice_comes_equally_often() {
        let mut stream = SplitMix64::new(1);
        let mut times = [0_u32; 7];
        for _ in 0..70_000 {
            times[(stream.within(3) + 3) as usize] += 1;
        }
        assert!(times.iter().all(|&count| count.abs_diff(10_000) < 400), "{times:?}");
    }
}
