//! Stops, ramps, and what is more urgent; limit switches that one drives off; soft limits; a board's faults.

use hal_sim::Injection;
use motion_host::machine::Machine;
use motion_host::planning::Plan;
use motion_kernel::exec::ExecState;
use motion_kernel::fault::{FaultKind, Reaction};
use motion_kernel::kernel::Kernel;

use super::machine::{Next, TickView, random_plan, run};
use super::setting;
use motion_tests::check::drive;
use motion_tests::check::totals::Totals;
use motion_tests::random::Random;

fn plan(text: &str, machine: &Machine) -> Plan {
    let mode = motion_host::planning::Mode::Spanning;
    drive::plan(text, machine, mode, &mut Totals::default()).expect("a plan").expect("not dense")
}

/// The reactions in the order of their urgency.
#[test]
fn more_urgent_is_greater() {
    assert!(Reaction::Stop < Reaction::Ramp && Reaction::Ramp < Reaction::Immediate);
}

/// A missed tick, as a board reports it, at random ticks: the motion ends on its path, within the path's limits, and the
/// drives go off at rest.
#[test]
fn a_stop_stays_on_the_path_and_within_its_limits() {
    let machine = Machine::reference();
    let (first, times) = (setting("MOTION_TEST_SEED", 1), setting("MOTION_TEST_FAULTS", 40));
    let (mut longest, mut moving) = (0, 0);
    for seed in first..first + times {
        let mut random = Random::new(seed);
        let plan = random_plan(&mut random, &machine, 6000.0);
        let at = 25 + (random.unit() * plan.time_s / machine.tick_s) as u64;
        let (mut last_s_mm, mut stretches) = (0.0, 0);
        let (mut last_a, mut ended) = (0.0, None);
        run::<f64>(
            &plan,
            &machine,
            &mut |tick, _, kernel: &mut Kernel<f64, 3>, seen: Option<&TickView<f64>>| {
                if tick == at {
                    kernel.trip(FaultKind::TickMissed { ticks: 2 });
                }
                let Some(seen) = seen else { return Next::GoOn };
                let motion = seen.trace.executed.motion;
                if tick > at {
                    let found = seen.trace.fault.map(|fault| (fault.tick, fault.kind));
                    assert_eq!(found, Some((at, FaultKind::TickMissed { ticks: 2 })), "seed {seed}");
                    if tick == at + 1 && motion.v_mm_s > 0.0 {
                        moving += 1;
                    }
                    if !seen.is_off {
                        assert!(seen.is_enabled, "seed {seed} tick {tick}");
                        let limits = &machine.path;
                        assert!(
                            motion.a_mm_s2.abs() <= limits.accel_mm_s2 * 1.000_001,
                            "seed {seed} tick {tick}"
                        );
                        let jerk = (motion.a_mm_s2 - last_a) / machine.tick_s;
                        assert!(jerk.abs() <= limits.jerk_mm_s3 * 1.001, "seed {seed} tick {tick}: {jerk}");
                        // Never back, but for rounding.
                        let s_mm = motion.s.to_mm();
                        let is_new = seen.trace.executed.stretches != stretches;
                        assert!(s_mm >= last_s_mm - 1e-9 || is_new, "seed {seed} tick {tick}");
                        for axis in seen.trace.axes {
                            assert!(axis.following_error_mm.abs() < 0.1, "seed {seed} tick {tick}");
                        }
                    } else if ended.is_none() {
                        assert!(motion.v_mm_s == 0.0 && !seen.is_enabled && seen.codes() == [0; 3]);
                        ended = Some(tick - at);
                    }
                }
                (last_s_mm, last_a) = (motion.s.to_mm(), motion.a_mm_s2);
                stretches = seen.trace.executed.stretches;
                if ended.is_some_and(|ended| tick > at + ended + 400) {
                    Next::Recover([1.0, 1.0, -1.0])
                } else {
                    Next::GoOn
                }
            },
        );
        longest = longest.max(ended.unwrap_or_else(|| panic!("seed {seed}: no end")));
    }
    println!("{moving} of {times} in motion, the longest stop took {longest} ticks");
    assert!(longest < 4000 && moving * 2 > times, "{longest} ticks, {moving} in motion");
}

