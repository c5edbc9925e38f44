//! Homing over the link: references, what ends it, what is lost.

use hal_sim::{HomeParameters, IndexParameters, SimHome, SwitchParameters};
use motion_kernel::fault::FaultKind;
use motion_kernel::homing::{AxisHoming, Homed, HomingConfig, HomingFigures};
use motion_kernel::jog::Direction;
use motion_kernel::link::{HomingFailure, HomingProgress, Mode, State};
use motion_kernel::units::{Counts, Position};

use super::{DEAD_MAN_MS, Operator, Seen, board_with, names};
use crate::fixture::{AXES, TICK_S, machine};

/// All axes towards lesser positions; the second one with its index.
pub(super) fn figures() -> HomingFigures<AXES> {
    let rules = machine().header().rules;
    let at = |mm| Position::from_mm(mm).expect("in range");
    let axes = core::array::from_fn(|axis| {
        let config = HomingConfig {
            direction: Direction::Negative,
            fast_mm_s: 40.0,
            slow_mm_s: 2.0,
            travel_mm: 60.0,
            back_off_mm: 40.0,
            index_mm: (axis < 2).then_some(11.0),
            position: at(-50.0),
            park: Some(at(-45.0)),
        };
        let config = if axis == 0 { HomingConfig { index_mm: None, ..config } } else { config };
        Some(AxisHoming { config, feed_mm_s: rules.feed_mm_s, limits: rules.limits })
    });
    HomingFigures { axes }
}

/// Where switches close \[mm\], and index pulses every 10 mm.
const CLOSES_MM: f64 = -20.0;

fn homes() -> [Option<SimHome>; AXES] {
    core::array::from_fn(|axis| Some(home(axis, axis < 2)))
}

fn home(axis: usize, has_index: bool) -> SimHome {
    let mm_per_count = machine().header().axes[axis].mm_per_count;
    let counts = |mm: f64| (mm / mm_per_count).round() as i64;
    let switch = SwitchParameters { closes_mm: (CLOSES_MM - 60.0, CLOSES_MM), hysteresis_mm: 0.2 };
    let index = IndexParameters { counts: counts(10.0).abs(), at: Counts(counts(CLOSES_MM - 3.0)) };
    let parameters = HomeParameters { switch: Some(switch), index: has_index.then_some(index) };
    SimHome::new(parameters, 0.0, Counts(0))
}

/// The count at which the index of an axis is.
fn index_counts(axis: usize) -> i64 {
    ((CLOSES_MM - 3.0) / machine().header().axes[axis].mm_per_count).round() as i64
}

/// Enables, asks for `axes` to be homed with a dead man, and is over when that has ended; what it has come to, and every set position since.
fn homed(
    axes: u16,
    homes: [Option<SimHome>; AXES],
    dead_man_ms: u16,
    mut meanwhile: impl FnMut(u32, &mut Operator),
) -> (HomingProgress, [Option<Homed>; AXES], Seen) {
    let (mut step, mut last, mut since) = (0, None, 0);
    let seen = board_with(homes, |now, operator| {
        let aborts = operator.host.controls().aborts;
        let told = operator.status.filter(|status| status.aborts == aborts);
        match step {
            0 if told.is_some_and(|status| status.is_ready) => {
                assert!(operator.host.enable(true));
                step = 1;
            }
            1 if told.is_some_and(|status| status.state == State::Held) => {
                assert!(operator.host.home(axes, dead_man_ms));
                // Before it is sent.
                meanwhile(0, operator);
                (step, since) = (2, now);
            }
            2 => {
                meanwhile(now - since, operator);
                if let Some(status) = told
                    && now > since + 10
                    && !matches!(status.homing, HomingProgress::None | HomingProgress::UnderWay { .. })
                {
                    last = Some(status);
                    (step, since) = (3, now);
                }
            }
            // What has ended stays at rest.
            3 if now > since + 400 => {
                let (status, last) = (operator.status.expect("told"), last.expect("ended"));
                assert_eq!((status.set, status.homing), (last.set, last.homing), "it moves");
                return true;
            }
            _ => {}
        }
        false
    });
    let last = last.expect("ended");
    (last.homing, last.homed, seen)
}

/// One axis after the other, each to its reference and its park position; over a wire that loses a tenth, too, to the count.
#[test]
fn axes_are_homed_one_after_the_other() {
    let park = Position::from_mm(-45.0).expect("in range");
    let mut clean = None;
    for loses in [0, 100, 300] {
        println!("loses {loses} of 1000 frames");
        let (progress, found, seen) = homed(0b110, homes(), 3000, |_, operator| operator.loses = loses);
        assert_eq!(progress, HomingProgress::Done);
        let [None, Some(y), Some(z)] = found else { panic!("{found:?}") };
        assert_eq!(y.counts, Counts(index_counts(1)));
        assert_eq!(z.index_counts, None);
        assert_eq!(*clean.get_or_insert(found), found);
        let (state, set) = *seen.states.last().expect("told");
        assert_eq!((state, [set[1], set[2]]), (State::Held, [park; 2]));
        let names = names(&seen);
        assert_eq!(names, [State::Off, State::Held, State::Homing, State::Held]);
    }
}

