//! What the boards execute: the stringer, generated programs, and a program full of worst ticks.

use core::f64::consts::TAU;

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode, Plan, plan_program};
use motion_kernel::axis::{
    AxisCompensation, Backlash, BedInverse, DriveInverse, Feedforward, PitchError, Table, Tables,
};
use motion_kernel::law::{Law, PlannedRamp, Pulse, Ramp};
use motion_kernel::num::Fixed;
use motion_kernel::program::{Header, Item, write};
use motion_kernel::units::Position;

use motion_tests::check::{machine, planned, program};
use motion_tests::random::Random;

const STRINGER: &str = include_str!("../../../host/src/cli/stringer.ngc");
/// Longer ones take the emulators too long [s].
const TIME_MAX_S: f64 = 4.0;
/// Of programs that a search runs by the thousand [s].
const SEARCHED_TIME_MAX_S: f64 = 1.0;
/// Bytes that fit the smallest board.
const BYTES_MAX: usize = 32 << 10;

fn plan(text: &str, machine: &Machine, mode: Mode) -> Plan {
    let read = gcode::read("board.ngc", text.as_bytes()).expect("G-code");
    plan_program("board.ngc", &read, machine, mode).expect("a plan")
}

/// Checked for both number types, whose pieces are cut alike.
fn executable(plan: &Plan) -> Option<Executable> {
    let executable = Executable::new::<f32>(plan).expect("executable");
    let fixed = Executable::new::<Fixed>(plan).ok()?;
    assert_eq!(executable.items, fixed.items);
    Some(executable)
}

fn bytes(text: &str, machine: &Machine, mode: Mode) -> Vec<u8> {
    executable(&plan(text, machine, mode)).expect("within fixed point").to_bytes(machine)
}

/// With the blocks that live control plans with.
fn live_bytes(text: &str, machine: &Machine, mode: Mode) -> Vec<u8> {
    executable(&plan(text, machine, mode)).expect("within fixed point").to_live_bytes(machine)
}

/// The stringer on the reference machine.
pub(crate) fn stringer() -> Vec<u8> {
    bytes(STRINGER, &Machine::reference(), Mode::Spanning)
}

/// The reference machine with all that feedforward can have on every axis: lead, the drive's inverse with friction and
/// bed, and tables.
fn inverting() -> Machine {
    let mut machine = Machine::reference();
    let bed = BedInverse { frequency_hz: 13.4, damping_ratio: 0.03, mass_ratio: 0.06 };
    for axis in &mut machine.axes {
        axis.feedforward = Feedforward {
            velocity: 1.0,
            lead_s: 0.00167,
            drive: Some(DriveInverse {
                velocity_gain_per_s: 440.0,
                integral_time_s: 0.0275,
                current_lag_s: 0.00037,
                viscous_friction_per_s: 0.08,
                coulomb_friction_mm_s2: 260.0,
                reversal_mm_s: 0.5,
                bed: Some(bed),
            }),
            ..Feedforward::default()
        };
    }
    machine
}

/// The stringer, facets, and the stringer with outputs that saturate, under feedforward that inverts the drive.
pub(crate) fn inverted() -> Vec<Vec<u8>> {
    worst_ticks_of(&inverting())
}

/// With feedforward that inverts the drive, as many pieces a tick as the kernel accepts.
pub(crate) fn densest_inverted() -> Vec<u8> {
    densest_of(&inverting())
}

/// All that feedforward can do: the drive's inverse, tables, and leads that differ by ticks, so that a command is delayed.
pub(crate) fn with_tables() -> Vec<u8> {
    let mut machine = inverting();
    machine.axes[1].feedforward.lead_s = 0.0054;
    let table = |reach: f64| Some(Table::new(reach, &[-0.5, -0.3, -0.25, -0.2, 0.0, 0.1, 0.2, 0.4, 0.6]));
    for axis in &mut machine.axes {
        axis.feedforward.tables = Tables { velocity: table(60.0), accel: table(400.0), jerk: table(4e3) };
    }
    bytes(STRINGER, &machine, Mode::Spanning)
}

/// The stringer with one coefficient of its first arc one last place of an f32 off.
pub(crate) fn stringer_off_by_a_last_place() -> Vec<u8> {
    off_by_a_last_place().to_bytes(&Machine::reference())
}

/// The stringer for live control.
pub(crate) fn live_stringer() -> Vec<u8> {
    live_bytes(STRINGER, &Machine::reference(), Mode::Spanning)
}

/// The stringer, and one a last place off, for live control.
pub(crate) fn live_stringer_and_off_by_a_last_place() -> [Vec<u8>; 2] {
    [live_stringer(), off_by_a_last_place().to_live_bytes(&Machine::reference())]
}

