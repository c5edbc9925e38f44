//! The items of a program for a board's axes.

use motion_kernel::axis::Guards;
use motion_kernel::program::{Header, Item, write};

use crate::machine::Machine;
use crate::planning::{first_axes, guards_of_axes, header_of_axes};

/// A program for a board of `M` axes.
#[derive(Clone, Debug)]
pub struct Job<const M: usize> {
    /// The machine it was planned for.
    pub header: Header<M>,
    /// Its items, live control's blocks among them.
    pub items: Vec<Item<M>>,
    /// Its name on the link: the checksum of machine and items, and not 0.
    pub name: u32,
    /// The checksum of the machine: that of its program without items.
    pub machine: u32,
}

impl<const M: usize> Job<M> {
    /// The job of `items` on `machine`, which has `M` axes or fewer than `M` places behind them.
    #[must_use]
    pub fn new<const N: usize>(machine: &Machine<N>, items: &[Item<N>]) -> Self {
        let (header, guards) = (header_of_axes(&machine.header()), guards_of_axes(&machine.guards()));
        let items: Vec<Item<M>> = items.iter().map(first_axes).collect();
        let name = checksum(&header, &guards, &items).max(1);
        Self { header, name, machine: checksum(&header, &guards, &[]), items }
    }
}

impl<const M: usize> Job<M> {
    /// The program line of the first piece of path from an item on; none behind the last one.
    #[must_use]
    pub fn line_of(&self, item: u32) -> Option<u32> {
        self.items.get(item as usize..)?.iter().find_map(|item| match item {
            Item::Line { line, .. } | Item::Septic { line, .. } => Some(*line),
            _ => None,
        })
    }
}

/// The checksum at the end of a compiled program.
fn checksum<const M: usize>(header: &Header<M>, guards: &Guards<M>, items: &[Item<M>]) -> u32 {
    let bytes = record(header, guards, items);
    bytes.last_chunk().map_or(0, |sum| u32::from_le_bytes(*sum))
}

/// A compiled program.
fn record<const M: usize>(header: &Header<M>, guards: &Guards<M>, items: &[Item<M>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Entries of nine axes fit the format.
    write(header, Some(guards), items, &mut bytes).expect("nine axes at most");
    bytes
}

/// A machine's parameters for a board of `M` axes: a compiled program without items.
#[must_use]
pub fn parameters<const N: usize, const M: usize>(machine: &Machine<N>) -> Vec<u8> {
    record::<M>(&header_of_axes(&machine.header()), &guards_of_axes(&machine.guards()), &[])
}
