//! Values between keyframes (glTF 2.0, appendix C).

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};

use super::animated::{Animated, close};

const NODE: usize = 0;
const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

fn translated(by: Vec3) -> [Vec3; 3] {
    CORNERS.map(|corner| corner + by)
}

/// File of a translation whose times and values have exact sums.
fn walk(interpolation: &str) -> Animated {
    let mut scene = Animated::new();
    let animation = scene.animation("walk");
    let keys = [(1.0, [1.0, 0.0, -2.0]), (2.0, [3.0, 1.0, 4.0]), (4.0, [-1.0, 0.5, 0.0])];
    scene.moved(animation, (NODE, "translation"), &keys, interpolation);
    scene
}

#[test]
fn keyframes_are_exact_and_hold_before_the_first_and_after_the_last() {
    for interpolation in ["LINEAR", "STEP"] {
        let scene = walk(interpolation);
        for (seconds, expected) in [
            (-5.0, [1.0, 0.0, -2.0]),
            (0.0, [1.0, 0.0, -2.0]),
            (1.0, [1.0, 0.0, -2.0]),
            (2.0, [3.0, 1.0, 4.0]),
            (4.0, [-1.0, 0.5, 0.0]),
            (1e300, [-1.0, 0.5, 0.0]),
        ] {
            assert_eq!(scene.corners(seconds), translated(expected.into()), "{interpolation} at {seconds}");
        }
    }
}

#[test]
fn linear_values_are_interpolated_by_time() {
    let scene = walk("LINEAR");
    for (seconds, expected) in [(1.5, [2.0, 0.5, 1.0]), (1.25, [1.5, 0.25, -0.5]), (3.0, [1.0, 0.75, 2.0])] {
        assert_eq!(scene.corners(seconds), translated(expected.into()), "at {seconds}");
    }
}

#[test]
fn a_step_holds_until_the_next_keyframe() {
    let scene = walk("STEP");
    for (seconds, expected) in [(1.999, [1.0, 0.0, -2.0]), (3.999, [3.0, 1.0, 4.0])] {
        assert_eq!(scene.corners(seconds), translated(expected.into()), "at {seconds}");
    }
}

#[test]
fn a_single_keyframe_holds_at_all_times() {
    for interpolation in ["LINEAR", "STEP"] {
        let mut scene = Animated::new();
        let animation = scene.animation("still");
        scene.moved(animation, (NODE, "scale"), &[(2.0, [2.0, 4.0, 1.0])], interpolation);
        for seconds in [0.0, 2.0, 3.0] {
            assert_eq!(scene.corners(seconds), [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 4.0]);
        }
    }
}

/// Corners after a rotation about +z by an angle in radians.
fn turned(angle: f64) -> [Vec3; 3] {
    let (sine, cosine) = angle.sin_cos();
    CORNERS.map(|corner| {
        let corner = corner.as_dvec3();
        DVec3::new(cosine * corner.x - sine * corner.y, sine * corner.x + cosine * corner.y, corner.z)
            .as_vec3()
    })
}

/// Quaternion of a rotation about +z by an angle in radians.
fn about_z(angle: f64) -> [f32; 4] {
    let (sine, cosine) = (0.5 * angle).sin_cos();
    [0.0, 0.0, sine as f32, cosine as f32]
}

#[test]
fn rotations_turn_evenly_along_the_shorter_arc() {
    for (to, whole) in [(FRAC_PI_2, FRAC_PI_2), (1.5 * PI, -FRAC_PI_2), (0.25, 0.25), (1e-9, 0.0)] {
        let mut scene = Animated::new();
        let animation = scene.animation("turn");
        // A quaternion of twice the length is the same rotation.
        let keys = [(0.0, about_z(0.0)), (2.0, about_z(to).map(|part| 2.0 * part))];
        scene.moved(animation, (NODE, "rotation"), &keys, "LINEAR");
        for share in [0.0, 0.125, 0.25, 0.5, 0.875, 1.0] {
            close(scene.corners(2.0 * share), turned(share * whole));
        }
    }
}

#[test]
fn rotations_in_integers_are_normalized() {
    let mut scene = Animated::new();
    let animation = scene.animation("turn");
    let half = (std::f32::consts::FRAC_1_SQRT_2 * 32767.0).round() as i16;
    let rotations = [[0, 0, 0, 32767], [0, 0, half, half]];
    let bytes: Vec<u8> = rotations.as_flattened().iter().flat_map(|part: &i16| part.to_le_bytes()).collect();
    let accessors = [scene.0.floats("SCALAR", &[[0.0], [1.0]]), scene.0.accessor("VEC4", 5122, 2, &bytes)];
    scene.channel(animation, (NODE, "rotation"), accessors, "LINEAR");
    close(scene.corners(0.0), turned(0.0));
    close(scene.corners(0.5), turned(0.25 * PI));
    close(scene.corners(1.0), turned(FRAC_PI_2));
}

