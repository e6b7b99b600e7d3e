//! Cornell box with moving parts: a lamp that swings, a reed that bends at its joints, a block that twists by
//! a morph target, and a camera.

use glam::{Quat, Vec3};

use super::{FRONT, WHITE, add_ceiling_lamp, empty_box};
use crate::builder::{Camera, SceneBuilder};
use crate::document::Node;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::motion::{Between, Track, Values};

/// Time between two keyframes, seconds. All animations have five keyframes; the last equals the first.
const INTERVAL: f32 = 0.5;

/// Geometry of the lamp: position of its pivot, distance from the pivot to its centre, half its side, metres,
/// and its maximum angle, radians.
const PIVOT: Vec3 = Vec3::new(0.0, 0.98, 0.35);
const ROD: f32 = 0.6;
const LAMP: f32 = 0.09;
const SWING: f32 = 0.7;
const LAMP_RADIANCE: [f64; 3] = [4.0, 3.0, 1.7];
/// Intensity of the point light below the lamp, W/sr.
const GLOW: f64 = 0.4;

/// Geometry of the reed: position of its foot, height, half its width, metres, number of segments, and its
/// maximum angles, radians.
const FOOT: Vec3 = Vec3::new(-0.45, -1.0, -0.2);
const HEIGHT: f32 = 1.2;
const REED: f32 = 0.12;
const SEGMENTS: usize = 8;
const BEND: f32 = 0.9;
const TURN: f32 = 0.3;

/// Centre of the block on the floor, and half its side, metres.
const BLOCK: Vec3 = Vec3::new(0.45, -0.7, 0.2);
const SIDE: f32 = 0.3;

/// Returns the box, as a `.glb` file, with two animations: `play` moves lamp, reed and block; `pan` moves the
/// camera.
pub(crate) fn moving() -> Vec<u8> {
    let (mut scene, white) = empty_box(None, add_ceiling_lamp);
    let lamp = add_swinging_lamp(&mut scene);
    let [foot, middle] = add_reed(&mut scene);
    let block = add_block(&mut scene, white);
    let camera = scene.moving_camera("camera", &FRONT);
    let turned = |axis: Vec3, angles: [f32; 5]| {
        let half = angles.map(|angle| 0.5 * angle);
        Values::Rotations(half.map(|half| quaternion(axis, half)).to_vec())
    };
    let track = |node, values, between| Track { node, values, interval: INTERVAL, between };
    let swing = turned(Vec3::Z, [-SWING, 0.0, SWING, 0.0, -SWING]);
    let bend = turned(Vec3::X, [0.0, BEND, 0.0, -BEND, 0.0]);
    let turn = turned(Vec3::Y, [0.0, TURN, 0.0, -TURN, 0.0]);
    let bulge = Values::Weights(vec![0.0, 1.0, 0.5, 1.0, 0.0]);
    let play = [
        track(lamp, swing, Between::Smooth),
        track(foot, turn, Between::Step),
        track(middle, bend, Between::Linear),
        track(block, bulge, Between::Smooth),
    ];
    scene.animation("play", &play);
    let views = [[0.0, 0.0], [0.3, 0.1], [0.0, 0.2], [-0.3, 0.1], [0.0, 0.0]]
        .map(|[x, y]| Camera { eye: FRONT.eye + Vec3::new(x, y, 0.0), ..FRONT });
    let eyes = Values::Translations(views.iter().map(|view| view.eye).collect());
    let turns = Values::Rotations(views.iter().map(Camera::rotation).collect());
    scene.animation("pan", &[track(camera, eyes, Between::Smooth), track(camera, turns, Between::Linear)]);
    scene.into_glb()
}

/// Returns the quaternion of a rotation about `axis` by the angle `2 half`, radians.
fn quaternion(axis: Vec3, half: f32) -> Quat {
    let (sine, cosine) = (libm::sin(f64::from(half)) as f32, libm::cos(f64::from(half)) as f32);
    Quat::from_vec4((axis * sine).extend(cosine))
}

