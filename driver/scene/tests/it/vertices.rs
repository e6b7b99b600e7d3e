//! Vertex attributes belong to the right corners, in world space.

use glam::{Vec2, Vec3};
use miette::Diagnostic;
use photoncard_scene::{NO_ATTRIBUTES, Scene, Triangle, VertexAttributes};
use serde_json::{Value, json};

use crate::support::{Extended, push};

/// Attributes of the only triangle.
fn attributes(scene: &Scene) -> VertexAttributes {
    assert_eq!(scene.triangles.len(), 1);
    scene.attributes[scene.triangles[0].attributes as usize]
}

fn with_normals(normals: [[f32; 3]; 3], change: impl FnOnce(&mut Value)) -> Scene {
    let mut scene = Extended::new();
    let accessor = scene.floats("VEC3", &normals);
    scene.primitive()["attributes"]["NORMAL"] = json!(accessor);
    change(&mut scene.json);
    scene.load().unwrap()
}

fn close(found: [Vec3; 3], expected: [Vec3; 3]) {
    for (found, expected) in found.into_iter().zip(expected) {
        assert!(found.distance(expected) < 1e-6, "{found} is not {expected}");
    }
}

const TILTED: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]];

#[test]
fn triangles_without_attributes_have_none() {
    let scene = Extended::new().load().unwrap();
    assert_eq!((scene.triangles[0].attributes, scene.attributes.len()), (NO_ATTRIBUTES, 0));
}

#[test]
fn normals_equal_to_the_triangles_are_left_out() {
    let almost = (0.0005_f32).sin();
    for normals in [[[0.0, 0.0, 1.0]; 3], [[0.0, 0.0, 7.0], [almost, 0.0, 1.0], [0.0, -almost, 1.0]]] {
        for scale in [[1, 1, 1], [-1, 1, 1], [2, 3, -1]] {
            let scene = with_normals(normals, |json| json["nodes"][0]["scale"] = json!(scale));
            assert_eq!(scene.triangles[0].attributes, NO_ATTRIBUTES, "{normals:?} {scale:?}");
            assert_eq!(scene.notices, Vec::<String>::new());
        }
    }
}

/// Normals of a sphere that is stretched to an ellipsoid stay perpendicular to the surface.
#[test]
fn normals_are_transformed_by_the_inverse_transposed() {
    let scene = with_normals(TILTED, |json| json["nodes"][0]["scale"] = json!([2, 1, 1]));
    let expected = [Vec3::Z, Vec3::new(0.3, 0.0, 0.8).normalize(), Vec3::new(0.0, 0.6, 0.8)];
    close(attributes(&scene).normals.unwrap(), expected);
}

#[test]
fn a_mirror_reverses_the_corners_with_their_normals() {
    let scene = with_normals(TILTED, |json| json["nodes"][0]["scale"] = json!([-1, 1, 1]));
    assert_eq!(scene.triangles[0].vertices, [Vec3::ZERO, Vec3::Y, -Vec3::X]);
    let expected = [Vec3::Z, Vec3::new(0.0, 0.6, 0.8), Vec3::new(-0.6, 0.0, 0.8)];
    close(attributes(&scene).normals.unwrap(), expected);
}

#[test]
fn normals_that_are_zero_or_on_the_back_become_the_triangles() {
    for bad in [[0.0; 3], [f32::NAN, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0], [0.0, 0.6, -0.8], [1.0, 0.0, 0.0]]
    {
        let scene = with_normals([bad, TILTED[1], TILTED[2]], |_| {});
        let expected = [Vec3::Z, Vec3::from(TILTED[1]), Vec3::from(TILTED[2])];
        close(attributes(&scene).normals.unwrap(), expected);
    }
}

