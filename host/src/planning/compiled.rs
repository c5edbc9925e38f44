//! A program as bytes for a board, with the axes of its machine and no others.
//!
//! Planning has places for three or nine axes. The places behind the axes stand still; boards do not have them.

use core::array::from_fn;

use motion_kernel::axis::{Compensation, Guards};
use motion_kernel::homing::HomingFigures;
use motion_kernel::program::{Header, Item, write_compensated};

use crate::machine::Machine;
use crate::simulate::session::homing_figures;

/// Evaluates an expression with a count of axes as a constant. Of a machine with `N` places, for the counts that have so many
/// ([`AnyMachine`](crate::machine::AnyMachine)): others are not compiled.
macro_rules! on_axis_count {
    (@arms $count:expr, $name:ident => $result:expr; $($number:literal if $has_places:expr),*) => {
        match $count {
            $($number if const { $has_places } => {
                const $name: usize = $number;
                $result
            })*
            count => panic!("{count} axes, where machines have one to nine, in the fewest places that hold them"),
        }
    };
    ($count:expr, in $places:ident, $name:ident => $result:expr) => {
        $crate::planning::on_axis_count!(@arms $count, $name => $result;
            1 if $places == 3, 2 if $places == 3, 3 if $places == 3, 4 if $places == 9, 5 if $places == 9,
            6 if $places == 9, 7 if $places == 9, 8 if $places == 9, 9 if $places == 9)
    };
    ($count:expr, $name:ident => $result:expr) => {
        $crate::planning::on_axis_count!(@arms $count, $name => $result;
            1 if true, 2 if true, 3 if true, 4 if true, 5 if true, 6 if true, 7 if true, 8 if true, 9 if true)
    };
}

pub(crate) use on_axis_count;

/// The bytes of `items` for `machine`.
///
/// # Panics
/// The machine has no axis.
pub(super) fn bytes<'a, const N: usize>(
    machine: &Machine<N>,
    items: impl IntoIterator<Item = &'a Item<N>>,
) -> Vec<u8> {
    on_axis_count!(machine.axis_count(), in N, M => bytes_of::<N, M>(machine, items))
}

/// The bytes of `items` for the first `M` axes of `machine`, as many as it has.
pub(crate) fn bytes_of<'a, const N: usize, const M: usize>(
    machine: &Machine<N>,
    items: impl IntoIterator<Item = &'a Item<N>>,
) -> Vec<u8> {
    let items: Vec<Item<M>> = items.into_iter().map(first_axes).collect();
    let mut bytes = Vec::new();
    // Entries of nine axes fit the format.
    let (header, guards) = (header_of_axes(&machine.header()), guards_of_axes(&machine.guards()));
    let (homing, compensation) = (homing_of_axes(machine), compensation_of_axes(&machine.compensation()));
    write_compensated(&header, &guards, &homing, &compensation, &items, &mut bytes)
        .expect("nine axes at most");
    bytes
}

/// The header with the first `M` axes.
pub(crate) fn header_of_axes<const N: usize, const M: usize>(header: &Header<N>) -> Header<M> {
    let &Header { tick_s, rules, pulse, axes, start } = header;
    Header { tick_s, rules, pulse, axes: from_fn(|axis| axes[axis]), start: from_fn(|axis| start[axis]) }
}

fn guards_of_axes<const N: usize, const M: usize>(guards: &Guards<N>) -> Guards<M> {
    Guards { axes: from_fn(|axis| guards.axes[axis]), reactions: guards.reactions }
}

fn compensation_of_axes<const N: usize, const M: usize>(compensation: &Compensation<N>) -> Compensation<M> {
    Compensation { axes: from_fn(|axis| compensation.axes[axis]) }
}

/// How the first `M` axes are homed.
fn homing_of_axes<const N: usize, const M: usize>(machine: &Machine<N>) -> HomingFigures<M> {
    HomingFigures { axes: from_fn(|axis| homing_figures(machine, axis)) }
}

/// The item with the first `M` of its axes.
pub(crate) fn first_axes<const N: usize, const M: usize>(item: &Item<N>) -> Item<M> {
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
