//! The report of a run: one HTML file for the engineer who wants to see what the machine did.
//!
//! Consumes a [`RunTrace`], produces a page that needs nothing else: no script, no font, no picture from
//! elsewhere. It opens on a desk, on a phone and in ten years, and prints on paper. Time and memory grow with
//! the number of ticks; the size of the page does not: plots keep the extremes of every column, tables end
//! after a number of rows and say what they left out. Fails only if the output cannot be written.

mod decimate;
pub mod drive;
mod format;
mod palette;
mod plots;
pub mod smoothness;
mod summary;
mod tables;

use std::io::{self, Write};

use self::format::{counted, duration, escape, figure, share};
use self::palette::Ink;
use self::plots::path::View;
use self::plots::{Caption, contour, feed, marks, path, time};
use self::summary::{Outcome, Span, Summary};
use crate::trace::{RunTrace, TracedFault};

/// Faults named in the sentence at the top; the table below it has the others.
const FAULTS_IN_SENTENCE: usize = 3;

/// Full stops that a plot of the feed can tell apart, even if they are not evenly spread.
const STOPS_TOLD_APART: usize = 60;

/// The remark below a plot with line numbers.
const LINE_NUMBERS: &str = "Numbers along the top, where there is room for them, are lines of the program. ";

/// Notices shown.
const NOTICES_MAX: usize = 100;

/// Writes the report of `trace` as one self-contained HTML file.
///
/// An empty trace, a run of one tick and values that are not finite all make a valid page that says so.
///
/// # Errors
///
/// Whatever `out` reports. Drawing itself happens in memory.
pub fn write_html<const N: usize>(trace: &RunTrace<N>, out: &mut impl Write) -> io::Result<()> {
    let summary = Summary::of(trace);
    let names = axis_names(trace);
    head(file_name(program_name(trace)), out)?;
    header(trace, &summary, &names, out)?;
    if !trace.ticks.is_empty() {
        path_section(trace, &summary, &names, out)?;
        feed_section(trace, &summary, out)?;
        contour_section(trace, &summary, out)?;
        time_section(trace, &summary, out)?;
        axes_section(trace, &summary, &names, out)?;
    }
    if !trace.blocks.is_empty() {
        writeln!(out, "<section><h2>Blocks</h2>\n{}</section>", tables::blocks(trace))?;
    }
    writeln!(out, "</main></body></html>")
}

/// Names to call the axes by; one without a name gets its number.
fn axis_names<const N: usize>(trace: &RunTrace<N>) -> Vec<String> {
    let name = |(axis, name): (usize, &str)| match name {
        "" => format!("axis {}", axis + 1),
        name => name.to_string(),
    };
    trace.axes.iter().map(|axis| axis.name.trim()).enumerate().map(name).collect()
}

/// Everything before what the page has to say about `subject`.
fn head(subject: &str, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <title>{} – motion report</title>\n<style>\n{}{}</style></head>\n<body><main>",
        escape(subject),
        include_str!("style.css"),
        palette::style_sheet(),
    )
}

fn program_name<const N: usize>(trace: &RunTrace<N>) -> &str {
    if trace.program.is_empty() { "unnamed program" } else { &trace.program }
}

/// The last part of a path, which is what a reader looks for.
fn file_name(program: &str) -> &str {
    program.rsplit(['/', '\\']).next().filter(|name| !name.is_empty()).unwrap_or(program)
}

fn header<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    names: &[String],
    out: &mut impl Write,
) -> io::Result<()> {
    let program = program_name(trace);
    writeln!(out, "<header><h1>{}</h1>", escape(file_name(program)))?;
    if file_name(program) != program {
        writeln!(out, "<p class=\"machine\">Program: {}</p>", escape(program))?;
    }
    if !trace.machine.is_empty() {
        writeln!(out, "<p class=\"machine\">Machine: {}</p>", escape(&trace.machine))?;
    }
    let class = match summary.outcome {
        Outcome::Empty => "empty",
        Outcome::Done => "done",
        Outcome::Unfinished => "unfinished",
        Outcome::Faulted => "faulted",
    };
    writeln!(out, "<p class=\"result {class}\">{}</p></header>", result(trace, summary))?;
    writeln!(out, "{}{}", tables::faults(trace), tables::commands(trace))?;
    notices(trace, summary, out)?;
    writeln!(out, "<h2>Key figures</h2>\n{}", tables::key_figures(trace, summary))?;
    writeln!(out, "{}", tables::axes(trace, summary, names))
}

