//! The longest ticks, and the longest turns of live control's background, that a search over random programs and commands
//! finds.
//!
//! The search runs 1000 seeds of each kind, in 25 minutes on two idle cores, and prints the worst. Its worst seeds
//! are committed (`tests/expected/worst.txt`), and every run of the tests measures them again:
//!
//! ```text
//! MOTION_TEST_SEEDS=1000 cargo test --release -p motion-tests --test target the_longest -- --nocapture
//! MOTION_TEST_SEEDS=1000 MOTION_ACCEPT=1 …                                     commits the worst seeds
//! ```

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use motion_tests::figures::is_accepting;
use motion_tests::from_env;

use crate::programs::{self, Drives};
use crate::tools::{Board, Case, Clock, M4F, Tools, bundles};

/// What is searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kind {
    /// As the tables call it.
    pub(crate) name: &'static str,
    pub(crate) image: &'static str,
    features: &'static str,
    drives: Drives,
    /// With the blocks that live control plans with.
    pub(crate) is_live: bool,
    /// Instructions of a tick that are promised, on an M4F with f32: what was found and 5 %, or less.
    pub(crate) most: u32,
}

const PLAIN: Kind =
    Kind { name: "plain", image: "budget", features: "", drives: Drives::Any, is_live: false, most: 1500 };
const LIVE: Kind = Kind {
    name: "live control and guards",
    image: "live_interrupt",
    features: "watch",
    drives: Drives::Guarded,
    is_live: true,
    most: 1800,
};
/// Everything that is searched. Live control's background is stopped by ticks, as on a board.
pub(crate) const KINDS: [Kind; 5] = [
    PLAIN,
    Kind { name: "drives inverted", drives: Drives::Inverted, ..PLAIN },
    Kind { name: "guards", features: "live", drives: Drives::Guarded, most: 1620, ..PLAIN },
    LIVE,
    Kind { name: "live control and guards, drives inverted", drives: Drives::Inverted, most: 2050, ..LIVE },
];

/// Instructions of a turn of live control's background that are promised, on an M4F: what was found and 5 %.
pub(crate) const TURN: u32 = 2_480_000;

/// Seeds that are searched when nothing else is asked for, so that the search works when it is.
const FEW: u32 = 3;

/// Of each kind so many worst ticks, and as many worst turns, are kept.
const KEPT: usize = 2;

/// What a board counted of a program \[instructions\].
#[derive(Clone, Debug, Default)]
pub(crate) struct Counted {
    pub(crate) seed: u32,
    pub(crate) ticks: Vec<u32>,
    pub(crate) polls: Vec<u32>,
}

impl Counted {
    fn longest_tick(&self) -> u32 {
        self.ticks.iter().copied().max().unwrap_or_default()
    }

    fn longest_turn(&self) -> u32 {
        self.polls.iter().copied().max().unwrap_or_default()
    }
}

impl Kind {
    /// The board with the images that it needs.
    pub(crate) fn on(self, board: Board) -> Board {
        board.with(self.features)
    }

    fn case(self, seed: u32) -> Case {
        Case { seed, bytes: programs::searched(seed, self.drives, self.is_live) }
    }

    /// The cases of the committed worst seeds, that of the longest tick first.
    pub(crate) fn worst_cases(self) -> Result<Vec<Case>, String> {
        Ok(self.worst()?.into_iter().map(|seed| self.case(seed)).collect())
    }

    fn worst(self) -> Result<Vec<u32>, String> {
        let text =
            std::fs::read_to_string(path()).map_err(|error| format!("{}: {error}", path().display()))?;
        let seeds = text.lines().find_map(|line| line.strip_prefix(self.name)?.strip_prefix(": "));
        let seeds = seeds.and_then(|seeds| seeds.split(' ').map(|seed| seed.parse().ok()).collect());
        seeds.ok_or_else(|| format!("{}: no seeds of {}", path().display(), self.name))
    }
}

