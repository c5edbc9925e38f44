//! The emulator's log, read as it is written.
//!
//! Lines of `qemu-system-arm -singlestep -d in_asm,exec,nochain` (7.2, which disassembles with Capstone):
//!
//! ```text
//! ----------------
//! IN: budgeted_tick
//! 0x000004ee:  ed2d 8b02  vpush    {d8}
//!
//! Trace 0: 0x7ff3f8006d40 [00800408/000004ee/00000010/ff000201] budgeted_tick
//! ```
//!
//! Each instruction is disassembled before it first runs, again when it runs with other flags or its
//! translation was dropped, and alone: inside an IT block it is printed without its condition. Each
//! execution is one line `Trace`, the second number in brackets its address. A line `Stopped execution`
//! takes the line before it back: the emulator had to leave, and will log that execution once more.

use std::collections::HashMap;
use std::fmt;
use std::io::{self, BufRead};

use super::Estimate;
use super::flash::Flash;
use super::instruction::{Instruction, UnknownInstruction};
use super::price::price;

/// Where the calls to estimate begin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Begin {
    /// The address of the function, with or without the Thumb bit.
    Address(u32),
    /// The function whose symbol, as it stands in the executable, contains this; its first instruction
    /// executed is where it begins.
    Symbol(String),
}

/// One estimate for each call of a function. Ends after the first error.
#[derive(Debug)]
pub struct Calls<R> {
    log: R,
    line: Vec<u8>,
    begin: Begin,
    code: HashMap<u32, Result<Instruction, UnknownInstruction>>,
    /// Logged, but may still be taken back.
    logged: Option<u32>,
    executed: Option<u32>,
    call: Option<Call>,
    ended: bool,
}

/// A call under way. Its last instruction has no price until it is seen where execution goes on.
#[derive(Debug)]
struct Call {
    returns_to: u32,
    estimate: Estimate,
    flash: Flash,
    before: Instruction,
    last: Instruction,
    last_at: u32,
}

impl Call {
    /// What memory makes the last instruction wait.
    fn fetch(&mut self) {
        self.estimate.wait(self.flash.fetch(self.last_at, self.last.width));
        if let Some(address) = self.last.constant_at(self.last_at) {
            self.estimate.wait(self.flash.load(address));
        }
    }
}

impl<R: BufRead> Calls<R> {
    /// Estimates of the calls in `log`. Memory stays within the size of the code.
    pub fn new(log: R, begin: Begin) -> Self {
        let begin = match begin {
            Begin::Address(address) => Begin::Address(address & !1),
            symbol @ Begin::Symbol(_) => symbol,
        };
        let (line, code) = (Vec::new(), HashMap::new());
        Self { log, line, begin, code, logged: None, executed: None, call: None, ended: false }
    }

    fn advance(&mut self) -> Result<Option<Estimate>, TraceError> {
        let mut in_symbol = false;
        loop {
            self.line.clear();
            if self.log.read_until(b'\n', &mut self.line)? == 0 {
                self.ended = true;
                if let Some(at) = self.logged.take()
                    && let Some(estimate) = self.execute(at)?
                {
                    return Ok(Some(estimate));
                }
                return if self.call.is_some() { Err(TraceError::Unfinished) } else { Ok(None) };
            }
            let line = self.line.as_slice();
            if line.starts_with(b"Trace ") {
                let at = executed_address(line).ok_or_else(|| malformed(line))?;
                if let Some(before) = self.logged.replace(at)
                    && let Some(estimate) = self.execute(before)?
                {
                    return Ok(Some(estimate));
                }
            } else if line.starts_with(b"0x") {
                let (at, width, text) = disassembly(line).ok_or_else(|| malformed(line))?;
                self.code.insert(at, Instruction::parse(text, width));
                if std::mem::take(&mut in_symbol) {
                    self.begin = Begin::Address(at);
                }
            } else if let Some(name) = line.strip_prefix(b"IN: ") {
                in_symbol = matches!(&self.begin, Begin::Symbol(symbol)
                    if std::str::from_utf8(name).is_ok_and(|name| name.contains(symbol.as_str())));
            } else if line.starts_with(b"Stopped execution") {
                self.logged = None;
            } else if line.starts_with(b"OBJD-") {
                // Bytes without a mnemonic.
                return Err(malformed(line));
            }
        }
    }

