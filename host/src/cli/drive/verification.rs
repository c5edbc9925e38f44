//! Circles before and after tuning, in as many planes as let every tuned axis move.

use std::io::{self, Write};

use serde::Serialize;

use super::super::error::CliError;
use super::super::progress::Progress;
use super::super::table::{self, Align};
use crate::drive::circle::{CircleFigures, Sweep, figures};
use crate::drive::reference::CIRCLE_FEED_MM_S;
use crate::drive::verification::{VERIFIED_HZ, circle, is_no_worse, planes};
use crate::gcode::Plane;
use crate::machine::Machine;
use crate::report::{self, drive::Shown};

/// Frequencies whose circles the report draws \[Hz\].
const SHOWN_HZ: [f64; 2] = [4.0, 13.0];
/// The contour error that S4 asks for \[µm\].
const LIMIT_UM: f64 = 20.0;

/// Circles before and after.
pub(super) struct Verification {
    planes: Vec<Verified>,
    shown: Vec<Shown>,
}

/// The circles of one plane.
struct Verified {
    /// Which of the plane's axes were tuned.
    is_tuned: [bool; 2],
    before: Sweep,
    after: Sweep,
}

impl Verified {
    fn pairs(&self) -> impl Iterator<Item = (&CircleFigures, &CircleFigures)> {
        self.before.circles.iter().zip(&self.after.circles)
    }

    /// Whether no circle got worse, but for the encoders' rounding.
    fn is_better(&self) -> bool {
        self.pairs().all(|(before, after)| is_no_worse(&self.after.machine, self.is_tuned, before, after))
    }
}

impl Verification {
    /// Drives the circles on the machine `before` and `after` tuning the axes `tuned`.
    ///
    /// # Errors
    /// A circle can't be driven.
    pub(super) fn new(before: &Machine, after: &Machine, tuned: &[usize]) -> Result<Self, CliError> {
        let planes = planes(tuned);
        let mut progress = Progress::new((2 * planes.len() * VERIFIED_HZ.len()) as u64);
        let mut shown = Vec::new();
        let mut sweep = |name: &'static str, machine: &Machine, plane: Plane| -> Result<Sweep, CliError> {
            let mut circles = Vec::with_capacity(VERIFIED_HZ.len());
            for frequency_hz in VERIFIED_HZ {
                let circle = circle(plane, frequency_hz);
                let recording = circle.record(machine)?;
                circles.push(figures(&recording, &circle)?);
                if SHOWN_HZ.contains(&frequency_hz) {
                    shown.push((name, circle, recording));
                }
                progress.step();
            }
            let within = |figures: &&CircleFigures| figures.contour_um() <= LIMIT_UM;
            let limit_hz = circles.iter().take_while(within).last().map(|figures| figures.frequency_hz);
            Ok(Sweep { name, machine: machine.clone(), circles, limit_hz })
        };
        let mut verified = Vec::with_capacity(planes.len());
        for plane in planes {
            let [was, is] = match plane {
                Plane::Xy => ["before, XY", "after, XY"],
                Plane::Zx => ["before, ZX", "after, ZX"],
                Plane::Yz => ["before, YZ", "after, YZ"],
            };
            let [first, second, _] = plane.axes();
            let is_tuned = [first, second].map(|axis| tuned.contains(&axis));
            let (before, after) = (sweep(was, before, plane)?, sweep(is, after, plane)?);
            verified.push(Verified { is_tuned, before, after });
        }
        progress.finish();
        Ok(Self { planes: verified, shown })
    }

    /// Whether no circle got worse.
    pub(super) fn is_better(&self) -> bool {
        self.planes.iter().all(Verified::is_better)
    }

    /// The page of the circles.
    pub(super) fn write_report(&self, machine: &Machine, out: &mut impl Write) -> io::Result<()> {
        let sweeps: Vec<Sweep> =
            self.planes.iter().flat_map(|plane| [plane.before.clone(), plane.after.clone()]).collect();
        report::drive::write_circle(machine, &sweeps, LIMIT_UM, &self.shown, &[], out)
    }

    /// A table of each plane.
    pub(super) fn write_words(&self, out: &mut dyn Write) -> io::Result<()> {
        for plane in &self.planes {
            let axes = plane.after.circles.first().map_or([0, 1], |circle| circle.axes);
            let [first, second] = axes.map(|axis| plane.after.machine.axes[axis].name.as_str());
            writeln!(
                out,
                "Circles of {first} and {second} at {:.0} mm/min, before and after\n",
                CIRCLE_FEED_MM_S * 60.0
            )?;
            let columns = [
                ("frequency", "Hz", Align::Right),
                ("contour", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("form deviation", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("following, first axis", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("second axis", "µm", Align::Right),
                ("", "µm", Align::Right),
            ];
            let rows: Vec<[String; 9]> = plane
                .pairs()
                .map(|(before, after)| {
                    let um = |value: f64| format!("{value:.2}");
                    [
                        before.frequency_hz.to_string(),
                        um(before.contour_um()),
                        um(after.contour_um()),
                        um(before.form_um()),
                        um(after.form_um()),
                        um(before.following_um[0]),
                        um(after.following_um[0]),
                        um(before.following_um[1]),
                        um(after.following_um[1]),
                    ]
                })
                .collect();
            table::write(&columns, &rows, out)?;
            writeln!(out)?;
        }
        Ok(())
    }

    /// The figures as JSON.
    pub(super) fn json(&self) -> VerificationJson {
        let circle = |figures: &CircleFigures| CircleJson {
            contour_error_um: figures.contour_um(),
            form_deviation_um: figures.form_um(),
            following_error_first_um: figures.following_um[0],
            following_error_second_um: figures.following_um[1],
        };
        let pair = |(before, after): (&CircleFigures, &CircleFigures), machine: &Machine| PairJson {
            axes: before.axes.map(|axis| machine.axes[axis].name.clone()),
            frequency_hz: before.frequency_hz,
            before: circle(before),
            after: circle(after),
        };
        let pairs = |plane: &Verified| -> Vec<PairJson> {
            plane.pairs().map(|both| pair(both, &plane.after.machine)).collect()
        };
        VerificationJson {
            feed_mm_min: CIRCLE_FEED_MM_S * 60.0,
            circles: self.planes.iter().flat_map(pairs).collect(),
        }
    }
}

#[derive(Serialize)]
pub(super) struct VerificationJson {
    feed_mm_min: f64,
    circles: Vec<PairJson>,
}

#[derive(Serialize)]
struct PairJson {
    axes: [String; 2],
    frequency_hz: f64,
    before: CircleJson,
    after: CircleJson,
}

#[derive(Serialize)]
struct CircleJson {
    contour_error_um: f64,
    form_deviation_um: f64,
    following_error_first_um: f64,
    following_error_second_um: f64,
}
