//! How much of the disc around a photon is surface: the boundary correction of the density estimate.
//!
//! A gather divides by the area of a flat disc. Near an edge or in a corner part of that disc is no surface, the area is
//! too large and the estimate too dark: on a Cornell box by some 2 % of all indirect light. Here, for every photon, the
//! part that is surface is measured once, with short rays, for the radius that a gather at the photon would have. A
//! gather then divides by that part of the area ([`photoncard_firmware::photon`]).
//!
//! Most photons lie inside a large flat surface. They are found a leaf at a time, by one test of a disc that holds the discs
//! of all its photons; only the others are measured one by one. The photons of a leaf share a search for the radius, and a
//! search for the triangles around them.

use glam::Vec3;
use photoncard_firmware::photon::MIN_NORMAL_COSINE;
use photoncard_firmware::scene::{Ray, closest_hit, magnitude, offset_origin, read_surface};
use photoncard_firmware::simd::LANES;
use photoncard_shared::layout::{FULL_DISC, LEAF_PHOTONS, Photon, PhotonLeaf, decode_normal};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::PhotonError;
use super::search::Searcher;
use super::surroundings::{DiscView, PointLanes, Surroundings};
use crate::pack::CardImage;

/// Points tested on the disc of one photon, in lanes.
const POINT_LANES: usize = 2;
const POINTS: usize = POINT_LANES * LANES;
/// Points tested on the disc of a leaf, in lanes.
const LEAF_POINT_LANES: usize = 4;
/// Leaves that one task measures.
const LEAVES_PER_TASK: usize = 64;
/// How far from the centre, in radii, a point may be and still count: of a curved surface, or next to the rim.
const REACH: f32 = 1.05;

/// Evenly spread points of a disc of radius 1, each lot of them as well: the sunflower spiral (Vogel 1979), equal areas, no
/// two points in line.
fn spiral<const N: usize>() -> [PointLanes; N] {
    let mut lanes = [[[0.0; LANES]; 2]; N];
    let points = N * LANES;
    for index in 0..points {
        let distance = ((index as f32 + 0.5) / points as f32).sqrt();
        let angle = index as f32 * 2.399_963_2;
        let [x, y] = &mut lanes[index % N];
        (x[index / N], y[index / N]) = (distance * libm::cosf(angle), distance * libm::sinf(angle));
    }
    lanes
}

/// The codes of a leaf's photons.
type Codes = [u8; LEAF_PHOTONS];

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
    let leaves = image.leaf_lines().len();
    let measured: Result<Vec<Vec<(usize, Codes)>>, PhotonError> = (0..leaves.div_ceil(LEAVES_PER_TASK))
        .into_par_iter()
        .map_init(
            || Meter::new(image, neighbors, max_distance),
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
    let lines = image.leaf_lines_mut();
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
    searcher: Searcher<'a>,
    surroundings: Surroundings,
    /// Whether [`Self::surroundings`] holds all triangles that matter.
    is_complete: bool,
    points: [PointLanes; POINT_LANES],
    leaf_points: [PointLanes; LEAF_POINT_LANES],
}

/// What is asked of a photon.
#[derive(Clone, Copy)]
struct Place {
    position: Vec3,
    /// The code of its surface's normal.
    normal: u8,
}

impl<'a> Meter<'a> {
    fn new(image: &'a CardImage, neighbors: u32, max_distance: f32) -> Self {
        let searcher = Searcher::new(image, neighbors, max_distance);
        Self {
            image,
            searcher,
            surroundings: Surroundings::default(),
            is_complete: false,
            points: spiral(),
            leaf_points: spiral(),
        }
    }

