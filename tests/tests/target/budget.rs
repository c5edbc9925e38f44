//! Instructions of a tick, whole and by stage.

use std::collections::BTreeMap;

use motion_tests::figures::{Table, hold};

use crate::programs;
use crate::search::{KINDS, TURN, of_the_worst};
use crate::tools::{Board, COMPENSATED, LIVE_BOARDS, M0, M3, M3_SOFT, M4F, M7, RISC_V, Tools};

/// Growth that fails.
pub(crate) const GROWTH: f64 = 0.02;

/// Bounds of a tick that no accepted program exceeds.
const UTMOST: [(Board, u32); 2] = [(M4F, 3300), (M3, 5200)];

/// What the densest program takes at most on an M4F, which is more than the promise for all others: no planner here
/// makes 15 pieces in every tick.
const DENSEST: u32 = 1720;
/// Instructions of a tick of 3 axes with live control and guards, in the committed cases of two seeds. The search finds more.
const LIVE: u32 = 1560;
/// The same with every drive inverted.
const INVERTED: u32 = 1800;
/// `LIVE` with every screw compensated: what was found and 5 %.
const COMPENSATION: u32 = 2860;
/// Those of the densest program with every drive inverted.
const DENSEST_INVERTED: u32 = 1980;

/// Figures that an image printed, by name, sorted.
pub(crate) fn by_name(printed: &str) -> BTreeMap<String, Vec<u32>> {
    let mut figures = BTreeMap::<String, Vec<u32>>::new();
    for line in printed.lines() {
        if let Some((name, figure)) = line.rsplit_once(' ')
            && let Ok(figure) = figure.parse()
        {
            figures.entry(name.to_owned()).or_default().push(figure);
        }
    }
    figures.values_mut().for_each(|figures| figures.sort_unstable());
    figures
}

/// Least, median, 99th percentile, greatest.
pub(crate) fn distribution<T: Copy>(sorted: &[T]) -> [T; 4] {
    let last = sorted.len() - 1;
    [sorted[0], sorted[last / 2], sorted[last * 99 / 100], sorted[last]]
}

fn row(table: &mut Table, board: Board, what: &str, sorted: &[u32]) -> [u32; 4] {
    let figures = distribution(sorted);
    let mut cells = vec![board.cores().to_owned(), board.number.to_owned(), what.to_owned()];
    cells.extend(figures.map(|figure| figure.to_string()));
    table.row(&cells);
    figures
}

