//! Photon paths: Russian roulette on the albedo; a photon is stored at every surface that is not specular.

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::render::specular_path::{Arrival, Carried, Passes, SpecularPath};
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

/// Result of the photon pass.
pub struct PhotonPass {
    /// Photons in the order of their paths, as many as requested.
    pub photons: Photons,
    /// Number of paths traced.
    pub paths: u64,
    /// Number of paths that met a surface that reflects or transmits light.
    met: u64,
}

/// Number of paths after which at least one photon per thousand further paths must be stored.
const FRUITLESS_PATHS: u64 = 1_000_000;
/// Maximum number of paths per stored caustic photon, beyond [`FRUITLESS_PATHS`]: a lower yield means that caustics carry
/// little light, for which few photons suffice.
const MAX_PATHS_TO_A_CAUSTIC_PHOTON: u64 = 20;
/// Number of paths of one task.
const PATHS_PER_TASK: u64 = 2048;
/// Number of tasks of a pilot.
const PILOT_TASKS: u64 = 4;
/// Minimum of the pilots' effective numbers of photons, aimed over unaimed, for which paths are aimed: 2, so that noise of the pilots
/// changes nothing in rooms, where both are about equal.
const MIN_GAIN_BY_AIM: f64 = 2.0;
/// Maximum number of bounces of a path; only surfaces without loss let a path reach it.
const MAX_BOUNCES: u32 = 512;

/// Traces paths until `count` photons are stored; none if no surface stores photons, and fewer if most light ends on surfaces that
/// store none. `progress` is called with the number
/// of photons, and returns whether to go on.
///
/// # Errors
/// If hardly any path meets a surface, or `progress` returns false.
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
    if !is_fruitless(stored, traced.paths) {
        return Err(PhotonError::Stopped);
    }
    // The fewer photons are all that there is to gather, unless light passes the surfaces by.
    if is_fruitless(traced.met as usize, traced.paths) {
        return Err(PhotonError::Lost { stored, paths: traced.paths });
    }
    Ok(traced)
}

/// Traces paths until `count` caustic photons are stored, or until the yield is so low that the missing ones are invisible.
/// `go_on` returns whether to go on.
///
/// # Errors
/// If `go_on` returns false.
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

/// Traces paths until `count` photons are stored, or `go_on(photons, paths)` returns false.
fn trace_while(
    packed: &PackedScene,
    (seed, purpose): (u32, Purpose),
    count: usize,
    go_on: &dyn Fn(usize, u64) -> bool,
) -> Result<PhotonPass, PhotonError> {
    let keeps_photons = match purpose {
        Purpose::Indirect => packed.keeps_photons(),
        Purpose::Caustics => packed.keeps_photons() || packed.has_lobes_under_punctual_lights(),
    };
    if !keeps_photons {
        let photons = Photons { list: Vec::new(), grid: packed.photon_grid(), power_unit: 1.0 };
        return Ok(PhotonPass { photons, paths: 0, met: 0 });
    }
    let tracer = match purpose {
        Purpose::Indirect => Tracer::of_more_photons(packed, seed).map_err(PhotonError::Unsound)?,
        Purpose::Caustics => {
            Tracer::new(packed, packed.caustic_sources().unwrap_or(packed.sources()), seed, purpose)
        }
    };
    let mut list: Vec<StoredPhoton> = Vec::with_capacity(count);
    let mut paths = 0_u64;
    let mut met = 0_u64;
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
            met += traced.met;
            let missing = count - list.len();
            if missing > 0 {
                paths += traced.paths_until(missing);
                list.extend_from_slice(traced.photons.get(..missing).unwrap_or(&traced.photons));
            }
        }
    }
    let power_unit = (tracer.path_unit / paths.max(1) as f32).max(f32::MIN_POSITIVE);
    Ok(PhotonPass { photons: Photons { list, grid: tracer.grid, power_unit }, paths, met })
}

