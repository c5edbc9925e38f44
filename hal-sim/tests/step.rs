//! The velocity step of S4 on the simulated X axis: 0 to 7.2 m/min, open loop, through the real DAC
//! driver.
//!
//! Delay, time constant, overshoot and settling are read from the velocity as backward differences of the
//! true positions at the tick, stamped with the later tick: tangent at the steepest difference, crossing 0 at
//! the delay and rising to the command within the time constant. The peaks are backward differences of
//! encoder readings, as the paper's machine records them. Expected figures and tolerances: the reference
//! model of S4.

use hal_sim::{AxisParameters, MachineParameters, REFERENCE_MM_S_PER_VOLT, SimMachine};
use motion_kernel::hal::{Ad5754Output, DriveEnable, Encoder, VelocityChannel};
use motion_kernel::units::DacCode;
use motion_tests::s4::assert_near;

const TICK_S: f64 = 0.0005;
const TICKS: usize = 400;
const STEP_MM_S: f64 = 120.0;
/// Band in which the velocity counts as settled: ±0.02 m/min (S4).
const BAND_MM_S: f64 = 20.0 / 60.0;
/// One cell per sub-step of 3.125 µs, and two.
const LINE: usize = 512;

struct StepFigures {
    delay_ms: f64,
    time_constant_ms: f64,
    overshoot_percent: f64,
    settling_ms: f64,
    peak_accel_m_s2: f64,
    peak_jerk_m_s3: f64,
}

/// Differences of neighbours over the tick.
fn rates(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|pair| (pair[1] - pair[0]) / TICK_S).collect()
}

fn largest(values: &[f64]) -> (usize, f64) {
    values.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

fn step(axis: AxisParameters, substeps: u32) -> StepFigures {
    let parameters = MachineParameters { axes: [axis], tick_s: TICK_S, substeps };
    let machine = SimMachine::<1, LINE>::new(&parameters).unwrap();
    let mut output = Ad5754Output::<_, 1>::setup(machine.chip(), &mut machine.chip()).unwrap();
    let (mut encoder, mut enable) = (&machine, &machine);
    enable.set_enabled(true).unwrap();
    output.write(&[DacCode::from_volts(STEP_MM_S / REFERENCE_MM_S_PER_VOLT)]).unwrap();

    let (mut true_mm, mut read_mm) = (Vec::new(), Vec::new());
    for _ in 0..TICKS {
        true_mm.push(machine.truth()[0].position_mm);
        read_mm.push(encoder.latch().unwrap()[0].0 as f64 * axis.encoder.resolution_mm);
        machine.advance();
    }

    let velocity = rates(&true_mm);
    let (steepest, slope_mm_s2) = largest(&rates(&velocity));
    let stamp_ms = |index: usize| (index + 1) as f64 * TICK_S * 1e3;
    let outside = velocity.iter().rposition(|v| (v - STEP_MM_S).abs() > BAND_MM_S).unwrap();
    let read_accel = rates(&rates(&read_mm));
    StepFigures {
        delay_ms: stamp_ms(steepest) - velocity[steepest] / slope_mm_s2 * 1e3,
        time_constant_ms: STEP_MM_S / slope_mm_s2 * 1e3,
        overshoot_percent: (largest(&velocity).1 / STEP_MM_S - 1.0) * 100.0,
        settling_ms: stamp_ms(outside),
        peak_accel_m_s2: largest(&read_accel).1 / 1e3,
        peak_jerk_m_s3: largest(&rates(&read_accel)).1 / 1e3,
    }
}

#[test]
fn the_step_response_has_the_figures_of_the_reference_model() {
    let figures = step(AxisParameters::REFERENCE_X, 20);
    assert_near("delay ms", figures.delay_ms, 2.013, 0.1);
    assert_near("time constant ms", figures.time_constant_ms, 9.827, 0.2);
    assert_near("overshoot %", figures.overshoot_percent, 1.12, 0.1);
    assert_near("settling ms", figures.settling_ms, 57.5, 2.0);
    assert_near("peak acceleration m/s²", figures.peak_accel_m_s2, 12.55, 0.4);
    assert_near("peak jerk m/s³", figures.peak_jerk_m_s3, 11_700.0, 800.0);
}

#[test]
fn few_substeps_do_nearly_as_well_as_160() {
    let fine = step(AxisParameters::REFERENCE_X, 160);
    for (substeps, share) in [(10, 0.025), (20, 0.015)] {
        let coarse = step(AxisParameters::REFERENCE_X, substeps);
        for (quantity, coarse, fine) in [
            ("delay ms", coarse.delay_ms, fine.delay_ms),
            ("time constant ms", coarse.time_constant_ms, fine.time_constant_ms),
            ("overshoot %", coarse.overshoot_percent, fine.overshoot_percent),
            ("settling ms", coarse.settling_ms, fine.settling_ms),
        ] {
            assert_near(&format!("{substeps} sub-steps, {quantity}"), coarse, fine, share * fine);
        }
    }
}

#[test]
fn a_disabled_drive_brakes_and_holds() {
    let parameters = MachineParameters::at_reference_tick([AxisParameters::REFERENCE_X]);
    let machine = SimMachine::<1>::new(&parameters).unwrap();
    let mut output = Ad5754Output::<_, 1>::setup(machine.chip(), &mut machine.chip()).unwrap();
    let run = |ticks| (0..ticks).for_each(|_| machine.advance());
    output.write(&[DacCode::from_volts(3.6)]).unwrap();
    run(100);
    assert!(machine.truth()[0].position_mm.abs() < 1e-12, "not enabled yet");

    (&machine).set_enabled(true).unwrap();
    run(200);
    assert!((machine.truth()[0].velocity_mm_s - STEP_MM_S).abs() < 0.1);

    (&machine).set_enabled(false).unwrap();
    run(1000);
    // The integral part approaches the friction, the velocity 0, only asymptotically.
    assert!(machine.truth()[0].velocity_mm_s.abs() < 1e-5);
    assert_eq!(machine.ticks(), 1300);
}
