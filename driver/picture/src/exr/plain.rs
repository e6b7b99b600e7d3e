//! Pictures that no film holds: rows of linear RGB.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage};

use super::ExrError;

/// Encodes a square picture of `size * size` pixels as `OpenEXR`, float samples. `pixels` are rows from the
/// top; those that are missing are black. Equal pixels give equal bytes. `path` is the file's name in errors.
///
/// # Errors
/// If the encoder refuses the picture.
pub fn square_bytes(path: &Path, size: u32, pixels: &[[f32; 3]]) -> Result<Vec<u8>, ExrError> {
    let side = size as usize;
    let at = |Vec2(x, y): Vec2<usize>| {
        let [red, green, blue] = pixels.get(y * side + x).copied().unwrap_or_default();
        (red, green, blue)
    };
    let encoding = Encoding { line_order: exr::prelude::LineOrder::Increasing, ..Encoding::SMALL_LOSSLESS };
    let layer = Layer::new((side, side), LayerAttributes::default(), encoding, SpecificChannels::rgb(at));
    let mut bytes = Cursor::new(Vec::new());
    let written = Image::from_layer(layer).write().to_buffered(&mut bytes);
    written.map_err(|error| ExrError::Encode { path: path.to_owned(), reason: error.to_string() })?;
    Ok(bytes.into_inner())
}
