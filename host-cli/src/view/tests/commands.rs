//! Checks that the command line shown by a view parses to the settings of the final picture.

use clap::Parser;
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Quality, Stated};
use photoncard_driver::render::{Filter, Radiance, Sampling};
use photoncard_driver::scheduler::GatherOrder;

use super::random::Random;
use crate::arguments::{Arguments, Command, RenderOptions, ViewOptions};
use crate::view::command_line::{quoted, words};
use crate::view::request::{Extent, Setting, View};
use crate::view::wish::Wish;

/// Parses the arguments of `photoncard view`.
pub(super) fn view_options(arguments: &[String]) -> ViewOptions {
    let command = ["photoncard".to_owned(), "view".to_owned()];
    let parsed = Arguments::try_parse_from(command.iter().chain(arguments));
    match parsed.map(|arguments| arguments.command) {
        Ok(Command::View(options)) => *options,
        Ok(_) => panic!("another command"),
        Err(error) => panic!("{arguments:?}: {error}"),
    }
}

/// Splits a shell command line of words with single quotes and, outside of them, backslashes.
fn split(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let (mut is_quoted, mut is_escaped) = (false, false);
    for character in line.chars() {
        let last = words.last_mut().unwrap();
        match character {
            _ if is_escaped => {
                last.push(character);
                is_escaped = false;
            }
            '\'' => is_quoted = !is_quoted,
            '\\' if !is_quoted => is_escaped = true,
            ' ' if !is_quoted => words.push(String::new()),
            _ => last.push(character),
        }
    }
    words
}

fn render_options(line: &str) -> RenderOptions {
    match Arguments::try_parse_from(split(line)).map(|arguments| arguments.command) {
        Ok(Command::Render(options)) => *options,
        Ok(_) => panic!("another command"),
        Err(error) => panic!("{line}: {error}"),
    }
}

/// Random options of a view.
fn options(random: &mut Random) -> Vec<String> {
    let quality = random.one(Quality::ALL).name();
    let mut options = vec![random.one(&["scene.gltf", "a b/it's.glb", "-x.gltf", "ä$(x).gltf"]).to_owned()];
    if options[0].starts_with('-') {
        options.insert(0, "--".into());
    }
    let mut named = vec![format!("--quality={quality}")];
    let choices: [(&str, String); 16] = [
        ("seed", random.below(1 << 32).to_string()),
        ("tile", (1 + random.below(64)).to_string()),
        ("spp", (1 + random.below(64)).to_string()),
        ("gather-rays", random.below(100).to_string()),
        ("shadow-rays", random.below(9).to_string()),
        ("photons", (1 + random.below(1 << 20)).to_string()),
        ("neighbors", (2 + random.below(200)).to_string()),
        ("caustic-photons", random.below(1 << 20).to_string()),
        ("max-distance", random.number(1e-3).abs().max(1e-9).to_string()),
        ("near-distance", random.number(1e-3).abs().to_string()),
        ("irradiance-cache", random.one(&["on", "off"]).to_owned()),
        ("ic-error", (0.01 + random.number(0.005)).to_string()),
        ("sampling", random.one(Sampling::ALL).name().to_owned()),
        ("radiance", random.one(Radiance::ALL).name().to_owned()),
        ("filter", random.one(Filter::ALL).name().to_owned()),
        ("camera", random.one(&["eye", "the 'left' one", "-", "$HOME"]).to_owned()),
    ];
    let more: [(&str, &str); 8] = [
        ("set", "wall 'n'.diffuse=0.1,0.2,0.3"),
        ("aov", "direct,Z"),
        ("environment", "0.5,0.25,1"),
        ("environment", "my sky.exr"),
        ("sky", "-33.9,18.4,2026-06-21T14:30+02:00,2.5"),
        ("north", "-30"),
        ("light-units", "watts"),
        ("texture-limit", "64"),
    ];
    let all = choices.iter().map(|(name, value)| (*name, value.as_str())).chain(more);
    for (name, value) in all {
        let is_given = named.iter().any(|option| option.starts_with(&format!("--{name}=")));
        let has = |other: &str| named.iter().any(|option| option.starts_with(&format!("--{other}=")));
        let is_excluded = match name {
            "sky" => has("environment"),
            "north" => !has("sky"),
            _ => false,
        };
        if random.below(3) == 0 && !is_given && !is_excluded {
            named.push(format!("--{name}={value}"));
        }
    }
    named.extend(options);
    named
}

