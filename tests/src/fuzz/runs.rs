//! A program through the streams, or through live control, with what comes between two ticks.

use core::convert::Infallible;
use core::task::Poll;
use std::cell::Cell;

use arbitrary::{Result, Unstructured};
use motion_kernel::exec::ExecState;
use motion_kernel::fault::{FaultKind, Reaction};
use motion_kernel::kernel::Kernel;
use motion_kernel::live::{Leads, LiveControl, Source, State};
use motion_kernel::num::Real;
use motion_kernel::program::{Item, Supply};
use motion_kernel::queue::{Intake, LiveStreams, Streams};
use motion_kernel::units::{Counts, Position};

use super::Laws;
use super::items::{Program, RULES, TICK_S};
use super::judge::Judge;
use super::machine::{REACTIONS, axes, mend, upset};
use crate::axes::{TestAxes, counts};

/// Of the queues, small enough to be full at times.
const PIECES: usize = 16;
const SEGMENTS: usize = 12;
const LIVE_SEGMENTS: usize = 16;
const PLACES: usize = 64;
/// What takes longer is not driven to its end \[ticks\].
const TICKS_MAX: f64 = 6000.0;
/// Drives take so many ticks to be ready.
const SETTLE_TICKS: u32 = 3;
/// Switching the drives off takes so many ticks at most: a stop that is given up for a ramp.
const OFF_TICKS: u32 = REACTIONS.stop_ticks + REACTIONS.ramp_ticks as u32 + 2;

/// The machine's side of a run.
struct Machine<R: Real> {
    kernel: Kernel<R, 2>,
    hardware: TestAxes,
    /// It has answered other than it should.
    is_hostile: bool,
    judge: Judge<R>,
    /// Where it was set by the latest tick.
    set: [Position; 2],
    /// Ticks since the fault.
    faulty: u32,
    /// A command has given up motion, or something was made to go wrong.
    is_given_up: bool,
    /// A command has just put the machine elsewhere, or let it stand where it is: what came before says nothing.
    is_moved: bool,
}

impl<R: Real> Machine<R> {
    fn new() -> Self {
        let mut kernel = Kernel::new(&axes::<R>(), [Position::ZERO; 2], [Counts(0); 2]);
        kernel.enable(SETTLE_TICKS);
        let set = [Position::ZERO; 2];
        Self {
            kernel,
            hardware: TestAxes::default(),
            is_hostile: false,
            judge: Judge::new(),
            set,
            faulty: 0,
            is_given_up: false,
            is_moved: false,
        }
    }

    /// A command of the board, or something that goes wrong.
    fn event(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        match input.int_in_range(0..=11)? {
            0 => self.kernel.disable(),
            1 => self.kernel.enable(input.int_in_range(0..=20)?),
            2 => {
                if self.kernel.clear_fault().is_none() {
                    return Ok(());
                }
                self.faulty = 0;
            }
            3 => {
                self.kernel.stand_here();
            }
            4 => return self.trip(input),
            5 => {
                mend(&mut self.hardware);
                return Ok(());
            }
            6 => {
                self.kernel.rest_here();
            }
            7 => self.refer(input)?,
            _ => {
                self.is_hostile = true;
                return upset(&mut self.hardware, input);
            }
        }
        (self.is_moved, self.is_given_up) = (true, true);
        Ok(())
    }

    /// A fault that the board has seen. It must be followed as any other one is: what was driven goes on in its stop.
    fn trip(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        self.kernel.trip(match input.int_in_range(0..=2)? {
            // Ends on the path, in a ramp, at once.
            0 => FaultKind::TickMissed { ticks: 1 },
            1 => FaultKind::Drive { axis: input.choose_index(2)? },
            _ => FaultKind::Encoder,
        });
        self.is_given_up = true;
        Ok(())
    }

    /// An axis gets another position, if it is at rest.
    fn refer(&mut self, input: &mut Unstructured<'_>) -> Result<()> {
        let (axis, behind) = (input.choose_index(2)?, input.arbitrary::<i16>()?);
        let mm = f64::from(input.arbitrary::<i16>()?) / 64.0;
        let position = Position::from_mm(mm).expect("within half a metre");
        let Counts(now) = self.hardware.counts[axis];
        let latched = Counts(now.wrapping_sub(i64::from(behind)));
        let before = self.set[axis];
        if let Some(set) = self.kernel.reference(axis, latched, position) {
            self.hardware.origin[axis] -= counts(set[axis] - before);
        }
        Ok(())
    }

    fn tick(&mut self, intake: &mut Intake<'_, R, 2>) -> ExecState {
        let trace = *self.kernel.tick(intake, &mut self.hardware);
        // Enabled anew in the middle of a stretch the machine stands where it is.
        if core::mem::take(&mut self.is_moved) {
            self.judge.anew();
        }
        self.judge.tick(&trace, self.kernel.reaction());
        self.set = trace.executed.setpoints.map(|axis| axis.position);
        if trace.fault.is_some() {
            self.faulty += 1;
        } else {
            self.faulty = 0;
            if !self.is_hostile {
                self.hardware.follow(&trace);
            }
        }
        if self.faulty > OFF_TICKS {
            assert_eq!(self.kernel.reaction(), Some(Reaction::Immediate), "{trace:?}");
            mend(&mut self.hardware);
        }
        if trace.executed.state == ExecState::Stopped {
            self.kernel.resume();
        }
        trace.executed.state
    }

