//! Emission: the first ray of a photon path, and its power.
//!
//! The first four random numbers of a path choose its source, position and direction. They are a point of a
//! low-discrepancy sequence: the additive recurrence of Roberts 2018 (*The unreasonable effectiveness of
//! quasirandom sequences*), indexed by the path's number and shifted by the seed. Random numbers of bounces
//! are hashes of (seed, path, bounce).

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::light::{
    EmitterPoint, ProfileFrame, disk_direction, emitter_point, environment_direction, environment_radiance,
    falloff, profile_intensity, read_emitter,
};
use photoncard_firmware::scene::{Ray, RayKind, SceneImage, Surface, closest_hit};
use photoncard_shared::layout::{Emitter, EmitterKind};
use photoncard_shared::message::Fault;

use super::guide::{Guide, Point, Warped};
use crate::light::{Aim, ProfileDirection, ProfileDirections, Profiles, SolidCone, Source, Sources, Targets};

/// An emitted photon: the first ray of a path, and its power.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emission {
    /// First ray of the path.
    pub(super) ray: Ray,
    /// Power per channel, watts, if this were the only path.
    pub(super) power: Vec3,
    /// True if the light comes from a surface or from the environment, which rays can hit.
    pub(super) has_extent: bool,
    /// Light group of the light.
    pub(super) light_group: u8,
}

/// Constants of the recurrence: 2^64 divided by the powers 1 to 4 of the root of `x^5 = x + 1`.
const RECURRENCE: [u64; 4] =
    [0xdb4f_0b91_75ae_2165, 0xbbe0_5633_03a4_615f, 0xa0f2_ec75_a1fe_1575, 0x89e1_8285_7d9e_d688];

#[derive(Clone, Copy)]
pub(super) struct PathRandom {
    seed: u32,
    path: u64,
}

impl PathRandom {
    pub(super) fn new(seed: u32, path: u64) -> Self {
        Self { seed, path }
    }

    /// Low-discrepancy point for the emission, in units of 2^-64.
    fn emission(self) -> Point {
        std::array::from_fn(|dimension| {
            let shift = (hash(self.seed ^ hash(dimension as u32 + 1)) as u64) << 32;
            RECURRENCE[dimension].wrapping_mul(self.path + 1).wrapping_add(shift)
        })
    }

    pub(super) fn bounce(self, bounce: u32) -> BounceRandom {
        let path = hash(hash(self.seed ^ 0x2c1b_3c6d).wrapping_add(self.path as u32));
        BounceRandom { key: hash(hash(path.wrapping_add((self.path >> 32) as u32)).wrapping_add(bounce)) }
    }
}

#[derive(Clone, Copy)]
pub(super) struct BounceRandom {
    key: u32,
}

impl BounceRandom {
    fn bits(self, index: u32) -> u32 {
        hash(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9)))
    }

    /// Point of the unit square that selects the direction.
    pub(super) fn point(self) -> [f32; 2] {
        [1, 2].map(|index| unit_interval(self.bits(index)))
    }

    /// Number in [0, 1) for Russian roulette.
    pub(super) fn survival(self) -> f32 {
        unit_interval(self.bits(3))
    }

    /// Number in [0, 1) that selects reflection or transmission at a specular surface.
    pub(super) fn choice(self) -> f32 {
        unit_interval(self.bits(5))
    }

    /// Number in [0, 1) for a choice of a surface's layer.
    pub(super) fn layer(self, choice: u32) -> f32 {
        unit_interval(self.bits(6 + choice))
    }

    /// Random bits for the rounding of the power.
    pub(super) fn dither(self) -> u32 {
        self.bits(4)
    }
}

fn unit_of_bits(bits: u64) -> f32 {
    unit_interval((bits >> 32) as u32)
}

fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

/// Returns the low-discrepancy point from which a path's emission is sampled, and its weight. A guide warps
/// the point.
pub(super) fn emission_point(guide: Option<&Guide>, random: PathRandom) -> Warped {
    let point = random.emission();
    guide.map_or(Warped { point, weight: 1.0 }, |guide| guide.warp(point))
}

