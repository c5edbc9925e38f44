//! Identified and tuned from recordings alone, then driven round circles, through the kernel in f32.
//!
//! S4's machine had 4 µm of following error at 4 Hz, a contour error of 20 µm at 10 Hz, and 32 µm of form deviation at
//! its resonance of 13 Hz.

use motion_host::drive::circle::{self, CircleFigures};
use motion_host::drive::circle_motion::Circle;
use motion_host::drive::experiment::Recording;
use motion_host::drive::learning::{Ending, LearningOptions, learn};
use motion_host::machine::Machine;
use motion_host::simulate::RunOptions;
use motion_host::tuning::{AxisTuning, Margins, Method, identify_axes, propose};
use motion_tests::figures::{Table, hold};

use motion_tests::random::Random;

const FEED_MM_S: f64 = 2150.0 / 60.0;
/// What identification is off by at most, as a part, as docs/PROMISES.md states it.
const PART_OFF_MAX: f64 = 0.02;

/// `machine` with X and Y tuned.
fn tuned(machine: &Machine, method: Method) -> (Machine, Vec<AxisTuning>) {
    let found = identify_axes(machine, &[0, 1]).expect("an identification");
    let mut tuned = machine.clone();
    let mut tunings = vec![];
    for (axis, found) in tuned.axes.iter_mut().zip(&found) {
        let tuning = propose(axis, found, method, machine.tick_s).expect("a proposal");
        axis.gains = tuning.gains;
        axis.feedforward = tuning.feedforward;
        axis.output_offset_v = tuning.output_offset_v;
        tunings.push(tuning);
    }
    (tuned, tunings)
}

fn circle(machine: &Machine, frequency_hz: f64) -> CircleFigures {
    let figures = circle::measure(machine, frequency_hz, FEED_MM_S).expect("a circle");
    let [x, y] = figures.following_um;
    println!(
        "{frequency_hz:5} Hz: following {x:.3} {y:.3} µm, contour {:.3} µm, form {:.3} µm",
        figures.contour_um(),
        figures.form_um()
    );
    figures
}

#[test]
fn tuned_machine_is_an_order_better_than_the_paper() {
    let reference = Machine::reference();
    let (machine, tunings) = tuned(&reference, Method::Inverse);
    for tuning in &tunings {
        println!("{:?}", tuning.margins);
        assert!(tuning.margins.is_stable());
    }
    let slow = circle(&machine, 4.0);
    assert!(slow.following_um.iter().all(|error_um| *error_um <= 0.5), "{slow:?}");
    for frequency_hz in 1..=28 {
        let figures = circle(&machine, f64::from(frequency_hz));
        assert!(figures.contour_um() <= 5.0, "{figures:?}");
        assert!(frequency_hz != 13 || figures.form_um() <= 3.0, "{figures:?}");
    }
    let mut table = Table::new(&[
        "circles at 2.15 m/min",
        "published",
        "V+A+J as published, simulated",
        "after `motion drive tune`",
    ]);
    let mut row = |what: &str, published: &str, frequency_hz: f64, of: fn(&CircleFigures) -> f64| {
        let figures =
            [&reference, &machine].map(|machine| format!("{:.2}", of(&circle(machine, frequency_hz))));
        let [before, after] = figures;
        table.row(&[what, published, before.as_str(), after.as_str()]);
    };
    row("following error of X at 4 Hz [µm]", "4", 4.0, |figures| figures.following_um[0]);
    row("following error of Y at 4 Hz [µm]", "–", 4.0, |figures| figures.following_um[1]);
    row("contour error at 10 Hz [µm]", "20", 10.0, CircleFigures::contour_um);
    row("contour error at 13 Hz, the bed's resonance [µm]", "–", 13.0, CircleFigures::contour_um);
    row("form deviation at 13 Hz [µm]", "32", 13.0, CircleFigures::form_um);
    row("contour error at 28 Hz [µm]", "–", 28.0, CircleFigures::contour_um);
    hold("axis", &table, 0.1).unwrap_or_else(|difference| panic!("{difference}"));
}

