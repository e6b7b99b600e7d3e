//! Messages of a render: what was loaded, ignored, chosen, found and written.

use std::path::Path;

use photoncard_driver::choice::Choice;
use photoncard_driver::photon_map::PhotonsFor;
use photoncard_driver::quality::{Beyond, Finish, Fit, Quality, Stated};
use photoncard_driver::render::{
    EARLIER_RENDER, MemoryStatistics, NamedSettings, Picture, ReadStatistics, RenderSettings, Rendering,
    Statistics, Times,
};
use photoncard_driver::scene::{Camera, Scene};
use serde_json::Value;

use crate::arguments::{OutputOptions, PictureOutput, RenderOptions};
use crate::console::{counted, say};
use crate::failure::Failure;
use crate::notices::{self, Uses};
use crate::progress::duration;

/// Prints the loaded contents, the ignored contents, the options without effect, and `misfit`, a notice that
/// the picture has another aspect ratio than the camera. With `--quiet` only the ignored contents are
/// printed.
///
/// # Errors
/// If contents are ignored and `--strict` is given.
pub(super) fn say_loaded(
    options: &RenderOptions,
    settings: &RenderSettings,
    scene: &Scene,
    camera: &Camera,
    misfit: Option<String>,
) -> Result<(), Failure> {
    let path = &options.scene.path;
    if !options.host.quiet {
        say(format_args!("photoncard: {}", loaded(path, &settings.picture, scene, camera)));
    }
    let uses = Uses::of(&options.scene, &settings.picture, Some(&options.frames));
    notices::say_ignored(&options.scene, scene, &uses)?;
    if options.host.quiet {
        return Ok(());
    }
    notices::say_remarks(path, scene);
    for notice in options.without_effect(scene).into_iter().chain(misfit) {
        say(format_args!("photoncard: {notice}"));
    }
    Ok(())
}

/// Prints a warning if fewer photons were stored than requested.
pub(super) fn say_sparse(statistics: &Statistics) {
    let requested = statistics.provenance.pixels.get("photons").and_then(Value::as_u64);
    let Statistics { photons, photon_paths, .. } = statistics;
    if *photon_paths > 0 && requested.is_some_and(|requested| *photons < requested) {
        say(format_args!(
            "photoncard: only {photons} photons were stored of {photon_paths} paths from the lights, which pass the surfaces by or end \
             on them: indirect light is of these alone (the back of a one-sided triangle neither shines nor reflects)"
        ));
    }
}

/// Prints a warning about tiles far brighter than any surface, unless a second card has verified them.
pub(super) fn say_dazzling(statistics: &Statistics) {
    let Statistics { dazzling_tiles, dazzling_cards, .. } = statistics;
    if *dazzling_tiles > 0 {
        let tiles = counted(*dazzling_tiles, "tile");
        let is_kept = dazzling_cards.iter().any(|card| card == EARLIER_RENDER);
        let remedy = if is_kept {
            "verified if it is rendered again without --resume, by another --card too"
        } else {
            "verified by another --card"
        };
        say(format_args!(
            "photoncard: {tiles} of {} with light far beyond that of the surfaces, which no second card has verified: a lamp without \
             extent that nearly touches a surface makes such light, and so does a faulty card ({remedy})",
            dazzling_cards.join(", ")
        ));
    }
}

/// Prints the scene of a prepared file, its number of photons, the camera and the picture's size.
pub(super) fn say_prepared(path: &Path, settings: &RenderSettings, inputs: &NamedSettings, camera: &Camera) {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let scene = inputs.get("scene").and_then(Value::as_str).unwrap_or_default();
    let RenderSettings { picture: Picture { width, height, .. }, photons, .. } = settings;
    say(format_args!(
        "photoncard: {name}: {scene} with {} photons, prepared; seen by '{}', {width} x {height} pixels",
        photons.count, camera.name
    ));
}

/// Prints a notice if a scene was prepared for denoised pictures and the picture is not denoised, or the
/// reverse. Nothing is printed with the quality `paper`.
pub(super) fn say_other_finish(path: &Path, quality: Quality, prepared: Finish, wanted: Finish) {
    let text = match (prepared, wanted) {
        _ if quality == Quality::Paper => return,
        (Finish::Denoised, Finish::Rendered) => {
            "has the few samples of a picture that is denoised; add --denoise"
        }
        (Finish::Rendered, Finish::Denoised) => {
            "may have interpolated irradiance, whose errors a denoiser keeps; prepare it with --denoise"
        }
        _ => return,
    };
    say(format_args!("photoncard: {} {text}", path.display()));
}

