//! Materials, and the valid ranges of their values.

use glam::Vec3;
use photoncard_shared::layout::MAX_PHONG_EXPONENT;
use photoncard_shared::layout::NARROW_ALPHA;

use super::layers::Layers;
use super::limits::EMISSION;
use super::out_of_range::{OutOfRange, Property, every, fault, is_share};

/// Maximum excess of the sum of the diffuse and specular albedo over 1. Files often state only three digits.
const SUM_TOLERANCE: f32 = 1e-4;

/// Material of a surface: reflection, transmission, emission, textures and cut-outs.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// Reflection and transmission.
    pub reflection: Reflection,
    /// Radiance emitted from the front, W/(sr m^2). The emissive texture multiplies it.
    pub emission: Vec3,
    /// True if the back reflects and emits as the front does. The back of a one-sided surface is black.
    pub double_sided: bool,
    /// Threshold of `alphaMode` `MASK`: the surface is cut out where the product of `alpha`, the base
    /// texture's alpha and the vertex colour's alpha is below it.
    pub alpha_cutoff: Option<f32>,
    /// True for `alphaMode` `BLEND`: the coverage of the surface is the product of `alpha`, the base
    /// texture's alpha and the vertex colour's alpha.
    pub blends: bool,
    /// Alpha of the base colour factor, 0 to 1.
    pub alpha: f32,
    /// Base colour texture, an index into [`Scene::textures`](super::SceneContents::textures): its colour
    /// (sRGB) multiplies the base colour or the diffuse albedo, its alpha multiplies `alpha`.
    pub base_texture: Option<u32>,
    /// Metallic-roughness texture, an index into [`Scene::textures`](super::SceneContents::textures): its
    /// green (linear) multiplies the roughness, its blue (linear) the metalness.
    pub metallic_roughness_texture: Option<u32>,
    /// Emissive texture (sRGB), an index into [`Scene::textures`](super::SceneContents::textures), which
    /// multiplies the emission.
    pub emissive_texture: Option<u32>,
    /// True to add the light that is scattered several times between microfacets, which glTF's model leaves
    /// out.
    pub energy_compensation: bool,
    /// Layers beyond the base; `None` for most materials.
    pub layers: Option<Box<Layers>>,
    /// Rays for which the surface is there.
    pub visibility: Visibility,
}

/// Rays for which a surface is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visibility {
    /// True if the rays of pixels meet the surface. Mirrors and glass show it in any case.
    pub camera: bool,
    /// True if the surface casts shadows and photons arrive at it. A lamp without substance does not: its
    /// front lights what lies before it, and all else passes it.
    pub light: bool,
}

impl Default for Visibility {
    /// A surface that is there for all rays.
    fn default() -> Self {
        Self { camera: true, light: true }
    }
}

impl Visibility {
    /// Returns whether the surface is there for all rays.
    pub fn is_whole(self) -> bool {
        self.camera && self.light
    }
}

/// Reflection and transmission model of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflection {
    /// Lambertian reflection with one Phong cosine lobe: `f = diffuse / pi + specular (exponent + 2) / (2 pi)
    /// max(0, cos alpha)^exponent`; alpha is the angle to the mirror direction. A file states this model in
    /// `extras`. Materials that are neither metallic, transmissive nor layered, and have a `specularFactor`
    /// of 0, get this model without a lobe.
    Phong {
        /// Lambertian albedo, 0 to 1.
        diffuse: Vec3,
        /// Albedo of the Phong lobe, 0 to 1.
        specular: Vec3,
        /// Exponent of the Phong lobe, 0 to [`MAX_PHONG_EXPONENT`].
        exponent: f32,
    },
    /// The metallic-roughness reflection of glTF 2.0 (appendix B).
    MetallicRoughness {
        /// Base colour, 0 to 1: the albedo of the dielectric part, and F0 of the metallic part.
        base_colour: Vec3,
        /// Metalness, 0 to 1.
        metallic: f32,
        /// Perceptual roughness, 0 to 1: `sqrt(alpha)` of the microfacet distribution.
        roughness: f32,
        /// F0 of the dielectric part, `min(1, ((ior - 1) / (ior + 1))^2 specularColorFactor) specularFactor`
        /// (`KHR_materials_specular`).
        dielectric: Vec3,
        /// F90 of the dielectric part, 0 to 1: `specularFactor` of `KHR_materials_specular`.
        grazing: f32,
        /// Transmission; `None` for opaque surfaces.
        transmission: Option<Transmission>,
    },
}

