//! Sphere of nearly equal triangles.

use std::collections::HashMap;

use glam::Vec3;

use crate::mesh::Mesh;

/// Faces of an icosahedron, as indices of the vertices of [`icosahedron`], counter-clockwise seen from
/// outside.
const FACES: [[u32; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// Smooth unit sphere about the origin: an icosahedron in which each triangle is divided into four,
/// `subdivisions` times.
pub(crate) fn icosphere(subdivisions: u32) -> Mesh {
    let mut mesh = icosahedron();
    for _ in 0..subdivisions {
        cut_into_four(&mut mesh);
    }
    mesh.normals.clone_from(&mesh.positions);
    mesh
}

fn icosahedron() -> Mesh {
    let golden = (1.0 + libm::sqrtf(5.0)) / 2.0;
    let rectangle = [[-1.0, golden], [1.0, golden], [-1.0, -golden], [1.0, -golden]];
    let mut mesh = Mesh::default();
    mesh.positions.extend(rectangle.map(|[x, y]| Vec3::new(x, y, 0.0)));
    mesh.positions.extend(rectangle.map(|[y, z]| Vec3::new(0.0, y, z)));
    mesh.positions.extend(rectangle.map(|[z, x]| Vec3::new(x, 0.0, z)));
    for position in &mut mesh.positions {
        *position = position.normalize();
    }
    mesh.triangles.extend(FACES);
    mesh
}

fn cut_into_four(mesh: &mut Mesh) {
    let mut middles = HashMap::new();
    for [a, b, c] in std::mem::take(&mut mesh.triangles) {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                let sum = mesh.positions[from as usize] + mesh.positions[to as usize];
                mesh.positions.push(sum.normalize());
                (mesh.positions.len() - 1) as u32
            })
        });
        mesh.triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_is_closed_and_faces_outwards() {
        let sphere = icosphere(3);
        assert_eq!(sphere.triangles.len(), 20 * 64);
        assert_eq!(sphere.positions.len(), sphere.triangles.len() / 2 + 2);
        // The mesh is inscribed in the ball, so that its volume is a little less.
        let share = sphere.volume() / (4.0 / 3.0 * core::f32::consts::PI);
        assert!((0.98..1.0).contains(&share), "{share}");
    }
}
