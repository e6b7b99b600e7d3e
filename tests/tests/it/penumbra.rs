//! Shadow rays of many samples, one ray each, are stratified over a lamp as those of one sample are.

use glam::Vec3;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Material, Scene};
use photoncard_tests::{camera, lambertian, quad, radiances, render_or_panic, scene};

/// Floor below a square lamp, half of it in the shadow of a board between them.
fn penumbra() -> Scene {
    let at = Vec3::new;
    let floor = [at(-2.0, -1.0, 2.0), at(2.0, -1.0, 2.0), at(2.0, -1.0, -2.0), at(-2.0, -1.0, -2.0)];
    let lamp = [at(-0.5, 1.0, -0.5), at(0.5, 1.0, -0.5), at(0.5, 1.0, 0.5), at(-0.5, 1.0, 0.5)];
    let board = [at(-2.0, 0.0, 2.0), at(0.0, 0.0, 2.0), at(0.0, 0.0, -2.0), at(-2.0, 0.0, -2.0)];
    let triangles = [quad(floor, 0), quad(lamp, 1), quad(board, 2)].concat();
    let materials = vec![
        lambertian("floor", 0.5),
        Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) },
        Material { double_sided: true, ..lambertian("board", 0.0) },
    ];
    scene(triangles, materials, camera(at(0.0, -0.3, 0.0), at(0.01, -1.0, 0.0)))
}

fn picture(samples: u32, shadow_rays: u32, seed: u32) -> Vec<f64> {
    let settings = RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 1000, ..PhotonMaps::default() },
        integrator: Integrator { samples, shadow_rays, seed, gather_rays: 0, ..Integrator::default() },
        ..RenderSettings::default()
    };
    let rendering = render_or_panic(&penumbra(), &settings);
    radiances(&rendering.film).iter().map(|&[red, _, _]| f64::from(red)).collect()
}

fn rmse(picture: &[f64], reference: &[f64]) -> f64 {
    let squares = picture.iter().zip(reference).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / reference.len() as f64).sqrt()
}

#[test]
fn the_samples_of_a_pixel_share_a_pattern_of_points_on_the_lamp() {
    let reference = picture(256, 4, 99);
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    let together = picture(16, 1, 0);
    let mut apart = vec![0.0; reference.len()];
    for seed in 1..=16 {
        apart.iter_mut().zip(picture(1, 1, seed)).for_each(|(sum, pixel)| *sum += pixel / 16.0);
    }
    let [together, apart] = [rmse(&together, &reference), rmse(&apart, &reference)];
    assert!(apart > 0.01 * mean, "the lamp is half hidden: {apart}");
    assert!(together < 0.7 * apart, "{together} of {apart}");
}