/// Text that names the quality that chose settings: `quality good`.
pub(super) fn by_quality(quality: Quality) -> String {
    format!("quality {}", quality.name())
}

/// Text about the settings that a pilot has chosen or that are taken from kept samples. `are_planned` is true
/// if `--time` or `--noise` decides the number of samples.
pub(super) fn chosen(settings: &RenderSettings, are_planned: bool) -> String {
    let RenderSettings { photons, integrator, .. } = settings;
    let (interpolated, of) = match integrator.irradiance_error {
        Some(error) => (format!("irradiance interpolated to within {error}"), "a pixel and a record"),
        None => ("no irradiance interpolated".to_owned(), "a sample"),
    };
    let paths = match integrator.adaptive_threshold {
        Some(threshold) => format!(", more paths by the threshold {threshold}"),
        None => String::new(),
    };
    let cameras = if photons.photons_for == PhotonsFor::Camera { " for the camera" } else { "" };
    let (planned, samples) =
        if are_planned { ("planned for ", integrator.planned()) } else { ("", integrator.samples) };
    format!(
        "{planned}{} a pixel{paths}; {} a sample, {} {of}; {interpolated}; {} photons{cameras}, {} a gather",
        counted(samples as usize, "sample"),
        counted(integrator.shadow_rays as usize, "shadow ray"),
        counted(integrator.gather_rays as usize, "gather ray"),
        photons.count,
        photons.neighbors,
    )
}

/// Messages about the results of a pilot render. One states the squared error with photons guided to the
/// camera, divided by the error with as many photons for the whole scene. Others state that the bounds of the
/// quality or of `--time` have reduced the number of photons or of gather rays, if no option states this
/// number.
pub(super) fn fitted(fit: &Fit, settings: &RenderSettings, stated: Stated) -> Vec<String> {
    let gain = fit.measured.photons_for_camera.map(|ratio| {
        let taken = if fit.photons_for == PhotonsFor::Camera { "taken" } else { "left" };
        format!("photons for the camera have some {ratio:.2} times the squared error of as many for any camera: {taken}")
    });
    let Beyond { photons, gather_rays, photons_in_time } = fit.beyond;
    let (photons, remedy) = match photons_in_time {
        Some(more) => (Some(more), "more --time"),
        None => (photons, "a better --quality"),
    };
    let photons = photons.filter(|_| !stated.photons).map(|more| {
        let most = settings.photons.count;
        format!("no more than {most} photons; this scene would take {more} (--photons {more}, or {remedy})")
    });
    let gather_rays = gather_rays.filter(|_| !stated.gather_rays).map(|more| {
        let most = fit.gather_rays;
        format!("no more than {most} gather rays a pixel; this scene would take {more} (a better --quality)")
    });
    let caustics = (fit.max_caustic_photons == 0 && settings.photons.caustic_photons == Some(0)).then(|| {
        "gather rays bring caustics, which are soft: no caustic map (--caustic-photons N makes one)"
            .to_owned()
    });
    [gain, photons, gather_rays, caustics].into_iter().flatten().collect()
}

/// Text about the contents of a scene and its view.
fn loaded(path: &Path, picture: &Picture, scene: &Scene, camera: &Camera) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let left_out = match scene.skipped_triangles {
        0 => String::new(),
        count => format!(" (and {count} of zero area, left out)"),
    };
    let contents = [
        format!("{}{left_out}", counted(scene.placed_triangles() as usize, "triangle")),
        counted(scene.materials.len(), "material"),
        counted(scene.images.len(), "image"),
        lights(scene),
    ];
    let Picture { width, height, .. } = picture;
    format!("{name}: {}; seen by '{}', {width} x {height} pixels", contents.join(", "), camera.name)
}

/// Text about the light sources of each kind.
fn lights(scene: &Scene) -> String {
    let emissive = scene.emissive_triangles();
    let kinds = [
        (emissive > 0).then(|| counted(emissive, "emissive triangle")),
        (!scene.lights.is_empty()).then(|| counted(scene.lights.len(), "punctual light")),
        scene.environment.as_ref().filter(|map| map.is_lit()).map(|_| "an environment".to_owned()),
    ];
    format!("light of {}", kinds.into_iter().flatten().collect::<Vec<_>>().join(" and "))
}

