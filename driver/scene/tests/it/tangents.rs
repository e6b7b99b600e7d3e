//! Tangents of normal maps belong to the right corners, whether they are stated or computed.

use glam::{Vec3, Vec4};
use miette::Diagnostic;
use photoncard_scene::{NO_TANGENTS, Scene};
use serde_json::{Value, json};

use crate::support::Extended;

const FRONT: [[f32; 3]; 3] = [[0.0, 0.0, 1.0]; 3];

/// File of the triangle (0, 0), (1, 0), (0, 1) in the plane z = 0 with a normal map and these texture
/// coordinates. `normals` are optional.
fn mapped(coordinates: [[f32; 2]; 3], normals: Option<[[f32; 3]; 3]>) -> Extended {
    let mut scene = Extended::new();
    let texel = scene.view(include_bytes!("images/texel.png"));
    scene.json["images"] = json!([{"bufferView": texel, "mimeType": "image/png"}]);
    scene.json["textures"] = json!([{"source": 0}]);
    scene.json["materials"][0]["normalTexture"] = json!({"index": 0});
    let coordinates = scene.floats("VEC2", &coordinates);
    scene.primitive()["attributes"]["TEXCOORD_0"] = json!(coordinates);
    if let Some(normals) = normals {
        let normals = scene.floats("VEC3", &normals);
        scene.primitive()["attributes"]["NORMAL"] = json!(normals);
    }
    scene
}

/// Texture coordinates as in a picture: u to the right, v downwards.
const UPRIGHT: [[f32; 2]; 3] = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]];
/// Mirrored texture coordinates: u to the left.
const MIRRORED: [[f32; 2]; 3] = [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]];

fn with_tangents(mut scene: Extended, tangents: [[f32; 4]; 3]) -> Extended {
    let tangents = scene.floats("VEC4", &tangents);
    scene.primitive()["attributes"]["TANGENT"] = json!(tangents);
    scene
}

/// Tangents of the only triangle.
fn tangents(scene: &Scene) -> [Vec4; 3] {
    let attributes = scene.attributes[scene.triangles[0].attributes as usize];
    scene.tangents[attributes.tangents as usize]
}

fn loaded(scene: &Extended, change: impl FnOnce(&mut Value)) -> Scene {
    let mut scene = Extended { json: scene.json.clone(), bytes: scene.bytes.clone() };
    change(&mut scene.json);
    scene.load().unwrap()
}

fn close(found: [Vec4; 3], expected: Vec4) {
    for found in found {
        assert!(found.distance(expected) < 1e-6, "{found} is not {expected}");
    }
}

#[test]
fn stated_and_computed_tangents_are_alike() {
    for (coordinates, tangent) in [(UPRIGHT, [1.0, 0.0, 0.0, 1.0]), (MIRRORED, [-1.0, 0.0, 0.0, -1.0])] {
        // Without normals stated tangents are ignored, and computed all the same.
        let wrong = with_tangents(mapped(coordinates, None), [[0.0, 1.0, 0.0, 1.0]; 3]);
        let stated = with_tangents(mapped(coordinates, Some(FRONT)), [tangent; 3]);
        for scene in [mapped(coordinates, None), mapped(coordinates, Some(FRONT)), wrong, stated] {
            let scene = scene.load().unwrap();
            close(tangents(&scene), tangent.into());
            assert_eq!(scene.notices, Vec::<String>::new());
        }
    }
    // Stated tangents count, not the texture coordinates.
    let other = with_tangents(mapped(UPRIGHT, Some(FRONT)), [[0.0, 2.0, 0.0, -0.5]; 3]);
    close(tangents(&other.load().unwrap()), Vec4::new(0.0, 1.0, 0.0, -1.0));
}

#[test]
fn tangents_follow_the_node() {
    for scene in
        [mapped(UPRIGHT, Some(FRONT)), with_tangents(mapped(UPRIGHT, Some(FRONT)), [[3.0, 0.0, 0.0, 1.0]; 3])]
    {
        let turned = loaded(&scene, |json| json["nodes"][0]["rotation"] = json!([0.0, 0.6, 0.0, 0.8]));
        // A turn about y by 73.7 degrees.
        close(tangents(&turned), Vec4::new(0.28, 0.0, -0.96, 1.0));
        // In a mirror the cross product of normal and tangent changes its sign.
        let mirrored = loaded(&scene, |json| json["nodes"][0]["scale"] = json!([-2, 1, 1]));
        close(tangents(&mirrored), Vec4::new(-1.0, 0.0, 0.0, -1.0));
    }
}

/// A mirroring transform reverses the order of the corners.
#[test]
fn each_corner_of_a_mirrored_triangle_keeps_its_tangent() {
    let stated = [[1.0, 0.0, 0.0, 1.0], [0.8, 0.6, 0.0, 1.0], [0.6, -0.8, 0.0, 1.0]];
    let scene = with_tangents(mapped(UPRIGHT, Some(FRONT)), stated);
    let scene = loaded(&scene, |json| json["nodes"][0]["scale"] = json!([-1, 1, 1]));
    let [first, second, third] = stated.map(|[x, y, z, w]| Vec4::new(-x, y, z, -w));
    for (found, expected) in tangents(&scene).into_iter().zip([first, third, second]) {
        assert!(found.distance(expected) < 1e-6, "{found} is not {expected}");
    }
}

