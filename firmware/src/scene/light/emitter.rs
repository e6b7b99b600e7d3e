//! Sampling of emitters: emissive triangles, and lights at points. The light tree selects an emitter.
//! On an emissive triangle, a point is then chosen uniformly by area.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BLENDS, Emitter, EmitterKind, NO_TEXTURE, Record, Triangle, TriangleId};
use photoncard_shared::message::Fault;

use super::choice::Fraction;
use super::environment::environment_coordinates;
use super::sample::{LightSample, Receiver};
use super::tree::{LightChoices, select_emitter, selection_probability};
use crate::memory::MemoryPort;
use crate::scene::corners::Corners;
use crate::scene::coverage::coverage;
use crate::scene::materials::read_material;
use crate::scene::{SceneImage, magnitude, offset_origin, read_texture, sample_texture};
use crate::vector::{max, min, sqrt, unit};

const EMITTERS_PER_LINE: u32 = Emitter::PER_LINE as u32;

/// A point on an emissive triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterPoint {
    /// Position, metres.
    pub position: Vec3,
    /// Unit normal of the triangle's front side.
    pub normal: Vec3,
    /// Radiance that the point emits, W/(sr m^2).
    pub emission: Vec3,
    /// Greatest absolute coordinate of the triangle's corners, metres.
    pub magnitude: f32,
}

/// Reads emitter `index`.
///
/// # Errors
/// If there is no such emitter.
pub fn read_emitter(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<Emitter, Fault> {
    let kind = SectionKind::Emitters;
    let bytes = scene.record::<{ Emitter::BYTES }, EMITTERS_PER_LINE>(memory, kind, index)?;
    Ok(Emitter::read(bytes))
}

/// Maps a point of the unit square to a point on an emissive triangle. The map is continuous and preserves
/// area ratios. Returns `None` if the emitter is not a triangle.
///
/// # Errors
/// If the card image is invalid.
pub fn emitter_point(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    emitter: &Emitter,
    square: [f32; 2],
) -> Result<Option<EmitterPoint>, Fault> {
    let EmitterKind::Triangle { vertices, triangle, material, varies, .. } = emitter.kind else {
        return Ok(None);
    };
    let [a, b, c] = vertices.map(Vec3::from_array);
    let [p, q] = square_to_triangle(square);
    let emission = if varies {
        let place =
            (TriangleId::lone(triangle), &Triangle { vertices, material, cut_out: true, flat_glass: false });
        emission_at(scene, memory, emitter, place, [1.0 - p - q, p, q])?
    } else {
        emitter.emission.into()
    };
    Ok(Some(EmitterPoint {
        position: a + (b - a) * p + (c - a) * q,
        normal: unit((b - a).cross(c - a)),
        emission,
        magnitude: magnitude(&[a, b, c]),
    }))
}

/// Radiance, W/(sr m^2), emitted by a triangle at the point with the barycentric coordinates `weights`. Takes
/// emissive texture, cut-outs and partial coverage into account.
fn emission_at(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    emitter: &Emitter,
    (id, triangle): (TriangleId, &Triangle),
    weights: [f32; 3],
) -> Result<Vec3, Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let mut emission = Vec3::from_array(emitter.emission);
    if material.cutoff > 0.0 || material.flags & BLENDS != 0 {
        emission *= coverage(scene, memory, &material, id, weights)?;
    }
    let [.., texture] = material.textures;
    if texture == NO_TEXTURE {
        return Ok(emission);
    }
    let Some(corners) = Corners::read(scene, memory, id, weights)? else { return Ok(emission) };
    let [red, green, blue, _] = corners.texture(scene, memory, texture)?;
    Ok(emission * Vec3::new(red, green, blue))
}

/// Probability density, 1/sr, with which `sample_light` returns the direction to a given point on the
/// emissive triangle `emitter`. The point is at `distance`, metres, from the receiver. `cosine` is the cosine
/// between the triangle's normal and the direction to the receiver.
///
/// # Errors
/// If the card image is invalid.
pub fn emitter_density(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    receiver: &Receiver,
    emitter: u32,
    (distance, cosine): (f32, f32),
) -> Result<f32, Fault> {
    let probability = scene.header.lights.emitters * selection_probability(scene, memory, receiver, emitter)?;
    let EmitterKind::Triangle { vertices, .. } = read_emitter(scene, memory, emitter)?.kind else {
        return Ok(0.0);
    };
    Ok(probability * (distance * distance / (cosine * area(vertices))))
}

/// Selects an emitter and a point on it by the random numbers `across` and `down`. `share` is the probability
/// with which the caller has chosen the emitters among all lights.
pub(super) fn sample(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    choices: &mut LightChoices,
    share: f32,
    [across, down]: [Fraction; 2],
) -> Result<Option<LightSample>, Fault> {
    let Some(selection) = select_emitter(scene, memory, choices, across)? else { return Ok(None) };
    let receiver = &choices.receiver;
    let emitter = read_emitter(scene, memory, selection.emitter)?;
    let probability = share * selection.probability;
    let intensity = Vec3::from_array(emitter.emission);
    let sample = match emitter.kind {
        EmitterKind::Triangle { vertices, double_sided, .. } => {
            let square = [selection.rest.value(), down.value()];
            let target = emitter_point(scene, memory, &emitter, square)?;
            let density = probability / area(vertices);
            target.and_then(|target| from_area(receiver, &target, double_sided, density))
        }
        EmitterKind::Point { position } => from_point(receiver, position.into(), probability, |_| intensity),
        EmitterKind::Spot { position, direction, scale, offset } => {
            let axis = Vec3::from_array(direction);
            let towards = |direction: Vec3| intensity * falloff(-axis.dot(direction), scale, offset);
            from_point(receiver, position.into(), probability, towards)
        }
        EmitterKind::Profile { position, aim, across, texture } => {
            let frame = ProfileFrame::new(aim, across);
            let away = unit(receiver.origin - Vec3::from_array(position));
            let relative = profile_intensity(scene, memory, texture, frame.local(away))?;
            from_point(receiver, position.into(), probability, |_| intensity * relative)
        }
    };
    Ok(sample.map(|sample| LightSample { light_group: emitter.light_group, ..sample }))
}

