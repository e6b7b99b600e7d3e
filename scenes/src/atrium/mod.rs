//! Court with two storeys of arcades under an open sky, in the style of the Sponza atrium.

mod column;
mod dimensions;
mod furnishing;
mod light;
mod masonry;
mod palette;
mod parts;
mod side;
mod walk;

use glam::Vec3;

use crate::builder::{Camera, SceneBuilder};
use dimensions::{GALLERY_FLOOR, HALF, OUTER_WALL, ROOF, STEP_TOP};
use palette::Palette;
use parts::Parts;
use side::Plan;

pub(crate) use self::walk::walk;

/// Vertical field of view, radians, and aspect ratio of the cameras. The horizontal field of view is 73
/// degrees.
const LENS: (f64, f64) = (0.789, 16.0 / 9.0);

const RED: usize = 0;
const GREEN: usize = 1;
const BLUE: usize = 2;
const GOLD: usize = 3;

const SIDES: [Plan; 4] = [
    Plan {
        name: "north",
        bays: 8,
        x_axis: [1.0, 0.0, 0.0],
        z_axis: [0.0, 0.0, 1.0],
        origin: [0.0, 0.0, HALF.y],
        curtains: &[(3, RED), (6, GREEN), (9, BLUE), (12, RED)],
        banners: &[(4, GOLD), (8, RED), (11, GREEN)],
    },
    Plan {
        name: "east",
        bays: 3,
        x_axis: [0.0, 0.0, -1.0],
        z_axis: [1.0, 0.0, 0.0],
        origin: [HALF.x, 0.0, 0.0],
        curtains: &[(1, GREEN), (4, GREEN)],
        banners: &[(2, BLUE), (3, BLUE)],
    },
    Plan {
        name: "south",
        bays: 8,
        x_axis: [-1.0, 0.0, 0.0],
        z_axis: [0.0, 0.0, -1.0],
        origin: [0.0, 0.0, -HALF.y],
        curtains: &[(2, GOLD), (5, RED), (8, BLUE), (11, GREEN)],
        banners: &[(3, RED), (7, BLUE), (10, GOLD)],
    },
    Plan {
        name: "west",
        bays: 3,
        x_axis: [0.0, 0.0, 1.0],
        z_axis: [-1.0, 0.0, 0.0],
        origin: [-HALF.x, 0.0, 0.0],
        curtains: &[(1, GOLD), (4, RED)],
        banners: &[],
    },
];

/// Returns the court with an emissive sky and sun as a `.glb` file.
pub(crate) fn atrium() -> Vec<u8> {
    let mut scene = lit_court();
    place_cameras(&mut scene);
    scene.into_glb()
}

/// Court with an emissive sky and sun, without cameras.
fn lit_court() -> SceneBuilder {
    let (mut scene, colours) = court();
    scene.object("sky", &light::sky(), colours.sky);
    scene.object("sun", &light::sun(), colours.sun);
    scene
}

/// Returns the court without lights as a `.glb` file, to be lit by an environment map.
pub(crate) fn open() -> Vec<u8> {
    let (mut scene, _) = court();
    place_cameras(&mut scene);
    scene.into_glb()
}

/// Court without lights and cameras.
fn court() -> (SceneBuilder, Palette) {
    let mut scene = SceneBuilder::default();
    let colours = Palette::new(&mut scene);
    let parts = Parts::new(&mut scene, &colours);
    for plan in &SIDES {
        side::build(&mut scene, &parts, plan);
    }
    build_rings(&mut scene, &colours);
    build_floor(&mut scene, &colours);
    furnish(&mut scene, &colours, &parts);
    (scene, colours)
}

