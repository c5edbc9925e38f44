//! What a board's flight recorder kept, read from the board's log.
//!
//! Consumes text in which a frame of [`motion_kernel::flight`] stands in a line as `flight [01, 03, …]`, in
//! hexadecimal, whatever is before or behind it; produces the ticks as those of a run. Lines without a frame
//! are passed over. Fails at the first frame that is damaged, with its line.

use motion_kernel::flight::{FlightAxis, FlightRow, FrameError};
use motion_kernel::units::{Counts, DacCode, Position};

use crate::machine::Machine;
use crate::simulate::contour::Contour;
use crate::simulate::run::state_name;
use crate::trace::{AxisTick, TraceRow};

/// What is in front of a frame's bytes.
const MARK: &str = "flight [";

/// Why a log has no ticks. Displays as what follows the log's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlightError {
    /// No line has a frame.
    #[error(": found no frame, expected lines with `{MARK}…]`")]
    NoFrame,
    /// What should be a byte is none.
    #[error(":{line}: found `{found}`, expected bytes of two hexadecimal digits up to a `]`")]
    Byte {
        /// Line of the log, from 1.
        line: usize,
        /// What is there.
        found: String,
    },
    /// The bytes are no frame.
    #[error(":{line}: found {source}")]
    Frame {
        /// Line of the log, from 1.
        line: usize,
        /// Why.
        source: FrameError,
    },
    /// Ticks do not follow each other in time: the log holds more than one flight.
    #[error(":{line}: found tick {found} behind tick {before}, expected the ticks of one recording")]
    Order {
        /// Line of the log, from 1.
        line: usize,
        /// The tick.
        found: u64,
        /// The one before it.
        before: u64,
    },
}

/// The rows in `log`, oldest first. One that was lost on the way is missing.
///
/// # Errors
/// There is no frame, or a frame is not whole.
pub fn read<const N: usize>(log: &str) -> Result<Vec<FlightRow<f64, N>>, FlightError> {
    let mut rows: Vec<FlightRow<f64, N>> = Vec::new();
    for (index, text) in log.lines().enumerate() {
        let line = index + 1;
        let Some((_, bytes)) = text.split_once(MARK) else { continue };
        let row = FlightRow::from_frame(&frame(line, bytes)?)
            .map_err(|source| FlightError::Frame { line, source })?;
        if let Some(before) = rows.last().map(|row| row.tick).filter(|before| *before >= row.tick) {
            return Err(FlightError::Order { line, found: row.tick, before });
        }
        rows.push(row);
    }
    if rows.is_empty() { Err(FlightError::NoFrame) } else { Ok(rows) }
}

fn frame(line: usize, text: &str) -> Result<Vec<u8>, FlightError> {
    let refused = |found: &str| FlightError::Byte { line, found: found.trim().to_owned() };
    let (bytes, _) = text.split_once(']').ok_or_else(|| refused(text.rsplit(',').next().unwrap_or(text)))?;
    let byte = |part: &str| {
        let digits = part.trim().trim_start_matches("0x");
        u8::from_str_radix(digits, 16).map_err(|_| refused(part))
    };
    bytes.split(',').map(byte).collect()
}

/// A row with places for all axes of a machine; those behind its own stand still.
#[must_use]
pub fn with_places<const M: usize, const N: usize>(row: &FlightRow<f64, M>) -> FlightRow<f64, N> {
    let &FlightRow { tick, motion, stretches, line, state, emergency_stop, is_faulted, ref axes } = row;
    let still = FlightAxis {
        counts: Counts(0),
        set: Position::ZERO,
        velocity_mm_s: 0.0,
        accel_mm_s2: 0.0,
        jerk_mm_s3: 0.0,
        following_error_mm: 0.0,
        code: DacCode::ZERO,
        saturated: false,
        inputs: 0,
    };
    let axes = std::array::from_fn(|axis| axes.get(axis).copied().unwrap_or(still));
    FlightRow { tick, motion, stretches, line, state, emergency_stop, is_faulted, axes }
}

/// The rows as ticks of a run of `machine`; the path position counts from the start of each stretch.
#[must_use]
pub fn ticks<const N: usize>(rows: &[FlightRow<f64, N>], machine: &Machine<N>) -> Vec<TraceRow<N>> {
    let mut contour = Contour::new(machine.linear_places());
    let tick = |row: &FlightRow<f64, N>| {
        let axes = row.axes.map(|axis| AxisTick {
            set_mm: axis.set.to_mm(),
            vel_mm_s: axis.velocity_mm_s,
            acc_mm_s2: axis.accel_mm_s2,
            jerk_mm_s3: axis.jerk_mm_s3,
            act_mm: axis.set.to_mm() - axis.following_error_mm,
            err_um: axis.following_error_mm * 1e3,
            out_v: axis.code.to_volts(),
        });
        TraceRow {
            tick: row.tick,
            s_mm: row.motion.s.to_mm(),
            v_mm_s: row.motion.v_mm_s,
            a_mm_s2: row.motion.a_mm_s2,
            j_mm_s3: row.motion.j_mm_s3,
            snap_mm_s4: row.motion.snap_mm_s4,
            state: state_name(row.state, row.is_faulted),
            line: row.line,
            contour_um: contour.error_um(&axes),
            axes,
        }
    };
    rows.iter().map(tick).collect()
}

