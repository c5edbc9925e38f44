//! The stringer flange of S3: the plan's published table, and the whole pipeline on its G-code.

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Mode, plan_blocks, plan_program};
use motion_host::simulate::{Number, run_with};

const BLOCKS: &str = r#"{
    "limits": {"accel_mm_s2": 500, "jerk_mm_s3": 5000, "snap_mm_s4": 400000},
    "start_feed_mm_s": 0, "end_feed_mm_s": 0,
    "blocks": [
        {"length_mm": 50, "feed_mm_s": 83.33333333333333},
        {"length_mm": 5.235987755982989, "feed_mm_s": 43.08869380063767},
        {"length_mm": 26.179938779914945, "feed_mm_s": 70.71067811865476},
        {"length_mm": 5.235987755982989, "feed_mm_s": 43.08869380063767},
        {"length_mm": 25, "feed_mm_s": 83.33333333333333}
    ]
}"#;

#[test]
fn per_block_plan_is_the_published_one() {
    let plan = plan_blocks("stringer.json", BLOCKS.as_bytes(), Mode::PerBlock).expect("a plan");
    println!("{:.15} s", plan.time_s);
    for block in &plan.blocks {
        println!("{block:?}");
    }
    for feed in &plan.feed {
        println!("{feed:?}");
    }
    assert!((plan.time_s - 2.097_975_247_451_847).abs() < 1e-9, "{}", plan.time_s);
}

#[test]
fn program() {
    let text = std::fs::read("/tmp/p.ngc").unwrap();
    let program = gcode::read("stringer.ngc", &text).expect("a program");
    let machine = Machine::reference();
    let plan =
        plan_program("stringer.ngc", &program, &machine, Mode::Merged).unwrap_or_else(|e| panic!("{e}"));
    for block in plan.blocks.iter().take(10) {
        println!("{block:?}");
    }
    for number in [Number::F32, Number::F64] {
        let mut last = None;
        let summary = run_with(number, &plan, &machine, &mut |tick| {
            last = Some(*tick);
        })
        .expect("a run");
        println!("{summary:#?} {last:?}");
    }
}
