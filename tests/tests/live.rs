//! Live control: whatever is commanded whenever, every tick keeps every limit, the path and its ends.

#[allow(dead_code, reason = "each test takes what it needs of the shared checks")]
mod check;

use check::bounds::Number;
use check::live::{Command, Run, Seen, execute};
use check::path::Path;
use check::program::{Asked, Generated};
use check::random::Random;
use check::totals::Totals;
use check::{drive, machine, program};
use motion_host::machine::Machine;
use motion_host::planning::{Mode, Plan};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::law::{FeedSegment, Law, Ramp, Ticks, TurnedRamp};
use motion_kernel::live::State;
use motion_kernel::num::Fixed;
use motion_kernel::path::Piece;
use motion_kernel::queue::{Change, LiveStreams};
use motion_kernel::units::Position;

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
    let (mut ran, mut starvations, mut failures) = (0, 0, Vec::new());
    let first = check::from_env("MOTION_TEST_SEED").unwrap_or(1);
    let programs = check::from_env("MOTION_TEST_PROGRAMS").unwrap_or(400);
    for seed in first..first + programs {
        match random_commands(seed) {
            None => {}
            Some(Ok(run)) => {
                totals.add(&run.totals);
                starvations += run.starvations;
                ran += 1;
            }
            // Fixed point's range has tests of its own.
            Some(Err(error)) if error.contains("the kernel's number type") => {}
            Some(Err(error)) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}")),
        }
    }
    println!("{ran} runs, {starvations} stops for want of a plan; {totals}");
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

/// A background that is late at random: every stall that outlasts what is queued ends in a stop on the path, and motion
/// goes on behind it; nothing is lost, nothing repeated.
#[test]
fn a_late_background_is_waited_for_at_rest() {
    let (mut ran, mut stalls, mut starvations, mut totals) = (0, 0_u64, 0_u64, Totals::default());
    let programs = check::from_env("MOTION_TEST_PROGRAMS").unwrap_or(300);
    for seed in 1..=programs {
        let Some(case) = Case::random(seed, 6_000.0) else { continue };
        let mut random = Random::new(seed ^ 0x57A11);
        let often = random.log_between(1e-3, 0.3);
        let mut left = 0;
        let mut script = || {
            if left == 0 && random.chance(often) {
                left = random.log_between(1.0, 3000.0) as u64;
                stalls += 1;
            }
            left = u64::saturating_sub(left, 1);
            (left > 0).then_some(Command::Stall)
        };
        let run = match seed % 3 {
            0 => case.run::<f32>(seed, 1.0, &mut |_| script()),
            1 => case.run::<f64>(seed, 1.0, &mut |_| script()),
            _ => case.run::<Fixed>(seed, 1.0, &mut |_| script()),
        };
        match run {
            Ok(run) => {
                starvations += u64::from(run.starvations);
                totals.add(&run.totals);
                ran += 1;
            }
            Err(error) if error.contains("the kernel's number type") => {}
            Err(error) => panic!("MOTION_TEST_SEED={seed}: {error}"),
        }
    }
    println!("{ran} programs, {stalls} stalls, {starvations} stops for want of data; {totals}");
    assert!(ran > 80 && stalls > 1000 && starvations > 30, "{ran} {stalls} {starvations}");
}

/// The time that stopping takes at least with limits of acceleration and jerk alone, from a feed and an acceleration
/// (the optimum of a velocity interface without a limit of snap).
fn shortest_stop_s(v: f64, a: f64, accel: f64, jerk: f64) -> f64 {
    // Where the feed would end if the acceleration went to 0 at once.
    let left = v + a * a.abs() / (2.0 * jerk);
    let (v, a) = if left < 0.0 { (-v, -a) } else { (v, a) };
    let peak = (jerk * v + 0.5 * a * a).max(0.0).sqrt();
    if peak <= accel {
        (a + peak) / jerk + peak / jerk
    } else {
        let falling = (a + accel) / jerk;
        let lost = v + 0.5 * a * a / jerk - accel * accel / jerk;
        falling + lost / accel + accel / jerk
    }
}

