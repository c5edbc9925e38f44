//! Kernel and machine under arbitrary items, commands, feedback and arrival times. See `motion_tests::fuzz`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    motion_tests::fuzz::drive(bytes);
});
