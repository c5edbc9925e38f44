//! The firmware of the NUCLEO with the feature `link`, on an emulated STM32F405, driven over its emulated serial port.
//!
//! The PC's end is the kernel's own. Nothing here depends on how fast the emulator is: what is waited for comes, or the
//! emulator's time-out ends the test.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use motion_host::board::Job;
use motion_host::board::job::parameters;
use motion_host::machine::Machine;
use motion_kernel::link::{Build, Event, FRAME_MAX, HostLink, Mode, State, Status, WriteError};
use motion_kernel::program::{FORMAT, Item, Reader};
use motion_kernel::straight::Straight;
use motion_kernel::units::Position;
use object::{Object, ObjectSymbol};

use crate::firmware::{AT_REST_MM, END_MM, emulator, instructions};
use crate::tools::Tools;

const AXES: usize = 3;
/// The emulated port takes a byte whenever the emulator looks, some hundred a second: the PC repeats itself so much later.
const SLOWER: u128 = 20;
/// The emulator's time for an instruction is 2 to this power \[ns\]: a processor so slow that an emulated second does not take
/// many, as the time in which nothing happens can't be skipped here.
const SHIFT: u32 = 5;
/// Written as the firmware has it in flash.
const PROGRAM: &[u8] = include_bytes!("../../../boards/common/program/stringer.bin");
/// What has to be left of the stack for what this test does not do \[bytes\].
const STACK_LEFT_MIN: usize = 1024;
/// Path after which the second program is aborted \[mm\].
const ABORT_AFTER_MM: f64 = 2.0;

/// The PC.
struct Pc {
    stream: TcpStream,
    begin: Instant,
    /// The checksum of its machine.
    machine: u32,
    link: HostLink<AXES, 64, 8192>,
    status: Option<Status<AXES>>,
    is_ready: bool,
    /// What has come of new parameters, until it is looked at.
    written: Option<(u32, Option<WriteError>)>,
    /// The board's parameters as far as they were read, and how many bytes there are.
    read: (Vec<u8>, Option<u32>),
    has_restarted: bool,
    items: VecDeque<Option<Item<AXES>>>,
}

impl Pc {
    /// One exchange with the board.
    fn step(&mut self) -> Result<(), String> {
        let failed = |error: std::io::Error| format!("the link to the emulator: {error}");
        while self.is_ready
            && let Some(item) = self.items.front()
            && self.link.push(item.as_ref()).map_err(|error| error.to_string())?
        {
            self.items.pop_front();
        }
        let now_ms = (self.begin.elapsed().as_millis() / SLOWER) as u32;
        let mut frame = [0; FRAME_MAX];
        let length = self.link.transmit(now_ms, &mut frame);
        self.stream.write_all(&frame[..length]).map_err(failed)?;
        let mut bytes = [0; 4096];
        let count = match self.stream.read(&mut bytes) {
            Ok(0) => return Err("the emulator has closed the link".to_owned()),
            Ok(count) => count,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => 0,
            Err(error) => return Err(failed(error)),
        };
        let (mut refused, machine) = (None, self.machine);
        let read = &mut self.read;
        self.link.receive(&bytes[..count], now_ms, &mut |event| match event {
            Event::Status(status) => self.status = Some(status),
            Event::Ready { .. } => self.is_ready = true,
            Event::Welcome(it) => {
                let is_known = (it.build, it.format, it.axes, it.tick_s, it.machine)
                    == (Build::THIS, FORMAT.into(), AXES as u16, 0.0005, machine);
                if !is_known {
                    refused = Some(format!("{it:?}, expected the machine {machine}"));
                }
            }
            Event::Written { bytes, error } => self.written = Some((bytes, error)),
            Event::Parameters { offset, length, piece } if offset as usize == read.0.len() => {
                read.0.extend(piece.bytes());
                read.1 = Some(length);
            }
            Event::Restarted { .. } => self.has_restarted = true,
            other => refused = Some(format!("{other:?}")),
        });
        refused.map_or(Ok(()), Err)
    }

    /// Steps until `is_there` has an answer for what the board says of the program under way.
    fn until<T>(&mut self, mut is_there: impl FnMut(&Self, &Status<AXES>) -> Option<T>) -> Result<T, String> {
        loop {
            self.step()?;
            if let Some(status) = &self.status
                && let Some(fault) = status.fault
            {
                return Err(format!("a fault: {fault:?}"));
            }
            if let Some(status) = &self.status
                && status.aborts == self.link.controls().aborts
                && let Some(found) = is_there(self, status)
            {
                return Ok(found);
            }
        }
    }

    /// Until the board is at rest, held.
    fn held(&mut self) -> Result<[Position; AXES], String> {
        self.until(|pc, status| (pc.is_ready && status.state == State::Held).then_some(status.set))
    }