    fn execute(&mut self, at: u32) -> Result<Option<Estimate>, TraceError> {
        let mut finished = None;
        if let Some(call) = &mut self.call {
            let taken = at != call.last_at.wrapping_add(call.last.width);
            if taken && !call.last.may_jump() {
                return Err(TraceError::Interrupted { at: call.last_at });
            }
            let cost = price(&call.last, taken, Some(&call.before));
            call.estimate += cost;
            call.flash.pass(cost.nominal);
            if at == call.returns_to {
                finished = self.call.take().map(|call| call.estimate);
            } else {
                call.before = call.last;
                (call.last, call.last_at) = (instruction(&self.code, at)?, at);
                call.fetch();
            }
        } else if self.begin == Begin::Address(at) {
            let caller = self.executed.ok_or(TraceError::NotCalled { from: 0 })?;
            let before = instruction(&self.code, caller)?;
            if !before.is_call() {
                return Err(TraceError::NotCalled { from: caller });
            }
            let mut call = Call {
                returns_to: caller.wrapping_add(before.width),
                estimate: Estimate::default(),
                flash: Flash::default(),
                before,
                last: instruction(&self.code, at)?,
                last_at: at,
            };
            call.fetch();
            self.call = Some(call);
        }
        self.executed = Some(at);
        Ok(finished)
    }
}

impl<R: BufRead> Iterator for Calls<R> {
    type Item = Result<Estimate, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let item = self.advance().transpose();
        self.ended |= !matches!(item, Some(Ok(_)));
        item
    }
}

fn instruction(
    code: &HashMap<u32, Result<Instruction, UnknownInstruction>>,
    at: u32,
) -> Result<Instruction, TraceError> {
    match code.get(&at) {
        Some(Ok(instruction)) => Ok(*instruction),
        Some(Err(unknown)) => Err(TraceError::Unknown { at, instruction: unknown.clone() }),
        None => Err(TraceError::NotDisassembled { at }),
    }
}

/// `Trace 0: 0x7ff3f8006d40 [00800408/000004ee/…`: the second number in brackets.
fn executed_address(line: &[u8]) -> Option<u32> {
    let bracket = line.iter().position(|&b| b == b'[')?;
    let fields = &line[bracket + 1..];
    let slash = fields.iter().position(|&b| b == b'/')?;
    hex(fields.get(slash + 1..slash + 9)?)
}

/// `0x00000400:  f000 fa4e  bl       #0x8a0`: address, width, text.
fn disassembly(line: &[u8]) -> Option<(u32, u32, &str)> {
    let at = hex(line.get(2..10)?)?;
    let rest = std::str::from_utf8(line.get(11..)?).ok()?.trim();
    let (half, rest) = rest.split_once(' ')?;
    // The first halfword of a long instruction (ARMv7-M Architecture Reference Manual, A5.1).
    if hex(half.as_bytes())? >> 11 < 0b11101 {
        return Some((at, 2, rest.trim_start()));
    }
    let (half, text) = rest.trim_start().split_once(' ')?;
    hex(half.as_bytes())?;
    Some((at, 4, text.trim_start()))
}

fn hex(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |value: u32, &digit| Some(value << 4 | char::from(digit).to_digit(16)?))
}

fn malformed(line: &[u8]) -> TraceError {
    TraceError::Malformed { line: String::from_utf8_lossy(line).trim_end().to_owned() }
}

/// Why a log gives no estimate.
#[derive(Debug)]
pub enum TraceError {
    /// The log cannot be read.
    Io(io::Error),
    /// A line that is not as this emulator writes it.
    Malformed {
        /// The line.
        line: String,
    },
    /// An instruction ran that was not disassembled.
    NotDisassembled {
        /// Its address.
        at: u32,
    },
    /// An instruction ran that has no price.
    Unknown {
        /// Its address.
        at: u32,
        /// The instruction.
        instruction: UnknownInstruction,
    },
    /// The function was reached by something other than a call, so where it returns to is not known.
    NotCalled {
        /// The address of what led to it; 0 if the log starts there.
        from: u32,
    },
    /// Execution went elsewhere after an instruction that is no jump: an exception was taken.
    Interrupted {
        /// The address of that instruction.
        at: u32,
    },
    /// The log ends within a call.
    Unfinished,
}

impl From<io::Error> for TraceError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl fmt::Display for TraceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => write!(f, "the trace cannot be read: {error}"),
            Self::Malformed { line } => write!(f, "not a line of a trace: `{line}`"),
            Self::NotDisassembled { at } => write!(f, "{at:#010x} ran but was not disassembled"),
            Self::Unknown { at, instruction } => write!(f, "{at:#010x}: {instruction}"),
            Self::NotCalled { from } => {
                write!(f, "the function was reached from {from:#010x} without a call")
            }
            Self::Interrupted { at } => write!(f, "an exception was taken after {at:#010x}"),
            Self::Unfinished => write!(f, "the trace ends within a call"),
        }
    }
}

impl std::error::Error for TraceError {}

#[cfg(test)]
mod tests;
