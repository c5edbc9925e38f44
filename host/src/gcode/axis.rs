//! The nine axes of RS-274/NGC.

use std::fmt;

use super::decimal::Length;

/// How many axes a program may move.
pub const AXES_MAX: usize = 9;

/// A coordinate for every axis, in the order of [`Axis::ALL`]; of an axis that the machine does not have, 0 \[mm or °\].
pub type Point = [Length; AXES_MAX];

/// The point whose coordinates are all 0.
pub const ORIGIN: Point = [Length::ZERO; AXES_MAX];

/// The length that the feed of a straight move counts along, as LinuxCNC has it: over X, Y and Z if one of them moves, else
/// over U, V and W \[mm\], else over A, B and C \[°\].
pub(super) fn feed_length(from: Point, to: Point) -> f64 {
    let lengths = [AxisGroup::Xyz, AxisGroup::Uvw, AxisGroup::Abc].map(|group| {
        let of_group = Axis::ALL.into_iter().filter(|axis| axis.group() == group);
        let ways = of_group.map(|axis| to[axis.index()].to_mm() - from[axis.index()].to_mm());
        libm::sqrt(ways.map(|way| way * way).sum())
    });
    lengths.into_iter().find(|&length| length > 0.0).unwrap_or(0.0)
}

/// Whether only rotary axes move.
pub(super) fn is_rotary(from: Point, to: Point) -> bool {
    from != to && Axis::ALL.iter().all(|axis| axis.is_rotary() || from[axis.index()] == to[axis.index()])
}

/// X, Y and Z of a point \[mm\].
#[must_use]
pub fn xyz_mm(point: Point) -> [f64; 3] {
    core::array::from_fn(|axis| point[axis].to_mm())
}

/// An axis, by the letter of its words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// Linear, the first of the tool's three directions.
    X,
    /// Linear.
    Y,
    /// Linear, along the spindle of a mill.
    Z,
    /// Rotary, about X.
    A,
    /// Rotary, about Y.
    B,
    /// Rotary, about Z.
    C,
    /// Linear, beside X.
    U,
    /// Linear, beside Y.
    V,
    /// Linear, beside Z.
    W,
}

impl Axis {
    /// All of them, in the order of [`Point`].
    pub const ALL: [Self; AXES_MAX] =
        [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C, Self::U, Self::V, Self::W];

    /// Its place in a [`Point`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Its letter, upper case.
    #[must_use]
    pub const fn letter(self) -> char {
        LETTERS[self.index()] as char
    }

    /// The same, as a text.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"][self.index()]
    }

    /// The axis of a letter, of either case.
    #[must_use]
    pub fn of_letter(letter: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| LETTERS[axis.index()] == letter.to_ascii_uppercase())
    }

    /// Whether it counts degrees.
    #[must_use]
    pub const fn is_rotary(self) -> bool {
        matches!(self, Self::A | Self::B | Self::C)
    }

    /// The axes that a feed counts together with it.
    #[must_use]
    pub const fn group(self) -> AxisGroup {
        match self {
            Self::X | Self::Y | Self::Z => AxisGroup::Xyz,
            Self::U | Self::V | Self::W => AxisGroup::Uvw,
            Self::A | Self::B | Self::C => AxisGroup::Abc,
        }
    }
}

/// Axes that a feed counts together; as in LinuxCNC the first group that moves counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisGroup {
    /// X, Y and Z.
    Xyz,
    /// U, V and W.
    Uvw,
    /// A, B and C.
    Abc,
}

/// The letters, in the order of [`Axis::ALL`].
pub(super) const LETTERS: [u8; AXES_MAX] = *b"XYZABCUVW";

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A set of axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes(u16);

impl Axes {
    /// X, Y and Z.
    pub const XYZ: Self = Self(0b111);

    /// Whether an axis is among them.
    #[must_use]
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & (1 << axis.index()) != 0
    }

    /// The axes, in the order of [`Axis::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Axis> {
        Axis::ALL.into_iter().filter(move |&axis| self.contains(axis))
    }
}

impl Default for Axes {
    fn default() -> Self {
        Self::XYZ
    }
}

impl FromIterator<Axis> for Axes {
    fn from_iter<I: IntoIterator<Item = Axis>>(axes: I) -> Self {
        Self(axes.into_iter().fold(0, |set, axis| set | 1 << axis.index()))
    }
}

/// As "X, Y, Z".
impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, axis) in self.iter().enumerate() {
            write!(f, "{}{axis}", if place == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_name_their_axes() {
        for axis in Axis::ALL {
            assert_eq!(Axis::of_letter(axis.letter() as u8), Some(axis));
        }
        assert_eq!(Axis::of_letter(b'w'), Some(Axis::W));
        assert_eq!(Axis::of_letter(b'D'), None);
    }

    #[test]
    fn a_set_tells_its_axes() {
        let lathe: Axes = [Axis::Z, Axis::X].into_iter().collect();
        assert_eq!(lathe.to_string(), "X, Z");
        assert!(lathe.contains(Axis::X) && !lathe.contains(Axis::Y));
    }
}
