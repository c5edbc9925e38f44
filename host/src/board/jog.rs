//! Jogs of a machine on a board: keys pressed one after the other, each until the machine stands.
//!
//! Consumes [`Keys`]; produces, for each, a program of one line for the board. The board has a dead man: where nothing comes
//! from here for that time, it holds by itself.

use std::sync::Arc;
use std::time::Duration;

use motion_kernel::link::{Event, State, Status};

use super::connection::{Connection, Heard};
use super::error::BoardError;
use super::job::Job;
use super::sender::{Permissions, Sender, Step};
use crate::simulate::jog::{Ended, Jogged, Keys};

/// Jogs of a machine with `N` places on a board of `M` axes.
pub struct Jogs<'a, const N: usize, const M: usize> {
    /// The keys.
    pub keys: &'a Keys<'a, N>,
    /// A job of the machine without items.
    pub job: Arc<Job<M>>,
    /// Names of the machine's axes, for errors.
    pub axes: Arc<[String]>,
    /// What may be done for it.
    pub may: Permissions,
    /// After so long a silence the board holds \[ms\], above 0.
    pub dead_man_ms: u16,
}

impl<const N: usize, const M: usize> Jogs<'_, N, M> {
    /// Presses a key, and waits until the machine stands. It is released where its press says so, or as soon as
    /// `is_released`. Times and the greatest feed are those of what the board tells, some fifty times a second.
    ///
    /// # Errors
    /// The key or the board is refused, or the board is in a fault or lost.
    pub fn press(
        &self,
        key: usize,
        connection: &mut Connection<M>,
        is_released: &mut dyn FnMut() -> bool,
    ) -> Result<Jogged, BoardError> {
        let (axis, press) = self.keys.key(key);
        let wanted = self.keys.wanted(key);
        let mut sender = Sender::new(Arc::clone(&self.job), Arc::clone(&self.axes), self.may)
            .jogs(wanted, self.dead_man_ms);
        let mut seen: Option<Seen<M>> = None;
        let mut released: Option<Status<M>> = None;
        let (mut has_moved, mut is_held) = (false, false);
        loop {
            let mut heard = Vec::new();
            connection.step(Duration::from_millis(2), &mut |one| heard.push(one));
            for one in &heard {
                sender.hear(one)?;
                match one {
                    Heard::Lost(cause) => {
                        let told = format!("{cause}; the board holds by itself");
                        return Err(BoardError::Wire(std::io::Error::other(told)));
                    }
                    Heard::Board(Event::Status(status)) => {
                        if let Some(seen) = &mut seen {
                            has_moved |= status.state == State::Moving;
                            seen.see(status);
                        }
                    }
                    _ => {}
                }
            }
            // What the board has before the greeting is not this one's to give up.
            if !matches!(sender.step(), Step::Greets | Step::Aborts) {
                let is_due =
                    |seen: &Seen<M>, status| press.release.is_some_and(|ticks| seen.ticks(status) >= ticks);
                let moving = connection.status().filter(|status| status.state == State::Moving);
                let is_due = seen.as_ref().zip(moving).is_some_and(|(seen, status)| is_due(seen, status));
                // Before it moves, too.
                let by_itself = connection.status().is_some_and(|status| status.state == State::Held);
                // Before it moves, it is held from the press before.
                if by_itself && has_moved {
                    is_held = true;
                    sender.abort(connection);
                } else if is_released() || is_due {
                    released = connection.status().copied();
                    sender.abort(connection);
                }
            }
            let before = connection.status().copied();
            let step = sender.advance(connection)?;
            if let (None, Step::ToStart, Some(before)) = (&seen, step, before) {
                seen = Some(Seen::new(before));
            }
            if matches!(step, Step::Done | Step::Aborted) {
                if is_held {
                    let told = "the board held by itself: it heard nothing for the dead man's time";
                    return Err(BoardError::Wire(std::io::Error::other(told)));
                }
                let Some(status) = connection.status().copied() else { continue };
                let seen = seen.unwrap_or_else(|| Seen::new(status));
                let ended = match released {
                    Some(from) => Ended::Released {
                        ticks: u64::from(status.tick.wrapping_sub(from.tick)),
                        length_mm: (status.set[axis] - from.set[axis]).to_mm().abs(),
                    },
                    None if wanted.on_board(seen.first.set).is_ok_and(|jog| jog.ends_at_limit()) => {
                        Ended::SoftLimit
                    }
                    None => Ended::Distance,
                };
                return Ok(Jogged {
                    press: press.clone(),
                    unit: self.keys.unit(key),
                    from_mm: seen.first.set[axis].to_mm(),
                    to_mm: status.set[axis].to_mm(),
                    ticks: seen.ticks(&status),
                    feed_mm_s: seen.feed_mm_s,
                    ended,
                });
            }
        }
    }
}

/// What is seen of a jog.
struct Seen<const M: usize> {
    /// The last status before it.
    first: Status<M>,
    feed_mm_s: f64,
}

impl<const M: usize> Seen<M> {
    fn new(first: Status<M>) -> Self {
        Self { first, feed_mm_s: 0.0 }
    }

    fn see(&mut self, status: &Status<M>) {
        self.feed_mm_s = self.feed_mm_s.max(status.feed_mm_s);
    }

    /// Ticks since it began.
    fn ticks(&self, status: &Status<M>) -> u64 {
        // They wrap.
        u64::from(status.tick.wrapping_sub(self.first.tick))
    }
}
