//! What must hold at every tick, whatever the bytes.

use motion_kernel::exec::ExecState;
use motion_kernel::fault::{Fault, Reaction};
use motion_kernel::num::Real;
use motion_kernel::trace::Trace;
use motion_kernel::units::DacCode;

use super::items::{LIMITS, RULES, TICK_S};
use super::machine::TRIM_V;

/// A part of itself by which a limit may be exceeded: that of the tangent, twice.
const SHARE: f64 = 3e-5;
/// Steps of fixed point in a quantity that is a product of three.
const STEPS: f64 = 1e-6;
/// A set position is rounded, and pieces may lie apart by so much \[mm\], sixteen of them in a tick.
const GAPS_MM: f64 = 17.0 * RULES.junction_gap_mm + 1e-4;

/// The tick before.
struct Before<R> {
    v_mm_s: f64,
    set_mm: [f64; 2],
    fault: Option<Fault<R>>,
    /// How it ends.
    reaction: Option<Reaction>,
    codes: [DacCode; 2],
}

/// Looks at one tick after the other.
pub(super) struct Judge<R> {
    before: Option<Before<R>>,
    /// The machine was told to be elsewhere than its streams, which a board would split anew: they may jump.
    is_torn: bool,
}

impl<R: Real> Judge<R> {
    pub(super) fn new() -> Self {
        Self { before: None, is_torn: false }
    }

    /// The machine was told to stand where it is, and what was faulty is not: what came before does not count.
    pub(super) fn anew(&mut self) {
        (self.before, self.is_torn) = (None, true);
    }

    /// Panics where a promise is broken. `reaction` is the one after the tick.
    pub(super) fn tick(&mut self, trace: &Trace<R, 2>, reaction: Option<Reaction>) {
        let motion = &trace.executed.motion;
        let [v, a, j, snap] =
            [motion.v_mm_s, motion.a_mm_s2, motion.j_mm_s3, motion.snap_mm_s4].map(|value| value.to_f64());
        let quantities = [
            ("feed", v, RULES.feed_mm_s),
            ("acceleration", a, LIMITS.accel_mm_s2),
            ("jerk", j, LIMITS.jerk_mm_s3),
            ("snap", snap, LIMITS.snap_mm_s4),
        ];
        for (name, value, limit) in quantities {
            // Written so that what is not a number fails.
            assert!(value.abs() <= limit * (1.0 + SHARE) + STEPS, "{name} {value}, limit {limit}: {trace:?}");
        }
        assert!(v >= 0.0, "backwards: {trace:?}");
        let rests = trace.executed.state != ExecState::Moving;
        assert!(trace.fault.is_some() || !rests || v == 0.0, "at rest with a feed: {trace:?}");
        let set_mm = trace.executed.setpoints.map(|axis| axis.position.to_mm());
        let codes = trace.axes.each_ref().map(|axis| axis.code);
        if let Some(before) = &self.before {
            if !self.is_torn {
                goes_on(before, trace, v, &set_mm);
            }
            if let Some(fault) = before.fault {
                assert_eq!(trace.fault, Some(fault), "a fault stays");
                assert!(reaction >= before.reaction, "{reaction:?} after {:?}: {trace:?}", before.reaction);
            }
            falls(before, &codes, reaction);
        }
        self.before = Some(Before { v_mm_s: v, set_mm, fault: trace.fault, reaction, codes });
    }
}

/// Neither the feed nor the set position steps.
fn goes_on<R: Real>(before: &Before<R>, trace: &Trace<R, 2>, v_mm_s: f64, set_mm: &[f64; 2]) {
    let (limit, step) = (LIMITS.accel_mm_s2 * TICK_S, v_mm_s - before.v_mm_s);
    // What ends inside a tick and rests begins anew after it: from one side only.
    assert!(step.abs() <= limit * (1.0 + SHARE) + STEPS, "feed steps by {step}: {trace:?}");
    for (now, then) in set_mm.iter().zip(before.set_mm) {
        let (limit, step) = (RULES.feed_mm_s * TICK_S * (1.0 + SHARE) + GAPS_MM, now - then);
        assert!(step.abs() <= limit, "set position jumps by {step} mm: {trace:?}");
    }
}

/// Outputs of a ramp only come nearer to the voltage of standing still, and stay there once the drives are off.
fn falls<R>(before: &Before<R>, codes: &[DacCode; 2], reaction: Option<Reaction>) {
    let DacCode(still) = DacCode::from_volts(TRIM_V);
    for (&DacCode(then), &DacCode(now)) in before.codes.iter().zip(codes) {
        let [then, now] = [then, now].map(|code| i32::from(code) - i32::from(still));
        match (before.reaction, reaction) {
            (Some(Reaction::Ramp), Some(Reaction::Ramp)) => {
                assert!(now.abs() <= then.abs() && now * then >= 0, "a ramp from {then} to {now}");
            }
            (Some(Reaction::Immediate), Some(_)) => assert!(now.abs() <= 1, "{now} with the drives off"),
            _ => {}
        }
    }
}