#[test]
fn normals_and_colours_that_are_not_finite_are_noticed() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let scene = with_normals([[bad, 0.0, 1.0], TILTED[1], TILTED[2]], |_| {});
        let notice = "normals that are not finite are ignored, the triangles' own count: mesh 'panel'";
        assert_eq!(scene.notices, [notice], "{bad}");
        let mut scene = Extended::new();
        let accessor = scene.floats("VEC3", &[[0.5, 0.5, 0.5], [0.5, bad, 0.5], [0.5, 0.5, 0.5]]);
        scene.primitive()["attributes"]["COLOR_0"] = json!(accessor);
        let scene = scene.load().unwrap();
        let notice = "vertex colours that are not finite are 0, or 1 if infinite: mesh 'panel'";
        assert_eq!(scene.notices, [notice], "{bad}");
        let expected = if bad == f32::INFINITY { 1.0 } else { 0.0 };
        assert_eq!(attributes(&scene).colours[1][1], expected, "{bad}");
    }
}

#[test]
fn colours_of_every_format_are_linear_rgba() {
    let shorts: Vec<u8> = [65_535_u16, 0, 13_107].repeat(3).iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut cases: Vec<(Extended, usize, [f32; 4])> = Vec::new();
    let mut add = |found: &dyn Fn(&mut Extended) -> usize, expected| {
        let mut scene = Extended::new();
        let accessor = found(&mut scene);
        cases.push((scene, accessor, expected));
    };
    add(&|scene| scene.floats("VEC3", &[[0.5, 0.25, 1.0]; 3]), [0.5, 0.25, 1.0, 1.0]);
    add(&|scene| scene.floats("VEC4", &[[2.0, -1.0, 1e9, 0.5]; 3]), [1.0, 0.0, 1.0, 0.5]);
    add(&|scene| scene.accessor("VEC4", 5121, 3, &[255, 0, 51, 102].repeat(3)), [1.0, 0.0, 0.2, 0.4]);
    // Elements of six bytes without a stride are tightly packed, not padded to a multiple of four.
    add(&|scene| scene.accessor("VEC3", 5123, 3, &shorts), [1.0, 0.0, 0.2, 1.0]);
    for (mut scene, accessor, expected) in cases {
        scene.primitive()["attributes"]["COLOR_0"] = json!(accessor);
        let scene = scene.load().unwrap();
        assert_eq!(attributes(&scene), VertexAttributes { colours: [expected; 3], ..VertexAttributes::NONE });
        assert_eq!(scene.notices, Vec::<String>::new());
    }
    let mut white = Extended::new();
    let accessor = white.floats("VEC4", &[[1.0; 4]; 3]);
    white.primitive()["attributes"]["COLOR_0"] = json!(accessor);
    assert_eq!(white.load().unwrap().triangles[0].attributes, NO_ATTRIBUTES);
}

/// A square of two triangles is stated as a list, a strip and a fan. Its triangles face +z and cover it.
#[test]
fn lists_strips_and_fans_give_the_same_square() {
    let (a, b, c, d) = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
    let cases: [(u32, &[[f32; 3]]); 3] = [(4, &[a, b, c, a, c, d]), (5, &[a, b, d, c]), (6, &[a, b, c, d])];
    for (mode, vertices) in cases {
        let mut scene = Extended::new();
        let positions = scene.floats("VEC3", vertices);
        *scene.primitive() = json!({"attributes": {"POSITION": positions}, "mode": mode, "material": 0});
        let scene = scene.load().unwrap();
        assert_eq!(scene.triangles.len(), 2, "{mode}");
        let normals = scene.triangles.iter().map(Triangle::scaled_normal);
        assert_eq!(normals.collect::<Vec<_>>(), [Vec3::Z; 2], "{mode}");
        assert_eq!(scene.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
        assert_eq!(scene.notices, Vec::<String>::new());
    }
}

#[test]
fn instances_are_placed_by_translation_rotation_and_scale() {
    let mut scene = Extended::new();
    let translation = scene.floats("VEC3", &[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]);
    let scale = scene.floats("VEC3", &[[1.0; 3], [2.0; 3]]);
    // A quarter turn about z in normalised shorts.
    let half = (0.5_f32.sqrt() * 32_767.0).round() as i16;
    let turns: Vec<u8> =
        [0, 0, 0, i16::MAX, 0, 0, half, half].iter().flat_map(|value| value.to_le_bytes()).collect();
    let rotation = scene.accessor("VEC4", 5122, 2, &turns);
    scene.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    scene.json["nodes"][0]["translation"] = json!([0, 1, 0]);
    scene.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {
        "attributes": {"TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": 0}
    }});
    let scene = scene.load().unwrap();
    let places: Vec<_> = scene.triangles.iter().map(|triangle| triangle.vertices).collect();
    close(places[0], [Vec3::Y, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 2.0, 0.0)]);
    close(places[1], [Vec3::new(5.0, 1.0, 0.0), Vec3::new(5.0, 3.0, 0.0), Vec3::new(3.0, 1.0, 0.0)]);
    assert_eq!(scene.notices, Vec::<String>::new());
}

