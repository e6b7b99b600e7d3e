//! Ten balls on the ground under a lamp: metals and dielectrics, from nearly smooth to rough.

use glam::Vec3;

use crate::builder::{Camera, SceneBuilder};
use crate::document::Node;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::sphere::icosphere;

const ROUGHNESSES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 1.0];
const GOLD: [f64; 3] = [1.0, 0.766, 0.336];
const PLASTIC: [f64; 3] = [0.2, 0.45, 0.25];
const RADIUS: f32 = 0.4;

pub(crate) fn roughness() -> Vec<u8> {
    let mut scene = SceneBuilder::default();
    surround(&mut scene);
    let ball = scene.geometry(&icosphere(4));
    for (name, base_colour, metallic, z) in [("metal", GOLD, 1.0, -0.55), ("dielectric", PLASTIC, 0.0, 0.55)]
    {
        for (column, roughness) in ROUGHNESSES.into_iter().enumerate() {
            let name = format!("{name}-{roughness}");
            let material =
                scene.material(&Material::metallic_roughness(&name, base_colour, metallic, roughness));
            let mesh = Some(scene.mesh(&name, &[(ball, material)]));
            let translation = Some([column as f32 - 2.0, RADIUS + 0.001, z]);
            scene.root(Node { name, mesh, translation, scale: Some([RADIUS; 3]), ..Node::default() });
        }
    }
    let camera = Camera {
        eye: Vec3::new(0.0, 3.1, 5.2),
        target: Vec3::new(0.0, 0.25, -0.05),
        yfov: 0.46,
        aspect_ratio: 2.0,
    };
    scene.camera("camera", &camera);
    scene.into_glb()
}

/// Adds the ground, a wall behind the balls, and a lamp above them.
fn surround(scene: &mut SceneBuilder) {
    let ground = scene.material(&Material::diffuse("ground", [0.5; 3]));
    let lamp = scene.material(&Material::diffuse("lamp", [0.0; 3]).emitting([12.0; 3]));
    let mut mesh = Mesh::default();
    mesh.quad([[-5.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 0.0, -2.0], [-5.0, 0.0, -2.0]].map(Vec3::from_array));
    mesh.quad(
        [[-5.0, 0.0, -2.0], [5.0, 0.0, -2.0], [5.0, 4.0, -2.0], [-5.0, 4.0, -2.0]].map(Vec3::from_array),
    );
    scene.object("ground", &mesh, ground);
    let mut mesh = Mesh::default();
    mesh.quad([[-1.0, 3.5, -0.3], [1.0, 3.5, -0.3], [1.0, 3.2, 0.6], [-1.0, 3.2, 0.6]].map(Vec3::from_array));
    scene.object("lamp", &mesh, lamp);
}
