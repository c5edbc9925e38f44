//! The interpreter of G-code under arbitrary text. See `motion_tests::fuzz::gcode`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = motion_tests::fuzz::gcode::read(bytes);
});
