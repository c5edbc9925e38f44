//! From the end of a search: on along the floor of its valley, and over to valleys that answer alike.
//!
//! A search stops where a floor is flat or curved, and ends in the nearest valley. Poles of the drive can be exchanged
//! with hardly another answer, so each exchange is a place to search from, and so is each valley that is found in this
//! way. What leads back to a valley that is known is left early.

use super::cholesky::Symmetric;
use super::confidence::floor;
use super::parameters::{Unknown, Unknowns, way};
use super::readings::{Precision, Runs};
use super::search::{Differences, Effort, Found, LAST_EFFORT, derivatives, is_met, search, search_unless};
use super::simulation::SUBSTEPS;

/// Over to a valley that answers alike, before it is judged.
pub(super) const EXCHANGED_EFFORT: Effort =
    Effort { precision: Precision::LAST, jacobians: 4, least_gain: 10.0, differences: Differences::OneSided };
/// A valley that is this much worse after a few steps is left.
pub(super) const NEAR: f64 = 3e4;
/// An end that is less than this worse is a rival: chance prefers the wrong one in one of a hundred cases.
const RIVAL: f64 = 9.0;
/// Difference in misfit below which more search may still decide.
pub(super) const UNDECIDED: f64 = 1e3;
/// Misfit for each reading beyond which a model has no valley worth looking beside.
const LOST: f64 = 100.0;
/// Valleys that answer alike, with which no further ones are looked for.
const VALLEYS_MAX: usize = 6;
/// A parabola tells the rise of misfit within its valley to this factor ...
const PARABOLA: f64 = 4.0;
/// ... and to what searches leave.
const SAME: f64 = 1.0;

/// Once more, of readings that were grouped or weighed anew.
pub(super) const SETTLING_EFFORT: Effort =
    Effort { jacobians: 5, differences: Differences::Central, ..LAST_EFFORT };

/// Kicks along the floor, in standard deviations, and the gain in misfit for which what follows is searched.
const KICKS: [f64; 4] = [-30.0, -9.0, 9.0, 30.0];
const KICKED_EFFORT: Effort =
    Effort { precision: Precision::LAST, jacobians: 2, least_gain: 10.0, differences: Differences::Central };
const KICK_GAIN: f64 = 0.5;
/// The same where the model does not follow: the floor is curved there, and a search stops far from its end.
const FAR_KICKS: [f64; 6] = [-100.0, -30.0, -9.0, 9.0, 30.0, 100.0];
const FAR_EFFORT: Effort = Effort { jacobians: 6, ..KICKED_EFFORT };
/// Most kicks after each other.
const KICKED_ROUNDS: usize = 4;

/// What was found by the last stages, or better if there is better near it; with its rivals.
pub(super) fn finished(runs: &Runs, found: Found, free: &[Unknown]) -> Option<Found> {
    if found.misfit() > LOST * runs.readings() {
        return Some(found);
    }
    // What answers alike is looked for from where the model follows, if it does anywhere.
    let found = if is_met(runs, &found) { found } else { kicked(runs, found, free)? };
    let found = with_rivals(runs, found, free)?;
    if is_met(runs, &found) { kicked(runs, found, free) } else { Some(found) }
}

/// What was found, or better if the search had stopped on its way along the floor of a valley. What follows may stop
/// there, too. Places where searches along the floor end, and that are hardly worse, are rivals: the floor is flat, and
/// rough.
fn kicked(runs: &Runs, mut found: Found, free: &[Unknown]) -> Option<Found> {
    let mut is_under_way = false;
    for _ in 0..KICKED_ROUNDS {
        let valley = Valley::of(runs, found.clone(), free)?;
        let ends = along(runs, &valley, free)?;
        let near = ends.iter().min_by(|a, b| a.misfit().total_cmp(&b.misfit()));
        match near.filter(|near| near.misfit() < found.misfit() - KICK_GAIN) {
            Some(near) => {
                // Before the model follows, the next kick goes on from there at once.
                is_under_way = !is_met(runs, near);
                let next =
                    if is_under_way { near.clone() } else { search(runs, near.unknowns, free, LAST_EFFORT)? };
                found = Found { rivals: found.rivals, ..next };
            }
            None => {
                let is_rival =
                    |end: &&Found| end.misfit() < found.misfit() + RIVAL && !valley.holds(end, free);
                let rivals: Vec<Unknowns> = ends.iter().filter(is_rival).map(|end| end.unknowns).collect();
                // What was kicked once more ends in the same places.
                found.rivals.retain(|known| !rivals.contains(known));
                found.rivals.extend(rivals);
                break;
            }
        }
    }
    if is_under_way {
        found = Found { rivals: found.rivals, ..search(runs, found.unknowns, free, LAST_EFFORT)? };
    }
    Some(found)
}

