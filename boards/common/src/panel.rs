//! The operator's panel: a button and the bytes of a serial console.
//!
//! Consumes the level of the button once per poll; produces presses.

/// The board's panel. The background asks it once per poll, and between the steps of a plan whether a hold waits.
pub trait Panel {
    /// Whether the start button is down now. This crate debounces it.
    fn is_button_down(&self) -> bool;

    /// Called between the steps of a plan: the background is alive, however long the plan takes.
    fn note_step(&self);

    /// The byte that [`Panel::next_byte`] would take.
    fn waiting_byte(&self) -> Option<u8>;

    /// The next byte of the console, in order of arrival.
    fn next_byte(&mut self) -> Option<u8>;

    /// Number of times that bytes were lost since the start.
    fn bytes_lost(&self) -> u32;
}

/// The button, debounced.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Button {
    /// The tick since which it has been down.
    since: Option<u32>,
    samples: u8,
    is_counted: bool,
}

/// Least number of samples for a press, however long polls take: one may be a bounce.
const PRESS_SAMPLES: u8 = 3;

impl Button {
    /// Whether a poll has seen it down. So a press, or a bounce, ends one plan and no more.
    pub(crate) fn is_seen(&self) -> bool {
        self.since.is_some()
    }

    /// Whether it has just been down for `button_ticks` at tick `now`, as seen by the polls. A press counts
    /// once.
    pub(crate) fn is_pressed(&mut self, is_down: bool, now: u32, button_ticks: u32) -> bool {
        if !is_down {
            *self = Self::default();
            return false;
        }
        let since = *self.since.get_or_insert(now);
        self.samples = self.samples.saturating_add(1);
        let is_press = now.wrapping_sub(since) >= button_ticks && self.samples >= PRESS_SAMPLES;
        is_press && !core::mem::replace(&mut self.is_counted, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks at which a button that is down where `down` says so counts as pressed, with a poll every `poll`
    /// ticks.
    fn presses(poll: u32, begin: u32, down: impl Fn(u32) -> bool) -> Vec<u32> {
        let mut button = Button::default();
        (0..400)
            .step_by(poll as usize)
            .filter(|&tick| button.is_pressed(down(tick), begin.wrapping_add(tick), 40))
            .collect()
    }

    #[test]
    fn a_press_counts_once_and_a_bounce_never() {
        assert_eq!(presses(1, 0, |tick| (100..300).contains(&tick)), [140]);
        assert!(presses(1, 0, |tick| (100..140).contains(&tick)).is_empty());
        // Bounces at both edges.
        let bouncing = |tick| (100..300).contains(&tick) && !matches!(tick, 103 | 110 | 290);
        assert_eq!(presses(1, 0, bouncing), [151]);
        assert_eq!(presses(1, 0, |tick| (50..100).contains(&tick) || tick >= 200), [90, 240]);
        // The counter of ticks wraps.
        assert_eq!(presses(1, u32::MAX - 120, |tick| tick >= 100), [140]);
    }

    /// Polls of 66 ticks: two samples are 66 ticks apart, and still no press.
    #[test]
    fn long_polls_need_three_samples() {
        assert_eq!(presses(66, 0, |tick| tick >= 66), [198]);
    }
}
