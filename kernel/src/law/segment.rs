//! A ramp or a cruise made ready for the tick.
//!
//! Consumes a [`Ramp`] of any number type and the control tick; produces a [`FeedSegment`]: the feed stream's
//! item. All divisions and roots happen here, in the background, in f64. The tick is left with one
//! [`Shape`](super::shape::Shape) and a handful of products.
//!
//! **Time** is counted in ticks with 32 fractional bits, and the tick never divides by it: a phase adds up
//! the fraction of itself that passes per tick, with 64 fractional bits.
//!
//! **Position** in a rise is F₀·t and what its pulse has gained ([`TickPulse`]). All but a sine's small part is
//! fixed point times fractions, accurate to a few position steps and length·2⁻³² (1.9 nm over 8 m) in any
//! number type.

#[cfg(feature = "live")]
mod cut;
mod tick_pulse;

use serde::{Deserialize, Serialize};

use self::tick_pulse::TickPulse;
use super::ramp::Ramp;
use crate::num::{Real, Root, Unit, in_q32, is_within, of_q32, rolled, whole};
use crate::units::Position;

#[cfg(feature = "live")]
pub use cut::CutRamp;

/// A duration in control ticks, in steps of 2⁻³² tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ticks(u64);

impl Ticks {
    /// No time.
    pub const ZERO: Self = Self(0);
    /// One control tick.
    pub const ONE: Self = Self(1 << 32);
    /// The longest duration a segment or a dwell may have \[ticks\]: 2³¹, twelve days at 0.5 ms.
    pub const LIMIT: f64 = 2_147_483_648.0;

    /// The duration `seconds` at `tick_s` seconds a tick; `None` unless it is from 0 to
    /// [`Self::LIMIT`].
    #[must_use]
    pub fn from_seconds(seconds: f64, tick_s: f64) -> Option<Self> {
        let ticks = seconds / tick_s;
        is_within(ticks, 0.0, Self::LIMIT).then(|| Self(whole(in_q32(ticks) + 0.5)))
    }

    /// The duration in ticks.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        of_q32(self.0 as f64)
    }

    /// Sum; saturates at 2³² ticks.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// A duration of `bits` steps of 2⁻³² tick.
    #[doc(hidden)]
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The number of steps of 2⁻³² tick.
    #[doc(hidden)]
    #[must_use]
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// The rest of `self` after `other`, or `None` if `other` is longer.
    #[doc(hidden)]
    #[must_use]
    pub const fn minus(self, other: Self) -> Option<Self> {
        match self.0.checked_sub(other.0) {
            Some(left) => Some(Self(left)),
            None => None,
        }
    }
}

/// The parts of a segment, in order. A cruise has only a hold; a ramp that is cut early returns within its
/// hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// 0 … t₁: acceleration builds up.
    Rise,
    /// t₁ … t₂: constant acceleration, or cruise; in a cut ramp, from the cut to its mirror image.
    Hold,
    /// t₂ … t_p: acceleration falls back to 0.
    Fall,
}

/// The motion along the path in one tick; the position is counted from the stretch's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathMotion<R> {
    /// Path position.
    pub s: Position,
    /// Feed \[mm/s\].
    pub v_mm_s: R,
    /// Acceleration along the path \[mm/s²\].
    pub a_mm_s2: R,
    /// Jerk along the path \[mm/s³\].
    pub j_mm_s3: R,
    /// Snap along the path \[mm/s⁴\].
    pub snap_mm_s4: R,
}

/// Why a segment can't be made.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SegmentError {
    /// A quantity is not finite, below zero, or beyond the kernel's range.
    OutOfRange {
        /// The quantity, with its unit.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// The ramp's own length differs from the length of path it is to cover.
    LengthMismatch {
        /// (F₀+F)/2·t_p \[mm\].
        ramp_mm: f64,
        /// The length of path \[mm\].
        path_mm: f64,
    },
    /// The feed would change in no time.
    FeedStep {
        /// F₀ \[mm/s\].
        from_mm_s: f64,
        /// F \[mm/s\].
        to_mm_s: f64,
    },
}

