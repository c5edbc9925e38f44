//! The simulated machine in random motion, tick by tick, under live control.

use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode, Plan};
use motion_host::simulate::hardware::{Simulated, SimulatedHardware};
use motion_kernel::exec::ExecState;
use motion_kernel::fault::Reaction;
use motion_kernel::hal::Encoder;
use motion_kernel::kernel::Kernel;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::path::Piece;
use motion_kernel::queue::{LiveStreams, Streams};
use motion_kernel::trace::Trace;
use motion_kernel::units::{DacCode, Position};

use motion_tests::check::bench::{mm, rest_to_rest};
use motion_tests::check::totals::Totals;
use motion_tests::check::{drive, program};
use motion_tests::random::Random;

const PIECES: usize = 256;
const SEGMENTS: usize = 16;
const PLACES: usize = 128;
/// Ticks in which drives settle, and a machine comes to rest after a fault.
const SETTLE_TICKS: u32 = 20;

/// A program of random motion that takes at most `longest_ticks`.
pub(crate) fn random_plan(random: &mut Random, machine: &Machine, longest_ticks: f64) -> Plan {
    loop {
        let fragments = 1 + random.below(12);
        let program = program::generate(random, fragments, machine.path.feed_mm_s);
        let plan = drive::plan(&program.text, machine, Mode::Spanning, &mut Totals::default());
        if let Ok(Some(plan)) = plan
            && plan.length_mm > 0.0
            && plan.time_s / machine.tick_s <= longest_ticks
        {
            return plan;
        }
    }
}

/// What a tick showed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickView<R> {
    pub(crate) trace: Trace<R, 3>,
    pub(crate) is_enabled: bool,
    pub(crate) is_off: bool,
    pub(crate) position_mm: [f64; 3],
}

impl<R: Real> TickView<R> {
    pub(crate) fn codes(&self) -> [i16; 3] {
        self.trace.axes.map(|axis| axis.code.0)
    }

    /// The velocity that an output commands, from its code alone [mm/s].
    pub(crate) fn commanded_mm_s(&self, machine: &Machine, axis: usize) -> f64 {
        let settings = &machine.axes[axis];
        let volts = self.trace.axes[axis].code.to_volts() - settings.output_offset_v;
        volts * settings.mm_s_at_10_v / DacCode::FULL_SCALE_V
    }
}

/// What a run does after a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Next {
    GoOn,
    /// The fault is over: clear it, and move every axis again, with these signs.
    Recover([f64; 3]),
    End,
}

/// What a test does between two ticks: the hardware to break, the kernel to trip.
pub(crate) type Between<'a, R> =
    dyn FnMut(u64, &mut SimulatedHardware<'_>, &mut Kernel<R, 3>, Option<&TickView<R>>) -> Next + 'a;

/// Runs a plan; `between` is called before every tick. After the program's end the machine stands for 100 ticks. Ends with
/// the last tick's number.
pub(crate) fn run<R: Real>(plan: &Plan, machine: &Machine, between: &mut Between<'_, R>) -> u64 {
    let executable = Executable::new::<R>(plan).expect("executable");
    let simulated = Simulated::new(&machine.simulated()).expect("a machine");
    let mut hardware = SimulatedHardware::new(&simulated).expect("a converter");
    let Ok(counts) = hardware.latch();
    let start = [Position::ZERO; 3];
    let mut kernel = Kernel::<R, 3>::new(&machine.axes_config().expect("axes"), start, counts);
    kernel.enable(SETTLE_TICKS);
    let mut streams = Box::new(LiveStreams::<R, 3, PIECES, SEGMENTS>::new());
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut control = LiveControl::<R, 3, _, _, PLACES>::new(
        executable.supplied(),
        machine.path.pulse,
        executable.tick_s,
        Leads::NONE,
    );
    let mut last: Option<TickView<R>> = None;
    let mut standing = 0;
    for tick in 0.. {
        match between(tick, &mut hardware, &mut kernel, last.as_ref()) {
            Next::GoOn => {}
            Next::End => return tick,
            Next::Recover(signs) => {
                recover(machine, &simulated, &mut hardware, &mut kernel, signs);
                return tick;
            }
        }
        control.poll(&mut feeder).expect("items");
        let trace = *kernel.tick(&mut intake, &mut hardware);
        simulated.advance();
        if trace.executed.state == ExecState::Stopped {
            kernel.resume();
        }
        last = Some(TickView {
            trace,
            is_enabled: simulated.is_enabled(),
            is_off: kernel.reaction() == Some(Reaction::Immediate),
            position_mm: simulated.truth().map(|axis| axis.position_mm),
        });
        let is_done = control.state(&feeder) == State::Done && trace.executed.state == ExecState::Idle;
        standing = if is_done { standing + 1 } else { 0 };
        if standing > 100 {
            return tick;
        }
    }
    unreachable!("ticks have no end")
}

/// Clears a fault of a machine that was mended, and moves every axis.
fn recover<R: Real>(
    machine: &Machine,
    simulated: &Simulated,
    hardware: &mut SimulatedHardware<'_>,
    kernel: &mut Kernel<R, 3>,
    signs: [f64; 3],
) {
    let mut streams = Streams::<R, 3, 8, 8>::new();
    let fault = kernel.fault().expect("a fault");
    {
        // Enabling does not help, and nothing moves.
        let (_, mut intake) = streams.split(machine.rules(), [Position::ZERO; 3]);
        kernel.enable(0);
        for _ in 0..400 {
            let trace = kernel.tick(&mut intake, hardware);
            assert_eq!(trace.fault, Some(fault));
            simulated.advance();
            assert!(!simulated.is_enabled());
        }
    }
    let mut here = kernel.clear_fault().expect("off");
    assert_eq!(kernel.fault(), None);
    let (mut feeder, mut intake) = streams.split(machine.rules(), here);
    kernel.enable(SETTLE_TICKS);
    let length = mm(2.0);
    for (axis, sign) in signs.into_iter().enumerate() {
        let mut direction = [0.0; 3];
        direction[axis] = sign;
        feeder.piece(Piece::line(1, here, direction, length).expect("a piece")).expect("room");
        for segment in rest_to_rest(length, 20.0) {
            feeder.segment(segment).expect("room");
        }
        here[axis] = if sign > 0.0 { here[axis] + length } else { here[axis] - length };
        feeder.end_stretch(here).expect("room");
        let is_there = (0..5000).any(|_| {
            let trace = kernel.tick(&mut intake, hardware);
            assert_eq!(trace.fault, None, "moving again");
            simulated.advance();
            let set = trace.executed.setpoints.map(|setpoint| setpoint.position);
            trace.executed.state == ExecState::Idle && set == here
        });
        assert!(is_there, "axis {axis} did not move again");
    }
}
