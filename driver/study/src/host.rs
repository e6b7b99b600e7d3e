//! Measures the host's work for a frame with other photons than the previous frame: the time of the work, and
//! the number of bytes that change in the card image.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::Vec3;
use photoncard_cards::session::changed_runs;
use photoncard_map::pack::{CardImage, PackedScene};
use photoncard_map::photon_map::{
    MappedImage, PhotonMapSize, PhotonSettings, PhotonTimes, TracedPhotons, map_photons, map_traced,
};
use photoncard_render::{RenderError, RenderSettings};
use photoncard_scene::{Scene, SceneContents};
use photoncard_shared::address::LINE_BYTES;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::error::StudyError;
use super::laboratory::{StudyObserver, load_scene};
use super::parts::PartError;
use super::point::identity;
use super::store::PointStore;

/// Displacement of moving lights, as a fraction of the scene's diagonal.
pub(crate) const LIGHT_STEP: f32 = 0.01;

/// Times of the host's work for the photon map of one scene, and numbers of bytes that changes of light
/// alter.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct HostFrame {
    /// Size of the card image, bytes.
    pub(crate) image_bytes: u64,
    /// Size of the photon map in the card image.
    pub(crate) map: PhotonMapSize,
    /// Number of threads used.
    pub(crate) threads: usize,
    /// Time to trace photons, seconds.
    pub(crate) tracing: f64,
    /// Time to build the map and the other sections of the card image, seconds.
    pub(crate) building: f64,
    /// Time to measure the maximum radius of gathers, and the fraction of each gather's disc that surfaces
    /// fill, seconds.
    pub(crate) measuring: f64,
    /// Bytes of the card image that each change of the scene's light alters.
    pub(crate) changes: Vec<Changed>,
}

impl HostFrame {
    /// Total time of tracing, building and measuring, seconds.
    pub(crate) fn seconds(&self) -> f64 {
        self.tracing + self.building + self.measuring
    }
}

/// Change of a scene's light between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) enum Change {
    /// The emission of all lights is halved.
    Dimmed,
    /// All lights move by [`LIGHT_STEP`].
    Moved,
    /// This fraction of the photons is replaced by photons of another seed.
    Replaced(f64),
}

/// Size of the lines of the card image that a change alters, and of all lines.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(crate) struct Changed {
    pub(crate) change: Change,
    /// Size of all changed lines, bytes.
    pub(crate) bytes: u64,
    /// Size of all lines of the new card image, bytes.
    pub(crate) of: u64,
}

/// Measures the host's work, and keeps the results in a [store](super::store).
pub(crate) struct HostBench<'a> {
    scenes: PathBuf,
    store: PointStore,
    pool: ThreadPool,
    observer: &'a dyn StudyObserver,
    /// True to refuse what is not in the store.
    is_united: bool,
}