impl core::fmt::Display for SegmentError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::OutOfRange { quantity, value } => write!(f, "{quantity} {value} is out of range"),
            Self::LengthMismatch { ramp_mm, path_mm } => {
                write!(f, "a ramp of {ramp_mm} mm over {path_mm} mm of path")
            }
            Self::FeedStep { from_mm_s, to_mm_s } => {
                write!(
                    f,
                    "a step of the feed from {from_mm_s} to {to_mm_s} mm/s: expected a rise that takes time"
                )
            }
        }
    }
}

impl core::error::Error for SegmentError {}

/// Turns ticks into the normalised time of a phase.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Clock {
    duration: Ticks,
    /// The fraction of the phase that passes in one tick, in 2⁻⁶⁴; for a phase shorter than a tick, the
    /// fraction that passes in 2⁻³² tick.
    step: u64,
}

/// 2⁶⁴, the last f64 below it, and 2⁹⁶.
const POWER_64: f64 = 18_446_744_073_709_551_616.0;
const LAST_BELOW: f64 = POWER_64.next_down();
const POWER_96: f64 = POWER_64 * 4_294_967_296.0;

impl Clock {
    #[inline(never)]
    fn new(duration: Ticks) -> Self {
        let step = match duration.0 {
            0 => 0,
            bits if bits > Ticks::ONE.0 => quotient(POWER_96, 0, bits),
            bits => quotient(POWER_64, u64::MAX, bits),
        };
        Self { duration, step }
    }

    /// The fraction of the phase that passes in `time` ≤ 1 tick; `time` is less than a tick in a phase that
    /// is not longer.
    #[inline]
    fn part(&self, time: Ticks, is_long: bool) -> u64 {
        if time == Ticks::ONE {
            self.step
        } else if is_long {
            multiply_q32(self.step, time.0)
        } else {
            self.step.wrapping_mul(time.0)
        }
    }
}

/// ⌊dividend/by⌋ for `by` ≤ 2⁶³ and a quotient of at most 2⁶⁴ − 1. The dividend is given as an f64 and as its lower 64 bits. Two
/// divisions of f64 take fewer instructions than 64 steps bit by bit.
fn quotient(about: f64, lower: u64, by: u64) -> u64 {
    /// What the first quotient leaves is above −2⁴⁶, of a dividend of up to 2⁹⁶.
    const NEGATIVE: u64 = (1_u64 << 46).wrapping_neg();
    let by_about = by as f64;
    let first = about / by_about;
    let first = if is_within(first, 0.0, LAST_BELOW) { whole(first) } else { u64::MAX };
    let left = lower.wrapping_sub(first.wrapping_mul(by));
    let is_negative = left >= NEGATIVE;
    let magnitude = if is_negative { left.wrapping_neg() } else { left };
    let second = whole(magnitude as f64 / by_about);
    let second = if is_negative { second.wrapping_neg() } else { second };
    let found = first.wrapping_add(second);
    // The last place.
    let left = lower.wrapping_sub(found.wrapping_mul(by));
    if left >= NEGATIVE { found.wrapping_sub(1) } else { found.wrapping_add(u64::from(left >= by)) }
}

/// a·b/2³² for b ≤ 2³².
#[inline]
const fn multiply_q32(a: u64, b: u64) -> u64 {
    (a >> 32).wrapping_mul(b).wrapping_add(((a & 0xFFFF_FFFF).wrapping_mul(b)) >> 32)
}

/// `length` times a fraction in 2⁻³²; two 32×32-bit products.
#[inline]
#[allow(clippy::cast_possible_wrap)]
const fn portion(length: i64, fraction: u32) -> i64 {
    let high = (length >> 32).wrapping_mul(fraction as i64);
    let low = ((length & 0xFFFF_FFFF) as u64).wrapping_mul(fraction as u64) >> 32;
    high.wrapping_add(low as i64)
}

/// The product of two fractions in 2⁻³², rounded up, because the fractions themselves were rounded down.
#[inline]
#[allow(clippy::cast_possible_truncation)]
const fn times(a: u32, b: u32) -> u32 {
    ((a as u64).wrapping_mul(b as u64).wrapping_add(0xFFFF_FFFF) >> 32) as u32
}

