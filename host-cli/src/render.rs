//! `photoncard render`.

mod files;

use std::time::Instant;

use photoncard_driver::render::{
    CardAddress, MemoryStatistics, ReadStatistics, RenderSettings, Statistics, render,
};
use photoncard_driver::scene::Scene;
use photoncard_driver::scene::gltf::load_for;

use crate::arguments::RenderOptions;
use crate::console::say;
use crate::failure::Failure;
use crate::progress::Progress;

/// Renders a scene, and writes the picture and all other requested outputs.
pub(crate) fn run(options: &RenderOptions) -> Result<(), Failure> {
    let mut settings = options.settings();
    files::check(options)?;
    let start = Instant::now();
    let scene = read_scene(options, &mut settings)?;
    let scene_seconds = start.elapsed().as_secs_f64();
    let progress = Progress::start(options.quiet).map_err(|error| Failure::work_error(&error))?;
    let result = on_threads(options.threads, || render(&scene, &settings, &progress))?;
    progress.finish();
    let mut rendering = result.inspect_err(|error| {
        if !error.is_input() && progress.has_kept() {
            let path = options.outputs.partial_path();
            say(format_args!("photoncard: finished tiles are kept in {}; --resume goes on", path.display()));
        }
    })?;
    rendering.statistics.time_s.scene = scene_seconds;
    rendering.statistics.time_s.total += scene_seconds;
    files::write(options, &settings, &scene, &rendering)?;
    if let Some(partial) = rendering.partial {
        partial.remove().map_err(Failure::work)?;
    }
    if let Some(memory) = rendering.statistics.memory.as_ref().filter(|_| !options.quiet) {
        tell_memory(memory, &rendering.statistics);
    }
    Ok(())
}

/// Prints a table of the reads of card memory.
fn tell_memory(memory: &MemoryStatistics, statistics: &Statistics) {
    let gathers = statistics.gathers;
    let rays = &statistics.rays;
    let rays = rays.eye + rays.shadow + rays.gather + rays.survey;
    say(format_args!("photoncard: memory behind {}", memory.caches));
    say(format_args!("photoncard:             requests     hits          raw bytes         DRAM bytes"));
    for (name, reads) in [("photon map", &memory.photon_map), ("scene", &memory.scene)] {
        let ReadStatistics { requests, raw_bytes, line_hits, dram_bytes, .. } = reads;
        let hits = 100.0 * *line_hits as f64 / (*requests).max(1) as f64;
        let line = format!("{name:10} {requests:>12} {hits:>6.2} % {raw_bytes:>18} {dram_bytes:>18}");
        say(format_args!("photoncard: {line}"));
    }
    let each = |bytes: u64, count: u64| bytes as f64 / count.max(1) as f64;
    let of_gather = each(memory.photon_map.dram_bytes, gathers);
    let of_ray = each(memory.scene.dram_bytes, rays);
    say(format_args!("photoncard: {of_gather:.1} DRAM bytes of the photon map a gather, of {gathers}"));
    say(format_args!("photoncard: {of_ray:.1} DRAM bytes of the scene a ray, of {rays}"));
}

fn read_scene(options: &RenderOptions, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    // The image must fit every card.
    let dram_bytes = settings.cards.addresses.iter().map(CardAddress::dram_bytes).min().unwrap_or(u32::MAX);
    let scene = load_for(&options.scene, dram_bytes, options.variant.as_deref());
    let mut scene = scene.map_err(Failure::input)?;
    for assignment in &options.assignments {
        scene.apply(assignment).map_err(Failure::input)?;
    }
    if options.energy_compensation {
        scene.compensate_energy();
    }
    if let Some(environment) = &options.environment {
        scene.environment = Some(environment.load()?);
    }
    scene.check_light().map_err(Failure::input)?;
    let camera = settings.camera(&scene)?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if !options.quiet {
        for notice in options.without_effect(&scene).into_iter().chain(misfit) {
            say(format_args!("photoncard: {notice}"));
        }
        for notice in &scene.notices {
            say(format_args!("photoncard: {notice}"));
        }
        if scene.skipped_triangles > 0 {
            let count = scene.skipped_triangles;
            say(format_args!("photoncard: triangles of zero area are left out: {count}"));
        }
    }
    Ok(scene)
}

/// Runs `work` on a pool of `threads` threads.
fn on_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let Some(threads) = threads else { return Ok(work()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(|error| Failure::work_error(&error))?.install(work))
}
