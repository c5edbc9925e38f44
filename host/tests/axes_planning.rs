//! Plans of more than three axes: what F means, whose limits bind what, and the path, tick by tick.

use motion_host::compare::ticks;
use motion_host::gcode::{
    self, ArcMove, Axis, Feed, Length, LineMove, ORIGIN, PathMode, Plane, Point, Program, Step, StepKind,
};
use motion_host::machine::{AxisSettings, Machine};
use motion_host::planning::{Executable, Mode, Plan, plan_moves, plan_program};
use motion_host::toolpath::curve::Curve;
use motion_host::toolpath::smooth::Move;
use motion_host::toolpath::{Element, Feeds};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::path::Setpoint;
use motion_kernel::program::Supply;
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;
use motion_tests::random::Random;

/// Feed, acceleration, jerk and snap.
type Figures = [f64; 4];

const REFERENCE: Figures = [300.0, 500.0, 5e3, 4e5];

/// The reference machine with these axes, in this order, and limits.
fn machine<const N: usize>(axes: &[(Axis, Figures)]) -> Machine<N> {
    let Machine { name, tick_s, path, faults, tool, .. } = Machine::reference();
    let axis = |place: usize| match axes.get(place) {
        None => AxisSettings::idle(),
        Some(&(letter, [feed_mm_s, accel_mm_s2, jerk_mm_s3, snap_mm_s4])) => AxisSettings {
            letter: Some(letter),
            name: letter.to_string(),
            feed_mm_s,
            accel_mm_s2,
            jerk_mm_s3,
            snap_mm_s4,
            ..AxisSettings::idle()
        },
    };
    let axes = std::array::from_fn(axis);
    Machine { name, tick_s, path, axes, faults, tool, probe: None, spindle: None, coolant: None }
}

/// All nine axes, like the reference machine's.
fn nine() -> Machine<9> {
    machine(&Axis::ALL.map(|axis| (axis, REFERENCE)))
}

fn point(coordinates: &[(Axis, f64)]) -> Point {
    coordinates.iter().fold(ORIGIN, |mut point, &(axis, mm)| {
        point[axis.index()] = Length::nearest(mm).expect("in range");
        point
    })
}

/// Lines from the origin through points, each at its feed \[mm/min, or °/min\].
fn lines(points: &[(Point, f64)], mode: PathMode) -> Program {
    let mut from = ORIGIN;
    let step = |(&(to, feed_mm_min), line): (&(Point, f64), u32)| {
        let kind = StepKind::Line(LineMove { from, to, feed: Feed::MmPerMin(feed_mm_min), mode });
        from = to;
        Step { line, kind }
    };
    Program { steps: points.iter().zip(1..).map(step).collect(), ..Program::default() }
}

fn planned<const N: usize>(program: &Program, machine: &Machine<N>) -> Plan<N> {
    plan_program("test.ngc", program, machine, Mode::Spanning).expect("a plan")
}

/// One tick: the program line and the set-points.
type Tick<const N: usize> = (u32, [Setpoint<f64>; N]);

/// The plan as the kernel executes it.
fn executed<const N: usize>(plan: &Plan<N>, machine: &Machine<N>) -> Vec<Tick<N>> {
    let executable = Executable::new::<f64>(plan).expect("executable");
    let start = [Position::ZERO; N];
    let mut streams = Streams::<f64, N, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<f64, N>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut ticks = Vec::new();
    loop {
        supply.fill(&mut feeder).expect("items that follow each other");
        let tick = executor.tick(&mut intake).expect("no fault");
        ticks.push((tick.line, tick.setpoints));
        match tick.state {
            ExecState::Idle if supply.is_empty() => return ticks,
            ExecState::Stopped => executor.resume(),
            _ => {}
        }
    }
}

fn norm(components: impl Iterator<Item = f64>) -> f64 {
    components.map(|component| component * component).sum::<f64>().sqrt()
}

fn is_xyz(axis: Axis) -> bool {
    axis.index() < 3
}

