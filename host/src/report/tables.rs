//! The tables: key figures, axes, faults, commands.

use std::fmt::Write as _;

use super::command_word;
use super::format::{count, counted, duration, escape, figure, fixed, share};
use super::summary::{Span, Summary};
use crate::axis_unit::AxisUnit;
use crate::trace::RunTrace;

/// Rows of a table on the page; the rest is in the trace file.
pub(super) const ROWS_MAX: usize = 200;

/// The remark about rows that did not fit into a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LeftOut {
    /// How many rows the table would have.
    pub(super) total: usize,
    /// How many of them are not shown.
    pub(super) rows: usize,
}

impl LeftOut {
    /// `None` if `total` rows fit.
    fn of(total: usize) -> Option<Self> {
        (total > ROWS_MAX).then(|| Self { total, rows: total - ROWS_MAX })
    }

    fn remark(self) -> String {
        let total = count(self.total as u64);
        format!("<p class=\"remark\">{} of {total} rows left out.</p>\n", count(self.rows as u64))
    }
}

/// A table that scrolls by itself where the page is too narrow for it.
fn wrapped(name: &str, head: &[&str], body: &str) -> String {
    let mut table = format!(
        "<div class=\"scroll\" role=\"region\" aria-label=\"{name}\" tabindex=\"0\"><table>\
         <caption class=\"unseen\">{name}</caption><thead><tr>"
    );
    for cell in head {
        // Columns of words are marked with a star and aligned to the left like their cells.
        let (cell, class) = cell.strip_prefix('*').map_or((*cell, ""), |word| (word, " class=\"word\""));
        // The unit goes below the word, so that columns stay narrow.
        let (word, unit) = cell.split_once(" [").unwrap_or((cell, ""));
        let unit = unit.trim_end_matches(']');
        if unit.is_empty() {
            let _ = write!(table, "<th scope=\"col\"{class}>{word}</th>");
        } else {
            let _ = write!(table, "<th scope=\"col\"{class}>{word} <span class=\"unit\">{unit}</span></th>");
        }
    }
    let _ = writeln!(table, "</tr></thead><tbody>\n{body}</tbody></table></div>");
    table
}

/// A table whose first column names the row. Headings and cells are words of anyone's.
pub(super) fn of_rows(name: &str, headings: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let escaped: Vec<String> = headings.iter().map(|heading| escape(heading)).collect();
    let head: Vec<&str> = escaped.iter().map(String::as_str).collect();
    let mut body = String::new();
    for row in rows {
        body.push_str("<tr>");
        for (index, cell) in row.iter().enumerate() {
            let cell = escape(cell);
            let _ = match headings.get(index) {
                _ if index == 0 => write!(body, "<th scope=\"row\">{cell}</th>"),
                Some(heading) if heading.starts_with('*') => {
                    write!(body, "<td class=\"word long\">{cell}</td>")
                }
                _ => write!(body, "<td>{cell}</td>"),
            };
        }
        body.push_str("</tr>\n");
    }
    wrapped(&escape(name), &head, &body)
}

/// Blocks at whose end the machine stands.
pub(super) fn full_stops<const N: usize>(trace: &RunTrace<N>) -> usize {
    trace.blocks.iter().filter(|block| block.exit_mm_s <= 0.0).count()
}

/// Figures of the whole run, as terms and values.
pub(super) fn key_figures<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> String {
    let feed = summary.feed_mm_s.magnitude();
    let path = if summary.path_done_mm < summary.path_length_mm - 1e-3 {
        format!("{} of {} mm", figure(summary.path_done_mm, 6), figure(summary.path_length_mm, 6))
    } else {
        format!("{} mm", figure(summary.path_length_mm, 6))
    };
    // What a quantity came to, and how much of what is allowed that is.
    let of_limit = |span: Span, limit: f64, unit: &str| {
        let share = share(span.magnitude(), limit);
        let share = share.map_or(String::new(), |share| format!("<small>{share} of the limit</small>"));
        format!("{} {unit}{share}", figure(span.magnitude(), 4))
    };
    let limits = &trace.limits;
    let mut rows = vec![
        ("Path length", path),
        (
            "Executed time",
            if trace.blocks.is_empty() {
                duration(summary.executed_time_s)
            } else {
                let planned = duration(trace.planned_time_s);
                format!("{}<small>planned {planned}</small>", duration(summary.executed_time_s))
            },
        ),
        ("Ticks", format!("{} of {} ms", count(trace.ticks.len() as u64), figure(trace.tick_s * 1e3, 4))),
        (
            "Blocks",
            format!(
                "{}<small>{}</small>",
                count(trace.blocks.len() as u64),
                counted(full_stops(trace), "full stop", "full stops")
            ),
        ),
        ("Highest feed", format!("{} mm/s<small>{} mm/min</small>", figure(feed, 4), figure(feed * 60.0, 4))),
        ("Highest acceleration", of_limit(summary.accel_mm_s2, limits.accel_mm_s2, "mm/s²")),
        ("Highest jerk", of_limit(summary.jerk_mm_s3, limits.jerk_mm_s3, "mm/s³")),
        ("Highest snap", of_limit(summary.snap_mm_s4, limits.snap_mm_s4, "mm/s⁴")),
    ];
    if !summary.contour_um.is_empty() {
        rows.push(("Highest contour error", format!("{} µm", figure(summary.contour_um.magnitude(), 3))));
    }
    let dwells = || summary.rests.iter().filter(|rest| rest.state == "dwell");
    if dwells().next().is_some() {
        let time_s = dwells().map(|rest| rest.to_s - rest.from_s).sum();
        let number = counted(dwells().count(), "dwell", "dwells");
        rows.push(("Dwells", format!("{}<small>{number}</small>", duration(time_s))));
    }
    if trace.blocks.is_empty() {
        // There is no plan to tell of.
        rows.retain(|(term, _)| !["Path length", "Blocks"].contains(term));
    }
    let mut list = String::from("<dl class=\"figures\">\n");
    for (term, value) in rows {
        let _ = writeln!(list, "<div><dt>{term}</dt><dd>{value}</dd></div>");
    }
    list.push_str("</dl>\n");
    list
}

