//! S4's measurements, and the figures that the reference machine has to reach.
//!
//! The reference drive was fitted so that S4's figures come out together. The expected values are those of an
//! independent model of drive, converter and regulator in double precision; a run through planner, streams
//! and kernel has to agree within the tolerances. The tests and the tables of `motion drive` read these same
//! constants.

use super::circle_motion::Circle;
use super::experiment::DriveError;
use super::step::Step;
use super::{Terms, circle, experiment, harmonic, step};
use crate::machine::Machine;

/// A figure to be met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// The figure's name.
    pub quantity: &'static str,
    /// The figure's unit.
    pub unit: &'static str,
    /// S4's value.
    pub paper: f64,
    /// The reference machine's.
    pub expected: f64,
    /// Greatest difference of a run from `expected`.
    pub tolerance: f64,
}

impl Figure {
    const fn new(
        quantity: &'static str,
        unit: &'static str,
        paper: f64,
        (expected, tolerance): (f64, f64),
    ) -> Self {
        Self { quantity, unit, paper, expected, tolerance }
    }

    /// The figure with its measured value.
    #[must_use]
    pub fn against(self, measured: f64) -> Comparison {
        Comparison { figure: self, measured }
    }
}

/// A figure and its measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// The range that had to be met.
    pub figure: Figure,
    /// The measured value, in the figure's unit; not a number if there was nothing to measure.
    pub measured: f64,
}

impl Comparison {
    /// Whether it is within the tolerance.
    #[must_use]
    pub fn holds(&self) -> bool {
        (self.measured - self.figure.expected).abs() <= self.figure.tolerance
    }
}

/// Feed of S4's step \[mm/s\]: 7.2 m/min.
pub const STEP_FEED_MM_S: f64 = 120.0;
/// Feed of the bandwidth's measurements \[mm/s\]: 9549 mm/min.
pub const BANDWIDTH_FEED_MM_S: f64 = 9549.0 / 60.0;
/// Feed of the circle test \[mm/s\]: 2.150 m/min.
pub const CIRCLE_FEED_MM_S: f64 = 2150.0 / 60.0;
/// The contour error that S4 allows \[µm\].
pub const CONTOUR_LIMIT_UM: f64 = 20.0;

/// Delay of the step.
pub const DELAY: Figure = Figure::new("delay", "ms", 2.0, (2.013, 0.1));
/// Time constant of the step.
pub const TIME_CONSTANT: Figure = Figure::new("time constant", "ms", 10.0, (9.827, 0.2));
/// Overshoot of the step.
pub const OVERSHOOT: Figure = Figure::new("overshoot", "%", 1.1, (1.12, 0.1));
/// Settling of the step into ±0.02 m/min.
pub const SETTLING: Figure = Figure::new("settled within ±0.02 m/min", "ms", 62.0, (57.5, 2.0));
/// Peak acceleration of the step.
pub const PEAK_ACCEL: Figure = Figure::new("peak acceleration", "m/s²", 12.5, (12.55, 0.4));
/// Peak jerk of the step.
pub const PEAK_JERK: Figure = Figure::new("peak jerk", "m/s³", 11_800.0, (11_700.0, 800.0));
/// −3 dB of the spectrum of a step to 9549 mm/min.
pub const STEP_BANDWIDTH: Figure = Figure::new("−3 dB from a step to 9549 mm/min", "Hz", 28.0, (32.201, 0.7));
/// −3 dB of the swing of harmonics of 9549 mm/min.
pub const HARMONIC_BANDWIDTH: Figure =
    Figure::new("−3 dB from harmonics of 9549 mm/min", "Hz", 28.0, (25.329, 0.5));