/// The greatest speed of some axes together.
fn speed_max<const N: usize>(ticks: &[Tick<N>], machine: &Machine<N>, is_in: impl Fn(Axis) -> bool) -> f64 {
    let of_tick = |(_, set): &Tick<N>| {
        let axes = set.iter().zip(&machine.axes).filter(|(_, axis)| axis.letter.is_some_and(&is_in));
        norm(axes.map(|(set, _)| set.velocity_mm_s))
    };
    ticks.iter().map(of_tick).fold(0.0, f64::max)
}

fn is_near(found: f64, expected: f64, within: f64) {
    assert!((found / expected - 1.0).abs() < within, "{found}, expected {expected}");
}

#[test]
fn a_line_of_x_and_a_runs_x_at_its_feed() {
    let mut machine = nine();
    machine.axes[3].feed_mm_s = 1e3;
    let end = point(&[(Axis::X, 60.0), (Axis::A, 300.0)]);
    let plan = planned(&lines(&[(end, 600.0)], PathMode::ExactPath), &machine);
    // 10 mm/s of X, 50 °/s of A.
    let along = 10.0 * (60.0_f64.powi(2) + 300.0_f64.powi(2)).sqrt() / 60.0;
    is_near(plan.blocks[0].peak_mm_s, along, 1e-12);
    assert_eq!(plan.blocks[0].cap_reason, "programmed");
    let ticks = executed(&plan, &machine);
    is_near(speed_max(&ticks, &machine, is_xyz), 10.0, 1e-9);
    is_near(speed_max(&ticks, &machine, Axis::is_rotary), 50.0, 1e-9);
    // The same ramps as a line alone at that feed, under the limits that A has over its part.
    let part = 300.0 / (60.0_f64.powi(2) + 300.0_f64.powi(2)).sqrt();
    let alone = machine_of_x(REFERENCE.map(|limit| limit / part));
    let x = point(&[(Axis::X, 60.0 * along / 10.0)]);
    is_near(plan.time_s, planned(&lines(&[(x, along * 60.0)], PathMode::ExactPath), &alone).time_s, 1e-9);
}

/// A machine of X whose path bounds nothing.
fn machine_of_x(figures: Figures) -> Machine {
    let mut machine: Machine = machine(&[(Axis::X, figures)]);
    (machine.path.feed_mm_s, machine.path.accel_mm_s2) = (1e6, 1e6);
    (machine.path.jerk_mm_s3, machine.path.snap_mm_s4) = (1e8, 1e10);
    machine
}

/// Axes that are not linear have their own limits alone: those of the path are a hundredth here.
#[test]
fn a_alone_is_bound_by_its_own_limits() {
    let of_a = [90.0, 700.0, 9e3, 8e5];
    let mut machine: Machine<9> = machine(&[(Axis::X, REFERENCE), (Axis::A, of_a)]);
    (machine.path.feed_mm_s, machine.path.accel_mm_s2) = (1.0, 5.0);
    (machine.path.jerk_mm_s3, machine.path.snap_mm_s4) = (50.0, 4e3);
    let x = machine_of_x(of_a);
    let turn = |axis| lines(&[(point(&[(axis, 720.0)]), 60_000.0)], PathMode::ExactPath);
    let (plan, expected) = (planned(&turn(Axis::A), &machine), planned(&turn(Axis::X), &x));
    is_near(plan.time_s, expected.time_s, 1e-12);
    assert_eq!(plan.blocks[0].cap_reason, "axis feed");
    is_near(plan.blocks[0].peak_mm_s, 90.0, 1e-12);
    // What the kernel's queue holds streams to lets it pass.
    is_near(speed_max(&executed(&plan, &machine), &machine, Axis::is_rotary), 90.0, 1e-9);
    // F in degrees per minute.
    let slow = lines(&[(point(&[(Axis::A, 720.0)]), 1200.0)], PathMode::ExactPath);
    is_near(planned(&slow, &machine).blocks[0].peak_mm_s, 20.0, 1e-12);
    // X and U are linear, and bound.
    for axis in [Axis::X, Axis::U] {
        let machine = Machine { path: machine.path, ..nine() };
        is_near(planned(&turn(axis), &machine).blocks[0].peak_mm_s, 1.0, 1e-12);
    }
}

