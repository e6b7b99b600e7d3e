//! White furnace test: a closed cube whose walls all have the same emission and albedo.
//!
//! The radiance `L` is equal at every position and in every direction: `L = 1 + 0.5 L`, so `L = 2`.

use glam::Vec3;

use crate::builder::{Camera, SceneBuilder};
use crate::material::Material;
use crate::mesh::Mesh;

/// Cube whose faces point inwards, because its two corners are swapped.
fn room() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.cuboid(Vec3::ONE, Vec3::NEG_ONE);
    mesh
}

pub(crate) fn furnace() -> Vec<u8> {
    let mut scene = SceneBuilder::default();
    let wall = scene.material(&Material::diffuse("wall", [0.5; 3]).emitting([1.0; 3]));
    scene.object("room", &room(), wall);
    let camera = Camera {
        eye: Vec3::new(0.3, 0.2, 0.4),
        target: Vec3::NEG_ONE,
        yfov: core::f64::consts::FRAC_PI_3,
        aspect_ratio: 1.0,
    };
    scene.camera("camera", &camera);
    scene.into_gltf()
}
