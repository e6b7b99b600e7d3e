//! Decides on which materials photons are stored.

use glam::Vec3;
use photoncard_shared::layout::{Material, NO_TEXTURE};
use photoncard_shared::message::Fault;

use super::layered::lit_by_photons;
use super::material::{Texel, View};
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::scene::texture::{channel_ranges, read_texture};

/// Returns true if photons are stored on surfaces of a material. This is the case if, at some texel, the base
/// reflects light by more than a narrow lobe.
///
/// # Errors
/// If the card image is invalid.
pub fn keeps_photons(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
) -> Result<bool, Fault> {
    let [_, texture, _] = material.textures;
    // The texture of metalness is read only if the result depends on metalness.
    if texture == NO_TEXTURE || keeps(material, 0.0) == keeps(material, 1.0) {
        return Ok(keeps(material, 1.0));
    }
    let texture = read_texture(scene, memory, u32::from(texture))?;
    let [_, _, metallic, _] = channel_ranges(scene, memory, &texture)?;
    Ok(metallic.into_iter().any(|metallic| keeps(material, metallic)))
}

/// Returns true if photons are stored at a texel with the metalness `metallic` and 1 in all other textures.
/// The view is along the normal, where the dielectric's Fresnel reflection dims the base least. If photons
/// are stored at some metalness in a range, they are stored at one of the range's ends.
fn keeps(material: &Material, metallic: f32) -> bool {
    let texel = Texel { metallic, ..Texel::WHITE };
    let view = View { outgoing: Vec3::Y, normals: [Vec3::Y; 2], is_front: true };
    !lit_by_photons(material, &texel, &view).is_black()
}

#[cfg(test)]
mod tests {
    use photoncard_shared::layout::Reflectance;

    use std::vec::Vec;

    use super::*;

    const SHARES: [f32; 3] = [0.0, 0.5, 1.0];

    fn shares(index: usize) -> [f32; 4] {
        [1, 3, 9, 27].map(|place| SHARES[index / place % 3])
    }

    /// Materials of all kinds with factors of 0, 1/2 and 1.
    fn materials() -> impl Iterator<Item = Material> {
        let reflectances = |[a, b, c, d]: [f32; 4]| {
            let [first, second] = [[a; 3], [b; 3]];
            [
                Reflectance::Phong { diffuse: first, specular: second, exponent: 100.0 * c },
                Reflectance::MetallicRoughness {
                    base: first,
                    dielectric: second,
                    grazing: b,
                    metallic: c,
                    roughness: d,
                },
                Reflectance::Glass {
                    base: first,
                    absorption: [0.0; 3],
                    transmission: b,
                    ior: 1.5,
                    specular: 1.0,
                    metallic: c,
                    roughness: d,
                },
            ]
        };
        (0..81).flat_map(move |index| reflectances(shares(index))).map(|reflectance| Material {
            reflectance,
            emission: [0.0; 3],
            flags: 0,
            cutoff: 0.0,
            textures: [NO_TEXTURE; 3],
            layers: None,
            light_group: 0,
        })
    }

    /// Texels of one metalness, with colours and roughnesses of 0, 1/2 and 1, seen from both sides.
    fn sights(metallic: f32) -> Vec<(Texel, View)> {
        let mut sights = Vec::new();
        for index in 0..81 {
            let [colour, roughness, cosine, front] = shares(index);
            let texel = Texel { colour: Vec3::splat(colour), roughness, metallic };
            let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            sights.push((texel, View { outgoing, normals: [Vec3::Y; 2], is_front: front > 0.0 }));
        }
        sights
    }

    #[test]
    fn a_material_reflects_if_one_of_its_texels_does() {
        for metallic in [[0.0; 2], [1.0; 2], [0.0, 0.5], [0.5, 1.0], [0.0, 1.0]] {
            let sights: Vec<_> = [metallic[0], 0.5 * (metallic[0] + metallic[1]), metallic[1]]
                .into_iter()
                .flat_map(sights)
                .collect();
            for material in materials() {
                let some =
                    sights.iter().any(|(texel, view)| !lit_by_photons(&material, texel, view).is_black());
                let ends = metallic.into_iter().any(|metallic| keeps(&material, metallic));
                assert_eq!(ends, some, "{material:?} of a metalness in {metallic:?}");
            }
        }
    }
}
