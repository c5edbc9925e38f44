//! Faults of the kernel: typed, latched, the first one stays, outputs 0 V, drives disabled, and a defined
//! way back.

use hal_sim::{AxisParameters, MachineParameters, SimMachine};
use motion_host::machine::Machine;
use motion_host::simulate::hardware::SimulatedHardware;
use motion_kernel::axis::AxesConfig;
use motion_kernel::exec::{ExecFault, ExecState};
use motion_kernel::fault::FaultKind;
use motion_kernel::hal::{AxisInputs, Encoder};
use motion_kernel::kernel::Kernel;
use motion_kernel::queue::{Feeder, Intake, Streams};
use motion_kernel::units::{Counts, DacCode, Position};
use motion_tests::axes::{MM_PER_COUNT, TestAxes};
use motion_tests::check::bench::{LIMITS, RULES, line, mm, point, ramp, rest_to_rest};

/// Two axes of the reference machine, with another limit of the following error.
fn kernel() -> Kernel<f32, 2> {
    let mut machine = Machine::reference();
    for axis in &mut machine.axes {
        axis.following_error_limit_mm = 0.5;
        axis.mm_per_count = MM_PER_COUNT;
    }
    let [x, y, _] = machine.axes;
    let config = AxesConfig::new(&[x.figures(), y.figures()], machine.tick_s).expect("axes");
    let mut kernel = Kernel::new(&config, point([0.0, 0.0]), [Counts(0); 2]);
    kernel.enable(0);
    kernel
}

/// What is found when the codes are on their way already: they are 0 V from the next tick on.
fn is_found_writing(kind: &FaultKind<f32>) -> bool {
    matches!(kind, FaultKind::Output | FaultKind::Enable)
}

/// One tick of a bench that follows: its encoders read what was set.
fn tick(
    kernel: &mut Kernel<f32, 2>,
    intake: &mut Intake<'_, f32, 2>,
    axes: &mut TestAxes,
) -> Option<FaultKind<f32>> {
    let trace = *kernel.tick(intake, axes);
    if trace.fault.is_none() {
        axes.follow(&trace);
    } else if trace.fault.is_some_and(|fault| fault.tick < trace.tick || !is_found_writing(&fault.kind)) {
        assert!(trace.axes.iter().all(|axis| axis.code == DacCode::ZERO), "{trace:?}");
    }
    assert_eq!(trace.fault.map(|fault| fault.kind), kernel.fault().map(|fault| fault.kind));
    trace.fault.map(|fault| fault.kind)
}

/// 20 mm along X from `from_mm`, whole.
fn offer(feeder: &mut Feeder<'_, f32, 2>, from_mm: f64) {
    for part in [0.0, 10.0] {
        feeder.piece(line([from_mm + part, 0.0], [1.0, 0.0], 10.0)).expect("a piece");
    }
    for segment in rest_to_rest(mm(20.0), 50.0) {
        feeder.segment(segment).expect("a segment");
    }
    feeder.end_stretch(point([from_mm + 20.0, 0.0])).expect("its end");
}

