//! The background: start button, console, streams, log.
//!
//! Consumes the button, the console and what the tick has left in [`Control`]; produces items for the streams, and in a
//! fault what the flight recorder kept, into the log. Runs in what the ticks leave of the processor, a turn behind the first
//! tick that ends after the turn before, for ever.
//!
//! Its turn begins right behind a tick, with what keeps interrupts off: taking figures out of [`Control`], at
//! most one line of log (defmt encodes it with interrupts masked). Both are over long before the next
//! tick, so neither delays any. Then come planning and filling, which may take several ticks and keep
//! nothing off.
//!
//! Fails by bringing the machine to rest and saying why; in a fault, with drives off.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::DWT;
use defmt::{error, info, warn};
use heapless::spsc::Consumer;
use motion_kernel::exec::ExecState;
use motion_kernel::fault::Fault;
use motion_kernel::flight::frame_max;
use motion_kernel::live::State;
use motion_kernel::program::{ProgramError, SupplyError};
use motion_kernel::straight::StraightError;
use motion_kernel::units::Position;
use nucleo_f446re::console::Command;
use nucleo_f446re::design_parameters::{
    BUTTON_TICKS, FLIGHT_LINE_TICKS, REPORT_TICKS, SETTLE_TICKS, SYSCLK_HZ,
};
use nucleo_f446re::machine::{AXES, Machine};
use nucleo_f446re::operator::{Action, Asked, Phase, Settings};
use nucleo_f446re::program::Run;
use nucleo_f446re::tick_timing::TickTiming;
use rtic::Mutex;
use stm32f4xx_hal::gpio::{Input, PC13};

use crate::console_port::LOST;
use crate::control::{Control, Streams};

/// Ticks since the start; counted by the tick.
pub(crate) static TICKS: AtomicU32 = AtomicU32::new(0);
/// Turns of the background; the tick feeds the watchdog only while they are counted.
pub(crate) static TURNS: AtomicU32 = AtomicU32::new(0);

/// What the tick last left.
#[derive(Clone, Copy)]
struct Seen {
    state: ExecState,
    position: [Position; AXES],
    fault: Option<Fault<f32>>,
    healthy: bool,
}

