//! Which line comes next: subroutines, loops, conditions.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::fs;
use std::rc::Rc;

use super::block::Block;
use super::error::{GcodeError, Located, Problem};
use super::expression;
use super::interpreter::{Control, Interpreter};
use super::lexer::{Cursor, is_blank_line, is_percent_line};
use super::options::ReadOptions;
use super::oword::{self, Keyword, OWord};
use super::parameters::LOCALS;
use super::program::{NoticeKind, Program};
use super::source::{Place, Source};
use super::structure::{Role, Structure, Unread};

/// Most subroutines within each other; LinuxCNC has 10.
const LEVELS_MAX: usize = 100;

/// A file, with its structure once that is needed.
struct File<'a> {
    source: Source<'a>,
    structure: OnceCell<Structure>,
}

/// A subroutine that runs.
struct Call {
    /// Where the caller goes on.
    file: usize,
    place: Place,
    /// The caller's loops.
    repeats: Vec<Repeat>,
    /// Of M98: where it begins, and how often it is to run yet.
    again: Option<(Place, u32)>,
}

/// A `repeat` that runs.
#[derive(Clone, Copy)]
struct Repeat {
    /// Its line.
    begin: usize,
    /// How often it is to run after this time.
    left: u64,
}

/// A program being read.
pub(super) struct Flow<'a> {
    options: &'a ReadOptions,
    /// The program first.
    files: Vec<Rc<File<'a>>>,
    interpreter: Interpreter,
    file: usize,
    place: Place,
    calls: Vec<Call>,
    repeats: Vec<Repeat>,
    executed: u64,
}

impl<'a> Flow<'a> {
    /// Before the first line.
    pub(super) fn new(source_name: &str, text: &'a [u8], options: &'a ReadOptions) -> Self {
        let source = Source::new(source_name, Cow::Borrowed(text));
        Self {
            options,
            files: vec![Rc::new(File { source, structure: OnceCell::new() })],
            interpreter: Interpreter::new(options),
            file: 0,
            place: Place::default(),
            calls: Vec::new(),
            repeats: Vec::new(),
            executed: 0,
        }
    }

    /// Reads to the end.
    pub(super) fn read(mut self) -> Result<Program, GcodeError> {
        let mut last = 1;
        loop {
            let file = self.current();
            let here = self.place;
            let Some((line, after)) = file.source.line(here) else {
                if self.calls.is_empty() {
                    break;
                }
                let problem = Problem::SubprogramWithoutEnd;
                return Err(GcodeError::new(
                    &file.source.name,
                    here.line.saturating_sub(1).max(1),
                    b"",
                    Located::new(0, problem),
                ));
            };
            self.place = after;
            if is_blank_line(line) {
                continue;
            }
            if self.file == 0 {
                self.interpreter.line = here.line;
                last = here.line;
            }
            self.line(&file, line, here).map_err(|(file, place, located)| {
                let line = file.source.line(place).map_or(&b""[..], |(line, _)| line);
                GcodeError::new(&file.source.name, place.line, line, located)
            })?;
            if self.interpreter.ended && !self.calls.is_empty() {
                break;
            }
        }
        self.interpreter.line = last;
        self.check_subroutines()?;
        if !self.interpreter.ended {
            self.interpreter.notice(NoticeKind::NoProgramEnd);
        }
        let mut program = self.interpreter.program;
        program.parameters = self.interpreter.parameters;
        Ok(program)
    }

