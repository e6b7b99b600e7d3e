//! Small scene that has every feature of a scene.

use std::path::Path;

use glam::{Vec2, Vec3};
use photoncard_driver::scene::{
    Coat, DiffuseTransmission, Encoding, Environment, Image, Layers, LightAxes, LightProfile, Material,
    NormalMap, PunctualKind, PunctualLight, Reflection, Scene, Sheen, Texture, Transmission, Triangle,
    VertexAttributes, Visibility, Wrap,
};

use crate::shapes::{add_ball, add_tangents, add_textured_quad, cuboid};
use crate::{camera, lambertian, quad, room, scene};

const WALL: u32 = 0;
const LAMP: u32 = 1;
const PAPER: u32 = 2;
const METAL: u32 = 3;
const MIRROR: u32 = 4;
const GLASS: u32 = 5;
const LATTICE: u32 = 6;
const SCREEN: u32 = 7;
const VEIL: u32 = 8;
const VARNISHED: u32 = 9;
const PANE: u32 = 10;
const ICE: u32 = 11;
const BUMPS: u32 = 12;
const DENTS: u32 = 13;
const WINDOW: u32 = 14;
const PANEL: u32 = 15;
const GHOST: u32 = 16;

/// Creates a room with every feature. It has an emissive lamp, a point, a spot and a directional light, a
/// luminaire, a sky through its open front, and walls with textures by both sets of coordinates. In the room
/// are a mirror ball, a glass ball, a lattice with cut-outs, an emissive screen, a veil of partial coverage
/// with sheen and diffuse transmission, a coated board, a rough pane and a rough block of glass, and a glossy
/// and a Lambertian sheet with normal maps. Under the lights are a shelf of tinted glass and a coated window
/// with textures. The camera does not see a lamp without substance and a block.
pub fn everything() -> Scene {
    let view = camera(Vec3::new(0.1, 0.1, 0.95), Vec3::new(-0.05, -0.2, -1.0));
    let mut scene = scene(room([METAL, WALL, PAPER, WALL, PAPER, WALL]), materials(), view);
    // The wall behind the camera is left open.
    scene.triangles.truncate(10);
    add_textures(&mut scene);
    add_lights(&mut scene);
    // All walls but those of the material `WALL` have texture coordinates and colours.
    for index in 0..10 {
        let Triangle { vertices, material, .. } = scene.triangles[index];
        if material != WALL {
            scene.triangles[index].attributes = scene.attributes.len() as u32;
            let coordinates = vertices.map(|vertex| Vec2::new(vertex.x + vertex.z, vertex.y - vertex.z));
            let colours = [[1.0, 0.9, 0.8, 1.0], [0.7, 1.0, 0.6, 1.0], [0.9, 0.5, 1.0, 1.0]];
            scene.attributes.push(VertexAttributes {
                normals: None,
                coordinates: [coordinates, coordinates.map(|coordinate| coordinate * 3.0)],
                colours,
                ..VertexAttributes::NONE
            });
        }
    }
    add_ball(&mut scene, Vec3::new(-0.45, -0.55, -0.3), 0.35, 8, MIRROR);
    add_ball(&mut scene, Vec3::new(0.4, -0.6, 0.1), 0.3, 8, GLASS);
    let upright = |centre: Vec3, half: f32| {
        [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]]
            .map(|[x, y]| centre + Vec3::new(x * half, y * half, 0.3 * x))
    };
    let coordinates = [[0., 3.], [3., 3.], [3., 0.], [0., 0.]];
    add_textured_quad(&mut scene, upright(Vec3::new(0.3, 0.2, -0.5), 0.4), coordinates, LATTICE);
    add_textured_quad(&mut scene, upright(Vec3::new(-0.5, 0.3, -0.7), 0.25), coordinates, SCREEN);
    add_textured_quad(&mut scene, upright(Vec3::new(-0.1, -0.1, 0.1), 0.15), coordinates, VEIL);
    add_textured_quad(&mut scene, upright(Vec3::new(0.7, -0.1, -0.2), 0.2), coordinates, VARNISHED);
    add_textured_quad(&mut scene, upright(Vec3::new(-0.2, -0.6, 0.3), 0.15), coordinates, PANE);
    scene.triangles.extend(cuboid(Vec3::new(0.0, -0.8, 0.0), Vec3::splat(0.1), ICE));
    scene.triangles.extend(cuboid(Vec3::new(0.3, 0.8, 0.2), Vec3::new(0.5, 0.01, 0.4), GLASS));
    add_textured_quad(&mut scene, upright(Vec3::new(-0.2, 0.6, 0.4), 0.3), coordinates, WINDOW);
    for (material, x) in [(BUMPS, -0.7), (DENTS, 0.8)] {
        add_textured_quad(&mut scene, upright(Vec3::new(x, -0.1, -0.4), 0.2), coordinates, material);
        let along = Vec3::new(1.0, 0.0, 0.3).normalize();
        add_tangents(&mut scene, material, along.extend(x.signum()));
    }
    let low = |x: f32, z: f32| Vec3::new(0.55 + x, -0.95, 0.5 + z);
    let panel = [low(-0.1, -0.1), low(-0.1, 0.1), low(0.1, 0.1), low(0.1, -0.1)];
    scene.triangles.extend(quad(panel, PANEL));
    scene.triangles.extend(cuboid(Vec3::new(-0.6, -0.9, 0.5), Vec3::splat(0.08), GHOST));
    // Neighbouring triangles are of different objects.
    scene.objects = (0..5).map(|object| format!("object {object}")).collect();
    for (index, triangle) in (0..).zip(&mut scene.triangles) {
        triangle.object = index % 5;
    }
    scene
}