/// The loader skips the list of instances of a mesh without triangles, because many nodes can share a long
/// list. The test's rotations are zero, so that reading the list would be an error.
#[test]
fn instances_of_points_are_not_traversed() {
    let mut scene = Extended::new();
    let instances =
        push(&mut scene.json, "accessors", json!({"componentType": 5126, "count": 1 << 24, "type": "VEC4"}));
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": instances}}});
    let mut points = scene.primitive().clone();
    points["mode"] = json!(0);
    let points = push(&mut scene.json, "meshes", json!({"name": "dust", "primitives": [points]}));
    for _ in 0..1000 {
        let node = push(&mut scene.json, "nodes", json!({"mesh": points, "extensions": extension}));
        scene.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    assert_eq!(scene.load().unwrap().triangles.len(), 1);
    scene.json["nodes"][0]["extensions"] = extension;
    assert!(scene.load().unwrap_err().to_string().contains("more than 16777216 triangles"));
    scene.json["accessors"][instances]["count"] = json!(2);
    assert!(scene.load().unwrap_err().to_string().contains("zero rotation"));
}

/// File with two joints: one at rest, the other moved by 3 along x. The bind pose of the latter is at x = 1.
fn skinned(weights: [[f32; 4]; 3]) -> Extended {
    let mut scene = Extended::new();
    let joints = scene.accessor("VEC4", 5121, 3, &[0, 1, 0, 0].repeat(3));
    let weights = scene.floats("VEC4", &weights);
    let mut bind = [[0.0; 16]; 2];
    for matrix in &mut bind {
        [0, 5, 10, 15].into_iter().for_each(|place| matrix[place] = 1.0);
    }
    bind[1][12] = -1.0;
    let inverse = scene.floats("MAT4", &bind);
    scene.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    scene.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    scene.json["skins"] = json!([{"joints": [2, 3], "inverseBindMatrices": inverse}]);
    scene.json["nodes"][0]["skin"] = json!(0);
    // The node's own transform is ignored.
    scene.json["nodes"][0]["translation"] = json!([100, 0, 0]);
    let nodes = scene.json["nodes"].as_array_mut().unwrap();
    nodes.push(json!({"children": [3]}));
    nodes.push(json!({"translation": [4, 0, 0]}));
    scene.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    scene
}

#[test]
fn a_skin_moves_vertices_with_their_joints() {
    let scene = skinned([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]]).load().unwrap();
    close(scene.triangles[0].vertices, [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(1.5, 1.0, 0.0)]);
    assert_eq!(scene.notices, Vec::<String>::new());
}

