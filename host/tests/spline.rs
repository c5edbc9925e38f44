//! Splines, involutes and their pieces, against what knows nothing of them: their definitions, finite
//! differences and quadrature of its own.

use motion_host::machine::Machine;
use motion_host::planning::spline::plan_spline;
use motion_host::planning::{Mode, plan_moves};
use motion_host::simulate;
use motion_host::toolpath::curve::Curve;
use motion_host::toolpath::septic::{FEED_TOLERANCE, FitError, POSITION_TOLERANCE_MM, fit as septic_fit};
use motion_host::toolpath::smooth::Move;
use motion_host::toolpath::spline::{
    Degree, Derivatives, Ends, Spline, SplineError, chord_lengths, fit, interpolate,
};
use motion_host::toolpath::{Element, Feeds, Involute, Polynomial, Vector, septics};
use motion_tests::check::geometry::{minus, norm};
use motion_tests::random::Random;

const DEGREES: [Degree; 2] = [Degree::Cubic, Degree::Quintic];

/// Numbers that grow from 0 by steps that differ up to `uneven`-fold.
fn growing(random: &mut Random, count: usize, uneven: f64) -> Vec<f64> {
    let mut sum = 0.0;
    (0..count)
        .map(|index| {
            sum += if index == 0 { 0.0 } else { random.between(1.0, uneven) };
            sum
        })
        .collect()
}

fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Zeroth to fourth derivative by the spline's parameter, at the end of every span and at the start of the
/// next.
fn at_knots(spline: &Spline) -> Vec<[[Vector; 5]; 2]> {
    let spans: Vec<(Vector, &Polynomial)> =
        spline.elements().map(|(_, element)| element.ends_mm().0).zip(spline.spans()).collect();
    let widths: Vec<f64> = spline.knots().windows(2).map(|pair| pair[1] - pair[0]).collect();
    let of = |index: usize, part: f64| {
        let (start, shape) = spans[index];
        let [d1, d2, d3, d4] = shape.four_derivatives(part);
        let mut power = 1.0;
        let mut scaled = |vector: Vector| {
            power /= widths[index];
            vector.map(|x| x * power)
        };
        [plus(start, shape.offset(0.0, part)), scaled(d1), scaled(d2), scaled(d3), scaled(d4)]
    };
    (1..spans.len()).map(|index| [of(index - 1, 1.0), of(index, 0.0)]).collect()
}

/// Derivatives up to `order` agree at every knot.
fn assert_continuous(spline: &Spline, order: usize) {
    let width = spline.knots().windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    for [before, after] in at_knots(spline) {
        for order in 0..=order {
            // In units of the coordinates over a span.
            let step = norm(minus(before[order], after[order])) * width.powi(order as i32);
            assert!(step < 1e-9, "derivative {order} steps by {step}");
        }
    }
}

#[test]
fn it_goes_through_its_points_smoothly() {
    let mut random = Random::of_stream(1);
    for round in 0..200 {
        let count = 6 + random.below(40);
        let points: Vec<Vector> = (0..count).map(|_| random.vector(50.0)).collect();
        let parameters = growing(&mut random, count, 3.0);
        let clamps = [(); 2].map(|()| Derivatives { first: random.vector(30.0), second: random.vector(9.0) });
        for degree in DEGREES {
            for ends in [Ends::Free, Ends::Clamped(clamps)] {
                let spline = interpolate(&points, &parameters, degree, &ends).expect("a spline");
                for (point, u) in points.iter().zip(&parameters) {
                    let missed = norm(minus(spline.at(*u), *point));
                    assert!(missed <= spline.deviation_mm() && missed < 1e-8, "{round}: {missed}");
                }
                assert_continuous(&spline, degree.number() - 1);
                let Ends::Clamped(clamps) = ends else { continue };
                // By differences from outside, one-sided: what was asked for stands at the ends.
                let h = 1e-4;
                let (first, last) = (parameters[0], parameters[count - 1]);
                for (end, sign, clamp) in [(first, 1.0, clamps[0]), (last, -1.0, clamps[1])] {
                    let at = |steps: f64| spline.at(end + sign * h * steps);
                    for axis in 0..3 {
                        let [a, b, c] = [0.0, 1.0, 2.0].map(|steps| at(steps)[axis]);
                        let slope = sign * (-3.0 * a + 4.0 * b - c) / (2.0 * h);
                        assert!((slope - clamp.first[axis]).abs() < 1e-3, "{slope} {clamp:?}");
                        if degree == Degree::Quintic {
                            let d = at(3.0)[axis];
                            let second = (2.0 * a - 5.0 * b + 4.0 * c - d) / (h * h);
                            assert!((second - clamp.second[axis]).abs() < 0.05, "{second} {clamp:?}");
                        }
                    }
                }
            }
        }
    }
}