/// In the middle of a move: the machine, its streams, and what it has done.
fn moving(then: impl FnOnce(&mut Kernel<f32, 2>, &mut Intake<'_, f32, 2>, &mut TestAxes)) {
    let (mut kernel, mut axes) = (kernel(), TestAxes::default());
    let mut streams = Streams::<f32, 2, 8, 8>::new();
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    offer(&mut feeder, 0.0);
    for _ in 0..100 {
        assert_eq!(tick(&mut kernel, &mut intake, &mut axes), None);
    }
    assert!(axes.is_enabled && axes.written[0] != DacCode::ZERO);
    then(&mut kernel, &mut intake, &mut axes);
}

/// Runs into a fault that `break_it` provokes at tick 100, and checks all that is promised about it.
fn provoke(
    break_it: impl Fn(&mut TestAxes),
    repair: impl Fn(&mut TestAxes),
    is_expected: impl Fn(&FaultKind<f32>) -> bool,
) {
    moving(|kernel, intake, axes| {
        let mut fault = None;
        for _ in 0..400 {
            break_it(axes);
            fault = fault.or(tick(kernel, intake, axes));
        }
        let fault = fault.expect("a fault");
        assert!(is_expected(&fault), "{fault:?}");
        let latched = kernel.fault().expect("latched");
        // Repaired it stays, and another failure does not replace it.
        repair(axes);
        assert_eq!(tick(kernel, intake, axes), Some(fault));
        axes.fails.latch = true;
        axes.fails.write = true;
        tick(kernel, intake, axes);
        (axes.fails.latch, axes.fails.write) = (false, false);
        for _ in 0..10 {
            assert_eq!(tick(kernel, intake, axes), Some(fault));
        }
        assert_eq!(kernel.fault(), Some(latched));
        assert!(!axes.is_enabled && axes.written == [DacCode::ZERO; 2], "{axes:?}");
        // The way back: cleared, at rest where the axes are, with new streams.
        let stands = kernel.clear_fault().expect("off");
        assert_eq!(kernel.fault(), None);
        let here = axes.counts.map(|Counts(counts)| counts as f64 * MM_PER_COUNT);
        for (found, here) in stands.iter().zip(here) {
            assert!((found.to_mm() - here).abs() < 1e-9);
        }
        let mut streams = Streams::<f32, 2, 8, 8>::new();
        let (mut feeder, mut intake) = streams.split(RULES, point(here));
        offer(&mut feeder, here[0]);
        // Not before it is asked to.
        for _ in 0..3 {
            let trace = kernel.tick(&mut intake, axes);
            assert!(trace.executed.state == ExecState::Idle && !axes.is_enabled);
        }
        kernel.enable(5);
        for settling in 0..5 {
            let trace = kernel.tick(&mut intake, axes);
            assert!(trace.executed.state == ExecState::Idle && axes.is_enabled, "{settling}");
        }
        for _ in 0..20_000 {
            let trace = *kernel.tick(&mut intake, axes);
            assert_eq!(trace.fault, None);
            axes.follow(&trace);
            let set = trace.executed.setpoints.map(|axis| axis.position);
            if trace.executed.stretches == 1 && trace.executed.state == ExecState::Idle {
                assert!(axes.is_enabled);
                assert_eq!(set, [mm(here[0] + 20.0), mm(here[1])]);
                return;
            }
        }
        panic!("it did not move again");
    });
}

#[test]
fn an_axis_that_stands_still_is_a_following_error() {
    let stuck = |axes: &mut TestAxes| axes.counts[0] = Counts(0);
    provoke(
        stuck,
        |_| {},
        |kind| matches!(*kind, FaultKind::FollowingError { axis: 0, error_mm } if error_mm > 0.5 && error_mm < 0.6),
    );
}

#[test]
fn encoders_that_can_not_be_read_are_a_fault() {
    provoke(|b| b.fails.latch = true, |b| b.fails.latch = false, |k| matches!(k, FaultKind::Encoder));
}

#[test]
fn a_converter_that_can_not_be_written_is_a_fault() {
    provoke(|b| b.fails.write = true, |b| b.fails.write = false, |k| matches!(k, FaultKind::Output));
}

#[test]
fn inputs_that_can_not_be_read_are_a_fault() {
    provoke(|b| b.fails.inputs = true, |b| b.fails.inputs = false, |k| matches!(k, FaultKind::Inputs));
}

#[test]
fn an_open_emergency_stop_is_a_fault() {
    provoke(
        |b| b.inputs.emergency_stop = true,
        |b| b.inputs.emergency_stop = false,
        |k| matches!(k, FaultKind::EmergencyStop),
    );
}

#[test]
fn a_drive_that_reports_a_fault_is_one() {
    provoke(
        |b| b.inputs.axes[1] = AxisInputs::HEALTHY.with_fault(true),
        |b| b.inputs.axes[1] = AxisInputs::HEALTHY,
        |k| matches!(k, FaultKind::Drive { axis: 1 }),
    );
}

/// The first tick can't enable the drives: no motion with them off.
#[test]
fn drives_that_can_not_be_enabled_do_not_move() {
    let (mut kernel, mut axes) = (kernel(), TestAxes::default());
    axes.fails.enable = true;
    let mut streams = Streams::<f32, 2, 8, 8>::new();
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    offer(&mut feeder, 0.0);
    tick(&mut kernel, &mut intake, &mut axes);
    let before = kernel.fault();
    assert!(matches!(before.map(|fault| fault.kind), Some(FaultKind::Enable)), "{before:?}");
    axes.fails.enable = false;
    tick(&mut kernel, &mut intake, &mut axes);
    assert!(kernel.fault() == before && axes.written == [DacCode::ZERO; 2] && !axes.is_enabled);
}

/// Runs dry inside a stretch: as much as fits the queues, then nothing more.
fn starve(is_path: bool) {
    let (mut kernel, mut axes) = (kernel(), TestAxes::default());
    let mut streams = Streams::<f32, 2, 8, 4>::new();
    let (mut feeder, mut intake) = streams.split(RULES, point([0.0, 0.0]));
    // Both streams are full (one place stays empty), so the stretch may start; then the rest of the path
    // is missing, or the fourth segment.
    let (path_mm, top_mm_s) = if is_path { (10.0, 50.0) } else { (80.0, 30.0) };
    let part_mm = path_mm / 7.0;
    for part in 0..7 {
        feeder.piece(line([f64::from(part) * part_mm, 0.0], [1.0, 0.0], part_mm)).expect("a piece");
    }
    for (from, to) in [(0.0, 0.5 * top_mm_s), (0.5 * top_mm_s, 0.8 * top_mm_s), (0.8 * top_mm_s, top_mm_s)] {
        feeder.segment(ramp(LIMITS, from, to)).expect("a ramp");
    }
    let mut fault = None;
    for _ in 0..10_000 {
        let trace = *kernel.tick(&mut intake, &mut axes);
        if trace.fault.is_none() {
            assert!(trace.executed.motion.v_mm_s <= top_mm_s as f32);
            let set = trace.executed.setpoints.map(|axis| axis.position.to_mm());
            assert!(!is_path || set[0] <= path_mm);
            axes.follow(&trace);
        } else {
            assert!(trace.axes.iter().all(|axis| axis.code == DacCode::ZERO));
        }
        assert!(fault.is_none() || fault == trace.fault, "latched");
        fault = trace.fault;
    }
    let expected = if is_path { ExecFault::PathStarved } else { ExecFault::FeedStarved };
    assert_eq!(fault.map(|fault| fault.kind), Some(FaultKind::Executor(expected)));
    assert!(!axes.is_enabled && axes.written == [DacCode::ZERO; 2]);
}

#[test]
fn a_path_that_runs_dry_is_a_fault_and_stays_one() {
    starve(true);
}

#[test]
fn a_feed_that_runs_dry_is_a_fault_and_stays_one() {
    starve(false);
}

/// The converter's bus fails in the middle of a move, on the simulated machine: when it is back, the first
/// thing it gets is 0 V, although the axes do not stand where they were set.
#[test]
fn a_converter_bus_that_comes_back_first_gets_0_v() {
    let reference = Machine::reference();
    for frames in [0, 1, 2, 3, 401, 402, 403, 404] {
        let axis = AxisParameters::REFERENCE_X;
        let parameters = MachineParameters::at_reference_tick([axis; 3]);
        let simulated = SimMachine::<3, _, _>::new(&parameters).expect("a machine");
        let mut hardware = SimulatedHardware::new(&simulated).expect("a converter");
        let Ok(counts) = hardware.latch();
        let start = [Position::ZERO; 3];
        let mut kernel = Kernel::<f32, 3>::new(&reference.axes_config().expect("axes"), start, counts);
        kernel.enable(0);
        let mut streams = Streams::<f32, 3, 8, 8>::new();
        let (mut feeder, mut intake) = streams.split(reference.rules(), start);
        let piece = motion_kernel::path::Piece::line(1, start, [1.0, 0.0, 0.0], mm(10.0)).expect("a piece");
        feeder.piece(piece).expect("room");
        for segment in rest_to_rest(mm(10.0), 50.0) {
            feeder.segment(segment).expect("room");
        }
        feeder.end_stretch([mm(10.0), mm(0.0), mm(0.0)]).expect("room");
        // The frames of 100 ticks, then some.
        for _ in 0..100 {
            assert_eq!(kernel.tick(&mut intake, &mut hardware).fault, None);
            simulated.advance();
        }
        simulated.chip().fail_bus_after(Some(frames));
        let mut ticks = 100;
        while kernel.fault().is_none() {
            kernel.tick(&mut intake, &mut hardware);
            simulated.advance();
            ticks += 1;
        }
        let fault = kernel.fault().expect("a fault");
        assert!(matches!(fault.kind, FaultKind::Output), "{fault:?}");
        // Four frames a tick.
        assert_eq!(fault.tick, 100 + frames / 4, "{frames} frames");
        assert_eq!(ticks, fault.tick + 1);
        assert!(!simulated.is_enabled());
        simulated.chip().fail_bus_after(None);
        kernel.tick(&mut intake, &mut hardware);
        assert_eq!(simulated.chip().volts()[..3], [0.0; 3]);
        assert_eq!(kernel.fault(), Some(fault));
    }
}

/// What the board has found ends like any other fault, in the very next tick, whose number it has.
#[test]
fn a_fault_that_the_board_reports_ends_motion_in_the_next_tick() {
    for kind in [FaultKind::EmergencyStop, FaultKind::Drive { axis: 1 }] {
        moving(|kernel, intake, axes| {
            kernel.trip(kind);
            kernel.trip(FaultKind::Encoder); // not the first one
            let trace = *kernel.tick(intake, axes);
            assert_eq!(trace.fault.map(|fault| (fault.kind, fault.tick)), Some((kind, trace.tick)));
            assert_eq!(trace.tick, 100);
            assert!(!axes.is_enabled && axes.written == [DacCode::ZERO; 2], "{axes:?}");
            kernel.enable(0);
            assert_eq!(tick(kernel, intake, axes), Some(kind));
            assert!(!axes.is_enabled, "a fault is not enabled away");
        });
    }
}

/// Disabling is no fault: outputs and drives go off, and the streams stand still.
#[test]
fn disabling_takes_effect_in_the_next_tick() {
    moving(|kernel, intake, axes| {
        kernel.disable();
        let set = kernel.tick(intake, axes).executed.setpoints[0].position;
        assert!(!axes.is_enabled && axes.written == [DacCode::ZERO; 2], "{axes:?}");
        for _ in 0..10 {
            let trace = kernel.tick(intake, axes);
            assert_eq!((trace.fault, trace.executed.setpoints[0].position), (None, set));
        }
        assert_eq!(kernel.stand_here()[0].to_bits() >> 20, set.to_bits() >> 20);
    });
}

/// Drives that come back in the middle of a stretch hold still. What is left of it does not move them: it does not
/// start where they stand.
#[test]
fn enabling_after_disabling_stands_still() {
    moving(|kernel, intake, axes| {
        kernel.disable();
        kernel.tick(intake, axes);
        kernel.enable(400);
        for _ in 0..400 {
            let trace = kernel.tick(intake, axes);
            assert_eq!((trace.fault, trace.executed.state), (None, ExecState::Idle));
            assert!(axes.is_enabled && axes.written == [DacCode::ZERO; 2], "{axes:?}");
        }
        let fault = kernel.tick(intake, axes).fault.map(|fault| fault.kind);
        assert_eq!(fault, Some(FaultKind::Executor(ExecFault::NotHere)));
    });
}

/// The peak is the greatest magnitude since it was last asked for.
#[test]
fn peaks_are_held_until_they_are_taken() {
    moving(|kernel, intake, axes| {
        let first = kernel.take_peak_following_error_mm();
        assert!(first[0] > 0.0 && first[1].abs() < 1e-6, "{first:?}");
        assert!(kernel.take_peak_following_error_mm().iter().all(|peak| *peak == 0.0));
        // 0.2 mm ahead for one tick.
        axes.counts[0].0 += 2000;
        kernel.tick(intake, axes);
        axes.counts[0].0 -= 2000;
        for _ in 0..5 {
            tick(kernel, intake, axes);
        }
        let peak = kernel.take_peak_following_error_mm()[0];
        assert!((0.19..0.21).contains(&peak), "{peak}");
    });
}
