//! The intervals of a stretch, from one minimum of its ceilings to the next.
//!
//! Consumes the ceilings of a stretch; divides it into **intervals**: from one minimum to the next the feed
//! rises, holds and falls again, once. A minimum is a ceiling that the feed should come down to from both
//! sides. All other ceilings are steps on the way up or down, the peak of their interval, or too high to
//! matter.
//!
//! The ceilings are visited from the lowest up, in the tree of their minima. Higher ceilings next to a step
//! need not be visited any more, so the work is proportional to the number of ceilings.
//!
//! - `least`: the least limits between two positions;
//! - `settle`: which minima can be reached, and which are given up.

mod least;
mod settle;

use super::ascent::{Step, Steps};
use crate::law::{Law, Limits, Pulse, Ramp, peak};
use crate::plan::{Attention, Block};

/// No node.
const NONE: u32 = u32::MAX;

/// The role of a ceiling in the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Role {
    /// It limits nothing.
    #[default]
    Free,
    /// Held up to its end, on the way up.
    Rising,
    /// Held from its start, on the way down.
    Falling,
    /// The feed comes down to it and rests in it, or starts or ends there.
    Minimum,
}

/// A ceiling: of a block, of several equal ones, or of a junction. Working memory of the planner.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    start_mm: f64,
    end_mm: f64,
    feed_mm_s: f64,
    /// The time from the stretch's start to this node's end, if everything is driven at its ceiling \[s\].
    ideal_s: f64,
    /// The block that its law is from.
    block: u32,
    /// The least limits of some nodes up to this one: see `least`.
    least: Limits<f64>,
    /// The lowest of the ceilings to its left and to its right that are not below it.
    left: u32,
    right: u32,
    /// In turn: the next lower node to the left; the next waiting minimum; the minimum before it.
    link: u32,
    /// For a waiting minimum: how far its right side reaches.
    bounds: (u32, u32),
    /// For a minimum: the ceiling of the interval after it \[mm/s\].
    peak_mm_s: f64,
    role: Role,
    /// The role it had before it became a minimum to divide a long series of steps.
    divides: Option<Role>,
}

impl Node {
    /// Unused memory.
    pub const EMPTY: Self = Self {
        start_mm: 0.0,
        end_mm: 0.0,
        feed_mm_s: 0.0,
        ideal_s: 0.0,
        block: 0,
        least: least::NONE,
        left: NONE,
        right: NONE,
        link: NONE,
        bounds: (NONE, NONE),
        peak_mm_s: f64::INFINITY,
        role: Role::Free,
        divides: None,
    };
}

/// The part of a stretch between two minima.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    /// Where it starts \[mm\].
    pub(super) start_mm: f64,
    /// Where it ends \[mm\].
    pub(super) end_mm: f64,
    /// The feed at its start \[mm/s\].
    pub(super) enter_mm_s: f64,
    /// The feed at its end \[mm/s\].
    pub(super) exit_mm_s: f64,
    /// Its ceiling \[mm/s\], as far as it is known.
    pub(super) peak_mm_s: f64,
    /// Steps on the way up, from its start.
    pub(super) rising: Steps,
    /// Steps on the way down, from its end.
    pub(super) falling: Steps,
    /// The range of nodes inside.
    nodes: (usize, usize),
}

/// The ceilings of a stretch and their roles found so far.
pub(super) struct Intervals<'a> {
    blocks: &'a [Block<f64>],
    nodes: &'a mut [Node],
    /// Greatest acceleration of any block.
    accel_mm_s2: f64,
    pulse: Pulse,
    /// What all of it is given up for.
    pub(super) attention: &'a Attention<'a>,
}

/// A part of the stretch still to be visited: the minima it lies between, and the nodes next to its rest.
#[derive(Clone, Copy)]
struct Open {
    left_minimum: u32,
    left_bound: u32,
    right_minimum: u32,
    right_bound: u32,
    /// The lowest remaining ceiling.
    root: u32,
}

