//! Everything that can break, at random ticks of random motion: found in its time, as itself, with its reaction, and the
//! machine moves again once it is mended.
//!
//! The oracle is what was injected, and the outputs' codes alone.

use std::collections::BTreeMap;

use hal_sim::Injection;
use motion_host::machine::Machine;
use motion_host::simulate::faults;
use motion_kernel::fault::{FaultKind, Reaction};
use motion_kernel::kernel::Kernel;
use motion_kernel::num::{Fixed, Real};

use super::machine::{Next, TickView, random_plan, run};
use super::setting;
use motion_tests::random::Random;

/// A round of looks at three axes [ticks].
const ROUND_TICKS: u64 = 24;
/// response_s in rounds, and two.
const RESPONSE_TICKS: u64 = (13.2e-3 / 0.5e-3 / 24.0 + 1.0) as u64 * ROUND_TICKS + 2 * ROUND_TICKS;

/// What is injected, and what must come of it.
#[derive(Clone, Copy, Debug)]
struct Case {
    name: &'static str,
    /// In which the fault must be found: ticks after the injection, or of commanded motion after it.
    within: Within,
    reaction: Reaction,
}

#[derive(Clone, Copy, Debug)]
enum Within {
    /// In the tick itself.
    TheTick,
    /// So many ticks of a command beyond ±moving_mm_s that keeps its sign.
    Commanded(u64),
    /// So many ticks of an output at its limit.
    Saturated(u64),
}

/// A reference machine whose following error may grow until the output is at its limit.
fn loose() -> Machine {
    let mut machine = Machine::reference();
    for axis in &mut machine.axes {
        axis.following_error_limit_mm = 400.0;
        // So little that it moves however great the load is.
        axis.drive.coulomb_friction_mm_s2 = 10.0;
    }
    machine
}

fn injection(name: &str, random: &mut Random, position_mm: f64) -> Option<Injection> {
    Some(match name {
        "encoder lost" => Injection::EncoderLost,
        "encoder jump" => {
            // Beyond twice the limit of a jump, and beyond what a tick moves, so that it is neither a stop nor a turn.
            let counts = random.log(4000.0, 1e6) as i32;
            Injection::EncoderJump { counts: if random.chance(0.5) { counts } else { -counts } }
        }
        "encoder reversed" => Injection::EncoderReversed,
        "drive reversed" => Injection::DriveReversed,
        "overload" => Injection::Overload { accel_limit_mm_s2: random.between(12.0, 40.0) },
        "drive not ready" => Injection::DriveNotReady,
        "drive" => Injection::DriveFault,
        "limit low" => Injection::LimitLow { at_mm: position_mm },
        "limit high" => Injection::LimitHigh { at_mm: position_mm },
        "emergency stop" => return None,
        other => panic!("{other}"),
    })
}

fn is_expected<R: Real>(case: &str, kind: &FaultKind<R>, at: usize) -> bool {
    match (case, *kind) {
        ("encoder lost", FaultKind::EncoderLost { axis })
        | ("encoder jump", FaultKind::EncoderJump { axis, .. })
        | ("encoder reversed" | "drive reversed", FaultKind::Runaway { axis })
        | ("overload", FaultKind::Saturated { axis })
        | ("drive not ready", FaultKind::DriveNotReady { axis })
        | ("drive", FaultKind::Drive { axis })
        | ("limit low" | "limit high", FaultKind::LimitSwitch { axis }) => axis == at,
        ("emergency stop", FaultKind::EmergencyStop) => true,
        _ => false,
    }
}

/// What came of an injection.
#[derive(Debug, Default)]
struct Outcome {
    /// Ticks that it took, from the injection on.
    ticks: Option<u64>,
    /// Of commanded motion or saturation.
    counted: u64,
}

