//! Feedforward: the command that makes the axis move as commanded before any error shows.
//!
//! Consumes the set-point's velocity, acceleration and jerk, produces a velocity command. In the tick.
//!
//! ```text
//! F_V(V) + F_a(a) + F_J(J)                                        S4 (1): each a gain plus a table
//!   + HP{ (1 + Tc·s)·(a + b·V) + a_c·sgn V + z″ } / Kv            the drive's inverse
//! ```
//!
//! **Lead.** Drive and converter take time: dead time, and half a tick for holding the output. Feedforward
//! can't undo that after the fact, but it can come early: position set-points are delayed by a few ticks, all
//! axes alike, so that the path does not change ([`Preview`](super::preview::Preview)), and feedforward is
//! not. The longest lead decides by how many. An axis with a shorter lead is delayed by the difference: whole
//! ticks by delaying the command, which is exact, the rest by the series V(t − φ) = V − φ·a + φ²/2·J, which
//! costs nothing: it is in the gains. φ is below a tick; with half a millisecond, the omitted terms are 10⁻⁴
//! of the velocity at 28 Hz.
//!
//! **The drive's inverse.** A velocity drive is a PI controller with gain Kv and integral time Ti over a
//! current loop with lag Tc. To make acceleration a against friction it needs the torque a + b·V + a_c·sgn V,
//! multiplied by (1 + Tc·s) because of the lag. Its controller makes that of the velocity difference
//! torque/Kv, until the integral part has taken over: a high-pass HP with Ti. A bed that the axis shakes
//! accelerates by z″ under it; the axis has to follow that, too. The Coulomb term changes sign Tc before the
//! axis does, over a small range of velocity.

use serde::{Deserialize, Serialize};

use super::check::{Check, fits};
use super::preview::{LEAD_ROUNDING_TICKS, PREVIEW_TICKS_MAX};
use super::scale::ScaleError;
use crate::num::{Fixed, Real, is_finite, whole};
use crate::path::Setpoint;

/// Feedforward of an axis. The default is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedforward {
    /// Gain of velocity \[1\]; 1 for a drive whose gain is known.
    pub velocity: f64,
    /// Gain of acceleration \[s\].
    pub accel_s: f64,
    /// Gain of jerk \[s²\].
    pub jerk_s2: f64,
    /// How long it comes before the position set-point \[s\], 0 or more: the drive's dead time plus half a
    /// tick.
    pub lead_s: f64,
    /// Added to the gains.
    pub tables: Tables,
    /// The drive to invert.
    pub drive: Option<DriveInverse>,
}

/// The tables of F_V, F_a and F_J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tables {
    /// Over velocity \[mm/s\].
    pub velocity: Option<Table>,
    /// Over acceleration \[mm/s²\].
    pub accel: Option<Table>,
    /// Over jerk \[mm/s³\].
    pub jerk: Option<Table>,
}

/// Points of a [`Table`].
pub const TABLE_POINTS: usize = 9;

/// A velocity command over a quantity, interpolated linearly between points. A point has 16 bits, because
/// every axis keeps room for three tables: one of ±5 mm/s has steps of 0.15 µm/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// The points lie evenly from −reach to +reach, in the quantity's unit: above 10⁻⁶, in fixed point below
    /// 2³¹. Beyond, the end points hold.
    pub reach: f64,
    /// Velocity per step \[mm/s\], 0 to 10.
    pub mm_s_per_step: f64,
    /// Velocity commands in steps.
    pub steps: [i16; TABLE_POINTS],
}

impl Table {
    /// The table of `mm_s` \[mm/s\]. A value that is not a number leads to a refusal of the table.
    #[must_use]
    pub fn new(reach: f64, mm_s: &[f64; TABLE_POINTS]) -> Self {
        let greatest = mm_s.iter().fold(0.0_f64, |greatest, point| greatest.max(libm::fabs(*point)));
        let is_number = mm_s.iter().all(|&point| is_finite(point));
        let mm_s_per_step = if is_number { greatest / f64::from(i16::MAX) } else { f64::NAN };
        let step =
            |point: f64| if mm_s_per_step > 0.0 { libm::round(point / mm_s_per_step) as i16 } else { 0 };
        Self { reach, mm_s_per_step, steps: mm_s.map(step) }
    }

