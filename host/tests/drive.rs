//! The drive experiments through planner, streams and kernel in f32, against the reference machine's figures.

use hal_sim::EncoderNoise;
use motion_host::drive::circle_motion::Circle;
use motion_host::drive::inverse::inverse;
use motion_host::drive::reference::{self, BANDWIDTH_FEED_MM_S, CIRCLE_FEED_MM_S, Comparison};
use motion_host::drive::step::Step;
use motion_host::drive::{DriveError, Terms, bode, circle, experiment, harmonic, inertia};
use motion_host::gcode::Plane;
use motion_host::machine::Machine;
use motion_host::tuning::feedforward::series;
use motion_host::tuning::identify_axes;
use motion_kernel::axis::Feedforward;
use motion_tests::s4::{CONTOUR_V, CONTOUR_VAJ, ContourTable};

#[track_caller]
fn assert_hold(comparisons: &[Comparison]) {
    for comparison in comparisons {
        let figure = comparison.figure;
        println!(
            "{}: {:.3} {}, expected {} ± {}",
            figure.quantity, comparison.measured, figure.unit, figure.expected, figure.tolerance
        );
    }
    let failed: Vec<_> = comparisons.iter().filter(|comparison| !comparison.holds()).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn the_step_has_the_figures_of_s4() {
    let machine = Machine::reference();
    let (figures, _) = Step::reference().measure(&machine).expect("a step");
    assert_hold(&reference::compare_step(&machine, &figures).expect("a step"));
}

#[test]
fn the_set_velocity_steps_within_one_tick() {
    let recording = Step::reference().record(&Machine::reference()).expect("a step");
    let feeds: Vec<f64> = recording.ticks.iter().map(|tick| tick.v_mm_s).collect();
    let first = feeds.iter().position(|&v| v > 0.0).expect("motion");
    assert!((feeds[first] - 120.0).abs() < 1e-4, "{:?}", &feeds[..first + 3]);
    // Open loop: the output is the feed, whatever the error.
    assert!(recording.axis(0).skip(first).take(500).all(|axis| (axis.out_v - 3.6).abs() < 1e-3));
}

#[test]
fn harmonics_have_the_figures_of_s4() {
    assert_hold(&reference::compare_harmonic(&Machine::reference()).expect("harmonics"));
}

#[test]
fn circles_have_the_figures_of_s4() {
    assert_hold(&reference::compare_circle(&Machine::reference()).expect("circles"));
}

/// Velocity and acceleration.
const CONTOUR_VA: ContourTable = [
    (5.57, 0.67),
    (6.11, 0.68),
    (7.07, 0.71),
    (8.53, 0.76),
    (10.41, 0.81),
    (12.57, 0.88),
    (15.01, 0.95),
    (17.56, 1.03),
    (20.39, 1.11),
    (23.37, 1.2),
    (27.18, 1.32),
    (34.0, 1.52),
    (48.2, 1.95),
    (32.16, 1.46),
    (34.49, 1.53),
    (37.54, 1.63),
];

/// All three, the jerk gain of the drive's series.
const CONTOUR_SERIES: ContourTable = [
    (5.54, 0.67),
    (6.01, 0.68),
    (6.78, 0.7),
    (7.87, 0.74),
    (9.1, 0.77),
    (10.39, 0.81),
    (11.55, 0.85),
    (12.5, 0.88),
    (13.26, 0.9),
    (13.85, 0.92),
    (14.7, 0.94),
    (18.04, 1.04),
    (27.97, 1.34),
    (8.59, 0.76),
    (6.54, 0.7),
    (5.03, 0.65),
];

/// The drives' inverse, friction included, without the bed.
const CONTOUR_INVERSE: ContourTable = [
    (0.35, 0.51),
    (0.2, 0.51),
    (0.15, 0.5),
    (0.16, 0.5),
    (0.17, 0.51),
    (0.25, 0.51),
    (0.38, 0.51),
    (0.56, 0.52),
    (0.95, 0.53),
    (1.67, 0.55),
    (3.24, 0.6),
    (7.79, 0.73),
    (16.86, 1.01),
    (10.57, 0.82),
    (7.05, 0.71),
    (5.73, 0.67),
];

/// And with the bed.
const CONTOUR_INVERSE_BED: ContourTable = [
    (0.35, 0.51),
    (0.2, 0.51),
    (0.15, 0.5),
    (0.14, 0.5),
    (0.14, 0.5),
    (0.16, 0.5),
    (0.17, 0.51),
    (0.17, 0.51),
    (0.2, 0.51),
    (0.15, 0.5),
    (0.27, 0.51),
    (0.31, 0.51),
    (0.46, 0.51),
    (0.19, 0.51),
    (0.23, 0.51),
    (0.29, 0.51),
];

#[test]
fn contour_errors_are_those_of_the_reference_model() {
    let machine = Machine::reference();
    let with = |feedforward: &dyn Fn(&hal_sim::DriveParameters) -> Feedforward| {
        let mut machine = machine.clone();
        for axis in &mut machine.axes {
            axis.feedforward = feedforward(&axis.drive);
        }
        machine
    };
    let series = with(&|drive| {
        let [accel_s, jerk_s2] = series(drive, machine.tick_s);
        Feedforward { velocity: 1.0, accel_s, jerk_s2, ..Feedforward::default() }
    });
    let per_axis = with(&|drive| inverse(&hal_sim::DriveParameters { bed: None, ..*drive }, machine.tick_s));
    let whole = with(&|drive| inverse(drive, machine.tick_s));
    for (name, machine, table) in [
        ("V", Terms::V.of(&machine), CONTOUR_V),
        ("VA", Terms::Va.of(&machine), CONTOUR_VA),
        ("VAJ", Terms::Vaj.of(&machine), CONTOUR_VAJ),
        ("series", series, CONTOUR_SERIES),
        ("inverse", per_axis, CONTOUR_INVERSE),
        ("inverse with bed", whole, CONTOUR_INVERSE_BED),
    ] {
        for (index, (expected_um, tolerance_um)) in table.into_iter().enumerate() {
            let frequency_hz = (index + 1) as f64;
            let found_um =
                circle::measure(&machine, frequency_hz, CIRCLE_FEED_MM_S).expect("a circle").contour_um();
            assert!(
                (found_um - expected_um).abs() <= tolerance_um,
                "{name} at {frequency_hz} Hz: {found_um} µm, expected {expected_um} ± {tolerance_um}"
            );
        }
    }
}

/// Radii from 16 m to 0.1 mm: each is planned, held and measured.
#[test]
fn circles_of_every_size_reach_their_feed() {
    let open = experiment::open_loop(&Machine::reference());
    for feed_mm_s in [5.0, CIRCLE_FEED_MM_S, BANDWIDTH_FEED_MM_S, 330.0] {
        for frequency_hz in [0.1, 0.7, 8.0, 28.0, 55.0, 200.0] {
            let circle = Circle::new(frequency_hz, feed_mm_s);
            let recording = circle.record(&open).expect("a circle");
            let ticks = circle.measured(&recording).expect("constant feed");
            let speed = |t: &motion_host::trace::TraceRow| t.axes[0].vel_mm_s.hypot(t.axes[1].vel_mm_s);
            assert!(
                ticks.iter().all(|tick| (speed(tick) / feed_mm_s - 1.0).abs() < 1e-4),
                "{frequency_hz} Hz, {feed_mm_s} mm/s"
            );
        }
    }
}

/// Far below the current limit the linear model says what the axis does; friction costs a part in a thousand.
#[test]
fn a_slow_drive_is_its_linear_model() {
    let mut machine = Machine::reference();
    machine.axes[0].drive.coulomb_friction_mm_s2 = 0.0;
    let found = bode::measure(&machine, 0, 20.0, &[2.0, 10.0, 30.0, 80.0], &mut || {}).expect("curves");
    for point in found.points {
        let (harmonic, model) = (&point.harmonic, &point.model);
        assert!((harmonic.fundamental_ratio / model.ratio - 1.0).abs() < 0.01, "{point:?}");
        assert!((harmonic.phase_rad - model.phase_rad).abs() < 0.01, "{point:?}");
        assert!((point.step.ratio / model.ratio - 1.0).abs() < 0.01, "{point:?}");
        assert!((point.step.phase_rad - model.phase_rad).abs() < 0.02, "{point:?}");
    }
}

#[test]
fn the_z_axis_is_measured_in_its_own_plane() {
    let machine = Machine::reference();
    let circle = Circle { plane: Plane::Zx, ..Circle::new(8.0, 50.0) };
    let found = harmonic::measure(&experiment::open_loop(&machine), &circle).expect("harmonics");
    let [z, x] = found.axes;
    assert_eq!((z.axis, x.axis), (2, 0));
    // The reference machine's Z is like its X.
    assert!((z.fundamental_ratio - x.fundamental_ratio).abs() < 1e-3);
}

/// At 8 Hz a growing load makes a triangle of the velocity, and its plateau is what the limit gives the load.
#[test]
fn a_load_shows_the_current_limit() {
    let machine = Machine::reference();
    let circle = Circle::new(8.0, BANDWIDTH_FEED_MM_S);
    for (load, is_limited) in [(0.0, false), (1.0, true), (2.0, true)] {
        let (found, _) = inertia::measure(&machine, &circle, 0, load).expect("a run");
        assert_eq!(found.is_limited, is_limited, "{found:?}");
        if is_limited {
            let limit_mm_s2 = machine.axes[0].drive.accel_limit_mm_s2 / (1.0 + load);
            assert!((found.plateau_accel_mm_s2 / limit_mm_s2 - 1.0).abs() < 0.03, "{found:?}");
        }
    }
}

/// A slow X and a fast Y are both identified, by motions that X reaches.
#[test]
fn a_slow_axis_is_identified() {
    let mut machine = Machine::reference();
    let x = &mut machine.axes[0];
    (x.mm_s_at_10_v, x.feed_mm_s) = (100.0, 90.0);
    for (axis, found) in identify_axes(&machine, &[0, 1]).expect("both").iter().enumerate() {
        let (found, drive) = (&found.parameters, &machine.axes[axis].drive);
        let parts = [
            found.velocity_gain_per_s.value / drive.velocity_gain_per_s,
            found.integral_time_s.value / drive.integral_time_s,
            found.accel_limit_mm_s2.value / drive.accel_limit_mm_s2,
            found.coulomb_friction_mm_s2.value / drive.coulomb_friction_mm_s2,
        ];
        println!("{parts:.4?}");
        assert!(parts.iter().all(|part| (part - 1.0).abs() < 0.02), "{axis}: {parts:?}");
        assert_eq!(found.bed.is_some(), axis == 1);
    }
}

/// A margin is not known well where the encoder has noise: X is moved once more, by a circle that Y drives with it.
#[test]
fn a_noisy_axis_is_moved_for_longer() {
    let mut machine = Machine::reference();
    let x = &mut machine.axes[0];
    (x.mm_per_count, x.noise) = (4e-3, Some(EncoderNoise { amplitude_counts: 2, seed: 7 }));
    let found = identify_axes(&machine, &[0, 1]).expect("both");
    let [x, y] = found.as_slice() else { panic!("two axes") };
    println!("{x}");
    assert_eq!(y.runs.len(), 14);
    assert!(x.runs.len() > 14, "{} runs", x.runs.len());
    let gain = x.parameters.velocity_gain_per_s;
    let is_per_s = machine.axes[0].drive.velocity_gain_per_s;
    assert!((gain.value - is_per_s).abs() < 2.0 * gain.half_width_95, "{gain:?}");
    assert!(gain.half_width_95 < 0.05 * gain.value, "{gain:?}");
}

#[test]
fn what_the_machine_cannot_do_is_refused_before_it_moves() {
    let machine = Machine::reference();
    let refused = Circle::new(4.0, 400.0).record(&machine).expect_err("beyond 10 V");
    assert!(matches!(refused, DriveError::Feed { ref axis, .. } if axis == "X"), "{refused}");
    for circle in [Circle::new(0.0, 30.0), Circle::new(300.0, 30.0), Circle::new(f64::NAN, 30.0)] {
        let refused = circle.record(&machine).expect_err("no circle");
        assert!(matches!(refused, DriveError::Quantity { quantity: "frequency [Hz]", .. }), "{refused}");
    }
    let mut narrow = Machine::reference();
    narrow.axes[1].timer = hal_sim::TimerBits::Sixteen;
    narrow.axes[1].mm_per_count = 1e-6;
    let refused = Circle::new(4.0, 100.0).record(&narrow).expect_err("a register too short");
    assert!(matches!(refused, DriveError::Counter { ref axis, .. } if axis == "Y"), "{refused}");
}