/// From any state of the law a hold takes at most 2.2 times the shortest stop without a limit of snap, and twice the
/// law's longest rise.
#[test]
fn a_stop_is_not_much_longer_than_the_shortest() {
    let holds = check::from_env("MOTION_TEST_HOLDS").unwrap_or(3000);
    // Over the shortest stop with the jerk that snap leaves the law, and with all the jerk, where that is the same.
    let (mut ratios, mut plain, mut shares, mut beyond) = (Vec::new(), Vec::new(), Vec::new(), 0_usize);
    let mut seed = 0;
    while (ratios.len() as u64) < holds {
        seed += 1;
        let mut random = Random::new(seed);
        let mut machine = machine::any(&mut random);
        // The path's limits are the only ones.
        for axis in &mut machine.axes {
            axis.feed_mm_s = machine.path.feed_mm_s;
            (axis.accel_mm_s2, axis.jerk_mm_s3, axis.snap_mm_s4) =
                (machine.path.accel_mm_s2, machine.path.jerk_mm_s3, machine.path.snap_mm_s4);
        }
        let path = &machine.path;
        let (accel, jerk, snap) = (path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4);
        let peak = jerk.min((2.0 * accel * snap / std::f64::consts::PI).sqrt());
        let rise_s = 2.0 * accel / peak;
        // Straight on, each line at a feed of its own, with room to reach it and to stop.
        let (mut x_mm, mut text, mut asked) = (0.0, String::new(), Vec::new());
        let mut from = [0; 3];
        for _ in 0..12 {
            let feed = path.feed_mm_s * random.log_between(0.02, 1.0);
            let room_mm = path.feed_mm_s * (path.feed_mm_s / accel + 2.0 * rise_s);
            x_mm += room_mm * random.between(1.5, 3.0);
            let to = [(x_mm * check::geometry::UNITS_PER_MM).round() as i64, 0, 0];
            let _ = std::fmt::Write::write_fmt(
                &mut text,
                format_args!(
                    "G1 X{:.10} F{:.4}\n",
                    to[0] as f64 / check::geometry::UNITS_PER_MM,
                    feed * 60.0
                ),
            );
            let feed_mm_min = format!("{:.4}", feed * 60.0).parse().expect("a number");
            asked.push(program::Asked::Move(check::geometry::Move { from, to, arc: None, feed_mm_min }));
            from = to;
        }
        if x_mm > 7000.0 {
            continue;
        }
        let Some(case) = Case::of(&Generated { text, asked }, machine.clone(), 200_000.0) else { continue };
        let mut held: Option<(u64, f64, f64)> = None;
        let (mut last_rest, tick_s) = (0, machine.tick_s);
        let run = case.run::<f64>(seed, 1.0, &mut |seen| match held {
            None if seen.ticks > last_rest + 20 && random.chance(0.01) => {
                let motion = &seen.executed.motion;
                let shortest_s = |jerk: f64| shortest_stop_s(motion.v_mm_s, motion.a_mm_s2, accel, jerk);
                held = Some((seen.ticks, shortest_s(jerk), shortest_s(peak)));
                Some(Command::Hold)
            }
            Some((at, shortest_s, with_peak_s)) if seen.state == State::Held => {
                let stop_s = (seen.ticks - at) as f64 * tick_s;
                if shortest_s > 0.0 {
                    let more_s = stop_s - 2.0 * rise_s - 2.0 * tick_s;
                    ratios.push(more_s / with_peak_s);
                    if peak >= jerk {
                        plain.push(more_s / shortest_s);
                    }
                    shares.push(stop_s / shortest_s);
                    let goal_s = 1.5 * shortest_s + std::f64::consts::PI * jerk / snap + 2.0 * tick_s;
                    beyond += usize::from(stop_s > goal_s);
                }
                (held, last_rest) = (None, seen.ticks);
                Some(Command::Resume)
            }
            _ => None,
        });
        run.unwrap_or_else(|error| panic!("MOTION_TEST_SEED={seed}: {error}"));
    }
    for all in [&mut ratios, &mut plain, &mut shares] {
        all.sort_by(f64::total_cmp);
    }
    let at = |all: &[f64], share: f64| all[((all.len() - 1) as f64 * share) as usize];
    println!(
        "{} stops: time over the shortest {:.2} (median), {:.2} (p90), {:.2} (p99), {:.2} (max); beyond two rises at \
         most {:.2} times the shortest with the law's jerk, of {} where that is the limit {:.2} times; above 1.5 times \
         the shortest and pi J/DJ {:.1} %",
        shares.len(),
        at(&shares, 0.5),
        at(&shares, 0.9),
        at(&shares, 0.99),
        at(&shares, 1.0),
        at(&ratios, 1.0),
        plain.len(),
        at(&plain, 1.0),
        100.0 * beyond as f64 / shares.len() as f64,
    );
    assert!(
        plain.len() > shares.len() / 10 && at(&plain, 1.0) <= 2.2,
        "{} of {}",
        at(&plain, 1.0),
        plain.len()
    );
    assert!(at(&ratios, 1.0) <= 2.2, "{}", at(&ratios, 1.0));
}

