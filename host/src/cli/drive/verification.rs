//! Circles before and after tuning, in as many planes as let every tuned axis move.
//!
//! Every circle stays within what its axes bear: the feed of S4's circles, or less where the outputs or the current
//! limits that were found do not reach it. A circle that can't be driven all the same is named and not judged.

use std::io::{self, Write};

use serde::Serialize;

use super::super::progress::Progress;
use super::super::table::{self, Align};
use crate::drive::DriveError;
use crate::drive::circle::{CircleFigures, figures};
use crate::drive::reference::CIRCLE_FEED_MM_S;
use crate::drive::verification::{VERIFIED_HZ, Verdict, circle, planes};
use crate::machine::Machine;
use crate::report::drive::{self as drawn, Around};

/// Circles before and after.
pub(super) struct Verification {
    /// The machine after tuning.
    machine: Machine,
    planes: Vec<Verified>,
    shown: Vec<Around>,
    not_driven: Vec<NotDriven>,
}

/// A circle that was not driven as it should.
#[derive(Clone, Debug, Serialize)]
pub(super) struct NotDriven {
    axes: [String; 2],
    frequency_hz: f64,
    feed_mm_min: f64,
    reason: String,
    /// Whether the machine could drive it before, and no more.
    #[serde(skip)]
    is_worse: bool,
}

/// The circles of one plane.
struct Verified {
    axes: [usize; 2],
    /// Which of the plane's axes were tuned.
    is_tuned: [bool; 2],
    before: Vec<CircleFigures>,
    after: Vec<CircleFigures>,
}

impl Verified {
    fn pairs(&self) -> impl Iterator<Item = (&CircleFigures, &CircleFigures)> {
        self.before.iter().zip(&self.after)
    }

    fn verdict<'a>(&self, machine: &'a Machine) -> Verdict<'a> {
        Verdict { machine, is_tuned: self.is_tuned }
    }
}

impl Verification {
    /// Drives the circles on the machine `before` and `after` tuning the axes `tuned`, within the accelerations
    /// that they bear \[mm/s²\], as far as that was found.
    pub(super) fn new(
        before: &Machine,
        after: &Machine,
        tuned: &[usize],
        bears_mm_s2: &[Option<f64>],
    ) -> Self {
        let planes = planes(tuned);
        let mut progress = Progress::new((planes.len() * VERIFIED_HZ.len()) as u64);
        let mut shown = Vec::new();
        let mut not_driven = Vec::new();
        let mut verified = Vec::with_capacity(planes.len());
        for plane in planes {
            let [first, second, _] = plane.axes();
            let axes = [first, second];
            let names = axes.map(|axis| after.axes[axis].name.clone());
            let of_tuned = tuned.iter().zip(bears_mm_s2).filter(|(axis, _)| axes.contains(axis));
            let bears_mm_s2 = of_tuned.filter_map(|(_, bears)| *bears).fold(f64::INFINITY, f64::min);
            let mut circles = [Vec::new(), Vec::new()];
            for frequency_hz in VERIFIED_HZ {
                let not = |feed_mm_s: f64, reason: String, is_worse| NotDriven {
                    axes: names.clone(),
                    frequency_hz,
                    feed_mm_min: feed_mm_s * 60.0,
                    reason,
                    is_worse,
                };
                let (circle, slower) = circle(plane, frequency_hz, before, bears_mm_s2);
                let feed_mm_s = circle.feed_mm_s;
                if let Some(reason) = slower {
                    let slower = format!("{reason}: driven at {:.0} mm/min instead", feed_mm_s * 60.0);
                    not_driven.push(not(CIRCLE_FEED_MM_S, slower, false));
                }
                let drive = |name: &str, machine: &Machine| {
                    let recording = circle.record(machine)?;
                    Ok((figures(&recording, &circle)?, Around::of(name, &circle, &recording)?))
                };
                let both: [Result<_, DriveError>; 2] = [drive("before", before), drive("after", after)];
                progress.step();
                match both {
                    [Ok(before), Ok(after)] => {
                        for ((figures, around), circles) in [before, after].into_iter().zip(&mut circles) {
                            circles.push(figures);
                            shown.push(around);
                        }
                    }
                    [Err(error), _] => not_driven.push(not(feed_mm_s, format!("before: {error}"), false)),
                    [Ok(_), Err(error)] => not_driven.push(not(feed_mm_s, format!("after: {error}"), true)),
                }
            }
            let [of_before, of_after] = circles;
            let is_tuned = axes.map(|axis| tuned.contains(&axis));
            verified.push(Verified { axes, is_tuned, before: of_before, after: of_after });
        }
        progress.finish();
        Self { machine: after.clone(), planes: verified, shown, not_driven }
    }

