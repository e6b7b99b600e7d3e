//! Files and crates of the repository.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Folders at the top of the repository.
const FOLDERS: [&str; 8] = ["docs", "driver", "firmware", "host-cli", "scenes", "shared", "tests", ".config"];

/// Path of a file of the repository, from its path relative to the repository.
pub(crate) fn path(name: impl AsRef<Path>) -> PathBuf {
    root().join(name)
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Path relative to the repository.
pub(crate) fn name(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned()
}

/// Returns whether a word is a path in the repository, and no placeholder or pattern.
fn is_path(word: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_./".contains(c);
    let stem = word.strip_suffix("Cargo.toml").or_else(|| word.strip_suffix("README.md")).unwrap_or(word);
    FOLDERS.contains(&word.split('/').next().unwrap_or_default())
        && word.contains('/')
        && stem.chars().all(is_plain)
}

/// Defect of a word that names a path in the repository, if this path does not exist.
pub(crate) fn defect_of_path(word: &str) -> Option<String> {
    let word = word.strip_prefix("./").unwrap_or(word);
    (is_path(word) && !path(word).exists()).then(|| format!("{word} does not exist"))
}

/// Defect of a script's path: it does not exist, or is not executable.
pub(crate) fn defect_of_script(program: &str) -> Option<String> {
    let Ok(metadata) = fs::metadata(path(program)) else { return Some(format!("{program} does not exist")) };
    let is_executable = metadata.is_file() && metadata.permissions().mode() & 0o111 != 0;
    (!is_executable).then(|| format!("{program} is not executable"))
}

/// Returns whether any script of the repository contains this option.
pub(crate) fn has_script_with(option: &str) -> bool {
    let mut folders = vec![path("tests"), path("host-cli")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let is_script = path.extension().is_some_and(|ending| ending == "sh" || ending == "py");
            if is_script && fs::read_to_string(&path).unwrap().contains(option) {
                return true;
            }
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    false
}

/// Defects of cargo's arguments: crates, targets and folders that do not exist.
pub(crate) fn defects_of_cargo(arguments: &[&str]) -> Vec<String> {
    let value = |options: &[&str]| {
        let place = arguments.iter().position(|argument| options.contains(argument))?;
        arguments.get(place + 1).copied()
    };
    let mut defects = Vec::new();
    if let Some(folder) = value(&["--path"])
        && !path(folder).join("Cargo.toml").is_file()
    {
        defects.push(format!("{folder} is no crate"));
    }
    let Some(package) = value(&["-p", "--package"]) else { return defects };
    let Some(folder) = FOLDERS.into_iter().find(|folder| is_package(folder, package)) else {
        defects.push(format!("there is no crate {package}"));
        return defects;
    };
    for (option, below) in [("--test", "tests"), ("--example", "examples"), ("--bench", "benches")] {
        let Some(target) = value(&[option]) else { continue };
        let place = path(folder).join(below).join(target);
        if !place.with_extension("rs").is_file() && !place.join("main.rs").is_file() {
            defects.push(format!("{package} has no {option} {target}"));
        }
    }
    defects
}

fn is_package(folder: &str, package: &str) -> bool {
    let manifest = fs::read_to_string(path(folder).join("Cargo.toml")).unwrap_or_default();
    manifest.lines().any(|line| line == format!("name = \"{package}\""))
}
