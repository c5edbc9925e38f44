//! Tests: reactions to faults at the limits of the number types.

use super::Kernel;
use crate::axis::AxesConfig;
use crate::fault::{FaultKind, Reaction, Reactions};
use crate::fixture::{GUARD, RULES, TestAxes, figures, guarded};
use crate::queue::Streams;
use crate::units::{Counts, DacCode, Position};

/// The longest ramp there is, from one end of the converter's range to a trim near the other.
#[test]
fn the_longest_ramp_falls_in_every_tick() {
    let figures = crate::axis::AxisFigures { output_offset_v: 9.9, ..figures() };
    let reactions = Reactions { ramp_ticks: u16::MAX, stop_ticks: 0, emergency_stop: Reaction::Immediate };
    let config = AxesConfig { reactions, ..guarded::<f32, 1>(figures, GUARD) };
    let mut kernel = Kernel::<f32, 1>::new(&config, [Position::ZERO], [Counts(0)]);
    let mut streams = Streams::<f32, 1, 2, 2>::new();
    let (_, mut intake) = streams.split(RULES, [Position::ZERO]);
    let mut bench = TestAxes::<1>::default();
    kernel.enable(0);
    kernel.tick(&mut intake, &mut bench);
    let still = bench.codes[0].0;
    kernel.guards.written = [DacCode(i16::MIN)];
    kernel.trip(FaultKind::Drive { axis: 0 });
    let mut last = i16::MIN;
    for tick in 1..=u32::from(u16::MAX) {
        assert_eq!((kernel.reaction(), kernel.clear_fault()), (Some(Reaction::Ramp), None), "tick {tick}");
        kernel.tick(&mut intake, &mut bench);
        let code = bench.codes[0].0;
        assert!((last..=still).contains(&code), "tick {tick}: {last} {code} {still}");
        last = code;
    }
    assert_eq!((last, kernel.reaction()), (still, Some(Reaction::Immediate)));
    assert!(kernel.clear_fault().is_some() && kernel.reaction().is_none());
}

/// As many axes as a round of samples has places for.
const MANY: usize = 31;

/// A kernel of many axes, at this place of a round of samples, after a tick in which the encoders of these axes jump.
fn jumped(axes: &[usize], sample_ticks: u8) -> Kernel<f32, MANY> {
    let config = guarded::<f32, MANY>(figures(), GUARD);
    let mut kernel = Kernel::<f32, MANY>::new(&config, [Position::ZERO; MANY], [Counts(0); MANY]);
    let mut streams = Streams::<f32, MANY, 2, 2>::new();
    let (_, mut intake) = streams.split(RULES, [Position::ZERO; MANY]);
    let mut bench = TestAxes::<MANY>::default();
    kernel.enable(0);
    kernel.tick(&mut intake, &mut bench);
    kernel.guards.sample_ticks = sample_ticks;
    for &axis in axes {
        bench.counts[axis] = Counts(123_456_789);
    }
    kernel.tick(&mut intake, &mut bench);
    kernel
}

/// Each of many axes is lost at every place of a round.
#[test]
fn any_of_many_axes_is_judged() {
    for lost in 0..MANY {
        for wait in 0..MANY * usize::from(crate::axis::SAMPLE_TICKS) {
            let fault = jumped(&[lost], wait as u8).fault().expect("lost");
            let is_it = matches!(fault.kind, FaultKind::EncoderJump { axis, .. } if axis == lost);
            assert!(is_it, "axis {lost} at {wait}: {fault:?}");
        }
    }
}

/// Encoders that fail in the same tick are all lost, though one of them alone is the fault; a reference finds an axis again.
#[test]
fn encoders_that_fail_together_are_all_lost() {
    for first in 0..MANY {
        let lost = [first, (first + 7) % MANY];
        let mut kernel = jumped(&lost, 0);
        for axis in 0..MANY {
            assert_eq!(kernel.has_lost_counts(axis), lost.contains(&axis), "axis {axis} of {lost:?}");
        }
        assert!(kernel.clear_fault().is_some() && kernel.has_lost_counts(first));
        assert!(kernel.reference(first, Counts(0), Position::ZERO).is_some());
        assert!(!kernel.has_lost_counts(first) && kernel.has_lost_counts(lost[1]));
    }
}

/// A fault between the order to enable the drives and the tick that would do it.
#[test]
fn drives_that_are_not_on_are_not_enabled_for_a_ramp() {
    let reactions = Reactions { ramp_ticks: 20, stop_ticks: 40, emergency_stop: Reaction::Ramp };
    for kind in [FaultKind::Drive { axis: 0 }, FaultKind::EmergencyStop, FaultKind::TickMissed { ticks: 1 }] {
        let config = AxesConfig { reactions, ..guarded::<f32, 1>(figures(), GUARD) };
        let mut kernel = Kernel::<f32, 1>::new(&config, [Position::ZERO], [Counts(0)]);
        let mut streams = Streams::<f32, 1, 2, 2>::new();
        let (_, mut intake) = streams.split(RULES, [Position::ZERO]);
        let mut bench = TestAxes::<1>::default();
        for settle_ticks in [0, 100] {
            kernel.tick(&mut intake, &mut bench);
            kernel.enable(settle_ticks);
            kernel.trip(kind);
            kernel.tick(&mut intake, &mut bench);
            let is_off = (Some(false), Some(Reaction::Immediate));
            assert_eq!((kernel.told, kernel.reaction()), is_off, "{kind:?}");
            assert!(kernel.clear_fault().is_some());
        }
        // In the tick itself.
        kernel.enable(0);
        bench.counts[0] = Counts(1_000_000);
        kernel.tick(&mut intake, &mut bench);
        assert!(kernel.fault().is_some() && kernel.told == Some(false), "{:?}", kernel.fault());
    }
}
