//! The curve of least bending within a tube about the path: a convex problem (S. Boyd, L. Vandenberghe,
//! "Convex Optimization", chapter 11).
//!
//! The curve is a quintic spline over the length of the path. What is made least is the integral of the
//! squares of its second to fourth derivative, each in units of what the limits allow at the feed that is
//! expected there. Each sample of the path holds the curve's point at the same place within a sphere of the
//! tolerance.
//!
//! Every step is one of a primal-dual interior-point method that may start outside (J. Nocedal, S. Wright,
//! "Numerical Optimization", 2nd edition, sections 19.2 and 19.3). Each sample has a slack variable and a
//! multiplier, both above 0. Newton steps reduce the constraint violation to zero and bring every product of
//! slack and multiplier to the same value. Then the sum of these products, the duality gap, bounds what is
//! left to gain.

use super::super::spline::basis::{Row, clamped, polynomial, row};
use super::super::{Vector, add, dot, norm, scale, subtract};
use super::cholesky::{ACTING, Cholesky};
use super::guide::Guide;
use crate::toolpath::Polynomial;
use crate::toolpath::blend::feed_within;
use motion_kernel::internals::add_work;
use motion_kernel::law::Limits;

/// Degree of the spline.
const DEGREE: usize = ACTING - 1;
/// Control points that the conditions at one end decide: point and three derivatives.
pub(super) const DECIDED: usize = 4;
/// Samples of the path for each span.
const SAMPLES: f64 = 3.0;
/// Part of the tolerance that is used: between the samples the curve may be farther.
const USED: f64 = 0.96;
/// Abscissae of Gauss's rule on 0 … 1, and their weights.
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// A point of the path that holds the curve.
struct Sample<const N: usize> {
    /// The first control point that acts on it.
    first: usize,
    row: Row,
    at: Vector<N>,
    /// How far the curve is from it \[mm\].
    off: Vector<N>,
    /// 1/tolerance² \[1/mm²\].
    per_square: f64,
    /// The slack variable, above 0: with [`Self::square`] it makes 1, and what it is off by is the
    /// constraint violation.
    slack: f64,
    /// The multiplier: the cost that a little more tolerance would save.
    multiplier: f64,
}

impl<const N: usize> Sample<N> {
    fn new(knots: &[f64], span: usize, mm: f64, at: Vector<N>, tolerance_mm: f64) -> Self {
        let tolerance_mm = USED * tolerance_mm;
        let per_square = 1.0 / (tolerance_mm * tolerance_mm);
        Self {
            first: span - DEGREE,
            row: row(knots, DEGREE, span, mm, 0),
            at,
            off: [0.0; N],
            per_square,
            slack: 1.0,
            multiplier: 1.0,
        }
    }

    /// The square of the curve's distance from it, in units of its tolerance: at most 1 within it.
    fn square(&self) -> f64 {
        self.per_square * dot(self.off, self.off)
    }
}

/// Quadrature over one span: factors of second to fourth derivative at three points.
struct Bending {
    rows: [[Row; 3]; GAUSS.len()],
    length_mm: f64,
    /// What the square of each derivative costs at each point.
    factors: [[f64; 3]; GAUSS.len()],
}

/// Second to fourth derivative at the points of the quadrature on one span.
type SpanDerivatives<const N: usize> = [[Vector<N>; 3]; GAUSS.len()];

/// The problem and where its solution stands.
pub(super) struct Problem<'a, const N: usize> {
    /// Ends of the spans \[mm\].
    breaks: &'a [f64],
    knots: Vec<f64>,
    samples: Vec<Sample<N>>,
    bendings: Vec<Bending>,
    control: Vec<Vector<N>>,
    /// How the curve of these control points bends on each span.
    bent: Vec<SpanDerivatives<N>>,
    /// Control points that the end has decided.
    decided_at_end: usize,
    /// What bending adds to the equations, Σ factor·row·rowᵀ of all points, at these costs.
    of_bending: Cholesky<N>,
    equations: Cholesky<N>,
}

