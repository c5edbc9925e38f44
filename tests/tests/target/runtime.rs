//! What the compiler calls where a core has no instruction: arithmetic of f64 with the same bits as on a PC, and the instructions
//! of it and of copies.

use armv7m_runtime::operands::digests;
use motion_tests::figures::{Table, hold};
use object::{Object, ObjectSymbol};

use crate::budget::{GROWTH, by_name};
use crate::tools::{BOARDS, Board, Clock, LIVE_BOARDS, M7, RISC_V, Tools};

fn printed(tools: &Tools, board: Board) -> Result<String, String> {
    tools.run(board, "runtime", &[], Clock::Counting)
}

pub(crate) fn the_same_sums_and_products(tools: &Tools) -> Result<(), String> {
    let expected: Vec<_> = digests().map(|digest| format!("{digest:016x}")).collect();
    for board in BOARDS {
        let printed = printed(tools, board)?;
        let found: Vec<_> = printed.lines().filter_map(|line| line.strip_prefix("digest ")).collect();
        if found != expected {
            let right = found.iter().zip(&expected).take_while(|(found, expected)| found == expected).count();
            return Err(format!(
                "{}: another result among the ten thousand pairs from {right}0000 on",
                board.core
            ));
        }
    }
    Ok(())
}

/// Results and tests are the same without it.
pub(crate) fn the_runtime_is_linked(tools: &Tools) -> Result<(), String> {
    let mut images = vec![("the firmware", tools.firmware("emulated")?)];
    for board in LIVE_BOARDS {
        images.push((board.core, tools.image(board, "kernel_only")?));
    }
    for (name, path) in images {
        let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
        let is_there =
            object.symbols().any(|symbol| symbol.name().is_ok_and(|name| name.contains("armv7m_runtime")));
        if is_there == (name == RISC_V.core) {
            return Err(format!("{name}: has the routines of armv7m-runtime: {is_there}"));
        }
    }
    Ok(())
}

pub(crate) fn instructions_of_the_runtime(tools: &Tools) -> Result<(), String> {
    let mut table = Table::new(&["core", "instructions of", "min", "median", "max"]);
    for board in BOARDS.into_iter().filter(|&board| board != M7) {
        let figures = by_name(&printed(tools, board)?);
        for (name, what) in [
            ("sum", "a sum of f64"),
            ("difference", "a difference"),
            ("product", "a product"),
            ("quotient", "a quotient"),
            ("comparison", "a comparison"),
            ("copy4", "a copy of 256 bytes, by words"),
            ("copy8", "a copy of 256 bytes, by two words"),
        ] {
            // RISC-V has no copies by words.
            let Some(sorted) = figures.get(name) else { continue };
            let figures = [sorted[0], sorted[sorted.len() / 2], sorted[sorted.len() - 1]];
            let [least, median, most] = figures.map(|figure| figure.to_string());
            table.row(&[board.cores(), what, &least, &median, &most]);
        }
    }
    hold("runtime", &table, GROWTH)
}
