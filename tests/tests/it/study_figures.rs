//! Figures in `docs/studies.md` equal those of `docs/studies.csv`, which is the `figures.csv` of a run of
//! `photoncard study all`. `UPDATE_DOCS=1 cargo test -p photoncard-tests --test it study_figures` writes them
//! into the document.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use photoncard_driver::render::PROGRAM;
use photoncard_driver::study::dissertation::{self, Measured};
use photoncard_driver::study::{Figure, Laboratory, NOT_REACHED, StudyObserver, check, human};
use photoncard_shared::image::LAYOUT_VERSION;
use serde::Deserialize;

/// Line of `docs/studies.csv`.
#[derive(Debug, Deserialize, PartialEq)]
struct Line {
    name: String,
    scene: String,
    value: String,
    unit: String,
    lower: Option<f64>,
    upper: Option<f64>,
}

/// Figures by name and scene.
type Figures = BTreeMap<(String, String), Line>;

fn figures(csv: &str) -> Figures {
    let lines = csv::Reader::from_reader(csv.as_bytes()).into_deserialize();
    let mut figures = Figures::new();
    for line in lines {
        let line: Line = line.expect("each line of the CSV is a figure");
        let key = (line.name.clone(), line.scene.clone());
        assert!(figures.insert(key.clone(), line).is_none(), "{key:?} is there once");
    }
    figures
}

/// Text of a figure: its value for the kind `=`, its confidence interval for `~`. Numbers have three
/// significant digits.
fn text(figure: &Line, kind: char) -> String {
    let number = |value: f64| human(value, 3);
    match (kind, figure.lower, figure.upper) {
        ('~', Some(lower), Some(upper)) => format!("{} to {}", number(lower), number(upper)),
        ('~', ..) => NOT_MEASURED.to_owned(),
        _ => figure.value.parse().map_or_else(|_| figure.value.clone(), number),
    }
}

const END: &str = "<!--/-->";

/// Text for a figure that was not measured, and for the interval of a figure without one.
const NOT_MEASURED: &str = "–";

/// Returns whether there is a figure of the same study, which is the part of the name before the first dot.
fn has_study(figures: &Figures, name: &str) -> bool {
    let study = |name: &str| name.split('.').next().map(str::to_owned);
    figures.keys().any(|(other, _)| study(other) == study(name))
}

/// Document with new figures: the text from each marker `<!--=NAME@SCENE-->` or `<!--~NAME@SCENE-->` to the
/// next `<!--/-->` is replaced.
fn filled(document: &str, figures: &Figures) -> Result<String, String> {
    let mut filled = String::new();
    let mut rest = document;
    while let Some(start) = rest.find("<!--=").into_iter().chain(rest.find("<!--~")).min() {
        let length = rest[start..].find("-->").ok_or("a marker has no end")?;
        let marker = &rest[start + 4..start + length];
        let (name, scene) = marker[1..].split_once('@').unwrap_or((&marker[1..], ""));
        let key = (name.to_owned(), scene.to_owned());
        let text = match figures.get(&key) {
            Some(figure) => text(figure, if marker.starts_with('~') { '~' } else { '=' }),
            None if has_study(figures, name) => return Err(format!("{name} of {scene:?} is no figure")),
            None => NOT_MEASURED.to_owned(),
        };
        filled.push_str(&rest[..start + length + 3]);
        filled.push_str(&text);
        let end = rest[start..].find(END).ok_or_else(|| format!("{marker} is not followed by {END}"))?;
        rest = &rest[start + end..];
    }
    Ok(filled + rest)
}

fn documents() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

fn read(name: &str) -> String {
    fs::read_to_string(documents().join(name)).expect("the document can be read")
}

#[test]
fn the_figures_of_the_document_equal_those_of_its_csv() {
    let document = read("studies.md");
    let expected = filled(&document, &figures(&read("studies.csv"))).expect("each marker names a figure");
    if document == expected {
        return;
    }
    let differing = document.lines().zip(expected.lines()).find(|(is, expected)| is != expected);
    assert!(std::env::var_os("UPDATE_DOCS").is_some(), "{differing:?}");
    fs::write(documents().join("studies.md"), expected).expect("written");
}

