//! What must hold at every tick, whatever the bytes.

use motion_kernel::exec::ExecState;
use motion_kernel::fault::{Fault, Reaction};
use motion_kernel::num::Real;
use motion_kernel::trace::Trace;
use motion_kernel::units::DacCode;

use super::items::{RULES, TICK_S};
use super::machine::TRIM_V;
use crate::judge::{self, Along, along};

/// A part of itself by which a limit may be exceeded: that of the tangent, twice.
const SHARE: f64 = 3e-5;
/// Steps of fixed point in a quantity that is a product of three.
const STEPS: f64 = 1e-6;
const PATH: judge::Judge = judge::Judge::new(&RULES, TICK_S, SHARE, STEPS);
/// A set position is rounded, and pieces may lie apart by so much \[mm\], sixteen of them in a tick.
const GAPS_MM: f64 = 17.0 * RULES.junction_gap_mm + 1e-4;

/// The tick before.
struct Before<R> {
    along: Along,
    set_mm: [f64; 2],
    fault: Option<Fault<R>>,
    /// How it ends.
    reaction: Option<Reaction>,
    codes: [DacCode; 2],
}

/// Judges one tick after the other.
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
        let now = along(&trace.executed.motion);
        PATH.limits(&now).unwrap_or_else(|error| panic!("{error}: {trace:?}"));
        let v = now[0];
        assert!(v >= 0.0, "backwards: {trace:?}");
        let rests = trace.executed.state != ExecState::Moving;
        assert!(trace.fault.is_some() || !rests || v == 0.0, "at rest with a feed: {trace:?}");
        let set_mm = trace.executed.setpoints.map(|axis| axis.position.to_mm());
        let codes = trace.axes.each_ref().map(|axis| axis.code);
        if let Some(before) = &self.before {
            if !self.is_torn {
                is_continuous(before, trace, &now, &set_mm);
            }
            if let Some(fault) = before.fault {
                assert_eq!(trace.fault, Some(fault), "a fault stays");
                assert!(reaction >= before.reaction, "{reaction:?} after {:?}: {trace:?}", before.reaction);
            }
            falls(before, &codes, reaction);
        }
        self.before = Some(Before { along: now, set_mm, fault: trace.fault, reaction, codes });
    }
}

/// Neither the feed nor the set position steps.
fn is_continuous<R: Real>(before: &Before<R>, trace: &Trace<R, 2>, now: &Along, set_mm: &[f64; 2]) {
    // What ends inside a tick and rests begins anew after it: from one side only.
    PATH.feed(&before.along, now).unwrap_or_else(|error| panic!("{error}: {trace:?}"));
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
