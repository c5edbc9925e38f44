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

    pub(super) fn order(&self) -> usize {
        self.order
    }

    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        self.cells[row * self.order + column]
    }

    pub(super) fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.cells[row * self.order + column]
    }

    /// vᵀ·A·v.
    pub(super) fn quadratic_form(&self, v: &[f64]) -> f64 {
        let row = |row: usize| (0..self.order).map(|column| self.at(row, column) * v[column]).sum::<f64>();
        (0..self.order).map(|index| v[index] * row(index)).sum()
    }

    /// The lower factor L of LLᵀ; `None` if the matrix is not positive.
    pub(super) fn factor(&self) -> Option<Lower> {
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
        Some(Lower { order: n, cells: factor })
    }

    /// The solution for one right-hand side; `None` if the matrix is not positive.
    pub(super) fn solve(&self, right: &[f64]) -> Option<Vec<f64>> {
        let factor = self.factor()?;
        let mut solution = right.to_vec();
        factor.forward(&mut solution);
        factor.backward(&mut solution);
        Some(solution)
    }

    /// The inverse; `None` if the matrix is not positive.
    pub(super) fn inverse(&self) -> Option<Self> {
        let factor = self.factor()?;
        let mut inverse = Self::zero(self.order);
        for column in 0..self.order {
            let mut unit = vec![0.0; self.order];
            unit[column] = 1.0;
            factor.forward(&mut unit);
            factor.backward(&mut unit);
            for (row, value) in unit.into_iter().enumerate() {
                *inverse.at_mut(row, column) = value;
            }
        }
        Some(inverse)
    }
}

/// A lower triangular matrix, row by row; what is above the diagonal is not read.
#[derive(Clone, Debug)]
pub(super) struct Lower {
    order: usize,
    cells: Vec<f64>,
}

impl Lower {
    /// Multiplies every row by its factor.
    pub(super) fn scale_rows(&mut self, factors: &[f64]) {
        for (row, factor) in self.cells.chunks_mut(self.order.max(1)).zip(factors) {
            row.iter_mut().for_each(|cell| *cell *= factor);
        }
    }

    /// `right` becomes L⁻¹·right.
    pub(super) fn forward(&self, right: &mut [f64]) {
        let n = self.order;
        for row in 0..n {
            let inner: f64 = (0..row).map(|k| self.cells[row * n + k] * right[k]).sum();
            right[row] = (right[row] - inner) / self.cells[row * n + row];
        }
    }

    /// `right` becomes L⁻ᵀ·right.
    pub(super) fn backward(&self, right: &mut [f64]) {
        let n = self.order;
        for row in (0..n).rev() {
            let inner: f64 = (row + 1..n).map(|k| self.cells[k * n + row] * right[k]).sum();
            right[row] = (right[row] - inner) / self.cells[row * n + row];
        }
    }

    /// ln det L.
    pub(super) fn log_determinant(&self) -> f64 {
        (0..self.order).map(|row| libm::log(self.cells[row * (self.order + 1)])).sum()
    }

    /// `right` becomes L·right.
    pub(super) fn times(&self, right: &[f64]) -> Vec<f64> {
        let n = self.order;
        (0..n).map(|row| (0..=row).map(|k| self.cells[row * n + k] * right[k]).sum()).collect()
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
        // 4 + 5·4 + 3·9 + 2·(2·2 − 3 + 0.5·6), and a determinant of 4·(15 − 0.25) − 2·(6 + 0.5) − (1 + 5).
        assert!((positive.quadratic_form(&[1.0, 2.0, 3.0]) - 59.0).abs() < 1e-12);
        let log_determinant = positive.factor().unwrap().log_determinant();
        assert!((log_determinant - 0.5 * 40.0_f64.ln()).abs() < 1e-12, "{log_determinant}");
    }

    #[test]
    fn what_is_not_positive_has_no_solution() {
        assert_eq!(matrix([1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]).solve(&[1.0; 3]), None);
        assert_eq!(matrix([1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]).solve(&[1.0; 3]), None);
        assert_eq!(matrix([f64::NAN; 9]).inverse(), None);
    }
}
