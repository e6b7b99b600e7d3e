//! Qualities: settings that pilot renders choose for a scene.

use glam::Vec3;
use photoncard_driver::film::Window;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::{Finish, Fit, Quality, Stated};
use photoncard_driver::render::{RenderSettings, Sampling, Unobserved};
use photoncard_driver::scene::gltf;
use photoncard_driver::scene::{
    Environment, LightAxes, Material, PunctualKind, PunctualLight, Reflection, Scene, Triangle,
};
use photoncard_tests::{camera, lambertian, mean, quad, render_or_panic, room, scene};

use super::specular::mirror;

/// Settings of a small picture with the quality `good`.
fn small() -> RenderSettings {
    Quality::Good.settings().with(|settings| {
        (settings.picture.width, settings.picture.height) = (64, 48);
    })
}

fn fit(scene: &Scene, settings: &RenderSettings) -> Fit {
    let packed = PackedScene::new(scene).expect("packs");
    let fit = Quality::Good.fit((Finish::Rendered, None), (scene, &packed), settings, &Unobserved);
    fit.unwrap_or_else(|error| panic!("{error}")).expect("good depends on the scene")
}

fn shipped(name: &str) -> Scene {
    let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

/// Room with grey walls, one of which emits.
fn lit_room() -> Scene {
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let materials = vec![lambertian("wall", 0.5), lamp];
    scene(room([0, 0, 0, 1, 0, 0]), materials, camera(Vec3::new(0.0, 0.0, 0.9), Vec3::NEG_Z))
}

/// Room with a point light in its middle.
fn room_with_a_point() -> Scene {
    let mut scene =
        scene(room([0; 6]), vec![lambertian("wall", 0.5)], camera(Vec3::new(0.0, 0.0, 0.9), Vec3::NEG_Z));
    let kind = PunctualKind::Point { position: Vec3::ZERO };
    scene.lights.push(PunctualLight {
        name: "light".into(),
        kind,
        intensity: Vec3::ONE,
        axes: LightAxes::default(),
    });
    scene
}

#[test]
fn found_settings_depend_neither_on_threads_nor_on_the_crop_window() {
    let scene = shipped("cornell.gltf");
    let settings = small();
    let expected = fit(&scene, &settings);
    let cropped = settings.clone().with(|s| s.picture.crop = Some(Window { x0: 0, x1: 1, y0: 0, y1: 1 }));
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert_eq!(pool.install(|| fit(&scene, &settings)), expected);
        assert_eq!(pool.install(|| fit(&scene, &cropped)), expected);
    }
}

/// From a point, a point light has one direction and distance; parts of a lamp differ in distance, angle and
/// occlusion.
#[test]
fn a_point_light_takes_one_shadow_ray_and_a_lamp_more() {
    assert_eq!(fit(&room_with_a_point(), &small()).shadow_rays, 1);
    assert!(fit(&shipped("cornell.gltf"), &small()).shadow_rays > 1);
}

/// The noise of textures and edges falls with more samples, and not with more rays per sample.
#[test]
fn a_textured_room_takes_more_samples_than_one_of_plain_walls() {
    let [plain, textured] = ["cornell.gltf", "room.glb"].map(|name| fit(&shipped(name), &small()));
    assert!(textured.samples > plain.samples, "{textured:?} {plain:?}");
    assert!(textured.measured.place > plain.measured.place, "{textured:?} {plain:?}");
}

/// In a larger picture, an irradiance record serves more pixels.
#[test]
fn a_pixel_of_a_larger_picture_has_a_smaller_share_in_the_gather_rays_of_records() {
    let scene = shipped("cornell.gltf");
    let of_side = |side| fit(&scene, &small().with(|s| (s.picture.width, s.picture.height) = (side, side)));
    let [small, large] = [128, 512].map(|side| of_side(side).measured.gather_rays_per_ray);
    assert!(large < 0.7 * small, "{large} {small}");
}

/// Pilot renders with two seeds differ by their noise, and must choose equal settings.
#[test]
fn found_settings_do_not_depend_on_the_seed() {
    let seeded = |seed| fit(&lit_room(), &small().with(|s| s.integrator.seed = seed));
    assert_eq!(seeded(0), seeded(7));
}

/// A pixel is as noisy in a picture of few pixels as in a large one.
#[test]
fn settings_are_found_for_pictures_of_a_pixel() {
    let scene = shipped("cornell.gltf");
    let of_size = |side| fit(&scene, &small().with(|s| (s.picture.width, s.picture.height) = (side, side)));
    let expected = of_size(32);
    for side in [1, 2, 8] {
        assert_eq!(of_size(side), expected, "{side}");
    }
    assert!(expected.shadow_rays > 1, "{expected:?}");
}

