//! The discrete Fourier transform of real signals whose length is a power of two.

use core::f64::consts::TAU;

use crate::drive::model::Complex;

/// A signal's spectrum: Σ x\[k\]·e^(−2πi·jk/n) in bin j. The signal is as long as a power of two.
pub(super) fn spectrum(signal: &[f64]) -> Vec<Complex> {
    let mut bins: Vec<Complex> = signal.iter().map(|&value| Complex::new(value, 0.0)).collect();
    transform(&mut bins);
    bins
}

/// The real part of the signal with these bins.
pub(super) fn signal(mut bins: Vec<Complex>) -> Vec<f64> {
    let scale = 1.0 / bins.len() as f64;
    for bin in &mut bins {
        *bin = bin.conjugate();
    }
    transform(&mut bins);
    bins.iter().map(|value| value.re * scale).collect()
}

/// Radix 2, decimation in time.
fn transform(values: &mut [Complex]) {
    let length = values.len();
    if length < 2 {
        return;
    }
    debug_assert!(length.is_power_of_two());
    let shift = usize::BITS - length.trailing_zeros();
    for index in 0..length {
        let mirrored = index.reverse_bits() >> shift;
        if index < mirrored {
            values.swap(index, mirrored);
        }
    }
    let twiddles: Vec<Complex> = (0..length / 2)
        .map(|index| {
            let (sine, cosine) = libm::sincos(-TAU * index as f64 / length as f64);
            Complex::new(cosine, sine)
        })
        .collect();
    let mut half = 1;
    while half < length {
        let stride = length / (2 * half);
        for group in values.chunks_exact_mut(2 * half) {
            let (low, high) = group.split_at_mut(half);
            for ((low, high), &twiddle) in low.iter_mut().zip(high).zip(twiddles.iter().step_by(stride)) {
                let (even, odd) = (*low, *high * twiddle);
                (*low, *high) = (even + odd, even - odd);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_sum_and_comes_back() {
        for length in [1_usize, 2, 8, 64] {
            let values: Vec<f64> = (0..length).map(|index| ((index * index) as f64 * 0.7).sin()).collect();
            let bins = spectrum(&values);
            for (bin, found) in bins.iter().enumerate() {
                let mut sum = Complex::ZERO;
                for (index, &value) in values.iter().enumerate() {
                    let (sine, cosine) = (-TAU * (index * bin) as f64 / length as f64).sin_cos();
                    sum = sum + Complex::new(value * cosine, value * sine);
                }
                assert!((*found - sum).magnitude() < 1e-11, "{length} {bin}");
            }
            for (back, value) in signal(bins).iter().zip(values) {
                assert!((back - value).abs() < 1e-13);
            }
        }
    }
}
