//! The planner's one entry: the faster of two plans, over exact positions, from rest or from a feed.

use motion_kernel::law::{PlannedRamp, reach};
use motion_kernel::plan::{
    Block, BlockPlan, Effort, Memory, Node, Path, PlanError, Planned, nodes_for, plan_ramps,
};
use motion_kernel::units::Position;

use super::spanning::{Span, legal, spans_between, unreachable};
use super::{block, from_rest, laws, planned, random_blocks, time_s};
use motion_tests::random::Random;

/// The ramps of a plan, of which there is room for so many.
fn ramps(
    blocks: &[Block<f64>],
    feeds_mm_s: [f64; 2],
    effort: Effort,
    room: usize,
) -> Result<(Planned, Vec<PlannedRamp>), PlanError> {
    let mut end_mm = 0.0;
    let mut ends: Vec<Position> = Vec::new();
    for block in blocks {
        end_mm += block.length_mm;
        ends.push(Position::from_mm(end_mm).expect("in range"));
    }
    let (blocks, ends) = (&mut blocks.to_vec(), &mut ends);
    let (plans, nodes) =
        (&mut vec![BlockPlan::default(); blocks.len()], &mut vec![Node::EMPTY; nodes_for(blocks.len())]);
    let mut ramps: Vec<PlannedRamp> = Vec::new();
    let path = Path { blocks, ends, start: Position::ZERO, feeds_mm_s, tick_s: 5e-4 };
    let planned = plan_ramps(path, effort, Memory { plans, nodes }, &mut |index, ramp| {
        ramps.truncate(index);
        if ramps.len() < room {
            ramps.push(ramp);
        }
        ramps.len() == index + 1
    })?;
    Ok((planned, ramps))
}

fn whole(blocks: &[Block<f64>], feeds_mm_s: [f64; 2], effort: Effort) -> Result<Planned, PlanError> {
    let (planned, ramps) = ramps(blocks, feeds_mm_s, effort, usize::MAX)?;
    assert!(planned.is_whole);
    let [start, end] = feeds_mm_s;
    let spans = placed(&ramps);
    if let Err(error) = legal(blocks, start, end, &spans) {
        panic!("{effort:?} from {start} to {end}: {error}\n{blocks:?}");
    }
    let sum: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
    assert!((sum - planned.time_s).abs() <= 1e-9 * sum);
    Ok(planned)
}

/// Random blocks whose ends are positions to the bit, as those of a caller are.
fn exact_blocks(random: &mut Random, count: usize, least_mm: f64) -> Vec<Block<f64>> {
    let mut blocks = random_blocks(random, count, least_mm);
    for block in &mut blocks {
        block.length_mm = Position::from_mm(block.length_mm).expect("in range").to_mm();
    }
    blocks
}

fn placed(ramps: &[PlannedRamp]) -> Vec<Span> {
    let mut at = Position::ZERO;
    let place = |&PlannedRamp { ramp, length }: &PlannedRamp| {
        let start_mm = at.to_mm();
        at = at + length;
        Span { start_mm, length_mm: length.to_mm(), ramp }
    };
    ramps.iter().map(place).collect()
}

