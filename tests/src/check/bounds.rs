//! What is promised, in figures: every test that holds a figure takes it from here.
//!
//! Rounding is counted in ε, the distance of 1 from the next number: 1.2·10⁻⁷ in f32, 2.2·10⁻¹⁶ in f64.

use std::f64::consts::PI;

use motion_kernel::num::{Fixed, Real};

/// How a number type rounds.
pub trait Number: Real {
    /// Part of itself by which a scaled value is rounded: ε of a float; in fixed point the step of the
    /// normalised quantities that scale it.
    const RELATIVE: f64;
    /// Rounding whatever the size: none of a float, the step of fixed point.
    const STEP: f64;
}

impl Number for f32 {
    const RELATIVE: f64 = Self::EPSILON as f64;
    const STEP: f64 = 0.0;
}

impl Number for f64 {
    const RELATIVE: f64 = Self::EPSILON;
    const STEP: f64 = 0.0;
}

impl Number for Fixed {
    // Four steps of 2⁻²⁹: the series of a shape rounds down in every term.
    const RELATIVE: f64 = 4.0 / 536_870_912.0;
    const STEP: f64 = 1.0 / 4_294_967_296.0;
}

/// Acceleration, jerk and snap along the path may exceed their limits by this many ε of themselves: the
/// scale of a ramp is rounded once, its shape reaches 1/2, 1 and 1 within 2 ε, and their product is
/// rounded again.
pub const LIMIT_ROUNDING: f64 = 4.0;
/// The same in f64, where the decimal places of the limits count too.
pub const LIMIT_SHARE: f64 = 1e-9;

/// Values of one tick against what the tick before predicts: so many ε of the terms that were added.
/// The normalised time of a phase is rounded to ε/2, and the shapes change by up to π per unit of it.
pub const CONTINUITY_ROUNDING: f64 = 8.0;
/// The path position against its prediction: the two ends of every segment are rounded to position steps,
/// and a ramp's own length may be this far from the path it covers \[mm\].
pub const LENGTH_ROUNDING_MM: f64 = 1.2e-8;

/// How far rounding may set the path position back where the motion is slower than it \[mm\]: a few position
/// steps, and twice the error of the sine's part of a ramp's length, Jp·(2e)³/(16π³), of an arch of length
/// 2e. The sine is 4π times the acceleration's shape, so it has 4π times that one's rounding, of about 2
/// `relative`. The cube, Jp·(2e)³/12, and the bend, Jp·(2e)³/(8π²), are multiplied by fractions in 2⁻³², which
/// are rounded twice and once.
pub fn backward_mm(relative: f64, jerk_arch_cubed_mm: f64) -> f64 {
    let sine = 2.0 * 2.0 * 12.6 * relative / 496.1;
    let fractions = 2.0_f64.powi(-32) * (2.0 / 12.0 + 1.0 / (8.0 * PI * PI));
    2e-9 + (sine + fractions) * jerk_arch_cubed_mm
}

/// Set positions against the programmed path \[mm\]: the curves' tolerance, a hundredth of a count of 0.1 µm …
pub const CURVE_MM: f64 = 1e-6;
/// … and the offset from the start of a piece, of at most `PIECE_MM_MAX`: direction, length and product
/// are each rounded to ε/2.
pub fn position_mm<R: Number>() -> f64 {
    CURVE_MM + 1.5 * R::RELATIVE * R::PIECE_MM_MAX.min(16.0) + 1e-9
}

/// Velocity, acceleration and jerk of the axes against the chain rule on the programmed path, as a part of
/// the sum of the magnitudes of its terms. Septic pieces of up to 45° of arc; derivatives of
/// higher order are less well approximated.
pub const AXIS_SHARES: [f64; 3] = [4e-6, 5e-6, 2e-5];

/// What fixed point adds to that, in [`Number::STEP`]s. A septic's coefficients and what is made of them
/// are parts of the piece's length, in units of 2⁻²⁹ = 8 steps. Half a unit for each coefficient (k,
/// k·(k − 1), … of them, summed over k) and one for each of Horner's products that is rounded down and
/// carried on (8, 8 + 28, … of them, times 1, 2, 6) make 50, 240 and 1180 units of the first, second and third
/// derivative; the products are rounded to one step each, and so is 1/L, of which v/L has v-fold the error.
/// The place in the piece is off by two units. √3 of
/// that for the vector of three axes. `bend` and `twist` are κ and κ', `piece_mm` is L.
pub fn axis_steps([v, a, j]: [f64; 3], bend: f64, twist: f64, piece_mm: f64) -> [f64; 3] {
    if bend <= 0.0 {
        return [3.0; 3];
    }
    let w = v / piece_mm;
    let w_steps = 1.0 + v;
    let place = 2.0 * 8.0 * piece_mm;
    let (a, j) = (a.abs(), j.abs());
    [
        6.0 + 8.0 * 50.0 * v + place * bend * v,
        6.0 + 8.0 * (50.0 * a + 240.0 * w * v)
            + 2.0 * v * (1.0 + bend * piece_mm * w_steps)
            + place * (twist * v * v + bend * a),
        6.0 + 8.0 * (50.0 * j + 3.0 * 240.0 * w * a + 1180.0 * w * w * v)
            + 6.0 * a * (1.0 + bend * piece_mm * w_steps)
            + 2.0 * v * (1.0 + w + 2.0 * twist * piece_mm * v * w_steps)
            + place * (bend * twist * v * v * v + 3.0 * twist * v * a + bend * j),
    ]
    .map(|steps| 3.0_f64.sqrt() * steps)
}
