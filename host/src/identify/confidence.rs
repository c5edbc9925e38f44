//! How well the recordings fix the unknowns.
//!
//! The covariance of the unknowns, in the search's coordinates, is the inverse of the information of all runs.
//! Residuals that resemble their neighbours tell less: n of them as little as n/γ independent ones, with γ one
//! plus twice the sum of their autocorrelation. Where an axis moves by part of a count from tick to tick, rounding errors make
//! each other good: sums of readings scatter less than those of independent ones, and tell more.
//!
//! Where the model does not follow, what is left of the recordings may be the work of anything. An unknown moves by
//! at most √left standard deviations for a remainder of `left` (Cauchy and Schwarz), and intervals become as much
//! wider.
//!
//! Drives work in steps of their own, and so does the model. Along the direction that the recordings fix worst, positions
//! hardly change over many steps of the drive but go up and down within each, and a derivative sees only this. So the
//! weakest directions are looked at over a standard deviation instead: what little changes over that is what tells.
//!
//! Intervals of what is made from several unknowns, and of what has a bound, are not those of a parabola. So
//! samples are drawn from the covariance, cut to the bounds, and the interval is what holds 95 of 100. Searches that end in
//! other places, and beds that recordings do not show, have their share of the samples, by their likelihood.

use super::bed::unseen_beds;
use super::cholesky::{Lower, Symmetric};
use super::parameters::{ALL, Unknown, Unknowns, way};
use super::readings::{Precision, Residuals, Runs, Weights, dot};
use super::search::{Found, SEARCH_SCATTER, derivatives};
use super::simulation::SUBSTEPS;
use super::{Alternatives, Estimate};
use crate::chance::Chance;

/// Lags over which autocorrelation is summed at most.
const LAGS_MAX: usize = 400;

/// Readings over which errors are summed. More would scatter less, but how much less is known worse.
const SUMMED: usize = 11;

/// The least scatter of sums that is believed. What cancels in steady motion does not where motion changes, and taking off
/// offsets lowers the scatter, too. Without noise it is 0.40 to 0.52 as measured over random drives.
const SCATTER_MIN: f64 = 0.4;

/// γ from which a run's residuals are not white.
const NOT_WHITE: f64 = 1.35;

/// Powers of the inverse for its greatest direction.
const POWERS: usize = 12;

/// Weakest directions that are looked at over a standard deviation, and how often each: it grows.
const WIDE_DIRECTIONS: usize = 3;
const WIDE_ROUNDS: usize = 3;
/// Part of the change that derivatives promise, from which they are believed.
const PROMISED: f64 = 0.9;

/// Samples that intervals are read from: their ends are good to a thirtieth.
const SAMPLES: usize = 2000;
/// And those that are handed on: intervals are good to an eighth.
const ALTERNATIVES: usize = 32;

/// The autocorrelation of all runs' residuals, by lag; 0 where there are none.
fn autocorrelation(runs: &[&[f64]]) -> impl Fn(usize) -> f64 {
    let power: f64 = runs.iter().map(|run| dot(run, run)).sum();
    move |lag| {
        let of_run = |run: &&[f64]| run.get(lag..).map_or(0.0, |later| dot(later, run));
        if power > 0.0 { runs.iter().map(of_run).sum::<f64>() / power } else { 0.0 }
    }
}

/// γ of one run's residuals, at least 1.
fn correlation_factor(residuals: &[f64]) -> f64 {
    let run = [residuals];
    let correlations = (1..LAGS_MAX.min(residuals.len())).map(autocorrelation(&run));
    // Beyond its first zero the estimate is noise.
    1.0 + 2.0 * correlations.take_while(|&correlation| correlation > 0.0).sum::<f64>()
}

/// The variance of sums of some [`SUMMED`] residuals over that of independent ones. Rounding errors of an axis that moves by part of
/// a count from tick to tick run through the count, and their sums hardly grow.
fn scatter_of_sums(whitened: &[Vec<f64>]) -> f64 {
    let runs: Vec<&[f64]> = whitened.iter().map(Vec::as_slice).collect();
    let correlation = autocorrelation(&runs);
    // Weights of Bartlett: a variance is never negative.
    let share = |lag: usize| 1.0 - lag as f64 / SUMMED as f64;
    1.0 + 2.0 * (1..SUMMED).map(|lag| share(lag) * correlation(lag)).sum::<f64>()
}

