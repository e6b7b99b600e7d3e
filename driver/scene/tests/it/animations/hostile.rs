//! Animations that contradict each other or violate glTF are refused with their JSON path.

use miette::Diagnostic;
use photoncard_scene::error::SceneError;
use photoncard_scene::gltf::Moment;
use serde_json::{Value, json};

use super::animated::{Animated, all_at};

const NODE: usize = 0;

/// File with two animations of the node's translation.
fn two() -> Animated {
    let mut scene = Animated::new();
    for (name, x) in [("left", -1.0), ("right", 1.0)] {
        let animation = scene.animation(name);
        scene.moved(animation, (NODE, "translation"), &[(0.0, [x, 0.0, 0.0])], "LINEAR");
    }
    scene
}

fn playing(names: &[&str]) -> Moment {
    Moment { animations: names.iter().map(ToString::to_string).collect(), seconds: 0.0 }
}

#[test]
fn animations_of_one_property_are_chosen_by_name() {
    let file = two().file().unwrap();
    for (name, x) in [("left", -1.0), ("right", 1.0)] {
        let scene = file.at(&playing(&[name, name])).unwrap();
        assert_eq!(scene.triangles[0].vertices[0].x, x);
    }
    let error = file.at(&all_at(0.0)).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("nodes[0]") && text.contains("animations[1].channels[0]"), "{text}");
    assert!(error.help().unwrap().to_string().contains("--animation"));
}

#[test]
fn an_unknown_name_is_refused_with_the_known_ones() {
    let error = two().file().unwrap().at(&playing(&["left", "up"])).unwrap_err();
    assert!(error.to_string().contains("'up'"), "{error}");
    let help = error.help().unwrap().to_string();
    assert!(help.contains("'left'") && help.contains("'right'"), "{help}");
}

/// Evaluates a linear translation after a change of its JSON.
fn changed(change: impl FnOnce(&mut Value)) -> Result<(), SceneError> {
    let mut scene = Animated::new();
    let animation = scene.animation("walk");
    scene.moved(animation, (NODE, "translation"), &[(0.0, [0.0; 3]), (1.0, [1.0; 3])], "LINEAR");
    change(scene.json());
    both(&scene)
}

/// Evaluates the scene at 0.5 s. If listing the animations fails as well, both errors must be equal.
fn both(scene: &Animated) -> Result<(), SceneError> {
    let file = scene.file()?;
    let listed = file.animations().map(drop);
    let placed = file.at(&all_at(0.5)).map(drop);
    if let (Err(listed), Err(placed)) = (&listed, &placed) {
        assert_eq!(listed.to_string(), placed.to_string());
    }
    file.cameras_at(&all_at(0.5)).err().map_or(Ok(()), Err).and(placed)
}

fn refused(found: Result<(), SceneError>, place: &str) {
    let error = found.expect_err(place);
    assert!(error.to_string().contains(place), "{error} does not name {place}");
}

#[test]
fn channels_that_refer_to_nothing_are_refused() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 6] = [
        ("animations[0].channels[0].target.node", |json| {
            json["animations"][0]["channels"][0]["target"]["node"] = json!(9);
        }),
        ("animations[0].channels[0].sampler", |json| {
            json["animations"][0]["channels"][0]["sampler"] = json!(1);
        }),
        ("animations[0].samplers[0].input", |json| {
            json["animations"][0]["samplers"][0]["input"] = json!(99);
        }),
        ("animations[0].samplers[0].output", |json| {
            json["animations"][0]["samplers"][0]["output"] = json!(99);
        }),
        ("interpolation", |json| {
            json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBIC");
        }),
        ("animations[0].channels[0]", |json| {
            json["nodes"][NODE]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        }),
    ];
    for (place, change) in cases {
        refused(changed(change), place);
    }
    assert!(changed(|_| {}).is_ok());
}

#[test]
fn accessors_of_another_form_or_of_too_few_elements_are_refused() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 6] = [
        // Counts that exceed the bytes.
        ("accessors[2]", |json| json["accessors"][2]["count"] = json!(1_000_000_000)),
        ("accessors[3]", |json| json["accessors"][3]["count"] = json!(u32::MAX)),
        ("animations[0].channels[0]", |json| json["accessors"][3]["count"] = json!(1)),
        ("animations[0].channels[0]", |json| {
            json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
        }),
        ("animations[0].samplers[0].input", |json| json["accessors"][2]["type"] = json!("VEC2")),
        ("animations[0].samplers[0].output", |json| json["accessors"][3]["type"] = json!("VEC4")),
    ];
    for (place, change) in cases {
        refused(changed(change), place);
    }
}

#[test]
fn times_that_do_not_increase_are_refused() {
    for times in [[0.0, 0.0], [1.0, 0.5], [f32::NAN, 1.0], [0.0, f32::NAN], [0.0, f32::INFINITY]] {
        let mut scene = Animated::new();
        let animation = scene.animation("walk");
        let keys = times.map(|time| (time, [0.0; 3]));
        scene.moved(animation, (NODE, "translation"), &keys, "LINEAR");
        refused(both(&scene), "animations[0].samplers[0].input");
    }
}

#[test]
fn a_sampler_without_keyframes_is_refused() {
    let found = changed(|json| {
        json["accessors"][2]["count"] = json!(0);
        json["accessors"][3]["count"] = json!(0);
    });
    assert!(found.is_err());
}

#[test]
fn values_that_give_no_pose_are_refused() {
    for value in [f32::NAN, f32::INFINITY] {
        for path in ["translation", "scale"] {
            let mut scene = Animated::new();
            let animation = scene.animation("walk");
            scene.moved(animation, (NODE, path), &[(0.0, [0.0, value, 0.0])], "LINEAR");
            refused(both(&scene), "animations[0].channels[0]");
        }
    }
    for rotation in [[0.0; 4], [f32::NAN, 0.0, 0.0, 1.0]] {
        let mut scene = Animated::new();
        let animation = scene.animation("turn");
        scene.moved(animation, (NODE, "rotation"), &[(0.0, rotation)], "LINEAR");
        assert!(both(&scene).is_err(), "{rotation:?}");
    }
}

/// Weights of a mesh without morph targets have no values and move nothing.
#[test]
fn weights_without_targets_move_nothing() {
    let mut scene = Animated::new();
    let animation = scene.animation("breathe");
    scene.moved(animation, (NODE, "weights"), &[(0.0, [1.0]), (1.0, [0.0])], "LINEAR");
    assert_eq!(scene.corners(0.5), Animated::new().corners(0.0));
}

#[test]
fn targets_that_do_not_fit_their_mesh_are_refused() {
    let mut scene = Animated::new();
    let short = scene.0.floats("VEC3", &[[0.0; 3]; 2]);
    scene.0.primitive()["targets"] = json!([{"POSITION": short}]);
    refused(both(&scene), "targets[0].POSITION");
    let mut scene = Animated::new();
    scene.0.primitive()["targets"] = json!([{"NORMAL": 99}]);
    assert!(both(&scene).is_err());
    let mut scene = Animated::new();
    scene.0.primitive()["targets"] = json!(vec![json!({}); 1025]);
    refused(both(&scene), "targets");
    let mut scene = Animated::new();
    scene.0.primitive()["targets"] = json!([{"POSITION": 0}]);
    scene.json()["nodes"][NODE]["weights"] = json!([1e30]);
    assert!(both(&scene).is_err(), "a vertex that far away");
}