/// An item of the feed stream: a ramp or a cruise over a length of path. Immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedSegment<R> {
    length: Position,
    from_mm_s: R,
    to_mm_s: R,
    rise: Clock,
    hold: Clock,
    /// Where in the rise it is cut, counted from 1 downwards in 2⁻⁶⁴; 0 if it is not cut, see `cut`.
    #[cfg(feature = "live")]
    cut_at: u64,
    /// Where the closing edge of the first pulse begins: until then it is like a ramp that lasts longer.
    #[cfg(feature = "live")]
    closing_at: Ticks,
    /// F₀·P and −F·P less the pulse's bend, in position steps.
    rise_bits: i64,
    fall_bits: i64,
    pulse: TickPulse<R>,
    /// S(t₁), V(t₁)·(t₂−t₁) and A(t₁)·(t₂−t₁)²/2, in position steps.
    hold_start_bits: i64,
    hold_linear_bits: i64,
    hold_square_bits: i64,
    hold_v_mm_s: R,
    hold_a_mm_s2: R,
    hold_gain_mm_s: R,
}

/// Corruption of a segment in memory.
#[cfg(all(test, feature = "guards"))]
impl FeedSegment<f32> {
    /// Flips one bit of one of its figures.
    pub(crate) fn with_flipped_bit(mut self, bit: u32) -> Self {
        let wide = [
            &mut self.rise_bits,
            &mut self.fall_bits,
            &mut self.hold_start_bits,
            &mut self.hold_linear_bits,
            &mut self.hold_square_bits,
        ];
        let mut narrow = [&mut self.hold_v_mm_s, &mut self.hold_a_mm_s2, &mut self.hold_gain_mm_s];
        let figure = (bit >> 8) as usize;
        let figures = wide.len() + narrow.len() + 1 + TickPulse::<f32>::FIGURES;
        match figure % figures {
            figure @ 0..5 => *wide[figure] ^= 1 << (bit % 64),
            figure @ 5..8 => {
                let narrow = &mut narrow[figure - 5];
                **narrow = f32::from_bits(narrow.to_bits() ^ 1 << (bit % 32));
            }
            8 => self.length = Position::from_bits(self.length.to_bits() ^ 1 << (bit % 64)),
            figure => self.pulse.flip_bit(figure - 9, bit),
        }
        self
    }
}

/// Greatest difference between a ramp's own length and the path it covers \[mm\]: rounding of both ends to
/// position steps, and of the ramp's figures in f64 at a kilometre.
const LENGTH_TOLERANCE_MM: f64 = 1.0e-8;

/// How much longer than a pulse its two edges may be by rounding, as a part of it.
const ROUNDING_OF_EDGES: f64 = 1.0e-14;

impl<R: Real> FeedSegment<R> {
    /// A ramp over `length` of path, which must be its own length to 10⁻⁸ mm (rounding).
    ///
    /// # Errors
    /// A figure is not finite, negative or too large, the lengths differ, or the feed steps.
    #[doc(hidden)]
    pub fn ramp<P: Root>(ramp: &Ramp<P>, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        Self::new(&of_length(ramp, length)?, length, tick_s)
    }

    /// A cruise at `feed_mm_s` > 0 over `length` of path.
    ///
    /// # Errors
    /// A figure is not finite, the feed is not positive, or the duration is too long.
    #[doc(hidden)]
    pub fn cruise(feed_mm_s: f64, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        let ramp = Ramp::cruise(feed_mm_s, length.to_mm() / feed_mm_s);
        Self::new(&ramp, length, tick_s)
    }

