//! Animated parts of a scene: meshes by morph targets and joints, cameras, lights, and parents of nodes.

use glam::{DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use photoncard_scene::{PunctualKind, Scene};
use serde_json::json;

use super::animated::{Animated, all_at, close};
use crate::support::push;

const NODE: usize = 0;
const TRIPOD: usize = 1;

#[test]
fn a_moment_does_not_change_the_scene_at_rest() {
    let mut scene = Animated::new();
    let animation = scene.animation("walk");
    scene.moved(animation, (NODE, "translation"), &[(0.0, [5.0, 0.0, 0.0])], "LINEAR");
    let file = scene.file().unwrap();
    assert_eq!(file.at(&all_at(0.0)).unwrap().triangles[0].vertices[0], Vec3::X * 5.0);
    let rest = file.at_rest().unwrap();
    assert_eq!(rest.triangles[0].vertices[0], Vec3::ZERO);
    assert_eq!(rest.notices, Vec::<String>::new());
}

/// An animated property replaces that of the node; other properties of the node stay.
#[test]
fn an_animated_translation_leaves_rotation_and_scale() {
    let mut scene = Animated::new();
    scene.json()["nodes"][NODE]["scale"] = json!([2, 3, 1]);
    scene.json()["nodes"][NODE]["translation"] = json!([0, 0, 1]);
    let animation = scene.animation("walk");
    scene.moved(animation, (NODE, "translation"), &[(0.0, [5.0, 0.0, 0.0])], "LINEAR");
    assert_eq!(scene.corners(0.0), [[5.0, 0.0, 0.0], [7.0, 0.0, 0.0], [5.0, 3.0, 0.0]].map(Vec3::from));
}

#[test]
fn children_follow_their_parents() {
    let mut scene = Animated::new();
    scene.json()["scenes"][0]["nodes"] = json!([TRIPOD]);
    scene.json()["nodes"][TRIPOD]["children"] = json!([NODE]);
    let animation = scene.animation("walk");
    scene.moved(animation, (TRIPOD, "translation"), &[(0.0, [0.0; 3]), (1.0, [0.0, 2.0, 4.0])], "LINEAR");
    let file = scene.file().unwrap();
    assert!(!file.only_cameras_move(&[]).unwrap());
    let found = file.at(&all_at(0.5)).unwrap();
    assert_eq!(found.triangles[0].vertices[0], Vec3::new(0.0, 1.0, 2.0));
    assert_eq!(found.cameras[0].origin, Vec3::new(0.0, 1.0, 2.0));
}

#[test]
fn cameras_without_geometry_equal_those_of_the_scene() {
    let mut scene = Animated::new();
    let animation = scene.animation("pan");
    let turn = Quat::from_rotation_y(0.5).to_array();
    scene.moved(animation, (TRIPOD, "rotation"), &[(0.0, [0.0, 0.0, 0.0, 1.0]), (1.0, turn)], "LINEAR");
    scene.moved(animation, (TRIPOD, "translation"), &[(0.0, [1.0, 2.0, 3.0]), (2.0, [4.0; 3])], "LINEAR");
    let file = scene.file().unwrap();
    assert!(file.only_cameras_move(&[]).unwrap());
    for seconds in [0.0, 0.25, 1.0, 1.75] {
        let whole = file.at(&all_at(seconds)).unwrap();
        assert_eq!(file.cameras_at(&all_at(seconds)).unwrap(), whole.cameras);
        assert_eq!(whole.checksum_without_cameras(), file.at_rest().unwrap().checksum_without_cameras());
    }
    let camera = &file.cameras_at(&all_at(1.0)).unwrap()[0];
    let forward = Quat::from_rotation_y(0.5) * Vec3::NEG_Z;
    assert!(camera.forward.distance(forward) < 1e-6, "{camera:?}");
}

#[test]
fn lights_move_by_their_nodes() {
    let mut scene = Animated::new();
    scene.json()["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_lights_punctual"));
    scene.json()["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "name": "torch", "spot": {}}]}});
    let extensions = json!({"KHR_lights_punctual": {"light": 0}});
    let node = push(scene.json(), "nodes", json!({"extensions": extensions}));
    push(&mut scene.json()["scenes"][0], "nodes", json!(node));
    let animation = scene.animation("swing");
    scene.moved(animation, (node, "translation"), &[(0.0, [0.0; 3]), (1.0, [2.0, 0.0, 0.0])], "LINEAR");
    let down = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2).to_array();
    scene.moved(animation, (node, "rotation"), &[(0.0, down)], "STEP");
    let file = scene.file().unwrap();
    assert!(!file.only_cameras_move(&[]).unwrap());
    let found = file.at(&all_at(0.5)).unwrap();
    let PunctualKind::Spot { position, direction, .. } = found.lights[0].kind else { panic!("{found:?}") };
    assert_eq!(position, Vec3::X);
    assert!(direction.distance(Vec3::NEG_Y) < 1e-6, "{direction}");
}

