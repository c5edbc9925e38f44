//! The words of one line, each in its slot.
//!
//! A slot holds one word. So a word given twice, two words of one modal group, and words without a slot are
//! refused here, the leftmost first. The interpreter acts on the words.

use super::axis::{AXES_MAX, Axes, Axis, LETTERS as LETTERS_OF_AXES};
use super::error::{Located, Problem};
use super::expression::Environment;
use super::lexer::{Assignment, Cursor, Item, Items, Word};
use super::message;
use super::modal::Motion;
use super::number::Number;

/// Letters that take a number of their own.
const LETTERS: &[u8; 25] = b"ABCDEFHIJKLNPQRSTUVWXYZ@^";
/// The slot of every letter by its byte; beyond the last for letters without a slot.
const SLOTS: [u8; 128] = {
    let mut slots = [u8::MAX; 128];
    let mut slot = 0;
    while slot < LETTERS.len() {
        slots[LETTERS[slot] as usize] = slot as u8;
        slot += 1;
    }
    slots
};

/// The slot of a letter.
fn slot_of(letter: u8) -> Option<usize> {
    SLOTS.get(usize::from(letter)).map(|&slot| usize::from(slot))
}

/// Modal groups of G words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GGroup {
    /// G0 G1 G2 G3 G5 G5.1 G5.2 G5.5 G6.2 G33 G33.1 G38.2 to G38.5 G73 G74 G76 G80 to G86 G88 G89.
    Motion,
    /// G4 G5.3 G6.3 G10 G28 G28.1 G30 G30.1 G52 G53 G92: in force for their line.
    NonModal,
    /// G92.1 G92.2 G92.3.
    Shift,
    /// G17 G18 G19.
    Plane,
    /// G20 G21.
    Units,
    /// G90 G91.
    Distance,
    /// G90.1 G91.1.
    ArcDistance,
    /// G61 G61.1 G64.
    PathMode,
    /// G40 G41 G41.1 G42 G42.1.
    CutterCompensation,
    /// G43 G43.1 G43.2 G49.
    ToolLength,
    /// G54 to G59.3.
    CoordinateSystem,
    /// G7 G8.
    Diameter,
    /// G93 G94 G95.
    FeedMode,
    /// G96 G97.
    SpindleMode,
    /// G98 G99.
    Retract,
}

/// Groups of M words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MGroup {
    /// M0 M1 M2 M30 M60.
    Stop,
    /// M3 M4 M5.
    Spindle,
    /// M6 M61.
    ToolChange,
    /// M7: may run together with flood.
    Mist,
    /// M8.
    Flood,
    /// M9.
    CoolantOff,
    /// M48 to M53.
    Override,
    /// M62 to M68.
    InputOutput,
    /// M70 to M73.
    Modes,
    /// M98 M99.
    Subprogram,
    /// M100 to M199: a program of the user's.
    User,
}

const G_GROUPS: usize = GGroup::Retract as usize + 1;
const M_GROUPS: usize = MGroup::User as usize + 1;

/// The group of a G word, by its number in tenths.
fn g_group(tenths: i64) -> Option<GGroup> {
    Some(match tenths {
        330 | 331 | 382..=385 | 740 | 760 | 840 => GGroup::Motion,
        0 | 10 | 20 | 30 | 50 | 51 | 52 | 55 | 62 | 730 | 800 | 810 | 820 | 830 | 850 | 860 | 880 | 890 => {
            GGroup::Motion
        }
        40 | 53 | 63 | 100 | 280 | 281 | 300 | 301 | 520 | 530 | 920 => GGroup::NonModal,
        921..=923 => GGroup::Shift,
        170 | 180 | 190 => GGroup::Plane,
        200 | 210 => GGroup::Units,
        900 | 910 => GGroup::Distance,
        901 | 911 => GGroup::ArcDistance,
        610 | 611 | 640 => GGroup::PathMode,
        400 | 410 | 411 | 420 | 421 => GGroup::CutterCompensation,
        430..=432 | 490 => GGroup::ToolLength,
        540 | 550 | 560 | 570 | 580 | 590..=593 => GGroup::CoordinateSystem,
        70 | 80 => GGroup::Diameter,
        930 | 940 | 950 => GGroup::FeedMode,
        960 | 970 => GGroup::SpindleMode,
        980 | 990 => GGroup::Retract,
        _ => return None,
    })
}