impl<'a, const N: usize> Problem<'a, N> {
    /// The curve over `breaks`, which starts with this point and its first to third derivative by the length of
    /// the path, and ends with these, or freely.
    pub(super) fn new(
        guide: &Guide<N>,
        breaks: &'a [f64],
        start: &[Vector<N>; DECIDED],
        end: Option<&[Vector<N>; DECIDED]>,
    ) -> Self {
        let knots = clamped(breaks, DEGREE);
        let points = breaks.len() - 1 + DEGREE;
        let mut control: Vec<Vector<N>> = (0..points)
            .map(|index| {
                let mm = knots[index + 1..=index + DEGREE].iter().sum::<f64>() / DEGREE as f64;
                guide.at(guide.part_at(mm), mm).0
            })
            .collect();
        decide(&knots, &mut control, start, false);
        if let Some(end) = end {
            decide(&knots, &mut control, end, true);
        }
        let bendings = breaks
            .windows(2)
            .enumerate()
            .map(|(span, ends)| Bending {
                rows: GAUSS.map(|(x, _)| {
                    let mm = ends[0] + (ends[1] - ends[0]) * x;
                    core::array::from_fn(|order| row(&knots, DEGREE, DEGREE + span, mm, order + 2))
                }),
                length_mm: ends[1] - ends[0],
                factors: [[0.0; 3]; GAUSS.len()],
            })
            .collect::<Vec<_>>();
        let samples = samples(guide, breaks, &knots, end.is_none());
        let decided_at_end = if end.is_some() { DECIDED } else { 0 };
        let bent = vec![[[[0.0; N]; 3]; GAUSS.len()]; bendings.len()];
        let (of_bending, equations) = (Cholesky::new(points), Cholesky::new(points));
        let mut problem =
            Self { breaks, knots, samples, bendings, control, bent, decided_at_end, of_bending, equations };
        problem.measure();
        problem
    }

    /// The ends of the spans \[mm\].
    pub(super) fn breaks(&self) -> &[f64] {
        self.breaks
    }

    /// Sets what bending costs where: the limits, at the feeds that are expected on the spans \[mm/s\].
    fn set_costs(&mut self, limits: &Limits<f64>, feeds_mm_s: &[f64]) {
        self.of_bending.clear();
        for (span, (bending, &feed)) in self.bendings.iter_mut().zip(feeds_mm_s).enumerate() {
            let square = feed * feed;
            let units = [
                square / limits.accel_mm_s2,
                square * feed / limits.jerk_mm_s3,
                square * square / limits.snap_mm_s4,
            ];
            let mut gram = [[0.0; ACTING]; ACTING];
            bending.factors =
                GAUSS.map(|(_, share)| units.map(|unit| share * bending.length_mm * unit * unit));
            for (rows, factors) in bending.rows.iter().zip(&bending.factors) {
                for (row, factor) in rows.iter().zip(factors) {
                    for a in 0..ACTING {
                        for b in 0..=a {
                            gram[a][b] += factor * row[a] * row[b];
                        }
                    }
                }
            }
            for (a, row) in gram.iter().enumerate() {
                for (b, &entry) in row.iter().enumerate().take(a + 1) {
                    self.of_bending.add_unit(span + a, span + b, entry);
                }
            }
        }
    }

    /// Takes note of how the curve of the control points bends, and of how far it is from the samples.
    fn measure(&mut self) {
        for sample in &mut self.samples {
            let acting = &self.control[sample.first..sample.first + ACTING];
            let mut off = subtract(acting[2], sample.at);
            for (&control, &factor) in acting.iter().zip(&sample.row) {
                off = add(off, scale(subtract(control, acting[2]), factor));
            }
            sample.off = off;
        }
        for (span, (bending, bent)) in self.bendings.iter().zip(&mut self.bent).enumerate() {
            let acting = &self.control[span..span + ACTING];
            // Relative to one of them, so that nothing is lost far from the origin.
            let mut from = [[0.0; N]; ACTING];
            for (from, &control) in from.iter_mut().zip(acting) {
                *from = subtract(control, acting[2]);
            }
            for (rows, bent) in bending.rows.iter().zip(bent) {
                for (row, derivative) in rows.iter().zip(bent) {
                    *derivative = [0.0; N];
                    for (&from, &factor) in from.iter().zip(row) {
                        *derivative = add(*derivative, scale(from, factor));
                    }
                }
            }
        }
    }

    /// What bending costs.
    pub(super) fn cost(&self) -> f64 {
        let mut sum = 0.0;
        for (bending, bent) in self.bendings.iter().zip(&self.bent) {
            for (derivative, factor) in bent.iter().flatten().zip(bending.factors.iter().flatten()) {
                sum += factor * dot(*derivative, *derivative);
            }
        }
        0.5 * sum
    }

    /// The greatest distance of the curve from a sample, in units of its tolerance.
    pub(super) fn farthest(&self) -> f64 {
        self.samples.iter().map(Sample::square).fold(0.0, f64::max).sqrt()
    }

    /// The spans where the curve is farther from a sample than so many of its tolerances.
    pub(super) fn tight(&self, tolerances: f64) -> Vec<usize> {
        let is_far = |sample: &&Sample<N>| sample.square() > tolerances * tolerances;
        let mut spans: Vec<usize> = self.samples.iter().filter(is_far).map(|sample| sample.first).collect();
        spans.dedup();
        spans
    }

