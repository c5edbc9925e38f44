//! Homing of an axis: switch and, where there is one, index pulse, at two speeds.
//!
//! Consumes, once per poll of the background, what the tick has seen of the axis ([`HomingInput`]); produces
//! the next step ([`HomingStep`]): jogs, which are jerk-limited, and stops, which are controlled. The
//! reference is where the switch closes on the slow approach, or the first index after that: its count is
//! latched, so the position is exact however late the stop is.
//!
//! ```text
//!              on already ┌──────────────────────┐
//!   start ───────────────►│ back off, fast       │ off, at rest ┌────────────────┐ closes, index or end at rest
//!     │ off               │ until it opens       ├─────────────►│ approach, slow ├─────────► reference ─► park
//!     └─► seek, fast ────►│                      │              └────────────────┘
//!          closes, at rest└──────────────────────┘
//! ```
//!
//! Without an index the reference is off by up to the slow feed times a tick, plus the switch's own
//! repeatability. With an index it is the same count wherever homing starts, as long as the
//! index does not lie where the switch closes: [`Homed::index_counts`] says how far beyond the switch it was
//! found.
//!
//! Every stage is bounded by a length; if nothing is found within it, homing ends at rest with a
//! [`HomingError`].

use serde::{Deserialize, Serialize};

use crate::jog::{Direction, Jog, JogAxis, JogError, JogTarget};
use crate::law::{Limits, Pulse};
use crate::live::State;
use crate::units::{Counts, Position};

/// How an axis is homed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HomingConfig {
    /// Where the switch is.
    pub direction: Direction,
    /// Feed of the search \[mm/s\].
    pub fast_mm_s: f64,
    /// Feed at which the switch is approached \[mm/s\].
    pub slow_mm_s: f64,
    /// Greatest length of the search \[mm\].
    pub travel_mm: f64,
    /// Greatest length of backing off, and of the approach after it \[mm\]: the switch's length and
    /// hysteresis, plus twice the stopping distance at the fast feed.
    pub back_off_mm: f64,
    /// Greatest length from where the switch closes to the index \[mm\], a little more than a revolution; if
    /// `None`, the switch is the reference.
    pub index_mm: Option<f64>,
    /// Position of the reference.
    pub position: Position,
    /// Where the axis goes afterwards.
    pub park: Option<Position>,
}

/// How an axis of a board is homed, and what it may do meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisHoming {
    /// How it is homed.
    pub config: HomingConfig,
    /// Its greatest feed \[mm/s\], see [`JogAxis::feed_mm_s`].
    pub feed_mm_s: f64,
    /// Limits of its ramps, see [`JogAxis::limits`].
    pub limits: Limits<f64>,
}

impl AxisHoming {
    /// Homing of `axis` with pulses of jerk of this shape, for ticks of `tick_s`.
    #[must_use]
    pub fn start(&self, axis: usize, pulse: Pulse, tick_s: f64) -> Homing {
        let &Self { config, feed_mm_s, limits } = self;
        Homing::new(config, &JogAxis { feed_mm_s, limits, pulse, travel: None }, axis, tick_s)
    }
}

/// How the axes of a machine are homed; a compiled program carries it. `None` for an axis that is not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HomingFigures<const AXES: usize> {
    /// Figures of each axis.
    #[serde(with = "crate::array")]
    pub axes: [Option<AxisHoming>; AXES],
}

impl<const AXES: usize> HomingFigures<AXES> {
    /// No axis is homed.
    pub const NONE: Self = Self { axes: [None; AXES] };
}

/// What homing of an axis is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub enum HomingStage {
    /// Searches the switch, at the fast feed.
    Search,
    /// Backs off the switch.
    BackOff,
    /// Approaches the switch, at the slow feed.
    Approach,
    /// Looks for the index.
    Index,
    /// Has its reference, and goes to the park position.
    Park,
}

