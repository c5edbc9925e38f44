//! A screw, from where its load was measured to be: backlash and pitch error.
//!
//! An encoder on the motor sees neither, so it takes an instrument at the load: a laser, a scale, a dial gauge. Consumes
//! [`ScrewReading`]s at rest, from both directions; produces a [`ScrewFound`] whose figures are those of
//! [`AxisCompensation`](motion_kernel::axis::AxisCompensation). Background; milliseconds for some hundred readings.
//!
//! The model is the kernel's own: measured − commanded = e(load) + b·σ, with σ = 1 after motion in negative direction. The
//! curve e through a table's points is linear in them, so points and play follow from least squares. Which table it is, if
//! any, is chosen by the Bayesian criterion n·ln(RSS/n) + k·ln n (Schwarz 1978) among all numbers of points, over the travel and,
//! where a turn's length is given, over a turn. Intervals are of Student's distribution with the chosen table; what the table
//! can't follow raises the scatter, and so widens them in part.

use core::ops::RangeInclusive;

use motion_kernel::axis::{
    BACKLASH_MM_MAX, COMPENSATION_POINTS_MAX, PITCH_ERROR_SLOPE_MAX, PITCH_ERROR_SPACING_MM,
    PITCH_ERROR_UM_MAX, PitchError,
};

use super::cholesky::Symmetric;
use super::estimate::Estimate;

/// Least number of places in each direction.
const PLACES_MIN: usize = 4;
/// Least degrees of freedom.
const FREEDOM_MIN: usize = 8;
/// Points of a table over the travel.
const TRAVEL_POINTS: RangeInclusive<usize> = 2..=COMPENSATION_POINTS_MAX;
/// Points of a table over a turn: two can't have a sine's phase.
const TURN_POINTS: RangeInclusive<usize> = 3..=COMPENSATION_POINTS_MAX;
/// Instruments and commands are rounded: their scatter is not taken for less \[mm\].
const ROUNDING_MM: f64 = 1e-6;
/// By how much the criterion has to be lower with a table than without. From 10 on evidence counts as very strong (Kass and
/// Raftery 1995), for one model; here some sixty are tried.
const STRONG: f64 = 20.0;
/// Two places that are closer, in intervals of the table, are one.
const APART: f64 = 0.1;
/// Rounds in which the load's place is found from its error: each leaves a fiftieth or less.
const PLACE_ROUNDS: usize = 3;
/// The greatest difference of measured and commanded lengths, of the length: more is another unit, sign or axis.
const SCALE_MAX: f64 = 0.02;
/// A negative play of so many halves of its interval is no scatter.
const CERTAIN: f64 = 3.0;
/// A reading so many standard deviations from the model is no scatter, where the deviation is that of the median.
const OUTLYING: f64 = 5.0;
const DEVIATION_PER_MEDIAN: f64 = 1.4826;
const UM: f64 = 1e3;

/// Where the load was measured to be, with the axis at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScrewReading {
    /// Where the axis was told to be, without compensation \[mm\].
    pub commanded_mm: f64,
    /// Where the instrument found the load, from any origin \[mm\].
    pub measured_mm: f64,
    /// The last motion was in negative direction; `None` where that is not known.
    pub is_from_above: Option<bool>,
}

/// Where load and axis are said to be at the same place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScrewReference {
    /// The place \[mm\].
    pub position_mm: f64,
    /// It is approached in negative direction.
    pub is_from_above: bool,
}

/// A screw's errors.
#[derive(Clone, Debug, PartialEq)]
pub struct ScrewFound {
    /// Play \[mm\].
    pub backlash_mm: Estimate,
    /// The error, if a table explains the readings better than none beyond chance.
    pub pitch_error: Option<PitchErrorFound>,
    /// Scatter about the model \[mm\], root mean square.
    pub left_rms_mm: f64,
    /// The greatest distance of a reading from the model \[mm\].
    pub left_most_mm: f64,
    /// Each reading with its direction: where the load was, how far that is from where it was told to be, and the model's, all
    /// about the mean \[mm\].
    pub readings: Vec<ExplainedReading>,
}

