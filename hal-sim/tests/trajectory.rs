//! The drive's trajectories, bit for bit.
//!
//! The expected states were computed by an independent implementation of the same equations in plain
//! IEEE doubles (Python, lengths in mm). Any change of a parameter, of an operation or of the order of
//! the sub-step shows here first.

use hal_sim::{BedMode, DriveModel, DriveParameters, DriveState, REFERENCE_X, REFERENCE_Y};

const TICK_S: f64 = 0.0005;

/// Rest, a step, a reversal into the current limit, creeping forward, a stop until the axis sticks.
fn command_mm_s(tick: usize) -> f64 {
    match tick {
        0..2 => 0.0,
        2..12 => 100.0,
        12..20 => -300.0,
        20..30 => 5.0,
        _ => 0.0,
    }
}

/// Position \[mm\], velocity \[mm/s\] and torque \[mm/s²\] of the reference Y axis after each tick.
#[rustfmt::skip]
const REFERENCE_Y_STATES: [[f64; 3]; 40] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [4.957456412002198e-06, 0.14626954093641611, 2726.252467927059],
    [0.0008510017139512884, 3.8267156014516117, 9821.450849293264],
    [0.004146435466569942, 9.507212135912289, 11658.327982653733],
    [0.010439418885888306, 15.703801188047475, 12133.877420696772],
    [0.01987089838659449, 22.0318356615278, 12256.992496776642],
    [0.03247616540037984, 28.39127392974546, 12288.86578006876],
    [0.04826292952585396, 34.75576141950475, 12297.117459880585],
    [0.06723153384518872, 41.118026696832, 12299.253738691048],
    [0.08938019180860161, 47.47574582809314, 12299.806800280943],
    [0.11470634673533377, 53.827883565424386, 12299.949982491395],
    [0.143192191194619, 59.78349753806168, 6474.0478554104875],
    [0.17302220195650067, 58.38072887941651, -7439.5835109013005],
    [0.20095445927066846, 53.04860129971921, -11041.685936381882],
    [0.22591026560946564, 46.69665926580264, -11974.234854924387],
    [0.24760922717362488, 40.07872137874592, -12215.662605374533],
    [0.265977906861145, 33.390512395148015, -12278.165877351426],
    [0.2809967312777844, 26.683273444568865, -12294.347360219623],
    [0.29266035690584535, 19.970840637956798, -12298.53658711179],
    [0.3009697635568167, 13.337840626520773, -10763.190064359816],
    [0.3065186631934376, 9.372897116398047, -4693.09574365995],
    [0.3106727487014079, 7.4479786102596215, -2292.837402601113],
    [0.3141037734741708, 6.366674111363756, -1237.074189289365],
    [0.3171041773372025, 5.681252721998064, -701.6320259538763],
    [0.31982055588701586, 5.211658972274481, -387.5943977079527],
    [0.32233810164116256, 4.8766497397732005, -181.47281304149698],
    [0.32471249200787794, 4.633758684529591, -36.478894729997556],
    [0.32698291624271936, 4.457384088211339, 69.25458910610377],
    [0.3291780868464566, 4.330368920016074, 147.60109975654447],
    [0.33131869471584563, 4.2164648279442165, -221.11720803827467],
    [0.33327330711731584, 3.5055682996536666, -1397.4996964806996],
    [0.3347871873406971, 2.54969243829576, -1428.623672683007],
    [0.33583927032361205, 1.683832249599907, -1152.9350881612797],
    [0.3364988497172173, 0.982472814698716, -839.9173529372719],
    [0.3368482836021174, 0.439618553360251, -566.651533094252],
    [0.33696052229719814, 0.0289264973611743, -347.34205487433525],
    [0.33695199526902697, -0.03201082536527843, -222.29832065026775],
];

fn bits<const LINE: usize>(state: &DriveState<LINE>) -> [u64; 3] {
    [state.position_mm(), state.velocity_mm_s(), state.torque_mm_s2()].map(f64::to_bits)
}

#[test]
fn the_reference_axis_follows_bit_for_bit() {
    let model = DriveModel::new(REFERENCE_Y, TICK_S, 20).unwrap();
    let mut state = DriveState::<58>::at_rest(&model, 0.0).unwrap();
    for (tick, expected) in REFERENCE_Y_STATES.iter().enumerate() {
        model.tick(&mut state, command_mm_s(tick));
        assert_eq!(bits(&state), expected.map(f64::to_bits), "tick {tick}: {state:?}, expected {expected:?}");
    }
}

#[test]
fn every_option_at_once_ends_in_the_same_bits() {
    // Load, command filter, no current lag, another bed, a dead time of whole sub-steps, a moving start
    // and a line longer than needed.
    let parameters = DriveParameters {
        load_inertia_ratio: 0.5,
        command_filter_s: 0.001,
        current_lag_s: 0.0,
        dead_time_s: 0.00125,
        bed: Some(BedMode { frequency_hz: 13.4, damping_ratio: 0.03, mass_ratio: 0.1 }),
        ..REFERENCE_X
    };
    let model = DriveModel::new(parameters, TICK_S, 20).unwrap();
    let mut state = DriveState::<200>::in_motion(&model, 3.0, -20.0).unwrap();
    for tick in 0..200 {
        model.tick(&mut state, command_mm_s(tick % 40));
    }
    let expected = [3.763529028203391, 1.118299251883611, 873.5444214100426_f64];
    assert_eq!(bits(&state), expected.map(f64::to_bits), "{state:?}");
    assert_eq!(state.bed_mm().to_bits(), (-0.010645705068839722_f64).to_bits());
}

#[test]
fn friction_sticks() {
    // A command that asks for less torque than friction holds back: the axis must not creep, buzz or
    // drift before the integral part has grown to the friction.
    let model = DriveModel::new(REFERENCE_X, TICK_S, 20).unwrap();
    let mut state = DriveState::<64>::at_rest(&model, 1.0).unwrap();
    for _ in 0..20 {
        model.tick(&mut state, 0.1);
        assert_eq!(state.position_mm().to_bits(), 1.0_f64.to_bits());
    }
    assert!(state.torque_mm_s2() > 0.0 && state.torque_mm_s2() < REFERENCE_X.coulomb_friction_mm_s2);
    for _ in 0..200 {
        model.tick(&mut state, 0.1);
    }
    assert!(state.velocity_mm_s() > 0.0, "the integral part overcomes friction in the end");
}
