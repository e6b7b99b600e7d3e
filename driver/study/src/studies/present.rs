//! Building blocks of the studies' reports.

use super::super::report::number::human;
use super::super::report::{
    Block, Cell, Column, Panel, Plot, Point, Provenance, Report, Section, Series, Table, XAxis, XScale,
    YAxis, YScale,
};
use super::super::sample::Estimate;

/// Number of bytes of a gigabyte.
pub(super) const GIGA: f64 = 1e9;

/// Formats a number in a sentence with three significant digits.
pub(super) fn say(value: f64) -> String {
    human(value, 3)
}

/// Name of a scene in key figures: its file name without the extension.
pub(super) fn key(scene: &str) -> &str {
    scene.split('.').next().unwrap_or_default()
}

/// Cell with an estimate and its confidence interval, both divided by `unit`.
pub(super) fn cell(estimate: Estimate, unit: f64) -> Cell {
    let estimate = estimate.scaled(1.0 / unit);
    Cell::interval(estimate.value, estimate.half_width)
}

/// Cell with a number of bytes and its confidence interval, in gigabytes.
pub(super) fn gigabytes(estimate: Estimate) -> Cell {
    cell(estimate, GIGA)
}

/// Point of a plot at `x`: a number of bytes with its confidence interval, in gigabytes.
pub(super) fn gigabyte_point(x: f64, estimate: Estimate) -> Point {
    let estimate = estimate.scaled(1.0 / GIGA);
    Point::with_half_width(x, estimate.value, estimate.half_width)
}

pub(super) fn columns(heads: &[(&str, &str)]) -> Vec<Column> {
    heads.iter().map(|&(name, unit)| Column::new(name, unit)).collect()
}

/// Report without a banner and without provenance.
pub(super) fn page(title: &str, introduction: Vec<String>, sections: Vec<Section>) -> Report {
    Report {
        title: title.to_owned(),
        banner: None,
        introduction,
        sections,
        provenance: Provenance::default(),
        figures: Vec::new(),
    }
}

pub(super) fn section(heading: &str, blocks: Vec<Block>) -> Section {
    Section { heading: heading.to_owned(), blocks }
}

pub(super) fn text(text: impl Into<String>) -> Block {
    Block::Paragraph(text.into())
}

/// Block with a table that is stored in a file with this name.
pub(super) fn table(name: &str, table: Table) -> Block {
    Block::Table { name: name.to_owned(), table }
}

/// Block with a plot that is stored in a file with this name.
pub(super) fn plot(name: &str, title: &str, caption: &str, panels: Vec<Panel>) -> Block {
    let plot = Plot { title: title.to_owned(), caption: caption.to_owned(), panels, shares_y_range: true };
    Block::Plot { name: name.to_owned(), plot }
}

/// A pair of axes with its series. Each axis is given by label, unit and scale.
pub(super) fn panel(
    title: &str,
    (x_label, x_unit, x_scale): (&str, &str, XScale),
    (y_label, y_unit, y_scale): (&str, &str, YScale),
    series: Vec<Series>,
) -> Panel {
    Panel {
        title: title.to_owned(),
        x: XAxis { label: x_label.to_owned(), unit: x_unit.to_owned(), scale: x_scale },
        y: YAxis { label: y_label.to_owned(), unit: y_unit.to_owned(), scale: y_scale },
        series,
    }
}

pub(super) fn series(name: impl Into<String>, points: Vec<Point>) -> Series {
    Series { name: name.into(), points }
}

/// Paragraph that explains counting, for the introduction of every report.
pub(super) fn how_it_counts() -> String {
    "Raw bytes are what the chip asks of the photon map; bytes from DRAM are the lines that miss the cache, times a line's \
     bytes. Sampled tiles are rendered on an emulated chip whose caches are empty when a tile begins; each stands for \
     its share of all tiles, and ± is half the width of the 95 % confidence interval of their sum (Student's t over the \
     tiles, corrected for a finite population)."
        .to_owned()
}

/// Scenes of the studies, a simple, a glossy and a large one: file, and name in reports.
pub(super) const SCENES: [(&str, &str); 3] =
    [(CORNELL, "Cornell box"), (GLOSSY, "glossy Cornell box"), (ATRIUM, "atrium")];
pub(super) const CORNELL: &str = "cornell.gltf";
pub(super) const GLOSSY: &str = "cornell-glossy.gltf";
pub(super) const ATRIUM: &str = "atrium.glb";
