//! What the background hands to the tick, in order, each with the tick before which it counts.
//!
//! The tick sees what the background writes by a number, the mailbox's generation, which is in its record. So what was written
//! up to that number comes before the tick. What the background does to the kernel itself it does between two ticks that it
//! knows.

use heapless::Deque;
use serde::{Deserialize, Serialize};

use crate::live::ListItem;
use crate::units::{Counts, Position};

/// Room for what is handed over between two frames: two lists, and some words.
const PLACES: usize = 64;

/// What the background hands to the tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Handed<const AXES: usize> {
    /// A list is begun.
    Begin { list: u8 },
    /// An item of it.
    Item { list: u8, item: ListItem },
    /// An item of a list that was handed over before the snapshot.
    Kept { list: u8, item: ListItem },
    /// The word of the change that is asked for.
    Change(u32),
    /// A list is given up.
    GiveUp { list: u8 },
    /// The streams begin anew at a position, with the items of a program.
    Restart {
        #[serde(with = "crate::array")]
        position: [Position; AXES],
        program: Begun,
    },
    /// What is done to the kernel.
    Command(Command),
}

/// Where the items come from that the streams were filled with since they began anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Begun {
    /// The program after so many aborts.
    pub(crate) aborts: u16,
    /// The number of the first item.
    pub(crate) first: u32,
    /// How many pieces and ends of stretch had entered before.
    pub(crate) path_entered: u32,
    /// They come from nowhere: the board makes them itself, to home an axis.
    pub(crate) is_own: bool,
}

/// What a board's background does to its kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// [`Kernel::enable`](crate::kernel::Kernel::enable).
    Enable {
        /// Ticks in which the machine is held.
        settle_ticks: u32,
    },
    /// [`Kernel::stand_here`](crate::kernel::Kernel::stand_here).
    StandHere,
    /// [`Kernel::rest_here`](crate::kernel::Kernel::rest_here).
    RestHere,
    /// [`Kernel::clear_fault`](crate::kernel::Kernel::clear_fault).
    ClearFault,
    /// [`Kernel::resume`](crate::kernel::Kernel::resume).
    Resume,
    /// [`Kernel::reference`](crate::kernel::Kernel::reference).
    Reference {
        /// The axis, from 0.
        axis: u16,
        /// Its encoder's counts.
        counts: Counts,
        /// The position there.
        position: Position,
    },
}

/// From which tick on it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum From {
    /// Nothing sees it by itself.
    Now,
    /// From the first tick that saw this generation.
    Generation(u32),
    /// From the tick after this one.
    After(u32),
}

/// What was handed to the tick and was not sent yet.
#[derive(Debug)]
pub struct Log<const AXES: usize> {
    entries: Deque<(From, Handed<AXES>), PLACES>,
    /// Somebody wants to know.
    pub(super) is_on: bool,
    /// Something is missing.
    pub(super) is_lost: bool,
    pub(super) begun: Begun,
}

impl<const AXES: usize> Log<AXES> {
    pub(super) const fn new() -> Self {
        let begun = Begun { aborts: 0, first: 0, path_entered: 0, is_own: false };
        Self { entries: Deque::new(), is_on: false, is_lost: false, begun }
    }

    /// Notes a word that the background wrote to the mailbox, with its generation; none if that is not certain.
    pub(crate) fn hand(&mut self, generation: Option<u32>, handed: Handed<AXES>) {
        match generation {
            Some(generation) => self.push(From::Generation(generation), handed),
            None => self.is_lost = true,
        }
    }

    /// Notes an item of a list.
    pub(crate) fn item(&mut self, list: u8, item: &ListItem) {
        self.push(From::Now, Handed::Item { list, item: *item });
    }

    /// Notes an item of a list that was handed over before.
    pub(crate) fn keep(&mut self, list: u8, item: &ListItem) {
        self.push(From::Now, Handed::Kept { list, item: *item });
    }

    /// Notes what was done to the kernel after `tick`.
    pub fn command(&mut self, tick: u64, command: Command) {
        self.push(From::After(tick as u32), Handed::Command(command));
    }

    /// Notes that the streams have begun anew after `tick`.
    pub(crate) fn restart(&mut self, tick: u64, position: [Position; AXES], begun: Begun) {
        self.begun = begun;
        self.push(From::After(tick as u32), Handed::Restart { position, program: begun });
    }

    fn push(&mut self, from: From, handed: Handed<AXES>) {
        if self.is_on && self.entries.push_back((from, handed)).is_err() {
            self.is_lost = true;
        }
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
        self.is_lost = false;
    }

    /// Whether most of the room is taken.
    pub(super) fn is_filling(&self) -> bool {
        self.entries.len() > PLACES / 2
    }

    /// The first one, if it comes before a tick, which saw this generation.
    pub(super) fn before(&self, tick: u32, generation: u32) -> Option<&Handed<AXES>> {
        let (from, handed) = self.entries.front()?;
        let counts = match *from {
            From::Now => true,
            From::Generation(of_word) => generation.wrapping_sub(of_word).cast_signed() >= 0,
            From::After(before) => tick.wrapping_sub(before).cast_signed() > 0,
        };
        counts.then_some(handed)
    }

    /// Drops the first one.
    pub(super) fn pop(&mut self) {
        self.entries.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log() -> Log<1> {
        let mut log = Log::new();
        log.is_on = true;
        log
    }

    /// Before the first tick that saw its number; what comes behind it waits for it.
    #[test]
    fn a_word_comes_before_the_tick_that_saw_it() {
        let mut log = log();
        log.hand(Some(u32::MAX), Handed::Begin { list: 1 });
        log.hand(Some(0), Handed::Change(7));
        log.command(9, Command::Resume);
        assert_eq!(log.before(1, u32::MAX - 1), None);
        assert_eq!(log.before(1, u32::MAX), Some(&Handed::Begin { list: 1 }));
        log.pop();
        assert_eq!(log.before(2, u32::MAX), None);
        // Numbers wrap.
        assert_eq!(log.before(3, 0), Some(&Handed::Change(7)));
        log.pop();
        assert_eq!((log.before(9, 0), log.before(10, 0)), (None, Some(&Handed::Command(Command::Resume))));
    }

    /// A word that a tick came into the midst of, and one for which there is no room.
    #[test]
    fn what_is_not_known_makes_a_gap() {
        let mut log = log();
        log.hand(None, Handed::GiveUp { list: 2 });
        assert!(log.is_lost);
        log.clear();
        for number in 0..PLACES as u32 {
            log.hand(Some(number), Handed::Change(number));
            assert!(!log.is_lost);
        }
        log.hand(Some(PLACES as u32), Handed::Change(0));
        assert!(log.is_lost);
    }
}
