//! Every tick of a board in a trace file, or those around a trigger.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;

use super::error::{CliError, Outcome};
use super::outputs::{self, Written};
use super::port::PortArguments;
use super::trace::{AXIS_COLUMNS, Selection, TraceWriter};
use crate::board::scope::{Scope, ScopeSummary, Ticks};
use crate::board::{BoardError, Connection, parameters};
use crate::files::{Failure, Files, OutputFile};
use crate::simulate::RunInfo;
use crate::simulate::run::state_names;
use crate::trace::TraceRow;

/// The last ticks come within this time.
const LATE: Duration = Duration::from_secs(1);

/// What is to be written of every tick.
#[derive(Clone, Debug, Args)]
pub(super) struct ScopeArguments {
    /// Write every tick of the board to this file, one row each, as `motion run --trace` does; an existing file is replaced.
    #[arg(long, value_name = "FILE")]
    scope: Option<PathBuf>,
    /// Write only ticks around those where this is true: COLUMN>VALUE or COLUMN<VALUE for the magnitude in a column of
    /// the file, such as `X_err_um>50`, or `err_um>50` for any axis; or state=NAME.
    #[arg(long, value_name = "CONDITION", requires = "scope")]
    trigger: Option<Condition>,
    /// So many ticks before them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    before: usize,
    /// So many ticks after them.
    #[arg(long, value_name = "TICKS", requires = "trigger", default_value_t = 1000)]
    after: usize,
}

/// A condition of a tick.
#[derive(Clone, Debug, PartialEq)]
struct Condition {
    /// As it was given.
    text: String,
    quantity: Quantity,
    is: Is,
}

#[derive(Clone, Debug, PartialEq)]
enum Quantity {
    State,
    Path(PathQuantity),
    /// Of the axis with that name, or of any: one of its columns.
    Axis(Option<String>, usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PathQuantity {
    S,
    V,
    A,
    J,
    Line,
}

#[derive(Clone, Debug, PartialEq)]
enum Is {
    Above(f64),
    Below(f64),
    Named(String),
}

impl Quantity {
    /// That of a column of a trace file.
    fn of(column: &str) -> Option<Self> {
        let of_axis = |word: &str| AXIS_COLUMNS.iter().position(|column| column.quantity == word);
        Some(match column {
            "state" => Self::State,
            "s_mm" => Self::Path(PathQuantity::S),
            "v_mm_s" => Self::Path(PathQuantity::V),
            "a_mm_s2" => Self::Path(PathQuantity::A),
            "j_mm_s3" => Self::Path(PathQuantity::J),
            "line" => Self::Path(PathQuantity::Line),
            _ => {
                let words: Vec<&str> = column.split('_').collect();
                let (at, quantity) =
                    words.iter().enumerate().rev().find_map(|(at, word)| Some((at, of_axis(word)?)))?;
                // With its unit behind.
                words.get(at + 1)?;
                Self::Axis((at > 0).then(|| words[..at].join("_")), quantity)
            }
        })
    }
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = || {
            format!(
                "found `{text}`, expected COLUMN>VALUE, COLUMN<VALUE or state=NAME with a column of the trace file"
            )
        };
        let at = text.find(['>', '<', '=']).ok_or_else(refused)?;
        let (column, rest) = (text[..at].trim(), text[at + 1..].trim());
        let quantity = Quantity::of(column).ok_or_else(refused)?;
        let number = || rest.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or_else(refused);
        let is = match (&quantity, &text[at..=at]) {
            (Quantity::State, "=") if state_names().contains(&rest) => Is::Named(rest.to_owned()),
            (Quantity::State, "=") => {
                return Err(format!(
                    "found `{text}`, expected state= and one of {}",
                    state_names().join(", ")
                ));
            }
            (Quantity::Path(_) | Quantity::Axis(..), ">") => Is::Above(number()?),
            (Quantity::Path(_) | Quantity::Axis(..), "<") => Is::Below(number()?),
            _ => return Err(refused()),
        };
        Ok(Self { text: text.to_owned(), quantity, is })
    }
}

impl Condition {
    /// Whether it holds in a tick of axes with these names.
    fn holds<const N: usize>(&self, row: &TraceRow<N>, names: &[String]) -> bool {
        let is = |value: f64| match self.is {
            Is::Above(limit) => value.abs() > limit,
            Is::Below(limit) => value.abs() < limit,
            Is::Named(_) => false,
        };
        match (&self.quantity, &self.is) {
            (Quantity::State, Is::Named(name)) => row.state == name,
            (Quantity::State, _) => false,
            (Quantity::Path(quantity), _) => is(match quantity {
                PathQuantity::S => row.s_mm,
                PathQuantity::V => row.v_mm_s,
                PathQuantity::A => row.a_mm_s2,
                PathQuantity::J => row.j_mm_s3,
                PathQuantity::Line => f64::from(row.line),
            }),
            (Quantity::Axis(axis, column), _) => names
                .iter()
                .zip(&row.axes)
                .filter(|(name, _)| axis.as_ref().is_none_or(|axis| axis == *name))
                .any(|(_, tick)| AXIS_COLUMNS.get(*column).is_some_and(|column| is((column.of)(tick)))),
        }
    }

