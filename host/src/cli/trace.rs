//! The trace file: one row per tick, written during the run.

use std::io::{self, Write};
use std::num::NonZeroU64;
use std::path::PathBuf;

use clap::Args;

use super::csv_failure;
use super::error::CliError;
use crate::files::STANDARD_INPUT;
use crate::simulate::RunInfo;
use crate::simulate::live::{Due, When};
use crate::trace::TraceRow;
use crate::trace::columns::{AXIS_COLUMNS, AxisColumn, CHANGE, POSITION, TIME, VELOCITY};

/// Columns of the path, then seven of each axis that there is.
const PATH_COLUMNS: [(&str, PathColumn); 8] = [
    ("tick", PathColumn::Tick),
    ("t_s", PathColumn::Time),
    ("s_mm", PathColumn::Position),
    ("v_mm_s", PathColumn::Feed),
    ("a_mm_s2", PathColumn::Acceleration),
    ("j_mm_s3", PathColumn::Jerk),
    ("state", PathColumn::State),
    ("line", PathColumn::Line),
];

/// A column of the path.
#[derive(Clone, Copy, Debug)]
enum PathColumn {
    Tick,
    Time,
    Position,
    Feed,
    Acceleration,
    Jerk,
    State,
    Line,
}

/// A column.
#[derive(Clone, Copy, Debug)]
enum Column {
    Path(PathColumn),
    /// An axis, and which of [`AXIS_COLUMNS`].
    Axis(usize, usize),
}

/// The trace that is asked for.
#[derive(Clone, Debug, Default, Args)]
pub(super) struct TraceArguments {
    /// Write every tick as a row of CSV; an existing file is replaced. `-` is standard output; everything else
    /// is then printed to standard error.
    #[arg(long, value_name = "FILE.csv")]
    pub(super) trace: Option<PathBuf>,
    /// Write every quantity of every tick as MCAP, for viewers such as Foxglove and PlotJuggler; an existing file is
    /// replaced.
    #[arg(long, value_name = "FILE.mcap")]
    pub(super) mcap: Option<PathBuf>,
    /// Columns of --trace in their order, by name, such as `t_s,X_err_um`. Without it, all.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "trace")]
    columns: Vec<String>,
    /// The first tick of --trace: a tick (2000), a time (1.5s), or where motion on a line of the
    /// program's file begins (N50: line 50).
    #[arg(long, value_name = "WHEN", value_parser = when, requires = "trace")]
    from: Option<When>,
    /// The last tick of --trace, likewise.
    #[arg(long, value_name = "WHEN", value_parser = when, requires = "trace")]
    to: Option<When>,
    /// Every how many ticks --trace has a row.
    #[arg(long, value_name = "TICKS", requires = "trace")]
    every: Option<NonZeroU64>,
}

fn when(text: &str) -> Result<When, String> {
    text.parse().map_err(|()| {
        format!("found `{text}`, expected a tick such as 2000, a time such as 1.5s, or a line of the file such as N50")
    })
}

impl TraceArguments {
    /// Whether the trace goes to standard output.
    pub(super) fn is_standard(&self) -> bool {
        self.trace.as_deref().is_some_and(|path| path.as_os_str() == STANDARD_INPUT)
    }

    /// What is to be written of a run of `info`.
    ///
    /// # Errors
    /// There is no such column.
    pub(super) fn selection(&self, info: &RunInfo) -> Result<Selection, CliError> {
        let all = all_columns(info);
        let named = |name: &String| {
            let found = all.iter().find(|(known, _)| known == name.trim()).cloned();
            found.ok_or_else(|| {
                let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
                CliError::Column { found: name.clone(), expected: names.join(", ") }
            })
        };
        let columns = if self.columns.is_empty() {
            all
        } else {
            self.columns.iter().map(named).collect::<Result<_, _>>()?
        };
        let due = |when: Option<When>| when.map(|when| when.due(info));
        let (from, to) = (due(self.from), due(self.to));
        let is_behind = match (from, to) {
            (Some(Due::Tick(from)), Some(Due::Tick(to))) => from > to,
            (Some(Due::Position(from_mm)), Some(Due::Position(to_mm))) => from_mm > to_mm,
            _ => false,
        };
        if is_behind {
            let found = "--from behind --to".to_owned();
            return Err(CliError::Arguments {
                found,
                expected: "a first tick that is not behind the last one",
            });
        }
        let every = self.every.map_or(1, NonZeroU64::get);
        let ticks = Ticks { from, to, every, ..Ticks::ALL };
        Ok(Selection { columns, ticks })
    }
}

/// The columns of a trace, and its ticks.
#[derive(Clone, Debug)]
pub(super) struct Selection {
    /// With their names.
    columns: Vec<(String, Column)>,
    ticks: Ticks,
}

impl Selection {
    /// Everything.
    pub(super) fn all(info: &RunInfo) -> Self {
        Self { columns: all_columns(info), ticks: Ticks::ALL }
    }
}