/// What else recordings allow than what was found.
#[derive(Clone, Debug)]
pub(super) struct Confidence {
    best: Unknowns,
    samples: Vec<Unknowns>,
    /// What intervals are to be multiplied by.
    widening: f64,
}

/// Ends of searches that are nearer to each other are one place: standard deviations, squared.
const ONE_PLACE: f64 = 1.0;

/// Where the recordings may be from: the end of a search, and how wide its valley is.
struct Place<'a> {
    centre: Unknowns,
    free: &'a [Unknown],
    misfit: f64,
    information: Symmetric,
    /// Of the covariance.
    factor: Lower,
}

/// A bed beside a rigid model, which recordings do not tell from chance, but which was searched for.
pub(super) struct UnprovenBed {
    pub(super) unknowns: Unknowns,
    /// Logarithm of its likelihood over that of the rigid model, by Schwarz.
    pub(super) log_likelihood: f64,
}

impl<'a> Place<'a> {
    fn new(centre: Unknowns, free: &'a [Unknown], misfit: f64, information: Symmetric) -> Option<Self> {
        let factor = inverse_factor(&information)?;
        Some(Self { centre, free, misfit, information, factor })
    }

    /// With its columns of derivatives and its residuals.
    fn linearised(
        runs: &Runs,
        weights: &Weights,
        centre: Unknowns,
        free: &'a [Unknown],
    ) -> Option<(Self, Vec<Residuals>, Residuals)> {
        let (mut columns, residuals) = derivatives(runs, &centre, free, SUBSTEPS, true)?;
        let misfit = weights.misfits(&residuals).iter().sum();
        widen(runs, weights, &centre, free, &mut columns, &residuals);
        let mut information = weights.columns(&columns).normal();
        for (index, unknown) in free.iter().enumerate() {
            // An unknown that no run shows ends with this width, far beyond what counts as determined.
            *information.at_mut(index, index) += unknown.ignorance().powi(-2);
        }
        Some((Self::new(centre, free, misfit, information)?, columns, residuals))
    }

    /// Whether the end of another search is the same place.
    fn is_at(&self, other: &Unknowns) -> bool {
        self.information.quadratic_form(&way(self.free, &self.centre, other)) < ONE_PLACE
    }

    /// The logarithm of its likelihood over that of another place with as many unknowns, by Laplace: a wide valley counts for
    /// more. An end that is worse counts for less by what is beyond the scatter of searches.
    fn log_likelihood(&self, other: &Place) -> f64 {
        let wider = self.factor.log_determinant() - other.factor.log_determinant();
        let worse = self.misfit - other.misfit;
        wider - 0.5 * (worse.min(0.0) + (worse - SEARCH_SCATTER).max(0.0))
    }

    /// A sample about `centre`, which is its own or that of another place of its width.
    fn sample(&self, centre: Unknowns, chance: &mut Chance, lag_limit_s: f64) -> Unknowns {
        let normal: Vec<f64> = self.free.iter().map(|_| chance.normal()).collect();
        let steps = self.factor.times(&normal);
        let moved = self.free.iter().zip(steps);
        let moved = moved.fold(centre, |sample, (&unknown, step)| sample.shifted(unknown, step));
        moved.bounded(self.free, lag_limit_s)
    }
}

