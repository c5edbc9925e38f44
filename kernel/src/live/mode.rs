//! The operator's commands: how the program is to be driven. Owns no motion.

/// The greatest feed override.
pub const OVERRIDE_MAX: f64 = 2.0;
/// The least feed override that is not 0.
pub const OVERRIDE_MIN: f64 = 1.0e-3;

/// Whether the program is to be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Run {
    /// Driven as long as there are items.
    On,
    /// At rest until resumed.
    Hold,
    /// At rest for good.
    Abort,
}

/// How far the program is driven before motion is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blocks {
    /// To its end.
    All,
    /// To the end of every program block.
    Single,
}

/// What a command asks of the motion under way, until a list for it has been handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Come to rest.
    Stop,
    /// Continue under another override, or to the end of a block.
    Override,
}

/// What was commanded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mode {
    run: Run,
    blocks: Blocks,
    feed_override: f64,
    request: Option<Request>,
}

impl Mode {
    pub(super) const fn new() -> Self {
        Self { run: Run::On, blocks: Blocks::All, feed_override: 1.0, request: None }
    }

    pub(super) fn run(&self) -> Run {
        self.run
    }

    pub(super) fn is_single_block(&self) -> bool {
        self.blocks == Blocks::Single
    }

    pub(super) fn feed_override(&self) -> f64 {
        self.feed_override
    }

    pub(super) fn request(&self) -> Option<Request> {
        self.request
    }

    /// Whether motion is to end at rest, or to stay there.
    pub(super) fn is_to_rest(&self) -> bool {
        self.run != Run::On || self.feed_override <= 0.0
    }

    pub(super) fn hold(&mut self) {
        if self.run == Run::On {
            (self.run, self.request) = (Run::Hold, Some(Request::Stop));
        }
    }

    pub(super) fn resume(&mut self) {
        if self.run == Run::Hold {
            self.run = Run::On;
            // A stop not handed over yet is dropped; the override may have changed by now.
            self.request = self.request.map(|_| self.request_of_override());
        }
    }

    pub(super) fn abort(&mut self) {
        self.hold();
        self.run = Run::Abort;
    }

    /// Holds at rest at the end of a block; no request is needed.
    pub(super) fn hold_at_block_end(&mut self) {
        self.run = Run::Hold;
    }

    pub(super) fn set_override(&mut self, feed_override: f64) -> Result<(), f64> {
        if feed_override != 0.0 && !(OVERRIDE_MIN..=OVERRIDE_MAX).contains(&feed_override) {
            return Err(feed_override);
        }
        if feed_override != self.feed_override {
            self.feed_override = feed_override;
            self.request_change();
        }
        Ok(())
    }

    pub(super) fn set_blocks(&mut self, blocks: Blocks) {
        if blocks != self.blocks {
            self.blocks = blocks;
            self.request_change();
        }
    }

    /// Clears a request that has been obeyed or can't be.
    pub(super) fn clear_request(&mut self) {
        self.request = None;
    }

    /// Asks again for `request`, unless there is a newer one.
    pub(super) fn renew(&mut self, request: Option<Request>) {
        self.request = self.request.or(request);
    }

    /// Requests a change of motion that is not held.
    fn request_change(&mut self) {
        if self.run == Run::On {
            self.request = Some(self.request_of_override());
        }
    }

    fn request_of_override(&self) -> Request {
        if self.feed_override > 0.0 { Request::Override } else { Request::Stop }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stop that was not made yet is taken back by a resume, and becomes what the override asks for.
    #[test]
    fn a_resume_takes_back_a_stop_that_is_not_made() {
        for (feed_override, request) in [(0.5, Request::Override), (0.0, Request::Stop)] {
            let mut mode = Mode::new();
            mode.hold();
            assert_eq!((mode.run(), mode.request()), (Run::Hold, Some(Request::Stop)));
            mode.set_override(feed_override).expect("in range");
            assert_eq!(mode.request(), Some(Request::Stop), "held: the override waits");
            mode.resume();
            assert_eq!((mode.run(), mode.request()), (Run::On, Some(request)));
        }
        let mut mode = Mode::new();
        mode.hold();
        mode.clear_request();
        mode.resume();
        assert_eq!(
            (mode.run(), mode.request()),
            (Run::On, None),
            "the stop was made: motion starts from rest"
        );
    }

    #[test]
    fn an_abort_is_final() {
        let mut mode = Mode::new();
        mode.abort();
        mode.resume();
        mode.hold();
        assert_eq!((mode.run(), mode.request()), (Run::Abort, Some(Request::Stop)));
        assert!(mode.is_to_rest());
    }

    #[test]
    fn an_override_out_of_range_changes_nothing() {
        let mut mode = Mode::new();
        for feed_override in [-1.0, 0.9 * OVERRIDE_MIN, 1.1 * OVERRIDE_MAX] {
            assert_eq!(mode.set_override(feed_override), Err(feed_override));
        }
        assert!(mode.set_override(f64::NAN).is_err());
        assert_eq!((mode.feed_override(), mode.request()), (1.0, None));
        mode.set_override(1.0).expect("in range");
        assert_eq!(mode.request(), None, "the one that it has");
    }
}
