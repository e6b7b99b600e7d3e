//! Disc fractions: the boundary correction of the density estimate.
//!
//! A gather divides by the area of a flat disc. But its search looks into a sphere, and finds the photons of all surfaces
//! there, of which those with about the same normal count. Near an edge or in a corner they are less than a disc, and the
//! estimate would be too dark: on a Cornell box by some 2 % of all indirect light. On steps, or between balusters, they
//! may be more, and it would be too bright. Here the area of that surface is measured once for every photon, for the
//! radius that a gather at the photon would have, along chords of the sphere ([`super::chords`]). A gather then divides
//! by that area ([`photoncard_firmware::photon`]).
//!
//! Most photons lie inside a large flat surface, and have a whole disc: such leaves are recognized by the triangles around
//! them. The photons of other leaves share a search for the radius, one for the triangles around them, and their chords.

use glam::Vec3;
use photoncard_firmware::photon::MIN_NORMAL_COSINE;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, magnitude, offset_origin};
use photoncard_firmware::simd::run;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{FULL_DISC, LEAF_PHOTONS, Photon, PhotonLeaf, decode_normal, encode_disc};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::ball::Ball;
use super::chords::{CHORDS, ChordFrame, Chords, Crossing, Crossings, FractionWithin, OpenSurfaces};
use super::rays::{Met, all_on_way, first_triangle};
use super::search::Searcher;
use super::sides::SideTable;
use super::surroundings::{PlainWall, Surroundings};
use crate::pack::CardImage;
use crate::photon::PhotonError;

/// Leaves that one task measures.
const LEAVES_PER_TASK: usize = 64;
/// Photons share chords along the normal of one of them if theirs is at least at this cosine to it.
const MIN_SHARED_COSINE: f32 = 0.85;
/// Height above a photon of the point that is inside of no solid, in radii, if there is room.
const OPEN_HEIGHT: f32 = 0.1;
/// Distance behind a triangle at which a ray goes on, in radii of the ball.
const STEP: f32 = 1e-5;

/// The codes of a leaf's photons.
type Codes = [u8; LEAF_PHOTONS];
/// Some of a leaf's photons.
type DiscPhotons = heapless::Vec<DiscPhoton, LEAF_PHOTONS>;

/// Measures the disc fraction of every photon for gathers of `neighbors` photons within `max_distance`, and writes it
/// into the image. `go_on` is asked now and then.
///
/// # Errors
/// If the image is not sound, or `go_on` says no.
pub(crate) fn measure_discs(
    image: &mut CardImage,
    neighbors: u32,
    max_distance: f32,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<(), PhotonError> {
    let leaves = image.section(SectionKind::PhotonLeaves).len();
    let sides = SideTable::new(image)?;
    let measured: Result<Vec<Vec<(usize, Codes)>>, PhotonError> = (0..leaves.div_ceil(LEAVES_PER_TASK))
        .into_par_iter()
        .map_init(
            || Meter::new(image, &sides, neighbors, max_distance),
            |meter, task| {
                if !go_on() {
                    return Err(PhotonError::Stopped);
                }
                let first = task * LEAVES_PER_TASK;
                Ok(meter.measure_leaves(first, (first + LEAVES_PER_TASK).min(leaves))?)
            },
        )
        .collect();
    let measured = measured?;
    let lines = image.section_mut(SectionKind::PhotonLeaves);
    for (leaf, codes) in measured.into_iter().flatten() {
        for (index, code) in (0..).zip(codes) {
            PhotonLeaf::set_disc(&mut lines[leaf].0, index, code);
        }
    }
    Ok(())
}

/// Measures discs.
struct Meter<'a> {
    image: &'a CardImage,
    sides: &'a SideTable,
    searcher: Searcher<'a>,
    surroundings: Surroundings,
    /// True if [`Self::surroundings`] holds all triangles of the ball.
    is_complete: bool,
    chords: Chords,
    crossings: Crossings,
    surfaces: OpenSurfaces,
}

