//! Lights without extent, and environments.

use std::f32::consts::PI;
use std::fs;
use std::path::Path;

use glam::Vec3;
use miette::Diagnostic;
use photoncard_driver::error::SceneError;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::gltf::{self, LoadSettings};
use photoncard_driver::scene::{Environment, LightUnits, PunctualKind, Scene};
use serde_json::{Value, json};

use crate::support::{load_changed, load_with, push, triangle_bytes, triangle_json};

/// Loads the triangle of the tests without emission, with `light` at a node that turns -z to -x.
fn lit(light: &Value) -> Result<Scene, SceneError> {
    load_changed(|json| {
        json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
        json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
        let half = 0.5_f64.sqrt();
        let node = json!({"translation": [1, 2, 3], "scale": [2, 2, 2], "rotation": [0, half, 0, half],
                          "extensions": {"KHR_lights_punctual": {"light": 0}}});
        json["nodes"].as_array_mut().unwrap().push(node);
        json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    })
}

fn close(found: Vec3, expected: Vec3) {
    assert!(found.distance(expected) < 1e-6, "{found} is not {expected}");
}

#[test]
fn lights_are_placed_and_turned_by_their_nodes() {
    let place = Vec3::new(1.0, 2.0, 3.0);
    let point =
        lit(&json!({"type": "point", "name": "bulb", "color": [1, 0.5, 0.25], "intensity": 8})).unwrap();
    let [light] = &point.lights[..] else { panic!("{:?}", point.lights) };
    assert_eq!((light.name.as_str(), light.intensity), ("bulb", Vec3::new(8.0, 4.0, 2.0)));
    assert_eq!(light.kind, PunctualKind::Point { position: place });
    assert!(point.check_light().is_ok());
    assert_eq!(point.notices, Vec::<String>::new());

    let sun = lit(&json!({"type": "directional"})).unwrap();
    assert_eq!((sun.lights[0].name.as_str(), sun.lights[0].intensity), ("light 0", Vec3::ONE));
    let PunctualKind::Directional { direction, angle: 0.0 } = sun.lights[0].kind else { panic!("{sun:?}") };
    close(direction, Vec3::NEG_X);
    let wide = lit(&json!({"type": "directional", "extras": {"photoncard": {"angle": 90}}})).unwrap();
    let angle = std::f32::consts::FRAC_PI_2;
    assert_eq!(wide.lights[0].kind, PunctualKind::Directional { direction, angle });
    for (extras, said) in [(json!({"angle": -1}), "-1"), (json!({"angle": "wide"}), "string")] {
        let extras = json!({"photoncard": extras});
        let error = lit(&json!({"type": "directional", "extras": extras})).unwrap_err().to_string();
        assert!(error.contains("lights[0].extras.photoncard") && error.contains(said), "{error}");
    }

    let spot =
        lit(&json!({"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}})).unwrap();
    let PunctualKind::Spot { position, direction, inner_cosine, outer_cosine } = spot.lights[0].kind else {
        panic!("{spot:?}")
    };
    assert_eq!(position, place);
    close(direction, Vec3::NEG_X);
    close(Vec3::new(inner_cosine, outer_cosine, 0.0), Vec3::new(0.25_f32.cos(), 0.5_f32.cos(), 0.0));
}

#[test]
fn a_spot_without_a_penumbra_gets_the_narrowest() {
    let angle = std::f64::consts::FRAC_PI_2;
    let cones = json!({"innerConeAngle": angle, "outerConeAngle": angle});
    let spot = lit(&json!({"type": "spot", "spot": cones})).unwrap();
    let PunctualKind::Spot { inner_cosine, outer_cosine, .. } = spot.lights[0].kind else {
        panic!("{spot:?}")
    };
    assert!(inner_cosine > outer_cosine && inner_cosine.abs() < 0.002, "{inner_cosine} {outer_cosine}");
}

#[test]
fn angles_of_spot_lights_are_clamped_and_lights_without_any_left_out() {
    let cosines = |spot: Value| {
        let scene = lit(&json!({"name": "stage", "type": "spot", "spot": spot})).unwrap();
        let PunctualKind::Spot { inner_cosine, outer_cosine, .. } = scene.lights[0].kind else {
            panic!("{scene:?}")
        };
        (inner_cosine, outer_cosine, scene.remarks.iter().any(|remark| remark.contains("'stage'")))
    };
    let sharp = |outer: f32| (libm::cosf(outer), libm::cosf(outer) - 0.001, true);
    let quarter = std::f32::consts::FRAC_PI_4;
    assert_eq!(cosines(json!({"innerConeAngle": 0.9})), sharp(quarter));
    assert_eq!(cosines(json!({"innerConeAngle": 1, "outerConeAngle": 0.5})), sharp(0.5));
    assert_eq!(cosines(json!({"innerConeAngle": -1, "outerConeAngle": 0.5})), (1.0, libm::cosf(0.5), true));
    let wide = cosines(json!({"innerConeAngle": 0.5, "outerConeAngle": 2}));
    assert_eq!(wide, (libm::cosf(0.5), libm::cosf(std::f32::consts::FRAC_PI_2), true));
    assert!(!cosines(json!({"innerConeAngle": 0.5, "outerConeAngle": 0.5})).2);
    for outer in [0, -1] {
        let scene = lit(&json!({"type": "spot", "spot": {"outerConeAngle": outer}})).unwrap();
        assert!(scene.lights.is_empty() && scene.notices[0].contains("left out"), "{:?}", scene.notices);
    }
}

#[test]
fn lights_that_are_not_possible_are_refused() {
    for (light, part) in [
        (json!({"type": "point", "intensity": -1}), "intensity"),
        (json!({"type": "point", "intensity": 1e30}), "intensity"),
        (json!({"type": "point", "color": [-1, 1, 1]}), "intensity"),
        (json!({"type": "area"}), "type"),
        (json!({"type": "spot"}), "spot"),
    ] {
        let error = lit(&light).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("KHR_lights_punctual.lights[0]") && text.contains(part), "{light}: {text}");
        assert!(error.help().is_some());
    }
    let dark = lit(&json!({"type": "point", "intensity": 0})).unwrap();
    assert!(matches!(dark.check_light(), Err(SceneError::NoLight { .. })));
    let flat = load_changed(|json| {
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "directional"}]}});
        json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        json["nodes"][0]["scale"] = json!([1, 1, 0]);
    });
    assert!(flat.unwrap_err().to_string().contains("nodes[0]"));
}

