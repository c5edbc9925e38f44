//! What reading G-code takes: lines a second on one core, and the memory of the steps.
//!
//! ```text
//! cargo bench -p motion-tests --bench reading
//! ```
//!
//! The programs have a million lines each. The table gives the best of some rounds. A name, or a part of one, selects
//! programs.

use std::fmt::Write;
use std::hint::black_box;
use std::time::Instant;

use motion_host::gcode::{self, Program, Step};
use motion_tests::bench;
use motion_tests::random::Random;

const LINES: usize = 1_000_000;
const ROUNDS: usize = 5;

fn main() {
    let Some(asked) = bench::asked() else { return };
    println!("| {LINES} lines | lines a second | steps, bytes a line |");
    println!("|---|---:|---:|");
    let mut random = Random::new(18);
    let programs: [(&str, String); 4] = [
        (
            "points: X and Y",
            text(|_, line| {
                let [x, y] = [(); 2].map(|()| random.between(0.0, 100.0));
                write!(line, "X{x:.4} Y{y:.4}")
            }),
        ),
        (
            "as a post writes: N G1 X Y Z F",
            text(|index, line| {
                let index = index % 1000;
                write!(line, "N{} G1 X{index}.125 Y-{index}.5 Z{}.0625 F1200.", 10 * index, index % 7)
            }),
        ),
        (
            "arcs: G2 X Y I J",
            text(|index, line| {
                let side = if index % 2 == 0 { 10 } else { 0 };
                write!(line, "G2 X{side}. Y0. I{}. J0.", if side == 0 { -5 } else { 5 })
            }),
        ),
        (
            "expressions: X[#1*COS[…]+#<r>] Y[#1*SIN[…]-#2/2]",
            text(|index, line| {
                let angle = index % 360;
                write!(line, "X[#1*COS[{angle}]+#<r>] Y[#1*SIN[{angle}]-#2/2]")
            }),
        ),
    ];
    for (name, text) in &programs {
        if !asked.is_empty() && !asked.iter().any(|part| name.contains(part.as_str())) {
            continue;
        }
        let mut least_s = f64::INFINITY;
        let mut bytes = 0;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            let program: Program = gcode::read("bench.ngc", black_box(text.as_bytes())).expect("a program");
            least_s = least_s.min(start.elapsed().as_secs_f64());
            bytes = program.steps.capacity() * size_of::<Step>();
        }
        println!("| {name} | {:.0} | {} |", LINES as f64 / least_s, bytes / LINES);
    }
}

/// A program of so many lines.
fn text(mut line: impl FnMut(usize, &mut String) -> std::fmt::Result) -> String {
    let mut text = String::from("G21 G90 G1 F1000\n#1=10 #2=3 #<r>=4\n");
    for index in 0..LINES {
        line(index, &mut text).expect("memory");
        text.push('\n');
    }
    text.push_str("M2\n");
    text
}
