//! Layers of a material beyond its base: normal map, textures of the reflectance, clearcoat, sheen, textures
//! of transmission.

use glam::Vec3;

use super::out_of_range::{OutOfRange, Property, every, fault, is_share};

/// Layers of a material beyond its base. Textures are indices into
/// [`Scene::textures`](super::SceneContents::textures); the texels of a roughness texture, for example,
/// multiply the roughness.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Normal map of the base.
    pub normal: Option<NormalMap>,
    /// F0 of the dielectric (`KHR_materials_specular`) before `specularFactor` and the limit of 1 are
    /// applied: `((ior - 1) / (ior + 1))^2 specularColorFactor`.
    pub specular: Vec3,
    /// Texture of `specularFactor`, in alpha.
    pub specular_texture: Option<u32>,
    /// Texture of `specularColorFactor` (sRGB).
    pub specular_colour_texture: Option<u32>,
    /// Coat over everything else.
    pub coat: Option<Coat>,
    /// Sheen below the coat.
    pub sheen: Option<Sheen>,
    /// Texture of the transmission factor, in red.
    pub transmission_texture: Option<u32>,
    /// Diffuse transmission.
    pub diffuse_transmission: Option<DiffuseTransmission>,
}

/// A tangent-space normal texture (linear).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Index of the texture in [`Scene::textures`](super::SceneContents::textures).
    pub texture: u32,
    /// Factor of the x and y components of the map's normals.
    pub scale: f32,
}

/// Layer of clear dielectric with the index of refraction 1.5 (`KHR_materials_clearcoat`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// Share of the surface that has the coat, 0 to 1.
    pub factor: f32,
    /// Perceptual roughness, 0 to 1.
    pub roughness: f32,
    /// Texture of the factor, in red.
    pub factor_texture: Option<u32>,
    /// Texture of the roughness, in green.
    pub roughness_texture: Option<u32>,
    /// Normal map of the coat; without one, the coat has the interpolated vertex normals.
    pub normal: Option<NormalMap>,
}

/// A layer of fibres (`KHR_materials_sheen`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Colour, 0 to 1.
    pub colour: Vec3,
    /// Perceptual roughness, 0 to 1.
    pub roughness: f32,
    /// Texture of the colour (sRGB).
    pub colour_texture: Option<u32>,
    /// Texture of the roughness, in alpha.
    pub roughness_texture: Option<u32>,
}

/// Diffuse transmission (`KHR_materials_diffuse_transmission`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Share of the diffuse light that is transmitted to the other side, 0 to 1.
    pub factor: f32,
    /// Colour of the transmitted light, 0 to 1.
    pub colour: Vec3,
    /// Texture of the factor, in alpha.
    pub factor_texture: Option<u32>,
    /// Texture of the colour (sRGB).
    pub colour_texture: Option<u32>,
}

impl Layers {
    /// Creates layers without any texture, coat, sheen or transmission. `specular` is the F0 of the
    /// dielectric.
    pub const fn none(specular: Vec3) -> Self {
        Self {
            normal: None,
            specular,
            specular_texture: None,
            specular_colour_texture: None,
            coat: None,
            sheen: None,
            transmission_texture: None,
            diffuse_transmission: None,
        }
    }

    /// Index of the normal texture whose coordinates define the tangents: the base's or, without one, the
    /// coat's.
    pub(super) fn tangent_texture(&self) -> Option<u32> {
        let coat_normal = self.coat.and_then(|coat| coat.normal);
        self.normal.or(coat_normal).map(|map| map.texture)
    }

    /// Indices of the textures in use.
    pub(super) fn textures(&self) -> impl Iterator<Item = u32> {
        let Self { normal, specular_texture, specular_colour_texture, transmission_texture, .. } = *self;
        let map = |map: Option<NormalMap>| map.map(|map| map.texture);
        let coat = self.coat.map(|coat| [coat.factor_texture, coat.roughness_texture, map(coat.normal)]);
        let sheen = self.sheen.map(|sheen| [sheen.colour_texture, sheen.roughness_texture]);
        let diffuse = self.diffuse_transmission.map(|part| [part.factor_texture, part.colour_texture]);
        [map(normal), specular_texture, specular_colour_texture, transmission_texture]
            .into_iter()
            .chain(coat.into_iter().flatten())
            .chain(sheen.into_iter().flatten())
            .chain(diffuse.into_iter().flatten())
            .flatten()
    }

    /// Replaces every texture index `i` by `renumbered(i)`; `None` removes the texture. All fields are
    /// destructured, so that the compiler reports a new field that is not handled.
    pub(super) fn renumber(&mut self, renumbered: impl Fn(u32) -> Option<u32>) {
        let Self {
            normal,
            specular: _,
            specular_texture,
            specular_colour_texture,
            coat,
            sheen,
            transmission_texture,
            diffuse_transmission,
        } = self;
        let replace = |texture: &mut Option<u32>| *texture = texture.and_then(&renumbered);
        let replace_map = |map: &mut Option<NormalMap>| {
            *map = map.and_then(|map| Some(NormalMap { texture: renumbered(map.texture)?, ..map }));
        };
        replace_map(normal);
        [specular_texture, specular_colour_texture, transmission_texture].into_iter().for_each(replace);
        if let Some(Coat { factor: _, roughness: _, factor_texture, roughness_texture, normal }) = coat {
            [factor_texture, roughness_texture].into_iter().for_each(replace);
            replace_map(normal);
        }
        if let Some(Sheen { colour: _, roughness: _, colour_texture, roughness_texture }) = sheen {
            [colour_texture, roughness_texture].into_iter().for_each(replace);
        }
        if let Some(DiffuseTransmission { factor: _, colour: _, factor_texture, colour_texture }) =
            diffuse_transmission
        {
            [factor_texture, colour_texture].into_iter().for_each(replace);
        }
    }

    /// Checks that every value is finite and within its range.
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let coat_normal = self.coat.and_then(|coat| coat.normal);
        for (map, property) in [(self.normal, Property::NormalScale), (coat_normal, Property::Coat)] {
            if let Some(scale) = map.map(|map| map.scale).filter(|scale| !scale.is_finite()) {
                return fault(
                    property,
                    format!("the scale of the normals is {scale}"),
                    "state a finite number",
                );
            }
        }
        if let Some(Coat { factor, roughness, .. }) = self.coat
            && !(is_share(factor) && is_share(roughness))
        {
            let reason = format!("the coat's factor is {factor}, its roughness {roughness}");
            return fault(Property::Coat, reason, "both are 0 to 1");
        }
        if let Some(Sheen { colour, roughness, .. }) = self.sheen
            && !(every(colour, is_share) && is_share(roughness))
        {
            let reason = format!("the sheen's colour is {colour}, its roughness {roughness}");
            return fault(Property::Sheen, reason, "both are 0 to 1");
        }
        if let Some(DiffuseTransmission { factor, colour, .. }) = self.diffuse_transmission
            && !(is_share(factor) && every(colour, is_share))
        {
            let reason = format!("the factor of diffuse transmission is {factor}, its colour {colour}");
            return fault(Property::DiffuseTransmission, reason, "both are 0 to 1");
        }
        Ok(())
    }
}
