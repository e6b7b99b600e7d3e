//! Reports of studies: tables, plots, and a page with all of them.
//!
//! [`write()`] stores a [`Report`] in a folder: the self-contained page `index.html`, every table as CSV, and
//! every plot as SVG.

mod figure;
mod html;
mod markup;
pub(crate) mod number;
mod plot;
mod table;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::{fs, io};

use thiserror::Error;

pub(crate) use self::figure::{FIGURES, figures_csv, is_portable, slug};
pub use self::figure::{Figure, NOT_REACHED};
pub use self::html::Provenance;
pub(crate) use self::html::{Block, Report, Section};
pub use self::number::human;
pub(crate) use self::plot::{Panel, Plot, Point, Series, XAxis, XScale, YAxis, YScale};
pub use self::table::Cell;
pub(crate) use self::table::{Column, Table};
use photoncard_picture::output::{self, OutputError};

const PAGE: &str = "index.html";

/// Error of writing a report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The name of a table or plot is not a portable file name.
    #[error(
        "'{name}' cannot name a table or plot; use up to 100 letters, digits, '-' and '.', the first and the last of them \
         no dot"
    )]
    BadName {
        /// Name of the table or plot.
        name: String,
    },
    /// Two tables or two plots have names that are equal or differ only in case.
    #[error(
        "two files of the report would be named {file}, in some case; give each table and each plot its own name"
    )]
    SameName {
        /// Name of the file.
        file: String,
    },
    /// The folder cannot be created.
    #[error("cannot create the folder {}; check the permissions of the folder that it is to be in", folder.display())]
    Folder {
        /// Path of the folder.
        folder: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Writes `report` into `folder`, which is created if it is missing: each table as `<name>.csv`, data as
/// `<name>.json` too, each plot as `<name>.svg`, and finally `index.html`. Existing files with these names
/// are replaced, each atomically; other files are left unchanged.
///
/// # Errors
/// If a name has other characters than letters, digits, `-` and `.`, or two files would have names that are
/// equal or differ only in case; nothing is written then. If the folder or a file cannot be written.
pub(crate) fn write(folder: &Path, report: &Report) -> Result<(), ReportError> {
    let blocks = || report.sections.iter().flat_map(|section| &section.blocks);
    for block in blocks() {
        if let Block::Table { name, .. } | Block::Data { name, .. } | Block::Plot { name, .. } = block
            && !is_portable(name)
        {
            return Err(ReportError::BadName { name: name.clone() });
        }
    }
    let files: Vec<_> = blocks().flat_map(Block::files).collect();
    let mut names = HashSet::new();
    for (file, _) in &files {
        if !names.insert(file.to_ascii_lowercase()) {
            return Err(ReportError::SameName { file: file.clone() });
        }
    }
    fs::create_dir_all(folder).map_err(|source| ReportError::Folder { folder: folder.to_owned(), source })?;
    for (file, content) in files {
        output::write(&folder.join(file), content.as_bytes())?;
    }
    output::write(&folder.join(PAGE), report.to_html().as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table =
            Table::new("Times <of> \"orders\"", vec![Column::new("order", ""), Column::new("time", "s")]);
        table.push(vec!["sort & <hash>".into(), Cell::interval(1.25, 0.125)]);
        table
    }

    fn plot() -> Plot {
        let series = Series { name: "<sort> & 'hash'".to_owned(), points: vec![Point::new(1.0, 2.0)] };
        Plot {
            title: "Time <plot>".to_owned(),
            caption: "Lower is \"better\" & <good>.".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: XAxis { label: "chips & cards".to_owned(), unit: String::new(), scale: XScale::Log2 },
                y: YAxis { label: "time".to_owned(), unit: "s".to_owned(), scale: YScale::LinearFromZero },
                series: vec![series],
            }],
            shares_y_range: false,
        }
    }

    fn report(blocks: Vec<Block>) -> Report {
        Report {
            title: "Orders <i>\"&\"</i>".to_owned(),
            banner: Some("A <trial>".to_owned()),
            introduction: vec!["Is a < b && c > d?".to_owned()],
            sections: vec![Section { heading: "Time & <space>".to_owned(), blocks }],
            provenance: Provenance {
                version: "photoncard 0.1.0".to_owned(),
                date: "2007-05-01".to_owned(),
                host: "a <host>".to_owned(),
                command_line: "photoncard study --out 'a & b'".to_owned(),
                settings: vec![("seed".to_owned(), "<0>".to_owned())],
            },
            figures: Vec::new(),
        }
    }

    fn whole() -> Report {
        report(vec![
            Block::Paragraph("A </p> paragraph.".to_owned()),
            Block::Table { name: "times".to_owned(), table: table() },
            Block::Plot { name: "times".to_owned(), plot: plot() },
        ])
    }

    #[test]
    fn a_report_folder_holds_the_page_and_the_files_that_it_links() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new/report");
        for _ in 0..2 {
            write(&folder, &whole()).unwrap();
        }
        let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
        assert_eq!(read("times.csv"), table().to_csv());
        assert_eq!(read("times.svg"), plot().to_svg());
        let page = read(PAGE);
        assert!(page.contains("href=\"times.csv\"") && page.contains("href=\"times.svg\""));
        assert!(page.contains(&plot().to_svg()) && page.contains(&table().to_html()));
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3);
    }

    #[test]
    fn the_page_is_well_formed_and_self_contained_and_keeps_its_text() {
        let page = whole().to_html();
        let elements = markup::reader::elements(&page);
        let texts: Vec<_> = elements.iter().map(|element| element.text.as_str()).collect();
        for text in [
            "Orders <i>\"&\"</i>",
            "A <trial>",
            "Is a < b && c > d?",
            "Time & <space>",
            "A </p> paragraph.",
            "Times <of> \"orders\"",
            "sort & <hash>",
            "Lower is \"better\" & <good>. ",
            "a <host>",
            "photoncard study --out 'a & b'",
            "<0>",
        ] {
            assert!(texts.contains(&text), "{text}: {texts:?}");
        }
        assert!(elements.iter().all(|element| !["script", "link", "img"].contains(&element.tag.as_str())));
        for element in &elements {
            assert!(element.get("src").is_none());
            let local = |target: &str| !target.contains(':') && !target.contains('/');
            assert!(element.get("href").is_none_or(local), "{element:?}");
        }
        assert!(!page.contains("url(") && !page.contains("@import"));
    }

    #[test]
    fn bad_and_equal_names_are_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let named = |name: &str| Block::Table { name: name.to_owned(), table: table() };
        for name in ["", "../escape", "a b", "<x>"] {
            let refused = write(folder.path(), &report(vec![named("good"), named(name)]));
            assert!(
                matches!(&refused, Err(ReportError::BadName { name: bad }) if bad == name),
                "{refused:?}"
            );
        }
        let refused = write(folder.path(), &report(vec![named("times"), named("Times")]));
        assert!(matches!(refused, Err(ReportError::SameName { .. })), "{refused:?}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
