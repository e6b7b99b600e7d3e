//! Textures are loaded with texels, samplers and transforms. Unreadable images are named with their path and
//! remedy.

use std::fs;
use std::path::Path;

use miette::Diagnostic;
use photoncard_firmware::scene::decode_texel;
use photoncard_scene::error::SceneError;
use photoncard_scene::{Encoding, Scene, Wrap, gltf};
use photoncard_shared::layout::TexelFormat;
use serde_json::{Value, json};

use crate::support::{Extended, check_left_out, embedded, glb, pbr, push, textured};

/// PNG of one texel: (255, 128, 0, 51).
const TEXEL: &[u8] = include_bytes!("images/texel.png");
/// JPEG of 24 x 16 texels (10 x, 16 y, 200 - 8 x).
const COLOUR: &[u8] = include_bytes!("images/colour.jpg");
const PROGRESSIVE: &[u8] = include_bytes!("images/progressive.jpg");
const GREY: &[u8] = include_bytes!("images/grey.jpg");
const LOSSY_WEBP: &[u8] = include_bytes!("images/lossy.webp");
const LOSSLESS_WEBP: &[u8] = include_bytes!("images/lossless.webp");
/// WebP with an alpha of 255 - 5 y.
const ALPHA_WEBP: &[u8] = include_bytes!("images/alpha.webp");
const CMYK: &[u8] = include_bytes!("images/cmyk.jpg");

fn base64(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// Loads a scene from a folder that also contains `files`.
fn load_beside(scene: &Extended, files: &[(&str, &[u8])]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("scene");
    fs::create_dir_all(inside.join("sub")).unwrap();
    fs::write(folder.path().join("secret.png"), TEXEL).unwrap();
    fs::write(inside.join("data.bin"), &scene.bytes).unwrap();
    for (name, bytes) in files {
        fs::write(inside.join(name), bytes).unwrap();
    }
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.path().join("secret.png"), inside.join("link.png")).unwrap();
    fs::write(inside.join("scene.gltf"), scene.json.to_string()).unwrap();
    gltf::load(&inside.join("scene.gltf"))
}

fn check(error: &SceneError, parts: &[&str]) {
    let text = error.to_string();
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in {text:?}");
    }
    assert!(error.help().is_some_and(|help| !help.to_string().is_empty()), "{text}: no remedy");
}

#[test]
fn an_image_is_the_same_from_any_source() {
    let uri = |uri: &str| textured(&json!({"uri": uri}));
    let data = uri(&format!("data:image/png;base64,{}", base64(TEXEL)));
    let untyped = uri(&format!("data:application/octet-stream;base64,{}", base64(TEXEL)));
    let mut in_view = embedded(TEXEL, "image/png");
    for scene in [&data, &untyped, &in_view, &uri("my%20texel.png"), &uri("sub/texel.png")] {
        let scene = load_beside(scene, &[("my texel.png", TEXEL), ("sub/texel.png", TEXEL)]).unwrap();
        let [image] = &scene.images[..] else { panic!("{:?}", scene.images) };
        assert_eq!((image.width, image.height, &image.texels[..]), (1, 1, &[[255, 128, 0, 51]][..]));
        assert_eq!(image.encoding, Encoding::Srgb);
        assert_eq!(scene.materials[0].base_texture, Some(0));
        assert_eq!(scene.notices, Vec::<String>::new());
    }
    in_view.json["images"][0]["name"] = json!("paint");
    assert_eq!(in_view.load().unwrap().images[0].name, "paint");
}

