//! A correction of a stretch: velocity commands learnt from earlier runs of the same path.
//!
//! Made in the background from the following error of a run, added to feedforward in the tick. A correction
//! belongs to one stretch and to the time within it: it begins with the stretch's first tick and is 0 before,
//! after, and beyond its last knot. Its values are bounded when it is made.

use crate::num::Real;

/// Greatest number of ticks between knots.
pub const KNOT_TICKS_MAX: u16 = 1000;

/// Velocity commands over the time in a stretch, interpolated linearly between knots.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, R, const AXES: usize> {
    knots_mm_s: &'a [[R; AXES]],
    knot_ticks: u16,
    /// 1/`knot_ticks`.
    per_knot: R,
    stretch: u32,
    /// Where in the stretch the machine is: the knot passed, and the ticks since.
    knot: usize,
    ticks: u16,
}

/// Why a correction can't be used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CorrectionError {
    /// A knot is not a number or beyond the bound.
    OutOfBound {
        /// The knot, from 0.
        knot: usize,
        /// The axis, from 0.
        axis: usize,
    },
    /// From 1 to [`KNOT_TICKS_MAX`] ticks are allowed from knot to knot.
    KnotTicks {
        /// The number given.
        found: u16,
    },
    /// The bound is not positive, or beyond the kernel's range.
    Bound,
    /// Live control is on: a correction belongs to the times of the program's own plan.
    LiveControl,
}

impl core::fmt::Display for CorrectionError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::OutOfBound { knot, axis } => write!(f, "knot {knot} of axis {axis} is beyond the bound"),
            Self::KnotTicks { found } => {
                write!(f, "{found} ticks from knot to knot: expected 1 to {KNOT_TICKS_MAX}")
            }
            Self::Bound => write!(f, "a bound that is not above 0 and below 1e6 mm/s"),
            Self::LiveControl => {
                write!(
                    f,
                    "a correction under live control: expected the program's own plan, whose times it is for"
                )
            }
        }
    }
}

impl core::error::Error for CorrectionError {}

impl<'a, R: Real, const AXES: usize> Correction<'a, R, AXES> {
    /// A correction for the stretch that begins after `stretch` others have ended: a knot every `knot_ticks`
    /// ticks, the first at the stretch's first tick, none greater than `bound_mm_s` in magnitude. Background.
    ///
    /// # Errors
    /// A knot, their distance or the bound is out of range.
    pub fn new(
        stretch: u32,
        knots_mm_s: &'a [[R; AXES]],
        knot_ticks: u16,
        bound_mm_s: f64,
    ) -> Result<Self, CorrectionError> {
        if !(1..=KNOT_TICKS_MAX).contains(&knot_ticks) {
            return Err(CorrectionError::KnotTicks { found: knot_ticks });
        }
        let bound = R::checked_from_f64(bound_mm_s)
            .filter(|_| bound_mm_s > 0.0 && bound_mm_s < 1e6)
            .ok_or(CorrectionError::Bound)?;
        for (knot, values) in knots_mm_s.iter().enumerate() {
            // Written so that NaN is out of bound.
            if let Some(axis) = values.iter().position(|value| !(value.abs() <= bound)) {
                return Err(CorrectionError::OutOfBound { knot, axis });
            }
        }
        let per_knot = R::from_f64(1.0 / f64::from(knot_ticks));
        Ok(Self { knots_mm_s, knot_ticks, per_knot, stretch, knot: 0, ticks: 0 })
    }

    /// The correction for the next tick, in which motion is in stretch `stretch` or in none.
    pub(crate) fn next(&mut self, stretch: Option<u32>) -> [R; AXES] {
        if stretch != Some(self.stretch) {
            return [R::ZERO; AXES];
        }
        let (Some(from), to) = (self.knots_mm_s.get(self.knot), self.knots_mm_s.get(self.knot + 1)) else {
            return [R::ZERO; AXES];
        };
        let mut correction = *from;
        if let Some(to) = to {
            let part = R::from_q32(i64::from(self.ticks) << 32) * self.per_knot;
            for (value, &to) in correction.iter_mut().zip(to) {
                *value = *value + (to - *value) * part;
            }
        }
        self.ticks += 1;
        if self.ticks == self.knot_ticks {
            (self.knot, self.ticks) = (self.knot + 1, 0);
        }
        correction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_straight_between_knots_and_nothing_elsewhere() {
        let knots = [[1.0, -2.0], [3.0, 2.0], [0.5, 0.0]];
        let mut correction = Correction::<f64, 2>::new(7, &knots, 4, 3.0).unwrap();
        assert_eq!(correction.next(Some(6)), [0.0; 2]);
        assert_eq!(correction.next(None), [0.0; 2]);
        let first: [f64; 10] = core::array::from_fn(|_| correction.next(Some(7))[0]);
        assert_eq!(first, [1.0, 1.5, 2.0, 2.5, 3.0, 2.375, 1.75, 1.125, 0.5, 0.5]);
        assert_eq!(correction.next(Some(8)), [0.0; 2]);
        for _ in 0..20 {
            correction.next(Some(7));
        }
        assert_eq!(correction.next(Some(7)), [0.0; 2]);
    }

    #[test]
    fn refuses_what_is_out_of_bound() {
        let new =
            |knot: f64, ticks, bound| Correction::<f64, 1>::new(0, &[[0.0], [knot]], ticks, bound).err();
        assert_eq!(new(1.0, 1, 1.0), None);
        for knot in [1.001, -1.001, f64::NAN, f64::INFINITY] {
            assert_eq!(new(knot, 1, 1.0), Some(CorrectionError::OutOfBound { knot: 1, axis: 0 }));
        }
        assert_eq!(new(0.0, 0, 1.0), Some(CorrectionError::KnotTicks { found: 0 }));
        assert_eq!(new(0.0, 1001, 1.0), Some(CorrectionError::KnotTicks { found: 1001 }));
        for bound in [0.0, -1.0, f64::NAN, 1e6] {
            assert_eq!(new(0.0, 1, bound), Some(CorrectionError::Bound));
        }
    }
}