fn materials() -> Vec<Material> {
    let glossy = |metallic: f32, roughness: f32, transmission| Reflection::MetallicRoughness {
        base_colour: Vec3::new(0.9, 0.8, 0.7),
        metallic,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission,
    };
    let absorption = Vec3::new(0.1, 0.5, 1.0);
    let clear = Transmission { factor: 0.95, ior: 1.5, is_volume: true, absorption };
    let thin = Transmission { is_volume: false, ..clear };
    let none = Layers::none(Vec3::splat(0.04));
    vec![
        lambertian("wall", 0.6),
        Material { emission: Vec3::splat(12.0), ..lambertian("lamp", 0.0) },
        Material { base_texture: Some(0), ..lambertian("paper", 0.9) },
        Material {
            base_texture: Some(1),
            metallic_roughness_texture: Some(2),
            ..Material::new("metal", glossy(0.8, 0.6, None))
        },
        Material::new("mirror", glossy(1.0, 0.0, None)),
        Material::new("glass", glossy(0.0, 0.0, Some(clear))),
        Material {
            alpha_cutoff: Some(0.4),
            base_texture: Some(3),
            double_sided: true,
            ..lambertian("lattice", 0.8)
        },
        Material { emission: Vec3::splat(2.0), emissive_texture: Some(0), ..lambertian("screen", 0.1) },
        Material {
            blends: true,
            alpha: 0.9,
            base_texture: Some(3),
            double_sided: true,
            layers: Some(Box::new(veil(&none))),
            ..Material::new("veil", glossy(0.0, 0.8, None))
        },
        Material {
            metallic_roughness_texture: Some(2),
            layers: Some(Box::new(varnish(&none))),
            ..Material::new("varnished", glossy(0.3, 0.9, None))
        },
        Material {
            layers: Some(Box::new(Layers { transmission_texture: Some(2), ..none.clone() })),
            ..Material::new("pane", glossy(0.0, 0.4, Some(thin)))
        },
        Material::new("ice", glossy(0.1, 0.3, Some(clear))),
        Material { layers: bumpy(0.7), ..Material::new("bumps", glossy(0.9, 0.3, None)) },
        Material { layers: bumpy(-0.4), double_sided: true, ..lambertian("dents", 0.7) },
        Material {
            blends: true,
            alpha: 0.8,
            base_texture: Some(3),
            layers: Some(Box::new(Layers { transmission_texture: Some(2), ..varnish(&none) })),
            ..Material::new("window", glossy(0.0, 0.0, Some(thin)))
        },
        Material {
            emission: Vec3::new(3.0, 4.0, 5.0),
            visibility: Visibility { camera: false, light: false },
            ..lambertian("panel", 0.0)
        },
        Material { visibility: Visibility { camera: false, light: true }, ..lambertian("ghost", 0.5) },
    ]
}

fn bumpy(scale: f32) -> Option<Box<Layers>> {
    Some(Box::new(Layers {
        normal: Some(NormalMap { texture: 4, scale }),
        ..Layers::none(Vec3::splat(0.04))
    }))
}

