//! The firmware of the NUCLEO on an emulated STM32F405: main, RTIC, interrupts, background, button, console, streams.
//!
//! It closes its loop through the converter's frames (`boards/nucleo-f446re/src/emulated`), and its script presses the
//! button and opens the emergency stop. The test reads the log, sends letters to the console, and judges what the model
//! of the machine has seen.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use motion_tests::figures::{Table, hold};

use crate::budget::{GROWTH, distribution};
use crate::tools::{HANGS_AFTER_S, Tools};

/// The emulator's time for an instruction is 2 to this power \[ns\].
const SHIFT: u32 = 3;

/// Where the stringer ends \[mm\].
pub(crate) const END_MM: [f64; 3] = [102.045_923_136, 0.0, 0.0];
/// The regulator holds the machine there so well \[mm\].
pub(crate) const AT_REST_MM: f64 = 0.005;
/// Frames of the converter's setup: configuration, clear, codes, a range for each axis, power, codes, load.
const SETUP_FRAMES: u64 = 9;
/// And of a write: a code for each axis, and a load.
const FRAMES: u64 = 4;
/// Cycles from the opening of the emergency stop until the drives are off: a tick has 84 000.
const OFF_CYCLES_MAX: u64 = 1000;

/// What the log says, in its order; a letter is sent to the console after its line.
const LINES: [(&str, Option<u8>); 19] = [
    // The button starts, holds and resumes.
    ("Ready", None),
    ("Started([Position(0), Position(0), Position(0)])", None),
    ("Holding", None),
    ("Held", None),
    ("Resumed", None),
    ("Done", None),
    // And starts again; the console holds and resumes, and knows its other letters.
    ("Started([Position(102.045923136), Position(0), Position(0)])", Some(b'u')),
    ("Override(110)", Some(b'n')),
    ("Override(100)", Some(b'h')),
    ("Holding", None),
    ("Held", Some(b'r')),
    ("Resumed", None),
    // The emergency stop opens; then the board is reset.
    ("Fault(", None),
    ("reset", None),
    ("Ready", None),
    ("Started([Position(0), Position(0), Position(0)])", None),
    ("Holding", None),
    ("Held", None),
    ("Resumed", None),
];

/// What the firmware printed until the last of [`LINES`]; run once.
fn printed(tools: &Tools) -> Result<&'static [String], String> {
    static PRINTED: OnceLock<Result<Vec<String>, String>> = OnceLock::new();
    match PRINTED.get_or_init(|| run(tools)) {
        Ok(lines) => Ok(lines),
        Err(error) => Err(error.clone()),
    }
}

/// The emulator with an image, not yet started. Of its serial ports the second one is the console, or the link. Ended with
/// `timeout`, which runs it. `monitor` is where it takes commands.
pub(crate) fn emulator(image: &Path, serial: &str, monitor: &str, shift: u32) -> Command {
    let mut emulator = Command::new("timeout");
    emulator
        .args(["--foreground", HANGS_AFTER_S])
        .args(["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", monitor])
        .args(["-serial", "null", "-serial", serial, "-semihosting-config", "enable=on,target=native"])
        .args(["-icount", &format!("shift={shift},sleep=off"), "-kernel"])
        .arg(image);
    emulator
}

fn run(tools: &Tools) -> Result<Vec<String>, String> {
    let image = tools.firmware("emulated")?;
    let mut emulator = emulator(&image, "stdio", "none", SHIFT);
    emulator
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        // It says that it was ended.
        .stderr(Stdio::null());
    let mut running = emulator.spawn().map_err(|error| format!("qemu-system-arm: {error}"))?;
    let (input, output) = (running.stdin.take(), running.stdout.take());
    let (mut input, output) = input.zip(output).ok_or("no pipes")?;
    let mut lines = Vec::new();
    let followed = follow(BufReader::new(output), &mut input, &mut lines);
    // It would run forever; a signal to `timeout` ends both.
    let ended = Command::new("kill").arg(running.id().to_string()).status();
    running.wait().and(ended).map_err(|error| error.to_string())?;
    followed.map(|()| lines)
}