/// Transmission of light through a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Share of the light entering the dielectric part that is transmitted instead of scattered, 0 to 1
    /// (`KHR_materials_transmission`).
    pub factor: f32,
    /// Index of refraction, at least 1 (`KHR_materials_ior`; 1.5 by default).
    pub ior: f32,
    /// True if the surface bounds a volume (`KHR_materials_volume` with a thickness above 0), at which light
    /// is refracted. Otherwise the surface is thin-walled: light passes straight on.
    pub is_volume: bool,
    /// Absorption coefficient, 1/m: `-ln(attenuationColor) / attenuationDistance`; zero without a volume. The
    /// scale of nodes does not change it.
    pub absorption: Vec3,
}

impl Material {
    /// Creates a one-sided material that does not emit and has no textures.
    pub fn new(name: impl Into<String>, reflection: Reflection) -> Self {
        Self {
            name: name.into(),
            reflection,
            emission: Vec3::ZERO,
            double_sided: false,
            alpha_cutoff: None,
            blends: false,
            alpha: 1.0,
            base_texture: None,
            metallic_roughness_texture: None,
            emissive_texture: None,
            energy_compensation: false,
            layers: None,
            visibility: Visibility::default(),
        }
    }

    /// Creates a one-sided Lambertian material that does not emit.
    pub fn lambertian(name: impl Into<String>, albedo: Vec3) -> Self {
        Self::phong(name, albedo, Vec3::ZERO, 0.0)
    }

    /// Creates a one-sided material that does not emit, with a Lambertian albedo and a Phong lobe.
    pub fn phong(name: impl Into<String>, diffuse: Vec3, specular: Vec3, exponent: f32) -> Self {
        Self::new(name, Reflection::Phong { diffuse, specular, exponent })
    }

    /// Returns whether any channel emits.
    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }

    /// Returns whether the material focuses light: it is a mirror or transmits light, has a coat or a sheen,
    /// or has a narrow lobe. `texel` is the minimum of the roughness texture, or 1 without a texture.
    pub(super) fn is_specular(&self, texel: f32) -> bool {
        if self.layers.as_ref().is_some_and(|layers| layers.coat.is_some() || layers.sheen.is_some()) {
            return true;
        }
        match self.reflection {
            Reflection::Phong { .. } => false,
            Reflection::MetallicRoughness {
                base_colour,
                metallic,
                roughness,
                dielectric,
                grazing,
                transmission,
            } => {
                let transmits = transmission.is_some_and(|transmission| transmission.factor > 0.0);
                let reflects = dielectric.max_element() > 0.0
                    || grazing > 0.0
                    || metallic * base_colour.max_element() > 0.0;
                is_narrow(roughness * texel) && reflects || transmits && self.may_be_dielectric(metallic)
            }
        }
    }

    /// Returns whether the material has a narrow lobe at some texel. `texel` is the minimum of the roughness
    /// texture, or 1 without a texture.
    pub(super) fn has_narrow_lobe(&self, texel: f32) -> bool {
        matches!(self.reflection, Reflection::MetallicRoughness { roughness, .. } if is_narrow(roughness * texel))
    }

    /// Returns whether the material may have dielectric parts: `metallic` is below 1, or a texture varies it.
    pub fn may_be_dielectric(&self, metallic: f32) -> bool {
        metallic < 1.0 || self.metallic_roughness_texture.is_some()
    }

    /// Indices of the textures in use, in [`Scene::textures`](super::SceneContents::textures).
    pub fn textures(&self) -> impl Iterator<Item = u32> {
        let own = [self.base_texture, self.metallic_roughness_texture, self.emissive_texture];
        own.into_iter().flatten().chain(self.layers.iter().flat_map(|layers| layers.textures()))
    }

    /// Index in [`Scene::textures`](super::SceneContents::textures) of the normal texture whose coordinates
    /// define tangents; `None` without a normal map.
    pub fn tangent_texture(&self) -> Option<u32> {
        self.layers.as_ref().and_then(|layers| layers.tangent_texture())
    }

    /// Checks that every value is finite and within its range, and that no more light is reflected than
    /// arrives.
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        self.reflection.check()?;
        self.layers.as_ref().map_or(Ok(()), |layers| layers.check())?;
        let emission = self.emission;
        if !every(emission, |value| value == 0.0 || EMISSION.contains(&value)) {
            let remedy = "emission is a radiance of 0, or of 1e-20 to 1e20, in each channel";
            return fault(Property::Emission, format!("the emission is {emission}"), remedy);
        }
        if !is_share(self.alpha) {
            return fault(Property::Alpha, format!("the alpha is {}", self.alpha), "alpha is 0 to 1");
        }
        if let Some(cutoff) = self.alpha_cutoff.filter(|cutoff| !(*cutoff >= 0.0 && cutoff.is_finite())) {
            let remedy = "the cutoff is 0 or more; 0.5 is common";
            return fault(Property::AlphaCutoff, format!("the alpha cutoff is {cutoff}"), remedy);
        }
        Ok(())
    }
}