/// Phase of harmonics of 9549 mm/min.
pub const PHASE_AT_28_HZ: Figure = Figure::new("phase at 28 Hz, 9549 mm/min", "°", -90.0, (-71.335, 3.0));
/// Following error of X with velocity feedforward.
pub const FOLLOWING_V: Figure = Figure::new("following error of X at 4 Hz, V", "µm", 11.0, (10.491, 0.5));
/// Following error of X with all three.
pub const FOLLOWING_VAJ: Figure = Figure::new("following error of X at 4 Hz, VAJ", "µm", 4.0, (4.159, 0.5));
/// The frequency at which the contour error passes 20 µm with velocity feedforward.
pub const LIMIT_V: Figure = Figure::new("contour error ≤ 20 µm up to, V", "Hz", 5.5, (5.388, 0.2));
/// The frequency at which it passes 20 µm with velocity and acceleration.
pub const LIMIT_VA: Figure = Figure::new("contour error ≤ 20 µm up to, VA", "Hz", 9.0, (8.861, 0.3));
/// The frequency at which it passes 20 µm with all three.
pub const LIMIT_VAJ: Figure = Figure::new("contour error ≤ 20 µm up to, VAJ", "Hz", 10.0, (10.1, 0.3));
/// Greatest form deviation at 1, 2, … 10 Hz.
pub const FORM_TO_10_HZ: Figure = Figure::new("form deviation up to 10 Hz, VAJ", "µm", 9.0, (5.687, 0.6));
/// Form deviation in the bed's resonance.
pub const FORM_AT_13_HZ: Figure = Figure::new("form deviation at 13 Hz, VAJ", "µm", 32.0, (31.54, 2.0));

/// Whether `machine` is the reference machine, whatever its name.
#[must_use]
pub fn is_reference(machine: &Machine) -> bool {
    let reference = Machine::reference();
    machine.tick_s.to_bits() == reference.tick_s.to_bits() && machine.axes == reference.axes
}

/// The figures of S4's step; `step` is what [`Step::reference`] gave.
///
/// # Errors
/// Those of [`Step::measure`].
pub fn compare_step(machine: &Machine, step: &step::StepFigures) -> Result<Vec<Comparison>, DriveError> {
    let faster = Step { feed_mm_s: BANDWIDTH_FEED_MM_S, ..Step::reference() };
    let (fast, _) = faster.measure(machine)?;
    Ok(vec![
        DELAY.against(step.delay_s * 1e3),
        TIME_CONSTANT.against(step.time_constant_s * 1e3),
        OVERSHOOT.against(step.overshoot * 1e2),
        SETTLING.against(step.settling_s.unwrap_or(f64::NAN) * 1e3),
        PEAK_ACCEL.against(step.peak_accel_mm_s2 / 1e3),
        PEAK_JERK.against(step.peak_jerk_mm_s3 / 1e3),
        STEP_BANDWIDTH.against(fast.bandwidth_hz.unwrap_or(f64::NAN)),
    ])
}

/// The figures of S4's harmonic motion, of the first axis.
///
/// # Errors
/// Those of [`harmonic::measure`].
pub fn compare_harmonic(machine: &Machine) -> Result<Vec<Comparison>, DriveError> {
    let open = experiment::open_loop(machine);
    let circle = Circle::new(28.0, BANDWIDTH_FEED_MM_S);
    let bandwidth_hz = harmonic::bandwidth(&open, &circle, (16.0, 40.0, 4.0), 0, harmonic::Amplitude::Swing)?;
    let [x, _] = harmonic::measure(&open, &circle)?.axes;
    Ok(vec![
        HARMONIC_BANDWIDTH.against(bandwidth_hz.unwrap_or(f64::NAN)),
        PHASE_AT_28_HZ.against(x.phase_rad.to_degrees()),
    ])
}

/// The figures of S4's circle test.
///
/// # Errors
/// Those of [`circle::measure`].
pub fn compare_circle(machine: &Machine) -> Result<Vec<Comparison>, DriveError> {
    let feed_mm_s = CIRCLE_FEED_MM_S;
    let [v, va, vaj] = [Terms::V, Terms::Va, Terms::Vaj].map(|terms| terms.of(machine));
    let passes = |machine: &Machine| -> Result<f64, DriveError> {
        let found = circle::limit_frequency(machine, feed_mm_s, CONTOUR_LIMIT_UM, (1.0, 16.0, 1.0))?;
        Ok(found.unwrap_or(f64::NAN))
    };
    let mut form_um = 0.0_f64;
    for frequency in 1..=10 {
        form_um = form_um.max(circle::measure(&vaj, f64::from(frequency), feed_mm_s)?.form_um());
    }
    Ok(vec![
        FOLLOWING_V.against(circle::measure(&v, 4.0, feed_mm_s)?.following_um[0]),
        FOLLOWING_VAJ.against(circle::measure(&vaj, 4.0, feed_mm_s)?.following_um[0]),
        LIMIT_V.against(passes(&v)?),
        LIMIT_VA.against(passes(&va)?),
        LIMIT_VAJ.against(passes(&vaj)?),
        FORM_TO_10_HZ.against(form_um),
        FORM_AT_13_HZ.against(circle::measure(&vaj, 13.0, feed_mm_s)?.form_um()),
    ])
}
