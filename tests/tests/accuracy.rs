//! How far fixed point and f32 are from f64: one plan, executed in all three side by side, every tick compared.
//!
//! The result is a committed table, `tests/expected/accuracy.md`; see `motion_tests::figures`.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use motion_host::drive::inverse::inverse;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode, Plan};
use motion_kernel::axis::{DriveInverse, Feedforward, Table, Tables};
use motion_kernel::exec::{ExecState, Executed, Executor};
use motion_kernel::internals::{FeedforwardConfig, FeedforwardState};
use motion_kernel::num::{Fixed, Real};
use motion_kernel::path::Setpoint;
use motion_kernel::program::Supply;
use motion_kernel::queue::Streams;
use motion_kernel::units::Position;
use motion_tests::check::drive::{PIECES, SEGMENTS, is_beyond_fixed_point};
use motion_tests::check::totals::Totals;
use motion_tests::check::{drive, machine, planned, program};
use motion_tests::figures::{Table as Figures, hold};
use motion_tests::judge::along;
use motion_tests::random::Random;

const STRINGER: &str = include_str!("../../host/src/cli/stringer.ngc");
const MM_PER_COUNT: f64 = 1e-4;
/// Promised of fixed point: a quarter of a count.
const COUNTS_MAX: f64 = 0.25;
/// Random programs, by their seeds from 1; longer ones than this are not executed [ticks].
const PROGRAMS: u64 = 1000;
const TICKS_MAX: f64 = 150_000.0;
/// So many of them have to be executed.
const EXECUTED_MIN: u64 = 900;

/// The preview of the reference machine's inverse \[ticks\].
const PREVIEW_TICKS: u8 = 4;

/// What an executor says of a tick, in f64: state, stretches, positions, then feed, acceleration, jerk and snap along
/// the path, then velocity, acceleration and jerk of the axes.
struct Tick {
    state: ExecState,
    stretches: u32,
    positions: [Position; 3],
    along: [f64; 4],
    axes: [[f64; 3]; 3],
}

impl Tick {
    fn new<R: Real>(executed: &Executed<R, 3>) -> Self {
        let (motion, set) = (&executed.motion, &executed.setpoints);
        Self {
            state: executed.state,
            stretches: executed.stretches,
            positions: set.map(|axis| axis.position),
            along: along(motion),
            axes: set.map(|axis| [axis.velocity_mm_s, axis.accel_mm_s2, axis.jerk_mm_s3].map(R::to_f64)),
        }
    }
}

/// The greatest differences from f64, and the greatest excess of a limit.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    counts: f64,
    /// Of an axis' velocity, acceleration and jerk, as parts of the axis' limits.
    axes: [f64; 3],
    /// Of feed, acceleration, jerk and snap along the path, as a part of the limit.
    excess: f64,
    ticks: u64,
    programs: u64,
}

impl Worst {
    fn tick(&mut self, machine: &Machine, found: &Tick, reference: &Tick) {
        self.ticks += 1;
        for (found, reference) in found.positions.iter().zip(&reference.positions) {
            self.counts = self.counts.max((*found - *reference).to_mm().abs() / MM_PER_COUNT);
        }
        for ((found, reference), axis) in found.axes.iter().zip(&reference.axes).zip(&machine.axes) {
            let limits = [axis.feed_mm_s, axis.accel_mm_s2, axis.jerk_mm_s3];
            for k in 0..3 {
                self.axes[k] = self.axes[k].max((found[k] - reference[k]).abs() / limits[k]);
            }
        }
        let path = &machine.path;
        let limits = [path.feed_mm_s, path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4];
        for (value, limit) in found.along.iter().zip(limits) {
            self.excess = self.excess.max(value.abs() / limit - 1.0);
        }
    }

    fn add(&mut self, other: &Self) {
        self.counts = self.counts.max(other.counts);
        for (axis, other) in self.axes.iter_mut().zip(other.axes) {
            *axis = axis.max(other);
        }
        self.excess = self.excess.max(other.excess);
        self.ticks += other.ticks;
        self.programs += other.programs;
    }
}