/// Prints a picture's files and its time. Adds the number of samples or, for a frame, the times of its
/// phases.
pub(super) fn say_done(outputs: &OutputOptions, rendering: &Rendering, frame: Option<u32>) {
    let statistics = &rendering.statistics;
    if let Some(memory) = &statistics.memory {
        say_memory(memory, statistics);
    }
    let pixels = rendering.film.pixels().len() - rendering.film.missing();
    let pictures = outputs.pictures.iter().map(PictureOutput::name).collect::<Vec<_>>().join(", ");
    let summary = match frame {
        Some(frame) => format!("frame {frame}, {}", cost(statistics)),
        None => summary(statistics, pixels),
    };
    say(format_args!("photoncard: {pictures}: {summary}"));
}

/// Prints the number and the time of all frames.
pub(super) fn say_frames(count: usize, seconds: f64) {
    say(format_args!("photoncard: {} in {}", counted(count, "frame"), duration(seconds)));
}

/// Prints that the files of a frame exist already.
pub(super) fn say_finished(outputs: &OutputOptions, number: u32) {
    let path = outputs.pictures.first().map_or(Path::new(""), |picture| &picture.path);
    say(format_args!("photoncard: {}: frame {number} is finished", path.display()));
}

/// Prints that a file of a frame is damaged and that the frame is rendered again.
pub(super) fn say_damaged(path: &Path) {
    say(format_args!("photoncard: {} is not as it was written: its frame is rendered again", path.display()));
}

/// Text about the time of a frame: the total, each preparing phase that took at least 5 ms, the bytes sent to
/// cards with their time, the tiles, and the denoiser if there is one.
fn cost(statistics: &Statistics) -> String {
    let Statistics { time_s, link, .. } = statistics;
    let Times { total, scene, pilot, photons, pack, load, render, denoise, .. } = time_s;
    let sent: u64 = link.image_bytes.iter().sum();
    let phases = [("pilot", pilot), ("scene", scene), ("photons", photons), ("card image", pack)];
    let phases = phases.iter().filter(|(_, seconds)| **seconds >= 0.005);
    let phases: String = phases.map(|(name, seconds)| format!("{name} {seconds:.2} s, ")).collect();
    let denoised = if *denoise > 0.0 { format!(", denoised in {denoise:.2} s") } else { String::new() };
    format!("{total:.2} s: {phases}{sent} bytes sent in {load:.2} s, tiles {render:.2} s{denoised}")
}

/// Text about a picture: its time, the longest phase, the number of samples and, if it is at least 0.1 %, the
/// percentage of lost paths.
fn summary(statistics: &Statistics, pixels: usize) -> String {
    let Statistics { samples, rays, lost_paths, time_s, .. } = statistics;
    let total = if time_s.total < 10.0 { format!("{:.1} s", time_s.total) } else { duration(time_s.total) };
    let per_pixel = counted(*samples as usize, "sample");
    let all = pixels as u64 * u64::from(*samples);
    let (phase, seconds) = longest(time_s);
    let share = 100.0 * seconds / time_s.total.max(f64::MIN_POSITIVE);
    let mut text = format!("done in {total}, {share:.0} % of it {phase}; {per_pixel} a pixel, {all} in all");
    let paths = rays.eye + rays.gather;
    let lost = 100.0 * *lost_paths as f64 / paths.max(1) as f64;
    if lost >= 0.1 {
        text +=
            &format!("; {lost:.1} % of the paths lost to the limit of specular bounces or to black surfaces");
    }
    text
}

/// Name of the longest phase, with its seconds.
fn longest(times: &Times) -> (&'static str, f64) {
    let phases = [
        ("reading the scene", times.scene),
        ("choosing settings", times.pilot),
        ("tracing photons", times.photons),
        ("building the card image", times.pack),
        ("loading the cards", times.load),
        ("rendering", times.render),
        ("denoising", times.denoise),
    ];
    phases.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
}

/// Prints the modelled reads of card memory: a table for photon map and scene, and the DRAM bytes per gather
/// and per ray.
fn say_memory(memory: &MemoryStatistics, statistics: &Statistics) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_final_message_states_time_samples_and_limits() {
        let mut statistics = Statistics { samples: 4, ..Statistics::default() };
        statistics.time_s = Times { photons: 1.0, render: 3.0, total: 4.0, ..Times::default() };
        statistics.rays.eye = 1000;
        let plain = "done in 4.0 s, 75 % of it rendering; 4 samples a pixel, 40 in all";
        assert_eq!(summary(&statistics, 10), plain);
        statistics.lost_paths = 20;
        let lost = "; 2.0 % of the paths lost to the limit of specular bounces or to black surfaces";
        assert_eq!(summary(&statistics, 10), format!("{plain}{lost}"));
        let none = summary(&Statistics::default(), 0);
        assert!(none.starts_with("done in 0.0 s, 0 %"), "{none}");
    }
}