/// The feedforward stays, the plant changes.
fn changed(machine: &Machine, change: &dyn Fn(&mut hal_sim::DriveParameters)) -> Machine {
    let mut machine = machine.clone();
    for axis in &mut machine.axes[..2] {
        change(&mut axis.drive);
    }
    machine
}

/// Each of Kv, Ti, dead time and inertia off by a fifth, then all of them slow together. Y has three times the friction
/// of X, whose compensation is off with Kv, and keeps more error. docs/PROMISES.md states these figures.
#[test]
fn a_fifth_of_any_parameter_may_change() {
    type Change = fn(&mut hal_sim::DriveParameters, f64);
    let (machine, _) = tuned(&Machine::reference(), Method::Inverse);
    let parameters: [(&str, Change); 4] = [
        ("Kv", |drive, by| drive.velocity_gain_per_s *= by),
        ("Ti", |drive, by| drive.integral_time_s *= by),
        ("dead time", |drive, by| drive.dead_time_s *= by),
        ("inertia", |drive, by| drive.load_inertia_ratio = by - 1.0),
    ];
    for (name, change) in parameters {
        for by in [0.8, 1.2] {
            println!("{name} × {by}");
            let machine = changed(&machine, &|drive| change(drive, by));
            let following_um = circle(&machine, 4.0).following_um;
            assert!(following_um[0] <= 0.95 && following_um[1] <= 1.5, "{name} {by}: {following_um:?}");
            for frequency_hz in [10.0, 13.0, 16.0, 19.0, 22.0, 25.0] {
                let contour_um = circle(&machine, frequency_hz).contour_um();
                assert!(contour_um <= 11.0, "{name} {by}, {frequency_hz} Hz: {contour_um}");
            }
        }
    }
    println!("all slow");
    let machine = changed(&machine, &|drive| {
        drive.velocity_gain_per_s /= 1.2;
        for time_s in [&mut drive.integral_time_s, &mut drive.dead_time_s, &mut drive.current_lag_s] {
            *time_s *= 1.2;
        }
        drive.load_inertia_ratio = 0.2;
    });
    let following_um = circle(&machine, 4.0).following_um;
    assert!(following_um[0] <= 2.95 && following_um[1] <= 3.35, "{following_um:?}");
    for frequency_hz in [8.0, 11.0, 16.0, 19.0] {
        let contour_um = circle(&machine, frequency_hz).contour_um();
        assert!(contour_um <= 20.0, "{frequency_hz} Hz: {contour_um}");
    }
}

/// A corner of a fifth of Kv, Ti, dead time, inertia and current lag, by its bits, with friction changed, too.
fn corner(machine: &Machine, corner: u32, friction: f64) -> Machine {
    let by = |bit: u32| if corner >> bit & 1 == 0 { 0.8 } else { 1.2 };
    changed(machine, &|drive| {
        drive.velocity_gain_per_s *= by(0);
        drive.integral_time_s *= by(1);
        drive.dead_time_s *= by(2);
        drive.load_inertia_ratio = by(3) - 1.0;
        drive.current_lag_s *= by(4);
        drive.coulomb_friction_mm_s2 *= friction;
    })
}

/// All corners, with friction as it was and a fifth off.
fn corners(machine: &Machine) -> impl Iterator<Item = (String, f64, Machine)> {
    (0..32).flat_map(|number| [1.0, 0.8, 1.2].map(|friction| (number, friction))).map(|(number, friction)| {
        (format!("{number:05b}, friction × {friction}"), friction, corner(machine, number, friction))
    })
}