/// An arc in a plane about a centre, from where `from` is, with what else moves until its end; counter-clockwise.
fn arc(from: Point, plane: Plane, radius_mm: f64, sweep_rad: f64, others: &[(Axis, f64)]) -> ArcMove {
    let [first, second, _] = plane.axes();
    let start = [first, second].map(|axis| from[axis].to_mm());
    // The start is at the angle of 30°.
    let at = |rad: f64| [radius_mm * rad.cos(), radius_mm * rad.sin()];
    let start_rad = std::f64::consts::PI / 6.0;
    let centre_mm = [start[0] - at(start_rad)[0], start[1] - at(start_rad)[1]];
    let end = at(start_rad + sweep_rad);
    let mut to = from;
    to[first] = Length::nearest(centre_mm[0] + end[0]).expect("in range");
    to[second] = Length::nearest(centre_mm[1] + end[1]).expect("in range");
    for &(axis, mm) in others {
        to[axis.index()] = Length::nearest(mm).expect("in range");
    }
    let radius =
        |point: Point| (point[first].to_mm() - centre_mm[0]).hypot(point[second].to_mm() - centre_mm[1]);
    ArcMove {
        from,
        to,
        plane,
        turn_deg: 0.0,
        centre_mm,
        start_radius_mm: radius(from),
        end_radius_mm: radius(to),
        sweep_rad,
        feed: Feed::MmPerMin(600.0),
        mode: PathMode::ExactPath,
    }
}

fn program_of(arc: ArcMove) -> Program {
    Program { steps: vec![Step { line: 1, kind: StepKind::Arc(arc) }], ..Program::default() }
}

#[test]
fn a_helix_takes_a_along_and_runs_x_y_z_at_its_feed() {
    let machine = nine();
    let sweep_rad = 4.0 * std::f64::consts::PI;
    let helix = arc(ORIGIN, Plane::Xy, 20.0, sweep_rad, &[(Axis::Z, -5.0), (Axis::A, 400.0), (Axis::W, 3.0)]);
    let plan = planned(&program_of(helix), &machine);
    let xyz_mm = (20.0 * sweep_rad).hypot(5.0);
    is_near(plan.length_mm, norm([xyz_mm, 400.0, 3.0].into_iter()), 1e-9);
    assert_eq!(plan.blocks[0].kind, "helix");
    let ticks = executed(&plan, &machine);
    is_near(speed_max(&ticks, &machine, is_xyz), 10.0, 1e-6);
    // A turns evenly with the angle.
    for (_, set) in &ticks {
        let at = |axis: Axis| set[axis.index()].position.to_mm();
        assert!((at(Axis::A) + 80.0 * at(Axis::Z)).abs() < 1e-4, "{} {}", at(Axis::A), at(Axis::Z));
        let from_centre = (at(Axis::X) - helix.centre_mm[0]).hypot(at(Axis::Y) - helix.centre_mm[1]);
        assert!((from_centre - 20.0).abs() < 1e-5, "{from_centre}");
    }
    assert_eq!(ticks.last().map(|(_, set)| set.map(|set| set.position)), Some(exact(helix.to, &machine)));
    let ratios = ticks::ratios(&plan, &machine).expect("ticks");
    assert!(ratios.feed < 1.0 && ratios.accel < 1.0 && ratios.jerk < 1.0, "{ratios:?}");
    let flat = arc(ORIGIN, Plane::Xy, 20.0, 1.0, &[]);
    assert_eq!(planned(&program_of(flat), &machine).blocks[0].kind, "arc");
}

fn exact<const N: usize>(point: Point, machine: &Machine<N>) -> [Position; N] {
    machine.coordinates(point).map(|mm| Position::from_mm(mm).expect("in range"))
}

