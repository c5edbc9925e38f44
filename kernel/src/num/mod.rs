//! Numbers: what the kernel's arithmetic is generic over, and the sine of our own.
//!
//! Two levels. [`Real`] is all the tick needs: add, subtract, multiply, compare, a sine, and exact
//! conversions from and to the 32.32 fixed-point positions. [`Root`] adds what only planning needs
//! (divide, roots); it never runs in the tick.
//!
//! Every operation is IEEE basic arithmetic or integer arithmetic, nothing is contracted to a fused
//! multiply-add and no platform library is called, so the same input gives the same bits on every
//! target.

mod float;
mod sine;

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number the tick can compute with.
///
/// Nothing here assumes a floating point: a fixed-point type can implement it.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Send
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Distance from 1 to the next larger value.
    const EPSILON: f64;
    /// Terms of the power series of the law's shapes that this type resolves over half a phase, at
    /// most 12 (see [`crate::law::shape`]).
    const SERIES_TERMS: usize;
    /// The longest piece of path whose local offset this type resolves to a small part of a
    /// 0.1 µm count \[mm\]. Longer lines are cut into several pieces.
    const PIECE_MM_MAX: f64;

    /// The nearest value to `value`. For constants and configuration.
    fn from_f64(value: f64) -> Self;
    /// The value, for records and background code.
    fn to_f64(self) -> f64;
    /// A fraction of one in steps of 2⁻⁶⁴.
    fn from_fraction(fraction: u64) -> Self;
    /// A signed value in steps of 2⁻³².
    fn from_q32(bits: i64) -> Self;
    /// The value in steps of 2⁻³², truncated towards zero; saturates beyond ±2³¹, and is 0 if the
    /// value is not a number.
    fn to_q32(self) -> i64;
    /// The nearest integer, halves away from zero; saturates, and is 0 if the value is not a number.
    fn round_to_i16(self) -> i16;
    /// False for infinities and what is not a number.
    fn is_finite(self) -> bool;
    /// (sin πx, cos πx) for `x` in \[0, 1/2\]; absolute error at most [`SINE_ERROR_F64`] in f64 and
    /// [`SINE_ERROR_F32`] in f32.
    fn sin_cos_half_turn(x: Self) -> (Self, Self);

    /// |x|.
    #[must_use]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// The smaller of two.
    #[must_use]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    /// The larger of two.
    #[must_use]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }

    /// `self` limited to ±`bound`.
    #[must_use]
    fn clamp_abs(self, bound: Self) -> Self {
        self.min(bound).max(-bound)
    }
}

/// What planning needs beyond [`Real`]. Background only.
pub trait Root: Real + Div<Output = Self> {
    /// Square root; `self` ≥ 0.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Cube root.
    #[must_use]
    fn cbrt(self) -> Self;
}

pub use sine::{SINE_ERROR_F32, SINE_ERROR_F64};
