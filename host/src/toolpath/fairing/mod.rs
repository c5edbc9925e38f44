//! A run of short lines and arcs to one smooth curve within its tolerance.
//!
//! Points that were cut from a curve, or that something else made dense, have a corner at every joint and no
//! room for blends that are worth it. Consumes lines and arcs, each with its tolerance and feed; produces the
//! spans of a quintic spline, continuous to the third derivative, that goes on as the path does at both ends.
//! Background; linear in the number of parts times the logarithm of how many a line stands for.
//!
//! - `guide`: the path by its length;
//! - `knots`: where the spline gets its knots;
//! - `problem`: the curve that bends least within the tolerance, by
//!   `cholesky`: equations in a band;
//! - `deviation`: how far the curve is from the path;
//! - [`feeds`]: the feeds that a curve allows.
//!
//! **Feed.** What bends least depends on the feed: at a low one acceleration counts, at a high one snap. So
//! the curve is made for the feeds that the one before allows, until two rounds in a row gain no time.
//!
//! **Windows.** A long curve is made window by window. Each begins with point and derivatives that the one
//! before ends with, and looks ahead beyond its own end, where it is free: what is ahead is made again by the
//! next window. So a place that is hard costs steps where it is, and memory does not grow with the path but by
//! the spans themselves. Where a window has no curve, it is made again with the one before, twice as long.
//!
//! **Bounds.** For each window nine meshes, 400 steps each, a step linear in spans and samples; most take one
//! mesh and some twenty steps. Where none is found, there is none: the caller keeps what it has.

mod cholesky;
mod deviation;
pub mod feeds;
mod guide;
mod knots;
mod problem;

use motion_kernel::law::Limits;
use motion_kernel::num::Root;

use self::deviation::Walk;
use self::guide::Guide;
use self::knots::Mesh;
use self::problem::{DECIDED, Problem};
use super::curve::Curve as _;
use super::element::{Element, Role};
use super::subspace::Subspace;
use super::{Greatest, Vector, scale};

/// Spans of a window, and those that it looks ahead. What is not much longer is one window.
const WINDOW: usize = 256;
const AHEAD: usize = 48;
/// Spans behind the end of a window that have to be within the tolerance, too, so that the next one can go on.
const GOES_ON: usize = 8;
/// How often more knots are put where they are too few.
const REFINEMENTS: usize = 8;
/// How often the curve is made for other feeds at most; it ends where that has gained hardly any time twice.
const ROUNDS: usize = 24;
const GAIN_MIN: f64 = 0.003;
/// Steps until the curve is given up, and steps for the feeds of one round.
const STEPS_MAX: usize = 400;
const STEPS_PER_ROUND: usize = 12;
/// The duality gap at which a round ends, and the last one, as a part of the cost. Feeds change with its
/// sixth root.
const GAP_MAX: f64 = 0.5;
const GAP_MAX_AT_LAST: f64 = 0.2;
/// The duality gap that a step aims at: a part of the present one, small where the step before was taken
/// whole, large where it was not; never less than a part of the cost, because the equations lose their digits
/// near the optimum; and all of the cost while the curve is far outside.
const CENTERING: [(f64, f64); 2] = [(0.8, 0.1), (0.4, 0.3)];
const CENTERING_MAX: f64 = 0.6;
const GAP_MIN: f64 = 0.03;
/// How far the curve may be from the path at its samples, and from where on it is far, in units of what is
/// used of the tolerance.
const WITHIN: f64 = 1.01;
const FAR: f64 = 1.1;
/// Within so many steps a curve that is too far has to come nearer, to this part of what it was too far by:
/// or it has too few knots.
const NEARER_STEPS: usize = 10;
const NEARER: f64 = 0.7;
/// How often the tolerance is made smaller where the curve is too far from the path between its samples, by
/// what at most for each span, and what the new one aims below.
const TIGHTENINGS: usize = 12;
const TIGHTENED_MIN: f64 = 0.8;
const BELOW: f64 = 0.95;
/// The third derivative of a curve that is led by the tolerance past the path, over the tolerance and the
/// third power of the path's scale.
const THIRD: f64 = 100.0;

/// A line or an arc of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part<const N: usize = 3> {
    /// The line or arc.
    pub element: Element<N>,
    /// How far the curve may be from it \[mm\], above 0.
    pub tolerance_mm: f64,
    /// The greatest feed \[mm/s\].
    pub feed_mm_s: f64,
}

