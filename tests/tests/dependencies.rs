//! What dependencies may be: their licences and their sources, as `deny.toml` allows them. `cargo deny` checks advisories as well;
//! this needs no tool but cargo.

use std::collections::BTreeSet;
use std::process::Command;

use serde_json::Value;

const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Whether an SPDX expression is satisfied by allowed licences: alternatives of terms that all must hold. `None` if it is none.
fn is_satisfied(expression: &str, allowed: &BTreeSet<&str>) -> Option<bool> {
    // A slash is how crates told alternatives before SPDX.
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    let value = alternatives(&mut words, allowed)?;
    words.next().is_none().then_some(value)
}

type Words<'a, 'b> = &'a mut std::iter::Peekable<std::str::SplitWhitespace<'b>>;

fn alternatives(words: Words, allowed: &BTreeSet<&str>) -> Option<bool> {
    let mut value = terms(words, allowed)?;
    while words.next_if_eq(&"OR").is_some() {
        value |= terms(words, allowed)?;
    }
    Some(value)
}

fn terms(words: Words, allowed: &BTreeSet<&str>) -> Option<bool> {
    let mut value = term(words, allowed)?;
    while words.next_if_eq(&"AND").is_some() {
        value &= term(words, allowed)?;
    }
    Some(value)
}

fn term(words: Words, allowed: &BTreeSet<&str>) -> Option<bool> {
    let licence = words.next_if(|word| !["OR", "AND", "WITH", ")"].contains(word))?;
    if licence == "(" {
        let value = alternatives(words, allowed)?;
        return words.next_if_eq(&")").map(|_| value);
    }
    match words.next_if_eq(&"WITH") {
        None => Some(allowed.contains(licence)),
        Some(_) => Some(allowed.contains(&*format!("{licence} WITH {}", words.next()?))),
    }
}

/// The licences that `deny.toml` allows.
fn allowed_licences() -> Vec<String> {
    let text = include_str!("../../deny.toml");
    let list = text
        .split_once("\nallow = [")
        .and_then(|(_, rest)| rest.split_once(']'))
        .expect("a list of licences")
        .0;
    list.split(',')
        .map(|name| name.trim().trim_matches('"').to_owned())
        .filter(|name| !name.is_empty())
        .collect()
}

/// All packages of the lock file, those of other systems and boards included.
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
fn expressions_are_read_as_spdx_means_them() {
    let allowed = BTreeSet::from(["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"]);
    for (expression, expected) in [
        ("MIT", Some(true)),
        ("GPL-3.0", Some(false)),
        ("GPL-3.0 OR MIT", Some(true)),
        ("GPL-3.0/MIT", Some(true)),
        ("MIT AND GPL-3.0", Some(false)),
        ("GPL-3.0 AND ISC OR MIT", Some(true)),
        ("(GPL-3.0 OR MIT) AND ISC", Some(false)),
        ("(GPL-3.0 OR MIT) AND Zlib", Some(true)),
        ("Apache-2.0 WITH LLVM-exception", Some(true)),
        ("Apache-2.0 WITH other", Some(false)),
        ("Apache-2.0", Some(false)),
        ("", None),
        ("MIT OR", None),
        ("MIT Zlib", None),
        ("(MIT", None),
        ("MIT)", None),
    ] {
        assert_eq!(is_satisfied(expression, &allowed), expected, "{expression}");
    }
}

#[test]
fn dependencies_come_from_crates_io_under_allowed_licences() {
    let allowed = allowed_licences();
    let allowed = allowed.iter().map(String::as_str).collect();
    let packages = packages();
    assert!(packages.len() > 50, "{} packages are not all", packages.len());
    for package in packages {
        let (name, version) = (&package["name"], &package["version"]);
        let licence = package["license"].as_str().unwrap_or_default();
        assert_eq!(
            is_satisfied(licence, &allowed),
            Some(true),
            "{name} {version} is under {licence:?}: see deny.toml"
        );
        let source = package["source"].as_str();
        assert!(source.is_none_or(|source| source == CRATES_IO), "{name} {version} comes from {source:?}");
    }
}
