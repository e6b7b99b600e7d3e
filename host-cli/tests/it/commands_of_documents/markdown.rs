//! Markdown documents, and their parts that are not prose.

use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag};

use super::repository;

/// Document of the repository.
pub(crate) struct Document {
    /// Path relative to the repository.
    pub(crate) name: String,
    text: String,
}

/// Part of a document that is not prose.
#[derive(Debug, PartialEq)]
pub(crate) enum Piece {
    /// A block of code.
    Block {
        /// Info string after the opening fence; empty without one.
        info: String,
        text: String,
    },
    /// Inline code.
    Code(String),
    /// Target of a link or a picture.
    Link(String),
}

/// All documents but the change log, whose commands may be of older versions.
pub(crate) fn documents() -> Vec<Document> {
    let in_folder = |folder: &str| {
        let mut names: Vec<_> = fs::read_dir(repository::path(folder))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
            .collect();
        names.sort();
        names
    };
    let folders = ["", "docs", "scenes", "tests/references", "tests/peers"];
    let paths = folders.into_iter().flat_map(in_folder).filter(|path| !path.ends_with("CHANGELOG.md"));
    paths.map(|path| Document::new(&repository::name(&path), &fs::read_to_string(&path).unwrap())).collect()
}

impl Document {
    pub(crate) fn new(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), text: text.to_owned() }
    }

    /// Text of the whole document.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Code blocks, inline code and links, each with its line number.
    pub(crate) fn pieces(&self) -> Vec<(usize, Piece)> {
        let mut pieces = Vec::new();
        let mut in_block = false;
        for (event, place) in Parser::new_ext(&self.text, Options::ENABLE_TABLES).into_offset_iter() {
            let piece = match event {
                Event::Start(Tag::CodeBlock(kind)) => {
                    in_block = true;
                    let info = match kind {
                        CodeBlockKind::Fenced(info) => info.to_string(),
                        CodeBlockKind::Indented => String::new(),
                    };
                    Piece::Block { info, text: String::new() }
                }
                Event::End(_) => {
                    in_block = false;
                    continue;
                }
                Event::Text(more) if in_block => {
                    if let Some((_, Piece::Block { text, .. })) = pieces.last_mut() {
                        text.push_str(&more);
                    }
                    continue;
                }
                Event::Code(text) => Piece::Code(text.to_string()),
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    Piece::Link(dest_url.to_string())
                }
                _ => continue,
            };
            let line = 1 + self.text[..place.start].matches('\n').count();
            pieces.push((line, piece));
        }
        pieces
    }

    /// Defect of a link whose target is a missing file.
    pub(crate) fn defect_of_link(&self, target: &str) -> Option<String> {
        let file = target.split('#').next().unwrap_or_default();
        let folder: PathBuf = Path::new(&self.name).parent().unwrap().join(file);
        let is_sound = file.contains("://") || repository::path(&folder).exists();
        (!is_sound).then(|| format!("a link to {}, which does not exist", folder.display()))
    }
}

#[test]
fn a_document_has_blocks_inline_code_and_links() {
    let text = "A `code` of\n[x](y.md#z):\n\n1. In a list:\n\n   ```sh slow\n   a \\\n      b\n   ```\n\n| a |\n|---|\n| `b\\|c` |\n";
    let block = |info: &str, text: &str| Piece::Block { info: info.to_owned(), text: text.to_owned() };
    assert_eq!(
        Document::new("README.md", text).pieces(),
        [
            (1, Piece::Code("code".to_owned())),
            (2, Piece::Link("y.md#z".to_owned())),
            (6, block("sh slow", "a \\\n   b\n")),
            (13, Piece::Code("b|c".to_owned())),
        ]
    );
    assert_eq!(Document::new("README.md", "    indented\n").pieces(), [(1, block("", "indented\n"))]);
}
