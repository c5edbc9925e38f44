//! Coordinates that move, apart from those that stand.
//!
//! Most of what a machine of many axes drives moves few of them. What is solved at a cost that grows with the number of
//! coordinates, or is known in space only, is solved in these and put back.

use super::curve::Spiral;
use super::element::Element;
use super::polynomial::Polynomial;
use super::{Greatest, Vector};

/// Some coordinates of a larger space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subspace<const M: usize = 3> {
    /// Where each coordinate is in the larger space; one that is not there is 0.
    places: [Option<usize>; M],
}

impl<const M: usize> Subspace<M> {
    /// The coordinates at these places.
    #[must_use]
    pub fn at(places: [Option<usize>; M]) -> Self {
        Self { places }
    }

    /// The coordinates of those that move, and the first of the others, in their order; none if more than `M` move.
    #[must_use]
    pub fn of<const N: usize>(moves: [bool; N]) -> Option<Self> {
        let moving = moves.iter().filter(|&&moves| moves).count();
        if moving > M {
            return None;
        }
        let mut standing = M - moving;
        let mut is_in = moves;
        for place in is_in.iter_mut().filter(|place| !**place) {
            *place = standing > 0;
            standing = standing.saturating_sub(1);
        }
        let mut places = (0..N).filter(|&place| is_in[place]);
        Some(Self { places: std::array::from_fn(|_| places.next()) })
    }

    /// A vector of the larger space in these coordinates.
    #[must_use]
    pub fn narrow<const N: usize>(&self, vector: Vector<N>) -> Vector<M> {
        self.places.map(|place| place.map_or(0.0, |place| vector[place]))
    }

    /// A vector of the larger space: these coordinates, and the others of `rest`.
    #[must_use]
    pub fn widen<const N: usize>(&self, vector: Vector<M>, rest: Vector<N>) -> Vector<N> {
        self.put(vector, rest)
    }

    fn put<T: Copy, const N: usize>(&self, values: [T; M], mut rest: [T; N]) -> [T; N] {
        for (place, value) in self.places.into_iter().zip(values) {
            if let Some(place) = place {
                rest[place] = value;
            }
        }
        rest
    }

    /// An element without its other coordinates, which stand.
    #[must_use]
    pub fn narrow_element<const N: usize>(&self, element: &Element<N>) -> Element<M> {
        mapped(element, |point| self.narrow(point), |vector| self.narrow(vector))
    }

    /// An element whose other coordinates stand at those of `rest`.
    #[must_use]
    pub fn widen_element<const N: usize>(&self, element: &Element<M>, rest: Vector<N>) -> Element<N> {
        mapped(element, |point| self.widen(point, rest), |vector| self.widen(vector, [0.0; N]))
    }

    /// How an element bends whose other coordinates stand.
    #[must_use]
    pub fn widen_greatest<const N: usize>(&self, greatest: &Greatest<M>) -> Greatest<N> {
        Greatest {
            bend: greatest.bend,
            tangent: self.widen(greatest.tangent, [0.0; N]),
            curved: self.put(greatest.curved, [false; N]),
        }
    }
}

/// An element with its points and its vectors in another space, of which neither changes a length.
fn mapped<const A: usize, const B: usize>(
    element: &Element<A>,
    point: impl Fn(Vector<A>) -> Vector<B>,
    vector: impl Fn(Vector<A>) -> Vector<B>,
) -> Element<B> {
    match element {
        Element::Line { from, to } => Element::Line { from: point(*from), to: point(*to) },
        Element::Arc { from, to, shape, sweep_rad } => Element::Arc {
            from: point(*from),
            to: point(*to),
            shape: Spiral {
                outward: vector(shape.outward),
                onward: vector(shape.onward),
                radius_mm: shape.radius_mm,
                radius_per_rad: shape.radius_per_rad,
                across_per_rad: vector(shape.across_per_rad),
            },
            sweep_rad: *sweep_rad,
        },
        Element::Polynomial { from, to, shape, role } => Element::Polynomial {
            from: point(*from),
            to: point(*to),
            shape: Polynomial::new(shape.coefficients().map(vector)),
            role: *role,
        },
        Element::Involute { from, to, shape } => {
            Element::Involute { from: point(*from), to: point(*to), shape: shape.mapped(vector) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_is_found_with_the_first_of_what_stands() {
        let of = |moves: [bool; 5]| Subspace::<3>::of(moves).map(|space| space.places);
        assert_eq!(of([false; 5]), Some([Some(0), Some(1), Some(2)]));
        assert_eq!(of([true, false, true, false, false]), Some([Some(0), Some(1), Some(2)]));
        assert_eq!(of([false, false, false, true, true]), Some([Some(0), Some(3), Some(4)]));
        assert_eq!(of([true, true, true, true, false]), None);
        let few = Subspace::<3>::of([false, true]).expect("two coordinates");
        assert_eq!(few.places, [Some(0), Some(1), None]);
        assert_eq!(few.narrow([4.0, 5.0]), [4.0, 5.0, 0.0]);
    }

    #[test]
    fn what_is_put_back_stands_where_it_stood() {
        let space = Subspace::<3>::of([true, false, false, true, true]).expect("three coordinates");
        let line = Element::Line { from: [1.0, 2.0, 3.0, 4.0, 5.0], to: [6.0, 2.0, 3.0, 7.0, 8.0] };
        let narrow = space.narrow_element(&line);
        assert_eq!(narrow, Element::Line { from: [1.0, 4.0, 5.0], to: [6.0, 7.0, 8.0] });
        assert_eq!(space.widen_element(&narrow, line.ends_mm().0), line);
        let greatest: Greatest<5> = space.widen_greatest(&narrow.greatest());
        assert_eq!(greatest, line.greatest());
    }
}
