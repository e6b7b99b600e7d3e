//! Energy of the photon pass: photons store the power that each kind of light emits towards surfaces.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::{trace, trace_caustics};
use photoncard_driver::scene::{
    Encoding, Environment, Image, LightAxes, Material, PunctualKind, PunctualLight, Reflection, Scene,
    Texture, Triangle, VertexAttributes,
};
use photoncard_firmware::scene::light::{environment_direction, environment_radiance};
use photoncard_tests::{camera, lambertian, quad, room, scene};

const PHOTONS: usize = 200_000;
/// Albedo of surfaces that are nearly black, but store photons.
const BLACK: f32 = 0.001;

/// Power of all stored photons per channel, W.
fn stored(scene: &Scene) -> [f64; 3] {
    let packed = PackedScene::new(scene).unwrap();
    let photons = trace(&packed, 11, PHOTONS, &|_| true).unwrap().photons;
    let unit = f64::from(photons.power_unit());
    std::array::from_fn(|channel| {
        photons.iter().map(|photon| f64::from(photon.power.decode()[channel]) * unit).sum()
    })
}

fn check(scene: &Scene, expected: [f64; 3], what: &str) {
    for (found, expected) in stored(scene).into_iter().zip(expected) {
        let error = found * (1.0 - f64::from(BLACK)) / expected - 1.0;
        assert!(error.abs() < 0.006, "{what}: {found} W instead of {expected} W, off by {error}");
    }
}

/// Closed room whose walls are nearly black.
fn inside() -> Scene {
    scene(room([0; 6]), vec![lambertian("wall", BLACK)], camera(Vec3::ZERO, Vec3::NEG_Z))
}

/// Nearly black cube of side 2 that faces outwards.
fn outside() -> Scene {
    let mut cube = inside();
    for Triangle { vertices: [_, b, c], .. } in &mut cube.triangles {
        std::mem::swap(b, c);
    }
    cube
}

fn light(kind: PunctualKind, intensity: [f32; 3]) -> PunctualLight {
    PunctualLight { name: "light".into(), kind, intensity: intensity.into(), axes: LightAxes::default() }
}

const COLOUR: [f32; 3] = [3.0, 2.0, 0.5];

fn times(colour: [f32; 3], factor: f64) -> [f64; 3] {
    colour.map(|channel| f64::from(channel) * factor)
}

#[test]
fn point_and_spot_lights_emit_their_intensity_over_their_directions() {
    let position = Vec3::new(0.2, 0.1, -0.3);
    let mut room = inside();
    room.lights = vec![light(PunctualKind::Point { position }, COLOUR)];
    check(&room, times(COLOUR, 4.0 * PI), "point");
    for (inner, outer) in [(0.9_f64, 0.6_f64), (1.0, 0.999_9), (0.5, -0.5)] {
        let direction = Vec3::new(1.0, 2.0, -0.5).normalize();
        let kind = PunctualKind::Spot {
            position,
            direction,
            inner_cosine: inner as f32,
            outer_cosine: outer as f32,
        };
        room.lights = vec![light(kind, COLOUR)];
        // Mean over the cone of the falloff of `KHR_lights_punctual`, integrated numerically.
        let width = (f64::from(inner as f32) - f64::from(outer as f32)).max(0.001);
        let steps = 10_000;
        let share = |i: i32| {
            let above = (f64::from(i) + 0.5) / f64::from(steps) * (1.0 - f64::from(outer as f32));
            (above / width).min(1.0).powi(2)
        };
        let mean = (0..steps).map(share).sum::<f64>() / f64::from(steps);
        let solid_angle = 2.0 * PI * (1.0 - f64::from(outer as f32)) * mean;
        check(&room, times(COLOUR, solid_angle), "spot");
    }
}

#[test]
fn a_directional_light_gives_its_irradiance_to_surfaces_that_face_it() {
    for direction in [Vec3::NEG_Y, Vec3::new(1.0, -2.0, 0.5)] {
        let direction = direction.normalize();
        let mut cube = outside();
        cube.lights = vec![light(PunctualKind::Directional { direction, angle: 0.0 }, COLOUR)];
        let shown = 4.0 * f64::from(direction.abs().element_sum());
        check(&cube, times(COLOUR, shown), "directional");
    }
    // A hemisphere of radiance E / pi gives E to the top and half of it to each of the four sides.
    let kind = PunctualKind::Directional { direction: Vec3::NEG_Y, angle: PI as f32 };
    let mut cube = outside();
    cube.lights = vec![light(kind, COLOUR)];
    check(&cube, times(COLOUR, 4.0 + 4.0 * 2.0), "a hemisphere");
}

#[test]
fn an_environment_gives_its_radiance_to_all_sides() {
    let mut cube = outside();
    cube.environment = Some(Environment::constant(COLOUR.into()));
    check(&cube, times(COLOUR, PI * 24.0), "constant");
    let mut texels = vec![[0.2, 0.3, 0.4]; 96 * 48];
    for row in 5..9 {
        texels[row * 96 + 20..][..6].fill([300.0, 200.0, 100.0]);
    }
    cube.environment = Some(Environment { width: 96, height: 48, texels, strength: 1.0 });
    check(&cube, received(&cube), "map");
}