    /// Sends the way to the program's start and the program, and has it driven.
    fn start(&mut self, from: [Position; AXES]) -> Result<(), String> {
        let reader = Reader::<AXES>::new(PROGRAM).map_err(|error| error.to_string())?;
        let header = reader.header();
        let way =
            Straight::new(from, header.start, header.pulse, header.rules.limits, [20.0; 2], header.tick_s)
                .map_err(|error| error.to_string())?;
        self.items.extend(way.map(|item| item.ok()).chain(reader.items().map(|item| item.ok())));
        self.items.push_back(None);
        if self.link.press(Mode::Run) { Ok(()) } else { Err("no resume is taken".to_owned()) }
    }

    /// Until all is driven; where the machine is then.
    fn driven(&mut self) -> Result<Status<AXES>, String> {
        self.until(|pc, status| {
            let is_sent = pc.items.is_empty() && pc.link.waiting() == 0;
            (is_sent && status.state == State::Idle && status.taken == pc.link.confirmed()).then_some(*status)
        })
    }
}

/// The machine is exactly at the program's end, and the drives hold it there.
fn check_end(status: &Status<AXES>) -> Result<(), String> {
    let end = END_MM.map(|mm| Position::from_mm(mm).unwrap_or_default());
    let errors_mm = status.actual.iter().zip(&end).map(|(actual, end)| (*actual - *end).to_mm().abs());
    if status.set == end && errors_mm.fold(0.0, f64::max) < AT_REST_MM {
        return Ok(());
    }
    Err(format!("at {:?}, in truth {:?}, expected {END_MM:?}", status.set, status.actual))
}

fn drive(pc: &mut Pc) -> Result<(), String> {
    // Nothing is enabled before the operator's command.
    pc.until(|pc, status| (pc.is_ready && status.is_ready && status.state == State::Off).then_some(()))?;
    pc.is_ready = false;
    if !pc.link.enable(true) {
        return Err("no enable is taken".to_owned());
    }
    let here = pc.held()?;
    pc.start(here)?;
    pc.until(|_, status| (status.state == State::Moving).then_some(()))?;
    // The script presses the button: a hold on the path, which the PC ends.
    let held = pc.held()?;
    if held == here || held == END_MM.map(|mm| Position::from_mm(mm).unwrap_or_default()) {
        return Err(format!("held at {held:?}, not on the path"));
    }
    if !pc.link.press(Mode::Run) {
        return Err("no resume is taken".to_owned());
    }
    let end = pc.driven()?;
    check_end(&end)?;
    // Again, and aborted on the way; and again from there.
    pc.start(end.set)?;
    pc.until(|_, status| ((status.set[0] - end.set[0]).to_mm().abs() > ABORT_AFTER_MM).then_some(()))?;
    pc.is_ready = false;
    pc.items.clear();
    if !pc.link.abort() {
        return Err("no abort is taken".to_owned());
    }
    let aborted = pc.held()?;
    if (aborted[0] - end.set[0]).to_mm().abs() < ABORT_AFTER_MM || aborted[0] == Position::ZERO {
        return Err(format!("aborted at {aborted:?}"));
    }
    pc.start(aborted)?;
    let end = pc.driven()?;
    check_end(&end)?;
    take_parameters(pc)
}

/// The board takes new parameters, starts anew, and has them from its flash.
fn take_parameters(pc: &mut Pc) -> Result<(), String> {
    let mut machine = Machine::reference();
    machine.axes[1].gains.kp_per_s = 200.0;
    let record = parameters::<AXES, AXES>(&machine);
    let sum = record.last_chunk().map_or(0, |sum| u32::from_le_bytes(*sum));
    if std::mem::replace(&mut pc.machine, sum) == sum {
        return Err("the parameters are those that the board has".to_owned());
    }
    if !pc.link.enable(false) {
        return Err("no disable is taken".to_owned());
    }
    pc.until(|_, status| (status.state == State::Off).then_some(()))?;
    pc.link.write_parameters(&record, 0);
    while !pc.has_restarted {
        pc.step()?;
        match pc.written.take() {
            Some((_, Some(error))) => return Err(format!("the parameters are not taken: {error:?}")),
            Some((bytes, None)) => pc.link.write_parameters(&record, bytes),
            None => {}
        }
    }
    pc.link.accept();
    pc.link.read_parameters(0);
    while pc.read.1.is_none_or(|length| pc.read.0.len() < length as usize) {
        let before = pc.read.0.len();
        pc.step()?;
        if pc.read.0.len() > before {
            pc.link.read_parameters(pc.read.0.len() as u32);
        }
    }
    if pc.read.0 == record { Ok(()) } else { Err("the board has other parameters than it took".to_owned()) }
}

