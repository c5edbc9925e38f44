//! The words of one line, each in its slot.
//!
//! A slot holds one word. So a word given twice, two words of one modal group, and words without a slot are
//! refused here, the leftmost first. The interpreter acts on the words.

use super::error::{Located, Problem};
use super::lexer::{Word, Words};
use super::modal::Motion;

/// Letters that take a number of their own.
const LETTERS: &[u8; 12] = b"FIJKNPQRSXYZ";

/// Modal groups of G words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GGroup {
    /// G0 G1 G2 G3 G5 G5.5 G80.
    Motion,
    /// G17 G18 G19.
    Plane,
    /// G20 G21.
    Units,
    /// G90 G91.
    Distance,
    /// G90.1 G91.1.
    ArcDistance,
    /// G61 G64.
    PathMode,
    /// G4.
    Dwell,
    /// G40.
    CutterCompensation,
    /// G49.
    ToolLength,
    /// G54.
    CoordinateSystem,
    /// G94.
    FeedMode,
}

/// Groups of M words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MGroup {
    /// M0 M1 M2 M30.
    Stop,
    /// M3 M4 M5.
    Spindle,
    /// M6.
    ToolChange,
    /// M7: may run together with flood.
    Mist,
    /// M8.
    Flood,
    /// M9.
    CoolantOff,
}

const G_GROUPS: usize = GGroup::FeedMode as usize + 1;
const M_GROUPS: usize = MGroup::CoolantOff as usize + 1;

/// The group of a G word, by its number in tenths.
fn g_group(tenths: i64) -> Option<GGroup> {
    Some(match tenths {
        0 | 10 | 20 | 30 | 50 | 55 | 800 => GGroup::Motion,
        170 | 180 | 190 => GGroup::Plane,
        200 | 210 => GGroup::Units,
        900 | 910 => GGroup::Distance,
        901 | 911 => GGroup::ArcDistance,
        610 | 640 => GGroup::PathMode,
        40 => GGroup::Dwell,
        400 => GGroup::CutterCompensation,
        490 => GGroup::ToolLength,
        540 => GGroup::CoordinateSystem,
        940 => GGroup::FeedMode,
        _ => return None,
    })
}

