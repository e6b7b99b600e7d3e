//! Photon paths: Russian roulette on the albedo, every arrival at a reflecting surface stored.

use glam::Vec3;
use photoncard_firmware::importance::sample_reflection;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::scene::{Ray, SceneImage, closest_hit, read_surface};
use photoncard_shared::layout::{encode_direction, encode_normal};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::PhotonError;
use super::emit::{PathRandom, emit};
use crate::pack::PackedScene;

/// A photon where it arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Where, metres.
    pub position: [f32; 3],
    /// Watts per channel; until the pass is complete, those of one path in all.
    pub power: [f32; 3],
    /// Code of the direction it came from.
    pub direction: [u8; 2],
    /// Code of the surface normal on its side.
    pub normal: u8,
    /// Whether it came straight from an emitter.
    pub direct: bool,
}

/// The result of the photon pass.
pub struct PhotonPass {
    /// Arrivals in the order of their paths, exactly as many as were asked for.
    pub arrivals: Vec<Arrival>,
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
    let (scene, _) = packed.view();
    let mut arrivals: Vec<Arrival> = Vec::with_capacity(count);
    let mut paths = 0_u64;
    while arrivals.len() < count {
        if paths >= FRUITLESS_PATHS + 1_000 * arrivals.len() as u64 {
            return Err(PhotonError::Lost { stored: arrivals.len(), paths });
        }
        let tasks = next_tasks(count - arrivals.len(), arrivals.len(), paths);
        let rounds: Result<Vec<Vec<Path>>, Fault> = (0..tasks)
            .into_par_iter()
            .map(|task| {
                let (_, mut memory) = packed.view();
                let first = paths + task * PATHS_PER_TASK;
                (first..first + PATHS_PER_TASK).map(|path| follow(&scene, &mut memory, seed, path)).collect()
            })
            .collect();
        for path in rounds.map_err(PhotonError::Unsound)?.into_iter().flatten() {
            if arrivals.len() < count {
                paths += 1;
                arrivals.extend(path);
            }
        }
        if !progress(arrivals.len().min(count)) {
            return Err(PhotonError::Stopped);
        }
    }
    arrivals.truncate(count);
    let per_path = 1.0 / paths as f32;
    arrivals.par_iter_mut().for_each(|arrival| arrival.power = arrival.power.map(|p| p * per_path));
    Ok(PhotonPass { arrivals, paths })
}

/// Tasks of the next round: as many as the photons per path so far promise to need, at most a share of all, so that
/// progress shows. Which paths are traced does not depend on it.
fn next_tasks(missing: usize, stored: usize, paths: u64) -> u64 {
    let photons_per_path = if stored > 0 { stored as f64 / paths as f64 } else { 4.0 };
    let needed = (missing as f64 / photons_per_path) as u64 / PATHS_PER_TASK;
    needed.clamp(1, 64)
}

/// The arrivals of one path.
type Path = Vec<Arrival>;

fn follow(scene: &SceneImage, memory: &mut impl MemoryPort, seed: u32, path: u64) -> Result<Path, Fault> {
    let random = PathRandom::new(seed, path);
    let mut arrivals = Path::new();
    let Some(emission) = emit(scene, memory, random)? else { return Ok(arrivals) };
    let mut ray = emission.ray;
    let mut power = emission.power;
    for bounce in 0..MOST_BOUNCES {
        let Some(hit) = closest_hit(scene, memory, &ray)? else { break };
        let surface = read_surface(scene, memory, &ray, &hit)?;
        if surface.reflection.is_black() {
            break;
        }
        arrivals.push(Arrival {
            position: surface.position.to_array(),
            power: power.to_array(),
            direction: encode_direction(surface.outgoing.to_array()),
            normal: encode_normal(surface.normal.to_array()),
            direct: bounce == 0,
        });
        let (point, roulette) = random.bounce(bounce);
        let Some(sampled) = sample_reflection(&surface, point) else { break };
        match survive(power, power * sampled.weight, roulette) {
            Some(reflected) => power = reflected,
            None => break,
        }
        ray = Ray::new(surface.offset_origin(), sampled.direction);
    }
    Ok(arrivals)
}

/// Russian roulette: a photon goes on with the probability that its strongest channel keeps, and then carries the
/// power it came with in that channel.
fn survive(arrived: Vec3, reflected: Vec3, roulette: f32) -> Option<Vec3> {
    let probability = (reflected.max_element() / arrived.max_element()).min(1.0);
    (roulette < probability).then(|| reflected / probability)
}
