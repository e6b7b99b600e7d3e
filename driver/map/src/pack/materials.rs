//! Encodes materials as records of the card image.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::{SceneImage, keeps_photons};
use photoncard_scene::{Layers, Material, NO_ATTRIBUTES, NormalMap, Reflection, Scene, Transmission};
use photoncard_shared::layout::{
    self, BLENDS, COMPENSATED, DOUBLE_SIDED, HAS_ATTRIBUTES, HIDDEN, LAMP, LayerTexture, NARROW_LOBE,
    NO_TEXTURE, Record, Reflectance, THIN_WALLED,
};

use crate::light::Lights;

/// Records of the layers of a scene's materials.
pub(super) fn layers(scene: &Scene) -> Vec<[u8; layout::Layers::BYTES]> {
    scene.materials.iter().filter_map(|material| material.layers.as_deref()).map(layers_record).collect()
}

/// Records of a scene's materials. `uncovered` is the result of [`Scene::uncovered_materials`].
pub(super) fn records(scene: &Scene, lights: &Lights, uncovered: &[bool]) -> Vec<layout::Material> {
    let mut has_attributes = vec![false; scene.materials.len()];
    for (index, triangle) in (0..).zip(scene.stored_triangles()) {
        let has_any = triangle.attributes != NO_ATTRIBUTES || lights.of_triangle(index).is_some();
        has_attributes[triangle.material as usize] |= has_any;
    }
    let mut layers = 0..;
    let materials = scene.materials.iter().zip(has_attributes).zip(uncovered);
    let record_of =
        |(index, ((material, has_attributes), &is_uncovered)): (usize, ((&Material, bool), &bool))| {
            let mut attributes = if has_attributes || is_uncovered { HAS_ATTRIBUTES } else { 0 };
            attributes |= if material.blends && is_uncovered { BLENDS } else { 0 };
            let layers = material.layers.as_ref().and_then(|_| layers.next());
            let light_group = scene.light_groups.of_material(index);
            layout::Material {
                light_group,
                ..record(material, attributes | lobe_flag(scene, material), layers)
            }
        };
    materials.enumerate().map(record_of).collect()
}

/// Record of a material without the flags that depend on its scene.
pub(super) fn bare_record(material: &Material) -> layout::Material {
    // The record is encoded and decoded again, because its encoding rounds some values.
    layout::Material::read(&record(material, 0, None).to_bytes())
}

/// Returns whether any triangle's material stores photons. The chip's code decides this from the card image.
pub(super) fn keep_photons(scene: &Scene, (image, mut memory): (SceneImage, Lines)) -> bool {
    let mut is_used = vec![false; scene.materials.len()];
    for triangle in scene.stored_triangles() {
        is_used[triangle.material as usize] = true;
    }
    let mut used = scene.materials.iter().zip(is_used).filter(|(_, is_used)| *is_used);
    used.any(|(material, _)| {
        let material = layout::Material::read(
            &record(material, HAS_ATTRIBUTES | lobe_flag(scene, material), None).to_bytes(),
        );
        // The card image was just packed. If it were malformed, tracing photons would report it.
        keeps_photons(&image, &mut memory, &material).unwrap_or(true)
    })
}

/// Returns [`NARROW_LOBE`] if the material has a narrow lobe, else 0.
fn lobe_flag(scene: &Scene, material: &Material) -> u32 {
    if scene.has_narrow_lobe(material) { NARROW_LOBE } else { 0 }
}

/// Record of a material. `flags` are those of [`HAS_ATTRIBUTES`], [`BLENDS`] and [`NARROW_LOBE`] that follow
/// from the scene; `layers` is the index of the material's layers. All texture indices of the scene fit in
/// `u16`.
fn record(material: &Material, mut flags: u32, layers: Option<u32>) -> layout::Material {
    let transmission = transmission_of(material);
    flags |= if material.double_sided { DOUBLE_SIDED } else { 0 };
    flags |= if material.energy_compensation { COMPENSATED } else { 0 };
    flags |= if material.visibility.camera { 0 } else { HIDDEN };
    flags |= if material.visibility.light { 0 } else { LAMP };
    if transmission.is_some_and(|transmission| !transmission.is_volume) {
        flags |= THIN_WALLED;
    }
    layout::Material {
        reflectance: reflectance(material),
        emission: material.emission.to_array(),
        flags,
        cutoff: cutoff(material),
        textures: [
            texture(material.base_texture),
            texture(material.metallic_roughness_texture),
            texture(material.emissive_texture),
        ],
        layers,
        light_group: 0,
    }
}

/// Maximum factor of diffuse transmission. A factor below 1 leaves the base a diffuse reflection, so that
/// photons are stored on both sides.
const MAX_DIFFUSE_TRANSMISSION: f32 = 63.0 / 64.0;

fn texture(index: Option<u32>) -> u16 {
    index.and_then(|index| u16::try_from(index).ok()).unwrap_or(NO_TEXTURE)
}

