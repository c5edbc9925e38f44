//! Figures of S4 that more than one crate is held to, from its reference model.

/// The figure is what is expected, within its tolerance; both are printed.
///
/// # Panics
/// It is not.
#[track_caller]
pub fn assert_near(quantity: &str, actual: f64, expected: f64, tolerance: f64) {
    println!("{quantity}: {actual:.3}, expected {expected} ± {tolerance}");
    assert!(
        (actual - expected).abs() <= tolerance,
        "{quantity}: {actual}, expected {expected} ± {tolerance}"
    );
}

/// Contour error \[µm\] and its tolerance at 1, 2, … 16 Hz.
pub type ContourTable = [(f64, f64); 16];

/// With velocity feedforward.
pub const CONTOUR_V: ContourTable = [
    (7.21, 0.72),
    (9.31, 0.78),
    (11.97, 0.86),
    (15.03, 0.95),
    (18.52, 1.06),
    (22.36, 1.17),
    (26.41, 1.29),
    (30.59, 1.42),
    (34.96, 1.55),
    (39.65, 1.69),
    (45.04, 1.85),
    (53.59, 2.11),
    (69.96, 2.6),
    (54.73, 2.14),
    (58.54, 2.26),
    (63.15, 2.39),
];

/// With feedforward of velocity, acceleration and jerk, the jerk gain as published.
pub const CONTOUR_VAJ: ContourTable = [
    (5.56, 0.67),
    (6.05, 0.68),
    (6.97, 0.71),
    (8.3, 0.75),
    (9.93, 0.8),
    (11.78, 0.85),
    (13.74, 0.91),
    (15.75, 0.97),
    (17.74, 1.03),
    (19.77, 1.09),
    (22.37, 1.17),
    (27.66, 1.33),
    (39.99, 1.7),
    (22.33, 1.17),
    (22.43, 1.17),
    (23.01, 1.19),
];
