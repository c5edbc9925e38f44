//! How long a stop takes.
//!
//! The long form, `MOTION_TEST_HOLDS=100000`, is what the table of the documents is made of; `MOTION_ACCEPT=1` writes it.

use motion_host::machine::Machine;
use motion_kernel::live::State;
use motion_tests::figures::{Table, hold};

use super::{Case, planned};
use motion_tests::check::geometry::{Move, UNITS_PER_MM};
use motion_tests::check::live::{Command, Run};
use motion_tests::check::machine;
use motion_tests::check::program::{Asked, Generated};
use motion_tests::from_env;
use motion_tests::random::Random;
use motion_tests::samples::SAMPLES;

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

/// A machine whose path's limits are the only ones, and lines straight on, each at a feed of its own, with room to reach it
/// and to stop.
fn straight(random: &mut Random) -> Option<Case> {
    let mut machine = machine::any(random);
    for axis in &mut machine.axes {
        axis.feed_mm_s = machine.path.feed_mm_s;
        (axis.accel_mm_s2, axis.jerk_mm_s3, axis.snap_mm_s4) =
            (machine.path.accel_mm_s2, machine.path.jerk_mm_s3, machine.path.snap_mm_s4);
    }
    let (most_mm_s, room_s) =
        (machine.path.feed_mm_s, machine.path.feed_mm_s / machine.path.accel_mm_s2 + 2.0 * rise_s(&machine));
    let (mut x_mm, mut text, mut asked, mut from) = (0.0, "G61\n".to_owned(), Vec::new(), [0; 3]);
    for _ in 0..12 {
        let feed_mm_min = format!("{:.4}", 60.0 * most_mm_s * random.log(0.02, 1.0));
        x_mm += most_mm_s * room_s * random.between(1.5, 3.0);
        let to = [(x_mm * UNITS_PER_MM).round() as i64, 0, 0];
        text.push_str(&format!("G1 X{:.10} F{feed_mm_min}\n", to[0] as f64 / UNITS_PER_MM));
        let feed_mm_min = feed_mm_min.parse().expect("a number");
        asked.push(Asked::Move(Move { from, to, arc: None, feed_mm_min }));
        from = to;
    }
    if x_mm > 7000.0 {
        return None;
    }
    Case::of(&Generated { text, asked }, machine, 200_000.0)
}

/// The jerk that snap leaves the law \[mm/s³\].
fn peak_jerk(machine: &Machine) -> f64 {
    let path = &machine.path;
    path.jerk_mm_s3.min((2.0 * path.accel_mm_s2 * path.snap_mm_s4 / std::f64::consts::PI).sqrt())
}

/// The law's longest rise \[s\].
fn rise_s(machine: &Machine) -> f64 {
    2.0 * machine.path.accel_mm_s2 / peak_jerk(machine)
}

/// A stop from any state of the law, over the shortest without a limit of snap.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// All of it, over 1.5 times the shortest and π·J/DJ.
    of_goal: f64,
    /// What two rises do not account for; where snap leaves the law all its jerk.
    plain: Option<f64>,
    /// The same, of any law.
    beyond: f64,
    /// The same, over the shortest with the jerk that snap leaves.
    with_its_jerk: f64,
}

impl Stop {
    fn new(machine: &Machine, [v, a]: [f64; 2], ticks: u64) -> Option<Self> {
        let path = &machine.path;
        let (jerk, peak) = (path.jerk_mm_s3, peak_jerk(machine));
        let shortest_s = |jerk: f64| shortest_stop_s(v, a, path.accel_mm_s2, jerk);
        if shortest_s(jerk) <= 0.0 {
            return None;
        }
        // A tick until it begins, and one until it is seen to be over.
        let stop_s = (ticks as f64 - 2.0) * machine.tick_s;
        let more_s = stop_s - 2.0 * rise_s(machine);
        let goal_s = 1.5 * shortest_s(jerk) + std::f64::consts::PI * jerk / path.snap_mm_s4;
        Some(Self {
            of_goal: stop_s / goal_s,
            plain: (peak >= jerk).then_some(more_s / shortest_s(jerk)),
            beyond: more_s / shortest_s(jerk),
            with_its_jerk: more_s / shortest_s(peak),
        })
    }
}

