//! Numbers: what the kernel's arithmetic is generic over.
//!
//! Three levels, by what they are for:
//!
//! - [`Unit`]: normalised quantities of magnitude below 4, such as the time inside a phase, the law's
//!   shapes, a direction. 32 bits suffice for them.
//! - [`Real`]: quantities with a unit: offsets, velocities, accelerations, gains. A `Real` is scaled by
//!   a `Unit`, and converts exactly from and to the 32.32 fixed-point positions. This is all the tick
//!   needs.
//! - [`Root`]: divide and take roots, for planning. Never in the tick.
//!
//! | `Real` | `Unit` | for |
//! |---|---|---|
//! | f32 | f32 | cores with a single-precision FPU |
//! | f64 | f64 | the reference, on a PC |
//! | [`Fixed`] | `I3F29` | cores without an FPU |
//!
//! Every operation is IEEE basic arithmetic or integer arithmetic, nothing is contracted to a fused
//! multiply-add and no platform library is called, so the same input gives the same bits on every
//! target.
//!
//! ```
//! use motion_kernel::num::{Fixed, Real, Scalar};
//!
//! /// The way to a stop under a constant deceleration, in any number type \[mm\].
//! fn stop_mm<R: Real>(feed_mm_s: f64, share_s_per_mm: f64) -> f64 {
//!     let feed = R::from_f64(feed_mm_s);
//!     (feed * (feed * R::from_f64(share_s_per_mm))).to_f64()
//! }
//! assert_eq!(stop_mm::<f32>(50.0, 0.001), stop_mm::<f64>(50.0, 0.001));
//! assert!((stop_mm::<Fixed>(50.0, 0.001) - 2.5).abs() < 1e-6);
//! ```

mod cube_root;
mod fixed_point;
mod float;
mod series;
pub(crate) mod sine;
mod table;

pub use fixed_point::Fixed;
pub(crate) use float::{in_q32, is_finite, is_within, of_q32, whole};
pub use series::Coefficients;
pub(crate) use series::SERIES_TERMS_MAX;

use core::fmt::Debug;
use core::hint::black_box;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `slices` for a loop of the background that is not to be unrolled: the optimiser does not see how long they
/// are. In software a few operations of f64 are a hundred bytes, and flash is worth more than the
/// background's time. A loop that calls nothing is unrolled all the same, unless what it works on goes
/// through here, too.
#[inline(always)]
pub(crate) fn rolled<T>(slices: T) -> T {
    black_box(slices)
}

/// What every number of the kernel can do.
pub trait Scalar:
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

    /// The nearest value to `value`, for constants and configuration. Fixed point saturates, and takes
    /// what is not a number for 0; use [`Real::checked_from_f64`] for input.
    fn from_f64(value: f64) -> Self;
    /// The value, for records and background code.
    fn to_f64(self) -> f64;

    /// Its bits, for digests: equal bits mean equal values of this type.
    fn to_bits64(self) -> u64;

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
}

/// A normalised quantity, |x| < 4.
pub trait Unit: Scalar + Coefficients {
    /// Terms of the series of [`Coefficients`] that this type resolves up to y = 1, at most 12.
    const SERIES_TERMS: usize;
    /// Magnitudes below this are held; infinite for floats.
    const LIMIT: f64;

    /// A fraction of one in steps of 2⁻⁶⁴.
    fn from_fraction(fraction: u64) -> Self;
}

/// A quantity with a unit, that the tick can compute with.
pub trait Real: Scalar + serde::Serialize + serde::de::DeserializeOwned {
    /// The normalised quantities that scale it.
    type Unit: Unit;
    /// Distance from 1 to the next larger value.
    const EPSILON: f64;
    /// The longest piece of path whose local offset this type resolves to a small part of a
    /// 0.1 µm count \[mm\]. Longer lines are cut into several pieces.
    const PIECE_MM_MAX: f64;