/// The group of an M word, by its number in tenths.
fn m_group(tenths: i64) -> Option<MGroup> {
    Some(match tenths {
        0 | 10 | 20 | 300 | 600 => MGroup::Stop,
        30 | 40 | 50 => MGroup::Spindle,
        60 | 610 => MGroup::ToolChange,
        70 => MGroup::Mist,
        80 => MGroup::Flood,
        90 => MGroup::CoolantOff,
        480 | 490 | 500 | 510 | 520 | 530 => MGroup::Override,
        620 | 630 | 640 | 650 | 660 | 670 | 680 => MGroup::InputOutput,
        700 | 710 | 720 | 730 => MGroup::Modes,
        980 | 990 => MGroup::Subprogram,
        1000..=1990 if tenths % 10 == 0 => MGroup::User,
        _ => return None,
    })
}

/// The problem of a G word without a group.
fn unsupported_g(word: &Word<'_>) -> Located {
    word.problem(|word| Problem::UnsupportedG { word })
}

/// The problem of an M word without a group.
fn unsupported_m(word: &Word<'_>) -> Located {
    let tenths = word.number.tenths();
    word.problem(|word| match tenths {
        Some(190) => Problem::NeedsEncoder { word },
        _ => Problem::UnsupportedM { word },
    })
}

/// A G or M word in its slot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Code<'a> {
    /// Its number in tenths: G90.1 is 901.
    pub(super) tenths: i64,
    /// The word.
    pub(super) word: Word<'a>,
}