    /// The points \[mm/s\].
    #[doc(hidden)]
    #[must_use]
    pub fn mm_s(&self) -> [f64; TABLE_POINTS] {
        self.steps.map(|step| f64::from(step) * self.mm_s_per_step)
    }
}

/// A drive with its mechanics, to be inverted. All figures are per unit of the inertia that it moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveInverse {
    /// Proportional gain of the velocity controller \[1/s\], 10⁻³ to 10⁶.
    pub velocity_gain_per_s: f64,
    /// Integral time of the velocity controller \[s\], a tick to 10⁶.
    pub integral_time_s: f64,
    /// Lag of the current loop \[s\], 0 to 1.
    pub current_lag_s: f64,
    /// Viscous friction \[1/s\], 0 to 10⁶.
    pub viscous_friction_per_s: f64,
    /// Coulomb friction \[mm/s²\], 0 to 10⁶; divided by Kv and by [`reversal_mm_s`](Self::reversal_mm_s) it
    /// must fit the number type.
    pub coulomb_friction_mm_s2: f64,
    /// Velocity above which Coulomb friction is fully compensated \[mm/s\], 10⁻³ to 10⁶; below, in proportion
    /// to the velocity.
    pub reversal_mm_s: f64,
    /// The machine bed, if the axis shakes it.
    pub bed: Option<BedInverse>,
}

impl DriveInverse {
    /// Checks that every figure is within its range.
    fn check(&self, check: &mut Check, tick_s: f64) {
        const GAINS: [f64; 2] = [1e-3, 1e6];
        const FRICTIONS: [f64; 2] = [0.0, 1e6];
        let Self { velocity_gain_per_s, integral_time_s, current_lag_s, viscous_friction_per_s, .. } = *self;
        let Self { coulomb_friction_mm_s2, reversal_mm_s, .. } = *self;
        let (of_gain, of_friction) = ("a number from 1e-3 to 1e6", "a number from 0 to 1e6");
        let of_time = "a number from the tick to 1e6";
        check.within(GAINS, "drive velocity gain [1/s]", velocity_gain_per_s, of_gain);
        check.within([tick_s, 1e6], "drive integral time [s]", integral_time_s, of_time);
        check.within([0.0, 1.0], "drive current lag [s]", current_lag_s, "a number from 0 to 1");
        check.within(FRICTIONS, "viscous friction [1/s]", viscous_friction_per_s, of_friction);
        check.within(FRICTIONS, "Coulomb friction [mm/s²]", coulomb_friction_mm_s2, of_friction);
        check.within(GAINS, "reversal velocity [mm/s]", reversal_mm_s, of_gain);
    }
}

/// One mode of the machine bed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BedInverse {
    /// Natural frequency of the bed alone \[Hz\], above 0, below [`BED_TICK_SHARE_MAX`] of the tick's
    /// frequency.
    pub frequency_hz: f64,
    /// Fraction of critical damping, from 0.001 to 1.
    pub damping_ratio: f64,
    /// Moving mass over the bed's modal mass, above 0; a resonance with that mass must fit the number type.
    pub mass_ratio: f64,
}

/// The bed's frequency is below this fraction of the tick's frequency: its inverse steps once per tick.
pub const BED_TICK_SHARE_MAX: f64 = 0.25;

/// Greatest velocity, acceleration and jerk that the figures must leave room for: a set-point's greatest ones
/// in fixed point, and the same in floats.
fn reach<R: Real>() -> [f64; 3] {
    R::SETPOINT_MAX.or(Fixed::SETPOINT_MAX).unwrap_or_default()
}

/// eˣ − 1 for |x| ≤ 2.
fn expm1(x: f64) -> f64 {
    series(1.0, x, 24, |n| n)
}