/// What comes later stays unsaid, but an emergency stop ends a stop and a ramp at once, and a drive's fault ends a stop in
/// a ramp.
#[test]
fn the_first_fault_stays_and_the_most_urgent_reaction_is_taken() {
    let machine = Machine::reference();
    let plan = plan("G21 G90 G61\nG1 X200 F6000\n", &machine);
    let [missed, drive] = [FaultKind::TickMissed { ticks: 1 }, FaultKind::Drive { axis: 2 }];
    let urgent: [(FaultKind<f32>, Option<FaultKind<f32>>, Reaction); 6] = [
        (missed, None, Reaction::Stop),
        (missed, Some(drive), Reaction::Ramp),
        (missed, Some(FaultKind::EmergencyStop), Reaction::Immediate),
        (drive, Some(missed), Reaction::Ramp),
        (drive, Some(FaultKind::EmergencyStop), Reaction::Immediate),
        (FaultKind::EmergencyStop, Some(missed), Reaction::Immediate),
    ];
    for (kind, then, reaction) in urgent {
        let mut off = None;
        run::<f32>(&plan, &machine, &mut |tick, _, kernel, seen| {
            if tick == 1000 {
                kernel.trip(kind);
            }
            if let Some(then) = then
                && tick == 1010
            {
                kernel.trip(then);
            }
            let Some(seen) = seen else { return Next::GoOn };
            assert_eq!(seen.trace.fault.map(|fault| fault.kind), (tick > 1000).then_some(kind));
            if seen.is_off && tick > 1000 {
                assert!(!seen.is_enabled && seen.codes() == [0; 3]);
                off = off.or(Some(tick - 1));
            }
            if off.is_some_and(|off| tick > off + 300) { Next::Recover([1.0, 1.0, -1.0]) } else { Next::GoOn }
        });
        let off = off.expect("off");
        let first = kind.reaction(Reaction::Immediate);
        let expected = match (first, reaction) {
            (Reaction::Immediate, _) => 1000..=1000,
            (_, Reaction::Immediate) => 1010..=1010,
            // 0.1 s, from the fault that asks for it.
            (Reaction::Ramp, _) => 1199..=1199,
            (Reaction::Stop, Reaction::Ramp) => 1209..=1209,
            (Reaction::Stop, Reaction::Stop) => 1300..=2500,
        };
        assert!(expected.contains(&off), "{kind:?} {then:?}: off in tick {off}, expected {expected:?}");
    }
}

/// The emergency stop does what the machine says; a stop that takes too long is given up.
#[test]
fn what_the_machine_says_of_its_reactions_is_done() {
    for (emergency_stop, ramp_s, stop_s, off_after) in [
        (Reaction::Immediate, 0.1, 2.0, 1..=1),
        (Reaction::Ramp, 0.1, 2.0, 200..=200),
        (Reaction::Ramp, 0.0, 2.0, 1..=1),
        (Reaction::Stop, 0.1, 2.0, 400..=1500),
        // 50 ticks of a stop, then a ramp of 20.
        (Reaction::Stop, 0.01, 0.025, 70..=71),
    ] {
        let mut machine = Machine::reference();
        machine.faults.emergency_stop = emergency_stop;
        (machine.faults.ramp_s, machine.faults.stop_s) = (ramp_s, stop_s);
        let plan = plan("G21 G90 G61\nG1 X200 F9000\n", &machine);
        let mut off = 0;
        run::<f32>(&plan, &machine, &mut |tick, hardware, _, seen| {
            hardware.injector.emergency_stop = tick >= 1000;
            let Some(seen) = seen else { return Next::GoOn };
            if tick > 1000 {
                assert_eq!(
                    seen.trace.fault.map(|fault| (fault.tick, fault.kind)),
                    Some((1000, FaultKind::EmergencyStop))
                );
                off += u64::from(!seen.is_off);
            }
            if tick > 1000 && seen.is_off { Next::End } else { Next::GoOn }
        });
        assert!(
            off_after.contains(&(off + 1)),
            "{emergency_stop:?} {ramp_s} {stop_s}: off after {}",
            off + 1
        );
    }
}

/// Between two stretches, whatever is about to begin: what rests when a fault asks for a stop does not begin to move.
#[test]
fn what_rests_does_not_begin_to_move() {
    let machine = Machine::reference();
    let plan = plan("G21 G90 G61\nG1 X2 F3000\nG4 P0.02\nG1 X4\nG1 Y3\n", &machine);
    let (mut resting, mut moving) = (0, 0);
    for at in 100..1200 {
        let (mut rests, mut last) = (false, [0.0; 3]);
        run::<f32>(&plan, &machine, &mut |tick, _, kernel, seen| {
            if let Some(seen) = seen {
                let set_mm = seen.trace.axes.map(|axis| axis.set.to_mm());
                if tick == at {
                    rests = seen.trace.executed.state != ExecState::Moving;
                    kernel.trip(FaultKind::TickMissed { ticks: 1 });
                } else if tick > at {
                    assert!(!rests || set_mm == last, "tripped in {at}, moves in {tick}");
                    assert!(!rests || tick < at + 3 || seen.is_off, "tripped in {at}, not off in {tick}");
                    if seen.is_off {
                        return Next::End;
                    }
                }
                last = set_mm;
            }
            Next::GoOn
        });
        (resting, moving) = (resting + u32::from(rests), moving + u32::from(!rests));
    }
    assert!(resting > 20 && moving > 20, "{resting} at rest, {moving} in motion");
}

