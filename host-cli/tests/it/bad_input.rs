//! Invalid arguments and unreadable input: the exit status is 2, the error has location and remedy, and no
//! file changes.

use std::fs;

use crate::support::{Outcome, Room, scene, scene_bytes, scene_of, shipped};
use serde_json::{Value, json};

/// Checks that a command was refused: status 2, these words in its message, and nothing on standard output.
fn check_refused(outcome: &Outcome, words: &[&str], case: &str) {
    let Outcome { status, stdout, stderr } = outcome;
    assert_eq!(*status, Some(2), "{case}: {stderr}");
    assert_eq!(stdout, "", "{case}");
    for word in words {
        assert!(stderr.contains(word), "{case}: {word:?} is not in: {stderr}");
    }
}

/// Checks that a render is refused with these words, that it leaves an old picture unchanged, and that it
/// writes no other file.
fn refused(room: &Room, scene: &str, options: &[&str], words: &[&str]) {
    let case = format!("{scene} {options:?}");
    room.write("out.exr", "old picture");
    let before = room.names();
    let mut all = vec!["-o", "out.png"];
    for default in [["-o", "out.exr"], ["--stats", "out.json"]] {
        if !options.contains(&default[0]) {
            all.extend(default);
        }
    }
    all.extend(options);
    check_refused(&room.render(scene, &all), words, &case);
    assert_eq!(room.names(), before, "{case}");
    assert_eq!(room.read("out.exr"), b"old picture", "{case}");
}

/// Checks that a render of a scene is refused with these words.
fn refused_scene(scene: &Value, words: &[&str]) {
    let room = Room::new();
    room.write_scene("scene.gltf", scene);
    refused(&room, "scene.gltf", &[], &[&["scene.gltf", "help:"], words].concat());
}

#[test]
fn files_that_are_no_scene_are_refused() {
    let room = Room::new();
    let atrium = fs::read(shipped("atrium.glb")).unwrap();
    room.write("cut.glb", &atrium[..atrium.len() / 2]);
    room.write("empty.gltf", "");
    room.write("list.gltf", "[]");
    room.write("open.gltf", "{");
    room.write("other.gltf", "{\"name\": \"no glTF\"}");
    fs::create_dir(room.path("folder")).unwrap();
    let unreadable = "check that the path names a file";
    for (file, words) in [
        ("absent.gltf", ["cannot read", unreadable]),
        ("folder", ["a folder", "a file .gltf or .glb"]),
        ("cut.glb", ["truncated", "copy or export the file again"]),
        ("empty.gltf", ["empty", "glTF 2.0"]),
        ("list.gltf", ["its JSON is no object", "glTF's schema"]),
        ("open.gltf", ["glTF JSON", "correct the JSON"]),
        ("other.gltf", ["missing field `asset`", "glTF's schema"]),
    ] {
        refused(&room, file, &[], &[file, words[0], words[1]]);
        check_refused(&room.run(&["scene", "info", file]), &[file, words[0], words[1]], file);
    }
    #[cfg(unix)]
    refused(&room, "/dev/null", &[], &["/dev/null", "not a regular file"]);
}

#[test]
fn scenes_that_violate_gltf_are_refused() {
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut scene = scene();
        change(&mut scene);
        scene
    };
    refused_scene(&changed(&|s| s["accessors"][0]["count"] = json!(400)), &["accessors[0]"]);
    refused_scene(
        &changed(&|s| s["extensionsRequired"] = json!(["KHR_materials_anisotropy"])),
        &["extensionsRequired[0]", "KHR_materials_anisotropy", "convert the scene without"],
    );
    let mut bytes = scene_bytes();
    bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    refused_scene(&scene_of(&bytes), &["vertex 1", "'room'", "repair the mesh"]);
    let mut bytes = scene_bytes();
    bytes[84..86].copy_from_slice(&9u16.to_le_bytes());
    refused_scene(&scene_of(&bytes), &["index 0 is 9", "4 vertices", "repair the mesh"]);
}