/// The axes of a plane may stand anywhere, and lathes have no Y.
#[test]
fn an_arc_is_the_same_wherever_its_axes_are() {
    let of_xyz = Machine::reference();
    let lathe: Machine = machine(&[(Axis::Z, REFERENCE), (Axis::X, REFERENCE)]);
    let five: Machine<9> =
        machine(&[Axis::C, Axis::Z, Axis::A, Axis::X, Axis::U].map(|axis| (axis, REFERENCE)));
    let arc = arc(point(&[]), Plane::Zx, 7.0, -2.0, &[]);
    let expected = planned(&program_of(arc), &of_xyz);
    is_near(planned(&program_of(arc), &lathe).time_s, expected.time_s, 1e-12);
    is_near(planned(&program_of(arc), &five).time_s, expected.time_s, 1e-12);
    let [place_z, place_x] = [Axis::Z, Axis::X].map(|axis| five.place_of(axis).expect("an axis"));
    let (ticks, of_five) = (executed(&expected, &of_xyz), executed(&planned(&program_of(arc), &five), &five));
    for ((_, set), (_, five)) in ticks.iter().zip(&of_five) {
        assert!((set[2].position - five[place_z].position).to_mm().abs() < 1e-8);
        assert!((set[0].position - five[place_x].position).to_mm().abs() < 1e-8);
    }
    let xy = ArcMove { plane: Plane::Xy, ..arc };
    let refused = plan_program("test.ngc", &program_of(xy), &lathe, Mode::Spanning).map(|_| ());
    let refused = refused.expect_err("no Y").to_string();
    assert_eq!(
        refused,
        "test.ngc:1: found a curve in a plane of Y, expected a plane whose axes the machine has"
    );
}

/// The distance of a point from the line between two others.
fn distance<const N: usize>(point: [f64; N], [from, to]: [[f64; N]; 2]) -> f64 {
    let dot = |a: [f64; N], b: [f64; N]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let minus = |a: [f64; N], b: [f64; N]| -> [f64; N] { std::array::from_fn(|axis| a[axis] - b[axis]) };
    let (along, offset) = (minus(to, from), minus(point, from));
    let square = dot(along, along);
    let share = if square > 0.0 { (dot(offset, along) / square).clamp(0.0, 1.0) } else { 0.0 };
    norm((0..N).map(|axis| offset[axis] - share * along[axis]))
}

#[test]
fn a_corner_from_x_to_a_is_blended_within_the_tolerance() {
    let machine = nine();
    let mode = PathMode::Blend { tolerance_mm: Some(0.5), merging_mm: None };
    let (corner, end) = (point(&[(Axis::X, 20.0)]), point(&[(Axis::X, 20.0), (Axis::A, 30.0)]));
    let plan = planned(&lines(&[(corner, 300.0), (end, 300.0)], mode), &machine);
    let kinds: Vec<&str> = plan.blocks.iter().map(|block| &*block.kind).collect();
    assert_eq!(kinds, ["line", "blend", "line"]);
    let [start, corner, end] = [ORIGIN, corner, end].map(|point| machine.coordinates(point));
    let mut farthest = 0.0_f64;
    for (_, set) in executed(&plan, &machine) {
        let at = set.map(|set| set.position.to_mm());
        farthest = farthest.max(distance(at, [start, corner]).min(distance(at, [corner, end])));
    }
    assert!(farthest <= 0.5 + 1e-6 && farthest > 0.2, "{farthest}");
}

/// Points of a step's path, close to each other.
fn outline(kind: &StepKind, machine: &Machine<9>) -> Vec<[f64; 9]> {
    let element = match kind {
        StepKind::Line(line) => Element::line(line, machine),
        StepKind::Arc(arc) => Element::arc(arc, machine).expect("a plane"),
        _ => panic!("a line or an arc"),
    };
    let (from, to) = element.ends_mm();
    let Element::Arc { shape, sweep_rad, .. } = element else { return vec![from, to] };
    let at = |part: u32| {
        let offset = shape.offset(0.0, sweep_rad * f64::from(part) / 1000.0);
        std::array::from_fn(|axis| from[axis] + offset[axis])
    };
    (0..=1000).map(at).collect()
}