    /// Nothing has kept the program from being driven to its end.
    fn is_undisturbed(&self) -> bool {
        !self.is_hostile && !self.is_given_up
    }
}

/// As a board without live control does it.
pub(super) fn of_streams<R: Real>(laws: Laws, input: &mut Unstructured<'_>) -> Result<()> {
    let program = Program::read(laws.planned, input)?;
    let mut streams = Streams::<R, 2, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO; 2]);
    let items = program.items.iter().map(|&item| Ok::<_, Infallible>(item));
    let mut supply = Supply::new(items, TICK_S);
    let mut machine = Machine::<R>::new();
    let mut is_polled = true;
    while !input.is_empty() {
        match input.int_in_range(0..=15)? {
            0 => machine.event(input)?,
            1 => is_polled = !is_polled,
            _ => {}
        }
        for _ in 0..input.arbitrary::<u8>()? {
            if is_polled {
                let _ = supply.fill(&mut feeder);
            }
            machine.tick(&mut intake);
        }
    }
    // A background that comes too late is a fault without live control.
    let was_late = machine.kernel.fault().is_some();
    if program.is_whole && machine.is_undisturbed() && program.ticks < TICKS_MAX && !was_late {
        let mut idle_ticks = 0;
        for _ in 0..2 * program.ticks as u64 + 1000 {
            supply.fill(&mut feeder).expect("a whole program");
            let idles = machine.tick(&mut intake) == ExecState::Idle && supply.is_empty();
            idle_ticks = if idles { idle_ticks + 1 } else { 0 };
            // Drives that are being switched on stand still, too.
            if idle_ticks > SETTLE_TICKS {
                assert_eq!(machine.set, program.end);
                return Ok(());
            }
        }
        panic!("a whole program has no end: {:?}", machine.kernel.fault());
    }
    Ok(())
}

/// Items that come when they are told to.
struct Arriving<'a> {
    items: core::slice::Iter<'a, Item<2>>,
    /// So many more are there.
    there: &'a Cell<usize>,
}

impl Source<2> for Arriving<'_> {
    type Error = Infallible;

    fn poll_next(&mut self) -> Poll<Option<core::result::Result<Item<2>, Infallible>>> {
        if self.items.len() == 0 {
            return Poll::Ready(None);
        }
        match self.there.get().checked_sub(1) {
            None => Poll::Pending,
            Some(left) => {
                self.there.set(left);
                Poll::Ready(self.items.next().map(|&item| Ok(item)))
            }
        }
    }
}

/// Held, resumed, overridden, given up; items and polls come late.
pub(super) fn under_live_control<R: Real>(laws: Laws, input: &mut Unstructured<'_>) -> Result<()> {
    let program = Program::read(laws.planned, input)?;
    let mut streams = LiveStreams::<R, 2, PIECES, LIVE_SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(RULES, [Position::ZERO; 2]);
    let there = Cell::new(0);
    let source = Arriving { items: program.items.iter(), there: &there };
    let leads = Leads { stop_ticks: input.int_in_range(0..=3)?, plan_ticks: input.int_in_range(0..=3)? };
    let mut control = LiveControl::<R, 2, _, _, PLACES>::new(source, laws.live, TICK_S, leads);
    let mut machine = Machine::<R>::new();
    let (mut is_polled, mut is_aborted) = (true, false);
    while !input.is_empty() {
        match input.int_in_range(0..=15)? {
            0 => machine.event(input)?,
            1 => is_polled = !is_polled,
            2 => control.hold(),
            3 => control.set_single_block(input.arbitrary()?),
            4 | 5 => control.resume(),
            6 => {
                let share: f64 = input.arbitrary()?;
                // Refused, or taken as it is.
                let _ = control.set_override(share);
            }
            7 | 8 => {
                let eighths: u8 = input.int_in_range(0..=16)?;
                control.set_override(f64::from(eighths) / 8.0).expect("within the range");
            }
            9 if input.ratio(1, 8)? => {
                control.abort();
                is_aborted = true;
            }
            _ => there.set(there.get() + usize::from(input.arbitrary::<u8>()?)),
        }
        for _ in 0..input.arbitrary::<u8>()? {
            if is_polled {
                let _ = control.poll(&mut feeder);
            }
            machine.tick(&mut intake);
        }
    }
    there.set(usize::MAX);
    let fault = machine.kernel.fault();
    // What fills the lists is never the reason: what can't be executed is refused.
    assert!(
        machine.is_hostile || machine.is_given_up || fault.is_none(),
        "no fault of the machine: {fault:?}"
    );
    if program.is_whole && machine.is_undisturbed() && program.ticks < TICKS_MAX {
        control.set_single_block(false);
        control.resume();
        control.set_override(1.0).expect("within the range");
        for _ in 0..20 * program.ticks as u64 + 40_000 {
            control.poll(&mut feeder).expect("a whole program");
            let state = machine.tick(&mut intake);
            match control.state(&feeder) {
                State::Done if state == ExecState::Idle => {
                    assert_eq!(machine.set, program.end);
                    return Ok(());
                }
                State::Aborted if is_aborted => return Ok(()),
                _ => {}
            }
        }
        panic!("a whole program has no end: {:?}, {:?}", control.state(&feeder), machine.kernel.fault());
    }
    Ok(())
}
