//! What a slow flash adds: the wait states that the STM32F446's accelerator does not hide.
//!
//! RM0390, 3.4: at 168 MHz a read takes 5 wait states and gives a line of 128 bits. The line in use is buffered, the next
//! one is read ahead while that is used (prefetch), and 64 lines that were missed are kept, the one that was used longest
//! ago replaced first. Constants come by another bus, with 8 lines of their own. The background has filled both with its
//! own lines before every tick: they begin empty of ours.
//!
//! Not in either side: constants whose address is in a register, of which a trace knows nothing.

use super::Cost;

/// Cycles that a line takes longer than one that is kept (RM0390, table of wait states: 150 to 180 MHz at 2.7 to 3.6 V).
const WAIT_STATES: u32 = 5;
const LINE_BYTES: u32 = 16;
/// Lines that are kept.
const CODE_LINES: usize = 64;
const DATA_LINES: usize = 8;

/// The lines that are kept, the one used longest ago first.
#[derive(Clone, Debug, Default)]
struct Lines(Vec<u32>);

impl Lines {
    /// Uses a line; whether it was kept.
    fn uses(&mut self, line: u32, capacity: usize) -> bool {
        let kept = self.0.iter().position(|&kept| kept == line);
        match kept {
            Some(at) => _ = self.0.remove(at),
            None if self.0.len() == capacity => _ = self.0.remove(0),
            None => {}
        }
        self.0.push(line);
        kept.is_some()
    }
}

/// The accelerator, from the beginning of a tick on.
#[derive(Clone, Debug, Default)]
pub(super) struct Flash {
    code: Lines,
    data: Lines,
    /// The line in use, and the cycles since it was.
    used: Option<(u32, u32)>,
}

impl Flash {
    /// Cycles that the fetch of `width` bytes at `at` waits.
    pub(super) fn fetch(&mut self, at: u32, width: u32) -> Cost {
        // An instruction may lie in two lines.
        let mut wait = self.line(at / LINE_BYTES);
        let last = (at + width - 1) / LINE_BYTES;
        if last != at / LINE_BYTES {
            wait = wait + self.line(last);
        }
        wait
    }

    fn line(&mut self, line: u32) -> Cost {
        let before = self.used;
        if before.is_some_and(|(used, _)| used == line) {
            return Cost::NOTHING;
        }
        self.used = Some((line, 0));
        if self.code.uses(line, CODE_LINES) {
            return Cost::NOTHING;
        }
        match before {
            // Read ahead since the line before was begun; on the other side the read has only been asked for.
            Some((used, since)) if used + 1 == line => {
                Cost { nominal: WAIT_STATES.saturating_sub(since), pessimistic: WAIT_STATES }
            }
            // On the other side a line that is being read ahead, in vain, comes first.
            _ => Cost { nominal: WAIT_STATES, pessimistic: 2 * WAIT_STATES },
        }
    }

    /// Cycles that a constant at `address` waits.
    pub(super) fn load(&mut self, address: u32) -> Cost {
        if self.data.uses(address / LINE_BYTES, DATA_LINES) {
            Cost::NOTHING
        } else {
            Cost { nominal: WAIT_STATES, pessimistic: 2 * WAIT_STATES }
        }
    }

    /// An instruction took so many cycles.
    pub(super) fn pass(&mut self, cycles: u32) {
        if let Some((_, since)) = &mut self.used {
            *since += cycles;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits(nominal: u32, pessimistic: u32) -> Cost {
        Cost { nominal, pessimistic }
    }

    #[test]
    fn code_in_order_is_read_ahead() {
        let mut flash = Flash::default();
        assert_eq!(flash.fetch(0x100, 2), waits(5, 10));
        assert_eq!(flash.fetch(0x102, 4), waits(0, 0));
        flash.pass(3);
        // Two of the five are left; in two lines at once.
        assert_eq!(flash.fetch(0x10e, 4), waits(2, 5));
        flash.pass(20);
        assert_eq!(flash.fetch(0x120, 2), waits(0, 5));
    }

    #[test]
    fn lines_are_kept_until_as_many_others_were_used() {
        let mut flash = Flash::default();
        for line in 0..64 {
            assert_eq!(flash.fetch(64 * line, 2), waits(5, 10), "{line}");
        }
        assert_eq!(flash.fetch(0, 2), waits(0, 0));
        // Takes the place of the second, not of the first, which was used just now.
        assert_eq!(flash.fetch(64 * 64, 2), waits(5, 10));
        assert_eq!(flash.fetch(0, 2), waits(0, 0));
        assert_eq!(flash.fetch(64, 2), waits(5, 10));
    }

    #[test]
    fn constants_have_lines_of_their_own() {
        let mut flash = Flash::default();
        assert_eq!(flash.fetch(0x100, 2), waits(5, 10));
        assert_eq!(flash.load(0x104), waits(5, 10));
        assert_eq!(flash.load(0x10c), waits(0, 0));
        for line in 0..8 {
            flash.load(0x1000 + 16 * line);
        }
        assert_eq!(flash.load(0x104), waits(5, 10));
    }
}