/// A span of the curve.
#[derive(Clone, Copy, Debug)]
pub struct Span<const N: usize = 3> {
    /// The span.
    pub element: Element<N>,
    /// The first and the last of the parts that it stands for.
    pub parts: (usize, usize),
    /// A bound on the distance between it and the path \[mm\].
    pub distance_mm: f64,
    /// How it bends at its tightest.
    pub greatest: Greatest<N>,
}

/// The curve that stands for `parts`, made for `limits`; nothing if none was found, or if a part is neither a
/// line nor an arc. It is made in the coordinates that move: the work of a step grows with the third power of their
/// number.
#[must_use]
pub fn fair<const N: usize>(parts: &[Part<N>], limits: &Limits<f64>) -> Option<Vec<Span<N>>> {
    let mut moves = [false; N];
    for part in parts {
        moves.iter_mut().zip(part.element.moves()).for_each(|(moves, of_part)| *moves |= of_part);
    }
    if let Some(plane) = Subspace::<2>::of(moves) {
        return in_subspace(plane, parts, limits);
    }
    match Subspace::<3>::of(moves) {
        Some(space) => in_subspace(space, parts, limits),
        None => in_space(parts, limits),
    }
}

/// The curve in some coordinates; the others stand.
fn in_subspace<const M: usize, const N: usize>(
    space: Subspace<M>,
    parts: &[Part<N>],
    limits: &Limits<f64>,
) -> Option<Vec<Span<N>>> {
    let rest = parts.first()?.element.ends_mm().0;
    let narrow = |part: &Part<N>| Part {
        element: space.narrow_element(&part.element),
        tolerance_mm: part.tolerance_mm,
        feed_mm_s: part.feed_mm_s,
    };
    let spans = in_space(&parts.iter().map(narrow).collect::<Vec<_>>(), limits)?;
    let widened = spans.into_iter().map(|span| Span {
        element: space.widen_element(&span.element, rest),
        parts: span.parts,
        distance_mm: span.distance_mm,
        greatest: space.widen_greatest(&span.greatest),
    });
    Some(widened.collect())
}

/// The curve in all coordinates.
fn in_space<const N: usize>(parts: &[Part<N>], limits: &Limits<f64>) -> Option<Vec<Span<N>>> {
    let guide = Guide::new(parts)?;
    let mesh = Mesh::new(&guide);
    let mut spans = Vec::new();
    let mut start = Start { point: guide.end(false), walk: Walk::START, past: None };
    let (mut first, mut size) = (0, WINDOW);
    // Where the last window began.
    let mut before: Option<(usize, usize, Start<N>)> = None;
    while first < mesh.len() {
        let is_last = mesh.len() - first <= size + 2 * AHEAD;
        let next = if is_last { mesh.len() } else { first + size };
        let until = if is_last { next } else { next + AHEAD };
        let window = Window { guide: &guide, start, end_mm: mesh.breaks_mm[next], is_last, limits };
        if let Some(made) = window.spans(mesh.part(first..until)) {
            before = Some((first, spans.len(), start));
            spans.extend(made.spans);
            (first, size, start) = (next, WINDOW, made.next);
            continue;
        }
        // It may have begun in the wrong direction, or looked ahead too short.
        size *= 2;
        match before.take() {
            Some((first_before, count, start_before)) => {
                (first, start) = (first_before, start_before);
                spans.truncate(count);
            }
            None if is_last => return None,
            None => {}
        }
    }
    Some(spans)
}

/// What a window begins with.
#[derive(Clone, Copy)]
struct Start<const N: usize> {
    /// Point and first to third derivative by the length of the path.
    point: [Vector<N>; DECIDED],
    /// How far the curve and the path have been walked.
    walk: Walk<N>,
    /// Length and feed of the span before \[mm, mm/s\].
    past: Option<(f64, f64)>,
}

/// A part of a curve that is made at once.
struct Window<'a, const N: usize> {
    guide: &'a Guide<'a, N>,
    start: Start<N>,
    /// Where it ends \[mm\]. The mesh goes farther, unless the path ends there.
    end_mm: f64,
    is_last: bool,
    limits: &'a Limits<f64>,
}

