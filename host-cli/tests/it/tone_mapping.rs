//! Tone-mapped PNGs: a render writes the same PNG as `photoncard tonemap` for the EXR of the render.

use std::path::Path;

use crate::support::{Outcome, Room, scene};
use exr::prelude::{f16, write_rgb_file};
use photoncard_driver::exr::{Shown, read};

/// Options of tone mappings. The first one is the default.
const MAPPINGS: [&[&str]; 5] = [
    &[],
    &["--exposure=auto", "--tonemap=reinhard"],
    &["--exposure=-2.5"],
    &["--tonemap=none"],
    &["--tonemap=aces", "--exposure", "1"],
];

fn room_with_a_scene() -> Room {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room
}

fn tonemap(room: &Room, options: &[&str]) -> Outcome {
    room.run(&[&["tonemap"], options].concat())
}

/// One render writes an EXR and a PNG. `photoncard tonemap` makes the same PNG of this EXR, for every
/// mapping.
#[test]
fn the_png_of_a_render_equals_that_of_its_exr() {
    let room = room_with_a_scene();
    room.rendered("scene.gltf", &["-o", "only.exr", "--crop", "1,7,2,8"]);
    let mut pictures = Vec::new();
    for mapping in MAPPINGS {
        let both = ["-o", "a.png", "-o", "a.exr", "--crop", "1,7,2,8"];
        room.rendered("scene.gltf", &[&both[..], mapping].concat());
        assert_eq!(room.read("a.exr"), room.read("only.exr"), "{mapping:?}");
        let outcome = tonemap(&room, &[&["a.exr", "-o", "b.png"], mapping].concat());
        assert_eq!((outcome.status, outcome.stdout, outcome.stderr), (Some(0), String::new(), String::new()));
        assert!(room.read("b.png").starts_with(b"\x89PNG\r\n\x1a\n"));
        assert!(room.read("a.png") == room.read("b.png"), "{mapping:?}");
        pictures.push(room.read("a.png"));
    }
    assert!(pictures[0] == pictures[1]);
    for (index, picture) in pictures.iter().enumerate().skip(2) {
        assert!(!pictures[..index].contains(picture), "{:?}", MAPPINGS[index]);
    }
    room.rendered("scene.gltf", &["-o", "only.png", "--crop", "1,7,2,8"]);
    assert!(room.read("only.png") == pictures[0]);
}

#[test]
fn a_transparent_picture_has_alpha_in_all_its_files() {
    let room = room_with_a_scene();
    let sky = ["--environment", "1,1,1", "--camera-at", "0,2,9"];
    let layers = ["--aov", "object,material,alpha,position"];
    let files = ["-o", "a.exr", "-o", "a.png", "--transparent"];
    room.rendered("scene.gltf", &[&files[..], &sky, &layers].concat());
    let outcome = tonemap(&room, &["a.exr", "-o", "b.png"]);
    assert_eq!((outcome.status, outcome.stderr), (Some(0), String::new()));
    assert!(room.read("a.png") == room.read("b.png"));
    let is_rgba = |name| room.read(name)[25] == 6;
    assert!(is_rgba("a.png"));
    let picture = read(&room.path("a.exr"), Shown::Rendered).unwrap();
    let alpha = picture.alpha.expect("the picture has alpha");
    assert!(alpha.contains(&0.0) && alpha.iter().any(|&alpha| alpha > 0.0));
    let background = alpha.iter().zip(&picture.pixels).filter(|(alpha, _)| **alpha == 0.0);
    assert!(background.into_iter().all(|(_, pixel)| *pixel == [0.0; 3]));
    // Layers alone do not make a picture transparent.
    room.rendered("scene.gltf", &[&["-o", "c.exr", "-o", "c.png"][..], &sky, &layers].concat());
    let opaque = read(&room.path("c.exr"), Shown::Rendered).unwrap();
    assert!(opaque.alpha.is_none() && !is_rgba("c.png"));
    assert!(opaque.pixels.iter().flatten().all(|&value| value > 0.0));
    let outcome = room.render("scene.gltf", &["-o", "a.mp4", "--frames", "1-2", "--transparent"]);
    assert_eq!(outcome.status, Some(2));
    assert!(outcome.stderr.contains("no alpha") && outcome.stderr.contains(".png"), "{}", outcome.stderr);
}

#[test]
fn finished_tiles_of_a_png_alone_are_kept_beside_it() {
    let room = room_with_a_scene();
    room.write("a.png.partial", "notes");
    let outcome = room.render("scene.gltf", &["-o", "a.png", "--resume"]);
    assert_eq!(outcome.status, Some(2));
    assert!(outcome.stderr.contains("a.png.partial"), "{}", outcome.stderr);
    // With an EXR, the partial file has the EXR's name, whatever the order of outputs.
    let outcome = room.rendered("scene.gltf", &["-o", "a.png", "-o", "a.exr"]);
    assert_eq!(outcome.status, Some(0));
    assert_eq!(room.names(), ["a.exr", "a.png", "a.png.partial", "scene.gltf"]);
}

/// Writes an EXR of half-precision samples from `pixel`, as another program would.
fn foreign(path: &Path, pixel: impl Fn(usize, usize) -> f32 + Sync) {
    let half = |x, y| f16::from_f32(pixel(x, y));
    write_rgb_file(path, 5, 4, |x, y| (half(x, y), half(y, x), f16::ONE)).unwrap();
}

