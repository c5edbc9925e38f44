//! `motion plan`: what limits the feed, block by block.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use motion_kernel::law::Ramp;
use serde::Serialize;

use super::error::{CliError, Outcome};
use super::table::{self, Align};
use super::{input, progress, write_json};
use crate::machine::on_machine;
use crate::planning::{Mode, PlacedRamp, Plan, plan_blocks};
use crate::trace::TracedBlock;

const EXAMPLES: &str = "\
Examples:
  motion plan part.ngc                           the blocks that take longest: ceiling, its reason, feeds, time
  motion plan part.ngc --all                     every block, in the order of the program
  motion plan part.ngc --machine mine.toml       for a machine of your own
  motion plan part.ngc --per-block               one pair of sin² ramps per block
  motion plan blocks.json --json                 lengths and feeds without geometry
  generate-part | motion plan -                  G-code from standard input

A block list holds its own limits and its law, \"sin2\" or \"plateau\" (also if it is left out):
  {\"law\": \"plateau\", \"limits\": {\"accel_mm_s2\": 500, \"jerk_mm_s3\": 5000, \"snap_mm_s4\": 400000},
   \"start_feed_mm_s\": 0, \"end_feed_mm_s\": 0,
   \"blocks\": [{\"length_mm\": 50, \"feed_mm_s\": 80}, {\"length_mm\": 25, \"feed_mm_s\": 40}]}";

/// Plan the feed of a program or of a block list, without running it.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PlanArguments {
    /// G-code (`-`: standard input), or a block list if the name ends in .json.
    #[arg(value_name = "PROGRAM|BLOCKS.json")]
    program: PathBuf,
    /// Machine file (`motion machine` prints one); without it, the reference machine.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    reading: input::ReadingArguments,
    /// One pair of sin² ramps per block, whatever `law` is; without it, ramps follow it and may span blocks.
    #[arg(long)]
    per_block: bool,
    /// List every block, in the order of the program, not only those that take longest.
    #[arg(long)]
    all: bool,
    /// Print JSON: time_s, blocks, feed; of every block.
    #[arg(long)]
    json: bool,
}

/// So many blocks are listed, unless all are asked for.
const LISTED: usize = 20;

#[derive(Serialize)]
struct PlanJson<'plan> {
    time_s: f64,
    length_mm: f64,
    blocks: Vec<BlockJson<'plan>>,
    feed: Vec<FeedJson>,
    notices: &'plan [String],
}

#[derive(Serialize)]
struct BlockJson<'plan> {
    line: u32,
    kind: &'plan str,
    start_mm: f64,
    length_mm: f64,
    cap_mm_s: f64,
    cap_reason: &'plan str,
    enter_mm_s: f64,
    peak_mm_s: f64,
    exit_mm_s: f64,
    time_s: f64,
}

#[derive(Serialize)]
struct FeedJson {
    start_mm: f64,
    length_mm: f64,
    from_mm_s: f64,
    to_mm_s: f64,
    law: &'static str,
    peak_jerk_mm_s3: f64,
    edge_s: f64,
    plateau_s: f64,
    t1_s: f64,
    t2_s: f64,
    time_s: f64,
}

/// Plans and prints.
///
/// # Errors
/// The program, block list or machine file is refused, there is no plan, or `out` can't be written.
pub fn plan(arguments: &PlanArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    let machine = input::any_machine(arguments.machine.as_ref())?;
    let source = input::read(&arguments.program)?;
    let mode = if arguments.per_block { Mode::PerBlock } else { Mode::Spanning };
    let is_block_list =
        arguments.program.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
    if is_block_list {
        let mut plan = plan_blocks(&source.name, &source.text, mode)?;
        if arguments.machine.is_some() {
            plan.notices.push("a block list has its own limits: --machine is not acted on".to_owned());
        }
        return show(arguments, &plan, out);
    }
    let program = arguments.reading.program(&source, machine.read_options())?;
    on_machine!(machine, machine => show(arguments, &progress::plan(&source.name, &program, machine, mode)?, out))
}