#[test]
fn bad_skins_are_refused() {
    let weights = [[1.0, 0.0, 0.0, 0.0]; 3];
    let mut absent = skinned(weights);
    absent.json["scenes"][0]["nodes"] = json!([0, 1]);
    let mut few = skinned(weights);
    few.json["skins"][0]["joints"] = json!([2]);
    let mut matrices = skinned(weights);
    matrices.json["skins"][0]["joints"] = json!([2, 3, 2]);
    let negative = skinned([[-1.0, 0.0, 0.0, 0.0]; 3]);
    for (scene, part) in [
        (absent, "skins[0].joints[0]"),
        (few, "joint 1 of skins[0]"),
        (matrices, "skins[0].inverseBindMatrices"),
        (negative, "weight of -1"),
    ] {
        let error = scene.load().unwrap_err();
        assert!(error.to_string().contains(part), "{part}: {error}");
        assert!(error.help().is_some());
    }
}

#[test]
fn quantised_vertices_are_read_where_the_extension_allows_them() {
    let mut scene = Extended::new();
    let shorts: Vec<u8> =
        [0, 0, 0, 0, 3, 0, 0, 0, 0, 3, 0, 0].iter().flat_map(|v: &i16| v.to_le_bytes()).collect();
    let positions = scene.accessor("VEC3", 5122, 3, &shorts);
    let view = scene.json["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
    scene.json["bufferViews"][view]["byteStride"] = json!(8);
    scene.primitive()["attributes"]["POSITION"] = json!(positions);
    let refused = scene.load().unwrap_err().to_string();
    assert!(refused.contains("POSITION"), "{refused}");
    scene.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert_eq!(scene.load().unwrap().triangles[0].vertices, [Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0]);
}

/// Uses normalised and plain integers of all types that `KHR_mesh_quantization` allows, in all attributes
/// that it extends.
#[test]
fn quantised_attributes_mean_what_their_type_says() {
    // The greatest value of each type, as bytes, and its meaning once normalised.
    let types: [(u32, &[u8], f32); 4] = [
        (5120, &[127], 127.0),
        (5121, &[255], 255.0),
        (5122, &[255, 127], 32_767.0),
        (5123, &[255, 255], 65_535.0),
    ];
    for (component, greatest, whole) in types {
        for is_normalized in [false, true] {
            let zero = vec![0; greatest.len()];
            let rows = |width: usize, filled: [&[usize]; 3]| -> Vec<u8> {
                let row = |places: &[usize]| -> Vec<u8> {
                    let value = |at: usize| if places.contains(&at) { greatest } else { &zero };
                    let mut row: Vec<u8> = (0..width).flat_map(value).copied().collect();
                    row.resize(8, 0);
                    row
                };
                filled.into_iter().flat_map(row).collect()
            };
            let mut scene = Extended::new();
            scene.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
            let mut add = |name: &str, kind: &str, bytes: Vec<u8>| {
                let accessor = scene.accessor(kind, component, 3, &bytes);
                scene.json["accessors"][accessor]["normalized"] = json!(is_normalized || name == "NORMAL");
                let view = scene.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
                scene.json["bufferViews"][view]["byteStride"] = json!(8);
                scene.primitive()["attributes"][name] = json!(accessor);
            };
            add("POSITION", "VEC3", rows(3, [&[], &[0], &[1]]));
            add("NORMAL", "VEC3", rows(3, [&[0, 2], &[2], &[2]]));
            add("TEXCOORD_0", "VEC2", rows(2, [&[], &[0], &[1]]));
            let texel = scene.view(include_bytes!("images/texel.png"));
            scene.json["images"] = json!([{"bufferView": texel, "mimeType": "image/png"}]);
            scene.json["textures"] = json!([{"source": 0}]);
            scene.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
            let scene = scene.load().unwrap();
            let one = if is_normalized { 1.0 } else { whole };
            assert_eq!(
                scene.triangles[0].vertices,
                [Vec3::ZERO, Vec3::X * one, Vec3::Y * one],
                "{component}"
            );
            let found = attributes(&scene);
            assert_eq!(found.coordinates[0], [Vec2::ZERO, Vec2::X * one, Vec2::Y * one], "{component}");
            let slanted = Vec3::new(1.0, 0.0, 1.0).normalize();
            assert!(found.normals.unwrap()[0].distance(slanted) < 1e-6, "{component}: {found:?}");
        }
    }
}

#[test]
fn attributes_that_do_not_fit_are_refused() {
    type Change = fn(&mut Extended);
    let cases: [(&str, Change); 3] = [
        ("attributes.NORMAL: there are 2", |scene| {
            let accessor = scene.floats("VEC3", &[[0.0, 0.0, 1.0]; 2]);
            scene.primitive()["attributes"]["NORMAL"] = json!(accessor);
        }),
        ("attributes.COLOR_0", |scene| {
            let accessor = scene.floats("VEC2", &[[0.0; 2]; 3]);
            scene.primitive()["attributes"]["COLOR_0"] = json!(accessor);
        }),
        ("EXT_mesh_gpu_instancing", |scene| {
            let (one, two) = (scene.floats("VEC3", &[[0.0; 3]]), scene.floats("VEC3", &[[1.0; 3]; 2]));
            scene.json["nodes"][0]["extensions"] =
                json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": one, "SCALE": two}}});
        }),
    ];
    for (part, change) in cases {
        let mut scene = Extended::new();
        change(&mut scene);
        let error = scene.load().unwrap_err();
        assert!(error.to_string().contains(part), "{part}: {error}");
        assert!(error.help().is_some());
    }
}

#[test]
fn vertices_that_make_no_whole_triangle_are_ignored() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0; 3], [3.0; 3]];
    for (mode, count, triangles) in
        [(4, 5, Some(1)), (4, 3, Some(1)), (5, 4, Some(2)), (4, 2, None), (6, 2, None)]
    {
        let mut scene = Extended::new();
        let accessor = scene.floats("VEC3", &corners[..count]);
        *scene.primitive() = json!({"attributes": {"POSITION": accessor}, "mode": mode});
        let loaded = scene.load();
        let found = loaded.as_ref().ok().map(|scene| scene.triangles.len());
        assert_eq!(found, triangles, "{mode}, {count}");
        let is_told = loaded.is_ok_and(|scene| scene.notices.concat().contains("no whole triangle"));
        assert_eq!(is_told, (mode, count) == (4, 5), "{mode}, {count}");
    }
}