    fn current(&self) -> Rc<File<'a>> {
        Rc::clone(&self.files[self.file])
    }

    /// One line with text; an error has its file and the place of its line.
    fn line(
        &mut self,
        file: &Rc<File<'a>>,
        line: &[u8],
        here: Place,
    ) -> Result<(), (Rc<File<'a>>, Place, Located)> {
        let at = |located| (Rc::clone(file), here, located);
        if is_percent_line(line) {
            // Before any word the mark opens the tape, later it closes it; closed twice is closed.
            if self.file == 0 && self.calls.is_empty() {
                if self.interpreter.begun && !self.interpreter.ended {
                    self.interpreter.end().map_err(at)?;
                }
                self.interpreter.begun = true;
            }
            return Ok(());
        }
        if self.interpreter.ended {
            return self.after_end(file, here);
        }
        self.executed += 1;
        if self.executed > self.options.lines_max {
            return Err(at(Located::new(0, Problem::TooManyLines { lines_max: self.options.lines_max })));
        }
        let Some(cursor) = file.source.cursor(line, self.options.block_delete) else {
            self.interpreter.notice(NoticeKind::BlockDeleted);
            return Ok(());
        };
        if let Some(cursor) = oword::place(cursor.clone()) {
            self.interpreter.begun = true;
            return self.oword(file, cursor, here);
        }
        match self.interpreter.execute(cursor).map_err(at)? {
            Control::Next => Ok(()),
            Control::Call { repeats: 0, .. } => Ok(()),
            Control::Call { number, repeats } => {
                self.call(&number.to_string(), None, repeats, 0).map_err(|error| error.at(file, here))
            }
            Control::Return if self.calls.is_empty() => self.interpreter.end().map_err(at),
            Control::Return => match self.calls.last().is_some_and(|call| call.again.is_some()) {
                true => self.leave().map_err(at),
                false => Err(at(Located::new(
                    0,
                    Problem::ReturnMismatch { found: "M99", expected: "endsub or return" },
                ))),
            },
        }
    }

    /// Text after the end is not read; subroutines may stand there.
    fn after_end(&mut self, file: &Rc<File<'a>>, here: Place) -> Result<(), (Rc<File<'a>>, Place, Located)> {
        let structure = file.structure.get();
        let sub = structure.and_then(|structure| {
            let (_, line) = structure.at(here)?;
            match line.role {
                Role::Sub { end } => structure.lines.get(end),
                _ => None,
            }
        });
        match (sub, structure) {
            (Some(end), _) => self.place = end.after,
            (None, Some(structure)) if !structure.programs.is_empty() => {}
            _ => self.interpreter.notice(NoticeKind::TextAfterEnd),
        }
        Ok(())
    }

    fn oword(
        &mut self,
        file: &Rc<File<'a>>,
        cursor: Cursor<'_>,
        here: Place,
    ) -> Result<(), (Rc<File<'a>>, Place, Located)> {
        let at = |located| (Rc::clone(file), here, located);
        let word = OWord::read(cursor, &self.interpreter).map_err(at)?;
        if word.keyword == Keyword::Program {
            return Ok(());
        }
        if word.keyword == Keyword::Call {
            let arguments = self.arguments(&word).map_err(at)?;
            return self
                .call(&word.label, Some(arguments), 1, word.offset)
                .map_err(|error| error.at(file, here));
        }
        let structure =
            structure(file, self.options).map_err(|(place, located)| (Rc::clone(file), place, located))?;
        // What the structure leaves out is behind the end of the tape.
        let Some((index, line)) = structure.at(here) else { return Ok(()) };
        let line_at = |index: usize| structure.lines.get(index).copied().unwrap_or(line);
        let end_of = |index: usize| match line_at(index).role {
            Role::Sub { end } | Role::While { end } | Role::Do { end } | Role::Repeat { end } => end,
            _ => index,
        };
        match line.role {
            Role::Sub { end } => self.place = line_at(end).after,
            Role::EndSub | Role::Return => {
                if self.calls.last().is_some_and(|call| call.again.is_some()) {
                    let problem = Problem::ReturnMismatch { found: "the end of a sub", expected: "M99" };
                    return Err(at(Located::new(word.offset, problem)));
                }
                let mut rest = word.rest.clone();
                self.interpreter.returned = match rest.peek_text() {
                    Some(b'[') => Some(expression::bracketed(&mut rest, &self.interpreter).map_err(at)?),
                    _ => None,
                };
                OWord { rest, ..word }.refuse_rest().map_err(at)?;
                self.leave().map_err(at)?;
            }
            Role::If { .. } => self
                .branch(file, structure, index)
                .map_err(|(place, located)| (Rc::clone(file), place, located))?,
            Role::ElseIf { end, .. } | Role::Else { end } => self.place = line_at(end).after,
            Role::EndIf | Role::Do { .. } => word.refuse_rest().map_err(at)?,
            Role::While { end } => {
                if self.condition(&word).map_err(at)? == 0.0 {
                    self.place = line_at(end).after;
                }
            }
            Role::EndWhile { begin } => {
                word.refuse_rest().map_err(at)?;
                self.place = line_at(begin).start;
            }
            Role::DoWhile { begin } => {
                if self.condition(&word).map_err(at)? != 0.0 {
                    self.place = line_at(begin).after;
                }
            }
            Role::Repeat { end } => {
                let count = self.condition(&word).map_err(at)?.round();
                if count >= 1.0 {
                    // Beyond the lines that may run, every count is the same.
                    self.repeats.push(Repeat { begin: index, left: count as u64 - 1 });
                } else {
                    self.place = line_at(end).after;
                }
            }
            Role::EndRepeat { begin } => {
                word.refuse_rest().map_err(at)?;
                match self.repeats.last_mut().filter(|repeat| repeat.begin == begin) {
                    Some(repeat) if repeat.left > 0 => {
                        repeat.left -= 1;
                        self.place = line_at(begin).after;
                    }
                    Some(_) => drop(self.repeats.pop()),
                    None => {}
                }
            }
            Role::Break { begin } | Role::Continue { begin } => {
                word.refuse_rest().map_err(at)?;
                while self.repeats.last().is_some_and(|repeat| repeat.begin > begin) {
                    self.repeats.pop();
                }
                let end = line_at(end_of(begin));
                self.place = match (line.role, line_at(begin).role) {
                    (Role::Break { .. }, _) => end.after,
                    (_, Role::Do { .. }) => end.start,
                    _ => line_at(begin).start,
                };
            }
            Role::Call | Role::Program => {}
        }
        Ok(())
    }

    /// Goes to the branch of an `if` whose condition is true.
    fn branch(
        &mut self,
        file: &File<'a>,
        structure: &Structure,
        first: usize,
    ) -> Result<(), (Place, Located)> {
        let mut index = first;
        while let Some(line) = structure.lines.get(index) {
            self.place = line.after;
            let next = match line.role {
                Role::If { next } | Role::ElseIf { next, .. } => next,
                _ => return Ok(()),
            };
            let at = |located| (line.start, located);
            let Some((text, _)) = file.source.line(line.start) else { return Ok(()) };
            let cursor = file.source.cursor(text, self.options.block_delete).and_then(oword::place);
            let Some(cursor) = cursor else { return Ok(()) };
            let word = OWord::read(cursor, &self.interpreter).map_err(at)?;
            if self.condition(&word).map_err(at)? != 0.0 {
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
        OWord { rest, ..word.clone() }.refuse_rest()?;
        Ok(value)
    }

    fn arguments(&self, word: &OWord<'_>) -> Result<[f64; LOCALS], Located> {
        let mut arguments = [0.0; LOCALS];
        let mut rest = word.rest.clone();
        let mut slots = arguments.iter_mut();
        while rest.peek_text() == Some(b'[') {
            let place = rest.next;
            let value = expression::bracketed(&mut rest, &self.interpreter)?;
            *slots.next().ok_or(Located::new(place, Problem::TooManyArguments))? = value;
            while rest.peek_text() == Some(b'(') {
                rest.comment()?;
            }
        }
        OWord { rest, ..word.clone() }.refuse_rest()?;
        Ok(arguments)
    }

    /// Calls a subroutine; without arguments, a subprogram of M98.
    fn call(
        &mut self,
        label: &str,
        arguments: Option<[f64; LOCALS]>,
        repeats: u32,
        offset: usize,
    ) -> Result<(), CallError<'a>> {
        if self.calls.len() >= LEVELS_MAX {
            return Err(CallError::Here(Located::new(offset, Problem::TooDeep { levels: LEVELS_MAX })));
        }
        let is_sub = arguments.is_some();
        let (file, place) = self.find(label, is_sub, offset)?;
        self.interpreter.parameters.enter(arguments.as_ref());
        self.interpreter.enter();
        self.calls.push(Call {
            file: self.file,
            place: self.place,
            repeats: std::mem::take(&mut self.repeats),
            again: (!is_sub).then_some((place, repeats)),
        });
        (self.file, self.place) = (file, place);
        Ok(())
    }

    /// Where a subroutine begins: in this file, in the program, in a file read before, in a file of its name.
    fn find(&mut self, label: &str, is_sub: bool, offset: usize) -> Result<(usize, Place), CallError<'a>> {
        let begin = |structure: &Structure| {
            let table = if is_sub { &structure.subs } else { &structure.programs };
            Some(structure.lines.get(*table.get(label)?)?.after)
        };
        for index in [self.file, 0].into_iter().chain(1..self.files.len()) {
            let Some(file) = self.files.get(index) else { continue };
            let structure = structure(file, self.options)
                .map_err(|(place, located)| CallError::There(Rc::clone(file), place, located))?;
            if let Some(place) = begin(structure) {
                return Ok((index, place));
            }
        }
        let missing =
            || CallError::Here(Located::new(offset, Problem::SubroutineMissing { label: label.to_owned() }));
        // A name leads to no other folder.
        if label.contains(['/', '\\', ':', '\0']) || label.starts_with('.') {
            return Err(missing());
        }
        let name = format!("{label}.ngc");
        let found =
            self.options.subroutines.iter().map(|folder| folder.join(&name)).find(|path| path.is_file());
        let path = found.ok_or_else(missing)?;
        let shown = path.display().to_string();
        let text = fs::read(&path).map_err(|error| {
            let problem = Problem::SubroutineUnreadable { path: shown.clone(), error: error.to_string() };
            CallError::Here(Located::new(offset, problem))
        })?;
        let file =
            Rc::new(File { source: Source::new(&shown, Cow::Owned(text)), structure: OnceCell::new() });
        let place = begin(
            structure(&file, self.options)
                .map_err(|(place, located)| CallError::There(Rc::clone(&file), place, located))?,
        );
        let Some(place) = place else {
            let problem = Problem::SubroutineNotInFile { label: label.to_owned(), path: shown };
            return Err(CallError::Here(Located::new(offset, problem)));
        };
        self.files.push(file);
        Ok((self.files.len() - 1, place))
    }

    /// Ends a subroutine, or begins it again.
    fn leave(&mut self) -> Result<(), Located> {
        if let Some(Call { again: Some((place, times @ 2..)), .. }) = self.calls.last_mut() {
            *times -= 1;
            self.place = *place;
            self.repeats.clear();
            return Ok(());
        }
        let Some(call) = self.calls.pop() else { return Ok(()) };
        self.interpreter.parameters.leave(call.again.is_none());
        self.interpreter.leave()?;
        (self.file, self.place, self.repeats) = (call.file, call.place, call.repeats);
        Ok(())
    }

    /// A file of subroutines alone is right if all of it can be read.
    fn check_subroutines(&self) -> Result<(), GcodeError> {
        let Some(file) = self.files.first() else { return Ok(()) };
        let program = &self.interpreter.program;
        let is_library = program.steps.is_empty() && file.structure.get().is_some_and(|s| !s.subs.is_empty());
        if !is_library || self.files.len() > 1 {
            return Ok(());
        }
        let mut place = Place::default();
        while let Some((line, after)) = file.source.line(place) {
            let cursor = file.source.cursor(line, self.options.block_delete);
            if let Some(cursor) = cursor.filter(|_| !is_blank_line(line) && !is_percent_line(line)) {
                if oword::place(cursor.clone()).is_none() {
                    Block::collect(cursor, &Unread)
                        .map_err(|located| GcodeError::new(&file.source.name, place.line, line, located))?;
                }
            }
            place = after;
        }
        Ok(())
    }
}

/// Why a call fails: here, or in the file that is called.
enum CallError<'a> {
    Here(Located),
    There(Rc<File<'a>>, Place, Located),
}

impl<'a> CallError<'a> {
    fn at(self, file: &Rc<File<'a>>, here: Place) -> (Rc<File<'a>>, Place, Located) {
        match self {
            Self::Here(located) => (Rc::clone(file), here, located),
            Self::There(file, place, located) => (file, place, located),
        }
    }
}

/// The structure of a file, made when it is first needed.
fn structure<'file>(
    file: &'file File<'_>,
    options: &ReadOptions,
) -> Result<&'file Structure, (Place, Located)> {
    if let Some(structure) = file.structure.get() {
        return Ok(structure);
    }
    let structure = Structure::of(&file.source, options.block_delete)?;
    Ok(file.structure.get_or_init(|| structure))
}