/// What a tick has seen of the axis.
#[derive(Clone, Copy, Debug)]
pub struct HomingInput<const AXES: usize> {
    /// Set positions of all axes.
    pub set: [Position; AXES],
    /// Its encoder's reading.
    pub counts: Counts,
    /// Its home switch, as read in the same tick.
    pub is_home: bool,
    /// Its encoder's reading in the tick in which the switch closed, the first time since a poll that found it open, where every
    /// tick looks for that; `None` where every tick is polled.
    pub home_counts: Option<Counts>,
    /// The count in its index latch ([`IndexLatch`](crate::hal::IndexLatch)).
    pub index: Option<Counts>,
    /// The state of the move asked for last; before the first one it is ignored.
    pub state: State,
}

/// The next thing to do.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is no heap to put a jog on")]
pub enum HomingStep<const AXES: usize> {
    /// Nothing.
    Wait,
    /// Rest here, split the streams and drive this with a new live control.
    Move(Jog<AXES>),
    /// Abort the move.
    Stop,
    /// Arm the axis' index latch.
    ArmIndex,
    /// At rest: the axis was at this position where its encoder read these counts
    /// ([`Kernel::reference`](crate::kernel::Kernel::reference)). Split the streams anew.
    Reference(Counts, Position),
    /// The axis is homed, and at rest.
    Done(Homed),
}

/// The reference that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "link", derive(postcard_schema::Schema))]
pub struct Homed {
    /// The encoder's counts at the reference.
    pub counts: Counts,
    /// Number of counts from where the switch was seen closing to the latched index.
    pub index_counts: Option<i64>,
}

/// Why an axis is not homed. It is at rest and keeps its old position, unless homing failed on the way to the
/// park position.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum HomingError {
    /// A move is refused: a feed, a length or an axis is out of range.
    Move(JogError),
    /// The switch did not close in the search.
    NoSwitch {
        /// Within this length \[mm\].
        travel_mm: f64,
    },
    /// The switch did not open again.
    StuckSwitch {
        /// Within this length \[mm\].
        back_off_mm: f64,
    },
    /// The switch was seen closed but did not close again: in the slow approach, or after it was passed at
    /// the fast feed.
    LostSwitch {
        /// Within this length \[mm\].
        back_off_mm: f64,
    },
    /// No index was latched.
    NoIndex {
        /// Within this length beyond the switch \[mm\].
        index_mm: f64,
    },
    /// The board has no index input for the axis.
    NoLatch,
    /// Homing was aborted.
    Aborted,
    /// The move could not be executed.
    Failed,
}

impl core::fmt::Display for HomingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Move(error) => error.fmt(f),
            Self::NoSwitch { travel_mm } => {
                write!(f, "no home switch within {travel_mm} mm: expected it to close there")
            }
            Self::StuckSwitch { back_off_mm } => {
                write!(f, "home switch closed over {back_off_mm} mm: expected it to open when backing off")
            }
            Self::LostSwitch { back_off_mm } => {
                write!(f, "home switch open over {back_off_mm} mm: expected it to close again")
            }
            Self::NoIndex { index_mm } => {
                write!(f, "no index within {index_mm} mm of the home switch: expected one a revolution")
            }
            Self::NoLatch => f.write_str("no index input for this axis: expected one, or index_mm 0"),
            Self::Aborted => f.write_str("homing was given up"),
            Self::Failed => f.write_str("a move of homing can't be executed"),
        }
    }
}

impl core::error::Error for HomingError {}

/// The stage under way.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Start,
    Seek,
    /// Backing off a switch that has been seen closed, or is still to be.
    BackOff {
        was_home: bool,
    },
    Approach,
    /// Looking for the index beyond the place `edge` where the switch closed, at `counts`.
    Index {
        edge: Position,
        counts: Counts,
    },
    /// Coming to rest; then the stage given.
    Stopping(After),
    /// At rest, with its new position.
    Referenced(Homed),
    Park(Homed),
    Ended,
}

/// What follows a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
enum After {
    BackOff,
    Approach,
    Reference(Homed),
    Error(HomingError),
}

/// Homing of one axis.
#[derive(Clone, Debug)]
pub struct Homing {
    config: HomingConfig,
    jog: JogAxis,
    axis: usize,
    tick_s: f64,
    stage: Stage,
    /// Where the stage's move began.
    from: Position,
    /// Why it is to end early.
    ends: Option<HomingError>,
}

