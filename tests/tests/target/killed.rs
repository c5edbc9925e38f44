//! Senders that are killed: `motion send` in a process of its own drives programs on an emulated board, and is killed somewhere; so
//! is the board, now and then. `send --continue` or `resume`, in the next process, brings the program to its end.
//!
//! The process is this test's own executable, which is `motion` where [`COMMAND`] is set. When something is killed depends on
//! the machine's clock; what is judged does not: every told position is on the path, none goes on behind the place where motion
//! was told to be, and the end is exact.
//!
//! ```text
//! MOTION_TEST_KILLS=1000 cargo test -p motion-tests --test target a_sender_is_killed -- --nocapture
//! ```

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use motion_tests::from_env;
use motion_tests::random::Random;
use serde_json::Value;

use crate::linked::{Emulator, TIME_OUT, record, session};
use crate::programs;
use crate::tools::{Board, Bundle, Case, LINKED_BOARDS, Tools};

/// The variable by which a process of this executable knows that it is `motion`.
const COMMAND: &str = "MOTION_TEST_COMMAND";
/// As a thread of `motion` has.
const STACK_BYTES: usize = 16 << 20;
/// Kills by all boards together, unless `MOTION_TEST_KILLS` tells another number.
const KILLS: u64 = 50;
/// Ends are exact, and told in decimals [mm].
const END_MM: f64 = 1e-9;
/// In between, offsets along pieces of some millimetres are of f32 [mm].
const PATH_MM: f64 = 1e-6;
/// Programmed feed [mm/s].
const FEED_MM_S: f64 = 12.0;

/// Runs this process as `motion`, if it is one.
pub(crate) fn as_command() -> Option<ExitCode> {
    std::env::var_os(COMMAND)?;
    let main = thread::Builder::new().stack_size(STACK_BYTES).spawn(motion_host::cli::main);
    Some(main.ok().and_then(|main| main.join().ok()).unwrap_or(ExitCode::from(101)))
}

/// A way through points whose X grows, so that X tells how far motion is.
struct Way(Vec<[f64; 2]>);

impl Way {
    /// Some two to five seconds, with exact corners.
    fn random(random: &mut Random) -> Self {
        let thousandths = |mm: f64| (mm * 1e3).round() * 1e-3;
        let mut points = vec![[0.0; 2]];
        while points.last().is_some_and(|&[x, _]| x < 20.0) {
            let [x, _] = points[points.len() - 1];
            points.push([x + random.between(0.3, 3.0), random.between(-1.5, 1.5)].map(thousandths));
        }
        Self(points)
    }

    fn program(&self) -> String {
        let mut text = format!("G21 G90 G61 F{}\n", FEED_MM_S * 60.0);
        for [x, y] in &self.0 {
            // Cannot fail.
            let _ = writeln!(text, "G1 X{x:.3} Y{y:.3}");
        }
        text + "M2\n"
    }

    fn end_mm(&self) -> f64 {
        self.0.last().map_or(0.0, |&[x, _]| x)
    }

    /// The line that leads to the last point, and that of the way at a place, the later one at a point between two.
    fn last_line(&self) -> u64 {
        self.0.len() as u64 + 1
    }

    fn line_at(&self, x_mm: f64) -> u64 {
        let points = self.0.partition_point(|&[x, _]| x <= x_mm + PATH_MM);
        (points as u64 + 2).min(self.last_line())
    }

