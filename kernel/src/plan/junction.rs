//! The greatest feed through a junction of two blocks.
//!
//! A junction is passed without stopping if the angle between its tangents is small enough; otherwise the
//! machine stops exactly on the corner. When it is passed at feed v, two things step from one tick to the
//! next: the velocity by the angle, v·φ, which is an acceleration of v·φ/τ for one tick, and the acceleration
//! by the jump of curvature, v²·|Δ(κN)|. No limit on jerk per tick can be honest there (it grows as 1/τ), so
//! their sum has its own limit, the **acceleration-step limit**:
//!
//! ```text
//! v·φ/τ + v²·|Δ(κN)| ≤ step
//! ```

use crate::num::Root;

/// The steps at a junction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Junction<R> {
    /// φ, the angle between the tangents \[rad\].
    pub angle_rad: R,
    /// |Δ(κN)|, the jump of the curvature vector \[1/mm\].
    pub curvature_step_per_mm: R,
}

/// The greatest feed through a junction \[mm/s\]: 0 if the angle exceeds `angle_max_rad`, infinite if nothing
/// steps (in fixed point, the greatest value). `accel_step_mm_s2` is the acceleration-step limit, `tick_s`
/// the control tick τ.
pub fn junction<R: Root>(junction: &Junction<R>, angle_max_rad: R, accel_step_mm_s2: R, tick_s: R) -> R {
    let (kink, bend) = (junction.angle_rad / tick_s, junction.curvature_step_per_mm);
    // A junction beyond the range of fixed point stops, and no greater step is used.
    let most = R::from_f64(R::LIMITS.1);
    if junction.angle_rad > angle_max_rad || kink > most || bend > most {
        return R::ZERO;
    }
    // The root of Δκ·v² + (φ/τ)·v = step, in the form without cancellation.
    let step = accel_step_mm_s2.min(most);
    let two_step = step + step;
    // Rounding of fixed point makes it larger, not smaller.
    let sum = kink + kink.root_of_squares((bend + bend).sqrt_product(two_step));
    two_step / if sum > R::ZERO { sum.rounded_up() } else { sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_the_steps_is_the_limit() {
        let (step, tick) = (500.0, 0.0005);
        for angle_rad in [0.0, 1e-6, 1e-3] {
            for curvature_step_per_mm in [0.0, 1e-3, 0.25, 100.0] {
                let v = junction(&Junction { angle_rad, curvature_step_per_mm }, 0.01, step, tick);
                if angle_rad == 0.0 && curvature_step_per_mm == 0.0 {
                    assert_eq!(v, f64::INFINITY);
                } else {
                    let sum = v * angle_rad / tick + v * v * curvature_step_per_mm;
                    assert!((sum - step).abs() < 1e-9 * step, "{angle_rad} {curvature_step_per_mm} {v}");
                }
            }
        }
        let corner = Junction { angle_rad: 0.02, curvature_step_per_mm: 0.0 };
        assert_eq!(junction(&corner, 0.01, step, tick), 0.0);
    }
}
