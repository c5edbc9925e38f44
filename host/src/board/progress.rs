//! How far a program is for sure, of what a board tells.
//!
//! What the kernel has driven is ahead of what the machine has: by the preview, and by the following error. Progress counts
//! only once it is older than that, so that after a power cut path comes again rather than being left out.

use std::collections::VecDeque;

/// Axes follow within this time \[s\]: a preview of some ticks, and several time constants of a position loop.
const FOLLOW_S: f64 = 0.25;

/// A place of the program, as a board tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Pieces of path and ends of stretches of the whole program that are driven.
    pub driven: u32,
    /// The program line there; 0 at rest.
    pub line: u32,
}

/// What is driven, and what the machine has followed for sure.
#[derive(Clone, Debug)]
pub struct Progress {
    follow_ticks: u32,
    sure: Place,
    /// Places with the tick in which they were told first.
    told: VecDeque<(u32, Place)>,
}

impl Progress {
    /// Before anything of a job is driven that begins behind `driven` pieces and ends, on a board with ticks of `tick_s`.
    #[must_use]
    pub fn new(driven: u32, tick_s: f64) -> Self {
        let sure = Place { driven, line: 0 };
        Self { follow_ticks: (FOLLOW_S / tick_s).ceil() as u32, sure, told: VecDeque::new() }
    }

    /// The board tells in a tick how far it is; how far it is for sure.
    pub fn tell(&mut self, tick: u32, place: Place) -> Place {
        if self.told.back().map_or(self.sure.driven, |(_, last)| last.driven) != place.driven {
            self.told.push_back((tick, place));
        }
        // Ticks wrap.
        while let Some(&(since, place)) = self.told.front()
            && tick.wrapping_sub(since) >= self.follow_ticks
        {
            self.sure = place;
            self.told.pop_front();
        }
        self.sure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_is_sure_once_the_machine_has_followed() {
        let place = |driven| Place { driven, line: 10 * driven };
        let mut progress = Progress::new(3, 0.0005);
        assert_eq!(progress.tell(u32::MAX - 100, place(3)).driven, 3);
        assert_eq!(progress.tell(u32::MAX - 99, place(4)).driven, 3);
        assert_eq!(progress.tell(u32::MAX, place(6)).driven, 3);
        assert_eq!(progress.tell(399, place(6)).driven, 3);
        // 500 ticks after it was told first, across the wrap of ticks.
        assert_eq!(progress.tell(400, place(6)), place(4));
        assert_eq!(progress.tell(499, place(7)), place(6));
        assert_eq!(progress.tell(900, place(7)).driven, 6);
    }
}
