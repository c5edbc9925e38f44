//! The G-code interpreter, driven by bytes.
//!
//! Any bytes are a switch for what the program is read with, and its text: a byte below 128 is itself, every other one a word
//! of the dialect. [`read()`] reads it within small bounds and panics where a promise is broken:
//!
//! - nothing panics, overflows or goes on for ever: lines, steps and messages stay within their bounds;
//! - every move begins where the one before ended, and its numbers are finite;
//! - what is refused has a place.

use motion_host::gcode::{
    self, Axis, Feed, GcodeError, ORIGIN, ParameterFile, Program, ReadOptions, SpindleSpeed, StepKind,
    ToolTable,
};
use motion_host::machine::Machine;
use motion_host::touch::{Surface, TouchBox};

/// Most lines to execute.
const LINES_MAX: u64 = 2000;
/// Most steps, and messages.
const STEPS_MAX: usize = 3000;

/// What a byte from 128 on stands for; those that are missing are the end of a line.
const WORDS: [&str; 116] = [
    "\n",
    "\n",
    "\n",
    "\n",
    "\n",
    "\n",
    "\n",
    "\n",
    "G0 ",
    "G1 ",
    "G2 ",
    "G3 ",
    "G4 P1 ",
    "G5 ",
    "G5.2 ",
    "G5.3 ",
    "G5.5 ",
    "G6.2 ",
    "G7 ",
    "G8 ",
    "G10 L2 ",
    "G10 L20 ",
    "G10 L1 ",
    "G10 L11 ",
    "G17 ",
    "G18 ",
    "G19 ",
    "G20 ",
    "G21 ",
    "G28 ",
    "G28.1 ",
    "G30 ",
    "G38.2 ",
    "G38.3 ",
    "G38.4 ",
    "G38.5 ",
    "G40 ",
    "G41 ",
    "G42 ",
    "G41.1 ",
    "G42.1 ",
    "G43 ",
    "G43.1 ",
    "G43.2 ",
    "G49 ",
    "G52 ",
    "G53 ",
    "G54 ",
    "G59.3 ",
    "G61 ",
    "G61.1 ",
    "G64 ",
    "G73 ",
    "G80 ",
    "G81 ",
    "G82 ",
    "G83 ",
    "G85 ",
    "G89 ",
    "G90 ",
    "G91 ",
    "G90.1 ",
    "G91.1 ",
    "G92 ",
    "G92.1 ",
    "G92.3 ",
    "G93 ",
    "G94 ",
    "G95 ",
    "G96 ",
    "G98 ",
    "G99 ",
    "M0 ",
    "M2 ",
    "M3 ",
    "M6 ",
    "M61 Q1 ",
    "M66 P0 ",
    "M70 ",
    "M72 ",
    "M73 ",
    "M98 P1 ",
    "M99 ",
    "F100 ",
    "S500 ",
    "T1 ",
    "H2 ",
    "D2 ",
    "R5 ",
    "Q1 ",
    "P1 ",
    "L2 ",
    "X10 ",
    "Y-4 ",
    "Z-12 ",
    "I3 ",
    "J2 ",
    "K1 ",
    "@5 ",
    "^45 ",
    "o1 sub\n",
    "o1 endsub\n",
    "o1 call [1] ",
    "o2 while [#1 lt 9]\n",
    "o2 endwhile\n",
    "o3 if [#1 gt 2]\n",
    "o3 else\n",
    "o3 endif\n",
    "o4 repeat [3]\n",
    "o4 endrepeat\n",
    "#1=[#1+1] ",
    "#<_x> ",
    "A30 ",
    "B-9 ",
    "U2 ",
    "W-1 ",
];

/// Reads what `bytes` say. Whether it was accepted.
///
/// # Panics
/// The interpreter breaks a promise.
#[must_use]
pub fn read(bytes: &[u8]) -> bool {
    let (&switches, bytes) = bytes.split_first().unwrap_or((&0, &[]));
    let mut text = Vec::new();
    for &byte in bytes {
        match byte.checked_sub(128) {
            None => text.push(byte),
            Some(word) => text.extend(WORDS.get(usize::from(word)).unwrap_or(&"\n").bytes()),
        }
    }
    let options = options(switches);
    let outcome = gcode::read_with("a.ngc", &text, &options);
    let refusals = gcode::refusals("a.ngc", &text, &options);
    assert_eq!(refusals.is_empty(), outcome.is_ok(), "{refusals:?}");
    refusals.iter().for_each(|refusal| assert_placed(&refusal.first, &text));
    match &outcome {
        Ok(program) => assert_sound(program, STEPS_MAX),
        Err(error) => assert_placed(error, &text),
    }
    outcome.is_ok()
}

