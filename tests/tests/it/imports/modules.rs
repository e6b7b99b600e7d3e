//! Modules of a crate, with their files, names and paths.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use syn::{Attribute, Expr, ExprLit, Item, ItemMod, Lit, Meta};

use super::circles::Imports;
use super::paths::{Names, PathText, Paths, names_and_paths};

/// Index in [`Crate::modules`].
type ModuleIndex = usize;

/// Modules and names that were looked up for a path. None is looked up twice, because the search would not
/// end if modules re-export each other's names.
type Asked = BTreeSet<(ModuleIndex, String)>;

/// Module, inline or in a file of its own.
struct Module {
    file: PathBuf,
    parent: Option<ModuleIndex>,
    /// Child modules by name. There may be several of a name, for different systems.
    children: BTreeMap<String, Vec<ModuleIndex>>,
    names: Names,
    paths: Paths,
}

/// Cargo target with all its modules, the root first.
pub(crate) struct Crate {
    modules: Vec<Module>,
}

/// Target of a path.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Resolved {
    /// A module itself.
    Module(ModuleIndex),
    /// An item that a module defines.
    ItemOf(ModuleIndex),
}

impl Crate {
    /// Reads the modules of a target, from its root file on.
    ///
    /// # Panics
    /// If a file is missing or cannot be parsed as Rust.
    pub(crate) fn read(root: &Path) -> Self {
        let mut modules = Self { modules: Vec::new() };
        modules.read_file(root, None, root.parent().expect("a root is in a folder"));
        modules
    }

    /// Reads the module in a file, with its child modules, whose files are in `folder`.
    fn read_file(&mut self, file: &Path, parent: Option<ModuleIndex>, folder: &Path) -> ModuleIndex {
        let text =
            std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.add(&parsed.items, file, parent, folder)
    }

    fn add(
        &mut self,
        items: &[Item],
        file: &Path,
        parent: Option<ModuleIndex>,
        folder: &Path,
    ) -> ModuleIndex {
        let (names, paths) = names_and_paths(items);
        let index = self.modules.len();
        // The path is canonical, as targets may reach one file in several ways.
        let file = file.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let module = Module { file: file.clone(), parent, children: BTreeMap::new(), names, paths };
        self.modules.push(module);
        for item in items {
            if let Item::Mod(declared) = item {
                let child = self.add_child(declared, &file, index, folder);
                self.modules[index].children.entry(declared.ident.to_string()).or_default().push(child);
            }
        }
        index
    }

    /// Adds a declared module by Rust's rules: inline, at its `#[path]`, in `NAME.rs` or in `NAME/mod.rs`.
    fn add_child(
        &mut self,
        declared: &ItemMod,
        file: &Path,
        parent: ModuleIndex,
        folder: &Path,
    ) -> ModuleIndex {
        let own_folder = folder.join(declared.ident.to_string());
        if let Some((_, items)) = &declared.content {
            return self.add(items, file, Some(parent), &own_folder);
        }
        if let Some(path) = declared.attrs.iter().find_map(path_attribute) {
            let child = file.parent().expect("a file is in a folder").join(path);
            let folder = child.parent().expect("a file is in a folder").to_owned();
            return self.read_file(&child, Some(parent), &folder);
        }
        let beside = own_folder.with_extension("rs");
        let child = if beside.is_file() { beside } else { own_folder.join("mod.rs") };
        self.read_file(&child, Some(parent), &own_folder)
    }

    /// Adds the imports of each file of the target to `imports`.
    pub(crate) fn add_imports(&self, imports: &mut Imports) {
        let mut first_segments: BTreeMap<&Path, BTreeSet<&String>> = BTreeMap::new();
        for Module { file, paths, .. } in &self.modules {
            first_segments.entry(file).or_default().extend(&paths.first_segments);
        }
        for (index, Module { file, paths, .. }) in self.modules.iter().enumerate() {
            let of_file = imports.entry(file.clone()).or_default();
            let used = &first_segments[file.as_path()];
            let handed_on = paths.handed_on.iter().filter(|(name, _)| used.contains(name));
            for path in paths.imports.iter().chain(handed_on.map(|(_, path)| path)) {
                for resolved in self.resolve(index, path, &mut BTreeSet::new()) {
                    let (Resolved::Module(target) | Resolved::ItemOf(target)) = resolved;
                    let target = &self.modules[target].file;
                    if target != file {
                        of_file.entry(target.clone()).or_insert_with(|| path.join("::"));
                    }
                }
            }
        }
    }

    /// Resolves a path in a module; empty if it leads to another crate.
    fn resolve(&self, module: ModuleIndex, path: &[String], asked: &mut Asked) -> Vec<Resolved> {
        let [first, rest @ ..] = path else { return vec![Resolved::Module(module)] };
        match (first.as_str(), self.modules[module].parent) {
            ("crate", _) => self.walk(0, rest, asked),
            ("self", _) => self.resolve(module, rest, asked),
            ("super", Some(parent)) => self.resolve(parent, rest, asked),
            _ => self.look_up(module, first, rest, asked),
        }
    }

    /// Resolves the rest of a path from a module on. An unknown name, such as one that a macro defines,
    /// counts as an item of this module.
    fn walk(&self, module: ModuleIndex, path: &[String], asked: &mut Asked) -> Vec<Resolved> {
        let [first, rest @ ..] = path else { return vec![Resolved::Module(module)] };
        let found = self.look_up(module, first, rest, asked);
        if found.is_empty() { vec![Resolved::ItemOf(module)] } else { found }
    }

    /// Resolves `name`, if the module declares, defines or imports it, and the rest of the path from there.
    fn look_up(&self, module: ModuleIndex, name: &str, rest: &[String], asked: &mut Asked) -> Vec<Resolved> {
        if !asked.insert((module, name.to_owned())) {
            return Vec::new();
        }
        let Module { children, names, .. } = &self.modules[module];
        if let Some(children) = children.get(name) {
            return children.iter().flat_map(|child| self.walk(*child, rest, asked)).collect();
        }
        if names.defined.contains(name) {
            return vec![Resolved::ItemOf(module)];
        }
        if let Some(imported) = names.imported.get(name) {
            let path: PathText = imported.iter().chain(rest).cloned().collect();
            return self.resolve(module, &path, asked);
        }
        let mut places = Vec::new();
        for glob in &names.globs {
            for resolved in self.resolve(module, glob, asked) {
                if let Resolved::Module(of) = resolved {
                    places.extend(self.look_up(of, name, rest, asked));
                }
            }
        }
        places
    }
}

/// File of `#[path = "FILE"]`.
fn path_attribute(attribute: &Attribute) -> Option<String> {
    match &attribute.meta {
        Meta::NameValue(meta) if meta.path.is_ident("path") => match &meta.value {
            Expr::Lit(ExprLit { lit: Lit::Str(path), .. }) => Some(path.value()),
            _ => None,
        },
        _ => None,
    }
}
