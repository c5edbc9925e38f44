//! Commands of the serial console: one character each, so that none can come in half.
//!
//! Consumes bytes; produces [`Command`]s. What is none is nothing. The console steers motion that the button has started;
//! it starts none, and goes on only behind a hold: a line that nobody drives must not set a machine going.

use motion_kernel::live::{OVERRIDE_MAX, OVERRIDE_MIN};

/// What is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Come to rest on the path.
    Hold,
    /// Go on: behind a hold, a block in single block, or a program stop.
    GoOn,
    /// Another feed override.
    Override(Step),
    /// Come to rest at the end of every program line, or do so no more.
    SingleBlock(bool),
}

impl Command {
    /// Of a byte. `!` and `~` are those of Grbl.
    #[must_use]
    pub fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            b'!' => Self::Hold,
            b'~' => Self::GoOn,
            b'+' => Self::Override(Step::Faster),
            b'-' => Self::Override(Step::Slower),
            b'=' => Self::Override(Step::AsProgrammed),
            b's' => Self::SingleBlock(true),
            b'c' => Self::SingleBlock(false),
            _ => return None,
        })
    }
}

/// How the feed override changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// By [`STEP_PERCENT`] up.
    Faster,
    /// By as much down.
    Slower,
    /// To 100 %.
    AsProgrammed,
}

/// Least change of the feed override \[%\].
pub const STEP_PERCENT: u8 = 10;
/// Greatest feed override \[%\].
pub const MOST_PERCENT: u8 = 200;

const _: () =
    assert!(MOST_PERCENT as f64 <= 100.0 * OVERRIDE_MAX && STEP_PERCENT as f64 >= 100.0 * OVERRIDE_MIN);

/// A feed override \[%\], from [`STEP_PERCENT`] to [`MOST_PERCENT`]: 0 is a hold's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FeedOverride(u8);

impl FeedOverride {
    /// As programmed.
    pub const NONE: Self = Self(100);

    /// The next one.
    #[must_use]
    pub fn after(self, step: Step) -> Self {
        match step {
            Step::Faster => Self((self.0 + STEP_PERCENT).min(MOST_PERCENT)),
            Step::Slower => Self((self.0 - STEP_PERCENT).max(STEP_PERCENT)),
            Step::AsProgrammed => Self::NONE,
        }
    }

    /// In percent.
    #[must_use]
    pub fn percent(self) -> u8 {
        self.0
    }

    /// As a share of the program's feed.
    #[must_use]
    pub fn share(self) -> f64 {
        f64::from(self.0) / 100.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seven_characters_are_commands() {
        let commands: Vec<_> = (0..=u8::MAX).filter_map(|byte| Some((byte, Command::of(byte)?))).collect();
        let expected = [
            (b'!', Command::Hold),
            (b'+', Command::Override(Step::Faster)),
            (b'-', Command::Override(Step::Slower)),
            (b'=', Command::Override(Step::AsProgrammed)),
            (b'c', Command::SingleBlock(false)),
            (b's', Command::SingleBlock(true)),
            (b'~', Command::GoOn),
        ];
        assert_eq!(commands, expected);
        // What a line reads as that floats or is broken.
        assert!([0x00, 0xFF].map(Command::of).iter().all(Option::is_none));
    }

    #[test]
    fn an_override_stays_within_its_range() {
        let (mut up, mut down) = (FeedOverride::NONE, FeedOverride::NONE);
        for steps in 1..=30_u8 {
            (up, down) = (up.after(Step::Faster), down.after(Step::Slower));
            let most = 100_u32 + 10 * u32::from(steps);
            assert_eq!(u32::from(up.percent()), most.min(200));
            assert_eq!(down.percent(), 100_u8.saturating_sub(steps.saturating_mul(10)).max(10));
        }
        assert_eq!((up.share(), down.share()), (2.0, 0.1));
        assert_eq!([up, down].map(|other| other.after(Step::AsProgrammed)), [FeedOverride::NONE; 2]);
    }
}