/// Executes all of a plan; every tick is handed to `see`.
fn execute<R: Real>(
    executable: &Executable,
    machine: &Machine,
    mut see: impl FnMut(Tick),
) -> Result<(), String> {
    let start = [Position::ZERO; 3];
    let mut streams = Streams::<R, 3, PIECES, SEGMENTS>::new();
    let (mut feeder, mut intake) = streams.split(machine.rules(), start);
    let mut executor = Executor::<R, 3>::new(start);
    let mut supply = Supply::new(executable.supplied(), executable.tick_s);
    loop {
        supply.fill(&mut feeder).map_err(|rejection| format!("rejected: {rejection}"))?;
        let executed = executor.tick(&mut intake).map_err(|fault| format!("{fault:?}"))?;
        see(Tick::new(&executed));
        match executed.state {
            ExecState::Idle if supply.is_empty() => return Ok(()),
            ExecState::Stopped => executor.resume(),
            _ => {}
        }
    }
}

/// A plan executed in `R` against what f64 made of it.
fn against<R: Real>(plan: &Plan, machine: &Machine, reference: &[Tick]) -> Result<Option<Worst>, String> {
    let executable = match Executable::new::<R>(plan) {
        Ok(executable) => executable,
        Err(error) if is_beyond_fixed_point(&error.problem) => return Ok(None),
        Err(error) => return Err(error.to_string()),
    };
    let mut worst = Worst { programs: 1, ..Worst::default() };
    let (mut tick, mut differs) = (0, None);
    execute::<R>(&executable, machine, |found| {
        let same =
            reference.get(tick).filter(|tick| (tick.state, tick.stretches) == (found.state, found.stretches));
        match same {
            Some(reference) => worst.tick(machine, &found, reference),
            None => differs = differs.or(Some(tick)),
        }
        tick += 1;
    })?;
    match differs {
        None if tick == reference.len() => Ok(Some(worst)),
        _ => Err(format!("{tick} ticks, {} in f64; first differs in {differs:?}", reference.len())),
    }
}

/// A plan in f64, in fixed point and in f32; none where it is beyond the type.
fn all(plan: &Plan, machine: &Machine) -> Result<[Option<Worst>; 3], String> {
    let executable = Executable::new::<f64>(plan).map_err(|error| error.to_string())?;
    let mut reference = Vec::new();
    execute::<f64>(&executable, machine, |tick| reference.push(tick))?;
    Ok([
        against::<f64>(plan, machine, &reference).map_err(|error| format!("f64: {error}"))?,
        against::<Fixed>(plan, machine, &reference).map_err(|error| format!("fixed: {error}"))?,
        against::<f32>(plan, machine, &reference).map_err(|error| format!("f32: {error}"))?,
    ])
}

fn reference_machine(text: &str) -> [Worst; 3] {
    let machine = Machine::reference();
    let plan = planned(text, &machine).expect("a plan");
    all(&plan, &machine).expect("executed").map(|worst| worst.expect("within the type's range"))
}

/// What became of the random programs.
#[derive(Debug, Default)]
struct Programs {
    worst: [Worst; 3],
    /// Not executed, by reason.
    refused: BTreeMap<String, u64>,
    failures: Vec<String>,
}

impl Programs {
    fn one(&mut self, seed: u64) -> Result<(), String> {
        let mut random = Random::new(seed);
        let machine = machine::any(&mut random);
        let fragments = 1 + random.below(24);
        let program = program::generate(&mut random, fragments, machine.path.feed_mm_s);
        let mode = if random.chance(0.5) { Mode::Spanning } else { Mode::PerBlock };
        let mut totals = Totals::default();
        let plan = drive::plan(&program.text, &machine, mode, &mut totals)?;
        for (reason, count) in totals.refused {
            *self.refused.entry(reason).or_default() += count;
        }
        let Some(plan) = plan else { return Ok(()) };
        if plan.time_s / machine.tick_s > TICKS_MAX {
            *self.refused.entry(format!("longer than {TICKS_MAX} ticks")).or_default() += 1;
            return Ok(());
        }
        for ((worst, found), number) in self.worst.iter_mut().zip(all(&plan, &machine)?).zip(NUMBERS) {
            match found {
                Some(found) => worst.add(&found),
                None => *self.refused.entry(format!("beyond {number}")).or_default() += 1,
            }
        }
        Ok(())
    }
}