/// The effect of a ceiling on its interval.
enum Class {
    /// It is not reached from the left.
    BelowLeft,
    /// It is not reached from the right.
    BelowRight,
    /// The feed holds there.
    Top,
    /// It limits the feed in this role: it is passed, or rested in.
    Limits(Role),
}

/// The gap between two ceilings.
struct Gap {
    length_mm: f64,
    /// The time if everything is driven at its ceiling \[s\].
    ideal_s: f64,
}

impl<'a> Intervals<'a> {
    /// Makes the nodes. `None` if there are too few places. Where it is given up, not all have their roles.
    pub(super) fn new(
        blocks: &'a [Block<f64>],
        start_mm_s: f64,
        end_mm_s: f64,
        places: &'a mut [Node],
        attention: &'a Attention<'a>,
    ) -> Option<Self> {
        let mut count = 0;
        let mut put = |node: Node| -> Option<()> {
            *places.get_mut(count)? = node;
            count += 1;
            Some(())
        };
        put(Node { feed_mm_s: start_mm_s, ..Node::EMPTY })?;
        let (mut at_mm, mut accel_mm_s2) = (0.0, 0.0_f64);
        let mut pulse = Pulse::Plateau;
        let mut open: Option<Node> = None;
        for (index, block) in blocks.iter().enumerate() {
            accel_mm_s2 = accel_mm_s2.max(block.law.limits().accel_mm_s2);
            if block.law.pulse() == Pulse::Sin2 {
                pulse = Pulse::Sin2;
            }
            let end_mm = at_mm + block.length_mm;
            let next_mm_s = blocks.get(index + 1).map_or(f64::INFINITY, |next| next.cap_mm_s);
            let is_junction = index + 1 < blocks.len() && block.junction_mm_s < block.cap_mm_s.min(next_mm_s);
            match &mut open {
                Some(last)
                    if last.feed_mm_s == block.cap_mm_s
                        && blocks.get(last.block as usize).is_some_and(|before| before.law == block.law) =>
                {
                    last.end_mm = end_mm;
                }
                _ => {
                    if let Some(last) = open.take() {
                        put(last)?;
                    }
                    let (feed_mm_s, block) = (block.cap_mm_s, index as u32);
                    open = Some(Node { start_mm: at_mm, end_mm, feed_mm_s, block, ..Node::EMPTY });
                }
            }
            if is_junction {
                if let Some(last) = open.take() {
                    put(last)?;
                }
                put(Node {
                    start_mm: end_mm,
                    end_mm,
                    feed_mm_s: block.junction_mm_s,
                    block: index as u32,
                    ..Node::EMPTY
                })?;
            }
            at_mm = end_mm;
        }
        if let Some(last) = open {
            put(last)?;
        }
        put(Node { start_mm: at_mm, end_mm: at_mm, feed_mm_s: end_mm_s, ..Node::EMPTY })?;
        let nodes = places.get_mut(..count)?;
        let mut ideal_s = 0.0;
        for node in nodes.iter_mut() {
            if node.end_mm > node.start_mm {
                ideal_s += (node.end_mm - node.start_mm) / node.feed_mm_s;
            }
            node.ideal_s = ideal_s;
        }
        least::collect(nodes, blocks);
        let root = tree(nodes);
        let last = (count - 1) as u32;
        let mut intervals = Self { blocks, nodes, accel_mm_s2, pulse, attention };
        intervals.find(Open { left_minimum: 0, left_bound: 0, right_minimum: last, right_bound: last, root });
        Some(intervals)
    }

    fn node(&self, index: u32) -> Node {
        self.nodes.get(index as usize).copied().unwrap_or(Node::EMPTY)
    }

    fn node_mut(&mut self, index: u32) -> Option<&mut Node> {
        self.nodes.get_mut(index as usize)
    }

    fn law(&self, index: u32) -> Option<Law<f64>> {
        self.blocks.get(self.node(index).block as usize).map(|block| block.law)
    }

