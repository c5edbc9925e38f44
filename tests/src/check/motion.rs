//! Checks of one tick against the limits, the tick before, and the programmed path.
//!
//! The feed law makes the path position four times continuously differentiable in time, through rests
//! too, with a fifth derivative bounded by K = 2π²·Jp/(2e)² of the ramps under way. So the values of two
//! neighbouring ticks determine each other: the change of each is the integral of the next one, by
//! Hermite's rule of the order that the known derivatives allow, within a multiple of K·τⁿ. No law, no
//! phases: an error in any of the five values shows.

use motion_host::machine::Machine;
use motion_host::planning::Plan;
use motion_kernel::exec::{ExecState, Executed};
use motion_kernel::num::Real;
use std::f64::consts::PI;

use super::bounds::{self, Number};
use super::geometry::{Vector, minus, norm};
use super::path::{Cursor, Path};
use super::totals::Totals;
use crate::judge;

/// Greatest error of Hermite's rules for a change of s, v, a, j over one tick, over K·τⁿ: Peano's kernels,
/// integrated numerically.
const HERMITE: [f64; 4] = [1.7059e-4, 2.7084e-3, 3.2076e-2, 0.25];

/// The same where snap may step within its limit DJ, over DJ·τⁿ: the change of j itself, and with one derivative less
/// on either side.
const HERMITE_LIVE: [f64; 4] = [8.1e-3, 3.2076e-2, 0.25, 1.0];

/// Within this of a junction both its moves count \[mm\]: segments end on position steps.
const JUNCTION_MM: f64 = 1e-7;

/// The motion along the path: s, v, a, j, snap.
type Along = [f64; 5];

/// Set values against one move: position, velocity, acceleration and jerk, each found and its bound.
struct Comparison {
    worst: f64,
    found: [(f64, f64); 4],
    bend: f64,
    /// What fixed point's steps add to the last three.
    steps: [f64; 3],
}

pub struct Checker<'a> {
    machine: &'a Machine,
    plan: &'a Plan,
    cursor: Cursor<'a>,
    epsilon: f64,
    step: f64,
    position_mm: f64,
    seed: u64,
    before: Along,
    /// Move of the tick before.
    block: usize,
    /// First record of the feed plan that may still matter.
    feed: usize,
    /// Under live control, the greatest feed override that the feed may still be of: motion is not the plan's any more,
    /// but keeps the limits.
    live: Option<f64>,
    pub totals: Totals,
}

impl<'a> Checker<'a> {
    pub fn new<R: Number>(machine: &'a Machine, plan: &'a Plan, path: &'a Path, seed: u64) -> Self {
        Self {
            machine,
            plan,
            cursor: Cursor::new(path),
            epsilon: R::RELATIVE,
            step: R::STEP,
            position_mm: bounds::position_mm::<R>(),
            seed,
            before: [0.0; 5],
            block: 0,
            feed: 0,
            live: None,
            totals: Totals::default(),
        }
    }

    /// The same for motion under live control, with feed overrides up to `feed_override`.
    pub fn live(self, feed_override: f64) -> Self {
        Self { live: Some(feed_override), ..self }
    }

    /// From now on the feed may be of an override up to `feed_override`.
    pub fn override_up_to(&mut self, feed_override: f64) {
        self.live = Some(feed_override);
    }

    /// How far the machine has come, from the program's start \[mm\].
    pub fn s_mm(&self) -> f64 {
        self.before[0]
    }

    /// Checks a tick; says what is wrong.
    pub fn tick<R: Real>(&mut self, executed: &Executed<R, 3>) -> Result<(), String> {
        self.totals.ticks += 1;
        let motion = &executed.motion;
        let local_mm = motion.s.to_mm();
        let values = judge::along(motion);
        let stretch = executed.stretches as usize;
        let placed = self.cursor.seek(stretch, local_mm).copied();
        let [v, a, j, snap] = values;
        let along = [self.cursor.before_mm + local_mm, v, a, j, snap];
        let is_moving = executed.state == ExecState::Moving;
        let Some(placed) = placed.filter(|_| is_moving) else {
            if values.iter().any(|&value| value != 0.0) || is_moving {
                return Err(format!("moves at rest or after the end: {executed:?}"));
            }
            self.along(&along)?;
            self.before = along;
            return Ok(());
        };
        self.limits(&along)?;
        self.along(&along)?;
        self.ceiling(&along, local_mm, placed.block)?;
        if placed.block != self.block {
            self.junctions(&along, self.block, placed.block)?;
            self.block = placed.block;
        }
        self.axes(executed, local_mm, &along)?;
        self.before = along;
        Ok(())
    }

