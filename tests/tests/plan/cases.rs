//! Named cases: the field's, and S3's.

use super::{block, from_rest, law, planned, reference, time_s};
use motion_kernel::internals::merge_equal;
use motion_kernel::law::reach;
use motion_kernel::plan::Block;
use motion_tests::random::Random;

fn merged_time_s(mut blocks: Vec<Block<f64>>) -> (usize, f64) {
    let count = merge_equal(&mut blocks);
    blocks.truncate(count);
    (count, time_s(&blocks, &from_rest(&blocks)))
}

/// 50 mm at 5000 mm/min in 500 pieces: 7.03 s with a ramp in each, 0.965 s as the one line it is.
#[test]
fn a_tessellated_line_is_planned_as_the_line_it_is() {
    let blocks = vec![block(0.1, 5000.0 / 60.0); 500];
    let apart = time_s(&blocks, &from_rest(&blocks));
    let (count, together) = merged_time_s(blocks);
    println!("{apart:.6} s, merged {together:.6} s");
    assert_eq!(count, 1);
    assert!((apart - 7.03).abs() < 0.005, "{apart}");
    assert!((together - 0.965).abs() < 0.0005, "{together}");
}

#[test]
fn ten_thousand_blocks_of_a_nanometre_are_planned_as_one() {
    let blocks = vec![block(1e-6, 5000.0 / 60.0); 10_000];
    let plans = from_rest(&blocks);
    let apart = time_s(&blocks, &plans);
    let (count, together) = merged_time_s(blocks);
    println!("{apart:.6} s, merged {together:.6} s");
    assert!(count == 1 && together < apart && apart.is_finite());
    let one = [block(1e-2, 5000.0 / 60.0)];
    assert!((together / time_s(&one, &from_rest(&one)) - 1.0).abs() < 1e-9);
}

/// Every second block slow, and a saw-tooth: the junctions keep the lower ceiling, fast blocks rise above it.
#[test]
fn junctions_keep_the_lower_ceiling() {
    let alternating: Vec<_> = (0..200).map(|n| block(1.0, if n % 2 == 0 { 80.0 } else { 10.0 })).collect();
    let plans = from_rest(&alternating);
    for pair in plans[..199].windows(2) {
        assert_eq!(pair[0].exit_mm_s, 10.0, "{pair:?}");
    }
    assert!(plans[2].peak_mm_s > 10.0 && plans[2].peak_mm_s < 80.0 && plans[3].peak_mm_s == 10.0);
    let teeth: Vec<_> = (0..200).map(|n| block(0.5, 5.0 + f64::from(n % 10) * 8.0)).collect();
    for (pair, blocks) in from_rest(&teeth).windows(2).zip(teeth.windows(2)) {
        assert!(pair[0].exit_mm_s <= blocks[0].cap_mm_s.min(blocks[1].cap_mm_s));
    }
    let down = from_rest(&(0..50).map(|n| block(2.0, 100.0 - f64::from(n))).collect::<Vec<_>>());
    assert!(down.iter().all(|plan| plan.exit_mm_s <= plan.peak_mm_s));
}

/// Steps around corners: stops at every one, so all alike blocks are planned alike.
#[test]
fn a_stepped_path_stops_at_every_corner() {
    let step = Block { junction_mm_s: 0.0, ..block(0.5, 50.0) };
    let mut blocks = vec![step; 100];
    let plans = from_rest(&blocks);
    assert!(plans.iter().all(|plan| *plan == plans[0] && plan.enter_mm_s == 0.0 && plan.exit_mm_s == 0.0));
    assert_eq!(merge_equal(&mut blocks), 100);
}

/// Blocks of no length pass the feed on and bind it to their ceiling.
#[test]
fn blocks_of_no_length() {
    let long = block(50.0, 80.0);
    let without = from_rest(&[long, long]);
    let with = from_rest(&[long, block(0.0, 200.0), block(0.0, 300.0), long]);
    assert_eq!((with[0], with[3]), (without[0], without[1]));
    assert!((with[1].enter_mm_s, with[1].peak_mm_s, with[1].exit_mm_s) == (80.0, 80.0, 80.0));
    let slow = from_rest(&[long, block(0.0, 30.0), long]);
    assert_eq!((slow[0].exit_mm_s, slow[1].peak_mm_s, slow[2].enter_mm_s), (30.0, 30.0, 30.0));
    let at_rest = from_rest(&[block(0.0, 30.0), block(0.0, 30.0)]);
    assert!(at_rest.iter().all(|plan| plan.peak_mm_s == 0.0));
    let stop = Block { junction_mm_s: 0.0, ..block(0.0, 80.0) };
    assert_eq!(from_rest(&[long, stop, long])[1].enter_mm_s, 0.0);
}

/// The 8 m machine: the whole length, as one block and as 8000.
#[test]
fn eight_metres_in_one_block_and_in_8000_take_the_same_time() {
    let one = [block(8000.0, 500.0)];
    let plan = from_rest(&one)[0];
    assert_eq!((plan.enter_mm_s, plan.peak_mm_s, plan.exit_mm_s), (0.0, 500.0, 0.0));
    // F·(F/A + t₁) to accelerate and brake, the rest at the feed; t₁ = 2·A/J.
    let time = 8000.0 / 500.0 + 500.0 / 500.0 + 0.2;
    assert!((time_s(&one, &[plan]) - time).abs() < 1e-12);
    let (count, merged) = merged_time_s(vec![block(1.0, 500.0); 8000]);
    assert!(count == 1 && (merged - time).abs() < 1e-9, "{merged}");
}

