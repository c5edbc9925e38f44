//! The sines of the kernel, of `libm` and of `micromath` and the law's shapes, by each backend, against 31 digits:
//! `tests/expected/functions.md`.
//!
//! Errors are absolute in units of the shapes' scales, and relative from x = 10⁻⁴ up, where a ramp begins (a
//! ramp's other end is the mirror image). Fixed point has steps and no relative precision.

use motion_kernel::internals::{Libm, Micromath, Own, Shape, SineCosine};
use motion_kernel::num::{Fixed, Real, Unit};
use motion_tests::dd::{Dd, dd};
use motion_tests::figures::{Table, hold};

const DENSE: u32 = 200_000;
/// Where relative errors begin.
const EDGE: f64 = 1e-4;
/// Terms of the reference's series: the first one left out is below 10⁻³¹ at x = 1.
const TERMS: usize = 29;

/// Acceleration, feed and length, relative; each from [`EDGE`] up.
const RELATIVE: [usize; 3] = [1, 2, 3];

/// Everything from one Taylor series each, in 31 digits: neither mirrored, nor one from another as in the
/// kernel, nor with a sine.
struct Reference {
    /// (−1)^(n+1)·(2π)^(2n)/(2·(2n)!), n = 1 …: sin²πx over x^(2n), and what integrates it once, twice, three
    /// times, and its derivative over π.
    shapes: [[Dd; TERMS]; 5],
    sine: [Dd; TERMS],
    cosine: [Dd; TERMS],
}

impl Reference {
    fn new() -> Self {
        let count = |n: usize| dd(n as f64);
        let mut shapes = [[Dd::ZERO; TERMS]; 5];
        let two_pi_square = Dd::PI * Dd::PI * dd(4.0);
        let mut jerk = -dd(0.5);
        for i in 0..TERMS {
            let power = 2 * (i + 1);
            jerk = -(jerk * two_pi_square / (count(power) * count(power - 1)));
            let accel = jerk / count(power + 1);
            let speed = accel / count(power + 2);
            let length = speed / count(power + 3);
            for (series, term) in
                shapes.iter_mut().zip([jerk, accel, speed, length, jerk * count(power) / Dd::PI])
            {
                series[i] = term;
            }
        }
        let series = |first: Dd, power: usize| {
            let mut term = first;
            std::array::from_fn(|i| {
                let n = power + 2 * i;
                let here = term;
                term = -(term * Dd::PI * Dd::PI / (count(n + 1) * count(n + 2)));
                here
            })
        };
        Self { shapes, sine: series(Dd::PI, 1), cosine: series(dd(1.0), 0) }
    }

    /// Jerk, acceleration, feed, length, snap.
    fn shape(&self, x: Dd) -> [Dd; 5] {
        let square = x * x;
        let [jerk, accel, speed, length, snap] =
            self.shapes.map(|series| sum(&series, square)).map(|sum| sum * x);
        [jerk * x, accel * square, speed * square * x, length * square * square, snap]
    }

    fn sin_cos(&self, x: Dd) -> [Dd; 2] {
        let square = x * x;
        [sum(&self.sine, square) * x, sum(&self.cosine, square)]
    }
}

fn sum(series: &[Dd], square: Dd) -> Dd {
    series.iter().rev().fold(Dd::ZERO, |sum, &term| sum * square + term)
}

/// A method of evaluation, and its worst errors.
struct Method<U> {
    name: String,
    sin_cos: Option<fn(U) -> (U, U)>,
    stated: f64,
    shape: fn(U) -> Shape<U>,
    sine: f64,
    absolute: [f64; 5],
    relative: [f64; 3],
}

impl<U: Unit> Method<U> {
    fn series(number: &str) -> Self {
        Self {
            name: format!("{number}, series"),
            sin_cos: None,
            stated: 0.0,
            shape: Shape::at,
            sine: 0.0,
            absolute: [0.0; 5],
            relative: [0.0; 3],
        }
    }

    fn closed<B: SineCosine<U>>(number: &str) -> Self {
        Self {
            name: format!("{number}, closed, {}", B::NAME),
            sin_cos: Some(B::sin_cos),
            stated: B::ERROR,
            shape: Shape::closed::<B>,
            ..Self::series(number)
        }
    }

