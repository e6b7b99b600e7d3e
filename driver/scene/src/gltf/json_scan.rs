//! Scans a JSON text in one pass before it is parsed, without storing values.
//!
//! The scan bounds the memory of the parsed text, because two characters may become a material of hundreds of
//! bytes. Each value counts as the largest value of its kind, in the types of the `gltf` crate and of the
//! loader, times two because lists grow by doubling. The scan also finds repeated keys of an object. glTF
//! forbids them, and parsers differ in which value they take.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::fmt::{self, Write as _};

use glam::DMat4;
use gltf::json;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::specular_glossiness::Conversion;
use crate::{Camera, Material};

/// Maximum number of bytes of memory per byte of JSON.
pub(super) const BYTES_OF_A_BYTE: u64 = 32;

/// Memory that the parsed form of any JSON may take, however short, bytes.
pub(super) const BYTES_OF_ANY: u64 = 256 << 20;

/// Estimated memory of a value outside the root's lists, bytes: twice the size of the largest,
/// `serde_json::Value`.
const VALUE: u64 = 64;

/// Estimated memory of an object outside the root's lists, bytes: a node of a `BTreeMap` with one key, or a
/// primitive.
const OBJECT: u64 = 640;

/// Result of a scan. It covers the text before the first syntax error.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Scanned {
    /// Estimated memory of the parsed text, bytes.
    pub(super) bytes: u64,
    /// JSON path of the first repeated key of an object. Keys in `extras` may repeat.
    pub(super) repeated_key: Option<String>,
}

/// Maximum memory of the parsed text, bytes.
pub(super) fn limit(text: &str) -> u64 {
    BYTES_OF_ANY + BYTES_OF_A_BYTE * text.len() as u64
}

/// Scans a text; `None` if its estimated memory exceeds [`limit`].
pub(super) fn scan(text: &str) -> Option<Scanned> {
    let limit = limit(text);
    let mut scan = Scan { bytes: 0, limit, keys: Vec::new(), path: Vec::new(), repeated_key: None };
    let root = Value { kind: Kind::Root, is_free: false, scan: &mut scan };
    let _ = root.deserialize(&mut serde_json::Deserializer::from_str(text));
    let Scan { bytes, repeated_key, .. } = scan;
    (bytes <= limit).then_some(Scanned { bytes, repeated_key })
}

/// Estimated memory of an element of a list of the root, bytes: twice that of the `gltf` crate's and the
/// loader's data.
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

/// Position of a value in the document.
#[derive(Clone, Copy)]
enum Kind {
    Root,
    /// Member of the root. If it is a list, each element counts this number of bytes.
    List(u64),
    /// An element of a list of the root, which is counted by its list.
    Element,
    Other,
}

/// Step of a JSON path.
enum Step<'t> {
    Key(Cow<'t, str>),
    Index(usize),
}

struct Scan<'t> {
    bytes: u64,
    limit: u64,
    /// Keys of the objects that enclose the current position, the outermost first.
    keys: Vec<Cow<'t, str>>,
    path: Vec<Step<'t>>,
    repeated_key: Option<String>,
}

impl Scan<'_> {
    fn add<E: Error>(&mut self, bytes: u64) -> Result<(), E> {
        self.bytes += bytes;
        if self.bytes <= self.limit { Ok(()) } else { Err(E::custom("more than the limit")) }
    }

    /// Removes the keys of the current object, which start at index `first`, and records a repeated one.
    fn end_object(&mut self, first: usize, is_free: bool) {
        let keys = &mut self.keys[first..];
        if !is_free && self.repeated_key.is_none() {
            keys.sort_unstable();
            let twice = keys.windows(2).find(|pair| pair[0] == pair[1]);
            self.repeated_key = twice.map(|pair| at(&self.path, &pair[0]));
        }
        self.keys.truncate(first);
    }
}

/// JSON path of a key of the object at `path`.
fn at(path: &[Step], key: &str) -> String {
    let mut text = String::new();
    for step in path {
        let _ = match step {
            Step::Key(key) => write!(text, "{}{key}", if text.is_empty() { "" } else { "." }),
            Step::Index(index) => write!(text, "[{index}]"),
        };
    }
    if !text.is_empty() {
        text.push('.');
    }
    text + key
}

