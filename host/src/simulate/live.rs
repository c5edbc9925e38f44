//! Live control of a run: commands before given ticks, at given times, or where given program lines begin.
//!
//! As text `WHEN:COMMAND,WHEN:COMMAND,…`, in the order in which they are given: each waits for the one before it. When is
//! a tick (`2000`), a time from the start of the run (`1.5s`), or a program line (`N50`); commands are `hold`, `resume`,
//! `abort`, `override=SHARE`, `single` and `continuous`. A script displays as the text it is read from.

use std::fmt;
use std::str::FromStr;

use motion_kernel::live::{OVERRIDE_MAX, OVERRIDE_MIN};
use serde::{Deserialize, Serialize};

/// What is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Come to rest on the path.
    Hold,
    /// Go on.
    Resume,
    /// Come to rest on the path and give up the rest of the program.
    Abort,
    /// Drive at this multiple of the program's feed, from 0 to 2.
    Override(f64),
    /// Come to rest at the end of every program block and wait there for a resume, or do so no more.
    SingleBlock(bool),
}

/// When a command is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// Before this tick from the start of the run, from 0.
    Tick(u64),
    /// At this time from the start of the run \[s\]: before the first tick that begins no earlier.
    Time(f64),
    /// Before the second tick of motion on this program line, or on the first one behind it where it has none of a tick's
    /// length.
    Line(u32),
}

/// How far a run is, before its next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reached {
    /// The next tick.
    pub tick: u64,
    /// The program line of motion in the last tick, and in the one before; 0: at rest.
    pub lines: [u32; 2],
}

impl When {
    /// Whether a run of ticks of `tick_s` is there.
    #[must_use]
    pub fn is_reached(self, reached: Reached, tick_s: f64) -> bool {
        let Reached { tick, lines: [line, before] } = reached;
        match self {
            Self::Tick(at) => at <= tick,
            // Times in decimals and ticks in binary fractions of a second meet within less than a millionth of a tick.
            Self::Time(at_s) => at_s <= (tick as f64 + 1e-6) * tick_s,
            Self::Line(at) => line == at || before > 0 && before < at && at < line,
        }
    }
}

/// A command with when it is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// When.
    pub when: When,
    /// What.
    pub command: Command,
}

/// Commands in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Script(Vec<Timed>);

impl Script {
    /// The commands.
    #[must_use]
    pub fn commands(&self) -> &[Timed] {
        &self.0
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hold => f.write_str("hold"),
            Self::Resume => f.write_str("resume"),
            Self::Abort => f.write_str("abort"),
            // All the digits that the number has.
            Self::Override(share) => write!(f, "override={share}"),
            Self::SingleBlock(true) => f.write_str("single"),
            Self::SingleBlock(false) => f.write_str("continuous"),
        }
    }
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tick(tick) => write!(f, "{tick}"),
            // All the digits that the number has.
            Self::Time(time_s) => write!(f, "{time_s}s"),
            Self::Line(line) => write!(f, "N{line}"),
        }
    }
}

impl FromStr for When {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        if let Some(line) = text.strip_prefix(['N', 'n']) {
            return line.parse().ok().filter(|&line| line > 0).map(Self::Line).ok_or(());
        }
        if let Some(time) = text.strip_suffix('s') {
            let time_s: Option<f64> = time.trim().parse().ok();
            return time_s.filter(|time_s| (0.0..f64::INFINITY).contains(time_s)).map(Self::Time).ok_or(());
        }
        text.parse().map(Self::Tick).map_err(|_| ())
    }
}

impl fmt::Display for Timed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.when, self.command)
    }
}

impl fmt::Display for Script {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, timed) in self.0.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            write!(f, "{comma}{timed}")?;
        }
        Ok(())
    }
}

impl From<Script> for String {
    fn from(script: Script) -> Self {
        script.to_string()
    }
}

/// As [`Script::from_str`]; an empty text is a script without commands.
impl TryFrom<String> for Script {
    type Error = ScriptError;

    fn try_from(text: String) -> Result<Self, ScriptError> {
        if text.is_empty() { Ok(Self::default()) } else { text.parse() }
    }
}

/// Why a text is not a script. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScriptError {
    /// A part has no colon, or nothing before it that says when.
    #[error(
        "found `{0}`, expected WHEN:COMMAND such as 2000:hold (before a tick), 1.5s:hold or N50:hold (a line)"
    )]
    When(String),
    /// A command is not known.
    #[error("found the command `{0}`, expected hold, resume, abort, override=SHARE, single or continuous")]
    Command(String),
    /// An override is not a number within its range.
    #[error("found an override of `{0}`, expected 0 or a number from {OVERRIDE_MIN} to {OVERRIDE_MAX}")]
    Override(String),
    /// A tick or a time comes before the one in front of it.
    #[error("found {0} behind {1}, expected ticks and times in their order")]
    Order(String, String),
}

