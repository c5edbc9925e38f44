//! Figures over many programs: counts, and the worst ratio of every check to its bound.

use std::collections::BTreeMap;

#[derive(Clone, Debug, Default)]
pub struct Totals {
    pub programs: u64,
    pub moves: u64,
    pub ticks: u64,
    /// Refused by planning because more would fall into one tick than its bound.
    pub refused: BTreeMap<String, u64>,
    /// Found value over its bound, the greatest of all; above 1 a check has failed.
    pub worst: BTreeMap<&'static str, (f64, u64)>,
}

impl Totals {
    pub fn add(&mut self, other: &Self) {
        self.programs += other.programs;
        self.moves += other.moves;
        self.ticks += other.ticks;
        for (reason, count) in &other.refused {
            *self.refused.entry(reason.clone()).or_default() += count;
        }
        for (&name, &(ratio, seed)) in &other.worst {
            let worst = self.worst.entry(name).or_default();
            if ratio > worst.0 {
                *worst = (ratio, seed);
            }
        }
    }

    pub fn worst(&mut self, name: &'static str, ratio: f64, seed: u64) {
        let worst = self.worst.entry(name).or_default();
        if ratio > worst.0 {
            *worst = (ratio, seed);
        }
    }
}

impl std::fmt::Display for Totals {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "{} programs, {} moves, {} ticks; refused {:?}",
            self.programs, self.moves, self.ticks, self.refused
        )?;
        for (name, (ratio, seed)) in &self.worst {
            writeln!(f, "  {name}: {ratio:.9} of its bound at seed {seed}")?;
        }
        Ok(())
    }
}
