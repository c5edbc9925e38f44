//! Recordings that are not what they were.

use motion_kernel::hal::{AxisInputs, MachineInputs, OutputState};
use motion_kernel::law::{PlannedRamp, Ramp, Ticks};
use motion_kernel::program::{Allowed, Item, PathBlock};
use motion_kernel::units::Position;

use super::answers::{AnswerWriter, Answers};
use super::*;
use crate::gcode;
use crate::machine::Machine;
use crate::planning::{Mode, plan_program};
use crate::simulate::live::Script;
use crate::simulate::{self, RunOptions};
use crate::trace::TraceRow;

const PROGRAM: &str = "G21 G90 G61\nG1 X3 F600\nG1 X3 Y2\nG4 P0.05\nG1 X0 Y0 F2000\nM2\n";

fn recorded(number: Number) -> Recording {
    let machine = Machine::reference();
    let program = gcode::read("part.ngc", PROGRAM.as_bytes()).expect("G-code");
    let plan = plan_program("part.ngc", &program, &machine, Mode::Spanning).expect("a plan");
    let script: Script = "300:hold,700:resume,900:override=0.5".parse().expect("a script");
    let options = RunOptions { number, script: Some(&script), ..RunOptions::default() };
    let job = Job::new(&options, &plan, &machine).expect("a job");
    simulate::on_simulated(&machine, None, |hardware| {
        let mut recorder = Recorder::new(hardware);
        simulate::run_on(&job, &mut recorder, &mut |_: &TraceRow| ())?;
        Ok(recorder.finish(&job))
    })
    .expect("a run")
}

fn replayed(recording: &Recording) -> Replay {
    replay(recording, recording.job(), &mut |_: &TraceRow| ()).expect("a replay")
}

/// The recorded answers with the answers of one tick changed; its check bytes are those of the run.
fn tampered(recording: &Recording, tick: u64, change: impl Fn(&mut Answers)) -> Recording {
    let mut writer = AnswerWriter::new(recording.start);
    for (index, (mut answers, check)) in recording.answers.read(recording.start).enumerate() {
        if index as u64 == tick {
            change(&mut answers);
        }
        writer.add(&answers, check);
    }
    Recording { answers: writer.finish(recording.digest()), ..recording.clone() }
}

#[test]
fn one_count_off_is_found_in_its_tick() {
    for number in [Number::F32, Number::F64, Number::Fixed] {
        let recording = recorded(number);
        assert_eq!(replayed(&recording).difference, None);
        let (mut in_its_tick, mut later) = (0, 0);
        for tick in (0..recording.ticks()).step_by(37) {
            for axis in 0..3 {
                let changed = tampered(&recording, tick, |answers| {
                    answers.counts.as_mut().expect("read")[axis].0 += 1;
                });
                match replayed(&changed).difference {
                    Some(Difference::Tick { tick: found }) if found == tick => in_its_tick += 1,
                    // One in 256 agrees by chance.
                    Some(Difference::Tick { tick: found }) if found > tick && found < tick + 4 => later += 1,
                    // Of the last tick, the digest alone is left.
                    Some(Difference::Digest { .. }) if tick + 1 == recording.ticks() => later += 1,
                    other => panic!("tick {tick}, axis {axis}: {other:?}"),
                }
            }
        }
        assert!(in_its_tick > 100 && later <= in_its_tick / 50, "{in_its_tick} and {later}");
    }
}

#[test]
fn what_the_drives_were_told_and_inputs_are_compared() {
    let recording = recorded(Number::F32);
    let at = |tick: u64, told| tampered(&recording, tick, |answers| answers.told = told);
    let found = |recording: &Recording| replayed(recording).difference;
    assert_eq!(found(&at(0, None)), Some(Difference::Tick { tick: 0 }));
    assert_eq!(found(&at(0, Some((false, true)))), Some(Difference::Tick { tick: 0 }));
    assert_eq!(found(&at(5, Some((true, true)))), Some(Difference::Tick { tick: 5 }));
    // The emergency stop is a fault in its tick, whatever the check bytes say.
    let stopped = tampered(&recording, 200, |answers| {
        answers.inputs.as_mut().expect("read").emergency_stop = true;
    });
    let stopped = replayed(&stopped);
    assert_eq!(stopped.difference, Some(Difference::Tick { tick: 200 }));
    assert_eq!(
        (stopped.summary.faults[0].fault.as_str(), stopped.summary.faults[0].tick),
        ("emergency stop", 200)
    );
    // Drives that do not obey are a fault, which the run had not.
    let fault = replayed(&at(0, Some((true, false))));
    assert_eq!(fault.difference, Some(Difference::Tick { tick: 0 }));
    assert_eq!(fault.summary.faults[0].fault, "enable");
}

#[test]
fn a_replay_that_is_longer_or_shorter_says_so() {
    let recording = recorded(Number::F64);
    let ticks = recording.ticks();
    let of = |count: u64| {
        let mut writer = AnswerWriter::new(recording.start);
        let all = recording.answers.read(recording.start);
        let last = all.clone().last();
        for (answers, check) in all.chain(last).take(count as usize) {
            writer.add(&answers, check);
        }
        Recording { answers: writer.finish(recording.digest()), ..recording.clone() }
    };
    let shorter = of(100);
    let Replay { difference, ticks: made, .. } = replayed(&shorter);
    assert_eq!((difference, made), (Some(Difference::Longer { ticks: 100 }), 100));

    let longer = of(ticks + 1);
    let difference = replayed(&longer).difference;
    assert_eq!(difference, Some(Difference::Shorter { ticks, expected: ticks + 1 }));

    let mut other = recording.clone();
    other.answers.digest = 7;
    let expected = Difference::Digest { found: recording.digest(), expected: 7 };
    assert_eq!(replayed(&other).difference, Some(expected));
}

