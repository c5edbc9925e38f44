//! Iterative learning: a path that is driven repeatedly is followed better every time.
//!
//! **Consumes** a [`Motion`] that can be repeated, a model of every axis's drive and [`LearningOptions`].
//! **Produces** [`Learnt`]: the figures of every repeat and the best correction, a bounded table of velocity
//! commands that the kernel adds over the stretch ([`StretchCorrection`]). **Runs** in the background,
//! between repeats. **Fails** with a [`DriveError`] before anything moves if a quantity is out of its range
//! or the law would not converge, and if the first run fails; a fault in a later run ends learning with the
//! best correction.
//!
//! After each repeat u′ = Q·(u + L·e) for every axis over the whole stretch, including its start and end: e
//! is the recorded following error, L the model's inverse, Q a zero-phase low-pass. `law` has the formulas
//! and the bound on divergence, which is stated in [`Robustness`]. Four more rules keep it from diverging
//! where the bound does not hold, at friction and at the current limit: no command is above the correction's
//! bound; a repeat that made the error larger is undone, and half the step is tried from the best one;
//! learning stops when it no longer improves; and the best correction that was driven is returned. The
//! contour error may rise while the following error falls, because it is small when two axes lag alike (up to
//! four times as much after one repeat, at 40 Hz).
//!
//! - [`motion`](mod@motion): motions that can be repeated;
//! - `law`: L, Q and the bound;
//! - `fourier`: the transform they are applied in.
//!
//! ```no_run
//! use motion_host::drive::{Terms, learning, circle_motion::Circle};
//! use motion_host::machine::Machine;
//!
//! let machine = Terms::Vaj.of(&Machine::reference());
//! let models = machine.axes.each_ref().map(|axis| axis.drive.into());
//! let circle = Circle::new(10.0, 2150.0 / 60.0);
//! let learnt = learning::learn(&machine, &circle, &models, &learning::LearningOptions::default())?;
//! let best = learnt.repeats[learnt.best_repeat];
//! println!("{:.2} µm after {} repeats", best.contour_um, learnt.best_repeat);
//! # Ok::<(), motion_host::drive::DriveError>(())
//! ```

use hal_sim::DriveParameters;
use motion_kernel::axis::KNOT_TICKS_MAX;

use super::experiment::{DriveError, Recording, within};
use crate::drive::AXES;
use crate::machine::Machine;
use crate::simulate::{Number, RunError, RunOptions, StretchCorrection};
use crate::trace::{TraceRow, TracedFault};

pub mod motion;

mod fourier;
mod law;

pub use law::{CONTRACTION_MAX, FILTER_ORDER, Filter, Robustness, SPREAD};
pub use motion::{Motion, Stretch};

use law::{CORNER_HZ_MIN, Law, Loop};

/// The knowledge of an axis' drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The drive.
    pub drive: DriveParameters,
    /// Actual over nominal scale of its commands, 0.01 to 100.
    pub command_gain: f64,
}

impl From<DriveParameters> for Model {
    /// A drive whose scale is that of the machine file.
    fn from(drive: DriveParameters) -> Self {
        Self { drive, command_gain: 1.0 }
    }
}

/// Longest stretch that is learnt \[ticks\]: 131 s at 0.5 ms.
pub const STRETCH_TICKS_MAX: usize = 1 << 18;

/// Transforms are longer than the stretch by this: the inverse reaches some periods of the loop to either
/// side \[s\].
const MARGIN_S: f64 = 0.2;
/// Fraction of an encoder step by which a total error must grow to count as larger; less is reading noise.
const NOISE_STEPS: f64 = 0.25;
/// The factor of the step after a repeat that made the error larger.
const STEP_BACK: f64 = 0.5;
/// Learning stops after this many repeats in a row that are no better than the best before.
const NO_BETTER: usize = 2;