/// How the run ended, in one sentence.
fn result<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    let blocks = counted(trace.blocks.len(), "block", "blocks");
    let length = figure(summary.path_length_mm, 6);
    let time = duration(summary.executed_time_s);
    match summary.outcome {
        Outcome::Empty => "<strong>Nothing was run:</strong> the trace holds no tick.".to_string(),
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

fn notices<const N: usize>(trace: &RunTrace<N>, summary: &Summary, out: &mut impl Write) -> io::Result<()> {
    if trace.notices.is_empty() && summary.not_finite == 0 {
        return Ok(());
    }
    writeln!(out, "<h2>Notices</h2>\n<ul class=\"notices\">")?;
    for notice in trace.notices.iter().take(NOTICES_MAX) {
        writeln!(out, "<li>{}</li>", escape(notice))?;
    }
    if trace.notices.len() > NOTICES_MAX {
        writeln!(out, "<li>{} more left out.</li>", trace.notices.len() - NOTICES_MAX)?;
    }
    if summary.not_finite > 0 {
        let values = counted(summary.not_finite as usize, "value", "values");
        writeln!(out, "<li>{values} in the trace not finite, and therefore not drawn.</li>")?;
    }
    writeln!(out, "</ul>")
}

/// A figure with its legend and its caption.
fn figure_html(
    drawing: &str,
    legend: &[(Ink, String)],
    caption: &str,
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "<figure>\n{drawing}")?;
    if !legend.is_empty() {
        writeln!(out, "<ul class=\"legend\">")?;
        for (ink, word) in legend {
            let line = "<path d=\"M0 24H136\" fill=\"none\" stroke-width=\"12\"";
            writeln!(
                out,
                "<li><svg viewBox=\"0 0 136 48\" aria-hidden=\"true\">{line} stroke=\"{}\"/></svg>{}</li>",
                ink.hex(),
                escape(word)
            )?;
        }
        writeln!(out, "</ul>")?;
    }
    if !caption.is_empty() {
        writeln!(out, "<figcaption>{caption}</figcaption>")?;
    }
    writeln!(out, "</figure>")
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

fn path_section<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    names: &[String],
    out: &mut impl Write,
) -> io::Result<()> {
    let views = views(summary);
    if views.is_empty() {
        return Ok(());
    }
    writeln!(out, "<section><h2>Path</h2>")?;
    let classes = path::classes(summary.feed_mm_s);
    let legend: Vec<_> = palette::CLASSES
        .into_iter()
        .zip(&classes)
        .map(|(ink, (from, to))| (ink, format!("{}–{}", figure(*from, 3), figure(*to, 3))))
        .collect();
    let count = views.len();
    for (number, view) in views.iter().enumerate() {
        let title = format!("Path, {} and {}", names[view.right], names[view.up]);
        let description = path::describe(summary, names, view);
        let caption = Caption { id: &format!("path{number}"), title: &title, description: &description };
        let drawing = path::draw(trace, summary, names, view, &caption)?;
        let last = number + 1 == count;
        let words = if last {
            "Set path, coloured by feed in mm/s. Ring: start; square: end; cross: first fault."
        } else {
            ""
        };
        figure_html(&drawing, if last { &legend } else { &[] }, words, out)?;
    }
    writeln!(out, "</section>")
}

/// The places on the path where faults were latched.
fn faults_mm<const N: usize>(trace: &RunTrace<N>) -> Vec<f64> {
    let place = |fault: &TracedFault| {
        let index = trace.ticks.partition_point(|tick| tick.tick < fault.tick);
        trace.ticks.get(index).map(|tick| tick.s_mm)
    };
    trace.faults.iter().filter_map(place).collect()
}

