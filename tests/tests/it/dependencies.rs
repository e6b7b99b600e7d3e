//! Licences and sources of dependencies are allowed by `deny.toml`. `cargo deny` also checks advisories; this
//! test needs only cargo.

use std::process::Command;

use serde_json::Value;
use spdx::{Expression, ParseMode};

const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Table `licenses` of `deny.toml`.
fn licences() -> toml::Table {
    let file: toml::Table = include_str!("../../../deny.toml").parse().expect("deny.toml is TOML");
    file["licenses"].as_table().expect("a table").clone()
}

/// Licences in a list of `deny.toml`.
fn names(list: &toml::Value) -> Vec<&str> {
    list.as_array().expect("a list").iter().map(|name| name.as_str().expect("a licence")).collect()
}

/// Licences that a package may have: the allowed ones, and its own exceptions.
fn allowed<'a>(licences: &'a toml::Table, package: &str) -> Vec<&'a str> {
    let exceptions = licences["exceptions"].as_array().expect("a list").iter();
    let of_package = exceptions.filter(|exception| exception["crate"].as_str() == Some(package));
    of_package.flat_map(|exception| names(&exception["allow"])).chain(names(&licences["allow"])).collect()
}

/// Returns whether the allowed licences satisfy an SPDX expression; `None` if it is invalid. A slash
/// separates alternatives in the notation before SPDX.
fn is_satisfied(expression: &str, allowed: &[&str]) -> Option<bool> {
    let expression = Expression::parse_mode(expression, ParseMode::LAX).ok()?;
    Some(expression.evaluate(|requirement| allowed.contains(&requirement.to_string().as_str())))
}

/// All packages of the lock file, including those for other systems and boards.
fn packages() -> Vec<Value> {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml");
    let arguments =
        ["metadata", "--format-version", "1", "--all-features", "--locked", "--manifest-path", manifest];
    let output = Command::new(env!("CARGO")).args(arguments).output().expect("cargo runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "run `cargo fetch --locked` where crates.io can be reached: {said}");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo's metadata is JSON");
    metadata["packages"].as_array().expect("there are packages").clone()
}

#[test]
fn a_licence_is_allowed_for_all_crates_or_for_one() {
    let licences = licences();
    assert!(!allowed(&licences, "serde").contains(&"MPL-2.0"));
    assert!(allowed(&licences, "serialport").contains(&"MPL-2.0"));
    let few = ["MIT", "Zlib"];
    assert_eq!(is_satisfied("GPL-3.0 OR MIT", &few), Some(true));
    assert_eq!(is_satisfied("Apache-2.0/MIT", &few), Some(true));
    assert_eq!(is_satisfied("(Apache-2.0 OR MIT) AND ISC", &few), Some(false));
    assert_eq!(is_satisfied("", &few), None);
}

#[test]
fn dependencies_come_from_crates_io_under_allowed_licences() {
    let licences = licences();
    let packages = packages();
    assert!(packages.len() > 50, "{} packages are not all", packages.len());
    for package in packages {
        let [name, version, licence] =
            ["name", "version", "license"].map(|key| package[key].as_str().unwrap_or_default());
        let is_allowed = is_satisfied(licence, &allowed(&licences, name));
        assert_eq!(is_allowed, Some(true), "{name} {version} is under {licence:?}: see deny.toml");
        let source = package["source"].as_str();
        assert!(source.is_none_or(|source| source == CRATES_IO), "{name} {version} comes from {source:?}");
    }
}
