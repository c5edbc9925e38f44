//! Double-double arithmetic: an unevaluated sum of two f64, about 31 digits. An oracle's number, so
//! plain rather than fast: products are split by Dekker's method, roots are Newton's from f64.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// `hi + lo`, |lo| ≤ half an ulp of `hi`.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Dd {
    pub hi: f64,
    pub lo: f64,
}

/// A double as it is.
pub fn dd(value: f64) -> Dd {
    Dd { hi: value, lo: 0.0 }
}

/// |a| ≥ |b|, or nothing known about what is lost.
fn fast_two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    Dd { hi, lo: b - (hi - a) }
}

fn two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    let part = hi - a;
    Dd { hi, lo: (a - (hi - part)) + (b - part) }
}

fn split(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

fn two_product(a: f64, b: f64) -> Dd {
    let hi = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    Dd { hi, lo: ((ah * bh - hi) + ah * bl + al * bh) + al * bl }
}

impl Dd {
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };
    pub const PI: Self = Self { hi: std::f64::consts::PI, lo: 1.224_646_799_147_353_2e-16 };

    pub fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }

    pub fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    pub fn sqrt(self) -> Self {
        if self.hi <= 0.0 {
            return Self::ZERO;
        }
        let root = dd(self.hi.sqrt());
        root + (self - root * root) / dd(2.0 * root.hi)
    }

    pub fn cbrt(self) -> Self {
        if self.hi == 0.0 {
            return Self::ZERO;
        }
        let mut root = dd(self.hi.cbrt());
        for _ in 0..2 {
            root = root - (root * root * root - self) / dd(3.0 * root.hi * root.hi);
        }
        root
    }

    pub fn to_f64(self) -> f64 {
        self.hi
    }
}

impl Add for Dd {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let high = two_sum(self.hi, other.hi);
        let low = two_sum(self.lo, other.lo);
        let sum = fast_two_sum(high.hi, high.lo + low.hi);
        fast_two_sum(sum.hi, sum.lo + low.lo)
    }
}

impl Neg for Dd {
    type Output = Self;
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for Dd {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Dd {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = two_product(self.hi, other.hi);
        fast_two_sum(product.hi, product.lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

impl Div for Dd {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self - other * dd(first);
        let second = rest.hi / other.hi;
        let rest = rest - other * dd(second);
        fast_two_sum(first, second) + dd(rest.hi / other.hi)
    }
}