/// File of the triangle with two morph targets. One displaces positions, the other positions and normals.
fn morphed() -> Animated {
    let mut scene = Animated::new();
    let normals = scene.0.floats("VEC3", &[[0.0, 0.0, 1.0]; 3]);
    let raised = scene.0.floats("VEC3", &[[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]]);
    let moved = scene.0.floats("VEC3", &[[2.0, 0.0, 0.0]; 3]);
    let tilted = scene.0.floats("VEC3", &[[0.5, 0.0, 0.0]; 3]);
    let primitive = scene.0.primitive();
    primitive["attributes"]["NORMAL"] = json!(normals);
    primitive["targets"] = json!([{"POSITION": raised}, {"POSITION": moved, "NORMAL": tilted}]);
    scene
}

fn shape(raised: f32, moved: f32) -> [Vec3; 3] {
    let corners = [Vec3::Z * raised, Vec3::X, Vec3::Y];
    corners.map(|corner| corner + Vec3::X * (2.0 * moved))
}

fn normals(scene: &Scene) -> [Vec3; 3] {
    scene.attributes[scene.triangles[0].attributes as usize].normals.unwrap()
}

#[test]
fn targets_displace_by_the_weights_of_the_node_or_else_of_the_mesh() {
    let rest = |scene: &Animated| scene.file().unwrap().at_rest().unwrap();
    let mut scene = morphed();
    assert_eq!(rest(&scene).triangles[0].vertices, shape(0.0, 0.0));
    scene.json()["meshes"][0]["weights"] = json!([0.5, 0.25]);
    let of_mesh = rest(&scene);
    assert_eq!(of_mesh.triangles[0].vertices, shape(0.5, 0.25));
    assert_eq!(of_mesh.notices, Vec::<String>::new());
    scene.json()["nodes"][NODE]["weights"] = json!([0.0, 1.0]);
    let of_node = rest(&scene);
    assert_eq!(of_node.triangles[0].vertices, shape(0.0, 1.0));
    let tilted = Vec3::new(0.5, 0.0, 1.0).normalize();
    close(normals(&of_node), [tilted; 3]);
}

#[test]
fn weights_of_targets_are_animated_together() {
    let mut scene = morphed();
    scene.json()["meshes"][0]["weights"] = json!([7.0, 7.0]);
    let animation = scene.animation("breathe");
    let times = scene.0.floats("SCALAR", &[[0.0], [1.0]]);
    let weights = scene.0.floats("SCALAR", &[[1.0], [0.0], [0.5], [1.0]]);
    scene.channel(animation, (NODE, "weights"), [times, weights], "LINEAR");
    for (seconds, [raised, moved]) in [(0.0, [1.0, 0.0]), (0.5, [0.75, 0.5]), (1.0, [0.5, 1.0])] {
        assert_eq!(scene.corners(seconds), shape(raised, moved), "at {seconds}");
    }
}

/// A keyframe holds the in-tangents of all targets, then their values, then their out-tangents.
#[test]
fn weights_of_targets_follow_cubic_splines() {
    let mut scene = morphed();
    let animation = scene.animation("breathe");
    let times = scene.0.floats("SCALAR", &[[0.0], [2.0]]);
    let keys = [[9.0, 9.0], [1.0, 0.0], [0.5, -1.0], [0.0, 0.0], [0.0, 1.0], [9.0, 9.0]];
    let weights =
        scene.0.floats("SCALAR", keys.as_flattened().iter().map(|key| [*key]).collect::<Vec<_>>().as_slice());
    scene.channel(animation, (NODE, "weights"), [times, weights], "CUBICSPLINE");
    assert_eq!(scene.corners(0.0), shape(1.0, 0.0));
    assert_eq!(scene.corners(2.0), shape(0.0, 1.0));
    // Halfway: half of both values, and an eighth of the interval times the out-tangent.
    close(scene.corners(1.0), shape(0.5 + 0.125, 0.5 - 0.25));
}