    /// The greatest Jp·(2e)³ of a ramp whose positions this type keeps within a quarter of a 0.1 µm count
    /// \[mm\]: a five-hundredth of it is scaled by a sine of this type, good to six [`Self::EPSILON`] in a
    /// float and 70 steps of 2⁻²⁹ in fixed point. Reached by limits so soft that a ramp takes a minute.
    const RAMP_MM_MAX: f64;

    /// Greatest velocity, acceleration and jerk that an axis may be asked for \[mm/s, mm/s², mm/s³\], and
    /// with the last the greatest number on the way to them, whatever its unit; none for floats, whose range
    /// is out of reach. Feedforward is accepted with room for as much.
    const SETPOINT_MAX: Option<[f64; 3]>;

    /// The nearest value to `value`; `None` if it is not finite or beyond the type's range.
    fn checked_from_f64(value: f64) -> Option<Self>;
    /// This quantity times a normalised one.
    #[must_use]
    fn scaled(self, by: Self::Unit) -> Self;
    /// A value below 4 in magnitude as a normalised one.
    fn to_unit(self) -> Self::Unit;
    /// A signed value in steps of 2⁻³².
    fn from_q32(bits: i64) -> Self;
    /// The value in steps of 2⁻³², truncated towards zero to a step or, in f32, two; 0 if it is not a number.
    /// Beyond ±2³¹, where nothing that is accepted comes, the result is some number.
    fn to_q32(self) -> i64;
    /// The nearest integer, halves away from zero; saturates, and is 0 if the value is not a number.
    fn round_to_i16(self) -> i16;
}

/// What planning needs beyond [`Real`]. Background only.
///
/// Plans multiply and divide figures whose products outgrow fixed point although the result does not:
/// those that combine two steps keep the product between them whole.
pub trait Root: Real + Div<Output = Self> {
    /// Least and greatest limit of acceleration, jerk and snap that plans are made with
    /// \[mm/s², mm/s³, mm/s⁴\]; see [`Law::new`](crate::law::Law::new).
    const LIMITS: (f64, f64);
    /// Least and greatest ceiling of a block \[mm/s\]. A feed below the least is a ramp from rest without a
    /// length.
    const FEEDS_MM_S: (f64, f64);
    /// The shortest length of a block that has any \[mm\].
    const LENGTH_MIN_MM: f64;

    /// A little greater, for what rounding must never make too small; in floats it is the same, whose rounding is
    /// a part of the value.
    #[must_use]
    fn rounded_up(self) -> Self;
    /// Square root; `self` ≥ 0.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Cube root.
    #[must_use]
    fn cbrt(self) -> Self;
    /// (self/per)^⅓ for `per` > 0. Fixed point divides the roots: the quotient may be too small for it.
    #[must_use]
    fn cbrt_quotient(self, per: Self) -> Self;
    /// self/2.
    #[must_use]
    fn half(self) -> Self {
        self * Self::from_f64(0.5)
    }
    /// self·by/2. Fixed point rounds the result alone, to the nearest, and saturates.
    #[must_use]
    fn half_product(self, by: Self) -> Self {
        self.times_per(by, Self::from_f64(2.0))
    }
    /// self·by/per. Fixed point rounds the result alone, to the nearest, and saturates.
    #[must_use]
    fn times_per(self, by: Self, per: Self) -> Self;
    /// √(self·other); both ≥ 0. Fixed point rounds the result alone, down.
    #[must_use]
    fn sqrt_product(self, other: Self) -> Self;
    /// √(self² + other²). Fixed point rounds the result alone, down, and saturates.
    #[must_use]
    fn root_of_squares(self, other: Self) -> Self;
    /// √(self² + of/per); `of` ≥ 0, `per` > 0. Fixed point divides the roots: the quotient may be too small for it.
    #[must_use]
    fn root_of_square_and_quotient(self, of: Self, per: Self) -> Self;
    /// The distance of neighbouring values around this one, to a factor of two.
    #[must_use]
    fn spacing(self) -> Self;
}