    /// Why the machine is not better, if it is not.
    pub(super) fn reason(&self) -> Option<String> {
        if let Some(lost) = self.not_driven.iter().find(|circle| circle.is_worse) {
            return Some(format!(
                "the circle at {} Hz can't be driven any more, {}",
                lost.frequency_hz, lost.reason
            ));
        }
        if self.planes.iter().all(|plane| plane.before.is_empty()) {
            return Some("no circle could be driven, so nothing was verified".to_owned());
        }
        self.planes.iter().find_map(|plane| {
            let verdict = plane.verdict(&self.machine);
            let (before, after) =
                plane.pairs().find(|(before, after)| !verdict.is_no_worse(before, after))?;
            Some(format!(
                "the circle at {} Hz got worse: {:.2} µm before, {:.2} µm after",
                before.frequency_hz,
                verdict.judged_um(before),
                verdict.judged_um(after)
            ))
        })
    }

    /// What a page shows of it: the circles by plane, those that were not driven, and those that are drawn.
    pub(super) fn shown(&self) -> (Vec<drawn::Circles<'_>>, Vec<drawn::NotDriven<'_>>, &[Around]) {
        let circles = self.planes.iter().map(|plane| {
            let verdict = plane.verdict(&self.machine);
            let pairs =
                plane.pairs().map(|(before, after)| (before, after, !verdict.is_no_worse(before, after)));
            drawn::Circles { axes: plane.axes, pairs: pairs.collect() }
        });
        let not_driven = self.not_driven.iter().map(|circle| drawn::NotDriven {
            axes: &circle.axes,
            frequency_hz: circle.frequency_hz,
            feed_mm_min: circle.feed_mm_min,
            reason: &circle.reason,
        });
        (circles.collect(), not_driven.collect(), &self.shown)
    }

    /// A table of each plane.
    pub(super) fn write_words(&self, out: &mut dyn Write) -> io::Result<()> {
        for plane in &self.planes {
            let [first, second] = plane.axes.map(|axis| self.machine.axes[axis].name.as_str());
            writeln!(out, "Circles of {first} and {second}, before and after\n")?;
            let columns = [
                ("frequency", "Hz", Align::Right),
                ("feed", "mm/min", Align::Right),
                ("contour", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("form deviation", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("following, first axis", "µm", Align::Right),
                ("", "µm", Align::Right),
                ("second axis", "µm", Align::Right),
                ("", "µm", Align::Right),
            ];
            let rows: Vec<[String; 10]> = plane
                .pairs()
                .map(|(before, after)| {
                    let [a, b, c, d, e, f, g, h] =
                        before.errors_um_beside(after).map(|um| format!("{um:.2}"));
                    let feed = format!("{:.0}", before.feed_mm_s * 60.0);
                    [before.frequency_hz.to_string(), feed, a, b, c, d, e, f, g, h]
                })
                .collect();
            table::write(&columns, &rows, out)?;
            writeln!(out)?;
        }
        for NotDriven { axes: [first, second], frequency_hz, feed_mm_min, reason, .. } in &self.not_driven {
            writeln!(
                out,
                "  {first} and {second} at {frequency_hz} Hz and {feed_mm_min:.0} mm/min: {reason}"
            )?;
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
            feed_mm_min: before.feed_mm_s * 60.0,
            before: circle(before),
            after: circle(after),
        };
        let pairs = |plane: &Verified| -> Vec<PairJson> {
            plane.pairs().map(|both| pair(both, &self.machine)).collect()
        };
        VerificationJson {
            feed_mm_min: CIRCLE_FEED_MM_S * 60.0,
            circles: self.planes.iter().flat_map(pairs).collect(),
            not_driven: self.not_driven.clone(),
        }
    }
}

#[derive(Serialize)]
pub(super) struct VerificationJson {
    feed_mm_min: f64,
    circles: Vec<PairJson>,
    not_driven: Vec<NotDriven>,
}

#[derive(Serialize)]
struct PairJson {
    axes: [String; 2],
    frequency_hz: f64,
    feed_mm_min: f64,
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
