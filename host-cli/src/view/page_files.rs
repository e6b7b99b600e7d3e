//! Files of the browser's page, embedded in the program.

/// File of the page.
#[derive(Debug, PartialEq)]
pub(super) struct PageFile {
    name: &'static str,
    /// Media type, for the header `Content-Type`.
    pub(super) kind: &'static str,
    pub(super) text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const DRAWING: &str = "image/svg+xml";
const MANIFEST: &str = "application/manifest+json";

macro_rules! files {
    ($($kind:ident $name:literal),+ $(,)?) => {
        [$(PageFile { name: $name, kind: $kind, text: include_str!(concat!("../../page/", $name)) }),+]
    };
}

static FILES: &[PageFile] = &files![
    HTML "index.html",
    HTML "lend.html",
    STYLE "view.css",
    DRAWING "icon.svg",
    MANIFEST "manifest.webmanifest",
    SCRIPT "bookmarks.js",
    SCRIPT "camera.js",
    SCRIPT "chip.js",
    SCRIPT "compare.js",
    SCRIPT "connection.js",
    SCRIPT "controls.js",
    SCRIPT "display.js",
    SCRIPT "environment.js",
    SCRIPT "exposure.js",
    SCRIPT "fields.js",
    SCRIPT "history.js",
    SCRIPT "host.js",
    SCRIPT "inspector.js",
    SCRIPT "instance.js",
    SCRIPT "lend.js",
    SCRIPT "link.js",
    SCRIPT "local.js",
    SCRIPT "main.js",
    SCRIPT "offline.js",
    SCRIPT "overlay.js",
    SCRIPT "pace.js",
    SCRIPT "panel.js",
    SCRIPT "picture.js",
    SCRIPT "saving.js",
    SCRIPT "soon.js",
    SCRIPT "start.js",
    SCRIPT "status.js",
    SCRIPT "tiles.js",
    SCRIPT "times.js",
    SCRIPT "tone.js",
    SCRIPT "turntable.js",
    SCRIPT "wasi.js",
    SCRIPT "words.js",
    SCRIPT "zip.js",
    SCRIPT "zoom.js",
];

/// Names and texts of the files of a page without the command.
pub(crate) fn pages() -> impl Iterator<Item = (&'static str, &'static str)> {
    // Cards are lent to a command.
    let files = FILES.iter().filter(|file| !file.name.starts_with("lend."));
    files.map(|file| (file.name, file.text))
}

/// Embedded file with this name; `None` if there is none.
pub(super) fn page_file(name: &str) -> Option<&'static PageFile> {
    FILES.iter().find(|file| file.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without this test only browsers would notice a file that the table lacks.
    #[test]
    fn the_table_has_every_file_of_the_page() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        for name in names {
            assert!(page_file(name.to_str().unwrap()).is_some(), "{name:?}");
        }
    }
}