/// Adds a pendulum: an emissive block `ROD` below a pivot, and a point light below the block. Returns the
/// pivot's node, which is animated.
fn add_swinging_lamp(scene: &mut SceneBuilder) -> usize {
    let material = scene.material(&Material::diffuse("lantern", WHITE).emitting(LAMP_RADIANCE));
    let mut shape = Mesh::default();
    shape.cuboid(Vec3::splat(-LAMP), Vec3::splat(LAMP));
    let geometry = scene.geometry(&shape);
    let mesh = Some(scene.mesh("lantern", &[(geometry, material)]));
    let place = |y: f32| Some([0.0, y, 0.0]);
    let lantern = Node { name: "lantern".into(), mesh, translation: place(-ROD), ..Node::default() };
    let light = scene.point_light("glow", [1.0, 0.8, 0.5], GLOW);
    let below = place(-ROD - 1.5 * LAMP);
    let glow = Node { name: "glow".into(), translation: below, extensions: Some(light), ..Node::default() };
    let children = [lantern, glow].map(|node| scene.node(node)).to_vec();
    let translation = Some(PIVOT.to_array());
    scene.root(Node { name: "pendulum".into(), translation, children, ..Node::default() })
}

/// Adds a tall prism with a skin of two joints; returns the nodes of the joints, the lower first.
fn add_reed(scene: &mut SceneBuilder) -> [usize; 2] {
    let material = scene.material(&Material::diffuse("reed", [0.2, 0.5, 0.7]));
    let corners = [[-REED, REED], [REED, REED], [REED, -REED], [-REED, -REED]];
    let height = |row: usize| HEIGHT * row as f32 / SEGMENTS as f32;
    let mut shape = Mesh::default();
    shape.grid([4, SEGMENTS + 1], [true, false], |column, row| {
        let [x, z] = corners[column];
        FOOT + Vec3::new(x, height(row), z)
    });
    shape.quad(corners.map(|[x, z]| FOOT + Vec3::new(x, HEIGHT, z)));
    let middle = Vec3::Y * (0.5 * HEIGHT);
    let joint = |name: &str, place: Vec3, children| Node {
        name: name.into(),
        translation: Some(place.to_array()),
        children,
        ..Node::default()
    };
    let upper = scene.node(joint("upper", middle, Vec::new()));
    let lower = scene.root(joint("lower", FOOT, vec![upper]));
    let skin = Some(scene.skin(&[(lower, FOOT), (upper, FOOT + middle)]));
    // The weight of the upper joint rises from 0 to 1 over the middle half of the height.
    let share = |place: &Vec3| ((place.y - FOOT.y) / HEIGHT * 2.0 - 0.5).clamp(0.0, 1.0);
    let shares: Vec<f32> = shape.positions.iter().map(share).collect();
    let geometry = scene.geometry(&shape);
    let geometry = scene.hung(geometry, &shares);
    let mesh = Some(scene.mesh("reed", &[(geometry, material)]));
    scene.root(Node { name: "reed".into(), mesh, skin, ..Node::default() });
    [lower, upper]
}

/// Adds a block with a morph target that twists its top; returns its node.
fn add_block(scene: &mut SceneBuilder, material: usize) -> usize {
    let mut shape = Mesh::default();
    shape.cuboid(Vec3::splat(-SIDE), Vec3::splat(SIDE));
    let displace = |place: &Vec3| {
        let is_top = place.y > 0.0;
        if is_top {
            Vec3::new(-0.4 * place.x - 0.5 * place.z, 0.4, 0.5 * place.x - 0.4 * place.z)
        } else {
            Vec3::ZERO
        }
    };
    let displacements: Vec<Vec3> = shape.positions.iter().map(displace).collect();
    let geometry = scene.geometry(&shape);
    let mesh = scene.mesh("block", &[(geometry, material)]);
    scene.morph_target(mesh, &displacements);
    let translation = Some(BLOCK.to_array());
    scene.root(Node { name: "block".into(), mesh: Some(mesh), translation, ..Node::default() })
}