impl ScrewFound {
    /// The reading that is farthest from the model, if that is no scatter: its row may be wrong.
    #[must_use]
    pub fn outlier(&self) -> Option<&ExplainedReading> {
        let left_mm = |reading: &ExplainedReading| reading.left_mm().abs();
        let mut all_mm: Vec<f64> = self.readings.iter().map(left_mm).collect();
        all_mm.sort_by(f64::total_cmp);
        let deviation_mm = DEVIATION_PER_MEDIAN * all_mm.get(all_mm.len() / 2)? + ROUNDING_MM;
        let farthest = self.readings.iter().max_by(|a, b| left_mm(a).total_cmp(&left_mm(b)));
        farthest.filter(|reading| left_mm(reading) > OUTLYING * deviation_mm)
    }

    /// The greatest distance of a reading from the mean, without compensation \[mm\].
    #[must_use]
    pub fn before_mm(&self) -> f64 {
        let errors = || self.readings.iter().map(|reading| reading.error_mm);
        let mean_mm = errors().sum::<f64>() / self.readings.len().max(1) as f64;
        errors().map(|error_mm| (error_mm - mean_mm).abs()).fold(0.0, f64::max)
    }
}

/// A table that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitchErrorFound {
    /// The table, its mean 0.
    pub table: PitchError,
    /// The greatest half of the 95 % interval of a point, by the scatter of the readings \[mm\]. What a cubic between the points
    /// can't follow comes on top: of random tables 93 % of the points of a turn and 87 % of those over a travel lie within.
    pub half_width_95_mm: f64,
}

/// A reading and what the model says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExplainedReading {
    /// Where the load is \[mm\].
    pub load_mm: f64,
    /// The last motion was in negative direction.
    pub is_from_above: bool,
    /// Measured − commanded \[mm\].
    pub error_mm: f64,
    /// What the model says \[mm\].
    pub model_mm: f64,
}

impl ExplainedReading {
    /// What the model leaves \[mm\].
    #[must_use]
    pub fn left_mm(&self) -> f64 {
        self.error_mm - self.model_mm
    }
}

/// Why a screw can't be told from readings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScrewError {
    /// A value that is no position.
    #[error("reading {reading}: found {found}, expected a finite number of mm")]
    NotFinite {
        /// The reading, from 1.
        reading: usize,
        /// What is there.
        found: f64,
    },
    /// Too little to tell anything from.
    #[error(
        "found {up} places after motion in positive and {down} after motion in negative direction, expected at least {PLACES_MIN} of \
         each, and 10 in all"
    )]
    TooFew {
        /// Those in positive direction.
        up: usize,
        /// Those in negative direction.
        down: usize,
    },
    /// The instrument counts in another unit or direction.
    #[error(
        "found {ratio:.4} mm measured for each commanded, expected 1 ± {SCALE_MAX}: the same axis, unit and sign"
    )]
    Scale {
        /// The slope of measured over commanded positions.
        ratio: f64,
    },
    /// A turn that readings do not cover.
    #[error(
        "found {places} places over {covered_mm:.1} mm, expected more of them, and some in every part of a turn of {pitch_mm} mm"
    )]
    Turn {
        /// From the first to the last one \[mm\].
        covered_mm: f64,
        /// Different places.
        places: usize,
        /// The turn \[mm\].
        pitch_mm: f64,
    },
    /// The load moves before the motor does.
    #[error(
        "found a play of {play_um:.2} ± {half_width_um:.2} µm, expected none or a positive one: is the order of the rows right?"
    )]
    Negative {
        /// The play \[µm\].
        play_um: f64,
        /// Half of its interval \[µm\].
        half_width_um: f64,
    },
    /// More than the kernel compensates.
    #[error("found {quantity} of {found:.3}, expected at most {most}")]
    Beyond {
        /// Which figure.
        quantity: &'static str,
        /// Its value.
        found: f64,
        /// The most that is compensated.
        most: f64,
    },
}

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScrewSearch {
    /// Travel of a turn \[mm\], where the error is to be looked for turn by turn, too.
    pub pitch_mm: Option<f64>,
    /// Where load and axis are said to be at the same place.
    pub reference: ScrewReference,
    /// The error that counts \[mm\]: a table with less everywhere is none.
    pub least_mm: f64,
    /// The greatest curvature that the axis can follow \[1/mm\]. A table with more is taken only if there is no other.
    pub curvature_per_mm: f64,
}

