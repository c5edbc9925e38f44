//! Fixed point has a range: what could leave it inside the tick is refused before. Debug assertions find what is not.

use std::convert::Infallible;

use motion_host::machine::Machine;
use motion_host::toolpath::curve::Spiral;
use motion_host::toolpath::septic::fit;
use motion_kernel::law::{Limits, PathMotion, PlannedRamp, Ramp};
use motion_kernel::num::{Fixed, Real, Scalar};
use motion_kernel::path::{Piece, PieceError};
use motion_kernel::program::{self, CheckError, Header, Item, SupplyError};
use motion_kernel::queue::{Refused, Rejection, Streams};
use motion_kernel::units::Position;
use motion_tests::check::bench::{TICK_S, law, mm};
use motion_tests::random::Random;

/// The first piece of an arc from the origin, of one axis' direction after another.
fn arc(radius_mm: f64, sweep_rad: f64, height_per_rad: f64) -> ([[f64; 7]; 3], Position) {
    let spiral = Spiral {
        outward: [0.0, -1.0, 0.0],
        onward: [1.0, 0.0, 0.0],
        radius_mm,
        radius_per_rad: 0.0,
        across_per_rad: [0.0, 0.0, height_per_rad],
    };
    let septic = fit(&spiral, 0.0, sweep_rad, sweep_rad, 16.0).expect("smooth")[0];
    (septic.coefficients.map(|axis| axis.map(|c| c / septic.length_mm)), mm(septic.length_mm))
}

fn with(limits: Limits<f64>, feed_mm_s: f64) -> Header<3> {
    let mut header = Machine::reference().header();
    (header.rules.limits, header.rules.feed_mm_s) = (limits, feed_mm_s);
    header
}

/// Along the start of a curve up to the feed, round a part of it, at constant feed.
fn to_the_curve(
    limits: Limits<f64>,
    feed_mm_s: f64,
    coefficients: [[f64; 7]; 3],
    length: Position,
) -> Vec<Item<3>> {
    let direction = coefficients.map(|axis| axis[0]);
    let ramp = Ramp::new(&law(limits), 0.0, feed_mm_s);
    let whole = mm(ramp.length_mm());
    let parts = (whole.to_mm() / 15.0) as i64 + 1;
    let at_part = |part: i64| {
        Position::from_bits((i128::from(whole.to_bits()) * i128::from(part) / i128::from(parts)) as i64)
    };
    let at = |s: Position| direction.map(|d| mm(d * s.to_mm()));
    let mut items = vec![Item::Feed(PlannedRamp { ramp, length: whole })];
    for part in 0..parts {
        let (from, to) = (at_part(part), at_part(part + 1));
        items.push(Item::Line { line: 1, start: at(from), direction, length: to - from });
    }
    items.push(Item::Septic { line: 1, start: at(whole), coefficients, length });
    let t2_s = length.to_mm() / feed_mm_s;
    let cruise = Ramp::cruise(feed_mm_s, t2_s);
    items.push(Item::Feed(PlannedRamp { ramp: cruise, length }));
    items
}

/// What is wrong with items that end in motion.
fn refusal<R: Real>(header: &Header<3>, items: &[Item<3>]) -> Option<SupplyError<Infallible>> {
    match program::check::<R, 3, _>(header, items.iter().map(|&item| Ok(item))) {
        Err(CheckError::Item { cause, .. }) => Some(cause),
        Err(CheckError::Unfinished) => None,
        other => panic!("{other:?}"),
    }
}

const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

