//! The blends and easements that junctions may be crossed by, each made once.
//!
//! Consumes what meets at a junction, with the tolerance and the room that are left there; produces its blend or its easements,
//! and how they bend. The runs of a section have most of their junctions in common, and a junction is looked at again and
//! again: half of what is asked for is known.

use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;

use motion_kernel::law::Limits;

use crate::gcode::Axis;
use crate::toolpath::blend::Blend;
use crate::toolpath::easement::Easement;
use crate::toolpath::smooth::Run;
use crate::toolpath::{Element, Greatest, SpeedRatios};

/// Makes the shapes of a section's junctions.
pub(super) struct Shapes<const N: usize> {
    /// Limits of the path in any direction.
    limits: Limits<f64>,
    axes: [Option<Axis>; N],
    blends: ShapeCache<N, Option<Rc<MeasuredBlend<N>>>>,
    easements: ShapeCache<N, Rc<[MeasuredEasement<N>]>>,
}

/// A blend, and how it bends, which is not asked of all.
#[derive(Debug)]
pub(super) struct MeasuredBlend<const N: usize> {
    pub(super) blend: Blend<N>,
    bent: OnceCell<Rc<MeasuredCurve<N>>>,
}

/// An easement, and how its sides bend.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeasuredEasement<const N: usize> {
    pub(super) easement: Rc<Easement<N>>,
    pub(super) sides: Vec<Rc<MeasuredCurve<N>>>,
}

/// A polynomial between moves, and how it bends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeasuredCurve<const N: usize> {
    pub(super) element: Element<N>,
    pub(super) length_mm: f64,
    pub(super) greatest: Greatest<N>,
    pub(super) ratios: SpeedRatios,
}

impl<const N: usize> Shapes<N> {
    /// None yet, for `limits` of the path in any direction, those of the programmed moves, on a machine with these axes. Axes
    /// that only these moves move bind what stands for them, too.
    pub(super) fn new(limits: Limits<f64>, axes: [Option<Axis>; N]) -> Self {
        Self { limits, axes, blends: ShapeCache::default(), easements: ShapeCache::default() }
    }

    /// Limits of the path in any direction.
    pub(super) fn limits(&self) -> &Limits<f64> {
        &self.limits
    }

    /// The blend of a junction with at most `room_mm` of either move; none where there is nothing to blend.
    pub(super) fn blend(&self, run: &Run<N>, junction: usize, room_mm: f64) -> Option<Rc<MeasuredBlend<N>>> {
        if !run.has_blend(junction) {
            return None;
        }
        self.blends.get_or_make(run, junction, [room_mm; 2], || {
            let blend = run.blend(junction, room_mm, &self.limits)?;
            Some(Rc::new(MeasuredBlend { blend, bent: OnceCell::new() }))
        })
    }

    /// How a blend bends.
    pub(super) fn bent(&self, blended: &MeasuredBlend<N>) -> Rc<MeasuredCurve<N>> {
        blended.bent.get_or_init(|| Rc::new(self.bends(blended.blend.element))).clone()
    }

    /// The easements of a junction with at most `rooms_mm` of the two moves.
    pub(super) fn easements(
        &self,
        run: &Run<N>,
        junction: usize,
        rooms_mm: [f64; 2],
    ) -> Rc<[MeasuredEasement<N>]> {
        self.easements.get_or_make(run, junction, rooms_mm, || {
            let easements = run.easements(junction, rooms_mm).into_iter();
            let eased = |easement: Easement<N>| {
                let sides = easement.elements.iter().map(|&element| Rc::new(self.bends(element)));
                MeasuredEasement { sides: sides.collect(), easement: Rc::new(easement) }
            };
            easements.map(eased).collect()
        })
    }

    /// How an element bends takes a search along it.
    fn bends(&self, element: Element<N>) -> MeasuredCurve<N> {
        let (greatest, ratios) = (element.greatest(), SpeedRatios::of(&element, &self.axes));
        MeasuredCurve { element, length_mm: element.length_mm(), greatest, ratios }
    }
}

