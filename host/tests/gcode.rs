//! The G-code reader from outside: whole programs, against a second, simple-minded interpreter written for
//! this test alone, and against plane geometry. Every random case replays from the seed it prints; set
//! `MOTION_TEST_SEED` to search elsewhere.

#![allow(clippy::float_cmp, reason = "exact values are the point")]

use motion_host::gcode::{self, ArcMove, Feed, NoticeKind, Point, Program, SpindleSpeed, Step, StepKind};
use motion_kernel::hal::Spindle;
use motion_tests::random::Random;
use std::f64::consts::PI;
use std::panic::catch_unwind;

const SAMPLES: [(&str, &str); 5] = [
    ("pockets.ngc", include_str!("../../tests/programs/pockets.ngc")),
    ("nameplate_inch.ngc", include_str!("../../tests/programs/nameplate_inch.ngc")),
    ("thread_mill_helix.ngc", include_str!("../../tests/programs/thread_mill_helix.ngc")),
    ("stairs_incremental.ngc", include_str!("../../tests/programs/stairs_incremental.ngc")),
    ("modes.ngc", include_str!("../../tests/programs/modes.ngc")),
];

fn seed() -> u64 {
    motion_tests::from_env("MOTION_TEST_SEED").unwrap_or(20_240_917)
}