    fn new(ramp: &Ramp<f64>, length: Position, tick_s: f64) -> Result<Self, SegmentError> {
        let Ramp { from_mm_s, to_mm_s, t1_s, t2_s, .. } = *ramp;
        let hold_s = t2_s - t1_s;
        // The first reason to refuse it. The computation still continues to its end: an early return at each
        // figure would take more flash than the computation.
        let mut refused = None;
        let [rise, hold] = check(&mut refused, ramp, length, tick_s, R::RAMP_MM_MAX).map(Clock::new);
        let feeds = made(
            &mut refused,
            &["entry feed [mm/s]", "exit feed [mm/s]"],
            [from_mm_s, to_mm_s],
            R::checked_from_f64,
        );
        let of_ramp = ramp.pulse();
        let end = of_ramp.end();
        let (pulse, bent_mm) = TickPulse::new(&mut refused, &of_ramp, &end);
        let (hold_v, hold_a) = (from_mm_s + end.v_mm_s, end.a_mm_s2);
        let lengths = &[
            "entry feed · t1 [mm]",
            "exit feed · t1 [mm]",
            "length of the rise [mm]",
            "feed · hold time [mm]",
            "length gained in the hold [mm]",
        ];
        let lengths_mm = [
            from_mm_s * t1_s - bent_mm,
            to_mm_s * t1_s + bent_mm,
            from_mm_s * t1_s + end.s_mm,
            hold_v * hold_s,
            0.5 * hold_a * hold_s * hold_s,
        ];
        let lengths = made(&mut refused, lengths, lengths_mm, Position::from_mm);
        let scales = &["feed at t1 [mm/s]", "acceleration at t1 [mm/s²]", "feed gained in the hold [mm/s]"];
        let figures = [hold_v, hold_a, hold_a * hold_s];
        let scales = made(&mut refused, scales, figures, R::checked_from_f64);
        let [rise_bits, fall_less_bits, hold_start_bits, hold_linear_bits, hold_square_bits] =
            lengths.map(Position::to_bits);
        let ([from_mm_s, to_mm_s], [hold_v_mm_s, hold_a_mm_s2, hold_gain_mm_s]) = (feeds, scales);
        if let Some(error) = refused {
            return Err(error);
        }
        Ok(Self {
            length,
            from_mm_s,
            to_mm_s,
            rise,
            hold,
            #[cfg(feature = "live")]
            cut_at: 0,
            #[cfg(feature = "live")]
            closing_at: Ticks::from_seconds(t1_s - ramp.edge_s, tick_s).unwrap_or_default(),
            rise_bits,
            fall_bits: -fall_less_bits,
            pulse,
            hold_start_bits,
            hold_linear_bits,
            hold_square_bits,
            hold_v_mm_s,
            hold_a_mm_s2,
            hold_gain_mm_s,
        })
    }

    /// The length of path it covers.
    #[doc(hidden)]
    pub fn length(&self) -> Position {
        self.length
    }

    /// The feed at its start \[mm/s\].
    #[doc(hidden)]
    pub fn from_mm_s(&self) -> R {
        self.from_mm_s
    }

    /// The feed at its end \[mm/s\].
    #[doc(hidden)]
    pub fn to_mm_s(&self) -> R {
        self.to_mm_s
    }

    /// Greatest |acceleration| inside \[mm/s²\].
    #[doc(hidden)]
    pub fn peak_accel_mm_s2(&self) -> R {
        self.hold_a_mm_s2.abs()
    }

    /// Greatest |jerk| inside \[mm/s³\]; of a cut ramp, that of the whole.
    pub(crate) fn peak_jerk_mm_s3(&self) -> R {
        self.pulse.jerk_mm_s3.abs()
    }

    /// Greatest |snap| inside \[mm/s⁴\]; of a cut ramp, that of the whole.
    pub(crate) fn peak_snap_mm_s4(&self) -> R {
        self.pulse.snap_mm_s4.abs()
    }

    /// How long it is like a ramp with the same first pulse that goes on: up to the closing edge or the cut.
    pub(crate) fn opens_for(&self) -> Ticks {
        #[cfg(feature = "live")]
        return self.closing_at;
        #[cfg(not(feature = "live"))]
        self.rise.duration
    }

    /// The whole duration.
    pub fn duration(&self) -> Ticks {
        self.rise.duration.plus(self.hold.duration).plus(self.rise.duration)
    }

