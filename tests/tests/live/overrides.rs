//! Overrides that keep changing, against the feed and the time that they ask for.
//!
//! **The bound.** Let T be the law's longest ramp between two feeds that the override asks for, t₁ its longest rise. When
//! the override changes, motion either cruises, and a ramp begins at once; or it brakes, which is finished, at most T; or
//! it accelerates, which is given up, at most 3/2·t₁. Then comes one ramp, at most T. So after D = max(T, 3/2·t₁) + T and a
//! tick for the background the feed is not above any that was asked for within the last D, and, where nothing cuts what
//! accelerates again and again, not below any either:
//!
//! ```text
//! min r(τ)·F ≤ v(t) ≤ max r(τ)·F,  t − D ≤ τ ≤ t
//! ```
//!
//! Integrated, the length driven is that of the override's mean but for the integral of its range within D.

use motion_host::machine::Machine;
use motion_host::planning::{Item, Plan};
use motion_kernel::exec::ExecState;
use motion_kernel::law::Limits;
use motion_kernel::live::OVERRIDE_MAX;

use super::{Case, Runs, seeds};
use motion_tests::check::geometry::{Move, UNITS_PER_MM};
use motion_tests::check::live::{Command, Run, Setup, execute};
use motion_tests::check::machine;
use motion_tests::check::program::{Asked, Generated};
use motion_tests::random::Random;

/// The law's longest rise \[s\].
fn longest_rise_s(accel: f64, jerk: f64, snap: f64) -> f64 {
    2.0 * accel / jerk.min((2.0 * accel * snap / std::f64::consts::PI).sqrt())
}

/// How long the law takes to change the feed by `change_mm_s`.
fn ramp_s(change_mm_s: f64, accel: f64, jerk: f64, snap: f64) -> f64 {
    let rise_s = longest_rise_s(accel, jerk, snap);
    if change_mm_s >= accel * rise_s {
        change_mm_s / accel + rise_s
    } else {
        // The change is Jp·t1², and Jp at most π times less than snap times t1.
        let by_jerk_s = (2.0 * change_mm_s / jerk).sqrt();
        let by_snap_s = (2.0 * std::f64::consts::PI * change_mm_s / snap).cbrt();
        2.0 * by_jerk_s.max(by_snap_s)
    }
}

/// How long a response takes between feeds up to `feed_mm_s`, a tick for the background included.
pub(super) fn response_s(feed_mm_s: f64, limits: &Limits<f64>, tick_s: f64) -> f64 {
    let &Limits { accel_mm_s2: accel, jerk_mm_s3: jerk, snap_mm_s4: snap } = limits;
    let ramp_s = ramp_s(feed_mm_s, accel, jerk, snap);
    ramp_s.max(1.5 * longest_rise_s(accel, jerk, snap)) + ramp_s + 2.0 * tick_s
}

/// The least limits that ramps of a plan may have, and its greatest ceiling \[mm/s\].
pub(super) fn least_limits(plan: &Plan) -> (Limits<f64>, f64) {
    let all = f64::INFINITY;
    let mut least = Limits { accel_mm_s2: all, jerk_mm_s3: all, snap_mm_s4: all };
    let mut greatest_mm_s = 0.0_f64;
    for item in &plan.items {
        let Item::Stretch(stretch) = item else { continue };
        for block in &stretch.blocks {
            least = least.least(&block.ceiling.law.limits()).least(&block.greatest.law.limits());
            greatest_mm_s = greatest_mm_s.max(block.greatest.feed_mm_s);
        }
    }
    (least, greatest_mm_s)
}

/// Straight on at one feed, with overrides up to the greatest below the machine's feed.
struct Straight {
    case: Case,
    feed_mm_s: f64,
    response_s: f64,
    /// From the greatest feed.
    brake_mm: f64,
}

