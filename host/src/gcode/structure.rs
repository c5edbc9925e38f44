//! What the O-words of a file join: where each of them jumps.
//!
//! Made in one pass over the file, when the first O-word with a keyword runs. Blocks lie within each other, so
//! a label says which one is meant, and may be used again after its block.

use std::collections::HashMap;

use super::error::{Located, Problem};
use super::expression::Environment;
use super::lexer::{Cursor, is_blank_line, is_percent_line};
use super::library::Callee;
use super::oword::{self, Keyword, OWord};
use super::source::{Place, Source};

/// A line with an O-word.
#[derive(Clone, Copy, Debug)]
pub(super) struct OLine {
    /// Its start.
    pub(super) start: Place,
    /// The start of the next line.
    pub(super) after: Place,
    pub(super) role: Role,
}

/// What an O-word does; indices are those of [`Structure::lines`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Sub {
        end: usize,
    },
    EndSub,
    Call,
    Return,
    /// `next` is what is tried if the condition is false.
    If {
        next: usize,
    },
    ElseIf {
        next: usize,
        end: usize,
    },
    Else {
        end: usize,
    },
    EndIf,
    While {
        end: usize,
    },
    EndWhile {
        begin: usize,
    },
    Do {
        end: usize,
    },
    DoWhile {
        begin: usize,
    },
    Repeat {
        end: usize,
    },
    EndRepeat {
        begin: usize,
    },
    /// Of the loop that begins there.
    Break {
        begin: usize,
    },
    Continue {
        begin: usize,
    },
    Program,
}

/// The O-words of a file.
#[derive(Debug, Default)]
pub(super) struct Structure {
    /// In the order of the file.
    lines: Vec<OLine>,
    /// `sub` lines by label.
    pub(super) subs: HashMap<String, usize>,
    /// Subprograms of M98 by label.
    pub(super) programs: HashMap<String, usize>,
}

/// A block that is not closed yet.
struct Open {
    keyword: Keyword,
    label: String,
    index: usize,
    /// Where it begins, from 1.
    line: u32,
    /// `elseif` and `else` of an `if`.
    branches: Vec<usize>,
}

/// The blocks that are not closed yet. A block of a label is found without a look at the others.
#[derive(Default)]
struct OpenBlocks {
    /// From the outermost to the innermost.
    blocks: Vec<Open>,
    /// Where those of a label are among them: a sub and one within it at most.
    of_label: HashMap<String, Vec<usize>>,
}

impl OpenBlocks {
    fn push(&mut self, open: Open) {
        self.of_label.entry(open.label.clone()).or_default().push(self.blocks.len());
        self.blocks.push(open);
    }

    fn pop(&mut self) -> Option<Open> {
        let open = self.blocks.pop()?;
        if let Some(places) = self.of_label.get_mut(&open.label) {
            places.pop();
        }
        Some(open)
    }

    fn last(&self) -> Option<&Open> {
        self.blocks.last()
    }

    /// The innermost block of a label.
    fn of(&self, label: &str) -> Option<&Open> {
        self.blocks.get(*self.of_label.get(label)?.last()?)
    }

    /// Subs stand in no other block.
    fn is_in_sub(&self) -> bool {
        self.blocks.first().is_some_and(|open| open.keyword == Keyword::Sub)
    }

    /// The problem of an O-word that belongs to another block than the last.
    fn not_open(&self, word: &OWord<'_>) -> Located {
        let open = self.last().map_or_else(
            || "no block is open".to_owned(),
            |open| format!("O{} {} of line {} is open last", open.label, open.keyword.word(), open.line),
        );
        Located::new(word.offset, Problem::BlockNotOpen { label: word.label.clone(), open })
    }
}

/// Nothing counts: the text is only checked.
pub(super) struct Unread;

impl Environment for Unread {
    fn numbered(&self, _: u32) -> f64 {
        1.0
    }

    fn named(&self, _: &str) -> Option<f64> {
        Some(1.0)
    }

    fn counts(&self) -> bool {
        false
    }
}

