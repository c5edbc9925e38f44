//! Gives the compiler the program and the linker the board's memory map and its scripts.
//!
//! The program is `common/program/stringer.bin`, or what `MOTION_PROGRAM` names. The map is the repository's
//! `memory.x`, copied to where the linker looks, so that there is one; with the link, it leaves sectors for parameters. The linker
//! also refuses an image with more initial values than a few bytes.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;

const PROGRAM: &str = "../common/program/stringer.bin";
const MEMORY: &str = "../../memory.x";
/// Where the code of a board on the link begins, behind its parameters: the end of `PARAMETER_SECTORS` of `design_parameters.rs`
/// \[bytes from the begin of flash\].
const CODE_BEGIN: u32 = 0xC000;
/// Bytes of initial values that may be copied from flash at the start: the log's own. Whatever is big is initialised
/// by code, or is all zeros.
const DATA_MAX: u32 = 64;

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
    let mut memory = fs::read_to_string(MEMORY)?;
    if env::var_os("CARGO_FEATURE_LINK").is_some() {
        // The vectors are before the parameters, in sector 0; all else is behind them.
        memory += &format!("_stext = ORIGIN(FLASH) + {CODE_BEGIN:#x};\n");
    }
    fs::write(out.join("memory.x"), memory)?;
    // The emulated board's model is no part of the firmware.
    let max = if env::var_os("CARGO_FEATURE_EMULATED").is_some() { DATA_MAX + 4096 } else { DATA_MAX };
    let check = format!("ASSERT(SIZEOF(.data) <= {max}, \"a static's initial value is not all zeros\");\n");
    fs::write(out.join("data.x"), check)?;
    println!("cargo:rustc-env=MOTION_CODE_BEGIN={CODE_BEGIN}");
    println!("cargo:rustc-link-search={}", out.display());
    // --nmagic: sections are not aligned to pages, which flash does not have.
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x", "-Tdata.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    Ok(())
}