/// Metal has no Lambertian part, whose irradiance could be interpolated.
#[test]
fn irradiance_is_not_interpolated_in_a_scene_of_metal() {
    let mut scene = lit_room();
    scene.materials[0].reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(0.5),
        metallic: 1.0,
        roughness: 0.6,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    assert!(!fit(&scene, &small()).interpolates);
    assert!(fit(&lit_room(), &small()).interpolates);
}

/// Light that many surfaces receive from one bright spot takes more gather rays and photons than light of a
/// visible lamp.
#[test]
fn indirect_light_from_a_spot_takes_more_rays_and_photons() {
    let [lamp, spot] = ["cornell.gltf", "cornell-uplight.gltf"].map(|name| fit(&shipped(name), &small()));
    assert!(spot.gather_rays > lamp.gather_rays && spot.photons > lamp.photons, "{lamp:?} {spot:?}");
    assert!(spot.shadow_rays < lamp.shadow_rays, "{lamp:?} {spot:?}");
}

#[test]
fn the_dissertations_values_depend_on_no_scene() {
    let scene = lit_room();
    let packed = PackedScene::new(&scene).expect("packs");
    let fit = Quality::Paper.fit(
        (Finish::Rendered, None),
        (&scene, &packed),
        &RenderSettings::default(),
        &Unobserved,
    );
    let fit = fit.expect("no pilot");
    assert_eq!(fit, None);
    // The dissertation gathers photons at the end of every gather ray, and its sampling has no foci.
    let dissertation = RenderSettings::default().with(|s| {
        (s.integrator.near_distance, s.integrator.sampling) = (Some(0.0), Sampling::Product);
    });
    assert_eq!(Quality::Paper.settings(), dissertation);
}

/// A grey floor before a mirror under an even sky of 1 W/(sr m^2), with more triangles of the third material.
fn floor_before_a_mirror(more: &[Triangle], third: Material) -> Scene {
    let floor = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let wall = [[-1.0, 0.0], [1.0, 0.0], [1.0, 1.5], [-1.0, 1.5]].map(|[x, y]| Vec3::new(x, y, -1.0));
    let triangles = [&quad(floor, 0)[..], &quad(wall, 1), more].concat();
    let view = camera(Vec3::new(0.0, 1.0, 1.0), Vec3::new(0.0, -0.8, -1.0));
    let mut scene = scene(triangles, vec![lambertian("floor", 0.5), mirror(0.9), third], view);
    scene.environment = Some(Environment::constant(Vec3::ONE));
    scene
}

#[test]
fn soft_caustics_have_no_map_and_equal_light() {
    let scene = floor_before_a_mirror(&[], lambertian("none", 0.5));
    let found = fit(&scene, &small());
    assert_eq!(found.max_caustic_photons, 0, "{found:?}");
    let mean_by = |caustic_photons| {
        let settings = small().with(|s| {
            found.apply(s, Stated::default());
            s.photons.caustic_photons = Some(caustic_photons);
        });
        let film = render_or_panic(&scene, &settings).film;
        mean(&film.pixels().map(|pixel| pixel.radiance).collect::<Vec<_>>())
    };
    let [without, with] = [0, 100_000].map(mean_by);
    assert!((without / with - 1.0).abs() < 0.01, "{without} {with}");
}

#[test]
fn caustics_of_suns_and_of_small_bright_lamps_have_a_map() {
    let mut sunny = floor_before_a_mirror(&[], lambertian("none", 0.5));
    let kind = PunctualKind::Directional { direction: Vec3::new(0.0, -1.0, -1.0).normalize(), angle: 0.0 };
    sunny.lights.push(PunctualLight {
        name: "sun".into(),
        kind,
        intensity: Vec3::splat(0.1),
        axes: LightAxes::default(),
    });
    let lamp = Material { emission: Vec3::splat(500.0), ..lambertian("lamp", 0.0) };
    let corners = [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]].map(|[x, z]| Vec3::new(x, 2.0, z));
    let lit = floor_before_a_mirror(&quad(corners, 2), lamp);
    for scene in [sunny, lit] {
        assert_eq!(fit(&scene, &small()).max_caustic_photons, usize::MAX);
    }
}

/// The floor is one-sided and lit from below: paths end on it and store no photon.
#[test]
fn a_scene_that_stores_no_photon_has_settings() {
    let floor = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let view = camera(Vec3::new(0.0, 1.0, 1.0), Vec3::new(0.0, -0.8, -1.0));
    let mut scene = scene(quad(floor, 0).to_vec(), vec![lambertian("floor", 0.5)], view);
    let kind = PunctualKind::Directional { direction: Vec3::Y, angle: 0.0 };
    scene.lights.push(PunctualLight {
        name: "light".into(),
        kind,
        intensity: Vec3::ONE,
        axes: LightAxes::default(),
    });
    let found = fit(&scene, &small());
    assert!(found.photons > 0, "{found:?}");
    let settings = small().with(|settings| found.apply(settings, Stated::default()));
    assert!(render_or_panic(&scene, &settings).film.pixels().all(|pixel| pixel.radiance == [0.0; 3]));
}