impl Structure {
    /// The structure of a file; lines with `/` count if `block_delete` is off.
    ///
    /// # Errors
    /// The place in the file, and what is wrong there.
    pub(super) fn of(source: &Source<'_>, block_delete: bool) -> Result<Self, (Place, Located)> {
        let mut structure = Self::default();
        let mut open = OpenBlocks::default();
        let mut place = Place::default();
        let mut begun = false;
        while let Some((line, after)) = source.line(place) {
            if is_percent_line(line) {
                if begun {
                    break;
                }
                begun = true;
            } else if !is_blank_line(line) {
                begun = true;
                if let Some(cursor) = source.cursor(line, block_delete).and_then(oword::place) {
                    structure.add(cursor, place, after, &mut open).map_err(|located| (place, located))?;
                }
            }
            place = after;
        }
        match open.last().and_then(|open| Some((open, structure.lines.get(open.index)?))) {
            Some((open, line)) => {
                let (keyword, end) = (open.keyword.word(), open.keyword.end());
                let last = place.line.saturating_sub(1);
                let problem = Problem::BlockOpen { label: open.label.clone(), keyword, end, last };
                Err((line.start, Located::new(0, problem)))
            }
            None => Ok(structure),
        }
    }

    /// An O-word by its index.
    pub(super) fn line(&self, index: usize) -> Option<OLine> {
        self.lines.get(index).copied()
    }

    /// The index of the last O-word of a block.
    pub(super) fn end_of(&self, begin: usize) -> usize {
        match self.line(begin).map(|line| line.role) {
            Some(Role::Sub { end } | Role::While { end } | Role::Do { end } | Role::Repeat { end }) => end,
            _ => begin,
        }
    }

    /// The line behind the first one of a subroutine.
    pub(super) fn body(&self, label: &str, callee: Callee) -> Option<Place> {
        let table = match callee {
            Callee::Sub => &self.subs,
            Callee::Subprogram => &self.programs,
        };
        Some(self.line(*table.get(label)?)?.after)
    }

    /// The O-word of a line.
    pub(super) fn at(&self, place: Place) -> Option<(usize, OLine)> {
        let index = self.lines.binary_search_by_key(&place.offset, |line| line.start.offset).ok()?;
        Some((index, *self.lines.get(index)?))
    }

    fn add(
        &mut self,
        cursor: Cursor<'_>,
        start: Place,
        after: Place,
        open: &mut OpenBlocks,
    ) -> Result<(), Located> {
        let word = OWord::read(cursor, &Unread)?;
        if word.is_computed && word.keyword != Keyword::Call {
            return Err(Located::new(word.offset, Problem::LabelComputed));
        }
        let index = self.lines.len();
        let role = self.role(&word, index, start.line, open)?;
        self.lines.push(OLine { start, after, role });
        Ok(())
    }

