//! What a program needs of its machine and its operator.

use motion_kernel::hal::Spindle;

use crate::gcode::{AXES_MAX, Length, NoticeKind, Program, StepKind};

/// What has to be ready.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Needs {
    /// Tools that are put in the spindle, by the operator or a subroutine, in the order of their first use.
    pub tools: Vec<u32>,
    /// Coordinate systems that moves are made in: 1 for G54 to 9 for G59.3, in this order.
    pub systems: Vec<u32>,
    /// What the program switches or reads that the machine may not have.
    pub outputs: Vec<&'static str>,
    /// Least and greatest position that a move begins or ends at, in the order of a [`Point`](crate::gcode::Point) \[mm, ° of
    /// rotary axes\]; none without moves. Curves between may reach farther.
    pub extent: Option<[[f64; 2]; AXES_MAX]>,
}

impl Needs {
    /// The needs of a program.
    #[must_use]
    pub fn of(program: &Program) -> Self {
        let (tools, systems) = (program.tools.clone(), program.systems.iter().collect());
        let mut needs = Self { tools, systems, ..Self::default() };
        let (mut turns, mut flows) = (false, false);
        for step in &program.steps {
            if let StepKind::Switch(to) = step.kind {
                turns |= to.spindle != Spindle::Off;
                flows |= to.flood || to.mist;
            }
            if let Some(ends) = step.kind.ends() {
                for point in ends.map(|point| point.map(Length::to_mm)) {
                    let extent = needs.extent.get_or_insert(point.map(|coordinate| [coordinate; 2]));
                    for ([low, high], coordinate) in extent.iter_mut().zip(point) {
                        (*low, *high) = (low.min(coordinate), high.max(coordinate));
                    }
                }
            }
        }
        let has = |kind| program.notices.iter().any(|notice| notice.kind == kind);
        let switched = [
            (turns, "spindle (M3, M4)"),
            (flows, "coolant (M7, M8)"),
            (has(NoticeKind::Output), "outputs (M62 to M68)"),
            (has(NoticeKind::Input), "inputs (M66)"),
        ];
        let switched = switched.into_iter().filter_map(|(is_needed, what)| is_needed.then_some(what));
        needs.outputs.extend(switched);
        needs
    }
}

/// The word of a coordinate system.
#[must_use]
pub fn system_word(system: u32) -> &'static str {
    match system {
        1 => "G54",
        2 => "G55",
        3 => "G56",
        4 => "G57",
        5 => "G58",
        6 => "G59",
        7 => "G59.1",
        8 => "G59.2",
        _ => "G59.3",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode;

    #[test]
    fn tools_systems_outputs_and_extent_are_told() {
        let text = "G55\nT3 M6\nM3 S1000\nG10 L2 P2 X-5\nG0 X1 Z2\nG54\nT1 M6\nG1 Y-4 F60\nT3 M6\nG56\nM2\n";
        let program = gcode::read("a.ngc", text.as_bytes()).expect("G-code");
        let needs = Needs::of(&program);
        let loaded = gcode::read("a.ngc", b"M61 Q4\nT0 M6\nT4 M6\nG0 X1\nM2\n").expect("G-code");
        assert_eq!(Needs::of(&loaded).tools, [4]);
        let off = gcode::read("a.ngc", b"M5 M9\nG0 X1\nM2").expect("G-code");
        assert_eq!(Needs::of(&off).outputs, [""; 0]);
        // No move is made in G56.
        assert_eq!(needs.systems, [1, 2]);
        assert_eq!(
            needs.systems.iter().map(|&system| system_word(system)).collect::<Vec<_>>(),
            ["G54", "G55"]
        );
        assert_eq!(needs.tools, [3, 1]);
        assert_eq!(needs.outputs, ["spindle (M3, M4)"]);
        let extent = needs.extent.expect("moves");
        assert_eq!(extent[..3], [[-4.0, 0.0], [-4.0, 0.0], [0.0, 2.0]]);
        assert_eq!(Needs::of(&gcode::read("a.ngc", b"M2").expect("G-code")).extent, None);
    }
}
