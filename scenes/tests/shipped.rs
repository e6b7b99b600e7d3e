//! Tests that the shipped scenes equal the generators' output, and are valid.

use std::fs;
use std::path::Path;

use base64::Engine;
use glam::{Mat4, Vec3};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use gltf::{Gltf, Node, Primitive};

/// Name, range of the number of triangles, and cameras of each scene.
const EXPECTED: [(&str, std::ops::RangeInclusive<usize>, &[&str]); 12] = [
    ("cornell.gltf", 36..=36, &["camera"]),
    ("cornell-glossy.gltf", 36..=36, &["camera", "floor"]),
    ("cornell-uplight.gltf", 46..=46, &["camera"]),
    ("cornell-spheres.glb", 40_972..=40_972, &["camera"]),
    ("cornell-moving.glb", 102..=102, &["camera"]),
    ("furnace.gltf", 12..=12, &["camera"]),
    ("atrium.glb", 60_000..=150_000, &["court", "gallery"]),
    ("atrium-walk.glb", 60_000..=150_000, &["walk"]),
    ("atrium-open.glb", 60_000..=150_000, &["court", "gallery"]),
    ("room.glb", 1_500..=3_000, &["camera"]),
    ("roughness.glb", 51_206..=51_206, &["camera"]),
    ("house.glb", 158..=158, &["camera"]),
];

fn shipped(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn binary(file: &Gltf) -> Vec<u8> {
    let buffer = file.buffers().next().expect("a buffer");
    match buffer.source() {
        Source::Bin => file.blob.clone().expect("a binary chunk"),
        Source::Uri(uri) => {
            let (_, encoded) = uri.split_once("base64,").expect("a data URI");
            base64::engine::general_purpose::STANDARD.decode(encoded).expect("base64")
        }
    }
}

/// Returns the vertex indices of each triangle of a primitive.
fn joined<'a>(primitive: &Primitive<'_>, indices: &'a [u32]) -> Box<dyn Iterator<Item = [u32; 3]> + 'a> {
    match primitive.mode() {
        Mode::Triangles => Box::new(indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]])),
        Mode::TriangleStrip => Box::new(indices.windows(3).map(|c| [c[0], c[1], c[2]])),
        Mode::TriangleFan => Box::new(indices[1..].windows(2).map(|c| [c[0], c[1], indices[0]])),
        mode => panic!("{mode:?}"),
    }
}

/// Appends the world-space triangles of a node and its descendants to `triangles`.
fn collect(node: &Node<'_>, parent: Mat4, data: &[u8], triangles: &mut Vec<[Vec3; 3]>) {
    let transform = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
    for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
        let reader = primitive.reader(|_| Some(data));
        let place = |position| transform.transform_point3(Vec3::from_array(position));
        let positions: Vec<Vec3> = reader.read_positions().expect("positions").map(place).collect();
        let indices: Vec<u32> = reader
            .read_indices()
            .map_or_else(|| (0..positions.len() as u32).collect(), |indices| indices.into_u32().collect());
        triangles.extend(joined(&primitive, &indices).map(|corners| corners.map(|i| positions[i as usize])));
    }
    for child in node.children() {
        collect(&child, transform, data, triangles);
    }
}

fn triangles(file: &Gltf) -> Vec<[Vec3; 3]> {
    let data = binary(file);
    let mut triangles = Vec::new();
    for node in file.default_scene().expect("a scene").nodes() {
        collect(&node, Mat4::IDENTITY, &data, &mut triangles);
    }
    triangles
}

#[test]
fn shipped_files_equal_the_generators_output() {
    let scenes = photoncard_scenes::scenes();
    // One of the files is the sky, which is no scene.
    assert_eq!(scenes.len(), EXPECTED.len() + 1);
    for scene in scenes {
        let same = shipped(scene.name) == scene.bytes;
        assert!(same, "{} differs: run `cargo run -p photoncard-scenes`", scene.name);
    }
}

#[test]
fn scenes_are_valid_and_of_the_expected_size() {
    for (name, range, cameras) in EXPECTED {
        let file = Gltf::from_slice(&shipped(name)).expect(name);
        let count = triangles(&file).len();
        assert!(range.contains(&count), "{name}: {count} triangles");
        let names: Vec<_> = file.cameras().filter_map(|camera| camera.name()).collect();
        assert_eq!(names, cameras, "{name}");
    }
}

#[test]
fn no_triangle_is_degenerate() {
    for (name, ..) in EXPECTED {
        let file = Gltf::from_slice(&shipped(name)).expect(name);
        for [a, b, c] in triangles(&file) {
            let doubled = (b - a).cross(c - a).length();
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            let height = doubled / longest;
            assert!(height > 1e-3, "{name}: {a} {b} {c} is {height} m high");
            assert!(longest < 200.0 * height, "{name}: {a} {b} {c} is a sliver");
        }
    }
}

#[test]
fn normals_are_of_unit_length_and_on_the_side_of_the_front() {
    for (name, ..) in EXPECTED {
        let file = Gltf::from_slice(&shipped(name)).expect(name);
        let data = binary(&file);
        for primitive in file.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()) {
            let reader = primitive.reader(|_| Some(&data));
            let (Some(normals), Some(indices)) = (reader.read_normals(), reader.read_indices()) else {
                continue;
            };
            let normals: Vec<Vec3> = normals.map(Vec3::from_array).collect();
            let positions: Vec<Vec3> =
                reader.read_positions().expect("positions").map(Vec3::from_array).collect();
            assert!(normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5), "{name}");
            let indices: Vec<u32> = indices.into_u32().collect();
            for corners in joined(&primitive, &indices) {
                let [a, b, c] = corners.map(|index| positions[index as usize]);
                let front = (b - a).cross(c - a);
                let sum: f32 = corners.iter().map(|index| normals[*index as usize].dot(front)).sum();
                assert!(sum > 0.0, "{name}: {a} {b} {c}");
            }
        }
    }
}

#[test]
fn the_atrium_reflects_no_more_than_85_percent() {
    let file = Gltf::from_slice(&shipped("atrium.glb")).expect("atrium.glb");
    for material in file.materials() {
        let [r, g, b, _] = material.pbr_metallic_roughness().base_color_factor();
        assert!(r.max(g).max(b) <= 0.85, "{:?}", material.name());
    }
}