/// The override changed every 10 ms, whatever is under way.
#[test]
fn an_override_that_never_rests_keeps_the_limits() {
    let (mut ran, mut totals) = (0, Totals::default());
    for seed in 1..200 {
        let Some(case) = Case::random(seed, 4_000.0) else { continue };
        let every = (0.01 / case.machine.tick_s).round().max(1.0) as u64;
        let mut random = Random::new(seed ^ 0x0E44);
        let most = if seed % 2 == 0 { 1.0 } else { 2.0 };
        let run = case.run::<f64>(seed, most, &mut |seen| {
            (seen.ticks % every == 0).then(|| Command::Override(random.between(0.1, most)))
        });
        totals.add(&run.unwrap_or_else(|error| panic!("MOTION_TEST_SEED={seed}: {error}")).totals);
        ran += 1;
    }
    println!("{ran} programs; {totals}");
    assert!(ran > 60, "{ran}");
}

/// An abort comes to rest on the path, and nothing of the program is left.
#[test]
fn an_abort_ends_at_rest_on_the_path() {
    let (mut ran, mut early) = (0, 0);
    for seed in 1..200 {
        let Some(case) = Case::random(seed, 4_000.0) else { continue };
        let ticks = case.plan.time_s / case.machine.tick_s;
        let at = (Random::new(seed).unit() * ticks) as u64;
        let run = case.run::<f64>(seed, 1.0, &mut |seen| (seen.ticks == at).then_some(Command::Abort));
        let run = run.unwrap_or_else(|error| panic!("MOTION_TEST_SEED={seed}: {error}"));
        assert_eq!(run.state, State::Aborted, "seed {seed}");
        assert!(run.ticks >= at, "seed {seed}");
        // Most of them are given up on the way.
        early += usize::from(run.s_mm < case.plan.length_mm - 1e-6);
        ran += 1;
    }
    assert!(ran > 60 && early > ran / 2, "{early} of {ran}");
}