impl Homing {
    /// Homing of `axis` within the feed and limits of `jog`. Soft limits are ignored: the axis does not know
    /// yet where it is.
    #[must_use]
    pub fn new(config: HomingConfig, jog: &JogAxis, axis: usize, tick_s: f64) -> Self {
        let jog = JogAxis { travel: None, ..*jog };
        Self { config, jog, axis, tick_s, stage: Stage::Start, from: Position::ZERO, ends: None }
    }

    /// Aborts: the axis comes to rest, then [`Homing::poll`] returns [`HomingError::Aborted`].
    pub fn abort(&mut self) {
        self.ends = Some(HomingError::Aborted);
    }

    /// The index can't be armed: as [`Homing::abort`], with [`HomingError::NoLatch`].
    pub fn lacks_index(&mut self) {
        self.ends = Some(HomingError::NoLatch);
    }

    /// What it is doing.
    #[must_use]
    pub fn stage(&self) -> HomingStage {
        match self.stage {
            Stage::Start | Stage::Seek | Stage::Stopping(After::BackOff | After::Error(_)) | Stage::Ended => {
                HomingStage::Search
            }
            Stage::BackOff { .. } | Stage::Stopping(After::Approach) => HomingStage::BackOff,
            Stage::Approach => HomingStage::Approach,
            Stage::Index { .. } | Stage::Stopping(After::Reference(_)) => HomingStage::Index,
            Stage::Referenced(_) | Stage::Park(_) => HomingStage::Park,
        }
    }

    /// One poll, after a tick: returns what to do before the next one.
    ///
    /// # Errors
    /// The axis is not homed; it is at rest.
    pub fn poll<const AXES: usize>(
        &mut self,
        seen: &HomingInput<AXES>,
    ) -> Result<HomingStep<AXES>, HomingError> {
        let step = self.step(seen);
        if matches!(step, Err(_) | Ok(HomingStep::Done(_))) {
            self.stage = Stage::Ended;
        }
        step
    }

    fn step<const AXES: usize>(&mut self, seen: &HomingInput<AXES>) -> Result<HomingStep<AXES>, HomingError> {
        let here = self.here(seen)?;
        let is_at_rest = matches!(seen.state, State::Done | State::Aborted);
        match self.stage {
            Stage::Ended => return Ok(HomingStep::Wait),
            Stage::Start => {
                if let Some(error) = self.ends {
                    return Err(error);
                }
            }
            _ if seen.state == State::Failed => return Err(HomingError::Failed),
            _ => {
                if let Some(error) = self.ends.take() {
                    return Ok(self.stop(After::Error(error)));
                }
            }
        }
        let HomingConfig { travel_mm, back_off_mm, index_mm, .. } = self.config;
        match self.stage {
            Stage::Start if seen.is_home => self.go(Stage::BackOff { was_home: true }, seen),
            Stage::Start => self.go(Stage::Seek, seen),
            Stage::Seek if seen.is_home => Ok(self.stop(After::BackOff)),
            Stage::Seek if is_at_rest => Err(HomingError::NoSwitch { travel_mm }),
            Stage::BackOff { was_home: true } if !seen.is_home => Ok(self.stop(After::Approach)),
            Stage::BackOff { was_home: true } if is_at_rest => Err(HomingError::StuckSwitch { back_off_mm }),
            Stage::BackOff { was_home: false } if is_at_rest => Err(HomingError::LostSwitch { back_off_mm }),
            Stage::BackOff { was_home } => {
                self.stage = Stage::BackOff { was_home: was_home || seen.is_home };
                Ok(HomingStep::Wait)
            }
            Stage::Approach if seen.is_home => {
                let counts = seen.home_counts.unwrap_or(seen.counts);
                if index_mm.is_some() {
                    self.stage = Stage::Index { edge: here, counts };
                    Ok(HomingStep::ArmIndex)
                } else {
                    Ok(self.stop(After::Reference(Homed { counts, index_counts: None })))
                }
            }
            Stage::Approach if is_at_rest || self.distance_mm(self.from, here) > back_off_mm => {
                Ok(self.stop(After::Error(HomingError::LostSwitch { back_off_mm })))
            }
            Stage::Index { edge, counts: Counts(at_edge) } => {
                let index_mm = index_mm.unwrap_or_default();
                match seen.index {
                    Some(counts) => {
                        let behind = counts.0.wrapping_sub(at_edge);
                        Ok(self.stop(After::Reference(Homed { counts, index_counts: Some(behind) })))
                    }
                    None if is_at_rest || self.distance_mm(edge, here) > index_mm => {
                        Ok(self.stop(After::Error(HomingError::NoIndex { index_mm })))
                    }
                    None => Ok(HomingStep::Wait),
                }
            }
            Stage::Stopping(after) if is_at_rest => self.after(after, seen),
            Stage::Referenced(homed) => match self.config.park {
                Some(park) if park != here => {
                    self.stage = Stage::Park(homed);
                    self.jog(JogTarget::By(park - here), self.config.fast_mm_s, seen)
                }
                _ => Ok(HomingStep::Done(homed)),
            },
            Stage::Park(homed) if is_at_rest => Ok(HomingStep::Done(homed)),
            Stage::Seek | Stage::Approach | Stage::Stopping(_) | Stage::Park(_) | Stage::Ended => {
                Ok(HomingStep::Wait)
            }
        }
    }

