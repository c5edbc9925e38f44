//! Fewer points, the same picture.
//!
//! An experiment may hold millions of ticks, a plot only about a thousand columns. The reduction is O(n), and keeps what
//! the reader looks for: the highest and the lowest value of every column, so no peak is lost.

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
}
