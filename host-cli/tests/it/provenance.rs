//! Provenance: in a picture, it has every setting that pixels depend on; in the statistics, also the settings
//! that the work depends on.

use std::collections::BTreeSet;

use crate::support::{Room, mirrored_cornell, scene};
use serde_json::{Value, json};

/// Options that pixels depend on: each with a value other than the default, its key in the provenance, and
/// its value there.
fn options_of_pixels() -> Vec<(&'static [&'static str], &'static str, Value)> {
    vec![
        (&["--size", "9x7"], "size", json!([9, 7])),
        (&["--crop", "1,5,2,6"], "crop", json!([1, 5, 2, 6])),
        (&["--camera", "camera"], "camera", json!("camera")),
        (&["--camera-at", "0,1.25, 2"], "camera-at", json!([0.0, 1.25, 2.0])),
        (&["--look-at", "-0.5,0.5,0"], "look-at", json!([-0.5, 0.5, 0.0])),
        (&["--up", "0.5,1,0", "--look-at", "0,0.5,0"], "up", json!([0.5, 1.0, 0.0])),
        (&["--fov", "12.5"], "fov", json!(12.5)),
        (&["--orthographic", "2.5"], "orthographic", json!(2.5)),
        (&["--panorama", "180"], "panorama", json!([180.0, 180.0])),
        (&["--shift", "0.25,-0.5"], "shift", json!([0.25, -0.5])),
        (&["--aperture", "f/2", "--focus", "3"], "aperture", json!("f/2")),
        (&["--focus", "1.5", "--aperture", "0.25"], "focus", json!(1.5)),
        (&["--quality", "draft"], "spp", json!(8)),
        (&["--filter", "gaussian"], "filter", json!("gaussian")),
        (&["--aov", "direct,Z"], "aov", json!("direct,Z")),
        (&["--transparent"], "transparent", json!(true)),
        (&["--irradiance"], "irradiance", json!(true)),
        (&["--lumens-per-watt", "179", "--aov", "illuminance"], "lumens-per-watt", json!(179.0)),
        (&["--set", "white.diffuse=0.5,0.5,0.5"], "set", json!(["white.diffuse=0.5,0.5,0.5"])),
        (&["--light-groups", "key=light"], "light-groups", json!(["key=light"])),
        (&["--texture-limit", "64"], "texture-limit", json!(64)),
        (&["--light-units", "watts"], "light-units", json!("watts")),
        (&["--energy-compensation"], "energy-compensation", json!(true)),
        (&["--environment", "1,2,3"], "environment", json!("1,2,3")),
        (&["--environment-rotation", "-9.5", "--environment", "1,2,3"], "environment-rotation", json!(-9.5)),
        (&["--sky", MORNING], "sky", json!(MORNING)),
        (&["--north", "-30", "--sky", MORNING], "north", json!(-30.0)),
        (&["--seed", "5"], "seed", json!(5)),
        (&["--photons", "300"], "photons", json!(300)),
        (&["--photons-for", "camera"], "photons-for", json!("camera")),
        (&["--neighbors", "6"], "neighbors", json!(6)),
        (&["--caustic-photons", "90"], "caustic-photons", json!(90)),
        (&["--caustic-neighbors", "9"], "caustic-neighbors", json!(9)),
        (&["--max-distance", "0.5"], "max-distance", json!(0.5)),
        (&["--near-distance", "0.25"], "near-distance", json!(0.25_f32)),
        (&["--radiance", "precomputed"], "radiance", json!("precomputed")),
        (&["--gather-rays", "5"], "gather-rays", json!(5)),
        (&["--shadow-rays", "2"], "shadow-rays", json!(2)),
        (&["--spp", "2"], "spp", json!(2)),
        (&["--sampling", "mixture"], "sampling", json!("mixture")),
        (&["--irradiance-cache", "on"], "ic-error", json!(0.025_f32)),
        (&["--ic-error", "0.5", "--irradiance-cache", "on"], "ic-error", json!(0.5)),
        (&["--adaptive", "0.5"], "adaptive", json!(0.5)),
    ]
}

/// A sky of the southern hemisphere.
const MORNING: &str = "-33.9,18.4,2026-06-21T10:30+02:00";

/// Card with a chip of a file.
const CHIP: &str = concat!("emulated:", env!("CARGO_MANIFEST_DIR"), "/../docs/chip.toml:2");

/// Options that no pixel depends on.
const OTHERS: [&[&str]; 25] = [
    &["--strict"],
    &["--photon-map", "jensen"],
    &["--tile", "3"],
    &["--order", "naive"],
    &["--bins", "5"],
    &["--queue", "7"],
    &["--in-flight", "1"],
    &["--card", "emulated-micro:2"],
    &["--card", CHIP],
    &["--card-memory", "1G"],
    &["--verify", "0.5", "--card", "emulated:2"],
    &["--faults", "flips=1e-6"],
    &["--resume"],
    &["--keep-samples"],
    // Planned samples change no pixel if the irradiance cache is off, as in this render.
    &["--planned-spp", "7"],
    &["--counters"],
    &["--cache", "unified=8K/128/2"],
    &["--trace", "a.din.gz", "--card", "emulated:1"],
    &["--trace-format", "ramulator", "--trace", "a.gz", "--card", "emulated:1"],
    &["--trace-labels", "--trace", "a.din.gz", "--card", "emulated:1"],
    &["--threads", "2"],
    &["--exposure", "1", "-o", "a.png"],
    &["--tonemap", "aces", "-o", "a.png"],
    &["--display-server", "127.0.0.1:1"],
    &["--stats", "a.json"],
];

