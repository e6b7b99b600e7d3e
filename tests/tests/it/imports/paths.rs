//! Names that a module defines or imports, and all paths in it.

use std::collections::{BTreeMap, BTreeSet};

use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Expr, Item, ItemMod, ItemUse, Macro, Path, Token, UseTree, VisRestricted, Visibility};

/// Segments of a path, such as `crate`, `scene`, `Scene`.
pub(crate) type PathText = Vec<String>;

/// Names of a module, without those of its child modules.
#[derive(Default)]
pub(crate) struct Names {
    pub(crate) defined: BTreeSet<String>,
    /// Paths that `use` imports, by the names that it gives them.
    pub(crate) imported: BTreeMap<String, PathText>,
    /// Paths before the `*` of glob imports.
    pub(crate) globs: Vec<PathText>,
}

/// All paths in a module.
#[derive(Default)]
pub(crate) struct Paths {
    /// Paths of `use`, and other paths of two segments or more: a single name is defined or imported here, or
    /// a variable.
    pub(crate) imports: Vec<PathText>,
    /// Paths of `pub use`, by the names that it gives them.
    pub(crate) handed_on: BTreeMap<String, PathText>,
    /// First segments of all paths except those of `use`.
    pub(crate) first_segments: BTreeSet<String>,
}

/// Names and paths of a module.
pub(crate) fn names_and_paths(items: &[Item]) -> (Names, Paths) {
    let mut names = Names::default();
    let mut paths = Paths::default();
    for item in items {
        match item {
            Item::Use(item) => add_imported(&item.tree, &[], &mut names),
            other => names.defined.extend(defined_name(other)),
        }
        paths.visit_item(item);
    }
    (names, paths)
}

/// Name that an item defines.
fn defined_name(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// Adds the names that a `use` imports below the path `before`; the name `self` imports `before` itself.
fn add_imported(tree: &UseTree, before: &[String], names: &mut Names) {
    match tree {
        UseTree::Path(path) => add_imported(&path.tree, &with(before, &path.ident), names),
        UseTree::Name(name) if name.ident == "self" => {
            names.imported.extend(before.last().map(|name| (name.clone(), before.to_vec())));
        }
        UseTree::Name(name) => {
            names.imported.insert(name.ident.to_string(), with(before, &name.ident));
        }
        UseTree::Rename(rename) => {
            names.imported.insert(rename.rename.to_string(), with(before, &rename.ident));
        }
        UseTree::Glob(_) => names.globs.push(before.to_vec()),
        UseTree::Group(group) => group.items.iter().for_each(|tree| add_imported(tree, before, names)),
    }
}

fn with(before: &[String], name: &syn::Ident) -> PathText {
    before.iter().cloned().chain([name.to_string()]).collect()
}

impl<'ast> Visit<'ast> for Paths {
    /// Skips child modules, which are read by themselves.
    fn visit_item_mod(&mut self, _: &'ast ItemMod) {}

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let mut names = Names::default();
        add_imported(&item.tree, &[], &mut names);
        if matches!(item.vis, Visibility::Inherited) {
            self.imports.extend(names.imported.into_values().chain(names.globs));
        } else {
            self.handed_on.extend(names.imported);
        }
    }

    /// Skips visibilities such as `pub(in PATH)`, which import nothing.
    fn visit_vis_restricted(&mut self, _: &'ast VisRestricted) {}

    fn visit_path(&mut self, path: &'ast Path) {
        let segments: PathText = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if path.leading_colon.is_none() {
            self.first_segments.extend(segments.first().cloned());
            self.imports.extend((segments.len() > 1).then_some(segments));
        }
        visit::visit_path(self, path);
    }

    /// Visits a macro's path, and its arguments if they are comma-separated expressions.
    fn visit_macro(&mut self, called: &'ast Macro) {
        self.visit_path(&called.path);
        let arguments = Punctuated::<Expr, Token![,]>::parse_terminated.parse2(called.tokens.clone());
        // Another visitor reads the arguments, because `self` borrows from the file's syntax tree, which
        // lives longer than they do.
        let mut paths = Paths::default();
        arguments.iter().flatten().for_each(|argument| paths.visit_expr(argument));
        self.imports.append(&mut paths.imports);
        self.first_segments.extend(paths.first_segments);
    }
}
