//! Path modes that would save time.

use super::time::Times;
use crate::compare::in_mode;
use crate::gcode::{PathMode, Program};
use crate::machine::Machine;
use crate::planning::{Mode, Plan, plan_program};

/// Part of the time that advice has to save.
const GAIN_MIN: f64 = 0.02;
/// A tolerance that many parts bear \[mm\], tried where blends keep within less.
const COARSE_MM: f64 = 0.05;
/// A tolerance for machines that have none of their own \[mm\].
const FINE_MM: f64 = 0.01;

/// A sentence for each path mode that saves time.
pub(super) fn advice<const N: usize>(
    source_name: &str,
    program: &Program,
    machine: &Machine<N>,
    plan: &Plan<N>,
    times: &Times,
) -> Vec<String> {
    let own_mm = machine.path.blend_tolerance_mm;
    let fine_mm = if own_mm > 0.0 { own_mm } else { FINE_MM };
    // The widest tolerance in the program; 0 without blends.
    let modes = program.steps.iter().filter_map(|step| step.kind.mode());
    let widest_mm = modes.map(|mode| machine.path.tolerance_mm(mode)).fold(0.0, f64::max);
    let mut advice = Vec::new();
    let mut least_s = plan.time_s;
    for tolerance_mm in [fine_mm, COARSE_MM] {
        if tolerance_mm <= widest_mm {
            continue;
        }
        let mode = PathMode::Blend { tolerance_mm: Some(tolerance_mm), merging_mm: None };
        // What can't be planned within this tolerance is no advice.
        let Ok(other) = plan_program(source_name, &in_mode(program, mode), machine, Mode::Spanning) else {
            continue;
        };
        if other.time_s >= (1.0 - GAIN_MIN) * least_s {
            continue;
        }
        least_s = other.time_s;
        let stops = match times.corner_stops {
            0 => String::new(),
            1 => "1 full stop at a corner: ".to_owned(),
            stops => format!("{stops} full stops at corners: "),
        };
        let [other_s, time_s] = [other.time_s, plan.time_s];
        advice.push(format!(
            "{stops}with G64 P{tolerance_mm} it would take {other_s:.1} s instead of {time_s:.1} s"
        ));
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::super::check;
    use crate::gcode;
    use crate::machine::Machine;

    fn advice(text: &str) -> Vec<String> {
        let program = gcode::read("a.ngc", text.as_bytes()).expect("G-code");
        check("a.ngc", &program, &Machine::reference()).expect("a plan").advice
    }

    #[test]
    fn stops_that_can_be_saved_are_told() {
        let zigzag: String =
            (1..40).map(|line| format!("G1 X{line} Y{}\n", 0.1 * f64::from(line % 2))).collect();
        let exact = advice(&format!("F6000 G61\n{zigzag}M2\n"));
        assert_eq!(exact.len(), 2, "{exact:?}");
        assert!(exact[0].starts_with("38 full stops at corners: with G64 P0.01 it would take "), "{exact:?}");
        assert!(exact[1].contains("with G64 P0.05 it would take "), "{exact:?}");
        // Blended widely already, and nothing to blend.
        assert_eq!(advice(&format!("F6000 G64 P0.1\n{zigzag}M2\n")), [""; 0]);
        assert_eq!(advice("F6000 G61\nG1 X100\nM2\n"), [""; 0]);
    }
}