/// Baseline and progressive JPEG keep colours within the error of their quality and chroma subsampling.
#[test]
fn jpegs_are_decoded() {
    for bytes in [COLOUR, PROGRESSIVE] {
        let scene = embedded(bytes, "image/jpeg").load().unwrap();
        let image = &scene.images[0];
        assert_eq!((image.width, image.height), (24, 16));
        let mut sum = 0;
        for (index, texel) in image.texels.iter().enumerate() {
            let (x, y) = (index as i32 % 24, index as i32 / 24);
            let expected = [10 * x, 16 * y, 200 - 8 * x, 255];
            sum += texel.iter().zip(expected).map(|(&found, e)| (i32::from(found) - e).abs()).sum::<i32>();
        }
        let mean = f64::from(sum) / (3.0 * 24.0 * 16.0);
        assert!(mean < 4.0, "{mean}");
    }
    let grey = embedded(GREY, "image/jpeg").load().unwrap();
    assert!(
        grey.images[0]
            .texels
            .iter()
            .all(|[red, green, blue, alpha]| { red == green && green == blue && *alpha == 255 })
    );
}

/// WebP is read as a texture's own image, and as that of `EXT_texture_webp`, which may be required.
#[test]
fn webps_are_decoded() {
    for (bytes, tolerance, rows) in [(LOSSY_WEBP, 8, 0), (LOSSLESS_WEBP, 0, 0), (ALPHA_WEBP, 8, 5)] {
        let mut scene = embedded(bytes, "image/webp");
        let image = scene.load().unwrap().images.remove(0);
        assert_eq!((image.width, image.height), (24, 16));
        for (index, texel) in image.texels.iter().enumerate() {
            let (x, y) = (index as i32 % 24, index as i32 / 24);
            let expected = [10 * x, 16 * y, 200 - 8 * x, 255 - rows * y];
            let errors = texel.iter().zip(expected).map(|(&found, e)| (i32::from(found) - e).abs());
            assert!(errors.max() <= Some(4 * tolerance), "{texel:?} is not {expected:?}");
        }
        scene.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
        scene.json["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
        assert_eq!(scene.load().unwrap().images, [image]);
    }
    // A texture's own image comes first.
    let mut scene = embedded(TEXEL, "image/png");
    let view = scene.view(LOSSY_WEBP);
    push(&mut scene.json, "images", json!({"bufferView": view}));
    scene.json["textures"][0]["extensions"] = json!({"EXT_texture_webp": {"source": 1}});
    assert_eq!(scene.load().unwrap().images[0].width, 1);
}

#[test]
fn webps_that_contradict_themselves_or_move_are_left_out() {
    let changed = |bytes: &[u8], at: usize, value: u8| {
        let mut bytes = bytes.to_vec();
        bytes[at] = value;
        embedded(&bytes, "image/webp").load().unwrap()
    };
    // Other width of the canvas in the extended header (`VP8X`), and its flag of an animation.
    check_left_out(&changed(ALPHA_WEBP, 24, 24), &["contradict"]);
    check_left_out(&changed(ALPHA_WEBP, 20, 0x12), &["cannot be decoded"]);
    check_left_out(&embedded(&LOSSY_WEBP[..100], "image/webp").load().unwrap(), &["cannot be decoded"]);
    check_left_out(&embedded(&LOSSLESS_WEBP[..30], "image/webp").load().unwrap(), &["cannot be decoded"]);
}

#[test]
fn samplers_and_transforms_are_taken() {
    let plain = embedded(TEXEL, "image/png").load().unwrap().textures[0];
    assert_eq!((plain.wrap, plain.nearest, plain.set), ([Wrap::Repeat; 2], false, 0));
    assert_eq!((plain.matrix, plain.offset), ([[1.0, 0.0], [0.0, 1.0]], [0.0; 2]));

    let mut scene = embedded(TEXEL, "image/png");
    scene.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}]);
    scene.json["textures"][0]["sampler"] = json!(0);
    scene.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    // The lower left quadrant, turned clockwise, as the extension's own example has it.
    let quarter = std::f64::consts::FRAC_PI_2;
    pbr(&mut scene.json)["baseColorTexture"]["extensions"] = json!({"KHR_texture_transform": {
        "offset": [0, 1], "rotation": quarter, "scale": [0.5, 0.5], "texCoord": 0
    }});
    pbr(&mut scene.json)["baseColorTexture"]["texCoord"] = json!(7);
    let texture = scene.load().unwrap().textures[0];
    assert_eq!((texture.wrap, texture.nearest), ([Wrap::Clamp, Wrap::Mirror], true));
    let place = |u: f32, v: f32| {
        let row = |row: usize| texture.matrix[row][0] * u + texture.matrix[row][1] * v + texture.offset[row];
        [row(0), row(1)]
    };
    for (from, to) in [((0.0, 0.0), [0.0, 1.0]), ((1.0, 0.0), [0.0, 0.5]), ((0.0, 1.0), [0.5, 1.0])] {
        let found = place(from.0, from.1);
        assert!(found.iter().zip(to).all(|(found, to)| (found - to).abs() < 1e-6), "{from:?}: {found:?}");
    }
}

