//! The pages: `host/page`, with the data of a run or the figures of an experiment in it, as one file.
//!
//! The page's modules import each other by names that an import map gives to their text, so the file works without a server.
//! What it says about the run in words and tables is made here, and is there without a script, too. The playground is the same
//! page with an editor, sliders and a module instead of data.

mod column;
mod data;
mod outline;
#[cfg(feature = "terminal")]
mod playground;
mod samples;
mod worst;

use std::io::{self, Write};

#[cfg(feature = "terminal")]
pub use self::playground::{Playground, Sheet};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::Serialize;

use super::figure::Figure;
use super::findings::Findings;
use super::format::escape;
use super::palette;
use super::summary::Summary;
use super::{file_name, program_name};
use crate::trace::RunTrace;

const INDEX: &str = include_str!("../../../page/index.html");
const WORKBENCH_SECTION: &str = include_str!("../../../page/workbench.html");
const STYLE: &str = include_str!("../../../page/style.css");

/// A module of a page: the name that others import it by, and its text.
type Module = (&'static str, &'static str);

/// What draws figures.
const FIGURES: [Module; 14] = [
    ("page/data.js", include_str!("../../../page/data.js")),
    ("page/work.js", include_str!("../../../page/work.js")),
    ("page/format.js", include_str!("../../../page/format.js")),
    ("page/theme.js", include_str!("../../../page/theme.js")),
    ("page/sorted.js", include_str!("../../../page/sorted.js")),
    ("page/sheet.js", include_str!("../../../page/sheet.js")),
    ("page/dom.js", include_str!("../../../page/dom.js")),
    ("page/figure.js", include_str!("../../../page/figure.js")),
    ("page/span.js", include_str!("../../../page/span.js")),
    ("page/axes.js", include_str!("../../../page/axes.js")),
    ("page/input.js", include_str!("../../../page/input.js")),
    ("page/stack.js", include_str!("../../../page/stack.js")),
    ("page/flat.js", include_str!("../../../page/flat.js")),
    ("page/figures.js", include_str!("../../../page/figures.js")),
];

/// What shows runs, besides.
const WORKBENCH: [Module; 14] = [
    ("page/pyramid.js", include_str!("../../../page/pyramid.js")),
    ("page/run.js", include_str!("../../../page/run.js")),
    ("page/state.js", include_str!("../../../page/state.js")),
    ("page/columns.js", include_str!("../../../page/columns.js")),
    ("page/plot.js", include_str!("../../../page/plot.js")),
    ("page/overview.js", include_str!("../../../page/overview.js")),
    ("page/plots.js", include_str!("../../../page/plots.js")),
    ("page/camera.js", include_str!("../../../page/camera.js")),
    ("page/colours.js", include_str!("../../../page/colours.js")),
    ("page/path-input.js", include_str!("../../../page/path-input.js")),
    ("page/path.js", include_str!("../../../page/path.js")),
    ("page/code.js", include_str!("../../../page/code.js")),
    ("page/tables.js", include_str!("../../../page/tables.js")),
    ("page/workbench.js", include_str!("../../../page/workbench.js")),
];

/// What starts a page of figures.
const FINDINGS: [Module; 1] = [("page/findings.js", include_str!("../../../page/findings.js"))];

/// What a report has, the last one to start it.
const REPORT: [Module; 2] = [
    ("page/source.js", include_str!("../../../page/source.js")),
    ("page/main.js", include_str!("../../../page/main.js")),
];

/// What the panel has.
const PANEL: [Module; 5] = [
    ("page/panel/link.js", include_str!("../../../page/panel/link.js")),
    ("page/panel/follow.js", include_str!("../../../page/panel/follow.js")),
    ("page/panel/display.js", include_str!("../../../page/panel/display.js")),
    ("page/panel/controls.js", include_str!("../../../page/panel/controls.js")),
    ("page/panel/main.js", include_str!("../../../page/panel/main.js")),
];
const PANEL_STYLE: &str = include_str!("../../../page/panel/panel.css");
const PANEL_CONTROLS: &str = include_str!("../../../page/panel/panel.html");