/// Angular attenuation of a spot light, `clamp(cosine * scale + offset, 0, 1)^2` (`KHR_lights_punctual`).
/// `cosine` is the cosine of the angle to the light's axis.
#[inline(always)]
pub fn falloff(cosine: f32, scale: f32, offset: f32) -> f32 {
    let linear = min(max(cosine * scale + offset, 0.0), 1.0);
    linear * linear
}

/// Directions from a light with a profile, whose map has the pole and the middle of an environment's map.
#[derive(Clone, Copy)]
pub struct ProfileFrame {
    aim: Vec3,
    across: Vec3,
    upright: Vec3,
}

impl ProfileFrame {
    /// Frame of the directions gamma = 0, and C = 0 at gamma = pi / 2.
    #[inline(always)]
    pub fn new(aim: [f32; 3], across: [f32; 3]) -> Self {
        let (aim, across) = (Vec3::from_array(aim), Vec3::from_array(across));
        Self { aim, across, upright: across.cross(aim) }
    }

    /// A direction in the frame: `[direction of C = 90 degrees, aim, opposite of C = 0]`.
    #[inline(always)]
    pub fn local(&self, direction: Vec3) -> Vec3 {
        Vec3::new(self.upright.dot(direction), self.aim.dot(direction), -self.across.dot(direction))
    }

    /// Inverse of [`Self::local`].
    pub fn world(&self, local: Vec3) -> Vec3 {
        self.upright * local.x + self.aim * local.y - self.across * local.z
    }
}

/// Intensity of a light with a profile in a direction of its frame, relative to the peak.
///
/// # Errors
/// If the card image is invalid.
pub fn profile_intensity(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    texture: u32,
    local: Vec3,
) -> Result<f32, Fault> {
    let texture = read_texture(scene, memory, texture)?;
    let [relative, ..] = sample_texture(scene, memory, &texture, environment_coordinates(local))?;
    Ok(relative)
}

/// Creates the light sample of a point on a triangle, chosen with the probability density `density`, 1/m^2.
/// Returns `None` if the receiver is on the side of the triangle that does not emit.
fn from_area(
    receiver: &Receiver,
    target: &EmitterPoint,
    double_sided: bool,
    density: f32,
) -> Option<LightSample> {
    let is_front = target.normal.dot(receiver.origin - target.position) > 0.0;
    if !is_front && !double_sided {
        return None;
    }
    let normal = if is_front { target.normal } else { -target.normal };
    let way = offset_origin(target.position, normal, target.magnitude) - receiver.origin;
    let distance_squared = way.length_squared();
    let distance = sqrt(distance_squared);
    let direction = way / distance;
    let cosine = -normal.dot(direction);
    let density = density * (distance_squared / cosine);
    // At distance 0 the cosine is NaN.
    (cosine > 0.0).then_some(LightSample {
        direction,
        distance,
        irradiance: target.emission / density,
        density: Some(density),
        light_group: 0,
    })
}

/// Creates the light sample of a point or spot light, chosen with the probability `probability`. `intensity`
/// maps the direction from receiver to light to the intensity, W/sr. Returns `None` at distance 0.
fn from_point(
    receiver: &Receiver,
    position: Vec3,
    probability: f32,
    intensity: impl FnOnce(Vec3) -> Vec3,
) -> Option<LightSample> {
    let way = position - receiver.origin;
    let distance_squared = way.length_squared();
    let distance = sqrt(distance_squared);
    let direction = way / distance;
    let irradiance = intensity(direction) / (probability * distance_squared);
    // At distance 0 there is no direction.
    (distance > 0.0).then_some(LightSample { direction, distance, irradiance, density: None, light_group: 0 })
}

/// Area of a triangle, m^2.
fn area(vertices: [[f32; 3]; 3]) -> f32 {
    let [a, b, c] = vertices.map(Vec3::from_array);
    0.5 * sqrt((b - a).cross(c - a).length_squared())
}

/// Area-preserving map of the unit square to the triangle `p, q >= 0, p + q <= 1` (Heitz 2019, *A
/// low-distortion map between triangle and square*).
#[inline(always)]
fn square_to_triangle([x, y]: [f32; 2]) -> [f32; 2] {
    if y > x {
        let p = x * 0.5;
        [p, y - p]
    } else {
        let q = y * 0.5;
        [x - q, q]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_fills_the_triangle_evenly() {
        let mut mean = [0.0; 2];
        for i in 0..100 {
            for j in 0..100 {
                let [p, q] = square_to_triangle([(i as f32 + 0.5) / 100.0, (j as f32 + 0.5) / 100.0]);
                assert!(p >= 0.0 && q >= 0.0 && p + q <= 1.000_001);
                mean[0] += p / 1e4;
                mean[1] += q / 1e4;
            }
        }
        assert!((mean[0] - 1.0 / 3.0).abs() < 1e-3 && (mean[1] - 1.0 / 3.0).abs() < 1e-3, "{mean:?}");
    }
}
