//! An axis from what was recorded of it: a board's or a simulated run (`motion run --record`), or CSV.
//!
//! Consumes bytes and the axis' scales; produces an [`AxisRecording`] of the whole, from rest on. Background;
//! linear. Fails with file, line, what was found and what was expected.

use core::ops::Range;

use super::rows;
use crate::identify::AxisRecording;
use crate::recording::{Recording, RecordingError, replay};
use crate::simulate::RunError;

/// The columns of CSV.
const HEADING: [&str; 3] = ["time_s", "command_v", "counts"];
/// What is expected of the file, its heading, and a row.
const EXPECTED: [&str; 3] = [
    "a recording of `motion run --record`, or CSV",
    "the heading time_s,command_v,counts",
    "three finite numbers: time [s], command [V], counts",
];
/// How far a time may be from its tick's, in ticks.
const JITTER_TICKS: f64 = 0.1;
/// Ticks at the start in which an axis that stands moves by no more than these counts.
const REST: (usize, f64) = (10, 6.0);
/// Range of a control tick \[s\].
const TICK_S: Range<f64> = 1e-5..0.1;

/// What volts and counts stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Velocity at 10 V \[mm/s\], as the machine file says it.
    pub mm_s_at_10_v: f64,
    /// Travel of a count \[mm\]; negative where it counts the other way.
    pub mm_per_count: f64,
}

/// Why a recording can't be used.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// Something is wrong in a line.
    #[error("{name}:{line}: found {found}, expected {expected}")]
    Line {
        /// The file.
        name: String,
        /// Its line, from 1.
        line: usize,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// A recording of ours that is damaged.
    #[error("{name}: {source}")]
    Recording {
        /// The file.
        name: String,
        /// Why.
        source: RecordingError,
    },
    /// A recording of ours that can't be run again.
    #[error("{name}: {source}")]
    Run {
        /// The file.
        name: String,
        /// Why.
        source: RunError,
    },
    /// A recording of ours goes another way when it is run again.
    #[error("{name}: the recording {difference}, expected a run that can be made again")]
    Differs {
        /// The file.
        name: String,
        /// Where.
        difference: String,
    },
}

/// Reads axis `axis` (from 0) of a recording of ours, with the scales and the tick that it holds, or CSV with
/// `scales`.
///
/// # Errors
/// The bytes are neither, the rows are not those of one clock, or the axis does not begin at rest.
pub fn read(name: &str, bytes: &[u8], axis: usize, scales: Scales) -> Result<AxisRecording, RecordedError> {
    match Recording::<3>::from_bytes(bytes) {
        Ok(recording) => of_recording(name, &recording, axis),
        Err(RecordingError::NotARecording { .. }) => of_csv(name, bytes, scales),
        Err(source) => Err(RecordedError::Recording { name: name.to_owned(), source }),
    }
}

fn of_recording(name: &str, recording: &Recording<3>, axis: usize) -> Result<AxisRecording, RecordedError> {
    let header = &recording.job().header;
    let axis = axis.min(header.axes.len() - 1);
    let mm_s_per_volt = header.axes[axis].mm_s_at_10_v / 10.0;
    let (mut command_mm_s, mut actual_mm) = (Vec::new(), Vec::new());
    let replayed = replay(recording, recording.job(), &mut |row| {
        command_mm_s.push(row.axes[axis].out_v * mm_s_per_volt);
        actual_mm.push(row.axes[axis].act_mm);
    });
    let replayed = replayed.map_err(|source| RecordedError::Run { name: name.to_owned(), source })?;
    if let Some(difference) = replayed.difference {
        let difference = difference.to_string();
        return Err(RecordedError::Differs { name: name.to_owned(), difference });
    }
    Ok(AxisRecording { tick_s: header.tick_s, command_mm_s, actual_mm, lead_in_ticks: 0, harmonic_hz: None })
}

fn of_csv(name: &str, bytes: &[u8], scales: Scales) -> Result<AxisRecording, RecordedError> {
    let fail = |line: usize, found: String, expected: &'static str| RecordedError::Line {
        name: name.to_owned(),
        line,
        found,
        expected,
    };
    let rows = rows::read(name, bytes, HEADING, EXPECTED)?;
    let &[(_, [first_s, ..]), .., (last_line, [last_s, ..])] = rows.as_slice() else {
        return Err(fail(1, format!("{} rows", rows.len()), "a row for every tick"));
    };
    let (mut command_mm_s, mut actual_mm) = (Vec::new(), Vec::new());
    for (_, [_, command_v, counts]) in &rows {
        command_mm_s.push(command_v / 10.0 * scales.mm_s_at_10_v);
        actual_mm.push(counts * scales.mm_per_count);
    }
    let tick_s = (last_s - first_s) / (rows.len() - 1) as f64;
    if !TICK_S.contains(&tick_s) {
        return Err(fail(last_line, format!("ticks of {tick_s} s"), "ticks of 10 µs to 0.1 s"));
    }
    for (index, (line, [time_s, ..])) in rows.iter().enumerate() {
        let expected_s = first_s + index as f64 * tick_s;
        if (time_s - expected_s).abs() > JITTER_TICKS * tick_s {
            let found = format!("the time {time_s} s where ticks of {tick_s} s are at {expected_s} s");
            return Err(fail(*line, found, "a row for every tick of one clock"));
        }
    }
    let start = &actual_mm[..actual_mm.len().min(REST.0)];
    let moved_counts =
        start.iter().map(|at| (at - start[0]).abs()).fold(0.0, f64::max) / scales.mm_per_count.abs();
    if moved_counts > REST.1 {
        let found = format!("an axis that moves by {moved_counts:.0} counts in the first {} ticks", REST.0);
        return Err(fail(rows[0].0, found, "a recording that begins at rest"));
    }
    Ok(AxisRecording { tick_s, command_mm_s, actual_mm, lead_in_ticks: 0, harmonic_hz: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALES: Scales = Scales { mm_s_at_10_v: 200.0, mm_per_count: -0.001 };

    #[test]
    fn volts_and_counts_become_an_axis() {
        let text = "time_s,command_v,counts\n# a remark\n0.5,0,7\n0.501,1.5,7\n0.502,-1.5,3\n";
        let read = read("a.csv", text.as_bytes(), 0, SCALES).expect("a recording");
        assert!((read.tick_s - 1e-3).abs() < 1e-12);
        assert_eq!(read.command_mm_s, [0.0, 30.0, -30.0]);
        assert_eq!(read.actual_mm, [-0.007, -0.007, -0.003]);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, expected) in [
            ("time,volts\n", "a.csv:1: found 'time,volts', expected the heading time_s,command_v,counts"),
            ("time_s,command_v,counts\n0,0,0\n", "a.csv:1: found 1 rows, expected a row for every tick"),
            ("time_s,command_v,counts\n0,0,x\n", "a.csv:2: found '0,0,x', expected three finite numbers"),
            ("time_s,command_v,counts\n0,0,0\n1,0,0\n", "a.csv:3: found ticks of 1 s, expected ticks of 10"),
            (
                "time_s,command_v,counts\n0,0,0\n0.001,0,0\n0.0025,0,0\n0.003,0,0\n",
                "a.csv:4: found the time 0.0025 s where ticks of 0.001 s are at 0.002 s",
            ),
            (
                "time_s,command_v,counts\n0,0,0\n0.001,0,9\n",
                "a.csv:2: found an axis that moves by 9 counts in the first 10 ticks",
            ),
        ] {
            let error = read("a.csv", text.as_bytes(), 0, SCALES).expect_err(text).to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
