//! The contour error: how far the machine is off its path.

use crate::trace::{AXES, AxisTick};

/// Speed below which the direction of motion is rounding \[mm/s\].
const AT_REST_MM_S: f64 = 1e-6;

/// Contour error tick by tick. It remembers the direction of the path.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contour {
    direction: Option<[f64; AXES]>,
}

impl Contour {
    /// The part of the following error across the path \[µm\], 0 or more. The path is taken as straight over
    /// the error's length, which at 20 µm on a radius of 1 mm hides 0.2 µm. At rest the last direction
    /// counts.
    pub(crate) fn error_um(&mut self, axes: &[AxisTick; AXES]) -> f64 {
        let velocity = axes.map(|axis| axis.vel_mm_s);
        let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        if speed > AT_REST_MM_S {
            self.direction = Some(velocity.map(|v| v / speed));
        }
        let error = axes.map(|axis| axis.err_um);
        let direction = self.direction.unwrap_or_default();
        let along: f64 = error.iter().zip(direction).map(|(e, d)| e * d).sum();
        error.iter().zip(direction).map(|(e, d)| (e - along * d) * (e - along * d)).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(vel_mm_s: [f64; AXES], err_um: [f64; AXES]) -> [AxisTick; AXES] {
        std::array::from_fn(|axis| AxisTick {
            vel_mm_s: vel_mm_s[axis],
            err_um: err_um[axis],
            ..AxisTick::default()
        })
    }

    #[test]
    fn only_what_is_across_the_path_counts() {
        let mut contour = Contour::default();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        // Before the first motion there is no direction: all of the error counts.
        assert!(close(contour.error_um(&axes([0.0; 3], [3.0, 4.0, 0.0])), 5.0));
        // A lag along the path is no contour error, whatever the direction.
        assert!(close(contour.error_um(&axes([30.0, 40.0, 0.0], [3.0, 4.0, 0.0])), 0.0));
        assert!(close(contour.error_um(&axes([-30.0, -40.0, 0.0], [-4.0, 3.0, 0.0])), 5.0));
        // At rest the last direction counts.
        assert!(close(contour.error_um(&axes([0.0; 3], [3.0, 4.0, 12.0])), 12.0));
    }
}
