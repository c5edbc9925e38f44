//! A page of figures: what came of an experiment in a sentence and in tables, and what its script draws.

use std::io::{self, Write};

use super::figure::Figure;
use super::format::escape;
use super::{page, tables};

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it should.
    Done,
    /// As it should, and something is left to do.
    Unfinished,
    /// Not as it should.
    Failed,
}

impl Verdict {
    fn class(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Unfinished => "unfinished",
            Self::Failed => "faulted",
        }
    }
}

/// Headings, words, tables and figures, in their order.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    title: String,
    html: String,
    has_section: bool,
    figures: Vec<Figure>,
}

impl Findings {
    /// Begins with a title, the machine, and how it ended: the beginning in bold, and the rest.
    pub(super) fn new(title: &str, machine: &str, verdict: Verdict, [bold, rest]: [&str; 2]) -> Self {
        let mut html = format!("<header><h1>{}</h1>\n", escape(title));
        if !machine.is_empty() {
            html += &format!("<p class=\"machine\">Machine: {}</p>\n", escape(machine));
        }
        let (class, bold, rest) = (verdict.class(), escape(bold), escape(rest));
        html += &format!("<p class=\"result {class}\"><strong>{bold}</strong> {rest}</p></header>\n");
        Self { title: title.to_owned(), html, ..Self::default() }
    }

    /// Only sections, for a page that has its own beginning.
    pub(super) fn part() -> Self {
        Self::default()
    }

    /// Begins a section.
    pub(super) fn section(&mut self, heading: &str) {
        self.end_section();
        self.has_section = true;
        self.html += &format!("<section class=\"figures-of\"><h2>{}</h2>\n", escape(heading));
    }

    fn end_section(&mut self) {
        if std::mem::take(&mut self.has_section) {
            self.html += "</section>\n";
        }
    }

    /// A paragraph; none for no words.
    pub(super) fn words(&mut self, words: &str) {
        if !words.is_empty() {
            self.html += &format!("<p>{}</p>\n", escape(words));
        }
    }

    /// A list of notes; nothing if there are none.
    pub(super) fn notes<'a>(&mut self, notes: impl Iterator<Item = &'a str>) {
        let items: String = notes.map(|note| format!("<li>{}</li>\n", escape(note))).collect();
        if !items.is_empty() {
            self.html += &format!("<ul class=\"notices\">\n{items}</ul>\n");
        }
    }

    /// A table whose first column names the row. Headings of words begin with a star, units stand in brackets.
    pub(super) fn table(&mut self, name: &str, headings: &[&str], rows: impl Iterator<Item = Vec<String>>) {
        self.html += &tables::of_rows(name, headings, rows);
    }

    /// Figures beside each other, where there is room.
    pub(super) fn figures(&mut self, figures: impl IntoIterator<Item = Figure>) {
        self.html += "<div class=\"drawings\">\n";
        for figure in figures {
            self.html += &format!("<div data-figure=\"{}\"></div>\n", self.figures.len());
            self.figures.push(figure);
        }
        self.html += "</div>\n";
    }

    /// A figure.
    pub(super) fn figure(&mut self, figure: impl Into<Figure>) {
        self.figures([figure.into()]);
    }

    /// The words, tables and places of figures, as HTML, and the figures.
    pub(super) fn parts(mut self) -> (String, Vec<Figure>) {
        self.end_section();
        (self.html, self.figures)
    }

    /// Writes the page.
    ///
    /// # Errors
    /// Whatever `out` reports.
    pub fn write(self, out: &mut impl Write) -> io::Result<()> {
        let title = format!("{} – motion report", self.title);
        let (html, figures) = self.parts();
        page::write_figures(&title, &html, &figures, out)
    }
}
