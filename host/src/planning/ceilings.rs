//! The ceilings of a move and of a junction.
//!
//! **Axes.** The limits of the path bind the linear axes together, X, Y, Z, U, V and W; rotary ones have limits of their
//! own alone. Where the path takes rotary axes along, the linear ones have a part of its speed and of its ramps, and it
//! may be driven the faster. Bends may turn the linear part faster than that: where linear axes take part in one, the
//! acceleration, jerk and snap of the whole path keep the limits.

use motion_kernel::law::{Law, LimitError, Limits};
use motion_kernel::plan::{AxisLimits, Ceiling, Junction, MachineLimits, Reason, junction};

use super::error::AtLine;
use crate::gcode::Axis;
use crate::machine::Machine;
use crate::toolpath::fairing::feeds::lower;
use crate::toolpath::smooth::{Move, Run, TANGENT_ROUNDING_RAD, kink_rad};
use crate::toolpath::{Element, Greatest, Role, SpeedRatios, angle, norm, subtract};

/// The ceilings of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ceilings {
    /// The programmed feed along it \[mm/s\]; infinite for a rapid.
    pub feed_mm_s: f64,
    /// The ceiling at the programmed feed.
    pub programmed: Ceiling<f64>,
    /// The ceiling without a programmed feed.
    pub greatest: Ceiling<f64>,
}

/// The ceilings of what bends as `greatest` says, programmed to be driven along it at `feed_mm_s` and at most at
/// `curve_feed_share` of what its curvature allows.
pub(super) fn ceilings<const N: usize>(
    feed_mm_s: f64,
    greatest: &Greatest<N>,
    ratios: &SpeedRatios,
    curve_feed_share: f64,
    machine: &Machine<N>,
) -> Result<Ceilings, LimitError> {
    let limits = machine.limits();
    let path = path_limits(&limits.path, greatest, ratios, machine);
    let limits = MachineLimits { curve_feed_share, path, ..limits };
    let Greatest { bend, tangent, curved } = greatest;
    let at = |feed_mm_s: f64| Ceiling::new(&limits, feed_mm_s, tangent, curved, bend);
    let at = |feed_mm_s: f64| at(feed_mm_s).and_then(with_few_digits);
    let programmed = at(feed_mm_s)?;
    let greatest = if programmed.reason == Reason::Programmed { at(f64::INFINITY)? } else { programmed };
    Ok(Ceilings { feed_mm_s, programmed, greatest })
}

/// What the limits of axes along a line leave for the rounding of its direction to position steps.
const DIRECTION_ROUNDING: f64 = 3.0e-7;

/// A figure with the upper 16 digits of its fraction, which takes fewer bytes: at most 1.6·10⁻⁵ less. One that has no more
/// stays; any other leaves room for the rounding of directions.
pub(super) fn few_digits(figure: f64) -> f64 {
    let cut = |figure: f64| f64::from_bits(figure.to_bits() >> 36 << 36);
    if cut(figure) == figure { figure } else { cut(figure * (1.0 - DIRECTION_ROUNDING)) }
}

/// The ceiling with figures of few digits. The program's own feed stays.
fn with_few_digits(ceiling: Ceiling<f64>) -> Result<Ceiling<f64>, LimitError> {
    let Limits { accel_mm_s2, jerk_mm_s3, snap_mm_s4 } = ceiling.law.limits();
    let limits = Limits {
        accel_mm_s2: few_digits(accel_mm_s2),
        jerk_mm_s3: few_digits(jerk_mm_s3),
        snap_mm_s4: few_digits(snap_mm_s4),
    };
    let feed_mm_s =
        if ceiling.reason == Reason::Programmed { ceiling.feed_mm_s } else { few_digits(ceiling.feed_mm_s) };
    Ok(Ceiling { feed_mm_s, law: Law::new(ceiling.law.pulse(), limits)?, ..ceiling })
}

/// What the limits of the linear axes together are along the path.
fn path_limits<const N: usize>(
    path: &AxisLimits<f64>,
    greatest: &Greatest<N>,
    ratios: &SpeedRatios,
    machine: &Machine<N>,
) -> AxisLimits<f64> {
    let is_bent =
        machine.linear_places().iter().zip(greatest.curved).any(|(&linear, curved)| linear && curved);
    let part = if is_bent { 1.0 } else { ratios.linear };
    // Where nothing linear moves they bind nothing; limits are finite.
    let most = |limit: f64| (limit / part).min(f64::MAX);
    AxisLimits {
        feed_mm_s: path.feed_mm_s / ratios.linear,
        limits: Limits {
            accel_mm_s2: most(path.limits.accel_mm_s2),
            jerk_mm_s3: most(path.limits.jerk_mm_s3),
            snap_mm_s4: most(path.limits.snap_mm_s4),
        },
    }
}

