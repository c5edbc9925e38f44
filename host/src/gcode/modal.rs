//! The modes, which stay in force from line to line.

use super::arc::{RADIUS_MISMATCH_INCH, RADIUS_MISMATCH_MM};
use super::axis::Axis;
use super::block::{Block, GGroup};
use super::cycle::Cycle;
use super::decimal::Length;
use super::error::{Located, Problem};
use super::lexer::Word;
use super::number::Number;
use super::nurbs::Kind;
use super::probe::ProbeKind;
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
    /// G5.1.
    Quadratic,
    /// G5.5.
    Through,
    /// G5.2 and G6.2.
    Nurbs(Kind),
    /// G38.2 to G38.5.
    Probe(ProbeKind),
    /// G73 to G89.
    Cycle(Cycle),
}

impl Motion {
    /// The mode that a G word sets, by its number in tenths; none for G80.
    fn of(tenths: i64) -> Option<Self> {
        Some(match tenths {
            0 => Self::Rapid,
            10 => Self::Feed,
            20 => Self::Clockwise,
            30 => Self::CounterClockwise,
            50 => Self::Cubic,
            51 => Self::Quadratic,
            52 => Self::Nurbs(Kind::Uniform),
            55 => Self::Through,
            62 => Self::Nurbs(Kind::Knotted),
            382..=385 => Self::Probe(ProbeKind::of(tenths)?),
            _ => Self::Cycle(Cycle::of(tenths)?),
        })
    }

    /// The word that sets it.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Rapid => "G0",
            Self::Feed => "G1",
            Self::Clockwise => "G2",
            Self::CounterClockwise => "G3",
            Self::Cubic => "G5",
            Self::Quadratic => "G5.1",
            Self::Through => "G5.5",
            Self::Nurbs(kind) => kind.word(),
            Self::Probe(kind) => kind.word(),
            Self::Cycle(cycle) => cycle.word(),
        }
    }

    /// The number of its word in tenths.
    pub(super) fn tenths(self) -> i64 {
        match self {
            Self::Rapid => 0,
            Self::Feed => 10,
            Self::Clockwise => 20,
            Self::CounterClockwise => 30,
            Self::Cubic => 50,
            Self::Quadratic => 51,
            Self::Through => 55,
            Self::Nurbs(kind) => kind.tenths(),
            Self::Probe(kind) => kind.tenths(),
            Self::Cycle(cycle) => cycle.tenths(),
        }
    }

    /// Whether the mode is G2 or G3.
    pub(super) fn is_arc(self) -> bool {
        matches!(self, Self::Clockwise | Self::CounterClockwise)
    }

    /// Whether it takes a letter other than those of the axes.
    pub(super) fn takes(self, letter: u8) -> bool {
        match self {
            Self::Rapid | Self::Feed | Self::Through | Self::Probe(_) => false,
            Self::Clockwise | Self::CounterClockwise => matches!(letter, b'I' | b'J' | b'K' | b'R' | b'P'),
            Self::Cubic => matches!(letter, b'I' | b'J' | b'P' | b'Q'),
            Self::Quadratic => matches!(letter, b'I' | b'J'),
            Self::Nurbs(kind) => kind.letters().contains(&letter),
            Self::Cycle(cycle) => cycle.takes(letter),
        }
    }
}

/// F, positive, a minute or a revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeedWord {
    /// Of linear axes \[mm\].
    pub(super) linear: f64,
    /// Of rotary axes alone \[°\]: the number as it stands, in inches too.
    pub(super) angular: f64,
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

/// The meaning of F.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum FeedMode {
    /// G93: one by the minutes that a move takes; in every line with a move at a feed.
    InverseTime,
    /// G94: per minute.
    #[default]
    PerMinute,
    /// G95: per revolution of the spindle, at its commanded speed.
    PerRevolution,
}

/// What was commanded of the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spindle {
    /// M3: clockwise; M4: not; M5: none.
    pub(super) clockwise: Option<bool>,
    /// S \[rev/min\], after G96 \[m/min or feet/min\].
    pub(super) speed: f64,
    /// G96: S is a speed of the surface.
    pub(super) is_surface: bool,
}

/// Overrides that M48 to M53 allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Overrides {
    /// M50.
    pub(super) feed: bool,
    /// M51.
    pub(super) speed: bool,
    /// M52.
    pub(super) adaptive_feed: bool,
    /// M53.
    pub(super) feed_stop: bool,
}

impl Default for Overrides {
    fn default() -> Self {
        Self { feed: true, speed: true, adaptive_feed: false, feed_stop: true }
    }
}