#[test]
fn pictures_of_other_programs_are_tone_mapped() {
    let room = Room::new();
    let name = room.path("half.exr");
    foreign(&name, |x, y| match (x, y) {
        (4, 3) => f32::INFINITY,
        _ => x as f32 - y as f32,
    });
    assert!(read(&name, Shown::Rendered).unwrap().pixels.iter().flatten().any(|value| *value < 0.0));
    let outcome = tonemap(&room, &["half.exr", "-o", "half.png", "--exposure", "0", "--tonemap", "none"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let file = std::io::BufReader::new(std::fs::File::open(room.path("half.png")).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let texts = reader.info().uncompressed_latin1_text.iter().map(|text| text.keyword.as_str());
    assert_eq!(texts.collect::<Vec<_>>(), ["photoncard-tonemap"]);
    assert_eq!((info.width, info.height), (5, 4));
    for (place, pixel) in (0..).zip(pixels.chunks(3)) {
        let (x, y) = (place % 5, place / 5);
        let code = |value: i32, is_infinite| if is_infinite || value > 0 { 255 } else { 0 };
        let expected = [code(x - y, (x, y) == (4, 3)), code(y - x, (y, x) == (4, 3)), 255];
        assert_eq!(pixel, expected, "{x},{y}");
    }
}

#[test]
fn files_that_are_no_picture_are_refused_and_the_old_one_is_kept() {
    let room = room_with_a_scene();
    room.rendered("scene.gltf", &["-o", "good.exr"]);
    let good = room.read("good.exr");
    room.write("cut.exr", &good[..good.len() / 2]);
    room.write("empty.exr", "");
    foreign(&room.path("nan.exr"), |x, y| if (x, y) == (3, 1) { f32::NAN } else { 1.0 });
    depth_alone(&room.path("depth.exr"));
    std::fs::create_dir(room.path("folder.exr")).unwrap();
    room.write("old.png", "old picture");
    let before = room.names();
    for (name, words) in [
        ("absent.exr", ["cannot read absent.exr", "check that the path"]),
        ("folder.exr", ["cannot read folder.exr", "check that the path"]),
        ("empty.exr", ["not a readable OpenEXR picture", "copy it again"]),
        ("cut.exr", ["not a readable OpenEXR picture", "copy it again"]),
        ("scene.gltf", ["not a readable OpenEXR picture", "copy it again"]),
        ("depth.exr", ["no channels R, G and B, only Z", "plain RGB"]),
        ("nan.exr", ["pixel (3, 1)", "not a number"]),
    ] {
        let outcome = tonemap(&room, &[name, "-o", "old.png"]);
        assert_eq!((outcome.status, outcome.stdout.as_str()), (Some(2), ""), "{name}: {}", outcome.stderr);
        assert!(words.iter().all(|word| outcome.stderr.contains(word)), "{words:?}: {}", outcome.stderr);
        assert_eq!((room.names(), room.read("old.png")), (before.clone(), b"old picture".to_vec()), "{name}");
    }
    for (options, word) in [
        (&["--exposure=inf"][..], "number of stops"),
        (&["--exposure=nan"], "number of stops"),
        (&["--tonemap=filmic"], "reinhard"),
        (&["-o", "absent/a.png"], "the folder absent does not exist"),
    ] {
        let output: &[&str] = if options[0] == "-o" { &[] } else { &["-o", "old.png"] };
        let outcome = tonemap(&room, &[&["good.exr"], output, options].concat());
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
        assert_eq!(room.read("old.png"), b"old picture");
    }
}

/// Writes an EXR whose only channel is `Z`.
fn depth_alone(path: &Path) {
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, SmallVec, WritableImage};
    let mut channels = SmallVec::new();
    channels.push(AnyChannel::new("Z", FlatSamples::F32(vec![1.0; 6])));
    Image::from_channels((3, 2), AnyChannels::sort(channels)).write().to_file(path).unwrap();
}

/// The input is an EXR with the name of a PNG, which is also the output.
#[test]
fn the_input_picture_is_not_replaced() {
    let room = room_with_a_scene();
    room.rendered("scene.gltf", &["-o", "a.exr"]);
    let bytes = room.read("a.exr");
    room.write("a.png", &bytes);
    let outcome = tonemap(&room, &["a.png", "-o", "./a.png"]);
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("it is the picture to read as well"), "{}", outcome.stderr);
    assert_eq!(room.read("a.png"), bytes);
}

#[test]
fn false_colours_are_of_illuminance_or_luminance() {
    let room = room_with_a_scene();
    room.rendered("scene.gltf", &["--aov", "illuminance", "-o", "lux.exr"]);
    room.rendered("scene.gltf", &["--aov", "none", "-o", "plain.exr"]);
    room.rendered("scene.gltf", &["--aov", "none", "--irradiance", "-o", "irradiance.exr"]);
    let shown = |name: &str| {
        let arguments = ["tonemap", name, "--false-color", "0,5", "--lumens-per-watt", "1", "-o", "out.png"];
        let outcome = room.run(&arguments);
        assert_eq!((outcome.status, &*outcome.stderr), (Some(0), ""), "{name}");
        pixels_of(&room.path("out.png"))
    };
    let [lux, plain, irradiance] = ["lux.exr", "plain.exr", "irradiance.exr"].map(shown);
    assert_eq!(lux.0, [8, 8]);
    assert!(lux == irradiance, "illuminance is the luminance of the irradiance");
    assert!(lux != plain);
    for (range, part) in [("5,0", "no range"), ("0", "no range"), ("0,nan", "no range")] {
        let outcome = room.run(&["tonemap", "lux.exr", "--false-color", range, "-o", "out.png"]);
        assert_eq!(outcome.status, Some(2), "{range}");
        assert!(outcome.stderr.contains(part), "{}", outcome.stderr);
    }
}

/// Size and bytes of the pixels of a PNG.
fn pixels_of(path: &Path) -> ([u32; 2], Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    ([info.width, info.height], pixels)
}