#[test]
fn scenes_without_geometry_or_light_are_refused() {
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut scene = scene();
        change(&mut scene);
        scene
    };
    refused_scene(&changed(&|s| s["scenes"][0]["nodes"] = json!([1])), &["no triangles", "mesh"]);
    refused_scene(&changed(&|s| s["nodes"][0]["scale"] = json!([1, 0, 0])), &["all 3", "zero area", "scale"]);
    let dark = changed(&|s| s["materials"][1]["emissiveFactor"] = json!([0, 0, 0]));
    let room = Room::new();
    room.write_scene("dark.gltf", &dark);
    refused(&room, "dark.gltf", &[], &["no light", "emissiveFactor", "help:"]);
    // A floor that absorbs all of the lamp's light.
    let black = json!([0.0, 0.0, 0.0, 1.0]);
    room.write_scene(
        "lost.gltf",
        &changed(&|s| s["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = black.clone()),
    );
    let lost = room.rendered("lost.gltf", &["-o", "lost.exr", "--quiet"]).stderr;
    assert!(lost.contains("only 0 photons") && lost.contains("the picture is black"), "{lost}");
    fs::remove_file(room.path("lost.exr")).unwrap();
    room.write_scene("scene.gltf", &scene());
    refused(&room, "scene.gltf", &["--set", "lamp.emission=0"], &["no light", "emissiveFactor"]);
}

#[test]
fn numbers_out_of_range_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (option, value, words) in [
        ("--photons", "0", ["1 to", "choose 1 or more"]),
        ("--photons", "-5", ["-5", "invalid"]),
        ("--photons", "99999999999", ["1 to", "or less"]),
        ("--photons", "18446744073709551616", ["--photons", "too large"]),
        ("--size", "0x0", ["WIDTHxHEIGHT", "at least 1"]),
        ("--size", "8x", ["WIDTHxHEIGHT", "512x512"]),
        ("--size", "99999x99999", ["--size 99999 is not possible", "65536 or less"]),
        ("--size", "70000x1", ["70000", "65536 or less"]),
        ("--crop", "0,9,0,8", ["not inside", "X1 <= width"]),
        ("--crop", "3,3,0,8", ["empty", "X0 < X1"]),
        ("--crop", "0,9", ["four whole numbers", "0,64,0,64"]),
        ("--crop", "0,9,a,b", ["four whole numbers", "0,64,0,64"]),
        ("--crop", "-1,2,3,4", ["four whole numbers", "0,64,0,64"]),
        ("--size", "-8x8", ["WIDTHxHEIGHT", "512x512"]),
        ("--tile", "0", ["1 to 64", "choose 1 or more"]),
        ("--tile", "65", ["1 to 64", "64 or less"]),
        ("--neighbors", "0", ["2 to 256", "choose 2 or more"]),
        ("--neighbors", "257", ["2 to 256", "256 or less"]),
        ("--spp", "0", ["1 to 4096", "choose 1 or more"]),
        ("--spp", "4294967295", ["1 to 4096", "4096 or less"]),
        ("--planned-spp", "0", ["1 to 4096", "choose 1 or more"]),
        ("--gather-rays", "4294967295", ["0 to", "or less"]),
        ("--max-distance", "-1", ["positive number", "auto"]),
        ("--max-distance", "nan", ["positive number", "auto"]),
        ("--near-distance", "-1", ["0 or more", "auto"]),
        ("--near-distance", "inf", ["0 or more", "auto"]),
        ("--threads", "0", ["1 to 1024", "leave the option out"]),
        ("--threads", "100000", ["1 to 1024", "leave the option out"]),
        ("--seed", "-1", ["--seed", "invalid"]),
        ("--camera-at", "1,2", ["three numbers of metres", "0,1.5,4"]),
        ("--camera-at", "1,2,nan", ["three numbers of metres", "0,1.5,4"]),
        ("--look-at", "-1,-2,-3,-4", ["three numbers of metres", "0,1.5,4"]),
        ("--look-at", "0,0.5,3", ["the camera itself is there", "--camera-at"]),
        ("--up", "0,0,0", ["no direction", "0,1,0"]),
        ("--up", "0,0,-2", ["no direction", "0,1,0"]),
        ("--fov", "0", ["above 0 and below 180", "such as 40"]),
        ("--fov", "-20", ["above 0 and below 180", "such as 40"]),
        ("--fov", "180", ["above 0 and below 180", "such as 40"]),
        ("--fov", "wide", ["--fov", "invalid"]),
        ("--orthographic", "0", ["above 0 metres", "such as 3"]),
        ("--orthographic", "-1", ["above 0 metres", "such as 3"]),
        ("--panorama", "400,180", ["up to 360 degrees", "give 360,180"]),
        ("--panorama", "0", ["up to 360 degrees", "give 360,180"]),
        ("--panorama", "1,2,3", ["LONGITUDES,LATITUDES", "360,180"]),
        ("--shift", "0.1", ["two numbers", "0,0.2"]),
        ("--shift", "0.1,inf", ["finite", "0,0.2"]),
        ("--aperture", "f/0", ["f-number", "f/2.8"]),
        ("--aperture", "-0.1", ["f-number", "f/2.8"]),
        ("--aperture", "f/2.8", ["distance in focus", "in metres"]),
        ("--focus", "2", ["a pinhole is in focus everywhere", "f/2.8"]),
        ("--texture-limit", "0", ["0 is not in 1..=16384", "--texture-limit"]),
        ("--texture-limit", "16385", ["16385 is not in 1..=16384", "--texture-limit"]),
        ("--card-memory", "100K", ["from 1M to 511G", "--card-memory"]),
    ] {
        refused(&room, "scene.gltf", &[option, value], &[option, words[0], words[1]]);
    }
}

