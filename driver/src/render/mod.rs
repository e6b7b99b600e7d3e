//! A render, from a loaded scene to a complete film.

mod address;
mod card_thread;
mod cards;
mod crew;
mod error;
mod exchange;
mod greeting;
mod memory;
mod observer;
mod open_card;
mod reopening;
mod settings;
mod statistics;
mod verification;

pub use address::{CardAddress, RemoteAddress};
pub use error::{CardError, RenderError};
pub use greeting::{CardInfo, card_info, card_ping};
pub use memory::{MemoryStatistics, ReadStatistics, StageReads, StructureReads};
pub use observer::{Observer, Phase, Unobserved};
pub use photoncard_shared::budget::MAX_BINS;
pub use photoncard_shared::message::MemoryUse;
pub use photoncard_shared::message::{Radiance, Sampling};
pub use settings::{
    CardSet, DEFAULT_CAUSTIC_PHOTONS, Integrator, MIN_IRRADIANCE_ERROR, NamedSettings, PROGRAM, PhotonMaps,
    Picture, RenderSettings, Schedule, TileOutputs,
};
pub use statistics::{Flops, LinkStatistics, Rays, Statistics, Times};

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use photoncard_shared::budget::{Budget, REFERENCE};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{CausticGather, FrameParameters, Tile};

use self::cards::{Cards, Onlookers, Outcome};
use crate::display::Display;
use crate::emulator::trace::TraceFile;
use crate::emulator::whole_frame::{CurveJob, CurveOutcome, render_along_curve};
use crate::film::Film;
use crate::pack::{CardImage, PackedScene};
use crate::partial::PartialRender;
use crate::photon_map::{self, MappedImage, PhotonTimes, map_photons};
use crate::scene::{Camera, Scene};
use crate::scheduler::{GatherOrder, tiles};
use crate::session::{Job, PixelLimits};
use crate::sink::TileSink;

/// A finished picture.
pub struct Rendering {
    /// Its pixels.
    pub film: Film,
    /// What it took.
    pub statistics: Statistics,
    /// Where finished tiles are kept: to be removed when the picture is written.
    pub partial: Option<PartialRender>,
}

/// Renders a scene.
///
/// A serial port may still be held for about a second after the end: one that was just being opened again is on a thread that
/// nobody waits for.
///
/// # Errors
/// If settings or scene do not fit the cards, a card fails, or the observer stops it.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let camera = scene.camera(settings.picture.camera.as_deref())?;
    settings.check_trace()?;
    settings.check_memory_model()?;
    settings.check_verification()?;
    if settings.schedule.order == GatherOrder::Hilbert {
        return render_whole_frame(scene, settings, camera, observer);
    }
    let trace = settings.cards.trace.as_deref().map(TraceFile::create).transpose()?;
    let cards = Cards::connect(settings, trace, observer)?;
    for budget in cards.budgets() {
        settings.check(&budget)?;
    }
    // Not before the settings are known to be possible: a film may be large.
    let mut film = settings.film()?;
    let partial = begin_partial(scene, settings, &mut film, observer)?;
    let tiles = tiles(settings.window(), settings.schedule.tile, settings.schedule.order);
    let display = open_display(settings, &film, &tiles);
    let kept = tiles.iter().filter(|tile| film.has(tile)).count();
    if kept > 0 {
        observer.resumed(kept, tiles.len());
    }
    let mut times = Times::default();
    let prepared = prepare(scene, settings, cards.budgets(), &mut times, observer)?;
    cards.share(prepared.image.clone());
    let frame = settings.frame(camera, prepared.max_distance, prepared.caustics);
    let (scene_image, _) = prepared.image.view();
    let job = Job {
        image: prepared.image.lines(),
        checksum: image_checksum(prepared.image.lines()),
        frame: &frame,
        limits: PixelLimits::new(&scene_image.header, &frame),
    };
    let scheduler = settings.scheduler(tiles, cards.count()).with_kept(&film);
    let film = Mutex::new(film);
    let mut sinks: Vec<&dyn TileSink> = vec![&film];
    sinks.extend(partial.as_ref().map(|partial| partial as &dyn TileSink));
    sinks.extend(display.as_ref().map(|display| display as &dyn TileSink));
    let onlookers = Onlookers { partial: partial.as_ref(), display: display.as_ref(), observer };
    let outcome = cards.run(job, scheduler, sinks, onlookers).inspect_err(|_| {
        if partial.as_ref().is_some_and(PartialRender::holds_tiles) {
            observer.kept();
        }
    })?;
    times.load = outcome.load_seconds;
    times.render = outcome.render_seconds;
    times.total = start.elapsed().as_secs_f64();
    let statistics = statistics(settings, &frame, &prepared, &outcome, times);
    let film = film.into_inner().unwrap_or_else(PoisonError::into_inner);
    finish_display(display.as_ref(), &film, observer);
    Ok(Rendering { film, statistics, partial })
}

