//! Counts the instructions of the polls in which the background answers a command, of every program of the bundle: holds,
//! resumes, overrides and single block, at random moments of all kinds of motion; of the longest step of every poll, after
//! which it looks whether a stop is asked for; and of what it does where that look says yes, in every other run. Encoders
//! read what was set in the tick before.
//!
//! One line a figure, as `budget` prints them.
#![no_std]
#![no_main]

use core::cell::Cell;

use hal_sim::closed_loop::InMemory;
use motion_kernel::axis::AxesConfig;
use motion_kernel::kernel::Kernel;
use motion_kernel::live::{Leads, LiveControl, State};
use motion_kernel::num::Scalar;
use motion_kernel::program::Reader;
use motion_kernel::units::{Counts, DacCode};
use qemu_boards::count::Counter;
use qemu_boards::live::{PLACES, Streams};
use qemu_boards::processor::{Timer, WRAP, entry, now};
use qemu_boards::programs::seeded_programs;
use qemu_boards::{AXES, Number, exit, fail, println};

/// Runs of each program.
const RUNS: u32 = 8;
/// A run ends by then.
const TICKS_MAX: u32 = 200_000;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    for (_, bytes) in seeded_programs() {
        println!("program");
        for seed in 0..RUNS {
            run(seed, bytes, &counter);
        }
    }
    exit(true)
}

fn run(seed: u32, bytes: &[u8], counter: &Counter) {
    let program = Reader::<AXES>::new(bytes).unwrap_or_else(|error| fail(&error));
    let header = program.header();
    let config =
        AxesConfig::<Number, _>::new(&header.axes, header.tick_s).unwrap_or_else(|error| fail(&error));
    let steps = config.axes.map(|config| config.encoder.position(Counts(1)).to_bits());
    let mut streams = Streams::new();
    let (mut feeder, mut intake) = streams.split(header.rules, header.start);
    let mut memory = InMemory { counts: [Counts(0); AXES], codes: [DacCode::ZERO; AXES], enabled: None };
    let mut kernel = Kernel::new(&config, header.start, memory.counts);
    kernel.enable(0);
    let mut control =
        LiveControl::<_, AXES, _, _, PLACES>::new(program.items(), header.pulse, header.tick_s, Leads::NONE);
    // The first poll reads as much of the program as there is room for: no command is answered by that.
    let (mut random, mut wait) = (u64::from(seed), 1);
    let (mut is_single, mut is_stop_due, mut is_moving) = (false, false, false);
    for _ in 0..TICKS_MAX {
        let mut kind = None;
        // The look that is told of a stop.
        let mut told = None;
        // At rest there is nothing to answer.
        let hold = is_moving.then_some("hold");
        if is_stop_due {
            control.hold();
            (kind, is_stop_due) = (hold, false);
        } else if wait == 0 {
            // Knuth's generator of full period; its upper bits.
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let bits = random >> 20;
            wait = 5 + bits % 300;
            // Of few looks or many.
            let within = (1 << (bits >> 24 & 15)) - 1;
            told = (seed % 2 == 1).then_some(1 + (bits >> 28 & within) as u32);
            kind = match control.state(&feeder) {
                State::Held => {
                    control.resume();
                    Some("resume")
                }
                State::Running if is_single || bits >> 40 & 15 == 0 => {
                    is_single = !is_single;
                    control.set_single_block(is_single);
                    Some("single_block")
                }
                State::Running if bits >> 40 & 3 == 0 => {
                    control.set_override(0.125 * (1 + (bits >> 32 & 15)) as f64).unwrap_or_default();
                    Some("override")
                }
                State::Running => {
                    control.hold();
                    hold
                }
                _ => None,
            };
        }
        wait = wait.saturating_sub(1);
        // In steps of the timer.
        let (since, longest, whole) = (Cell::new(now()), Cell::new(0), Cell::new(0));
        // A stop is handed over without a look, and before more of the program is read, which has many.
        let first = Cell::new(None);
        let (looks, after) = (Cell::new(0), Cell::new(None));
        let look = || {
            let at = now();
            let step = at.wrapping_sub(since.replace(at)) & WRAP;
            longest.set(step.max(longest.get()));
            whole.set(whole.get() + u64::from(step));
            first.set(first.get().or(Some(step)));
            looks.set(looks.get() + 1);
            after.set(after.get().map(|after: u64| after + u64::from(step)));
            if kind != Some("hold") && told == Some(looks.get()) {
                after.set(Some(0));
            }
            after.get().is_some()
        };
        let polled = control.poll_unless(&look, &mut feeder);
        let is_given_up = after.get().is_some();
        look();
        polled.unwrap_or_else(|error| fail(&error));
        println!("step {}", counter.instructions(longest.get().into()));
        if is_given_up {
            println!("given_up {}", counter.instructions(after.get().unwrap_or(0)));
            is_stop_due = control.state(&feeder) == State::Running;
        } else if let Some(kind) = kind.filter(|kind| told.is_none() || *kind == "hold") {
            let answer = if kind == "hold" { first.get().unwrap_or(0).into() } else { whole.get() };
            println!("{} {}", kind, counter.instructions(answer));
        }
        let trace = kernel.tick(&mut intake, &mut memory);
        is_moving = trace.executed.motion.v_mm_s > Number::ZERO;
        if trace.fault.is_some() {
            fail(&"a fault");
        }
        for ((counts, setpoint), step) in memory.counts.iter_mut().zip(&trace.executed.setpoints).zip(steps) {
            *counts = Counts(setpoint.position.to_bits() / step);
        }
        if control.state(&feeder) == State::Done {
            return;
        }
    }
    fail(&"it never ends");
}