/// Bytes of an image's stack that were never used, of how many. Memory that nothing was written to is 0 on the emulator.
fn stack_left(image: &Path, mut monitor: &TcpStream) -> Result<(usize, usize), String> {
    let failed = |error: std::io::Error| format!("the emulator's monitor: {error}");
    let elf = std::fs::read(image).map_err(failed)?;
    let file = object::File::parse(&*elf).map_err(|error| error.to_string())?;
    let symbol = |name: &str| {
        let found = file.symbols().find(|symbol| symbol.name() == Ok(name));
        found.map(|symbol| symbol.address()).ok_or_else(|| format!("no symbol {name}"))
    };
    let (low, high) = (symbol("_stack_end")?, symbol("_stack_start")?);
    let folder = tempfile::tempdir().map_err(failed)?;
    let path = folder.path().join("stack");
    writeln!(monitor, "pmemsave {low} {} \"{}\"", high - low, path.display()).map_err(failed)?;
    // Bounded by the emulator's time-out, which closes the monitor.
    let mut said = [0; 1024];
    let stack = loop {
        match std::fs::read(&path) {
            Ok(stack) if stack.len() as u64 == high - low => break stack,
            _ if monitor.read(&mut said).is_ok_and(|count| count == 0) => {
                return Err("the emulator has closed its monitor".to_owned());
            }
            _ => {}
        }
    };
    let left = stack.iter().position(|byte| *byte != 0).unwrap_or(stack.len());
    Ok((left, stack.len()))
}

/// Drives an emulated board with the image; what its log says, and how much of its stack is left.
fn run(image: &Path) -> Result<(Vec<String>, (usize, usize)), String> {
    let failed = |error: std::io::Error| error.to_string();
    let [listener, monitor] = [TcpListener::bind("127.0.0.1:0"), TcpListener::bind("127.0.0.1:0")];
    let (listener, monitor) = (listener.map_err(failed)?, monitor.map_err(failed)?);
    let place = |listener: &TcpListener| {
        listener.local_addr().map(|address| format!("tcp:{address}")).map_err(failed)
    };
    let mut running = emulator(image, &place(&listener)?, &place(&monitor)?, SHIFT)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| format!("qemu-system-arm: {error}"))?;
    let output = running.stdout.take().ok_or("no pipe")?;
    let lines = Arc::new(Mutex::new(Vec::new()));
    let read = Arc::clone(&lines);
    let reader = std::thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            read.lock().expect("nobody panics with it").push(line);
        }
    });
    // It connects the monitor first.
    let driven = connect(&monitor, &mut running).and_then(|monitor| {
        let stream = connect(&listener, &mut running)?;
        let (begin, link) = (Instant::now(), HostLink::new(1));
        let machine = Job::<AXES>::new(&Machine::reference(), &[]).machine;
        drive(&mut Pc {
            stream,
            begin,
            machine,
            link,
            status: None,
            is_ready: false,
            written: None,
            read: (Vec::new(), None),
            has_restarted: false,
            items: VecDeque::new(),
        })?;
        stack_left(image, &monitor)
    });
    // It would run forever; a signal to `timeout` ends both.
    let ended = std::process::Command::new("kill").arg(running.id().to_string()).status();
    running.wait().and(ended).map_err(failed)?;
    let _ = reader.join();
    let lines = std::mem::take(&mut *lines.lock().map_err(|_| "the log's reader panicked")?);
    match driven {
        Ok(stack) => Ok((lines, stack)),
        Err(error) => {
            let end: Vec<_> =
                lines.iter().filter(|line| !line.starts_with("interrupt ")).rev().take(5).collect();
            Err(format!("{error}; the log's last lines: {end:?}"))
        }
    }
}

/// The emulator's end of the link.
fn connect(listener: &TcpListener, running: &mut std::process::Child) -> Result<TcpStream, String> {
    let failed = |error: std::io::Error| error.to_string();
    listener.set_nonblocking(true).map_err(failed)?;
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).map_err(failed)?;
                stream.set_nodelay(true).map_err(failed)?;
                stream.set_read_timeout(Some(Duration::from_millis(1))).map_err(failed)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(failed(error)),
        }
        if let Some(status) = running.try_wait().map_err(failed)? {
            return Err(format!("the emulator ends: {status}"));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

pub(crate) fn a_pc_drives_the_firmware(tools: &Tools) -> Result<(), String> {
    let (lines, (left, stack)) = run(&tools.firmware("emulated,link")?)?;
    println!("stack, linked: {} of {stack} bytes used", stack - left);
    if left < STACK_LEFT_MIN {
        return Err(format!("{left} bytes of the stack are left, expected {STACK_LEFT_MIN}"));
    }
    println!("instructions of the interrupt, linked: {:?}", instructions(lines.iter(), SHIFT)?);
    if let Some(line) = lines.iter().find(|line| line.contains("Fault(") || line.contains("Refused(")) {
        return Err(format!("the log says {line:?}"));
    }
    let origins: Vec<_> = lines.iter().filter_map(|line| line.split("Parameters(").nth(1)).collect();
    if origins == ["Build)", "Flash)"] { Ok(()) } else { Err(format!("the parameters are from {origins:?}")) }
}
