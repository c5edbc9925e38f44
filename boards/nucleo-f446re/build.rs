//! Gives the compiler the program and the linker the board's memory map and its scripts.
//!
//! The program is `common/program/stringer.bin`, or what `MOTION_PROGRAM` names. The map is the repository's
//! `memory.x`, copied to where the linker looks, so that there is one.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;

const PROGRAM: &str = "../common/program/stringer.bin";
const MEMORY: &str = "../../memory.x";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var("OUT_DIR")?);

    println!("cargo:rerun-if-env-changed=MOTION_PROGRAM");
    let program = env::var("MOTION_PROGRAM").unwrap_or_else(|_| PROGRAM.to_owned());
    println!("cargo:rerun-if-changed={program}");
    fs::copy(&program, out.join("program.bin")).map_err(|error| format!("{program}: {error}"))?;

    println!("cargo:rerun-if-changed={MEMORY}");
    // The library's tests run on a PC and are linked as usual.
    if env::var("CARGO_CFG_TARGET_ARCH")? != "arm" {
        return Ok(());
    }
    fs::copy(MEMORY, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // --nmagic: sections are not aligned to pages, which flash does not have.
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    Ok(())
}
