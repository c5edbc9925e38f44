//! What is in an image: no panic, and how many bytes.

use motion_tests::figures::{Table, hold};
use object::{Object, ObjectSection, ObjectSymbol};

use crate::budget::{GROWTH, by_name};
use crate::programs;
use crate::tools::{BOARDS, Board, Clock, LIVE_BOARDS, M4F, M7, Tools};

/// Whatever a panic needs. The handler's own symbol is in every image in which one is reachable.
const PANIC: [&str; 5] = ["panic", "unwrap_failed", "expect_failed", "slice_index", "_fail"];

/// Flash of the kernel, RAM of 3 axes with 64 pieces and 64 segments, and stack of the tick that are promised on
/// the M4F [bytes].
const FLASH_MAX: u64 = 36 << 10;
const STACK_MAX: u64 = 1 << 10;

fn file(tools: &Tools, board: Board, name: &str) -> Result<Vec<u8>, String> {
    let path = tools.image(board, name)?;
    std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))
}

pub(crate) fn nothing_can_panic(tools: &Tools) -> Result<(), String> {
    for board in BOARDS.into_iter().chain(LIVE_BOARDS) {
        let symbols = |name: &str| -> Result<Vec<String>, String> {
            let bytes = file(tools, board, name)?;
            let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
            let names = object.symbols().filter_map(|symbol| symbol.name().ok().map(str::to_owned));
            Ok(names.filter(|name| PANIC.iter().any(|panic| name.contains(panic))).collect())
        };
        let found = symbols("kernel_only")?;
        if !found.is_empty() {
            return Err(format!("the kernel's image for {} can panic: {found:?}", board.core));
        }
        // The search itself works: an image with a panic has the handler's symbol.
        if !symbols("budget")?.iter().any(|name| name.contains("panic_is_linked")) {
            return Err("no panic found where there is one".to_owned());
        }
    }
    Ok(())
}

/// Bytes of code, constants, and what memory starts with.
fn flash(tools: &Tools, board: Board, name: &str) -> Result<u64, String> {
    let bytes = file(tools, board, name)?;
    let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
    let sections =
        object.sections().filter(|section| matches!(section.name(), Ok(".text" | ".rodata" | ".data")));
    Ok(sections.map(|section| section.size()).sum())
}

pub(crate) fn sizes(tools: &Tools) -> Result<(), String> {
    let mut table = Table::new(&[
        "core",
        "number",
        "flash of the kernel [bytes]",
        "RAM of kernel and streams [bytes]",
        "pieces and segments",
        "stack of a tick [bytes]",
    ]);
    // An M7 runs the M4F's images.
    for board in BOARDS.into_iter().filter(|board| board.core != M7.core) {
        let flash = flash(tools, board, "kernel_only")? - flash(tools, board, "empty")?;
        let figures = by_name(&tools.run(board, "budget", &programs::worst_ticks(), Clock::Counting)?);
        let greatest = |name: &str| figures.get(name).and_then(|sorted| sorted.last().copied()).unwrap_or(0);
        let (ram, stack) = (greatest("ram"), greatest("stack"));
        let capacity = format!("{}, {}", greatest("pieces"), greatest("segments"));
        let cells = [flash.to_string(), ram.to_string(), capacity, stack.to_string()];
        table.row(&[&[board.cores().to_owned(), board.number.to_owned()], &cells[..]].concat());
        if board == M4F && (flash > FLASH_MAX || u64::from(stack) > STACK_MAX || stack == 0) {
            return Err(format!(
                "{flash} bytes of flash, {stack} of stack; promised {FLASH_MAX}, {STACK_MAX}"
            ));
        }
    }
    for board in LIVE_BOARDS.into_iter().filter(|board| board.core != M7.core) {
        let flash = flash(tools, board, "kernel_only")? - flash(tools, board, "empty")?;
        let [reference, _] = programs::worst_live_ticks();
        let figures = by_name(&tools.run(board, "live_budget", &reference, Clock::Counting)?);
        let greatest = |name: &str| figures.get(name).and_then(|sorted| sorted.last().copied()).unwrap_or(0);
        let number = format!("{}, live control and guards", board.number);
        let cells = [flash.to_string(), greatest("ram").to_string(), "64, 3 × 16".to_owned()];
        let stack = greatest("stack").to_string();
        table.row(&[&[board.cores().to_owned(), number], &cells[..], &[stack]].concat());
    }
    tools.accept_compiler()?;
    hold("sizes", &table, GROWTH)
}
