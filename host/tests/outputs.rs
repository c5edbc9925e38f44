//! Spindle and coolant in simulated runs: in order with motion, at rest, with their waits; what holds, aborts and
//! faults make of them; the same in a replay. The trace's rows are the oracle.

use motion_host::machine::{CoolantSettings, Machine, SpindleSettings};
use motion_host::recording::{self, Recorder, Recording};
use motion_host::simulate::inject::Injections;
use motion_host::simulate::live::Script;
use motion_host::simulate::{self, Job, Number, RunOptions, RunSummary, run_with};
use motion_host::trace::{RunEnd, TraceRow, TracedSwitch};
use motion_kernel::hal::{OutputState, Spindle};
use motion_tests::check::planned;

const START_S: f64 = 0.25;
const STOP_S: f64 = 0.1;

/// A cut with the spindle and coolant on, another one with the spindle off.
const PROGRAM: &str = "G21 G90 G61\nM3 S9000\nM8\nG1 X5 F1200\nM5\nG1 X8\nM9\nG1 X9\nM2\n";

fn machine() -> Machine {
    Machine {
        spindle: Some(SpindleSettings {
            speed_max_rpm: 1e4,
            start_s: START_S,
            stop_s: STOP_S,
            reverses: true,
        }),
        coolant: Some(CoolantSettings { flood: true, mist: false }),
        ..Machine::reference()
    }
}

/// A run, with its rows.
fn run(text: &str, options: &RunOptions<'_>) -> (RunSummary, Vec<TraceRow>) {
    let (machine, mut rows) = (machine(), Vec::new());
    let plan = planned(text, &machine).expect("a plan");
    let summary = run_with(options, &plan, &machine, &mut |row| rows.push(*row)).expect("a run");
    (summary, rows)
}

fn script(text: &str) -> Script {
    if text.is_empty() { Script::default() } else { text.parse().expect("a script") }
}

fn run_at(commands: &str) -> (RunSummary, Vec<TraceRow>) {
    let script = script(commands);
    run(PROGRAM, &RunOptions { script: Some(&script), ..RunOptions::default() })
}

/// Lines and states of the switches.
fn switched(outputs: &[TracedSwitch]) -> Vec<(Option<u32>, OutputState)> {
    outputs.iter().map(|switch| (switch.line, switch.to)).collect()
}

/// What [`PROGRAM`] switches.
fn expected() -> [(Option<u32>, OutputState); 4] {
    let on = OutputState { spindle: Spindle::Clockwise, speed_rpm: 9000.0, ..OutputState::OFF };
    let flood = OutputState { flood: true, ..OutputState::OFF };
    [
        (Some(2), on),
        (Some(3), OutputState { flood: true, ..on }),
        (Some(5), flood),
        (Some(7), OutputState::OFF),
    ]
}

/// Ticks that do not rest, of the moves of a line.
fn moving(rows: &[TraceRow], line: u32) -> (u64, u64) {
    let mut ticks = rows.iter().filter(|row| row.line == line && row.v_mm_s > 0.0).map(|row| row.tick);
    let first = ticks.next().expect("it moves");
    (first, ticks.next_back().expect("for a while"))
}

/// The switches of a run of [`PROGRAM`] come between the moves, and motion waits for the spindle.
fn assert_in_order(summary: &RunSummary, rows: &[TraceRow], what: &str) {
    assert_eq!(switched(&summary.outputs), expected(), "{what}");
    let [on, coolant_on, off, coolant_off] = [0, 1, 2, 3].map(|index: usize| summary.outputs[index].tick);
    let [start_ticks, stop_ticks] = [START_S, STOP_S].map(|s| (s / summary.tick_s).round() as u64);
    let [cut, still, last] = [4, 6, 8].map(|line| moving(rows, line));
    // The first moving tick ends with motion in it.
    assert!(on + start_ticks <= cut.0 && coolant_on >= on + start_ticks, "{what}: {on} {coolant_on} {cut:?}");
    assert!(cut.1 < off && off + stop_ticks <= still.0, "{what}: {cut:?} {off} {still:?}");
    assert!(still.1 < coolant_off && coolant_off <= last.0, "{what}: {still:?} {coolant_off} {last:?}");
    // At rest at the end of the block, exactly.
    for (tick, x_mm) in [(on, 0.0), (coolant_on, 0.0), (off, 5.0), (coolant_off, 8.0)] {
        let row = rows.iter().rfind(|row| row.tick < tick);
        let at_mm = row.map_or(0.0, |row| row.axes[0].set_mm);
        assert!((at_mm - x_mm).abs() < 1e-9, "{what}: switched at {at_mm}");
    }
}

