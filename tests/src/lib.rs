//! The test kit: what the tests of all crates share. Nothing else depends on it.

#[cfg(feature = "host")]
#[allow(missing_docs, reason = "parts of checks, read with the tests that use them")]
pub mod check;

pub mod axes;
pub mod block_lists;
pub mod cycles;
#[allow(missing_docs, reason = "arithmetic")]
pub mod dd;
pub mod figures;
pub mod fuzz;
pub mod judge;
pub mod random;
pub mod s4;

/// A number from the environment: the seed of a test, or how much it does in its long form.
///
/// # Panics
/// What is set is no whole number.
#[must_use]
pub fn from_env(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text}: expected a whole number")))
}