impl Default for ScrewSearch {
    /// Over the travel alone, without bounds.
    fn default() -> Self {
        let reference = ScrewReference::default();
        Self { pitch_mm: None, reference, least_mm: 0.0, curvature_per_mm: f64::INFINITY }
    }
}

/// Finds a screw's errors.
///
/// # Errors
/// Readings that do not determine a screw, or one that can't be compensated.
pub fn identify_screw(readings: &[ScrewReading], search: &ScrewSearch) -> Result<ScrewFound, ScrewError> {
    let reference = search.reference;
    let every = directed(readings)?;
    let means = means(&every);
    let [up, down] = by_direction(&means);
    if up.min(down) < PLACES_MIN || up + down < FREEDOM_MIN + 2 {
        return Err(ScrewError::TooFew { up, down });
    }
    let mut loads_mm: Vec<f64> = means.iter().map(|reading| reading.commanded_mm).collect();
    let mut fit = chosen(&means, &loads_mm, search)?;
    for _ in 0..PLACE_ROUNDS {
        for (reading, load_mm) in means.iter().zip(&mut loads_mm) {
            *load_mm = fit.load_mm(reading, *load_mm, reference);
        }
        fit = chosen(&means, &loads_mm, search)?;
    }
    fit.found(&every, reference)
}

/// A reading whose direction is known.
#[derive(Clone, Copy)]
struct Directed {
    commanded_mm: f64,
    error_mm: f64,
    is_from_above: bool,
}

/// The readings with a direction, checked.
fn directed(readings: &[ScrewReading]) -> Result<Vec<Directed>, ScrewError> {
    for (index, reading) in readings.iter().enumerate() {
        for found in [reading.commanded_mm, reading.measured_mm] {
            if !found.is_finite() {
                return Err(ScrewError::NotFinite { reading: index + 1, found });
            }
        }
    }
    let mean = |value: &dyn Fn(&ScrewReading) -> f64| {
        readings.iter().map(value).sum::<f64>() / readings.len().max(1) as f64
    };
    let means = [mean(&|reading| reading.commanded_mm), mean(&|reading| reading.measured_mm)];
    let about = |reading: &ScrewReading| [reading.commanded_mm - means[0], reading.measured_mm - means[1]];
    let directed: Vec<Directed> = readings
        .iter()
        .filter_map(|reading| {
            let [commanded_mm, measured_mm] = about(reading);
            let is_from_above = reading.is_from_above?;
            Some(Directed {
                commanded_mm: reading.commanded_mm,
                error_mm: measured_mm - commanded_mm,
                is_from_above,
            })
        })
        .collect();
    let (mut products, mut squares) = (0.0, 0.0);
    for [commanded_mm, measured_mm] in readings.iter().map(about) {
        products += commanded_mm * measured_mm;
        squares += commanded_mm * commanded_mm;
    }
    let ratio = products / squares;
    // NaN where all were at one place.
    if !((ratio - 1.0).abs() <= SCALE_MAX) {
        return Err(ScrewError::Scale { ratio });
    }
    Ok(directed)
}

/// How many there are after motion in positive and in negative direction.
fn by_direction(readings: &[Directed]) -> [usize; 2] {
    let down = readings.iter().filter(|reading| reading.is_from_above).count();
    [readings.len() - down, down]
}

/// The mean of all readings of a place and direction: an instrument's steps, and what drifts slowly, are the same in all of
/// them, so they are no independent ones.
fn means(readings: &[Directed]) -> Vec<Directed> {
    let mut sorted = readings.to_vec();
    let of_place = |reading: &Directed| (reading.commanded_mm, reading.is_from_above);
    sorted.sort_by(|a, b| {
        a.commanded_mm.total_cmp(&b.commanded_mm).then(a.is_from_above.cmp(&b.is_from_above))
    });
    let mean = |group: &[Directed]| {
        let error_mm = group.iter().map(|reading| reading.error_mm).sum::<f64>() / group.len() as f64;
        Directed { error_mm, ..group[0] }
    };
    sorted.chunk_by(|a, b| of_place(a) == of_place(b)).map(mean).collect()
}

/// In how many different places there are means.
fn places_of(means: &[Directed]) -> usize {
    means.chunk_by(|a, b| a.commanded_mm == b.commanded_mm).count()
}

