//! Values of this renderer in `extras`, under the key `photoncard`. Other keys belong to other programs.

use gltf::json::Extras;
use serde::Deserialize;
use serde::de::DeserializeOwned;

#[derive(Deserialize)]
#[serde(bound = "T: DeserializeOwned")]
struct Keys<T> {
    photoncard: Option<T>,
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
    let keys: Keys<T> = serde_json::from_str(text).map_err(|error| {
        // The message's line and column refer to `extras`, not to the file, and are cut off.
        error.to_string().split(" at line ").next().unwrap_or_default().to_owned()
    })?;
    Ok(keys.photoncard)
}
