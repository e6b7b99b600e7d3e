//! Tables: CSV and JSON for programs, HTML for people.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::markup::escape;
use super::number;

/// Number of significant digits of a measured value and of its half-width in HTML.
const DIGITS: usize = 4;
const HALF_WIDTH_DIGITS: usize = 2;
/// Maximum number of characters of a text that stays on one line in HTML.
const MAX_NAME: usize = 40;
/// HTML class of cells with numbers.
const NUMBER: &str = "number";

/// A titled table with one unit per column.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    title: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
    /// Columns that only files have, with the cell of each row.
    of_files: Vec<(Column, Vec<Cell>)>,
}

/// Head of a column.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Column {
    /// Name of the quantity.
    pub(crate) name: String,
    /// Unit of the quantity; empty if it has none.
    pub(crate) unit: String,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Cell without a value.
    Empty,
    /// Text.
    Text(String),
    /// A count or a setting, shown with all its digits.
    Integer(i128),
    /// A measured value, shown with four significant digits.
    Real {
        /// Value in the column's unit.
        value: f64,
        /// Half-width of the confidence interval, in the column's unit.
        half_width: Option<f64>,
    },
}

impl Column {
    /// Creates the head of a column with a name and a unit.
    pub(crate) fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into() }
    }
}

impl Cell {
    /// Cell with a measured value and the half-width of its confidence interval, both in the column's unit.
    pub(crate) fn interval(value: f64, half_width: f64) -> Self {
        Self::Real { value, half_width: Some(half_width) }
    }

    fn half_width(&self) -> Option<f64> {
        match self {
            Self::Real { half_width, .. } => *half_width,
            _ => None,
        }
    }

    fn is_text(&self) -> bool {
        matches!(self, Self::Text(_))
    }

    /// HTML class of the cell. Numbers and names stay on one line.
    fn class(&self) -> &'static str {
        match self {
            Self::Text(text) if text.chars().count() > MAX_NAME => "text",
            Self::Text(_) => "name",
            _ => NUMBER,
        }
    }

    /// Text of the cell in CSV, before quoting. Numbers are in full precision.
    pub fn csv(&self) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Text(text) => text.clone(),
            Self::Integer(value) => value.to_string(),
            Self::Real { value, .. } => number::full(*value),
        }
    }

    /// Value of the cell in JSON, without its half-width.
    fn json(&self) -> Value {
        match self {
            Self::Empty => Value::Null,
            Self::Text(text) => json!(text),
            Self::Integer(value) => {
                i64::try_from(*value).map_or_else(|_| json!(value.to_string()), Value::from)
            }
            Self::Real { value, .. } => json!(value),
        }
    }

    fn html(&self) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Text(text) => escape(text),
            Self::Integer(value) => number::grouped(&value.to_string()),
            Self::Real { value, half_width: None } => number::human(*value, DIGITS),
            Self::Real { value, half_width: Some(half_width) } => {
                let half_width = number::human(*half_width, HALF_WIDTH_DIGITS);
                format!("{} ± {half_width}", number::human(*value, DIGITS))
            }
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Real { value, half_width: None }
    }
}

macro_rules! from_integer {
    ($($integer:ty),*) => {$(
        impl From<$integer> for Cell {
            fn from(value: $integer) -> Self {
                Self::Integer(value as i128)
            }
        }
    )*};
}

from_integer!(u8, u16, u32, u64, usize, i32, i64);

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

impl Table {
    /// Creates a table without rows.
    pub(crate) fn new(title: impl Into<String>, columns: Vec<Column>) -> Self {
        Self { title: title.into(), columns, rows: Vec::new(), of_files: Vec::new() }
    }

    /// Adds a column that files have and pages do not.
    ///
    /// # Panics
    /// If there is not one cell per row.
    pub(crate) fn add_to_files(&mut self, column: Column, cells: Vec<Cell>) {
        assert_eq!(cells.len(), self.rows.len(), "a column of the table '{}'", self.title);
        self.of_files.push((column, cells));
    }

