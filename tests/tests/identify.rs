//! Identification of simulated axes from what a machine would record: converter codes and encoder counts.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use hal_sim::{
    AxisParameters, BedMode, DriveParameters, EncoderNoise, EncoderParameters, REFERENCE_ENCODER,
    REFERENCE_MM_S_PER_VOLT, REFERENCE_SUBSTEPS, REFERENCE_TICK_S, REFERENCE_X, REFERENCE_Y, SimAxis,
};
use motion_host::identify::{AxisRecording, Excitation, Identification, identification_plan, identify};
use motion_kernel::units::DacCode;

/// Cells for the dead time at up to 40 sub-steps.
const LINE: usize = 256;

/// How an axis is recorded.
#[derive(Clone, Copy, Debug)]
struct Rig {
    resolution_um: f64,
    noise_seed: Option<u64>,
    /// Gain of a P regulator \[1/s\]; `None`: open loop.
    regulator_per_s: Option<f64>,
    substeps: u32,
    /// Actual over nominal volts.
    output_gain: f64,
    /// Added to the output \[V\].
    output_offset_v: f64,
}

const RIG: Rig = Rig {
    resolution_um: 0.1,
    noise_seed: None,
    regulator_per_s: None,
    substeps: REFERENCE_SUBSTEPS,
    output_gain: 1.0,
    output_offset_v: 0.0,
};

fn record(drive: DriveParameters, rig: Rig, excitation: &Excitation) -> AxisRecording {
    let encoder = EncoderParameters {
        resolution_mm: rig.resolution_um * 1e-3,
        noise: rig.noise_seed.map(|seed| EncoderNoise { amplitude_counts: 1, seed }),
        ..REFERENCE_ENCODER
    };
    // Not on a count: the encoder's rounding is as unknown as on a machine.
    let parameters =
        AxisParameters { drive, encoder, start_position_mm: 12.345_678_9, ..AxisParameters::REFERENCE_X };
    let mut axis = SimAxis::<LINE>::new(parameters, REFERENCE_TICK_S, rig.substeps).expect("an axis");
    let latch_mm = |axis: &mut SimAxis<LINE>| axis.latch().0 as f64 * encoder.resolution_mm;
    let start_mm = latch_mm(&mut axis);
    let mut recording = AxisRecording {
        tick_s: REFERENCE_TICK_S,
        harmonic_hz: excitation.harmonic_hz(),
        ..Default::default()
    };
    let mut setpoint_mm = start_mm;
    for velocity_mm_s in excitation.velocity_mm_s(REFERENCE_TICK_S) {
        let actual_mm = latch_mm(&mut axis);
        let regulated_mm_s = rig.regulator_per_s.map_or(0.0, |gain| gain * (setpoint_mm - actual_mm));
        let code = DacCode::from_volts((velocity_mm_s + regulated_mm_s) / REFERENCE_MM_S_PER_VOLT);
        setpoint_mm += velocity_mm_s * REFERENCE_TICK_S;
        recording.command_mm_s.push(code.to_volts() * REFERENCE_MM_S_PER_VOLT);
        recording.actual_mm.push(actual_mm);
        axis.advance(code.to_volts() * rig.output_gain + rig.output_offset_v, true);
    }
    recording
}

fn recordings(drive: DriveParameters, rig: Rig) -> Vec<AxisRecording> {
    let noisy = |run: usize| Rig { noise_seed: rig.noise_seed.map(|seed| seed + run as u64), ..rig };
    identification_plan()
        .iter()
        .enumerate()
        .map(|(run, excitation)| record(drive, noisy(run), excitation))
        .collect()
}

/// Numbers from −1 to 1 (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// The reference Y with every parameter changed by up to ± 30 %.
fn random_drive(seed: u64) -> DriveParameters {
    let mut random = Random(seed);
    let mut about = |value: f64| value * (1.0 + 0.3 * random.next());
    let y = REFERENCE_Y;
    let bed = y.bed.expect("a bed");
    DriveParameters {
        velocity_gain_per_s: about(y.velocity_gain_per_s),
        integral_time_s: about(y.integral_time_s),
        current_lag_s: about(y.current_lag_s),
        dead_time_s: about(y.dead_time_s),
        accel_limit_mm_s2: about(y.accel_limit_mm_s2),
        coulomb_friction_mm_s2: about(y.coulomb_friction_mm_s2),
        viscous_friction_per_s: about(y.viscous_friction_per_s),
        bed: Some(BedMode {
            frequency_hz: about(bed.frequency_hz),
            damping_ratio: about(bed.damping_ratio),
            mass_ratio: about(bed.mass_ratio),
        }),
        ..y
    }
}