/// The scale is applied before the rotation, and both before the offset.
#[test]
fn a_transform_scales_turns_and_moves_in_this_order() {
    let mut scene = embedded(TEXEL, "image/png");
    pbr(&mut scene.json)["baseColorTexture"]["extensions"] =
        json!({"KHR_texture_transform": {"rotation": std::f64::consts::FRAC_PI_6, "scale": [2, 4]}});
    let [[a, b], [c, d]] = scene.load().unwrap().textures[0].matrix;
    let half_root = 3_f32.sqrt() / 2.0;
    for (found, expected) in [(a, 2.0 * half_root), (b, 2.0), (c, -1.0), (d, 4.0 * half_root)] {
        assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
    }
}

/// An image that is used for colours and for numbers is stored twice. Equal textures are merged.
#[test]
fn an_image_is_stored_once_for_each_encoding() {
    let mut scene = embedded(TEXEL, "image/png");
    scene.json["materials"][0]["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
    pbr(&mut scene.json)["metallicRoughnessTexture"] = json!({"index": 0});
    scene.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    push(&mut scene.json, "textures", json!({"source": 0, "name": "the same again"}));
    let scene = scene.load().unwrap();
    let material = &scene.materials[0];
    let used = [material.base_texture, material.metallic_roughness_texture, material.emissive_texture];
    assert_eq!(used, [Some(0), Some(1), Some(0)]);
    let encodings: Vec<_> =
        scene.textures.iter().map(|texture| scene.images[texture.image as usize].encoding).collect();
    assert_eq!(encodings, [Encoding::Srgb, Encoding::Linear]);
    assert_eq!(scene.images.len(), 2);
    assert!(scene.images.iter().all(|image| image.texels == [[255, 128, 0, 51]]));
}

/// Images of unused textures may be missing or invalid.
#[test]
fn images_without_a_use_are_not_read() {
    let mut scene = embedded(TEXEL, "image/png");
    push(&mut scene.json, "images", json!({"uri": "absent.png"}));
    push(&mut scene.json, "textures", json!({"source": 1}));
    // A Lambertian material does not use roughness, and one without emission no emissive texture.
    pbr(&mut scene.json)["metallicRoughnessTexture"] = json!({"index": 1});
    assert_eq!(scene.load().unwrap().images.len(), 1);
    scene.json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    scene.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    assert_eq!(scene.load().unwrap().images.len(), 1);
    assert_eq!(scene.load().unwrap().materials[0].textures().count(), 1);
}

#[test]
fn textures_without_a_readable_image_are_left_out() {
    let uri = |uri: &str| textured(&json!({"uri": uri}));
    let without_source = |texture: Value| {
        let mut scene = embedded(TEXEL, "image/png");
        scene.json["textures"] = json!([texture]);
        scene
    };
    let cases: [(Extended, &[&str]); 19] = [
        (uri("absent.png"), &["'absent.png'", "cannot read"]),
        (uri("sub"), &["'sub'", "regular file"]),
        (uri("/etc/hostname"), &["relative"]),
        (uri("../secret.png"), &["leaves"]),
        (uri("sub/%2e%2e/%2E%2e/secret.png"), &["leaves"]),
        (uri("..%2fsecret.png"), &["leaves"]),
        (uri("file:///etc/hostname"), &["scheme"]),
        (uri("https://example.org/a.png"), &["scheme"]),
        (uri("data:image/png;base64,*"), &["'image 0'", "base64"]),
        (uri("data:image/png;base64,"), &["'image 0'", "empty"]),
        (textured(&json!({"name": "paint"})), &["'paint'", "neither uri nor bufferView"]),
        (textured(&json!({"uri": "a.png", "bufferView": 0})), &["'a.png'", "both"]),
        (embedded(b"GIF89a", "image/gif"), &["'image 0'", "GIF"]),
        (embedded(&TEXEL[..TEXEL.len() - 20], "image/png"), &["decoded"]),
        (embedded(&COLOUR[..COLOUR.len() - 100], "image/jpeg"), &["decoded"]),
        (embedded(&COLOUR[..100], "image/jpeg"), &["frame header"]),
        (embedded(CMYK, "image/jpeg"), &["CMYK"]),
        (without_source(json!({"extensions": {"VENDOR_texture": {"source": 0}}})), &["no image in a format"]),
        (without_source(json!({})), &["no image in a format"]),
    ];
    for (scene, parts) in cases {
        check_left_out(&load_beside(&scene, &[]).unwrap(), parts);
    }
    #[cfg(unix)]
    check_left_out(&load_beside(&uri("link.png"), &[]).unwrap(), &["'link.png'", "link"]);
    // A buffer that is too short is a fault of the whole file.
    let mut beyond = embedded(TEXEL, "image/png");
    beyond.json["bufferViews"][2]["byteLength"] = json!(1000);
    beyond.json["images"][0]["bufferView"] = json!(2);
    check(&beyond.load().unwrap_err(), &["images[0].bufferView", "beyond"]);
}

/// A notice lists each unreadable image once, and at most eight of them.
#[test]
fn textures_beside_an_unreadable_one_stay() {
    let mut scene = embedded(TEXEL, "image/png");
    let first = push(&mut scene.json, "images", json!({"uri": "absent 0.png"}));
    for number in 1..20 {
        push(&mut scene.json, "images", json!({"uri": format!("absent {number}.png")}));
    }
    for image in first..first + 20 {
        let texture = push(&mut scene.json, "textures", json!({"source": image}));
        let other = json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": texture},
            "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": texture}}});
        push(&mut scene.json, "materials", other);
    }
    pbr(&mut scene.json)["baseColorTexture"] = json!({"index": 1});
    scene.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    let scene = scene.load().unwrap();
    assert_eq!((scene.materials[0].base_texture, scene.materials[0].emissive_texture), (None, Some(0)));
    assert_eq!((scene.textures.len(), scene.textures[0].image), (1, 0));
    assert_eq!(scene.images[0].texels, [[255, 128, 0, 51]]);
    let [notice] = &scene.notices[..] else { panic!("{:?}", scene.notices) };
    assert_eq!(notice.matches("absent 0.png'").count(), 1, "{notice}");
    assert!(notice.ends_with("and 12 more"), "{notice}");
}

