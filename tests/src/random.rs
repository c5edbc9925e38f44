//! Random numbers that replay: SplitMix64, seeded, the same everywhere.

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Neighbouring seeds give streams that are not alike. Who calls it says the seed where a test fails.
    pub fn new(seed: u64) -> Self {
        Self(Self(seed ^ 0x5851_F42D_4C95_7F2D).bits())
    }

    /// One of the streams of the seed `MOTION_TEST_SEED`, which is printed: the harness shows it on failure.
    pub fn of_stream(stream: u64) -> Self {
        let seed = crate::from_env("MOTION_TEST_SEED").unwrap_or(20_240_917);
        println!("MOTION_TEST_SEED={seed}");
        Self(Self(seed ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03)).bits())
    }

    /// As it was left at `state`.
    #[must_use]
    pub fn at(state: u64) -> Self {
        Self(state)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From 0 to below 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `least` to below `greatest`.
    pub fn between(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.unit()
    }

    /// Between two positive numbers, every decade as likely as any other.
    pub fn log(&mut self, least: f64, greatest: f64) -> f64 {
        least * (greatest / least).powf(self.unit())
    }

    /// From 0 to `count` − 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// One of them.
    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// True once in `of`.
    pub fn once_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// 1 or −1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A unit vector.
    pub fn direction(&mut self) -> [f64; 3] {
        loop {
            let vector = self.vector(1.0);
            let length = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
            if (0.1..=1.0).contains(&length) {
                return vector.map(|c| c / length);
            }
        }
    }

    /// Three coordinates up to `size`, of either sign.
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(-size, size))
    }
}
