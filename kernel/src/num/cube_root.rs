//! Cube roots of floats, from basic arithmetic alone: the same bits on every target.
//!
//! A third of the exponent and a straight line through the digits come within 3.3 % of the root. Two steps of
//! Halley's in f32, each of which cubes the error, leave only the rounding of f32. A third one in f64 leaves that
//! of f64. A core without f64 pays for nine operations in software; the correctly rounded root of `libm` takes
//! fused products, which it lacks, too (docs/decisions/46-answers.md).

/// The cube root, within 0.67 of a last place. 0 and what is not finite is returned.
#[inline(never)]
pub(super) fn cbrt(x: f64) -> f64 {
    const FRACTION_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    const FRACTION: u64 = (1 << FRACTION_BITS) - 1;
    /// A multiple of 3.
    const BIAS: u32 = 1023;
    /// The cube root of 2⁵⁴, which makes a subnormal number normal: by its exponent.
    const STEPS: u32 = 18;
    let exponent_of = |bits: u64| (bits >> FRACTION_BITS) as u32 & 0x7FF;
    let is_subnormal = exponent_of(x.to_bits()) == 0;
    let bits = if is_subnormal { (x * (1_u64 << (3 * STEPS)) as f64).to_bits() } else { x.to_bits() };
    let exponent = exponent_of(bits);
    if exponent == 0 || exponent == 0x7FF {
        return x;
    }
    // |x| = digits·8ⁿ with digits from 1 to below 8.
    let digits = f64::from_bits(bits & FRACTION | u64::from(BIAS + exponent % 3) << FRACTION_BITS);
    // Its square is exact.
    let root = f64::from(cbrtf(digits as f32));
    let quotient = digits / (root * root);
    let root = root + root * ((quotient - root) / ((root + root) + quotient));
    // ±2ⁿ, by its exponent.
    let biased = exponent / 3 + (BIAS - BIAS / 3) - if is_subnormal { STEPS } else { 0 };
    root * f64::from_bits(bits & 1 << 63 | u64::from(biased) << FRACTION_BITS)
}

/// The cube root, within a last place. 0 and what is not finite is returned.
pub(super) fn cbrtf(x: f32) -> f32 {
    /// Two thirds of the exponent's bias, less what makes the line's greatest error least.
    const OFFSET: u32 = 0x2A51_0680;
    /// The cube root of 2²⁴, which makes a subnormal number normal.
    const SCALE: f32 = 256.0;
    let is_subnormal = x.to_bits() << 1 < f32::MIN_POSITIVE.to_bits() << 1;
    let of = if is_subnormal { x.abs() * (SCALE * SCALE * SCALE) } else { x.abs() };
    if of == 0.0 || !of.is_finite() {
        return x;
    }
    let mut root = f32::from_bits(of.to_bits() / 3 + OFFSET);
    for _ in 0..2 {
        // Nothing here is too large where the root is not.
        let quotient = of / (root * root);
        root = root + root * ((quotient - root) / ((root + root) + quotient));
    }
    if is_subnormal {
        root *= 1.0 / SCALE;
    }
    root.copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Against the root that is rounded correctly, over all exponents and both signs.
    #[test]
    fn roots_are_within_a_last_place() {
        let random = Random::new(11);
        let (mut worst, mut worst_f32) = (0, 0);
        for _ in 0..2_000_000 {
            let x = f64::from_bits(random.next());
            if x.is_finite() {
                worst = worst.max(cbrt(x).to_bits().abs_diff(libm::cbrt(x).to_bits()));
            }
            let x = f32::from_bits(random.next() as u32);
            if x.is_finite() {
                worst_f32 = worst_f32.max(cbrtf(x).to_bits().abs_diff(libm::cbrtf(x).to_bits()));
            }
        }
        assert_eq!((worst, worst_f32), (1, 1));
    }

    /// Greatest error, in last places: half of one by the last sum, a sixth by what it adds.
    const ERROR_MAX: f64 = 0.67;

    /// The error itself, as that of the cube: e of the root is 3·e there.
    #[test]
    fn the_error_is_two_thirds_of_a_last_place() {
        let random = Random::new(12);
        let mut worst = 0.0_f64;
        for _ in 0..2_000_000 {
            let x = random.log(1.0, 8.0);
            let root = cbrt(x);
            // root³ − x by exact products.
            let square = root * root;
            let low = libm::fma(root, root, -square);
            let cube = square * root;
            let residual = (cube - x) + (libm::fma(square, root, -cube) + low * root);
            worst = worst.max((residual / (3.0 * x) * root).abs() / f64::EPSILON);
        }
        println!("worst: {worst:.4} of a last place");
        assert!(worst > 0.5 && worst < ERROR_MAX, "{worst}");
    }

    /// Powers of 8, subnormal ones too, are exact; 0 and what is not finite come back.
    #[test]
    fn exact_roots_and_no_numbers() {
        for n in -358..=341 {
            let root = libm::ldexp(1.0, n);
            let cube = libm::ldexp(1.0, 3 * n);
            assert_eq!((cbrt(cube), cbrt(-cube)), (root, -root), "8^{n}");
        }
        for n in -49..=42 {
            let root = libm::ldexpf(1.0, n);
            assert_eq!(cbrtf(libm::ldexpf(1.0, 3 * n)), root, "8^{n}");
        }
        for x in [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(cbrt(x).to_bits(), x.to_bits());
            assert_eq!(cbrtf(x as f32).to_bits(), (x as f32).to_bits());
        }
        assert!(cbrt(f64::NAN).is_nan() && cbrtf(f32::NAN).is_nan());
        assert!(cbrtf(f32::MAX).is_finite() && cbrt(f64::MAX).is_finite());
    }
}
