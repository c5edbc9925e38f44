//! `motion` alone: the stringer flange through plan, kernel and simulated machine.

use std::io::Write;

use super::error::{CliError, Outcome};
use super::outputs::Outputs;
use super::{plan, run};
use crate::files::Files;
use crate::gcode;
use crate::machine::Machine;
use crate::planning::{Mode, plan_program};
use crate::simulate::RunOptions;

/// The program: line, arc R4, arc R10, arc R4, line, tangent to each other.
pub const STRINGER: &str = include_str!("stringer.ngc");
pub(super) const STRINGER_NAME: &str = "stringer.ngc";
/// The report's name, in the current directory.
const REPORT: &str = "stringer.html";

/// Plans and runs the built-in program on the reference machine, writes its report.
///
/// # Errors
/// The report or `out` can't be written.
pub fn demonstrate(out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = Machine::reference();
    let program = gcode::read(STRINGER_NAME, STRINGER.as_bytes())?;
    let plan = plan_program(STRINGER_NAME, &program, &machine, Mode::Spanning)?;
    let outputs = Outputs::report(&mut Files::reading([]), "the report", REPORT.into())?;
    let outputs = outputs.of_program(STRINGER.as_bytes(), &plan);
    let mut say = |text: &str| writeln!(out, "{text}").map_err(CliError::Output);
    say("Demonstration: a stringer flange, 5000 mm/min, on the reference machine.\n")?;
    for line in STRINGER.lines() {
        say(&format!("  {line}"))?;
    }
    say("\nPlan: what limits the feed\n")?;
    plan::write_plan(&plan, usize::MAX, out).map_err(CliError::Output)?;
    let (summary, written) = run::execute(&RunOptions::default(), &plan, &machine, outputs, None)?;
    let mut say = |text: &str| writeln!(out, "{text}").map_err(CliError::Output);
    say("\nRun: the real-time kernel on simulated axes\n")?;
    run::write_summary(&summary, out).map_err(CliError::Output)?;
    if written.place_of("report").is_some() {
        let place = std::path::absolute(REPORT).unwrap_or_else(|_| REPORT.into());
        writeln!(out, "\nReport written to {}", place.display()).map_err(CliError::Output)?;
    }
    writeln!(out, "`motion --help` shows what else there is.").map_err(CliError::Output)?;
    written.outcome(Outcome::of(&summary))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::StepKind;
    use crate::toolpath::{Element, angle, norm, subtract};

    /// The tangents agree within 10⁻⁶ rad at every junction, and the last line is parallel to the first.
    #[test]
    fn the_stringer_is_tangent() {
        let program = gcode::read(STRINGER_NAME, STRINGER.as_bytes()).expect("G-code");
        let elements: Vec<Element> = program
            .steps
            .iter()
            .filter_map(|step| match &step.kind {
                StepKind::Line(line) => Some(Element::line(line, &Machine::reference())),
                StepKind::Arc(arc) => Element::arc(arc, &Machine::reference()).ok(),
                _ => None,
            })
            .collect();
        // R·angle of an arc.
        let (small_mm, large_mm) = (4.0 * 75.0_f64.to_radians(), 10.0 * 150.0_f64.to_radians());
        let lengths_mm = [50.0, small_mm, large_mm, small_mm, 25.0];
        assert_eq!(elements.len(), lengths_mm.len());
        for (element, length_mm) in elements.iter().zip(lengths_mm) {
            assert!((element.length_mm() - length_mm).abs() < 1e-8, "{}", element.length_mm());
        }
        for pair in elements.windows(2) {
            let turn_rad = angle(pair[0].ends()[1].tangent, pair[1].ends()[0].tangent);
            assert!(turn_rad < 1e-6, "{turn_rad}");
            assert!(norm(subtract(pair[0].ends_mm().1, pair[1].ends_mm().0)) < 1e-12);
        }
        assert!(angle(elements[0].ends()[0].tangent, elements[4].ends()[1].tangent) < 1e-9);
    }
}