/// A table's places.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Places {
    start_mm: f64,
    spacing_mm: f64,
    points: usize,
    repeats: bool,
}

impl Places {
    fn intervals(&self) -> usize {
        if self.repeats { self.points } else { self.points - 1 }
    }

    /// In which interval a place lies, and how far behind its first point, in intervals.
    fn place(&self, load_mm: f64) -> (usize, f64) {
        let ahead = (load_mm - self.start_mm) / self.spacing_mm;
        let most = self.intervals() as f64;
        let ahead = if self.repeats { ahead.rem_euclid(most) } else { ahead.clamp(0.0, most) };
        let index = (ahead as usize).min(self.intervals() - 1);
        (index, ahead - index as f64)
    }

    /// Whether there are readings at two places or more between any two points: else points would be free to be anything.
    fn are_seen(&self, loads_mm: &[f64]) -> bool {
        let mut seen = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.intervals()];
        for &load_mm in loads_mm {
            let (interval, t) = self.place(load_mm);
            let [least, most] = seen[interval];
            seen[interval] = [least.min(t), most.max(t)];
        }
        seen.into_iter().all(|[least, most]| most - least >= APART)
    }

    /// The share of each point in the curve at `load_mm`: at most four, by their index.
    fn shares(&self, load_mm: f64) -> [(usize, f64); 4] {
        let &Self { points, repeats, .. } = self;
        let (intervals, (index, t)) = (self.intervals(), self.place(load_mm));
        let next = (index + 1) % points;
        let (before, after) = if repeats {
            ((index + points - 1) % points, (index + 2) % points)
        } else {
            (index.saturating_sub(1), (index + 2).min(points - 1))
        };
        // Hermite's cubic: values and slopes at both ends.
        let (t2, t3) = (t * t, t * t * t);
        let of_slope = [t3 - 2.0 * t2 + t, t3 - t2];
        let of_next = 3.0 * t2 - 2.0 * t3;
        // Central differences are the slopes; at the ends of a stretch they are 0.
        let left = if !repeats && index == 0 { 0.0 } else { 0.5 * of_slope[0] };
        let right = if !repeats && index + 1 == intervals { 0.0 } else { 0.5 * of_slope[1] };
        [(before, -left), (index, 1.0 - of_next - right), (next, of_next + left), (after, right)]
    }
}

/// A model fitted to readings.
#[derive(Clone, Debug)]
struct Fit {
    /// `None`: the error is the same everywhere.
    places: Option<Places>,
    /// Points of the table, or the error that is the same everywhere, then the play \[mm\].
    unknowns: Vec<f64>,
    /// The normal equations.
    normal: Symmetric,
    sum_of_squares_mm2: f64,
    readings: usize,
    /// In how many places.
    places_read: usize,
}

impl Fit {
    fn of(readings: &[Directed], loads_mm: &[f64], places: Option<Places>) -> Option<Self> {
        let order = places.map_or(1, |places| places.points) + 1;
        if readings.len() < order + FREEDOM_MIN || places.is_some_and(|places| !places.are_seen(loads_mm)) {
            return None;
        }
        let rows: Vec<Vec<(usize, f64)>> = readings
            .iter()
            .zip(loads_mm)
            .map(|(reading, &load_mm)| row(places, load_mm, reading.is_from_above))
            .collect();
        let (mut normal, mut right) = (Symmetric::zero(order), vec![0.0; order]);
        for (row, reading) in rows.iter().zip(readings) {
            for &(i, a) in row {
                right[i] += a * reading.error_mm;
                for &(j, b) in row {
                    *normal.at_mut(i, j) += a * b;
                }
            }
        }
        let unknowns = normal.solve(&right)?;
        let (readings_read, places_read) = (readings.len(), places_of(readings));
        let mut fit =
            Self { places, unknowns, normal, sum_of_squares_mm2: 0.0, readings: readings_read, places_read };
        fit.sum_of_squares_mm2 = readings
            .iter()
            .zip(loads_mm)
            .map(|(reading, &load_mm)| (reading.error_mm - fit.at(load_mm, reading.is_from_above)).powi(2))
            .sum();
        Some(fit)
    }

    /// What the model says \[mm\].
    fn at(&self, load_mm: f64, is_from_above: bool) -> f64 {
        row(self.places, load_mm, is_from_above)
            .iter()
            .map(|&(index, share)| share * self.unknowns[index])
            .sum()
    }

