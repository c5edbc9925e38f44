//! A program as bytes for a board, with the axes of its machine and no others.
//!
//! Planning has places for three or nine axes. The places behind the axes stand still; boards do not have them.

use core::array::from_fn;

use motion_kernel::axis::Guards;
use motion_kernel::program::{Header, Item, write};

use crate::machine::Machine;

/// The bytes of `items` for `machine`.
///
/// # Panics
/// The machine has no axis.
pub(super) fn bytes<'a, const N: usize>(
    machine: &Machine<N>,
    items: impl IntoIterator<Item = &'a Item<N>>,
) -> Vec<u8> {
    match machine.axis_count() {
        1 => bytes_of::<N, 1>(machine, items),
        2 => bytes_of::<N, 2>(machine, items),
        3 => bytes_of::<N, 3>(machine, items),
        4 => bytes_of::<N, 4>(machine, items),
        5 => bytes_of::<N, 5>(machine, items),
        6 => bytes_of::<N, 6>(machine, items),
        7 => bytes_of::<N, 7>(machine, items),
        8 => bytes_of::<N, 8>(machine, items),
        9 => bytes_of::<N, 9>(machine, items),
        count => panic!("{count} axes, where machines have one to nine"),
    }
}

fn bytes_of<'a, const N: usize, const M: usize>(
    machine: &Machine<N>,
    items: impl IntoIterator<Item = &'a Item<N>>,
) -> Vec<u8> {
    let items: Vec<Item<M>> = items.into_iter().map(first_axes).collect();
    let mut bytes = Vec::new();
    // Entries of nine axes fit the format.
    write(&header(&machine.header()), Some(&guards(&machine.guards())), &items, &mut bytes)
        .expect("nine axes at most");
    bytes
}

fn header<const N: usize, const M: usize>(header: &Header<N>) -> Header<M> {
    let &Header { tick_s, rules, pulse, axes, start } = header;
    Header { tick_s, rules, pulse, axes: from_fn(|axis| axes[axis]), start: from_fn(|axis| start[axis]) }
}

fn guards<const N: usize, const M: usize>(guards: &Guards<N>) -> Guards<M> {
    Guards { axes: from_fn(|axis| guards.axes[axis]), reactions: guards.reactions }
}

/// The item with the first `M` of its axes.
fn first_axes<const N: usize, const M: usize>(item: &Item<N>) -> Item<M> {
    match *item {
        Item::Line { line, start, direction, length } => Item::Line {
            line,
            start: from_fn(|axis| start[axis]),
            direction: from_fn(|axis| direction[axis]),
            length,
        },
        Item::Septic { line, start, coefficients, length } => Item::Septic {
            line,
            start: from_fn(|axis| start[axis]),
            coefficients: from_fn(|axis| coefficients[axis]),
            length,
        },
        Item::EndOfStretch(end) => Item::EndOfStretch(from_fn(|axis| end[axis])),
        Item::Feed(ramp) => Item::Feed(ramp),
        Item::Dwell(ticks) => Item::Dwell(ticks),
        Item::Stop => Item::Stop,
        Item::Switch(to) => Item::Switch(to),
        Item::Block(block) => Item::Block(block),
    }
}
