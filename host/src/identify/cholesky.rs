//! Symmetric positive systems of a dozen unknowns: Cholesky's factorisation.

/// A symmetric matrix, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Symmetric {
    order: usize,
    cells: Vec<f64>,
}

impl Symmetric {
    pub(super) fn zero(order: usize) -> Self {
        Self { order, cells: vec![0.0; order * order] }
    }

    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        self.cells[row * self.order + column]
    }

    pub(super) fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.cells[row * self.order + column]
    }

    /// Adds `factor` × `other`, which has the same order.
    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        self.cells.iter_mut().zip(&other.cells).for_each(|(cell, other)| *cell += factor * other);
    }

    /// The solution for one right-hand side; `None` if the matrix is not positive.
    pub(super) fn solve(&self, right: &[f64]) -> Option<Vec<f64>> {
        let n = self.order;
        let mut factor = self.cells.clone();
        for column in 0..n {
            for row in column..n {
                let inner: f64 = (0..column).map(|k| factor[row * n + k] * factor[column * n + k]).sum();
                let rest = self.at(row, column) - inner;
                if row == column {
                    // What is left of the diagonal after 14 digits have cancelled is rounding.
                    if !(rest > 1e-14 * self.at(row, row)) {
                        return None;
                    }
                    factor[row * n + row] = rest.sqrt();
                } else {
                    factor[row * n + column] = rest / factor[column * n + column];
                }
            }
        }
        let mut solution = right.to_vec();
        for row in 0..n {
            let inner: f64 = (0..row).map(|k| factor[row * n + k] * solution[k]).sum();
            solution[row] = (solution[row] - inner) / factor[row * n + row];
        }
        for row in (0..n).rev() {
            let inner: f64 = (row + 1..n).map(|k| factor[k * n + row] * solution[k]).sum();
            solution[row] = (solution[row] - inner) / factor[row * n + row];
        }
        Some(solution)
    }

    /// The inverse; `None` if the matrix is not positive.
    pub(super) fn inverse(&self) -> Option<Self> {
        let mut inverse = Self::zero(self.order);
        for column in 0..self.order {
            let mut unit = vec![0.0; self.order];
            unit[column] = 1.0;
            for (row, value) in self.solve(&unit)?.into_iter().enumerate() {
                *inverse.at_mut(row, column) = value;
            }
        }
        Some(inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(cells: [f64; 9]) -> Symmetric {
        Symmetric { order: 3, cells: cells.to_vec() }
    }

    #[test]
    fn a_system_is_solved() {
        let positive = matrix([4.0, 2.0, -1.0, 2.0, 5.0, 0.5, -1.0, 0.5, 3.0]);
        let solution = positive.solve(&[4.0 + 4.0 - 3.0, 2.0 + 10.0 + 1.5, -1.0 + 1.0 + 9.0]).unwrap();
        for (found, expected) in solution.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{solution:?}");
        }
        let inverse = positive.inverse().unwrap();
        let unit: f64 = (0..3).map(|k| positive.at(0, k) * inverse.at(k, 0)).sum();
        assert!((unit - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_positive_has_no_solution() {
        assert_eq!(matrix([1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]).solve(&[1.0; 3]), None);
        assert_eq!(matrix([1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]).solve(&[1.0; 3]), None);
        assert_eq!(matrix([f64::NAN; 9]).inverse(), None);
    }
}
