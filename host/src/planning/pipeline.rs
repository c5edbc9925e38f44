//! The way of a program's steps to what is known of its path: runs, smoothing, look-ahead, part by part.
//!
//! Memory is that of [`TOGETHER`] sections and of the path that is not settled yet, whatever the length of the program.

use super::Mode;
use super::error::AtLine;
use super::runs::{Between, Runs};
use super::sections::{Smoothed, TOGETHER, smoothed};
use super::stretch::{Growing, Known};
use crate::gcode::{Message, Nurbs, Step};
use crate::machine::Machine;
use crate::toolpath::smooth::Move;

/// Takes what comes out.
pub(super) type Out<'a, const N: usize> = dyn FnMut(Next<N>) -> AtLine<()> + 'a;

/// What comes out, in the order of the program.
pub(super) enum Next<const N: usize> {
    /// Of a stretch.
    Path(Known<N>),
    /// Between stretches.
    Between(Between),
}

/// A program on its way.
pub(super) struct Pipeline<'m, const N: usize> {
    machine: &'m Machine<N>,
    runs: Runs<'m, N>,
    growing: Growing<'m, N>,
    /// Parts that are smoothed together: few at first, so that motion begins soon.
    together: usize,
}

impl<'m, const N: usize> Pipeline<'m, N> {
    /// Before the first step.
    pub(super) fn new(machine: &'m Machine<N>, mode: Mode) -> Self {
        Self { machine, runs: Runs::new(machine), growing: Growing::new(machine, mode), together: 1 }
    }

    /// Takes steps, with the curves and the messages among them. At an error, everything before it comes out, to rest.
    pub(super) fn take(
        &mut self,
        (steps, curves, messages): (&[Step], &[Nurbs], &[Message]),
        out: &mut Out<'_, N>,
    ) -> AtLine<()> {
        let mut said = messages.iter().peekable();
        for (index, step) in steps.iter().enumerate() {
            while let Some(message) = said.next_if(|message| message.step <= index) {
                self.runs.say(message);
            }
            if let Err(error) = self.runs.step(step, curves) {
                self.end(out)?;
                return Err(error);
            }
            if self.runs.waiting() >= self.together {
                self.advance(out)?;
            }
        }
        said.for_each(|message| self.runs.say(message));
        Ok(())
    }

    /// Takes moves that follow each other from rest to rest.
    pub(super) fn take_moves(&mut self, moves: Vec<Move<N>>, out: &mut Out<'_, N>) -> AtLine<()> {
        for step in moves {
            self.runs.go([step])?;
            if self.runs.waiting() >= self.together {
                self.advance(out)?;
            }
        }
        self.end(out)
    }

    /// What was taken comes out, to rest: behind the last step, or where no more is to come.
    pub(super) fn end(&mut self, out: &mut Out<'_, N>) -> AtLine<()> {
        let spline = self.runs.end_spline();
        self.runs.stop();
        self.advance(out)?;
        spline
    }

    fn advance(&mut self, out: &mut Out<'_, N>) -> AtLine<()> {
        let parts = self.runs.parts();
        self.together = (2 * self.together).min(TOGETHER);
        for part in smoothed(parts, self.machine) {
            match part {
                Ok(Smoothed::Blocks { blocks, goes_on }) => {
                    self.growing.take(blocks, goes_on, &mut |known| out(Next::Path(known)))?;
                }
                Ok(Smoothed::Between(what)) => out(Next::Between(what))?,
                Err(error) => {
                    self.growing.end(&mut |known| out(Next::Path(known)))?;
                    return Err(error);
                }
            }
        }
        Ok(())
    }
}
