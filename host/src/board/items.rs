//! The items of a job: all there, or planned while it is driven.

use std::cell::Cell;
use std::collections::VecDeque;
use std::error::Error;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;

use motion_kernel::num::Real;
use motion_kernel::program::Item;
use motion_kernel::units::Position;

use super::error::BoardError;
use super::job::{Job, piece};
use crate::gcode::{ReadOptions, Reading};
use crate::machine::Machine;
use crate::planning::{Stream, Streamed, assumed_path, first_axes, notes, require_outputs};

/// Items that are planned ahead of what the board has room for.
const AHEAD: usize = 4096;
/// Items whose lines are remembered; a board asks about those that it has not driven yet.
const LINES: usize = 1 << 16;

/// What planning hands on.
enum Planned<const M: usize> {
    Item(Item<M>, Option<String>),
    Note(String),
    End,
    Failed(Box<dyn Error + Send + Sync>),
}

/// The items, in their order.
pub(super) enum Items<const M: usize> {
    Whole { job: Arc<Job<M>>, next: usize },
    Planned(Box<InPlanning<M>>),
}

/// A program that is read and planned while it is driven.
pub struct InPlanning<const M: usize> {
    name: String,
    planned: Receiver<Planned<M>>,
    /// The next item, once it is there; at the end, nothing.
    next: Option<Option<Item<M>>>,
    failed: Option<BoardError>,
    /// The last item that was taken is of a stretch that does not end.
    is_in_stretch: bool,
    /// Items before the next one, and the program lines of the latest of them; 0: of no piece of path.
    taken: usize,
    lines: VecDeque<u32>,
    /// Where the last stretch ended.
    here: Vec<Position>,
    /// What was said and not told yet.
    said: Vec<Said>,
}

/// What a program says while it is planned.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// Of a program stop at a place.
    Stop(Vec<Position>, String),
    /// A note for the operator.
    Note(String),
}

/// What there is next.
pub(super) enum Next<'a, const M: usize> {
    Item(&'a Item<M>),
    /// It is being planned.
    Wait,
    End,
}

/// What a program is read from.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its name in errors.
    pub name: String,
    /// The text.
    pub text: Vec<u8>,
    /// What it is read with.
    pub options: ReadOptions,
    /// Words of spindle and coolant that the machine has no output for are left out, not refused.
    pub leaves_out_outputs: bool,
}

impl<const M: usize> InPlanning<M> {
    /// Reads and plans a program for the number type `R` in a thread of its own, which waits where it is far ahead.
    #[must_use]
    pub fn begin<R: Real + Send, const N: usize>(source: Source, machine: &Machine<N>) -> Self {
        let (to, planned) = sync_channel(AHEAD);
        let (machine, name) = (machine.clone(), source.name.clone());
        thread::spawn(move || {
            let last = match plan::<R, N, M>(&source, &machine, &to) {
                Ok(()) => Planned::End,
                Err(error) => Planned::Failed(error),
            };
            // Nobody listens where the job was given up.
            let _ = to.send(last);
        });
        Self {
            name,
            planned,
            next: None,
            failed: None,
            is_in_stretch: false,
            taken: 0,
            lines: VecDeque::new(),
            here: vec![Position::ZERO; M],
            said: Vec::new(),
        }
    }

    fn next(&mut self) -> Next<'_, M> {
        while self.next.is_none() {
            match self.planned.try_recv() {
                Ok(Planned::Item(item, stop)) => {
                    self.said.extend(stop.map(|text| Said::Stop(self.here.clone(), text)));
                    if let Item::EndOfStretch(end) = item {
                        self.here = end.to_vec();
                    }
                    self.next = Some(Some(item));
                }
                Ok(Planned::Note(note)) => self.said.push(Said::Note(note)),
                Ok(Planned::End) => self.next = Some(None),
                Ok(Planned::Failed(error)) => self.fail(BoardError::Program(error)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    self.fail(BoardError::Program("planning has ended".into()));
                }
            }
        }
        match &self.next {
            Some(Some(item)) => Next::Item(item),
            Some(None) => Next::End,
            None => Next::Wait,
        }
    }

    fn fail(&mut self, error: BoardError) {
        (self.failed, self.next) = (Some(error), Some(None));
    }

    fn advance(&mut self) {
        let Some(Some(item)) = self.next.take_if(|next| next.is_some()) else { return };
        self.is_in_stretch =
            matches!(item, Item::Block(_) | Item::Feed(_) | Item::Line { .. } | Item::Septic { .. });
        self.taken += 1;
        self.lines.push_back(piece(&item).map_or(0, |(line, _)| line));
        if self.lines.len() > LINES {
            self.lines.pop_front();
        }
    }

    /// The program line of the first piece of path from an item on, of those that were taken or are next.
    fn line_of(&self, item: usize) -> Option<u32> {
        let first = self.taken - self.lines.len();
        let known = self.lines.iter().skip(item.checked_sub(first)?).copied();
        let next = self.next.iter().flatten().filter_map(|item| piece(item).map(|(line, _)| line));
        known.chain(next).find(|&line| line > 0)
    }
}