#[test]
fn cameras_refuse_what_their_projection_lacks() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let around = ["--panorama", "360"];
    for (options, words) in [
        ([around, ["--shift", "0.1,0"]].concat(), ["--shift", "no lens shift"]),
        ([around, ["--aperture", "0.1"]].concat(), ["--aperture", "in focus"]),
        ([["--aperture", "0.1"], ["--focus", "-1"]].concat(), ["--focus", "from 1e-6 to 1e9"]),
        ([["--aperture", "0.1"], ["--focus", "1e20"]].concat(), ["--focus", "from 1e-6 to 1e9"]),
        ([["--aperture", "1e7"], ["--focus", "1"]].concat(), ["--aperture", "up to 1e6"]),
        ([["--shift", "3e38,0"], ["--fov", "40"]].concat(), ["--shift", "up to 1e6"]),
        ([["--orthographic", "3e38"], ["--spp", "1"]].concat(), ["--orthographic", "up to 1e12"]),
        (
            [["--aperture", "0.1"], ["--focus", "1"], ["--orthographic", "2"]].concat(),
            ["--aperture", "perspective"],
        ),
        ([["--fov", "40"], ["--orthographic", "2"]].concat(), ["--fov", "cannot be used with"]),
        ([around, ["--orthographic", "2"]].concat(), ["--panorama", "cannot be used with"]),
    ] {
        refused(&room, "scene.gltf", &options, &words);
    }
}

#[test]
fn unknown_names_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (option, value, words) in [
        ("--camera", "absent", ["no camera 'absent'", "'eye'"]),
        ("--variant", "night", ["no variant 'night'", "leave the option out"]),
        ("--light-units", "candela", ["radiometric", "photometric"]),
        ("--set", "floor", ["`floor`", "NAME.PROPERTY=VALUE"]),
        ("--set", "flor.diffuse=0", ["'flor'", "'floor'"]),
        ("--set", "floor.gloss=1", ["'gloss'", "the properties of a material are"]),
        ("--set", "floor.diffuse=2", ["albedo", "0 to 1"]),
        ("--ic-error", "nan", ["--ic-error", "0.025"]),
        ("--adaptive", "0", ["positive number", "off"]),
        ("--adaptive", "inf", ["positive number", "off"]),
        ("--card", "serial:", ["serial port", "serial:PATH[@BAUD]"]),
        ("--card", "serial:/dev/x@fast", ["no speed", "such as 115200"]),
        ("--card", "serial:/dev/x@1200", ["too slow", "use 4800 or more"]),
        ("--card", "serial:/dev/x,rts=high", ["\"rts=high\" states neither on nor off", "use dtr=on|off"]),
        ("--card", "tcp:localhost", ["no TCP address", "tcp:HOST:PORT"]),
        ("--card", "unix:", ["Unix socket", "unix:PATH"]),
        ("--card", "abacus", ["no kind of card", "emulated[:CHIPS]"]),
        ("--card", "emulated:0", ["no number of chips", "use 1 to"]),
    ] {
        refused(&room, "scene.gltf", &[option, value], &words);
    }
}

#[test]
fn files_that_are_no_environment_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.write("text.hdr", "no picture");
    for (environment, words) in [
        ("absent.hdr", ["absent.hdr", "cannot read"]),
        ("text.hdr", ["text.hdr", "OpenEXR"]),
        ("1,2", ["--environment", "R,G,B"]),
        ("1,2,-3", ["--environment", "R,G,B"]),
    ] {
        refused(&room, "scene.gltf", &["--environment", environment], &words);
    }
    let options = ["--environment", "text.hdr", "--stats", "text.hdr"];
    refused(&room, "scene.gltf", &options, &["it is the environment as well", "a name of its own"]);
}