/// 1 − cos √x for 0 ≤ x ≤ 4.
fn versine(x: f64) -> f64 {
    series(-1.0, x, 12, |n| 2.0 * n * (1.0 - 2.0 * n))
}

/// Sum of the terms 1 to `terms` of a power series: term n is the one before, at first `term`, times
/// x/divisor(n). A loop of a few operations: general f64 functions take kilobytes on a core without f64
/// hardware.
#[inline(never)]
fn series(mut term: f64, x: f64, terms: u8, divisor: fn(f64) -> f64) -> f64 {
    let mut sum = 0.0;
    for n in 1..=terms {
        term = term * x / divisor(f64::from(n));
        sum += term;
    }
    sum
}

/// A linear function of velocity, acceleration and jerk.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Linear<R> {
    velocity: R,
    accel: R,
    jerk: R,
}

impl<R: Real> Linear<R> {
    /// `gains` applied to the set-point of `late_s` ago.
    #[inline(never)]
    fn new(check: &mut Check, quantity: &'static str, gains: [f64; 3], late_s: f64) -> Self {
        let [velocity, accel, jerk] = gains;
        let (accel, jerk) =
            (accel - late_s * velocity, jerk - late_s * accel + late_s * late_s / 2.0 * velocity);
        let [velocity_mm_s, accel_mm_s2, jerk_mm_s3] = reach::<R>();
        let most = libm::fabs(velocity) * velocity_mm_s
            + libm::fabs(accel) * accel_mm_s2
            + libm::fabs(jerk) * jerk_mm_s3;
        // Leaves room for the sum of all terms. Reaches are above 1: if a gain does not fit, neither does the
        // sum.
        let culprit = [velocity, accel, jerk].into_iter().find(|&gain| !is_finite(gain)).unwrap_or(most);
        check.that(fits::<R>(8.0 * most), quantity, culprit, "numbers within the kernel's range");
        Self { velocity: R::from_f64(velocity), accel: R::from_f64(accel), jerk: R::from_f64(jerk) }
    }

    #[inline]
    fn at(&self, setpoint: &Setpoint<R>) -> R {
        self.velocity * setpoint.velocity_mm_s
            + self.accel * setpoint.accel_mm_s2
            + self.jerk * setpoint.jerk_mm_s3
    }
}

/// A [`Table`] made for the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lookup<R> {
    reach: R,
    /// A power of two that scales the reach to at most 1; a second factor leads from there to points. In
    /// fixed point a single quotient would have no digits left at a long reach.
    scale: R,
    per_scaled: R,
    mm_s_per_step: R,
    steps: [i16; TABLE_POINTS],
}

/// The least power of two from 1 to 2³¹ that is not below `x`; 2³¹, the longest reach in fixed point, if
/// there is none.
fn power_of_two_above(x: f64) -> f64 {
    const EXPONENT: u32 = f64::MANTISSA_DIGITS - 1;
    // The exponent plus one, unless all digits after the first are 0.
    let next = x.to_bits().saturating_add((1 << EXPONENT) - 1) >> EXPONENT;
    f64::from_bits(next.clamp(1023, 1023 + 31) << EXPONENT)
}

impl<R: Real> Lookup<R> {
    #[inline(never)]
    fn new(check: &mut Check, quantity: &'static str, table: &Table) -> Self {
        let &Table { reach, mm_s_per_step, steps } = table;
        let expected = "a reach above 1e-6 and steps of at most 10 mm/s";
        check.within([0.0, 10.0], quantity, mm_s_per_step, expected);
        check.that(reach > 1e-6 && fits::<R>(reach), quantity, reach, expected);
        let scale = 1.0 / power_of_two_above(reach);
        let per_scaled = (TABLE_POINTS - 1) as f64 / 2.0 / (scale * reach);
        Self {
            reach: R::from_f64(reach),
            scale: R::from_f64(scale),
            per_scaled: R::from_f64(per_scaled),
            mm_s_per_step: R::from_f64(mm_s_per_step),
            steps,
        }
    }