fn off_by_a_last_place() -> Executable {
    let machine = Machine::reference();
    let mut executable = executable(&plan(STRINGER, &machine, Mode::Spanning)).expect("within fixed point");
    let arc = executable.items.iter_mut().find_map(|item| match item {
        Item::Septic { coefficients, .. } => Some(coefficients),
        _ => None,
    });
    let coefficient = &mut arc.expect("the stringer has arcs")[0][0];
    *coefficient = f64::from((*coefficient as f32).next_up());
    executable
}

/// The stringer and facets for live control, on the reference machine and with every drive inverted.
pub(crate) fn worst_live_ticks() -> [Vec<Vec<u8>>; 2] {
    [Machine::reference(), inverting()].map(|machine| worst_live_ticks_of(&machine))
}

fn worst_live_ticks_of(machine: &Machine) -> Vec<Vec<u8>> {
    vec![live_bytes(STRINGER, machine, Mode::Spanning), live_bytes(&facets_text(), machine, Mode::PerBlock)]
}

/// Those on the reference machine with play and an error of every turn on every axis, which are compensated.
pub(crate) fn compensated() -> Vec<Vec<u8>> {
    let mut machine = Machine::reference();
    let points_um: Vec<f64> = (0..32).map(|point| 10.0 * (f64::from(point) * TAU / 32.0).sin()).collect();
    let compensation = AxisCompensation {
        backlash: Some(Backlash { play_mm: 0.02, take_up_s: 0.006 }),
        pitch_error: PitchError::new(0.0, 5.0 / 32.0, &points_um, true),
    };
    machine.axes.iter_mut().for_each(|axis| axis.compensation = Some(compensation));
    worst_live_ticks_of(&machine)
}

/// Those and random programs.
pub(crate) fn live(generated: usize) -> Vec<Vec<u8>> {
    let mut programs = worst_live_ticks().concat();
    programs.extend(generated_by(generated, Executable::to_live_bytes).into_iter().map(|(_, bytes)| bytes));
    programs
}

/// So many random programs that the boards have time and room for, by seed.
pub(crate) fn generated(count: usize) -> Vec<(u64, Vec<u8>)> {
    generated_by(count, Executable::to_bytes)
}

fn generated_by(count: usize, to_bytes: fn(&Executable, &Machine) -> Vec<u8>) -> Vec<(u64, Vec<u8>)> {
    let mut programs = Vec::new();
    for seed in 1.. {
        let mut random = Random::new(seed);
        let machine = machine::gentle(&mut random);
        let fragments = 1 + random.below(3);
        let generated = program::generate(&mut random, fragments, 30.0);
        let Ok(plan) = planned(&generated.text, &machine) else { continue };
        if plan.time_s > TIME_MAX_S {
            continue;
        }
        let Some(bytes) = executable(&plan).map(|executable| to_bytes(&executable, &machine)) else {
            continue;
        };
        if bytes.len() <= BYTES_MAX {
            programs.push((seed, bytes));
        }
        if programs.len() == count {
            break;
        }
    }
    programs
}

/// Whose drives a search's programs are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Drives {
    /// The reference machine's, sometimes too weak for the program: outputs saturate.
    Any,
    /// The reference machine's, which its guards watch.
    Guarded,
    /// With all that feedforward can have.
    Inverted,
}

/// The program of a seed of the search for the longest ticks: the stringer, short lines and arcs, or anything random.
pub(crate) fn searched(seed: u32, drives: Drives, is_live: bool) -> Vec<u8> {
    let mut random = Random::new(u64::from(seed));
    loop {
        let mut machine = machine::gentle(&mut random);
        if drives == Drives::Inverted {
            let inverting = inverting();
            for (axis, inverting) in machine.axes.iter_mut().zip(inverting.axes) {
                axis.feedforward = inverting.feedforward;
            }
        }
        if drives == Drives::Any && random.chance(0.3) {
            for axis in &mut machine.axes {
                axis.output_limit_v = random.between(0.5, 1.5);
                axis.following_error_limit_mm = 100.0;
            }
        }
        let mode = if random.chance(0.5) { Mode::Spanning } else { Mode::PerBlock };
        let text = match random.below(8) {
            0 => STRINGER.to_owned(),
            1..=4 => random_facets(&mut random),
            _ => {
                let fragments = 1 + random.below(4);
                program::generate(&mut random, fragments, 30.0).text
            }
        };
        let read = gcode::read("searched.ngc", text.as_bytes()).expect("G-code");
        let Ok(plan) = plan_program("searched.ngc", &read, &machine, mode) else { continue };
        let is_short = plan.time_s <= SEARCHED_TIME_MAX_S || text == STRINGER;
        let Some(executable) = is_short.then(|| executable(&plan)).flatten() else { continue };
        let bytes = if is_live { executable.to_live_bytes(&machine) } else { executable.to_bytes(&machine) };
        if bytes.len() <= BYTES_MAX {
            return bytes;
        }
    }
}

