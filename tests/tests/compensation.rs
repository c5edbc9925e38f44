//! Screws with errors, and their compensation: where the load is, which the encoder does not see.
//!
//! The load's error is its distance from the set path, found from positions alone. Both axes have 20 µm of play and a pitch
//! error of ±10 µm over 5 mm.

use core::convert::Infallible;

use hal_sim::{PitchErrorParameters, ScrewParameters};
use motion_host::drive::screw::{Survey, measure};
use motion_host::identify::{ScrewSearch, identify_screw};
use motion_host::machine::Machine;
use motion_host::planning::Plan;
use motion_host::simulate::hardware::{Simulated, SimulatedHardware, simulated};
use motion_host::simulate::inject::Injections;
use motion_host::simulate::{Hardware, Job, Number, RunOptions, run_on, run_with};
use motion_host::trace::TracedFault;
use motion_kernel::axis::{AxisCompensation, Backlash, BedInverse, DriveInverse, Feedforward, PitchError};
use motion_kernel::hal::{
    DriveEnable, Encoder, Inputs, MachineInputs, OutputState, Outputs, VelocityChannel,
};
use motion_kernel::kernel::Kernel;
use motion_kernel::num::Scalar;
use motion_kernel::queue::Streams;
use motion_kernel::trace::Trace;
use motion_kernel::units::{Counts, DacCode, Position};

const STRINGER: &str = include_str!("../../host/src/cli/stringer.ngc");
/// Twice round, with a quadrant after every quarter, from rest to rest.
const CIRCLE: &str = "G21 G90 G64 P0\nG3 X0 Y0 I20 J0 F2150\nG3 X0 Y0 I20 J0\nM2\n";
const PLAY_MM: f64 = 0.02;
const TAKE_UP_S: f64 = 0.006;
const PITCH_MM: f64 = 5.0;
const AMPLITUDE_MM: f64 = 0.01;
const PHASES_RAD: [f64; 2] = [0.7, 2.1];

/// What the machines have.
#[derive(Clone, Copy, PartialEq)]
enum Screws {
    Ideal,
    WithErrors,
    Compensated,
}

fn screw(axis: usize) -> ScrewParameters {
    let error =
        PitchErrorParameters { pitch_mm: PITCH_MM, amplitude_mm: AMPLITUDE_MM, phase_rad: PHASES_RAD[axis] };
    ScrewParameters { pitch_error: Some(error), backlash_mm: PLAY_MM }
}

/// A turn as it would be measured: load − motor at 32 places of the load. By bisection: the screw is told over the motor.
fn measured(axis: usize) -> PitchError {
    let error = screw(axis).pitch_error.expect("an error");
    let load_of = |motor_mm: f64| motor_mm + error.error_mm(motor_mm) - error.error_mm(0.0);
    let points_um: Vec<f64> = (0..32)
        .map(|index| {
            let load_mm = PITCH_MM / 32.0 * f64::from(index);
            let (mut low_mm, mut high_mm) = (load_mm - 0.1, load_mm + 0.1);
            for _ in 0..60 {
                let middle_mm = 0.5 * (low_mm + high_mm);
                if load_of(middle_mm) < load_mm { low_mm = middle_mm } else { high_mm = middle_mm }
            }
            (load_mm - low_mm) * 1e3
        })
        .collect();
    PitchError::new(0.0, PITCH_MM / 32.0, &points_um, true).expect("a table")
}

/// The reference machine, or that with feedforward by the inverse of its drives and with a preview.
fn machine(screws: Screws, is_inverted: bool) -> Machine {
    let mut machine = Machine::reference();
    for (index, axis) in machine.axes[..2].iter_mut().enumerate() {
        if screws != Screws::Ideal {
            axis.screw = screw(index);
        }
        if screws == Screws::Compensated {
            let backlash = Backlash { play_mm: PLAY_MM, take_up_s: TAKE_UP_S };
            axis.compensation =
                Some(AxisCompensation { backlash: Some(backlash), pitch_error: Some(measured(index)) });
        }
        if is_inverted {
            let bed = axis.drive.bed.map(|bed| BedInverse {
                frequency_hz: bed.frequency_hz,
                damping_ratio: bed.damping_ratio,
                mass_ratio: bed.mass_ratio,
            });
            let drive = DriveInverse {
                velocity_gain_per_s: axis.drive.velocity_gain_per_s,
                integral_time_s: axis.drive.integral_time_s,
                current_lag_s: axis.drive.current_lag_s,
                viscous_friction_per_s: axis.drive.viscous_friction_per_s,
                coulomb_friction_mm_s2: axis.drive.coulomb_friction_mm_s2,
                reversal_mm_s: 0.5,
                bed,
            };
            axis.feedforward =
                Feedforward { velocity: 1.0, lead_s: 0.00167, drive: Some(drive), ..Feedforward::default() };
        }
    }
    machine
}

