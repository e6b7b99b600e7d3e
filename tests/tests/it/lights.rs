//! Lights of every kind give a floor its known radiance, by shadow rays, by gather rays and by both.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Camera, Encoding, Environment, Image, LightAxes, Material, Projection, PunctualKind, PunctualLight,
    Scene, Texture, Triangle, VertexAttributes,
};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, scene};

const ALBEDO: f32 = 0.5;

/// Square floor at y = 0 that faces up.
fn floor(half: f32, material: u32) -> [Triangle; 2] {
    let at = |x: f32, z: f32| Vec3::new(x * half, 0.0, z * half);
    quad([at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0), at(-1.0, -1.0)], material)
}

/// Camera that sees about a centimetre of the floor around `place`.
fn view(place: Vec3) -> Camera {
    let origin = place + Vec3::new(0.3, 1.0, 0.2);
    Camera { projection: Projection::perspective(0.01), ..camera(origin, place - origin) }
}

fn bare_floor(place: Vec3) -> Scene {
    scene(floor(10.0, 0).to_vec(), vec![lambertian("floor", ALBEDO)], view(place))
}

fn lit_by(kind: PunctualKind, intensity: f32, place: Vec3) -> Scene {
    let light = PunctualLight {
        name: "light".into(),
        kind,
        intensity: Vec3::splat(intensity),
        axes: LightAxes::default(),
    };
    bare_floor(place).with(|scene| scene.lights = vec![light])
}

