//! A run as the page's script reads it: a header in JSON, and columns of numbers behind it, compressed.
//!
//! ```text
//! length of the header, 4 bytes, little end first │ header, JSON │ columns, each where the header says
//! ```
//!
//! The data of a page have a size that grows with the run's duration, up to a bound. As much as fits is told: samples of one
//! tick, or of 2, 4, 8, …; the path to 0.1 µm, or twice, four times as much.

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

use super::column::{self, Column};
use super::outline::{self, Vertex};
use super::samples::{self, Division, Resolution};
use super::worst::{self, Place};
use crate::report::palette;
use crate::report::summary::{Rest, Summary};
use crate::report::{axis_names, command_word, file_name, program_name, views};
use crate::trace::{PathLimits, RunTrace, TraceRow};

/// Changes with what the header and the columns say.
const FORMAT: u32 = 1;

/// The path is told this closely, or as closely as there is room for \[mm\].
const FINEST_MM: f64 = 1e-4;

/// Steps of a vertex's coordinates in the tolerance. Rounding moves a vertex by half a step in each of three axes.
const STEPS_IN_TOLERANCE: f64 = 4.0;
/// The part of the tolerance that rounding to steps takes, at most: half a step times √3.
const ROUNDING_SHARE: f64 = 0.5 * 1.733 / STEPS_IN_TOLERANCE;

/// The share of the data that the path may take.
const PATH_SHARE: f64 = 0.3;
/// About how many bytes a vertex takes, and how many more each of its coordinates.
const BYTES_PER_VERTEX: f64 = 2.5;
const BYTES_PER_COORDINATE: f64 = 2.0;

/// Path positions are told in these steps \[mm\], feeds in these \[mm/s\], times of blocks in these \[s\].
const POSITION_STEP_MM: f64 = 1e-4;
const FEED_STEP_MM_S: f64 = 1e-3;
const TIME_STEP_S: f64 = 1e-6;

#[derive(Serialize)]
struct Header<'run> {
    format: u32,
    program: &'run str,
    machine: &'run str,
    tick_s: f64,
    #[serde(flatten)]
    division: DivisionJson,
    planned_time_s: f64,
    length_mm: f64,
    limits: PathLimits,
    axes: Vec<AxisJson>,
    /// Views of the path: a name, and the axes to the right, upwards, and towards the reader.
    views: Vec<(String, Vec<usize>)>,
    /// The greatest distance between the path and the line through its vertices \[mm\].
    tolerance_mm: f64,
    reasons: Vec<(&'run str, String)>,
    kinds: Vec<&'run str>,
    rests: Vec<RestJson>,
    commands: Vec<MarkJson>,
    faults: Vec<MarkJson>,
    worst: Vec<WorstJson>,
    columns: Vec<Column>,
}

#[derive(Clone, Copy, Serialize)]
struct DivisionJson {
    first_tick: u64,
    ticks: u64,
    ticks_per_sample: u64,
}

#[derive(Serialize)]
struct AxisJson {
    name: String,
    unit: &'static str,
    thousandth: &'static str,
    is_moved: bool,
    is_on_path: bool,
    error_limit_um: f64,
}

#[derive(Serialize)]
struct RestJson {
    state: &'static str,
    from_s: f64,
    to_s: f64,
}

#[derive(Serialize)]
struct MarkJson {
    tick: u64,
    word: String,
}

#[derive(Serialize)]
struct WorstJson {
    name: String,
    unit: String,
    places: Vec<Place>,
}

