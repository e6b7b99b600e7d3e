//! Points on emitters, for shadow rays: an emitter is chosen by its power, a point on it uniformly by area.

use glam::Vec3;
use photoncard_shared::image::{SectionKind, THRESHOLDS_PER_LINE};
use photoncard_shared::layout::{DOUBLE_SIDED, Emitter, Record};
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

const EMITTERS_PER_LINE: u32 = Emitter::PER_LINE as u32;

/// A point on an emitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterSample {
    /// The point, metres.
    pub position: Vec3,
    /// Unit normal of the emitter's front.
    pub normal: Vec3,
    /// Radiance leaving the front, W/(sr m^2).
    pub emission: Vec3,
    /// Whether the back emits as well.
    pub double_sided: bool,
    /// Probability density of the point, 1/m^2.
    pub density: f32,
    /// The greatest coordinate of the emitter, metres.
    pub magnitude: f32,
}

/// The probability density, 1/m^2, with which [`sample_emitter`] chooses a point of a surface of this emission: of
/// either side, as a shadow ray meets the one that faces it.
///
/// It is the density in [`EmitterSample`] but for the rounding of its share; the weights of the two ways that direct
/// light comes ([`crate::render::direct`]) both use this one, so that they sum to 1.
#[inline(always)]
pub fn emitter_density(scene: &SceneImage, emission: Vec3, double_sided: bool) -> f32 {
    let sides = if double_sided { 2.0 } else { 1.0 };
    scene.header.emitter_density * sides * (emission.element_sum() * (1.0 / 3.0))
}

/// The point on the scene's emitters that belongs to a point of the unit square; `None` without emitters.
///
/// Neighbouring points of the square are on one emitter and near each other, so that a stratified pattern stratifies
/// the emitters' area.
///
/// # Errors
/// If the image is not sound.
pub fn sample_emitter(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    [u, v]: [f32; 2],
) -> Result<Option<EmitterSample>, Fault> {
    let emitters = scene.header.section(SectionKind::Emitters).records;
    if emitters == 0 {
        return Ok(None);
    }
    let target = (u * 4_294_967_296.0) as u32;
    let (index, lower, upper) = find(scene, memory, target, emitters)?;
    let bytes =
        scene.record::<{ Emitter::BYTES }, EMITTERS_PER_LINE>(memory, SectionKind::Emitters, index)?;
    let emitter = Emitter::read(bytes);
    let share = (upper - lower).max(1) as f32;
    let within = crate::vector::min((target - lower) as f32 / share, 1.0);
    let [a, b, c] = emitter.vertices.map(Vec3::from_array);
    let scaled_normal = (b - a).cross(c - a);
    let [p, q] = square_to_triangle([within, v]);
    Ok(Some(EmitterSample {
        position: a + (b - a) * p + (c - a) * q,
        normal: crate::vector::unit(scaled_normal),
        emission: emitter.emission.into(),
        double_sided: emitter.flags & DOUBLE_SIDED != 0,
        density: emitter.density,
        magnitude: super::magnitude(&[a, b, c]),
    }))
}

/// The emitter whose share of 2^32 holds `target`, and the ends of that share.
fn find(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    target: u32,
    emitters: u32,
) -> Result<(u32, u32, u32), Fault> {
    let mut threshold = |index: u32| {
        let kind = SectionKind::EmitterThresholds;
        scene.record::<4, THRESHOLDS_PER_LINE>(memory, kind, index).map(|bytes| u32::from_le_bytes(*bytes))
    };
    // The first whose threshold is not below the target; the last one's is 2^32 - 1.
    let (mut low, mut high) = (0, emitters - 1);
    while low < high {
        let middle = low + (high - low) / 2;
        if threshold(middle)? < target {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    let lower = if low == 0 { 0 } else { threshold(low - 1)? };
    // An unsound table could hold anything: the share is made to hold the target.
    Ok((low, lower.min(target), threshold(low)?.max(target)))
}

/// Maps the unit square on the triangle `p, q >= 0, p + q <= 1`, keeping areas (Heitz 2019, *A low-distortion map
/// between triangle and square*).
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
