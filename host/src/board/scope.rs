//! Every tick of a board, by replay.
//!
//! Consumes the frames of the board's scope and the items that it was sent; produces a row of the trace for every tick. The
//! kernel runs again in a thread of its own, so the link waits for nothing.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use motion_kernel::axis::{AxesConfig, AxesError};
use motion_kernel::link::{Build, Identity, Piece};
use motion_kernel::num::Real;
use motion_kernel::program::{Header, Item, ProgramError, Reader};
use motion_kernel::queue::LiveStreams;
use motion_kernel::scope::{Replay, ReplayError, Told};

use super::numbers::{Numbers, in_numbers};
use crate::simulate::contour::Contour;
use crate::simulate::run::trace_row;
use crate::trace::TraceRow;

/// Path that is ready for the replay, and items of a feed list.
const PIECES: usize = 64;
const SEGMENTS: usize = 16;
/// Streams of nine places pass through the stack.
const STACK: usize = 16 << 20;

/// What is told of the ticks, in order.
pub enum Ticks<'t, const N: usize> {
    /// A tick; the path position counts from the start of its stretch.
    Row(&'t TraceRow<N>),
    /// These are missing, from the first to the last.
    Gap(u64, u64),
}

/// Who is told.
pub type Sink<const N: usize> = Box<dyn FnMut(Ticks<'_, N>) + Send>;

/// What a scope has come to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScopeSummary {
    /// Ticks that were told.
    pub ticks: u64,
    /// Ticks that are missing, from the first to the last.
    pub gaps: Vec<(u64, u64)>,
    /// Bytes of the bodies of all frames.
    pub bytes: u64,
    /// Motion followed items that somebody else has sent.
    pub is_foreign: bool,
    /// What ended it.
    pub error: Option<ReplayError>,
}

impl ScopeSummary {
    /// Number of ticks that are missing.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.gaps.iter().map(|(first, last)| last - first + 1).sum()
    }
}

/// Why there is no scope. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScopeError {
    /// The board's ticks are another kernel's.
    #[error("found a board with kernel {}, expected kernel {}, which runs its ticks again", version(*.0), version(Build::THIS.kernel))]
    Kernel([u16; 3]),
    /// The board's parameters are none.
    #[error("found parameters that are none ({0:?}), expected those of a machine")]
    Parameters(ProgramError),
    /// The board's parameters have no guards, and its kernel has.
    #[error("found parameters without guards, expected those of a machine")]
    Unguarded,
    /// The board's number type does not hold them.
    #[error("found {0}, expected axes that the board's number type holds")]
    Axes(AxesError),
}

fn version([major, minor, patch]: [u16; 3]) -> String {
    format!("{major}.{minor}.{patch}")
}

/// What the thread is told.
enum Message<const N: usize> {
    /// An item of the program after so many aborts, or its end.
    Item(u16, Option<Item<N>>),
    /// The board has started anew: programs are counted from the first again.
    Restarted,
    Frame(bool, Piece),
}

/// A scope in a thread.
pub struct Scope<const N: usize> {
    to: Sender<Message<N>>,
    thread: JoinHandle<ScopeSummary>,
    wants: Arc<AtomicBool>,
    has_failed: Arc<AtomicBool>,
    last: Arc<AtomicU64>,
}

impl<const N: usize> Scope<N> {
    /// Of a board with these parameters, which were read from it.
    ///
    /// # Errors
    /// See [`ScopeError`].
    pub fn start(identity: &Identity, parameters: &[u8], sink: Sink<N>) -> Result<Self, ScopeError> {
        if identity.build.kernel != Build::THIS.kernel {
            return Err(ScopeError::Kernel(identity.build.kernel));
        }
        in_numbers!(Numbers::of(identity), R => Self::start_in::<R>(parameters, sink))
    }

    fn start_in<R: Real>(parameters: &[u8], sink: Sink<N>) -> Result<Self, ScopeError> {
        let reader = Reader::<N>::new(parameters).map_err(ScopeError::Parameters)?;
        let guards = reader.guards().map_err(ScopeError::Parameters)?.ok_or(ScopeError::Unguarded)?;
        let compensation = reader.compensation().map_err(ScopeError::Parameters)?;
        let header = *reader.header();
        let axes = AxesConfig::<R, N>::new(&header.axes, header.tick_s)
            .and_then(|axes| axes.guarded(&guards, header.tick_s))
            .and_then(|axes| axes.compensated(&compensation, header.tick_s))
            .map_err(ScopeError::Axes)?;
        let (to, from) = channel();
        let (wants, has_failed) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let last = Arc::new(AtomicU64::new(0));
        let flags = (Arc::clone(&wants), Arc::clone(&has_failed), Arc::clone(&last));
        let run = move || run(&axes, &header, &from, sink, &flags);
        let thread = thread::Builder::new().name("scope".to_owned()).stack_size(STACK).spawn(run);
        let thread = thread.expect("a system that has threads");
        Ok(Self { to, thread, wants, has_failed, last })
    }

