//! The log, one line at a time.
//!
//! Consumes the background's events; produces lines for people. A poll makes at most one line, because a log
//! may mask interrupts while it takes one in.

use motion_kernel::fault::Fault;
use motion_kernel::flight::FlightRow;
use motion_kernel::hal::OutputState;
use motion_kernel::num::Real;
use motion_kernel::program::{ProgramError, SupplyError};
use motion_kernel::straight::StraightError;
use motion_kernel::units::Position;

use crate::machine::MachineError;
use crate::stored::StoreError;
use crate::tick_timing::TickTiming;

/// Where a board's parameters are from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Origin {
    /// From flash, which a PC had them written to.
    Flash,
    /// From the program that it was built with: flash has none.
    Build,
    /// From the program that it was built with: those in flash are not for this firmware.
    Unsuitable(MachineError),
    /// From the program that it was built with: flash can't be read.
    Unreadable(StoreError),
}

/// A line of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LogLine<R: Real, const AXES: usize> {
    /// The board waits for its first start.
    Ready,
    /// The board waits for a PC on the link.
    Linked,
    /// New parameters are not in flash; those before are.
    NotStored(StoreError),
    /// Where the board's parameters are from.
    Parameters(Origin),
    /// A run starts from here.
    Started([Position; AXES]),
    /// There is no start: the emergency stop is open or a drive is not ready.
    NotReady,
    /// A run is at its end.
    Done,
    /// Motion rests at a program stop.
    ProgramStop,
    /// Motion rests in a hold.
    Held,
    /// A hold begins.
    Holding,
    /// A hold or a program stop ends.
    Resumed,
    /// Spindle and coolant are switched.
    Switched(OutputState),
    /// The new feed override \[%\].
    Override(u8),
    /// Single block is on or off.
    SingleBlock(bool),
    /// A press or a command had no effect, and why.
    Nothing(&'static str),
    /// The kernel is in a fault.
    Fault(Fault<R>),
    /// An item of the program can't be executed.
    Refused(SupplyError<ProgramError>),
    /// There is no way to the program's start.
    NoWay(StraightError),
    /// A row of the flight recorder.
    Flight(FlightRow<R, AXES>),
    /// Ticks of the last second, and all overruns.
    Ticks {
        /// The ticks of the last second.
        timing: TickTiming,
        /// Number of overruns since the start.
        overruns: u32,
    },
    /// Peaks of the following errors in the last second \[mm\].
    FollowingErrors([R; AXES]),
    /// Figures of the background.
    Background {
        /// Longest poll of the last second \[µs\].
        longest_poll_us: u32,
        /// Number of stops for want of data since the start.
        starvations: u32,
        /// Number of times that bytes of console or link were lost since the start.
        bytes_lost: u32,
    },
}

/// Greatest number of axes whose rows fit the log.
#[cfg(feature = "defmt")]
const FLIGHT_AXES_MAX: usize = 6;

/// Writes the line to defmt's log, with its level. A line that defmt's transport has no room for is lost.
#[cfg(feature = "defmt")]
#[inline(never)]
pub fn write<R: Real + defmt::Format, const AXES: usize>(line: &LogLine<R, AXES>) {
    use defmt::{error, info, warn};

    const { assert!(AXES <= FLIGHT_AXES_MAX, "a row of the flight recorder does not fit its frame") };
    match *line {
        LogLine::Ready => info!("ready: press the start button"),
        LogLine::Linked => info!("ready: waits for a PC on the link"),
        LogLine::Parameters(Origin::Flash) => info!("parameters: from flash"),
        LogLine::Parameters(Origin::Build) => info!("parameters: of the build"),
        LogLine::Parameters(Origin::Unsuitable(error)) => {
            warn!("parameters: of the build, as those in flash are not for this firmware: {}", error)
        }
        LogLine::Parameters(Origin::Unreadable(error)) => {
            error!("parameters: of the build, as flash can't be read: {}", error)
        }
        LogLine::NotStored(error) => error!("new parameters are not stored: {}", error),
        LogLine::Started(from) => info!("started: from {=[?]} mm", from.map(Position::to_mm)),
        LogLine::NotReady => warn!("not started: the emergency stop is open or a drive is not ready"),
        LogLine::Done => info!("done: press the start button to run again"),
        LogLine::ProgramStop => info!("program stop: press the start button to resume"),
        LogLine::Held => info!("held: the start button or r resumes"),
        LogLine::Holding => info!("coming to rest"),
        LogLine::Resumed => info!("resumed"),
        LogLine::Switched(to) => info!(
            "spindle {} at {=f64} rev/min, coolant {=str}",
            to.spindle,
            to.speed_rpm,
            if to.coolant_flows() { "on" } else { "off" }
        ),
        LogLine::Override(percent) => info!("feed override {=u8} %", percent),
        LogLine::SingleBlock(is_on) => info!("single block {=str}", if is_on { "on" } else { "off" }),
        LogLine::Nothing(why) => info!("{=str}", why),
        LogLine::Fault(fault) => error!("stopped: {}", fault),
        LogLine::Refused(error) => error!("program refused: {}; motion comes to rest", error),
        LogLine::NoWay(error) => error!("no way to the program's start: {}", error),
        LogLine::Flight(ref row) => {
            let mut buffer = [0; motion_kernel::flight::frame_max(FLIGHT_AXES_MAX)];
            if let Some(frame) = row.to_frame(&mut buffer) {
                info!("flight {=[u8]:02x}", frame);
            }
        }
        LogLine::Ticks { timing, overruns } => info!(
            "tick cycles min {=u32} max {=u32} last {=u32}, latency {=u32} to {=u32}, overruns {=u32}",
            timing.min_cycles,
            timing.max_cycles,
            timing.last_cycles,
            timing.min_latency_cycles,
            timing.max_latency_cycles,
            overruns
        ),
        LogLine::FollowingErrors(peaks_mm) => {
            info!("peak following error {=[?]} um", peaks_mm.map(|mm| R::from_f64(1e3) * mm));
        }
        LogLine::Background { longest_poll_us, starvations, bytes_lost } => info!(
            "longest background poll {=u32} us, {=u32} stops for want of data, {=u32} times bytes lost",
            longest_poll_us, starvations, bytes_lost
        ),
    }
}
