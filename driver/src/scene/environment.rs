//! Light from infinitely far.

use glam::Vec3;

/// Radiance from infinitely far, W/(sr m^2) per linear RGB channel: an equirectangular map, constant if it is 1 x 1.
///
/// Column u, 0 to 1 from the left, and row v, 0 to 1 from the top, show the direction
/// `(sin(theta) sin(phi), cos(theta), -sin(theta) cos(phi))` with `phi = 2 pi (u - 0.5)` and `theta = pi v`: y is up, and
/// the middle of the map is -z, where a camera of glTF looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Texels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rows from the top. Finite, and 0 or more.
    pub texels: Vec<[f32; 3]>,
}

impl Environment {
    /// The same radiance from everywhere.
    pub fn constant(radiance: Vec3) -> Self {
        Self { width: 1, height: 1, texels: vec![radiance.to_array()] }
    }

    /// Whether any light comes from it.
    pub fn is_lit(&self) -> bool {
        self.texels.iter().flatten().any(|radiance| *radiance > 0.0)
    }
}
