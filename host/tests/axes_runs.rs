//! Runs of machines of other axes than X, Y and Z: in every number type, in records, by name.

use motion_host::axis_unit::AxisUnit;
use motion_host::gcode::Axis;
use motion_host::machine::{AxisSettings, Machine, REFERENCE_TOML};
use motion_host::recording::{self, Recorder, Recording, RecordingError};
use motion_host::report;
use motion_host::simulate::home::Homes;
use motion_host::simulate::inject::Injections;
use motion_host::simulate::jog::{Ended, Keys, Press};
use motion_host::simulate::live::Script;
use motion_host::simulate::session::Session;
use motion_host::simulate::{self, Job, Number, RunInfo, RunSummary, hardware};
use motion_host::trace::{RunEnd, RunTrace, TraceRow};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::Item;
use motion_kernel::straight::Straight;
use motion_kernel::units::Position;

use super::cli::workspace::{Workspace, assert_has, number};

const FEED_MM_S: f64 = 40.0;

/// A machine of axes of these letters, each like the reference machine's X.
fn machine<const N: usize>(letters: &str) -> Machine<N> {
    let Machine { name, tick_s, path, axes: [x, ..], faults, tool, probe, spindle, coolant } =
        Machine::reference();
    let mut letters = letters.bytes().map(|letter| Axis::of_letter(letter).expect("a letter"));
    let axes = core::array::from_fn(|_| match letters.next() {
        Some(letter) => AxisSettings { letter: Some(letter), name: letter.to_string(), ..x.clone() },
        None => AxisSettings::idle(),
    });
    Machine { name, tick_s, path, axes, faults, tool, probe, spindle, coolant }
}

/// Straight moves from the origin through `points`, from rest to rest.
fn moves<const N: usize>(machine: &Machine<N>, points_mm: &[[f64; N]]) -> Vec<Item<N>> {
    let place = |point: &[f64; N]| point.map(|mm| Position::from_mm(mm).expect("in range"));
    let mut from = [Position::ZERO; N];
    let mut items = Vec::new();
    for to in points_mm.iter().map(place) {
        let (pulse, limits) = (machine.path.pulse, machine.path.limits());
        let straight = Straight::new(from, to, pulse, limits, [FEED_MM_S; 2], machine.tick_s);
        items.extend(straight.expect("a move").map(|item| item.unwrap_or_else(|never| match never {})));
        from = to;
    }
    items
}

/// A job of such moves.
fn job<const N: usize>(machine: &Machine<N>, number: Number, points_mm: &[[f64; N]]) -> Job<N> {
    let (mut starts_mm, mut from, mut path_length_mm) = (Vec::new(), [0.0; N], 0.0);
    for to in points_mm {
        starts_mm.push(path_length_mm);
        path_length_mm += to.iter().zip(from).map(|(to, from)| (to - from) * (to - from)).sum::<f64>().sqrt();
        from = *to;
    }
    let info = RunInfo {
        program: "moves.ngc".to_owned(),
        starts_mm,
        path_length_mm,
        ..RunInfo::of_machine(machine)
    };
    Job {
        number,
        header: machine.header(),
        guards: machine.guards(),
        compensation: machine.compensation(),
        items: moves(machine, points_mm),
        correction: None,
        script: None,
        info,
    }
}

fn run<const N: usize>(machine: &Machine<N>, job: &Job<N>) -> (RunSummary, Vec<TraceRow<N>>, Recording<N>) {
    let mut rows = Vec::new();
    let (summary, recording) = simulate::on_simulated(machine, None, |hardware| {
        let mut recorder = Recorder::new(hardware);
        let summary = simulate::run_on(job, &mut recorder, &mut |row| rows.push(*row))?;
        Ok((summary, recorder.finish(job)))
    })
    .expect("a run");
    (summary, rows, recording)
}

/// Six axes on nine places; the places behind them stand at 0 and are no part of records.
const SIX: &str = "XYZACU";
const POINTS_MM: [[f64; 9]; 2] =
    [[10.0, -4.0, 2.0, 15.0, -7.5, 3.0, 0.0, 0.0, 0.0], [12.0, 6.0, 2.0, -3.0, 7.5, -1.0, 0.0, 0.0, 0.0]];

#[test]
fn six_axes_come_to_their_ends_in_every_number_type() {
    // Streams of nine places pass through the stack.
    let checked = std::thread::Builder::new().stack_size(8 << 20).spawn(six_axes);
    checked.expect("a thread").join().expect("what it asserts");
}

