//! Traces a photon path, with Russian roulette on the albedo. A photon is stored at every surface that is not
//! specular.

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::render::specular_path::{Arrival, Carried, Passes, SpecularPath};
use photoncard_firmware::scene::{Ray, RayKind, SceneImage, Surface, closest_hit, read_surface};
use photoncard_shared::layout::{
    FULL_DISC, Photon, PhotonGrid, Rgbe, encode_direction, encode_normal, power_of_two_above,
};
use photoncard_shared::message::Fault;

use super::emit::{PathRandom, emit};
use super::guide::{Guide, UNIFORM_SHARE};
use super::stored::StoredPhoton;
use crate::light::Sources;
use crate::pack::PackedScene;

pub(super) const PATHS_PER_TASK: u64 = 2048;
/// Maximum number of bounces of a path. A path reaches it only between surfaces without loss.
const MAX_BOUNCES: u32 = 512;

/// Photons of the paths of a task.
pub(super) struct Traced {
    /// Photons in the order of their paths.
    pub(super) photons: Vec<StoredPhoton>,
    /// Number of photons stored up to the end of each path.
    pub(super) ends: Vec<u32>,
}

impl Traced {
    /// Number of paths until `count` photons are stored, including the last path; all paths if they store
    /// fewer.
    pub(super) fn paths_until(&self, count: usize) -> u64 {
        let before = self.ends.partition_point(|&end| (end as usize) < count);
        (before + 1).min(self.ends.len()) as u64
    }
}

/// Map for which photons are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The photon map, which stores a photon at every surface that is not specular.
    Indirect,
    /// The caustic map, which stores a photon at the first surface that is not specular, if specular surfaces
    /// changed the path's direction before. Flat glass, which shadow rays pass, does not change it.
    Caustics,
}

/// Sources, guide and units of the paths of one map.
pub(super) struct Tracer<'s> {
    packed: &'s PackedScene,
    scene: SceneImage,
    sources: &'s Sources,
    pub(super) guide: Option<&'s Guide>,
    pub(super) grid: PhotonGrid,
    /// Power, in watts, that the stored value 1 represents if a photon's path is the only one.
    pub(super) path_unit: f32,
    pub(super) seed: u32,
    purpose: Purpose,
}

impl<'s> Tracer<'s> {
    pub(super) fn new(packed: &'s PackedScene, sources: &'s Sources, seed: u32, purpose: Purpose) -> Self {
        // Photons rarely gain power after emission. The exceptions are Phong lobes, by a factor of 2, and
        // glass whose reflection is almost only that of a mirror, by a factor of 16.
        let path_unit = power_of_two_above(sources.strongest.into());
        let (scene, grid) = (packed.view().0, packed.photon_grid());
        Self { packed, scene, sources, guide: None, grid, path_unit, seed, purpose }
    }

    /// Tracer with another seed.
    pub(super) fn with_seed(&self, seed: u32) -> Self {
        Self { seed, ..*self }
    }

    /// Tracer whose paths are guided, if `guide` is given. Its power unit is then larger, because photons can
    /// be stronger.
    pub(super) fn guided(self, guide: Option<&'s Guide>) -> Self {
        let scale = if guide.is_some() { power_of_two_above(1.0 / UNIFORM_SHARE) } else { 1.0 };
        Self { guide, path_unit: self.path_unit * scale, ..self }
    }

    /// Traces the paths of a task, from path `first` on.
    pub(super) fn trace(&self, memory: &mut impl MemoryPort, first: u64) -> Result<Traced, Fault> {
        let mut traced = Traced { photons: Vec::new(), ends: Vec::with_capacity(PATHS_PER_TASK as usize) };
        for path in first..first + PATHS_PER_TASK {
            self.follow(memory, path, &mut traced.photons)?;
            traced.ends.push(traced.photons.len() as u32);
        }
        Ok(traced)
    }

