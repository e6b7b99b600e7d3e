//! Outputs of a render. The picture depends only on the scene and its settings.

use crate::support::{Room, scene, scene_bytes, scene_of, shipped, small_render};
use photoncard_driver::exr::{RgbImage, Shown, read};
use serde_json::{Value, json};

fn picture(room: &Room, name: &str) -> RgbImage {
    read(&room.path(name), Shown::Rendered).unwrap()
}

#[test]
fn layers_are_requested_by_name_and_do_not_change_the_picture() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let of_options = |options: &[&str]| {
        room.rendered("scene.gltf", &[&["-o", "a.exr"], options].concat());
        (picture(&room, "a.exr").pixels, room.read("a.exr"))
    };
    let (plain, bytes) = of_options(&[]);
    assert_eq!(of_options(&["--aov=Z,N,albedo"]).1, bytes);
    let mut sizes = vec![bytes.len()];
    for list in ["all", "none", "direct,gathers"] {
        for card in ["emulated:2", "emulated-micro:2"] {
            let (same, other) = of_options(&["--aov", list, "--card", card]);
            assert!(same == plain, "{list}");
            sizes.push(other.len());
        }
    }
    // By their sizes, files have the requested channels and no others.
    let [default, all, again, none, _, some, _] = sizes[..] else { panic!("{sizes:?}") };
    assert!(all == again && all > default && none < some && none < default, "{sizes:?}");

    let outcome = room.render("scene.gltf", &["-o", "b.exr", "--aov=all", "--tile=33", "--card=emulated:1"]);
    assert_eq!(outcome.status, Some(2));
    assert!(outcome.stderr.contains("32 or less") && outcome.stderr.contains("--aov"), "{}", outcome.stderr);
    let outcome = room.render("scene.gltf", &["-o", "b.exr", "--aov=depth"]);
    assert_eq!(outcome.status, Some(2));
    assert!(outcome.stderr.contains("direct,indirect,caustic,albedo,N,Z,gathers"), "{}", outcome.stderr);
}

#[test]
fn a_render_writes_pictures_and_statistics() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    // With one card the sums are exact. With several, bytes may still be under way to one of them at the end.
    let files = ["-o", "a.exr", "-o", "a.png", "--stats", "a.json", "--card", "emulated:1"];
    let outcome = room.rendered(&cornell, &files);
    assert_eq!(room.names(), ["a.exr", "a.json", "a.png"]);
    assert!(room.read("a.png").starts_with(b"\x89PNG\r\n\x1a\n"));
    assert!(outcome.stderr.lines().all(|line| line.starts_with("photoncard: ")), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("tiles"), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains(['\r', '\x1b']), "{:?}", outcome.stderr);

    let statistics: Value = serde_json::from_slice(&room.read("a.json")).unwrap();
    for key in ["scene", "photons", "pack", "load", "render", "total"] {
        assert!(statistics["time_s"][key].as_f64().is_some_and(|seconds| seconds >= 0.0), "{key}");
    }
    assert_eq!(statistics["rays"]["eye"], 2 * 64);
    for pointer in ["/rays/shadow", "/rays/gather", "/gathers", "/image_bytes"] {
        assert!(statistics.pointer(pointer).and_then(Value::as_u64).is_some_and(|n| n > 0), "{pointer}");
    }
    let link = |key: &str| statistics["link"][key].as_u64().unwrap();
    assert!(link("wire_bytes") > link("payload_bytes") && link("payload_bytes") > 0);
    assert_eq!(link("retransmitted_frames"), 0);

    let outcome = room.run(&["diff", "a.exr", "a.exr"]);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let difference: Value = serde_json::from_str(&outcome.stdout).unwrap();
    for pointer in ["/pixels/mse", "/pixels/rmse", "/pixels/relmse", "/blocks/mse"] {
        assert_eq!(difference.pointer(pointer), Some(&json!(0.0)), "{pointer}");
    }
}