/// The bytes of an image determine its format.
#[test]
fn a_wrong_media_type_is_ignored() {
    let right = embedded(COLOUR, "image/jpeg").load().unwrap().checksum().to_owned();
    assert_eq!(embedded(COLOUR, "image/png").load().unwrap().checksum(), right);
    let uri = format!("data:image/png;base64,{}", base64(COLOUR));
    assert_eq!(textured(&json!({"uri": uri})).load().unwrap().images[0].width, 24);
}

/// Uses headers with a correct checksum and a size that exceeds a limit or contradicts the file's length.
#[test]
fn sizes_are_refused_by_the_header() {
    let header = |width: u32, height: u32| {
        let mut bytes = TEXEL.to_vec();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = bytes[12..29].iter().fold(u32::MAX, |sum, &byte| {
            (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xedb8_8320))
        });
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        bytes
    };
    // The length allows this size by the bound of Deflate: the sum of the images is refused first.
    let mut large = header(16_384, 16_384);
    large.resize(1 << 16, 0);
    let mut two = embedded(&large, "image/png");
    let view = two.view(TEXEL);
    push(&mut two.json, "images", json!({"bufferView": view}));
    push(&mut two.json, "textures", json!({"source": 1}));
    two.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    let words = ["images and materials take 1073741888 bytes", "the card has 536870912"];
    check(&two.load().unwrap_err(), &words);
    for (size, part) in [
        ([1, 100_000], "1 x 100000 texels, more than 16384"),
        ([16_385, 1], "16385 x 1"),
        ([u32::MAX >> 1, u32::MAX >> 1], "more than 16384"),
    ] {
        let error = embedded(&header(size[0], size[1]), "image/png").load().unwrap_err();
        check(&error, &["images[0]", part]);
    }
    // A size that the file cannot hold is damage.
    let empty = embedded(&header(16_384, 16_384), "image/png").load().unwrap();
    check_left_out(&empty, &["16384 x 16384 texels do not fit into 70 bytes"]);
    let mut wide = COLOUR.to_vec();
    let frame = wide.windows(2).position(|bytes| bytes == [0xff, 0xc0]).unwrap();
    wide[frame + 5..frame + 9].copy_from_slice(&[0xff; 4]);
    check(&embedded(&wide, "image/jpeg").load().unwrap_err(), &["images[0]", "65535 x 65535"]);
}