    /// Traces the path with the number `path`, and appends the photons that it stores.
    fn follow(
        &self,
        memory: &mut impl MemoryPort,
        path: u64,
        photons: &mut Vec<StoredPhoton>,
    ) -> Result<(), Fault> {
        let scene = &self.scene;
        let random = PathRandom::new(self.seed, path);
        let Some(emission) = emit(scene, memory, (self.sources, self.guide), random)? else {
            return Ok(());
        };
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
                    let left = arrived * shading_share(&surface, path.ray.direction);
                    match survive(power, left, random.survival()) {
                        Some(left) => power = left,
                        None => break,
                    }
                }
                Arrival::Ends => {
                    let surface = surface.flat();
                    let is_caustic = is_direct && !path.is_straight;
                    let is_of_map = self.purpose == Purpose::Indirect || is_caustic;
                    if !is_of_map || !is_lit(&surface, emission.has_extent) {
                        break;
                    }
                    let flag = match self.purpose {
                        Purpose::Indirect => is_direct,
                        Purpose::Caustics => emission.has_extent,
                    };
                    // Light that comes through a surface is stored at the side where it arrives.
                    if !surface.is_behind && self.packed.stores_photons_at(surface.position) {
                        let marks = (flag, emission.light_group);
                        photons.push(self.stored(&surface, arrived, marks, random.dither()));
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
                    let ray = Ray::new(RayKind::Light, surface.offset_origin(), sampled.direction);
                    path = SpecularPath::new(ray, Carried::Power, passes);
                }
            }
        }
        Ok(())
    }

    /// Encodes a photon that arrives at a surface. Its power is divided by the product of the surface's layer
    /// probability and coverage, because photons and gathers reach the base layer only with this probability.
    fn stored(
        &self,
        surface: &Surface,
        arrived: Vec3,
        (direct, light_group): (bool, u8),
        dither: u32,
    ) -> StoredPhoton {
        let power = arrived / (surface.probability * surface.coverage);
        let photon = Photon {
            position: surface.position.to_array(),
            power: Rgbe::encode((power / self.path_unit).to_array(), dither),
            direction: encode_direction(surface.outgoing.to_array()),
            axis_or_group: light_group,
            normal: encode_normal(surface.normal.to_array()),
            disc: FULL_DISC,
            direct,
        };
        StoredPhoton::new(&self.grid, &photon)
    }
}

/// Returns whether a surface needs photons of a light. A narrow lobe needs only photons of lights without
/// extent, because rays of the lobe cannot hit these lights.
fn is_lit(surface: &Surface, has_extent: bool) -> bool {
    let reflection = surface.reflection;
    !if has_extent { reflection.without_narrow_lobe() } else { reflection }.is_black()
}

/// Maximum of [`shading_share`].
const MAX_SHADING_SHARE: f32 = 4.0;

/// Correction of a photon's power for a shading normal `n` on a triangle with the normal `g`:
/// `|n.i| |g.o| / (|n.o| |g.i|)`, where `i` is the direction of incidence and `o` of exitance (Veach 1997,
/// *Robust Monte Carlo methods for light transport simulation*, section 5.3).
fn shading_share(surface: &Surface, left: Vec3) -> f32 {
    let Surface { normal, geometric_normal, outgoing: arrived, .. } = *surface;
    if normal == geometric_normal {
        return 1.0;
    }
    let cosines = |a: Vec3, b: Vec3| normal.dot(a).abs() * geometric_normal.dot(b).abs();
    let share = cosines(arrived, left) / cosines(left, arrived);
    if share < MAX_SHADING_SHARE { share } else { MAX_SHADING_SHARE }
}

/// Applies Russian roulette: a photon survives with the probability `min(1, max(reflected) / max(arrived))`
/// over the channels. Its power is then divided by this probability.
fn survive(arrived: Vec3, reflected: Vec3, roulette: f32) -> Option<Vec3> {
    let probability = (reflected.max_element() / arrived.max_element()).min(1.0);
    (roulette < probability).then(|| reflected / probability)
}