/// The spans of a window, and what the next one begins with.
struct Made<const N: usize> {
    spans: Vec<Span<N>>,
    next: Start<N>,
}

/// Spans, and what their tolerance has to be made smaller by.
type TooFar = Vec<(usize, f64)>;

/// Why there is no curve with the knots that were tried.
enum Failure {
    /// These spans need more of them.
    TooFew(Vec<usize>),
    /// The equations have no solution, or the steps have come to no end.
    Unsolved,
}

impl<const N: usize> Window<'_, N> {
    /// The spans, with more knots than the mesh has where that is needed; nothing if none were found.
    fn spans(&self, mut mesh: Mesh) -> Option<Made<N>> {
        let mut is_halved = false;
        for _ in 0..=REFINEMENTS {
            mesh = match self.with_knots(&mesh) {
                Ok(made) => return Some(made),
                Err(Failure::TooFew(spans)) => mesh.refined(&spans)?,
                Err(Failure::Unsolved) if is_halved => return None,
                Err(Failure::Unsolved) => {
                    is_halved = true;
                    mesh.refined(&(0..mesh.len()).collect::<Vec<_>>())?
                }
            };
        }
        None
    }

    /// The spans with these knots.
    fn with_knots(&self, mesh: &Mesh) -> Result<Made<N>, Failure> {
        let (guide, limits) = (self.guide, self.limits);
        let programmed = programmed_mm_s(guide, mesh);
        let lengths_mm = mesh.lengths_mm();
        let lowered = |mut feeds: Vec<f64>| {
            feeds.iter_mut().zip(&programmed).for_each(|(feed, &programmed)| *feed = feed.min(programmed));
            self.lower(feeds, &lengths_mm)
        };
        let end = self.is_last.then(|| guide.end(true));
        let mut problem = Problem::new(guide, &mesh.breaks_mm, &self.start.point, end.as_ref());
        problem.start(limits, &lowered(promised_mm_s(guide, mesh, limits)));
        let (mut rounds, mut approach) = (Rounds::default(), Approach::default());
        let (mut steps, mut tightenings, mut centering) = (0, 0, CENTERING[0].1);
        let (mut farthest, mut cost) = (problem.farthest(), problem.cost());
        for _ in 0..STEPS_MAX {
            let least = if farthest > FAR { 1.0 } else { GAP_MIN };
            let gap_aim = (centering * problem.gap()).max(least * cost);
            let taken = problem.step(gap_aim).ok_or(Failure::Unsolved)?;
            cost = problem.cost();
            centering = CENTERING
                .iter()
                .find(|(least, _)| taken > *least)
                .map_or(CENTERING_MAX, |&(_, centering)| centering);
            farthest = problem.farthest();
            if farthest > WITHIN {
                if approach.has_stalled(farthest) {
                    return Err(Failure::TooFew(problem.tight(WITHIN)));
                }
                continue;
            }
            approach = Approach::default();
            steps += 1;
            let gap_max = if rounds.are_over() { GAP_MAX_AT_LAST } else { GAP_MAX };
            if problem.gap() >= gap_max * cost && steps < STEPS_PER_ROUND {
                continue;
            }
            steps = 0;
            if !rounds.are_over() {
                let feeds = lowered(problem.allowed_mm_s(limits));
                rounds.next(lengths_mm.iter().zip(&feeds).map(|(mm, mm_s)| mm / mm_s).sum());
                problem.change(limits, &feeds);
                cost = problem.cost();
                continue;
            }
            match self.made(&problem) {
                Ok((spans, next)) => {
                    let past = lowered(problem.allowed_mm_s(limits));
                    let past = lengths_mm.iter().copied().zip(past).nth(spans.len() - 1);
                    return Ok(Made { spans, next: Start { past, ..next } });
                }
                Err(far) if tightenings == TIGHTENINGS => {
                    return Err(Failure::TooFew(far.into_iter().map(|(span, _)| span).collect()));
                }
                Err(far) => {
                    tightenings += 1;
                    problem.tighten(&far);
                    farthest = problem.farthest();
                }
            }
        }
        Err(Failure::Unsolved)
    }

    /// The feeds of the spans \[mm/s\], lowered to what ramps between them and from the span before reach.
    fn lower(&self, mut feeds_mm_s: Vec<f64>, lengths_mm: &[f64]) -> Vec<f64> {
        let Some((past_mm, past_mm_s)) = self.start.past else {
            feeds::lower(&mut feeds_mm_s, lengths_mm, self.limits);
            return feeds_mm_s;
        };
        feeds_mm_s.insert(0, past_mm_s);
        let lengths_mm: Vec<f64> = core::iter::once(past_mm).chain(lengths_mm.iter().copied()).collect();
        feeds::lower(&mut feeds_mm_s, &lengths_mm, self.limits);
        feeds_mm_s.remove(0);
        feeds_mm_s
    }
}

