//! Jog: keys pressed and released at random, checked from the executed positions alone.

use motion_kernel::exec::{ExecState, Executed, Executor};
use motion_kernel::jog::{Direction, Jog, JogAxis, JogError, JogTarget, Travel};
use motion_kernel::law::{Limits, Pulse};
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::queue::{LiveStreams, PathRules};
use motion_kernel::units::Position;
use motion_tests::check::bench::mm;
use motion_tests::judge::{Judge, along};
use motion_tests::random::Random;

const AXES: usize = 3;
type Place = [Position; AXES];

/// A machine of equal axes.
#[derive(Clone, Copy, Debug)]
struct Machine {
    axis: JogAxis,
    travel: Travel,
    tick_s: f64,
}

impl Machine {
    fn random(random: &mut Random) -> Self {
        let accel_mm_s2 = random.log(50.0, 5e3);
        let jerk_mm_s3 = accel_mm_s2 * random.log(5.0, 100.0);
        let snap_mm_s4 = jerk_mm_s3 * random.log(20.0, 500.0);
        let limits = Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 };
        let least = mm(-random.log(0.1, 300.0));
        let travel = Travel { least, greatest: least + mm(random.log(0.2, 600.0)) };
        let feed_mm_s = random.log(5.0, 300.0);
        Self {
            axis: JogAxis { feed_mm_s, limits, pulse: Pulse::Plateau, travel: Some(travel) },
            travel,
            tick_s: 5e-4,
        }
    }

    fn rules(&self) -> PathRules {
        let JogAxis { feed_mm_s, limits, .. } = self.axis;
        PathRules { limits, feed_mm_s, junction_angle_rad: 0.01, junction_gap_mm: 5e-6 }
    }
}

/// Differences of set positions over ticks are means of their derivatives: none is above its limit.
struct Differences {
    axis: usize,
    past_mm: [f64; 5],
    limits: [f64; 4],
    rounding_mm: f64,
    tick_s: f64,
}

impl Differences {
    /// `rounding_mm` is how far a position may be off.
    fn new(machine: &Machine, axis: usize, start: Position, rounding_mm: f64) -> Self {
        let JogAxis { feed_mm_s, limits, .. } = machine.axis;
        let limits = [feed_mm_s, limits.accel_mm_s2, limits.jerk_mm_s3, limits.snap_mm_s4];
        Self { axis, past_mm: [start.to_mm(); 5], limits, rounding_mm, tick_s: machine.tick_s }
    }

    fn check(&mut self, now: &Place) -> Result<(), String> {
        self.past_mm.rotate_left(1);
        self.past_mm[4] = now[self.axis].to_mm();
        let mut differences = self.past_mm.to_vec();
        for (order, &limit) in (1..).zip(&self.limits) {
            differences = differences.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let bound = limit * self.tick_s.powi(order) * (1.0 + 1e-9) + self.rounding_mm * 2_f64.powi(order);
            let found = differences.last().copied().unwrap_or(0.0);
            if found.abs() > bound {
                return Err(format!("difference of order {order}: {found} mm, bound {bound}"));
            }
        }
        Ok(())
    }
}

/// What comes of a press of a key.
#[derive(Debug, PartialEq)]
enum Outcome {
    /// Where it was to go.
    Arrived,
    /// Released before.
    Released,
}

