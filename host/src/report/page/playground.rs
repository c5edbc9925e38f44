//! The playground: the page with a program and a machine that are edited and run in it.

use std::io::{self, Write};

use flate2::Compression;
use serde::Serialize;

use super::{Module, Page, data, embed};

const STYLE: &str = include_str!("../../../page/playground.css");
const TOOLS: &str = include_str!("../../../page/playground.html");

/// What it has besides what all pages of runs have. The worker is imported by none: its text becomes a worker.
const PLAYGROUND: [Module; 4] = [
    ("page/worker.js", include_str!("../../../page/worker.js")),
    ("page/engine.js", include_str!("../../../page/engine.js")),
    ("page/sliders.js", include_str!("../../../page/sliders.js")),
    ("page/playground.js", include_str!("../../../page/playground.js")),
];

/// A text that is edited.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sheet<'a> {
    /// Its file.
    pub name: &'a str,
    /// The text.
    pub text: &'a str,
}

/// What the page begins with.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Playground<'a> {
    /// G-code.
    pub program: Sheet<'a>,
    /// A machine file.
    pub machine: Sheet<'a>,
}

impl Playground<'_> {
    /// Writes the page around a module, which `host/wasm/build` makes.
    ///
    /// # Errors
    /// Whatever `out` reports.
    pub fn write(&self, module: &[u8], out: &mut impl Write) -> io::Result<()> {
        let sheets = data::compressed(&[&serde_json::to_vec(self)?])?;
        let module = data::compressed_to(Compression::best(), &[module])?;
        let title = "motion playground";
        let tools = format!("<style>\n{STYLE}</style>\n{TOOLS}");
        let page = Page::of_runs(title, &PLAYGROUND, &tools);
        page.write(out, |out| {
            embed("sheets", &sheets, out)?;
            embed("module", &module, out)
        })
    }
}