    /// The duration of a phase; 0 for a phase that the segment does not have.
    #[doc(hidden)]
    #[inline]
    pub fn phase_duration(&self, phase: Phase) -> Ticks {
        self.clock(phase).duration
    }

    /// 0: only live control cuts ramps.
    #[inline]
    fn cut_at(&self) -> u64 {
        #[cfg(feature = "live")]
        return self.cut_at;
        #[cfg(not(feature = "live"))]
        0
    }

    /// The normalised time at the start of `phase`, in 2⁻⁶⁴.
    #[doc(hidden)]
    #[inline]
    pub fn fraction_at_start(&self, phase: Phase) -> u64 {
        match phase {
            Phase::Rise => 0,
            Phase::Hold | Phase::Fall => self.cut_at(),
        }
    }

    /// The normalised time of `phase` that passes in `time` ≤ 1 tick, in 2⁻⁶⁴. A whole tick is allowed only
    /// in longer phases.
    #[doc(hidden)]
    #[inline]
    pub fn fraction_in(&self, phase: Phase, time: Ticks) -> u64 {
        let clock = self.clock(phase);
        clock.part(time, clock.duration > Ticks::ONE || self.cut_at() != 0)
    }

    /// The normalised time `elapsed` after the start of `phase`, in 2⁻⁶⁴.
    pub(crate) fn fraction_after(&self, phase: Phase, elapsed: Ticks) -> u64 {
        let clock = self.clock(phase);
        let whole = clock.step.wrapping_mul(elapsed.0 >> 32);
        let part = Ticks(elapsed.0 & 0xFFFF_FFFF);
        self.fraction_at_start(phase).wrapping_add(whole).wrapping_add(self.fraction_in(phase, part))
    }

    #[inline]
    fn clock(&self, phase: Phase) -> &Clock {
        match phase {
            Phase::Rise | Phase::Fall => &self.rise,
            Phase::Hold => &self.hold,
        }
    }

    /// The motion at a normalised time of a phase; `s` counts from the segment's start and is never beyond
    /// its end. In the tick.
    #[doc(hidden)]
    #[inline(always)]
    pub fn at(&self, phase: Phase, fraction: u64) -> PathMotion<R> {
        let is_cut = phase == Phase::Hold && self.cut_at() != 0;
        if phase == Phase::Hold && !is_cut {
            let x = (fraction >> 32) as u32;
            let s = self
                .hold_start_bits
                .wrapping_add(portion(self.hold_linear_bits, x))
                // Multiplied twice: in a braking hold its error adds to that of twice the length.
                .wrapping_add(portion(portion(self.hold_square_bits, x), x));
            return PathMotion {
                s: Position::from_bits(s).min(self.length),
                v_mm_s: self.hold_v_mm_s + self.hold_gain_mm_s.scaled(R::Unit::from_fraction(fraction)),
                a_mm_s2: self.hold_a_mm_s2,
                j_mm_s3: R::ZERO,
                snap_mm_s4: R::ZERO,
            };
        }
        #[cfg(feature = "live")]
        if is_cut {
            return self.at_cut(fraction);
        }
        // The fall is the rise run backwards from the end: one evaluation of the pulse serves both.
        let falling = phase == Phase::Fall;
        let fraction = if falling { !fraction } else { fraction };
        let gained = self.pulse.at(fraction);
        let x = (fraction >> 32) as u32;
        let (s, v_mm_s, j_mm_s3) = if falling {
            let even = self.length.to_bits().wrapping_add(portion(self.fall_bits, x));
            (even, self.to_mm_s - gained.v_mm_s, -gained.j_mm_s3)
        } else {
            (portion(self.rise_bits, x), self.from_mm_s + gained.v_mm_s, gained.j_mm_s3)
        };
        PathMotion {
            s: Position::from_bits(s.wrapping_add(gained.s)).min(self.length),
            v_mm_s,
            a_mm_s2: gained.a_mm_s2,
            j_mm_s3,
            snap_mm_s4: gained.snap_mm_s4,
        }
    }
}