    fn at(&mut self, x: U, exact: &[Dd; 5], exact_sine: Option<&[Dd; 2]>) {
        let shape = (self.shape)(x);
        let values = [shape.jerk, shape.accel, shape.speed, shape.length, shape.snap];
        for ((worst, value), &exact) in self.absolute.iter_mut().zip(values).zip(exact) {
            *worst = worst.max(error(value, exact));
        }
        if x.to_f64() >= EDGE {
            for (worst, which) in self.relative.iter_mut().zip(RELATIVE) {
                *worst = worst.max(error(values[which], exact[which]) / exact[which].to_f64());
            }
        }
        if let (Some(sin_cos), Some(exact)) = (self.sin_cos, exact_sine) {
            let (sine, cosine) = sin_cos(x);
            self.sine = self.sine.max(error(sine, exact[0])).max(error(cosine, exact[1]));
        }
    }
}

fn error<U: Unit>(value: U, exact: Dd) -> f64 {
    (dd(value.to_f64()) - exact).abs().to_f64()
}

/// Measures `methods`, checks what they state, and appends their rows.
fn measure<U: Unit>(reference: &Reference, mut methods: Vec<Method<U>>, relative: bool, table: &mut Table) {
    let dense = (0..=DENSE).map(|i| f64::from(i) / f64::from(DENSE));
    let near = std::iter::successors(Some(1e-6), |x| Some(x * 1.000_1)).take_while(|&x| x < 1.0);
    for x in dense.chain(near) {
        let x = U::from_f64(x);
        let wide = dd(x.to_f64());
        let shape = reference.shape(wide);
        let sine = (wide.hi <= 0.5).then(|| reference.sin_cos(wide));
        for method in &mut methods {
            method.at(x, &shape, sine.as_ref());
        }
    }
    for method in &methods {
        assert!(
            method.sine <= method.stated,
            "{}: {:e}, stated {:e}",
            method.name,
            method.sine,
            method.stated
        );
        let figure = |error: f64| format!("{error:.1e}");
        let mut cells = vec![method.name.clone()];
        cells.push(method.sin_cos.map_or_else(|| "–".to_owned(), |_| figure(method.sine)));
        cells.extend(method.absolute.map(figure));
        cells.extend(method.relative.map(|error| if relative { figure(error) } else { "–".to_owned() }));
        table.row(&cells);
    }
}

#[test]
fn errors_are_those_of_the_table() {
    let reference = Reference::new();
    let mut table = Table::new(&[
        "shapes by",
        "sine, cosine",
        "jerk",
        "acceleration",
        "feed",
        "length",
        "snap",
        "acceleration, relative",
        "feed, relative",
        "length, relative",
    ]);
    let methods = vec![
        Method::series("f32"),
        Method::closed::<Own>("f32"),
        Method::closed::<Libm>("f32"),
        Method::closed::<Micromath>("f32"),
    ];
    measure::<f32>(&reference, methods, true, &mut table);
    let methods = vec![Method::series("fixed"), Method::closed::<Own>("fixed")];
    measure::<<Fixed as Real>::Unit>(&reference, methods, false, &mut table);
    let methods = vec![Method::series("f64"), Method::closed::<Own>("f64"), Method::closed::<Libm>("f64")];
    measure::<f64>(&reference, methods, true, &mut table);
    println!("{}", table.to_markdown());
    hold("functions", &table, 0.02).unwrap_or_else(|difference| panic!("{difference}"));
}

/// The reference itself, where it is known in closed form.
#[test]
fn reference_ends_where_the_paper_says() {
    let [jerk, accel, speed, length, snap] = Reference::new().shape(dd(1.0));
    let length_end = dd(1.0) / dd(12.0) - dd(1.0) / (dd(8.0) * Dd::PI * Dd::PI);
    for (value, exact) in
        [(jerk, Dd::ZERO), (accel, dd(0.5)), (speed, dd(0.25)), (length, length_end), (snap, Dd::ZERO)]
    {
        assert!((value - exact).abs().hi < 1e-29, "{value:?} {exact:?}");
    }
    let [sine, cosine] = Reference::new().sin_cos(dd(0.5));
    assert!((sine - dd(1.0)).abs().hi < 1e-30 && cosine.abs().hi < 1e-30, "{sine:?} {cosine:?}");
}
