//! The circle test of S4 on the simulated X and Y axes, closed loop, through the real DAC driver.
//!
//! The regulator here is a test oracle of S4 (1), plain P with feedforward, written apart from the kernel's.
//! Contour error: largest deviation of the radius read from the encoders; form deviation: largest minus
//! smallest radius; following error: largest difference of set-point and reading of X. All over the last
//! second of four, when the bed has come to rest. Expected figures and tolerances: the reference model of S4.

use core::f64::consts::PI;

use hal_sim::{
    AxisParameters, EncoderParameters, MachineParameters, REFERENCE_ENCODER, REFERENCE_MM_S_PER_VOLT,
    SimMachine,
};
use motion_kernel::hal::{Ad5754Output, DriveEnable, Encoder, VelocityChannel};
use motion_kernel::units::DacCode;
use motion_tests::s4::{CONTOUR_V, CONTOUR_VAJ, ContourTable, assert_near};

const TICK_S: f64 = 0.0005;
const RUN_TICKS: usize = 8000;
const SETTLE_TICKS: usize = 6000;
/// F = 2.150 m/min.
const FEED_MM_S: f64 = 2150.0 / 60.0;
const POSITION_GAIN_PER_S: f64 = 230.0;
/// A and J gain that the inverse of the small-signal drive has.
const SERIES_ACCEL_GAIN_S: f64 = 1.675e-3;
const SERIES_JERK_GAIN_S2: f64 = 6.376_715e-5;
const LINE: usize = 512;

/// Gains on commanded velocity, acceleration and jerk.
#[derive(Clone, Copy)]
struct Feedforward {
    velocity: f64,
    accel_s: f64,
    jerk_s2: f64,
}

const V: Feedforward = Feedforward { velocity: 1.0, accel_s: 0.0, jerk_s2: 0.0 };
const VA: Feedforward = Feedforward { accel_s: SERIES_ACCEL_GAIN_S, ..V };
/// The paper's J gain was about a third of the series' value.
const VAJ: Feedforward = Feedforward { jerk_s2: 0.35 * SERIES_JERK_GAIN_S2, ..VA };
const VAJ_SERIES: Feedforward = Feedforward { jerk_s2: SERIES_JERK_GAIN_S2, ..VA };

struct CircleFigures {
    contour_um: f64,
    form_um: f64,
    following_um: f64,
}

/// The circle on the reference machine.
fn circle(frequency_hz: f64, feedforward: Feedforward) -> CircleFigures {
    circle_at(frequency_hz, feedforward, 20, REFERENCE_ENCODER.resolution_mm)
}

fn circle_at(
    frequency_hz: f64,
    feedforward: Feedforward,
    substeps: u32,
    resolution_mm: f64,
) -> CircleFigures {
    let encoder = EncoderParameters { resolution_mm, ..REFERENCE_ENCODER };
    let omega = 2.0 * PI * frequency_hz;
    let radius_mm = FEED_MM_S / omega;
    let x = AxisParameters { start_position_mm: radius_mm, encoder, ..AxisParameters::REFERENCE_X };
    let axes = [x, AxisParameters { encoder, ..AxisParameters::REFERENCE_Y }];
    let machine = SimMachine::<2, LINE>::new(&MachineParameters { axes, tick_s: TICK_S, substeps }).unwrap();
    let mut output = Ad5754Output::<_, 2>::setup(machine.chip(), &mut machine.chip()).unwrap();
    let (mut encoder, mut enable) = (&machine, &machine);
    enable.set_enabled(true).unwrap();

    let (mut smallest_mm, mut largest_mm, mut following_mm) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for tick in 0..RUN_TICKS {
        let (sine, cosine) = libm::sincos(omega * tick as f64 * TICK_S);
        // Each derivative turns (position, velocity, …) by a quarter and multiplies by omega.
        let turns = [[cosine, sine], [-sine, cosine], [-cosine, -sine], [sine, -cosine]];
        let counts = encoder.latch().unwrap();
        let mut codes = [DacCode::ZERO; 2];
        let mut read_mm = [0.0; 2];
        for axis in 0..2 {
            let [position, velocity, accel, jerk] = turns.map(|unit| unit[axis]);
            read_mm[axis] = counts[axis].0 as f64 * resolution_mm;
            let error_mm = radius_mm * position - read_mm[axis];
            let command_mm_s = POSITION_GAIN_PER_S * error_mm
                + FEED_MM_S
                    * (feedforward.velocity * velocity
                        + feedforward.accel_s * omega * accel
                        + feedforward.jerk_s2 * omega * omega * jerk);
            codes[axis] = DacCode::from_volts(command_mm_s / REFERENCE_MM_S_PER_VOLT);
            if axis == 0 && tick >= SETTLE_TICKS {
                following_mm = following_mm.max(error_mm.abs());
            }
        }
        if tick >= SETTLE_TICKS {
            let deviation_mm = libm::hypot(read_mm[0], read_mm[1]) - radius_mm;
            smallest_mm = smallest_mm.min(deviation_mm);
            largest_mm = largest_mm.max(deviation_mm);
        }
        output.write(&codes).unwrap();
        machine.advance();
    }
    CircleFigures {
        contour_um: 1e3 * largest_mm.abs().max(smallest_mm.abs()),
        form_um: 1e3 * (largest_mm - smallest_mm),
        following_um: 1e3 * following_mm,
    }
}

