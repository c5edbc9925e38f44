//! What compiled programs take: bytes for each straight and each curved block, by kind of item.
//!
//! ```text
//! cargo bench -p motion-tests --bench bytes [-- FILE...]
//! ```
//!
//! The samples on the reference machine, exact and blended; or these programs, named from `tests/` on, as they are
//! written. With the limits that live control plans from. Of a kind of item the number and the bytes; what follows a
//! block counts for it.

use motion_host::compare::{Path, on};
use motion_host::gcode::{self, Program};
use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_program};
use motion_tests::bench;
use motion_tests::bytes::{Bytes, Count, OfBlocks};
use motion_tests::samples::SAMPLES;

const PATHS: [Path; 3] = [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)];

fn main() {
    let Some(files) = bench::asked() else { return };
    println!(
        "| program | path | blocks | | bytes a block | pieces | of long lines | limits | cruises | ramps | others |"
    );
    println!("|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|");
    let mut all = Bytes::default();
    if files.is_empty() {
        for (name, text) in SAMPLES {
            let program = gcode::read(name, text.as_bytes()).map_err(|error| error.to_string());
            for path in PATHS {
                let bytes = program
                    .as_ref()
                    .map_err(Clone::clone)
                    .and_then(|program| measured(name, &on(program, path)));
                row(name, &path.to_string(), bytes, &mut all);
            }
        }
    }
    for file in files {
        let text = std::fs::read(&file).map_err(|error| error.to_string());
        let program = text.and_then(|text| gcode::read(&file, &text).map_err(|error| error.to_string()));
        row(&file, "as written", program.and_then(|program| measured(&file, &program)), &mut all);
    }
    rows("all", "", &all);
}

fn measured(name: &str, program: &Program) -> Result<Bytes, String> {
    let plan = plan_program(name, program, &Machine::reference(), Mode::Spanning);
    plan.and_then(|plan| Bytes::of(&plan, true)).map_err(|error| error.to_string())
}

fn row(name: &str, path: &str, bytes: Result<Bytes, String>, all: &mut Bytes) {
    match bytes {
        Ok(bytes) => {
            all.add(&bytes);
            rows(name, path, &bytes);
        }
        // A row is one line.
        Err(error) => println!("| {name} | {path} | {} | | | |", error.lines().next().unwrap_or_default()),
    }
}

fn rows(name: &str, path: &str, bytes: &Bytes) {
    for (kind, of) in [("straight", &bytes.lines), ("curved", &bytes.curves)] {
        let &OfBlocks { blocks, pieces, more_pieces, limits, cruises, ramps, others } = of;
        let each = of.bytes() as f64 / blocks as f64;
        print!("| {name} | {path} | {kind} | {blocks} | {each:.1} |");
        for Count { items, bytes } in [pieces, more_pieces, limits, cruises, ramps, others] {
            print!(" {items}: {bytes} |");
        }
        println!();
    }
}
