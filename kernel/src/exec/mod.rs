//! The tick's first half: from the two streams to set-points.
//!
//! Consumes feed segments and pieces; produces the motion along the path and a [`Setpoint`] for every axis,
//! each tick. Everything ends at its exact time inside a tick: the rest of the tick is spent on the next
//! item, so a program's duration equals its plan's to the tick. Every stretch ends exactly at its end point,
//! at rest.
//!
//! Bound: `STEPS_PER_TICK_MAX` phase changes, [`PIECES_PER_TICK_MAX`]
//! pieces; no solver, no division. Fails by [`ExecFault`] only.
//!
//! ```
//! use motion_kernel::exec::{ExecState, Executor};
//! use motion_kernel::law::Limits;
//! use motion_kernel::queue::{PathRules, Streams};
//! use motion_kernel::units::Position;
//!
//! # let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 1e4, snap_mm_s4: 1e6 };
//! # let rules = PathRules { limits, feed_mm_s: 50.0, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 };
//! let mut streams = Streams::<f32, 1, 18, 10>::new();
//! let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
//! feeder.program_stop().expect("room in empty streams");
//!
//! let mut executor = Executor::new([Position::ZERO]);
//! let state = executor.tick(&mut intake).expect("no fault").state;
//! assert_eq!(state, ExecState::Stopped);
//! executor.resume();
//! assert_eq!(executor.tick(&mut intake).expect("no fault").state, ExecState::Idle);
//! ```

mod motion;
mod walk;

use serde::{Deserialize, Serialize};

use crate::law::{PathMotion, Ticks};
use crate::num::Real;
use crate::path::Setpoint;
use crate::queue::{FeedItem, Intake, SEGMENTS_PER_TICK_MAX};
use crate::units::Position;
use motion::Moving;
use walk::{WalkError, Walker};

pub use walk::PIECES_PER_TICK_MAX;

/// Greatest number of steps of the executor within one tick. A segment takes up to three for its phases, and
/// one more to begin if it is the first of a stretch or was late. This holds for the segments that end in the
/// tick and for the one that begins in it. A dwell takes two.
pub(crate) const STEPS_PER_TICK_MAX: usize = 4 * (SEGMENTS_PER_TICK_MAX + 1) + 1;

/// The executor's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ExecState {
    /// At rest, nothing to do.
    Idle,
    /// Moving along the path.
    Moving,
    /// At rest for a programmed time.
    Dwell,
    /// At rest until told to resume.
    Stopped,
    /// At rest inside a stretch: held, or out of data.
    Held,
}

/// Why the executor can't continue. Latched by the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub enum ExecFault {
    /// The next feed segment was needed and had not arrived.
    FeedStarved,
    /// The next piece of path was needed and had not arrived.
    PathStarved,
    /// More pieces ended within one tick than the bound.
    TooManyPieces,
    /// More segments ended within one tick than the bound.
    TooManySegments,
    /// A stretch does not start where the machine stands.
    NotHere,
}

/// The result of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound(deserialize = "R: Copy + Deserialize<'de>"))]
pub struct Executed<R, const AXES: usize> {
    /// The executor's state at the end of the tick.
    pub state: ExecState,
    /// The motion along the path; `s` counts from the stretch's start, 0 at rest between stretches.
    pub motion: PathMotion<R>,
    /// Number of stretches finished since the start.
    pub stretches: u32,
    /// Program line of the current piece; 0 at rest.
    pub line: u32,
    /// Set-points of all axes.
    #[serde(with = "crate::array")]
    pub setpoints: [Setpoint<R>; AXES],
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Activity<R> {
    /// Between stretches.
    Rest,
    Dwell {
        left: Ticks,
    },
    Stopped,
    /// Inside a stretch, in the segment at the head of the feed stream.
    Moving(Moving),
    /// Inside a stretch, between two segments.
    Between {
        s: Position,
        v_mm_s: R,
    },
}

/// Executes the streams, tick by tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Executor<R: Real, const AXES: usize> {
    activity: Activity<R>,
    walker: Walker<AXES>,
    stretches: u32,
}

