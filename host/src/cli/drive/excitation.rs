//! `motion drive excitation`: the program to record for identification.

use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::{axis_named, feed_mm_min};
use crate::cli::error::{CliError, Outcome};
use crate::cli::input;
use crate::cli::outputs::{self, Written};
use crate::drive::circle_motion::plane_of;
use crate::files::Files;
use crate::gcode::Plane;
use crate::identify::{Excitation, Reach, identification_plan};
use crate::machine::Machine;

const HELP: &str = "\
The program moves the axis there and back with four feeds, and on small circles with a second axis, all relative to
where it stands, within the limits of the machine file. Record what the converter puts out and what the encoder counts,
tick by tick, from before its first motion until after its last: `motion drive identify --from` reads that.

Steps of planned motion are as steep as the machine file's limits let them be. Gentle limits show less of the drive:
dead time, command filter and current lag may not be told apart then, and the current limit is not reached. Circles of less
than 0.01 mm are left out.
`motion drive identify` says what a recording did not show.

Example:
  motion drive excitation --machine mine.toml --axis Y --output excite_y.ngc";

/// Rest between two motions \[s\].
const REST_S: f64 = 0.3;
/// The part of the axis' limits that circles take.
const SHARE: f64 = 0.8;

/// The least radius of a circle \[mm\]: programs have no smaller ones.
const RADIUS_MM_MIN: f64 = 0.01;

/// Write the G-code program whose run shows the drive of an axis.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct ExcitationArguments {
    /// The axis, by its name.
    #[arg(long, value_name = "NAME", default_value = "X")]
    axis: String,
    /// Where the program goes; an existing file is replaced. Without it, it is printed.
    #[arg(short, long, value_name = "FILE.ngc")]
    output: Option<PathBuf>,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
}

/// Writes the program.
///
/// # Errors
/// An argument is refused, or the file can't be written.
pub fn run(arguments: &ExcitationArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let mut files = Files::reading([("--machine", arguments.machine.as_deref())]);
    let output = outputs::open(&mut files, "--output", arguments.output.as_ref())?;
    let machine = input::xyz_machine(arguments.machine.as_ref())?;
    let axis = axis_named(&machine, &arguments.axis)?;
    let program = program(&machine, axis);
    let Some(output) = output else {
        out.write_all(program.as_bytes()).map_err(CliError::Output)?;
        return Ok(Outcome::Done);
    };
    let mut written = Written::default();
    written.write("program", Some(output), |file| file.write_all(program.as_bytes()));
    written.say(out)?;
    written.outcome(Outcome::Done)
}

/// The plan of identification within the limits of production, relative to where the axes stand.
fn program(machine: &Machine, axis: usize) -> String {
    let plane = plane_of(axis);
    let [first, second, _] = plane.axes();
    let pair = [first, second].map(|axis| &machine.axes[axis]);
    let feed_mm_s = |axes: &[usize]| {
        let limit_mm_min =
            axes.iter().map(|&axis| machine.axes[axis].feed_mm_s).fold(machine.path.feed_mm_s, f64::min);
        feed_mm_min(machine, axes, None, 60.0 * limit_mm_min) / 60.0
    };
    let accel_mm_s2 = machine.axes[axis].accel_mm_s2.min(machine.path.accel_mm_s2);
    let pair_accel_mm_s2 = pair.iter().map(|axis| axis.accel_mm_s2).fold(machine.path.accel_mm_s2, f64::min);
    let reach = Reach { tick_s: machine.tick_s, fastest_mm_s: feed_mm_s(&[axis]), accel_mm_s2 };
    let letters = ["X", "Y", "Z"];
    let (select, offset) = match plane {
        Plane::Xy => ("G17", "I"),
        Plane::Zx => ("G18", "K"),
        Plane::Yz => ("G19", "J"),
    };
    let name = &machine.axes[axis].name;
    let mut text = format!(
        "(identification of axis {name}: record outputs and counts of every tick)\nG21 G91 G61 {select}\nG4 P{REST_S}\n"
    );
    let mut line = |words: String| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{words}");
    };
    for excitation in identification_plan(&reach) {
        match excitation {
            Excitation::Steps { feed_mm_s, cruise_s, .. } => {
                let far_mm = feed_mm_s * cruise_s;
                for far_mm in [far_mm, -far_mm] {
                    line(format!("G1 {}{far_mm:.4} F{:.3}", letters[axis], feed_mm_s * 60.0));
                    line(format!("G4 P{REST_S}"));
                }
            }
            Excitation::Harmonic { amplitude_mm_s, frequency_hz, periods } => {
                let omega_per_s = core::f64::consts::TAU * frequency_hz;
                let most_mm_s = feed_mm_s(&[first, second]).min(SHARE * pair_accel_mm_s2 / omega_per_s);
                let feed_mm_s = amplitude_mm_s.min(SHARE * most_mm_s);
                let radius_mm = feed_mm_s / omega_per_s;
                if radius_mm < RADIUS_MM_MIN {
                    continue;
                }
                for _ in 0..periods {
                    line(format!(
                        "G3 {}0 {}0 {offset}{:.6} F{:.3}",
                        letters[first],
                        letters[second],
                        -radius_mm,
                        feed_mm_s * 60.0
                    ));
                }
                line(format!("G4 P{REST_S}"));
            }
        }
    }
    line("M2".to_owned());
    text
}