/// A row per axis: a table of the linear ones, and one of the rotary ones.
pub(super) fn axes<const N: usize>(trace: &RunTrace<N>, summary: &Summary, names: &[String]) -> String {
    let of_unit = |unit: AxisUnit, name: &str| {
        let mut body = String::new();
        let axes = trace.axes.iter().zip(&summary.axes).zip(names);
        for ((of_run, axis), name) in axes.filter(|((of_run, _), _)| of_run.unit() == unit) {
            let _ = writeln!(
                body,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                escape(name),
                fixed(axis.err_um.magnitude(), 2),
                fixed(axis.err_um_rms, 2),
                fixed(of_run.end_error_counts as f64, 0),
                fixed(axis.out_v.magnitude(), 3),
                fixed(axis.vel_mm_s.magnitude(), 2),
                fixed(axis.set_mm.low, 4),
                fixed(axis.set_mm.high, 4),
            );
        }
        let (symbol, thousandth) = (unit.symbol(), unit.thousandth_symbol());
        let head = [
            "*Axis",
            &format!("Error max [{thousandth}]"),
            &format!("Error rms [{thousandth}]"),
            "End error [counts]",
            "Output max [V]",
            &format!("Speed max [{symbol}/s]"),
            &format!("Lowest [{symbol}]"),
            &format!("Highest [{symbol}]"),
        ];
        if body.is_empty() { String::new() } else { wrapped(name, &head, &body) }
    };
    format!(
        "<p>Error is the following error, set minus actual position; end error is what is left of it once the axes have settled.</p>\n{}{}",
        of_unit(AxisUnit::Millimetre, "Axes"),
        of_unit(AxisUnit::Degree, "Rotary axes"),
    )
}

/// A row per fault; nothing if there was none.
pub(super) fn faults<const N: usize>(trace: &RunTrace<N>) -> String {
    if trace.faults.is_empty() {
        return String::new();
    }
    let mut body = String::new();
    for fault in trace.faults.iter().take(ROWS_MAX) {
        let _ = writeln!(
            body,
            "<tr><td>{}</td><td>{:.4}</td><td class=\"word\">{}</td><td class=\"word\">{}</td><td class=\"word long\">{}</td></tr>",
            fault.tick,
            fault.tick as f64 * trace.tick_s,
            fault.axis.as_deref().map_or("–".to_string(), escape),
            escape(&fault.fault),
            escape(&fault.detail),
        );
    }
    let left_out = LeftOut::of(trace.faults.len()).map_or(String::new(), LeftOut::remark);
    let mut table = String::from("<h2>Faults</h2>\n");
    table.push_str(&wrapped("Faults", &["Tick", "Time [s]", "*Axis", "*Fault", "*Detail"], &body));
    table + &left_out
}

/// A row per command; nothing if there was none.
pub(super) fn commands<const N: usize>(trace: &RunTrace<N>) -> String {
    if trace.commands.is_empty() {
        return String::new();
    }
    let mut body = String::new();
    for command in trace.commands.iter().take(ROWS_MAX) {
        let stop = command.stop.as_ref().map_or_else(
            || "<td>–</td>".repeat(3),
            |stop| {
                let (time, length) = (fixed(stop.time_s * 1e3, 1), fixed(stop.length_mm, 3));
                format!("<td>{}</td><td>{time}</td><td>{length}</td>", stop.tick)
            },
        );
        let _ = writeln!(
            body,
            "<tr><td>{}</td><td>{:.4}</td><td class=\"word\">{}</td><td>{}</td>{stop}</tr>",
            command.tick,
            command.tick as f64 * trace.tick_s,
            escape(&command_word(command)),
            fixed(command.s_mm, 3),
        );
    }
    let left_out = LeftOut::of(trace.commands.len()).map_or(String::new(), LeftOut::remark);
    let head = [
        "Before tick",
        "Time [s]",
        "*Command",
        "Path position [mm]",
        "At rest in tick",
        "Stop time [ms]",
        "Stop length [mm]",
    ];
    let mut table = String::from("<h2>Commands</h2>\n");
    table.push_str(&wrapped("Commands", &head, &body));
    let is_above = |share: Option<f64>| share.is_some_and(|share| share > 1.0);
    let remark = if trace.commands.iter().any(|command| is_above(command.feed_override)) {
        "<p class=\"remark\">Under an override above 100 % the feed may pass a programmed ceiling, and no other.</p>\n"
    } else {
        ""
    };
    table + &left_out + remark
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_does_not_fit_is_left_out() {
        assert_eq!(LeftOut::of(ROWS_MAX), None);
        assert_eq!(LeftOut::of(ROWS_MAX + 5), Some(LeftOut { total: ROWS_MAX + 5, rows: 5 }));
    }
}