    /// Where the load of a reading is, from where it was thought to be. Where axis and load were said to be at the same place,
    /// measured − commanded is 0.
    fn load_mm(&self, reading: &Directed, thought_mm: f64, reference: ScrewReference) -> f64 {
        let at_reference_mm = self.at(reference.position_mm, reference.is_from_above);
        reading.commanded_mm + self.at(thought_mm, reading.is_from_above) - at_reference_mm
    }

    /// The criterion; the least is the best. Both directions of a place may be off by the same.
    fn criterion(&self) -> f64 {
        let mean_mm2 = self.sum_of_squares_mm2 / self.readings as f64 + ROUNDING_MM * ROUNDING_MM;
        // And the scatter.
        let unknowns = self.unknowns.len() as f64 + 1.0;
        let places = self.places_read as f64;
        places * libm::log(mean_mm2) + unknowns * libm::log(places)
    }

    /// Half of the 95 % interval of a sum of unknowns, by the inverse of the normal equations.
    fn half_width_95(&self, inverse: &Symmetric, weights: &[f64]) -> f64 {
        let freedom = (self.readings - self.unknowns.len()) as f64;
        let scatter_mm2 = self.sum_of_squares_mm2 / freedom + ROUNDING_MM * ROUNDING_MM;
        let order = inverse.order();
        let variance: f64 = (0..order)
            .flat_map(|i| (0..order).map(move |j| (i, j)))
            .map(|(i, j)| weights[i] * weights[j] * inverse.at(i, j))
            .sum();
        students_quantile(freedom) * (scatter_mm2 * variance).sqrt()
    }

    /// The points' distances from their mean \[mm\]: the origin of the instrument is anywhere.
    fn points_mm(&self) -> impl Iterator<Item = f64> {
        let points = &self.unknowns[..self.unknowns.len() - 1];
        let mean_mm = points.iter().sum::<f64>() / points.len() as f64;
        points.iter().map(move |mm| mm - mean_mm)
    }

    fn most_mm(&self) -> f64 {
        self.points_mm().map(f64::abs).fold(0.0, f64::max)
    }

    /// The table, if there is one.
    fn table(&self) -> Result<Option<PitchError>, ScrewError> {
        let Some(Places { start_mm, spacing_mm, repeats, .. }) = self.places else { return Ok(None) };
        let points_um: Vec<f64> = self.points_mm().map(|mm| mm * UM).collect();
        let table = PitchError::new(start_mm, spacing_mm, &points_um, repeats);
        let found = self.most_mm() * UM;
        table.map(Some).ok_or(ScrewError::Beyond {
            quantity: "a pitch error [µm]",
            found,
            most: PITCH_ERROR_UM_MAX,
        })
    }

    fn found(&self, readings: &[Directed], reference: ScrewReference) -> Result<ScrewFound, ScrewError> {
        let order = self.unknowns.len();
        let inverse = self.normal.inverse().expect("solved for the unknowns, so positive");
        let weights = |of: &dyn Fn(usize) -> f64| (0..order).map(of).collect::<Vec<f64>>();
        let play = order - 1;
        let backlash_mm = Estimate {
            value: self.unknowns[play],
            half_width_95: self
                .half_width_95(&inverse, &weights(&|index| f64::from(u8::from(index == play)))),
        };
        if backlash_mm.value < -CERTAIN * backlash_mm.half_width_95 {
            let Estimate { value, half_width_95 } = backlash_mm;
            return Err(ScrewError::Negative { play_um: value * UM, half_width_um: half_width_95 * UM });
        }
        if backlash_mm.value > BACKLASH_MM_MAX {
            let (found, most) = (backlash_mm.value, BACKLASH_MM_MAX);
            return Err(ScrewError::Beyond { quantity: "a play [mm]", found, most });
        }
        let pitch_error = self.table()?.map(|table| {
            let count = table.point_count();
            let of_point = |point: usize| {
                self.half_width_95(
                    &inverse,
                    &weights(&|index| match index {
                        index if index == play => 0.0,
                        index => f64::from(u8::from(index == point)) - 1.0 / count as f64,
                    }),
                )
            };
            // What is common to both directions of a place is as good as one reading.
            let common = (self.readings as f64 / self.places_read as f64).sqrt();
            let half_width_95_mm = common * (0..count).map(of_point).fold(0.0, f64::max);
            PitchErrorFound { table, half_width_95_mm }
        });
        let explained: Vec<ExplainedReading> = readings
            .iter()
            .map(|reading| {
                let mut load_mm = reading.commanded_mm;
                (0..PLACE_ROUNDS).for_each(|_| load_mm = self.load_mm(reading, load_mm, reference));
                let &Directed { is_from_above, error_mm, .. } = reading;
                ExplainedReading {
                    load_mm,
                    is_from_above,
                    error_mm,
                    model_mm: self.at(load_mm, is_from_above),
                }
            })
            .collect();
        let left_mm = || explained.iter().map(ExplainedReading::left_mm);
        let left_most_mm = left_mm().map(f64::abs).fold(0.0, f64::max);
        let left_rms_mm = (left_mm().map(|mm| mm * mm).sum::<f64>() / readings.len() as f64).sqrt();
        Ok(ScrewFound { backlash_mm, pitch_error, left_rms_mm, left_most_mm, readings: explained })
    }
}

