//! Flight recorder: the last ticks, kept when a fault comes.
//!
//! Consumes each tick's [`Trace`], in the tick: one [`FlightRow`] is copied, whatever the number of rows. A
//! fault freezes the recorder: it still keeps the next `AFTER` ticks, to show how the machine came to rest,
//! and then writes nothing until [`FlightRecorder::clear`]. Read from the background, oldest first.
//!
//! A row leaves a board as a frame of its own, so that a lost frame costs one row:
//!
//! | bytes | content |
//! |---|---|
//! | 1 | version of this format, 1 |
//! | 1 | number of axes |
//! | … | [`FlightRow`] of f64, whatever the kernel's number type, in the [postcard](https://postcard.jamesmunns.com) wire format |
//! | 4 | CRC-32 (ISO-HDLC) of all before it, least significant byte first |
//!
//! Its memory is the rows: 168 bytes each for three axes in f32.
//!
//! ```
//! # use hal_sim::closed_loop::InMemory;
//! # use motion_kernel::axis::{AxesConfig, AxisFigures, Feedforward, Gains};
//! # use motion_kernel::kernel::Kernel;
//! # use motion_kernel::law::Limits;
//! # use motion_kernel::queue::{PathRules, Streams};
//! # use motion_kernel::units::{Counts, DacCode, Position};
//! use motion_kernel::fault::FaultKind;
//! use motion_kernel::flight::{FlightRecorder, FlightRow, frame_max};
//!
//! # let axis = AxisFigures {
//! #     mm_per_count: 0.0001,
//! #     mm_s_at_10_v: 100.0,
//! #     output_offset_v: 0.0,
//! #     output_limit_v: 10.0,
//! #     gains: Gains { kp_per_s: 50.0, ki_per_s2: 0.0, kd: 0.0 },
//! #     feedforward: Feedforward::default(),
//! #     following_error_limit_mm: 0.5,
//! # };
//! # let config = AxesConfig::<f32, 1>::new(&[axis], 0.0005).expect("an axis");
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! # let mut streams = Streams::<f32, 1, 18, 10>::new();
//! # let (_, mut intake) = streams.split(rules, [Position::ZERO]);
//! # let mut hal = InMemory { counts: [Counts(0)], codes: [DacCode(0)], enabled: None };
//! let mut kernel = Kernel::new(&config, [Position::ZERO], [Counts(0)]);
//! let mut flight = FlightRecorder::<f32, 1, 8, 3>::new();
//! for tick in 0..20 {
//!     if tick == 10 {
//!         kernel.trip(FaultKind::EmergencyStop);
//!     }
//!     flight.add(kernel.tick(&mut intake, &mut hal));
//! }
//! // The fault's tick, three after it, and what was before.
//! assert!(flight.is_frozen());
//! let row = flight.row(7).expect("the newest");
//! assert_eq!(row.tick, 13);
//! let mut buffer = [0; frame_max(1)];
//! let frame = row.to_frame(&mut buffer).expect("room");
//! assert_eq!(FlightRow::<f64, 1>::from_frame(frame), Ok(row.to_f64()));
//! ```

use heapless::Deque;
use serde::{Deserialize, Serialize};

use crate::array;
use crate::exec::ExecState;
use crate::fault::Fault;
use crate::law::PathMotion;
use crate::num::{Real, Scalar};
use crate::program::Checksum;
use crate::trace::Trace;
use crate::units::{Counts, DacCode, Position};

const VERSION: u8 = 1;
const PREFIX: usize = 2;
const CHECKSUM: usize = 4;

/// Greatest length of the frame of a row of `axes` axes \[bytes\].
#[must_use]
pub const fn frame_max(axes: usize) -> usize {
    // Numbers of 64 bits take ten bytes at most, of 32 five, of 16 three, figures eight.
    PREFIX + 10 + (10 + 4 * 8) + 5 + 5 + 1 + 1 + 1 + axes * (10 + 10 + 4 * 8 + 3 + 1 + 1) + CHECKSUM
}

/// A tick's row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRow<R, const AXES: usize> {
    /// Tick number since the start.
    pub tick: u64,
    /// The motion along the path; `s` counts from the stretch's start.
    pub motion: PathMotion<R>,
    /// Number of stretches finished since the start.
    pub stretches: u32,
    /// Program line of the current piece; 0 at rest.
    pub line: u32,
    /// The executor's state.
    pub state: ExecState,
    /// The emergency stop was open.
    pub emergency_stop: bool,
    /// A fault was latched.
    pub is_faulted: bool,
    /// Each axis.
    #[serde(with = "array", bound(serialize = "R: Serialize", deserialize = "R: Copy + Deserialize<'de>"))]
    pub axes: [FlightAxis<R>; AXES],
}

