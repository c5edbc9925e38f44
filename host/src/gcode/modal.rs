//! The modes, which stay in force from line to line.

use super::block::{Block, GGroup};
use super::decimal::{Decimal, Length, LengthFault};
use super::error::{Located, Problem};
use super::lexer::Word;
use super::program::{PathMode, Plane};

/// Motion mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// G0.
    Rapid,
    /// G1.
    Feed,
    /// G2.
    Clockwise,
    /// G3.
    CounterClockwise,
    /// G5.
    Cubic,
    /// G5.5.
    Through,
}

impl Motion {
    /// The word that sets it.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Rapid => "G0",
            Self::Feed => "G1",
            Self::Clockwise => "G2",
            Self::CounterClockwise => "G3",
            Self::Cubic => "G5",
            Self::Through => "G5.5",
        }
    }

    /// Whether it makes arcs.
    pub(super) fn is_arc(self) -> bool {
        matches!(self, Self::Clockwise | Self::CounterClockwise)
    }
}

/// Units of lengths and feeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Units {
    /// G21.
    #[default]
    Millimetres,
    /// G20.
    Inches,
}

/// The point that coordinates are counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Distance {
    /// The origin.
    Absolute,
    /// The point where the move starts.
    Incremental,
}

/// The modes in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Modal {
    /// G0 G1 G2 G3 G5 G5.5; none after G80.
    pub(super) motion: Option<Motion>,
    /// G17 G18 G19.
    pub(super) plane: Plane,
    /// G20 G21.
    pub(super) units: Units,
    /// G90 G91.
    pub(super) distance: Distance,
    /// G90.1 G91.1.
    pub(super) arc_distance: Distance,
    /// G61 G64.
    pub(super) path: PathMode,
    /// F \[mm/min\], positive.
    pub(super) feed_mm_min: Option<f64>,
}

impl Default for Modal {
    /// Power-on modes of RS-274/NGC, and exact path.
    fn default() -> Self {
        Self {
            motion: None,
            plane: Plane::default(),
            units: Units::default(),
            distance: Distance::Absolute,
            arc_distance: Distance::Incremental,
            path: PathMode::default(),
            feed_mm_min: None,
        }
    }
}

impl Modal {
    /// Sets the modes a line asks for: plane, units, path mode, distance modes, motion mode.
    pub(super) fn set(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let tenths = |group| block.g(group).map(|code| code.tenths);
        match tenths(GGroup::Plane) {
            Some(170) => self.plane = Plane::Xy,
            Some(180) => self.plane = Plane::Zx,
            Some(_) => self.plane = Plane::Yz,
            None => {}
        }
        self.units = Units::of(block).unwrap_or(self.units);
        if block.is_blend() {
            self.path = self.blend(block)?;
        } else if tenths(GGroup::PathMode).is_some() {
            self.path = PathMode::ExactPath;
        }
        if let Some(tenths) = tenths(GGroup::Distance) {
            self.distance = if tenths == 900 { Distance::Absolute } else { Distance::Incremental };
        }
        if let Some(tenths) = tenths(GGroup::ArcDistance) {
            self.arc_distance = if tenths == 901 { Distance::Absolute } else { Distance::Incremental };
        }
        if let Some(tenths) = tenths(GGroup::Motion) {
            self.motion = match tenths {
                0 => Some(Motion::Rapid),
                10 => Some(Motion::Feed),
                20 => Some(Motion::Clockwise),
                30 => Some(Motion::CounterClockwise),
                50 => Some(Motion::Cubic),
                55 => Some(Motion::Through),
                _ => None,
            };
        }
        Ok(())
    }

    /// The path mode of G64; P and Q are lengths.
    fn blend(&self, block: &Block<'_>) -> Result<PathMode, Located> {
        let mut lengths_mm = [None; 2];
        for (length_mm, letter) in lengths_mm.iter_mut().zip([b'P', b'Q']) {
            if let Some(word) = block.letter(letter) {
                word.refuse_negative()?;
                *length_mm = Some(self.units.length(word)?.to_mm());
            }
        }
        let [tolerance_mm, merging_mm] = lengths_mm;
        Ok(PathMode::Blend { tolerance_mm, merging_mm })
    }
}

impl Units {
    /// The units a line sets.
    pub(super) fn of(block: &Block<'_>) -> Option<Self> {
        block.g(GGroup::Units).map(|code| if code.tenths == 200 { Self::Inches } else { Self::Millimetres })
    }

    /// The length a word gives.
    pub(super) fn length(self, word: Word<'_>) -> Result<Length, Located> {
        let length = match self {
            Self::Millimetres => Length::from_mm(word.number),
            Self::Inches => Length::from_inches(word.number),
        };
        length.map_err(|fault| {
            word.problem(|word| match fault {
                LengthFault::OutOfRange => Problem::LengthOutOfRange { word },
                LengthFault::Inexact => Problem::InchesInexact { word },
            })
        })
    }

    /// \[mm/min\] of a feed; a feed is a speed, not a place, and may be rounded to the nearest f64.
    pub(super) fn feed_mm_min(self, feed: Decimal) -> f64 {
        const MM_PER_INCH_TENTHS: f64 = 254.0;
        match self {
            Self::Millimetres => feed.to_f64(),
            Self::Inches => feed.to_f64() * MM_PER_INCH_TENTHS / 10.0,
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::*;

    #[test]
    fn feeds_in_inches_are_the_nearest_double() {
        for (text, feed_mm_min) in [("1", 25.4), ("100", 2540.0), ("0.5", 12.7), ("60", 1524.0)] {
            let feed = Decimal::parse(text.as_bytes()).unwrap();
            assert_eq!(Units::Inches.feed_mm_min(feed), feed_mm_min);
        }
    }
}
