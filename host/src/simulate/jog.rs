//! Jog of the simulated machine: keys pressed one after the other, each released after some ticks or never.
//!
//! A [`Press`] as text is the axis, the direction, a distance in mm unless it goes on to the soft limit, and the ticks after
//! which the key is released: `X+`, `X-2.5`, `Y+@800`. It displays as the text it is read from.
//!
//! Consumes a machine and presses; produces what became of each, and every tick's record.

use std::fmt;
use std::str::FromStr;

use motion_kernel::exec::ExecState;
use motion_kernel::jog::{Direction, Jog, JogAxis, Travel, Way};
use motion_kernel::live::State;
use motion_kernel::num::Real;
use motion_kernel::units::Position;

use super::Observer;
use super::rig::Simulated;
use super::run::RunError;
use super::session::{Session, SessionError, Then};
use crate::machine::Machine;

/// A key that is pressed.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    /// The axis' name.
    pub axis: String,
    /// How far it is to go.
    pub way: Way,
    /// After how many ticks the key is released, at least 1.
    pub release: Option<u64>,
}

/// Why a text is no press of a key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "found `{0}`, expected an axis, + or -, a distance in mm or none, and @TICKS until it is released: X+, X-2.5, Y+@800"
)]
pub struct PressError(String);

impl FromStr for Press {
    type Err = PressError;

    fn from_str(text: &str) -> Result<Self, PressError> {
        let wrong = || PressError(text.to_owned());
        let at = text.find(['+', '-']).filter(|&at| at > 0).ok_or_else(wrong)?;
        let (axis, rest) = text.split_at(at);
        let (direction, rest) = match rest.strip_prefix('+') {
            Some(rest) => (Direction::Positive, rest),
            None => (Direction::Negative, &rest[1..]),
        };
        let (distance, release) = match rest.split_once('@') {
            Some((distance, tick)) => {
                (distance, Some(tick.parse().ok().filter(|&tick| tick > 0).ok_or_else(wrong)?))
            }
            None => (rest, None),
        };
        let way = if distance.is_empty() {
            Way::Continuous(direction)
        } else {
            // Digits only: a second sign, `inf` and `nan` are no distance.
            let is_plain = distance.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            let mm = distance.parse().ok().filter(|_| is_plain);
            let by = mm.and_then(Position::from_mm).ok_or_else(wrong)?;
            Way::By(if direction == Direction::Negative { -by } else { by })
        };
        Ok(Self { axis: axis.to_owned(), way, release })
    }
}

impl fmt::Display for Press {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.axis)?;
        match self.way {
            Way::Continuous(Direction::Positive) => f.write_str("+")?,
            Way::Continuous(Direction::Negative) => f.write_str("-")?,
            // To the picometre, which is less than a position step.
            Way::By(by) => write!(f, "{:+}", (by.to_mm() * 1e9).round() / 1e9)?,
        }
        self.release.map_or(Ok(()), |ticks| write!(f, "@{ticks}"))
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

/// What became of a press.
#[derive(Clone, Debug, PartialEq)]
pub struct Jogged {
    /// The press.
    pub press: Press,
    /// Set position before it \[mm\].
    pub from_mm: f64,
    /// Set position behind it \[mm\].
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

impl<R: Real> Session<'_, R> {
    /// Presses a key of `axis`, at `feed_mm_s` or the greatest, and waits until the machine stands.
    ///
    /// # Errors
    /// It is refused, or there was a fault.
    pub fn jog(
        &mut self,
        axis: usize,
        press: &Press,
        feed_mm_s: Option<f64>,
        observe: &mut Observer<'_>,
    ) -> Result<Jogged, JogError> {
        let travel = self.machine.travel()[axis].map(|[least, greatest]| Travel { least, greatest });
        let of_axis = JogAxis { travel, ..self.of_axis(axis) };
        let feed_mm_s = feed_mm_s.unwrap_or(of_axis.feed_mm_s);
        let jog = Jog::new(&of_axis, axis, self.set, press.way, feed_mm_s, self.machine.tick_s);
        let jog = jog.map_err(|source| match source {
            motion_kernel::jog::JogError::NoTravel => JogError::NoTravel(press.to_string()),
            source => JogError::Refused { press: press.to_string(), source },
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
        drive.map_err(|source| JogError::Session { press: press.to_string(), source })?;
        self.set = self.kernel.rest_here().unwrap_or(self.set);
        let (to_mm, ticks) = (self.set[axis].to_mm(), self.ticks - first);
        let ended = match released {
            Some((at, at_mm)) if is_aborted => {
                Ended::Released { ticks: ticks - at, length_mm: (to_mm - at_mm).abs() }
            }
            _ if ends_at_limit => Ended::SoftLimit,
            _ => Ended::Distance,
        };
        Ok(Jogged { press: press.clone(), from_mm, to_mm, ticks, feed_mm_s: greatest_mm_s, ended })
    }
}

/// Presses the keys one after the other, at `feed_mm_s` or the greatest of each axis, into `jogged`.
///
/// # Errors
/// There is no such axis; then nothing moves. A press is refused, or the machine can't be simulated.
pub fn jog(
    machine: &Machine,
    presses: &[Press],
    feed_mm_s: Option<f64>,
    jogged: &mut Vec<Jogged>,
    observe: &mut Observer<'_>,
) -> Result<(), JogError> {
    let axis_of = |press: &Press| {
        machine.axes.iter().position(|axis| axis.name == press.axis).ok_or_else(|| JogError::Axis {
            press: press.to_string(),
            names: machine.axes.each_ref().map(|axis| axis.name.as_str()).join(", "),
        })
    };
    let axes = presses.iter().map(axis_of).collect::<Result<Vec<usize>, _>>()?;
    let simulated =
        Simulated::new(&machine.simulated()).map_err(|error| RunError::Simulation(error.to_string()))?;
    let mut session = Session::<f32>::new(machine, &simulated)?;
    for (press, axis) in presses.iter().zip(axes) {
        jogged.push(session.jog(axis, press, feed_mm_s, observe)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_displays_as_the_text_it_is_read_from() {
        for text in ["X+", "X-", "Y+@800", "X+20", "X-2.5", "Long name-0.000000001@1", "X+1000000"] {
            let press: Press = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(press.to_string(), text);
        }
        let press: Press = "X-2.5@7".parse().expect("a press");
        let by = Way::By(-Position::from_mm(2.5).expect("in range"));
        assert_eq!(press, Press { axis: "X".to_owned(), way: by, release: Some(7) });
    }

    #[test]
    fn what_is_no_press_is_refused() {
        for text in [
            "",
            "X",
            "5",
            "+5",
            "X5",
            "X+-5",
            "X++",
            "X+5mm",
            "X+1e3",
            "X+inf",
            "X+nan",
            "X+.",
            "X+2147483648",
            "X+@",
            "X+@0",
            "X+@-1",
            "X+5@1.5",
            "X+5@1@2",
        ] {
            let error = text.parse::<Press>().expect_err(text);
            assert!(error.to_string().starts_with(&format!("found `{text}`, expected")), "{error}");
        }
    }
}
