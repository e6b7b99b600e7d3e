//! Legend of a plot. It is below the panels, so that it never covers data.

use super::style::Style;
use super::svg::{self, Anchor};
use super::text;

/// Width of a line's sample in the legend, in pixels.
const SAMPLE: f64 = 46.0;
const GAP: f64 = 8.0;
/// Space between columns, in pixels.
const COLUMN_GAP: f64 = 22.0;
const PADDING: f64 = 8.0;
/// Minimum distance between rows, in pixels.
const ROW: f64 = 20.0;

/// A laid-out legend: samples of lines, and names of series, in columns of equal width.
pub(super) struct Legend {
    /// Index and wrapped name of each series that has a name.
    entries: Vec<(usize, Vec<String>)>,
    columns: usize,
    column_width: f64,
}

impl Legend {
    /// Lays out the series that have names, within a width of `room` pixels.
    pub(super) fn new(names: &[&str], room: f64) -> Self {
        let name_room = room - SAMPLE - GAP;
        let entries: Vec<_> = names
            .iter()
            .enumerate()
            .map(|(index, name)| (index, text::wrap(name, text::LABEL, name_room)))
            .filter(|(_, lines)| !lines.is_empty())
            .collect();
        let lines = entries.iter().flat_map(|(_, lines)| lines);
        let widest = lines.map(|line| text::width(line, text::LABEL)).fold(0.0, f64::max);
        let column_width = SAMPLE + GAP + widest;
        let columns = ((room + COLUMN_GAP) / (column_width + COLUMN_GAP)).floor().max(1.0) as usize;
        Self { entries, columns, column_width }
    }

    /// Height of the legend, in pixels.
    pub(super) fn height(&self) -> f64 {
        let padding = if self.entries.is_empty() { 0.0 } else { 2.0 * PADDING };
        self.rows().map(row_height).sum::<f64>() + padding
    }

    /// SVG of the legend with its upper left corner at `[left, top]`.
    pub(super) fn draw(&self, [left, top]: [f64; 2]) -> String {
        let mut drawn = String::new();
        let mut row_top = top + PADDING;
        for row in self.rows() {
            for (column, (index, lines)) in row.iter().enumerate() {
                let x = left + column as f64 * (self.column_width + COLUMN_GAP);
                let style = Style::of(*index);
                let y = row_top + 0.62 * text::LABEL;
                drawn += "<g class=\"legend\">\n";
                drawn += &style.line(&[[x, y], [x + SAMPLE, y]], 1.75);
                drawn += &style.marker(x + 0.5 * SAMPLE, y);
                drawn += &svg::lines("name", lines, [x + SAMPLE + GAP, row_top], text::LABEL, Anchor::Start);
                drawn += "</g>\n";
            }
            row_top += row_height(row);
        }
        drawn
    }

    fn rows(&self) -> impl Iterator<Item = &[(usize, Vec<String>)]> {
        self.entries.chunks(self.columns)
    }
}

fn row_height(row: &[(usize, Vec<String>)]) -> f64 {
    let lines = row.iter().map(|(_, lines)| lines.len()).max().unwrap_or(0);
    (text::height(lines, text::LABEL) + 3.0).max(ROW)
}
