//! Loops and conditions: where their O-words lead.

use std::rc::Rc;

use super::error::Located;
use super::expression;
use super::flow::{Flow, Repeat};
use super::library::{Failure, File};
use super::oword::{self, OWord};
use super::source::Place;
use super::structure::{OLine, Role, Structure};

impl<'a> Flow<'a> {
    /// Sets the next line after an O-word of a loop, a condition or a `sub`.
    pub(super) fn jump(
        &mut self,
        file: &Rc<File<'a>>,
        word: &OWord<'_>,
        here: Place,
    ) -> Result<(), Failure<'a>> {
        let structure = file.structure()?;
        // What the structure leaves out is behind the end of the tape.
        let Some((index, line)) = structure.at(here) else { return Ok(()) };
        if let Role::If { .. } = line.role {
            return self.branch(file, structure, index);
        }
        let next =
            self.next_of(word, structure, index, line).map_err(|located| file.failure(here, located))?;
        self.place = next.unwrap_or(self.place);
        Ok(())
    }

    /// Where an O-word other than `if` leads; none for the next line.
    fn next_of(
        &mut self,
        word: &OWord<'_>,
        structure: &Structure,
        index: usize,
        line: OLine,
    ) -> Result<Option<Place>, Located> {
        let start = |index| structure.line(index).map(|line| line.start);
        let after = |index| structure.line(index).map(|line| line.after);
        match line.role {
            Role::While { .. } | Role::DoWhile { .. } | Role::Repeat { .. } | Role::ElseIf { .. } => {}
            _ => word.refuse_rest()?,
        }
        Ok(match line.role {
            // They are met behind the branch that ran.
            Role::Sub { end } | Role::ElseIf { end, .. } | Role::Else { end } => after(end),
            Role::While { end } if self.condition(word)? == 0.0 => after(end),
            Role::EndWhile { begin } => start(begin),
            Role::DoWhile { begin } if self.condition(word)? != 0.0 => after(begin),
            Role::Repeat { end } => {
                let count = self.condition(word)?.round();
                if count < 1.0 {
                    return Ok(after(end));
                }
                // Beyond the lines that may run, every count is the same.
                self.repeats.push(Repeat { begin: index, left: count as u64 - 1 });
                None
            }
            Role::EndRepeat { begin } => match self.repeats.last_mut().filter(|last| last.begin == begin) {
                Some(last) if last.left > 0 => {
                    last.left -= 1;
                    after(begin)
                }
                Some(_) => {
                    self.repeats.pop();
                    None
                }
                None => None,
            },
            Role::Break { begin } | Role::Continue { begin } => {
                // Those within it; the outer ones begin before it.
                while self.repeats.pop_if(|repeat| repeat.begin >= begin).is_some() {}
                let end = structure.end_of(begin);
                match (line.role, structure.line(begin).map(|line| line.role)) {
                    (Role::Break { .. }, _) => after(end),
                    (_, Some(Role::Do { .. })) => start(end),
                    _ => start(begin),
                }
            }
            _ => None,
        })
    }

    /// Goes to the branch of an `if` whose condition is true.
    fn branch(
        &mut self,
        file: &Rc<File<'a>>,
        structure: &Structure,
        first: usize,
    ) -> Result<(), Failure<'a>> {
        let mut index = first;
        while let Some(line) = structure.line(index) {
            self.place = line.after;
            self.executed += 1;
            let (Role::If { next } | Role::ElseIf { next, .. }) = line.role else { return Ok(()) };
            let Some((text, _)) = file.source.line(line.start) else { return Ok(()) };
            let cursor = file.cursor(text).and_then(oword::place);
            let Some(cursor) = cursor else { return Ok(()) };
            let condition = OWord::read(cursor, &self.interpreter).and_then(|word| self.condition(&word));
            if condition.map_err(|located| file.failure(line.start, located))? != 0.0 {
                return Ok(());
            }
            index = next;
        }
        Ok(())
    }

    /// The expression after a keyword.
    fn condition(&self, word: &OWord<'_>) -> Result<f64, Located> {
        let mut rest = word.rest.clone();
        let value = expression::bracketed(&mut rest, &self.interpreter)?;
        word.with(rest).refuse_rest()?;
        Ok(value)
    }
}
