//! Primitives compressed by Draco equal the output of the reference decoder; damaged and impossible ones are
//! refused.
//!
//! Both files are encoded by draco3dgltf 1.5.7, one by Edgebreaker and one sequentially. The file beside each
//! is the output of the package's own decoder: a wave of 4 x 3 squares with a seam of texture coordinates,
//! colours, two bones and tangents.

use std::collections::BTreeSet;

use miette::Diagnostic;
use photoncard_scene::error::SceneError;
use serde_json::{Value, json};

use crate::support::{load_parts, parts};

const NAME: &str = "KHR_draco_mesh_compression";

/// Compressed files, each with the output of the reference decoder.
const FILES: [[&[u8]; 2]; 2] = [
    [
        include_bytes!("compressed/draco-edgebreaker.glb"),
        include_bytes!("compressed/draco-edgebreaker-reference.glb"),
    ],
    [
        include_bytes!("compressed/draco-sequential.glb"),
        include_bytes!("compressed/draco-sequential-reference.glb"),
    ],
];

const TRIANGLES: usize = 24;
const VERTICES: u64 = 24;

fn primitive(json: &mut Value) -> &mut Value {
    &mut json["meshes"][0]["primitives"][0]
}

fn extension(json: &mut Value) -> &mut Value {
    &mut primitive(json)["extensions"][NAME]
}

fn accessor<'v>(json: &'v mut Value, name: &str) -> &'v mut Value {
    let index = primitive(json)["attributes"][name].as_u64().unwrap() as usize;
    &mut json["accessors"][index]
}

/// Range of the stream in the binary chunk.
fn stream(json: &Value) -> std::ops::Range<usize> {
    let view = &json["bufferViews"][0];
    let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
    start..start + length
}

#[test]
fn compressed_primitives_hold_what_the_reference_decoder_finds() {
    for [file, reference] in FILES {
        let compressed = load_parts(&parts(file)).unwrap();
        assert!(
            compressed.notices.iter().all(|notice| notice.contains("camera")),
            "{:?}",
            compressed.notices
        );
        let reference = load_parts(&parts(reference)).unwrap();
        assert_eq!((reference.triangles.len(), reference.tangents.len()), (TRIANGLES, TRIANGLES));
        assert_eq!(compressed.triangles, reference.triangles);
        assert_eq!(compressed.attributes, reference.attributes);
        assert_eq!(compressed.checksum(), reference.checksum());
    }
}

#[test]
fn vertices_are_those_of_the_wave_within_the_quantisation() {
    for [file, _] in FILES {
        let (mut json, bytes) = parts(file);
        json["nodes"][0].as_object_mut().unwrap().remove("skin");
        let scene = load_parts(&(json, bytes)).unwrap();
        // Positions have 14 bits for 4 m; the colours are not quantised.
        let tolerance = 4.0 / 16_384.0;
        let mut squares = BTreeSet::new();
        for triangle in &scene.triangles {
            let attributes = &scene.attributes[triangle.attributes as usize];
            for (vertex, colour) in triangle.vertices.iter().zip(attributes.colours) {
                let (x, y) = (vertex.x.round(), vertex.y.round());
                let expected = glam::Vec3::new(x, y, 0.25 * ((x * x + y) % 3.0));
                assert!(vertex.distance(expected) <= tolerance, "{vertex}, {expected}");
                let channels = [50.0 * x, 60.0 * y, 255.0 - 40.0 * x, 255.0].map(|channel| channel / 255.0);
                assert_eq!(colour, channels);
            }
            let middle = triangle.vertices.iter().sum::<glam::Vec3>() / 3.0;
            let side = middle.x.fract() + middle.y.fract() > 1.0;
            squares.insert((middle.x as u32, middle.y as u32, side));
        }
        assert_eq!(squares.len(), TRIANGLES);
    }
}

#[test]
fn strips_are_compressed_as_their_triangles() {
    for [file, _] in FILES {
        let expected = load_parts(&parts(file)).unwrap().checksum().to_owned();
        // The second count has two triangles of zero area, which the stream does not have.
        for corners in [TRIANGLES + 2, TRIANGLES + 4] {
            let (mut json, bytes) = parts(file);
            primitive(&mut json)["mode"] = json!(5);
            json["accessors"][0]["count"] = json!(corners);
            assert_eq!(load_parts(&(json, bytes)).unwrap().checksum(), expected);
        }
    }
}

/// Attributes that the extension does not name are read from their accessors, in the order of the stream's
/// vertices. Compressed attributes may have an uncompressed fallback, which is ignored.
#[test]
fn attributes_beside_the_stream_are_read() {
    for [file, reference] in FILES {
        let expected = load_parts(&parts(reference)).unwrap().checksum().to_owned();
        let (mut json, mut bytes) = parts(reference);
        let (compressed, streams) = parts(file);
        let mut view = compressed["bufferViews"][0].clone();
        view["byteOffset"] = json!(bytes.len());
        bytes.extend(&streams[stream(&compressed)]);
        json["buffers"][0]["byteLength"] = json!(bytes.len());
        let index = crate::support::push(&mut json, "bufferViews", view);
        *primitive(&mut json) = compressed["meshes"][0]["primitives"][0].clone();
        extension(&mut json)["bufferView"] = json!(index);
        for name in ["COLOR_0", "NORMAL"] {
            extension(&mut json)["attributes"].as_object_mut().unwrap().remove(name);
        }
        // The uncompressed positions are changed, because they are not read.
        let positions = accessor(&mut json, "POSITION")["bufferView"].as_u64().unwrap() as usize;
        let start = json["bufferViews"][positions]["byteOffset"].as_u64().unwrap() as usize;
        bytes[start..start + 12].fill(0x55);
        assert_eq!(load_parts(&(json, bytes)).unwrap().checksum(), expected);
    }
}

