//! Jog of the simulated machine: keys pressed one after the other, each released after some ticks or never.
//!
//! A [`Press`] as text is the axis, the direction, a distance in mm or degrees unless it goes to the soft limit, and the
//! ticks after which the key is released: `X+`, `X-2.5`, `Y+@800`. It displays as the text it is read from.
//!
//! Consumes a machine and presses; produces what became of each, and every tick's record.

use std::fmt;
use std::str::FromStr;

use motion_kernel::exec::ExecState;
use motion_kernel::jog::{Direction, Jog, JogAxis, JogTarget, Travel};
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::straight::StraightError;
use motion_kernel::units::Position;

use super::Observer;
use super::error::RunError;
use super::hardware::simulated;
use super::session::{Session, SessionError, Then, jog_axis};
use crate::axis_unit::AxisUnit;
use crate::machine::Machine;

/// The shortest distance \[mm\]: some position steps, below which a ramp has no length.
const LEAST_MM: f64 = 1e-9;

/// A key that is pressed.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    /// The axis' name.
    pub axis: String,
    /// How far it is to go.
    pub target: JogTarget,
    /// After how many ticks the key is released, at least 1.
    pub release: Option<u64>,
    text: String,
}

/// Why a text is no press of a key. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PressError {
    /// It has another form.
    #[error(
        "found `{0}`, expected an axis, + or -, a distance in mm or degrees or none, and @TICKS until it is released: X+, X-2.5, Y+@800"
    )]
    Form(String),
    /// The distance is too short for motion, or beyond what positions hold.
    #[error("found a distance of {0} mm or degrees, expected {LEAST_MM} to {most}", most = Position::LIMIT_MM)]
    Distance(String),
    /// The ticks are no positive whole number.
    #[error("found `@{0}`, expected a whole number of ticks, at least 1")]
    Release(String),
}

impl FromStr for Press {
    type Err = PressError;

    fn from_str(text: &str) -> Result<Self, PressError> {
        let form = || PressError::Form(text.to_owned());
        let at = text.find(['+', '-']).filter(|&at| at > 0).ok_or_else(form)?;
        let (axis, rest) = text.split_at(at);
        let (direction, rest) = match rest.strip_prefix('+') {
            Some(rest) => (Direction::Positive, rest),
            None => (Direction::Negative, &rest[1..]),
        };
        let (distance, ticks) =
            rest.split_once('@').map_or((rest, None), |(distance, ticks)| (distance, Some(ticks)));
        // Digits only: a second sign, `inf` and `nan` are no figures.
        let is_plain =
            |text: &str, also: &[u8]| text.bytes().all(|byte| byte.is_ascii_digit() || also.contains(&byte));
        let release = |ticks: &str| {
            let whole = ticks.parse().ok().filter(|&whole: &u64| whole > 0 && is_plain(ticks, b""));
            whole.ok_or_else(|| PressError::Release(ticks.to_owned()))
        };
        let target = if distance.is_empty() {
            JogTarget::Continuous(direction)
        } else {
            let mm: f64 = distance.parse().ok().filter(|_| is_plain(distance, b".")).ok_or_else(form)?;
            let by = Position::from_mm(mm).filter(|_| mm >= LEAST_MM);
            let by = by.ok_or_else(|| PressError::Distance(distance.to_owned()))?;
            JogTarget::By(if direction == Direction::Negative { -by } else { by })
        };
        let release = ticks.map(release).transpose()?;
        Ok(Self { axis: axis.to_owned(), target, release, text: text.to_owned() })
    }
}

impl fmt::Display for Press {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// What ended a jog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ended {
    /// It went as far as it was to.
    Distance,
    /// It stands at the soft limit.
    SoftLimit,
    /// The key was released.
    Released {
        /// From then until it stood \[ticks\].
        ticks: u64,
        /// How far it went in that time \[mm\].
        length_mm: f64,
    },
}

/// What became of a press. Of a rotary axis read ° for mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Jogged {
    /// The press.
    pub press: Press,
    /// What its axis counts.
    pub unit: AxisUnit,
    /// Set position before it \[mm\].
    pub from_mm: f64,
    /// Set position after it \[mm\].
    pub to_mm: f64,
    /// How long it took \[ticks\].
    pub ticks: u64,
    /// Greatest feed \[mm/s\].
    pub feed_mm_s: f64,
    /// What ended it.
    pub ended: Ended,
}

