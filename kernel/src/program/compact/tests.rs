//! Items come back to the bit, whatever they are and in whatever order; other bytes give none, or one, and no panic.

use std::array::from_fn;

use super::*;
use crate::hal::{OutputState, Spindle};
use crate::law::{Law, Limits, Pulse, Ticks};
#[cfg(feature = "live")]
use crate::program::{Allowed, PathBlock};
use crate::random::Random;

/// An item's figures, down to the bits: numbers that are none are not equal to themselves.
fn bits<const AXES: usize>(item: &Item<AXES>) -> Vec<u8> {
    let mut buffer = [0; 1000];
    postcard::to_slice(item, &mut buffer).expect("short").to_vec()
}

/// Any bits; often round, of few digits, or special.
fn figure(random: &Random) -> f64 {
    let any = f64::from_bits(random.next());
    let specials = [0.0, -0.0, 1.0, f64::INFINITY, f64::NAN, -f64::NAN, f64::MAX, 5e-324];
    match random.below(6) {
        0 => specials[random.below(8) as usize],
        1 => f64::from_bits(any.to_bits() >> 36 << 36),
        2 => f64::from(random.next() as i32) / f64::from(1 << random.below(30)),
        3 => random.log(1e-6, 1e6),
        4 => [500.0, 5e3, 4e5, 50.0][random.below(4) as usize],
        _ => any,
    }
}

fn position(random: &Random) -> Position {
    Position::from_bits(random.of_any_size())
}

/// An item of any kind. Half of them could be a program's, so that they are as expected after the one before.
fn item<const AXES: usize>(random: &Random, before: &Item<AXES>) -> Item<AXES> {
    let line = if random.chance(0.8) { 7 } else { random.next() as u32 };
    let length = match *before {
        Item::Line { length, .. } | Item::Septic { length, .. } if random.chance(0.5) => length,
        _ => position(random),
    };
    let pieces = piece(before);
    let end = pieces.map_or_else(|| from_fn(|_| position(random)), |(end, ..)| end);
    let start = if random.chance(0.6) { end } else { from_fn(|_| position(random)) };
    let grid = |random: &Random| ((random.next() >> 34) as f64 - 536_870_912.0) / 268_435_456.0;
    match random.below(12) {
        0 => Item::Line { line, start, direction: from_fn(|_| figure(random)), length },
        1 => {
            let offset = from_fn(|_| Position::from_bits(random.of_any_size() >> 20));
            let (direction, length_mm) = direction(offset);
            Item::Line { line, start, direction, length: Position::from_mm(length_mm).unwrap_or_default() }
        }
        2 => {
            let direction = match *before {
                Item::Line { direction, .. } => direction,
                _ => from_fn(|_| random.unit()),
            };
            Item::Line { line, start, direction, length }
        }
        3 => Item::Septic { line, start, coefficients: from_fn(|_| from_fn(|_| figure(random))), length },
        4 => {
            let of_grid = from_fn(|_| from_fn(|_| grid(random)));
            let coefficients = match pieces {
                Some((_, before, length_before)) if random.chance(0.5) => {
                    let on = continued(&before, length_before, length);
                    from_fn(|axis| {
                        let ([q1, q2, q3], [_, _, _, q4, q5, q6, q7]) = (on[axis], of_grid[axis]);
                        [q1, q2, q3, q4, q5, q6, q7]
                    })
                }
                Some((_, before, _)) if random.chance(0.5) => turned(&before),
                _ => of_grid,
            };
            Item::Septic { line, start, coefficients, length }
        }
        5 => {
            let all: [f64; 6] = from_fn(|_| figure(random));
            let [from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s] = all;
            let limited_by =
                [LimitedBy::Acceleration, LimitedBy::Jerk, LimitedBy::Snap][random.below(3) as usize];
            let ramp = Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, limited_by };
            Item::Feed(PlannedRamp { ramp, length })
        }
        6 | 7 => {
            let from_mm_s = match before {
                Item::Feed(planned) => planned.ramp.to_mm_s,
                _ => random.log(0.1, 300.0),
            };
            if random.chance(0.3) {
                return Item::Feed(cruise(from_mm_s, length));
            }
            let limits = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };
            let pulse = if random.chance(0.5) { Pulse::Plateau } else { Pulse::Sin2 };
            let law = Law::new(pulse, limits).expect("limits");
            let to_mm_s = if random.chance(0.3) { 0.0 } else { random.log(0.1, 300.0) };
            let ramp = to_f64(&Ramp::new(&law, from_mm_s, to_mm_s));
            Item::Feed(PlannedRamp { ramp, length: own_length(&ramp) })
        }
        8 => Item::EndOfStretch(start),
        9 => [Item::Stop, Item::Dwell(Ticks::from_bits(random.next() >> random.below(64)))]
            [random.below(2) as usize],
        10 => Item::Switch(OutputState {
            spindle: [Spindle::Off, Spindle::Clockwise, Spindle::Counterclockwise][random.below(3) as usize],
            speed_rpm: figure(random),
            flood: random.chance(0.5),
            mist: random.chance(0.5),
        }),
        #[cfg(feature = "live")]
        _ => {
            let allowed = || {
                let [cap_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4] = from_fn(|_| figure(random));
                Allowed { cap_mm_s, limits: Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 } }
            };
            let (programmed, greatest) = (allowed(), allowed());
            let greatest = if random.chance(0.5) { programmed } else { greatest };
            Item::Block(PathBlock::new(length, figure(random), programmed, greatest, figure(random)))
        }
        #[cfg(not(feature = "live"))]
        _ => Item::Stop,
    }
}

