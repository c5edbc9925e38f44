//! Tells which processors have the instructions.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(armv7m)");
    // Cortex-M3, M4 and M7; what of an M23 or of a PC's Arm is like them does not tell.
    let target = std::env::var("TARGET").expect("set by cargo");
    if target.starts_with("thumbv7m-none") || target.starts_with("thumbv7em-none") {
        println!("cargo::rustc-cfg=armv7m");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