/// Where friction is known, the worst corner has Kv low and all else slow. What friction lacks in the inverse is a step at
/// each reversal, which bandwidth bounds.
#[test]
fn a_fifth_of_all_parameters_may_change_at_once() {
    let (machine, tunings) = tuned(&Machine::reference(), Method::Inverse);
    let [mut known_um, mut unknown_um] = [[0.0_f64; 2]; 2];
    for (name, friction, machine) in corners(&machine) {
        let following_um = circle(&machine, 4.0).following_um;
        println!("{name}: {following_um:.2?} µm");
        let worst_um = if friction == 1.0 { &mut known_um } else { &mut unknown_um };
        for (worst_um, found_um) in worst_um.iter_mut().zip(following_um) {
            *worst_um = worst_um.max(found_um);
        }
        for (axis, tuning) in tunings.iter().enumerate() {
            let margins = Margins::of(&machine.axes[axis].drive, tuning.gains, machine.tick_s);
            assert!(margins.is_stable(), "{name}, axis {axis}: {margins:?}");
        }
    }
    assert!(known_um[0] <= 3.15 && known_um[1] <= 3.7, "{known_um:?}");
    assert!(unknown_um[0] <= 3.2 && unknown_um[1] <= 4.7, "{unknown_um:?}");
}

/// What the inverse lacks of a drive that is another one by now, learning by the drive that it was makes up for in two repeats:
/// in every corner, friction among what is off.
#[test]
fn two_repeats_make_up_for_a_fifth_of_all_parameters() {
    let (machine, _) = tuned(&Machine::reference(), Method::Inverse);
    let known = machine.axes.each_ref().map(|axis| axis.drive.into());
    let options = LearningOptions { repeats: 2, ending: Ending::Repeats, ..LearningOptions::default() };
    let motion = Circle { settle_s: 0.5, measured_s: 0.5, ..Circle::new(4.0, FEED_MM_S) };
    let mut worst_um = [0.0_f64; 2];
    for (name, _, machine) in corners(&machine) {
        let learnt = learn(&machine, &motion, &known, &options).expect("learns");
        assert!(learnt.best_repeat > 0, "{name}: {:?}", learnt.repeats);
        let run = RunOptions { correction: Some(&learnt.best), ..RunOptions::default() };
        let recording = motion.record_with(&run, &machine).expect("a run");
        let following_um = circle::figures(&recording, &motion).expect("a circle").following_um;
        println!("{name}: {following_um:.2?} µm");
        for (worst_um, found_um) in worst_um.iter_mut().zip(following_um) {
            *worst_um = worst_um.max(found_um);
        }
    }
    assert!(worst_um[0] <= 0.3 && worst_um[1] <= 0.6, "{worst_um:?}");
}

/// Two integrals would move an axis with friction to and fro for ever, which is why ki stays 0. An axis that sticks with up to ten
/// times the friction is pushed to the count and stays there.
#[test]
fn a_tuned_axis_rests() {
    let (tuned, _) = tuned(&Machine::reference(), Method::Inverse);
    let moves = "G1 X10.00003 Y5.00007 F1000\nG4 P3\nG1 X0.01234 Y0.00321 F50\nG4 P8\n";
    for (friction, ki_per_s2) in [(1.0, 0.0), (10.0, 0.0), (1.0, 25_000.0), (10.0, 25_000.0)] {
        let mut machine = changed(&tuned, &|drive| drive.coulomb_friction_mm_s2 *= friction);
        machine.axes.iter_mut().for_each(|axis| axis.gains.ki_per_s2 = ki_per_s2);
        let run = Recording::of("rest".to_owned(), moves, machine, 1.0).expect("a run");
        let rest = &run.ticks[run.ticks.len() - 2000..];
        for axis in 0..2 {
            let span_um = span(rest.iter().map(|tick| tick.axes[axis].err_um));
            let span_v = span(rest.iter().map(|tick| tick.axes[axis].out_v));
            println!("friction × {friction}, ki {ki_per_s2}, axis {axis}: {span_um:.2} µm, {span_v:.4} V");
            // A count, and the rounding of its millimetres.
            let rests = span_um <= 0.1 + 1e-6;
            assert_eq!(
                rests,
                ki_per_s2 == 0.0,
                "friction × {friction}, axis {axis}: {span_um} µm, {span_v} V"
            );
        }
    }
}

