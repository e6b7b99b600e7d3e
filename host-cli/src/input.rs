//! Input files of a render: scene and environment.

use std::path::Path;

use photoncard_driver::choice::Choice;
use photoncard_driver::render::NamedSettings;
use photoncard_driver::scene::gltf::{LoadSettings, Moment, SceneFile};
use photoncard_driver::scene::{Daylight, Environment, Scene, profile_of};
use serde_json::json;

use crate::arguments::SceneOptions;
use crate::environment::EnvironmentOption;
use crate::failure::Failure;

/// Returns the paths of the input files, each with its name in errors: `the scene` or `the environment`.
pub(crate) fn files(options: &SceneOptions) -> Vec<(&Path, &'static str)> {
    let mut files = vec![(options.path.as_path(), "the scene")];
    if let Some(EnvironmentOption::File(path)) = &options.environment {
        files.push((path, "the environment"));
    }
    let profiles = options.assignments.iter().filter_map(|assignment| profile_of(assignment));
    files.extend(profiles.map(|path| (path, "the photometric file")));
    files
}

/// Loads a scene for cards with `dram_bytes` bytes of memory. Assignments (`--set`) are not applied.
pub(crate) fn load(options: &SceneOptions, dram_bytes: u64) -> Result<Scene, Failure> {
    Input::open(options, dram_bytes)?.into_rest()
}

/// Does [`load`], and sets the light groups.
pub(crate) fn load_with_groups(options: &SceneOptions, dram_bytes: u64) -> Result<Scene, Failure> {
    let mut scene = load(options, dram_bytes)?;
    scene.set_light_groups(&options.light_groups).map_err(Failure::input)?;
    Ok(scene)
}

/// Does [`load`], with the second coordinates of all meshes that have them.
pub(crate) fn load_for_lightmaps(options: &SceneOptions, dram_bytes: u64) -> Result<Scene, Failure> {
    Input::open_with(options, dram_bytes, true)?.into_rest()
}

/// Opened scene file and environment, which are read once for all frames.
pub(crate) struct Input {
    pub(crate) file: SceneFile,
    surroundings: Surroundings,
    compensates_energy: bool,
}

/// Light from infinitely far that options state.
#[derive(Clone)]
struct Surroundings {
    /// Environment light, with a notice if texels of its map were clamped.
    environment: Option<(Environment, Option<String>)>,
    /// Rotation of the environment, degrees; `None` if it is not stated.
    rotation: Option<f32>,
    /// Sky and sun by place and time, in lumens.
    daylight: Option<Daylight>,
}

impl Surroundings {
    fn load(options: &SceneOptions) -> Result<Self, Failure> {
        let north = options.north.unwrap_or_default();
        Ok(Self {
            environment: options.environment.as_ref().map(EnvironmentOption::load).transpose()?,
            rotation: options.environment_rotation,
            daylight: options.sky.as_ref().map(|sky| sky.daylight(north)),
        })
    }
}

impl Input {
    /// Opens the files for cards with `dram_bytes` bytes of memory.
    pub(crate) fn open(options: &SceneOptions, dram_bytes: u64) -> Result<Self, Failure> {
        Self::open_with(options, dram_bytes, false)
    }

    fn open_with(
        options: &SceneOptions,
        dram_bytes: u64,
        lightmap_coordinates: bool,
    ) -> Result<Self, Failure> {
        let (variant, light_units) = (options.variant.clone(), options.lights.light_units);
        let texture_limit = options.texture_limit;
        let load = LoadSettings { dram_bytes, texture_limit, variant, light_units, lightmap_coordinates };
        Ok(Self {
            file: SceneFile::open(&options.path, &load).map_err(Failure::input)?,
            surroundings: Surroundings::load(options)?,
            compensates_energy: options.energy_compensation,
        })
    }

    fn into_rest(self) -> Result<Scene, Failure> {
        let scene = self.file.into_rest().map_err(Failure::input)?;
        Ok(completed(scene, self.surroundings, self.compensates_energy))
    }

    /// Returns the scene without animation. Assignments (`--set`) are not applied.
    pub(crate) fn at_rest(&self) -> Result<Scene, Failure> {
        let scene = self.file.at_rest().map_err(Failure::input)?;
        Ok(self.completed(scene))
    }

    /// Scene at a moment of its animations. Assignments (`--set`) are not applied.
    pub(crate) fn at(&self, moment: &Moment) -> Result<Scene, Failure> {
        let scene = self.file.at(moment).map_err(Failure::input)?;
        Ok(self.completed(scene))
    }

    fn completed(&self, scene: Scene) -> Scene {
        completed(scene, self.surroundings.clone(), self.compensates_energy)
    }
}

/// Adds the environment to a loaded scene, turned by `rotation` degrees plus the turn that the scene's
/// exporter implies. Compensates the energy of rough reflections if `compensates_energy`. Adds notices about
/// clamped texels, about the exporter's turn, and about a rotation without effect. A sky replaces the
/// environment.
fn completed(mut scene: Scene, surroundings: Surroundings, compensates_energy: bool) -> Scene {
    if compensates_energy {
        scene.compensate_energy();
    }
    let Surroundings { environment, rotation, daylight } = surroundings;
    if let Some(daylight) = daylight {
        add_sky(&mut scene, daylight);
        return scene;
    }
    let (environment, notice) = environment.unzip();
    let turn = scene.environment_turn();
    let is_turned = environment.as_ref().is_some_and(|map| !map.is_equal_around());
    if turn != 0.0 && is_turned {
        scene.remarks.push("the middle of the environment map is +x, as in Blender".to_owned());
    }
    if rotation.is_some() && environment.is_some() && !is_turned {
        let notice = "--environment-rotation has no effect with an environment that is equal all around";
        scene.remarks.push(notice.to_owned());
    }
    let turn = turn + rotation.unwrap_or_default();
    scene.environment = environment.map(|environment| environment.turned(turn));
    scene.notices.extend(notice.flatten());
    scene
}

/// Adds sky and sun, in the scene's units, and a remark by night.
fn add_sky(scene: &mut Scene, daylight: Daylight) {
    let Daylight { environment, sun, elevation } = daylight.in_watts(scene.lumens_per_watt());
    if sun.is_none() {
        let below = -elevation;
        scene.remarks.push(format!(
            "the sky is black: the sun is {below:.1} degrees below the horizon at the place and time of --sky"
        ));
    }
    scene.environment = Some(environment);
    scene.lights.extend(sun);
}

/// File name of the scene, without its folder.
pub(crate) fn name(options: &SceneOptions) -> String {
    options.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the file names of the inputs and the options that change the loaded scene, for the provenance of a
/// picture.
pub(crate) fn provenance(options: &SceneOptions) -> NamedSettings {
    let inputs = [
        ("scene", json!(name(options))),
        ("texture-limit", json!(options.texture_limit)),
        ("variant", json!(options.variant)),
        ("light-units", json!(options.lights.light_units.name())),
        ("set", json!(options.assignments)),
        ("energy-compensation", json!(options.energy_compensation)),
        ("environment", json!(options.environment.as_ref().map(EnvironmentOption::name))),
        ("environment-rotation", json!(options.environment_rotation)),
    ];
    // A picture without light groups or a sky has the provenance that it had before there were any.
    let groups = (!options.light_groups.is_empty()).then(|| ("light-groups", json!(options.light_groups)));
    let sky = options.sky.as_ref().map(|sky| ("sky", json!(sky.to_string())));
    let north = options.north.map(|north| ("north", json!(north)));
    inputs
        .into_iter()
        .chain(groups)
        .chain(sky)
        .chain(north)
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}
