//! The machine file against the built-in machine, and every refusal.

use hal_sim::{HomeParameters, IndexParameters, PitchErrorParameters, ScrewParameters, SwitchParameters};
use motion_kernel::axis::{AxesConfig, Backlash, PREVIEW_TICKS_MAX, PitchError};
use motion_kernel::jog::Direction;
use motion_kernel::law::Pulse;
use motion_kernel::units::{Counts, Position};

use super::keys::{KEY_TABLES, KeyTable, is_list};
use super::{AnyMachine, Machine, REFERENCE_TOML};
use crate::gcode::Axis;
use crate::touch::{Surface, TouchBox};

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

/// What texts say of the longest lead is the kernel's.
#[test]
fn texts_have_the_kernels_preview() {
    let ticks = PREVIEW_TICKS_MAX;
    assert!(REFERENCE_TOML.contains(&format!("the longest lead needs, at most {ticks}: ")));
    // At the slowest tick.
    let most_s = f64::from(ticks) * 0.02;
    assert!(REFERENCE_TOML.contains(&format!("0 … {most_s}, at most {ticks}·tick_s. Optional")));
    let mut keys = KEY_TABLES.iter().flat_map(|table| table.keys);
    let lead = keys.find(|key| key.name == "feedforward_lead_s").expect("a key");
    assert!(lead.meaning.contains(&format!("at most {ticks} ticks.")), "{}", lead.meaning);
    let mut axis = Machine::reference().axes[0].figures();
    axis.feedforward.lead_s = 1.0;
    let refusal = AxesConfig::<f32, 1>::new(&[axis], 5e-4).expect_err("too long").to_string();
    assert!(refusal.contains(&format!("from 0 to {ticks} ticks")), "{refusal}");
}

#[test]
fn the_stages_take_it() {
    let machine = Machine::reference();
    let narrow: AxesConfig<f32, 3> = machine.axes_config().expect("f32");
    let wide: AxesConfig<f64, 3> = machine.axes_config().expect("f64");
    // 10⁻¹⁵ mm a count.
    assert!((narrow.axes[0].encoder.position(Counts(100_000_000)).to_mm() - 1e4).abs() < 1e-7);
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
        ("junction_angle_deg", &["-0.5", "31"]),
        ("accel_step_mm_s2", LIMIT),
        ("curve_feed_share", &["0", "0.86", "-0.5"]),
        ("blend_tolerance_mm", &["-0.01", "11"]),
        ("corner_angle_deg", &["-1", "181"]),
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
            let error = refused(&format!("\n{line}"), &format!("\n{key} = {value}"));
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
}

/// The reference file with axes of these letters, each a copy of X.
fn with_axes(letters: &str) -> String {
    let (path, axes) = REFERENCE_TOML.split_once("[[axis]]").expect("axes");
    let axis = axes.split("[[axis]]").next().expect("an axis");
    let of = |(place, letter): (usize, char)| {
        format!(
            "[[axis]]{}",
            axis.replacen("name = \"X\"", &format!("name = \"axis{place}\"\nletter = \"{letter}\""), 1)
        )
    };
    path.to_owned() + &letters.chars().enumerate().map(of).collect::<String>()
}