/// Held at random times, again and again.
fn stops(seed: u64, found: &mut Vec<Stop>) -> Option<Result<Run, String>> {
    let mut random = Random::new(seed);
    let case = straight(&mut random)?;
    let (mut held, mut last_rest) = (None, 0);
    Some(case.run::<f64>(seed, &mut |seen| match held {
        None if seen.ticks > last_rest + 20 && random.chance(0.01) => {
            let motion = &seen.executed.motion;
            held = Some((seen.ticks, [motion.v_mm_s, motion.a_mm_s2]));
            Some(Command::Hold)
        }
        Some((at, state)) if seen.state == State::Held => {
            found.extend(Stop::new(&case.machine, state, seen.ticks - at));
            (held, last_rest) = (None, seen.ticks);
            Some(Command::Resume)
        }
        _ => None,
    }))
}

/// What is published; a short form's stops are the first of the long form's.
const PUBLISHED: &str = include_str!("../../expected/stops.md");
const LONG: usize = 100_000;

/// From any state of the law a hold takes at most 2.2 times the shortest stop without a limit of snap, and twice the
/// law's longest rise.
#[test]
fn a_stop_is_not_much_longer_than_the_shortest() {
    let holds = from_env("MOTION_TEST_HOLDS").unwrap_or(3000) as usize;
    let mut found = Vec::new();
    for seed in 1.. {
        if found.len() >= holds {
            break;
        }
        if let Some(Err(error)) = stops(seed, &mut found) {
            panic!("MOTION_TEST_SEED={seed}: {error}");
        }
    }
    found.truncate(holds);
    let sorted = |figure: &dyn Fn(&Stop) -> Option<f64>| {
        let mut all: Vec<f64> = found.iter().filter_map(figure).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let plain = sorted(&|stop| stop.plain);
    let columns = [
        sorted(&|stop| Some(stop.of_goal)),
        plain.clone(),
        sorted(&|stop| Some(stop.with_its_jerk)),
        sorted(&|stop| Some(stop.beyond)),
    ];
    let mut table = Table::new(&[
        "share of stops",
        "time over 1.5 times the shortest and π·J/DJ",
        "less two rises, snap leaving all jerk",
        "less two rises, over the shortest with the jerk that snap leaves",
        "less two rises, over the shortest with all jerk",
    ]);
    for (name, share) in [("50 %", 0.5), ("90 %", 0.9), ("99 %", 0.99), ("99.9 %", 0.999), ("all", 1.0)] {
        let at = |all: &Vec<f64>| format!("{:.2}", all[((all.len() - 1) as f64 * share) as usize]);
        let mut row = vec![name.to_owned()];
        row.extend(columns.iter().map(at));
        table.row(&row);
    }
    let above = |all: &[f64], figure: f64| {
        100.0 * all.iter().filter(|&&value| value > figure).count() as f64 / all.len() as f64
    };
    println!(
        "{}{} stops, {} of them where snap leaves all jerk; {:.2} % above 1.5 times the shortest and pi J/DJ, {:.3} % \
         above 2.2 times the shortest with all jerk and two rises",
        table.to_markdown(),
        found.len(),
        plain.len(),
        above(&columns[0], 1.0),
        above(&columns[3], 2.2),
    );
    let greatest = |all: &Vec<f64>| all[all.len() - 1];
    assert!(plain.len() > found.len() / 10 && greatest(&plain) <= 2.2, "{}", greatest(&plain));
    assert!(greatest(&columns[2]) <= 2.2, "{}", greatest(&columns[2]));
    if found.len() == LONG {
        hold("stops", &table, 0.0).unwrap_or_else(|error| panic!("{error}"));
    } else if found.len() < LONG {
        let last = PUBLISHED.lines().last().expect("rows");
        let published = last.split('|').filter_map(|cell| cell.trim().parse::<f64>().ok());
        assert_eq!(published.clone().count(), columns.len(), "{last}");
        for (all, published) in columns.iter().zip(published) {
            // As printed.
            assert!(greatest(all) <= published + 0.005, "{} of the published {published}", greatest(all));
        }
    }
}

/// The samples, and what `MOTION_TEST_FOLDER` has.
fn programs() -> Vec<(String, String)> {
    let mut programs = SAMPLES.map(|(name, text)| (name.to_owned(), text.to_owned())).to_vec();
    let Some(folder) = std::env::var_os("MOTION_TEST_FOLDER") else { return programs };
    let files = std::fs::read_dir(folder).expect("MOTION_TEST_FOLDER names a folder");
    for file in files.map(|file| file.expect("a file").path()) {
        if file.extension().is_some_and(|ending| ending == "ngc") {
            let text = std::fs::read(&file).expect("a program that can be read");
            programs.push((file.display().to_string(), String::from_utf8_lossy(&text).into_owned()));
        }
    }
    programs
}

/// With ceilings, arcs and blends: the greatest share of the bound that a stop of a program takes, before which tick, and
/// the number of stops; none where planning refuses the program or it takes more than five minutes.
fn greatest_share(text: &str, machine: &Machine, every: Option<u64>) -> Option<(f64, u64, u64)> {
    let plan = planned(text, machine, 600_000.0)?;
    let time_s = plan.time_s;
    let case = Case::compiled::<f64>(plan, machine.clone())?;
    let ticks = (time_s / machine.tick_s) as u64;
    // Every run begins at the beginning.
    let every = match every {
        Some(every) if time_s > 60.0 => 10 * every,
        Some(every) => every,
        None => (ticks / 20).max(20),
    };
    let (mut worst, mut worst_at, mut stops) = (0.0, 0, 0);
    for at in (every..ticks).step_by(every as usize) {
        let mut before = [0.0; 2];
        let run = case.run::<f64>(at, &mut |seen| {
            (seen.ticks == at).then(|| {
                before = [seen.executed.motion.v_mm_s, seen.executed.motion.a_mm_s2];
                Command::Abort
            })
        });
        let run = run.unwrap_or_else(|error| panic!("aborted before tick {at}: {error}"));
        let [v, a] = before;
        if v <= 0.0 {
            continue;
        }
        // A tick until it begins, and one until it is seen to be over.
        let stop_s = (run.ticks as f64 - at as f64 - 2.0) * machine.tick_s;
        let shortest_s = shortest_stop_s(v, a, machine.path.accel_mm_s2, peak_jerk(machine));
        let share = stop_s / (2.2 * shortest_s + 2.0 * rise_s(machine));
        stops += 1;
        if share > worst {
            (worst, worst_at) = (share, at);
        }
    }
    Some((worst, worst_at, stops))
}

/// The bound holds where ceilings, arcs and blends leave less than the machine's limits, too. The long form is
/// `MOTION_TEST_EVERY=20`: every twentieth tick, of programs over a minute every two hundredth.
#[test]
fn a_stop_keeps_its_bound_in_programs() {
    let every = from_env("MOTION_TEST_EVERY");
    let mut samples = 0;
    for (name, text) in programs() {
        for machine in machine::references() {
            let law = machine.path.pulse.name();
            let Some((share, at, stops)) = greatest_share(&text, &machine, every) else { continue };
            println!("{name}, {law}: {stops} stops, at most {share:.3} of the bound, before tick {at}");
            assert!(share <= 1.0, "{name}, {law}: {share} before tick {at}");
            samples += usize::from(stops > 10);
        }
    }
    assert!(samples >= 2 * SAMPLES.len(), "{samples}");
}
