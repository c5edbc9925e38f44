//! The fuzz target's own runs: every seed of its corpus, and random bytes.

#[path = "support/mod.rs"]
mod support;

use std::path::Path;

use motion_tests::fuzz::drive;
use support::Random;

/// Random inputs in a short run; `MOTION_TEST_PROGRAMS` has more.
const INPUTS: usize = 2000;

#[test]
fn the_corpus() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/kernel");
    let mut inputs = 0;
    for entry in std::fs::read_dir(&folder).expect("a corpus") {
        let path = entry.expect("an entry").path();
        println!("{}", path.display());
        drive(&std::fs::read(&path).expect("a seed"));
        inputs += 1;
    }
    assert!(inputs >= 20, "{inputs} seeds");
}

#[test]
fn random_bytes() {
    let inputs =
        std::env::var("MOTION_TEST_PROGRAMS").ok().and_then(|text| text.parse().ok()).unwrap_or(INPUTS);
    let mut random = Random::new(61);
    let mut said = 0;
    for input in 0..inputs {
        let mut bytes = vec![0; 8 + random.below(400)];
        for byte in &mut bytes {
            *byte = random.next() as u8;
        }
        println!("input {input}");
        said += usize::from(drive(&bytes));
    }
    assert!(2 * said > inputs, "{said} of {inputs} inputs said anything");
}
