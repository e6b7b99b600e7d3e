//! Upper bound of the memory of a parsed JSON text, computed before parsing.
//!
//! Two characters may become a material of hundreds of bytes. The text is scanned without being stored. Each
//! value counts as the largest value of its kind, in the types of the `gltf` crate and in the loader's, times
//! two, as lists grow by doubling.

use std::cell::{Cell, OnceCell};
use std::fmt;

use glam::DMat4;
use gltf::json;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::specular_glossiness::Conversion;
use crate::{Camera, Material};

/// Maximum number of bytes of memory per byte of JSON.
pub(super) const BYTES_OF_A_BYTE: u64 = 32;

/// Number of bytes of memory that any JSON may take.
pub(super) const BYTES_OF_ANY: u64 = 256 << 20;

/// Bytes of a value in a list that is not a list of the root: twice the maximum, `serde_json::Value`.
const VALUE: u64 = 64;

/// Bytes of an object that is not in a list of the root: a node of a `BTreeMap` with one key, or a primitive.
const OBJECT: u64 = 640;

/// Maximum memory of the parsed text, bytes.
pub(super) fn limit(text: &str) -> u64 {
    BYTES_OF_ANY + BYTES_OF_A_BYTE * text.len() as u64
}

/// Estimated memory of the parsed text, bytes; `None` above [`limit`]. If the text is no JSON, only values
/// before the first error count.
pub(super) fn estimate(text: &str) -> Option<u64> {
    let (count, limit) = (Cell::new(0), limit(text));
    let root = Value { kind: Kind::Root, count: &count, limit };
    let _ = root.deserialize(&mut serde_json::Deserializer::from_str(text));
    Some(count.get()).filter(|count| *count <= limit)
}

/// Bytes of an element of a list of the root, including the loader's data, times two.
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
    /// A value of the root. If it is a list, each of its elements counts this number of bytes.
    List(u64),
    /// An element of a list of the root, which is counted by its list.
    Element,
    Other,
}

/// Visitor that counts a value without storing it.
struct Value<'c> {
    kind: Kind,
    count: &'c Cell<u64>,
    limit: u64,
}

impl Value<'_> {
    fn inside(&self, kind: Kind) -> Self {
        Self { kind, ..*self }
    }

    fn add<E: Error>(&self, bytes: u64) -> Result<(), E> {
        self.count.set(self.count.get() + bytes);
        if self.count.get() <= self.limit { Ok(()) } else { Err(E::custom("more than the limit")) }
    }
}

impl<'de> DeserializeSeed<'de> for Value<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Value<'_> {
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
        self.add(text.len() as u64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let (kind, bytes) = match self.kind {
            Kind::List(bytes) => (Kind::Element, bytes),
            _ => (Kind::Other, VALUE),
        };
        while list.next_element_seed(self.inside(kind))?.is_some() {
            self.add(bytes)?;
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut is_counted = matches!(self.kind, Kind::Root | Kind::Element);
        while let Some(bytes) = map.next_key_seed(Key)? {
            if !std::mem::replace(&mut is_counted, true) {
                self.add(OBJECT)?;
            }
            self.add(VALUE)?;
            let kind = if matches!(self.kind, Kind::Root) { Kind::List(bytes) } else { Kind::Other };
            map.next_value_seed(self.inside(kind))?;
        }
        Ok(())
    }
}

/// Visitor of a key of the root; returns the bytes per element of the list of this name.
struct Key;

impl<'de> DeserializeSeed<'de> for Key {
    type Value = u64;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<u64, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Key {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, name: &str) -> Result<u64, E> {
        Ok(element(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(name: &str, element: &str, count: usize) -> String {
        format!("{{\"{name}\": [{}]}}", vec![element; count].join(","))
    }

    #[test]
    fn lists_of_next_to_nothing_are_refused() {
        for (name, element) in
            [("materials", "{}"), ("nodes", "{}"), ("accessors", "{}"), ("extras", "{\"\":{\"\":0}}")]
        {
            assert!(estimate(&list(name, element, 1000)).is_some(), "{name}");
            assert_eq!(estimate(&list(name, element, 1_000_000)), None, "{name}");
        }
    }

    #[test]
    fn lists_as_exporters_write_them_pass() {
        let node = r#"{"mesh":12345,"name":"Wall.12345","translation":[1.25,0.5,-3.75]}"#;
        let accessor = r#"{"bufferView":1234,"componentType":5126,"count":240,"max":[1.5,1,1],"min":[-1,-1,-1.5],"type":"VEC3"}"#;
        let mesh = r#"{"name":"Wall.12345","primitives":[{"attributes":{"NORMAL":123456,"POSITION":123457,"TEXCOORD_0":12345},"indices":12345,"material":12}]}"#;
        for (name, element) in [("nodes", node), ("accessors", accessor), ("meshes", mesh)] {
            let text = list(name, element, 500_000);
            assert!(estimate(&text).is_some_and(|bytes| bytes < limit(&text) * 3 / 4), "{name}");
        }
    }

    #[test]
    fn a_text_that_is_no_json_counts_up_to_its_fault() {
        assert_eq!(estimate("{\"a\": [1, 2, nonsense"), Some(3 * VALUE));
        assert_eq!(estimate(""), Some(0));
    }
}
