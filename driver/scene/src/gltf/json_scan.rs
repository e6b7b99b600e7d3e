//! Scans a JSON text in one pass before it is parsed, without storing values.
//!
//! The scan bounds the memory of the parsed text, because two characters may become a material of hundreds of
//! bytes. Each value counts as twice the size of the largest type for its kind in the `gltf` crate and the
//! loader, because lists grow by doubling. The scan also finds repeated keys of an object. glTF forbids
//! repeated keys, and parsers differ in which value they take.
//!
//! A parser skips values that it does not need, whatever they are: numbers beyond the range of floats, lone
//! surrogates, any depth. The scan skips them too: it only splits the text into tokens, and never fails. Its
//! result is right for valid JSON; parsing finds whether the text is valid.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::fmt::Write as _;
use std::ops::Range;

use glam::DMat4;
use gltf::json;

use super::specular_glossiness::Conversion;
use crate::{Camera, Material};

/// Maximum number of bytes of memory per byte of JSON, in addition to [`BYTES_OF_ANY`].
pub(super) const BYTES_OF_A_BYTE: u64 = 32;

/// Memory that the parsed form of even the shortest JSON may take, bytes.
pub(super) const BYTES_OF_ANY: u64 = 256 << 20;

/// Estimated memory of a value outside the root's lists, bytes: twice the size of the largest type of a
/// value, `serde_json::Value`.
const VALUE: u64 = 64;

/// Estimated memory of an object outside the root's lists, bytes: a node of a `BTreeMap` with one key, or a
/// primitive.
const OBJECT: u64 = 640;

/// Maximum number of characters of a key in a message.
const SHOWN: usize = 80;

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Scanned {
    /// Estimated memory of the parsed text, bytes.
    pub(super) bytes: u64,
    /// JSON path of the first repeated key of an object. Keys in `extras` may repeat.
    pub(super) repeated_key: Option<String>,
    /// Byte ranges of the values of `extras`, without `extras` inside of other `extras`.
    pub(super) extras: Vec<Range<usize>>,
}

/// Maximum memory of the parsed text, bytes.
pub(super) fn limit(text: &str) -> u64 {
    BYTES_OF_ANY + BYTES_OF_A_BYTE * text.len() as u64
}

/// Scans a text; `None` if its estimated memory exceeds [`limit`].
pub(super) fn scan(text: &str) -> Option<Scanned> {
    let (limit, bytes) = (limit(text), text.as_bytes());
    let mut scan = Scan::default();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let start = at;
        at += 1;
        match byte {
            b'{' | b'[' => scan.open(byte == b'{', start),
            b'}' | b']' => scan.close(at),
            b',' => scan.separate(),
            b'"' => {
                let end = end_of_string(bytes, at);
                scan.string(&text[at..end], start, end + 1);
                at = end + 1;
            }
            b':' | b' ' | b'\t' | b'\r' | b'\n' => {}
            _ => {
                let is_end = |byte: &u8| matches!(byte, b',' | b'}' | b']' | b' ' | b'\t' | b'\r' | b'\n');
                at += bytes[at..].iter().position(is_end).unwrap_or(bytes.len() - at);
                scan.begin_value(start);
                scan.end_value(at);
            }
        }
        if scan.bytes > limit {
            return None;
        }
    }
    let Scan { bytes, repeated_key, extras, .. } = scan;
    Some(Scanned { bytes, repeated_key, extras })
}

/// Index of the quotation mark that ends the string whose text begins at `at`, or the length of the whole
/// text if none does.
fn end_of_string(bytes: &[u8], mut at: usize) -> usize {
    while let Some(byte) = bytes.get(at) {
        match byte {
            b'"' => break,
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
    at.min(bytes.len())
}

/// Estimated memory of an element of the root's member `list`, bytes: twice the size of its types in the
/// `gltf` crate and the loader.
fn element(list: &str) -> u64 {
    let placed =
        size_of::<(usize, DMat4)>() + size_of::<Option<DMat4>>() + size_of::<(usize, DMat4, usize)>();
    let bytes = match list {
        "accessors" => size_of::<json::Accessor>(),
        "animations" => size_of::<json::Animation>(),
        "buffers" => size_of::<json::Buffer>(),
        "bufferViews" => size_of::<json::buffer::View>() + size_of::<OnceCell<Vec<u8>>>(),
        "cameras" => size_of::<json::Camera>() + size_of::<Camera>(),
        "images" => size_of::<json::Image>(),
        // A converted material has two images and textures of its own.
        "materials" => {
            let converted =
                size_of::<json::Image>() + size_of::<json::Texture>() + size_of::<(usize, Conversion)>();
            size_of::<json::Material>() + size_of::<Material>() + 2 * converted
        }
        "meshes" => size_of::<json::Mesh>(),
        "nodes" => size_of::<json::Node>() + placed,
        "samplers" => size_of::<json::texture::Sampler>(),
        "scenes" => size_of::<json::Scene>(),
        "skins" => size_of::<json::Skin>(),
        "textures" => size_of::<json::Texture>(),
        _ => return VALUE,
    };
    2 * bytes as u64
}

/// Position of a value in the JSON document, by which its memory is estimated.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Root,
    /// Member of the root object. If the member is a list, the number is the estimated memory of each of its
    /// elements, bytes.
    List(u64),
    /// Element of a list that is a member of the root object. Its memory is counted when it begins, so that
    /// its first key does not add [`OBJECT`].
    Element,
    Other,
}

/// Object or list that encloses the current position.
struct Frame {
    kind: Kind,
    /// Index in [`Scan::keys`] of an object's first key; `None` for a list.
    first_key: Option<usize>,
    /// Number of the object's keys, or of the list's elements, so far.
    count: usize,
    /// True if the next string is a key.
    expects_key: bool,
}

#[derive(Default)]
struct Scan<'t> {
    bytes: u64,
    frames: Vec<Frame>,
    /// Keys of the objects that enclose the current position, the outermost first.
    keys: Vec<Cow<'t, str>>,
    /// Byte index of the value of the outermost enclosing `extras`, and the number of frames around it;
    /// `None` outside of `extras`.
    free: Option<(usize, usize)>,
    repeated_key: Option<String>,
    extras: Vec<Range<usize>>,
}

