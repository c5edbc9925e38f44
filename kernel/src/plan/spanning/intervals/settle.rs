//! Which minima stay.
//!
//! Consumes the roles of all nodes; gives up minima that the law can't reach below the steps next to them,
//! and makes new ones where there are too many steps for one ascent.

use super::{Interval, Intervals, NONE, Node, Role, Steps};

/// Share of the time of a ramp over all steps that joining them may lose; otherwise they are divided.
const DIVIDE_SHARE: f64 = 0.05;

/// A chain of minima given up one after the other: its length divided by this is the number given up before
/// looking again.
const CHAIN_LOOKED_AT: usize = 64;

/// How often all nodes may be visited to settle which minima are reached; a list that takes more has no plan.
const LOOKS_MAX: usize = 256;

impl Intervals<'_> {
    /// Gives up minima that can't be reached below the steps from the minimum before, or left for the one
    /// after; `fits` says whether an interval can be driven. Returns whether all remaining intervals can.
    pub(in crate::plan::spanning) fn settle(
        &mut self,
        mut fits: impl FnMut(&Self, &Interval) -> bool,
    ) -> bool {
        let (mut left, mut right) = (0, self.next_minimum(0));
        let mut looked_at = 0;
        // Number of minima given up since an interval could be driven.
        let mut chain = 0;
        while right != NONE {
            // Minima given up one after the other make ever longer intervals.
            looked_at += (right - left) as usize;
            if looked_at > LOOKS_MAX * self.nodes.len() || self.attention.is_wanted() {
                return false;
            }
            let interval = self.interval(left, right);
            if let Some(divide) = self.divide(&interval, left, right) {
                right = divide;
                continue;
            }
            if fits(self, &interval) {
                if let Some(node) = self.node_mut(right) {
                    node.link = left;
                }
                (left, right, chain) = (right, self.next_minimum(right), 0);
                continue;
            }
            chain += 1;
            let last = self.nodes.len() - 1;
            if interval.enter_mm_s > interval.exit_mm_s && left != 0 {
                // On the way down to the right one.
                for _ in 0..1 + chain / CHAIN_LOOKED_AT {
                    if left == 0 || self.node(left).feed_mm_s <= interval.exit_mm_s {
                        break;
                    }
                    self.give_up(left, Role::Falling, left as usize + 1..right as usize);
                    left = self.node(left).link;
                }
            } else if interval.enter_mm_s <= interval.exit_mm_s && right as usize != last {
                for _ in 0..1 + chain / CHAIN_LOOKED_AT {
                    if right as usize == last || self.node(right).feed_mm_s < interval.enter_mm_s {
                        break;
                    }
                    let peak_mm_s = self.node(right).peak_mm_s;
                    self.give_up(right, Role::Rising, left as usize + 1..right as usize);
                    if let Some(node) = self.node_mut(left) {
                        node.peak_mm_s = peak_mm_s;
                    }
                    right = self.next_minimum(right);
                }
            } else if interval.enter_mm_s > interval.exit_mm_s && right as usize != last {
                // From the start, where the minimum must be passed on the way down to a lower one: a ramp to
                // a lower feed passes a feed earlier than one that ends at it.
                let next = self.next_minimum(right);
                if self.node(next).feed_mm_s > interval.exit_mm_s {
                    return false;
                }
                self.give_up(right, Role::Falling, right as usize + 1..next as usize);
                right = next;
            } else {
                return false;
            }
        }
        true
    }

    /// Rests in the middle of too many steps for one ascent; returns the new minimum.
    fn divide(&mut self, interval: &Interval, left: u32, right: u32) -> Option<u32> {
        let is_long = |steps: &Steps| {
            let (low, high) = steps.range_mm_s();
            let law = self.law(left + 1);
            steps.lost_s > law.map_or(f64::INFINITY, |law| DIVIDE_SHARE * law.ramp_time_s(high - low))
        };
        let role = match (is_long(&interval.rising), is_long(&interval.falling)) {
            (true, _) => Role::Rising,
            (_, true) => Role::Falling,
            _ => return None,
        };
        let inside = left as usize + 1..right as usize;
        // If a dividing step was given up, there is no better one.
        if self.nodes.get(inside.clone())?.iter().any(|node| node.divides.is_some()) {
            return None;
        }
        let steps =
            || inside.clone().filter(|&index| self.nodes.get(index).is_some_and(|node| node.role == role));
        let middle = steps().nth(steps().count() / 2)? as u32;
        let (feed_mm_s, peak_mm_s) = (self.node(middle).feed_mm_s, self.node(left).peak_mm_s);
        let node = self.node_mut(middle)?;
        (node.role, node.divides) = (Role::Minimum, Some(role));
        // The steps towards the foot stay below the middle.
        if role == Role::Rising {
            node.peak_mm_s = peak_mm_s;
            self.node_mut(left)?.peak_mm_s = feed_mm_s;
        } else {
            node.peak_mm_s = feed_mm_s;
        }
        Some(middle)
    }

    /// Makes a minimum a step. On the side where it is passed, ceilings not below its feed no longer limit,
    /// up to the next lower step; beyond that there are only lower ones.
    fn give_up(&mut self, minimum: u32, role: Role, passed: core::ops::Range<usize>) {
        let feed_mm_s = self.node(minimum).feed_mm_s;
        if let Some(node) = self.node_mut(minimum) {
            node.role = role;
        }
        let nodes = self.nodes.get_mut(passed).unwrap_or(&mut []);
        let free = |node: &mut Node| {
            let is_lower = node.role == role && node.feed_mm_s < feed_mm_s;
            if !is_lower {
                node.role = Role::Free;
            }
            is_lower
        };
        match role {
            Role::Rising => nodes.iter_mut().rev().any(free),
            _ => nodes.iter_mut().any(free),
        };
    }
}