const NUMBERS: [&str; 3] = ["f64", "fixed point", "f32"];

/// The random programs, on all cores.
fn random_programs() -> Programs {
    let next = AtomicU64::new(1);
    let all = Mutex::new(Programs::default());
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let mut done = Programs::default();
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed > PROGRAMS {
                        break;
                    }
                    if let Err(error) = done.one(seed) {
                        done.failures.push(format!("seed {seed}: {error}"));
                    }
                }
                let mut all = all.lock().expect("no worker panics");
                for (all, done) in all.worst.iter_mut().zip(done.worst) {
                    all.add(&done);
                }
                for (reason, count) in done.refused {
                    *all.refused.entry(reason).or_default() += count;
                }
                all.failures.append(&mut done.failures);
            });
        }
    });
    all.into_inner().expect("no worker panics")
}

/// What feedforward makes of set-points (velocity, acceleration, jerk of each tick), in `R` \[mm/s\].
fn commands<R: Real>(feedforward: &Feedforward, tick_s: f64, setpoints: &[[f64; 3]]) -> Vec<f64> {
    let config =
        FeedforwardConfig::<R>::new(feedforward, PREVIEW_TICKS, tick_s).expect("within the type's range");
    let mut state = FeedforwardState::default();
    let command = |&[velocity, accel, jerk]: &[f64; 3]| {
        let setpoint = Setpoint {
            position: Position::ZERO,
            velocity_mm_s: R::from_f64(velocity),
            accel_mm_s2: R::from_f64(accel),
            jerk_mm_s3: R::from_f64(jerk),
        };
        config.tick(&mut state, &setpoint).to_f64()
    };
    setpoints.iter().map(command).collect()
}

/// The set-points of X that a plan has in `R`.
fn of_x<R: Real>(executable: &Executable, machine: &Machine) -> Vec<[f64; 3]> {
    let mut setpoints = Vec::new();
    execute::<R>(executable, machine, |tick| setpoints.push(tick.axes[0])).expect("executed");
    setpoints
}