    fn bound(&mut self, name: &'static str, found: f64, bound: f64) -> Result<(), String> {
        let ratio = if found == 0.0 { 0.0 } else { found / (bound + 4.0 * self.step) };
        self.totals.worst(name, ratio, self.seed);
        // Written so that what is not a number fails.
        if ratio <= 1.0 {
            return Ok(());
        }
        Err(format!("{name}: {found:e}, bound {bound:e}, ratio {ratio}"))
    }

    fn limits(&mut self, &[_, v, a, j, snap]: &Along) -> Result<(), String> {
        let path = &self.machine.path;
        let rounding = 1.0 + bounds::LIMIT_SHARE + bounds::LIMIT_ROUNDING * self.epsilon;
        // A ramp that turns at less than a step of fixed point may end one below 0.
        let least = if self.live.is_some() { -self.step } else { 0.0 };
        if v < least {
            return Err(format!("feed {v} mm/s"));
        }
        self.bound("feed limit", v, path.feed_mm_s * rounding)?;
        self.bound("acceleration limit", a.abs(), path.accel_mm_s2 * rounding)?;
        self.bound("jerk limit", j.abs(), path.jerk_mm_s3 * rounding)?;
        self.bound("snap limit", snap.abs(), path.snap_mm_s4 * rounding)
    }

    /// Fits the tick before, with snap that may step within its limit and nothing known of the ramps.
    fn along_live(&mut self, now: &Along) -> Result<(), String> {
        let then = self.before;
        let path = &self.machine.path;
        let (accel, jerk, snap) = (path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4);
        let peak = jerk.min((2.0 * accel * snap / PI).sqrt());
        let longest_s = 2.0 * accel / peak;
        let gained = peak * longest_s.powi(3);
        // A ramp that turns has products of all the length that it would have had.
        let ramp_mm = 3.0 * 2.0_f64.powi(-32) * path.feed_mm_s * longest_s;
        if now[0] < then[0] - bounds::backward_mm(self.epsilon, gained) - ramp_mm {
            return Err(format!("goes back from {} to {} mm", then[0], now[0]));
        }
        let h = self.machine.tick_s;
        let d: Along = core::array::from_fn(|k| now[k] - then[k]);
        let m: Along = core::array::from_fn(|k| now[k] + then[k]);
        let predicted =
            [h * (m[1] / 2.0 - h * d[2] / 12.0), h * (m[2] / 2.0 - h * d[3] / 12.0), h * m[3] / 2.0, 0.0];
        let errors = core::array::from_fn(|k| HERMITE_LIVE[k] * snap * h.powi(4 - k as i32));
        let span_mm = 2.0_f64.powi(-31) * self.plan.length_mm + ramp_mm;
        self.fits(now, &predicted, &errors, &[gained, path.feed_mm_s, accel, jerk, snap], span_mm)
    }

    /// Whether the changes since the tick before are those predicted, within the rule's errors and rounding: of `sizes`,
    /// which end with the rate of change of the last that is checked, and of the length `span_mm`.
    fn fits(
        &mut self,
        now: &Along,
        predicted: &[f64; 4],
        errors: &[f64; 4],
        sizes: &[f64],
        span_mm: f64,
    ) -> Result<(), String> {
        let (then, h, c) = (self.before, self.machine.tick_s, bounds::CONTINUITY_ROUNDING);
        for (k, name) in ["fit of s", "fit of v", "fit of a", "fit of j"].into_iter().enumerate() {
            let rates = sizes.len() - 1;
            let rounded: f64 = (k..rates).map(|of| sizes[of] * h.powi((of - k) as i32)).sum();
            let mut bound = errors[k] + c * self.epsilon * rounded + c * h * sizes[k + 1] * 2.0_f64.powi(-32);
            if k == 0 {
                // 2⁻³² of a length is what its products resolve.
                bound += bounds::LENGTH_ROUNDING_MM + span_mm;
            }
            let fits = self.bound(name, (now[k] - then[k] - predicted[k]).abs(), bound);
            fits.map_err(|error| format!("{error}; from {then:?} to {now:?}"))?;
        }
        Ok(())
    }