/// The data of a run, which take `bytes_max` bytes at most, if the header and the blocks leave room for anything else.
pub(super) fn of_run<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    bytes_max: usize,
) -> io::Result<Vec<u8>> {
    let (first_tick, last_tick) =
        trace.ticks.first().zip(trace.ticks.last()).map_or((0, 0), |(first, last)| (first.tick, last.tick));
    let ticks = if trace.ticks.is_empty() { 0 } else { last_tick - first_tick + 1 };
    let mut fixed = Vec::new();
    let mut columns = visits(trace, first_tick, &mut fixed);
    columns.extend(blocks(trace, &mut fixed));
    let (path_columns, tolerance_mm) = path(trace, summary, bytes_max, &mut fixed);
    columns.extend(path_columns);
    let quantities = quantities(trace, summary);
    let reasons = reasons(trace);
    let mut header = Header {
        format: FORMAT,
        program: file_name(program_name(trace)),
        machine: &trace.machine,
        tick_s: trace.tick_s,
        division: DivisionJson { first_tick, ticks, ticks_per_sample: 1 },
        planned_time_s: trace.planned_time_s,
        length_mm: summary.path_length_mm,
        limits: trace.limits,
        axes: axes(trace, summary),
        views: views_of(trace, summary),
        tolerance_mm,
        reasons: reasons.iter().map(|&reason| (reason, ink(reason, &reasons))).collect(),
        kinds: distinct(trace.blocks.iter().map(|block| &*block.kind)),
        rests: summary
            .rests
            .iter()
            .map(|&Rest { state, from_s, to_s }| RestJson { state, from_s, to_s })
            .collect(),
        commands: trace
            .commands
            .iter()
            .map(|command| MarkJson { tick: command.tick, word: command_word(command) })
            .collect(),
        faults: trace
            .faults
            .iter()
            .map(|fault| MarkJson { tick: fault.tick, word: fault.fault.clone() })
            .collect(),
        worst: quantities.iter().filter_map(|quantity| quantity.worst(trace)).collect(),
        columns: Vec::new(),
    };
    // More than this cannot be compressed to what there is room for.
    let values_max = 8 * bytes_max as u64;
    let mut division = Division { first_tick, ticks, ticks_per_sample: 1 };
    while division.samples() as u64 * quantities.len() as u64 > values_max {
        division.ticks_per_sample *= 2;
    }
    loop {
        let mut bytes = fixed.clone();
        let mut with_samples = columns.clone();
        for quantity in &quantities {
            let values = trace.ticks.iter().map(|row| (row.tick, (quantity.value)(row)));
            let written = samples::write(&mut bytes, &quantity.column, quantity.resolution, division, values);
            with_samples.extend(written);
        }
        header.division.ticks_per_sample = division.ticks_per_sample;
        header.columns = with_samples;
        let data = with_header(&header, &bytes)?;
        if data.len() <= bytes_max || division.samples() <= 1 {
            return Ok(data);
        }
        division.ticks_per_sample *= 2;
    }
}

fn with_header(header: &Header<'_>, columns: &[u8]) -> io::Result<Vec<u8>> {
    let header = serde_json::to_vec(header)?;
    compressed(&[&(header.len() as u32).to_le_bytes(), &header, columns])
}

/// Parts behind each other, compressed.
pub(super) fn compressed(parts: &[&[u8]]) -> io::Result<Vec<u8>> {
    compressed_to(Compression::default(), parts)
}

/// The same, as closely as this.
pub(super) fn compressed_to(level: Compression, parts: &[&[u8]]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), level);
    parts.iter().try_for_each(|part| encoder.write_all(part))?;
    encoder.finish()
}

/// What is told of every tick.
struct Quantity<'run, const N: usize> {
    /// The name of its column.
    column: String,
    /// In the list of worst places; without one it is not there.
    name: Option<String>,
    unit: String,
    resolution: Resolution,
    value: Box<dyn Fn(&TraceRow<N>) -> f64 + 'run>,
}

impl<const N: usize> Quantity<'_, N> {
    fn worst(&self, trace: &RunTrace<N>) -> Option<WorstJson> {
        let places = worst::places(trace, &self.value);
        let name = self.name.clone().filter(|_| !places.is_empty())?;
        Some(WorstJson { name, unit: self.unit.clone(), places })
    }
}