impl<'t> Scan<'t> {
    fn open(&mut self, is_object: bool, start: usize) {
        let kind = self.begin_value(start);
        let first_key = is_object.then_some(self.keys.len());
        self.frames.push(Frame { kind, first_key, count: 0, expects_key: is_object });
    }

    fn close(&mut self, end: usize) {
        let Some(Frame { first_key, .. }) = self.frames.pop() else { return };
        if let Some(first) = first_key {
            self.end_object(first);
        }
        self.end_value(end);
    }

    fn separate(&mut self) {
        if let Some(frame) = self.frames.last_mut() {
            frame.expects_key = frame.first_key.is_some();
        }
    }

    /// Processes a string, which is a key or a value. Its opening quotation mark is byte `start`; its closing
    /// one is the byte before `end`.
    fn string(&mut self, text: &'t str, start: usize, end: usize) {
        match self.frames.last_mut().filter(|frame| frame.expects_key) {
            Some(frame) => {
                frame.expects_key = false;
                let is_counted = frame.count > 0 || matches!(frame.kind, Kind::Root | Kind::Element);
                self.bytes += if is_counted { VALUE } else { VALUE + OBJECT };
                frame.count += 1;
                self.keys.push(unescaped(text));
            }
            None => {
                self.begin_value(start);
                self.bytes += text.len() as u64;
                self.end_value(end);
            }
        }
    }

    /// Counts a value that begins at byte `start`, and returns its position in the document.
    fn begin_value(&mut self, start: usize) -> Kind {
        let depth = self.frames.len();
        let Some(frame) = self.frames.last_mut() else { return Kind::Root };
        if frame.first_key.is_some() {
            let key = self.keys.last().map_or("", |key| key);
            if key == "extras" {
                self.free.get_or_insert((start, depth));
            }
            return if frame.kind == Kind::Root { Kind::List(element(key)) } else { Kind::Other };
        }
        frame.count += 1;
        let (kind, bytes) = match frame.kind {
            Kind::List(bytes) => (Kind::Element, bytes),
            _ => (Kind::Other, VALUE),
        };
        self.bytes += bytes;
        kind
    }

    fn end_value(&mut self, end: usize) {
        if let Some((start, _)) = self.free.take_if(|(_, depth)| *depth == self.frames.len()) {
            self.extras.push(start..end);
        }
    }

    /// Removes the keys of an object, the first of which has the index `first`. Stores the path of a repeated
    /// key.
    fn end_object(&mut self, first: usize) {
        if self.free.is_none() && self.repeated_key.is_none() {
            let keys = &mut self.keys[first..];
            keys.sort_unstable();
            let twice = keys.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0].clone());
            self.repeated_key = twice.map(|key| self.path_to(&key, first));
        }
        self.keys.truncate(first);
    }

    /// JSON path of a key of the object that was closed last. `first` is the index of the object's first key.
    fn path_to(&self, key: &str, first: usize) -> String {
        let mut path = String::new();
        // In `keys` the last key of each open object precedes the first key of the next inner object.
        let mut ends = self.frames.iter().filter_map(|frame| frame.first_key).skip(1).chain([first]);
        for frame in &self.frames {
            if frame.first_key.is_none() {
                let _ = write!(path, "[{}]", frame.count.saturating_sub(1));
            } else if let Some(end) = ends.next() {
                append(&mut path, self.keys.get(end.saturating_sub(1)).map_or("", |key| key));
            }
        }
        append(&mut path, key);
        path
    }
}