#[test]
fn joints_carry_their_vertices() {
    let mut scene = Animated::new();
    let joints = scene.0.accessor("VEC4", 5121, 3, &[[0, 1, 0, 0]; 3].concat());
    let weights =
        scene.0.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]);
    let inverse = [Mat4::IDENTITY, Mat4::from_translation(Vec3::new(0.0, -0.5, 0.0))];
    let inverse = scene.0.floats("MAT4", &inverse.map(|matrix| matrix.to_cols_array()));
    let attributes = &mut scene.0.primitive()["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    let tip = push(scene.json(), "nodes", json!({"translation": [0, 0.5, 0]}));
    let root = push(scene.json(), "nodes", json!({"children": [tip]}));
    push(&mut scene.json()["scenes"][0], "nodes", json!(root));
    push(scene.json(), "skins", json!({"joints": [root, tip], "inverseBindMatrices": inverse}));
    scene.json()["nodes"][NODE]["skin"] = json!(0);
    let animation = scene.animation("bend");
    let bent = Quat::from_rotation_x(1.0);
    scene.moved(
        animation,
        (tip, "rotation"),
        &[(0.0, [0.0, 0.0, 0.0, 1.0]), (1.0, bent.to_array())],
        "LINEAR",
    );
    scene.moved(animation, (root, "translation"), &[(0.0, [0.0; 3]), (1.0, [0.0, 0.0, 2.0])], "LINEAR");
    assert!(!scene.file().unwrap().only_cameras_move(&[]).unwrap());
    close(scene.corners(0.0), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    for share in [0.25, 0.5, 1.0] {
        let root = DMat4::from_translation(DVec3::Z * (2.0 * share));
        let turn = DMat4::from_quat(DQuat::from_rotation_x(share));
        let at_tip = DMat4::from_translation(DVec3::Y * 0.5);
        let tip = root * at_tip * turn * at_tip.inverse();
        let [o, x, y] = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let both = root.transform_point3(x) * 0.25 + tip.transform_point3(x) * 0.75;
        let expected = [root.transform_point3(o), both, tip.transform_point3(y)];
        close(scene.corners(share), expected.map(DVec3::as_vec3));
    }
}

#[test]
fn the_default_camera_is_that_at_rest() {
    let mut scene = Animated::new();
    scene.json()["nodes"][TRIPOD].as_object_mut().unwrap().remove("camera");
    let animation = scene.animation("walk");
    scene.moved(animation, (NODE, "translation"), &[(0.0, [5.0, 0.0, 0.0])], "LINEAR");
    let file = scene.file().unwrap();
    assert_eq!(file.at(&all_at(0.0)).unwrap().cameras, file.at_rest().unwrap().cameras);
    assert!(file.cameras_at(&all_at(0.0)).unwrap().is_empty());
}

#[test]
fn animations_have_names_and_lengths() {
    let mut scene = Animated::new();
    let walk = scene.animation("walk");
    scene.moved(walk, (NODE, "translation"), &[(0.5, [1.0, 0.0, 0.0]), (2.0, [0.0; 3])], "LINEAR");
    scene.moved(walk, (NODE, "scale"), &[(1.0, [1.0; 3]), (3.0, [2.0; 3])], "LINEAR");
    let pan = scene.animation("pan");
    scene.moved(pan, (TRIPOD, "translation"), &[(0.0, [0.0, 0.0, 9.0])], "STEP");
    scene.json()["animations"][pan].as_object_mut().unwrap().remove("name");
    scene.animation("nothing");
    let file = scene.file().unwrap();
    let found: Vec<_> = file.animations().unwrap();
    let found: Vec<_> =
        found.iter().map(|clip| (clip.name.as_str(), clip.seconds, clip.moves_only_cameras)).collect();
    let expected =
        [("walk", [0.5, 3.0], false), ("animation 1", [0.0, 0.0], true), ("nothing", [0.0, 0.0], true)];
    assert_eq!(found, expected);
    assert!(file.only_cameras_move(&["animation 1".to_owned()]).unwrap());
    assert!(!file.only_cameras_move(&[]).unwrap());
}