/// Plans are legal with every effort. Ramps that span blocks are never slower than merged ones, which may be 1 % slower than one pair a block.
#[test]
fn more_effort_is_faster() {
    let mut random = Random::of_stream(39);
    let (mut made, mut refused, mut faster, mut fallback) = (0, 0, 0, 0);
    for _ in 0..4000 {
        let blocks = exact_blocks(&mut random, 40, 1e-2);
        let feed = blocks[0].cap_mm_s * random.log(0.01, 1.0);
        let feeds = [if random.once_in(2) { feed } else { 0.0 }, 0.0];
        let Ok(per_block) = whole(&blocks, feeds, Effort::PerBlock) else {
            let stops = planned(&blocks, feeds[0], 0.0);
            assert!(matches!(stops, Err(PlanError::TooShortToBrake { .. })), "{stops:?}\n{blocks:?}");
            refused += 1;
            continue;
        };
        let merged = whole(&blocks, feeds, Effort::Merged).expect("a plan");
        let spanning = whole(&blocks, feeds, Effort::Spanning).expect("a plan");
        assert!(spanning.time_s <= merged.time_s, "{spanning:?} {merged:?}\n{blocks:?}");
        assert!(merged.time_s <= per_block.time_s * 1.01, "{merged:?} {per_block:?}\n{blocks:?}");
        made += 1;
        faster += u32::from(spanning.time_s < merged.time_s);
        fallback += u32::from(spans_between(&blocks, feeds[0], 0.0).expect("in range").is_none());
    }
    println!(
        "{made} planned, {faster} faster with spans, {fallback} without any; {refused} too short to stop"
    );
    assert!(made > 2000 && refused > 100 && faster > 1000 && fallback > 0);
}

/// With one law for all blocks and ceilings that don't matter, the greatest feed at an end is what one ramp over all blocks
/// reaches, however many there are.
#[test]
fn a_feed_at_an_end_is_refused_only_where_no_ramp_reaches_it() {
    let mut random = Random::of_stream(43);
    let (mut reached, mut only_by_spans, mut refused) = (0, 0, 0);
    for _ in 0..4000 {
        let law = *random.pick(&laws());
        let mut blocks = exact_blocks(&mut random, 12, 1e-2);
        let length_mm: f64 = blocks.iter().map(|block| block.length_mm).sum();
        let greatest_mm_s = reach(&law, 0.0, length_mm);
        for block in &mut blocks {
            let cap_mm_s = greatest_mm_s * random.between(1.0, 2.0);
            *block = Block { cap_mm_s, junction_mm_s: f64::INFINITY, law, ..*block };
        }
        let share = random.between(0.5, 1.5);
        if (share - 1.0).abs() < 1e-6 || !(0.01..900.0).contains(&greatest_mm_s) {
            continue;
        }
        let feed_mm_s = greatest_mm_s * share;
        for (feeds, cap_mm_s) in
            [([feed_mm_s, 0.0], blocks[0].cap_mm_s), ([0.0, feed_mm_s], blocks[blocks.len() - 1].cap_mm_s)]
        {
            if feed_mm_s > cap_mm_s {
                continue;
            }
            match whole(&blocks, feeds, Effort::Spanning) {
                Ok(_) => {
                    assert!(share < 1.0, "{feeds:?} {share}\n{blocks:?}");
                    reached += 1;
                    only_by_spans += u32::from(whole(&blocks, feeds, Effort::PerBlock).is_err());
                }
                Err(PlanError::TooShortToBrake { .. } | PlanError::TooShortToAccelerate { .. }) => {
                    assert!(share > 1.0, "{feeds:?} {share}\n{blocks:?}");
                    refused += 1;
                }
                Err(error) => panic!("{error}\n{blocks:?}"),
            }
        }
    }
    println!(
        "{reached} reached, {only_by_spans} of them only by ramps over several blocks; {refused} refused"
    );
    assert!(reached > 1000 && only_by_spans > 500 && refused > 500);
}

/// Where there are more blocks than may be spanned, what is put is the begin of a motion that can be finished from there.
#[test]
fn a_part_is_spanned() {
    let mut random = Random::of_stream(40);
    let mut parts = 0;
    for _ in 0..1000 {
        let blocks = exact_blocks(&mut random, 60, 1e-2);
        let most = 1 + random.below(20);
        let (planned, found) =
            ramps(&blocks, [0.0; 2], Effort::SpanningFirst { most }, usize::MAX).expect("a plan");
        let spans = placed(&found);
        if planned.is_whole {
            assert_eq!(legal(&blocks, 0.0, 0.0, &spans), Ok(()));
            continue;
        }
        parts += 1;
        let exit_mm_s = from_rest(&blocks)[most - 1].exit_mm_s;
        assert_eq!(legal(&blocks[..most], 0.0, exit_mm_s, &spans), Ok(()));
    }
    println!("{parts} parts");
    assert!(parts > 200);
}