#[test]
fn a_machine_has_one_to_nine_axes() {
    let lathe = Machine::from_toml("lathe.toml", &with_axes("XZ")).expect("a lathe");
    assert_eq!((lathe.axis_count(), lathe.letters().to_string()), (2, "X, Z".to_owned()));
    assert_eq!((lathe.place_of(Axis::Z), lathe.place_of(Axis::Y)), (Some(1), None));
    let AnyMachine::Nine(all) =
        AnyMachine::from_toml("all.toml", &with_axes("XYZABCUVW")).expect("nine axes")
    else {
        panic!("nine places")
    };
    assert_eq!(all.axis_count(), 9);
    assert!(matches!(AnyMachine::from_toml("mill.toml", REFERENCE_TOML), Ok(AnyMachine::Three(_))));
    for (letters, expected) in [
        ("XYZA", "found 4 [[axis]] tables, expected at most 3 for this command"),
        ("XYX", "letter = \"X\", expected a letter that no other axis has"),
        ("XQ", "found letter = \"Q\", expected one of the letters X, Y, Z, A, B, C, U, V, W"),
    ] {
        let error = Machine::from_toml("few.toml", &with_axes(letters)).expect_err(letters).to_string();
        assert!(error.contains(expected), "{error}");
    }
    let ten = with_axes("XYZABCUVW") + &with_axes("X").split_off(with_axes("").len());
    for (text, expected) in
        [(with_axes(""), "found no key `axis`"), (ten, "10 [[axis]] tables, expected 1 to 9")]
    {
        let error = AnyMachine::from_toml("count.toml", &text).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
    // A rotary axis homes as fast as it can; [path] does not bind it.
    let fast = |letter: char| {
        let slow_path = with_optional_keys().replacen("feed_mm_s = 300.0", "feed_mm_s = 20", 1);
        slow_path.replacen("letter = \"X\"", &format!("letter = \"{letter}\""), 1).replacen(
            "name = \"X\"",
            "name = \"first\"",
            1,
        )
    };
    assert!(Machine::from_toml("turn.toml", &fast('A')).is_ok());
    let error = Machine::from_toml("line.toml", &fast('X')).expect_err("faster than the path").to_string();
    assert!(error.contains("expected a magnitude of at most feed_mm_s = 20"), "{error}");
    let moved = REFERENCE_TOML.replacen("name = \"Z\"", "name = \"A\"", 1);
    let error = Machine::from_toml("moved.toml", &moved).expect_err("moved by Z").to_string();
    assert!(error.contains("expected Z or a name that is no axis' letter"), "{error}");
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

/// The reference file with all its optional keys in use: a "#" without a blank after it is removed.
fn with_optional_keys() -> String {
    let in_use = |line: &str| match line.strip_prefix('#') {
        Some(rest) if rest.starts_with(|c: char| c == '[' || c.is_ascii_lowercase()) => rest.to_owned(),
        _ => line.to_owned(),
    };
    REFERENCE_TOML.lines().map(|line| in_use(line) + "\n").collect()
}

#[test]
fn optional_keys_are_read() {
    let machine = Machine::from_toml("full.toml", &with_optional_keys()).expect("valid");
    let feedforward = machine.axes[0].feedforward;
    assert!((feedforward.lead_s - 0.00167).abs() < 1e-12);
    let table = feedforward.tables.velocity.expect("a table");
    assert_eq!((table.reach, table.mm_s()[0], table.mm_s()[8]), (300.0, -0.6, 0.6));
    assert_eq!(feedforward.tables.accel.expect("a table").reach, 500.0);
    assert_eq!(feedforward.tables.jerk.expect("a table").reach, 5000.0);
    let drive = feedforward.drive.expect("an inverse");
    let bed = drive.bed.expect("a bed");
    assert_eq!((drive.velocity_gain_per_s, drive.integral_time_s), (440.0, 0.0275));
    assert_eq!((drive.current_lag_s, drive.viscous_friction_per_s), (0.000_37, 0.08));
    assert_eq!((drive.coulomb_friction_mm_s2, drive.reversal_mm_s), (85.0, 0.5));
    assert_eq!((bed.frequency_hz, bed.damping_ratio, bed.mass_ratio), (13.4, 0.03, 0.06));
    let homing = machine.axes[0].homing.expect("homing");
    let config = &homing.config;
    assert_eq!((config.direction, config.fast_mm_s, config.slow_mm_s), (Direction::Negative, 50.0, 2.0));
    assert_eq!((config.travel_mm, config.back_off_mm, config.index_mm), (600.0, 60.0, Some(11.0)));
    assert_eq!((config.position.to_mm(), config.park.map(Position::to_mm)), (-250.0, Some(0.0)));
    let switch = Some(SwitchParameters { closes_mm: (-220.0, -180.0), hysteresis_mm: 0.2 });
    let index = Some(IndexParameters { counts: 100_000, at: Counts(42_000) });
    assert_eq!(homing.simulated, HomeParameters { switch, index });
    let touch = TouchBox { low_mm: [0.0, 0.0, -30.0], high_mm: [100.0, 60.0, -10.0] };
    assert_eq!((machine.tool.change_subroutine.as_deref(), machine.tool.radius_mm), (Some("change"), 3.0));
    assert_eq!(machine.probe, Some(Surface { boxes: vec![touch] }));
    let compensation = machine.axes[0].compensation.expect("a compensation");
    assert_eq!(compensation.backlash, Some(Backlash { play_mm: 0.02, take_up_s: 0.006 }));
    let points_um = [0.0, 7.07, 10.0, 7.07, 0.0, -7.07, -10.0, -7.07];
    assert_eq!(compensation.pitch_error, PitchError::new(0.0, 0.625, &points_um, true));
    let error = PitchErrorParameters { pitch_mm: 5.0, amplitude_mm: 0.01, phase_rad: 0.0 };
    assert_eq!(machine.axes[0].screw, ScrewParameters { pitch_error: Some(error), backlash_mm: 0.02 });
    // The others stay what they are.
    assert_eq!(machine.axes[1..], Machine::reference().axes[1..]);
    // Tables stand alone, and so does the inverse without its bed.
    let text = with_optional_keys();
    let (before, bed) = text.split_once("[axis.regulator.inverse.bed]").expect("a bed");
    let after = &bed[bed.find("[axis.drive]").expect("a drive")..];
    let machine = Machine::from_toml("no_bed.toml", &[before, after].concat()).expect("valid");
    assert_eq!(machine.axes[0].feedforward.drive.expect("an inverse").bed, None);
}

/// `text` with the value of a key, first of its table, replaced; where the value stands.
fn set(text: &str, table: &KeyTable, name: &str, value: &str) -> (String, usize, usize) {
    let start = match table.name {
        "" => 0,
        name if is_list(name) => text.find(&format!("\n[[{name}]]\n")).expect(name),
        name => text.find(&format!("\n[{name}]\n")).expect(name),
    };
    let key = start + text[start..].find(&format!("\n{name} = ")).expect(name) + 1;
    let line = text[key..].lines().next().expect("a line");
    let row = text[..key].lines().count() + 1;
    ([&text[..key], name, " = ", value, &text[key + line.len()..]].concat(), row, name.len() + 4)
}

/// The names in backquotes of a refusal after its first, in order.
fn names(error: &str) -> Vec<&str> {
    error.split('`').skip(3).step_by(2).collect()
}

#[test]
fn the_reader_knows_exactly_the_explained_keys() {
    let text = with_optional_keys();
    for table in KEY_TABLES {
        let first = table.keys[0].name;
        let (unknown, row, _) = set(&text, table, first, "0\nunknown_key = 0");
        // The value before would be refused first.
        let line = text.lines().nth(row - 1).expect("a line");
        let unknown = unknown.replacen(&format!("{first} = 0\nunknown"), &format!("{line}\nunknown"), 1);
        let error = Machine::from_toml("unknown.toml", &unknown).expect_err("an unknown key").to_string();
        assert!(error.starts_with(&format!("unknown.toml:{}:1: found unknown key `unknown_key`", row + 1)));
        let mut found = names(&error);
        found.sort_unstable();
        let prefix = if table.name.is_empty() { String::new() } else { format!("{}.", table.name) };
        let inner = KEY_TABLES.iter().filter_map(|other| other.name.strip_prefix(&prefix));
        // A table without keys of its own is known by its inner ones.
        let inner = inner.filter_map(|name| name.split('.').next()).filter(|name| !name.is_empty());
        let mut expected: Vec<&str> = table.keys.iter().map(|key| key.name).chain(inner).collect();
        expected.sort_unstable();
        expected.dedup();
        assert_eq!(found, expected, "[{}]", table.name);
    }
}

#[test]
fn the_reader_refuses_values_with_the_explained_ranges() {
    let text = with_optional_keys();
    for table in KEY_TABLES {
        for key in table.keys.iter().filter(|key| key.range != "any text") {
            let wrong = match (key.values, key.unit, key.name) {
                (1, "", "name") => "\"no name\"".to_owned(),
                (1, "" | "counts", _) => "-1".to_owned(),
                (1, ..) => "1e300".to_owned(),
                (values, ..) => format!("[{}1e300]", "0, ".repeat(values - 1)),
            };
            let (refused, row, column) = set(&text, table, key.name, &wrong);
            let error = Machine::from_toml("wrong.toml", &refused).expect_err(key.name).to_string();
            // A value in a list stands after those before it.
            let column = column + wrong.find("1e300").unwrap_or(0);
            assert!(error.starts_with(&format!("wrong.toml:{row}:{column}: found ")), "{error}");
            assert!(error.ends_with(&format!(", expected {}", key.range)), "{error}, {}", key.range);
        }
    }
}

/// The subroutine that changes tools by a name that leads to no other folder, and case does not count.
#[test]
fn a_subroutine_has_a_plain_name() {
    let text = with_optional_keys();
    let table = KEY_TABLES.iter().find(|table| table.name == "tool").expect("known");
    let read = |value: &str| {
        let machine = Machine::from_toml("tool.toml", &set(&text, table, "change_subroutine", value).0);
        machine.map(|machine| machine.tool.change_subroutine).map_err(|error| error.to_string())
    };
    for (value, name) in [("\"Tool-Change_2\"", Some("tool-change_2")), ("\"5\"", Some("5")), ("\"\"", None)]
    {
        assert_eq!(read(value), Ok(name.map(str::to_owned)));
    }
    for wrong in ["\"a b\"", "\"../a\"", "\"a.ngc\"", "\"ä\"", "1", "true"] {
        let refused = read(wrong).expect_err(wrong);
        assert!(refused.contains("expected letters, digits, '-' and '_', or \"\" for none"), "{refused}");
    }
}

/// The feed law by its name, and a wrong one in the project's words.
#[test]
fn the_law_has_a_name() {
    let text = with_optional_keys();
    let table = KEY_TABLES.iter().find(|table| table.name == "path").expect("known");
    let read = |value: &str| {
        let (text, row, column) = set(&text, table, "law", value);
        let found = Machine::from_toml("law.toml", &text).map_err(|error| error.to_string());
        (
            found.map(|machine| machine.path.pulse),
            format!("law.toml:{row}:{column}: found law = {value}, expected "),
        )
    };
    for pulse in [Pulse::Sin2, Pulse::Plateau] {
        assert_eq!(read(&format!("\"{}\"", pulse.name())).0, Ok(pulse));
    }
    for wrong in ["-1", "true", "\"other\"", "\"Sin2\"", "\"\""] {
        let (found, place) = read(wrong);
        assert_eq!(found, Err(format!("{place}\"sin2\" or \"plateau\"")));
    }
}

#[test]
fn defaults_and_only_they_may_be_left_out() {
    let text = with_optional_keys();
    let full = Machine::from_toml("full.toml", &text).expect("valid");
    for table in KEY_TABLES {
        for key in table.keys {
            let (marked, row, _) = set(&text, table, key.name, "0");
            let without: String = marked
                .lines()
                .enumerate()
                .filter(|(index, _)| index + 1 != row)
                .map(|(_, line)| line.to_owned() + "\n")
                .collect();
            let found = Machine::from_toml("without.toml", &without);
            let Some(default) = key.default else {
                let error = found.expect_err(key.name).to_string();
                assert!(error.contains(&format!("found no key `{}`", key.name)), "{error}");
                continue;
            };
            let written = set(&text, table, key.name, default).0;
            let written = Machine::from_toml("written.toml", &written).expect("valid");
            assert_eq!(found.expect("valid"), written, "{}", key.name);
        }
        if table.is_optional {
            let brackets = usize::from(is_list(table.name)) + 1;
            let heading = format!("\n{}{}{}\n", "[".repeat(brackets), table.name, "]".repeat(brackets));
            let start = text.find(&heading).expect("a table");
            let end = text[start + 1..].find("\n[").map_or(text.len(), |end| start + 1 + end);
            let without = [&text[..start], &text[end..]].concat();
            let inner = KEY_TABLES.iter().any(|other| other.name.starts_with(&format!("{}.", table.name)));
            // An inner table opens its outer one, which then lacks its keys.
            assert_eq!(Machine::from_toml("without.toml", &without).is_err(), inner, "[{}]", table.name);
        }
    }
    assert_ne!(full, Machine::reference());
}

/// Ranges of the optional keys on every side, and what is not a number.
#[test]
fn ranges_of_optional_keys_are_kept() {
    let text = with_optional_keys();
    let cases: &[(&str, &str, &[&str])] = &[
        ("axis.regulator", "feedforward_lead_s", &["-1e-9", "0.481"]),
        ("axis.regulator.feedforward_velocity_table", "reach", &["0", "-1", "2e12"]),
        (
            "axis.regulator.feedforward_velocity_table",
            "mm_s",
            &["[0, 0]", "[0, 0, 0, 0, 0, 0, 0, 0, -100001]", "0"],
        ),
        ("axis.regulator.inverse", "velocity_gain_per_s", &["0", "0.0009", "2e6", "-440"]),
        ("axis.regulator.inverse", "integral_time_s", &["0", "0.00001", "2e6"]),
        ("axis.regulator.inverse", "current_lag_s", &["-1e-9", "1.1"]),
        ("axis.regulator.inverse", "viscous_friction_per_s", &["-0.1", "2e6"]),
        ("axis.regulator.inverse", "coulomb_friction_mm_s2", &["-0.1", "2e6"]),
        ("axis.regulator.inverse", "reversal_mm_s", &["0", "0.0009", "2e6"]),
        ("axis.regulator.inverse.bed", "frequency_hz", &["0", "-13", "2e9"]),
        ("axis.regulator.inverse.bed", "damping_ratio", &["0", "0.0009", "1.1"]),
        ("axis.regulator.inverse.bed", "mass_ratio", &["0", "-0.06", "101"]),
        ("path", "law", &["\"sin\"", "\"Plateau\"", "\"\"", "[\"sin2\"]"]),
        ("path", "mode", &["\"G64\"", "\"Blend\"", "\"\"", "true", "[\"exact\"]"]),
        ("spindle", "speed_max_rpm", &["0", "-100", "2e6"]),
        ("spindle", "start_s", &["-1", "601"]),
        ("spindle", "stop_s", &["-1", "601"]),
        ("spindle", "turns", &["\"left\"", "\"\"", "[\"both\"]"]),
        ("coolant", "kinds", &["\"none\"", "\"Flood\"", "[\"both\"]"]),
        ("axis.compensation.backlash", "play_mm", &["0", "-0.02", "1.01"]),
        ("axis.compensation.backlash", "take_up_s", &["0", "0.00001", "1.1"]),
        ("axis.compensation.pitch_error", "start_mm", &["-1000001", "1000001"]),
        ("axis.compensation.pitch_error", "spacing_mm", &["0", "0.009", "1001"]),
        ("axis.compensation.pitch_error", "points_um", &["[]", "[0]", "[0, 300.1]", "[-301, 0]", "0"]),
        ("axis.compensation.pitch_error", "repeats", &["0", "[true]", "\"no\""]),
        ("axis.drive.screw", "pitch_mm", &["0", "-5", "100001"]),
        ("axis.drive.screw", "pitch_error_um", &["-1", "301"]),
        ("axis.drive.screw", "pitch_phase_deg", &["-361", "361"]),
        ("axis.drive.screw", "backlash_mm", &["-0.01", "1.1"]),
        ("axis.homing", "search_mm_s", &["0", "0.0009", "-2e9"]),
        ("axis.homing", "approach_mm_s", &["0", "-2"]),
        ("axis.homing", "travel_mm", &["0", "-600", "100001"]),
        ("axis.homing", "back_off_mm", &["0", "-60", "100001"]),
        ("axis.homing", "index_mm", &["-0.001", "100001"]),
        ("axis.homing", "position_mm", &["-100001", "100001"]),
        ("axis.homing", "park_mm", &["-100001", "100001"]),
        ("axis.homing.simulated", "closes_mm", &["-100001", "100001"]),
        ("axis.homing.simulated", "length_mm", &["0", "-1", "100001"]),
        ("axis.homing.simulated", "hysteresis_mm", &["-0.1", "100001"]),
        ("axis.homing.simulated", "index_every_mm", &["-10", "100001"]),
        ("axis.homing.simulated", "index_at_mm", &["-100001", "100001"]),
        ("tool", "radius_mm", &["-0.1", "100001"]),
        ("probe.box", "low_mm", &["[0, 0]", "[0, 0, 0, 0]", "[0, -1000001, 0]", "0"]),
    ];
    for (table, key, values) in cases {
        let table = KEY_TABLES.iter().find(|known| known.name == *table).expect("known");
        for value in values.iter().chain(&["nan", "-inf", "inf", "\"5\"", "true"]) {
            if (*key, *value) == ("repeats", "true") {
                continue;
            }
            let (refused, row, _) = set(&text, table, key, value);
            let error = Machine::from_toml("test.toml", &refused).expect_err(key).to_string();
            assert!(error.starts_with(&format!("test.toml:{row}:")), "{key} = {value}: {error}");
            assert!(error.contains(": found ") && error.contains(", expected "), "{error}");
        }
    }
}

#[test]
fn rules_that_join_optional_keys() {
    let text = with_optional_keys();
    let change = |table: &str, key: &str, value: &str| {
        let table = KEY_TABLES.iter().find(|known| known.name == table).expect("known");
        let (text, row, column) = set(&text, table, key, value);
        let found = Machine::from_toml("test.toml", &text).map_err(|error| error.to_string());
        (found, format!("test.toml:{row}:{column}: found {key} = {value}, expected "))
    };
    let (found, _) = change("axis.regulator", "feedforward_lead_s", "0.012");
    assert!(found.is_ok(), "24 ticks: {found:?}");
    let (found, place) = change("axis.regulator", "feedforward_lead_s", "0.01201");
    assert_eq!(found, Err(format!("{place}at most 0.012, 24 ticks of tick_s = 0.0005")));
    let (found, place) = change("axis.regulator.inverse", "integral_time_s", "0.0004");
    assert_eq!(found, Err(format!("{place}at least tick_s = 0.0005")));
    let (found, place) = change("axis.regulator.inverse.bed", "frequency_hz", "500");
    assert_eq!(found, Err(format!("{place}below 500, a quarter of the frequency of tick_s = 0.0005")));
    assert!(change("axis.regulator.inverse.bed", "frequency_hz", "499").0.is_ok());
    for (key, fast, slow) in [("search_mm_s", "-301", "300"), ("approach_mm_s", "300.5", "300")] {
        let (found, place) = change("axis.homing", key, fast);
        assert_eq!(found, Err(format!("{place}a magnitude of at most feed_mm_s = 300")));
        assert!(change("axis.homing", key, slow).0.is_ok());
    }
    // √(7.5132·0.02/(12300/2)).
    let (found, place) = change("axis.compensation.backlash", "take_up_s", "0.0049");
    let expected = "at least 0.004943, for at most feed_mm_s and half of the acceleration that the drive has";
    assert_eq!(found.map(|_| ()), Err(format!("{place}{expected}")));
    assert!(change("axis.compensation.backlash", "take_up_s", "0.00495").0.is_ok());
    let (found, place) = change("axis.compensation.pitch_error", "points_um", "[0, 12.6]");
    let expected = "at most 0.02 mm/mm from point to point (here 0.0202)";
    assert_eq!(found.map(|_| ()), Err(format!("{place}{expected}")));
    // 6·0.0125/0.625²·300².
    let (found, place) = change("axis.compensation.pitch_error", "points_um", "[0, 12.5]");
    let expected = "a curve along which the motor needs at most 11800 mm/s² at feed_mm_s, what the drive has beyond \
                    accel_mm_s2 (here 17280)";
    assert_eq!(found.map(|_| ()), Err(format!("{place}{expected}")));
    assert!(change("axis.compensation.pitch_error", "points_um", "[0, 4.4]").0.is_ok());
    let many = |count: usize| format!("[{}]", vec!["1"; count].join(", "));
    let (found, place) = change("axis.compensation.pitch_error", "points_um", &many(33));
    let (at, _) = place.split_once(": found").expect("a place");
    assert_eq!(found.map(|_| ()), Err(format!("{at}: found 33 points_um, expected 2 to 32")));
    assert!(change("axis.compensation.pitch_error", "points_um", &many(32)).0.is_ok());
    let (found, place) = change("axis.travel", "low_mm", "700");
    assert_eq!(found.map(|_| ()), Err(format!("{place}less than high_mm = 400")));
    let (found, place) = change("probe.box", "low_mm", "[0, 60.0, -30]");
    // The place is that of the number.
    let place = place.replace(":10: found low_mm = [0, 60.0, -30],", ":14: found 60.0,");
    assert_eq!(found.map(|_| ()), Err(format!("{place}less than high_mm = 60 of the same axis")));
    let (found, place) = change("axis.guard", "following_error_at_rest_mm", "1.01");
    assert_eq!(found.map(|_| ()), Err(format!("{place}at most following_error_limit_mm = 1")));
    assert!(change("axis.guard", "following_error_at_rest_mm", "1").0.is_ok());
    let (found, place) = change("axis.homing.simulated", "index_every_mm", "0.00009");
    assert_eq!(found, Err(format!("{place}0, or at least mm_per_count = 0.0001")));
    let homing = change("axis.homing.simulated", "index_every_mm", "0").0.expect("valid").axes[0].homing;
    assert_eq!(homing.expect("homing").simulated.index, None);
}
