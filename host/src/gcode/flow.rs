//! Which line comes next: the next one, or where an O-word, M98 or M99 leads.

use std::rc::Rc;

use super::block::Block;
use super::error::{GcodeError, Located, Problem};
use super::expression;
use super::interpreter::{Control, Interpreter};
use super::lexer::{Cursor, is_blank_line, is_percent_line};
use super::library::{Callee, Failure, File, Library};
use super::options::ReadOptions;
use super::oword::{self, Keyword, OWord};
use super::parameters::LOCALS;
use super::program::{NoticeKind, Program, StepKind};
use super::source::Place;
use super::structure::{Role, Unread};

/// Most subroutines within each other; LinuxCNC has 10.
const LEVELS_MAX: usize = 100;

/// A subroutine that runs.
struct Call {
    /// Where the caller goes on.
    file: usize,
    place: Place,
    /// The caller's loops.
    repeats: Vec<Repeat>,
    /// Of M98: where it begins, and how often it is to run yet.
    again: Option<(Place, u32)>,
    /// Of M6: the tool that it is to change to.
    changes_to: Option<u32>,
}

/// A `repeat` that runs.
#[derive(Clone, Copy)]
pub(super) struct Repeat {
    /// Its line.
    pub(super) begin: usize,
    /// How often it is to run after this time.
    pub(super) left: u64,
}

/// A program being read.
pub(super) struct Flow<'a> {
    options: &'a ReadOptions,
    library: Library<'a>,
    pub(super) interpreter: Interpreter,
    /// The file of the next line.
    file: usize,
    /// The next line.
    pub(super) place: Place,
    calls: Vec<Call>,
    /// The loops of the subroutine that runs.
    pub(super) repeats: Vec<Repeat>,
    pub(super) executed: u64,
    /// The last line with text in the program's own file.
    last: u32,
    /// Why the text as a whole is no program: nothing of it is read.
    unread: Option<Problem>,
}

/// Why a text can't be a program, whatever its lines are.
fn unread(text: &[u8]) -> Option<Problem> {
    let is_wide = match text {
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => true,
        // Without the mark: every character of G-code has a zero byte then.
        [0, other, ..] | [other, 0, ..] => *other != 0,
        _ => false,
    };
    if is_wide {
        return Some(Problem::WideText);
    }
    text.iter().all(u8::is_ascii_whitespace).then_some(Problem::EmptyText)
}

impl<'a> Flow<'a> {
    /// Before the first line.
    pub(super) fn new(source_name: &str, text: &'a [u8], options: &'a ReadOptions) -> Self {
        Self {
            options,
            library: Library::new(source_name, text, options),
            interpreter: Interpreter::new(options),
            file: 0,
            place: Place::default(),
            calls: Vec::new(),
            repeats: Vec::new(),
            executed: 0,
            last: 1,
            unread: unread(text),
        }
    }

    /// Reads to the end.
    pub(super) fn read(mut self) -> Result<Program, GcodeError> {
        while self.next_line().map_err(Failure::into_error)? {}
        self.finish()
    }

