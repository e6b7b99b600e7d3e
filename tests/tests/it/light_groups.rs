//! Light groups: their light adds up to the picture, each is that of its lights alone, and a mix is a render
//! with other strengths.

use std::path::Path;

use glam::Vec3;
use photoncard_driver::exr::mix::{Gain, Mix};
use photoncard_driver::exr::{Content, SampleFormat, Shown, bytes, read};
use photoncard_driver::film::Film;
use photoncard_driver::layer::Layers;
use photoncard_driver::parts::{Part, PartHead, Parts, write};
use photoncard_driver::render::{RenderSettings, Rendering};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_tests::everything::everything;
use photoncard_tests::render_or_panic;

/// Groups of the scene with every feature: all three kinds of lights are in several groups.
const GROUPS: [&str; 3] = ["key=lamp", "punctual=light", "sky=environment"];

/// The scene with every feature, and with light groups.
fn grouped(requests: &[&str]) -> Scene {
    let mut scene = everything();
    let requests: Vec<String> = requests.iter().map(|&request| request.to_owned()).collect();
    scene.set_light_groups(&requests).expect("there are these lights");
    scene
}

fn settings(scene: &Scene) -> RenderSettings {
    RenderSettings::default().with(|s| {
        (s.picture.width, s.picture.height) = (20, 16);
        s.picture.light_groups = scene.light_groups.names().to_vec();
        (s.photons.count, s.photons.neighbors, s.photons.caustic_photons) = (4000, 30, Some(1000));
        (s.integrator.gather_rays, s.integrator.shadow_rays, s.integrator.samples) = (16, 4, 4);
    })
}

/// Techniques with which light reaches a pixel by different ways.
fn techniques(scene: &Scene) -> Vec<RenderSettings> {
    let of = |change: &dyn Fn(&mut RenderSettings)| settings(scene).with(|s| change(s));
    vec![
        of(&|_| {}),
        of(&|s| s.integrator.irradiance_error = Some(0.1)),
        of(&|s| s.integrator.gather_rays = 0),
        of(&|s| s.integrator.adaptive_threshold = Some(0.2)),
        of(&|s| s.picture.layers = Layers::without_mattes()),
    ]
}

fn encoded(film: &Film, layers: &Layers, format: SampleFormat) -> Vec<u8> {
    bytes(Path::new("a.exr"), &Content::new(film, layers), "{}", format).expect("encodes")
}

#[test]
fn the_groups_of_each_pixel_add_up_to_its_radiance_to_the_bit() {
    let scene = grouped(&GROUPS);
    for settings in techniques(&scene) {
        let film = render_or_panic(&scene, &settings).film;
        assert_eq!(film.light_groups(), ["key", "punctual", "rest", "sky"]);
        let mut lit = [false; 4];
        for (pixel, sums) in film.all().zip(film.sums()) {
            let [first, rest @ ..] = pixel.light_groups.map(Vec3::from);
            let sum = rest.into_iter().fold(first, |sum, group| sum + group);
            assert_eq!(sum.to_array(), pixel.pixel.radiance);
            lit.iter_mut().zip(pixel.light_groups).for_each(|(lit, group)| *lit |= group != [0.0; 3]);
            // The exact sums of components and of groups are equal too.
            if let Some(layers) = sums.layers {
                let components = [layers.direct, layers.indirect, layers.caustic];
                let total =
                    [0, 1, 2].map(|channel| components.iter().map(|light| light[channel]).sum::<i64>());
                assert_eq!(total, sums.light);
            }
        }
        assert_eq!(lit, [true; 4]);
    }
}

#[test]
fn all_lights_in_one_group_are_the_picture_without_groups() {
    let plain = everything();
    let one = grouped(&["all=lamp,light,screen,panel,environment"]);
    for (with, without) in techniques(&one).into_iter().zip(techniques(&plain)) {
        let [with, without] =
            [render_or_panic(&one, &with), render_or_panic(&plain, &without)].map(|rendering| rendering.film);
        assert!(with.pixels().eq(without.pixels()));
        assert!(with.all().all(|pixel| pixel.light_groups[0] == pixel.pixel.radiance));
    }
}