impl<R: Real, const AXES: usize> Executor<R, AXES> {
    /// An executor at rest at `position`.
    #[must_use]
    pub fn new(position: [Position; AXES]) -> Self {
        Self { activity: Activity::Rest, walker: Walker::new(position), stretches: 0 }
    }

    /// The outcome of a tick at rest here.
    pub(crate) fn resting(&self) -> Executed<R, AXES> {
        let mut executed = Executed {
            state: self.state(),
            motion: PathMotion::default(),
            stretches: self.stretches,
            line: 0,
            setpoints: [Setpoint::default(); AXES],
        };
        self.walker.rest(&mut executed.setpoints);
        executed
    }

    /// Whether no stretch is under way: at rest between stretches, dwelling or stopped.
    pub(crate) fn is_at_rest(&self) -> bool {
        !matches!(self.activity, Activity::Moving(_) | Activity::Between { .. })
    }

    /// Ends a program stop. Without effect in any other state.
    pub fn resume(&mut self) {
        if matches!(self.activity, Activity::Stopped) {
            self.activity = Activity::Rest;
        }
    }

    /// One control tick.
    ///
    /// # Errors
    /// The streams ran dry inside a stretch, or held more than the tick's bound. The executor's state is then
    /// invalid; the kernel latches the fault.
    pub fn tick(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<Executed<R, AXES>, ExecFault> {
        let mut executed = self.resting();
        self.tick_into(intake, &mut executed)?;
        Ok(executed)
    }

    /// [`Executor::tick`] into `executed`, which holds the set-points of the tick before.
    #[inline]
    pub(crate) fn tick_into(
        &mut self,
        intake: &mut Intake<'_, R, AXES>,
        executed: &mut Executed<R, AXES>,
    ) -> Result<(), ExecFault> {
        self.walker.start_tick();
        intake.start_tick();
        if intake.is_change_due() {
            self.change_over(intake);
        }
        match self.advance(intake)? {
            Some(motion) => {
                // In this order: if the path has run dry, motion and set-points stay those of the tick
                // before.
                executed.line =
                    self.walker.follow(&motion, intake, &mut executed.setpoints).map_err(walk_fault)?;
                executed.motion = motion;
            }
            None => {
                (executed.motion, executed.line) = (PathMotion::default(), 0);
                self.walker.rest(&mut executed.setpoints);
            }
        }
        executed.state = self.state();
        executed.stretches = self.stretches;
        intake.publish(
            match &self.activity {
                Activity::Moving(moving) => Some(moving.inside()),
                _ => None,
            },
            matches!(self.activity, Activity::Dwell { .. } | Activity::Stopped),
        );
        Ok(())
    }

    /// Changes to the feed list asked for: between two items, or within one that the new list repeats.
    /// Refuses a change that is too late.
    #[cold]
    fn change_over(&mut self, intake: &mut Intake<'_, R, AXES>) {
        let carried = match (&self.activity, intake.feed(), intake.feed_after_change()) {
            (Activity::Moving(moving), Some(FeedItem::Segment(before)), Some(FeedItem::Segment(segment))) => {
                moving.carried_over(before, segment)
            }
            (Activity::Moving(_), _, _) => None,
            _ if intake.takes_over_between_items() => return intake.take_over(),
            _ => None,
        };
        match carried {
            Some(moving) => {
                self.activity = Activity::Moving(moving);
                intake.take_over();
            }
            None => intake.refuse(),
        }
    }

    #[inline]
    fn state(&self) -> ExecState {
        match self.activity {
            Activity::Rest => ExecState::Idle,
            Activity::Dwell { .. } => ExecState::Dwell,
            Activity::Stopped => ExecState::Stopped,
            Activity::Between { v_mm_s, .. } if v_mm_s <= R::ZERO => ExecState::Held,
            Activity::Moving(_) | Activity::Between { .. } => ExecState::Moving,
        }
    }

    /// Spends one tick's time on the queued items; returns the motion at the tick's end, if inside a stretch.
    #[inline]
    fn advance(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<Option<PathMotion<R>>, ExecFault> {
        let mut left = Ticks::ONE;
        for _ in 0..STEPS_PER_TICK_MAX {
            match (&mut self.activity, intake.feed()) {
                (Activity::Moving(moving), Some(FeedItem::Segment(segment))) => {
                    let Some(after) = moving.spend(segment, left) else {
                        return Ok(Some(moving.at(segment)));
                    };
                    left = after;
                    if !moving.next_phase(segment) {
                        self.activity = moving.ended(segment);
                        intake.drop_feed();
                        // The next item is usually there; if not, the next step handles it.
                        self.go_on(intake)?;
                    }
                }
                (Activity::Dwell { left: dwell }, _) => {
                    if let Some(still) = dwell.minus(left)
                        && still > Ticks::ZERO
                    {
                        *dwell = still;
                        return Ok(None);
                    }
                    left = left.minus(*dwell).unwrap_or(Ticks::ZERO);
                    self.activity = Activity::Rest;
                }
                (Activity::Stopped, _) | (Activity::Rest, None) => return Ok(None),
                (Activity::Rest, Some(FeedItem::Segment(segment))) => {
                    if !intake.may_start() {
                        return Ok(None);
                    }
                    self.activity = Activity::Moving(Moving::new(segment, Position::ZERO));
                }
                (Activity::Rest, Some(&FeedItem::Dwell(left))) => {
                    intake.drop_feed();
                    self.activity = Activity::Dwell { left };
                }
                (Activity::Rest, Some(FeedItem::ProgramStop)) => {
                    intake.drop_feed();
                    self.activity = Activity::Stopped;
                }
                (Activity::Between { .. }, Some(FeedItem::Segment(_) | FeedItem::EndOfStretch)) => {
                    self.go_on(intake)?;
                }
                (Activity::Rest, Some(FeedItem::EndOfStretch)) => self.end_stretch(intake)?,
                // The next item is not needed yet, or there is time to wait for it at rest.
                (Activity::Between { s, v_mm_s }, None) if left == Ticks::ZERO || *v_mm_s <= R::ZERO => {
                    return Ok(Some(PathMotion { s: *s, v_mm_s: *v_mm_s, ..PathMotion::default() }));
                }
                // The feeder lets no dwell or stop into a stretch, and a segment stays until it is done.
                (Activity::Between { .. } | Activity::Moving(_), _) => return Err(ExecFault::FeedStarved),
            }
        }
        Err(ExecFault::TooManySegments)
    }

    /// Continues from between two segments to the next one, or to the stretch's end, if it is there.
    #[inline]
    fn go_on(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<(), ExecFault> {
        match (&self.activity, intake.feed()) {
            (Activity::Between { s, .. }, Some(FeedItem::Segment(segment))) => {
                self.activity = Activity::Moving(Moving::new(segment, *s));
                Ok(())
            }
            (Activity::Between { .. }, Some(FeedItem::EndOfStretch)) => self.end_stretch(intake),
            _ => Ok(()),
        }
    }

    fn end_stretch(&mut self, intake: &mut Intake<'_, R, AXES>) -> Result<(), ExecFault> {
        intake.drop_feed();
        self.walker.finish(intake).map_err(walk_fault)?;
        self.stretches = self.stretches.wrapping_add(1);
        self.activity = Activity::Rest;
        Ok(())
    }
}

fn walk_fault(error: WalkError) -> ExecFault {
    match error {
        WalkError::Starved => ExecFault::PathStarved,
        WalkError::TooManyPieces => ExecFault::TooManyPieces,
        WalkError::NotHere => ExecFault::NotHere,
    }
}
