//! What is in an image: no panic, and how many bytes.

use motion_tests::figures::{Table, hold};
use object::{Object, ObjectSection, ObjectSymbol};

use crate::budget::{GROWTH, by_name};
use crate::programs;
use crate::tools::{BOARDS, Board, Clock, LINKED_BOARDS, LIVE_BOARDS, M4F, M7, Tools};

/// Whatever a panic needs. The handler's own symbol is in every image in which one is reachable.
const PANIC: [&str; 5] = ["panic", "unwrap_failed", "expect_failed", "slice_index", "_fail"];

/// Flash of the kernel, RAM of 3 axes with 64 pieces and 64 segments, and stack of the tick that are promised on
/// the M4F [bytes].
const FLASH_MAX: u64 = 42 << 10;
const STACK_MAX: u64 = 1 << 10;

fn file(tools: &Tools, board: Board, name: &str) -> Result<Vec<u8>, String> {
    let path = tools.image(board, name)?;
    std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))
}

pub(crate) fn nothing_can_panic(tools: &Tools) -> Result<(), String> {
    let panics = |board: Board, name: &str| -> Result<Vec<String>, String> {
        let bytes = file(tools, board, name)?;
        let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
        let names = object.symbols().filter_map(|symbol| symbol.name().ok().map(str::to_owned));
        Ok(names.filter(|name| PANIC.iter().any(|panic| name.contains(panic))).collect())
    };
    let kernels = BOARDS.into_iter().chain(LIVE_BOARDS).map(|board| (board, "kernel_only"));
    // With the link, the board's background, and even the simulated machine.
    for (board, name) in kernels.chain(LINKED_BOARDS.map(|board| (board, "linked"))) {
        let found = panics(board, name)?;
        if !found.is_empty() {
            return Err(format!("the image {name} for {} can panic: {found:?}", board.core));
        }
    }
    // The search itself works: an image with a panic has the handler's symbol.
    for board in BOARDS.into_iter().chain(LIVE_BOARDS) {
        if !panics(board, "budget")?.iter().any(|name| name.contains("panic_is_linked")) {
            return Err("no panic found where there is one".to_owned());
        }
    }
    Ok(())
}

/// Bytes of sections of an image.
fn size(tools: &Tools, board: Board, name: &str, sections: &[&str]) -> Result<u64, String> {
    let bytes = file(tools, board, name)?;
    let object = object::File::parse(&*bytes).map_err(|error| error.to_string())?;
    let of_these =
        object.sections().filter(|section| section.name().is_ok_and(|name| sections.contains(&name)));
    Ok(of_these.map(|section| section.size()).sum())
}

/// Bytes of code, constants, and what memory starts with.
fn flash(tools: &Tools, board: Board, name: &str) -> Result<u64, String> {
    size(tools, board, name, &[".text", ".rodata", ".data"])
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
    // All of the image: kernel, link and queue of items, the board's background, the simulated machine.
    for board in LINKED_BOARDS {
        let flash = flash(tools, board, "linked")? - flash(tools, board, "empty")?;
        let ram = size(tools, board, "linked", &[".data", ".bss", ".uninit"])?;
        let number = format!("{}, a board on the link, its machine simulated", board.number);
        let cells = [flash.to_string(), ram.to_string(), "64, 3 × 16".to_owned(), "–".to_owned()];
        table.row(&[&[board.core.to_owned(), number], &cells[..]].concat());
    }
    tools.accept_compiler()?;
    hold("sizes", &table, GROWTH)
}