    /// The codes of those leaves that have a photon whose disc is not whole.
    fn measure_leaves(&mut self, first: usize, end: usize) -> Result<Vec<(usize, Codes)>, Fault> {
        let grid = self.searcher.scene.header.photon_grid;
        let mut measured = Vec::new();
        for (index, line) in (first..end).zip(&self.image.leaf_lines()[first..end]) {
            let leaf = PhotonLeaf::read(&line.0);
            let photons: heapless::Vec<Place, LEAF_PHOTONS> = (0..leaf.photons())
                .map(|photon| {
                    let [.., low, high] = leaf.content(photon);
                    let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                    Place { position: grid.position(leaf.point(photon)).into(), normal }
                })
                .collect();
            measured.extend(self.measure(&photons)?.map(|codes| (index, codes)));
        }
        Ok(measured)
    }

    /// The codes of the photons of a leaf; `None` if all of their discs are whole.
    fn measure(&mut self, photons: &[Place]) -> Result<Option<Codes>, Fault> {
        let centre = photons.iter().map(|photon| photon.position).sum::<Vec3>() / photons.len() as f32;
        // The centre of photons on a curved surface is off it: the test is made from the nearest of them.
        let distance = |photon: &&Place| photon.position.distance_squared(centre);
        let Some(nearest) = photons.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
            return Ok(None);
        };
        let from_nearest = |photon: &Place| photon.position.distance(nearest.position);
        let spread = photons.iter().map(from_nearest).fold(0.0, f32::max);
        let radius = self.searcher.radius(nearest.position)?.max(f32::MIN_POSITIVE);
        // From one photon to another the radius of a gather grows by their distance at the most.
        let outer = spread + (radius + spread).min(self.searcher.max_distance());
        // As far as points count, and what the start of rays may be off by.
        let ball = 1.01 * REACH * outer + self.lift(outer);
        let Searcher { scene, memory, .. } = &self.searcher;
        self.is_complete = self.surroundings.find(scene, *memory, nearest.position, ball)?;
        if photons.iter().all(|photon| photon.normal == nearest.normal)
            && self.is_whole(&self.view(nearest, outer)?)?
        {
            return Ok(None);
        }
        let mut codes = [FULL_DISC; LEAF_PHOTONS];
        for (code, photon) in codes.iter_mut().zip(photons) {
            // The photon is on a surface: there is never none.
            let points = self.visible_points(&self.view(photon, radius)?, &self.points)?.max(1);
            *code = (points * (u32::from(FULL_DISC) + 1) / POINTS as u32 - 1) as u8;
        }
        Ok(codes.iter().any(|&code| code != FULL_DISC).then_some(codes))
    }

    /// The disc around a photon, seen from above it.
    fn view(&self, photon: &Place, radius: f32) -> Result<DiscView, Fault> {
        let centre = photon.position;
        let normal = self.exact_normal(photon, radius)?;
        let surface = offset_origin(centre, normal, magnitude(&[centre])) + normal * self.lift(radius);
        // A height with nothing in between: half the radius, or half of what is free.
        let free = self.first_on_way(surface, normal, radius)?.map_or(radius, |(distance, _)| distance);
        let above = surface + normal * (0.5 * free);
        Ok(DiscView { centre, normal, radius, above, reach: REACH * radius, least_cosine: MIN_NORMAL_COSINE })
    }

    /// Whether all of a disc is surface.
    fn is_whole(&self, disc: &DiscView) -> Result<bool, Fault> {
        for points in &self.leaf_points {
            if (self.visible_points(disc, std::array::from_ref(points))? as usize) < LANES {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Of points of a disc, those that are surface: that are seen from above, with a normal near the disc's.
    fn visible_points<const N: usize>(
        &self,
        disc: &DiscView,
        points: &[PointLanes; N],
    ) -> Result<u32, Fault> {
        if self.is_complete {
            return Ok(self.surroundings.visible_points(disc, points));
        }
        self.visible_points_by_rays(disc, points)
    }

    /// The normal of the surface that a photon lies on, which a short ray finds again; its code is rough.
    fn exact_normal(&self, photon: &Place, radius: f32) -> Result<Vec3, Fault> {
        let coded = Vec3::from(decode_normal(photon.normal)).normalize();
        let above =
            offset_origin(photon.position, coded, magnitude(&[photon.position])) + coded * self.lift(radius);
        let found = self.first_on_way(above, -coded, radius)?.map(|(_, normal)| normal);
        Ok(found.filter(|normal| normal.dot(coded) >= MIN_NORMAL_COSINE).unwrap_or(coded))
    }

    /// How far above a photon rays start, metres: a little of the disc's radius, and more than the grid may have put the photon
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
        let (scene, mut memory) = (&self.searcher.scene, self.searcher.memory);
        let ray = Ray { origin, direction, max_distance };
        let Some(hit) = closest_hit(scene, &mut memory, &ray)? else { return Ok(None) };
        let normal = read_surface(scene, &mut memory, &ray, &hit)?.normal;
        Ok(Some((hit.intersection.distance, normal)))
    }

    /// The same as [`Surroundings::visible_points`], where there are too many triangles to test them all.
    fn visible_points_by_rays(&self, disc: &DiscView, points: &[PointLanes]) -> Result<u32, Fault> {
        let (tangent, bitangent) = disc.normal.any_orthonormal_pair();
        let mut visible = 0;
        for [x, y] in points {
            for (x, y) in x.iter().zip(y) {
                let way = disc.centre + (tangent * *x + bitangent * *y) * disc.radius - disc.above;
                // As far again below the disc: a curved surface falls away from it.
                let (direction, length) = (way.normalize(), way.length());
                let Some((distance, normal)) = self.first_on_way(disc.above, direction, 2.0 * length)? else {
                    continue;
                };
                let end = disc.above + direction * distance;
                let is_near = end.distance(disc.centre) <= disc.reach;
                visible += u32::from(is_near && normal.dot(disc.normal) >= disc.least_cosine);
            }
        }
        Ok(visible)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emitter::Emitters;
    use crate::pack::PackedScene;
    use crate::photon::trace;
    use crate::scene::gltf;

    /// In rooms and on curved columns: what is tested against a list of triangles is what rays find.
    #[test]
    fn the_triangles_around_a_photon_show_what_rays_show() {
        for (name, photons) in [("cornell.gltf", 3000), ("atrium.glb", 10_000)] {
            let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
            let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
            let packed = PackedScene::new(&scene, &Emitters::new(&scene)).expect("packs");
            let photons = trace(&packed, 1, photons, &|_| true).expect("it is lit").photons;
            let image = packed.with_photons(photons, 20).expect("packs");
            let mut meter = Meter::new(&image, 20, f32::MAX.sqrt() * 0.5);
            let grid = meter.searcher.scene.header.photon_grid;
            let (mut discs, mut cut, mut differences, mut far) = (0, 0, 0, 0);
            for line in image.leaf_lines() {
                let leaf = PhotonLeaf::read(&line.0);
                let [.., low, high] = leaf.content(0);
                let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                let place = Place { position: grid.position(leaf.point(0)).into(), normal };
                let radius = meter.searcher.radius(place.position).expect("sound");
                let Meter { searcher, surroundings, .. } = &mut meter;
                let ball = 1.1 * REACH * radius + grid.cell;
                if !surroundings.find(&searcher.scene, searcher.memory, place.position, ball).expect("sound")
                {
                    continue;
                }
                meter.is_complete = false;
                let by_rays = meter.view(&place, radius).expect("sound");
                let expected = meter.visible_points_by_rays(&by_rays, &meter.points).expect("sound");
                meter.is_complete = true;
                let by_list = meter.view(&place, radius).expect("sound");
                let found = meter.visible_points(&by_list, &meter.points).expect("sound");
                discs += 1;
                cut += u32::from(expected < POINTS as u32);
                differences += found.abs_diff(expected);
                far += u32::from(found.abs_diff(expected) > 2);
            }
            println!(
                "{name}: {discs} discs, {cut} not whole, {differences} points differ, {far} by more than 2"
            );
            assert!(discs > 200 && cut * 5 > discs, "{cut} of {discs} discs are not whole");
            assert!(
                differences * 50 < discs && far * 500 <= discs,
                "{differences} points of {discs}, {far} far"
            );
        }
    }
}