/// The words of a line.
#[derive(Debug, Default)]
pub(super) struct Block<'a> {
    letters: [Option<Word<'a>>; LETTERS.len()],
    g: [Option<Code<'a>>; G_GROUPS],
    m: [Option<Code<'a>>; M_GROUPS],
    /// Parameters to assign before the line is executed, in order.
    pub(super) assignments: Vec<Assignment>,
    /// Comments that ask for something: `(MSG,…)` and the like, without their parentheses.
    pub(super) comments: Vec<&'a [u8]>,
    /// A comment asks for a file that is written.
    pub(super) asks_for_file: bool,
    /// A number had more decimals than are exact.
    pub(super) rounded: bool,
    any: bool,
}

impl<'a> Block<'a> {
    /// Collects the words of a line, from the cursor on, for a machine with these axes.
    pub(super) fn collect(
        cursor: Cursor<'a>,
        environment: &dyn Environment,
        axes: Axes,
    ) -> Result<Self, Located> {
        let mut block = Self::default();
        for item in Items::new(cursor, environment) {
            match item? {
                Item::Word(word) => block.put_word(word, axes)?,
                Item::Assignment(assignment) => block.assignments.push(assignment),
                Item::Comment(text) if message::is_active(text) => {
                    block.comments.push(text);
                    continue;
                }
                Item::Comment(text) => {
                    block.asks_for_file |= message::is_file(text);
                    continue;
                }
            }
            block.any = true;
        }
        let is_diameter = match block.g(GGroup::Diameter) {
            Some(code) => code.tenths == 70,
            None => environment.is_diameter(),
        };
        if is_diameter {
            block.halve_x();
        }
        Ok(block)
    }

    /// After G7, also in the line itself, X is a diameter.
    fn halve_x(&mut self) {
        for word in self.letters.iter_mut().flatten().filter(|word| word.letter == b'X') {
            word.number = word.number.half();
        }
    }

    fn put_word(&mut self, word: Word<'a>, axes: Axes) -> Result<(), Located> {
        self.rounded |= word.rounded;
        match word.letter {
            b'G' => {
                let (group, code) = number(word, g_group).ok_or_else(|| unsupported_g(&word))?;
                self.put_g(group, code)
            }
            b'M' => {
                let (group, code) = number(word, m_group).ok_or_else(|| unsupported_m(&word))?;
                self.refuse_coolant_clash((group, code))?;
                put(&mut self.m, group as usize, code)
            }
            b'N' if self.any || word.number.signum() < 0 => {
                Err(word.problem(|word| Problem::LineNumber { word }))
            }
            b'O' => Err(word.problem(|word| Problem::OWordPlace { word })),
            letter if Axis::of_letter(letter).is_some_and(|axis| !axes.contains(axis)) => {
                Err(word.problem(|word| Problem::NoSuchAxis { word, axes }))
            }
            _ => self.put_letter(word),
        }
    }

    /// G80 gives way to another motion word: it only says that no cycle goes on.
    fn put_g(&mut self, group: GGroup, code: Code<'a>) -> Result<(), Located> {
        if group == GGroup::Motion {
            match self.g(GGroup::Motion) {
                Some(other) if other.tenths == 800 && code.tenths != 800 => {
                    if let Some(slot) = self.g.get_mut(group as usize) {
                        *slot = None;
                    }
                }
                Some(other) if code.tenths == 800 && other.tenths != 800 => return Ok(()),
                _ => {}
            }
        }
        put(&mut self.g, group as usize, code)
    }

    /// Whether the line has neither words nor assignments.
    pub(super) fn is_empty(&self) -> bool {
        !self.any
    }

    /// Whether a length of the line is no whole count of 10⁻¹⁰ mm in inches.
    pub(super) fn is_inexact_in_inches(&self) -> bool {
        b"DIJKPQRUVWXYZ".iter().filter_map(|&letter| self.letter(letter)).any(|word| match word.number {
            Number::Exact(number) => !number.is_exact_in_inches(),
            Number::Real(_) => false,
        })
    }

    /// The leftmost word whose letter is not in `letters`, but for the G words of these tenths.
    pub(super) fn stranger(&self, letters: &[u8], g_tenths: &[i64]) -> Option<Word<'a>> {
        let g = self.g.iter().flatten().filter(|code| !g_tenths.contains(&code.tenths));
        let codes = g.chain(self.m.iter().flatten()).map(|code| code.word);
        let words = self.letters.iter().flatten().copied().chain(codes);
        words.filter(|word| !letters.contains(&word.letter)).min_by_key(|word| word.offset)
    }

    fn put_letter(&mut self, word: Word<'a>) -> Result<(), Located> {
        let slot = slot_of(word.letter);
        let Some(slot) = slot.and_then(|index| self.letters.get_mut(index)) else {
            // All letters have a slot, or a group.
            return Ok(());
        };
        if slot.is_some() {
            let letter = char::from(word.letter);
            return Err(word.problem(|word| Problem::WordTwice { letter, word }));
        }
        *slot = Some(word);
        Ok(())
    }

    /// The leftmost word that would be executed behind M6.
    pub(super) fn beside_tool_change(&self) -> Option<Word<'a>> {
        let change = self.m(MGroup::ToolChange).map(|code| code.word.offset);
        let codes = self.g.iter().chain(&self.m).flatten().map(|code| code.word);
        let letters = self.letters.iter().flatten().copied();
        let letters = letters.filter(|word| !matches!(word.letter, b'N' | b'T' | b'S' | b'F'));
        letters.chain(codes.filter(|word| Some(word.offset) != change)).min_by_key(|word| word.offset)
    }

    /// M7 and M8 go together, neither goes with M9.
    fn refuse_coolant_clash(&self, (group, code): (MGroup, Code<'a>)) -> Result<(), Located> {
        let clash = match group {
            MGroup::CoolantOff => self.m(MGroup::Mist).or(self.m(MGroup::Flood)),
            MGroup::Mist | MGroup::Flood => self.m(MGroup::CoolantOff),
            _ => None,
        };
        clash.map_or(Ok(()), |other| Err(same_group(code, other)))
    }

    /// Whether nothing in the line takes its D. Posts for Fanuc name the tool's radius beside its length, where its use
    /// may begin much later.
    pub(super) fn has_idle_d(&self) -> bool {
        self.letter(b'D').is_some() && self.takers(b'D') == 0
    }

    /// G53.
    pub(super) fn machine_word(&self) -> Option<Word<'a>> {
        self.g(GGroup::NonModal).filter(|code| code.tenths == 530).map(|code| code.word)
    }

    /// Whether the line sets G64.
    pub(super) fn is_blend(&self) -> bool {
        self.has_g(GGroup::PathMode, &[640])
    }

    fn has_g(&self, group: GGroup, tenths: &[i64]) -> bool {
        self.g(group).is_some_and(|code| tenths.contains(&code.tenths))
    }

    fn has_m(&self, group: MGroup, tenths: &[i64]) -> bool {
        self.m(group).is_some_and(|code| tenths.contains(&code.tenths))
    }

    /// Whether a word other than a motion word takes the axis words.
    pub(super) fn axes_are_taken(&self) -> bool {
        self.has_g(GGroup::NonModal, &[100, 280, 300, 520, 920])
            || self.has_g(GGroup::ToolLength, &[431, 432])
    }

    /// The number of words, other than motion words, that take a letter.
    fn takers(&self, letter: u8) -> usize {
        let g = |group, tenths: &[i64]| usize::from(self.has_g(group, tenths));
        let m = |group, tenths: &[i64]| usize::from(self.has_m(group, tenths));
        let setup = g(GGroup::NonModal, &[100]);
        match letter {
            b'P' => {
                g(GGroup::NonModal, &[40, 100])
                    + g(GGroup::PathMode, &[640])
                    + m(MGroup::Override, &[500, 510, 520, 530])
                    + m(MGroup::InputOutput, &[620, 630, 640, 650, 660])
                    + m(MGroup::Subprogram, &[980])
            }
            b'Q' => {
                setup
                    + g(GGroup::PathMode, &[640])
                    + m(MGroup::ToolChange, &[610])
                    + m(MGroup::InputOutput, &[660, 670, 680])
            }
            b'L' => {
                setup
                    + g(GGroup::CutterCompensation, &[411, 421])
                    + m(MGroup::InputOutput, &[660])
                    + m(MGroup::Subprogram, &[980])
            }
            b'E' => m(MGroup::InputOutput, &[660, 670, 680]),
            b'D' => g(GGroup::CutterCompensation, &[410, 411, 420, 421]) + g(GGroup::SpindleMode, &[960]),
            b'H' => g(GGroup::ToolLength, &[430, 432]),
            b'I' | b'J' | b'R' => setup,
            _ => 0,
        }
    }

    /// A word nothing in the line takes would be silently dropped, and a word that two others take would do
    /// two things. `motion` is the mode in force.
    pub(super) fn refuse_unused(&self, motion: Option<Motion>) -> Result<(), Located> {
        const CHECKED: [(u8, &str); 11] = [
            (b'@', "a move in the XY plane"),
            (b'^', "a move in the XY plane"),
            (b'E', "M66, M67 or M68"),
            (b'H', "G43 or G43.2"),
            (b'I', "G2, G3, G5, G5.1 or G10"),
            (b'J', "G2, G3, G5, G5.1 or G10"),
            (b'K', "G2, G3 or G6.2"),
            (b'L', "G5.2, G10, G41.1, G42.1, M66, M98 or a drilling cycle"),
            (
                b'P',
                "G2, G3, G4, G5, G5.2, G6.2, G10, G64, a cycle with a dwell, M50 to M53, M62 to M66 or M98",
            ),
            (b'Q', "G5, G6.2, G10, G64, G73, G83, M61 or M66 to M68"),
            (b'R', "G2, G3, G6.2, G10 or a drilling cycle"),
        ];
        let moves = self.moves(motion);
        let mut first: Option<Located> = None;
        for (letter, needs) in CHECKED {
            let Some(word) = self.letter(letter) else { continue };
            let others = self.takers(letter);
            let is_polar = matches!(letter, b'@' | b'^') && !self.axes_are_taken();
            let by_motion = is_polar || motion.is_some_and(|motion| motion.takes(letter));
            let problem = if others == 0 && !by_motion {
                word.problem(|word| Problem::WordUnused { word, needs })
            } else if others > 1 || others == 1 && by_motion && moves {
                word.problem(|word| Problem::WordShared { word, letter: char::from(letter) })
            } else {
                continue;
            };
            if first.as_ref().is_none_or(|first| problem.offset < first.offset) {
                first = Some(problem);
            }
        }
        first.map_or(Ok(()), Err)
    }

    /// Whether the line asks for a move in the mode `motion`.
    pub(super) fn moves(&self, motion: Option<Motion>) -> bool {
        let has_axes = self.has_axes() && !self.axes_are_taken();
        let own = |letters: &[u8]| letters.iter().any(|&letter| self.own(letter).is_some());
        has_axes
            || match motion {
                Some(motion) if motion.is_arc() => own(b"IJKR"),
                Some(Motion::Cubic) => own(b"IJPQ"),
                Some(Motion::Quadratic) => own(b"IJ"),
                Some(Motion::Nurbs(kind)) => own(kind.letters()),
                _ => false,
            }
    }

    /// The word with a letter, if no word but a motion word takes it.
    pub(super) fn own(&self, letter: u8) -> Option<Word<'a>> {
        self.letter(letter).filter(|_| self.takers(letter) == 0)
    }

    /// The word with a letter of its own.
    pub(super) fn letter(&self, letter: u8) -> Option<Word<'a>> {
        self.letters.get(slot_of(letter)?).copied().flatten()
    }

    /// Whether there are words of axes, polar ones too.
    pub(super) fn has_axes(&self) -> bool {
        b"@^".iter().chain(&LETTERS_OF_AXES).any(|&letter| self.letter(letter).is_some())
    }

    /// The words of the axes, in the order of a [`Point`](super::Point).
    pub(super) fn axes(&self) -> [Option<Word<'a>>; AXES_MAX] {
        LETTERS_OF_AXES.map(|letter| self.letter(letter))
    }

    /// The leftmost word of an axis that is none of `axes`.
    pub(super) fn axis_beside(&self, axes: Axes) -> Option<Word<'a>> {
        let others = Axis::ALL.into_iter().filter(|&axis| !axes.contains(axis));
        others.filter_map(|axis| self.letter(axis.letter() as u8)).min_by_key(|word| word.offset)
    }

    /// I, J and K.
    pub(super) fn offsets(&self) -> [Option<Word<'a>>; 3] {
        [self.letter(b'I'), self.letter(b'J'), self.letter(b'K')]
    }

    /// The G word of a group.
    pub(super) fn g(&self, group: GGroup) -> Option<Code<'a>> {
        self.g.get(group as usize).copied().flatten()
    }

    /// The M word of a group.
    pub(super) fn m(&self, group: MGroup) -> Option<Code<'a>> {
        self.m.get(group as usize).copied().flatten()
    }
}