    /// Gives every node its role.
    fn find(&mut self, all: Open) {
        for sentinel in [all.left_minimum, all.right_minimum] {
            if let Some(node) = self.node_mut(sentinel) {
                node.role = Role::Minimum;
            }
        }
        // Minima whose right side waits, linked, last one first.
        let (mut open, mut waiting) = (all, NONE);
        loop {
            let mut peak_mm_s = f64::INFINITY;
            while open.root != NONE {
                if self.attention.is_wanted() {
                    return;
                }
                let root = self.node(open.root);
                let role = match self.classify(&open, &root) {
                    Class::BelowLeft => {
                        open.root = root.right;
                        continue;
                    }
                    Class::BelowRight => {
                        open.root = root.left;
                        continue;
                    }
                    Class::Top => {
                        peak_mm_s = root.feed_mm_s;
                        break;
                    }
                    Class::Limits(role) => role,
                };
                let here = open.root;
                if let Some(node) = self.node_mut(here) {
                    node.role = role;
                }
                match role {
                    Role::Rising => (open.left_bound, open.root) = (here, root.right),
                    Role::Falling => (open.right_bound, open.root) = (here, root.left),
                    Role::Minimum | Role::Free => {
                        if let Some(node) = self.node_mut(here) {
                            node.bounds = (open.right_minimum, open.right_bound);
                            node.link = waiting;
                        }
                        waiting = here;
                        (open.right_minimum, open.right_bound, open.root) = (here, here, root.left);
                    }
                }
            }
            if let Some(node) = self.node_mut(open.left_minimum) {
                node.peak_mm_s = peak_mm_s;
            }
            if open.right_minimum != waiting || waiting == NONE {
                return;
            }
            let minimum = self.node(waiting);
            open = Open {
                left_minimum: waiting,
                left_bound: waiting,
                right_minimum: minimum.bounds.0,
                right_bound: minimum.bounds.1,
                root: minimum.right,
            };
            waiting = minimum.link;
        }
    }

    /// The class of the lowest remaining ceiling.
    fn classify(&self, open: &Open, root: &Node) -> Class {
        let (left, right) = (self.node(open.left_bound), self.node(open.right_bound));
        let squared = |feed: f64, length_mm: f64| feed * feed + 2.0 * self.accel_mm_s2 * length_mm;
        let ceiling = root.feed_mm_s * root.feed_mm_s;
        // Even with acceleration alone, neither it nor anything before it is reached.
        if squared(left.feed_mm_s, root.end_mm - left.end_mm) <= ceiling {
            return Class::BelowLeft;
        }
        if squared(right.feed_mm_s, right.start_mm - root.start_mm) <= ceiling {
            return Class::BelowRight;
        }
        let (before, after) = (self.gap(&left, root), self.gap(root, &right));
        // The gain is counted from the minimum itself, too: a step before this one may not be reached.
        let (first, last) = (self.node(open.left_minimum), self.node(open.right_minimum));
        let all_before = (first.feed_mm_s, root.start_mm - first.end_mm);
        let all_after = (last.feed_mm_s, last.start_mm - root.end_mm);
        let can_rise = root.feed_mm_s >= left.feed_mm_s;
        let can_fall = root.feed_mm_s >= right.feed_mm_s;
        let lost_left = self.lost(root, &left, &before, all_before, root.left, can_rise);
        let lost_right = self.lost(root, &right, &after, all_after, root.right, can_fall);
        // Nothing is lost by it, so the cost of resting in it does not matter.
        let rises = can_rise
            && (lost_left <= 0.0
                || lost_left <= self.broken(root, &left, &before, &right, &after, root.right));
        let falls = can_fall
            && (lost_right <= 0.0
                || lost_right <= self.broken(root, &right, &after, &left, &before, root.left));
        match (rises, falls) {
            (true, true) if lost_left <= 0.0 && lost_right <= 0.0 => Class::Top,
            (true, true) if lost_left <= lost_right => Class::Limits(Role::Rising),
            (true, false) => Class::Limits(Role::Rising),
            (_, true) => Class::Limits(Role::Falling),
            (false, false) => Class::Limits(Role::Minimum),
        }
    }