/// A machine of nine axes in some order, each with limits of its own.
fn random_machine(random: &mut Random) -> Machine<9> {
    let mut letters = Axis::ALL;
    for place in (1..9).rev() {
        letters.swap(place, random.below(place + 1));
    }
    let axes = letters.map(|letter| {
        let figures =
            [random.log(20.0, 600.0), random.log(100.0, 3e3), random.log(1e3, 5e4), random.log(5e4, 5e6)];
        (letter, figures)
    });
    let mut machine: Machine<9> = machine(&axes);
    machine.path.feed_mm_s = random.log(20.0, 400.0);
    machine.path.accel_mm_s2 = random.log(100.0, 2e3);
    machine.path.jerk_mm_s3 = random.log(1e3, 3e4);
    machine.path.snap_mm_s4 = random.log(5e4, 3e6);
    // Nothing steps: ticks are then within the limits to the last digits.
    machine.path.accel_step_mm_s2 = 1e-3;
    machine
}

/// Lines and helices of some axes, of all lengths.
fn random_program(random: &mut Random, mode: PathMode) -> Program {
    let (mut from, mut steps) = (ORIGIN, Vec::new());
    let size_mm = random.log(0.3, 30.0);
    for line in 1..=20 {
        let feed = if random.once_in(8) { Feed::Rapid } else { Feed::MmPerMin(random.log(600.0, 3e4)) };
        let mut others = Vec::new();
        for axis in Axis::ALL {
            if random.once_in(3) {
                others.push((axis, from[axis.index()].to_mm() + random.between(-size_mm, size_mm)));
            }
        }
        let kind = if random.once_in(4) {
            let plane = *random.pick(&[Plane::Xy, Plane::Zx, Plane::Yz]);
            let [.., normal] = plane.axes();
            others.retain(|(axis, _)| !is_xyz(*axis) || axis.index() == normal);
            let sweep_rad = random.sign() * random.between(0.3, 9.0);
            StepKind::Arc(ArcMove {
                feed,
                mode,
                ..arc(from, plane, random.between(0.2, 1.0) * size_mm, sweep_rad, &others)
            })
        } else {
            let mut to = from;
            others.iter().for_each(|&(axis, mm)| to[axis.index()] = Length::nearest(mm).expect("in range"));
            if to == from {
                continue;
            }
            StepKind::Line(LineMove { from, to, feed, mode })
        };
        from = kind.ends().map_or(from, |[_, to]| to);
        steps.push(Step { line, kind });
    }
    Program { steps, ..Program::default() }
}

/// Whether F is the speed of these axes in a step.
fn counts(kind: &StepKind, machine: &Machine<9>, is_in: impl Fn(Axis) -> bool) -> bool {
    let outline = outline(kind, machine);
    let moves = |place: usize| outline.iter().any(|point| point[place] != outline[0][place]);
    (0..9).any(|place| moves(place) && machine.axes[place].letter.is_some_and(&is_in))
}

/// Tick by tick: limits of every axis and of the linear ones together, the programmed feed, the tolerance, the end.
#[test]
fn nothing_is_exceeded_by_random_programs_of_nine_axes() {
    let mut random = Random::of_stream(9);
    let mut blends = 0;
    for round in 0..30 {
        let machine = random_machine(&mut random);
        let tolerance_mm = if random.once_in(3) { 0.0 } else { random.log(1e-3, 0.5) };
        let mode = PathMode::Blend { tolerance_mm: Some(tolerance_mm), merging_mm: None };
        let program = random_program(&mut random, mode);
        let plan = planned(&program, &machine);
        blends += plan.blocks.iter().filter(|block| block.kind == "blend" || block.kind == "curve").count();
        let ticks = executed(&plan, &machine);
        keeps_limits(&ticks, &machine, round);
        keeps_feeds(&ticks, &program, &machine, round);
        keeps_path(&ticks, &program, tolerance_mm, &machine, round);
        let end = program.steps.last().and_then(|step| step.kind.ends()).expect("steps")[1];
        assert_eq!(ticks.last().map(|(_, set)| set.map(|set| set.position)), Some(exact(end, &machine)));
        let ratios = ticks::ratios(&plan, &machine).expect("ticks");
        assert!(ratios.feed <= 1.0 + 1e-6 && ratios.accel <= 1.0 + 1e-3, "round {round}: {ratios:?}");
    }
    assert!(blends > 45, "{blends} blends");
}