    /// Fits the tick before.
    fn along(&mut self, now: &Along) -> Result<(), String> {
        if self.live.is_some() {
            return self.along_live(now);
        }
        let then = self.before;
        // Peaks in the segments under way.
        let (mut crackle, mut snap, mut jerk, mut accel) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        let (mut feed, mut gained, mut span) = (0.0_f64, 0.0_f64, 0.0_f64);
        let records = &self.plan.feed;
        while records.get(self.feed).is_some_and(|r| r.start_mm + r.length_mm() < then[0] - 1e-7) {
            self.feed += 1;
        }
        for record in records[self.feed..].iter().take_while(|r| r.start_mm <= now[0] + 1e-7) {
            let ramp = &record.planned.ramp;
            let (jp, arch_s) = (ramp.peak_jerk_mm_s3, 2.0 * ramp.edge_s);
            if jp > 0.0 {
                crackle = crackle.max(2.0 * PI * PI * jp / (arch_s * arch_s));
                snap = snap.max(PI * jp / arch_s);
                jerk = jerk.max(jp);
                accel = accel.max(ramp.peak_accel_mm_s2());
            }
            // In a phase of constant acceleration the feed is computed from its start.
            feed = feed.max(ramp.from_mm_s).max(ramp.to_mm_s);
            gained = gained.max(jp * arch_s * arch_s * arch_s);
            span = span.max(record.length_mm());
        }
        if now[0] < then[0] - bounds::backward_mm(self.epsilon, gained) {
            return Err(format!("goes back from {} to {} mm", then[0], now[0]));
        }
        let h = self.machine.tick_s;
        let d: Along = core::array::from_fn(|k| now[k] - then[k]);
        let m: Along = core::array::from_fn(|k| now[k] + then[k]);
        let predicted = [
            h * (m[1] / 2.0 - h * (d[2] * 3.0 / 28.0 - h * (m[3] / 84.0 - h * d[4] / 1680.0))),
            h * (m[2] / 2.0 - h * (d[3] / 10.0 - h * m[4] / 120.0)),
            h * (m[3] / 2.0 - h * d[4] / 12.0),
            h * m[4] / 2.0,
        ];
        // Sizes of what is rounded; time itself is in steps of 2⁻³² tick.
        let sizes = [gained, feed, accel, jerk, snap, crackle];
        let errors = core::array::from_fn(|k| HERMITE[k] * crackle * h.powi(4 - k as i32 + 1));
        self.fits(now, &predicted, &errors, &sizes, 2.0_f64.powi(-31) * span)
    }

    /// The feed against the ceiling of the block it is in, planned and programmed.
    fn ceiling(&mut self, now: &Along, local_mm: f64, block: usize) -> Result<(), String> {
        let v = now[1];
        let rounding = 1.0 + bounds::LIMIT_SHARE + bounds::LIMIT_ROUNDING * self.epsilon;
        let planned = |index: usize| self.plan.blocks.get(index).map_or(0.0, |block| block.cap_mm_s);
        let (mut cap, mut asked) = (planned(block), 0.0_f64);
        for placed in self.cursor.near(local_mm, JUNCTION_MM) {
            cap = cap.max(planned(placed.block));
            asked = asked.max(placed.feed_mm_s);
        }
        let most = self.live.unwrap_or(1.0);
        if most <= 1.0 {
            self.bound("planned ceiling", v, cap * rounding)?;
        }
        // A rapid has no feed of its own.
        if asked.is_infinite() {
            return Ok(());
        }
        self.bound("programmed feed", v, asked * most * rounding)
    }