/// Options of the file's storage, of denoising and of messages: no rendered pixel depends on them.
const OF_THE_FILE: [&str; 6] = ["--output", "--sample-type", "--denoise", "--quiet", "--progress", "--help"];

/// Option that pixels depend on, for scenes with variants. No shipped scene has variants.
const OF_SCENES_WITH_VARIANTS: &str = "--variant";

/// Options of frames, which another test checks.
const OF_FRAMES: [&str; 3] = ["--frames", "--animation", "--fps"];

/// Options of prepared scenes and parts, which other tests check.
const OF_FARMS: [&str; 2] = ["--part", "--prepared"];

/// Options that end a render at a time or noise, and thus determine the number of samples.
const OF_SAMPLES: [&str; 2] = ["--noise", "--time"];

/// Provenance in an EXR file: the text of its attribute `photoncard`.
fn provenance(file: &[u8]) -> Value {
    let head = b"photoncard\0string\0";
    let start = file.windows(head.len()).position(|bytes| bytes == head).expect("the attribute") + head.len();
    let (length, text) = file[start..].split_first_chunk().expect("a length");
    serde_json::from_slice(&text[..u32::from_le_bytes(*length) as usize]).expect("JSON")
}

/// Provenance of a rendered scene with a mirror.
fn rendered(room: &Room, options: &[&str]) -> Value {
    let small = if options.contains(&"--caustic-photons") { &[][..] } else { &["--caustic-photons", "99"] };
    // A render without `--resume` does not overwrite the samples that an earlier one has kept.
    let _ = std::fs::remove_file(room.path("a.exr.partial"));
    room.rendered("mirrored.gltf", &[&["-o", "a.exr"], small, options].concat());
    provenance(&room.read("a.exr"))
}

#[test]
fn the_provenance_has_exactly_the_options_that_pixels_depend_on() {
    let room = Room::new();
    room.write_scene("mirrored.gltf", &mirrored_cornell());
    let plain = rendered(&room, &[]);
    assert_eq!((&plain["scene"], &plain["aov"]), (&json!("mirrored.gltf"), &json!("albedo,N,Z")));
    let mut keys = BTreeSet::from(["program", "layout", "scene", "scene-checksum", "variant", "view"]);
    for (options, key, value) in options_of_pixels() {
        let found = rendered(&room, options);
        assert_eq!(found[key], value, "{options:?}");
        assert_ne!(plain[key], value, "{options:?}");
        keys.insert(key);
    }
    // A picture with a background has no entry for it, nor one without light groups, irradiance or sky for
    // them.
    for absent in ["transparent", "light-groups", "irradiance", "lumens-per-watt", "sky", "north"] {
        keys.remove(absent);
    }
    let found: BTreeSet<_> = plain.as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(found, keys);
    for options in OTHERS {
        assert_eq!(rendered(&room, options), plain, "{options:?}");
    }
}

/// JSON of the text chunk `keyword` in a PNG file; `None` without this chunk.
fn text_of_png(file: &[u8], keyword: &str) -> Option<Value> {
    let reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
    let chunk = reader.info().uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == keyword);
    chunk.map(|chunk| serde_json::from_str(&chunk.text).expect("JSON"))
}

fn statistics(room: &Room) -> Value {
    serde_json::from_slice(&room.read("a.json")).expect("JSON")
}

