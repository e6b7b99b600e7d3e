//! Measures points whose results are not in the store yet. Points with the same card image are measured one
//! after another, so that photons are traced once for all of them. Frames that are rendered on one chip each
//! are measured at once, one a thread.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use photoncard_map::pack::PackedScene;
use photoncard_map::photon_map::{MappedImage, check_image, check_packed, map_photons};
use photoncard_render::RenderError;
use photoncard_render::emulator::direct::TileMemory;
use photoncard_render::parts::Part;
use photoncard_scene::{Scene, gltf};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::error::StudyError;
use super::measure::{Bench, Measurement};
use super::parts::{PartError, Union, deal};
use super::point::{ImageKey, Point, Task};
use super::quality::{Quality, Reference};
use super::store::PointStore;

/// Observer of a study's progress, which can stop the study.
pub trait StudyObserver: Sync {
    /// Reports that `done` of the study's `total` points are finished. In the first call `is_new` is false,
    /// and `done` is the number of points whose results are in the store. Each later call follows the
    /// measurement of a point.
    fn progress(&self, study: &str, done: usize, total: usize, is_new: bool);

    /// Reports in a sentence why a stored point cannot be used. The point is measured again.
    fn notice(&self, text: &str);

    /// Returns whether the study should stop as soon as possible.
    fn is_stopped(&self) -> bool;
}

/// Result of measuring a point. The variant depends on the point's [`Task`].
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) enum Outcome {
    Traffic(Measurement),
    Quality(Quality),
}

/// Outcomes of a study's points.
#[derive(Debug)]
pub struct Results(Vec<(Point, Outcome)>);

impl Results {
    pub(super) fn new(outcomes: Vec<(Point, Outcome)>) -> Self {
        Self(outcomes)
    }

    /// Returns the work and memory traffic of a point.
    ///
    /// # Panics
    /// If the point was not measured, or its task is not [`Task::Traffic`].
    pub fn traffic(&self, point: &Point) -> &Measurement {
        match self.find(point) {
            Some(Outcome::Traffic(measurement)) => measurement,
            _ => panic!("the traffic of {} was not measured", point.name()),
        }
    }

    /// Returns the error of a point's pixels.
    ///
    /// # Panics
    /// If the point was not measured, or its task is not [`Task::Quality`].
    pub fn quality(&self, point: &Point) -> &Quality {
        match self.find(point) {
            Some(Outcome::Quality(quality)) => quality,
            _ => panic!("the quality of {} was not measured", point.name()),
        }
    }

    fn find(&self, point: &Point) -> Option<&Outcome> {
        self.0.iter().find(|(other, _)| other == point).map(|(_, outcome)| outcome)
    }
}

/// Measures points, and keeps their outcomes in a folder.
pub struct Laboratory<'a> {
    scenes: PathBuf,
    store: PointStore,
    pool: ThreadPool,
    observer: &'a dyn StudyObserver,
    /// Parts whose points are in the store; no point is measured then.
    united: Option<Union>,
    loaded: HashMap<String, Scene>,
    /// Card image of the last point, kept for a next point that needs the same image.
    last: Option<LastImage>,
    /// Reference renders of the points with [`Task::Quality`], kept for other points that need the same
    /// references.
    references: Vec<SceneReference>,
}

struct LastImage {
    key: ImageKey,
    scene: Scene,
    mapped: MappedImage,
}

/// A reference render, with the name of the rendered scene and the assignments to the scene's materials.
struct SceneReference {
    scene: String,
    assignments: Vec<String>,
    reference: Reference,
}

