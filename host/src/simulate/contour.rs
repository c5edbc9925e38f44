//! The contour error: how far the machine is off its path.
//!
//! It is a distance, and so of linear axes only, which count as at right angles to each other: degrees and millimetres
//! have none in common.

use crate::trace::AxisTick;

/// Speed below which the direction of motion is rounding \[mm/s\].
const AT_REST_MM_S: f64 = 1e-6;

/// Contour error tick by tick. It remembers the direction of the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contour<const N: usize> {
    /// Which places have linear axes.
    is_linear: [bool; N],
    direction: Option<[f64; N]>,
}

impl<const N: usize> Contour<N> {
    /// Of a machine that has linear axes in these places, before its first motion.
    pub(crate) fn new(is_linear: [bool; N]) -> Self {
        Self { is_linear, direction: None }
    }

    /// The part of the following error across the path \[µm\], 0 or more. The path is taken as straight over
    /// the error's length, which at 20 µm on a radius of 1 mm hides 0.2 µm. At rest the last direction
    /// counts.
    pub(crate) fn error_um(&mut self, axes: &[AxisTick; N]) -> f64 {
        let linear = |of: fn(&AxisTick) -> f64| -> [f64; N] {
            core::array::from_fn(|place| if self.is_linear[place] { of(&axes[place]) } else { 0.0 })
        };
        let velocity = linear(|axis| axis.vel_mm_s);
        let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        let error = linear(|axis| axis.err_um);
        if speed > AT_REST_MM_S {
            self.direction = Some(velocity.map(|v| v / speed));
        }
        let direction = self.direction.unwrap_or([0.0; N]);
        let along: f64 = error.iter().zip(direction).map(|(e, d)| e * d).sum();
        error.iter().zip(direction).map(|(e, d)| (e - along * d) * (e - along * d)).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes<const N: usize>(vel_mm_s: [f64; N], err_um: [f64; N]) -> [AxisTick; N] {
        std::array::from_fn(|axis| AxisTick {
            vel_mm_s: vel_mm_s[axis],
            err_um: err_um[axis],
            ..AxisTick::default()
        })
    }

    #[test]
    fn only_what_is_across_the_path_counts() {
        let mut contour = Contour::new([true; 3]);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        // Before the first motion there is no direction: all of the error counts.
        assert!(close(contour.error_um(&axes([0.0; 3], [3.0, 4.0, 0.0])), 5.0));
        // A lag along the path is no contour error, whatever the direction.
        assert!(close(contour.error_um(&axes([30.0, 40.0, 0.0], [3.0, 4.0, 0.0])), 0.0));
        assert!(close(contour.error_um(&axes([-30.0, -40.0, 0.0], [-4.0, 3.0, 0.0])), 5.0));
        // At rest the last direction counts.
        assert!(close(contour.error_um(&axes([0.0; 3], [3.0, 4.0, 12.0])), 12.0));
    }

    #[test]
    fn a_rotary_axis_has_no_part_in_it() {
        let mut contour = Contour::new([true, false, true]);
        let error = contour.error_um(&axes([30.0, 700.0, 40.0], [3.0, 500.0, 4.0]));
        assert!(error.abs() < 1e-12, "{error}");
        let error = contour.error_um(&axes([0.0, 700.0, 0.0], [-4.0, 500.0, 3.0]));
        assert!((error - 5.0).abs() < 1e-12, "{error}");
    }
}
