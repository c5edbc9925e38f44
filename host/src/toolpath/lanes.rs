//! Numbers one by one, or four at once.
//!
//! What is computed at many places of a curve is computed at four of them by the same instructions. Each lane has the bits
//! that one number has, but for the sign of 0.

use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub, SubAssign};

use wide::f64x4;

/// How many places are computed at once.
pub(super) const LANES: usize = 4;

/// A number, or one in each lane.
pub(crate) trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// The same number in each.
    fn of(number: f64) -> Self;

    fn sqrt(self) -> Self;
}

impl Lanes for f64 {
    fn of(number: f64) -> Self {
        number
    }

    fn sqrt(self) -> Self {
        self.sqrt()
    }
}

impl Lanes for f64x4 {
    fn of(number: f64) -> Self {
        Self::splat(number)
    }

    fn sqrt(self) -> Self {
        self.sqrt()
    }
}