/// A polynomial of its degree is its own spline, whatever the parameters, and its own fit with one span.
#[test]
fn polynomials_are_reproduced() {
    let mut random = Random::of_stream(2);
    for _ in 0..200 {
        let count = 6 + random.below(20);
        let parameters = growing(&mut random, count, 10.0);
        let last = parameters[count - 1];
        for degree in DEGREES {
            let coefficients: Vec<Vector> = (0..=degree.number()).map(|_| random.vector(5.0)).collect();
            let curve = |u: f64| {
                let x = u / last;
                coefficients.iter().rev().fold([0.0; 3], |sum, c| plus(sum.map(|y| y * x), *c))
            };
            let points: Vec<Vector> = parameters.iter().map(|&u| curve(u)).collect();
            let through = interpolate(&points, &parameters, degree, &Ends::Free).expect("a spline");
            let near = fit(&points, &parameters, degree, 1e-9).expect("a spline");
            assert_eq!(near.spans().len(), 1);
            for part in 0..=300 {
                let u = last * f64::from(part) / 300.0;
                assert!(norm(minus(through.at(u), curve(u))) < 1e-8);
                assert!(norm(minus(near.at(u), curve(u))) < 1e-8);
            }
        }
    }
}

/// Half the step, a 16th of the error with degree 3 and a 64th with 5, up to the ends.
#[test]
fn the_order_of_accuracy_is_the_degree_and_one() {
    for (degree, least) in [(Degree::Cubic, 14.0), (Degree::Quintic, 50.0)] {
        let error = |count: usize| {
            let parameters: Vec<f64> =
                (0..count).map(|index| 5.0 * index as f64 / (count - 1) as f64).collect();
            let point = |u: f64| [10.0 * u.cos(), 10.0 * u.sin(), (2.0 * u).sin()];
            let points: Vec<Vector> = parameters.iter().map(|&u| point(u)).collect();
            let spline = interpolate(&points, &parameters, degree, &Ends::Free).expect("a spline");
            (0..=2000)
                .map(|part| 5.0 * f64::from(part) / 2000.0)
                .fold(0.0, |error: f64, u| error.max(norm(minus(spline.at(u), point(u)))))
        };
        let (coarse, fine) = (error(33), error(65));
        assert!(coarse / fine > least, "{degree:?}: {coarse} {fine}");
    }
}

/// What is stated is what an independent look finds, within the tolerance, with fewer knots than points, C³
/// throughout.
#[test]
fn a_fit_keeps_its_tolerance_and_says_how_well() {
    let mut random = Random::of_stream(3);
    let mut saved = 0;
    for round in 0..120 {
        let count = 6 + random.below(300);
        let (turns, noise) = (random.between(0.5, 12.0), 10.0_f64.powf(random.between(-7.0, -1.0)));
        let points: Vec<Vector> = (0..count)
            .map(|index| {
                let t = turns * index as f64 / count as f64;
                plus([20.0 * t.cos(), 15.0 * (1.3 * t).sin(), t], random.vector(noise))
            })
            .collect();
        let parameters = chord_lengths(&points).expect("points that differ");
        let tolerance = 10.0_f64.powf(random.between(-6.0, 0.0));
        for degree in DEGREES {
            let spline = fit(&points, &parameters, degree, tolerance).expect("a spline");
            let distances =
                points.iter().zip(&parameters).map(|(point, &u)| norm(minus(spline.at(u), *point)));
            let farthest = distances.fold(0.0, f64::max);
            assert!(farthest <= tolerance, "{round}: {farthest} of {tolerance}");
            assert_eq!(farthest.to_bits(), spline.deviation_mm().to_bits());
            assert!(norm(minus(spline.at(0.0), points[0])) < 1e-9);
            assert_continuous(&spline, degree.number() - 1);
            assert!(spline.spans().len() < count);
            saved += usize::from(2 * spline.spans().len() < count);
            // Each span knows the last point on it; the last span has the last one.
            let last: Vec<usize> = spline.elements().map(|(point, _)| point).collect();
            assert!(last.is_sorted() && last.last() == Some(&(count - 1)), "{last:?}");
        }
    }
    assert!(saved > 100, "{saved} of 240 with less than half the knots");
}