fn six_axes() {
    let machine = machine::<9>(SIX);
    let held: Script = "300:hold,900:resume".parse().expect("commands");
    let numbers = [Number::F32, Number::F64, Number::Fixed];
    for (number, script) in
        numbers.into_iter().flat_map(|number| [None, Some(&held)].map(|held| (number, held)))
    {
        let job = Job { script: script.cloned(), ..job(&machine, number, &POINTS_MM) };
        let (summary, rows, recording) = run(&machine, &job);
        assert_eq!((summary.end, summary.faults.len()), (RunEnd::Finished, 0), "{:?}", summary.faults);
        assert_eq!(summary.commands.len(), script.map_or(0, |_| 2));
        let last = rows.last().expect("ticks");
        for ((axis, tick), end_mm) in summary.axes.iter().zip(&last.axes).zip(POINTS_MM[1]) {
            let name = &axis.name;
            assert!((tick.set_mm - end_mm).abs() < 1e-9, "{name}: {} of {end_mm}", tick.set_mm);
            let (off_um, most_um) = ((tick.act_mm - end_mm).abs() * 1e3, axis.following_error_um_max);
            assert!(most_um > 0.1 && most_um < 200.0, "{name}: {most_um} µm");
            assert!(off_um <= most_um + 1e-6, "{name}: {off_um} of {most_um} µm");
            assert!(axis.end_error_counts.abs() <= 2, "{name}: {} counts", axis.end_error_counts);
        }
        let names: String = summary.axes.iter().map(|axis| axis.name.as_str()).collect();
        assert_eq!(names, SIX);
        for (row, axis) in
            rows.iter().flat_map(|row| row.axes[SIX.len()..].iter().map(move |axis| (row, axis)))
        {
            let all = [axis.set_mm, axis.vel_mm_s, axis.acc_mm_s2, axis.act_mm, axis.err_um, axis.out_v];
            assert_eq!(all, [0.0; 6], "tick {}", row.tick);
        }
        replays(&recording, &summary, &rows);
    }
}

/// As bytes and back, and run again: the same ticks.
fn replays(recording: &Recording<9>, summary: &RunSummary, rows: &[TraceRow<9>]) {
    let bytes = recording.to_bytes();
    assert_eq!(recording::places(&bytes), Ok(9));
    let read = Recording::<9>::from_bytes(&bytes).expect("a recording");
    assert_eq!(&read, recording);
    let mut again = 0;
    let replay = recording::replay(&read, read.job(), &mut |row| {
        let of = |row: &TraceRow<9>| row.axes.map(|axis| (axis.set_mm.to_bits(), axis.out_v.to_bits()));
        assert_eq!(of(row), of(&rows[again]), "tick {again}");
        again += 1;
    });
    let replay = replay.expect("a replay");
    assert_eq!((replay.difference, again), (None, rows.len()));
    assert_eq!((replay.ticks, read.ticks()), (read.ticks(), recording.ticks()));
    let letters = |summary: &RunSummary| summary.axes.iter().map(|axis| axis.letter).collect::<Vec<_>>();
    assert_eq!(letters(&replay.summary), letters(summary));

    let refused = Recording::<3>::from_bytes(&bytes).expect_err("nine places");
    assert_eq!(refused, RecordingError::Places { found: 9, expected: 3 });
    let mut old = bytes;
    old[4] = 3;
    let expected = "found a recording of format 3, expected format 6";
    assert_eq!(recording::places(&old).expect_err("old").to_string(), expected);
    assert_eq!(Recording::<9>::from_bytes(&old).expect_err("old").to_string(), expected);
}

/// Contour error is a distance: the rotary axes' following error has no part in it.
#[test]
fn a_report_names_all_axes_with_their_units() {
    let machine = machine::<9>(SIX);
    let job = job(&machine, Number::F32, &POINTS_MM);
    let (summary, ticks, _) = run(&machine, &job);
    let trace = RunTrace { ticks, end: summary.end, ..job.info.empty_trace() };
    let mut page = Vec::new();
    report::write_html(&trace, None, None, &mut page).expect("memory");
    let page = String::from_utf8(page).expect("UTF-8");
    for axis in &summary.axes {
        assert!(page.contains(&format!("<th scope=\"row\">{}</th>", axis.name)), "{}", axis.name);
    }
    let heads = ["<span class=\"unit\">m°</span>", "<span class=\"unit\">°/s</span>", "Rotary axes"];
    for part in ["Without a fault"].iter().chain(&heads) {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("axis 7"));
}