/// Samples the emission of a path: a source by its power, a position and a direction. Returns `None` if
/// Russian roulette ends the path, the direction carries no light, or there are no sources. A guide warps the
/// distribution of all choices.
pub(super) fn emit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (sources, guide): (&Sources, Option<&Guide>),
    random: PathRandom,
) -> Result<Option<Emission>, Fault> {
    let Warped { point, weight } = emission_point(guide, random);
    let [first, b, c, d] = point;
    let [b, c, d] = [b, c, d].map(unit_of_bits);
    let Some(chosen) = sources.choose(first) else { return Ok(None) };
    let (is_aimed, c) = sources.targets.is_aimed(c);
    let way = Way { targets: &sources.targets, is_aimed };
    let mut has_extent = true;
    let light_group;
    let emission = match chosen.source {
        Source::Emitter(index) => {
            let emitter = read_emitter(scene, memory, index)?;
            has_extent = matches!(emitter.kind, EmitterKind::Triangle { .. });
            light_group = emitter.light_group;
            from_emitter((scene, memory), &emitter, (way, &sources.profiles), [chosen.rest, b, c, d])?
        }
        Source::Distant { direction, spread, irradiance, light_group: of_light } => {
            (has_extent, light_group) = (false, of_light);
            let direction = disk_direction(direction, spread, [chosen.rest, b]);
            from_afar((scene, memory), sources, way, (direction, irradiance), [c, d])?
        }
        Source::Cell { across: [left, width], cosines: [upper, lower], solid_angle } => {
            light_group = scene.header.lights.light_group;
            let cosine = (upper + (lower - upper) * b).clamp(-1.0, 1.0);
            let towards = environment_direction(left + width * chosen.rest, cosine);
            let irradiance = environment_radiance(scene, memory, towards)? * solid_angle;
            from_afar((scene, memory), sources, way, (-towards, irradiance), [c, d])?
        }
    };
    let emission = emission.map(|emission| Emission {
        power: emission.power / chosen.probability,
        has_extent,
        light_group,
        ..emission
    });
    let emission = emission.filter(|emission| emission.power.max_element() > 0.0);
    // Bounces have smaller numbers than `u32::MAX`, so that none of them uses this random number too.
    let survival = random.bounce(u32::MAX).survival();
    // The roulette equalises the power of the sources, not that of guided photons.
    let emission = emission.and_then(|emission| roulette(emission, sources.power, survival));
    Ok(emission.map(|emission| Emission { power: emission.power * weight, ..emission }))
}

/// Applies Russian roulette to an emission below the mean power, for example from dark parts of an emissive
/// texture. Photons then have equal power.
fn roulette(emission: Emission, mean_power: f64, roulette: f32) -> Option<Emission> {
    let probability = (f64::from(emission.power.element_sum()) / (3.0 * mean_power)) as f32;
    // A probability near 1 counts as 1, because rounding can lower it.
    if probability > 0.99 {
        return Some(emission);
    }
    (roulette < probability).then(|| Emission { power: emission.power / probability, ..emission })
}

/// Method by which a path's first ray is chosen: aimed at targets or not.
#[derive(Clone, Copy)]
struct Way<'s> {
    targets: &'s Targets,
    is_aimed: bool,
}

impl Way<'_> {
    /// Divides the emission's power by the mixture density of aimed and other photons (balance heuristic,
    /// Veach 1997, section 9.2.2) instead of the density of its own method. `densities` returns the densities
    /// of aimed and of other photons for a ray.
    fn balanced(&self, emission: Option<Emission>, densities: impl Fn(&Ray) -> [f32; 2]) -> Option<Emission> {
        let emission = emission?;
        if [0.0, 1.0].contains(&self.targets.share) {
            return Some(emission);
        }
        let [aimed, free] = densities(&emission.ray);
        let own = if self.is_aimed { aimed } else { free };
        let mixed = self.targets.mixed(aimed, free);
        // The density can be 0 by rounding, at the border of a sphere.
        (mixed > 0.0).then(|| Emission { power: emission.power * (own / mixed), ..emission })
    }
}