fn feed_section<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    out: &mut impl Write,
) -> io::Result<()> {
    let (top_mm_s, beyond) = feed::top(trace, summary);
    let reasons = feed::reasons(&trace.blocks, top_mm_s);
    let description = format!(
        "Feed over {} mm of path, at most {} mm/s, under ceilings: {}.",
        figure(summary.path_length_mm, 6),
        figure(summary.feed_mm_s.magnitude(), 4),
        if reasons.is_empty() { "nothing".to_string() } else { reasons.join(", ") }
    );
    let caption =
        Caption { id: "feed", title: "Feed over path length and its ceilings", description: &description };
    let mut legend = vec![(palette::FEED, "feed".to_string())];
    legend.extend(
        reasons.iter().map(|reason| (palette::ceiling(reason, &reasons), format!("ceiling: {reason}"))),
    );
    legend.extend(command_key(trace));
    legend.extend(fault_key(trace));
    let mut words = String::new();
    if feed::has_line_numbers(trace, summary) {
        words += LINE_NUMBERS;
    }
    if reasons.contains(&palette::NOT_REACHED) {
        words += "A ceiling is not reached where a block is too short to accelerate to it and brake again. ";
    }
    if beyond {
        let top = figure(top_mm_s, 4);
        words += &format!(
            "Ceilings above {top} mm/s are out of reach and not drawn; the table of blocks has them. "
        );
    }
    if trace.commands.iter().any(|command| command.feed_override.is_some_and(|share| share > 1.0)) {
        words += "Under an override above 100 % the feed may pass a programmed ceiling, and no other. ";
    }
    if tables::full_stops(trace) > STOPS_TOLD_APART {
        words += "Where the curve fills an area, the feed falls to 0 and rises again more often than the picture resolves. ";
    }
    if feed::is_crowded(trace, summary) {
        words += "Where many blocks share a column, a band spans their ceilings; its lower edge is the lowest of them.";
    }
    writeln!(out, "<section><h2>Feed along the path</h2>")?;
    figure_html(&feed::draw(trace, summary, &caption)?, &legend, &words, out)?;
    writeln!(out, "</section>")
}

fn contour_section<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    out: &mut impl Write,
) -> io::Result<()> {
    if summary.contour_um.is_empty() {
        return Ok(());
    }
    let description = format!(
        "Contour error over {} mm of path, at most {} µm.",
        figure(summary.path_length_mm, 6),
        figure(summary.contour_um.magnitude(), 3),
    );
    let caption =
        Caption { id: "contour", title: "Contour error over path length", description: &description };
    let mut words = if trace.axes.len() > summary.linear.len() {
        "The part of the linear axes' following error across the path. ".to_string()
    } else {
        "The part of the following error across the path. ".to_string()
    };
    if feed::has_line_numbers(trace, summary) {
        words += LINE_NUMBERS;
    }
    writeln!(out, "<section><h2>Contour error along the path</h2>")?;
    let drawing = contour::draw(trace, summary, &faults_mm(trace), &caption)?;
    figure_html(&drawing, &fault_key(trace), &words, out)?;
    writeln!(out, "</section>")
}

/// The remark below a plot over time about limits that it does not show.
fn limits_beyond<'a>(limits: impl Iterator<Item = (&'a str, Span, f64, &'a str)>) -> String {
    let mut words = String::new();
    for (quantity, span, limit, unit) in
        limits.filter(|(_, span, limit, _)| !time::shows_limit(*span, *limit))
    {
        if let Some(share) = share(span.magnitude(), limit) {
            let limit = figure(limit, 4);
            words += &format!(
                "The {quantity} stays within {share} of its limit, {limit} {unit}, which is not drawn. "
            );
        }
    }
    words
}

/// The remark about shaded stretches of a plot over time; nothing if there are none.
fn rests_key(summary: &Summary) -> String {
    let kinds =
        [("dwell", "dwells"), ("stopped", "program stops"), ("held", "rests by command or for lack of data")];
    let has = |state: &str| summary.rests.iter().any(|rest| rest.state == state);
    let there: Vec<&str> = kinds.iter().filter(|(state, _)| has(state)).map(|(_, words)| *words).collect();
    match there[..] {
        [] => String::new(),
        [ref first @ .., last] if !first.is_empty() => format!("Shaded: {} and {last}.", first.join(", ")),
        _ => format!("Shaded: {}.", there.concat()),
    }
}