/// Runs seeds of a kind on a board, two emulators beside each other.
fn count(tools: &Tools, board: Board, kind: Kind, seeds: &[u32]) -> Result<Vec<Counted>, String> {
    let board = kind.on(board);
    let cases: Vec<_> = seeds.iter().map(|&seed| kind.case(seed)).collect();
    let left = Mutex::new(bundles(board, &cases));
    let found = Mutex::new(Vec::new());
    let work = || -> Result<(), String> {
        loop {
            let Some(bundle) = left.lock().map_err(|_| "a run panicked")?.pop() else { return Ok(()) };
            let counted = counted(&tools.run_anew(board, kind.image, &bundle, Clock::Counting)?, &bundle);
            found.lock().map_err(|_| "a run panicked")?.extend(counted);
        }
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(work);
        work()?;
        other.join().map_err(|_| "a run panicked".to_owned())?
    })?;
    let mut found = found.into_inner().map_err(|_| "a run panicked")?;
    found.sort_by_key(|counted: &Counted| counted.seed);
    if found.len() != seeds.len() {
        return Err(format!("{}: {} of {} seeds", kind.name, found.len(), seeds.len()));
    }
    Ok(found)
}

fn counted(printed: &str, bundle: &[Case]) -> Vec<Counted> {
    let mut found: Vec<Counted> = Vec::new();
    for line in printed.lines() {
        if line == "program" {
            let seed = bundle.get(found.len()).map_or(0, |case| case.seed);
            found.push(Counted { seed, ..Counted::default() });
        } else if let (Some(last), Some((name, Ok(figure)))) =
            (found.last_mut(), line.split_once(' ').map(|(name, figure)| (name, figure.parse())))
        {
            match name {
                "tick" => last.ticks.push(figure),
                "poll" => last.polls.push(figure),
                _ => {}
            }
        }
    }
    found
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("expected/worst.txt")
}

/// What the committed worst seeds of a kind take on a board.
pub(crate) fn of_the_worst(tools: &Tools, board: Board, kind: Kind) -> Result<Counted, String> {
    let mut all = Counted::default();
    for counted in count(tools, board, kind, &kind.worst()?)? {
        all.ticks.extend(counted.ticks);
        all.polls.extend(counted.polls);
    }
    all.ticks.sort_unstable();
    all.polls.sort_unstable();
    Ok(all)
}

/// The search, in its long form; in its short one, that committed and promised figures are those of the worst seeds.
pub(crate) fn the_longest_ticks_and_turns(tools: &Tools) -> Result<(), String> {
    let Some(seeds) = from_env("MOTION_TEST_SEEDS") else {
        return search(tools, FEW);
    };
    let seeds = u32::try_from(seeds).map_err(|error| error.to_string())?;
    search(tools, seeds)
}

/// Searches so many seeds on an M4F and prints the worst; commits them if it is told to, whatever they break.
fn search(tools: &Tools, seeds: u32) -> Result<(), String> {
    let is_long = seeds > FEW;
    let seeds: Vec<_> = (0..seeds).collect();
    let mut text = String::new();
    let mut broken = Vec::new();
    for kind in KINDS {
        let mut found = count(tools, M4F, kind, &seeds)?;
        let ticks = longest(&mut found, kind, "a tick", Counted::longest_tick);
        let mut kept = ticks.clone();
        let most = found[0].longest_tick();
        if most > kind.most {
            broken.push(format!("{}: {most} instructions, promised {}", kind.name, kind.most));
        }
        if kind.is_live {
            let turns = longest(&mut found, kind, "a turn", Counted::longest_turn);
            kept.extend(turns.into_iter().filter(|seed| !ticks.contains(seed)));
            let most = found[0].longest_turn();
            if most > TURN {
                broken.push(format!("{}: {most} instructions of a turn, promised {TURN}", kind.name));
            }
        }
        let kept: Vec<_> = kept.iter().map(u32::to_string).collect();
        let _ = writeln!(text, "{}: {}", kind.name, kept.join(" "));
    }
    print!("{text}");
    if is_accepting() && is_long {
        std::fs::write(path(), text).map_err(|error| format!("{}: {error}", path().display()))?;
    }
    if broken.is_empty() { Ok(()) } else { Err(broken.join("; ")) }
}

/// The seeds of the greatest figures; prints them.
fn longest(found: &mut [Counted], kind: Kind, what: &str, of: fn(&Counted) -> u32) -> Vec<u32> {
    found.sort_by_key(|counted| std::cmp::Reverse(of(counted)));
    let kept = &found[..found.len().min(KEPT)];
    for counted in kept {
        println!("{}: {} instructions of {what}, seed {}", kind.name, of(counted), counted.seed);
    }
    kept.iter().map(|counted| counted.seed).collect()
}