pub(crate) fn instructions_of_a_tick(tools: &Tools) -> Result<(), String> {
    let mut table = Table::new(&["core", "number", "instructions of a tick", "min", "median", "p99", "max"]);
    let mut stages = Table::new(&["core", "number", "instructions of", "min", "median", "p99", "max"]);
    let mut ticks = Vec::new();
    for board in [M4F, M3, M0, M3_SOFT, RISC_V] {
        let printed = tools.count(board, "budget", &programs::worst_ticks())?;
        let figures = by_name(&printed);
        let of = |name: &str| figures.get(name).ok_or_else(|| format!("{}: no {name}", board.core));
        let mut ordinary = row(&mut table, board, "3 axes", of("tick")?);
        for (stage, name) in [("law", "law"), ("path, 3 axes", "path"), ("regulator, 1 axis", "regulator")] {
            row(&mut stages, board, stage, of(name)?);
        }
        if board.core == M0.core {
            continue;
        }
        let alone = |bytes: Vec<u8>| tools.count(board, "budget", &[bytes]);
        let one = by_name(&alone(programs::one_axis())?);
        let one = row(&mut table, board, "1 axis", &one["tick"]);
        if board == M4F && one[3] > 710 {
            return Err(format!("one axis on {}: at most {}, promised 710", board.core, one[3]));
        }
        let densest = by_name(&alone(programs::densest())?);
        let densest = row(&mut table, board, "3 axes, 15 pieces in every tick", &densest["tick"]);
        if board == M4F && densest[3] > DENSEST {
            return Err(format!("{}: {} instructions, promised {DENSEST}", board.core, densest[3]));
        }
        let inverted = by_name(&tools.count(board, "budget", &programs::inverted())?);
        let inverted = row(&mut table, board, "3 axes, drives inverted", &inverted["tick"]);
        let tables = by_name(&alone(programs::with_tables())?);
        row(&mut table, board, "3 axes, drives inverted, tables, a command delayed", &tables["tick"]);
        let both = by_name(&alone(programs::densest_inverted())?);
        let both = row(&mut table, board, "3 axes, drives inverted, 15 pieces in every tick", &both["tick"]);
        if board == M4F && both[3] > DENSEST_INVERTED {
            return Err(format!("{}: {} instructions, promised {DENSEST_INVERTED}", board.core, both[3]));
        }
        // Of what is ordinary, the promise is for the worst.
        ordinary[3] = ordinary[3].max(inverted[3]);
        ticks.push((board, ordinary));
        let what = "8 segments and 15 pieces in every tick";
        let utmost = by_name(&alone(programs::utmost::<1>())?);
        row(&mut table, board, &format!("1 axis, {what}"), &utmost["tick"]);
        let utmost = by_name(&alone(programs::utmost::<3>())?);
        let most = row(&mut table, board, &format!("3 axes, {what}"), &utmost["tick"])[3];
        let bound = UTMOST.iter().find(|(of, _)| *of == board).map_or(u32::MAX, |(_, bound)| *bound);
        if most > bound {
            return Err(format!(
                "{}: {most} instructions of what may be accepted at most, promised {bound}",
                board.core
            ));
        }
    }
    for board in LIVE_BOARDS.into_iter().filter(|board| board.core != M7.core) {
        let [reference, inverted] = programs::worst_live_ticks().map(|programs| {
            let printed = tools.count(board, "live_budget", &programs);
            printed.map(|printed| by_name(&printed))
        });
        let (reference, inverted) = (reference?, inverted?);
        let most = row(&mut table, board, "3 axes, live control and guards", &reference["tick"])[3];
        let inverted =
            row(&mut table, board, "3 axes, live control and guards, drives inverted", &inverted["tick"])[3];
        row(&mut stages, board, "a poll of live control", &reference["poll"]);
        let [programs, _] = programs::worst_live_ticks();
        let answers = by_name(&tools.count(board, "answers", &programs)?);
        for (what, name) in [
            ("the first step of a poll that takes a hold", "hold"),
            ("the poll that takes an override", "override"),
            ("the poll that takes a resume", "resume"),
            ("the poll that begins or ends single block", "single_block"),
            ("the longest step of a poll between two looks for a stop", "step"),
            ("the rest of a poll that is told of a stop", "given_up"),
        ] {
            row(&mut stages, board, what, &answers[name]);
        }
        if board.core == M4F.core && (most > LIVE || inverted > INVERTED) {
            return Err(format!(
                "{}: {most} and {inverted} under live control, promised {LIVE} and {INVERTED}",
                board.core
            ));
        }
    }
    let compensated = by_name(&tools.count(COMPENSATED, "live_budget", &programs::compensated())?);
    let what = "3 axes, live control and guards, screws compensated";
    let most = row(&mut table, COMPENSATED, what, &compensated["tick"])[3];
    if most > COMPENSATION {
        return Err(format!("{what}: {most} instructions, promised {COMPENSATION}"));
    }
    for board in [M4F, M3, RISC_V] {
        for kind in KINDS {
            let worst = of_the_worst(tools, board, kind)?;
            let most =
                row(&mut table, board, &format!("3 axes, the worst found: {}", kind.name), &worst.ticks)[3];
            if board == M4F && most > kind.most {
                return Err(format!("{}: {most} instructions, promised {}", kind.name, kind.most));
            }
            if kind.is_live {
                let what = format!("a poll stopped by ticks, the worst found: {}", kind.name);
                let most = row(&mut stages, board, &what, &worst.polls)[3];
                if board == M4F && most > TURN {
                    return Err(format!("{what}: {most} instructions, promised {TURN}"));
                }
            }
        }
    }
    tools.accept_compiler()?;
    println!("{}", table.to_markdown());
    promised(&ticks)?;
    hold("budgets", &table, GROWTH)?;
    hold("stages", &stages, GROWTH)
}

/// What docs/PROMISES.md promises, whatever is committed.
fn promised(ticks: &[(Board, [u32; 4])]) -> Result<(), String> {
    let of = |board: Board| {
        ticks.iter().find(|(found, _)| *found == board).map_or([u32::MAX; 4], |(_, figures)| *figures)
    };
    let ([_, median, _, most], [.., fixed], [.., soft]) = (of(M4F), of(M3), of(M3_SOFT));
    if median > 820 || most > 1500 {
        return Err(format!("M4F: median {median}, at most {most}; promised 820 and 1500"));
    }
    if fixed > 4000 || 3 * fixed > soft {
        return Err(format!("M3: at most {fixed} in fixed point, {soft} in f32; promised 4000 and a third"));
    }
    Ok(())
}
