//! Texels of images that are converted to metallic-roughness.

use glam::{Vec3, Vec4};

use super::formula::Appearance;
use super::{Conversion, Part};
use crate::srgb::{Srgb, linear};

#[derive(Clone, Copy)]
pub(in crate::gltf) struct Grid<'t> {
    pub(in crate::gltf) size: [u32; 2],
    pub(in crate::gltf) texels: &'t [[u8; 4]],
}

impl Grid<'_> {
    /// Returns the linear value, bilinearly interpolated, at the centre of texel (`x`, `y`) of a grid of size
    /// `size` over the same image.
    fn sample(&self, srgb: &Srgb, [x, y]: [u32; 2], size: [u32; 2]) -> Vec4 {
        let at = |x: u32, y: u32| srgb.decode(self.texels[(y * self.size[0] + x) as usize]);
        if self.size == size {
            return at(x, y);
        }
        let place = |at: u32, whole: u32, own: u32| {
            let centre = (at as f32 + 0.5) / whole as f32 * own as f32 - 0.5;
            let low = libm::floorf(centre).max(0.0);
            let low_index = (low as u32).min(own - 1);
            (low_index, (low_index + 1).min(own - 1), (centre - low).clamp(0.0, 1.0))
        };
        let (left, right, across) = place(x, size[0], self.size[0]);
        let (top, bottom, down) = place(y, size[1], self.size[1]);
        let row = |y| at(left, y).lerp(at(right, y), across);
        row(top).lerp(row(bottom), down)
    }
}

impl Conversion {
    /// Size of the converted image: the larger width and the larger height of its readable sources.
    pub(in crate::gltf) fn size(sources: [Option<[u32; 2]>; 2]) -> [u32; 2] {
        sources.into_iter().flatten().fold([1, 1], |[width, height], [w, h]| [width.max(w), height.max(h)])
    }

    /// Computes the texels of the converted image. For a source that cannot be read, only the factors count.
    pub(in crate::gltf) fn texels(&self, size: [u32; 2], sources: [Option<Grid<'_>>; 2]) -> Vec<[u8; 4]> {
        let srgb = Srgb::new();
        let places = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
        places.map(|place| self.texel(&srgb, place, size, sources)).collect()
    }

    fn texel(&self, srgb: &Srgb, place: [u32; 2], size: [u32; 2], sources: [Option<Grid<'_>>; 2]) -> [u8; 4] {
        let sample = |grid: Option<Grid<'_>>| grid.map_or(Vec4::ONE, |grid| grid.sample(srgb, place, size));
        let [diffuse, specular] = sources.map(sample);
        let colour = |sample: Vec4| Vec3::new(sample.x, sample.y, sample.z);
        let appearance = Appearance {
            diffuse: self.factors.diffuse * colour(diffuse),
            specular: self.factors.specular * colour(specular),
            glossiness: self.factors.glossiness * specular.w,
        };
        let converted = appearance.converted();
        match self.part {
            Part::BaseColour => {
                let [red, green, blue] = converted.base.to_array().map(|value| srgb.encode(value));
                [red, green, blue, linear(diffuse.w)]
            }
            Part::MetallicRoughness => {
                // Without a specular-glossiness texture the roughness is the material's factor.
                let roughness = if self.sources[1].is_some() { converted.roughness } else { 1.0 };
                [255, linear(roughness), linear(converted.metallic), 255]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_of_other_sizes_are_interpolated() {
        let srgb = Srgb::new();
        let texels = [[0, 0, 0, 0], [255, 255, 255, 255]];
        let grid = Grid { size: [2, 1], texels: &texels };
        let row: Vec<_> = (0..4).map(|x| grid.sample(&srgb, [x, 0], [4, 1]).w).collect();
        assert_eq!(row, [0.0, 0.25, 0.75, 1.0]);
        assert_eq!(grid.sample(&srgb, [1, 0], [2, 1]).w, 1.0);
    }
}