/// A machine whose axes are all rotary has neither a path picture nor a contour error.
#[test]
fn rotary_axes_alone_make_a_report() {
    let machine = machine::<3>("AC");
    let job = job(&machine, Number::F64, &[[90.0, -20.0, 0.0]]);
    let (summary, ticks, _) = run(&machine, &job);
    assert_eq!(summary.contour_error_um_max, 0.0);
    let trace = RunTrace { ticks, end: summary.end, ..job.info.empty_trace() };
    let mut page = Vec::new();
    report::write_html(&trace, None, None, &mut page).expect("memory");
    let page = String::from_utf8(page).expect("UTF-8");
    assert!(page.contains("<th scope=\"row\">A</th>") && page.contains("Rotary axes"));
    assert!(!page.contains("ontour error"));
}

#[test]
fn axes_break_by_name() {
    let machine = machine::<9>(SIX);
    let job = job(&machine, Number::F32, &POINTS_MM);
    let broken = |text: &str| {
        let injections: Injections = text.parse().expect("faults");
        simulate::on_simulated(&machine, Some(&injections), |hardware| {
            simulate::run_on(&job, hardware, &mut |_| {})
        })
    };
    let summary = broken("400:encoder-jump=C:40000").expect("a run");
    let fault = summary.faults.first().expect("a fault");
    assert_eq!((summary.end, fault.axis.as_deref()), (RunEnd::Faulted, Some("C")), "{fault:?}");
    let refused = broken("400:drive-fault=B").expect_err("no such axis").to_string();
    assert_eq!(refused, "found the axis `B`, expected one of X, Y, Z, A, C, U");

    // Degrees, not millimetres.
    let mut strict = machine.clone();
    strict.axes[3].following_error_limit_mm = 1e-4;
    let guards = strict.guards().limits_only();
    let (summary, ..) = run(&strict, &Job { header: strict.header(), guards, ..job.clone() });
    let fault = summary.faults.first().expect("a fault");
    assert_eq!((fault.axis.as_deref(), fault.fault.as_str()), (Some("A"), "following error"));
    assert!(fault.detail.contains("°, limit") && !fault.detail.contains("mm"), "{}", fault.detail);
}

/// From one motion to the next, in every number type.
fn session<R: Real>(machine: &Machine<9>) -> [f64; 9] {
    let simulated = hardware::simulated(machine).expect("a machine");
    let mut session = Session::<R, 9>::new(machine, &simulated).expect("a session");
    let items = moves(machine, &POINTS_MM).into_iter().map(Ok);
    session.run(items, &mut |_| {}).expect("motion");
    session.position().map(Position::to_mm)
}

#[test]
fn a_session_drives_all_axes() {
    let machine = machine::<9>("XYZABCUVW");
    for ends_mm in [session::<f32>(&machine), session::<f64>(&machine), session::<Fixed>(&machine)] {
        for (end_mm, expected_mm) in ends_mm.into_iter().zip(POINTS_MM[1]) {
            assert!((end_mm - expected_mm).abs() < 1e-9, "{end_mm} of {expected_mm}");
        }
    }
}

#[test]
fn a_rotary_axis_is_jogged_by_name() {
    let mut machine = machine::<9>(SIX);
    machine.axes[3].travel_mm = Some([-360.0, 90.0]);
    let press = |text: &str| text.parse::<Press>().expect("a press");
    let presses = ["A+30", "A-12.5", "A+", "U-1"].map(press);
    let mut jogged = Vec::new();
    let mut rows = 0;
    Keys::new(&machine, &presses, Some(FEED_MM_S))
        .and_then(|keys| {
            keys.jog(&mut jogged, &mut |row: &TraceRow<9>| {
                rows += 1;
                assert_eq!(row.axes[0].set_mm, 0.0);
            })
        })
        .expect("motion");
    let ends = jogged.iter().map(|jogged| (jogged.unit, jogged.to_mm, jogged.ended));
    let (deg, mm) = (AxisUnit::Degree, AxisUnit::Millimetre);
    let expected = [
        (deg, 30.0, Ended::Distance),
        (deg, 17.5, Ended::Distance),
        (deg, 90.0, Ended::SoftLimit),
        (mm, -1.0, Ended::Distance),
    ];
    assert_eq!(ends.collect::<Vec<_>>(), expected);
    assert_eq!(rows, jogged.iter().map(|jogged| jogged.ticks).sum::<u64>());
    let refused = |text: &str, feed| {
        let presses = [press(text)];
        Keys::new(&machine, &presses, Some(feed)).expect_err(text).to_string()
    };
    assert_eq!(refused("B+1", 1.0), "B+1: found no such axis, expected one of X, Y, Z, A, C, U");
    assert_eq!(refused("C+1", 301.0), "C+1: found a feed of 301 °/s, expected above 0, at most 300");
}