const BLENDER: &str = "Khronos glTF Blender I/O v5.0.21";

/// A file of `generator` with a point, a directional and a spot light, each of the intensity 683, loaded in
/// `units`.
fn of_exporter(generator: &str, units: LightUnits) -> Scene {
    let mut json = triangle_json();
    json["asset"]["generator"] = json!(generator);
    let spot = json!({"innerConeAngle": 0.25, "outerConeAngle": 0.5});
    let lights = json!([{"type": "point", "intensity": 683}, {"type": "directional", "intensity": 683},
                        {"type": "spot", "intensity": 683, "spot": spot, "name": "stage"}]);
    json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    for light in 0..3 {
        push(&mut json, "nodes", json!({"extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "data.bin", &triangle_bytes());
    let path = write(folder.path(), "scene.gltf", json.to_string().as_bytes());
    gltf::load_with(&path, &LoadSettings { light_units: units, ..LoadSettings::default() }).unwrap()
}

#[test]
fn units_of_lights_are_the_exporters_unless_they_are_stated() {
    use LightUnits::{Auto, Photometric, Radiometric, Watts};
    let (photometric, watts, as_they_stand) = ([1.0, 1.0], [683.0 / (4.0 * PI), 683.0], [683.0, 683.0]);
    let early = "Khronos glTF Blender I/O v3.3.35";
    for (generator, units, expected, notice) in [
        (BLENDER, Auto, photometric, Some("683 lm/W")),
        (BLENDER, Photometric, photometric, None),
        (BLENDER, Radiometric, as_they_stand, None),
        (BLENDER, Watts, watts, None),
        (early, Auto, watts, Some("watts")),
        (early, Radiometric, as_they_stand, None),
        ("another", Auto, as_they_stand, None),
        ("another", Photometric, photometric, None),
    ] {
        let scene = of_exporter(generator, units);
        let [point, directional, spot] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
        let found = [point, directional].map(|light| light.intensity.x);
        assert_eq!((found, spot.intensity), (expected, point.intensity), "{generator} {units:?}");
        assert_eq!(scene.generator.as_deref(), Some(generator));
        let on_units: Vec<_> =
            scene.remarks.iter().filter(|notice| notice.contains("--light-units")).collect();
        match notice {
            Some(part) => assert!(on_units.len() == 1 && scene.remarks[0].contains(part), "{on_units:?}"),
            None => assert!(on_units.is_empty(), "{generator} {units:?}: {on_units:?}"),
        }
    }
    let sums = [Auto, Photometric, Radiometric, Watts]
        .map(|units| of_exporter(BLENDER, units).checksum().to_owned());
    assert_eq!(sums[0], sums[1]);
    assert!(sums[1] != sums[2] && sums[2] != sums[3] && sums[3] != sums[1], "{sums:?}");
}

#[test]
fn penumbras_of_blenders_spots_alone_are_adapted() {
    let inner = |generator: &str| {
        let scene = of_exporter(generator, LightUnits::Photometric);
        let PunctualKind::Spot { inner_cosine, .. } = scene.lights[2].kind else { panic!("{scene:?}") };
        (inner_cosine, scene.remarks.iter().any(|notice| notice.contains("light 'stage'")))
    };
    let edge = 0.5_f32.cos();
    // The blend is half, and 3/4 of its width has the flux of Blender's smooth step.
    let (found, is_noted) = inner(BLENDER);
    assert!((found - (edge + 0.375 * (1.0 - edge))).abs() < 1e-6 && is_noted, "{found}");
    assert_eq!(inner("another"), (libm::cosf(0.25), false));
}

#[test]
fn errors_on_files_of_blender_say_what_to_tick() {
    let scene = |generator: &str| {
        let mut json = triangle_json();
        json["asset"]["generator"] = json!(generator);
        json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
        json["nodes"].as_array_mut().unwrap().iter_mut().for_each(|node| {
            node.as_object_mut().unwrap().remove("camera");
        });
        load_with(&json, &triangle_bytes()).unwrap()
    };
    let help = |error: SceneError| error.help().unwrap().to_string();
    let [of_blender, other] = [BLENDER, "another"].map(scene);
    for (scene, is_of_blender) in [(of_blender, true), (other, false)] {
        let dark = help(scene.check_light().unwrap_err());
        assert_eq!(dark.contains("Punctual Lights"), is_of_blender, "{dark}");
        assert_eq!(dark.contains("emissiveFactor"), !is_of_blender, "{dark}");
        let unknown = help(scene.camera(Some("hall")).unwrap_err());
        assert_eq!(unknown.contains("Include > Data > Cameras"), is_of_blender, "{unknown}");
        assert!(unknown.contains("choose one of: 'framed'"), "{unknown}");
        let framed = scene.notices.iter().find(|notice| notice.contains("no camera")).unwrap();
        assert_eq!(framed.contains("Include > Data > Cameras"), is_of_blender, "{framed}");
    }
}

#[test]
fn a_light_is_part_of_the_checksum() {
    let sum = |intensity: f64| {
        lit(&json!({"type": "point", "intensity": intensity})).unwrap().checksum().to_owned()
    };
    assert_ne!(sum(1.0), sum(2.0));
    let scene = lit(&json!({"type": "point"})).unwrap();
    let mut sums = vec![scene.checksum().to_owned()];
    for radiance in [0.0, 1.0] {
        let environment = Some(Environment::constant(Vec3::splat(radiance)));
        sums.push(scene.clone().with(|scene| scene.environment = environment).checksum().to_owned());
    }
    assert!(sums[0] != sums[1] && sums[1] != sums[2], "{sums:?}");
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// A Radiance picture of 2 x 1 texels.
const HDR: &[u8] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\x00\x00\x80\x83";

fn exr(path: &Path, texels: &[[f32; 3]]) {
    use exr::prelude::write_rgb_file;
    write_rgb_file(path, texels.len(), 1, |x, _| (texels[x][0], texels[x][1], texels[x][2])).unwrap();
}

#[test]
fn environments_are_read_from_hdr_and_exr() {
    let folder = tempfile::tempdir().unwrap();
    let expected =
        Environment { width: 2, height: 1, texels: vec![[1.0, 0.5, 0.25], [0.0, 0.0, 4.0]], strength: 1.0 };
    assert_eq!(Environment::load(&write(folder.path(), "sky.hdr", HDR)).unwrap(), expected);
    // The first bytes of a file determine its format, not its name.
    let path = folder.path().join("sky.bin");
    exr(&folder.path().join("sky.exr"), &expected.texels);
    fs::rename(folder.path().join("sky.exr"), &path).unwrap();
    assert_eq!(Environment::load(&path).unwrap(), expected);
    assert!(expected.is_lit() && !Environment::constant(Vec3::ZERO).is_lit());
}

#[test]
fn environments_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |path: &Path, part: &str| {
        let error = Environment::load(path).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(part) && text.contains(&path.display().to_string()), "{part}: {text}");
        assert!(error.help().is_some());
    };
    refused(&folder.path().join("absent.hdr"), "cannot read");
    refused(folder.path(), "cannot read");
    refused(&write(folder.path(), "text.hdr", b"text"), "neither");
    refused(&write(folder.path(), "cut.hdr", &HDR[..HDR.len() - 1]), "ends before");
    refused(&write(folder.path(), "cut.exr", &[0x76, 0x2f, 0x31, 0x01, 2]), "cut.exr");
}

#[test]
fn texels_that_are_no_radiance_are_clamped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    let good = [[0.5, 2.0, 0.0]; 2];
    exr(
        &path,
        &[&good[..], &[[-1.0, 0.25, 3.0], [f32::NAN, 1.0, f32::INFINITY], [1.0, f32::NEG_INFINITY, 0.0]]]
            .concat(),
    );
    let (sky, notice) = Environment::load_with_notice(&path).unwrap();
    assert_eq!(sky.texels, [&good[..], &[[0.0, 0.25, 3.0], [0.0, 1.0, 3.0], [1.0, 0.0, 0.0]]].concat());
    assert!(notice.is_some_and(|notice| notice.starts_with("3 of 5 texels")));
    for dark in [f32::INFINITY, f32::NAN, -1.0, 0.0] {
        exr(&path, &[[0.0, f32::INFINITY, dark]; 2]);
        let error = Environment::load(&path).unwrap_err();
        assert!(error.to_string().contains("infinite texels"), "{error}");
    }
    exr(&path, &good);
    assert_eq!(Environment::load_with_notice(&path).unwrap().1, None);
    exr(&path, &[[1e30, 1.0, 0.0]]);
    let (sky, notice) = Environment::load_with_notice(&path).unwrap();
    assert_eq!(sky.texels, [[1e20, 1.0, 0.0]]);
    assert!(notice.is_some_and(|notice| notice.ends_with("those above 1e20 as 1e20")));
}

#[test]
fn environments_are_turned_counter_clockwise_seen_from_above() {
    let texels: Vec<[f32; 3]> = (0..8).map(|index| [index as f32, 0.0, 1.0]).collect();
    let sky = Environment { width: 4, height: 2, texels, strength: 1.0 };
    let red = |degrees: f32| -> Vec<f32> {
        sky.clone().turned(degrees).texels.iter().map(|texel| texel[0]).collect()
    };
    assert_eq!(red(0.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    // The east, +x, at three quarters of the width, moves to the middle, the north.
    assert_eq!(red(90.0), [1.0, 2.0, 3.0, 0.0, 5.0, 6.0, 7.0, 4.0]);
    assert_eq!((red(-270.0), red(450.0)), (red(90.0), red(90.0)));
    let rows = vec![[1.0; 3], [1.0; 3], [2.0; 3], [2.0; 3]];
    let even = Environment { width: 2, height: 2, texels: rows, strength: 1.0 };
    assert_eq!([sky.is_equal_around(), even.is_equal_around()], [false, true]);
    assert_eq!(red(45.0), [0.5, 1.5, 2.5, 1.5, 4.5, 5.5, 6.5, 5.5]);
    assert_eq!(Environment::constant(Vec3::ONE).turned(33.0), Environment::constant(Vec3::ONE));
    let turn = |generator: &str| lit_by(generator).environment_turn();
    assert_eq!((turn(BLENDER), turn("another")), (-90.0, 0.0));
}

fn lit_by(generator: &str) -> Scene {
    load_changed(|json| json["asset"]["generator"] = json!(generator)).unwrap()
}

#[test]
fn environments_of_too_many_texels_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 8193\n";
    let error = Environment::load(&write(folder.path(), "sky.hdr", header)).unwrap_err();
    assert!(error.to_string().contains("8193 x 8192 texels"), "{error}");
    assert!(error.help().is_some_and(|help| help.to_string().contains("scale")));
}

#[test]
fn the_unit_of_radiance_is_not_far_below_the_brightest_texel_of_the_environment() {
    let brightest = 1e6;
    let mut texels = vec![[0.0; 3]; 1024 * 512];
    texels[100 * 1024 + 7] = [0.0, brightest, 0.0];
    let environment = Some(Environment { width: 1024, height: 512, texels, strength: 1.0 });
    let scene = lit(&json!({"type": "point"})).unwrap().with(|scene| scene.environment = environment);
    let unit = PackedScene::new(&scene).unwrap().view().0.header.radiance_unit;
    assert!(unit >= brightest / 4096.0, "{unit}");
}

/// A panel with the emission `emission` in the plane of a wall, beside a second copy of the wall.
fn panel_in_a_wall(emission: f32) -> Scene {
    load_changed(|json| {
        let mut wall = json["materials"][0].clone();
        wall.as_object_mut().unwrap().remove("emissiveFactor");
        json["materials"][0]["emissiveFactor"] = json!([emission, emission, emission]);
        let wall = push(json, "materials", wall);
        let mut mesh = json["meshes"][0].clone();
        mesh["primitives"][0]["material"] = json!(wall);
        let mesh = push(json, "meshes", mesh);
        for place in [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]] {
            let node = push(json, "nodes", json!({"mesh": mesh, "translation": place}));
            push(&mut json["scenes"][0], "nodes", json!(node));
        }
        let lamp = json!({"type": "directional", "intensity": 1.0});
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [lamp]}});
        let node = json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
        let node = push(json, "nodes", node);
        push(&mut json["scenes"][0], "nodes", json!(node));
        json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_lights_punctual"));
    })
    .unwrap()
}

#[test]
fn a_lamp_in_the_plane_of_a_wall_is_in_front_of_it() {
    let heights = |scene: &Scene| -> Vec<f32> {
        scene.triangles.iter().flat_map(|triangle| triangle.vertices).map(|vertex| vertex.z).collect()
    };
    let lit = heights(&panel_in_a_wall(1.0));
    assert!(lit[..3].iter().all(|height| (1e-5..1e-3).contains(height)), "{lit:?}");
    assert!(lit[3..].iter().all(|height| *height == 0.0), "{lit:?}");
    assert_eq!(heights(&panel_in_a_wall(0.0)), [0.0; 9]);
}