fn show<const N: usize>(
    arguments: &PlanArguments,
    plan: &Plan<N>,
    out: &mut dyn Write,
) -> Result<Outcome, CliError> {
    if arguments.json {
        write_json(&json(plan), out)?;
    } else {
        let listed = if arguments.all { usize::MAX } else { LISTED };
        write_plan(plan, listed, out).map_err(CliError::Output)?;
    }
    Ok(Outcome::Done)
}

fn json<'plan, const N: usize>(plan: &'plan Plan<N>) -> PlanJson<'plan> {
    let block = |block: &'plan TracedBlock| BlockJson {
        line: block.line,
        kind: &block.kind,
        start_mm: block.start_mm,
        length_mm: block.length_mm,
        cap_mm_s: block.cap_mm_s,
        cap_reason: &block.cap_reason,
        enter_mm_s: block.enter_mm_s,
        peak_mm_s: block.peak_mm_s,
        exit_mm_s: block.exit_mm_s,
        time_s: block.time_s,
    };
    let feed = |placed: &PlacedRamp| {
        let Ramp { from_mm_s, to_mm_s, peak_jerk_mm_s3, edge_s, t1_s, t2_s, .. } = placed.planned.ramp;
        FeedJson {
            start_mm: placed.start_mm,
            length_mm: placed.length_mm(),
            from_mm_s,
            to_mm_s,
            law: plan.pulse.name(),
            peak_jerk_mm_s3,
            edge_s,
            plateau_s: placed.planned.ramp.plateau_s(),
            t1_s,
            t2_s,
            time_s: placed.time_s(),
        }
    };
    PlanJson {
        time_s: plan.time_s,
        length_mm: plan.length_mm,
        blocks: plan.blocks.iter().map(block).collect(),
        feed: plan.feed.iter().map(feed).collect(),
        notices: &plan.notices,
    }
}

/// Writes the plan for people, with `listed` of its blocks at most: those that take longest, the longest first.
pub(super) fn write_plan<const N: usize>(
    plan: &Plan<N>,
    listed: usize,
    out: &mut dyn Write,
) -> io::Result<()> {
    let columns = [
        ("block", "", Align::Right),
        ("line", "", Align::Right),
        ("kind", "", Align::Left),
        ("length", "mm", Align::Right),
        ("ceiling", "mm/s", Align::Right),
        ("limited by", "", Align::Left),
        ("enter", "mm/s", Align::Right),
        ("peak", "mm/s", Align::Right),
        ("exit", "mm/s", Align::Right),
        ("peak", "mm/min", Align::Right),
        ("time", "s", Align::Right),
    ];
    let row = |(index, block): (usize, &TracedBlock)| {
        [
            (index + 1).to_string(),
            if block.line == 0 { "–".to_owned() } else { block.line.to_string() },
            block.kind.to_string(),
            format!("{:.4}", block.length_mm),
            format!("{:.3}", block.cap_mm_s),
            block.cap_reason.to_string(),
            format!("{:.3}", block.enter_mm_s),
            format!("{:.3}", block.peak_mm_s),
            format!("{:.3}", block.exit_mm_s),
            format!("{:.1}", block.peak_mm_s * 60.0),
            format!("{:.6}", block.time_s),
        ]
    };
    let (blocks, parts) = (plan.blocks.len(), plan.feed.len());
    let mut shown: Vec<(usize, &TracedBlock)> = plan.blocks.iter().enumerate().collect();
    if blocks > listed {
        shown.sort_by(|(_, one), (_, other)| other.time_s.total_cmp(&one.time_s));
        shown.truncate(listed);
        let time_s: f64 = shown.iter().map(|(_, block)| block.time_s).sum();
        let share = 100.0 * time_s / plan.time_s;
        writeln!(
            out,
            "  the {listed} blocks that take longest, {share:.1} % of the time; --all lists all {blocks}\n"
        )?;
    }
    let rows: Vec<[String; 11]> = shown.into_iter().map(row).collect();
    table::write(&columns, &rows, out)?;
    writeln!(
        out,
        "\n  {blocks} blocks, {:.4} mm, {parts} ramps and cruises, {:.6} s",
        plan.length_mm, plan.time_s
    )?;
    plan.notices.iter().try_for_each(|notice| writeln!(out, "  note: {notice}"))
}