impl<'a> Laboratory<'a> {
    /// Creates a laboratory that keeps finished points in `folder/points` and reads scenes from the folder
    /// `scenes`. Each of `threads` threads emulates one chip; `None` is one thread per core.
    ///
    /// # Errors
    /// If the folder cannot be created, or the threads cannot be started.
    pub fn new(
        folder: &Path,
        scenes: &Path,
        threads: Option<usize>,
        observer: &'a dyn StudyObserver,
    ) -> Result<Self, StudyError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build()?;
        let store = PointStore::open(folder)?;
        Ok(Self {
            scenes: scenes.to_owned(),
            store,
            pool,
            observer,
            united: None,
            loaded: HashMap::new(),
            last: None,
            references: Vec::new(),
        })
    }

    /// Refuses points that are not in the store, which has those of the united parts.
    ///
    /// # Errors
    /// If a scene is missing, or is not the one that the parts have measured.
    pub(crate) fn refuse_missing(&mut self, united: &Union) -> Result<(), StudyError> {
        for (name, checksum) in &united.scenes {
            if self.load(name)?.checksum() != checksum {
                return Err(PartError::OtherScene { scene: name.clone() }.into());
            }
        }
        self.united = Some(united.clone());
        Ok(())
    }

    /// Number of threads, each of which emulates a chip.
    pub(crate) fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Checksums of the scenes that were read, by name.
    pub(crate) fn checksums(&self) -> BTreeMap<String, String> {
        let of = |(name, scene): (&String, &Scene)| (name.clone(), scene.checksum().to_owned());
        self.loaded.iter().map(of).collect()
    }

    /// Measures the points of a part that are not in the store yet.
    ///
    /// # Errors
    /// As [`Self::measure`].
    pub(crate) fn measure_part(
        &mut self,
        study: &str,
        points: &[Point],
        part: Part,
    ) -> Result<(), StudyError> {
        let points = sharing_images(points);
        let numbers = deal(&points, part.count());
        let own = points.into_iter().zip(numbers).filter(|(_, number)| *number == part.number());
        let own: Vec<_> = own.map(|(point, _)| point).collect();
        self.measure(study, &own).map(drop)
    }

    /// Measures the points that are not in the store yet. Returns the outcomes of all points.
    ///
    /// # Errors
    /// If a scene is missing, a point cannot be measured or stored, or the observer stops the study.
    pub fn measure(&mut self, study: &str, points: &[Point]) -> Result<Results, StudyError> {
        let points = sharing_images(points);
        if let Some(united) = self.united.clone() {
            return self.united_results(&points, united.parts);
        }
        let total = points.len();
        let (mut results, mut missing) = (Vec::new(), Vec::new());
        for point in points {
            match self.stored(&point)? {
                Some(outcome) => results.push((point, outcome)),
                None => missing.push(point),
            }
        }
        self.observer.progress(study, results.len(), total, false);
        for points in missing.chunk_by(are_measured_together) {
            if self.observer.is_stopped() {
                return Err(StudyError::Stopped);
            }
            for (point, outcome) in points.iter().zip(self.measured(points)?) {
                results.push((point.clone(), outcome));
                self.observer.progress(study, results.len(), total, true);
            }
        }
        Ok(Results::new(results))
    }

    /// Returns the outcomes of points, which are all in the store.
    fn united_results(&mut self, points: &[Point], parts: u32) -> Result<Results, StudyError> {
        let mut results = Vec::new();
        for (point, number) in points.iter().zip(deal(points, parts)) {
            let key = self.key(point)?;
            let noticed = self.store.notices().len();
            let Some(outcome) = self.store.get(&point.name(), &key) else {
                let part = format!("{number}/{parts}");
                let notices = &self.store.notices()[noticed..];
                let reason = if notices.is_empty() { "is missing" } else { "is damaged" }.to_owned();
                return Err(PartError::MissingPoint { point: point.name(), part, reason }.into());
            };
            results.push((point.clone(), outcome));
        }
        Ok(Results::new(results))
    }

    /// Adds a scene under `name`. It is used instead of the file of this name in the folder of scenes.
    pub fn add(&mut self, name: &str, scene: Scene) {
        self.loaded.insert(name.to_owned(), scene);
    }

    /// Loads the scene of a file, without the changes of materials that a point makes.
    ///
    /// # Errors
    /// If the file is missing or cannot be read.
    fn load(&mut self, file: &str) -> Result<&Scene, StudyError> {
        if !self.loaded.contains_key(file) {
            let scene = load_scene(&self.scenes, file)?;
            self.add(file, scene);
        }
        Ok(&self.loaded[file])
    }

    /// Returns the outcome of a point in the store; `None` if it must be measured.
    fn stored(&mut self, point: &Point) -> Result<Option<Outcome>, StudyError> {
        let key = self.key(point)?;
        let noticed = self.store.notices().len();
        let outcome = self.store.get(&point.name(), &key);
        for notice in &self.store.notices()[noticed..] {
            self.observer.notice(&format!("{notice}; it is computed anew"));
        }
        Ok(outcome)
    }

    /// Measures points [together](are_measured_together), and stores the outcome of each.
    fn measured(&mut self, points: &[Point]) -> Result<Vec<Outcome>, StudyError> {
        match self.measure_together(points) {
            Err(StudyError::Render(RenderError::Stopped)) => Err(StudyError::Stopped),
            outcomes => outcomes,
        }
    }

    fn key(&mut self, point: &Point) -> Result<Value, StudyError> {
        Ok(point.key(self.load(&point.scene)?.checksum()))
    }

    fn measure_together(&mut self, points: &[Point]) -> Result<Vec<Outcome>, StudyError> {
        points.iter().try_for_each(Point::check)?;
        let keys: Vec<_> = points.iter().map(|point| self.key(point)).collect::<Result<_, _>>()?;
        let last = self.image(&points[0])?;
        points.iter().try_for_each(|point| self.add_reference(&last, point))?;
        let outcomes = match points {
            [point] => vec![self.measure_one(&last, point, &keys[0])?],
            _ => self.measure_whole_frames(&last, points, &keys)?,
        };
        self.last = Some(last);
        Ok(outcomes)
    }

    /// Measures frames that are rendered on one chip each, as many at a time as there are threads.
    fn measure_whole_frames(
        &self,
        last: &LastImage,
        points: &[Point],
        keys: &[Value],
    ) -> Result<Vec<Outcome>, StudyError> {
        let frames = points.par_iter().zip(keys).with_max_len(1);
        self.pool.install(|| frames.map(|(point, key)| self.measure_one(last, point, key)).collect())
    }

    fn bench<'b>(&'b self, last: &'b LastImage, is_stopped: &'b (dyn Fn() -> bool + Sync)) -> Bench<'b> {
        Bench { scene: &last.scene, mapped: &last.mapped, pool: &self.pool, is_stopped }
    }

    /// Renders the reference of a point with [`Task::Quality`], unless it is known.
    fn add_reference(&mut self, last: &LastImage, point: &Point) -> Result<(), RenderError> {
        let Task::Quality { tiles, reference_rays } = point.task else { return Ok(()) };
        if self.reference(point).is_none() {
            let is_stopped = || self.observer.is_stopped();
            let bench = self.bench(last, &is_stopped);
            self.references.push(SceneReference::new(&bench, point, tiles, reference_rays)?);
        }
        Ok(())
    }

    /// Known reference of a point with [`Task::Quality`].
    fn reference(&self, point: &Point) -> Option<&Reference> {
        let known = self.references.iter().find(|known| known.is_of(point))?;
        Some(&known.reference)
    }

    /// Measures a point with its card image, and stores the outcome.
    fn measure_one(&self, last: &LastImage, point: &Point, key: &Value) -> Result<Outcome, StudyError> {
        check_image(&last.mapped.image, &point.chip().budget()).map_err(RenderError::from)?;
        let is_stopped = || self.observer.is_stopped();
        let bench = self.bench(last, &is_stopped);
        let frame = bench.frame(&point.settings)?;
        point.settings.check_waiting_room(&frame, &last.mapped.image, &point.chip().budget())?;
        let outcome = match &point.task {
            Task::Traffic { caches, .. } if point.is_along_curve => {
                Outcome::Traffic(bench.along_curve(&point.settings, caches)?)
            }
            Task::Traffic { chip, caches, sample, least_tiles, has_reuse } => {
                let model = TileMemory { caches, has_reuse: *has_reuse };
                Outcome::Traffic(bench.traffic(&point.settings, *chip, model, *sample, *least_tiles)?)
            }
            Task::Quality { .. } => {
                let reference = self.reference(point).expect("references are rendered first");
                Outcome::Quality(reference.compare(&bench, &point.settings)?)
            }
        };
        self.store.put(&point.name(), key, &outcome)?;
        Ok(outcome)
    }

    /// Returns the card image for a point: the previous point's image if both points have equal image keys,
    /// otherwise a new image.
    fn image(&mut self, point: &Point) -> Result<LastImage, StudyError> {
        let key = point.image_key();
        if let Some(last) = self.last.take_if(|last| last.key == key) {
            return Ok(last);
        }
        // The previous image is dropped first: two images may not fit into memory.
        self.last = None;
        let mut scene = self.load(&point.scene)?.clone();
        for assignment in &point.assignments {
            scene.apply(assignment)?;
        }
        scene.check_light()?;
        let packed = PackedScene::new(&scene).map_err(RenderError::from)?;
        let settings = point.settings.photon_settings(&scene);
        check_packed(&packed, &settings, &point.chip().budget()).map_err(RenderError::from)?;
        let go_on = |_| !self.observer.is_stopped();
        let mapped = self.pool.install(|| map_photons(packed, &settings, &go_on));
        Ok(LastImage { key, scene, mapped: mapped.map_err(RenderError::from)? })
    }
}