impl<'a> HostBench<'a> {
    /// Creates a bench that keeps results in `folder/points` and reads scenes from the folder `scenes`.
    ///
    /// # Errors
    /// If the folder cannot be created, or the threads cannot be started.
    pub(crate) fn new(
        folder: &Path,
        scenes: &Path,
        threads: Option<usize>,
        observer: &'a dyn StudyObserver,
    ) -> Result<Self, StudyError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build()?;
        Ok(Self {
            scenes: scenes.to_owned(),
            store: PointStore::open(folder)?,
            pool,
            observer,
            is_united: false,
        })
    }

    /// Refuses results that are not in the store, which has those of the first part.
    pub(crate) fn refuse_missing(&mut self) {
        self.is_united = true;
    }

    /// Measures the host's work for a frame of the scene in `file`, and the effects of `changes` on the card
    /// image. A result in the store is returned without a measurement.
    ///
    /// # Errors
    /// If the scene cannot be read, its photons cannot be mapped, the result cannot be stored, or the
    /// observer stops the study.
    pub(crate) fn measure(
        &mut self,
        file: &str,
        settings: &RenderSettings,
        changes: &[Change],
    ) -> Result<HostFrame, StudyError> {
        let scene = load_scene(&self.scenes, file)?;
        let threads = self.pool.current_num_threads();
        let key = json!({
            "identity": identity(settings, scene.checksum()), "scene": file, "threads": threads, "changes": changes,
        });
        let name = format!("host-{}", file.split('.').next().unwrap_or_default());
        if let Some(known) = self.store.get(&name, &key) {
            return Ok(known);
        }
        if self.is_united {
            return Err(PartError::MissingPoint {
                point: name,
                part: "1".to_owned(),
                reason: "is missing".to_owned(),
            }
            .into());
        }
        let frame = self.pool.install(|| self.frame(&scene, settings, changes));
        let frame = frame.map_err(|error| match error {
            RenderError::Stopped => StudyError::Stopped,
            error => error.into(),
        })?;
        self.store.put(&name, &key, &frame)?;
        Ok(frame)
    }

    fn frame(
        &self,
        scene: &Scene,
        settings: &RenderSettings,
        changes: &[Change],
    ) -> Result<HostFrame, RenderError> {
        let go_on = |_| !self.observer.is_stopped();
        let photons = settings.photon_settings(scene);
        let start = Instant::now();
        let packed = PackedScene::new(scene)?;
        let packing = start.elapsed();
        let MappedImage { image, times, .. } = map_photons(packed, &photons, &go_on)?;
        let PhotonTimes { tracing, building, measuring, .. } = times;
        let changed = |&change: &Change| {
            let after = self.changed(scene, settings, change)?;
            Ok(Changed { change, bytes: differing_bytes(&image, &after), of: after.bytes() })
        };
        Ok(HostFrame {
            image_bytes: image.bytes(),
            map: PhotonMapSize::of(&image),
            threads: rayon::current_num_threads(),
            tracing: tracing.as_secs_f64(),
            building: (packing + building).as_secs_f64(),
            measuring: measuring.as_secs_f64(),
            changes: changes.iter().map(changed).collect::<Result<_, RenderError>>()?,
        })
    }

    /// Creates the card image after a change.
    fn changed(
        &self,
        scene: &Scene,
        settings: &RenderSettings,
        change: Change,
    ) -> Result<CardImage, RenderError> {
        let go_on = |_| !self.observer.is_stopped();
        let photons = settings.photon_settings(scene);
        let mut after = scene.clone();
        let mapped = match change {
            Change::Dimmed => {
                after.materials.iter_mut().for_each(|material| material.emission *= 0.5);
                map_photons(PackedScene::new(&after)?, &photons, &go_on)?
            }
            Change::Moved => {
                move_lights(&mut after);
                map_photons(PackedScene::new(&after)?, &photons, &go_on)?
            }
            Change::Replaced(share) => {
                let packed = PackedScene::new(scene)?;
                let mut traced = TracedPhotons::new(&packed, &photons, &go_on)?;
                let others = PhotonSettings { seed: !photons.seed, ..photons };
                let others = TracedPhotons::new(&packed, &others, &go_on)?;
                traced.photons = traced.photons.with_replaced(&others.photons, share);
                map_traced(packed, traced, &photons, &go_on)?
            }
        };
        Ok(mapped.image)
    }
}

/// Moves all emissive triangles along +x by [`LIGHT_STEP`] of the scene's diagonal.
fn move_lights(scene: &mut Scene) {
    let corners = || scene.triangles.iter().flat_map(|triangle| triangle.vertices);
    let lower = corners().fold(Vec3::INFINITY, Vec3::min);
    let upper = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
    let step = Vec3::X * (LIGHT_STEP * lower.distance(upper));
    let SceneContents { triangles, materials, .. } = &mut **scene;
    for triangle in triangles {
        let material = materials.get(triangle.material as usize);
        if material.is_some_and(|material| material.emission.max_element() > 0.0) {
            triangle.vertices.iter_mut().for_each(|vertex| *vertex += step);
        }
    }
}

/// Returns the size of the lines of `after` that differ from those of `before`, bytes.
fn differing_bytes(before: &CardImage, after: &CardImage) -> u64 {
    let differ: usize = changed_runs(before.lines(), after.lines()).iter().map(ExactSizeIterator::len).sum();
    (differ * LINE_BYTES) as u64
}
