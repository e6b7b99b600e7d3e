//! Shapes for the scenes of tests.

use glam::{Vec2, Vec3, Vec4};
use photoncard_driver::scene::{Scene, Triangle, VertexAttributes};

use crate::{quad, room};

/// Axis-aligned box that faces outwards. `half` is half of its size along each axis.
pub fn cuboid(centre: Vec3, half: Vec3, material: u32) -> Vec<Triangle> {
    // The walls of a room face inwards: their orientation is reversed.
    let mut walls = room([material; 6]);
    for Triangle { vertices, .. } in &mut walls {
        vertices.swap(1, 2);
        vertices.iter_mut().for_each(|vertex| *vertex = centre + *vertex * half);
    }
    walls
}

/// Adds a ball to a scene: `steps` rows of `2 steps` quadrilaterals, with smooth vertex normals.
pub fn add_ball(scene: &mut Scene, centre: Vec3, radius: f32, steps: u32, material: u32) {
    let normal = |row: u32, column: u32| {
        let pole = std::f32::consts::PI * row as f32 / steps as f32;
        // The last column ends exactly where the first begins.
        let around = std::f32::consts::PI * (column % (2 * steps)) as f32 / steps as f32;
        if row == 0 || row == steps {
            return Vec3::Y * pole.cos();
        }
        Vec3::new(pole.sin() * around.cos(), pole.cos(), -pole.sin() * around.sin())
    };
    for row in 0..steps {
        for column in 0..2 * steps {
            let corners = [[row, column], [row + 1, column], [row + 1, column + 1], [row, column + 1]];
            let [a, b, c, d] = corners.map(|[row, column]| normal(row, column));
            for normals in [[a, b, c], [a, c, d]] {
                let triangle = Triangle {
                    attributes: scene.attributes.len() as u32,
                    ..Triangle::new(normals.map(|normal| centre + normal * radius), material)
                };
                // One triangle of each quadrilateral at a pole has no area.
                if triangle.area() > 0.0 {
                    scene.triangles.push(triangle);
                    scene
                        .attributes
                        .push(VertexAttributes { normals: Some(normals), ..VertexAttributes::NONE });
                }
            }
        }
    }
}

/// Adds a quadrilateral with texture coordinates of set 0 to a scene. Its corners are counter-clockwise, seen
/// from the front.
pub fn add_textured_quad(scene: &mut Scene, corners: [Vec3; 4], coordinates: [[f32; 2]; 4], material: u32) {
    let [a, b, c, d] = coordinates.map(Vec2::from);
    for (triangle, coordinates) in quad(corners, material).into_iter().zip([[a, b, c], [a, c, d]]) {
        let attributes = scene.attributes.len() as u32;
        scene.triangles.push(Triangle { attributes, ..triangle });
        scene
            .attributes
            .push(VertexAttributes { coordinates: [coordinates, [Vec2::ZERO; 3]], ..VertexAttributes::NONE });
    }
}

/// Sets the tangent of all corners of a material's triangles to `tangent`, whose w is the sign of the
/// bitangent.
pub fn add_tangents(scene: &mut Scene, material: u32, tangent: Vec4) {
    let scene = &mut **scene;
    for triangle in scene.triangles.iter().filter(|triangle| triangle.material == material) {
        scene.attributes[triangle.attributes as usize].tangents = scene.tangents.len() as u32;
        scene.tangents.push([tangent; 3]);
    }
}