/// The share of every unknown in a reading.
fn row(places: Option<Places>, load_mm: f64, is_from_above: bool) -> Vec<(usize, f64)> {
    let (mut row, play) = match places {
        Some(places) => (places.shares(load_mm).to_vec(), places.points),
        None => (vec![(0, 1.0)], 1),
    };
    if is_from_above {
        row.push((play, 1.0));
    }
    row
}

/// The best of all models.
fn chosen(readings: &[Directed], loads_mm: &[f64], search: &ScrewSearch) -> Result<Fit, ScrewError> {
    let low_mm = loads_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let high_mm = loads_mm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let plain = Fit::of(readings, loads_mm, None).ok_or_else(|| {
        let [up, down] = by_direction(readings);
        ScrewError::TooFew { up, down }
    })?;
    let over_travel = TRAVEL_POINTS.map(|points| Places {
        start_mm: low_mm,
        spacing_mm: (high_mm - low_mm) / (points - 1) as f64,
        points,
        repeats: false,
    });
    let over_turn = search.pitch_mm.map(|pitch_mm| {
        TURN_POINTS.map(move |points| Places {
            start_mm: 0.0,
            spacing_mm: pitch_mm / points as f64,
            points,
            repeats: true,
        })
    });
    let [least_mm, most_mm] = PITCH_ERROR_SPACING_MM;
    let fit = |places: Places| {
        let is_spaced = (least_mm..=most_mm).contains(&places.spacing_mm);
        if is_spaced { Fit::of(readings, loads_mm, Some(places)) } else { None }
    };
    let of_turn: Vec<Fit> = over_turn.into_iter().flatten().filter_map(fit).collect();
    if let (Some(pitch_mm), true) = (search.pitch_mm, of_turn.is_empty()) {
        let (covered_mm, places) = (high_mm - low_mm, places_of(readings));
        return Err(ScrewError::Turn { covered_mm, places, pitch_mm });
    }
    let needed = plain.criterion() - STRONG;
    let better = of_turn.into_iter().chain(over_travel.filter_map(fit));
    let mut better: Vec<Fit> = better.filter(|table| table.criterion() < needed).collect();
    better.sort_by(|a, b| a.criterion().total_cmp(&b.criterion()));
    let can_be_had = |fit: &Fit| {
        fit.table().is_ok_and(|table| {
            table.is_none_or(|table| {
                table.slope() <= PITCH_ERROR_SLOPE_MAX && table.curvature() <= search.curvature_per_mm
            })
        })
    };
    let at = better.iter().position(can_be_had).unwrap_or(0);
    let table = better.into_iter().nth(at);
    Ok(table.filter(|table| table.most_mm() >= search.least_mm).unwrap_or(plain))
}