/// Facets whose lengths and feeds are random.
fn random_facets(random: &mut Random) -> String {
    use std::fmt::Write;
    let path = if random.chance(0.5) { "G61" } else { "G64 P0.02" };
    let mut text = format!("{path} G91 G1 F4000\n");
    let (shortest_mm, longest_mm) = (random.log(0.005, 0.1), random.log(0.2, 3.0));
    for _ in 0..30 + random.below(60) {
        let [x, y] = [0, 1].map(|_| random.log(shortest_mm, longest_mm) * random.sign());
        let feed_mm_min = random.log(500.0, 6000.0);
        let _ = match random.below(6) {
            0 => writeln!(text, "G3 X{x:.3} Y{x:.3} I0 J{x:.3} F{feed_mm_min:.0}\nG1"),
            1 => writeln!(text, "X{x:.3} Y{y:.3} Z{:.3} F{feed_mm_min:.0}", 0.5 * x),
            2 => writeln!(text, "X{x:.3} Y{y:.3}"),
            _ => writeln!(text, "X{:.3} F{feed_mm_min:.0}", x.abs()),
        };
    }
    text + "M2\n"
}

/// Short lines and arcs, planned per block: pieces, segments and phases end all the time, often several in a tick.
pub(crate) fn facets() -> Vec<u8> {
    bytes(&facets_text(), &Machine::reference(), Mode::PerBlock)
}

/// For live control, with some hundred items a second for a quarter of a minute: much more than a board on the link has room
/// for.
pub(crate) fn long() -> Vec<u8> {
    use std::fmt::Write;
    let mut text = "G61 G91 G1\n".to_owned();
    for line in 0..1200 {
        let sign = if line / 200 % 2 == 0 { "" } else { "-" };
        let _ = writeln!(text, "X{sign}0.25 Y0.02 F{}", 1300 + line * 37 % 400);
    }
    live_bytes(&text, &Machine::reference(), Mode::Spanning)
}

fn facets_text() -> String {
    use std::fmt::Write;
    let mut text = "G61 G91 G1 F4000\n".to_owned();
    for facet in 0..60 {
        let _ = writeln!(
            text,
            "X{:.3}\nX{:.3} F{}",
            0.02 + 0.004 * f64::from(facet),
            0.9,
            3000 + facet * 37 % 1500
        );
        if facet % 6 == 5 {
            text.push_str("G3 X0.8 Y0.8 I0 J0.8\nG3 X-0.8 Y0.8 I-0.8 J0\nG3 X-0.8 Y-0.8 I0 J-0.8\nG3 X0.8 Y-0.8 I0.8 J0\nG1\n");
        }
    }
    text
}

/// The programs of the budgets: the stringer; facets; the stringer with outputs that saturate.
pub(crate) fn worst_ticks() -> Vec<Vec<u8>> {
    worst_ticks_of(&Machine::reference())
}

fn worst_ticks_of(machine: &Machine) -> Vec<Vec<u8>> {
    let mut weak = machine.clone();
    for axis in &mut weak.axes {
        // 48 mm/s where the program asks for 83: the axes fall behind, and catch up.
        axis.output_limit_v = 1.45;
        axis.following_error_limit_mm = 100.0;
    }
    vec![
        bytes(STRINGER, machine, Mode::Spanning),
        bytes(&facets_text(), machine, Mode::PerBlock),
        bytes(STRINGER, &weak, Mode::Spanning),
    ]
}

/// As many pieces a tick as the kernel accepts: lines that the path passes within little more than a sixteenth of a
/// tick each.
pub(crate) fn densest() -> Vec<u8> {
    densest_of(&Machine::reference())
}

fn densest_of(machine: &Machine) -> Vec<u8> {
    let feed_mm_s = 50.0;
    let length_mm = feed_mm_s * machine.tick_s / 15.5;
    let text = format!("G61 G91 G1 F{}\n", feed_mm_s * 60.0) + &format!("X{length_mm:.7}\n").repeat(6000);
    bytes(&text, machine, Mode::Spanning)
}

