//! Live control: whatever is commanded whenever, every tick keeps every limit, the path and its ends.
//!
//! - here: without commands, and with any at random;
//! - `holds`: held before every tick;
//! - `overrides`: overrides that keep changing, against the feed and the time that they ask for;
//! - `stalls`: a background that is late, and items that are;
//! - `stops`: how long a stop takes;
//! - `single_block`: rests at the ends of blocks;
//! - `seam`: what the feeder of feed lists refuses.
//!
//! `MOTION_TEST_SEED` is the first seed, `MOTION_TEST_PROGRAMS` how many.

mod holds;
mod overrides;
mod seam;
mod single_block;
mod stalls;
mod stops;

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode, Plan};
use motion_kernel::exec::ExecState;
use motion_kernel::law::Pulse;
use motion_kernel::live::State;
use motion_kernel::num::Fixed;
use motion_tests::check::bounds::Number;
use motion_tests::check::live::{Command, Run, Setup, TickView, execute, execute_from};
use motion_tests::check::path::Path;
use motion_tests::check::program::{Asked, Generated};
use motion_tests::check::totals::Totals;
use motion_tests::check::{drive, geometry, machine, program};
use motion_tests::random::Random;
use stalls::{Late, Stalls};

/// A machine, a program for it and its plan; none where planning refuses it or it is long.
struct Case {
    machine: Machine,
    path: Path,
    plan: Plan,
}

impl Case {
    fn random(seed: u64, longest_ticks: f64) -> Option<Self> {
        Self::with(seed, None, longest_ticks)
    }

    /// With this law instead of the one that the seed draws.
    fn with(seed: u64, pulse: Option<Pulse>, longest_ticks: f64) -> Option<Self> {
        let (machine, program) = generated(&mut Random::new(seed), pulse);
        Self::of(&program, machine, longest_ticks)
    }

    fn of(program: &Generated, machine: Machine, longest_ticks: f64) -> Option<Self> {
        let path = Path::new(program, &machine);
        let plan = planned(&program.text, &machine, longest_ticks)?;
        (!path.is_ambiguous).then_some(Self { machine, path, plan })
    }

    /// A random program whose corners are blended, if any of them is worth it. The path is that of a kernel of numbers
    /// `R`.
    fn blended<R: Number>(seed: u64, pulse: Option<Pulse>, longest_ticks: f64) -> Option<Self> {
        let mut random = Random::new(seed);
        let (machine, program) = generated(&mut random, pulse);
        let tolerance_mm = random.log(1e-3, 0.5);
        let text = program.text.replace("G61", &format!("G64 P{tolerance_mm:.6}"));
        let plan = planned(&text, &machine, longest_ticks)?;
        if !plan.blocks.iter().any(|block| block.kind == "blend") {
            return None;
        }
        Self::compiled::<R>(plan, machine)
    }

    /// A plan whose path is that of a kernel of numbers `R`.
    fn compiled<R: Number>(plan: Plan, machine: Machine) -> Option<Self> {
        let path = Path::compiled(&plan, &Executable::new::<R>(&plan).ok()?);
        Some(Self { machine, path, plan })
    }

    fn run<R: Number>(
        &self,
        seed: u64,
        script: &mut dyn FnMut(&TickView<'_, R>) -> Option<Command>,
    ) -> Result<Run, String> {
        execute::<R>(&self.setup(seed), script)
    }

    fn setup(&self, seed: u64) -> Setup<'_> {
        let (plan, path, machine) = (&self.plan, &self.path, &self.machine);
        let (limits, feed_mm_s) = overrides::least_limits(plan);
        let response_s = overrides::response_s(feed_mm_s, &limits, machine.tick_s);
        Setup { plan, path, machine, seed, response_ticks: (response_s / machine.tick_s).ceil() as u64 }
    }
}

/// Any machine, and a program of a few fragments for it.
fn generated(random: &mut Random, pulse: Option<Pulse>) -> (Machine, Generated) {
    let mut machine = machine::any(random);
    machine.path.pulse = pulse.unwrap_or(machine.path.pulse);
    let fragments = 1 + random.below(8);
    let program = program::generate(random, fragments, machine.path.feed_mm_s);
    (machine, program)
}

fn planned(text: &str, machine: &Machine, longest_ticks: f64) -> Option<Plan> {
    let plan = drive::plan(text, machine, Mode::Spanning, &mut Totals::default()).ok()??;
    (plan.time_s / machine.tick_s <= longest_ticks && plan.length_mm > 0.0).then_some(plan)
}

