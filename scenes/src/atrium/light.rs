//! Sky over the court, and the sun in it.
//!
//! The sky is an emissive wedge that closes the opening of the roof, low in the north and high in the south.
//! Its shape is invisible, because its radiance is uniform. The wedge is small, because light from one of its
//! faces to another is lost. The sun is in the high corner of the wedge, so that sunlight passes the southern
//! eaves obliquely and reaches the northern side.

use glam::Vec3;

use crate::mesh::Mesh;

/// Extent of the sky, metres: half its width in x; heights of its lower edge (inside the roof) and its top; z
/// of its south and north end.
const SKY_X: f32 = 13.3;
const SKY_Y: [f32; 2] = [9.2, 12.9];
const SKY_Z: [f32; 2] = [-7.4, 5.6];

const SUN: Vec3 = Vec3::new(-7.0, 12.0, -6.6);
const SUN_TARGET: Vec3 = Vec3::new(3.0, 3.0, 4.5);
const SUN_HALF_SIZE: f32 = 0.25;

pub(super) fn sky() -> Mesh {
    let ([foot, top], [south, north]) = (SKY_Y, SKY_Z);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x * SKY_X, y, z);
    let mut mesh = Mesh::default();
    mesh.quad([at(-1.0, foot, north), at(-1.0, top, south), at(1.0, top, south), at(1.0, foot, north)]);
    mesh.quad([at(-1.0, foot, south), at(1.0, foot, south), at(1.0, top, south), at(-1.0, top, south)]);
    mesh.lone_triangle([at(1.0, foot, north), at(1.0, top, south), at(1.0, foot, south)]);
    mesh.lone_triangle([at(-1.0, foot, north), at(-1.0, foot, south), at(-1.0, top, south)]);
    mesh
}

pub(super) fn sun() -> Mesh {
    let towards = (SUN_TARGET - SUN).normalize();
    let across = Vec3::Y.cross(towards).normalize() * SUN_HALF_SIZE;
    let up = towards.cross(across);
    let mut mesh = Mesh::default();
    mesh.quad([SUN - across - up, SUN + across - up, SUN + across + up, SUN - across + up]);
    mesh
}
