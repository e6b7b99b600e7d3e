//! First commands of a new user: no options, default outputs, pipes, and options of other renderers.

use std::fs;
use std::process::Stdio;

use photoncard_driver::exr::{Shown, read};
use serde_json::json;

use crate::support::{Outcome, Room, scene, small_render};

#[test]
fn the_default_picture_is_beside_the_scene_and_replaces_no_other_file() {
    let room = Room::new();
    fs::create_dir(room.path("sub")).unwrap();
    room.write_scene("sub/room.one.gltf", &scene());
    let said = room.rendered("sub/room.one.gltf", &[]).stderr;
    assert!(said.contains("written to sub/room.one.png"), "{said}");
    let first = room.read("sub/room.one.png");
    room.rendered("sub/room.one.gltf", &["--seed", "1"]);
    assert!(room.read("sub/room.one.png") != first, "its own file is replaced");
    for other in [&b"a drawing"[..], b"\x89PNG\r\n\x1a\n"] {
        room.write("sub/room.one.png", other);
        let refused = room.render("sub/room.one.gltf", &[]);
        let is_named = refused.stderr.contains("sub/room.one.png") && refused.stderr.contains("-o OUT.png");
        assert!(refused.status == Some(2) && is_named, "{}", refused.stderr);
        assert_eq!(room.read("sub/room.one.png"), other);
    }
    room.rendered("sub/room.one.gltf", &["-o", "sub/room.one.png", "--quiet"]);
}

#[test]
fn a_picture_goes_to_a_pipe() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.rendered("scene.gltf", &["-o", "a.png"]);
    let piped = |options: &[&str]| {
        let mut command = room.command();
        command.args(small_render("scene.gltf", options)).stdout(Stdio::piped());
        command.output().unwrap()
    };
    let output = piped(&["-o", "-"]);
    assert!(output.status.success() && output.stdout == room.read("a.png"));
    assert_eq!(room.names(), ["a.png", "scene.gltf"]);
    let twice = Outcome::of(&piped(&["-o", "-", "--stats", "-"]));
    assert!(twice.status == Some(2) && twice.stderr.contains("one output alone"), "{}", twice.stderr);
    let progress = Outcome::of(&piped(&["-o", "-", "--progress", "openjd"]));
    assert_eq!(progress.status, Some(2), "{}", progress.stderr);
    let kept = Outcome::of(&piped(&["-o", "-", "--keep-samples"]));
    assert!(kept.status == Some(2) && kept.stderr.contains("beside a file"), "{}", kept.stderr);
    let frames = Outcome::of(&piped(&["-o", "-", "--frames", "1-2"]));
    assert!(frames.status == Some(2) && frames.stderr.contains("run of #"), "{}", frames.stderr);
}

#[test]
fn options_of_other_renderers_and_other_files_get_a_remedy() {
    let room = Room::new();
    room.write("a.blend", b"BLENDER-v405RENDH");
    room.write("a.obj", "v 0 0 0\n");
    room.write_scene("scene.gltf", &scene());
    for (arguments, parts) in [
        (&["render", "scene.gltf", "a.png"][..], &["-o a.png"][..]),
        (&["render", "scene.gltf", "--samples", "9"], &["--spp"]),
        (&["render", "a.blend", "-o", "a.png"], &["file of Blender", "blender -b a.blend --python-expr"]),
        (&["render", "a.obj", "-o", "a.png"], &["OBJ", "wm.obj_import"]),
        (&["render", ".", "-o", "a.png"], &["a folder", "scene.gltf"]),
        (&["scene", "info", "http://host/a.glb"], &["an address", "curl -L -o a.glb http://host/a.glb"]),
        (&["a.glb", "--samples", "1"], &["--spp"]),
        (&["absent.glb"], &["absent.glb"]),
        (
            &["render", "scene.gltf", "--frames", "1-2", "-o", "view.####.mp4"],
            &["one video of all frames", "-o view.mp4", "view.####.png"],
        ),
    ] {
        let refused = room.run(arguments);
        let is_named = parts.iter().all(|part| refused.stderr.contains(part));
        assert!(refused.status == Some(2) && is_named, "{arguments:?}: {}", refused.stderr);
    }
}

