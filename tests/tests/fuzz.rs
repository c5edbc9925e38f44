//! The fuzz targets' own runs: every seed of their corpora, and random bytes.

use std::path::Path;

use motion_tests::fuzz::{Laws, drive, drive_with, gcode, link};
use motion_tests::random::Random;

/// Random inputs in a short run; `MOTION_TEST_PROGRAMS` has more.
const INPUTS: usize = 2000;

/// The inputs of a corpus, each with its bytes.
fn seeds(corpus: &str) -> impl Iterator<Item = Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(corpus);
    std::fs::read_dir(&folder).expect("a corpus").map(|entry| {
        let path = entry.expect("an entry").path();
        println!("{}", path.display());
        std::fs::read(&path).expect("a seed")
    })
}

/// With any laws: a search has kept a seed for what it did with those of its time.
#[test]
fn every_seed_of_the_corpus_keeps_the_promises() {
    let mut inputs = 0;
    for bytes in seeds("kernel") {
        for laws in Laws::ALL {
            println!("{laws:?}");
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

#[test]
fn every_seed_of_the_link_keeps_its_promises() {
    let mut inputs = 0;
    for bytes in seeds("link") {
        link::drive(&bytes);
        inputs += 1;
    }
    assert!(inputs >= 50, "{inputs} seeds");
}

#[test]
fn random_bytes_keep_the_promises_of_the_link() {
    let inputs = motion_tests::from_env("MOTION_TEST_PROGRAMS").map_or(INPUTS, |inputs| inputs as usize);
    let mut random = Random::of_stream(63);
    for input in 0..inputs {
        let bytes: Vec<u8> = (0..random.below(600)).map(|_| random.bits() as u8).collect();
        println!("input {input}");
        link::drive(&bytes);
    }
}

#[test]
fn every_seed_of_gcode_is_read_as_promised() {
    let (mut inputs, mut accepted) = (0, 0);
    for seed in seeds("gcode") {
        accepted += usize::from(gcode::read(&seed));
        // With all that it may be read with, and cut short anywhere.
        for switches in 0..32 {
            let _ = gcode::read(&[&[switches], &seed[1..]].concat());
        }
        for end in 0..seed.len() {
            let _ = gcode::read(&seed[..end]);
        }
        inputs += 1;
    }
    assert!(inputs >= 20 && accepted >= 15, "{accepted} of {inputs} seeds accepted");
}

/// Programs that grow by lines of words and bytes. A line that is refused is left out again, so that others are read behind
/// what was accepted.
#[test]
fn random_gcode_is_read_as_promised() {
    const LINES: usize = 16;
    let programs = motion_tests::from_env("MOTION_TEST_PROGRAMS").map_or(INPUTS, |inputs| inputs as usize);
    let mut random = Random::of_stream(62);
    let mut accepted = 0;
    for program in 0..programs {
        let mut bytes = vec![random.bits() as u8];
        for _ in 0..LINES {
            let before = bytes.len();
            for _ in 0..1 + random.below(5) {
                // Words from 136 on, ends of lines before them.
                let byte = if random.once_in(16) { random.below(256) } else { 136 + random.below(120) };
                bytes.push(byte as u8);
            }
            bytes.push(b'\n');
            println!("program {program}: {bytes:?}");
            if gcode::read(&bytes) {
                accepted += 1;
            } else {
                bytes.truncate(before);
            }
        }
    }
    println!("{accepted} of {} lines accepted", LINES * programs);
    assert!(5 * accepted > LINES * programs, "{accepted} of {} lines accepted", LINES * programs);
}
