//! The compiled programs that the emulator was given: a bundle at a fixed address, loaded next to the image
//! as if it had been flashed there.
//!
//! A bundle is the number of programs, then each one's seed, length, and bytes, padded to four; all numbers are
//! 32 bits, least significant byte first.

/// The bundle's address: after the image's own memory (`build.rs`).
pub const ADDRESS: usize = if super::IS_SMALL {
    192 << 10
} else if cfg!(target_arch = "riscv32") {
    0x8040_0000
} else {
    2 << 20
};
/// How much memory there is from there.
const LENGTH: usize = if super::IS_SMALL { 64 << 10 } else { 2 << 20 };

/// The programs in order.
pub fn programs() -> impl Iterator<Item = &'static [u8]> {
    seeded_programs().map(|(_, program)| program)
}

/// The programs in order, with the seeds of the commands that they get under live control.
pub fn seeded_programs() -> impl Iterator<Item = (u64, &'static [u8])> {
    // Sound: read-only memory of the emulated board from ADDRESS on, which nothing else uses.
    let mut left = unsafe { core::slice::from_raw_parts(ADDRESS as *const u8, LENGTH) };
    let mut programs_left = take_word(&mut left).unwrap_or(0);
    core::iter::from_fn(move || {
        programs_left = programs_left.checked_sub(1)?;
        let seed = take_word(&mut left)?;
        let length = take_word(&mut left)? as usize;
        let (program, rest) = left.split_at_checked(length)?;
        left = rest.get(length.wrapping_neg() % 4..)?;
        Some((u64::from(seed), program))
    })
}

fn take_word(bytes: &mut &[u8]) -> Option<u32> {
    let (word, rest) = bytes.split_first_chunk::<4>()?;
    *bytes = rest;
    Some(u32::from_le_bytes(*word))
}
