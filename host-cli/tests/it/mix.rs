//! Light groups of a render, and `photoncard mix`.

use photoncard_driver::exr::{Shown, read};

use crate::support::{Outcome, Room, mirrored_cornell};

/// Renders a box whose lamp is one group, and whose sky is the rest.
fn room_with_a_picture(options: &[&str]) -> Room {
    let room = Room::new();
    room.write_scene("box.gltf", &mirrored_cornell());
    let groups = ["--light-groups", "key=light", "--environment", "0.2,0.3,0.5", "-o", "a.exr"];
    room.rendered("box.gltf", &[&groups, options].concat());
    room
}

fn mix(room: &Room, options: &[&str]) -> Outcome {
    room.run(&[&["mix", "a.exr"], options].concat())
}

fn mixed(room: &Room, options: &[&str]) {
    let outcome = mix(room, options);
    assert_eq!((outcome.status, &*outcome.stdout, &*outcome.stderr), (Some(0), "", ""));
}

fn radiance(room: &Room, name: &str) -> Vec<[f32; 3]> {
    read(&room.path(name), Shown::Denoised).expect("a picture").pixels
}

#[test]
fn a_mix_without_gains_is_the_file_and_gains_multiply() {
    let room = room_with_a_picture(&["--aov", "all", "--transparent"]);
    mixed(&room, &["-o", "b.exr"]);
    assert!(room.read("b.exr") == room.read("a.exr"));
    mixed(&room, &["--group", "key=0", "-o", "sky.exr"]);
    mixed(&room, &["--group", "rest=0", "-o", "key.exr", "-o", "key.png"]);
    mixed(&room, &["--group", "key=2,1,0.5", "--group", "rest=0", "-o", "tinted.exr"]);
    let [whole, sky, key, tinted] =
        ["a.exr", "sky.exr", "key.exr", "tinted.exr"].map(|name| radiance(&room, name));
    for (index, whole) in whole.iter().enumerate() {
        let sum = [0, 1, 2].map(|channel| key[index][channel] + sky[index][channel]);
        assert_eq!(sum, *whole);
        let [red, green, blue] = key[index];
        assert_eq!(tinted[index], [2.0 * red, green, 0.5 * blue]);
    }
    assert!(key.concat().iter().sum::<f32>() > 0.0 && sky.concat().iter().sum::<f32>() > 0.0);
    // The PNG is that of the EXR.
    let outcome = room.run(&["tonemap", "key.exr", "-o", "same.png"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(room.read("same.png") == room.read("key.png"));
}

#[test]
fn mixes_multiply_and_state_their_gains() {
    let room = room_with_a_picture(&["--aov", "none"]);
    mixed(&room, &["--group", "key=2", "-o", "b.exr"]);
    let outcome = room.run(&["mix", "b.exr", "--group", "key=0.5", "-o", "c.exr"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert_eq!(radiance(&room, "c.exr"), radiance(&room, "a.exr"));
    let text = String::from_utf8_lossy(&room.read("c.exr")).into_owned();
    assert!(text.contains(r#""mix":{"key":[1.0,1.0,1.0]}"#));
}

#[test]
fn wrong_gains_groups_and_pictures_are_refused_with_a_remedy() {
    let room = room_with_a_picture(&["--aov", "none"]);
    room.rendered("box.gltf", &["-o", "plain.exr"]);
    let before = room.names();
    let render = |groups: &str| room.render("box.gltf", &["-o", "b.exr", "--light-groups", groups]);
    for (outcome, words) in [
        (mix(&room, &["--group", "lamp=2", "-o", "b.exr"]), &["\"lamp\"", "\"key\", \"rest\""][..]),
        (mix(&room, &["--group", "key=-1", "-o", "b.exr"]), &["key=1.5,0.9,0.8"]),
        (mix(&room, &["--group", "key", "-o", "b.exr"]), &["NAME=R,G,B"]),
        (mix(&room, &["-o", "a.exr"]), &["a.exr"]),
        (mix(&room, &["-o", "b.part"]), &["part"]),
        (mix(&room, &["--denoise", "-o", "b.exr"]), &["albedo"]),
        (room.run(&["mix", "plain.exr", "-o", "b.exr"]), &["no light groups", "--light-groups"]),
        (room.run(&["mix", "box.gltf", "-o", "b.exr"]), &["not a readable OpenEXR picture"]),
        (render("key=lihgt"), &["lihgt", "'light'"]),
        (render("key"), &["there is no =", "key=Lamp,Spot"]),
        (render("file"), &["the file states no light groups"]),
    ] {
        assert_eq!((outcome.status, &*outcome.stdout), (Some(2), ""), "{}", outcome.stderr);
        let said = outcome.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        // Without Open Image Denoise, the library is what is missing.
        let is_said = |word: &&str| said.contains(*word) || *word == "albedo" && said.contains("Denoise");
        assert!(words.iter().all(is_said), "{words:?} are not in: {said}");
    }
    assert_eq!(room.names(), before);
}
