//! No file imports another file that imports it, directly or indirectly: each can be read without its users.
//!
//! The test reads all files of all targets of the workspace. A file imports another if a path in it, in a
//! `use` or an expression, names an item that the other file defines, through whichever `pub use` the path
//! leads. A `mod` declaration is no import, nor is a `pub use` of a name that the file itself does not use.
//!
//! Types are not resolved. The test therefore misses methods and fields of a value whose type the file does
//! not name, paths in the body of a `macro_rules!`, and paths in macro arguments that are not comma-separated
//! expressions.

mod circles;
mod modules;
mod paths;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use self::circles::{Imports, circles};
use self::modules::Crate;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are a folder of the workspace")
}

/// Root files of all cargo targets: libraries, programs, tests, examples, benchmarks, build scripts.
fn roots() -> BTreeSet<PathBuf> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(workspace())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages").iter();
    let targets = packages.flat_map(|package| package["targets"].as_array().expect("targets"));
    targets.map(|target| target["src_path"].as_str().expect("a path").into()).collect()
}

/// Adds all Rust files below a folder to `found`.
fn rust_files(folder: &Path, found: &mut BTreeSet<PathBuf>) {
    for entry in folder.read_dir().expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.insert(path);
        }
    }
}

fn imports_of<'r>(roots: impl IntoIterator<Item = &'r PathBuf>) -> Imports {
    let mut imports = Imports::default();
    for root in roots {
        Crate::read(root).add_imports(&mut imports);
    }
    imports
}

#[test]
fn no_file_imports_one_that_imports_it_back() {
    let imports = imports_of(&roots());
    let mut on_disk = BTreeSet::new();
    let rooms = ["cards", "map", "picture", "render", "scene", "study"].map(|room| format!("driver/{room}"));
    let packages = ["shared", "firmware", "driver", "host-cli", "scenes", "tests"];
    for package in packages.into_iter().chain(rooms.iter().map(String::as_str)) {
        for folder in ["src", "boards"].map(|folder| workspace().join(package).join(folder)) {
            if folder.is_dir() {
                rust_files(&folder, &mut on_disk);
            }
        }
    }
    let missed: Vec<_> = on_disk.iter().filter(|file| !imports.contains_key(*file)).collect();
    assert!(missed.is_empty(), "no target has {missed:?}");
    let edges: usize = imports.values().map(BTreeMap::len).sum();
    println!("{} files, {edges} imports", imports.len());
    let circles = circles(&imports, workspace());
    assert!(circles.is_empty(), "{} circles:\n{}", circles.len(), circles.join("\n"));
}

/// Circles of a crate of these files (name, source), the root first.
fn circles_of(files: &[(&str, &str)]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("is made");
        std::fs::write(path, text).expect("is written");
    }
    circles(&imports_of([&folder.path().join(files[0].0)]), folder.path())
}

#[test]
fn a_circle_is_named_with_the_paths_that_close_it() {
    let files = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::{b::{self, One}, c::*}; pub struct A(One);"),
        ("b.rs", "pub struct One(super::c::Three);"),
        ("c/mod.rs", "mod d; pub use self::d::Three;"),
        ("c/d.rs", "use crate::a::A as Renamed; pub struct Three(Vec<Renamed>);"),
    ];
    assert_eq!(
        circles_of(&files),
        [
            "a.rs takes crate::b::One of b.rs\n  b.rs takes super::c::Three of c/d.rs\n  c/d.rs takes crate::a::A of a.rs"
        ]
    );
}

#[test]
fn circles_are_found_however_they_are_written() {
    let one = "pub struct One; pub fn one() {}";
    for closing in [
        "use super::a::One;",
        "use crate::a as other; fn f(_: other::One) {}",
        "use crate::a::*;",
        "use crate::*; fn f() { a::one() }",
        "fn f() { crate::a::one() }",
        "fn f() { assert_eq!((), crate::a::one()) }",
        "fn f() { use super::a::One; }",
        "mod inner { use super::super::a::One; }",
        "#[cfg(test)] mod tests { use super::*; use crate::a; fn f() { a::one() } }",
        "pub use crate::renamed::Two; fn f(_: Two) {}",
    ] {
        let a = format!("use crate::b::B; {one}");
        let b = format!("pub struct B; {closing}");
        let root = "mod a; mod b; mod renamed { pub use crate::a::One as Two; }";
        let circles = circles_of(&[("lib.rs", root), ("a.rs", &a), ("b.rs", &b)]);
        assert_eq!(circles.len(), 1, "{closing}: {circles:?}");
    }
}

#[test]
fn imports_without_a_circle_are_accepted() {
    let cases: [&[(&str, &str)]; 4] = [
        // Files declare child modules, and import what a parent re-exports.
        &[
            ("main.rs", "mod a; use a::One; fn main() { a::b::two(One) }"),
            ("a/mod.rs", "pub mod b; mod c; pub use self::c::One;"),
            ("a/b.rs", "use super::One; pub fn two(_: One) {}"),
            ("a/c.rs", "pub struct One;"),
        ],
        // A variable has the name of a module.
        &[
            ("lib.rs", "mod a; pub fn f(a: u32) -> u32 { a + 1 }"),
            ("a.rs", "use crate::f; pub fn g() { f(1); }"),
        ],
        // Paths lead to other crates, and to items of the same file.
        &[
            ("lib.rs", "mod a;"),
            (
                "a.rs",
                "use std::fs; mod b { use super::One; pub struct Two(One); } use self::b::Two; struct One;",
            ),
        ],
        // A test module imports more than the file that declares it.
        &[
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "pub fn f() {} #[cfg(test)] mod tests;"),
            ("a/tests.rs", "use super::*; use crate::b::g;"),
            ("b.rs", "use crate::a::f; pub fn g() { f() }"),
        ],
    ];
    for files in cases {
        assert_eq!(circles_of(files), [""; 0], "{files:?}");
    }
}

#[test]
fn modules_are_found_by_the_rules_of_the_language() {
    let files = [
        ("main.rs", "#[path = \"common/mod.rs\"] mod common; mod inline { mod deep; } mod file;"),
        ("common/mod.rs", "mod port; pub struct Common;"),
        ("common/port.rs", "use super::Common; use crate::file::child::Child;"),
        ("inline/deep.rs", "use crate::common::Common;"),
        ("file.rs", "pub mod child;"),
        ("file/child.rs", "use crate::inline::deep::Deep; pub struct Child;"),
    ];
    assert_eq!(circles_of(&files), [""; 0]);
    let closed = files.map(|(name, text)| match name {
        "common/mod.rs" => (name, "mod port; pub struct Common(self::port::Port);"),
        _ => (name, text),
    });
    let circles = circles_of(&closed);
    for file in ["common/mod.rs takes", "common/port.rs takes", "file/child.rs takes", "inline/deep.rs takes"]
    {
        assert!(circles.iter().any(|circle| circle.contains(file)), "{file}: {circles:?}");
    }
}
