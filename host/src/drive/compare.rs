//! Regulators side by side, on the same axes and the same path.
//!
//! Every regulator has the machine's kp as its only feedback, the machine's output limits, and set values of
//! the same plan. They differ only in feedforward:
//!
//! - [`Choice::P`] has none, [`Choice::Pv`] the velocity's;
//! - [`Choice::Peer`] differences position commands ([`peer_regulator`](super::peer_regulator)); its gains
//!   are those of [`Choice::Vaj`], less what differencing adds, so that with exact set positions it does the
//!   same;
//! - [`Choice::Vaj`] has the set-points' own velocity, acceleration and jerk, with the machine's gains;
//! - [`Choice::PeerFitted`] and [`Choice::VajFitted`] have the gains with the least following error
//!   ([`fit`]), one fit for both; [`Choice::PeerFittedTwo`] omits the third difference, as is usual with
//!   coarse set-points;
//! - [`Choice::Inverse`] inverts the drive: with the machine file's inverse, or, if it has none, with the
//!   simulated drive's own figures, which identification finds within a few per cent.
//!
//! The kernel's regulators run in the kernel. With coarser set-points all of them are
//! [replayed](super::replay).

use motion_kernel::axis::Feedforward;

use super::AXES;
use super::circle;
use super::circle_motion::Circle;
use super::experiment::{CLOSED_LOOP_ERROR_MM, DriveError, Recording, Terms};
use super::inverse::inverse;
use super::peer_regulator::PeerGains;
use super::replay::{Law, Replayed, replay};
use crate::machine::Machine;

/// Frequencies at which the differencing regulator's gains are fitted \[Hz\].
pub const FIT_HZ: [f64; 3] = [4.0, 10.0, 16.0];
/// The fit is linear but for friction: this many rounds settle it.
const FIT_ROUNDS: usize = 2;
/// Steps of the fit's difference quotients: FF2 \[s\] and FF3 \[s²\].
const FIT_STEPS: [f64; 2] = [1e-4, 5e-6];
/// An axis that moves less than this over the measured time does not count \[mm\].
const AT_REST_MM: f64 = 1e-6;

/// A regulator to be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Following error only.
    P,
    /// Following error and the set-point's velocity.
    Pv,
    /// Differenced position commands, gains as [`Choice::Vaj`].
    Peer,
    /// Differenced position commands without the third difference, fitted.
    PeerFittedTwo,
    /// Differenced position commands, fitted.
    PeerFitted,
    /// Velocity, acceleration and jerk of the set-point, the machine's gains.
    Vaj,
    /// Velocity, acceleration and jerk of the set-point, fitted.
    VajFitted,
    /// The drive's inverse, with preview.
    Inverse,
}

impl Choice {
    /// All choices, in the order of tables.
    pub const ALL: [Self; 8] = [
        Self::P,
        Self::Pv,
        Self::Peer,
        Self::Vaj,
        Self::PeerFittedTwo,
        Self::PeerFitted,
        Self::VajFitted,
        Self::Inverse,
    ];

    /// The regulators that pictures show.
    pub const SHOWN: [Self; 7] =
        [Self::P, Self::Pv, Self::Peer, Self::Vaj, Self::PeerFitted, Self::VajFitted, Self::Inverse];

    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::P => "P",
            Self::Pv => "P + V",
            Self::Peer => "P + FF1–FF3 differenced",
            Self::Vaj => "P + V + A + J",
            Self::PeerFittedTwo => "P + FF1, FF2 differenced, fitted",
            Self::PeerFitted => "P + FF1–FF3 differenced, fitted",
            Self::VajFitted => "P + V + A + J, fitted",
            Self::Inverse => "P + inverse with preview",
        }
    }
}

/// The regulators of a machine, ready to run.
#[derive(Clone, Debug)]
pub struct Regulators {
    machine: Machine,
    /// Fitted gains of each axis.
    pub fitted: [PeerGains; AXES],
    /// Fitted gains without the third difference.
    pub fitted_two: [PeerGains; AXES],
}

impl Regulators {
    /// The regulators of `machine`, fitted on circles of `feed_mm_s` \[mm/s\]. `progress` is called after
    /// each of [`Regulators::STEPS`] steps.
    ///
    /// # Errors
    /// Those of [`Circle::record`].
    pub fn new(machine: &Machine, feed_mm_s: f64, progress: &mut dyn FnMut()) -> Result<Self, DriveError> {
        let machine = with_room(machine);
        let fitted = fit(&machine, feed_mm_s, Differences::Three, progress)?;
        let fitted_two = fit(&machine, feed_mm_s, Differences::Two, progress)?;
        Ok(Self { machine, fitted, fitted_two })
    }