/// What a program is read with, a bit for each.
fn options(switches: u8) -> ReadOptions {
    let is_on = |bit: u8| switches >> bit & 1 == 1;
    let mut machine = Machine::reference();
    machine.probe = is_on(0).then(|| Surface {
        boxes: vec![TouchBox { low_mm: [-50.0, -50.0, -40.0], high_mm: [50.0, 50.0, -5.0] }],
    });
    let table = "T1 Z12 D4\nT2 X3 Z-4 D1.6 Q2\nT3 Z50 D-1\n";
    let parameters = "5220 2\n5221 7.5\n5230 30\n5211 1\n5210 1\n5241 -3\n5163 20\n";
    let letters = ["XYZ", "XZ", "XYZA", "XYZABCUVW"][usize::from(switches >> 5 & 3)];
    ReadOptions {
        axes: letters.bytes().filter_map(Axis::of_letter).collect(),
        tools: is_on(1).then(|| ToolTable::parse("tool.tbl", table.as_bytes()).expect("a table")),
        parameters: match is_on(2) {
            true => ParameterFile::parse("a.var", parameters.as_bytes()).expect("parameters"),
            false => ParameterFile::default(),
        },
        block_delete: is_on(3),
        optional_stop: is_on(4),
        lines_max: LINES_MAX,
        steps_max: STEPS_MAX,
        ..machine.read_options()
    }
}

/// Steps and messages are within their bound; every move begins where the one before ended, and its numbers are finite.
///
/// # Panics
/// They are not.
pub fn assert_sound(program: &Program, steps_max: usize) {
    assert!(program.steps.len() <= steps_max && program.messages.len() <= steps_max);
    let mut at = ORIGIN;
    for step in &program.steps {
        let (ends, feed, numbers) = match &step.kind {
            StepKind::Line(line) => {
                assert_ne!(line.from, line.to, "line {} goes nowhere", step.line);
                ((line.from, line.to), line.feed, Vec::new())
            }
            StepKind::Arc(arc) => {
                assert!(arc.start_radius_mm > 0.0 && arc.end_radius_mm > 0.0 && arc.sweep_rad.abs() > 0.0);
                let radii = [arc.start_radius_mm, arc.end_radius_mm, arc.sweep_rad, arc.turn_deg];
                ((arc.from, arc.to), arc.feed, [&arc.centre_mm[..], &radii].concat())
            }
            StepKind::Cubic(curve) => ((curve.from, curve.to), curve.feed, curve.controls_mm.concat()),
            StepKind::Through(point) => {
                assert_ne!(point.from, point.to, "line {} goes nowhere", step.line);
                ((point.from, point.to), point.feed, Vec::new())
            }
            StepKind::Nurbs(curve) => {
                let nurbs = program.nurbs.get(curve.curve).expect("a curve");
                assert_eq!(nurbs.points_mm.len(), nurbs.weights.len());
                assert_eq!(nurbs.knots.len(), nurbs.points_mm.len() + nurbs.degree + 1);
                let numbers = [nurbs.points_mm.concat(), nurbs.weights.clone(), nurbs.knots.clone()];
                ((curve.from, curve.to), curve.feed, numbers.concat())
            }
            StepKind::Probe(probe) => ((probe.from, probe.to), probe.feed, Vec::new()),
            StepKind::Dwell { seconds } => {
                assert!(seconds.is_finite() && *seconds >= 0.0, "line {}: {seconds} s", step.line);
                continue;
            }
            StepKind::Switch(outputs) => {
                let (SpindleSpeed::Rpm(speed) | SpindleSpeed::Surface(speed)) = outputs.speed;
                assert!(speed.is_finite() && speed >= 0.0, "line {}: {speed}", step.line);
                continue;
            }
            StepKind::ToolChange { .. } | StepKind::Stop | StepKind::End => continue,
        };
        let (from, to) = ends;
        for axis in Axis::ALL.into_iter().filter(|&axis| !program.axes.contains(axis)) {
            assert_eq!(from[axis.index()], to[axis.index()], "line {} moves {axis}", step.line);
        }
        assert_eq!(from, at, "line {} begins elsewhere", step.line);
        assert!(numbers.iter().all(|number| number.is_finite()), "line {}: {:?}", step.line, step.kind);
        if let Feed::MmPerMin(feed_mm_min) = feed {
            assert!(feed_mm_min.is_finite() && feed_mm_min > 0.0, "line {}: {feed_mm_min}", step.line);
        }
        at = to;
    }
}

/// The error stands at a place of the text.
///
/// # Panics
/// It does not.
pub fn assert_placed(error: &GcodeError, text: &[u8]) {
    let lines = text.split(|&byte| byte == b'\n').count();
    assert!(error.line >= 1 && error.line as usize <= lines && error.column >= 1, "{error}");
}