/// Number of tasks of the next round, from the photons per path so far; at most 64, so that progress shows. It does not
/// affect which paths are traced.
fn next_tasks(missing: usize, stored: usize, paths: u64) -> u64 {
    let photons_per_path = if stored > 0 { stored as f64 / paths as f64 } else { 4.0 };
    let needed = (missing as f64 / photons_per_path) as u64;
    needed.div_ceil(PATHS_PER_TASK).clamp(1, 64)
}

/// Photons of a task's paths.
struct Traced {
    /// Photons in the order of their paths.
    photons: Vec<StoredPhoton>,
    /// Number of photons at the end of each path.
    ends: Vec<u32>,
    /// Number of paths that met a surface that reflects or transmits light.
    met: u64,
}

impl Traced {
    /// Number of paths until `count` photons are stored, the last path included; all paths if they store fewer.
    fn paths_until(&self, count: usize) -> u64 {
        let before = self.ends.partition_point(|&end| (end as usize) < count);
        (before + 1).min(self.ends.len()) as u64
    }
}

/// Map that photons are traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// The photon map: a photon at every surface that is not specular.
    Indirect,
    /// The caustic map: a photon at the first such surface, of paths that have met specular surfaces before.
    Caustics,
}

/// Parameters of all paths.
struct Tracer<'s> {
    scene: SceneImage,
    sources: &'s Sources,
    grid: PhotonGrid,
    /// Power of a photon of value 1 if the path were the only one, watts.
    path_unit: f32,
    seed: u32,
    purpose: Purpose,
}

impl<'s> Tracer<'s> {
    fn new(packed: &PackedScene, sources: &'s Sources, seed: u32, purpose: Purpose) -> Self {
        // Photons rarely gain power after emission: factor 2 at a Phong lobe, 16 at glass whose reflection is almost the
        // mirror's alone.
        let path_unit = power_of_two_above(sources.strongest.into());
        Self { scene: packed.view().0, sources, grid: packed.photon_grid(), path_unit, seed, purpose }
    }

    /// Tracer of the photon map whose paths store more photons: of unaimed paths, or of aimed ones, where far more of these meet a
    /// surface.
    fn of_more_photons(packed: &'s PackedScene, seed: u32) -> Result<Self, Fault> {
        let unaimed = Self::new(packed, packed.sources(), seed, Purpose::Indirect);
        let Some(sources) = packed.aimed_sources() else { return Ok(unaimed) };
        let aimed = Self::new(packed, sources, seed, Purpose::Indirect);
        // Paths of another seed, so that the choice does not depend on the photons of the map.
        let pilot = |tracer: &Self| Self { seed: !seed, ..*tracer }.pilot(packed);
        let [of_unaimed, of_aimed] = [pilot(&unaimed)?, pilot(&aimed)?];
        Ok(if of_aimed > MIN_GAIN_BY_AIM * of_unaimed { aimed } else { unaimed })
    }

    /// Effective number of the photons that the first paths store: `(sum w)^2 / sum w^2` of their powers w (Kish 1965).
    fn pilot(&self, packed: &PackedScene) -> Result<f64, Fault> {
        let tasks: Result<Vec<Traced>, Fault> = (0..PILOT_TASKS)
            .into_par_iter()
            .map(|task| self.trace(&mut packed.view().1, task * PATHS_PER_TASK))
            .collect();
        let powers = tasks?.into_iter().flat_map(|traced| traced.photons).map(StoredPhoton::power);
        let [sum, squares] =
            powers.fold([0.0; 2], |[sum, squares], power| [sum + power, squares + power * power]);
        Ok(if squares > 0.0 { sum * sum / squares } else { 0.0 })
    }

    /// Traces the paths of a task.
    fn trace(&self, memory: &mut impl MemoryPort, first: u64) -> Result<Traced, Fault> {
        let mut traced =
            Traced { photons: Vec::new(), ends: Vec::with_capacity(PATHS_PER_TASK as usize), met: 0 };
        for path in first..first + PATHS_PER_TASK {
            traced.met += u64::from(self.follow(memory, path, &mut traced.photons)?);
            traced.ends.push(traced.photons.len() as u32);
        }
        Ok(traced)
    }