fn straight(random: &mut Random) -> Option<Straight> {
    let mut machine: Machine = machine::any(random);
    for axis in &mut machine.axes {
        axis.feed_mm_s = machine.path.feed_mm_s;
        (axis.accel_mm_s2, axis.jerk_mm_s3, axis.snap_mm_s4) =
            (machine.path.accel_mm_s2, machine.path.jerk_mm_s3, machine.path.snap_mm_s4);
    }
    let path = &machine.path;
    let limits =
        Limits { accel_mm_s2: path.accel_mm_s2, jerk_mm_s3: path.jerk_mm_s3, snap_mm_s4: path.snap_mm_s4 };
    let feed_mm_min = format!("{:.4}", 60.0 * path.feed_mm_s * random.log(0.05, 0.49));
    let feed_mm_min: f64 = feed_mm_min.parse().expect("a number");
    let feed_mm_s = feed_mm_min / 60.0;
    let most_mm_s = OVERRIDE_MAX * feed_mm_s;
    let response_s = response_s(most_mm_s, &limits, machine.tick_s);
    // Ramps at the ends are a small part of it.
    let length_mm = feed_mm_s * response_s * random.between(20.0, 60.0);
    if length_mm > 7000.0 || length_mm / feed_mm_s > 60_000.0 * machine.tick_s {
        return None;
    }
    let (mut text, mut asked) = ("G61\n".to_owned(), Vec::new());
    let lines = 1 + random.below(6) as i64;
    let mut from = [0; 3];
    for line in 1..=lines {
        let x = (length_mm * UNITS_PER_MM) as i64 / lines * line;
        let to = [x, 0, 0];
        let written = format!("G1 X{}.{:010} F{feed_mm_min:.4}\n", x / 10_000_000_000, x % 10_000_000_000);
        text.push_str(&written);
        asked.push(Asked::Move(Move { from, to, arc: None, feed_mm_min }));
        from = to;
    }
    let case = Case::of(&Generated { text, asked }, machine, f64::INFINITY)?;
    Some(Straight { case, feed_mm_s, response_s, brake_mm: most_mm_s * response_s })
}

/// How the override changes every 10 ms.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A little, as a knob is turned.
    Walk,
    /// To anything.
    Jump,
    /// From one to another, and back after a while.
    Square,
}

const LEAST: f64 = 0.2;

/// The override from each 10 ms on.
fn next_override(kind: Kind, random: &mut Random, last: f64, step: f64) -> f64 {
    match kind {
        Kind::Walk => (last + random.between(-step, step)).clamp(LEAST, OVERRIDE_MAX),
        Kind::Jump => random.between(LEAST, OVERRIDE_MAX),
        Kind::Square if random.chance(0.02) => random.between(LEAST, OVERRIDE_MAX),
        Kind::Square => last,
    }
}

/// What the runs of a kind came to.
#[derive(Default)]
struct Tracked {
    cruised: u64,
    /// Feed over the override's, driven over asked for; the greatest difference of lengths over the bound.
    shares: Vec<f64>,
    worst: f64,
}

