//! Which valleys stay.
//!
//! Consumes the roles of all nodes; gives up valleys that the law does not reach below the stairs beside them, and makes
//! new ones in staircases that are too long to be climbed at once.

use super::{Hump, NONE, Node, Role, Stairs, Valleys};

/// Joining stairs may lose so much of the time of a ramp over all of them; otherwise the staircase is divided.
const DIVIDE_SHARE: f64 = 0.05;

/// Of a chain of valleys given up one after the other as many are given up before looking again as it is long, over this.
const CHAIN_LOOKED_AT: usize = 64;

/// How often all nodes may be looked at to settle which valleys are reached; a list that takes more has no plan.
const LOOKS_MAX: usize = 256;

impl Valleys<'_> {
    /// Gives up valleys that cannot be reached below the stairs from the one before, or left for the one after;
    /// `fits` says whether a hump can be driven. Returns whether all humps that are left can.
    pub fn settle(&mut self, mut fits: impl FnMut(&Self, &Hump) -> bool) -> bool {
        let (mut left, mut right) = (0, self.next_valley(0));
        let mut looked_at = 0;
        // Valleys given up since a hump could be driven.
        let mut chain = 0;
        while right != NONE {
            // Valleys that are given up one after the other make ever longer humps.
            looked_at += (right - left) as usize;
            if looked_at > LOOKS_MAX * self.nodes.len() {
                return false;
            }
            let hump = self.hump(left, right);
            if let Some(divide) = self.divide(&hump, left, right) {
                right = divide;
                continue;
            }
            if fits(self, &hump) {
                if let Some(node) = self.node_mut(right) {
                    node.link = left;
                }
                (left, right, chain) = (right, self.next_valley(right), 0);
                continue;
            }
            chain += 1;
            let last = self.nodes.len() - 1;
            if hump.enter_mm_s > hump.exit_mm_s && left != 0 {
                // On the way down to the right one.
                for _ in 0..1 + chain / CHAIN_LOOKED_AT {
                    if left == 0 || self.node(left).feed_mm_s <= hump.exit_mm_s {
                        break;
                    }
                    self.give_up(left, Role::Falling, left as usize + 1..right as usize);
                    left = self.node(left).link;
                }
            } else if hump.enter_mm_s <= hump.exit_mm_s && right as usize != last {
                for _ in 0..1 + chain / CHAIN_LOOKED_AT {
                    if right as usize == last || self.node(right).feed_mm_s < hump.enter_mm_s {
                        break;
                    }
                    let top_mm_s = self.node(right).top_mm_s;
                    self.give_up(right, Role::Rising, left as usize + 1..right as usize);
                    if let Some(node) = self.node_mut(left) {
                        node.top_mm_s = top_mm_s;
                    }
                    right = self.next_valley(right);
                }
            } else if hump.enter_mm_s > hump.exit_mm_s && right as usize != last {
                // From the start, where the valley must be passed on the way down to a lower one: a ramp to a lower feed
                // passes a feed earlier than one that ends at it.
                let next = self.next_valley(right);
                if self.node(next).feed_mm_s > hump.exit_mm_s {
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

    /// Rests in the middle of a staircase that is too long to be climbed at once; returns the new valley.
    fn divide(&mut self, hump: &Hump, left: u32, right: u32) -> Option<u32> {
        let is_long = |stairs: &Stairs| {
            let (low, high) = stairs.range_mm_s();
            let law = self.law(left + 1);
            stairs.lost_s > law.map_or(f64::INFINITY, |law| DIVIDE_SHARE * law.ramp_time_s(high - low))
        };
        let role = match (is_long(&hump.rising), is_long(&hump.falling)) {
            (true, _) => Role::Rising,
            (_, true) => Role::Falling,
            _ => return None,
        };
        let inside = left as usize + 1..right as usize;
        // Where a dividing stair was given up there is no better one.
        if self.nodes.get(inside.clone())?.iter().any(|node| node.divides.is_some()) {
            return None;
        }
        let steps =
            || inside.clone().filter(|&index| self.nodes.get(index).is_some_and(|node| node.role == role));
        let middle = steps().nth(steps().count() / 2)? as u32;
        let (feed_mm_s, top_mm_s) = (self.node(middle).feed_mm_s, self.node(left).top_mm_s);
        let node = self.node_mut(middle)?;
        (node.role, node.divides) = (Role::Valley, Some(role));
        // What lies towards the foot of the staircase stays below its middle.
        if role == Role::Rising {
            node.top_mm_s = top_mm_s;
            self.node_mut(left)?.top_mm_s = feed_mm_s;
        } else {
            node.top_mm_s = feed_mm_s;
        }
        Some(middle)
    }

    /// Makes a stair of a valley; what lies on the side where it is passed at its feed or below limits no more, up to the
    /// next lower stair: beyond that there are only lower ones.
    fn give_up(&mut self, valley: u32, role: Role, passed: core::ops::Range<usize>) {
        let feed_mm_s = self.node(valley).feed_mm_s;
        if let Some(node) = self.node_mut(valley) {
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