fn keeps_limits(ticks: &[Tick<9>], machine: &Machine<9>, round: u32) {
    let within = 1.0 + 1e-3;
    let path = &machine.path;
    let is_linear = machine.letters_by_place().map(|axis| axis.is_some_and(|axis| !axis.is_rotary()));
    for (tick, pair) in ticks.windows(2).enumerate() {
        let (before, set) = (&pair[0].1, &pair[1].1);
        let of_tick = |place: usize| {
            let (before, set) = (&before[place], &set[place]);
            let snap = (set.jerk_mm_s3 - before.jerk_mm_s3) / machine.tick_s;
            [set.velocity_mm_s, set.accel_mm_s2, set.jerk_mm_s3, snap]
        };
        for (place, axis) in machine.axes.iter().enumerate() {
            let limits = [axis.feed_mm_s, axis.accel_mm_s2, axis.jerk_mm_s3, axis.snap_mm_s4];
            for (found, limit) in of_tick(place).into_iter().zip(limits) {
                assert!(
                    found.abs() <= within * limit,
                    "round {round}, tick {tick}, {}: {found} of {limit}",
                    axis.name
                );
            }
        }
        let limits = [path.feed_mm_s, path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4];
        for (order, limit) in limits.into_iter().enumerate() {
            let linear = (0..9).filter(|&place| is_linear[place]).map(|place| of_tick(place)[order]);
            let found = norm(linear);
            assert!(found <= within * limit, "round {round}, tick {tick}: {found} of {limit} along the path");
        }
    }
}

fn keeps_feeds(ticks: &[Tick<9>], program: &Program, machine: &Machine<9>, round: u32) {
    let kinds: [fn(Axis) -> bool; 3] = [is_xyz, |axis| !is_xyz(axis) && !axis.is_rotary(), Axis::is_rotary];
    for step in &program.steps {
        let (StepKind::Line(LineMove { feed, .. }) | StepKind::Arc(ArcMove { feed, .. })) = step.kind else {
            panic!("a line or an arc");
        };
        let kind = kinds.into_iter().find(|kind| counts(&step.kind, machine, kind)).expect("a move");
        let of_step: Vec<Tick<9>> = ticks.iter().filter(|(line, _)| *line == step.line).copied().collect();
        let found = speed_max(&of_step, machine, kind);
        assert!(found <= feed.mm_s() * (1.0 + 1e-5), "round {round}, line {}: {found} {feed:?}", step.line);
    }
}

fn keeps_path(ticks: &[Tick<9>], program: &Program, tolerance_mm: f64, machine: &Machine<9>, round: u32) {
    let outlines: Vec<_> =
        program.steps.iter().map(|step| (step.line, outline(&step.kind, machine))).collect();
    for (line, set) in ticks.iter().step_by(31).filter(|(line, _)| *line > 0) {
        let at = set.map(|set| set.position.to_mm());
        // What stands for several moves has the line of the first of them.
        let here = outlines.partition_point(|(of_step, _)| of_step < line);
        let mut nearest = f64::INFINITY;
        for (_, outline) in &outlines[here.saturating_sub(1)..] {
            let pairs = outline.windows(2).map(|pair| distance(at, [pair[0], pair[1]]));
            nearest = pairs.fold(nearest, f64::min);
            if nearest <= tolerance_mm + 4e-4 {
                break;
            }
        }
        // Chords of 9 mrad are 10⁻⁵ of the radius off.
        assert!(nearest <= tolerance_mm + 4e-4, "round {round}, line {line}: {nearest} of {tolerance_mm}");
    }
}

