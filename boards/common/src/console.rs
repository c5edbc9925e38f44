//! Commands of the serial console: one character each, so none can arrive in part.
//!
//! Consumes bytes; produces [`Command`]s. Other bytes are ignored. Bytes that PC programs send to what they
//! take for a modem (`AT…`, frames between 0x7E) contain none of these letters.

use motion_kernel::live::{OVERRIDE_MAX, OVERRIDE_MIN};

/// A command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Come to rest on the path.
    Hold,
    /// Resume after a hold, or after a block in single block.
    Resume,
    /// Change the feed override.
    Override(Step),
    /// Come to rest at the end of every program line, or stop doing so.
    SingleBlock(bool),
}

impl Command {
    /// The command of a byte.
    #[must_use]
    pub fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            b'h' => Self::Hold,
            b'r' => Self::Resume,
            b'u' => Self::Override(Step::Up),
            b'd' => Self::Override(Step::Down),
            b'n' => Self::Override(Step::AsProgrammed),
            b's' => Self::SingleBlock(true),
            b'c' => Self::SingleBlock(false),
            _ => return None,
        })
    }
}

/// How the feed override changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Up by [`STEP_PERCENT`].
    Up,
    /// Down by [`STEP_PERCENT`].
    Down,
    /// To 100 %.
    AsProgrammed,
}

/// A step of the feed override, and the least override \[%\].
pub const STEP_PERCENT: u8 = 10;
/// Greatest feed override \[%\].
pub const MOST_PERCENT: u8 = 200;

const _: () =
    assert!(MOST_PERCENT as f64 <= 100.0 * OVERRIDE_MAX && STEP_PERCENT as f64 >= 100.0 * OVERRIDE_MIN);

/// A feed override \[%\], from [`STEP_PERCENT`] to [`MOST_PERCENT`]; for 0 there is the hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FeedOverride(u8);

impl FeedOverride {
    /// The feed as programmed.
    pub const NONE: Self = Self(100);

    /// The override after a step.
    #[must_use]
    pub fn after(self, step: Step) -> Self {
        match step {
            Step::Up => Self((self.0 + STEP_PERCENT).min(MOST_PERCENT)),
            Step::Down => Self((self.0 - STEP_PERCENT).max(STEP_PERCENT)),
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
    fn seven_letters_are_commands() {
        let commands: Vec<_> = (0..=u8::MAX).filter_map(|byte| Some((byte, Command::of(byte)?))).collect();
        let expected = [
            (b'c', Command::SingleBlock(false)),
            (b'd', Command::Override(Step::Down)),
            (b'h', Command::Hold),
            (b'n', Command::Override(Step::AsProgrammed)),
            (b'r', Command::Resume),
            (b's', Command::SingleBlock(true)),
            (b'u', Command::Override(Step::Up)),
        ];
        assert_eq!(commands, expected);
    }

    /// A line that floats or is broken, and a program that looks for a modem.
    #[test]
    fn what_nobody_meant_is_none() {
        let probes: [&[u8]; 4] = [&[0x00, 0xFF], b"AT\r\n", b"AT+CGMM\r", &[0x7E, 0x00, 0x78, 0xF0, 0x7E]];
        for byte in probes.into_iter().flatten() {
            assert_eq!(Command::of(*byte), None, "{byte:#x}");
        }
    }

    #[test]
    fn an_override_stays_within_its_range() {
        let (mut up, mut down) = (FeedOverride::NONE, FeedOverride::NONE);
        for steps in 1..=30_u8 {
            (up, down) = (up.after(Step::Up), down.after(Step::Down));
            let most = 100_u32 + 10 * u32::from(steps);
            assert_eq!(u32::from(up.percent()), most.min(200));
            assert_eq!(down.percent(), 100_u8.saturating_sub(steps.saturating_mul(10)).max(10));
        }
        assert_eq!((up.share(), down.share()), (2.0, 0.1));
        assert_eq!([up, down].map(|other| other.after(Step::AsProgrammed)), [FeedOverride::NONE; 2]);
    }
}