impl FromStr for Script {
    type Err = ScriptError;

    fn from_str(text: &str) -> Result<Self, ScriptError> {
        let mut commands: Vec<Timed> = Vec::new();
        for part in text.split(',') {
            let part = part.trim();
            let of_when = || ScriptError::When(part.to_owned());
            let (when, command) = part.split_once(':').ok_or_else(of_when)?;
            let when: When = when.trim().parse().map_err(|()| of_when())?;
            let command = match command.trim() {
                "hold" => Command::Hold,
                "resume" => Command::Resume,
                "abort" => Command::Abort,
                "single" => Command::SingleBlock(true),
                "continuous" => Command::SingleBlock(false),
                other => {
                    let share = other
                        .strip_prefix("override=")
                        .ok_or_else(|| ScriptError::Command(other.to_owned()))?;
                    let value: Option<f64> = share.trim().parse().ok();
                    let value =
                        value.filter(|&value| value == 0.0 || (OVERRIDE_MIN..=OVERRIDE_MAX).contains(&value));
                    Command::Override(value.ok_or_else(|| ScriptError::Override(share.to_owned()))?)
                }
            };
            let is_earlier = |last: &&Timed| match (last.when, when) {
                (When::Tick(last), When::Tick(next)) => next < last,
                (When::Time(last), When::Time(next)) => next < last,
                _ => false,
            };
            if let Some(last) = commands.last().filter(is_earlier) {
                return Err(ScriptError::Order(when.to_string(), last.when.to_string()));
            }
            commands.push(Timed { when, command });
        }
        Ok(Self(commands))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_is_read_or_says_what_is_wrong() {
        let script: Script =
            "0:override=0.5, 10:hold,10:resume,11:single,0.25s:continuous,N20:abort, n20:resume"
                .parse()
                .expect("a script");
        let commands: Vec<_> = script.commands().iter().map(|timed| (timed.when, timed.command)).collect();
        assert_eq!(
            commands,
            [
                (When::Tick(0), Command::Override(0.5)),
                (When::Tick(10), Command::Hold),
                (When::Tick(10), Command::Resume),
                (When::Tick(11), Command::SingleBlock(true)),
                (When::Time(0.25), Command::SingleBlock(false)),
                (When::Line(20), Command::Abort),
                (When::Line(20), Command::Resume),
            ]
        );
        let third: Script =
            "7:override=0.3333333333333333,0.3333333333333333s:hold".parse().expect("a script");
        for script in [script, third, Script::default()] {
            assert_eq!(Script::try_from(script.to_string()), Ok(script));
        }
        let when = "expected WHEN:COMMAND such as 2000:hold (before a tick), 1.5s:hold or N50:hold (a line)";
        for text in ["hold", "", "-1:hold", "1.5:hold", "-1s:hold", "nans:hold", "N0:hold", "N:hold"] {
            assert_eq!(
                text.parse::<Script>().expect_err(text).to_string(),
                format!("found `{text}`, {when}")
            );
        }
        for (text, message) in [
            (
                "1:stop",
                "found the command `stop`, expected hold, resume, abort, override=SHARE, single or continuous",
            ),
            ("1:override=2.5", "found an override of `2.5`, expected 0 or a number from 0.001 to 2"),
            ("1:override=nan", "found an override of `nan`, expected 0 or a number from 0.001 to 2"),
            ("7:hold,6:resume", "found 6 behind 7, expected ticks and times in their order"),
            ("1s:hold,0.5s:resume", "found 0.5s behind 1s, expected ticks and times in their order"),
        ] {
            assert_eq!(text.parse::<Script>().expect_err(text).to_string(), message);
        }
    }
    #[test]
    fn a_command_is_due_once_its_place_is_reached() {
        let is_reached = |when: &str, tick: u64, lines: [u32; 2]| {
            when.parse::<When>().expect(when).is_reached(Reached { tick, lines }, 5e-4)
        };
        assert!(!is_reached("7", 6, [0; 2]) && is_reached("7", 7, [0; 2]));
        // 0.3 s are tick 600, though 600 · 0.0005 is a little less in binary.
        assert!(!is_reached("0.3s", 599, [0; 2]) && is_reached("0.3s", 600, [0; 2]));
        assert!(!is_reached("0.3001s", 600, [0; 2]) && is_reached("0.3001s", 601, [0; 2]));
        assert!(is_reached("N5", 0, [5, 4]) && is_reached("N5", 0, [5, 5]) && !is_reached("N5", 0, [4, 3]));
        // Passed within a tick; a start behind it is no passing.
        assert!(is_reached("N5", 0, [6, 4]) && !is_reached("N5", 0, [6, 0]) && !is_reached("N5", 0, [6, 6]));
        // A subroutine that stands before its call.
        assert!(!is_reached("N5", 0, [3, 30]) && is_reached("N5", 0, [5, 30]));
    }
}
