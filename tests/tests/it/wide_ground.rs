//! A product on a ground many kilometres wide is lit as on a small one.

use glam::Vec3;
use photoncard_driver::photon_map::PhotonsFor;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Environment, Scene};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, scene};

/// Radiance of the sky, W/(sr m^2).
const SKY: f32 = 1.0;
const ALBEDO_OF_GROUND: f32 = 0.5;
const ALBEDO_OF_BOX: f32 = 0.8;
/// Height of the ground (y), metres.
const HEIGHT: f32 = -0.137;
/// Side of the picture, pixels.
const SIDE: u32 = 16;
/// Side of a block, pixels.
const BLOCK: usize = 4;

/// Box of 10 cm on a ground of this half side, metres, under a constant sky. The picture shows a part of its
/// front.
fn product(half_side: f32) -> Scene {
    let on_ground = |x: f32, z: f32| Vec3::new(x, 0.0, z) * half_side + Vec3::Y * HEIGHT;
    let mut triangles =
        quad([on_ground(-1.0, 1.0), on_ground(1.0, 1.0), on_ground(1.0, -1.0), on_ground(-1.0, -1.0)], 0)
            .to_vec();
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * 0.1 + Vec3::Y * HEIGHT;
    triangles.extend(quad([at(-0.5, 0.0, 0.5), at(0.5, 0.0, 0.5), at(0.5, 1.0, 0.5), at(-0.5, 1.0, 0.5)], 1));
    triangles
        .extend(quad([at(0.5, 0.0, -0.5), at(-0.5, 0.0, -0.5), at(-0.5, 1.0, -0.5), at(0.5, 1.0, -0.5)], 1));
    triangles.extend(quad([at(0.5, 0.0, 0.5), at(0.5, 0.0, -0.5), at(0.5, 1.0, -0.5), at(0.5, 1.0, 0.5)], 1));
    triangles
        .extend(quad([at(-0.5, 0.0, -0.5), at(-0.5, 0.0, 0.5), at(-0.5, 1.0, 0.5), at(-0.5, 1.0, -0.5)], 1));
    triangles
        .extend(quad([at(-0.5, 1.0, 0.5), at(0.5, 1.0, 0.5), at(0.5, 1.0, -0.5), at(-0.5, 1.0, -0.5)], 1));
    let materials = vec![lambertian("ground", ALBEDO_OF_GROUND), lambertian("box", ALBEDO_OF_BOX)];
    let view = camera(Vec3::new(0.0, 0.05 + HEIGHT, 0.09), Vec3::NEG_Z);
    scene(triangles, materials, view)
        .with(|scene| scene.environment = Some(Environment::constant(Vec3::splat(SKY))))
}

/// Radiance of each pixel, W/(sr m^2).
fn picture(half_side: f32) -> Vec<[f32; 3]> {
    let settings = RenderSettings {
        picture: Picture { width: SIDE, height: SIDE, ..Picture::default() },
        photons: PhotonMaps { count: 200_000, photons_for: PhotonsFor::Camera, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 64, samples: 4, ..Integrator::default() },
        ..RenderSettings::default()
    };
    radiances(&render_or_panic(&product(half_side), &settings).film)
}

/// Means of the red channel over blocks of 4x4 pixels.
fn blocks(radiances: &[[f32; 3]]) -> Vec<f64> {
    let across = SIDE as usize / BLOCK;
    let mut sums = vec![0.0; across * across];
    for (index, [radiance, ..]) in radiances.iter().enumerate() {
        let (row, column) = (index / SIDE as usize, index % SIDE as usize);
        sums[row / BLOCK * across + column / BLOCK] += f64::from(*radiance) / (BLOCK * BLOCK) as f64;
    }
    sums
}

/// A vertical front sees half sky and half ground: its irradiance is `pi/2 (sky + ground)`. Near the box the
/// ground is a few per cent darker, as the box hides a part of the sky.
#[test]
fn a_product_is_lit_the_same_on_a_ground_of_10_m_and_of_1000_km() {
    let open = 0.5 * f64::from(ALBEDO_OF_BOX * SKY * (1.0 + ALBEDO_OF_GROUND));
    let half_sides = [10.0, 100.0, 1e3, 1e4, 1e5, 5e5];
    let pictures = half_sides.map(picture);
    let smallest = blocks(&pictures[0]);
    let compared = half_sides.iter().zip(&pictures).map(|(&half_side, picture)| {
        let deviations =
            blocks(picture).into_iter().zip(&smallest).map(|(own, other)| (own / other - 1.0).abs());
        (half_side, mean(picture) / open, deviations.fold(0.0, f64::max))
    });
    let compared: Vec<_> = compared.collect();
    println!("half side, m; mean over that of an open ground; worst block: {compared:?}");
    for (half_side, share, worst) in compared {
        assert!((0.96..1.01).contains(&share), "{half_side} m: {share}");
        assert!(worst < 0.05, "{half_side} m: {worst}");
    }
}