impl Tracked {
    /// A run under overrides of a kind, which are known to the tick.
    fn run(&mut self, kind: Kind, seed: u64, random: &mut Random) -> Option<Result<Run, String>> {
        let Straight { case, feed_mm_s, response_s, brake_mm } = straight(random)?;
        let tick_s = case.machine.tick_s;
        let every = (0.01 / tick_s).round().max(1.0) as u64;
        let response = (response_s / tick_s).ceil() as u64;
        let step = random.log(0.002, 0.05);
        let (mut feed_override, mut history) = (1.0_f64, Vec::<f64>::new());
        let (mut asked_mm, mut range_mm, mut driven_mm) = (0.0_f64, 0.0_f64, 0.0_f64);
        let (length_mm, mut low) = (case.plan.length_mm, None);
        let setup = Setup { response_ticks: response, ..case.setup(seed) };
        let run = execute::<f64>(&setup, &mut |seen| {
            let motion = &seen.executed.motion;
            // After the start, before the stop at the end.
            let is_under_way = seen.executed.state == ExecState::Moving
                && seen.ticks > 2 * response
                && length_mm - motion.s.to_mm() > brake_mm;
            if is_under_way {
                let window = &history[history.len() - response as usize..];
                let least = window.iter().copied().fold(f64::INFINITY, f64::min);
                let greatest = window.iter().copied().fold(0.0, f64::max);
                if motion.v_mm_s < least * feed_mm_s * (1.0 - 1e-9) {
                    low.get_or_insert((seen.ticks, motion.v_mm_s, least * feed_mm_s));
                }
                self.cruised += 1;
                asked_mm += feed_override * feed_mm_s * tick_s;
                driven_mm += motion.v_mm_s * tick_s;
                range_mm += f64::max(greatest - feed_override, feed_override - least) * feed_mm_s * tick_s;
            }
            let is_due = seen.ticks % every == 0;
            if is_due {
                feed_override = next_override(kind, random, feed_override, step);
            }
            history.push(feed_override);
            is_due.then_some(Command::Override(feed_override))
        });
        if asked_mm > 0.0 {
            // Where nothing is asked for but one override, rounding is all there is.
            self.worst = self.worst.max((driven_mm - asked_mm).abs() / (range_mm + 1e-6 * asked_mm));
            self.shares.push(driven_mm / asked_mm);
        }
        Some(run.and_then(|run| match low {
            None if run.starvations == 0 => Ok(run),
            low => Err(format!("below all overrides of a response {low:?}, {} starvations", run.starvations)),
        }))
    }
}

/// The override changed every 10 ms of programs that cruise for most of their time: in every tick the feed is within what
/// was asked for within the last response, and so the length driven is that of the override's mean within what it ranges
/// over in that time.
#[test]
fn feed_and_time_are_those_of_the_override() {
    let mut runs = Runs::default();
    for kind in [Kind::Walk, Kind::Jump, Kind::Square] {
        let mut tracked = Tracked::default();
        for seed in seeds(60) {
            let mut random = Random::new(seed ^ 0x0E44_0000);
            if let Some(run) = tracked.run(kind, seed, &mut random) {
                runs.add(seed, run.map_err(|error| format!("{kind:?}: {error}")));
            }
        }
        let Tracked { cruised, mut shares, worst } = tracked;
        shares.sort_by(f64::total_cmp);
        let [least, median, greatest] = [0, shares.len() / 2, shares.len() - 1].map(|index| shares[index]);
        println!(
            "{kind:?}: {} programs, {cruised} ticks; driven over asked {least:.4} to {greatest:.4}, median {median:.4}; \
             at most {worst:.3} of what the override ranges over",
            shares.len(),
        );
        assert!(shares.len() > 20 && worst <= 1.0, "{kind:?}: {worst}");
    }
    runs.print_and_assert();
}

/// Dwells and stops before and after all motion keep no override from holding, and are not waited for.
#[test]
fn an_override_holds_between_rests() {
    let to = [(8.0 * UNITS_PER_MM) as i64, 0, 0];
    let asked = vec![
        Asked::Dwell(0.05),
        Asked::Stop,
        Asked::Dwell(0.01),
        Asked::Move(Move { from: [0; 3], to, arc: None, feed_mm_min: 1200.0 }),
        Asked::Dwell(0.05),
        Asked::Stop,
    ];
    let text = "G61 G4 P0.05\nM0\nG4 P0.01\nG1 X8 F1200\nG4 P0.05\nM0\n".to_owned();
    let case = Case::of(&Generated { text, asked }, Machine::reference(), 10_000.0).expect("a program");
    let mut runs = Runs::default();
    // From the start, in the first dwell, in motion, in the last dwell.
    for at in [0, 40, 600, 1300] {
        let mut fastest_mm_s = 0.0_f64;
        let run = case.run::<f64>(at, &mut |seen| {
            fastest_mm_s = fastest_mm_s.max(seen.executed.motion.v_mm_s);
            (seen.ticks == at).then_some(Command::Override(0.5))
        });
        runs.add(at, run);
        // Motion begins after 60 ms of dwells, and half a second is more than a ramp to 20 mm/s takes.
        let is_before = at < 100;
        let expected_mm_s = if is_before { 10.0 } else { 20.0 };
        assert!((fastest_mm_s - expected_mm_s).abs() < 1e-9, "override at {at}: {fastest_mm_s} mm/s");
    }
    runs.print_and_assert();
    assert_eq!(runs.ran, 4);
}

