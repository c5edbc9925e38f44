//! Polar coordinates: `@` and `^`, the distance from the program's zero and the angle about it, in XY.
//!
//! As in LinuxCNC: the one that is not given stays; after G91 both are added to those of the position.

use super::block::Block;
use super::decimal::Length;
use super::error::{Located, Problem};
use super::lexer::Word;
use super::modal::{Distance, Modal};

/// The polar words of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polar<'a> {
    /// `@`.
    distance: Option<Word<'a>>,
    /// `^` \[°\], counter-clockwise from X.
    angle: Option<Word<'a>>,
}

impl<'a> Polar<'a> {
    /// The polar words of a line, if it has any; X and Y beside them are refused.
    pub(super) fn of(block: &Block<'a>) -> Result<Option<Self>, Located> {
        let [distance, angle] = [b'@', b'^'].map(|letter| block.letter(letter));
        if distance.or(angle).is_none() {
            return Ok(None);
        }
        match block.letter(b'X').or(block.letter(b'Y')) {
            Some(word) => Err(word.problem(|word| Problem::PolarWithAxes { word })),
            None => Ok(Some(Self { distance, angle })),
        }
    }

    /// The point they lead to from `here`, X and Y.
    pub(super) fn point(self, here: [Length; 2], modal: &Modal) -> Result<[Length; 2], Located> {
        let [x, y] = here.map(Length::to_mm);
        let Some(word) = self.distance.or(self.angle) else { return Ok(here) };
        let is_incremental = modal.distance == Distance::Incremental;
        if (is_incremental || self.angle.is_none()) && here == [Length::ZERO; 2] {
            return Err(word.problem(|word| Problem::PolarAtZero { word }));
        }
        let (mut distance_mm, mut angle_rad) = (libm::hypot(x, y), libm::atan2(y, x));
        if let Some(word) = self.distance {
            let length_mm = modal.units.length(word)?.to_mm();
            distance_mm = if is_incremental { distance_mm + length_mm } else { length_mm };
        }
        if let Some(word) = self.angle {
            let turn_rad = word.number.to_f64().to_radians();
            angle_rad = if is_incremental { angle_rad + turn_rad } else { turn_rad };
        }
        let (sine, cosine) = libm::sincos(angle_rad);
        let beyond = || word.problem(|word| Problem::PositionOutOfRange { word });
        let length = |mm| Length::nearest(mm).ok_or_else(beyond);
        Ok([length(distance_mm * cosine)?, length(distance_mm * sine)?])
    }
}
