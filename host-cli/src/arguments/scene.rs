//! Options of the scene: its file, and changes to it.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::scene::{LightUnits, MAX_SIDE, Material, Reflection, Scene};

use super::lights::LightOptions;
use crate::environment::EnvironmentOption;

#[derive(Args, Clone)]
pub(crate) struct SceneOptions {
    /// A glTF 2.0 file, .gltf or .glb
    #[arg(value_name = "SCENE")]
    pub(crate) path: PathBuf,
    /// Change a material, a light or the environment: NAME.PROPERTY=VALUE; may be repeated
    ///
    /// Properties of a material are diffuse, specular, exponent, metallic, roughness, transmission, ior,
    /// thickness, alpha and emission; those of a point, spot or directional light are colour, intensity and
    /// position. environment.strength is a factor of the environment.
    #[arg(long = "set", value_name = "ASSIGNMENT", help_heading = "Scene", hide_short_help = true)]
    pub(crate) assignments: Vec<String>,
    /// Add the light that rough metals and coats reflect several times between their microfacets
    ///
    /// Blender does so by default; glTF's model leaves this light out, and a metal of roughness 1 is less
    /// than half as bright.
    #[arg(long, help_heading = "Scene", hide_short_help = true)]
    pub(crate) energy_compensation: bool,
    /// Variant of the scene's materials, by its name [default: the materials that its meshes state]
    #[arg(long, value_name = "NAME", help_heading = "Scene", hide_short_help = true)]
    pub(crate) variant: Option<String>,
    /// Scale images down to at most this width and height, texels, by averaging in linear light
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SIDE)), help_heading = "Scene", hide_short_help = true)]
    pub(crate) texture_limit: Option<u32>,
    #[command(flatten)]
    pub(crate) lights: LightOptions,
    /// Light from infinitely far: an equirectangular map, .hdr or .exr, or a constant radiance
    ///
    /// The top of the map is +y. Its middle is -z, or +x for scenes that Blender has exported, as in Blender.
    /// The last bits of an EXR with DWA compression depend on the vector instructions of the processor: for a
    /// farm with several kinds of processors, store the map with ZIP compression.
    #[arg(long, value_name = "FILE|R,G,B", allow_hyphen_values = true, help_heading = "Scene")]
    pub(crate) environment: Option<EnvironmentOption>,
    /// Turn the environment map about +y, counter-clockwise seen from above [default: 0]
    ///
    /// A rotation of A degrees about Z in Blender's Mapping node is -A.
    #[arg(long, value_name = "DEGREES", requires = "environment", allow_negative_numbers = true, value_parser = degrees, help_heading = "Scene", hide_short_help = true)]
    pub(crate) environment_rotation: Option<f32>,
    /// Fail if anything in the scene is ignored or missing, such as a texture
    #[arg(long, help_heading = "Scene", hide_short_help = true)]
    pub(crate) strict: bool,
}

impl SceneOptions {
    /// Reports useless options: calls `add(is_useless, name, reason)` for each option that can be useless.
    pub(super) fn without_effect(&self, scene: &Scene, add: &mut impl FnMut(bool, &str, &str)) {
        let has_lobe =
            |material: &Material| matches!(material.reflection, Reflection::MetallicRoughness { .. });
        let no_lights = self.lights.light_units != LightUnits::Auto && scene.lights.is_empty();
        add(no_lights, "--light-units", "without point, spot or directional lights in the file");
        add(self.texture_limit.is_some() && scene.images.is_empty(), "--texture-limit", "without images");
        let no_lobe = self.energy_compensation && !scene.materials.iter().any(has_lobe);
        add(no_lobe, "--energy-compensation", "without a metallic-roughness material");
    }
}

fn degrees(text: &str) -> Result<f32, String> {
    let degrees = text.parse().ok().filter(|degrees: &f32| degrees.is_finite());
    degrees.ok_or_else(|| "a rotation is a number of degrees, such as 90 or -22.5".into())
}
