//! The page of a velocity step: velocity, acceleration and jerk over time, and the settling.

use super::super::figure::{Axis, Graph, Series, Stack};
use super::super::findings::Findings;
use super::super::format::figure;
use super::super::palette;
use super::open;
use crate::drive::reference::Comparison;
use crate::drive::step::{BAND_MM_S, Step, StepFigures, StepResponse};
use crate::machine::Machine;

/// Time that is shown, in time constants.
const SHOWN_TIME_CONSTANTS: f64 = 10.0;
/// The settling is shown this far on either side of the step, in bands.
const BANDS: f64 = 5.0;

fn m_min(mm_s: f64) -> f64 {
    mm_s * 0.06
}

fn optional(value: Option<f64>, unit: &str) -> String {
    value
        .map_or_else(|| "not within the recording".to_owned(), |value| format!("{} {unit}", figure(value, 3)))
}

/// The step, and its settling magnified.
#[must_use]
pub fn step_figures(
    machine: &Machine,
    step: &Step,
    response: &StepResponse,
    figures: &StepFigures,
) -> [Stack; 2] {
    let tick_ms = response.tick_s * 1e3;
    let set_m_min = m_min(step.feed_mm_s);
    let end_ms = response.positions_mm.len() as f64 * tick_ms;
    let shown_ms = SHOWN_TIME_CONSTANTS * figures.time_constant_s * 1e3;
    let shown_ms = ((shown_ms / 10.0).ceil() * 10.0).min(end_ms);
    let velocity: Vec<_> =
        response.velocities().into_iter().map(|(t_s, mm_s)| (t_s * 1e3, m_min(mm_s))).collect();
    let [_, accel, jerk] = response.rates();
    let by_tick = |values: &[f64]| {
        values.iter().enumerate().map(|(i, v)| ((i + 1) as f64 * tick_ms, v * 1e-3)).collect::<Vec<_>>()
    };
    // The tangent from the delay to the step.
    let (delay_ms, rise_ms) = (figures.delay_s * 1e3, figures.time_constant_s * 1e3);
    let tangent = vec![(delay_ms, 0.0), (delay_ms + rise_ms, set_m_min)];
    let set = vec![(0.0, 0.0), (0.0, set_m_min), (end_ms, set_m_min)];
    let time = || Axis::new("Time since the step", "ms");
    let of_step = Stack::new(
        "Velocity, acceleration and jerk",
        time(),
        (0.0, shown_ms),
        vec![
            Graph::new(
                "Velocity",
                "m/min",
                vec![
                    Series::curve("actual", palette::FEED, velocity.clone()),
                    Series::curve("set", palette::LIMIT, set),
                    Series::curve("tangent at the steepest rise", palette::SERIES[1], tangent),
                ],
            ),
            Graph::new(
                "Acceleration",
                "m/s²",
                vec![Series::curve("", palette::ACCELERATION, by_tick(&accel))],
            ),
            Graph::new("Jerk", "m/s³", vec![Series::curve("", palette::JERK, by_tick(&jerk))]),
        ],
    );
    let count_mm = machine.axes[step.axis].mm_per_count.abs();
    let words = format!(
        "Velocity averaged over 2.5 ms; acceleration and jerk are differences of encoder readings from tick to tick, \
         so they show the encoder’s count: one of them in a tick is {} m/s² and {} m/s³.",
        figure(count_mm / response.tick_s.powi(2) / 1e3, 2),
        figure(count_mm / response.tick_s.powi(3) / 1e3, 2),
    );
    let band = m_min(BAND_MM_S);
    let over = (figures.overshoot * set_m_min).max(band);
    let beside = velocity.into_iter().map(|(t_ms, v)| (t_ms, v - set_m_min)).collect();
    let settling = Graph {
        ends: Some((-BANDS * band, 1.2 * over)),
        ..Graph::new("Actual less set velocity", "m/min", vec![Series::curve("", palette::FEED, beside)])
            .with_levels(&[band, -band])
    };
    let settled = optional(figures.settling_s.map(|settling_s| settling_s * 1e3), "ms");
    let of_settling = Stack::new("Settling", time(), (0.0, shown_ms), vec![settling])
        .with_words(format!("Settled within ±0.02 m/min, dashed: {settled}."));
    [of_step.with_words(words), of_settling]
}

/// The page of a step.
#[must_use]
pub fn step_findings(
    machine: &Machine,
    step: &Step,
    response: &StepResponse,
    figures: &StepFigures,
    comparisons: &[Comparison],
) -> Findings {
    let name = &machine.axes[step.axis].name;
    let bold = format!(
        "Delay {} ms, time constant {} ms,",
        figure(figures.delay_s * 1e3, 3),
        figure(figures.time_constant_s * 1e3, 3)
    );
    let rest = format!(
        "overshoot {} %, settled within ±0.02 m/min: {}; −3 dB of the spectrum: {}.",
        figure(figures.overshoot * 1e2, 3),
        optional(figures.settling_s.map(|settling_s| settling_s * 1e3), "ms"),
        optional(figures.bandwidth_hz, "Hz"),
    );
    let title = format!("Velocity step of axis {name} to {} m/min", figure(m_min(step.feed_mm_s), 4));
    let mut findings = open(&title, machine, [&bold, &rest], comparisons);
    let [of_step, of_settling] = step_figures(machine, step, response, figures);
    findings.section("The step");
    findings.figure(of_step);
    findings.section("Settling");
    findings.figure(of_settling);
    findings
}