/// Renders with all gathers of the frame along one curve: the chips are emulated, and leave the gathers to the host.
fn render_whole_frame(
    scene: &Scene,
    settings: &RenderSettings,
    camera: &Camera,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    settings.check_resume()?;
    let chips = cards::reference_chips(&settings.cards.addresses)?;
    settings.check(&REFERENCE)?;
    let mut film = settings.film()?;
    let partial = begin_partial(scene, settings, &mut film, observer)?;
    let mut times = Times::default();
    let prepared = prepare(scene, settings, std::iter::once(REFERENCE), &mut times, observer)?;
    let frame = settings.frame(camera, prepared.max_distance, prepared.caustics);
    let tiles = tiles(settings.window(), settings.schedule.tile, settings.schedule.order);
    let display = open_display(settings, &film, &tiles);
    let progress = |done: u64, total: u64| {
        observer.progress(Phase::Tiles, done, total);
        tell_failure(display.as_ref(), observer);
        !observer.is_stopped()
    };
    let begun = Instant::now();
    let job = CurveJob { image: &prepared.image, frame: &frame, tiles: &tiles, chips };
    let caches = settings.modelled_caches();
    let CurveOutcome { counters, traffic } = render_along_curve(job, caches.as_ref(), &mut film, &progress)?;
    times.render = begun.elapsed().as_secs_f64();
    times.total = start.elapsed().as_secs_f64();
    if let Some(display) = &display {
        show_finished(display, &film, &tiles);
    }
    finish_display(display.as_ref(), &film, observer);
    let traffic = caches.map(|_| traffic);
    let outcome = Outcome { counters, traffic, cards: chips, ..Outcome::default() };
    let statistics = statistics(settings, &frame, &prepared, &outcome, times);
    Ok(Rendering { film, statistics, partial })
}

/// Begins to keep finished tiles, and takes over those of an earlier render, if the settings say so.
fn begin_partial(
    scene: &Scene,
    settings: &RenderSettings,
    film: &mut Film,
    observer: &dyn Observer,
) -> Result<Option<PartialRender>, RenderError> {
    let begin = |partial| PartialRender::begin(partial, settings.identity(scene), film);
    let partial = settings.outputs.partial.as_ref().map(begin).transpose()?;
    if partial.as_ref().is_some_and(PartialRender::holds_tiles) {
        observer.kept();
    }
    Ok(partial)
}

/// Begins to show the picture, with the tiles that are there, if the settings say so.
fn open_display(settings: &RenderSettings, film: &Film, tiles: &[Tile]) -> Option<Display> {
    let display =
        Display::open(settings.outputs.display.as_ref()?, film.window(), &settings.picture.layers.channels());
    show_finished(&display, film, tiles);
    Some(display)
}

/// Shows the tiles that are in a film.
fn show_finished(display: &Display, film: &Film, tiles: &[Tile]) {
    tiles.iter().filter_map(|tile| film.finished(tile)).for_each(|tile| display.put(&tile));
}

/// Shows what is still to be shown.
fn finish_display(display: Option<&Display>, film: &Film, observer: &dyn Observer) {
    if let Some(display) = display {
        display.finish(film);
    }
    tell_failure(display, observer);
}

/// Tells why the picture is not shown, once.
fn tell_failure(display: Option<&Display>, observer: &dyn Observer) {
    if let Some(error) = display.and_then(Display::failure) {
        observer.not_shown(&error);
    }
}