    /// Steps of [`Regulators::new`].
    pub const STEPS: usize = 2 * FIT_HZ.len() * FIT_ROUNDS;

    /// The machine on which `choice` runs through the kernel, or whose set positions it is told.
    #[must_use]
    pub fn machine(&self, choice: Choice) -> Machine {
        let tick_s = self.machine.tick_s;
        let mut machine = match choice {
            Choice::Pv => Terms::V.of(&self.machine),
            Choice::Inverse => return with_inverse(&self.machine),
            _ => Terms::Vaj.of(&self.machine),
        };
        for (axis, fitted) in machine.axes.iter_mut().zip(&self.fitted) {
            match choice {
                Choice::P => axis.feedforward = Feedforward::default(),
                Choice::VajFitted => axis.feedforward = fitted.analytic(tick_s),
                _ => {}
            }
        }
        machine
    }

    /// The regulator.
    #[must_use]
    pub fn law(&self, choice: Choice) -> Law {
        match choice {
            Choice::Peer => Law::Peer(peer_gains(&self.machine)),
            Choice::PeerFitted => Law::Peer(self.fitted),
            Choice::PeerFittedTwo => Law::Peer(self.fitted_two),
            _ => Law::Kernel,
        }
    }

    /// `choice` on `motion` with set positions in steps of each of `resolutions_um` \[µm\].
    ///
    /// # Errors
    /// Those of [`Circle::record`], and a resolution out of its range.
    pub fn measure(
        &self,
        choice: Choice,
        motion: &Motion,
        resolutions_um: &[f64],
    ) -> Result<Vec<Measured>, DriveError> {
        let recording = motion.record(&self.machine(choice))?;
        let law = self.law(choice);
        let exact = replay(&recording, &law, 0.0)?;
        let mut all = vec![Measured::of(motion, 0.0, &exact, &exact)?];
        for &resolution_um in resolutions_um {
            let coarse = replay(&recording, &law, resolution_um / 1e3)?;
            all.push(Measured::of(motion, resolution_um, &coarse, &exact)?);
        }
        Ok(all)
    }

    /// Output of the axis that moves first, with set positions in steps of `resolution_um` \[µm\]: time from
    /// the start of the measured part \[s\] and volts, for `duration_s`.
    ///
    /// # Errors
    /// Those of [`Circle::record`], and a resolution out of its range.
    pub fn output(
        &self,
        choice: Choice,
        circle: &Circle,
        resolution_um: f64,
        duration_s: f64,
    ) -> Result<Vec<(f64, f64)>, DriveError> {
        let recording = circle.record(&self.machine(choice))?;
        let replayed = replay(&recording, &self.law(choice), resolution_um / 1e3)?.recording;
        let [first, _] = circle.axes();
        let times = (0_u32..).map(|tick| f64::from(tick) * replayed.tick_s());
        let ticks = circle.measured(&replayed)?;
        let points = times.zip(ticks).map(|(time_s, tick)| (time_s, tick.axes[first].out_v));
        Ok(points.take_while(|point| point.0 <= duration_s).collect())
    }
}

/// A regulator over frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The regulator.
    pub choice: Choice,
    /// Frequency \[Hz\], and the figures on that circle.
    pub circles: Vec<(f64, Measured)>,
}

/// A regulator on every motion, with one resolution of set positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The regulator.
    pub choice: Choice,
    /// Steps of the set positions \[µm\]; 0 if they were exact.
    pub resolution_um: f64,
    /// The figures, by motion.
    pub measured: Vec<Measured>,
}

/// All regulators on `motions`, with exact set positions and in steps of each of `resolutions_um` \[µm\].
/// `progress` is called after each regulator.
///
/// # Errors
/// Those of [`Regulators::measure`].
pub fn rows(
    regulators: &Regulators,
    motions: &[Motion],
    resolutions_um: &[f64],
    progress: &mut dyn FnMut(),
) -> Result<Vec<Row>, DriveError> {
    let mut rows = Vec::new();
    for choice in Choice::ALL {
        let exact_and_steps = core::iter::once(0.0).chain(resolutions_um.iter().copied());
        let mut of: Vec<Row> = exact_and_steps
            .map(|resolution_um| Row { choice, resolution_um, measured: Vec::new() })
            .collect();
        for motion in motions {
            let measured = regulators.measure(choice, motion, resolutions_um)?;
            of.iter_mut().zip(measured).for_each(|(row, measured)| row.measured.push(measured));
        }
        rows.append(&mut of);
        progress();
    }
    Ok(rows)
}