/// The confidence of what a search over the `free` unknowns found, with weights that are up to date; `None` if it
/// can't be linearised.
pub(super) fn confidence(
    runs: &mut Runs,
    found: &Found,
    free: &[Unknown],
    unproven: Option<&UnprovenBed>,
    left: f64,
) -> Option<Confidence> {
    let whitened = runs.weights(Precision::LAST).whitened(&found.residuals);
    let factors: Vec<f64> = whitened.iter().map(|run| correlation_factor(run)).collect();
    // A remainder that counts as a whole counts once.
    let not_white = if left > 0.0 { f64::INFINITY } else { NOT_WHITE };
    // The bound for what a remainder does is in units of the readings' errors.
    let scatter = if left > 0.0 { 1.0 } else { scatter_of_sums(&whitened).clamp(SCATTER_MIN, 1.0) };
    let counted: Vec<f64> =
        factors.iter().map(|&factor| if factor > not_white { factor } else { scatter }).collect();
    runs.scale_variances(&counted);
    let weights = runs.weights(Precision::LAST);
    let lag_limit_s = runs.lag_limit_s();
    let place = |centre: &Unknowns, free| Place::linearised(runs, &weights, *centre, free);
    let (first, columns, still) = place(&found.unknowns, free)?;
    let mut places = vec![(first, 0.0)];
    for rival in &found.rivals {
        if places.iter().any(|(place, _)| place.is_at(rival)) {
            continue;
        }
        // A rival that can't be linearised is none.
        let rival = place(rival, free);
        places.extend(rival.map(|(rival, ..)| {
            let log_likelihood = rival.log_likelihood(&places[0].0);
            (rival, log_likelihood)
        }));
    }
    places.extend(unproven.and_then(|bed| Some((place(&bed.unknowns, &ALL)?.0, bed.log_likelihood))));
    let mut chance = Chance(0x1DE7);
    let mut samples = samples(&places, &mut chance, lag_limit_s);
    // Beside a remainder, likelihoods mean nothing.
    if found.unknowns.get(Unknown::BedMassRatio) == 0.0 && left == 0.0 {
        let beds = drawn(&unseen_beds(runs, &weights, &found.unknowns, columns, &still));
        let rigid = &places[0].0;
        samples.extend(beds.into_iter().map(|bed| rigid.sample(bed, &mut chance, lag_limit_s)));
    }
    Some(Confidence { best: found.unknowns, samples, widening: 1.0 + left.max(0.0).sqrt() / 1.96 })
}

/// Samples of places with their log-likelihoods over the first one's. That was found, and by more than its misfit: a filter has
/// to be worth its unknown. So none has more samples.
fn samples(places: &[(Place, f64)], chance: &mut Chance, lag_limit_s: f64) -> Vec<Unknowns> {
    let mut samples = Vec::new();
    for (place, log_likelihood) in places {
        let count = (libm::exp(log_likelihood.min(0.0)) * SAMPLES as f64) as usize;
        samples.extend((0..count).map(|_| place.sample(place.centre, chance, lag_limit_s)));
    }
    samples
}

/// Of sets of unknowns, each as often as it is likely; they have the logarithms of their likelihoods over what was found.
fn drawn(sets: &[(Unknowns, f64)]) -> Vec<Unknowns> {
    let sets = || sets.iter().filter(|(_, log_likelihood)| !log_likelihood.is_nan());
    let most = sets().map(|(_, log_likelihood)| *log_likelihood).fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return Vec::new();
    }
    let share = |log_likelihood: f64| libm::exp(log_likelihood - most);
    let all: f64 = sets().map(|(_, log_likelihood)| share(*log_likelihood)).sum();
    // What was found has no less.
    let count = SAMPLES as f64 * libm::exp((libm::log(all) + most).min(0.0));
    let mut due = 0.0;
    let mut drawn = Vec::new();
    for (set, log_likelihood) in sets() {
        due += share(*log_likelihood) / all * count;
        let times = due as usize;
        due -= times as f64;
        drawn.extend(core::iter::repeat_n(*set, times));
    }
    drawn
}

/// One standard deviation along the direction that is fixed worst, in the coordinates of the `free` unknowns.
pub(super) fn floor(information: &Symmetric, free: &[Unknown]) -> Option<Vec<f64>> {
    Some(weakest(&Shown::of(information.clone(), free), &[])?.0)
}

/// The information of the unknowns that some run shows; the others are held.
struct Shown {
    scaled: Symmetric,
    scale: Vec<f64>,
}

