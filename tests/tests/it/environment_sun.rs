//! An environment map with a sun of one texel gives the sun's irradiance, with little noise.

use std::f64::consts::PI;

use glam::Vec3;
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Camera, Environment, Projection, Scene};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, scene};

const WIDTH: u32 = 2048;
const ALBEDO: f32 = 0.5;
const SKY: f32 = 0.2;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 2000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 4, shadow_rays: 1, samples: 16, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

/// Floor under a uniform sky with a sun at one texel.
fn floor_under(column: u32, row: u32, sun: f32) -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, -z);
    let floor = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 0);
    let view = camera(Vec3::new(0.0, 1.0, 1e-3), Vec3::new(0.0, -1.0, -1e-3));
    let view = Camera { projection: Projection::perspective(0.5), ..view };
    let mut texels = vec![[SKY; 3]; (WIDTH * WIDTH / 2) as usize];
    texels[(row * WIDTH + column) as usize] = [sun; 3];
    let environment = Environment { width: WIDTH, height: WIDTH / 2, texels, strength: 1.0 };
    let mut scene = scene(floor.to_vec(), vec![lambertian("floor", ALBEDO)], view);
    scene.environment = Some(environment);
    scene
}

/// Expected radiance of the floor. Interpolation spreads the sun's texel over its neighbours; its power is
/// that of the texel's own solid angle.
fn expected(row: u32, sun: f32) -> f64 {
    let angle = PI * (f64::from(row) + 0.5) / f64::from(WIDTH / 2);
    let solid_angle = (2.0 * PI / f64::from(WIDTH)).powi(2) * angle.sin();
    let irradiance = f64::from(sun - SKY) * solid_angle * angle.cos() + PI * f64::from(SKY);
    f64::from(ALBEDO) / PI * irradiance
}

#[test]
fn a_sun_of_one_texel_lights_a_floor_evenly() {
    // In the middle of a cell, and at a corner of four.
    for (column, row, sun) in [(701, 206, 1e5_f32), (512, 128, 1e6), (1023, 400, 1e4)] {
        let pixels = radiances(&render_or_panic(&floor_under(column, row, sun), &settings()).film);
        let expected = expected(row, sun);
        let found = mean(&pixels);
        assert!((found / expected - 1.0).abs() < 0.01, "{column} {row}: {found} instead of {expected}");
        let squares = pixels.iter().map(|[red, ..]| (f64::from(*red) / expected - 1.0).powi(2));
        let deviation = (squares.sum::<f64>() / pixels.len() as f64).sqrt();
        assert!(deviation < 0.2, "{column} {row}: {deviation}");
    }
}