/// Settings with `shadow_rays` and `gather_rays` per sample.
fn settings(shadow_rays: u32, gather_rays: u32) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 8, height: 8, ..Picture::default() },
        photons: PhotonMaps { count: 2000, neighbors: 20, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays, shadow_rays, samples: 4, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:1".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

fn seen(scene: &Scene, settings: &RenderSettings) -> f64 {
    mean(&radiances(&render_or_panic(scene, settings).film))
}

fn check(scene: &Scene, settings: &RenderSettings, expected: f64, tolerance: f64) {
    let found = seen(scene, settings);
    let error = if expected > 0.0 { found / expected - 1.0 } else { found };
    assert!(error.abs() <= tolerance, "{found} instead of {expected}: off by {error}");
}

/// Radiance of the Lambertian floor under an irradiance.
fn reflected(irradiance: f64) -> f64 {
    f64::from(ALBEDO) / PI * irradiance
}

#[test]
fn a_point_lights_by_the_cosine_and_the_inverse_square_of_its_distance() {
    let height = 2.0_f64;
    for x in [0.0_f64, 1.0, 3.0] {
        let place = Vec3::new(x as f32, 0.0, 0.0);
        let kind = PunctualKind::Point { position: Vec3::new(0.0, height as f32, 0.0) };
        let distance = (x * x + height * height).sqrt();
        let expected = reflected(7.0 * height / distance.powi(3));
        check(&lit_by(kind, 7.0, place), &settings(1, 0), expected, 0.005);
        // Gather rays neither add nor remove light of a punctual light.
        check(&lit_by(kind, 7.0, place), &settings(1, 16), expected, 0.005);
    }
}

#[test]
fn a_spot_falls_off_between_its_cones() {
    let height = 2.0_f64;
    let [inner, outer] = [0.95_f64, 0.8];
    let kind = PunctualKind::Spot {
        position: Vec3::new(0.0, height as f32, 0.0),
        direction: Vec3::NEG_Y,
        inner_cosine: inner as f32,
        outer_cosine: outer as f32,
    };
    for cosine in [1.0_f64, 0.96, 0.9, 0.85, 0.79, 0.5] {
        let distance = height / cosine;
        let x = (distance * distance - height * height).sqrt();
        let share = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
        let expected = reflected(5.0 * share * cosine / (distance * distance));
        check(&lit_by(kind, 5.0, Vec3::new(x as f32, 0.0, 0.0)), &settings(2, 0), expected, 0.01);
    }
}

#[test]
fn a_directional_light_lights_by_the_cosine_at_every_point() {
    for direction in [Vec3::NEG_Y, Vec3::new(1.0, -1.0, 0.5), Vec3::new(-3.0, -0.5, 0.0)] {
        let direction = direction.normalize();
        let kind = PunctualKind::Directional { direction, angle: 0.0 };
        let expected = reflected(4.0 * f64::from(-direction.y));
        for x in [0.0, 5.0] {
            check(&lit_by(kind, 4.0, Vec3::new(x, 0.0, 0.0)), &settings(1, 0), expected, 1e-4);
        }
    }
}

#[test]
fn a_disk_of_any_angle_gives_the_irradiance_of_a_directional_light() {
    for (direction, degrees) in
        [(Vec3::NEG_Y, 180.0_f32), (Vec3::NEG_Y, 90.0), (Vec3::new(1.0, -1.0, 0.5), 60.0)]
    {
        let direction = direction.normalize();
        let kind = PunctualKind::Directional { direction, angle: degrees.to_radians() };
        let expected = reflected(4.0 * f64::from(-direction.y));
        check(&lit_by(kind, 4.0, Vec3::ZERO), &settings(64, 0), expected, 0.005);
    }
}

/// A vertical light of a disk 10 degrees across is hidden by a board 1 m above the floor, whose edge is at x
/// = 0. At the distance x from the edge's shadow, the disk's visible part is a segment of a circle.
#[test]
fn the_penumbra_of_a_disk_is_as_wide_as_its_angle() {
    let angle = 10.0_f32.to_radians();
    let kind = PunctualKind::Directional { direction: Vec3::NEG_Y, angle };
    let reach = f64::from(angle / 2.0).tan();
    let at = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let board = quad([at(0.0, 4.0), at(4.0, 4.0), at(4.0, -4.0), at(0.0, -4.0)], 1);
    for share in [-1.1, -0.8, -0.4, 0.0, 0.4, 0.8, 1.1] {
        // The camera stands beside the board.
        let place = Vec3::new((share * reach) as f32, 0.0, 0.0);
        let origin = place + Vec3::new(-1.0, 0.5, 0.0);
        let view = Camera { projection: Projection::perspective(0.002), ..camera(origin, place - origin) };
        let scene = lit_by(kind, 4.0, place).with(|scene| {
            scene.triangles.extend(board);
            scene.materials.push(Material { double_sided: true, ..lambertian("board", 0.0) });
            scene.cameras = vec![view];
        });
        let edge = share.clamp(-1.0, 1.0);
        let visible = (edge.acos() - edge * (1.0 - edge * edge).sqrt()) / PI;
        let found = seen(&scene, &settings(64, 0)) / reflected(4.0);
        assert!((found - visible).abs() < 0.01, "{share}: {found} instead of {visible}");
    }
}

#[test]
fn a_floor_under_a_constant_environment_shows_its_albedo() {
    let environment = Some(Environment::constant(Vec3::splat(3.0)));
    let scene = bare_floor(Vec3::ZERO).with(|scene| scene.environment = environment);
    let expected = 3.0 * f64::from(ALBEDO);
    check(&scene, &settings(64, 0), expected, 0.01);
    // Without shadow rays, gather rays carry the light of the sky: cosine-weighted, they do so without noise.
    check(&scene, &settings(0, 16), expected, 1e-4);
    check(&scene, &settings(32, 32), expected, 0.01);
}

/// Sky of 8x4 texels, two of which are bright.
fn sky() -> Environment {
    let mut texels = vec![[0.25, 0.5, 1.0]; 32];
    texels[9..11].fill([30.0, 20.0, 10.0]);
    Environment { width: 8, height: 4, texels, strength: 1.0 }
}

#[test]
fn the_eye_sees_the_environment() {
    // Direction of the texel in row 1, column 4 of 8, next to the middle of the map.
    let (theta, phi) = (PI * 1.5 / 4.0, 2.0 * PI * (4.5 / 8.0 - 0.5));
    let direction =
        Vec3::new((theta.sin() * phi.sin()) as f32, theta.cos() as f32, -(theta.sin() * phi.cos()) as f32);
    let view = Camera { projection: Projection::perspective(0.001), ..camera(Vec3::Y, direction) };
    let environment = Some(sky());
    let scene =
        bare_floor(Vec3::ZERO).with(|scene| (scene.environment, scene.cameras) = (environment, vec![view]));
    let film = render_or_panic(&scene, &settings(1, 1)).film;
    for pixel in radiances(&film) {
        for (found, expected) in pixel.into_iter().zip([0.25, 0.5, 1.0]) {
            assert!((found / expected - 1.0).abs() < 0.002, "{pixel:?}");
        }
    }
}

/// Floor below lamps of different sizes, heights and brightness, one of them double-sided, and a sky.
fn lamps_and_sky() -> Scene {
    let mut all = bare_floor(Vec3::ZERO);
    let mut lamp = |centre: Vec3, half: f32, emission: f32, double_sided: bool| {
        let material = all.materials.len() as u32;
        let at = |x: f32, z: f32| centre + Vec3::new(x * half, 0.3 * x * half, z * half);
        all.triangles.extend(quad([at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)], material));
        let emission = Vec3::splat(emission);
        all.materials.push(Material { emission, double_sided, ..lambertian("lamp", 0.0) });
    };
    lamp(Vec3::new(0.5, 1.2, -0.5), 0.2, 20.0, false);
    lamp(Vec3::new(-1.5, 0.8, 0.5), 0.3, 5.0, true);
    lamp(Vec3::new(4.0, 3.0, 2.0), 1.0, 8.0, false);
    lamp(Vec3::new(0.0, 2.5, 3.0), 0.05, 300.0, false);
    all.environment = Some(sky());
    all
}