/// How to learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningOptions {
    /// Most repeats with a correction, 1 to 1000.
    pub repeats: usize,
    /// γ: fraction of the error that a repeat removes, 0.01 to 1. Below 1, random differences between repeats
    /// are averaged, and the first step does not overdrive a drive at its current limit.
    pub gain: f64,
    /// Ticks from knot to knot of the correction, 1 to 1000.
    pub knot_ticks: u16,
    /// Greatest velocity command of the correction \[mm/s\], above 0, below 10⁶; larger commands are cut and
    /// counted in [`RepeatFigures::cut_ticks`]. None: the greatest command of the run without correction, of
    /// any axis, so that all of feedforward could be undone, plus the command that Coulomb friction takes at
    /// reversal, 2·a_c/Kv.
    pub bound_mm_s: Option<f64>,
    /// −3 dB of Q \[Hz\], 1 to a quarter of the knots' rate; refused if the law does not converge with it for
    /// every machine within [`SPREAD`]. None: the highest with which a repeat leaves at most
    /// [`CONTRACTION_MAX`].
    pub corner_hz: Option<f64>,
    /// The rule by which learning ends before all repeats are made.
    pub ending: Ending,
    /// The kernel's number type.
    pub number: Number,
}

impl Default for LearningOptions {
    /// Up to 10 repeats, γ = 0.8, a knot every 4 ticks; ends when learnt.
    fn default() -> Self {
        Self {
            repeats: 10,
            gain: 0.8,
            knot_ticks: 4,
            bound_mm_s: None,
            corner_hz: None,
            ending: Ending::Learnt,
            number: Number::default(),
        }
    }
}

/// The end of learning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ending {
    /// Learning ends when the error is below the encoder's step, or two repeats in a row were no better than
    /// the best before.
    #[default]
    Learnt,
    /// Learning makes all repeats, to see whether it would diverge.
    Repeats,
}

/// Why learning ended.
#[derive(Clone, Debug)]
pub enum Reason {
    /// All repeats were made.
    Repeats,
    /// The rms following error of every axis is at most one step of its encoder.
    Resolved,
    /// Two repeats in a row were no better than the best before.
    NoBetter,
    /// A repeat ended in a fault; its correction is not the best.
    Fault(TracedFault),
}

/// The figures of a run of the stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepeatFigures {
    /// Root of the mean square of the following error over the whole stretch, by axis \[µm\].
    pub rms_um: [f64; AXES],
    /// The motion's contour error: see [`Motion::contour_um`] \[µm\].
    pub contour_um: f64,
    /// The number of ticks in which the bound cut the correction of this run, by axis.
    pub cut_ticks: [usize; AXES],
    /// The part of γ with which this run's correction was learnt: 1, halved by every repeat that had to be
    /// taken back.
    pub step: f64,
}

impl RepeatFigures {
    /// Root of the sum of the axes' squares: the length of the error \[µm\].
    #[must_use]
    pub fn total_um(&self) -> f64 {
        self.rms_um.iter().map(|rms_um| rms_um * rms_um).sum::<f64>().sqrt()
    }

    /// Whether it is better than `other`, and no farther from the path than `first`.
    fn is_better(&self, other: &Self, first: &Self) -> bool {
        self.total_um() < other.total_um() && self.contour_um <= first.contour_um
    }
}

/// The result of learning.
#[derive(Clone, Debug)]
pub struct Learnt {
    /// The figures of every run: the first one without correction, then by repeat.
    pub repeats: Vec<RepeatFigures>,
    /// The best of them: the least total error among those whose contour error is not above the first one's.
    /// 0: none was better than no correction.
    pub best_repeat: usize,
    /// The correction of that run; without knots if there was none.
    pub best: StretchCorrection,
    /// The bound on convergence, by axis; `None` for an axis that did not move.
    pub robustness: [Option<Robustness>; AXES],
    /// Why learning ended.
    pub stopped: Reason,
}