/// Counts as far apart as they can be, and every combination of failures.
#[test]
fn recorded_answers_read_what_was_written() {
    let ends = [0, 1, -1, i64::MAX, i64::MIN, 1 << 40];
    let stopped = MachineInputs { emergency_stop: true, ..MachineInputs::HEALTHY };
    let mut reached = MachineInputs::HEALTHY;
    reached.axes = [0, 31, 5].map(AxisInputs::from_bits);
    let inputs = [Some(MachineInputs::HEALTHY), None, Some(stopped), Some(stopped), Some(reached)];
    let tellings = [None, Some((true, true)), Some((true, false)), Some((false, true)), Some((false, false))];
    let mut all = Vec::new();
    for (a, b) in ends.iter().flat_map(|a| ends.map(|b| (*a, b))) {
        for (is_written, told) in [false, true].into_iter().flat_map(|is| tellings.map(|told| (is, told))) {
            let counts = (all.len() % 3 != 0).then_some([Counts(a), Counts(b), Counts(a ^ b)]);
            let inputs = inputs[all.len() * 7 / 3 % inputs.len()];
            all.push(Answers { counts, inputs, is_written, told });
        }
    }
    let start = [Counts(i64::MIN), Counts(5), Counts(i64::MAX)];
    let mut writer = AnswerWriter::new(start);
    for (index, answers) in all.iter().enumerate() {
        writer.add(answers, index as u8);
    }
    let recorded = writer.finish(0);
    recorded.check::<3>().expect("entries");
    for (index, (read, written)) in recorded.read(start).zip(&all).enumerate() {
        assert_eq!(read, (*written, index as u8));
    }
}

/// A field more or less of what the kernel consumes is another format, and needs another version.
#[test]
fn the_format_has_these_lengths() {
    let Job { header, guards, compensation, .. } = recorded(Number::F32).job;
    let still = [Position::ZERO; 3];
    let limits = Machine::reference().path.limits();
    let allowed = Allowed { cap_mm_s: 1.0, limits };
    let ramp = Ramp::cruise(1.0, 1.0);
    let items = [
        Item::Line { line: 1, start: still, direction: [1.0, 0.0, 0.0], length: Position::ZERO },
        Item::Septic { line: 1, start: still, coefficients: [[0.0; 7]; 3], length: Position::ZERO },
        Item::Feed(PlannedRamp { ramp, length: Position::ZERO }),
        Item::EndOfStretch(still),
        Item::Dwell(Ticks::ONE),
        Item::Stop,
        Item::Switch(OutputState::OFF),
        Item::Block(PathBlock::new(Position::ZERO, 1.0, allowed, allowed, 0.0)),
    ];
    let length = |bytes: postcard::Result<Vec<u8>>| bytes.expect("figures").len();
    let found = (
        length(postcard::to_stdvec(&header)),
        length(postcard::to_stdvec(&guards)),
        length(postcard::to_stdvec(&compensation)),
        items.map(|item| length(postcard::to_stdvec(&item))),
    );
    assert_eq!((VERSION, found), (6, (360, 206, 3, [30, 174, 51, 4, 6, 1, 12, 82])));
}

#[test]
fn strangers_are_named() {
    let message = |bytes: &[u8]| Recording::<3>::from_bytes(bytes).expect_err("no recording").to_string();
    let bytes = recorded(Number::F32).to_bytes();
    assert_eq!(message(b""), "found nothing, expected a recording, which begins with MREC");
    assert_eq!(
        message(b"G1 X10\nM2\n"),
        "found \"G1 X10\\nM2\\n\" at its start, expected a recording, which begins with MREC"
    );
    let mut newer = bytes.clone();
    newer[4] = 9;
    assert_eq!(message(&newer), "found a recording of format 9, expected format 6");
    assert!(message(&bytes[..bytes.len() - 1]).contains("damaged or not whole"));

    // With a checksum that fits.
    let sealed =
        |recording: &Recording| Recording::<3>::from_bytes(&recording.to_bytes()).expect_err("refused");
    let recording = recorded(Number::F32);
    let mut refused = recording.clone();
    refused.job.items.retain(|item| !matches!(item, Item::Line { .. }));
    assert!(matches!(sealed(&refused), RecordingError::Check(_)));
    let mut crowded = recording.clone();
    crowded.job.info.axes.push(recording.job.info.axes[0].clone());
    let found = "4 axes on 3 places".to_owned();
    assert_eq!(sealed(&crowded), RecordingError::Malformed(found));
    let mut missing = recording.clone();
    missing.answers.ticks += 1;
    assert!(matches!(sealed(&missing), RecordingError::Malformed(_)));
    let mut trailing = recording.to_bytes();
    trailing.truncate(trailing.len() - 4);
    trailing.push(0);
    trailing.extend(Checksum::of(&trailing).to_le_bytes());
    assert!(message(&trailing).contains("1 bytes too many"), "{}", message(&trailing));
}