#[test]
fn what_is_no_spline_is_refused() {
    let good: Vec<Vector> = (0..8).map(|i| [f64::from(i), f64::from(i * i), 0.0]).collect();
    let even: Vec<f64> = (0..8).map(f64::from).collect();
    let of = |points: &[Vector], parameters: &[f64]| {
        let through = interpolate(points, parameters, Degree::Quintic, &Ends::Free).expect_err("refused");
        let near = fit(points, parameters, Degree::Quintic, 0.1).expect_err("refused");
        assert_eq!(format!("{through}"), format!("{near}"));
        assert!(through.to_string().contains(", expected "), "{through}");
        through
    };
    let with = |index: usize, point: Vector| {
        let mut points = good.clone();
        points[index] = point;
        points
    };
    assert_eq!(of(&good[..5], &even[..5]), SplineError::TooFew { points: 5, expected: 6 });
    assert_eq!(of(&[], &[]), SplineError::TooFew { points: 0, expected: 6 });
    assert_eq!(of(&good, &even[..7]), SplineError::Parameters { points: 8, parameters: 7 });
    assert_eq!(of(&with(3, good[2]), &even).point(), Some(3));
    assert!(matches!(of(&with(3, good[2]), &even), SplineError::Repeated { index: 3 }));
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let found = of(&with(5, [0.0, value, 0.0]), &even);
        assert!(matches!(found, SplineError::NotFinite { index: 5, .. }), "{found}");
        assert!(chord_lengths(&with(5, [0.0, value, 0.0])).is_err());
        for index in [0, 4, 7] {
            let mut parameters = even.clone();
            parameters[index] = value;
            let found = of(&good, &parameters);
            assert!(matches!(found, SplineError::Parameter { .. }), "{found}");
        }
    }
    let mut parameters = even.clone();
    parameters[4] = parameters[3];
    assert_eq!(of(&good, &parameters), SplineError::Parameter { index: 4, u: 3.0, before: 3.0 });
    for mm in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(fit(&good, &even, Degree::Cubic, mm), Err(SplineError::Tolerance { .. })));
    }
    // Steps that differ by up to ten decades: solved to the stated digits, or refused; never wrong, never a
    // panic.
    let mut random = Random::of_stream(4);
    let (mut solved, mut refused) = (0, 0);
    for _ in 0..500 {
        let (mut u, decades) = (0.0, random.between(0.0, 10.0));
        let parameters: Vec<f64> = (0..12)
            .map(|_| {
                u += 10.0_f64.powf(random.between(0.0, decades));
                u
            })
            .collect();
        let points: Vec<Vector> = (0..12).map(|_| random.vector(1e5)).collect();
        match interpolate(&points, &parameters, Degree::Quintic, &Ends::Free) {
            Ok(spline) => {
                solved += 1;
                assert!(spline.deviation_mm() < 1e-4, "{}", spline.deviation_mm());
            }
            Err(SplineError::Uneven { .. } | SplineError::Parameter { .. }) => refused += 1,
            Err(error) => panic!("{error}"),
        }
    }
    println!("{solved} solved, {refused} refused");
    assert!(solved > 100 && refused > 100, "{solved} {refused}");
}

/// The curve's points at equal steps of its parameter with the length up to each, by Simpson's rule.
fn measured(curve: &dyn Curve, from: f64, to: f64, steps: u32) -> Vec<(f64, Vector, f64)> {
    let speed = |u: f64| norm(curve.derivatives(u)[0]);
    let at = |step: f64| from + (to - from) * step / f64::from(steps);
    let mut length = 0.0;
    (0..=steps)
        .map(|step| {
            let step = f64::from(step);
            if step > 0.0 {
                let (a, m, b) = (at(step - 1.0), at(step - 0.5), at(step));
                length += (b - a) / 6.0 * (speed(a) + 4.0 * speed(m) + speed(b));
            }
            (at(step), curve.offset(from, at(step)), length)
        })
        .collect()
}