#[test]
fn all_pictures_and_the_statistics_of_a_render_have_one_provenance() {
    let room = Room::new();
    let mut scene = scene();
    scene["materials"][0]["name"] = json!("Größe \u{202e}");
    room.write_scene("scene.gltf", &scene);
    let set = ["--set", "Größe \u{202e}.diffuse=0.25", "--camera-at", "0,0.5,2"];
    room.rendered("scene.gltf", &[&["-o", "a.exr", "-o", "a.png", "--stats", "a.json"][..], &set].concat());
    let of_pixels = &statistics(&room)["provenance"]["pixels"];
    assert_eq!(of_pixels["set"], json!(["Größe \u{202e}.diffuse=0.25"]));
    assert_eq!(of_pixels["view"]["camera"], "eye");
    assert_eq!(of_pixels["view"]["at"], json!([0.0, 0.5, 2.0]));
    assert_eq!(provenance(&room.read("a.exr")), *of_pixels);
    assert_eq!(text_of_png(&room.read("a.png"), "photoncard").as_ref(), Some(of_pixels));
    let mapping = json!({"exposure": null, "tonemap": "reinhard"});
    assert_eq!(text_of_png(&room.read("a.png"), "photoncard-tonemap"), Some(mapping));
    let outcome = room.run(&["tonemap", "a.exr", "-o", "b.png", "--exposure=-1", "--tonemap=aces"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert_eq!(text_of_png(&room.read("b.png"), "photoncard").as_ref(), Some(of_pixels));
    let mapping = json!({"exposure": -1.0, "tonemap": "aces"});
    assert_eq!(text_of_png(&room.read("b.png"), "photoncard-tonemap"), Some(mapping));
}

#[test]
fn statistics_name_the_options_that_the_work_depends_on() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let work = |options: &[&str]| {
        room.rendered("scene.gltf", &[&["-o", "a.exr", "--stats", "a.json"], options].concat());
        statistics(&room)["provenance"]["work"].clone()
    };
    let plain = work(&["--card", "emulated:1"]);
    assert_eq!(plain["protocol"], photoncard_shared::message::PROTOCOL_VERSION);
    let cases: [(&[&str], &str, Value); 14] = [
        (&["--photon-map", "jensen"], "photon-map", json!("jensen")),
        (&["--tile", "3"], "tile", json!(3)),
        (&["--order", "naive"], "order", json!("naive")),
        (&["--bins", "5", "--order", "dirbin"], "bins", json!(5)),
        (&["--queue", "7"], "queue", json!(7)),
        (&["--in-flight", "1"], "in-flight", json!(1)),
        (&["--card", "emulated-micro:2"], "card", json!(["emulated-micro:2"])),
        (
            &["--card", "emulated-micro:2", "--card", "emulated:1"],
            "chips",
            json!({"micro": 2, "reference": 1}),
        ),
        (&["--verify", "0.5", "--card", "emulated:2"], "verify", json!(0.5)),
        (
            &["--faults", "flips=1e-9,seed=3"],
            "faults",
            json!("flips=0.000000001,drops=0,repeats=0,delays=0,seed=3"),
        ),
        (
            &["--counters"],
            "cache",
            json!("photon=128K/128/4,scene=75K/128/4,casting=504K/128/4,gathering=835072/128/4"),
        ),
        (&["--cache", "unified=8K/128/2"], "cache", json!("unified=8K/128/2")),
        (&["--quality", "draft"], "quality", json!("draft")),
        (&["--threads", "2"], "threads", json!(2)),
    ];
    for (options, key, value) in cases {
        assert_ne!(plain[key], value, "{options:?}");
        assert_eq!(work(options)[key], value, "{options:?}");
    }
}

#[test]
fn scenes_of_one_name_that_differ_have_another_provenance() {
    let room = Room::new();
    let [dark, light] = [0.2, 0.9].map(|red| {
        let mut scene = scene();
        scene["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([red, 0.5, 0.5, 1.0]);
        room.write_scene("scene.gltf", &scene);
        room.rendered("scene.gltf", &["-o", "a.exr", "--max-distance", "0.5"]);
        provenance(&room.read("a.exr"))
    });
    assert_eq!(dark["scene"], light["scene"]);
    assert_ne!(dark, light);
}

#[test]
fn a_variant_is_in_the_provenance_and_changes_the_scene() {
    let room = Room::new();
    let mut scene = scene();
    scene["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    scene["materials"].as_array_mut().expect("a list").push(json!({"name": "dark"}));
    scene["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 2, "variants": [1]}]}});
    room.write_scene("scene.gltf", &scene);
    let of = |options: &[&str]| {
        room.rendered("scene.gltf", &[&["-o", "a.exr", "--max-distance", "0.5"], options].concat());
        provenance(&room.read("a.exr"))
    };
    let [stated, day, night] = [of(&[]), of(&["--variant", "day"]), of(&["--variant", "night"])];
    assert_eq!(
        [&stated, &day, &night].map(|of| of["variant"].clone()),
        [Value::Null, json!("day"), json!("night")]
    );
    assert_eq!(stated["scene-checksum"], day["scene-checksum"]);
    assert_ne!(stated["scene-checksum"], night["scene-checksum"]);
    let info = room.run(&["scene", "info", "scene.gltf"]).stdout;
    assert!(info.contains("Variants (2)\n  day\n  night\n"), "{info}");
}

/// Every option must be in one of the lists above.
#[test]
fn every_option_is_known_to_change_pixels_or_not_to() {
    let help = Room::new().run(&["render", "--help"]).stdout;
    let lines =
        help.lines().filter_map(|line| line.trim_start().strip_prefix("-").map(|_| line.trim_start()));
    let options = lines.filter_map(|line| line.split([' ', ',']).find(|word| word.starts_with("--")));
    let offered: BTreeSet<_> = options.collect();
    let of_pixels = options_of_pixels();
    let known = of_pixels.iter().map(|(options, ..)| options[0]).chain(OTHERS.map(|options| options[0]));
    let known: BTreeSet<_> = known
        .chain(OF_THE_FILE)
        .chain(OF_SAMPLES)
        .chain(OF_FRAMES)
        .chain(OF_FARMS)
        .chain([OF_SCENES_WITH_VARIANTS])
        .collect();
    assert_eq!(offered, known);
}
