//! Junctions without a blend: as they are, or with a kink's turn spread over the ends of its moves.
//!
//! Consumes a junction of a run; produces what it is without a blend, and adds its easements to the crossings that are compared.
//! Background, at most six easements a look.

use std::rc::Rc;

use motion_kernel::plan::Ceiling;

use super::Junctions;
use crate::planning::ceilings::{Ceilings, ceilings, junction_feed};
use crate::planning::compared::Compared;
use crate::planning::crossing::{By, Crossing, Eased};
use crate::planning::error::AtLine;
use crate::planning::shapes::{MeasuredCurve, MeasuredEasement};

/// Lengths of easements that are tried, as parts of what there is room for.
const EASEMENT_SIZES: [f64; 2] = [1.0, 0.25];

impl<const N: usize> Junctions<'_, N> {
    /// A junction without a blend; a kink that might be passed, but for the step of velocity, with the fastest of its easements
    /// within half of its moves.
    pub(super) fn exact_at(&self, junction: usize) -> AtLine<Crossing<N>> {
        let exact = &self.exact[junction];
        if let Some(known) = exact.get() {
            return Ok(known.clone());
        }
        let made = self.made_exact_at(junction)?;
        Ok(exact.get_or_init(|| made).clone())
    }

    fn made_exact_at(&self, junction: usize) -> AtLine<Crossing<N>> {
        if self.are_eased[junction] {
            let eased = self.eased(junction, self.halves_mm(junction, |_| [0.0; 2]))?.into_iter();
            let fastest = eased.max_by(|one, other| one.feed_mm_s.total_cmp(&other.feed_mm_s));
            if let Some(fastest) = fastest {
                return Ok(fastest);
            }
        }
        let [before, after] = [junction, junction + 1]
            .map(|index| (&self.run.moves()[index], &self.ceilings[index].programmed));
        let elements = [&before.0.element, &after.0.element];
        let feed_mm_s = junction_feed(elements, self.run.kink_rad(junction).is_some(), self.machine);
        let feed_mm_s = feed_mm_s.min(before.1.feed_mm_s).min(after.1.feed_mm_s);
        Ok(Crossing { by: By::Itself, feed_mm_s })
    }

    /// A junction with each of its easements within `rooms_mm`.
    fn eased(&self, junction: usize, rooms_mm: [f64; 2]) -> AtLine<Vec<Crossing<N>>> {
        let easements = self.shapes.easements(&self.run, junction, rooms_mm);
        easements.iter().map(|eased| self.eased_by(junction, eased)).collect()
    }

    /// A junction with an easement.
    fn eased_by(
        &self,
        junction: usize,
        MeasuredEasement { easement, sides }: &MeasuredEasement<N>,
    ) -> AtLine<Crossing<N>> {
        let share = self.machine.path.curve_feed_share;
        let sides = sides.iter().map(|side| self.driven(junction, side, share));
        let mut sides = sides.collect::<AtLine<Vec<_>>>()?;
        // What meets there.
        let [before, after] = [junction, junction + 1].map(|index| &self.run.moves()[index].element);
        let met = match (&easement.elements[..], easement.trims_mm) {
            ([first, second], _) => [first, second],
            ([only], [_, 0.0]) => [only, after],
            ([only], _) => [before, only],
            _ => [before, after],
        };
        let junction_mm_s = junction_feed(met, true, self.machine);
        // Ramps have more of the limits below what they can reach from the junction.
        let most = [&self.ceilings[junction], &self.ceilings[junction + 1]].into_iter();
        let most = most.chain(sides.iter().map(|side| &side.ceilings)).map(|of| of.greatest.feed_mm_s);
        let most_mm_s = most.fold(junction_mm_s, f64::min);
        let trims_mm = easement.trims_mm[0] + easement.trims_mm[1];
        let reach_mm_s = (most_mm_s.powi(2) + 2.0 * self.shapes.limits().accel_mm_s2 * trims_mm).sqrt();
        for side in &mut sides {
            if side.ceilings.programmed.feed_mm_s > reach_mm_s {
                let reason = side.ceilings.programmed.reason;
                let MeasuredCurve { greatest, ratios, .. } = &*side.bent;
                let lowered = ceilings(reach_mm_s, greatest, ratios, share, self.machine);
                let lowered = lowered.map_err(|error| (self.run.moves()[junction].line, error.into()))?;
                let lowered = Ceiling { reason, ..lowered.programmed };
                side.ceilings = Ceilings { programmed: lowered, greatest: lowered, ..side.ceilings };
            }
        }
        if easement.trims_mm[0] > 0.0
            && let Some(first) = sides.first_mut()
        {
            first.end_mm_s = junction_mm_s;
        }
        let feeds = sides.iter().map(|side| side.ceilings.programmed.feed_mm_s);
        let feed_mm_s = feeds.fold(junction_mm_s, f64::min);
        Ok(Crossing { feed_mm_s, by: By::Easement(Rc::new(Eased { easement: easement.clone(), sides })) })
    }

    /// Adds the easements of a kink that might be passed under G61 to those that are compared; whether there are any. They are made
    /// for the room that the others, crossed as `chosen` says, leave, but at most half of either move: one that takes more leaves
    /// the next kink next to nothing.
    pub(super) fn add_easements(
        &self,
        compared: &mut Compared<'_, N>,
        junction: usize,
        chosen: &[Crossing<N>],
    ) -> AtLine<bool> {
        if !self.are_eased[junction] {
            return Ok(false);
        }
        let rooms_mm = self.halves_mm(junction, |junction| chosen[junction].trims_mm());
        let mut are_any = false;
        for size in EASEMENT_SIZES {
            for eased in self.eased(junction, rooms_mm.map(|room_mm| size * room_mm))? {
                compared.add(eased);
                are_any = true;
            }
        }
        Ok(are_any)
    }
}

