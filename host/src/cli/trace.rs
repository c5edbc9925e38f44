//! The trace file: one row per tick, written during the run.

use std::io::{self, Write};

use super::csv_failure;
use crate::axis_unit::AxisUnit;
use crate::simulate::RunInfo;
use crate::trace::{AxisTick, TraceRow};

/// Columns of the path, then seven of each axis that there is.
const PATH_COLUMNS: [&str; 8] = ["tick", "t_s", "s_mm", "v_mm_s", "a_mm_s2", "j_mm_s3", "state", "line"];

// Decimals. A position step is 2⁻³² mm = 2.3·10⁻¹⁰ mm, a step of the converter 0.3 mV.
const TIME: usize = 9;
const POSITION: usize = 10;
const VELOCITY: usize = 9;
const CHANGE: usize = 6;
const ERROR: usize = 6;
const VOLTS: usize = 6;

/// A column of an axis.
pub(super) struct AxisColumn {
    /// Its name without the unit.
    pub(super) quantity: &'static str,
    /// The unit of an axis that counts in this.
    unit: fn(AxisUnit) -> String,
    decimals: usize,
    /// Its value.
    pub(super) of: fn(&AxisTick) -> f64,
}

/// The columns of an axis.
pub(super) const AXIS_COLUMNS: [AxisColumn; 7] = [
    axis_column("set", |unit| unit.name().to_owned(), POSITION, |tick| tick.set_mm),
    axis_column("vel", |unit| format!("{}_s", unit.name()), VELOCITY, |tick| tick.vel_mm_s),
    axis_column("acc", |unit| format!("{}_s2", unit.name()), CHANGE, |tick| tick.acc_mm_s2),
    axis_column("jerk", |unit| format!("{}_s3", unit.name()), CHANGE, |tick| tick.jerk_mm_s3),
    axis_column("act", |unit| unit.name().to_owned(), POSITION, |tick| tick.act_mm),
    axis_column("err", |unit| unit.thousandth_name().to_owned(), ERROR, |tick| tick.err_um),
    axis_column("out", |_| "v".to_owned(), VOLTS, |tick| tick.out_v),
];

const fn axis_column(
    quantity: &'static str,
    unit: fn(AxisUnit) -> String,
    decimals: usize,
    of: fn(&AxisTick) -> f64,
) -> AxisColumn {
    AxisColumn { quantity, unit, decimals, of }
}

/// A trace being written.
pub(super) struct TraceWriter<W: Write> {
    csv: csv::Writer<W>,
    tick_s: f64,
    /// The axes that there are.
    axis_count: usize,
    /// The text of one field, kept to reuse its memory.
    field: Vec<u8>,
    /// The first failure; nothing is written after it.
    failure: Option<io::Error>,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header. A failure is kept for [`Self::finish`]: it does not stop the run.
    pub(super) fn new(out: W, info: &RunInfo) -> Self {
        let csv = csv::Writer::from_writer(out);
        let (tick_s, axis_count) = (info.tick_s, info.axes.len());
        let mut writer = Self { csv, tick_s, axis_count, field: Vec::new(), failure: None };
        writer.failure = writer.header(info).err();
        writer
    }

    /// Adds a row, or keeps its failure.
    pub(super) fn add<const N: usize>(&mut self, tick: &TraceRow<N>) {
        if self.failure.is_none() {
            self.failure = self.row(tick).err();
        }
    }

    /// Writes out what is still in memory; returns what it was written to.
    pub(super) fn finish(self) -> io::Result<W> {
        match self.failure {
            Some(failure) => Err(failure),
            None => self.csv.into_inner().map_err(csv::IntoInnerError::into_error),
        }
    }

    fn header(&mut self, info: &RunInfo) -> io::Result<()> {
        for column in PATH_COLUMNS {
            self.csv.write_field(column).map_err(csv_failure)?;
        }
        for axis in &info.axes {
            for AxisColumn { quantity, unit, .. } in AXIS_COLUMNS {
                let name = format!("{}_{quantity}_{}", axis.name, unit(axis.unit()));
                self.csv.write_field(name).map_err(csv_failure)?;
            }
        }
        self.csv.write_record(None::<&[u8]>).map_err(csv_failure)
    }

