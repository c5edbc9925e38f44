//! Single block: every program block ends at rest, exactly at its end, and none is left out; at any tick, among all other
//! commands, every tick keeps every limit.

use motion_kernel::live::State;
use motion_kernel::num::Fixed;

use super::{Case, generated, is_out_of_range, seeds};
use motion_tests::check::bounds::Number;
use motion_tests::check::live::{Command, Run, Setup, TickView, execute};
use motion_tests::check::path::Path;
use motion_tests::check::program::{Asked, Generated};
use motion_tests::check::totals::Totals;
use motion_tests::random::Random;

/// Ends of blocks are rounded to position steps of 2⁻³² mm, here and in the plan.
const END_MM: f64 = 1e-8;

/// Where a rest is: stretches done, and the path position in the next.
type Rest = (usize, f64);

/// A case with the ends of its blocks.
struct Blocks {
    case: Case,
    /// Where each block of the program ends.
    ends: Vec<Rest>,
}

impl Blocks {
    fn random(seed: u64, longest_ticks: f64) -> Option<Self> {
        let (machine, program) = generated(&mut Random::new(seed), None);
        let case = Case::of(&program, machine, longest_ticks)?;
        let ends = block_ends(&program, &case.path);
        Some(Self { case, ends })
    }

    /// A run in the number type of the seed; `script` sees ticks, state and place. None where the program is out of fixed
    /// point's range.
    fn run(&self, seed: u64, script: &mut dyn FnMut(u64, State, Rest) -> Option<Command>) -> Option<Run> {
        // Of the feed, the greatest override that was asked for is what holds: a rest at a block's end may be far.
        let setup = Setup { response_ticks: u64::MAX, ..self.case.setup(seed) };
        let run = match seed % 3 {
            0 => execute::<f32>(&setup, &mut |seen| script(seen.ticks, seen.state, rest_of(seen))),
            1 => execute::<f64>(&setup, &mut |seen| script(seen.ticks, seen.state, rest_of(seen))),
            _ => execute::<Fixed>(&setup, &mut |seen| script(seen.ticks, seen.state, rest_of(seen))),
        };
        match run {
            Ok(run) => Some(run),
            Err(error) if is_out_of_range(&error) => None,
            Err(error) => panic!("MOTION_TEST_SEED={seed}: {error}"),
        }
    }

    fn is_end(&self, rest: Rest) -> bool {
        self.ends.iter().any(|&end| is_at(rest, end))
    }

    /// Where the path of a stretch begins, from the program's start [mm].
    fn before_mm(&self, stretch: usize) -> f64 {
        self.case.path.stretches[..stretch].iter().map(|stretch| stretch.length_mm).sum()
    }
}

fn is_at((stretch, s_mm): Rest, end: Rest) -> bool {
    stretch == end.0 && (s_mm - end.1).abs() <= END_MM
}

fn block_ends(program: &Generated, path: &Path) -> Vec<Rest> {
    let mut moves = path.stretches.iter().enumerate().flat_map(|(index, stretch)| {
        stretch.moves.iter().map(move |placed| {
            let end_mm = placed.start_mm + placed.element.length_mm;
            let is_last = placed.block == stretch.moves[stretch.moves.len() - 1].block;
            if is_last { (index + 1, 0.0) } else { (index, end_mm) }
        })
    });
    let mut at = (0, 0.0);
    let end = |asked: &Asked| {
        if let Asked::Move(_) = asked {
            at = moves.next().expect("as many moves as are asked for");
        }
        at
    };
    program.asked.iter().map(end).collect()
}

fn rest_of<R: Number>(seen: &TickView<'_, R>) -> Rest {
    (seen.executed.stretches as usize, seen.executed.motion.s.to_mm())
}

