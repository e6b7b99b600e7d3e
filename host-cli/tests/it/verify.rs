//! Verification: two cards render a tile, and their pixels are compared.

use crate::support::{Room, scene, shipped};
use serde_json::json;

const PICTURE: [&str; 9] = [
    "--quality=paper",
    "--size",
    "64x64",
    "--photons",
    "2000",
    "--gather-rays",
    "20",
    "--quiet",
    "--stats=a.json",
];

fn statistics(room: &Room) -> serde_json::Value {
    serde_json::from_slice(&room.read("a.json")).unwrap()
}

#[test]
fn verification_of_honest_cards_does_not_change_the_picture() {
    let cornell = shipped("cornell.gltf");
    let rendered = |options: &[&str]| {
        let room = Room::new();
        let outcome = room.run(&[&["render", &cornell, "-o", "a.exr"][..], &PICTURE, options].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        (room.read("a.exr"), statistics(&room))
    };
    let one_card = ["--card", "emulated:1", "--tile", "16"];
    let cards = ["--card", "emulated:1", "--card", "emulated-micro:1"];
    for technique in [&[][..], &["--irradiance-cache", "on"]] {
        let (expected, alone) = rendered(&[&one_card[..], technique].concat());
        for (share, verified) in [("1", 16..=16), ("0.000001", 1..=1)] {
            let (found, statistics) = rendered(&[&cards[..], technique, &["--verify", share]].concat());
            assert!(found == expected, "--verify {share} {technique:?}");
            let tiles = statistics["verified_tiles"].as_u64().unwrap();
            assert!(verified.contains(&tiles), "{tiles} tiles are verified");
            assert!(statistics["repeated_tiles"].as_u64().unwrap() >= tiles);
            assert_eq!(statistics["cards_given_up"], 0);
            if technique.is_empty() {
                assert_eq!(
                    [&statistics["rays"], &statistics["gathers"]],
                    [&alone["rays"], &alone["gathers"]]
                );
            }
        }
    }
}

#[test]
fn impossible_verification_is_refused_with_a_remedy() {
    let cornell = shipped("cornell.gltf");
    for (options, words) in [
        (&["--verify", "0.5", "--card", "emulated:1"][..], "a second card"),
        (&["--verify", "0", "--card", "emulated:2"], "above 0 and at most 1"),
        (&["--verify", "nan", "--card", "emulated:2"], "above 0 and at most 1"),
        (&["--verify", "1", "--card", "emulated:2", "--counters"], "leave out --counters or --cache"),
    ] {
        let room = Room::new();
        let outcome = room.run(&[&["render", &cornell, "-o", "a.exr"][..], &PICTURE, options].concat());
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("--verify") && outcome.stderr.contains(words), "{}", outcome.stderr);
        assert!(room.names().is_empty());
    }
}

/// A point light is a hundredth of a millimetre above the floor.
#[test]
fn dazzling_light_of_a_single_card_is_reported() {
    let room = Room::new();
    let mut dazzling = scene();
    let lights = json!({"lights": [{"type": "point", "intensity": 1}]});
    dazzling["extensions"] = json!({"KHR_lights_punctual": lights});
    dazzling["extensionsUsed"] = json!(["KHR_materials_specular", "KHR_lights_punctual"]);
    let lamp = json!({"translation": [0.0, 1e-5, 0.0], "extensions": {"KHR_lights_punctual": {"light": 0}}});
    dazzling["nodes"].as_array_mut().unwrap().push(lamp);
    dazzling["scenes"][0]["nodes"] = json!([0, 1, 2]);
    room.write_scene("scene.gltf", &dazzling);
    let view = ["--camera-at", "0,0.001,0.001", "--look-at", "0,0,0", "--fov", "20", "--stats", "a.json"];
    for (cards, is_told) in [("emulated:1", true), ("emulated:2", false)] {
        let options = [&["-o", "a.exr", "--quiet", "--card", cards][..], &view].concat();
        let said = room.rendered("scene.gltf", &options).stderr;
        assert_eq!(
            said.contains("card 0 with light far beyond") && said.contains("--card"),
            is_told,
            "{said}"
        );
        assert_eq!(statistics(&room)["dazzling_tiles"].as_u64().unwrap() > 0, is_told);
    }
    // Samples of a single card are kept; two cards add others.
    let kept = [&["-o", "k.exr", "--quiet", "--keep-samples"][..], &view].concat();
    room.rendered("scene.gltf", &[&kept[..], &["--spp", "2", "--card", "emulated:1"]].concat());
    let added = [&kept[..], &["--spp", "4", "--card", "emulated:2", "--resume"]].concat();
    let said = room.rendered("scene.gltf", &added).stderr;
    assert!(
        said.contains("an earlier render with light far beyond") && said.contains("without --resume"),
        "{said}"
    );
    // The file of a part does not name the cards that rendered it.
    for number in ["1", "2"] {
        let part = [&format!("--part={number}/2"), "-o", &format!("{number}.part"), "--quiet"];
        room.rendered("scene.gltf", &[&part[..], &view[..6]].concat());
    }
    let merged = room.run(&["merge", "1.part", "2.part", "-o", "b.exr"]);
    assert!(merged.status == Some(0) && merged.stderr.contains("far beyond"), "{}", merged.stderr);
}