/// What is to be loaded into the cards.
struct Prepared {
    image: Arc<CardImage>,
    /// Greatest distance of a gather, metres.
    max_distance: f32,
    /// The gathers of caustics.
    caustics: Option<CausticGather>,
    /// Paths that were traced for its photons.
    paths: u64,
}

fn prepare(
    scene: &Scene,
    settings: &RenderSettings,
    budgets: impl Iterator<Item = Budget>,
    times: &mut Times,
    observer: &dyn Observer,
) -> Result<Prepared, RenderError> {
    let start = Instant::now();
    let packed = PackedScene::new(scene)?;
    times.hierarchy = start.elapsed().as_secs_f64();
    let budgets: Vec<Budget> = budgets.collect();
    let photon_settings = settings.photon_settings(scene);
    for budget in &budgets {
        photon_map::check_packed(&packed, &photon_settings, budget)?;
    }
    let total = settings.photons.count as u64;
    let progress = |stored: usize| {
        observer.progress(Phase::Photons, stored as u64, total);
        if stored as u64 == total {
            observer.progress(Phase::Pack, 0, 1);
        }
        !observer.is_stopped()
    };
    let mapped = map_photons(packed, &photon_settings, &progress)?;
    for budget in &budgets {
        photon_map::check_image(&mapped.image, budget)?;
    }
    let PhotonTimes { tracing, building, measuring, estimating } = mapped.times;
    times.photons = tracing.as_secs_f64();
    times.pack = start.elapsed().as_secs_f64() - times.photons;
    times.photon_map = building.as_secs_f64();
    times.discs = measuring.as_secs_f64();
    times.irradiance = estimating.as_secs_f64();
    let MappedImage { image, max_distance, caustics, paths, .. } = mapped;
    Ok(Prepared { image: Arc::new(image), max_distance, caustics, paths })
}

fn statistics(
    settings: &RenderSettings,
    frame: &FrameParameters,
    prepared: &Prepared,
    outcome: &cards::Outcome,
    time_s: Times,
) -> Statistics {
    let counters = &outcome.counters;
    Statistics {
        width: frame.width,
        height: frame.height,
        samples: frame.samples,
        photons: settings.photons.count as u64,
        photon_paths: prepared.paths,
        max_distance: frame.max_distance,
        cards: outcome.cards,
        cards_given_up: outcome.cards_given_up,
        verified_tiles: outcome.tiles.verified,
        repeated_tiles: outcome.tiles.repeated,
        revoked_tiles: outcome.tiles.revoked,
        time_s,
        rays: Rays {
            eye: counters.eye_rays,
            shadow: counters.shadow_rays,
            gather: counters.gather_rays,
            survey: counters.survey_rays,
            specular: counters.specular_rays,
        },
        lost_paths: counters.lost_paths,
        caustic_gathers: counters.caustic_gathers,
        gathers: counters.gathers,
        tables: counters.tables,
        records: counters.records,
        interpolated_share: counters.interpolated_samples as f64 / counters.lambertian_samples.max(1) as f64,
        photons_tested: counters.photons_tested,
        photons_taken: counters.photons_taken,
        photons_selected: counters.photons_selected,
        photons_found: counters.photons_found,
        lookups: counters.lookups,
        points_tested: counters.points_tested,
        drains: counters.drains,
        most_waiting: counters.most_waiting,
        flops: Flops::new(counters, frame),
        image_bytes: prepared.image.bytes(),
        link: LinkStatistics {
            payload_bytes: outcome.bytes.payload,
            wire_bytes: outcome.bytes.wire,
            retransmitted_frames: outcome.bytes.line.repeated,
            damaged_frames: outcome.bytes.line.damaged,
            duplicate_frames: outcome.bytes.line.duplicates,
            probes: outcome.bytes.line.probes,
            resets: outcome.bytes.resets,
        },
        memory: settings.modelled_caches().zip(outcome.traffic.as_ref()).map(MemoryStatistics::new),
        peak_memory_bytes: statistics::peak_memory_bytes(),
    }
}