#[test]
fn they_switch_in_order_with_motion_at_rest_and_motion_waits() {
    let live = Script::default();
    for number in [Number::F32, Number::F64, Number::Fixed] {
        for script in [None, Some(&live)] {
            let (summary, rows) = run(PROGRAM, &RunOptions { number, script, ..RunOptions::default() });
            let what = format!("{number:?}, live {}", script.is_some());
            assert_eq!(summary.end, RunEnd::Finished);
            assert_in_order(&summary, &rows, &what);
            // A tick for the fraction at the end of each stretch and dwell, at most.
            let late_s = summary.time_s - summary.planned_time_s;
            assert!(late_s.abs() <= 6.0 * summary.tick_s, "{what}: {late_s}");
            // Three waits for the spindle are no more: M8 and M9 have none.
            let rest = rows.iter().filter(|row| row.state == "dwell").count() as f64 * summary.tick_s;
            assert!((rest - START_S - STOP_S).abs() <= 3.0 * summary.tick_s, "{what}: {rest}");
        }
    }
}

/// Held before a switch, in the wait behind it and in the cut: nothing switches under the hold, and all come in order.
#[test]
fn a_hold_leaves_them_as_they_are() {
    let (_, rows) = run_at("");
    let (first, last) = moving(&rows, 4);
    for hold in [1, 100, first + 1, first.midpoint(last), last, last + 1, last + 50] {
        let resume = hold + 3000;
        let (summary, rows) = run_at(&format!("{hold}:hold,{resume}:resume"));
        assert_eq!(summary.end, RunEnd::Finished);
        assert_in_order(&summary, &rows, &format!("held before {hold}"));
        let stop = summary.commands[0].stop.as_ref().map_or(0.0, |stop| stop.time_s);
        let rest = hold + (stop / summary.tick_s).ceil() as u64;
        let under = summary.outputs.iter().filter(|switch| (rest + 1..resume).contains(&switch.tick)).count();
        assert_eq!(under, 0, "held before {hold}: {:?}", summary.outputs);
    }
}

#[test]
fn single_block_runs_a_switch_with_its_wait() {
    let resumes: Vec<String> = (1..12).map(|index| format!("{}:resume", index * 2000)).collect();
    let (summary, rows) = run_at(&format!("0:single,{}", resumes.join(",")));
    assert_eq!(summary.end, RunEnd::Finished);
    assert_in_order(&summary, &rows, "single block");
    // After a resume, not when the block before has ended.
    for switch in &summary.outputs[2..] {
        assert!(switch.tick % 2000 <= 2, "{switch:?}");
    }
}

/// An abort at any time ends with all off, once motion rests.
#[test]
fn an_abort_switches_all_off_at_rest() {
    let (_, rows) = run_at("");
    let (first, last) = moving(&rows, 4);
    for tick in [200, first + 10, first.midpoint(last), last, last + 30] {
        let (summary, rows) = run_at(&format!("{tick}:abort"));
        assert_eq!(summary.end, RunEnd::Aborted);
        let off = summary.outputs.last().expect("an end");
        assert_eq!((off.line, off.to), (None, OutputState::OFF), "{tick}: {:?}", summary.outputs);
        let moves = rows.iter().rfind(|row| row.v_mm_s > 0.0).map_or(0, |row| row.tick);
        assert!(off.tick > moves && off.tick >= tick, "{tick}: {off:?} {moves}");
    }
    // What is not on is not switched off.
    let (summary, _) = run_at("0:abort");
    assert_eq!((summary.end, summary.outputs), (RunEnd::Aborted, vec![]));
}

/// Right after the tick that finds it, in every kind of reaction, and for good.
#[test]
fn a_fault_switches_all_off_at_once() {
    let (_, rows) = run_at("");
    let (first, last) = moving(&rows, 4);
    // In the cut, and while motion waits for the spindle: what is due after that is not switched any more.
    for (tick, text) in [first.midpoint(last), 100]
        .into_iter()
        .flat_map(|tick| ["emergency-stop", "drive-fault=X", "limit-high=X:-1"].map(|text| (tick, text)))
        .chain([(first.midpoint(last), "encoder-lost=X")])
    {
        for live in [false, true] {
            let injections: Injections = format!("{tick}:{text}").parse().expect("an injection");
            let script = script("");
            let script = live.then_some(&script);
            let options = RunOptions { script, injections: Some(&injections), ..RunOptions::default() };
            let (summary, _) = run(PROGRAM, &options);
            let what = format!("{tick}:{text}, live {live}: {:?}", summary.outputs);
            assert_eq!(summary.end, RunEnd::Faulted, "{what}");
            let (fault, on) = (summary.faults[0].tick, summary.outputs.len() - 1);
            assert_eq!(switched(&summary.outputs[..on]), expected()[..on], "{what}");
            let off = summary.outputs[on];
            assert_eq!((off.tick, off.line, off.to), (fault + 1, None, OutputState::OFF), "{what}");
        }
    }
}

