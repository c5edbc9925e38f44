//! A compiled program under live control in closed loop: the background obeys commands generated from a seed.
//!
//! The same seed gives the same commands on a PC and inside an emulated board.

use motion_kernel::axis::AxesConfig;
use motion_kernel::exec::ExecState;
use motion_kernel::hal::{Ad5754Output, Encoder};
#[cfg(feature = "watch")]
use motion_kernel::internals::Access;
use motion_kernel::kernel::Kernel;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Real;
use motion_kernel::program::{Items, ProgramError, Reader, SupplyError};
use motion_kernel::queue::{LiveFeeder, LiveStreams, Streams};
use motion_kernel::units::DacCode;

use super::{Closed, ClosedLoop, InMemory, LoopError, regulated};
use crate::machine::SimMachine;
use crate::noise::SplitMix64;

/// A command before a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Command {
    Hold,
    Resume,
    Abort,
    Override(f64),
}

/// Commands that no operator would give: in any order, one every hundred ticks, with times between them in
/// which the background does not poll.
#[derive(Clone, Debug)]
struct Commands {
    random: SplitMix64,
    polls_left: u32,
    /// Number of polls that the background still loses.
    lost: u32,
}

/// Number of polls with commands; then the program continues to its end.
const COMMANDED_POLLS: u32 = 8000;
/// A share of all polls, in 2⁻³².
const ONE_IN_100: u32 = u32::MAX / 100;
const ONE_IN_400: u32 = u32::MAX / 400;
/// A poll is late by less than this many ticks.
const LATE_TICKS: u32 = 256;

impl Commands {
    /// The command in this poll, if any; `None` if the background loses the poll.
    fn next(&mut self) -> Option<Option<Command>> {
        if self.polls_left == 0 {
            return Some(None);
        }
        self.polls_left -= 1;
        if self.lost > 0 {
            self.lost -= 1;
            return None;
        }
        // Two halves of one number, and its lowest bits, which the halves' comparisons don't look at.
        let bits = self.random.next();
        let (upper, lower) = ((bits >> 32) as u32, bits as u32);
        if upper < ONE_IN_400 {
            self.lost = lower % LATE_TICKS;
            return None;
        }
        Some((upper > u32::MAX - ONE_IN_100).then(|| match lower % 64 {
            0 => Command::Abort,
            1..16 => Command::Hold,
            16..40 => Command::Resume,
            // 0 to 2 in eighths.
            _ => Command::Override(0.125 * f64::from(lower >> 8 & 15)),
        }))
    }

    fn are_over(&self) -> bool {
        self.polls_left == 0
    }
}

/// The background under live control: keeps the streams full and obeys. `PLACES` is that of [`LiveControl`].
pub struct LiveProducer<'a, R: Real, const AXES: usize, const PLACES: usize> {
    feeder: LiveFeeder<'a, R, AXES>,
    control: LiveControl<R, AXES, Items<'a, AXES>, ProgramError, PLACES>,
    commands: Commands,
}

impl<R: Real, const AXES: usize, const PLACES: usize> LiveProducer<'_, R, AXES, PLACES> {
    /// The background's part before a tick.
    ///
    /// # Errors
    /// The program holds an item that can't be executed.
    #[inline(never)]
    pub fn poll(&mut self) -> Result<(), SupplyError<ProgramError>> {
        let Some(command) = self.commands.next() else { return Ok(()) };
        match command {
            None => {}
            Some(Command::Hold) => self.control.hold(),
            Some(Command::Resume) => self.control.resume(),
            Some(Command::Abort) => self.control.abort(),
            // All of these are within the range.
            Some(Command::Override(share)) => self.control.set_override(share).unwrap_or_default(),
        }
        if self.commands.are_over() {
            self.control.resume();
            self.control.set_override(1.0).unwrap_or_default();
        }
        self.control.poll(&mut self.feeder)
    }

    /// Whether nothing is left to do after a tick that ended in `state`.
    pub fn is_over(&self, state: ExecState) -> bool {
        state == ExecState::Idle && self.control.state(&self.feeder) == State::Done
            || self.control.state(&self.feeder) == State::Aborted
    }
}

/// What the background sees of the ticks that come when they like.
#[cfg(feature = "watch")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticked {
    /// How many there were.
    pub ticks: u32,
    /// How the last one ended.
    pub state: ExecState,
    /// It ended in a fault.
    pub is_fault: bool,
}

#[cfg(feature = "watch")]
impl<'a, R: Real, const AXES: usize, const PLACES: usize> LiveProducer<'a, R, AXES, PLACES> {
    /// The background of a run whose ticks come when they like: `poll`s and then waits for a tick, unless one came
    /// meanwhile, until nothing is left to do. `watcher` is called before and after every access to what the tick
    /// writes, those by `ticked` among them: a tick that comes at the same of these places does the same on any
    /// machine.
    ///
    /// # Errors
    /// The program holds an item that can't be executed.
    pub fn run(
        &mut self,
        watcher: &'a dyn Fn(Access),
        ticked: impl Fn() -> Ticked,
        mut poll: impl FnMut(&mut Self) -> Result<(), SupplyError<ProgramError>>,
        wait: impl Fn(),
    ) -> Result<(), SupplyError<ProgramError>> {
        let ticked = || {
            watcher(Access::Begins);
            let ticked = ticked();
            watcher(Access::Ends);
            ticked
        };
        self.feeder.watch(watcher);
        let mut seen = ticked();
        loop {
            poll(self)?;
            let mut last = ticked();
            if last.is_fault || self.is_over(last.state) {
                return Ok(());
            }
            while last.ticks == seen.ticks && !last.is_fault {
                wait();
                last = ticked();
            }
            seen = last;
        }
    }
}