/// One injection at `inject_at` of a program's run.
fn inject<R: Real>(case: &Case, machine: &Machine, seed: u64, longest_ticks: f64) -> Result<Outcome, String> {
    let mut random = Random::new(seed);
    let plan = random_plan(&mut random, machine, longest_ticks);
    // Not before the drives have settled.
    let inject_at = 25 + (random.unit() * plan.time_s / machine.tick_s) as u64;
    let axis = random.below(3);
    let at = |what: String| format!("{} seed {seed} tick {inject_at} axis {axis}: {what}", case.name);
    let mut outcome = Outcome::default();
    let mut error = None;
    let mut from: Option<([i16; 3], u64)> = None;
    let mut before = [0; 3];
    let mut sign = 0.0;
    let moving_mm_s = machine.axes[axis].guard_figures(machine.tick_s).moving_mm_s;
    let ramp_ticks = (machine.faults.ramp_s / machine.tick_s).round() as i64;
    let mut end = |problem: String| {
        error = Some(problem);
        Next::End
    };
    run::<R>(&plan, machine, &mut |tick, hardware, _: &mut Kernel<R, 3>, seen: Option<&TickView<R>>| {
        if tick == inject_at {
            let position_mm = seen.map_or(0.0, |seen| seen.position_mm[axis]);
            match injection(case.name, &mut random, position_mm) {
                Some(injection) => hardware.inject(axis, injection),
                None => hardware.injector.emergency_stop = true,
            }
        }
        let Some(seen) = seen else { return Next::GoOn };
        let codes = seen.codes();
        let Some(fault) = seen.trace.fault else {
            if tick > inject_at {
                let mm_s = seen.commanded_mm_s(machine, axis);
                let limit_mm_s = machine.axes[axis].reachable_mm_s() - 0.1;
                let counts = match case.within {
                    Within::TheTick => return end("not found in its tick".to_owned()),
                    Within::Commanded(_) => mm_s.abs() > moving_mm_s + 0.1,
                    Within::Saturated(_) => mm_s.abs() > limit_mm_s,
                };
                let goes_on = counts && mm_s * sign > 0.0;
                outcome.counted = if goes_on { outcome.counted + 1 } else { 0 };
                sign = if counts { mm_s.signum() } else { 0.0 };
                if let Within::Commanded(most) | Within::Saturated(most) = case.within
                    && outcome.counted > most
                {
                    return end(format!("not found in {most} ticks"));
                }
            }
            before = codes;
            return Next::GoOn;
        };
        let k = seen.trace.tick - fault.tick;
        if k == 0 {
            if !is_expected(case.name, &fault.kind, axis) {
                return end(format!("found {:?} in tick {}", fault.kind, fault.tick));
            }
            if fault.kind.reaction(machine.faults.emergency_stop) != case.reaction {
                return end(format!("reaction to {:?}", fault.kind));
            }
            if let Within::TheTick = case.within
                && fault.tick != inject_at
            {
                return end(format!("found in tick {}", fault.tick));
            }
            outcome.ticks = Some(fault.tick - inject_at);
            from = Some((before, fault.tick));
        }
        // Outputs and drives, tick by tick.
        let (ramp_from, _) = from.expect("the fault's first tick");
        let is_as_documented = match case.reaction {
            Reaction::Immediate => codes == [0; 3] && !seen.is_enabled,
            Reaction::Ramp => {
                let left = ramp_ticks - 1 - k as i64;
                let is_ramp = codes.iter().zip(ramp_from).all(|(&code, from)| {
                    let exact = f64::from(from) * left.max(0) as f64 / ramp_ticks as f64;
                    (f64::from(code) - exact).abs() <= 1.0
                });
                is_ramp && seen.is_enabled == (left > 0)
            }
            // On the path, with the drives on; the outputs are those of a motion.
            Reaction::Stop => seen.is_enabled != seen.is_off && (!seen.is_off || codes == [0; 3]),
        };
        if !is_as_documented {
            return end(format!("tick {k} of {:?}: {codes:?} from {ramp_from:?}", case.reaction));
        }
        if seen.is_off && k > ramp_ticks as u64 + 400 {
            hardware.injector.repair();
            if case.name == "drive reversed" {
                hardware.inject(axis, Injection::DriveReversed);
            }
            if case.name == "overload" {
                let accel_limit_mm_s2 = machine.axes[axis].drive.accel_limit_mm_s2;
                hardware.inject(axis, Injection::Overload { accel_limit_mm_s2 });
            }
            return Next::Recover([1.0, 1.0, -1.0]);
        }
        Next::GoOn
    });
    match error {
        Some(problem) => Err(at(problem)),
        None => Ok(outcome),
    }
}

/// Injects a fault at random ticks, most of which must find it.
fn many<R: Real>(case: &Case, machine: &Machine, longest_ticks: f64) {
    let (first, times) = (setting("MOTION_TEST_SEED", 1), setting("MOTION_TEST_FAULTS", 40));
    let (mut found, mut latest, mut wrong) = (0, 0, BTreeMap::new());
    for seed in first..first + times {
        match inject::<R>(case, machine, seed, longest_ticks) {
            Ok(Outcome { ticks: Some(ticks), .. }) => {
                found += 1;
                latest = latest.max(ticks);
            }
            Ok(_) => {}
            Err(problem) => {
                wrong.insert(seed, problem);
            }
        }
    }
    println!("{}: {found} of {times} found, the latest after {latest} ticks", case.name);
    assert!(
        wrong.is_empty(),
        "{} of {times}: {:#?}",
        wrong.len(),
        wrong.values().take(12).collect::<Vec<_>>()
    );
    let always = matches!(case.within, Within::TheTick);
    assert!(found == times || !always && found * 6 > times, "{found} of {times}");
}

macro_rules! cases {
    ($($test:ident: $name:literal, $within:expr, $reaction:ident;)*) => {$(
        #[test]
        fn $test() {
            let case = Case { name: $name, within: $within, reaction: Reaction::$reaction };
            many::<f32>(&case, &Machine::reference(), 6000.0);
            // The name is that of reports.
            let _ = faults::table();
        }
    )*};
}

cases! {
    encoder_lost: "encoder lost", Within::Commanded(RESPONSE_TICKS), Immediate;
    encoder_jump: "encoder jump", Within::TheTick, Ramp;
    encoder_reversed: "encoder reversed", Within::Commanded(RESPONSE_TICKS), Immediate;
    drive_reversed: "drive reversed", Within::Commanded(RESPONSE_TICKS), Immediate;
    drive_not_ready: "drive not ready", Within::TheTick, Ramp;
    drive_fault: "drive", Within::TheTick, Ramp;
    limit_low: "limit low", Within::TheTick, Ramp;
    limit_high: "limit high", Within::TheTick, Ramp;
    emergency_stop: "emergency stop", Within::TheTick, Immediate;
}

#[test]
fn overload() {
    let within = Within::Saturated(200 + 2 * ROUND_TICKS);
    let case = Case { name: "overload", within, reaction: Reaction::Stop };
    many::<f32>(&case, &loose(), 12_000.0);
}

/// The same in fixed point.
#[test]
fn in_fixed_point() {
    for (name, within, reaction) in [
        ("encoder lost", Within::Commanded(RESPONSE_TICKS), Reaction::Immediate),
        ("encoder jump", Within::TheTick, Reaction::Ramp),
        ("drive reversed", Within::Commanded(RESPONSE_TICKS), Reaction::Immediate),
    ] {
        many::<Fixed>(&Case { name, within, reaction }, &Machine::reference(), 6000.0);
    }
}
