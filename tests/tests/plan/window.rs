//! Planning in a window: legal whatever it holds, hardly slower than the whole, from rest or from a feed.

use motion_kernel::law::Ramp;
use motion_kernel::plan::{Block, BlockPlan, FeedSpan, Node, PlanError, Window, WindowError, nodes_for};

use crate::spanning::{legal, spans as whole, spans_between, unreachable};
use crate::{block, from_rest, planned, random_blocks, reference, time_s};
use motion_tests::random::Random;

/// The spans of a plan with a window of `room` blocks.
fn windowed(blocks: &[Block<f64>], room: usize) -> Result<Vec<FeedSpan>, WindowError> {
    windowed_from(blocks, 0.0, room, 4 * room)
}

/// The same, starting at a feed, with so many places for spans. What is committed is one motion at any time.
fn windowed_from(
    blocks: &[Block<f64>],
    feed_mm_s: f64,
    room: usize,
    places_for_spans: usize,
) -> Result<Vec<FeedSpan>, WindowError> {
    let mut memory = vec![block(0.0, 1.0); room];
    let mut places = vec![Node::EMPTY; nodes_for(room)];
    let nothing = FeedSpan { start_mm: 0.0, length_mm: 0.0, ramp: Ramp::cruise(1.0, 0.0) };
    let mut room_for_spans = vec![nothing; places_for_spans];
    let mut plans = vec![BlockPlan::default(); room];
    let mut window =
        Window::new(&mut memory, &mut places, &mut plans, &mut room_for_spans).starting_at(feed_mm_s);
    let mut spans: Vec<FeedSpan> = Vec::new();
    let mut put = |span: FeedSpan| {
        let feed = spans.last().map_or(feed_mm_s, |last| last.ramp.to_mm_s);
        assert_eq!(span.ramp.from_mm_s, feed, "after {:?}", spans.last());
        spans.push(span);
    };
    for &block in blocks {
        window.push(block, &mut put)?;
    }
    window.finish(&mut put)?;
    Ok(spans)
}

/// A window of twice the stopping length, however the ceilings run: legal, and hardly slower than the whole.
#[test]
fn a_window_loses_little_to_the_whole() {
    let mut random = Random::of_stream(34);
    let mut worst = 0.0_f64;
    for case in 0..200 {
        let mut walk = 50.0;
        let (count, length_mm) = (200 + random.below(400), random.log(0.3, 3.0));
        let blocks: Vec<_> = (0..count)
            .map(|n| match case % 4 {
                0 => block(length_mm, 80.0),
                1 => block(length_mm, 20.0 + 60.0 * random.log(0.01, 1.0)),
                2 => block(length_mm, 5.0 + 8.0 * (n % 10) as f64),
                _ => {
                    walk = f64::clamp(walk * random.log(0.8, 1.25), 5.0, 90.0);
                    block(length_mm, walk)
                }
            })
            .collect();
        let fastest = blocks.iter().map(|block| block.cap_mm_s).fold(0.0, f64::max);
        let stop_mm = reference().ramp_length_mm(0.0, fastest);
        let room = 2 + (2.0 * stop_mm / length_mm).ceil() as usize;
        let spans = windowed(&blocks, room).expect("a plan");
        if let Err(error) = legal(&blocks, 0.0, 0.0, &spans) {
            panic!("case {case}: {error}");
        }
        let time_s: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
        let (whole_s, _) = whole(&blocks);
        worst = worst.max(time_s / whole_s);
    }
    println!("at most {worst:.4} of the whole plan's time");
    assert!(worst <= 1.005, "{worst}");
}

/// A program of any length in the same memory.
#[test]
fn a_long_program_passes_a_small_window() {
    let mut random = Random::of_stream(35);
    let blocks: Vec<_> = (0..100_000).map(|_| block(0.1, 20.0 + 60.0 * random.log(0.01, 1.0))).collect();
    let spans = windowed(&blocks, 400).expect("a plan");
    let time_s: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
    let (whole_s, _) = whole(&blocks);
    println!("{time_s:.3} s, whole {whole_s:.3} s");
    assert!(time_s < 1.03 * whole_s);
    let end = spans.last().map_or(0.0, |span| span.start_mm + span.length_mm);
    assert!((end - 10_000.0).abs() < 1e-5, "{end}");
}

/// Every block with limits of its own, junctions that slow and stop, in windows of any length.
#[test]
fn windows_of_random_lists_are_legal() {
    let mut random = Random::of_stream(36);
    for _ in 0..500 {
        let blocks = random_blocks(&mut random, 120, 1e-3);
        let room = 1 + random.below(40);
        match windowed(&blocks, room) {
            Ok(spans) => {
                if let Err(error) = legal(&blocks, 0.0, 0.0, &spans) {
                    panic!("window of {room}: {error}\n{blocks:?}");
                }
            }
            Err(error) => panic!("window of {room}: {error}\n{blocks:?}"),
        }
    }
}

