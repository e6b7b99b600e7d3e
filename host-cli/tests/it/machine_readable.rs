//! Progress, notices and failures as JSON, and tiles on standard output: what programs read that start the
//! command.

use photoncard_driver::exr::{Shown, read};
use serde_json::{Value, json};

use crate::support::{Outcome, Room, scene, small_render};

/// Objects on standard error, which must have nothing else.
fn objects(outcome: &Outcome) -> Vec<Value> {
    outcome.stderr.lines().map(|line| serde_json::from_str(line).expect(line)).collect()
}

fn of_kind<'a>(objects: &'a [Value], kind: &str) -> Vec<&'a Value> {
    objects.iter().filter(|object| object["kind"] == kind).collect()
}

#[test]
fn progress_of_each_phase_begins_and_ends() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for passes in [&[] as &[_], &["--noise", "0.3"]] {
        let options = [&["-o", "out.exr", "--size=32x32", "--progress", "json"], passes].concat();
        let objects = objects(&room.rendered("scene.gltf", &options));
        let progress = of_kind(&objects, "progress");
        for phase in ["photons", "load", "tiles"] {
            let of_phase: Vec<_> = progress.iter().filter(|object| object["phase"] == phase).collect();
            let last = of_phase.last().expect(phase);
            assert_eq!(last["done"], last["total"], "{phase}");
            assert!(of_phase.iter().all(|object| object["seconds"].as_f64().is_some()), "{phase}");
        }
        let last = progress.last().expect("tiles");
        assert_eq!((&last["phase"], &last["seconds_left"]), (&json!("tiles"), &json!(0.0)));
        let said = of_kind(&objects, "message");
        assert!(said.iter().all(|object| !object["message"].as_str().unwrap().starts_with("photoncard")));
        assert!(!said.is_empty());
    }
    let quiet = room.rendered("scene.gltf", &["-o", "out.exr", "--progress=json", "--quiet"]);
    assert_eq!(quiet.stderr, "");
}

#[test]
fn notices_are_lists() {
    let room = Room::new();
    let mut odd = scene();
    odd["meshes"][0]["primitives"][0]["mode"] = json!(1);
    odd["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_materials_anisotropy"));
    odd["materials"][0]["extensions"]["KHR_materials_anisotropy"] = json!({"anisotropyStrength": 0.5});
    room.write_scene("scene.gltf", &odd);
    let objects = objects(&room.rendered("scene.gltf", &["-o", "out.png", "--progress", "json"]));
    let [ignored] = of_kind(&objects, "ignored")[..] else { panic!("{objects:?}") };
    let items = ignored["items"].as_array().unwrap();
    assert!(items.len() >= 2 && items.iter().all(Value::is_string), "{ignored}");
}

#[test]
fn a_failure_is_the_last_object_and_has_its_remedy_and_status() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.write("broken.gltf", "{");
    for (arguments, status, said, remedy) in [
        (small_render("none.gltf", &["-o", "a.png", "--progress", "json"]), 2, "none.gltf", true),
        (small_render("broken.gltf", &["-o", "a.png", "--progress", "json"]), 2, "broken.gltf", true),
        (small_render("scene.gltf", &["-o", "a.png", "--progress=json", "--sizes", "3"]), 2, "--sizes", true),
        (small_render("scene.gltf", &["-o", "a.png", "--progress=json", "--camera", "x"]), 2, "x", true),
        (
            small_render("scene.gltf", &["-o", "a.png", "--progress", "json", "--card", "unix:none"]),
            1,
            "none",
            false,
        ),
    ] {
        let outcome = room.run(&arguments);
        assert_eq!(outcome.status, Some(status), "{arguments:?}");
        let objects = objects(&outcome);
        let failure = objects.last().expect("a failure");
        assert_eq!((&failure["kind"], &failure["status"]), (&json!("failure"), &json!(status)));
        assert!(failure["message"].as_str().unwrap().contains(said), "{failure}");
        assert!(failure["remedy"].is_string() || !remedy, "{failure}");
    }
    assert_eq!(room.names(), ["broken.gltf", "scene.gltf"]);
}

#[test]
fn tiles_on_standard_output_are_those_of_a_display_server() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let options = ["-o", "out.exr", "--size=20x12", "--tile=8", "--display-server", "-"];
    let output = room.command().args(small_render("scene.gltf", &options)).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let viewed = crate::display::Viewed::of(&output.stdout);
    let picture = read(&room.path("out.exr"), Shown::Rendered).unwrap();
    assert_eq!((viewed.width, viewed.height), (picture.width, picture.height));
    let pixels: Vec<f32> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
    assert!(viewed.values[0] == pixels);
    assert!(viewed.updates > 2);
}

#[test]
fn standard_output_takes_tiles_alone() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for other in [["-o", "-"], ["--stats", "-"], ["--progress", "openjd"]] {
        let options = [&["--display-server", "-"], &other[..]].concat();
        let outcome = room.render("scene.gltf", &options);
        assert_eq!(outcome.status, Some(2), "{other:?}");
        assert!(outcome.stderr.contains("one output alone"), "{}", outcome.stderr);
    }
}
