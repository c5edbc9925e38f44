//! A plan in the kernel's terms, checked against the number type and against the bounds of a tick.
//!
//! Consumes a [`Plan`]; produces the items of the two streams. A program that is denser than the executor's
//! bounds, or beyond the number type's range, is refused here, with its line, before anything moves.

use core::convert::Infallible;

use motion_kernel::num::Real;
use motion_kernel::program::Item;

use super::compiled::bytes;
use super::error::{AtLine, PlanningError};
use super::items::Items;
use super::stretch::Stretch;
use super::{Item as PlanItem, Plan};
use crate::machine::Machine;

/// The items of the two streams.
#[derive(Clone, Debug)]
pub struct Executable<const N: usize = 3> {
    /// The items, in order.
    pub items: Vec<Item<N>>,
    /// The control tick they are for \[s\].
    pub tick_s: f64,
}

impl<const N: usize> Executable<N> {
    /// The executable form of `plan`, for kernels of the number type `R`.
    ///
    /// # Errors
    /// A move can't be made into pieces, a figure is beyond the number type, or more pieces or segments than
    /// the tick's bound fall into one tick.
    pub fn new<R: Real>(plan: &Plan<N>) -> Result<Self, PlanningError> {
        let mut items = Vec::with_capacity(plan.items.len());
        let mut maker = Items::<R, N>::new(plan.tick_s, plan.axes);
        let mut put = |item: Item<N>| {
            items.push(item);
            Ok(())
        };
        for item in &plan.items {
            let made = match *item {
                PlanItem::Stretch(ref stretch) => whole(&mut maker, stretch, &mut put),
                PlanItem::Dwell { line, seconds } => maker.dwell(line, seconds).and_then(&mut put),
                PlanItem::Switch { to, .. } => put(Item::Switch(to)),
                PlanItem::Stop { .. } => put(Item::Stop),
            };
            made.map_err(|problem| PlanningError::at_line(&plan.source, problem))?;
        }
        Ok(Self { items, tick_s: plan.tick_s })
    }

    /// The bytes for a board without live control.
    pub fn without_blocks(&self) -> impl Iterator<Item = &Item<N>> {
        self.items.iter().filter(|item| !matches!(item, Item::Block(_)))
    }

    /// The program with the machine it was planned for, as bytes for a board without live control: without
    /// blocks.
    #[must_use]
    pub fn to_bytes(&self, machine: &Machine<N>) -> Vec<u8> {
        bytes(machine, self.without_blocks())
    }

    /// The same for a board with live control.
    #[must_use]
    pub fn to_live_bytes(&self, machine: &Machine<N>) -> Vec<u8> {
        bytes(machine, &self.items)
    }

    /// The items of motion, as the kernel's [`Supply`](motion_kernel::program::Supply) takes them: without switches of
    /// outputs.
    pub fn supplied(&self) -> impl Iterator<Item = Result<Item<N>, Infallible>> + '_ {
        self.items.iter().filter(|item| !matches!(item, Item::Switch(_))).map(|&item| Ok(item))
    }
}

/// The items of a stretch that is known to its end.
fn whole<R: Real, const N: usize>(
    maker: &mut Items<R, N>,
    stretch: &Stretch<N>,
    put: &mut impl FnMut(Item<N>) -> AtLine<()>,
) -> AtLine<()> {
    stretch.blocks.iter().try_for_each(|block| maker.block(block))?;
    stretch.profile.ramps().iter().try_for_each(|placed| maker.ramp(placed.planned))?;
    maker.end(put)
}