#[test]
fn images_above_a_limit_are_scaled_down_and_count_so_in_the_memory_of_cards() {
    let textured = embedded(COLOUR, "image/jpeg");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    fs::write(&path, glb(textured.json, &textured.bytes)).unwrap();
    let image = |limit| {
        let settings = gltf::LoadSettings { texture_limit: limit, ..gltf::LoadSettings::default() };
        let scene = gltf::load_with(&path, &settings).unwrap();
        (scene.images[0].clone(), scene.checksum().to_owned())
    };
    let ((whole, checksum), (same, of_same), (small, of_small)) =
        (image(None), image(Some(24)), image(Some(8)));
    assert_eq!((whole.width, whole.height), (24, 16));
    assert_eq!((&whole, &checksum), (&same, &of_same));
    assert_ne!(checksum, of_small);
    // Each side is reduced to a third. Texels are means of nine, and columns differ by about 10.
    assert_eq!((small.width, small.height, small.texels.len()), (8, 6, 48));
    let red = |image: &photoncard_scene::Image, x: usize| i32::from(image.texels[x][0]);
    for x in 0..8 {
        let (mean, middle) = (red(&small, x), red(&whole, 3 * x + 1));
        assert!((mean - middle).abs() < 6, "{mean}, {middle}");
    }
    // The texels take twelve lines, or two with a limit of 8 texels.
    let load = |texture_limit| {
        let settings =
            gltf::LoadSettings { dram_bytes: 1000, texture_limit, ..gltf::LoadSettings::default() };
        gltf::load_with(&path, &settings)
    };
    assert!(matches!(load(None), Err(SceneError::TooLarge { .. })));
    load(Some(8)).unwrap();
}