/// Appends a key to a JSON path.
fn append(path: &mut String, key: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.extend(key.chars().take(SHOWN));
    if key.chars().nth(SHOWN).is_some() {
        path.push('…');
    }
}

/// Key without escapes. A key with a lone surrogate, which is no text, stays as it is written.
fn unescaped(key: &str) -> Cow<'_, str> {
    if !key.contains('\\') {
        return key.into();
    }
    serde_json::from_str::<String>(&format!("\"{key}\"")).map_or(key.into(), Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(name: &str, element: &str, count: usize) -> String {
        format!("{{\"{name}\": [{}]}}", vec![element; count].join(","))
    }

    #[test]
    fn lists_of_short_elements_are_refused() {
        for (name, element) in
            [("materials", "{}"), ("nodes", "{}"), ("accessors", "{}"), ("extras", "{\"\":{\"\":0}}")]
        {
            assert!(scan(&list(name, element, 1000)).is_some(), "{name}");
            assert_eq!(scan(&list(name, element, 1_000_000)), None, "{name}");
        }
    }

    #[test]
    fn lists_as_exporters_write_them_pass() {
        let node = r#"{"mesh":12345,"name":"Wall.12345","translation":[1.25,0.5,-3.75]}"#;
        let accessor = r#"{"bufferView":1234,"componentType":5126,"count":240,"max":[1.5,1,1],"min":[-1,-1,-1.5],"type":"VEC3"}"#;
        let mesh = r#"{"name":"Wall.12345","primitives":[{"attributes":{"NORMAL":123456,"POSITION":123457,"TEXCOORD_0":12345},"indices":12345,"material":12}]}"#;
        for (name, element) in [("nodes", node), ("accessors", accessor), ("meshes", mesh)] {
            let text = list(name, element, 500_000);
            assert!(scan(&text).is_some_and(|scanned| scanned.bytes < limit(&text) * 3 / 4), "{name}");
        }
    }

    #[test]
    fn a_text_that_is_no_json_is_scanned_without_fail() {
        let bytes = |text: &str| scan(text).unwrap().bytes;
        assert_eq!((bytes("{\"a\": [1, 2, nonsense"), bytes("")), (4 * VALUE, 0));
        for text in ["}", "]]", "\"", "\"\\", "{,,{", "[}", "{\"a\"", ":", "{]\"a\"", "ä", "{\"ä\":é"] {
            assert!(scan(text).is_some(), "{text}");
        }
    }

    /// Values that a parser skips precede contents that the scan must find.
    #[test]
    fn no_value_ends_a_scan() {
        let deep = "[".repeat(1000) + &"]".repeat(1000);
        for value in ["1e999", r#""\ud800""#, r#"{"\ud800": 1}"#, &deep, "-1.5e-7", "true"] {
            let text = format!(r#"{{"extras": {value}, "b": {{"c": {value}, "d": 1, "d": 2}}}}"#);
            let scanned = scan(&text).unwrap();
            assert_eq!(scanned.repeated_key.as_deref(), Some("b.d"), "{text}");
            assert_eq!(scanned.extras.len(), 1);
            assert_eq!(&text[scanned.extras[0].clone()], value);
            let bomb = format!(r#"{{"v": {value}, "materials": [{}]}}"#, vec!["{}"; 1_000_000].join(","));
            assert_eq!(scan(&bomb), None, "{value}");
        }
    }

    #[test]
    fn the_path_of_a_repeated_key_is_found() {
        let long = format!(r#"{{"{0}": 1, "{0}": 2}}"#, "k".repeat(5000));
        let shown = "k".repeat(80) + "…";
        for (text, expected) in [
            (r#"{"a": [1, {"b": null}, {"b": -1.5, "c": {"d": "", "d": true}}]}"#, Some("a[2].c.d")),
            (r#"{"z": 0, "a": {"b": 1}, "b": [{"b": 1}, {"b": 2}]}"#, None),
            (r#"{"z": 0, "a": {"y": 1, "b": [[0, {"x": 1, "x": 1}]]}}"#, Some("a.b[0][1].x")),
            (r#"{"extras": {"b": 1, "b": [{"c": 1, "c": 1}]}, "b": 3, "b": 4}"#, Some("b")),
            (r#"{"a": {"extras": {"extras": 1, "b": 1, "b": 2}}, "extras": [{"b": 1, "b": 2}]}"#, None),
            (r#"[{"x": [[]]}, {"x": 1, "\u0078": 1}]"#, Some("[1].x")),
            (r#"{"a": {"z": "\"", "b": 2, "z": 3}, "c""#, Some("a.z")),
            (r#"{"a": 1, "b": {"a": 2}}"#, None),
            (&long, Some(&shown)),
        ] {
            assert_eq!(scan(text).unwrap().repeated_key.as_deref(), expected, "{text}");
        }
    }
}