/// The ramp in f64, if its own length is `length` but for rounding.
pub(super) fn of_length<P: Root>(ramp: &Ramp<P>, length: Position) -> Result<Ramp<f64>, SegmentError> {
    let ramp = to_f64(ramp);
    let path_mm = length.to_mm();
    let ramp_mm = ramp.length_mm();
    // In a narrower planning type the ramp's figures carry that type's rounding.
    let size = P::from_f64(ramp_mm + ramp.from_mm_s + ramp.to_mm_s);
    let rounding = 16.0 * size.spacing().to_f64();
    if !(libm::fabs(ramp_mm - path_mm) <= LENGTH_TOLERANCE_MM + rounding) {
        return Err(SegmentError::LengthMismatch { ramp_mm, path_mm });
    }
    Ok(ramp)
}

/// The checks of a ramp over `length` for every number type; the first reason to refuse it is kept. Returns
/// the durations of rise and hold.
#[inline]
pub(super) fn check(
    refused: &mut Option<SegmentError>,
    ramp: &Ramp<f64>,
    length: Position,
    tick_s: f64,
    ramp_mm_max: f64,
) -> [Ticks; 2] {
    let Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, .. } = *ramp;
    let hold_s = t2_s - t1_s;
    made(
        refused,
        &[
            "entry feed [mm/s]",
            "exit feed [mm/s]",
            "peak jerk [mm/s³]",
            "length [mm]",
            "edge [s]",
            "t1 [s]",
            "t1 − edges [s]",
            "t2 − t1 [s]",
            "tick [s]",
        ],
        [
            from_mm_s,
            to_mm_s,
            peak_jerk_mm_s3,
            length.to_mm(),
            edge_s,
            t1_s,
            ramp.plateau_s() + ROUNDING_OF_EDGES * t1_s,
            hold_s,
            tick_s,
        ],
        // 0 ≤ value ≤ MAX by its bits, −0 included: NaN and negative numbers have greater bits. Any type will do for the result;
        // the type of lengths needs no extra function in the image.
        |value| {
            let bits = value.to_bits();
            (bits <= f64::MAX.to_bits() || bits << 1 == 0).then_some(Position::ZERO)
        },
    );
    if t1_s <= 0.0 && from_mm_s != to_mm_s {
        refused.get_or_insert(SegmentError::FeedStep { from_mm_s, to_mm_s });
    }
    let mut ticks = |quantity, value| {
        Ticks::from_seconds(value, tick_s).unwrap_or_else(|| {
            refused.get_or_insert(SegmentError::OutOfRange { quantity, value });
            Ticks::ZERO
        })
    };
    let phases = [ticks("t1 [s]", t1_s), ticks("t2 − t1 [s]", hold_s)];
    let arch_s = edge_s + edge_s;
    let value = peak_jerk_mm_s3 * arch_s * arch_s * arch_s;
    if !(value <= ramp_mm_max) {
        refused.get_or_insert(SegmentError::OutOfRange { quantity: "jerk · (2·edge)³ [mm]", value });
    }
    phases
}