/// Dense moves of five axes become a curve that keeps everything, too.
#[test]
fn dense_moves_of_five_axes_become_a_curve() {
    let mut machine = nine();
    machine.path.accel_step_mm_s2 = 1e-3;
    let wave = |index: u32| {
        let u = 0.05 * f64::from(index);
        point(&[
            (Axis::X, u),
            (Axis::Y, 0.3 * (2.0 * u).sin()),
            (Axis::Z, 0.1 * u.cos() - 0.1),
            (Axis::A, 3.0 * u.sin()),
            (Axis::B, u * u * 0.2),
        ])
    };
    let points: Vec<(Point, f64)> = (1..160).map(|index| (wave(index), 1200.0)).collect();
    let mode = PathMode::Blend { tolerance_mm: Some(0.02), merging_mm: None };
    let program = lines(&points, mode);
    let plan = planned(&program, &machine);
    assert!(plan.blocks.iter().any(|block| block.kind == "curve"), "no curve");
    let ticks = executed(&plan, &machine);
    keeps_limits(&ticks, &machine, 0);
    keeps_path(&ticks, &program, 0.02, &machine, 0);
    let fastest = speed_max(&ticks, &machine, is_xyz);
    assert!(fastest <= 20.0 * (1.0 + 1e-5), "{fastest}");
    let stopping = planned(&lines(&points, PathMode::ExactPath), &machine);
    assert!(plan.time_s < 0.2 * stopping.time_s, "{} {}", plan.time_s, stopping.time_s);
}

/// To and fro of A along X: what is merged must not drive X faster than F.
#[test]
fn merged_lines_keep_the_feed_of_their_own_direction() {
    let machine = nine();
    let zigzag =
        |index: u32| point(&[(Axis::X, 0.01 * f64::from(index)), (Axis::A, 0.05 * f64::from(index % 2))]);
    let points: Vec<(Point, f64)> = (1..400).map(|index| (zigzag(index), 300.0)).collect();
    let mode = PathMode::Blend { tolerance_mm: Some(0.2), merging_mm: None };
    let plan = planned(&lines(&points, mode), &machine);
    assert!(plan.blocks.len() < 100, "{} blocks", plan.blocks.len());
    let fastest = speed_max(&executed(&plan, &machine), &machine, is_xyz);
    assert!(fastest <= 5.0 * (1.0 + 1e-5), "{fastest}");
    // X swings within the tolerance while A turns: one line of A alone, no faster than A was before.
    let swing =
        |index: u32| point(&[(Axis::X, 0.25 * f64::from(index % 2)), (Axis::A, 2.0 * f64::from(index))]);
    let points: Vec<(Point, f64)> = (1..60).map(|index| (swing(index), 100.0)).collect();
    let mode = PathMode::Blend { tolerance_mm: Some(0.5), merging_mm: None };
    let plan = planned(&lines(&points, mode), &machine);
    assert!(plan.blocks.len() < 10, "{} blocks", plan.blocks.len());
    let fastest = speed_max(&executed(&plan, &machine), &machine, |letter| letter == Axis::A);
    let programmed = 100.0 / 60.0 * libm::hypot(2.0, 0.25) / 0.25;
    assert!(fastest <= programmed * (1.0 + 1e-5) && fastest > 0.9 * programmed, "{fastest} {programmed}");
}