    /// The steps at the junctions passed since the tick before.
    fn junctions(&mut self, now: &Along, from: usize, to: usize) -> Result<(), String> {
        let tick_s = self.machine.tick_s;
        // At least this feed, wherever in the tick the junction lay: where a ramp ends and another begins in one tick, its
        // feed sinks below both ends by an eighth of what jerk makes of it.
        let most = |order: usize| now[order].abs().max(self.before[order].abs());
        let change = 0.5 * tick_s * most(2) + 0.125 * tick_s * tick_s * most(3);
        let v = (now[1].min(self.before[1]) - change).max(0.0);
        let passed = self.cursor.neighbours().iter().filter(|p| p.block > from && p.block <= to);
        let steps: Vec<_> = passed.filter_map(|placed| placed.junction).collect();
        for (angle_rad, bend) in steps {
            let step = v * (angle_rad - 1e-11).max(0.0) / tick_s + v * v * bend;
            let limit = self.machine.path.accel_step_mm_s2;
            self.bound(
                "acceleration step",
                step,
                limit * (1.0 + 1e-6 + bounds::LIMIT_ROUNDING * self.epsilon),
            )?;
        }
        Ok(())
    }

    /// The axes' set values against the programmed path, and the machine's limits of them.
    fn axes<R: Real>(&mut self, executed: &Executed<R, 3>, local_mm: f64, now: &Along) -> Result<(), String> {
        let [_, v, a, j, _] = *now;
        let set = &executed.setpoints;
        let position: Vector = set.map(|axis| axis.position.to_mm());
        let derived = [
            set.map(|axis| axis.velocity_mm_s.to_f64()),
            set.map(|axis| axis.accel_mm_s2.to_f64()),
            set.map(|axis| axis.jerk_mm_s3.to_f64()),
        ];
        // At a junction both neighbours are right.
        let mut best: Option<Comparison> = None;
        for placed in self.cursor.near(local_mm, JUNCTION_MM) {
            let point = placed.at(local_mm);
            let (t, n, o) = (point.tangent, point.second, point.third);
            let exact: [Vector; 3] = [
                t.map(|t| t * v),
                core::array::from_fn(|i| n[i] * v * v + t[i] * a),
                core::array::from_fn(|i| o[i] * v * v * v + 3.0 * n[i] * v * a + t[i] * j),
            ];
            let bend = norm(n);
            let [along, curve, twist] = point.sizes;
            let sizes = [
                along * v,
                curve * v * v + along * a.abs(),
                twist * v * v * v + 3.0 * curve * v * a.abs() + along * j.abs(),
            ];
            let mut found = [(norm(minus(position, point.at)), self.position_mm); 4];
            let piece_mm = placed.element.length_mm.min(0.39 * placed.element.radius_mm).min(16.0);
            let steps = bounds::axis_steps([v, a, j], curve, twist, piece_mm);
            for k in 0..3 {
                let bound = bounds::AXIS_SHARES[k] * sizes[k] + steps[k] * self.step + 1e-300;
                found[k + 1] = (norm(minus(derived[k], exact[k])), bound);
            }
            let worst = found.iter().map(|(found, bound)| found / bound).fold(0.0, f64::max);
            if best.as_ref().is_none_or(|best| worst < best.worst) {
                let steps = steps.map(|steps| steps * self.step);
                best = Some(Comparison { worst, found, bend, steps });
            }
        }
        let Some(Comparison { found, bend, steps, .. }) = best else {
            return Err(format!("{local_mm} mm is on no move"));
        };
        for (name, (found, bound)) in
            ["set position", "set velocity", "set acceleration", "set jerk"].into_iter().zip(found)
        {
            self.bound(name, found, bound)?;
        }
        let machine = self.machine;
        let path = &machine.path;
        // Curved or not, the vectors keep the path's limits and each axis its own.
        let shares = if bend > 0.0 { bounds::AXIS_SHARES } else { [2.0 * self.epsilon; 3] };
        let rounding = bounds::LIMIT_SHARE + bounds::LIMIT_ROUNDING * self.epsilon;
        let limits = [path.feed_mm_s, path.accel_mm_s2, path.jerk_mm_s3];
        let vectors = ["velocity vector", "acceleration vector", "jerk vector"];
        for (k, name) in ["axis velocity", "axis acceleration", "axis jerk"].into_iter().enumerate() {
            let factor = 1.0 + shares[k] + rounding;
            self.bound(vectors[k], norm(derived[k]), limits[k] * factor + steps[k])?;
            for (settings, value) in machine.axes.iter().zip(derived[k]) {
                let limit = [settings.feed_mm_s, settings.accel_mm_s2, settings.jerk_mm_s3][k];
                self.bound(name, value.abs(), limit * factor + steps[k])?;
            }
        }
        Ok(())
    }
}