/// The group of an M word, by its number in tenths.
fn m_group(tenths: i64) -> Option<MGroup> {
    Some(match tenths {
        0 | 10 | 20 | 300 => MGroup::Stop,
        30 | 40 | 50 => MGroup::Spindle,
        60 => MGroup::ToolChange,
        70 => MGroup::Mist,
        80 => MGroup::Flood,
        90 => MGroup::CoolantOff,
        _ => return None,
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
    any: bool,
}

impl<'a> Block<'a> {
    /// Collects the words of a line.
    pub(super) fn collect(line: &'a [u8]) -> Result<Self, Located> {
        let mut block = Self::default();
        for (index, word) in Words::new(line).enumerate() {
            let word = word?;
            block.any = true;
            match word.letter {
                b'G' => {
                    let code = number(word, g_group)
                        .ok_or_else(|| word.problem(|word| Problem::UnsupportedG { word }))?;
                    put(&mut block.g, code.0 as usize, code.1)?;
                }
                b'M' => {
                    let code = number(word, m_group)
                        .ok_or_else(|| word.problem(|word| Problem::UnsupportedM { word }))?;
                    block.refuse_coolant_clash(code)?;
                    put(&mut block.m, code.0 as usize, code.1)?;
                }
                b'N' if index > 0 || !word.number.is_whole() || word.number.signum() < 0 => {
                    return Err(word.problem(|word| Problem::LineNumber { word }));
                }
                _ => block.put_letter(word)?,
            }
        }
        Ok(block)
    }

    /// Whether the line has no words.
    pub(super) fn is_empty(&self) -> bool {
        !self.any
    }

    fn put_letter(&mut self, word: Word<'a>) -> Result<(), Located> {
        let slot = LETTERS.iter().position(|&letter| letter == word.letter);
        let Some(slot) = slot.and_then(|index| self.letters.get_mut(index)) else {
            return Err(word.problem(|word| Problem::UnsupportedLetter { word }));
        };
        if slot.is_some() {
            let letter = char::from(word.letter);
            return Err(word.problem(|word| Problem::WordTwice { letter, word }));
        }
        *slot = Some(word);
        Ok(())
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

    /// Whether the line sets G64.
    pub(super) fn is_blend(&self) -> bool {
        self.g(GGroup::PathMode).is_some_and(|code| code.tenths == 640)
    }

    /// A word nothing in the line takes would be silently dropped. `motion` is the mode in force.
    pub(super) fn refuse_unused(&self, motion: Option<Motion>) -> Result<(), Located> {
        let takes_arc = motion.is_some_and(Motion::is_arc);
        let takes_cubic = motion == Some(Motion::Cubic);
        let takes_q = self.is_blend() || takes_cubic;
        let rules = [
            (b'P', takes_q || self.g(GGroup::Dwell).is_some(), "G4, G5 or G64"),
            (b'Q', takes_q, "G5 or G64"),
            (b'I', takes_arc || takes_cubic, "G2, G3 or G5"),
            (b'J', takes_arc || takes_cubic, "G2, G3 or G5"),
            (b'K', takes_arc, "G2 or G3"),
            (b'R', takes_arc, "G2 or G3"),
        ];
        let unused = rules
            .into_iter()
            .filter(|(_, taken, _)| !taken)
            .filter_map(|(letter, _, needs)| Some((self.letter(letter)?, needs)))
            .min_by_key(|(word, _)| word.offset);
        unused.map_or(Ok(()), |(word, needs)| Err(word.problem(|word| Problem::WordUnused { word, needs })))
    }

    /// The word with a letter of its own.
    pub(super) fn letter(&self, letter: u8) -> Option<Word<'a>> {
        let index = LETTERS.iter().position(|&candidate| candidate == letter)?;
        self.letters.get(index).copied().flatten()
    }

    /// X, Y and Z.
    pub(super) fn axes(&self) -> [Option<Word<'a>>; 3] {
        [self.letter(b'X'), self.letter(b'Y'), self.letter(b'Z')]
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
    use super::*;

    #[test]
    fn every_word_finds_its_slot() {
        let block = Block::collect(b"N10 G90.1 g01 G04 P.5 X1 y2 Z-3 F100 M3 M7 M8").unwrap();
        assert_eq!(block.g(GGroup::Motion).unwrap().tenths, 10);
        assert_eq!(block.g(GGroup::ArcDistance).unwrap().tenths, 901);
        assert_eq!(block.m(MGroup::Flood).unwrap().tenths, 80);
        assert_eq!(block.axes().map(|word| word.unwrap().number.to_f64()), [1.0, 2.0, -3.0]);
        assert!(block.letter(b'R').is_none() && block.g(GGroup::Units).is_none());
    }

    #[test]
    fn clashes_and_strangers_are_refused_at_their_place() {
        for (line, offset, message) in [
            (&b"G0 G1 X1"[..], 3, "found G1 in a line with G0"),
            (b"G1 G1", 3, "found G1 in a line with G1"),
            (b"G80 G2", 4, "found G2 in a line with G80"),
            (b"G90 X1 G91", 7, "found G91 in a line with G90"),
            (b"M3 M5", 3, "found M5 in a line with M3"),
            (b"M8 M9", 3, "found M9 in a line with M8"),
            (b"M9 M7", 3, "found M7 in a line with M9"),
            (b"M2 M30", 3, "found M30 in a line with M2"),
            (b"X1 X2", 3, "a second X word, X2"),
            (b"G10 L2 P0", 0, "found G10, expected one of G0"),
            (b"G0 G53 Z-10.", 3, "found G53"),
            (b"G90.2", 0, "found G90.2"),
            (b"G1.05", 0, "found G1.05"),
            (b"G-1", 0, "found G-1"),
            (b"M10", 0, "found M10"),
            (b"M0.5", 0, "found M0.5"),
            (b"T1 M6", 0, "found T1, expected one of the words"),
            (b"G1 X1 A5", 6, "found A5"),
            (b"G1 N5", 3, "line number"),
            (b"N-5", 0, "line number"),
            (b"N1.5", 0, "line number"),
            (b"O100", 0, "found O100"),
        ] {
            let located = Block::collect(line).unwrap_err();
            assert_eq!(located.offset, offset, "{}", String::from_utf8_lossy(line));
            let text = located.problem.to_string();
            assert!(text.contains(message), "{text}");
        }
    }
}
