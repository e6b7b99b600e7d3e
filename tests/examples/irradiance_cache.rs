//! Measures what the irradiance cache saves, and its error against a picture of many rays without
//! interpolation.
//!
//! `cargo run --release -p photoncard-tests --example irradiance_cache [SCENE [camera=NAME]
//! [crop=X0,X1,Y0,Y1]]`
//!
//! The picture has 512x512 pixels, of which the crop is rendered. The reference has the same eye and shadow
//! rays: only its indirect light differs.

use glam::Vec3;
use photoncard_driver::film::Window;
use photoncard_driver::render::{PhotonMaps, Picture, RenderSettings, Sampling};
use photoncard_driver::scene::gltf;
use photoncard_tests::mapped::MappedScene;

const ERRORS: [f32; 2] = [0.025, 0.1];
const REFERENCE_RAYS: u32 = 800;
const RAYS: u32 = 100;
const RAYS_OF_RECORD: u32 = 150;

fn rmse(image: &[Vec3], reference: &[Vec3]) -> f64 {
    let squares = image.iter().zip(reference).map(|(a, b)| a.distance_squared(*b) as f64 / 3.0);
    (squares.sum::<f64>() / image.len() as f64).sqrt()
}

fn mean(image: &[Vec3]) -> f64 {
    image.iter().map(|pixel| pixel.element_sum() as f64 / 3.0).sum::<f64>() / image.len() as f64
}

fn window(text: &str) -> Window {
    let ends: Vec<u32> = text.split(',').map(|end| end.parse().expect("a number")).collect();
    Window { x0: ends[0], x1: ends[1], y0: ends[2], y1: ends[3] }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "scenes/cornell.gltf".into());
    let mut settings = RenderSettings {
        picture: Picture { crop: Some(Window { x0: 64, x1: 448, y0: 192, y1: 320 }), ..Picture::default() },
        photons: PhotonMaps { count: 300_000, ..PhotonMaps::default() },
        ..RenderSettings::default()
    };
    for argument in arguments {
        match argument.split_once('=') {
            Some(("camera", camera)) => settings.picture.camera = Some(camera.into()),
            Some(("crop", crop)) => settings.picture.crop = Some(window(crop)),
            _ => panic!("{argument} is neither camera=NAME nor crop=X0,X1,Y0,Y1"),
        }
    }
    let mapped = MappedScene::new(gltf::load(path.as_ref()).expect("the scene loads"), &settings);
    let reference = mapped
        .frame(&settings.clone().with(|s| {
            s.integrator.gather_rays = REFERENCE_RAYS;
            s.integrator.shadow_rays = 64;
        }))
        .radiance;
    let scale = mean(&reference);
    println!("{path}: mean {scale:.5}");
    for sampling in [Sampling::Reflection, Sampling::Product] {
        let off = settings.clone().with(|s| {
            s.integrator.gather_rays = RAYS;
            s.integrator.sampling = sampling;
        });
        let on = ERRORS.map(|error| {
            off.clone().with(|s| {
                s.integrator.gather_rays = RAYS_OF_RECORD;
                s.integrator.irradiance_error = Some(error);
            })
        });
        for settings in [off].into_iter().chain(on) {
            let frame = mapped.frame(&settings);
            let counters = frame.counters;
            println!(
                "{sampling:?} {:5}: rmse {:.4}, mean {:.4}, interpolated {:.3}, records {}, gathers {}",
                settings.integrator.irradiance_error.map_or("off".into(), |error| error.to_string()),
                rmse(&frame.radiance, &reference) / scale,
                mean(&frame.radiance) / scale,
                counters.interpolated_samples as f64 / counters.lambertian_samples.max(1) as f64,
                counters.records,
                counters.gathers,
            );
        }
    }
}