/// Reads, plans, and hands on.
fn plan<R: Real, const N: usize, const M: usize>(
    source: &Source,
    machine: &Machine<N>,
    to: &SyncSender<Planned<M>>,
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let mut reading = Reading::new(&source.name, &source.text, &source.options);
    let mut stream = Stream::<R, N>::new(&source.name, machine);
    let (is_listened_to, mut is_path_programmed) = (Cell::new(true), false);
    let mut put = |streamed: Streamed<N>| {
        let item = Planned::Item(first_axes(&streamed.item), streamed.stop);
        is_listened_to.set(is_listened_to.get() && to.send(item).is_ok());
    };
    loop {
        let batch = match reading.next_batch() {
            Ok(Some(batch)) => batch,
            Ok(None) => break,
            Err(error) => {
                stream.end(&mut put)?;
                return Err(error.into());
            }
        };
        if !is_path_programmed && let Some(note) = assumed_path(&batch.steps, machine) {
            is_path_programmed = true;
            let _ = to.send(Planned::Note(note));
        }
        if !source.leaves_out_outputs
            && let Err(error) = require_outputs(&source.name, &batch.steps, machine)
        {
            stream.end(&mut put)?;
            return Err(error.into());
        }
        stream.take(&batch, &mut put)?;
        if !is_listened_to.get() {
            return Ok(());
        }
    }
    stream.end(&mut put)?;
    for note in reading.into_program().iter().flat_map(|program| notes(program, machine)) {
        let _ = to.send(Planned::Note(note));
    }
    Ok(())
}

impl<const M: usize> Items<M> {
    /// What there is next.
    pub(super) fn next(&mut self) -> Next<'_, M> {
        match self {
            Self::Whole { job, next } => job.items.get(*next).map_or(Next::End, Next::Item),
            Self::Planned(planned) => planned.next(),
        }
    }

    /// The next item is taken.
    pub(super) fn advance(&mut self) {
        match self {
            Self::Whole { next, .. } => *next += 1,
            Self::Planned(planned) => planned.advance(),
        }
    }

    /// From the first one on, again.
    pub(super) fn rewind(&mut self) {
        if let Self::Whole { next, .. } = self {
            *next = 0;
        }
    }

    /// How many there are, where that is known.
    pub(super) fn count(&self) -> Option<usize> {
        match self {
            Self::Whole { job, .. } => Some(job.items.len()),
            Self::Planned(_) => None,
        }
    }

    /// The program line of the first piece of path from an item on; none where it is not known any more, or not yet.
    pub(super) fn line_of(&self, item: u32) -> Option<u32> {
        match self {
            Self::Whole { job, .. } => job.line_of(item),
            Self::Planned(planned) => planned.line_of(item as usize),
        }
    }

    /// The program's name, where it is planned.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Whole { .. } => "the program",
            Self::Planned(planned) => &planned.name,
        }
    }

    /// Why there are no more than these, where the program could not be read or planned to its end.
    pub(super) fn take_failure(&mut self) -> Option<BoardError> {
        match self {
            Self::Whole { .. } => None,
            Self::Planned(planned) => planned.failed.take(),
        }
    }

    /// There are no more, because the next one can't be driven.
    pub(super) fn fail(&mut self, error: BoardError) {
        if let Self::Planned(planned) = self {
            planned.fail(error);
        }
    }

    /// Whether what was taken ends in the middle of a stretch.
    pub(super) fn is_in_stretch(&self) -> bool {
        matches!(self, Self::Planned(planned) if planned.is_in_stretch)
    }

    /// The line of the last piece of path that was taken.
    pub(super) fn last_line(&self) -> u32 {
        match self {
            Self::Whole { .. } => 0,
            Self::Planned(planned) => planned.lines.iter().rev().copied().find(|&line| line > 0).unwrap_or(0),
        }
    }

    /// Whether there is such a reason.
    pub(super) fn has_failed(&self) -> bool {
        matches!(self, Self::Planned(planned) if planned.failed.is_some())
    }

    /// What the program has said since the last call.
    pub(super) fn take_said(&mut self) -> Vec<Said> {
        match self {
            Self::Whole { .. } => Vec::new(),
            Self::Planned(planned) => std::mem::take(&mut planned.said),
        }
    }
}