/// Why the machine did not jog. Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum JogError {
    /// There is no such axis.
    #[error("{press}: found no such axis, expected one of {names}")]
    Axis {
        /// The press.
        press: String,
        /// What axes there are.
        names: String,
    },
    /// The feed is none that its axis has.
    #[error("{press}: found a feed of {feed_mm_s} {unit}/s, expected above 0, at most {most_mm_s}", unit = .unit.symbol())]
    Feed {
        /// The press.
        press: String,
        /// The feed.
        feed_mm_s: f64,
        /// The greatest of the axis.
        most_mm_s: f64,
        /// What its axis counts.
        unit: AxisUnit,
    },
    /// It would have no end.
    #[error("{0}: found no [axis.travel] for its axis, expected one to go on to, or a distance")]
    NoTravel(String),
    /// The kernel refuses it.
    #[error("{press}: {source}")]
    Refused {
        /// The press.
        press: String,
        /// Why.
        source: motion_kernel::jog::JogError,
    },
    /// At its feed there is no motion over its length.
    #[error("{press}: found no motion at {feed_mm_s} {unit}/s ({source}), expected a greater feed", unit = .unit.symbol())]
    NoMotion {
        /// The press.
        press: String,
        /// Its feed.
        feed_mm_s: f64,
        /// What its axis counts.
        unit: AxisUnit,
        /// Why.
        source: StraightError,
    },
    /// A motion did not come to its end.
    #[error("{press}: {source}")]
    Session {
        /// The press.
        press: String,
        /// Why.
        source: SessionError,
    },
    /// The machine can't be simulated.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl<R: Real, const N: usize> Session<'_, R, N> {
    /// Presses a key of `axis` at `feed_mm_s`, and waits until the machine stands.
    ///
    /// # Errors
    /// It is refused, or there was a fault.
    pub fn jog(
        &mut self,
        axis: usize,
        press: &Press,
        feed_mm_s: f64,
        observe: &mut Observer<'_, N>,
    ) -> Result<Jogged, JogError> {
        let of_axis = within_travel(self.machine, axis);
        let jog = Jog::new(&of_axis, axis, self.set, press.target, feed_mm_s, self.machine.tick_s);
        let jog = jog.map_err(|source| {
            let (press, unit) = (press.to_string(), self.machine.axes[axis].unit());
            match source {
                motion_kernel::jog::JogError::Straight(source) => {
                    JogError::NoMotion { press, feed_mm_s, unit, source }
                }
                source => JogError::Refused { press, source },
            }
        })?;
        let (first, from_mm, ends_at_limit) = (self.ticks, self.set[axis].to_mm(), jog.ends_at_limit());
        let (mut tick, mut greatest_mm_s, mut released, mut is_aborted) = (0, 0.0_f64, None, false);
        let drive = self.drive(jog, observe, |trace, _, state| {
            greatest_mm_s = greatest_mm_s.max(trace.executed.motion.v_mm_s.to_f64());
            let is_over =
                matches!(state, State::Done | State::Aborted) && trace.executed.state != ExecState::Moving;
            tick += 1;
            is_aborted = state == State::Aborted;
            Ok::<_, SessionError>(if is_over {
                Then::End
            } else if press.release == Some(tick) {
                released = Some((tick, trace.executed.setpoints[axis].position.to_mm()));
                Then::Abort
            } else {
                Then::GoOn
            })
        });
        drive
            .and_then(|()| self.rest())
            .map_err(|source| JogError::Session { press: press.to_string(), source })?;
        let (to_mm, ticks) = (self.set[axis].to_mm(), self.ticks - first);
        let ended = match released {
            Some((at, at_mm)) if is_aborted => {
                Ended::Released { ticks: ticks - at, length_mm: (to_mm - at_mm).abs() }
            }
            _ if ends_at_limit => Ended::SoftLimit,
            _ => Ended::Distance,
        };
        let (press, unit) = (press.clone(), self.machine.axes[axis].unit());
        Ok(Jogged { press, unit, from_mm, to_mm, ticks, feed_mm_s: greatest_mm_s, ended })
    }
}

/// What an axis may do, that knows its soft limits.
fn within_travel<const N: usize>(machine: &Machine<N>, axis: usize) -> JogAxis {
    let travel = machine.travel()[axis].map(|[least, greatest]| Travel { least, greatest });
    JogAxis { travel, ..jog_axis(machine, axis) }
}

/// A jog that a board is asked for, before it is known where the machine stands.
#[derive(Clone, Copy, Debug)]
pub struct WantedJog {
    axis: JogAxis,
    /// The number of the axis, from 0.
    number: usize,
    target: JogTarget,
    feed_mm_s: f64,
    tick_s: f64,
}

impl WantedJog {
    /// Of the axis with this number, from 0.
    #[must_use]
    pub fn new<const N: usize>(
        machine: &Machine<N>,
        number: usize,
        target: JogTarget,
        feed_mm_s: f64,
    ) -> Self {
        Self { axis: within_travel(machine, number), number, target, feed_mm_s, tick_s: machine.tick_s }
    }

    /// The jog of a board of `M` axes that stands at `start`.
    ///
    /// # Errors
    /// The kernel refuses it.
    pub fn on_board<const M: usize>(
        &self,
        start: [Position; M],
    ) -> Result<Jog<M>, motion_kernel::jog::JogError> {
        Jog::new(&self.axis, self.number, start, self.target, self.feed_mm_s, self.tick_s)
    }
}

