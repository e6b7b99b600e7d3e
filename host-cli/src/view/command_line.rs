//! Command line that renders the final picture that pages request, with every option that the pixels or the
//! work of the picture depend on.

use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Finish, Quality};
use photoncard_driver::render::{Changes, Setting};
use photoncard_driver::scene::LightUnits;

use super::wish::{Wish, numbers};
use crate::arguments::SceneOptions;
use crate::environment::EnvironmentOption;
use crate::shell;

/// Words of the command that renders the final picture of `wish`.
pub(super) fn words(scene: &SceneOptions, quality: Quality, finish: Finish, wish: &Wish) -> Vec<String> {
    let mut words = Words(vec!["photoncard".into(), "render".into(), path(&scene.path.to_string_lossy())]);
    words.add("quality", quality.name());
    of_scene(scene, wish, &mut words);
    for Setting { changes, option, argument, .. } in wish.settings.options() {
        if matches!(changes, Changes::Pixels | Changes::Work) {
            words.add_some(option, argument);
        }
    }
    words.add_switch("denoise", finish == Finish::Denoised);
    words.0.extend(["-o", "picture.exr"].map(str::to_owned));
    words.0
}

/// Words quoted for a shell.
pub(super) fn quoted(words: &[String]) -> String {
    words.iter().map(|word| shell::quoted(word)).collect::<Vec<_>>().join(" ")
}

/// Inserts `./` before a path that begins with a dash, which clap would take for an option.
fn path(path: &str) -> String {
    if path.starts_with('-') { format!("./{path}") } else { path.to_owned() }
}

struct Words(Vec<String>);

impl Words {
    /// Adds an option with its value.
    fn add(&mut self, option: &str, value: &(impl ToString + ?Sized)) {
        let value = value.to_string();
        // Behind `=`, clap does not take a value with a leading dash for an option.
        if value.starts_with('-') {
            self.0.push(format!("--{option}={value}"));
        } else {
            self.0.extend([format!("--{option}"), value]);
        }
    }

    fn add_some(&mut self, option: &str, value: Option<impl ToString>) {
        if let Some(value) = value {
            self.add(option, &value);
        }
    }

    /// Adds an option without a value, if `is_stated`.
    fn add_switch(&mut self, option: &str, is_stated: bool) {
        self.0.extend(is_stated.then(|| format!("--{option}")));
    }
}

fn of_scene(scene: &SceneOptions, wish: &Wish, words: &mut Words) {
    let SceneOptions {
        path: _,
        assignments: _,
        light_groups,
        energy_compensation,
        variant,
        texture_limit,
        lights,
        environment,
        environment_rotation,
        sky,
        north,
        strict,
    } = scene;
    wish.assignments().iter().for_each(|assignment| words.add("set", assignment));
    light_groups.iter().for_each(|group| words.add("light-groups", group));
    words.add_switch("energy-compensation", *energy_compensation);
    words.add_some("variant", variant.as_ref());
    words.add_some("texture-limit", *texture_limit);
    if lights.light_units != LightUnits::default() {
        words.add("light-units", lights.light_units.name());
    }
    words.add_some(
        "environment",
        environment.as_ref().map(|environment| match environment {
            EnvironmentOption::Constant(radiance) => numbers(radiance),
            EnvironmentOption::File(file) => path(&file.to_string_lossy()),
            EnvironmentOption::Dropped(file) => path(&file.name),
        }),
    );
    words.add_some("environment-rotation", *environment_rotation);
    words.add_some("sky", sky.as_ref());
    words.add_some("north", *north);
    words.add_switch("strict", *strict);
}
