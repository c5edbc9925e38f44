//! All refusals of a program at once.
//!
//! **Consumes** what [`read_with`](super::read_with) consumes. **Produces** the [`Refusal`]s of a program that it refuses,
//! alike ones together. Where a word has no meaning here, it is left out and the rest of its line is read; any other
//! refused line is left out as a whole.
//!
//! What might not be refused without an earlier refusal is not listed: the geometry of arcs and corners, parameters without a
//! value, and words that nothing takes, from the first line on that was left out, or whose G or M word was.

use std::collections::BTreeSet;
use std::mem::discriminant;
use std::rc::Rc;

use super::error::{GcodeError, Problem};
use super::flow::Flow;
use super::library::Failure;
use super::options::ReadOptions;

/// Most lines that are executed after a refusal: a loop may have lost its end with it.
const LINES_AFTER_REFUSAL: u64 = 10_000_000;

/// Most words of a line that are left out.
const WORDS_MAX: usize = 100;

/// A refusal, and how many lines are refused for the like.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// Where it is first, and why.
    pub first: GcodeError,
    /// The number of lines, in all files together.
    pub lines: usize,
}

/// Every refusal of a program, file by file in the order of their first places; none if the program is accepted.
///
/// ```
/// use motion_host::gcode::{self, ReadOptions};
///
/// let text = b"G1 X1 A5 F600\nG33 Z-1 K1\nX2 A6\nM2\n";
/// let refusals = gcode::refusals("part.ngc", text, &ReadOptions::default());
/// let found: Vec<_> = refusals.iter().map(|refusal| (refusal.first.line, refusal.lines)).collect();
/// assert_eq!(found, [(1, 2), (2, 1)]);
/// ```
#[must_use]
pub fn refusals(source_name: &str, text: &[u8], options: &ReadOptions) -> Vec<Refusal> {
    let mut flow = Flow::new(source_name, text, options);
    let mut survey = Survey::default();
    loop {
        let before = flow.position();
        let failure = match flow.next_line() {
            Ok(true) if survey.groups.is_empty() || flow.executed < survey.executed_max => continue,
            Ok(true) => return survey.refusals(),
            Ok(false) => break,
            Err(failure) => failure,
        };
        if survey.groups.is_empty() {
            survey.executed_max = flow.executed.saturating_add(LINES_AFTER_REFUSAL);
        }
        let (_, _, located) = failure.parts();
        let is_bound = matches!(located.problem, Problem::TooManyLines { .. } | Problem::TooManySteps { .. });
        // A bound is passed at any line of a loop, which may have lost its end.
        let is_listed = !is_bound || survey.groups.is_empty();
        let stands_still = flow.position() == before;
        if is_listed {
            survey.rest_of_line(&mut flow, failure);
        }
        if stands_still || is_bound {
            return survey.refusals();
        }
    }
    if let Err(error) = flow.finish() {
        // What is open at the end may have lost its end with a refused line.
        if survey.groups.is_empty() {
            survey.add(error);
        }
    }
    survey.refusals()
}

/// Refusals alike.
struct Group {
    first: GcodeError,
    /// Their places: file and line.
    lines: BTreeSet<(String, u32)>,
}

#[derive(Default)]
struct Survey {
    groups: Vec<Group>,
    /// Lines that may be executed.
    executed_max: u64,
    /// A line was left out: positions and parameters are not what they would be.
    is_uncertain: bool,
}

impl Survey {
    /// A refused line, and what else of it is refused.
    fn rest_of_line<'a>(&mut self, flow: &mut Flow<'a>, failure: Failure<'a>) {
        let (file, place, _) = failure.parts();
        let file = Rc::clone(file);
        let mut text = file.source.line(place).map_or_else(Vec::new, |(line, _)| line.to_vec());
        let mut failure = Some(failure);
        // Every pass leaves out one word more.
        for _ in 0..WORDS_MAX {
            let Some(found) = failure.take() else { return };
            let (_, at, located) = found.parts();
            let is_word = at == place && located.problem.is_of_a_word();
            let offset = located.offset;
            self.add(found.into_error());
            // A G word may be a motion mode, and both G and M words may take letters of their line.
            let is_code = text.get(offset).is_some_and(|letter| b"gGmM".contains(letter));
            self.is_uncertain |= !is_word || is_code;
            if is_word && leave_out(&mut text, offset) {
                failure = flow.line(&file, &text, place).err();
            }
        }
    }

    fn add(&mut self, error: GcodeError) {
        let place = (error.source_name.clone(), error.line);
        let group = self.groups.iter_mut().find(|group| alike(&group.first.problem, &error.problem));
        if let Some(group) = group {
            group.lines.insert(place);
        } else if self.groups.is_empty() || !(self.is_uncertain && error.problem.may_follow()) {
            self.groups.push(Group { first: error, lines: BTreeSet::from([place]) });
        }
    }

    fn refusals(self) -> Vec<Refusal> {
        let refusal = |group: Group| Refusal { first: group.first, lines: group.lines.len() };
        let mut refusals: Vec<Refusal> = self.groups.into_iter().map(refusal).collect();
        let files: Vec<String> = refusals.iter().map(|refusal| refusal.first.source_name.clone()).collect();
        // A line is read again after each of its words: they are found in no order.
        refusals.sort_by_key(|Refusal { first, .. }| {
            let file = files.iter().position(|name| *name == first.source_name);
            (file, first.line, first.column)
        });
        refusals
    }
}

/// Whether two problems are told together: of one kind, and about one G or M word or one letter.
fn alike(one: &Problem, other: &Problem) -> bool {
    discriminant(one) == discriminant(other) && one.subject() == other.subject()
}

