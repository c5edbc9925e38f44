//! Cycles of a tick on a Cortex-M4 with memory that never waits, estimated from the instructions that were executed
//! and the core's published timing. Not measured: only hardware measures cycles.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use motion_tests::cycles::{Begin, Calls};
use motion_tests::figures::{Table, hold};

use crate::budget::GROWTH;
use crate::programs;
use crate::tools::{Bundle, M4F, Tools};

pub(crate) fn estimated_cycles(tools: &Tools) -> Result<(), String> {
    let [_, facets, _] = &programs::worst_ticks()[..] else { return Err("three programs".to_owned()) };
    let bundle = Bundle::new(core::slice::from_ref(facets))?;
    // The log is gigabytes: it goes through a pipe.
    let pipe = std::env::temp_dir().join(format!("motion-trace-{}", std::process::id()));
    let made = Command::new("mkfifo").arg(&pipe).status().map_err(|error| format!("mkfifo: {error}"))?;
    if !made.success() {
        return Err(format!("mkfifo {}: {made}", pipe.display()));
    }
    let mut emulator = tools.emulator(M4F, "trace", bundle.path())?;
    emulator.args(["-singlestep", "-d", "in_asm,exec,nochain", "-D"]).arg(&pipe);
    let started = emulator.spawn();
    let counted = started.map_err(|error| format!("qemu-system-arm: {error}")).and_then(|mut running| {
        let figures = count(&pipe);
        let ended = running.wait().map_err(|error| error.to_string())?;
        if ended.success() { figures } else { Err(format!("trace: {ended}, {figures:?}")) }
    });
    let _ = std::fs::remove_file(&pipe);
    let mut ticks = counted?;
    let mut table = Table::new(&["a tick of 3 axes on a Cortex-M4F, f32", "median", "p99", "max"]);
    for (name, of) in [
        ("instructions", 0),
        ("estimated cycles, M4 zero-wait-state, nominal", 1),
        ("estimated cycles, M4 zero-wait-state, pessimistic", 2),
    ] {
        ticks.sort_unstable_by_key(|tick| tick[of]);
        let last = ticks.len() - 1;
        let figures = [last / 2, last * 99 / 100, last].map(|at| ticks[at][of].to_string());
        table.row(&[&[name.to_owned()], &figures[..]].concat());
    }
    tools.accept_compiler()?;
    hold("cycles", &table, GROWTH)
}

/// Instructions, nominal and pessimistic cycles of every tick.
fn count(pipe: &std::path::Path) -> Result<Vec<[u64; 3]>, String> {
    let trace = File::open(pipe).map_err(|error| format!("{}: {error}", pipe.display()))?;
    Calls::new(BufReader::with_capacity(1 << 20, Portions(trace)), Begin::Symbol("budgeted_tick".into()))
        .map(|call| {
            let call = call.map_err(|error| error.to_string())?;
            Ok([call.instructions, call.nominal_cycles, call.pessimistic_cycles])
        })
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