impl Shown {
    fn of(mut information: Symmetric, free: &[Unknown]) -> Self {
        for (index, unknown) in free.iter().enumerate() {
            let least = unknown.ignorance().powi(-2);
            if information.at(index, index) < least {
                *information.at_mut(index, index) = 1e12 * least;
            }
        }
        let scale: Vec<f64> =
            (0..free.len()).map(|index| information.at(index, index).sqrt().recip()).collect();
        let mut scaled = Symmetric::zero(free.len());
        for row in 0..free.len() {
            for column in 0..free.len() {
                *scaled.at_mut(row, column) = information.at(row, column) * scale[row] * scale[column];
            }
            *scaled.at_mut(row, row) *= 1.0 + 1e-12;
        }
        Self { scaled, scale }
    }
}

/// One standard deviation along the worst direction of those at right angles to the `known` ones, in the coordinates of
/// the unknowns, and its unit vector among the scaled ones.
fn weakest(Shown { scaled, scale }: &Shown, known: &[Vec<f64>]) -> Option<(Vec<f64>, Vec<f64>)> {
    // Powers of the inverse turn any vector into its greatest direction.
    let mut direction: Vec<f64> = (0..scale.len()).map(|index| 1.0 + 0.1 * index as f64).collect();
    let mut length = 1.0;
    for _ in 0..POWERS {
        direction = scaled.solve(&direction)?;
        for known in known {
            let share = dot(known, &direction);
            direction.iter_mut().zip(known).for_each(|(part, known)| *part -= share * known);
        }
        length = dot(&direction, &direction).sqrt();
        direction.iter_mut().for_each(|part| *part /= length);
    }
    let step = direction.iter().zip(scale).map(|(part, scale)| part * scale * length.sqrt()).collect();
    Some((step, direction))
}

/// Gives `columns` the change over a standard deviation along the weakest directions, where it is less than the
/// derivatives promise.
fn widen(
    runs: &Runs,
    weights: &Weights,
    centre: &Unknowns,
    free: &[Unknown],
    columns: &mut [Residuals],
    still: &Residuals,
) {
    let mut known: Vec<Vec<f64>> = Vec::new();
    for _ in 0..WIDE_DIRECTIONS.min(free.len()) {
        for round in 1..=WIDE_ROUNDS {
            let shown = Shown::of(weights.columns(columns).normal(), free);
            let Some((step, direction)) = weakest(&shown, &known) else { return };
            let wide = wide_change(runs, centre, free, &step, still);
            let is_less =
                |change: &Residuals| weights.misfits(change).iter().sum::<f64>() < PROMISED * PROMISED;
            let Some(mut change) = wide.filter(is_less) else {
                known.push(direction);
                break;
            };
            for (column, by) in columns.iter().zip(&step) {
                add(&mut change, column, -by);
            }
            // The change along the step becomes what was seen; at right angles to it all stays.
            let scaled: Vec<f64> = step.iter().zip(&shown.scale).map(|(by, scale)| by / scale).collect();
            let squares = dot(&scaled, &scaled);
            for (column, (by, scale)) in columns.iter_mut().zip(scaled.iter().zip(&shown.scale)) {
                add(column, &change, by / scale / squares);
            }
            if round == WIDE_ROUNDS {
                known.push(direction);
            }
        }
    }
}

/// What residuals change by over `step`: half of what they do over a step to either side, where bounds allow both.
fn wide_change(
    runs: &Runs,
    centre: &Unknowns,
    free: &[Unknown],
    step: &[f64],
    still: &Residuals,
) -> Option<Residuals> {
    let lag_limit_s = runs.lag_limit_s();
    let side = |sign: f64| {
        let steps = free.iter().zip(step);
        let moved = steps.fold(*centre, |moved, (&unknown, step)| moved.shifted(unknown, sign * step));
        (moved == moved.bounded(free, lag_limit_s)).then_some(moved)
    };
    let sides = [side(1.0), side(-1.0)];
    let sets: Vec<Unknowns> = sides.iter().flatten().copied().collect();
    let mut found = runs.residuals(&sets, Precision::LAST.substeps).into_iter();
    let mut of = |side: Option<Unknowns>| match side {
        Some(_) => found.next()?,
        None => Some(still.clone()),
    };
    let (mut change, less) = (of(sides[0])?, of(sides[1])?);
    add(&mut change, &less, -1.0);
    let per_step = 1.0 / sets.len() as f64;
    change.iter_mut().flatten().for_each(|value| *value *= per_step);
    (!sets.is_empty()).then_some(change)
}

