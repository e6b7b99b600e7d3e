//! House of one room with a window, on open ground, to be lit by an environment map. Only a small part of the
//! sky's light reaches the window.

use glam::Vec3;

use crate::builder::{Camera, SceneBuilder};
use crate::material::Material;
use crate::mesh::Mesh;

/// Lower and upper corner of the room, metres.
const ROOM: [Vec3; 2] = [Vec3::new(-2.5, 0.0, -2.0), Vec3::new(2.5, 2.6, 2.0)];
/// Lower and upper corner of the window (x and y), metres. The window is in the wall towards -z, which faces
/// the sun of `sky.exr`.
const WINDOW: [[f32; 2]; 2] = [[-0.9, 0.9], [0.5, 2.1]];
/// Thickness of walls, floor and ceiling, metres.
const THICKNESS: f32 = 0.2;
/// Half the side of the ground, and its height, metres.
const GROUND: [f32; 2] = [15.0, -0.1];

/// Lower and upper corner of each piece of furniture, metres: a table's top, its two sides, and a chest.
const FURNITURE: [[[f32; 3]; 2]; 4] = [
    [[-0.7, 0.7, -0.5], [0.9, 0.75, 0.4]],
    [[-0.65, 0.0, -0.45], [-0.6, 0.7, 0.35]],
    [[0.8, 0.0, -0.45], [0.85, 0.7, 0.35]],
    [[-2.4, 0.0, 1.3], [-1.3, 0.9, 1.9]],
];

/// Returns the scene as a `.glb` file.
pub(crate) fn house() -> Vec<u8> {
    let mut scene = SceneBuilder::default();
    let ground = scene.material(&Material::diffuse("ground", [0.25, 0.28, 0.16]));
    let plaster = scene.material(&Material::diffuse("plaster", [0.74, 0.72, 0.68]));
    let floor = scene.material(&Material::diffuse("floor", [0.46, 0.3, 0.18]));
    let wood = scene.material(&Material::diffuse("wood", [0.35, 0.4, 0.5]));
    scene.object("ground", &lawn(), ground);
    scene.object("walls", &walls(), plaster);
    let mut mesh = Mesh::default();
    let [lower, upper] = ROOM;
    mesh.cuboid(lower - THICKNESS, Vec3::new(upper.x + THICKNESS, lower.y, upper.z + THICKNESS));
    scene.object("floor", &mesh, floor);
    let mut mesh = Mesh::default();
    for [lower, upper] in FURNITURE {
        mesh.cuboid(lower.into(), upper.into());
    }
    scene.object("furniture", &mesh, wood);
    let camera = Camera {
        eye: Vec3::new(2.3, 1.6, -1.8),
        target: Vec3::new(-1.2, 0.8, 1.2),
        yfov: 1.1,
        aspect_ratio: 1.0,
    };
    scene.camera("camera", &camera);
    scene.into_glb()
}

fn lawn() -> Mesh {
    let [half, height] = GROUND;
    let mut mesh = Mesh::default();
    let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
    mesh.quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]);
    mesh
}

/// Walls and ceiling. The wall with the window consists of four boxes around the window.
fn walls() -> Mesh {
    let [lower, upper] = ROOM;
    let [inner, outer] = [lower, upper + THICKNESS];
    let [left, right] = [lower.x - THICKNESS, outer.x];
    let [[window_left, sill], [window_right, lintel]] = WINDOW;
    let mut mesh = Mesh::default();
    let mut part = |min: [f32; 3], max: [f32; 3]| mesh.cuboid(min.into(), max.into());
    part([left, upper.y, lower.z - THICKNESS], outer.into());
    part([left, inner.y, lower.z - THICKNESS], [lower.x, upper.y, outer.z]);
    part([upper.x, inner.y, lower.z - THICKNESS], [right, upper.y, outer.z]);
    part([lower.x, inner.y, upper.z], [upper.x, upper.y, outer.z]);
    part([lower.x, inner.y, lower.z - THICKNESS], [window_left, upper.y, lower.z]);
    part([window_right, inner.y, lower.z - THICKNESS], [upper.x, upper.y, lower.z]);
    part([window_left, inner.y, lower.z - THICKNESS], [window_right, sill, lower.z]);
    part([window_left, lintel, lower.z - THICKNESS], [window_right, upper.y, lower.z]);
    mesh
}
