//! Emission of triangles with an emissive texture, averaged over the triangle.

use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use photoncard_scene::{Image, Material, Scene, Triangle, VertexAttributes};

use super::footprint::Footprint;
use super::pyramid::{Level, Pyramid, decode};

/// Maximum distance from a texel's centre at which it contributes to bilinear interpolation, texels.
const REACH: f64 = 1.0;

/// Emissive textures of a scene, prepared for averaging over triangles.
pub(super) struct EmissiveTextures<'s> {
    scene: &'s Scene,
    /// Pyramid of each image, built at its first use.
    pyramids: Vec<OnceLock<Pyramid>>,
}

impl<'s> EmissiveTextures<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        Self { scene, pyramids: scene.images.iter().map(|_| OnceLock::new()).collect() }
    }

    /// Mean emitted radiance of a triangle, W/(sr m^2). It is approximate, but zero only if no texel emits.
    pub(super) fn mean_radiance(&self, triangle: &Triangle, material: &Material) -> DVec3 {
        let emission = material.emission.as_dvec3();
        let Some(index) = material.emissive_texture else { return emission };
        let Some(texture) = self.scene.textures.get(index as usize) else { return DVec3::ZERO };
        let Some(image) = self.scene.images.get(texture.image as usize) else { return DVec3::ZERO };
        let attributes =
            self.scene.attributes.get(triangle.attributes as usize).unwrap_or(&VertexAttributes::NONE);
        let footprint = Footprint::new(texture, attributes);
        let mut mean = Mean::default();
        let texel = |index: usize, _| mean.add(decode(image.encoding, image.texels[index]), 1.0);
        let is_seen = footprint.for_each_cell([image.width, image.height], REACH, texel);
        emission
            * if is_seen { mean.value() } else { self.coarse_mean(texture.image as usize, image, &footprint) }
    }

    /// Mean of a texture over a triangle that covers too many texels: from the finest pyramid level with few
    /// enough cells, or from the whole image.
    fn coarse_mean(&self, index: usize, image: &Image, footprint: &Footprint) -> DVec3 {
        let levels = &self.pyramids[index].get_or_init(|| Pyramid::new(image)).levels;
        for level in levels {
            let mut mean = Mean::default();
            let cell = |index: usize, is_inside| {
                mean.add(level.cells[index], if is_inside { 1.0 } else { Level::OUTSIDE });
            };
            if footprint.for_each_cell(level.size, Level::REACH, cell) {
                return mean.value();
            }
        }
        levels.last().map_or(DVec3::ZERO, |level| level.cells.iter().map(|cell| cell.as_dvec3()).sum())
    }
}

#[derive(Default)]
struct Mean {
    sum: DVec3,
    weight: f64,
}

impl Mean {
    fn add(&mut self, value: Vec3, weight: f64) {
        self.sum += value.as_dvec3() * weight;
        self.weight += weight;
    }

    /// Weighted mean; zero if the weight is zero.
    fn value(&self) -> DVec3 {
        if self.weight > 0.0 { self.sum / self.weight } else { DVec3::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use photoncard_scene::{Encoding, SceneContents, Texture};

    use super::*;

    /// Half a quad whose texture is black except for the texel `lit`.
    fn scene(lit: usize) -> Scene {
        scene_of(64, lit)
    }

    /// Variant of [`scene`] with a texture of `side` x `side` texels.
    fn scene_of(side: u32, lit: usize) -> Scene {
        let mut texels = vec![[0, 0, 0, 255]; side as usize * side as usize];
        texels[lit] = [255; 4];
        let image =
            Image { name: "spark".into(), width: side, height: side, texels, encoding: Encoding::Srgb };
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE];
        Scene::from(SceneContents {
            attributes: vec![VertexAttributes { coordinates: [corners; 2], ..VertexAttributes::NONE }],
            textures: vec![Texture::new(0)],
            images: vec![image],
            ..SceneContents::default()
        })
    }

    fn mean(scene: &Scene) -> f64 {
        let triangle = Triangle { attributes: 0, ..Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0) };
        let mut material = Material::lambertian("glow", Vec3::ZERO);
        (material.emission, material.emissive_texture) = (Vec3::splat(3.0), Some(0));
        EmissiveTextures::new(scene).mean_radiance(&triangle, &material).x
    }

    #[test]
    fn a_texel_counts_where_the_triangle_shows_it() {
        // Points below the diagonal u = v belong to the other half.
        let shown = mean(&scene(10 * 64 + 40));
        assert!((shown / (3.0 / 2048.0) - 1.0).abs() < 0.15, "{shown}");
        assert_eq!(mean(&scene(40 * 64 + 10)), 0.0);
        assert!(mean(&scene(40 * 64 + 40)) > 0.0, "its light is interpolated over the diagonal");
    }

    #[test]
    fn a_texture_repeated_often_is_averaged_as_a_whole() {
        let mut scene = scene(40 * 64 + 10);
        scene.textures[0].matrix = [[100.0, 0.0], [0.0, 100.0]];
        assert!((mean(&scene) / (3.0 / 4096.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_single_texel_of_a_large_texture_counts_where_the_triangle_shows_it() {
        // Cells of a side that is no power of four may have 3 x 3 texels, or cells, instead of 4 x 4.
        for (side, tolerance) in [(1000, 7.0 / 9.0), (1023, 7.0 / 9.0), (1024, 0.15)] {
            let spark = |x: usize, y: usize| mean(&scene_of(side, y * side as usize + x));
            let once = 3.0 / (0.5 * f64::from(side * side));
            for (x, y) in [(640, 160), (side as usize - 2, 0), (900, 400)] {
                let shown = spark(x, y) / once;
                assert!((shown - 1.0).abs() < tolerance, "{side}: {x}, {y}: {shown}");
            }
            assert!(spark(500, 500) > 0.0, "{side}: on the diagonal");
            assert_eq!(spark(160, 640), 0.0, "{side}: in the other half");
        }
    }

    #[test]
    fn a_triangle_visits_few_cells_of_a_texture_of_any_size() {
        let scene = scene(0);
        let footprint = Footprint::new(&Texture::new(0), &scene.attributes[0]);
        for side in [16, 64, 1024, 16_384] {
            let mut cells = 0;
            let is_seen = footprint.for_each_cell([side, side], REACH, |_, _| cells += 1);
            assert!(cells <= 8192, "{cells} of a side of {side}");
            assert_eq!(is_seen, cells > 0, "a coarser level is looked at instead of a side of {side}");
        }
    }
}
