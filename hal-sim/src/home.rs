//! Home switches and index pulses of simulated axes.
//!
//! Consumes, once per tick, the axes' true positions and their counts; produces the state of each switch, and the
//! count at the first index since a latch was armed. Constant cost, cannot fail.

use core::convert::Infallible;

use motion_kernel::hal::{IndexLatch, MachineInputs};
use motion_kernel::units::Counts;

/// A switch that is closed over a length of the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchParameters {
    /// The range in which it is closed \[mm\], lesser position first.
    pub closes_mm: (f64, f64),
    /// How far outside of that range it opens \[mm\], 0 or more.
    pub hysteresis_mm: f64,
}

/// A periodic index pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexParameters {
    /// Counts per revolution, above 0.
    pub counts: i64,
    /// The count at one of the pulses.
    pub at: Counts,
}

/// Switch and index of an axis; a broken one is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HomeParameters {
    /// The switch; without it the input stays open.
    pub switch: Option<SwitchParameters>,
    /// The index; without it nothing is latched.
    pub index: Option<IndexParameters>,
}

/// The state of switch and index.
#[derive(Clone, Debug)]
pub struct SimHome {
    parameters: HomeParameters,
    is_closed: bool,
    counts: Counts,
    is_armed: bool,
    latched: Option<Counts>,
}

impl SimHome {
    /// An axis that stands at `position_mm`, where its encoder reads `counts`.
    #[must_use]
    pub fn new(parameters: HomeParameters, position_mm: f64, counts: Counts) -> Self {
        let mut home = Self { parameters, is_closed: false, counts, is_armed: false, latched: None };
        home.advance(position_mm, counts);
        home
    }

    /// Advances by a tick that ended at `position_mm`, where the encoder reads `counts`.
    pub fn advance(&mut self, position_mm: f64, counts: Counts) {
        if let Some(SwitchParameters { closes_mm: (least, greatest), hysteresis_mm }) = self.parameters.switch
        {
            let margin_mm = if self.is_closed { hysteresis_mm } else { 0.0 };
            self.is_closed = position_mm >= least - margin_mm && position_mm <= greatest + margin_mm;
        }
        if let Some(IndexParameters { counts: revolution, at }) = self.parameters.index
            && let Some(index) = first_index(self.counts, counts, revolution, at)
            && self.is_armed
        {
            (self.is_armed, self.latched) = (false, Some(index));
        }
        self.counts = counts;
    }

    /// Whether the switch is closed.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Whether the axis has index pulses.
    #[must_use]
    pub const fn has_index(&self) -> bool {
        self.parameters.index.is_some()
    }

    /// Waits for the next index.
    pub fn arm(&mut self) {
        (self.is_armed, self.latched) = (true, None);
    }

    /// The count at the first index since the latch was armed.
    #[must_use]
    pub fn latched(&self) -> Option<Counts> {
        self.latched
    }
}

/// The axes of a machine, with what those that can be homed have for it.
#[derive(Clone, Debug)]
pub struct SimHomes<const AXES: usize>([Option<SimHome>; AXES]);

impl<const AXES: usize> SimHomes<AXES> {
    /// No axis can be homed.
    pub const NONE: Self = Self([const { None }; AXES]);

    /// Those of each axis.
    #[must_use]
    pub const fn new(homes: [Option<SimHome>; AXES]) -> Self {
        Self(homes)
    }

    /// The switch and index of an axis; none if it can't be homed.
    pub fn get_mut(&mut self, axis: usize) -> Option<&mut SimHome> {
        self.0.get_mut(axis)?.as_mut()
    }

    /// Advances all by a tick, to where `position_mm` says that an axis is; where it does not, nothing changes.
    pub fn advance(&mut self, position_mm: impl Fn(usize) -> Option<f64>, counts: [Counts; AXES]) {
        for ((axis, home), counts) in self.0.iter_mut().enumerate().zip(counts) {
            if let Some(home) = home
                && let Some(position_mm) = position_mm(axis)
            {
                home.advance(position_mm, counts);
            }
        }
    }

    /// The inputs, with the switches of those axes that have one.
    #[must_use]
    pub fn with_switches(&self, mut inputs: MachineInputs<AXES>) -> MachineInputs<AXES> {
        for (axis, home) in inputs.axes.iter_mut().zip(&self.0) {
            if let Some(home) = home {
                *axis = axis.with_home(home.is_closed());
            }
        }
        inputs
    }
}

/// Of an axis without one nothing is latched.
impl<const AXES: usize> IndexLatch for SimHomes<AXES> {
    type Error = Infallible;

    fn arm(&mut self, axis: usize) -> Result<(), Infallible> {
        if let Some(home) = self.get_mut(axis) {
            home.arm();
        }
        Ok(())
    }

    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, Infallible> {
        Ok(self.get_mut(axis).and_then(|home| home.latched()))
    }
}

/// The first index that was reached between two counts: the same count from either side.
fn first_index(Counts(before): Counts, Counts(now): Counts, revolution: i64, at: Counts) -> Option<Counts> {
    // A revolution has a count at least.
    let revolutions = |counts: i64| (counts - at.0).checked_div_euclid(revolution).unwrap_or_default();
    if now > before {
        let next = (revolutions(before) + 1) * revolution + at.0;
        (next <= now).then_some(Counts(next))
    } else {
        // The last one below `before`.
        let last = revolutions(before - 1) * revolution + at.0;
        (now < before && last >= now).then_some(Counts(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_index_from_either_side() {
        let at = |before, now| first_index(Counts(before), Counts(now), 100, Counts(7)).map(|Counts(at)| at);
        // Against looking at every count.
        for before in -250_i64..250 {
            for now in -250..250 {
                let is_index = |counts: &i64| (counts - 7) % 100 == 0;
                let expected = if now >= before {
                    (before + 1..=now).find(is_index)
                } else {
                    (now..before).rev().find(is_index)
                };
                assert_eq!(at(before, now), expected, "{before} to {now}");
            }
        }
    }

    #[test]
    fn a_switch_opens_further_out_than_it_closes() {
        let switch = Some(SwitchParameters { closes_mm: (10.0, 12.0), hysteresis_mm: 0.5 });
        let mut home = SimHome::new(HomeParameters { switch, index: None }, 0.0, Counts(0));
        let way = [(9.9, false), (10.0, true), (9.6, true), (9.4, false), (9.9, false), (12.4, false)];
        for (position_mm, is_closed) in way.into_iter().chain([(11.0, true), (12.4, true), (12.6, false)]) {
            home.advance(position_mm, Counts(0));
            assert_eq!(home.is_closed(), is_closed, "{position_mm} mm");
        }
        let index = Some(IndexParameters { counts: 100, at: Counts(30) });
        let mut home = SimHome::new(HomeParameters { switch: None, index }, 11.0, Counts(0));
        home.advance(11.0, Counts(50));
        assert_eq!((home.is_closed(), home.latched()), (false, None));
        home.arm();
        home.advance(11.0, Counts(250));
        home.advance(11.0, Counts(450));
        assert_eq!(home.latched(), Some(Counts(130)));
    }
}