fn read(name: &str, text: &str) -> Program {
    gcode::read(name, text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

// ---- the second interpreter
// --------------------------------------------------------------------------------------

/// A step as the second interpreter expects it; lengths in 10⁻¹⁰ mm.
#[derive(Debug)]
enum Expected {
    Line { to: [i128; 3], feed_mm_min: Option<f64> },
    Arc { to: [i128; 3], feed_mm_min: f64, clockwise: bool, axes: [usize; 2], shape: Shape, turns: i128 },
    Cubic { to: [i128; 3], feed_mm_min: f64, controls: [[i128; 2]; 2] },
    Through { to: [i128; 3], feed_mm_min: f64, begins: bool },
    Dwell(f64),
    Switch(Switched),
    Stop,
    End,
}

/// Whether the spindle turns clockwise or the other way round, its speed, mist and flood.
type Switched = (Option<bool>, f64, [bool; 2]);

#[derive(Debug)]
enum Shape {
    Centre([i128; 2]),
    Radius(i128),
}

/// Letter and number text of each word of a line, comments and blanks cut out.
fn split_words(line: &[u8]) -> Vec<(char, String)> {
    let mut words: Vec<(char, String)> = Vec::new();
    let mut in_comment = false;
    for &byte in line.strip_suffix(b"\r").unwrap_or(line) {
        match char::from(byte) {
            ')' => in_comment = false,
            _ if in_comment => {}
            '(' => in_comment = true,
            ';' => break,
            ' ' | '\t' => {}
            letter if letter.is_ascii_alphabetic() => {
                words.push((letter.to_ascii_uppercase(), String::new()))
            }
            other => match words.last_mut() {
                Some(word) => word.1.push(other),
                None => words.push(('?', other.to_string())),
            },
        }
    }
    words
}

/// 10⁻¹⁰ of the number, by its digits.
fn units(text: &str) -> i128 {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    let decimals = decimals.trim_end_matches('0');
    assert!(decimals.len() <= 10, "{text}");
    sign * format!("{whole}{decimals:0<10}").parse::<i128>().unwrap_or_else(|_| panic!("a number: {text:?}"))
}

/// Whether the second interpreter knows all that is in a program. It knows neither parameters nor offsets.
fn is_plain(text: &[u8]) -> bool {
    let is_known = |(letter, number): &(char, String)| {
        let number = number.strip_prefix(['-', '+']).unwrap_or(number);
        let decimals = number.split_once('.').map_or("", |(_, decimals)| decimals).trim_end_matches('0');
        let is_number = number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
        let is_code = matches!(letter, 'G' | 'M');
        let codes: &[i128] = match letter {
            'G' => &[
                0, 10, 20, 30, 40, 50, 55, 170, 180, 190, 200, 210, 400, 490, 540, 610, 640, 800, 900, 901,
                910, 911, 940,
            ],
            'M' => &[0, 10, 20, 30, 40, 50, 70, 80, 90, 300],
            _ => &[],
        };
        is_number
            && number.bytes().any(|byte| byte.is_ascii_digit())
            && "FGIJKMNPQRSXYZ".contains(*letter)
            && decimals.len() <= 9
            && number.len() <= 18
            && (!is_code || codes.contains(&(units(number) / 1_000_000_000)))
    };
    let is_plain_line = |line: &[u8]| {
        if line.trim_ascii() == b"%" {
            return true;
        }
        let mut in_comment = false;
        let has_strangers = line.iter().any(|&byte| {
            in_comment = byte == b'(' || in_comment && byte != b')';
            !in_comment && matches!(byte, b'#' | b'[' | b'/' | b'*' | b'=' | b'<')
        });
        if has_strangers {
            return false;
        }
        let words = split_words(line);
        let has =
            |code: i128| words.iter().any(|(letter, n)| *letter == 'G' && units(n) / 1_000_000_000 == code);
        words.iter().all(is_known)
            && !(has(800) && words.iter().filter(|(letter, _)| *letter == 'G').count() > 1)
    };
    text.split(|&byte| byte == b'\n').all(is_plain_line)
}

/// What an accepted program must have been read as. Panics on anything it does not know, since the reader
/// has no business accepting it.
fn second_opinion(text: &[u8]) -> Vec<(u32, Expected)> {
    let mut expected = Vec::new();
    let (mut position, mut feed_mm_min, mut inch) = ([0_i128; 3], f64::NAN, false);
    let (mut incremental, mut centre_absolute) = (false, false);
    let (mut motion, mut axes, mut begun) = (None, [0, 1], false);
    // P and Q of the curve before, if that was the last thing done.
    let mut before: Option<[i128; 2]> = None;
    // What was programmed, and what the last step does.
    let (mut clockwise, mut speed, mut coolant, mut now) = (None, 0.0, [false; 2], Switched::default());
    let switch = |number, to: Switched, now: &mut Switched, expected: &mut Vec<(u32, Expected)>| {
        let spindle = if to.0.is_some() { (to.0, to.1) } else { (None, 0.0) };
        for next in [
            (spindle.0, spindle.1, now.2),
            (spindle.0, spindle.1, [to.2[0], now.2[1]]),
            (spindle.0, spindle.1, to.2),
        ] {
            if next != *now {
                *now = next;
                expected.push((number, Expected::Switch(next)));
            }
        }
    };
    let mut last = 1;
    for (line, number) in text.split(|&byte| byte == b'\n').zip(1_u32..) {
        if line.trim_ascii() == b"%" {
            if begun {
                switch(number, Switched::default(), &mut now, &mut expected);
                expected.push((number, Expected::End));
                break;
            }
            begun = true;
            continue;
        }
        if !line.trim_ascii().is_empty() {
            last = number;
        }
        let words = split_words(line);
        begun |= !words.is_empty();
        let value = |letter| words.iter().find(|word| word.0 == letter).map(|word| units(&word.1));
        let codes = |letter| {
            let tenths = |word: &(char, String)| units(&word.1) / 1_000_000_000;
            words.iter().filter(move |word| word.0 == letter).map(tenths).collect::<Vec<_>>()
        };
        let (mut dwell, mut stop) = (false, None);
        for code in codes('G') {
            match code {
                0 | 10 | 20 | 30 | 50 | 55 => motion = Some(code),
                40 => dwell = true,
                170 => axes = [0, 1],
                180 => axes = [2, 0],
                190 => axes = [1, 2],
                200 => inch = true,
                210 => inch = false,
                800 => motion = None,
                900 => incremental = false,
                910 => incremental = true,
                901 => centre_absolute = true,
                911 => centre_absolute = false,
                400 | 490 | 540 | 610 | 640 | 940 => {}
                other => panic!("line {number}: G{other}/10"),
            }
        }
        for code in codes('M') {
            match code {
                0 | 10 => stop = Some(Expected::Stop),
                20 | 300 => stop = Some(Expected::End),
                30..=90 => {}
                other => panic!("line {number}: M{other}/10"),
            }
        }
        let length = |letter| {
            let tenths = value(letter)? * if inch { 254 } else { 10 };
            assert_eq!(tenths % 10, 0, "line {number}: {letter} rounded");
            Some(tenths / 10)
        };
        if let Some(feed) = value('F') {
            feed_mm_min = feed as f64 / 1e10 * if inch { 25.4 } else { 1.0 };
        }
        if let Some(rpm) = value('S') {
            speed = rpm as f64 / 1e10;
            switch(number, (clockwise, speed, coolant), &mut now, &mut expected);
        }
        for code in codes('M') {
            match code {
                30 => clockwise = Some(true),
                40 => clockwise = Some(false),
                50 => clockwise = None,
                70 => coolant[0] = true,
                80 => coolant[1] = true,
                _ => {}
            }
        }
        if codes('M').contains(&90) {
            coolant = [false; 2];
        }
        switch(number, (clockwise, speed, coolant), &mut now, &mut expected);
        if dwell || motion != Some(50) {
            before = None;
        }
        if dwell {
            expected.push((number, Expected::Dwell(value('P').expect("a time") as f64 / 1e10)));
        }
        let from = position;
        let mut moves = false;
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            if let Some(length) = length(letter) {
                moves = true;
                position[axis] = if incremental { position[axis] + length } else { length };
            }
        }
        let offsets = axes.map(|axis| length(['I', 'J', 'K'][axis]));
        let radius = length('R');
        let to = position;
        // Of a curve, where they are not those of G64 or G4.
        let ends = ['P', 'Q'].map(length);
        let is_curve = motion == Some(50) && ends != [None, None] && !dwell && !codes('G').contains(&640);
        if is_curve {
            assert_eq!((axes, value('Z')), ([0, 1], None), "line {number}");
            let end = ends.map(|offset| offset.expect("both"));
            let start = match ['I', 'J'].map(length) {
                [Some(i), Some(j)] => [i, j],
                [None, None] => before.expect("a curve to continue").map(|offset| -offset),
                _ => panic!("line {number}: I or J alone"),
            };
            let controls = [start, end];
            if from != to || controls != [[0; 2]; 2] {
                expected.push((number, Expected::Cubic { to, feed_mm_min, controls }));
                before = Some(end);
            }
        } else if moves || offsets != [None, None] || radius.is_some() {
            let clockwise = motion == Some(20);
            let turns = value('P')
                .filter(|_| !dwell && !codes('G').contains(&640))
                .map_or(1, |turns| turns / 10_i128.pow(10));
            match motion.expect("a motion mode") {
                0 if from != to => expected.push((number, Expected::Line { to, feed_mm_min: None })),
                10 if from != to => {
                    expected.push((number, Expected::Line { to, feed_mm_min: Some(feed_mm_min) }));
                }
                55 if from != to => {
                    let begins = codes('G').contains(&55);
                    expected.push((number, Expected::Through { to, feed_mm_min, begins }));
                }
                0 | 10 | 55 => {}
                50 => panic!("line {number}: a curve without its end"),
                _ => {
                    let shape = match radius {
                        Some(radius) => Shape::Radius(radius),
                        None if centre_absolute => Shape::Centre(offsets.map(|offset| offset.expect("both"))),
                        None => Shape::Centre([0, 1].map(|i| from[axes[i]] + offsets[i].unwrap_or(0))),
                    };
                    expected.push((number, Expected::Arc { to, feed_mm_min, clockwise, axes, shape, turns }));
                }
            }
        }
        if stop.is_some() {
            before = None;
        }
        let ends = matches!(stop, Some(Expected::End));
        if ends {
            switch(number, Switched::default(), &mut now, &mut expected);
        }
        expected.extend(stop.map(|stop| (number, stop)));
        if ends {
            break;
        }
    }
    switch(last, Switched::default(), &mut now, &mut expected);
    expected
}

fn assert_near(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found} instead of {expected}");
}