/// The seeds of a test that has `programs` of them in its short form.
fn seeds(programs: u64) -> std::ops::Range<u64> {
    let first = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(1);
    first..first + motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(programs)
}

/// Whether a run failed for fixed point's range alone, which has tests of its own.
fn is_out_of_range(error: &str) -> bool {
    error.contains("the kernel's number type")
}

/// Runs of many seeds: what they come to, and what failed.
#[derive(Default)]
struct Runs {
    ran: u64,
    blended: u64,
    commands: u64,
    starvations: u64,
    rests: u64,
    totals: Totals,
    failures: Vec<String>,
}

impl Runs {
    fn add(&mut self, seed: u64, run: Result<Run, String>) {
        match run {
            Ok(run) => {
                self.ran += 1;
                self.commands += run.commands;
                self.starvations += u64::from(run.starvations);
                self.rests += run.rests;
                self.totals.add(&run.totals);
            }
            Err(error) if is_out_of_range(&error) => {}
            Err(error) => self.failures.push(format!("MOTION_TEST_SEED={seed}: {error}")),
        }
    }

    fn print_and_assert(&self) {
        println!(
            "{} runs, {} of them with blends, {} commands, {} rests, {} stops for want of data; {}",
            self.ran, self.blended, self.commands, self.rests, self.starvations, self.totals
        );
        let shown: Vec<_> = self.failures.iter().take(200).map(String::as_str).collect();
        assert!(shown.is_empty(), "{} failed:\n{}", self.failures.len(), shown.join("\n"));
    }
}