    /// Returns whether columns make each row of a file complete without the page. Such a table has a JSON
    /// file as well.
    pub(crate) fn is_data(&self) -> bool {
        !self.of_files.is_empty()
    }

    /// Adds a row at the end.
    ///
    /// # Panics
    /// If the row does not have one cell per column.
    pub(crate) fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "a row of the table '{}'", self.title);
        self.rows.push(row);
    }

    pub(crate) fn title(&self) -> &str {
        &self.title
    }

    /// Encodes the table as CSV (RFC 4180), with `name (unit)` of each column in the header, and numbers in
    /// full precision.
    ///
    /// A column with half-widths is followed by a column of the half-widths. Values that are not finite are
    /// written `NaN`, `inf` and `-inf`.
    pub(crate) fn to_csv(&self) -> String {
        let mut records = vec![self.header()];
        records.extend(self.records().map(|record| record.iter().map(Cell::csv).collect()));
        csv_of(&records).unwrap_or_default()
    }

    /// Encodes the rows of [`Self::to_csv`] as a JSON array of objects. A key is the head of a column.
    /// Numbers are numbers; cells without a value, and values that are not finite, are `null`.
    pub(crate) fn to_json(&self) -> String {
        let header = self.header();
        let object = |record: Vec<Cell>| -> Map<String, Value> {
            header.iter().cloned().zip(record.iter().map(Cell::json)).collect()
        };
        let rows: Vec<_> = self.records().map(object).collect();
        format!("{:#}\n", json!(rows))
    }

    /// Heads of the columns of a file: `name (unit)`.
    fn header(&self) -> Vec<String> {
        let mut header = Vec::new();
        for (index, Column { name, unit }) in self.columns.iter().enumerate() {
            let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
            header.push(format!("{name}{unit}"));
            if self.has_half_width(index) {
                header.push(format!("{name} half-width{unit}"));
            }
        }
        header.extend(self.of_files.iter().map(|(column, _)| column.name.clone()));
        header
    }

    /// Cells of each row of a file, of which each has one value.
    fn records(&self) -> impl Iterator<Item = Vec<Cell>> {
        let with_half_width: Vec<bool> =
            (0..self.columns.len()).map(|column| self.has_half_width(column)).collect();
        self.rows.iter().enumerate().map(move |(index, row)| {
            let mut record = Vec::new();
            for (cell, with_half_width) in row.iter().zip(&with_half_width) {
                record.push(cell.clone());
                if *with_half_width {
                    record.push(cell.half_width().into());
                }
            }
            record.extend(self.of_files.iter().map(|(_, cells)| cells[index].clone()));
            record
        })
    }

    /// Encodes the table as an HTML element `table`, without its title. Integers are written in full, other
    /// numbers with four significant digits.
    pub(crate) fn to_html(&self) -> String {
        let mut html = "<table>\n<thead><tr>".to_owned();
        for (index, column) in self.columns.iter().enumerate() {
            let unit = match column.unit.as_str() {
                "" => String::new(),
                unit => format!(" <span class=\"unit\">({})</span>", escape(unit)),
            };
            let class = if self.is_numeric(index) { format!(" class=\"{NUMBER}\"") } else { String::new() };
            let _ = write!(html, "<th scope=\"col\"{class}>{}{unit}</th>", escape(&column.name));
        }
        html.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            html.push_str("<tr>");
            for cell in row {
                let _ = write!(html, "<td class=\"{}\">{}</td>", cell.class(), cell.html());
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody>\n</table>\n");
        html
    }

    fn has_half_width(&self, column: usize) -> bool {
        self.rows.iter().any(|row| row[column].half_width().is_some())
    }

    fn is_numeric(&self, column: usize) -> bool {
        !self.rows.is_empty() && self.rows.iter().all(|row| !row[column].is_text())
    }
}

