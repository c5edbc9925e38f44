//! How long a stop takes.

use super::Case;
use super::check::live::Command;
use super::check::program::{self, Generated};
use super::check::random::Random;
use super::check::{self, machine};
use motion_kernel::live::State;

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
            let to = [(x_mm * super::check::geometry::UNITS_PER_MM).round() as i64, 0, 0];
            let _ = std::fmt::Write::write_fmt(
                &mut text,
                format_args!(
                    "G1 X{:.10} F{:.4}\n",
                    to[0] as f64 / super::check::geometry::UNITS_PER_MM,
                    feed * 60.0
                ),
            );
            let feed_mm_min = format!("{:.4}", feed * 60.0).parse().expect("a number");
            asked.push(program::Asked::Move(super::check::geometry::Move {
                from,
                to,
                arc: None,
                feed_mm_min,
            }));
            from = to;
        }
        if x_mm > 7000.0 {
            continue;
        }
        let Some(case) = Case::of(&Generated { text, asked }, machine.clone(), 200_000.0) else { continue };
        let mut held: Option<(u64, f64, f64)> = None;
        let (mut last_rest, tick_s) = (0, machine.tick_s);
        let run = case.run::<f64>(seed, &mut |seen| match held {
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
