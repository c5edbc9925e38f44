//! The machine file against the built-in machine, and every refusal.

use motion_kernel::axis::AxesConfig;

use super::{Machine, REFERENCE_TOML};

/// The refusal of the reference file with the first `from` replaced by `to`.
fn refused(from: &str, to: &str) -> String {
    assert!(REFERENCE_TOML.contains(from), "{from}");
    let text = REFERENCE_TOML.replacen(from, to, 1);
    match Machine::from_toml("test.toml", &text) {
        Ok(_) => panic!("{from} → {to}: accepted"),
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "{error}");
            error.to_string()
        }
    }
}

#[test]
fn the_file_is_the_built_in_machine() {
    assert_eq!(Machine::from_toml("reference.toml", REFERENCE_TOML), Ok(Machine::reference()));
}

#[test]
fn the_stages_take_it() {
    let machine = Machine::reference();
    let narrow: AxesConfig<f32, 3> = machine.axes_config().expect("f32");
    let wide: AxesConfig<f64, 3> = machine.axes_config().expect("f64");
    assert!((narrow.axes[0].encoder.mm_per_count() - 1e-4).abs() < 1e-15);
    assert!((wide.axes[2].output.limits().1 - 1000.0 / 3.0).abs() < 1e-9);
    assert_eq!(
        machine.simulated(),
        hal_sim::MachineParameters::at_reference_tick([
            hal_sim::AxisParameters::REFERENCE_X,
            hal_sim::AxisParameters::REFERENCE_Y,
            hal_sim::AxisParameters::REFERENCE_Z,
        ])
    );
    assert_eq!(machine.limits().path.limits, machine.rules().limits);
}

/// Each key, a value outside its range on every side, and nothing that is not a number.
#[test]
fn every_range_is_kept() {
    const ANY: &[&str] = &["nan", "-nan", "inf", "-inf", "\"5\"", "true", "[1.0]", "1e300"];
    const LIMIT: &[&str] = &["0", "-1.0", "1e13"];
    const GAIN: &[&str] = &["-0.1", "1e10"];
    const POSITIVE: &[&str] = &["0.0", "-3", "1e10"];
    let cases: &[(&str, &[&str])] = &[
        ("tick_s", &["0", "0.00001", "0.03", "-0.0005"]),
        ("feed_mm_s", LIMIT),
        ("accel_mm_s2", LIMIT),
        ("jerk_mm_s3", LIMIT),
        ("snap_mm_s4", LIMIT),
        ("joint_angle_deg", &["-0.5", "31"]),
        ("accel_step_mm_s2", LIMIT),
        ("curve_feed_share", &["0", "0.86", "-0.5"]),
        ("following_error_limit_mm", &["0", "-1", "1001"]),
        ("mm_per_count", &["0", "-0.0001", "1", "1e-8"]),
        ("mm_min_at_10_v", &["0", "2e9"]),
        ("offset_v", &["10", "-10.0"]),
        ("limit_v", &["0", "10.1", "-10"]),
        ("kp_per_s", GAIN),
        ("ki_per_s2", GAIN),
        ("kd", GAIN),
        ("feedforward_velocity", &["1001", "-1001"]),
        ("feedforward_accel_s", &["1001", "-1001"]),
        ("feedforward_jerk_s2", &["1001", "-1001"]),
        ("velocity_gain_per_s", POSITIVE),
        ("integral_time_s", POSITIVE),
        ("current_lag_s", GAIN),
        ("dead_time_s", &["-0.001", "0.011"]),
        ("command_filter_s", GAIN),
        ("accel_limit_mm_s2", POSITIVE),
        ("load_inertia_ratio", &["-1", "1001"]),
        ("coulomb_friction_mm_s2", GAIN),
        ("viscous_friction_per_s", GAIN),
        ("frequency_hz", POSITIVE),
        ("damping_ratio", GAIN),
        ("mass_ratio", POSITIVE),
        ("timer_bits", &["8", "64", "-16"]),
        ("noise_counts", &["-1", "1001"]),
        ("noise_seed", &["-1"]),
    ];
    for (key, values) in cases {
        let position = REFERENCE_TOML.find(&format!("\n{key} = ")).expect(key) + 1;
        let line = REFERENCE_TOML[position..].lines().next().expect("a line");
        let row = REFERENCE_TOML[..position].lines().count() + 1;
        let column = key.len() + 4;
        for value in values.iter().chain(ANY) {
            let error = refused(line, &format!("{key} = {value}"));
            assert!(error.starts_with(&format!("test.toml:{row}:{column}: found {key} = ")), "{error}");
            assert!(error.contains(", expected "), "{error}");
        }
    }
}