/// The limits that path and axes keep in any direction of X, Y and Z and of what else moves.
pub(super) fn in_any_direction<const N: usize>(moves: &[Move<N>], machine: &Machine<N>) -> Limits<f64> {
    let mut limits = machine.limits();
    let path = limits.path;
    for (place, axis) in machine.axes.iter().enumerate() {
        let is_xyz = matches!(axis.letter, Some(Axis::X | Axis::Y | Axis::Z));
        let is_bound = is_xyz || moves.iter().any(|step| step.element.moves()[place]);
        if !is_bound {
            limits.axes[place] = path;
        }
    }
    limits.in_any_direction()
}

/// The part of the feed that a curve through dense moves allows, with which it is driven: where it is
/// tightest the feed hardly changes, and before and behind it is lower anyhow.
const SMOOTH_FEED_SHARE: f64 = 0.93;

/// The ceilings of the moves of a run. An error comes with the program line.
pub(super) fn along<const N: usize>(run: &Run<N>, machine: &Machine<N>) -> AtLine<Vec<Ceilings>> {
    let is_curve = |step: &Move<N>| matches!(step.element, Element::Polynomial { role: Role::Curve, .. });
    let axes = machine.letters_by_place();
    let mut all: Vec<Ceilings> = Vec::with_capacity(run.moves().len());
    for moves in run.moves().chunk_by(|before, after| is_curve(before) == is_curve(after)) {
        let first = all.len();
        let is_smooth = moves.first().is_some_and(is_curve);
        let share = if is_smooth { SMOOTH_FEED_SHARE } else { machine.path.curve_feed_share };
        for (index, step) in moves.iter().enumerate() {
            let ratios = SpeedRatios::of(&step.element, &axes);
            let (feed_mm_s, greatest) = (step.feeds.along(&ratios), run.greatest(first + index));
            let of_step = ceilings(feed_mm_s, &greatest, &ratios, share, machine);
            all.push(of_step.map_err(|error| (step.line, error.into()))?);
        }
        if is_smooth {
            lower_curve(run, first, &mut all[first..], machine)?;
        }
    }
    Ok(all)
}

/// Lowers the ceilings of a curve through dense moves, those of a run from `first` on, to the feeds that ramps
/// between the slowest of them reach. That leaves more of the limits for the ramps.
fn lower_curve<const N: usize>(
    run: &Run<N>,
    first: usize,
    all: &mut [Ceilings],
    machine: &Machine<N>,
) -> AtLine<()> {
    let axes = machine.letters_by_place();
    let moves = &run.moves()[first..first + all.len()];
    let mut feeds: Vec<f64> = all.iter().map(|ceilings| ceilings.programmed.feed_mm_s).collect();
    let lengths: Vec<f64> = (first..first + all.len()).map(|index| run.length_mm(index)).collect();
    lower(&mut feeds, &lengths, &in_any_direction(moves, machine));
    for (index, (of_step, feed_mm_s)) in all.iter_mut().zip(feeds.into_iter().map(few_digits)).enumerate() {
        if feed_mm_s < of_step.programmed.feed_mm_s {
            let reason = of_step.programmed.reason;
            let ratios = SpeedRatios::of(&moves[index].element, &axes);
            let greatest = run.greatest(first + index);
            let lowered = ceilings(feed_mm_s, &greatest, &ratios, SMOOTH_FEED_SHARE, machine)
                .map_err(|error| (moves[index].line, error.into()))?;
            let lowered = Ceiling { reason, ..lowered.programmed };
            *of_step = Ceilings { programmed: lowered, greatest: lowered, ..*of_step };
        }
    }
    Ok(())
}

/// The greatest feed from one element to the next \[mm/s\]; 0 where the machine has to stop. Where the path `is_smoothed`,
/// velocity is not to step: a kink is not passed.
pub(super) fn junction_feed<const N: usize>(
    elements: [&Element<N>; 2],
    is_smoothed: bool,
    machine: &Machine<N>,
) -> f64 {
    if is_smoothed && kink_rad(elements).is_some() {
        return 0.0;
    }
    let ([_, end], [start, _]) = (elements[0].ends(), elements[1].ends());
    let angle_rad = angle(end.tangent, start.tangent);
    let steps = Junction { angle_rad, curvature_step_per_mm: norm(subtract(start.curvature, end.curvature)) };
    few_digits(junction(
        &steps,
        machine.path.junction_angle_rad.max(TANGENT_ROUNDING_RAD),
        machine.path.accel_step_mm_s2,
        machine.tick_s,
    ))
}