/// Repeats `motion` on `machine` and learns a correction of its stretch, by the drives' `models`: identified
/// ones, or those of the machine file. They may be ± 20 % off.
///
/// # Errors
/// A quantity is out of its range, the law would not converge with the filter or with any, or the run without
/// correction fails.
pub fn learn<M: Motion + ?Sized>(
    machine: &Machine,
    motion: &M,
    models: &[Model; AXES],
    options: &LearningOptions,
) -> Result<Learnt, DriveError> {
    options.check(machine)?;
    for model in models {
        check_model(model)?;
    }
    let first = motion.record(&RunOptions { number: options.number, ..RunOptions::default() }, machine)?;
    let mut learning = Learning::new(&first, motion, models, options)?;
    let mut repeats = vec![learning.take(&first, motion)?];
    let (mut best_repeat, mut best) = (0, learning.correction());
    best.knots_mm_s.clear();
    let stopped = loop {
        let is_learning = options.ending == Ending::Learnt;
        if repeats.len() > options.repeats {
            break Reason::Repeats;
        }
        if is_learning && learning.is_resolved(&repeats) {
            break Reason::Resolved;
        }
        if is_learning && is_no_better(&repeats) {
            break Reason::NoBetter;
        }
        learning.update();
        let correction = learning.correction();
        let run =
            RunOptions { number: options.number, correction: Some(&correction), ..RunOptions::default() };
        let recording = match motion.record(&run, machine) {
            Ok(recording) => recording,
            Err(DriveError::Fault { fault, .. }) => break Reason::Fault(fault),
            Err(error) => return Err(error),
        };
        let figures = learning.take(&recording, motion)?;
        if figures.is_better(&repeats[best_repeat], &repeats[0]) {
            (best_repeat, best) = (repeats.len(), correction);
        }
        repeats.push(figures);
    };
    Ok(Learnt { repeats, best_repeat, best, robustness: learning.robustness, stopped })
}

/// Whether none of the last repeats is better than the best one before them.
fn is_no_better(repeats: &[RepeatFigures]) -> bool {
    let (before, last) = repeats.split_at(repeats.len().saturating_sub(NO_BETTER));
    let least_um =
        |repeats: &[RepeatFigures]| repeats.iter().map(RepeatFigures::total_um).fold(f64::INFINITY, f64::min);
    !before.is_empty() && least_um(last) >= least_um(before)
}

fn check_model(model: &Model) -> Result<(), DriveError> {
    use hal_sim::ParameterError::{NotFinite, OutOfRange};
    within("command gain", model.command_gain, (0.01, 100.0))?;
    let expected = || "a number within the range of the drive's model".to_owned();
    match model.drive.check() {
        Ok(()) => Ok(()),
        Err(NotFinite { quantity, value } | OutOfRange { quantity, value }) => {
            Err(DriveError::Quantity { quantity, value, expected: expected() })
        }
        Err(other) => Err(RunError::Simulation(other.to_string()).into()),
    }
}

impl LearningOptions {
    /// Checks that all options are in range on `machine`; [`learn`] does the same.
    ///
    /// # Errors
    /// The first quantity that is not.
    pub fn check(&self, machine: &Machine) -> Result<(), DriveError> {
        within("repeats", self.repeats as f64, (1.0, 1000.0))?;
        within("learning gain", self.gain, (0.01, 1.0))?;
        within("ticks from knot to knot", f64::from(self.knot_ticks), (1.0, f64::from(KNOT_TICKS_MAX)))?;
        if let Some(bound_mm_s) = self.bound_mm_s {
            within("bound of the correction [mm/s]", bound_mm_s, (1e-6, 999_999.0))?;
        }
        let drive = &machine.axes[0].drive;
        let gains = machine.axes[0].gains;
        let (tick_s, knot_ticks) = (machine.tick_s, self.knot_ticks);
        let most_hz = Loop { drive, command_gain: 1.0, gains, tick_s, knot_ticks }.corner_hz_max();
        within("knots' rate over 4 [Hz]", most_hz, (CORNER_HZ_MIN, f64::INFINITY))?;
        if let Some(corner_hz) = self.corner_hz {
            within("−3 dB of the learning filter [Hz]", corner_hz, (CORNER_HZ_MIN, most_hz))?;
        }
        Ok(())
    }
}

/// The state between two repeats.
struct Learning {
    stretch: Stretch,
    knot_ticks: u16,
    bound_mm_s: f64,
    laws: [Option<Law>; AXES],
    robustness: [Option<Robustness>; AXES],
    /// The encoders' steps \[µm\].
    steps_um: [f64; AXES],
    /// The correction in every tick of the stretch, before it is reduced to knots.
    commands_mm_s: [Vec<f64>; AXES],
    cut_ticks: [usize; AXES],
    step: f64,
    /// The run with the least total error, from which the next correction is made.
    base: Option<Base>,
}