/// The regulators of [`Choice::SHOWN`] on circles of `frequencies_hz` with set positions in steps of
/// `resolution_um` \[µm\]. `progress` is called after each regulator.
///
/// # Errors
/// Those of [`Regulators::measure`].
pub fn sweeps(
    regulators: &Regulators,
    feed_mm_s: f64,
    frequencies_hz: &[f64],
    resolution_um: f64,
    progress: &mut dyn FnMut(),
) -> Result<Vec<Sweep>, DriveError> {
    let mut sweeps = Vec::with_capacity(Choice::SHOWN.len());
    for choice in Choice::SHOWN {
        let mut circles = Vec::with_capacity(frequencies_hz.len());
        for &frequency_hz in frequencies_hz {
            let circle = Motion::Circle(Circle::new(frequency_hz, feed_mm_s));
            let measured = regulators.measure(choice, &circle, &[resolution_um])?;
            circles.extend(measured.last().map(|&last| (frequency_hz, last)));
        }
        sweeps.push(Sweep { choice, circles });
        progress();
    }
    Ok(sweeps)
}

/// The motion of the axes.
#[derive(Clone, Debug)]
pub enum Motion {
    /// A circle at constant feed; measured when it has settled.
    Circle(Circle),
    /// A program (name, G-code), with the machine's own limits; measured from its first to its last tick.
    Program(&'static str, &'static str),
}

impl Motion {
    /// The name in tables.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Circle(circle) => {
                format!("circle at {} Hz, {} mm/min", circle.frequency_hz, circle.feed_mm_s * 60.0)
            }
            Self::Program(name, _) => (*name).to_owned(),
        }
    }

    fn record(&self, machine: &Machine) -> Result<Recording, DriveError> {
        match self {
            Self::Circle(circle) => circle.record(machine),
            Self::Program(name, text) => {
                Recording::of((*name).to_owned(), text, machine.clone(), machine.path.feed_mm_s)
            }
        }
    }

    fn measured(&self, recording: &Recording) -> Result<core::ops::Range<usize>, DriveError> {
        match self {
            Self::Circle(circle) => recording.steady(circle.settle_s, circle.span_s()),
            Self::Program(..) => Ok(0..recording.ticks.len()),
        }
    }
}

/// The figures of a regulator on a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Steps of the set positions \[µm\]; 0 if they were exact.
    pub resolution_um: f64,
    /// Greatest |following error| of any axis, against the exact set positions \[µm\].
    pub following_um: f64,
    /// Greatest contour error \[µm\].
    pub contour_um: f64,
    /// Greatest rms, over the axes that move, of the output minus the output with exact set positions \[V\].
    pub output_noise_v: f64,
    /// The same for the drive's current, as a fraction of its limit.
    pub current_noise: f64,
}

impl Measured {
    fn of(
        motion: &Motion,
        resolution_um: f64,
        found: &Replayed,
        exact: &Replayed,
    ) -> Result<Self, DriveError> {
        let range = motion.measured(&found.recording)?;
        let ticks = &found.recording.ticks[range.clone()];
        let exact_ticks = &exact.recording.ticks[range.clone()];
        let axes = || ticks.iter().flat_map(|tick| &tick.axes);
        let contour_um = match motion {
            Motion::Circle(circle) => circle::figures(&found.recording, circle)?.contour_um(),
            Motion::Program(..) => ticks.iter().map(|tick| tick.contour_um).fold(0.0, f64::max),
        };
        let (mut output_noise_v, mut current_noise) = (0.0_f64, 0.0_f64);
        for axis in 0..AXES {
            let set = || ticks.iter().map(|tick| tick.axes[axis].set_mm);
            let travel_mm = set().fold(f64::MIN, f64::max) - set().fold(f64::MAX, f64::min);
            if !(travel_mm > AT_REST_MM) {
                continue;
            }
            let volts = ticks.iter().zip(exact_ticks).map(|(a, b)| a.axes[axis].out_v - b.axes[axis].out_v);
            output_noise_v = output_noise_v.max(rms(volts));
            let limit_mm_s2 = found.recording.machine.axes[axis].drive.accel_limit_mm_s2;
            let torques = found.torque_mm_s2[range.clone()].iter().zip(&exact.torque_mm_s2[range.clone()]);
            current_noise = current_noise.max(rms(torques.map(|(a, b)| a[axis] - b[axis])) / limit_mm_s2);
        }
        Ok(Self {
            resolution_um,
            following_um: axes().map(|axis| axis.err_um.abs()).fold(0.0, f64::max),
            contour_um,
            output_noise_v,
            current_noise,
        })
    }
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

/// The machine with room for the following error of feedback alone.
fn with_room(machine: &Machine) -> Machine {
    let mut machine = machine.clone();
    for axis in &mut machine.axes {
        axis.following_error_limit_mm = axis.following_error_limit_mm.max(CLOSED_LOOP_ERROR_MM);
    }
    machine
}

/// The differencing regulator with the machine's gains.
fn peer_gains(machine: &Machine) -> [PeerGains; AXES] {
    machine.axes.each_ref().map(|axis| PeerGains {
        p_per_s: axis.gains.kp_per_s,
        i_per_s2: axis.gains.ki_per_s2,
        d: axis.gains.kd,
        ..PeerGains::like(&axis.feedforward, machine.tick_s)
    })
}

/// The differences that a fit uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Differences {
    /// FF2; FF3 is 0.
    Two,
    /// FF2 and FF3.
    Three,
}

