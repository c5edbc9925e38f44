//! A program planned while it is read: items as soon as they are known.

use motion_kernel::num::Real;
use motion_kernel::program::Item;

use super::error::{AtLine, PlanningError, Problem};
use super::items::Items;
use super::pipeline::{Next, Out, Pipeline};
use super::runs::Between;
use super::stretch::Known;
use super::{Mode, travel};
use crate::gcode::Batch;
use crate::machine::Machine;

/// Plans a program part by part, for kernels of the number type `R`.
///
/// Its items are those of [`Executable`](super::Executable), whatever the parts are. Memory is bounded: see `pipeline`.
pub struct Stream<'m, R, const N: usize> {
    source_name: String,
    machine: &'m Machine<N>,
    pipeline: Pipeline<'m, N>,
    items: Items<R, N>,
}

/// An item of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed<const N: usize> {
    /// The item.
    pub item: Item<N>,
    /// Of a program stop: what the program says of it.
    pub stop: Option<String>,
}

impl<'m, R: Real, const N: usize> Stream<'m, R, N> {
    /// Before the first step; `source_name` appears in errors.
    #[must_use]
    pub fn new(source_name: &str, machine: &'m Machine<N>) -> Self {
        Self {
            source_name: source_name.to_owned(),
            machine,
            pipeline: Pipeline::new(machine, Mode::Spanning),
            items: Items::new(machine.tick_s, machine.letters_by_place()),
        }
    }

    /// Takes the next steps, and gives out the items that are known by them.
    ///
    /// # Errors
    /// As [`plan_program`](super::plan_program), and a probing move: where it trips, no program says. What stands before the
    /// line at fault was given out, to rest.
    pub fn take(&mut self, batch: &Batch, put: &mut dyn FnMut(Streamed<N>)) -> Result<(), PlanningError> {
        self.run(put, |pipeline, out| pipeline.take((&batch.steps, &batch.nurbs, &batch.messages), out))
    }

    /// Gives out what was taken, to rest: behind the last step, or where the rest of the program is not to come.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn end(&mut self, put: &mut dyn FnMut(Streamed<N>)) -> Result<(), PlanningError> {
        self.run(put, |pipeline, out| pipeline.end(out))
    }

    fn run(
        &mut self,
        put: &mut dyn FnMut(Streamed<N>),
        step: impl FnOnce(&mut Pipeline<'m, N>, &mut Out<'_, N>) -> AtLine<()>,
    ) -> Result<(), PlanningError> {
        let Self { source_name, machine, pipeline, items } = self;
        let mut checked = |item: Item<N>, stop: Option<String>| {
            travel::check(&item, machine)?;
            put(Streamed { item, stop });
            Ok(())
        };
        let done = step(pipeline, &mut |next| {
            let mut put = |item| checked(item, None);
            match next {
                Next::Path(Known::Block(block)) => items.block(&block),
                Next::Path(Known::Ramp(ramp)) => {
                    items.ramp(ramp)?;
                    items.give(&mut put)
                }
                Next::Path(Known::End) => items.end(&mut put),
                Next::Between(Between::Probe { line, .. }) => Err((line, Problem::NoProbeInput)),
                Next::Between(Between::Dwell { line, seconds }) => items.dwell(line, seconds).and_then(put),
                Next::Between(Between::Switch { to, .. }) => put(Item::Switch(to)),
                Next::Between(Between::Stop { said, .. }) => checked(Item::Stop, Some(said)),
            }
        });
        done.map_err(|problem| PlanningError::at_line(source_name, problem))
    }
}