/// Reads until the last of [`LINES`], and answers.
fn follow(output: impl BufRead, input: &mut impl Write, lines: &mut Vec<String>) -> Result<(), String> {
    let mut expected = LINES.into_iter();
    let mut next = expected.next();
    for line in output.lines() {
        let line = line.map_err(|error| error.to_string())?;
        let said = line.split_once(' ').map_or("", |(_, said)| said).to_owned();
        lines.push(line.clone());
        if line.starts_with("failed") {
            return Err(line);
        }
        let is_figure =
            ["Ticks", "FollowingErrors", "Background", "Flight"].iter().any(|of| said.starts_with(of));
        let is_models = line.starts_with("model: ") && said != "reset";
        if line.starts_with("interrupt ") || is_figure || is_models {
            continue;
        }
        let Some((start, answer)) = next else { return Ok(()) };
        if !said.starts_with(start) {
            return Err(format!("the log says {line:?} where {start:?} was expected"));
        }
        if let Some(letter) = answer {
            input.write_all(&[letter]).and_then(|()| input.flush()).map_err(|error| error.to_string())?;
        }
        next = expected.next();
        if next.is_none() {
            return Ok(());
        }
    }
    Err(format!("the log ends where {next:?} was expected; its last lines: {:?}", lines.iter().rev().take(3)))
}

/// The numbers in a line, in their order.
fn numbers(line: &str) -> Vec<f64> {
    let parts = line.split(|character: char| !(character.is_ascii_digit() || ".-e".contains(character)));
    parts.filter_map(|part| part.parse().ok()).collect()
}

pub(crate) fn the_firmware_runs(tools: &Tools) -> Result<(), String> {
    let lines = printed(tools)?;
    let model = |start: &str, nth: usize| -> Result<Vec<f64>, String> {
        let of_start = lines.iter().filter(|line| line.starts_with("model: ") && line.contains(start));
        let line = of_start.clone().nth(nth).ok_or_else(|| format!("no {start:?} of the model"))?;
        Ok(numbers(line))
    };
    // At the end of the first run, and after the emergency stop.
    for nth in [0, 1] {
        let at_mm = model(" at ", nth)?;
        let at_end = at_mm.iter().zip(END_MM).all(|(at, end)| (at - end).abs() < AT_REST_MM);
        if at_mm.len() != END_MM.len() || at_end != (nth == 0) {
            return Err(format!("the machine is at {at_mm:?} mm, and the program ends at {END_MM:?}"));
        }
        let [frames, ticks, codes @ ..] = &model(" frames ", nth)?[..] else {
            return Err("no frames".to_owned());
        };
        // The emergency stop writes once more than the ticks.
        let expected = SETUP_FRAMES + FRAMES * (*ticks as u64 + nth as u64);
        if *frames as u64 != expected {
            return Err(format!("{frames} frames in {ticks} ticks, expected {expected}"));
        }
        if nth == 1 && codes.iter().any(|&code| code != 0.0) {
            return Err(format!("the outputs are at {codes:?} after the emergency stop"));
        }
    }
    let enabled = |nth: usize| {
        let mut of_model = lines.iter().filter(|line| line.starts_with("model: enabled "));
        of_model.nth(nth).map(|line| (line.contains("enabled true"), numbers(line)))
    };
    match (enabled(0), enabled(1)) {
        (Some((true, _)), Some((false, after))) if matches!(after[..], [cycles] if cycles as u64 <= OFF_CYCLES_MAX) => {
            Ok(())
        }
        others => Err(format!("enabled, then off at once: {others:?}")),
    }
}

/// Least, median, 99th percentile and most of the instructions of the interrupts in `lines`, where an instruction takes 2 to
/// the power `shift` \[ns\].
pub(crate) fn instructions<'a>(
    lines: impl Iterator<Item = &'a String>,
    shift: u32,
) -> Result<[u32; 4], String> {
    // The processor runs at 168 MHz.
    let cycles_per_instruction = 0.168 * f64::from(1 << shift);
    let cycles = lines.filter_map(|line| line.strip_prefix("interrupt ")?.parse::<f64>().ok());
    let mut counted: Vec<u32> =
        cycles.map(|cycles| (cycles / cycles_per_instruction).round() as u32).collect();
    if counted.is_empty() {
        return Err("no interrupt was counted".to_owned());
    }
    counted.sort_unstable();
    Ok(distribution(&counted))
}

pub(crate) fn instructions_of_the_interrupt(tools: &Tools) -> Result<(), String> {
    let lines = printed(tools)?;
    let first_boot = lines.iter().take_while(|line| !line.starts_with("model: reset"));
    let figures = instructions(first_boot, SHIFT)?;
    let mut table =
        Table::new(&["instructions of the interrupt, NUCLEO-F446RE", "min", "median", "p99", "max"]);
    table.row(
        &[&["live control and guards, a hold".to_owned()], &figures.map(|figure| figure.to_string())[..]]
            .concat(),
    );
    println!("{}", table.to_markdown());
    tools.accept_compiler()?;
    hold("interrupt", &table, GROWTH)
}
