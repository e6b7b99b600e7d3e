//! Materials of several layers: coat, sheen, base, and the far side, whose reflection is seen through the
//! surface by diffuse or rough transmission.
//!
//! A path chooses one layer at random, in proportion to the layers' albedos. The layer's reflection is
//! divided by the probability of the choice. A surface thus needs only one lobe, in registers and in the
//! gather queue. Light that reaches a layer is attenuated by the directional albedo of the layers above it.
//! Rays follow coat, sheen and transmission; photons are gathered for the base alone.

use glam::Vec3;
use photoncard_shared::layout::{COMPENSATED, Layers, Material, NARROW_LOBE, Reflectance, THIN_WALLED};

use super::Reflection;
use super::ggx::{GgxLobe, masking, microfacet};
use super::lobe::Lobe;
use super::material::{Scattering, Texel, View, scattering};
use super::metallic_roughness::MetallicRoughness;
use super::sheen::SheenLobe;
use crate::scene::specular::{Bounds, Glass, Specular};
use crate::vector::{max, max_component, sqrt};

/// Lower limit of a layer's share in the sum of albedos. It bounds the weight of a sample.
const MIN_PROBABILITY: f32 = 1.0 / 8.0;

/// F0 of a coat, whose index of refraction is 1.5.
const COAT_F0: f32 = 0.04;

/// Texture values at a point, by which the factors in [`Layers`] are multiplied.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct LayerTexel {
    pub(in crate::scene) specular: f32,
    pub(in crate::scene) specular_colour: Vec3,
    pub(in crate::scene) coat: f32,
    pub(in crate::scene) coat_roughness: f32,
    pub(in crate::scene) sheen: Vec3,
    pub(in crate::scene) sheen_roughness: f32,
    pub(in crate::scene) transmission: f32,
    pub(in crate::scene) diffuse_transmission: f32,
    pub(in crate::scene) diffuse_transmission_colour: Vec3,
}

impl LayerTexel {
    const WHITE: Self = Self {
        specular: 1.0,
        specular_colour: Vec3::ONE,
        coat: 1.0,
        coat_roughness: 1.0,
        sheen: Vec3::ONE,
        sheen_roughness: 1.0,
        transmission: 1.0,
        diffuse_transmission: 1.0,
        diffuse_transmission_colour: Vec3::ONE,
    };
}

/// Kind of layer that a path can take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::scene) enum Layer {
    Base,
    Coat,
    Sheen,
    /// Far side of the surface, whose reflection is seen through the surface.
    Behind,
}

/// The layer that a path has chosen.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Taken {
    pub(in crate::scene) layer: Layer,
    /// Scattering of the layer, divided by `probability`.
    pub(in crate::scene) scattering: Scattering,
    /// Shading normal of the layer.
    pub(in crate::scene) normal: Vec3,
    pub(in crate::scene) probability: f32,
    /// Probability with which any layer except [`Layer::Behind`] is chosen.
    pub(in crate::scene) of_front: f32,
}

/// Scattering of all layers of a material at a point, each attenuated by the layers above it.
struct Stack {
    base: Scattering,
    behind: Reflection,
    sheen: SheenLobe,
    coat: Scattering,
}

/// Chooses a layer of a material at a point. `coat_normal` is the coat's shading normal. `random(i)` must
/// return random number `i` in [0, 1): number 0 chooses the layer, and 1 and 2 the microfacet of rough glass.
/// `random(0) == 0` chooses the base.
#[inline(never)]
pub(in crate::scene) fn take(
    (material, layers): (&Material, &Layers),
    (texel, layer_texel): (&Texel, &LayerTexel),
    view: &View,
    coat_normal: Vec3,
    random: &dyn Fn(u32) -> f32,
) -> Taken {
    let material = varied(material, layers, layer_texel);
    let [normal, geometric_normal] = view.normals;
    let cosine = normal.dot(view.outgoing);
    let coat_view = View { normals: [coat_normal, geometric_normal], ..*view };
    let (coat, coat_fresnel) = coat(layers, layer_texel, coat_view.glossy_cosine());
    let sheen = SheenLobe::new(
        Vec3::from(layers.sheen) * layer_texel.sheen,
        layers.sheen_roughness * layer_texel.sheen_roughness,
        cosine,
    );
    let (base, behind) = base(&material, (layers, layer_texel), texel, view, random);
    let below_coat = Vec3::splat(max(1.0 - max(albedo(&coat), coat_fresnel), 0.0));
    let below_sheen = below_coat * max(1.0 - max_component(sheen.albedo()), 0.0);
    let stack = Stack {
        base: dimmed(base, below_sheen),
        behind: behind.dimmed(below_sheen),
        sheen: sheen.dimmed(below_coat),
        coat,
    };
    stack.take(view, coat_normal, random(0))
}

