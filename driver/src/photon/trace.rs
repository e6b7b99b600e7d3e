//! Photon paths: Russian roulette on the albedo, every arrival at a reflecting surface stored.

use glam::Vec3;
use photoncard_firmware::importance::sample_reflection;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::scene::{Ray, SceneImage, closest_hit, read_surface};
use photoncard_shared::layout::{
    FULL_DISC, Photon, PhotonGrid, Rgbe, encode_direction, encode_normal, power_of_two_above,
};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::PhotonError;
use super::emit::{PathRandom, emit};
use super::stored::{Photons, StoredPhoton};
use crate::pack::PackedScene;

/// The result of the photon pass.
pub struct PhotonPass {
    /// Photons in the order of their paths, exactly as many as were asked for.
    pub photons: Photons,
    /// Paths that were begun for them.
    pub paths: u64,
}

/// Paths that may be traced before each photon stored; beyond them there must be a photon to every thousand paths.
const FRUITLESS_PATHS: u64 = 1_000_000;
/// Paths that one task traces.
const PATHS_PER_TASK: u64 = 2048;
/// A path with more bounces than this has met surfaces that lose nothing; it ends.
const MOST_BOUNCES: u32 = 512;

/// Traces paths until `count` photons are stored. `progress` is told how many are, and says whether to go on.
///
/// # Errors
/// If hardly any path meets a surface, or if `progress` says to stop.
pub fn trace(
    packed: &PackedScene,
    seed: u32,
    count: usize,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<PhotonPass, PhotonError> {
    // Hardly any photon is stronger than it was emitted: at a Phong lobe, twice at the most.
    let path_unit = power_of_two_above(packed.strongest_emission().into());
    let tracer = Tracer { scene: packed.view().0, grid: packed.photon_grid(), path_unit, seed };
    let mut list: Vec<StoredPhoton> = Vec::with_capacity(count);
    let mut paths = 0_u64;
    while list.len() < count {
        if paths >= FRUITLESS_PATHS + 1_000 * list.len() as u64 {
            return Err(PhotonError::Lost { stored: list.len(), paths });
        }
        let tasks = next_tasks(count - list.len(), list.len(), paths);
        let round: Result<Vec<Traced>, Fault> = (0..tasks)
            .into_par_iter()
            .map(|task| {
                let (_, mut memory) = packed.view();
                tracer.trace(&mut memory, paths + task * PATHS_PER_TASK)
            })
            .collect();
        for traced in round.map_err(PhotonError::Unsound)? {
            let missing = count - list.len();
            if missing > 0 {
                paths += traced.paths_until(missing);
                list.extend_from_slice(traced.photons.get(..missing).unwrap_or(&traced.photons));
            }
        }
        if !progress(list.len()) {
            return Err(PhotonError::Stopped);
        }
    }
    let power_unit = (path_unit / paths.max(1) as f32).max(f32::MIN_POSITIVE);
    Ok(PhotonPass { photons: Photons { list, grid: tracer.grid, power_unit }, paths })
}

/// Tasks of the next round: as many as the photons per path so far promise to need, at most a share of all, so that
/// progress shows. Which paths are traced does not depend on it.
fn next_tasks(missing: usize, stored: usize, paths: u64) -> u64 {
    let photons_per_path = if stored > 0 { stored as f64 / paths as f64 } else { 4.0 };
    let needed = (missing as f64 / photons_per_path) as u64;
    needed.div_ceil(PATHS_PER_TASK).clamp(1, 64)
}

/// What the paths of a task left.
struct Traced {
    /// Photons in the order of their paths.
    photons: Vec<StoredPhoton>,
    /// Of each path, the photons there were at its end.
    ends: Vec<u32>,
}

impl Traced {
    /// The paths that leave `count` photons, the last begun only; all if they leave fewer.
    fn paths_until(&self, count: usize) -> u64 {
        let before = self.ends.partition_point(|&end| (end as usize) < count);
        (before + 1).min(self.ends.len()) as u64
    }
}

/// What all paths share.
struct Tracer {
    scene: SceneImage,
    grid: PhotonGrid,
    /// Watts of a path by itself that a photon power of 1 stands for.
    path_unit: f32,
    seed: u32,
}

impl Tracer {
    /// Follows the paths of a task.
    fn trace(&self, memory: &mut impl MemoryPort, first: u64) -> Result<Traced, Fault> {
        let mut traced = Traced { photons: Vec::new(), ends: Vec::with_capacity(PATHS_PER_TASK as usize) };
        for path in first..first + PATHS_PER_TASK {
            self.follow(memory, path, &mut traced.photons)?;
            traced.ends.push(traced.photons.len() as u32);
        }
        Ok(traced)
    }

    fn follow(
        &self,
        memory: &mut impl MemoryPort,
        path: u64,
        photons: &mut Vec<StoredPhoton>,
    ) -> Result<(), Fault> {
        let scene = &self.scene;
        let random = PathRandom::new(self.seed, path);
        let Some(emission) = emit(scene, memory, random)? else { return Ok(()) };
        let mut ray = emission.ray;
        let mut power = emission.power;
        for bounce in 0..MOST_BOUNCES {
            let Some(hit) = closest_hit(scene, memory, &ray)? else { break };
            let surface = read_surface(scene, memory, &ray, &hit)?;
            if surface.reflection.is_black() {
                break;
            }
            let random = random.bounce(bounce);
            let photon = Photon {
                position: surface.position.to_array(),
                power: Rgbe::encode((power / self.path_unit).to_array(), random.dither()),
                direction: encode_direction(surface.outgoing.to_array()),
                axis: 0,
                normal: encode_normal(surface.normal.to_array()),
                disc: FULL_DISC,
                direct: bounce == 0,
            };
            photons.push(StoredPhoton::new(&self.grid, &photon));
            let Some(sampled) = sample_reflection(&surface, random.point()) else { break };
            match survive(power, power * sampled.weight, random.survival()) {
                Some(reflected) => power = reflected,
                None => break,
            }
            ray = Ray::new(surface.offset_origin(), sampled.direction);
        }
        Ok(())
    }
}

/// Russian roulette: a photon goes on with the probability that its strongest channel keeps, and then carries the
/// power it came with in that channel.
fn survive(arrived: Vec3, reflected: Vec3, roulette: f32) -> Option<Vec3> {
    let probability = (reflected.max_element() / arrived.max_element()).min(1.0);
    (roulette < probability).then(|| reflected / probability)
}