/// Pseudo-random number from -1 to 1.
fn random(index: u32) -> f64 {
    let hash = index.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    f64::from((hash ^ (hash >> 15)).wrapping_mul(0x85eb_ca6b)) / f64::from(u32::MAX / 2) - 1.0
}

fn vector(index: u32) -> [f32; 3] {
    [0, 1, 2].map(|axis| random(3 * index + axis) as f32)
}

/// Evaluates a cubic Bezier curve by de Casteljau's algorithm. Its inner control points are a third of the
/// tangents away from the ends.
fn bezier(points: [DVec3; 2], tangents: [DVec3; 2], interval: f64, share: f64) -> DVec3 {
    let [from, to] = points;
    let mut points =
        vec![from, from + tangents[0] * (interval / 3.0), to - tangents[1] * (interval / 3.0), to];
    while points.len() > 1 {
        points = points.windows(2).map(|pair| pair[0].lerp(pair[1], share)).collect();
    }
    points[0]
}

#[test]
fn cubic_splines_are_the_curves_of_their_values_and_tangents() {
    let times = [0.5_f32, 0.75, 3.0];
    // In-tangent, value, out-tangent of each keyframe.
    let values: Vec<[f32; 3]> = (0..9).map(vector).collect();
    let mut scene = Animated::new();
    let animation = scene.animation("curve");
    let accessors = [scene.0.floats("SCALAR", &times.map(|time| [time])), scene.0.floats("VEC3", &values)];
    scene.channel(animation, (NODE, "translation"), accessors, "CUBICSPLINE");
    let exact = |index: usize| Vec3::from(values[index]);
    let value = |index: usize| exact(index).as_dvec3();
    for (seconds, index) in [(0.0, 1), (0.5, 1), (0.75, 4), (3.0, 7), (9.0, 7)] {
        assert_eq!(scene.corners(seconds)[0], exact(index), "at {seconds}");
    }
    for (interval, from) in [(0.25, 0), (2.25, 1)] {
        let points = [value(3 * from + 1), value(3 * from + 4)];
        let tangents = [value(3 * from + 2), value(3 * from + 3)];
        for share in [0.1, 0.25, 0.5, 0.9] {
            let expected = bezier(points, tangents, interval, share).as_vec3();
            close(scene.corners(f64::from(times[from]) + share * interval), translated(expected));
        }
    }
}

#[test]
fn cubic_rotations_are_of_unit_length() {
    let quarter = about_z(FRAC_PI_2);
    let values = [[0.0; 4], about_z(0.0), [0.0; 4], [0.0; 4], quarter, [0.0; 4]];
    let mut scene = Animated::new();
    let animation = scene.animation("turn");
    let accessors = [scene.0.floats("SCALAR", &[[0.0], [1.0]]), scene.0.floats("VEC4", &values)];
    scene.channel(animation, (NODE, "rotation"), accessors, "CUBICSPLINE");
    // At the middle equal tangents cancel: the rotation is the mean of both.
    close(scene.corners(0.5), turned(0.25 * PI));
    let [_, x, _] = scene.corners(0.3);
    assert!((x.length() - 1.0).abs() < 1e-6, "{x}");
}

/// Keyframes may be in an accessor without a buffer view, with sparse elements.
#[test]
fn sparse_values_replace_zeros() {
    let mut scene = Animated::new();
    let animation = scene.animation("jump");
    let times = scene.0.floats("SCALAR", &[[0.0], [1.0], [2.0]]);
    let (indices, values) = (scene.0.view(&[1]), scene.0.view(&[0, 0, 64, 64, 0, 0, 0, 0, 0, 0, 0, 0]));
    let sparse = serde_json::json!({
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values}
    });
    let accessor = serde_json::json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse});
    let output = crate::support::push(scene.json(), "accessors", accessor);
    scene.channel(animation, (NODE, "translation"), [times, output], "LINEAR");
    for (seconds, x) in [(0.0, 0.0), (0.5, 1.5), (1.0, 3.0), (2.0, 0.0)] {
        assert_eq!(scene.corners(seconds), translated(Vec3::X * x), "at {seconds}");
    }
}