/// Where two elements meet, the tolerance that is left there, and the rooms: the bits of these.
type Place<const N: usize> = ([u64; N], [u64; 3]);

/// What was made of the elements of junctions, by their places.
struct ShapeCache<const N: usize, T>(RefCell<HashMap<Place<N>, Vec<MadeOf<N, T>>>>);

/// What was made of two elements.
struct MadeOf<const N: usize, T> {
    elements: [Element<N>; 2],
    made: T,
}

impl<const N: usize, T> Default for ShapeCache<N, T> {
    fn default() -> Self {
        Self(RefCell::default())
    }
}

impl<const N: usize, T: Clone> ShapeCache<N, T> {
    /// What is made of a junction's elements within `rooms_mm` of either, if it was not made before.
    fn get_or_make(&self, run: &Run<N>, junction: usize, rooms_mm: [f64; 2], make: impl FnOnce() -> T) -> T {
        let elements = [junction, junction + 1].map(|index| run.moves()[index].element);
        let left_mm = [run.left_mm(junction), rooms_mm[0], rooms_mm[1]];
        let place = (elements[1].ends_mm().0.map(f64::to_bits), left_mm.map(f64::to_bits));
        let known = self.0.borrow();
        let of_these = known.get(&place).and_then(|all| all.iter().find(|known| known.elements == elements));
        if let Some(known) = of_these {
            return known.made.clone();
        }
        drop(known);
        let made = make();
        let new = MadeOf { elements, made: made.clone() };
        let mut known = self.0.borrow_mut();
        // Few have another one in their place.
        known.entry(place).or_insert_with(|| Vec::with_capacity(1)).push(new);
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::planning::ceilings::in_any_direction;
    use crate::toolpath::smooth::tests::path;

    /// The same corner is made once, in whatever run and at whatever index it is; another one that begins in the same point, in
    /// the same room, is another one.
    #[test]
    fn a_shape_is_made_once() {
        let machine = Machine::reference();
        let corner = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]];
        let moves = path(&corner, 0.05, |_| 50.0);
        let shapes = Shapes::new(in_any_direction(&moves, &machine), machine.letters_by_place());
        let blend = |points: &[[f64; 2]], junction, room_mm| {
            let run = Run::exact(&path(points, 0.05, |_| 50.0));
            shapes.blend(&run, junction, room_mm).expect("a corner")
        };
        let [first, again] = [(); 2].map(|()| blend(&corner, 0, 0.1));
        let later = blend(&[[-5.0, 3.0], [0.0, 0.0], [10.0, 0.0], [10.0, 10.0]], 1, 0.1);
        assert!(Rc::ptr_eq(&first, &again) && Rc::ptr_eq(&first, &later));
        assert!(Rc::ptr_eq(&shapes.bent(&first), &shapes.bent(&later)));
        for other in [blend(&corner, 0, 0.05), blend(&[[0.0, 0.0], [10.0, 0.0], [20.0, 10.0]], 0, 0.1)] {
            assert!(other.blend != first.blend);
        }
        let tight = |tolerance_mm| shapes.blend(&Run::exact(&path(&corner, tolerance_mm, |_| 50.0)), 0, 0.1);
        assert!(tight(0.02).expect("a corner").blend != first.blend && tight(0.0).is_none());
    }

    /// Easements likewise; their rooms on both sides count.
    #[test]
    fn easements_are_made_once() {
        let machine = Machine::reference();
        let moves = path(&[[0.0, 0.0], [10.0, 0.0], [20.0, 0.02]], 0.05, |_| 50.0);
        let shapes = Shapes::new(in_any_direction(&moves, &machine), machine.letters_by_place());
        let run = Run::exact(&moves);
        let easements = |rooms_mm| shapes.easements(&run, 0, rooms_mm);
        let [first, again, other] = [[1.0, 2.0], [1.0, 2.0], [2.0, 1.0]].map(easements);
        assert!(!first.is_empty() && Rc::ptr_eq(&first, &again) && first != other);
    }
}
