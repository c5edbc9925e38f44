//! Velocity and acceleration from encoder readings: local parabolas.
//!
//! Plain differences of a 1 µm encoder at 0.5 ms step by 2 mm/s and 4000 mm/s². A parabola fitted to n
//! readings about a tick has errors smaller by about n^1.5 and n^2.5, and no lag.

/// Parabolas through `half` readings to either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parabolas {
    half: usize,
    tick_s: f64,
}

impl Parabolas {
    /// Over about `time_s`, at least 5 readings.
    pub(super) fn over(time_s: f64, tick_s: f64) -> Self {
        Self { half: ((time_s / tick_s / 2.0) as usize).clamp(2, 1000), tick_s }
    }

    /// The shortest whose acceleration is good to `accel_mm_s2` for an encoder of this resolution, within 10
    /// ms.
    pub(super) fn resolving(accel_mm_s2: f64, resolution_mm: f64, tick_s: f64) -> Self {
        let longest = Self::over(10e-3, tick_s);
        let all = (2..=longest.half).map(|half| Self { half, tick_s });
        let mut good = all.filter(|parabolas| parabolas.accel_error_mm_s2(resolution_mm) <= accel_mm_s2);
        good.next().unwrap_or(longest)
    }

    /// Readings to either side.
    pub(super) fn half(&self) -> usize {
        self.half
    }

    /// Σk² and Σ(k² − mean)² over the readings.
    fn moments(&self) -> (f64, f64) {
        let n = (2 * self.half + 1) as f64;
        (n * (n * n - 1.0) / 12.0, n * (n * n - 1.0) * (n * n - 4.0) / 180.0)
    }

    /// Standard deviation of an acceleration under rounding.
    fn accel_error_mm_s2(&self, resolution_mm: f64) -> f64 {
        2.0 * rounding(resolution_mm) / self.moments().1.sqrt() / (self.tick_s * self.tick_s)
    }

    /// Standard deviation of a velocity under rounding.
    pub(super) fn velocity_error_mm_s(&self, resolution_mm: f64) -> f64 {
        rounding(resolution_mm) / self.moments().0.sqrt() / self.tick_s
    }

    /// The greatest acceleration in either direction \[mm/s²\]; 0 for too few readings.
    pub(super) fn greatest_accel(&self, positions: &[f64]) -> f64 {
        self.of(positions).map(|(_, _, accel)| accel.abs()).fold(0.0, f64::max)
    }

    /// Velocity and acceleration at every tick that has enough readings on both sides, as (tick, mm/s,
    /// mm/s²).
    pub(super) fn of<'a>(&self, positions: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + use<'a> {
        let Self { half, tick_s } = *self;
        let (second, fourth) = self.moments();
        let mean = second / (2 * half + 1) as f64;
        positions.windows(2 * half + 1).enumerate().map(move |(start, readings)| {
            let (mut slope, mut bend) = (0.0, 0.0);
            for (index, reading) in readings.iter().enumerate() {
                let k = index as f64 - half as f64;
                // Relative to the middle, so that large positions lose no digits.
                let rise = reading - readings[half];
                slope += k * rise;
                bend += (k * k - mean) * rise;
            }
            (start + half, slope / second / tick_s, 2.0 * bend / fourth / (tick_s * tick_s))
        })
    }
}

/// Standard deviation of a rounding error \[mm\].
pub(super) fn rounding(resolution_mm: f64) -> f64 {
    resolution_mm / 12.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_met() {
        let positions: Vec<f64> =
            (0..20).map(|k| 100.0 + 0.3 * f64::from(k) + 0.05 * f64::from(k * k)).collect();
        let parabolas = Parabolas::over(0.8, 0.1);
        assert_eq!(parabolas.half(), 4);
        for (tick, velocity, accel) in parabolas.of(&positions) {
            assert!((velocity - (3.0 + tick as f64)).abs() < 1e-9, "{velocity}");
            assert!((accel - 10.0).abs() < 1e-8, "{accel}");
        }
        assert_eq!(parabolas.of(&positions[..8]).count(), 0);
    }
}