/// An emergency stop that is a stop on the path hides nothing that breaks on the way, and nothing is cleared before the end.
#[test]
fn an_open_emergency_stop_hides_nothing() {
    let mut machine = Machine::reference();
    machine.faults.emergency_stop = Reaction::Stop;
    let plan = plan("G21 G90 G61\nG1 X200 F9000\n", &machine);
    let breaks = [Injection::DriveNotReady, Injection::DriveFault, Injection::LimitHigh { at_mm: -1.0 }];
    for then in breaks {
        let mut reactions = Vec::new();
        run::<f32>(&plan, &machine, &mut |tick, hardware, kernel, seen| {
            hardware.injector.emergency_stop = tick >= 1000;
            if tick == 1010 {
                hardware.inject(0, then);
            }
            let Some(seen) = seen else { return Next::GoOn };
            if let Some(reaction) = kernel.reaction() {
                assert_eq!(seen.trace.fault.map(|fault| fault.kind), Some(FaultKind::EmergencyStop));
                reactions.push(reaction);
            }
            if seen.is_off {
                return Next::End;
            }
            assert!(kernel.fault().is_none() || kernel.clear_fault().is_none(), "{then:?} in tick {tick}");
            Next::GoOn
        });
        // In the tick it breaks in.
        let stop = reactions.iter().filter(|&&reaction| reaction == Reaction::Stop).count();
        let ramp = reactions.iter().filter(|&&reaction| reaction == Reaction::Ramp).count();
        assert_eq!((stop, ramp, reactions.len()), (10, 199, 210), "{then:?}");
        assert!(reactions.is_sorted(), "{then:?}");
    }
}

/// A switch that is reached is a fault when it is reached and where motion is towards it; one can drive off it.
#[test]
fn a_limit_switch_is_driven_off_but_not_onto() {
    let machine = Machine::reference();
    for (sign, towards) in [(1.0, true), (1.0, false), (-1.0, true), (-1.0, false)] {
        let x_mm = if towards { 20.0 * sign } else { -20.0 * sign };
        let plan = plan(&format!("G21 G90 G61\nG1 X{x_mm} F3000\n"), &machine);
        let mut found = None;
        run::<f32>(&plan, &machine, &mut |tick, hardware, kernel, seen| {
            // Reached from the beginning, before the drives have settled.
            if tick == 0 {
                let at = if sign > 0.0 {
                    Injection::LimitHigh { at_mm: -0.001 }
                } else {
                    Injection::LimitLow { at_mm: 0.001 }
                };
                hardware.inject(0, at);
            }
            found = kernel.fault().map(|fault| fault.kind);
            if let Some(seen) = seen
                && found.is_some()
            {
                // Before it has moved by a micrometre.
                assert!(seen.position_mm[0].abs() < 1e-3, "{seen:?}");
                return Next::End;
            }
            Next::GoOn
        });
        assert_eq!(found, towards.then_some(FaultKind::LimitSwitch { axis: 0 }), "{sign} {towards}");
    }
}

/// A set position beyond the travel, of a program that was accepted without: found within a round of looks, and the motion
/// stops on its path.
#[test]
fn motion_beyond_the_travel_is_stopped() {
    let mut machine = Machine::reference();
    let plan = plan("G21 G90 G61\nG1 X50 Y-30 F6000\n", &machine);
    for (axis, travel_mm) in [(0, [-1.0, 25.0]), (1, [-10.0, 100.0])] {
        machine.axes[axis].travel_mm = Some(travel_mm);
        let (mut beyond, mut found) = (None, None);
        run::<f32>(&plan, &machine, &mut |tick, _, _, seen| {
            let Some(seen) = seen else { return Next::GoOn };
            let set_mm = seen.trace.axes[axis].set.to_mm();
            if set_mm > travel_mm[1] + 1e-3 || set_mm < travel_mm[0] - 1e-3 {
                beyond = beyond.or(Some(tick));
            }
            if let Some(fault) = seen.trace.fault {
                assert_eq!(fault.kind, FaultKind::SoftLimit { axis });
                found = found.or(Some(tick));
            }
            if seen.is_off && found.is_some() {
                assert!(seen.trace.executed.motion.v_mm_s == 0.0, "at rest");
                // Back, as far as the one that is beyond is concerned.
                return Next::Recover([-1.0, 1.0, 1.0]);
            }
            Next::GoOn
        });
        let (beyond, found) = (beyond.expect("beyond"), found.expect("found"));
        assert!(found - beyond <= 24, "{} ticks", found - beyond);
        machine.axes[axis].travel_mm = None;
    }
}
