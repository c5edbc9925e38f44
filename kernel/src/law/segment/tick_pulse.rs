//! A pulse of jerk made ready for the tick.
//!
//! Consumes a ramp's first pulse in f64; produces a [`TickPulse`]: what the pulse has gained by any fraction
//! x of its length, in products alone. The parts of a pulse are found by their fraction, so a rise stays one
//! phase with one clock, however many parts end in a tick.
//!
//! **Edges.** With z = k·x, k = P/2e, an opening edge is the first half of an arch of length 2e:
//!
//! ```text
//! length = Jp·(2e)³·(z³/12 − z/(8π²) + sin 2πz/(16π³))
//! ```
//!
//! The first term is fixed point times fractions, the second is a part of the segment's linear term, and the
//! sine's, a five-hundredth of Jp·(2e)³, is a `Real`. A closing edge is the same run backwards from the
//! pulse's end, so both have the full relative precision at their ends.
//!
//! **The plateau** is a cubic, in fixed point.
//!
//! k has 32 fractional bits, and 32 more in number types that resolve them.

use core::f64::consts::PI;

use super::{SegmentError, made, portion, times};
use crate::law::pulse::JerkPulse;
use crate::law::ramp::FeedState;
use crate::law::shape::Shape;
use crate::num::{Real, Unit, in_q32, is_within, whole};
use crate::units::Position;

/// One, in 32 fractional bits.
const ONE: u64 = 1 << 32;

/// Greatest k: a plateau two thousand million times as long as its edges.
const MOST_ARCHES: f64 = 1.0e9;

/// One pulse; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TickPulse<R> {
    /// k = P/2e in 2⁻³², at least 1, and what it lacks, in 2⁻⁶⁴.
    arches: u64,
    arches_low: u64,
    /// The fraction of the pulse that an edge takes, in 2⁻⁶⁴: at most 1/2.
    edge: u64,
    /// Jp·(2e)³/12, in position steps.
    cube_bits: i64,
    /// Length at the start of the plateau, the feed there times P, half the acceleration times P² and
    /// Jp·P³/6.
    plateau_bits: [i64; 4],
    /// Length at the pulse's end, the feed there times P and half the acceleration times P².
    closing_bits: [i64; 3],
    /// ±Jp times 1, 2e, (2e)², (2e)³/(16π³) and π/2e: the scales of [`Shape`].
    pub(super) jerk_mm_s3: R,
    accel_mm_s2: R,
    speed_mm_s: R,
    sine_mm: R,
    pub(super) snap_mm_s4: R,
    /// At the start of the plateau: feed, acceleration, the latter times P; and Jp times P and P²/2.
    plateau_v_mm_s: R,
    plateau_a_mm_s2: R,
    plateau_gain_mm_s: R,
    plateau_rise_mm_s2: R,
    plateau_bend_mm_s: R,
    /// At the pulse's end: feed, acceleration, and the latter times P.
    end_v_mm_s: R,
    end_a_mm_s2: R,
    end_gain_mm_s: R,
}

/// What a pulse has gained.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gained<R> {
    /// Without the segment's linear term.
    pub(super) s: i64,
    pub(super) v_mm_s: R,
    pub(super) a_mm_s2: R,
    pub(super) j_mm_s3: R,
    pub(super) snap_mm_s4: R,
}

impl<R: Real> TickPulse<R> {
    /// No pulse.
    const NONE: Self = Self {
        arches: ONE,
        arches_low: 0,
        edge: 1 << 63,
        cube_bits: 0,
        plateau_bits: [0; 4],
        closing_bits: [0; 3],
        jerk_mm_s3: R::ZERO,
        accel_mm_s2: R::ZERO,
        speed_mm_s: R::ZERO,
        sine_mm: R::ZERO,
        snap_mm_s4: R::ZERO,
        plateau_v_mm_s: R::ZERO,
        plateau_a_mm_s2: R::ZERO,
        plateau_gain_mm_s: R::ZERO,
        plateau_rise_mm_s2: R::ZERO,
        plateau_bend_mm_s: R::ZERO,
        end_v_mm_s: R::ZERO,
        end_a_mm_s2: R::ZERO,
        end_gain_mm_s: R::ZERO,
    };

