//! Key figures of studies, for documents and programs: a CSV file with one line per figure.

use super::table::{Cell, Column, Table};

/// Name of the file with the key figures of a run.
pub(crate) const FIGURES: &str = "figures.csv";

/// Value of a figure of a quality that a technique does not reach.
pub const NOT_REACHED: &str = "not reached";

/// A key figure of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of the quantity, such as `check.bytes.photon-map.sort`: levels are joined by dots, words by
    /// hyphens. No two figures of a run have the same name and the same [`Self::scene`].
    pub name: String,
    /// Name of the scene; empty if the figure belongs to no scene.
    pub scene: String,
    /// Value of the figure: a number or a text.
    pub value: Cell,
    /// Unit of the number; empty if it has none.
    pub unit: &'static str,
    /// Ends of the 95 % confidence interval.
    pub interval: Option<[f64; 2]>,
}

impl Figure {
    /// Creates a figure without an interval.
    pub(crate) fn new(
        name: impl Into<String>,
        scene: &str,
        value: impl Into<Cell>,
        unit: &'static str,
    ) -> Self {
        Self { name: name.into(), scene: scene.to_owned(), value: value.into(), unit, interval: None }
    }

    /// Adds the ends of the confidence interval to the figure.
    #[must_use]
    pub(crate) fn within(self, lower: f64, upper: f64) -> Self {
        Self { interval: Some([lower, upper]), ..self }
    }
}

/// Encodes the figures as CSV.
pub(crate) fn figures_csv(figures: &[Figure]) -> String {
    let heads = ["name", "scene", "value", "unit", "lower", "upper"];
    let mut table = Table::new("", heads.map(|head| Column::new(head, "")).into());
    for Figure { name, scene, value, unit, interval } in figures {
        let [lower, upper]: [Cell; 2] = match interval {
            Some(ends) => ends.map(Cell::from),
            None => [Cell::Empty, Cell::Empty],
        };
        table.push(vec![
            name.as_str().into(),
            scene.as_str().into(),
            value.clone(),
            (*unit).into(),
            lower,
            upper,
        ]);
    }
    table.to_csv()
}

/// Converts a name to a part of a figure's name: lower case, with a hyphen for each run of characters other
/// than letters, digits and dots.
pub(crate) fn slug(name: &str) -> String {
    let is_kept = |c: char| c.is_ascii_alphanumeric() || c == '.';
    let words = name.split(|c: char| !is_kept(c)).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}

/// Maximum length of a name, bytes. A name with a hash and an extension then has less than the 255 bytes that
/// common file systems allow.
const LONGEST: usize = 100;

/// Returns whether `name` is a valid file name on every system: 1 to 100 letters, digits, `-` and `.`, not
/// starting or ending with a dot.
pub(crate) fn is_portable(name: &str) -> bool {
    let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'.';
    (1..=LONGEST).contains(&name.len())
        && name.bytes().all(is_allowed)
        && !name.starts_with('.')
        && !name.ends_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_lines_in_full_precision() {
        let figures = [
            Figure::new("program", "", "photoncard 1", ""),
            Figure::new("bytes.all", "atrium", 1.0 / 3.0, "GB").within(0.25, 0.5),
            Figure::new("verdict", "atrium", "pays, \"twice\"", ""),
            Figure::new("sum", "", 12_u64, "bytes"),
        ];
        let expected = "name,scene,value,unit,lower,upper\r\nprogram,,photoncard 1,,,\r\n\
                        bytes.all,atrium,0.3333333333333333,GB,0.25,0.5\r\n\
                        verdict,atrium,\"pays, \"\"twice\"\"\",,,\r\nsum,,12,bytes,,\r\n";
        assert_eq!(figures_csv(&figures), expected);
        assert_eq!(slug("All techniques, lines; cache error 0.1"), "all-techniques-lines-cache-error-0.1");
    }

    #[test]
    fn only_plain_names_are_portable() {
        for name in ["figure-6.17", "a", "Table-7.1"] {
            assert!(is_portable(name), "{name}");
        }
        let long = "a".repeat(LONGEST + 1);
        for name in ["", ".", "..", ".hidden", "a.", "a/b", "a\\b", "a b", "ä", "a:b", long.as_str()] {
            assert!(!is_portable(name), "{name}");
        }
    }
}