/// The first line describes the scene, the last the picture's files; between them are remaining times.
#[test]
fn a_render_reports_what_it_loads_and_what_it_writes() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let options = ["-o", "a.png", "-o", "./a.exr", "--spp", "3", "--crop", "0,8,0,5", "--tile", "1"];
    let said = room.rendered("scene.gltf", &options).stderr;
    let lines: Vec<_> = said.lines().collect();
    assert_eq!(
        lines[0],
        "photoncard: scene.gltf: 3 triangles, 2 materials, 0 images, light of 1 emissive triangle; seen by 'eye', 8 x 8 pixels"
    );
    let last = lines[lines.len() - 1];
    assert!(last.starts_with("photoncard: a.png, ./a.exr: done in "), "{last}");
    assert!(last.contains("; 3 samples a pixel, 120 in all"), "{last}");
    let tiles: Vec<_> = lines.iter().filter(|line| line.starts_with("photoncard: tiles ")).collect();
    assert!(tiles.len() > 1 && tiles.iter().all(|line| line.ends_with(" left")), "{said}");
    assert!(
        tiles[tiles.len() - 1].contains("40 of 40") && tiles[tiles.len() - 1].ends_with(", 0 s left"),
        "{said}"
    );
}

/// Only the statistics are on standard output.
#[test]
fn statistics_go_to_standard_output_by_a_dash() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for more in [&[][..], &["--quiet", "--counters"]] {
        let outcome = room.render("scene.gltf", &[&["-o", "a.exr", "--stats", "-"], more].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        let statistics: Value = serde_json::from_str(&outcome.stdout).unwrap();
        assert_eq!(statistics["width"], 8);
        assert_eq!(outcome.stderr.is_empty(), !more.is_empty(), "{}", outcome.stderr);
    }
    room.rendered("scene.gltf", &["-o", "a.exr", "--stats", "./-"]);
    assert_eq!(room.names(), ["-", "a.exr", "scene.gltf"]);
}

#[test]
fn quiet_is_silent() {
    let room = Room::new();
    let outcome = room.rendered(&shipped("cornell-glossy.gltf"), &["-o", "a.exr", "--quiet"]);
    assert_eq!(outcome.stderr, "");
}

#[test]
fn pictures_do_not_depend_on_how_they_are_rendered() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    room.rendered(&cornell, &["-o", "first.exr", "--size", "20x20"]);
    for options in [
        &[][..],
        &["--order", "naive"],
        &["--order", "tiled"],
        &["--card", "emulated:1"],
        &["--card", "emulated:2", "--threads", "1"],
        &["--card", "emulated:3", "--threads", "2"],
        &["--card", "emulated:1", "--card", "emulated-micro:2"],
        &["--tile", "1"],
        &["--tile", "7", "--order", "naive"],
        &["--tile", "32"],
    ] {
        room.rendered(&cornell, &[&["-o", "other.exr", "--size", "20x20", "--quiet"], options].concat());
        assert!(room.read("other.exr") == room.read("first.exr"), "{options:?}");
    }
    room.rendered(&cornell, &["-o", "other.exr", "--size", "20x20", "--seed", "1"]);
    assert!(room.read("other.exr") != room.read("first.exr"));
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    room.rendered(&cornell, &["-o", "whole.exr", "--size", "20x16"]);
    room.rendered(&cornell, &["-o", "part.exr", "--size", "20x16", "--crop", "3,17,5,16"]);
    let (whole, part) = (picture(&room, "whole.exr"), picture(&room, "part.exr"));
    assert_eq!((part.width, part.height, part.data_window_origin), (14, 11, [3, 5]));
    for (row, pixels) in part.pixels.chunks(14).enumerate() {
        let first = (row + 5) * whole.width + 3;
        assert_eq!(pixels, &whole.pixels[first..first + 14], "row {row}");
    }
}

#[test]
fn a_setting_of_a_material_changes_the_picture() {
    let room = Room::new();
    let glossy = shipped("cornell-glossy.gltf");
    // The floor's exponent changes the light that final gather rays bring to the lobe.
    let common = ["--size", "16x16", "--gather-rays", "16", "--quiet"];
    room.rendered(&glossy, &[&common[..], &["-o", "a.exr"]].concat());
    room.rendered(&glossy, &[&common[..], &["-o", "b.exr", "--set", "floor.exponent=2"]].concat());
    assert_ne!(picture(&room, "a.exr").pixels, picture(&room, "b.exr").pixels);
}

