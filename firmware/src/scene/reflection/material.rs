//! Materials as reflections: the factors of a record times those of textures and corners, seen from one direction.

use glam::Vec3;
use photoncard_shared::layout::{Material, Reflectance, THIN_WALLED};

use super::Reflection;
use super::metallic_roughness::MetallicRoughness;
use crate::scene::specular::{Glass, Specular};

/// The factors that textures and corners have at a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Texel {
    /// Of the base colour or the diffuse albedo.
    pub(in crate::scene) colour: Vec3,
    pub(in crate::scene) roughness: f32,
    pub(in crate::scene) metallic: f32,
}

impl Texel {
    pub(in crate::scene) const WHITE: Self = Self { colour: Vec3::ONE, roughness: 1.0, metallic: 1.0 };
}

/// The side that a point is seen from.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct View {
    /// Unit vector to the viewer.
    pub(in crate::scene) outgoing: Vec3,
    /// Unit shading normal and unit normal of the triangle, on the viewer's side.
    pub(in crate::scene) normals: [Vec3; 2],
    pub(in crate::scene) is_front: bool,
}

/// The ways of light at a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Scattering {
    pub(in crate::scene) reflection: Reflection,
    /// The perfectly specular part.
    pub(in crate::scene) specular: Specular,
    /// Absorption coefficient on the viewer's side, 1/m.
    pub(in crate::scene) absorption: Vec3,
}

/// The scattering of a material at a point.
#[inline(always)]
pub(in crate::scene) fn scattering(material: &Material, texel: &Texel, view: &View) -> Scattering {
    let View { outgoing, normals, is_front } = *view;
    let mut scattering =
        Scattering { reflection: Reflection::BLACK, specular: Specular::NONE, absorption: Vec3::ZERO };
    match material.reflectance {
        Reflectance::Phong { diffuse, specular, exponent } => {
            let diffuse = Vec3::from(diffuse) * texel.colour;
            scattering.reflection = Reflection::phong(diffuse, specular.into(), exponent);
        }
        Reflectance::MetallicRoughness { base, dielectric, metallic, roughness } => {
            let surface = MetallicRoughness {
                base: Vec3::from(base) * texel.colour,
                dielectric: dielectric.into(),
                metallic: metallic * texel.metallic,
                roughness: roughness * texel.roughness,
            };
            if roughness > 0.0 {
                scattering.reflection = surface.reflection();
            } else {
                let [normal, _] = normals;
                (scattering.reflection, scattering.specular) = surface.smooth(normal.dot(outgoing));
            }
        }
        Reflectance::Glass { base, absorption, transmission, ior, specular, metallic, roughness } => {
            let is_thin = material.flags & THIN_WALLED != 0;
            let (base, absorption) = (Vec3::from(base) * texel.colour, Vec3::from(absorption));
            let glass = Glass { base, absorption, transmission, ior, specular, is_thin };
            let (diffuse, specular) = glass.at(outgoing, normals, !is_front);
            // Metal lets nothing through.
            let [metallic, roughness] = [metallic * texel.metallic, roughness * texel.roughness];
            let metal = MetallicRoughness { base, dielectric: Vec3::ZERO, metallic: 1.0, roughness };
            scattering.reflection = metal.lobe_beside(diffuse * (1.0 - metallic), metallic);
            scattering.specular = specular.dimmed(1.0 - metallic);
            if !(is_front || is_thin) {
                scattering.absorption = absorption;
            }
        }
    }
    scattering
}
