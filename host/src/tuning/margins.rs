//! Margins of the position loop L = C·G/s, in the linear model with its bed.

use core::f64::consts::{PI, TAU};

use hal_sim::DriveParameters;
use motion_kernel::axis::Gains;

use crate::drive::model::{Complex, feedback, response};

/// Frequencies per decade that are looked at: a resonance of 3 % damping is 40 of them wide.
const PER_DECADE: f64 = 1500.0;
/// The lowest frequency \[Hz\]; loops of position servos cross far above.
const LEAST_HZ: f64 = 0.05;
/// Halvings of the ratio between two frequencies in which a margin is read.
const HALVINGS: u32 = 20;

/// How far a loop is from swinging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// The last frequency at which the loop has a gain of 1 \[Hz\].
    pub crossover_hz: f64,
    /// Phase margin: the additional lag that it bears, the least of all crossings \[°\].
    pub phase_deg: f64,
    /// The frequency of that crossing \[Hz\]; 0 if there is none.
    pub phase_hz: f64,
    /// Gain margin: the factor by which its gain might be greater. Infinite if there is none.
    pub gain: f64,
    /// The frequency at which it is read \[Hz\]; 0 if there is none.
    pub gain_hz: f64,
    /// Greatest magnification of an error, |1/(1 + L)|.
    pub sensitivity: f64,
}

/// A drive seen from its position loop, G/s over frequency.
#[derive(Clone, Debug)]
pub struct Plant {
    drive: DriveParameters,
    tick_s: f64,
    points: Vec<(f64, Complex)>,
}

/// A loop at a frequency.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopPoint {
    pub(super) hz: f64,
    pub(super) open: Complex,
    pub(super) magnitude: f64,
    /// Its phase, without jumps from one frequency to the next \[rad\].
    pub(super) phase_rad: f64,
}

impl Plant {
    /// What a regulator in ticks of `tick_s` has to do with.
    #[must_use]
    pub fn new(drive: &DriveParameters, tick_s: f64) -> Self {
        let decades = libm::log10(0.5 / tick_s / LEAST_HZ);
        let points = (0..=(decades * PER_DECADE) as u32).map(|index| {
            let hz = LEAST_HZ * libm::pow(10.0, f64::from(index) / PER_DECADE);
            (hz, position(drive, tick_s, hz))
        });
        Self { drive: *drive, tick_s, points: points.collect() }
    }

    /// The loop that `gains` close, by rising frequency.
    pub(super) fn opened(&self, gains: Gains) -> impl Iterator<Item = LoopPoint> {
        let mut last = None;
        self.points.iter().map(move |&(hz, position)| {
            let open = feedback(&gains, self.tick_s, hz) * position;
            let point = LoopPoint::after(last, hz, open);
            last = Some(point.phase_rad);
            point
        })
    }

    /// The margins of the loop that `gains` close.
    #[must_use]
    pub fn margins(&self, gains: Gains) -> Margins {
        let mut margins = Margins {
            crossover_hz: 0.0,
            phase_deg: 180.0,
            phase_hz: 0.0,
            gain: f64::INFINITY,
            gain_hz: 0.0,
            sensitivity: 1.0,
        };
        let mut before: Option<LoopPoint> = None;
        for point in self.opened(gains) {
            let closed = Complex::new(1.0 + point.open.re, point.open.im).magnitude();
            margins.sensitivity = margins.sensitivity.max(1.0 / closed);
            if let Some(before) = before {
                if before.is_strong() != point.is_strong() {
                    let at = self.turn(gains, before, point, LoopPoint::is_strong);
                    margins.crossover_hz = at.hz;
                    let phase_deg = (PI + at.phase_rad).to_degrees();
                    if phase_deg < margins.phase_deg {
                        (margins.phase_deg, margins.phase_hz) = (phase_deg, at.hz);
                    }
                }
                if point.turns_over(&before) {
                    let at = self.turn(gains, before, point, LoopPoint::is_half_a_circle_late);
                    let gain = 1.0 / at.magnitude;
                    if gain < margins.gain {
                        (margins.gain, margins.gain_hz) = (gain, at.hz);
                    }
                }
            }
            before = Some(point);
        }
        margins
    }

    /// Where `is` changes between two frequencies. Near a bed that is hardly damped much changes between two.
    fn turn(
        &self,
        gains: Gains,
        mut before: LoopPoint,
        mut after: LoopPoint,
        is: fn(&LoopPoint) -> bool,
    ) -> LoopPoint {
        for _ in 0..HALVINGS {
            let hz = libm::sqrt(before.hz * after.hz);
            let open = open_loop(&self.drive, &gains, self.tick_s, hz);
            let middle = LoopPoint::after(Some(before.phase_rad), hz, open);
            if is(&middle) == is(&before) {
                before = middle;
            } else {
                after = middle;
            }
        }
        after
    }
}

