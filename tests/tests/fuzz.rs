//! The fuzz target's own runs: every seed of its corpus, and random bytes.

use std::path::Path;

use motion_tests::fuzz::{Laws, drive, drive_with};
use motion_tests::random::Random;

/// Random inputs in a short run; `MOTION_TEST_PROGRAMS` has more.
const INPUTS: usize = 2000;

/// With any laws: a search has kept a seed for what it did with those of its time.
#[test]
fn every_seed_of_the_corpus_keeps_the_promises() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/kernel");
    let mut inputs = 0;
    for entry in std::fs::read_dir(&folder).expect("a corpus") {
        let path = entry.expect("an entry").path();
        let bytes = std::fs::read(&path).expect("a seed");
        for laws in Laws::ALL {
            println!("{}, {laws:?}", path.display());
            drive_with(laws, &bytes);
        }
        inputs += 1;
    }
    assert!(inputs >= 20, "{inputs} seeds");
}

#[test]
fn random_bytes_keep_the_promises() {
    let inputs = motion_tests::from_env("MOTION_TEST_PROGRAMS").map_or(INPUTS, |inputs| inputs as usize);
    let mut random = Random::of_stream(61);
    let mut said = 0;
    for input in 0..inputs {
        let mut bytes = vec![0; 8 + random.below(400)];
        for byte in &mut bytes {
            *byte = random.bits() as u8;
        }
        println!("input {input}");
        said += usize::from(drive(&bytes));
    }
    assert!(2 * said > inputs, "{said} of {inputs} inputs said anything");
}