/// The curve made for the feeds that the one before allows, again and again.
#[derive(Default)]
struct Rounds {
    /// The time of each \[s\].
    times_s: Vec<f64>,
}

impl Rounds {
    fn next(&mut self, time_s: f64) {
        self.times_s.push(time_s);
    }

    fn are_over(&self) -> bool {
        let Some((before, [last, at_last])) = self.times_s.split_last_chunk() else { return false };
        let least_s = before.iter().copied().fold(f64::INFINITY, f64::min);
        self.times_s.len() == ROUNDS || last.min(*at_last) > (1.0 - GAIN_MIN) * least_s
    }
}

/// A curve on its way to the path.
struct Approach {
    steps: usize,
    /// How much farther than allowed it was when it last came nearer, in units of what is used of the
    /// tolerance.
    beyond: f64,
}

impl Default for Approach {
    fn default() -> Self {
        Self { steps: 0, beyond: f64::INFINITY }
    }
}

impl Approach {
    /// Takes note of a step after which it is `farthest` from the path; true if it does not come nearer.
    fn has_stalled(&mut self, farthest: f64) -> bool {
        self.steps += 1;
        if farthest - 1.0 < NEARER * self.beyond {
            *self = Self { steps: 0, beyond: farthest - 1.0 };
        }
        self.steps > NEARER_STEPS
    }
}

/// The programmed feed of each span \[mm/s\].
fn programmed_mm_s<const N: usize>(guide: &Guide<N>, mesh: &Mesh) -> Vec<f64> {
    let of_span = |ends: &[f64]| {
        let parts = &guide.parts[guide.part_at(ends[0])..=guide.part_at(ends[1])];
        parts.iter().map(|part| part.feed_mm_s).fold(f64::INFINITY, f64::min)
    };
    mesh.breaks_mm.windows(2).map(of_span).collect()
}

/// The feeds that the scale of the path promises, to begin with \[mm/s\].
fn promised_mm_s<const N: usize>(guide: &Guide<N>, mesh: &Mesh, limits: &Limits<f64>) -> Vec<f64> {
    let of_span = |(ends, scale_mm): (&[f64], &f64)| {
        let tolerance_mm = guide.parts[guide.part_at(ends[0])].tolerance_mm;
        scale_mm * Root::cbrt(limits.jerk_mm_s3 / (THIRD * tolerance_mm))
    };
    mesh.breaks_mm.windows(2).zip(&mesh.scales_mm).map(of_span).collect()
}