/// The reference file with axes of these letters, each a copy of its X.
fn file(letters: &str) -> String {
    let (path, axes) = REFERENCE_TOML.split_once("[[axis]]").expect("axes");
    let x = axes.split("[[axis]]").next().expect("an axis");
    let named = |letter: char| {
        let name = format!("name = \"{letter}\"\nletter = \"{letter}\"");
        format!("[[axis]]{}", x.replacen("name = \"X\"", &name, 1))
    };
    path.to_owned() + &letters.chars().map(named).collect::<String>()
}

/// Homing of the reference file in use.
fn homed(file: &str) -> String {
    let (before, homing) = file.split_once("#[axis.homing]").expect("homing");
    let (homing, after) = homing.split_once("\n\n").unwrap_or((homing, ""));
    let homing = format!("[axis.homing]{homing}").replace("\n#", "\n").replace("\n ", "\n# ");
    [before, &homing, "\n\n", after].concat()
}

#[test]
fn a_rotary_axis_is_homed() {
    let reference = Machine::from_toml("home.toml", &homed(REFERENCE_TOML)).expect("a machine");
    let mut machine = machine::<9>(SIX);
    machine.axes[3].homing = reference.axes[0].homing;
    let mut homed = Vec::new();
    Homes::new(&machine, &[]).expect("an axis").home(&mut homed, &mut |_| {}).expect("homed");
    let [axis] = &homed[..] else { panic!("{homed:?}") };
    assert_eq!((axis.name.as_str(), axis.unit, axis.position_mm), ("A", AxisUnit::Degree, 0.0));
    assert_eq!(axis.homed.counts.0, -1_858_000);
}

/// The commands show the axes that there are, a rotary one in degrees.
#[test]
fn commands_show_the_axes_that_there_are() {
    let workspace = Workspace::new("axes-runs");
    workspace.put("xz.toml", &file("XZ"));
    workspace.json(&["jog", "X+1", "Z-2", "--machine", "xz.toml", "--trace", "xz.csv", "--json"]);
    let columns = |csv: &str| {
        let header = csv.lines().next().expect("a header").to_owned();
        header.split(',').skip(8).map(str::to_owned).collect::<Vec<_>>()
    };
    let shown = workspace.read("xz.csv");
    let of = |axis: &str| {
        ["set_mm", "vel_mm_s", "acc_mm_s2", "jerk_mm_s3", "act_mm", "err_um", "out_v"]
            .map(|column| format!("{axis}_{column}"))
    };
    assert_eq!(columns(&shown), [of("X"), of("Z")].concat());
    assert!(shown.lines().all(|line| line.split(',').count() == 8 + 2 * 7));
    let last: Vec<&str> = shown.lines().last().expect("a row").split(',').collect();
    assert_eq!((last[8], last[15]), ("1.0000000000", "-2.0000000000"));
    assert_eq!(
        workspace.refusal(&["jog", "Y+1", "--machine", "xz.toml"]),
        "Y+1: found no such axis, expected one of X, Z"
    );

    workspace.put("ax.toml", &homed(&file("AX")));
    let keys = ["jog", "A+30", "X+1", "--machine", "ax.toml", "--trace", "ax.csv"];
    let presses = workspace.json(&[&keys[..], &["--json"]].concat());
    assert_has(
        &presses[0],
        &["press", "from_deg", "to_deg", "time_s", "feed_deg_s", "ended", "stop_s", "stop_deg"],
    );
    assert_eq!((number(&presses[0]["to_deg"]), number(&presses[1]["to_mm"])), (30.0, 1.0));
    let in_degrees = ["set_deg", "vel_deg_s", "acc_deg_s2", "jerk_deg_s3", "act_deg", "err_mdeg", "out_v"];
    let in_degrees = in_degrees.map(|column| format!("A_{column}"));
    assert_eq!(columns(&workspace.read("ax.csv")), [in_degrees, of("X")].concat());
    let table = workspace.stdout(&keys);
    assert!(table.contains("30.0000 °") && table.contains("1.0000 mm") && table.contains("°/s"), "{table}");
    let homes = workspace.json(&["home", "--machine", "ax.toml", "--json"]);
    assert_has(&homes[0], &["axis", "counts", "index_counts", "time_s", "position_deg", "true_deg"]);
}