    /// The minimum after one, [`NONE`] after the last.
    fn next_minimum(&self, minimum: u32) -> u32 {
        let after = minimum as usize + 1;
        let found = self.nodes.iter().skip(after).position(|node| node.role == Role::Minimum);
        found.map_or(NONE, |steps| (after + steps) as u32)
    }

    /// The intervals, in path order.
    pub(super) fn in_order(&self) -> impl Iterator<Item = Interval> + '_ {
        let mut left = 0;
        core::iter::from_fn(move || {
            let right = self.next_minimum(left);
            if right == NONE {
                return None;
            }
            let interval = self.interval(left, right);
            left = right;
            Some(interval)
        })
    }

    /// The interval between two minima.
    fn interval(&self, left: u32, right: u32) -> Interval {
        let (first, last) = (left as usize, right as usize);
        let (left, right) = (self.node(left), self.node(right));
        // A step that divides a series is rested in only at its far end, and belongs to the interval before
        // it.
        let is_step = |node: &Node, role: Role| node.divides == Some(role);
        let inside = first + usize::from(!is_step(&left, Role::Falling))
            ..last + usize::from(is_step(&right, Role::Rising));
        let start_mm = if is_step(&left, Role::Falling) { left.start_mm } else { left.end_mm };
        let end_mm = if is_step(&right, Role::Rising) { right.end_mm } else { right.start_mm };
        let nodes = self.nodes.get(inside.clone()).unwrap_or(&[]);
        crate::work::add(nodes.len());
        let (mut rising, mut falling) = (Steps::NONE, Steps::NONE);
        for node in nodes.iter().filter(|node| node.role == Role::Rising) {
            rising.push(Step { end_mm: node.end_mm - start_mm, feed_mm_s: node.feed_mm_s });
        }
        for node in nodes.iter().rev().filter(|node| node.role == Role::Falling) {
            falling.push(Step { end_mm: end_mm - node.start_mm, feed_mm_s: node.feed_mm_s });
        }
        Interval {
            start_mm,
            end_mm,
            enter_mm_s: left.feed_mm_s,
            exit_mm_s: right.feed_mm_s,
            peak_mm_s: left.peak_mm_s,
            rising,
            falling,
            nodes: (inside.start, inside.end),
        }
    }

    /// The gap between two nodes.
    fn gap(&self, left: &Node, right: &Node) -> Gap {
        let length_mm = right.start_mm - left.end_mm;
        let own_s = if right.end_mm > right.start_mm {
            (right.end_mm - right.start_mm) / right.feed_mm_s
        } else {
            0.0
        };
        Gap { length_mm, ideal_s: right.ideal_s - own_s - left.ideal_s }
    }

    /// Greatest time lost by not rising above `root` in the gap between it and `bound` \[s\]. Infinite if
    /// `bound` is above the root.
    fn lost(
        &self,
        root: &Node,
        bound: &Node,
        gap: &Gap,
        (minimum_mm_s, minimum_mm): (f64, f64),
        between: u32,
        is_below: bool,
    ) -> f64 {
        if !is_below || self.attention.is_wanted() {
            return f64::INFINITY;
        }
        let Some(law) = self.law(between).filter(|_| between != NONE) else { return 0.0 };
        let feed = root.feed_mm_s;
        let left_mm = (gap.length_mm - law.ramp_length_mm(bound.feed_mm_s, feed))
            .min(minimum_mm - law.ramp_length_mm(minimum_mm_s, feed));
        if left_mm <= 0.0 {
            return 0.0;
        }
        let peak = peak(&law, feed, feed, left_mm);
        let time_s =
            2.0 * law.ramp_time_s(peak - feed) + (left_mm - 2.0 * law.ramp_length_mm(feed, peak)) / peak;
        (left_mm / feed - time_s).min(gap.length_mm / feed - gap.ideal_s)
    }

    /// Approximate time lost \[s\] by resting in `root` on the way from `bound` over `gap` and further, over
    /// `beyond`, towards `other`.
    fn broken(&self, root: &Node, bound: &Node, gap: &Gap, other: &Node, beyond: &Gap, next: u32) -> f64 {
        if self.attention.is_wanted() {
            return 0.0;
        }
        let Some(law) = self.law(next).filter(|_| next != NONE) else { return 0.0 };
        let feed = root.feed_mm_s;
        let mean_mm_s = beyond.length_mm / beyond.ideal_s;
        if !(mean_mm_s > feed) {
            return 0.0;
        }
        // The highest peak that there is room for, or the mean of the ceilings if that is lower.
        let is_reached = mean_mm_s > other.feed_mm_s
            && law.ramp_length_mm(feed, mean_mm_s) + law.ramp_length_mm(other.feed_mm_s, mean_mm_s)
                < beyond.length_mm;
        let peak = if is_reached {
            mean_mm_s
        } else {
            peak(&law, feed, other.feed_mm_s, beyond.length_mm).min(mean_mm_s)
        };
        // The times below take a while.
        if !(peak > feed) || self.attention.is_wanted() {
            return 0.0;
        }
        let lag_s = |from: f64, to: f64| law.ramp_time_s(to - from) - law.ramp_length_mm(from, to) / peak;
        let rested = lag_s(bound.feed_mm_s, feed) + lag_s(feed, peak);
        if self.attention.is_wanted() {
            return 0.0;
        }
        let ramp = Ramp::new(&law, bound.feed_mm_s, peak);
        let waited_mm = (root.end_mm - root.start_mm) + gap.length_mm - ramp.length_to_feed_mm(feed);
        let waited_s = match (waited_mm > 0.0, bound.feed_mm_s > 0.0) {
            (false, _) => 0.0,
            (true, true) => waited_mm * (1.0 / bound.feed_mm_s - 1.0 / peak),
            (true, false) => f64::INFINITY,
        };
        (rested - lag_s(bound.feed_mm_s, peak) - waited_s).max(0.0)
    }

    /// The shape of the pulses: sin² if any block is to have it, which keeps the limits of all.
    pub(super) fn pulse(&self) -> Pulse {
        self.pulse
    }

    /// The laws of the blocks of an interval.
    pub(super) fn laws_of(&self, interval: &Interval) -> impl Iterator<Item = Law<f64>> {
        let nodes = self.nodes.get(interval.nodes.0..interval.nodes.1).unwrap_or(&[]);
        let blocks = self.blocks;
        nodes
            .iter()
            .filter(|node| node.end_mm > node.start_mm)
            .filter_map(move |node| Some(blocks.get(node.block as usize)?.law))
    }
}

/// Links every node, except the first and the last, to the lowest nodes on either side of it; returns the
/// lowest of all.
fn tree(nodes: &mut [Node]) -> u32 {
    let last = nodes.len().saturating_sub(1);
    let mut root = NONE;
    let mut before = NONE;
    for index in 1..last {
        let Some(feed) = nodes.get(index).map(|node| node.feed_mm_s) else { break };
        let (mut at, mut below) = (before, NONE);
        while let Some(node) = nodes.get(at as usize).filter(|node| node.feed_mm_s > feed) {
            (below, at) = (at, node.link);
        }
        let here = index as u32;
        if let Some(node) = nodes.get_mut(index) {
            (node.left, node.link) = (below, at);
        }
        if let Some(node) = nodes.get_mut(below as usize) {
            node.link = here;
        }
        match nodes.get_mut(at as usize) {
            Some(node) => node.right = here,
            None => root = here,
        }
        before = here;
    }
    root
}
