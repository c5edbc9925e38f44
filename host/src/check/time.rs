//! Where the time of a plan goes.

use std::collections::BTreeSet;

use motion_kernel::plan;

use crate::planning::{Item, PlacedRamp, Plan, Stretch};
use crate::trace::TracedProgram;

/// What holds the feed down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The program's feed.
    Programmed,
    /// The greatest feed of the machine or of an axis.
    Machine,
    /// Acceleration across a curve.
    Acceleration,
    /// Jerk across a curve.
    Jerk,
    /// Snap across a curve.
    Snap,
    /// From one feed to another.
    FeedChange,
    /// Blends, and ramps to and from rest where the path has a corner.
    Corner,
    /// Ramps to and from rest at the program's start, its end, its stops and dwells.
    Stop,
    /// Dwells.
    Dwell,
}

impl Reason {
    /// All of them, as they are listed.
    pub const ALL: [Self; 9] = [
        Self::Programmed,
        Self::Machine,
        Self::Acceleration,
        Self::Jerk,
        Self::Snap,
        Self::FeedChange,
        Self::Corner,
        Self::Stop,
        Self::Dwell,
    ];

    /// Its name for scripts.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Programmed => "programmed",
            Self::Machine => "machine",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Snap => "snap",
            Self::FeedChange => "feed change",
            Self::Corner => "corner",
            Self::Stop => "stop",
            Self::Dwell => "dwell",
        }
    }

    /// Its meaning for people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Programmed => "at the programmed feed",
            Self::Machine => "at the greatest feed of the machine or an axis",
            Self::Acceleration => "on curves, limited by acceleration",
            Self::Jerk => "on curves, limited by jerk",
            Self::Snap => "on curves, limited by snap",
            Self::FeedChange => "changing the feed",
            Self::Corner => "stopping at corners, and on blends",
            Self::Stop => "stopping where the program stops",
            Self::Dwell => "dwelling",
        }
    }
}

impl From<plan::Reason> for Reason {
    fn from(reason: plan::Reason) -> Self {
        match reason {
            plan::Reason::Programmed => Self::Programmed,
            plan::Reason::PathFeed | plan::Reason::AxisFeed => Self::Machine,
            plan::Reason::Acceleration => Self::Acceleration,
            plan::Reason::Jerk => Self::Jerk,
            plan::Reason::Snap => Self::Snap,
            plan::Reason::Braking | plan::Reason::Accelerating => Self::FeedChange,
        }
    }
}

/// The time of a plan by reason. Stops that wait for the operator have none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    by_reason_s: [f64; Reason::ALL.len()],
    /// Full stops between two moves that follow each other.
    pub corner_stops: usize,
    /// Stops for the operator.
    pub operator_stops: usize,
}

impl Times {
    /// The times of a plan. They add up to [`Plan::time_s`].
    #[must_use]
    pub fn of<const N: usize>(plan: &Plan<N>) -> Self {
        let mut times = Self::default();
        let is_stretch = |item: Option<&Item<N>>| matches!(item, Some(Item::Stretch(_)));
        // A probing move has a stop at either end whatever the path mode: before which stretches they are.
        let probe_stops: BTreeSet<u32> =
            plan.probes.iter().flat_map(|probe| [probe.stretch, probe.end()]).collect();
        let mut number = 0;
        for (index, item) in plan.items.iter().enumerate() {
            match item {
                Item::Stretch(stretch) => {
                    let follows =
                        index.checked_sub(1).is_some_and(|before| is_stretch(plan.items.get(before)));
                    let follows = follows && !probe_stops.contains(&number);
                    number += 1;
                    let is_followed = is_stretch(plan.items.get(index + 1)) && !probe_stops.contains(&number);
                    times.corner_stops += usize::from(is_followed);
                    let rest = |at_corner| if at_corner { Reason::Corner } else { Reason::Stop };
                    times.add_stretch(stretch, [rest(follows), rest(is_followed)]);
                }
                Item::Dwell { seconds, .. } => times.add(Reason::Dwell, *seconds),
                // Its wait is a dwell.
                Item::Switch { .. } => {}
                Item::Stop { .. } => times.operator_stops += 1,
            }
        }
        times
    }

    /// The time of a reason \[s\].
    #[must_use]
    pub fn of_reason_s(&self, reason: Reason) -> f64 {
        self.by_reason_s.get(reason as usize).copied().unwrap_or(0.0)
    }