/// Power that the cube receives from its environment, W: the integral over directions of radiance times
/// projected area.
fn received(cube: &Scene) -> [f64; 3] {
    let packed = PackedScene::new(cube).unwrap();
    let (image, mut memory) = packed.view();
    let [columns, rows] = [768, 768];
    let mut sum = [0.0; 3];
    for row in 0..rows {
        let cosine = 1.0 - (row as f32 + 0.5) / rows as f32 * 2.0;
        for column in 0..columns {
            let direction = environment_direction((column as f32 + 0.5) / columns as f32, cosine);
            let radiance = environment_radiance(&image, &mut memory, direction).unwrap();
            let shown = 4.0 * f64::from(direction.abs().element_sum()) * 4.0 * PI / f64::from(columns * rows);
            sum.iter_mut().zip(radiance.to_array()).for_each(|(sum, r)| *sum += f64::from(r) * shown);
        }
    }
    sum
}

#[test]
fn a_panel_with_a_texture_emits_its_mean_and_all_lights_together_their_sum() {
    // One corner of the panel's emissive texture glows. At first there is no point light.
    let mut texels = vec![[0, 0, 0, 255]; 16 * 16];
    for row in 2..6 {
        texels[row * 16 + 3..][..5].fill([255; 4]);
    }
    let image = Image { name: "corner".into(), width: 16, height: 16, texels, encoding: Encoding::Srgb };
    let corner = |x: f32, z: f32| Vec3::new(0.5 * x, -0.2, 0.5 * z);
    let mut all = inside();
    all.images.push(image);
    all.textures.push(Texture::new(0));
    all.triangles.extend(quad([corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)], 1));
    let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    for (corners, index) in [([a, b, c], 0), ([a, c, d], 1)] {
        all.attributes.push(VertexAttributes { coordinates: [corners; 2], ..VertexAttributes::NONE });
        all.triangles[12 + index as usize].attributes = index;
    }
    all.materials.push(Material {
        emission: COLOUR.into(),
        double_sided: true,
        emissive_texture: Some(0),
        ..lambertian("panel", BLACK)
    });
    // Interpolation keeps the mean of the texels, as those at the borders are black.
    let panel = 2.0 * PI * 20.0 / 256.0;
    check(&all, times(COLOUR, panel), "panel");
    all.lights = vec![light(PunctualKind::Point { position: Vec3::new(0.0, 0.5, 0.0) }, COLOUR)];
    check(&all, times(COLOUR, panel + 4.0 * PI), "panel and point");
}

/// Distance of each of two small cubes from the origin, metres.
const AFAR: f32 = 5.0;
/// Half side of a small cube, metres.
const HALF: f32 = 0.05;

/// Two small cubes, nearly black and far from each other.
fn far_cubes() -> Scene {
    let mut cubes = outside();
    let of = |x: f32| {
        let at = move |corner: Vec3| corner * HALF + Vec3::X * x;
        outside()
            .triangles
            .clone()
            .into_iter()
            .map(move |triangle| Triangle { vertices: triangle.vertices.map(at), ..triangle })
    };
    cubes.triangles = of(-AFAR).chain(of(AFAR)).collect();
    cubes
}

/// Power that both cubes receive from a light at `from`, W. `toward(way)` is the radiant intensity along the
/// vector `way` from the light to a surface, W/sr.
fn received_from(from: Vec3, toward: impl Fn(Vec3) -> f32) -> f64 {
    const STEPS: i32 = 8;
    let middle = |i: i32| ((i as f32 + 0.5) / STEPS as f32 * 2.0 - 1.0) * HALF;
    let mut sum = 0.0;
    for (x, axis, side) in
        [-AFAR, AFAR].into_iter().flat_map(|x| (0..6).map(move |face| (x, face % 3, face / 3)))
    {
        let normal = [Vec3::X, Vec3::Y, Vec3::Z][axis] * if side == 0 { 1.0 } else { -1.0 };
        let (along, across) = normal.any_orthonormal_pair();
        for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
            let place = Vec3::X * x + normal * HALF + along * middle(i) + across * middle(j);
            let way = place - from;
            let cosine = -normal.dot(way.normalize());
            sum += f64::from(toward(way).max(0.0) * cosine.max(0.0) / way.length_squared());
        }
    }
    sum * f64::from((2.0 * HALF / STEPS as f32).powi(2))
}