    fn at(&self, value: R) -> R {
        // From 0 at −reach to 8 at +reach, in steps of 2⁻³².
        let from_middle = value.max(-self.reach).min(self.reach) * self.scale * self.per_scaled;
        let place = from_middle.to_q32() + ((TABLE_POINTS as i64 - 1) << 31);
        let index = (place >> 32).clamp(0, TABLE_POINTS as i64 - 2) as usize;
        let part = R::from_q32(place - ((index as i64) << 32));
        match (self.steps.get(index), self.steps.get(index + 1)) {
            (Some(&from), Some(&to)) => {
                let steps = |steps: i32| R::from_q32(i64::from(steps) << 32);
                let (from, to) = (i32::from(from), i32::from(to));
                (steps(from) + steps(to - from) * part) * self.mm_s_per_step
            }
            // The index is clamped.
            _ => R::ZERO,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct LookupTables<R> {
    velocity: Option<Lookup<R>>,
    accel: Option<Lookup<R>>,
    jerk: Option<Lookup<R>>,
    /// How far back the tables' arguments are taken \[s\].
    late: R,
}

impl<R: Real> LookupTables<R> {
    fn new(check: &mut Check, tables: &Tables, late_s: f64) -> Option<Self> {
        let Tables { velocity, accel, jerk } = tables;
        if velocity.is_none() && accel.is_none() && jerk.is_none() {
            return None;
        }
        let mut lookup =
            |quantity, table: &Option<Table>| table.as_ref().map(|table| Lookup::new(check, quantity, table));
        Some(Self {
            velocity: lookup("velocity feedforward table", velocity),
            accel: lookup("acceleration feedforward table", accel),
            jerk: lookup("jerk feedforward table", jerk),
            late: R::from_f64(late_s),
        })
    }

    fn at(&self, setpoint: &Setpoint<R>) -> R {
        let of =
            |lookup: &Option<Lookup<R>>, value: R| lookup.as_ref().map_or(R::ZERO, |lookup| lookup.at(value));
        of(&self.velocity, setpoint.velocity_mm_s - self.late * setpoint.accel_mm_s2)
            + of(&self.accel, setpoint.accel_mm_s2 - self.late * setpoint.jerk_mm_s3)
            + of(&self.jerk, setpoint.jerk_mm_s3)
    }
}

/// The bed's acceleration caused by the commanded motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bed<R> {
    /// Factors of displacement, velocity, and the axis' acceleration and jerk, in the bed's acceleration.
    displacement: R,
    velocity: R,
    drive: [R; 2],
    tick_s: R,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct BedState<R> {
    displacement_mm: R,
    velocity_mm_s: R,
}

impl<R: Real> Bed<R> {
    #[inline(never)]
    fn new(check: &mut Check, bed: &BedInverse, late_s: f64, tick_s: f64) -> Self {
        let &BedInverse { frequency_hz, damping_ratio, mass_ratio } = bed;
        let is_slow = frequency_hz > 0.0 && frequency_hz * tick_s < BED_TICK_SHARE_MAX;
        let expected = "more than 0, less than a quarter of the tick's frequency";
        check.that(is_slow, "bed frequency [Hz]", frequency_hz, expected);
        check.within([0.001, 1.0], "bed damping ratio", damping_ratio, "a number from 0.001 to 1");
        // At worst, shaken to and fro at the resonance, the bed's acceleration is 2/π·μ/ζ of the axis', and μ
        // at first.
        let [_, accel_mm_s2, _] = reach::<R>();
        let peak = accel_mm_s2 * mass_ratio * (2.0 + 0.75 / damping_ratio);
        let expected = "more than 0, and a resonance within the kernel's range";
        check.that(mass_ratio > 0.0 && fits::<R>(peak), "bed mass ratio", mass_ratio, expected);
        // With the moving mass on it: z″ + 2σ·z′ + ω²·z = −share·a. Steps of a tick have its exact poles and
        // its exact displacement under constant acceleration: at a resonance of 16, a frequency error of a
        // thousandth would be a thirtieth of the motion.
        let omega = 2.0 * core::f64::consts::PI * frequency_hz;
        let share = mass_ratio / (1.0 + mass_ratio);
        let decay = damping_ratio * omega / (1.0 + mass_ratio) * tick_s;
        let square = omega * omega / (1.0 + mass_ratio) * tick_s * tick_s;
        let shrinks = expm1(-decay);
        let grows = shrinks * (2.0 + shrinks);
        // 1 + e^(−2σTs) − 2·e^(−σTs)·cos, without cancellation.
        let stiffness = shrinks * shrinks + 2.0 * (1.0 + shrinks) * versine(square - decay * decay);
        let drive = share * stiffness / square;
        Self {
            displacement: -R::from_f64(stiffness / tick_s / tick_s),
            velocity: R::from_f64(grows / tick_s),
            drive: [-R::from_f64(drive), R::from_f64(late_s * drive)],
            tick_s: R::from_f64(tick_s),
        }
    }

    /// Returns the bed's acceleration now, and moves its state to the next tick.
    #[inline]
    fn tick(&self, state: &mut BedState<R>, setpoint: &Setpoint<R>) -> R {
        let [of_accel, of_jerk] = self.drive;
        let accel_mm_s2 = self.displacement * state.displacement_mm
            + self.velocity * state.velocity_mm_s
            + of_accel * setpoint.accel_mm_s2
            + of_jerk * setpoint.jerk_mm_s3;
        state.velocity_mm_s = state.velocity_mm_s + self.tick_s * accel_mm_s2;
        state.displacement_mm = state.displacement_mm + self.tick_s * state.velocity_mm_s;
        accel_mm_s2
    }
}

/// [`DriveInverse`] made for the tick. All torques are divided by Kv, so that they are velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Inverse<R> {
    /// (1 + Tc·s)·(a + b·V).
    torque: Linear<R>,
    /// The velocity that decides the sign of Coulomb friction.
    turning: Linear<R>,
    reversal_mm_s: R,
    friction: R,
    /// The share of a change that the high-pass takes, and the share that it forgets per tick.
    takes: R,
    forgets: R,
    bed: Option<(Bed<R>, R)>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct InverseState<R> {
    last_mm_s: R,
    output_mm_s: R,
    bed: BedState<R>,
}

impl<R: Real> Inverse<R> {
    fn new(check: &mut Check, drive: &DriveInverse, late_s: f64, tick_s: f64) -> Self {
        let &DriveInverse {
            velocity_gain_per_s: gain_per_s,
            integral_time_s,
            current_lag_s: lag_s,
            viscous_friction_per_s: viscous_per_s,
            coulomb_friction_mm_s2,
            reversal_mm_s,
            bed,
        } = drive;
        drive.check(check, tick_s);
        let torque =
            [viscous_per_s / gain_per_s, (1.0 + lag_s * viscous_per_s) / gain_per_s, lag_s / gain_per_s];
        let friction = coulomb_friction_mm_s2 / gain_per_s / reversal_mm_s;
        let fits = fits::<R>(friction) && fits::<R>(8.0 * coulomb_friction_mm_s2 / gain_per_s);
        let quantity = "Coulomb friction over drive velocity gain and reversal velocity [1]";
        check.that(fits, quantity, friction, "a number within the kernel's range");
        Self {
            torque: Linear::new(check, "drive inverse", torque, late_s),
            turning: Linear::new(check, "reversal", [1.0, 0.0, 0.0], late_s - lag_s),
            reversal_mm_s: R::from_f64(reversal_mm_s),
            friction: R::from_f64(friction),
            // By the trapezoid rule: the plain difference would come half a tick late.
            takes: R::from_f64(1.0 / (1.0 + tick_s / integral_time_s / 2.0)),
            forgets: R::from_f64(1.0 / (0.5 + integral_time_s / tick_s)),
            bed: bed
                .as_ref()
                .map(|bed| (Bed::new(check, bed, late_s - lag_s, tick_s), R::from_f64(1.0 / gain_per_s))),
        }
    }

    #[inline]
    fn tick(&self, state: &mut InverseState<R>, setpoint: &Setpoint<R>) -> R {
        let turning = self.turning.at(setpoint).max(-self.reversal_mm_s).min(self.reversal_mm_s);
        let mut torque = self.torque.at(setpoint) + self.friction * turning;
        if let Some((bed, per_gain)) = &self.bed {
            torque = torque + *per_gain * bed.tick(&mut state.bed, setpoint);
        }
        let output =
            state.output_mm_s - self.forgets * state.output_mm_s + self.takes * (torque - state.last_mm_s);
        (state.last_mm_s, state.output_mm_s) = (torque, output);
        output
    }
}

/// [`Feedforward`] made for the tick. Immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedforwardConfig<R> {
    gains: Linear<R>,
    more: Option<More<R>>,
}

/// The parts that gains alone don't cover.
#[derive(Clone, Copy, Debug, PartialEq)]
struct More<R> {
    tables: Option<LookupTables<R>>,
    inverse: Option<Inverse<R>>,
    /// Number of ticks by which the command is delayed.
    delay_ticks: u8,
}

/// The state of feedforward. The default is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedforwardState<R> {
    inverse: InverseState<R>,
    delay: Delay<R>,
}

/// The commands of the last ticks. Delaying the output equals delaying the input, and is one number instead
/// of three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Delay<R> {
    past_mm_s: [R; PREVIEW_TICKS_MAX as usize],
    next: u8,
}