/// One press, from `start`, until it rests; the key is released before tick `release`, the feed changed at random.
fn press<R: Real>(
    machine: &Machine,
    start: Place,
    (axis, target, feed_mm_s): (usize, JogTarget, f64),
    release: u64,
    random: &mut Random,
    rounding_mm: f64,
) -> Result<(Place, Outcome), String> {
    let jog = Jog::new(&machine.axis, axis, start, target, feed_mm_s, machine.tick_s)
        .map_err(|error| format!("{target:?}: {error}"))?;
    let end = jog.end();
    let mut streams = LiveStreams::<R, AXES, 32, 16>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut control = LiveControl::<R, AXES, _, _, 64>::new(jog, Pulse::Plateau, machine.tick_s, Leads::NONE);
    let mut executor = Executor::<R, AXES>::new(start);
    // Feed positions are products with 32 bits of the length that they are parts of.
    let rounding_mm = rounding_mm + 2.0_f64.powi(-32) * (end[axis] - start[axis]).to_mm().abs();
    let mut differences = Differences::new(machine, axis, start[axis], rounding_mm);
    let judge = Judge::new(&machine.rules(), machine.tick_s, 1e-5, 0.0);
    let (mut before, mut most) = (start, 1.0_f64);
    for tick in 0..2_000_000 {
        if tick == release {
            control.abort();
        } else if random.chance(0.002) {
            let share = random.between(0.1, 2.0);
            most = most.max(share);
            control.set_override(share).expect("within range");
        }
        control.poll(&mut feeder).map_err(|error| format!("tick {tick}: {error}"))?;
        let Executed { setpoints, motion, state, .. } =
            executor.tick(&mut intake).map_err(|fault| format!("tick {tick}: {fault:?}"))?;
        let now = setpoints.map(|axis| axis.position);
        differences.check(&now).map_err(|error| format!("tick {tick}: {error}"))?;
        let v_mm_s = motion.v_mm_s.to_f64();
        let most_mm_s = machine.axis.feed_mm_s.min(feed_mm_s * most) * (1.0 + 1e-6) + 1e-6;
        if v_mm_s > most_mm_s {
            return Err(format!("tick {tick}: feed {v_mm_s}, asked for at most {most_mm_s}"));
        }
        judge.limits(&along(&motion)).map_err(|error| format!("tick {tick}: {error}"))?;
        for other in (0..AXES).filter(|&other| other != axis) {
            if now[other] != start[other] {
                return Err(format!("tick {tick}: axis {other} moves in a jog of axis {axis}"));
            }
        }
        // Between start and end, on the way there.
        let whole = (end[axis] - start[axis]).to_mm();
        let (was, is) = [before, now].map(|place| (place[axis] - start[axis]).to_mm() / whole).into();
        let rounding = 2.0 * rounding_mm / whole.abs();
        if is < was - rounding || !(-rounding..=1.0 + rounding).contains(&is) {
            return Err(format!("tick {tick}: from {was} to {is} of the way to {end:?}"));
        }
        before = now;
        if state != ExecState::Moving {
            match control.state(&feeder) {
                State::Done => return Ok((now, Outcome::Arrived)),
                State::Aborted => return Ok((now, Outcome::Released)),
                _ => {}
            }
        }
    }
    Err("no end".to_owned())
}

fn presses<R: Real>(seed: u64, rounding_mm: f64) -> Result<[usize; 4], String> {
    let mut random = Random::new(seed);
    let machine = Machine::random(&mut random);
    let Travel { least, greatest } = machine.travel;
    let inside = |random: &mut Random| least + mm(random.unit() * (greatest - least).to_mm());
    let mut place: Place = core::array::from_fn(|_| inside(&mut random));
    // Outside of the travel, as after a change of the soft limits.
    if random.chance(0.2) {
        place[0] = greatest + mm(random.log(0.01, 20.0));
    }
    let [mut arrived, mut at_limit, mut released, mut refused] = [0; 4];
    for _ in 0..12 {
        let axis = random.below(AXES);
        let positive = random.chance(0.5);
        let target = if random.chance(0.5) {
            JogTarget::Continuous(if positive { Direction::Positive } else { Direction::Negative })
        } else {
            let by = mm(random.log(1e-4, 50.0));
            JogTarget::By(if positive { by } else { -by })
        };
        let feed_mm_s = machine.axis.feed_mm_s * random.log(0.01, 1.0);
        let here = place[axis];
        let is_outwards = if positive { here >= greatest } else { here <= least };
        if is_outwards {
            let limit = if positive { greatest } else { least };
            let refusal = Jog::new(&machine.axis, axis, place, target, feed_mm_s, machine.tick_s).map(|_| ());
            assert_eq!(refusal, Err(JogError::AtLimit { position: here, limit }), "seed {seed}");
            refused += 1;
            continue;
        }
        let limit = if positive { greatest } else { least };
        let end = match target {
            JogTarget::Continuous(_) => limit,
            JogTarget::By(by) if positive => (here + by).min(limit),
            JogTarget::By(by) => (here + by).max(limit),
        };
        // No key is held for minutes.
        let is_long = (end - here).to_mm().abs() / feed_mm_s > 30.0;
        let release = if is_long || random.chance(0.5) { random.log(1.0, 4000.0) as u64 } else { u64::MAX };
        let asked = (axis, target, feed_mm_s);
        let (now, outcome) = press::<R>(&machine, place, asked, release, &mut random, rounding_mm)
            .map_err(|error| format!("{machine:?} from {here:?}, {asked:?}: {error}"))?;
        match outcome {
            // Exactly.
            Outcome::Arrived if now[axis] == end => {
                arrived += 1;
                at_limit += usize::from(end == limit);
            }
            Outcome::Arrived => return Err(format!("ends at {:?} for {end:?}", now[axis])),
            Outcome::Released => released += 1,
        }
        place = now;
    }
    Ok([arrived, at_limit, released, refused])
}

