//! Sampling of distant (directional) lights, in proportion to their irradiance. A light with a spread, such
//! as the sun, comes from a disk of uniform radiance.

use core::f32::consts::TAU;

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{DistantLight, Record};
use photoncard_shared::message::Fault;

use super::choice::{Fraction, choose};
use super::sample::LightSample;
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::vector::{about, max, sqrt, unit};

const LIGHTS_PER_LINE: u32 = DistantLight::PER_LINE as u32;

/// Unit vector in the disk of a distant light around the unit vector `axis`, by the point `(u, v)` of the
/// unit square: uniform in solid angle. `spread` is 1 minus the cosine of the disk's half angle. With a
/// spread of 0 it is `axis`.
pub fn disk_direction(axis: Vec3, spread: f32, [u, v]: [f32; 2]) -> Vec3 {
    if spread <= 0.0 {
        return axis;
    }
    // 1 minus the cosine of the angle to the axis: the sine follows without cancellation.
    let height = u * spread;
    let sine = sqrt(max(height * (2.0 - height), 0.0));
    unit(about(axis, TAU * v, sine, 1.0 - height))
}

/// Chooses a distant light by the random number `across`, and a direction in its disk by the rest of it and
/// by `down`. `share` is the probability with which the caller has chosen the distant lights among all
/// lights.
pub(super) fn sample(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    share: f32,
    [across, down]: [Fraction; 2],
) -> Result<LightSample, Fault> {
    let kind = SectionKind::DistantLights;
    let count = scene.header.section(kind).records;
    let chosen = choose(across, count, |index| {
        let bytes = scene.record::<{ DistantLight::BYTES }, LIGHTS_PER_LINE>(memory, kind, index)?;
        Ok(DistantLight::threshold(bytes))
    })?;
    let bytes = scene.record::<{ DistantLight::BYTES }, LIGHTS_PER_LINE>(memory, kind, chosen.index)?;
    let light = DistantLight::read(bytes);
    let square = [chosen.rest.value(), down.value()];
    Ok(LightSample {
        direction: disk_direction(-Vec3::from_array(light.direction), light.spread, square),
        distance: f32::INFINITY,
        irradiance: Vec3::from_array(light.irradiance) / (share * chosen.probability),
        density: None,
        light_group: light.light_group,
    })
}