/// Mean radiance of a picture of the scene whose other lights are off.
fn mean_of_alone(group: &str, settings: &RenderSettings) -> f64 {
    let mut scene = everything();
    let has = |name: &str| group == name;
    for material in &mut scene.materials {
        let is_on = match &*material.name {
            "lamp" => has("key"),
            "screen" | "panel" => has("rest"),
            _ => true,
        };
        material.emission *= if is_on { 1.0 } else { 0.0 };
    }
    scene.lights.retain(|_| has("punctual"));
    scene.environment = scene.environment.take().filter(|_| has("sky"));
    let film = render_or_panic(&scene, settings).film;
    mean(film.pixels().map(|pixel| luminance(pixel.radiance)))
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

fn luminance(radiance: [f32; 3]) -> f64 {
    radiance.into_iter().map(f64::from).sum::<f64>() / 3.0
}

/// Mean over seeds, whose photons are shared by all groups in one of the compared pictures.
fn over_seeds(of_seed: impl Fn(u32) -> f64) -> f64 {
    mean((0..SEEDS).map(of_seed))
}

const SEEDS: u32 = 4;

#[test]
fn the_light_of_a_group_is_that_of_a_scene_without_the_other_lights() {
    let scene = grouped(&GROUPS);
    for irradiance_error in [None, Some(0.05)] {
        let fine = |scene: &Scene, seed| {
            settings(scene).with(|s| {
                s.integrator.seed = seed;
                (s.photons.count, s.photons.caustic_photons) = (60_000, Some(20_000));
                (s.integrator.samples, s.integrator.gather_rays) = (8, 32);
                s.integrator.irradiance_error = irradiance_error;
            })
        };
        let films: Vec<Film> =
            (0..SEEDS).map(|seed| render_or_panic(&scene, &fine(&scene, seed)).film).collect();
        let all = ["key", "punctual", "rest", "sky"].into_iter().enumerate();
        // Records hold the light of all groups alike.
        for (index, group) in all.filter(|(_, group)| irradiance_error.is_none() || *group == "key") {
            let of_group = |film: &Film| mean(film.all().map(|pixel| luminance(pixel.light_groups[index])));
            let found = over_seeds(|seed| of_group(&films[seed as usize]));
            let alone = over_seeds(|seed| mean_of_alone(group, &fine(&everything(), seed)));
            let error = found / alone - 1.0;
            assert!(error.abs() < 0.04, "{group}, {irradiance_error:?}: {found} and alone {alone}");
        }
    }
}

#[test]
fn a_mix_without_gains_is_the_file_and_a_mix_with_gains_is_their_sum() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let scene = grouped(&GROUPS);
    let film = render_or_panic(&scene, &settings(&scene)).film;
    for format in [SampleFormat::Float, SampleFormat::Half] {
        let file = encoded(&film, &Layers::default(), format);
        std::fs::write(&path, &file).expect("writes");
        let mut mix = Mix::read(&path).expect("reads");
        assert!(mix.groups().eq(["key", "punctual", "rest", "sky"]));
        mix.apply(&[]).expect("mixes");
        assert!(mix.bytes().expect("encodes") == file, "{format:?}");
    }
    std::fs::write(&path, encoded(&film, &Layers::default(), SampleFormat::Float)).expect("writes");
    let gains: [Gain; 2] = ["key=1.5,0.9,0.8", "sky=0"].map(|text| text.parse().expect("a gain"));
    let mut mix = Mix::read(&path).expect("reads");
    mix.apply(&gains).expect("mixes");
    mix.write(&path).expect("writes");
    let mixed = read(&path, Shown::Rendered).expect("reads");
    let provenance = mixed.provenance.expect("a provenance");
    assert!(provenance.contains("mix") && provenance.contains("key"), "{provenance}");
    for (pixel, mixed) in film.all().zip(mixed.pixels) {
        let [key, punctual, rest, sky] = pixel.light_groups.map(Vec3::from);
        let expected = key * Vec3::new(1.5, 0.9, 0.8) + punctual + rest + sky * 0.0;
        assert_eq!(expected.to_array(), mixed);
    }
}

