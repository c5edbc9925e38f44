//! Least squares with banded rows.
//!
//! Each row is rotated into an upper triangle by Givens rotations as it comes: backward stable for square
//! systems and for overdetermined ones, and linear in the number of rows.

use super::DEGREE_MAX;
use super::basis::Row;
use crate::toolpath::{Vector, add, scale, subtract};

/// A pivot below this part of the greatest entry of its column leaves its unknown undetermined.
const PIVOT_MIN: f64 = 1.0e-11;

/// Rows rotated into a triangle.
pub(super) struct Band<const N: usize> {
    /// Row i holds columns i … i + [`DEGREE_MAX`].
    triangle: Vec<Row>,
    sides: Vec<Vector<N>>,
    /// Greatest |entry| of each column, as the rows came.
    greatest: Vec<f64>,
}

impl<const N: usize> Band<N> {
    /// For `unknowns` points.
    pub(super) fn new(unknowns: usize) -> Self {
        Self {
            triangle: vec![[0.0; DEGREE_MAX + 1]; unknowns],
            sides: vec![[0.0; N]; unknowns],
            greatest: vec![0.0; unknowns],
        }
    }

    /// Adds Σ rowᵢ·unknown[first + i] = side. Entries beyond the last unknown are 0.
    pub(super) fn add(&mut self, first: usize, mut row: Row, mut side: Vector<N>) {
        for (greatest, entry) in self.greatest[first..].iter_mut().zip(row) {
            *greatest = greatest.max(entry.abs());
        }
        let pivots = self.triangle[first..].iter_mut().zip(&mut self.sides[first..]);
        for (pivot, pivot_side) in pivots.take(DEGREE_MAX + 1) {
            let size = libm::hypot(pivot[0], row[0]);
            if row[0] != 0.0 && size > 0.0 {
                let (cosine, sine) = (pivot[0] / size, row[0] / size);
                for (kept, rest) in pivot.iter_mut().zip(&mut row) {
                    (*kept, *rest) = (cosine * *kept + sine * *rest, cosine * *rest - sine * *kept);
                }
                let rest = subtract(scale(side, cosine), scale(*pivot_side, sine));
                *pivot_side = add(scale(*pivot_side, cosine), scale(side, sine));
                side = rest;
            }
            // What stands in this column has been taken over.
            row[0] = 0.0;
            row.rotate_left(1);
        }
    }

    /// The unknowns; nothing if the rows leave one of them undetermined.
    pub(super) fn solve(mut self) -> Option<Vec<Vector<N>>> {
        for index in (0..self.triangle.len()).rev() {
            let row = self.triangle[index];
            if !(row[0].abs() > PIVOT_MIN * self.greatest[index]) {
                return None;
            }
            let known = row[1..].iter().zip(&self.sides[index + 1..]);
            let rest =
                known.fold(self.sides[index], |rest, (&entry, &known)| subtract(rest, scale(known, entry)));
            self.sides[index] = scale(rest, 1.0 / row[0]);
        }
        Some(self.sides)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(entries: [f64; 3]) -> Row {
        let mut row = [0.0; DEGREE_MAX + 1];
        row[..3].copy_from_slice(&entries);
        row
    }

    /// A line that fits four points which do not lie on it: by hand, 1.4·x + 0.4.
    #[test]
    fn overdetermined_rows_are_met_in_the_mean() {
        let mut band = Band::new(2);
        for (x, y) in [(0.0, 0.0), (1.0, 2.0), (2.0, 4.0), (3.0, 4.0)] {
            band.add(0, row([1.0, x, 0.0]), [y, 2.0 * y, 0.0]);
        }
        let found = band.solve().expect("determined");
        for (found, expected) in found.iter().zip([[0.4, 0.8, 0.0], [1.4, 2.8, 0.0]]) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-14, "{found} {expected}");
            }
        }
    }

    #[test]
    fn an_unknown_without_a_row_is_found_out() {
        let mut band = Band::new(3);
        band.add(0, row([1.0, 1.0, 0.0]), [1.0; 3]);
        band.add(0, row([2.0, 2.0, 0.0]), [2.0; 3]);
        band.add(2, row([1.0, 0.0, 0.0]), [1.0; 3]);
        assert_eq!(band.solve(), None);
    }
}