    /// How far a position is from the way [mm].
    fn off_mm(&self, [x, y]: [f64; 2]) -> f64 {
        let mut off = f64::INFINITY;
        for pair in self.0.windows(2) {
            let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
            let (dx, dy) = (x1 - x0, y1 - y0);
            let share = (((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
            off = off.min((x - x0 - share * dx).hypot(y - y0 - share * dy));
        }
        off
    }
}

/// A running `motion`, and its lines of JSON as they come.
struct Motion {
    process: Child,
    lines: Receiver<Value>,
    errors: thread::JoinHandle<String>,
    words: String,
}

/// How a command has ended, and what it told last.
struct Ended {
    status: Option<i32>,
    errors: String,
}

impl Motion {
    fn start(words: &[&str]) -> Result<Self, String> {
        let executable = std::env::current_exe().map_err(|error| error.to_string())?;
        let mut process = Command::new(executable)
            .args(words)
            .env(COMMAND, "1")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| error.to_string())?;
        let (Some(out), Some(mut error)) = (process.stdout.take(), process.stderr.take()) else {
            return Err("no pipes".to_owned());
        };
        let (told, lines) = channel();
        thread::spawn(move || {
            // A killed process may leave half a line.
            let texts = BufReader::new(out).lines().map_while(Result::ok);
            texts
                .filter_map(|text| serde_json::from_str(&text).ok())
                .take_while(|line: &Value| told.send(line.clone()).is_ok())
                .count()
        });
        let errors = thread::spawn(move || {
            let mut text = String::new();
            // What could be read is told.
            let _ = error.read_to_string(&mut text);
            text
        });
        Ok(Self { process, lines, errors, words: words.join(" ") })
    }

    /// Hands what it tells to `on_line` until it ends, or is killed after `kill_after`; whether it was, or how it ended.
    fn until(
        mut self,
        kill_after: Option<Duration>,
        on_line: &mut dyn FnMut(&Value) -> Result<(), String>,
    ) -> Result<Option<Ended>, String> {
        let since = Instant::now();
        let killed = loop {
            let left = kill_after.unwrap_or(TIME_OUT).saturating_sub(since.elapsed());
            match self.lines.recv_timeout(left) {
                Ok(line) => on_line(&line).map_err(|wrong| format!("{}: {wrong}: {line}", self.words))?,
                Err(RecvTimeoutError::Timeout) => break true,
                Err(RecvTimeoutError::Disconnected) => break false,
            }
        };
        if killed {
            // It may have ended by itself.
            let _ = self.process.kill();
        }
        let status = self.process.wait().map_err(|error| error.to_string())?;
        // What it told before it was killed.
        while let Ok(line) = self.lines.recv() {
            on_line(&line).map_err(|wrong| format!("{}: {wrong}: {line}", self.words))?;
        }
        let errors = self.errors.join().map_err(|_| "panicked".to_owned())?;
        match (killed, kill_after) {
            (true, Some(_)) => Ok(None),
            (true, None) => Err(format!("{} did not end: {errors}", self.words)),
            (false, _) => Ok(Some(Ended { status: status.code(), errors })),
        }
    }
}

/// What was seen of a program, by all processes that drove it.
struct Seen<'a> {
    way: &'a Way,
    /// Where it was told to be last.
    at_mm: f64,
    /// The last program line that it may go on at, in a process that tells where it does.
    until_line: u64,
    /// This process drives the program.
    is_begun: bool,
    /// All is driven.
    is_done: bool,
}

impl<'a> Seen<'a> {
    /// Before the program.
    fn new(way: &'a Way) -> Self {
        Self { way, at_mm: 0.0, until_line: 0, is_begun: false, is_done: false }
    }

    /// The next process goes on from `journal`: not behind the place that it was told last, where motion has been.
    fn resumes(&mut self, journal: &str) -> Result<(), String> {
        // Where there is none yet, nothing goes on.
        let Ok(text) = std::fs::read_to_string(journal) else { return Ok(()) };
        let record: Value = serde_json::from_str(&text).map_err(|error| format!("{journal}: {error}"))?;
        self.until_line = self.way.line_at(record["set_mm"][0].as_f64().unwrap_or(0.0));
        Ok(())
    }

