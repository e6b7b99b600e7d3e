//! Values of this renderer in `extras`, under the key `photoncard`. Other keys belong to other programs.

use gltf::json::Extras;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

#[derive(Deserialize)]
struct Keys {
    photoncard: Option<Map<String, Value>>,
}

/// Reads the value of the key `photoncard`; `None` if there is none.
///
/// # Errors
/// The reason, if the value is not a `T`.
pub(super) fn read<T: DeserializeOwned>(extras: &Extras) -> Result<Option<T>, String> {
    // `extras` may be of any type; only an object can hold the key.
    let Some(text) = extras.as_ref().map(|extras| extras.get()) else { return Ok(None) };
    if !text.trim_start().starts_with('{') {
        return Ok(None);
    }
    // The message's line and column refer to `extras`, not to the file, and are cut off.
    let reason =
        |error: serde_json::Error| error.to_string().split(" at line ").next().unwrap_or_default().to_owned();
    let keys: Keys = serde_json::from_str(text).map_err(reason)?;
    keys.photoncard.map(|values| serde_json::from_value(Value::Object(values)).map_err(reason)).transpose()
}