impl<R: Real> Delay<R> {
    /// Returns the command of `ticks` ago, 1 or more; remembers the present one.
    fn tick(&mut self, ticks: u8, command_mm_s: R) -> R {
        // The ring is as long as the delay: the place read is the one written.
        let Some(place) = self.past_mm_s.get_mut(usize::from(self.next)) else { return command_mm_s };
        let delayed_mm_s = *place;
        *place = command_mm_s;
        self.next = if self.next + 1 >= ticks { 0 } else { self.next + 1 };
        delayed_mm_s
    }
}

impl<R: Real> FeedforwardConfig<R> {
    /// Feedforward alone, for a control tick of `tick_s` and position set-points delayed by `preview_ticks`.
    /// Background.
    ///
    /// # Errors
    /// The first figure that is out of its range or beyond the number type.
    pub fn new(feedforward: &Feedforward, preview_ticks: u8, tick_s: f64) -> Result<Self, ScaleError> {
        Check::all(|check| Self::checked(check, feedforward, preview_ticks, tick_s))
    }

    /// Feedforward for a tick of `tick_s`, with position set-points delayed by `preview_ticks` ticks.
    ///
    /// Refused if a figure is not finite, out of its range or beyond the number type, or if the lead is
    /// longer than the preview.
    pub(super) fn checked(
        check: &mut Check,
        feedforward: &Feedforward,
        preview_ticks: u8,
        tick_s: f64,
    ) -> Self {
        let &Feedforward { velocity, accel_s, jerk_s2, lead_s, .. } = feedforward;
        let preview_s = f64::from(preview_ticks) * tick_s;
        let early_s = preview_s - lead_s;
        // Rounding must neither turn a whole tick into one less nor make the remainder negative.
        let leads = [0.0, preview_s + LEAD_ROUNDING_TICKS * tick_s];
        check.within(leads, "feedforward lead [s]", lead_s, "a number from 0 to the machine's preview");
        let early_ticks = early_s / tick_s + LEAD_ROUNDING_TICKS;
        let delay_ticks = if early_ticks > 0.0 { whole(early_ticks) as u8 } else { 0 };
        let delay_ticks = delay_ticks.min(PREVIEW_TICKS_MAX);
        let late_s = early_s - f64::from(delay_ticks) * tick_s;
        let late_s = if late_s > 0.0 { late_s } else { 0.0 };
        let gains = Linear::new(check, "feedforward gains", [velocity, accel_s, jerk_s2], late_s);
        let tables = LookupTables::new(check, &feedforward.tables, late_s);
        let inverse = feedforward.drive.as_ref().map(|drive| Inverse::new(check, drive, late_s, tick_s));
        let is_more = tables.is_some() || inverse.is_some() || delay_ticks > 0;
        let more = is_more.then_some(More { tables, inverse, delay_ticks });
        Self { gains, more }
    }