    fn after<const AXES: usize>(
        &mut self,
        after: After,
        seen: &HomingInput<AXES>,
    ) -> Result<HomingStep<AXES>, HomingError> {
        match after {
            // A short switch may have been passed.
            After::BackOff => self.go(Stage::BackOff { was_home: seen.is_home }, seen),
            // The switch bounces.
            After::Approach if seen.is_home => self.go(Stage::BackOff { was_home: true }, seen),
            After::Approach => self.go(Stage::Approach, seen),
            After::Reference(homed) => {
                self.stage = Stage::Referenced(homed);
                Ok(HomingStep::Reference(homed.counts, self.config.position))
            }
            After::Error(error) => Err(error),
        }
    }

    fn here<const AXES: usize>(&self, seen: &HomingInput<AXES>) -> Result<Position, HomingError> {
        let here = seen.set.get(self.axis).copied();
        here.ok_or(HomingError::Move(JogError::Axis { axis: self.axis, axes: AXES }))
    }

    /// How far `to` is from `from` in the direction of homing \[mm\].
    fn distance_mm(&self, from: Position, to: Position) -> f64 {
        match self.config.direction {
            Direction::Positive => (to - from).to_mm(),
            Direction::Negative => (from - to).to_mm(),
        }
    }

    fn stop<const AXES: usize>(&mut self, after: After) -> HomingStep<AXES> {
        self.stage = Stage::Stopping(after);
        HomingStep::Stop
    }

    /// The move of a stage.
    fn go<const AXES: usize>(
        &mut self,
        stage: Stage,
        seen: &HomingInput<AXES>,
    ) -> Result<HomingStep<AXES>, HomingError> {
        let HomingConfig { direction, fast_mm_s, slow_mm_s, travel_mm, back_off_mm, index_mm, .. } =
            self.config;
        let (direction, length_mm, feed_mm_s) = match stage {
            Stage::BackOff { .. } => (direction.reversed(), back_off_mm, fast_mm_s),
            Stage::Approach => (direction, back_off_mm + index_mm.unwrap_or_default(), slow_mm_s),
            _ => (direction, travel_mm, fast_mm_s),
        };
        let signed_mm = if direction == Direction::Positive { length_mm } else { -length_mm };
        let by =
            Position::from_mm(signed_mm).ok_or(HomingError::Move(JogError::End { end_mm: signed_mm }))?;
        (self.stage, self.from) = (stage, self.here(seen)?);
        self.jog(JogTarget::By(by), feed_mm_s, seen)
    }