/// `sum` + `by`·`other`.
fn add(sum: &mut Residuals, other: &Residuals, by: f64) {
    for (sum, other) in sum.iter_mut().zip(other) {
        sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += by * other);
    }
}

/// A factor of the inverse: L⁻ᵀ scaled, so that L⁻ᵀ·(normal numbers) have the covariance.
fn inverse_factor(information: &Symmetric) -> Option<Lower> {
    let n = information.order();
    // Scaled to a diagonal of 1 for the inversion.
    let scale: Vec<f64> = (0..n).map(|index| information.at(index, index).sqrt().recip()).collect();
    let mut scaled = Symmetric::zero(n);
    for row in 0..n {
        for column in 0..n {
            *scaled.at_mut(row, column) = information.at(row, column) * scale[row] * scale[column];
        }
        *scaled.at_mut(row, row) *= 1.0 + 1e-12;
    }
    let mut factor = scaled.inverse()?.factor()?;
    factor.scale_rows(&scale);
    Some(factor)
}

impl Confidence {
    /// Some of the samples, by the shares of their places.
    pub(super) fn alternatives(&self) -> Alternatives {
        let every = (self.samples.len() / ALTERNATIVES).max(1);
        let drives = self.samples.iter().step_by(every).map(Unknowns::drive).collect();
        Alternatives { drives, widening: self.widening }
    }

    /// A value with its interval; `of` makes it from the unknowns.
    pub(super) fn estimate(&self, of: impl Fn(&Unknowns) -> f64) -> Estimate {
        let value = of(&self.best);
        let mut off: Vec<f64> = self.samples.iter().map(|sample| (of(sample) - value).abs()).collect();
        off.sort_by(f64::total_cmp);
        Estimate { value, half_width_95: self.widening * off[off.len() * 95 / 100] }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{harmonic, recorded, sticking};
    use super::super::parameters::without_bed;
    use super::*;

    #[test]
    fn repeated_residuals_count_once() {
        // An aperiodic sequence of signs, each standing for ten ticks: between 1 + 2·(9 + … + 1)/10 = 10 and
        // noise.
        let mut state = 12345_u32;
        let mut signs = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if state >> 31 == 0 { 1.0 } else { -1.0 }
        };
        let alone: Vec<f64> = (0..20_000).map(|_| signs()).collect();
        let standing: Vec<f64> = alone.iter().take(2000).flat_map(|&sign| [sign; 10]).collect();
        assert!((1.0..1.3).contains(&correlation_factor(&alone)));
        assert!((8.0..13.0).contains(&correlation_factor(&standing)));
        assert_eq!(correlation_factor(&[0.0; 10]), 1.0);
    }

    /// Readings of a steady motion, rounded to counts, and errors of no order.
    #[test]
    fn rounding_errors_make_each_other_good() {
        let rounded = |counts_per_tick: f64| -> Vec<f64> {
            let positions = (0..4000).map(|tick| counts_per_tick * f64::from(tick));
            positions.map(|position| position.round() - position).collect()
        };
        for counts_per_tick in [0.382, 3.236, 7.41] {
            let scatter = scatter_of_sums(&[rounded(counts_per_tick)]);
            assert!((0.0..0.4).contains(&scatter), "{counts_per_tick}: {scatter}");
        }
        let mut chance = Chance(3);
        let noise: Vec<f64> = (0..20_000).map(|_| chance.normal()).collect();
        let scatter = scatter_of_sums(&[noise]);
        assert!((0.9..1.1).contains(&scatter), "{scatter}");
        assert_eq!(scatter_of_sums(&[Vec::new(), vec![0.0; 5]]), 1.0);
    }