/// Feedforward by itself: what differs from f64 in the command, of set-points of the same number type, so that all that a
/// tick rounds is counted.
#[test]
fn feedforward_in_fixed_point_and_f32_against_f64() {
    let machine = Machine::reference();
    let tick_s = machine.tick_s;
    let plan = planned(STRINGER, &machine).expect("a plan");
    let executable = Executable::new::<Fixed>(&plan).expect("within fixed point");
    let stringer = [
        of_x::<f64>(&executable, &machine),
        of_x::<Fixed>(&executable, &machine),
        of_x::<f32>(&executable, &machine),
    ];
    // 20 s of the motion that shakes the bed most: rounding would add up in its state.
    let omega = TAU * 13.4 / 1.06_f64.sqrt();
    let swing = |tick: u32| {
        let (sine, cosine) = (omega * f64::from(tick) * tick_s).sin_cos();
        [35.8 * sine, 35.8 * omega * cosine, -35.8 * omega * omega * sine]
    };
    let shaken: Vec<[f64; 3]> = (0..40_000).map(swing).collect();
    let shaken = [shaken.clone(), shaken.clone(), shaken];

    let whole = inverse(&machine.axes[1].drive, tick_s);
    let without_bed = whole.drive.map(|drive| DriveInverse { bed: None, ..drive });
    let line = |reach: f64| Some(Table::new(reach, &[-0.5, -0.3, -0.25, -0.2, 0.0, 0.1, 0.2, 0.4, 0.6]));
    let tables = Tables { velocity: line(60.0), accel: line(400.0), jerk: line(4e3) };
    let mut table = Figures::new(&["feedforward", "set-points", "number type", "command off f64 [nm/s]"]);
    for (what, feedforward) in [
        ("V, A, J", Feedforward { lead_s: 0.00167, ..machine.axes[0].feedforward }),
        ("with tables", Feedforward { lead_s: 0.00167, tables, ..machine.axes[0].feedforward }),
        ("inverse", Feedforward { drive: without_bed, ..whole }),
        ("inverse with bed", whole),
    ] {
        for (run, setpoints) in [("stringer flange", &stringer), ("13 Hz, 20 s", &shaken)] {
            let [exact, fixed, single] = setpoints;
            let exact = commands::<f64>(&feedforward, tick_s, exact);
            let found = [
                commands::<Fixed>(&feedforward, tick_s, fixed),
                commands::<f32>(&feedforward, tick_s, single),
            ];
            for (number, found) in NUMBERS[1..].iter().zip(found) {
                let off = |(found, exact): (&f64, &f64)| (found - exact).abs();
                let worst_mm_s = found.iter().zip(&exact).map(off).fold(0.0, f64::max);
                // A hundredth of the converter's step, 0.01 mm/s.
                assert!(
                    worst_mm_s < 1e-4 && found.len() == exact.len(),
                    "{what}, {run}, {number}: {worst_mm_s}"
                );
                table.row(&[what, run, number, &format!("{:.1}", worst_mm_s * 1e6)]);
            }
        }
    }
    println!("{}", table.to_markdown());
    if let Err(difference) = hold("feedforward", &table, 0.02) {
        panic!("{difference}");
    }
}

/// Two digits.
fn part(value: f64) -> String {
    if value <= 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

fn rows(table: &mut Figures, run: &str, worst: &[Worst; 3]) {
    for (number, worst) in NUMBERS.iter().zip(worst) {
        let mut cells = vec![run.to_owned(), (*number).to_owned()];
        if *number == "f64" {
            cells.extend(["–"; 4].map(str::to_owned));
        } else {
            cells.push(format!("{:.4}", worst.counts));
            cells.extend(worst.axes.map(part));
        }
        cells.push(part(worst.excess));
        table.row(&cells);
    }
}

#[test]
fn fixed_point_and_f32_against_f64() {
    let programs = random_programs();
    println!("random programs: {programs:?}");
    assert!(programs.failures.is_empty(), "{:#?}", programs.failures);
    let straight = reference_machine("G61 G1 X8000 F18000\nM2\n");
    let diagonal = reference_machine("G61 G1 X5000 Y-4000 Z4795.8315233 F18000\nM2\n");
    let stringer = reference_machine(STRINGER);
    let executed = programs.worst.map(|worst| worst.programs);
    let refused: String =
        programs.refused.iter().map(|(reason, count)| format!(", {count} {reason}")).collect();
    let run = format!("{PROGRAMS} random programs{refused}");

    let mut table = Figures::new(&[
        "executed",
        "number type",
        "positions off f64 [counts of 0.1 µm]",
        "velocity off f64 [parts of the axis' limit]",
        "acceleration off f64 [parts]",
        "jerk off f64 [parts]",
        "path limits exceeded by [parts]",
    ]);
    for (run, worst) in [
        ("8 m along X, 300 mm/s", &straight),
        ("8 m diagonally, 300 mm/s", &diagonal),
        ("stringer flange", &stringer),
        (&run, &programs.worst),
    ] {
        rows(&mut table, run, worst);
        assert_eq!(worst[0].counts, 0.0, "{run}: f64 differs from itself");
        assert!(worst[1].counts <= COUNTS_MAX, "{run} in fixed point: {:?}", worst[1]);
    }
    println!("{}", table.to_markdown());
    assert!(executed.iter().all(|&count| count >= EXECUTED_MIN), "{executed:?}");
    if let Err(difference) = hold("accuracy", &table, 0.02) {
        panic!("{difference}");
    }
}