/// Adds the objects that surround the whole court: steps, gallery floor, cornice, roof, outer wall and rails.
fn build_rings(scene: &mut SceneBuilder, colours: &Palette) {
    let steps = [[-0.9, -0.1], [0.62, -0.1], [0.62, STEP_TOP], [-0.6, STEP_TOP], [-0.6, 0.08], [-0.9, 0.08]];
    scene.object("steps", &masonry::ring(&steps), colours.trim);
    let outer = OUTER_WALL[0] + 0.1;
    let [under, floor] = GALLERY_FLOOR;
    let gallery = [
        [-0.36, under],
        [outer, under],
        [outer, floor],
        [-0.50, floor],
        [-0.50, floor - 0.08],
        [-0.46, floor - 0.12],
        [-0.42, floor - 0.22],
        [-0.36, floor - 0.26],
    ];
    scene.object("gallery-floor", &masonry::ring(&gallery), colours.trim);
    let [ceiling, top] = ROOF;
    let cornice = [
        [-0.24, ceiling],
        [outer, ceiling],
        [outer, top - 0.2],
        [-0.6, top - 0.2],
        [-0.6, top - 0.28],
        [-0.5, top - 0.36],
        [-0.4, top - 0.4],
        [-0.32, top - 0.44],
        [-0.32, top - 0.52],
        [-0.24, top - 0.54],
    ];
    scene.object("cornice", &masonry::ring(&cornice), colours.trim);
    let tiles = [[-0.75, top - 0.21], [outer, top - 0.21], [outer, top], [-0.75, top]];
    scene.object("roof", &masonry::ring(&tiles), colours.roof);
    let [inner, outside] = OUTER_WALL;
    let wall = [[inner, -0.3], [outside, -0.3], [outside, top + 0.15], [inner, top + 0.15]];
    scene.object("outer-wall", &masonry::ring(&wall), colours.ochre);
    let foot = [[-0.12, 4.96], [0.12, 4.96], [0.12, 5.10], [0.09, 5.14], [-0.09, 5.14], [-0.12, 5.10]];
    scene.object("foot-rail", &masonry::ring(&foot), colours.trim);
    let hand = [
        [-0.11, 5.80],
        [0.11, 5.80],
        [0.14, 5.84],
        [0.14, 5.91],
        [0.11, 5.94],
        [-0.11, 5.94],
        [-0.14, 5.91],
        [-0.14, 5.84],
    ];
    scene.object("hand-rail", &masonry::ring(&hand), colours.trim);
}

/// Adds the slabs of the floor: light and dark stone in the court, light stone and terracotta in the
/// corridors.
fn build_floor(scene: &mut SceneBuilder, colours: &Palette) {
    const SLAB: f32 = 0.75;
    const OUTER: [i32; 2] = [21, 11];
    const COURT: [i32; 2] = [16, 6];
    let in_court = |column: i32, row: i32| {
        (-COURT[0]..COURT[0]).contains(&column) && (-COURT[1]..COURT[1]).contains(&row)
    };
    let odd = |column: i32, row: i32| (column + row).rem_euclid(2) == 1;
    let lay = |chosen: &dyn Fn(i32, i32) -> bool| masonry::paving(OUTER.map(|n| -n), OUTER, SLAB, chosen);
    let light = lay(&|column, row| !odd(column, row));
    let dark = lay(&|column, row| odd(column, row) && in_court(column, row));
    let terracotta = lay(&|column, row| odd(column, row) && !in_court(column, row));
    scene.object("floor-light", &light, colours.floor_light);
    scene.object("floor-dark", &dark, colours.floor_dark);
    scene.object("floor-terracotta", &terracotta, colours.terracotta);
}

fn furnish(scene: &mut SceneBuilder, colours: &Palette, parts: &Parts) {
    scene.object("fountain", &furnishing::fountain(), colours.trim);
    scene.object("water", &furnishing::water(), colours.water);
    let places = [
        (-2.5, -3.0, 0.85),
        (2.5, -3.0, 0.85),
        (5.75, -3.0, 0.85),
        (9.0, -3.0, 1.0),
        (-9.0, 3.0, 1.0),
        (-4.5, 3.0, 0.85),
        (4.5, 3.0, 0.85),
        (9.0, 3.0, 1.0),
    ];
    for (x, z, scale) in places {
        side::stand(scene, "planter", parts.planter, Vec3::new(x, 0.0, z), scale);
    }
}

fn place_cameras(scene: &mut SceneBuilder) {
    let (yfov, aspect_ratio) = LENS;
    let court =
        Camera { eye: Vec3::new(-11.2, 2.0, -2.9), target: Vec3::new(-2.0, 3.4, 0.6), yfov, aspect_ratio };
    scene.camera("court", &court);
    let gallery =
        Camera { eye: Vec3::new(-10.2, 6.7, 6.9), target: Vec3::new(-3.0, 6.3, 5.2), yfov, aspect_ratio };
    scene.camera("gallery", &gallery);
}
