//! The page of the Bode plot: three methods.

use super::super::figure::Series;
use super::super::findings::Findings;
use super::super::format::figure;
use super::super::palette;
use super::{db, open, over_frequency};
use crate::drive::bode::{Bode, BodePoint};
use crate::machine::Machine;

const WORDS: &str = "Where the curves part, the current limit acts: a lower feed brings them together. Phases count the half \
                     tick for which a command is held.";

/// Amplitude and phase from the step's spectrum, from harmonic motion, and of the linear model.
#[must_use]
pub fn bode_findings(machine: &Machine, bode: &Bode) -> Findings {
    let name = &machine.axes[bode.axis].name;
    let title = format!("Frequency response of axis {name} at {} m/min", figure(bode.feed_mm_s * 0.06, 4));
    let bandwidth =
        bode.step.bandwidth_hz.map_or_else(|| "–".to_owned(), |hz| format!("{} Hz", figure(hz, 3)));
    let bold = format!("−3 dB of the step’s spectrum: {bandwidth}.");
    let mut findings = open(&title, machine, [&bold, "Open loop."], &[]);
    let points = &bode.points;
    let curve = |name: &str, index: usize, value: &dyn Fn(&BodePoint) -> f64| {
        let points = points.iter().map(|point| (point.frequency_hz, value(point))).collect();
        Series::curve(name, palette::series(index), points)
    };
    let amplitude = vec![
        curve("spectrum of the step", 0, &|point| db(point.step.ratio)),
        curve("harmonics, swing", 1, &|point| db(point.harmonic.swing_ratio)),
        curve("harmonics, fundamental", 2, &|point| db(point.harmonic.fundamental_ratio)),
        curve("linear model", 3, &|point| db(point.model.ratio)),
    ];
    let phase = vec![
        curve("spectrum of the step", 0, &|point| point.step.phase_rad.to_degrees()),
        curve("harmonics, fundamental", 2, &|point| point.harmonic.phase_rad.to_degrees()),
        curve("linear model", 3, &|point| point.model.phase_rad.to_degrees()),
    ];
    let ends =
        points.first().zip(points.last()).map_or((1.0, 10.0), |(a, b)| (a.frequency_hz, b.frequency_hz));
    findings.section("Amplitude and phase");
    findings.figure(over_frequency("Amplitude and phase", ends, amplitude, phase).with_words(WORDS));
    findings
}
