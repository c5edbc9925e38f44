//! Cycles of a tick on a Cortex-M4, estimated from the instructions that were executed and published timing: with memory
//! that never waits, and from an STM32F446's flash in an interrupt; and the part of a processor that such ticks take. Not
//! measured: only hardware measures cycles.
//!
//! The ticks are those of the seed with the longest one that a search found (`search`).

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use motion_tests::cycles::{Begin, Calls, Estimate, INTERRUPT};
use motion_tests::figures::{Table, hold};
use object::{Object, ObjectSymbol, SymbolKind};

use crate::budget::{GROWTH, distribution};
use crate::search::{KINDS, Kind};
use crate::tools::{Bundle, COUNTING, M4F, Tools};

/// What the rows hold of an estimate.
type Figure = (&'static str, fn(&Estimate) -> u64);
const FIGURES: [Figure; 5] = [
    ("instructions", |tick| tick.instructions),
    ("estimated cycles, M4 zero-wait-state, nominal", |tick| tick.nominal_cycles),
    ("estimated cycles, M4 zero-wait-state, pessimistic", |tick| tick.pessimistic_cycles),
    ("estimated cycles, with flash and interrupt, nominal", nominal_with_flash),
    ("estimated cycles, with flash and interrupt, pessimistic", pessimistic_with_flash),
];
/// Both sides of the estimate with flash and interrupt.
const SIDES: [Figure; 2] = [("nominal", nominal_with_flash), ("pessimistic", pessimistic_with_flash)];

/// Estimated cycles with flash and interrupt.
fn nominal_with_flash(tick: &Estimate) -> u64 {
    tick.nominal_cycles + tick.nominal_waits + u64::from(INTERRUPT.nominal)
}

/// The same on the pessimistic side.
fn pessimistic_with_flash(tick: &Estimate) -> u64 {
    tick.pessimistic_cycles + tick.pessimistic_waits + u64::from(INTERRUPT.pessimistic)
}

/// Ticks a second whose shares of a processor are shown \[kHz\].
const RATES_KHZ: [u32; 5] = [2, 10, 20, 50, 100];
/// Clock of that processor \[MHz\].
const CLOCK_MHZ: f64 = 168.0;

pub(crate) fn estimated_cycles(tools: &Tools) -> Result<(), String> {
    let rates = RATES_KHZ.map(|rate_khz| format!("{rate_khz} kHz"));
    let of = format!("of a Cortex-M4F at {CLOCK_MHZ} MHz, 3 axes, f32 [%]");
    let mut columns = vec![&of[..]];
    columns.extend(rates.iter().map(String::as_str));
    let mut shares = Table::new(&columns);
    let mut table = Table::new(&["a tick of 3 axes on a Cortex-M4F, f32", "median", "p99", "max"]);
    for kind in KINDS {
        let ticks = traced(tools, kind)?;
        let of_all = |of: fn(&Estimate) -> u64| {
            let mut figures: Vec<_> = ticks.iter().map(of).collect();
            figures.sort_unstable();
            distribution(&figures)
        };
        for (name, of) in FIGURES {
            let [_, figures @ ..] = of_all(of).map(|figure| figure.to_string());
            table.row(&[&[format!("{}: {name}", kind.name)], &figures[..]].concat());
        }
        for (side, of) in SIDES {
            let [_, median, _, longest] = of_all(of);
            for (name, cycles) in [("median", median), ("longest", longest)] {
                let shares_of = RATES_KHZ.map(|rate_khz| share(cycles, rate_khz));
                shares.row(&[&[format!("{}: {name} tick, {side}", kind.name)], &shares_of[..]].concat());
            }
        }
    }
    tools.accept_compiler()?;
    hold("cycles", &table, GROWTH)?;
    hold("shares", &shares, GROWTH)
}

/// The part of a processor that ticks of so many cycles take, so many times a millisecond \[%\].
fn share(cycles: u64, rate_khz: u32) -> String {
    format!("{:.2}", 100.0 * cycles as f64 * f64::from(rate_khz) / (1e3 * CLOCK_MHZ))
}

/// An estimate for every tick of the worst seed of a kind.
fn traced(tools: &Tools, kind: Kind) -> Result<Vec<Estimate>, String> {
    let board = kind.on(M4F);
    let bundle = Bundle::new(&kind.worst_cases()?[..1])?;
    // The log is gigabytes: it goes through a pipe.
    let pipe = std::env::temp_dir().join(format!("motion-trace-{}-{}", std::process::id(), kind.name.len()));
    let made = Command::new("mkfifo").arg(&pipe).status().map_err(|error| format!("mkfifo: {error}"))?;
    if !made.success() {
        return Err(format!("mkfifo {}: {made}", pipe.display()));
    }
    let mut emulator = tools.emulator(board, kind.image, bundle.path(), "none")?;
    emulator.args(COUNTING).args(["-singlestep", "-d", "in_asm,exec,nochain", "-D"]).arg(&pipe);
    emulator.arg("-dfilter").arg(code_of_ticks(&tools.image(board, kind.image)?)?);
    emulator.stdout(std::process::Stdio::null());
    let started = emulator.spawn();
    let counted = started.map_err(|error| format!("qemu-system-arm: {error}")).and_then(|mut running| {
        let figures = count(&pipe);
        let ended = running.wait().map_err(|error| error.to_string())?;
        if ended.success() { figures } else { Err(format!("trace: {ended}, {figures:?}")) }
    });
    let _ = std::fs::remove_file(&pipe);
    counted
}

/// Parts of the names of who calls a tick, and of all functions that a tick calls. If one were missing, so would its instructions be in the trace,
/// which then is no trace of a tick.
const PARTS: [&str; 12] = [
    "6budget5ticks",
    "14live_interrupt3run",
    "budgeted_tick",
    "13motion_kernel4exec",
    "13motion_kernel5queue",
    "13motion_kernel3law",
    "13motion_kernel4path",
    "13motion_kernel4axis",
    "13motion_kernel6kernel",
    "13motion_kernel3num",
    "compiler_builtins3mem",
    "aeabi_mem",
];

/// The code of ticks, as ranges of addresses for the emulator: what it would write of all else is many times as much.
fn code_of_ticks(image: &Path) -> Result<String, String> {
    let bytes = std::fs::read(image).map_err(|error| format!("{}: {error}", image.display()))?;
    let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
    let functions = object.symbols().filter(|symbol| {
        symbol.kind() == SymbolKind::Text
            && symbol.size() > 0
            && symbol.name().is_ok_and(|name| PARTS.iter().any(|part| name.contains(part)))
    });
    let ranges = functions.map(|symbol| format!("{:#x}+{:#x}", symbol.address() & !1, symbol.size()));
    Ok(ranges.collect::<Vec<_>>().join(","))
}

fn count(pipe: &Path) -> Result<Vec<Estimate>, String> {
    let trace = File::open(pipe).map_err(|error| format!("{}: {error}", pipe.display()))?;
    Calls::new(BufReader::with_capacity(1 << 20, Portions(trace)), Begin::Symbol("budgeted_tick".into()))
        .map(|call| call.map_err(|error| error.to_string()))
        .collect()
}

/// A pipe that is left to fill before it is read: the emulator writes line by line, and to wake for each of the lines takes longer
/// than to read them.
struct Portions(File);

impl Read for Portions {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        sleep(Duration::from_millis(1));
        self.0.read(buffer)
    }
}