/// Where there is little room, what is put is the begin of the whole.
#[test]
fn little_room_for_ramps() {
    let mut random = Random::of_stream(42);
    let mut cut = 0;
    for _ in 0..1000 {
        let blocks = exact_blocks(&mut random, 40, 1e-2);
        let room = random.below(30);
        for effort in [Effort::PerBlock, Effort::Spanning, Effort::SpanningFirst { most: usize::MAX }] {
            let (_, all) = ramps(&blocks, [0.0; 2], effort, usize::MAX).expect("a plan");
            let (planned, found) = ramps(&blocks, [0.0; 2], effort, room).expect("a plan");
            assert_eq!(planned.is_whole, all.len() <= room);
            assert_eq!(found, all[..all.len().min(room)]);
            cut += usize::from(!planned.is_whole);
        }
    }
    assert!(cut > 500, "{cut}");
}

/// A bad block is named by its place among those that were given, whatever is merged.
#[test]
fn a_bad_block_is_counted_as_given() {
    let mut random = Random::of_stream(43);
    for _ in 0..200 {
        let bad = random.below(50);
        let mut blocks: Vec<_> = (0..50).map(|_| block(1.0, 10.0 + random.below(2) as f64)).collect();
        blocks[bad].cap_mm_s = -1.0;
        let first = [10, 50].map(|most| Effort::SpanningFirst { most });
        for effort in [Effort::PerBlock, Effort::Merged, Effort::Spanning].into_iter().chain(first) {
            match ramps(&blocks, [0.0; 2], effort, usize::MAX) {
                Err(PlanError::Block { block, value, .. }) => assert_eq!((block, value), (bad, -1.0)),
                other => panic!("{other:?}"),
            }
        }
    }
}

/// Blocks that may be planned once more, as live control does after a refusal, are not merged.
#[test]
fn spanning_first_leaves_the_blocks() {
    let equal = [block(1.0, 10.0); 6];
    for (feeds_mm_s, is_refused) in [([0.0; 2], false), ([10.0, 0.0], true)] {
        let (mut blocks, mut plans) = (equal, [BlockPlan::default(); 6]);
        if is_refused {
            blocks.iter_mut().for_each(|block| block.length_mm = 1e-3);
        }
        let mut end_mm = 0.0;
        let mut ends = blocks.map(|block| {
            end_mm += block.length_mm;
            Position::from_mm(end_mm).expect("in range")
        });
        let before = (blocks, ends);
        let mut nodes = [Node::EMPTY; nodes_for(6)];
        let path =
            Path { blocks: &mut blocks, ends: &mut ends, start: Position::ZERO, feeds_mm_s, tick_s: 5e-4 };
        let memory = Memory { plans: &mut plans, nodes: &mut nodes };
        let planned = plan_ramps(path, Effort::SpanningFirst { most: 16 }, memory, &mut |_, _| true);
        assert_eq!(planned.is_err(), is_refused, "{planned:?}");
        assert_eq!((blocks, ends), before);
    }
}

/// Where giving up minima would take too long there are no ramps that span blocks, and still a plan.
#[test]
fn one_pair_of_ramps_a_block_is_the_last_resort() {
    let blocks = unreachable(1.0, -0.5, 1.0);
    assert_eq!(spans_between(&blocks, 0.0, 0.0), Ok(None));
    let planned = whole(&blocks, [0.0; 2], Effort::Spanning).expect("a plan");
    let per_block = time_s(&blocks, &from_rest(&blocks));
    assert!(planned.time_s <= per_block * (1.0 + 1e-6), "{planned:?} {per_block}");
}