/// Size of a page: at least, at most, and for each second of the run \[bytes\].
const PAGE_LEAST: f64 = 2.7e6;
const PAGE_MOST: f64 = 11.7e6;
const PAGE_PER_S: f64 = 4_300.0;
/// What a page takes without data \[bytes\].
const PAGE_EMPTY: f64 = 0.2e6;
/// The part of the room that a run has at least, however long its program is.
const RUN_SHARE_LEAST: f64 = 0.25;

/// A run as a page shows it.
#[derive(Clone, Debug)]
pub struct PageRun {
    data: Vec<u8>,
    program: Option<Vec<u8>>,
}

#[derive(Serialize)]
struct ProgramJson<'run> {
    text: &'run str,
    times: Vec<(&'run str, f64)>,
}

impl PageRun {
    /// The data of a trace, in their own share of a page of the size that a run of this duration has.
    ///
    /// # Errors
    /// Writing into memory fails.
    pub fn of<const N: usize>(trace: &RunTrace<N>) -> io::Result<Self> {
        Self::with_summary(trace, &Summary::of(trace))
    }

    /// The bytes that a page's script inflates and reads.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The same of the program, where there is one.
    #[must_use]
    pub fn program(&self) -> Option<&[u8]> {
        self.program.as_deref()
    }

    pub(super) fn with_summary<const N: usize>(trace: &RunTrace<N>, summary: &Summary) -> io::Result<Self> {
        let program = trace.source.as_ref().map(|source| {
            let program = ProgramJson { text: &source.text, times: source.times.clone() };
            data::compressed(&[&serde_json::to_vec(&program)?])
        });
        let program = program.transpose()?;
        let page = (PAGE_PER_S * summary.executed_time_s).clamp(PAGE_LEAST, PAGE_MOST) - PAGE_EMPTY;
        // Four characters of text are three bytes.
        let room = 0.75 * page;
        let text = program.as_ref().map_or(0, Vec::len) as f64;
        let bytes_max = (room - text).max(RUN_SHARE_LEAST * room) as usize;
        Ok(Self { data: data::of_run(trace, summary, bytes_max)?, program })
    }
}

/// Writes the page of a run, `headline` first; with another run beside it, and findings below it, if there are such.
pub(super) fn write<const N: usize>(
    trace: &RunTrace<N>,
    summary: &Summary,
    headline: &str,
    against: Option<&PageRun>,
    below: Option<Findings>,
    out: &mut impl Write,
) -> io::Result<()> {
    let (below, figures) = below.map(Findings::parts).unwrap_or_default();
    let run = PageRun::with_summary(trace, summary)?;
    let title = format!("{} – motion report", file_name(program_name(trace)));
    let page = Page { headline, below: &below, ..Page::of_runs(&title, &REPORT, "") };
    page.write(out, |out| {
        embed_figures(&figures, out)?;
        for (role, run) in [("", Some(&run)), ("against-", against)] {
            let Some(run) = run else { continue };
            embed(&format!("{role}run"), &run.data, out)?;
            if let Some(program) = &run.program {
                embed(&format!("{role}program"), program, out)?;
            }
        }
        Ok(())
    })
}

/// Writes a page of figures: words and tables with the figures' places, and the figures.
pub(super) fn write_figures(
    title: &str,
    html: &str,
    figures: &[Figure],
    out: &mut impl Write,
) -> io::Result<()> {
    let page = Page { title, modules: &FINDINGS, has_runs: false, tools: "", headline: html, below: "" };
    page.write(out, |out| embed_figures(figures, out))
}

fn embed_figures(figures: &[Figure], out: &mut impl Write) -> io::Result<()> {
    if figures.is_empty() {
        return Ok(());
    }
    embed("figures", &data::compressed(&[&serde_json::to_vec(figures)?])?, out)
}

/// The panel's page, without data: it asks its server for them.
pub(super) fn panel() -> String {
    let tools = format!("<style>\n{PANEL_STYLE}</style>\n{PANEL_CONTROLS}");
    let page = Page::of_runs("motion panel", &PANEL, &tools);
    let mut written = Vec::new();
    page.write(&mut written, |_| Ok(())).expect("memory takes all");
    String::from_utf8(written).expect("all of it is text")
}

/// What differs from page to page.
struct Page<'a> {
    title: &'a str,
    /// Besides those of figures and of runs; the last one starts the page.
    modules: &'a [Module],
    /// Whether it shows runs.
    has_runs: bool,
    /// HTML above the headline.
    tools: &'a str,
    /// HTML.
    headline: &'a str,
    /// HTML below the run.
    below: &'a str,
}

