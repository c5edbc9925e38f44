//! Counts the instructions of every tick of every program of the bundle, and of the tick's stages; paints the
//! stack below the tick; says how much memory kernel and streams take.
//!
//! With live control's features the axes are guarded as the program says; the program's own plan is driven here, too.
//!
//! One line a figure: what, and how many instructions (for `stack` and `ram`: bytes; `pieces` and `segments`: places).
#![no_std]
#![no_main]

use core::hint::black_box;

#[cfg(not(feature = "live"))]
use hal_sim::closed_loop::close;
#[cfg(feature = "live")]
use hal_sim::closed_loop::live::close_guarded as close;
use hal_sim::closed_loop::{Closed, InMemory, LoopError, reference_machine};
use hal_sim::{MachineParameters, SimMachine};
use motion_kernel::axis::{AxesConfig, AxisConfig, AxisFigures, AxisOutput, AxisState};
use motion_kernel::exec::ExecState;
use motion_kernel::internals::{Phase, Ready};
use motion_kernel::kernel::Kernel;
use motion_kernel::law::{FeedSegment, PathMotion, Ticks};
use motion_kernel::num::Scalar;
use motion_kernel::path::{Piece, Setpoint};
use motion_kernel::program::{Header, ProgramError, Reader};
use motion_kernel::queue::{Intake, Streams};
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, Position};
use qemu_boards::count::Counter;
use qemu_boards::processor::{Timer, entry};
use qemu_boards::programs::programs;
use qemu_boards::{AXES, LINE, Number, PIECES, SEGMENTS, SUBSTEPS, exit, fail, println, singleton, stack};

type Axis = AxisState<Number>;
type Queues<const N: usize> = Streams<Number, N, PIECES, SEGMENTS>;
/// The tick of a machine with `N` axes, called through something that is not inlined.
type Tick<const N: usize> = for<'a> fn(
    &'a mut Kernel<Number, N>,
    &mut Intake<'_, Number, N>,
    &mut InMemory<N>,
) -> &'a Trace<Number, N>;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    let kernel = size_of::<Kernel<Number, AXES>>();
    println!("ram {}", kernel + size_of::<Streams<Number, AXES, PIECES, SEGMENTS>>());
    println!("pieces {}\nsegments {}", PIECES, SEGMENTS);
    // Not on the stack, where the one that is measured needs the room.
    let streams = singleton!(Queues<AXES> = Streams::new()).unwrap_or_else(|| fail(&"streams"));
    // 16 KiB hold one machine only.
    #[cfg(target_has_atomic = "8")]
    let one = singleton!(Queues<1> = Streams::new()).unwrap_or_else(|| fail(&"streams"));
    for bytes in programs() {
        println!("program");
        match refusal(bytes) {
            None => measure(&counter, bytes, streams, budgeted_tick),
            #[cfg(target_has_atomic = "8")]
            Some(ProgramError::Axes { found: 1, .. }) => measure(&counter, bytes, one, Kernel::tick),
            Some(error) => fail(&error),
        }
    }
    exit(true)
}

#[inline(never)]
fn refusal(bytes: &[u8]) -> Option<ProgramError> {
    Reader::<AXES>::new(bytes).err()
}

qemu_boards::budgeted_tick!();

#[inline(never)]
fn measure<const N: usize>(counter: &Counter, bytes: &[u8], streams: &mut Queues<N>, tick: Tick<N>) {
    looped(counter, bytes, &parameters(bytes), &first_axis::<N>(bytes), streams, tick);
    stages::<N>(counter, bytes);
}

/// The program, which is accepted. A header is a kilobyte: looked at where it is, and gone before the ticks
/// begin.
fn program<'a, const N: usize>(read: &'a Result<Reader<'a, N>, ProgramError>) -> &'a Reader<'a, N> {
    read.as_ref().unwrap_or_else(|error| fail(error))
}

/// Closes the loop with nothing else in its frame: closing it is what needs the most room.
#[inline(never)]
fn looped<const N: usize>(
    counter: &Counter,
    bytes: &[u8],
    parameters: &MachineParameters<N>,
    first: &FirstAxis,
    streams: &mut Queues<N>,
    tick: Tick<N>,
) {
    let machine = simulated(parameters);
    let mut closed = closed(bytes, streams, &machine);
    // In place: the microbit has no room for another one.
    let closed = closed.as_mut().unwrap_or_else(|error| fail(error));
    ticks(counter, first, closed, tick);
}

#[inline(never)]
fn ticks<const N: usize>(
    counter: &Counter,
    first: &FirstAxis,
    (producer, closed_loop): &mut Closed<'_, Number, N, LINE>,
    tick: Tick<N>,
) {
    // A regulator of its own beside the kernel's, fed with the same.
    let (config, mut axis) = first.regulated();
    let mut deepest = 0;
    loop {
        let is_all = producer.fill().unwrap_or_else(|error| fail(&error));
        let mut spent = 0;
        let trace = closed_loop.tick_by(|kernel, intake, memory| {
            let top = stack::paint();
            let (trace, instructions) = counter.count(|| black_box(tick)(kernel, intake, memory));
            deepest = deepest.max(stack::depth(top));
            spent = instructions;
            *trace
        });
        println!("tick {}", spent);
        let (_, spent) =
            counter.count(|| regulate(&mut axis, &config, &trace.executed.setpoints[0], trace.axes[0]));
        println!("regulator {}", spent);
        if trace.fault.is_some() {
            fail(&"a fault");
        }
        if is_all && trace.executed.state == ExecState::Idle {
            break;
        }
    }
    println!("stack {}", deepest);
}