/// An axis in a row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightAxis<R> {
    /// The encoder's reading at the start of the tick.
    pub counts: Counts,
    /// The position set-point that was regulated to.
    pub set: Position,
    /// Set velocity \[mm/s\].
    pub velocity_mm_s: R,
    /// Set acceleration \[mm/s²\].
    pub accel_mm_s2: R,
    /// Set jerk \[mm/s³\].
    pub jerk_mm_s3: R,
    /// Following error: set − actual \[mm\].
    pub following_error_mm: R,
    /// The code for the converter.
    pub code: DacCode,
    /// The output reached the limit.
    pub saturated: bool,
    /// The digital inputs, as [`AxisInputs::to_bits`](crate::hal::AxisInputs::to_bits).
    pub inputs: u8,
}

impl<R: Scalar, const AXES: usize> FlightRow<R, AXES> {
    /// The row of a tick.
    #[must_use]
    #[inline]
    pub(crate) fn new(trace: &Trace<R, AXES>) -> Self {
        let Trace { tick, ref executed, ref axes, ref inputs, ref fault } = *trace;
        let empty = FlightAxis {
            counts: Counts(0),
            set: Position::ZERO,
            velocity_mm_s: R::ZERO,
            accel_mm_s2: R::ZERO,
            jerk_mm_s3: R::ZERO,
            following_error_mm: R::ZERO,
            code: DacCode::ZERO,
            saturated: false,
            inputs: 0,
        };
        let mut rows = [empty; AXES];
        let of_axes = rows.iter_mut().zip(axes).zip(executed.setpoints.iter().zip(&inputs.axes));
        for ((row, output), (setpoint, inputs)) in of_axes {
            *row = FlightAxis {
                counts: output.counts,
                set: output.set,
                velocity_mm_s: setpoint.velocity_mm_s,
                accel_mm_s2: setpoint.accel_mm_s2,
                jerk_mm_s3: setpoint.jerk_mm_s3,
                following_error_mm: output.following_error_mm,
                code: output.code,
                saturated: output.saturated,
                inputs: inputs.to_bits(),
            };
        }
        Self {
            tick,
            motion: executed.motion,
            stretches: executed.stretches,
            line: executed.line,
            state: executed.state,
            emergency_stop: inputs.emergency_stop,
            is_faulted: fault.is_some(),
            axes: rows,
        }
    }

    /// The same row in f64: exact for floats, rounded to nearest for fixed point.
    #[must_use]
    pub fn to_f64(&self) -> FlightRow<f64, AXES> {
        let Self { tick, motion, stretches, line, state, emergency_stop, is_faulted, .. } = *self;
        FlightRow {
            tick,
            motion: PathMotion {
                s: motion.s,
                v_mm_s: motion.v_mm_s.to_f64(),
                a_mm_s2: motion.a_mm_s2.to_f64(),
                j_mm_s3: motion.j_mm_s3.to_f64(),
                snap_mm_s4: motion.snap_mm_s4.to_f64(),
            },
            stretches,
            line,
            state,
            emergency_stop,
            is_faulted,
            axes: self.axes.map(|axis| FlightAxis {
                counts: axis.counts,
                set: axis.set,
                velocity_mm_s: axis.velocity_mm_s.to_f64(),
                accel_mm_s2: axis.accel_mm_s2.to_f64(),
                jerk_mm_s3: axis.jerk_mm_s3.to_f64(),
                following_error_mm: axis.following_error_mm.to_f64(),
                code: axis.code,
                saturated: axis.saturated,
                inputs: axis.inputs,
            }),
        }
    }

