//! Sampling of distant (directional) lights, in proportion to their irradiance.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{DistantLight, Record};
use photoncard_shared::message::Fault;

use super::choice::{Fraction, choose};
use super::sample::LightSample;
use crate::memory::MemoryPort;
use crate::scene::SceneImage;

const LIGHTS_PER_LINE: u32 = DistantLight::PER_LINE as u32;

/// Chooses a distant light by the random number `across`. `share` is the probability with which the caller
/// has chosen the distant lights among all lights.
pub(super) fn sample(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    share: f32,
    across: Fraction,
) -> Result<LightSample, Fault> {
    let kind = SectionKind::DistantLights;
    let count = scene.header.section(kind).records;
    let chosen = choose(across, count, |index| {
        let bytes = scene.record::<{ DistantLight::BYTES }, LIGHTS_PER_LINE>(memory, kind, index)?;
        Ok(DistantLight::threshold(bytes))
    })?;
    let bytes = scene.record::<{ DistantLight::BYTES }, LIGHTS_PER_LINE>(memory, kind, chosen.index)?;
    let light = DistantLight::read(bytes);
    Ok(LightSample {
        direction: -Vec3::from_array(light.direction),
        distance: f32::INFINITY,
        irradiance: Vec3::from_array(light.irradiance) / (share * chosen.probability),
        density: None,
    })
}