#[test]
fn an_environment_lights_the_picture() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let pixels = |options: &[&str]| {
        room.rendered("scene.gltf", &[&["-o", "a.exr"], options].concat());
        picture(&room, "a.exr").pixels
    };
    let plain = pixels(&[]);
    assert!(plain == pixels(&["--environment", "0,0,0"]));
    assert!(plain != pixels(&["--environment", "1, 2, 3"]));
    // The environment map is a picture of the scene.
    room.rendered("scene.gltf", &["-o", "map.exr"]);
    assert!(plain != pixels(&["--environment", "map.exr"]));
}

#[test]
fn triangles_of_no_area_are_counted_and_left_out() {
    let room = Room::new();
    let mut bytes = scene_bytes();
    // An index of the floor's second triangle is repeated, so that the triangle has no area.
    bytes[92..94].copy_from_slice(&0u16.to_le_bytes());
    room.write_scene("scene.gltf", &scene_of(&bytes));
    let outcome = room.rendered("scene.gltf", &["-o", "a.exr"]);
    let told = outcome.stderr.lines().filter(|line| line.contains("zero area")).collect::<Vec<_>>();
    let [told] = told[..] else { panic!("{told:?}") };
    assert!(
        told.starts_with("photoncard: scene.gltf: 2 triangles (and 1 of zero area, left out), "),
        "{told}"
    );
    let information = room.run(&["scene", "info", "scene.gltf"]).stdout;
    assert!(
        information.contains("  triangles   2, 1 of them emissive\n  left out    1 of zero area\n"),
        "{information}"
    );
}