/// R 0.1 mm at 300 mm/s asks an axis for a jerk of 2.5·10⁹ mm/s³: refused in whichever order piece and feed come,
/// unless the feed on the curve is lower.
#[test]
fn a_feed_too_fast_for_its_piece_is_refused() {
    let (coefficients, length) = arc(0.1, 0.7, 0.0);
    let header = with(LIMITS, 300.0);
    let fast = to_the_curve(LIMITS, 300.0, coefficients, length);
    let is_jerk = |cause: &SupplyError<Infallible>| matches!(cause, SupplyError::Rejected(Rejection::Limit { quantity: "axis jerk [mm/s³]", limit, .. }) if *limit == 2e9);
    assert!(refusal::<Fixed>(&header, &fast).is_some_and(|cause| is_jerk(&cause)));
    let mut feed_first = fast.clone();
    let last = feed_first.len() - 1;
    feed_first.swap(last - 1, last);
    assert!(refusal::<Fixed>(&header, &feed_first).is_some_and(|cause| is_jerk(&cause)));
    assert_eq!(refusal::<f64>(&header, &fast), None);
    assert_eq!(refusal::<f32>(&header, &fast), None);
    assert_eq!(refusal::<Fixed>(&header, &to_the_curve(LIMITS, 100.0, coefficients, length)), None);
    // Sharp at first, fast where it is straight again: on the same ramp it is too fast, after it not.
    let end: [Position; 3] =
        Piece::<Fixed, 3>::septic(1, [Position::ZERO; 3], coefficients, length).expect("a piece").end();
    let onward = [0.7_f64.cos(), 0.7_f64.sin(), 0.0];
    let mut streams = Box::new(Streams::<Fixed, 3, 8, 8>::new());
    let (mut feeder, _) = streams.split(header.rules, [Position::ZERO; 3]);
    feeder
        .piece(Piece::septic(1, [Position::ZERO; 3], coefficients, length).expect("a piece"))
        .expect("alone");
    feeder.piece(Piece::line(1, end, onward, mm(15.0)).expect("a line")).expect("straight on");
    let segment = |ramp: &Ramp<f64>| {
        motion_kernel::law::FeedSegment::<Fixed>::ramp(ramp, mm(ramp.length_mm()), TICK_S).expect("a ramp")
    };
    let whole = Ramp::new(&law(LIMITS), 0.0, 299.0);
    assert!(matches!(feeder.segment(segment(&whole)), Err(Refused::Invalid(Rejection::Limit { .. }))));
    let (slow, quick) = (Ramp::new(&law(LIMITS), 0.0, 10.0), Ramp::new(&law(LIMITS), 10.0, 299.0));
    assert!(slow.length_mm() > 0.07);
    feeder.segment(segment(&slow)).expect("slowly round it");
    feeder.segment(segment(&quick)).expect("it is behind");
}

/// A septic over 2.1 rad is none of arc length, and in fixed point its sums might not fit: an error, in both.
#[test]
fn a_piece_that_bends_too_far_is_an_error() {
    let sweep = 2.1_f64;
    // The Taylor polynomials of a circle by arc length.
    let mut coefficients = [[0.0; 7]; 3];
    let mut term = 1.0;
    for k in 1..=7 {
        term *= sweep / k as f64;
        let (axis, sign) = [(0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0)][(k - 1) % 4];
        coefficients[axis][k - 1] = sign * term / sweep;
    }
    let start = [Position::ZERO; 3];
    let wide = Piece::<f64, 3>::septic(1, start, coefficients, mm(1.0));
    assert!(matches!(wide, Err(PieceError::NotArcLength { .. })), "{wide:?}");
    let fixed = Piece::<Fixed, 3>::septic(1, start, coefficients, mm(1.0));
    assert!(matches!(fixed, Err(PieceError::Bent { sum, .. }) if sum > 4.0), "{fixed:?}");
    // Whatever the coefficients and however short the piece, there is an answer.
    let mut random = Random::new(11);
    let mut made = 0;
    for _ in 0..20_000 {
        let size = random.log(1e-3, 4.0);
        let mut coefficients = [[0.0; 7]; 3].map(|axis: [f64; 7]| axis.map(|_| random.between(-size, size)));
        if random.chance(0.5) {
            coefficients = arc(1.0, random.between(0.01, 1.4), random.between(-1.0, 1.0)).0;
        }
        let length = Position::from_bits(random.log(1.0, 17.0 * 4_294_967_296.0) as i64);
        made += usize::from(Piece::<Fixed, 3>::septic(1, start, coefficients, length).is_ok());
    }
    assert!(made > 5_000, "{made}");
}