#[test]
fn shadow_rays_gather_rays_and_both_give_equal_light() {
    let scene = lamps_and_sky();
    let many =
        |shadow_rays, gather_rays| settings(shadow_rays, gather_rays).with(|s| s.integrator.samples = 64);
    let by_shadow_rays = seen(&scene, &many(64, 0));
    let by_gather_rays = seen(&scene, &many(0, 1024));
    let by_both = seen(&scene, &many(32, 64));
    for (found, name) in [(by_gather_rays, "gather rays"), (by_both, "both")] {
        let error = found / by_shadow_rays - 1.0;
        assert!(error.abs() < 0.015, "{name}: {found} instead of {by_shadow_rays}, off by {error}");
    }
}

/// Floor below an emissive panel, with the emissive texture `image` if stated.
fn panel(emission: f32, image: Option<Image>) -> Scene {
    let at = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    let mut scene = bare_floor(Vec3::new(0.2, 0.0, 0.1));
    let corners = [at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.5), at(-0.5, 0.5)];
    scene.triangles.extend(quad(corners, 1));
    let mut material = lambertian("panel", 0.0);
    material.emission = Vec3::splat(emission);
    if let Some(image) = image {
        scene.images.push(image);
        scene.textures.push(Texture::new(0));
        material.emissive_texture = Some(0);
        let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        for (corners, index) in [([a, b, c], 0), ([a, c, d], 1)] {
            scene.attributes.push(VertexAttributes { coordinates: [corners; 2], ..VertexAttributes::NONE });
            scene.triangles[2 + index as usize].attributes = index;
        }
    }
    scene.materials.push(material);
    scene
}

#[test]
fn a_panel_with_a_fine_texture_lights_by_its_mean() {
    let texel = |i: u32| if (i / 32 + i % 32).is_multiple_of(4) { [255; 4] } else { [0, 0, 0, 255] };
    let texels = (0..32 * 32).map(texel).collect();
    let image = Image { name: "grid".into(), width: 32, height: 32, texels, encoding: Encoding::Srgb };
    let many = settings(64, 0).with(|s| s.integrator.samples = 16);
    let plain = seen(&panel(2.0, None), &many);
    for settings in [many, settings(64, 256)] {
        let textured = seen(&panel(8.0, Some(image.clone())), &settings);
        assert!((textured / plain - 1.0).abs() < 0.02, "{textured} instead of {plain}");
    }
}

#[test]
fn a_white_bowl_under_a_white_sky_is_white() {
    // Of albedo 1, the bowl reflects all light: each of its points has the radiance of the sky.
    let at = Vec3::new;
    let ring = [at(-1.0, 0.0, 1.0), at(1.0, 0.0, 1.0), at(1.0, 0.0, -1.0), at(-1.0, 0.0, -1.0)];
    let rim = ring.map(|corner| corner * 1.5 + Vec3::Y);
    let mut triangles = quad(ring, 0).to_vec();
    for side in 0..4 {
        let next = (side + 1) % 4;
        triangles.extend(quad([ring[next], ring[side], rim[side], rim[next]], 0));
    }
    let white = Material { double_sided: true, ..lambertian("white", 1.0) };
    let mut bowl = scene(triangles, vec![white], camera(at(0.2, 2.5, 0.3), at(0.01, -1.0, 0.02)));
    bowl.cameras[0].projection = Projection::perspective(0.5);
    bowl.environment = Some(Environment::constant(Vec3::splat(2.0)));
    let settings = settings(16, 64).with(|s| {
        s.photons.count = 200_000;
        s.photons.neighbors = 60;
    });
    check(&bowl, &settings, 2.0, 0.02);
}
