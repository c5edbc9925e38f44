//! Bad input gives the error that names it, never a panic and never another plan.

use super::{block, planned, random_blocks};
use motion_kernel::plan::{Block, BlockPlan, PlanError, plan};
use motion_tests::random::Random;

#[test]
fn bad_figures_are_named() {
    let good = [block(10.0, 50.0), block(5.0, 80.0), block(20.0, 60.0)];
    assert!(planned(&good, 0.0, 0.0).is_ok());
    for place in 0..3 {
        for (quantity, values) in [
            ("length [mm]", [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, -f64::MIN_POSITIVE]),
            ("ceiling [mm/s]", [f64::NAN, f64::INFINITY, 0.0, -1.0, -0.0]),
            ("junction feed [mm/s]", [f64::NAN, f64::NEG_INFINITY, -1.0, -1e-300, -f64::MIN_POSITIVE]),
        ] {
            for bad in values {
                let mut blocks = good;
                match quantity {
                    "length [mm]" => blocks[place].length_mm = bad,
                    "ceiling [mm/s]" => blocks[place].cap_mm_s = bad,
                    _ => blocks[place].junction_mm_s = bad,
                }
                let before = format!("{blocks:?}");
                match planned(&blocks, 0.0, 0.0) {
                    Err(PlanError::Block { block, quantity: named, value, .. }) => {
                        assert_eq!((block, named, value.to_bits()), (place, quantity, bad.to_bits()));
                    }
                    other => panic!("{quantity} {bad} in block {place}: {other:?}"),
                }
                assert_eq!(before, format!("{blocks:?}"));
            }
        }
    }
}

#[test]
fn bad_feeds_are_named() {
    let blocks = [block(10.0, 50.0), block(100.0, 60.0)];
    for (feed, greatest) in [(f64::NAN, 50.0), (f64::INFINITY, 50.0), (-1.0, 50.0), (50.000_001, 50.0)] {
        match planned(&blocks, feed, 0.0) {
            Err(PlanError::EndFeed { quantity: "start feed", feed_mm_s, greatest_mm_s }) => {
                assert!(feed_mm_s.to_bits() == feed.to_bits() && greatest_mm_s == greatest);
            }
            other => panic!("{feed}: {other:?}"),
        }
    }
    for feed in [f64::NAN, f64::INFINITY, -1.0, 60.000_001] {
        let found = planned(&blocks, 0.0, feed);
        assert!(matches!(found, Err(PlanError::EndFeed { quantity: "end feed", .. })), "{feed}: {found:?}");
    }
    // One has to stop from 50 mm/s within 0.1 mm, and to reach 50 mm/s within it.
    let short = [block(0.1, 50.0)];
    assert!(matches!(planned(&short, 50.0, 0.0), Err(PlanError::TooShortToBrake { .. })));
    assert!(matches!(planned(&short, 0.0, 50.0), Err(PlanError::TooShortToAccelerate { .. })));
    // Too short together, over a junction that both feeds would pass.
    let pair = [block(0.1, 50.0), block(0.1, 50.0)];
    assert!(matches!(planned(&pair, 50.0, 0.0), Err(PlanError::TooShortToBrake { .. })));
    assert!(matches!(planned(&pair, 0.0, 50.0), Err(PlanError::TooShortToAccelerate { .. })));
    // A junction or a ceiling in between that the start feed can't be braked to.
    let stop = Block { junction_mm_s: 0.0, ..block(0.1, 50.0) };
    assert!(matches!(
        planned(&[stop, block(100.0, 50.0)], 50.0, 0.0),
        Err(PlanError::TooShortToBrake { .. })
    ));
    let slow = [block(0.1, 50.0), block(100.0, 1.0)];
    assert!(matches!(planned(&slow, 50.0, 0.0), Err(PlanError::TooShortToBrake { .. })));
    assert!(matches!(planned(&[slow[1], slow[0]], 0.0, 50.0), Err(PlanError::TooShortToAccelerate { .. })));
}

#[test]
fn room_for_plans_must_match() {
    let blocks = [block(10.0, 50.0); 3];
    for room in [0, 2, 4] {
        let mut plans = vec![BlockPlan::default(); room];
        assert_eq!(
            plan(&blocks, 0.0, 0.0, &mut plans),
            Err(PlanError::Room { of: "plans", needed: 3, places: room })
        );
        assert!(plans.iter().all(|plan| *plan == BlockPlan::default()));
    }
    assert_eq!(planned(&[], 0.0, 0.0), Ok(Vec::new()));
    assert!(matches!(planned(&[], 1.0, 0.0), Err(PlanError::EndFeed { .. })));
}

/// Any numbers at all, in any place: a plan or an error, and a message.
#[test]
fn any_numbers() {
    const STRANGE: [f64; 12] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        0.0,
        -0.0,
        f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        -f64::MAX,
        1e-160,
        1e160,
        f64::EPSILON,
    ];
    let mut random = Random::of_stream(70);
    let mut plans_made = 0;
    for _ in 0..50_000 {
        let mut blocks = random_blocks(&mut random, 8, 1e-6);
        let (mut start, mut end) = (0.0, 0.0);
        for _ in 0..=random.below(3) {
            let value = *random.pick(&STRANGE);
            let place = random.below(blocks.len());
            match random.below(6) {
                0 | 1 => blocks[place].length_mm = value,
                2 => blocks[place].cap_mm_s = value,
                3 => blocks[place].junction_mm_s = value,
                4 => start = value,
                _ => end = value,
            }
        }
        match planned(&blocks, start, end) {
            Ok(plans) => {
                plans_made += 1;
                for (block, plan) in blocks.iter().zip(plans) {
                    let feeds = [plan.enter_mm_s, plan.peak_mm_s, plan.exit_mm_s];
                    assert!(feeds.iter().all(|feed| *feed >= 0.0 && feed.is_finite()), "{plan:?} {blocks:?}");
                    let usual = block.length_mm >= 1e-6 && block.cap_mm_s >= 1e-6;
                    assert!(!usual || plan.peak_mm_s > 0.0, "never left: {plan:?} {block:?}");
                }
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    assert!(plans_made > 1000);
}
