//! Symmetric positive definite equations in a band, by Cholesky factorisation.

use super::super::Vector;

/// Control points that act on one span.
pub(super) const ACTING: usize = 6;
/// Entries of a row, the diagonal last.
const WIDTH: usize = 3 * ACTING;

/// What the diagonal is made greater by, as a part of it, so that rounding leaves the pivots above 0.
const REGULARISATION: f64 = 1.0e-13;

/// The lower triangle of the matrix of points whose entries couple at most [`ACTING`] neighbours.
pub(super) struct Cholesky {
    rows: Vec<[f64; WIDTH]>,
}

impl Cholesky {
    pub(super) fn new(points: usize) -> Self {
        Self { rows: vec![[0.0; WIDTH]; 3 * points] }
    }

    pub(super) fn clear(&mut self) {
        self.rows.fill([0.0; WIDTH]);
    }

    /// Adds `factor` times a symmetric 3 × 3 matrix to the block of the points `row` ≥ `column`.
    pub(super) fn add(&mut self, row: usize, column: usize, factor: f64, matrix: &[Vector; 3]) {
        for (axis, line) in matrix.iter().enumerate() {
            let r = 3 * row + axis;
            let last = if row == column { axis } else { 2 };
            for (other, entry) in line.iter().enumerate().take(last + 1) {
                self.rows[r][WIDTH - 1 - (r - (3 * column + other))] += factor * entry;
            }
        }
    }

    /// Adds `factor` times the identity.
    pub(super) fn add_unit(&mut self, row: usize, column: usize, factor: f64) {
        for axis in 0..3 {
            self.rows[3 * row + axis][WIDTH - 1 - 3 * (row - column)] += factor;
        }
    }

    /// Solves for `sides` in place; false if the matrix is not positive definite. The matrix is used up.
    pub(super) fn solve(&mut self, sides: &mut [Vector]) -> bool {
        let size = self.rows.len();
        for r in 0..size {
            let reach = r.min(WIDTH - 1);
            for back in (0..=reach).rev() {
                // L[r][c] = (A[r][c] − Σ L[r][k]·L[c][k]) / L[c][c]
                let c = r - back;
                let shared = reach - back;
                let (before, row) = self.rows.split_at_mut(r);
                let row = &mut row[0];
                let at = WIDTH - 1 - back;
                if back == 0 {
                    let sum: f64 = row[at - shared..at].iter().map(|entry| entry * entry).sum();
                    let rest = row[at] * (1.0 + REGULARISATION) - sum;
                    if !(rest > 0.0) {
                        return false;
                    }
                    row[at] = rest.sqrt();
                } else {
                    let other = &before[c];
                    let sum: f64 = row[at - shared..at]
                        .iter()
                        .zip(&other[WIDTH - 1 - shared..WIDTH - 1])
                        .map(|(a, b)| a * b)
                        .sum();
                    row[at] = (row[at] - sum) / other[WIDTH - 1];
                }
            }
        }
        for r in 0..size {
            let mut side = sides[r / 3][r % 3];
            for back in 1..=r.min(WIDTH - 1) {
                side -= self.rows[r][WIDTH - 1 - back] * sides[(r - back) / 3][(r - back) % 3];
            }
            sides[r / 3][r % 3] = side / self.rows[r][WIDTH - 1];
        }
        for r in (0..size).rev() {
            let mut side = sides[r / 3][r % 3];
            for ahead in 1..WIDTH.min(size - r) {
                side -= self.rows[r + ahead][WIDTH - 1 - ahead] * sides[(r + ahead) / 3][(r + ahead) % 3];
            }
            sides[r / 3][r % 3] = side / self.rows[r][WIDTH - 1];
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A random matrix plus its transpose, made dominant; the product with a known solution is the side.
    #[test]
    fn a_known_solution_is_found() {
        let points = 23;
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let size = 3 * points;
        let mut full = vec![vec![0.0; size]; size];
        let mut band = Cholesky::new(points);
        for row in 0..points {
            for column in row.saturating_sub(ACTING - 1)..=row {
                let diagonal = if row == column { 20.0 } else { 0.0 };
                let [a, b, c, d, e, f] = core::array::from_fn(|_| random());
                let block = [[a + diagonal, d, e], [d, b + diagonal, f], [e, f, c + diagonal]];
                band.add(row, column, 0.5, &block);
                band.add_unit(row, column, 0.25);
                for (a, line) in block.iter().enumerate() {
                    for (b, entry) in line.iter().enumerate() {
                        let entry = 0.5 * entry + if a == b { 0.25 } else { 0.0 };
                        full[3 * row + a][3 * column + b] = entry;
                        full[3 * column + b][3 * row + a] = entry;
                    }
                }
            }
        }
        let expected: Vec<f64> = (0..size).map(|_| random()).collect();
        let mut sides = vec![[0.0; 3]; points];
        for (r, row) in full.iter().enumerate() {
            sides[r / 3][r % 3] = row.iter().zip(&expected).map(|(a, b)| a * b).sum();
        }
        assert!(band.solve(&mut sides));
        for (index, expected) in expected.iter().enumerate() {
            assert!((sides[index / 3][index % 3] - expected).abs() < 1e-13);
        }
        let mut indefinite = Cholesky::new(2);
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
            let factors = [random(), random()];
            let mut equations = Cholesky::new(2);
            for row in 0..2 {
                equations.add_unit(row, row, 1e-3);
                for column in 0..=row {
                    equations.add(row, column, factors[row] * factors[column], &matrix);
                }
            }
            let mut sides = [[1.0; 3]; 2];
            assert!(equations.solve(&mut sides));
            assert!(sides.iter().flatten().all(|side| side.is_finite()));
        }
    }
}
