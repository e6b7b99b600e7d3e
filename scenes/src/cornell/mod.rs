//! Cornell box, scaled to two metres, and three variants: with a glossy floor, with a lamp that faces the
//! ceiling, and with a mirror ball and a glass ball in place of its blocks.

mod moving;

use glam::Vec3;

pub(crate) use self::moving::moving;

use crate::builder::{Camera, SceneBuilder};
use crate::document::{Node, Phong};
use crate::material::{Glass, Material};
use crate::mesh::Mesh;
use crate::sphere::icosphere;

/// Corners of a quadrilateral, counter-clockwise seen from the front.
type Quad = [[f32; 3]; 4];

const LIGHT: Quad = [[-0.23, 0.99, -0.18], [0.23, 0.99, -0.18], [0.23, 0.99, 0.2], [-0.23, 0.99, 0.2]];
const FLOOR: Quad = [[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, -1.0]];
const CEILING: Quad = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]];
const BACK: Quad = [[-1.0, -1.0, -1.0], [1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, -1.0]];
const GREEN_WALL: Quad = [[1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]];
const RED_WALL: Quad = [[-1.0, -1.0, 1.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]];

/// Box on the floor, or slightly sunk into it: (x, z) of its four corners, and the heights of its bottom and
/// top, metres.
struct StandingBox {
    footprint: [[f32; 2]; 4],
    bottom: f32,
    top: f32,
}

const SMALL_BOX: StandingBox = StandingBox {
    footprint: [
        [-0.03960294, 0.57917994],
        [0.5341799, 0.7546029],
        [0.70960295, 0.18082008],
        [0.13582009, 0.005397062],
    ],
    bottom: -1.0,
    top: -0.4,
};

const LARGE_BOX: StandingBox = StandingBox {
    footprint: [
        [-0.52096057, 0.09885888],
        [0.04885888, -0.08903941],
        [-0.1390394, -0.6588589],
        [-0.7088589, -0.4709606],
    ],
    bottom: -1.01,
    top: 0.21,
};

const WHITE: [f64; 3] = [0.885809, 0.698859, 0.666422];
const GREEN: [f64; 3] = [0.105421, 0.37798, 0.076425];
const RED: [f64; 3] = [0.570068, 0.0430135, 0.0443706];
const LIGHT_RADIANCE: [f64; 3] = [18.387, 13.9873, 6.75357];

/// Geometry of a lamp that faces upwards and of the square cup around it: corners of the lamp; half the cup's
/// side and the heights of the cup's bottom and rim, metres.
const UPLIGHT: Quad = [[-0.12, 0.72, 0.12], [0.12, 0.72, 0.12], [0.12, 0.72, -0.12], [-0.12, 0.72, -0.12]];
const CUP: (f32, f32, f32) = (0.14, 0.7, 0.86);
const CUP_ALBEDO: [f64; 3] = [0.1; 3];
/// Radiance of the upward lamp, W/(sr m^2). The lamp has a third of the area of the ceiling lamp, and emits
/// the same power.
const UPLIGHT_RADIANCE: [f64; 3] = [56.0, 42.6, 20.6];

/// Centres and radius of the balls, metres. They float slightly above the floor.
const MIRROR_BALL: [f32; 3] = [-0.45, -0.58, -0.4];
const GLASS_BALL: [f32; 3] = [0.42, -0.58, 0.3];
const BALL_RADIUS: f32 = 0.4;
/// Clear glass with a slight green absorption tint, like a bottle.
const GLASS: Glass =
    Glass { ior: 1.5, thickness: 0.8, attenuation_colour: [0.8, 0.93, 0.86], attenuation_distance: 1.0 };

/// Camera in front of the open side of the box, which fills the picture.
const FRONT: Camera =
    Camera { eye: Vec3::new(0.0, 0.0, 3.9), target: Vec3::ZERO, yfov: 0.6860487863861751, aspect_ratio: 1.0 };

/// Camera that looks down from close by. The floor, from its open edge to the back wall, fills the picture.
const TOWARDS_FLOOR: Camera = Camera {
    eye: Vec3::new(-0.15, 0.5, 1.75),
    target: Vec3::new(-0.15, -1.0, 0.2),
    yfov: 0.64,
    aspect_ratio: 1.0,
};

fn quad(corners: Quad) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.quad(corners.map(Vec3::from_array));
    mesh
}

fn standing_box(shape: &StandingBox) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.prism(shape.footprint, shape.bottom, shape.top);
    mesh
}

