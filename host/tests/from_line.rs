//! Programs begun in their middle: the items are those of the whole program from there on, and the state is the one there.

use std::convert::Infallible;
use std::path::Path;

use motion_host::board::Job;
use motion_host::board::from_line::{FromLineError, from_line};
use motion_host::gcode::{self, Program, ReadOptions, StepKind};
use motion_host::machine::{CoolantSettings, Machine, SpindleSettings};
use motion_host::planning::{Executable, Mode, plan_program};
use motion_kernel::hal::{OutputState, Spindle};
use motion_kernel::program::{Item, check_live};
use motion_kernel::units::Position;
use motion_tests::random::Random;

/// Lines tried of every program.
const LINES: u64 = 40;

/// The reference machine with spindle and coolant.
fn machine() -> Machine {
    let spindle = SpindleSettings { speed_max_rpm: 30_000.0, start_s: 1.5, stop_s: 0.5, reverses: true };
    let coolant = CoolantSettings { flood: true, mist: true };
    Machine { spindle: Some(spindle), coolant: Some(coolant), ..Machine::reference() }
}

/// Offsets, tools, spindle, coolant, G91, G92, subroutines, loops, jumps, stops and dwells.
const STATES: &str = "\
G21 G90 G17 G64 P0.02
(one)
T1 M6
M3 S8000
G54 G0 X5 Y0
M8
G1 Z-1 F600
X20
Y10
G92 X0 Y0
G1 X5 Y5 F900

M5
T2 M6
M4 S4000
G91 G1 X3 Y-2
X3 Y2
G90
G92.1
o100 sub
G1 X40 F1200
Y20
M9
Y25
o100 endsub
o101 sub
G91 G1 X-1 Y0.5
G90
o101 endsub
o100 call
G4 P0.3
o101 call
o101 call
o102 repeat [3]
G91 G1 X1
G90
o102 endrepeat
o103 if [0]
G1 X99
o103 endif
M0
G91 G2 X4 Y-4 I4 J0
G90 G1 X10 Y0
M5
M2
G1 X1
";

fn read(text: &str, machine: &Machine) -> (Program, Job<3>) {
    let options = ReadOptions { optional_stop: true, ..machine.read_options() };
    let program =
        gcode::read_with("part.ngc", text.as_bytes(), &options).unwrap_or_else(|error| panic!("{error}"));
    let plan =
        plan_program("part.ngc", &program, machine, Mode::Spanning).unwrap_or_else(|error| panic!("{error}"));
    let job = Job::new(machine, &Executable::new::<f32>(&plan).expect("executable").items);
    (program, job)
}

/// Many short lines, blended or merged into curves.
fn wave(lines: u32) -> String {
    let lines: String = (1..=lines)
        .map(|line| {
            let x_mm = f64::from(line) * 0.4;
            format!("G1 X{x_mm:.4} Y{:.4} F2400\n", 3.0 * (x_mm * 0.5).sin())
        })
        .collect();
    format!("G21 G90 G64 P0.01\nM3 S5000\n{lines}M5\nM2\n")
}

fn programs() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/programs");
    let mut programs = vec![("states".to_owned(), STATES.to_owned()), ("wave".to_owned(), wave(200))];
    for name in ["pockets", "nameplate_inch", "thread_mill_helix", "stairs_incremental"] {
        let text = std::fs::read_to_string(folder.join(format!("{name}.ngc"))).expect("a sample");
        programs.push((name.to_owned(), text));
    }
    programs
}

/// What no plan makes anew.
fn is_kept(item: &&Item<3>) -> bool {
    !matches!(item, Item::Block(_) | Item::Feed(_))
}

fn length_of(item: &Item<3>) -> [Position; 3] {
    let zero = Position::ZERO;
    match item {
        Item::Line { length, .. } | Item::Septic { length, .. } => [*length, zero, zero],
        Item::Block(block) => [zero, block.length, zero],
        Item::Feed(planned) => [zero, zero, planned.length],
        _ => [zero; 3],
    }
}

/// The items of the first stretch, its end among them, and those behind it.
fn first_stretch(items: &[Item<3>]) -> (&[Item<3>], &[Item<3>]) {
    let is_end = |item: &Item<3>| matches!(item, Item::EndOfStretch(_));
    items.split_at(items.iter().position(is_end).expect("a stretch") + 1)
}

