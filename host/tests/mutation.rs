//! Programs of every kind of word, changed at random: whatever comes out is read within its bounds or refused at a place,
//! and no move of it begins where the one before did not end.

use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use motion_host::gcode::{self, ReadOptions, ToolTable};
use motion_tests::fuzz::gcode::{assert_placed, assert_sound};
use motion_tests::random::Random;

const LINES_MAX: u64 = 3000;
const STEPS_MAX: usize = 5000;

/// Posts of CAM programs, and programs of all words that LinuxCNC reads alike.
fn programs() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests");
    let folders = ["programs/posts", "peers/linuxcnc/programs"].map(|folder| root.join(folder));
    let entries = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "ngc"));
    paths.sort();
    paths
}

fn options() -> ReadOptions {
    let others: String = (4..100).map(|number| format!("T{number} Z{number} D1\n")).collect();
    let table = format!("T1 Z12 D4\nT2 X3 Z-4 D1.6 Q2\nT3 Z50 D-1\n{others}");
    ReadOptions {
        tools: Some(ToolTable::parse("tool.tbl", table.as_bytes()).unwrap()),
        lines_max: LINES_MAX,
        steps_max: STEPS_MAX,
        ..ReadOptions::default()
    }
}

fn changed(text: &[u8], random: &mut Random) -> Vec<u8> {
    const WORDS: [&str; 24] = [
        "G0",
        "G2",
        "G40",
        "G41",
        "G42.1 D1",
        "G18",
        "G91",
        "G20",
        "G28",
        "G53",
        "G81 R2 Z-1",
        "G92 X1",
        "G10 L2 P1 R33",
        "M2",
        "M6",
        "M73",
        "M98 P1",
        "o1 call",
        "o1 while [1]",
        "o1 endwhile",
        "#1=[#1+1]",
        "X#1",
        "I-3.5",
        "[1/0]",
    ];
    const BYTES: &[u8] = b"GMXYZIJKRFPQLDHTO0123456789.-[]#<>()=;%/ \n\xff";
    let mut lines: Vec<Vec<u8>> = text.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    for _ in 0..1 + random.below(4) {
        let [at, other] = [0, 1].map(|_| random.below(lines.len()));
        match random.below(6) {
            0 => lines.swap(at, other),
            1 => lines.insert(at, lines[other].clone()),
            2 if lines.len() > 1 => drop(lines.remove(at)),
            3 => {
                lines[at].push(b' ');
                lines[at].extend(random.pick(&WORDS).bytes());
            }
            4 => lines.insert(at, random.pick(&WORDS).bytes().collect()),
            _ => {
                let line = &mut lines[at];
                let place = random.below(line.len() + 1);
                let byte = *random.pick(BYTES);
                match line.get_mut(place) {
                    Some(old) if random.chance(0.5) => *old = byte,
                    _ => line.insert(place, byte),
                }
            }
        }
    }
    lines.join(&b'\n')
}

#[test]
fn changed_programs_are_read_within_bounds_or_refused_at_a_place() {
    let seed: u64 = motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(20_261_124);
    let (options, programs) = (options(), programs());
    assert!(programs.len() > 20, "{programs:?}");
    for path in programs {
        let text = std::fs::read(&path).unwrap();
        let mut accepted = 0;
        for case in 0..1000 {
            let seed = seed.wrapping_add(case);
            let changed = changed(&text, &mut Random::new(seed));
            let outcome = catch_unwind(|| match gcode::read_with("a.ngc", &changed, &options) {
                Ok(program) => {
                    assert_sound(&program, STEPS_MAX);
                    true
                }
                Err(error) => {
                    assert_placed(&error, &changed);
                    false
                }
            });
            accepted += u32::from(outcome.unwrap_or_else(|_| {
                panic!("{}, seed {seed}:\n{}", path.display(), String::from_utf8_lossy(&changed))
            }));
        }
        println!("{accepted} of 1000 changes of {} accepted", path.display());
        assert!((50..950).contains(&accepted), "{accepted} of {}", path.display());
    }
}