fn same_feed(feed: Feed, expected: Option<f64>) {
    match (feed, expected) {
        (Feed::Rapid, None) => {}
        (Feed::MmPerMin(feed), Some(expected)) => assert_near(feed, expected, 1e-12 * expected, "feed"),
        other => panic!("feed: {other:?}"),
    }
}

/// The arc's figures against each other, by rotating the start about the centre.
fn assert_arc_geometry(arc: &ArcMove) {
    let [first, second, _] = arc.plane.axes();
    let relative =
        |point: Point| [point[first].to_mm() - arc.centre_mm[0], point[second].to_mm() - arc.centre_mm[1]];
    let (start, end) = (relative(arc.from), relative(arc.to));
    let largest =
        start.iter().chain(&arc.centre_mm).chain(&end).fold(1.0_f64, |largest, mm| largest.max(mm.abs()));
    let rounding_mm = 4.0 * f64::EPSILON * largest;
    assert_near(start[0].hypot(start[1]), arc.start_radius_mm, rounding_mm, "start radius");
    assert_near(end[0].hypot(end[1]), arc.end_radius_mm, rounding_mm, "end radius");
    let (sin, cos) = arc.sweep_rad.sin_cos();
    let rotated = [start[0] * cos - start[1] * sin, start[0] * sin + start[1] * cos];
    for i in 0..2 {
        let reached = rotated[i] / arc.start_radius_mm * arc.end_radius_mm;
        let stretch = arc.end_radius_mm / arc.start_radius_mm + 1.0;
        assert_near(
            reached,
            end[i],
            2.0 * stretch * rounding_mm + 1e-15 * arc.end_radius_mm,
            "end of the sweep",
        );
    }
    assert!(arc.sweep_rad.abs() > 0.0 && arc.sweep_rad.abs() <= 2.0 * PI, "{}", arc.sweep_rad);
    // As LinuxCNC: a thousandth, but at least 0.002 √2 inch, the more of both units, and at most a hundred times that.
    let least_mm = 25.4 * 0.002 * 2.0_f64.sqrt();
    let allowed_mm = (arc.start_radius_mm * 0.001).clamp(least_mm, 100.0 * least_mm);
    assert_near(arc.end_radius_mm, arc.start_radius_mm, allowed_mm, "radii");
}

