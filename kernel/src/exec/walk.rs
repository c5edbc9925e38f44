//! Walking from piece to piece.
//!
//! Consumes the path stream, up to [`PIECES_PER_TICK_MAX`] pieces per tick; produces the set-points at a path
//! position. In the tick.

use serde::{Deserialize, Serialize};

use crate::law::PathMotion;
use crate::num::Real;
use crate::path::Setpoint;
use crate::queue::{Intake, PathItem};
use crate::units::Position;

/// Greatest number of pieces that may end within one tick, across stretches. At 20 m/min and ticks of 0.5 ms
/// these are pieces of 10 µm. Planning must refuse a denser program; the executor's fault is the last line of
/// defence.
pub const PIECES_PER_TICK_MAX: usize = 16;

/// How far a stretch may start from where the machine stands \[mm\]: rounding of f32 over a piece.
const START_TOLERANCE: Position = Position::from_bits(1 << 16);

/// Why the walk can't continue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WalkError {
    /// The next piece has not arrived.
    Starved,
    /// More than [`PIECES_PER_TICK_MAX`] pieces ended.
    TooManyPieces,
    /// The stretch starts elsewhere.
    NotHere,
}

/// The machine's place on the path. The piece itself stays at the head of its queue.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Walker<const AXES: usize> {
    /// The head of the path stream is the piece under way.
    is_on_piece: bool,
    /// Path position of the piece's start, from the stretch's start.
    piece_start: Position,
    /// Where the machine rests between stretches.
    #[serde(with = "crate::array")]
    rest: [Position; AXES],
    /// Number of pieces that may still end in this tick.
    ends_left: usize,
}

impl<const AXES: usize> Walker<AXES> {
    pub(super) fn new(rest: [Position; AXES]) -> Self {
        Self { is_on_piece: false, piece_start: Position::ZERO, rest, ends_left: PIECES_PER_TICK_MAX }
    }

    /// Begins a tick: resets the bound.
    #[inline]
    pub(super) fn start_tick(&mut self) {
        self.ends_left = PIECES_PER_TICK_MAX;
    }

    /// Moves forward to the piece that contains path position `s`; writes the set-points there to `setpoints`
    /// and returns the piece's program line.
    #[inline]
    pub(super) fn follow<R: Real>(
        &mut self,
        motion: &PathMotion<R>,
        intake: &mut Intake<'_, R, AXES>,
        setpoints: &mut [Setpoint<R>; AXES],
    ) -> Result<u32, WalkError> {
        for _ in 0..PIECES_PER_TICK_MAX + 1 {
            let Some(PathItem::Piece(piece)) = intake.path() else { return Err(WalkError::Starved) };
            if !self.is_on_piece {
                if self.piece_start == Position::ZERO && !self.stands_at(&piece.start()) {
                    return Err(WalkError::NotHere);
                }
                self.is_on_piece = true;
            }
            let local = motion.s - self.piece_start;
            if local <= piece.length() {
                // A rounding step back over the junction still is the piece's start.
                piece.set(local.max(Position::ZERO).to_offset(), motion, setpoints);
                return Ok(piece.program_line());
            }
            self.piece_start = self.piece_start + piece.length();
            self.end_piece(intake)?;
        }
        Err(WalkError::TooManyPieces)
    }

    /// Ends the stretch: passes the rest of its pieces; the machine rests at its end.
    #[inline]
    pub(super) fn finish<R: Real>(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<(), WalkError> {
        for _ in 0..PIECES_PER_TICK_MAX + 1 {
            match intake.path() {
                Some(PathItem::EndOfStretch(end)) => {
                    (self.piece_start, self.rest) = (Position::ZERO, *end);
                    intake.drop_end_of_path();
                    return Ok(());
                }
                Some(PathItem::Piece(_)) => self.end_piece(intake)?,
                None => return Err(WalkError::Starved),
            }
        }
        Err(WalkError::TooManyPieces)
    }

    #[inline]
    fn end_piece<R: Real>(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<(), WalkError> {
        intake.drop_piece();
        self.is_on_piece = false;
        self.ends_left = self.ends_left.checked_sub(1).ok_or(WalkError::TooManyPieces)?;
        Ok(())
    }

    fn stands_at(&self, start: &[Position; AXES]) -> bool {
        // Both signs in one comparison.
        let tolerance = START_TOLERANCE.to_bits();
        self.rest.iter().zip(start).all(|(&rest, &start)| {
            let gap = (start - rest).to_bits();
            gap.wrapping_add(tolerance).cast_unsigned() <= 2 * tolerance.unsigned_abs()
        })
    }

    /// The set-points between stretches.
    #[inline]
    pub(super) fn rest<R: Real>(&self, setpoints: &mut [Setpoint<R>; AXES]) {
        for (setpoint, &position) in setpoints.iter_mut().zip(&self.rest) {
            *setpoint = Setpoint { position, ..Setpoint::default() };
        }
    }
}
