//! Closed room in which nearly every surface has a texture. All materials are Lambertian.

mod furniture;
mod patterns;
mod picture;

use glam::Vec3;

use crate::builder::{Camera, Joined, SceneBuilder, Wrap};
use crate::document::TextureTransform;
use crate::material::Material;
use crate::mesh::Mesh;

/// Half the room's size in x and z, and its height, metres.
const HALF: [f32; 2] = [2.0, 1.6];
const HEIGHT: f32 = 2.6;

const LAMP_RADIANCE: [f64; 3] = [14.0, 12.0, 9.5];
const WINDOW_RADIANCE: [f64; 3] = [9.0; 3];
const PLASTER: [f64; 3] = [0.72, 0.70, 0.66];

/// Picture on the wall, a JPEG file that `painting.py` in this folder generates.
const PAINTING: &[u8] = include_bytes!("painting.jpg");

/// Texture coordinates that map the whole image to a quadrilateral whose first corner is at the lower left.
const WHOLE: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

/// Indices of the textures in the glTF file.
struct Textures {
    planks: usize,
    wallpaper: usize,
    mirrored_wallpaper: usize,
    lattice: usize,
    window: usize,
    painting: usize,
}

impl Textures {
    fn new(scene: &mut SceneBuilder) -> Self {
        let mut png = |name: &str, picture: &picture::Picture| scene.image(name, "image/png", picture.png());
        let planks = png("planks", &patterns::planks());
        let wallpaper = png("wallpaper", &patterns::wallpaper());
        let lattice = png("lattice", &patterns::lattice());
        let window = png("window", &patterns::stained_glass());
        let painting = scene.image("painting", "image/jpeg", PAINTING.to_vec());
        Self {
            planks: scene.texture(planks, [Wrap::Repeat; 2]),
            wallpaper: scene.texture(wallpaper, [Wrap::Repeat; 2]),
            mirrored_wallpaper: scene.texture(wallpaper, [Wrap::Mirror; 2]),
            lattice: scene.texture(lattice, [Wrap::Repeat; 2]),
            window: scene.texture(window, [Wrap::Clamp; 2]),
            painting: scene.texture(painting, [Wrap::Clamp; 2]),
        }
    }
}

/// Returns the scene as a `.glb` file.
pub(crate) fn room() -> Vec<u8> {
    let mut scene = SceneBuilder::default();
    let textures = Textures::new(&mut scene);
    build_walls(&mut scene, &textures);
    hang(&mut scene, &textures);
    furnish(&mut scene, &textures);
    let camera = Camera {
        eye: Vec3::new(1.35, 1.5, 1.5),
        target: Vec3::new(-0.42, 0.98, -0.9),
        yfov: 0.92,
        aspect_ratio: 4.0 / 3.0,
    };
    scene.camera("camera", &camera);
    scene.into_glb()
}

fn textured(corners: [[f32; 3]; 4], coordinates: [[f32; 2]; 4]) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.textured_quad(corners.map(Vec3::from_array), coordinates);
    mesh
}