fn assert_same_step(step: &Step, expected: &Expected, position: &mut [i128; 3]) {
    let units = |point: Point| core::array::from_fn(|axis| i128::from(point[axis].units()));
    match (step.kind, expected) {
        (StepKind::Line(line), Expected::Line { to, feed_mm_min }) => {
            assert_eq!((units(line.from), units(line.to)), (*position, *to));
            same_feed(line.feed, *feed_mm_min);
            *position = *to;
        }
        (StepKind::Arc(mut arc), Expected::Arc { to, feed_mm_min, clockwise, axes, shape, turns }) => {
            arc.sweep_rad -= (2.0 * PI * (*turns - 1) as f64).copysign(arc.sweep_rad);
            assert_eq!((units(arc.from), units(arc.to)), (*position, *to));
            same_feed(arc.feed, Some(*feed_mm_min));
            assert_eq!(arc.plane.axes()[..2], axes[..]);
            assert_eq!(arc.sweep_rad < 0.0, *clockwise);
            assert_arc_geometry(&arc);
            match shape {
                Shape::Centre(centre) => {
                    for (found, expected) in arc.centre_mm.iter().zip(centre) {
                        assert_near(*found, *expected as f64 / 1e10, 0.0, "centre");
                    }
                }
                Shape::Radius(radius) => {
                    let radius_mm = *radius as f64 / 1e10;
                    assert_near(arc.start_radius_mm, radius_mm.abs(), 0.002_501, "radius");
                    let shorter = arc.sweep_rad.abs() <= PI;
                    assert!(shorter == (radius_mm > 0.0) || (arc.sweep_rad.abs() - PI).abs() < 1e-12);
                }
            }
            *position = *to;
        }
        (StepKind::Cubic(curve), Expected::Cubic { to, feed_mm_min, controls }) => {
            assert_eq!((units(curve.from), units(curve.to)), (*position, *to));
            same_feed(curve.feed, Some(*feed_mm_min));
            for (found, expected) in curve.controls_mm.iter().flatten().zip(controls.iter().flatten()) {
                assert_near(*found, *expected as f64 / 1e10, 0.0, "control point");
            }
            *position = *to;
        }
        (StepKind::Through(point), Expected::Through { to, feed_mm_min, begins }) => {
            assert_eq!((units(point.from), units(point.to)), (*position, *to));
            same_feed(point.feed, Some(*feed_mm_min));
            assert_eq!(point.begins, *begins);
            *position = *to;
        }
        (StepKind::Dwell { seconds }, Expected::Dwell(expected)) => {
            assert_near(seconds, *expected, 0.0, "dwell")
        }
        (StepKind::Switch(to), Expected::Switch((clockwise, speed, coolant))) => {
            let turns = match to.spindle {
                Spindle::Off => None,
                Spindle::Clockwise => Some(true),
                Spindle::Counterclockwise => Some(false),
            };
            assert_eq!((turns, [to.mist, to.flood]), (*clockwise, *coolant));
            match to.speed {
                SpindleSpeed::Rpm(rpm) => assert_near(rpm, *speed, 1e-12 * speed, "spindle speed"),
                SpindleSpeed::Surface(_) => panic!("no G96"),
            }
        }
        (StepKind::Stop, Expected::Stop) | (StepKind::End, Expected::End) => {}
        other => panic!("found {other:?}"),
    }
}

