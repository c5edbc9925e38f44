//! What a program says about blending.

use motion_host::machine::Machine;
use motion_host::planning::Item as PlanItem;

use super::planned;

/// G61 is as it was: tangent junctions run through, corners stop, nothing is blended.
#[test]
fn exact_path_stops_at_corners_only() {
    let machine = Machine::reference();
    let text = "G61 F120\nG1 X10\nX20\nY10\nG64 P0.05\nX30\nX30 Y20\nG61\nX40\nY30\nM2\n";
    let plan = planned(text, &machine).expect("a plan");
    let kinds: Vec<_> = plan.blocks.iter().map(|block| (block.line, &*block.kind)).collect();
    let blended = [(6, "line"), (6, "blend"), (7, "line"), (9, "line")];
    let mut expected = vec![(2, "line"), (3, "line"), (4, "line")];
    expected.extend(blended);
    expected.push((10, "line"));
    assert_eq!(kinds, expected);
    let stretches = plan.items.iter().filter(|item| matches!(item, PlanItem::Stretch(_))).count();
    assert_eq!(stretches, 5);
}

/// Without P the machine's tolerance holds; P0 and corners of more than 170° stay exact.
#[test]
fn without_p_the_tolerance_of_the_machine_holds_and_exact_corners_stay_exact() {
    let mut machine = Machine::reference();
    let blends = |machine: &Machine, text: &str| {
        planned(text, machine).expect("a plan").blocks.iter().filter(|block| block.kind == "blend").count()
    };
    assert_eq!(blends(&machine, "G64 F30\nG1 X10\nY10\nM2\n"), 1);
    assert_eq!(blends(&machine, "G64 P0 F30\nG1 X10\nY10\nM2\n"), 0);
    assert_eq!(blends(&machine, "G64 P1 F30\nG1 X10\nX0 Y1.77\nM2\n"), 1);
    assert_eq!(blends(&machine, "G64 P1 F30\nG1 X10\nX0 Y1.75\nM2\n"), 0);
    machine.path.blend_tolerance_mm = 0.0;
    assert_eq!(blends(&machine, "G64 F30\nG1 X10\nY10\nM2\n"), 0);
}