/// Adds floor, ceiling and walls. The wallpaper is mirrored on one wall and slanted on another.
fn build_walls(scene: &mut SceneBuilder, textures: &Textures) {
    let [x, z] = HALF;
    let mut white = |name: &str, texture: usize, transform: Option<TextureTransform>| {
        scene.material(&Material::diffuse(name, [1.0; 3]).textured(texture, transform))
    };
    let mirrored = TextureTransform { offset: [0.1, 0.05], rotation: 0.0, scale: [5.0, 3.25] };
    let slanted = TextureTransform { offset: [0.3, 0.0], rotation: 0.5, scale: [4.0, 3.25] };
    let floor = white("floor", textures.planks, None);
    let back = white("mirrored-wallpaper", textures.mirrored_wallpaper, Some(mirrored));
    let left = white("slanted-wallpaper", textures.wallpaper, Some(slanted));
    let plaster = scene.material(&Material::diffuse("plaster", PLASTER));
    let boards = [[0.0, 1.6], [2.0, 1.6], [2.0, 0.0], [0.0, 0.0]];
    let lower = [[-x, 0.0, z], [x, 0.0, z], [x, 0.0, -z], [-x, 0.0, -z]];
    let upper = lower.map(|[x, _, z]| [x, HEIGHT, z]);
    scene.object("floor", &textured(lower, boards), floor);
    scene.object("back-wall", &textured([lower[3], lower[2], upper[2], upper[3]], WHOLE), back);
    scene.object("left-wall", &textured([lower[0], lower[3], upper[3], upper[0]], WHOLE), left);
    let mut plain = Mesh::default();
    for corners in [
        [upper[3], upper[2], upper[1], upper[0]],
        [lower[2], lower[1], upper[1], upper[2]],
        [lower[1], lower[0], upper[0], upper[1]],
    ] {
        plain.quad(corners.map(Vec3::from_array));
    }
    scene.object("plaster", &plain, plaster);
}

/// Adds the lamp, the window of coloured light, and the painting.
fn hang(scene: &mut SceneBuilder, textures: &Textures) {
    let lamp = scene.material(&Material::diffuse("lamp", [0.0; 3]).emitting(LAMP_RADIANCE));
    let window =
        Material::diffuse("window", [0.0; 3]).emitting(WINDOW_RADIANCE).emission_textured(textures.window);
    let window = scene.material(&window);
    let painting = scene.material(&Material::diffuse("painting", [0.9; 3]).textured(textures.painting, None));
    let [left, back] = [0.01 - HALF[0], 0.02 - HALF[1]];
    let under = HEIGHT - 0.02;
    let mut mesh = Mesh::default();
    mesh.quad(
        [[-0.45, under, -0.35], [0.45, under, -0.35], [0.45, under, 0.25], [-0.45, under, 0.25]]
            .map(Vec3::from_array),
    );
    scene.object("lamp", &mesh, lamp);
    let pane = [[left, 0.8, 0.15], [left, 0.8, -0.85], [left, 2.1, -0.85], [left, 2.1, 0.15]];
    scene.object("window", &textured(pane, WHOLE), window);
    let canvas = [[-1.0, 1.25, back], [0.2, 1.25, back], [0.2, 2.15, back], [-1.0, 2.15, back]];
    scene.object("painting", &textured(canvas, WHOLE), painting);
}

/// Adds a cut-out screen, a vase on a coloured plinth, and a drum made of a strip and a fan.
fn furnish(scene: &mut SceneBuilder, textures: &Textures) {
    let lattice = Material::diffuse("lattice", [1.0; 3]).textured(textures.lattice, None).cut_out(0.5);
    let lattice = scene.material(&lattice.double_sided());
    let screen = [[0.35, 0.0, -1.35], [1.45, 0.0, -0.75], [1.45, 1.45, -0.75], [0.35, 1.45, -1.35]];
    scene.object("screen", &textured(screen, [[0.0, 3.0], [2.5, 3.0], [2.5, 0.0], [0.0, 0.0]]), lattice);
    let coloured = scene.material(&Material::diffuse("coloured", [1.0; 3]));
    scene.object("plinth", &furniture::plinth(), coloured);
    let glaze = scene.material(&Material::diffuse("glaze", [0.16, 0.34, 0.55]));
    scene.object("vase", &furniture::vase(), glaze);
    let paper = Material::diffuse("paper", [0.9, 0.8, 0.7]).textured(textures.wallpaper, None);
    let paper = scene.material(&paper);
    let side = scene.joined(&furniture::drum_side(), Joined::Strip);
    let head = scene.joined(&furniture::drum_head(), Joined::Fan);
    let drum = scene.mesh("drum", &[(side, paper), (head, coloured)]);
    scene.root(furniture::drum_node(drum));
}
