//! The least limits between two positions.
//!
//! Consumes the nodes of a stretch; every node keeps the least limits of itself and of some nodes before it;
//! their number is the lowest set bit of its place, counted from 1 (a Fenwick tree). Any range is composed of
//! a few of those; the work grows with the square of the logarithm of its length.

use super::{Interval, Intervals, Node};
use crate::law::Limits;
use crate::plan::Block;

/// No limits.
pub(super) const NONE: Limits<f64> =
    Limits { accel_mm_s2: f64::INFINITY, jerk_mm_s3: f64::INFINITY, snap_mm_s4: f64::INFINITY };

/// The node's own limits. A junction has none, nor has a block without length.
fn own(node: &Node, blocks: &[Block<f64>]) -> Limits<f64> {
    let block = blocks.get(node.block as usize).filter(|_| node.end_mm > node.start_mm);
    block.map_or(NONE, |block| block.law.limits())
}

/// Number of nodes that the one at `place`, counted from 1, stands for.
fn reach(place: usize) -> usize {
    place & place.wrapping_neg()
}

/// Gives every node the least limits of the nodes it stands for.
pub(super) fn collect(nodes: &mut [Node], blocks: &[Block<f64>]) {
    for node in nodes.iter_mut() {
        node.least = own(node, blocks);
    }
    for place in 1..=nodes.len() {
        let Some(here) = nodes.get(place - 1).map(|node| node.least) else { break };
        if let Some(above) = nodes.get_mut(place + reach(place) - 1) {
            above.least = above.least.least(&here);
        }
    }
}

impl Intervals<'_> {
    /// The least limits in an interval from `low_mm` to `high_mm`. For a single position, the limits of the
    /// block after it, or on the way back the block before it.
    pub(in crate::plan::spanning) fn least(
        &self,
        interval: &Interval,
        low_mm: f64,
        high_mm: f64,
        is_back: bool,
    ) -> Limits<f64> {
        let (first, last) = interval.nodes;
        let nodes = self.nodes.get(first..last).unwrap_or(&[]);
        let (from, to) = if is_back {
            let from = nodes.partition_point(|node| node.end_mm < low_mm);
            (from, nodes.partition_point(|node| node.start_mm < high_mm))
        } else {
            let from = nodes.partition_point(|node| node.end_mm <= low_mm);
            (from, nodes.partition_point(|node| node.start_mm <= high_mm))
        };
        let least = self.least_of(first + from, first + to);
        // If rounding leads beyond the interval's end, the limits of the whole interval hold.
        if least == NONE { self.least_of(first, last) } else { least }
    }

    /// The least limits of the nodes `first..last`.
    fn least_of(&self, first: usize, last: usize) -> Limits<f64> {
        let (mut least, mut place) = (NONE, last);
        while place > first {
            let Some(node) = self.nodes.get(place - 1) else { break };
            let all = reach(place);
            if place - first >= all {
                least = least.least(&node.least);
                place -= all;
            } else {
                least = least.least(&own(node, self.blocks));
                place -= 1;
            }
        }
        least
    }
}
