//! The drive experiments of S4: the response of a ±10 V axis to a velocity step, to harmonic motion and on a
//! circle.
//!
//! Consumes a [`Machine`](crate::machine::Machine); produces figures and the recordings they were taken from.
//! Every experiment is a program that is planned, fed through the streams, executed and regulated by the
//! kernel in f32 and put out through the converter's adapter, as on a board; only the drive is a model. The
//! figures are made only of values that a board has, too: set positions, encoder readings, output voltages.
//! Runs in the background. Fails with a [`DriveError`] if the machine can't do the motion, before anything
//! moves, or if a fault ended it.
//!
//! - [`experiment`]: a program on a changed machine, and its [`Recording`];
//! - [`circle_motion`]: circles of constant feed, the motion of two experiments;
//! - [`step`]: the feed steps within one tick, open loop;
//! - [`harmonic`]: amplitude and phase of the velocity;
//! - [`identification`]: the runs that identification and [`crate::tuning`] ask for;
//! - [`recorded`]: an axis from a recording or CSV, for identification without a simulation;
//! - [`screw`]: where the load is, place by place, which no encoder on a motor sees;
//! - [`inertia`]: harmonic motion under a growing load, until the current limit shows;
//! - [`circle`](mod@circle): contour error, form deviation, following error;
//! - [`compare`]: regulators side by side; [`peer_regulator`]: one that differences positions;
//!   [`replay`](mod@replay): recorded set values under another regulator;
//! - [`verification`]: circles before and after tuning;
//! - [`learning`]: a correction of a path that is driven repeatedly;
//! - [`bode`]: the step's spectrum, harmonics and the linear model side by side;
//! - [`spectrum`], [`model`]: the mathematics of it; [`inverse`](mod@inverse): the kernel's inverse of a
//!   drive;
//! - [`mod@reference`]: S4's measurements, and the figures that the reference machine has to reach.

pub mod bode;
pub mod circle;
pub mod compare;
pub mod experiment;
pub mod harmonic;
pub mod identification;
pub mod inertia;
pub mod inverse;
pub mod learning;
pub mod model;
pub mod peer_regulator;
pub mod recorded;
pub mod reference;
pub mod replay;
mod rows;
pub mod screw;

pub mod spectrum;
pub mod step;
pub mod circle_motion;
pub mod verification;

pub use experiment::{DriveError, Recording, Terms};

/// Axes of the machines that experiments are made on.
pub(crate) const AXES: usize = 3;

/// −3 dB as a ratio of amplitudes.
pub const HALF_POWER: f64 = core::f64::consts::FRAC_1_SQRT_2;