const NAMES: [&str; 11] =
    ["Kv %", "Ti %", "a_lim %", "a_c %", "b %", "delay us", "tau us", "Tc us", "f_r %", "zeta %", "mu %"];

/// Errors in the order of `NAMES`, each with half its confidence interval.
fn errors(truth: &DriveParameters, found: &Identification) -> Vec<(f64, f64)> {
    let found = &found.parameters;
    let relative = |estimate: motion_host::identify::Estimate, truth: f64| {
        (100.0 * (estimate.value / truth - 1.0), 100.0 * estimate.half_width_95 / truth)
    };
    let us = |estimate: motion_host::identify::Estimate, truth: f64| {
        (1e6 * (estimate.value - truth), 1e6 * estimate.half_width_95)
    };
    let delay_s = truth.dead_time_s + truth.current_lag_s + REFERENCE_TICK_S / 2.0;
    let mut errors = vec![
        relative(found.velocity_gain_per_s, truth.velocity_gain_per_s),
        relative(found.integral_time_s, truth.integral_time_s),
        relative(found.accel_limit_mm_s2, truth.accel_limit_mm_s2),
        relative(found.coulomb_friction_mm_s2, truth.coulomb_friction_mm_s2),
        relative(found.viscous_friction_per_s, truth.viscous_friction_per_s),
        us(found.total_delay_s, delay_s),
        us(found.dead_time_s, truth.dead_time_s),
        us(found.current_lag_s, truth.current_lag_s),
    ];
    assert_eq!(found.bed.is_some(), truth.bed.is_some(), "a bed is found where there is one: {truth:?}");
    if let (Some(found), Some(truth)) = (found.bed, truth.bed) {
        errors.push(relative(found.frequency_hz, truth.frequency_hz));
        errors.push(relative(found.damping_ratio, truth.damping_ratio));
        errors.push(relative(found.mass_ratio, truth.mass_ratio));
    }
    errors
}

/// Identifies all cases on all cores, in order.
fn identify_all(cases: &[(DriveParameters, Rig)]) -> Vec<(Vec<(f64, f64)>, f64)> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut done = Vec::new();
        loop {
            let case = next.fetch_add(1, Ordering::Relaxed);
            let Some((drive, rig)) = cases.get(case) else { return done };
            let runs = recordings(*drive, *rig);
            let start = Instant::now();
            let found = identify(&runs).unwrap_or_else(|error| panic!("case {case}, {rig:?}: {error}"));
            done.push((case, (errors(drive, &found), start.elapsed().as_secs_f64())));
        }
    };
    let mut all: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..2).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect()
    });
    all.sort_by_key(|(case, _)| *case);
    all.into_iter().map(|(_, result)| result).collect()
}

#[test]
fn explore() {
    let n: u64 = std::env::var("N").ok().and_then(|n| n.parse().ok()).unwrap_or(4);
    let mut cases = vec![];
    for resolution_um in [0.1, 0.5, 1.0] {
        let rig = Rig { resolution_um, ..RIG };
        cases.push((REFERENCE_X, rig));
        cases.push((REFERENCE_Y, rig));
        for seed in std::env::var("S").ok().and_then(|n| n.parse().ok()).unwrap_or(0)..n {
            cases.push((random_drive(seed), rig));
        }
    }
    print!("{:>10}", "");
    NAMES.iter().for_each(|name| print!("{name:>17}"));
    println!();
    for (index, (errors, time)) in identify_all(&cases).iter().enumerate() {
        print!("{index:>4} {:>5}", cases[index].1.resolution_um);
        errors.iter().for_each(|(error, half)| print!("{error:>8.2} ±{half:>6.2} "));
        println!("{time:.2} s");
    }
}
#[test]
fn show() {
    println!("{}", identify(&recordings(REFERENCE_Y, RIG)).unwrap());
}
#[test]
fn one() {
    let seed = std::env::var("SEED").ok().and_then(|n| n.parse().ok()).unwrap_or(2);
    println!("{}", identify(&recordings(random_drive(seed), Rig { resolution_um: 1.0, ..RIG })).unwrap());
}
