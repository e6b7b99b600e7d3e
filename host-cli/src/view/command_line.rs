//! Command line that renders a settled picture, with every option on which pixels depend.

use photoncard_driver::choice::Choice;
use photoncard_driver::quality::Quality;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture};
use photoncard_driver::scene::LightUnits;

use super::wish::{Wish, numbers};
use crate::arguments::SceneOptions;
use crate::environment::EnvironmentOption;
use crate::shell;

/// Words of the command that renders the picture of a wish.
pub(super) fn words(scene: &SceneOptions, quality: Quality, wish: &Wish) -> Vec<String> {
    let mut words = Words(vec!["photoncard".into(), "render".into(), path(&scene.path.to_string_lossy())]);
    words.add("--quality", quality.name());
    of_scene(scene, wish, &mut words);
    of_picture(&wish.settings.picture, &mut words);
    of_photons(&wish.settings.photons, &mut words);
    of_rays(&wish.settings.integrator, &mut words);
    words.add("--order", wish.settings.schedule.order.name());
    words.add_some("--tile", wish.settings.schedule.tile);
    words.add("-o", "picture.exr");
    words.0
}

/// Words quoted for a shell.
pub(super) fn quoted(words: &[String]) -> String {
    words.iter().map(|word| shell::quoted(word)).collect::<Vec<_>>().join(" ")
}

/// Path that cannot be mistaken for an option.
fn path(path: &str) -> String {
    if path.starts_with('-') { format!("./{path}") } else { path.to_owned() }
}

struct Words(Vec<String>);

impl Words {
    fn add(&mut self, option: &str, value: &(impl ToString + ?Sized)) {
        let value = value.to_string();
        // A value that begins like an option is none after an equals sign.
        if value.starts_with('-') {
            self.0.push(format!("{option}={value}"));
        } else {
            self.0.extend([option.to_owned(), value]);
        }
    }

    fn add_some(&mut self, option: &str, value: Option<impl ToString>) {
        if let Some(value) = value {
            self.add(option, &value);
        }
    }
}

fn of_scene(scene: &SceneOptions, wish: &Wish, words: &mut Words) {
    let SceneOptions {
        path: _,
        assignments: _,
        energy_compensation,
        variant,
        lights,
        environment,
        environment_rotation,
        strict,
    } = scene;
    wish.assignments().iter().for_each(|assignment| words.add("--set", assignment));
    if *energy_compensation {
        words.0.push("--energy-compensation".into());
    }
    words.add_some("--variant", variant.as_ref());
    if lights.light_units != LightUnits::default() {
        words.add("--light-units", lights.light_units.name());
    }
    words.add_some(
        "--environment",
        environment.as_ref().map(|environment| match environment {
            EnvironmentOption::Constant(radiance) => numbers(radiance),
            EnvironmentOption::File(file) => path(&file.to_string_lossy()),
        }),
    );
    words.add_some("--environment-rotation", *environment_rotation);
    if *strict {
        words.0.push("--strict".into());
    }
}

fn of_picture(picture: &Picture, words: &mut Words) {
    let Picture { width, height, crop: _, camera, camera_at, look_at, fov, layers, filter } = picture;
    words.add("--size", &format!("{width}x{height}"));
    words.add_some("--camera", camera.as_ref());
    words.add_some("--camera-at", camera_at.map(|place| numbers(&place)));
    words.add_some("--look-at", look_at.map(|place| numbers(&place)));
    words.add_some("--fov", *fov);
    words.add("--aov", layers);
    words.add("--filter", filter.name());
}

fn of_photons(photons: &PhotonMaps, words: &mut Words) {
    let PhotonMaps {
        count,
        photons_for,
        layout,
        neighbors,
        max_distance,
        caustic_photons,
        caustic_neighbors,
        radiance,
    } = photons;
    words.add("--photons", count);
    words.add("--photons-for", photons_for.resolved().name());
    words.add("--photon-map", layout.name());
    words.add("--neighbors", neighbors);
    words.add_some("--caustic-photons", *caustic_photons);
    words.add("--caustic-neighbors", caustic_neighbors);
    words.add_some("--max-distance", *max_distance);
    words.add("--radiance", radiance.name());
}

fn of_rays(integrator: &Integrator, words: &mut Words) {
    let Integrator {
        seed,
        samples,
        planned_samples,
        gather_rays,
        shadow_rays,
        sampling,
        irradiance_error,
        adaptive_threshold,
    } = integrator;
    words.add("--seed", seed);
    words.add("--spp", samples);
    words.add_some("--planned-spp", *planned_samples);
    words.add("--gather-rays", gather_rays);
    words.add("--shadow-rays", shadow_rays);
    words.add("--sampling", sampling.name());
    words.add("--irradiance-cache", if irradiance_error.is_some() { "on" } else { "off" });
    words.add_some("--ic-error", *irradiance_error);
    words.add("--adaptive", &adaptive_threshold.map_or("off".to_owned(), |threshold| threshold.to_string()));
}