#[test]
fn ignored_contents_are_reported_once() {
    let room = Room::new();
    let mut scene = scene();
    // Occlusion textures are ignored: the missing image file is not read.
    scene["images"] = json!([{"uri": "absent.png"}]);
    scene["textures"] = json!([{"source": 0}]);
    scene["materials"][0]["occlusionTexture"] = json!({"index": 0});
    scene["extensionsUsed"] = json!(["KHR_materials_specular", "KHR_lights_punctual", "EXT_unheard_of"]);
    scene["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "point", "name": "bulb", "range": 3.0}]}});
    room.write_scene("scene.gltf", &scene);
    let outcome = room.rendered("scene.gltf", &["-o", "a.exr"]);
    let information = room.run(&["scene", "info", "scene.gltf"]).stdout;
    for sentence in ["occlusion textures", "range of lights", "EXT_unheard_of is ignored"] {
        let lines: Vec<_> = outcome.stderr.lines().filter(|line| line.contains(sentence)).collect();
        assert!(
            lines.len() == 1 && lines[0].starts_with("photoncard: ignored or missing: "),
            "{}",
            outcome.stderr
        );
        assert_eq!(outcome.stderr.matches(sentence).count(), 1, "{sentence}: {}", outcome.stderr);
        assert_eq!(information.matches(sentence).count(), 1, "{sentence}: {information}");
    }
}

#[test]
fn the_camera_gives_the_picture_its_aspect_ratio() {
    let room = Room::new();
    let mut scene = scene();
    scene["cameras"][0]["perspective"]["aspectRatio"] = json!(64.0);
    room.write_scene("scene.gltf", &scene);
    let without_size: Vec<_> = small_render("scene.gltf", &["-o", "a.exr"]);
    let place = without_size.iter().position(|argument| *argument == "--size").expect("a small size");
    let arguments = [&without_size[..place], &without_size[place + 2..]].concat();
    let outcome = room.run(&arguments);
    assert_eq!((outcome.status, outcome.stderr.contains("aspect")), (Some(0), false), "{}", outcome.stderr);
    let found = picture(&room, "a.exr");
    assert_eq!((found.width, found.height), (512, 8));

    // A stated size of another aspect ratio keeps the vertical field of view.
    let said = room.rendered("scene.gltf", &["-o", "a.exr", "--size", "128x8"]).stderr;
    assert!(said.contains("'eye' has an aspect ratio of 64") && said.contains("--size 128x2 "), "{said}");
    let narrow = picture(&room, "a.exr");
    assert_eq!((narrow.width, narrow.height), (128, 8));
    assert!(!room.rendered("scene.gltf", &["-o", "a.exr", "--size", "128x2"]).stderr.contains("aspect"));
}

/// `--camera-at`, `--look-at` and `--fov` give the picture of a camera in the file with these values.
#[test]
fn a_view_by_options_equals_that_of_a_camera_there() {
    let room = Room::new();
    let mut stated = scene();
    stated["nodes"][1]["translation"] = json!([0.25, 0.75, 2.5]);
    stated["cameras"][0]["perspective"]["yfov"] = json!(45_f32.to_radians());
    room.write_scene("stated.gltf", &stated);
    room.write_scene("other.gltf", &scene());
    stated["scenes"][0]["nodes"] = json!([0]);
    room.write_scene("without.gltf", &stated);
    let pixels = |name: &str, options: &[&str]| {
        room.rendered(name, &[&["-o", "a.exr"], options].concat());
        picture(&room, "a.exr").pixels
    };
    let expected = pixels("stated.gltf", &[]);
    let place = ["--camera-at", "0.25,0.75,2.5"];
    let view = [&place[..], &["--look-at", "0.25,0.75,-7", "--fov", "45"]].concat();
    for name in ["other.gltf", "without.gltf"] {
        assert!(pixels(name, &view) == expected, "{name}");
    }
    assert!(pixels("without.gltf", &[]) != expected);
    // Options that are not stated leave the values of the file's camera.
    assert!(pixels("other.gltf", &[&place[..], &["--fov=45"]].concat()) == expected);
    assert!(pixels("other.gltf", &place) != expected);
    // A camera that is turned by a quarter about its axis.
    stated["nodes"][1]["rotation"] = json!([0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()]);
    stated["scenes"][0]["nodes"] = json!([0, 1]);
    room.write_scene("turned.gltf", &stated);
    let turned = pixels("turned.gltf", &["--up", "-1,0,0"]);
    assert!(pixels("other.gltf", &[&view[..], &["--up=-2,0,0"]].concat()) == turned);
    assert!(turned != expected);
}

/// Options and the camera in the file state equal projections.
#[test]
fn projections_by_options_equal_those_of_the_file() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let camera = |changes: Value| {
        let mut stated = scene();
        changes
            .as_object()
            .unwrap()
            .iter()
            .for_each(|(key, value)| stated["cameras"][0][key] = value.clone());
        room.write_scene("stated.gltf", &stated);
        room.rendered("stated.gltf", &["-o", "a.exr", "--size", "24x16"]);
        picture(&room, "a.exr").pixels
    };
    let extras = |value: Value| json!({"extras": {"photoncard": value}});
    let parallel = json!({"xmag": 3, "ymag": 1, "znear": 0.1, "zfar": 9});
    let mut seen = Vec::new();
    for (changes, options) in [
        (json!({}), &[][..]),
        (json!({"type": "orthographic", "orthographic": parallel}), &["--orthographic", "2"]),
        (extras(json!({"panorama": [180, 90]})), &["--panorama", "180,90"]),
        (extras(json!({"shift": [0.1, -0.2]})), &["--shift", "0.1,-0.2"]),
        (extras(json!({"aperture": 0.25, "focus": 2})), &["--aperture", "0.25", "--focus", "2"]),
        (extras(json!({"aperture": 0.25, "focus": 2.5})), &["--aperture", "0.25", "--look-at", "0,0.5,0.5"]),
    ] {
        let expected = camera(changes);
        room.rendered("scene.gltf", &[&["-o", "b.exr", "--size", "24x16"], options].concat());
        assert!(picture(&room, "b.exr").pixels == expected, "{options:?}");
        assert!(!seen.contains(&expected), "{options:?} changes nothing");
        seen.push(expected);
    }
}

/// The chip is that of `docs/chip.toml`.
#[test]
fn chips_of_a_file_render_the_picture_of_the_reference_chip() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let chip = concat!("emulated:", env!("CARGO_MANIFEST_DIR"), "/../docs/chip.toml");
    for options in [&["--tile", "8"][..], &["--irradiance-cache", "on", "--sampling", "combined"]] {
        let options = [options, &["--size", "16x16"]].concat();
        room.rendered(&cornell, &[&["-o", "a.exr"], &options[..]].concat());
        room.rendered(&cornell, &[&["-o", "b.exr", "--card", chip], &options[..]].concat());
        assert!(room.read("a.exr") == room.read("b.exr"), "{options:?}");
    }
    let info = room.run(&["card", "info", "--card", chip]);
    assert_eq!(info.status, Some(0), "{}", info.stderr);
    for line in
        ["sram            524288 bytes", "gather queue    4096 gathers", "dram            67108864 bytes"]
    {
        assert!(info.stdout.contains(line), "{line}: {}", info.stdout);
    }
}