/// Which ticks are written.
#[derive(Clone, Copy, Debug)]
struct Ticks {
    from: Option<Due>,
    to: Option<Due>,
    every: u64,
    /// The first one that was; whether the last one was.
    first: Option<u64>,
    is_over: bool,
}

impl Ticks {
    const ALL: Self = Self { from: None, to: None, every: 1, first: None, is_over: false };

    /// Whether a tick is written.
    fn takes(&mut self, tick: u64, s_mm: f64) -> bool {
        let is_reached = |due: Option<Due>| due.is_some_and(|due| due.is_reached(tick, s_mm));
        if self.first.is_none() && (self.from.is_none() || is_reached(self.from)) {
            self.first = Some(tick);
        }
        let Some(first) = self.first.filter(|_| !self.is_over) else { return false };
        self.is_over = is_reached(self.to);
        (tick - first).is_multiple_of(self.every)
    }
}

/// All columns, with their names.
fn all_columns(info: &RunInfo) -> Vec<(String, Column)> {
    let of_axes = info.axes.iter().enumerate().flat_map(|(place, axis)| {
        AXIS_COLUMNS.iter().enumerate().map(move |(column, AxisColumn { quantity, unit, .. })| {
            (format!("{}_{quantity}_{}", axis.name, unit(axis.unit())), Column::Axis(place, column))
        })
    });
    let of_path = PATH_COLUMNS.into_iter().map(|(name, column)| (name.to_owned(), Column::Path(column)));
    of_path.chain(of_axes).collect()
}

/// A trace being written.
pub(super) struct TraceWriter<W: Write> {
    csv: csv::Writer<W>,
    tick_s: f64,
    selection: Selection,
    /// The text of one field, kept to reuse its memory.
    field: Vec<u8>,
    /// The first failure; nothing is written after it.
    failure: Option<io::Error>,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header. A failure is kept for [`Self::finish`]: it does not stop the run.
    pub(super) fn new(out: W, info: &RunInfo, selection: Selection) -> Self {
        let csv = csv::Writer::from_writer(out);
        let mut writer = Self { csv, tick_s: info.tick_s, selection, field: Vec::new(), failure: None };
        writer.failure = writer.header().err();
        writer
    }

    /// Adds a row, or keeps its failure.
    pub(super) fn add<const N: usize>(&mut self, tick: &TraceRow<N>) {
        if self.failure.is_none() && self.selection.ticks.takes(tick.tick, tick.s_mm) {
            self.failure = self.row(tick).err();
        }
    }

    /// Whether the tick that it was to begin with has not come.
    pub(super) fn has_not_begun(&self) -> bool {
        self.selection.ticks.from.is_some() && self.selection.ticks.first.is_none()
    }

    /// Writes out what is still in memory; returns what it was written to.
    pub(super) fn finish(self) -> io::Result<W> {
        match self.failure {
            Some(failure) => Err(failure),
            None => self.csv.into_inner().map_err(csv::IntoInnerError::into_error),
        }
    }

    fn header(&mut self) -> io::Result<()> {
        for (name, _) in &self.selection.columns {
            self.csv.write_field(name).map_err(csv_failure)?;
        }
        self.csv.write_record(None::<&[u8]>).map_err(csv_failure)
    }

    fn row<const N: usize>(&mut self, tick: &TraceRow<N>) -> io::Result<()> {
        for index in 0..self.selection.columns.len() {
            self.column(self.selection.columns[index].1, tick)?;
        }
        self.csv.write_record(None::<&[u8]>).map_err(csv_failure)
    }

    fn column<const N: usize>(&mut self, column: Column, tick: &TraceRow<N>) -> io::Result<()> {
        match column {
            Column::Path(PathColumn::Tick) => self.text(format_args!("{}", tick.tick)),
            Column::Path(PathColumn::Time) => self.number(tick.tick as f64 * self.tick_s, TIME),
            Column::Path(PathColumn::Position) => self.number(tick.s_mm, POSITION),
            Column::Path(PathColumn::Feed) => self.number(tick.v_mm_s, VELOCITY),
            Column::Path(PathColumn::Acceleration) => self.number(tick.a_mm_s2, CHANGE),
            Column::Path(PathColumn::Jerk) => self.number(tick.j_mm_s3, CHANGE),
            Column::Path(PathColumn::State) => self.text(format_args!("{}", tick.state)),
            Column::Path(PathColumn::Line) => self.text(format_args!("{}", tick.line)),
            Column::Axis(axis, column) => {
                let AxisColumn { of, decimals, .. } = AXIS_COLUMNS[column];
                self.number(of(&tick.axes[axis]), decimals)
            }
        }
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
        let mut trace = TraceWriter::new(&mut text, &info, Selection::all(&info));
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
        let info = RunInfo::of_machine(&Machine::reference());
        let mut trace = TraceWriter::new(&mut text, &info, Selection::all(&info));
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