    /// Reads a line; whether another may follow.
    pub(super) fn next_line(&mut self) -> Result<bool, Failure<'a>> {
        let Some(file) = self.library.file(self.file).map(Rc::clone) else { return Ok(false) };
        let here = self.place;
        if let Some(problem) = &self.unread {
            return Err(file.failure(here, Located::new(0, problem.clone())));
        }
        let Some((line, after)) = file.source.line(here) else {
            if self.calls.is_empty() {
                return Ok(false);
            }
            let last = Place { line: here.line.saturating_sub(1).max(1), ..here };
            return Err(file.failure(last, Located::new(0, Problem::SubprogramWithoutEnd)));
        };
        self.place = after;
        // What follows the last line's end is no line.
        if self.file == 0 && !file.source.is_end(here) {
            let program = &mut self.interpreter.program;
            program.lines.is_there(here.line);
            if !self.interpreter.ended {
                program.lines.run(here.line, program.steps.len());
            }
        }
        if is_blank_line(line) {
            // In a loop they take time, too.
            self.executed += 1;
            return Ok(true);
        }
        if self.file == 0 {
            self.interpreter.line = here.line;
            self.last = here.line;
        }
        let told = self.interpreter.program.messages.len();
        let is_elsewhere = self.file != 0;
        self.line(&file, line, here)?;
        if is_elsewhere {
            for message in self.interpreter.program.messages.iter_mut().skip(told) {
                message.within = Some(format!("{}:{}", file.source.name, here.line));
            }
        }
        Ok(!self.interpreter.ended || self.calls.is_empty())
    }

    /// The program, after the last line.
    pub(super) fn finish(mut self) -> Result<Program, GcodeError> {
        let last = self.last;
        self.interpreter.line = last;
        self.check_subroutines()?;
        let unended = self.interpreter.unended_nurbs();
        if let Some(unended) = unended
            .or_else(|| self.interpreter.end_track(0).err())
            .or_else(|| self.interpreter.all_off().err())
        {
            let name = self.library.file(0).map_or("", |file| file.source.name.as_str());
            return Err(GcodeError::new(name, last, b"", unended));
        }
        if !self.interpreter.ended {
            self.interpreter.notice(NoticeKind::NoProgramEnd);
        }
        let mut program = self.interpreter.program;
        program.parameters = self.interpreter.parameters;
        Ok(program)
    }

    /// Where the next line begins, and in which file.
    pub(super) fn position(&self) -> (usize, Place) {
        (self.file, self.place)
    }

    /// One line with text.
    pub(super) fn line(&mut self, file: &Rc<File<'a>>, line: &[u8], here: Place) -> Result<(), Failure<'a>> {
        let at = |located| file.failure(here, located);
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
            self.after_end(file, here);
            return Ok(());
        }
        self.executed += 1;
        if self.executed > self.options.lines_max {
            return Err(at(Located::new(0, Problem::TooManyLines { lines_max: self.options.lines_max })));
        }
        let Some(cursor) = file.cursor(line) else {
            self.interpreter.notice(NoticeKind::BlockDeleted);
            return Ok(());
        };
        if let Some(cursor) = oword::place(cursor.clone()) {
            self.interpreter.begun = true;
            return self.oword(file, cursor, here);
        }
        match self.interpreter.execute(cursor).map_err(at)? {
            Control::Next | Control::Call { repeats: 0, .. } => Ok(()),
            Control::Call { number, repeats } => {
                let failure = |problem| at(Located::new(0, problem));
                self.call(&number.to_string(), None, repeats, &failure)
            }
            Control::ChangeTool { tool } => {
                let failure = |problem| at(Located::new(0, problem));
                self.call_change(tool, &failure)
            }
            Control::Return if self.calls.is_empty() => {
                self.interpreter.notice(NoticeKind::MainReturn);
                self.interpreter.end().map_err(at)
            }
            Control::Return if self.is_subprogram() => self.leave().map_err(at),
            Control::Return => {
                let problem = Problem::ReturnMismatch { found: "M99", expected: "endsub or return" };
                Err(at(Located::new(0, problem)))
            }
        }
    }

    /// Text after the end is not read; subroutines may stand there.
    fn after_end(&mut self, file: &Rc<File<'a>>, here: Place) {
        let behind = file.structure().ok().and_then(|structure| {
            let (_, line) = structure.at(here)?;
            match line.role {
                Role::Sub { end } => Some(structure.line(end)?.after),
                _ => None,
            }
        });
        match behind {
            Some(behind) => self.place = behind,
            None if file.has_subprograms() => {}
            None => self.interpreter.notice(NoticeKind::TextAfterEnd),
        }
    }

    /// A line with an O-word.
    fn oword(&mut self, file: &Rc<File<'a>>, cursor: Cursor<'_>, here: Place) -> Result<(), Failure<'a>> {
        let at = |located| file.failure(here, located);
        let word = OWord::read(cursor, &self.interpreter).map_err(at)?;
        match word.keyword {
            Keyword::Program => Ok(()),
            Keyword::Call => {
                let arguments = self.arguments(&word).map_err(at)?;
                let failure = |problem| at(Located::new(word.offset, problem));
                self.call(&word.label, Some(arguments), 1, &failure)
            }
            Keyword::EndSub | Keyword::Return => {
                file.structure()?;
                self.end_of_sub(&word).map_err(at)
            }
            _ => self.jump(file, &word, here),
        }
    }

    /// `endsub` and `return`, with the value they return.
    fn end_of_sub(&mut self, word: &OWord<'_>) -> Result<(), Located> {
        if self.is_subprogram() {
            let problem = Problem::ReturnMismatch { found: "the end of a sub", expected: "M99" };
            return Err(Located::new(word.offset, problem));
        }
        let mut rest = word.rest.clone();
        self.interpreter.returned = match rest.peek_text() {
            Some(b'[') => Some(expression::bracketed(&mut rest, &self.interpreter)?),
            _ => None,
        };
        word.with(rest).refuse_rest()?;
        self.leave()
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
        word.with(rest).refuse_rest()?;
        Ok(arguments)
    }

    /// Whether M98 called what runs.
    fn is_subprogram(&self) -> bool {
        self.calls.last().is_some_and(|call| call.again.is_some())
    }

    /// Calls a subroutine; without arguments, a subprogram of M98.
    fn call(
        &mut self,
        label: &str,
        arguments: Option<[f64; LOCALS]>,
        repeats: u32,
        failure: &dyn Fn(Problem) -> Failure<'a>,
    ) -> Result<(), Failure<'a>> {
        if self.calls.len() >= LEVELS_MAX {
            return Err(failure(Problem::TooDeep { levels: LEVELS_MAX }));
        }
        let callee = if arguments.is_some() { Callee::Sub } else { Callee::Subprogram };
        let (file, place) = self.library.find(label, callee, self.file, failure)?;
        self.interpreter.parameters.enter(arguments.as_ref());
        self.interpreter.enter();
        self.calls.push(Call {
            file: self.file,
            place: self.place,
            repeats: std::mem::take(&mut self.repeats),
            again: (callee == Callee::Subprogram).then_some((place, repeats)),
            changes_to: None,
        });
        (self.file, self.place) = (file, place);
        Ok(())
    }

    /// Calls the subroutine that changes tools, with the tool's number.
    fn call_change(
        &mut self,
        tool: u32,
        failure: &dyn Fn(Problem) -> Failure<'a>,
    ) -> Result<(), Failure<'a>> {
        let Some(label) = &self.options.change_subroutine else { return Ok(()) };
        let mut arguments = [0.0; LOCALS];
        arguments[0] = f64::from(tool);
        self.call(label, Some(arguments), 1, failure)?;
        self.interpreter.begin_change(tool);
        if let Some(call) = self.calls.last_mut() {
            call.changes_to = Some(tool);
        }
        Ok(())
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
        (self.file, self.place, self.repeats) = (call.file, call.place, call.repeats);
        self.interpreter.parameters.leave(call.again.is_none());
        self.interpreter.leave()?;
        call.changes_to.map_or(Ok(()), |tool| self.interpreter.end_change(tool))
    }

    /// A file of subroutines alone is right if all of it can be read.
    fn check_subroutines(&self) -> Result<(), GcodeError> {
        let program = &self.interpreter.program;
        let has_steps =
            self.interpreter.taken[0] > 0 || program.steps.iter().any(|step| step.kind != StepKind::End);
        let Some(file) = self.library.file(0).filter(|file| !has_steps && file.has_subs()) else {
            return Ok(());
        };
        if self.library.file(1).is_some() {
            return Ok(());
        }
        let mut place = Place::default();
        while let Some((line, after)) = file.source.line(place) {
            let has_text = !is_blank_line(line) && !is_percent_line(line);
            let cursor = file.cursor(line);
            if let Some(cursor) = cursor.filter(|cursor| has_text && oword::place(cursor.clone()).is_none()) {
                Block::collect(cursor, &Unread, self.interpreter.program.axes)
                    .map_err(|located| file.failure(place, located).into_error())?;
            }
            place = after;
        }
        Ok(())
    }
}