/// Encodes records as CSV. Writing to memory does not fail, and all records have equal lengths, so that the
/// result is never `None`.
fn csv_of(records: &[Vec<String>]) -> Option<String> {
    let mut csv = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
    records.iter().try_for_each(|record| csv.write_record(record)).ok()?;
    String::from_utf8(csv.into_inner().ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::super::markup::reader;
    use super::*;

    fn parse(text: &str) -> Vec<Vec<String>> {
        let records =
            csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes()).into_records();
        records.map(|record| record.unwrap().iter().map(str::to_owned).collect()).collect()
    }

    fn nasty() -> Table {
        let mut table = Table::new(
            "Nasty",
            vec![Column::new("name, \"quoted\"", ""), Column::new("traffic", "GB/s"), Column::new("n", "")],
        );
        table.push(vec![
            "a\r\nb \"c\", <d> & 'e'".into(),
            Cell::interval(1.0 / 3.0, 0.0125),
            12_345_678_u64.into(),
        ]);
        table.push(vec![" padded ".into(), f64::NAN.into(), (-7_i64).into()]);
        table.push(vec![Cell::Empty, 1234.5678.into(), Cell::Empty]);
        table
    }

    #[test]
    fn csv_is_read_back_unchanged() {
        let records = parse(&nasty().to_csv());
        assert_eq!(records[0], ["name, \"quoted\"", "traffic (GB/s)", "traffic half-width (GB/s)", "n"]);
        assert_eq!(records[1][0], "a\r\nb \"c\", <d> & 'e'");
        assert_eq!(records[1][1].parse::<f64>().unwrap(), 1.0 / 3.0);
        assert_eq!(records[1][2..], ["0.0125", "12345678"]);
        assert_eq!(records[2], [" padded ", "NaN", "", "-7"]);
        assert_eq!(records[3], ["", "1234.5678", "", ""]);
        assert_eq!(records.len(), 4);
    }

    #[test]
    fn a_row_with_one_empty_cell_is_a_csv_record() {
        let mut table = Table::new("", vec![Column::new("only", "")]);
        table.push(vec![Cell::Empty]);
        assert_eq!(parse(&table.to_csv()), [["only"], [""]]);
    }

    #[test]
    fn json_has_the_rows_of_the_csv() {
        let mut table = nasty();
        table.add_to_files(Column::new("seed", ""), vec![1.into(), 2.into(), Cell::Empty]);
        let records = parse(&table.to_csv());
        let rows: Vec<Map<String, Value>> = serde_json::from_str(&table.to_json()).unwrap();
        assert_eq!(rows.len() + 1, records.len());
        for (row, record) in rows.iter().zip(&records[1..]) {
            assert_eq!(row.len(), record.len());
            for (name, text) in records[0].iter().zip(record) {
                match &row[name] {
                    Value::Null => assert!(text.is_empty() || text == "NaN", "{name}: {text}"),
                    Value::String(value) => assert_eq!(value, text),
                    number => assert_eq!(number.as_f64(), text.parse().ok(), "{name}"),
                }
            }
        }
        assert_eq!(rows[1]["seed"], json!(2));
        assert!(!table.to_html().contains("seed") && table.is_data() && !nasty().is_data());
    }

    #[test]
    fn html_has_rounded_numbers_with_units_and_escaped_text() {
        let html = nasty().to_html();
        let elements = reader::elements(&html);
        let cells: Vec<_> = elements.iter().filter(|element| element.tag == "td").collect();
        assert_eq!(cells[0].text, "a\r\nb \"c\", <d> & 'e'");
        assert_eq!((cells[1].text.as_str(), cells[1].get("class")), ("0.3333 ± 0.013", Some("number")));
        assert_eq!(cells[0].get("class"), Some("name"));
        assert_eq!(cells[2].text, "12,345,678");
        assert_eq!(cells[4].text, "n/a");
        assert_eq!(cells[5].text, "−7");
        assert_eq!(cells[7].text, "1,235");
        assert!(html.contains("traffic <span class=\"unit\">(GB/s)</span>"));
    }

    #[test]
    #[should_panic(expected = "a row of the table 'Nasty'")]
    fn a_row_has_a_cell_for_every_column() {
        nasty().push(vec![Cell::Empty]);
    }
}
