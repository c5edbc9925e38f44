//! What several tests identify.

use hal_sim::{DriveModel, DriveState};

use super::parameters::{Unknown, Unknowns};
use super::readings::Runs;
use super::recording::AxisRecording;
use super::simulation::SUBSTEPS;

/// Of all recordings.
pub(super) const TICK_S: f64 = 5e-4;

/// The unknowns of a drive on a bed, with dead time, filter and current lag \[s\].
pub(super) fn unknowns(
    values: [(Unknown, f64); 9],
    [dead_time_s, filter_s, current_s]: [f64; 3],
) -> Unknowns {
    let mut unknowns = Unknowns::zero(TICK_S / f64::from(SUBSTEPS));
    for (unknown, value) in values {
        unknowns.set(unknown, value);
    }
    unknowns.set_lags(dead_time_s, filter_s, current_s);
    unknowns
}

/// A drive whose axis sticks, on a bed: nearly that of seed 476 of docs/DRIVES.md.
pub(super) fn sticking() -> Unknowns {
    let values = [
        (Unknown::Gain, 1.0),
        (Unknown::VelocityGain, 193.8),
        (Unknown::IntegralTime, 0.019_73),
        (Unknown::AccelLimit, 15_884.0),
        (Unknown::Coulomb, 1612.0),
        (Unknown::Viscous, 0.17),
        (Unknown::BedFrequency, 6.07),
        (Unknown::BedDamping, 0.0063),
        (Unknown::BedMassRatio, 0.133),
    ];
    unknowns(values, [4.843e-5, 1.082e-4, 1.229e-4])
}

/// That drive in harmonic motion, of which an encoder of 1 µm reads some counts in every tick.
pub(super) fn harmonic() -> Runs {
    const RESOLUTION_MM: f64 = 1e-3;
    let feed = |tick: usize| 40.0 * libm::sin(core::f64::consts::TAU * 3.0 * TICK_S * tick as f64);
    let run = recorded(&sticking(), (0..4000).map(feed).collect(), RESOLUTION_MM);
    let mut runs = Runs::new(&[run], RESOLUTION_MM);
    runs.regroup(&sticking(), SUBSTEPS);
    runs
}

/// What an encoder of `resolution_mm` reads of the simulated drive.
pub(super) fn recorded(unknowns: &Unknowns, command_mm_s: Vec<f64>, resolution_mm: f64) -> AxisRecording {
    let model = DriveModel::new(unknowns.drive(), TICK_S, SUBSTEPS).expect("a drive");
    let mut state = DriveState::<64>::at_rest(&model, 10.6165).expect("at rest");
    let mut read = |command_mm_s: &f64| {
        let counts = (state.position_mm() / resolution_mm).round();
        model.tick(&mut state, *command_mm_s);
        counts * resolution_mm
    };
    let actual_mm = command_mm_s.iter().map(&mut read).collect();
    AxisRecording { tick_s: TICK_S, command_mm_s, actual_mm, ..Default::default() }
}
