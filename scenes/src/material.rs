//! Materials of glTF: reflection, transmission and emission of surfaces.

use crate::document::{
    EmissiveStrength, Extensions, Extras, IndexOfRefraction, MaterialEntry, MetallicRoughness, Phong,
    PhotoncardExtras, Specular, TextureExtensions, TextureInfo, TextureTransform, Transmission, Volume,
};

/// Material of a surface.
#[derive(Clone, Debug, Default)]
pub struct Material {
    name: String,
    base_colour: [f64; 3],
    /// Metallic factor and roughness; `None` for a Lambertian material.
    microfacets: Option<[f64; 2]>,
    glass: Option<Glass>,
    radiance: [f64; 3],
    double_sided: bool,
    phong: Option<Phong>,
    base_texture: Option<TextureInfo>,
    emissive_texture: Option<TextureInfo>,
    alpha_cutoff: Option<f64>,
}

/// Optical properties of a clear, smooth solid.
#[derive(Clone, Copy, Debug)]
pub struct Glass {
    /// Index of refraction.
    pub ior: f64,
    /// Approximate thickness of the solid, metres, for renderers that do not trace rays through it.
    pub thickness: f64,
    /// Transmittance over `attenuation_distance`, red, green and blue.
    pub attenuation_colour: [f64; 3],
    /// Distance over which the transmittance is `attenuation_colour`, metres.
    pub attenuation_distance: f64,
}

impl Material {
    /// Creates a Lambertian material with this albedo, red, green and blue.
    pub fn diffuse(name: &str, albedo: [f64; 3]) -> Self {
        Self { name: name.into(), base_colour: albedo, ..Self::default() }
    }

    /// Creates a material of glTF's metallic-roughness model. A metal of roughness 0 is a mirror.
    pub fn metallic_roughness(name: &str, base_colour: [f64; 3], metallic: f64, roughness: f64) -> Self {
        Self { microfacets: Some([metallic, roughness]), ..Self::diffuse(name, base_colour) }
    }

    /// Creates the surface of a clear, smooth solid.
    pub fn glass(name: &str, glass: Glass) -> Self {
        Self { glass: Some(glass), ..Self::metallic_roughness(name, [1.0; 3], 0.0, 0.0) }
    }

    /// Sets the emitted radiance, W/(sr m^2).
    #[must_use]
    pub fn emitting(mut self, radiance: [f64; 3]) -> Self {
        self.radiance = radiance;
        self
    }

    /// Makes the material double-sided.
    #[must_use]
    pub fn double_sided(mut self) -> Self {
        self.double_sided = true;
        self
    }

    /// Adds a Phong lobe.
    #[must_use]
    pub fn with_phong(mut self, phong: Phong) -> Self {
        self.phong = Some(phong);
        self
    }

    /// Multiplies the base colour by a texture.
    #[must_use]
    pub fn textured(mut self, texture: usize, transform: Option<TextureTransform>) -> Self {
        self.base_texture = Some(info(texture, transform));
        self
    }

    /// Multiplies the emitted radiance by a texture.
    #[must_use]
    pub fn emission_textured(mut self, texture: usize) -> Self {
        self.emissive_texture = Some(info(texture, None));
        self
    }

    /// Makes the surface absent where the alpha of the base texture is below `cutoff`.
    #[must_use]
    pub fn cut_out(mut self, cutoff: f64) -> Self {
        self.alpha_cutoff = Some(cutoff);
        self
    }

    /// Returns glTF's `emissiveFactor`, at most 1, and the `emissiveStrength` that multiplies it. The
    /// strength is `None` for a radiance of at most 1.
    fn emission(&self) -> (Option<[f64; 3]>, Option<EmissiveStrength>) {
        let peak = self.radiance.into_iter().fold(0.0, f64::max);
        if peak == 0.0 {
            (None, None)
        } else if peak <= 1.0 {
            (Some(self.radiance), None)
        } else {
            let factor = self.radiance.map(|channel| channel / peak);
            (Some(factor), Some(EmissiveStrength { emissive_strength: peak }))
        }
    }

    fn extensions(&self, emissive_strength: Option<EmissiveStrength>) -> Extensions {
        Extensions {
            emissive_strength,
            specular: self.microfacets.is_none().then_some(Specular { specular_factor: 0.0 }),
            transmission: self.glass.map(|_| Transmission { transmission_factor: 1.0 }),
            ior: self.glass.map(|glass| IndexOfRefraction { ior: glass.ior }),
            volume: self.glass.map(|glass| Volume {
                thickness_factor: glass.thickness,
                attenuation_distance: glass.attenuation_distance,
                attenuation_color: glass.attenuation_colour,
            }),
        }
    }

    pub(crate) fn entry(&self) -> MaterialEntry {
        let [r, g, b] = self.base_colour;
        let [metallic_factor, roughness_factor] = self.microfacets.unwrap_or([0.0, 1.0]);
        let (emissive_factor, emissive_strength) = self.emission();
        MaterialEntry {
            name: self.name.clone(),
            pbr_metallic_roughness: MetallicRoughness {
                base_color_factor: [r, g, b, 1.0],
                base_color_texture: self.base_texture,
                metallic_factor,
                roughness_factor,
            },
            emissive_factor,
            emissive_texture: self.emissive_texture,
            alpha_mode: self.alpha_cutoff.map(|_| "MASK"),
            alpha_cutoff: self.alpha_cutoff,
            double_sided: self.double_sided,
            extensions: self.extensions(emissive_strength),
            extras: self.phong.map(|phong| Extras { photoncard: PhotoncardExtras { phong } }),
        }
    }
}

fn info(index: usize, transform: Option<TextureTransform>) -> TextureInfo {
    TextureInfo { index, extensions: transform.map(|transform| TextureExtensions { transform }) }
}