#[test]
fn a_mix_is_a_render_with_these_strengths() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    let mut scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    scene.environment = Some(photoncard_driver::scene::Environment::constant(Vec3::new(0.2, 0.3, 0.5)));
    let material = scene.materials.iter().find(|material| material.is_emissive()).expect("a lamp");
    let lamp = material.name.clone();
    let stronger = scene.clone().with(|scene| {
        scene.materials.iter_mut().filter(|material| material.name == lamp).for_each(|m| m.emission *= 0.25);
        scene.environment.as_mut().expect("a sky").strength = 3.0;
    });
    scene.set_light_groups(&[format!("lamp={lamp}"), "sky=environment".into()]).expect("there are these");
    let fine = |scene: &Scene| {
        settings(scene).with(|s| {
            (s.picture.width, s.picture.height) = (32, 32);
            (s.photons.count, s.photons.neighbors) = (60_000, 50);
            (s.integrator.samples, s.integrator.gather_rays, s.integrator.irradiance_error) =
                (64, 64, Some(0.05));
        })
    };
    let film = render_or_panic(&scene, &fine(&scene)).film;
    let other = render_or_panic(&stronger, &fine(&stronger)).film;
    // Blocks of 8 x 8 pixels, to average the noise.
    let mut blocks = [[0.0_f64; 2]; 16];
    for (index, (pixel, other)) in film.all().zip(other.pixels()).enumerate() {
        let [lamp, _, sky, _] = pixel.light_groups.map(Vec3::from);
        let block = &mut blocks[index / 32 / 8 * 4 + index % 32 / 8];
        block[0] += luminance((lamp * 0.25 + sky * 3.0).to_array());
        block[1] += luminance(other.radiance);
    }
    let mut errors: Vec<f64> =
        blocks.iter().map(|[mixed, rendered]| (mixed / rendered - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let [mixed, rendered] = [0, 1].map(|which: usize| blocks.iter().map(|block| block[which]).sum::<f64>());
    assert!((mixed / rendered - 1.0).abs() < 0.01, "{mixed} and {rendered}");
    assert!(errors[8] < 0.02 && errors[15] < 0.1, "{errors:?}");
}

#[test]
fn parts_merge_to_the_file_of_the_whole_with_all_groups() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = grouped(&GROUPS);
    let layers = Layers::default();
    let whole = render_or_panic(&scene, &settings(&scene)).film;
    let paths: Vec<_> = (1..=3)
        .map(|number| {
            let part = Part::new(number, 3).expect("a part");
            let part_of = settings(&scene).with(|s| s.schedule.part = Some(part));
            let Rendering { film, statistics, .. } = render_or_panic(&scene, &part_of);
            let pixels = statistics.provenance.pixels;
            let head = PartHead::new(part, &film, pixels, &layers, None, Vec::new());
            let path = folder.path().join(format!("{number}.part"));
            write(&path, &head, &film).expect("writes");
            path
        })
        .collect();
    let merged = Parts::open(&paths).expect("parts of one picture").merge().expect("merges").film;
    assert_eq!(merged.light_groups(), whole.light_groups());
    assert!(encoded(&merged, &layers, SampleFormat::Float) == encoded(&whole, &layers, SampleFormat::Float));
}

#[test]
fn settings_without_the_scenes_groups_are_refused() {
    let scene = grouped(&GROUPS);
    let other = RenderSettings { ..settings(&everything()) };
    let rendered = photoncard_driver::render::render(&scene, &other, &photoncard_driver::render::Unobserved);
    let error = rendered.err().expect("an error").to_string();
    assert!(error.contains("key, punctual, rest, sky"), "{error}");
}
