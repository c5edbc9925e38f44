//! The page of harmonic motion.

use super::super::figure::{Axis, Figure, Graph, Series, Stack};
use super::super::findings::Findings;
use super::super::format::figure;
use super::super::palette;
use super::{db, open, over_frequency};
use crate::drive::Recording;
use crate::drive::circle_motion::Circle;
use crate::drive::experiment::{DriveError, differences};
use crate::drive::harmonic::{HarmonicFigures, Response};
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// Turns of a motion that are shown.
const TURNS_SHOWN: f64 = 2.0;
/// Time over which drawn velocities are averaged \[s\].
const AVERAGED_S: f64 = 0.0015;

/// Amplitude and phase of the axes `axes` over frequency.
#[must_use]
pub fn harmonic_figures(machine: &Machine, axes: &[usize], found: &[HarmonicFigures]) -> Figure {
    let over = |axis: usize, value: &dyn Fn(&Response) -> f64| -> Vec<(f64, f64)> {
        let of_axis = |figures: &HarmonicFigures| {
            let response = figures.axes.iter().find(|response| response.axis == axis)?;
            Some((figures.frequency_hz, value(response)))
        };
        found.iter().filter_map(of_axis).collect()
    };
    let (mut amplitude, mut phase) = (Vec::new(), Vec::new());
    for (index, &axis) in axes.iter().enumerate() {
        let name = &machine.axes[axis].name;
        let (swing, sine) = (palette::series(index), palette::series(axes.len() + index));
        amplitude.push(Series::curve(
            format!("{name}, swing"),
            swing,
            over(axis, &|response| db(response.swing_ratio)),
        ));
        amplitude.push(Series::curve(
            format!("{name}, fundamental"),
            sine,
            over(axis, &|response| db(response.fundamental_ratio)),
        ));
        let degrees = over(axis, &|response| response.phase_rad.to_degrees());
        phase.push(Series::curve(format!("{name}, fundamental"), sine, degrees));
    }
    let ends = found.first().zip(found.last()).map_or((1.0, 10.0), |(a, b)| (a.frequency_hz, b.frequency_hz));
    let ends = if ends.1 > ends.0 { ends } else { (ends.0 / 2.0, ends.0 * 2.0) };
    over_frequency("Amplitude and phase", ends, amplitude, phase).into()
}

/// Amplitude and phase of both axes over frequency, and velocities of the given motions. `words` explain the figures.
///
/// # Errors
/// A recording without its steady part.
pub fn harmonic_findings(
    machine: &Machine,
    found: &[HarmonicFigures],
    waves: &[(Circle, Recording)],
    words: &str,
    comparisons: &[Comparison],
) -> Result<Findings, DriveError> {
    let feed_m_min = found.first().map_or(0.0, |figures| figures.feed_mm_s * 0.06);
    let title = format!("Harmonic motion at {} m/min", figure(feed_m_min, 4));
    let [first, second] = [0, 1].map(|axis: usize| machine.axes[axis].name.as_str());
    let rest = format!("at {} frequencies.", found.len());
    let mut findings = open(&title, machine, [&format!("{first} and {second}"), &rest], comparisons);
    findings.section("Amplitude and phase");
    findings.words(words);
    findings.figure(harmonic_figures(machine, &[0, 1], found));
    findings.section("Velocities");
    for (circle, recording) in waves {
        let [x, y] = circle.axes();
        let series = vec![
            Series::curve(format!("{first}, set"), palette::LIMIT, wave(circle, recording, x, true)?),
            Series::curve(first, palette::series(0), wave(circle, recording, x, false)?),
            Series::curve(second, palette::series(1), wave(circle, recording, y, false)?),
        ];
        let title = format!("At {} Hz", figure(circle.frequency_hz, 4));
        findings.figure(over_revolutions(&title, circle, vec![Graph::new("Velocity", "m/min", series)]));
    }
    Ok(findings)
}

/// Graphs over the revolutions that are shown.
pub(super) fn over_revolutions(title: &str, circle: &Circle, graphs: Vec<Graph>) -> Stack {
    let end_ms = (TURNS_SHOWN / circle.frequency_hz).min(circle.span_s()) * 1e3;
    Stack::new(title, Axis::new("Time", "ms"), (0.0, end_ms), graphs)
}

/// Set or actual velocity of an axis: time and velocity \[ms, m/min\], over the revolutions that are shown.
pub(super) fn wave(
    circle: &Circle,
    recording: &Recording,
    axis: usize,
    is_set: bool,
) -> Result<Vec<(f64, f64)>, DriveError> {
    let tick_s = recording.tick_s();
    let over = if is_set { 1 } else { ((AVERAGED_S / tick_s).round() as usize).max(1) };
    let shown = (TURNS_SHOWN / circle.frequency_hz / tick_s) as usize + over + 1;
    let positions: Vec<f64> = circle
        .measured(recording)?
        .iter()
        .take(shown)
        .map(|tick| if is_set { tick.axes[axis].set_mm } else { tick.axes[axis].act_mm })
        .collect();
    let smooth: Vec<f64> = differences(&positions, tick_s)
        .windows(over)
        .map(|part| part.iter().sum::<f64>() / over as f64)
        .collect();
    let half = 0.5 * over as f64;
    Ok(smooth.iter().enumerate().map(|(i, v)| ((i as f64 + half) * tick_s * 1e3, v * 0.06)).collect())
}
