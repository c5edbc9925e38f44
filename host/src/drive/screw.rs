//! Where the load is: place by place at rest, from both directions.
//!
//! Consumes the axis' range; produces the program that goes to the places ([`program`]), and [`ScrewReading`]s: from what an
//! instrument measured there ([`read`]), or from the simulated machine ([`measure`]), whose loads are known. Background.

use std::fmt::Write as _;

use super::AXES;
use super::experiment::{DriveError, within};
use super::recorded::RecordedError;
use super::rows;
use crate::chance::Chance;
use crate::gcode;
use crate::identify::ScrewReading;
use crate::machine::Machine;
use crate::planning::{Mode, plan_program};
use crate::simulate::hardware::{SimulatedHardware, simulated};
use crate::simulate::{Job, RunOptions, run_on};

/// The columns of CSV.
const HEADING: [&str; 2] = ["commanded_mm", "measured_mm"];
/// What is expected of the file, its heading, and a row.
const EXPECTED: [&str; 3] = [
    "CSV",
    "the heading commanded_mm,measured_mm",
    "two finite numbers: where the axis was told to be, and where its load was measured [mm]",
];
/// Turning points lie this far beyond the places, so that each is approached through the play \[mm\].
const BEYOND_MM: f64 = 1.5;
/// Places are anywhere within equal parts of the travel, as ISO 230-2 asks: then no error that repeats hides between them. They
/// are the same every time.
const PLACES_SEED: u64 = 230;
/// An overshoot would take up the play: slowly \[mm/s\].
const FEED_MM_S: f64 = 10.0;
/// How long an axis stands until it is at rest, in simulation \[s\].
const REST_S: f64 = 0.3;

/// Places along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// The axis, from 0.
    pub axis: usize,
    /// The ends, in machine coordinates \[mm\]; the places lie 1.5 mm within.
    pub ends_mm: [f64; 2],
    /// How many places.
    pub places: u32,
    /// How often they are gone to from both sides.
    pub rounds: u32,
    /// Rest at each place \[s\].
    pub rest_s: f64,
}

impl Survey {
    /// Checks the figures.
    ///
    /// # Errors
    /// The first one that is out of its range.
    pub fn check(&self) -> Result<(), DriveError> {
        let [low_mm, high_mm] = self.ends_mm;
        within("axis", self.axis as f64, (0.0, AXES as f64 - 1.0))?;
        within("places", f64::from(self.places), (4.0, 1000.0))?;
        within("rounds", f64::from(self.rounds), (1.0, 100.0))?;
        within("rest [s]", self.rest_s, (0.01, 3600.0))?;
        within("length of the travel [mm]", high_mm - low_mm, (4.0 * BEYOND_MM, 1e5))
    }

    /// Where the axis goes, in order: beyond the first place, up, beyond the last one, down, and so on \[mm\].
    #[must_use]
    pub fn stops_mm(&self) -> Vec<f64> {
        let [low_mm, high_mm] = self.ends_mm;
        let (first_mm, last_mm) = (low_mm + BEYOND_MM, high_mm - BEYOND_MM);
        let part_mm = (last_mm - first_mm) / f64::from(self.places);
        let mut chance = Chance(PLACES_SEED);
        let mut places_mm: Vec<f64> = (0..self.places)
            // As programs say it.
            .map(|part| ((first_mm + part_mm * (f64::from(part) + chance.unit())) * 1e4).round() / 1e4)
            .collect();
        places_mm.dedup();
        let up = || places_mm.iter().copied();
        let round = || up().chain([high_mm]).chain(up().rev()).chain([low_mm]);
        core::iter::once(low_mm).chain((0..self.rounds).flat_map(|_| round())).collect()
    }
}

/// The program that goes to the places, in machine coordinates.
#[must_use]
pub fn program(machine: &Machine, survey: &Survey) -> String {
    let settings = &machine.axes[survey.axis.min(AXES - 1)];
    let letter = ["X", "Y", "Z"][survey.axis.min(AXES - 1)];
    let feed_mm_min = 60.0 * FEED_MM_S.min(settings.feed_mm_s).min(machine.path.feed_mm_s);
    let mut text = format!(
        "(screw of axis {}: without compensation; measure where the load is at every rest, the first one included)\nG21 G90 G94 G61\n",
        settings.name
    );
    for stop_mm in survey.stops_mm() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "G53 G1 {letter}{stop_mm:.4} F{feed_mm_min:.3}\nG4 P{}", survey.rest_s);
    }
    text.push_str("M2\n");
    text
}

/// Goes to the places on the simulated machine, without the axis' compensation, and measures the load there.
///
/// # Errors
/// The program can't be planned or run, or a fault ended it.
pub fn measure(machine: &Machine, survey: &Survey) -> Result<Vec<ScrewReading>, DriveError> {
    let survey = Survey { rest_s: REST_S, ..*survey };
    survey.check()?;
    let axis = survey.axis;
    let mut machine = machine.clone();
    machine.axes[axis].compensation = None;
    let experiment = format!("screw of axis {}", machine.axes[axis].name);
    let program = gcode::read(&experiment, program(&machine, &survey).as_bytes())?;
    let plan = plan_program(&experiment, &program, &machine, Mode::Spanning)?;
    let job = Job::new(&RunOptions::default(), &plan, &machine)?;
    let plant = simulated(&machine)?;
    let mut hardware = SimulatedHardware::new(&plant)?;
    let mut at_rest: Vec<[f64; 2]> = Vec::new();
    let mut was_at_rest = false;
    let summary = run_on(&job, &mut hardware, &mut |row| {
        let is_at_rest = row.state == "dwell";
        if is_at_rest {
            let here = [row.axes[axis].set_mm, plant.truth()[axis].position_mm];
            match at_rest.last_mut() {
                Some(last) if was_at_rest => *last = here,
                _ => at_rest.push(here),
            }
        }
        was_at_rest = is_at_rest;
    })?;
    match summary.faults.into_iter().next() {
        Some(fault) => Err(DriveError::Fault { experiment, fault }),
        None => Ok(directed(&at_rest)),
    }
}

/// Reads what an instrument measured: CSV with the heading commanded_mm,measured_mm, the rows in the order of the motion.
///
/// # Errors
/// The text is no such CSV.
pub fn read(name: &str, bytes: &[u8]) -> Result<Vec<ScrewReading>, RecordedError> {
    let rows = rows::read(name, bytes, HEADING, EXPECTED)?;
    if let Some([_, (line, [commanded_mm, _])]) = rows.windows(2).find(|pair| pair[0].1[0] == pair[1].1[0]) {
        return Err(RecordedError::Line {
            name: name.to_owned(),
            line: *line,
            found: format!("{commanded_mm} mm, as in the row before"),
            expected: "a row for each rest, turning points too: they say from which side a place was come to",
        });
    }
    Ok(directed(&rows.into_iter().map(|(_, row)| row).collect::<Vec<_>>()))
}

/// Readings in the order of the motion, each with the direction in which its place was reached; the first has none.
fn directed(readings: &[[f64; 2]]) -> Vec<ScrewReading> {
    let mut before: Option<f64> = None;
    readings
        .iter()
        .map(|&[commanded_mm, measured_mm]| {
            let is_from_above = before.map(|before_mm| commanded_mm < before_mm);
            before = Some(commanded_mm);
            ScrewReading { commanded_mm, measured_mm, is_from_above }
        })
        .collect()
}