impl SceneReference {
    /// Renders the reference of a point.
    fn new(bench: &Bench, point: &Point, tiles: usize, rays: u32) -> Result<Self, RenderError> {
        Ok(Self {
            scene: point.scene.clone(),
            assignments: point.assignments.clone(),
            reference: Reference::new(bench, &point.settings, tiles, rays)?,
        })
    }

    /// Returns whether this is the reference of a point.
    fn is_of(&self, point: &Point) -> bool {
        let Task::Quality { tiles, reference_rays } = point.task else { return false };
        self.scene == point.scene
            && self.assignments == point.assignments
            && self.reference.is_of(&point.settings, tiles, reference_rays)
    }
}

/// Returns whether two points are measured at once: frames that are rendered on one chip each, from the same
/// card image.
fn are_measured_together(point: &Point, other: &Point) -> bool {
    point.is_on_one_chip() && other.is_on_one_chip() && point.image_key() == other.image_key()
}

/// Removes duplicate points, and sorts the others so that points with the same card image are adjacent.
fn sharing_images(points: &[Point]) -> Vec<Point> {
    let mut images: Vec<(ImageKey, Vec<Point>)> = Vec::new();
    for point in points {
        let key = point.image_key();
        match images.iter_mut().find(|(other, _)| *other == key) {
            Some((_, sharing)) if sharing.contains(point) => {}
            Some((_, sharing)) => sharing.push(point.clone()),
            None => images.push((key, vec![point.clone()])),
        }
    }
    images.into_iter().flat_map(|(_, sharing)| sharing).collect()
}

