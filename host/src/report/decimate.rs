//! Fewer points, the same picture.
//!
//! A run may hold millions of ticks, a plot only about a thousand columns. Both reductions are O(n), and both
//! keep what the reader looks for: a plot over time keeps the highest and the lowest value of every column,
//! so no peak is lost; a path keeps its shape to a fraction of a pixel.

/// The points that a column of the picture keeps: first, lowest, highest and last, with their rank.
#[derive(Clone, Copy)]
struct Column {
    index: usize,
    first: (usize, f64, f64),
    low: (usize, f64, f64),
    high: (usize, f64, f64),
    last: (usize, f64, f64),
}

impl Column {
    fn new(index: usize, point: (usize, f64, f64)) -> Self {
        Self { index, first: point, low: point, high: point, last: point }
    }

    fn add(&mut self, point: (usize, f64, f64)) {
        if point.2 < self.low.2 {
            self.low = point;
        }
        if point.2 > self.high.2 {
            self.high = point;
        }
        self.last = point;
    }

    fn push_into(self, out: &mut Vec<(f64, f64)>) {
        let mut kept = [self.first, self.low, self.high, self.last];
        kept.sort_by_key(|point| point.0);
        let mut previous = None;
        for (rank, x, y) in kept {
            if previous != Some(rank) {
                push_unless_level(out, (x, y));
            }
            previous = Some(rank);
        }
    }
}

/// Adds a point. On a level stretch only the two ends are kept.
fn push_unless_level(out: &mut Vec<(f64, f64)>, point: (f64, f64)) {
    if let [.., a, b] = out.as_slice() {
        let same = |p: &(f64, f64)| p.1.total_cmp(&point.1).is_eq();
        if same(a) && same(b) {
            out.pop();
        }
    }
    out.push(point);
}

/// Returns at most four points for each of `columns` equal parts of `from..to`, in their order, the extremes
/// of every part among them. Points that are not finite are left out.
pub(super) fn by_column(
    points: impl Iterator<Item = (f64, f64)>,
    (from, to): (f64, f64),
    columns: usize,
) -> Vec<(f64, f64)> {
    let width = (to - from) / columns.max(1) as f64;
    let mut out = Vec::new();
    let mut column: Option<Column> = None;
    for (rank, (x, y)) in points.enumerate().filter(|(_, (x, y))| x.is_finite() && y.is_finite()) {
        let index = if width > 0.0 { ((x - from) / width) as usize } else { 0 };
        match &mut column {
            Some(open) if open.index == index => open.add((rank, x, y)),
            _ => {
                if let Some(full) = column.replace(Column::new(index, (rank, x, y))) {
                    full.push_into(&mut out);
                }
            }
        }
    }
    if let Some(full) = column {
        full.push_into(&mut out);
    }
    out
}

/// A stretch of path in one class of colour, in drawing units. It begins where the one before it ends.
pub(super) struct Stretch {
    /// The colour.
    pub(super) class: usize,
    /// Corners of the line.
    pub(super) points: Vec<(f64, f64)>,
}

/// How far the drawn path may lie from the true one, in drawing units.
const DEVIATION: f64 = 0.25;

/// The cost of a stretch's beginning in the file, counted in corners.
const STRETCH_COST: usize = 10;

/// A path in drawing units with a colour class per point, reduced to what can be seen: points closer than a
/// unit are one, straight stretches are two. If it still costs more than `corners_max`, points are taken
/// farther apart until they fit.
pub(super) fn path<I>(points: impl Fn() -> I, corners_max: usize) -> Vec<Stretch>
where
    I: Iterator<Item = (f64, f64, usize)>,
{
    let mut apart = 1.0;
    // Doubling passes the size of any picture after a few rounds.
    for _ in 0..16 {
        if let Some(stretches) = thinned(points(), apart, corners_max) {
            return stretches;
        }
        apart *= 2.0;
    }
    Vec::new()
}

/// One attempt; `None` as soon as it costs too much.
fn thinned(
    points: impl Iterator<Item = (f64, f64, usize)>,
    apart: f64,
    corners_max: usize,
) -> Option<Vec<Stretch>> {
    let mut cost = 0;
    let mut stretches: Vec<Stretch> = Vec::new();
    let mut line = Straight::default();
    let mut last_seen = None;
    let mut kept: Option<(f64, f64)> = None;
    let mut keep = |x: f64, y: f64, class: usize, kept: &mut Option<(f64, f64)>| {
        match stretches.last_mut() {
            Some(open) if open.class == class => {
                if line.takes((x, y)) {
                    open.points.pop();
                    cost -= 1;
                } else if let Some(&corner) = open.points.last() {
                    line = Straight::from(corner);
                    line.takes((x, y));
                }
                open.points.push((x, y));
                cost += 1;
            }
            _ => {
                let start = kept.unwrap_or((x, y));
                line = Straight::from(start);
                line.takes((x, y));
                stretches.push(Stretch { class, points: vec![start, (x, y)] });
                cost += STRETCH_COST + 2;
            }
        }
        *kept = Some((x, y));
        cost <= corners_max
    };
    for (x, y, class) in points.filter(|(x, y, _)| x.is_finite() && y.is_finite()) {
        if kept.is_none_or(|(kx, ky)| (x - kx).hypot(y - ky) >= apart) {
            if !keep(x, y, class, &mut kept) {
                return None;
            }
            last_seen = None;
        } else {
            last_seen = Some((x, y, class));
        }
    }
    // The end of the path is exact however close it lies to the point before.
    if let Some((x, y, class)) = last_seen
        && !keep(x, y, class, &mut kept)
    {
        return None;
    }
    Some(stretches)
}

