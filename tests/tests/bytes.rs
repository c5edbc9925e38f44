//! What compiled programs take, with the limits that live control plans from.

use motion_host::compare::{Path, on};
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_program};
use motion_tests::bytes::Bytes;
use motion_tests::figures::{Table, hold};
use motion_tests::samples::SAMPLES;

const PATHS: [Path; 3] = [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)];
/// Bytes that a straight block may take in the mean of all samples, and a piece of a curve with all that starts on it.
const STRAIGHT_MAX: f64 = 48.0;
const CURVED_MAX: f64 = 120.0;
/// Bytes that every further piece of a line may take that is longer than one.
const MORE_MAX: f64 = 2.2;

/// Piece, ramps, limits and what follows: everything is counted.
#[test]
fn blocks_take_few_bytes() {
    let columns = [
        "path",
        "straight blocks",
        "bytes each",
        "curved blocks",
        "bytes each",
        "pieces of them",
        "bytes each",
    ];
    let mut table = Table::new(&columns);
    let mut all = Bytes::default();
    for path in PATHS {
        let mut of_path = Bytes::default();
        for (name, text) in SAMPLES {
            let program = gcode::read(name, text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
            let plan = plan_program(name, &on(&program, path), &Machine::reference(), Mode::Spanning)
                .unwrap_or_else(|error| panic!("{error}"));
            of_path.add(&Bytes::of(&plan, true).unwrap_or_else(|error| panic!("{error}")));
        }
        row(&mut table, &path.to_string(), &of_path);
        all.add(&of_path);
    }
    row(&mut table, "all", &all);
    let (straight, curved) = (straight_each(&all), curved_each(&all, all.curves.pieces.items));
    assert!(straight <= STRAIGHT_MAX, "{straight} bytes a straight block");
    assert!(curved <= CURVED_MAX, "{curved} bytes a piece of a curve");
    let more = all.lines.more_pieces;
    assert!(more.items > 1000 && more.bytes as f64 <= MORE_MAX * more.items as f64, "{more:?}");
    hold("bytes", &table, 0.01).unwrap_or_else(|error| panic!("{error}"));
}

/// Without further pieces of long lines.
fn straight_each(bytes: &Bytes) -> f64 {
    (bytes.lines.bytes() - bytes.lines.more_pieces.bytes) as f64 / bytes.lines.blocks as f64
}

fn curved_each(bytes: &Bytes, count: usize) -> f64 {
    bytes.curves.bytes() as f64 / count as f64
}

fn row(table: &mut Table, path: &str, bytes: &Bytes) {
    table.row(&[
        path.to_owned(),
        bytes.lines.blocks.to_string(),
        format!("{:.1}", straight_each(bytes)),
        bytes.curves.blocks.to_string(),
        format!("{:.1}", curved_each(bytes, bytes.curves.blocks)),
        bytes.curves.pieces.items.to_string(),
        format!("{:.1}", curved_each(bytes, bytes.curves.pieces.items)),
    ]);
}