/// Held in a dwell it does not go on behind it, whatever the list under way holds, until it is told to; nor with an
/// override of 0, nor when it is to be given up.
#[test]
fn held_in_a_dwell_it_stays() {
    let line = |x: f64| {
        Asked::Move(check::geometry::Move {
            from: [((x - 5.0) * check::geometry::UNITS_PER_MM).round() as i64, 0, 0],
            to: [(x * check::geometry::UNITS_PER_MM).round() as i64, 0, 0],
            arc: None,
            feed_mm_min: 1200.0,
        })
    };
    let text = "G1 X5 F1200\nG4 P0.5\nX10\nG4 P0.5\nX15\n".to_owned();
    let asked = vec![line(5.0), Asked::Dwell(0.5), line(10.0), Asked::Dwell(0.5), line(15.0)];
    let case = Case::of(&Generated { text, asked }, Machine::reference(), 20_000.0).expect("a program");
    for (stop, go) in [
        (Command::Hold, Some(Command::Resume)),
        (Command::Override(0.0), Some(Command::Override(1.0))),
        (Command::Abort, None),
    ] {
        let (mut dwelt, mut stopped_at, mut gone, mut moved) = (0, None, false, 0);
        let run = case.run::<f64>(0, 1.0, &mut |seen| {
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

/// An override holds behind a dwell too, however the list before it is filled.
#[test]
fn an_override_holds_behind_a_dwell() {
    for blocks in 1..=40 {
        let (mut text, mut asked, mut from) = (String::new(), Vec::new(), [0; 3]);
        for index in 0..=blocks {
            let feed_mm_min = if index % 2 == 0 { 1200.0 } else { 600.0 };
            let to = [from[0] + 2 * check::geometry::UNITS_PER_MM as i64, 0, 0];
            text += &format!("G1 X{} F{feed_mm_min}\n", 2 * (index + 1));
            asked.push(Asked::Move(check::geometry::Move { from, to, arc: None, feed_mm_min }));
            from = to;
            if index + 1 == blocks {
                text += "G4 P0.05\n";
                asked.push(Asked::Dwell(0.05));
            }
        }
        let case = Case::of(&Generated { text, asked }, Machine::reference(), 50_000.0).expect("a program");
        let mut fastest_mm_s = 0.0_f64;
        let run = case.run::<f64>(blocks as u64, 1.0, &mut |seen| {
            fastest_mm_s = fastest_mm_s.max(seen.executed.motion.v_mm_s);
            (seen.ticks == 0).then_some(Command::Override(0.3))
        });
        run.unwrap_or_else(|error| panic!("{blocks} blocks: {error}"));
        assert!(fastest_mm_s <= 0.3 * 20.0 * (1.0 + 1e-9), "{blocks} blocks: {fastest_mm_s} mm/s");
    }
}

/// The tick has passed the place where a list would take over: it says so, and ends as it would have.
#[test]
fn a_change_that_comes_too_late_is_refused() {
    let machine = Machine::reference();
    let (tick_s, rules) = (machine.tick_s, machine.rules());
    let at = |mm: f64| Position::from_mm(mm).expect("in range");
    let law = Law::new(rules.limits).expect("limits");
    let up = Ramp::new(&law, 0.0, 20.0);
    let length = at(up.length_mm());
    let mut streams = LiveStreams::<f64, 1, 8, 16>::new();
    let (mut feeder, mut intake) = streams.split(rules, [at(0.0)]);
    let mut executor = Executor::<f64, 1>::new([at(0.0)]);
    feeder.piece(Piece::line(1, [at(0.0)], [1.0], length + length).expect("a line"), 20.0).expect("room");
    feeder.end_of_path([length + length]).expect("room");
    let list = feeder.begin(at(0.0), 0.0).expect("a list");
    for ramp in [up, up.reversed()] {
        feeder.segment(list, FeedSegment::ramp(&ramp, length, tick_s).expect("a segment")).expect("room");
    }
    feeder.end_of_feed(list).expect("room");
    feeder.change(Change { from: 0, to: list, after: 0, within: false });
    for _ in 0..100 {
        executor.tick(&mut intake).expect("no fault");
    }
    let progress = feeder.progress();
    assert_eq!((progress.tick, progress.list, progress.done), (100, list, 0));
    // The same ramp, turned where it was 50 ticks ago, and to rest.
    let turned = TurnedRamp { ramp: up, turn_s: 50.0 * tick_s };
    let other = feeder.begin(at(0.0), 0.0).expect("a list");
    let turn_at = Ticks::from_seconds(50.0, 1.0).expect("in range");
    let first = FeedSegment::turned(&up, turn_at, at(turned.length_mm()), tick_s).expect("a segment");
    feeder.segment(other, first).expect("room");
    let stop = Ramp::new(&law, turned.to_mm_s(), 0.0);
    feeder
        .segment(other, FeedSegment::ramp(&stop, at(stop.length_mm()), tick_s).expect("a segment"))
        .expect("room");
    feeder.change(Change { from: list, to: other, after: 0, within: true });
    assert!(!feeder.is_refused());
    executor.tick(&mut intake).expect("no fault");
    assert!(feeder.is_refused());
    let executed = std::iter::repeat_with(|| executor.tick(&mut intake).expect("no fault"))
        .find(|executed| executed.state == ExecState::Idle)
        .expect("endless");
    assert_eq!(executed.setpoints[0].position, length + length);
}