    /// All of it \[s\].
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.by_reason_s.iter().sum()
    }

    fn add(&mut self, reason: Reason, time_s: f64) {
        if let Some(sum_s) = self.by_reason_s.get_mut(reason as usize) {
            *sum_s += time_s;
        }
    }

    /// `ends`: why it starts and ends at rest.
    fn add_stretch<const N: usize>(&mut self, stretch: &Stretch<N>, ends: [Reason; 2]) {
        let mut first_block = 0;
        for placed in stretch.profile.ramps() {
            let ramp = placed.planned.ramp;
            if ramp.is_cruise() {
                first_block = self.add_cruise(stretch, placed, first_block);
            } else if ramp.from_mm_s == 0.0 {
                self.add(ends[0], placed.time_s());
            } else if ramp.to_mm_s == 0.0 {
                self.add(ends[1], placed.time_s());
            } else {
                self.add(Reason::FeedChange, placed.time_s());
            }
        }
    }

    /// A cruise may pass several blocks: each has its part, in proportion to its length. Gives the block that the next
    /// ramp begins in, at the latest.
    fn add_cruise<const N: usize>(
        &mut self,
        stretch: &Stretch<N>,
        placed: &PlacedRamp,
        first_block: usize,
    ) -> usize {
        let end_mm = placed.start_mm + placed.length_mm();
        let feed_mm_s = placed.planned.ramp.from_mm_s;
        let blocks = stretch.blocks.iter().zip(stretch.ends_mm()).enumerate().skip(first_block);
        let (mut here_mm, mut last) = (placed.start_mm, (first_block, Reason::FeedChange));
        for (index, (block, &block_end_mm)) in blocks {
            if block_end_mm <= here_mm {
                continue;
            }
            // Below its ceiling a block is held down by its neighbours.
            let is_at_ceiling = feed_mm_s >= block.ceiling.feed_mm_s * (1.0 - CEILING_SHARE);
            let reason = match block.element.kind() {
                "blend" => Reason::Corner,
                _ if is_at_ceiling => block.ceiling.reason.into(),
                _ => Reason::FeedChange,
            };
            last = (index, reason);
            if block_end_mm >= end_mm {
                break;
            }
            self.add(reason, (block_end_mm - here_mm) / feed_mm_s);
            here_mm = block_end_mm;
        }
        // What rounding leaves goes to the last one.
        self.add(last.1, (end_mm - here_mm) / feed_mm_s);
        last.0
    }
}

/// A feed that is this part below a ceiling is at it: plans keep off by less.
const CEILING_SHARE: f64 = 1e-6;

/// A program for the report of its run: its text, and where the time of its plan goes.
#[must_use]
pub fn traced<const N: usize>(text: &[u8], plan: &Plan<N>) -> TracedProgram {
    let times = Times::of(plan);
    let of_reason = |reason: Reason| (reason.words(), times.of_reason_s(reason));
    TracedProgram {
        text: String::from_utf8_lossy(text).into_owned(),
        times: Reason::ALL.map(of_reason).into_iter().filter(|(_, time_s)| *time_s > 0.0).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode;
    use crate::machine::Machine;
    use crate::planning::{Mode, plan_program};

    fn times(text: &str) -> Times {
        let program = gcode::read("a.ngc", text.as_bytes()).expect("G-code");
        let plan = plan_program("a.ngc", &program, &Machine::reference(), Mode::Spanning).expect("a plan");
        let times = Times::of(&plan);
        assert!((times.total_s() - plan.time_s).abs() < 1e-9, "{} of {} s", times.total_s(), plan.time_s);
        times
    }

    /// 0.1 s and a pulse's edges take the feed from 0 to 50 mm/s and back; what remains is driven at it.
    #[test]
    fn a_line_is_driven_at_its_feed() {
        let found = times("G61 G1 X100 F3000\nG4 P0.5\nX110\nM2\n");
        assert_eq!((found.corner_stops, found.operator_stops), (0, 0));
        assert_eq!(found.of_reason_s(Reason::Dwell), 0.5);
        // Between the ramps' lengths and the whole.
        let cruise_s = found.of_reason_s(Reason::Programmed);
        assert!(cruise_s > 1.5 && cruise_s < 2.2, "{cruise_s}");
        assert!(found.of_reason_s(Reason::Stop) > 0.6, "{found:?}");
        assert_eq!(found.of_reason_s(Reason::Corner), 0.0);
    }

    #[test]
    fn corners_are_stops_of_the_path() {
        let square = "G1 X20 F3000\nY20\nX0\nY0\nM2\n";
        let exact = times(&format!("G61 {square}"));
        assert_eq!(exact.corner_stops, 3);
        // Three of four stops.
        let share = exact.of_reason_s(Reason::Corner) / exact.of_reason_s(Reason::Stop);
        assert!((share - 3.0).abs() < 1e-6, "{share}");
        let blended = times(&format!("G64 P1 {square}"));
        assert_eq!(blended.corner_stops, 0);
        assert!(blended.of_reason_s(Reason::Corner) > 0.0, "{blended:?}");
    }

    #[test]
    fn a_circle_is_limited_by_acceleration_or_jerk() {
        let found = times("G61 G2 X0 Y0 I20 F60000\nM2\n");
        let curved_s = found.of_reason_s(Reason::Acceleration) + found.of_reason_s(Reason::Jerk);
        assert!(curved_s > 0.5 * found.total_s(), "{found:?}");
        let rapid = times("G0 X2000\nM2\n");
        assert!(rapid.of_reason_s(Reason::Machine) > 0.8 * rapid.total_s(), "{rapid:?}");
    }
}
