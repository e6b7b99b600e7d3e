//! Circles of imports between files.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

/// For each file, the files that it imports. Each imported file has a path that occurs in the importing file
/// and names an item of the imported file.
pub(crate) type Imports = BTreeMap<PathBuf, BTreeMap<PathBuf, String>>;

/// Circles of imports without common files, each as text with a line for each import.
pub(crate) fn circles(imports: &Imports, folder: &Path) -> Vec<String> {
    let mut known = BTreeSet::new();
    let mut circles = Vec::new();
    for file in imports.keys() {
        if known.contains(file) {
            continue;
        }
        if let Some(circle) = shortest_circle(imports, file) {
            circles.push(description(imports, &circle, folder));
            known.extend(circle);
        }
    }
    circles
}

/// Shortest circle of imports that starts at a file, by breadth-first search; the file comes first.
fn shortest_circle<'i>(imports: &'i Imports, start: &'i PathBuf) -> Option<Vec<&'i PathBuf>> {
    let mut importers: BTreeMap<&PathBuf, &PathBuf> = BTreeMap::new();
    let mut waiting = VecDeque::from([start]);
    while let Some(file) = waiting.pop_front() {
        for imported in imports.get(file)?.keys() {
            if imported == start {
                let back = std::iter::successors(Some(file), |file| importers.get(file).copied());
                let mut circle: Vec<_> = back.collect();
                circle.reverse();
                return Some(circle);
            }
            if !importers.contains_key(imported) {
                importers.insert(imported, file);
                waiting.push_back(imported);
            }
        }
    }
    None
}

fn description(imports: &Imports, circle: &[&PathBuf], folder: &Path) -> String {
    let name = |file: &'_ PathBuf| file.strip_prefix(folder).unwrap_or(file).display().to_string();
    let next = circle.iter().cycle().skip(1);
    let lines = circle.iter().zip(next).map(|(&file, &imported)| {
        format!("{} takes {} of {}", name(file), imports[file][imported], name(imported))
    });
    lines.collect::<Vec<_>>().join("\n  ")
}
