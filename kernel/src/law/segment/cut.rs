//! A ramp that is cut while its acceleration still rises: the jerk returns the way it came.
//!
//! Consumes a ramp under way and where in its rise it is cut; produces a [`FeedSegment`] with the same rise
//! up to there, but for rounding. With z = t/2e and a cut in the opening edge, at z₁ ≤ 1/2, the jerk
//! Jp·sin²πz runs up to z₁ and back to 0, and then the same mirrored: the change of feed is symmetric about
//! its middle like any ramp's and takes four times the time to the cut. It keeps the ramp's limits, because
//! jerk and snap only take values that they have in the ramp. Snap steps at the cut and at its mirror image.
//!
//! Between the cut and its image one expression holds, about the middle, where acceleration is greatest. With
//! u the time from the middle as a fraction of t₁, and V, A and S the feed, acceleration and position in the
//! middle,
//!
//! ```text
//! s = S + V·u·t₁ + A·(u·t₁)²/2 − Jp·(2e)³·(z³/12 − z/(8π²) + sin 2πz/(16π³)),  z = |u|·t₁/2e
//! ```
//!
//! and its derivatives. Construction in the background, evaluation in the tick.

use core::f64::consts::PI;

use super::{Clock, FeedSegment, PathMotion, SegmentError, Ticks, portion, times};
use crate::law::ramp::Ramp;
use crate::num::{Real, Unit};
use crate::units::Position;

/// A ramp that is cut `cut_s` into its rise, inside its opening edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutRamp {
    /// The ramp as it was begun.
    pub ramp: Ramp<f64>,
    /// When it is cut \[s\].
    pub cut_s: f64,
}

/// What a cut ramp comes to. All of it comes from what the pulse has gained by the cut, and that takes a while.
struct Cut {
    /// The greatest acceleration, in the middle, with the sign of the change of feed \[mm/s²\].
    peak_accel_mm_s2: f64,
    /// The feed at its end \[mm/s\].
    to_mm_s: f64,
    /// Its length \[mm\].
    length_mm: f64,
    /// Its length up to the middle \[mm\].
    middle_mm: f64,
}

impl CutRamp {
    fn cut(&self) -> Cut {
        let &Self { ramp, cut_s } = self;
        let gained = ramp.pulse().at(cut_s);
        let peak_accel_mm_s2 = 2.0 * gained.a_mm_s2;
        let to_mm_s = ramp.from_mm_s + 2.0 * cut_s * peak_accel_mm_s2;
        let cut_mm = ramp.from_mm_s * cut_s + gained.s_mm;
        Cut {
            peak_accel_mm_s2,
            to_mm_s,
            length_mm: 0.5 * (ramp.from_mm_s + to_mm_s) * self.duration_s(),
            middle_mm: 2.0 * cut_mm + 0.5 * peak_accel_mm_s2 * cut_s * cut_s,
        }
    }

    /// The feed at its end \[mm/s\].
    #[must_use]
    pub fn to_mm_s(&self) -> f64 {
        self.cut().to_mm_s
    }

    /// Its duration \[s\].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        4.0 * self.cut_s
    }

    /// Its length \[mm\].
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.cut().length_mm
    }
}

/// Error of the time of a cut, half a step of time \[ticks\].
const ROUNDING_TICKS: f64 = 1.0 / 4_294_967_296.0;

