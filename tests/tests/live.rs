//! Live control: whatever is commanded whenever, every tick keeps every limit, the path and its ends.

#[allow(dead_code, reason = "each test takes what it needs of the shared checks")]
mod check;

use check::bounds::Number;
use check::live::{Command, Run, Seen, execute};
use check::path::Path;
use check::program::Generated;
use check::random::Random;
use check::totals::Totals;
use check::{drive, machine, program};
use motion_host::machine::Machine;
use motion_host::planning::{Mode, Plan};
use motion_kernel::live::State;
use motion_kernel::num::Fixed;

/// A machine, a program for it and its plan; none where planning refuses it or it is long.
struct Case {
    machine: Machine,
    path: Path,
    plan: Plan,
}

impl Case {
    fn random(seed: u64, longest_ticks: f64) -> Option<Self> {
        let mut random = Random::new(seed);
        let machine = machine::any(&mut random);
        let fragments = 1 + random.below(8);
        let program = program::generate(&mut random, fragments, machine.path.feed_mm_s);
        Self::of(&program, machine, longest_ticks)
    }

    fn of(program: &Generated, machine: Machine, longest_ticks: f64) -> Option<Self> {
        let path = Path::new(program, &machine);
        let plan = drive::plan(&program.text, &machine, Mode::Spanning, &mut Totals::default()).ok()??;
        let is_short = plan.time_s / machine.tick_s <= longest_ticks;
        (!path.is_ambiguous && is_short && plan.length_mm > 0.0).then_some(Self { machine, path, plan })
    }

    fn run<R: Number>(
        &self,
        seed: u64,
        most_override: f64,
        script: &mut dyn FnMut(&Seen<'_, R>) -> Option<Command>,
    ) -> Result<Run, String> {
        execute::<R>(&self.plan, &self.path, &self.machine, most_override, seed, script)
    }
}

#[test]
fn without_commands_it_is_the_plan() {
    let (mut ran, mut replanned) = (0, 0);
    for seed in 1..400 {
        let Some(case) = Case::random(seed, 20_000.0) else { continue };
        let run =
            case.run::<f64>(seed, 1.0, &mut |_| None).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let planned = case.plan.time_s / case.machine.tick_s;
        let more = run.ticks as f64 - planned - case.path.stops as f64;
        if more > 1.001 {
            replanned += 1;
            println!("{seed}: {} ticks, planned {planned:.1}, starved {}", run.ticks, run.starvations);
        }
        assert!(more > -1.001, "seed {seed}: {} ticks, planned {planned}", run.ticks);
        ran += 1;
    }
    println!("{ran} programs, {replanned} with more path to stop on than the queue holds");
    assert!(ran > 100 && replanned < ran / 4, "{replanned} of {ran}");
}

/// Any command before any tick.
fn random_commands(seed: u64) -> Option<Result<Run, String>> {
    let case = Case::random(seed, 3_000.0)?;
    let mut random = Random::new(seed ^ 0xC0_FFEE);
    let often = random.log_between(2e-3, 0.5);
    let most = if random.chance(0.5) { 1.0 } else { 2.0 };
    let mut decide = |state: State| {
        if !random.chance(often) {
            return None;
        }
        Some(match random.below(8) {
            0..=2 if state == State::Running => Command::Hold,
            0..=4 => Command::Resume,
            5 => Command::Override(1.0),
            6 if random.chance(0.1) => Command::Override(0.0),
            _ => Command::Override(random.between(0.05, most)),
        })
    };
    // In the end everything is let go.
    let let_go = 60_000;
    let mut step = |ticks: u64, state: State| match ticks {
        ..60_000 => decide(state),
        ticks if ticks == let_go => Some(Command::Override(1.0)),
        _ => Some(Command::Resume),
    };
    Some(match seed % 3 {
        0 => case.run::<f32>(seed, most, &mut |seen| step(seen.ticks, seen.state)),
        1 => case.run::<f64>(seed, most, &mut |seen| step(seen.ticks, seen.state)),
        _ => case.run::<Fixed>(seed, most, &mut |seen| step(seen.ticks, seen.state)),
    })
}

#[test]
fn any_command_at_any_tick_is_legal() {
    let mut totals = Totals::default();
    let (mut ran, mut failures) = (0, Vec::new());
    let first = check::from_env("MOTION_TEST_SEED").unwrap_or(1);
    let programs = check::from_env("MOTION_TEST_PROGRAMS").unwrap_or(400);
    for seed in first..first + programs {
        match random_commands(seed) {
            None => {}
            Some(Ok(run)) => {
                totals.add(&run.totals);
                ran += 1;
            }
            // Fixed point's range has tests of its own.
            Some(Err(error)) if error.contains("the kernel's number type") => {}
            Some(Err(error)) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}")),
        }
    }
    println!("{ran} runs, {totals}");
    let shown: Vec<_> = failures.iter().take(200).map(String::as_str).collect();
    assert!(
        failures.is_empty(),
        "{} of {} failed:\n{}",
        failures.len(),
        ran + failures.len(),
        shown.join("\n")
    );
}

/// Held before every tick of a program that has all that a ramp can be in, and let go again: each time legal, at the
/// same end, and not slower than the stop and the start of it cost.
#[test]
fn held_before_every_tick() {
    let mm = |mm: f64| (mm * check::geometry::UNITS_PER_MM).round() as i64;
    // A corner of a millimetre at less than the feed before and behind it.
    let points = [[12.0, 0.0], [12.9, 0.02], [14.0, 0.05], [30.0, 0.5]].map(|[x, y]| [mm(x), mm(y), 0]);
    let program = program::lines(&points, 2400.0);
    let case = Case::of(&program, Machine::reference(), 10_000.0).expect("a short program");
    let ticks = case.run::<f64>(0, 1.0, &mut |_| None).expect("a run").ticks;
    let every = check::from_env("MOTION_TEST_EVERY").unwrap_or(7);
    let (mut slowest, mut longest_stop) = (0, 0);
    for at in (0..ticks).step_by(every as usize) {
        let mut held_at = None;
        let mut script = |ticks: u64, state: State| {
            if ticks == at {
                return Some(Command::Hold);
            }
            if state == State::Held && held_at.is_none() {
                held_at = Some(ticks);
                return Some(Command::Resume);
            }
            None
        };
        let run = match at % 3 {
            0 => case.run::<f32>(at, 1.0, &mut |seen| script(seen.ticks, seen.state)),
            1 => case.run::<f64>(at, 1.0, &mut |seen| script(seen.ticks, seen.state)),
            _ => case.run::<Fixed>(at, 1.0, &mut |seen| script(seen.ticks, seen.state)),
        };
        let run = run.unwrap_or_else(|error| panic!("held before tick {at}: {error}"));
        assert_eq!(run.state, State::Done, "held before tick {at}");
        let held = held_at.unwrap_or_else(|| panic!("held before tick {at}, never at rest"));
        longest_stop = longest_stop.max(held - at);
        slowest = slowest.max(run.ticks - ticks);
    }
    println!("{ticks} ticks; the longest stop took {longest_stop} ticks, the slowest run {slowest} more");
    // From 40 mm/s: a ramp given up at its half, 3 t1/2, and a ramp to rest; as much again to start.
    assert!(longest_stop < 900, "{longest_stop}");
}