/// Only sets of texture coordinates that a texture uses are loaded.
#[test]
fn texture_coordinates_are_those_of_the_sets_in_use() {
    let shorts: Vec<u8> =
        [0, 0, 65_535_u16, 0, 0, 13_107].iter().flat_map(|value| value.to_le_bytes()).collect();
    let mut scene = Extended::new();
    let first = scene.floats("VEC2", &[[0.0, 0.0], [1.5, 0.0], [0.0, -2.0]]);
    let second = scene.accessor("VEC2", 5123, 3, &shorts);
    scene.primitive()["attributes"]["TEXCOORD_0"] = json!(first);
    scene.primitive()["attributes"]["TEXCOORD_1"] = json!(second);
    assert_eq!(scene.load().unwrap().triangles[0].attributes, NO_ATTRIBUTES);

    let texel = scene.view(include_bytes!("images/texel.png"));
    scene.json["images"] = json!([{"bufferView": texel, "mimeType": "image/png"}]);
    scene.json["textures"] = json!([{"source": 0}]);
    let pbr = &mut scene.json["materials"][0]["pbrMetallicRoughness"];
    pbr["baseColorTexture"] = json!({"index": 0});
    let base = [Vec2::ZERO, Vec2::new(1.5, 0.0), Vec2::new(0.0, -2.0)];
    assert_eq!(attributes(&scene.load().unwrap()).coordinates, [base, [Vec2::ZERO; 3]]);

    scene.json["materials"][0]["emissiveTexture"] = json!({"index": 0, "texCoord": 1});
    let emissive = [Vec2::ZERO, Vec2::X, Vec2::new(0.0, 0.2)];
    assert_eq!(attributes(&scene.load().unwrap()).coordinates, [base, emissive]);
}
