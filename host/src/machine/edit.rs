//! Values written into a machine file, whose comments and layout stay as they are.

use motion_kernel::axis::{AxisCompensation, Feedforward, Gains};
use serde::Deserialize;
use toml_edit::{DocumentMut, Item, Table, value};

use super::error::MachineError;

/// New values of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisEdit {
    /// The axis, from 0.
    pub axis: usize,
    /// Feedback gains.
    pub gains: Gains,
    /// Feedforward. Tables that it has are left as they are in the file, those that it has not are taken out.
    pub feedforward: Feedforward,
    /// Trim of the output \[V\].
    pub output_offset_v: f64,
}

/// `text`, a machine file, with the values of `edits`.
///
/// # Errors
/// The text is no machine file: not TOML, or without the tables that the values belong to.
pub fn edited(source_name: &str, text: &str, edits: &[AxisEdit]) -> Result<String, MachineError> {
    let mut document = document(source_name, text)?;
    for edit in edits {
        let missing = |table: &str| {
            let place =
                format!("found no table [axis.{table}] of axis {}, expected [[axis]] with it", edit.axis + 1);
            MachineError::new(source_name, text, &(0..0), place)
        };
        let axes = document.get_mut("axis").and_then(Item::as_array_of_tables_mut);
        let axis = axes.and_then(|axes| axes.get_mut(edit.axis)).ok_or_else(|| missing("regulator"))?;
        let output = axis.get_mut("output").and_then(Item::as_table_mut).ok_or_else(|| missing("output"))?;
        set(output, "offset_v", Some(edit.output_offset_v));
        let regulator =
            axis.get_mut("regulator").and_then(Item::as_table_mut).ok_or_else(|| missing("regulator"))?;
        set_regulator(regulator, edit);
    }
    Ok(document.to_string())
}

/// `text`, a machine file, with the compensation of axis `axis` (from 0), or with no table where there is none.
///
/// # Errors
/// The text is no machine file: not TOML, or without the axis.
pub fn compensated(
    source_name: &str,
    text: &str,
    axis: usize,
    compensation: &AxisCompensation,
) -> Result<String, MachineError> {
    let mut document = document(source_name, text)?;
    let axes = document.get_mut("axis").and_then(Item::as_array_of_tables_mut);
    let Some(table) = axes.and_then(|axes| axes.get_mut(axis)) else {
        let problem = format!("found no axis {}, expected [[axis]]", axis + 1);
        return Err(MachineError::new(source_name, text, &(0..0), problem));
    };
    let AxisCompensation { backlash, pitch_error } = compensation;
    let is_new = !table.contains_table("compensation");
    let compensation = child(table, "compensation");
    if is_new {
        compensation.set_implicit(true);
    }
    match backlash {
        None => drop(compensation.remove("backlash")),
        Some(backlash) => {
            let backlash_table = child(compensation, "backlash");
            set(backlash_table, "play_mm", Some(backlash.play_mm));
            set(backlash_table, "take_up_s", Some(backlash.take_up_s));
        }
    }
    match pitch_error {
        None => drop(compensation.remove("pitch_error")),
        Some(error) => {
            let table = child(compensation, "pitch_error");
            set(table, "start_mm", Some(error.start_mm));
            set(table, "spacing_mm", Some(error.spacing_mm));
            put(table, "points_um", error.points_um().collect::<toml_edit::Array>());
            put(table, "repeats", error.repeats);
        }
    }
    if compensation.is_empty() {
        table.remove("compensation");
    }
    Ok(document.to_string())
}

fn document(source_name: &str, text: &str) -> Result<DocumentMut, MachineError> {
    text.parse().map_err(|error: toml_edit::TomlError| {
        let problem = format!("found {}", error.message().replace('\n', ", "));
        MachineError::new(source_name, text, &error.span().unwrap_or(0..0), problem)
    })
}

/// A number of a machine file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NumberEdit {
    /// The name of its table in dots, as in [`KEY_TABLES`](super::keys::KEY_TABLES).
    pub table: String,
    /// Its key.
    pub key: String,
    /// Of a table of axes: which axis, from 0; all of them without.
    #[serde(default)]
    pub axis: Option<usize>,
    /// Its new value.
    pub value: f64,
}

