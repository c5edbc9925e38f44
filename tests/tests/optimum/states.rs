//! The states of ramps from which the least time to rest is known: they are states of the law.

use motion_kernel::law::{Pulse, Ramp};

use super::{machines, number};

/// Relative to what the ramp changes or reaches. The tool computes the law from its description.
const WITHIN: f64 = 1e-9;

#[test]
fn states_to_stop_from_are_states_of_the_law() {
    let mut states = 0;
    for machine in machines(include_str!("../../optimum/stops.json")) {
        let law = machine.law(Pulse::Plateau);
        for case in machine.cases("stops") {
            let ramp = Ramp::new(&law, number(case, "from_mm_s"), number(case, "to_mm_s"));
            let at_s = number(case, "at_s");
            assert!(at_s <= ramp.duration_s(), "{case}");
            let state = ramp.at(at_s);
            for (name, found, scale) in [
                ("v_mm_s", state.v_mm_s, state.v_mm_s),
                ("a_mm_s2", state.a_mm_s2, ramp.peak_accel_mm_s2()),
                ("j_mm_s3", state.j_mm_s3, ramp.peak_jerk_mm_s3),
            ] {
                let expected = number(case, name);
                assert!((found - expected).abs() <= WITHIN * scale, "{name} {found} in {case}");
            }
            assert!(number(case, "peak_mm_s") >= state.v_mm_s * (1.0 - WITHIN), "{case}");
            assert!(number(case, "violation") <= 1e-6, "{case}");
            states += 1;
        }
    }
    assert_eq!(states, 800);
}