#[track_caller]
fn assert_contour(name: &str, feedforward: Feedforward, table: &ContourTable) {
    for (index, &(expected_um, tolerance_um)) in table.iter().enumerate() {
        let frequency_hz = (index + 1) as f64;
        let actual_um = circle(frequency_hz, feedforward).contour_um;
        assert_near(&format!("{name} {frequency_hz} Hz µm"), actual_um, expected_um, tolerance_um);
    }
}

#[test]
fn contour_error_with_velocity_feedforward() {
    assert_contour("V", V, &CONTOUR_V);
}

#[test]
fn contour_error_with_velocity_acceleration_and_jerk_feedforward() {
    assert_contour("VAJ", VAJ, &CONTOUR_VAJ);
}

#[test]
fn contour_error_with_the_series_gains() {
    for (frequency_hz, expected_um, tolerance_um) in
        [(4.0, 7.87, 0.74), (10.0, 13.85, 0.92), (16.0, 5.03, 0.65)]
    {
        let actual_um = circle(frequency_hz, VAJ_SERIES).contour_um;
        assert_near(&format!("series {frequency_hz} Hz µm"), actual_um, expected_um, tolerance_um);
    }
}

#[test]
fn following_error_at_4_hz() {
    assert_near("V µm", circle(4.0, V).following_um, 10.491, 0.5);
    assert_near("VAJ µm", circle(4.0, VAJ).following_um, 4.159, 0.5);
}

#[test]
fn contour_error_passes_20_um_where_it_should() {
    for (name, feedforward, expected_hz, tolerance_hz) in
        [("V", V, 5.388, 0.2), ("VA", VA, 8.861, 0.3), ("VAJ", VAJ, 10.1, 0.3)]
    {
        let (below, above) =
            [-tolerance_hz, tolerance_hz].map(|off| circle(expected_hz + off, feedforward).contour_um).into();
        assert!(below < 20.0 && above > 20.0, "{name}: {below} and {above} µm about {expected_hz} Hz");
    }
}

#[test]
fn form_deviation_shows_the_bed() {
    let form_um = |frequency_hz: i32| circle(f64::from(frequency_hz), VAJ).form_um;
    let low_um = (1..=10).map(form_um).fold(0.0, f64::max);
    assert_near("form up to 10 Hz µm", low_um, 5.687, 0.6);
    assert_near("form at 13 Hz µm", form_um(13), 31.54, 2.0);
}

#[test]
fn few_substeps_do_nearly_as_well_as_160() {
    // A hundredth of the real count: one count of 0.1 µm would be 2 % of some of these figures.
    let figures = |feedforward, substeps| circle_at(4.0, feedforward, substeps, 1e-6);
    for (name, feedforward) in [("V", V), ("VAJ", VAJ)] {
        let fine = figures(feedforward, 160);
        for (substeps, share) in [(10, 0.025), (20, 0.015)] {
            let coarse = figures(feedforward, substeps);
            for (quantity, coarse, fine) in [
                ("contour µm", coarse.contour_um, fine.contour_um),
                ("following µm", coarse.following_um, fine.following_um),
            ] {
                assert_near(&format!("{substeps} sub-steps, {name} {quantity}"), coarse, fine, share * fine);
            }
        }
    }
}