/// Both parts of a loop under live control.
pub type LiveClosed<'a, R, const AXES: usize, const PLACES: usize, const LINE: usize> =
    (LiveProducer<'a, R, AXES, PLACES>, ClosedLoop<'a, R, AXES, LINE>);

/// Closes the loop of a program with blocks over `machine`, drives enabled, with the commands of `seed`.
///
/// # Errors
/// The program's machine can't be regulated or simulated.
#[inline(never)]
pub fn close<
    'a,
    R: Real,
    const AXES: usize,
    const PIECES: usize,
    const SEGMENTS: usize,
    const PLACES: usize,
    const LINE: usize,
>(
    program: &Reader<'a, AXES>,
    streams: &'a mut LiveStreams<R, AXES, PIECES, SEGMENTS>,
    machine: &'a SimMachine<AXES, LINE>,
    seed: u64,
) -> Result<LiveClosed<'a, R, AXES, PLACES, LINE>, LoopError> {
    // As the other `close`, line by line: a constructor for both costs copies of the kernel, and a board with
    // 16 KiB has no room for them.
    let header = program.header();
    let (feeder, intake) = streams.split(header.rules, header.start);
    let outputs = Ad5754Output::setup(machine.chip(), &mut machine.chip()).map_err(LoopError::Converter)?;
    let Ok(counts) = (&*machine).latch();
    let memory = InMemory { counts, codes: [DacCode::ZERO; AXES], enabled: None };
    let axes = guarded(program)?;
    let mut kernel = Kernel::new(&axes, header.start, counts);
    kernel.enable(0);
    let control = LiveControl::new(program.items(), header.pulse, header.tick_s, Leads::NONE);
    let commands = Commands { random: SplitMix64::new(seed), polls_left: COMMANDED_POLLS, lost: 0 };
    let producer = LiveProducer { feeder, control, commands };
    Ok((producer, ClosedLoop { kernel, intake: intake.into(), machine, outputs, memory }))
}

/// Closes the loop of a program over `machine` without live control, guarded as the program says.
///
/// # Errors
/// The program's machine can't be regulated, guarded or simulated.
#[inline(never)]
pub fn close_guarded<
    'a,
    R: Real,
    const AXES: usize,
    const PIECES: usize,
    const SEGMENTS: usize,
    const LINE: usize,
>(
    program: &Reader<'a, AXES>,
    streams: &'a mut Streams<R, AXES, PIECES, SEGMENTS>,
    machine: &'a SimMachine<AXES, LINE>,
) -> Result<Closed<'a, R, AXES, LINE>, LoopError> {
    let (producer, mut closed) = super::close(program, streams, machine)?;
    closed.kernel = Kernel::new(&guarded(program)?, program.header().start, closed.memory.counts);
    closed.kernel.enable(0);
    Ok((producer, closed))
}

/// The axes of a program with its guards and its compensation.
fn guarded<R: Real, const AXES: usize>(program: &Reader<'_, AXES>) -> Result<AxesConfig<R, AXES>, LoopError> {
    let axes = compensated(regulated(program.header())?, program)?;
    match program.guards().map_err(LoopError::Program)? {
        Some(guards) => axes.guarded(&guards, program.header().tick_s).map_err(LoopError::Axes),
        None => Ok(axes),
    }
}

#[cfg(feature = "compensation")]
fn compensated<R: Real, const AXES: usize>(
    axes: AxesConfig<R, AXES>,
    program: &Reader<'_, AXES>,
) -> Result<AxesConfig<R, AXES>, LoopError> {
    let compensation = program.compensation().map_err(LoopError::Program)?;
    axes.compensated(&compensation, program.header().tick_s).map_err(LoopError::Axes)
}

#[cfg(not(feature = "compensation"))]
fn compensated<R: Real, const AXES: usize>(
    axes: AxesConfig<R, AXES>,
    program: &Reader<'_, AXES>,
) -> Result<AxesConfig<R, AXES>, LoopError> {
    if program.is_compensated() { Err(LoopError::Compensated) } else { Ok(axes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_of_every_kind_come_and_end() {
        let mut commands = Commands { random: SplitMix64::new(3), polls_left: COMMANDED_POLLS, lost: 0 };
        let mut kinds = [0_u32; 4];
        let mut lost = 0;
        for _ in 0..COMMANDED_POLLS {
            match commands.next() {
                None => lost += 1,
                Some(None) => {}
                Some(Some(Command::Hold)) => kinds[0] += 1,
                Some(Some(Command::Resume)) => kinds[1] += 1,
                Some(Some(Command::Abort)) => kinds[2] += 1,
                Some(Some(Command::Override(share))) => {
                    assert!((0.0..2.0).contains(&share));
                    kinds[3] += 1;
                }
            }
        }
        assert!(kinds.iter().all(|&kind| kind > 0) && lost > 100, "{kinds:?} {lost}");
        assert!(commands.are_over() && commands.next() == Some(None));
    }
}