/// From 60 mm/s within 3 mm one can stop but not slow to 20 mm/s: a hole in what can be reached. The plan keeps
/// out of it by entering more slowly, and says so if the entry is given.
#[test]
fn hole_in_what_can_be_reached() {
    let law = law(2000.0, 5e4, 5e6);
    let block = |length_mm, cap_mm_s| Block { law, ..block(length_mm, cap_mm_s) };
    assert!(planned(&[block(3.0, 60.0)], 60.0, 0.0).is_ok());
    assert!(planned(&[block(3.0, 60.0)], 60.0, 20.0).is_err());
    assert!(planned(&[block(3.0, 60.0)], 60.0, 40.0).is_ok());
    let blocks = [block(100.0, 60.0), block(3.0, 60.0), block(100.0, 20.0)];
    let plans = from_rest(&blocks);
    assert_eq!((plans[1].exit_mm_s, plans[1].enter_mm_s), (20.0, reach(&law, 20.0, 3.0)));
    assert!(plans[1].enter_mm_s < 60.0 && plans[0].peak_mm_s == 60.0);
}

/// Only neighbours that are alike are merged, and the last one's junction stays.
#[test]
fn only_neighbours_that_are_alike_are_merged() {
    let mut random = Random::of_stream(90);
    for _ in 0..5000 {
        let blocks: Vec<Block<f64>> = (0..random.below(20))
            .map(|_| Block {
                length_mm: f64::from(1 + random.below(5) as u32),
                cap_mm_s: *random.pick(&[50.0, 50.0, 50.0, 60.0]),
                junction_mm_s: *random.pick(&[f64::INFINITY, f64::INFINITY, 60.0, 50.0, 49.0, 0.0]),
                law: if random.once_in(4) { law(500.0, 5e3, 5e5) } else { reference() },
            })
            .collect();
        let alike = |a: &Block<f64>, b: &Block<f64>| {
            a.cap_mm_s == b.cap_mm_s && a.law == b.law && a.junction_mm_s >= b.cap_mm_s
        };
        let expected: Vec<Block<f64>> = blocks
            .chunk_by(alike)
            .map(|run| Block {
                length_mm: run.iter().map(|block| block.length_mm).sum(),
                ..run[run.len() - 1]
            })
            .collect();
        let mut merged = blocks.clone();
        let count = merge_equal(&mut merged);
        assert_eq!(merged[..count], expected[..], "{blocks:?}");
    }
}

/// Merged and yet slower: eight blocks of 1 µm reach less feed than the 8 µm they are, and from less feed the short
/// block after them accelerates further, for the benefit of a long one that hardly accelerates.
#[test]
fn higher_at_a_junction_and_slower_in_all() {
    let mut blocks = vec![Block { law: law(500.0, 1e5, 4e5), ..block(1e-3, 80.0) }; 8];
    blocks.extend([block(0.03, 900.0), Block { law: law(1.0, 1e4, 1e8), ..block(80.0, 300.0) }]);
    let plans = from_rest(&blocks);
    let apart = time_s(&blocks, &plans);
    let mut merged = blocks.clone();
    let count = merge_equal(&mut merged);
    merged.truncate(count);
    let together = from_rest(&merged);
    println!("{apart} s, merged {} s", time_s(&merged, &together));
    assert!(together[0].exit_mm_s > plans[7].exit_mm_s && together[1].exit_mm_s < plans[8].exit_mm_s);
    assert!(time_s(&merged, &together) > apart);
}

/// S3's stringer, block by block, to the published micrometres and microseconds.
#[test]
fn the_stringer_has_the_published_feeds_and_time() {
    let caps = [5000.0 / 60.0, 80_000.0_f64.cbrt(), 5000.0_f64.sqrt(), 80_000.0_f64.cbrt(), 5000.0 / 60.0];
    let quarter = std::f64::consts::PI / 180.0;
    let lengths = [50.0, 4.0 * 75.0 * quarter, 10.0 * 150.0 * quarter, 4.0 * 75.0 * quarter, 25.0];
    let blocks: Vec<_> = lengths.iter().zip(caps).map(|(length, cap)| block(*length, cap)).collect();
    let plans = from_rest(&blocks);
    let feeds = plans.iter().map(|plan| [plan.enter_mm_s, plan.peak_mm_s, plan.exit_mm_s]);
    let printed = [
        [0.0, 83.3333, 43.0887],
        [43.0887, 43.0887, 43.0887],
        [43.0887, 70.7107, 43.0887],
        [43.0887, 43.0887, 43.0887],
        [43.0887, 72.7017, 0.0],
    ];
    for (found, printed) in feeds.flatten().zip(printed.iter().flatten()) {
        assert!((found - printed).abs() <= 0.5e-4, "{found} {printed}");
    }
    assert!((reference().ramp_length_mm(43.088_693_800_637_67, plans[4].peak_mm_s) - 12.6021).abs() < 0.5e-4);
    assert!((time_s(&blocks, &plans) - 2.097_975_247_451_847).abs() < 1e-12);
}