    /// Makes the tolerance of the samples on these spans and beside them smaller by the factors, and goes on.
    pub(super) fn tighten(&mut self, spans: &[(usize, f64)]) {
        for &(span, factor) in spans {
            // Samples are in the order of the spans.
            let first = self.samples.partition_point(|sample| sample.first + 1 < span);
            for sample in self.samples[first..].iter_mut().take_while(|sample| sample.first <= span + 1) {
                sample.per_square /= factor * factor;
            }
        }
        self.restart();
    }

    /// Starts where the curve is, for the limits at these feeds, with a duality gap as great as the cost.
    pub(super) fn start(&mut self, limits: &Limits<f64>, feeds_mm_s: &[f64]) {
        self.set_costs(limits, feeds_mm_s);
        self.restart();
    }

    fn restart(&mut self) {
        let per_sample = self.cost().max(f64::MIN_POSITIVE) / self.samples.len() as f64;
        for sample in &mut self.samples {
            sample.slack = SLACK_MIN.max(1.0 - sample.square());
            sample.multiplier = per_sample / sample.slack;
        }
    }

    /// Goes on for other feeds.
    pub(super) fn change(&mut self, limits: &Limits<f64>, feeds_mm_s: &[f64]) {
        let before = self.cost();
        self.set_costs(limits, feeds_mm_s);
        // What does not bend at all costs nothing at any feed.
        if before > 0.0 {
            let factor = self.cost() / before;
            self.samples.iter_mut().for_each(|sample| sample.multiplier *= factor);
        }
    }

    /// The duality gap: what is left to gain at most where no constraint is violated.
    pub(super) fn gap(&self) -> f64 {
        self.samples.iter().map(|sample| sample.multiplier * sample.slack).sum()
    }

    /// One step towards a gap of `gap_aim`: how much of it was taken, or nothing if the equations have no
    /// solution.
    pub(super) fn step(&mut self, gap_aim: f64) -> Option<f64> {
        add_work(self.bendings.len() + self.samples.len());
        let per_sample = gap_aim / self.samples.len() as f64;
        self.equations.copy_from(&self.of_bending);
        let mut slope = vec![[0.0; N]; self.control.len()];
        for (span, (bending, bent)) in self.bendings.iter().zip(&self.bent).enumerate() {
            let rows = bending.rows.iter().flatten();
            for ((row, derivative), factor) in
                rows.zip(bent.iter().flatten()).zip(bending.factors.iter().flatten())
            {
                for (slope, entry) in slope[span..].iter_mut().zip(row) {
                    *slope = subtract(*slope, scale(*derivative, factor * entry));
                }
            }
        }
        let mut pushes = Vec::with_capacity(self.samples.len());
        for sample in &self.samples {
            let pulled = scale(sample.off, 2.0 * sample.per_square);
            let violation = sample.square() - 1.0 + sample.slack;
            let (linear, square) =
                (2.0 * sample.multiplier * sample.per_square, sample.multiplier / sample.slack);
            let push = per_sample / sample.slack + square * violation;
            pushes.push((pulled, violation, push));
            let curvature: [Vector<N>; N] = core::array::from_fn(|a| {
                core::array::from_fn(|b| square * pulled[a] * pulled[b] + if a == b { linear } else { 0.0 })
            });
            for (slope, entry) in slope[sample.first..].iter_mut().zip(&sample.row) {
                *slope = subtract(*slope, scale(pulled, push * entry));
            }
            self.equations.add(sample.first, &sample.row, &curvature);
        }
        let last = self.control.len() - self.decided_at_end;
        for held in [0..DECIDED, last..self.control.len()] {
            slope[held.clone()].fill([0.0; N]);
            self.equations.hold(held);
        }
        if !self.equations.solve(&mut slope) {
            return None;
        }
        let step = slope;
        // Neither multipliers nor slacks may come to nothing.
        let (mut part, mut multiplier_part) = (1.0_f64, 1.0_f64);
        let mut changes = Vec::with_capacity(self.samples.len());
        for (sample, (pulled, violation, push)) in self.samples.iter().zip(pushes) {
            let acting = step[sample.first..].iter().zip(&sample.row);
            let moved = acting.fold([0.0; N], |sum, (&step, &entry)| add(sum, scale(step, entry)));
            let along = dot(pulled, moved);
            let multiplier_change = push + sample.multiplier / sample.slack * along - sample.multiplier;
            let slack_change = -violation - along;
            if multiplier_change < 0.0 {
                multiplier_part =
                    multiplier_part.min(FRACTION_TO_BOUNDARY * sample.multiplier / -multiplier_change);
            }
            if slack_change < 0.0 {
                part = part.min(FRACTION_TO_BOUNDARY * sample.slack / -slack_change);
            }
            changes.push((slack_change, multiplier_change));
        }
        if !part.is_finite() || !per_sample.is_finite() || step.iter().flatten().any(|mm| !mm.is_finite()) {
            return None;
        }
        for (control, &step) in self.control.iter_mut().zip(&step) {
            *control = add(*control, scale(step, part));
        }
        self.measure();
        for (sample, (slack_change, multiplier_change)) in self.samples.iter_mut().zip(changes) {
            let within = 1.0 - sample.square();
            sample.slack = (sample.slack + part * slack_change).max(within);
            let balanced = per_sample / sample.slack;
            sample.multiplier = (sample.multiplier + multiplier_part * multiplier_change)
                .clamp(balanced / APART_MAX, balanced * APART_MAX);
        }
        Some(part)
    }