/// FF2 and FF3 of every axis with the least rms following error, over circles of [`FIT_HZ`] with exact set
/// positions; FF1 stays the machine's. Axes that no circle moves keep the machine's gains.
///
/// # Errors
/// Those of [`Circle::record`].
pub fn fit(
    machine: &Machine,
    feed_mm_s: f64,
    differences: Differences,
    progress: &mut dyn FnMut(),
) -> Result<[PeerGains; AXES], DriveError> {
    let machine = Terms::Vaj.of(machine);
    let mut gains = peer_gains(&machine);
    if differences == Differences::Two {
        gains = gains.map(|gains| PeerGains { ff3_s2: 0.0, ..gains });
    }
    let mut circles = Vec::with_capacity(FIT_HZ.len());
    for frequency_hz in FIT_HZ {
        let circle = Circle::new(frequency_hz, feed_mm_s);
        circles.push((circle, circle.record(&machine)?));
    }
    for _ in 0..FIT_ROUNDS {
        // Normal equations of ε + ∂ε/∂FF2·x + ∂ε/∂FF3·y = 0 for every axis: Σ of products of ε and its
        // derivatives.
        let mut sums = [[[0.0_f64; 3]; 3]; AXES];
        for (circle, recording) in &circles {
            let errors = |change: [f64; 2]| -> Result<Vec<[f64; AXES]>, DriveError> {
                let changed = gains.map(|gains| PeerGains {
                    ff2_s: gains.ff2_s + change[0],
                    ff3_s2: gains.ff3_s2 + change[1],
                    ..gains
                });
                let found = replay(recording, &Law::Peer(changed), 0.0)?.recording;
                let ticks = circle.measured(&found)?;
                Ok(ticks.iter().map(|tick| tick.axes.map(|axis| axis.err_um)).collect())
            };
            let base = errors([0.0, 0.0])?;
            let second = errors([FIT_STEPS[0], 0.0])?;
            let third = errors([0.0, FIT_STEPS[1]])?;
            for ((base, second), third) in base.iter().zip(&second).zip(&third) {
                for (axis, sums) in sums.iter_mut().enumerate() {
                    let parts = [second[axis] - base[axis], third[axis] - base[axis], base[axis]];
                    for (row, sums) in parts.iter().zip(sums.iter_mut()) {
                        for (column, sum) in parts.iter().zip(sums.iter_mut()) {
                            *sum += row * column;
                        }
                    }
                }
            }
            progress();
        }
        for (gains, sums) in gains.iter_mut().zip(&sums) {
            let [[aa, ab, ae], [_, bb, be], _] = sums;
            let determinant = aa * bb - ab * ab;
            // An axis at rest shows no error to learn from.
            if differences == Differences::Two {
                gains.ff2_s -= if *aa > 0.0 { FIT_STEPS[0] * ae / aa } else { 0.0 };
            } else if determinant > 1e-6 * aa * bb {
                gains.ff2_s -= FIT_STEPS[0] * (bb * ae - ab * be) / determinant;
                gains.ff3_s2 -= FIT_STEPS[1] * (aa * be - ab * ae) / determinant;
            }
        }
    }
    Ok(gains)
}

/// The machine with an inverse of every drive that its file does not invert.
#[must_use]
pub fn with_inverse(machine: &Machine) -> Machine {
    let mut machine = machine.clone();
    for axis in &mut machine.axes {
        if axis.feedforward.drive.is_none() {
            axis.feedforward = inverse(&axis.drive, machine.tick_s);
        }
    }
    machine
}
