//! Quantities over time, as the lowest and highest value of so many ticks each.
//!
//! Consumes values by tick; produces whole numbers of steps, two for a sample, or one where a sample is one tick. The lowest and
//! the highest value of a sample are values that its ticks had, to half a step, so no peak is lost and none is invented. The
//! page makes all coarser samples from these.

use super::column::{self, Column};

/// Steps to the greatest magnitude of a quantity: a plot would have to be 16 000 pixels high to show them.
const STEPS: f64 = (1 << 13) as f64;
/// The same where every tick has a sample of its own, which costs little.
const FINE_STEPS: f64 = (1 << 16) as f64;

/// Ticks of a run, as samples divide them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Division {
    /// The first tick.
    pub(super) first_tick: u64,
    /// How many ticks there are; some may be missing in between.
    pub(super) ticks: u64,
    /// Ticks that a sample spans, a power of two.
    pub(super) ticks_per_sample: u64,
}

impl Division {
    /// How many samples there are.
    pub(super) fn samples(self) -> usize {
        self.ticks.div_ceil(self.ticks_per_sample) as usize
    }
}

/// How finely a quantity is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Resolution {
    /// As a part of its greatest magnitude.
    Relative,
    /// In steps of this, or coarser where numbers would not hold the quantity.
    Step(f64),
}

/// Appends a quantity's columns, `name` with the lowest values and, where a sample is more than a tick, `name+` with the
/// highest. Values that are not finite have no part in it. A sample without any value has a low above its high.
pub(super) fn write(
    bytes: &mut Vec<u8>,
    name: &str,
    resolution: Resolution,
    division: Division,
    values: impl Iterator<Item = (u64, f64)>,
) -> Vec<Column> {
    let mut samples = vec![(f64::INFINITY, f64::NEG_INFINITY); division.samples()];
    for (tick, value) in values.filter(|(_, value)| value.is_finite()) {
        let index = tick.saturating_sub(division.first_tick) / division.ticks_per_sample;
        if let Some((low, high)) = samples.get_mut(index as usize) {
            (*low, *high) = (low.min(value), high.max(value));
        }
    }
    let magnitude =
        samples.iter().fold(
            0.0_f64,
            |most, &(low, high)| {
                if low > high { most } else { most.max(low.abs()).max(high.abs()) }
            },
        );
    let is_single = division.ticks_per_sample == 1;
    let step = match resolution {
        Resolution::Relative => magnitude / if is_single { FINE_STEPS } else { STEPS },
        Resolution::Step(step) => step.max(magnitude / f64::from(1 << 30)),
    };
    // A quantity that is nothing but 0.
    let step = if step > 0.0 { step } else { 1.0 };
    let numbers = |of: fn(&(f64, f64)) -> f64, none: i32| -> Vec<i32> {
        let number = |sample: &(f64, f64)| {
            let is_empty = sample.0 > sample.1;
            if is_empty { none } else { (of(sample) / step).round() as i32 }
        };
        samples.iter().map(number).collect()
    };
    let mut columns =
        vec![column::write(bytes, name.to_owned(), step, &numbers(|sample| sample.0, i32::MAX))];
    if !is_single {
        columns.push(column::write(bytes, format!("{name}+"), step, &numbers(|sample| sample.1, i32::MIN)));
    }
    columns
}

#[cfg(test)]
mod tests {
    use motion_tests::random::Random;

    use super::super::column::tests::read;
    use super::*;

    /// Every sample has the lowest and the highest value of its ticks, and no other.
    #[test]
    fn no_peak_is_lost_and_none_is_invented() {
        let mut random = Random::of_stream(22);
        for _ in 0..200 {
            let ticks = 1 + random.below(3000) as u64;
            let ticks_per_sample = 1 << random.below(8);
            let division = Division { first_tick: random.below(1000) as u64, ticks, ticks_per_sample };
            let size = random.log(1e-9, 1e9);
            let value = |random: &mut Random| match random.below(40) {
                0 => f64::NAN,
                1 => 30.0 * size * random.sign(),
                _ => random.between(-size, size),
            };
            let mut values: Vec<(u64, f64)> =
                (0..ticks).map(|tick| (division.first_tick + tick, value(&mut random))).collect();
            // A log may lack some.
            values.retain(|_| !random.once_in(10));
            let mut bytes = Vec::new();
            let columns = write(&mut bytes, "q", Resolution::Relative, division, values.iter().copied());
            let step = column_step(&columns[0]);
            let json = |column: &Column| serde_json::to_value(column).expect("JSON");
            let [low, high] =
                [&columns[0], columns.last().expect("one")].map(|column| read(&bytes, &json(column)));
            assert_eq!(low.len(), division.samples());
            for (index, (low, high)) in low.into_iter().zip(high).enumerate() {
                let of_sample = values.iter().filter(|(tick, value)| {
                    value.is_finite() && (tick - division.first_tick) / ticks_per_sample == index as u64
                });
                let span = of_sample.fold(None, |span, &(_, value)| {
                    let (low, high) = span.unwrap_or((value, value));
                    Some((low.min(value), high.max(value)))
                });
                match span {
                    None => assert!(low == i32::MAX && (high == i32::MIN || ticks_per_sample == 1)),
                    Some((least, greatest)) => {
                        let half = 0.5000001 * step;
                        assert!((f64::from(low) * step - least).abs() <= half, "{low} {least} {step}");
                        assert!(
                            (f64::from(high) * step - greatest).abs() <= half,
                            "{high} {greatest} {step}"
                        );
                        assert!(step <= 30.0 * size / STEPS);
                    }
                }
            }
        }
    }

    fn column_step(column: &Column) -> f64 {
        serde_json::to_value(column).expect("JSON")["step"].as_f64().expect("a number")
    }

    #[test]
    fn nothing_and_zero_have_a_step() {
        let division = Division { first_tick: 0, ticks: 4, ticks_per_sample: 2 };
        for values in [vec![], vec![(0, 0.0), (1, f64::INFINITY)]] {
            let columns = write(&mut Vec::new(), "q", Resolution::Relative, division, values.into_iter());
            assert_eq!(column_step(&columns[0]), 1.0);
        }
        let far = write(&mut Vec::new(), "q", Resolution::Step(1e-4), division, [(0, 1e9)].into_iter());
        assert!(column_step(&far[0]) > 0.9);
    }
}
