//! A mesh that is placed often becomes a group with instances, and looks as its copies would.

use photoncard_scene::Scene;
use serde_json::{Value, json};

use crate::support::{Extended, push};

const TRIANGLES: u64 = 4096;
/// Number of nodes at which the triangles of [`mesh`] become a group.
const NODES: u64 = 65;

/// Scene with `nodes` nodes, each with the same mesh of [`TRIANGLES`] coincident triangles that do not emit.
fn file(nodes: u64, change: impl FnOnce(&mut Value)) -> Extended {
    let mut scene = Extended::new();
    let indices: Vec<u8> =
        [0_u16, 1, 2].repeat(TRIANGLES as usize).iter().flat_map(|i| i.to_le_bytes()).collect();
    let accessor = scene.accessor("SCALAR", 5123, 3 * TRIANGLES as usize, &indices);
    scene.primitive()["indices"] = json!(accessor);
    scene.json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    for node in 1..nodes {
        let node = push(
            &mut scene.json,
            "nodes",
            json!({"mesh": 0, "translation": [2 * node, 0, 0], "scale": [2, 1, 1]}),
        );
        scene.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    change(&mut scene.json);
    scene
}

fn mesh(nodes: u64, change: impl FnOnce(&mut Value)) -> Scene {
    file(nodes, change).load().unwrap()
}

/// Numbers of triangles in world space, of groups and of instances.
fn numbers(scene: &Scene) -> [usize; 3] {
    [scene.triangles.len(), scene.groups.len(), scene.instances.len()]
}

#[test]
fn a_mesh_becomes_a_group_where_that_saves_many_triangles() {
    assert_eq!(numbers(&mesh(2, |_| {})), [2 * TRIANGLES as usize, 0, 0]);
    let scene = mesh(NODES, |_| {});
    assert_eq!(numbers(&scene), [0, 1, NODES as usize]);
    assert_eq!(scene.placed_triangles(), NODES * TRIANGLES);
    // The triangle has the corners (0, 0), (1, 0) and (0, 1).
    let (lower, upper) = scene.bounds();
    assert_eq!((lower.to_array(), upper.to_array()), ([0.0; 3], [2.0 * (NODES - 1) as f32 + 2.0, 1.0, 0.0]));
    let area = TRIANGLES as f64 * 0.5;
    assert!(scene.area() > area * NODES as f64 && scene.area() < 2.0 * area * NODES as f64);
}

#[test]
fn a_mirrored_copy_is_an_instance_of_a_mirrored_group() {
    let scene = mesh(NODES + 1, |json| json["nodes"][0]["scale"] = json!([-1, 1, 1]));
    assert_eq!(numbers(&scene), [0, 2, NODES as usize + 1]);
    let normals: Vec<f32> = scene.groups.iter().map(|group| group[0].scaled_normal().z).collect();
    assert_eq!(normals, [1.0, 1.0], "the front stays the front");
    assert_eq!(scene.bounds().0.x, -1.0);
}

#[test]
fn a_copy_without_an_area_is_left_out() {
    let scene = mesh(NODES + 1, |json| json["nodes"][0]["scale"] = json!([0, 1, 1]));
    assert_eq!(numbers(&scene), [0, 1, NODES as usize]);
    assert_eq!(scene.skipped_triangles, TRIANGLES as usize);
}

#[test]
fn meshes_that_emit_or_focus_light_are_copied() {
    let emits = mesh(NODES, |json| json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]));
    assert_eq!(numbers(&emits), [(NODES * TRIANGLES) as usize, 0, 0]);
    assert_eq!(emits.emissive_triangles() as u64, NODES * TRIANGLES);
    let mirror = mesh(NODES, |json| {
        json["materials"][0]["pbrMetallicRoughness"] = json!({"metallicFactor": 1, "roughnessFactor": 0});
    });
    assert_eq!(numbers(&mirror), [(NODES * TRIANGLES) as usize, 0, 0]);
}

#[test]
fn an_instance_changes_the_checksum_of_its_scene() {
    let scene = mesh(NODES, |_| {});
    let moved = scene.clone().with(|scene| scene.instances[3].to_world[0][3] += 0.5);
    assert_ne!(scene.checksum(), moved.checksum());
}

#[test]
fn copies_that_cannot_be_instances_count_as_triangles() {
    // A corner of each copy's box is further from the origin than a coordinate may be, but no vertex is.
    let scene = file((1 << 24) / TRIANGLES + 1, |json| {
        for node in json["nodes"].as_array_mut().unwrap() {
            let turn = std::f64::consts::FRAC_PI_8.sin_cos();
            *node = json!({"mesh": node["mesh"], "scale": [9.5e7, 9.5e7, 9.5e7], "rotation": [0, 0, turn.0, turn.1]});
        }
    });
    let error = scene.load().unwrap_err().to_string();
    assert!(error.contains("more than 16777216 triangles"), "{error}");
}