/// Runs for ever.
pub(crate) fn run(
    mut control: impl Mutex<T = Control>,
    streams: &'static mut Streams,
    machine: &Machine,
    button: &PC13<Input>,
    bytes: &mut Consumer<'static, u8>,
) -> ! {
    let mut work = Work {
        phase: Phase::Ready,
        settings: Settings::NONE,
        streams: Some(streams),
        run: None,
        from: None,
        no_way: None,
        refused: None,
        has_said: false,
    };
    let mut press = Press::default();
    let mut report = Report::default();
    let mut dump = Dump::default();
    info!("ready: press the blue button to start");
    loop {
        wait_for_tick();
        TURNS.store(TURNS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        let begin = DWT::cycle_count();

        let seen = control.lock(|control| Seen {
            state: control.state,
            position: control.position,
            fault: control.kernel.fault(),
            healthy: control.healthy,
        });
        let now = TICKS.load(Ordering::Relaxed);
        let asked = if press.is_new(button.is_low(), now) {
            Some(Asked::Press)
        } else {
            core::iter::from_fn(|| bytes.dequeue()).find_map(Command::of).map(Asked::Command)
        };
        let has_logged = work.poll(seen, asked, machine, &mut control)
            || work.phase == Phase::Faulted && dump.line(now, &mut control);
        if !has_logged {
            report.line(&mut control, work.run.as_ref().map_or(0, Run::starvations));
        }
        work.plan();

        report.longest_turn_cycles = report.longest_turn_cycles.max(DWT::cycle_count().wrapping_sub(begin));
    }
}

/// Returns when a tick has just ended. (Not with `wfi`: in sleep the probe can't read the log.)
fn wait_for_tick() {
    let before = TICKS.load(Ordering::Relaxed);
    while TICKS.load(Ordering::Relaxed) == before {
        core::hint::spin_loop();
    }
}

/// What the button has started.
struct Work {
    phase: Phase,
    settings: Settings,
    /// Until the first start.
    streams: Option<&'static mut Streams>,
    run: Option<Run<'static>>,
    /// Where the next run is to start from.
    from: Option<[Position; AXES]>,
    /// Why there is no way to the program's start.
    no_way: Option<StraightError>,
    /// Why it can't go on.
    refused: Option<SupplyError<ProgramError>>,
    /// The log has said that it waits for somebody.
    has_said: bool,
}

impl Work {
    /// What follows from what the tick has left, and from what is asked for. Whether it has logged a line; at most one.
    fn poll(
        &mut self,
        seen: Seen,
        asked: Option<Asked>,
        machine: &Machine,
        control: &mut impl Mutex<T = Control>,
    ) -> bool {
        if self.has_ended(&seen) {
            return true;
        }
        if let (Phase::Running { .. }, Some(run)) = (self.phase, &self.run) {
            let is_stopped = seen.state == ExecState::Stopped;
            self.phase = Phase::Running { is_held: run.is_held(), is_stopped };
        }
        match asked {
            Some(asked) => {
                self.act(Action::of(self.phase, asked), &seen, machine, control);
                true
            }
            None => self.has_come_to_rest(&seen),
        }
    }

    /// Whether it has just come to what only a reset ends.
    fn has_ended(&mut self, seen: &Seen) -> bool {
        match (self.phase, self.refused, &mut self.run) {
            (Phase::Ready | Phase::Faulted, ..) => return false,
            _ if seen.fault.is_some() => {
                error!("stopped: {}; reset the board to go on", seen.fault);
                self.phase = Phase::Faulted;
            }
            (Phase::Running { .. }, Some(error), Some(run)) => {
                error!("program refused: {}; motion comes to rest; reset the board to go on", error);
                run.hold();
                self.phase = Phase::Refused;
            }
            _ => {
                let Some(error) = self.no_way.take() else { return false };
                error!("no way to the program's start: {}; reset the board to go on", error);
                self.phase = Phase::Refused;
            }
        }
        true
    }

    /// Whether a run has just come to where it waits for somebody, or to its end.
    fn has_come_to_rest(&mut self, seen: &Seen) -> bool {
        let (Phase::Running { is_stopped, .. }, Some(run)) = (self.phase, &self.run) else { return false };
        let state = run.state();
        if state == State::Waiting && seen.state == ExecState::Idle {
            info!("done: press the blue button to run again");
            self.phase = Phase::Done;
            return true;
        }
        let had_said = core::mem::replace(&mut self.has_said, is_stopped || state == State::Held);
        if had_said || !self.has_said {
            return false;
        }
        if is_stopped {
            info!("program stop: press the blue button to go on");
        } else {
            info!("held: the blue button or r goes on");
        }
        true
    }

    /// Does what there is to do, in a line of log.
    fn act(&mut self, action: Action, seen: &Seen, machine: &Machine, control: &mut impl Mutex<T = Control>) {
        match (action, &mut self.run) {
            (Action::Start, None) => self.first_start(seen.healthy, machine, control),
            // At rest the set position is exactly where the streams ended.
            (Action::Start, Some(_)) => self.start(seen.position),
            (Action::Hold, Some(run)) => {
                run.hold();
                info!("comes to rest");
            }
            (Action::GoOn, Some(run)) => {
                if let Phase::Running { is_stopped: true, .. } = self.phase {
                    control.lock(|control| control.kernel.resume());
                }
                run.resume();
                self.has_said = false;
                info!("goes on");
            }
            (Action::Override(step), _) => {
                self.settings.feed_override = self.settings.feed_override.after(step);
                info!("feed override {=u8} %", self.settings.feed_override.percent());
            }
            (Action::SingleBlock(is_single), _) => {
                self.settings.is_single = is_single;
                info!("single block {=str}", if is_single { "on" } else { "off" });
            }
            (Action::Nothing(why), _) => info!("{=str}", why),
            // There is no run to hold in the phases before the first start.
            (Action::Hold | Action::GoOn, None) => {}
        }
    }

    /// Takes the actual position, gives the streams to the tick, enables the drives, starts.
    fn first_start(&mut self, healthy: bool, machine: &Machine, control: &mut impl Mutex<T = Control>) {
        if !healthy {
            return warn!("not started: the emergency stop is open or a drive is not ready");
        }
        // With the faults of a machine that was not ready yet.
        let here = control.lock(|control| {
            control.flight.clear();
            control.kernel.clear_fault()
        });
        // Nothing has been enabled yet, so no reaction can be under way.
        let Some((here, streams)) = here.zip(self.streams.take()) else { return };
        let (feeder, intake) = streams.split(machine.header().rules, here);
        control.lock(|control| {
            control.intake = intake;
            control.kernel.enable(SETTLE_TICKS);
        });
        self.run = Some(Run::new(machine.program, feeder));
        self.start(here);
    }

    /// Starts a run from `here`, as soon as that is logged.
    fn start(&mut self, here: [Position; AXES]) {
        info!("started: from {=[?]} mm", here.map(Position::to_mm));
        self.from = Some(here);
        self.phase = Phase::Running { is_held: false, is_stopped: false };
        self.has_said = false;
    }

    /// What takes several ticks. Also in a fault: it may end in a stop on the path.
    fn plan(&mut self) {
        let Some(run) = &mut self.run else { return };
        if let Some(here) = self.from.take() {
            self.no_way = run.start(here).err();
        }
        run.set(&self.settings);
        self.refused = run.poll().err();
    }
}

/// The button, debounced.
#[derive(Default)]
struct Press {
    /// Since when it is held, until that was long enough.
    since: Option<u32>,
    samples: u8,
    is_counted: bool,
}

/// So many samples at least make a press, however long turns take: one may be a bounce.
const PRESS_SAMPLES: u8 = 3;

impl Press {
    /// Whether it has just been held for long enough at tick `now`, as far as turns have seen.
    fn is_new(&mut self, down: bool, now: u32) -> bool {
        if !down {
            *self = Self::default();
            return false;
        }
        let since = *self.since.get_or_insert(now);
        self.samples = self.samples.saturating_add(1);
        let is_press = now.wrapping_sub(since) >= BUTTON_TICKS && self.samples >= PRESS_SAMPLES;
        is_press && !core::mem::replace(&mut self.is_counted, true)
    }
}

/// What the flight recorder kept of a fault, into the log, a row a line.
#[derive(Default)]
struct Dump {
    rows: usize,
    last_ticks: u32,
}

impl Dump {
    /// Whether it has logged a line, at tick `now`.
    fn line(&mut self, now: u32, control: &mut impl Mutex<T = Control>) -> bool {
        if now.wrapping_sub(self.last_ticks) < FLIGHT_LINE_TICKS {
            return false;
        }
        self.last_ticks = now;
        let row = control.lock(|control| {
            let flight = &control.flight;
            if flight.is_frozen() { flight.row(self.rows).copied() } else { None }
        });
        let mut buffer = [0; frame_max(AXES)];
        let Some(frame) = row.as_ref().and_then(|row| row.to_frame(&mut buffer)) else { return false };
        self.rows += 1;
        info!("flight {=[u8]:02x}", frame);
        true
    }
}

/// The figures that are logged once a second, a line a turn.
#[derive(Default)]
struct Report {
    next_ticks: u32,
    step: u8,
    overruns: u32,
    longest_turn_cycles: u32,
}

impl Report {
    fn line(&mut self, control: &mut impl Mutex<T = Control>, starvations: u32) {
        match self.step {
            0 => {
                let ticks = TICKS.load(Ordering::Relaxed);
                // Across the wrap of the counter too.
                if self.next_ticks.wrapping_sub(ticks).wrapping_sub(1) < REPORT_TICKS {
                    return;
                }
                self.next_ticks = ticks.wrapping_add(REPORT_TICKS);
                let log = control.lock(|control| control.log.take());
                self.tick(&log);
            }
            1 => {
                let peaks_mm = control.lock(|control| control.kernel.take_peak_following_error_mm());
                info!("peak following error {=[?]} um", peaks_mm.map(|mm| 1e3 * mm));
            }
            _ => {
                let us = core::mem::take(&mut self.longest_turn_cycles) / (SYSCLK_HZ / 1_000_000);
                let lost = LOST.load(Ordering::Relaxed);
                info!(
                    "longest background turn {=u32} us, {=u32} stops for want of data, {=u32} console bytes lost",
                    us, starvations, lost
                );
            }
        }
        self.step = (self.step + 1) % 3;
    }

    fn tick(&mut self, log: &TickTiming) {
        self.overruns = self.overruns.saturating_add(log.overruns);
        info!(
            "tick cycles min {=u32} max {=u32} last {=u32}, latency {=u32} to {=u32}, overruns {=u32}",
            log.min_cycles,
            log.max_cycles,
            log.last_cycles,
            log.min_latency_cycles,
            log.max_latency_cycles,
            self.overruns
        );
    }
}
