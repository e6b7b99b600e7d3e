//! Reports as HTML: one page with the results, and with the versions and settings that reproduce them.

use std::fmt::Write;

use super::figure::Figure;
use super::markup::escape;
use super::plot::Plot;
use super::table::{Column, Table};

const STYLE: &str = include_str!("style.css");

/// A report on a study.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Title of the page.
    pub(crate) title: String,
    /// Warning at the top of the page, if any.
    pub(crate) banner: Option<String>,
    /// Paragraphs before the first section.
    pub(crate) introduction: Vec<String>,
    /// Sections in reading order.
    pub(crate) sections: Vec<Section>,
    /// Provenance of the numbers.
    pub(crate) provenance: Provenance,
    /// Key figures. They are not on the page.
    pub(crate) figures: Vec<Figure>,
}

/// A part of a report under one heading.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Section {
    pub(crate) heading: String,
    /// Blocks in reading order.
    pub(crate) blocks: Vec<Block>,
}

/// A part of a section.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Block {
    /// Plain text.
    Paragraph(String),
    /// A link to a page in this folder or a folder below.
    Link {
        text: String,
        /// Path of the linked page, relative to this one.
        target: String,
    },
    /// A table. It is also stored in the file `<name>.csv` beside the page, and in `<name>.json` if it is
    /// [data](Table::is_data).
    Table {
        /// Name of the file without its extension.
        name: String,
        table: Table,
    },
    /// A table of files alone, to which the page links.
    Data {
        /// Name of the files without their extensions.
        name: String,
        table: Table,
    },
    /// A plot. It is also stored in the file `<name>.svg` beside the page.
    Plot {
        /// Name of the file without its extension.
        name: String,
        plot: Plot,
    },
}

/// Provenance of a report's numbers: program, date, machine, command line and settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Name and version of the program.
    pub version: String,
    /// Date of the study, `YYYY-MM-DD`.
    pub date: String,
    /// Processor and operating system.
    pub host: String,
    /// Command line of the study.
    pub command_line: String,
    /// Names and values of all settings.
    pub settings: Vec<(String, String)>,
}

impl Report {
    /// Adds `banner` to the report, and `Trial: ` to the title of each plot. The titles are marked too,
    /// because the files of plots can be used without the page.
    #[must_use]
    pub(crate) fn marked(mut self, banner: String) -> Self {
        self.banner = Some(banner);
        for block in self.sections.iter_mut().flat_map(|section| &mut section.blocks) {
            if let Block::Plot { plot, .. } = block {
                plot.title.insert_str(0, "Trial: ");
            }
        }
        self
    }

    /// Encodes the report as a self-contained HTML page with links to the tables and plots beside it. The
    /// page is also well-formed XML.
    pub(crate) fn to_html(&self) -> String {
        let title = escape(&self.title);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n"
        );
        if let Some(banner) = &self.banner {
            let _ = writeln!(html, "<p class=\"banner\" role=\"note\">{}</p>", escape(banner));
        }
        for text in &self.introduction {
            html += &paragraph(text);
        }
        for section in &self.sections {
            let _ = write!(html, "<section>\n<h2>{}</h2>\n", escape(&section.heading));
            for block in &section.blocks {
                html += &block.to_html();
            }
            html += "</section>\n";
        }
        html += &self.provenance.to_html();
        html + "</main>\n</body>\n</html>\n"
    }
}

impl Block {
    /// Names and contents of the block's files beside the page.
    pub(super) fn files(&self) -> Vec<(String, String)> {
        match self {
            Self::Paragraph(_) | Self::Link { .. } => Vec::new(),
            Self::Table { name, table } | Self::Data { name, table } => {
                let json = table.is_data().then(|| (format!("{name}.json"), table.to_json()));
                std::iter::once((format!("{name}.csv"), table.to_csv())).chain(json).collect()
            }
            Self::Plot { name, plot } => vec![(format!("{name}.svg"), plot.to_svg())],
        }
    }

    fn to_html(&self) -> String {
        match self {
            Self::Paragraph(text) => paragraph(text),
            Self::Link { text, target } => {
                format!("<p><a href=\"{}\">{}</a></p>\n", escape(target), escape(text))
            }
            Self::Data { name, table } => format!("<p>{}</p>\n", caption(name, table)),
            Self::Table { name, table } => {
                format!(
                    "<figure>\n<figcaption>{}</figcaption>\n{}</figure>\n",
                    caption(name, table),
                    scrolling("table", table.title(), &table.to_html())
                )
            }
            Self::Plot { name, plot } => {
                let caption = format!("{} {}", escape(&plot.caption), link(name, "svg"));
                format!(
                    "<figure>\n{}<figcaption>{caption}</figcaption>\n</figure>\n",
                    scrolling("plot", &plot.title, &sized(plot))
                )
            }
        }
    }
}

impl Provenance {
    fn to_html(&self) -> String {
        let mut html = "<section>\n<h2>Provenance</h2>\n<dl>\n".to_owned();
        for (term, text) in [("Program", &self.version), ("Date", &self.date), ("Host", &self.host)] {
            let _ = writeln!(html, "<dt>{term}</dt><dd>{}</dd>", escape(text));
        }
        let command = format!("<pre><code>{}</code></pre>\n", escape(&self.command_line));
        let _ = writeln!(
            html,
            "<dt>Command line</dt><dd>{}</dd>\n</dl>",
            scrolling("", "Command line", &command)
        );
        if !self.settings.is_empty() {
            let mut settings =
                Table::new("Settings", vec![Column::new("setting", ""), Column::new("value", "")]);
            for (name, value) in &self.settings {
                settings.push(vec![name.as_str().into(), value.as_str().into()]);
            }
            html += &scrolling("table", settings.title(), &settings.to_html());
        }
        html + "</section>\n"
    }
}

fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escape(text))
}

/// Title of a table, with links to its files.
fn caption(name: &str, table: &Table) -> String {
    let json = if table.is_data() { format!(" {}", link(name, "json")) } else { String::new() };
    format!("<strong>{}</strong> {}{json}", escape(table.title()), link(name, "csv"))
}

fn link(name: &str, extension: &str) -> String {
    let file = escape(&format!("{name}.{extension}"));
    format!("<a href=\"{file}\" download=\"{file}\">{file}</a>")
}

/// HTML of a plot that shrinks with the page, but not below the size at which its text is legible.
fn sized(plot: &Plot) -> String {
    format!("<div style=\"--panels: {}\">\n{}</div>\n", plot.panels.len().max(1), plot.to_svg())
}

/// HTML of a box that scrolls if its content is wider than the page.
fn scrolling(class: &str, label: &str, content: &str) -> String {
    format!(
        "<div class=\"scroll {class}\" role=\"region\" aria-label=\"{}\" tabindex=\"0\">\n{content}</div>\n",
        escape(label)
    )
}