    fn take(&mut self, line: &Value) -> Result<(), String> {
        if let Some((_, place)) = line["text"].as_str().and_then(|text| text.split_once(": goes on ")) {
            let begins = place.strip_prefix("at line ").map_or(Ok(u64::MAX), str::parse);
            let begins = begins.map_err(|error| error.to_string())?;
            // Behind the path, all of it is driven.
            if begins > self.until_line && (begins < u64::MAX || self.until_line < self.way.last_line()) {
                return Err(format!("it was in line {}: path is left out", self.until_line));
            }
        }
        self.is_done |= line["step"] == "done";
        let set = [&line["set_mm"][0], &line["set_mm"][1]].map(Value::as_f64);
        let ("program" | "done", [Some(x), Some(y)]) = (line["step"].as_str().unwrap_or_default(), set)
        else {
            return Ok(());
        };
        let off_mm = self.way.off_mm([x, y]);
        if off_mm > PATH_MM {
            return Err(format!("{off_mm} mm off the path"));
        }
        if self.is_begun && x < self.at_mm - PATH_MM {
            return Err(format!("behind {} mm: it goes back", self.at_mm));
        }
        (self.is_begun, self.at_mm) = (true, x);
        Ok(())
    }
}

/// What one board has gone through.
#[derive(Default)]
struct Tally {
    /// How often a sender was killed, and the board, too.
    kills: u64,
    boards: u64,
    /// How often each way to go on was taken.
    ways: BTreeMap<&'static str, u64>,
}

/// Kills until there are `kills`.
fn kills(tools: &Tools, board: Board, kills: u64) -> Result<Tally, String> {
    let mut random = Random::of_stream(u64::from(board.number == "fixed"));
    let record = record(&programs::live_stringer());
    let start = || {
        let bundle = Bundle::new(&[Case { seed: session(), bytes: record.clone() }])?;
        let mut emulator = Emulator::start(tools, board, &bundle)?;
        // A command does not wait for it.
        emulator.connect().map(|_| (emulator, bundle))
    };
    let mut running = start()?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    let [program, journal] =
        [path("part.ngc"), path("part.journal.json")].map(|path| path.display().to_string());
    let mut tally = Tally::default();
    while tally.kills < kills {
        let way = Way::random(&mut random);
        std::fs::write(&program, way.program()).map_err(|error| error.to_string())?;
        // That of the program before.
        let _ = std::fs::remove_file(&journal);
        let mut seen = Seen::new(&way);
        let mut how = "anew";
        loop {
            let port = format!("tcp:127.0.0.1:{}", running.0.port());
            let on_port = ["--port", &port, "--json"];
            let journal = journal.as_str();
            let anew = ["send", program.as_str(), "--journal", journal, "--restart", "--enable"];
            let resumed = ["resume", journal, "--yes", "--homed", "--enable"];
            let words = match how {
                "anew" => anew.to_vec(),
                "continued" => vec!["send", program.as_str(), "--journal", journal, "--continue"],
                _ => resumed.to_vec(),
            };
            let words: Vec<&str> = words.into_iter().chain(on_port).collect();
            *tally.ways.entry(how).or_default() += 1;
            if how == "anew" {
                seen = Seen::new(&way);
            }
            seen.is_begun = false;
            if how == "resumed" {
                seen.resumes(journal)?;
            }
            let kill_after = (tally.kills < kills && random.chance(0.7))
                .then(|| Duration::from_secs_f64(random.between(0.05, 3.0)));
            let ended = Motion::start(&words)?.until(kill_after, &mut |line| seen.take(line))?;
            match ended {
                None => {
                    tally.kills += 1;
                    let is_reset = random.chance(0.3);
                    if is_reset {
                        tally.boards += 1;
                        drop(running);
                        running = start()?;
                    }
                    how = if is_reset || random.chance(0.5) { "resumed" } else { "continued" };
                }
                Some(Ended { status: Some(0), .. }) => break,
                // Killed before the program had begun, or after its end.
                Some(Ended { status: Some(2), errors }) if is_nothing_left(&errors) && how != "anew" => {
                    if seen.is_done {
                        break;
                    }
                    how = "anew";
                }
                Some(Ended { status, errors }) => {
                    return Err(format!("{}: status {status:?}: {errors}", words.join(" ")));
                }
            }
        }
        let (at_mm, end_mm) = (seen.at_mm, way.end_mm());
        if (at_mm - end_mm).abs() > END_MM {
            return Err(format!("at {at_mm} mm, expected {end_mm}"));
        }
    }
    Ok(tally)
}

/// Whether a command says that there is no program to go on with.
fn is_nothing_left(errors: &str) -> bool {
    ["driven to its end", "nothing of this program", "No such file"]
        .iter()
        .any(|words| errors.contains(words))
}

pub(crate) fn a_sender_is_killed(tools: &Tools) -> Result<(), String> {
    let kills_of_each = from_env("MOTION_TEST_KILLS").unwrap_or(KILLS).div_ceil(LINKED_BOARDS.len() as u64);
    let tallies = thread::scope(|scope| {
        LINKED_BOARDS
            .map(|board| {
                scope.spawn(move || {
                    kills(tools, board, kills_of_each).map_err(|error| format!("{}: {error}", board.core))
                })
            })
            .map(|thread| thread.join().unwrap_or_else(|_| Err("panicked".to_owned())))
    });
    for (board, tally) in LINKED_BOARDS.into_iter().zip(tallies) {
        let Tally { kills, boards, ways } = tally?;
        println!(
            "{}, {}: {kills} kills, {boards} of them of the board, too; {ways:?}",
            board.core, board.number
        );
    }
    Ok(())
}