    fn row<const N: usize>(&mut self, tick: &TraceRow<N>) -> io::Result<()> {
        self.text(format_args!("{}", tick.tick))?;
        self.number(tick.tick as f64 * self.tick_s, TIME)?;
        self.number(tick.s_mm, POSITION)?;
        self.number(tick.v_mm_s, VELOCITY)?;
        self.number(tick.a_mm_s2, CHANGE)?;
        self.number(tick.j_mm_s3, CHANGE)?;
        self.text(format_args!("{}", tick.state))?;
        self.text(format_args!("{}", tick.line))?;
        for axis in tick.axes.iter().take(self.axis_count) {
            for column in &AXIS_COLUMNS {
                self.number((column.of)(axis), column.decimals)?;
            }
        }
        self.csv.write_record(None::<&[u8]>).map_err(csv_failure)
    }

    fn number(&mut self, value: f64, decimals: usize) -> io::Result<()> {
        self.text(format_args!("{value:.decimals$}"))
    }

    fn text(&mut self, text: std::fmt::Arguments<'_>) -> io::Result<()> {
        self.field.clear();
        self.field.write_fmt(text)?;
        self.csv.write_field(&self.field).map_err(csv_failure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::Axis;
    use crate::machine::Machine;
    use crate::trace::AxisTick;

    /// A nine-place machine of X, A and W.
    #[test]
    fn columns_are_of_the_axes_that_there_are_in_their_units() {
        let mut info = RunInfo::of_machine(&Machine::reference());
        for (axis, letter) in info.axes.iter_mut().zip([Axis::X, Axis::A, Axis::W]) {
            (axis.name, axis.letter) = (letter.to_string(), letter);
        }
        let mut text = Vec::new();
        let mut trace = TraceWriter::new(&mut text, &info);
        trace.add(&TraceRow {
            tick: 0,
            s_mm: 0.0,
            v_mm_s: 0.0,
            a_mm_s2: 0.0,
            j_mm_s3: 0.0,
            snap_mm_s4: 0.0,
            state: "idle",
            line: 0,
            contour_um: 0.0,
            axes: [AxisTick::default(); 9],
        });
        trace.finish().expect("memory");
        let text = String::from_utf8(text).expect("UTF-8");
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[0].contains(",X_act_mm,X_err_um,X_out_v,A_set_deg,A_vel_deg_s,A_acc_deg_s2,A_jerk_deg_s3,")
        );
        assert!(lines[0].contains(",A_act_deg,A_err_mdeg,A_out_v,W_set_mm,"));
        assert_eq!(lines.iter().map(|line| line.split(',').count()).collect::<Vec<_>>(), [29, 29]);
    }

    #[test]
    fn header_and_row() {
        let mut text = Vec::new();
        let mut trace = TraceWriter::new(&mut text, &RunInfo::of_machine(&Machine::reference()));
        let axis = AxisTick { set_mm: 7_999.999_999_999_8, act_mm: -0.1, ..AxisTick::default() };
        trace.add(&TraceRow {
            tick: 3,
            s_mm: 1.0 / 3.0,
            v_mm_s: 2.0,
            a_mm_s2: -1.5,
            j_mm_s3: 0.0,
            snap_mm_s4: 0.0,
            state: "moving",
            line: 12,
            contour_um: 0.0,
            axes: [axis; 3],
        });
        trace.finish().expect("memory");
        let text = String::from_utf8(text).expect("UTF-8");
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("tick,t_s,s_mm,v_mm_s,a_mm_s2,j_mm_s3,state,line,X_set_mm,X_vel_mm_s,"));
        assert!(lines[0].ends_with("Z_acc_mm_s2,Z_jerk_mm_s3,Z_act_mm,Z_err_um,Z_out_v"));
        assert!(lines[1].starts_with(
            "3,0.001500000,0.3333333333,2.000000000,-1.500000,0.000000,moving,12,7999.9999999998,"
        ));
        assert_eq!(lines.iter().map(|line| line.split(',').count()).collect::<Vec<_>>(), [29, 29]);
    }
}