/// Creates the box with its blocks and a lamp. The floor has the material `floor`; `None` stands for the
/// material of the white walls.
fn cornell_box(floor: Option<&Material>, add_lamp: fn(&mut SceneBuilder)) -> SceneBuilder {
    let (mut scene, white) = empty_box(floor, add_lamp);
    scene.object("small-box", &standing_box(&SMALL_BOX), white);
    scene.object("large-box", &standing_box(&LARGE_BOX), white);
    scene.camera("camera", &FRONT);
    scene
}

/// Creates the box with a lamp and without blocks. Returns the box and the index of the white walls'
/// material.
fn empty_box(floor: Option<&Material>, add_lamp: fn(&mut SceneBuilder)) -> (SceneBuilder, usize) {
    let mut scene = SceneBuilder::default();
    let white = scene.material(&Material::diffuse("white", WHITE));
    let green = scene.material(&Material::diffuse("green", GREEN));
    let red = scene.material(&Material::diffuse("red", RED));
    add_lamp(&mut scene);
    let floor = floor.map_or(white, |material| scene.material(material));
    scene.object("floor", &quad(FLOOR), floor);
    scene.object("ceiling", &quad(CEILING), white);
    scene.object("back", &quad(BACK), white);
    scene.object("green-wall", &quad(GREEN_WALL), green);
    scene.object("red-wall", &quad(RED_WALL), red);
    (scene, white)
}

fn add_ceiling_lamp(scene: &mut SceneBuilder) {
    let light = scene.material(&Material::diffuse("light", WHITE).emitting(LIGHT_RADIANCE));
    scene.object("light", &quad(LIGHT), light);
}

fn add_uplight(scene: &mut SceneBuilder) {
    let lamp = scene.material(&Material::diffuse("lamp", WHITE).emitting(UPLIGHT_RADIANCE));
    let cup = scene.material(&Material::diffuse("cup", CUP_ALBEDO).double_sided());
    scene.object("lamp", &quad(UPLIGHT), lamp);
    scene.object("cup", &cup_walls(), cup);
}

/// Lambertian box, lit by the lamp in the ceiling.
pub(crate) fn lambertian() -> Vec<u8> {
    cornell_box(None, add_ceiling_lamp).into_gltf()
}

/// Box whose floor has a Phong lobe, lit by the lamp in the ceiling.
pub(crate) fn glossy_floor() -> Vec<u8> {
    let phong = Phong { specular: [0.35; 3], exponent: 32.0 };
    let floor = Material::diffuse("floor", [0.45, 0.28, 0.14]).with_phong(phong);
    let mut scene = cornell_box(Some(&floor), add_ceiling_lamp);
    scene.camera("floor", &TOWARDS_FLOOR);
    scene.into_gltf()
}

/// Lambertian box with a lamp in a cup. The lamp illuminates only a spot of the ceiling, so that nearly all
/// light is indirect.
pub(crate) fn uplight() -> Vec<u8> {
    cornell_box(None, add_uplight).into_gltf()
}

/// Lambertian box with a mirror ball and a glass ball, which cause caustics.
pub(crate) fn spheres() -> Vec<u8> {
    let (mut scene, _) = empty_box(None, add_ceiling_lamp);
    let mirror = scene.material(&Material::metallic_roughness("mirror", [1.0; 3], 1.0, 0.0));
    let glass = scene.material(&Material::glass("glass", GLASS));
    let ball = scene.geometry(&icosphere(5));
    for (name, material, centre) in [("mirror-ball", mirror, MIRROR_BALL), ("glass-ball", glass, GLASS_BALL)]
    {
        let mesh = Some(scene.mesh(name, &[(ball, material)]));
        let (translation, scale) = (Some(centre), Some([BALL_RADIUS; 3]));
        scene.root(Node { name: name.into(), mesh, translation, scale, ..Node::default() });
    }
    scene.camera("camera", &FRONT);
    scene.into_glb()
}

/// Bottom and four sides of the cup.
fn cup_walls() -> Mesh {
    let (side, bottom, rim) = CUP;
    let corners = [[-side, -side], [side, -side], [side, side], [-side, side]];
    let mut mesh = Mesh::default();
    mesh.quad(corners.map(|[x, z]| Vec3::new(x, bottom, z)));
    for (index, [x, z]) in corners.into_iter().enumerate() {
        let [next_x, next_z] = corners[(index + 1) % 4];
        let wall = [[x, bottom, z], [next_x, bottom, next_z], [next_x, rim, next_z], [x, rim, z]];
        mesh.quad(wall.map(Vec3::from_array));
    }
    mesh
}