    /// A quiet axis that does not move by whole counts from tick to tick: intervals are those of readings whose errors
    /// make each other good, but not where the model does not follow.
    #[test]
    fn intervals_of_a_quiet_axis_are_narrower() {
        let (runs, found) = quiet();
        let free = [Unknown::Gain, Unknown::Offset, Unknown::Lag];
        let half_width = |left: f64| {
            let confidence = confidence(&mut runs.clone(), &found, &free, None, left).expect("a confidence");
            confidence.estimate(|unknowns| unknowns.get(Unknown::Gain)).half_width_95
        };
        let part = half_width(0.0) / half_width(f64::MIN_POSITIVE);
        assert!((SCATTER_MIN.sqrt() - 1e-9..0.8).contains(&part), "{part}");
    }

    /// A quiet axis, and what it is.
    fn quiet() -> (Runs, Found) {
        let (runs, unknowns) = (harmonic(), sticking());
        let residuals = runs.residuals(&[unknowns], SUBSTEPS).remove(0).expect("numbers");
        let misfits = runs.weights(Precision::LAST).misfits(&residuals);
        (runs, Found { unknowns, residuals, misfits, rivals: Vec::new() })
    }

    #[test]
    fn intervals_span_a_bed_that_is_not_proven() {
        let (runs, found) = quiet();
        let gain = found.unknowns.get(Unknown::VelocityGain);
        let half_width = |log_likelihood: Option<f64>| {
            let unknowns = found.unknowns.shifted(Unknown::VelocityGain, 0.05);
            let bed = log_likelihood.map(|log_likelihood| UnprovenBed { unknowns, log_likelihood });
            let confidence = confidence(&mut runs.clone(), &found, without_bed(), bed.as_ref(), 0.0);
            confidence
                .expect("a confidence")
                .estimate(|unknowns| unknowns.get(Unknown::VelocityGain))
                .half_width_95
        };
        let alone = half_width(None);
        assert!(alone < 0.04 * gain, "{alone}");
        assert!(half_width(Some(0.0)) > 0.05 * gain);
        assert!((half_width(Some(-9.0)) / alone - 1.0).abs() < 0.01);
    }

    /// As likely in all as what was found, a fifth as likely, and e⁵⁰⁰⁰ times as likely.
    #[test]
    fn sets_are_drawn_by_their_likelihood() {
        let set = |gain: f64| sticking().shifted(Unknown::VelocityGain, gain);
        let counts = |parts: [f64; 3], log: f64| {
            let sets = [set(0.0), set(0.1), set(0.2)];
            let drawn = drawn(&[0, 1, 2].map(|index| (sets[index], log + libm::log(parts[index]))));
            sets.map(|set| drawn.iter().filter(|drawn| **drawn == set).count())
        };
        let is_near = |counts: [usize; 3], parts: [f64; 3]| {
            counts
                .into_iter()
                .zip(parts)
                .all(|(count, part)| (count as f64 - part * SAMPLES as f64).abs() <= 1.0)
        };
        assert!(is_near(counts([0.5, 0.3, 0.2], 0.0), [0.5, 0.3, 0.2]));
        assert!(is_near(counts([0.1, 0.06, 0.04], 0.0), [0.1, 0.06, 0.04]));
        assert!(is_near(counts([0.5, 0.3, 0.2], 5000.0), [0.5, 0.3, 0.2]));
        assert!(is_near(counts([f64::NAN, 0.6, 0.0], 0.0), [0.0, 0.6, 0.0]));
        assert_eq!(counts([0.0; 3], 0.0), [0; 3]);
    }