    /// The feed at which each span alone keeps the limits \[mm/s\].
    pub(super) fn allowed_mm_s(&self, limits: &Limits<f64>) -> Vec<f64> {
        let of_span = |bent: &SpanDerivatives<N>| {
            let mut greatest = [0.0_f64; 3];
            for derivatives in bent {
                for (greatest, &derivative) in greatest.iter_mut().zip(derivatives) {
                    *greatest = greatest.max(norm(derivative));
                }
            }
            feed_within(limits, greatest)
        };
        self.bent.iter().map(of_span).collect()
    }

    /// Start and shape of each span.
    pub(super) fn shapes(&self) -> Vec<(Vector<N>, Polynomial<N>)> {
        let of_span = |span: usize| {
            let acting = &self.control[span..span + ACTING];
            // Relative to the first control point, so that nothing is lost far from the origin.
            let relative: [Vector<N>; ACTING] =
                core::array::from_fn(|index| subtract(acting[index], acting[0]));
            let (offset, shape) = polynomial(&self.knots, DEGREE, DEGREE + span, &relative);
            (add(acting[0], offset), shape)
        };
        (0..self.breaks.len() - 1).map(of_span).collect()
    }
}

/// How much of the way to where a slack or a multiplier comes to nothing a step may take.
const FRACTION_TO_BOUNDARY: f64 = 0.95;
/// The least slack to start with.
const SLACK_MIN: f64 = 0.1;
/// How far multipliers may be from balance: beyond, steps come to nothing.
const APART_MAX: f64 = 100.0;

/// The control points at the start or the end of the knots, from point and derivatives there.
fn decide<const N: usize>(
    knots: &[f64],
    control: &mut [Vector<N>],
    point: &[Vector<N>; DECIDED],
    is_end: bool,
) {
    let (count, last_span) = (control.len(), control.len() - 1);
    let (span, mm) = if is_end { (last_span, knots[count]) } else { (DEGREE, knots[DEGREE]) };
    for (order, &derivative) in point.iter().enumerate() {
        let row = row(knots, DEGREE, span, mm, order);
        // The derivative of this order has one control point more than the one below.
        let place = |index: usize| {
            if is_end { (count - 1 - index, row[DEGREE - index]) } else { (index, row[index]) }
        };
        let known = (0..order).fold(derivative, |rest, index| {
            let (point, factor) = place(index);
            subtract(rest, scale(control[point], factor))
        });
        let (point, factor) = place(order);
        control[point] = scale(known, 1.0 / factor);
    }
}

/// Samples at every joint of the path's parts, and so many between that each span has some; none at the start,
/// and one at the end if that is free.
fn samples<const N: usize>(
    guide: &Guide<N>,
    breaks: &[f64],
    knots: &[f64],
    is_end_free: bool,
) -> Vec<Sample<N>> {
    let mut samples = Vec::new();
    let last = breaks.len() - 2;
    let (mut mm, end_mm) = (breaks[0], breaks[last + 1]);
    let (mut part, mut span) = (guide.part_at(mm), 0);
    while mm < end_mm {
        let (_, part_end_mm) = guide.range_mm(part);
        let spacing_mm = (breaks[span + 1] - breaks[span]) / SAMPLES;
        mm = part_end_mm.min(mm + spacing_mm).min(end_mm);
        while span < last && breaks[span + 1] <= mm {
            span += 1;
        }
        let mut tolerance_mm = guide.parts[part].tolerance_mm;
        let (at, _) = guide.at(part, mm);
        // At a joint the smaller tolerance holds.
        if let Some(next) = guide.parts.get(part + 1)
            && mm >= part_end_mm
        {
            tolerance_mm = tolerance_mm.min(next.tolerance_mm);
            part += 1;
        }
        if mm < end_mm || is_end_free {
            samples.push(Sample::new(knots, DEGREE + span, mm, at, tolerance_mm));
        }
    }
    samples
}
