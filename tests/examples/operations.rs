//! Counts the floating-point operations of the firmware, for `tests/operations.sh`.
//!
//! `operations table` prints `driver/render/src/cost_model/arithmetic/table.rs`: the mean operations of each
//! step, counted in tiles of several scenes. `operations report` prints the operations of each unit for a ray
//! and for a gather, as counted and by the table.

use photoncard_driver::choice::Choice;
use photoncard_driver::cost_model::arithmetic::{Operations, Step, Unit};
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Sampling};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_tests::operations::Instrument;
use photoncard_tests::operations::run::{Run, means};

/// Scenes, each with the number of its tiles that are rendered.
const SCENES: [(&str, usize); 6] = [
    ("cornell.gltf", 4),
    ("cornell-glossy.gltf", 4),
    ("atrium.glb", 4),
    ("cornell-spheres.glb", 2),
    ("room.glb", 2),
    ("roughness.glb", 2),
];

/// Settings of the dissertation's frame, without its techniques or with all of them. Picture and photon map
/// are smaller, which leaves the operations of a step as they are.
fn settings(has_all: bool) -> RenderSettings {
    let plain = RenderSettings {
        picture: Picture { width: 256, height: 256, ..Picture::default() },
        photons: PhotonMaps {
            count: 60_000,
            neighbors: 100,
            layout: PhotonLayout::Jensen,
            ..PhotonMaps::default()
        },
        integrator: Integrator {
            gather_rays: 100,
            shadow_rays: 8,
            sampling: Sampling::Reflection,
            ..Integrator::default()
        },
        ..RenderSettings::default()
    };
    if !has_all {
        return plain.with(|s| s.schedule.order = GatherOrder::Naive);
    }
    plain.with(|s| {
        s.photons.layout = PhotonLayout::Lines;
        s.integrator.sampling = Sampling::Product;
        s.integrator.irradiance_error = Some(0.025);
        s.schedule.order = GatherOrder::Sort;
    })
}

fn runs(instrument: &Instrument) -> Vec<(String, Run)> {
    let kinds = [("naive", settings(false)), ("all techniques", settings(true))];
    let of = |(scene, tiles): (&str, usize)| {
        kinds.each_ref().map(|(kind, settings)| {
            eprintln!("{scene}, {kind}");
            (format!("{scene}, {kind}"), Run::new(instrument, scene, settings, tiles))
        })
    };
    SCENES.into_iter().flat_map(of).collect()
}

/// Formats a number with four digits, an integer with one decimal.
fn number(value: f64) -> String {
    if value == 0.0 || (value - value.round()).abs() < 1e-9 {
        return format!("{:.1}", value.round());
    }
    let digits = (3 - value.abs().log10().floor() as i32).max(1) as usize;
    format!("{value:.digits$}")
}

fn print_table(runs: &[Run]) {
    println!("//! Operations of a step. Written by `tests/operations.sh`.\n");
    println!("use photoncard_picture::choice::Choice;\n\nuse super::step::{{Operations, Step}};\n");
    println!(
        "/// Operations of one step of each kind, in the order of [`Step::ALL`]: means over tiles of several scenes."
    );
    println!("#[rustfmt::skip] // One step a line.");
    println!("pub const OPERATIONS: [Operations; Step::ALL.len()] = [");
    for (step, operations) in Step::ALL.iter().zip(means(runs)) {
        let [add, multiply, divide, root, compare, convert] = operations.to_array().map(number);
        println!(
            "    // {}\n    Operations {{ add: {add}, multiply: {multiply}, divide: {divide}, square_root: {root}, compare: \
             {compare}, convert: {convert} }},",
            step.about()
        );
    }
    println!("];");
}

fn print_operations(name: &str, counted: &Operations, modelled: &Operations, pieces: f64) {
    let [add, multiply, divide, root, compare, convert] = counted.times(1.0 / pieces).to_array();
    println!(
        "    {name:18} {add:8.1} {multiply:8.1} {divide:7.1} {root:7.1} {compare:8.1} {convert:8.1} {:9.1} {:9.1}",
        counted.flops() / pieces,
        modelled.flops() / pieces
    );
}

/// Prints the operations of each unit in a run, for a ray or for a gather.
fn print_run(name: &str, run: &Run) {
    let counters = &run.counters;
    let rays = counters.eye_rays
        + counters.shadow_rays
        + counters.gather_rays
        + counters.survey_rays
        + counters.specular_rays;
    let gathers = counters.gathers.max(1);
    println!("{name}: {rays} rays, {gathers} gathers");
    println!("                         add multiply  divide    root  compare  convert     FLOPs  by table");
    for (piece, count, units) in [
        (
            "ray",
            rays,
            &[
                Unit::Traversal,
                Unit::Triangles,
                Unit::Shading,
                Unit::Light,
                Unit::Sampling,
                Unit::IrradianceCache,
                Unit::Pixels,
            ][..],
        ),
        ("gather", gathers, &[Unit::Search, Unit::Selection, Unit::Reflection][..]),
    ] {
        println!("  a {piece}:");
        let modelled = run.modelled();
        let mut sums = [Operations::default(); 2];
        for &unit in units {
            let (counted, modelled) = (run.counted(unit), modelled.unit(unit));
            print_operations(unit.name(), &counted, modelled, count as f64);
            sums[0].add(&counted);
            sums[1].add(modelled);
        }
        print_operations("sum", &sums[0], &sums[1], count as f64);
    }
}

fn main() {
    let task = std::env::args().nth(1);
    let instrument = Instrument::build().unwrap_or_else(|reason| {
        eprintln!("operations: {reason}");
        std::process::exit(1);
    });
    match task.as_deref() {
        Some("table") => print_table(&runs(&instrument).into_iter().map(|(_, run)| run).collect::<Vec<_>>()),
        Some("report") => runs(&instrument).iter().for_each(|(name, run)| print_run(name, run)),
        _ => panic!("usage: operations table | report"),
    }
}