/// Where searches end that begin along the floor of the valley.
fn along(runs: &Runs, valley: &Valley, free: &[Unknown]) -> Option<Vec<Found>> {
    let lag_limit_s = runs.lag_limit_s();
    let floor = floor(&valley.information, free)?;
    let start = |deviations: &f64| {
        let steps = free.iter().zip(&floor);
        let moved = steps
            .fold(valley.end.unknowns, |start, (&unknown, step)| start.shifted(unknown, deviations * step));
        moved.bounded(free, lag_limit_s)
    };
    let from = |kicks: &[f64], effort: Effort| {
        kicks.iter().filter_map(|by| search(runs, start(by), free, effort)).collect()
    };
    let is_met = is_met(runs, &valley.end);
    Some(if is_met { from(&KICKS, KICKED_EFFORT) } else { from(&FAR_KICKS, FAR_EFFORT) })
}

/// A valley with its lowest known place.
struct Valley {
    end: Found,
    /// The curvature of its floor, by free unknown.
    information: Symmetric,
}

impl Valley {
    fn of(runs: &Runs, end: Found, free: &[Unknown]) -> Option<Self> {
        let (columns, _) = derivatives(runs, &end.unknowns, free, SUBSTEPS, true)?;
        let information = runs.weights(Precision::LAST).columns(&columns).normal();
        Some(Self { end, information })
    }

    /// By how much a place is worse than the end, if the floor is a parabola.
    fn rise(&self, to: &Unknowns, free: &[Unknown]) -> f64 {
        self.information.quadratic_form(&way(free, &self.end.unknowns, to))
    }

    /// Whether a place may lie in the valley: it is no lower there than the parabola tells. It is higher where a search is
    /// still on its way down to the floor.
    fn holds(&self, place: &Found, free: &[Unknown]) -> bool {
        let higher = (place.misfit() - self.end.misfit()).max(0.0);
        self.rise(&place.unknowns, free) < PARABOLA * higher + SAME
    }
}

/// The valleys that are known.
struct Valleys<'a> {
    runs: &'a Runs,
    free: &'a [Unknown],
    all: Vec<Valley>,
}

impl Valleys<'_> {
    /// Whether a search that has come to `place` is on its way back to a known end.
    fn is_back(&self, place: &Found) -> bool {
        let is_back =
            |valley: &Valley| place.misfit() >= valley.end.misfit() && valley.holds(place, self.free);
        self.all.iter().any(is_back)
    }

    /// An end: of a new valley, or a lower one of a known valley.
    fn add(&mut self, end: Found) {
        match self.all.iter_mut().find(|valley| valley.holds(&end, self.free)) {
            Some(valley) if end.misfit() < valley.end.misfit() => valley.end = end,
            Some(_) => {}
            None => self.all.extend(Valley::of(self.runs, end, self.free)),
        }
    }

    /// The lowest end, with those as rivals that are hardly worse.
    fn lowest(mut self) -> Option<Found> {
        self.all.sort_by(|a, b| a.end.misfit().total_cmp(&b.end.misfit()));
        let mut ends = self.all.into_iter().map(|valley| valley.end);
        let mut best = ends.next()?;
        let is_rival = |other: &Found| other.misfit() < best.misfit() + RIVAL;
        best.rivals = ends.filter(is_rival).map(|other| other.unknowns).collect();
        Some(best)
    }
}

