//! Operations per step of the cost model equal those counted in the firmware, but for the rays and tests of
//! visible regions and for rays that search for covers, for which the model has no steps.

use photoncard_driver::choice::Choice;
use photoncard_driver::cost_model::arithmetic::{OPERATIONS, Operations, Step, Unit};
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Sampling};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_tests::operations::Instrument;
use photoncard_tests::operations::run::Run;
use photoncard_tests::skip;

/// Maximum relative difference by what the model leaves out: rays of visible regions and covers, and tests of
/// photons against sectors. It is large here, as few photons make gathers wide and rays short.
const OF_REGIONS: f64 = 0.18;

/// Steps whose operations are equal for all data, except that rays of a bundle share decoded nodes.
const FIXED: [Step; 6] = [Step::Ray, Step::Box, Step::Vertex, Step::Triangle, Step::PhotonBox, Step::Photon];

fn settings(layout: PhotonLayout, sampling: Sampling, irradiance_error: Option<f32>) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 64, height: 64, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, neighbors: 60, layout, ..PhotonMaps::default() },
        integrator: Integrator {
            gather_rays: 40,
            shadow_rays: 4,
            sampling,
            irradiance_error,
            ..Integrator::default()
        },
        ..RenderSettings::default()
    }
    .with(|s| s.schedule.order = GatherOrder::Sort)
}

/// Difference of `a` from `b`, relative to `b`.
fn difference(a: f64, b: f64) -> f64 {
    (a - b).abs() / b.abs().max(f64::MIN_POSITIVE)
}

fn check(name: &str, run: &Run) {
    for step in FIXED {
        let index = Step::ALL.iter().position(|&other| other == step).expect("it is one of all");
        let modelled = OPERATIONS[index].times(step.count(&run.work));
        let [counted, modelled] = [run.steps[index], modelled].map(|operations| operations.flops());
        let off = difference(modelled, counted);
        println!("{name}: {}: {off}", step.name());
        let allowed = if [Step::Ray, Step::Photon].contains(&step) { OF_REGIONS } else { 0.0 };
        assert!(off <= allowed, "{name}: {}: {modelled} instead of {counted}", step.name());
    }
    let modelled = run.modelled();
    let mut total = Operations::default();
    Unit::ALL.iter().for_each(|&unit| total.add(&run.counted(unit)));
    let of_all = modelled.sum(|_| true).flops();
    println!("{name}: all: {}", difference(of_all, total.flops()));
    assert!(difference(of_all, total.flops()) < 0.05, "{name}: {of_all} instead of {}", total.flops());
    // A quarter of the unit's operations and a fiftieth of all are allowed: directions depend on the few
    // surfaces in the tiles, and the model of shading and pixels is a mean.
    for &unit in Unit::ALL {
        let (counted, modelled) = (run.counted(unit).flops(), modelled.unit(unit).flops());
        let allowed = 0.25 * counted + 0.02 * total.flops();
        let name = format!("{name}: {}", unit.name());
        println!("{name}: {modelled} {counted} {}", total.flops());
        assert!((modelled - counted).abs() < allowed, "{name}: {modelled} instead of {counted}");
    }
}

#[test]
#[cfg_attr(
    not(all(target_os = "linux", target_arch = "x86_64")),
    ignore = "operations are counted on Linux and x86-64 alone"
)]
fn the_models_operations_equal_those_of_the_firmware() {
    let instrument = match Instrument::build() {
        Ok(instrument) => instrument,
        Err(reason) => return skip(&format!("operations are not counted: {reason}")),
    };
    for (scene, layout, sampling, error) in [
        ("cornell.gltf", PhotonLayout::Lines, Sampling::Product, Some(0.1)),
        ("cornell-glossy.gltf", PhotonLayout::Jensen, Sampling::Reflection, None),
    ] {
        check(scene, &Run::new(&instrument, scene, &settings(layout, sampling, error), 2));
    }
}