#[test]
fn every_block_ends_at_rest() {
    let (mut ran, mut ends, mut starvations, mut totals) = (0, 0, 0, Totals::default());
    for seed in seeds(250) {
        let Some(blocks) = Blocks::random(seed, 3_000.0) else { continue };
        let mut rests: Vec<Rest> = Vec::new();
        let mut waited = 0_u64;
        let mut script = |ticks: u64, state: State, at: Rest| {
            if ticks == 0 {
                return Some(Command::SingleBlock(true));
            }
            if state != State::Held {
                waited = 0;
                return None;
            }
            // It stays until it is told to.
            waited += 1;
            (waited == 1 + seed % 3).then(|| {
                rests.push(at);
                Command::Resume
            })
        };
        let Some(run) = blocks.run(seed, &mut script) else { continue };
        assert_eq!(run.state, State::Done, "seed {seed}");
        let (last, waited_at) = blocks.ends.split_last().expect("a program has blocks");
        assert_eq!(rests.len(), waited_at.len(), "seed {seed}: {rests:?} for {waited_at:?}, then {last:?}");
        for (index, (&rest, &end)) in rests.iter().zip(waited_at).enumerate() {
            assert!(is_at(rest, end), "seed {seed}: block {index} ends at {rest:?}, programmed {end:?}");
        }
        totals.add(&run.totals);
        ends += blocks.ends.len();
        starvations += run.starvations;
        ran += 1;
    }
    println!("{ran} programs, {ends} blocks, {starvations} stops for want of a plan; {totals}");
    assert!(ran > 0);
}

/// Switched on at rest, wherever a hold has come to rest, perhaps off and on again: the resume runs the next block, whole or
/// what is left of it.
#[test]
fn switched_on_at_rest_it_runs_the_next_block() {
    let (mut ran, mut at_ends) = (0, 0);
    for seed in seeds(400) {
        let Some(blocks) = Blocks::random(seed, 4_000.0) else { continue };
        let ticks = blocks.case.plan.time_s / blocks.case.machine.tick_s;
        let mut random = Random::new(seed ^ 0x0FF_0FF);
        let (at, toggles) = ((random.unit() * ticks) as u64, random.below(3));
        let (mut first, mut switched, mut resumed, mut second) = (None, 0, false, None);
        let mut script = |ticks: u64, state: State, here: Rest| {
            let Some(_) = first else {
                first = (state == State::Held).then_some(here);
                return (ticks == at).then_some(Command::Hold);
            };
            if switched <= 2 * toggles {
                switched += 1;
                return Some(Command::SingleBlock(switched % 2 == 1));
            }
            if !resumed {
                resumed = true;
                return Some(Command::Resume);
            }
            (state == State::Held).then(|| {
                second = Some(here);
                Command::Abort
            })
        };
        let Some(run) = blocks.run(seed, &mut script) else { continue };
        // The hold came after the end.
        let Some(first) = first else { continue };
        at_ends += usize::from(blocks.is_end(first));
        ran += 1;
        let Some(second) = second else {
            assert_eq!(run.state, State::Done, "seed {seed}");
            continue;
        };
        // A dwell is a block, and ends where it begins, as the move before it does.
        let ends_there = blocks.ends.iter().filter(|&&end| is_at(first, end)).count();
        let dwells_there = ends_there > usize::from(first != (0, 0.0));
        assert!(dwells_there || !is_at(second, first), "seed {seed}: held again at {first:?}");
        assert!(blocks.is_end(second), "seed {seed}: {second:?} is no block's end, held at {first:?}");
    }
    println!("{ran} holds, {at_ends} of them at a block's end");
    assert!(ran > 100 && at_ends > 10 || ran < 100, "{ran}, {at_ends}");
}

