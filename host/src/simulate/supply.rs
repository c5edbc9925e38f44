//! Keeps the two streams filled.
//!
//! Consumes the items of an [`Executable`]; offers them to the [`Feeder`] until it says it is full,
//! whenever it is called. Pieces and segments of a stretch go in side by side.

use motion_kernel::num::Real;
use motion_kernel::queue::{Feeder, Refused, Rejection};

use crate::planning::{Executable, ExecutableItem};
use crate::record::AXES;

/// Where the supply stands.
pub struct Supply<'a, R: Real> {
    items: &'a [ExecutableItem<R>],
    piece: usize,
    segment: usize,
}

impl<'a, R: Real> Supply<'a, R> {
    /// All of `executable` still to do.
    #[must_use]
    pub fn new(executable: &'a Executable<R>) -> Self {
        Self { items: &executable.items, piece: 0, segment: 0 }
    }

    /// Whether everything has been offered and taken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Fills the streams.
    ///
    /// # Errors
    /// The kernel rejects an item: the plan and the kernel's rules disagree.
    pub fn fill(&mut self, feeder: &mut Feeder<'_, R, AXES>) -> Result<(), Rejection> {
        while let Some(item) = self.items.first() {
            let taken = match item {
                ExecutableItem::Stretch { pieces, segments, end, .. } => {
                    while let Some(&piece) = pieces.get(self.piece)
                        && taken(feeder.piece(piece))?
                    {
                        self.piece += 1;
                    }
                    while let Some(&segment) = segments.get(self.segment)
                        && taken(feeder.segment(segment))?
                    {
                        self.segment += 1;
                    }
                    let complete = self.piece == pieces.len() && self.segment == segments.len();
                    complete && taken(feeder.end_stretch(*end))?
                }
                ExecutableItem::Dwell(duration) => taken(feeder.dwell(*duration))?,
                ExecutableItem::Stop => taken(feeder.program_stop())?,
            };
            if !taken {
                return Ok(());
            }
            self.items = &self.items[1..];
            (self.piece, self.segment) = (0, 0);
        }
        Ok(())
    }
}

/// Whether the queue had room.
fn taken<T>(answer: Result<(), Refused<T>>) -> Result<bool, Rejection> {
    match answer {
        Ok(()) => Ok(true),
        Err(Refused::Full(_)) => Ok(false),
        Err(Refused::Invalid(rejection)) => Err(rejection),
    }
}