    /// `pulse`, which has gained `end` by its end, and its bend Jp·(2e)²·P/(8π²) \[mm\], which a segment's linear
    /// term lacks in a rise. The first reason to refuse it is kept.
    #[inline(never)]
    pub(super) fn new(
        refused: &mut Option<SegmentError>,
        pulse: &JerkPulse<f64>,
        end: &FeedState<f64>,
    ) -> (Self, f64) {
        let &JerkPulse { jerk_mm_s3: jerk, edge_s, duration_s: pulse_s } = pulse;
        if !(pulse_s > 0.0) {
            return (Self::NONE, 0.0);
        }
        let arch_s = edge_s + edge_s;
        let arches = pulse_s / arch_s;
        // A pulse may be shorter than its edges by rounding.
        let is_held = is_within(arches, 0.0, MOST_ARCHES);
        if !is_held {
            refused.get_or_insert(SegmentError::OutOfRange { quantity: "t1 / edges", value: arches });
        }
        let steps = if is_held && arches > 1.0 { in_q32(arches) } else { ONE as f64 };
        let arches = whole(steps);
        let arches_low = whole(in_q32(steps - arches as f64));
        let edge = if arches > ONE { whole(in_q32(in_q32(ONE as f64 / (steps + steps)))) } else { 1 << 63 };
        let snap = PI * jerk / arch_s;
        let accel = jerk * arch_s;
        let speed = accel * arch_s;
        let length = speed * arch_s;
        let middle = Shape::<f64>::middle();
        let (edge_a, edge_v, edge_mm) = (accel * middle.accel, speed * middle.speed, length * middle.length);
        let &FeedState { s_mm: end_mm, v_mm_s: end_v, a_mm_s2: end_a, .. } = end;
        let bent_mm = speed * pulse_s / (8.0 * PI * PI);
        let square_s2 = pulse_s * pulse_s;
        // The segment's linear term lacks the bend, which is an edge's alone.
        // Without a plateau its figures are not used, so they can't be a reason to refuse it.
        let of_plateau = |value| if arches > ONE { value } else { 0.0 };
        let plateau_mm = edge_mm + bent_mm * (edge_s / pulse_s);
        let lengths_mm = [
            length / 12.0,
            of_plateau(plateau_mm),
            of_plateau(edge_v * pulse_s + bent_mm),
            of_plateau(0.5 * edge_a * square_s2),
            of_plateau(jerk * square_s2 * pulse_s / 6.0),
            end_mm + bent_mm,
            end_v * pulse_s,
            0.5 * end_a * square_s2,
        ];
        let of_lengths = &[
            "jerk · edge³ [mm]",
            "length of an edge [mm]",
            "feed gained in an edge · t1 [mm]",
            "acceleration gained in an edge · t1² [mm]",
            "jerk · t1³ [mm]",
            "length gained by t1 [mm]",
            "feed gained by t1 · t1 [mm]",
            "acceleration gained by t1 · t1² [mm]",
        ];
        let lengths = made(refused, of_lengths, lengths_mm, Position::from_mm).map(Position::to_bits);
        let [cube_bits, plateau_0, plateau_1, plateau_2, plateau_3, end_0, end_1, end_2] = lengths;
        let of_scales = &[
            "peak jerk [mm/s³]",
            "jerk · edge [mm/s²]",
            "jerk · edge² [mm/s]",
            "jerk · edge³ [mm]",
            "peak snap [mm/s⁴]",
            "feed gained in an edge [mm/s]",
            "acceleration gained in an edge [mm/s²]",
            "acceleration gained in an edge · t1 [mm/s]",
            "jerk · t1 [mm/s²]",
            "jerk · t1² [mm/s]",
            "feed gained by t1 [mm/s]",
            "acceleration at t1 [mm/s²]",
            "acceleration at t1 · t1 [mm/s]",
        ];
        let scales = [
            jerk,
            accel,
            speed,
            length / (16.0 * PI * PI * PI),
            snap,
            edge_v,
            edge_a,
            of_plateau(edge_a * pulse_s),
            of_plateau(jerk * pulse_s),
            of_plateau(0.5 * jerk * square_s2),
            end_v,
            end_a,
            end_a * pulse_s,
        ];
        // A value that a narrow type can't hold must be refused here, not overflow in a tick.
        let scales = made(refused, of_scales, scales, R::checked_from_f64);
        let [
            jerk_mm_s3,
            accel_mm_s2,
            speed_mm_s,
            sine_mm,
            snap_mm_s4,
            plateau_v_mm_s,
            plateau_a_mm_s2,
            plateau_gain_mm_s,
            plateau_rise_mm_s2,
            plateau_bend_mm_s,
            end_v_mm_s,
            end_a_mm_s2,
            end_gain_mm_s,
        ] = scales;
        let ready = Self {
            arches,
            arches_low,
            edge,
            cube_bits,
            plateau_bits: [plateau_0, plateau_1, plateau_2, plateau_3],
            closing_bits: [end_0, end_1, end_2],
            jerk_mm_s3,
            accel_mm_s2,
            speed_mm_s,
            sine_mm,
            snap_mm_s4,
            plateau_v_mm_s,
            plateau_a_mm_s2,
            plateau_gain_mm_s,
            plateau_rise_mm_s2,
            plateau_bend_mm_s,
            end_v_mm_s,
            end_a_mm_s2,
            end_gain_mm_s,
        };
        (ready, bent_mm)
    }

    /// Jp·(2e)³/12, in position steps.
    #[cfg(feature = "live")]
    pub(super) fn cube_bits(&self) -> i64 {
        self.cube_bits
    }

