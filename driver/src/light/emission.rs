//! How much an emissive triangle emits: the mean of its texture over it.

use std::cell::OnceCell;

use glam::DVec3;

use super::footprint::Footprint;
use crate::scene::{Attributes, Encoding, Image, Material, Scene, Triangle};

/// Emissive textures of a scene: their means over triangles.
pub(super) struct EmissiveTextures<'s> {
    scene: &'s Scene,
    /// Of each texture the mean over all of it, once it is asked for.
    means: Vec<OnceCell<DVec3>>,
    /// Linear values of the 256 codes of sRGB.
    linear: [f64; 256],
}

impl<'s> EmissiveTextures<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        let means = scene.textures.iter().map(|_| OnceCell::new()).collect();
        Self { scene, means, linear: std::array::from_fn(|code| linear(code as u8)) }
    }

    /// The mean radiance over a triangle, W/(sr m^2): about so, and zero only where no texel glows.
    pub(super) fn mean_radiance(&self, triangle: &Triangle, material: &Material) -> DVec3 {
        let emission = material.emission.as_dvec3();
        let Some(index) = material.emissive_texture else { return emission };
        let Some(texture) = self.scene.textures.get(index as usize) else { return DVec3::ZERO };
        let Some(image) = self.scene.images.get(texture.image as usize) else { return DVec3::ZERO };
        let attributes = self.scene.attributes.get(triangle.attributes as usize).unwrap_or(&Attributes::NONE);
        let mut mean = Mean::default();
        let footprint = Footprint::new(texture, image, attributes);
        let is_seen = footprint.for_each_texel(|texel| mean.add(self.decode(image.encoding, texel)));
        let mean = if is_seen { mean.value() } else { self.mean_of_all(index as usize, image) };
        emission * mean
    }

    fn mean_of_all(&self, texture: usize, image: &Image) -> DVec3 {
        *self.means[texture].get_or_init(|| {
            let mut mean = Mean::default();
            image.texels.iter().for_each(|&texel| mean.add(self.decode(image.encoding, texel)));
            mean.value()
        })
    }

    fn decode(&self, encoding: Encoding, [red, green, blue, _]: [u8; 4]) -> DVec3 {
        let channel = |code: u8| match encoding {
            Encoding::Srgb => self.linear[usize::from(code)],
            Encoding::Linear => f64::from(code) / 255.0,
        };
        DVec3::new(channel(red), channel(green), channel(blue))
    }
}

#[derive(Default)]
struct Mean {
    sum: DVec3,
    count: u64,
}

impl Mean {
    fn add(&mut self, value: DVec3) {
        self.sum += value;
        self.count += 1;
    }

    fn value(&self) -> DVec3 {
        self.sum / self.count.max(1) as f64
    }
}

/// The linear value of a code of sRGB (IEC 61966-2-1).
fn linear(code: u8) -> f64 {
    let value = f64::from(code) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;
    use crate::scene::Texture;

    /// Half a quad with a texture that is black but for one texel.
    fn scene(lit: usize) -> Scene {
        let mut texels = vec![[0, 0, 0, 255]; 64 * 64];
        texels[lit] = [255; 4];
        let image = Image { name: "spark".into(), width: 64, height: 64, texels, encoding: Encoding::Srgb };
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE];
        Scene {
            attributes: vec![Attributes { coordinates: [corners; 2], ..Attributes::NONE }],
            textures: vec![Texture::new(0)],
            images: vec![image],
            ..Scene::default()
        }
    }

    fn mean(scene: &Scene) -> f64 {
        let triangle = Triangle { attributes: 0, ..Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0) };
        let mut material = Material::lambertian("glow", Vec3::ZERO);
        (material.emission, material.emissive_texture) = (Vec3::splat(3.0), Some(0));
        EmissiveTextures::new(scene).mean_radiance(&triangle, &material).x
    }

    #[test]
    fn a_texel_counts_where_the_triangle_shows_it() {
        // Below the diagonal u = v is the other half.
        let shown = mean(&scene(10 * 64 + 40));
        assert!((shown / (3.0 / 2048.0) - 1.0).abs() < 0.15, "{shown}");
        assert_eq!(mean(&scene(40 * 64 + 10)), 0.0);
        assert!(mean(&scene(40 * 64 + 40)) > 0.0, "its light is interpolated over the diagonal");
    }

    #[test]
    fn a_texture_repeated_often_is_taken_as_a_whole() {
        let mut scene = scene(40 * 64 + 10);
        scene.textures[0].matrix = [[100.0, 0.0], [0.0, 100.0]];
        assert!((mean(&scene) / (3.0 / 4096.0) - 1.0).abs() < 1e-6);
    }
}
