//! Live control of a run: commands before given ticks.
//!
//! As text `TICK:COMMAND,TICK:COMMAND,…`, in the order of their ticks; commands are `hold`, `resume`,
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

/// A command with the tick before which it is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// Tick from the start of the run, from 0.
    pub tick: u64,
    /// What.
    pub command: Command,
}

/// Commands in the order of their ticks.
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

impl fmt::Display for Timed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.tick, self.command)
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
    /// A part has no colon or no tick before it.
    #[error("found `{0}`, expected TICK:COMMAND such as 2000:hold")]
    Tick(String),
    /// A command is not known.
    #[error("found the command `{0}`, expected hold, resume, abort, override=SHARE, single or continuous")]
    Command(String),
    /// An override is not a number within its range.
    #[error("found an override of `{0}`, expected 0 or a number from {OVERRIDE_MIN} to {OVERRIDE_MAX}")]
    Override(String),
    /// A tick comes before the one in front of it.
    #[error("found tick {0} behind tick {1}, expected ticks in their order")]
    Order(u64, u64),
}

impl FromStr for Script {
    type Err = ScriptError;

    fn from_str(text: &str) -> Result<Self, ScriptError> {
        let mut commands: Vec<Timed> = Vec::new();
        for part in text.split(',') {
            let part = part.trim();
            let of_tick = || ScriptError::Tick(part.to_owned());
            let (tick, command) = part.split_once(':').ok_or_else(of_tick)?;
            let tick = tick.trim().parse().map_err(|_| of_tick())?;
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
            if let Some(last) = commands.last().filter(|last| last.tick > tick) {
                return Err(ScriptError::Order(tick, last.tick));
            }
            commands.push(Timed { tick, command });
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
            "0:override=0.5, 10:hold,10:resume,11:single,12:continuous,20:abort".parse().expect("a script");
        let commands: Vec<_> = script.commands().iter().map(|timed| (timed.tick, timed.command)).collect();
        assert_eq!(
            commands,
            [
                (0, Command::Override(0.5)),
                (10, Command::Hold),
                (10, Command::Resume),
                (11, Command::SingleBlock(true)),
                (12, Command::SingleBlock(false)),
                (20, Command::Abort)
            ]
        );
        let third: Script = "7:override=0.3333333333333333".parse().expect("a script");
        for script in [script, third, Script::default()] {
            assert_eq!(Script::try_from(script.to_string()), Ok(script));
        }
        for (text, message) in [
            ("hold", "found `hold`, expected TICK:COMMAND such as 2000:hold"),
            ("", "found ``, expected TICK:COMMAND such as 2000:hold"),
            ("-1:hold", "found `-1:hold`, expected TICK:COMMAND such as 2000:hold"),
            (
                "1:stop",
                "found the command `stop`, expected hold, resume, abort, override=SHARE, single or continuous",
            ),
            ("1:override=2.5", "found an override of `2.5`, expected 0 or a number from 0.001 to 2"),
            ("1:override=nan", "found an override of `nan`, expected 0 or a number from 0.001 to 2"),
            ("7:hold,6:resume", "found tick 6 behind tick 7, expected ticks in their order"),
        ] {
            assert_eq!(text.parse::<Script>().expect_err(text).to_string(), message);
        }
    }
}
