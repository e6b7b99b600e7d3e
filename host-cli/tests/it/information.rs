//! Commands that print information, also to closed streams.

use std::f64::consts::PI;
use std::process::Stdio;

use crate::support::{Room, scene, shipped, small_render};
use serde_json::{Value, json};

#[test]
fn scene_info_prints_the_contents_of_a_scene() {
    let outcome = Room::new().run(&["scene", "info", &shipped("cornell-glossy.gltf")]);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    for word in [
        "cornell-glossy.gltf\n  triangles ",
        "\n  left out    0 of zero area\n",
        "\n  size ",
        "\n\nCameras (",
        "\n\nMaterials (",
        "\n  floor: ",
        "exponent",
    ] {
        assert!(outcome.stdout.contains(word), "{word}: {}", outcome.stdout);
    }
    assert!(outcome.stdout.ends_with('\n'));
}

/// glTF features that renders use are printed with their values; other features are named as ignored.
#[test]
fn scene_info_prints_textures_lights_and_ignored_features() {
    let outcome = Room::new().run(&[
        "scene",
        "info",
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/painted.gltf"),
    ]);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    for line in [
        "  attributes  1 triangles: 0 with smooth normals, 0 with colours",
        "  textures    1 of 1 images, 1 texels, 4 bytes",
        "  paint: 1 x 1, sRGB",
        "  bulb: point at [0, 0, 2], [8, 8, 8] W/sr",
        "  painted: base colour [1, 1, 1], metallic 0, roughness 0.5, dielectric [0.04, 0.04, 0.04], base \
         texture paint (set 0, clamped across and repeated down)",
        "  the range of lights is ignored, their light reaches everywhere: light 'bulb'",
    ] {
        assert!(outcome.stdout.lines().any(|found| found == line), "{line}: {}", outcome.stdout);
    }
}

/// A point light of 60 W in Blender has 60 / (4 pi) W/sr, unless `--light-units` states another unit of the
/// file.
#[test]
fn scene_info_prints_lights_in_the_units_of_their_exporter() {
    let lights = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/fixtures/blender/lights.glb");
    for (options, intensity, is_divided) in [
        (&[][..], 60.0 / (4.0 * PI), true),
        (&["--light-units", "photometric"], 60.0 / (4.0 * PI), false),
        (&["--light-units", "radiometric"], 60.0 * 683.0 / (4.0 * PI), false),
    ] {
        let report = Room::new().run(&[&["scene", "info", lights], options].concat()).stdout;
        assert!(report.contains("  written by  Khronos glTF Blender I/O v5.0.21\n"), "{report}");
        assert_eq!(report.contains("683 lm/W"), is_divided, "{report}");
        let json = Room::new().run(&[&["scene", "info", "--json", lights], options].concat()).stdout;
        let value: Value = serde_json::from_str(&json).unwrap();
        let found = value["lights"][0]["intensity"][0].as_f64().unwrap();
        assert!((found / intensity - 1.0).abs() < 1e-6, "{found} is not {intensity}");
        assert_eq!(value["generator"], "Khronos glTF Blender I/O v5.0.21");
    }
}

/// JSON has the contents of the report.
#[test]
fn scene_info_is_json_for_programs() {
    let room = Room::new();
    let painted = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/painted.gltf");
    let outcome = room.run(&["scene", "info", "--json", painted]);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let value: Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!(value["triangles"], 1);
    assert_eq!(value["images"], json!([{"name": "paint", "width": 1, "height": 1, "encoding": "srgb"}]));
    assert_eq!(value["lights"][0]["name"], "bulb");
    assert_eq!(value["lights"][0]["at"], json!([0.0, 0.0, 2.0]));
    assert_eq!(value["materials"][0]["reflection"]["roughness"], 0.5);
    assert!(value["ignored"].to_string().contains("the range of lights is ignored"), "{value}");
    room.write_scene("scene.gltf", &scene());
    let outcome = room.run(&["scene", "info", "--json", "scene.gltf"]);
    let value: Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!((&value["triangles"], &value["emissive_triangles"]), (&json!(3), &json!(1)));
    assert_eq!(value["cameras"][0]["name"], "eye");
    assert_eq!(value["bounds"], json!([[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]]));
}