/// The reader's steps are those of the second interpreter, line by line.
fn assert_second_opinion(text: &[u8], program: &Program) {
    let expected = second_opinion(text);
    let lines: Vec<u32> = program.steps.iter().map(|step| step.line).collect();
    assert_eq!(lines, expected.iter().map(|(line, _)| *line).collect::<Vec<_>>());
    let mut position = [0; 3];
    for (step, (_, expected)) in program.steps.iter().zip(&expected) {
        assert_same_step(step, expected, &mut position);
    }
}

/// Reads `text`; if that is accepted, nothing in it may have been changed. Returns whether it was.
fn check(text: &[u8], seed: u64) -> bool {
    let outcome = catch_unwind(|| match gcode::read("mutant.ngc", text) {
        Ok(program) => {
            if is_plain(text) {
                assert_second_opinion(text, &program);
            }
            true
        }
        Err(error) => {
            let lines = text.split(|&byte| byte == b'\n').count();
            assert!(error.line >= 1 && error.line as usize <= lines && error.column >= 1, "{error}");
            assert!(
                error.to_string().contains("found ") && error.to_string().contains(", expected "),
                "{error}"
            );
            false
        }
    });
    outcome.unwrap_or_else(|_| panic!("seed {seed}, program:\n{}", String::from_utf8_lossy(text)))
}

// ---- samples
// -----------------------------------------------------------------------------------------------------

#[test]
fn samples_read_as_the_second_interpreter_reads_them() {
    for (name, text) in SAMPLES {
        let program = read(name, text);
        assert_second_opinion(text.as_bytes(), &program);
        assert!(program.steps.len() >= 9, "{name}");
        assert_eq!(program.steps.last().map(|step| step.kind), Some(StepKind::End), "{name}");
        let windows_ends = text.replace('\n', "\r\n");
        assert_eq!(read(name, &windows_ends), program, "{name}");
        assert_eq!(read(name, &format!("\u{feff}{text}")), program, "{name}");
    }
}

#[test]
fn text_after_the_end_is_noticed() {
    let program = read(SAMPLES[3].0, SAMPLES[3].1);
    let notice = program.notices.iter().find(|notice| notice.kind == NoticeKind::TextAfterEnd);
    assert_eq!(notice.map(|notice| notice.first_line), Some(20));
}

#[test]
fn near_coordinates_stay_apart() {
    let program = read("near", "G0 X7999.9999\nX8000.0001\nM2");
    let StepKind::Line(line) = program.steps[1].kind else { panic!("a line") };
    assert_eq!(line.from[0].to_string(), "7999.9999");
    assert_eq!(line.to[0].to_string(), "8000.0001");
}

#[test]
fn a_million_increments_land_exactly() {
    let text = format!("G91 G1 F100\n{}M2", "X.1 Z-0.1\n".repeat(1_000_000));
    let program = read("increments", &text);
    let StepKind::Line(last) = program.steps[999_999].kind else { panic!("a line") };
    assert_eq!(gcode::xyz_mm(last.to), [100_000.0, 0.0, -100_000.0]);
}