/// A photon whose disc is measured.
#[derive(Clone, Copy)]
struct DiscPhoton {
    /// Its number in its leaf.
    photon: usize,
    position: Vec3,
    /// The code of its surface's normal.
    normal: u8,
}

impl DiscPhoton {
    /// The unit normal that the code stands for.
    fn coded_normal(&self) -> Vec3 {
        Vec3::from(decode_normal(self.normal)).normalize()
    }
}

/// Photons whose gathers have about one radius, metres.
struct Cluster {
    ball: Ball,
    radius: f32,
    /// The radius of the disc that the discs of all are in.
    outer: f32,
}

impl<'a> Meter<'a> {
    fn new(image: &'a CardImage, sides: &'a SideTable, neighbors: u32, max_distance: f32) -> Self {
        let searcher = Searcher::new(image, neighbors, max_distance);
        Self {
            image,
            sides,
            searcher,
            surroundings: Surroundings::default(),
            is_complete: false,
            chords: Chords::new(),
            crossings: Crossings::new(),
            surfaces: OpenSurfaces::default(),
        }
    }

    /// The codes of those leaves that have a photon whose disc is not whole.
    fn measure_leaves(&mut self, first: usize, end: usize) -> Result<Vec<(usize, Codes)>, Fault> {
        let grid = self.searcher.scene.header.photon_grid;
        let mut measured = Vec::new();
        for (index, line) in (first..end).zip(&self.image.section(SectionKind::PhotonLeaves)[first..end]) {
            let leaf = PhotonLeaf::read(&line.0);
            let photons: DiscPhotons = (0..leaf.photons())
                .map(|photon| {
                    let [.., low, high] = leaf.content(photon);
                    let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                    let position = grid.position(leaf.point(photon)).into();
                    DiscPhoton { photon: photon as usize, position, normal }
                })
                .collect();
            let fractions = self.measure(photons)?;
            let codes = codes(&fractions, index);
            if codes.iter().any(|&code| code != FULL_DISC) {
                measured.push((index, codes));
            }
        }
        Ok(measured)
    }

    /// The disc fractions of the photons of a leaf.
    fn measure(&mut self, mut photons: DiscPhotons) -> Result<[f32; LEAF_PHOTONS], Fault> {
        let mut fractions = [1.0; LEAF_PHOTONS];
        if self.is_plain(&photons, self.searcher.max_distance())? {
            return Ok(fractions);
        }
        while let Some(middle) = middle(&photons) {
            let radius = self.searcher.radius(middle.position)?.max(f32::MIN_POSITIVE);
            let cluster =
                split_off(&mut photons, |photon| photon.position.distance(middle.position) <= radius);
            if !self.is_plain(&cluster, radius)? {
                self.measure_cluster(cluster, middle, radius, &mut fractions)?;
            }
        }
        Ok(fractions)
    }

    /// True if the spheres around some photons hold nothing but the plane that all of them lie on.
    fn is_plain(&mut self, photons: &[DiscPhoton], radius: f32) -> Result<bool, Fault> {
        let Some(middle) = middle(photons) else { return Ok(true) };
        if photons.iter().any(|photon| photon.normal != middle.normal) {
            return Ok(false);
        }
        let places: heapless::Vec<Vec3, LEAF_PHOTONS> =
            photons.iter().map(|photon| photon.position).collect();
        let lift = self.lift(radius);
        let wall = PlainWall { normal: middle.normal, lift, places: &places };
        let outer = 1.001 * (radius + spread(photons, middle)) + lift;
        let ball = Ball { centre: middle.position, radius: outer };
        let Searcher { scene, memory, .. } = &self.searcher;
        self.surroundings.is_plain(scene, *memory, self.sides, ball, wall)
    }