    /// Notes an item that the board is sent, of the program after so many aborts; none for its end.
    pub fn item(&self, aborts: u16, item: Option<&Item<N>>) {
        // A thread that has failed says so at its end.
        let _ = self.to.send(Message::Item(aborts, item.copied()));
    }

    /// Notes that the board has started anew.
    pub fn restarted(&self) {
        let _ = self.to.send(Message::Restarted);
    }

    /// Takes a frame.
    pub fn frame(&self, is_first: bool, body: Piece) {
        let _ = self.to.send(Message::Frame(is_first, body));
    }

    /// Whether it needs another snapshot.
    #[must_use]
    pub fn wants_snapshot(&self) -> bool {
        self.wants.load(Ordering::Relaxed)
    }

    /// It will have another snapshot.
    pub fn snapshot_asked(&self) {
        self.wants.store(false, Ordering::Relaxed);
    }

    /// Whether a tick differed, so that nothing more is told.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed)
    }

    /// The last tick that was told, or is missing; 0 before the first one.
    #[must_use]
    pub fn last(&self) -> u64 {
        self.last.load(Ordering::Relaxed)
    }

    /// Waits until everything that came is told.
    #[must_use]
    pub fn finish(self) -> ScopeSummary {
        drop(self.to);
        match self.thread.join() {
            Ok(summary) => summary,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

/// The thread: until nobody can tell it anything more.
fn run<R: Real, const N: usize>(
    axes: &AxesConfig<R, N>,
    header: &Header<N>,
    from: &Receiver<Message<N>>,
    mut sink: Sink<N>,
    (wants, has_failed, last): &(Arc<AtomicBool>, Arc<AtomicBool>, Arc<AtomicU64>),
) -> ScopeSummary {
    let mut streams = Box::new(LiveStreams::<R, N, PIECES, SEGMENTS>::new());
    let mut replay = Box::new(Replay::new(axes, header, &mut *streams));
    let mut programs: BTreeMap<u16, Vec<Option<Item<N>>>> = BTreeMap::new();
    let mut contour = Contour::new([true; N]);
    let mut summary = ScopeSummary::default();
    while let Ok(message) = from.recv() {
        let (is_first, body) = match message {
            Message::Item(aborts, item) => {
                programs.entry(aborts).or_default().push(item);
                continue;
            }
            Message::Restarted => {
                programs.clear();
                continue;
            }
            Message::Frame(..) if summary.error.is_some() => continue,
            Message::Frame(is_first, body) => (is_first, body),
        };
        summary.bytes += body.bytes().len() as u64;
        let mut items = |aborts: u16, number: u32| programs.get(&aborts)?.get(number as usize).copied();
        let taken = replay.take(is_first, body.bytes(), &mut items, &mut |told| match told {
            Told::Tick(trace) => {
                summary.ticks += 1;
                sink(Ticks::Row(&trace_row(trace, 0.0, &mut contour)));
                last.store(trace.tick, Ordering::Relaxed);
            }
            Told::Gap { first, last } => {
                summary.gaps.push((first, last));
                sink(Ticks::Gap(first, last));
            }
            Told::UnknownItems => {
                summary.is_foreign = true;
                wants.store(true, Ordering::Relaxed);
            }
        });
        if let Err(error) = taken {
            summary.error = Some(error);
            has_failed.store(true, Ordering::Relaxed);
        }
    }
    summary
}

#[cfg(test)]
mod tests {
    use motion_kernel::hal::BoardOutputs;

    use super::*;

    #[test]
    fn ticks_of_another_kernel_are_not_run_again() {
        let kernel = [u16::MAX, 1, 2];
        let identity = Identity {
            build: Build { kernel, ..Build::THIS },
            format: 0,
            axes: 3,
            is_fixed_point: false,
            tick_s: 0.0005,
            items: 8,
            outputs: BoardOutputs::FixedSpeed,
            machine: 0,
        };
        let started = Scope::<3>::start(&identity, &[], Box::new(|_| {}));
        let Err(error) = started else { panic!("it is started") };
        assert_eq!(error, ScopeError::Kernel(kernel));
        assert!(
            error.to_string().starts_with("found a board with kernel 65535.1.2, expected kernel "),
            "{error}"
        );
    }
}