fn quantities<'run, const N: usize>(trace: &'run RunTrace<N>, summary: &Summary) -> Vec<Quantity<'run, N>> {
    let of = |column: &str, name: Option<&str>, unit: &str, value: fn(&TraceRow<N>) -> f64| Quantity {
        column: column.to_owned(),
        name: name.map(str::to_owned),
        unit: unit.to_owned(),
        resolution: Resolution::Relative,
        value: Box::new(value),
    };
    let mut all = vec![
        Quantity { resolution: Resolution::Step(POSITION_STEP_MM), ..of("s", None, "mm", |row| row.s_mm) },
        of("feed", Some("feed"), "mm/s", |row| row.v_mm_s),
        of("acceleration", Some("acceleration"), "mm/s²", |row| row.a_mm_s2),
        of("jerk", Some("jerk"), "mm/s³", |row| row.j_mm_s3),
        of("snap", Some("snap"), "mm/s⁴", |row| row.snap_mm_s4),
    ];
    if !summary.contour_um.is_empty() {
        all.push(of("contour", Some("contour error"), "µm", |row| row.contour_um));
    }
    for ((axis, of_run), name) in trace.axes.iter().enumerate().zip(axis_names(trace)) {
        let (symbol, thousandth) = (of_run.unit().symbol(), of_run.unit().thousandth_symbol());
        let mut add = |column: &str,
                       words: Option<&str>,
                       unit: String,
                       resolution,
                       value: fn(&TraceRow<N>, usize) -> f64| {
            all.push(Quantity {
                column: format!("{column} {axis}"),
                name: words.map(|words| format!("{words} of {name}")),
                unit,
                resolution,
                value: Box::new(move |row: &TraceRow<N>| value(row, axis)),
            });
        };
        let step = Resolution::Step(POSITION_STEP_MM);
        add("position", None, symbol.to_owned(), step, |row, axis| row.axes[axis].set_mm);
        let relative = Resolution::Relative;
        add("velocity", Some("velocity"), format!("{symbol}/s"), relative, |row, axis| {
            row.axes[axis].vel_mm_s
        });
        add("error", Some("following error"), thousandth.to_owned(), relative, |row, axis| {
            row.axes[axis].err_um
        });
        add("volts", Some("output"), "V".to_owned(), relative, |row, axis| row.axes[axis].out_v);
    }
    all
}

fn axes<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> Vec<AxisJson> {
    let axes = trace.axes.iter().zip(axis_names(trace)).zip(&summary.axes).enumerate();
    axes.map(|(index, ((axis, name), figures))| AxisJson {
        name,
        unit: axis.unit().symbol(),
        thousandth: axis.unit().thousandth_symbol(),
        is_moved: figures.moved(),
        is_on_path: summary.linear.contains(&index),
        error_limit_um: axis.following_error_limit_um,
    })
    .collect()
}

/// Views in space first, then in planes.
fn views_of<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> Vec<(String, Vec<usize>)> {
    let names = axis_names(trace);
    let planes = views(summary);
    let moved: Vec<usize> =
        summary.linear.iter().copied().filter(|&axis| summary.axes[axis].moved()).collect();
    let in_space = (moved.len() >= 3).then(|| ("3D".to_owned(), moved[..3].to_vec()));
    let in_plane = planes
        .iter()
        .map(|view| (format!("{}{}", names[view.right], names[view.up]), vec![view.right, view.up]));
    in_space.into_iter().chain(in_plane).collect()
}

/// Reasons of ceilings in the order of their appearance.
fn reasons<const N: usize>(trace: &RunTrace<N>) -> Vec<&str> {
    distinct(trace.blocks.iter().map(|block| &*block.cap_reason))
}

/// The ink of a ceiling. Where a block is too short to reach its own, what set that is not known, and does not matter.
fn ink(reason: &str, known: &[&str]) -> String {
    let is_unreached = |reason: &str| ["accelerating", "braking"].contains(&reason);
    let reached: Vec<&str> = known.iter().copied().filter(|reason| !is_unreached(reason)).collect();
    let reason = if is_unreached(reason) { palette::NOT_REACHED } else { reason };
    palette::ceiling(reason, &reached).name()
}

fn distinct<'a>(words: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut distinct = Vec::new();
    for word in words {
        if !distinct.contains(&word) {
            distinct.push(word);
        }
    }
    distinct
}

/// Where the path comes to another line of the program: ticks from the first one, and lines.
fn visits<const N: usize>(trace: &RunTrace<N>, first_tick: u64, bytes: &mut Vec<u8>) -> Vec<Column> {
    let visits = || trace.ticks.chunk_by(|a, b| a.line == b.line).filter_map(<[_]>::first);
    let ticks: Vec<i32> = visits().map(|row| (row.tick - first_tick) as i32).collect();
    let lines: Vec<i32> = visits().map(|row| row.line as i32).collect();
    vec![
        column::write(bytes, "visit tick".to_owned(), 1.0, &ticks),
        column::write(bytes, "visit line".to_owned(), 1.0, &lines),
    ]
}

