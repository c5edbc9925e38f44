//! Corner blends against the programmed path: distance both ways, continuity, and every tick's limits.
//!
//! The oracle is the programmed geometry itself: distances from lines and arcs in closed form, polynomials of the
//! compiled pieces evaluated here. `MOTION_TEST_SEED` is the first seed, `MOTION_TEST_PROGRAMS` how many.

#[allow(dead_code, reason = "each test takes what it needs of the shared checks")]
mod check;

use check::random::Random;
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Item as PlanItem, Mode, Plan, plan_program};
use motion_kernel::exec::{ExecState, Executor};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::program::{Item, Supply};
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;

type Vector = [f64; 3];

/// Programs of two moves.
const PAIRS: u64 = 4000;
/// Programs of many.
const CHAINS: u64 = 60;

fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn along(a: Vector, direction: Vector, length: f64) -> Vector {
    [a[0] + direction[0] * length, a[1] + direction[1] * length, a[2] + direction[2] * length]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// To 10⁻¹⁰ mm, as G-code has them.
fn rounded(mm: f64) -> f64 {
    (mm * 1e10).round() / 1e10
}

/// A programmed move.
#[derive(Clone, Copy, Debug)]
enum Asked {
    Line {
        from: Vector,
        to: Vector,
    },
    /// Axes of the plane, the normal last; centre in the plane; the sweep is counter-clockwise if positive.
    Arc {
        from: Vector,
        to: Vector,
        axes: [usize; 3],
        centre: [f64; 2],
        sweep: f64,
    },
}

impl Asked {
    fn to(&self) -> Vector {
        match *self {
            Self::Line { to, .. } | Self::Arc { to, .. } => to,
        }
    }

    /// The tangent at the end.
    fn heading(&self) -> Vector {
        match *self {
            Self::Line { from, to } => {
                let chord = subtract(to, from);
                chord.map(|c| c / norm(chord))
            }
            Self::Arc { to, axes: [first, second, _], centre, sweep, .. } => {
                let (x, y) = (to[first] - centre[0], to[second] - centre[1]);
                let mut heading = [0.0; 3];
                heading[first] = -y * sweep.signum() / x.hypot(y);
                heading[second] = x * sweep.signum() / x.hypot(y);
                heading
            }
        }
    }

    /// The point at a part of the sweep or the length.
    fn at(&self, part: f64) -> Vector {
        match *self {
            Self::Line { from, to } => along(from, subtract(to, from), part),
            Self::Arc { from, axes: [first, second, _], centre, sweep, .. } => {
                let (x, y) = (from[first] - centre[0], from[second] - centre[1]);
                let angle = y.atan2(x) + sweep * part;
                let mut point = from;
                point[first] = centre[0] + x.hypot(y) * angle.cos();
                point[second] = centre[1] + x.hypot(y) * angle.sin();
                point
            }
        }
    }

    fn distance(&self, point: Vector) -> f64 {
        let to_ends = norm(subtract(point, self.at(0.0))).min(norm(subtract(point, self.to())));
        match *self {
            Self::Line { from, to } => {
                let chord = subtract(to, from);
                let foot = dot(subtract(point, from), chord) / dot(chord, chord);
                if (0.0..=1.0).contains(&foot) {
                    norm(subtract(point, along(from, chord, foot)))
                } else {
                    to_ends
                }
            }
            Self::Arc { from, axes: [first, second, normal], centre, sweep, .. } => {
                let (x, y) = (point[first] - centre[0], point[second] - centre[1]);
                let (x0, y0) = (from[first] - centre[0], from[second] - centre[1]);
                let turned =
                    ((y.atan2(x) - y0.atan2(x0)) * sweep.signum()).rem_euclid(core::f64::consts::TAU);
                if turned <= sweep.abs() {
                    (x.hypot(y) - x0.hypot(y0)).hypot(point[normal] - from[normal])
                } else {
                    to_ends
                }
            }
        }
    }

    fn text(&self) -> String {
        match *self {
            Self::Line { to, .. } => format!("G1 X{:.10} Y{:.10} Z{:.10}\n", to[0], to[1], to[2]),
            Self::Arc { from, to, axes: [first, second, normal], centre, sweep } => {
                let (plane, words) = [("G19", "XJK"), ("G18", "YKI"), ("G17", "ZIJ")][normal];
                let words: Vec<char> = words.chars().collect();
                let turn = if sweep < 0.0 { "G2" } else { "G3" };
                format!(
                    "{plane} {turn} X{:.10} Y{:.10} Z{:.10} {}{:.10} {}{:.10}\n",
                    to[0],
                    to[1],
                    to[2],
                    words[1],
                    centre[0] - from[first],
                    words[2],
                    centre[1] - from[second]
                )
            }
        }
    }
}

/// An arc from `from` with the tangent `heading`, which lies in the plane.
fn arc(from: Vector, heading: Vector, normal: usize, radius: f64, sweep: f64) -> Asked {
    let axes = [(normal + 1) % 3, (normal + 2) % 3, normal];
    let (hx, hy) = (heading[axes[0]], heading[axes[1]]);
    // The centre lies to the left of a counter-clockwise arc.
    let (cx, cy) = (-hy * radius * sweep.signum(), hx * radius * sweep.signum());
    let centre = [rounded(from[axes[0]] + rounded(cx)), rounded(from[axes[1]] + rounded(cy))];
    let (sine, cosine) = sweep.sin_cos();
    let mut to = from;
    let (x, y) = (from[axes[0]] - centre[0], from[axes[1]] - centre[1]);
    to[axes[0]] = rounded(centre[0] + x * cosine - y * sine);
    to[axes[1]] = rounded(centre[1] + x * sine + y * cosine);
    Asked::Arc { from, to, axes, centre, sweep }
}

fn line(from: Vector, heading: Vector, length: f64) -> Asked {
    Asked::Line { from, to: along(from, heading, length).map(rounded) }
}

/// `heading` turned by `angle`: in the plane of `normal`, or anywhere.
fn turned(random: &mut Random, heading: Vector, normal: Option<usize>, angle: f64) -> Vector {
    let aside = loop {
        let other = match normal {
            Some(normal) => {
                let [first, second] = [(normal + 1) % 3, (normal + 2) % 3];
                let mut aside = [0.0; 3];
                let sign = random.sign();
                aside[first] = -heading[second] * sign;
                aside[second] = heading[first] * sign;
                aside
            }
            None => random.direction(),
        };
        let across = along(other, heading, -dot(other, heading));
        if norm(across) > 0.1 {
            break across.map(|c| c / norm(across));
        }
    };
    core::array::from_fn(|axis| heading[axis] * angle.cos() + aside[axis] * angle.sin())
}

/// The next move after a corner of `angle`.
fn next(
    random: &mut Random,
    from: Vector,
    heading: Vector,
    angle: f64,
    length: f64,
    plane: Option<usize>,
) -> Asked {
    let heading = turned(random, heading, plane, angle);
    match plane {
        Some(normal) if random.chance(0.5) => {
            let sweep = random.between(5.0_f64, 300.0).to_radians();
            arc(from, heading, normal, length.max(1e-3) / sweep, sweep * random.sign())
        }
        _ => line(from, heading, length),
    }
}

/// Corners and lengths of every size, in a plane or in space.
fn corners(random: &mut Random, moves: usize, length: (f64, f64), angle: (f64, f64)) -> Vec<Asked> {
    let plane = random.chance(0.7).then(|| random.below(3));
    let mut heading = random.direction();
    if let Some(normal) = plane {
        heading = [0.0; 3];
        let direction = random.between(0.0, core::f64::consts::TAU);
        heading[(normal + 1) % 3] = direction.cos();
        heading[(normal + 2) % 3] = direction.sin();
    }
    let mut at = [0.0; 3];
    let mut asked = Vec::new();
    for index in 0..moves {
        let length = random.log_between(length.0, length.1);
        let is_tangent = index > 0 && random.chance(0.2);
        let corner = if index == 0 || is_tangent { 0.0 } else { random.between(angle.0, angle.1) };
        let step = next(random, at, heading, corner, length, plane);
        (at, heading) = (step.to(), step.heading());
        asked.push(step);
    }
    asked
}

fn program(asked: &[Asked], tolerance: f64, feed_mm_min: f64) -> String {
    let moves: String = asked.iter().map(Asked::text).collect();
    format!("G64 P{tolerance:.10} F{feed_mm_min:.3}\n{moves}M2\n")
}

fn planned(text: &str, machine: &Machine) -> Result<Plan, String> {
    let program = gcode::read("corners.ngc", text.as_bytes()).map_err(|error| error.to_string())?;
    plan_program("corners.ngc", &program, machine, Mode::Spanning).map_err(|error| error.to_string())
}

/// A piece as the kernel gets it: derivatives by arc length are computed here.
struct Compiled {
    start: Vector,
    length: f64,
    /// Of u = s/length, per axis, as parts of the length; the first is the tangent.
    coefficients: [[f64; 7]; 3],
}

impl Compiled {
    /// Position and its first three derivatives by arc length.
    fn at(&self, u: f64) -> [Vector; 4] {
        let mut found = [[0.0; 3]; 4];
        for axis in 0..3 {
            for (index, &c) in self.coefficients[axis].iter().enumerate() {
                let mut factor = c * self.length;
                for (order, found) in found.iter_mut().enumerate() {
                    let power = index as i32 + 1 - order as i32;
                    if power >= 0 {
                        found[axis] += factor * u.powi(power) / self.length.powi(order as i32);
                    }
                    factor *= f64::from(power);
                }
            }
            found[0][axis] += self.start[axis];
        }
        found
    }
}

/// The pieces of every stretch.
fn compiled(plan: &Plan) -> Vec<Vec<Compiled>> {
    let mut stretches = vec![Vec::new()];
    for item in Executable::new::<f64>(plan).expect("planned").items {
        let (start, length, coefficients) = match item {
            Item::Line { start, direction, length, .. } => {
                (start, length, direction.map(|d| [d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
            }
            Item::Septic { start, coefficients, length, .. } => (start, length, coefficients),
            Item::EndOfStretch(_) => {
                stretches.push(Vec::new());
                continue;
            }
            _ => continue,
        };
        let piece = Compiled { start: start.map(Position::to_mm), length: length.to_mm(), coefficients };
        stretches.last_mut().expect("one").push(piece);
    }
    stretches.retain(|stretch| !stretch.is_empty());
    stretches
}

/// Nothing but snap steps within a stretch: gaps [mm], and steps of the first three derivatives, made numbers by the
/// length of the shorter piece.
fn continuous(stretches: &[Vec<Compiled>]) -> Result<(), String> {
    for pair in stretches.iter().flat_map(|pieces| pieces.windows(2)) {
        let (end, start) = (pair[0].at(1.0), pair[1].at(0.0));
        let shorter = pair[0].length.min(pair[1].length);
        let step = |order: usize| norm(subtract(end[order], start[order]));
        let steps = [step(0), step(1), step(2) * shorter, step(3) * shorter * shorter];
        // Coordinates are rounded to 2⁻³² mm and lines have their direction from them.
        let rounding = 2e-9 + 4e-10 / shorter;
        let limits = [2e-9, rounding, rounding, 10.0 * rounding];
        if !steps.iter().zip(limits).all(|(&step, limit)| step <= limit) {
            return Err(format!(
                "steps {steps:?} between pieces of {} and {} mm",
                pair[0].length, pair[1].length
            ));
        }
    }
    Ok(())
}

/// The greatest distance of the pieces from the path, and of the path from the pieces, over the tolerance.
fn distance(asked: &[Asked], stretches: &[Vec<Compiled>], tolerance: f64, samples: usize) -> f64 {
    let mut driven: Vec<Vector> = Vec::new();
    let mut worst = 0.0_f64;
    for piece in stretches.iter().flatten() {
        // Chords between the samples cut off at most a two-thousandth of the tolerance.
        let curvature = (0..=8).map(|part| norm(piece.at(f64::from(part) / 8.0)[2])).fold(0.0, f64::max);
        let samples = samples.max((piece.length * (curvature * 250.0 / tolerance).sqrt()).ceil() as usize);
        for part in 0..=samples {
            let [point, ..] = piece.at(part as f64 / samples as f64);
            let nearest = asked.iter().map(|step| step.distance(point)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest);
            driven.push(point);
        }
    }
    let chords: Vec<Asked> = driven
        .windows(2)
        .filter(|pair| norm(subtract(pair[0], pair[1])) > 0.0)
        .map(|pair| Asked::Line { from: pair[0], to: pair[1] })
        .collect();
    for step in asked {
        // Near the ends, where blends are, most of all.
        for part in 0..=40 {
            let part = f64::from(part) / 40.0;
            let part = part * part * (3.0 - 2.0 * part);
            let point = step.at(part);
            let nearest = chords.iter().map(|chord| chord.distance(point)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest);
        }
    }
    worst / tolerance
}

fn seeds(count: u64) -> impl Iterator<Item = u64> {
    let first = check::from_env("MOTION_TEST_SEED").unwrap_or(1);
    first..first + check::from_env("MOTION_TEST_PROGRAMS").unwrap_or(count)
}

fn assert_none(failures: &[String]) {
    let shown: Vec<_> = failures.iter().take(8).map(String::as_str).collect();
    assert!(failures.is_empty(), "{} failed:\n{}", failures.len(), shown.join("\n"));
}

/// Any two moves, corners from 1° to 165°, lengths from 1 µm to 100 mm, tolerances from 1 µm to 1 mm.
#[test]
fn a_blend_keeps_its_tolerance_and_steps_nowhere() {
    let machine = Machine::reference();
    let mut failures = Vec::new();
    let (mut worst, mut close, mut blends) = (0.0_f64, 0, 0);
    for seed in seeds(PAIRS) {
        let mut random = Random::new(seed);
        let radians = |degrees: f64| degrees.to_radians();
        let asked = corners(&mut random, 2, (1e-3, 100.0), (radians(1.0), radians(165.0)));
        let tolerance = rounded(random.log_between(1e-3, 1.0));
        let text = program(&asked, tolerance, 60_000.0);
        let done = || -> Result<f64, String> {
            let plan = planned(&text, &machine)?;
            let stretches = compiled(&plan);
            continuous(&stretches)?;
            let ratio = distance(&asked, &stretches, tolerance, 60);
            blends += plan.blocks.iter().filter(|block| block.kind == "blend").count();
            if ratio > 1.0 + 1e-6 {
                return Err(format!("{ratio} times the tolerance"));
            }
            if stretches.len() != 1 && !is_straight_on(&asked) {
                return Err("a stop".to_owned());
            }
            Ok(ratio)
        }();
        match done {
            Ok(ratio) => {
                worst = worst.max(ratio);
                close += u32::from(ratio > 0.99);
            }
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{blends} blends, worst {worst} of the tolerance, {close} above 0.99");
    assert_none(&failures);
    if check::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(blends > 3000 && close > 600, "{blends} blends, {close} that use their tolerance");
    }
}

/// Two lines in one direction have nothing to blend.
fn is_straight_on(asked: &[Asked]) -> bool {
    asked.iter().all(|step| matches!(step, Asked::Line { .. }))
        && norm(subtract(asked[0].heading(), asked[1].heading())) < 1e-6
}

/// What the ticks of a program came to.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    /// Greatest |V|, |A|, |J| of an axis over its limit.
    axis: [f64; 3],
    /// Greatest magnitude of A and J as vectors over the path's limit.
    path: [f64; 2],
    /// Greatest change of an axis' jerk in a tick, over what snap allows.
    jerk_step: f64,
    ticks: u64,
}

/// Executes a plan with the kernel's executor and looks at every tick.
fn driven<R: Real>(plan: &Plan, machine: &Machine) -> Result<Worst, String> {
    let executable = Executable::new::<R>(plan).map_err(|error| error.to_string())?;
    let start = [Position::ZERO; 3];
    let mut streams = Streams::<R, 3, 64, 64>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    let mut worst = Worst::default();
    let mut last_jerk = [0.0; 3];
    loop {
        supply.fill(&mut feeder).map_err(|rejection| format!("rejected: {rejection}"))?;
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        let of = |figure: fn(&motion_kernel::path::Setpoint<R>) -> R| {
            core::array::from_fn::<f64, 3, _>(|axis| figure(&executed.setpoints[axis]).to_f64())
        };
        let (v, a, j) = (of(|s| s.velocity_mm_s), of(|s| s.accel_mm_s2), of(|s| s.jerk_mm_s3));
        for (axis, limits) in machine.axes.iter().enumerate() {
            let ratios =
                [v[axis] / limits.feed_mm_s, a[axis] / limits.accel_mm_s2, j[axis] / limits.jerk_mm_s3];
            for (worst, ratio) in worst.axis.iter_mut().zip(ratios) {
                *worst = worst.max(ratio.abs());
            }
            let step = (j[axis] - last_jerk[axis]).abs() / (limits.snap_mm_s4 * machine.tick_s);
            worst.jerk_step = worst.jerk_step.max(step);
        }
        worst.path[0] = worst.path[0].max(norm(a) / machine.path.accel_mm_s2);
        worst.path[1] = worst.path[1].max(norm(j) / machine.path.jerk_mm_s3);
        last_jerk = j;
        worst.ticks += 1;
        match executed.state {
            ExecState::Idle if supply.is_empty() => return Ok(worst),
            ExecState::Stopped => executor.resume(),
            _ => {}
        }
        if worst.ticks as f64 > plan.time_s / machine.tick_s + 1000.0 {
            return Err("no end".to_owned());
        }
    }
}

impl Worst {
    fn check(&self) -> Result<(), String> {
        let all = self.axis.iter().chain(&self.path);
        if all.copied().fold(0.0, f64::max) > 1.0 + 1e-6 || self.jerk_step > 1.0 + 1e-6 {
            return Err(format!("{self:?}"));
        }
        Ok(())
    }

    fn max(self, other: Self) -> Self {
        Self {
            axis: core::array::from_fn(|index| self.axis[index].max(other.axis[index])),
            path: core::array::from_fn(|index| self.path[index].max(other.path[index])),
            jerk_step: self.jerk_step.max(other.jerk_step),
            ticks: self.ticks + other.ticks,
        }
    }
}

/// Many moves one after the other, on machines whose axes differ: every tick within every limit, jerk without a
/// step, the tolerance kept over the whole path.
#[test]
fn every_tick_of_blended_programs_keeps_the_limits() {
    let mut failures = Vec::new();
    let (mut worst, mut worst_distance) = (Worst::default(), 0.0_f64);
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let mut machine = Machine::reference();
        for axis in &mut machine.axes {
            let softer = random.between(0.3, 1.0);
            axis.accel_mm_s2 *= softer;
            axis.jerk_mm_s3 *= softer;
            axis.snap_mm_s4 *= softer;
            axis.feed_mm_s *= random.between(0.1, 1.0);
        }
        let lengths = if random.chance(0.5) { (0.1, 20.0) } else { (0.005, 0.5) };
        let moves = 3 + random.below(20);
        let asked = corners(&mut random, moves, lengths, (1e-3, 2.8));
        let tolerance = rounded(random.log_between(1e-3, 0.3));
        let text = program(&asked, tolerance, random.log_between(60.0, 12_000.0));
        let done = || -> Result<Worst, String> {
            let plan = planned(&text, &machine)?;
            let stretches = compiled(&plan);
            continuous(&stretches)?;
            let ratio = distance(&asked, &stretches, tolerance, 24);
            worst_distance = worst_distance.max(ratio);
            if ratio > 1.0 + 1e-6 {
                return Err(format!("{ratio} times the tolerance"));
            }
            let found = driven::<f64>(&plan, &machine)?;
            found.check().map(|()| found)
        }();
        match done {
            Ok(found) => worst = worst.max(found),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{worst:?}, worst distance {worst_distance} of the tolerance");
    assert_none(&failures);
}

/// Curves and corners in short chords that lie beside them by a part of the tolerance, as a scanner or a rounding
/// postprocessor leaves them.
fn chords(random: &mut Random, tolerance: f64) -> Vec<Asked> {
    let (mut on_curve, mut heading) = ([0.0, 0.0], random.between(0.0, core::f64::consts::TAU));
    let (mut at, mut asked) = ([0.0; 3], Vec::new());
    let beside = tolerance * random.between(0.0, 0.5);
    for _ in 0..4 {
        heading += random.between(-1.2, 1.2);
        let length = tolerance * random.log_between(0.5, 20.0);
        let turn = random.between(-0.05, 0.05);
        for _ in 0..10 + random.below(40) {
            heading += turn;
            on_curve = [on_curve[0] + length * heading.cos(), on_curve[1] + length * heading.sin()];
            let to = [0, 1].map(|axis| rounded(on_curve[axis] + beside * random.between(-1.0, 1.0)));
            let to = [to[0], to[1], 0.0];
            asked.push(Asked::Line { from: at, to });
            at = to;
        }
    }
    asked
}

/// What merging and blending leave of the tolerance together.
#[test]
fn merged_chords_keep_the_tolerance() {
    let machine = Machine::reference();
    let mut failures = Vec::new();
    let (mut worst, mut merged, mut all) = (0.0_f64, 0, 0);
    for seed in seeds(CHAINS) {
        let mut random = Random::new(seed);
        let tolerance = rounded(random.log_between(3e-3, 0.3));
        let asked = chords(&mut random, tolerance);
        let text = program(&asked, tolerance, 6000.0);
        let done = || -> Result<f64, String> {
            let plan = planned(&text, &machine)?;
            all += asked.len();
            merged += plan.blocks.iter().filter(|block| block.kind != "blend").count();
            let stretches = compiled(&plan);
            continuous(&stretches)?;
            let ratio = distance(&asked, &stretches, tolerance, 24);
            if ratio > 1.0 + 1e-6 { Err(format!("{ratio} times the tolerance")) } else { Ok(ratio) }
        }();
        match done {
            Ok(ratio) => worst = worst.max(ratio),
            Err(error) => failures.push(format!("MOTION_TEST_SEED={seed}: {error}\n{text}")),
        }
    }
    println!("{all} chords became {merged} lines and arcs, worst {worst} of the tolerance");
    assert_none(&failures);
    if check::from_env("MOTION_TEST_PROGRAMS").is_none() {
        assert!(2 * merged < all && worst > 0.9, "{merged} of {all}, worst {worst}");
    }
}

/// The feeds of septic blends that the literature of the method quotes, for 30°, 60°, 90° and 120° within 0.05 mm
/// at 500 mm/s² and 5000 mm/s³; snap does not limit them there.
#[test]
fn corners_are_passed_as_fast_as_septic_blends_can_be() {
    let mut machine = Machine::reference();
    machine.path.snap_mm_s4 = 1e9;
    for axis in &mut machine.axes {
        axis.snap_mm_s4 = 1e9;
    }
    for (degrees, feed_mm_s) in [(30.0_f64, 13.4), (60.0, 6.31), (90.0, 3.69), (120.0, 2.13)] {
        let first = line([0.0; 3], [1.0, 0.0, 0.0], 20.0);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let asked = [first, line(first.to(), [cosine, sine, 0.0], 20.0)];
        let plan = planned(&program(&asked, 0.05, 60_000.0), &machine).expect("a plan");
        let blend = plan.blocks.iter().find(|block| block.kind == "blend").expect("a blend");
        println!("{degrees}°: {} mm/s", blend.peak_mm_s);
        assert!(blend.peak_mm_s >= feed_mm_s, "{degrees}°: {} mm/s, expected {feed_mm_s}", blend.peak_mm_s);
        assert!(blend.enter_mm_s >= feed_mm_s && blend.exit_mm_s >= feed_mm_s);
        let worst = driven::<f64>(&plan, &machine).expect("a run");
        assert!(worst.check().is_ok(), "{worst:?}");
    }
}

/// Gentle corners are passed in less time than stopping takes, however short the lines beside them.
#[test]
fn gentle_corners_cost_less_than_stops() {
    let machine = Machine::reference();
    for degrees in [2.0_f64, 5.0, 15.0] {
        for length in [0.2, 1.0, 10.0] {
            let first = line([0.0; 3], [1.0, 0.0, 0.0], length);
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let text = program(&[first, line(first.to(), [cosine, sine, 0.0], length)], 0.05, 6000.0);
            let blended = planned(&text, &machine).expect("a plan").time_s;
            let exact = planned(&text.replace("G64 P0.0500000000", "G61"), &machine).expect("a plan").time_s;
            assert!(blended < 0.9 * exact, "{degrees}°, {length} mm: {blended} s, with a stop {exact} s");
        }
    }
}

/// A circle of 10 mm radius in chords of a tenth of a millimetre is driven almost like a circle.
#[test]
fn a_tessellated_circle_runs_smoothly() {
    let machine = Machine::reference();
    let points = (1..=628).map(|index| {
        let (sine, cosine) = (core::f64::consts::TAU * f64::from(index) / 628.0).sin_cos();
        [10.0 * cosine - 10.0, 10.0 * sine, 0.0].map(|mm| (mm * 1e4).round() / 1e4)
    });
    let mut at = [0.0; 3];
    let asked: Vec<Asked> = points
        .map(|to| {
            let from = at;
            at = to;
            Asked::Line { from, to }
        })
        .collect();
    for tolerance in [0.005, 0.05] {
        let plan = planned(&program(&asked, tolerance, 6000.0), &machine).expect("a plan");
        let worst = driven::<f64>(&plan, &machine).expect("a run");
        assert!(worst.check().is_ok(), "{worst:?}");
        let stretches = compiled(&plan);
        assert_eq!(stretches.len(), 1);
        assert!(distance(&asked, &stretches, tolerance, 24) <= 1.0 + 1e-6);
        let feed = plan.length_mm / plan.time_s;
        println!("P{tolerance}: {feed} mm/s on average");
        // A true circle from rest to rest: 36 mm/s.
        assert!(feed > 30.0, "P{tolerance}: {feed} mm/s");
    }
}

/// The programs of the tests, blended, in every number type.
#[test]
fn whole_programs_keep_the_limits_in_every_number_type() {
    let machine = Machine::reference();
    for (name, text) in [
        ("pockets", include_str!("../programs/pockets.ngc")),
        ("nameplate", include_str!("../programs/nameplate_inch.ngc")),
        ("thread mill", include_str!("../programs/thread_mill_helix.ngc")),
        ("stringer", include_str!("../../host/src/cli/stringer.ngc")),
    ] {
        let exact = planned(text, &machine).expect("a plan");
        // Where nothing says G61, exact path is what is so at the start.
        let blended = if text.contains("G61") {
            text.replace("G61", "G64 P0.05")
        } else {
            format!("G64 P0.05\n{text}")
        };
        let plan = planned(&blended, &machine).expect("a plan");
        assert!(plan.blocks.iter().any(|block| block.kind == "blend"), "{name}");
        println!("{name}: {} s exact, {} s blended", exact.time_s, plan.time_s);
        for worst in
            [driven::<f64>(&plan, &machine), driven::<f32>(&plan, &machine), driven::<Fixed>(&plan, &machine)]
        {
            let worst = worst.unwrap_or_else(|error| panic!("{name}: {error}"));
            // f32 and fixed point round jerk to some millionths of its limit.
            let all = worst.axis.into_iter().chain(worst.path).chain([worst.jerk_step]);
            assert!(all.fold(0.0, f64::max) < 1.0 + 1e-4, "{name}: {worst:?}");
        }
    }
}

/// G61 is as it was: tangent joints run through, corners stop, nothing is blended.
#[test]
fn exact_path_stops_at_corners_only() {
    let machine = Machine::reference();
    let text = "G61 F6000\nG1 X10\nX20\nY10\nG64 P0.05\nX30\nX30 Y20\nG61\nX40\nY30\nM2\n";
    let plan = planned(text, &machine).expect("a plan");
    let kinds: Vec<_> = plan.blocks.iter().map(|block| (block.line, block.kind)).collect();
    let blended = [(6, "line"), (6, "blend"), (7, "line"), (9, "line")];
    let mut expected = vec![(2, "line"), (3, "line"), (4, "line")];
    expected.extend(blended);
    expected.push((10, "line"));
    assert_eq!(kinds, expected);
    let stretches = plan.items.iter().filter(|item| matches!(item, PlanItem::Stretch(_))).count();
    assert_eq!(stretches, 5);
}

/// Without P the machine's tolerance holds; P0 and turns of more than 170° stay exact.
#[test]
fn what_is_not_blended() {
    let mut machine = Machine::reference();
    let blends = |machine: &Machine, text: &str| {
        planned(text, machine).expect("a plan").blocks.iter().filter(|block| block.kind == "blend").count()
    };
    assert_eq!(blends(&machine, "G64 F600\nG1 X10\nY10\nM2\n"), 1);
    assert_eq!(blends(&machine, "G64 P0 F600\nG1 X10\nY10\nM2\n"), 0);
    assert_eq!(blends(&machine, "G64 P1 F600\nG1 X10\nX0 Y1.77\nM2\n"), 1);
    assert_eq!(blends(&machine, "G64 P1 F600\nG1 X10\nX0 Y1.75\nM2\n"), 0);
    machine.path.blend_tolerance_mm = 0.0;
    assert_eq!(blends(&machine, "G64 F600\nG1 X10\nY10\nM2\n"), 0);
}