/// Samples the emission of an emitter, as if it were the only source.
fn from_emitter(
    (scene, memory): (&SceneImage, &mut impl MemoryPort),
    emitter: &Emitter,
    (way, profiles): (Way, &Profiles),
    [a, b, c, d]: [f32; 4],
) -> Result<Option<Emission>, Fault> {
    let intensity = Vec3::from(emitter.emission);
    Ok(match emitter.kind {
        EmitterKind::Triangle { vertices, double_sided, .. } => {
            let Some(point) = emitter_point(scene, memory, emitter, [a, b])? else { return Ok(None) };
            let [p, q, r] = vertices.map(Vec3::from);
            let area = 0.5 * (q - p).cross(r - p).length();
            let emission = if way.is_aimed {
                aimed(&point, double_sided, way.targets, [c, d])
            } else {
                by_cosine(&point, double_sided, [c, d])
            };
            let emission = way.balanced(emission, |ray| {
                let sides = if double_sided { 2.0 } else { 1.0 };
                let free = point.normal.dot(ray.direction).abs() * (FRAC_1_PI / sides);
                [way.targets.direction_density(point.position, ray.direction), free]
            });
            emission.map(|Emission { ray, power, .. }| Emission {
                ray,
                power: power * area,
                has_extent: true,
                light_group: 0,
            })
        }
        EmitterKind::Point { position } => {
            from_point(way, position.into(), &SolidCone::ALL, [c, d], |_| intensity)
        }
        EmitterKind::Spot { position, direction, scale, offset } => {
            let axis = Vec3::from(direction);
            let height = (1.0 + offset / scale).clamp(0.0, 2.0);
            let towards = |direction: Vec3| intensity * falloff(axis.dot(direction), scale, offset);
            from_point(way, position.into(), &SolidCone { axis, height }, [c, d], towards)
        }
        EmitterKind::Profile { position, aim, across, texture } => {
            let Some(directions) = profiles.get(&texture) else { return Ok(None) };
            let beam = Beam { directions, frame: ProfileFrame::new(aim, across) };
            let Some(emission) = from_point(way, position.into(), &beam, [c, d], |_| intensity) else {
                return Ok(None);
            };
            let local = beam.frame.local(emission.ray.direction);
            let relative = profile_intensity(scene, memory, texture, local)?;
            Some(Emission { power: emission.power * relative, ..emission })
        }
    })
}

/// Distribution of the directions of photons from a point.
trait Directions {
    fn aim(&self, square: [f32; 2]) -> Aim;

    /// Probability density of a direction, 1/sr.
    fn density(&self, direction: Vec3) -> f32;
}

impl Directions for SolidCone {
    fn aim(&self, square: [f32; 2]) -> Aim {
        Aim { towards: self.direction(square), measure: self.solid_angle() }
    }

    fn density(&self, direction: Vec3) -> f32 {
        if self.holds(direction) { 1.0 / self.solid_angle() } else { 0.0 }
    }
}

/// Directions of a profile, in its light's frame.
#[derive(Clone, Copy)]
struct Beam<'p> {
    directions: &'p ProfileDirections,
    frame: ProfileFrame,
}

impl Directions for Beam<'_> {
    fn aim(&self, square: [f32; 2]) -> Aim {
        let ProfileDirection { local, density } = self.directions.sample(square);
        Aim { towards: self.frame.world(local).normalize(), measure: 1.0 / density }
    }

    fn density(&self, direction: Vec3) -> f32 {
        self.directions.density(self.frame.local(direction))
    }
}

/// Samples the emission of a light at a point. `intensity` returns its radiant intensity in a direction,
/// W/sr, which is 0 where `directions` has none. The direction is sampled towards the targets, or by
/// `directions`.
fn from_point(
    way: Way,
    position: Vec3,
    directions: &impl Directions,
    square: [f32; 2],
    intensity: impl Fn(Vec3) -> Vec3,
) -> Option<Emission> {
    let Aim { towards, measure } =
        if way.is_aimed { way.targets.direction(position, square)? } else { directions.aim(square) };
    let ray = Ray::new(RayKind::Light, position, towards);
    let emission = Emission { ray, power: intensity(towards) * measure, has_extent: true, light_group: 0 };
    way.balanced(Some(emission), |_| {
        [way.targets.direction_density(position, towards), directions.density(towards)]
    })
}

/// Samples the cosine-weighted emission of a point on a triangle. Its power is per square metre. A
/// double-sided triangle emits from both sides.
fn by_cosine(point: &EmitterPoint, double_sided: bool, [c, d]: [f32; 2]) -> Option<Emission> {
    let (sides, is_back, c) = if double_sided {
        (2.0, c >= 0.5, if c >= 0.5 { 2.0 * c - 1.0 } else { 2.0 * c })
    } else {
        (1.0, false, c)
    };
    let normal = if is_back { -point.normal } else { point.normal };
    // A white Lambertian surface has the cosine distribution of the emitter.
    let white = Surface::white(point.position, normal, point.magnitude);
    white.reflector().sample([c, d]).map(|sampled| Emission {
        ray: Ray::new(RayKind::Light, white.offset_origin(), sampled.direction),
        power: point.emission * (PI * sides),
        has_extent: true,
        light_group: 0,
    })
}

