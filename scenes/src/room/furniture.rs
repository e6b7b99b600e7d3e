//! Furniture of the room: plinth, vase and drum.

use glam::{Vec2, Vec3};

use crate::document::Node;
use crate::mesh::{Mesh, on_circle};

/// Plinth: position in x and z, half its width, and its height, metres.
const PLINTH: ([f32; 2], f32, f32) = ([-1.15, -0.95], 0.22, 0.62);

const DRUM: [f32; 3] = [-0.25, 0.0, -0.35];
const DRUM_RADIUS: f32 = 0.28;
const DRUM_HEIGHT: f32 = 0.42;
const DRUM_SEGMENTS: usize = 48;

/// Block whose vertex colours change from bottom to top and from left to right.
pub(super) fn plinth() -> Mesh {
    let ([x, z], half, height) = PLINTH;
    let mut block = Mesh::default();
    block.block(half, 0.0, height);
    let colour = |p: &Vec3| {
        let (above, right) = (p.y / height, if p.x > 0.0 { 1.0 } else { 0.0 });
        [0.15 + 0.65 * above, 0.25 + 0.3 * right, 0.6 - 0.45 * above]
    };
    block.colours = block.positions.iter().map(colour).collect();
    let mut mesh = Mesh::default();
    mesh.append(&block, Vec3::new(x, 0.0, z));
    mesh
}

/// Smooth vase on the plinth, open at the top.
pub(super) fn vase() -> Mesh {
    let ([x, z], _, height) = PLINTH;
    let profile = [
        [0.0, 0.0],
        [0.09, 0.0],
        [0.10, 0.01],
        [0.13, 0.05],
        [0.165, 0.11],
        [0.175, 0.17],
        [0.165, 0.23],
        [0.135, 0.29],
        [0.10, 0.335],
        [0.075, 0.375],
        [0.07, 0.41],
        [0.08, 0.445],
        [0.10, 0.47],
        [0.105, 0.477],
        [0.10, 0.48],
        [0.085, 0.46],
        [0.062, 0.41],
        [0.065, 0.375],
        [0.09, 0.335],
        [0.0, 0.30],
    ];
    let mut turned = Mesh::default();
    turned.lathe(48, &profile);
    let mut mesh = Mesh::default();
    mesh.append(&turned.smooth(), Vec3::new(x, height + 0.002, z));
    mesh
}

/// Side of the drum as a triangle strip: alternating top and bottom vertices, counter-clockwise seen from
/// above. The vertices of the seam occur twice.
pub(super) fn drum_side() -> Mesh {
    let mut mesh = Mesh::default();
    for segment in 0..=DRUM_SEGMENTS {
        let outwards = on_circle(segment % DRUM_SEGMENTS, DRUM_SEGMENTS);
        let outwards = Vec3::new(outwards.x, 0.0, -outwards.y);
        let around = 4.0 * segment as f32 / DRUM_SEGMENTS as f32;
        for (height, down) in [(DRUM_HEIGHT, 0.0), (0.0, 1.0)] {
            mesh.positions.push(outwards * DRUM_RADIUS + Vec3::Y * height);
            mesh.normals.push(outwards);
            mesh.coordinates.push(Vec2::new(around, down));
        }
    }
    mesh
}

/// Head of the drum as a triangle fan: its centre, then its rim counter-clockwise seen from above.
pub(super) fn drum_head() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.positions.push(Vec3::Y * DRUM_HEIGHT);
    mesh.colours.push([0.85, 0.82, 0.70]);
    for segment in 0..=DRUM_SEGMENTS {
        let outwards = on_circle(segment % DRUM_SEGMENTS, DRUM_SEGMENTS);
        mesh.positions.push(Vec3::new(outwards.x * DRUM_RADIUS, DRUM_HEIGHT, -outwards.y * DRUM_RADIUS));
        let [red, blue] = [0.5 + 0.4 * outwards.x, 0.5 + 0.4 * outwards.y];
        mesh.colours.push([red, 0.2, blue]);
    }
    mesh
}

/// Node of the drum. Its negative scale mirrors the mesh, so that a glTF loader must reverse the winding of
/// the triangles.
pub(super) fn drum_node(mesh: usize) -> Node {
    Node {
        name: "drum".into(),
        mesh: Some(mesh),
        translation: Some(DRUM),
        scale: Some([-1.0, 1.0, 1.0]),
        ..Node::default()
    }
}
