//! A complete pixel, and the sums of a pixel that is being completed.

use glam::Vec3;
use photoncard_shared::image::Header;
use photoncard_shared::message::{
    ALBEDO_STEPS, DEPTH_STEPS, FrameParameters, LayerSums, NORMAL_STEPS, PixelSums,
};

use super::adaptive::Probes;
use super::light::PixelLight;
use crate::fixed_point::ColourSum;
use crate::render::features::Features;

/// A complete pixel: its tile, its index in the tile, and its sums over all samples.
#[derive(Clone, Copy, Debug)]
pub struct FinishedPixel {
    /// [`Tile::id`](photoncard_shared::message::Tile::id) of the pixel's tile.
    pub tile: u32,
    /// Row-major index of the pixel in the tile.
    pub index: u32,
    /// Sums of the pixel's light.
    pub light: PixelLight,
    /// Sums of the pixel's albedo, normal and depth.
    pub view: PixelView,
}

impl FinishedPixel {
    /// Sums of the pixel as a card sends them to its host.
    pub fn sums(&self, frame: &FrameParameters) -> PixelSums {
        self.view.sums(self.light.sums(frame))
    }
}

/// Sums of albedo, normal and depth over the samples of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelView(PixelSums);

impl PixelView {
    pub(super) const NOTHING: Self = Self(PixelSums::NOTHING);

    /// Adds a sample: the features of the surface that it sees, and the surface's depth, metres.
    pub(super) fn add(&mut self, header: &Header, features: &Features, depth: f32) {
        let Self(sums) = self;
        let albedo = features.albedo.clamp(Vec3::ZERO, Vec3::ONE) * ALBEDO_STEPS as f32;
        let normal = features.normal * NORMAL_STEPS as f32;
        // Conversions round towards zero and saturate. The maximum number of samples does not overflow the
        // sums of albedo and normal.
        for (axis, (albedo, normal)) in albedo.to_array().into_iter().zip(normal.to_array()).enumerate() {
            let (Some(albedo_sum), Some(normal_sum)) = (sums.albedo.get_mut(axis), sums.normal.get_mut(axis))
            else {
                continue;
            };
            *albedo_sum = albedo_sum.saturating_add(albedo as u32);
            *normal_sum = normal_sum.saturating_add(normal as i32);
        }
        let depth = depth * (DEPTH_STEPS as f32 / header.sum_scale().depth);
        sums.depth = sums.depth.saturating_add(depth as i64);
        sums.surfaces = sums.surfaces.saturating_add(1);
    }

    /// Combines albedo, normal and depth with sums of light. With layers, `light` is a sum for each
    /// component, then the count of gathers. Without layers it is a single sum.
    pub fn sums(&self, light: &[ColourSum]) -> PixelSums {
        match light {
            [direct, indirect, caustic, gathers] => {
                let [direct, indirect, caustic] = [direct, indirect, caustic].map(ColourSum::bits);
                let gathers = gathers.value().x as u32;
                self.0.with_layers(LayerSums { direct, indirect, caustic, gathers })
            }
            _ => self.0.with_light(light.first().map_or([0; 3], ColourSum::bits)),
        }
    }
}

/// State of the pixel that is being completed.
pub(super) struct Completion {
    pub(super) light: PixelLight,
    pub(super) view: PixelView,
    /// Number of the next sample among all samples of the pixel.
    pub(super) sample: u32,
    /// Number of the next path in its sample.
    pub(super) path: u32,
    /// Light of the current path, in the card image's radiance units.
    pub(super) of_path: Vec3,
    pub(super) probes: Probes,
    /// Number of paths that see a surface with a Lambertian part; 0 in a frame without gather rays.
    pub(super) lambertian: u32,
    /// Number of paths whose irradiance is interpolated from irradiance records.
    pub(super) interpolated: u32,
}

impl Completion {
    /// Begins the completion of a pixel at sample `sample`. `light` is the pixel's light from earlier passes.
    pub(super) const fn new(light: PixelLight, sample: u32) -> Self {
        Self {
            light,
            view: PixelView::NOTHING,
            sample,
            path: 0,
            of_path: Vec3::ZERO,
            probes: Probes::NONE,
            lambertian: 0,
            interpolated: 0,
        }
    }
}