#[test]
fn a_dwell_names_its_seconds_and_an_arc_its_centre() {
    let program = read("zx", "G18 F60 G0 X3 Y1 Z10\nG4 P.25\nG2 X7 Z14 I4\nM2");
    assert_eq!(program.steps[1].kind, StepKind::Dwell { seconds: 0.25 });
    let StepKind::Arc(arc) = program.steps[2].kind else { panic!("an arc") };
    // Clockwise seen from +Y with Z to the right and X up: from below the centre over the left to Z+ is 3/4.
    assert_eq!(arc.centre_mm, [10.0, 7.0]);
    assert_near(arc.sweep_rad, -1.5 * PI, 1e-15, "sweep");
}

// ---- random programs
// ---------------------------------------------------------------------------------------------

fn number(random: &mut Random, mm_max: i64, decimals: u32) -> (i64, String) {
    let scale = 10_i64.pow(decimals);
    let value = random.below((2 * mm_max * scale + 1) as usize) as i64 - mm_max * scale;
    (value, decimal(value, decimals))
}

fn decimal(value: i64, decimals: u32) -> String {
    let scale = 10_u64.pow(decimals);
    let sign = if value < 0 { "-" } else { "" };
    let (whole, fraction) = (value.unsigned_abs() / scale, value.unsigned_abs() % scale);
    format!("{sign}{whole}.{fraction:0width$}", width = decimals as usize)
}

/// A word with blanks and case as people leave them.
fn written(random: &mut Random, letter: char, number: &str) -> String {
    let letter = if random.below(4) == 0 { letter.to_ascii_lowercase() } else { letter };
    let blanks = random.pick(&["", "", " ", "\t"]);
    let tail = random.pick(&[" ", "", " (c)", "(x1;)"]);
    format!("{letter}{blanks}{number}{tail}")
}

/// A line that is valid after any other.
fn random_line(random: &mut Random) -> String {
    let planes =
        [("G17", ['X', 'Y'], ['I', 'J']), ("G18", ['Z', 'X'], ['K', 'I']), ("G19", ['Y', 'Z'], ['J', 'K'])];
    let (plane, axes, offsets) = *random.pick(&planes);
    let direction = *random.pick(&["G2", "G3"]);
    match random.below(12) {
        11 => (*random.pick(&[
            "M3 S100",
            "M3",
            "S200.5",
            "M4 S50",
            "M5",
            "M7",
            "M8",
            "M7 M8 M3",
            "M9",
            "G0 X1 M5 M9",
            "M4 M8 S7",
        ]))
        .to_owned(),
        9 => {
            let mut line = "G17 G5 ".to_owned();
            for letter in ['X', 'I', 'Q', 'Y', 'J', 'P'] {
                let text = number(random, 20, 6).1;
                line += &written(random, letter, &text);
            }
            // Another one that continues it.
            let words = ['P', 'X', 'Q'].map(|letter| {
                let text = number(random, 9, 3).1;
                written(random, letter, &text)
            });
            format!("{line}\n{}", words.concat())
        }
        10 => {
            let [x, z] = ['X', 'Z'].map(|letter| {
                let text = number(random, 20, 4).1;
                written(random, letter, &text)
            });
            format!("G5.5 {x}\n{z}")
        }
        0 => (*random.pick(&["G21", "G20", "G91.1", "G61", "G64 P0.1", "", "(G5)", "; G5"])).to_owned(),
        1 => format!("F{}", 1 + random.below(10_000)),
        2 => format!("G4 P{}", decimal(random.below(100_000) as i64, 3)),
        3..=5 => {
            let mut line = format!("G{} {} ", random.below(2), random.pick(&["G90", "G91"]));
            for axis in ['X', 'Y', 'Z'] {
                let decimals = random.below(8) as u32;
                let text = number(random, 20, decimals).1;
                if random.below(2) == 0 {
                    line += &written(random, axis, &text);
                }
            }
            line
        }
        6 => {
            // A chord of at most 40 √2 and a radius of at least half of that.
            let ends = axes.map(|axis| {
                let text = decimal(1 + number(random, 19, 4).0.abs(), 4);
                written(random, axis, &text)
            });
            let sign = *random.pick(&["", "-"]);
            let radius = format!("{sign}{}", 29 + random.below(1000));
            let radius = written(random, 'R', &radius);
            format!("G91 {plane} {direction} {}{}{radius}", ends[0], ends[1])
        }
        7 => {
            // A quarter turn: the end is the offset turned by ±90°, exact in any decimals.
            let (a, text_a) = number(random, 20, 5);
            let (b, text_b) = number(random, 20, 5);
            if a == 0 && b == 0 {
                return String::new();
            }
            let counter = if direction == "G3" { 1 } else { -1 };
            // From the centre, the start is (−a, −b), turned ±(b, −a).
            let end = [a + counter * b, b - counter * a];
            let words = [
                written(random, offsets[0], &text_a),
                written(random, offsets[1], &text_b),
                written(random, axes[0], &decimal(end[0], 5)),
                written(random, axes[1], &decimal(end[1], 5)),
            ];
            format!("G91 {plane} {direction} {}", words.concat())
        }
        _ => {
            let letter = *random.pick(&offsets);
            let text = decimal(1 + random.below(900_000) as i64, 4);
            let offset = written(random, letter, &text);
            let normal =
                ['X', 'Y', 'Z'].into_iter().find(|axis| !axes.contains(axis)).expect("the third axis");
            let text = number(random, 5, 3).1;
            let height = written(random, normal, &text);
            format!("G91 {plane} {direction} {offset}{height}")
        }
    }
}

