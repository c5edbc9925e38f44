//! Random programs and machines, and what is checked about their execution, shared by the tests.
//!
//! Nothing here uses the kernel's feed law, the toolpath's curves or the G-code reader's geometry: what
//! a program means is known from how it was generated, and motion is checked against itself.

pub(crate) mod bench;
pub(crate) mod bounds;
pub(crate) mod drive;
pub(crate) mod geometry;
pub(crate) mod live;
pub(crate) mod machine;
pub(crate) mod motion;
pub(crate) mod path;
pub(crate) mod program;
pub(crate) mod random;
pub(crate) mod totals;

/// A number from the environment.
pub(crate) fn from_env(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text}: expected a whole number")))
}