impl<R: Real> FeedSegment<R> {
    /// A ramp that is cut `cut_at` after its start, over `length` of path, which must be its own length to
    /// 10⁻⁸ mm.
    ///
    /// # Errors
    /// The ramp is not cut in its opening edge, or rises in less than a tick; a figure is not
    /// finite or too large; the lengths differ.
    #[doc(hidden)]
    pub fn cut(ramp: &Ramp<f64>, cut_at: Ticks, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        // As for the whole ramp: rounding here would be a step there.
        let ramp = &super::to_f64(ramp);
        let cut_s = cut_at.to_f64() * tick_s;
        let rise_ticks = ramp.t1_s / tick_s;
        let edge_ticks = ramp.edge_s / tick_s;
        if !(cut_s > 0.0 && cut_at.to_f64() <= edge_ticks + ROUNDING_TICKS && rise_ticks > 1.0) {
            return Err(SegmentError::OutOfRange { quantity: "cut in the rise [s]", value: cut_s });
        }
        let Cut { peak_accel_mm_s2: peak, to_mm_s, length_mm: ramp_mm, middle_mm } =
            CutRamp { ramp: *ramp, cut_s }.cut();
        let path_mm = length.to_mm();
        if !(libm::fabs(ramp_mm - path_mm) <= super::LENGTH_TOLERANCE_MM) {
            return Err(SegmentError::LengthMismatch { ramp_mm, path_mm });
        }
        // Computed in the same way as for the whole ramp: the rise must be equal to the bit.
        let whole_mm = Position::from_mm(ramp.length_mm())
            .ok_or(SegmentError::OutOfRange { quantity: "length [mm]", value: ramp.length_mm() })?;
        let mut segment = Self::new(ramp, whole_mm, tick_s)?;
        let bits = |quantity, mm: f64| {
            Position::from_mm(mm)
                .map(Position::to_bits)
                .ok_or(SegmentError::OutOfRange { quantity, value: mm })
        };
        let real = |quantity, value: f64| {
            R::checked_from_f64(value).ok_or(SegmentError::OutOfRange { quantity, value })
        };
        let t1_s = ramp.t1_s;
        let middle_mm_s = ramp.from_mm_s + peak * cut_s;
        let step = segment.rise.step;
        // x₁ as the tick counts it, in steps.
        let cut_part = (u128::from(step) * u128::from(cut_at.0)) >> 32;
        segment.cut_at = (cut_part as u64).wrapping_neg();
        segment.rise.duration = cut_at;
        segment.hold = Clock { duration: cut_at.plus(cut_at), step };
        segment.length = length;
        segment.closing_at = cut_at;
        segment.to_mm_s = real("exit feed [mm/s]", to_mm_s)?;
        // The rise's own is F₀·P less the bend.
        let bent_mm = ramp.from_mm_s * t1_s - Position::from_bits(segment.rise_bits).to_mm();
        segment.fall_bits = bits("exit feed · t1 [mm]", -to_mm_s * t1_s - bent_mm)?;
        segment.hold_start_bits = bits("length of the rise [mm]", middle_mm)?;
        segment.hold_linear_bits = bits("feed · t1 [mm]", middle_mm_s * t1_s)?;
        segment.hold_square_bits = bits("acceleration · t1² [mm]", 0.5 * peak * t1_s * t1_s)?;
        segment.hold_v_mm_s = real("feed in the middle [mm/s]", middle_mm_s)?;
        segment.hold_a_mm_s2 = real("acceleration in the middle [mm/s²]", peak)?;
        segment.hold_gain_mm_s = real("acceleration · t1 [mm/s]", peak * t1_s)?;
        Ok(segment)
    }

    /// The motion between the cut and its image, at the fraction of t₁ from the middle in 2⁻⁶⁴. In the tick.
    #[cold]
    #[inline(never)]
    pub(super) fn at_cut(&self, fraction: u64) -> PathMotion<R> {
        /// 12/(8π²), in 2⁻³².
        const LINEAR: u32 = (12.0 / (8.0 * PI * PI) * 4_294_967_296.0) as u32;
        let before = fraction.cast_signed() < 0;
        let fraction = if before { fraction.wrapping_neg() } else { fraction };
        let (unit, x) = (R::Unit::from_fraction(fraction), (fraction >> 32) as u32);
        let z = self.pulse.in_arch(fraction);
        let rise = self.pulse.opened(z);
        let bent = rise.s.wrapping_sub(portion(portion(self.pulse.cube_bits(), LINEAR), (z >> 32) as u32));
        let even = portion(self.hold_linear_bits, x);
        let gained = self.hold_gain_mm_s.scaled(unit) - rise.v_mm_s;
        let (even, v_mm_s, j_mm_s3) = if before {
            (even.wrapping_neg(), self.hold_v_mm_s - gained, rise.j_mm_s3)
        } else {
            (even, self.hold_v_mm_s + gained, -rise.j_mm_s3)
        };
        let square = portion(self.hold_square_bits, times(x, x));
        let middle = self.hold_start_bits.wrapping_add(even).wrapping_add(square);
        PathMotion {
            s: Position::from_bits(middle.wrapping_sub(bent)).min(self.length),
            v_mm_s,
            a_mm_s2: self.hold_a_mm_s2 - rise.a_mm_s2,
            j_mm_s3,
            snap_mm_s4: -rise.snap_mm_s4,
        }
    }
}