    /// Writes the row as a frame at the start of `buffer`; `None` if the buffer is shorter than the frame,
    /// which is at most [`frame_max`] long. Background.
    pub fn to_frame<'a>(&self, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
        let (prefix, rest) = buffer.split_first_chunk_mut()?;
        *prefix = [VERSION, u8::try_from(AXES).ok()?];
        let length = PREFIX + postcard::to_slice(&self.to_f64(), rest).ok()?.len();
        let (content, rest) = buffer.split_at_mut_checked(length)?;
        let (sum, _) = rest.split_first_chunk_mut()?;
        *sum = Checksum::of(content).to_le_bytes();
        buffer.get(..length + CHECKSUM)
    }
}

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// It is shorter than the shortest frame.
    Short,
    /// It has another version of the format.
    Version {
        /// Its version; 1 is expected.
        found: u8,
    },
    /// It is of a machine with another number of axes.
    Axes {
        /// The frame's.
        found: u8,
        /// The reader's.
        expected: usize,
    },
    /// It has been damaged.
    Checksum {
        /// The checksum of the bytes received.
        found: u32,
        /// The checksum in the frame.
        expected: u32,
    },
    /// The checksum is right, but the content is no row.
    Malformed,
}

impl core::fmt::Display for FrameError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Short => write!(f, "a few bytes, expected a frame of the flight recorder"),
            Self::Version { found } => write!(f, "a frame of format {found}, expected {VERSION}"),
            Self::Axes { found, expected } => write!(f, "a frame of {found} axes, expected {expected}"),
            Self::Checksum { found, expected } => {
                write!(f, "a damaged frame: checksum {found:08x}, expected {expected:08x}")
            }
            Self::Malformed => write!(f, "a frame that holds no row"),
        }
    }
}

impl core::error::Error for FrameError {}

impl<const AXES: usize> FlightRow<f64, AXES> {
    /// Reads the row in `frame`.
    ///
    /// # Errors
    /// The bytes are not one whole, undamaged frame of `AXES` axes.
    pub fn from_frame(frame: &[u8]) -> Result<Self, FrameError> {
        let (content, sum) = frame.split_last_chunk().ok_or(FrameError::Short)?;
        let (&[version, axes], body) = content.split_first_chunk().ok_or(FrameError::Short)?;
        let (found, expected) = (Checksum::of(content), u32::from_le_bytes(*sum));
        if version != VERSION {
            return Err(FrameError::Version { found: version });
        }
        if usize::from(axes) != AXES {
            return Err(FrameError::Axes { found: axes, expected: AXES });
        }
        if found != expected {
            return Err(FrameError::Checksum { found, expected });
        }
        match postcard::take_from_bytes(body) {
            Ok((row, [])) => Ok(row),
            _ => Err(FrameError::Malformed),
        }
    }
}

/// The last `ROWS` ticks; with a fault, `AFTER` of them come after its tick.
#[derive(Debug)]
pub struct FlightRecorder<R, const AXES: usize, const ROWS: usize, const AFTER: usize> {
    rows: Deque<FlightRow<R, AXES>, ROWS>,
    /// The fault that freezes it, and the number of ticks still to be kept.
    fault: Option<(Fault<R>, usize)>,
}

impl<R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize> FlightRecorder<R, AXES, ROWS, AFTER> {
    const HAS_ROOM: () = assert!(AFTER < ROWS, "no room for the tick of the fault");

    /// An empty recorder.
    #[must_use]
    pub const fn new() -> Self {
        let () = Self::HAS_ROOM;
        Self { rows: Deque::new(), fault: None }
    }

    /// Adds a tick, unless the recorder is frozen. Call it in the tick.
    #[inline]
    pub fn add(&mut self, trace: &Trace<R, AXES>) {
        match (&mut self.fault, &trace.fault) {
            (None, None) => {}
            (None, Some(fault)) => self.fault = Some((*fault, AFTER)),
            (Some((_, 0)), _) => return,
            (Some((_, left)), _) => *left -= 1,
        }
        if self.rows.is_full() {
            self.rows.pop_front();
        }
        let kept = self.rows.push_back(FlightRow::new(trace));
        debug_assert!(kept.is_ok(), "the oldest row has made room");
    }

    /// Whether a fault has frozen it: no more ticks are added.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        matches!(self.fault, Some((_, 0)))
    }

    /// Number of rows.
    #[must_use]
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// The row `index` ticks after the oldest.
    #[must_use]
    pub fn row(&self, index: usize) -> Option<&FlightRow<R, AXES>> {
        self.rows.get(index)
    }

    /// Forgets everything, and records again. Clear the kernel's fault first: one that is still latched
    /// freezes the recorder once more.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.fault = None;
    }
}

impl<R: Real, const AXES: usize, const ROWS: usize, const AFTER: usize> Default
    for FlightRecorder<R, AXES, ROWS, AFTER>
{
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