/// Without an index the reference is where the tick saw the switch close, however seldom the background is polled.
#[test]
fn a_switch_is_a_reference_to_the_tick() {
    let mm_per_count = machine().header().axes[2].mm_per_count;
    // At the slow feed, in a tick; and rounding.
    let most_counts =
        (figures().axes[2].expect("homed").config.slow_mm_s * TICK_S / mm_per_count).abs() + 2.0;
    for polled_in in [1, 7, 40] {
        let (progress, found, _) = homed(0b100, homes(), 3000, |_, operator| operator.polled_in = polled_in);
        assert_eq!(progress, HomingProgress::Done);
        let Counts(counts) = found[2].expect("homed").counts;
        let off_counts = counts as f64 - CLOSES_MM / mm_per_count;
        println!("polled in one of {polled_in} ticks: {off_counts} counts off");
        assert!(off_counts.abs() <= most_counts, "{off_counts} counts, at most {most_counts}");
    }
}

#[test]
fn what_cannot_be_homed_is_refused_by_name() {
    let failed = |axis, failure| HomingProgress::Failed { axis, failure };
    let of = |axes, homes| homed(axes, homes, DEAD_MAN_MS, |_, _| {}).0;
    assert_eq!(of(0b1000, homes()), failed(3, HomingFailure::NoSettings));
    assert_eq!(of(0, homes()), failed(0, HomingFailure::NoSettings));
    assert_eq!(of(0b100, [const { None }; AXES]), failed(2, HomingFailure::NoSwitch { travel_mm: 60.0 }));
    let none = [None, None, homes()[2].clone()];
    assert_eq!(of(0b110, none), failed(1, HomingFailure::NoSwitch { travel_mm: 60.0 }));
    // Where the switch is and no input for the index.
    let mut no_latch = homes();
    no_latch[1] = Some(home(1, false));
    assert_eq!(of(0b10, no_latch), failed(1, HomingFailure::NoLatch));
}

/// Whatever ends homing, at any time, ends it at rest and by its name; the axes before stay homed.
#[test]
fn what_ends_homing_early_is_named() {
    for at in [0, 1, 300, 900, 2000, 3500, 5000] {
        println!("after {at} ticks");
        let ended = |does: &mut dyn FnMut(u32, &mut Operator)| {
            let (progress, _, seen) =
                homed(0b11, homes(), DEAD_MAN_MS, |ticks, operator| does(ticks, operator));
            let HomingProgress::Failed { failure, .. } = progress else { panic!("{progress:?}") };
            (failure, seen.states.last().map(|&(state, _)| state))
        };
        let aborts = ended(&mut |ticks, operator| {
            if ticks == at {
                assert!(operator.host.abort());
            }
        });
        assert_eq!(aborts, (HomingFailure::Aborted, Some(State::Held)));
        let holds = ended(&mut |ticks, operator| {
            if ticks == at {
                assert!(operator.host.press(Mode::Hold));
            }
        });
        assert_eq!(holds, (HomingFailure::Aborted, Some(State::Held)));
        let button = ended(&mut |ticks, operator| operator.is_held = ticks >= at);
        assert_eq!(button, (HomingFailure::Aborted, Some(State::Held)));
        // Back long after the time.
        let since = at.max(1);
        let silent = ended(&mut |ticks, operator| {
            operator.is_silent = (since..since + 2000).contains(&ticks);
        });
        assert_eq!(silent, (HomingFailure::Silent, Some(State::Held)));
        let off = ended(&mut |ticks, operator| {
            if ticks == at {
                assert!(operator.host.enable(false));
            }
        });
        assert_eq!(off, (HomingFailure::DrivesOff, Some(State::Off)));
        let fault = ended(&mut |ticks, operator| {
            operator.unhealthy = (ticks >= at).then_some(FaultKind::EmergencyStop);
        });
        assert_eq!(fault, (HomingFailure::Fault, Some(State::Off)));
    }
}

/// An axis whose encoder was lost is not homed any more, also where another fault was there first; the others are, also with
/// the drives off in between.
#[test]
fn a_lost_encoder_is_not_homed() {
    for is_first in [true, false] {
        println!("as the first fault: {is_first}");
        lose_an_encoder(is_first);
    }
}

fn lose_an_encoder(is_first: bool) {
    let mut step = 0;
    let mut since = 0;
    board_with(homes(), |now, operator| {
        let aborts = operator.host.controls().aborts;
        let Some(status) = operator.status.filter(|status| status.aborts == aborts) else { return false };
        let is_homed = status.homed.map(|homed| homed.is_some());
        match step {
            0 => {
                assert!(operator.host.enable(true));
                step = 1;
            }
            1 if status.state == State::Held => {
                assert!(operator.host.home(0b11, DEAD_MAN_MS));
                step = 2;
            }
            2 if status.homing == HomingProgress::Done => {
                assert_eq!(is_homed, [true, true, false]);
                operator.unhealthy = Some(FaultKind::EmergencyStop).filter(|_| !is_first);
                (step, since) = (3, now);
            }
            3 if now == since + 100 => {
                operator.unhealthy = Some(FaultKind::EncoderLost { axis: 1 });
            }
            3 if now > since + 500 => {
                assert_eq!(is_homed, [true, false, false]);
                operator.unhealthy = None;
                assert!(operator.host.clear_fault() && operator.host.enable(true));
                (step, since) = (4, now);
            }
            4 if now > since + 1000 => {
                assert_eq!((is_homed, status.state), ([true, false, false], State::Held));
                step = 5;
            }
            _ => {}
        }
        step == 5
    });
}
