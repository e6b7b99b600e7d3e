//! Size limit of environment maps.

use std::fmt::Display;

use super::raster::{Fault, check_size};
use super::texture::MAX_SIDE;

/// Maximum number of texels of an environment. A texel takes 12 bytes of the host's memory and 4 bytes of the
/// card's.
pub const MAX_ENVIRONMENT_TEXELS: u64 = 1 << 26;

/// Checks a map's size against the limits.
pub(super) fn check_map_size(size: [u32; 2]) -> Result<(), Fault> {
    let [width, height] = size.map(u64::from);
    let is_too_large =
        size.into_iter().any(|side| side > MAX_SIDE) || width * height > MAX_ENVIRONMENT_TEXELS;
    if is_too_large { Err(too_large(size)) } else { check_size(size) }
}

pub(super) fn too_large([width, height]: [impl Display; 2]) -> Fault {
    let reason = format!(
        "the map has {width} x {height} texels, more than {MAX_SIDE} a side or {MAX_ENVIRONMENT_TEXELS} in all"
    );
    Fault { reason, remedy: "scale the map down to 8192 x 4096 texels or less", is_limit: true }
}
