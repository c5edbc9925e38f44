//! The test kit: what the tests of all crates share. Nothing else depends on it.

#[cfg(feature = "host")]
#[allow(missing_docs, reason = "parts of checks, read with the tests that use them")]
pub mod check;

pub mod axes;
pub mod bench;
pub mod block_lists;
#[cfg(feature = "host")]
pub mod bytes;
pub mod cycles;
#[allow(missing_docs, reason = "arithmetic")]
pub mod dd;
#[cfg(feature = "host")]
pub mod drives;
pub mod figures;
pub mod fuzz;
pub mod judge;
pub mod link;
pub mod random;
pub mod samples;
pub mod s4;

/// The laws.
pub const PULSES: [motion_kernel::law::Pulse; 2] =
    [motion_kernel::law::Pulse::Sin2, motion_kernel::law::Pulse::Plateau];

/// A number from the environment: the seed of a test, or how much it does in its long form.
///
/// # Panics
/// What is set is no whole number.
#[must_use]
pub fn from_env(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text}: expected a whole number")))
}

/// Every file and folder in a package's `tests` is a module of its `suite.rs`, or one of `alone`: cargo builds none by itself.
///
/// # Panics
/// One is not.
pub fn assert_all_are_in(package: &str, suite: &str, alone: &[&str]) {
    let folder = std::path::Path::new(package).join("tests");
    for entry in std::fs::read_dir(&folder).expect("a folder") {
        let path = entry.expect("a readable folder").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
        let is_built = suite.lines().any(|line| line == format!("mod {name};"));
        assert!(is_built || name == "suite" || alone.contains(&name), "suite.rs has no `mod {name};`");
    }
}
