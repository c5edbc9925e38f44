//! Reasons why recordings do not determine an axis.

/// Recordings that can't be evaluated: what was found, and what is needed. Runs are counted from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// Nothing was given.
    #[error("no recording, expected at least one run of the axis")]
    NoRuns,
    /// A tick length that no clock has.
    #[error("run {run}: tick of {tick_s} s, expected a positive finite number")]
    Tick {
        /// The recording's index.
        run: usize,
        /// Its tick \[s\].
        tick_s: f64,
    },
    /// Runs of different clocks can't belong to one fit.
    #[error("run {run}: tick of {tick_s} s, expected {expected_s} s as in run 1")]
    DifferentTicks {
        /// The recording's index.
        run: usize,
        /// Its tick \[s\].
        tick_s: f64,
        /// The first recording's tick \[s\].
        expected_s: f64,
    },
    /// The recording does not have one command for every position.
    #[error("run {run}: {commands} commands and {positions} positions, expected as many of both")]
    Lengths {
        /// The recording's index.
        run: usize,
        /// Ticks with a command.
        commands: usize,
        /// Ticks with a position.
        positions: usize,
    },
    /// Too little to tell anything from.
    #[error("run {run}: {ticks} evaluated ticks, expected at least {needed}")]
    TooShort {
        /// The recording's index.
        run: usize,
        /// Ticks after the lead-in.
        ticks: usize,
        /// Ticks that it takes.
        needed: usize,
    },
    /// A value that is not a number.
    #[error("run {run}: {quantity} {value} at tick {tick}, expected a finite number")]
    NotFinite {
        /// The recording's index.
        run: usize,
        /// The field's name.
        quantity: &'static str,
        /// The tick, from 0.
        tick: usize,
        /// The value there.
        value: f64,
    },
    /// Commands without effect.
    #[error(
        "the axis moved {travel_mm} mm at most under commands that ask for {commanded_mm} mm; expected motion: \
         is the drive enabled, the encoder connected?"
    )]
    NeverMoved {
        /// The difference of the greatest and the smallest reading \[mm\].
        travel_mm: f64,
        /// The same for the integral of the command \[mm\].
        commanded_mm: f64,
    },
    /// Positive commands drive it in negative direction.
    #[error(
        "the axis moves against its command, by {slope} mm per mm; expected the same direction: swap one sign"
    )]
    Reversed {
        /// Change of position over change of the command's integral.
        slope: f64,
    },
    /// The dead time is longer than the model holds.
    #[error("no response within {limit_s} s of a command, the longest lag that is looked for")]
    TooLate {
        /// The bound \[s\].
        limit_s: f64,
    },
    /// A servo axis with these parameters does something else.
    #[error(
        "run {run}: the best model misses the recording by {error_mm:.6} mm of {travel_mm:.6} mm travel, expected \
         less than a twentieth; expected a velocity servo that starts at rest"
    )]
    UnlikeModel {
        /// The worst recording.
        run: usize,
        /// Root of the mean square \[mm\].
        error_mm: f64,
        /// The difference of the greatest and the smallest reading \[mm\].
        travel_mm: f64,
    },
}