// Each in a frame of its own, which is gone before the ticks begin: 16 KiB are not much.

#[inline(never)]
fn simulated<const N: usize>(parameters: &MachineParameters<N>) -> SimMachine<N, LINE> {
    SimMachine::new(parameters).unwrap_or_else(|error| fail(&error))
}

#[inline(never)]
fn parameters<const N: usize>(bytes: &[u8]) -> MachineParameters<N> {
    reference_machine(program(&Reader::<N>::new(bytes)).header(), SUBSTEPS)
}

#[inline(never)]
fn closed<'a, const N: usize>(
    bytes: &'a [u8],
    streams: &'a mut Queues<N>,
    machine: &'a SimMachine<N, LINE>,
) -> Result<Closed<'a, Number, N, LINE>, LoopError> {
    close(Reader::<N>::new(bytes).as_ref().unwrap_or_else(|error| fail(error)), streams, machine)
}

/// The first axis of a program, and where it starts.
struct FirstAxis {
    figures: AxisFigures,
    preview_ticks: u8,
    tick_s: f64,
    start: Position,
}

#[inline(never)]
fn first_axis<const N: usize>(bytes: &[u8]) -> FirstAxis {
    let read = Reader::<N>::new(bytes);
    let &Header { ref axes, tick_s, start, .. } = program(&read).header();
    let preview_ticks =
        AxesConfig::<Number, N>::preview_ticks(axes, tick_s).unwrap_or_else(|error| fail(&error));
    FirstAxis { figures: axes[0], preview_ticks, tick_s, start: start[0] }
}

impl FirstAxis {
    /// The axis, and its state at the program's start.
    #[inline(never)]
    fn regulated(&self) -> (AxisConfig<Number>, Axis) {
        let config = AxisConfig::new(&self.figures, self.preview_ticks, self.tick_s);
        let config = config.unwrap_or_else(|error| fail(&error));
        let mut axis = Axis::default();
        axis.set_position(&config, Counts::default(), self.start);
        (config, axis)
    }
}

/// The stages by themselves, over all that the program contains.
#[inline(never)]
fn stages<const N: usize>(counter: &Counter, bytes: &[u8]) {
    let read = Reader::<N>::new(bytes);
    let program = program(&read);
    let &Header { tick_s, rules, .. } = program.header();
    let limits = rules.limits;
    let motion = PathMotion {
        s: Position::ZERO,
        v_mm_s: Number::from_f64(0.3 * rules.feed_mm_s),
        a_mm_s2: Number::from_f64(-0.7 * limits.accel_mm_s2),
        j_mm_s3: Number::from_f64(0.6 * limits.jerk_mm_s3),
        snap_mm_s4: Number::from_f64(-0.5 * limits.snap_mm_s4),
    };
    let mut setpoints = [Setpoint::default(); N];
    for item in program.items() {
        let item = item.unwrap_or_else(|error| fail(&error));
        match item.ready::<Number, ProgramError>(tick_s).unwrap_or_else(|error| fail(&error)) {
            Ready::Segment(segment) => {
                for phase in [Phase::Rise, Phase::Hold, Phase::Fall] {
                    if segment.phase_duration(phase) > Ticks::ZERO {
                        for eighth in 0..8 {
                            let (_, spent) = counter.count(|| law(&segment, phase, (eighth << 61) + 12345));
                            println!("law {}", spent);
                        }
                    }
                }
            }
            Ready::Piece(piece) => {
                let length: Number = piece.length().to_offset();
                for eighth in 0..8 {
                    let s_mm = length * Number::from_f64(0.125 * f64::from(eighth));
                    let (_, spent) = counter.count(|| path(&piece, s_mm, &motion, &mut setpoints));
                    println!("path {}", spent);
                }
            }
            Ready::EndOfStretch(_) | Ready::Dwell(_) | Ready::Stop | Ready::Block => {}
        }
    }
}

#[inline(never)]
fn law(segment: &FeedSegment<Number>, phase: Phase, fraction: u64) -> PathMotion<Number> {
    segment.at(phase, fraction)
}

#[inline(never)]
fn path<const N: usize>(
    piece: &Piece<Number, N>,
    s_mm: Number,
    motion: &PathMotion<Number>,
    setpoints: &mut [Setpoint<Number>; N],
) {
    piece.set(s_mm, motion, setpoints);
    black_box(setpoints);
}

#[inline(never)]
fn regulate(
    axis: &mut Axis,
    config: &AxisConfig<Number>,
    setpoint: &Setpoint<Number>,
    mut output: AxisOutput<Number>,
) -> AxisOutput<Number> {
    axis.tick(config, setpoint, &mut output);
    output
}