/// A recording runs again to the same switches; one whose program switches something else is found out.
#[test]
fn a_replay_switches_the_same() {
    let machine = machine();
    let plan = planned(PROGRAM, &machine).expect("a plan");
    for commands in [None, Some(script("900:hold,1500:resume,1600:abort"))] {
        let options = RunOptions { script: commands.as_ref(), ..RunOptions::default() };
        let job = Job::new(&options, &plan, &machine).expect("a job");
        let (summary, recording) = simulate::on_simulated(&machine, None, |hardware| {
            let mut recorder = Recorder::new(hardware);
            let summary = simulate::run_on(&job, &mut recorder, &mut |_| {})?;
            Ok((summary, recorder.finish(&job)))
        })
        .expect("a run");
        assert!(summary.outputs.len() >= 3);
        let recording = Recording::<3>::from_bytes(&recording.to_bytes()).expect("a recording");
        let mut job = recording.job().clone();
        let replay = recording::replay(&recording, &job, &mut |_| {}).expect("a replay");
        assert_eq!((replay.difference, &replay.summary.outputs), (None, &summary.outputs));
        for item in &mut job.items {
            if let motion_kernel::program::Item::Switch(to) = item {
                to.speed_rpm += 1.0;
            }
        }
        let other = recording::replay(&recording, &job, &mut |_| {}).expect("a replay");
        assert!(other.difference.is_some());
    }
}

/// What the machine's outputs can't do is refused with its line; without the tables it is no part of the plan.
#[test]
fn plans_refuse_what_outputs_cannot_do() {
    let refusal = |text: &str, machine: &Machine| match planned(text, machine) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("{text}: planned"),
    };
    let mut machine = machine();
    for (text, message) in [
        (
            "G0 X1\nM3 S10001\nM2",
            ":2: found a spindle speed of 10001 rev/min, expected at most speed_max_rpm = 10000",
        ),
        ("M3 S9\nS20000\nM2", ":2: found a spindle speed of 20000 rev/min"),
        ("M8\nM7\nM2", ":2: found M7, expected coolant of the kind that [coolant] of the machine file has"),
        ("G96 S100\nM3\nM2", ":2: found a spindle turning after G96"),
        ("M3 S100\nG96 S100\nM2", ":2: found a spindle turning after G96"),
    ] {
        assert!(refusal(text, &machine).contains(message), "{text}: {}", refusal(text, &machine));
    }
    // It does not turn.
    assert!(planned("S20000\nG96 S100\nG97 S0\nM5\nM2", &machine).is_ok());
    assert!(planned("M4 S10000\nM2", &machine).is_ok());
    machine.spindle = machine.spindle.map(|spindle| SpindleSettings { reverses: false, ..spindle });
    assert!(refusal("M4\nM2", &machine).contains(":1: found M4, expected M3"));
    let plan = planned("M4 S1e6\nM7\nG96 S1\nM2".replace("1e6", "999999").as_str(), &Machine::reference());
    let plan = plan.expect("a plan");
    assert!(plan.items.is_empty() && plan.time_s == 0.0 && plan.notices.len() == 4, "{:?}", plan.notices);
    // The words that a machine acts on are not noticed, the others are.
    let plan = planned("G61 M3 S9\nM8\nG0 X1\nM2", &Machine { coolant: None, ..machine }).expect("a plan");
    assert_eq!(plan.notices, ["line 2: M7, M8, M9 are not acted on: there is no coolant"]);
}

/// Spindle and coolant break no blends and no splines where the machine has none.
#[test]
fn without_outputs_a_plan_is_that_of_the_moves() {
    let text = "F900 G64 P0.1\nG1 X5\nM3 S100\nX6 Y5\nM8\nX9\nG5.5 X10 Y1\nX11\nM5\nX12 Y1\nX13\nX14 Y3\nM9\nX15\nM2";
    let moves: String =
        text.lines().filter(|line| !line.starts_with('M')).map(|line| format!("{line}\n")).collect();
    let [with, without] = [text, &moves].map(|text| planned(text, &Machine::reference()).expect("a plan"));
    assert_eq!(with.time_s, without.time_s);
    assert_eq!(with.blocks.len(), without.blocks.len());
    // A machine that has them stops, and a spline may not be cut in two so short.
    let cut = planned(text, &machine()).expect_err("too few points").to_string();
    assert!(cut.contains(":7: "), "{cut}");
    let [text, moves] = [text, &moves].map(|text| text.split("G5.5").next().expect("a part").to_owned());
    let [with, without] = [text, moves].map(|text| planned(&text, &machine()).expect("a plan"));
    assert!(with.time_s > without.time_s + START_S);
}
