//! Default views: closed rooms are seen from inside, other scenes from the front.

use glam::Vec3;
use photoncard_scene::Scene;
use serde_json::json;

use crate::support::{Extended, push};

/// Box of 6 x 3 x 4 m without the sides `open`. Its faces look inwards or outwards; lamps are at `lamps`.
fn room(open: &[usize], faces_inwards: bool, double_sided: bool, lamps: &[[f32; 3]]) -> Scene {
    let size = Vec3::new(6.0, 3.0, 4.0);
    let mut scene = Extended::new();
    let mut corners = Vec::new();
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let number = 2 * axis + side as usize;
            let corner = |a: f32, b: f32| {
                let mut place = [0.0; 3];
                (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, a, b);
                (Vec3::from(place) * size).to_array()
            };
            let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            // The corners are counter-clockwise seen from greater coordinates.
            let faces_up = (side == 0.0) == faces_inwards;
            let quadrilateral = if faces_up { [a, b, c, a, c, d] } else { [c, b, a, d, c, a] };
            corners.extend(quadrilateral.into_iter().filter(|_| !open.contains(&number)));
        }
    }
    let positions = scene.floats("VEC3", &corners);
    *scene.primitive() = json!({"attributes": {"POSITION": positions}, "material": 0});
    scene.json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    scene.json["materials"][0]["doubleSided"] = json!(double_sided);
    scene.json["nodes"] = json!([{"mesh": 0}]);
    scene.json["scenes"] = json!([{"nodes": [0]}]);
    scene.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    for lamp in lamps {
        let light = json!({"KHR_lights_punctual": {"light": 0}});
        let node = push(&mut scene.json, "nodes", json!({"translation": lamp, "extensions": light}));
        push(&mut scene.json["scenes"][0], "nodes", json!(node));
    }
    scene.load().unwrap()
}

const INSIDE: [f32; 3] = [3.0, 2.5, 2.0];
const OUTSIDE: [f32; 3] = [3.0, 9.0, 2.0];

#[test]
fn a_closed_room_with_a_lamp_is_seen_from_inside_along_its_length() {
    for (faces_inwards, double_sided) in [(true, false), (true, true), (false, true)] {
        let scene = room(&[], faces_inwards, double_sided, &[INSIDE]);
        let camera = scene.camera(None).unwrap();
        let (low, high) = scene.bounds();
        assert!(camera.origin.cmpgt(low).all() && camera.origin.cmplt(high).all(), "{camera:?}");
        assert!(camera.origin.distance(Vec3::new(5.76, 1.5, 2.0)) < 1e-3, "{camera:?}");
        assert_eq!((camera.forward, camera.up), (Vec3::NEG_X, Vec3::Y));
        assert!((camera.right.cross(camera.up) + camera.forward).length() < 1e-6, "{camera:?}");
        assert!(scene.notices[0].contains("from inside"), "{:?}", scene.notices);
    }
}

#[test]
fn scenes_that_are_no_closed_room_are_seen_from_the_front() {
    for (scene, what) in [
        (room(&[], false, false, &[INSIDE]), "walls from behind"),
        (room(&[], true, true, &[OUTSIDE]), "a box under a lamp"),
        (room(&[], true, true, &[]), "a box without a lamp"),
        (room(&[5], true, false, &[INSIDE]), "a stage"),
        (room(&[3], false, true, &[INSIDE]), "a box without a lid"),
    ] {
        let camera = scene.camera(None).unwrap();
        assert!(camera.origin.z > 4.0 && camera.forward == Vec3::NEG_Z, "{what}: {camera:?}");
        assert!(scene.notices[0].contains("from the front"), "{what}: {:?}", scene.notices);
    }
}