/// The environment map is black in the red channel, except in one column.
#[test]
fn environments_are_turned_by_the_option_and_by_blenders_convention() {
    let room = Room::new();
    let mut scene = scene();
    // The camera looks up towards -z, and sees nothing but the sky.
    scene["nodes"][1]["rotation"] = json!([0.382_683_4, 0, 0, 0.923_879_5]);
    room.write_scene("other.gltf", &scene);
    scene["asset"]["generator"] = json!("Khronos glTF Blender I/O v5.0.21");
    room.write_scene("blender.gltf", &scene);
    let texel = |x: usize| if x == 4 { 1.0_f32 } else { 0.0 };
    exr::prelude::write_rgb_file(room.path("sky.exr"), 8, 4, |x, _| (texel(x), 0.5, 0.0)).unwrap();
    let red = |name: &str, options: &[&str]| {
        let all = [&["-o", "a.exr", "--environment", "sky.exr"], options].concat();
        room.rendered(name, &all);
        let picture = read(&room.path("a.exr"), Shown::Rendered).unwrap();
        picture.pixels.iter().map(|pixel| pixel[0]).sum::<f32>()
    };
    let ahead = red("other.gltf", &[]);
    assert!(ahead > 1.0, "{ahead}");
    assert_eq!(red("other.gltf", &["--environment-rotation", "180"]), 0.0);
    assert_eq!(red("blender.gltf", &[]), 0.0);
    assert_eq!(red("blender.gltf", &["--environment-rotation", "90"]), ahead);
}

/// In place of ffmpeg, a script joins the files of the list that it is given, or fails.
#[cfg(unix)]
#[test]
fn ffmpeg_makes_a_video_of_frames() {
    use std::os::unix::fs::PermissionsExt;
    let room = Room::new();
    let moving = crate::support::shipped("cornell-moving.glb");
    let run = |folder: &str, options: &[&str]| {
        let mut command = room.command();
        command.env("PATH", room.path(folder));
        let small = small_render(
            &moving,
            &["--frames", "1-2", "--fps", "12", "-o", "walk.mp4", "--card", "emulated:1"],
        );
        Outcome::of(&command.args(small).args(options).output().unwrap())
    };
    let without = run("nowhere", &[]);
    let is_told = without.stderr.contains("ffmpeg") && without.stderr.contains("walk.######.png");
    assert!(without.status == Some(2) && is_told && room.names().is_empty(), "{}", without.stderr);
    for (folder, script) in [
        (
            "good",
            "[ $1 = -version ] && exit; echo $@ >words; while read a b; do eval cat $b; done <${11} >${14}",
        ),
        ("bad", "[ $1 = -version ] && exit; echo no encoder >&2; exit 3"),
    ] {
        fs::create_dir(room.path(folder)).unwrap();
        room.write(&format!("{folder}/ffmpeg"), format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n"));
        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(room.path(&format!("{folder}/ffmpeg")), executable).unwrap();
    }
    let bad = run("bad", &["--quiet"]);
    assert!(bad.status == Some(1) && bad.stderr.contains("no encoder"), "{}", bad.stderr);
    assert!(bad.stderr.contains("-r 12") && !room.path("walk.mp4").exists(), "{}", bad.stderr);
    let good = run("good", &["--resume"]);
    assert!(good.status == Some(0) && good.stderr.contains("walk.mp4: 2 frames"), "{}", good.stderr);
    let frames = ["walk.000001.png", "walk.000002.png"].map(|name| room.read(name));
    assert_eq!(room.read("walk.mp4"), frames.concat());
    assert_eq!(room.names(), ["bad", "good", "walk.000001.png", "walk.000002.png", "walk.mp4", "words"]);
}