#[test]
fn photons_are_aimed_at_surfaces_far_from_the_lights() {
    let position = Vec3::new(0.5, 3.0, 1.0);
    let mut cubes = far_cubes();
    cubes.lights = vec![light(PunctualKind::Point { position }, COLOUR)];
    check(&cubes, times(COLOUR, received_from(position, |_| 1.0)), "point");
    let direction = (Vec3::X * AFAR - position).normalize();
    let kind = PunctualKind::Spot { position, direction, inner_cosine: 0.9, outer_cosine: 0.8 };
    cubes.lights = vec![light(kind, COLOUR)];
    let in_spot = |way: Vec3| if way.x > 0.0 { 1.0 } else { 0.0 };
    check(&cubes, times(COLOUR, received_from(position, in_spot)), "spot");
    let direction = Vec3::new(0.3, -1.0, 0.2).normalize();
    cubes.lights = vec![light(PunctualKind::Directional { direction, angle: 0.0 }, COLOUR)];
    let shown = f64::from(direction.abs().element_sum() * 8.0 * HALF * HALF);
    check(&cubes, times(COLOUR, shown), "directional");
    cubes.lights.clear();
    cubes.environment = Some(Environment::constant(COLOUR.into()));
    check(&cubes, times(COLOUR, PI * f64::from(48.0 * HALF * HALF)), "environment");
}

#[test]
fn photons_of_panels_are_aimed() {
    let middle = Vec3::new(0.5, 3.0, 1.0);
    for double_sided in [false, true] {
        let mut cubes = far_cubes();
        let mut lamp = lambertian("lamp", 0.0);
        (lamp.emission, lamp.double_sided) = (COLOUR.into(), double_sided);
        cubes.materials.push(lamp);
        // The front of the lamp faces one of the cubes, its back the other.
        let normal = Vec3::new(1.0, -0.4, 0.0).normalize();
        let (along, across) = normal.any_orthonormal_pair();
        let corner = |x: f32, y: f32| middle + along * (0.2 * x) + across * (0.2 * y);
        cubes
            .triangles
            .extend(quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], 1));
        let steps = 8;
        let at = |i: i32| (i as f32 + 0.5) / steps as f32 * 2.0 - 1.0;
        let points = (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j)));
        let sum: f64 = points
            .map(|(i, j)| {
                received_from(corner(at(i), at(j)), |way| {
                    let cosine = normal.dot(way.normalize());
                    if double_sided { cosine.abs() } else { cosine }
                })
            })
            .sum();
        check(&cubes, times(COLOUR, sum * f64::from(0.4_f32 * 0.4) / f64::from(steps * steps)), "panel");
    }
}

/// Mirror of 10 m on the ground under a slanting sun, with a plate of 1 m above it: of hundreds of paths that
/// hit the mirror, one hits the plate. A spot light gives the plate `lamp` times the light of the sun.
fn sun_over_a_mirror(lamp: f32) -> Scene {
    let smooth = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic: 1.0,
        roughness: 0.0,
        dielectric: Vec3::ZERO,
        grazing: 1.0,
        transmission: None,
    };
    let materials = vec![lambertian("black", BLACK), Material::new("mirror", smooth)];
    let square = |y: f32, side: f32, material| {
        let corner = |i: f32, j: f32| Vec3::new(0.5 * side * i, y, 0.5 * side * j);
        quad([corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)], material)
    };
    let mut triangles = [square(0.0, 10.0, 1), square(3.0, 1.0, 0)].concat();
    // The plate faces the mirror, downwards.
    triangles[2..].iter_mut().for_each(|triangle| triangle.vertices.reverse());
    let sun = light(
        PunctualKind::Directional { direction: Vec3::new(1.0, -1.0, 0.0).normalize(), angle: 0.0 },
        COLOUR,
    );
    let spot = PunctualKind::Spot {
        position: 2.0 * Vec3::Y,
        direction: Vec3::Y,
        inner_cosine: 0.9,
        outer_cosine: 0.8,
    };
    let spot = light(spot, COLOUR.map(|intensity| intensity * lamp));
    scene(triangles, materials, camera(Vec3::Y, Vec3::Y)).with(|scene| scene.lights = vec![sun, spot])
}

/// If caustics contribute almost no light, few paths are traced for them. The stored photons nevertheless
/// have the full power of the caustics.
#[test]
fn rare_caustics_have_few_paths_and_their_full_power() {
    const SEEDS: u32 = 16;
    let [much, little] = [0.0, 100.0].map(|lamp| {
        let packed = PackedScene::new(&sun_over_a_mirror(lamp)).unwrap();
        let (mut photons, mut power) = (0, [0.0; 3]);
        for seed in 0..SEEDS {
            let caustic = trace_caustics(&packed, seed, PHOTONS, &|| true).unwrap();
            let unit = f64::from(caustic.power_unit()) / f64::from(SEEDS);
            photons += caustic.len();
            for photon in caustic.iter() {
                let own = photon.power.decode();
                power.iter_mut().zip(own).for_each(|(sum, own)| *sum += f64::from(own) * unit);
            }
        }
        for (found, expected) in power.into_iter().zip(times(COLOUR, 0.5_f64.sqrt())) {
            let error = found / expected - 1.0;
            println!("lamp {lamp}: {photons} photons, {found} W, off by {error}");
            assert!(error.abs() < 0.02, "lamp {lamp}: {found} W instead of {expected} W, off by {error}");
        }
        photons
    });
    assert!(little > 0 && 6 * little < much, "{little} photons instead of {much}");
}
