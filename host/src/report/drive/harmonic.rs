//! The pages of harmonic motion, of the growing load, and of the Bode plot.

use std::io::{self, Write};

use super::super::figure_html;
use super::super::format::{escape, figure};
use super::super::palette;
use super::super::plots::Caption;
use super::super::plots::graph::{Graph, Series, Stack};
use super::legend;
use crate::drive::Recording;
use crate::drive::bode::{Bode, Point};
use crate::drive::circle_motion::Circle;
use crate::drive::experiment::{DriveError, differences};
use crate::drive::harmonic::HarmonicFigures;
use crate::drive::inertia::{InertiaFigures, accelerations};
use crate::drive::reference::Comparison;
use crate::machine::Machine;

/// Amplitude at −3 dB.
const HALF_POWER_DB: f64 = -3.0103;
/// Turns of a motion that are shown.
const TURNS_SHOWN: f64 = 2.0;
/// Time over which drawn velocities are averaged \[s\].
const AVERAGED_S: f64 = 0.0015;

fn db(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// What was measured was measured before it is drawn.
fn measured<T>(result: Result<T, DriveError>) -> io::Result<T> {
    result.map_err(io::Error::other)
}

/// Writes the page of harmonic motion: amplitude and phase of both axes over frequency, and velocities of the
/// given motions. `words` explain the figures.
///
/// # Errors
/// Whatever `out` reports; a recording without its steady part.
pub fn write_harmonic(
    machine: &Machine,
    found: &[HarmonicFigures],
    waves: &[(Circle, Recording)],
    words: &str,
    comparisons: &[Comparison],
    out: &mut impl Write,
) -> io::Result<()> {
    let feed_m_min = found.first().map_or(0.0, |figures| figures.feed_mm_s * 0.06);
    let title = format!("Harmonic motion at {} m/min", figure(feed_m_min, 4));
    let names = [0, 1].map(|axis: usize| machine.axes[axis].name.clone());
    let sentence = format!(
        "<strong>{} and {}</strong> at {} frequencies.",
        escape(&names[0]),
        escape(&names[1]),
        found.len()
    );
    super::open(&title, machine, &sentence, comparisons, out)?;
    if !words.is_empty() {
        writeln!(out, "<p>{}</p>", escape(words))?;
    }
    let over = |value: &dyn Fn(&HarmonicFigures) -> f64| -> Vec<(f64, f64)> {
        found.iter().map(|figures| (figures.frequency_hz, value(figures))).collect()
    };
    let curve = |index: usize, value: &dyn Fn(&HarmonicFigures) -> f64| Series {
        ink: palette::series(index),
        points: over(value),
    };
    let ends = found.first().zip(found.last()).map_or((0.0, 1.0), |(a, b)| (a.frequency_hz, b.frequency_hz));
    let stack = Stack {
        x: if ends.1 > ends.0 { ends } else { (ends.0 / 2.0, ends.0 * 2.0) },
        x_name: "frequency [Hz]",
        is_logarithmic: true,
        graphs: vec![
            Graph {
                title: "Amplitude [dB], −3 dB dashed".to_owned(),
                y: None,
                series: vec![
                    curve(0, &|figures| db(figures.axes[0].swing_ratio)),
                    curve(1, &|figures| db(figures.axes[1].swing_ratio)),
                    curve(2, &|figures| db(figures.axes[0].fundamental_ratio)),
                    curve(3, &|figures| db(figures.axes[1].fundamental_ratio)),
                ],
                levels: vec![HALF_POWER_DB],
            },
            Graph {
                title: "Phase [°]".to_owned(),
                y: None,
                series: vec![
                    curve(0, &|figures| figures.axes[0].phase_rad.to_degrees()),
                    curve(1, &|figures| figures.axes[1].phase_rad.to_degrees()),
                ],
                levels: Vec::new(),
            },
        ],
    };
    let caption = Caption {
        id: "bode",
        title: "Amplitude and phase over frequency",
        description: "Amplitude ratio and phase of actual against commanded velocity, both axes.",
    };
    let words = [
        format!("{}, swing (phase: fundamental)", names[0]),
        format!("{}, swing (phase: fundamental)", names[1]),
        format!("{}, fundamental", names[0]),
        format!("{}, fundamental", names[1]),
    ];
    writeln!(out, "<section><h2>Amplitude and phase</h2>")?;
    figure_html(&stack.draw(&caption)?, &legend(words.into_iter()), "", out)?;
    writeln!(out, "</section><section><h2>Velocities</h2>")?;
    for (index, (circle, recording)) in waves.iter().enumerate() {
        let hz = figure(circle.frequency_hz, 4);
        let [x, y] = circle.axes();
        let series = vec![
            Series { ink: palette::LIMIT, points: wave(circle, recording, x, true)? },
            Series { ink: palette::series(0), points: wave(circle, recording, x, false)? },
            Series { ink: palette::series(1), points: wave(circle, recording, y, false)? },
        ];
        let title = format!("Velocity at {hz} Hz [m/min]");
        let stack = over_revolutions(
            circle,
            vec![Graph { title: title.clone(), y: None, series, levels: Vec::new() }],
        );
        let caption = Caption { id: &format!("wave{index}"), title: &title, description: &title };
        let words = [
            (palette::LIMIT, format!("{}, set", names[0])),
            (palette::series(0), names[0].clone()),
            (palette::series(1), names[1].clone()),
        ];
        figure_html(&stack.draw(&caption)?, &words, "", out)?;
    }
    writeln!(out, "</section>")?;
    super::close(out)
}

/// Graphs over the revolutions that are shown.
fn over_revolutions(circle: &Circle, graphs: Vec<Graph>) -> Stack {
    let end_ms = (TURNS_SHOWN / circle.frequency_hz).min(circle.span_s()) * 1e3;
    Stack { x: (0.0, end_ms), x_name: "time [ms]", is_logarithmic: false, graphs }
}

/// Set or actual velocity of an axis: time and velocity \[ms, m/min\].
fn wave(circle: &Circle, recording: &Recording, axis: usize, is_set: bool) -> io::Result<Vec<(f64, f64)>> {
    let ticks = measured(circle.measured(recording))?;
    let tick_s = recording.tick_s();
    let over = if is_set { 1 } else { ((AVERAGED_S / tick_s).round() as usize).max(1) };
    let positions: Vec<f64> = ticks
        .iter()
        .map(|tick| if is_set { tick.axes[axis].set_mm } else { tick.axes[axis].act_mm })
        .collect();
    let smooth: Vec<f64> = differences(&positions, tick_s)
        .windows(over)
        .map(|part| part.iter().sum::<f64>() / over as f64)
        .collect();
    let half = 0.5 * over as f64;
    Ok(smooth.iter().enumerate().map(|(i, v)| ((i as f64 + half) * tick_s * 1e3, v * 0.06)).collect())
}

/// Writes the page of the growing load: velocities and accelerations of one axis.
///
/// # Errors
/// Those of [`write_harmonic`].
pub fn write_inertia(
    machine: &Machine,
    circle: &Circle,
    found: &[(InertiaFigures, Recording)],
    out: &mut impl Write,
) -> io::Result<()> {
    let axis = found.first().map_or(0, |(figures, _)| figures.response.axis);
    let name = &machine.axes[axis].name;
    let title = format!("Axis {name} at {} Hz under load", figure(circle.frequency_hz, 4));
    let limited = found.iter().find(|(figures, _)| figures.is_limited);
    let sentence = match limited {
        None => "<strong>The velocity stays a sine:</strong> the current limit is not reached.".to_owned(),
        Some((figures, _)) => format!(
            "<strong>From load {} on the velocity is a triangle:</strong> the current limit holds the acceleration at \
             {} m/s².",
            figure(figures.load_inertia_ratio, 3),
            figure(figures.plateau_accel_mm_s2 / 1e3, 3),
        ),
    };
    super::open(&title, machine, &sentence, &[], out)?;
    let (mut velocity, mut accel) = (Vec::new(), Vec::new());
    if let Some((_, recording)) = found.first() {
        velocity.push(Series { ink: palette::LIMIT, points: wave(circle, recording, axis, true)? });
    }
    for (index, (_, recording)) in found.iter().enumerate() {
        let ink = palette::series(index);
        velocity.push(Series { ink, points: wave(circle, recording, axis, false)? });
        let points = measured(accelerations(recording, circle, axis))?;
        accel.push(Series { ink, points: points.into_iter().map(|(t, a)| (t * 1e3, a / 1e3)).collect() });
    }
    let graph = |title: &str, series| Graph { title: title.to_owned(), y: None, series, levels: Vec::new() };
    let graphs = vec![graph("Velocity [m/min]", velocity), graph("Acceleration [m/s²]", accel)];
    let stack = over_revolutions(circle, graphs);
    let caption = Caption {
        id: "inertia",
        title: "Velocity and acceleration under load",
        description: "Two revolutions of the motion under each load: velocity and acceleration.",
    };
    let mut words: Vec<_> =
        legend(found.iter().map(|(figures, _)| format!("load {}", figure(figures.load_inertia_ratio, 3))));
    words.insert(0, (palette::LIMIT, "set".to_owned()));
    writeln!(out, "<section><h2>Velocity and acceleration</h2>")?;
    figure_html(&stack.draw(&caption)?, &words, "Load: added inertia over the unloaded axis’s.", out)?;
    writeln!(out, "</section>")?;
    super::close(out)
}

/// Writes the page of the Bode plot: three methods.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_bode(machine: &Machine, bode: &Bode, out: &mut impl Write) -> io::Result<()> {
    let name = &machine.axes[bode.axis].name;
    let title = format!("Frequency response of axis {name} at {} m/min", figure(bode.feed_mm_s * 0.06, 4));
    let bandwidth =
        bode.step.bandwidth_hz.map_or_else(|| "–".to_owned(), |hz| format!("{} Hz", figure(hz, 3)));
    let sentence = format!("<strong>−3 dB of the step’s spectrum: {bandwidth}.</strong> Open loop.");
    super::open(&title, machine, &sentence, &[], out)?;
    let points = &bode.points;
    let curve = |index: usize, value: &dyn Fn(usize) -> f64| Series {
        ink: palette::series(index),
        points: points.iter().enumerate().map(|(i, point)| (point.frequency_hz, value(i))).collect(),
    };
    let degrees = |point: &Point| point.phase_rad.to_degrees();
    let ends =
        points.first().zip(points.last()).map_or((1.0, 10.0), |(a, b)| (a.frequency_hz, b.frequency_hz));
    let stack = Stack {
        x: ends,
        x_name: "frequency [Hz]",
        is_logarithmic: true,
        graphs: vec![
            Graph {
                title: "Amplitude [dB], −3 dB dashed".to_owned(),
                y: None,
                series: vec![
                    curve(0, &|i| db(points[i].step.ratio)),
                    curve(1, &|i| db(points[i].harmonic.swing_ratio)),
                    curve(2, &|i| db(points[i].harmonic.fundamental_ratio)),
                    curve(3, &|i| db(points[i].model.ratio)),
                ],
                levels: vec![HALF_POWER_DB],
            },
            Graph {
                title: "Phase [°]".to_owned(),
                y: None,
                series: vec![
                    curve(0, &|i| degrees(&points[i].step)),
                    curve(2, &|i| points[i].harmonic.phase_rad.to_degrees()),
                    curve(3, &|i| degrees(&points[i].model)),
                ],
                levels: Vec::new(),
            },
        ],
    };
    let caption = Caption {
        id: "bode",
        title: "Amplitude and phase over frequency",
        description: "From the step's spectrum, from harmonic motion, and of the linear model.",
    };
    let names = ["spectrum of the step", "harmonics, swing", "harmonics, fundamental", "linear model"];
    let words = "Where the curves part, the current limit acts: a lower feed brings them together. Phases count the half \
                 tick for which a command is held.";
    writeln!(out, "<section><h2>Amplitude and phase</h2>")?;
    figure_html(&stack.draw(&caption)?, &legend(names.into_iter().map(str::to_owned)), words, out)?;
    writeln!(out, "</section>")?;
    super::close(out)
}