#[test]
fn textures_without_coordinates_or_of_wrong_indices_are_refused() {
    type Change = fn(&mut Value);
    let cases: [(&[&str], Change); 5] = [
        (&["textures[0].source"], |json| json["textures"][0]["source"] = json!(3)),
        (&["materials[0].pbrMetallicRoughness.baseColorTexture.index"], |json| {
            pbr(json)["baseColorTexture"]["index"] = json!(3);
        }),
        (&["baseColorTexture.texCoord", "TEXCOORD_2"], |json| {
            pbr(json)["baseColorTexture"]["texCoord"] = json!(2);
        }),
        (&["meshes[0].primitives[0].attributes", "TEXCOORD_1"], |json| {
            pbr(json)["baseColorTexture"]["texCoord"] = json!(1);
        }),
        (&["KHR_texture_transform", "out of range"], |json| {
            pbr(json)["baseColorTexture"]["extensions"] =
                json!({"KHR_texture_transform": {"scale": [1e9, 1]}});
        }),
    ];
    for (parts, change) in cases {
        let mut scene = embedded(TEXEL, "image/png");
        change(&mut scene.json);
        match scene.load() {
            Ok(_) => panic!("{parts:?} was loaded"),
            Err(error) => check(&error, parts),
        }
    }
    let mut endless = embedded(TEXEL, "image/png");
    let coordinates = endless.floats("VEC2", &[[0.0, 0.0], [f32::NAN, 0.0], [0.0, 1.0]]);
    endless.primitive()["attributes"]["TEXCOORD_0"] = json!(coordinates);
    check(&endless.load().unwrap_err(), &["TEXCOORD_0", "vertex 1"]);
}

/// Compares two scenes that differ in one texel only.
#[test]
fn checksums_depend_on_texels_and_samplers() {
    let scene = embedded(TEXEL, "image/png").load().unwrap();
    let mut other = scene.clone();
    other.images[0].texels[0][1] = 127;
    let mut nearest = scene.clone();
    nearest.textures[0].nearest = true;
    let mut moved = scene.clone();
    moved.attributes[0].coordinates[0][1].x = 0.5;
    let sums = [&scene, &other, &nearest, &moved].map(Scene::checksum);
    for (i, a) in sums.iter().enumerate() {
        assert!(sums[..i].iter().all(|b| a != b), "{sums:?}");
    }
    assert_eq!(scene.checksum(), embedded(TEXEL, "image/png").load().unwrap().checksum());
}

/// The path of the scene's own folder may contain a symbolic link.
#[cfg(unix)]
#[test]
fn a_scene_in_a_linked_folder_reads_what_is_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("scene");
    fs::create_dir(&inside).unwrap();
    let scene = textured(&json!({"uri": "texel.png"}));
    fs::write(inside.join("data.bin"), &scene.bytes).unwrap();
    fs::write(inside.join("texel.png"), TEXEL).unwrap();
    fs::write(inside.join("scene.gltf"), scene.json.to_string()).unwrap();
    let linked = folder.path().join("linked");
    std::os::unix::fs::symlink(Path::new("scene"), &linked).unwrap();
    assert_eq!(gltf::load(&linked.join("scene.gltf")).unwrap().images.len(), 1);
}

/// PNG of one grey texel of 16 bits per channel.
fn deep(grey: u16) -> Vec<u8> {
    deep_of(png::ColorType::Grayscale, &[grey])
}

