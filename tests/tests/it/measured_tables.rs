//! Tables of measurements in documents equal those made from the CSV files beside them. `UPDATE_DOCS=1 cargo
//! test -p photoncard-tests --test it measured_tables` writes them.

use std::fs;
use std::path::{Path, PathBuf};

/// Line of `docs/quality.csv`: measurements of a scene that was rendered by photoncard with some settings, or
/// by another renderer.
struct Row {
    scene: String,
    settings: String,
    /// CPU time, s.
    seconds: f64,
    /// Relative RMSE, %.
    error: f64,
    /// Mean, median and 95th percentile of the errors of blocks, as the file states them.
    others: [String; 3],
}

impl Row {
    fn new(line: &str) -> Option<Self> {
        let (scene, rest) = line.split_once(',')?;
        // The settings may contain commas.
        let mut fields: Vec<&str> = rest.rsplitn(8, ',').collect();
        fields.reverse();
        let [settings, seconds, _noise, _bias, error, others @ ..] = &fields[..] else { return None };
        Some(Self {
            scene: scene.to_owned(),
            settings: settings.trim_matches('"').to_owned(),
            seconds: seconds.parse().ok()?,
            error: error.parse().ok()?,
            others: <[&str; 3]>::try_from(others).ok()?.map(str::to_owned),
        })
    }

    /// CPU time times squared error. It does not depend on the number of samples if the samples are
    /// independent.
    fn cost(&self) -> f64 {
        self.seconds * self.error * self.error
    }
}

/// Rows of the table in `docs/quality.md`.
fn quality_table(csv: &str) -> Vec<String> {
    let rows: Vec<Row> = csv.lines().skip(1).filter_map(Row::new).collect();
    assert_eq!(rows.len(), csv.lines().count() - 1, "each line of the CSV is a row");
    rows.iter().filter_map(|row| row.settings.strip_prefix("--quality ").map(|quality| (row, quality))).map(|(row, quality)| {
        let of_scene = || rows.iter().filter(|other| other.scene == row.scene);
        let times = |peer: &str| {
            let found = of_scene().find(|other| other.settings.starts_with(peer));
            found.map_or_else(String::new, |peer| format!("{:.1}", peer.cost() / row.cost()))
        };
        let ours = of_scene().filter(|other| other.settings.starts_with("--"));
        let best = ours.map(Row::cost).fold(f64::INFINITY, f64::min);
        let Row { scene, seconds, error, others: [mean, median, p95], .. } = row;
        let [mitsuba, cycles] = ["Mitsuba", "Cycles"].map(times);
        let of_best = row.cost() / best;
        format!(
            "| {scene} | `{quality}` | {seconds:.1} | {error:.2} | {mean} | {median} | {p95} | {mitsuba} | {cycles} | {of_best:.1} |"
        )
    }).collect()
}

fn documents() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// Indices of the first row of the table below a heading row, and of the line after the table.
fn table_of(document: &str, heading: &str) -> (usize, usize) {
    let lines: Vec<&str> = document.lines().collect();
    let first = lines.iter().position(|line| *line == heading).expect("the document has the table") + 2;
    let length = lines[first..].iter().take_while(|line| line.starts_with('|')).count();
    (first, first + length)
}

/// Rows of the table in `docs/memory.md`: bytes per frame, the factor below the naive order, and the program.
fn memory_table(csv: &str) -> Vec<String> {
    let rows = csv.lines().skip(1).map(|line| {
        let fields = <[&str; 9]>::try_from(line.split(',').collect::<Vec<_>>()).expect("nine fields");
        let [scene, rays, card, side, order, photons, geometry, waiting, program] = fields;
        let bytes =
            [photons, geometry, waiting].map(|bytes| bytes.parse::<f64>().expect("a number of bytes"));
        ((scene, rays, card, order, side), bytes, program)
    });
    let frames: Vec<_> = rows.filter(|((.., side), ..)| *side == "512").collect();
    let naive = |of: &str| {
        let row = frames.iter().find(|((scene, _, _, order, _), ..)| *scene == of && *order == "naive");
        row.map(|(_, bytes, _)| bytes.iter().sum::<f64>()).expect("a naive frame of each scene")
    };
    frames
        .iter()
        .map(|((scene, rays, card, order, _), bytes, program)| {
            let [photons, geometry, waiting] = bytes.map(|bytes| format!("{:.1}", bytes / 1e6));
            let times = naive(scene) / bytes.iter().sum::<f64>();
            let of_bytes = format!("{photons} | {geometry} | {waiting}");
            format!("| {scene}, {rays} | `{card}` | `{order}` | {of_bytes} | {times:.0} | {program} |")
        })
        .collect()
}

/// Compares the rows below a heading row with `expected`, or writes these if `UPDATE_DOCS` is set.
fn check_table(name: &str, heading: &str, expected: &[String]) {
    let path = documents().join(name);
    let document = fs::read_to_string(&path).expect("the document can be read");
    let (first, end) = table_of(&document, heading);
    let lines: Vec<&str> = document.lines().collect();
    if lines[first..end] == *expected {
        return;
    }
    assert!(std::env::var_os("UPDATE_DOCS").is_some(), "expected:\n{}", expected.join("\n"));
    let expected: Vec<&str> = expected.iter().map(String::as_str).collect();
    fs::write(&path, [&lines[..first], &expected, &lines[end..]].concat().join("\n") + "\n")
        .expect("written");
}

fn csv(name: &str) -> String {
    fs::read_to_string(documents().join(name)).expect("the figures can be read")
}

#[test]
fn the_table_of_qualities_follows_from_its_csv() {
    const HEADING: &str = "| scene | quality | CPU s | error, % | mean | median, % | p95, % | Mitsuba, times | Cycles, times | best, times |";
    check_table("quality.md", HEADING, &quality_table(&csv("quality.csv")));
}

#[test]
fn the_table_of_memory_follows_from_its_csv() {
    const HEADING: &str = "| scene, gather rays | `--card` | `--order` | photon map, MB | scene, MB | waiting, MB | times less | program |";
    check_table("memory.md", HEADING, &memory_table(&csv("memory.csv")));
}

#[test]
fn ratios_compare_time_times_squared_error() {
    let csv = "scene,settings\nbox,--quality good,2.00,1,0,3.00,1.0001,0.4,2.0\nbox,\"Mitsuba, 64 samples\",1.00,1,0,12.00,1.0,0.5,2.5\nbox,--spp 2 --photons 3,1.00,1,0,3.00,1.0,0.4,2.0";
    assert_eq!(quality_table(csv), ["| box | `good` | 2.0 | 3.00 | 1.0001 | 0.4 | 2.0 | 8.0 |  | 2.0 |"]);
}