/// The 97.5 % quantile of Student's distribution (Abramowitz and Stegun, 26.7.5), for 8 degrees of freedom or more to 0.001.
fn students_quantile(freedom: f64) -> f64 {
    const NORMAL: f64 = 1.959_964;
    let x = NORMAL;
    let g1 = (x.powi(3) + x) / 4.0;
    let g2 = (5.0 * x.powi(5) + 16.0 * x.powi(3) + 3.0 * x) / 96.0;
    let g3 = (3.0 * x.powi(7) + 19.0 * x.powi(5) + 17.0 * x.powi(3) - 15.0 * x) / 384.0;
    x + g1 / freedom + g2 / freedom.powi(2) + g3 / freedom.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up and down over 0 … 90 mm, at uneven places, with `error_mm` of place and direction.
    fn readings(error_mm: impl Fn(f64, bool) -> f64) -> Vec<ScrewReading> {
        let places = || (0..20).map(|place| 4.5 * f64::from(place) + 0.37 * f64::from(place % 3));
        let at = |commanded_mm: f64, is_from_above: bool| ScrewReading {
            commanded_mm,
            measured_mm: 12.0 + commanded_mm + error_mm(commanded_mm, is_from_above),
            is_from_above: Some(is_from_above),
        };
        let up = places().map(|mm| at(mm, false));
        up.chain(places().rev().map(|mm| at(mm, true))).collect()
    }

    fn identified(readings: &[ScrewReading]) -> Result<ScrewFound, String> {
        identify_screw(readings, &ScrewSearch::default()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_play_and_a_lead_are_told_apart() {
        let found =
            identified(&readings(|mm, down| 2e-4 * mm + if down { 0.015 } else { 0.0 })).expect("a screw");
        assert!((found.backlash_mm.value - 0.015).abs() < 1e-5, "{found:?}");
        let table = found.pitch_error.expect("a lead").table;
        let last = table.point_count() - 1;
        let ends_um = [table.point_um(0), table.point_um(last)].map(|um| um.expect("a point"));
        let slope = (ends_um[1] - ends_um[0]) / (table.spacing_mm * last as f64);
        // A table ends level, which its other points make good.
        assert!((slope - 0.2).abs() < 3e-3, "{table:?}");
        assert!(found.left_most_mm < 2e-4 && found.before_mm() > 0.01, "{found:?}");
    }

    #[test]
    fn readings_that_are_none_of_a_screw_are_refused() {
        let good = || readings(|_, down| if down { 0.015 } else { 0.0 });
        assert!(identified(&good()).is_ok());
        let refusal = |readings: &[ScrewReading]| identified(readings).expect_err("refused");
        let without = |from_above: bool| {
            let mut readings = good();
            readings.retain(|reading| reading.is_from_above != Some(from_above));
            refusal(&readings)
        };
        assert!(
            without(true).contains("found 20 places after motion in positive and 0 after motion in negative")
        );
        assert!(without(false).contains("found 0 places after motion in positive and 20"));
        let mut odd = good();
        odd[7].measured_mm = f64::NAN;
        assert!(refusal(&odd).starts_with("reading 8: found NaN"));
        let scaled = |by: f64| {
            let mut readings = good();
            readings.iter_mut().for_each(|reading| reading.measured_mm *= by);
            refusal(&readings)
        };
        assert!(scaled(-1.0).contains("-1.0000 mm measured for each commanded"));
        assert!(scaled(1e-3).contains("the same axis, unit and sign"));
        let mut still = good();
        still.iter_mut().for_each(|reading| reading.commanded_mm = 3.0);
        assert!(refusal(&still).contains("the same axis, unit and sign"));
        assert!(
            refusal(&readings(|_, down| if down { -0.015 } else { 0.0 })).contains("found a play of -15.00")
        );
        assert!(
            refusal(&readings(|_, down| if down { 1.25 } else { 0.0 })).contains("found a play [mm] of 1.25")
        );
        let bent = readings(|mm, _| 0.9 * (mm / 14.0).sin());
        assert!(refusal(&bent).contains("found a pitch error [µm] of"), "{}", refusal(&bent));
        let turn = identify_screw(&good(), &ScrewSearch { pitch_mm: Some(500.0), ..ScrewSearch::default() });
        assert!(turn.expect_err("no turn").to_string().contains("in every part of a turn of 500 mm"));
    }

    /// Of Student's tables, five digits.
    #[test]
    fn students_quantiles() {
        for (freedom, expected) in
            [(8.0, 2.3060), (10.0, 2.2281), (20.0, 2.0860), (60.0, 2.0003), (1e6, 1.95996)]
        {
            assert!((students_quantile(freedom) - expected).abs() < 1e-3, "{freedom}");
        }
    }
}