    /// The disc fractions of photons within a radius of one of them, which is that of their gathers.
    fn measure_cluster(
        &mut self,
        mut photons: DiscPhotons,
        middle: DiscPhoton,
        radius: f32,
        fractions: &mut [f32; LEAF_PHOTONS],
    ) -> Result<(), Fault> {
        let spread = spread(&photons, middle);
        let outer = radius + spread;
        // The ways from the open point are in the ball as well.
        // In double precision the squares of no two lengths are too large.
        let [across, along] = [outer, spread + OPEN_HEIGHT * radius].map(f64::from);
        let reach = (across * across + along * along).sqrt() as f32;
        let ball = Ball { centre: middle.position, radius: 1.001 * reach + 2.0 * self.lift(radius) };
        let cluster = Cluster { ball, radius, outer };
        let Searcher { scene, memory, .. } = &self.searcher;
        self.is_complete = self.surroundings.find(scene, *memory, self.sides, ball)?;
        while let Some(nearest) = nearest(&photons, middle.position) {
            let frame = self.frame(&nearest, &cluster)?;
            let [.., along] = frame.axes;
            let group = split_off(&mut photons, |photon| {
                photon.photon == nearest.photon || photon.coded_normal().dot(along) >= MIN_SHARED_COSINE
            });
            self.measure_group(&group, &frame, &cluster, fractions)?;
        }
        Ok(())
    }

    /// The disc fractions of photons of about one normal.
    fn measure_group(
        &mut self,
        group: &[DiscPhoton],
        frame: &ChordFrame,
        cluster: &Cluster,
        fractions: &mut [f32; LEAF_PHOTONS],
    ) -> Result<(), Fault> {
        let Cluster { ball, radius, outer } = *cluster;
        let chords = self.chords.scaled(outer / ball.radius);
        if self.is_complete {
            self.surroundings.cross(frame, &chords, &mut self.crossings);
        } else {
            self.cross_by_rays(frame, &chords, ball)?;
        }
        let sides = self.sides;
        self.crossings.open_surfaces(&chords, |triangle| sides.of(triangle), &mut self.surfaces);
        let lift = self.lift(radius) / ball.radius;
        let mut chosen = None;
        for photon in group {
            if chosen.replace(photon.normal) != Some(photon.normal) {
                self.surfaces.choose(photon.normal);
            }
            let centre = frame.along((photon.position - ball.centre) / ball.radius);
            let radius = radius / ball.radius;
            let within = FractionWithin { chords: &chords, surfaces: &self.surfaces, centre, radius, lift };
            fractions[photon.photon] = run(within);
        }
        Ok(())
    }

    /// A frame along the normal of a photon, and a point above it with nothing in between: some of the radius, or half of
    /// what is free.
    fn frame(&self, photon: &DiscPhoton, cluster: &Cluster) -> Result<ChordFrame, Fault> {
        let Cluster { ball, radius, .. } = *cluster;
        let normal = self.exact_normal(photon, radius)?;
        let tangent = normal.any_orthonormal_vector();
        let surface = offset_origin(photon.position, normal, magnitude(&[photon.position]))
            + normal * self.lift(radius);
        let height = 2.0 * OPEN_HEIGHT * radius;
        let free = self.first_on_way(surface, normal, height)?.map_or(height, |(distance, _)| distance);
        let open = surface + normal * (0.5 * free);
        let frame = ChordFrame { axes: [tangent, normal.cross(tangent), normal], open: Vec3::ZERO };
        Ok(ChordFrame { open: frame.along((open - ball.centre) / ball.radius), ..frame })
    }

    /// The normal of the surface that a photon lies on, which a short ray finds again; its code is rough.
    fn exact_normal(&self, photon: &DiscPhoton, radius: f32) -> Result<Vec3, Fault> {
        let coded = photon.coded_normal();
        let above =
            offset_origin(photon.position, coded, magnitude(&[photon.position])) + coded * self.lift(radius);
        let found = self.first_on_way(above, -coded, radius)?.map(|(_, normal)| normal);
        Ok(found.filter(|normal| normal.dot(coded) >= MIN_NORMAL_COSINE).unwrap_or(coded))
    }

    /// Height above a photon at which rays start, metres: a little of the disc's radius, and more than the grid may have put the photon
    /// below its surface.
    fn lift(&self, radius: f32) -> f32 {
        1e-3 * radius + self.searcher.scene.header.photon_grid.cell
    }

