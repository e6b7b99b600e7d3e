//! Lights without extent, and environments.

mod scene_support;

use std::fs;
use std::path::Path;

use glam::Vec3;
use miette::Diagnostic;
use photoncard_driver::error::SceneError;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::{Environment, PunctualKind, Scene};
use scene_support::load_changed;
use serde_json::{Value, json};

/// The triangle, dark, with a light at the node `lamp`, which turns -z to -x.
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
    let PunctualKind::Directional { direction } = sun.lights[0].kind else { panic!("{sun:?}") };
    close(direction, Vec3::NEG_X);

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
fn lights_that_are_not_possible_are_refused() {
    for (light, part) in [
        (json!({"type": "point", "intensity": -1}), "intensity"),
        (json!({"type": "point", "intensity": 1e30}), "intensity"),
        (json!({"type": "point", "color": [-1, 1, 1]}), "intensity"),
        (json!({"type": "area"}), "type"),
        (json!({"type": "spot"}), "spot"),
        (json!({"type": "spot", "spot": {"outerConeAngle": 0}}), "spot"),
        (json!({"type": "spot", "spot": {"outerConeAngle": 2}}), "spot"),
        (json!({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}), "spot"),
    ] {
        let error = lit(&light).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("KHR_lights_punctual.lights[0]") && text.contains(part), "{light}: {text}");
        assert!(error.help().is_some());
    }
    let dark = lit(&json!({"type": "point", "intensity": 0})).unwrap();
    assert!(matches!(dark.check_light(), Err(SceneError::NoLight)));
    let flat = load_changed(|json| {
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "directional"}]}});
        json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        json["nodes"][0]["scale"] = json!([1, 1, 0]);
    });
    assert!(flat.unwrap_err().to_string().contains("nodes[0]"));
}

#[test]
fn a_light_is_part_of_the_checksum() {
    let sum = |intensity: f64| lit(&json!({"type": "point", "intensity": intensity})).unwrap().checksum();
    assert_ne!(sum(1.0), sum(2.0));
    let scene = lit(&json!({"type": "point"})).unwrap();
    let mut sums = vec![scene.checksum()];
    for radiance in [0.0, 1.0] {
        let environment = Some(Environment::constant(Vec3::splat(radiance)));
        sums.push(Scene { environment, ..scene.clone() }.checksum());
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
    let expected = Environment { width: 2, height: 1, texels: vec![[1.0, 0.5, 0.25], [0.0, 0.0, 4.0]] };
    assert_eq!(Environment::load(&write(folder.path(), "sky.hdr", HDR)).unwrap(), expected);
    // The first bytes count, not the name.
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
    let path = folder.path().join("bad.exr");
    for bad in [-1.0, f32::NAN, f32::INFINITY, 1e30] {
        exr(&path, &[[0.0; 3], [0.0, bad, 0.0]]);
        refused(&path, "texel (1, 0)");
    }
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
    let environment = Some(Environment { width: 1024, height: 512, texels });
    let scene = Scene { environment, ..lit(&json!({"type": "point"})).unwrap() };
    let unit = PackedScene::new(&scene).unwrap().view().0.header.radiance_unit;
    assert!(unit >= brightest / 4096.0, "{unit}");
}