    /// What an axis on a bed of a small mass ratio shows in slow motion is an axis without one. Its current lag is known less well
    /// then.
    #[test]
    fn intervals_span_beds_that_are_not_shown() {
        let mut rigid = sticking();
        rigid.set(Unknown::BedMassRatio, 0.0);
        let steps = |tick: usize| if (300..1500).contains(&tick) { 40.0 } else { 0.0 };
        let run = recorded(&rigid, (0..3000).map(steps).collect(), 5e-3);
        let mut runs = Runs::new(&[run], 5e-3);
        runs.regroup(&rigid, SUBSTEPS);
        let residuals = runs.residuals(&[rigid], SUBSTEPS).remove(0).expect("numbers");
        let misfits = runs.weights(Precision::LAST).misfits(&residuals);
        let found = Found { unknowns: rigid, residuals, misfits, rivals: Vec::new() };
        let confidence = |left: f64| {
            confidence(&mut runs.clone(), &found, without_bed(), None, left).expect("a confidence")
        };
        let beds = |confidence: &Confidence| {
            confidence.samples.iter().filter(|sample| sample.get(Unknown::BedMassRatio) > 0.0).count()
        };
        let spanned = confidence(0.0);
        assert!((SAMPLES / 50..=SAMPLES).contains(&beds(&spanned)), "{}", beds(&spanned));
        // A likelihood means nothing where the model does not follow.
        assert_eq!(beds(&confidence(f64::MIN_POSITIVE)), 0);
    }

    /// A place off by `offset`, and its standard deviation there.
    fn place(free: &'static [Unknown], offset: f64, deviation: f64, misfit: f64) -> Place<'static> {
        let mut information = Symmetric::zero(free.len());
        for index in 0..free.len() {
            *information.at_mut(index, index) = deviation.powi(-2);
        }
        let centre = sticking().shifted(Unknown::Offset, offset);
        Place::new(centre, free, misfit, information).expect("a place")
    }

    #[test]
    fn places_count_by_misfit_and_width() {
        const FREE: [Unknown; 1] = [Unknown::Offset];
        let first = || place(&FREE, 0.0, 0.1, 100.0);
        let log = |other: Place| other.log_likelihood(&first());
        assert!((log(place(&FREE, 10.0, 0.1, 104.0 + SEARCH_SCATTER)) + 2.0).abs() < 1e-9);
        assert!((log(place(&FREE, 10.0, 0.4, 104.0 + SEARCH_SCATTER)) - 4.0_f64.ln() + 2.0).abs() < 1e-9);
        assert!(log(place(&FREE, 10.0, 0.1, 100.0 + 0.9 * SEARCH_SCATTER)).abs() < 1e-9);
        assert!((log(place(&FREE, 10.0, 0.1, 96.0)) - 2.0).abs() < 1e-9);
        // Samples of both places, which are far apart.
        let counts = |log_likelihood: f64| {
            let places = [(first(), 0.0), (place(&ALL, 10.0, 0.1, 90.0), log_likelihood)];
            let all = samples(&places, &mut Chance(1), 1.0);
            let middle = sticking().shifted(Unknown::Offset, 5.0).get(Unknown::Offset);
            let of_other = all.iter().filter(|sample| sample.get(Unknown::Offset) > middle).count();
            [all.len() - of_other, of_other]
        };
        assert_eq!(counts(-2.0), [SAMPLES, (SAMPLES as f64 * (-2.0_f64).exp()) as usize]);
        assert_eq!(counts(5.0), [SAMPLES, SAMPLES]);
    }

    #[test]
    fn ends_within_a_deviation_are_one_place() {
        let first = place(&[Unknown::Offset], 0.0, 0.1, 100.0);
        for (offset, is_at) in [(0.09, true), (-0.09, true), (0.11, false)] {
            assert_eq!(first.is_at(&sticking().shifted(Unknown::Offset, offset)), is_at, "{offset}");
        }
    }

    #[test]
    fn samples_have_the_covariance() {
        let mut information = Symmetric::zero(2);
        for (row, column, value) in [(0, 0, 4.0), (1, 1, 100.0), (0, 1, 10.0), (1, 0, 10.0)] {
            *information.at_mut(row, column) = value;
        }
        let factor = inverse_factor(&information).expect("positive");
        let mut chance = Chance(1);
        let (mut first, mut both) = (0.0, 0.0);
        for _ in 0..20_000 {
            let sample = factor.times(&[chance.normal(), chance.normal()]);
            first += sample[0] * sample[0] / 20_000.0;
            both += sample[0] * sample[1] / 20_000.0;
        }
        // The inverse is (100, −10; −10, 4)/300.
        assert!((first * 3.0 - 1.0).abs() < 0.05 && (both * 30.0 + 1.0).abs() < 0.05, "{first} {both}");
    }
}