/// `text`, a machine file, with other numbers. Whether they are in their ranges is found when it is read.
///
/// # Errors
/// The text is not TOML, or has no such table.
pub fn with_numbers(source_name: &str, text: &str, edits: &[NumberEdit]) -> Result<String, MachineError> {
    let mut document = document(source_name, text)?;
    for NumberEdit { table, key, axis, value } in edits {
        let mut tables = tables_of(&mut document, table);
        if let Some(axis) = axis {
            tables = tables.into_iter().skip(*axis).take(1).collect();
        }
        if tables.is_empty() {
            let problem = format!("found no table [{table}], expected it for {key}");
            return Err(MachineError::new(source_name, text, &(0..0), problem));
        }
        tables.into_iter().for_each(|table| set(table, key, Some(*value)));
    }
    Ok(document.to_string())
}

/// A key's numbers in a machine file, one of each table of this name that has it.
#[must_use]
pub fn numbers(text: &str, table: &str, key: &str) -> Vec<Option<f64>> {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Vec::new() };
    let number = |table: &mut Table| {
        let value = table.get(key)?;
        value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64))
    };
    tables_of(&mut document, table).into_iter().map(number).collect()
}

/// The tables of a name in dots; of a list all that have it.
fn tables_of<'a>(document: &'a mut DocumentMut, name: &str) -> Vec<&'a mut Table> {
    name.split('.').fold(vec![document.as_table_mut()], |tables, part| {
        let of_table = |table: &'a mut Table| match table.get_mut(part) {
            Some(Item::Table(table)) => vec![table],
            Some(Item::ArrayOfTables(list)) => list.iter_mut().collect(),
            _ => Vec::new(),
        };
        tables.into_iter().flat_map(of_table).collect()
    })
}

fn set_regulator(regulator: &mut Table, edit: &AxisEdit) {
    let AxisEdit { gains, feedforward, .. } = edit;
    set(regulator, "kp_per_s", Some(gains.kp_per_s));
    set(regulator, "ki_per_s2", Some(gains.ki_per_s2));
    set(regulator, "kd", Some(gains.kd));
    set(regulator, "feedforward_velocity", Some(feedforward.velocity));
    set(regulator, "feedforward_accel_s", Some(feedforward.accel_s));
    set(regulator, "feedforward_jerk_s2", Some(feedforward.jerk_s2));
    set(regulator, "feedforward_lead_s", (feedforward.lead_s != 0.0).then_some(feedforward.lead_s));
    let tables = &feedforward.tables;
    for (key, table) in [
        ("feedforward_velocity_table", tables.velocity),
        ("feedforward_accel_table", tables.accel),
        ("feedforward_jerk_table", tables.jerk),
    ] {
        if table.is_none() {
            regulator.remove(key);
        }
    }
    let Some(drive) = &feedforward.drive else {
        regulator.remove("inverse");
        return;
    };
    let inverse = child(regulator, "inverse");
    set(inverse, "velocity_gain_per_s", Some(drive.velocity_gain_per_s));
    set(inverse, "integral_time_s", Some(drive.integral_time_s));
    set(inverse, "current_lag_s", Some(drive.current_lag_s));
    set(inverse, "viscous_friction_per_s", Some(drive.viscous_friction_per_s));
    set(inverse, "coulomb_friction_mm_s2", Some(drive.coulomb_friction_mm_s2));
    set(inverse, "reversal_mm_s", Some(drive.reversal_mm_s));
    let Some(bed) = &drive.bed else {
        inverse.remove("bed");
        return;
    };
    let table = child(inverse, "bed");
    set(table, "frequency_hz", Some(bed.frequency_hz));
    set(table, "damping_ratio", Some(bed.damping_ratio));
    set(table, "mass_ratio", Some(bed.mass_ratio));
}