/// `docs/dissertation.md` is the page of these figures. `UPDATE_DOCS=1` writes it.
#[test]
fn the_claims_of_the_dissertation_are_compared_with_the_figures_of_the_csv() {
    let figures = figures(&read("studies.csv"));
    let measured = |name: &str, scene: &str| {
        let Line { value, lower, upper, .. } = figures.get(&(name.to_owned(), scene.to_owned()))?;
        let value = if value == NOT_REACHED { f64::NAN } else { value.parse().ok()? };
        Some(Measured { value, interval: lower.zip(*upper).map(|(lower, upper)| [lower, upper]) })
    };
    for file in dissertation::files() {
        assert!(documents().join("..").join(file).is_file(), "{file}");
    }
    let expected = dissertation::page(&measured);
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(documents().join("dissertation.md"), &expected).expect("written");
    }
    let is = read("dissertation.md");
    let differing = is.lines().zip(expected.lines()).find(|(is, expected)| is != expected);
    assert!(is == expected, "{differing:?}");
}

struct Silent;

impl StudyObserver for Silent {
    fn progress(&self, _: &str, _: usize, _: usize, _: bool) {}
    fn notice(&self, _: &str) {}
    fn is_stopped(&self) -> bool {
        false
    }
}

/// Value in `docs/studies.csv` of a figure without a scene.
fn committed(name: &str) -> Option<String> {
    figures(&read("studies.csv")).remove(&(name.to_owned(), String::new())).map(|line| line.value)
}

#[test]
fn the_csv_is_of_this_version_and_layout_and_of_a_full_run() {
    assert_eq!(committed("program").as_deref(), Some(PROGRAM));
    assert_eq!(committed("card-image-layout"), Some(LAYOUT_VERSION.to_string()));
    assert_eq!(committed("trial"), None);
}

/// Compares figures of two small renders with `docs/studies.csv`. If they differ, all figures are outdated.
#[test]
#[ignore = "figures of documents are compared by a command of their own: CONTRIBUTING.md, Documents"]
fn the_csv_is_of_this_program() {
    let committed = figures(&read("studies.csv"));
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut laboratory = Laboratory::new(folder.path(), &scenes, Some(2), &Silent).expect("threads start");
    let measured = check(&mut laboratory).expect("measured");
    assert!(
        measured.len() >= 6 && measured.iter().any(|figure| figure.name == "check.bytes.photon-map.sort")
    );
    for Figure { name, scene, value, .. } in measured {
        let line = committed.get(&(name.clone(), scene)).map(|line| line.value.clone());
        let is = value.csv();
        assert_eq!(
            line,
            Some(is),
            "{name}: replace docs/studies.csv by figures.csv of `photoncard study all`"
        );
    }
}

#[test]
fn markers_are_filled_repeatedly_with_values_and_intervals() {
    let csv = "name,scene,value,unit,lower,upper\r\nfactor,atrium,12345.6,times,0.25,2\r\nword,,\"pays, much\",,,\r\n";
    let figures = figures(csv);
    let document =
        "a <!--=factor@atrium-->1<!--/--> (<!--~factor@atrium--><!--/-->), <!--=word-->x<!--/-->.\n";
    let expected = "a <!--=factor@atrium-->12,300<!--/--> (<!--~factor@atrium-->0.25 to 2<!--/-->), \
                    <!--=word-->pays, much<!--/-->.\n";
    assert_eq!(filled(document, &figures).unwrap(), expected);
    assert_eq!(filled(expected, &figures).unwrap(), expected);
    let other_study = "<!--=other.factor@atrium-->–<!--/-->";
    assert_eq!(filled(other_study, &figures).unwrap(), other_study);
    for (document, error) in [
        ("<!--=factor-->1<!--/-->", "factor of \"\" is no figure"),
        ("<!--=word-->1", "not followed"),
        ("<!--=word", "no end"),
    ] {
        assert!(filled(document, &figures).unwrap_err().contains(error), "{document}");
    }
}
