//! Identification: the parameters of a servo axis, from recordings of outputs and encoder readings.
//!
//! Consumes [`AxisRecording`]s of the motions that [`explore`] and [`long_harmonic`] ask for, or of any others that start at rest, from an
//! open or a closed loop; produces an [`Identification`]. Runs in the background of the PC, mostly in one second of processor
//! time for ten seconds of recordings; `docs/DRIVES.md` has the longest. It never sees the parameters of a simulation: a machine gives the
//! same two columns.
//!
//! Two methods:
//!
//! - **Figures without a model**: delay, time constant, overshoot and settling of steps, gain and delay of
//!   harmonic motion, −3 dB bandwidth, sustained acceleration (S4).
//! - **The drive model of hal-sim**, run on the recorded commands. Its parameters are moved until its
//!   positions are those that were recorded (output error, least squares). Noise of the encoder thus enters
//!   once, is not differentiated, and does not bend the result.
//!
//! The errors of the readings are known (`readings`, `moments`), so how well a model follows says whether it is
//! the right one. The model knows nothing of backlash, cogging and pitch errors. Where these matter,
//! [`Identification::misfit_per_reading`] is far above 1, and intervals are as wide as what is left allows.
//!
//! A screw between motor and load is another matter: no encoder on a motor sees its backlash and pitch error. [`identify_screw`]
//! finds them from where an instrument saw the load.
//!
//! # Example
//!
//! ```
//! use hal_sim::{DriveModel, DriveState, REFERENCE_X};
//! use motion_host::identify::{AxisRecording, explore, identify};
//!
//! // In place of a machine.
//! let tick_s = 0.5e-3;
//! let model = DriveModel::new(REFERENCE_X, tick_s, 20)?;
//! let runs = explore(333.0, |excitation| {
//!     let mut axis = DriveState::<128>::at_rest(&model, 0.0)?;
//!     let command_mm_s = excitation.velocity_mm_s(tick_s);
//!     let mut latch = |command_mm_s: &f64| {
//!         let counts = (axis.position_mm() / 1e-4).round();
//!         model.tick(&mut axis, *command_mm_s);
//!         counts * 1e-4
//!     };
//!     let actual_mm = command_mm_s.iter().map(&mut latch).collect();
//!     let harmonic_hz = excitation.harmonic_hz();
//!     Ok::<_, hal_sim::ParameterError>(AxisRecording { tick_s, command_mm_s, actual_mm, lead_in_ticks: 0, harmonic_hz })
//! })?;
//!
//! let axis = identify(&runs)?;
//! assert!((axis.parameters.velocity_gain_per_s.value - 440.0).abs() < 4.4);
//! assert!(axis.parameters.bed.is_none());
//! println!("{axis}");
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod error;
mod excitation;
mod recording;
mod differences;
mod step_reading;
mod harmonic_reading;
mod parameters;
mod simulation;
mod whole_ticks;
mod cholesky;
mod moments;
mod readings;
mod search;
mod coarse;
mod bed;
mod confidence;
mod valleys;
mod fit;
mod estimate;
mod display;
mod screw;
#[cfg(test)]
mod fixtures;

pub use display::Described;
pub use error::IdentifyError;
pub use estimate::{
    Alternatives, AxisParametersFound, BedEstimate, DETERMINED, Estimate, Figures, Identification, RunMatch,
};
pub use excitation::{
    Excitation, Reach, explore, first_look, highest_hz, identification_plan, long_harmonic,
};
pub use harmonic_reading::{Bandwidth, HarmonicReading};
pub use recording::AxisRecording;
pub use screw::{
    ExplainedReading, PitchErrorFound, ScrewError, ScrewFound, ScrewReading, ScrewReference, ScrewSearch,
    identify_screw,
};
pub use step_reading::StepReading;

/// Identifies an axis.
///
/// # Errors
/// Recordings that can't be evaluated, that show no motion, or that a velocity servo could not have made.
pub fn identify(runs: &[AxisRecording]) -> Result<Identification, IdentifyError> {
    let figures = figures(runs)?;
    let fit = fit::fit(runs, figures.resolution_mm)?;
    Ok(identification(figures, fit))
}

/// Identifies an axis once more, with further recordings: `runs` are all of it, and `found` is what some of them tell. Takes a part
/// of the time. `None` if what was found does not lead to a model that follows all of them, to a twentieth more than their errors.
///
/// # Errors
/// Recordings that can't be evaluated or show no motion.
pub fn identify_further(
    found: &Identification,
    runs: &[AxisRecording],
) -> Result<Option<Identification>, IdentifyError> {
    let figures = figures(runs)?;
    let fit = fit::refit(runs, figures.resolution_mm, &found.ends);
    Ok(fit.map(|fit| identification(figures, fit)))
}

fn identification(figures: Figures, fit: fit::Fit) -> Identification {
    Identification {
        parameters: fit.parameters,
        alternatives: fit.alternatives,
        ends: fit.ends,
        figures,
        runs: fit.runs,
        misfit_per_reading: fit.misfit_per_reading,
    }
}

/// The figures that need no model.
///
/// # Errors
/// Recordings that can't be evaluated or show no motion.
pub fn figures(runs: &[AxisRecording]) -> Result<Figures, IdentifyError> {
    let first = runs.first().ok_or(IdentifyError::NoRuns)?;
    for (index, run) in runs.iter().enumerate() {
        run.check(index + 1, first.tick_s)?;
    }
    recording::check_motion(runs)?;
    let resolution_mm = recording::resolution_mm(runs);
    let harmonics: Vec<_> = runs.iter().filter_map(harmonic_reading::harmonic_reading).collect();
    Ok(Figures {
        resolution_mm,
        reading_noise_mm: readings::noise_mm2(runs, resolution_mm).sqrt(),
        steps: runs.iter().flat_map(|run| step_reading::step_reading(run, resolution_mm)).collect(),
        bandwidths: harmonic_reading::bandwidths(&harmonics),
        harmonics,
        sustained_accel_mm_s2: coarse::sustained_accel_mm_s2(runs),
    })
}