/// Visitor of a value. `is_free` is true in `extras`.
struct Value<'s, 't> {
    kind: Kind,
    is_free: bool,
    scan: &'s mut Scan<'t>,
}

impl<'t> Value<'_, 't> {
    fn inside(&mut self, kind: Kind, is_free: bool) -> Value<'_, 't> {
        Value { kind, is_free: is_free || self.is_free, scan: self.scan }
    }
}

impl<'t> DeserializeSeed<'t> for Value<'_, 't> {
    type Value = ();

    fn deserialize<D: Deserializer<'t>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'t> Visitor<'t> for Value<'_, 't> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        self.scan.add(text.len() as u64)
    }

    fn visit_seq<A: SeqAccess<'t>>(mut self, mut list: A) -> Result<(), A::Error> {
        let (kind, bytes) = match self.kind {
            Kind::List(bytes) => (Kind::Element, bytes),
            _ => (Kind::Other, VALUE),
        };
        for index in 0.. {
            self.scan.path.push(Step::Index(index));
            let next = list.next_element_seed(self.inside(kind, false))?;
            self.scan.path.pop();
            if next.is_none() {
                break;
            }
            self.scan.add(bytes)?;
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'t>>(mut self, mut map: A) -> Result<(), A::Error> {
        let mut is_counted = matches!(self.kind, Kind::Root | Kind::Element);
        let first = self.scan.keys.len();
        while let Some(key) = map.next_key_seed(Key)? {
            if !std::mem::replace(&mut is_counted, true) {
                self.scan.add(OBJECT)?;
            }
            self.scan.add(VALUE)?;
            let kind = match self.kind {
                Kind::Root => Kind::List(element(&key)),
                _ => Kind::Other,
            };
            let is_free = key == "extras";
            self.scan.keys.push(key.clone());
            self.scan.path.push(Step::Key(key));
            map.next_value_seed(self.inside(kind, is_free))?;
            self.scan.path.pop();
        }
        self.scan.end_object(first, self.is_free);
        Ok(())
    }
}

/// Visitor of a key, which is borrowed from the text unless it has escapes.
struct Key;

impl<'t> DeserializeSeed<'t> for Key {
    type Value = Cow<'t, str>;

    fn deserialize<D: Deserializer<'t>>(self, deserializer: D) -> Result<Cow<'t, str>, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'t> Visitor<'t> for Key {
    type Value = Cow<'t, str>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_borrowed_str<E>(self, key: &'t str) -> Result<Cow<'t, str>, E> {
        Ok(key.into())
    }

    fn visit_str<E>(self, key: &str) -> Result<Cow<'t, str>, E> {
        Ok(key.to_owned().into())
    }
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
    fn invalid_json_counts_up_to_its_first_error() {
        let bytes = |text: &str| scan(text).unwrap().bytes;
        assert_eq!((bytes("{\"a\": [1, 2, nonsense"), bytes("")), (3 * VALUE, 0));
    }

    #[test]
    fn the_path_of_a_repeated_key_is_found() {
        for (text, expected) in [
            (r#"{"a": [1, {"b": null}, {"b": -1.5, "c": {"d": "", "d": true}}]}"#, Some("a[2].c.d")),
            (r#"{"a": {"b": 1}, "b": [{"b": 1}, {"b": 2}]}"#, None),
            (r#"{"extras": {"b": 1, "b": [{"c": 1, "c": 1}]}, "b": 3, "b": 4}"#, Some("b")),
            (r#"[{"x": [[]]}, {"x": 1, "\u0078": 1}]"#, Some("[1].x")),
            (r#"{"a": {"z": 1, "b": 2, "z": 3}, "c""#, Some("a.z")),
            (r#"{"a": 1, "b": {"a": 2}}"#, None),
        ] {
            assert_eq!(scan(text).unwrap().repeated_key.as_deref(), expected, "{text}");
        }
    }
}
