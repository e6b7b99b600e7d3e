//! Command `photoncard bake`.

use photoncard_driver::exr::{Shown, read};

use crate::support::{Outcome, Room, mirrored_cornell};

const QUICK: [&str; 13] = [
    "--photons",
    "3000",
    "--spp",
    "4",
    "--gather-rays",
    "8",
    "--shadow-rays",
    "4",
    "--texels-per-metre",
    "4",
    "--size",
    "64",
    "--quiet",
];

fn room() -> Room {
    let room = Room::new();
    room.write_scene("box.gltf", &mirrored_cornell());
    room
}

fn bake(room: &Room, options: &[&str]) -> Outcome {
    room.run(&[&["bake", "box.gltf"], &QUICK[..], options].concat())
}

#[track_caller]
fn baked(room: &Room, options: &[&str]) {
    let outcome = bake(room, options);
    assert_eq!((outcome.status, &*outcome.stderr), (Some(0), ""), "{options:?}");
}

#[test]
fn cards_orders_threads_and_parts_give_equal_files() {
    let room = room();
    baked(&room, &["-o", "one.glb", "--exr", "--rgbm"]);
    let pages = || ["one.glb", "one.0.exr", "one.0.png"].map(|name| room.read(name));
    let first = pages();
    assert!(first[1].len() > 1000 && first[2].starts_with(b"\x89PNG"));
    let others = ["--card", "emulated-micro:3", "--order", "hash", "--threads", "1"];
    baked(&room, &[&["-o", "one.glb", "--exr", "--rgbm"], &others[..]].concat());
    assert!(first == pages());
    baked(&room, &["-o", "plain.glb"]);
    for part in ["1/3", "2/3", "3/3"] {
        let path = format!("{}.part", &part[..1]);
        baked(&room, &["--part", part, "-o", &path, "--card", "emulated:2"]);
    }
    baked(&room, &["--merge", "3.part", "1.part", "2.part", "-o", "joined.glb"]);
    assert!(room.read("joined.glb") == room.read("plain.glb"));

    let missing = bake(&room, &["--merge", "3.part", "1.part", "-o", "missing.glb"]);
    assert_eq!(missing.status, Some(2));
    assert!(missing.stderr.contains("2/3"), "{}", missing.stderr);
    let foreign = bake(&room, &["--seed", "5", "--merge", "1.part", "2.part", "3.part", "-o", "missing.glb"]);
    assert!(foreign.stderr.contains("another bake"), "{}", foreign.stderr);
    assert!(!room.names().contains(&"missing.glb".to_owned()));
}

/// Irradiance of the texels of a page, in the first channel.
fn page(room: &Room, name: &str) -> Vec<f64> {
    let picture = read(&room.path(name), Shown::Rendered).unwrap();
    picture.pixels.iter().map(|pixel| f64::from(pixel[0])).collect()
}

#[test]
fn a_denoised_lightmap_has_less_noise_and_equal_light() {
    let room = room();
    if !crate::denoise::is_there(&room) {
        return;
    }
    let fine = ["--spp", "64", "--gather-rays", "64", "--shadow-rays", "16", "--photons", "100000"];
    for (name, options) in [("fine", &fine[..]), ("noisy", &[]), ("denoised", &["--denoise"])] {
        let path = format!("{name}.glb");
        let words = ["bake", "box.gltf", "--exr", "-o", &path];
        let quick: Vec<&str> =
            QUICK.chunks(2).filter(|pair| !options.contains(&pair[0])).flatten().copied().collect();
        let outcome = room.run(&[&words[..], &quick, options].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    }
    let [fine, noisy, denoised] =
        ["fine", "noisy", "denoised"].map(|name| page(&room, &format!("{name}.0.exr")));
    let lit = || (0..fine.len()).filter(|&index| fine[index] > 0.0);
    let error = |values: &[f64]| lit().map(|index| (values[index] - fine[index]).powi(2)).sum::<f64>().sqrt();
    let mean = |values: &[f64]| lit().map(|index| values[index]).sum::<f64>();
    assert!(error(&denoised) < 0.8 * error(&noisy), "{} of {}", error(&denoised), error(&noisy));
    let change = mean(&denoised) / mean(&noisy) - 1.0;
    assert!(change.abs() < 0.03, "the light changed by {change}");
    let part = bake(&room, &["--part", "1/2", "--denoise", "-o", "1.part"]);
    assert!(part.status == Some(2) && part.stderr.contains("--denoise"), "{}", part.stderr);
}

#[test]
fn a_baked_file_is_a_scene() {
    let room = room();
    for form in ["baked", "kept"] {
        baked(&room, &["-o", "out.glb", "--materials", form]);
        let info = room.run(&["scene", "info", "out.glb"]);
        assert_eq!(info.status, Some(0), "{}", info.stderr);
    }
}

#[test]
fn refusals_name_a_remedy() {
    let room = room();
    for (options, parts) in [
        (&["--object", "nowhere"][..], &["nowhere", "one of:"][..]),
        (&["--texels-per-metre", "0"], &["0 texels per metre", "above 0"]),
        (&["--texels-per-metre", "nan"], &["texels per metre", "above 0"]),
        (&["--texels-per-metre", "1e9"], &["texels along one side", "lower --texels-per-metre"]),
        (&["--size", "8192", "--texels-per-metre", "3000"], &["lower --texels-per-metre"]),
        (&["--size", "0"], &["pages of 0 texels", "--size"]),
        (&["--supersample", "9"], &["9 sensors", "1 to 4"]),
        (&["--texels-per-metre", "4", "--merge", "box.gltf"], &["box.gltf", "before --merge"]),
    ] {
        let words: Vec<&str> = [&["bake", "box.gltf", "--quiet", "-o", "out.glb"], options].concat();
        let outcome = room.run(&words);
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        let text = outcome.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(parts.iter().all(|part| text.contains(part)), "{options:?}: {text}");
    }
    let ending = bake(&room, &["-o", "out.gltf"]);
    assert!(ending.status == Some(2) && ending.stderr.contains("OUT.glb"), "{}", ending.stderr);
    assert_eq!(room.names(), ["box.gltf"]);
}