/// What of the flight people are told, line by line.
#[must_use]
pub fn words<const N: usize>(rows: &[FlightRow<f64, N>], machine: &Machine<N>) -> Vec<String> {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Vec::new() };
    let spanned = last.tick - first.tick + 1;
    let mut words = vec![format!("ticks {} to {}, {} rows", first.tick, last.tick, rows.len())];
    if spanned > rows.len() as u64 {
        words
            .push(format!("{} ticks between them are missing: lost on the way", spanned - rows.len() as u64));
    }
    match rows.iter().find(|row| row.is_faulted) {
        Some(row) => {
            let at =
                if row.line > 0 { format!(", in line {} of the program", row.line) } else { String::new() };
            words.push(format!("fault latched in tick {}{at}", row.tick));
        }
        None => words.push("no fault latched".to_owned()),
    }
    for (axis, settings) in machine.driven_axes().iter().enumerate() {
        if let Some(row) = rows.iter().find(|row| row.axes[axis].saturated) {
            words.push(format!("output of axis {} at its limit from tick {} on", settings.name, row.tick));
        }
        let errors_mm = rows.iter().map(|row| row.axes[axis].following_error_mm);
        let greater = |most: f64, error: f64| if error.abs() > most.abs() { error } else { most };
        words.push(format!(
            "following error of axis {} at most {:.4} {unit}, limit {} {unit}",
            settings.name,
            errors_mm.fold(0.0, greater),
            settings.following_error_limit_mm,
            unit = settings.unit().symbol(),
        ));
    }
    words
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::ExecState;
    use motion_kernel::flight::{FlightAxis, frame_max};
    use motion_kernel::law::PathMotion;
    use motion_kernel::units::{Counts, DacCode, Position};

    use super::*;

    fn row(tick: u64, is_faulted: bool) -> FlightRow<f64, 3> {
        let axis = FlightAxis {
            counts: Counts(-7),
            set: Position::from_mm(12.5).expect("near"),
            velocity_mm_s: 3.0,
            accel_mm_s2: -4.0,
            jerk_mm_s3: 5.0,
            following_error_mm: 0.25,
            code: DacCode(-16384),
            saturated: tick > 11,
            inputs: 1,
        };
        let at = Position::from_mm(0.5).expect("near");
        FlightRow {
            tick,
            motion: PathMotion { s: at, v_mm_s: 2.0, ..PathMotion::default() },
            stretches: 1,
            line: 30,
            state: ExecState::Moving,
            emergency_stop: false,
            is_faulted,
            axes: [axis; 3],
        }
    }

    fn line(row: &FlightRow<f64, 3>) -> String {
        let mut buffer = [0; frame_max(3)];
        let bytes = row.to_frame(&mut buffer).expect("room");
        // As defmt shows `{=[u8]:02x}`.
        let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("4711 INFO  flight [{}]\n└─ at src/background.rs:1", bytes.join(", "))
    }

    #[test]
    fn a_log_gives_its_rows_and_says_what_is_missing() {
        let rows = [row(10, false), row(11, false), row(14, true), row(15, true)];
        let log: String = rows.iter().map(|row| format!("0 INFO ready\n{}\n", line(row))).collect();
        let found = read(&log).expect("frames");
        assert_eq!(found, rows);
        let words = words(&found, &Machine::reference());
        assert_eq!(
            words[..3],
            [
                "ticks 10 to 15, 4 rows",
                "2 ticks between them are missing: lost on the way",
                "fault latched in tick 14, in line 30 of the program"
            ]
        );
        for said in [
            "output of axis Z at its limit from tick 14 on",
            "following error of axis Y at most 0.2500 mm, limit 1 mm",
        ] {
            assert!(words[3..].contains(&said.to_owned()), "{said}");
        }
        let ticks = ticks(&found, &Machine::reference());
        assert_eq!(
            ticks.iter().map(|tick| tick.state).collect::<Vec<_>>(),
            ["moving", "moving", "fault", "fault"]
        );
        let axis = ticks[0].axes[2];
        assert_eq!((ticks[0].s_mm, ticks[0].line, axis.set_mm, axis.act_mm), (0.5, 30, 12.5, 12.25));
        assert_eq!((axis.vel_mm_s, axis.acc_mm_s2, axis.jerk_mm_s3, axis.err_um), (3.0, -4.0, 5.0, 250.0));
        assert_eq!(axis.out_v, -5.0);
    }

    #[test]
    fn what_is_wrong_with_a_log_is_named_with_its_line() {
        let message = |log: &str| read::<3>(log).expect_err("refused").to_string();
        let good = line(&row(10, false));
        assert_eq!(message("0 INFO ready"), ": found no frame, expected lines with `flight […]`");
        assert_eq!(
            message("\nflight [01, xy]"),
            ":2: found `xy`, expected bytes of two hexadecimal digits up to a `]`"
        );
        assert!(message(&good.replace(']', "")).starts_with(":1: found `"));
        let damaged = good.replacen("0a, ", "0b, ", 1);
        assert!(damaged != good && message(&damaged).starts_with(":1: found a damaged frame: checksum "));
        assert_eq!(message("flight [01]"), ":1: found a few bytes, expected a frame of the flight recorder");
        let twice = format!("{good}\n{good}");
        assert_eq!(message(&twice), ":3: found tick 10 behind tick 10, expected the ticks of one recording");
    }
}