/// Request of a view with `options`, after random changes by a page.
fn wish(options: &ViewOptions, random: &mut Random) -> Wish {
    let mut wish = Wish::new(options.settings(), options.stated(), options.scene.assignments.clone());
    for _ in 0..random.below(6) {
        let mut place = |reach: f32| [(); 3].map(|()| f64::from(random.number(reach)));
        match place(1.0)[0] {
            change if change < -0.4 => {
                let [size, longitude, latitude] = place(1.0).map(|size| size.abs() as f32);
                let shown = match change {
                    change if change < -0.8 => Extent::Angles([360.0 * longitude, 180.0 * latitude]),
                    change if change < -0.6 => Extent::Height(size),
                    _ => Extent::Fov(90.0 * size),
                };
                let camera = (size < 0.5).then(|| "a camera".into());
                wish.look(View {
                    camera,
                    position: place(1e3),
                    look_at: place(1e-6),
                    up: None,
                    shift: None,
                    lens: None,
                    shown,
                });
            }
            change if change < 0.0 => wish.set("lamp \"x\".emission".into(), place(1e20).to_vec()),
            change if change < 0.2 => wish.set("a.exponent".into(), vec![place(1e-20)[0].abs()]),
            change if change < 0.6 => wish.change(random.one(&[
                Setting::Photons(77_777),
                Setting::Samples(3),
                Setting::GatherRays(0),
                Setting::GatherRays(17),
                Setting::Cache(true),
                Setting::Cache(false),
                Setting::Sampling(Sampling::Mixture),
                Setting::Order(GatherOrder::Tiled),
                Setting::Tile(8),
                Setting::Tile(0),
            ])),
            _ => {
                wish.add_layers();
            }
        }
    }
    wish
}

#[test]
fn the_command_line_shown_parses_to_the_settings_of_the_view() {
    let mut random = Random(1);
    for _ in 0..2000 {
        let arguments = options(&mut random);
        let view = view_options(&arguments);
        let wish = wish(&view, &mut random);
        let line = quoted(&words(&view.scene, view.quality, view.finish(), &wish));
        let render = render_options(&line);
        let settings = render.settings();
        assert_eq!(settings.of_pixels(), wish.settings.of_pixels(), "{arguments:?}: {line}");
        assert_eq!(settings.photons.layout, wish.settings.photons.layout, "{line}");
        assert_eq!(settings.schedule.order, wish.settings.schedule.order, "{line}");
        assert_eq!(settings.schedule.tile, wish.settings.schedule.tile, "{line}");
        assert_eq!(settings.picture.layers, wish.settings.picture.layers, "{line}");
        // The command line states every setting that a quality could choose, except a number of caustic
        // photons that is left to its default.
        assert_eq!(Stated { caustic_photons: true, ..render.stated() }, Stated::ALL, "{line}");
        assert_eq!(render.scene.assignments, wish.assignments(), "{line}");
        assert_eq!(render.scene.variant, view.scene.variant, "{line}");
        assert_eq!(render.scene.environment, view.scene.environment, "{line}");
        assert_eq!(render.scene.sky, view.scene.sky, "{line}");
        assert_eq!(render.scene.north, view.scene.north, "{line}");
        assert_eq!(render.scene.lights.light_units, view.scene.lights.light_units, "{line}");
        let path = render.scene.path.strip_prefix(".").unwrap_or(&render.scene.path);
        assert_eq!(path, view.scene.path, "{line}");
    }
}

#[test]
fn numbers_and_words_survive_a_shell() {
    let view = view_options(&["it's a scene.gltf".into()]);
    let mut wish = Wish::new(view.settings(), view.stated(), Vec::new());
    let (position, look_at) = ([0.1, -2.0, 1e-7], [f64::MIN_POSITIVE, 16_777_216.0, -0.0]);
    let (up, shift) = (Some([0.0, -1e-7, 1.0]), Some([0.1, -0.3]));
    let lens = Some([0.25, 3.0]);
    wish.look(View { camera: None, position, look_at, up, shift, lens, shown: Extent::Fov(33.3) });
    let line = quoted(&words(&view.scene, view.quality, view.finish(), &wish));
    assert!(line.starts_with(r"photoncard render 'it'\''s a scene.gltf' --quality good "), "{line}");
    let shell = std::process::Command::new("sh").arg("-c").arg(format!("printf '%s\\n' {line}")).output();
    let Ok(output) = shell else {
        eprintln!("SKIPPED: there is no shell `sh`, to which the command line could be given");
        return;
    };
    let said: Vec<_> = String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect();
    assert_eq!(said, split(&line));
    let picture = render_options(&line).settings().picture;
    assert_eq!(picture.camera_at.unwrap().map(f64::to_bits), [0.1_f64, -2.0, 1e-7].map(f64::to_bits));
    assert_eq!(picture.look_at.unwrap()[1..], [16_777_216.0, -0.0]);
}
