//! Albedo and emission of surfaces at texels.

use std::collections::BTreeMap;

use glam::{DVec2, Vec3, Vec4};
use photoncard_firmware::scene::decode_texel;
use photoncard_scene::{Image, Reflection, Texture, Triangle, Wrap};
use rayon::prelude::*;

use super::atlas::{Atlas, PlacedChart};
use super::raster::{barycentric, cells, is_within, touched};
use super::surfaces::Surfaces;
use super::texels::Texel;

/// Points along a texel at which colours are sampled.
const SIDE: u32 = 4;

/// Light that a surface reflects and emits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Colour {
    /// Diffuse albedo.
    pub albedo: Vec3,
    /// Emitted radiance, W/(sr m^2).
    pub emission: Vec3,
}

/// Mean colours of the texels.
pub(super) fn colours(surfaces: &Surfaces, atlas: &Atlas, texels: &[Texel]) -> Vec<Colour> {
    let of_charts: Vec<&[Texel]> = texels.chunk_by(|one, other| one.chart == other.chart).collect();
    let of_chart = |texels: &&[Texel]| {
        let chart = texels.first().and_then(|texel| atlas.charts.get(texel.chart as usize));
        chart.map_or_else(Vec::new, |chart| of_chart(surfaces, chart, texels))
    };
    of_charts.par_iter().flat_map_iter(of_chart).collect()
}

fn of_chart(surfaces: &Surfaces, chart: &PlacedChart, texels: &[Texel]) -> Vec<Colour> {
    let mut sums: BTreeMap<[u32; 2], (Colour, f32)> = BTreeMap::new();
    for (&index, places) in chart.triangles.iter().zip(&chart.places) {
        let triangle = surfaces.triangle(index);
        for texel in touched(places, chart.rectangle) {
            let weights = cells(texel, SIDE).map(|place| barycentric(places, place));
            for weights in weights.filter(|weights| is_within(*weights)) {
                let colour = colour(surfaces, &triangle, weights);
                let (sum, count) = sums.entry(texel).or_default();
                sum.albedo += colour.albedo;
                sum.emission += colour.emission;
                *count += 1.0;
            }
        }
    }
    let mean = |texel: &Texel| match sums.get(&texel.place) {
        Some((sum, count)) => Colour { albedo: sum.albedo / *count, emission: sum.emission / *count },
        None => colour(surfaces, &surfaces.triangle(texel.nearest.0), texel.nearest.1),
    };
    texels.iter().map(mean).collect()
}

/// Colour of a triangle at barycentric coordinates.
fn colour(surfaces: &Surfaces, triangle: &Triangle, weights: [f64; 3]) -> Colour {
    let Some(material) = surfaces.scene.materials.get(triangle.material as usize) else {
        return Colour::default();
    };
    let texel = |texture: Option<u32>| {
        texture.map_or(Vec4::ONE, |texture| sampled(surfaces, triangle, texture, weights))
    };
    let corners = surfaces.attributes(triangle).colours;
    let vertex = corners
        .iter()
        .zip(weights)
        .fold(Vec4::ZERO, |sum, (corner, weight)| sum + Vec4::from_array(*corner) * weight as f32);
    let base = (texel(material.base_texture) * vertex).truncate();
    let share = match material.reflection {
        Reflection::Phong { diffuse, .. } => diffuse,
        Reflection::MetallicRoughness { base_colour, metallic, transmission, .. } => {
            let metallic = metallic * texel(material.metallic_roughness_texture).z;
            let transmitted = transmission.map_or(0.0, |transmission| transmission.factor);
            base_colour * ((1.0 - metallic) * (1.0 - transmitted))
        }
    };
    let emission = if material.is_emissive() {
        material.emission * texel(material.emissive_texture).truncate()
    } else {
        Vec3::ZERO
    };
    Colour { albedo: share * base, emission }
}

/// Linear RGBA of a texture on a triangle.
fn sampled(surfaces: &Surfaces, triangle: &Triangle, texture: u32, weights: [f64; 3]) -> Vec4 {
    let scene = &surfaces.scene;
    let found = scene.textures.get(texture as usize);
    let found = found.and_then(|texture| Some((texture, scene.images.get(texture.image as usize)?)));
    let Some((texture, image)) = found else { return Vec4::ONE };
    let corners = surfaces.coordinates(triangle, texture.set as usize).unwrap_or_default();
    let place = corners.iter().zip(weights).fold(DVec2::ZERO, |sum, (corner, weight)| sum + *corner * weight);
    read(texture, image, place)
}

/// Texel at a place, bilinear or nearest, as firmware's `sample_texture` filters.
fn read(texture: &Texture, image: &Image, place: DVec2) -> Vec4 {
    let [[a, b], [c, d]] = texture.matrix.map(|row| row.map(f64::from));
    let [x, y] = texture.offset.map(f64::from);
    let place = DVec2::new(a * place.x + b * place.y + x, c * place.x + d * place.y + y);
    let place = place * DVec2::new(f64::from(image.width), f64::from(image.height));
    if texture.nearest {
        return texel(texture, image, place.floor());
    }
    let low = (place - 0.5).floor();
    let share = (place - 0.5 - low).as_vec2();
    let at = |x: f64, y: f64| texel(texture, image, low + DVec2::new(x, y));
    let upper = at(0.0, 0.0) * (1.0 - share.x) + at(1.0, 0.0) * share.x;
    let lower = at(0.0, 1.0) * (1.0 - share.x) + at(1.0, 1.0) * share.x;
    upper * (1.0 - share.y) + lower * share.y
}

fn texel(texture: &Texture, image: &Image, place: DVec2) -> Vec4 {
    let [x, y] = [(place.x, image.width, texture.wrap[0]), (place.y, image.height, texture.wrap[1])]
        .map(|(place, side, wrap)| wrapped(place, f64::from(side), wrap));
    let code = image.texels.get(y as usize * image.width as usize + x as usize).copied();
    Vec4::from_array(decode_texel(image.encoding.into(), code.unwrap_or([u8::MAX; 4])))
}

/// Column or row of a place beyond an image with `side` columns or rows.
fn wrapped(place: f64, side: f64, wrap: Wrap) -> f64 {
    match wrap {
        Wrap::Clamp => place.clamp(0.0, side - 1.0),
        Wrap::Repeat => place.rem_euclid(side),
        Wrap::Mirror => {
            let around = place.rem_euclid(2.0 * side);
            if around < side { around } else { 2.0 * side - 1.0 - around }
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_scene::Encoding;

    use super::*;

    #[test]
    fn textures_repeat_and_interpolate_between_the_centres_of_texels() {
        let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
        let name = "checker".to_owned();
        let image = Image { name, width: 2, height: 1, texels, encoding: Encoding::Linear };
        let texture = Texture::new(0);
        for (u, expected) in [(0.25, 0.0), (0.75, 1.0), (0.5, 0.5), (1.25, 0.0), (0.0, 0.5), (-0.25, 1.0)] {
            let found = read(&texture, &image, DVec2::new(u, 0.5)).x;
            assert!((found - expected).abs() < 1e-6, "{u}: {found}");
        }
        let clamped = Texture { wrap: [Wrap::Clamp; 2], ..texture };
        assert_eq!(read(&clamped, &image, DVec2::new(5.0, 0.5)).x, 1.0);
        assert_eq!([-1.0, 2.0, 3.0].map(|place| wrapped(place, 2.0, Wrap::Mirror)), [0.0, 1.0, 0.0]);
    }
}
