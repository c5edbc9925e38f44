//! The memory map of the emulated board, by the core it is built for.

use std::{env, fs, path::PathBuf};

/// mps2-an385, -an386, -an500: code and data memory of 4 MiB each.
const MPS2: &str = "MEMORY
{
  FLASH : ORIGIN = 0x00000000, LENGTH = 2M
  RAM   : ORIGIN = 0x20000000, LENGTH = 4M
}
";

/// QEMU's `virt` for RISC-V: one memory for all, which begins there; programs lie 4 MiB behind.
const VIRT: &str = "MEMORY
{
  RAM : ORIGIN = 0x80000000, LENGTH = 4M
  STACK : ORIGIN = 0x80800000, LENGTH = 4M
}
REGION_ALIAS(\"REGION_TEXT\", RAM);
REGION_ALIAS(\"REGION_RODATA\", RAM);
REGION_ALIAS(\"REGION_DATA\", RAM);
REGION_ALIAS(\"REGION_BSS\", RAM);
REGION_ALIAS(\"REGION_HEAP\", RAM);
REGION_ALIAS(\"REGION_STACK\", STACK);
";

/// Bytes for the streams and the semihosting's handle of an image that runs on the microbit: 2804 are used. A multiple of
/// 8, because the stack begins below.
const STATICS: u32 = 2832;

/// microbit (nRF51822): the last quarter of its flash is for programs. The stack lies at the bottom of the memory:
/// where it overflows there is nothing to overwrite, and the emulator stops at once.
fn microbit() -> String {
    format!(
        "MEMORY
{{
  FLASH : ORIGIN = 0x00000000, LENGTH = 192K
  STACK : ORIGIN = 0x20000000, LENGTH = 16K - {STATICS}
  RAM   : ORIGIN = 0x20004000 - {STATICS}, LENGTH = {STATICS}
}}
_stack_end = ORIGIN(STACK);
_stack_start = ORIGIN(RAM);
"
    )
}

/// The same for images that have more in memory, and are not run there.
const MICROBIT_LARGE: &str = "MEMORY
{
  FLASH : ORIGIN = 0x00000000, LENGTH = 192K
  RAM   : ORIGIN = 0x20000000, LENGTH = 16K
}
";
const LARGE: [&str; 1] = ["kernel_only"];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("set by cargo"));
    let target = env::var("TARGET").expect("set by cargo");
    let is_small = target.starts_with("thumbv6m");
    let (map, large) = match &*target {
        _ if is_small => (&*microbit(), MICROBIT_LARGE),
        "riscv32imafc-unknown-none-elf" => (VIRT, VIRT),
        _ => (MPS2, MPS2),
    };
    for (folder, map) in [("small", map), ("large", large)] {
        fs::create_dir_all(out.join(folder)).expect("OUT_DIR can be written");
        fs::write(out.join(folder).join("memory.x"), map).expect("OUT_DIR can be written");
    }
    for bin in fs::read_dir("src/bin").expect("the package has images") {
        let bin = bin.expect("a readable folder").path();
        let bin = bin.file_stem().expect("a file").to_str().expect("a name");
        let folder = out.join(if LARGE.contains(&bin) { "large" } else { "small" });
        println!("cargo:rustc-link-arg-bin={bin}=-L{}", folder.display());
    }
    if target.starts_with("riscv") {
        println!("cargo:rustc-link-arg-bins=-Tmemory.x");
    }
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/bin");
}
