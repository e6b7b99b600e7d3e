//! A complete pixel, and the sums of a pixel that is being completed.

use glam::Vec3;
use photoncard_shared::image::Header;
use photoncard_shared::message::{
    ALBEDO_STEPS, COVERAGE_STEPS, DEPTH_STEPS, FrameParameters, IdentityCoverage, NORMAL_STEPS, PixelForm,
    PixelSums,
};

use super::adaptive::Probes;
use super::light::{PixelLight, with_light};
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
    /// Other sums of the pixel.
    pub view: PixelView,
}

impl FinishedPixel {
    /// Sums of the pixel as a card sends them to its host.
    pub fn sums(&self, frame: &FrameParameters) -> PixelSums {
        self.view.sums(frame.form(), self.light.sums(frame))
    }
}

/// Sums over the samples of a pixel, except those of light.
#[derive(Clone, Copy, Debug)]
pub struct PixelView {
    pub(super) seen: SeenSums,
    pub(super) further: FurtherSums,
}

impl PixelView {
    /// Combines the sums with sums of light, in the order of the layers of light, of a frame whose pixels
    /// have the contents `form`.
    pub fn sums(&self, form: PixelForm, light: &[ColourSum]) -> PixelSums {
        let SeenSums { albedo, normal, depth, surfaces } = self.seen;
        let FurtherSums { position, coverage, identities } = self.further;
        let view = PixelSums {
            albedo,
            normal,
            depth,
            surfaces,
            position,
            coverage,
            identities,
            ..PixelSums::NOTHING
        };
        with_light(view, form, light)
    }
}

/// Sums of albedo, normal and depth over the samples of a pixel, and the number of samples that see a
/// surface ([`PixelSums`]).
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenSums {
    albedo: [u32; 3],
    normal: [i32; 3],
    depth: i64,
    surfaces: u32,
}

impl SeenSums {
    pub(super) const NOTHING: Self = Self { albedo: [0; 3], normal: [0; 3], depth: 0, surfaces: 0 };

    /// Adds a sample: the features of the surface that it sees, and the surface's depth, metres.
    pub(super) fn add(&mut self, header: &Header, features: &Features, depth: f32) {
        let albedo = features.albedo.clamp(Vec3::ZERO, Vec3::ONE) * ALBEDO_STEPS as f32;
        let normal = features.normal * NORMAL_STEPS as f32;
        // Conversions round towards zero and saturate. The maximum number of samples does not overflow the
        // sums of albedo and normal.
        for (axis, (albedo, normal)) in albedo.to_array().into_iter().zip(normal.to_array()).enumerate() {
            let (Some(albedo_sum), Some(normal_sum)) = (self.albedo.get_mut(axis), self.normal.get_mut(axis))
            else {
                continue;
            };
            *albedo_sum = albedo_sum.saturating_add(albedo as u32);
            *normal_sum = normal_sum.saturating_add(normal as i32);
        }
        let depth = depth * (DEPTH_STEPS as f32 / header.sum_scale().depth);
        self.depth = self.depth.saturating_add(depth as i64);
        self.surfaces = self.surfaces.saturating_add(1);
    }
}

/// Sums that only some frames ask for, of the first surfaces that eye rays hit ([`PixelSums`]).
#[derive(Clone, Copy, Debug)]
pub(super) struct FurtherSums {
    position: Option<[i64; 3]>,
    coverage: Option<u32>,
    identities: Option<IdentityCoverage>,
}

impl FurtherSums {
    /// Sums of a frame that asks for none.
    pub(super) const NONE: Self = Self { position: None, coverage: None, identities: None };

    /// Sums over no samples, those that a frame asks for.
    pub(super) fn of_frame(frame: &FrameParameters) -> Self {
        Self {
            position: frame.position.then_some([0; 3]),
            coverage: frame.coverage.then_some(0),
            identities: frame.identities.then_some(IdentityCoverage::NONE),
        }
    }

    /// Adds the position of a hit, metres, if the frame asks for positions.
    pub(super) fn add_position(&mut self, header: &Header, position: Vec3) {
        let Some(sums) = &mut self.position else { return };
        let steps = position * (DEPTH_STEPS as f32 / header.sum_scale().depth);
        for (sum, steps) in sums.iter_mut().zip(steps.to_array()) {
            *sum = sum.saturating_add(steps as i64);
        }
    }

    /// Adds a path with the weight `weight` whose eye ray hits a surface of the identity `identity`.
    pub(super) fn cover(&mut self, weight: f32, identity: Option<u32>) {
        let covered = (weight * COVERAGE_STEPS as f32 + 0.5) as u32;
        if let Some(sum) = &mut self.coverage {
            *sum = sum.saturating_add(covered);
        }
        if let (Some(sums), Some(identity)) = (&mut self.identities, identity) {
            sums.add(identity, covered);
        }
    }
}

/// State of the pixel that is being completed.
pub(super) struct Completion {
    pub(super) light: PixelLight,
    pub(super) seen: SeenSums,
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
            seen: SeenSums::NOTHING,
            sample,
            path: 0,
            of_path: Vec3::ZERO,
            probes: Probes::NONE,
            lambertian: 0,
            interpolated: 0,
        }
    }
}
