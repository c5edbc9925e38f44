//! Stops on a straight from states of the law, driven under live control: how much longer than the least time
//! they take, and how much the feed rises first.

use std::convert::Infallible;

use motion_kernel::exec::Executor;
use motion_kernel::law::{Law, PlannedRamp, Pulse, Ramp};
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::program::{Allowed, Item, PathBlock};
use motion_kernel::queue::{LiveStreams, PathRules};
use motion_kernel::units::Position;
use motion_tests::figures::{Table, hold};
use serde_json::Value;

use super::{GROWTH, Machine, machines, number};

/// Ticks in the least time of a stop: what rounding to ticks may add is a five-hundredth.
const TICKS: f64 = 500.0;
/// The greatest medians: on the reference machine, and on the others.
const MEDIANS_MAX: [f64; 2] = [1.3, 1.7];
/// How far the feed may rise on the reference machine, beyond 1.15 times the least possible peak \[mm/s\].
const RISE_MAX_MM_S: f64 = 2.0;

fn at(mm: f64) -> Position {
    Position::from_mm(mm).expect("in range")
}

/// A stretch: up to the first feed of the case's ramp, a cruise, the ramp, a cruise, and a rest.
fn items(law: &Law<f64>, ramp: &Ramp<f64>, cruise_s: f64) -> Vec<Item<1>> {
    let up = Ramp::new(law, 0.0, ramp.from_mm_s);
    let down = Ramp::new(law, ramp.to_mm_s, 0.0);
    let room_s = 4.0 * law.ramp_time_s(ramp.from_mm_s.max(ramp.to_mm_s));
    let feeds: Vec<PlannedRamp> =
        [up, Ramp::cruise(ramp.from_mm_s, cruise_s), *ramp, Ramp::cruise(ramp.to_mm_s, room_s), down]
            .map(|ramp| PlannedRamp { ramp, length: at(ramp.length_mm()) })
            .to_vec();
    let length = feeds.iter().fold(Position::ZERO, |sum, feed| sum + feed.length);
    let cap_mm_s = ramp.from_mm_s.max(ramp.to_mm_s);
    let allowed = Allowed { cap_mm_s, limits: law.limits() };
    let mut items = vec![
        Item::Block(PathBlock::new(length, cap_mm_s, allowed, allowed, 0.0)),
        Item::Line { line: 1, start: [Position::ZERO], direction: [1.0], length },
    ];
    items.extend(feeds.into_iter().map(Item::Feed));
    items.push(Item::EndOfStretch([length]));
    items
}

/// Time and peak of a stop from the case's state \[s, mm/s\].
fn stopped(machine: &Machine, case: &Value) -> [f64; 2] {
    let law = machine.law(Pulse::Plateau);
    let ramp = Ramp::new(&law, number(case, "from_mm_s"), number(case, "to_mm_s"));
    let tick_s = number(case, "time_s") / TICKS;
    // The state is that at the end of a tick.
    let before_s = law.ramp_time_s(ramp.from_mm_s) + number(case, "at_s");
    let ticks = (before_s / tick_s).ceil() + 1.0;
    let items = items(&law, &ramp, ticks * tick_s - before_s);
    let rules = PathRules {
        limits: law.limits(),
        feed_mm_s: ramp.from_mm_s.max(ramp.to_mm_s),
        junction_angle_rad: 0.01,
        junction_gap_mm: 5e-6,
    };
    let mut streams = LiveStreams::<f64, 1, 64, 16>::new();
    let (mut feeder, mut intake) = streams.split(rules, [Position::ZERO]);
    let source = items.into_iter().map(Ok::<_, Infallible>);
    let mut control = LiveControl::<f64, 1, _, _, 64>::new(source, Pulse::Plateau, tick_s, Leads::NONE);
    let mut executor = Executor::new([Position::ZERO]);
    let mut tick = |control: &mut LiveControl<f64, 1, _, _, 64>| {
        control.poll(&mut feeder).expect("items that can be executed");
        let motion = executor.tick(&mut intake).expect("no fault").motion;
        (motion, control.state(&feeder))
    };
    let mut state = tick(&mut control).0;
    for _ in 1..ticks as u64 {
        state = tick(&mut control).0;
    }
    let v_mm_s = number(case, "v_mm_s");
    assert!((state.v_mm_s - v_mm_s).abs() <= 1e-6 * v_mm_s, "{} of {case}", state.v_mm_s);
    control.hold();
    let (mut count, mut peak_mm_s) = (0.0, v_mm_s);
    loop {
        let (motion, state) = tick(&mut control);
        (count, peak_mm_s) = (count + 1.0, motion.v_mm_s.max(peak_mm_s));
        assert!(count < 100.0 * TICKS, "no rest: {case}");
        if motion.v_mm_s <= 0.0 && state == State::Held {
            return [count * tick_s, peak_mm_s];
        }
    }
}

/// The share of the sorted values up to which it is.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[(share * (sorted.len() - 1) as f64) as usize]
}

#[test]
fn stops_are_as_near_to_the_least_time_as_promised() {
    let mut table =
        Table::new(&["machine", "median", "90 %", "99 %", "all", "peak beyond 1.15 times the least [mm/s]"]);
    for machine in machines(include_str!("../../optimum/stops.json")) {
        let (mut ratios, mut rise_mm_s) = (Vec::new(), f64::NEG_INFINITY);
        for case in machine.cases("stops") {
            let [time_s, peak_mm_s] = stopped(&machine, case);
            let ratio = time_s / number(case, "time_s");
            assert!(ratio >= 1.0 - 1e-4, "{ratio}: {case}");
            ratios.push(ratio);
            rise_mm_s = rise_mm_s.max(peak_mm_s - 1.15 * number(case, "peak_mm_s"));
        }
        ratios.sort_by(f64::total_cmp);
        let median = quantile(&ratios, 0.5);
        let is_reference = machine.name == "reference";
        assert!(median <= MEDIANS_MAX[usize::from(!is_reference)], "{}: {median}", machine.name);
        assert!(!is_reference || rise_mm_s <= RISE_MAX_MM_S, "{rise_mm_s} mm/s");
        let cells = [0.5, 0.9, 0.99, 1.0].map(|share| format!("{:.2}", quantile(&ratios, share)));
        let row = [machine.name()].into_iter().chain(cells).chain([format!("{rise_mm_s:.1}")]);
        table.row(&row.collect::<Vec<_>>());
    }
    hold("optimum-stops", &table, GROWTH).unwrap_or_else(|error| panic!("{error}"));
}