#[test]
fn tangents_are_perpendicular_to_normals() {
    let normal = [0.6, 0.0, 0.8];
    for scene in [
        mapped(UPRIGHT, Some([normal; 3])),
        with_tangents(mapped(UPRIGHT, Some([normal; 3])), [[1.0, 0.0, 0.0, 1.0]; 3]),
    ] {
        close(tangents(&scene.load().unwrap()), Vec4::new(0.8, 0.0, -0.6, 1.0));
    }
}

#[test]
fn invalid_tangents_are_computed_with_a_notice() {
    for bad in [[0.0; 4], [f32::NAN, 0.0, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]] {
        let good = [0.0, 1.0, 0.0, 1.0];
        let scene = with_tangents(mapped(UPRIGHT, Some(FRONT)), [good, bad, good]).load().unwrap();
        close(tangents(&scene), Vec4::new(1.0, 0.0, 0.0, 1.0));
        let notice =
            "tangents that are zero or not finite are ignored, the mesh's are computed: mesh 'panel'";
        assert_eq!(scene.notices, [notice], "{bad:?}");
    }
}

#[test]
fn a_texture_that_does_not_vary_has_no_tangent() {
    let scene = mapped([[0.5; 2]; 3], None).load().unwrap();
    assert_eq!(tangents(&scene).map(Vec4::truncate), [Vec3::ZERO; 3]);
}

/// `texCoord` of `KHR_texture_transform` selects the set; the transform does not rotate tangents.
#[test]
fn tangents_are_those_of_the_normal_textures_set() {
    let mut scene = mapped(UPRIGHT, Some(FRONT));
    let second = scene.floats("VEC2", &MIRRORED);
    scene.primitive()["attributes"]["TEXCOORD_1"] = json!(second);
    let transformed = |tex_coord: Value| {
        loaded(&scene, |json| {
            json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_texture_transform"));
            json["materials"][0]["normalTexture"]["extensions"] =
                json!({"KHR_texture_transform": {"rotation": 1.0, "texCoord": tex_coord}});
        })
    };
    close(tangents(&transformed(json!(0))), Vec4::new(1.0, 0.0, 0.0, 1.0));
    close(tangents(&transformed(json!(1))), Vec4::new(-1.0, 0.0, 0.0, -1.0));
    // A coat's map has tangents of its own set where the base has no map.
    let coat = |json: &mut Value| {
        let material = json["materials"][0].as_object_mut().unwrap();
        let mut texture = material.remove("normalTexture").unwrap();
        texture["texCoord"] = json!(1);
        material["extensions"] = json!({"KHR_materials_clearcoat":
            {"clearcoatFactor": 1.0, "clearcoatNormalTexture": texture}});
    };
    close(tangents(&loaded(&scene, coat)), Vec4::new(-1.0, 0.0, 0.0, -1.0));
}

#[test]
fn surfaces_without_normal_maps_have_no_tangents() {
    let scene = with_tangents(mapped(UPRIGHT, Some(FRONT)), [[0.0; 4]; 3]);
    let scene = loaded(&scene, |json| {
        let material = json["materials"][0].as_object_mut().unwrap();
        let texture = material.remove("normalTexture").unwrap();
        material["pbrMetallicRoughness"]["baseColorTexture"] = texture;
    });
    assert_eq!((scene.attributes[0].tangents, scene.tangents.len()), (NO_TANGENTS, 0));
    assert_eq!(scene.notices, Vec::<String>::new());
}

#[test]
fn tangents_that_do_not_fit_are_refused() {
    let mut short = mapped(UPRIGHT, Some(FRONT));
    let accessor = short.floats("VEC4", &[[1.0, 0.0, 0.0, 1.0]; 2]);
    short.primitive()["attributes"]["TANGENT"] = json!(accessor);
    let mut narrow = mapped(UPRIGHT, Some(FRONT));
    let accessor = narrow.floats("VEC3", &[[1.0, 0.0, 0.0]; 3]);
    narrow.primitive()["attributes"]["TANGENT"] = json!(accessor);
    let mut absent = mapped(UPRIGHT, Some(FRONT));
    absent.primitive()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    for (scene, part) in [
        (short, "meshes[0].primitives[0].attributes.TANGENT: there are 2 of them, and 3 positions"),
        (narrow, "meshes[0].primitives[0].attributes.TANGENT"),
        (absent, "a texture that takes TEXCOORD_0, which is not there"),
    ] {
        let error = scene.load().unwrap_err();
        assert!(error.to_string().contains(part), "{part}: {error}");
        assert!(error.help().is_some_and(|help| !help.to_string().is_empty()));
    }
}
