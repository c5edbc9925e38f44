//! Walking from piece to piece.
//!
//! Consumes the path stream, up to [`PIECES_PER_TICK_MAX`] pieces a tick; produces the set-points at
//! a path position. In the tick.

use crate::law::PathMotion;
use crate::num::Real;
use crate::path::{Piece, Setpoint};
use crate::queue::{Intake, PathItem};
use crate::units::Position;

/// How many pieces may end within one tick, whatever stretches they belong to. At 20 m/min and 0.5 ms
/// a tick that is pieces of 10 µm. Planning must refuse a denser program; the executor's fault is the
/// last line of defence.
pub const PIECES_PER_TICK_MAX: usize = 16;

/// How far a stretch may start from where the machine stands \[mm\]: rounding of f32 over a piece.
const START_TOLERANCE: Position = Position::from_bits(1 << 16);

/// Why the walk can't go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WalkError {
    /// The next piece has not arrived.
    Starved,
    /// More than [`PIECES_PER_TICK_MAX`] pieces ended.
    TooManyPieces,
    /// The stretch starts elsewhere.
    NotHere,
}

/// Where on the path the machine is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Walker<R: Real, const AXES: usize> {
    piece: Option<Piece<R, AXES>>,
    /// Path position of the piece's start, from the stretch's start.
    piece_start: Position,
    /// Where the machine rests between stretches.
    rest: [Position; AXES],
    /// How many more pieces may end in this tick.
    ends_left: usize,
}

impl<R: Real, const AXES: usize> Walker<R, AXES> {
    pub(super) fn new(rest: [Position; AXES]) -> Self {
        Self { piece: None, piece_start: Position::ZERO, rest, ends_left: PIECES_PER_TICK_MAX }
    }

    /// Program line of the current piece; 0 at rest.
    pub(super) fn program_line(&self) -> u32 {
        self.piece.as_ref().map_or(0, Piece::program_line)
    }

    /// A new tick: the bound starts anew.
    #[inline]
    pub(super) fn start_tick(&mut self) {
        self.ends_left = PIECES_PER_TICK_MAX;
    }

    /// Goes forward to the piece that contains path position `s`.
    #[inline]
    pub(super) fn seek(&mut self, s: Position, intake: &mut Intake<'_, R, AXES>) -> Result<(), WalkError> {
        for _ in 0..=PIECES_PER_TICK_MAX {
            if let Some(piece) = &self.piece {
                // At the very end of the path a rounding step beyond it is still its end.
                if s - self.piece_start <= piece.length() || intake.at_end_of_path() {
                    return Ok(());
                }
                self.piece_start = self.piece_start + piece.length();
                self.end_piece()?;
            }
            match intake.take_path() {
                Some(PathItem::Piece(piece)) => {
                    if self.piece_start == Position::ZERO && !self.stands_at(&piece.start()) {
                        return Err(WalkError::NotHere);
                    }
                    self.piece = Some(piece);
                }
                Some(PathItem::EndOfStretch(_)) | None => return Err(WalkError::Starved),
            }
        }
        Err(WalkError::TooManyPieces)
    }

    /// Ends the stretch: what is left of its pieces is passed, and the machine rests at its end.
    #[inline]
    pub(super) fn finish(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<(), WalkError> {
        for _ in 0..=PIECES_PER_TICK_MAX {
            match intake.take_path() {
                Some(PathItem::EndOfStretch(end)) => {
                    self.end_piece()?;
                    (self.piece_start, self.rest) = (Position::ZERO, end);
                    return Ok(());
                }
                Some(PathItem::Piece(_)) => self.end_piece()?,
                None => return Err(WalkError::Starved),
            }
        }
        Err(WalkError::TooManyPieces)
    }

    #[inline]
    fn end_piece(&mut self) -> Result<(), WalkError> {
        self.piece = None;
        self.ends_left = self.ends_left.checked_sub(1).ok_or(WalkError::TooManyPieces)?;
        Ok(())
    }

    fn stands_at(&self, start: &[Position; AXES]) -> bool {
        let tolerance = START_TOLERANCE;
        self.rest.iter().zip(start).all(|(&rest, &start)| {
            let gap = start - rest;
            gap <= tolerance && -gap <= tolerance
        })
    }

    /// The set-points at path position `motion.s` of the current piece, or at rest.
    #[inline]
    pub(super) fn setpoints(&self, motion: &PathMotion<R>) -> [Setpoint<R>; AXES] {
        match &self.piece {
            Some(piece) => {
                let local = (motion.s - self.piece_start).max(Position::ZERO).min(piece.length());
                piece.at(local.to_offset(), motion)
            }
            None => self.rest.map(|position| Setpoint { position, ..Setpoint::default() }),
        }
    }
}
