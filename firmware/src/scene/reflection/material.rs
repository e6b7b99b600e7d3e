//! Computes the scattering of a material towards one direction. The material's factors are multiplied by the
//! values of textures and vertex colours.

use glam::Vec3;
use photoncard_shared::layout::{COMPENSATED, Material, NARROW_LOBE, Reflectance};

use super::Reflection;
use super::lobe::Lobe;
use super::metallic_roughness::MetallicRoughness;
use crate::scene::shading_normal::bent;
use crate::scene::specular::{Bounds, Glass, Specular};
use crate::vector::sqrt;

/// Values of textures and vertex colours at a point, by which a material's factors are multiplied.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Texel {
    /// Factor of the base colour, or of the diffuse albedo of a Phong material.
    pub(in crate::scene) colour: Vec3,
    pub(in crate::scene) roughness: f32,
    pub(in crate::scene) metallic: f32,
}

impl Texel {
    pub(in crate::scene) const WHITE: Self = Self { colour: Vec3::ONE, roughness: 1.0, metallic: 1.0 };
}

/// Direction from which a point is seen, and the normals on that side.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct View {
    /// Unit direction to the viewer.
    pub(in crate::scene) outgoing: Vec3,
    /// Unit shading normal and unit geometric normal, on the viewer's side.
    pub(in crate::scene) normals: [Vec3; 2],
    pub(in crate::scene) is_front: bool,
}

impl View {
    /// Cosine between the direction to the viewer and the [`bent`] shading normal, which lobes and mirrors
    /// use.
    #[inline(always)]
    pub(super) fn glossy_cosine(&self) -> f32 {
        let [normal, geometric_normal] = self.normals;
        bent(normal, self.outgoing, geometric_normal).dot(self.outgoing)
    }
}

#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Scattering {
    pub(in crate::scene) reflection: Reflection,
    pub(in crate::scene) specular: Specular,
    /// Absorption coefficient on the viewer's side, 1/m.
    pub(in crate::scene) absorption: Vec3,
}

impl Scattering {
    /// Value for a surface that neither reflects nor transmits.
    pub(super) const BLACK: Self =
        Self { reflection: Reflection::BLACK, specular: Specular::NONE, absorption: Vec3::ZERO };

    /// Scattering that consists of a lobe only.
    pub(super) fn of_lobe(lobe: Lobe) -> Self {
        Self { reflection: Reflection { diffuse: Vec3::ZERO, lobe }, ..Self::BLACK }
    }
}

/// Scattering of a material's base at a point, without its other [layers](super::layered).
#[inline(always)]
pub(in crate::scene) fn scattering(material: &Material, texel: &Texel, view: &View) -> Scattering {
    let View { outgoing, normals, is_front } = *view;
    let cosine = view.glossy_cosine();
    let has_narrow_lobe = material.flags & NARROW_LOBE != 0;
    let is_compensated = material.flags & COMPENSATED != 0;
    let mut scattering = Scattering::BLACK;
    match material.reflectance {
        Reflectance::Phong { diffuse, specular, exponent } => {
            let diffuse = Vec3::from(diffuse) * texel.colour;
            scattering.reflection = Reflection::phong(diffuse, specular.into(), exponent);
        }
        Reflectance::MetallicRoughness { base, dielectric, grazing, metallic, roughness } => {
            let surface = MetallicRoughness {
                base: Vec3::from(base) * texel.colour,
                dielectric: dielectric.into(),
                grazing,
                metallic: metallic * texel.metallic,
                roughness: roughness * texel.roughness,
                has_narrow_lobe,
                is_compensated,
            };
            if roughness > 0.0 {
                scattering.reflection = surface.reflection(cosine);
            } else {
                (scattering.reflection, scattering.specular) = surface.smooth(cosine);
            }
        }
        Reflectance::Glass { base, absorption, transmission, ior, specular, metallic, roughness } => {
            let bounds = Bounds::of(material);
            let is_thin = bounds == Bounds::ThinWall;
            let (base, absorption) = (Vec3::from(base) * texel.colour, Vec3::from(absorption));
            // Light passes a volume's surface twice, and is tinted once.
            let tint = if is_thin { base } else { Vec3::from_array(base.to_array().map(sqrt)) };
            let glass = Glass { base: tint, absorption, transmission, ior, specular, bounds };
            let (scattered, specular) = glass.at(outgoing, normals, !is_front);
            // Metal is opaque.
            let [metallic, roughness] = [metallic * texel.metallic, roughness * texel.roughness];
            let metal = MetallicRoughness {
                base,
                dielectric: Vec3::ZERO,
                grazing: 0.0,
                metallic: 1.0,
                roughness,
                has_narrow_lobe,
                is_compensated,
            };
            scattering.reflection =
                metal.lobe_beside(base * (scattered * (1.0 - metallic)), metallic, cosine);
            scattering.specular = specular.dimmed(1.0 - metallic);
            if bounds == Bounds::Solid && !is_front {
                scattering.absorption = absorption;
            }
        }
    }
    scattering
}