/// A straight line growing from `start`: the range of directions in which it passes every point taken so far
/// within [`DEVIATION`].
#[derive(Default)]
struct Straight {
    start: (f64, f64),
    /// First direction \[rad\], the deflections from it that are still allowed, and the length up to here.
    toward: Option<(f64, f64, f64, f64)>,
}

impl Straight {
    fn from(start: (f64, f64)) -> Self {
        Self { start, toward: None }
    }

    /// Whether the line can be drawn on to `point`; if so it has been.
    fn takes(&mut self, (x, y): (f64, f64)) -> bool {
        use std::f64::consts::{PI, TAU};
        let (dx, dy) = (x - self.start.0, y - self.start.1);
        let length = dx.hypot(dy);
        if length <= DEVIATION {
            return self.toward.is_none();
        }
        let direction = dy.atan2(dx);
        let spread = (DEVIATION / length).asin();
        let Some((first, low, high, longest)) = self.toward else {
            self.toward = Some((direction, -spread, spread, length));
            return true;
        };
        let deflection = (direction - first + PI).rem_euclid(TAU) - PI;
        // A path that comes back on itself reverses at its far end, which has to stay a corner.
        if deflection < low || deflection > high || length < longest {
            return false;
        }
        self.toward = Some((first, low.max(deflection - spread), high.min(deflection + spread), length));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_survive_in_their_column() {
        let n = 1_000_000;
        let mut values: Vec<f64> = (0..n).map(|i| (i as f64 * 0.37).sin()).collect();
        values[123_457] = 9.5;
        values[765_432] = -7.25;
        let points = values.iter().enumerate().map(|(i, &y)| (i as f64, y));
        let kept = by_column(points, (0.0, n as f64), 900);
        assert!(kept.len() <= 4 * 901, "{}", kept.len());
        assert!(kept.contains(&(123_457.0, 9.5)) && kept.contains(&(765_432.0, -7.25)));
        assert_eq!(kept.first(), Some(&(0.0, values[0])));
        assert_eq!(kept.last(), Some(&((n - 1) as f64, values[n - 1])));
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn level_lines_cost_two_points_and_gaps_none() {
        let level = (0..10_000).map(|i| (i as f64, 3.0));
        assert_eq!(by_column(level, (0.0, 10_000.0), 100), [(0.0, 3.0), (9_999.0, 3.0)]);
        let broken = [(0.0, 1.0), (1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 2.0)];
        assert_eq!(by_column(broken.into_iter(), (0.0, 3.0), 2), [(0.0, 1.0), (3.0, 2.0)]);
        assert!(by_column(std::iter::empty(), (0.0, 0.0), 10).is_empty());
    }

    #[test]
    fn a_square_keeps_its_corners() {
        let side = |i: usize| match i / 1000 {
            0 => (i as f64 * 0.1, 0.0, 0),
            1 => (100.0, (i - 1000) as f64 * 0.1, 0),
            2 => (100.0 - (i - 2000) as f64 * 0.1, 100.0, 0),
            _ => (0.0, 100.0 - (i - 3000) as f64 * 0.1, 0),
        };
        let stretches = path(|| (0..=4000).map(side), 10_000);
        assert_eq!(stretches.len(), 1);
        let points = &stretches[0].points;
        assert!(points.len() < 12, "{points:?}");
        for corner in [(100.0, 0.0), (100.0, 100.0), (0.0, 100.0), (0.0, 0.0)] {
            assert!(
                points.iter().any(|p| (p.0 - corner.0).hypot(p.1 - corner.1) < 0.6),
                "{corner:?} {points:?}"
            );
        }
    }

    #[test]
    fn a_circle_stays_round_and_a_there_and_back_keeps_its_tip() {
        let circle = |i: usize| {
            let angle = i as f64 * 1e-4;
            (200.0 + 150.0 * angle.cos(), 200.0 + 150.0 * angle.sin(), usize::from(i > 30_000))
        };
        let stretches = path(|| (0..62_832).map(circle), 10_000);
        assert_eq!(stretches.len(), 2);
        for stretch in &stretches {
            for pair in stretch.points.windows(2) {
                let middle =
                    ((pair[0].0 + pair[1].0) / 2.0 - 200.0).hypot((pair[0].1 + pair[1].1) / 2.0 - 200.0);
                assert!((middle - 150.0).abs() < 2.0 * DEVIATION, "{middle}");
            }
        }
        let back = path(|| (0..=200).map(|i| (100.0 - (100.0 - i as f64).abs(), 0.0, 0)), 1000);
        assert!(back[0].points.contains(&(100.0, 0.0)));
    }

    #[test]
    fn a_scribble_is_capped() {
        let noise = |i: usize| (((i * 7919) % 800) as f64, ((i * 104_729) % 500) as f64, i % 8);
        let stretches = path(|| (0..200_000).map(noise), 5_000);
        assert!(stretches.iter().map(|s| s.points.len()).sum::<usize>() <= 5_000);
    }
}
