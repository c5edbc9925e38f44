//! The stringer flange of S3: the published plan, and the whole pipeline on its G-code.

use motion_host::machine::Machine;
use motion_host::planning::{Mode, Plan, plan_blocks};
use motion_host::simulate::{Number, RunOptions, RunSummary, run_with};
use motion_kernel::law::Pulse;

const PROGRAM: &str = include_str!("../../host/src/cli/stringer.ngc");

/// Lengths of R4 × 75° and R10 × 150°; ceilings cbrt(J·R²) and √(A·R) without sharing, as feeds.
const BLOCKS: &str = r#"{
    "limits": {"accel_mm_s2": 500, "jerk_mm_s3": 5000, "snap_mm_s4": 400000},
    "start_feed_mm_s": 0, "end_feed_mm_s": 0,
    "blocks": [
        {"length_mm": 50, "feed_mm_s": 83.33333333333333},
        {"length_mm": 5.235987755982989, "feed_mm_s": 43.08869380063767},
        {"length_mm": 26.179938779914945, "feed_mm_s": 70.71067811865476},
        {"length_mm": 5.235987755982989, "feed_mm_s": 43.08869380063767},
        {"length_mm": 25, "feed_mm_s": 83.33333333333333}
    ]
}"#;

/// Half of the last printed digit.
fn printed(found: f64, printed: f64, digits: i32) {
    assert!((found - printed).abs() <= 0.5 * 10.0_f64.powi(-digits), "{found}, printed {printed}");
}

#[test]
fn per_block_plan_is_the_published_one() {
    let plan = plan_blocks("stringer.json", BLOCKS.as_bytes(), Mode::PerBlock).expect("a plan");
    assert!((plan.time_s - 2.097_975_247_451_847).abs() < 1e-9, "{}", plan.time_s);

    // Entry, peak and exit feed [mm/s] of every block.
    let feeds = [
        [0.0, 83.3333, 43.0887],
        [43.0887, 43.0887, 43.0887],
        [43.0887, 70.7107, 43.0887],
        [43.0887, 43.0887, 43.0887],
        [43.0887, 72.7017, 0.0],
    ];
    for (block, feeds) in plan.blocks.iter().zip(feeds) {
        let found = [block.enter_mm_s, block.peak_mm_s, block.exit_mm_s];
        found.into_iter().zip(feeds).for_each(|(found, feed)| printed(found, feed, 4));
    }
    // Length [mm] and duration [ms] of every ramp and cruise, in path order.
    let segments = [
        (15.2145, 365.148),
        (18.7454, 224.945),
        (16.0401, 253.755),
        (5.2360, 121.516),
        (11.9618, 210.227),
        (2.2563, 31.909),
        (11.9618, 210.227),
        (5.2360, 121.516),
        (12.6021, 217.671),
        (12.3979, 341.061),
    ];
    assert_eq!(plan.feed.len(), segments.len());
    for (feed, (length_mm, time_ms)) in plan.feed.iter().zip(segments) {
        let time_s = feed.time_s();
        printed(feed.length_mm(), length_mm, 4);
        // The table cuts 121.51651 to 121.516; the others are rounded.
        assert!((time_s * 1e3 - time_ms).abs() <= 0.52e-3, "{}, printed {time_ms}", time_s * 1e3);
    }
}

fn planned(machine: &Machine) -> Plan {
    motion_tests::check::planned(PROGRAM, machine).expect("a plan")
}

/// S3's result on the reference machine: N2 and N4 limited by jerk, N3 by acceleration, N5 by braking.
/// The acceleration-step limit of 500 mm/s² must not be what limits them.
#[test]
fn reasons_are_the_papers() {
    let mut machine = Machine::reference();
    let reasons = |plan: &Plan| -> Vec<String> {
        plan.blocks.iter().map(|block| block.cap_reason.to_string()).collect()
    };
    // With plateaus N5 reaches its feed before it brakes.
    assert_eq!(reasons(&planned(&machine)), ["programmed", "jerk", "acceleration", "jerk", "programmed"]);
    machine.path.pulse = Pulse::Sin2;
    let plan = planned(&machine);
    assert_eq!(reasons(&plan), ["programmed", "jerk", "acceleration", "jerk", "braking"]);
    // Every ceiling but the last block's is reached, the arcs' at both ends of N2 and N4.
    for block in &plan.blocks[..4] {
        assert!((block.peak_mm_s - block.cap_mm_s).abs() < 1e-9, "{block:?}");
    }
    assert!((plan.blocks[0].exit_mm_s - plan.blocks[1].cap_mm_s).abs() < 1e-9);
}

