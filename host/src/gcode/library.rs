//! The files of a program: its own first, then those of the subroutines it calls, in the order of their first calls.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::fs;
use std::rc::Rc;

use super::error::{GcodeError, Located, Problem};
use super::lexer::Cursor;
use super::options::ReadOptions;
use super::source::{Place, Source};
use super::structure::Structure;

/// A file, with its structure once that is needed.
pub(super) struct File<'a> {
    pub(super) source: Source<'a>,
    block_delete: bool,
    structure: OnceCell<Result<Structure, (Place, Located)>>,
}

/// A problem in a line of a file.
pub(super) struct Failure<'a> {
    file: Rc<File<'a>>,
    /// The start of the line.
    place: Place,
    located: Located,
}

impl<'a> File<'a> {
    fn new(name: &str, text: Cow<'a, [u8]>, block_delete: bool) -> Self {
        Self { source: Source::new(name, text), block_delete, structure: OnceCell::new() }
    }

    /// The start of a line's words; none for a line that is left out.
    pub(super) fn cursor<'line>(&self, line: &'line [u8]) -> Option<Cursor<'line>> {
        self.source.cursor(line, self.block_delete)
    }

    /// A problem in the line that starts at `place`.
    pub(super) fn failure(self: &Rc<Self>, place: Place, located: Located) -> Failure<'a> {
        Failure { file: Rc::clone(self), place, located }
    }

    /// What its O-words join; made when it is first asked for.
    pub(super) fn structure(self: &Rc<Self>) -> Result<&Structure, Failure<'a>> {
        let structure = self.structure.get_or_init(|| Structure::of(&self.source, self.block_delete));
        structure.as_ref().map_err(|(place, located)| self.failure(*place, located.clone()))
    }

    /// The structure, if it was asked for.
    fn known(&self) -> Option<&Structure> {
        self.structure.get()?.as_ref().ok()
    }

    /// Whether an O-word was executed, and the file has subroutines.
    pub(super) fn has_subs(&self) -> bool {
        self.known().is_some_and(|structure| !structure.subs.is_empty())
    }

    /// Whether an O-word was executed, and the file has subprograms of M98.
    pub(super) fn has_subprograms(&self) -> bool {
        self.known().is_some_and(|structure| !structure.programs.is_empty())
    }
}

impl<'a> Failure<'a> {
    /// The file, the start of the line, and the problem in it.
    pub(super) fn parts(&self) -> (&Rc<File<'a>>, Place, &Located) {
        (&self.file, self.place, &self.located)
    }

    pub(super) fn into_error(self) -> GcodeError {
        let line = self.file.source.line(self.place).map_or(&b""[..], |(line, _)| line);
        GcodeError::new(&self.file.source.name, self.place.line, line, self.located)
    }
}

/// What is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Callee {
    /// A `sub`, by `call`.
    Sub,
    /// A subprogram, by M98.
    Subprogram,
}

/// The files read so far.
pub(super) struct Library<'a> {
    files: Vec<Rc<File<'a>>>,
    options: &'a ReadOptions,
}

impl<'a> Library<'a> {
    /// The program's file.
    pub(super) fn new(name: &str, text: &'a [u8], options: &'a ReadOptions) -> Self {
        let file = File::new(name, Cow::Borrowed(text), options.block_delete);
        Self { files: vec![Rc::new(file)], options }
    }

    /// A file; 0 is the program's.
    pub(super) fn file(&self, index: usize) -> Option<&Rc<File<'a>>> {
        self.files.get(index)
    }

    /// The file of a subroutine, and the line behind its first. It is looked for in the caller's file, in the
    /// program's, in those read before, and in a file of its name. `caller` is where the call stands.
    pub(super) fn find(
        &mut self,
        label: &str,
        callee: Callee,
        caller: usize,
        failure: &dyn Fn(Problem) -> Failure<'a>,
    ) -> Result<(usize, Place), Failure<'a>> {
        for index in [caller, 0].into_iter().chain(1..self.files.len()) {
            let Some(file) = self.files.get(index) else { continue };
            if let Some(place) = file.structure()?.body(label, callee) {
                return Ok((index, place));
            }
        }
        let file = self.of_name(label, failure)?;
        let Some(place) = file.structure()?.body(label, callee) else {
            let path = file.source.name.clone();
            return Err(failure(Problem::SubroutineNotInFile { label: label.to_owned(), path }));
        };
        self.files.push(file);
        Ok((self.files.len() - 1, place))
    }

    /// The file `label.ngc` of the first folder that has it.
    fn of_name(
        &self,
        label: &str,
        failure: &dyn Fn(Problem) -> Failure<'a>,
    ) -> Result<Rc<File<'a>>, Failure<'a>> {
        // A name leads to no other folder.
        let is_name = !label.contains(['/', '\\', ':', '\0']) && !label.starts_with('.');
        let name = format!("{label}.ngc");
        let mut paths = self.options.subroutines.iter().map(|folder| folder.join(&name));
        let Some(path) = paths.find(|path| is_name && path.is_file()) else {
            return Err(failure(Problem::SubroutineMissing { label: label.to_owned() }));
        };
        let shown = path.display().to_string();
        let text = fs::read(&path).map_err(|error| {
            failure(Problem::SubroutineUnreadable { path: shown.clone(), error: error.to_string() })
        })?;
        Ok(Rc::new(File::new(&shown, Cow::Owned(text), self.options.block_delete)))
    }
}
