//! The page of a velocity step: velocity, acceleration and jerk over time, and the settling.

use std::io::{self, Write};

use super::super::figure_html;
use super::super::format::{escape, figure};
use super::super::palette;
use super::super::plots::Caption;
use super::super::plots::graph::{Graph, Series, Stack};
use crate::drive::reference::Comparison;
use crate::drive::step::{BAND_MM_S, Step, StepFigures, StepResponse};
use crate::machine::Machine;

/// Time that the first picture shows, in time constants.
const SHOWN_TIME_CONSTANTS: f64 = 10.0;
/// The settling is shown this far on either side of the step, in bands.
const BANDS: f64 = 5.0;

/// Writes the page.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_step(
    machine: &Machine,
    step: &Step,
    response: &StepResponse,
    figures: &StepFigures,
    comparisons: &[Comparison],
    out: &mut impl Write,
) -> io::Result<()> {
    let name = &machine.axes[step.axis].name;
    let m_min = |mm_s: f64| mm_s * 0.06;
    let optional = |value: Option<f64>, unit: &str| {
        value.map_or_else(
            || "not within the recording".to_owned(),
            |value| format!("{} {unit}", figure(value, 3)),
        )
    };
    let sentence = format!(
        "<strong>Delay {} ms, time constant {} ms,</strong> overshoot {} %, settled within ±0.02 m/min: {}; \
         −3 dB of the spectrum: {}.",
        figure(figures.delay_s * 1e3, 3),
        figure(figures.time_constant_s * 1e3, 3),
        figure(figures.overshoot * 1e2, 3),
        optional(figures.settling_s.map(|settling_s| settling_s * 1e3), "ms"),
        optional(figures.bandwidth_hz, "Hz"),
    );
    let title = format!("Velocity step of axis {name} to {} m/min", figure(m_min(step.feed_mm_s), 4));
    super::open(&title, machine, &sentence, comparisons, out)?;

    let tick_ms = response.tick_s * 1e3;
    let velocity: Vec<_> =
        response.velocities().into_iter().map(|(t_s, mm_s)| (t_s * 1e3, m_min(mm_s))).collect();
    let set = vec![(0.0, 0.0), (0.0, m_min(step.feed_mm_s)), (f64::MAX, m_min(step.feed_mm_s))];
    let shown_ms = SHOWN_TIME_CONSTANTS * figures.time_constant_s * 1e3;
    let end_ms = response.positions_mm.len() as f64 * tick_ms;
    let shown_ms = (shown_ms / 10.0).ceil() * 10.0;
    let shown_ms = shown_ms.min(end_ms);
    let [_, accel, jerk] = response.rates();
    let by_tick = |values: &[f64], scale: f64| {
        values.iter().enumerate().map(|(i, v)| ((i + 1) as f64 * tick_ms, v * scale)).collect::<Vec<_>>()
    };
    // The tangent from the delay to the step.
    let (delay_ms, rise_ms) = (figures.delay_s * 1e3, figures.time_constant_s * 1e3);
    let tangent = vec![(delay_ms, 0.0), (delay_ms + rise_ms, m_min(step.feed_mm_s))];
    let set: Vec<_> = set.into_iter().map(|(t, v)| (t.min(shown_ms), v)).collect();
    let stack = Stack {
        x: (0.0, shown_ms),
        x_name: "time since the step [ms]",
        is_logarithmic: false,
        graphs: vec![
            Graph {
                title: "Velocity [m/min]".to_owned(),
                y: None,
                series: vec![
                    Series { ink: palette::LIMIT, points: set },
                    Series { ink: palette::SERIES[1], points: tangent },
                    Series { ink: palette::FEED, points: velocity.clone() },
                ],
                levels: Vec::new(),
            },
            Graph {
                title: "Acceleration [m/s²]".to_owned(),
                y: None,
                series: vec![Series { ink: palette::ACCELERATION, points: by_tick(&accel, 1e-3) }],
                levels: Vec::new(),
            },
            Graph {
                title: "Jerk [m/s³]".to_owned(),
                y: None,
                series: vec![Series { ink: palette::JERK, points: by_tick(&jerk, 1e-3) }],
                levels: Vec::new(),
            },
        ],
    };
    let description = format!(
        "Velocity, acceleration and jerk over {} ms: acceleration up to {} m/s², jerk up to {} m/s³.",
        figure(shown_ms, 3),
        figure(figures.peak_accel_mm_s2 / 1e3, 3),
        figure(figures.peak_jerk_mm_s3 / 1e3, 3),
    );
    let caption = Caption {
        id: "step",
        title: "Velocity, acceleration and jerk of the step",
        description: &description,
    };
    let legend = [
        (palette::FEED, "actual velocity".to_owned()),
        (palette::LIMIT, "set velocity".to_owned()),
        (palette::SERIES[1], "tangent at the steepest rise".to_owned()),
    ];
    let words = format!(
        "Velocity averaged over 2.5 ms; acceleration and jerk are differences of encoder readings from tick to tick, \
         so they show the encoder’s count: one of them in a tick is {} m/s² and {} m/s³.",
        figure(machine.axes[step.axis].mm_per_count.abs() / response.tick_s.powi(2) / 1e3, 2),
        figure(machine.axes[step.axis].mm_per_count.abs() / response.tick_s.powi(3) / 1e3, 2),
    );
    writeln!(out, "<section><h2>The step</h2>")?;
    figure_html(&stack.draw(&caption)?, &legend, &escape(&words), out)?;
    writeln!(out, "</section><section><h2>Settling</h2>")?;

    let beside = |(t_ms, v): (f64, f64)| (t_ms, v - m_min(step.feed_mm_s));
    let band = m_min(BAND_MM_S);
    let over = (figures.overshoot * m_min(step.feed_mm_s)).max(band);
    let stack = Stack {
        x: (0.0, shown_ms),
        x_name: "time since the step [ms]",
        is_logarithmic: false,
        graphs: vec![Graph {
            title: "Actual less set velocity [m/min], limits ±0.02".to_owned(),
            y: Some((-BANDS * band, 1.2 * over)),
            series: vec![Series { ink: palette::FEED, points: velocity.into_iter().map(beside).collect() }],
            levels: vec![band, -band],
        }],
    };
    let settled = optional(figures.settling_s.map(|settling_s| settling_s * 1e3), "ms");
    let description = format!("Actual less set velocity, magnified; settled: {settled}.");
    let caption = Caption { id: "settling", title: "Settling of the step", description: &description };
    let legend = [(palette::LIMIT, "±0.02 m/min".to_owned())];
    figure_html(&stack.draw(&caption)?, &legend, &format!("Settled: {}.", escape(&settled)), out)?;
    writeln!(out, "</section>")?;
    super::close(out)
}
