//! Photon paths: Russian roulette on the albedo, every arrival at a surface that is not perfectly specular stored.

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::render::specular_path::{Arrival, Carried, SpecularPath};
use photoncard_firmware::scene::{Ray, SceneImage, Surface, closest_hit, read_surface};
use photoncard_shared::layout::{
    FULL_DISC, Photon, PhotonGrid, Rgbe, encode_direction, encode_normal, power_of_two_above,
};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::emit::{PathRandom, emit};
use super::error::PhotonError;
use super::stored::{Photons, StoredPhoton};
use crate::light::Sources;
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
/// Paths that may be traced for each photon of caustics that is stored, besides those: where fewer of them lead to one there is
/// little light in caustics, and few photons estimate it.
const MAX_PATHS_TO_A_CAUSTIC_PHOTON: u64 = 20;
/// Paths that one task traces.
const PATHS_PER_TASK: u64 = 2048;
/// A path with more bounces than this has met surfaces that lose nothing; it ends.
const MAX_BOUNCES: u32 = 512;

/// Traces paths until `count` photons are stored; none if no surface keeps any. `progress` gets their number, and returns
/// whether to go on.
///
/// # Errors
/// If hardly any path meets a surface, or if `progress` says to stop.
pub fn trace(
    packed: &PackedScene,
    seed: u32,
    count: usize,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<PhotonPass, PhotonError> {
    let is_fruitless = |stored: usize, paths: u64| paths >= FRUITLESS_PATHS + 1_000 * stored as u64;
    let traced = trace_while(packed, (seed, Purpose::Indirect), count, &|stored, paths| {
        !is_fruitless(stored, paths) && progress(stored)
    })?;
    let stored = traced.photons.len();
    if stored >= count || !packed.keeps_photons() {
        return Ok(traced);
    }
    if is_fruitless(stored, traced.paths) {
        return Err(PhotonError::Lost { stored, paths: traced.paths });
    }
    Err(PhotonError::Stopped)
}

/// Traces paths until `count` photons of caustics are stored, or so many paths have led to too few of them that what is left
/// out is not to be seen. `go_on` is asked whether to go on.
///
/// # Errors
/// If `go_on` says to stop.
pub fn trace_caustics(
    packed: &PackedScene,
    seed: u32,
    count: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Photons, PhotonError> {
    let is_fruitful =
        |stored: usize, paths| paths < FRUITLESS_PATHS + MAX_PATHS_TO_A_CAUSTIC_PHOTON * stored as u64;
    let traced = trace_while(packed, (seed, Purpose::Caustics), count, &|stored, paths| {
        is_fruitful(stored, paths) && go_on()
    })?;
    if go_on() { Ok(traced.photons) } else { Err(PhotonError::Stopped) }
}

/// Traces paths until `count` photons are stored, or until `go_on` returns false of their number and that of paths.
fn trace_while(
    packed: &PackedScene,
    (seed, purpose): (u32, Purpose),
    count: usize,
    go_on: &dyn Fn(usize, u64) -> bool,
) -> Result<PhotonPass, PhotonError> {
    if !packed.keeps_photons() {
        let photons = Photons { list: Vec::new(), grid: packed.photon_grid(), power_unit: 1.0 };
        return Ok(PhotonPass { photons, paths: 0 });
    }
    // Few photons are stronger than they were emitted: twice at a Phong lobe, 16 times where glass hardly reflects but for its mirror.
    let aimed = packed.aimed_sources().filter(|_| purpose == Purpose::Caustics);
    let sources = aimed.unwrap_or(packed.sources());
    let path_unit = power_of_two_above(sources.strongest.into());
    let (scene, grid) = (packed.view().0, packed.photon_grid());
    let tracer = Tracer { scene, sources, grid, path_unit, seed, purpose };
    let mut list: Vec<StoredPhoton> = Vec::with_capacity(count);
    let mut paths = 0_u64;
    while list.len() < count && go_on(list.len(), paths) {
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

/// The photons of a task's paths.
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

/// The map that photons are traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// Every arrival at a surface that is not perfectly specular.
    Indirect,
    /// The first arrival there of paths that have met others before.
    Caustics,
}

/// The parameters of all paths.
struct Tracer<'s> {
    scene: SceneImage,
    sources: &'s Sources,
    grid: PhotonGrid,
    /// Watts of a path by itself that a photon power of 1 stands for.
    path_unit: f32,
    seed: u32,
    purpose: Purpose,
}

impl Tracer<'_> {
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
        let Some(emission) = emit(scene, memory, self.sources, random)? else { return Ok(()) };
        let mut power = emission.power;
        let mut path = SpecularPath::new(emission.ray, Carried::Power);
        let mut is_direct = true;
        for bounce in 0..MAX_BOUNCES {
            let random = random.bounce(bounce);
            let Some(hit) = closest_hit(scene, memory, &path.ray)? else { break };
            let surface = read_surface(scene, memory, &path.ray, &hit)?;
            let arrival = path.arrive(&surface, random.choice());
            let arrived = std::mem::replace(&mut path.throughput, Vec3::ONE) * power;
            match arrival {
                Arrival::Lost => break,
                Arrival::GoesOn => {
                    let left = arrived * shading_share(&surface, path.ray.direction);
                    match survive(power, left, random.survival()) {
                        Some(left) => power = left,
                        None => break,
                    }
                }
                Arrival::Ends => {
                    let surface = surface.flat();
                    let is_caustic = is_direct && path.bounces > 0;
                    if surface.reflection.is_black() || self.purpose == Purpose::Caustics && !is_caustic {
                        break;
                    }
                    photons.push(self.stored(&surface, arrived, is_direct, random.dither()));
                    if self.purpose == Purpose::Caustics {
                        break;
                    }
                    let Some(sampled) = surface.reflector().sample(random.point()) else { break };
                    match survive(arrived, arrived * sampled.weight, random.survival()) {
                        Some(reflected) => power = reflected,
                        None => break,
                    }
                    is_direct = false;
                    let ray = Ray::new(surface.offset_origin(), sampled.direction);
                    path = SpecularPath::new(ray, Carried::Power);
                }
            }
        }
        Ok(())
    }

    /// A photon that has arrived at a surface.
    fn stored(&self, surface: &Surface, power: Vec3, direct: bool, dither: u32) -> StoredPhoton {
        let photon = Photon {
            position: surface.position.to_array(),
            power: Rgbe::encode((power / self.path_unit).to_array(), dither),
            direction: encode_direction(surface.outgoing.to_array()),
            axis: 0,
            normal: encode_normal(surface.normal.to_array()),
            disc: FULL_DISC,
            direct,
        };
        StoredPhoton::new(&self.grid, &photon)
    }
}

/// The greatest share of [`shading_share`].
const MAX_SHADING_SHARE: f32 = 4.0;

/// The factor of a photon's power where a smooth normal turns it: photons arrive and leave by the area of the
/// triangle, light is reflected by that of the smooth surface (Veach 1997, *Robust Monte Carlo methods for light transport
/// simulation*, section 5.3).
fn shading_share(surface: &Surface, left: Vec3) -> f32 {
    let Surface { normal, geometric_normal, outgoing: arrived, .. } = *surface;
    if normal == geometric_normal {
        return 1.0;
    }
    let cosines = |a: Vec3, b: Vec3| normal.dot(a).abs() * geometric_normal.dot(b).abs();
    let share = cosines(arrived, left) / cosines(left, arrived);
    if share < MAX_SHADING_SHARE { share } else { MAX_SHADING_SHARE }
}

/// Russian roulette: a photon goes on with the probability that its strongest channel keeps, and then carries the
/// power it came with in that channel.
fn survive(arrived: Vec3, reflected: Vec3, roulette: f32) -> Option<Vec3> {
    let probability = (reflected.max_element() / arrived.max_element()).min(1.0);
    (roulette < probability).then(|| reflected / probability)
}