/// Samples the emission of a point on a triangle towards the targets. Its power is per square metre.
fn aimed(point: &EmitterPoint, double_sided: bool, targets: &Targets, square: [f32; 2]) -> Option<Emission> {
    let Aim { towards, measure } = targets.direction(point.position, square)?;
    let cosine = point.normal.dot(towards);
    let normal = if cosine < 0.0 { -point.normal } else { point.normal };
    let origin = Surface::white(point.position, normal, point.magnitude).offset_origin();
    (cosine > 0.0 || double_sided).then(|| Emission {
        ray: Ray::new(RayKind::Light, origin, towards),
        power: point.emission * (cosine.abs() * measure),
        has_extent: true,
        light_group: 0,
    })
}

/// Samples light that comes from infinitely far away along `direction`. `irradiance` is that of a surface
/// facing the light. If photons are stored in only a part of the scene, rays that miss this part are dropped,
/// whether they are aimed or not.
fn from_afar(
    (scene, memory): (&SceneImage, &mut impl MemoryPort),
    sources: &Sources,
    way: Way,
    (direction, irradiance): (Vec3, Vec3),
    square: [f32; 2],
) -> Result<Option<Emission>, Fault> {
    let bounds = sources.bounds;
    let emission = if way.is_aimed {
        way.targets.place(direction, square).map(|Aim { towards, measure }| {
            // The origin lies before the whole box.
            let corners = bounds.map(|corner| corner * direction);
            let origin = towards + direction * corners[0].min(corners[1]).element_sum();
            Emission {
                ray: Ray::new(RayKind::Light, origin, direction),
                power: irradiance * measure,
                has_extent: true,
                light_group: 0,
            }
        })
    } else {
        Some(through_box(bounds, direction, irradiance, square))
    };
    let emission = way.balanced(emission, |ray| {
        let free = if meets_box(bounds, ray) { 1.0 / shown(bounds, direction).element_sum() } else { 0.0 };
        [way.targets.place_density(direction, ray.origin), free]
    });
    if sources.beyond == 0.0 {
        return Ok(emission);
    }
    let Some(emission) = emission.filter(|emission| meets_box(bounds, &emission.ray)) else {
        return Ok(None);
    };
    // A ray begins outside the scene only if something lies in front of the box, because the precision of a
    // ray falls with its length.
    let origin = emission.ray.origin;
    let is_open = closest_hit(scene, memory, &Ray::new(RayKind::Light, origin, -direction))?.is_none();
    let origin = if is_open { origin } else { origin - direction * sources.beyond };
    Ok(Some(Emission { ray: Ray::new(RayKind::Light, origin, direction), ..emission }))
}

/// Projected areas of a box's faces along a direction, m^2.
fn shown([lower, upper]: [Vec3; 2], direction: Vec3) -> Vec3 {
    let size = upper - lower;
    direction.abs() * Vec3::new(size.y * size.z, size.z * size.x, size.x * size.y)
}

/// Returns whether the line of a ray hits a box.
fn meets_box(bounds: [Vec3; 2], ray: &Ray) -> bool {
    let [a, b] = bounds.map(|corner| (corner - ray.origin) / ray.direction);
    // A component is NaN if the ray is parallel to a face and its origin lies in the plane of the face.
    let first = a.min(b).to_array().into_iter().fold(f32::NEG_INFINITY, f32::max);
    let last = a.max(b).to_array().into_iter().fold(f32::INFINITY, f32::min);
    first <= last
}

/// Samples light that comes from infinitely far away through the faces of a box. Faces are chosen in
/// proportion to their projected areas.
fn through_box(bounds: [Vec3; 2], direction: Vec3, irradiance: Vec3, [c, d]: [f32; 2]) -> Emission {
    let [lower, upper] = bounds;
    let size = upper - lower;
    let shown = shown(bounds, direction);
    let area = shown.element_sum();
    let mut number = c * area;
    let mut axis = 2;
    for candidate in 0..2 {
        if number < shown[candidate] {
            axis = candidate;
            break;
        }
        number -= shown[candidate];
    }
    let across = if shown[axis] > 0.0 { (number / shown[axis]).clamp(0.0, 1.0) } else { 0.5 };
    let mut place = [0.0; 3];
    place[axis] = if direction[axis] < 0.0 { 1.0 } else { 0.0 };
    place[(axis + 1) % 3] = across;
    place[(axis + 2) % 3] = d;
    let origin = lower + size * Vec3::from(place);
    Emission {
        ray: Ray::new(RayKind::Light, origin, direction),
        power: irradiance * area,
        has_extent: true,
        light_group: 0,
    }
}