    fn role(
        &mut self,
        word: &OWord<'_>,
        index: usize,
        line: u32,
        open: &mut OpenBlocks,
    ) -> Result<Role, Located> {
        let begins = |keyword, open: &mut OpenBlocks| {
            if let Some(of_label) = open.of(&word.label).filter(|open| open.keyword != Keyword::Sub) {
                let (label, line) = (word.label.clone(), of_label.line);
                return Err(Located::new(word.offset, Problem::LabelOpen { label, line }));
            }
            open.push(Open { keyword, label: word.label.clone(), index, line, branches: Vec::new() });
            Ok(())
        };
        let closes = |keyword, open: &mut OpenBlocks| {
            let is_last = |last: &Open| last.keyword == keyword && last.label == word.label;
            match open.last().is_some_and(is_last) {
                true => open.pop().ok_or_else(|| open.not_open(word)),
                false => Err(open.not_open(word)),
            }
        };
        Ok(match word.keyword {
            Keyword::Program => {
                self.programs.entry(word.label.clone()).or_insert(index);
                Role::Program
            }
            Keyword::Call => Role::Call,
            Keyword::Sub => {
                let other = match (open.last(), self.subs.get(&word.label)) {
                    (Some(open), _) => Some(("in the block that begins", open.line)),
                    (None, Some(&first)) => {
                        self.line(first).map(|line| ("a second time, after that", line.start.line))
                    }
                    (None, None) => None,
                };
                if let Some((place, line)) = other {
                    let problem = Problem::SubPlace { label: word.label.clone(), place, line };
                    return Err(Located::new(word.offset, problem));
                }
                self.subs.insert(word.label.clone(), index);
                begins(Keyword::Sub, open)?;
                Role::Sub { end: index }
            }
            Keyword::EndSub => {
                let begin = closes(Keyword::Sub, open)?.index;
                self.set(begin, Role::Sub { end: index });
                Role::EndSub
            }
            // Whatever its label is, it returns from the sub around it.
            Keyword::Return if open.is_in_sub() => Role::Return,
            Keyword::Return => return Err(Located::new(word.offset, Problem::ReturnOutside)),
            Keyword::If => {
                begins(Keyword::If, open)?;
                Role::If { next: index }
            }
            Keyword::ElseIf | Keyword::Else => {
                if word.keyword == Keyword::Else {
                    word.refuse_rest()?;
                }
                let is_else = |index: &usize| {
                    self.line(*index).is_some_and(|line| matches!(line.role, Role::Else { .. }))
                };
                let takes = |last: &Open| {
                    last.keyword == Keyword::If
                        && last.label == word.label
                        && !last.branches.last().is_some_and(is_else)
                };
                if !open.last().is_some_and(takes) {
                    return Err(open.not_open(word));
                }
                let Some(last) = open.blocks.last_mut() else { return Err(open.not_open(word)) };
                let before = last.branches.last().copied().unwrap_or(last.index);
                last.branches.push(index);
                self.lead(before, index);
                if word.keyword == Keyword::Else {
                    Role::Else { end: index }
                } else {
                    Role::ElseIf { next: index, end: index }
                }
            }
            Keyword::EndIf => {
                let closed = closes(Keyword::If, open)?;
                self.lead(closed.branches.last().copied().unwrap_or(closed.index), index);
                for branch in closed.branches {
                    let role = self.lines.get_mut(branch).map(|line| &mut line.role);
                    if let Some(Role::ElseIf { end, .. } | Role::Else { end }) = role {
                        *end = index;
                    }
                }
                Role::EndIf
            }
            Keyword::While
                if open
                    .last()
                    .is_some_and(|last| last.keyword == Keyword::Do && last.label == word.label) =>
            {
                let begin = closes(Keyword::Do, open)?.index;
                self.set(begin, Role::Do { end: index });
                Role::DoWhile { begin }
            }
            Keyword::While => {
                begins(Keyword::While, open)?;
                Role::While { end: index }
            }
            Keyword::EndWhile => {
                let begin = closes(Keyword::While, open)?.index;
                self.set(begin, Role::While { end: index });
                Role::EndWhile { begin }
            }
            Keyword::Do => {
                begins(Keyword::Do, open)?;
                Role::Do { end: index }
            }
            Keyword::Repeat => {
                begins(Keyword::Repeat, open)?;
                Role::Repeat { end: index }
            }
            Keyword::EndRepeat => {
                let begin = closes(Keyword::Repeat, open)?.index;
                self.set(begin, Role::Repeat { end: index });
                Role::EndRepeat { begin }
            }
            Keyword::Break | Keyword::Continue => {
                let is_loop = |open: &&Open| matches!(open.keyword, Keyword::While | Keyword::Do);
                let Some(begin) = open.of(&word.label).filter(is_loop).map(|open| open.index) else {
                    return Err(open.not_open(word));
                };
                if word.keyword == Keyword::Break { Role::Break { begin } } else { Role::Continue { begin } }
            }
        })
    }

    fn set(&mut self, index: usize, role: Role) {
        if let Some(line) = self.lines.get_mut(index) {
            line.role = role;
        }
    }

    /// A false condition at `from` leads to `to`.
    fn lead(&mut self, from: usize, to: usize) {
        let role = self.lines.get_mut(from).map(|line| &mut line.role);
        if let Some(Role::If { next } | Role::ElseIf { next, .. }) = role {
            *next = to;
        }
    }
}