/// The idle axes of a larger machine, and rotary ones that stand, change nothing.
#[test]
fn a_program_of_x_y_z_takes_the_same_time_on_a_machine_of_nine_axes() {
    let wave: String = (0..200)
        .map(|index| {
            let u = 0.05 * f64::from(index);
            format!(
                "G1 X{u:.4} Y{:.4} Z{:.4}\n",
                0.3 * (2.0 * u).sin() + 0.001 * f64::from(index % 2),
                0.2 * u.cos()
            )
        })
        .collect();
    let chords: String = (0..120)
        .map(|index| {
            format!("G1 X{:.4} Y{:.4}\n", (0.03 * f64::from(index)).cos(), (0.03 * f64::from(index)).sin())
        })
        .collect();
    let slow = [7.0, 11.0, 200.0, 1e3];
    let limits = [[200.0, 900.0, 1e4, 1e6], [250.0, 700.0, 9e3, 9e5], [60.0, 300.0, 4e3, 3e5]];
    let xyz: [(Axis, Figures); 3] = std::array::from_fn(|axis| (Axis::ALL[axis], limits[axis]));
    let mut three: Machine = machine(&xyz);
    three.path.accel_mm_s2 = 800.0;
    let others = [Axis::A, Axis::B, Axis::C, Axis::U, Axis::V, Axis::W].map(|axis| (axis, slow));
    let in_order: Vec<(Axis, Figures)> = xyz.into_iter().chain(others).collect();
    let reversed: Vec<(Axis, Figures)> = in_order.iter().copied().rev().collect();
    for text in [
        format!("G64 P0.02 F6000\n{wave}M2\n"),
        format!("G64 P0.01 Q0.003 F3000\n{chords}M2\n"),
        "G61 F4000\nG1 X30 Y10 Z3\nG2 X40 Y20 I10\nG18 G3 X20 Z-10 R25\nG0 X0 Y0 Z0\nM2\n".to_owned(),
        "G64 P0.1 F4000\nG1 X30 Y10 Z3\nG2 X40 Y20 Z5 I10\nG1 X60 Y-3\nG19 G3 Y5 Z9 R9\nG0 X0 Y0 Z0\nM2\n".to_owned(),
        "G64 P0.1 F4000\nG5 I0 J3 P0 Q-3 X4 Y5\nG5 I2 J2 P-1 Q1 X9 Y1\nG5.2 X13 Y4 P1 L3\nX16 Y5 P2\nX18 Y2 P1\nX20 Y0 P1\nG5.3\nG1 X25\nM2\n"
            .to_owned(),
    ] {
        let program = gcode::read("test.ngc", text.as_bytes()).expect("G-code");
        let expected = planned(&program, &three);
        // In another order sums are rounded otherwise, and iterations end elsewhere.
        for (axes, within) in [(&xyz[..], 1e-12), (&in_order, 1e-12), (&reversed, 1e-9)] {
            let mut nine: Machine<9> = machine(axes);
            nine.path = three.path;
            let plan = planned(&program, &nine);
            is_near(plan.time_s, expected.time_s, within);
            assert_eq!(plan.blocks.len(), expected.blocks.len());
        }
    }
}

#[test]
fn refusals_name_the_axis_and_its_unit() {
    let mut machine: Machine<9> = machine(&[Axis::X, Axis::C].map(|axis| (axis, REFERENCE)));
    machine.axes[1].travel_mm = Some([-90.0, 90.0]);
    let program = lines(&[(point(&[(Axis::C, 120.0)]), 600.0)], PathMode::ExactPath);
    let refused = plan_program("test.ngc", &program, &machine, Mode::Spanning).map(|_| ());
    let refused = refused.expect_err("beyond").to_string();
    assert!(
        refused.starts_with("test.ngc:1: found C at 120")
            && refused.ends_with(" °, expected its travel, -90 to 90 °"),
        "{refused}"
    );
    let mut to = [0.0; 9];
    to[1] = 1.5e6;
    let element = Element::Line { from: to, to: to.map(|mm| mm + 1.0) };
    let step =
        Move { line: 3, element, feeds: Feeds::RAPID, tolerance_mm: 0.0, merging_mm: None, distance_mm: 0.0 };
    let refused = plan_moves("test.ngc", vec![step], &machine, Mode::Spanning).map(|_| ());
    assert_eq!(
        refused.expect_err("too far").to_string(),
        "test.ngc:3: found a path through C = 1500001 °, expected coordinates within ±1000000 °"
    );
}