impl Stack {
    fn take(&self, view: &View, coat_normal: Vec3, random: f32) -> Taken {
        let [normal, _] = view.normals;
        let shares = [
            (Layer::Base, albedo(&self.base)),
            (Layer::Coat, albedo(&self.coat)),
            (Layer::Sheen, max_component(self.sheen.albedo())),
            (Layer::Behind, max_component(self.behind.diffuse) + max_component(self.behind.lobe.albedo())),
        ];
        let sum: f32 = shares.iter().map(|(_, share)| share).sum();
        let bounded = |share: f32| if share > 0.0 { max(share, sum * MIN_PROBABILITY) } else { 0.0 };
        let all: f32 = shares.iter().map(|&(_, share)| bounded(share)).sum();
        let [.., (_, behind)] = shares;
        let of_front = if all > 0.0 { 1.0 - bounded(behind) / all } else { 1.0 };
        let mut rest = random * all;
        let mut taken = (Layer::Base, 1.0);
        for (layer, share) in shares {
            let share = bounded(share);
            if share <= 0.0 {
                continue;
            }
            taken = (layer, share / all);
            rest -= share;
            if rest < 0.0 {
                break;
            }
        }
        let (layer, probability) = taken;
        let (scattering, normal) = match layer {
            Layer::Base => (self.base, normal),
            Layer::Coat => (self.coat, coat_normal),
            Layer::Sheen => (Scattering::of_lobe(Lobe::Sheen(self.sheen)), normal),
            Layer::Behind => (Scattering { reflection: self.behind, ..Scattering::BLACK }, -normal),
        };
        // A ray that arrives inside glass was absorbed on its way, whichever layer is chosen.
        let scattering = Scattering { absorption: self.base.absorption, ..scattering };
        let mut scattering = dimmed(scattering, Vec3::splat(1.0 / probability));
        scattering.specular.straight *= probability;
        Taken { layer, scattering, normal, probability, of_front }
    }
}

/// Multiplies a material's specular and transmission factors by the values of their textures.
fn varied(material: &Material, layers: &Layers, texel: &LayerTexel) -> Material {
    let mut material = *material;
    match &mut material.reflectance {
        Reflectance::MetallicRoughness { dielectric, grazing, .. } => {
            let [r, g, b] = layers.specular;
            let f0 = (Vec3::new(r, g, b) * texel.specular_colour).min(Vec3::ONE);
            *grazing *= texel.specular;
            *dielectric = (f0 * *grazing).to_array();
        }
        Reflectance::Glass { transmission, specular, .. } => {
            *transmission *= texel.transmission;
            *specular *= texel.specular;
        }
        Reflectance::Phong { .. } => {}
    }
    material
}

/// Returns the scattering of the coat (a lobe; at roughness 0 a mirror) and `F(n.o)`, by which glTF
/// attenuates everything below the coat. `cosine` is `n.o`, with the coat's normal `n`.
fn coat(layers: &Layers, texel: &LayerTexel, cosine: f32) -> (Scattering, f32) {
    let factor = layers.coat * texel.coat;
    if factor <= 0.0 {
        return (Scattering::BLACK, 0.0);
    }
    let roughness = layers.coat_roughness * texel.coat_roughness;
    let surface = MetallicRoughness {
        base: Vec3::ZERO,
        dielectric: Vec3::splat(COAT_F0 * factor),
        grazing: factor,
        metallic: 0.0,
        roughness,
        has_narrow_lobe: false,
        is_compensated: false,
    };
    let (_, specular) = surface.smooth(cosine);
    let fresnel = max_component(specular.reflected);
    if layers.coat_roughness > 0.0 {
        let mut reflection = surface.reflection(cosine);
        if let Lobe::Ggx(lobe) = reflection.lobe {
            reflection.lobe = Lobe::Ggx(lobe.as_layer());
        }
        (Scattering { reflection, ..Scattering::BLACK }, fresnel)
    } else {
        (Scattering { specular, ..Scattering::BLACK }, fresnel)
    }
}

/// Part of a material's reflection that is estimated from photons: the base without its narrow lobe.
pub(super) fn lit_by_photons(material: &Material, texel: &Texel, view: &View) -> Reflection {
    let none = LayerTexel::WHITE;
    let (base, _) = base(material, (&Layers::NONE, &none), texel, view, &|_| 0.0);
    base.reflection.without_narrow_lobe()
}

