//! Input files of a render: scene and environment.

use std::path::Path;

use photoncard_driver::choice::Choice;
use photoncard_driver::render::NamedSettings;
use photoncard_driver::scene::Scene;
use photoncard_driver::scene::gltf::{LoadSettings, load_with};
use serde_json::json;

use crate::arguments::SceneOptions;
use crate::environment::EnvironmentOption;
use crate::failure::Failure;

/// The files, each with its description.
pub(crate) fn files(options: &SceneOptions) -> Vec<(&Path, &'static str)> {
    let mut files = vec![(options.path.as_path(), "the scene")];
    if let Some(EnvironmentOption::File(path)) = &options.environment {
        files.push((path, "the environment"));
    }
    files
}

/// Loads the scene for cards of `dram_bytes`, before the assignments to its materials.
pub(crate) fn load(options: &SceneOptions, dram_bytes: u32) -> Result<Scene, Failure> {
    let (variant, light_units) = (options.variant.clone(), options.lights.light_units);
    let load = LoadSettings { dram_bytes, variant, light_units };
    let mut scene = load_with(&options.path, &load).map_err(Failure::input)?;
    if options.energy_compensation {
        scene.compensate_energy();
    }
    if let Some(environment) = &options.environment {
        scene.environment = Some(environment.load()?);
    }
    Ok(scene)
}

/// File name of the scene.
pub(crate) fn name(options: &SceneOptions) -> String {
    options.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Names of the inputs and of their changes, for the provenance of pixels.
pub(crate) fn provenance(options: &SceneOptions) -> NamedSettings {
    let inputs = [
        ("scene", json!(name(options))),
        ("variant", json!(options.variant)),
        ("light-units", json!(options.lights.light_units.name())),
        ("set", json!(options.assignments)),
        ("energy-compensation", json!(options.energy_compensation)),
        ("environment", json!(options.environment.as_ref().map(EnvironmentOption::name))),
    ];
    inputs.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