/// Pieces are where the curve is at the same length, and as fast, within what they state and a quarter; they
/// follow each other, and are as long as the curve.
#[test]
fn pieces_are_as_close_as_they_say() {
    let mut random = Random::of_stream(5);
    let (mut worst, mut count) = ([0.0_f64; 2], 0);
    for _ in 0..60 {
        let points: Vec<Vector> = (0..10).map(|_| random.vector(20.0)).collect();
        // Well and badly parametrised.
        let parameters = match random.below(2) {
            0 => chord_lengths(&points).expect("points that differ"),
            _ => growing(&mut random, 10, 4.0),
        };
        let degree = DEGREES[random.below(2)];
        let spline = interpolate(&points, &parameters, degree, &Ends::Free).expect("a spline");
        for (_, element) in spline.elements() {
            let (curve, end) = element.curve().expect("a curve");
            let pieces = septics::<f32, _>(&element).expect("smooth");
            let total: f64 = pieces.iter().map(|piece| piece.length_mm).sum();
            assert!((total - element.length_mm()).abs() < 1e-9 * total);
            let mut before = (0.0, [0.0; 3]);
            for piece in &pieces {
                count += 1;
                assert!(piece.length_mm <= 16.0);
                let (position, feed) = (piece.deviation.position_mm, piece.deviation.feed);
                assert!(position <= POSITION_TOLERANCE_MM && feed <= FEED_TOLERANCE);
                assert!(piece.span.0 == before.0 && norm(minus(piece.start, before.1)) < 1e-9);
                before = (piece.span.1, plus(piece.start, piece.at(1.0).0));
                let bound = piece.deviation.bound();
                let track = measured(curve, piece.span.0, piece.span.1, 64);
                let length = track[64].2;
                assert!((length / piece.length_mm - 1.0).abs() < 1e-8, "{length} {}", piece.length_mm);
                for (_, point, gone) in track {
                    let (found, slope) = piece.at(gone / length);
                    let far = norm(minus(found, point));
                    let fast = (norm(slope) - 1.0).abs();
                    // Simpson's own error, and rounding.
                    assert!(far <= bound.position_mm + 2e-8, "{far} of {position}");
                    assert!(fast <= bound.feed + 1e-9, "{fast} of {feed}");
                    if position > 1e-8 && feed > 1e-8 {
                        worst = [worst[0].max(far / position), worst[1].max(fast / feed)];
                    }
                }
            }
            assert!(before.0 == end);
        }
    }
    println!("{count} pieces; found/stated: position {:.3}, feed {:.3}", worst[0], worst[1]);
}

fn polynomial(coefficients: &[Vector]) -> Polynomial {
    let mut all = [[0.0; 3]; 7];
    all[..coefficients.len()].copy_from_slice(coefficients);
    Polynomial::new(all)
}

fn refused(curve: &impl Curve) -> FitError {
    septic_fit(curve, 0.0, 1.0, 1.0, 16.0).expect_err("pathological")
}

#[test]
fn pathological_curves_are_named() {
    // Cusps: y² = x³ about some u, the curve that runs back on itself, and those at an end.
    for at in [0.5, 0.3, 1.0 / 3.0, 0.0, 1.0] {
        let (a, b) = (2.0 * at, 3.0 * at);
        let cusp =
            polynomial(&[[-a, b * at, 0.0], [1.0, -b, 0.0], [0.0, 1.0, 0.0]].map(|c| c.map(|x| 10.0 * x)));
        let found = refused(&cusp);
        assert!(
            matches!(found, FitError::StandsStill { parameter } if (parameter - at).abs() < 1e-4),
            "{at}: {found}"
        );
        let back = polynomial(&[[-a, -a, 0.0], [1.0, 1.0, 0.0]]);
        let found = refused(&back);
        assert!(
            matches!(found, FitError::StandsStill { parameter } if (parameter - at).abs() < 1e-4),
            "{at}: {found}"
        );
    }
    let found = refused(&polynomial(&[]));
    assert!(matches!(found, FitError::StandsStill { .. }), "a point only: {found}");
    for value in [f64::NAN, f64::INFINITY, 1e200] {
        let found = refused(&polynomial(&[[1.0, 0.0, 0.0], [0.0, value, 0.0]]));
        assert!(matches!(found, FitError::NotFinite { .. }), "{value}: {found}");
    }
    let found = refused(&polynomial(&[[1e7, 0.0, 0.0]]));
    assert!(matches!(found, FitError::TooLong { length_mm, .. } if length_mm == 1e7), "{found}");
    for error in [found, refused(&polynomial(&[])), refused(&polynomial(&[[f64::NAN; 3]]))] {
        assert!(error.to_string().contains(", expected "), "{error}");
    }
    // A curve that crosses itself is none of it.
    let crossing =
        polynomial(&[[-2.0, 2.0, 0.0], [12.0, -6.0, 0.0], [-8.0, 4.0, 0.0]].map(|c| c.map(|x| 10.0 * x)));
    let pieces = septic_fit(&crossing, 0.0, 1.0, 1.0, 16.0);
    println!("{:?}", pieces.as_ref().map(Vec::len));
}

