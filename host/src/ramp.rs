//! One ramp of the feed law, in the papers' figures.

use motion_kernel::law::{FeedState, Law, Limits, Pulse, Ramp};
use serde::Serialize;

/// The figures are beyond the range of numbers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found}, expected {}", Self::EXPECTED)]
pub struct RampError {
    /// What was found.
    pub found: String,
}

impl RampError {
    /// What was expected.
    pub const EXPECTED: &str = "limits nearer to those of a machine";
}

/// A change of feed \[mm/s\] under limits.
///
/// # Errors
/// Its figures are beyond the range of numbers.
pub fn ramp(
    pulse: Pulse,
    limits: Limits<f64>,
    [from_mm_s, to_mm_s]: [f64; 2],
) -> Result<Ramp<f64>, RampError> {
    let law = Law::new(pulse, limits).map_err(|error| RampError { found: error.to_string() })?;
    let ramp = Ramp::new(&law, from_mm_s, to_mm_s);
    let figures = [ramp.peak_jerk_mm_s3, ramp.t1_s, ramp.t2_s, ramp.duration_s(), ramp.length_mm()];
    if figures.iter().all(|figure| figure.is_finite()) {
        Ok(ramp)
    } else {
        Err(RampError { found: "a ramp whose figures exceed the range of numbers".to_owned() })
    }
}

/// The figures of a ramp.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RampFigures {
    /// The law's name.
    pub law: &'static str,
    /// Peak jerk \[mm/s³\].
    pub peak_jerk_mm_s3: f64,
    /// Edge of a pulse of jerk \[s\].
    pub edge_s: f64,
    /// Its plateau \[s\].
    pub plateau_s: f64,
    /// End of the rising phase \[s\].
    pub t1_s: f64,
    /// End of the phase of constant acceleration \[s\].
    pub t2_s: f64,
    /// End of the ramp \[s\].
    pub tp_s: f64,
    /// Its length \[mm\].
    pub length_mm: f64,
    /// Which limit sets its duration.
    pub limited_by: &'static str,
    /// The motion at [`corner_times_s`].
    pub at: [Moment; 4],
}

impl RampFigures {
    /// Of a ramp under a law.
    #[must_use]
    pub fn new(pulse: Pulse, ramp: &Ramp<f64>) -> Self {
        Self {
            law: pulse.name(),
            peak_jerk_mm_s3: ramp.peak_jerk_mm_s3,
            edge_s: ramp.edge_s,
            plateau_s: ramp.plateau_s(),
            t1_s: ramp.t1_s,
            t2_s: ramp.t2_s,
            tp_s: ramp.duration_s(),
            length_mm: ramp.length_mm(),
            limited_by: ramp.limited_by.name(),
            at: corner_times_s(ramp).map(|t_s| Moment::new(ramp, t_s)),
        }
    }
}

/// The motion at one time of a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Moment {
    /// Time \[s\].
    pub t_s: f64,
    /// Path length \[mm\].
    pub s_mm: f64,
    /// Feed \[mm/s\].
    pub v_mm_s: f64,
    /// Acceleration \[mm/s²\].
    pub a_mm_s2: f64,
    /// Jerk \[mm/s³\].
    pub j_mm_s3: f64,
    /// Snap \[mm/s⁴\].
    pub snap_mm_s4: f64,
}

impl Moment {
    /// Of a ramp, at a time from its start.
    #[must_use]
    pub fn new(ramp: &Ramp<f64>, t_s: f64) -> Self {
        let FeedState { s_mm, v_mm_s, a_mm_s2, j_mm_s3, snap_mm_s4 } = ramp.at(t_s);
        Self { t_s, s_mm, v_mm_s, a_mm_s2, j_mm_s3, snap_mm_s4 }
    }
}

/// e/2, t1, t2, tp: where the papers, in which e/2 is t1/4, give their figures.
#[must_use]
pub fn corner_times_s(ramp: &Ramp<f64>) -> [f64; 4] {
    [ramp.edge_s / 2.0, ramp.t1_s, ramp.t2_s, ramp.duration_s()]
}