#[test]
fn random_valid_programs_are_read_as_written() {
    for case in 0..400 {
        let seed = seed().wrapping_add(case);
        let mut random = Random::new(seed);
        let mut text = "F100\n".to_owned();
        for _ in 0..60 {
            text += &random_line(&mut random);
            text += *random.pick(&["\n", "\r\n", " \n"]);
        }
        text += "M2\n";
        if let Err(error) = gcode::read("random.ngc", text.as_bytes()) {
            panic!("seed {seed}: {error}\n{text}");
        }
        assert!(check(text.as_bytes(), seed));
    }
}

// ---- mutations
// ---------------------------------------------------------------------------------------------------

fn mutate(text: &mut Vec<u8>, random: &mut Random) {
    const ALPHABET: &[u8] = b"GMXYZIJKRFPQSNTAGMXYZ0123456789012345..--+ \t();%/#[]\n\r\xb5\0";
    for _ in 0..1 + random.below(3) {
        if text.is_empty() {
            return;
        }
        let at = random.below(text.len());
        match random.below(7) {
            0 => text[at] = random.bits() as u8,
            1 | 2 => text[at] = *random.pick(ALPHABET),
            3 => drop(text.remove(at)),
            4 => text.insert(at, *random.pick(ALPHABET)),
            5 => {
                let line_start = text[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
                let line_end =
                    text[at..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |end| at + end + 1);
                let line = text[line_start..line_end].to_vec();
                if random.below(2) == 0 {
                    drop(text.drain(line_start..line_end));
                } else {
                    drop(text.splice(line_start..line_start, line));
                }
            }
            _ => {
                let other = random.below(text.len());
                text.swap(at, other);
            }
        }
    }
}

fn count_accepted_mutants(text: &[u8], count: u64, first_seed: u64) -> u64 {
    let seeds = (0..count).map(|case| first_seed.wrapping_add(case));
    let accepted = seeds.filter(|&seed| {
        let mut mutant = text.to_vec();
        mutate(&mut mutant, &mut Random::new(seed));
        check(&mutant, seed)
    });
    accepted.count() as u64
}

#[test]
fn mutants_are_refused_or_read_as_written() {
    for (name, text) in SAMPLES {
        let accepted = count_accepted_mutants(text.as_bytes(), 1000, seed());
        assert!((50..950).contains(&accepted), "{name}: {accepted} of 1000 accepted");
    }
}

#[test]
fn no_bytes_make_it_panic() {
    for case in 0..3000 {
        let seed = seed().wrapping_add(case);
        let mut random = Random::new(seed);
        let text: Vec<u8> = (0..random.below(300)).map(|_| random.bits() as u8).collect();
        check(&text, seed);
    }
}