/// A line that quivers: smooth, and with ever so many waves.
struct Quiver {
    waves: f64,
    height_mm: f64,
    calls: std::cell::Cell<u64>,
}

impl Quiver {
    fn new(waves: f64, height_mm: f64) -> Self {
        Self { waves, height_mm, calls: std::cell::Cell::new(0) }
    }
}

impl Curve for Quiver {
    fn offset(&self, origin: f64, u: f64) -> Vector {
        let wave = |u: f64| self.height_mm * (self.waves * u).sin();
        [u - origin, wave(u) - wave(origin), 0.0]
    }

    fn derivatives(&self, u: f64) -> [Vector; 3] {
        self.calls.set(self.calls.get() + 1);
        let (w, h, angle) = (self.waves, self.height_mm, self.waves * u);
        [
            [1.0, h * w * angle.cos(), 0.0],
            [0.0, -h * w * w * angle.sin(), 0.0],
            [0.0, -h * w.powi(3) * angle.cos(), 0.0],
        ]
    }
}

/// The cap is hard: in depth, in the number of pieces, and in what finding out takes.
#[test]
fn endless_curves_hit_the_cap() {
    let pieces = |error: FitError| {
        assert!(error.to_string().contains(", expected at most"), "{error}");
        let FitError::TooManyPieces { pieces, .. } = error else { panic!("{error}") };
        pieces
    };
    for waves in [1e5, 1e6, 1e9] {
        let curve = Quiver::new(waves, 1.0);
        assert!(pieces(refused(&curve)) < 100);
        assert!(curve.calls.get() < 100_000, "{}", curve.calls.get());
    }
    // Gentle waves: each is followed by a few pieces, so that their number is what ends it.
    let curve = Quiver::new(6e3, 1.0 / 6e3);
    let found = pieces(refused(&curve));
    assert!((2000..=4200).contains(&found), "{found}");
    assert!(curve.calls.get() < 4_000_000, "{}", curve.calls.get());
    let fewer = septic_fit(&Quiver::new(6e2, 1.0 / 6e2), 0.0, 1.0, 1.0, 16.0).expect("a tenth of the waves");
    assert!((400..=4200).contains(&fewer.len()), "{}", fewer.len());
}

/// Random polynomials of every kind, cusps and loops among them: pieces or a typed error, and nothing that is
/// not finite.
#[test]
fn random_polynomials_have_pieces_or_an_error() {
    let mut random = Random::of_stream(6);
    let (mut good, mut bad) = (0, 0);
    for round in 0..400 {
        let size = 10.0_f64.powf(random.between(-6.0, 4.0));
        let mut coefficients = [[0.0; 3]; 7];
        for coefficient in coefficients.iter_mut().take(1 + random.below(7)) {
            *coefficient = match random.below(4) {
                0 => [0.0; 3],
                1 => [random.between(-size, size), 0.0, 0.0],
                _ => random.vector(size),
            };
        }
        match septic_fit(&Polynomial::new(coefficients), 0.0, 1.0, 1.0, 16.0) {
            Ok(pieces) => {
                good += 1;
                for piece in pieces {
                    assert!(piece.coefficients.iter().flatten().all(|c| c.is_finite()), "{round}");
                    assert!(piece.length_mm > 0.0 && piece.length_mm <= 16.0, "{round}: {}", piece.length_mm);
                }
            }
            Err(error) => {
                bad += 1;
                assert!(error.to_string().contains(", expected "), "{round}: {error}");
            }
        }
    }
    println!("{good} compiled, {bad} refused");
    assert!(good > 150 && bad > 20, "{good} {bad}");
}