fn layers_record(layers: &Layers) -> [u8; layout::Layers::BYTES] {
    let map =
        |map: Option<NormalMap>| (texture(map.map(|map| map.texture)), map.map_or(1.0, |map| map.scale));
    let (normal, normal_scale) = map(layers.normal);
    let coat = layers.coat.as_ref();
    let (coat_normal, coat_normal_scale) = map(coat.and_then(|coat| coat.normal));
    let sheen = layers.sheen.as_ref();
    let diffuse = layers.diffuse_transmission.as_ref();
    layout::Layers {
        specular: layers.specular.to_array(),
        normal_scale,
        coat: coat.map_or(0.0, |coat| coat.factor),
        coat_roughness: coat.map_or(0.0, |coat| coat.roughness),
        coat_normal_scale,
        sheen: sheen.map_or([0.0; 3], |sheen| sheen.colour.to_array()),
        sheen_roughness: sheen.map_or(0.0, |sheen| sheen.roughness),
        diffuse_transmission: diffuse.map_or(0.0, |part| part.factor.min(MAX_DIFFUSE_TRANSMISSION)),
        diffuse_transmission_colour: diffuse.map_or([1.0; 3], |part| part.colour.to_array()),
        textures: LayerTexture::ALL.map(|which| match which {
            LayerTexture::Normal => normal,
            LayerTexture::Specular => texture(layers.specular_texture),
            LayerTexture::SpecularColour => texture(layers.specular_colour_texture),
            LayerTexture::Coat => texture(coat.and_then(|coat| coat.factor_texture)),
            LayerTexture::CoatRoughness => texture(coat.and_then(|coat| coat.roughness_texture)),
            LayerTexture::CoatNormal => coat_normal,
            LayerTexture::Sheen => texture(sheen.and_then(|sheen| sheen.colour_texture)),
            LayerTexture::SheenRoughness => texture(sheen.and_then(|sheen| sheen.roughness_texture)),
            LayerTexture::Transmission => texture(layers.transmission_texture),
            LayerTexture::DiffuseTransmission => texture(diffuse.and_then(|part| part.factor_texture)),
            LayerTexture::DiffuseTransmissionColour => texture(diffuse.and_then(|part| part.colour_texture)),
        }),
    }
    .to_bytes()
}

/// Alpha cutoff that applies to the product of texture and vertex alpha: the material's cutoff divided by its
/// alpha factor. With partial coverage it is the alpha factor.
fn cutoff(material: &Material) -> f32 {
    if material.blends {
        return material.alpha;
    }
    match material.alpha_cutoff {
        Some(cutoff) if cutoff > 0.0 => cutoff / material.alpha,
        _ => 0.0,
    }
}

/// Transmission of a material; `None` if it transmits no light.
pub(super) fn transmission_of(material: &Material) -> Option<Transmission> {
    match material.reflection {
        Reflection::MetallicRoughness { transmission, metallic, .. }
            if material.may_be_dielectric(metallic) =>
        {
            transmission.filter(|transmission| transmission.factor > 0.0)
        }
        _ => None,
    }
}

/// Ratio `F0 / ((n - 1) / (n + 1))^2`, at most 1. F0 is the stated reflectance of a dielectric at normal
/// incidence, and n its index of refraction.
fn specular_share(dielectric: Vec3, ior: f32) -> f32 {
    let amplitude = (ior - 1.0) / (ior + 1.0);
    let of_index = amplitude * amplitude;
    if of_index > 0.0 { (dielectric.max_element() / of_index).min(1.0) } else { 1.0 }
}

fn reflectance(material: &Material) -> Reflectance {
    match material.reflection {
        Reflection::Phong { diffuse, specular, exponent } => {
            Reflectance::Phong { diffuse: diffuse.to_array(), specular: specular.to_array(), exponent }
        }
        Reflection::MetallicRoughness { base_colour, metallic, roughness, dielectric, grazing, .. } => {
            match transmission_of(material) {
                Some(Transmission { factor, ior, absorption, .. }) => Reflectance::Glass {
                    base: base_colour.to_array(),
                    absorption: absorption.max(Vec3::ZERO).to_array(),
                    transmission: factor,
                    ior,
                    specular: specular_share(dielectric, ior),
                    metallic,
                    roughness,
                },
                None => Reflectance::MetallicRoughness {
                    base: base_colour.to_array(),
                    dielectric: dielectric.to_array(),
                    grazing,
                    metallic,
                    roughness,
                },
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(material: &Material) -> layout::Material {
        bare_record(material)
    }

    #[test]
    fn the_alpha_factor_is_divided_out_of_the_cutoff() {
        let masked = |alpha, alpha_cutoff| {
            read(&Material { alpha, alpha_cutoff, ..Material::lambertian("leaf", Vec3::ONE) }).cutoff
        };
        assert_eq!(masked(1.0, None), 0.0);
        assert_eq!(masked(0.5, Some(0.25)), 0.5);
        assert_eq!(masked(0.0, Some(0.0)), 0.0);
        assert!(masked(0.0, Some(0.5)) > 1.0, "nothing is there");
    }

    #[test]
    fn transmissive_materials_are_glass_and_thin_walled_without_a_volume() {
        let of = |transmission| {
            read(&Material::new(
                "window",
                Reflection::MetallicRoughness {
                    base_colour: Vec3::ONE,
                    metallic: 0.0,
                    roughness: 0.0,
                    dielectric: Vec3::splat(0.04),
                    grazing: 1.0,
                    transmission,
                },
            ))
        };
        let wall = Transmission { factor: 0.5, ior: 1.5, is_volume: false, absorption: Vec3::ZERO };
        let window = of(Some(wall));
        assert!(matches!(window.reflectance, Reflectance::Glass { transmission: 0.5, .. }));
        assert_eq!(window.flags, THIN_WALLED);
        assert_eq!(of(Some(Transmission { is_volume: true, ..wall })).flags, 0);
        let opaque = of(Some(Transmission { factor: 0.0, ..wall }));
        assert!(matches!(opaque.reflectance, Reflectance::MetallicRoughness { .. }));
    }
}