struct Base {
    total_um: f64,
    commands_mm_s: [Vec<f64>; AXES],
    errors_mm: [Vec<f64>; AXES],
}

impl Learning {
    fn new<M: Motion + ?Sized>(
        first: &Recording,
        motion: &M,
        models: &[Model; AXES],
        options: &LearningOptions,
    ) -> Result<Self, DriveError> {
        let stretch = motion.stretch(first);
        let ticks = stretch_ticks(first, &stretch);
        within("ticks of the stretch", ticks.len() as f64, (2.0, STRETCH_TICKS_MAX as f64))?;
        let margin_ticks = (MARGIN_S / first.tick_s()).ceil() as usize;
        let mut robustness = [None; AXES];
        let mut laws = [const { None }; AXES];
        let mut bound_mm_s = 0.0_f64;
        for (axis, (model, settings)) in models.iter().zip(&first.machine.axes).enumerate() {
            let velocity_mm_s = |tick: &TraceRow| tick.axes[axis].vel_mm_s.abs();
            let fastest_mm_s = ticks.iter().map(velocity_mm_s).fold(0.0, f64::max);
            // An axis at rest could only learn its encoder's noise.
            if fastest_mm_s <= 0.0 {
                continue;
            }
            let knot_ticks = options.knot_ticks;
            let &Model { ref drive, command_gain } = model;
            let (gains, tick_s) = (settings.gains, first.tick_s());
            let axis_loop = Loop { drive, command_gain, gains, tick_s, knot_ticks };
            let found = axis_loop.robustness(options.gain, options.corner_hz);
            if !(found.contraction < 1.0) {
                let quantity = "greatest |Q(1 − L·P)| of the learning law";
                let expected =
                    "a number below 1: a lower −3 dB, or feedback gains with more margin".to_owned();
                return Err(DriveError::Quantity { quantity, value: found.contraction, expected });
            }
            robustness[axis] = Some(found);
            let lengths = (ticks.len(), margin_ticks);
            laws[axis] = Some(Law::new(&axis_loop, options.gain, found.filter, lengths));
            let friction_mm_s = drive.coulomb_friction_mm_s2 / drive.velocity_gain_per_s / command_gain;
            let greatest_v = ticks
                .iter()
                .map(|tick| (tick.axes[axis].out_v - settings.output_offset_v).abs())
                .fold(0.0, f64::max);
            let command_mm_s = greatest_v * settings.mm_s_at_10_v.abs() / 10.0;
            bound_mm_s = bound_mm_s.max(command_mm_s + 2.0 * friction_mm_s);
        }
        if laws.iter().all(Option::is_none) {
            let axis = first.machine.axes.each_ref().map(|axis| axis.name.as_str()).join(", ");
            return Err(DriveError::NoMotion { experiment: first.experiment.clone(), axis });
        }
        Ok(Self {
            knot_ticks: options.knot_ticks,
            bound_mm_s: options.bound_mm_s.unwrap_or(bound_mm_s),
            laws,
            robustness,
            steps_um: first.machine.axes.each_ref().map(|axis| axis.mm_per_count.abs() * 1e3),
            commands_mm_s: core::array::from_fn(|_| vec![0.0; ticks.len()]),
            cut_ticks: [0; AXES],
            step: 1.0,
            base: None,
            stretch,
        })
    }

    /// Makes the next correction, from the base's error.
    fn update(&mut self) {
        let Some(base) = &self.base else { return };
        for (axis, law) in self.laws.iter().enumerate() {
            let Some(law) = law else { continue };
            let mut commands_mm_s = law.next(&base.commands_mm_s[axis], &base.errors_mm[axis], self.step);
            self.cut_ticks[axis] = 0;
            // The part that is cut is also forgotten: the next repeat continues from the correction that
            // acted.
            for command_mm_s in &mut commands_mm_s {
                if command_mm_s.abs() > self.bound_mm_s {
                    *command_mm_s = self.bound_mm_s.copysign(*command_mm_s);
                    self.cut_ticks[axis] += 1;
                }
            }
            self.commands_mm_s[axis] = commands_mm_s;
        }
    }

