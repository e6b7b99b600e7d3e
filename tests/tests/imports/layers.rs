//! Layers of a crate: the table of its root's documentation, against the modules that there are and what they import.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::circles::Imports;

/// Rows of the table below the heading `# Layers`, from the top row 0 on: of each module the row that names it.
pub(crate) struct Layers {
    rows: BTreeMap<String, usize>,
    repeated: Vec<String>,
}

impl Layers {
    /// Reads the table of a root file: the names in its second column that are set as code.
    pub(crate) fn read(root: &str) -> Self {
        let documentation = root.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim);
        let section = documentation.skip_while(|line| *line != "# Layers").skip(1);
        let rows = section.take_while(|line| !line.starts_with("# ")).filter(|line| line.starts_with('|'));
        let mut layers = Self { rows: BTreeMap::new(), repeated: Vec::new() };
        for (row, line) in rows.enumerate() {
            let modules = line.split('|').nth(2).unwrap_or_default();
            for name in modules.split('`').skip(1).step_by(2) {
                if layers.rows.insert(name.to_owned(), row).is_some() {
                    layers.repeated.push(name.to_owned());
                }
            }
        }
        layers
    }

    /// The faults of a crate in `folder`: modules that the table lacks, names that two rows or no module have, and imports
    /// of a row below, a line each.
    pub(crate) fn faults(&self, imports: &Imports, folder: &Path) -> Vec<String> {
        let of_crate =
            || imports.iter().filter_map(|(file, imported)| Some((module(file, folder)?, file, imported)));
        let modules: BTreeSet<String> = of_crate().map(|(module, ..)| module).collect();
        let repeated = self.repeated.iter().map(|name| format!("{name} is in two rows"));
        let missing = modules.iter().filter(|name| !self.rows.contains_key(*name));
        let unknown = self.rows.keys().filter(|name| !modules.contains(*name));
        let mut faults: Vec<String> = repeated.collect();
        faults.extend(missing.map(|name| format!("the module {name} is in no row")));
        faults.extend(unknown.map(|name| format!("{name} is no module")));
        for (importer, file, imported) in of_crate() {
            for (target, path) in imported {
                let target = module(target, folder);
                let rows = target.as_ref().map(|target| (self.rows.get(&importer), self.rows.get(target)));
                if let Some((Some(own), Some(other))) = rows
                    && own < other
                {
                    let file = file.strip_prefix(folder).unwrap_or(file).display();
                    faults.push(format!("{file} takes {path} of a row below"));
                }
            }
        }
        faults
    }
}

/// The module of the root that a file belongs to; `None` for the root, and files of other crates.
fn module(file: &Path, folder: &Path) -> Option<String> {
    let first = file.strip_prefix(folder).ok()?.components().next()?.as_os_str().to_str()?;
    let name = first.strip_suffix(".rs").unwrap_or(first);
    (!matches!(first, "lib.rs" | "main.rs")).then(|| name.to_owned())
}