#[test]
fn without_commands_it_is_the_plan() {
    let (mut ran, mut replanned) = (0, 0);
    for seed in 1..400 {
        let Some(case) = Case::random(seed, 20_000.0) else { continue };
        let run = case.run::<f64>(seed, &mut |_| None).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
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

/// Any command before any tick; a background that is late for some, and items that are for some.
fn random_commands<R: Number>(case: &Case, seed: u64) -> Result<Run, String> {
    let mut random = Random::new(seed ^ 0xC0_FFEE);
    let often = random.log(2e-3, 0.5);
    let most = if random.chance(0.5) { 1.0 } else { 2.0 };
    let (is_late, has_late_items) = (random.chance(0.3), random.chance(0.3));
    let is_given_up = random.chance(0.1);
    let mut late = 0_u64;
    let mut decide = |state: State| {
        late = late.saturating_sub(1);
        if late > 0 {
            return Some(Command::Stall);
        }
        if !random.chance(often) {
            return None;
        }
        Some(match random.below(8) {
            0..=2 if matches!(state, State::Running | State::Waiting) => Command::Hold,
            0..=3 => Command::Resume,
            4 if is_late => {
                late = random.log(1.0, 1000.0) as u64;
                Command::Stall
            }
            4 if is_given_up && random.chance(0.01) => Command::Abort,
            4 => Command::Resume,
            5 => Command::Override(1.0),
            6 if random.chance(0.1) => Command::Override(0.0),
            _ => Command::Override(random.between(0.05, most)),
        })
    };
    // In the end everything is let go.
    let let_go = 60_000;
    let executable = Executable::new::<R>(&case.plan).map_err(|error| error.to_string())?;
    let stalls = Stalls::new(seed, has_late_items.then_some((1e-3, 0.1)));
    let source = Late { items: executable.supplied(), stalls: &stalls };
    execute_from::<R, _>(&case.setup(seed), source, &mut |seen| {
        stalls.tick(seen.executed.state);
        match seen.ticks {
            ..60_000 => decide(seen.state),
            ticks if ticks == let_go => Some(Command::Override(1.0)),
            _ => Some(Command::Resume),
        }
    })
}

/// What long forms have found: a ramp given up early that asked for a rounding too much, a stop that fixed point does not
/// hold, the feed of a stretch that was lost because the one before it had hardly begun, a blend of which the pieces bend more
/// than itself, a helix that was as slow as tiny blends before it, and an override that was not obeyed on chords whose limits
/// hardly differ. All with sin² pulses; each seed is driven with either law.
const FOUND: [u64; 6] = [201_515, 8_012_480, 20_035_463, 50_019_280, 60_024_445, 100_006_472];

/// The long form gives a million commands.
#[test]
fn any_command_at_any_tick_is_legal() {
    let mut runs = Runs::default();
    let found = motion_tests::PULSES.map(|pulse| FOUND.map(|seed| (seed, Some(pulse))));
    for (seed, pulse) in found.into_iter().flatten().chain(seeds(400).map(|seed| (seed, None))) {
        // A third of the programs with blends, where they are worth it.
        let is_blended = seed % 9 >= 6;
        let longest_ticks = 3_000.0;
        let case = match seed % 9 {
            6 => Case::blended::<f32>(seed, pulse, longest_ticks),
            7 => Case::blended::<f64>(seed, pulse, longest_ticks),
            8 => Case::blended::<Fixed>(seed, pulse, longest_ticks),
            _ => Case::with(seed, pulse, longest_ticks),
        };
        let Some(case) = case else { continue };
        runs.blended += u64::from(is_blended);
        let run = match seed % 3 {
            0 => random_commands::<f32>(&case, seed),
            1 => random_commands::<f64>(&case, seed),
            _ => random_commands::<Fixed>(&case, seed),
        };
        runs.add(seed, run);
    }
    runs.print_and_assert();
    assert!(runs.blended > 10 || runs.ran < 100, "{} with blends", runs.blended);
}

/// An abort comes to rest on the path, and nothing of the program is left.
#[test]
fn an_abort_ends_at_rest_on_the_path() {
    let (mut ran, mut early) = (0, 0);
    for seed in 1..200 {
        let Some(case) = Case::random(seed, 4_000.0) else { continue };
        let ticks = case.plan.time_s / case.machine.tick_s;
        let at = (Random::new(seed).unit() * ticks) as u64;
        let run = case.run::<f64>(seed, &mut |seen| (seen.ticks == at).then_some(Command::Abort));
        let run = run.unwrap_or_else(|error| panic!("MOTION_TEST_SEED={seed}: {error}"));
        assert_eq!(run.state, State::Aborted, "seed {seed}");
        assert!(run.ticks >= at, "seed {seed}");
        // Most of them are given up on the way.
        early += usize::from(run.s_mm < case.plan.length_mm - 1e-6);
        ran += 1;
    }
    assert!(ran > 60 && early > ran / 2, "{early} of {ran}");
}

/// Held in a dwell, motion does not continue after it, whatever the list under way holds, until it is told to; nor with an
/// override of 0, nor when it is to be given up.
#[test]
fn held_in_a_dwell_it_stays() {
    let line = |x: f64| {
        Asked::Move(geometry::Move {
            from: [((x - 5.0) * geometry::UNITS_PER_MM).round() as i64, 0, 0],
            to: [(x * geometry::UNITS_PER_MM).round() as i64, 0, 0],
            arc: None,
            feed_mm_min: 1200.0,
        })
    };
    let text = "G61 G1 X5 F1200\nG4 P0.5\nX10\nG4 P0.5\nX15\n".to_owned();
    let asked = vec![line(5.0), Asked::Dwell(0.5), line(10.0), Asked::Dwell(0.5), line(15.0)];
    let case = Case::of(&Generated { text, asked }, Machine::reference(), 20_000.0).expect("a program");
    for (stop, go) in [
        (Command::Hold, Some(Command::Resume)),
        (Command::Override(0.0), Some(Command::Override(1.0))),
        (Command::Abort, None),
    ] {
        let (mut dwelt, mut stopped_at, mut gone, mut moved) = (0, None, false, 0);
        let run = case.run::<f64>(0, &mut |seen| {
            dwelt += u64::from(seen.executed.state == ExecState::Dwell);
            match stopped_at {
                None if dwelt == 300 => {
                    stopped_at = Some(seen.ticks);
                    return Some(stop);
                }
                // 700 ticks of the dwell are left.
                Some(at) if seen.ticks < at + 4000 => {
                    moved += u64::from(seen.executed.state == ExecState::Moving);
                }
                Some(_) if !gone => {
                    gone = true;
                    return go;
                }
                _ => {}
            }
            None
        });
        let run = run.unwrap_or_else(|error| panic!("{stop:?}: {error}"));
        assert_eq!(moved, 0, "{stop:?}");
        let (state, end_mm) = if go.is_some() { (State::Done, 15.0) } else { (State::Aborted, 5.0) };
        assert_eq!(run.state, state, "{stop:?}");
        assert!((run.s_mm - end_mm).abs() < 1e-6, "{stop:?}: {} mm", run.s_mm);
    }
}