/// Switched on before any tick, it comes to rest at the first block end after the place that a hold in the same tick comes
/// to rest at, or before that, if ramps ahead let it; at most one end further, where ceilings ask for it.
#[test]
fn it_stops_at_the_first_end_in_reach() {
    let (mut ran, mut earlier, mut later, mut at_the_end) = (0, 0, 0, 0);
    for seed in seeds(400) {
        let Some(blocks) = Blocks::random(seed, 4_000.0) else { continue };
        let ticks = blocks.case.plan.time_s / blocks.case.machine.tick_s;
        let at = 1 + (Random::new(seed ^ 0x51_6E).unit() * ticks) as u64;
        let mut hold = |ticks: u64, _, _| (ticks == at).then_some(Command::Abort);
        let Some(held) = blocks.run(seed, &mut hold) else { continue };
        let mut rest = None;
        let mut single = |ticks: u64, state: State, here: Rest| {
            if ticks == at {
                return Some(Command::SingleBlock(true));
            }
            (state == State::Held).then(|| {
                rest = Some(here);
                Command::Abort
            })
        };
        let Some(run) = blocks.run(seed, &mut single) else { continue };
        ran += 1;
        let Some(rest) = rest else {
            // The program's last block.
            assert_eq!(run.state, State::Done, "seed {seed}");
            at_the_end += 1;
            continue;
        };
        assert!(blocks.is_end(rest), "seed {seed}: at rest at {rest:?}, no block's end of {:?}", blocks.ends);
        let from_start = |(stretch, s_mm): Rest| blocks.before_mm(stretch) + s_mm;
        if from_start(rest) < held.s_mm - END_MM {
            earlier += 1;
            continue;
        }
        let mut in_reach: Vec<f64> = blocks.ends.iter().map(|&end| from_start(end)).collect();
        in_reach.retain(|&end_mm| end_mm >= held.s_mm - END_MM);
        in_reach.dedup_by(|a, b| (*a - *b).abs() <= END_MM);
        let index = in_reach.iter().position(|&end_mm| (end_mm - from_start(rest)).abs() <= END_MM);
        let index = index.unwrap_or_else(|| panic!("seed {seed}: {rest:?} is no end"));
        if index > 0 {
            later += 1;
            println!("seed {seed}: at {rest:?}, {index} behind the first in reach, held at {} mm", held.s_mm);
        }
        assert!(index <= 1, "seed {seed}: {index} block ends were passed");
    }
    println!(
        "{ran} runs, {at_the_end} in the last block; {earlier} before a hold's rest, {later} an end further"
    );
    assert!(ran > 0 && later * 20 <= ran, "{later} of {ran}");
}

/// Switched on and off before any tick, among holds, resumes and overrides. Where nothing is held by a command, motion
/// waits at ends of blocks only.
#[test]
fn among_all_other_commands() {
    let (mut ran, mut waits, mut totals) = (0, 0_u64, Totals::default());
    for seed in seeds(300) {
        let Some(blocks) = Blocks::random(seed, 3_000.0) else { continue };
        let mut random = Random::new(seed ^ 0xB10C);
        let often = random.log(2e-3, 0.3);
        let most = if random.chance(0.5) { 1.0 } else { 2.0 };
        let (mut is_held, mut was_single) = (false, false);
        let mut script = |ticks: u64, state: State, at: Rest| {
            if state == State::Held && !is_held {
                waits += 1;
                assert!(was_single, "seed {seed}: held by nothing");
                assert!(
                    blocks.is_end(at),
                    "seed {seed}: waits at {at:?}, no block's end of {:?}",
                    blocks.ends
                );
            }
            let command = match ticks {
                ..40_000 if !random.chance(often) => None,
                ..40_000 => Some(match random.below(10) {
                    0 => Command::Hold,
                    1..=3 => Command::Resume,
                    4 => Command::Override(1.0),
                    5 => Command::Override(random.between(0.05, most)),
                    6 if random.chance(0.1) => Command::Override(0.0),
                    7 => Command::SingleBlock(false),
                    _ => Command::SingleBlock(true),
                }),
                // In the end everything is let go.
                40_000 => Some(Command::Override(1.0)),
                40_001 => Some(Command::SingleBlock(false)),
                _ => Some(Command::Resume),
            };
            match command {
                Some(Command::Hold) => is_held |= state != State::Held,
                Some(Command::Resume) => is_held = false,
                Some(Command::SingleBlock(is_single)) => was_single |= is_single,
                _ => {}
            }
            command
        };
        let Some(run) = blocks.run(seed, &mut script) else { continue };
        assert_eq!(run.state, State::Done, "seed {seed}");
        totals.add(&run.totals);
        ran += 1;
    }
    println!("{ran} runs, waited in {waits} ticks; {totals}");
    assert!(ran > 0 && waits > 0);
}
