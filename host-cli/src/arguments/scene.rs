//! Options of the scene: its file, and changes to it.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::scene::{LightUnits, MAX_SIDE, Material, Reflection, Scene, Sky};

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
    /// thickness, alpha and emission; those of a point, spot or directional light are colour, intensity,
    /// position, angle and ies, a photometric file. environment.strength is a factor of the environment.
    #[arg(long = "set", value_name = "ASSIGNMENT", help_heading = "Scene", hide_short_help = true)]
    pub(crate) assignments: Vec<String>,
    /// Separate the light of a group: GROUP=SOURCE,SOURCE with the names of lights, materials or objects, or
    /// environment; may be repeated, for up to four groups
    ///
    /// An EXR then has a layer for each group, and photoncard mix changes their light without a render. Light
    /// that no group names is in the group rest. With file, the groups are those that the file's extras
    /// state.
    #[arg(long, value_name = "GROUP=SOURCES", help_heading = "Scene", hide_short_help = true)]
    pub(crate) light_groups: Vec<String>,
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
    #[arg(long, value_name = "DEGREES", requires = "environment", conflicts_with = "sky", allow_negative_numbers = true, value_parser = degrees, help_heading = "Scene", hide_short_help = true)]
    pub(crate) environment_rotation: Option<f32>,
    /// Light of a clear sky and of the sun at a place and a time, such as 52.5,13.4,2026-06-21T14:30+02:00
    ///
    /// Latitude and longitude are degrees, north and east positive; the time is of ISO 8601 with its offset
    /// from UTC. The turbidity is 1.7 to 10: 2 is very clear air, 3 clear [default: 3], 6 hazy. The light is
    /// in cd/m^2 and lx, or in watts in files of Blender. The sun is a directional light called sun. Below
    /// the horizon is a ground with an albedo of 0.2; by night the sky is black.
    #[arg(
        long,
        value_name = "LAT,LON,TIME[,TURBIDITY]",
        allow_hyphen_values = true,
        conflicts_with = "environment",
        help_heading = "Scene"
    )]
    pub(crate) sky: Option<Sky>,
    /// Turn north from -z about +y, counter-clockwise seen from above [default: 0]
    ///
    /// East is +x then. In files of Blender, whose +y is -z of the exported file, north is +y.
    #[arg(long, value_name = "DEGREES", requires = "sky", allow_negative_numbers = true, value_parser = degrees, help_heading = "Scene", hide_short_help = true)]
    pub(crate) north: Option<f32>,
    /// Fail if anything in the scene is ignored or missing, such as a texture
    #[arg(long, help_heading = "Scene", hide_short_help = true)]
    pub(crate) strict: bool,
}

impl SceneOptions {
    /// Returns whether an option states the light from infinitely far.
    pub(crate) fn states_environment(&self) -> bool {
        self.environment.is_some() || self.sky.is_some()
    }

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