/// Converts each of `values` by `make`; the first that can't be converted is refused by name.
fn made<T: Copy + Default, const N: usize>(
    refused: &mut Option<SegmentError>,
    quantities: &[&'static str; N],
    values: [f64; N],
    make: fn(f64) -> Option<T>,
) -> [T; N] {
    let mut made = [T::default(); N];
    make_each(refused, quantities, &values, make, &mut made);
    made
}

#[inline(never)]
fn make_each<T>(
    refused: &mut Option<SegmentError>,
    quantities: &[&'static str],
    values: &[f64],
    make: fn(f64) -> Option<T>,
    places: &mut [T],
) {
    let (quantities, values, places) = rolled((quantities, values, places));
    for ((place, &value), &quantity) in places.iter_mut().zip(values).zip(quantities) {
        match make(value) {
            Some(made) => *place = made,
            None => {
                refused.get_or_insert(SegmentError::OutOfRange { quantity, value });
            }
        }
    }
}

/// The ramp in f64. Its peak jerk is recomputed from its feeds and times, |F − F₀|/(t₂·(t₁ − e)): the
/// rounding of `P` in the original would be a step of the feed in the middle.
pub(crate) fn to_f64<P: Root>(ramp: &Ramp<P>) -> Ramp<f64> {
    let [from_mm_s, to_mm_s, edge_s, t1_s, t2_s] =
        [ramp.from_mm_s, ramp.to_mm_s, ramp.edge_s, ramp.t1_s, ramp.t2_s].map(|value| value.to_f64());
    let change = libm::fabs(to_mm_s - from_mm_s);
    let peak_jerk_mm_s3 =
        if t1_s > 0.0 { change / t2_s / (t1_s - edge_s) } else { ramp.peak_jerk_mm_s3.to_f64() };
    Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, limited_by: ramp.limited_by }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Against 128 bits: clocks of phases from 2⁻³² ticks to 2³¹.
    #[test]
    fn a_clocks_step_is_the_quotient() {
        let random = Random::new(11);
        for index in 0..200_000_u32 {
            let any = random.next() >> (1 + index % 63);
            let power = 1_u64 << (index % 64);
            for bits in [any.max(1), power, power.saturating_sub(1).max(1)] {
                let bits = bits.min(1 << 63);
                let by = u128::from(bits);
                let expected = if bits > 1 << 32 { (1_u128 << 96) / by } else { u128::from(u64::MAX) / by };
                assert_eq!(u128::from(Clock::new(Ticks(bits)).step), expected, "{bits}");
            }
        }
        assert_eq!(Clock::new(Ticks::ZERO).step, 0);
    }

    #[test]
    fn ticks_to_f64_is_rounded_once() {
        let random = Random::new(13);
        for index in 0..200_000_u32 {
            let bits = random.next() >> (index % 64);
            assert_eq!(Ticks(bits).to_f64(), bits as f64 / 4_294_967_296.0, "{bits}");
        }
    }

    /// Of several reasons the first is told, in the order of the figures.
    #[test]
    fn the_first_reason_is_told() {
        let length = Position::from_mm(1.0).expect("in range");
        let refusal = |ramp: Ramp<f64>, tick_s| match FeedSegment::<f32>::new(&ramp, length, tick_s) {
            Err(SegmentError::OutOfRange { quantity, value }) => (quantity, value),
            other => panic!("{other:?}"),
        };
        let good = Ramp::cruise(10.0, 0.1);
        assert!(FeedSegment::<f32>::new(&good, length, 5e-4).is_ok());
        assert_eq!(refusal(Ramp { from_mm_s: -1.0, t2_s: -2.0, ..good }, 0.0), ("entry feed [mm/s]", -1.0));
        assert_eq!(refusal(Ramp { t2_s: -2.0, ..good }, -1.0), ("t2 − t1 [s]", -2.0));
        assert_eq!(refusal(good, -1.0), ("tick [s]", -1.0));
        assert_eq!(refusal(Ramp { t2_s: 1e9, ..good }, 1e-4), ("t2 − t1 [s]", 1e9));
        assert_eq!(
            refusal(Ramp { from_mm_s: 1e300, to_mm_s: 1e300, ..good }, 5e-4),
            ("entry feed [mm/s]", 1e300)
        );
        assert_eq!(refusal(Ramp { t2_s: 1e6, ..good }, 1e-2), ("feed · hold time [mm]", 1e7));
        // A pulse without edges, and one that is too long for its edges.
        let rise = Ramp { to_mm_s: 11.0, peak_jerk_mm_s3: 1e3, t1_s: 0.05, t2_s: 0.05, ..good };
        assert_eq!(refusal(rise, 5e-4), ("t1 / edges", f64::INFINITY));
        assert_eq!(refusal(Ramp { edge_s: 5e-301, ..rise }, 5e-4), ("t1 / edges", 5e298));
        let step = Ramp { to_mm_s: 11.0, ..good };
        let error = FeedSegment::<f32>::new(&step, length, 5e-4);
        assert_eq!(error, Err(SegmentError::FeedStep { from_mm_s: 10.0, to_mm_s: 11.0 }));
    }
}
