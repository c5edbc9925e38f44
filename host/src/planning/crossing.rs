//! How a junction is crossed: as it is, by an easement, or by a blend.
//!
//! Consumes what `toolpath` makes of a junction; holds what planning has to know of it: what it takes of either move, what is
//! driven in its place, and how fast.

use std::rc::Rc;

use super::ceilings::Ceilings;
use super::shapes::{MeasuredBlend, MeasuredCurve};
use crate::toolpath::easement::Easement;

/// How a junction is crossed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Crossing<const N: usize> {
    pub(super) by: By<N>,
    /// The greatest feed \[mm/s\].
    pub(super) feed_mm_s: f64,
}

/// What takes the place of a junction.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum By<const N: usize> {
    /// Nothing.
    Itself,
    /// A kink's turn is spread over the ends of its moves.
    Easement(Rc<Eased<N>>),
    /// A blend.
    Blend(Rc<Rounding<N>>),
}

impl<const N: usize> Crossing<N> {
    /// Its trims of the move before and the move after \[mm\].
    pub(super) fn trims_mm(&self) -> [f64; 2] {
        match &self.by {
            By::Itself => [0.0; 2],
            By::Easement(eased) => eased.easement.trims_mm,
            By::Blend(rounding) => [rounding.blended.blend.trim_mm; 2],
        }
    }

    /// The greatest feed where it begins \[mm/s\].
    pub(super) fn enter_mm_s(&self) -> f64 {
        match (&self.by, self.driven().first()) {
            (By::Easement(eased), Some(first)) if eased.easement.trims_mm[0] > 0.0 => {
                first.ceilings.programmed.feed_mm_s
            }
            _ => self.feed_mm_s,
        }
    }

    /// What it is driven as.
    pub(super) fn driven(&self) -> &[Driven<N>] {
        match &self.by {
            By::Itself => &[],
            By::Easement(eased) => &eased.sides,
            By::Blend(rounding) => core::slice::from_ref(&rounding.driven),
        }
    }

    /// How far that is from the moves \[mm\].
    pub(super) fn distance_mm(&self) -> f64 {
        match &self.by {
            By::Itself => 0.0,
            By::Easement(eased) => eased.easement.distance_mm,
            By::Blend(rounding) => rounding.blended.blend.distance_mm,
        }
    }

    pub(super) fn blend(&self) -> Option<&Rc<Rounding<N>>> {
        match &self.by {
            By::Blend(rounding) => Some(rounding),
            By::Itself | By::Easement(_) => None,
        }
    }
}

/// An easement with what planning knows of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Eased<const N: usize> {
    pub(super) easement: Rc<Easement<N>>,
    pub(super) sides: Vec<Driven<N>>,
}

/// A polynomial between moves with what planning knows of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Driven<const N: usize> {
    pub(super) bent: Rc<MeasuredCurve<N>>,
    pub(super) ceilings: Ceilings,
    /// The greatest feed at its end \[mm/s\].
    pub(super) end_mm_s: f64,
}

/// A blend with what planning knows of it.
#[derive(Clone, Debug)]
pub(super) struct Rounding<const N: usize> {
    pub(super) blended: Rc<MeasuredBlend<N>>,
    /// The part of what its curvature allows with which it is driven.
    pub(super) share: f64,
    pub(super) driven: Driven<N>,
}

/// What is driven follows from these.
impl<const N: usize> PartialEq for Rounding<N> {
    fn eq(&self, other: &Self) -> bool {
        self.share == other.share && self.blended.blend == other.blended.blend
    }
}