/// What is left from an item on, against the whole.
fn check(whole: &Job<3>, item: usize) -> Job<3> {
    let job = whole.from_item::<f32>(item).unwrap_or_else(|(line, problem)| panic!("{line}: {problem}"));
    let suffix = &whole.items[item..];
    // Path, dwells, stops and switches, bit by bit.
    let (kept, of_whole): (Vec<_>, Vec<_>) =
        (job.items.iter().filter(is_kept).collect(), suffix.iter().filter(is_kept).collect());
    assert_eq!(kept, of_whole);
    // Behind the stretch, everything.
    let ((stretch, behind), (of_whole, behind_of_whole)) = (first_stretch(&job.items), first_stretch(suffix));
    assert_eq!(behind, behind_of_whole);
    // Blocks, but for the length of the first.
    let blocks = |items: &[Item<3>]| -> Vec<_> {
        items
            .iter()
            .filter_map(|item| if let Item::Block(block) = item { Some(*block) } else { None })
            .collect()
    };
    let (mut blocks_left, blocks_of_whole) = (blocks(stretch), blocks(of_whole));
    assert!(blocks_left.ends_with(&blocks_of_whole) || blocks_left[1..] == blocks_of_whole[..]);
    assert!(blocks_left.len() - blocks_of_whole.len() <= 1);
    let first = blocks_left.remove(0);
    let last_before = blocks(&whole.items[..item]);
    let cut = last_before.last().filter(|_| blocks_left.len() == blocks_of_whole.len());
    assert!(cut.is_none_or(|cut| cut.holds_like(&first) && cut.length >= first.length));
    // All three as long; from rest to rest, without a step of the feed.
    let lengths = stretch
        .iter()
        .map(length_of)
        .fold([Position::ZERO; 3], |sum, one| std::array::from_fn(|index| sum[index] + one[index]));
    assert!(lengths[0] > Position::ZERO && lengths.iter().all(|length| *length == lengths[0]), "{lengths:?}");
    let feeds: Vec<[f64; 2]> = stretch
        .iter()
        .filter_map(|item| match item {
            Item::Feed(planned) => Some([planned.ramp.from_mm_s, planned.ramp.to_mm_s]),
            _ => None,
        })
        .collect();
    assert_eq!((feeds[0][0], feeds[feeds.len() - 1][1]), (0.0, 0.0));
    assert!(feeds.windows(2).all(|two| two[0][1].to_bits() == two[1][0].to_bits()));
    // It begins where its path does.
    let start = job.items.iter().find_map(|item| match item {
        Item::Line { start, .. } | Item::Septic { start, .. } => Some(*start),
        _ => None,
    });
    assert_eq!(Some(job.header.start), start);
    // Spindle and coolant as they were switched last.
    let switched = whole.items[..item].iter().rev().find_map(|item| match item {
        Item::Switch(to) => Some(*to),
        _ => None,
    });
    let lead = match job.begin.lead.first() {
        Some(Item::Switch(to)) => *to,
        None => OutputState::OFF,
        other => panic!("{other:?}"),
    };
    assert_eq!(lead, switched.unwrap_or(OutputState::OFF));
    assert_eq!(
        job.begin.lead.len(),
        usize::from(lead != OutputState::OFF) + usize::from(lead.spindle_turns())
    );
    assert_ne!(job.name, whole.name);
    // A board takes it.
    let motion = job.items.iter().filter(|item| !matches!(item, Item::Switch(_)));
    check_live::<f32, 3, Infallible>(&job.header, motion.map(|item| Ok(*item))).expect("executable");
    job
}

/// From any line on, the items are those of the whole program; or it is said why there are none.
#[test]
fn the_items_from_a_line_on_are_those_of_the_whole_program() {
    let machine = machine();
    let (mut begun, mut refused, mut elsewhere) = (0, 0, 0);
    for (seed, (name, text)) in (1..).zip(programs()) {
        println!("{name}: seed {seed}");
        let (program, whole) = read(&text, &machine);
        let mut random = Random::new(seed);
        for _ in 0..LINES {
            let line = 1 + random.below(text.lines().count()) as u32;
            let found = match from_line(&program, &whole.items, line) {
                Ok(found) => found,
                Err(error) => {
                    println!("line {line}: {error}");
                    refused += 1;
                    continue;
                }
            };
            let job = check(&whole, found.item);
            assert_eq!(job.line_of(0), Some(found.line));
            // The path begins with its line, unless that has none.
            let has_path = whole.items.iter().any(|item| {
                matches!(item, Item::Line { line: of, .. } | Item::Septic { line: of, .. } if *of == line)
            });
            assert_eq!(has_path, found.line == line, "line {line}: {found:?}");
            let before = whole.items[..found.item].iter().rev().find_map(|item| match item {
                Item::Line { line, .. } | Item::Septic { line, .. } => Some(*line),
                _ => None,
            });
            assert_ne!(before, Some(found.line), "not at the line's first piece");
            elsewhere += u32::from(found.line != line);
            begun += 1;
        }
    }
    assert!(begun > 100 && refused > 10 && elsewhere > 10, "{begun} {refused} {elsewhere}");
}