    /// Whether there is an axis of its name.
    fn suits(&self, names: &[String]) -> bool {
        match &self.quantity {
            Quantity::Axis(Some(axis), _) => names.contains(axis),
            _ => true,
        }
    }
}

/// The file being written.
struct ScopeFile<W: Write, const N: usize> {
    trace: TraceWriter<W>,
    names: Vec<String>,
    trigger: Option<Condition>,
    before: usize,
    after: usize,
    /// The latest ticks that were not written.
    waiting: VecDeque<TraceRow<N>>,
    /// So many more ticks are to be written.
    left: usize,
    /// How often the condition became true.
    triggers: u64,
}

impl<W: Write, const N: usize> ScopeFile<W, N> {
    fn add(&mut self, row: &TraceRow<N>) {
        let Some(trigger) = &self.trigger else { return self.trace.add(row) };
        if trigger.holds(row, &self.names) {
            self.triggers += u64::from(self.left == 0);
            // This one, and those after it.
            self.left = self.after + 1;
            self.waiting.drain(..).for_each(|row| self.trace.add(&row));
        }
        if self.left > 0 {
            self.left -= 1;
            return self.trace.add(row);
        }
        self.waiting.push_back(*row);
        if self.waiting.len() > self.before {
            self.waiting.pop_front();
        }
    }
}

/// A scope under way, and its file.
pub(super) struct Scoped<const N: usize> {
    file: Arc<Mutex<ScopeFile<OutputFile, N>>>,
    name: String,
    failure: Failure,
}

impl ScopeArguments {
    /// Starts the scope, if it is asked for, before the first item is sent. No file of `inputs` is replaced. `info` names the board's axes.
    ///
    /// # Errors
    /// The file can't be written, there is no axis of the trigger's name, or the board does not answer.
    pub(super) fn start<const N: usize>(
        &self,
        inputs: &[(&'static str, Option<&Path>)],
        info: &RunInfo,
        port: &PortArguments,
        connection: &mut Connection<N>,
    ) -> Result<Option<Scoped<N>>, CliError> {
        let mut files = Files::reading(inputs.iter().copied());
        let Some(output) = outputs::open(&mut files, "--scope", self.scope.as_ref())? else {
            return Ok(None);
        };
        let names: Vec<String> = info.axes.iter().map(|axis| axis.name.clone()).collect();
        if let Some(trigger) = self.trigger.as_ref().filter(|trigger| !trigger.suits(&names)) {
            let found = format!("--trigger {}", trigger.text);
            return Err(CliError::Arguments { found, expected: "an axis of the machine" });
        }
        let refused = |error: BoardError| port.refused(error);
        let record = parameters::read(connection).map_err(refused)?;
        let (name, failure) = (output.name().to_owned(), output.failure());
        let file = Arc::new(Mutex::new(ScopeFile {
            trace: TraceWriter::new(output, info, Selection::all(info)),
            names,
            trigger: self.trigger.clone(),
            before: self.before,
            after: self.after,
            waiting: VecDeque::new(),
            left: 0,
            triggers: 0,
        }));
        let shared = Arc::clone(&file);
        let sink = Box::new(move |told: Ticks<'_, N>| {
            if let Ticks::Row(row) = told {
                lock(&shared).add(row);
            }
        });
        let identity = connection.identity().copied().ok_or_else(|| refused(BoardError::Silent))?;
        let scope = Scope::start(&identity, &record, sink).map_err(|error| refused(error.into()))?;
        connection.set_scope(scope);
        Ok(Some(Scoped { file, name, failure }))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked has said so.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<const N: usize> Scoped<N> {
    /// Ends the scope, once it has come as far as the board has told: writes the file, and says what is in it unless `is_quiet`. `outcome` is that of the command, which fails
    /// where a tick differed.
    pub(super) fn finish(
        self,
        connection: &mut Connection<N>,
        is_quiet: bool,
        outcome: Outcome,
        out: &mut dyn Write,
    ) -> Result<Outcome, CliError> {
        let (begin, until) = (Instant::now(), connection.status().map(|status| status.tick));
        let is_behind = |connection: &Connection<N>| {
            // Numbers wrap.
            let is_before = |last: u64, tick: u32| (last as u32).wrapping_sub(tick).cast_signed() < 0;
            let last = connection.scope().filter(|scope| !scope.has_failed()).map(Scope::last);
            last.zip(until).is_some_and(|(last, tick)| is_before(last, tick))
        };
        while is_behind(connection) && !connection.is_lost() && begin.elapsed() < LATE {
            connection.step(Duration::from_millis(5), &mut |_| {});
        }
        let summary = connection.end_scope().unwrap_or_default();
        let file = Arc::into_inner(self.file).expect("the thread has ended");
        let ScopeFile { trace, triggers, trigger, .. } =
            file.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut written = Written::default();
        let done = trace.finish().map_err(|source| self.failure.of(source));
        written.add("scope", self.name, done.and_then(OutputFile::commit));
        if !is_quiet {
            told(&summary, trigger.is_some().then_some(triggers), out).map_err(CliError::Output)?;
            written.say(out)?;
        }
        if is_quiet {
            let line = json(&summary, trigger.is_some().then_some(triggers));
            writeln!(out, "{line}").map_err(CliError::Output)?;
        }
        let outcome = match summary.error {
            Some(error) => {
                if !is_quiet {
                    writeln!(out, "  scope: {error}").map_err(CliError::Output)?;
                }
                Outcome::Failed
            }
            None => outcome,
        };
        written.outcome(outcome)
    }
}

/// What a scope has come to, for scripts.
fn json(summary: &ScopeSummary, triggers: Option<u64>) -> serde_json::Value {
    serde_json::json!({ "scope": {
        "ticks": summary.ticks,
        "missing": summary.missing(),
        "gaps": summary.gaps,
        "bytes": summary.bytes,
        "is_foreign": summary.is_foreign,
        "triggered": triggers,
        "error": summary.error.as_ref().map(ToString::to_string),
    } })
}

/// What a scope has come to, in words.
fn told(summary: &ScopeSummary, triggers: Option<u64>, out: &mut dyn Write) -> io::Result<()> {
    let ScopeSummary { ticks, gaps, bytes, is_foreign, .. } = summary;
    let of_tick = if *ticks > 0 { *bytes as f64 / *ticks as f64 } else { 0.0 };
    writeln!(out, "  scope: {ticks} ticks, {} missing, {of_tick:.1} bytes a tick", summary.missing())?;
    for (first, last) in gaps {
        writeln!(out, "  scope: ticks {first} to {last} are missing")?;
    }
    if *is_foreign {
        writeln!(out, "  scope: some of these followed items that were sent by somebody else")?;
    }
    if let Some(triggers) = triggers {
        writeln!(out, "  scope: triggered {triggers} times")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::trace::AxisTick;

    fn row(tick: u64, err_um: f64, state: &'static str) -> TraceRow<3> {
        let axes = [AxisTick { err_um, ..AxisTick::default() }, AxisTick::default(), AxisTick::default()];
        TraceRow {
            tick,
            s_mm: 0.0,
            v_mm_s: -3.0,
            a_mm_s2: 0.0,
            j_mm_s3: 0.0,
            snap_mm_s4: 0.0,
            state,
            line: 7,
            contour_um: 0.0,
            axes,
        }
    }

    #[test]
    fn conditions_are_of_columns() {
        let names = ["X", "Y_left", "Z"].map(str::to_owned);
        let holds = |text: &str| text.parse::<Condition>().map(|is| is.holds(&row(0, -51.0, "held"), &names));
        for (text, expected) in [
            ("X_err_um>50", true),
            ("X_err_um>51", false),
            ("err_um>50", true),
            ("Z_err_um>50", false),
            ("Y_left_err_um < 1", true),
            ("v_mm_s>2.5", true),
            ("line>7", false),
            ("state=held", true),
            ("state=fault", false),
        ] {
            assert_eq!(holds(text), Ok(expected), "{text}");
        }
        for text in
            ["", "X_err_um", "X_err_um=3", "err>3", "X_err_um>much", "X_err_um>NaN", "state>1", "speed>1"]
        {
            let error = text.parse::<Condition>().expect_err(text);
            assert!(error.starts_with(&format!("found `{text}`, expected COLUMN>VALUE")), "{error}");
        }
        assert!(!"A_err_um>1".parse::<Condition>().expect("a condition").suits(&names));
    }

    /// Ticks 40 and 43 are over the limit: from two before the first one to three after the second.
    #[test]
    fn a_trigger_writes_ticks_before_and_after() {
        let info = RunInfo::of_machine(&Machine::reference());
        let mut file = ScopeFile::<_, 3> {
            trace: TraceWriter::new(Vec::new(), &info, Selection::all(&info)),
            names: vec!["X".to_owned(), "Y".to_owned(), "Z".to_owned()],
            trigger: Some("X_err_um>50".parse().expect("a condition")),
            before: 2,
            after: 3,
            waiting: VecDeque::new(),
            left: 0,
            triggers: 0,
        };
        (0..100).for_each(|tick| {
            file.add(&row(tick, if matches!(tick, 40 | 43) { 60.0 } else { 1.0 }, "moving"))
        });
        let text = String::from_utf8(file.trace.finish().expect("memory")).expect("UTF-8");
        let ticks: Vec<&str> = text.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
        assert_eq!(ticks, ["38", "39", "40", "41", "42", "43", "44", "45", "46"]);
    }
}