    /// Traces a path. Returns whether it met a surface that reflects or transmits light.
    fn follow(
        &self,
        memory: &mut impl MemoryPort,
        path: u64,
        photons: &mut Vec<StoredPhoton>,
    ) -> Result<bool, Fault> {
        let scene = &self.scene;
        let random = PathRandom::new(self.seed, path);
        let Some(emission) = emit(scene, memory, self.sources, random)? else { return Ok(false) };
        let mut met = false;
        let mut power = emission.power;
        let passes = match self.purpose {
            Purpose::Indirect => Passes::NarrowLobes,
            Purpose::Caustics => Passes::CausticPhotons,
        };
        let mut path = SpecularPath::new(emission.ray, Carried::Power, passes);
        let mut is_direct = true;
        for bounce in 0..MAX_BOUNCES {
            let random = random.bounce(bounce);
            let Some(hit) = closest_hit(scene, memory, &path.ray)? else { break };
            let mut surface = Surface::NOWHERE;
            read_surface(scene, memory, &path.ray, &hit, &|choice| random.layer(choice), &mut surface)?;
            let [u, v] = random.point();
            let arrival = path.arrive(&mut surface, [random.choice(), u, v]);
            let arrived = std::mem::replace(&mut path.throughput, Vec3::ONE) * power;
            match arrival {
                Arrival::Lost | Arrival::Absorbed => break,
                Arrival::GoesOn => {
                    met = true;
                    let left = arrived * shading_share(&surface, path.ray.direction);
                    match survive(power, left, random.survival()) {
                        Some(left) => power = left,
                        None => break,
                    }
                }
                Arrival::Ends => {
                    let surface = surface.flat();
                    let is_caustic = is_direct && path.bounces > 0;
                    let is_of_map = self.purpose == Purpose::Indirect || is_caustic;
                    if !is_of_map || !is_lit(&surface, emission.has_extent) {
                        break;
                    }
                    met = true;
                    let flag = match self.purpose {
                        Purpose::Indirect => is_direct,
                        Purpose::Caustics => emission.has_extent,
                    };
                    // Light that comes through a surface is stored at the side where it arrives.
                    if !surface.is_behind {
                        photons.push(self.stored(&surface, arrived, flag, random.dither()));
                    }
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
                    path = SpecularPath::new(ray, Carried::Power, passes);
                }
            }
        }
        Ok(met)
    }

    /// Record of a photon that arrives at a surface. Of photons that reach the surface some meet its base, and gathers are there as
    /// rarely: the record has the power of all.
    fn stored(&self, surface: &Surface, arrived: Vec3, direct: bool, dither: u32) -> StoredPhoton {
        let power = arrived / (surface.probability * surface.coverage);
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

/// Returns whether photons of a light light a surface: rays of a narrow lobe meet lights with extent.
fn is_lit(surface: &Surface, has_extent: bool) -> bool {
    let reflection = surface.reflection;
    !if has_extent { reflection.without_narrow_lobe() } else { reflection }.is_black()
}

/// Maximum of [`shading_share`].
const MAX_SHADING_SHARE: f32 = 4.0;

/// Correction of a photon's power for a shading normal `n` at a triangle with the normal `g`: `|n.i| |g.o| / (|n.o| |g.i|)`
/// with the directions of incidence `i` and exitance `o` (Veach 1997, *Robust Monte Carlo methods for light transport
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

/// Russian roulette: a photon survives with the probability `reflected / arrived` of its strongest channel, over which its
/// power is divided.
fn survive(arrived: Vec3, reflected: Vec3, roulette: f32) -> Option<Vec3> {
    let probability = (reflected.max_element() / arrived.max_element()).min(1.0);
    (roulette < probability).then(|| reflected / probability)
}