fn number<'a, Group>(word: Word<'a>, group: impl Fn(i64) -> Option<Group>) -> Option<(Group, Code<'a>)> {
    let tenths = word.number.tenths()?;
    Some((group(tenths)?, Code { tenths, word }))
}

fn put<'a>(slots: &mut [Option<Code<'a>>], index: usize, code: Code<'a>) -> Result<(), Located> {
    match slots.get_mut(index) {
        Some(Some(other)) => Err(same_group(code, *other)),
        Some(slot) => {
            *slot = Some(code);
            Ok(())
        }
        // The slots are as many as the groups.
        None => Ok(()),
    }
}

fn same_group(code: Code<'_>, other: Code<'_>) -> Located {
    code.word.problem(|word| Problem::SameGroup { word, other: other.word.text() })
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the point")]
mod tests {
    use super::super::expression::NoParameters;
    use super::*;

    fn collect(line: &[u8]) -> Result<Block<'_>, Located> {
        Block::collect(Cursor::new(line), &NoParameters, Axes::XYZ)
    }

    #[test]
    fn g80_gives_way_to_another_motion_word() {
        for line in [&b"G80 G0"[..], b"G0 G80", b"G0"] {
            assert_eq!(collect(line).unwrap().g(GGroup::Motion).unwrap().tenths, 0);
        }
        assert_eq!(collect(b"G80").unwrap().g(GGroup::Motion).unwrap().tenths, 800);
        assert!(collect(b"G80 G80").is_err() && collect(b"G0 G80 G1").is_err());
    }

    #[test]
    fn codes_may_be_computed() {
        let block = collect(b"G[90/10+50.1] M[2+1]").unwrap();
        assert_eq!(block.g(GGroup::CoordinateSystem).unwrap().tenths, 591);
        assert_eq!(block.m(MGroup::Spindle).unwrap().tenths, 30);
    }

    #[test]
    fn every_word_finds_its_slot() {
        let block = collect(b"N10 G90.1 g01 G04 P.5 X1 y2 Z-3 F100 M3 M7 M8").unwrap();
        assert_eq!(block.g(GGroup::Motion).unwrap().tenths, 10);
        assert_eq!(block.g(GGroup::ArcDistance).unwrap().tenths, 901);
        assert_eq!(block.m(MGroup::Flood).unwrap().tenths, 80);
        let [x, y, z, others @ ..] = block.axes();
        assert_eq!([x, y, z].map(|word| word.unwrap().number.to_f64()), [1.0, 2.0, -3.0]);
        assert!(others.iter().all(Option::is_none));
        assert!(block.letter(b'R').is_none() && block.g(GGroup::Units).is_none());
    }

    #[test]
    fn clashes_and_strangers_are_refused_at_their_place() {
        for (line, offset, message) in [
            (&b"G0 G1 X1"[..], 3, "found G1 in a line with G0"),
            (b"G1 G1", 3, "found G1 in a line with G1"),
            (b"G90 X1 G91", 7, "found G91 in a line with G90"),
            (b"M3 M5", 3, "found M5 in a line with M3"),
            (b"M8 M9", 3, "found M9 in a line with M8"),
            (b"M9 M7", 3, "found M7 in a line with M9"),
            (b"M2 M30", 3, "found M30 in a line with M2"),
            (b"X1 X2", 3, "a second X word, X2"),
            (b"G41.2 D1", 0, "found G41.2, expected one of G0"),
            (b"M19", 0, "needs a spindle encoder"),
            (b"G90.2", 0, "found G90.2"),
            (b"G1.05", 0, "found G1.05"),
            (b"G-1", 0, "found G-1"),
            (b"M10", 0, "found M10"),
            (b"M0.5", 0, "found M0.5"),
            (b"@5 @6", 3, "a second @ word"),
            (b"M100.5", 0, "found M100.5"),
            (b"G1 X1 A5", 6, "found A5, expected an axis of the machine: X, Y, Z"),
            (b"G1 N5", 3, "line number"),
            (b"N-5", 0, "line number"),
            (b"G0 O100", 3, "found O100"),
        ] {
            let located = collect(line).unwrap_err();
            assert_eq!(located.offset, offset, "{}", String::from_utf8_lossy(line));
            let text = located.problem.to_string();
            assert!(text.contains(message), "{text}");
        }
    }
}