/// The simulated machine, and where its loads were in every tick.
struct Watched<'a> {
    machine: &'a Simulated,
    hardware: SimulatedHardware<'a>,
    loads_mm: Vec<[f64; 2]>,
}

impl Hardware for Watched<'_> {
    fn start_counts(&mut self) -> [Counts; 3] {
        self.hardware.start_counts()
    }

    fn advance<R: Scalar>(&mut self, trace: &Trace<R, 3>) -> bool {
        let [x, y, _] = self.machine.truth();
        self.loads_mm.push([x.position_mm, y.position_mm]);
        self.hardware.advance(trace)
    }
}

impl Encoder<3> for Watched<'_> {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; 3], Infallible> {
        self.hardware.latch()
    }
}

impl Inputs<3> for Watched<'_> {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<3>, Infallible> {
        self.hardware.read_inputs()
    }
}

impl VelocityChannel<3> for Watched<'_> {
    type Error = <SimulatedHardware<'static> as VelocityChannel<3>>::Error;

    fn write(&mut self, codes: &[DacCode; 3]) -> Result<(), Self::Error> {
        self.hardware.write(codes)
    }
}

impl DriveEnable<3> for Watched<'_> {
    type Error = Infallible;

    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.hardware.set_enabled(enabled)
    }
}

impl Outputs for Watched<'_> {
    fn switch(&mut self, to: &OutputState) {
        self.hardware.switch(to);
    }
}

/// Set, told and true positions of X and Y in every tick \[mm\].
struct Run {
    set_mm: Vec<[f64; 2]>,
    told_mm: Vec<[f64; 2]>,
    loads_mm: Vec<[f64; 2]>,
}

fn run(program: &str, machine: &Machine, number: Number) -> Run {
    let (run, faults) = run_with_faults(program, machine, number);
    assert!(faults.is_empty(), "{faults:?}");
    run
}

fn run_with_faults(program: &str, machine: &Machine, number: Number) -> (Run, Vec<TracedFault>) {
    let plan: Plan = motion_tests::check::planned(program, machine).expect("a plan");
    let simulated = simulated(machine).expect("a machine");
    let hardware = SimulatedHardware::new(&simulated).expect("converters");
    let mut watched = Watched { machine: &simulated, hardware, loads_mm: Vec::new() };
    let job = Job::new(&RunOptions { number, ..RunOptions::default() }, &plan, machine).expect("a job");
    let (mut set_mm, mut told_mm) = (Vec::new(), Vec::new());
    let summary = run_on(&job, &mut watched, &mut |tick| {
        let [x, y, _] = tick.axes;
        set_mm.push([x.set_mm, y.set_mm]);
        told_mm.push([x.act_mm, y.act_mm]);
    })
    .expect("a run");
    let loads_mm = watched.loads_mm;
    (Run { set_mm, told_mm, loads_mm }, summary.faults)
}