/// The modes in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Modal {
    /// G0 G1 G2 G3 G5 G5.1 G5.2 G5.5 G6.2 G38.2 to G38.5, drilling cycles; none after G80.
    pub(super) motion: Option<Motion>,
    /// G17 G18 G19.
    pub(super) plane: Plane,
    /// G20 G21.
    pub(super) units: Units,
    /// G90 G91.
    pub(super) distance: Distance,
    /// G90.1 G91.1.
    pub(super) arc_distance: Distance,
    /// G7: X words are diameters.
    pub(super) is_diameter: bool,
    /// G61 G61.1 G64.
    pub(super) path: PathMode,
    /// G93 G94 G95.
    pub(super) feed_mode: FeedMode,
    /// F; none before the first, after a change of mode, and in G93.
    pub(super) feed: Option<FeedWord>,
    /// G99: drilling cycles end at R, not where they began.
    pub(super) retracts_to_r: bool,
    pub(super) spindle: Spindle,
    /// M7.
    pub(super) mist: bool,
    /// M8.
    pub(super) flood: bool,
    pub(super) overrides: Overrides,
}

impl Default for Modal {
    /// Power-on modes of RS-274/NGC; the path mode is the machine's choice.
    fn default() -> Self {
        Self {
            motion: None,
            plane: Plane::default(),
            units: Units::default(),
            distance: Distance::Absolute,
            arc_distance: Distance::Incremental,
            is_diameter: false,
            path: PathMode::default(),
            feed_mode: FeedMode::default(),
            feed: None,
            retracts_to_r: false,
            spindle: Spindle::default(),
            mist: false,
            flood: false,
            overrides: Overrides::default(),
        }
    }
}

impl Modal {
    /// Sets what F means. Another meaning needs another F.
    pub(super) fn set_feed_mode(&mut self, block: &Block<'_>) {
        let mode = match block.g(GGroup::FeedMode).map(|code| code.tenths) {
            Some(930) => FeedMode::InverseTime,
            Some(950) => FeedMode::PerRevolution,
            Some(_) => FeedMode::PerMinute,
            None => return,
        };
        if mode != self.feed_mode {
            self.feed_mode = mode;
            self.feed = None;
        }
    }

    /// Sets the modes a line asks for: plane, units, path mode, distance modes, retraction, motion mode.
    pub(super) fn set(&mut self, block: &Block<'_>) -> Result<(), Located> {
        let tenths = |group| block.g(group).map(|code| code.tenths);
        match tenths(GGroup::Plane) {
            Some(170) => self.plane = Plane::Xy,
            Some(180) => self.plane = Plane::Zx,
            Some(_) => self.plane = Plane::Yz,
            None => {}
        }
        self.units = Units::of(block).unwrap_or(self.units);
        match tenths(GGroup::PathMode) {
            Some(640) => self.path = self.blend(block)?,
            Some(611) => self.path = PathMode::ExactStop,
            Some(_) => self.path = PathMode::ExactPath,
            None => {}
        }
        if let Some(tenths) = tenths(GGroup::Distance) {
            self.distance = if tenths == 900 { Distance::Absolute } else { Distance::Incremental };
        }
        if let Some(tenths) = tenths(GGroup::ArcDistance) {
            self.arc_distance = if tenths == 901 { Distance::Absolute } else { Distance::Incremental };
        }
        if let Some(tenths) = tenths(GGroup::Diameter) {
            self.is_diameter = tenths == 70;
        }
        if let Some(tenths) = tenths(GGroup::Retract) {
            self.retracts_to_r = tenths == 990;
        }
        if let Some(tenths) = tenths(GGroup::Motion) {
            self.motion = Motion::of(tenths);
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

    /// The coordinate an axis word gives \[mm, ° of a rotary axis\].
    pub(super) fn coordinate(self, word: Word<'_>) -> Result<Length, Located> {
        let is_rotary = Axis::of_letter(word.letter).is_some_and(Axis::is_rotary);
        if is_rotary { Self::Millimetres.length(word) } else { self.length(word) }
    }

    /// The length a word gives.
    pub(super) fn length(self, word: Word<'_>) -> Result<Length, Located> {
        let length = match (self, word.number) {
            (Self::Millimetres, Number::Exact(number)) => Length::from_mm(number),
            (Self::Inches, Number::Exact(number)) => Length::from_inches(number),
            (_, Number::Real(value)) => Length::nearest(self.mm(value)),
        };
        length.ok_or_else(|| word.problem(|word| Problem::LengthOutOfRange { word }))
    }

    /// \[mm\] of a number in these units, rounded to the nearest f64: for speeds and for what is computed.
    pub(super) fn mm(self, value: f64) -> f64 {
        const MM_PER_INCH_TENTHS: f64 = 254.0;
        match self {
            Self::Millimetres => value,
            Self::Inches => value * MM_PER_INCH_TENTHS / 10.0,
        }
    }

    /// How far the radii of an arc's ends may differ in any case \[mm\].
    pub(super) fn radius_mismatch_mm(self) -> f64 {
        match self {
            Self::Millimetres => RADIUS_MISMATCH_MM,
            Self::Inches => self.mm(RADIUS_MISMATCH_INCH),
        }
    }

    /// A number of millimetres in these units.
    pub(super) fn of_mm(self, mm: f64) -> f64 {
        match self {
            Self::Millimetres => mm,
            Self::Inches => mm / 25.4,
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
            assert_eq!(Units::Inches.mm(text.parse().unwrap()), feed_mm_min);
        }
    }
}