    /// The fraction of an arch, in 2⁻⁶⁴, at the fraction of the pulse, both at most 1/2 and inside an edge.
    #[inline]
    pub(super) fn in_arch(&self, fraction: u64) -> u64 {
        let (high, low) = (fraction >> 32, fraction & 0xFFFF_FFFF);
        let (whole, part) = (self.arches >> 32, self.arches & 0xFFFF_FFFF);
        let arches = high
            .wrapping_mul(part)
            .wrapping_add(low.wrapping_mul(whole))
            .wrapping_add(low.wrapping_mul(part) >> 32)
            .wrapping_add(high.wrapping_mul(whole) << 32);
        // Known when this is compiled.
        if R::EPSILON < 1.0e-10 {
            arches.wrapping_add(high.wrapping_mul(self.arches_low) >> 32)
        } else {
            arches
        }
    }

    /// What an opening edge has gained at the fraction `z` of its arch.
    #[inline(always)]
    pub(super) fn opened(&self, z: u64) -> Gained<R> {
        let shape = Shape::at_edge(R::Unit::from_fraction(z));
        let z = (z >> 32) as u32;
        let cube = portion(self.cube_bits, times(times(z, z), z));
        Gained {
            s: cube.wrapping_add(Position::from_offset(self.sine_mm.scaled(shape.snap)).to_bits()),
            v_mm_s: self.speed_mm_s.scaled(shape.speed),
            a_mm_s2: self.accel_mm_s2.scaled(shape.accel),
            j_mm_s3: self.jerk_mm_s3.scaled(shape.jerk),
            snap_mm_s4: self.snap_mm_s4.scaled(shape.snap),
        }
    }

    /// What it has gained at a fraction of its length, in 2⁻⁶⁴.
    #[inline(always)]
    pub(super) fn at(&self, fraction: u64) -> Gained<R> {
        // The half of the pulse is the highest bit.
        let is_opening = fraction.cast_signed() >= 0;
        let near = if is_opening { fraction } else { !fraction };
        if near >= self.edge {
            return self.on_plateau(fraction.wrapping_sub(self.edge));
        }
        let edge = self.opened(self.in_arch(near));
        if is_opening {
            return edge;
        }
        let x = (near >> 32) as u32;
        let [end, linear, square] = self.closing_bits;
        let s = end.wrapping_sub(portion(linear.wrapping_sub(portion(square, x)), x)).wrapping_sub(edge.s);
        let unit = R::Unit::from_fraction(near);
        Gained {
            s,
            v_mm_s: self.end_v_mm_s - self.end_gain_mm_s.scaled(unit) + edge.v_mm_s,
            a_mm_s2: self.end_a_mm_s2 - edge.a_mm_s2,
            j_mm_s3: edge.j_mm_s3,
            snap_mm_s4: -edge.snap_mm_s4,
        }
    }

    /// What it has gained a fraction of its length after the plateau's start.
    #[inline(always)]
    fn on_plateau(&self, after: u64) -> Gained<R> {
        let [start, linear, square, cube] = self.plateau_bits;
        let x = (after >> 32) as u32;
        let bend = square.wrapping_add(portion(cube, x));
        let s = start.wrapping_add(portion(linear.wrapping_add(portion(bend, x)), x));
        let unit = R::Unit::from_fraction(after);
        let slope_mm_s = self.plateau_gain_mm_s + self.plateau_bend_mm_s.scaled(unit);
        Gained {
            s,
            v_mm_s: self.plateau_v_mm_s + slope_mm_s.scaled(unit),
            a_mm_s2: self.plateau_a_mm_s2 + self.plateau_rise_mm_s2.scaled(unit),
            j_mm_s3: self.jerk_mm_s3,
            snap_mm_s4: R::ZERO,
        }
    }
}

/// Corruption of a pulse in memory.
#[cfg(all(test, feature = "guards"))]
impl TickPulse<f32> {
    /// Number of figures of which a bit can be flipped.
    pub(super) const FIGURES: usize = 21;

    /// Flips one bit of one of its figures.
    pub(super) fn flip_bit(&mut self, figure: usize, bit: u32) {
        let [a, b, c, d] = &mut self.plateau_bits;
        let [e, f, g] = &mut self.closing_bits;
        let mut wide = [&mut self.cube_bits, a, b, c, d, e, f, g];
        let mut narrow = [
            &mut self.jerk_mm_s3,
            &mut self.accel_mm_s2,
            &mut self.speed_mm_s,
            &mut self.sine_mm,
            &mut self.snap_mm_s4,
            &mut self.plateau_v_mm_s,
            &mut self.plateau_a_mm_s2,
            &mut self.plateau_gain_mm_s,
            &mut self.plateau_rise_mm_s2,
            &mut self.plateau_bend_mm_s,
            &mut self.end_v_mm_s,
            &mut self.end_a_mm_s2,
            &mut self.end_gain_mm_s,
        ];
        if let Some(wide) = wide.get_mut(figure) {
            **wide ^= 1 << (bit % 64);
        } else {
            let narrow = &mut narrow[figure - 8];
            **narrow = f32::from_bits(narrow.to_bits() ^ 1 << (bit % 32));
        }
    }
}