/// Random curves under random rules: what is accepted is executed at the rules' limits without leaving the range, and
/// right; what is refused in fixed point is not far from leaving it.
#[test]
fn what_is_accepted_stays_within_the_range() {
    let mut random = Random::new(7);
    let (mut accepted, mut refused, mut fullest) = (0, 0, 0.0_f64);
    while accepted < 2000 || refused < 500 {
        let (coefficients, length) = arc(random.log(1e-3, 100.0), random.between(0.01, 0.8), 0.0);
        let limits =
            Limits { accel_mm_s2: random.log(1e3, 1e7), jerk_mm_s3: random.log(1e5, 1e9), snap_mm_s4: 1e9 };
        let feed_mm_s = random.log(1.0, 1e3);
        let header = with(limits, feed_mm_s);
        let items = to_the_curve(limits, feed_mm_s, coefficients, length);
        let make = |start| Piece::<Fixed, 3>::septic(1, start, coefficients, length).expect("a piece");
        let (fixed, wide) = (
            make([Position::ZERO; 3]),
            Piece::<f64, 3>::septic(1, [Position::ZERO; 3], coefficients, length).expect("a piece"),
        );
        let peak = |fixed_too: bool| {
            let mut peak_jerk = 0.0_f64;
            for part in 0..=8 {
                let s_mm = length.to_mm() * f64::from(part) / 8.0;
                for (a, j) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    let motion = PathMotion {
                        v_mm_s: feed_mm_s,
                        a_mm_s2: a * limits.accel_mm_s2,
                        j_mm_s3: j * limits.jerk_mm_s3,
                        ..PathMotion::default()
                    };
                    let narrow = PathMotion {
                        v_mm_s: Fixed::from_f64(motion.v_mm_s),
                        a_mm_s2: Fixed::from_f64(motion.a_mm_s2),
                        j_mm_s3: Fixed::from_f64(motion.j_mm_s3),
                        ..PathMotion::default()
                    };
                    let exact = wide.at(s_mm, &motion);
                    for exact in &exact {
                        peak_jerk = peak_jerk.max(exact.jerk_mm_s3.abs());
                    }
                    if !fixed_too {
                        continue;
                    }
                    for (found, exact) in fixed.at(Fixed::from_f64(s_mm), &narrow).iter().zip(&exact) {
                        // 2⁻²³ for Horner's steps of 2⁻²⁹, in each derivative.
                        let per = feed_mm_s / length.to_mm();
                        let (step, a, j) = (1.2e-7, limits.accel_mm_s2, limits.jerk_mm_s3);
                        let accel = step * (a + per * feed_mm_s) * 8.0 + 1e-3;
                        let jerk =
                            step * (j + 3.0 * per * a + per * per * feed_mm_s) * 8.0 + 1e-3 * (1.0 + per);
                        assert!((found.accel_mm_s2.to_f64() - exact.accel_mm_s2).abs() <= accel);
                        let off = (found.jerk_mm_s3.to_f64() - exact.jerk_mm_s3).abs();
                        assert!(off <= jerk, "{off} {jerk}");
                    }
                }
            }
            peak_jerk
        };
        match refusal::<Fixed>(&header, &items) {
            None => {
                accepted += 1;
                fullest = fullest.max(peak(true));
            }
            Some(SupplyError::Rejected(Rejection::Limit { quantity, .. }))
                if quantity.starts_with("axis") =>
            {
                refused += 1;
                // Signs in the sums, and the steepest axis: a bound, within a factor.
                assert!(peak(false) > 2e9 / 5.0, "{}", peak(false));
            }
            Some(other) => panic!("{other:?}"),
        }
    }
    println!("{accepted} accepted with jerks up to {fullest:e}, {refused} refused");
    assert!(fullest > 1e9);
}