fn veil(none: &Layers) -> Layers {
    let colour = Vec3::new(0.3, 0.5, 0.4);
    let sheen = Sheen { colour, roughness: 0.6, colour_texture: Some(0), roughness_texture: Some(3) };
    let leaf = DiffuseTransmission {
        factor: 0.7,
        colour: Vec3::new(0.5, 0.9, 0.3),
        factor_texture: Some(3),
        colour_texture: Some(0),
    };
    Layers { sheen: Some(sheen), diffuse_transmission: Some(leaf), ..none.clone() }
}

fn varnish(none: &Layers) -> Layers {
    let (factor_texture, roughness_texture) = (Some(2), Some(2));
    let coat = Coat { factor: 0.9, roughness: 0.4, factor_texture, roughness_texture, normal: None };
    let specular = Vec3::new(0.9, 0.2, 0.1);
    Layers {
        coat: Some(coat),
        specular,
        specular_texture: Some(3),
        specular_colour_texture: Some(0),
        ..none.clone()
    }
}

fn add_textures(scene: &mut Scene) {
    let texel = |x: u32, y: u32, k: u32| (x * 53 + y * 97 + k * 71 + x * y * 13) as u8;
    let image = |width: u32, height: u32, encoding| Image {
        name: "image".into(),
        width,
        height,
        texels: (0..width * height).map(|i| [0, 1, 2, 3].map(|k| texel(i % width, i / width, k))).collect(),
        encoding,
    };
    let mut normals = image(7, 6, Encoding::Linear);
    normals.texels.iter_mut().for_each(|[_, _, blue, _]| *blue |= 192);
    scene.images = vec![image(13, 9, Encoding::Srgb), image(16, 4, Encoding::Linear), normals];
    scene.textures = vec![
        Texture::new(0),
        Texture { set: 1, wrap: [Wrap::Mirror, Wrap::Clamp], ..Texture::new(0) },
        Texture { nearest: true, matrix: [[0.8, 0.6], [-0.6, 0.8]], offset: [0.3, 0.1], ..Texture::new(1) },
        Texture { wrap: [Wrap::Repeat, Wrap::Mirror], ..Texture::new(0) },
        Texture { wrap: [Wrap::Mirror; 2], ..Texture::new(2) },
    ];
}

/// Luminaire of two unequal sides.
const PROFILE: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 5 1 2 0 0 0\n1 1 10\n0 45 120\n0 90 180 270 360\n\
     1 .8 0  1 .3 .1  1 .2 .4  1 .9 .2  1 .8 0\n";

/// Appends an item; returns its index.
fn add<T>(list: &mut Vec<T>, item: T) -> u32 {
    list.push(item);
    list.len() as u32 - 1
}

fn add_lights(scene: &mut Scene) {
    let corner = |x: f32, z: f32| Vec3::new(0.3 * x, 0.98, 0.3 * z);
    let lamp = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], LAMP);
    scene.triangles.extend(lamp);
    let direction = Vec3::new(0.2, -0.5, -0.8).normalize();
    let position = Vec3::new(-0.7, 0.6, 0.5);
    let axes = LightAxes { aim: Vec3::new(0.6, -0.8, 0.0), across: Vec3::new(0.8, 0.6, 0.0) };
    let LightProfile { image, texture, .. } =
        LightProfile::parse(PROFILE.as_bytes(), Path::new("lamp.ies")).expect("it is one");
    let [texture, image] = [add(&mut scene.textures, texture), add(&mut scene.images, image)];
    scene.textures[texture as usize].image = image;
    scene.lights = [
        PunctualKind::Profile { position: Vec3::new(-0.6, 0.8, -0.5), texture },
        PunctualKind::Point { position: Vec3::new(0.7, 0.5, 0.6) },
        PunctualKind::Spot { position, direction, inner_cosine: 0.9, outer_cosine: 0.7 },
        PunctualKind::Directional { direction, angle: 0.0 },
    ]
    .map(|kind| PunctualLight { name: "light".into(), kind, intensity: Vec3::new(0.9, 1.0, 0.8), axes })
    .to_vec();
    let texels = (0..32).map(|i| [0.2 + (i % 7) as f32 * 0.3, 0.5, (i % 3) as f32]).collect();
    scene.environment = Some(Environment { width: 8, height: 4, texels, strength: 1.0 });
}
