//! Gives the linker the board's memory map and its scripts.
//!
//! The map is the repository's `memory.x`, copied to where the linker looks, so that there is one.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;

const MEMORY: &str = "../../memory.x";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={MEMORY}");
    // The library's tests run on a PC and need none of it.
    if env::var("CARGO_CFG_TARGET_ARCH")? != "arm" {
        return Ok(());
    }
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::copy(MEMORY, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // --nmagic: sections are not aligned to pages, which flash does not have.
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    Ok(())
}