    /// The commands as a table: a knot every few ticks, and one at the end.
    fn correction(&self) -> StretchCorrection {
        let length = self.commands_mm_s[0].len();
        let at = |tick: usize| {
            self.commands_mm_s.each_ref().map(|commands| commands.get(tick).copied().unwrap_or_default())
        };
        let mut knots_mm_s: Vec<_> = (0..length).step_by(usize::from(self.knot_ticks)).map(at).collect();
        knots_mm_s.push(at(length - 1));
        StretchCorrection {
            stretch: self.stretch.index,
            knot_ticks: self.knot_ticks,
            knots_mm_s,
            bound_mm_s: self.bound_mm_s,
        }
    }

    /// The figures of a run with the correction at hand, which becomes the base unless it made the error
    /// larger.
    fn take<M: Motion + ?Sized>(
        &mut self,
        recording: &Recording,
        motion: &M,
    ) -> Result<RepeatFigures, DriveError> {
        let ticks = stretch_ticks(recording, &motion.stretch(recording));
        let expected = self.commands_mm_s[0].len() as f64;
        // A different length is a different motion, to which the correction does not apply.
        within("ticks of the repeated stretch", ticks.len() as f64, (expected, expected))?;
        let errors_mm: [Vec<f64>; AXES] =
            core::array::from_fn(|axis| ticks.iter().map(|tick| tick.axes[axis].err_um * 1e-3).collect());
        let rms_um = core::array::from_fn(|axis| {
            let squares: f64 = errors_mm[axis].iter().map(|error_mm| error_mm * error_mm).sum();
            if self.laws[axis].is_some() { 1e3 * (squares / expected).sqrt() } else { 0.0 }
        });
        let contour_um = motion.contour_um(recording)?;
        let figures = RepeatFigures { rms_um, contour_um, cut_ticks: self.cut_ticks, step: self.step };
        let total_um = figures.total_um();
        let noise_um = NOISE_STEPS * self.steps_um.iter().copied().fold(0.0, f64::max);
        if self.base.as_ref().is_some_and(|base| total_um > base.total_um + noise_um) {
            self.step *= STEP_BACK;
        } else {
            // Within the noise the base moves on, but keeps the least error so far, which therefore can't
            // creep upwards.
            let total_um = self.base.as_ref().map_or(total_um, |base| base.total_um.min(total_um));
            self.base = Some(Base { total_um, commands_mm_s: self.commands_mm_s.clone(), errors_mm });
        }
        Ok(figures)
    }

    fn is_resolved(&self, repeats: &[RepeatFigures]) -> bool {
        let is_small = |figures: &RepeatFigures| {
            figures.rms_um.iter().zip(self.steps_um).all(|(&rms_um, step_um)| rms_um <= step_um)
        };
        repeats.last().is_some_and(is_small)
    }
}

fn stretch_ticks<'run>(recording: &'run Recording, stretch: &Stretch) -> &'run [TraceRow] {
    recording.ticks.get(stretch.ticks.clone()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(total_um: f64, contour_um: f64) -> RepeatFigures {
        RepeatFigures { rms_um: [total_um, 0.0, 0.0], contour_um, cut_ticks: [0; AXES], step: 1.0 }
    }

    #[test]
    fn two_in_a_row_that_are_no_better_end_it() {
        let ends = |totals: &[f64]| {
            is_no_better(&totals.iter().map(|&total_um| run(total_um, 1.0)).collect::<Vec<_>>())
        };
        assert!(!ends(&[5.0]) && !ends(&[5.0, 6.0]) && !ends(&[5.0, 6.0, 4.0]) && !ends(&[5.0, 3.0, 4.0]));
        assert!(ends(&[5.0, 6.0, 7.0]) && ends(&[5.0, 7.0, 6.0]) && ends(&[9.0, 3.0, 3.0, 3.5]));
    }

    #[test]
    fn better_is_not_paid_for_beside_the_path() {
        let first = run(10.0, 2.0);
        assert!(run(3.0, 2.0).is_better(&first, &first));
        assert!(!run(3.0, 2.1).is_better(&first, &first));
        assert!(!run(10.0, 1.0).is_better(&first, &first));
        assert!(!run(f64::NAN, 1.0).is_better(&first, &first));
    }
}