#[cfg(test)]
mod tests {
    use motion_tests::random::Random;

    use super::*;
    use crate::machine::Machine;
    use crate::planning::ceilings::in_any_direction;
    use crate::planning::shapes::Shapes;
    use crate::toolpath::smooth::Run;
    use crate::toolpath::smooth::tests::path;

    /// An easement that lowers the feeds at the ends of a comparison lowers them for those before it, whenever these were planned.
    #[test]
    fn all_easements_are_compared_at_the_same_feeds() {
        let machine = Machine::reference();
        let mut random = Random::of_stream(73);
        let mut lowered = 0;
        for _ in 0..200 {
            let (mut at, mut heading_rad, mut points) = ([0.0, 0.0], 0.0_f64, vec![[0.0, 0.0]]);
            for _ in 0..8 {
                let length_mm = random.log(0.05, 5.0);
                let (sine, cosine) = libm::sincos(heading_rad);
                at = [at[0] + length_mm * cosine, at[1] + length_mm * sine];
                points.push(at);
                heading_rad += random.sign() * random.log(1e-4, 8e-3);
            }
            let feeds_mm_s: Vec<f64> = points.iter().map(|_| random.log(3.0, 100.0)).collect();
            let moves = path(&points, random.log(2e-3, 0.2), |line| feeds_mm_s[line as usize]);
            let shapes = Shapes::new(in_any_direction(&moves, &machine), machine.letters_by_place());
            let junctions = Junctions::new(Run::exact(&moves), &shapes, &machine).expect("limits");
            let count = junctions.run.junctions();
            let chosen: Vec<_> =
                (0..count).map(|junction| junctions.exact_at(junction).expect("limits")).collect();
            for junction in 0..count {
                let new = || Compared::new(&junctions.run, &junctions.ceilings, junction, &chosen);
                let (mut asked_each_time, mut asked_once) = (new(), new());
                let mut first_s = None;
                for size in EASEMENT_SIZES {
                    let rooms_mm = junctions.halves_mm(junction, |_| [0.0; 2]).map(|room_mm| size * room_mm);
                    for eased in junctions.eased(junction, rooms_mm).expect("limits") {
                        asked_each_time.add(eased.clone());
                        first_s.get_or_insert(asked_each_time.times_s()[0]);
                        asked_once.add(eased);
                    }
                }
                let times_s = asked_each_time.times_s();
                assert_eq!(times_s, asked_once.times_s());
                lowered += u32::from(first_s != times_s.first().copied());
            }
        }
        assert!(lowered > 20, "{lowered}");
    }
}