    /// The first surface on the way from a place along a unit vector: its distance, and its normal on the side of the place.
    fn first_on_way(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
    ) -> Result<Option<(f32, Vec3)>, Fault> {
        if self.is_complete {
            return Ok(self.surroundings.first_on_way(origin, direction, max_distance));
        }
        let ray = Ray { origin, direction, max_distance };
        let Searcher { scene, memory, .. } = &self.searcher;
        Ok(first_triangle(scene, *memory, &ray)?.map(|Met { distance, normal, .. }| {
            (distance, if normal.dot(direction) > 0.0 { -normal } else { normal })
        }))
    }

    /// [`Surroundings::cross`] by rays, where there are too many triangles to list.
    fn cross_by_rays(&mut self, frame: &ChordFrame, chords: &Chords, ball: Ball) -> Result<(), Fault> {
        self.crossings.clear(frame.open.z);
        let Searcher { scene, memory, .. } = &self.searcher;
        let step = STEP * ball.radius;
        let [tangent, bitangent, normal] = frame.axes;
        let place =
            |x: f32, y: f32, z: f32| ball.centre + (tangent * x + bitangent * y + normal * z) * ball.radius;
        let open = place(frame.open.x, frame.open.y, frame.open.z);
        for chord in 0..CHORDS {
            let [x, y] = chords.point(chord);
            let half = (1.0 - x * x - y * y).max(0.0).sqrt();
            for met in all_on_way(scene, *memory, [place(x, y, half), place(x, y, -half)], step)? {
                let height = half - met.distance / ball.radius;
                let cosine = met.normal.dot(normal);
                let crossing = Crossing::new(chord, height, cosine > 0.0, met.triangle, cosine.abs().recip());
                self.crossings.list.push(crossing);
            }
            let way = place(x, y, frame.open.z) - open;
            let mut depth = 0;
            for met in all_on_way(scene, *memory, [open, open + way], step)? {
                let change = if met.normal.dot(way) < 0.0 { 1 } else { -1 };
                depth += if self.sides.of(met.triangle).is_solid { change } else { 0 };
            }
            self.crossings.set_depth(chord, depth);
        }
        Ok(())
    }
}

/// The photon nearest to the mean of some: on a curved surface the mean is off it.
fn middle(photons: &[DiscPhoton]) -> Option<DiscPhoton> {
    nearest(photons, photons.iter().map(|photon| photon.position).sum::<Vec3>() / photons.len() as f32)
}

fn nearest(photons: &[DiscPhoton], to: Vec3) -> Option<DiscPhoton> {
    let distance = |photon: &&DiscPhoton| photon.position.distance_squared(to);
    photons.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}

/// The distance of the farthest of some photons from one of them, metres.
fn spread(photons: &[DiscPhoton], middle: DiscPhoton) -> f32 {
    photons.iter().map(|photon| photon.position.distance(middle.position)).fold(0.0, f32::max)
}

/// Takes those photons away that are chosen.
fn split_off(photons: &mut DiscPhotons, is_chosen: impl Fn(&DiscPhoton) -> bool) -> DiscPhotons {
    let chosen = photons.iter().filter(|photon| is_chosen(photon)).copied().collect();
    photons.retain(|photon| !is_chosen(photon));
    chosen
}

/// The codes of a leaf's fractions. The dithers of its photons are spread evenly, so that what rounding does to one is made
/// up for by its neighbours.
fn codes(fractions: &[f32; LEAF_PHOTONS], leaf: usize) -> Codes {
    const GOLDEN_RATIO: u32 = 0x9e37_79b9;
    let first = hash(leaf as u32);
    let mut photon = 0_u32;
    fractions.map(|fraction| {
        let dither = first.wrapping_add(photon.wrapping_mul(GOLDEN_RATIO));
        photon += 1;
        encode_disc(fraction, (dither >> 8) as f32 * (1.0 / 16_777_216.0))
    })
}

#[cfg(test)]
mod tests;
