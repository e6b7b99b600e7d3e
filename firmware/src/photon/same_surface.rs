//! Test, by the normals, whether a photon lies on a given surface.

use glam::Vec3;
use photoncard_shared::layout::{decode_normal, normal_class};

/// Minimum cosine between a photon's normal and a surface's normal. Below it, the photon is assumed to lie on
/// another surface.
pub const MIN_NORMAL_COSINE: f32 = 0.75;

/// Number of one-byte codes of a normal.
const CODES: usize = 256;

/// Unit normal of each one-byte code.
#[expect(clippy::indexing_slicing, reason = "computed at compile time")]
static NORMALS: [Vec3; CODES] = {
    let mut normals = [Vec3::ZERO; CODES];
    let mut code = 0;
    while code < CODES {
        normals[code] = computed_normal(code as u8);
        code += 1;
    }
    normals
};

/// Unit normal of a code, with the rounding of [`unit`](crate::vector::unit).
const fn computed_normal(code: u8) -> Vec3 {
    let [x, y, z] = decode_normal(code);
    let inverse = 1.0 / root(x * x + y * y + z * z);
    Vec3::new(x * inverse, y * inverse, z * inverse)
}

/// For each code of a surface's normal, a bit mask of classes of normals ([`normal_class`]): the classes of
/// all photon normals whose cosine to the surface's normal is at least [`MIN_NORMAL_COSINE`].
#[expect(clippy::indexing_slicing, reason = "computed at compile time")]
static CLASSES: [u16; CODES] = {
    let mut classes = [0; CODES];
    let mut pair = 0;
    while pair < CODES * CODES {
        let (code, other) = (pair / CODES, pair % CODES);
        let ([a, b, c], [x, y, z]) = (NORMALS[code].to_array(), NORMALS[other].to_array());
        if a * x + b * y + c * z >= MIN_NORMAL_COSINE {
            classes[code] |= 1 << normal_class(other as u8);
        }
        pair += 1;
    }
    classes
};

/// Unit normal of a code.
#[inline(always)]
pub(super) fn unit_normal(code: u8) -> Vec3 {
    NORMALS.get(usize::from(code)).copied().unwrap_or_default()
}

/// Correctly rounded square root of a number from 1/3 to 2, by Newton's method in `f64`.
const fn root(square: f32) -> f32 {
    let square = square as f64;
    let (mut root, mut step) = (1.0, 0);
    while step < 6 {
        root = 0.5 * (root + square / root);
        step += 1;
    }
    root as f32
}

/// Test whether photons lie on a given surface. The last result is cached, because consecutive photons mostly
/// have equal normals.
pub struct SameSurface {
    normal: Vec3,
    /// Code of the last normal tested, and its cosine to `normal`.
    last: (u8, f32),
    /// Number of normals decoded so far.
    decoded: u32,
}

impl SameSurface {
    /// Creates the test for a surface whose normal has this code.
    #[inline(always)]
    pub fn new(code: u8) -> Self {
        let normal = unit_normal(code);
        Self { normal, last: (code, normal.dot(normal)), decoded: 0 }
    }

    /// Bit mask of the classes ([`normal_class`]) of all photon normals that [`Self::holds`] accepts for a
    /// surface whose normal has this code.
    #[inline(always)]
    pub(super) fn classes(code: u8) -> u16 {
        CLASSES.get(usize::from(code)).copied().unwrap_or_default()
    }

    /// Number of normals decoded so far.
    #[inline(always)]
    pub(super) fn decoded(&self) -> u32 {
        self.decoded
    }

    /// Returns true if a photon whose normal has this code lies on the surface.
    #[inline(always)]
    pub fn holds(&mut self, code: u8) -> bool {
        self.cosine(code) >= MIN_NORMAL_COSINE
    }

    /// Cosine between the surface's normal and the normal that has this code.
    #[inline(always)]
    pub(super) fn cosine(&mut self, code: u8) -> f32 {
        if self.last.0 != code {
            self.decoded += 1;
            self.last = (code, unit_normal(code).dot(self.normal));
        }
        self.last.1
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::layout::encode_normal;

    use super::*;
    use crate::vector::unit;

    #[test]
    fn the_table_has_the_unit_normal_of_each_code() {
        for code in 0..=u8::MAX {
            assert_eq!(unit_normal(code), unit(decode_normal(code).into()), "{code}");
        }
    }

    #[test]
    fn classes_contain_each_normal_of_the_surface() {
        for code in 0..=u8::MAX {
            let mut surface = SameSurface::new(code);
            let held = (0..=u8::MAX).filter(|&other| surface.holds(other));
            let classes = held.fold(0, |classes, other| classes | 1 << normal_class(other));
            assert_eq!(SameSurface::classes(code), classes, "{code}");
        }
    }

    #[test]
    fn a_floor_is_of_other_classes_than_its_walls() {
        let class = |normal| 1 << normal_class(encode_normal(normal));
        let of_floor = SameSurface::classes(encode_normal([0.0, 0.0, 1.0]));
        assert_ne!(of_floor & class([0.0, 0.0, 1.0]), 0);
        for wall in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]] {
            assert_eq!(of_floor & class(wall), 0, "{wall:?}");
        }
    }
}