    /// The velocity command for this tick \[mm/s\].
    #[inline]
    pub fn tick(&self, state: &mut FeedforwardState<R>, setpoint: &Setpoint<R>) -> R {
        let command = self.gains.at(setpoint);
        match &self.more {
            Some(more) => more.tick(state, setpoint, command),
            None => command,
        }
    }
}

impl<R: Real> More<R> {
    // A separate function, so that axes without it don't pay for its registers.
    #[inline(never)]
    fn tick(&self, state: &mut FeedforwardState<R>, setpoint: &Setpoint<R>, gained: R) -> R {
        let mut command = gained;
        if let Some(tables) = &self.tables {
            command = command + tables.at(setpoint);
        }
        if let Some(inverse) = &self.inverse {
            command = command + inverse.tick(&mut state.inverse, setpoint);
        }
        if self.delay_ticks > 0 { state.delay.tick(self.delay_ticks, command) } else { command }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// At both ends of the reach, between them and beyond, every number type gives the table's value.
    #[test]
    fn tables_are_exact_over_their_whole_reach() {
        fn holds<R: Real>(reach: f64) {
            // A line: what is between points is known.
            let points: [f64; TABLE_POINTS] = core::array::from_fn(|index| 25.0 * (index as f64 - 4.0));
            let table = Table::new(reach, &points);
            let lookup = Check::all(|check| Lookup::<R>::new(check, "table", &table)).expect("valid");
            for part in [-2.0, -1.0, -0.99, -0.5, -0.01, 0.0, 0.3, 0.5, 0.999, 1.0, 1.5] {
                let value = R::checked_from_f64(part * reach).unwrap_or(R::from_f64(part.signum() * reach));
                let expected = 100.0 * part.clamp(-1.0, 1.0);
                let found = lookup.at(value).to_f64();
                // A step of the argument at a short reach, and the table's own steps of 16 bits.
                let tolerance = 100.0 * (1e-4 + 1e-3 * f64::from(u8::from(reach < 1e-3)));
                assert!((found - expected).abs() < tolerance, "{reach:e} at {part}: {found}");
            }
        }
        for reach in [1.1e-6, 1e-3, 0.7, 1.0, 300.0, 5e3, 1e6, 1e8, 5e8, 1.5e9, 2.1e9] {
            holds::<f32>(reach);
            holds::<f64>(reach);
            holds::<Fixed>(reach);
        }
        let far = Table::new(2.2e9, &[0.0; TABLE_POINTS]);
        assert!(Check::all(|check| Lookup::<Fixed>::new(check, "table", &far)).is_err());
    }

    #[test]
    fn loops_are_the_functions() {
        for index in 0..=200 {
            let x = f64::from(index) / 100.0;
            assert!((expm1(-x) - libm::expm1(-x)).abs() < 1e-15);
            assert!((versine(x * x) - (1.0 - libm::cos(x))).abs() < 1e-15);
        }
    }

    /// Halved until it is at most 1, as often as to 2³¹.
    #[test]
    fn a_reach_is_brought_to_one() {
        let random = Random::new(17);
        for index in 0..100_000_i32 {
            let power = 2.0_f64.powi(index % 40 - 5);
            let between = power * (1.0 + random.unit());
            for reach in [power, power.next_up(), power.next_down(), between] {
                let mut scale = 1.0;
                for _ in 0..31 {
                    if scale * reach > 1.0 {
                        scale *= 0.5;
                    }
                }
                assert_eq!(1.0 / power_of_two_above(reach), scale, "{reach:e}");
            }
        }
    }
}