/// However short the window, every block is driven, legally.
#[test]
fn a_short_window_is_slow_but_legal() {
    let blocks: Vec<_> = (0..400).map(|n| block(0.1, 40.0 + (n % 7) as f64)).collect();
    for room in [1, 2, 20] {
        let spans = windowed(&blocks, room).expect("a plan");
        if let Err(error) = legal(&blocks, 0.0, 0.0, &spans) {
            panic!("{room}: {error}");
        }
    }
}

/// From a feed, as live control goes on from one: planned if one pair of ramps a block is, and legal.
#[test]
fn a_window_starts_at_a_feed() {
    let mut random = Random::of_stream(39);
    let (mut made, mut refused, mut per_block) = (0, 0, 0);
    for _ in 0..4000 {
        let blocks = random_blocks(&mut random, 40, 1e-2);
        let feed = blocks[0].cap_mm_s * random.log(0.01, 1.0);
        let room = 1 + random.below(50);
        let first = &blocks[..blocks.len().min(room)];
        let stops = planned(first, feed, 0.0);
        match windowed_from(&blocks, feed, room, 6 * room) {
            Ok(spans) => {
                if let Err(error) = legal(&blocks, feed, 0.0, &spans) {
                    panic!("window of {room} from {feed}: {error}\n{blocks:?}");
                }
                made += 1;
                if first.len() == blocks.len()
                    && spans_between(&blocks, feed, 0.0).expect("in range").is_none()
                {
                    // Nothing but one pair of ramps a block is left then.
                    per_block += 1;
                    let time: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
                    let expected = time_s(&blocks, &stops.expect("one pair a block"));
                    assert!((time - expected).abs() < 1e-6 * expected, "{time} {expected}");
                }
            }
            Err(WindowError::NoPlan { feed_mm_s }) => {
                assert_eq!(feed_mm_s, feed, "motion never waits for a plan");
                assert!(matches!(stops, Err(PlanError::TooShortToBrake { .. })), "{stops:?}\n{blocks:?}");
                refused += 1;
            }
            Err(error) => panic!("window of {room} from {feed}: {error}\n{blocks:?}"),
        }
    }
    println!(
        "{made} planned, {per_block} of them with one pair of ramps a block; {refused} too short to stop"
    );
    assert!(made > 2000 && refused > 100 && per_block > 0);
}

/// With hardly any room for spans there still is a plan, or it is said that there is none.
#[test]
fn little_room_for_spans() {
    let mut random = Random::of_stream(40);
    let (mut made, mut refused) = (0, 0);
    for _ in 0..1000 {
        let blocks = random_blocks(&mut random, 60, 1e-2);
        let (room, places) = (1 + random.below(30), 1 + random.below(60));
        match windowed_from(&blocks, 0.0, room, places) {
            Ok(spans) => {
                if let Err(error) = legal(&blocks, 0.0, 0.0, &spans) {
                    panic!("window of {room}, {places} spans: {error}\n{blocks:?}");
                }
                made += 1;
            }
            Err(WindowError::Spans { places: room_for }) => {
                assert!(room_for < 3 * room, "room for {room_for} was too little for {room}");
                refused += 1;
            }
            Err(error) => panic!("window of {room}, {places} spans: {error}\n{blocks:?}"),
        }
    }
    println!("{made} planned, {refused} refused");
    assert!(made > 300 && refused > 100);
}

/// A bad block is named by its place in the program, however long the window has moved on.
#[test]
fn a_bad_block_is_counted_from_the_first() {
    let mut random = Random::of_stream(42);
    for _ in 0..200 {
        let (bad, room) = (random.below(500), 1 + random.below(40));
        let mut blocks: Vec<_> =
            (0..500).map(|_| block(random.log(0.01, 1.0), random.log(10.0, 100.0))).collect();
        blocks[bad].cap_mm_s = -1.0;
        match windowed(&blocks, room) {
            Err(WindowError::Plan(PlanError::Block { block, value, .. })) => {
                assert_eq!((block, value), (bad, -1.0), "window of {room}");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// Where giving up valleys would take too long there are no ramps that span blocks, and still a plan.
#[test]
fn one_pair_of_ramps_a_block_is_the_last_resort() {
    let blocks = unreachable(1.0, -0.5, 1.0);
    assert_eq!(spans_between(&blocks, 0.0, 0.0), Ok(None));
    let spans = windowed(&blocks, blocks.len()).expect("a plan");
    if let Err(error) = legal(&blocks, 0.0, 0.0, &spans) {
        panic!("{error}");
    }
    let time: f64 = spans.iter().map(|span| span.ramp.duration_s()).sum();
    let per_block = time_s(&blocks, &from_rest(&blocks));
    assert!(time <= per_block * (1.0 + 1e-6), "{time} {per_block}");
}