/// Blocks in path order. Where they start has one more number: where the last one ends.
fn blocks<const N: usize>(trace: &RunTrace<N>, bytes: &mut Vec<u8>) -> Vec<Column> {
    let blocks = &trace.blocks;
    let end_mm = blocks.last().map(|block| block.start_mm + block.length_mm);
    let starts_mm: Vec<f64> = blocks.iter().map(|block| block.start_mm).chain(end_mm).collect();
    let reach = starts_mm.last().copied().unwrap_or(0.0) / f64::from(1 << 30);
    let (reasons, kinds) = (reasons(trace), distinct(blocks.iter().map(|block| &*block.kind)));
    let place =
        |words: &[&str], word: &str| words.iter().position(|other| *other == word).unwrap_or(0) as i32;
    let mut write = |name: &str, step: f64, values: Vec<f64>| {
        let numbers: Vec<i32> = values.into_iter().map(|value| number(value, step)).collect();
        column::write(bytes, name.to_owned(), step, &numbers)
    };
    let all = |of: fn(&crate::trace::TracedBlock) -> f64| blocks.iter().map(of).collect::<Vec<_>>();
    let mut columns = vec![
        write("block start", POSITION_STEP_MM.max(reach), starts_mm),
        write("block ceiling", FEED_STEP_MM_S, all(|block| block.cap_mm_s)),
        write("block enter", FEED_STEP_MM_S, all(|block| block.enter_mm_s)),
        write("block peak", FEED_STEP_MM_S, all(|block| block.peak_mm_s)),
        write("block exit", FEED_STEP_MM_S, all(|block| block.exit_mm_s)),
        write("block time", TIME_STEP_S, all(|block| block.time_s)),
        write("block line", 1.0, all(|block| f64::from(block.line))),
        write("block rapid", 1.0, all(|block| f64::from(u8::from(block.is_rapid)))),
    ];
    let of_words = |name: &str, numbers: Vec<i32>, bytes: &mut Vec<u8>| {
        column::write(bytes, name.to_owned(), 1.0, &numbers)
    };
    let of_reasons = blocks.iter().map(|block| place(&reasons, &block.cap_reason)).collect();
    columns.push(of_words("block reason", of_reasons, bytes));
    let of_kinds = blocks.iter().map(|block| place(&kinds, &block.kind)).collect();
    columns.push(of_words("block kind", of_kinds, bytes));
    columns
}

/// In steps; what no number holds is the greatest one, which the page shows as none.
fn number(value: f64, step: f64) -> i32 {
    if value.is_finite() { (value / step).round() as i32 } else { i32::MAX }
}

/// The path of the linear axes, and how far it may be off \[mm\].
fn path<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    bytes_max: usize,
    bytes: &mut Vec<u8>,
) -> (Vec<Column>, f64) {
    // What is not finite is not drawn.
    let place = |row: &TraceRow<N>| {
        let mut place = [0.0; N];
        for &axis in &summary.linear {
            place[axis] = row.axes[axis].set_mm;
        }
        place.iter().all(|coordinate: &f64| coordinate.is_finite()).then_some((row.tick, place))
    };
    let (ticks, points): (Vec<u64>, Vec<[f64; N]>) = trace.ticks.iter().filter_map(place).unzip();
    let all = outline::outline(&points, FINEST_MM * (1.0 - ROUNDING_SHARE));
    let bytes_per_vertex = BYTES_PER_VERTEX + BYTES_PER_COORDINATE * summary.linear.len() as f64;
    let most = (PATH_SHARE * bytes_max as f64 / bytes_per_vertex) as usize;
    let kept = |level: u8| all.iter().filter(move |vertex| vertex.rank > level);
    let level =
        (0..outline::RANK_MAX).find(|&level| kept(level).count() <= most).unwrap_or(outline::RANK_MAX - 1);
    let kept: Vec<&Vertex> = kept(level).collect();
    let tolerance_mm = outline::tolerance(FINEST_MM, level);
    let reach = points.iter().flatten().fold(0.0_f64, |most, coordinate| most.max(coordinate.abs()));
    let step = (tolerance_mm / STEPS_IN_TOLERANCE).max(reach / f64::from(1 << 30));
    let first = trace.ticks.first().map_or(0, |row| row.tick);
    let of_ticks: Vec<i32> = kept.iter().map(|vertex| (ticks[vertex.point] - first) as i32).collect();
    let ranks: Vec<i32> = kept.iter().map(|vertex| i32::from(vertex.rank - level)).collect();
    let mut columns = vec![
        column::write(bytes, "vertex tick".to_owned(), 1.0, &of_ticks),
        column::write(bytes, "vertex rank".to_owned(), 1.0, &ranks),
    ];
    for &axis in &summary.linear {
        let numbers: Vec<i32> = kept.iter().map(|vertex| number(points[vertex.point][axis], step)).collect();
        columns.push(column::write(bytes, format!("vertex {axis}"), step, &numbers));
    }
    (columns, tolerance_mm)
}
