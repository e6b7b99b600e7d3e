//! Lamps of `extras`: area lights of nodes, spheres of point lights, and meshes that cameras do not see.

use std::f32::consts::PI;

use glam::Vec3;
use photoncard_scene::{Scene, Triangle, Visibility};
use serde_json::{Value, json};

use crate::support::{add_node, load_changed};

/// Scene with a node `softbox` of an area light.
fn softbox(light: &Value, node: &Value) -> Scene {
    let loaded = load_changed(|json| {
        let mut added = node.clone();
        added["name"] = json!("softbox");
        added["extras"] = json!({"photoncard": {"area_light": light, "light_group": "key"}});
        add_node(json, added);
    });
    loaded.unwrap()
}

/// Triangles of the object of a name.
fn of_object<'a>(scene: &'a Scene, name: &str) -> Vec<&'a Triangle> {
    let object = scene.objects.iter().position(|object| object == name).unwrap() as u32;
    scene.triangles.iter().filter(|triangle| triangle.object == object).collect()
}

#[test]
fn an_area_light_has_its_size_and_radiance_and_looks_along_minus_z() {
    for (shape, area) in [("rectangle", 6.0), ("ellipse", 6.0 * PI / 4.0)] {
        for mirror in [1.0, -1.0] {
            let light =
                json!({"shape": shape, "size": [1.0, 2.0], "radiance": [3.0, 2.0, 1.0], "camera": false});
            let scene =
                softbox(&light, &json!({"translation": [1.0, 2.0, 5.0], "scale": [3.0 * mirror, 1.0, 1.0]}));
            let triangles = of_object(&scene, "softbox");
            let found: f32 = triangles.iter().map(|triangle| triangle.area()).sum();
            assert!((found / area - 1.0).abs() < 1e-5, "{shape}: {found}");
            assert!(triangles.iter().all(|triangle| triangle.scaled_normal().z < 0.0), "{shape} {mirror}");
            let material = &scene.materials[triangles[0].material as usize];
            assert_eq!((&*material.name, material.emission), ("softbox", Vec3::new(3.0, 2.0, 1.0)));
            assert_eq!(material.visibility, Visibility { camera: false, light: false });
            assert_eq!(scene.stated_light_groups.len(), 1);
        }
    }
}

#[test]
fn a_point_light_with_a_radius_is_a_sphere_of_its_power() {
    let loaded = load_changed(|json| {
        let light = json!({"type": "point", "name": "bulb", "intensity": 7.0, "extras": {"photoncard": {"radius": 0.5}}});
        let spot =
            json!({"type": "spot", "name": "beam", "spot": {}, "extras": {"photoncard": {"radius": 0.5}}});
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light, spot]}});
        json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        for index in 0..2 {
            add_node(
                json,
                json!({"scale": [9.0, 9.0, 9.0], "extensions": {"KHR_lights_punctual": {"light": index}}}),
            );
        }
    });
    let scene = loaded.unwrap();
    let sphere = of_object(&scene, "bulb");
    let emission = scene.materials[sphere[0].material as usize].emission.x;
    let area: f32 = sphere.iter().map(|triangle| triangle.area()).sum();
    // The power of a point of I is 4 pi I, that of a surface pi L A.
    assert!((PI * emission * area / (4.0 * PI * 7.0) - 1.0).abs() < 1e-5, "{emission} {area}");
    let [spot] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
    assert_eq!(spot.name, "beam");
    assert!(scene.notices.iter().any(|notice| notice.contains("'beam'")), "{:?}", scene.notices);
}

#[test]
fn a_mesh_that_cameras_do_not_see_has_a_material_of_its_own() {
    let loaded = load_changed(|json| {
        add_node(json, json!({"name": "ghost", "mesh": 0, "extras": {"photoncard": {"camera": false}}}));
    });
    let scene = loaded.unwrap();
    let [shown, ghost] = ["shown", "ghost"].map(|name| of_object(&scene, name)[0].material as usize);
    assert!(scene.materials[shown].visibility.is_whole());
    assert_eq!(scene.materials[ghost].visibility, Visibility { camera: false, light: true });
    assert_eq!(scene.materials[ghost].emission, scene.materials[shown].emission);
}

#[test]
fn a_point_light_with_a_photometric_file_stays_a_point() {
    let loaded = load_changed(|json| {
        let extras = json!({"photoncard": {"radius": 0.5}});
        let light = json!({"type": "point", "name": "bulb", "intensity": 7.0, "extras": extras});
        json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
        json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        let lit = json!({"KHR_lights_punctual": {"light": 0}});
        add_node(json, json!({"extensions": lit, "extras": {"photoncard": {"ies": "data:,none"}}}));
    });
    assert!(loaded.unwrap_err().to_string().contains("line 1"), "the file is read");
}

#[test]
fn damaged_lamps_are_refused_by_their_place() {
    let good = json!({"shape": "rectangle", "size": [1.0, 2.0], "radiance": [1.0, 1.0, 1.0]});
    for (key, value) in [
        ("shape", json!("disk")),
        ("size", json!([1.0, 0.0])),
        ("size", json!([1.0])),
        ("radiance", json!([-1.0, 0.0, 0.0])),
        ("radiance", json!([1e30, 0.0, 0.0])),
        ("size", json!([1e-30, 1e-30])),
        ("power", json!(5.0)),
    ] {
        let mut light = good.clone();
        light[key] = value.clone();
        let loaded = load_changed(|json| {
            add_node(json, json!({"extras": {"photoncard": {"area_light": light}}}));
        });
        let error = loaded.unwrap_err().to_string();
        assert!(error.contains("nodes[2].extras.photoncard"), "{key} {value}: {error}");
    }
}