/// Puts blanks in place of the word at `offset`; whether there was one.
fn leave_out(line: &mut [u8], offset: usize) -> bool {
    let Some(word) = line.get_mut(offset..).filter(|word| word.first().is_some_and(|byte| *byte != b' '))
    else {
        return false;
    };
    let (mut depth, mut is_name, mut function) = (0_usize, false, 0);
    for index in 0..word.len() {
        if index > 0 && function == 0 {
            // The name of a function has two letters or more, a word has one.
            let letters = word[index..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
            function = if letters > 1 { letters } else { 0 };
        }
        match word[index] {
            b'[' => depth += 1,
            b']' => depth = depth.saturating_sub(1),
            b'<' => is_name = true,
            b'>' => is_name = false,
            b'0'..=b'9' | b'.' | b'+' | b'-' | b'#' | b' ' | b'\t' => {}
            _ if index == 0 || depth > 0 || is_name || function > 0 => {}
            _ => break,
        }
        function = function.saturating_sub(1);
        word[index] = b' ';
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(u32, u32, usize)> {
        refusals("a.ngc", text.as_bytes(), &ReadOptions::default())
            .iter()
            .map(|refusal| (refusal.first.line, refusal.first.column, refusal.lines))
            .collect()
    }

    /// What is no program at all is said once.
    #[test]
    fn a_text_that_is_no_program_is_named() {
        let said = |text: &[u8]| -> Vec<String> {
            let refusals = refusals("a.ngc", text, &ReadOptions::default());
            refusals.iter().map(|refusal| refusal.first.to_string()).collect()
        };
        let empty = ["a.ngc:1:1: found an empty file, expected G-code"];
        let wide =
            ["a.ngc:1:1: found UTF-16 text, expected UTF-8 or ASCII: save the program in one of these"];
        assert_eq!(said(b""), empty);
        assert_eq!(said(b" \r\n\n"), empty);
        for text in [&b"\xFF\xFEG\x001\x00"[..], b"\xFE\xFF\x00G\x001", b"G\x001\x00", b"\x00G\x001"] {
            assert_eq!(said(text), wide, "{text:?}");
        }
        // Bytes that are neither are told one by one.
        assert_ne!(said(b"\0\0G1"), wide);
    }

    #[test]
    fn accepted_programs_have_none() {
        for text in ["G1 X1 F60\nM2\n", "()", "o1 sub\nG1 X1 F9\no1 endsub\n"] {
            assert_eq!(found(text), []);
        }
    }

    #[test]
    fn every_word_of_a_line_is_found_and_the_rest_is_read() {
        // A and B in one line; X2 of the line is executed, so that the arc after it is right.
        let text = "G1 X1 F60 A1\nX2 A[1+[2*3]] B#1Y0\nG33 M199\nG2 X4 I1\nM2\n";
        assert_eq!(found(text), [(1, 11, 2), (2, 15, 1), (3, 1, 1), (3, 5, 1)]);
    }

    #[test]
    fn what_follows_from_a_refusal_is_not_listed() {
        // The second line is left out: the arc would not be one, and #1 has no value.
        assert_eq!(found("F60\nG1 X9 Q[1/0]\nG2 X4 I1\n#2=#<unset>\nM2\n").len(), 1);
        assert_eq!(found("F60\nG2 X4 I1\n#2=#<unset>\nM2\n").len(), 1);
    }

    /// They are not hidden by refusals that leave no line out.
    #[test]
    fn refusals_beside_a_word_without_a_meaning_are_found() {
        assert_eq!(found("F100\nG0 A1\nG1 X[1/0]\nM2\n"), [(2, 4, 1), (3, 7, 1)]);
        assert_eq!(found("G0 A1\nG1 X5\nM2\n"), [(1, 4, 1), (2, 1, 1)]);
        assert_eq!(found("F60\nG0 A1\nG2 X4 I1\nM2\n"), [(2, 4, 1), (3, 1, 1)]);
        assert_eq!(found("F100\nG1 X1 A5 Q2\nM2\n"), [(2, 7, 1), (2, 10, 1)]);
        // K belongs to the word that is refused.
        assert_eq!(found("F100 S1\nG33 Z-1 K1\nZ-2 K1\nM2\n"), [(2, 1, 1)]);
        assert_eq!(found("M190 P1\nM2\n"), [(1, 1, 1)]);
    }

    #[test]
    fn bounds_are_refused_once() {
        let text = b"F100\no1 while [1]\nG1 X1\no1 endwhile\nM2\n";
        let options = ReadOptions { lines_max: 1000, ..ReadOptions::default() };
        let refusals = refusals("a.ngc", text, &options);
        assert_eq!(refusals.iter().map(|refusal| refusal.lines).collect::<Vec<_>>(), [1], "{refusals:?}");
    }

    #[test]
    fn a_loop_that_lost_its_end_ends() {
        let text = "#1=0\no1 while [#1 lt 9]\n#1=[#1+1] H[sqrt[-1]]\no1 endwhile\nM2\n";
        assert_eq!(found(text), [(3, 13, 1)]);
    }

    #[test]
    fn a_word_is_left_out_with_its_number() {
        for (line, offset, expected) in [
            ("X1 A10. Y2", 3, "X1      Y2"),
            ("A[#<a b>*[2]]X1", 0, "             X1"),
            ("B#<x>", 0, "     "),
            ("A SIN[30]X1", 0, "         X1"),
            ("A-abs[3] X[1]", 0, "         X[1]"),
        ] {
            let mut text = line.as_bytes().to_vec();
            assert!(leave_out(&mut text, offset));
            assert_eq!(text, expected.as_bytes(), "{line}");
        }
        assert!(!leave_out(&mut b"X1".to_vec(), 2));
    }
}