/// Loads a scene from the folder `scenes`.
///
/// # Errors
/// If the file is missing or cannot be read.
pub(super) fn load_scene(scenes: &Path, file: &str) -> Result<Scene, StudyError> {
    let path = scenes.join(file);
    if !path.is_file() {
        return Err(StudyError::NoScene { scene: file.to_owned(), folder: scenes.to_owned() });
    }
    Ok(gltf::load(&path)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use photoncard_map::photon_map::PhotonLayout;
    use photoncard_render::{PhotonMaps, RenderSettings, Schedule};

    fn point(exponent: u32, layout: PhotonLayout, tile: u32) -> Point {
        Point {
            scene: "cornell-glossy.gltf".to_owned(),
            assignments: vec![format!("floor.exponent={exponent}")],
            settings: RenderSettings {
                photons: PhotonMaps { layout, ..PhotonMaps::default() },
                schedule: Schedule { tile: Some(tile), ..Schedule::default() },
                ..RenderSettings::default()
            },
            is_along_curve: false,
            task: Task::Quality { tiles: 1, reference_rays: 1 },
        }
    }

    #[test]
    fn points_are_grouped_by_image_without_duplicates() {
        use PhotonLayout::{Jensen, Lines};
        let [a, b, c, d] =
            [point(1, Jensen, 16), point(2, Jensen, 16), point(1, Lines, 16), point(1, Jensen, 8)];
        let points = [a.clone(), b.clone(), c.clone(), d.clone(), a.clone(), b.clone()];
        assert_eq!(sharing_images(&points), [a, d, b, c]);
    }
}
