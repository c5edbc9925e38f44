//! Shared by the test programs: random numbers that replay, and arithmetic of thirty digits.
//!
//! Every random case replays from the seed that a failing test prints; set `MOTION_TEST_SEED` to search
//! elsewhere.

#![allow(dead_code, reason = "each test program uses its own part")]

pub(crate) mod dd;

/// SplitMix64.
pub(crate) struct Random(u64);

impl Random {
    /// A stream of its own for each `stream`. The seed is printed; the harness shows it on failure.
    pub(crate) fn new(stream: u64) -> Self {
        let seed =
            std::env::var("MOTION_TEST_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(20_240_917);
        println!("MOTION_TEST_SEED={seed}");
        Self(Self(seed ^ stream.wrapping_mul(0xd1b5_4a32_d192_ed03)).next())
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub(crate) fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// True once in `of`.
    pub(crate) fn once_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Log-uniform between two positive numbers.
    pub(crate) fn log(&mut self, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.unit())
    }
}