/// The table `name`, new if there was none.
fn child<'table>(parent: &'table mut Table, name: &str) -> &'table mut Table {
    let item = parent.entry(name).or_insert_with(toml_edit::table);
    if !item.is_table() {
        *item = toml_edit::table();
    }
    item.as_table_mut().expect("made a table")
}

/// Sets `key`, or takes it out.
fn set(table: &mut Table, key: &str, to: Option<f64>) {
    match to {
        Some(to) => put(table, key, to),
        None => drop(table.remove(key)),
    }
}

/// Sets `key`, keeping what is written around its value.
fn put(table: &mut Table, key: &str, to: impl Into<toml_edit::Value>) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            let decor = old.decor().clone();
            *old = to.into();
            *old.decor_mut() = decor;
        }
        None => drop(table.insert(key, value(to))),
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::axis::{Backlash, BedInverse, DriveInverse, PitchError};

    use super::*;
    use crate::machine::{Machine, REFERENCE_TOML};

    fn edit(machine: &Machine, axis: usize) -> AxisEdit {
        let settings = &machine.axes[axis];
        AxisEdit {
            axis,
            gains: settings.gains,
            feedforward: settings.feedforward,
            output_offset_v: settings.output_offset_v,
        }
    }

    #[test]
    fn what_is_written_is_what_is_read() {
        let mut machine = Machine::reference();
        let bed = BedInverse { frequency_hz: 13.4, damping_ratio: 0.03, mass_ratio: 0.06 };
        for (axis, bed) in machine.axes[..2].iter_mut().zip([None, Some(bed)]) {
            axis.output_offset_v = -0.0125;
            axis.gains = Gains { kp_per_s: 217.5, ki_per_s2: 0.0, kd: 1e-5 };
            axis.feedforward = Feedforward {
                velocity: 0.998,
                lead_s: 1.67e-3,
                drive: Some(DriveInverse {
                    velocity_gain_per_s: 440.12,
                    integral_time_s: 0.0275,
                    current_lag_s: 3.7e-4,
                    viscous_friction_per_s: 0.08,
                    coulomb_friction_mm_s2: 85.0,
                    reversal_mm_s: 0.5,
                    bed,
                }),
                ..Feedforward::default()
            };
        }
        let edits = [edit(&machine, 0), edit(&machine, 1)];
        let text = edited("m.toml", REFERENCE_TOML, &edits).expect("a machine file");
        assert_eq!(Machine::from_toml("m.toml", &text), Ok(machine.clone()));
        // Every comment is still there.
        let comments = |text: &str| text.lines().filter(|line| line.starts_with('#')).count();
        assert_eq!(comments(&text), comments(REFERENCE_TOML));
        // Twice is once; and back again, what is no longer wanted goes.
        assert_eq!(edited("m.toml", &text, &edits).expect("a machine file"), text);
        let reference = Machine::reference();
        let back =
            edited("m.toml", &text, &[edit(&reference, 0), edit(&reference, 1)]).expect("a machine file");
        assert_eq!(Machine::from_toml("m.toml", &back), Ok(reference));
    }

    #[test]
    fn tables_that_are_not_wanted_go() {
        let mut machine = Machine::reference();
        let table = "[axis.regulator.feedforward_velocity_table]\nreach = 300.0\nmm_s = [-1, -1, -1, -1, 0, 1, 1, 1, 1]\n\n";
        let text = REFERENCE_TOML.replacen("[axis.drive]", &format!("{table}[axis.drive]"), 1);
        let read = |text: &str| Machine::from_toml("m.toml", text).expect("a machine file");
        let tables = read(&text).axes[0].feedforward.tables;
        assert!(tables.velocity.is_some());
        let without = edited("m.toml", &text, &[edit(&machine, 0)]).expect("a machine file");
        assert_eq!(read(&without), machine);
        machine.axes[0].feedforward.tables = tables;
        let with = edited("m.toml", &text, &[edit(&machine, 0)]).expect("a machine file");
        assert_eq!(read(&with), machine);
    }

    #[test]
    fn a_compensation_is_written_and_taken_out() {
        let mut machine = Machine::reference();
        let pitch_error =
            PitchError::new(-12.5, 0.625, &[0.0, 7.07, 10.0, 0.03, 0.0, -7.07, -10.0, -7.07], true);
        let both =
            AxisCompensation { backlash: Some(Backlash { play_mm: 0.0203, take_up_s: 0.0055 }), pitch_error };
        let mut text = REFERENCE_TOML.to_owned();
        for compensation in [
            both,
            AxisCompensation { backlash: None, ..both },
            AxisCompensation { pitch_error: None, ..both },
            AxisCompensation { backlash: None, pitch_error: None },
        ] {
            text = compensated("m.toml", &text, 1, &compensation).expect("a machine file");
            machine.axes[1].compensation = (compensation
                != AxisCompensation { backlash: None, pitch_error: None })
            .then_some(compensation);
            assert_eq!(Machine::from_toml("m.toml", &text), Ok(machine.clone()), "{text}");
        }
        assert_eq!(text, REFERENCE_TOML);
        // What a user has written around the values stays.
        let own = "# of the screw\n[axis.compensation]\n[axis.compensation.pitch_error]\nstart_mm = 0.0\nspacing_mm = 5.0\n\
                   points_um = [0, 1] # by laser\n\n[axis.drive]";
        let text = REFERENCE_TOML.replacen("[axis.drive]", own, 1);
        let text = compensated("m.toml", &text, 0, &both).expect("a machine file");
        assert!(
            text.contains("# of the screw\n[axis.compensation]\n") && text.contains("] # by laser\n"),
            "{text}"
        );
        let error = compensated("m.toml", &text, 3, &both).expect_err("no such axis");
        assert!(error.to_string().contains("found no axis 4"), "{error}");
    }

    #[test]
    fn numbers_are_of_one_axis_or_of_all() {
        let of = |table: &str, key: &str, axis, value| NumberEdit {
            table: table.to_owned(),
            key: key.to_owned(),
            axis,
            value,
        };
        let edits = [
            of("path", "accel_mm_s2", None, 750.0),
            of("axis", "jerk_mm_s3", None, 4000.5),
            of("axis.regulator", "kp_per_s", Some(1), 200.0),
            of("path", "blend_tolerance_mm", None, 0.05),
        ];
        let text = with_numbers("m.toml", REFERENCE_TOML, &edits).expect("a machine file");
        let mut expected = Machine::reference();
        expected.path.accel_mm_s2 = 750.0;
        expected.path.blend_tolerance_mm = 0.05;
        expected.axes.iter_mut().for_each(|axis| axis.jerk_mm_s3 = 4000.5);
        expected.axes[1].gains.kp_per_s = 200.0;
        assert_eq!(Machine::from_toml("m.toml", &text), Ok(expected));
        assert_eq!(numbers(&text, "axis.regulator", "kp_per_s"), [230.0, 200.0, 230.0].map(Some));
        assert_eq!(numbers(&text, "path", "jerk_mm_s3"), [Some(5000.0)]);
        // One axis has a bed.
        assert_eq!(numbers(&text, "axis.drive.bed", "frequency_hz"), [Some(13.4)]);
        assert_eq!(numbers(&text, "axis", "nothing"), [None; 3]);
        let refused =
            |edit| with_numbers("m.toml", REFERENCE_TOML, &[edit]).expect_err("refused").to_string();
        assert_eq!(
            refused(of("axis.drive", "dead_time_s", Some(3), 0.0)),
            "m.toml:1:1: found no table [axis.drive], expected it for dead_time_s"
        );
    }

    #[test]
    fn what_is_no_machine_file_is_refused_with_its_place() {
        let edits = [edit(&Machine::reference(), 2)];
        let of = |text: &str| edited("m.toml", text, &edits).expect_err("refused").to_string();
        assert!(of("a = \n").starts_with("m.toml:1:"), "{}", of("a = \n"));
        assert_eq!(
            of("name = \"x\""),
            "m.toml:1:1: found no table [axis.regulator] of axis 3, expected [[axis]] with it"
        );
    }
}