/// Through the real kernel: the set positions of every tick lie on the spline, and the axes' jerk is that of
/// the path.
#[test]
fn a_spline_runs_as_it_was_programmed() {
    let points: Vec<Vector> = (0..24)
        .map(|index| {
            let t = f64::from(index) * 0.4;
            [20.0 * t.cos() - 20.0, 12.0 * t.sin(), 0.7 * t]
        })
        .collect();
    let parameters = chord_lengths(&points).expect("points that differ");
    let spline = fit(&points, &parameters, Degree::Quintic, 0.0).expect("a spline");
    let machine = Machine::reference();
    let lines: Vec<u32> = (2..26).collect();
    let (plan, pieces) = plan_spline("points", &spline, &lines, 20.0, &machine).expect("a plan");
    assert!(pieces.count >= spline.spans().len());
    assert!(pieces.deviation.position_mm <= 1.25 * POSITION_TOLERANCE_MM);
    assert!(pieces.deviation.feed <= 1.25 * FEED_TOLERANCE);
    assert_eq!((&*plan.blocks[0].kind, plan.blocks[0].line), ("spline", 5));
    assert_eq!(plan.blocks.last().map(|block| block.line), Some(25));
    // One stretch: no knot is a stop.
    assert_eq!(plan.items.len(), 1);
    let course = motion_host::smoothness::course(&spline);
    let (mut farthest, mut fastest) = (0.0_f64, 0.0_f64);
    let summary = simulate::run(&plan, &machine, &mut |tick| {
        let there = course.at(tick.s_mm).expect("on the path");
        let set = tick.axes.map(|axis| axis.set_mm);
        // Set positions of the record are those of the axes, which preview may delay: on the reference
        // machine it does not.
        farthest = farthest.max(norm(minus(set, there.point)));
        let velocity = tick.axes.map(|axis| axis.vel_mm_s);
        fastest = fastest.max(norm(minus(velocity, there.tangent.map(|t| t * tick.v_mm_s))));
    })
    .expect("a run");
    assert!(summary.faults.is_empty(), "{:?}", summary.faults);
    assert!(farthest < 2e-5, "{farthest}");
    assert!(fastest < 1e-3, "{fastest}");
    assert!((summary.max_feed_mm_s - 20.0).abs() < 1e-3, "{}", summary.max_feed_mm_s);
    // A spline that starts elsewhere is come to by a rapid.
    let moved: Vec<Vector> = points.iter().map(|&point| plus(point, [5.0, 6.0, 0.0])).collect();
    let spline = fit(&moved, &parameters, Degree::Quintic, 0.0).expect("a spline");
    let (plan, _) = plan_spline("points", &spline, &lines, 20.0, &machine).expect("a plan");
    assert_eq!((&*plan.blocks[0].kind, plan.blocks[0].line), ("line", 2));
    let summary = simulate::run(&plan, &machine, &mut |_| ()).expect("a run");
    assert!(summary.faults.is_empty(), "{:?}", summary.faults);
}

/// An involute through the real kernel, against the definition: the end of a string that unwinds.
#[test]
fn an_involute_runs_as_it_was_programmed() {
    let (base_mm, from_rad, to_rad) = (6.0, 0.3, 5.0);
    let shape =
        Involute::new(([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), base_mm, (from_rad, to_rad)).expect("a shape");
    let end_of_string = |angle: f64| {
        let (sine, cosine) = angle.sin_cos();
        [base_mm * (cosine + angle * sine), base_mm * (sine - angle * cosine), 0.0]
    };
    let centre = end_of_string(from_rad).map(|mm| -mm);
    let element = Element::involute(centre, shape);
    assert_eq!(element.kind(), "involute");
    assert!(norm(element.ends_mm().0) < 1e-12);
    let machine = Machine::reference();
    let step = Move {
        line: 1,
        element,
        feeds: Feeds::xyz(30.0),
        tolerance_mm: 0.0,
        merging_mm: None,
        distance_mm: 0.0,
    };
    let plan = plan_moves("involute", vec![step], &machine, Mode::default()).expect("a plan");
    assert!((plan.length_mm - 0.5 * base_mm * (to_rad * to_rad - from_rad * from_rad)).abs() < 1e-9);
    let mut farthest = 0.0_f64;
    let summary = simulate::run(&plan, &machine, &mut |tick| {
        let angle = (from_rad * from_rad + 2.0 * tick.s_mm / base_mm).sqrt();
        let expected = plus(centre, end_of_string(angle));
        farthest = farthest.max(norm(minus(tick.axes.map(|axis| axis.set_mm), expected)));
    })
    .expect("a run");
    assert!(summary.faults.is_empty(), "{:?}", summary.faults);
    assert!(farthest < 2e-5, "{farthest}");
}
