//! Keys that stand twice in an object of JSON, which glTF does not allow. Readers take either of the values.

use std::collections::HashSet;
use std::fmt::{self, Write as _};

use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// JSON path of the first key that stands twice in an object; `None` if there is none in valid JSON. Contents
/// of `extras` are free.
pub(super) fn first(text: &str) -> Option<String> {
    let mut search = Search::default();
    let mut json = serde_json::Deserializer::from_str(text);
    Within(&mut search).deserialize(&mut json).err().and(search.found)
}

/// The place that is looked at, and the first key that stands twice.
#[derive(Default)]
struct Search {
    path: String,
    found: Option<String>,
}

/// A value at the search's place.
struct Within<'a>(&'a mut Search);

impl<'de> DeserializeSeed<'de> for Within<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<(), D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Within<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("JSON")
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

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        let outer = self.0.path.len();
        for index in 0_usize.. {
            let _ = write!(self.0.path, "[{index}]");
            let next = elements.next_element_seed(Within(&mut *self.0))?;
            self.0.path.truncate(outer);
            if next.is_none() {
                break;
            }
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<(), A::Error> {
        let outer = self.0.path.len();
        let mut keys = HashSet::new();
        while let Some(key) = members.next_key::<String>()? {
            if outer > 0 {
                self.0.path.push('.');
            }
            self.0.path.push_str(&key);
            let is_free = key == "extras";
            if !keys.insert(key) {
                self.0.found = Some(self.0.path.clone());
                return Err(A::Error::custom("a key stands twice"));
            }
            if is_free {
                members.next_value::<IgnoredAny>()?;
            } else {
                members.next_value_seed(Within(&mut *self.0))?;
            }
            self.0.path.truncate(outer);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_the_first_key_that_stands_twice_is_found() {
        for (text, expected) in [
            (r#"{"a": [1, {"b": null}, {"b": -1.5, "c": {"d": "", "d": true}}], "a": 0}"#, Some("a[2].c.d")),
            (r#"{"a": {"b": 1}, "b": [{"b": 1}, {"b": 2}]}"#, None),
            (r#"{"extras": {"b": 1, "b": 2}, "b": 3, "b": 4}"#, Some("b")),
            (r#"[{"x": [[]]}, {"x": 1, "x": 1}]"#, Some("[1].x")),
            (r#"{"a": 1, "a""#, Some("a")),
            (r#"{"a": }"#, None),
        ] {
            assert_eq!(first(text).as_deref(), expected, "{text}");
        }
    }
}