fn time_section<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    out: &mut impl Write,
) -> io::Result<()> {
    let description = format!(
        "Four curves over {}: feed up to {} mm/s, acceleration up to {} mm/s², jerk up to {} mm/s³, snap up to {} mm/s⁴.",
        duration(summary.executed_time_s),
        figure(summary.feed_mm_s.magnitude(), 4),
        figure(summary.accel_mm_s2.magnitude(), 4),
        figure(summary.jerk_mm_s3.magnitude(), 4),
        figure(summary.snap_mm_s4.magnitude(), 4),
    );
    let caption = Caption {
        id: "time",
        title: "Feed, acceleration, jerk and snap over time",
        description: &description,
    };
    let limits = [
        ("acceleration", summary.accel_mm_s2, trace.limits.accel_mm_s2, "mm/s²"),
        ("jerk", summary.jerk_mm_s3, trace.limits.jerk_mm_s3, "mm/s³"),
        ("snap", summary.snap_mm_s4, trace.limits.snap_mm_s4, "mm/s⁴"),
    ];
    let mut legend = Vec::new();
    if limits.iter().any(|(_, span, limit, _)| time::shows_limit(*span, *limit)) {
        legend.push((palette::LIMIT, "limit".to_string()));
    }
    if !trace.commands.is_empty() {
        legend.push((palette::OVERRIDE, "feed override".to_string()));
    }
    legend.extend(command_key(trace));
    legend.extend(fault_key(trace));
    let words = limits_beyond(limits.into_iter()) + &rests_key(summary);
    writeln!(out, "<section><h2>Motion along the path over time</h2>")?;
    figure_html(&time::along_path(trace, summary, &caption)?, &legend, &words, out)?;
    writeln!(out, "</section>")
}

fn axes_section<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    names: &[String],
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "<section><h2>Axes over time</h2>")?;
    let axes = names.iter().zip(&summary.axes).zip(&trace.axes).enumerate();
    for (axis, ((name, figures), of_run)) in axes {
        let unit = of_run.unit().thousandth_symbol();
        // An axis that failed is of interest even if it was to stand still.
        let failed = trace.faults.iter().any(|fault| fault.axis.as_ref() == Some(&of_run.name));
        if !figures.moved() && !failed {
            writeln!(
                out,
                "<p>{} was not moved: following error at most {} {unit}, output at most {} V.</p>",
                escape(name),
                figure(figures.err_um.magnitude(), 3),
                figure(figures.out_v.magnitude(), 3),
            )?;
            continue;
        }
        let title = format!("Following error and output of {name}");
        let description = format!(
            "Following error at most {} {unit}, {} {unit} rms; output at most {} V.",
            figure(figures.err_um.magnitude(), 3),
            figure(figures.err_um_rms, 3),
            figure(figures.out_v.magnitude(), 3),
        );
        let caption = Caption { id: &format!("axis{axis}"), title: &title, description: &description };
        let drawing = time::of_axis(trace, summary, axis, &caption)?;
        let limit_um = of_run.following_error_limit_um;
        let mut legend = Vec::new();
        if time::shows_limit(figures.err_um, limit_um) {
            legend.push((palette::LIMIT, "limit".to_string()));
        }
        legend.extend(fault_key(trace));
        let beyond = limits_beyond([("following error", figures.err_um, limit_um, unit)].into_iter());
        writeln!(out, "<div class=\"axis\"><h3>{}</h3>", escape(name))?;
        figure_html(&drawing, &legend, &(beyond + &rests_key(summary)), out)?;
        writeln!(out, "</div>")?;
    }
    writeln!(out, "</section>")
}

/// Legend of the commands' lines, where there are any.
fn command_key<const N: usize>(trace: &RunTrace<N>) -> Option<(Ink, String)> {
    let number = trace.commands.len();
    let words = if number > marks::COMMAND_MARKS_MAX {
        format!("command, the first {} of {number}", marks::COMMAND_MARKS_MAX)
    } else {
        "command".to_string()
    };
    (number > 0).then_some((palette::COMMAND, words))
}

/// Legend of the fault lines, where there are any.
fn fault_key<const N: usize>(trace: &RunTrace<N>) -> Vec<(Ink, String)> {
    if trace.faults.is_empty() { Vec::new() } else { vec![(palette::FAULT, "fault latched".to_string())] }
}

#[cfg(test)]
mod tests;