/// Returns the scattering of the base, and the reflection of the far side as seen through the base.
fn base(
    material: &Material,
    layers: (&Layers, &LayerTexel),
    texel: &Texel,
    view: &View,
    random: &dyn Fn(u32) -> f32,
) -> (Scattering, Reflection) {
    if let Reflectance::Glass { roughness, .. } = material.reflectance
        && roughness > 0.0
    {
        return rough_glass(material, texel, view, [random(1), random(2)]);
    }
    let mut base = scattering(material, texel, view);
    let (layers, layer_texel) = layers;
    let share = layers.diffuse_transmission * layer_texel.diffuse_transmission;
    if share <= 0.0 {
        return (base, Reflection::BLACK);
    }
    let colour = Vec3::from(layers.diffuse_transmission_colour) * layer_texel.diffuse_transmission_colour;
    let white = match material.reflectance {
        Reflectance::MetallicRoughness { dielectric, grazing, metallic, roughness, .. } => {
            let reflectance =
                Reflectance::MetallicRoughness { base: [1.0; 3], dielectric, grazing, metallic, roughness };
            scattering(&Material { reflectance, ..*material }, &Texel { colour: Vec3::ONE, ..*texel }, view)
        }
        _ => base,
    };
    base.reflection.diffuse *= 1.0 - share;
    (base, Reflection::lambertian(white.reflection.diffuse * colour * share))
}

/// Does `base` for rough glass. A thin wall transmits by a GGX lobe on its far side. A volume reflects by a
/// GGX lobe outside. Its reflection inside, and its transmission on both sides, are perfectly specular at a
/// microfacet that is sampled by visible normals (Walter et al. 2007).
fn rough_glass(material: &Material, texel: &Texel, view: &View, point: [f32; 2]) -> (Scattering, Reflection) {
    let View { outgoing, normals, is_front } = *view;
    let [normal, geometric_normal] = normals;
    let black = (Scattering::BLACK, Reflection::BLACK);
    let Reflectance::Glass { base, absorption, transmission, ior, specular, metallic, roughness } =
        material.reflectance
    else {
        return black;
    };
    let cosine = view.glossy_cosine();
    let [metallic, roughness] = [metallic * texel.metallic, roughness * texel.roughness];
    let (colour, is_thin) = (Vec3::from(base) * texel.colour, material.flags & THIN_WALLED != 0);
    let amplitude = (ior - 1.0) / (ior + 1.0);
    let surface = MetallicRoughness {
        base: colour,
        dielectric: Vec3::splat(amplitude * amplitude * specular),
        grazing: specular,
        metallic,
        roughness,
        has_narrow_lobe: material.flags & NARROW_LOBE != 0,
        is_compensated: material.flags & COMPENSATED != 0,
    };
    let mut outside = surface.reflection(cosine);
    let through = outside.diffuse * transmission;
    outside.diffuse *= 1.0 - transmission;
    let reflected = Scattering { reflection: outside, ..Scattering::BLACK };
    if is_thin {
        let lobe = Lobe::Ggx(GgxLobe::new(through, through, roughness, cosine).as_layer());
        return (reflected, Reflection { diffuse: Vec3::ZERO, lobe });
    }
    let microfacet = microfacet(normal, outgoing, roughness, point);
    let tint = Vec3::from_array(colour.to_array().map(sqrt));
    let absorption = Vec3::from(absorption);
    let glass = Glass { base: tint, absorption, transmission, ior, specular, bounds: Bounds::Solid };
    let (_, refracted) = glass.at(outgoing, [microfacet, geometric_normal], !is_front);
    // The weight of a sampled visible normal is G2 / G1, which is the G1 of the direction of incidence.
    let mirrored = Specular::reflected_direction(outgoing, microfacet, geometric_normal);
    let [beside, behind] = [normal.dot(mirrored), -normal.dot(refracted.behind)]
        .map(|cosine| masking(roughness, cosine) * (1.0 - metallic));
    let transmitted = refracted.transmitted * behind;
    if is_front {
        let specular = Specular { reflected: Vec3::ZERO, transmitted, ..refracted };
        return (Scattering { specular, ..reflected }, Reflection::BLACK);
    }
    let reflected = refracted.reflected * beside;
    let specular = Specular { reflected, transmitted, beside: mirrored, ..refracted };
    let diffuse = outside.diffuse;
    let reflection = Reflection::lambertian(diffuse);
    (Scattering { reflection, specular, absorption }, Reflection::BLACK)
}

/// Sum of the maximum channels of four albedos: Lambertian part, lobe, specular reflection, transmission.
fn albedo(Scattering { reflection, specular, .. }: &Scattering) -> f32 {
    let Reflection { diffuse, lobe } = reflection;
    [*diffuse, lobe.albedo(), specular.reflected, specular.transmitted].into_iter().map(max_component).sum()
}

/// Multiplies reflection, specular reflection and transmission by a colour.
fn dimmed(scattering: Scattering, colour: Vec3) -> Scattering {
    let Scattering { reflection, specular, .. } = scattering;
    let specular = Specular {
        reflected: specular.reflected * colour,
        transmitted: specular.transmitted * colour,
        ..specular
    };
    Scattering { reflection: reflection.dimmed(colour), specular, ..scattering }
}