/// The override changed every 10 ms, whatever is under way.
#[test]
fn an_override_that_never_rests_keeps_the_limits() {
    let mut runs = Runs::default();
    for seed in seeds(200) {
        let Some(case) = Case::random(seed, 4_000.0) else { continue };
        let every = (0.01 / case.machine.tick_s).round().max(1.0) as u64;
        let mut random = Random::new(seed ^ 0x0E44);
        let most = if seed % 2 == 0 { 1.0 } else { 2.0 };
        let run = case.run::<f64>(seed, &mut |seen| {
            (seen.ticks % every == 0).then(|| Command::Override(random.between(0.1, most)))
        });
        runs.add(seed, run);
    }
    runs.print_and_assert();
    assert!(runs.ran > 60, "{}", runs.ran);
}

/// The reading of a knob that is turned back slowly, or trembles, while the machine speeds up: it gets to the feed as soon as
/// without.
#[test]
fn an_override_that_trembles_does_not_hold_up_an_acceleration() {
    let to = [(200.0 * UNITS_PER_MM) as i64, 0, 0];
    let asked = vec![Asked::Move(Move { from: [0; 3], to, arc: None, feed_mm_min: 3000.0 })];
    let text = "G61 G1 X200 F3000\n".to_owned();
    let case = Case::of(&Generated { text, asked }, Machine::reference(), 20_000.0).expect("a program");
    let reaches = |share: &dyn Fn(u64) -> f64| {
        let mut reached = None;
        let run = case.run::<f64>(1, &mut |seen| {
            if reached.is_none() && seen.executed.motion.v_mm_s >= 0.9 * 50.0 {
                reached = Some(seen.ticks);
            }
            (seen.ticks % 20 == 0).then(|| Command::Override(share(seen.ticks / 20)))
        });
        run.expect("legal");
        reached.expect("nine tenths of the feed")
    };
    let free = reaches(&|_| 1.0);
    let falling = reaches(&|step| (1.0 - 0.002 * step as f64).max(0.91));
    let trembling = reaches(&|step| 1.0 - 0.02 * Random::new(step).unit());
    println!("{free}, falling {falling}, trembling {trembling} ticks");
    assert!(falling < free + free / 4 && trembling < free + free / 4, "{free}: {falling}, {trembling}");
}

/// An override holds after a dwell too, however the list before it is filled.
#[test]
fn an_override_holds_behind_a_dwell() {
    for blocks in 1..=40 {
        let (mut text, mut asked, mut from) = ("G61\n".to_owned(), Vec::new(), [0; 3]);
        for index in 0..=blocks {
            let feed_mm_min = if index % 2 == 0 { 1200.0 } else { 600.0 };
            let to = [from[0] + 2 * UNITS_PER_MM as i64, 0, 0];
            text += &format!("G1 X{} F{feed_mm_min}\n", 2 * (index + 1));
            asked.push(Asked::Move(Move { from, to, arc: None, feed_mm_min }));
            from = to;
            if index + 1 == blocks {
                text += "G4 P0.05\n";
                asked.push(Asked::Dwell(0.05));
            }
        }
        let case = Case::of(&Generated { text, asked }, Machine::reference(), 50_000.0).expect("a program");
        let mut fastest_mm_s = 0.0_f64;
        let run = case.run::<f64>(blocks as u64, &mut |seen| {
            fastest_mm_s = fastest_mm_s.max(seen.executed.motion.v_mm_s);
            (seen.ticks == 0).then_some(Command::Override(0.3))
        });
        run.unwrap_or_else(|error| panic!("{blocks} blocks: {error}"));
        assert!(fastest_mm_s <= 0.3 * 20.0 * (1.0 + 1e-9), "{blocks} blocks: {fastest_mm_s} mm/s");
    }
}
