//! The memory map of the emulated board, by the core it is built for.

use std::{env, fs, path::PathBuf};

/// mps2-an385, -an386, -an500: code and data memory of 4 MiB each.
const MPS2: &str = "MEMORY
{
  FLASH : ORIGIN = 0x00000000, LENGTH = 2M
  RAM   : ORIGIN = 0x20000000, LENGTH = 4M
}
";

/// microbit (nRF51822): the last quarter of its flash is for programs.
const MICROBIT: &str = "MEMORY
{
  FLASH : ORIGIN = 0x00000000, LENGTH = 192K
  RAM   : ORIGIN = 0x20000000, LENGTH = 16K
}
";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("set by cargo"));
    let target = env::var("TARGET").expect("set by cargo");
    let map = if target.starts_with("thumbv6m") { MICROBIT } else { MPS2 };
    fs::write(out.join("memory.x"), map).expect("OUT_DIR can be written");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=build.rs");
}
