//! The report of a run: one HTML file for the engineer who wants to see what the machine did.
//!
//! Consumes a [`RunTrace`], produces a page that needs nothing else: no font, no picture and no script from
//! elsewhere. It opens on a desk, on a phone and in ten years, and prints on paper. What the run came to stands in it in words
//! and tables; path, plots and program are drawn by its script from the data in it ([`page`]). Time and memory grow
//! with the number of ticks; the size of the page has a bound, and what is told less closely for it is said. Fails
//! only if the output cannot be written.
//!
//! Reports of experiments ([`drive`], [`smoothness`]) are [`Findings`]s: words, tables, and figures that the same script draws.

pub mod drive;
pub mod figure;
mod format;
pub mod page;
#[cfg(test)]
pub(crate) use page::reading;
mod palette;
#[cfg(feature = "terminal")]
mod picture;
mod findings;
#[cfg(feature = "terminal")]
pub mod smoothness;
#[cfg(feature = "terminal")]
pub mod spline;
mod summary;
mod tables;

use std::io::{self, Write};

pub use self::figure::{Figure, Stack};
pub use self::findings::{Findings, Verdict};
pub use self::page::PageRun;

use self::format::{counted, duration, escape, figure};
use self::summary::{Outcome, Summary};
use crate::trace::{RunTrace, TracedCommand, TracedFault};

/// Faults named in the sentence at the top; the table below it has the others.
const FAULTS_IN_SENTENCE: usize = 3;

/// Notices shown.
const NOTICES_MAX: usize = 100;

/// Writes the report of `trace` as one self-contained HTML file, with another run's curves beside it, and findings below it, if there
/// are such.
///
/// An empty trace, a run of one tick and values that are not finite all make a valid page that says so.
///
/// # Errors
///
/// Whatever `out` reports. The page is made in memory.
pub fn write_html<const N: usize>(
    trace: &RunTrace<N>,
    against: Option<&PageRun>,
    below: Option<Findings>,
    out: &mut impl Write,
) -> io::Result<()> {
    let summary = Summary::of(trace);
    page::write(trace, &summary, &headline(trace, &summary), against, below, out)
}

/// What a page shows of a run: what it came to in words and tables, as HTML, and its data.
///
/// # Errors
/// Writing into memory fails.
pub fn page_parts<const N: usize>(trace: &RunTrace<N>) -> io::Result<(String, PageRun)> {
    let summary = Summary::of(trace);
    Ok((headline(trace, &summary), PageRun::with_summary(trace, &summary)?))
}

/// The page of an operator's panel, which has its data from its server.
#[must_use]
pub fn panel_page() -> String {
    page::panel()
}

/// What the run came to, in words and tables.
fn headline<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    let outcome = outcome(trace, summary);
    let tables = [tables::faults(trace), tables::commands(trace), notices(trace, summary)].concat();
    let figures = tables::key_figures(trace, summary);
    let axes = tables::axes(trace, summary, &axis_names(trace));
    format!("{outcome}{tables}<h2>Key figures</h2>\n{figures}{axes}")
}

/// Names to call the axes by; one without a name gets its number.
fn axis_names<const N: usize>(trace: &RunTrace<N>) -> Vec<String> {
    let name = |(axis, name): (usize, &str)| match name {
        "" => format!("axis {}", axis + 1),
        name => name.to_string(),
    };
    trace.axes.iter().map(|axis| axis.name.trim()).enumerate().map(name).collect()
}

fn program_name<const N: usize>(trace: &RunTrace<N>) -> &str {
    if trace.program.is_empty() { "unnamed program" } else { &trace.program }
}

/// The last part of a path, which is what a reader looks for.
fn file_name(program: &str) -> &str {
    program.rsplit(['/', '\\']).next().filter(|name| !name.is_empty()).unwrap_or(program)
}

/// Which run it is, and how it ended.
fn outcome<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    let program = program_name(trace);
    let mut text = format!("<header><h1>{}</h1>\n", escape(file_name(program)));
    let named = [
        ("Program", program, file_name(program) != program),
        ("Machine", &trace.machine, !trace.machine.is_empty()),
    ];
    for (what, name, _) in named.into_iter().filter(|(_, _, is_told)| *is_told) {
        text += &format!("<p class=\"machine\">{what}: {}</p>\n", escape(name));
    }
    let class = match summary.outcome {
        Outcome::Empty => "empty",
        Outcome::Done => "done",
        Outcome::Unfinished => "unfinished",
        Outcome::Faulted => "faulted",
    };
    text + &format!("<p class=\"result {class}\">{}</p></header>\n", result(trace, summary))
}