    fn jog<const AXES: usize>(
        &self,
        target: JogTarget,
        feed_mm_s: f64,
        seen: &HomingInput<AXES>,
    ) -> Result<HomingStep<AXES>, HomingError> {
        let jog = Jog::new(&self.jog, self.axis, seen.set, target, feed_mm_s, self.tick_s);
        jog.map(HomingStep::Move).map_err(HomingError::Move)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::LIMITS;
    use crate::law::Pulse;

    fn at(mm: f64) -> Position {
        Position::from_mm(mm).expect("in range")
    }

    fn homing() -> Homing {
        let config = HomingConfig {
            direction: Direction::Negative,
            fast_mm_s: 20.0,
            slow_mm_s: 1.0,
            travel_mm: 100.0,
            back_off_mm: 10.0,
            index_mm: Some(5.0),
            position: at(-3.0),
            park: Some(at(0.0)),
        };
        let jog = JogAxis { feed_mm_s: 50.0, limits: LIMITS, pulse: Pulse::Plateau, travel: None };
        Homing::new(config, &jog, 0, 5e-4)
    }

    /// What a machine does that rests after every stop, and moves a millimetre a poll.
    struct Machine {
        seen: HomingInput<1>,
        direction: f64,
        end: Position,
    }

    impl Machine {
        fn new() -> Self {
            let seen = HomingInput {
                set: [at(0.0)],
                counts: Counts(0),
                is_home: false,
                home_counts: None,
                index: None,
                state: State::Done,
            };
            Self { seen, direction: 0.0, end: at(0.0) }
        }

        /// The switch is closed below -20 mm, an index lies at -22 mm.
        fn poll(&mut self, homing: &mut Homing) -> Result<HomingStep<1>, HomingError> {
            let step = homing.poll(&self.seen);
            match &step {
                Ok(HomingStep::Move(jog)) => {
                    [self.end] = jog.end();
                    let way = self.end - self.seen.set[0];
                    (self.direction, self.seen.state) = (way.to_mm().signum(), State::Running);
                }
                Ok(HomingStep::Stop) => (self.direction, self.seen.state) = (0.0, State::Aborted),
                _ => {}
            }
            let HomingInput { set: [set], counts, is_home, index, state, .. } = &mut self.seen;
            *set = *set + at(self.direction);
            if *state == State::Running && *set == self.end {
                (self.direction, *state) = (0.0, State::Done);
            }
            counts.0 = set.to_mm() as i64 * 10;
            *is_home = *set <= at(-20.0);
            *index = (*set <= at(-22.0)).then_some(Counts(-220));
            step
        }
    }

    #[test]
    fn it_can_be_given_up_in_every_turn() {
        let steps = |given_up: usize| {
            let (mut homing, mut machine) = (homing(), Machine::new());
            let mut steps = 0;
            loop {
                if steps == given_up {
                    homing.abort();
                }
                match machine.poll(&mut homing) {
                    Ok(HomingStep::Done(homed)) => {
                        assert_eq!(homed, Homed { counts: Counts(-220), index_counts: Some(-20) });
                        return Ok(steps);
                    }
                    Ok(HomingStep::Reference(counts, position)) => {
                        assert_eq!((counts, position), (Counts(-220), at(-3.0)));
                        // From here on it is elsewhere.
                        machine.seen.set = [at(-5.0)];
                    }
                    Err(error) => {
                        assert_eq!(machine.direction, 0.0, "moves in {:?}", homing.stage);
                        return Err(error);
                    }
                    Ok(_) => {}
                }
                steps += 1;
                assert!(steps < 1000, "no end in {:?}", homing.stage);
            }
        };
        let whole = steps(usize::MAX).expect("homed");
        assert!(whole > 25, "{whole}");
        for given_up in 0..whole {
            assert_eq!(steps(given_up), Err(HomingError::Aborted), "in poll {given_up}");
        }
    }

    #[test]
    fn an_axis_that_is_not_there_is_refused() {
        let mut homing = Homing { axis: 1, ..homing() };
        let error = Machine::new().poll(&mut homing).expect_err("refused");
        assert_eq!(error, HomingError::Move(JogError::Axis { axis: 1, axes: 1 }));
    }
}