#[test]
fn skies_of_no_place_or_time_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (sky, said) in [
        ("91,0,2026-06-21T12:00Z", "-90 to 90"),
        ("0,0,2026-13-21T12:00Z", "month 13"),
        ("0,0,2026-06-21T12:00", "offset"),
        ("0,0,2026-06-21T12:00Z,0", "1.7 to 10"),
    ] {
        refused(&room, "scene.gltf", &["--sky", sky], &["--sky", said]);
    }
    let both = ["--sky", "0,0,2026-06-21T12:00Z", "--environment", "1,1,1"];
    refused(&room, "scene.gltf", &both, &["--sky", "--environment"]);
    refused(&room, "scene.gltf", &["--north", "90"], &["--sky"]);
}

#[test]
fn options_for_emulated_cards_are_refused_for_others() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for card in ["serial:/dev/absent", "tcp:127.0.0.1:1", "unix:absent"] {
        for (options, words) in [
            (["--counters", "--card", "emulated:1"], ["only the memory", "leave --counters or --cache out"]),
            (["--cache=unified=64K/128/4", "--card", "emulated:1"], ["only the memory", card]),
            (["--trace=out.din.gz", "--tile", "8"], ["--trace", "use --card emulated:1"]),
        ] {
            refused(&room, "scene.gltf", &[&options[..], &["--card", card]].concat(), &words);
        }
    }
}

#[test]
fn settings_beyond_every_card_are_refused_before_one_is_reached() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (option, value) in [
        ("--size", "70000x1"),
        ("--crop", "0,9,0,8"),
        ("--photons", "0"),
        ("--caustic-photons", "99999999999"),
        ("--bins", "0"),
        ("--ic-error", "2"),
        ("--max-distance", "-1"),
        ("--near-distance", "-1"),
        ("--verify", "2"),
    ] {
        // No card listens at this address: an error about the card would mean that the value was accepted.
        let options = [option, value, "--card", "tcp:127.0.0.1:1", "--irradiance-cache", "on"];
        refused(&room, "scene.gltf", &options, &[option]);
    }
}

#[test]
fn photons_for_one_camera_are_refused_for_several_frames() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let words = ["--photons-for", "--frames"];
    refused(&room, "scene.gltf", &["--photons-for", "camera", "--frames", "1-2"], &words);
}

#[test]
fn invalid_arguments_of_an_emulator_are_refused() {
    let room = Room::new();
    for (options, words) in [
        (&[][..], ["--listen", "required"]),
        (&["--listen", "abacus"], ["no address to listen on", "unix:PATH"]),
        (&["--listen", "unix:"], ["no address to listen on", "unix:PATH"]),
        (&["--listen", "tcp:localhost:65536"], ["no port", "0 to 65535"]),
        (&["--listen", "tcp:::1:7000"], ["no host", "in brackets"]),
        (&["--listen", "pty", "--card", "tcp:localhost:1"], ["--card", "emulated-micro"]),
        (&["--listen", "pty", "--card", "emulated:2"], ["--card", "emulated-micro"]),
    ] {
        check_refused(&room.run(&[&["emulate"], options].concat()), &words, &format!("{options:?}"));
    }
    check_refused(&room.run(&["card", "ping", "--count", "0"]), &["--count"], "no hello");
    assert!(room.names().is_empty());
}

#[test]
fn an_impossible_chip_is_refused_with_its_field_and_range() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.write("chip.toml", "[memory]\n# No chip gathers without a queue.\ngather_queue = 0\n");
    let words = ["--card", "chip.toml:3: [memory] gather_queue is 0; use a whole number from 1 to"];
    refused(&room, "scene.gltf", &["--card", "emulated:chip.toml:2"], &words);
    refused(
        &room,
        "scene.gltf",
        &["--card", "emulated:absent.toml"],
        &["--card", "absent.toml cannot be read"],
    );
    for command in [
        &["prepare", "scene.gltf", "-o", "a.card"][..],
        &["emulate", "--listen", "unix:a"],
        &["card", "info"],
        &["view", "scene.gltf"],
    ] {
        check_refused(&room.run(&[command, &["--card", "emulated:chip.toml"]].concat()), &words, command[0]);
    }
}

#[test]
fn an_image_larger_than_the_card_is_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let options = ["--card", "emulated-micro:1", "--photons", "5000000"];
    let words = ["DRAM budget is 16777216 bytes", "lower --photons to"];
    refused(&room, "scene.gltf", &options, &words);
}