impl<'a> Page<'a> {
    /// A page that shows runs.
    fn of_runs(title: &'a str, modules: &'a [Module], tools: &'a str) -> Self {
        Self { title, modules, has_runs: true, tools, headline: "", below: "" }
    }

    /// Writes the page, with what `data` embeds.
    fn write<W: Write>(&self, out: &mut W, data: impl Fn(&mut W) -> io::Result<()>) -> io::Result<()> {
        let mut rest = INDEX;
        // The template names what stands in its place.
        while let Some((before, after)) = rest.split_once("{{") {
            let (name, after) = after.split_once("}}").unwrap_or((after, ""));
            out.write_all(before.as_bytes())?;
            match name {
                "title" => out.write_all(escape(self.title).as_bytes())?,
                "style" => write!(out, "{STYLE}{}", palette::variables())?,
                "modules" => out.write_all(self.import_map().as_bytes())?,
                "tools" => out.write_all(self.tools.as_bytes())?,
                "workbench" if self.has_runs => out.write_all(WORKBENCH_SECTION.as_bytes())?,
                "workbench" => {}
                "below" => out.write_all(self.below.as_bytes())?,
                "headline" => out.write_all(self.headline.as_bytes())?,
                "start" => out.write_all(self.modules.last().map_or("", |(name, _)| name).as_bytes())?,
                _ => data(out)?,
            }
            rest = after;
        }
        out.write_all(rest.as_bytes())
    }

    /// Every module under its name, as an address that holds its text.
    fn import_map(&self) -> String {
        let of_runs: &[Module] = if self.has_runs { &WORKBENCH } else { &[] };
        let imports: serde_json::Map<String, serde_json::Value> = FIGURES
            .iter()
            .chain(of_runs)
            .chain(self.modules)
            .map(|(name, text)| {
                let address = format!("data:text/javascript;base64,{}", BASE64.encode(text));
                ((*name).to_owned(), address.into())
            })
            .collect();
        serde_json::json!({ "imports": imports }).to_string()
    }
}

fn embed(name: &str, bytes: &[u8], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "<script type=\"text/plain\" id=\"{name}\">{}</script>", BASE64.encode(bytes))
}

/// Pages, read as their script does.
#[cfg(test)]
pub(crate) mod reading {
    use std::io::Read as _;

    use flate2::read::ZlibDecoder;
    use serde_json::Value;

    use super::*;

    pub(crate) struct Read {
        pub(crate) header: Value,
        bytes: Vec<u8>,
    }

    fn inflated(bytes: &[u8]) -> Vec<u8> {
        let mut inflated = Vec::new();
        ZlibDecoder::new(bytes).read_to_end(&mut inflated).expect("a stream");
        inflated
    }

    impl Read {
        /// An embedded text, inflated.
        pub(crate) fn text(page: &str, name: &str) -> Vec<u8> {
            let start = format!("id=\"{name}\">");
            let text =
                page.split_once(&start).and_then(|(_, rest)| rest.split_once("</script>")).expect("data").0;
            inflated(&BASE64.decode(text).expect("base64"))
        }

        pub(crate) fn of(page: &str, name: &str) -> Self {
            Self::of_bytes(&Self::text(page, name))
        }

        /// What is not embedded.
        pub(crate) fn of_data(data: &[u8]) -> Self {
            Self::of_bytes(&inflated(data))
        }

        fn of_bytes(bytes: &[u8]) -> Self {
            let (length, rest) = bytes.split_first_chunk().expect("a length");
            let (header, bytes) = rest.split_at(u32::from_le_bytes(*length) as usize);
            Self { header: serde_json::from_slice(header).expect("JSON"), bytes: bytes.to_vec() }
        }

        /// A column's values, and its step. What has no value is not a number.
        pub(crate) fn column(&self, name: &str) -> (Vec<f64>, f64) {
            let columns = self.header["columns"].as_array().expect("a list");
            let column = columns.iter().find(|column| column["name"] == name).expect("a column");
            let step = column["step"].as_f64().expect("a number");
            let value = |number| {
                if number == i32::MAX || number == i32::MIN { f64::NAN } else { f64::from(number) * step }
            };
            (column::tests::read(&self.bytes, column).into_iter().map(value).collect(), step)
        }
    }
}
