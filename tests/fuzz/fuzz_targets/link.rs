//! The two ends of the link under arbitrary scripts and frames. See `motion_tests::fuzz::link`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    motion_tests::fuzz::link::drive(bytes);
});
