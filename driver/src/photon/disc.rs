//! How much of the disc around a photon is surface: the boundary correction of the density estimate.
//!
//! A gather divides by the area of a flat disc. Near an edge or in a corner part of that disc is no surface, the area is
//! too large and the estimate too dark: on a Cornell box by some 2 % of all indirect light. Here, for every photon, the
//! part that is surface is measured once, with short rays, for the radius that a gather at the photon would have. A
//! gather then divides by that part of the area ([`photoncard_firmware::photon`]).
//!
//! Most photons lie inside a large flat surface. They are found in groups, by one test of a disc that holds the discs
//! of the whole group; only the others are measured one by one.

use glam::Vec3;
use photoncard_firmware::memory::{Lines, MemoryPort};
use photoncard_firmware::photon::{CandidateBuffer, MIN_NORMAL_COSINE, NearestPhotons, gather};
use photoncard_firmware::scene::{Ray, SceneImage, closest_hit, magnitude, offset_origin, read_surface};
use photoncard_shared::budget::{REFERENCE, gather_candidates};
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{FULL_DISC, Photon, Record, decode_normal};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::PhotonError;
use crate::pack::CardImage;

/// Points tested on the disc of one photon.
const POINTS: u32 = 32;
/// Points tested on the disc of a group.
const GROUP_POINTS: u32 = 64;
/// Levels of the tree below a group's root: up to 31 photons.
const GROUP_LEVELS: u32 = 5;
/// Photons from which the automatic greatest distance is estimated.
const SAMPLED_PHOTONS: usize = 2048;
/// Share of the sampled photons whose k-th neighbour lies within the automatic greatest distance.
const COVERED_SHARE: f64 = 0.95;

type Buffer = CandidateBuffer<{ gather_candidates(REFERENCE.neighbors) }>;

/// A search of the photon map, with its buffer.
struct Searcher<'a> {
    scene: SceneImage,
    memory: Lines<'a>,
    buffer: Box<Buffer>,
    neighbors: u32,
    max_distance: f32,
}

impl<'a> Searcher<'a> {
    fn new(image: &'a CardImage, neighbors: u32, max_distance: f32) -> Self {
        let (scene, memory) = image.view();
        Self { scene, memory, buffer: Box::default(), neighbors, max_distance }
    }

    /// The radius of a gather at `position`, metres: the distance of the k-th photon, or the greatest distance.
    fn radius(&mut self, position: Vec3) -> Result<f32, Fault> {
        let mut nearest = NearestPhotons::new(self.buffer.view(), self.neighbors, self.max_distance);
        gather(&self.scene, &mut self.memory, position, &mut nearest)?;
        if !nearest.is_full() {
            return Ok(self.max_distance);
        }
        let farthest = nearest.candidates().map(|candidate| candidate.distance_squared()).fold(0.0, f32::max);
        Ok(farthest.sqrt())
    }
}

/// The greatest distance of gathers that the photons' density suggests, metres: that within which 95 % of the photons
/// have `neighbors` others.
///
/// # Errors
/// If the image is not sound.
pub(super) fn automatic_max_distance(image: &CardImage, neighbors: u32) -> Result<f32, Fault> {
    let (scene, memory) = image.view();
    let count = scene.header.section(SectionKind::Photons).records as usize;
    let step = count.div_ceil(SAMPLED_PHOTONS).max(1);
    let unlimited = f32::MAX.sqrt() * 0.5;
    let distances: Result<Vec<f32>, Fault> = (0..count)
        .into_par_iter()
        .step_by(step)
        .map_init(
            || (Searcher::new(image, neighbors, unlimited), memory),
            |(searcher, memory), index| {
                let photon = read_photon(&scene, memory, index as u32)?;
                searcher.radius(photon.position.into())
            },
        )
        .collect();
    let mut distances = distances?;
    // Fewer photons than neighbours: no distance is short of any.
    distances.retain(|&distance| distance < unlimited);
    distances.sort_by(f32::total_cmp);
    let place = (distances.len() as f64 * COVERED_SHARE) as usize;
    let covered = distances.get(place.min(distances.len().saturating_sub(1))).copied();
    Ok(covered.unwrap_or_else(|| image.diagonal()).max(f32::MIN_POSITIVE.sqrt()))
}

