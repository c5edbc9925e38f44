//! Live control of a run: commands before given ticks, at given times, or where given program lines begin.
//!
//! As text `WHEN:COMMAND,WHEN:COMMAND,…`, in the order in which they are given: each waits for the one before it. When is
//! a tick (`2000`), a time from the start of the run (`1.5s`), or a line of the program's file (`N50`: line 50, whatever its
//! N word is); commands are `hold`, `resume`, `abort`, `override=SHARE`, `single` and `continuous`. A script displays as the
//! text it is read from.

use std::fmt;
use std::str::FromStr;

use motion_kernel::live::{OVERRIDE_MAX, OVERRIDE_MIN};
use serde::{Deserialize, Serialize};

use super::job::RunInfo;

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
    /// Where motion on this line of the program's file begins, or on the next line with motion.
    Line(u32),
}

/// When a command is due in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Due {
    /// Before this tick.
    Tick(u64),
    /// Once motion has come so far along the path \[mm\].
    Position(f64),
    /// There is no motion on its line, nor behind it.
    Never,
}

/// Positions are rounded by less \[mm\].
const ROUNDING_MM: f64 = 1e-6;

impl When {
    /// When that is in a run of `info`.
    #[must_use]
    pub fn due(self, info: &RunInfo) -> Due {
        match self {
            Self::Tick(tick) => Due::Tick(tick),
            // Times in decimals and ticks in binary fractions of a second meet within less than a millionth of a tick.
            Self::Time(time_s) => Due::Tick((time_s / info.tick_s - 1e-6).ceil().max(0.0) as u64),
            Self::Line(line) => {
                let behind = info.blocks.iter().filter(|block| block.line >= line);
                // The first of its blocks: a line may be driven more than once.
                let first = behind.min_by_key(|block| block.line);
                first.map_or(Due::Never, |block| Due::Position(block.start_mm))
            }
        }
    }
}

impl Due {
    /// Whether a run is there before the tick `tick`, `s_mm` along the path.
    #[must_use]
    pub fn is_reached(self, tick: u64, s_mm: f64) -> bool {
        match self {
            Self::Tick(at) => at <= tick,
            Self::Position(at_mm) => at_mm <= s_mm + ROUNDING_MM,
            Self::Never => false,
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

    /// When each of them is due in a run of `info`.
    pub(super) fn due(&self, info: &RunInfo) -> Vec<Due> {
        self.0.iter().map(|timed| timed.when.due(info)).collect()
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
        "found `{0}`, expected WHEN:COMMAND such as 2000:hold (before a tick), 1.5s:hold or N50:hold (line 50 of the file)"
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
    use crate::trace::TracedBlock;

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
        let when = "expected WHEN:COMMAND such as 2000:hold (before a tick), 1.5s:hold or N50:hold (line 50 of the file)";
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
        let block = |line: u32, start_mm: f64| TracedBlock { line, start_mm, ..TracedBlock::default() };
        // A subroutine on lines 2 and 3 that is called twice, another one on line 6, and the main program from line 8 on.
        let blocks = vec![
            block(2, 0.0),
            block(3, 10.0),
            block(9, 20.0),
            block(2, 30.0),
            block(3, 40.0),
            block(6, 50.0),
        ];
        let info = RunInfo { tick_s: 5e-4, blocks, ..RunInfo::default() };
        let due = |when: &str| when.parse::<When>().expect(when).due(&info);
        assert_eq!(due("7"), Due::Tick(7));
        // 600 · 0.0005 is a little less than 0.3 in binary.
        assert_eq!((due("0.3s"), due("0.3001s"), due("0s")), (Due::Tick(600), Due::Tick(601), Due::Tick(0)));
        assert_eq!(
            (due("N3"), due("N6"), due("N9")),
            (Due::Position(10.0), Due::Position(50.0), Due::Position(20.0))
        );
        // Lines without motion, and one behind the last.
        assert_eq!(
            (due("N5"), due("N8"), due("N10")),
            (Due::Position(50.0), Due::Position(20.0), Due::Never)
        );
        assert!(!due("7").is_reached(6, 1e9) && due("7").is_reached(7, 0.0));
        assert!(
            !due("N3").is_reached(9, 9.99) && due("N3").is_reached(9, 10.0) && !due("N10").is_reached(9, 1e9)
        );
    }
}