/// Lists the ports of this machine, each with its address.
#[test]
fn card_list_gives_an_address_for_every_serial_port() {
    let outcome = Room::new().run(&["card", "list"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    if outcome.stdout.is_empty() {
        assert!(outcome.stderr.contains("no serial port"), "{}", outcome.stderr);
        return;
    }
    assert_eq!(outcome.stderr, "");
    let (head, ports) = outcome.stdout.split_once('\n').unwrap();
    assert_eq!(
        head.split_whitespace().collect::<Vec<_>>(),
        ["path", "USB", "name", "serial", "number", "--card"]
    );
    let paths: Vec<_> = ports.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert!(!paths.is_empty() && paths.is_sorted(), "{ports}");
    for (path, line) in paths.iter().zip(ports.lines()) {
        assert!(line.ends_with(&format!(" serial:{path}@115200")), "{line}");
    }
}

#[test]
fn card_info_prints_the_budget_of_a_card() {
    for (card, dram) in [
        ("emulated", 536_870_912),
        ("emulated-large", 536_870_912),
        ("emulated-micro:2", 16_777_216),
        ("emulated-nano", 1_048_576),
    ] {
        let outcome = Room::new().run(&["card", "info", "--card", card]);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
        for word in [
            "photoncard-firmware",
            "sram",
            "reordering",
            "cache ",
            "sampling",
            "free",
            "neighbors",
            &format!("dram            {dram} bytes"),
        ] {
            assert!(outcome.stdout.contains(word), "{word}: {}", outcome.stdout);
        }
    }
}

#[test]
fn card_selftest_prints_what_was_tested() {
    let outcome = Room::new().run(&["card", "selftest", "--quiet", "--card", "emulated-micro:2"]);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let lines: Vec<_> = outcome.stdout.lines().collect();
    assert!(
        lines[0].starts_with("arithmetic      0 of ") && lines[0].contains(" results wrong"),
        "{lines:?}"
    );
    assert_eq!(lines[1], "memory          16777216 bytes: 131072 lines");
    let patterns = ["walking one", "walking zero", "address", "complement", "byte lanes"];
    assert_eq!(lines.len(), 2 + patterns.len());
    for (pattern, line) in patterns.iter().zip(&lines[2..]) {
        assert!(line.trim_start().starts_with(pattern) && line.ends_with(": 0 wrong words"), "{line}");
        assert!(line.contains(" MB/s), read in "), "{line}");
    }
    let outcome = Room::new().run(&["card", "selftest", "--card", "emulated-micro"]);
    assert_eq!(outcome.status, Some(0));
    assert!(outcome.stderr.contains("photoncard: memory 167772160 of 167772160, "), "{}", outcome.stderr);
}

#[test]
fn incomplete_and_unknown_commands_get_the_usage() {
    for command in [&[][..], &["render"], &["paint"]] {
        let outcome = Room::new().run(command);
        assert_eq!(outcome.status, Some(2), "{command:?}");
        assert!(outcome.stderr.contains("Usage: photoncard"), "{command:?}");
    }
}

/// Pipe whose reading end is closed.
fn closed_pipe() -> Stdio {
    let (_, writer) = std::io::pipe().unwrap();
    writer.into()
}

#[test]
fn a_reader_that_closes_early_is_no_failure() {
    let room = Room::new();
    let output = room.command().args(["card", "info"]).stdout(closed_pipe()).output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &[][..]));
    room.write_scene("scene.gltf", &scene());
    let render = small_render("scene.gltf", &["-o", "a.exr"]);
    let status = room.command().args(render).stderr(closed_pipe()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(room.names(), ["a.exr", "scene.gltf"]);
    let status = room.command().args(["scene", "info", "absent"]).stderr(closed_pipe()).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_reported() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = Room::new().command().args(["card", "info"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("cannot write to standard output") && message.contains("help:"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn names_need_not_be_text() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let room = Room::new();
    let names = [b"scene\xff.gltf".as_slice(), b"picture\xff.exr"].map(OsStr::from_bytes);
    room.write_scene("scene.gltf", &scene());
    std::fs::rename(room.path("scene.gltf"), room.path("").join(names[0])).unwrap();
    let mut command = room.command();
    command.args(small_render("", &["--quiet"]).into_iter().filter(|argument| !argument.is_empty()));
    let output = command.arg(names[0]).arg("-o").arg(names[1]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(room.path("").join(names[1]).exists());
}
