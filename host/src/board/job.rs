//! The items of a program for a board's axes.

use motion_kernel::program::{Header, Item};

use crate::machine::Machine;
use crate::planning::{bytes_of, first_axes, header_of_axes};

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
        Self {
            header: header_of_axes(&machine.header()),
            items: items.iter().map(first_axes).collect(),
            name: checksum(&bytes_of::<N, M>(machine, items)).max(1),
            machine: checksum(&parameters::<N, M>(machine)),
        }
    }

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
pub(super) fn checksum(program: &[u8]) -> u32 {
    program.last_chunk().map_or(0, |sum| u32::from_le_bytes(*sum))
}

/// A machine's parameters for a board of `M` axes: a compiled program without items.
#[must_use]
pub fn parameters<const N: usize, const M: usize>(machine: &Machine<N>) -> Vec<u8> {
    bytes_of::<N, M>(machine, [])
}