#[test]
fn keys_pressed_at_random_move_within_limits_to_exact_ends() {
    let mut totals = [0; 4];
    let first = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(1);
    let machines = motion_tests::from_env("MOTION_TEST_PROGRAMS").unwrap_or(120);
    for seed in first..first + machines {
        let counts = match seed % 3 {
            // f32 rounds what is local to a piece of 16 mm.
            0 => presses::<f32>(seed, 16.0 * f64::from(f32::EPSILON)),
            1 => presses::<f64>(seed, 2.0_f64.powi(-32)),
            _ => presses::<Fixed>(seed, 2.0_f64.powi(-29)),
        };
        let counts = counts.unwrap_or_else(|error| panic!("MOTION_TEST_SEED={seed}: {error}"));
        totals.iter_mut().zip(counts).for_each(|(total, count)| *total += count);
    }
    let [arrived, at_limit, released, refused] = totals;
    println!("{arrived} arrived, {at_limit} of them at a soft limit, {released} released, {refused} refused");
    assert!(arrived > 0 && at_limit > 0 && released > 0);
}

#[test]
fn what_can_not_be_jogged_is_refused() {
    let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
    let travel = Travel { least: mm(-10.0), greatest: mm(20.0) };
    let axis = JogAxis { feed_mm_s: 50.0, limits, pulse: Pulse::Plateau, travel: Some(travel) };
    let up = JogTarget::Continuous(Direction::Positive);
    let jog = |config: &JogAxis, axis, from: f64, target, feed| {
        Jog::new(config, axis, [mm(0.0), mm(from)], target, feed, 5e-4)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    let refused = |config: &JogAxis, number, from, target, feed| {
        jog(config, number, from, target, feed).expect_err("refused")
    };
    assert_eq!(jog(&axis, 1, 5.0, up, 50.0), Ok(()));
    assert_eq!(refused(&axis, 2, 5.0, up, 5.0), "axis 2: expected one of 2, from 0");
    for feed in [0.0, -1.0, 50.001, f64::NAN, f64::INFINITY] {
        let expected = format!("feed {feed} mm/s: expected above 0, at most 50");
        assert_eq!(refused(&axis, 1, 5.0, up, feed), expected);
    }
    assert_eq!(
        refused(&axis, 1, 5.0, JogTarget::By(Position::ZERO), 5.0),
        "a distance of 0: expected a distance to go"
    );
    let outwards = |mm: f64| format!("at {mm} mm outwards: expected inwards only from the soft limit 20 mm");
    assert_eq!(refused(&axis, 1, 20.0, up, 5.0), outwards(20.0));
    assert_eq!(refused(&axis, 1, 21.5, JogTarget::By(mm(1.0)), 5.0), outwards(21.5));
    assert_eq!(jog(&axis, 1, 21.5, JogTarget::By(mm(-1.0)), 5.0), Ok(()));
    let unknown = JogAxis { travel: None, ..axis };
    assert!(refused(&unknown, 1, 5.0, up, 5.0).starts_with("a jog without an end: expected soft limits"));
    assert_eq!(jog(&unknown, 1, 5.0, JogTarget::By(mm(100.0)), 5.0), Ok(()));
    let end = "an end at 1000001 mm: expected within 1000000 mm";
    assert_eq!(refused(&unknown, 1, 2.0, JogTarget::By(mm(999_999.0)), 5.0), end);
    let swapped = JogAxis { travel: Some(Travel { least: mm(20.0), greatest: mm(-10.0) }), ..axis };
    let order = "soft limits 20 and -10 mm: expected the lesser one first";
    assert_eq!(refused(&swapped, 1, 5.0, up, 5.0), order);
    let stiff = JogAxis { limits: Limits { jerk_mm_s3: 0.0, ..limits }, ..axis };
    assert!(refused(&stiff, 1, 5.0, up, 5.0).starts_with("jerk limit 0"));
}