#[test]
fn outputs_that_cannot_be_written_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    fs::create_dir(room.path("folder.exr")).unwrap();
    let scene_before = room.read("scene.gltf");
    let own_name = "a name of its own";
    for (options, words) in [
        (["-o", "absent/out.exr"], ["the folder absent does not exist", "create it"]),
        (["-o", "folder.exr"], ["a folder has that name", "choose another"]),
        (["--stats", "."], ["names no file", "add a file name"]),
        (["--stats", "folder.exr/../scene.gltf"], ["it is the scene as well", own_name]),
        (["-o", "./out.png"], ["it is another output as well", own_name]),
        (["-o", "folder.exr/../out.png"], ["it is another output as well", own_name]),
    ] {
        refused(&room, "scene.gltf", &options, &words);
        assert_eq!(room.read("scene.gltf"), scene_before);
    }
    for picture in ["out.exr", "out.png"] {
        let partial = format!("{picture}.partial");
        let outcome = room.render("scene.gltf", &["-o", picture, "--stats", &partial]);
        check_refused(&outcome, &[&partial, "it is another output as well", own_name], picture);
    }
}

/// The suffix of `-o` is checked before a card is reached or the scene is read.
#[test]
fn outputs_of_an_unknown_format_are_refused() {
    let room = Room::new();
    let unread = ["--card", "tcp:127.0.0.1:1"];
    for name in ["out", ".", ".exr", "out.exr.partial"] {
        let outcome = room.render("absent.gltf", &[&["-o", name], &unread[..]].concat());
        check_refused(&outcome, &["OUT.exr", "OUT.png", "endings"], name);
        let outcome = room.run(&["tonemap", "absent.exr", "-o", name]);
        check_refused(&outcome, &["OUT.exr", "OUT.png", "endings"], name);
    }
    check_refused(&room.run(&["tonemap", "a.exr", "-o", "b.exr"]), &["the ending .png"], "tonemap");
    let outcome = room.render("absent.gltf", &["-o", "a.exr", "--trace", "-"]);
    check_refused(&outcome, &["--trace", "standard output", "./-"], "trace");
    for (name, words) in [("out.jpg", ["JPEG", "magick"]), ("out.mp4", ["video", "--frames"])] {
        check_refused(&room.render("absent.gltf", &["-o", name]), &words, name);
    }
    let farm = room.run(&["farm", "slurm", "absent.gltf"]);
    check_refused(&farm, &["a job writes its pictures", "-o OUT.exr"], "no output");
    let part = room.render("absent.gltf", &["--part", "1/2"]);
    check_refused(&part, &["part 1/2", "OUT.part"], "no output of a part");
    assert!(room.names().is_empty());
}

/// An output must be a regular file: a pipe would block, and a device or a link would be replaced.
#[cfg(unix)]
#[test]
fn outputs_that_are_no_regular_files_are_refused() {
    use std::os::unix::fs::symlink;
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    assert!(std::process::Command::new("mkfifo").arg(room.path("pipe.png")).status().unwrap().success());
    symlink("absent", room.path("broken.exr")).unwrap();
    let files = ["broken.exr", "pipe.png", "scene.gltf"];
    for (name, kind) in
        [("pipe.png", "a named pipe"), ("broken.exr", "a broken symbolic link"), ("/dev/null", "a device")]
    {
        for option in ["-o", "--stats", "--trace"].into_iter().skip(usize::from(name == "/dev/null")) {
            let options = ["-o", "out.exr", "--card", "emulated:1", option, name];
            check_refused(&room.render("scene.gltf", &options), &[name, kind, "choose another"], option);
            assert_eq!(room.names(), files);
            assert!(room.path("broken.exr").is_symlink());
        }
    }
    check_refused(&room.run(&["tonemap", "a.exr", "-o", "pipe.png"]), &["a named pipe"], "tonemap");
}

#[test]
fn pictures_that_cannot_be_compared_are_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.rendered("scene.gltf", &["-o", "a.exr"]);
    room.rendered("scene.gltf", &["-o", "b.exr", "--size", "4x8"]);
    for (pictures, words) in [
        (["a.exr", "b.exr"], ["8 x 8", "4 x 8"]),
        (["a.exr", "scene.gltf"], ["scene.gltf", "not a readable OpenEXR picture"]),
        (["absent.exr", "a.exr"], ["absent.exr", "check that the path"]),
    ] {
        check_refused(&room.run(&["diff", pictures[0], pictures[1]]), &words, pictures[1]);
    }
    for (option, value) in [("--block", "0"), ("--exclude-above", "NaN"), ("--exclude-above", "-1")] {
        check_refused(&room.run(&["diff", "a.exr", "a.exr", option, value]), &[value], option);
    }
}
