//! Irradiance cache: interpolated light is right, other light is gathered, and fewer rays are cast.

use glam::Vec3;
use photoncard_driver::film::Window;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Sampling, Statistics};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_tests::mapped::{Frame, MappedScene};
use photoncard_tests::{camera, lambertian, mean, radiances, render_or_panic, room, scene};

fn load(name: &str) -> Scene {
    let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

/// Settings of a part of the Cornell box, at the resolution of a larger picture.
fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture {
            width: 256,
            height: 256,
            crop: Some(Window { x0: 32, x1: 224, y0: 112, y1: 144 }),
            ..Picture::default()
        },
        photons: PhotonMaps { count: 100_000, ..PhotonMaps::default() },
        integrator: Integrator { shadow_rays: 16, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

fn rmse(frame: &Frame, reference: &Frame) -> f32 {
    let pairs = frame.radiance.iter().zip(&reference.radiance);
    let squares: f32 = pairs.map(|(a, b)| a.distance_squared(*b) / 3.0).sum();
    (squares / frame.radiance.len() as f32).sqrt()
}

#[test]
fn most_pixels_of_the_cornell_box_are_interpolated_at_no_greater_error() {
    let mapped = MappedScene::new(load("cornell.gltf"), &settings());
    let with = |irradiance_error, gather_rays| {
        mapped.frame(&settings().with(|s| {
            s.picture.crop = Some(Window { x0: 32, x1: 224, y0: 120, y1: 136 });
            s.integrator.irradiance_error = irradiance_error;
            s.integrator.gather_rays = gather_rays;
        }))
    };
    // The noise of the reference is half of that without the cache, and adds to both errors alike.
    let reference = with(None, 400);
    let [off, on] = [with(None, 100), with(Some(0.025), 100)];
    let share = on.counters.interpolated_samples as f64 / on.counters.lambertian_samples as f64;
    assert!(share > 0.9, "only {share} interpolated");
    assert!(2 * on.counters.gathers < off.counters.gathers, "{:?}", on.counters);
    let [on, off] = [rmse(&on, &reference), rmse(&off, &reference)];
    assert!(on <= off, "the error is {on} with the cache and {off} without");
}

#[test]
fn a_smaller_error_takes_more_records() {
    let mapped = MappedScene::new(load("cornell.gltf"), &settings());
    let counters = [1e-4, 0.003, 0.03, 0.3].map(|error| {
        mapped
            .frame(&settings().with(|s| {
                s.integrator.irradiance_error = Some(error);
                s.integrator.gather_rays = 8;
            }))
            .counters
    });
    for pair in counters.windows(2) {
        assert!(pair[0].interpolated_samples <= pair[1].interpolated_samples, "{counters:?}");
        assert!(pair[0].gathers > pair[1].gathers, "{counters:?}");
    }
}

#[test]
fn sixteen_samples_cost_little_more_than_one() {
    let mapped = MappedScene::new(load("cornell.gltf"), &settings());
    let gathers = |samples| {
        let settings = settings().with(|s| {
            s.integrator.samples = samples;
            s.integrator.irradiance_error = Some(0.025);
        });
        mapped.frame(&settings).counters.gathers
    };
    let [one, sixteen] = [gathers(1), gathers(16)];
    assert!(sixteen * 2 < one * 3, "{one} gathers of one sample, {sixteen} of sixteen");
}

fn furnace(albedo: f32) -> Scene {
    let mut wall = lambertian("wall", albedo);
    wall.emission = Vec3::ONE;
    scene(room([0; 6]), vec![wall], camera(Vec3::new(0.2, -0.1, 0.6), Vec3::new(0.1, 0.2, -1.0)))
}

/// Walls emit 1 and reflect `albedo`: every pixel is `1 / (1 - albedo)`. Shadow rays and irradiance records
/// share the direct light, as the emissive walls are near and large.
#[test]
fn a_furnace_is_uniform_with_records_of_any_sampling() {
    for (albedo, sampling) in [
        (0.2, Sampling::Reflection),
        (0.5, Sampling::Photon),
        (0.8, Sampling::Product),
        (0.5, Sampling::Mixture),
        (0.8, Sampling::Focused),
    ] {
        let settings = RenderSettings {
            picture: Picture { width: 64, height: 64, ..Picture::default() },
            photons: PhotonMaps { count: 100_000, ..PhotonMaps::default() },
            integrator: Integrator {
                gather_rays: 64,
                samples: 2,
                irradiance_error: Some(0.025),
                sampling,
                ..Integrator::default()
            },
            ..RenderSettings::default()
        };
        let rendering = render_or_panic(&furnace(albedo), &settings);
        let Statistics { interpolated_share, .. } = rendering.statistics;
        assert!(interpolated_share > 0.85, "only {interpolated_share} interpolated");
        let found = mean(&radiances(&rendering.film)) * (1.0 - albedo as f64);
        assert!((found - 1.0).abs() < 0.01, "{sampling:?}, albedo {albedo}: {found} of what it must be");
    }
}

/// Compares mean squared differences of the error across borders of 16x16 cells with those across other
/// columns.
#[test]
fn no_seam_shows_at_the_borders_of_tiles() {
    let mapped = MappedScene::new(load("cornell.gltf"), &settings());
    let with = |seed, irradiance_error| {
        mapped
            .frame(&settings().with(|s| {
                s.integrator.seed = seed;
                s.integrator.irradiance_error = irradiance_error;
            }))
            .radiance
    };
    let [mut at_borders, mut elsewhere] = [(0.0_f64, 0_u32); 2];
    for seed in 0..4 {
        // Both renders have the same eye and shadow rays: their difference is the error of interpolation.
        let [on, off] = [with(seed, Some(0.025)), with(seed, None)];
        let errors: Vec<f32> = on.iter().zip(&off).map(|(on, off)| (*on - *off).element_sum()).collect();
        for row in errors.chunks(192) {
            for x in 1..192 {
                let sum = if (32 + x) % 16 == 0 { &mut at_borders } else { &mut elsewhere };
                sum.0 += ((row[x] - row[x - 1]) as f64).powi(2);
                sum.1 += 1;
            }
        }
    }
    let [at_borders, elsewhere] = [at_borders, elsewhere].map(|(sum, count)| (sum / count as f64).sqrt());
    assert!(at_borders < 1.15 * elsewhere, "{at_borders} at borders, {elsewhere} elsewhere");
}
