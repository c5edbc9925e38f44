//! Symmetric positive definite equations in a band, by Cholesky factorisation.

use core::ops::Range;

use super::super::{Vector, scale};

/// Control points that act on one span.
pub(super) const ACTING: usize = 6;
/// What the diagonal is made greater by, as a part of it, so that rounding leaves the pivots above 0.
const REGULARISATION: f64 = 1.0e-13;

/// The lower triangle of the matrix of points whose entries couple at most [`ACTING`] neighbours, by columns.
pub(super) struct Cholesky<const N: usize> {
    /// The entries of each, the diagonal first.
    columns: Vec<Column<N>>,
}

type Column<const N: usize> = [Vector<N>; ACTING];

impl<const N: usize> Cholesky<N> {
    /// Entries of a column.
    const WIDTH: usize = N * ACTING;

    pub(super) fn new(points: usize) -> Self {
        Self { columns: vec![[[0.0; N]; ACTING]; N * points] }
    }

    pub(super) fn clear(&mut self) {
        self.columns.fill([[0.0; N]; ACTING]);
    }

    /// Makes it the other, which has as many points.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.columns.copy_from_slice(&other.columns);
    }

    /// Adds a symmetric `N` × `N` matrix to the blocks of all pairs of [`ACTING`] points from `first` on, times the
    /// factors of both.
    pub(super) fn add(&mut self, first: usize, factors: &[f64; ACTING], matrix: &[Vector<N>; N]) {
        for (axis, line) in matrix.iter().enumerate() {
            let whole: Column<N> = factors.map(|factor| scale(*line, factor));
            for (point, factor) in factors.iter().enumerate() {
                let diagonal = N * point + axis;
                let column = self.columns[N * first + diagonal].as_flattened_mut();
                for (entry, below) in column.iter_mut().zip(&whole.as_flattened()[diagonal..]) {
                    *entry += factor * below;
                }
            }
        }
    }

    /// Adds `factor` times the identity to the block of the points `row` ≥ `column`.
    pub(super) fn add_unit(&mut self, row: usize, column: usize, factor: f64) {
        for axis in 0..N {
            self.columns[N * column + axis][row - column][0] += factor;
        }
    }

    /// Makes the equations of these points say that they stay at their side, and leaves them out of the others.
    pub(super) fn hold(&mut self, points: Range<usize>) {
        for index in N * points.start..N * points.end {
            self.columns[index] = [[0.0; N]; ACTING];
            self.columns[index][0][0] = 1.0;
            for back in 1..Self::WIDTH.min(index + 1) {
                self.columns[index - back].as_flattened_mut()[back] = 0.0;
            }
        }
    }

    /// Solves for `sides` in place; false if the matrix is not positive definite. The matrix is used up.
    pub(super) fn solve(&mut self, sides: &mut [Vector<N>]) -> bool {
        let size = self.columns.len();
        self.columns.iter_mut().for_each(|column| column[0][0] *= 1.0 + REGULARISATION);
        for index in 0..size {
            let (done, rest) = self.columns.split_at_mut(index + 1);
            let column = done[index].as_flattened_mut();
            if !(column[0] > 0.0) {
                return false;
            }
            let pivot = column[0].sqrt();
            column[0] = pivot;
            let per_pivot = 1.0 / pivot;
            column[1..].iter_mut().for_each(|entry| *entry *= per_pivot);
            // What is left of the matrix loses the product of this column with itself.
            for (below, other) in (1..Self::WIDTH).zip(rest) {
                let factor = column[below];
                for (entry, of_column) in other.as_flattened_mut().iter_mut().zip(&column[below..]) {
                    *entry -= factor * of_column;
                }
            }
        }
        let sides = sides.as_flattened_mut();
        for (index, column) in self.columns.iter().enumerate() {
            let column = column.as_flattened();
            let side = sides[index] / column[0];
            sides[index] = side;
            for (below, entry) in sides[index + 1..].iter_mut().zip(&column[1..]) {
                *below -= entry * side;
            }
        }
        for (index, column) in self.columns.iter().enumerate().rev() {
            let column = column.as_flattened();
            let known = sides[index + 1..].iter().zip(&column[1..]);
            sides[index] = known.fold(sides[index], |rest, (below, entry)| rest - entry * below) / column[0];
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random outer products and identities, and a point in the middle that is held; the product with a known
    /// solution is the side.
    #[test]
    fn a_known_solution_is_found() {
        let (points, held) = (23, 9);
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let size = 3 * points;
        let mut full = vec![vec![0.0; size]; size];
        let mut band = Cholesky::<3>::new(points);
        for first in 0..=points - ACTING {
            let factors: [f64; ACTING] = core::array::from_fn(|_| random());
            let [a, b, c, d, e, f] = core::array::from_fn(|_| random());
            let matrix = [[a + 2.0, d, e], [d, b + 2.0, f], [e, f, c + 2.0]];
            band.add(first, &factors, &matrix);
            for (row, column) in (0..ACTING).flat_map(|row| (0..ACTING).map(move |column| (row, column))) {
                for (axis, other) in (0..3).flat_map(|axis| (0..3).map(move |other| (axis, other))) {
                    full[3 * (first + row) + axis][3 * (first + column) + other] +=
                        factors[row] * factors[column] * matrix[axis][other];
                }
            }
        }
        for row in 0..points {
            for column in row.saturating_sub(ACTING - 1)..=row {
                let factor = if row == column { 3.0 } else { 0.2 * random() };
                band.add_unit(row, column, factor);
                for axis in 0..3 {
                    full[3 * row + axis][3 * column + axis] += factor;
                    if row != column {
                        full[3 * column + axis][3 * row + axis] += factor;
                    }
                }
            }
        }
        let mut expected: Vec<f64> = (0..size).map(|_| random()).collect();
        band.hold(held..held + 1);
        expected[3 * held..3 * held + 3].fill(0.0);
        let mut sides = vec![[0.0; 3]; points];
        for (r, row) in full.iter().enumerate().filter(|(r, _)| r / 3 != held) {
            sides[r / 3][r % 3] = row.iter().zip(&expected).map(|(a, b)| a * b).sum();
        }
        assert!(band.solve(&mut sides));
        for (index, expected) in expected.iter().enumerate() {
            assert!((sides[index / 3][index % 3] - expected).abs() < 1e-13);
        }
        let mut indefinite = Cholesky::<3>::new(2);
        indefinite.add_unit(0, 0, 1.0);
        indefinite.add_unit(1, 1, -1.0);
        assert!(!indefinite.solve(&mut [[0.0; 3]; 2]));
    }

    /// What holds one direction very hard takes all digits of the others.
    #[test]
    fn rounding_does_not_make_a_matrix_indefinite() {
        let mut state = 5_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1_u32 << 24) + 0.1
        };
        for _ in 0..100 {
            let held: Vector = core::array::from_fn(|_| random());
            let matrix: [Vector; 3] = held.map(|a| held.map(|b| 1e16 * a * b));
            let factors = core::array::from_fn(|_| random());
            let mut equations = Cholesky::<3>::new(ACTING);
            equations.add(0, &factors, &matrix);
            (0..ACTING).for_each(|point| equations.add_unit(point, point, 1e-3));
            let mut sides = [[1.0; 3]; ACTING];
            assert!(equations.solve(&mut sides));
            assert!(sides.iter().flatten().all(|side| side.is_finite()));
        }
    }
}