/// Returns whether a GGX lobe of this perceptual roughness is narrow: `roughness^2` is below
/// [`NARROW_ALPHA`].
fn is_narrow(roughness: f32) -> bool {
    roughness * roughness < NARROW_ALPHA
}

impl Reflection {
    fn check(&self) -> Result<(), OutOfRange> {
        match *self {
            Self::Phong { diffuse, specular, exponent } => check_phong(diffuse, specular, exponent),
            Self::MetallicRoughness {
                base_colour,
                metallic,
                roughness,
                dielectric,
                grazing,
                transmission,
            } => {
                check_metallic_roughness(base_colour, metallic, roughness, dielectric, grazing)?;
                transmission.map_or(Ok(()), |transmission| transmission.check())
            }
        }
    }
}

fn check_phong(diffuse: Vec3, specular: Vec3, exponent: f32) -> Result<(), OutOfRange> {
    const ALBEDO: &str = "albedos are 0 to 1 in each channel";
    if !every(diffuse, is_share) {
        return fault(Property::Diffuse, format!("the diffuse albedo is {diffuse}"), ALBEDO);
    }
    if !every(specular, is_share) {
        return fault(Property::Specular, format!("the specular albedo is {specular}"), ALBEDO);
    }
    let sum = diffuse + specular;
    if !every(sum, |sum| sum <= 1.0 + SUM_TOLERANCE) {
        let reason =
            format!("the diffuse and the specular albedo add up to {sum}: more light leaves than arrives");
        let remedy = "lower one of the two until no channel's sum exceeds 1";
        return fault(Property::Specular, reason, remedy);
    }
    if !(0.0..=MAX_PHONG_EXPONENT).contains(&exponent) {
        let reason = format!("the Phong exponent is {exponent}");
        return fault(Property::Exponent, reason, "the exponent is 0 to 10000");
    }
    Ok(())
}

fn check_metallic_roughness(
    base_colour: Vec3,
    metallic: f32,
    roughness: f32,
    dielectric: Vec3,
    grazing: f32,
) -> Result<(), OutOfRange> {
    if !every(base_colour, is_share) {
        let reason = format!("the base colour is {base_colour}");
        return fault(Property::Diffuse, reason, "base colours are 0 to 1 in each channel");
    }
    if !is_share(metallic) {
        return fault(Property::Metallic, format!("the metalness is {metallic}"), "metalness is 0 to 1");
    }
    if !is_share(roughness) {
        return fault(Property::Roughness, format!("the roughness is {roughness}"), "roughness is 0 to 1");
    }
    if !is_share(grazing) {
        let reason = format!("the reflectance at grazing incidence is {grazing}");
        return fault(Property::Dielectric, reason, "the specular factor is 0 to 1");
    }
    if !every(dielectric, is_share) {
        let reason = format!("the reflectance at normal incidence is {dielectric}");
        return fault(Property::Dielectric, reason, "the specular factor is 0 to 1, its colour 0 or more");
    }
    Ok(())
}

impl Transmission {
    fn check(&self) -> Result<(), OutOfRange> {
        let Self { factor, ior, absorption, .. } = *self;
        if !is_share(factor) {
            let reason = format!("the share of transmitted light is {factor}");
            return fault(Property::Transmission, reason, "the transmission factor is 0 to 1");
        }
        if !(ior >= 1.0 && ior.is_finite()) {
            let reason = format!("the index of refraction is {ior}");
            return fault(Property::Ior, reason, "indices of refraction are 1 or more; glass has 1.5");
        }
        if !every(absorption, |value| value >= 0.0 && value.is_finite()) {
            let reason = format!("the absorption coefficient is {absorption} / m");
            let remedy = "the attenuation colour is 0 to 1 in each channel, the attenuation distance above 0";
            return fault(Property::Absorption, reason, remedy);
        }
        Ok(())
    }
}