/// PNG of one texel of 16 bits per channel.
fn deep_of(colour: png::ColorType, channels: &[u16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().unwrap();
    let data: Vec<u8> = channels.iter().flat_map(|channel| channel.to_be_bytes()).collect();
    writer.write_image_data(&data).unwrap();
    writer.finish().unwrap();
    bytes
}

#[test]
fn emission_keeps_more_than_eight_bits() {
    let loaded = |bytes: &[u8], has_base: bool| {
        let mut scene = embedded(bytes, "image/png");
        let base = pbr(&mut scene.json).as_object_mut().unwrap().remove("baseColorTexture");
        if has_base {
            pbr(&mut scene.json)["baseColorTexture"] = base.unwrap();
        }
        scene.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
        let image = scene.load().unwrap().images.remove(0);
        (image.encoding, image.texels[0])
    };
    let (encoding, texel) = loaded(&deep(0x8000), false);
    assert_eq!(encoding, Encoding::SharedExponent);
    let [red, green, blue, _] = decode_texel(TexelFormat::SharedExponent, texel);
    assert!((red / 0.214_05 - 1.0).abs() < 1e-3 && green == red && blue == red, "{red}");
    // An image that is also the base colour is stored in one encoding, of 8 bits.
    assert_eq!(loaded(&deep(0x8000), true), (Encoding::Srgb, [128, 128, 128, 255]));
    assert_eq!(loaded(TEXEL, false).0, Encoding::Srgb);
}

#[test]
fn normals_and_data_keep_sixteen_bits() {
    let loaded = |properties: &[&str]| {
        let mut scene = embedded(&deep_of(png::ColorType::Rgb, &[32_800, 40_001, 65_535]), "image/png");
        pbr(&mut scene.json).as_object_mut().unwrap().remove("baseColorTexture");
        let material = &mut scene.json["materials"][0];
        for property in properties {
            match *property {
                "normalTexture" => material["normalTexture"] = json!({"index": 0}),
                "metallicRoughnessTexture" => {
                    material["pbrMetallicRoughness"] = json!({"metallicRoughnessTexture": {"index": 0}});
                }
                coat => {
                    material["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"] = json!(1.0);
                    material["extensions"]["KHR_materials_clearcoat"][coat] = json!({"index": 0});
                }
            }
        }
        let image = scene.load().unwrap().images.remove(0);
        (image.encoding, decode_texel(image.encoding.into(), image.texels[0]))
    };
    let exact = [32_800, 40_001, 65_535].map(|code: u16| f32::from(code) / 65_535.0);
    let near = |found: f32, expected: f32| (found - expected).abs() < 1e-6;
    let (encoding, [x, y, z, _]) = loaded(&["normalTexture"]);
    assert_eq!(encoding, Encoding::NormalPair);
    let normal = (glam::Vec3::from(exact) * 2.0 - 1.0).normalize();
    assert!((glam::Vec3::new(x, y, z) * 2.0 - 1.0).distance(normal) < 4e-5);
    let (encoding, [_, roughness, metallic, _]) = loaded(&["metallicRoughnessTexture"]);
    assert!(encoding == Encoding::LinearPair && near(roughness, exact[1]) && near(metallic, exact[2]));
    let (encoding, [factor, roughness, ..]) = loaded(&["clearcoatTexture", "clearcoatRoughnessTexture"]);
    assert!(encoding == Encoding::LinearPair && near(factor, exact[0]) && near(roughness, exact[1]));
    let (encoding, [_, roughness, metallic, _]) =
        loaded(&["metallicRoughnessTexture", "clearcoatRoughnessTexture"]);
    assert!(encoding == Encoding::LinearPair && near(roughness, exact[1]) && near(metallic, exact[2]));
    // Four bytes have no room for three channels of 16 bits, nor for a normal beside data.
    for both in ["clearcoatTexture", "normalTexture"] {
        assert_eq!(loaded(&["metallicRoughnessTexture", both]).0, Encoding::Linear);
    }
}

#[test]
fn coordinates_of_lightmaps_are_read_on_request() {
    let mut scene = crate::support::Extended::new();
    let corners = [[0.25, 0.5], [0.75, 0.5], [0.25, 0.75]];
    let second = scene.floats("VEC2", &corners);
    scene.primitive()["attributes"]["TEXCOORD_1"] = json!(second);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("data.bin"), &scene.bytes).unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, scene.json.to_string()).unwrap();
    for lightmap_coordinates in [false, true] {
        let settings = gltf::LoadSettings { lightmap_coordinates, ..gltf::LoadSettings::default() };
        let loaded = gltf::load_with(&path, &settings).unwrap();
        let attributes = loaded.attributes.get(loaded.triangles[0].attributes as usize);
        let found = attributes.map(|attributes| attributes.coordinates[1].map(|place| place.to_array()));
        assert_eq!(found, lightmap_coordinates.then_some(corners));
    }
}
