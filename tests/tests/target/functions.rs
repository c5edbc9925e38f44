//! Instructions of the law's shapes and of a sine, by backend.

use motion_tests::figures::{Table, hold};

use crate::budget::{GROWTH, by_name};
use crate::tools::{BOARDS, Clock, M3_SOFT, M7, Tools};

pub(crate) fn instructions_of_functions(tools: &Tools) -> Result<(), String> {
    let mut table = Table::new(&["core", "number", "instructions of", "median", "max"]);
    for board in BOARDS.into_iter().filter(|&board| board != M7).chain([M3_SOFT]) {
        let figures = by_name(&tools.run(board, "functions", &[], Clock::Counting)?);
        for (name, sorted) in figures {
            let (median, most) = (sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
            let cells = [board.core, board.number, &name, &median.to_string(), &most.to_string()];
            table.row(&cells);
        }
    }
    hold("function_instructions", &table, GROWTH)
}