impl<const N: usize> Window<'_, N> {
    /// The spans as they stand, and what the next window begins with; or those that are farther from the path than their
    /// tolerance, with what it has to be made smaller by. Where none is, those that can't be driven: how a span is driven takes
    /// longer to find out.
    fn made(&self, problem: &Problem<N>) -> Result<(Vec<Span<N>>, Start<N>), TooFar> {
        let (guide, breaks) = (self.guide, problem.breaks());
        let kept = breaks.partition_point(|&mm| mm < self.end_mm);
        let shapes = problem.shapes();
        let mut walk = self.start.walk;
        let deviations = deviation::deviations(guide, &breaks[..=kept], &shapes[..kept], &mut walk);
        let ahead = shapes.len().min(kept + GOES_ON);
        let behind =
            deviation::deviations(guide, &breaks[kept..=ahead], &shapes[kept..ahead], &mut walk.clone());
        // What is not a number is too far.
        let too_far = |(index, deviation): (usize, &deviation::Deviation)| {
            (!(deviation.share <= 1.0)).then(|| (index, (BELOW / deviation.share).max(TIGHTENED_MIN)))
        };
        let far: TooFar = deviations.iter().chain(&behind).enumerate().filter_map(too_far).collect();
        if !far.is_empty() {
            return Err(far);
        }
        let (mut spans, mut not_driven) = (Vec::with_capacity(kept), Vec::new());
        // It starts and ends exactly where the path does.
        let end = guide.parts[guide.parts.len() - 1].element.ends_mm().1;
        for (index, ((from, shape), ends)) in shapes[..kept].iter().zip(breaks.windows(2)).enumerate() {
            let parts = (guide.part_at(ends[0]), guide.part_at(ends[1]));
            let distance_mm = deviations[index].distance_mm;
            let from = if index == 0 { self.start.point[0] } else { *from };
            let to: Vector<N> = shapes.get(index + 1).map_or(end, |next| next.0);
            let element = Element::Polynomial { from, to, shape: *shape, role: Role::Curve };
            match element.greatest_driven() {
                Ok(greatest) => spans.push(Span { element, parts, distance_mm, greatest }),
                Err(_) => not_driven.push((index, BELOW)),
            }
        }
        if !not_driven.is_empty() {
            return Err(not_driven);
        }
        let point = match (shapes.get(kept), shapes[..kept].last()) {
            (Some((point, _)), Some((_, shape))) => {
                let per_mm = 1.0 / (breaks[kept] - breaks[kept - 1]);
                let [first, second, third] = shape.derivatives(1.0);
                [
                    *point,
                    scale(first, per_mm),
                    scale(second, per_mm * per_mm),
                    scale(third, per_mm * per_mm * per_mm),
                ]
            }
            _ => self.start.point,
        };
        Ok((spans, Start { point, walk, past: None }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve as _;
    use super::super::{Polynomial, add, norm, scale, subtract};
    use super::*;

    const LIMITS: Limits<f64> = Limits { accel_mm_s2: 500.0, jerk_mm_s3: 5e3, snap_mm_s4: 4e5 };

    fn lines(points: &[Vector], tolerance_mm: f64) -> Vec<Part> {
        let part = |pair: &[Vector]| Part {
            element: Element::Line { from: pair[0], to: pair[1] },
            tolerance_mm,
            feed_mm_s: 60.0,
        };
        points.windows(2).map(part).collect()
    }

    /// Chords of a curve in space that bends to both sides, off it to and fro, with a corner in the middle.
    fn chords(count: u32, off_mm: f64) -> Vec<Vector> {
        let point = |index: u32| {
            let u = f64::from(index);
            let off = if index.is_multiple_of(2) { off_mm } else { 0.0 };
            let back = if index > count / 2 { 0.1 * (u - f64::from(count / 2)) } else { 0.0 };
            [0.1 * u - back, 0.8 * libm::sin(0.07 * u) + off, 0.3 * libm::cos(0.05 * u) + back]
        };
        (0..=count).map(point).collect()
    }

    fn shape(span: &Span) -> (Vector, Polynomial) {
        let Element::Polynomial { from, shape, .. } = span.element else { panic!("a polynomial") };
        (from, shape)
    }

    fn from_segment(point: Vector, [from, to]: [Vector; 2]) -> f64 {
        let along = subtract(to, from);
        let square = along.iter().map(|c| c * c).sum::<f64>();
        let offset = subtract(point, from);
        let share = along.iter().zip(offset).map(|(a, b)| a * b).sum::<f64>() / square;
        norm(subtract(offset, scale(along, share.clamp(0.0, 1.0))))
    }

    /// Every point of the curve against all segments, every point of the path against all of the curve.
    #[test]
    fn the_curve_is_within_the_tolerance_and_says_so() {
        for (off_mm, tolerance_mm) in [(0.0, 0.01), (0.004, 0.01), (0.01, 0.05), (0.02, 0.2)] {
            let points = chords(120, off_mm);
            let spans = fair(&lines(&points, tolerance_mm), &LIMITS).expect("a curve");
            let said_mm = spans.iter().map(|span| span.distance_mm).fold(0.0, f64::max);
            let mut greatest = 0.0_f64;
            let mut on_curve = Vec::new();
            for span in &spans {
                let (from, shape) = shape(span);
                for index in 0..=40_u32 {
                    let point = add(from, shape.offset(0.0, f64::from(index) / 40.0));
                    let nearest = points.windows(2).map(|pair| from_segment(point, [pair[0], pair[1]]));
                    greatest = greatest.max(nearest.fold(f64::INFINITY, f64::min));
                    on_curve.push(point);
                }
            }
            for pair in points.windows(2) {
                for index in 0..5_u32 {
                    let point = add(pair[0], scale(subtract(pair[1], pair[0]), f64::from(index) / 5.0));
                    let nearest = on_curve.windows(2).map(|pair| from_segment(point, [pair[0], pair[1]]));
                    greatest = greatest.max(nearest.fold(f64::INFINITY, f64::min));
                }
            }
            assert!(
                said_mm <= tolerance_mm && greatest <= said_mm + 1e-5,
                "{greatest} {said_mm} {tolerance_mm}"
            );
            // It is used, or there would have been a better curve.
            assert!(greatest > 0.6 * tolerance_mm, "{greatest} of {tolerance_mm}");
        }
    }

    /// What moves in a plane has the curve that it has in space.
    #[test]
    fn fewer_coordinates_give_the_same_curve() {
        let in_plane = |[x, y, _]: Vector| [[x, y, 7.0], [7.0, x, y], [y, 7.0, x]];
        for plane in 0..3 {
            let points: Vec<Vector> =
                chords(120, 0.004).into_iter().map(|point| in_plane(point)[plane]).collect();
            let parts = lines(&points, 0.02);
            let (spans, of_space) = (fair(&parts, &LIMITS), in_space(&parts, &LIMITS));
            let (spans, of_space) = (spans.expect("a curve"), of_space.expect("a curve"));
            assert_eq!(spans.len(), of_space.len());
            for (span, of_space) in spans.iter().zip(&of_space) {
                let ((from, shape), (from_in_space, shape_in_space)) =
                    (self::shape(span), self::shape(of_space));
                for u in [0.0, 0.3, 0.7, 1.0] {
                    let [a, b] =
                        [add(from, shape.offset(0.0, u)), add(from_in_space, shape_in_space.offset(0.0, u))];
                    assert!(norm(subtract(a, b)) < 1e-9, "{a:?} {b:?}");
                }
                assert!((span.distance_mm - of_space.distance_mm).abs() < 1e-9);
                assert_eq!(span.greatest.curved, of_space.greatest.curved);
            }
        }
    }

    /// Random walks with corners: where the curve is too far between its samples, it is made again.
    #[test]
    fn no_curve_is_farther_than_the_tolerance() {
        let mut state = 11_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1_u32 << 24)
        };
        let mut found = 0;
        for walk in 0..40 {
            let (mut at, mut heading_rad, mut points) = ([0.0; 3], 0.0, vec![[0.0; 3]]);
            for _ in 0..80 {
                let length_mm = 0.05 + 0.3 * random();
                heading_rad += 2.4 * (random() - 0.5);
                let step = [libm::cos(heading_rad), libm::sin(heading_rad), 0.3 * (random() - 0.5)];
                at = add(at, scale(step, length_mm));
                points.push(at);
            }
            let Some(spans) = fair(&lines(&points, 0.03), &LIMITS) else { continue };
            found += 1;
            let said_mm = spans.iter().map(|span| span.distance_mm).fold(0.0, f64::max);
            assert!(said_mm <= 0.03, "walk {walk}: {said_mm}");
        }
        assert!(found > 35, "{found} of 40 walks have a curve");
    }

    /// Short lines to and fro across the tolerance become a curve of few spans. Its equations are close to
    /// singular, and the ends, which start as the lines do, need more knots than the scale gives them.
    #[test]
    fn what_goes_to_and_fro_becomes_straight() {
        let mm = 25.4;
        let point = |index: u32| {
            let across = if index == 0 { 0.0 } else { [0.001, -0.001][usize::from(index % 2 == 1)] };
            [0.002 * mm * f64::from(index), across * mm, 0.0]
        };
        let points: Vec<Vector> = (0..=2000).map(point).collect();
        let spans = fair(&lines(&points, 0.05), &LIMITS).expect("a curve");
        assert!(spans.len() < 100, "{} spans", spans.len());
        assert!(spans.iter().all(|span| span.distance_mm <= 0.05));
        let middle = &spans[spans.len() / 2];
        let (start, end) = middle.element.ends_mm();
        assert!((start[1] - end[1]).abs() < 1e-3 * (end[0] - start[0]), "{start:?} {end:?}");
    }

    /// From span to span position and three derivatives by arc length, also where windows meet; at the ends the
    /// path's own.
    #[test]
    fn nothing_steps_along_the_curve() {
        for (count, spans_min) in [(80, 10), (6000, 3 * WINDOW)] {
            let points = chords(count, 0.005);
            let parts = lines(&points, 0.02);
            let spans = fair(&parts, &LIMITS).expect("a curve");
            assert!(spans.len() >= spans_min, "{} spans", spans.len());
            let guide = Guide::new(&parts).expect("lines");
            let derivatives = |span: &Span, u: f64| {
                let (from, shape) = shape(span);
                let [tangent, second, third] = super::super::curve::by_arc_length(shape.derivatives(u));
                [add(from, shape.offset(0.0, u)), tangent, second, third]
            };
            let mut pairs: Vec<_> = spans
                .windows(2)
                .map(|pair| (derivatives(&pair[0], 1.0), derivatives(&pair[1], 0.0)))
                .collect();
            pairs.push((guide.end(false), derivatives(&spans[0], 0.0)));
            pairs.push((derivatives(&spans[spans.len() - 1], 1.0), guide.end(true)));
            for (before, after) in pairs {
                for (order, (a, b)) in before.into_iter().zip(after).enumerate() {
                    let step = norm(subtract(a, b));
                    assert!(step < 1e-9 * 100.0_f64.powi(order as i32), "derivative {order} steps by {step}");
                }
            }
            let said_mm = spans.iter().map(|span| span.distance_mm).fold(0.0, f64::max);
            assert!(said_mm <= 0.02, "{said_mm}");
        }
    }

    #[test]
    fn rounds_are_over_after_two_without_a_gain() {
        let ends_with = |times_s: &[f64]| {
            let mut rounds = Rounds::default();
            times_s.iter().for_each(|&time_s| rounds.next(time_s));
            rounds.are_over()
        };
        assert!(!ends_with(&[]) && !ends_with(&[1.0, 1.0]) && !ends_with(&[3.0, 3.0, 2.9]));
        assert!(
            !ends_with(&[3.0, 2.9, 2.9]) && ends_with(&[3.0, 2.9, 2.9, 2.9]) && ends_with(&[2.0, 2.1, 2.2])
        );
        let falling: Vec<f64> = (0..ROUNDS).map(|round| 0.9_f64.powi(round as i32)).collect();
        assert!(!ends_with(&falling[1..]) && ends_with(&falling));
    }

    #[test]
    fn what_does_not_come_nearer_has_stalled() {
        let mut approach = Approach::default();
        // 0.75 twice is nearer.
        assert!((0..100).all(|step| !approach.has_stalled(1.0 + 0.75_f64.powi(step))));
        let mut approach = Approach::default();
        assert!((0..=NEARER_STEPS).all(|_| !approach.has_stalled(2.0)));
        assert!(approach.has_stalled(2.0));
    }

    /// A wider tolerance lets the curve be driven faster.
    #[test]
    fn room_is_made_use_of() {
        let points = chords(120, 0.01);
        let time_s = |tolerance_mm: f64| {
            let spans = fair(&lines(&points, tolerance_mm), &LIMITS).expect("a curve");
            let of_span = |span: &Span| {
                let (_, shape) = shape(span);
                let derivatives = super::super::blend::derivatives(&shape);
                shape.length(0.0, 1.0) / super::super::blend::feed_within(&LIMITS, derivatives).min(60.0)
            };
            spans.iter().map(of_span).sum::<f64>()
        };
        let times = [0.012, 0.05, 0.2].map(time_s);
        assert!(times[1] < 0.98 * times[0] && times[2] < 0.92 * times[1], "{times:?}");
    }

    #[test]
    fn what_has_no_curve_has_none() {
        assert!(fair::<3>(&[], &LIMITS).is_none());
        let mut parts = lines(&chords(20, 0.0), 0.01);
        let curve = Polynomial::bezier(core::array::from_fn(|index| [index as f64, 0.0, 0.0]));
        parts.push(Part { element: Element::polynomial([0.0; 3], curve, Role::Spline), ..parts[0] });
        assert!(fair(&parts, &LIMITS).is_none());
    }
}