impl Run {
    /// The greatest distance of the load from the set path nearby \[µm\].
    fn off_path_um(&self) -> f64 {
        const NEAR: usize = 40;
        let mut most_mm: f64 = 0.0;
        for (tick, &[x, y]) in self.loads_mm.iter().enumerate().take(self.set_mm.len()) {
            let near = &self.set_mm[tick.saturating_sub(NEAR)..(tick + NEAR).min(self.set_mm.len())];
            let to_chord = near.windows(2).map(|ends| {
                let ([ax, ay], [bx, by]) = (ends[0], ends[1]);
                let (dx, dy) = (bx - ax, by - ay);
                let length2 = dx * dx + dy * dy;
                let along = if length2 > 0.0 {
                    (((x - ax) * dx + (y - ay) * dy) / length2).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                (x - ax - along * dx).hypot(y - ay - along * dy)
            });
            most_mm = most_mm.max(to_chord.fold(f64::INFINITY, f64::min));
        }
        1e3 * most_mm
    }

    /// The greatest distance of told and true positions \[µm\], but for 30 ms behind reversals: there the play is taken up.
    fn untold_um(&self) -> f64 {
        const TAKEN_UP: usize = 60;
        let mut most_mm: f64 = 0.0;
        for axis in 0..2 {
            let (mut is_rising, mut since) = (true, 0);
            let ticks = self.set_mm.windows(2).zip(self.told_mm.iter().zip(&self.loads_mm).skip(1));
            for (set_mm, (told_mm, load_mm)) in ticks {
                let moved_mm = set_mm[1][axis] - set_mm[0][axis];
                since = if moved_mm != 0.0 && is_rising != (moved_mm > 0.0) { 0 } else { since + 1 };
                is_rising = if moved_mm == 0.0 { is_rising } else { moved_mm > 0.0 };
                if since > TAKEN_UP {
                    most_mm = most_mm.max((told_mm[axis] - load_mm[axis]).abs());
                }
            }
        }
        1e3 * most_mm
    }
}

/// With compensation the load is nearly where that of an ideal machine is, at quadrants, too; in every number type.
#[test]
fn loads_follow_the_path_as_without_errors() {
    // v²/R: at quadrants, and in the stringer's arcs of 4 mm.
    let [quadrant_mm_s2, arc_mm_s2] = [35.84_f64.powi(2) / 20.0, 43.1_f64.powi(2) / 4.0];
    for (name, program, is_inverted, reversal_mm_s2) in [
        ("circle", CIRCLE, false, quadrant_mm_s2),
        ("circle, inverse", CIRCLE, true, quadrant_mm_s2),
        ("stringer", STRINGER, false, arc_mm_s2),
        ("stringer, inverse", STRINGER, true, arc_mm_s2),
    ] {
        let off_um = |screws, number| run(program, &machine(screws, is_inverted), number).off_path_um();
        let ideal_um = off_um(Screws::Ideal, Number::F64);
        let errors_um = off_um(Screws::WithErrors, Number::F64);
        let numbers = [Number::F64, Number::F32, Number::Fixed];
        let compensated_um = numbers.map(|number| off_um(Screws::Compensated, number));
        println!("{name}: ideal {ideal_um:.2}, errors {errors_um:.2}, compensated {compensated_um:.2?} µm");
        assert!(errors_um > 1e3 * PLAY_MM, "{name}: errors {errors_um} µm");
        // The load stands until the motor has come through the play: at 0.6 of the take-up it has come through four fifths,
        // and the path has gone on by the rest. Without a lead that comes later by the drive's delay.
        let late_s = 0.6 * TAKE_UP_S + if is_inverted { 0.0 } else { 1.7e-3 };
        // Of the table's motion, 0.6 µm: its jerk is not fed forward.
        let most_um = ideal_um + 1e3 * 0.5 * reversal_mm_s2 * late_s * late_s + 0.6;
        for (number, um) in numbers.into_iter().zip(compensated_um) {
            assert!(um < most_um, "{name} in {number:?}: {um} µm, expected less than {most_um}");
        }
    }
}

/// What is told is where the load is, but while play is taken up: then the motor, which is late, has not left it yet.
#[test]
fn the_loads_position_is_told() {
    for is_inverted in [false, true] {
        let [errors_um, compensated_um] = [Screws::WithErrors, Screws::Compensated]
            .map(|screws| run(CIRCLE, &machine(screws, is_inverted), Number::F32).untold_um());
        println!("told and true differ by {errors_um:.2} µm, with compensation by {compensated_um:.2} µm");
        assert!(errors_um > 1e3 * PLAY_MM && compensated_um < 0.5, "{errors_um} {compensated_um}");
    }
}

/// A machine whose X has this play alone, taken up as fast as its machine file may say.
fn worn(play_mm: f64, is_inverted: bool) -> Machine {
    let mut machine = machine(Screws::Ideal, is_inverted);
    let axis = &mut machine.axes[0];
    let backlash = Some(Backlash { play_mm, take_up_s: axis.take_up_s(play_mm) });
    axis.screw = ScrewParameters { pitch_error: None, backlash_mm: play_mm };
    axis.compensation = Some(AxisCompensation { backlash, pitch_error: None });
    machine
}

/// The fastest take-up that a machine file may ask for is no fault, wherever in a round of the guards' samples a reversal comes.
#[test]
fn the_fastest_take_up_is_no_fault() {
    // Reversals within motion, at the axis' acceleration, and from rest.
    let program = |wait_s: f64| {
        format!("G21 G90 G61\nG4 P{wait_s}\nG0 X8\nG0 X0\nG64 P0\nG3 X0 Y0 I3 J0 F2150\nG1 X-1\nX0\nM2\n")
    };
    for is_inverted in [false, true] {
        for play_mm in [0.005, 0.02, 0.05, 0.1, 0.3, 1.0] {
            let machine = worn(play_mm, is_inverted);
            for ticks in 0..24 {
                let wait_s = f64::from(ticks) * machine.tick_s;
                let (_, faults) = run_with_faults(&program(wait_s), &machine, Number::F32);
                assert!(faults.is_empty(), "{play_mm} mm, inverse {is_inverted}, {ticks} ticks: {faults:?}");
            }
        }
    }
}

/// The first tick in which X goes backward.
fn first_backward(plan: &Plan, machine: &Machine) -> u64 {
    let mut first = None;
    run_with(&RunOptions::default(), plan, machine, &mut |row| {
        if row.axes[0].vel_mm_s < -1e-3 {
            first = first.or(Some(row.tick));
        }
    })
    .expect("a run");
    first.expect("it goes backward")
}

/// A drive or an encoder that is reversed is found as that while play is taken up, just after it, and long after.
#[test]
fn a_runaway_is_found_in_a_take_up_and_after_it() {
    let program = "G21 G90 G61\nG0 X30\nG0 X0\nM2\n";
    for (is_inverted, play_mm) in [(false, 0.02), (true, 0.02), (false, 0.3), (true, 0.3)] {
        let machine = worn(play_mm, is_inverted);
        let plan: Plan = motion_tests::check::planned(program, &machine).expect("a plan");
        let reversal = first_backward(&plan, &machine);
        for fault in ["drive-reversed=X", "encoder-reversed=X"] {
            for after_ticks in [0, 2, 5, 10, 40, 90, 130, 170] {
                let broken_at = reversal + after_ticks;
                let injections: Injections = format!("{broken_at}:{fault}").parse().expect("an injection");
                let options = RunOptions { injections: Some(&injections), ..RunOptions::default() };
                let faults = run_with(&options, &plan, &machine, &mut |_| {}).expect("a run").faults;
                let first = faults.first().unwrap_or_else(|| panic!("{fault} after {after_ticks}: none"));
                let what =
                    format!("{play_mm} mm, inverse {is_inverted}, {fault} after {after_ticks}: {first:?}");
                println!("{} ticks: {what}", first.tick - broken_at);
                assert_eq!(first.fault, "runaway", "{what}");
                assert!(first.tick - broken_at < 200, "{what}");
            }
        }
    }
}

/// A loss of velocity that no load explains is found long after a take-up as soon as on a machine without play, by the samples
/// alone: the following error is not bounded here.
#[test]
fn samples_are_judged_again_after_a_take_up() {
    let program = "G21 G90 G61\nG0 X60\nG0 X0\nM2\n";
    let loose = |machine: &mut Machine| {
        machine.axes[0].following_error_limit_mm = 400.0;
        machine.axes[0].drive.coulomb_friction_mm_s2 = 10.0;
    };
    let (mut with, mut without) = (worn(0.02, true), machine(Screws::Ideal, true));
    loose(&mut with);
    loose(&mut without);
    // Compensation changes no plan.
    let plan: Plan = motion_tests::check::planned(program, &without).expect("a plan");
    let reversal = first_backward(&plan, &without);
    let mut latest = [0; 2];
    for broken_at in (reversal + 300..reversal + 348).step_by(3) {
        let found = [&with, &without].map(|machine| {
            let injections: Injections =
                format!("{broken_at}:drive-reversed=X").parse().expect("an injection");
            let options = RunOptions { injections: Some(&injections), ..RunOptions::default() };
            let mut velocity_mm_s = 0.0;
            let faults = run_with(&options, &plan, machine, &mut |row| {
                if row.tick == broken_at {
                    velocity_mm_s = row.axes[0].vel_mm_s;
                }
            })
            .expect("a run")
            .faults;
            assert!(velocity_mm_s < -20.0, "backward, long after the take-up: {velocity_mm_s}");
            let first = faults.first().expect("a fault");
            assert_eq!(first.fault, "runaway", "{first:?}");
            first.tick - broken_at
        });
        latest = [latest[0].max(found[0]), latest[1].max(found[1])];
    }
    println!("at most {latest:?} ticks after it broke, with play and without");
    assert!(latest[0] <= latest[1], "{latest:?}");
}

/// Play and error found from where an instrument sees the load compensate as well as those that are known.
#[test]
fn a_screw_that_was_measured_is_compensated() {
    let mut machine = machine(Screws::WithErrors, true);
    for axis in 0..2 {
        // X over its few turns here, Y over more than it needs.
        let ends_mm = [[-5.0, 45.0], [-25.0, 125.0]][axis];
        let survey = Survey { axis, ends_mm, places: 64, rounds: 1, rest_s: 3.0 };
        let readings = measure(&machine, &survey).expect("a measurement");
        let search = ScrewSearch { pitch_mm: Some(PITCH_MM), ..ScrewSearch::default() };
        let found = identify_screw(&readings, &search).expect("a screw");
        let play = found.backlash_mm;
        // Friction holds the motor within a count of where it was told to be, on the side that it comes from.
        assert!((play.value - PLAY_MM).abs() < 1e-4, "{play:?}");
        assert!(play.half_width_95 < 2e-4, "{play:?}");
        let table = found.pitch_error.expect("an error").table;
        assert!(table.repeats, "{table:?}");
        let backlash = Some(Backlash { play_mm: play.value, take_up_s: TAKE_UP_S });
        machine.axes[axis].compensation = Some(AxisCompensation { backlash, pitch_error: Some(table) });
    }
    let off_um = |machine: &Machine| run(CIRCLE, machine, Number::F32).off_path_um();
    let (known_um, found_um) = (off_um(&self::machine(Screws::Compensated, true)), off_um(&machine));
    println!(
        "a circle: {known_um} µm with the errors that are known, {found_um} µm with those that were found"
    );
    assert!(found_um < known_um + 0.2, "{known_um} {found_um}");
}

/// Homed anew where the load is known, wherever that is in a turn, the set positions are the load's again.
#[test]
fn a_reference_is_the_loads() {
    let machine = machine(Screws::Compensated, false);
    let config = machine.axes_config::<f64>().expect("axes");
    let load_of = |axis: usize, motor_mm: f64| {
        let error = screw(axis).pitch_error.expect("an error");
        motor_mm + error.error_mm(motor_mm) - error.error_mm(0.0)
    };
    let counts = |motor_mm: [f64; 3]| motor_mm.map(|mm| Counts((mm * 1e4).round() as i64));
    let mut kernel = Kernel::new(&config, [Position::ZERO; 3], counts([0.0; 3]));
    // The encoder began to count anywhere: by 1.3 mm off.
    for (index, motor_mm) in [0.0, 1.1, 2.345, 3.9, 17.02, -8.4].into_iter().enumerate() {
        let load_mm = load_of(0, motor_mm);
        let read = counts([motor_mm + 1.3, 0.0, 0.0]);
        let position = Position::from_mm(load_mm).expect("near");
        kernel = if index == 0 { Kernel::new(&config, [Position::ZERO; 3], read) } else { kernel };
        kernel.reference(0, read[0], position).expect("at rest");
        // Now elsewhere, without motion.
        for other_mm in [0.4, -2.2, 6.6] {
            let read = counts([other_mm + 1.3, 0.0, 0.0]);
            let mut streams = Streams::<f64, 3, 2, 2>::new();
            let (_, mut intake) = streams.split(machine.rules(), [Position::ZERO; 3]);
            kernel.tick(&mut intake, &mut Still(read));
            let [found, ..] = kernel.stand_here();
            let expected_mm = load_of(0, other_mm);
            assert!(
                (found.to_mm() - expected_mm).abs() < 2e-4,
                "{motor_mm}, {other_mm}: {} {expected_mm}",
                found.to_mm()
            );
        }
    }
}

/// Encoders that read the same all the time.
struct Still([Counts; 3]);

impl Encoder<3> for Still {
    type Error = Infallible;

    fn latch(&mut self) -> Result<[Counts; 3], Infallible> {
        Ok(self.0)
    }
}

impl Inputs<3> for Still {
    type Error = Infallible;

    fn read_inputs(&mut self) -> Result<MachineInputs<3>, Infallible> {
        Ok(MachineInputs::HEALTHY)
    }
}

impl VelocityChannel<3> for Still {
    type Error = Infallible;

    fn write(&mut self, _: &[DacCode; 3]) -> Result<(), Infallible> {
        Ok(())
    }
}

impl DriveEnable<3> for Still {
    type Error = Infallible;

    fn set_enabled(&mut self, _: bool) -> Result<(), Infallible> {
        Ok(())
    }
}