#[test]
fn impossible_streams_are_refused() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 16] = [
        ("missing field", |json| {
            extension(json).as_object_mut().unwrap().remove("bufferView");
        }),
        ("invalid type", |json| extension(json)["attributes"]["NORMAL"] = json!("normals")),
        ("buffer view 99 does not exist", |json| extension(json)["bufferView"] = json!(99)),
        ("beyond its buffer", |json| json["bufferViews"][0]["byteOffset"] = json!(1_000_000)),
        ("damaged", |json| {
            json["bufferViews"][0]["byteOffset"] = json!(4);
            json["bufferViews"][0]["byteLength"] = json!(100);
        }),
        ("attributes.NORMAL: its stream has no attribute 77", |json| {
            extension(json)["attributes"]["NORMAL"] = json!(77);
        }),
        ("2 components of Float32", |json| {
            let coordinates = extension(json)["attributes"]["TEXCOORD_0"].clone();
            extension(json)["attributes"]["NORMAL"] = coordinates;
        }),
        ("4 components of Uint8", |json| accessor(json, "COLOR_0")["componentType"] = json!(5123)),
        ("24 vertices, and its accessor 23", |json| accessor(json, "NORMAL")["count"] = json!(VERTICES - 1)),
        ("24 vertices, and its accessor 25", |json| {
            accessor(json, "POSITION")["count"] = json!(VERTICES + 1);
        }),
        ("faces", |json| json["accessors"][0]["count"] = json!(3 * (TRIANGLES - 1))),
        ("24 triangles, and the accessor of its indices 25", |json| {
            json["accessors"][0]["count"] = json!(3 * (TRIANGLES + 1));
        }),
        ("no indices", |json| {
            primitive(json).as_object_mut().unwrap().remove("indices");
        }),
        ("a fan", |json| primitive(json)["mode"] = json!(6)),
        ("faces", |json| {
            primitive(json)["mode"] = json!(5);
            json["accessors"][0]["count"] = json!(TRIANGLES + 1);
        }),
        ("more than", |json| accessor(json, "POSITION")["count"] = json!(u64::MAX)),
    ];
    for [file, _] in FILES {
        for (part, change) in &cases {
            let (mut json, bytes) = parts(file);
            change(&mut json);
            let Err(error) = load_parts(&(json, bytes)) else { panic!("{part} was loaded") };
            let text = error.to_string();
            assert!(text.contains(part), "{part}: {text}");
            assert!(text.contains(&format!("meshes[0].primitives[0].extensions.{NAME}")), "{text}");
            assert!(error.help().is_some());
        }
    }
}

#[test]
fn more_triangles_than_any_scene_has_are_refused_before_they_are_decoded() {
    let (mut json, bytes) = parts(FILES[0][0]);
    json["accessors"][0]["count"] = json!(3_u64 << 40);
    let error = load_parts(&(json, bytes)).unwrap_err();
    assert!(matches!(error, SceneError::TooManyTriangles { .. }), "{error}");
}

/// Uses many primitives with one small stream; their accessors claim many vertices.
#[test]
fn the_memory_of_all_primitives_is_bounded_together() {
    let (mut json, bytes) = parts(FILES[0][0]);
    let mut one = primitive(&mut json).clone();
    json["meshes"][0]["primitives"] = json!(vec![one.clone(); 3]);
    assert_eq!(load_parts(&(json.clone(), bytes.clone())).unwrap().triangles.len(), 3 * TRIANGLES);
    // Each primitive takes 0.9 GB, with an attribute that no material uses.
    let count = 12_000_000;
    let accessor = json!({"componentType": 5121, "type": "VEC4", "count": count});
    one["attributes"]["_UNUSED"] = json!(crate::support::push(&mut json, "accessors", accessor));
    one["extensions"][NAME]["attributes"]["_UNUSED"] = json!(77);
    json["meshes"][0]["primitives"] = json!(vec![one; 5]);
    let error = load_parts(&(json, bytes)).unwrap_err().to_string();
    assert!(
        error.contains("primitives[4]") && error.contains("up to this one, of 12000000 vertices"),
        "{error}"
    );
}

/// Tries streams with every third byte changed, in all of its bits or in one, and cut at every third length.
#[test]
fn damaged_streams_are_loaded_or_refused() {
    let load = |json: &Value, bytes: Vec<u8>| {
        let loaded = load_parts(&(json.clone(), bytes));
        loaded.inspect_err(|error| assert!(error.to_string().contains("meshes[0].primitives[0]"), "{error}"))
    };
    for [file, _] in FILES {
        let (json, bytes) = parts(file);
        let mut refused = 0;
        for place in stream(&json).step_by(3) {
            let mut damaged = bytes.clone();
            damaged[place] ^= if place % 2 == 0 { 0xff } else { 0x01 };
            refused += u32::from(load(&json, damaged).is_err());
        }
        assert!(refused > 50, "{refused}");
        for length in (0..stream(&json).len()).step_by(3) {
            let mut json = json.clone();
            json["bufferViews"][0]["byteLength"] = json!(length);
            assert!(load(&json, bytes.clone()).is_err(), "{length} bytes");
        }
    }
}