/// Every line of a program whose lines are moves without blends begins where its move does.
#[test]
fn the_path_of_a_line_begins_where_its_move_does() {
    let machine = machine();
    let text = STATES.replacen("G64 P0.02", "G61", 1);
    let (program, whole) = read(&text, &machine);
    let mut checked = 0;
    for line in 1..=text.lines().count() as u32 {
        let Ok(found) = from_line(&program, &whole.items, line) else { continue };
        let job = check(&whole, found.item);
        let moves = program.steps.iter().find(|step| step.line == found.line && step.kind.ends().is_some());
        let [from, _] = moves.and_then(|step| step.kind.ends()).expect("a move");
        let from = machine.coordinates(from).map(|mm| Position::from_mm(mm).expect("in range"));
        assert_eq!(job.header.start, from, "line {line}");
        checked += 1;
    }
    assert!(checked > 20, "{checked}");
}

/// Tool, spindle, coolant and stops at some lines, as a reader of the text knows them.
#[test]
fn the_state_at_a_line_is_the_programs() {
    let machine = machine();
    let (program, whole) = read(STATES, &machine);
    let line_of = |text: &str| STATES.lines().position(|line| line == text).expect("a line") as u32 + 1;
    let at = |text: &str| {
        let found = from_line(&program, &whole.items, line_of(text))
            .unwrap_or_else(|error| panic!("{text}: {error}"));
        (found, whole.from_item::<f32>(found.item).expect("a plan"))
    };
    let state = |spindle, speed_rpm, flood| OutputState { spindle, speed_rpm, flood, mist: false };
    let waits = |job: &Job<3>| job.begin.lead.len() == 2;
    let (found, job) = at("X20");
    assert_eq!((found.tool, job.begin.stops), (1, 1));
    assert_eq!(job.begin.lead[0], Item::Switch(state(Spindle::Clockwise, 8000.0, true)));
    assert!(waits(&job));
    // The tool is changed, and the spindle on again.
    let (found, job) = at("X3 Y2");
    assert_eq!((found.tool, job.begin.stops), (2, 2));
    let Item::Switch(to) = job.begin.lead[0] else { panic!("{:?}", job.begin.lead) };
    assert_eq!((to.spindle, to.speed_rpm), (Spindle::Counterclockwise, 4000.0));
    // In a subroutine that is called once, after the coolant went off there.
    let (found, job) = at("Y25");
    assert_eq!((found.line, found.tool), (line_of("Y25"), 2));
    assert_eq!(job.begin.lead[0], Item::Switch(state(Spindle::Counterclockwise, 4000.0, false)));
    // Without motion: what comes next in the order of execution.
    let (found, _) = at("o100 call");
    assert_eq!(found.line, line_of("G1 X40 F1200"));
    let (found, _) = at("(one)");
    assert_eq!(found.line, line_of("G54 G0 X5 Y0"));
    let refused = |text: &str| from_line(&program, &whole.items, line_of(text)).expect_err("refused");
    assert_eq!(refused("G91 G1 X-1 Y0.5"), FromLineError::RunsAgain);
    assert_eq!(refused("G91 G1 X1"), FromLineError::RunsAgain);
    assert_eq!(refused("G4 P0.3"), FromLineError::NextRunsAgain { line: line_of("G91 G1 X-1 Y0.5") });
    assert_eq!(refused("G1 X99"), FromLineError::NeverRuns);
    assert_eq!(refused("G1 X1"), FromLineError::NeverRuns);
    assert_eq!(refused("M5\nM2".lines().nth(1).expect("M2")), FromLineError::NoMotion);
    for line in [0, 900] {
        let lines = STATES.lines().count();
        let found = from_line(&program, &whole.items, line);
        assert!(matches!(found, Err(FromLineError::Lacking { lines: count }) if count >= lines), "{found:?}");
    }
    let stops =
        program.steps.iter().filter(|step| matches!(step.kind, StepKind::Stop | StepKind::ToolChange { .. }));
    assert_eq!(stops.count(), 3);
}

/// From every item on, as a program is gone on with.
#[test]
fn every_item_belongs_to_a_piece_or_is_at_rest() {
    let machine = machine();
    let (_, whole) = read(STATES, &machine);
    let path = whole
        .items
        .iter()
        .filter(|item| matches!(item, Item::Line { .. } | Item::Septic { .. } | Item::EndOfStretch(_)));
    let path = path.count() as u32;
    let mut last = 0;
    for behind in 0..=path {
        let item = whole.item_behind(behind);
        let job = whole.from_item::<f32>(item).expect("a plan");
        assert!(job.begin.item >= last && job.begin.path <= behind, "{behind}: {:?}", job.begin);
        // Nothing of the path is left out, and no more than a piece and an end comes again.
        assert!(behind - job.begin.path <= 1);
        let left: Vec<_> = job.items.iter().filter(is_kept).collect();
        assert!(whole.items.iter().filter(is_kept).collect::<Vec<_>>().ends_with(&left));
        last = job.begin.item;
    }
    assert!(last > whole.items.len() - 3);
}