/// Measures the disc fraction of every photon for gathers of `neighbors` photons within `max_distance`, and writes it
/// into the image. `go_on` is asked now and then.
///
/// # Errors
/// If the image is not sound, or `go_on` says no.
pub(super) fn measure_discs(
    image: &mut CardImage,
    neighbors: u32,
    max_distance: f32,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<(), PhotonError> {
    let (scene, _) = image.view();
    let count = scene.header.section(SectionKind::Photons).records;
    let measured: Result<Vec<Vec<(u32, u8)>>, PhotonError> = groups(count)
        .into_par_iter()
        .map_init(
            || Searcher::new(image, neighbors, max_distance),
            |searcher, group| {
                if !go_on() {
                    return Err(PhotonError::Stopped);
                }
                Ok(measure_group(searcher, &group)?)
            },
        )
        .collect();
    let measured = measured?;
    let first_line = scene.header.section(SectionKind::Photons).first_line as usize;
    let lines = image.lines_mut();
    for (index, disc) in measured.into_iter().flatten() {
        let line = &mut lines[first_line + index as usize / Photon::PER_LINE];
        if let Some(record) = line.record_mut::<{ Photon::BYTES }>(index as usize % Photon::PER_LINE) {
            *record = Photon { disc, ..Photon::read(record) }.to_bytes();
        }
    }
    Ok(())
}

/// The photons of a tree in groups: subtrees of [`GROUP_LEVELS`] levels, which are near each other; what is above them
/// goes alone.
fn groups(count: u32) -> Vec<Vec<u32>> {
    let levels = u32::BITS - count.leading_zeros();
    let root_level = levels.saturating_sub(GROUP_LEVELS);
    let first_root = (1_u32 << root_level) - 1;
    let alone = (0..first_root.min(count)).map(|index| vec![index]);
    let subtrees = (first_root..(2 * first_root + 1).min(count)).map(|root| {
        let mut group = vec![root];
        let mut next = 0;
        while let Some(&node) = group.get(next) {
            group.extend([2 * node + 1, 2 * node + 2].into_iter().filter(|&child| child < count));
            next += 1;
        }
        group
    });
    alone.chain(subtrees).collect()
}

/// The photons of a group whose disc is not whole, with their codes.
fn measure_group(searcher: &mut Searcher, group: &[u32]) -> Result<Vec<(u32, u8)>, Fault> {
    let (scene, mut memory) = (searcher.scene, searcher.memory);
    let photons: Result<Vec<Photon>, Fault> =
        group.iter().map(|&index| read_photon(&scene, &mut memory, index)).collect();
    let photons = photons?;
    if photons.len() > 1 && is_inside_surface(searcher, &photons)? {
        return Ok(Vec::new());
    }
    let mut measured = Vec::new();
    for (&index, photon) in group.iter().zip(&photons) {
        let radius = searcher.radius(photon.position.into())?;
        let normal = exact_normal(&scene, &mut memory, photon, radius)?;
        let disc = Disc { centre: photon.position.into(), normal, radius };
        let surface_points = disc.surface_points(&scene, &mut memory, POINTS)?;
        if surface_points < POINTS {
            // The photon is on a surface: there is never none.
            let code = (surface_points.max(1) * (FULL_DISC as u32 + 1) / POINTS - 1) as u8;
            measured.push((index, code));
        }
    }
    Ok(measured)
}

fn read_photon(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<Photon, Fault> {
    const PER_LINE: u32 = Photon::PER_LINE as u32;
    scene.record::<{ Photon::BYTES }, PER_LINE>(memory, SectionKind::Photons, index).map(Photon::read)
}

/// The normal that the photon's code stands for.
fn coded_normal(photon: &Photon) -> Vec3 {
    Vec3::from(decode_normal(photon.normal)).normalize()
}

/// The normal of the surface that the photon lies on, which a short ray finds again; its code is rough.
fn exact_normal(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    photon: &Photon,
    radius: f32,
) -> Result<Vec3, Fault> {
    let coded = coded_normal(photon);
    let above = offset_origin(photon.position.into(), coded, magnitude(&[photon.position.into()]))
        + coded * lift(scene, radius);
    let ray = Ray { origin: above, direction: -coded, max_distance: radius };
    let Some(hit) = closest_hit(scene, memory, &ray)? else { return Ok(coded) };
    let normal = read_surface(scene, memory, &ray, &hit)?.normal;
    Ok(if normal.dot(coded) >= MIN_NORMAL_COSINE { normal } else { coded })
}

/// Whether the discs of a whole group lie inside one flat surface.
fn is_inside_surface(searcher: &mut Searcher, photons: &[Photon]) -> Result<bool, Fault> {
    if photons.iter().any(|photon| photon.normal != photons[0].normal) {
        return Ok(false);
    }
    let places = || photons.iter().map(|photon| Vec3::from(photon.position));
    let centre = places().sum::<Vec3>() / photons.len() as f32;
    // The centre of photons on a curved surface is off it: the test is made from the nearest of them.
    let distance = |place: &Vec3| place.distance_squared(centre);
    let Some(nearest) = places().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { return Ok(false) };
    let spread = places().map(|place| place.distance(nearest)).fold(0.0, f32::max);
    // From one photon to another the radius of a gather grows by their distance at the most.
    let radius = spread + (searcher.radius(nearest)? + spread).min(searcher.max_distance);
    let mut memory = searcher.memory;
    let Some(photon) = photons.iter().find(|photon| Vec3::from(photon.position) == nearest) else {
        return Ok(false);
    };
    let normal = exact_normal(&searcher.scene, &mut memory, photon, radius)?;
    let disc = Disc { centre: nearest, normal, radius };
    Ok(disc.surface_points(&searcher.scene, &mut memory, GROUP_POINTS)? == GROUP_POINTS)
}

/// How far above a photon rays start, metres: a little of the disc's radius, and more than the grid may have put the photon
/// below its surface.
fn lift(scene: &SceneImage, radius: f32) -> f32 {
    1e-3 * radius + scene.header.photon_grid.cell
}

/// A flat disc on a surface.
struct Disc {
    centre: Vec3,
    normal: Vec3,
    radius: f32,
}

impl Disc {
    /// Of `points` evenly spread points of the disc, those that are surface: seen from above the centre, with a normal
    /// near the disc's.
    fn surface_points(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        points: u32,
    ) -> Result<u32, Fault> {
        let (tangent, bitangent) = self.normal.any_orthonormal_pair();
        let surface = offset_origin(self.centre, self.normal, magnitude(&[self.centre]))
            + self.normal * lift(scene, self.radius);
        let above = surface + self.normal * self.clear_height(scene, memory, surface)?;
        let mut found = 0;
        for index in 0..points {
            // The sunflower spiral (Vogel 1979): equal areas, no two points in line.
            let distance = self.radius * ((index as f32 + 0.5) / points as f32).sqrt();
            let angle = index as f32 * 2.399_963_2;
            let offset =
                tangent * (distance * libm::cosf(angle)) + bitangent * (distance * libm::sinf(angle));
            let way = self.centre + offset - above;
            // As far again below the disc: a curved surface falls away from it.
            let ray = Ray { origin: above, direction: way.normalize(), max_distance: 2.0 * way.length() };
            if self.is_surface(scene, memory, &ray)? {
                found += 1;
            }
        }
        Ok(found)
    }

    /// A height above the centre with nothing in between: half the radius, or half of what is free.
    fn clear_height(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        surface: Vec3,
    ) -> Result<f32, Fault> {
        let ray = Ray { origin: surface, direction: self.normal, max_distance: self.radius };
        let free = closest_hit(scene, memory, &ray)?.map_or(self.radius, |hit| hit.intersection.distance);
        Ok(0.5 * free)
    }

    fn is_surface(&self, scene: &SceneImage, memory: &mut impl MemoryPort, ray: &Ray) -> Result<bool, Fault> {
        let Some(hit) = closest_hit(scene, memory, ray)? else { return Ok(false) };
        let surface = read_surface(scene, memory, ray, &hit)?;
        let is_near = surface.position.distance(self.centre) <= 1.05 * self.radius;
        Ok(is_near && surface.normal.dot(self.normal) >= MIN_NORMAL_COSINE)
    }
}
