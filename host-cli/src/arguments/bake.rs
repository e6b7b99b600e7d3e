//! Options of `photoncard bake`.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::parts::Part;
use photoncard_driver::render::RenderSettings;
use photoncard_driver::render::bake::{BakeSettings, MaterialForm};

use super::cards::CardOptions;
use super::choice::choice;
use super::farm::JobOptions;
use super::files::file;
use super::host::HostOptions;
use super::scene::SceneOptions;
use super::schedule::ScheduleOptions;
use super::sensors::SensorOptions;

#[derive(Args)]
pub(crate) struct BakeOptions {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    /// The file to write: a glb with its lightmaps, or the light of a part of them
    #[arg(short, long, value_name = "OUT.glb|OUT.part", value_parser = file())]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) texels: TexelOptions,
    #[command(flatten)]
    pub(crate) files: PageOptions,
    #[command(flatten)]
    pub(crate) samples: SensorOptions,
    /// Measure only the K-th of N parts of the texels, and write their light: OUT.part
    #[arg(long, value_name = "K/N", conflicts_with_all = ["merge", "exr", "rgbm", "denoise"])]
    pub(crate) part: Option<Part>,
    /// Put together the files of all parts instead of measuring
    #[arg(long, value_name = "PART", num_args = 1.., conflicts_with = "farm", value_parser = part_file)]
    pub(crate) merge: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) job: JobOptions,
    #[command(flatten)]
    pub(crate) schedule: ScheduleOptions,
    #[command(flatten)]
    pub(crate) cards: CardOptions,
    #[command(flatten)]
    pub(crate) host: HostOptions,
}

/// Parses the path of a part. The option takes all words behind it, so that a scene there is a mistake.
fn part_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_scene = path.extension().is_some_and(|ending| ending == "gltf" || ending == "glb");
    if is_scene { Err("it is a scene; name the scene before --merge".into()) } else { Ok(path) }
}

#[derive(Args)]
#[command(next_help_heading = "Texels")]
pub(crate) struct TexelOptions {
    /// Object that gets a lightmap, by the name of its node; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    object: Vec<String>,
    /// Texels per metre [default: as many as one page of 1024 x 1024 texels holds]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    texels_per_metre: Option<f64>,
    /// Side of the pages, texels
    #[arg(long, value_name = "TEXELS", default_value_t = BakeSettings::default().size, allow_negative_numbers = true)]
    size: u32,
    /// Points along a texel at which its light is measured, which share its samples
    #[arg(long, value_name = "N", default_value_t = BakeSettings::default().supersample, allow_negative_numbers = true, hide_short_help = true)]
    supersample: u32,
}

#[derive(Args)]
#[command(next_help_heading = "Files")]
pub(crate) struct PageOptions {
    /// Materials of the glb: baked, black surfaces that emit their light; or kept, with irradiance as a loose
    /// texture that extras name
    #[arg(long, default_value = MaterialForm::Baked.name(), value_parser = choice::<MaterialForm>())]
    pub(crate) materials: MaterialForm,
    /// Write the irradiance of each page too, W/m^2: OUT.0.exr, float
    #[arg(long)]
    pub(crate) exr: bool,
    /// Remove noise by Open Image Denoise, a library that is looked for at run time
    #[arg(long)]
    pub(crate) denoise: bool,
    /// Write the irradiance of each page too, as RGBM of a range that extras state: OUT.0.png
    #[arg(long)]
    pub(crate) rgbm: bool,
}

impl BakeOptions {
    /// Settings of texels and sensors.
    pub(crate) fn bake(&self) -> BakeSettings {
        let TexelOptions { object, texels_per_metre, size, supersample } = &self.texels;
        BakeSettings {
            objects: object.clone(),
            density: *texels_per_metre,
            size: *size,
            supersample: *supersample,
        }
    }

    /// Settings of the measurement. The sensors of a texel share its samples.
    pub(crate) fn settings(&self) -> RenderSettings {
        let sensors = self.texels.supersample.saturating_pow(2).max(1);
        self.samples.settings(&self.schedule, &self.cards).with(|settings| {
            settings.integrator.samples = settings.integrator.samples.div_ceil(sensors);
        })
    }
}
