//! Compressed buffer views equal their uncompressed fallback; impossible ones are refused.
//!
//! Both files are compressed by meshoptimizer 1.3.0, in version 0 and 1 of its format, and their fallback is
//! decoded by its reference decoder in JavaScript. They contain a grid of several blocks with colours and
//! octahedral normals, and instances of a strip with exponents and quaternions.

use crate::support::{load_parts, parts};
use miette::Diagnostic;
use serde_json::{Value, json};

const FILES: [(&[u8], &str); 2] = [
    (include_bytes!("compressed/meshopt-0.glb"), "EXT_meshopt_compression"),
    (include_bytes!("compressed/meshopt-1.glb"), "KHR_meshopt_compression"),
];

/// Maximum difference of filtered values. The extension allows one unit of 8 bits.
const UNIT: f32 = 1.01 / 127.0;

/// Returns the extension of a buffer view.
fn extension<'v>(json: &'v mut Value, view: usize, name: &str) -> &'v mut Value {
    &mut json["bufferViews"][view]["extensions"][name]
}

fn near<const N: usize>(found: [f32; N], expected: [f32; N]) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= UNIT)
}

#[test]
fn compressed_views_hold_what_their_fallback_holds() {
    for (file, name) in FILES {
        let compressed = load_parts(&parts(file)).unwrap();
        assert!(
            compressed.notices.iter().all(|notice| notice.contains("camera")),
            "{:?}",
            compressed.notices
        );
        let (mut json, bytes) = parts(file);
        for view in json["bufferViews"].as_array_mut().unwrap() {
            assert!(
                view.as_object_mut().unwrap().remove("extensions").is_some_and(|of| of.get(name).is_some())
            );
        }
        let fallback = load_parts(&(json, bytes)).unwrap();
        // A grid of 24 x 16 vertices, and five strips of 40 vertices.
        assert_eq!(compressed.triangles.len(), 2 * 23 * 15 + 5 * 38);
        let pairs = compressed.triangles.iter().zip(&fallback.triangles);
        for (index, (found, expected)) in pairs.enumerate() {
            let corners = found.vertices.iter().zip(expected.vertices);
            // The strips are turned by filtered quaternions, at up to 40 m from their origin.
            let tolerance = if index < 2 * 23 * 15 { 0.0 } else { 40.0 / 32_767.0 * 4.0 };
            assert!(
                corners.into_iter().all(|(found, expected)| found.distance(expected) <= tolerance),
                "{name}: triangle {index} is {found:?}, not {expected:?}"
            );
        }
        assert_eq!(compressed.attributes.len(), fallback.attributes.len());
        for (found, expected) in compressed.attributes.iter().zip(&fallback.attributes) {
            assert_eq!(found.coordinates, expected.coordinates);
            let normals =
                found.normals.unwrap_or_default().into_iter().zip(expected.normals.unwrap_or_default());
            assert!(
                normals.into_iter().all(|(a, b)| near(a.to_array(), b.to_array())),
                "{found:?}, {expected:?}"
            );
            let colours = found.colours.into_iter().zip(expected.colours);
            assert!(colours.into_iter().all(|(a, b)| near(a, b)), "{found:?}, {expected:?}");
        }
    }
}

#[test]
fn placeholders_need_no_bytes() {
    for (file, name) in FILES {
        let expected = load_parts(&parts(file)).unwrap().checksum().to_owned();
        let (mut json, bytes) = parts(file);
        json["extensionsRequired"] = json!([name, "KHR_mesh_quantization"]);
        json["buffers"][1].as_object_mut().unwrap().remove("uri");
        assert_eq!(load_parts(&(json.clone(), bytes.clone())).unwrap().checksum(), expected);
        json["buffers"][1]["uri"] = json!("absent.bin");
        json["buffers"][1]["extensions"] = json!({name: {"fallback": true}});
        assert_eq!(load_parts(&(json, bytes)).unwrap().checksum(), expected);
    }
}

/// Views that are used only by animations and unused accessors may have an unknown format.
#[test]
fn unused_views_are_not_decoded() {
    let (file, name) = FILES[0];
    let (mut json, bytes) = parts(file);
    let mut view = json["bufferViews"][0].clone();
    view["extensions"][name]["mode"] = json!("TOMORROW");
    json["bufferViews"].as_array_mut().unwrap().push(view);
    assert!(load_parts(&(json, bytes)).is_ok());
}

#[test]
fn impossible_streams_are_refused() {
    type Change = fn(&mut Value, &str);
    let cases: [(&str, Change); 10] = [
        ("unknown variant", |json, name| extension(json, 0, name)["mode"] = json!("TOMORROW")),
        ("unknown variant", |json, name| extension(json, 1, name)["filter"] = json!("TOMORROW")),
        ("missing field", |json, name| {
            extension(json, 0, name).as_object_mut().unwrap().remove("count");
        }),
        ("do not go with", |json, name| extension(json, 0, name)["byteStride"] = json!(6)),
        ("the buffer view has 3072", |json, name| extension(json, 0, name)["count"] = json!(383)),
        ("do not go with", |json, name| extension(json, 0, name)["mode"] = json!("INDICES")),
        ("damaged", |json, name| extension(json, 4, name)["mode"] = json!("INDICES")),
        ("damaged", |json, name| {
            let length = extension(json, 0, name)["byteLength"].as_u64().unwrap();
            extension(json, 0, name)["byteLength"] = json!(length - 1);
        }),
        ("beyond its buffer", |json, name| extension(json, 0, name)["byteOffset"] = json!(1_000_000)),
        ("do not fit", |json, name| {
            extension(json, 0, name)["count"] = json!(1_u64 << 28);
            json["bufferViews"][0]["byteLength"] = json!(8_u64 << 28);
        }),
    ];
    for (file, name) in FILES {
        for (part, change) in &cases {
            let (mut json, bytes) = parts(file);
            // The view's own stride is removed, because it would be refused before the stride or mode that
            // the test changes in the extension.
            json["bufferViews"][0].as_object_mut().unwrap().remove("byteStride");
            change(&mut json, name);
            let Err(error) = load_parts(&(json, bytes)) else { panic!("{part} was loaded") };
            let text = error.to_string();
            assert!(text.contains(part), "{part}: {text}");
            assert!(text.contains(name), "{text}");
            assert!(error.help().is_some());
        }
    }
}