fn come_back<const AXES: usize>() {
    for seed in 1..=20 {
        let random = Random::new(seed);
        let (mut encoder, mut decoder) = (Encoder::<AXES>::new(), Decoder::<AXES>::new());
        let mut last = Item::Stop;
        for _ in 0..2_000 {
            let next = item(&random, &last);
            let mut bytes = [0xA5; 1000];
            let length = encoder.encode(&next, &mut bytes).expect("room");
            // As many bytes suffice, one fewer does not, and then nothing has happened.
            let encoded = encoder;
            assert_eq!(encoder.encode(&next, &mut []), None);
            assert_eq!(format!("{encoder:?}"), format!("{encoded:?}"));
            let (found, rest) = decoder.take(&bytes[..=length]).expect("an item");
            assert_eq!(rest, [0xA5], "seed {seed}: {next:?}");
            assert_eq!(bits(&found), bits(&next), "seed {seed}: {next:?}, found {found:?}");
            last = next;
        }
    }
}

#[test]
fn items_come_back_to_the_bit() {
    come_back::<1>();
    come_back::<2>();
    come_back::<3>();
    come_back::<6>();
    come_back::<9>();
}

/// Cut anywhere, an item is none.
#[test]
fn an_item_that_is_cut_is_none() {
    let random = Random::new(3);
    let (mut encoder, mut decoder) = (Encoder::<3>::new(), Decoder::<3>::new());
    let mut last = Item::Stop;
    for _ in 0..5_000 {
        let next = item(&random, &last);
        let mut bytes = [0; 400];
        let length = encoder.encode(&next, &mut bytes).expect("room");
        for cut in 0..length {
            assert!(decoder.clone().take(&bytes[..cut]).is_none(), "{next:?} in {cut} of {length} bytes");
        }
        assert!(decoder.take(&bytes).is_some());
        last = next;
    }
}

/// Random bytes: items with every nibble anything.
#[test]
fn random_bytes_are_an_item_or_none() {
    for seed in 1..=20 {
        let random = Random::new(seed);
        let (mut items, mut none) = (0, 0);
        let mut decoder = Decoder::<3>::new();
        for _ in 0..20_000 {
            let bytes: Vec<u8> = (0..random.below(400)).map(|_| random.next() as u8).collect();
            let mut rest = &bytes[..];
            while let Some((_, left)) = decoder.take(rest) {
                assert!(left.len() < rest.len());
                rest = left;
                items += 1;
            }
            none += 1;
        }
        assert!(items > 5_000 && none == 20_000, "seed {seed}: {items}");
    }
}

/// Both ends would agree on a wrong expectation, too.
#[test]
fn a_curve_goes_on_and_an_arc_is_turned() {
    let (before, length) = (Position::from_bits(1 << 32), Position::from_bits(3 << 31));
    let cubic = [[0.5, -0.25, 0.125, 0.0, 0.0, 0.0, 0.0]];
    assert_eq!(continued(&cubic, before, length), [[0.375, 0.125 * 1.5, 0.125 * 1.5 * 1.5]]);
    let fourth = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert_eq!(continued(&fourth, before, before), [[4.0, 6.0, 4.0]]);
    // A helix of half a radian a piece, its axis along the third axis: series of sine and cosine.
    let (theta, rise) = (0.5_f64, 0.6);
    let helix = |from: f64| {
        let (mut along, mut across, mut scale) = ([0.0; 7], [0.0; 7], 0.8);
        for power in 0..7 {
            // The derivatives of the tangent by the angle are the tangent turned by quarters.
            let quarter = from + f64::from(power) * std::f64::consts::FRAC_PI_2;
            scale /= f64::from(power + 1);
            along[power as usize] = scale * quarter.cos();
            across[power as usize] = scale * quarter.sin();
            scale *= theta;
        }
        [along, across, [rise, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
    };
    let (found, expected) = (turned(&helix(0.3)), helix(0.3 + theta));
    for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
        // What is left out of the series.
        assert!((found - expected).abs() < 0.8 * theta.powi(7) / 5040.0, "{found} {expected}");
    }
}

/// What a program mostly has takes few bytes. Exact, because it is a format.
#[test]
fn what_is_expected_takes_few_bytes() {
    let mut encoder = Encoder::<3>::new();
    let mut length_of = |item: &Item<3>| encoder.encode(item, &mut [0; 400]).expect("room");
    let offset = [10.0, -20.0, 0.0].map(|mm| Position::from_mm(mm).expect("in range"));
    let (along, length_mm) = direction(offset);
    let length = Position::from_mm(length_mm).expect("in range");
    let line = |start| Item::Line { line: 1, start, direction: along, length };
    let lengths = [length_of(&line([Position::ZERO; 3])), length_of(&line(offset))];
    assert_eq!(lengths, [14, 2]);
    let law = Law::new(Pulse::Plateau, Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 });
    let ramp = |from_mm_s, to_mm_s| {
        let ramp = to_f64(&Ramp::new(&law.expect("limits"), from_mm_s, to_mm_s));
        Item::Feed(PlannedRamp { ramp, length: own_length(&ramp) })
    };
    assert_eq!(length_of(&ramp(0.0, 40.0)), 17);
    assert_eq!(length_of(&Item::Feed(cruise(40.0, length))), 6);
    assert_eq!(length_of(&ramp(40.0, 0.0)), 2);
    assert_eq!(length_of(&Item::EndOfStretch(offset.map(|offset| offset + offset))), 2);
    assert_eq!(length_of(&Item::Stop), 1);
}