/// How the run ended, in one sentence.
fn result<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    let blocks = counted(trace.blocks.len(), "block", "blocks");
    let length = figure(summary.path_length_mm, 6);
    let time = duration(summary.executed_time_s);
    match summary.outcome {
        Outcome::Empty => "<strong>Nothing was run:</strong> the trace holds no tick.".to_string(),
        // Ticks alone: what a board did, without its plan.
        Outcome::Done if trace.blocks.is_empty() => format!("<strong>Without a fault:</strong> {time}."),
        Outcome::Done => format!("<strong>Done without a fault:</strong> {blocks}, {length} mm in {time}."),
        Outcome::Unfinished => format!(
            "<strong>Not finished:</strong> {} at {} of {length} mm along the path{}, after {time}.",
            trace.end.words().unwrap_or("the run ended without a fault"),
            figure(summary.path_done_mm, 6),
            reached_line(trace)
        ),
        Outcome::Faulted => {
            let named: Vec<_> = trace
                .faults
                .iter()
                .take(FAULTS_IN_SENTENCE)
                .map(|fault| name_fault(fault, trace.tick_s))
                .collect();
            let others = match trace.faults.len().saturating_sub(FAULTS_IN_SENTENCE) {
                0 => String::new(),
                others => format!(", and {}", counted(others, "other", "others")),
            };
            format!(
                "<strong>Ended in {}:</strong> {}{others}, at {} of {length} mm along the path{}.",
                if trace.faults.len() == 1 { "a fault" } else { "faults" },
                named.join("; "),
                figure(summary.path_done_mm, 6),
                reached_line(trace),
            )
        }
    }
}

/// The line that the run came to, if it came to one.
fn reached_line<const N: usize>(trace: &RunTrace<N>) -> String {
    let line = trace.ticks.iter().rev().map(|tick| tick.line).find(|&line| line > 0);
    line.map_or_else(String::new, |line| format!(", line {line}"))
}

fn name_fault(fault: &TracedFault, tick_s: f64) -> String {
    let axis = fault.axis.as_deref().map_or(String::new(), |axis| format!(" on axis {}", escape(axis)));
    let detail =
        if fault.detail.is_empty() { String::new() } else { format!(" ({})", escape(&fault.detail)) };
    format!("{}{axis} at {:.4} s{detail}", escape(&fault.fault), fault.tick as f64 * tick_s)
}

fn notices<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    if trace.notices.is_empty() && summary.not_finite == 0 {
        return String::new();
    }
    let mut notices: Vec<String> =
        trace.notices.iter().take(NOTICES_MAX).map(|notice| escape(notice)).collect();
    if trace.notices.len() > NOTICES_MAX {
        notices.push(format!("{} more left out.", trace.notices.len() - NOTICES_MAX));
    }
    if summary.not_finite > 0 {
        let values = counted(summary.not_finite as usize, "value", "values");
        notices.push(format!("{values} in the trace not finite, and therefore not drawn."));
    }
    let items: String = notices.iter().map(|notice| format!("<li>{notice}</li>\n")).collect();
    format!("<h2>Notices</h2>\n<ul class=\"notices\">\n{items}</ul>\n")
}

/// A command as people read it: "hold", "override 50 %".
fn command_word(command: &TracedCommand) -> String {
    match command.feed_override {
        Some(share) => format!("override {} %", figure(share * 100.0, 4)),
        None => command.command.clone(),
    }
}

/// Two linear axes of the machine, to the right and upwards.
struct View {
    right: usize,
    up: usize,
}

/// The planes in which there is something to see, of linear axes: of two that moved theirs, of more the first with each
/// of the others, and the plane of two others if the tool moved within it (G19), which those show as a line. An axis that
/// moved alone is shown with the first, or the next.
fn views(summary: &Summary) -> Vec<View> {
    let view = |&(right, up): &(usize, usize)| View { right, up };
    let moved: Vec<usize> =
        summary.linear.iter().copied().filter(|&axis| summary.axes[axis].moved()).collect();
    match (&moved[..], &summary.linear[..]) {
        (&[first, ref others @ ..], _) if !others.is_empty() => {
            let with_first = others.iter().map(|&other| (first, other)).collect::<Vec<_>>();
            let is_shown = |&(a, b): &&(usize, usize)| others.contains(a) && others.contains(b);
            with_first.iter().chain(summary.moved_together.iter().filter(is_shown)).map(view).collect()
        }
        (&[alone], &[first, ..]) if alone != first => vec![view(&(first, alone))],
        (_, &[first, second, ..]) => vec![view(&(first, second))],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests;
