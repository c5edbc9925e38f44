//! The rest of a stretch, from one of its pieces on: for programs that are started in their middle.
//!
//! Consumes the items of a stretch; produces those of a stretch that begins at rest where the piece does. Path and blocks
//! are the same, but for the first block, which is shorter. The feed is planned anew over the blocks.

use motion_kernel::law::{Law, Pulse};
use motion_kernel::num::Real;
use motion_kernel::plan::Block;
use motion_kernel::program::{Item, PathBlock};
use motion_kernel::units::Position;

use super::Mode;
use super::density::SegmentPace;
use super::error::{AtLine, Problem};
use super::lookahead::{block_at, lookahead};
use crate::toolpath::Placed;

/// The items of `stretch`, from the piece at an index on to its end, for kernels of the number type `R`.
///
/// # Errors
/// There is no plan from rest; with the program line.
pub(crate) fn rest_of_stretch<R: Real, const N: usize>(
    stretch: &[Item<N>],
    piece: usize,
    pulse: Pulse,
    tick_s: f64,
) -> AtLine<Vec<Item<N>>> {
    let before = stretch.iter().take(piece).filter_map(piece_length);
    let start = before.fold(Position::ZERO, |start, length| start + length);
    let blocks = blocks_from(stretch, start);
    let placed = stretch.iter().skip(piece);
    let pieces: Vec<Placed<N>> =
        placed.filter_map(|&item| Some(Placed { length: piece_length(&item)?, item })).collect();
    let line_at = |at: Position| line_at(&pieces, at);

    let (mut plan_blocks, mut ends_mm, mut end) = (Vec::new(), Vec::new(), Position::ZERO);
    for block in &blocks {
        let allowed = block.programmed();
        let law = Law::new(pulse, allowed.limits).map_err(|error| (line_at(end), error.into()))?;
        end = end + block.length;
        ends_mm.push(end.to_mm());
        plan_blocks.push(Block {
            length_mm: block.length.to_mm(),
            cap_mm_s: allowed.cap_mm_s,
            junction_mm_s: block.junction_mm_s(),
            law,
        });
    }
    let start_of = |block: usize| {
        let before = blocks.iter().take(block).map(|block| block.length);
        before.fold(Position::ZERO, |start, length| start + length)
    };
    let ramps = lookahead(&plan_blocks, &ends_mm, [0.0; 2], Mode::Spanning, tick_s)
        .map_err(|(block, problem)| (line_at(start_of(block)), problem))?;

    let (mut feed, mut pace, mut at) = (Vec::new(), SegmentPace::default(), Position::ZERO);
    for ramp in ramps {
        let segment = ramp.segment::<R>(tick_s);
        let segment = segment.map_err(|error| (line_at(at), Problem::Segment { error, tick_s }))?;
        pace.next(segment.duration()).map_err(|problem| (line_at(at), problem))?;
        feed.push(Placed { length: ramp.length, item: Item::Feed(ramp) });
        at = at + ramp.length;
    }
    let placed_blocks: Vec<Placed<N>> =
        blocks.iter().map(|&block| Placed { length: block.length, item: Item::Block(block) }).collect();
    let mut items = Vec::with_capacity(stretch.len().saturating_sub(piece));
    in_order_of_start(&placed_blocks, &pieces, &feed, &mut items);
    items.extend(stretch.iter().filter(|item| matches!(item, Item::EndOfStretch(_))));
    Ok(items)
}

/// The blocks of a stretch from a place on; the first one is cut there.
fn blocks_from<const N: usize>(stretch: &[Item<N>], start: Position) -> Vec<PathBlock> {
    let (mut blocks, mut at) = (Vec::new(), Position::ZERO);
    for item in stretch {
        let Item::Block(block) = item else { continue };
        let end = at + block.length;
        if end > start {
            let mut block = *block;
            block.length = end - at.max(start);
            blocks.push(block);
        }
        at = end;
    }
    blocks
}

/// The length of a piece of path; none of another item.
fn piece_length<const N: usize>(item: &Item<N>) -> Option<Position> {
    match item {
        Item::Line { length, .. } | Item::Septic { length, .. } => Some(*length),
        _ => None,
    }
}

/// The program line of the piece at a place of the path.
fn line_at<const N: usize>(pieces: &[Placed<N>], at: Position) -> u32 {
    let mut end = Position::ZERO;
    let ends: Vec<Position> = pieces
        .iter()
        .map(|piece| {
            end = end + piece.length;
            end
        })
        .collect();
    match pieces.get(block_at(&ends, at)).map(|piece| piece.item) {
        Some(Item::Line { line, .. } | Item::Septic { line, .. }) => line,
        _ => 0,
    }
}

/// Blocks and both streams as one, in the order of the path positions where the items start.
fn in_order_of_start<const N: usize>(
    blocks: &[Placed<N>],
    pieces: &[Placed<N>],
    feed: &[Placed<N>],
    items: &mut Vec<Item<N>>,
) {
    let mut ordered: Vec<(Position, Item<N>)> = Vec::with_capacity(blocks.len() + pieces.len() + feed.len());
    for kind in [blocks, pieces, feed] {
        let mut start = Position::ZERO;
        for placed in kind {
            ordered.push((start, placed.item));
            start = start + placed.length;
        }
    }
    // Stable: where all three start, a block comes before its piece, and that before its feed.
    ordered.sort_by_key(|&(start, _)| start);
    items.extend(ordered.into_iter().map(|(_, item)| item));
}