fn span(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
}

/// Machines whose Y axis is S4's with every parameter up to 30 % off, with three encoders: found through the kernel,
/// tuned, and then compared with what they are.
fn drives_are_found_tuned_and_stable(count: u64) {
    let one = |seed: u64| {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        let axis = &mut machine.axes[1];
        axis.mm_per_count = [1e-4, 5e-4, 1e-3][(seed % 3) as usize];
        let mut off = |value: &mut f64| *value *= 0.7 + 0.6 * random.unit();
        let drive = &mut axis.drive;
        off(&mut drive.velocity_gain_per_s);
        off(&mut drive.integral_time_s);
        off(&mut drive.current_lag_s);
        off(&mut drive.dead_time_s);
        off(&mut drive.accel_limit_mm_s2);
        off(&mut drive.coulomb_friction_mm_s2);
        off(&mut drive.viscous_friction_per_s);
        let bed = drive.bed.as_mut().expect("Y has a bed");
        off(&mut bed.frequency_hz);
        off(&mut bed.damping_ratio);
        off(&mut bed.mass_ratio);
        let drive = *drive;
        let found = identify_axes(&machine, &[1]).expect("an identification").remove(0);
        let parts = |found: f64, truth: f64| (found / truth - 1.0).abs();
        let values = found.parameters;
        let errors = [
            parts(values.velocity_gain_per_s.value, drive.velocity_gain_per_s),
            parts(values.integral_time_s.value, drive.integral_time_s),
            parts(values.accel_limit_mm_s2.value, drive.accel_limit_mm_s2),
            parts(values.coulomb_friction_mm_s2.value, drive.coulomb_friction_mm_s2),
            parts(values.bed.map_or(0.0, |bed| bed.frequency_hz.value), drive.bed.unwrap().frequency_hz),
        ];
        let delay_s = drive.dead_time_s + drive.current_lag_s + 0.5 * machine.tick_s;
        let delay_off_s = (values.total_delay_s.value - delay_s).abs();
        let tuning = propose(&machine.axes[1], &found, Method::Inverse, machine.tick_s).expect("a proposal");
        let margins = Margins::of(&drive, tuning.gains, machine.tick_s);
        let axis = &mut machine.axes[1];
        (axis.gains, axis.feedforward) = (tuning.gains, tuning.feedforward);
        axis.output_offset_v = tuning.output_offset_v;
        let slow = circle::measure(&machine, 4.0, FEED_MM_S).expect("a circle").following_um[1];
        let counts = slow / machine.axes[1].mm_per_count / 1e3;
        println!(
            "seed {seed}: off by {errors:.4?}, delay {:.2} µs; {margins:.2?}; at 4 Hz {slow:.3} µm",
            delay_off_s * 1e6
        );
        assert!(
            errors.iter().all(|part| *part < PART_OFF_MAX) && delay_off_s < 1e-4,
            "seed {seed}: {errors:?} {delay_off_s}"
        );
        // Designed for 40° and a factor of 2 in the model that was found.
        assert!(margins.phase_deg > 38.0 && margins.gain > 1.9, "seed {seed}: {margins:?}");
        // The encoder's rounding, and as much again; the published machine: 4 µm.
        assert!(slow < 0.5 || counts < 1.0, "seed {seed}: {slow} µm, {counts} counts");
    };
    std::thread::scope(|scope| {
        for first in [0, 1] {
            scope.spawn(move || (first..count).step_by(2).for_each(one));
        }
    });
}

#[test]
fn twelve_drives_are_found_tuned_and_stable() {
    drives_are_found_tuned_and_stable(12);
}

#[test]
#[ignore = "takes some minutes"]
fn fifty_drives_are_found_tuned_and_stable() {
    drives_are_found_tuned_and_stable(50);
}