/// Keys of a machine, each at a feed that its axis has.
#[derive(Clone, Debug)]
pub struct Keys<'a, const N: usize = 3> {
    machine: &'a Machine<N>,
    /// With the axis, from 0, and the feed \[mm/s\].
    presses: Vec<(usize, f64, &'a Press)>,
}

impl<'a, const N: usize> Keys<'a, N> {
    /// `presses` at `feed_mm_s`, or at the greatest feed of each axis.
    ///
    /// # Errors
    /// There is no such axis, or it has no such feed, or no soft limit to go on to.
    pub fn new(
        machine: &'a Machine<N>,
        presses: &'a [Press],
        feed_mm_s: Option<f64>,
    ) -> Result<Self, JogError> {
        let axes = machine.driven_axes();
        let key = |press: &'a Press| {
            let axis = axes.iter().position(|axis| axis.name == press.axis);
            let axis = axis.ok_or_else(|| JogError::Axis {
                press: press.to_string(),
                names: axes.iter().map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", "),
            })?;
            let most_mm_s = jog_axis(machine, axis).feed_mm_s;
            let feed_mm_s = feed_mm_s.unwrap_or(most_mm_s);
            // Written so that what is not a number is refused.
            if !(feed_mm_s > 0.0 && feed_mm_s <= most_mm_s) {
                let (press, unit) = (press.to_string(), axes[axis].unit());
                return Err(JogError::Feed { press, feed_mm_s, most_mm_s, unit });
            }
            if matches!(press.target, JogTarget::Continuous(_)) && machine.travel()[axis].is_none() {
                return Err(JogError::NoTravel(press.to_string()));
            }
            Ok((axis, feed_mm_s, press))
        };
        Ok(Self { machine, presses: presses.iter().map(key).collect::<Result<_, _>>()? })
    }

    /// The number of keys.
    #[must_use]
    pub fn count(&self) -> usize {
        self.presses.len()
    }

    /// A key's axis, from 0, and its press.
    ///
    /// # Panics
    /// There are fewer keys.
    #[must_use]
    pub fn key(&self, key: usize) -> (usize, &'a Press) {
        let (axis, _, press) = self.presses[key];
        (axis, press)
    }

    /// What a key's axis counts.
    ///
    /// # Panics
    /// There are fewer keys.
    #[must_use]
    pub fn unit(&self, key: usize) -> AxisUnit {
        self.machine.axes[self.presses[key].0].unit()
    }

    /// What a key asks a board for.
    ///
    /// # Panics
    /// There are fewer keys.
    #[must_use]
    pub fn wanted(&self, key: usize) -> WantedJog {
        let (axis, feed_mm_s, press) = self.presses[key];
        WantedJog::new(self.machine, axis, press.target, feed_mm_s)
    }

    /// Presses them one after the other, from where the machine is switched on; what came of each into
    /// `jogged`.
    ///
    /// # Errors
    /// A press is refused, there was a fault, or the machine can't be simulated.
    pub fn jog(&self, jogged: &mut Vec<Jogged>, observe: &mut Observer<'_, N>) -> Result<(), JogError> {
        let simulated = simulated(self.machine)?;
        let mut session = Session::<f32, N>::new(self.machine, &simulated)?;
        for &(axis, feed_mm_s, press) in &self.presses {
            jogged.push(session.jog(axis, press, feed_mm_s, observe)?);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_displays_as_the_text_it_is_read_from() {
        for text in ["X+", "X-", "Y+@800", "X+20", "X-2.50", "Long name-0.000000001@1", "X+.5", "X+1000000"] {
            let press: Press = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(press.to_string(), text);
        }
        let press: Press = "X-2.5@7".parse().expect("a press");
        let by = JogTarget::By(-Position::from_mm(2.5).expect("in range"));
        assert_eq!((press.axis.as_str(), press.target, press.release), ("X", by, Some(7)));
    }

    #[test]
    fn what_is_no_press_is_refused() {
        let parsed = |text: &str| text.parse::<Press>().expect_err(text);
        for text in
            ["", "X", "5", "+5", "X5", "X+-5", "X++", "X+5mm", "X+1e3", "X+inf", "X+nan", "X+.", "X+ 5"]
        {
            assert_eq!(parsed(text), PressError::Form(text.to_owned()));
        }
        for distance in ["0", "0.00", "0.0000000009", "2000000000", "1000000000000"] {
            assert_eq!(parsed(&format!("X+{distance}")), PressError::Distance(distance.to_owned()));
        }
        for ticks in ["", "0", "-1", "+5", "1.5", "1@2", "99999999999999999999"] {
            assert_eq!(parsed(&format!("X-5@{ticks}")), PressError::Release(ticks.to_owned()));
        }
    }
}