/// The least of what was found and of the valleys that answer alike; those that are hardly worse are its rivals, beside those
/// that it has.
fn with_rivals(runs: &Runs, found: Found, free: &[Unknown]) -> Option<Found> {
    let lag_limit_s = runs.lag_limit_s();
    let (first, rivals) = (found.misfit(), found.rivals.clone());
    let mut valleys = Valleys { runs, free, all: vec![Valley::of(runs, found, free)?] };
    let mut next = 0;
    while next < valleys.all.len() && valleys.all.len() < VALLEYS_MAX {
        let near = &valleys.all[next].end;
        next += 1;
        // What answers alike may be reached only from what answers alike, but not from far off.
        if near.misfit() > first + UNDECIDED {
            continue;
        }
        for start in near.unknowns.exchanged() {
            let begun = search(runs, start.bounded(free, lag_limit_s), free, EXCHANGED_EFFORT);
            let begun = begun.filter(|begun| begun.misfit() < first + NEAR && !valleys.is_back(begun));
            // A lower end of a valley that is known is lost with it; kicks along the floor find that.
            let on = |begun: Found| {
                search_unless(runs, begun.unknowns, free, LAST_EFFORT, |place| valleys.is_back(place))
            };
            if let Some(end) = begun.and_then(on) {
                valleys.add(end);
            }
        }
    }
    let mut best = valleys.lowest()?;
    best.rivals.extend(rivals);
    Some(best)
}

/// What was found and its rivals, searched once more: of readings that were grouped anew.
pub(super) fn settled(runs: &Runs, found: &Found, free: &[Unknown]) -> Option<Found> {
    let end = search(runs, found.unknowns, free, SETTLING_EFFORT)?;
    if found.rivals.is_empty() {
        return Some(end);
    }
    let mut valleys = Valleys { runs, free, all: vec![Valley::of(runs, end, free)?] };
    for rival in &found.rivals {
        if let Some(end) = search(runs, *rival, free, SETTLING_EFFORT) {
            valleys.add(end);
        }
    }
    valleys.lowest()
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::sticking;
    use super::*;

    const FREE: [Unknown; 2] = [Unknown::Offset, Unknown::Viscous];

    fn found(offset: f64, viscous: f64, misfit: f64) -> Found {
        let unknowns = sticking().shifted(Unknown::Offset, offset).shifted(Unknown::Viscous, viscous);
        Found { unknowns, residuals: Vec::new(), misfits: vec![misfit], rivals: Vec::new() }
    }

    /// Of a floor that rises by 9·a² + 4·b².
    fn valley(end: Found) -> Valley {
        let mut information = Symmetric::zero(2);
        *information.at_mut(0, 0) = 9.0;
        *information.at_mut(1, 1) = 4.0;
        Valley { end, information }
    }

    #[test]
    fn a_valley_holds_what_its_parabola_tells() {
        let valley = valley(found(0.0, 0.0, 100.0));
        // 9·4 + 4·9 = 72 higher.
        assert!((valley.rise(&found(2.0, 3.0, 0.0).unknowns, &FREE) - 72.0).abs() < 1e-9);
        for (misfit, is_held) in [(172.0, true), (130.0, true), (400.0, true), (117.0, false), (105.0, false)]
        {
            assert_eq!(valley.holds(&found(2.0, 3.0, misfit), &FREE), is_held, "{misfit}");
        }
        assert!(valley.holds(&found(0.1, 0.1, 99.0), &FREE), "a lower end of the same valley");
    }

    #[test]
    fn ends_of_other_places_are_rivals_if_they_are_hardly_worse() {
        let runs = Runs::new(&[], 1e-3);
        let ends = [(0.0, 0.0, 100.0), (9.0, 0.0, 104.0), (0.0, 9.0, 98.0), (-9.0, 0.0, 120.0)];
        let all = ends.map(|(offset, viscous, misfit)| valley(found(offset, viscous, misfit)));
        let mut valleys = Valleys { runs: &runs, free: &FREE, all: all.into() };
        // Lower, and on its way back, in valleys that are known.
        valleys.add(found(9.05, 0.0, 103.0));
        assert!(valleys.is_back(&found(0.0, 10.0, 102.0)) && !valleys.is_back(&found(0.0, 9.05, 97.0)));
        let lowest = valleys.lowest().expect("an end");
        assert_eq!(lowest.misfit(), 98.0);
        assert_eq!(lowest.rivals, [found(0.0, 0.0, 0.0).unknowns, found(9.05, 0.0, 0.0).unknowns]);
    }
}
