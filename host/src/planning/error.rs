//! What planning refuses.

use motion_kernel::law::{LimitError, SegmentError};
use motion_kernel::plan::PlanError;

use crate::toolpath::CompileError;

/// A place in a file, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column, where the problem has one.
    pub column: Option<u32>,
}

impl From<u32> for Place {
    fn from(line: u32) -> Self {
        Self { line, column: None }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.line)?;
        self.column.map_or(Ok(()), |column| write!(f, ":{column}"))
    }
}

/// A program or block list that can't be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{source_name}:{place}: {problem}")]
pub struct PlanningError {
    /// File name.
    pub source_name: String,
    /// Where.
    pub place: Place,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The geometry has no executable form.
    #[error("found {0}")]
    Geometry(#[from] CompileError),
    /// A limit that results for the block is unusable.
    #[error("found {0}")]
    Limit(#[from] LimitError),
    /// The look-ahead has no plan.
    #[error("found {0}")]
    Plan(#[from] PlanError),
    /// A ramp is beyond the tick's range.
    #[error("found {0}")]
    Segment(#[from] SegmentError),
    /// More pieces than the tick handles.
    #[error(
        "found {pieces} pieces over {length_mm:.6} mm, which {feed_mm_s:.3} mm/s pass within one tick of \
         {tick_s} s: expected at most {pieces} pieces a tick, so a feed of at most {feed_max_mm_s:.3} mm/s \
         here or longer moves"
    )]
    DensePieces {
        /// The bound.
        pieces: usize,
        /// The length they cover \[mm\].
        length_mm: f64,
        /// The planned feed \[mm/s\].
        feed_mm_s: f64,
        /// The feed at which they would be accepted \[mm/s\].
        feed_max_mm_s: f64,
        /// The tick \[s\].
        tick_s: f64,
    },
    /// More feed segments than the tick handles.
    #[error("found {segments} feed segments and dwells within {ticks:.3} ticks: expected at least 1 tick")]
    DenseSegments {
        /// The bound.
        segments: usize,
        /// What they take \[ticks\].
        ticks: f64,
    },
    /// A dwell that can't be executed.
    #[error("found a dwell of {seconds} s: expected at most {longest_s} s")]
    Dwell {
        /// Its duration \[s\].
        seconds: f64,
        /// The longest \[s\].
        longest_s: f64,
    },
    /// The file is not a block list.
    #[error("{0}")]
    Json(String),
}