/// What the feeder accepts at most: little less than 8 segments of three phases and 16 curved pieces end in every tick,
/// while all outputs saturate. No planner makes such a program.
pub(crate) fn utmost<const AXES: usize>() -> Vec<u8> {
    const SEGMENTS: usize = 3000;
    let machine = Machine::reference();
    let reference = machine.header();
    let mut axis = reference.axes[0];
    // 17 mm/s where 50 are asked for.
    (axis.output_limit_v, axis.following_error_limit_mm) = (0.5, 100.0);
    let header = Header::<AXES> {
        pulse: Pulse::Plateau,
        tick_s: reference.tick_s,
        rules: reference.rules,
        axes: [axis; AXES],
        start: [Position::ZERO; AXES],
    };
    let feed_mm_s = 50.0;
    let law = Law::new(Pulse::Plateau, reference.rules.limits).expect("limits");
    let (up, down) = (Ramp::new(&law, 0.0, feed_mm_s), Ramp::new(&law, feed_mm_s, 0.0));
    // A nanometre a second up and down again, each a third of its time rising, holding and falling.
    let change = |index: usize| {
        let third_s = reference.tick_s / 7.9 / 3.0;
        let (low, high) = (feed_mm_s, feed_mm_s + 1e-9);
        let (from_mm_s, to_mm_s) = if index.is_multiple_of(2) { (low, high) } else { (high, low) };
        Ramp {
            from_mm_s,
            to_mm_s,
            peak_jerk_mm_s3: 1.0,
            edge_s: third_s / 3.0,
            t1_s: third_s,
            t2_s: 2.0 * third_s,
            ..up
        }
    };
    let length = |mm: f64| Position::from_mm(mm).expect("in range");
    let ramps = core::iter::once(up).chain((0..SEGMENTS).map(change)).chain([down]);
    let feed: Vec<Item<AXES>> =
        ramps.map(|ramp| Item::Feed(PlannedRamp { ramp, length: length(ramp.length_mm()) })).collect();
    let of = |items: &[Item<AXES>]| -> i64 {
        let bits = items
            .iter()
            .map(|item| if let Item::Feed(planned) = item { planned.length.to_bits() } else { 0 });
        bits.sum()
    };
    // Straight, but as curves, along the diagonal.
    let along = 1.0 / (AXES as f64).sqrt();
    let mut coefficients = [[0.0; 7]; AXES];
    coefficients.iter_mut().for_each(|axis| axis[0] = along);
    let dense_mm = feed_mm_s * reference.tick_s / 15.5;
    let mut pieces = Vec::new();
    let mut start = 0;
    for (bits, longest_mm) in
        [(of(&feed[..1]), 10.0), (of(&feed[1..=SEGMENTS]), dense_mm), (of(&feed[SEGMENTS + 1..]), 10.0)]
    {
        let (begin, parts) = (start, bits / length(longest_mm).to_bits() + 1);
        for part in 1..=parts {
            let end = begin + (i128::from(bits) * i128::from(part) / i128::from(parts)) as i64;
            let at = [length(along * Position::from_bits(start).to_mm()); AXES];
            let length = Position::from_bits(end - start);
            pieces.push((start, Item::Septic { line: 1, start: at, coefficients, length }));
            start = end;
        }
    }
    // Both streams in the order of where their items start.
    let mut items = Vec::new();
    let (mut pieces, mut at) = (pieces.into_iter().peekable(), 0);
    for item in feed {
        while let Some((_, piece)) = pieces.next_if(|(start, _)| *start <= at) {
            items.push(piece);
        }
        at += of(&[item]);
        items.push(item);
    }
    items.extend(pieces.map(|(_, piece)| piece));
    items.push(Item::EndOfStretch([length(along * Position::from_bits(start).to_mm()); AXES]));
    let mut bytes = Vec::new();
    write(&header, None, &items, &mut bytes).expect("few axes");
    bytes
}

/// The X axis of the stringer's lines alone.
pub(crate) fn one_axis() -> Vec<u8> {
    let machine = Machine::reference();
    let text = "G61 G1 X20 F5000\nX18\nG4 P0.01\nX40 F3000\nX40.3 F5000\nX44\nM2\n";
    let header = machine.header();
    let header = Header::<1> {
        pulse: Pulse::Plateau,
        tick_s: header.tick_s,
        rules: header.rules,
        axes: [header.axes[0]],
        start: [header.start[0]],
    };
    let executable = executable(&plan(text, &machine, Mode::PerBlock)).expect("within fixed point");
    let items: Vec<Item<1>> = executable
        .items
        .into_iter()
        .filter(|item| !matches!(item, Item::Block(_)))
        .map(|item| match item {
            Item::Line { line, start, direction, length } => {
                Item::Line { line, start: [start[0]], direction: [direction[0]], length }
            }
            Item::Septic { .. } => unreachable!("a program of lines"),
            Item::Feed(planned) => Item::Feed(planned),
            Item::EndOfStretch(end) => Item::EndOfStretch([end[0]]),
            Item::Dwell(duration) => Item::Dwell(duration),
            Item::Stop => Item::Stop,
            Item::Switch(to) => Item::Switch(to),
            Item::Block(_) => unreachable!("left out"),
        })
        .collect();
    let mut bytes = Vec::new();
    write(&header, None, &items, &mut bytes).expect("one axis");
    bytes
}
