//! Measures the variance of each `--sampling` of gather rays, on a fixed photon map.
//!
//! `cargo run --release -p photoncard-tests --example sampling_variance [SCENE [camera=NAME]
//! [ASSIGNMENT...]]`
//!
//! For every sampling, and for several numbers of rays, the program prints the relative RMSE of a point's
//! indirect radiance; the ratio of the variance of `brdf` to that of the sampling; and the difference of the
//! mean over seeds from that of 10,000 rays, in standard errors. Then it prints the number of rays with which
//! the sampling has the RMSE of 200 `brdf` rays.

use glam::DVec3;
use photoncard_driver::render::{PhotonMaps, RenderSettings, Sampling};
use photoncard_driver::scene::gltf;
use photoncard_tests::mapped::{IndirectLight, MappedScene};

const COUNTS: [u32; 7] = [12, 25, 50, 100, 200, 400, 800];
const SEEDS: u32 = 8;
const SIDE: u32 = 14;
const REFERENCE_RAYS: u32 = 10_000;
const SAMPLINGS: [(&str, Sampling); 5] = [
    ("brdf", Sampling::Reflection),
    ("photon", Sampling::Photon),
    ("product", Sampling::Product),
    ("mixture", Sampling::Mixture),
    ("focused", Sampling::Focused),
];

/// Mean and variance over seeds of the radiance at each point.
struct Moments {
    mean: Vec<DVec3>,
    variance: Vec<f64>,
    seeds: u32,
}

fn moments(light: &IndirectLight, sampling: Sampling, rays: u32, seeds: std::ops::Range<u32>) -> Moments {
    let count = seeds.len() as f64;
    let runs: Vec<_> = seeds.clone().map(|seed| light.radiance(sampling, rays, seed)).collect();
    let points = 0..light.points.len();
    let mean: Vec<DVec3> =
        points.clone().map(|i| runs.iter().map(|run| run[i].as_dvec3()).sum::<DVec3>() / count).collect();
    let squares =
        |i: usize| runs.iter().map(|run| run[i].as_dvec3().distance_squared(mean[i]) / 3.0).sum::<f64>();
    let variance = points.map(|i| squares(i) / (count - 1.0)).collect();
    Moments { mean, variance, seeds: seeds.len() as u32 }
}

impl Moments {
    fn rmse(&self) -> f64 {
        (self.variance.iter().sum::<f64>() / self.variance.len() as f64).sqrt()
    }

    /// Mean over points and channels, with an upper bound of its standard error.
    fn overall(&self) -> (f64, f64) {
        let points = self.mean.len() as f64;
        let mean = self.mean.iter().map(|mean| mean.element_sum() / 3.0).sum::<f64>() / points;
        // The sum of the channels' variances is more than the variance of their mean, however they are
        // correlated.
        let variance = self.variance.iter().sum::<f64>() / self.seeds as f64 / (points * points);
        (mean, variance.sqrt())
    }
}

/// Number of rays with which a sampling has the RMSE `rmse`. Between the pairs (rays, RMSE) of `curve`, the
/// logarithm of the RMSE is linear in that of the rays.
fn rays_for(rmse: f64, curve: &[(u32, f64)]) -> f64 {
    let log = |(rays, rmse): (u32, f64)| ((rays as f64).ln(), rmse.ln());
    let target = rmse.ln();
    let pair = curve.windows(2).find(|pair| pair[1].1 <= rmse).unwrap_or(&curve[curve.len() - 2..]);
    let [(x0, y0), (x1, y1)] = [log(pair[0]), log(pair[1])];
    (x0 + (target - y0) / (y1 - y0) * (x1 - x0)).exp()
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "scenes/cornell.gltf".into());
    let mut scene = gltf::load(path.as_ref()).expect("the scene loads");
    let mut settings = RenderSettings {
        photons: PhotonMaps { count: 300_000, ..PhotonMaps::default() },
        ..RenderSettings::default()
    };
    for argument in arguments {
        match argument.strip_prefix("camera=") {
            Some(camera) => settings.picture.camera = Some(camera.into()),
            None => scene.apply(&argument).expect("the assignment applies"),
        }
    }
    let mapped = MappedScene::new(scene, &settings);
    let light = IndirectLight::new(&mapped, &settings, SIDE);
    let reference = moments(&light, Sampling::Reflection, REFERENCE_RAYS, 1000..1003);
    let (expected, reference_error) = reference.overall();
    println!("{path}: {} points, mean {expected:.5} +- {reference_error:.5}", light.points.len());
    let mut of_brdf = Vec::new();
    for (name, sampling) in SAMPLINGS {
        let mut curve = Vec::new();
        for rays in COUNTS {
            let found = moments(&light, sampling, rays, 0..SEEDS);
            let (mean, error) = found.overall();
            let deviation = (mean - expected) / error.hypot(reference_error);
            let rmse = found.rmse();
            curve.push((rays, rmse));
            let of_brdf = of_brdf.get(curve.len() - 1).map_or(rmse, |&(_, rmse)| rmse);
            println!(
                "{name:8} {rays:4} rays: rmse {:.4}, variance ratio {:6.3}, deviation {deviation:+.2}",
                rmse / expected,
                (of_brdf / rmse).powi(2),
            );
        }
        if sampling == Sampling::Reflection {
            of_brdf = curve.clone();
        }
        let target = of_brdf.iter().find(|(rays, _)| *rays == 200).expect("200 is a count").1;
        println!("{name:8} {:6.1} rays for the rmse of 200 brdf rays", rays_for(target, &curve));
    }
}