#[test]
fn keys_are_neither_invented_nor_left_out() {
    let error = refused("tick_s = 0.0005", "tick_s = 0.0005\ntick_ms = 0.5");
    assert!(error.contains(":15:1: found unknown key `tick_ms`, expected "), "{error}");
    let error = refused("tick_s = 0.0005", "");
    assert!(error.contains("found no key `tick_s`"), "{error}");
    let error = refused("mm_per_count = 0.0001", "");
    assert!(error.contains("found no key `mm_per_count`"), "{error}");
    let error = refused("tick_s = 0.0005", "tick_s = 0.0005\ntick_s = 0.0005");
    assert!(error.contains(":15:1: found "), "{error}");
    let error = refused("tick_s = 0.0005", "tick_s 0.0005");
    assert!(error.contains(":14:"), "{error}");
}

#[test]
fn keys_agree_with_each_other() {
    assert!(refused("name = \"Y\"", "name = \"X\"").contains("expected a name that no other axis has"));
    assert!(refused("name = \"Y\"", "name = \"Y axis\"").contains("expected 1 to 8 letters and digits"));
    assert!(
        refused("offset_v = 0.0\n", "offset_v = -6\n")
            .contains("found feed_mm_s = 300.0, expected at most 133.3")
    );
    assert!(refused("limit_v = 10.0", "limit_v = 8").contains("expected at most 266.666667"));
    let error = refused(
        "offset_v = 0.0\n# [V] Greatest output in either direction. Above 0, at most 10.\nlimit_v = 10.0",
        "offset_v = 2\nlimit_v = 1.5",
    );
    assert!(error.contains("found offset_v = 2, expected a magnitude below limit_v = 1.5"), "{error}");
    // 2·300·0.0005/2¹⁵ = 9.1552734375e-6, to the last digit.
    let narrow = |mm_per_count: &str| {
        let encoder = format!("mm_per_count = {mm_per_count}\ntimer_bits = 16\n#");
        REFERENCE_TOML.replacen("mm_per_count = 0.0001", &encoder, 1).replacen("timer_bits = 32", "", 1)
    };
    let row = REFERENCE_TOML.split("mm_per_count = ").next().expect("text before it").lines().count() + 1;
    assert_eq!(
        Machine::from_toml("n.toml", &narrow("2e-8")).unwrap_err().to_string(),
        format!(
            "n.toml:{row}:16: found mm_per_count = 2e-8, expected above 9.1552734375e-6: at 2 times feed_mm_s = 300 \
             a tick must be less than half the register of timer_bits = 16"
        )
    );
    assert!(Machine::from_toml("n.toml", &narrow("0.0000091552734375")).is_err());
    assert!(Machine::from_toml("n.toml", &narrow("0.00000916")).is_ok());
    let wide = REFERENCE_TOML.replacen("mm_per_count = 0.0001", "mm_per_count = 2e-8", 1);
    assert!(Machine::from_toml("w.toml", &wide).is_ok());
    let two = REFERENCE_TOML.rsplit_once("[[axis]]").expect("axes").0;
    let error = Machine::from_toml("two.toml", two).unwrap_err().to_string();
    assert!(error.contains("found 2 [[axis]] tables, expected exactly 3"), "{error}");
}

/// The longest dead time at every tick fits the simulation's cells.
#[test]
fn dead_times_fit() {
    let mut machine = Machine::reference();
    for axis in &mut machine.axes {
        axis.drive.dead_time_s = 0.01;
    }
    for hundredths_ms in 2..=2000 {
        machine.tick_s = f64::from(hundredths_ms) * 1e-5;
        let simulated = hal_sim::SimMachine::<3, { super::DEAD_TIME_CELLS }>::new(&machine.simulated());
        assert!(simulated.is_ok(), "{} s: {:?}", machine.tick_s, simulated.err());
    }
}
