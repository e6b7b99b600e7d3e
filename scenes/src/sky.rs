//! Clear sky as an equirectangular map: blue at the zenith, bright at the horizon, with a soft sun.
//!
//! The centre of the map is -z and its top is +y, as the option `--environment` of photoncard expects.

use std::io::Cursor;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage, f16};
use glam::Vec3;

const SIZE: [usize; 2] = [128, 64];

/// Radiance at the zenith, at the horizon, and of the ground, W/(sr m^2).
const ZENITH: Vec3 = Vec3::new(0.30, 0.62, 1.40);
const HORIZON: Vec3 = Vec3::new(1.35, 1.50, 1.70);
const GROUND: Vec3 = Vec3::new(0.22, 0.19, 0.15);

/// Direction of the sun, the radiance at its centre, W/(sr m^2), and the angle from the centre at which the
/// radiance has fallen to `1/e`, radians.
const SUN: Vec3 = Vec3::new(-0.55, 0.75, -0.6);
const SUN_RADIANCE: Vec3 = Vec3::new(1100.0, 900.0, 620.0);
const SUN_WIDTH: f32 = 0.06;

fn radiance(direction: Vec3) -> Vec3 {
    if direction.y < 0.0 {
        return GROUND;
    }
    let from_horizon = libm::powf(direction.y, 0.6);
    let angle = libm::acosf(direction.dot(SUN.normalize()).clamp(-1.0, 1.0)) / SUN_WIDTH;
    HORIZON.lerp(ZENITH, from_horizon) + SUN_RADIANCE * libm::expf(-angle * angle)
}

/// Returns the unit direction of the centre of a texel.
fn direction(column: usize, row: usize) -> Vec3 {
    let [u, v] =
        [(column, SIZE[0]), (row, SIZE[1])].map(|(place, count)| (place as f32 + 0.5) / count as f32);
    let (phi, theta) = (core::f32::consts::TAU * (u - 0.5), core::f32::consts::PI * v);
    let (sine, cosine) = (libm::sinf(theta), libm::cosf(theta));
    Vec3::new(sine * libm::sinf(phi), cosine, -sine * libm::cosf(phi))
}

/// Returns the map as an `OpenEXR` file with half-precision samples.
pub(crate) fn sky() -> Vec<u8> {
    let channels = SpecificChannels::rgb(|place: exr::prelude::Vec2<usize>| {
        let [red, green, blue] = radiance(direction(place.x(), place.y())).to_array().map(f16::from_f32);
        (red, green, blue)
    });
    // The file is not compressed, so that its bytes do not depend on the version of a compressor.
    let layer = Layer::new((SIZE[0], SIZE[1]), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .expect("a small picture in memory");
    bytes.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_map_is_minus_z_and_the_right_half_is_plus_x() {
        let [width, height] = SIZE;
        assert!(direction(width / 2, height / 2).dot(Vec3::NEG_Z) > 0.998);
        assert!(direction(width * 3 / 4, height / 2).x > 0.998);
        assert!(direction(0, 0).y > 0.998);
    }
}