impl LoopPoint {
    /// The loop at a frequency, behind one of phase `last_rad`.
    fn after(last_rad: Option<f64>, hz: f64, open: Complex) -> Self {
        let phase = open.phase_rad();
        // The phase never changes by half a circle from one frequency to the next. Where it begins, two integrals are
        // half a circle late and not early.
        let phase_rad = match last_rad {
            Some(last) => phase - TAU * libm::round((phase - last) / TAU),
            None if phase > PI / 2.0 => phase - TAU,
            None => phase,
        };
        Self { hz, open, magnitude: open.magnitude(), phase_rad }
    }

    /// Whether it magnifies.
    fn is_strong(&self) -> bool {
        self.magnitude >= 1.0
    }

    fn is_half_a_circle_late(&self) -> bool {
        self.phase_rad <= -PI
    }

    /// Whether the loop has become half a circle late since `before`.
    pub(super) fn turns_over(&self, before: &Self) -> bool {
        !before.is_half_a_circle_late() && self.is_half_a_circle_late()
    }
}

impl Margins {
    /// The margins of the loop that `gains` close over `drive`, in ticks of `tick_s`.
    #[must_use]
    pub fn of(drive: &DriveParameters, gains: Gains, tick_s: f64) -> Self {
        Plant::new(drive, tick_s).margins(gains)
    }

    /// The additional delay that the loop bears \[s\]: its phase margin at its crossover.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.phase_deg / 360.0 / self.crossover_hz
    }

    /// Whether a closed loop with these margins is stable: true if the gain may grow and the phase may lag.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.gain > 1.0 && self.phase_deg > 0.0
    }
}

/// G/s at a frequency \[s\]: from a velocity command to the position.
pub(super) fn position(drive: &DriveParameters, tick_s: f64, frequency_hz: f64) -> Complex {
    response(drive, tick_s, frequency_hz) / Complex::new(0.0, TAU * frequency_hz)
}

/// The position loop L = C·G/s at a frequency.
#[must_use]
pub fn open_loop(drive: &DriveParameters, gains: &Gains, tick_s: f64, frequency_hz: f64) -> Complex {
    feedback(gains, tick_s, frequency_hz) * position(drive, tick_s, frequency_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the regulator below, likewise.
    const PID: [f64; 4] = [42.356, 40.107, 2.4847, 1.9807];

    const fn p(kp_per_s: f64) -> Gains {
        Gains { kp_per_s, ki_per_s2: 0.0, kd: 0.0 }
    }

    fn close(found: &Margins, [crossover_hz, phase_deg, gain, sensitivity]: [f64; 4]) {
        assert!((found.crossover_hz - crossover_hz).abs() < 0.1, "{found:?}");
        assert!((found.phase_deg - phase_deg).abs() < 0.2, "{found:?}");
        assert!((found.gain - gain).abs() < 0.01, "{found:?}");
        assert!((found.sensitivity - sensitivity).abs() < 0.01, "{found:?}");
    }

    /// Figures of an independent computation for S4's X axis.
    #[test]
    fn margins_of_the_reference() {
        let found = Margins::of(&hal_sim::REFERENCE_X, p(230.0), 5e-4);
        close(&found, [36.291, 38.559, 2.186, 2.298]);
        assert!(found.is_stable() && !Margins::of(&hal_sim::REFERENCE_X, p(230.0 * 2.25), 5e-4).is_stable());
        let pid = Gains { kp_per_s: 262.0, ki_per_s2: 15_700.0, kd: 0.4 };
        close(&Margins::of(&hal_sim::REFERENCE_X, pid, 5e-4), PID);
    }

    /// Between two of the frequencies that are looked at, a bed that is hardly damped changes the loop by a tenth. Its margin is
    /// that of an independent search at 200 000 frequencies per decade.
    #[test]
    fn a_sharp_bed_has_its_margin() {
        for (off, gain) in [(0.0, 2.1954), (4e-4, 2.196), (8e-4, 2.1947), (1.2e-3, 2.1935)] {
            let bed = hal_sim::BedMode {
                frequency_hz: 27.24 * (1.0 + off),
                damping_ratio: 0.005,
                mass_ratio: 0.33,
            };
            let drive = DriveParameters {
                velocity_gain_per_s: 765.5,
                integral_time_s: 0.0125,
                current_lag_s: 7.86e-4,
                dead_time_s: 1.596e-3,
                bed: Some(bed),
                ..hal_sim::REFERENCE_X
            };
            let found = Margins::of(&drive, p(118.0), 5e-4);
            println!("{found:?}");
            assert!((found.gain - gain).abs() < 3e-3, "{found:?}");
        }
    }
}