fn executed(machine: &Machine, number: Number) -> RunSummary {
    let plan = planned(machine);
    let mut last = None;
    let summary = run_with(&RunOptions { number, ..RunOptions::default() }, &plan, machine, &mut |tick| {
        last = Some(*tick)
    })
    .expect("a run");
    let last = last.expect("ticks");
    assert!(summary.faults.is_empty(), "{:?}", summary.faults);
    assert!((summary.time_s - summary.planned_time_s).abs() <= summary.tick_s, "{summary:?}");
    // Ends exactly at the programmed point: to a position step of 2⁻³² mm.
    for (axis, end_mm) in last.axes.iter().zip([102.045_923_136, 0.0, 0.0]) {
        assert!((axis.set_mm - end_mm).abs() <= 2.0_f64.powi(-32), "{}", axis.set_mm);
    }
    assert!(summary.axes.iter().all(|axis| axis.end_error_counts.abs() <= 5), "{:?}", summary.axes);
    summary
}

/// Both number types execute the same motion; limits to their own rounding.
#[test]
fn executes_without_a_fault_within_the_limits() {
    let machine = Machine::reference();
    for (number, rounding) in [(Number::F64, 1e-9), (Number::F32, 1e-6), (Number::Fixed, 1e-6)] {
        let summary = executed(&machine, number);
        println!("{number:?} {summary:?}");
        for (quantity, value, limit) in [
            ("feed", summary.max_feed_mm_s, 5000.0 / 60.0),
            ("acceleration", summary.max_accel_mm_s2, machine.path.accel_mm_s2),
            ("jerk", summary.max_jerk_mm_s3, machine.path.jerk_mm_s3),
            ("snap", summary.max_snap_mm_s4, machine.path.snap_mm_s4),
        ] {
            assert!(value <= limit * (1.0 + rounding), "{number:?} {quantity} {value} {limit}");
        }
    }
}

/// What the drive model leads one to expect at a P gain of 230/s: with velocity feedforward alone the
/// inverse series leaves A·a/kp = 1.675 ms·456 mm/s²/(230/s) = 3.3 µm on the ramps, and a step of the
/// acceleration of v²/R = 297 mm/s² where line and arc meet adds its transient; acceleration feedforward
/// takes the first away and leaves the second.
#[test]
fn following_error_falls_with_each_feedforward() {
    let error_um = |accel: bool, jerk: bool| {
        let mut machine = Machine::reference();
        for axis in &mut machine.axes {
            if !accel {
                axis.feedforward.accel_s = 0.0;
            }
            if !jerk {
                axis.feedforward.jerk_s2 = 0.0;
            }
        }
        let axes = executed(&machine, Number::F32).axes;
        let (x, y) = (&axes[0], &axes[1]);
        [
            x.following_error_um_rms,
            y.following_error_um_rms,
            x.following_error_um_max,
            y.following_error_um_max,
        ]
    };
    let (v, va, vaj) = (error_um(false, false), error_um(true, false), error_um(true, true));
    println!("following error X, Y rms; X, Y max [µm]: V {v:.2?}, VA {va:.2?}, VAJ {vaj:.2?}");
    for rms in 0..2 {
        assert!(va[rms] < 0.7 * v[rms], "{v:?} {va:?}");
        assert!(vaj[rms] <= va[rms] * 1.02, "{va:?} {vaj:?}");
    }
    assert!(v[2] < 12.0 && v[3] < 12.0 && vaj[2] < 8.0 && vaj[3] < 8.0, "{v:?} {vaj:?}");
}
